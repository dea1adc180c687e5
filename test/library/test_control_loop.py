# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller's loop without a process: settings, safety, targets, a simulated arm."""

import re
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from arm import (
    Closed,
    Q,
    control_loop,
    gravity_of,
    loop_of,
    pinocchio_command,
    pose_of,
    state_at,
    waypoints,
)
from described import MS, UR5, S, robot
from diag_dynamics.control import supervisor as phases
from diag_dynamics.control.by_dof import by_dof, command_order, require_same_joints
from diag_dynamics.control.modes import LAWS, POSE, TRACKING
from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.robot_joints import RobotState
from diag_dynamics.nodes.controller import received
from examples import shortened, some_of
from limits import HANG

NAMES = ("shoulder", "elbow", "wrist")
RATE = 400.0


@pytest.fixture(scope="module")
def arm():
    """Return a UR5."""
    return dd.load_urdf(robot(UR5).path)


@pytest.fixture(scope="module")
def strong():
    """Return a UR5 that is strong enough for anything."""
    return dd.load_urdf(re.sub(r'effort="[^"]*"', 'effort="1e4"', robot(UR5).urdf))


def slow_loop_of(arm, compensated=False, **values):
    """Return a loop whose efforts change at RATE."""
    return loop_of(arm, compensated, **({"effort_rate": [f"*={RATE}"]} | values))


def test_entries_by_joint():
    assert by_dof("gain", ["elbow=2", "*=3"], NAMES).tolist() == [3.0, 2.0, 3.0]
    assert by_dof("limit", ["elbow=2"], NAMES, np.array([5.0, np.inf, 7.0])).tolist() == [
        5.0,
        2.0,
        7.0,
    ]
    assert command_order([""], NAMES) == (NAMES, [0, 1, 2])
    assert command_order(["wrist", "shoulder", "elbow"], NAMES)[1] == [2, 0, 1]
    require_same_joints(NAMES, list(NAMES), "/effort_controller")


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda _: by_dof("gain", ["elbow=2"], NAMES), "no entry for joint 'shoulder'"),
        (lambda _: by_dof("gain", ["wing=2", "*=1"], NAMES), "names 'wing'"),
        (lambda _: command_order(["wrist", "shoulder"], NAMES), "lacks joint 'elbow'"),
        (lambda _: command_order([*NAMES, "wrist"], NAMES), "names 'wrist' twice"),
        (
            lambda _: require_same_joints(
                NAMES, ["shoulder", "wrist", "elbow"], "/effort_controller"
            ),
            "are shoulder, wrist, elbow; expected",
        ),
        (
            lambda _: require_same_joints(NAMES, NAMES[:2], "/effort_controller"),
            f"are {', '.join(NAMES[:2])}; expected {', '.join(NAMES)}",
        ),
        (lambda arm: loop_of(arm, hold_time=0.03), "'hold_time' is 0.03 s"),
        (
            lambda arm: loop_of(arm, controlled_link="", initial_mode="pose"),
            "'controlled_link' is empty",
        ),
        (
            lambda arm: loop_of(arm, effort_limit=["*=28", "wrist_1_joint=100"]),
            "'effort_limit' of 'wrist_1_joint' is 100",
        ),
    ],
)
def test_settings_that_are_refused(arm, make, key):
    with pytest.raises(InputError, match=key):
        make(arm)


def settle(loop, q=Q, qd=None, stamp=S, cycles=1000):
    """Send states until the efforts are those of the law; return the last command and its stamp."""
    for k in range(cycles):
        sent = loop.step(state_at(stamp + k * MS, q, qd), stamp + k * MS)
    return sent, stamp + (cycles - 1) * MS


