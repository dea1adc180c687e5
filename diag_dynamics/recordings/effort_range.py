# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Efforts that no sensor can have measured: 0, constant or missing throughout a recording."""

import numpy as np

TINY = 1e-12
"""Effort below which it is 0 [N m, N]: no sensor tells so little."""

CONSTANT = 1e-9
"""Range of an effort, in parts of its largest value, up to which it is constant."""

MOVES = 0.01
"""Travel from which a joint has moved, so that its effort cannot be constant [rad, m]."""


class EffortRange:
    """Finds smallest and largest efforts and positions of each joint, piece by piece.

    Parameters
    ----------
    names : sequence of str
        Degrees of freedom.

    Attributes
    ----------
    states : int
        How many there were.
    low, high : ndarray, shape (2, n)
        Bounds of efforts [N m, N] and of positions [rad, m].
    """

    def __init__(self, names):
        self._names, count = tuple(names), len(names)
        self.states = 0
        self.low, self.high = np.full((2, count), np.inf), np.full((2, count), -np.inf)

    def take(self, positions, efforts):
        """Take in positions and efforts, (T, n) each; NaN for efforts that are missing."""
        self.states += len(efforts)
        for row, values in enumerate((efforts, positions)):
            self.low[row] = np.fmin(self.low[row], np.fmin.reduce(values, axis=0, initial=np.inf))
            self.high[row] = np.fmax(self.high[row], np.fmax.reduce(values, axis=0, initial=-np.inf))

    def add(self, other):
        """Take in what another one has."""
        self.states += other.states
        self.low, self.high = np.minimum(self.low, other.low), np.maximum(self.high, other.high)

    @property
    def moved(self):
        """Whether any joint has moved."""
        return bool(np.any(self.high[1] - self.low[1] > MOVES))

    @property
    def measures(self):
        """Whether the effort of any joint can have been measured."""
        return self.states < 2 or not np.all(np.any(self._unmeasured(), axis=0))

    def complaint(self):
        """Return which efforts cannot have been measured, in words; empty where all can."""
        if self.states < 2 or not np.isfinite(self.low[0]).any():
            return ""
        missing, zero, constant = self._unmeasured()
        told = [self._said(missing, "missing"), self._said(zero, "0")]
        told += [self._said(constant & (self.low[0] == one), f"{one:.6g}") for one in np.unique(self.low[0][constant])]
        return "; ".join(filter(None, told))

    def _unmeasured(self):
        """Return which efforts are missing, 0 and constant throughout, bool, shape (n,) each."""
        low, high = self.low[0], self.high[0]
        largest = np.maximum(np.abs(low), np.abs(high))
        moves = self.high[1] - self.low[1] > MOVES
        with np.errstate(invalid="ignore"):
            zero = largest < TINY
            return ~np.isfinite(low), zero, moves & ~zero & (high - low <= CONSTANT * largest)

    def _said(self, which, value):
        """Return that some efforts have a value throughout, in words."""
        names = ", ".join(name for name, one in zip(self._names, which, strict=True) if one)
        return f"efforts of {names} are {value} throughout (effort_available)" if names else ""
