# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lockstep: account of which command answers which joint state, and of when to publish a state again."""

import math

PATIENCE = 1.0
"""Wall time [s] without a command after which the last state may have to be published again."""


class Lockstep:
    """Account of joint states and of the commands that answer them, by a steady clock [s].

    A command does not say which state it answers: it is taken for the answer to the oldest one. A state that all
    have seen is not published again: an answer to each copy would be a step too many. A state whose answer may never come is.
    """

    def __init__(self):
        self.begin(-math.inf)

    def begin(self, now):
        """Begin anew: no state waits for a command, and no partner is known."""
        self._owed, self._in_doubt, self._heard = 0, False, now
        self._partners, self._joined = set(), -math.inf

    def publish(self):
        """Note that a state goes out."""
        self._owed += 1

    def command(self, now):
        """Note a command."""
        self._owed, self._heard = max(self._owed - 1, 0), now

    def refuse(self):
        """Note a refused command: its sender believes the state answered, so it has to be published again."""
        self._in_doubt = True

    def answered(self, now):
        """Whether the last state has been answered, so that time goes on."""
        joining = now - self._joined < 2.0 * PATIENCE  # a command sent before the newcomer saw the state may arrive yet
        self._in_doubt = joining or self._owed > 0
        return not self._owed

    def meet(self, partners, now):
        """Note the set of those who listen to states or send commands: a newcomer may not have seen the last state."""
        if partners - self._partners:
            self._in_doubt, self._joined = True, now
        self._partners = partners

    def waits(self, now):
        """Whether no command has come for :data:`PATIENCE`."""
        return now - self._heard > PATIENCE

    def resume(self, now):
        """Wait anew from now on."""
        self._heard = now

    def repeat(self, now):
        """Whether to publish the last state again, once; it then counts as the only unanswered one."""
        due = self.waits(now) and (self._in_doubt or self._owed > 1)
        if due:
            self._owed, self._heard = 1, now
        return due