@pytest.mark.parametrize("compensated", [False, True])
@pytest.mark.parametrize("mode", LAWS)
def test_efforts_are_continuous_and_begin_at_zero(strong, mode, compensated):
    """From the first command on, across switches of mode, holds and ramps: never faster than the
    rate.
    """
    loop = slow_loop_of(strong, compensated, initial_mode=mode)
    rng = np.random.default_rng(3)
    first = loop.step(state_at(S, Q), S)
    assert not first.effort.any()
    sent, stamp = settle(loop)
    assert not loop.supervisor.starting
    last = sent.effort
    for k in range(400):
        stamp += MS
        if k % 37 == 0:
            loop.switch(list(LAWS)[rng.integers(len(LAWS))])
        if k % 50 < 40:
            sent = loop.step(
                state_at(stamp, Q + 0.3 * rng.normal(size=6), rng.normal(size=6)), stamp
            )
        else:
            sent = loop.without_state(stamp, "NaN")
        assert np.abs(sent.effort - last).max() <= RATE * 1e-3 + 1e-9
        last = sent.effort
    assert not loop.supervisor.starting


@pytest.mark.parametrize("compensated", [False, True])
def test_beginning_anew_goes_on_as_far_as_that_carries(strong, compensated):
    """Where the arm was moved meanwhile, it begins with the torques that carry it in both places,
    and no others.
    """
    loop = slow_loop_of(
        strong,
        compensated,
        initial_mode="gravity_compensation",
        effort_rate=["*=1e-3"],
        limit_margin=0.0,
    )
    moved = np.array([0.3, -2.1, -1.2, 0.5, 0.4, 0.2])
    before, after = (robot(UR5).oracle.gravity_torque(q) * (not compensated) for q in (Q, moved))
    loop.step(state_at(S, Q), S)
    loop.leave()
    loop.forget()
    sent = loop.step(state_at(9 * S, moved), 9 * S)
    expected = np.where(
        before * after > 0.0, np.sign(before) * np.minimum(np.abs(before), np.abs(after)), 0.0
    )
    assert compensated or ((np.abs(after - before) > 1.0).any() and (before * after < -1.0).any())
    np.testing.assert_allclose(sent.effort, expected, atol=1e-9)


def test_states_without_stamps_or_with_an_old_joint_are_rejected(strong):
    """The age of such a state is unknown; a joint that is older than the others makes its state
    late.
    """
    loop = slow_loop_of(strong)
    assert loop.step(state_at(S, Q)._replace(stamp_is_receive_time=True), S) is None
    assert "without stamps" in loop.supervisor.reason
    for oldest, late in ((-20, False), (-25, True)):
        loop = slow_loop_of(strong)
        assert loop.step(state_at(S, Q), S + 21 * MS) is None
        _, stamp = settle(loop)
        loop.step(
            RobotState(Q, np.zeros(6), None, stamp + MS, stamp + MS + oldest * MS, False),
            stamp + MS,
        )
        assert (loop.supervisor.phase == phases.HOLDING) == late
        assert not late or "too old: 0.025 s" in loop.supervisor.reason


def test_the_energy_limit_holds_under_a_push(strong):
    values = {"energy_limit": 0.5, "observer_gain": 60.0, "effort_rate": ["*=1e5"]}
    loop = slow_loop_of(strong, initial_mode="gravity_compensation", **values)
    simulation = dd.Simulation(strong, q=Q)
    energies = []
    limited = set()
    for k in range(700):
        sent = loop.step(state_at(S + k * MS, simulation.q, simulation.qd), S + k * MS)
        simulation.advance(
            sent.effort, f_ext={"tool0": (0, 30.0, 20.0, 0, 0, 0)} if k > 50 else None
        )
        energies.append(loop.energy)
        limited.add((sent.energy_limited, sent.contact_limited))
    assert 0.4 < max(energies) < 1.02 * 0.5
    assert limited == {(False, False), (True, False)}


