# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories between their points, before the first and after the last one."""

import numpy as np
import pytest

from arm import waypoints
from described import S
from diag_dynamics.control.trajectory import Trajectory

NAMES = ("shoulder", "elbow", "wrist")


@pytest.mark.parametrize("given", [1, 2, 3], ids=["linear", "cubic", "quintic"])
def test_polynomials_are_reproduced(given):
    """Positions alone make a polynomial of degree 1 between points, with velocities 3, with accelerations 5: any such one."""
    rng = np.random.default_rng(given)
    curves = [np.polynomial.Polynomial(rng.normal(size=2 * given)) for _ in NAMES]
    at = lambda t, order: [curve.deriv(order)(t) if order else curve(t) for curve in curves]  # noqa: E731
    times = [0.7, 1.1, 2.0, 2.6]
    points = [(t, *(at(t, order) for order in range(given))) for t in times]
    points.append((10.0, np.zeros(3), *[np.zeros(3)] * (given - 1)))
    followed = Trajectory(waypoints(points), NAMES)
    followed.begin(5 * S, np.zeros(3), np.zeros(3))
    for t in np.linspace(times[0], times[-1] - 1e-9, 23):
        desired = followed.sample(5 * S + round(t * S))
        for order, values in enumerate(desired[: max(given, 2)]):
            np.testing.assert_allclose(values, at(t, order), atol=2e-8 * 10**order)


def test_a_trajectory_begins_where_the_robot_is_and_ends_at_rest():
    """Its first stretch starts from the robot's state; after the last point it stays there, long before and long after."""
    goal = [1.0, -2.0, 0.5]
    followed = Trajectory(waypoints([(2.0, goal, [0, 0, 0])]), NAMES)
    start, moving = np.array([0.1, 0.2, 0.3]), np.array([0.5, 0.0, -0.5])
    followed.begin(S, start, moving)
    desired = followed.sample(S)
    np.testing.assert_allclose(desired.position, start, atol=1e-15)
    np.testing.assert_allclose(desired.velocity, moving, atol=1e-15)
    for time in (3 * S, 3 * S + 1, 1000 * S):
        desired = followed.sample(time)
        assert desired.position.tolist() == goal and not desired.velocity.any() and not desired.acceleration.any()
    assert not followed.over(3 * S - 1) and followed.over(3 * S)
    dt = 1e-5
    near = [followed.sample(2 * S + round(k * dt * S)) for k in (-1, 0, 1)]
    np.testing.assert_allclose((near[2].position - near[0].position) / (2 * dt), near[1].velocity, atol=1e-8)
    np.testing.assert_allclose((near[2].velocity - near[0].velocity) / (2 * dt), near[1].acceleration, atol=1e-8)


def test_continuous_joints_go_the_shorter_way_to_the_first_point():
    """A joint that turns round goes less than half a turn there; one that does not goes as far as it has to."""
    followed = Trajectory(waypoints([(1.0, [3.0, 3.0, 0.0])]), NAMES, continuous=("shoulder",))
    followed.begin(0, np.array([-3.0 + 4 * np.pi, -3.0, 0.0]), np.zeros(3))
    velocity = followed.sample(S // 2).velocity
    np.testing.assert_allclose(velocity, [6.0 - 2 * np.pi, 6.0, 0.0], atol=1e-12)


def test_a_trajectory_with_a_stamp():
    """It starts at its stamp: one of the future is gone towards, one of the past is joined, one that is over refused."""
    points = [(0.0, [0, 0, 0]), (2.0, [2, 2, 2])]
    later = Trajectory(waypoints(points), NAMES, stamp=10 * S)
    later.begin(8 * S, np.full(3, -1.0), np.zeros(3))
    np.testing.assert_allclose(later.sample(9 * S).position, -0.5)
    np.testing.assert_allclose(later.sample(11 * S).position, 1.0)
    assert later.ends_before(13 * S) and not later.ends_before(11 * S)
    joined = Trajectory(waypoints(points), NAMES, stamp=10 * S)
    joined.begin(11 * S, np.full(3, -1.0), np.zeros(3))
    np.testing.assert_allclose(joined.sample(11 * S).position, 1.0)


def test_a_moving_robot_is_not_carried_far_off_the_way():
    """Towards a point ten seconds ahead a cubic that keeps the velocity of 1 rad/s would turn back after 1.5 rad."""
    followed = Trajectory(waypoints([(10.0, [0, 0, 0], [0, 0, 0])]), NAMES)
    followed.begin(S, np.zeros(3), np.array([1.0, -0.01, 0.0]))
    way = np.array([followed.sample(S + round(t * S)).position for t in np.linspace(0, 10, 1001)])
    assert np.abs(way).max() == pytest.approx(0.3, rel=1e-3)
    assert followed.sample(S).velocity[1] == -0.01
    soon = Trajectory(waypoints([(0.5, [0, 0, 0], [0, 0, 0])]), NAMES)
    soon.begin(S, np.zeros(3), np.array([1.0, 0.0, 0.0]))
    assert soon.sample(S).velocity[0] == 1.0
