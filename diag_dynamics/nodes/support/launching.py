# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the launch files do with `launch`, for which only they are: see :mod:`~diag_dynamics.nodes.support.launches`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.logging import get_logger
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, TextSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from diag_dynamics.nodes.support.launches import LAUNCHES, arguments_of, misspelt, started


def launched(name):
    """The LaunchDescription of one of :data:`~diag_dynamics.nodes.support.launches.LAUNCHES`."""
    launch = LAUNCHES[name]
    arguments = arguments_of(launch)

    def start(context):
        for text in misspelt(launch, context.launch_configurations):
            get_logger("diag_dynamics").warning(text)
        values = {argument: LaunchConfiguration(argument).perform(context) for argument in arguments}
        return [action_of(node) for node in started(launch, values)]

    declared = [
        DeclareLaunchArgument(argument, default_value=default, description=text)
        for argument, (default, text) in arguments.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])


def action_of(node):
    """The action of `launch` that starts a node, from what :class:`~diag_dynamics.nodes.support.launches.Started` says."""
    own = PathJoinSubstitution([FindPackageShare("diag_dynamics"), "config", f"{node.executable}.yaml"])
    # With its type, lest an XML be parsed as YAML, or a link 1 be a number.
    parameters = {
        name: ParameterValue(TextSubstitution(text=text), value_type=kind)
        for name, (kind, text) in node.parameters.items()
    }
    return Node(
        package="diag_dynamics",
        executable=node.executable,
        name=node.name,  # its own; without it a section of that name in params_file beats what is given
        namespace=node.namespace,
        parameters=[node.params_file or own, *([parameters] if parameters else [])],
        remappings=list(node.remappings.items()),
        output="both",
    )
