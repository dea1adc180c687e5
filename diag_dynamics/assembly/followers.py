"""Mimic joints that are coupled to their leaders, as joint_states and requests list them: they may, but need not."""

import math

import numpy as np


class Followers:
    """Where followers are by their leaders, and what their efforts are to these.

    The state is the leaders': a follower's own position is only compared, its velocity not even that. Its effort acts on
    its leader, multiplied by the multiplier, so that q̇ᵀτ is the power of all efforts that are listed.

    What followers say of themselves are vectors in the order of :attr:`names`, NaN where it is unknown.

    Parameters
    ----------
    joints : sequence of str
        The independent joints, in the order of their vectors.
    mimics : mapping
        :class:`Mimic` by name of the follower.
    tolerance : float
        Largest distance of a follower's own position from that which its leader gives it [rad, m]; 0 for any.
    continuous : container of str
        Followers whose position is an angle that turns round: whole turns are no distance.

    Attributes
    ----------
    names : tuple of str
        The followers.
    index : dict
        Place of each of them, by name.
    leaders : ndarray of int
        Place of each one's leader among the joints.
    multipliers, offsets : ndarray
        Of its position by the leader's.
    turns : ndarray of bool
        Whether its position turns round.
    """

    def __init__(self, joints, mimics, tolerance=0.0, continuous=()):
        self.names = tuple(mimics)
        self.index = {name: k for k, name in enumerate(self.names)}
        self.tolerance = tolerance
        self._leader_names, multipliers, offsets = zip(*mimics.values(), strict=True) if mimics else ((), (), ())
        place = {name: k for k, name in enumerate(joints)}
        self.leaders = np.array([place[leader] for leader in self._leader_names], dtype=int)
        self.turns = np.array([name in continuous for name in self.names], dtype=bool)
        self.multipliers, self.offsets = np.array(multipliers), np.array(offsets)

    def unknown(self):
        """Say nothing of any: a new vector of NaN."""
        return np.full(len(self.names), math.nan)

    def positions(self, position):
        """Of the followers by the independent joints' [rad, m]."""
        return self.multipliers * position[self.leaders] + self.offsets

    def velocities(self, velocity):
        """Of the followers by the independent joints' [rad/s, m/s]."""
        return self.multipliers * velocity[self.leaders]

    def reflected(self, effort, own):
        """Efforts of the independent joints and, through the coupling, of the followers: Gᵀτ; those unknown are zero."""
        reflected = effort.copy()
        np.add.at(reflected, self.leaders, self.multipliers * np.where(np.isfinite(own), own, 0.0))
        return reflected

    def disagreements(self, position, own):
        """One text for each follower whose own position is not that which its leader gives it; NaN is not compared."""
        if not self.tolerance:
            return []
        expected = self.positions(position)
        distance = np.abs(np.where(np.isfinite(own), own, math.nan) - expected)
        around = np.abs(np.remainder(distance + np.pi, 2.0 * np.pi) - np.pi)
        distance = np.where(self.turns, around, distance)
        return [
            f"position of joint '{self.names[k]}' is {own[k]:.9g}, expected {expected[k]:.9g} from "
            f"'{self._leader_names[k]}', which it follows, within mimic_tolerance = {self.tolerance:g}"
            for k in np.flatnonzero(distance > self.tolerance)
        ]

    def without_leader(self, names):
        """A follower among these names whose leader is not, and that leader; None if there is none."""
        pairs = zip(self.names, self._leader_names, strict=True)
        return next(((name, leader) for name, leader in pairs if name in names and leader not in names), None)
