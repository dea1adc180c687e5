# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Desired motions to a set-point or a pose, and along a joint trajectory.

Motions to a set-point or a pose have bounded speed and acceleration. Trajectories are interpolated
like those of ros2_control's joint trajectory controller.
"""

from collections import namedtuple
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from diag_dynamics import rotations
from diag_dynamics.exceptions import InputError

REACHED = 1e-6
"""Distance at which a pose counts as reached [m, rad]."""

WITHIN = 0.5
"""Time in which a joint reaches its speed towards a set-point [s]."""

MIN_ROOM = 1e-2
"""Minimum distance in which a joint brakes [rad, m]."""

MAX_HARDER = 4.0
"""Additional braking for a robot that lags behind, relative to the acceleration."""

MAX_NUMBER = 1e8
"""Maximum number in a point; polynomials of larger ones overflow."""

SAMPLES = 9
"""Samples of the velocity in each segment."""

MAX_COAST = 0.3
"""Maximum distance by which the initial velocity moves a joint off its way [rad, m].

The way leads to the first point.
"""


POWERS = np.arange(6)

RATE = np.diag(POWERS[1:], 1)
"""Matrix of the derivative of a polynomial, given its coefficients."""

DERIVATIVES = np.array([np.linalg.matrix_power(RATE, k) for k in range(3)])


def _hermite(count):
    """Return the coefficients of a polynomial on [0, 1] by its derivatives, shape (6, 3, 2).

    The first `count` derivatives at 0 and at 1 determine it.
    """
    size = 2 * count
    ends = np.array([0.0, 1.0])[:, None] ** POWERS
    rows = (ends @ DERIVATIVES[:count])[..., :size].reshape(size, size)
    coefficients = np.zeros((6, 3, 2))
    coefficients[:size, :count] = np.linalg.inv(rows).reshape(size, count, 2)
    return coefficients


HERMITE = np.array([_hermite(count) for count in (1, 2, 3)])
"""Linear, cubic and quintic polynomials."""

Desired = namedtuple("Desired", "position velocity acceleration")
"""Desired position [rad, m], velocity and acceleration, each of shape (nv,)."""


def at_rest(position):
    """Return the desired motion of a robot at rest."""
    return Desired(position.copy(), np.zeros(len(position)), np.zeros(len(position)))


def nearest(position, to, continuous):
    """Return a position [rad, m], for continuous joints in the turn nearest to another one."""
    whole = 2.0 * np.pi * np.round((to - position) / (2.0 * np.pi))
    return position + np.where(continuous, whole, 0.0)


class SetPoint:
    """Motion of each joint to a position, at bounded speed and acceleration.

    A step of the target would need efforts beyond the limits, and late efforts oscillate. The
    velocity is √(2aδ) at a distance δ, for a braking acceleration a, up to the speed; near the
    target it is kδ. All joints slow down for a robot that lags behind.

    The motion goes on from the desired one at a time [ns], and ends that within the distance `room`
    [rad, m]. `speed` [rad/s, m/s] is reached within :data:`WITHIN`; `rate` is k [1/s]. Continuous
    joints go the shorter way. After a stall a step takes `max_period` [s] at most. All have shape
    (nv,).
    """

    def __init__(
        self, goal, time, desired, speed, rate, continuous, max_period=np.inf, room=np.inf
    ):
        self._position = nearest(desired.position, goal, continuous)
        self._goal = goal
        self._speed = speed
        self._rate = rate
        self.velocity = desired.velocity
        self._time = time
        self._max_period = max_period
        braking = desired.velocity**2 / (2.0 * np.maximum(room, MIN_ROOM))
        self._acceleration = np.maximum(
            np.maximum(speed, np.abs(desired.velocity)) / WITHIN, braking
        )

    def sample(self, time, lag=0.0):
        """Return the desired motion at a time [ns], which does not decrease.

        `lag` is V of the law relative to following_energy: the target slows down from a quarter on,
        and rests from three quarters on.
        """
        elapsed = min(max(time - self._time, 0) * 1e-9, self._max_period)
        self._time = time
        if elapsed == 0.0:
            return Desired(self._position.copy(), self.velocity.copy(), np.zeros_like(self._goal))
        left = self._goal - self._position
        a = self._acceleration
        k = self._rate
        # Both velocities are equal at `near`, and so are their slopes.
        far = np.abs(left)
        near = a / k**2
        braking = np.sqrt(2.0 * a * np.maximum(far - 0.5 * near, 0.0))
        velocity = np.where(far > near, braking, k * far)
        velocity = np.sign(left) * np.minimum(np.minimum(velocity, self._speed), far / elapsed)
        slower = min(max(1.5 - 2.0 * lag, 0.0), 1.0)
        max_change = a * elapsed * (1.0 + MAX_HARDER * (1.0 - slower))
        change = np.clip(slower * velocity - self.velocity, -max_change, max_change)
        self.velocity = self.velocity + change
        self._position = self._position + self.velocity * elapsed
        return Desired(self._position.copy(), self.velocity.copy(), change / elapsed)


class PoseTarget:
    """Straight motion to a pose, as of a :class:`SetPoint`.

    It turns about the axis of the smallest rotation.

    `goal` and `start` are position [m], shape (3,), and axes as columns, shape (3, 3), at the end
    and at a time [ns]. `speed` [m/s, rad/s] and `rate` [1/s] have shape (2,). The motion of the
    target `before` goes on as far as it leads to the goal, because targets may come in a stream.
    """

    def __init__(self, goal, time, start, speed, rate, max_period, before=None):
        self.goal = goal
        self._start = start
        self.arrived = False
        vectors = np.array([goal[0] - start[0], rotations.to_vector(goal[1] @ start[1].T)])
        self._lengths = np.linalg.norm(vectors, axis=1)
        self._directions = vectors / np.maximum(self._lengths, REACHED)[:, None]
        velocity = np.zeros((2, 3)) if before is None else before.velocity
        along = np.sum(self._directions * velocity, axis=1).clip(0.0)
        desired = at_rest(np.zeros(2))._replace(velocity=along)
        self._along = SetPoint(self._lengths, time, desired, speed, rate, False, max_period)

    @property
    def velocity(self):
        """Linear [m/s] and angular [rad/s] velocity, shape (2, 3)."""
        return self._along.velocity[:, None] * self._directions

    def sample(self, time, lag=0.0):
        """Return position and axes at a time [ns]; `lag` as for a SetPoint."""
        distance, angle = done = self._along.sample(time, lag).position
        if (self._lengths - done <= REACHED).all():
            self.arrived = True
            return self.goal
        R = rotations.about_axis(self._directions[1], angle)
        return self._start[0] + distance * self._directions[0], R @ self._start[1]


class Waypoints(NamedTuple):
    """Points of a trajectory, joints in the robot's order; at least one."""

    times: np.ndarray  # from the start [s], increasing, shape (points,)
    positions: np.ndarray  # [rad, m], shape (points, nv)
    velocities: np.ndarray  # [rad/s, m/s], shape (points, nv); zero where a point has none
    accelerations: np.ndarray  # [rad/s², m/s²], shape (points, nv); zero where a point has none
    with_velocity: np.ndarray  # of bool, shape (points,)
    with_acceleration: np.ndarray  # of bool, shape (points,)