@pytest.mark.parametrize(
    ("timeout", "scale", "age", "expected"),
    [
        (0.5, None, 0, 0.0),
        (0.5, 0.6, 500, 0.6),
        (0.5, 0.6, 501, 0.0),
        (0.5, 0.6, -1, 0.0),  # of a clock that went back
        (0.0, None, 0, 1.0),
        (0.0, 0.6, 10**6, 0.6),
    ],
)
def test_the_scale_of_contact_speeds(strong, timeout, scale, age, expected):
    """With a timeout a missing or stale scale stops every point that has a limit."""
    points = dd.ContactPoints(
        strong, [("tool", "tool0")], dd.ContactLimits({"hand": {"energy": 1.0}})
    )
    values = {"contact_limits.scale_timeout": timeout}
    loop = control_loop(strong, points=points, **values)
    if scale is not None:
        loop.take_scale(scale, S)
    loop.step(state_at(S + age * MS, Q), S + age * MS)
    assert loop.limits.contact.scale == expected
    with pytest.raises(InputError, match=r"scale is 1\.1"):
        loop.take_scale(1.1, S)
    with pytest.raises(InputError, match="expected contact limits"):
        slow_loop_of(strong).take_scale(0.5, S)


def test_targets_end_with_a_stall_longer_than_the_hold(strong):
    """After a stall of the node longer than the hold the measured position is the target."""
    loop = slow_loop_of(strong, hold_time=0.3, following_energy=0.0)
    _, stamp = settle(loop)
    loop.take_set_point(Q + 0.1)
    _, stamp = settle(loop, stamp=stamp + MS, cycles=200)
    for gap, is_held in ((320 * MS, True), (321 * MS, False)):
        stamp += gap
        sent = loop.step(state_at(stamp, Q), stamp)
        assert sent.command.error.any() == is_held


@pytest.mark.parametrize(
    ("mode", "text"),
    [
        (TRACKING, "joint 'elbow_joint' is 0.1 rad from its target"),
        (POSE, "link 'tool0' is 0.1 m from its target"),
    ],
)
def test_a_target_that_is_not_reached_is_named(strong, mode, text):
    """Friction holds the arm. It is named two seconds after the target has come to rest, until it
    arrives.
    """
    loop = slow_loop_of(strong, following_energy=0.0, controlled_link="tool0", initial_mode=mode)
    _, stamp = settle(loop)
    goal = Q + 0.1 * np.eye(6)[2]
    position, axes = pose_of(Q)
    if mode == TRACKING:
        loop.take_set_point(goal)
    else:
        loop.take_pose("base_link", position - [0.1, 0.0, 0.0], axes)
    texts = []
    for _ in range(800):
        stamp += 10 * MS
        loop.step(state_at(stamp, Q), stamp)
        texts.append(loop.shortfall)
    assert set(texts) == {"", text} and texts.index(text) > 200
    if mode == TRACKING:
        loop.step(state_at(stamp + MS, goal), stamp + MS)
    else:
        loop.take_pose("base_link", position, axes)
        loop.step(state_at(stamp + MS, Q), stamp + MS)
    assert loop.shortfall == ""


def test_a_law_that_fails_does_not_hold_for_ever(strong, monkeypatch):
    """States without a command count as missing states."""
    loop = slow_loop_of(strong, hold_time=0.3)
    _, stamp = settle(loop)

    def fails(*_):
        raise ZeroDivisionError

    monkeypatch.setattr(loop.modes[TRACKING], "command", fails)
    for k in range(300):
        with pytest.raises(ZeroDivisionError):
            loop.step(state_at(stamp + k * MS, Q), stamp + k * MS)
        loop.without_state(stamp + k * MS, "internal error")
    assert loop.supervisor.phase == phases.HOLDING
    loop.without_state(stamp + 300 * MS, "internal error")
    assert loop.supervisor.phase == phases.RAMPING_DOWN


