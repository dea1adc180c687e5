# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start ros2_control, its controllers and the controller node, then activate effort_controller.

Each step waits for the one before: the arm has gravity torque before effort_controller takes it.
The robot's own launch file publishes robot_description.
"""

import os
from pathlib import Path

from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    ExecuteProcess,
    OpaqueFunction,
    RegisterEventHandler,
)
from launch.conditions import IfCondition
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch_ros.actions import Node

ARGUMENTS = {
    "namespace": ("", "Namespace of all nodes."),
    "params_file": (
        str(Path(__file__).parents[1] / "config" / "effort_controllers.yaml"),
        "YAML file of parameters of all nodes.",
    ),
    "activate": ("true", "Whether effort_controller is activated in the end, once."),
    "log_level": ("info", "Log level of the controller node."),
    "prefix": ("", "Command before controller_manager and the node, such as `chrt -f 40`."),
}
"""Arguments: default and description."""

TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
"""By Fast DDS's shared memory a publication may wait 0.33 s for another process."""


def start(context):
    """Return controller_manager, the spawners, and handlers that start what follows them."""
    arguments = context.launch_configurations
    namespace, files = arguments["namespace"], [arguments["params_file"]]
    common = {"namespace": namespace, "output": "both"}
    transports = {TRANSPORTS: os.environ.get(TRANSPORTS, "UDPv4")}
    timely = common | {"prefix": arguments["prefix"], "additional_env": transports}

    def spawner(*words):
        return Node(
            package="controller_manager",
            executable="spawner",
            arguments=[*words, "--controller-manager-timeout", "30"],
            **common,
        )

    def after(process, action, condition=None):
        """Return the handler that starts an action after a process; its error ends the launch."""

        def on_exit(event, _):
            return EmitEvent(event=Shutdown(reason="a step failed")) if event.returncode else action

        handler = OnProcessExit(target_action=process, on_exit=on_exit)
        return RegisterEventHandler(handler, condition=condition)

    manager = Node(
        package="controller_manager", executable="ros2_control_node", parameters=files, **timely
    )
    states = spawner("joint_state_broadcaster")
    efforts = spawner("effort_controller", "--inactive")
    controller = Node(
        package="diag_dynamics",
        executable="controller",
        name="diag_dynamics_controller",
        parameters=[*files, {"autostart": True}],
        arguments=["--ros-args", "--log-level", arguments["log_level"]],
        **timely,
    )
    # A lifecycle event is published once and may be lost. A command follows each joint state.
    root = Path("/", namespace)
    options = ["--once", "--qos-reliability", "best_effort"]
    topic = [str(root / "effort_controller" / "commands"), "std_msgs/msg/Float64MultiArray"]
    command = ExecuteProcess(cmd=["ros2", "topic", "echo", *options, *topic], output="log")
    # Not a second spawner: it would configure effort_controller again.
    switch = ExecuteProcess(
        cmd=[
            *("ros2", "control", "switch_controllers", "--activate", "effort_controller"),
            *("--strict", "--controller-manager", str(root / "controller_manager")),
        ],
        output="both",
    )
    activates = IfCondition(arguments["activate"])
    return [
        manager,
        states,
        after(states, efforts),
        after(efforts, controller),
        after(efforts, command, activates),
        after(command, switch, activates),
        after(switch, None, activates),
    ]


def generate_launch_description():
    """Declare the arguments, and start the nodes."""
    declared = [
        DeclareLaunchArgument(name, default_value=value, description=text)
        for name, (value, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
