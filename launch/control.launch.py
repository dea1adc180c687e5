# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulated robot, its controller and its monitor, which all go by the simulator's time."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = {
    "namespace": "",
    "params_file": "",
    "robot_description": "",
    "robot_compensates_gravity": "false",
    "autostart": "true",
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
    compensates = given["robot_compensates_gravity"] == "true"
    simulated = {
        "compensates_gravity": compensates,
        "publish_clock": True,
        "without_command": "brake",  # brakes hold the robot before the first command and after the last one
        "command_timeout": 0.5,
    }
    if given["robot_description"]:
        simulated["robot_description"] = ParameterValue(given["robot_description"], value_type=str)
    time = {"use_sim_time": True}
    control = time | {
        "robot_compensates_gravity": compensates,
        "autostart": given["autostart"] == "true",
        "check_time": 0.0,  # the simulator has no parameter `joints`
    }
    nodes = [
        Node(executable="simulator", name="diag_dynamics_simulator", parameters=[*files, simulated], **common),
        Node(executable="controller", name="diag_dynamics_controller", parameters=[*files, control], **common),
        Node(executable="monitor", name="diag_dynamics", parameters=[*files, time], **common),
    ]
    if given["view"] == "true":
        nodes.append(Node(executable="view", name="diag_dynamics_view", parameters=[*files, time], **common))
    return nodes


def generate_launch_description():
    """Declare the arguments; without a value that of params_file or of the node holds."""
    declared = [DeclareLaunchArgument(name, default_value=value) for name, value in ARGUMENTS.items()]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
