# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Alarms as events: start, end, the detectors that rose, and how far."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, Whole
from diag_dynamics.collision.detector import AlarmDetector, Judged
from diag_dynamics.collision.thresholds import NORM, TORQUE

UNITS = {TORQUE: "N m", NORM: "J^0.5/s"}
LABELS = {TORQUE: "|m r|", NORM: "|r|"}

NAMED_SHARE = 0.5


def most_pushed(names: Sequence[str], torque: Array) -> tuple[str, ...]:
    """Return the joints with half of the largest |m r| or more, the largest first.

    The residual names none: r follows ℓτ_ext, whose components mix the torques of several joints.
    """
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
        label, unit = LABELS.get(self.detector, self.detector), UNITS.get(self.detector, "N m")
        return f"{label} {self.value:.3g} {unit} > {self.threshold:.3g}"


class Alarm(NamedTuple):
    """A collision by the detector.

    Without a joint that rose, `joints` is the one with the largest ratio to its threshold.
    """

    start: int  # stamp of the first state [ns]
    end: int  # of the last one
    first: str  # detector that rose first; of several, the one with the largest ratio
    exceeded: tuple[Exceeded, ...]  # all that rose, the largest ratio first
    joints: tuple[str, ...]
    norm: float  # largest |r| [J^½/s]

    def describe(self) -> str:
        """Return what rose in words: the joints, or else the detector with the largest ratio."""
        joints = [one for one in self.exceeded if one.detector in self.joints]
        if joints:
            return ", ".join(one.describe() for one in joints)
        return f"{self.exceeded[0].describe()}, most of it at {self.joints[0]}"


class Alarms:
    """Collects the alarms of a detector; `judged` are the detectors that have a threshold."""

    def __init__(self, detector: AlarmDetector) -> None:
        self._detectors, self._limits = detector.detectors, detector.limits
        self.judged = tuple(np.array(self._detectors)[np.isfinite(self._limits)].tolist())
        self.found: list[Alarm] = []
        self._peaks, self._nearest = np.zeros(len(self._limits)), (-1.0, "")

    def add_states(self, stamps: Whole, norm: Array, judged: Judged) -> None:
        """Add states: stamps [ns], |r| and the results of the detector."""
        on = np.flatnonzero(judged.alarm)
        for rows in np.split(on, np.flatnonzero(judged.begins[on])):
            if len(rows):
                begins = bool(judged.begins[rows[0]]) or not self.found
                self._add_alarm(stamps[rows], norm[rows], judged.values[rows], begins)

    def _add_alarm(self, stamps: Whole, norm: Array, values: Array, begins: bool) -> None:
        """Add states of one alarm, which begins, or continues the last one."""
        n, ratios = len(self._limits) - 2, values / self._limits
        if begins:
            first = self._detectors[int(np.argmax(ratios[0]))]
            alarm = Alarm(int(stamps[0]), 0, first, (), (), 0.0)
            self._peaks, self._nearest = np.zeros(n + 2), (-1.0, "")
        else:
            alarm = self.found.pop()
        at = int(np.argmax(ratios.max(axis=1)))
        of_joints = ratios[at, :n] if ratios[at, :n].any() else values[at, :n]
        nearest = float(ratios[at].max()), self._detectors[int(np.argmax(of_joints))]
        self._nearest = max(self._nearest, nearest, key=lambda one: one[0])
        self._peaks = np.maximum(self._peaks, values.max(axis=0))
        risen = [
            Exceeded(name, float(peak), float(limit))
            for name, peak, limit in zip(self._detectors, self._peaks, self._limits, strict=True)
            if peak > limit
        ]
        joints = tuple(one.detector for one in risen if one.detector not in (TORQUE, NORM))
        exceeded = tuple(sorted(risen, key=lambda one: -one.value / one.threshold))
        largest = max(alarm.norm, float(norm.max()))
        end, joints = int(stamps[-1]), joints or (self._nearest[1],)
        self.found.append(alarm._replace(end=end, exceeded=exceeded, joints=joints, norm=largest))
