# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joint trajectories, interpolated as ros2_control's joint trajectory controller does."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.control.references import Desired, at_rest, nearest
from diag_dynamics.exceptions import InputError

ABSURD = 1e8
"""Largest number that a point may hold: with greater ones polynomials overflow."""

LOOKS = 9
"""Places of each stretch at which its velocity is looked at."""

COAST = 0.3
"""How far what is left of the robot's motion may carry it off its way to the first point [rad, m]."""


class Waypoints(NamedTuple):
    """Points of a trajectory, joints in the robot's order; at least one.

    Attributes
    ----------
    times : ndarray, shape (points,)
        From the start [s], increasing.
    positions, velocities, accelerations : ndarray, shape (points, nv)
        [rad, m], [rad/s, m/s], [rad/s², m/s²]; the latter two are zero at points without.
    with_velocity, with_acceleration : ndarray of bool, shape (points,)
        Which points have them.
    """

    times: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    accelerations: np.ndarray
    with_velocity: np.ndarray
    with_acceleration: np.ndarray


class Trajectory:
    """A trajectory for the joints of a robot.

    Between two points that both have accelerations the positions are a quintic of time, where both have velocities a
    cubic, else linear. What comes before the first point starts where the robot is when the trajectory begins; after the last
    one the robot rests there. A continuous joint goes to the first point the shorter way round, and from point to point as
    they say.

    Parameters
    ----------
    waypoints : Waypoints
    names : sequence of str
        Joints of the robot, in its order.
    continuous : sequence of str
        Those of them that turn round.
    stamp : int
        When it starts [ns]; 0: with the first state.

    Attributes
    ----------
    positions : ndarray, shape (points, nv)
        Of the points [rad, m].
    stamp : int

    Raises
    ------
    InputError
        Times do not increase, a number is not finite or absurd, or the robot would have to rest while it moves.
    """

    def __init__(self, waypoints, names, continuous=(), stamp=0):
        self.stamp, self._turns = stamp, np.array([name in continuous for name in names])
        self._times, self.positions = waypoints.times, waypoints.positions
        _require_order(self._times)
        for field in ("positions", "velocities", "accelerations"):
            _require_sane(field, getattr(waypoints, field), names)
        self._velocities = waypoints.velocities, waypoints.with_velocity
        self._accelerations = waypoints.accelerations, waypoints.with_acceleration
        _require_rest(waypoints.velocities[-1], names)
        self._stretches = self._between_points()
        self._start = None

    def _between_points(self):
        """Coefficients of the polynomials from point to point, shape (points − 1, 6, nv)."""
        (v, with_v), (a, with_a) = self._velocities, self._accelerations
        with_v, with_a = with_v[:-1] & with_v[1:], with_a[:-1] & with_a[1:]
        q, T = self.positions, np.diff(self._times)
        return _polynomials(T, q[:-1], v[:-1], a[:-1], q[1:], v[1:], a[1:], with_v, with_v & with_a)

    @property
    def begun(self):
        """Whether it has a beginning yet."""
        return self._start is not None

    def ends_before(self, time):
        """Whether a trajectory that has a start of its own is over at a time [ns]."""
        return bool(self.stamp) and self.stamp + round(self._times[-1] * 1e9) < time

    def begin(self, time, position, velocity):
        """Start at a time [ns], or at that of its stamp, from where the robot is and how it moves at that time.

        A first point far ahead would let a cubic follow that motion a long way before it turns: :data:`COAST` bounds that.
        """
        self._start = self.stamp or time
        first, start = self.positions[:1], np.array(position, dtype=float)
        start = nearest(start, first[0], self._turns)
        self._begin = (time - self._start) * 1e-9
        T = np.maximum(self._times[:1] - self._begin, 1e-9)
        fastest = COAST * 27.0 / 4.0 / T
        (v, with_v), none = self._velocities, np.zeros_like(first)
        no = np.zeros(1, dtype=bool)
        moving = np.clip(velocity, -fastest, fastest)[None]
        self._approach = _polynomials(T, start[None], moving, none, first, v[:1], none, with_v[:1], no)

    def fastest(self):
        """Highest velocities [rad/s, m/s], shape (stretches, nv), in each stretch that is left once it has begun."""
        T, table = np.diff(self._times), self._stretches
        if self._begin < self._times[0]:
            T, table = np.append(self._times[0] - self._begin, T), np.concatenate([self._approach, table])
        else:
            T, table = T[self._times[1:] > self._begin], table[self._times[1:] > self._begin]
        s = (T[:, None] * np.linspace(0.0, 1.0, LOOKS))[..., None]
        c = table[:, :, None, :]
        velocity = c[:, 1] + s * (2.0 * c[:, 2] + s * (3.0 * c[:, 3] + s * (4.0 * c[:, 4] + s * 5.0 * c[:, 5])))
        return np.abs(velocity).max(axis=1)

    def over(self, time):
        """Whether the last point has been reached at a time [ns]."""
        return (time - self._start) * 1e-9 >= self._times[-1]

    def sample(self, time, lag=0.0):
        """Where the robot should be at a time [ns], however far it is behind."""
        t = (time - self._start) * 1e-9
        k = int(np.searchsorted(self._times, t, side="right"))
        if k == len(self._times):
            return at_rest(self.positions[-1])
        c, s = (self._stretches[k - 1], t - self._times[k - 1]) if k else (self._approach[0], t - self._begin)
        return Desired(
            c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5])))),
            c[1] + s * (2.0 * c[2] + s * (3.0 * c[3] + s * (4.0 * c[4] + s * 5.0 * c[5]))),
            2.0 * c[2] + s * (6.0 * c[3] + s * (12.0 * c[4] + s * 20.0 * c[5])),
        )


def _require_order(times):
    """Refuse times [s] that do not increase, or begin before the start."""
    if times[0] < 0.0:
        raise InputError(f"trajectory.points[0].time_from_start is {times[0]:g} s, expected no less than 0.")
    backward = np.flatnonzero(np.diff(times) <= 0.0)
    if backward.size:
        k = int(backward[0])
        raise InputError(
            f"trajectory.points[{k + 1}].time_from_start is {times[k + 1]:g} s, expected more than the {times[k]:g} s of the "
            "point before."
        )


def _require_sane(field, table, names):
    """Refuse numbers that are not finite, or absurd."""
    strange = np.argwhere(~(np.abs(table) <= ABSURD))
    if strange.size:
        k, joint = strange[0]
        raise InputError(
            f"trajectory.points[{k}].{field} of joint '{names[joint]}' is {table[k, joint]}, expected a finite number "
            f"of no more than {ABSURD:g}."
        )


def _require_rest(velocity, names):
    if velocity.any():
        joint = int(np.flatnonzero(velocity)[0])
        raise InputError(
            f"velocity of joint '{names[joint]}' at the last point of the trajectory is {velocity[joint]:g}, expected "
            "0: the robot rests there."
        )


def _polynomials(T, q, v, a, q1, v1, a1, with_velocity, with_acceleration):
    """Coefficients from points to the ones after them, T [s] later: quintic, cubic or linear, shape (points, 6, nv)."""
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
