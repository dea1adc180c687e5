# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller's loop closed by a simulated arm, without a process: what its defaults do to it."""

import re

import numpy as np
import pytest

import diag_dynamics as dd
from arm import state_at, waypoints
from described import MS, UR5, S, robot
from diag_dynamics.control import supervisor as phases
from diag_dynamics.control.loop import ControlLoop
from diag_dynamics.control.modes import MODES
from diag_dynamics.control.pose import rotation_of
from diag_dynamics.control.references import WITHIN, SetPoint, at_rest
from diag_dynamics.exceptions import InputError
from diag_dynamics.parameters.controller import PARAMETERS

Q = np.array([0.3, -1.2, 1.4, -0.6, 0.5, 0.2])
STRETCHED = np.zeros(6)


@pytest.fixture(scope="module")
def arm():
    return dd.load_urdf(robot(UR5).path)


def loop_of(arm, compensated=False, **values):
    return ControlLoop(arm, {name: spec.default for name, spec in PARAMETERS.items()} | values, compensated)


class Closed:
    """A loop, by default with its defaults, on an arm without friction that nothing stops, at 1 kHz."""

    def __init__(self, arm, q, qd=None, carried=True, **values):
        """Put the arm somewhere; carried, it is at first."""
        self.loop = loop_of(arm, **values)
        nothing = np.zeros(6)
        self.arm = dd.Simulation(arm, q, qd, friction=nothing, damping=nothing, limits=False)
        self.stamp, self.sent, self.fastest, self.most = S, None, nothing, 0.0
        self.way, self.lost = [np.array(q, dtype=float)], []
        if carried:
            self.loop.efforts.reset(robot(UR5).oracle.gravity_torque(np.array(q, dtype=float)))

    def go(self, seconds, push=None):
        """Let it go on; a push is a wrench on the tool."""
        for _ in range(round(1000 * seconds)):
            self.stamp += MS
            self.sent = self.loop.step(state_at(self.stamp, self.arm.q, self.arm.qd), self.stamp)
            self.arm.advance(self.sent.effort, f_ext=push)
            self.way.append(self.arm.q.copy())
            self.most = max(self.most, self.loop.energy)
            self.fastest = np.maximum(self.fastest, np.abs(self.arm.qd))
            self.lost += [self.sent.lost] if self.sent.lost else []
        return self


# --- set-points


@pytest.mark.parametrize(("start", "end"), [(2.2, 3.1), (2.6, 3.12)])
def test_a_set_point_in_the_middle_of_a_trajectory_stays_within_limits(arm, start, end):
    """One that replaces a fast trajectory close to a limit brakes in the room that is left."""
    q = np.array([0.3, -1.2, start, -0.6, 0.5, 0.2])
    closed = Closed(arm, q, following_energy=0.0).go(1.5)
    k, upper = 2, arm.upper[2]
    goal = closed.arm.q.copy()
    goal[k] = end
    closed.loop.take_trajectory(waypoints([(0.6, goal)]), 0, closed.stamp)
    while closed.loop.modes["tracking"].desired.position[k] < 0.8 * end + 0.2 * start:
        closed.go(0.001)
    assert closed.loop.modes["tracking"].desired.velocity[k] > 0.8
    back = closed.arm.q.copy()
    back[k] = end - 0.1
    closed.loop.take_set_point(back)
    furthest = 0.0
    for _ in range(1500):
        closed.go(0.001)
        furthest = max(furthest, closed.loop.modes["tracking"].desired.position[k])
    assert furthest < upper
    assert np.array(closed.way)[:, k].max() < upper
    np.testing.assert_allclose(closed.loop.modes["tracking"].desired.position, back, atol=0.01)


@pytest.mark.parametrize("period", [2, 10, 100], ids="{} ms".format)
def test_poses_in_a_stream_are_followed(arm, period):
    """The same pose again and again leads there as a single one does."""
    gone = []
    for every in (10**6, period):
        closed = Closed(arm, Q, controlled_link="tool0", initial_mode="pose").go(1.5)
        begin, axes = closed.loop.modes["pose"].law.pose(closed.arm.q)
        goal = begin + np.array([0.1, -0.1, 0.15])
        for k in range(1500):
            if k % every == 0:
                closed.loop.take_pose("base_link", goal, axes)
            closed.go(0.001)
        gone.append(np.linalg.norm(closed.loop.modes["pose"].law.pose(closed.arm.q)[0] - begin))
    assert gone[0] > 0.15 and gone[1] == pytest.approx(gone[0], rel=0.1)


