# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What an observer has seen over any time, in bounded memory: what thresholds of alarms are found from."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, Flags, Whole
from diag_dynamics.collision.detector import SECOND, detected

MOST = 2_000_000
"""Numbers that are kept: 16 MB. Of seven joints 117,000 states, two minutes at 1 kHz; after that, cells of states."""

FINEST, COARSEST = 20, 34
"""Shortest and longest cell, as powers of two [ns]: 1 ms and 17 s."""

LOT = 512
"""States that come one by one and are taken in together."""


class Piece(NamedTuple):
    """What was seen without a gap. A row is a state, or a cell of states."""

    stamps: Whole
    """Of the first state of each row [ns]."""
    torque: Array
    """m r [N m, N], shape (T, nv); of a cell, the largest of each joint with its sign."""
    residual: Array
    """r [J^½/s], likewise."""
    values: Array
    """What detectors look at, shape (T, nv + 2); of a cell, the largest of each."""
    duration: float
    """[s]"""

    def part(self, which: Flags) -> Piece:
        """Some of its rows."""
        stamps = self.stamps[which]
        duration = (int(stamps[-1]) - int(stamps[0])) / SECOND
        return Piece(stamps, self.torque[which], self.residual[which], self.values[which], duration)


class Residuals:
    """Gathers residuals of an observer, in whatever portions they come.

    Up to `MOST` numbers every state is kept. Beyond that, states of a cell of time become one row, with the largest value of
    each detector among them; cells double as often as it takes. The heights of peaks stay exact; when they were is known to a
    cell, 17 to 34 ms after an hour of seven joints at 1 kHz, where an alarm's hold-off is half a second. What is kept depends
    on the states alone, not on their portions.

    Parameters
    ----------
    width : int
        Degrees of freedom.
    max_gap : float
        Time without a result after which another piece begins [s].
    most : int
        Numbers that are kept.

    Attributes
    ----------
    states : int
        With a result.
    gaps : int
        How often another piece began.
    """

    def __init__(self, width: int, max_gap: float = 0.1, most: int = MOST) -> None:
        self._width, self._max_gap, self._most = width, max_gap * SECOND, most
        self._rows = _Rows.none(width)
        self._recent: list[_Rows] = []
        self._lot = _Lot(width)
        self._bounds: list[list[int]] = []  # first and last stamp of each piece
        self._shift: int | None = None
        self._states = 0

    @property
    def states(self) -> int:
        """See above."""
        self._flush()
        return self._states

    @property
    def gaps(self) -> int:
        """See above."""
        self._flush()
        return max(0, len(self._bounds) - 1)

    @property
    def duration(self) -> float:
        """Time in all pieces [s]."""
        self._flush()
        return sum(last - first for first, last in self._bounds) / SECOND

    def add(self, stamp: int, residual: Array, external_torque: Array) -> None:
        """Take in one state with a result."""
        if self._lot.add(stamp, residual, external_torque):
            self._flush()

    def take(self, stamps: Whole, residual: Array, external_torque: Array, valid: Flags) -> None:
        """Take in states, in order: stamps [ns], r, m r, and whether there is a result."""
        self._flush()
        self._take(stamps[valid], residual[valid], external_torque[valid])

    def pieces(self) -> list[Piece]:
        """All that was seen, but for states without another one beside them."""
        self._flush()
        rows, n = self._gathered(), self._width
        cuts = np.flatnonzero(np.diff(rows.piece)) + 1
        found = []
        for part in np.split(np.arange(len(rows.stamps)), cuts):
            if not len(part):
                continue
            first, last = self._bounds[int(rows.piece[part[0]])]
            if last > first:
                x = rows.x[part]
                values = np.concatenate([np.abs(x[:, :n]), rows.norms[part]], axis=1)
                found.append(Piece(rows.stamps[part], x[:, :n], x[:, n:], values, (last - first) / SECOND))
        return found

    def _flush(self) -> None:
        stamps, residual, torque = self._lot.taken()
        if len(stamps):
            self._take(stamps, residual, torque)

    def _take(self, stamps: Whole, residual: Array, torque: Array) -> None:
        if not len(stamps):
            return
        self._states += len(stamps)
        step = np.diff(stamps, prepend=self._bounds[-1][1] if self._bounds else stamps[0])
        cut = (step < 0) | (step > self._max_gap)
        cut[0] |= not self._bounds
        starts = np.flatnonzero(cut)
        piece = len(self._bounds) - 1 + np.cumsum(cut)
        reach = int(starts[0]) if len(starts) else len(stamps)
        if reach:
            self._bounds[-1][1] = int(stamps[reach - 1])
        ends = np.append(starts, len(stamps))[1:] - 1
        self._bounds += [[int(stamps[first]), int(stamps[last])] for first, last in zip(starts, ends, strict=True)]
        norms = detected(torque, residual)[:, self._width :]
        self._recent.append(
            _Rows(stamps, piece, np.concatenate([torque, residual], axis=1), norms).thinned(self._shift)
        )
        if self._size() > self._most:
            self._gathered()
            while self._size() > self._most and self._shift != COARSEST:
                self._shift = FINEST if self._shift is None else self._shift + 1
                self._rows = self._rows.thinned(self._shift)

    def _size(self) -> int:
        return sum(len(rows.stamps) for rows in (self._rows, *self._recent)) * (2 * self._width + 3)

    def _gathered(self) -> _Rows:
        """All rows; a cell may have come in portions."""
        if self._recent:
            columns = zip(self._rows, *self._recent, strict=True)
            self._rows = _Rows(*(np.concatenate(column) for column in columns)).thinned(self._shift)
            self._recent = []
        return self._rows


class _Rows(NamedTuple):
    """Columns: stamps, pieces that the rows belong to, m r beside r, ‖m r‖ beside |r|."""

    stamps: Whole
    piece: Whole
    x: Array
    norms: Array

    @classmethod
    def none(cls, width: int) -> _Rows:
        return cls(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 2 * width)), np.empty((0, 2)))

    def thinned(self, shift: int | None) -> _Rows:
        """Rows of one cell and piece together."""
        if shift is None or not len(self.stamps):
            return self
        new = (np.diff(self.stamps >> shift) != 0) | (np.diff(self.piece) != 0)
        first = np.flatnonzero(np.append(True, new))
        if len(first) == len(self.stamps):
            return self
        high, low = np.maximum.reduceat(self.x, first), np.minimum.reduceat(self.x, first)
        x = np.where(high >= -low, high, low)
        return _Rows(self.stamps[first], self.piece[first], x, np.maximum.reduceat(self.norms, first))


class _Lot:
    """States that came one by one."""

    def __init__(self, width: int) -> None:
        self._stamps = np.empty(LOT, np.int64)
        self._residual, self._torque = np.empty((2, LOT, width))
        self._count = 0

    def add(self, stamp: int, residual: Array, torque: Array) -> bool:
        """Take in one; returns whether it is full."""
        k = self._count
        self._stamps[k], self._residual[k], self._torque[k] = stamp, residual, torque
        self._count += 1
        return self._count == LOT

    def taken(self) -> tuple[Whole, Array, Array]:
        """Hand out all, and begin anew."""
        k, self._count = self._count, 0
        return self._stamps[:k].copy(), self._residual[:k].copy(), self._torque[:k].copy()
