# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The states that a report keeps: an overview with every peak, and all states around contacts.

States are records of NumPy. Of their fields these are used here: ``index`` from the first state of
the recording, ``t`` [s], ``K`` [J], ``norm`` (|r|) and ``collision``.
"""

import numpy as np

from diag_dynamics.recordings.balance import MAX_GAP

AROUND, MAX_RUN = 2.0, 20.0
"""Time about the start and the end of a contact, and the longest run of such states [s]."""

HALF_WINDOW = 0.01  # half the time over which powers are averaged [s]


def make_records(columns):
    """Return columns by name, shape (T, …), as T records."""
    records = np.empty(
        len(columns["t"]), [(name, x.dtype, x.shape[1:]) for name, x in columns.items()]
    )
    for name, column in columns.items():
        records[name] = column
    return records


def mean_powers(t, powers, K):
    """Return means of powers (T, k) and of dK/dt about each state [W], (T, k + 1); NaN at gaps."""
    steps = np.diff(t, prepend=t[0])[:, None]
    is_gap = steps > MAX_GAP
    means = 0.5 * (powers + np.concatenate([powers[:1], powers[:-1]]))
    is_unknown = ~np.isfinite(means) | is_gap
    work = np.cumsum(np.where(is_unknown, 0.0, means * steps), axis=0)
    count = np.cumsum(np.concatenate([is_unknown, is_gap], axis=1), axis=0)
    begin = np.maximum(t - HALF_WINDOW, t[0])
    end = np.minimum(t + HALF_WINDOW, t[-1])
    before = np.maximum(np.searchsorted(t, begin, side="right") - 1, 0)
    after = np.minimum(np.searchsorted(t, end), len(t) - 1)
    missing = (count[after] > count[before]) | (end <= begin)[:, None]
    change = [np.interp(end, t, energy) - np.interp(begin, t, energy) for energy in (*work.T, K)]
    with np.errstate(all="ignore"):
        return np.where(missing, np.nan, np.transpose(change) / (end - begin)[:, None])


class Overview:
    """Keep at most `size` states: the first one and the extremes of runs, whose length doubles."""

    def __init__(self, size):
        self._size = size
        self._stride = 1
        self._parts = []

    def add(self, states):
        """Add the next states."""
        self._parts.append(states[_extremes(states, self._stride)])
        while sum(map(len, self._parts)) > self._size:
            self._stride *= 2
            states = self.states()
            self._parts = [states[_extremes(states, self._stride)]]

    def states(self):
        """Return all states that are kept."""
        return np.concatenate(self._parts)


def _extremes(states, stride):
    """Return indices of the first state, the smallest and largest K and the largest |r| of runs."""
    run = states["index"] // stride
    K = states["K"]
    norm = states["norm"]
    first = np.flatnonzero(np.diff(run, prepend=-1))
    last = np.append(first[1:], len(run)) - 1
    by_energy = np.lexsort((K, run))
    by_norm = np.lexsort((np.where(np.isfinite(norm), norm, -1.0), run))
    return np.unique(np.concatenate([first, by_energy[first], by_energy[last], by_norm[last]]))


class ContactRuns:
    """Find all states around contacts. The newest are held back for the next contact."""

    def __init__(self):
        self._recent = None
        self._run = []
        self._collides = False
        self._edges = np.array([-np.inf, np.inf])

    def add(self, states):
        """Add the next states; yield the runs that are complete."""
        edges = states["t"][np.diff(states["collision"], prepend=self._collides)]
        self._collides = bool(states["collision"][-1])
        self._edges = np.sort(np.append(self._edges, edges))
        if self._recent is not None:
            states = np.concatenate([self._recent, states])
        is_recent = states["t"] >= states["t"][-1] - AROUND
        self._recent = states[is_recent]
        yield from self._split(states[~is_recent])

    def finish(self):
        """Yield the remaining runs."""
        yield from self._split(self._recent)
        if self._run:
            yield np.concatenate(self._run)

    def _split(self, states):
        t = states["t"]
        following = np.searchsorted(self._edges, states["t"])
        distance = np.minimum(t - self._edges[following - 1], self._edges[following] - t)
        is_near = distance <= AROUND
        cuts = np.flatnonzero(np.diff(is_near, prepend=~is_near[:1]))
        for first, part in zip(cuts, np.split(states, cuts)[1:], strict=True):
            if is_near[first]:
                self._run.append(part)
            if self._run and (not is_near[first] or part["t"][-1] - self._run[0]["t"][0] > MAX_RUN):
                yield np.concatenate(self._run)
                self._run = []
