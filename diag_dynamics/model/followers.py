# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Followers: mimic joints that are coupled to their leaders. Messages may list them, but need not."""

import math

import numpy as np

from diag_dynamics.rotations import wrap_angle


class Followers:
    """Positions of mimic joints by their leaders, and efforts of mimic joints on their leaders.

    A mimic joint's effort acts on its leader, times the multiplier, so that q̇ᵀτ is the power of all efforts listed. Vectors
    of mimic joints are in the order of `names`, NaN for unknown values.

    Parameters
    ----------
    joints : sequence of str
        The independent joints, in the order of their vectors.
    mimics : mapping
        :class:`Mimic` by name.
    tolerance : float
        Largest distance of a mimic joint's own position from that which its leader gives it [rad, m]; 0 for any.
    continuous : container of str
        Mimic joints whose position is an angle that wraps.
    """

    def __init__(self, joints, mimics, tolerance=0.0, continuous=()):
        self.names = tuple(mimics)
        self.tolerance = tolerance
        self._leader_names, multipliers, offsets = zip(*mimics.values(), strict=True) if mimics else ((), (), ())
        place = {name: k for k, name in enumerate(joints)}
        self.leaders = np.array([place[leader] for leader in self._leader_names], dtype=int)
        self.turns = np.array([name in continuous for name in self.names], dtype=bool)
        self.multipliers, self.offsets = np.array(multipliers), np.array(offsets)

    def positions(self, position):
        """Positions of the followers by those of the independent joints [rad, m]."""
        return self.multipliers * position[self.leaders] + self.offsets

    def velocities(self, velocity):
        """Velocities of the followers by those of the independent joints [rad/s, m/s]."""
        return self.multipliers * velocity[self.leaders]

    def reflected(self, effort, own):
        """Efforts of the independent joints and, through the coupling, of the followers: Gᵀτ; those unknown are zero."""
        reflected = effort.copy()
        np.add.at(reflected, self.leaders, self.multipliers * np.where(np.isfinite(own), own, 0.0))
        return reflected

    def disagreements(self, position, own):
        """Texts, one for each follower further than `tolerance` from where its leader puts it; NaN is not compared."""
        if not self.tolerance:
            return []
        expected = self.positions(position)
        distance = np.abs(np.where(np.isfinite(own), own, math.nan) - expected)
        distance = np.where(self.turns, np.abs(wrap_angle(distance)), distance)
        return [self.disagreement(k, own[k], expected[k]) for k in np.flatnonzero(distance > self.tolerance)]

    def disagreement(self, k, own, expected):
        """Text on follower k, whose position is not the expected one."""
        return (
            f"position of joint '{self.names[k]}' is {own:.9g}, expected {expected:.9g} from '{self._leader_names[k]}', "
            f"which it follows, within mimic_tolerance = {self.tolerance:g}"
        )
