# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints of a robot, options of the rules, states, and positions of links.

Options have limits and the meaning of efforts.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from diag_dynamics.entries import ALL, by_name
from diag_dynamics.exceptions import InputError, UnsupportedError
from diag_dynamics.joint_states.jumps import (
    MAX_EFFORT,
    MAX_POSITION,
    MAX_STEP_TIME,
    MAX_STEP_TIME_WITHOUT_LIMIT,
    MAX_VELOCITY,
)
from diag_dynamics.joint_states.stamps import nanoseconds
from diag_dynamics.model.joint_types import places, single_joints
from diag_dynamics.model.mimic import FollowerMotion

_NONE = MappingProxyType({})
_NO_LIMIT = np.array([-np.inf, np.inf])  # lower and upper
JOINT_TIMEOUT = 0.5
"""Default age limit of a joint [s]."""

BEYOND_EFFORT = 4.0
"""Largest plausible effort as a multiple of the URDF limit."""

MAX_GAP = 0.1
"""Interval of states [s] beyond which the rate of a spring torque is unknown."""


class Joints(NamedTuple):
    """Joints of a robot: the independent ones, whose states are needed, and their followers."""

    names: tuple
    mimics: Mapping = _NONE  # Mimic by name of the follower
    continuous: frozenset = frozenset()  # names of joints whose position is an angle that wraps
    lower: np.ndarray = _NO_LIMIT[0]  # position limits [rad, m]
    upper: np.ndarray = _NO_LIMIT[1]
    velocity: np.ndarray = _NO_LIMIT[1]  # velocity limits [rad/s, m/s]
    effort: np.ndarray = _NO_LIMIT[1]  # effort limits [N m, N]
    effort_scale: Mapping = (
        _NONE  # effort by reported unit [N m, N], where the options have none; NaN if unknown
    )
    motion: FollowerMotion | None = None  # of a model with followers whose ratios change


class Options(NamedTuple):
    """Options of the rules, from the monitor's parameters.

    Mappings are by joint, ``*`` for all others. The number 0 disables a rule.
    """

    timeouts: Mapping = MappingProxyType({ALL: JOINT_TIMEOUT})
    mimic_tolerance: float = 0.0
    max_age: float = 0.0
    refuse_foreign: bool = False
    estimate_velocity: bool = False
    velocity_filter_time: float = 0.01
    effort_available: Mapping = _NONE
    effort_scale: Mapping = _NONE
    effort_includes_gravity: Mapping = _NONE
    beyond_limits: float = 0.0
    beyond_velocity: float = 0.0
    jump: float = 0.0
    stuck_timeout: float = 0.0


class RobotState(NamedTuple):
    """Positions, velocities and efforts of all joints of a robot at one time.

    The rules of joint states assemble it from messages; laws, watches and the observer read it.
    Times are in nanoseconds.
    """

    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray | None
    newest: int
    oldest: int
    stamp_is_receive_time: bool
    velocity_estimated: bool = False
    partial: np.ndarray | None = None  # efforts, NaN where unknown, if some but not all are known


def joints_of(model):
    """Return the :class:`Joints` of a model.

    UnsupportedError names a flexible link, because no joint state has its modes.
    """
    if model.flexible_links:
        raise UnsupportedError(
            f"robot '{model.name}' has the flexible link '{next(iter(model.flexible_links))}', "
            "whose modes no joint state carries. Omit flexible_links."
        )
    names = single_joints(model)
    at = places(names, model.coordinate_names)
    dof = places(names, model.dof_names)
    return Joints(
        names,
        model.mimics,
        frozenset(model.continuous_joints),
        model.lower[at],
        model.upper[at],
        model.velocity_limit[dof],
        model.effort_limit[dof],
        model.effort_scale,
        FollowerMotion(model) if model.followers else None,
    )


# --- Limits of values and meaning of efforts, an array of one number for each joint


