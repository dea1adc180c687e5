# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics and services of each node: the one table behind `--help` and docs/interfaces.md. No ROS."""

from typing import NamedTuple

from diag_dynamics.control.modes import MODES
from diag_dynamics.nodes.support.topics import TOPICS

IN, OUT, SERVICE = "in", "out", "service"
"""Kinds of interfaces: a topic the node subscribes to, a topic it publishes, a service it offers."""

TITLES = {IN: "listens to", OUT: "publishes", SERVICE: "services"}
"""What a list of each kind is called."""


class Interface(NamedTuple):
    """One topic or service of a node."""

    kind: str
    name: str
    """``~`` stands for the node's name, ``/`` makes the name absolute, all others are relative to the namespace."""
    type: str
    """``package/Name``; a type without package is one of this package's."""
    meaning: str
    condition: str = ""
    """Parameter without which the topic is not there."""


CLOCK = Interface(IN, "/clock", "rosgraph_msgs/Clock", "simulated time", "use_sim_time")
DESCRIPTION = Interface(
    IN, "robot_description", "std_msgs/String", "URDF, latched; not listened to where the parameter of that name is set"
)

INTERFACES = {
    "monitor": (
        Interface(IN, "joint_states", "sensor_msgs/JointState", "positions, velocities and efforts of the joints"),
        DESCRIPTION,
        Interface(
            IN,
            "odom",
            "nav_msgs/Odometry",
            "pose and twist of the base; child_frame_id is the root link or one rigidly attached to it, gravity is given "
            "in header.frame_id",
            "floating_base",
        ),
        CLOCK,
        *(Interface(OUT, f"~/{topic.name}", topic.type, topic.meaning, topic.condition) for topic in TOPICS),
        Interface(
            OUT,
            "/diagnostics",
            "diagnostic_msgs/DiagnosticArray",
            "inputs, model, numerical health, energy, external torque, contact: once a second, at once where energy rises "
            "too high, something collides or a limit of contact is exceeded",
        ),
        Interface(SERVICE, "~/forward_dynamics", "ForwardDynamics", "q̈ and ν̇ from positions, velocities, efforts"),
        Interface(
            SERVICE, "~/inverse_dynamics", "InverseDynamics", "efforts from positions, velocities, accelerations"
        ),
        Interface(
            SERVICE, "~/diagonalize", "Diagonalize", "everything the monitor publishes, for a state of your choice"
        ),
        Interface(
            SERVICE, "~/set_payload", "SetPayload", "attach a payload to a link, change it, take it off, while running"
        ),
    ),
    "simulator": (
        Interface(
            IN,
            "effort_controller/commands",
            "std_msgs/Float64MultiArray",
            "efforts in the order of command_joints; held until the next one, or command_timeout; not with motion wave",
        ),
        Interface(
            IN,
            "external_wrench",
            "geometry_msgs/WrenchStamped",
            "pushes the link frame_id at its origin; several links at a time",
        ),
        CLOCK,
        Interface(
            OUT,
            "joint_states",
            "sensor_msgs/JointState",
            "as the sensors measure it; coupled mimic joints last, with an effort of 0; efforts as they act, weight "
            "compensation included",
        ),
        Interface(OUT, "robot_description", "std_msgs/String", "latched"),
        Interface(
            OUT,
            "odom",
            "nav_msgs/Odometry",
            "of a floating base, in `world`; delayed and lost with its joint state, without noise",
            "floating_base",
        ),
        Interface(OUT, "~/ground_truth", "DiagonalizedState", "what is, without sensors"),
        Interface(
            OUT,
            "~/energy_audit",
            "EnergyAudit",
            "work of efforts, wrenches, damping, friction and limits against the change of energy",
        ),
        Interface(OUT, "/clock", "rosgraph_msgs/Clock", "simulated time", "publish_clock or lockstep"),
        Interface(
            OUT, "/diagnostics", "diagnostic_msgs/DiagnosticArray", "commands, pace and simulation: once a second"
        ),
        Interface(SERVICE, "~/pause", "std_srvs/SetBool", "the robot stands still, and goes on as it was"),
        Interface(SERVICE, "~/step", "Step", "some steps while paused, stamped from now on"),
        Interface(
            SERVICE, "~/reset", "std_srvs/Trigger", "where it began, without a command; time goes on, noise begins anew"
        ),
        Interface(SERVICE, "~/set_state", "SetState", "any other state; time and command go on"),
    ),
    "controller": (
        Interface(
            IN,
            "joint_states",
            "sensor_msgs/JointState",
            "positions and velocities of all joints, with stamps; efforts are not looked at",
        ),
        DESCRIPTION._replace(meaning=DESCRIPTION.meaning + "; another robot is taken over when deactivated"),
        Interface(
            IN,
            "target",
            "geometry_msgs/PoseStamped",
            "mode pose: where controlled_link shall be, in the axes of the link frame_id, as that link is when the target "
            "comes",
        ),
        Interface(
            IN,
            "trajectory",
            "trajectory_msgs/JointTrajectory",
            "mode tracking: interpolated as ros2_control's joint trajectory controller does; within position and velocity "
            "limits",
        ),
        Interface(
            IN,
            "set_point",
            "sensor_msgs/JointState",
            "mode tracking: positions of all joints, within their limits; gone to at set_point_speed",
        ),
        Interface(
            IN,
            "contact_scale",
            "std_msgs/Float64",
            "part, from 0 to 1, of the allowed speeds of contact that is allowed now, as of speed and separation monitoring",
            "contact.limits_file or contact.energy_limit",
        ),
        CLOCK,
        Interface(
            OUT,
            "effort_controller/commands",
            "std_msgs/Float64MultiArray",
            "efforts in the order of command_joints, one message for each valid joint state",
        ),
        Interface(OUT, "~/status", "ControllerStatus", "law, phase, energies, V and its rate, errors, who is limited"),
        Interface(
            OUT, "/diagnostics", "diagnostic_msgs/DiagnosticArray", "control, commands and inputs: once a second"
        ),
        *(
            Interface(
                SERVICE,
                f"~/mode/{mode}",
                "std_srvs/Trigger",
                "puts this law in force, with the present state as its target; takes up a robot that was given up",
            )
            for mode in MODES
        ),
    ),
    "view": (
        Interface(IN, "diag_dynamics/state", "DiagonalizedState", "of each monitor that is found, whatever its name"),
        Interface(IN, "diag_dynamics/external_torque", "ExternalTorque", "likewise"),
        Interface(IN, "diag_dynamics/contact", "Contact", "of every monitor that judges contact by limits"),
        Interface(IN, "robot_description", "std_msgs/String", "URDF, in the namespace of each monitor"),
        Interface(IN, "/diagnostics", "diagnostic_msgs/DiagnosticArray", "what each robot's nodes say"),
        CLOCK,
        Interface(OUT, "/diagnostics", "diagnostic_msgs/DiagnosticArray", "page and robots: once a second"),
    ),
}
"""Of each executable, in the order in which they are listed."""

MANAGED = (
    ("~/change_state", "lifecycle_msgs/ChangeState"),
    ("~/get_state", "lifecycle_msgs/GetState"),
    ("~/get_available_states", "lifecycle_msgs/GetAvailableStates"),
    ("~/get_available_transitions", "lifecycle_msgs/GetAvailableTransitions"),
    ("~/get_transition_graph", "lifecycle_msgs/GetAvailableTransitions"),
)
"""Services of every managed node."""
