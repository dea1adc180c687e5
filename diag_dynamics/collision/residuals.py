# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Residuals of an observer without contact, and the level that a score of them exceeds at a given rate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, BoolArray, IntArray
from diag_dynamics.collision.detector import SECOND, detector_values
from diag_dynamics.optional import require

MAX_NUMBERS = 2_000_000  # from which cells are kept: of seven joints two minutes at 1 kHz
CELL = 20_000_000  # only the largest values within this time are kept [ns]
MIN_PEAKS, MAX_PEAKS = 10, 50  # fewest and most peaks from which alarms are counted or a tail is fitted
PEAK_PERIOD = 4.0  # time of the data for each peak, between these bounds [s]
MIN_FITTED = 4  # fewest peaks of a tail
MIN_NOISE = 1e-9  # smallest deviation of a joint relative to the largest, and smallest eigenvalue of correlations
CENSORED = 10  # one of so many peaks counts while its height is ignored: the highest

Segments = list[tuple[IntArray, Array]]  # stamps [ns] and values of rows without a gap


class Level(NamedTuple):
    """Level of a score, the method that found it, and the number of its peaks; see Calibration."""

    value: float
    method: str
    peaks: int


class Rows(NamedTuple):
    """Columns of states, or of cells with the largest value of each column."""

    stamps: IntArray  # [ns], of a cell that of its first state
    segment: IntArray  # number of the segment without a gap
    x: Array  # [m r, r]
    values: Array  # of the detectors, shape (T, nv + 2)

    @property
    def starts(self) -> BoolArray:
        """Whether a segment starts at each row."""
        return np.diff(self.segment, prepend=-1) != 0

    @property
    def time(self) -> Array:
        """Time from the first row to each one without the gaps between segments [s]."""
        return np.cumsum(np.where(self.starts, 0, np.diff(self.stamps, prepend=0))) / SECOND

    def split(self, values: Array) -> Segments:
        """Return stamps and values of each segment."""
        cuts = np.flatnonzero(self.starts)[1:]
        return list(zip(np.split(self.stamps, cuts), np.split(values, cuts), strict=True))

    def select(self, rows: Any) -> Rows:
        """Return some of the rows."""
        return Rows(*(column[rows] for column in self))


class Residuals:
    """Collect residuals of an observer batch by batch; an interval above `max_gap` [s] starts another segment."""

    def __init__(self, width: int, max_gap: float = 0.1) -> None:
        self._max_states, self._max_gap = MAX_NUMBERS // (2 * width + 3), max_gap * SECOND
        none = np.empty(0, dtype=np.int64)
        self._parts = [Rows(none, none, np.empty((0, 2 * width)), np.empty((0, width + 2)))]
        self._count = self._segment = self._reduced = 0  # states, number of the segment, parts that are cells
        self._last: int | None = None
        self._moment = np.zeros((width, width))

    def add_states(self, stamps: IntArray, residual: Array, torque: Array, valid: BoolArray) -> None:
        """Add states in order: stamps [ns], r, m r, and whether there is a result."""
        torque = torque[valid]
        stamps, x = stamps[valid], np.concatenate([torque, residual[valid]], axis=1)
        if not len(stamps):
            return
        steps = np.diff(stamps, prepend=stamps[0] if self._last is None else self._last)
        segment = self._segment + np.cumsum((steps < 0) | (steps > self._max_gap))
        self._last, self._segment = int(stamps[-1]), int(segment[-1])
        self._count += len(stamps)
        self._moment += torque.T @ torque
        self._parts.append(Rows(stamps, segment, x, detector_values(x)))
        if self._count > self._max_states:
            self._parts[self._reduced :] = [_reduce(self._parts[self._reduced :])]
            self._reduced += 1

    @property
    def covariance(self) -> Array:
        """Second moment of m r about zero over all states with a result, shape (nv, nv)."""
        return self._moment / max(1, self._count)

    def rows(self) -> Rows:
        """Return the rows of all segments that have two or more."""
        rows = _reduce(self._parts) if self._reduced else _concatenate(self._parts)
        return rows.select(np.bincount(rows.segment)[rows.segment] > 1)


