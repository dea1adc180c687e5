# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Samples that follow one another, integrals over windows, and maxima, of states in batches."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.joint_states.stamps import SECOND


def column_maxima(values):
    """Return the largest of each column, shape (n,).

    NaN is ignored, and −inf stands for no number.
    """
    # The reduction is fast along long rows.
    return np.fmax.reduce(np.ascontiguousarray(values.T), axis=1, initial=-np.inf)


class Samples(NamedTuple):
    """States with efforts in a batch.

    Of several states with one stamp the first one is the sample.
    """

    rows: np.ndarray | slice  # of the S samples in the batch
    interval: np.ndarray  # since the sample before [s], shape (S,); 0 if no motion leads from there
    known: np.ndarray  # rows of all states with efforts, shape (N,)
    # Number of the sample of each, shape (N,); −1 is the last one of the batch before
    sample: np.ndarray


class SampleChain:
    """Select samples that are at most `max_gap` [s] apart from batches of states, in order."""

    def __init__(self, max_gap):
        # Stamp of the last sample, jumps since
        self._max_gap = max_gap
        self._last = -(2**62)
        self._jumps = 0

    def select(self, states, known=None):
        """Return the :class:`Samples` of the next states.

        They are of states with all efforts, or of those that are `known`, bool.
        """
        known = np.flatnonzero(states.effort_known if known is None else known)
        jumps = np.cumsum(np.append(self._jumps, states.jumped))
        stamps = np.append(self._last, states.stamp[known])
        jumps_before = np.append(0, jumps[known + 1])
        begins = np.diff(jumps_before) > 0
        interval = np.diff(stamps) / SECOND
        self._last = stamps[-1]
        self._jumps = jumps[-1] - jumps_before[-1]
        first = begins | (interval != 0.0)
        interval[begins | (interval < 0.0) | (interval > self._max_gap)] = 0.0
        rows = slice(None) if len(known) == len(states.stamp) and first.all() else known[first]
        return Samples(rows, interval[first], known, np.cumsum(first) - 1)


class WindowIntegrals:
    """Integrate over windows between multiples of a length [s]; those with a gap are omitted."""

    def __init__(self, length):
        self._length = round(length * SECOND)
        self._begin = None
        self._whole = False
        self._sums = 0.0

    def integrate(self, stamps, follows, steps, values):
        """Return begin and end [ns], sums of steps (T, m) and changes of values, of ended windows.

        The first stamp is that of the last state before; `follows` tells whether each state follows
        the one before.
        """
        if self._begin is None:
            self._begin = stamps[0], values[0]
        steps[0] = self._sums
        number = stamps // self._length
        ends = follows[1:] & (number[1:] != number[:-1])
        bounds = np.flatnonzero(ends | ~follows[1:]) + 1
        cuts = np.append(0, bounds + 1)
        last = cuts[-1] == len(steps)
        sums = np.add.reduceat(steps, cuts[: len(cuts) - last])
        whole = np.append(self._whole, ends[bounds - 1])
        stamps = np.append(self._begin[0], stamps[bounds])
        values = np.vstack([self._begin[1], values[bounds]])
        self._begin = stamps[-1], values[-1]
        self._whole = whole[-1]
        self._sums = 0.0 if last else sums[-1]
        k = np.flatnonzero(whole[:-1] & whole[1:])
        return stamps[k], stamps[k + 1], sums[k], values[k + 1] - values[k]
