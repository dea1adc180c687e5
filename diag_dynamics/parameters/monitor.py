# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the monitor, and the settings that they make up."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from diag_dynamics.collision.contact_points import ContactLimits
from diag_dynamics.collision.detector import (
    HOLD_OFF,
    NORM,
    RELEASE,
    STANDING,
    STICTION,
    TOTAL,
    Thresholds,
)
from diag_dynamics.collision.residuals import singular_joint
from diag_dynamics.entries import ALL, assignments, by_name
from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.robot_joints import JOINT_TIMEOUT, Options
from diag_dynamics.parameters.contact_limits import PARAMETERS as CONTACT
from diag_dynamics.parameters.contact_limits import limits_of
from diag_dynamics.parameters.shared import PARAMETERS as SHARED
from diag_dynamics.parameters.shared import ROBOT, payloads_of
from diag_dynamics.parameters.spec import Spec, check, fixed
from diag_dynamics.text import distinct

RATES = {
    "total_joint_rates": 0.0,
    "working_moments": 0.0,
    "coriolis": 0.0,
    "kinetic_energy": 0.0,
    "state": 0.0,
    "external_torque": 0.0,
    "external_wrench": 250.0,
    "external_wrench_estimates": 250.0,
    "mass_matrix_factors": 50.0,
    "joint_space_dynamics": 50.0,
    "contact_limits": 50.0,
    "markers": 20.0,
    "load": 20.0,
}
"""Default maximum rate of each topic [Hz]; 0: every state."""