def joint_limits(joints, options):
    """Return the bounds in memory.JOINT by name.

    Continuous joints have no position limits. A URDF limit of 0 for velocity or effort is unknown.
    """
    turns = np.array([name in joints.continuous for name in joints.names], bool)
    bound = np.where(turns, np.inf, MAX_POSITION)
    slack = options.beyond_limits or np.inf
    velocity, effort = (
        np.where(limit > 0.0, limit, np.inf) for limit in (joints.velocity, joints.effort)
    )
    return {
        "lower": np.maximum(joints.lower - slack, -bound),
        "upper": np.minimum(joints.upper + slack, bound),
        "turns": turns,
        "fastest": np.minimum((options.beyond_velocity or np.inf) * velocity, MAX_VELOCITY),
        "strongest": np.minimum(BEYOND_EFFORT * effort, MAX_EFFORT),
        "reach": np.where(np.isfinite(velocity), velocity, 0.0),
        "lasting": np.where(np.isfinite(velocity), MAX_STEP_TIME, MAX_STEP_TIME_WITHOUT_LIMIT),
    }


def age_limits(names, options):
    """Return age limits [ns], infinite for none."""
    ages = by_name("joint_timeout", options.timeouts, names)
    return np.array([nanoseconds(ages.get(name, 0.0)) or np.inf for name in names], float)


class EffortMeaning:
    """Unit of a driver's efforts, whether they include gravity, and whether they are available.

    `factors` of joints, then mimic joints, are NaN without usable efforts; `without_gravity` is 1
    for joints whose efforts lack gravity, None without any; `undeclared` joints lack a scale or
    gravity. Undeclared efforts are N m with gravity. The `scale` of a robot's parameters is used
    for joints without one in the options.
    """

    def __init__(self, joints, followers, options, scale):
        for name in options.effort_includes_gravity:
            if name in followers:
                raise InputError(
                    f"parameter 'effort_includes_gravity' names '{name}', "
                    "which follows another joint: gravity is declared for the joint it follows."
                )
        names = (*joints, *followers)
        available = by_name("effort_available", options.effort_available, names)
        scale = {**scale, **by_name("effort_scale", options.effort_scale, names)}
        gravity = by_name("effort_includes_gravity", options.effort_includes_gravity, names)
        factors = [scale.get(name, 1.0) if available.get(name, True) else np.nan for name in names]
        self.factors = np.array(factors, float)
        without = np.array([not gravity.get(name, True) for name in joints], float)
        self.without_gravity = without if without.any() else None
        self.undeclared = tuple(
            n for n in joints if available.get(n, True) and (n not in scale or n not in gravity)
        )


class LinkPositions:
    """Conversion of states from motor positions to link positions, in their order.

    q = θ − δ and q̇ = θ̇ − δ̇ have the stretch δ = (τ_J − d δ̇)/k and δ̇ = τ̇_J/k. τ̇_J is the
    difference to the state before. Without that state δ̇ is 0, without an effort δ is 0, too.
    `has_any` is whether a joint has a motor position and a spring torque.
    """

    def __init__(self, model):
        flexible = {
            n: j
            for n, j in model.flexible_joints.items()
            if (j.position, j.effort) == ("motor", "spring")
        }
        self._at = places(flexible, model.coordinate_names)
        self._dofs = places(flexible, model.dof_names)
        self._stiffness = np.array([joint.stiffness for joint in flexible.values()])
        self._damping = np.array([joint.damping for joint in flexible.values()])
        self.has_any = bool(flexible)
        self.forget()

    def forget(self):
        """Start anew, as after a restart of time."""
        self._last = 0, np.full(len(self._at), np.nan)

    def convert(self, stamp, position, velocity, effort, jumped):
        """Return positions and rates of links, (T, nq) and (T, nv).

        Rows are states of stamps [ns]; a row that `jumped` has no state before it.
        """
        if not len(stamp):
            return position, velocity
        torque = effort[:, self._dofs]
        dt = 1e-9 * np.diff(stamp, prepend=self._last[0])[:, None]
        change = np.diff(torque, axis=0, prepend=self._last[1][None])
        follows = (dt > 0.0) & (dt <= MAX_GAP) & ~np.asarray(jumped)[:, None]
        rate = (
            np.nan_to_num(np.divide(change, dt, out=np.zeros_like(change), where=follows))
            / self._stiffness
        )
        self._last = int(stamp[-1]), torque[-1]
        position = position.copy()
        velocity = velocity.copy()
        position[:, self._at] -= np.nan_to_num(
            torque / self._stiffness - self._damping * rate / self._stiffness
        )
        velocity[:, self._dofs] -= rate
        return position, velocity
