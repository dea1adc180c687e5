# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller of a robot."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PARAMETERS = {
    "robot_description": str,
    "robot_compensates_gravity": bool,
    "autostart": bool,
    "check_time": float,
    "use_sim_time": bool,
}
"""Arguments that are parameters of the node; without a value that of params_file or of the node holds."""


def start(context):
    """Return the node for the values of the arguments."""
    given = context.launch_configurations
    parameters = {
        name: ParameterValue(given[name], value_type=kind) for name, kind in PARAMETERS.items() if given[name]
    }
    return [
        Node(
            package="diag_dynamics",
            executable="controller",
            name="diag_dynamics_controller",
            namespace=given["namespace"],
            parameters=[*([given["params_file"]] if given["params_file"] else []), parameters],
            arguments=["--ros-args", "--log-level", given["log_level"]],
            output="both",
        )
    ]


def generate_launch_description():
    """Declare the arguments, and start the node."""
    declared = [DeclareLaunchArgument(name, default_value="") for name in ("namespace", "params_file", *PARAMETERS)]
    log_level = DeclareLaunchArgument("log_level", default_value="info")
    return LaunchDescription([*declared, log_level, OpaqueFunction(function=start)])
