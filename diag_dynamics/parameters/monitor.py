# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the monitor, and the checks on values that belong together."""

from collections.abc import Mapping
from typing import NamedTuple

from diag_dynamics.collision.detector import HOLD_OFF, RELEASE, STANDING, AlarmThresholds
from diag_dynamics.entries import ALL, assignments, by_name
from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.joints import Options
from diag_dynamics.model.options import FRICTION_VELOCITY
from diag_dynamics.parameters.contact import PARAMETERS as CONTACT_PARAMETERS
from diag_dynamics.parameters.contact import Wanted
from diag_dynamics.parameters.shared import PARAMETERS as SHARED_PARAMETERS
from diag_dynamics.parameters.shared import payloads_of
from diag_dynamics.parameters.spec import Spec, wrong

RATES = {
    "total_joint_rates": 0.0,
    "working_moments": 0.0,
    "coriolis": 0.0,
    "mass_matrix_factors": 50.0,
    "kinetic_energy": 0.0,
    "joint_space_dynamics": 50.0,
    "state": 0.0,
    "external_torque": 0.0,
    "contact": 50.0,
    "markers": 20.0,
}
"""Highest rate at which each topic is published by default [Hz]; 0 for every state."""

BESIDES = {
    "external_torque": " The observer sees every state, whatever this is.",
    "contact": " Limits are judged at every state, whatever this is.",
}
"""What is to be said of the rate of some topics."""

