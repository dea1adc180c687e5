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
    """

    def __init__(self, names):
        self._names, self._goes_on = names, False
        self.found = []

    def take(self, stamps, residual, norm, collision):
        """Take in states: stamps [ns], r, |r|, and whether the observer told of a collision."""
        edges = np.diff(collision.astype(np.int8), prepend=np.int8(0), append=np.int8(0))
        goes_on, self._goes_on = self._goes_on, bool(len(collision) and collision[-1])
        for first, end in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
            k = first + int(np.argmax(norm[first:end]))
            r = np.abs(residual[k])
            joints = tuple(self._names[j] for j in np.flatnonzero(r >= MOST * r.max()))
            one = Collision(int(stamps[first]), int(stamps[end - 1]), joints, float(norm[k]))
            if first == 0 and goes_on:
                one = _joined(self.found.pop(), one)
            self.found.append(one)


def _joined(before, after):
    """One collision of two pieces."""
    largest = before if before.norm >= after.norm else after
    return Collision(before.start, after.end, largest.joints, largest.norm)
