# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joint trajectories, interpolated like those of ros2_control's joint trajectory controller."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.control.references import Desired, at_rest, nearest
from diag_dynamics.exceptions import InputError

MAX_NUMBER = 1e8
"""Maximum number in a point; polynomials of larger ones overflow."""

SAMPLES = 9
"""Samples of the velocity in each segment."""

MAX_COAST = 0.3
"""Maximum distance by which the robot's motion carries it off its way to the first point [rad, m]."""


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

    The positions between two points are a quintic of time if both have accelerations, a cubic if both have velocities, else
    linear. The approach to the first point starts from the robot's motion at the start; the robot rests at the last point. A
    continuous joint goes to the first point the shorter way round.

    Times of waypoints increase, numbers are finite and at most :data:`MAX_NUMBER`, and the last velocity is zero. `names` are
    the joints of the robot in its order, and `stamp` is the start [ns]; 0: the first state.
    """

    def __init__(self, waypoints, names, continuous=(), stamp=0):
        self._stamp, self._continuous = stamp, np.array([name in continuous for name in names])
        self._points, self._times, self.positions = waypoints, waypoints.times, waypoints.positions
        _require_order(self._times)
        for field in ("positions", "velocities", "accelerations"):
            _require_numbers(field, getattr(waypoints, field), names)
        _require_rest(waypoints.velocities[-1], names)
        self._segments = self._between_points()

    def _between_points(self):
        """Return the coefficients of the polynomials from point to point, shape (points − 1, 6, nv)."""
        q, v, a = self.positions, self._points.velocities, self._points.accelerations
        has_v, has_a = (has[:-1] & has[1:] for has in (self._points.with_velocity, self._points.with_acceleration))
        return _polynomials(np.diff(self._times), q[:-1], v[:-1], a[:-1], q[1:], v[1:], a[1:], has_v, has_v & has_a)

    def ends_before(self, time):
        """Return whether a trajectory with a stamp ends before a time [ns]."""
        return bool(self._stamp) and self._stamp + round(self._times[-1] * 1e9) < time

    def begin(self, time, position, velocity):
        """Start at a time [ns], or at the stamp, from the position and velocity at that time.

        A cubic to a first point far ahead would follow that velocity a long way before it turns: :data:`MAX_COAST` bounds it.
        """
        self._start = self._stamp or time
        first, v = self.positions[:1], self._points.velocities[:1]
        start = nearest(np.array(position, dtype=float), first[0], self._continuous)
        self._begin = (time - self._start) * 1e-9
        T = np.maximum(self._times[:1] - self._begin, 1e-9)
        max_speed = MAX_COAST * 27.0 / 4.0 / T
        moving, zero = np.clip(velocity, -max_speed, max_speed)[None], np.zeros_like(first)
        has_v, has_a = self._points.with_velocity[:1], np.zeros(1, dtype=bool)
        self._approach = _polynomials(T, start[None], moving, zero, first, v, zero, has_v, has_a)

    def fastest(self):
        """Return the maximum speeds [rad/s, m/s], shape (segments, nv), of each segment that is left after the start."""
        T, table = np.diff(self._times), self._segments
        if self._begin < self._times[0]:
            T, table = np.append(self._times[0] - self._begin, T), np.concatenate([self._approach, table])
        else:
            T, table = T[self._times[1:] > self._begin], table[self._times[1:] > self._begin]
        s = (T[:, None] * np.linspace(0.0, 1.0, SAMPLES))[..., None]
        return np.abs(_velocity(np.moveaxis(table, 1, 0)[:, :, None], s)).max(axis=1)

    def over(self, time):
        """Return whether the last point has been reached at a time [ns]."""
        return (time - self._start) * 1e-9 >= self._times[-1]

    def sample(self, time, lag=0.0):
        """Return the desired motion at a time [ns], whatever the lag of the robot."""
        t = (time - self._start) * 1e-9
        k = int(np.searchsorted(self._times, t, side="right"))
        if k == len(self._times):
            return at_rest(self.positions[-1])
        c, s = (self._segments[k - 1], t - self._times[k - 1]) if k else (self._approach[0], t - self._begin)
        position = c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))))
        acceleration = 2.0 * c[2] + s * (6.0 * c[3] + s * (12.0 * c[4] + s * 20.0 * c[5]))
        return Desired(position, _velocity(c, s), acceleration)


def _velocity(c, s):
    """Return the derivative of polynomials with six coefficients at a time [s]."""
    return c[1] + s * (2.0 * c[2] + s * (3.0 * c[3] + s * (4.0 * c[4] + s * 5.0 * c[5])))


def _require_order(times):
    """Reject times [s] that do not increase, or begin before the start."""
    if times[0] < 0.0:
        raise InputError(f"trajectory.points[0].time_from_start is {times[0]:g} s, expected no less than 0.")
    backward = np.flatnonzero(np.diff(times) <= 0.0)
    if backward.size:
        k = int(backward[0])
        raise InputError(
            f"trajectory.points[{k + 1}].time_from_start is {times[k + 1]:g} s, expected more than the {times[k]:g} s of the "
            "point before."
        )


def _require_numbers(field, table, names):
    """Reject numbers that are not finite, or larger than MAX_NUMBER."""
    wrong = np.argwhere(~(np.abs(table) <= MAX_NUMBER))
    if wrong.size:
        k, joint = wrong[0]
        raise InputError(
            f"trajectory.points[{k}].{field} of joint '{names[joint]}' is {table[k, joint]}, expected a finite number "
            f"of no more than {MAX_NUMBER:g}."
        )


def _require_rest(velocity, names):
    if velocity.any():
        joint = int(np.flatnonzero(velocity)[0])
        raise InputError(
            f"velocity of joint '{names[joint]}' at the last point of the trajectory is {velocity[joint]:g}, expected "
            "0: the robot rests there."
        )


def _polynomials(T, q, v, a, q1, v1, a1, with_velocity, with_acceleration):
    """Return the coefficients from points to the next ones, T [s] later: quintic, cubic or linear, shape (points, 6, nv)."""
    c = np.zeros((len(T), 6, q.shape[1]))
    c[:, 0], step, T = q, q1 - q, T[:, None]
    c[:, 1] = step / T
    k = with_velocity
    c[k, 1] = v[k]
    c[k, 2] = ((3.0 * step - (2.0 * v + v1) * T) / T**2)[k]
    c[k, 3] = ((-2.0 * step + (v + v1) * T) / T**3)[k]
    k = with_acceleration
    c[k, 2] = 0.5 * a[k]
    c[k, 3] = ((20.0 * step - (12.0 * v + 8.0 * v1) * T - (3.0 * a - a1) * T**2) / (2.0 * T**3))[k]
    c[k, 4] = ((-30.0 * step + (16.0 * v + 14.0 * v1) * T + (3.0 * a - 2.0 * a1) * T**2) / (2.0 * T**4))[k]
    c[k, 5] = ((12.0 * step - 6.0 * (v + v1) * T - (a - a1) * T**2) / (2.0 * T**5))[k]
    return c