PARAMETERS = {
    "robot_description": Spec(
        "",
        "URDF, or the path of one or of a xacro file, with NAME:=VALUE behind it. If it is empty, the topic "
        "robot_description is used, and used again whenever a new description arrives there.",
    ),
    **SHARED_PARAMETERS,
    "odom_twist_frame": Spec(
        "child",
        "Axes of the twist in odom: those of child_frame_id (child), as REP 147 has it, or of header.frame_id (header).",
        read_only=True,
        choices=("child", "header"),
    ),
    "odom_timeout": Spec(
        0.5,
        "Largest time between the stamps of odom and of the joints [s]; 0 for no limit.",
        minimum=0.0,
    ),
    "joint_timeout": Spec(
        0.5,
        "Largest age of a joint's last values against the newest joint's [s]; where one is older, nothing is "
        "published. 0 for no limit.",
        minimum=0.0,
    ),
    "joint_timeouts": Spec(
        [""], "joint_timeout of single joints, each as joint=seconds; the others keep joint_timeout."
    ),
    "max_age": Spec(
        1.0,
        "Largest distance of a stamp from this node's clock when it is received [s], into the past or the future; what is "
        "further away is rejected. 0: not judged.",
        minimum=0.0,
    ),
    "foreign_time": Spec(
        "warn",
        "Stamps further than max_age from this node's clock from the first one on (a recording without use_sim_time, hosts "
        "whose clocks differ): accepted, and diagnostics warn (warn), or rejected (refuse).",
        choices=("warn", "refuse"),
    ),
    "missing_velocity": Spec(
        "refuse",
        "Joints without velocity: nothing is published (refuse), or it is estimated from positions and flagged (estimate).",
        choices=("refuse", "estimate"),
    ),
    "velocity_filter_time": Spec(
        0.01,
        "Time constant of the filter of estimated velocities, and their delay where samples are dense [s].",
        minimum=0.0,
        maximum=10.0,
    ),
    "effort_available": Spec(
        [""], "Whether efforts of a joint can be used, each as joint=true or joint=false; * for all other joints."
    ),
    "effort_scale": Spec(
        [""],
        "Effort [N m, prismatic: N] per unit sent, as of motor currents, each as joint=factor; * for all other joints.",
    ),
    "effort_includes_gravity": Spec(
        [""],
        "Whether the efforts sent for a joint hold what carries its weight, each as joint=true or joint=false; * for all "
        "other joints. Where they do not, gravity of the model is added.",
    ),
    "absurd.position": Spec(
        1e8,
        "Positions beyond it reject the message [rad, m], but for those of continuous joints; 0: no bound.",
        minimum=0.0,
        maximum=1e12,
    ),
    "absurd.velocity": Spec(
        1e4, "Velocities beyond it reject the message [rad/s, m/s]; 0: no bound.", minimum=0.0, maximum=1e12
    ),
    "absurd.effort": Spec(
        1e6, "Efforts beyond it are taken as unknown [N m, prismatic: N]; 0: no bound.", minimum=0.0, maximum=1e12
    ),
    "absurd.beyond_limits": Spec(
        6.3,
        "Positions further outside the URDF's limits, by default a turn, reject the message [rad, m]; 0: no bound.",
        minimum=0.0,
    ),
    "absurd.beyond_velocity": Spec(
        3.0,
        "Velocities beyond so many times the URDF's velocity limit reject the message, where there is such a limit; 0: no "
        "bound.",
        minimum=0.0,
        maximum=1e6,
    ),
    "absurd.beyond_effort": Spec(
        4.0,
        "Efforts beyond so many times the URDF's effort limit, where there is such a limit, are taken as unknown; 0: no "
        "bound.",
        minimum=0.0,
        maximum=1e6,
    ),
    "absurd.jump": Spec(
        0.1,
        "Step of a position [rad, m] beyond what the velocities before and after it explain, or the URDF's velocity "
        "limit, that rejects the message. Three messages in a row that agree on the new place are accepted. Two sources "
        "in turns: docs/drivers.md, Two sources. 0: not judged.",
        minimum=0.0,
        maximum=1e6,
    ),
    "frozen_timeout": Spec(
        0.5,
        "How long a joint may have a velocity while no bit of its position changes, or move while its velocity is 0, as by "
        "a driver that repeats old values under fresh stamps [s]; 0: not judged.",
        minimum=0.0,
        maximum=100.0,
    ),
    "frozen_values": Spec(
        "warn",
        "States with frozen values: published, and diagnostics warn (warn), or rejected (refuse).",
        choices=("warn", "refuse"),
    ),
    "mimic_tolerance": Spec(
        0.01,
        "Largest distance of a coupled mimic joint's own position from that which its leader gives it [rad, m]; beyond it, "
        "diagnostics warn and services refuse. 0: not compared.",
        minimum=0.0,
    ),
    "warn_energy": Spec(0.0, "Kinetic energy beyond which diagnostics warn [J]; 0: no warning.", minimum=0.0),
    "error_energy": Spec(0.0, "Kinetic energy beyond which diagnostics report an error [J]; 0: no error.", minimum=0.0),
    "warn_energy_share": Spec(
        [""],
        "Share of the kinetic energy beyond which diagnostics warn, each as joint=energy [J]; * for all other joints.",
    ),
    "error_energy_share": Spec(
        [""], "Share beyond which diagnostics report an error, each as joint=energy [J]; * for all other joints."
    ),
    "external_torque.gain": Spec(
        0.0,
        "Gain K_O of the disturbance observer that external_torque tells the result of [1/s], which follows a push with a "
        "time constant of 1/K_O; 0: no observer.",
        minimum=0.0,
        maximum=1e6,
    ),
    "external_torque.threshold": Spec(
        0.0,
        "Norm of its residual beyond which it reports a collision [J^0.5/s]; 0: never, and the message has inf for it.",
        minimum=0.0,
    ),
    "external_torque.release_threshold": Spec(
        0.0, "Norm below which the collision is over [J^0.5/s]; 0: half of the threshold.", minimum=0.0
    ),
    "external_torque.friction": Spec(
        True,
        "Whether the observer takes the damping and friction of the URDF or parameters_file into account; false: they are "
        "part of the external torque.",
    ),
    "external_torque.max_gap": Spec(
        0.1,
        "Longest time between two states after which the observer goes on; it begins anew after a longer one [s].",
        minimum=1e-6,
        maximum=100.0,
    ),
    "alarm.joints": Spec(
        [""],
        "External torque |m r| of a joint beyond which there is an alarm, each as joint=threshold [N m, prismatic: N]; * for "
        "all other joints. 0: not judged. As diag-dynamics calibrate writes them.",
    ),
    "alarm.external_torque": Spec(
        0.0, "Norm of m r of all joints beyond which there is an alarm [N m]; 0: not judged.", minimum=0.0
    ),
    "alarm.norm": Spec(
        0.0,
        "Norm of the residual, |r|, beyond which there is an alarm [J^0.5/s]; 0: not judged. It takes the place of "
        "external_torque.threshold, which does without what the other alarm.* say.",
        minimum=0.0,
    ),
    "alarm.release": Spec(
        RELEASE, "Part of its threshold below which what made an alarm is quiet again.", minimum=0.01, maximum=1.0
    ),
    "alarm.hold_off": Spec(
        HOLD_OFF, "Time after an alarm within which another rise belongs to it [s].", minimum=0.0, maximum=1000.0
    ),
    "alarm.standing": Spec(
        STANDING,
        "Time after which a torque that keeps an alarm up is taken for an offset that stands, as stiction leaves one [s]; 0: "
        "never, and such an alarm does not end.",
        minimum=0.0,
        maximum=1000.0,
    ),
    **CONTACT_PARAMETERS,
    "contact.warn_at": Spec(
        0.8,
        "Part of its allowed speed from which on a point with a limit makes diagnostics warn; above all of it they report an "
        "error at once.",
        minimum=0.01,
        maximum=1.0,
    ),
    "contact.release": Spec(
        0.9,
        "Part of where a warning or error of contact began below which the point is quiet again.",
        minimum=0.01,
        maximum=1.0,
    ),
    "publish_inverse_factor": Spec(False, "Whether mass_matrix_factors carries l, the inverse of m."),
    "markers.link": Spec(
        "",
        "Link at which ~/markers shows the ellipsoid of J M^-1 J^T and the velocity; empty: the end-effector link.",
    ),
    "friction_velocity": Spec(
        FRICTION_VELOCITY,
        "Rate v0 within which Coulomb friction turns round, f tanh(velocity / v0) [rad/s, m/s]; 0: it jumps, f "
        "sign(velocity). Unless it is changed, that of parameters_file has precedence.",
        minimum=0.0,
        maximum=1.0,
        read_only=True,
    ),
    "publish_friction": Spec(
        False,
        "Whether state and coriolis carry damping and friction, of the URDF or parameters_file, which no other term holds.",
    ),
    **{
        f"max_rate.{topic}": Spec(
            rate,
            f"Highest rate of ~/{topic} [Hz]; 0 for every state." + BESIDES.get(topic, ""),
            minimum=0.0,
        )
        for topic, rate in RATES.items()
    },
}