def _concatenate(parts: list[Rows]) -> Rows:
    return Rows(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _reduce(parts: list[Rows]) -> Rows:
    """Return a row of the largest values of each cell."""
    rows = _concatenate(parts)
    first = np.flatnonzero(rows.starts | (np.diff(rows.stamps // CELL, prepend=0) != 0))
    high, low = np.maximum.reduceat(rows.x, first), np.minimum.reduceat(rows.x, first)
    x, values = np.where(high >= -low, high, low), np.maximum.reduceat(rows.values, first)
    return Rows(rows.stamps[first], rows.segment[first], x, values)


def singular_joint(names: Sequence[str], covariance: Array) -> str:
    """Return the joint without noise of its own, at which a covariance is not positive definite; empty if it is."""
    if not len(names):
        return ""
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    least = int(np.argmin(deviation))
    if deviation[least] <= MIN_NOISE * deviation.max():
        return names[least]
    values, vectors = np.linalg.eigh(covariance / np.outer(deviation, deviation))
    return names[int(np.argmax(np.abs(vectors[:, 0])))] if values[0] <= MIN_NOISE else ""


def poisson_interval(count: int) -> tuple[float, float]:
    """Return the exact 95 % interval (Garwood, 1936) of the expected number of events after a count."""
    gammaincinv = require("scipy.special", "calibrate").gammaincinv  # half a quantile of χ²
    return float(gammaincinv(count, 0.025)) if count else 0.0, float(gammaincinv(count + 1, 0.975))


def peaks_above(segments: Segments, level: float, release: float, hold_off: float) -> Array:
    """Return the highest score of each alarm at a level, by release and hold-off [s]."""
    found = [np.empty(0)]
    for stamps, score in segments:
        above = np.flatnonzero(score > level)
        if not len(above):
            continue
        held = np.concatenate([[False], score >= release * level, [False]])
        starts, ends = np.flatnonzero(np.diff(held.astype(np.int8))).reshape(-1, 2).T
        runs, first = np.unique(np.searchsorted(starts, above, side="right") - 1, return_index=True)
        pause = stamps[above[first[1:]]] - stamps[ends[runs[:-1]] - 1]
        begins = above[first[np.append(True, pause > 1e9 * hold_off)]]
        found.append(np.maximum.reduceat(score, begins))
    return np.concatenate(found)


def block_maxima(segments: Segments) -> Array:
    """Return the maximum, or that of each column, in blocks of a second."""
    found = []
    for stamps, values in segments:
        blocks = (stamps - stamps[0]) // SECOND
        found.append(np.maximum.reduceat(values, np.flatnonzero(np.diff(blocks, prepend=-1))))
    return np.concatenate(found)


def find_level(segments: Segments, duration: float, rate: float, release: float, hold_off: float) -> Level | None:
    """Return the level that a score exceeds at a rate [1/s]; None for too few peaks.

    It is counted in long data, otherwise extrapolated from peaks of alarms or from one-second maxima.
    """
    scores = np.concatenate([score for _, score in segments])
    grid = np.unique(np.quantile(scores, 1.0 - np.geomspace(0.5, 1.0 / len(scores), 80)))[::-1]
    expected = rate * duration
    wanted = int(np.clip(duration / PEAK_PERIOD, MIN_PEAKS, MAX_PEAKS))
    before, best, peaks = float(grid[0]), -math.inf, np.empty(0)
    for level in grid.tolist():
        found = peaks_above(segments, level, release, hold_off)
        if len(found) > len(peaks):
            best, peaks = level, found
        if len(found) > max(expected, wanted - 1):
            break
        before = level
    if expected >= wanted:
        return Level(before, "counted", min(len(found), int(expected)))
    if len(peaks) >= MIN_PEAKS:
        return _extrapolate(best, peaks, expected, "tail")
    maxima = block_maxima(segments)
    median = float(np.median(maxima))
    return _extrapolate(median, maxima[maxima > median], expected, "blocks")


def _extrapolate(level: float, peaks: Array, expected: float, method: str) -> Level | None:
    """Return the predictive level of an exponential tail: u + S[(m / expected)^(1/d) − 1]."""
    m = len(peaks)
    if m < MIN_FITTED or expected == 0.0:
        return None
    heights = np.sort(peaks - level)
    censored = max(1, m // CENSORED)
    d = m - censored
    total = float(heights[:d].sum() + censored * heights[d - 1])
    return Level(level + max(0.0, total * ((m / expected) ** (1.0 / d) - 1.0)), method, m)
