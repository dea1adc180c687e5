# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Residuals of an observer without contact: every state of some minutes, cells of 20 ms of more."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, Flags, Whole
from diag_dynamics.collision.detector import SECOND, detector_values

MAX_NUMBERS = 2_000_000  # from which cells are kept: of seven joints two minutes at 1 kHz
CELL = 20_000_000  # [ns]


class Rows(NamedTuple):
    """Columns of states, or of cells with the largest value of each column."""

    stamps: Whole  # [ns], of a cell that of its first state
    segment: Whole  # number of the segment without a gap
    x: Array  # [m r, r]
    values: Array  # of the detectors, shape (T, nv + 2)

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

    def __init__(self, width: int, max_gap: float = 0.1) -> None:
        self._max_states, self._max_gap = MAX_NUMBERS // (2 * width + 3), max_gap * SECOND
        none = np.empty(0, dtype=np.int64)
        self._parts = [Rows(none, none, np.empty((0, 2 * width)), np.empty((0, width + 2)))]
        self._count = self._segment = self._reduced = 0  # states, segment, parts of cells
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
        self._parts.append(Rows(stamps, segment, x, detector_values(x)))
        if self._count > self._max_states:
            self._parts[self._reduced :] = [_reduce(self._parts[self._reduced :])]
            self._reduced += 1

    def rows(self) -> Rows:
        """Return the rows of all segments that have two or more."""
        rows = _reduce(self._parts) if self._reduced else _concatenate(self._parts)
        return rows.select(np.bincount(rows.segment)[rows.segment] > 1)


def _concatenate(parts: list[Rows]) -> Rows:
    return Rows(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _reduce(parts: list[Rows]) -> Rows:
    """Return one row of each cell."""
    rows = _concatenate(parts)
    first = np.flatnonzero(rows.starts | (np.diff(rows.stamps // CELL, prepend=0) != 0))
    high, low = np.maximum.reduceat(rows.x, first), np.minimum.reduceat(rows.x, first)
    x, values = np.where(high >= -low, high, low), np.maximum.reduceat(rows.values, first)
    return Rows(rows.stamps[first], rows.segment[first], x, values)
