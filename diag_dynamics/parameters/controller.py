# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the controller, all in one table."""

from diag_dynamics.control.modes import MODES, TRACKING
from diag_dynamics.parameters.contact import PARAMETERS as CONTACT_PARAMETERS
from diag_dynamics.parameters.shared import PARAMETERS as SHARED_PARAMETERS
from diag_dynamics.parameters.spec import Spec

COMPENSATES = "robot_compensates_gravity"
"""The one parameter that has no default."""

WHY_REQUIRED = (
    "whether the robot itself adds what carries its weight to the efforts it is sent, as the torque interfaces of some "
    "vendors do. Nobody can guess it: gravity that is added twice launches the arm, gravity that nobody adds drops it"
)


def _once(default, description, **options):
    return Spec(default, description, while_unconfigured=True, **options)


PARAMETERS = {
    "autostart": Spec(
        False,
        "Whether the node configures and activates itself: when it starts, or as soon as the robot's description has come.",
        read_only=True,
    ),
    "robot_description": _once(
        "",
        "URDF, or the path of one or of a xacro file, with NAME:=VALUE behind it. If it is empty, the topic "
        "robot_description is used.",
    ),
    **{
        name: spec._replace(read_only=False, while_unconfigured=True)
        for name, spec in SHARED_PARAMETERS.items()
        if name != "floating_base"
    },
    "command_joints": _once(
        [""],
        "Joints in the order of a command's entries; by default all, in the robot's order. Lock those that no effort drives.",
    ),
    "check_time": _once(
        1.0,
        "How long the effort controller may take to say its joints on activation [s]. It is asked again twice a second; 0: "
        "never.",
        minimum=0.0,
        maximum=60.0,
    ),
    "initial_mode": _once(TRACKING, "The law in force on activation.", choices=MODES),
    # laws
    "damping": _once(["*=10.0"], "Gains c of damping, each as joint=gain; * for all others [1/s]."),
    "controlled_link": _once("", "Link whose pose is regulated; empty: none, and no mode pose."),
    "position_stiffness": _once(200.0, "Stiffness C2 of the position [N/m].", minimum=1e-6),
    "orientation_stiffness": _once(20.0, "Stiffness C2 of the orientation [N m/rad].", minimum=1e-6),
    "position_speed": _once(0.25, "Speed at which a pose's position is approached [m/s].", minimum=1e-6),
    "orientation_speed": _once(0.5, "Speed at which a pose's orientation is approached [rad/s].", minimum=1e-6),
    "pose_damping": _once(["*=12.0"], "Gains c1 of pose regulation, each as joint=gain; * for all others [1/s]."),
    "tracking_gain": _once(["*=20.0"], "Gains K of tracking, each as joint=gain; * for all others [1/s]."),
    "tracking_convergence": _once(
        ["*=10.0"], "Rates Lambda at which tracking errors decay, each as joint=rate; * for all others [1/s]."
    ),
    "set_point_speed": _once(
        0.25,
        "Speed at which set-points are approached, in parts of the URDF's velocity limits.",
        minimum=1e-3,
        maximum=1.0,
    ),
    "following_energy": _once(
        2.0,
        "V of tracking at which a target that the robot does not follow is given up [J], from a quarter of which set-points "
        "and poses wait for it; 0: never.",
        minimum=0.0,
    ),
    # filters
    "limit_margin": _once(
        0.1, "Where springs before the position limits begin, from those inward [rad, m]; 0: none.", minimum=0.0
    ),
    "limit_stiffness": _once(
        100.0, "Stiffness of the springs before the position limits [N m/rad, N/m].", minimum=1e-6
    ),
    "limit_damping": _once(10.0, "Damping at the position limits [N m s/rad, N s/m].", minimum=0.0),
    "energy_limit": _once(0.0, "Bound on the kinetic energy [J]; 0: none.", minimum=0.0),
    "energy_rate": _once(
        50.0, "Rate alpha at which that bound is approached [1/s]; times the period of states below 1.", minimum=1e-6
    ),
    **{name: spec._replace(read_only=False, while_unconfigured=True) for name, spec in CONTACT_PARAMETERS.items()},
    "contact.energy_limit": _once(
        0.0,
        "Bound on the kinetic energy that a contact could take out of the robot along the motion of any point [J], beside "
        "those of limits_file; 0: none.",
        minimum=0.0,
    ),
    "contact.rate": _once(
        30.0,
        "Rate alpha at which the limits of contact are approached [1/s]; times the period of states below 1.",
        minimum=1e-6,
    ),
    "contact.scale_timeout": _once(
        0.0,
        "Largest age of the last message on contact_scale, which scales the allowed speeds; where it is older, or none has "
        "come, they are 0 [s]. 0: the last one holds, and before the first they are not scaled.",
        minimum=0.0,
        maximum=100.0,
    ),
    "observer_gain": _once(
        0.0,
        "Gain of the disturbance observer [1/s], by which the energy limiter counts the power of pushes; 0: none.",
        minimum=0.0,
    ),
    "effort_limit": _once(
        [""],
        "Largest efforts, no more than the URDF's, each as joint=effort; * for all others [N m, N]. By default the URDF's.",
    ),
    "effort_rate": _once(
        ["*=1000.0"], "Rates at which efforts change, each as joint=rate; * for all others [N m/s, N/s]."
    ),
    # safety
    "joint_timeout": _once(
        0.02, "Largest age of a joint's last values against the newest joint's [s].", minimum=1e-4, maximum=1.0
    ),
    "max_state_age": _once(
        0.02,
        "Largest distance of a state's stamp from this node's clock [s]; beyond it, gravity is held.",
        minimum=1e-4,
        maximum=1.0,
    ),
    "hold_time": _once(
        0.5,
        "How long the last gravity torque is held without a valid state [s], at least twice max_state_age; then it is taken "
        "to zero.",
        minimum=0.0,
        maximum=10.0,
    ),
    "resume_after_ramp": _once(
        False, "Whether a valid state puts the law in force again after that; else choosing a mode does."
    ),
    "max_rate.status": _once(0.0, "Highest rate of ~/status [Hz]; 0 for every command.", minimum=0.0),
}
"""Specs of all parameters but :data:`COMPENSATES`, by name."""
