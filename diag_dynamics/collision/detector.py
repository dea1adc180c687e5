# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The detector: alarms of what a disturbance observer says, joint by joint and by norms, live and over columns alike."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, Flags, VectorLike, Whole
from diag_dynamics.checks import instance, number, vector
from diag_dynamics.collision.thresholds import NORM, TORQUE, AlarmThresholds

SECOND = 1_000_000_000
"""In nanoseconds."""


class Judged(NamedTuple):
    """What a detector says of states, a row for each.

    Attributes
    ----------
    alarm : ndarray of bool, shape (T,)
        Whether an alarm is on.
    begins : ndarray of bool, shape (T,)
        Whether one begins: not where a rise belongs to the alarm before, within the hold-off.
    joints : ndarray of bool, shape (T, nv)
        Whether the detector of each joint is among those that keep it up.
    values : ndarray, shape (T, nv + 2)
        What is compared with the thresholds: of each joint [N m, N], ‖m r‖ [N m], |r| [J^½/s]. Less what stands, if that is
        less. 0 where there is no result.
    """

    alarm: Flags
    begins: Flags
    joints: Flags
    values: Array


class AlarmDetector:
    """Judges external torque joint by joint, by its norm ‖m r‖ and by |r|; an alarm is on while one of them is above.

    A detector rises above its threshold, and is quiet again below `release` of it. A rise within `hold_off` after an alarm
    belongs to that alarm. What has kept an alarm up for longer than `standing` is followed by an offset, in half of that
    time; what a threshold is compared with is the smaller one of the value and of its distance from the offset. So an offset
    never makes an alarm, a torque that stands does not hold one for ever, and a further push is seen. The offset follows back
    at the same pace, and is forgotten where nothing is above its release threshold.

    Parameters
    ----------
    names : sequence of str
        Degrees of freedom.
    thresholds : AlarmThresholds

    Attributes
    ----------
    detectors : tuple of str
        Names of the detectors: the joints, ``external_torque``, ``norm``.
    limits : ndarray, shape (nv + 2,)
        Their thresholds; inf where there is none.

    Raises
    ------
    InputError
        There is a threshold of a joint that is not among the names.
    """

    def __init__(self, names: Sequence[str], thresholds: AlarmThresholds) -> None:
        self.thresholds = instance("thresholds", thresholds, AlarmThresholds)
        self._names = tuple(names)
        self.detectors = (*self._names, TORQUE, NORM)
        self.limits = thresholds.limits(self._names)
        self._low = thresholds.release * self.limits
        self._hold_off = thresholds.hold_off * SECOND
        self._standing = thresholds.standing * SECOND
        self.reset()

    def reset(self) -> None:
        """Forget everything: alarms, and what stands."""
        self._active: Flags = np.zeros(len(self.detectors), dtype=bool)
        self._offset: Array = np.zeros(2 * len(self._names))
        self._at_rest = True  # nothing is active, and no offset stands
        self._last = self._since = 0  # stamps: of the last state, of the beginning of the alarm
        self._end: int | None = None  # of the last state of an alarm

    def update(self, time: float, residual: VectorLike, external_torque: VectorLike) -> Judged:
        """Judge one state, with a time [s], r and m r; returns a single row.

        Raises
        ------
        InputError
            A vector is wrong, or the time not finite.
        """
        stamp = np.array([round(number("time", time, "a finite number [s]") * SECOND)])
        r, torque = (
            vector(name, value, self._names)[None]
            for name, value in (("residual", residual), ("external_torque", external_torque))
        )
        return self.judge(stamp, r, torque, np.ones(1, dtype=bool))

    @property
    def active(self) -> tuple[str, ...]:
        """Names of the detectors that keep the alarm up, if one is on."""
        return tuple(name for name, active in zip(self.detectors, self._active, strict=True) if active)

    def judge(
        self,
        stamps: Whole,
        residual: Array,
        external_torque: Array,
        valid: Flags,
        anew: Flags | None = None,
        values: Array | None = None,
    ) -> Judged:
        """Judge states, in order, going on from those before.

        Parameters
        ----------
        stamps : ndarray of int64, shape (T,)
            [ns]. Where they go back, all is forgotten.
        residual, external_torque : ndarray, shape (T, nv)
        valid : ndarray of bool, shape (T,)
            Whether there is a result; where there is none, nothing is judged, and no alarm is on.
        anew : ndarray of bool, shape (T,), optional
            States before which all is forgotten.
        values : ndarray, shape (T, nv + 2), optional
            What detectors look at, where a row stands for several states and these are the largest of them; becomes the
            result's. Without `anew`.
        """
        if anew is not None and anew.any():
            return self._judge_parts(np.flatnonzero(anew), stamps, residual, external_torque, valid)
        x = np.concatenate([external_torque, residual], axis=1)
        x[~valid] = 0.0
        if values is None:
            values = _values(x)
        alarm, begins = np.zeros((2, len(x)), dtype=bool)
        joints = np.zeros((len(x), len(self._names)), dtype=bool)
        hot = np.flatnonzero((values >= self._low).any(axis=1))  # elsewhere nothing can rise
        k = 0
        while True:
            if self._at_rest:
                next_hot = int(np.searchsorted(hot, k))
                if next_hot == len(hot):
                    break
                k = int(hot[next_hot])
                if k:
                    self._last = int(stamps[k - 1])
            if k == len(x):
                break
            if valid[k]:
                alarm[k], begins[k] = self._step(int(stamps[k]), x[k], values[k])
                joints[k] = self._active[:-2]
            self._last = int(stamps[k])
            k += 1
        if len(x):
            self._last = int(stamps[-1])
        return Judged(alarm, begins, joints, values)

    def _judge_parts(self, cuts: Whole, *columns: Any) -> Judged:
        parts = []
        for k, part in enumerate(zip(*(np.split(column, cuts) for column in columns), strict=True)):
            if k:
                self.reset()
            parts.append(self.judge(*part))
        return Judged(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def _step(self, stamp: int, x: Array, values: Array) -> tuple[bool, bool]:
        """Judge one state, whose values become those that thresholds are compared with: is an alarm on, and has it begun."""
        passed = stamp - self._last
        if passed < 0:
            self.reset()
        quiet = bool((values < self._low).all())
        stands = bool(self._offset.any())
        if stands:
            np.minimum(values, _values((x - self._offset)[None])[0], out=values)
        was = bool(self._active.any())
        self._active = (values > self.limits) | (self._active & (values >= self._low))
        on = bool(self._active.any())
        begins = on and not was and (self._end is None or not 0 <= stamp - self._end <= self._hold_off)
        if begins:
            self._since = stamp
        if on:
            self._end = stamp
        if on and stamp - self._since > self._standing:
            self._offset = self._offset + self._pace(passed) * (x - self._offset)
        elif quiet:
            self._offset = np.zeros_like(x)
        elif stands:
            towards = np.where(x * self._offset > 0.0, np.sign(x) * np.minimum(np.abs(x), np.abs(self._offset)), 0.0)
            self._offset = self._offset + self._pace(passed) * (towards - self._offset)
        self._at_rest = not on and not self._offset.any()
        return on, begins

    def _pace(self, passed: int) -> float:
        """Part of the way that an offset goes in a time [ns]."""
        return -math.expm1(-2.0 * passed / self._standing)

    def memory(self) -> list[Any]:
        """What later results depend on; see `diag_dynamics.recordings.seams`."""
        end = self._end if self._end is not None and self._last - self._end <= self._hold_off else None
        return [self._active.copy(), self._offset.copy(), None if self._at_rest and end is None else self._since, end]


def detected(external_torque: Array, residual: Array) -> Array:
    """What detectors look at, of rows of m r and r: |m r| of each joint, ‖m r‖, |r|."""
    return _values(np.concatenate([external_torque, residual], axis=1))


def _values(x: Array) -> Array:
    """The same of rows that hold both. Squares are added column by column: the same bits come of one row and of many."""
    n = x.shape[1] // 2
    values = np.empty((len(x), n + 2))
    np.abs(x[:, :n], out=values[:, :n])
    square = x * x
    for k, part in ((n, square[:, :n]), (n + 1, square[:, n:])):
        total = np.zeros(len(x))
        for column in part.T:
            total = total + column
        values[:, k] = np.sqrt(total)
    return values
