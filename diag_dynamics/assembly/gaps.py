# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Count of lost states, by the gaps that they leave in the stamps."""

import numpy as np

WINDOW, LONGEST = 32, 1_000_000_000
"""Intervals between stamps that are judged together, and the longest one [ns]: a longer one is a pause of the sender, after
which all begins anew."""

IRREGULAR = 0.15
"""Mean distance of intervals from multiples of the period, in periods, beyond which there is no period."""


class Gaps:
    """Counts states lost in a full queue, which DDS does not tell of.

    Of each source the intervals between the stamps of its messages are collected, rejected messages included. Of every
    :data:`WINDOW` of them the period is the one that they are multiples of, from their lower quartile; of an interval of n
    periods n − 1 states are lost. Where they are no multiples of anything, as of a driver that sends when something moves,
    or where no more than half of them are one period, as of two drivers of one joint, none is.

    Attributes
    ----------
    lost : int
    """

    def __init__(self):
        self.lost = 0
        self._intervals = {}  # by source [ns]
        self._last = {}  # last stamp by source [ns]

    def take(self, source, stamp):
        """Take in the stamp of a message [ns]."""
        elapsed = stamp - self._last.get(source, stamp)
        self._last[source] = stamp
        if 0 < elapsed <= LONGEST:
            intervals = self._intervals.setdefault(source, [])
            intervals.append(elapsed)
            if len(intervals) == WINDOW:
                self.lost += lost_between(intervals)
                intervals.clear()
        elif elapsed > LONGEST:
            self._intervals.pop(source, None)

    def pause(self):
        """Begin anew: a message came whose stamp is unknown, so the next interval would count as a loss."""
        self._last.clear()


def lost_between(intervals):
    """Number of states lost within intervals [ns] that are multiples of one period; 0 if they are not."""
    return int(lost_in(np.array([intervals], dtype=float))[0])


def lost_in(windows):
    """Number of states lost in each row of intervals [ns], of float64: see :func:`lost_between`."""
    count = windows.shape[1]
    period = np.partition(windows, (count - 1) // 4, axis=1)[:, (count - 1) // 4, None]
    for _ in range(2):
        counts = np.maximum(np.rint(windows / period), 1.0)
        period = windows.sum(axis=1, keepdims=True) / counts.sum(axis=1, keepdims=True)
    apart = np.abs(windows / period - counts).mean(axis=1)
    regular = (apart <= IRREGULAR) & (2 * (counts == 1.0).sum(axis=1) > count)
    return np.where(regular, counts.sum(axis=1) - count, 0.0)