def test_without_velocity_limits_trajectories_are_slow_all_the_same():
    """What the URDF does not say is taken to be a radian per second, and named."""
    urdf = re.sub(r' velocity="[^"]*"', ' velocity="0"', robot(UR5).urdf)
    unlimited = dd.load_urdf(urdf)
    closed = Closed(unlimited, Q).go(1.5)
    fast = waypoints([(0.1, closed.arm.q + 0.5)])
    with pytest.raises(InputError, match=r"expected no more than 1, as the URDF has no velocity limit for it"):
        closed.loop.take_trajectory(fast, 0, closed.stamp)


@pytest.mark.parametrize("period", [1, 2, 10, 100], ids="{} ms".format)
def test_a_set_point_is_gone_to_without_haste(period):
    """Within speed and acceleration, without overshoot, and there in the end; from a motion, too, and from another goal."""
    rng = np.random.default_rng(period)
    speed, rate = rng.uniform(0.1, 2.0, 4), rng.uniform(5.0, 9.0, 4)
    turns = np.array([False, False, False, True])
    desired, dt = at_rest(rng.uniform(-3, 3, 4)), period * 1e-3
    for time, seconds in ((0, 0.7), (700 * MS, 25.0)):
        goal, before = rng.uniform(-3, 3, 4), desired
        point = SetPoint(goal, time, desired, speed, rate, turns)
        for k in range(1, round(1000 * seconds / period)):
            desired, last = point.sample(time + k * period * MS), desired
            assert (np.abs(desired.velocity) <= speed + 1e-12).all()
            assert (np.abs(desired.acceleration) <= 2.0 * speed + 1e-9).all()
            np.testing.assert_allclose(desired.velocity, last.velocity + desired.acceleration * dt, atol=1e-12)
            step = desired.position - last.position
            step[3] -= 2.0 * np.pi * np.round(step[3] / (2.0 * np.pi))
            np.testing.assert_allclose(step, desired.velocity * dt, atol=1e-12)
            coast = before.velocity**2 / (4.0 * speed) + 1.5 * speed * dt
            low, high = np.minimum(before.position, goal) - coast, np.maximum(before.position, goal) + coast
            assert ((low <= desired.position) & (desired.position <= high))[~turns].all()
    away = desired.position - goal
    away[3] -= 2.0 * np.pi * np.round(away[3] / (2.0 * np.pi))
    np.testing.assert_allclose(away, 0.0, atol=1e-9)


def test_set_points_that_stream_are_followed():
    """A new one with every state, from whatever the last one has led to; one that comes in fast motion brakes it."""
    one, turns = np.ones(1), np.zeros(1, dtype=bool)
    desired, most = at_rest(np.zeros(1)), 0.0
    for k in range(3000):
        point = SetPoint(np.array([0.4 * k * 1e-3]), k * MS, desired, one, 10.0 * one, turns)
        desired = point.sample((k + 1) * MS)
        most = max(most, desired.velocity[0])
    assert desired.velocity[0] == pytest.approx(0.4, rel=1e-3) and most < 0.41
    assert 1.2 - desired.position[0] == pytest.approx(0.4 / 8.0, rel=0.01)  # √(2aδ) is 0.4 there
    point = SetPoint(np.zeros(1), 0, desired._replace(velocity=3.0 * one), one, 10.0 * one, turns)
    way = [point.sample(k * MS) for k in range(1, 6000)]
    assert max(np.abs(d.acceleration[0]) for d in way) == pytest.approx(3.0 / WITHIN)
    assert way[0].velocity[0] == pytest.approx(3.0 - 3.0e-3 / WITHIN) and np.abs(way[-1].position) < 1e-6


