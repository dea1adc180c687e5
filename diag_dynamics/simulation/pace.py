# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pace of simulated time: by a clock, or in lockstep with commands."""

import math
from typing import NamedTuple

MAX_LAG = 0.1
"""Lag [s of simulated time] beyond which the simulation drops time."""

COMMAND_TIMEOUT = 1.0
"""Wall time [s] without a command after which lockstep may publish the last state again."""


class PaceReport(NamedTuple):
    """Pace since the last report."""

    ticks: int
    mean: float  # lateness of ticks [s]
    largest: float
    overruns: int  # skipped ticks
    dropped: float  # simulated time [s]


class Pace:
    """Simulated time by a clock: `factor` seconds for each of the clock's.

    With a factor of 0 it is a period for each tick. After an overrun the next tick takes all steps
    that are due, without publishing the states between them. Lag beyond :data:`MAX_LAG` is dropped.
    `skipped` is the lag of simulated time since the last `resume`, a multiple of `step` [s]: the
    dropped time less that by which the clock went back. `dropped` and `overruns` are those of
    PaceReport until now.
    """

    def __init__(self, factor, period, step):
        self.factor = factor
        self._period = period
        self._step = step
        self._span = period / factor if factor else 0.0  # between two ticks [s of the clock]
        self.skipped = 0.0
        self._start_report()

    def _start_report(self):
        self._ticks = self.overruns = 0
        self._late = self._latest = self.dropped = 0.0

    def resume(self, now, simulated):
        """Continue from a simulated time [s] at a time [s] of the clock."""
        self._begun = now
        self._from = simulated
        self.skipped = 0.0
        self._due = now + self._span

    def steps(self, now, simulated):
        """Return the steps due at a time [s] of the clock and a `simulated` time [s]."""
        if not self.factor:
            self._ticks += 1
            return max(1, round(self._period / self._step))
        behind = self._from + (now - self._begun) * self.factor - simulated
        max_lag = max(MAX_LAG, 2.0 * self._period) + self._step
        if behind < -self._period:
            self._due = now
        if behind > max_lag or behind < -self._period:
            # Too late to catch up, or the clock went back; stamps stay whole steps apart.
            steps = math.floor((behind - self._period) / self._step)
            self._from -= steps * self._step
            self.skipped += steps * self._step
            self.dropped += max(steps, 0) * self._step
            behind -= steps * self._step
        self._record(now - self._due)
        return max(0, int(behind / self._step + 1e-6))

    def _record(self, late):
        """Record how late this tick is; ticks are due a period apart."""
        if late < -0.5 * self._span:
            return  # the extra tick of a late timer
        late = max(late, 0.0)
        missed = int(late / self._span)
        self._ticks += 1
        self._late += late
        self._latest = max(self._latest, late)
        self.overruns += missed
        self._due += (missed + 1) * self._span

    def report(self):
        """Return the :class:`PaceReport` since the last call."""
        mean = self._late / max(self._ticks, 1)
        report = PaceReport(self._ticks, mean, self._latest, self.overruns, self.dropped)
        self._start_report()
        return report


class Lockstep:
    """Joint states and the commands that answer them, by a steady clock [s].

    A command does not name the state that it answers: it answers the oldest one. A state that all
    peers have received is not published again, because an answer to each copy would advance time
    twice. It is published again if a peer may have missed it.
    """

    def __init__(self):
        self.begin(-math.inf)

    def begin(self, now):
        """Start: no state waits for a command, and no peer is known."""
        self._unanswered = 0
        self._uncertain = False
        self._heard = now
        self._peers = set()
        self._joined = -math.inf

    def publish(self):
        """Count a published state."""
        self._unanswered += 1

    def command(self, now):
        """Count a command."""
        self._unanswered = max(self._unanswered - 1, 0)
        self._heard = now

    def refuse(self):
        """Mark the state for another publication, because its answer was rejected."""
        self._uncertain = True

    def answered(self, now):
        """Return whether the last state has been answered, so that time advances."""
        # A command that was sent before the newcomer received the state may still arrive.
        joining = now - self._joined < 2.0 * COMMAND_TIMEOUT
        self._uncertain = joining or self._unanswered > 0
        return not self._unanswered

    def meet(self, peers, now):
        """Store receivers of states and senders of commands; a new one may lack the last state."""
        if peers - self._peers:
            self._uncertain = True
            self._joined = now
        self._peers = peers

    def waits(self, now):
        """Return whether no command has come for :data:`COMMAND_TIMEOUT`."""
        return now - self._heard > COMMAND_TIMEOUT

    def resume(self, now):
        """Restart the timeout."""
        self._heard = now

    def repeat(self, now):
        """Return whether to publish the last state again, then the only unanswered one."""
        due = self.waits(now) and (self._uncertain or self._unanswered > 1)
        if due:
            self._unanswered = 1
            self._heard = now
        return due
