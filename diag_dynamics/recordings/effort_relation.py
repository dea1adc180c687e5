# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Relation of measured efforts to the torques that the model needs: a factor for each joint, with its standard error."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.recordings.smoothing import smoothed
from diag_dynamics.sweeps.spatial import ANGULAR_X

NEEDED = GRAVITY_X, GRAVITY_Y, GRAVITY_Z, INERTIAL = range(4)
"""Columns of a joint's torque: of gravity along each axis of the base by 1 m/s², and of inertia."""

DAMPING, FRICTION, OFFSET, ROTOR = range(4, 8)
"""Columns that resist: rate, its sign, a constant, and the acceleration."""

COLUMNS = 8

BLOCK, MAX_BLOCKS, MIN_BLOCKS = 0.5, 32, 4
"""Length of a block [s], which doubles where there would be more of them than so many; fewer give no standard error."""

ERRORS = 4.0
"""Standard errors on both sides of a factor within which the true one is."""

MODEL_ERROR = 0.1
"""Torque that a model may miss at any joint, in parts of the largest torque of a joint of its kind: cables, a tool."""

LIMITS, WIDE_LIMITS = (0.6, 1.6), (0.2, 5.0)
"""Factors that are accepted: of gravity, and of inertia or where the robot may carry a payload."""

GEARED_LIMITS = 0.2, 100.0
"""Factors that are accepted where a rotor's inertia, which is reflected by its gear squared, is part of the factor."""

SMALL_ERRORS = 8.0
"""The same below the limits of a light joint: noise and cables hide the torque of right ones."""

SINGULAR = 1e-9
"""Part of a column's square below which it depends on others."""


class Run(NamedTuple):
    """States that follow one another without gaps."""

    t: np.ndarray
    """[s], rising, shape (T,)."""
    q: np.ndarray
    """[rad, m], shape (T, nq)."""
    qd: np.ndarray
    """[rad/s, m/s], shape (T, nv)."""
    tau: np.ndarray
    """[N m, N], shape (T, nv)."""


class Relation(NamedTuple):
    """Factors from the model's torque to the measured effort, by joint; shape (nv,) each."""

    factor: np.ndarray
    """Slope of the effort over the model's torque, of gravity and inertia; NaN where the motion does not show it."""
    error: np.ndarray
    """Its standard error, from blocks left out in turn: residuals of neighbours in time depend on one another."""
    model_error: np.ndarray
    """What the factor may be off by, because the model is."""
    inertial: np.ndarray
    """Slope over the torque of inertia alone, without the acceleration among the columns."""
    inertial_error: np.ndarray
    heavy: np.ndarray
    """Whether most of the torque is gravity, bool."""
    geared: np.ndarray
    """Whether the torque cannot be told from a rotor's, which is part of the factor then, bool: as of a linear axis."""
    torque: np.ndarray
    """Standard deviation of the model's torque that no friction or offset explains [N m, N]."""

    def limits(self, tolerant=False):
        """Return the smallest and the largest accepted factor, shape (nv,) each."""
        wide = ~self.heavy | tolerant
        bounds = zip(LIMITS, WIDE_LIMITS, GEARED_LIMITS, strict=True)
        return tuple(np.where(self.geared, geared, np.where(wide, other, own)) for own, other, geared in bounds)

    def judged(self):
        """Return which joints have a factor that tells 1 from 0, bool."""
        return ERRORS * self.error + self.model_error < 1.0

    def unrelated(self):
        """Return which joints have a factor that is 0 by its error, though the motion tells 1 from 0, bool."""
        spread = ERRORS * self.error
        return self.judged() & (np.abs(self.factor) <= spread) & (self.factor + spread + self.model_error < 1.0)

    def wrong(self, tolerant=False):
        """Return which joints have a factor that is beyond the limits by more than its errors, or unrelated, bool."""
        low, high = self.limits(tolerant)
        margin = ERRORS * self.error + self.model_error
        with np.errstate(invalid="ignore"):
            return (self.factor + margin < low) | (self.factor - margin > high) | self.unrelated()

    def doubtful(self):
        """Return which joints have a factor below 0 or far from 1 by its own standard error, without the model's, bool."""
        low, high = self.limits(tolerant=True)
        with np.errstate(invalid="ignore"):
            other_sign, small = self.factor + ERRORS * self.error < 0.0, self.factor + SMALL_ERRORS * self.error < low
            return other_sign | small | (self.factor - ERRORS * self.error > high)


