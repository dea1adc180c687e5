# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start a simulated robot."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PARAMETERS = {
    "robot_description": (str, "Required: URDF, or the path of one."),
    "motion": (str, "free: by commands and wrenches; wave: sine waves about mid-range."),
    "without_command": (str, "Drives without a command: zero effort (zero) or brakes (brake)."),
    "command_timeout": (float, "Simulated time after which a command expires [s]; 0: never."),
    "compensates_gravity": (bool, "Whether the simulated drives compensate gravity."),
}
"""Parameters of the simulator as arguments: type and description. If empty, params_file or the node determines them."""

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
            executable="simulator",
            name="diag_dynamics_simulator",
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