@pytest.mark.parametrize(
    "goal", [[0.3, -1.5, 1.04, -0.6, 0.5, 0.2], [0.3, -2.2, 0.2, -0.6, 0.5, 0.2], Q + 1.0, Q - 1.0]
)
def test_the_arm_goes_to_a_set_point_and_is_not_thrown_at_it(arm, goal):
    """With the defaults, whose effort rate is slower than the law: a quarter of the speed limit, and no overshoot."""
    closed, goal = Closed(arm, Q).go(0.1), np.array(goal)
    closed.loop.take_set_point(goal)
    closed.go(7.0)
    beyond = (np.array(closed.way) - goal) * np.sign(goal - Q)
    assert beyond[:, goal != Q].max() < 1e-3 and not closed.lost
    assert (closed.fastest <= 0.26 * arm.velocity_limit + 0.02).all()
    np.testing.assert_allclose(closed.arm.q, goal, atol=1e-6)


def test_an_energy_limit_makes_the_target_wait(arm):
    """The limiter lets the arm go slower than set-points go: they wait for it, and are not given up."""
    closed = Closed(arm, Q, energy_limit=0.1).go(0.1)
    goal = Q + np.array([1.2, 0.3, 0, 0, 0, 0])
    closed.loop.take_set_point(goal)
    closed.go(10.0)
    np.testing.assert_allclose(closed.arm.q, goal, atol=1e-5)
    assert not closed.lost and closed.most < 1.1 * 0.1


def test_a_target_does_not_run_away_from_an_arm_that_is_held(arm):
    """Drives that are off, or hands: efforts grow only as far as V may, which is then what the arm comes to move at."""
    loop, goal, stamp = loop_of(arm), Q + np.array([0.4, 0.3, -0.4, 0, 0, 0]), S
    for k in range(6000):
        stamp += MS
        sent = loop.step(state_at(stamp, Q), stamp)
        if k == 200:
            loop.take_set_point(goal)
        assert not sent.lost
    assert 1.0 < sent.command.lyapunov < 2.0 and np.abs(sent.command.error).max() < 0.2
    closed = Closed(arm, Q)
    closed.loop, closed.stamp = loop, stamp
    closed.go(6.0)
    np.testing.assert_allclose(closed.arm.q, goal, atol=1e-5)
    assert closed.most < 2.5
    beyond = (np.array(closed.way) - goal) * np.sign(goal - Q)
    assert beyond[:, :3].max() < 0.02


def test_a_target_that_is_not_followed_is_given_up(arm):
    """An arm that somebody else moves: where it is is its target then."""
    loop, stamp = loop_of(arm), S
    for k in range(1000):
        stamp += MS
        moved = Q + np.array([0.0, 0.0, 0.3e-3 * k, 0, 0, 0])  # and the commands come to nothing
        sent = loop.step(state_at(stamp, moved, [0, 0, 0.3, 0, 0, 0]), stamp)
        if sent.lost:
            break
    assert "expected no more than following_energy = 2 J; joint 'elbow_joint' is 0." in sent.lost
    assert not sent.command.error.any()
    freely = loop_of(arm, following_energy=0.0)
    for k in range(3000):
        moved = Q + np.array([0.0, 0.0, k / 3000, 0.0, 0.0, 0.0])
        sent = freely.step(state_at(S + k * MS, moved), S + k * MS)
        assert not sent.lost
    assert sent.command.error[2] < -0.9


# --- poses


@pytest.mark.parametrize("away", [(0.0, 0.1, -0.1), (-0.2, 0.1, 0.1), (2.0, 0.0, 0.0), (0.0, 0.0, 0.0)])
def test_a_pose_is_gone_to_and_the_arm_is_not_thrown_at_it(arm, away):
    """With the defaults, turned by a radian as well: within a half of the speed limits; out of reach it comes to rest."""
    closed = Closed(arm, Q, initial_mode="pose", controlled_link="tool0").go(0.1)
    placed = closed.loop.dynamics.placement(Q, "tool0")
    axes = placed[:3, :3] @ rotation_of([np.sin(0.5), 0.0, 0.0, np.cos(0.5)])
    goal = placed[:3, 3] + away
    closed.loop.take_pose("base_link", goal, axes)
    closed.go(0.1)
    np.testing.assert_allclose(closed.sent.command.error.position, away, atol=0.02)  # of the goal, not of the way
    assert closed.sent.lyapunov_rate is None
    closed.go(10.0)
    error, out_of_reach = closed.sent.command.error, away[0] > 1.0
    assert (closed.fastest <= 0.6 * arm.velocity_limit).all() and closed.most < 2.0
    assert np.abs(closed.arm.qd).max() < 5e-2
    assert out_of_reach or (np.linalg.norm(error.position) < 2e-3 and np.linalg.norm(error.orientation) < 2e-3)
    assert out_of_reach or closed.sent.lyapunov_rate is not None


