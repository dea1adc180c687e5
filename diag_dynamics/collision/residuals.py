# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Residuals of an observer without contact, and the level that a score exceeds at a rate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, BoolArray, IntArray
from diag_dynamics.collision.detector import SECOND, detector_values
from diag_dynamics.exceptions import InputError
from diag_dynamics.optional import require

FOLDS, MAX_PARTS = 5, 10  # parts of one recording, and most parts of several, each held out once
MAX_SHARE = 0.7  # largest fraction of the time in one recording, where recordings are held out
SPREAD = 0.9  # fraction of the seconds whose maxima are within a detector's spread
MAX_NUMBERS = 2_000_000  # from which cells are kept: of seven joints two minutes at 1 kHz
MAX_GAP = 100_000_000  # longest interval within a segment [ns]
CELL = 20_000_000  # only the largest values within this time are kept [ns]
# Fewest and most peaks from which alarms are counted or a tail is fitted
MIN_PEAKS, MAX_PEAKS = 10, 50
PEAK_PERIOD = 4.0  # time of the data for each peak, between these bounds [s]
MIN_FITTED = 4  # fewest peaks of a tail
QUANTILE = 0.1  # of the number of alarms at the requested rate, which thresholds leave
# Smallest deviation of a joint relative to the largest, and smallest eigenvalue of correlations
MIN_NOISE = 1e-9
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
    recording: IntArray  # number of the recording
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

    @property
    def duration(self) -> float:
        """Time without the gaps between segments [s]."""
        return float(self.time[-1]) if len(self.stamps) else 0.0

    def split(self, values: Array) -> Segments:
        """Return stamps and values of each segment."""
        cuts = np.flatnonzero(self.starts)[1:]
        return list(zip(np.split(self.stamps, cuts), np.split(values, cuts), strict=True))

    def cut(self, parts: IntArray) -> Rows:
        """Return the rows with a new segment where the number of a part changes."""
        return self._replace(segment=np.cumsum(self.starts | (np.diff(parts, prepend=0) != 0)))

    def select(self, rows: Any) -> Rows:
        """Return some of the rows."""
        return Rows(*(column[rows] for column in self))


class Residuals:
    """Collect residuals of an observer batch by batch.

    An interval above MAX_GAP starts another segment.
    """

    def __init__(self, width: int) -> None:
        self._max_states = MAX_NUMBERS // (2 * width + 3)
        self._parts: list[Rows] = []
        self._count = self._segment = 0  # states, and number of the segment
        self.whole = 0  # states with the torque of all joints
        self._reduced = 0  # parts that are cells
        self._recording = 0
        self._last: int | None = None
        self._moment = np.zeros((width, width))
        self.known = np.zeros(width)  # states by joint

    def start_recording(self) -> None:
        """Start another recording."""
        self._recording += 1
        self._last = None

    def add_states(
        self,
        stamps: IntArray,
        residual: Array,
        torque: Array,
        valid: BoolArray,
        external_torque: Array | None = None,
    ) -> None:
        """Add states in order.

        Parameters
        ----------
        stamps : ndarray of int64, shape (T,)
            [ns].
        residual, torque : ndarray, shape (T, nv)
            r and m r as the detector has them, NaN where unknown.
        valid : ndarray of bool, shape (T,)
            Whether there is a result.
        external_torque : ndarray, shape (T, nv), optional
            m r without a dead zone, if it differs.
        """
        stamps = stamps[valid]
        if not len(stamps):
            return
        x = np.nan_to_num(np.concatenate([torque, residual], axis=1)[valid])
        noise = (torque if external_torque is None else external_torque)[valid]
        known = np.isfinite(noise)
        self.known += known.sum(axis=0)
        noise = noise[known.all(axis=1)]
        self._moment += noise.T @ noise
        self.whole += len(noise)
        is_first = self._last is None
        steps = np.diff(stamps, prepend=stamps[0] if self._last is None else self._last)
        segment = self._segment + is_first + np.cumsum((steps < 0) | (steps > MAX_GAP))
        self._last = int(stamps[-1])
        self._segment = int(segment[-1])
        self._count += len(stamps)
        number = np.full(len(stamps), self._recording)
        self._parts.append(Rows(stamps, segment, number, x, detector_values(x)))
        if self._count > self._max_states:
            self._parts[self._reduced :] = [_reduce(self._parts[self._reduced :])]
            self._reduced += 1

    @property
    def covariance(self) -> Array:
        """Second moment of m r about zero over states with all torques, shape (nv, nv)."""
        return self._moment / max(1, self.whole)

    def rows(self) -> Rows:
        """Return the rows of all segments that have two or more; InputError without any."""
        if self._parts:
            rows = _reduce(self._parts) if self._reduced else _concatenate(self._parts)
            rows = rows.select(np.bincount(rows.segment)[rows.segment] > 1)
            if rows.duration:
                return rows
        raise InputError(
            "external torque is missing: the recordings have no efforts, or too long gaps."
        )


