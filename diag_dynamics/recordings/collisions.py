# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Collisions of a recording: runs of states at which the observer told of one."""

from typing import NamedTuple

import numpy as np

MOST = 0.5
"""Part of the largest component of r from which a joint is named."""


class Collision(NamedTuple):
    """Time for which an observer's residual was above its thresholds."""

    start: int
    """First stamp, and the last one [ns]."""
    end: int
    joints: tuple
    """Those with most of r where it was largest."""
    norm: float
    """Largest |r| [J^½/s]."""


class Collisions:
    """Gathers collisions, piece by piece.

    Parameters
    ----------
    names : sequence of str
        Degrees of freedom.

    Attributes
    ----------
    found : list of Collision
    goes_on : bool
        Whether one was on at the last state.
    judged : tuple of str
        Detectors of alarms, of which there are none here.
    """

    def __init__(self, names, goes_on=False):
        self._names, self.goes_on, self.found = names, goes_on, []
        self.judged = ()
        self._joins = False  # whether the first of them began before all that was taken in

    def take(self, stamps, residual, norm, collision):
        """Take in states: stamps [ns], r, |r|, and whether the observer told of a collision."""
        edges = np.diff(collision.astype(np.int8), prepend=np.int8(0), append=np.int8(0))
        if not len(collision):
            return
        goes_on, self.goes_on = self.goes_on, bool(collision[-1])
        for first, end in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
            k = first + int(np.argmax(norm[first:end]))
            r = np.abs(residual[k])
            joints = tuple(self._names[j] for j in np.flatnonzero(r >= MOST * r.max()))
            one = Collision(int(stamps[first]), int(stamps[end - 1]), joints, float(norm[k]))
            if first == 0 and goes_on:
                if self.found:
                    one = _joined(self.found.pop(), one)
                else:
                    self._joins = True
            self.found.append(one)

    def add(self, other):
        """Take in what another one has, which has gone on from here."""
        found = list(other.found)
        if other._joins and self.found:
            found[0] = _joined(self.found.pop(), found[0])
        else:
            self._joins = self._joins or (other._joins and not self.found)
        self.found += found
        self.goes_on = other.goes_on


def _joined(before, after):
    """One collision of two pieces."""
    largest = before if before.norm >= after.norm else after
    return Collision(before.start, after.end, largest.joints, largest.norm)