PARAMETERS = {
    "robot_description": Spec(
        "", f"{ROBOT}. Empty: the topic robot_description, also when it changes."
    ),
    **SHARED,
    **fixed(
        {
            "joint_names": Spec(
                [""],
                "Map names in joint_states to joints, "
                "each as name=joint, with one * in both or none: ur_*=*.",
            ),
            "odom_twist_frame": Spec(
                "child",
                "Axes of the odometry twist: child_frame_id (REP 147) or frame_id.",
                choices=("child", "header"),
            ),
            "gravity_frame": Spec(
                "",
                "Frame of tf whose z axis points up: its orientation turns gravity in the axes of "
                "the root link. Empty: none.",
            ),
            "gravity_imu": Spec(
                "",
                "Topic of a sensor_msgs/Imu on a link of the robot that turns gravity; "
                "empty: none.",
            ),
        }
    ),
    "joint_timeout": Spec(
        [f"*={JOINT_TIMEOUT:g}"],
        "Maximum ages of joints' values relative to the newest joint, each as joint=time [s]; "
        "* for all others, without it the default. 0 disables.",
    ),
    "max_age": Spec(
        1.0,
        "Maximum difference between stamp and node clock [s]; "
        "later and earlier messages are rejected. 0 disables.",
        0.0,
    ),
    "missing_velocity": Spec(
        "reject",
        "Messages without velocity: reject, or estimate it from positions.",
        choices=("reject", "estimate"),
    ),
    "velocity_filter_time": Spec(
        0.01, "Time constant and delay of the velocity estimate [s].", 0.0, 10.0
    ),
    "effort_available": Spec(
        [""],
        "Whether the reported effort of a joint is valid, as joint=true or joint=false; "
        "* for all others.",
    ),
    "effort_scale": Spec(
        [""],
        "Effort [N m, N] per reported unit (motor current), as joint=factor; * for all others.",
    ),
    "effort_includes_gravity": Spec(
        [""],
        "Whether reported efforts include gravity compensation, as joint=true or joint=false; "
        "* for all others.",
    ),
    "plausibility.beyond_limits": Spec(
        6.3,
        "Maximum distance outside the URDF limits [rad, m]; "
        "larger ones reject the message. 0 disables.",
        0.0,
    ),
    "plausibility.beyond_velocity": Spec(
        3.0,
        "Maximum velocity as a multiple of the URDF limit; "
        "larger ones reject the message. 0 disables.",
        0.0,
        1e6,
    ),
    "plausibility.jump": Spec(
        0.1,
        "Maximum jump of a position [rad, m]; messages are rejected until three agree. 0 disables.",
        0.0,
        1e6,
    ),
    "stuck_timeout": Spec(
        0.5,
        "Time with a velocity but no motion, "
        "or the reverse, after which a sensor counts as stuck [s]; 0 disables.",
        0.0,
        100.0,
    ),
    "mimic_tolerance": Spec(
        0.01,
        "Deviation of a mimic joint from its source joint at which diagnostics warn [rad, m]; "
        "0 disables.",
        0.0,
    ),
    "energy.warn": Spec(
        [""],
        "Kinetic energy above which diagnostics warn, as total=energy, and energy shares of joints "
        "as joint=energy [J]; * for all other joints. 0 disables.",
    ),
    "energy.error": Spec(
        [""], "Energies above which diagnostics report an error, as those of energy.warn [J]."
    ),
    "external_torque.gain": Spec(
        0.0, "Gain of the disturbance observer [1/s]; 0: no observer.", 0.0, 1e6
    ),
    "external_torque.friction": Spec(
        True, "Whether the observer model includes damping and friction."
    ),
    "external_torque.covariance_joints": Spec(
        [""], "Joints of external_torque.covariance, in order."
    ),
    "external_torque.covariance": Spec(
        [0.0],
        "Noise of m r: rows of its second moment without contact "
        "[N^2 m^2, N^2 of prismatic joints]; 0: unknown.",
    ),
    "collision.threshold": Spec(
        [""],
        "External torque of a collision: joint=|m r| [N m, N], *=for all other joints, total=‖m r‖ "
        "[N m], norm=|r| [J^0.5/s]. 0 disables.",
    ),
    "collision.release": Spec(
        RELEASE, "Hysteresis: an alarm ends below this fraction of its threshold.", 0.01, 1.0
    ),
    "collision.hold_off": Spec(
        HOLD_OFF,
        "Hold-off [s]: a rise within this time after the alarm of an event is part of that event.",
        0.0,
        1000.0,
    ),
    "collision.standing": Spec(
        STANDING,
        "Age of an alarm from which an offset follows its torque until it ends [s]; 0: never.",
        0.0,
        1000.0,
    ),
    "collision.stiction": Spec(
        STICTION,
        "Dead zone of |m r| of a standing joint, as a fraction of its Coulomb friction.",
        0.0,
        10.0,
    ),
    "contact.threshold": Spec(
        [""], "External torque of a contact, as collision.threshold and no higher. 0 disables."
    ),
    "external_wrench.frames": Spec(
        [""],
        "Links at whose origin and in whose axes the external wrench is estimated, "
        "the first one with ~/external_wrench; requires external_torque.gain.",
    ),
    "external_wrench.max_force_deviation": Spec(
        10.0,
        "Standard deviation of a force above which its direction is unobserved [N]; "
        "~/external_wrench is not published then.",
        1e-6,
        1e6,
    ),
    "external_wrench.max_torque_deviation": Spec(
        1.0,
        "Standard deviation of a torque above which its direction is unobserved [N m]; "
        "~/external_wrench is not published then.",
        1e-6,
        1e6,
    ),
    "load.link": Spec(
        "",
        "Link whose loads are estimated and not reported as collisions; "
        "requires external_torque.covariance. Empty: none.",
    ),
    **fixed(
        {
            "reaction.service": Spec(
                "",
                "Service that the node calls at reaction.event, a std_srvs/Trigger, "
                "or a SwitchController where it has controllers; empty: none. Not safety-rated.",
            ),
            "reaction.event": Spec(
                "collision",
                "Event whose beginning causes the call.",
                choices=("collision", "contact"),
            ),
            "reaction.deactivate": Spec([""], "Controllers that the call deactivates."),
            "reaction.activate": Spec([""], "Controllers that the call activates."),
        }
    ),
    **CONTACT,
    "publish_inverse_factor": Spec(
        False, "Whether mass_matrix_factors contains l, the inverse of m."
    ),
    "publish_friction": Spec(False, "Whether state and coriolis contain damping and friction."),
    "max_rate": Spec(
        ["*=0", *(f"{topic}={rate:g}" for topic, rate in RATES.items() if rate)],
        "Maximum rates of topics, each as topic=rate [Hz]; * for all others, without it their "
        "defaults; 0: every state.",
    ),
}
"""Specs by name."""


