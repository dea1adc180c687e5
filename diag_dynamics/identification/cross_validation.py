# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cross-validation by joint: blocks of the fitted rows, left out in turn, tell which joints a step pays for."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from diag_dynamics.identification.fit import Rows, fitted

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


class Cut:
    """Cuts portions into blocks of time that follow one another, and the part that is held out.

    Parameters
    ----------
    length : float
        Of all blocks together [s].

    Attributes
    ----------
    held_out : int
        Number of the part that is held out: it comes after all blocks.
    """

    def __init__(self, length):
        self.held_out = int(np.clip(length // SHORTEST, 1, MOST))
        self._length = length / self.held_out
        self._elapsed = self._begin = self._last = 0.0  # time before the segment; its first and latest time

    def take(self, states, begins, held_from):
        """Yield the number of a block, states of a Portion that are in it, and whether a segment begins with these.

        Those from the time `held_from` on [s] are in the part that is held out.
        """
        if begins:
            self._elapsed += self._last - self._begin
            self._begin = states.t[0]
        self._last = states.t[-1]
        at = self._elapsed + states.t - self._begin
        number = np.zeros(len(at), dtype=int)
        if self._length > 0.0:
            number = np.minimum(at // self._length, self.held_out - 1).astype(int)
        number[states.t >= held_from] = self.held_out
        bounds = np.flatnonzero(np.diff(number)) + 1
        for part in np.split(np.arange(len(at)), bounds):
            yield int(number[part[0]]), states.part(slice(part[0], part[-1] + 1)), begins and part[0] == 0


class Blocks:
    """Sums over rows, of all of them and of blocks of time that follow one another.

    Parameters
    ----------
    bounds : list of Sums
        Of all rows before each block, and of all.
    loaded : bool
        Whether the robot carries the payload in them.

    Attributes
    ----------
    sums : Sums
        Of all rows.
    """

    def __init__(self, bounds, loaded):
        self._loaded, self.sums = loaded, bounds[-1]
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