class EffortRelation:
    """Compares efforts with the torques that the model needs, over runs of states.

    Parameters
    ----------
    model : RobotModel
        With a fixed base, and joints of one degree of freedom.
    """

    def __init__(self, model):
        self.model, nv = model, model.nv
        self._needs = DiagonalDynamics(model)
        self._pulls = [DiagonalDynamics(model.with_gravity(axis)) for axis in np.eye(3)]
        coupled = {joint for group in model.coupled_groups for joint in group}
        self._turning = np.array([name in model.continuous_joints and name not in coupled for name in model.dof_names])
        own = model.bodies[1:][model.bodies["owner"][1:] == np.arange(1, len(model.bodies))]
        self.slides = np.zeros(nv, dtype=bool)
        self.slides[own["dof"][own["direction"] < ANGULAR_X]] = True
        self.rows = 0
        self.products = np.zeros((nv, COLUMNS + nv, COLUMNS + nv))
        """Of each joint's columns and all efforts with one another."""
        self._blocks, self._length = [], BLOCK

    def take(self, states):
        """Take in states that follow one another: `t`, `q`, `qd`, `tau`."""
        if len(states.t) < 2:
            return
        if self._turning.any():
            q = states.q.copy()
            q[:, self._turning] = np.unwrap(q[:, self._turning], axis=0)
            states = states._replace(q=q)
        q, qd, tau, qdd = smoothed(states, states.tau)
        pulls = np.stack([one.gravity_torque_batch(q) for one in self._pulls])
        inertial = self._needs.inverse_dynamics_batch(q, qd, qdd) - np.tensordot(self.model.gravity, pulls, 1)
        turned = np.tanh(qd / max(self.model.friction_velocity, 1e-9))
        columns = np.stack([*pulls, inertial, qd, turned, np.ones_like(qd), qdd], axis=-1).transpose(1, 0, 2)
        number = ((states.t - states.t[0]) // self._length).astype(int)
        for part in np.split(np.arange(len(q)), np.flatnonzero(np.diff(number)) + 1):
            self._add(columns[:, part], tau[part])
        while len(self._blocks) > MAX_BLOCKS:
            pairs = [self._blocks[k : k + 2] for k in range(0, len(self._blocks), 2)]
            self._blocks, self._length = [sum(pair[1:], pair[0]) for pair in pairs], 2.0 * self._length

    def _add(self, columns, tau):
        own = np.concatenate([columns, tau.T[:, :, None]], axis=-1)
        self._blocks.append(own.transpose(0, 2, 1) @ own)
        both = np.concatenate([columns, np.broadcast_to(tau, (self.model.nv, *tau.shape))], axis=-1)
        self.products += both.transpose(0, 2, 1) @ both
        self.rows += len(tau)

    def relation(self):
        """Return the :class:`Relation`."""
        nv, gravity = self.model.nv, self.model.gravity
        needed, pull = np.zeros((2, COLUMNS + 1))
        needed[:INERTIAL], needed[INERTIAL], pull[:INERTIAL] = gravity, 1.0, gravity
        inertia, effort = np.eye(COLUMNS + 1)[[INERTIAL, COLUMNS]]
        rest = np.eye(COLUMNS + 1)[DAMPING:COLUMNS]
        whole = sum(self._blocks) if self._blocks else np.zeros((nv, COLUMNS + 1, COLUMNS + 1))
        samples = [whole, *(whole - block for block in self._blocks)]
        together = np.array([_slopes(one, [needed], rest, effort) for one in samples])
        apart = np.array([_slopes(one, [inertia, pull], rest[:-1], effort) for one in samples])
        factor, error = together[0, :, 0], _jackknife(together[1:, :, 0])
        inertial, inertial_error = apart[0, :, 0], _jackknife(apart[1:, :, 0])
        geared = ~np.isfinite(factor) & np.isfinite(inertial)
        rests = [rest[:-1] if alone else rest for alone in geared]
        seen = [_left(one, needed, beside) for one, beside in zip(whole, rests, strict=True)]
        seen = np.sqrt(np.array(seen) / max(self.rows, 1))
        weight, moving = (np.array([_left(one, column, rest[2:3]) for one in whole]) for column in (pull, inertia))
        largest = np.array([seen[self.slides == slides].max(initial=0.0) for slides in self.slides])
        with np.errstate(divide="ignore", invalid="ignore"):
            model_error = np.where(seen > 0.0, MODEL_ERROR * largest / seen, np.inf)
        return Relation(
            np.where(geared, inertial, factor),
            np.where(geared, inertial_error, error),
            model_error,
            inertial,
            inertial_error,
            weight > moving,
            geared,
            seen,
        )


def _slopes(products, columns, rest, effort):
    """Return slopes of the effort over columns, rest being columns, too; of each joint; NaN where they depend on others."""
    found = np.full((len(products), len(columns)), np.nan)
    for k, own in enumerate(products):
        used = np.array([*columns, *rest])
        square, right = used @ own @ used.T, used @ own @ effort
        scale = np.sqrt(np.diag(square))
        kept = scale > 0.0
        if not kept[0]:
            continue
        index = np.flatnonzero(kept)
        scaled = square[np.ix_(index, index)] / np.outer(scale[index], scale[index])
        inverse = np.linalg.pinv(scaled, rcond=SINGULAR, hermitian=True)
        if (
            1.0 - scaled[0, 1:] @ np.linalg.pinv(scaled[1:, 1:], rcond=SINGULAR, hermitian=True) @ scaled[1:, 0]
            < SINGULAR
        ):
            continue
        found[k, index[index < len(columns)]] = (inverse @ (right[index] / scale[index]) / scale[index])[
            : int((index < len(columns)).sum())
        ]
    return found


def _left(products, column, rest):
    """Return the square of a column without what the rest explains."""
    square = column @ products @ column
    inner, across = rest @ products @ rest.T, rest @ products @ column
    scale = 1.0 / np.sqrt(np.maximum(np.diag(inner), 1e-300))
    scaled = inner * np.outer(scale, scale)
    left = square - (across * scale) @ np.linalg.pinv(scaled, rcond=SINGULAR, hermitian=True) @ (across * scale)
    return left if left > SINGULAR * square else 0.0


def _jackknife(without):
    """Return standard errors from values without each block in turn."""
    count = len(without)
    if count < MIN_BLOCKS:
        return np.full(without.shape[1], np.inf)
    with np.errstate(invalid="ignore"):
        error = np.sqrt((count - 1) / count * ((without - without.mean(axis=0)) ** 2).sum(axis=0))
    return np.where(np.isfinite(error), error, np.inf)
