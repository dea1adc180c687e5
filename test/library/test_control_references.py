# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""References of the controller: trajectories, set-points, poses and their messages."""

from array import array
from itertools import zip_longest
from types import SimpleNamespace

import numpy as np
import pytest

from arm import waypoints
from described import MS, S
from diag_dynamics.control.references import WITHIN, PoseTarget, SetPoint, Trajectory, at_rest
from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.controller import received
from examples import shortened

NAMES = ("shoulder", "elbow", "wrist")


@pytest.mark.parametrize("given", [1, 2, 3], ids=["linear", "cubic", "quintic"])
def test_polynomials_are_reproduced(given):
    """Positions alone define a polynomial of degree 1 between points, with velocities 3, with
    accelerations 5.
    """
    rng = np.random.default_rng(given)
    curves = [np.polynomial.Polynomial(rng.normal(size=2 * given)) for _ in NAMES]

    def at(t, order):
        return [curve.deriv(order)(t) if order else curve(t) for curve in curves]

    times = [0.7, 1.1, 2.0, 2.6]
    points = [(t, *(at(t, order) for order in range(given))) for t in times]
    points.append((10.0, np.zeros(3), *[np.zeros(3)] * (given - 1)))
    followed = Trajectory(waypoints(points), NAMES)
    followed.begin(5 * S, np.zeros(3), np.zeros(3))
    for t in np.linspace(times[0], times[-1] - 1e-9, 23):
        desired = followed.sample(5 * S + round(t * S))
        for order, values in enumerate(desired[: max(given, 2)]):
            np.testing.assert_allclose(values, at(t, order), atol=2e-8 * 10**order)


def test_segments_are_linear_unless_both_points_have_velocities():
    points = [(1.0, [0, 0, 0]), (2.0, [1, 1, 1], [0.5, 0.5, 0.5]), (3.0, [2, 2, 2])]
    followed = Trajectory(waypoints(points), NAMES)
    followed.begin(5 * S, np.zeros(3), np.zeros(3))
    for t in (1.25, 2.25):
        desired = followed.sample(5 * S + round(t * S))
        np.testing.assert_allclose(desired.position, t - 1.0, atol=1e-12)
        np.testing.assert_allclose(desired.velocity, 1.0, atol=1e-12)


def test_a_trajectory_begins_where_the_robot_is_and_ends_at_rest():
    """Its first stretch starts from the robot's state; after the last point it stays there."""
    goal = [1.0, -2.0, 0.5]
    followed = Trajectory(waypoints([(2.0, goal, [0, 0, 0])]), NAMES)
    start = np.array([0.1, 0.2, 0.3])
    moving = np.array([0.5, 0.0, -0.5])
    followed.begin(S, start, moving)
    desired = followed.sample(S)
    np.testing.assert_allclose(desired.position, start, atol=1e-15)
    np.testing.assert_allclose(desired.velocity, moving, atol=1e-15)
    for time in (3 * S, 3 * S + 1, 1000 * S):
        desired = followed.sample(time)
        assert (
            desired.position.tolist() == goal
            and not desired.velocity.any()
            and not desired.acceleration.any()
        )
    assert followed.sample(3 * S - 1).acceleration.any()
    dt = 1e-5
    near = [followed.sample(2 * S + round(k * dt * S)) for k in (-1, 0, 1)]
    np.testing.assert_allclose(
        (near[2].position - near[0].position) / (2 * dt), near[1].velocity, atol=1e-8
    )
    np.testing.assert_allclose(
        (near[2].velocity - near[0].velocity) / (2 * dt), near[1].acceleration, atol=1e-8
    )