class EnergyThresholds(NamedTuple):
    """Energies [J] of warnings and errors: of TOTAL and joints, ``*`` for all others; 0: none."""

    warn: Mapping = {}
    error: Mapping = {}

    def check_order(self):
        """Reject an error threshold below its warning threshold."""
        for name in sorted({*self.warn, *self.error}):
            warn = _threshold(self.warn, name)
            error = _threshold(self.error, name)
            if 0.0 < error < warn:
                value, bound = distinct(error, warn)
                raise InputError(
                    f"parameter 'energy.error' of '{name}' is {value} J; "
                    f"expected at least {bound} J (energy.warn)."
                )

    def by_joint(self, names):
        """Return the thresholds of TOTAL and joints (1 + n) by parameter, inf for none."""
        names = (TOTAL, *names)
        thresholds = {}
        for parameter, entries in (("energy.error", self.error), ("energy.warn", self.warn)):
            by_name(parameter, entries, names)  # raises InputError
            limits = [_threshold(entries, name) or np.inf for name in names]
            thresholds[parameter] = np.array(limits)
        return thresholds


def _threshold(entries, name):
    """Return the threshold of TOTAL or a joint; 0 without one."""
    return entries.get(name, 0.0 if name == TOTAL else entries.get(ALL, 0.0))


class Observation(NamedTuple):
    """Arguments of the DisturbanceObserver, and thresholds of collision and contact."""

    gain: float
    friction: bool
    collision: Thresholds
    contact: Thresholds  # lower ones
    covariance_joints: tuple[str, ...] = ()
    covariance: tuple[float, ...] = ()  # of m r without contact, row by row

    def covariance_of(self, names):
        """Return the covariance in the order of a model's degrees of freedom.

        It is None if it is unknown.
        """
        if not self.covariance:
            return None
        if missing := [name for name in names if name not in self.covariance_joints]:
            raise InputError(
                f"parameter external_torque.covariance_joints lacks '{missing[0]}'; "
                "expected all degrees of freedom. Calibrate again."
            )
        k = [self.covariance_joints.index(name) for name in names]
        return np.array(self.covariance).reshape(2 * [len(self.covariance_joints)])[np.ix_(k, k)]


class Settings(NamedTuple):
    """Parameters in the form in which the node uses them."""

    values: dict
    inputs: Options
    thresholds: EnergyThresholds
    observation: Observation | None
    contact_limits: ContactLimits | None
    rates: Mapping

    @property
    def frames(self):
        """Links at which the external wrench is published."""
        return tuple(dict.fromkeys(filter(None, self.values["external_wrench.frames"])))

    @property
    def unjudged_without(self):
        """Parameters without which no collision is reported; none where collisions are."""
        if self.observation and self.observation.collision.limits:
            return ()
        threshold = ("collision.threshold",)
        return threshold if self.observation else ("external_torque.gain", *threshold)

    @classmethod
    def of(cls, values):
        """Return the settings of parameters by name, checked one by one and together.

        Raise InputError for an invalid value.
        """
        for name, spec in PARAMETERS.items():
            check(name, values[name], spec)
        payloads_of(values["payloads"])
        sources = [name for name in ("gravity_frame", "gravity_imu") if values[name]]
        if sources and (values["floating_base"] or len(sources) > 1):
            raise InputError(
                f"parameter '{sources[-1]}' is '{values[sources[-1]]}'; expected empty because "
                f"'{'floating_base' if values['floating_base'] else sources[0]}' is set."
            )
        for name in ("locked_joints", "armature"):
            assignments(name, [entry for entry in values[name] if entry != ALL])
        thresholds = EnergyThresholds(
            assignments("energy.warn", values["energy.warn"], minimum=0.0),
            assignments("energy.error", values["energy.error"], minimum=0.0),
        )
        thresholds.check_order()
        contact = limits_of(values)
        rates = by_name("max_rate", _with_defaults("max_rate", values, RATES), RATES)
        settings = cls(
            values, _input_options(values), thresholds, observation_of(values), contact, rates
        )
        if settings.frames and not settings.observation:
            raise InputError(
                "parameter external_torque.gain is 0; "
                "expected a number above 0 because external_wrench.frames is set."
            )
        settings.check_load()
        settings.check_reaction()
        return settings

    def check_load(self):
        """Reject a link of the load without an observer whose noise is known."""
        link = self.values["load.link"]
        observation = self.observation
        if link and not (observation and observation.covariance):
            raise InputError(
                f"parameter 'load.link' is '{link}'; expected external_torque.gain above 0 and an "
                "external_torque.covariance beside it. Calibrate (diag-dynamics calibrate)."
            )

    def check_reaction(self):
        """Reject a service that would never be called."""
        values = self.values
        if values["reaction.service"]:
            event = values["reaction.event"]
            thresholds = getattr(self.observation, event) if self.observation else None
            if not (thresholds and thresholds.limits):
                raise InputError(
                    f"parameter {event}.threshold is empty; expected thresholds and "
                    "external_torque.gain above 0 because reaction.service is set. Calibrate "
                    "(diag-dynamics calibrate)."
                )


