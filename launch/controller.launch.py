# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller of a robot."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = {
    "namespace": "",
    "params_file": "",
    "robot_description": "",
    "robot_compensates_gravity": "",
    "autostart": "",
    "use_sim_time": "",
    "log_level": "info",
}


def start(context):
    """Return the node for the values of the arguments."""
    given = context.launch_configurations
    files = [given["params_file"]] if given["params_file"] else []
    common = {
        "package": "diag_dynamics",
        "namespace": given["namespace"],
        "arguments": ["--ros-args", "--log-level", given["log_level"]],
        "output": "both",
    }
    flags = ("robot_compensates_gravity", "autostart", "use_sim_time")
    parameters = {key: given[key] == "true" for key in flags if given[key]}
    if given["robot_description"]:
        parameters["robot_description"] = ParameterValue(given["robot_description"], value_type=str)
    return [Node(executable="controller", name="diag_dynamics_controller", parameters=[*files, parameters], **common)]


def generate_launch_description():
    """Declare the arguments; without a value that of params_file or of the node holds."""
    declared = [DeclareLaunchArgument(name, default_value=value) for name, value in ARGUMENTS.items()]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