def test_a_robot_that_carries_itself_is_controlled_as_far_as_its_limits_go(strong):
    """While a limit shrinks below the weight efforts stay continuous, and an effort that reduces
    the load passes.
    """
    gravity = gravity_of(Q)
    lift = int(np.argmax(np.abs(gravity)))
    for direction in (1.0, -1.0):  # upward, which is braked downward, and the other way round
        qd = np.zeros(6)
        qd[lift] = direction * 0.3 * np.sign(gravity[lift])
        efforts = []
        for part in np.linspace(1.3, 0.8, 101):
            values = {"initial_mode": "damping", "effort_rate": ["*=1e9"], "limit_margin": 0.0}
            limit = [f"{strong.dof_names[lift]}={part * abs(gravity[lift])}"]
            sent, _ = settle(
                slow_loop_of(strong, True, effort_limit=limit, **values), qd=qd, cycles=3
            )
            efforts.append(sent.effort[lift] * np.sign(gravity[lift]))
        efforts = np.array(efforts)
        assert np.abs(np.diff(efforts)).max() < 0.006 * abs(gravity[lift])
        free = pinocchio_command("damping_10", Q, qd, None)[lift] - gravity[lift]
        assert (
            efforts[0] == pytest.approx(free * np.sign(gravity[lift]), rel=1e-9) and abs(free) > 5.0
        )
        assert (efforts == efforts[0]).all() if direction > 0.0 else not efforts[-1]


ORIGIN, UPRIGHT, REST = np.zeros(3), np.eye(3), np.zeros(6)
FAR = Q + np.array([0.0, 0.0, 1.8, 0.0, 0.0, 0.0])
THERE = Q + np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])


def follow(points, stamp=0):
    return lambda loop: loop.take_trajectory(waypoints(points), stamp, 2 * S)


@pytest.mark.parametrize(
    ("mode", "take", "key"),
    [
        (TRACKING, lambda loop: loop.take_set_point(FAR), "'elbow_joint' is 3.2"),
        (TRACKING, lambda loop: loop.take_set_point(Q[:5]), r"^set_point\.position "),
        (TRACKING, lambda loop: loop.take_set_point([*Q[:5], np.nan]), r"^set_point\.position "),
        (
            TRACKING,
            follow([(1.0, Q), (2.0, FAR)]),
            r"points\[1\].positions of joint 'elbow_joint' is 3.2",
        ),
        (TRACKING, follow([(1.0, Q)], 13 * S), "stamp is 11 s in the future"),
        (
            TRACKING,
            follow([(0.05, THERE)]),
            r"'shoulder_lift_joint' move at 20; expected at most 3\.15: its velocity limit",
        ),
        # The maximum of a cubic is 1.5 times its mean.
        (
            TRACKING,
            follow([(1.0, Q, REST), (1.4, THERE, REST)]),
            r"'shoulder_lift_joint' move at 3\.75; expected",
        ),
        (
            TRACKING,
            follow([(0.0, Q + 0.06), (9.0, THERE)]),
            r"begins 0\.06 from where joint '\w+' is",
        ),
        (
            TRACKING,
            follow([(1.0, Q, [1e308, *REST[1:]]), (2.0, Q, REST)]),
            r"points\[0\].velocities .* is 1e\+308",
        ),
        (
            TRACKING,
            lambda loop: loop.take_pose("base_link", ORIGIN, UPRIGHT),
            "in mode tracking; expected mode pose",
        ),
        (POSE, follow([(1.0, Q)]), "in mode pose; expected mode tracking or regulation"),
        (POSE, lambda loop: loop.take_pose("wing", ORIGIN, UPRIGHT), "'wing'; expected"),
        (
            POSE,
            lambda _: received.pose(
                SimpleNamespace(
                    pose=SimpleNamespace(
                        position=None, orientation=SimpleNamespace(x=0.0, y=0.0, z=0.0, w=3.0)
                    )
                )
            ),
            "orientation is",
        ),
    ],
)
def test_targets_that_are_refused(arm, mode, take, key):
    """The target before stays in force."""
    loop = loop_of(arm, initial_mode=mode)
    loop.limits.reset(gravity_of(Q))
    _, stamp = settle(loop, cycles=5)
    with pytest.raises(InputError, match=key):
        take(loop)
    sent = loop.step(state_at(stamp + MS, Q), stamp + MS)
    assert (
        np.abs(np.concatenate(sent.command.error) if mode == POSE else sent.command.error).max()
        < 1e-9
    )


