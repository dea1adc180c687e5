# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cross-validation by joint: blocks of the fitted rows, left out in turn, tell which joints a step pays for."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from diag_dynamics.identification.fit import Rows, fitted
from diag_dynamics.identification.segments import duration

MOST, FEWEST = 8, 3
"""Blocks that are left out in turn; of fewer nothing is concluded."""

SHORTEST = 1.0
"""Shortest block [s]: six time constants of the filter, so that blocks know little of one another."""


class Worth(NamedTuple):
    """What is left of rows that were not fitted, by degree of freedom, root mean square [N m, N]; shape (nv,) each."""

    without: np.ndarray
    """With the numbers that the model has."""
    fitted: np.ndarray
    """With numbers of the joint's own."""

    def pays(self, gain=0.0):
        """Degrees of freedom of which numbers of their own leave less, by more than that part of it, bool."""
        return self.fitted < (1.0 - gain) * self.without


class Blocks:
    """Sums over rows, of all of them and of blocks of time that follow one another.

    Parameters
    ----------
    equations : Equations
        Takes the rows in; nothing has been taken in before.
    segments : list of Segment
        In the order of time.
    loaded : bool
        Whether the robot carries the payload in them.

    Attributes
    ----------
    sums : Sums
        Of all rows.
    """

    def __init__(self, equations, segments, loaded):
        self._loaded = loaded
        count = int(np.clip(duration(segments) // SHORTEST, 1, MOST))
        taken = [equations.sums()]
        block = 0
        for number, part, anew in _cut(segments, count):
            if number != block:
                taken.append(equations.sums())
                block = number
            equations.take(part, anew)
        self.sums = equations.sums()
        bounds = [*taken, self.sums]
        self._blocks = [after - before for before, after in pairwise(bounds)]

    @property
    def rows(self):
        """All of them."""
        return Rows(self.sums, self._loaded)

    def worth(self, layout, beside, free, without, weight):
        """Judge a step by what it leaves of each block when it is fitted to the others.

        Parameters
        ----------
        layout : Layout
        beside : list of Rows
            Further rows, that every fit is made to.
        free, without : Free
            The fit with the step, and the one without.
        weight : float
            γ of the prior on inertias.

        Returns
        -------
        Worth or None
            None if the rows are too short to be cut into blocks.
        """
        if len(self._blocks) < FEWEST:
            return None
        squares = np.zeros((2, layout.model.nv))
        for block in self._blocks:
            rest, out = [Rows(self.sums - block, self._loaded), *beside], [Rows(block, self._loaded)]
            for total, one in zip(squares, (without, free), strict=True):
                total += layout.mean_squares(out, fitted(layout, rest, one, weight).x) * block.weight
        return Worth(*np.sqrt(squares / np.maximum(self.sums.weight, 1e-300)))


def _cut(segments, count):
    """Yield the number of a block, consecutive states of it, and whether the filter begins anew with these."""
    length, elapsed = duration(segments) / count, 0.0
    for segment in segments:
        at = elapsed + segment.t - segment.t[0]
        number = np.minimum(at // length, count - 1).astype(int) if length > 0.0 else np.zeros(len(at), int)
        bounds = np.flatnonzero(np.diff(number)) + 1
        for states in np.split(np.arange(len(at)), bounds):
            yield int(number[states[0]]), segment.part(slice(states[0], states[-1] + 1)), states[0] == 0
        elapsed += segment.t[-1] - segment.t[0]
