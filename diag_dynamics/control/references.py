# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Desired motion to a set-point or a pose, at bounded speed and acceleration."""

from typing import NamedTuple

import numpy as np

from diag_dynamics import rotations

REACHED = 1e-6
"""Distance at which a pose counts as reached [m, rad]."""

WITHIN = 0.5
"""Time in which a joint reaches its speed towards a set-point [s]."""

MIN_ROOM = 1e-2
"""Minimum distance in which a joint brakes [rad, m]."""

MAX_HARDER = 4.0
"""Additional braking for a robot that lags behind, relative to the acceleration."""


class Desired(NamedTuple):
    """Desired position [rad, m], velocity and acceleration, each of shape (nv,)."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


def at_rest(position):
    """Return the desired motion of a robot at rest."""
    return Desired(position.copy(), np.zeros(len(position)), np.zeros(len(position)))


def nearest(position, to, continuous):
    """Return a position [rad, m], counted in the turn nearest to another one for continuous joints."""
    whole = 2.0 * np.pi * np.round((to - position) / (2.0 * np.pi))
    return position + np.where(continuous, whole, 0.0)


class SetPoint:
    """Motion of each joint to a position, at bounded speed and acceleration.

    A step of the target would need efforts beyond the limits, and late efforts oscillate. The velocity is √(2aδ) at a
    distance δ, for a braking acceleration a, up to the speed; near the target it is kδ. All joints slow down for a robot that
    lags behind.

    The motion goes on from the desired one at a time [ns]. `speed` [rad/s, m/s] is reached within :data:`WITHIN`, and `rate`
    is k [1/s]. Continuous joints go the shorter way. After a stall a step takes `max_period` [s] at most. The present motion
    ends within the distance `room` [rad, m]. All have shape (nv,).
    """

    def __init__(self, goal, time, desired, speed, rate, continuous, max_period=np.inf, room=np.inf):
        self._position = nearest(desired.position, goal, continuous)
        self._goal, self._speed, self._rate = goal, speed, rate
        self.velocity, self._time, self._max_period = desired.velocity, time, max_period
        braking = desired.velocity**2 / (2.0 * np.maximum(room, MIN_ROOM))
        self._acceleration = np.maximum(np.maximum(speed, np.abs(desired.velocity)) / WITHIN, braking)

    def sample(self, time, lag=0.0):
        """Return the desired motion at a time [ns], which does not decrease.

        `lag` is V of the law relative to following_energy: the target slows down from a quarter on, and rests from three
        quarters on.
        """
        elapsed, self._time = min(max(time - self._time, 0) * 1e-9, self._max_period), time
        if elapsed == 0.0:
            return Desired(self._position.copy(), self.velocity.copy(), np.zeros_like(self._goal))
        slower = min(max(1.5 - 2.0 * lag, 0.0), 1.0)
        max_change = self._acceleration * elapsed * (1.0 + MAX_HARDER * (1.0 - slower))
        change = np.clip(slower * self._velocity_to_goal(elapsed) - self.velocity, -max_change, max_change)
        self.velocity = self.velocity + change
        self._position = self._position + self.velocity * elapsed
        return Desired(self._position.copy(), self.velocity.copy(), change / elapsed)

    def _velocity_to_goal(self, elapsed):
        left, a, k = self._goal - self._position, self._acceleration, self._rate
        far = np.abs(left)
        near = a / k**2  # where both have the same velocity and slope
        velocity = np.where(far > near, np.sqrt(2.0 * a * np.maximum(far - 0.5 * near, 0.0)), k * far)
        return np.sign(left) * np.minimum(np.minimum(velocity, self._speed), far / elapsed)


class PoseTarget:
    """Motion to a pose as of a :class:`SetPoint`: straight, and about the axis of the smallest rotation.

    `goal` and `start` are position [m], shape (3,), and axes as columns, shape (3, 3), at the end and at a time [ns]. `speed`
    [m/s, rad/s] and `rate` [1/s] have shape (2,). The motion of the target `before` goes on as far as it leads to the goal,
    because targets may come in a stream.
    """

    def __init__(self, goal, time, start, speed, rate, max_period, before=None):
        self.goal, self._start, self.arrived = goal, start, False
        self._vectors = np.array([goal[0] - start[0], rotations.to_vector(goal[1] @ start[1].T)])
        self._lengths = np.array([np.linalg.norm(vector) for vector in self._vectors])
        moving = self._lengths[:, None] > REACHED
        self._directions = np.divide(self._vectors, self._lengths[:, None], out=np.zeros((2, 3)), where=moving)
        motion = np.zeros(2)
        if before is not None:
            motion = np.sum(self._directions * before.velocity, axis=1).clip(0.0)
        desired = at_rest(np.zeros(2))._replace(velocity=motion)
        self._along = SetPoint(self._lengths, time, desired, speed, rate, np.zeros(2, dtype=bool), max_period)

    @property
    def velocity(self):
        """Linear [m/s] and angular [rad/s] velocity, shape (2, 3)."""
        return self._along.velocity[:, None] * self._directions

    def sample(self, time, lag=0.0):
        """Return position and axes at a time [ns]; `lag` as for a SetPoint."""
        done = self._along.sample(time, lag).position
        if (self._lengths - done <= REACHED).all():
            self.arrived = True
            return self.goal
        fraction, turned = np.divide(done, self._lengths, out=np.ones(2), where=self._lengths > 0.0)
        R, angle = np.eye(3), self._lengths[1]
        if angle > REACHED:
            R = rotations.about_axis(self._directions[1], turned * angle)
        return self._start[0] + fraction * self._vectors[0], R @ self._start[1]
