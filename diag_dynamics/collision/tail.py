# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rates of events: Poisson intervals, and the level that a score exceeds at a given rate."""

from __future__ import annotations

import math

import numpy as np

from diag_dynamics.arrays import Array, Whole
from diag_dynamics.optional import require

MIN_PEAKS, MAX_PEAKS = 10, 50  # to count alarms, or to fit the tail to
PEAK_PERIOD = 4.0  # time for each peak of the tail [s]
MIN_FITTED = 4
CENSORED = 10  # one of so many peaks counts while its height is ignored: the highest
BLOCK = 1_000_000_000  # [ns]

Segments = list[tuple[Whole, Array]]  # stamps [ns] and values of rows without a gap
Level = tuple[float, str, int]  # level of a score, the method that found it, and its number of peaks


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
        blocks = (stamps - stamps[0]) // BLOCK
        found.append(np.maximum.reduceat(values, np.flatnonzero(np.diff(blocks, prepend=-1))))
    return np.concatenate(found)


def find_level(segments: Segments, duration: float, rate: float, release: float, hold_off: float) -> Level | None:
    """Return the level that a score exceeds at a rate [1/s]; None of too few peaks.

    Long data hold enough alarms to be counted. Else the level is extrapolated from the peaks of
    alarms, or from the maxima of single seconds where alarms run into one another.
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
        return before, "counted", min(len(found), int(expected))
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
    return level + max(0.0, total * ((m / expected) ** (1.0 / d) - 1.0)), method, m
