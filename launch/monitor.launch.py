# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor of a robot; `view:=true` serves its page, too."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = {
    "namespace": "",
    "params_file": "",
    "robot_description": "",
    "use_sim_time": "",
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
    time = {"use_sim_time": given["use_sim_time"] == "true"} if given["use_sim_time"] else {}
    robot = {"robot_description": ParameterValue(given["robot_description"], value_type=str)}
    robot = robot if given["robot_description"] else {}  # else that of the topic
    nodes = [Node(executable="monitor", name="diag_dynamics", parameters=[*files, time | robot], **common)]
    if given["view"] == "true":
        nodes.append(Node(executable="view", name="diag_dynamics_view", parameters=[*files, time], **common))
    return nodes


def generate_launch_description():
    """Declare the arguments; without a value that of params_file or of the node holds."""
    declared = [DeclareLaunchArgument(name, default_value=value) for name, value in ARGUMENTS.items()]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
