# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start a simulated robot that moves along sine waves, and its monitor; `view:=true` starts the page, too."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource


def include(name, **arguments):
    """Return the action that includes a launch file; its arguments hold for later files, too."""
    path = str(Path(__file__).with_name(f"{name}.launch.py"))
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(path), launch_arguments=arguments.items()
    )


def generate_launch_description():
    """Include the simulator and the monitor, which declare all other arguments."""
    motion = DeclareLaunchArgument(
        "motion", default_value="wave", description="Motion of the robot: wave or free."
    )
    return LaunchDescription(
        [motion, include("simulator"), include("monitor", robot_description="")]
    )
