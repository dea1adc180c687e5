# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the simulator, all in one table."""

from diag_dynamics.parameters.shared import PARAMETERS as SHARED_PARAMETERS
from diag_dynamics.parameters.spec import Spec


def _once(default, description, **options):
    return Spec(default, description, read_only=True, **options)


PARAMETERS = {
    "robot_description": _once(
        "", "URDF, or the path of one or of a xacro file, with NAME:=VALUE behind it; required."
    ),
    **SHARED_PARAMETERS,
    "floating_base": SHARED_PARAMETERS["floating_base"]._replace(
        description="Whether the root link moves freely; its state goes out on the topic odom."
    ),
    "inertia_error": _once(
        0.0,
        "Part by which the robot's inertias are off from its URDF, as a real one's are: masses by up to this part, centres "
        "by up to this part of the radius of gyration, lengths by up to half of it; drawn by chance. Friction and rotors "
        "that the URDF lacks are in parameters_file.",
        minimum=0.0,
        maximum=0.9,
    ),
    "inertia_error_seed": _once(0, "Seed of inertia_error, no less than 0: the same one makes the same robot."),
    "rate": _once(500.0, "joint_states per second of simulated time [Hz].", minimum=1.0, maximum=10000.0),
    "step": _once(
        0.001,
        "Integration step [s]. The time between two joint_states is divided into equal steps no longer than this.",
        minimum=1e-6,
        maximum=0.1,
    ),
    "order": _once(
        4,
        "Order of the integration: 4, or 1 at a tenth of the cost, which a floating base does not take.",
        choices=(4, 1),
    ),
    "motion": _once(
        "free",
        "free: as commands and wrenches move it; wave: each joint is driven along a sine wave about the middle of its range, "
        "and commands are not listened to.",
        choices=("free", "wave"),
    ),
    "limits": _once(
        "hard",
        "Position limits of the URDF: stops without rebound (hard), springs with dampers (compliant), or none.",
        choices=("hard", "compliant", "none"),
    ),
    "limit_stiffness": _once(1e4, "Stiffness of compliant limits [N m/rad, N/m].", minimum=1e-6, maximum=1e12),
    "limit_damping": _once(100.0, "Damping of compliant limits [N m s/rad, N s/m].", minimum=0.0),
    "command_joints": _once([""], "Joints in the order of a command's entries; by default all, in the robot's order."),
    "command_timeout": _once(
        0.0, "How long a command holds in simulated time [s]; 0: until the next one.", minimum=0.0
    ),
    "without_command": _once(
        "zero",
        "What drives do before the first command and after one has timed out: no effort (zero), or hold the joints by "
        "brakes of twice the effort limit (brake).",
        choices=("zero", "brake"),
    ),
    "compensates_gravity": _once(
        False,
        "Whether drives add what carries the robot's own weight, payloads included, as some vendors' do: to every command, "
        "and with without_command zero where there is none, too.",
    ),
    "wrench_axes": _once(
        "link",
        "Axes of external wrenches: those of their link, or of the world.",
        choices=("link", "world"),
    ),
    "wrench_timeout": _once(
        0.1, "How long a wrench holds in simulated time [s]; 0: until the next one on its link.", minimum=0.0
    ),
    "sensor_noise": _once(
        [0.0, 0.0, 0.0],
        "Standard deviation of white noise on position [rad, m], velocity [rad/s, m/s] and effort [N m, N].",
    ),
    "sensor_resolution": _once(
        [0.0, 0.0, 0.0], "Steps of position [rad, m], velocity [rad/s, m/s] and effort [N m, N]; 0: none."
    ),
    "sensor_delay": _once(0.0, "From a state to its publication, in simulated time [s].", minimum=0.0, maximum=10.0),
    "sensor_dropped": _once(0.0, "Probability that a message of joint_states is lost.", minimum=0.0, maximum=1.0),
    "seed": _once(
        0, "Seed of noise and losses, no less than 0: the same one, and the same joint states, give the same messages."
    ),
    "real_time_factor": _once(
        1.0,
        "Seconds of simulated time for each of the clock; 0: as fast as can be. But for 1 publish_clock is wanted.",
        minimum=0.0,
        maximum=1000.0,
    ),
    "publish_clock": _once(False, "Whether simulated time goes out on /clock, for nodes with use_sim_time."),
    "lockstep": _once(
        False,
        "Whether time goes on only by commands: each takes the simulation from one joint state to the next. Implies "
        "publish_clock.",
    ),
}
"""Specs of all parameters, by name."""

DYNAMIC = ("gravity", "payloads")
"""Parameters that may change while the robot moves."""
