# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Alarms as events: start, end, the detectors that rose, and how far."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, Whole
from diag_dynamics.collision.detector import AlarmDetector, Judged
from diag_dynamics.collision.thresholds import NORM, TORQUE

UNITS = {TORQUE: "N m", NORM: "J^0.5/s"}
LABELS = {TORQUE: "|m r|", NORM: "|r|"}


class Exceeded(NamedTuple):
    """A detector that rose: its name, its largest value and its threshold [N m, N, J^½/s]."""

    detector: str
    value: float
    threshold: float

    def describe(self) -> str:
        """Return a text such as ``shoulder_lift 34 N m > 21``."""
        label, unit = LABELS.get(self.detector, self.detector), UNITS.get(self.detector, "N m")
        return f"{label} {self.value:.3g} {unit} > {self.threshold:.3g}"


class Alarm(NamedTuple):
    """An alarm.

    Attributes
    ----------
    start, end : int
        Stamps of its first and last state [ns].
    first : str
        Detector that rose first; of several at once, the one with the largest ratio to its threshold.
    exceeded : tuple of Exceeded
        All that rose, the largest ratio first.
    joints : tuple of str
        Joints that rose; without any, the joint with the largest ratio.
    norm : float
        Largest |r| [J^½/s].
    """

    start: int
    end: int
    first: str
    exceeded: tuple[Exceeded, ...]
    joints: tuple[str, ...]
    norm: float

    def describe(self) -> str:
        """Return what rose in words: the joints, or else the detector with the largest ratio."""
        joints = [one for one in self.exceeded if one.detector in self.joints]
        if joints:
            return ", ".join(one.describe() for one in joints)
        return f"{self.exceeded[0].describe()}, most of it at {self.joints[0]}"

    def told(self) -> str:
        """Return the same, until its callers are renamed."""
        return self.describe()


class Alarms:
    """Collects the alarms of a detector from its results.

    Parameters
    ----------
    detector : AlarmDetector

    Attributes
    ----------
    found : list of Alarm
    judged : tuple of str
        Detectors that have a threshold.
    """

    def __init__(self, detector: AlarmDetector) -> None:
        self._detectors, self._limits = detector.detectors, detector.limits
        self.judged = tuple(np.array(self._detectors)[np.isfinite(self._limits)].tolist())
        self.found: list[Alarm] = []
        self._peaks, self._nearest = np.zeros(len(self._limits)), (-1.0, "")
        self._continues = False

    def add_states(self, stamps: Whole, norm: Array, judged: Judged) -> None:
        """Add states: stamps [ns], |r| and the results of the detector."""
        edges = np.diff(judged.alarm.astype(np.int8), prepend=np.int8(0), append=np.int8(0))
        starts, ends = np.flatnonzero((edges[:-1] == 1) | judged.begins), np.flatnonzero(edges == -1)
        over = ends[np.searchsorted(ends, starts, side="right")]
        for first, end in zip(starts, np.minimum(over, np.append(starts[1:], over[-1:])), strict=True):
            rows = slice(first, end)
            if judged.begins[first] or not self.found:
                self._continues |= not judged.begins[first]
                self._peaks, self._nearest = np.zeros(len(self._limits)), (-1.0, "")
                rose = self._detectors[int(np.argmax(judged.values[first] / self._limits))]
                start, largest = int(stamps[first]), 0.0
            else:
                start, _, rose, _, _, largest = self.found.pop()
            self._add_values(judged.values[rows])
            alarm = Alarm(start, int(stamps[end - 1]), rose, *self._exceeded(), max(largest, float(norm[rows].max())))
            self.found.append(alarm)

    def _add_values(self, values: Array) -> None:
        n, ratios = len(self._limits) - 2, values / self._limits
        self._peaks = np.maximum(self._peaks, values.max(axis=0))
        at = int(np.argmax(ratios.max(axis=1)))
        weight = ratios[at, :n] if ratios[at, :n].any() else values[at, :n]
        ratio = float(ratios[at].max())
        if ratio > self._nearest[0]:
            self._nearest = ratio, self._detectors[int(np.argmax(weight))]

    def _exceeded(self) -> tuple[tuple[Exceeded, ...], tuple[str, ...]]:
        """Return the detectors that rose, and the joints."""
        above = np.flatnonzero(self._peaks > self._limits)
        rose = [Exceeded(self._detectors[k], float(self._peaks[k]), float(self._limits[k])) for k in above]
        joints = tuple(self._detectors[k] for k in above if k < len(self._limits) - 2)
        ordered = sorted(rose, key=lambda one: -one.value / one.threshold)
        return tuple(ordered), joints or (self._nearest[1],)

    # Until recordings are analysed in one pass:

    take = add_states

    def add(self, other: Alarms) -> None:
        """Add the alarms of the next piece."""
        found = list(other.found)
        if other._continues and self.found:
            before, after = self.found.pop(), found[0]
            exceeded = {one.detector: one for one in before.exceeded}
            for one in after.exceeded:
                if one.detector not in exceeded or one.value > exceeded[one.detector].value:
                    exceeded[one.detector] = one
            by_joint = [alarm.joints for alarm in (before, after) if set(alarm.joints) & exceeded.keys()]
            joints = tuple(dict.fromkeys(name for names in by_joint or [before.joints] for name in names))
            rose = tuple(sorted(exceeded.values(), key=lambda one: -one.value / one.threshold))
            found[0] = Alarm(before.start, after.end, before.first, rose, joints, max(before.norm, after.norm))
        else:
            self._continues = self._continues or other._continues
        self.found += found
