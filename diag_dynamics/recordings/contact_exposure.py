# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Exposure to contact limits over a recording: time above them, and the worst moments."""

import numpy as np

from diag_dynamics.joint_states.stamps import SECOND

MAX_INTERVAL = 0.5  # longest interval between states that is counted [s]
MOMENTS, SEPARATION = 5, SECOND  # number of the worst moments, and time between them [ns]


class ContactExposure:
    """Compare predicted contact at ContactPoints with their limits, batch by batch."""

    def __init__(self, points):
        self._above, self._any_above, self._duration = np.zeros(len(points.names)), 0.0, 0.0
        self._names, self._last, self._worst = points.names, None, []

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
        before, self._worst = self._worst, []
        largest = np.append([one["usage"] for one in before], usage.max(axis=1, initial=0.0))
        at = np.append(np.array([one["at"] for one in before], dtype=np.int64), stamps)
        while len(self._worst) < MOMENTS and largest.max() > 0.0:
            k = int(np.argmax(largest))
            t = k - len(before)
            self._worst.append(before[k] if t < 0 else _moment(int(stamps[t]), t, contact, usage[t]))
            largest[np.abs(at - at[k]) < SEPARATION] = 0.0

    def summary(self, time):
        """Return `above`, `of`, `above_by_point` [s] and `worst`; `time` converts stamps [ns] to times [s]."""
        by_point = zip(self._names, self._above.tolist(), strict=True)
        return {
            "above": self._any_above,
            "of": self._duration,
            "above_by_point": {name: seconds for name, seconds in by_point if seconds},
            "worst": [one | {"at": time(one["at"])} for one in self._worst],
        }


def _moment(stamp, t, contact, usage):
    """Return the point with the largest fraction of its allowed speed at state t, with its numbers."""
    k = int(np.argmax(usage))
    names = {"point": contact.names[k], "link": contact.links[k], "region": contact.region(k, t)}
    numbers = {name: float(getattr(contact, name)[t, k]) for name in ("speed", "reflected_mass", "energy", "force")}
    return {"usage": float(usage[k]), **names, **numbers, "at": stamp}
