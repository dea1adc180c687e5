# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What sets simulated time going: a clock, with a record of how well it is followed, or the commands in lockstep."""

import math
from typing import NamedTuple

MAX_LAG = 0.1
"""Lag [s of simulated time] beyond which the simulation drops time instead of catching up."""

COMMAND_TIMEOUT = 1.0
"""Wall time [s] without a command after which lockstep may have to publish the last state again."""


class Kept(NamedTuple):
    """Record of the pace since the last report: ticks, their lateness [s], skipped ticks, dropped simulated time [s]."""

    ticks: int
    mean: float
    largest: float
    overruns: int
    let_go: float


class Pace:
    """Ties simulated time to a clock: `factor` seconds for each of the clock's, or a period with each tick where it is 0.

    After an overrun the next tick takes all steps that are due: the robot is where it has to be, but states in between are
    not published. Lag beyond :data:`MAX_LAG` is dropped. `skipped` is the lag of simulated time since the last `resume`, a
    multiple of `step` [s]: what was dropped, less what the clock was set back. `let_go` and `overruns` are totals of those
    in :class:`Kept`.
    """

    def __init__(self, factor, period, step):
        self.factor, self._period, self._step = factor, period, step
        self._span = period / factor if factor else 0.0  # between two ticks [s of the clock]
        self.skipped = self.let_go = 0.0
        self.overruns = 0
        self._start_report()

    def _start_report(self):
        self._ticks, self._late, self._latest, self._reported = 0, 0.0, 0.0, (self.overruns, self.let_go)

    def resume(self, now, simulated):
        """Go on from a simulated time [s] at a time [s] of the clock."""
        self._begun, self._from, self.skipped = now, simulated, 0.0
        self._due = now + self._span

    def steps(self, now, simulated):
        """Return the steps that are due at a time [s] of the clock, when the simulation is at `simulated` [s]."""
        if not self.factor:
            self._ticks += 1
            return max(1, round(self._period / self._step))
        behind = self._from + (now - self._begun) * self.factor - simulated
        max_lag = max(MAX_LAG, 2.0 * self._period) + self._step  # a leap must be longer than two periods
        if behind < -self._period:
            self._due = now
        if behind > max_lag or behind < -self._period:  # too late to catch up, or the clock has jumped back
            steps = math.floor((behind - self._period) / self._step)  # stamps stay whole steps apart
            self._from -= steps * self._step
            self.skipped += steps * self._step
            self.let_go += max(steps, 0) * self._step
            behind -= steps * self._step
        self._record(now - self._due)
        return max(0, int(behind / self._step + 1e-6))

    def _record(self, late):
        """Record how late this tick is; ticks are due a period apart."""
        if late < -0.5 * self._span:
            return  # the extra tick of a late timer
        late = max(late, 0.0)
        missed = int(late / self._span)
        self._ticks, self._late, self._latest = self._ticks + 1, self._late + late, max(self._latest, late)
        self.overruns += missed
        self._due += (missed + 1) * self._span

    def kept(self):
        """Return the :class:`Kept` since the last call."""
        overruns, let_go = self._reported
        mean = self._late / max(self._ticks, 1)
        kept = Kept(self._ticks, mean, self._latest, self.overruns - overruns, self.let_go - let_go)
        self._start_report()
        return kept


class Lockstep:
    """Account of joint states and of the commands that answer them, by a steady clock [s].

    A command does not say which state it answers: it answers the oldest one. A state that all peers have received is not
    published again, because an answer to each copy would be a step too many. A state whose answer may never come is.
    """

    def __init__(self):
        self.begin(-math.inf)

    def begin(self, now):
        """Start: no state waits for a command, and no peer is known."""
        self._unanswered, self._uncertain, self._heard = 0, False, now
        self._peers, self._joined = set(), -math.inf

    def publish(self):
        """Count a published state."""
        self._unanswered += 1

    def command(self, now):
        """Count a command."""
        self._unanswered, self._heard = max(self._unanswered - 1, 0), now

    def refuse(self):
        """Mark the state for another publication, because the sender of a rejected command takes it for answered."""
        self._uncertain = True

    def answered(self, now):
        """Return whether the last state has been answered, so that time goes on."""
        # A command that was sent before the newcomer received the state may still arrive.
        joining = now - self._joined < 2.0 * COMMAND_TIMEOUT
        self._uncertain = joining or self._unanswered > 0
        return not self._unanswered

    def meet(self, peers, now):
        """Store who listens to states or sends commands: a newcomer may not have received the last state."""
        if peers - self._peers:
            self._uncertain, self._joined = True, now
        self._peers = peers

    def waits(self, now):
        """Return whether no command has come for :data:`COMMAND_TIMEOUT`."""
        return now - self._heard > COMMAND_TIMEOUT

    def resume(self, now):
        """Restart the timeout."""
        self._heard = now

    def repeat(self, now):
        """Return whether to publish the last state again, once; it then counts as the only unanswered one."""
        due = self.waits(now) and (self._uncertain or self._unanswered > 1)
        if due:
            self._unanswered, self._heard = 1, now
        return due
