# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Relation of measured efforts to the torques of the model: a factor for each joint, with its standard error."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.model import RobotModel
from diag_dynamics.model.joint_types import sliding_dofs
from diag_dynamics.optional import require

CUTOFF, ORDER, MEMORY = 5.0, 4, 3.0
"""Zero-phase Butterworth low-pass: cutoff frequency [Hz], order, and length of its response [s]."""

INERTIAL, DAMPING, FRICTION, OFFSET, ROTOR, COLUMNS = range(3, 9)
"""Columns of torque: of gravity along each axis of the base by 1 m/s² (0 to 2), of inertia, and of what resists: rate, its
sign, a constant, and the acceleration. Efforts follow them."""

BLOCK, MAX_BLOCKS, MIN_BLOCKS = 0.5, 32, 4
"""Length of a block [s], which doubles beyond so many blocks, and fewest blocks for a standard error."""

ERRORS, SMALL_ERRORS = 4.0, 8.0
"""Standard errors on both sides of a factor that contain the true one, and below the limits of a light joint."""

MODEL_ERROR = (
    0.1  # torque that a model may miss at any joint over the largest torque of a joint of its kind
)
LIMITS, WIDE_LIMITS, GEARED_LIMITS = (0.6, 1.6), (0.2, 5.0), (0.2, 100.0)
"""Accepted factors: of gravity; of inertia, or with an unknown payload; and of inertia with an unknown rotor."""

SINGULAR = 1e-9  # fraction of a column's square below which it depends on others


def smoothed(t, q, qd, tau):
    """Return q, q̇, τ and q̈ at even times, through a zero-phase low-pass with the gain 1 / (1 + (f/f_c)^2n)."""
    next_fast_len = require("scipy.fft", "the judgement of efforts").next_fast_len
    count, nq, nv = len(t), q.shape[1], qd.shape[1]
    even = np.linspace(t[0], t[-1], count)
    step = even[1] - even[0]
    columns = np.ascontiguousarray(np.hstack([q, qd, tau]).T)
    values = np.stack([np.interp(even, t, column) for column in columns])
    memory = int(min(count - 1, np.ceil(MEMORY / step)))
    more = next_fast_len(count + 2 * memory, real=True) - count
    head = min(count - 1, more // 2)
    pad = (0, 0), (head, min(count - 1, more - head))
    whole = np.pad(values, pad, mode="reflect", reflect_type="odd")
    trend = whole[:, :1] + np.linspace(0.0, 1.0, whole.shape[1]) * (whole[:, -1:] - whole[:, :1])
    gain = 1.0 / (1.0 + (np.fft.rfftfreq(whole.shape[1], step) / CUTOFF) ** (2 * ORDER))
    smooth = np.fft.irfft(gain * np.fft.rfft(whole - trend), whole.shape[1]) + trend
    smooth = np.vstack([smooth, np.gradient(smooth[nq : nq + nv], step, axis=1)])[
        :, head : head + count
    ]
    return tuple(
        np.ascontiguousarray(part.T) for part in np.split(smooth, [nq, nq + nv, nq + 2 * nv])
    )


def remaining(products, kept, rest):
    """Return products (…, m, m) of the kept columns, rows of (k, m), without what the rest, rows of (r, m), explains."""
    inner, across = rest @ products @ rest.T, rest @ products @ kept.T
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(inner, axis1=-2, axis2=-1), 1e-300))[..., None]
    inverse = np.linalg.pinv(
        inner * scale * np.swapaxes(scale, -1, -2), rcond=SINGULAR, hermitian=True
    )
    across = across * scale
    return kept @ products @ kept.T - np.swapaxes(across, -1, -2) @ inverse @ across


