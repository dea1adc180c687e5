# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the simulator."""

from diag_dynamics.parameters.shared import PARAMETERS as SHARED
from diag_dynamics.parameters.shared import ROBOT
from diag_dynamics.parameters.spec import Spec, fixed

DYNAMIC = ("gravity", "payloads")
"""Parameters that may change while the robot moves."""

SENSORS = "position [rad, m], velocity [rad/s, m/s] and effort [N m, N]"

_FIXED = {
    "robot_description": Spec("", f"{ROBOT}; required."),
    **{name: spec for name, spec in SHARED.items() if name not in (*DYNAMIC, "armature")},
    "floating_base": Spec(
        False, "Whether the root link moves freely; its state is published on odom."
    ),
    "rate": Spec(500.0, "joint_states per second of simulated time [Hz].", 1.0, 10000.0),
    "step": Spec(0.001, "Maximum integration step [s].", 1e-6, 0.1),
    "motion": Spec(
        "free",
        "Motion: by commands and wrenches (free), or sine waves about mid-range (wave).",
        choices=("free", "wave"),
    ),
    "limits": Spec(
        "hard",
        "Position limits: stops without rebound (hard), springs with dampers (compliant), or none.",
        choices=("hard", "compliant", "none"),
    ),
    "command_joints": Spec(
        [""], "Joints in the order of a command's entries; by default all, in the robot's order."
    ),
    "command_timeout": Spec(
        0.0, "Simulated time after which a command expires [s]; 0: never.", 0.0
    ),
    "without_command": Spec(
        "zero",
        "Without a command: zero effort (zero), or brakes of twice the effort limit (brake).",
        choices=("zero", "brake"),
    ),
    "compensates_gravity": Spec(
        False, "Whether the simulated drives compensate gravity, payloads included."
    ),
    "wrench_axes": Spec(
        "link",
        "Axes of external wrenches: of their link, or of the world.",
        choices=("link", "world"),
    ),
    "wrench_timeout": Spec(0.1, "Simulated time after which a wrench expires [s]; 0: never.", 0.0),
    "sensor_noise": Spec([0.0, 0.0, 0.0], f"Standard deviation of white noise on {SENSORS}."),
    "real_time_factor": Spec(
        1.0,
        "Real-time factor; 0: as fast as possible. "
        "With other values than 1 the node publishes /clock.",
        0.0,
        1000.0,
    ),
    "lockstep": Spec(
        False, "Whether each command advances time, on /clock, to the next joint state."
    ),
}

PARAMETERS = fixed(_FIXED) | {name: SHARED[name] for name in DYNAMIC}
"""Specs by name."""