@pytest.mark.parametrize("away", [0.0, 0.06])
def test_a_trajectory_begins_at_the_target_or_at_the_robot(arm, away):
    """Of a robot that is 0.06 rad off its target both are near enough."""
    loop = loop_of(arm, following_energy=0.0)
    loop.limits.reset(gravity_of(Q))
    _, stamp = settle(loop, cycles=5)
    loop.step(state_at(stamp + MS, Q + 0.06), stamp + MS)
    follow([(0.0, Q + away), (9.0, THERE)])(loop)
    assert loop.following.outcome is None


CYCLES = """
import sys
from types import SimpleNamespace
import numpy as np
import diag_dynamics as dd
from diag_dynamics.control.loop import ControlLoop
from diag_dynamics.control.references import Waypoints
from diag_dynamics.joint_states.robot_joints import RobotState
from diag_dynamics.nodes.controller import received
from diag_dynamics.numerics import kernel
from diag_dynamics.parameters.controller import PARAMETERS

def compiled():
    entries = {
        entry.__name__
        for entry in kernel._entries
        if hasattr(getattr(entry, "run", None), "signatures")
    }
    callbacks = {entry.__name__ for entry in kernel._entries if "_compiled" in vars(entry)}
    return entries | callbacks

arm = dd.load_urdf(sys.argv[1])
points = dd.ContactPoints(arm, [("tool", "tool0")], dd.ContactLimits({"hand": {"energy": 1e-3}}))
values = {name: spec.default for name, spec in PARAMETERS.items()} | {"controlled_link": "tool0"}
values |= {"effort_rate": ["*=1e9"], "observer_gain": 20.0}
values |= {"energy_limit": 1e-3, "energy_rate": 1.0}
values |= {"joint_energy_limit": ["*=1"], "tank_energy": 1.0}
loop, time, limited = ControlLoop(arm, values, False, points), 10**9, set()
q = np.array([0.3, -1.2, 1.4, -0.6, 0.5, 0.2])
q[2] = arm.upper[2] - 0.099  # in the margin of a limit
first = compiled()
one, nothing = np.ones(1, bool), np.zeros((1, 6))
still = Waypoints(np.ones(1), q[None], nothing, nothing, one, one)
for mode in loop.modes:
    loop.switch(mode)
    for k in range(9):
        time += 10**6
        qd = np.full(6, 0.005 if k in (1, 2) else 0.2)  # a mode begins when the arm stands
        sent = loop.step(RobotState(q, qd, None, time, time, False), time)
        limited |= {name for name in ("energy_limited", "contact_limited") if getattr(sent, name)}
        if mode == "pose" and k == 3:
            loop.take_pose("forearm_link", (0.1, 0.2, 0.3), np.eye(3))
        if mode in ("tracking", "regulation") and k == 3:
            loop.take_set_point(q - 0.1)
        if mode in ("tracking", "regulation") and k == 6:
            loop.take_trajectory(still, 0, time)
    assert not loop.is_braking
loop.without_state(time + 10**6, "late")
loop.leave()
assert limited == {"energy_limited", "contact_limited"}, limited
print(*sorted(compiled() - first))
"""


