# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Thresholds, detector and events of collisions in the residuals of a disturbance observer."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, BoolArray, IntArray, VectorLike
from diag_dynamics.checks import instance, mapping, not_negative, number, positive, vector
from diag_dynamics.entries import ALL, by_name
from diag_dynamics.results import TouchedLink
from diag_dynamics.sweeps.alarms import BEGIN, EVENT, MEMORY, judge_states

SECOND = 1_000_000_000  # [ns]
RELEASE, HOLD_OFF, STANDING, STICTION = 0.7, 1.0, 2.0, 1.25  # defaults of :class:`Thresholds`

TOTAL, NORM = "total", "norm"
"""Names of the detectors of ‖m r‖ and of |r|; the others have the names of joints."""


@dataclass(frozen=True)
class Thresholds:
    """Thresholds of a :class:`~diag_dynamics.Detector`.

    Parameters
    ----------
    limits : mapping
        |m r| by joint [N m, N], ``*`` for all other joints, ``total`` for ‖m r‖ of all joints [N m]
        and ``norm`` for |r| [J^½/s]. A missing entry, or inf, is no threshold.
    release : float
        Fraction of its threshold below which a detector releases.
    hold_off : float
        Time after the alarm of an event within which another rise belongs to that event [s].
    standing : float
        Age of an alarm from which an offset follows the torque [s]; inf: never. See
        docs/collision.md.
    stiction : float
        Dead zone of |m r| of a standing joint, as a fraction of its Coulomb friction; see
        :class:`~diag_dynamics.control.dead_zone.DeadZone`.

    Raises
    ------
    InputError
        A value is wrong.
    """

    limits: Mapping[str, float] = field(default_factory=dict)
    release: float = RELEASE
    hold_off: float = HOLD_OFF
    standing: float = STANDING
    stiction: float = STICTION

    def __post_init__(self) -> None:
        for name, value in mapping("limits", self.limits).items():
            if value != math.inf:
                positive(f"threshold of '{name}'", value, "[N m, N, J^½/s]")
        if self.standing != math.inf:
            positive("standing", self.standing, "[s]")
        number("release", self.release, "a fraction > 0 and <= 1", lambda x: 0.0 < x <= 1.0)
        not_negative("hold_off", self.hold_off, "[s]")
        not_negative("stiction", self.stiction, "(a fraction)")

    def of_names(self, names: Sequence[str], parameter: str = "collision.threshold") -> Array:
        """Return the thresholds of these joints, of ‖m r‖ and of |r|; inf without one.

        Raises
        ------
        InputError
            There is a threshold of another joint.
        """
        limits = by_name(parameter, self.limits, (*names, TOTAL, NORM, ALL))
        for name in (TOTAL, NORM):
            limits[name] = self.limits.get(name, math.inf)
        return np.array([limits.get(name, math.inf) for name in (*names, TOTAL, NORM)])


class Judged(NamedTuple):
    """Results of a detector, a row for each state.

    Attributes
    ----------
    alarm, begins : ndarray of bool, shape (T,)
        Whether an alarm is on, and whether it or a further event in it begins.
    joints : ndarray of bool, shape (T, nv)
        Whether the detector of each joint is active.
    values : ndarray, shape (T, nv + 2)
        |m r| of joints, ‖m r‖ and |r|, lowered by the offset, as they are compared with the
        thresholds.
    """

    alarm: BoolArray
    begins: BoolArray
    joints: BoolArray
    values: Array


