"""Joint trajectories, interpolated as ros2_control's joint trajectory controller does."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import InputError

MOST_POINTS = 2000
"""Points that one trajectory may have."""

COAST = 0.3
"""How far what is left of the robot's motion may carry it off its way to the first point [rad, m]."""


class Desired(NamedTuple):
    """Where the robot should be: position [rad, m], velocity and acceleration, each of shape (nv,)."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


class _Knot(NamedTuple):
    """A point of a trajectory: its time from the start [s], its position, and what else it says."""

    time: float
    position: np.ndarray
    velocity: np.ndarray | None
    acceleration: np.ndarray | None


class Trajectory:
    """A trajectory_msgs/JointTrajectory for the joints of a robot.

    Between two points that both have accelerations the positions are a quintic of time, where both have velocities a
    cubic, else linear. What comes before the first point starts where the robot is when the trajectory begins; after the last
    one the robot rests there. A continuous joint goes to the first point the shorter way round, and from point to point as
    they say.

    Parameters
    ----------
    message : trajectory_msgs.msg.JointTrajectory
    names : sequence of str
        Joints of the robot, in its order; all of them have to be in the trajectory, in any order.
    continuous : sequence of str
        Those of them that turn round.

    Attributes
    ----------
    positions : ndarray, shape (points, nv)
        Of the points [rad, m], in the robot's order.
    stamp : int
        When it starts [ns]; 0: with the first state.

    Raises
    ------
    InputError
        A joint is missing, unknown or listed twice; a point has no positions, another length or a number that is not
        finite; times do not increase; efforts are given; or the robot would have to rest while it moves.
    """

    def __init__(self, message, names, continuous=()):
        order = _order(message.joint_names, names)
        if not message.points:
            raise InputError(
                "trajectory.points is empty: there is nothing to follow. To rest where the robot is, choose the mode anew."
            )
        if len(message.points) > MOST_POINTS:
            raise InputError(f"trajectory.points has {len(message.points)} entries, expected at most {MOST_POINTS}.")
        self.stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        if message.header.stamp.sec < 0 or message.header.stamp.nanosec >= 1_000_000_000:
            raise InputError("trajectory.header.stamp is no time.")
        self._turns = np.array([name in continuous for name in names])
        self._times = _times(message.points)
        _require_no_effort(message.points)
        fields = [_field(message.points, name, names, order) for name in ("positions", "velocities", "accelerations")]
        (self.positions, _), self._velocities, self._accelerations = fields
        _require_rest(self._knot(len(self._times) - 1), names)
        self._start = None

    def _knot(self, k):
        """The point of an index."""
        velocity, acceleration = (
            values[k] if given[k] else None for values, given in (self._velocities, self._accelerations)
        )
        return _Knot(float(self._times[k]), self.positions[k], velocity, acceleration)

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
        start = np.array(position, dtype=float)
        turned = self.positions[0] - start
        start[self._turns] += (2.0 * np.pi * np.round(turned / (2.0 * np.pi)))[self._turns]
        at = (time - self._start) * 1e-9
        fastest = COAST * 27.0 / 4.0 / max(self._times[0] - at, 1e-9)
        self._before = _Knot(at, start, np.clip(velocity, -fastest, fastest), None)

    def over(self, time):
        """Whether the last point has been reached at a time [ns]."""
        return (time - self._start) * 1e-9 >= self._times[-1]

    def sample(self, time):
        """Where the robot should be at a time [ns]."""
        t = (time - self._start) * 1e-9
        k = int(np.searchsorted(self._times, t, side="right"))
        if k == len(self._times):
            rest = np.zeros(len(self._turns))
            return Desired(self.positions[-1].copy(), rest, rest.copy())
        return _between(self._knot(k - 1) if k else self._before, self._knot(k), t)


def _order(listed, names):
    for k, name in enumerate(listed):
        if name not in names:
            raise InputError(f"trajectory.joint_names has '{name}', which is no joint to control: {', '.join(names)}.")
        if name in listed[:k]:
            raise InputError(f"trajectory.joint_names has '{name}' twice.")
    for name in names:
        if name not in listed:
            raise InputError(f"trajectory.joint_names lacks joint '{name}'.")
    return [list(listed).index(name) for name in names]


def _times(points):
    """Times of the points from the start [s], shape (points,)."""
    times = np.array([point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in points])
    if times[0] < 0.0:
        raise InputError(f"trajectory.points[0].time_from_start is {times[0]:g} s, expected no less than 0.")
    backward = np.flatnonzero(np.diff(times) <= 0.0)
    if backward.size:
        k = int(backward[0])
        raise InputError(
            f"trajectory.points[{k + 1}].time_from_start is {times[k + 1]:g} s, expected more than the {times[k]:g} s of the "
            "point before."
        )
    return times


def _require_no_effort(points):
    for k, point in enumerate(points):
        if len(point.effort):
            raise InputError(f"trajectory.points[{k}].effort is given, expected none: the law finds the efforts.")


def _field(points, name, names, order):
    """What the points say in one field, in the robot's order, shape (points, nv), and which of them say it.

    All points at once: a long trajectory must not hold up the loop.
    """
    values, width = [getattr(point, name) for point in points], len(names)
    lengths = np.array([len(one) for one in values])
    given = lengths > 0
    if name == "positions" and not given.all():
        k = int(np.argmin(given))
        raise InputError(f"trajectory.points[{k}].positions is empty, expected {width} entries.")
    wrong = given & (lengths != width)
    if wrong.any():
        k = int(np.argmax(wrong))
        raise InputError(f"trajectory.points[{k}].{name} has {lengths[k]} entries, expected {width}.")
    table = np.zeros((len(points), width))
    table[given] = np.frombuffer(b"".join(values)).reshape(-1, width)[:, order]
    strange = np.argwhere(~np.isfinite(table))
    if strange.size:
        k, joint = strange[0]
        raise InputError(
            f"trajectory.points[{k}].{name} of joint '{names[joint]}' is {table[k, joint]}, expected a finite number."
        )
    return table, given


def _require_rest(knot, names):
    if knot.velocity is not None and knot.velocity.any():
        joint = int(np.flatnonzero(knot.velocity)[0])
        raise InputError(
            f"velocity of joint '{names[joint]}' at the last point of the trajectory is {knot.velocity[joint]:g}, expected "
            "0: the robot rests there."
        )


def _between(a, b, t):
    """The polynomial from one point to the next, at a time within."""
    T, s = b.time - a.time, t - a.time
    step = b.position - a.position
    if a.velocity is None or b.velocity is None:
        return Desired(a.position + step * (s / T), step / T, np.zeros_like(step))
    if a.acceleration is None or b.acceleration is None:
        c2 = (3.0 * step - (2.0 * a.velocity + b.velocity) * T) / T**2
        c3 = (-2.0 * step + (a.velocity + b.velocity) * T) / T**3
        c4 = c5 = np.zeros_like(step)
    else:
        c2 = 0.5 * a.acceleration
        c3 = (
            20.0 * step - (12.0 * a.velocity + 8.0 * b.velocity) * T - (3.0 * a.acceleration - b.acceleration) * T**2
        ) / (2.0 * T**3)
        c4 = (
            -30.0 * step
            + (16.0 * a.velocity + 14.0 * b.velocity) * T
            + (3.0 * a.acceleration - 2.0 * b.acceleration) * T**2
        ) / (2.0 * T**4)
        c5 = (12.0 * step - 6.0 * (a.velocity + b.velocity) * T - (a.acceleration - b.acceleration) * T**2) / (
            2.0 * T**5
        )
    return Desired(
        a.position + s * (a.velocity + s * (c2 + s * (c3 + s * (c4 + s * c5)))),
        a.velocity + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5))),
        2.0 * c2 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5)),
    )