def test_no_cycle_compiles():
    """The constructor has compiled all that cycles and targets call: no cycle waits for the
    compiler.
    """
    command = [sys.executable, "-c", CYCLES, str(robot(UR5).path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=HANG)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []


def test_without_velocity_limits_trajectories_are_slow():
    """The limit is then one radian per second."""
    loop = loop_of(dd.load_urdf(re.sub(r' velocity="[^"]*"', ' velocity="0"', robot(UR5).urdf)))
    loop.limits.reset(gravity_of(Q))
    settle(loop, cycles=5)
    with pytest.raises(InputError, match="expected at most 1: its velocity limit, or 1 without"):
        follow([(0.1, Q + 0.5)])(loop)


def test_a_pose_in_the_axes_of_a_moving_link(strong):
    """The frame is taken where it is when the target comes: a step of the tool along its own axes,
    computed by Pinocchio.
    """
    loop = slow_loop_of(strong, initial_mode=POSE)
    _, stamp = settle(loop)
    loop.take_pose("tool0", np.array([0.1, 0.0, -0.2]), np.eye(3))
    sent = loop.step(state_at(stamp + MS, Q), stamp + MS)
    axes = loop.dynamics.placement(Q, "tool0")[:3, :3]
    np.testing.assert_allclose(sent.command.error.position, axes @ [0.1, 0.0, -0.2], atol=1e-12)
    np.testing.assert_allclose(sent.command.error.orientation, 0.0, atol=1e-9)


# --- The loop closed by a simulated arm


GOALS = [0.3, -1.5, 1.04, -0.6, 0.5, 0.2], [0.3, -2.2, 0.2, -0.6, 0.5, 0.2], Q + 1.0, Q - 1.0


@pytest.mark.parametrize("goal", list(some_of(GOALS, 2)))
def test_the_arm_goes_to_a_set_point_and_is_not_thrown_at_it(arm, goal):
    """With the defaults, whose effort rate is slower than the law: a quarter of the speed limit,
    and no overshoot.
    """
    closed = Closed(arm, Q).go(0.1)
    goal = np.array(goal)
    closed.loop.take_set_point(goal)
    closed.go(7.0)
    beyond = (np.array(closed.way) - goal) * np.sign(goal - Q)
    assert beyond[:, goal != Q].max() < 1e-3 and not closed.lost
    assert (closed.fastest <= 0.26 * arm.velocity_limit + 0.02).all()
    np.testing.assert_allclose(closed.plant.q, goal, atol=1e-6)


def test_a_target_does_not_run_away_from_an_arm_that_is_held(arm):
    """Efforts of a held arm grow only to the bound of V; after its release it goes to the
    target.
    """
    loop = loop_of(arm)
    goal = Q + np.array([0.4, 0.3, -0.4, 0, 0, 0])
    stamp = S
    for k in range(6000):
        stamp += MS
        sent = loop.step(state_at(stamp, Q), stamp)
        if k == 200:
            loop.take_set_point(goal)
        assert not sent.lost
    assert 1.0 < sent.command.lyapunov < 2.0 and np.abs(sent.command.error).max() < 0.2
    closed = Closed(arm, Q)
    closed.loop = loop
    closed.stamp = stamp
    closed.go(6.0)
    np.testing.assert_allclose(closed.plant.q, goal, atol=1e-5)
    assert closed.most < 2.5
    beyond = (np.array(closed.way) - goal) * np.sign(goal - Q)
    assert beyond[:, :3].max() < 0.02


AWAY = (0.0, 0.1, -0.1), (-0.2, 0.1, 0.1), (2.0, 0.0, 0.0), (0.0, 0.0, 0.0)


@pytest.mark.parametrize("away", list(some_of(AWAY, 2)))
def test_a_pose_is_gone_to_and_the_arm_is_not_thrown_at_it(arm, away):
    """With the defaults, turned by a radian as well: within a half of the speed limits; out of
    reach it comes to rest.
    """
    closed = Closed(arm, Q, initial_mode="pose", controlled_link="tool0").go(0.1)
    placed = closed.loop.dynamics.placement(Q, "tool0")
    axes = placed[:3, :3] @ pin.exp3(np.array([1.0, 0.0, 0.0]))
    goal = placed[:3, 3] + away
    closed.loop.take_pose("base_link", goal, axes)
    closed.go(0.1)
    np.testing.assert_allclose(
        closed.sent.command.error.position, away, atol=0.02
    )  # of the goal, not of the way
    assert closed.sent.lyapunov_rate is None
    closed.go(shortened(10.0, 8.0))
    error = closed.sent.command.error
    out_of_reach = away[0] > 1.0
    assert (closed.fastest <= 0.6 * arm.velocity_limit).all() and closed.most < 2.0
    assert np.abs(closed.plant.qd).max() < 5e-2
    assert out_of_reach or (
        np.linalg.norm(error.position) < 2e-3 and np.linalg.norm(error.orientation) < 2e-3
    )
    assert out_of_reach or closed.sent.lyapunov_rate is not None
