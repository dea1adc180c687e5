# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start a simulated robot, its controller and its monitor."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration


def include(name, **arguments):
    """Return the action that includes a launch file; its arguments hold for later files, too."""
    path = str(Path(__file__).with_name(f"{name}.launch.py"))
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(path), launch_arguments=arguments.items()
    )


def generate_launch_description():
    """Include the nodes, which declare all other arguments; the robot comes from the simulator."""
    compensates = DeclareLaunchArgument(
        "robot_compensates_gravity",
        default_value="false",
        description="Whether the simulated robot compensates gravity.",
    )
    autostart = DeclareLaunchArgument(
        "autostart",
        default_value="true",
        description="Whether the controller configures and activates itself.",
    )
    simulator = include(
        "simulator",
        compensates_gravity=LaunchConfiguration("robot_compensates_gravity"),
        without_command="brake",  # brakes hold the robot before the first command and after the last one
        command_timeout="0.5",
    )
    controller = include("controller", robot_description="")
    return LaunchDescription([compensates, autostart, simulator, controller, include("monitor")])
