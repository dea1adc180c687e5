# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Collisions as events: start, end, the detectors that rose, and how far."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, BoolArray, IntArray
from diag_dynamics.collision.detector import CHANGE, NORM, TORQUE, AlarmDetector, Judged
from diag_dynamics.results import TouchedLink

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
    joints: tuple[str, ...]  # that rose; without any, the one with the largest ratio to its threshold
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
        return self._replace(link=str(link), confidence=float(confidence), chi_square=float(chi_square))

    def describe(self) -> str:
        """Return what rose in words: the joints, or else the detector with the largest ratio."""
        joints = [one.describe() for one in self.exceeded if one.detector.removesuffix(CHANGE) in self.joints]
        return ", ".join(joints) or f"{self.exceeded[0].describe()}, most of it at {self.joints[0]}"


class Alarms:
    """Collect the alarms of a detector; `judged` are the detectors that have a threshold."""

    def __init__(self, detector: AlarmDetector) -> None:
        self._detectors, self._limits = detector.detectors, np.append(detector.limits, detector.rest_limits)
        self.judged = tuple(np.array(self._detectors)[np.isfinite(self._limits)].tolist())
        self.found: list[Alarm] = []

    def add_states(self, stamps: IntArray, norm: Array, judged: Judged, touched: TouchedLink | None = None) -> None:
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
        exceeded = [Exceeded(self._detectors[k], float(peaks[k]), float(self._limits[k])) for k in order if rose[k]]
        of_joints, either = np.maximum(ratios[:n], ratios[n + 2 : -1]), rose[:n] | rose[n + 2 : -1]
        nearest = int(np.argmax(of_joints if of_joints.any() else np.maximum(peaks[:n], peaks[n + 2 : -1])))
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
            k = first + int(np.argmax(norm[first:end]))  # the joints are those pushed most at the largest |r|
            one = Alarm(int(stamps[first]), int(stamps[end - 1]), most_pushed(self._names, torque[k]), float(norm[k]))
            one = one.at_link(touched, np.arange(first, end))
            if first == 0 and self._goes_on:
                before = self.found.pop()
                touch = max(before, one, key=lambda x: x.chi_square)
                end, one = one.end, before if before.norm >= one.norm else one
                one = one._replace(start=before.start, end=end, link=touch.link, confidence=touch.confidence)
                one = one._replace(chi_square=touch.chi_square)
            self.found.append(one)
        self._goes_on = bool(collision[-1])