class Detector:
    """Detect collisions joint by joint, by ‖m r‖ and by |r|.

    An alarm is on while any detector is active. A detector becomes active above its threshold and
    releases below `release` of it. A rise within `hold_off` after the alarm of an event belongs to
    that event, and prolongs no hold-off. A rise within an alarm, at least 0.3 s after its begin, is
    a further event if it exceeds its threshold and, relative to thresholds, what was there before.

    Once an alarm has been on for `standing`, an offset follows m r and r with a time constant of
    `standing` / 2, and afterwards decreasing torques. The test statistic is min(|x|, |x − offset|):
    a standing torque holds no alarm, a further push is one. The offset is reset where all torques
    are below their release thresholds.

    Parameters
    ----------
    names : sequence of str
        Degrees of freedom.
    thresholds : Thresholds

    Attributes
    ----------
    detectors : tuple of str
        The joints, ``total``, ``norm``.
    limits : ndarray, shape (nv + 2,)
        Their thresholds; inf without one.

    Raises
    ------
    InputError
        There is a threshold of a joint that is not among the names.
    """

    def __init__(self, names: Sequence[str], thresholds: Thresholds) -> None:
        self.thresholds = instance("thresholds", thresholds, Thresholds)
        self._names = tuple(names)
        self.detectors = (*self._names, TOTAL, NORM)
        self.limits = thresholds.of_names(self._names)
        self._limits = np.array([self.limits, thresholds.release * self.limits])
        self._options = np.array([thresholds.hold_off * SECOND, thresholds.standing * SECOND])
        judge_states.compile()  # or the first alarm would wait
        self.reset()

    def reset(self) -> None:
        """Clear alarms and offset, as before the first state."""
        self._active: BoolArray = np.zeros(len(self.detectors), dtype=bool)
        self._floor: Array = np.zeros(len(self.detectors))
        self._offset: Array = np.zeros(2 * len(self._names))
        self._memory: IntArray = np.zeros(MEMORY, dtype=np.int64)

    @property
    def starts(self) -> bool:
        """Whether the last event started its alarm and was no rise within it."""
        return bool(self._memory[BEGIN] == self._memory[EVENT])

    def update(self, time: float, residual: VectorLike, external_torque: VectorLike) -> Judged:
        """Process one state with a result of the observer.

        Parameters
        ----------
        time : float
            [s]. Where it goes back, or on by more than a second, the detector is reset.
        residual, external_torque : array_like, shape (nv,)
            r [J^½/s] and m r [N m, N].

        Returns
        -------
        Judged
            A single row.

        Raises
        ------
        InputError
            A vector is wrong, or the time is not finite.
        """
        stamp = np.array([round(number("time", time, "a finite number [s]") * SECOND)])
        r = vector("residual", residual, self._names)
        torque = vector("external_torque", external_torque, self._names)
        return self.judge(stamp, r[None], torque[None], np.ones(1, dtype=bool))

    def judge(
        self,
        stamps: IntArray,
        residual: Array,
        external_torque: Array,
        valid: BoolArray,
        restarts: BoolArray | None = None,
        maxima: Array | None = None,
    ) -> Judged:
        """Process states in order, after those of earlier calls.

        Parameters
        ----------
        stamps : ndarray of int64, shape (T,)
            [ns]. Where they go back, or on by more than a second, the detector is reset.
        residual, external_torque : ndarray, shape (T, nv)
            r [J^½/s] and m r [N m, N].
        valid : ndarray of bool, shape (T,)
            Whether the observer has a result. A state without one ends an alarm; its values are 0.
        restarts : ndarray of bool, shape (T,), optional
            States before which the detector is reset.
        maxima : ndarray, shape (T, nv + 2), optional
            Largest values, where a row stands for several states.

        Returns
        -------
        Judged
        """
        x = np.concatenate([external_torque, residual], axis=1)
        x[~valid] = 0.0
        values = detector_values(x) if maxima is None else maxima.copy()
        restart = np.zeros(len(x), dtype=bool) if restarts is None else restarts
        alarm, begins = np.zeros((2, len(x)), dtype=bool)
        joints = np.zeros((len(x), len(self._names)), dtype=bool)
        rows = np.ascontiguousarray(stamps), x, np.ascontiguousarray(valid), restart
        memory = self._active, self._offset, self._floor, self._memory
        judge_states(*rows, self._limits, self._options, values, *memory, alarm, begins, joints)
        return Judged(alarm, begins, joints, values)


def detector_values(x: Array) -> Array:
    """Return |m r| of each joint, ‖m r‖ and |r| of rows [m r, r].

    cumsum gives one row the bits of many.
    """
    n = x.shape[1] // 2
    if not n:  # a robot without joints
        return np.zeros((len(x), 2))
    squares = np.cumsum((x * x).reshape(len(x), 2, n), axis=2)[:, :, -1]
    return np.concatenate([np.abs(x[:, :n]), np.sqrt(squares)], axis=1)


# --- Collisions as events: start, end, the detectors that rose, and how far

