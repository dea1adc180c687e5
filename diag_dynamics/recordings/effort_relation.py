# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Relation of measured efforts to the torques of the model: a factor for each joint, with its standard error."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.optional import require
from diag_dynamics.sweeps.spatial import ANGULAR_X

CUTOFF, ORDER, MEMORY = 5.0, 4, 3.0
"""Zero-phase Butterworth low-pass: cutoff frequency [Hz], order, and time after which it has forgotten all [s]."""

INERTIAL, DAMPING, FRICTION, OFFSET, ROTOR, COLUMNS = range(3, 9)
"""Columns of torque: of gravity along each axis of the base by 1 m/s² (0 to 2), of inertia, and of what resists: rate, its
sign, a constant, and the acceleration. Efforts follow them."""

BLOCK, MAX_BLOCKS, MIN_BLOCKS = 0.5, 32, 4
"""Length of a block [s], which doubles beyond so many blocks, and fewest blocks for a standard error."""

ERRORS, SMALL_ERRORS = 4.0, 8.0
"""Standard errors on both sides of a factor that contain the true one, and below the limits of a light joint."""

MODEL_ERROR = 0.1  # torque that a model may miss at any joint over the largest torque of a joint of its kind
LIMITS, WIDE_LIMITS, GEARED_LIMITS = (0.6, 1.6), (0.2, 5.0), (0.2, 100.0)
"""Accepted factors: of gravity; of inertia, or with an unknown payload; and of inertia with an unknown rotor."""

SINGULAR = 1e-9  # fraction of a column's square below which it depends on others


def smoothed(segment, tau):
    """Return positions, rates, efforts `tau` and accelerations at even times, through a zero-phase low-pass.

    Its gain is that of a Butterworth filter, forward and backward: 1 / (1 + (f/f_c)^2n). Ends are reflected.
    """
    next_fast_len = require("scipy.fft", "the judgement of efforts").next_fast_len

    t, count = segment.t, len(segment.t)
    even = np.linspace(t[0], t[-1], count)
    step = even[1] - even[0]
    columns = np.ascontiguousarray(np.hstack([segment.q, segment.qd, tau]).T)
    values = np.stack([np.interp(even, t, column) for column in columns])
    memory = int(min(count - 1, np.ceil(MEMORY / step)))
    more = next_fast_len(count + 2 * memory, real=True) - count
    head = min(count - 1, more // 2)
    pad = (0, 0), (head, min(count - 1, more - head))
    whole = np.pad(values, pad, mode="reflect", reflect_type="odd")
    trend = whole[:, :1] + np.linspace(0.0, 1.0, whole.shape[1]) * (whole[:, -1:] - whole[:, :1])
    gain = 1.0 / (1.0 + (np.fft.rfftfreq(whole.shape[1], step) / CUTOFF) ** (2 * ORDER))
    smooth = np.fft.irfft(gain * np.fft.rfft(whole - trend), whole.shape[1]) + trend
    nq, nv = segment.q.shape[1], segment.qd.shape[1]
    smooth = np.vstack([smooth, np.gradient(smooth[nq : nq + nv], step, axis=1)])[:, head : head + count]
    return tuple(np.ascontiguousarray(part.T) for part in np.split(smooth, [nq, nq + nv, nq + 2 * nv]))


def remaining(products, kept, rest):
    """Return products (…, m, m) of the kept columns, rows of (k, m), without what the rest, rows of (r, m), explains."""
    inner, across = rest @ products @ rest.T, rest @ products @ kept.T
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(inner, axis1=-2, axis2=-1), 1e-300))[..., None]
    inverse = np.linalg.pinv(inner * scale * np.swapaxes(scale, -1, -2), rcond=SINGULAR, hermitian=True)
    across = across * scale
    return kept @ products @ kept.T - np.swapaxes(across, -1, -2) @ inverse @ across


def _square(products, column, rest):
    """Return the square of a column without what the rest explains; 0 if it depends on that."""
    left = remaining(products, column[None], rest)[..., 0, 0]
    return np.where(left > SINGULAR * (products @ column @ column), left, 0.0)


def _slope(products, column, effort, rest):
    """Return the slope of the effort over a column beside the rest; NaN if the column depends on that."""
    square = _square(products, column, rest)
    with np.errstate(divide="ignore", invalid="ignore"):
        return remaining(products, np.stack([column, effort]), rest)[..., 0, 1] / np.where(square, square, np.nan)


def _jackknife(values):
    """Return standard errors from values without each block in turn."""
    count = len(values)
    if count < MIN_BLOCKS:
        return np.full(values.shape[1], np.inf)
    error = np.sqrt((count - 1) / count * ((values - values.mean(axis=0)) ** 2).sum(axis=0))
    return np.where(np.isfinite(error), error, np.inf)


class Run(NamedTuple):
    """States that follow one another without gaps: t [s], q [rad, m], qd [rad/s, m/s], tau [N m, N]."""

    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    tau: np.ndarray


