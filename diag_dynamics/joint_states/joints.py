# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints of a robot, options of the rules, and states."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

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


def joints_of(model):
    """Return the :class:`Joints` of a model."""
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
    )
