# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulated robot that moves along sine waves, its monitor and, by `view:=true`, the page."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource


def include(name, **arguments):
    """Return the action that starts a node; `arguments` hold for the files included after it, too."""
    path = str(Path(__file__).with_name(f"{name}.launch.py"))
    return IncludeLaunchDescription(PythonLaunchDescriptionSource(path), launch_arguments=arguments.items())


def generate_launch_description():
    """Include the simulator and the monitor, which declare all other arguments."""
    motion = DeclareLaunchArgument("motion", default_value="wave")
    return LaunchDescription([motion, include("simulator"), include("monitor", robot_description="")])