def _concatenate(parts: list[Rows]) -> Rows:
    return Rows(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _reduce(parts: list[Rows]) -> Rows:
    """Return a row of the largest values of each cell."""
    rows = _concatenate(parts)
    first = np.flatnonzero(rows.starts | (np.diff(rows.stamps // CELL, prepend=0) != 0))
    high = np.maximum.reduceat(rows.x, first)
    low = np.minimum.reduceat(rows.x, first)
    values = np.maximum.reduceat(rows.values, first)
    return rows.select(first)._replace(x=np.where(high >= -low, high, low), values=values)


def singular_joint(names: Sequence[str], covariance: Array) -> str:
    """Return the joint at which a covariance is not positive definite; empty if it is.

    The joint has no noise of its own.
    """
    if not len(names):
        return ""
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    least = int(np.argmin(deviation))
    if deviation[least] <= MIN_NOISE * deviation.max():
        return names[least]
    values, vectors = np.linalg.eigh(covariance / np.outer(deviation, deviation))
    return names[int(np.argmax(np.abs(vectors[:, 0])))] if values[0] <= MIN_NOISE else ""


def poisson_interval(count: int) -> tuple[float, float]:
    """Return the exact 95 % interval (Garwood, 1936) of an expected number, given a count."""
    return _half_quantile(count, 0.025) if count else 0.0, _half_quantile(count + 1, 0.975)


def _half_quantile(count: float, probability: float) -> float:
    """Return half a quantile of χ² of twice as many degrees of freedom."""
    return float(require("scipy.special", "calibrate").gammaincinv(count, probability))


def allowed_alarms(rate: float, duration: float) -> float:
    """Return the number of alarms that shows a rate of at most the requested one [1/s].

    A detector with the requested rate has more of them in nine of ten recordings. A recording too
    short to show the rate has the expected number, at most one.
    """
    expected = rate * duration
    return max(min(1.0, expected), _half_quantile(expected, QUANTILE))


def peaks_above(segments: Segments, level: float, release: float, hold_off: float) -> Array:
    """Return the highest score of each alarm at a level, by release and hold-off [s]."""
    maxima = [np.empty(0)]
    for stamps, score in segments:
        above = np.flatnonzero(score > level)
        if not len(above):
            continue
        is_high = np.concatenate([[False], score >= release * level, [False]])
        starts, ends = np.flatnonzero(np.diff(is_high.astype(np.int8))).reshape(-1, 2).T
        runs, first = np.unique(np.searchsorted(starts, above, side="right") - 1, return_index=True)
        pause = stamps[above[first[1:]]] - stamps[ends[runs[:-1]] - 1]
        begins = above[first[np.append(True, pause > 1e9 * hold_off)]]
        maxima.append(np.maximum.reduceat(score, begins))
    return np.concatenate(maxima)


def block_maxima(segments: Segments) -> Array:
    """Return the maximum, or that of each column, in blocks of a second."""
    maxima = []
    for stamps, values in segments:
        blocks = (stamps - stamps[0]) // SECOND
        maxima.append(np.maximum.reduceat(values, np.flatnonzero(np.diff(blocks, prepend=-1))))
    return np.concatenate(maxima)


def find_level(
    segments: Segments, duration: float, rate: float, release: float, hold_off: float
) -> Level | None:
    """Return the level that a score exceeds at a rate [1/s] at most; None for too few peaks.

    It is counted in long data, otherwise extrapolated from peaks of alarms or from one-second
    maxima.
    """
    scores = np.concatenate([score for _, score in segments])
    grid = np.unique(np.quantile(scores, 1.0 - np.geomspace(0.5, 1.0 / len(scores), 80)))[::-1]
    expected = allowed_alarms(rate, duration)
    min_count = int(np.clip(duration / PEAK_PERIOD, MIN_PEAKS, MAX_PEAKS))
    before = float(grid[0])
    best = -math.inf
    peaks = np.empty(0)
    for level in grid.tolist():
        highest = peaks_above(segments, level, release, hold_off)
        if len(highest) > len(peaks):
            best = level
            peaks = highest
        if len(highest) > max(expected, min_count - 1):
            break
        before = level
    if expected >= min_count:
        return Level(before, "counted", min(len(highest), int(expected)))
    if len(peaks) >= MIN_PEAKS:
        return _extrapolate(best, peaks, expected, "tail")
    maxima = block_maxima(segments)
    median = float(np.median(maxima))
    return _extrapolate(median, maxima[maxima > median], expected, "blocks")


def fit_limits(
    rows: Rows, rate: float, release: float, hold_off: float
) -> tuple[Array, Level | None]:
    """Return thresholds that values exceed at a rate [1/s] at most, and their level.

    The level is the factor of the thresholds upon each spread.
    """
    spread = np.quantile(block_maxima(rows.split(rows.values)), SPREAD, axis=0, method="lower")
    # A joint without residuals gets no threshold.
    spread[spread <= MIN_NOISE * spread.max()] = math.inf
    level = find_level(
        rows.split((rows.values / spread).max(axis=1)), rows.duration, rate, release, hold_off
    )
    return spread * (level.value if level else math.inf), level


def part_numbers(rows: Rows) -> tuple[IntArray, str]:
    """Return the number of the part of each row, and the kind of parts in words.

    They are recordings, or fifths of the time.
    """
    number = np.unique(rows.recording, return_inverse=True)[1]
    count = int(number[-1]) + 1
    time = rows.time / rows.time[-1]
    if count == 1 or (np.bincount(number, np.diff(time, prepend=0.0)) > MAX_SHARE).any():
        return np.minimum((FOLDS * time).astype(np.int64), FOLDS - 1), f"{FOLDS} parts of the time"
    if count > MAX_PARTS:
        ends = np.array([time[number == k].mean() for k in range(count)])
        number = np.unique((MAX_PARTS * ends).astype(np.int64), return_inverse=True)[1][number]
    return number, f"{count} recordings"


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
