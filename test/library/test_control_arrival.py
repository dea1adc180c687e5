# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Controllers with default parameters arrive: arms with friction and loads, sampled at 125 to 1000
Hz, by Pinocchio.
"""

import numpy as np
import pytest

import diag_dynamics as dd
from arm import waypoints
from diag_dynamics.control.following import (
    GOAL_TOLERANCE_VIOLATED,
    PATH_TOLERANCE_VIOLATED,
    SUCCESSFUL,
)
from diag_dynamics.control.modes import REGULATION, TRACKING
from examples import shortened, some_of
from rubbing import ARMS, Closed

RATES = 125, 250, 500, 1000
CASES = some_of([(*arm, rate) for arm in ARMS for rate in RATES], 4)
MIN_EFFORT = 1e-3
"""Effort that has a sign [N m]."""
ROTOR = 0.1
"""Rotor inertia of all joints [kg m²]."""


def goal_of(q):
    """Return a set-point 0.4 rad away in each joint."""
    return q + 0.4 * np.where(np.arange(len(q)) % 2, 1.0, -1.0)


@pytest.mark.parametrize("rotor", some_of([0.0, ROTOR], 2))
@pytest.mark.parametrize(("robot", "q", "link", "rate"), CASES)
def test_each_joint_arrives(robot, q, link, rate, rotor):
    names = dd.load_urdf(robot.source, **robot.options).dof_names
    robot = robot._replace(armature=dict.fromkeys(names, rotor)) if rotor else robot
    closed = Closed(robot, q, link, rate)
    assert closed.go(goal_of(q)).max() < 0.01
    assert closed.loop.mode == REGULATION and closed.loop.shortfall == ""


@pytest.mark.parametrize("friction", [0.0, 1.0])
def test_an_energy_limit_does_not_keep_light_joints_from_their_friction(friction):
    """Their compensation alone would exceed it within a cycle. It holds without that friction."""
    robot, q, link = ARMS[3]
    closed = Closed(robot, q, link, 250, friction=friction, energy_limit=0.05)
    largest = 0.0
    closed.run(0.2)
    closed.loop.take_set_point(goal_of(q))
    for _ in range(40):
        closed.run(0.1)
        nu = closed.loop.dynamics.nu_from_qd(closed.plant.q, closed.plant.qd)
        largest = max(largest, 0.5 * nu @ nu)
    assert 0.01 < largest <= 1.02 * 0.05
    assert np.abs(goal_of(q) - closed.plant.q).max() < 0.01


@pytest.mark.parametrize(("robot", "q", "link", "rate"), CASES)
def test_no_joint_with_a_load_ends_further_off_than_by_tracking(robot, q, link, rate):
    """The load of 2 kg is unknown. Distances below 1 mrad count as that."""
    ours, theirs = (
        np.maximum(Closed(robot, q, link, rate, load=2.0, **values).go(goal_of(q)), 1e-3)
        for values in ({}, {"initial_mode": TRACKING, "friction_compensation": False})
    )
    assert (ours <= theirs).all() and ours.max() < 0.3 * theirs.max()


@pytest.mark.parametrize("friction", [0.7, 1.3])
@pytest.mark.parametrize(("robot", "q", "link", "rate"), CASES)
def test_wrong_friction_causes_no_limit_cycle(robot, q, link, rate, friction):
    """The arm rests near its target. Its efforts change their signs less than once a second."""
    closed = Closed(robot, q, link, rate, friction=friction)
    assert closed.go(goal_of(q)).max() < 0.06
    efforts = closed.run(shortened(5.0, 1.0))
    signs = np.sign(np.where(np.abs(efforts) > MIN_EFFORT, efforts, 0.0))
    assert (signs == signs[0]).all()
    assert np.abs(closed.plant.qd).max() < 1e-4


def test_friction_in_motion_is_that_of_the_urdf():
    """The springs that compensate it at rest add nothing, however far the joints are behind."""
    robot, q, link = ARMS[0]
    demands = []
    for compensated in (True, False):
        closed = Closed(robot, q, link, 1000, friction_compensation=compensated)
        closed.step()
        points = waypoints([(1.0, goal_of(q), np.zeros(len(q)))])
        closed.loop.take_trajectory(points, 0, closed.stamp)
        demands.append([closed.step().demand for _ in range(200)][-1])  # the arm is held
    velocity = closed.loop.desired.velocity
    friction = np.array([0.4, 0.4, 0.4, 0.1]) * np.sign(velocity)
    friction += np.array([0.5, 0.5, 0.5, 0.1]) * velocity
    np.testing.assert_allclose(demands[0] - demands[1], friction, rtol=1e-9)


@pytest.mark.parametrize(
    ("load", "tolerance", "code"),
    [
        (0.0, "goal_tolerance", SUCCESSFUL),
        (2.0, "goal_tolerance", GOAL_TOLERANCE_VIOLATED),
        (2.0, "path_tolerance", PATH_TOLERANCE_VIOLATED),
    ],
)
def test_tolerances_judge_the_error_that_a_load_leaves(load, tolerance, code):
    """The load moves a joint 8 mrad off, more than the tolerance; friction does not."""
    robot, q, link = ARMS[0]
    closed = Closed(robot, q, link, 125, load=load, **{tolerance: ["*=0.005"]})
    closed.run(1.0)
    points = waypoints([(1.0, goal_of(q), np.zeros(len(q)))])
    closed.loop.take_trajectory(points, 0, closed.stamp)
    closed.run(2.5)
    assert closed.loop.following.outcome.code == code
