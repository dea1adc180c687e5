# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the controller."""

from diag_dynamics.control.loop import require_consistent
from diag_dynamics.control.modes import LAWS, REGULATION
from diag_dynamics.entries import assignments
from diag_dynamics.parameters.contact_limits import PARAMETERS as CONTACT
from diag_dynamics.parameters.contact_limits import limits_of
from diag_dynamics.parameters.shared import PARAMETERS as SHARED
from diag_dynamics.parameters.shared import ROBOT, check_entries
from diag_dynamics.parameters.spec import Spec, while_unconfigured

BY_JOINT = (
    "damping",
    "regulation_stiffness",
    "tracking_gain",
    "tracking_convergence",
    "path_tolerance",
    "goal_tolerance",
    "joint_energy_limit",
    "effort_limit",
    "effort_rate",
)
"""Parameters whose entries are joint=number."""

COMPENSATES = "robot_compensates_gravity"
"""The one parameter that has no default."""

WHY_REQUIRED = (
    "whether the robot adds gravity compensation to commanded efforts, "
    "as some vendors' torque interfaces do. A wrong value makes the arm jump up or fall"
)

_WHILE_UNCONFIGURED = {
    "robot_description": Spec("", f"{ROBOT}. Empty: the topic robot_description."),
    **{name: spec for name, spec in SHARED.items() if name != "floating_base"},
    "command_joints": Spec(
        [""],
        "Joints in the order of a command's entries; by default all. "
        "Lock joints without effort interface.",
    ),
    "initial_mode": Spec(REGULATION, "Mode on activation.", choices=tuple(LAWS)),
    # laws
    "damping": Spec(["*=10.0"], "Gains c of damping, each as joint=gain; * for all others [1/s]."),
    "controlled_link": Spec("", "Link whose pose is regulated; empty: no mode pose."),
    "position_stiffness": Spec(200.0, "Stiffness C2 of the position [N/m].", 1e-6),
    "orientation_stiffness": Spec(20.0, "Stiffness C2 of the orientation [N m/rad].", 1e-6),
    "pose_damping_ratio": Spec(
        1.0, "Damping ratio of all modes of pose regulation; 1: critical.", 1e-3, 100.0
    ),
    "regulation_stiffness": Spec(
        [""],
        "Stiffnesses of regulation, each as joint=stiffness; * for all others [N m/rad, N/m]. "
        "By default four times tracking's, and more against Coulomb friction.",
    ),
    "regulation_damping_ratio": Spec(
        1.0, "Damping ratio of all modes of regulation; 1: critical.", 1e-3, 100.0
    ),
    "tracking_gain": Spec(
        ["*=20.0"], "Gains K of tracking, each as joint=gain; * for all others [1/s]."
    ),
    "tracking_convergence": Spec(
        ["*=10.0"], "Decay rates Lambda of tracking, each as joint=rate; * for all others [1/s]."
    ),
    "tracking_bound": Spec(
        0.0, "Bound rho on disturbances that tracking rejects [J^0.5/s]; 0: none.", 0.0
    ),
    "friction_compensation": Spec(
        True, "Whether regulation and tracking compensate the friction of the model."
    ),
    "set_point_speed": Spec(
        0.25,
        "Speed of the motion to a set-point, as a fraction of the URDF velocity limits; "
        "to a pose, of 1 m/s and 2 rad/s.",
        1e-3,
        1.0,
    ),
    "following_energy": Spec(
        2.0,
        "Tracking error energy that aborts a target [J]; "
        "a quarter pauses set-points and poses. 0 disables.",
        0.0,
    ),
    "path_tolerance": Spec(
        [""],
        "Maximum errors on a trajectory, each as joint=error; "
        "* for all others [rad, m]; by default none.",
    ),
    "goal_tolerance": Spec(
        ["*=0.05"],
        "Maximum errors at the end of a trajectory, each as joint=error; "
        "* for all others [rad, m].",
    ),
    "goal_time_tolerance": Spec(
        1.0,
        "Maximum time from the end of a trajectory until joints are within tolerances [s]; "
        "0: no limit.",
        0.0,
    ),
    # filters
    "limit_margin": Spec(
        0.1, "Distance of repulsive springs from the position limits [rad, m]; 0: none.", 0.0
    ),
    "energy_limit": Spec(0.0, "Maximum kinetic energy [J]; 0: no limit.", 0.0),
    "joint_energy_limit": Spec(
        [""],
        "Maximum energy shares of joints, each as joint=energy; "
        "* for all others [J]; by default none.",
    ),
    "energy_rate": Spec(
        50.0,
        "Rate alpha towards energy limits [1/s]; values above 1 / period act as 1 / period.",
        1e-6,
    ),
    "tank_energy": Spec(
        0.0,
        "Energy that laws may add to the arm in total [J]; "
        "braking refills it, a mode service, too. 0: no limit.",
        0.0,
    ),
    **CONTACT,
    "contact_limits.energy": Spec(
        0.0, "Maximum transferable energy of all contact points [J]; 0: no limit.", 0.0
    ),
    "contact_limits.scale_timeout": Spec(
        0.0,
        "Maximum age of contact_scale [s]; after it the allowed speeds are 0. 0: no timeout.",
        0.0,
        100.0,
    ),
    "observer_gain": Spec(
        0.0, "Gain of the energy limiter's disturbance observer [1/s]; 0: no observer.", 0.0
    ),
    "effort_limit": Spec(
        [""],
        "Maximum efforts, at most those of the URDF, each as joint=effort; "
        "* for all others [N m, N].",
    ),
    "effort_rate": Spec(
        ["*=1000.0"], "Maximum effort rates, each as joint=rate; * for all others [N m/s, N/s]."
    ),
    # safety
    "max_state_age": Spec(
        0.02,
        "Maximum difference between stamp and node clock [s]; "
        "beyond it the controller holds gravity.",
        1e-4,
        1.0,
    ),
    "hold_time": Spec(
        0.5,
        "Time of gravity hold without a valid state [s], at least twice max_state_age.",
        0.0,
        10.0,
    ),
    "max_rate.status": Spec(
        0.0, "Maximum rate of ~/status and ~/controller_state [Hz]; 0: every command.", 0.0
    ),
}

AUTOSTART = Spec(
    False,
    "Whether the node configures and activates itself at its first robot_description.",
    read_only=True,
)

PARAMETERS = {"autostart": AUTOSTART} | while_unconfigured(_WHILE_UNCONFIGURED)
"""Specs of all parameters but :data:`COMPENSATES`, by name."""


def check_values(values):
    """Raise InputError for values that are wrong for every robot, alone or together."""
    require_consistent(values)
    check_entries(values)
    for name in BY_JOINT:
        assignments(name, values[name])
    limits_of(values)