class Relation(NamedTuple):
    """Factors from the model's torque to the measured effort, by joint; shape (nv,) each."""

    factor: np.ndarray  # slope over the torque of gravity and inertia; NaN if the motion does not show it
    error: np.ndarray  # its standard error, by blocks of time left out: residuals of neighbours in time are alike
    model_error: np.ndarray  # error of the factor due to the model
    inertial: np.ndarray  # slope over the torque of inertia alone, without the acceleration among the columns
    inertial_error: np.ndarray
    heavy: np.ndarray  # whether most of the torque is gravity, bool
    geared: np.ndarray  # whether the factor contains that of an unknown rotor, bool: as of a linear axis
    torque: np.ndarray  # standard deviation of the model's torque that no friction or offset explains [N m, N]

    def limits(self, tolerant=False):
        """Return the smallest and the largest accepted factor, shape (nv,) each; `tolerant` of a payload."""
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
        """Return which joints have a factor beyond the limits by more than its errors, or are unrelated, bool."""
        low, high = self.limits(tolerant)
        margin = ERRORS * self.error + self.model_error
        with np.errstate(invalid="ignore"):
            return (self.factor + margin < low) | (self.factor - margin > high) | self.unrelated()

    def doubtful(self):
        """Return which joints have a factor below 0 or far from 1 without the error of the model, bool."""
        low, high = self.limits(tolerant=True)
        with np.errstate(invalid="ignore"):
            other_sign = self.factor + ERRORS * self.error < 0.0
            small, large = self.factor + SMALL_ERRORS * self.error < low, self.factor - ERRORS * self.error > high
            return other_sign | small | large


class EffortRelation:
    """Compare efforts with the torques of a model with a fixed base and joints of one degree of freedom."""

    def __init__(self, model):
        self.model = model
        self._dynamics = DiagonalDynamics(model)
        self._pulls = [DiagonalDynamics(model.with_gravity(axis)) for axis in np.eye(3)]
        coupled = {joint for group in model.coupled_groups for joint in group}
        self._turning = [name in model.continuous_joints and name not in coupled for name in model.dof_names]
        own = model.bodies[1:][model.bodies["owner"][1:] == np.arange(1, len(model.bodies))]
        self.slides = np.zeros(model.nv, dtype=bool)
        self.slides[own["dof"][own["direction"] < ANGULAR_X]] = True
        self.rows, self._blocks, self._length = 0, [], BLOCK

    @property
    def products(self):
        """Products of each joint's columns and all efforts with one another, shape (nv, COLUMNS + nv, COLUMNS + nv)."""
        size = COLUMNS + self.model.nv
        return sum(self._blocks, np.zeros((self.model.nv, size, size)))

    def add_run(self, run):
        """Add a :class:`Run`."""
        if len(run.t) < 2:
            return
        if any(self._turning):
            run = run._replace(q=np.where(self._turning, np.unwrap(run.q, axis=0), run.q))
        q, qd, tau, qdd = smoothed(run, run.tau)
        pulls = np.stack([one.gravity_torque_batch(q) for one in self._pulls])
        inertial = self._dynamics.inverse_dynamics_batch(q, qd, qdd) - np.tensordot(self.model.gravity, pulls, 1)
        turned = np.tanh(qd / max(self.model.friction_velocity, 1e-9))
        columns = np.stack([*pulls, inertial, qd, turned, np.ones_like(qd), qdd], axis=-1).transpose(1, 0, 2)
        columns = np.concatenate([columns, np.broadcast_to(tau, (self.model.nv, *tau.shape))], axis=-1)
        number = ((run.t - run.t[0]) // self._length).astype(int)
        for part in np.split(columns, np.flatnonzero(np.diff(number)) + 1, axis=1):
            self._blocks.append(part.transpose(0, 2, 1) @ part)
        self.rows += len(tau)
        while len(self._blocks) > MAX_BLOCKS:
            pairs = [self._blocks[k : k + 2] for k in range(0, len(self._blocks), 2)]
            self._blocks, self._length = [sum(pair[1:], pair[0]) for pair in pairs], 2.0 * self._length

    def fit(self):
        """Return the :class:`Relation`."""
        joints = np.arange(self.model.nv)
        own = np.hstack([np.tile(np.arange(COLUMNS), (len(joints), 1)), COLUMNS + joints[:, None]])
        blocks = np.array([self.products, *self._blocks])[:, joints[:, None, None], own[:, :, None], own[:, None]]
        samples = np.concatenate([blocks[:1], blocks[0] - blocks[1:]])
        columns = np.eye(COLUMNS + 1)
        pull = np.append(self.model.gravity, np.zeros(COLUMNS - 2))
        inertia, effort, rest = columns[INERTIAL], columns[COLUMNS], columns[DAMPING:COLUMNS]
        needed = pull + inertia
        factors = _slope(samples, needed, effort, rest)
        inertial = _slope(samples, inertia, effort, np.vstack([pull, rest[:-1]]))
        errors = [_jackknife(one[1:]) for one in (factors, inertial)]
        geared = ~np.isfinite(factors[0]) & np.isfinite(inertial[0])
        square = np.where(geared, *(_square(blocks[0], needed, one) for one in (rest[:-1], rest)))
        torque = np.sqrt(square / max(self.rows, 1))
        weight, moving = (_square(blocks[0], one, columns[[OFFSET]]) for one in (pull, inertia))
        largest = np.array([torque[self.slides == one].max(initial=0.0) for one in self.slides])
        with np.errstate(divide="ignore", invalid="ignore"):
            model_error = np.where(torque > 0.0, MODEL_ERROR * largest / torque, np.inf)
        return Relation(
            np.where(geared, inertial[0], factors[0]),
            np.where(geared, *errors[::-1]),
            model_error,
            inertial[0],
            errors[1],
            weight > moving,
            geared,
            torque,
        )
