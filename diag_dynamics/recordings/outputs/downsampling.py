# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The states that a report keeps: an overview with every peak, and all states around contacts.

States are records of NumPy. Of their fields these are used here: ``index`` from the first state of
the recording, ``t`` [s], ``K`` [J], ``norm`` (|r|), ``collision`` and ``sums`` of :class:`Work`.
"""

import numpy as np

from diag_dynamics.recordings.balance import MAX_GAP

AROUND, MAX_RUN = 2.0, 20.0
"""Time about the start and the end of a contact, and the longest run of states around contacts [s]."""

HALF_WINDOW = 0.01  # half the time over which powers are averaged [s]


def make_records(columns):
    """Return columns by name, shape (T, …), as T records."""
    records = np.empty(
        len(columns["t"]), [(name, x.dtype, x.shape[1:]) for name, x in columns.items()]
    )
    for name, column in columns.items():
        records[name] = column
    return records


class Work:
    """Integrate k powers over a recording, batch by batch."""

    def __init__(self):
        self._last = None

    def integrate(self, t, powers):
        """Return sums since the first state, (T, 2k + 1): work [J], steps with unknown powers, and gaps."""
        t0, p0, sums0 = self._last or (t[0], powers[0], np.zeros(2 * powers.shape[1] + 1))
        steps = np.diff(t, prepend=t0)[:, None]
        mean, gap = 0.5 * (powers + np.concatenate([p0[None], powers[:-1]])), steps > MAX_GAP
        known = np.isfinite(mean) & ~gap
        work = np.where(known, mean * steps, 0.0)
        sums = sums0 + np.cumsum(np.concatenate([work, ~known, gap], axis=1), axis=0)
        self._last = t[-1], powers[-1], sums[-1]
        return sums


def mean_powers(states):
    """Return the mean of each power and dK/dt about each state [W], shape (T, k + 1)."""
    t, k = states["t"], states["sums"].shape[1] // 2
    energies, unknown = np.column_stack([states["sums"][:, :k], states["K"]]), states["sums"][:, k:]
    begin, end = np.maximum(t - HALF_WINDOW, t[0]), np.minimum(t + HALF_WINDOW, t[-1])
    before = np.maximum(np.searchsorted(t, begin, side="right") - 1, 0)
    after = np.minimum(np.searchsorted(t, end), len(t) - 1)
    missing = (unknown[after] > unknown[before]) | (end <= begin)[:, None]
    change = [np.interp(end, t, x) - np.interp(begin, t, x) for x in energies.T]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(missing, np.nan, np.transpose(change) / (end - begin)[:, None])


class Overview:
    """Keep at most `size` states: the first one and the extremes of runs, which double in length."""

    def __init__(self, size):
        self._size, self._stride, self._parts = size, 1, []

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
    run, K, norm = states["index"] // stride, states["K"], states["norm"]
    first = np.flatnonzero(np.diff(run, prepend=-1))
    last = np.append(first[1:], len(run)) - 1
    by_energy = np.lexsort((K, run))
    by_norm = np.lexsort((np.where(np.isfinite(norm), norm, -1.0), run))
    return np.unique(np.concatenate([first, by_energy[first], by_energy[last], by_norm[last]]))


class ContactRuns:
    """Find all states around contacts. The newest are held back, because the next contact may be near them."""

    def __init__(self):
        self._recent, self._run, self._collides = None, [], False
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
        t, following = states["t"], np.searchsorted(self._edges, states["t"])
        distance = np.minimum(t - self._edges[following - 1], self._edges[following] - t)
        is_near = distance <= AROUND
        cuts = np.flatnonzero(np.diff(is_near, prepend=~is_near[:1]))
        for first, part in zip(cuts, np.split(states, cuts)[1:], strict=True):
            if is_near[first]:
                self._run.append(part)
            if self._run and (not is_near[first] or part["t"][-1] - self._run[0]["t"][0] > MAX_RUN):
                yield np.concatenate(self._run)
                self._run = []