# --- trajectories


def test_a_trajectory_faster_than_the_robot_is_refused(arm):
    """By joint and limit: between points, and on the way to the first one; and one that begins elsewhere.

    The target before stays in force.
    """
    closed = Closed(arm, Q).go(0.1)
    there = Q + np.array([0.0, 1.0, 0, 0, 0, 0])
    with pytest.raises(InputError, match=r"'shoulder_lift_joint' move at 20, expected no more than its limit 3\.15"):
        closed.loop.take_trajectory(waypoints([(0.05, there)]), 0, closed.stamp)
    rest = np.zeros(6)
    with pytest.raises(
        InputError, match=r"'shoulder_lift_joint' move at 3\.75, expected"
    ):  # a cubic: 1.5 times the mean
        points = [(1.0, Q, rest), (1.4, there, rest)]
        closed.loop.take_trajectory(waypoints(points), 0, closed.stamp)
    with pytest.raises(InputError, match=r"begins 0\.06 from where joint '\w+' is and should be"):
        closed.loop.take_trajectory(waypoints([(0.0, Q + 0.06), (9.0, there)]), 0, 0)
    with pytest.raises(InputError, match=r"points\[0\].velocities of joint 'shoulder_pan_joint' is 1e\+308"):
        closed.loop.take_trajectory(waypoints([(1.0, Q, [1e308, 0, 0, 0, 0, 0]), (2.0, Q, rest)]), 0, 0)
    closed.go(0.1)
    np.testing.assert_allclose(closed.arm.q, Q, atol=1e-6)
    closed.loop.take_trajectory(waypoints([(0.0, Q), (2.0, there, rest)]), 0, closed.stamp)
    closed.go(4.0)
    np.testing.assert_allclose(closed.arm.q, there, atol=1e-4)


# --- beginning


@pytest.mark.parametrize("rate", [1000.0, 300.0])
def test_an_arm_without_brakes_is_caught_and_not_thrown(arm, rate):
    """Efforts begin at zero: it sinks, how far is a matter of their rate; it comes to rest, and only then the law begins."""
    closed = Closed(arm, STRETCHED, carried=False, effort_rate=[f"*={rate}"])
    closed.go(8.0)
    assert np.abs(closed.arm.qd).max() < 1e-6
    assert closed.sent.lyapunov_rate is not None
    assert bool(closed.loop.efforts.slow) == (rate < 1000.0)
    sunk = np.abs(np.array(closed.way)).max()
    assert sunk < {1000.0: 0.5, 300.0: 2.0}[rate]


def test_an_arm_with_a_load_that_nobody_knows_is_not_let_sink(arm):
    """Damping alone would let it creep down for ever; the law begins, and holds it. Targets that come before are refused."""
    closed = Closed(arm, Q, carried=False)
    pull = {"tool0": (0, 0, 20.0, 0, 0, 0)}  # along its axis
    closed.go(0.02, pull)
    assert closed.loop.taking_up and closed.sent.command.error is None
    with pytest.raises(InputError, match="set_point comes while the robot is taken up"):
        closed.loop.take_set_point(Q)
    closed.go(3.0, pull)
    assert not closed.loop.taking_up and np.abs(closed.arm.qd).max() < 1e-3


@pytest.mark.parametrize("mode", MODES)
def test_no_law_begins_outside_of_limits(arm, mode):
    """By joint, position and limits: springs would throw it. At a stop, or nearly, it begins."""
    values = {"initial_mode": mode, "controlled_link": "tool0"}
    loop = loop_of(arm, **values)
    far = Q.copy()
    far[2] = arm.upper[2] + 0.4
    assert loop.step(state_at(S, far), S) is None
    assert loop.supervisor.phase == phases.INACTIVE
    assert "'elbow_joint' is at 3.54159, outside of its limits -3.14159 … 3.14159" in loop.supervisor.reason
    far[2] = arm.upper[2] + 0.04
    assert loop.step(state_at(S, far), S) is not None


def test_a_hold_shorter_than_a_state_may_be_old_is_refused(arm):
    with pytest.raises(InputError, match=r"'hold_time' is 0\.03 s, expected at least twice max_state_age = 0\.02 s"):
        loop_of(arm, hold_time=0.03)