class Thresholds(NamedTuple):
    """Kinetic energies that are too high [J]: in all, and of single joints by name, ``*`` for all others; 0 for none."""

    warn: float = 0.0
    error: float = 0.0
    warn_share: Mapping = {}
    error_share: Mapping = {}


class Observation(NamedTuple):
    """Arguments of the DisturbanceObserver behind external_torque; a threshold of inf for none.

    With `alarms` an AlarmDetector judges what it says, and the threshold is that of |r| among them.
    """

    gain: float
    threshold: float
    release: float
    friction: bool
    max_gap: float
    alarms: AlarmThresholds | None = None


class Settings(NamedTuple):
    """Parameters in the form in which the node uses them."""

    values: dict
    inputs: Options
    thresholds: Thresholds
    observation: Observation | None
    contact: Wanted

    @property
    def unjudged_without(self):
        """Parameters for want of which no collision is told of; none where collisions are."""
        if self.observation and self.observation.alarms:
            return ()
        wanted = ("external_torque.gain", "external_torque.threshold")
        return tuple(name for name in wanted if not self.values[name])

    @classmethod
    def of(cls, values):
        """Settings of parameters by name, judged one by one and together.

        Raises
        ------
        InputError
            Names the parameter, its value and what was expected.
        """
        for name, value in values.items():
            if reason := wrong(name, value, PARAMETERS):
                raise InputError(reason + ".")
        payloads_of(values["payloads"])
        for name in ("locked_joints", "armature"):
            assignments(name, values[name])
        inputs = Options(
            timeout=values["joint_timeout"],
            timeouts=assignments("joint_timeouts", values["joint_timeouts"], minimum=0.0),
            mimic_tolerance=values["mimic_tolerance"],
            max_age=values["max_age"],
            refuse_foreign=values["foreign_time"] == "refuse",
            estimate_velocity=values["missing_velocity"] == "estimate",
            velocity_filter_time=values["velocity_filter_time"],
            effort_available=assignments("effort_available", values["effort_available"], bool),
            effort_scale=assignments("effort_scale", values["effort_scale"]),
            effort_includes_gravity=assignments("effort_includes_gravity", values["effort_includes_gravity"], bool),
            max_position=values["absurd.position"],
            max_velocity=values["absurd.velocity"],
            max_effort=values["absurd.effort"],
            beyond_limits=values["absurd.beyond_limits"],
            beyond_velocity=values["absurd.beyond_velocity"],
            beyond_effort=values["absurd.beyond_effort"],
            jump=values["absurd.jump"],
            frozen_timeout=values["frozen_timeout"],
            refuse_frozen=values["frozen_values"] == "refuse",
            odom_timeout=values["odom_timeout"],
        )
        thresholds = Thresholds(
            values["warn_energy"],
            values["error_energy"],
            assignments("warn_energy_share", values["warn_energy_share"], minimum=0.0),
            assignments("error_energy_share", values["error_energy_share"], minimum=0.0),
        )
        _require_order(thresholds)
        if nothing := [name for name, scale in inputs.effort_scale.items() if not scale]:
            raise InputError(
                f"parameter 'effort_scale' of '{nothing[0]}' is 0, expected another number; effort_available says which "
                "efforts cannot be used."
            )
        return cls(values, inputs, thresholds, _observation(values), Wanted.of(values))


