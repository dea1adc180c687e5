# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulated robot that moves along sine waves, its monitor and, by `view:=true`, the page."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = {
    "namespace": "",
    "params_file": "",
    "robot_description": "",
    "motion": "wave",
    "view": "false",
    "log_level": "info",
}


def start(context):
    """Return the nodes for the values of the arguments."""
    given = context.launch_configurations
    files = [given["params_file"]] if given["params_file"] else []
    common = {
        "package": "diag_dynamics",
        "namespace": given["namespace"],
        "arguments": ["--ros-args", "--log-level", given["log_level"]],
        "output": "both",
    }
    robot = {"robot_description": ParameterValue(given["robot_description"], value_type=str)}
    simulated = (robot if given["robot_description"] else {}) | {"motion": given["motion"]}
    nodes = [
        Node(executable="simulator", name="diag_dynamics_simulator", parameters=[*files, simulated], **common),
        Node(executable="monitor", name="diag_dynamics", parameters=files, **common),
    ]
    if given["view"] == "true":
        nodes.append(Node(executable="view", name="diag_dynamics_view", parameters=files, **common))
    return nodes


def generate_launch_description():
    """Declare the arguments; without a value that of params_file or of the node holds."""
    declared = [DeclareLaunchArgument(name, default_value=value) for name, value in ARGUMENTS.items()]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
