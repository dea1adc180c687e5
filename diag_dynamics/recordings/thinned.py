# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""States of a recording of any length in bounded memory: every one, or every second, or every fourth, and so on."""

import numpy as np

from diag_dynamics.recordings.intake import States


class Thinned:
    """Gathers states, piece by piece, and keeps no more than so many: of more, those whose number a power of two divides.

    Parameters
    ----------
    most : int

    Attributes
    ----------
    every : int
        One of so many states is kept.
    """

    def __init__(self, most):
        self._most, self.every = most, 1
        self._kept, self._count = [], 0  # all that came
        self._jumped = False  # whether positions have jumped since the last state that is kept

    def add(self, states):
        """Take in states."""
        number = self._count + np.arange(states.number)
        self._count += states.number
        self._keep(states, number % self.every == 0)
        while sum(part.number for part in self._kept) > self._most:
            self.every *= 2
            whole, self._kept, jumped = States.together(self._kept), [], self._jumped
            self._jumped = False
            self._keep(whole, np.arange(whole.number) % 2 == 0)
            self._jumped |= jumped

    def _keep(self, states, which):
        """Keep some; a jump at a state that is left out is one at the next that is not."""
        kept = np.flatnonzero(which)
        jumps = np.concatenate([[0], np.cumsum(states.moved)])
        bounds = np.concatenate([[0], kept + 1])
        moved = np.diff(jumps[bounds]) > 0
        if len(kept):
            moved[0] |= self._jumped
            self._kept.append(states.part(kept)._replace(moved=moved))
            self._jumped = False
        self._jumped |= bool(jumps[-1] > jumps[bounds[-1]])

    def states(self):
        """All that are kept; at least one piece must have come."""
        return States.together(self._kept) if self._kept else None
