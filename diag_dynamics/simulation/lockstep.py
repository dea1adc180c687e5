"""Lockstep: which command answers which joint state, and when one has to be published again."""

import math

PATIENCE = 1.0
"""Wall time without a command after which one is waited for, and none is believed to be due [s]."""


class Lockstep:
    """Account of joint states and of the commands that answer them, by a steady clock [s].

    A command does not say which state it answers: it is taken for the answer to the oldest one. A state that all have seen is
    not published again, as an answer to each copy would be a step too many; one is where an answer to it may never come.
    """

    def __init__(self):
        self.begin(-math.inf)

    def begin(self, now):
        """Begin anew: no state is owed a command, and nobody is known to hear and to be heard."""
        self._owed, self._in_doubt, self._heard = 0, False, now
        self._partners, self._joined = set(), -math.inf

    def publish(self):
        """Note that a state goes out."""
        self._owed += 1

    def command(self, now):
        """Note a command."""
        self._owed, self._heard = max(self._owed - 1, 0), now

    def refuse(self):
        """Note a command that was refused: whoever sent it takes the state for answered."""
        self._in_doubt = True

    def answered(self, now):
        """Whether the last state has been answered, so that time goes on."""
        joining = now - self._joined < 2.0 * PATIENCE  # commands of others may still have been under way
        self._in_doubt = joining or self._owed > 0
        return not self._owed

    def meet(self, partners, now):
        """Note who listens to states and who sends commands, as a set: who has come may not have seen the last state."""
        if partners - self._partners:
            self._in_doubt, self._joined = True, now
        self._partners = partners

    def waits(self, now):
        """Whether a command has been waited for for long."""
        return now - self._heard > PATIENCE

    def resume(self, now):
        """Wait anew from now on."""
        self._heard = now

    def repeat(self, now):
        """Whether the last state is to be published again, once: it is then the only one that is not answered."""
        due = self.waits(now) and (self._in_doubt or self._owed > 1)
        if due:
            self._owed, self._heard = 1, now
        return due
