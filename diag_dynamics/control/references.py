# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the robot should be at a time, on its way to a set-point or a pose."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.control.pose import rotation_of, rotation_vector

THERE = 1e-6
"""What is no way to a pose any more [m, rad]."""

WITHIN = 0.5
"""How long a joint takes to come to the speed at which set-points are gone to [s]."""

CLOSE = 1e-2
"""Room that joints have to brake at least [rad, m]."""

HARDER = 4.0
"""How much more than that it brakes for a robot that lags behind."""


class Desired(NamedTuple):
    """Where the robot should be: position [rad, m], velocity and acceleration, each of shape (nv,)."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


def at_rest(position):
    """The same, at rest."""
    return Desired(position.copy(), np.zeros(len(position)), np.zeros(len(position)))


def nearest(position, to, turns):
    """A position [rad, m] as it is counted in the turn that is nearest to another one, where joints turn round."""
    whole = 2.0 * np.pi * np.round((to - position) / (2.0 * np.pi))
    return position + np.where(turns, whole, 0.0)


class SetPoint:
    """Goes to a position at bounded speed and acceleration, each joint by itself, and decays there at its own rate.

    The efforts of a step towards a target far away would be more than limits let pass in time, and what follows them late
    swings. The velocity is √(2aδ) at a distance δ, so that braking takes no more than a, up to the speed; near the target it
    is kδ. A new set-point is gone to from where the last one has led. All joints slow down for a robot that lags behind.

    Parameters
    ----------
    goal : ndarray, shape (nv,)
        Position [rad, m].
    time : int
        Now [ns].
    desired : Desired
        Where the robot should be at that time.
    speed, rate : ndarray, shape (nv,)
        The speed [rad/s, m/s], reached within :data:`WITHIN`, and k [1/s].
    turns : ndarray of bool, shape (nv,)
        Joints that turn round: they go the shorter way.
    longest : float
        Longest time in which it goes on at once [s]: after a stall it is no further.
    room : ndarray, shape (nv,)
        How far it may go on as it moves now before it is to stand still [rad, m].
    """

    def __init__(self, goal, time, desired, speed, rate, turns, longest=np.inf, room=np.inf):
        self._position = nearest(desired.position, goal, turns)
        self._goal, self._speed, self._rate = goal, speed, rate
        self._velocity, self._time, self._longest = desired.velocity, time, longest
        # What is faster than it should be is braked, and what has little room left is braked within that.
        brakes = desired.velocity**2 / (2.0 * np.maximum(room, CLOSE))
        self._most = np.maximum(np.maximum(speed, np.abs(desired.velocity)) / WITHIN, brakes)

    @property
    def velocity(self):
        """How the robot should move as it was asked last [rad/s, m/s]."""
        return self._velocity

    def sample(self, time, lag=0.0):
        """Where the robot should be at a time [ns], which does not go back.

        Parameters
        ----------
        time : int
        lag : float
            How far the robot is behind, as V of the law in parts of what is tolerated: from a quarter on the target
            waits for it, from three on it stands still.
        """
        elapsed, self._time = min(max(time - self._time, 0) * 1e-9, self._longest), time
        if elapsed == 0.0:
            return Desired(self._position.copy(), self._velocity.copy(), np.zeros_like(self._goal))
        left, a, k = self._goal - self._position, self._most, self._rate
        far = np.abs(left)
        near = a / k**2  # where both have the same velocity and slope
        wanted = np.where(far > near, np.sqrt(2.0 * a * np.maximum(far - 0.5 * near, 0.0)), k * far)
        wanted = np.sign(left) * np.minimum(np.minimum(wanted, self._speed), far / elapsed)
        part = min(max(1.5 - 2.0 * lag, 0.0), 1.0)
        most = a * elapsed * (1.0 + HARDER * (1.0 - part))
        change = np.clip(part * wanted - self._velocity, -most, most)
        self._velocity = self._velocity + change
        self._position = self._position + self._velocity * elapsed
        return Desired(self._position.copy(), self._velocity.copy(), change / elapsed)


class PoseTarget:
    """Goes to a pose as :class:`SetPoint` does: straight, and about the axis of the smallest rotation.

    Parameters
    ----------
    goal : tuple of ndarray
        Position [m], shape (3,), and axes as columns, shape (3, 3).
    time : int
        Now [ns].
    start : tuple of ndarray
        Where it is aimed now, likewise.
    speed, rate, longest
        As those of a SetPoint, in m/s and rad/s; shape (2,).
    before : PoseTarget or None
        What it replaces, whose motion goes on as far as it leads there: targets may come in a stream.
    """

    def __init__(self, goal, time, start, speed, rate, longest, before=None):
        self.goal, self._start, self.arrived = goal, start, False
        self._way, self._turn = goal[0] - start[0], rotation_vector(goal[1] @ start[1].T)
        self._lengths = np.array([np.linalg.norm(self._way), np.linalg.norm(self._turn)])
        motion = np.zeros(2)
        if before is not None:
            motion = np.sum(self._directions * before.velocity, axis=1).clip(0.0)
        away, straight = at_rest(np.zeros(2))._replace(velocity=motion), np.zeros(2, dtype=bool)
        self._along = SetPoint(self._lengths, time, away, speed, rate, straight, longest)

    @property
    def _directions(self):
        """Unit vectors of way and turn; zero where there is none."""
        vectors = np.array([self._way, self._turn])
        return np.divide(vectors, self._lengths[:, None], out=np.zeros((2, 3)), where=self._lengths[:, None] > THERE)

    @property
    def velocity(self):
        """Linear [m/s] and angular [rad/s] velocity of where it aims, shape (2, 3)."""
        return self._along.velocity[:, None] * self._directions

    def sample(self, time, lag=0.0):
        """Position and axes at which to aim at a time [ns]; `lag` as for a SetPoint."""
        gone = self._along.sample(time, lag).position
        if (self._lengths - gone <= THERE).all():
            self.arrived = True
            return self.goal
        way, turn = np.divide(gone, self._lengths, out=np.ones(2), where=self._lengths > 0.0)
        half = 0.5 * turn * self._lengths[1]
        axis = self._turn / max(self._lengths[1], THERE)
        about = rotation_of(np.append(np.sin(half) * axis, np.cos(half))) if self._lengths[1] > THERE else np.eye(3)
        return self._start[0] + way * self._way, about @ self._start[1]