def test_continuous_joints_go_the_shorter_way_to_the_first_point():
    followed = Trajectory(waypoints([(1.0, [3.0, 3.0, 0.0])]), NAMES, continuous=("shoulder",))
    followed.begin(0, np.array([-3.0 + 4 * np.pi, -3.0, 0.0]), np.zeros(3))
    velocity = followed.sample(S // 2).velocity
    np.testing.assert_allclose(velocity, [6.0 - 2 * np.pi, 6.0, 0.0], atol=1e-12)


def test_a_trajectory_with_a_stamp():
    """The robot moves towards a start in the future, and joins a trajectory that has started."""
    points = [(0.0, [0, 0, 0]), (2.0, [2, 2, 2])]
    later, joined = (Trajectory(waypoints(points), NAMES, stamp=10 * S) for _ in range(2))
    later.begin(8 * S, np.full(3, -1.0), np.zeros(3))
    np.testing.assert_allclose(later.sample(9 * S).position, -0.5)
    np.testing.assert_allclose(later.sample(11 * S).position, 1.0)
    assert later.ends_before(12 * S + 1) and not later.ends_before(12 * S)
    with np.errstate(all="raise"):
        joined.begin(10 * S, np.full(3, -1.0), np.zeros(3))
    joined.begin(11 * S, np.full(3, -1.0), np.zeros(3))
    np.testing.assert_allclose(joined.sample(11 * S).position, 1.0)


def test_a_moving_robot_is_not_carried_far_off_the_way():
    """Towards a point ten seconds ahead a cubic that keeps the velocity of 1 rad/s would turn back
    after 1.5 rad.
    """
    followed = Trajectory(waypoints([(10.0, [0, 0, 0], [0, 0, 0])]), NAMES)
    followed.begin(S, np.zeros(3), np.array([1.0, -0.01, 0.0]))
    way = np.array([followed.sample(S + round(t * S)).position for t in np.linspace(0, 10, 1001)])
    assert np.abs(way).max() == pytest.approx(0.3, rel=1e-3)
    assert followed.sample(S).velocity[1] == -0.01
    soon = Trajectory(waypoints([(0.5, [0, 0, 0], [0, 0, 0])]), NAMES)
    soon.begin(S, np.zeros(3), np.array([1.0, 0.0, 0.0]))
    assert soon.sample(S).velocity[0] == 1.0


@pytest.mark.parametrize("period", [10, 100], ids="{} ms".format)
def test_a_set_point_is_gone_to_without_haste(period):
    """Within speed and acceleration, without overshoot, from a motion too."""
    rng = np.random.default_rng(period)
    speed = rng.uniform(0.1, 2.0, 4)
    rate = rng.uniform(5.0, 9.0, 4)
    turns = np.array([False, False, False, True])
    desired = at_rest(rng.uniform(-3, 3, 4))
    dt = period * 1e-3

    def shortest(difference):
        difference[3] -= 2.0 * np.pi * np.round(difference[3] / (2.0 * np.pi))
        return difference

    for time, seconds in ((0, 0.7), (700 * MS, shortened(25.0, 12.0))):
        goal = rng.uniform(-3, 3, 4)
        before = desired
        point = SetPoint(goal, time, desired, speed, rate, turns)
        coast = before.velocity**2 / (4.0 * speed) + 1.5 * speed * dt
        low = np.minimum(before.position, goal) - coast
        high = np.maximum(before.position, goal) + coast
        for k in range(1, round(1000 * seconds / period)):
            desired, last = point.sample(time + k * period * MS), desired
            assert (np.abs(desired.velocity) <= speed + 1e-12).all()
            assert (np.abs(desired.acceleration) <= 2.0 * speed + 1e-9).all()
            assert (
                np.abs(desired.velocity - last.velocity - desired.acceleration * dt).max() < 1e-12
            )
            assert (
                np.abs(shortest(desired.position - last.position) - desired.velocity * dt).max()
                < 1e-12
            )
            assert ((low <= desired.position) & (desired.position <= high))[~turns].all()
    np.testing.assert_allclose(shortest(desired.position - goal), 0.0, atol=1e-9)


def test_set_points_that_stream_are_followed():
    """A set-point with every state is followed; one that comes in fast motion brakes it."""
    unit = np.ones(1)
    turns = np.zeros(1, dtype=bool)
    desired = at_rest(np.zeros(1))
    largest = 0.0
    for k in range(3000):
        point = SetPoint(np.array([0.4 * k * 1e-3]), k * MS, desired, unit, 10.0 * unit, turns)
        desired = point.sample((k + 1) * MS)
        largest = max(largest, desired.velocity[0])
    assert desired.velocity[0] == pytest.approx(0.4, rel=1e-3) and largest < 0.41
    assert 1.2 - desired.position[0] == pytest.approx(0.4 / 8.0, rel=0.01)  # √(2aδ) is 0.4 there
    point = SetPoint(
        np.zeros(1), 0, desired._replace(velocity=3.0 * unit), unit, 10.0 * unit, turns
    )
    way = [point.sample(k * MS) for k in range(1, 6000)]
    assert max(np.abs(d.acceleration[0]) for d in way) == pytest.approx(3.0 / WITHIN)
    assert (
        way[0].velocity[0] == pytest.approx(3.0 - 3.0e-3 / WITHIN)
        and np.abs(way[-1].position) < 1e-6
    )


def test_the_same_pose_in_a_stream_is_gone_to_as_once():
    speed = np.array([0.25, 0.5])
    rate = np.full(2, 10.0)
    axes = np.eye(3)
    goal = np.array([0.1, -0.1, 0.15])
    reached = []
    for every in (10**6, 10):
        aim = (np.zeros(3), axes)
        target = None
        for k in range(800):
            if k % every == 0:
                target = PoseTarget((goal, axes), k * MS, aim, speed, rate, 0.02, target)
            aim = target.sample((k + 1) * MS)
        reached.append(aim[0])
    assert np.linalg.norm(reached[0]) > 0.1
    np.testing.assert_allclose(reached[1], reached[0], rtol=0.1)


def time_of(nanoseconds):
    return SimpleNamespace(sec=nanoseconds // S, nanosec=nanoseconds % S)


def trajectory(points, names=NAMES, stamp=0, effort=()):
    """Return the fields of a JointTrajectory of (time, positions, velocities, accelerations)."""
    message = SimpleNamespace(
        joint_names=names, header=SimpleNamespace(stamp=time_of(stamp)), points=[]
    )
    for time, *fields in points:
        columns = zip_longest(("positions", "velocities", "accelerations"), fields, fillvalue=())
        values = {name: array("d", numbers) for name, numbers in columns}
        message.points.append(
            SimpleNamespace(time_from_start=time_of(round(time * S)), effort=effort, **values)
        )
    return message


def joint_state(names, position, velocity=(), effort=()):
    return SimpleNamespace(name=list(names), position=position, velocity=velocity, effort=effort)


POINT = (1.0, [0.0, 0.0, 0.0])
HELD = np.array([0.1, 0.2, 0.3])
OTHER_NAMES = (
    ((*NAMES, "wing"), "has 'wing'"),
    (("wrist", "elbow", "wrist"), "'wrist' twice"),
)


@pytest.mark.parametrize(
    ("message", "key"),
    [
        (trajectory([]), "points is empty"),
        (trajectory([POINT], ()), "joint_names is empty"),
        *((trajectory([POINT], names), key) for names, key in OTHER_NAMES),
        (trajectory([(1.0, [0.0, 0.0])]), r"points\[0\].positions has 2 entries"),
        (trajectory([(1.0, [])]), r"points\[0\].positions is empty"),
        (
            trajectory([POINT, (2.0, [0, 0, 0], [0, np.nan, 0])]),
            r"points\[1\].velocities of joint 'elbow' is nan",
        ),
        (trajectory([POINT, POINT]), r"points\[1\].time_from_start is 1 s"),
        (trajectory([(-1.0, [0, 0, 0])]), r"points\[0\].time_from_start is -1 s"),
        (
            trajectory([(1.0, [0, 0, 0], [0, 0, 0.5])]),
            "'wrist' at the last point of the trajectory is 0.5",
        ),
    ],
)
def test_bad_trajectories_are_rejected(message, key):
    with pytest.raises(InputError, match=key):
        Trajectory(received.trajectory(message, NAMES, HELD)[0], NAMES)


@pytest.mark.parametrize(
    ("message", "key"),
    [
        *((joint_state(names, [0.0] * len(names)), key) for names, key in OTHER_NAMES),
        (joint_state(NAMES[:2], [0.0, 0.0]), f"lacks {NAMES[2]}"),
        (joint_state(NAMES, [0, 0]), "position has 2 entries"),
        (joint_state(NAMES, [0, np.inf, 0]), "position of joint 'elbow' is inf"),
        (joint_state(NAMES, [0, 0, 0], [0, 0, 1]), "positions only"),
    ],
)
def test_bad_set_points_are_rejected(message, key):
    with pytest.raises(InputError, match=key):
        received.set_point(message, NAMES)


def test_joints_of_messages_come_in_any_order():
    points = [(1.0, [1, 2, 3], [4, 5, 6]), (2.0, [7, 8, 9])]
    message = trajectory(points, NAMES[::-1], stamp=3 * S + 5)
    read, stamp = received.trajectory(message, NAMES, HELD)
    assert stamp == 3 * S + 5 and read.times.tolist() == [1.0, 2.0]
    assert read.positions.tolist() == [[3, 2, 1], [9, 8, 7]]
    assert read.velocities.tolist() == [[6, 5, 4], [0, 0, 0]] and read.with_velocity.tolist() == [
        True,
        False,
    ]
    assert not read.with_acceleration.any()
    message = trajectory([(1.0, [1, 2], [3, 4])], NAMES[:0:-1])
    read, _ = received.trajectory(message, NAMES, HELD)
    assert read.positions.tolist() == [[HELD[0], 2, 1]]
    assert read.velocities.tolist() == [[0, 4, 3]]
    assert received.set_point(joint_state(NAMES[::-1], [1, 2, 3]), NAMES).tolist() == [3, 2, 1]