def _regress(products, column, rest):
    """Return squares of a column without what the rest explains (0 if dependent), and the efforts' slopes over it."""
    left = remaining(products, np.vstack([column, np.eye(len(column))[COLUMNS:]]), rest)
    square = np.where(
        left[..., 0, 0] > SINGULAR * (products @ column @ column), left[..., 0, 0], 0.0
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        return square, np.diagonal(left[..., 0, 1:], axis1=-2, axis2=-1) / np.where(
            square, square, np.nan
        )


def largest_of_kind(model, values):
    """Return for each joint the largest value of a joint of its kind, rotary or prismatic; shape (nv,)."""
    slides = np.array(sliding_dofs(model))
    return np.array([values[slides == one].max(initial=0.0) for one in slides])


def _jackknife(values):
    """Return standard errors from values without each block in turn."""
    count = len(values)
    if count < MIN_BLOCKS:
        return np.full(values.shape[1], np.inf)
    error = np.sqrt((count - 1) / count * ((values - values.mean(axis=0)) ** 2).sum(axis=0))
    return np.where(np.isfinite(error), error, np.inf)


class Relation(NamedTuple):
    """Factors from the model's torque to the measured effort, by joint; shape (nv,) each but for the first two."""

    model: RobotModel
    products: np.ndarray  # means, of gravity's columns, inertia and all efforts without what resists, (nv, 4 + nv, 4 + nv)
    factor: (
        np.ndarray
    )  # slope over the torque of gravity and inertia; NaN if the motion does not show it
    error: (
        np.ndarray
    )  # its standard error, by blocks of time left out: residuals of neighbours in time are alike
    model_error: np.ndarray  # error of the factor due to the model
    inertial: (
        np.ndarray
    )  # slope over the torque of inertia alone, without the acceleration among the columns
    inertial_error: np.ndarray
    heavy: np.ndarray  # whether most of the torque is gravity, bool
    geared: (
        np.ndarray
    )  # whether the factor contains that of an unknown rotor, bool: as of a linear axis
    torque: (
        np.ndarray
    )  # standard deviation of the model's torque that no friction or offset explains [N m, N]

    def limits(self, tolerant=False):
        """Return the smallest and the largest accepted factor, shape (2, nv); `tolerant` of a payload."""
        wide = (~self.heavy | tolerant)[:, None]
        return np.where(self.geared[:, None], GEARED_LIMITS, np.where(wide, WIDE_LIMITS, LIMITS)).T

    def judged(self):
        """Return which joints have a factor that tells 1 from 0, bool."""
        return ERRORS * self.error + self.model_error < 1.0

    def unrelated(self):
        """Return which joints have a factor that is 0 by its error, and cannot be 1, bool."""
        spread = ERRORS * self.error
        return (
            self.judged()
            & (np.abs(self.factor) <= spread)
            & (self.factor + spread + self.model_error < 1.0)
        )

    def wrong(self, tolerant=False):
        """Return which joints have a factor beyond the limits by more than its errors, or are unrelated, bool."""
        (low, high), margin = self.limits(tolerant), ERRORS * self.error + self.model_error
        return (self.factor + margin < low) | (self.factor - margin > high) | self.unrelated()

    def doubtful(self):
        """Return which joints have a factor below 0 or far from 1 without the error of the model, bool."""
        (low, high), spread = self.limits(tolerant=True), ERRORS * self.error
        small = self.factor + SMALL_ERRORS * self.error < low
        return small | (self.factor + spread < 0.0) | (self.factor - spread > high)


class EffortRelation:
    """Compare efforts with the torques of a model with a fixed base and joints of one degree of freedom."""

    def __init__(self, model):
        self._model, self._dynamics = model, DiagonalDynamics(model)
        self._pulls = [DiagonalDynamics(model.with_gravity(axis)) for axis in np.eye(3)]
        coupled = {joint for group in model.coupled_groups for joint in group}
        self._turning = [
            name in model.continuous_joints and name not in coupled for name in model.dof_names
        ]
        size = COLUMNS + model.nv
        self._rows, self._length, self._blocks = 0, BLOCK, np.zeros((0, model.nv, size, size))

    def columns(self, t, q, qd, tau):
        """Return the COLUMNS of states without gaps at even times, (nv, T, 8), and smoothed efforts there, (T, nv)."""
        q, qd, tau, qdd = smoothed(t, np.where(self._turning, np.unwrap(q, axis=0), q), qd, tau)
        pulls = np.stack([one.gravity_torque(q) for one in self._pulls])
        inertial = self._dynamics.inverse_dynamics(q, qd, qdd) - np.tensordot(
            self._model.gravity, pulls, 1
        )
        turned = np.tanh(qd / max(self._model.friction_velocity, 1e-9))
        columns = np.stack([*pulls, inertial, qd, turned, np.ones_like(qd), qdd], axis=-1)
        return columns.transpose(1, 0, 2), tau

    def add_run(self, t, q, qd, tau):
        """Add states without gaps: times [s], positions [rad, m], rates [rad/s, m/s] and efforts [N m, N]."""
        if len(t) < 2:
            return
        number = ((t - t[0]) // self._length).astype(int)
        columns, tau = self.columns(t, q, qd, tau)
        columns = np.concatenate(
            [columns, np.broadcast_to(tau, (self._model.nv, *tau.shape))], axis=-1
        )
        parts = np.split(columns, np.flatnonzero(np.diff(number)) + 1, axis=1)
        self._blocks = np.concatenate(
            [self._blocks, [part.transpose(0, 2, 1) @ part for part in parts]]
        )
        self._rows += len(tau)
        while len(self._blocks) > MAX_BLOCKS:
            self._blocks = np.add.reduceat(self._blocks, np.arange(0, len(self._blocks), 2))
            self._length *= 2.0

    def fit(self):
        """Return the :class:`Relation`."""
        model, joints = self._model, np.arange(self._model.nv)
        whole, columns = self._blocks.sum(axis=0), np.eye(COLUMNS + model.nv)
        samples = np.concatenate([whole[None], whole - self._blocks])
        pull, inertia = np.append(model.gravity, np.zeros(len(columns) - 3)), columns[INERTIAL]
        rest, offset = columns[DAMPING:COLUMNS], columns[[OFFSET]]
        squares, factors = _regress(samples, pull + inertia, rest)
        inertial = _regress(samples, inertia, np.vstack([pull, rest[:-1]]))[1]
        errors = [_jackknife(one[1:]) for one in (factors, inertial)]
        geared = ~np.isfinite(factors[0]) & np.isfinite(inertial[0])
        square = np.where(geared, _regress(whole, pull + inertia, rest[:-1])[0], squares[0])
        torque = np.sqrt(square / max(self._rows, 1))
        with np.errstate(divide="ignore", invalid="ignore"):
            model_error = np.where(
                torque > 0.0, MODEL_ERROR * largest_of_kind(model, torque) / torque, np.inf
            )
        kept = [*range(INERTIAL + 1), *(COLUMNS + joints)]
        return Relation(
            model,
            remaining(whole, columns[kept], rest) / max(self._rows, 1),
            np.where(geared, inertial[0], factors[0]),
            np.where(geared, *errors[::-1]),
            model_error,
            inertial[0],
            errors[1],
            _regress(whole, pull, offset)[0] > _regress(whole, inertia, offset)[0],
            geared,
            torque,
        )
