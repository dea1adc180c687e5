# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The states that a report keeps: a selection with every peak.

States are columns by name. Of these are used here: ``index`` from the first state of the recording,
``K`` [J] and ``norm`` (|r|).
"""

import numpy as np

HALF_WINDOW = 0.01  # half the time over which dK/dt is averaged [s]


def energy_rate(t, K):
    """Return the mean of dK/dt about each state [W], (T,); NaN of a single state."""
    begin = np.maximum(t - HALF_WINDOW, t[0])
    end = np.minimum(t + HALF_WINDOW, t[-1])
    with np.errstate(all="ignore"):
        return (np.interp(end, t, K) - np.interp(begin, t, K)) / (end - begin)


class Overview:
    """Keep at most `size` states: the first one and the extremes of runs, whose length doubles."""

    def __init__(self, size):
        self._size = size
        self._stride = 1
        self._parts = []

    def add(self, states):
        """Add the next states."""
        self._parts.append(_select_extremes(states, self._stride))
        while sum(len(part["index"]) for part in self._parts) > self._size:
            self._stride *= 2
            self._parts = [_select_extremes(self.states(), self._stride)]

    def states(self):
        """Return all states that are kept."""
        names = self._parts[0]
        return {name: np.concatenate([part[name] for part in self._parts]) for name in names}


def _select_extremes(states, stride):
    """Return the first state, those of smallest and largest K and of the largest |r| of runs."""
    run = states["index"] // stride
    K = states["K"]
    norm = states["norm"]
    first = np.flatnonzero(np.diff(run, prepend=-1))
    last = np.append(first[1:], len(run)) - 1
    by_energy = np.lexsort((K, run))
    by_norm = np.lexsort((np.where(np.isfinite(norm), norm, -1.0), run))
    rows = np.unique(np.concatenate([first, by_energy[first], by_energy[last], by_norm[last]]))
    return {name: column[rows] for name, column in states.items()}
