# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Alarms as a list: which detectors rose, how far, and from when until when."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, Whole
from diag_dynamics.collision.detector import AlarmDetector, Judged
from diag_dynamics.collision.thresholds import NORM, TORQUE

UNITS = {TORQUE: "N m", NORM: "J^0.5/s"}
LABELS = {TORQUE: "|m r|", NORM: "|r|"}


class Exceeded(NamedTuple):
    """A detector that has risen above its threshold."""

    detector: str
    """A joint, ``external_torque`` or ``norm``."""
    value: float
    """Its largest [N m, N, J^½/s]."""
    threshold: float

    def told(self) -> str:
        """Words, as ``shoulder_lift 34 N m > 21``."""
        label, unit = LABELS.get(self.detector, self.detector), UNITS.get(self.detector, "N m")
        return f"{label} {self.value:.3g} {unit} > {self.threshold:.3g}"


class Alarm(NamedTuple):
    """An alarm."""

    start: int
    """Stamp of its first state, and of its last one [ns]."""
    end: int
    first: str
    """Detector that rose first; of several at once, the one that was furthest above."""
    exceeded: tuple[Exceeded, ...]
    """All that rose, the furthest above first."""
    joints: tuple[str, ...]
    """Joints that rose; if none did, the one that came nearest to it."""
    norm: float
    """Largest |r| [J^½/s]."""

    def told(self) -> str:
        """Words: the joints first, or what else has risen."""
        joints = [one for one in self.exceeded if one.detector in self.joints]
        if joints:
            return ", ".join(one.told() for one in joints)
        return f"{self.exceeded[0].told()}, most of it at {self.joints[0]}"

    def joined(self, later: Alarm) -> Alarm:
        """One alarm of two: this one goes on in the other."""
        exceeded = {one.detector: one for one in self.exceeded}
        for one in later.exceeded:
            if one.detector not in exceeded or one.value > exceeded[one.detector].value:
                exceeded[one.detector] = one
        by_joint = [alarm.joints for alarm in (self, later) if set(alarm.joints) & exceeded.keys()]
        joints = tuple(dict.fromkeys(name for names in by_joint or [self.joints] for name in names))
        return self._replace(
            end=later.end, exceeded=_furthest_first(exceeded.values()), joints=joints, norm=max(self.norm, later.norm)
        )


class Alarms:
    """Gathers alarms, piece by piece.

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
        self._joins = False  # whether the first one belongs to one before all that was taken in

    def take(self, stamps: Whole, norm: Array, judged: Judged) -> None:
        """Take in states: stamps [ns], |r|, and what the detector said."""
        edges = np.diff(judged.alarm.astype(np.int8), prepend=np.int8(0), append=np.int8(0))
        starts, ends = np.flatnonzero((edges[:-1] == 1) | judged.begins), np.flatnonzero(edges == -1)
        over = ends[np.searchsorted(ends, starts, side="right")]
        for first, end in zip(starts, np.minimum(over, np.append(starts[1:], over[-1:])), strict=True):
            one = self._alarm(stamps[first:end], norm[first:end], judged.values[first:end])
            if judged.begins[first]:
                self.found.append(one)
            elif self.found:
                self.found[-1] = self.found[-1].joined(one)
            else:
                self._joins = True
                self.found.append(one)

    def latest(self) -> Alarm:
        """Forget all alarms but the last one."""
        del self.found[:-1]
        return self.found[0]

    def add(self, other: Alarms) -> None:
        """Take in what another one has, which has gone on from here."""
        found = list(other.found)
        if other._joins and self.found:
            found[0] = self.found.pop().joined(found[0])
        else:
            self._joins = self._joins or other._joins
        self.found += found

    def _alarm(self, stamps: Whole, norm: Array, values: Array) -> Alarm:
        ratios, peaks, n = values / self._limits, values.max(axis=0), len(self._detectors) - 2
        above = np.flatnonzero(peaks > self._limits)
        exceeded = (Exceeded(self._detectors[k], float(peaks[k]), float(self._limits[k])) for k in above)
        joints = [int(k) for k in above if k < n]
        if not joints:
            at = int(np.argmax(ratios.max(axis=1)))
            weight = ratios[at, :n] if ratios[at, :n].any() else values[at, :n]
            joints = [int(np.argmax(weight))]
        return Alarm(
            int(stamps[0]),
            int(stamps[-1]),
            self._detectors[int(np.argmax(ratios[0]))],
            _furthest_first(exceeded),
            tuple(self._detectors[k] for k in joints),
            float(norm.max()),
        )


def _furthest_first(exceeded: Iterable[Exceeded]) -> tuple[Exceeded, ...]:
    return tuple(sorted(exceeded, key=lambda one: -one.value / one.threshold))
