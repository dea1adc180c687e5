# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints of a robot, options of the rules with their limits and the meaning of efforts, and states."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from diag_dynamics.entries import by_name
from diag_dynamics.exceptions import InputError, UnsupportedError
from diag_dynamics.joint_states.stamps import nanoseconds
from diag_dynamics.joint_states.steps import MAX_STEP_TIME, MAX_STEP_TIME_WITHOUT_LIMIT
from diag_dynamics.model.followers import FollowerMotion
from diag_dynamics.model.joint_types import places, single_joints

_NONE = MappingProxyType({})


class Joints(NamedTuple):
    """Joints of a robot: the independent ones, whose states are needed, and their followers."""

    names: tuple
    mimics: Mapping = _NONE  # Mimic by name of the follower
    continuous: frozenset = frozenset()  # names of joints whose position is an angle that wraps
    lower: np.ndarray | None = None  # position limits [rad, m]
    upper: np.ndarray | None = None
    velocity: np.ndarray | None = None  # velocity limits [rad/s, m/s]
    effort: np.ndarray | None = None  # effort limits [N m, N]
    effort_scale: Mapping = _NONE  # effort by reported unit [N m, N], where the options have none; NaN if unknown
    motion: FollowerMotion | None = None  # of a model with followers whose ratios change


class Options(NamedTuple):
    """Options of the rules: the monitor's parameters. Mappings are by joint, ``*`` for all others; 0 disables a rule."""

    timeout: float = 0.5
    timeouts: Mapping = _NONE
    mimic_tolerance: float = 0.0
    max_age: float = 0.0
    refuse_foreign: bool = False
    estimate_velocity: bool = False
    velocity_filter_time: float = 0.01
    effort_available: Mapping = _NONE
    effort_scale: Mapping = _NONE
    effort_includes_gravity: Mapping = _NONE
    max_position: float = 0.0
    max_velocity: float = 0.0
    max_effort: float = 0.0
    beyond_limits: float = 0.0
    beyond_velocity: float = 0.0
    beyond_effort: float = 0.0
    jump: float = 0.0
    stuck_timeout: float = 0.0
    reject_stuck: bool = False
    odom_timeout: float = 0.0


class RobotState(NamedTuple):
    """A state of a robot; times are in nanoseconds."""

    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray | None
    newest: int
    oldest: int
    stamp_is_receive_time: bool
    velocity_estimated: bool = False
    partial: np.ndarray | None = None  # efforts, NaN where unknown, if some but not all are known


def joints_of(model):
    """Return the :class:`Joints` of a model; UnsupportedError names a flexible link, whose modes no joint state has."""
    for link in model.flexible_links:
        text = f"robot '{model.name}' has the flexible link '{link}', whose modes no joint state carries."
        raise UnsupportedError(f"{text} Omit flexible_links.")
    names = single_joints(model)
    at, dof = places(names, model.coordinate_names), places(names, model.dof_names)
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
    count = len(joints.names)
    turns = np.array([name in joints.continuous for name in joints.names], dtype=bool)
    most, slack = np.where(turns, np.inf, options.max_position or np.inf), options.beyond_limits or np.inf
    lower = np.full(count, -np.inf) if joints.lower is None else np.asarray(joints.lower, dtype=float)
    upper = np.full(count, np.inf) if joints.upper is None else np.asarray(joints.upper, dtype=float)
    velocity, effort = (_known(limit, count) for limit in (joints.velocity, joints.effort))
    return {
        "lower": np.maximum(lower - slack, -most),
        "upper": np.minimum(upper + slack, most),
        "turns": turns,
        "fastest": _multiple(options.beyond_velocity, velocity, options.max_velocity),
        "strongest": _multiple(options.beyond_effort, effort, options.max_effort),
        "reach": np.where(np.isfinite(velocity), velocity, 0.0),
        "lasting": np.where(np.isfinite(velocity), MAX_STEP_TIME, MAX_STEP_TIME_WITHOUT_LIMIT),
    }


def _known(limit, count):
    """Return limits, infinite where there is none."""
    limit = np.full(count, np.inf) if limit is None else np.asarray(limit, dtype=float)
    return np.where(limit > 0.0, limit, np.inf)


def _multiple(factor, limit, most):
    """Return bounds by multiples of a limit, and by one number for all; 0 is no bound."""
    return np.minimum(factor * limit if factor else np.inf, most or np.inf)


def age_limits(names, options):
    """Return age limits [ns], infinite for none."""
    ages = by_name("joint_timeouts", options.timeouts, names)
    return np.array([nanoseconds(ages.get(name, options.timeout)) or np.inf for name in names], dtype=float)


class EffortMeaning:
    """Unit of a driver's efforts, whether they include gravity, and whether they are available.

    `factors` of joints, then mimic joints, are NaN without usable efforts; `without_gravity` is 1 for joints whose efforts
    lack gravity, None without any; `undeclared` joints lack a scale or gravity. Undeclared efforts are N m with gravity. The
    `scale` of a robot's parameters is used for joints without one in the options.
    """

    def __init__(self, joints, followers, options, scale):
        for name in options.effort_includes_gravity:
            if name in followers:
                raise InputError(
                    f"parameter 'effort_includes_gravity' names '{name}', which follows another joint: gravity is "
                    "declared for the joint it follows."
                )
        names = (*joints, *followers)
        available = by_name("effort_available", options.effort_available, names)
        scale = {**scale, **by_name("effort_scale", options.effort_scale, names)}
        gravity = by_name("effort_includes_gravity", options.effort_includes_gravity, names)
        factors = [scale.get(name, 1.0) if available.get(name, True) else np.nan for name in names]
        self.factors = np.array(factors, dtype=float)
        without = np.array([not gravity.get(name, True) for name in joints], dtype=float)
        self.without_gravity = without if without.any() else None
        self.undeclared = tuple(n for n in joints if available.get(n, True) and (n not in scale or n not in gravity))
