# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a touch would have cost over a recording: time above the limits of contact, and the worst moments."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.contact.results import Contact

CONTINUOUS = 0.5
"""Time between two states [s] beyond which nothing is said of what was in between."""

MOMENTS, APART = 5, 1.0
"""How many of the worst moments are kept, and how far they are apart [s]."""


class Moment(NamedTuple):
    """A point that used much of its allowed speed."""

    usage: float
    """Part of that."""
    stamp: int
    point: str
    link: str
    region: str
    speed: float
    reflected_mass: float
    energy: float
    force: float


class Touches:
    """Contact at the states of a recording, against limits.

    Parameters
    ----------
    names : sequence of str
        Of the entries of ContactPoints.

    Attributes
    ----------
    above : dict
        How long each entry was above its limit [s].
    any_above : float
        How long any was [s].
    judged : float
        How long states followed each other [s].
    moments : list of Moment
        The worst, worst first.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        self.above = dict.fromkeys(names, 0.0)
        self.any_above = self.judged = 0.0
        self.moments: list[Moment] = []

    def take(self, stamps: Array, since: Array, contact: Contact) -> None:
        """Take in states: their stamps [ns], and the time since the state before each of them [s]."""
        usage = contact.usage
        interval = np.where((since > 0.0) & (since <= CONTINUOUS), since, 0.0)
        above = usage > 1.0
        for k in np.flatnonzero(above.any(axis=0)):
            self.above[contact.names[k]] += float(interval @ above[:, k])
        self.any_above += float(interval @ above.any(axis=1))
        self.judged += float(interval.sum())
        largest = usage.max(axis=1, initial=0.0)
        for t in np.argsort(-largest, kind="stable").tolist():
            full = len(self.moments) == MOMENTS and largest[t] <= self.moments[-1].usage
            if not largest[t] > 0.0 or full:
                break
            if all(abs(int(stamps[t]) - one.stamp) >= APART * 1e9 or one.usage < largest[t] for one in self.moments):
                self._keep([_moment(int(stamps[t]), t, contact, usage)])

    def add(self, other: Touches) -> None:
        """Take in those of the next piece."""
        for name, seconds in other.above.items():
            self.above[name] = self.above.get(name, 0.0) + seconds
        self.any_above += other.any_above
        self.judged += other.judged
        self._keep(other.moments)

    def _keep(self, more: list[Moment]) -> None:
        """Keep the worst moments that are apart."""
        kept: list[Moment] = []
        for one in sorted([*self.moments, *more], key=lambda one: (-one.usage, one.stamp)):
            if all(abs(one.stamp - other.stamp) >= APART * 1e9 for other in kept):
                kept.append(one)
        self.moments = kept[:MOMENTS]

    def told(self, time: Any) -> dict[str, Any]:
        """What a summary says; `time` takes stamps [ns] to times of the recording [s]."""
        return {
            "above": self.any_above,
            "of": self.judged,
            "above_by_point": {name: seconds for name, seconds in self.above.items() if seconds},
            "worst": [
                {name: value for name, value in one._asdict().items() if name != "stamp"} | {"at": time(one.stamp)}
                for one in self.moments
            ],
        }


def _moment(stamp: int, t: int, contact: Contact, usage: Array) -> Moment:
    k = int(np.argmax(usage[t]))
    numbers = (contact.speed, contact.reflected_mass, contact.energy, contact.force)
    said = contact.names[k], contact.links[k], contact.region(k, t)
    return Moment(float(usage[t, k]), stamp, *said, *(float(values[t, k]) for values in numbers))
