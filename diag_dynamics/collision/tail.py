# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How often something happens: Poisson's limits, and the level that peaks rise above at a wanted rate."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, Whole

MOST_PEAKS, FEWEST_PEAKS = 50, 10
APART = 4.0
"""Time for each peak that the tail is fitted to [s]."""
LEAST = 4
"""Peaks without which no tail can be fitted."""
CENSORED = 10
"""One of so many peaks counts, but its height does not: the highest."""

COUNTED, TAIL, BLOCKS = "counted", "tail", "blocks"
BLOCK = 1.0
"""Length of a block [s]."""


class Level(NamedTuple):
    """Level that is risen above at a wanted rate."""

    level: float
    method: str
    """``counted``: that often within the data; ``tail``: further out, by the tail of the peaks of alarms; ``blocks``: by
    that of the peaks of blocks of a second."""
    peaks: int
    """How many peaks it is based on."""


class Stretch(NamedTuple):
    """Score without a gap that matters, at stamps [ns]."""

    stamps: Whole
    score: Array


def poisson_interval(count: int, confidence: float = 0.95) -> tuple[float, float]:
    """Exact interval (Garwood, 1936) of the expected number of what was counted."""
    rest = 0.5 * (1.0 - confidence)
    low = 0.0 if count == 0 else _solved(lambda mean: 1.0 - _at_most(count - 1, mean) - rest, count)
    return low, _solved(lambda mean: rest - _at_most(count, mean), count)


def upper_limit(count: int, confidence: float = 0.95) -> float:
    """Expected number that is not exceeded with this confidence."""
    return _solved(lambda mean: 1.0 - confidence - _at_most(count, mean), count)


def _at_most(count: int, mean: float) -> float:
    """Probability of no more than a count."""
    if mean <= 0.0:
        return 1.0
    return math.fsum(math.exp(k * math.log(mean) - mean - math.lgamma(k + 1)) for k in range(count + 1))


def _solved(rising: Callable[[float], float], count: int) -> float:
    """Where a rising function of the mean is zero."""
    low, high = 0.0, 10.0 + 3.0 * count
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if rising(middle) > 0.0 else (middle, high)
    return 0.5 * (low + high)


def peaks_above(stretches: list[Stretch], level: float, release: float, hold_off: float) -> Array:
    """Highest score of each alarm that a level makes, with the same release and hold-off [s] as the detector has."""
    found = []
    for stamps, score in stretches:
        above = np.flatnonzero(score > level)
        if not len(above):
            continue
        edges = np.diff((score >= release * level).astype(np.int8), prepend=np.int8(0), append=np.int8(0))
        starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
        runs, first = np.unique(np.searchsorted(starts, above, side="right") - 1, return_index=True)
        pause = stamps[above[first[1:]]] - stamps[ends[runs[:-1]] - 1]
        begins = above[first[np.concatenate([[True], pause > 1e9 * hold_off])]]
        found.append(np.maximum.reduceat(score, begins))
    return np.concatenate(found) if found else np.empty(0)


def block_peaks(stamps: Whole, values: Array) -> Array:
    """Highest value, or highest of each column, of every block of a second; stamps in ns."""
    blocks = (stamps - stamps[0]) // int(1e9 * BLOCK)
    return np.maximum.reduceat(values, np.flatnonzero(np.diff(blocks, prepend=-1)))


def level_of(stretches: list[Stretch], duration: float, rate: float, release: float, hold_off: float) -> Level | None:
    """Level above which the score rises at a rate [1/s]; None where there are too few peaks to say.

    Where the data hold that many alarms, they are counted. Further out the tail of the peaks is taken for exponential: of m
    peaks above u, with the sum S of their heights above it, c = u + S[(m / (rate duration))^(1/d) − 1]. That is the
    predictive level: what d peaks leave unknown of the tail raises it. The highest peaks, one of ten, are taken for at least
    as high as the next one: one jerk is one alarm, however hard it was. d is how many are left.

    Residuals so slow that alarms run into one another have few peaks: those of blocks of a second take their place, from
    their median on. There are more of them than alarms, which makes the level higher.
    """
    everything = np.concatenate([score for _, score in stretches])
    grid = np.unique(np.quantile(everything, 1.0 - np.geomspace(0.5, 1.0 / len(everything), 80)))[::-1]
    expected = rate * duration
    wanted = int(np.clip(duration / APART, FEWEST_PEAKS, MOST_PEAKS))
    best: tuple[float, Array] = math.inf, np.empty(0)
    lowest = None
    for level in grid.tolist():
        peaks = peaks_above(stretches, level, release, hold_off)
        if expected >= wanted:
            if len(peaks) > expected:
                return Level(lowest or level, COUNTED, int(expected))
            lowest = level
            continue
        if len(peaks) > len(best[1]):
            best = level, peaks
        if len(peaks) >= wanted:
            break
    if expected >= wanted:
        return Level(grid[-1], COUNTED, len(peaks))
    level, peaks = best
    method = TAIL
    if len(peaks) < FEWEST_PEAKS:
        highest = np.concatenate([block_peaks(stamps, score) for stamps, score in stretches])
        level, method = float(np.median(highest)), BLOCKS
        peaks = highest[highest > level]
    m = len(peaks)
    if m < LEAST:
        return None
    heights = np.sort(peaks - level)
    censored = max(1, m // CENSORED)
    d = m - censored
    total = float(heights[:d].sum() + censored * heights[d - 1])
    return Level(level + max(0.0, total * ((m / expected) ** (1.0 / d) - 1.0)), method, m)
