# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start ros2_control, its controllers and the controller node, then activate effort_controller.

Each step waits for the one before: the arm has gravity torque before effort_controller takes it.
The robot's own launch file publishes robot_description.
"""

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
from launch_ros.actions import LifecycleNode, Node
from launch_ros.event_handlers import OnStateTransition

ARGUMENTS = {
    "namespace": ("", "Namespace of all nodes."),
    "params_file": (
        str(Path(__file__).parents[1] / "config" / "effort_controllers.yaml"),
        "YAML file of parameters of all nodes.",
    ),
    "activate": ("true", "Whether effort_controller is activated in the end, once."),
    "log_level": ("info", "Log level of the controller node."),
}
"""Arguments: default and description."""


def start(context):
    """Return controller_manager, the spawners, and handlers that start what follows them."""
    arguments = context.launch_configurations
    namespace, files = arguments["namespace"], [arguments["params_file"]]
    common = {"namespace": namespace, "output": "both"}

    def spawner(*words):
        return Node(
            package="controller_manager",
            executable="spawner",
            arguments=[*words, "--controller-manager-timeout", "30"],
            **common,
        )

    def after(process, action):
        """Return the handler that starts an action after a process; its error ends the launch."""

        def on_exit(event, _):
            return EmitEvent(event=Shutdown(reason="a step failed")) if event.returncode else action

        return RegisterEventHandler(OnProcessExit(target_action=process, on_exit=on_exit))

    manager = Node(
        package="controller_manager", executable="ros2_control_node", parameters=files, **common
    )
    states = spawner("joint_state_broadcaster")
    efforts = spawner("effort_controller", "--inactive")
    controller = LifecycleNode(
        package="diag_dynamics",
        executable="controller",
        name="diag_dynamics_controller",
        parameters=[*files, {"autostart": True}],
        arguments=["--ros-args", "--log-level", arguments["log_level"]],
        **common,
    )
    actions = [manager, states, after(states, efforts), after(efforts, controller)]
    # Not a second spawner: it would configure effort_controller again.
    command = ["ros2", "control", "switch_controllers", "--activate", "effort_controller"]
    where = ["--controller-manager", str(Path("/", namespace, "controller_manager"))]
    switch = ExecuteProcess(cmd=[*command, "--strict", *where], output="both")
    is_active = OnStateTransition(
        target_lifecycle_node=controller,
        goal_state="active",
        entities=[switch],
        handle_once=True,  # a reaction or a person may deactivate effort_controller later
    )
    activates = IfCondition(arguments["activate"])
    return [
        *actions,
        RegisterEventHandler(is_active, condition=activates),
        after(switch, None),
    ]


def generate_launch_description():
    """Declare the arguments, and start the nodes."""
    declared = [
        DeclareLaunchArgument(name, default_value=value, description=text)
        for name, (value, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
