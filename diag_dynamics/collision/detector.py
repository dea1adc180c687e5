# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Thresholds, detector and events of collisions in the residuals of a disturbance observer, of one state or of many."""

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
from diag_dynamics.sweeps.alarms import KEPT, MEMORY, judge_states

SECOND = 1_000_000_000  # [ns]
RELEASE, HOLD_OFF, STANDING = 0.7, 1.0, 2.0  # defaults of :class:`AlarmThresholds`

TORQUE, NORM = "external_torque", "norm"
"""Names of the detectors of ‖m r‖ and of |r|; the others have the names of joints."""

CHANGE = " (change)"
"""End of the names of detectors at rest."""


@dataclass(frozen=True)
class AlarmThresholds:
    """Thresholds of an :class:`~diag_dynamics.AlarmDetector`; inf switches a detector off.

    Parameters
    ----------
    joints : mapping
        |m r| by joint [N m, N], ``*`` for all other joints. A joint that is missing has none.
    external_torque : float
        ‖m r‖ of all joints [N m].
    norm : float
        |r| [J^½/s].
    release : float
        Fraction of its threshold below which a detector releases.
    hold_off : float
        Time after an alarm within which another rise belongs to it [s].
    standing : float
        Age of an alarm from which an offset follows the torque [s]; inf: never. See
        docs/collision.md.
    rest_joints, rest_external_torque
        As `joints` and `external_torque`, for the change of m r within 0.2 s of an arm at rest.

    Raises
    ------
    InputError
        A value is wrong.
    """

    joints: Mapping[str, float] = field(default_factory=dict)
    external_torque: float = math.inf
    norm: float = math.inf
    release: float = RELEASE
    hold_off: float = HOLD_OFF
    standing: float = STANDING
    rest_joints: Mapping[str, float] = field(default_factory=dict)
    rest_external_torque: float = math.inf

    def __post_init__(self) -> None:
        checked = [(TORQUE, self.external_torque, "[N m]"), (NORM, self.norm, "[J^½/s]")]
        checked.append(("rest_external_torque", self.rest_external_torque, "[N m]"))
        for kind in ("joints", "rest_joints"):
            limits = mapping(kind, getattr(self, kind)).items()
            checked += [
                (f"threshold of joint '{name}' in {kind}", x, "[N m]") for name, x in limits
            ]
        for name, value, unit in [*checked, ("standing", self.standing, "[s]")]:
            if value != math.inf:
                positive(name, value, unit)
        number("release", self.release, "a fraction > 0 and <= 1", lambda x: 0.0 < x <= 1.0)
        not_negative("hold_off", self.hold_off, "[s]")

    def limits(self, names: Sequence[str]) -> Array:
        """Return the thresholds of these joints, of ‖m r‖ and of |r|; inf without one.

        Raises
        ------
        InputError
            There is a threshold of another joint.
        """
        joints = by_name("alarm.joints", self.joints, (*names, ALL))
        return np.array(
            [*(joints.get(name, math.inf) for name in names), self.external_torque, self.norm]
        )

    def rest_limits(self, names: Sequence[str]) -> Array:
        """Return the thresholds at rest of these joints, and of ‖m r‖; inf without one.

        Raises
        ------
        InputError
            There is a threshold of another joint.
        """
        joints = by_name("alarm.rest_joints", self.rest_joints, (*names, ALL))
        return np.array(
            [*(joints.get(name, math.inf) for name in names), self.rest_external_torque]
        )


class Judged(NamedTuple):
    """Results of a detector, a row for each state.

    Attributes
    ----------
    alarm, begins : ndarray of bool, shape (T,)
        Whether an alarm is on, and whether it begins.
    joints : ndarray of bool, shape (T, nv)
        Whether the detector of each joint is active.
    values : ndarray, shape (T, nv + 2)
        |m r| of joints, ‖m r‖ and |r|, lowered by the offset, as they are compared with the
        thresholds.
    changes : ndarray, shape (T, nv + 1)
        Changes of m r, of joints and of all, as they are compared with the thresholds at rest; 0 in
        motion.
    rest : ndarray of bool, shape (T,)
        Whether the arm is at rest; False without thresholds at rest.
    """

    alarm: BoolArray
    begins: BoolArray
    joints: BoolArray
    values: Array
    changes: Array
    rest: BoolArray