LABELS = {TOTAL: ("|m r|", "N m"), NORM: ("|r|", "J^0.5/s")}


class Exceeded(NamedTuple):
    """A detector that rose: its name, its largest value and its threshold [N m, N, J^½/s]."""

    detector: str
    value: float
    threshold: float

    def describe(self) -> str:
        """Return a text such as ``shoulder_lift 34 N m or N > 21``."""
        label, unit = LABELS.get(self.detector, (self.detector, "N m or N"))
        return f"{label} {self.value:.3g} {unit} > {self.threshold:.3g}"


class Alarm(NamedTuple):
    """A collision or contact: the states in which a detector exceeded its threshold.

    Recordings list them with the joints and the detector that rose first.
    """

    start: int  # stamp of the first state [ns]
    end: int  # of the last one
    joints: tuple[str, ...]  # that rose; without any, the one nearest to its threshold
    norm: float  # largest |r| [J^½/s]
    first: str = ""  # detector that rose first; of several, the one with the largest ratio
    exceeded: tuple[Exceeded, ...] = ()  # all detectors that rose, the largest ratio first
    link: str = ""  # touched, at the largest χ² of m r; "" if it is unknown
    confidence: float = 0.0  # its probability
    chi_square: float = 0.0

    def at_link(self, touched: TouchedLink, rows: IntArray) -> Alarm:
        """Return the collision with the link of the largest χ² of states.

        The collision is unchanged if its own χ² is as large.
        """
        chi_square = np.nan_to_num(touched.chi_square[rows])
        k = int(np.argmax(chi_square))
        if chi_square[k] <= self.chi_square:
            return self
        link = str(touched.link[rows[k]])
        confidence = float(touched.confidence[rows[k]])
        return self._replace(link=link, confidence=confidence, chi_square=float(chi_square[k]))

    def describe(self) -> str:
        """Return what rose in words: the joints, or else the detector with the largest ratio."""
        joints = [event.describe() for event in self.exceeded if event.detector in self.joints]
        return ", ".join(joints) or f"{self.exceeded[0].describe()}, most of it at {self.joints[0]}"


class Alarms:
    """Collect the alarms of a detector; `judged` are the detectors that have a threshold."""

    def __init__(self, detector: Detector) -> None:
        self._detectors = detector.detectors
        self._limits = detector.limits
        self.judged = tuple(np.array(self._detectors)[np.isfinite(self._limits)].tolist())
        self.alarms: list[Alarm] = []

    def add_states(
        self, stamps: IntArray, norm: Array, judged: Judged, touched: TouchedLink | None = None
    ) -> None:
        """Add states: stamps [ns], |r|, results of the detector, and touched links or None."""
        on = np.flatnonzero(judged.alarm)
        for rows in np.split(on, np.flatnonzero(judged.begins[on])):
            if not len(rows):
                continue
            values = judged.values[rows]
            if judged.begins[rows[0]] or not self.alarms:
                first = self._detectors[int(np.argmax(values[0] / self._limits))]
                self.alarms.append(Alarm(int(stamps[rows[0]]), 0, (), 0.0, first))
                self._peaks = np.zeros(len(self._limits))
            alarm = self._with_peaks(values.max(axis=0))
            largest = max(alarm.norm, float(norm[rows].max()))
            alarm = alarm._replace(end=int(stamps[rows[-1]]), norm=largest)
            self.alarms[-1] = alarm if touched is None else alarm.at_link(touched, rows)

    def _with_peaks(self, values: Array) -> Alarm:
        """Return the last alarm after further values, with the detectors that rose in it."""
        peaks = self._peaks = np.maximum(self._peaks, values)
        ratios = peaks / self._limits
        exceeded = [
            Exceeded(self._detectors[k], float(peaks[k]), float(self._limits[k]))
            for k in np.argsort(-ratios, kind="stable")
            if ratios[k] > 1.0
        ]
        of_joints = ratios[:-2] if ratios[:-2].any() else peaks[:-2]
        joints = np.flatnonzero(ratios[:-2] > 1.0).tolist() or [int(np.argmax(of_joints))]
        names = tuple(self._detectors[k] for k in joints)
        return self.alarms[-1]._replace(exceeded=tuple(exceeded), joints=names)
