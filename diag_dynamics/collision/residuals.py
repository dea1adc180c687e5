# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Residuals of an observer without contact: every state of some minutes, cells of 20 ms of more."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, Flags, Whole
from diag_dynamics.collision.detector import SECOND, detector_values

MAX_NUMBERS = 2_000_000  # kept as states: 16 MB, of seven joints two minutes at 1 kHz
CELL = 20_000_000  # [ns]


class Rows(NamedTuple):
    """Columns of states, or of cells with the largest value of each column."""

    stamps: Whole  # [ns], of a cell that of its first state
    segment: Whole  # number of the segment without a gap
    x: Array  # [m r, r]
    norms: Array  # ‖m r‖, |r|

    @property
    def values(self) -> Array:
        """Values of the detectors, shape (T, nv + 2)."""
        return np.concatenate([np.abs(self.x[:, : self.x.shape[1] // 2]), self.norms], axis=1)

    @property
    def starts(self) -> Flags:
        """Whether a segment starts at each row."""
        return np.diff(self.segment, prepend=-1) != 0

    @property
    def time(self) -> Array:
        """Time within segments from the first row to each [s]."""
        return np.cumsum(np.where(self.starts, 0, np.diff(self.stamps, prepend=0))) / SECOND

    def split(self, values: Array) -> list[tuple[Whole, Array]]:
        """Return stamps and values of each segment."""
        cuts = np.flatnonzero(self.starts)[1:]
        return list(zip(np.split(self.stamps, cuts), np.split(values, cuts), strict=True))

    def select(self, rows: Any) -> Rows:
        """Return some of the rows."""
        return Rows(*(column[rows] for column in self))


class Residuals:
    """Collects residuals of an observer in parts of any size; a gap [s] starts another segment."""

    def __init__(self, width: int, max_gap: float = 0.1, max_numbers: int = MAX_NUMBERS) -> None:
        self._max_states, self._max_gap = max_numbers // (2 * width + 3), max_gap * SECOND
        none = np.empty(0, dtype=np.int64)
        self._states: list[Rows] = [Rows(none, none, np.empty((0, 2 * width)), np.empty((0, 2)))]
        self._cells: list[Rows] = []
        self._count = self._segment = 0
        self._last: int | None = None

    def add_states(self, stamps: Whole, residual: Array, torque: Array, valid: Flags) -> None:
        """Add states in order: stamps [ns], r, m r, and whether there is a result."""
        stamps, x = stamps[valid], np.concatenate([torque, residual], axis=1)[valid]
        if not len(stamps):
            return
        steps = np.diff(stamps, prepend=stamps[0] if self._last is None else self._last)
        segment = self._segment + np.cumsum((steps < 0) | (steps > self._max_gap))
        self._last, self._segment = int(stamps[-1]), int(segment[-1])
        self._count += len(stamps)
        self._states.append(Rows(stamps, segment, x, detector_values(x)[:, -2:]))
        if self._count > self._max_states:
            self._cells.append(_reduced(self._states))
            self._states = []

    def rows(self) -> Rows:
        """Return the rows of all segments that have two or more."""
        parts = [*self._cells, *self._states]
        rows = _reduced(parts) if self._cells else _concatenated(parts)
        return rows.select(np.bincount(rows.segment)[rows.segment] > 1)


def _concatenated(parts: list[Rows]) -> Rows:
    return Rows(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _reduced(parts: list[Rows]) -> Rows:
    """Return one row of each cell."""
    rows = _concatenated(parts)
    first = np.flatnonzero(rows.starts | (np.diff(rows.stamps // CELL, prepend=0) != 0))
    high, low = np.maximum.reduceat(rows.x, first), np.minimum.reduceat(rows.x, first)
    x, norms = np.where(high >= -low, high, low), np.maximum.reduceat(rows.norms, first)
    return Rows(rows.stamps[first], rows.segment[first], x, norms)
