# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start the controller of a robot."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PARAMETERS = {
    "robot_description": (str, "URDF, or the path of one. Empty: the topic robot_description."),
    "robot_compensates_gravity": (
        bool,
        "Required: whether the robot adds gravity compensation to efforts.",
    ),
    "autostart": (bool, "Whether the node configures and activates itself."),
    "use_sim_time": (bool, "Whether the node uses /clock."),
}
"""Parameters of the controller as arguments: type and description. If empty, params_file or the node determines them."""

COMMON = {
    "namespace": "Namespace of the node.",
    "params_file": "YAML file of parameters.",
}
"""Other arguments, and their descriptions."""


def start(context):
    """Return the node for the values of the arguments."""
    given = context.launch_configurations
    parameters = {
        name: ParameterValue(given[name], value_type=kind)
        for name, (kind, _) in PARAMETERS.items()
        if given[name]
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
    declared = [
        DeclareLaunchArgument(name, default_value="", description=text)
        for name, text in (COMMON | {name: text for name, (_, text) in PARAMETERS.items()}).items()
    ]
    log_level = DeclareLaunchArgument(
        "log_level", default_value="info", description="Log level of the node."
    )
    return LaunchDescription([*declared, log_level, OpaqueFunction(function=start)])
