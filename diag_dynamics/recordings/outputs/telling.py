# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which states of a recording a report keeps: some of all of it, none of whose peaks is missing, and all around contacts."""

from typing import NamedTuple

import numpy as np

AROUND = 2.0
"""Time before and after the beginning and the end of a contact of which every state is kept [s]."""

LONGEST = 20.0
"""Of a run of states at full rate [s]: where contact follows on contact, another one begins."""

HALF = 0.01
"""Half the time over which powers are averaged [s]: over shorter ones dK/dt is noise."""

LARGEST_GAP = 0.1
"""Time between two states beyond which they say nothing of the power in between [s]."""

WORKS = "effort", "gravity", "friction", "external"
"""Whose work is kept, beside K and the number of steps of which nothing is known, at each state."""


class Rows(NamedTuple):
    """States of a piece in columns, as far as a report needs them."""

    t: np.ndarray
    """Seconds after the first state."""
    q: np.ndarray
    qd: np.ndarray
    effort: np.ndarray
    nu: np.ndarray
    epsilon: np.ndarray
    coriolis: np.ndarray
    gravity: np.ndarray
    D: np.ndarray
    K: np.ndarray
    residual: np.ndarray
    external_torque: np.ndarray
    norm: np.ndarray
    valid: np.ndarray
    collision: np.ndarray
    estimated: np.ndarray
    received: np.ndarray
    work: np.ndarray
    """Of :data:`WORKS` since the beginning [J], shape (T, 4); steps of unknown power count for nothing."""
    unknown: np.ndarray
    """Number of such steps so far, of each, and in the last column of those over gaps, shape (T, 5)."""

    def part(self, which):
        """Rows of these indices, or of a mask or slice."""
        return Rows(*(column[which] for column in self))

    @classmethod
    def together(cls, pieces):
        """All rows of several."""
        return cls(*map(np.concatenate, zip(*pieces, strict=True)))


class Works:
    """Adds up works from piece to piece."""

    def __init__(self):
        self._last = None  # time and powers of the last state, works and numbers of unknown steps up to it

    def take(self, t, powers):
        """Work since the beginning and unknown steps at states, of powers [W] of shape (T, 4) that may be NaN."""
        if self._last is None:
            self._last = t[0], powers[0], np.zeros(4), np.zeros(5)
        t0, p0, work0, unknown0 = self._last
        steps = np.diff(t, prepend=t0)
        mean = 0.5 * (powers + np.concatenate([p0[None], powers[:-1]]))
        gap = (steps > LARGEST_GAP)[:, None]
        known = np.isfinite(mean) & ~gap
        work = work0 + np.cumsum(np.where(known, mean * steps[:, None], 0.0), axis=0)
        unknown = unknown0 + np.cumsum(np.concatenate([~known, gap], axis=1), axis=0)
        self._last = t[-1], powers[-1], work[-1], unknown[-1]
        return work, unknown


def mean_powers(rows):
    """Mean powers about each state [W]: of :data:`WORKS`, and dK/dt, shape (T, 5); NaN where something is unknown."""
    if len(rows.t) < 2:
        return np.full((len(rows.t), 5), np.nan)
    begin, end = np.maximum(rows.t - HALF, rows.t[0]), np.minimum(rows.t + HALF, rows.t[-1])
    energies = [*rows.work.T, rows.K]
    found = np.empty((len(rows.t), 5))
    before = np.maximum(np.searchsorted(rows.t, begin, side="right") - 1, 0)
    after = np.minimum(np.searchsorted(rows.t, end), len(rows.t) - 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        for k, energy in enumerate(energies):
            change = np.interp(end, rows.t, energy) - np.interp(begin, rows.t, energy)
            missing = rows.unknown[after, k] > rows.unknown[before, k]
            found[:, k] = np.where(missing | (end <= begin), np.nan, change / (end - begin))
    return found


class Overview:
    """Keeps at most so many states: of each run of consecutive ones the first, and those with most and least K and most |r|.

    Runs become twice as long whenever there are too many states.

    Parameters
    ----------
    most : int
    """

    def __init__(self, most):
        self._most, self._stride, self._count, self._number = most, 1, 0, 0
        self._kept = []  # tuples of the numbers of states, their Rows, and whatever goes with them

    def choose(self, rows):
        """Which of the next states are kept for now: indices."""
        return telling((self._count + np.arange(len(rows.t))) // self._stride, rows.K, rows.norm)

    def take(self, rows, chosen, numbers):
        """Take in the next states: those that were chosen, with what goes with these, an array with a row for each."""
        self._kept.append((self._count + chosen, rows.part(chosen), numbers))
        self._count, self._number = self._count + len(rows.t), self._number + len(chosen)
        while self._number > self._most:
            self._stride *= 2
            index, few, numbers = self._together()
            kept = telling(index // self._stride, few.K, few.norm)
            self._kept, self._number = [(index[kept], few.part(kept), numbers[kept])], len(kept)

    def _together(self):
        index, rows, numbers = zip(*self._kept, strict=True)
        return np.concatenate(index), Rows.together(rows), np.concatenate(numbers)

    def all(self):
        """All that is kept: Rows, and what goes with them."""
        return self._together()[1:]


def telling(run, K, norm):
    """Indices of the first state of each run, and of those with the least and the most K and the most |r|, in order."""
    if not len(run):
        return np.zeros(0, dtype=int)
    edges = np.flatnonzero(np.diff(run, prepend=run[0] - 1))
    last = np.append(edges[1:], len(run)) - 1
    by_energy = np.lexsort((K, run))
    by_norm = np.lexsort((np.where(np.isfinite(norm), norm, -1.0), run))
    return np.unique(np.concatenate([edges, by_energy[edges], by_energy[last], by_norm[last]]))


class Contacts:
    """Hands out all states around contacts, as soon as it is known that they are.

    States are held back for :data:`AROUND`: a contact may begin after them.
    """

    def __init__(self):
        self._held = None
        self._open = []  # rows of the run that goes on
        self._edges = np.zeros(0)
        self._was = False

    def take(self, rows):
        """Take in states; yields runs that are over."""
        touching = np.concatenate([[self._was], rows.collision])
        edges = rows.t[np.flatnonzero(touching[1:] != touching[:-1])]
        self._was = bool(rows.collision[-1])
        self._edges = np.concatenate([self._edges, edges])
        everything = rows if self._held is None else Rows.together([self._held, rows])
        known = everything.t[-1] - AROUND
        yield from self._hand_out(everything.part(everything.t < known))
        self._held = everything.part(everything.t >= known)
        self._edges = self._edges[self._edges >= known - 2.0 * AROUND]

    def end(self):
        """Yield what is left."""
        if self._held is not None:
            yield from self._hand_out(self._held)
        if self._open:
            yield Rows.together(self._open)

    def _hand_out(self, rows):
        if not len(rows.t):
            return
        near = np.zeros(len(rows.t), dtype=bool)
        for edge in self._edges:
            near |= np.abs(rows.t - edge) <= AROUND
        changes = np.flatnonzero(near[1:] != near[:-1]) + 1
        for first, last in zip([0, *changes], [*changes, len(near)], strict=True):
            if not near[first]:
                yield from self._close()
                continue
            self._open.append(rows.part(slice(first, last)))
            if self._open[-1].t[-1] - self._open[0].t[0] > LONGEST:
                yield from self._close()

    def _close(self):
        if self._open:
            run, self._open = Rows.together(self._open), []
            yield run
