# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Exposure to contact limits over a recording: time above them, and the worst moments."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.assembly.stamps import SECOND

MAX_INTERVAL = 0.5
"""Longest interval between states that is counted [s]."""

MOMENTS, SEPARATION = 5, SECOND
"""Number of the worst moments, and time between them [ns]."""


class Moment(NamedTuple):
    """A point with the fraction of its allowed speed that it used."""

    usage: float
    stamp: int
    point: str
    link: str
    region: str
    speed: float
    reflected_mass: float
    energy: float
    force: float


class ContactExposure:
    """Compare predicted contact at ContactPoints with their limits, batch by batch."""

    def __init__(self, points):
        self._above, self._any_above, self._duration = np.zeros(len(points.names)), 0.0, 0.0
        self._names, self._last, self._moments = points.names, None, []

    def add_states(self, stamps, contact):
        """Add states: stamps [ns] and Contact."""
        since = np.diff(stamps, prepend=stamps[0] if self._last is None else self._last) * 1e-9
        self._last = int(stamps[-1])
        interval = np.where((since > 0.0) & (since <= MAX_INTERVAL), since, 0.0)
        usage, above = contact.usage, contact.usage > 1.0
        self._above += interval @ above
        self._any_above += float(interval @ above.any(axis=1))
        self._duration += float(interval.sum())
        largest = usage.max(axis=1, initial=0.0)
        for t in np.argsort(-largest, kind="stable").tolist():
            full = len(self._moments) == MOMENTS and largest[t] <= self._moments[-1].usage
            if not largest[t] > 0.0 or full:
                break
            near = [one for one in self._moments if abs(int(stamps[t]) - one.stamp) < SEPARATION]
            if all(one.usage < largest[t] for one in near):
                self._keep(_moment(int(stamps[t]), t, contact, usage))

    def _keep(self, moment):
        """Keep the worst moments that are apart."""
        kept = []
        for one in sorted([*self._moments, moment], key=lambda one: (-one.usage, one.stamp)):
            if all(abs(one.stamp - other.stamp) >= SEPARATION for other in kept):
                kept.append(one)
        self._moments = kept[:MOMENTS]

    def summary(self, time):
        """Return `above`, `of`, `above_by_point` [s] and `worst`; `time` converts stamps [ns] to times [s]."""
        by_point = zip(self._names, self._above.tolist(), strict=True)
        return {
            "above": self._any_above,
            "of": self._duration,
            "above_by_point": {name: seconds for name, seconds in by_point if seconds},
            "worst": [
                {name: value for name, value in one._asdict().items() if name != "stamp"} | {"at": time(one.stamp)}
                for one in self._moments
            ],
        }


def _moment(stamp, t, contact, usage):
    k = int(np.argmax(usage[t]))
    numbers = (contact.speed, contact.reflected_mass, contact.energy, contact.force)
    names = contact.names[k], contact.links[k], contact.region(k, t)
    return Moment(float(usage[t, k]), stamp, *names, *(float(values[t, k]) for values in numbers))