class AlarmDetector:
    """Detect collisions joint by joint, by ‖m r‖ and by |r|; an alarm is on while any detector is active.

    A detector becomes active above its threshold and releases below `release` of it. A rise within
    `hold_off` after an alarm belongs to that alarm. Once an alarm has been on for `standing`, an
    offset follows m r and r with a time constant of `standing` / 2, and afterwards decreasing
    torques. The test statistic is min(|x|, |x − offset|): a standing torque holds no alarm, a
    further push is one. The offset is reset where all torques are below their release thresholds.

    An arm is at rest if all rates have been below 0.05 rad/s or m/s for 0.5 s, each with a result
    of the observer. Thresholds at rest are compared with the change of m r within the last 0.2 s,
    during an alarm with the change since before it. The other detectors then begin with an offset,
    the torque of stiction.

    Parameters
    ----------
    names : sequence of str
        Degrees of freedom.
    thresholds : AlarmThresholds

    Attributes
    ----------
    detectors : tuple of str
        The joints, ``external_torque``, ``norm``.
    limits : ndarray, shape (nv + 2,)
        Their thresholds; inf without one.
    rest_limits : ndarray, shape (nv + 1,)
        Thresholds at rest.

    Raises
    ------
    InputError
        There is a threshold of a joint that is not among the names.
    """

    def __init__(self, names: Sequence[str], thresholds: AlarmThresholds) -> None:
        self.thresholds = instance("thresholds", thresholds, AlarmThresholds)
        self._names = tuple(names)
        self.detectors = (
            *self._names,
            TORQUE,
            NORM,
            *(name + CHANGE for name in (*self._names, TORQUE)),
        )
        self.limits, self.rest_limits = (
            thresholds.limits(self._names),
            thresholds.rest_limits(self._names),
        )
        limits = np.concatenate([self.limits, self.rest_limits])
        self._limits, self._release = (
            np.array([limits, thresholds.release * limits]),
            thresholds.release * self.limits,
        )
        self._options = np.array(
            [thresholds.hold_off * SECOND, thresholds.standing * SECOND, 0.0, 0.0]
        )
        self._options[2] = np.isfinite(self.rest_limits).any()
        judge_states.compile()  # or the first alarm would wait
        self.reset()

    def reset(self) -> None:
        """Clear alarms and offset, as before the first state."""
        self._active: BoolArray = np.zeros(len(self.detectors), dtype=bool)
        self._offset: Array = np.zeros(2 * len(self._names))
        self._last: int | None = None  # stamp of the last state
        self._unknown: BoolArray = np.zeros(len(self._names), dtype=bool)
        self._kept: Array = np.zeros((KEPT + 2, len(self._names)))
        self._memory: IntArray = np.zeros(MEMORY + KEPT, dtype=np.int64)

    @property
    def active(self) -> tuple[str, ...]:
        """Names of the active detectors."""
        return tuple(np.array(self.detectors)[self._active].tolist())

    def update(
        self,
        time: float,
        residual: VectorLike,
        external_torque: VectorLike,
        velocity: VectorLike | None = None,
    ) -> Judged:
        """Process one state with a result of the observer.

        Parameters
        ----------
        time : float
            [s]. Where it goes back, the detector is reset.
        residual, external_torque : array_like, shape (nv,)
            r [J^½/s] and m r [N m, N].
        velocity : array_like, shape (nv,), optional
            Rates [rad/s, m/s]. Without them the arm counts as moving.

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
        rates = None if velocity is None else vector("velocity", velocity, self._names)[None]
        return self.judge(stamp, r[None], torque[None], np.ones(1, dtype=bool), velocity=rates)

    def judge(
        self,
        stamps: IntArray,
        residual: Array,
        external_torque: Array,
        valid: BoolArray,
        restarts: BoolArray | None = None,
        given: tuple[Array, Array] | None = None,
        *,
        velocity: Array | None = None,
        unknown: BoolArray | None = None,
    ) -> Judged:
        """Process states in order, after those of earlier calls.

        Parameters
        ----------
        stamps : ndarray of int64, shape (T,)
            [ns]. Where they go back, the detector is reset.
        residual, external_torque : ndarray, shape (T, nv)
            r [J^½/s] and m r [N m, N].
        valid : ndarray of bool, shape (T,)
            Whether the observer has a result. A state without one has no alarm, and zero values.
        restarts : ndarray of bool, shape (T,), optional
            States before which the detector is reset.
        given : tuple, optional
            Maxima of values and changes, of the shapes in Judged, where a row stands for several
            states.
        velocity : ndarray, shape (T, m), optional
            Rates, or the largest ones [rad/s, m/s]. Without them the arm counts as moving.
        unknown : ndarray of bool, shape (T, nv), optional
            Joints whose m r is 0 because it is unknown. Where they change the arm counts as moving.

        Returns
        -------
        Judged
        """
        x = np.concatenate([external_torque, residual], axis=1)
        x[~valid] = 0.0
        values, changes = given or (detector_values(x), np.zeros((len(x), len(self.rest_limits))))
        if given:
            values, changes = values.copy(), changes.copy()
        elapsed = np.zeros(len(x), dtype=np.int64)
        np.subtract(
            stamps[1:], stamps[:-1], out=elapsed[1:]
        )  # np.diff costs 7 µs of each live state
        if len(x) and self._last is not None:
            elapsed[0] = stamps[0] - self._last
        restart = elapsed < 0 if restarts is None else (elapsed < 0) | restarts
        alarm, begins, rest = np.zeros((3, len(x)), dtype=bool)
        joints = np.zeros((len(x), len(self._names)), dtype=bool)
        if len(x) and (
            self._options[2] or not self._is_idle() or not (values < self._release).all()
        ):
            speed = (
                np.full(len(x), np.inf)
                if velocity is None
                else np.abs(velocity).max(axis=1, initial=0.0)
            )
            if unknown is not None:
                speed[np.diff(unknown, axis=0, prepend=self._unknown[None]).any(axis=1)] = np.inf
                self._unknown = unknown[-1]
            self._options[3] = given is not None
            judge_states(
                *(
                    np.ascontiguousarray(stamps),
                    elapsed,
                    x,
                    speed,
                    np.ascontiguousarray(valid),
                    restart,
                ),
                *(
                    self._limits,
                    self._options,
                    values,
                    changes,
                    self._active,
                    self._offset,
                    self._kept,
                    self._memory,
                ),
                *(alarm, begins, rest, joints),
            )
        elif restart.any():
            self.reset()
        if len(x):
            self._last = int(stamps[-1])
        return Judged(alarm, begins, joints, values, changes, rest)

    def _is_idle(self) -> bool:
        return not (self._active.any() or self._offset.any())


class NoAlarms(AlarmDetector):
    """A detector that raises no alarm: its values and changes are those before any."""

    def __init__(self, width: int, standing: float = STANDING) -> None:
        super().__init__([str(k) for k in range(width)], AlarmThresholds(standing=standing))
        self._limits[1], self._options[2] = 0.0, 1.0  # no release resets the offset of stiction


def detector_values(x: Array) -> Array:
    """Return |m r| of each joint, ‖m r‖ and |r| of rows [m r, r]; cumsum gives one row the bits of many."""
    n = x.shape[1] // 2
    if not n:  # a robot without joints
        return np.zeros((len(x), 2))
    squares = np.cumsum((x * x).reshape(len(x), 2, n), axis=2)[:, :, -1]
    return np.concatenate([np.abs(x[:, :n]), np.sqrt(squares)], axis=1)


# --- Collisions as events: start, end, the detectors that rose, and how far

LABELS = {TORQUE: ("|m r|", "N m"), NORM: ("|r|", "J^0.5/s")}
NAMED_SHARE = 0.5  # fraction of the largest |m r|: a push at a link loads several joints


def most_pushed(names: Sequence[str], torque: Array) -> tuple[str, ...]:
    """Return the joints with half of the largest |m r| or more, the largest first; r mixes joints."""
    size = np.abs(torque)
    order = np.argsort(-size, kind="stable")
    return tuple(names[k] for k in order[size[order] >= NAMED_SHARE * size.max()])


class Exceeded(NamedTuple):
    """A detector that rose: its name, its largest value and its threshold [N m, N, J^½/s]."""

    detector: str
    value: float
    threshold: float

    def describe(self) -> str:
        """Return a text such as ``shoulder_lift 34 N m > 21``."""
        name = self.detector.removesuffix(CHANGE)
        label, unit = LABELS.get(name, (name, "N m"))
        change = "" if name == self.detector else " changed by"
        return f"{label}{change} {self.value:.3g} {unit} > {self.threshold:.3g}"


class Alarm(NamedTuple):
    """A collision by a detector, or by |r| alone."""

    start: int  # stamp of the first state [ns]
    end: int  # of the last one
    joints: tuple[
        str, ...
    ]  # that rose; without any, the one with the largest ratio to its threshold
    norm: float  # largest |r| [J^½/s]
    first: str = ""  # detector that rose first; of several, the one with the largest ratio
    exceeded: tuple[Exceeded, ...] = ()  # all detectors that rose, the largest ratio first
    link: str = ""  # touched, at the largest χ² of m r; "" if it is unknown
    confidence: float = 0.0  # its probability
    chi_square: float = 0.0

    def at_link(self, touched: TouchedLink | None, rows: IntArray) -> Alarm:
        """Return the collision with the link of the largest χ² of some states, if that is above the one before."""
        if touched is None or not np.isfinite(touched.chi_square[rows]).any():
            return self
        k = rows[int(np.nanargmax(touched.chi_square[rows]))]
        link, confidence, chi_square = touched.link[k], touched.confidence[k], touched.chi_square[k]
        if chi_square <= self.chi_square:
            return self
        return self._replace(
            link=str(link), confidence=float(confidence), chi_square=float(chi_square)
        )

    def describe(self) -> str:
        """Return what rose in words: the joints, or else the detector with the largest ratio."""
        joints = [
            one.describe()
            for one in self.exceeded
            if one.detector.removesuffix(CHANGE) in self.joints
        ]
        return ", ".join(joints) or f"{self.exceeded[0].describe()}, most of it at {self.joints[0]}"


class Alarms:
    """Collect the alarms of a detector; `judged` are the detectors that have a threshold."""

    def __init__(self, detector: AlarmDetector) -> None:
        self._detectors, self._limits = (
            detector.detectors,
            np.append(detector.limits, detector.rest_limits),
        )
        self.judged = tuple(np.array(self._detectors)[np.isfinite(self._limits)].tolist())
        self.found: list[Alarm] = []

    def add_states(
        self, stamps: IntArray, norm: Array, judged: Judged, touched: TouchedLink | None = None
    ) -> None:
        """Add states: stamps [ns], |r|, the results of the detector, and touched links if these are known."""
        on = np.flatnonzero(judged.alarm)
        for rows in np.split(on, np.flatnonzero(judged.begins[on])):
            if len(rows):
                begins = bool(judged.begins[rows[0]]) or not self.found
                values = np.hstack([judged.values[rows], judged.changes[rows]])
                self._add_alarm(stamps[rows], norm[rows], values, begins)
                self.found[-1] = self.found[-1].at_link(touched, rows)

    def _add_alarm(self, stamps: IntArray, norm: Array, values: Array, begins: bool) -> None:
        """Add states of one alarm, which begins, or continues the last one."""
        if begins:
            first = self._detectors[int(np.argmax(values[0] / self._limits))]
            self.found.append(Alarm(int(stamps[0]), 0, (), 0.0, first))
            self._peaks = np.zeros(len(self._limits))
        peaks = self._peaks = np.maximum(self._peaks, values.max(axis=0))
        ratios, rose, n = peaks / self._limits, peaks > self._limits, len(peaks) // 2 - 1
        order = np.argsort(-ratios, kind="stable")
        exceeded = [
            Exceeded(self._detectors[k], float(peaks[k]), float(self._limits[k]))
            for k in order
            if rose[k]
        ]
        of_joints, either = np.maximum(ratios[:n], ratios[n + 2 : -1]), rose[:n] | rose[n + 2 : -1]
        nearest = int(
            np.argmax(of_joints if of_joints.any() else np.maximum(peaks[:n], peaks[n + 2 : -1]))
        )
        joints = np.flatnonzero(either).tolist() or [nearest]
        self.found[-1] = self.found[-1]._replace(
            end=int(stamps[-1]),
            exceeded=tuple(exceeded),
            joints=tuple(self._detectors[k] for k in joints),
            norm=max(self.found[-1].norm, float(norm.max())),
        )


class NormCollisions:
    """Collect the collisions that an observer reports by |r|, of a robot with these degrees of freedom."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names, self._goes_on = names, False
        self.judged: tuple[str, ...] = ()
        self.found: list[Alarm] = []

    def add_states(
        self,
        stamps: IntArray,
        torque: Array,
        norm: Array,
        collision: BoolArray,
        touched: TouchedLink | None = None,
    ) -> None:
        """Add states: stamps [ns], m r, |r|, whether the observer reports a collision, and touched links."""
        edges = np.flatnonzero(np.diff(collision.astype(np.int8), prepend=0, append=0))
        for first, end in edges.reshape(-1, 2).tolist():
            k = first + int(
                np.argmax(norm[first:end])
            )  # the joints are those pushed most at the largest |r|
            one = Alarm(
                int(stamps[first]),
                int(stamps[end - 1]),
                most_pushed(self._names, torque[k]),
                float(norm[k]),
            )
            one = one.at_link(touched, np.arange(first, end))
            if first == 0 and self._goes_on:
                before = self.found.pop()
                touch = max(before, one, key=lambda x: x.chi_square)
                end, one = one.end, before if before.norm >= one.norm else one
                one = one._replace(
                    start=before.start, end=end, link=touch.link, confidence=touch.confidence
                )
                one = one._replace(chi_square=touch.chi_square)
            self.found.append(one)
        self._goes_on = bool(collision[-1])
