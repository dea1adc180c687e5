# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start the monitor of a robot; `view:=true` starts its page, too."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PARAMETERS = {
    "robot_description": (str, "URDF, or the path of one. Empty: the topic robot_description."),
    "use_sim_time": (bool, "Whether the nodes use /clock."),
}
"""Parameters of the monitor as arguments: type and description. If empty, params_file or the node determines them."""

COMMON = {
    "namespace": "Namespace of the node.",
    "params_file": "YAML file of parameters.",
}
"""Other arguments, and their descriptions."""


def start(context):
    """Return the nodes for the values of the arguments."""
    given = context.launch_configurations
    parameters = {
        name: ParameterValue(given[name], value_type=kind)
        for name, (kind, _) in PARAMETERS.items()
        if given[name]
    }
    common = {
        "package": "diag_dynamics",
        "namespace": given["namespace"],
        "arguments": ["--ros-args", "--log-level", given["log_level"]],
        "output": "both",
    }
    files = [given["params_file"]] if given["params_file"] else []
    nodes = [
        Node(executable="monitor", name="diag_dynamics", parameters=[*files, parameters], **common)
    ]
    if given["view"] == "true":
        time = {name: value for name, value in parameters.items() if name == "use_sim_time"}
        nodes.append(
            Node(executable="view", name="diag_dynamics_view", parameters=[*files, time], **common)
        )
    return nodes


def generate_launch_description():
    """Declare the arguments, and start the nodes."""
    declared = [
        DeclareLaunchArgument(name, default_value="", description=text)
        for name, text in (COMMON | {name: text for name, (_, text) in PARAMETERS.items()}).items()
    ]
    view = DeclareLaunchArgument(
        "view", default_value="false", description="Whether the page is served, too."
    )
    log_level = DeclareLaunchArgument(
        "log_level", default_value="info", description="Log level of the nodes."
    )
    return LaunchDescription([*declared, view, log_level, OpaqueFunction(function=start)])
