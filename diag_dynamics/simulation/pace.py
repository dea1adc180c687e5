# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pace of simulated time by a clock, and a record of how well it is kept."""

import math
from typing import NamedTuple

MOST_BEHIND = 0.1
"""Lag [s of simulated time] beyond which the simulation lets time go rather than catch up."""


class Kept(NamedTuple):
    """Record of the pace since the last report.

    Attributes
    ----------
    ticks : int
    mean, largest : float
        How late ticks were [s].
    overruns : int
        Ticks that were late by a period or more, so that another was due already.
    let_go : float
        Time that was not caught up with, in all [s of simulated time].
    """

    ticks: int
    mean: float
    largest: float
    overruns: int
    let_go: float


class Pace:
    """Ties simulated time to a clock.

    After an overrun the next tick takes the steps that are due together, so that the robot is where it has to be, but what
    it would have published in between is not. What is more than :data:`MOST_BEHIND` late is let go: simulated time then
    stays behind for good, by :attr:`skipped`. So no tick computes more than that.

    Parameters
    ----------
    factor : float
        Seconds of simulated time for each of the clock; 0: as fast as can be, a period with each tick.
    period : float
        Simulated time between two ticks [s].
    step : float
        Integration step, of which simulated time is a multiple [s].

    Attributes
    ----------
    skipped : float
        How far simulated time has come to be behind the clock since it went on last, a multiple of `step` [s]: what was let
        go, less what the clock was set back.
    let_go, overruns : float, int
        Totals of those in :class:`Kept`.
    """

    def __init__(self, factor, period, step):
        self.factor, self._period, self._step = factor, period, step
        self._span = period / factor if factor else 0.0  # between two ticks [s of the clock]
        self.skipped = self.let_go = 0.0
        self.overruns = 0
        self._begun = None
        self._start()

    def _start(self):
        self._ticks, self._late, self._latest, self._overran = 0, 0.0, 0.0, 0

    def resume(self, now, simulated):
        """Go on from a simulated time [s] at a time [s] of the clock."""
        self._begun, self._from, self.skipped = now, simulated, 0.0
        self._due = now + self._span

    def steps(self, now, simulated):
        """Steps that are due at a time [s] of the clock, when the simulation is at `simulated` [s]."""
        if not self.factor:
            self._ticks += 1
            return max(1, round(self._period / self._step))
        behind = self._from + (now - self._begun) * self.factor - simulated
        most = max(MOST_BEHIND, 2.0 * self._period) + self._step  # a leap must be longer than two periods
        if behind < -self._period:
            self._due = now
        if behind > most or behind < -self._period:  # too late to catch up, or the clock has jumped back
            steps = math.floor((behind - self._period) / self._step)  # stamps stay whole steps apart
            self._from -= steps * self._step
            self.skipped += steps * self._step
            self.let_go += max(steps, 0) * self._step
            behind -= steps * self._step
        self._judge(now)
        return max(0, int(behind / self._step + 1e-6))

    def _judge(self, now):
        """Note how late this tick is; ticks are due a period apart."""
        span, late = self._span, now - self._due
        if late < -0.5 * span:
            return  # a timer ticks once more after it was late; that tick is not due
        self._ticks += 1
        self._late += max(late, 0.0)
        self._latest = max(self._latest, late)
        missed = int(max(late, 0.0) / span)
        self._overran += missed
        self.overruns += missed
        self._due += (missed + 1) * span

    def kept(self):
        """Return the :class:`Kept` since the last call."""
        found = Kept(self._ticks, self._late / max(self._ticks, 1), self._latest, self._overran, self.let_go)
        self._start()
        return found