def _with_defaults(name, values, defaults):
    """Return entries of at least 0 by name; without an asterisk, missing ones are the defaults."""
    entries = assignments(name, values[name], minimum=0.0)
    return entries if ALL in entries else {**defaults, **entries}


def _input_options(values):
    """Return the options of joint states."""
    advice = " Set effort_available to false for joints without effort or in an unknown unit."
    effort_scale = assignments("effort_scale", values["effort_scale"], advice=advice)
    if zeros := [name for name, scale in effort_scale.items() if not scale]:
        raise InputError(
            f"parameter 'effort_scale' of '{zeros[0]}' is 0; expected another number.{advice}"
        )
    return Options(
        timeouts=_with_defaults("joint_timeout", values, {ALL: JOINT_TIMEOUT}),
        estimate_velocity=values["missing_velocity"] == "estimate",
        effort_available=assignments("effort_available", values["effort_available"], bool),
        effort_scale=effort_scale,
        effort_includes_gravity=assignments(
            "effort_includes_gravity", values["effort_includes_gravity"], bool
        ),
        mimic_tolerance=values["mimic_tolerance"],
        max_age=values["max_age"],
        velocity_filter_time=values["velocity_filter_time"],
        stuck_timeout=values["stuck_timeout"],
        beyond_limits=values["plausibility.beyond_limits"],
        beyond_velocity=values["plausibility.beyond_velocity"],
        jump=values["plausibility.jump"],
    )


def observation_of(values):
    """Return the Observation; None if the gain is 0."""
    gain = values["external_torque.gain"]
    collision, contact = (_thresholds(values, event) for event in ("collision", "contact"))
    _check_contact_order(collision, contact)
    if (collision.limits or contact.limits) and not gain:
        raise InputError(
            "parameter external_torque.gain is 0; expected that of the calibration because "
            "collision.threshold or contact.threshold is set. A file of diag-dynamics calibrate "
            "without it is cut."
        )
    if not gain:
        return None
    friction = values["external_torque.friction"]
    return Observation(gain, friction, collision, contact, *_covariance(values))


def _thresholds(values, event):
    """Return the Thresholds of collision or contact."""
    parameter = f"{event}.threshold"
    limits = assignments(parameter, values[parameter], minimum=0.0)
    limits = {name: limit or math.inf for name, limit in limits.items()}
    if set(limits.values()) == {math.inf}:
        limits = {}
    options = (values[f"collision.{name}"] for name in ("release", "hold_off"))
    standing = values["collision.standing"] or math.inf
    return Thresholds(limits, *options, standing, values["collision.stiction"])


def _covariance(values):
    """Return joints and entries of the covariance, both empty if it is unknown."""
    names = tuple(filter(None, values["external_torque.covariance_joints"]))
    numbers = (
        tuple(values["external_torque.covariance"])
        if names or any(values["external_torque.covariance"])
        else ()
    )
    if len(numbers) != len(names) ** 2 or len({*names}) != len(names):
        raise InputError(
            f"parameter external_torque.covariance has {len(numbers)} numbers "
            f"for {len(names)} covariance_joints; "
            f"expected {len(names)} x {len(names)}, each joint once."
        )
    matrix = np.array(numbers).reshape(2 * [len(names)])
    if not np.allclose(matrix, matrix.T, rtol=1e-6, atol=0.0):
        raise InputError(
            "parameter external_torque.covariance is not symmetric; expected a symmetric matrix."
        )
    if joint := singular_joint(names, matrix):
        raise InputError(
            f"parameter external_torque.covariance is singular at '{joint}'; "
            "expected a positive definite matrix. "
            "Calibrate with a recording that has noise of each joint."
        )
    return names, numbers


def _check_contact_order(collision, contact):
    """Reject thresholds of contact above those of a collision."""
    names = [name for name in {**collision.limits, **contact.limits} if name not in (TOTAL, NORM)]
    limits = zip(
        (*names, TOTAL, NORM), contact.of_names(names), collision.of_names(names), strict=True
    )
    for name, low, high in limits:
        if high < low < math.inf:
            value, bound = distinct(low, high)
            raise InputError(
                f"parameter contact.threshold of '{name}' is {value}; expected at most {bound} "
                "(collision.threshold)."
            )
