# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Exposure to contact limits over a recording: time above them, and the worst moments."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.assembly.stamps import SECOND

MAX_INTERVAL = 0.5  # longest interval between states that is counted [s]
MOMENTS, SEPARATION = 5, SECOND  # number of the worst moments, and time between them [ns]


class Moment(NamedTuple):
    """A point with the fraction of its allowed speed that it used."""

    usage: float
    point: str
    link: str
    region: str
    speed: float
    reflected_mass: float
    energy: float
    force: float
    at: int  # stamp [ns]


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
        usage = contact.usage
        above = usage > 1.0
        self._above += interval @ above
        self._any_above += float(interval @ above.any(axis=1))
        self._duration += float(interval.sum())
        self._keep_worst(stamps, contact, usage)

    def _keep_worst(self, stamps, contact, usage):
        """Keep the worst moments that are apart, of those before and of these states."""
        largest = np.fmax.reduce(usage, axis=1, initial=0.0)
        before, self._moments = self._moments, []
        while len(self._moments) < MOMENTS:
            t = int(np.argmax(largest))
            if before and before[0].usage >= largest[t]:
                worst = before[0]
            elif largest[t] > 0.0:
                worst = _moment(int(stamps[t]), t, contact, usage)
            else:
                break
            self._moments.append(worst)
            before = [one for one in before if abs(one.at - worst.at) >= SEPARATION]
            largest[np.abs(stamps - worst.at) < SEPARATION] = 0.0

    def summary(self, time):
        """Return `above`, `of`, `above_by_point` [s] and `worst`; `time` converts stamps [ns] to times [s]."""
        by_point = zip(self._names, self._above.tolist(), strict=True)
        return {
            "above": self._any_above,
            "of": self._duration,
            "above_by_point": {name: seconds for name, seconds in by_point if seconds},
            "worst": [one._asdict() | {"at": time(one.at)} for one in self._moments],
        }


def _moment(stamp, t, contact, usage):
    k = int(np.argmax(usage[t]))
    numbers = usage, contact.speed, contact.reflected_mass, contact.energy, contact.force
    usage, *numbers = (float(values[t, k]) for values in numbers)
    return Moment(usage, contact.names[k], contact.links[k], contact.region(k, t), *numbers, stamp)
