# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor of a robot; `view:=true` serves its page, too."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PARAMETERS = {
    "robot_description": str,
    "use_sim_time": bool,
}
"""Arguments that are parameters of the monitor; without a value that of params_file or of the node holds."""


def start(context):
    """Return the nodes for the values of the arguments."""
    given = context.launch_configurations
    parameters = {
        name: ParameterValue(given[name], value_type=kind) for name, kind in PARAMETERS.items() if given[name]
    }
    common = {
        "package": "diag_dynamics",
        "namespace": given["namespace"],
        "arguments": ["--ros-args", "--log-level", given["log_level"]],
        "output": "both",
    }
    files = [given["params_file"]] if given["params_file"] else []
    nodes = [Node(executable="monitor", name="diag_dynamics", parameters=[*files, parameters], **common)]
    if given["view"] == "true":
        time = {name: value for name, value in parameters.items() if name == "use_sim_time"}
        nodes.append(Node(executable="view", name="diag_dynamics_view", parameters=[*files, time], **common))
    return nodes


def generate_launch_description():
    """Declare the arguments, and start the nodes."""
    declared = [DeclareLaunchArgument(name, default_value="") for name in ("namespace", "params_file", *PARAMETERS)]
    defaults = {"view": "false", "log_level": "info"}
    declared += [DeclareLaunchArgument(name, default_value=value) for name, value in defaults.items()]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