def _observation(values):
    """Observation that the values ask for; None if the gain is 0."""
    gain, threshold, release = (values[f"external_torque.{x}"] for x in ("gain", "threshold", "release_threshold"))
    if release > (threshold or float("inf")):
        raise InputError(
            f"parameter external_torque.release_threshold is {release:g} J^0.5/s and external_torque.threshold "
            f"{threshold:g}, expected no more than the latter."
        )
    alarms = _alarms(values)
    if alarms and threshold:
        raise InputError(
            f"parameter external_torque.threshold is {threshold:g} J^0.5/s beside alarm.*, expected one of both: alarm.norm "
            "is the threshold of |r| there."
        )
    if not gain:
        if alarms:
            raise InputError("parameters alarm.* are given, and external_torque.gain is 0: nothing would be observed.")
        return None
    threshold = threshold or float("inf")
    release = release or 0.5 * threshold
    if alarms:
        threshold, release = alarms.norm, alarms.release * alarms.norm
    friction, max_gap = values["external_torque.friction"], values["external_torque.max_gap"]
    return Observation(gain, threshold, release, friction, max_gap, alarms)


def _alarms(values):
    """Thresholds of alarms; None if nothing is to be judged."""
    never = float("inf")
    joints = assignments("alarm.joints", values["alarm.joints"], minimum=0.0)
    torque, norm = values["alarm.external_torque"], values["alarm.norm"]
    if not (torque or norm or any(joints.values())):
        return None
    return AlarmThresholds(
        {name: threshold or never for name, threshold in joints.items()},
        torque or never,
        norm or never,
        values["alarm.release"],
        values["alarm.hold_off"],
        values["alarm.standing"] or never,
    )


def _require_order(thresholds):
    """Refuse an error threshold below its warning threshold."""
    _require_no_less("warn_energy", thresholds.warn, "error_energy", thresholds.error)
    warn, error = thresholds.warn_share, thresholds.error_share
    for name in sorted({*warn, *error}):
        low, high = (share.get(name, share.get(ALL, 0.0)) for share in (warn, error))
        _require_no_less(f"warn_energy_share of '{name}'", low, f"error_energy_share of '{name}'", high)


def _require_no_less(low, warn, high, error):
    if warn and error and error < warn:
        raise InputError(f"parameter {low} is {warn:g} J and {high} {error:g} J, expected no less than the former.")


def share_thresholds(thresholds, names):
    """Thresholds of the energy shares of these joints, infinite where there is none.

    Raises
    ------
    InputError
        A joint that is not among them.
    """
    shares = []
    for parameter, given in (
        ("warn_energy_share", thresholds.warn_share),
        ("error_energy_share", thresholds.error_share),
    ):
        entries = by_name(parameter, given, names)
        shares.append([entries.get(name, 0.0) or float("inf") for name in names])
    return shares