class Trajectory:
    """Trajectory of the joints of a robot.

    The positions between two points are a quintic of time if both have accelerations, a cubic if
    both have velocities, else linear. The approach to the first point starts from the robot's
    motion at the start; the robot rests at the last point. A continuous joint goes to the first
    point the shorter way round.

    Times of waypoints increase, numbers are finite and at most :data:`MAX_NUMBER`, and the last
    velocity is zero. `names` are the joints of the robot in its order, and `stamp` is the start
    [ns]; 0: the first state. After `begin`, `start` is the time from which those of waypoints count
    [ns], and `end` that of the last one.
    """

    def __init__(self, waypoints, names, continuous=(), stamp=0):
        self._stamp = stamp
        self._continuous = np.isin(names, continuous)
        self._points = waypoints
        self._times = waypoints.times
        self.positions = waypoints.positions
        late = np.flatnonzero((np.diff(self._times, prepend=-1.0) <= 0.0) | (self._times < 0.0))
        if len(late):
            k = late[0]
            raise InputError(
                f"trajectory.points[{k}].time_from_start is {self._times[k]:.10g} s; expected "
                "times from 0 s on that increase."
            )
        for field in ("positions", "velocities", "accelerations"):
            _require_numbers(field, getattr(waypoints, field), names)
        last = waypoints.velocities[-1]
        if last.any():
            k = np.flatnonzero(last)[0]
            raise InputError(
                f"velocity of joint '{names[k]}' at the last point of the trajectory is "
                f"{last[k]:g}; expected 0: the robot rests there."
            )

    def ends_before(self, time):
        """Return whether a trajectory with a stamp ends before a time [ns]."""
        return bool(self._stamp) and self._stamp + round(self._times[-1] * 1e9) < time

    def begin(self, time, position, velocity):
        """Start at a time [ns], or at the stamp, from the position and velocity at that time.

        A cubic to a first point far ahead would follow that velocity a long way before it turns:
        :data:`MAX_COAST` bounds it.
        """
        self.start = self._stamp or time
        self.end = self.start + round(self._times[-1] * 1e9)
        self._begin = (time - self.start) * 1e-9
        first = self._times[0]
        begin = min(self._begin, first - 1e-9)
        max_speed = MAX_COAST * 27.0 / 4.0 / (first - begin)
        position = nearest(np.array(position, dtype=float), self.positions[0], self._continuous)
        moving = np.clip(velocity, -max_speed, max_speed)
        start = begin, position, moving, np.zeros_like(position), True, False
        times, *states, with_velocity, with_acceleration = (
            np.concatenate([[value], field])
            for value, field in zip(start, self._points, strict=True)
        )
        self._knots = times
        self._durations = np.diff(times)
        powers = self._durations[:, None] ** np.arange(3)
        ends = sliding_window_view(np.stack(states, axis=1), 2, axis=0)  # ..., of each segment
        rank = np.sum([with_velocity, with_velocity & with_acceleration], axis=0)
        kind = np.minimum(rank[:-1], rank[1:])
        self._segments = np.einsum("sjdx,sd,sdkx->sjk", HERMITE[kind], powers, ends)

    def fastest(self):
        """Return the maximum speeds of each segment that is left after the start.

        They are [rad/s, m/s] of shape (segments, nv).
        """
        left = self._times > self._begin
        velocities = np.linspace(0.0, 1.0, SAMPLES)[:, None] ** POWERS @ RATE @ self._segments[left]
        return np.abs(velocities).max(axis=1) / self._durations[left, None]

    def sample(self, time, lag=0.0):
        """Return the desired motion at a time [ns].

        Unlike a SetPoint, it does not wait for a robot that lags behind.
        """
        t = (time - self.start) * 1e-9
        k = int(np.searchsorted(self._times, t, side="right"))
        if k == len(self._times):
            return at_rest(self.positions[-1])
        duration = self._durations[k]
        motion = ((t - self._knots[k]) / duration) ** POWERS @ DERIVATIVES @ self._segments[k]
        return Desired(*(motion / duration ** POWERS[:3, None]))


def _require_numbers(field, table, names):
    """Reject numbers that are not finite, or larger than MAX_NUMBER."""
    wrong = np.argwhere(~(np.abs(table) <= MAX_NUMBER))
    if len(wrong):
        k, joint = wrong[0]
        raise InputError(
            f"trajectory.points[{k}].{field} of joint '{names[joint]}' is {table[k, joint]}; "
            f"expected a finite number of at most {MAX_NUMBER:g}."
        )
