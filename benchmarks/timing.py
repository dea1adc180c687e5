# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Times of calls that take turns, and ratios of them: what the machine does besides hits all of them alike."""

import time
import timeit
from typing import NamedTuple

import numpy as np
import psutil


class Ratio(NamedTuple):
    """Median over all rounds, and quartiles."""

    median: float
    low: float
    high: float


def interleaved(calls, rounds, seconds=2e-3, pause=0.0):
    """Seconds per call, an array of one entry a round for each name in `calls`.

    In every round each call is repeated for about `seconds`, one call after the other, each after a `pause` [s] and a
    call that does not count.
    """
    timers = {name: timeit.Timer(call) for name, call in calls.items()}
    numbers = {name: _calibrated(timer, seconds) for name, timer in timers.items()}
    times = {name: np.empty(rounds) for name in calls}
    for k in range(rounds):
        for name, timer in timers.items():
            if pause:
                time.sleep(pause)
                timer.timeit(1)  # wakes threads up
            times[name][k] = timer.timeit(numbers[name]) / numbers[name]
    return times


def ratio(ours, theirs):
    """Ratio of two arrays of times, round by round."""
    return Ratio(*np.percentile(np.asarray(ours) / np.asarray(theirs), (50, 25, 75)))


class OtherWork:
    """What other processes do from now on."""

    def __init__(self):
        self._start = self._now()

    def processors(self):
        """How many processors they have kept busy."""
        (work, now), (work_before, before) = self._now(), self._start
        return max(0.0, (work - work_before) / (now - before))

    def _now(self):
        everybody, we = psutil.cpu_times(), time.process_time()
        idle = everybody.idle + getattr(everybody, "iowait", 0.0)
        return sum(everybody) - idle - we, time.perf_counter()


def _calibrated(timer, seconds):
    """How often to call in `seconds`; the first call, which may compile, does not count."""
    timer.timeit(1)
    number = 1
    while (taken := timer.timeit(number)) < 0.25 * seconds:
        number *= 2
    return max(1, round(number * seconds / taken))
