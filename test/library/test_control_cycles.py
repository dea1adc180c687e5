# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parts of the controller, each by itself: settings, safety, and the loop they make up."""

import re

import numpy as np
import pytest

import diag_dynamics as dd
from arm import pinocchio_command, state_at, waypoints
from described import MS, UR5, S, robot
from diag_dynamics.assembly.assembler import RobotState
from diag_dynamics.control import supervisor as phases
from diag_dynamics.control.by_dof import by_dof, command_order, require_same_joints
from diag_dynamics.control.loop import ControlLoop
from diag_dynamics.control.modes import LAWS, MODES, POSE, TRACKING, DampingMode
from diag_dynamics.control.supervisor import Supervisor
from diag_dynamics.exceptions import InputError, UnsupportedError
from diag_dynamics.parameters.controller import PARAMETERS

NAMES = ("shoulder", "elbow", "wrist")


# --- settings


def test_entries_by_joint():
    assert by_dof("gain", ["elbow=2", "*=3"], NAMES).tolist() == [3.0, 2.0, 3.0]
    assert by_dof("limit", ["elbow=2"], NAMES, np.array([5.0, np.inf, 7.0])).tolist() == [5.0, 2.0, 7.0]
    for entries, said in (
        (["elbow=2"], "'gain' has no entry for joint 'shoulder'"),
        (["wing=2", "*=1"], "'gain' names 'wing'"),
        (["elbow=-2", "*=1"], "'gain' of 'elbow' is -2"),
    ):
        with pytest.raises(InputError, match=said):
            by_dof("gain", entries, NAMES)


def test_order_of_commands():
    """Every joint has its place, once; the effort controller's order is compared entry by entry."""
    assert command_order([""], NAMES) == (NAMES, [0, 1, 2])
    assert command_order(["wrist", "shoulder", "elbow"], NAMES)[1] == [2, 0, 1]
    for entries, said in (
        (["wrist", "shoulder"], "lacks joint 'elbow'"),
        ([*NAMES, "wing"], "names 'wing'"),
        ([*NAMES, "wrist"], "names 'wrist' twice"),
    ):
        with pytest.raises(InputError, match=said):
            command_order(entries, NAMES)
    require_same_joints(NAMES, list(NAMES), "/effort_controller")
    with pytest.raises(InputError, match="entry 1 is 'elbow' here and 'wrist' there"):
        require_same_joints(NAMES, ["shoulder", "wrist", "elbow"], "/effort_controller")
    with pytest.raises(InputError, match="3 joints here, 2 there"):
        require_same_joints(NAMES, NAMES[:2], "/effort_controller")


# --- safety


def test_phases():
    """Nothing before the first state; then the law, the hold, the ramp; a valid state ends either, targets begin anew."""
    supervisor = Supervisor(max_age=0.02, hold_time=0.5, resumes=True)
    supervisor.invalid(S, "NaN")
    assert supervisor.phase == phases.INACTIVE and supervisor.reason == "NaN"
    assert supervisor.anew
    supervisor.valid(S)
    assert supervisor.phase == phases.ACTIVE and not supervisor.reason and not supervisor.anew
    supervisor.invalid(2 * S, "late")
    assert supervisor.phase == phases.HOLDING and supervisor.reason == "late"
    supervisor.invalid(2 * S + 499 * MS, "late")
    assert supervisor.phase == phases.HOLDING
    assert not supervisor.anew
    supervisor.valid(3 * S)
    supervisor.valid(3 * S + 500 * MS)
    supervisor.invalid(4 * S, "late")  # a hold of its own
    supervisor.invalid(4 * S + 499 * MS, "late")
    assert supervisor.phase == phases.HOLDING
    supervisor.invalid(4 * S + 500 * MS, "late")
    assert supervisor.phase == phases.RAMPING_DOWN
    supervisor.invalid(2 * S, "late")  # a clock that goes back does not make the arm stiff again
    assert supervisor.phase == phases.RAMPING_DOWN and supervisor.anew and not supervisor.latched
    supervisor.valid(S)
    assert supervisor.phase == phases.ACTIVE


def test_a_robot_that_was_given_up_stays_so():
    """Until somebody says otherwise while its states are valid; a state that fails once more takes that back."""
    supervisor = Supervisor(max_age=0.02, hold_time=0.5)
    supervisor.valid(S)
    supervisor.release()  # nothing to release
    for time in (S, 2 * S):
        supervisor.invalid(time, "late")
    assert supervisor.latched
    for _ in range(2):
        with pytest.raises(InputError, match=r"given up, and there is no valid state yet: late\."):
            supervisor.release()
        supervisor.wait()
        assert supervisor.latched and "choose a mode to go on. The robot was given up: late" in supervisor.reason
        supervisor.release()
        assert not supervisor.latched and supervisor.anew
        supervisor.invalid(3 * S, "late")
        assert supervisor.latched
    supervisor.wait()
    supervisor.release()
    supervisor.valid(S)
    assert supervisor.phase == phases.ACTIVE
    for time in (4 * S, 4 * S + 499 * MS):  # nothing is left of the hold before
        supervisor.invalid(time, "late")
        assert supervisor.phase == phases.HOLDING


def test_a_link_that_is_nearly_dead_does_not_prolong_the_hold():
    """A state now and then is no reason to hold on for ever; as many as are missing are."""
    for good, bad, end in ((1, 45, phases.RAMPING_DOWN), (20, 45, phases.RAMPING_DOWN), (50, 45, phases.HOLDING)):
        supervisor, time = Supervisor(max_age=0.02, hold_time=0.5), 0
        for _ in range(60):
            for _ in range(good):
                time += 10 * MS
                if not supervisor.latched:
                    supervisor.valid(time)
            for _ in range(bad):
                time += 10 * MS
                supervisor.invalid(time, "late")
        assert supervisor.phase == end, (good, bad)


@pytest.mark.parametrize(("period", "end"), [(6, phases.ACTIVE), (30, phases.ACTIVE), (100, phases.RAMPING_DOWN)])
def test_states_that_fail_or_are_slow_between_good_ones(period, end):
    """A good state counts for as long as it is fresh: late ones between are no end unless there are more of them."""
    supervisor, time = Supervisor(max_age=0.02, hold_time=0.5), 0
    for _ in range(300):
        if not supervisor.latched:
            supervisor.valid(time)
        for _ in range(period // 2 - 1):
            time += 2 * MS
            if period == 6 or time % (period * MS) > 20 * MS:
                supervisor.invalid(time, "late")
        time += 2 * MS
    if not supervisor.latched:
        supervisor.valid(time)
    assert supervisor.phase == end


def test_a_clock_that_stands_still_does_not_prolong_the_hold():
    """The machine's time counts then, with patience; a clock that goes on, however slowly, counts by itself."""
    machine = [0.0]
    supervisor = Supervisor(max_age=0.02, hold_time=0.5, machine_time=lambda: machine[0])
    supervisor.valid(S)
    for k in range(100):
        machine[0] += 0.9
        supervisor.invalid(S + k, "late")
    assert supervisor.phase == phases.HOLDING
    machine[0] += 0.9
    supervisor.invalid(S + 99, "late")
    assert supervisor.phase == phases.HOLDING
    machine[0] += 0.2
    supervisor.invalid(S + 99, "late")
    assert supervisor.phase == phases.RAMPING_DOWN
    supervisor.wait()
    assert "late; the clock stands still" in supervisor.reason


def test_a_clock_that_jumps_does_not_prolong_the_hold():
    """Two clocks in turn, as of two simulators: time that goes on is counted, whatever goes back in between."""
    supervisor = Supervisor(max_age=0.02, hold_time=0.5)
    supervisor.valid(S)
    for k in range(100):
        supervisor.invalid((k % 2) * 100 * S + k * MS, "late")
    assert supervisor.phase == phases.RAMPING_DOWN


def test_age_of_a_state():
    supervisor = Supervisor(max_age=0.02, hold_time=0.5)
    assert supervisor.age_problem(S, S + 20 * MS) is supervisor.age_problem(S, S - 20 * MS) is None
    assert "0.021 s old" in supervisor.age_problem(S, S + 21 * MS)
    assert "0.021 s in the future" in supervisor.age_problem(S, S - 21 * MS)
    assert "nothing on /clock" in supervisor.age_problem(S, 0)


# --- the loop


RATE = 400.0


@pytest.fixture(scope="module")
def arm():
    """A UR5 that is strong enough for anything."""
    return dd.load_urdf(re.sub(r'effort="[^"]*"', 'effort="1e4"', robot(UR5).urdf))


def loop_of(arm, compensated=False, **values):
    defaults = {name: spec.default for name, spec in PARAMETERS.items()}
    values = {"controlled_link": "tool0", "effort_rate": [f"*={RATE}"]} | values
    return ControlLoop(arm, defaults | values, compensated)


Q = np.array([0.3, -1.0, 1.2, -0.5, 0.4, 0.2])


def settle(loop, q=Q, qd=None, stamp=S, cycles=1000):
    """Send states until efforts have come to what the law asks for; returns the last command and its stamp."""
    for k in range(cycles):
        sent = loop.step(state_at(stamp + k * MS, q, qd), stamp + k * MS)
    return sent, stamp + (cycles - 1) * MS


@pytest.mark.parametrize("compensated", [False, True])
@pytest.mark.parametrize("mode", MODES)
def test_efforts_are_continuous_and_begin_at_zero(arm, mode, compensated):
    """From the first command on, across switches of mode, holds and ramps: never faster than the rate."""
    loop, rng = loop_of(arm, compensated, initial_mode=mode), np.random.default_rng(3)
    first = loop.step(state_at(S, Q), S)
    assert not first.effort.any()
    sent, stamp = settle(loop)
    assert not loop.taking_up
    last = sent.effort
    for k in range(400):
        stamp += MS
        if k % 37 == 0:
            loop.switch(MODES[rng.integers(len(MODES))])
        if k % 50 < 40:
            sent = loop.step(state_at(stamp, Q + 0.3 * rng.normal(size=6), rng.normal(size=6)), stamp)
        else:
            sent = loop.without_state(stamp, "NaN")
        assert np.abs(sent.effort - last).max() <= RATE * 1e-3 + 1e-9
        last = sent.effort
    assert not loop.taking_up


def test_a_switch_takes_the_state_for_the_target(arm):
    """At rest, every mode starts with the gravity torque: nothing pulls anywhere."""
    loop = loop_of(arm, initial_mode="damping", limit_margin=0.0)
    gravity = robot(UR5).oracle.at(Q, np.zeros(6), None).g
    _, stamp = settle(loop)
    for mode in MODES:
        loop.switch(mode)
        stamp += MS
        sent = loop.step(state_at(stamp, Q), stamp)
        np.testing.assert_allclose(sent.effort, gravity, atol=1e-10)
        assert sent.saturated == ()


@pytest.mark.parametrize("compensated", [False, True])
def test_hold_then_ramp(arm, compensated):
    """Without a valid state: gravity of the last one, whatever the law wanted and however fast the arm was; then zero.

    A robot that carries itself is sent zero throughout, and never what takes its own compensation away.
    """
    loop = loop_of(arm, compensated, initial_mode="damping", hold_time=0.3)
    assert loop.without_state(S, "NaN") is None
    _, stamp = settle(loop, qd=np.full(6, 0.3))
    held = (not compensated) * robot(UR5).oracle.at(Q, np.zeros(6), None).g
    sent = [loop.without_state(stamp + k * MS, "late") for k in range(1, 900)]
    for k in range(150, 300):
        np.testing.assert_allclose(sent[k].effort, held, atol=1e-10)
    assert loop.supervisor.phase == phases.RAMPING_DOWN
    size = np.array([np.abs(one.effort) for one in sent])
    assert (np.diff(size[300:], axis=0) <= 1e-12).all() and not size[-1].any()
    if not compensated:
        np.testing.assert_allclose(-np.diff(size[300:, 1])[:50], RATE * 1e-3, rtol=1e-9)
    # Valid states are taken note of, and no more; a mode that is chosen goes on with the state for a target.
    stamp += 900 * MS
    with pytest.raises(InputError, match="given up, and there is no valid state yet: late"):
        loop.switch(TRACKING)
    sent = loop.step(state_at(stamp, Q + 0.5, np.full(6, 0.3)), stamp)
    assert loop.supervisor.phase == phases.RAMPING_DOWN and not sent.effort.any() and sent.stamp == stamp
    assert loop.energy == pytest.approx(0.5 * 0.09 * robot(UR5).oracle.at(Q + 0.5, np.zeros(6), None).M.sum())
    assert "states are valid again; choose a mode" in loop.supervisor.reason
    loop.switch(TRACKING)
    sent = loop.step(state_at(stamp + MS, Q + 0.5), stamp + MS)
    assert loop.supervisor.phase == phases.ACTIVE and loop.taking_up == (not compensated)
    assert np.abs(sent.effort).max() <= RATE * 1e-3 + 1e-12
    sent, _ = settle(loop, Q + 0.5, stamp=stamp + 2 * MS)
    assert not loop.taking_up and not sent.command.error.any()


def test_it_may_go_on_by_itself(arm):
    """Where that has been asked for, the first valid state after the ramp puts the law in force."""
    loop = loop_of(arm, hold_time=0.3, resume_after_ramp=True)
    _, stamp = settle(loop)
    for k in range(900):
        loop.without_state(stamp + k * MS, "late")
    assert loop.supervisor.phase == phases.RAMPING_DOWN
    sent, _ = settle(loop, Q + 0.5, stamp=stamp + S)
    assert loop.supervisor.phase == phases.ACTIVE and not sent.command.error.any()


@pytest.mark.parametrize("compensated", [False, True])
def test_beginning_anew_goes_on_as_far_as_that_carries(arm, compensated):
    """Where the arm was moved meanwhile, no torque is repeated that does not carry it: none begins, none pulls down."""
    loop = loop_of(arm, compensated, initial_mode="gravity_compensation", effort_rate=["*=1e-3"], limit_margin=0.0)
    moved = np.array([0.3, -2.1, -1.2, 0.5, 0.4, 0.2])
    before, after = (robot(UR5).oracle.gravity_torque(q) * (not compensated) for q in (Q, moved))
    loop.step(state_at(S, Q), S)
    loop.leave()
    loop.forget()
    sent = loop.step(state_at(9 * S, moved), 9 * S)
    expected = np.where(before * after > 0.0, np.sign(before) * np.minimum(np.abs(before), np.abs(after)), 0.0)
    assert compensated or ((np.abs(after - before) > 1.0).any() and (before * after < -1.0).any())
    np.testing.assert_allclose(sent.effort, expected, atol=1e-9)


def test_states_without_stamps_are_none(arm):
    """How old they are cannot be told: a network that holds them back would go unnoticed."""
    loop = loop_of(arm)
    assert loop.step(state_at(S, Q)._replace(stamp_is_receive_time=True), S) is None
    assert "without stamps" in loop.supervisor.reason


def test_a_stall_does_not_let_efforts_jump(arm):
    """However long nothing was sent, efforts change no further than within the largest age of a state."""
    loop = loop_of(arm, initial_mode="gravity_compensation")
    loop.step(state_at(S, Q), S)
    sent = loop.step(state_at(5 * S, Q), 5 * S)
    assert np.abs(sent.effort).max() <= RATE * 0.02 + 1e-9


def test_targets_end_with_a_stall_longer_than_the_hold(arm):
    """Nobody holds or asks while the node is stopped; a state that comes after that is its own target all the same."""
    loop = loop_of(arm, hold_time=0.3, following_energy=0.0)
    _, stamp = settle(loop)
    loop.take_set_point(Q + 0.1)
    _, stamp = settle(loop, stamp=stamp + MS, cycles=200)
    for gap, held in ((320 * MS, True), (321 * MS, False)):
        stamp += gap
        sent = loop.step(state_at(stamp, Q), stamp)
        assert sent.command.error.any() == held


def test_a_law_that_fails_does_not_hold_for_ever(arm, monkeypatch):
    """States come, but no command can be found for them: that is held and given up as if none came."""
    loop = loop_of(arm, hold_time=0.3)
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


def test_targets_beyond_position_limits_are_refused(arm):
    """By joint and bound, set-points and every point of a trajectory."""
    loop = loop_of(arm)
    settle(loop)
    far = Q.copy()
    far[2] = 3.2
    with pytest.raises(InputError, match=r"'elbow_joint' is 3\.2, expected within its limits -3\.14159 … 3\.14159"):
        loop.take_set_point(far)
    with pytest.raises(InputError, match=r"points\[1\].positions of joint 'elbow_joint' is 3.2"):
        loop.take_trajectory(waypoints([(1.0, Q), (2.0, far), (3.0, Q)]), 0, S)


@pytest.mark.parametrize("position", [Q[:5], [[0.0] * 6], "up", None, 1.0, [*Q[:5], np.nan]])
def test_set_points_that_are_no_vector_are_refused(arm, position):
    """By name, and the target before stays."""
    loop = loop_of(arm)
    _, stamp = settle(loop)
    with pytest.raises(InputError, match=r"^set_point\.position .*expected (6 finite numbers|a finite number)"):
        loop.take_set_point(position)
    assert not loop.step(state_at(stamp + MS, Q), stamp + MS).command.error.any()


def test_too_old_a_state_is_no_state(arm):
    loop = loop_of(arm)
    assert loop.step(state_at(S, Q), S + 21 * MS) is None
    _, stamp = settle(loop)
    loop.step(state_at(stamp + MS, Q), stamp + 30 * MS)
    assert loop.supervisor.phase == phases.HOLDING and "0.029 s old" in loop.supervisor.reason


def test_no_joint_may_be_too_old(arm):
    """The law rests on all of them: one that is behind the others is as good as none."""
    loop = loop_of(arm)
    _, stamp = settle(loop)
    state = RobotState(Q, np.zeros(6), None, stamp + MS, stamp - 25 * MS, False)
    loop.step(state, stamp + MS)
    assert loop.supervisor.phase == phases.HOLDING and "0.026 s old" in loop.supervisor.reason


def test_a_robot_that_carries_itself_is_never_pulled_down(arm):
    """Joints whose weight is beyond their limit are left to the robot."""
    gravity = robot(UR5).oracle.gravity_torque(Q)
    assert np.abs(gravity).max() > 10.0
    loop = loop_of(arm, True, initial_mode="gravity_compensation", effort_limit=["*=10"], limit_margin=0.0)
    sent, _ = settle(loop)
    np.testing.assert_allclose(sent.effort, np.zeros(6), atol=1e-9)


def test_a_robot_that_carries_itself_is_controlled_as_far_as_its_limits_go(arm):
    """A limit that shrinks to less than the weight: efforts stay continuous, and what takes load away always passes."""
    gravity = robot(UR5).oracle.gravity_torque(Q)
    lift = int(np.argmax(np.abs(gravity)))
    for direction in (1.0, -1.0):  # upward, which is braked downward, and the other way round
        qd = np.zeros(6)
        qd[lift] = direction * 0.3 * np.sign(gravity[lift])
        efforts = []
        for part in np.linspace(1.3, 0.8, 101):
            values = {"initial_mode": "damping", "effort_rate": ["*=1e9"], "limit_margin": 0.0}
            limit = [f"{arm.dof_names[lift]}={part * abs(gravity[lift])}"]
            sent, _ = settle(loop_of(arm, True, effort_limit=limit, **values), qd=qd, cycles=3)
            efforts.append(sent.effort[lift] * np.sign(gravity[lift]))
        efforts = np.array(efforts)
        assert np.abs(np.diff(efforts)).max() < 0.006 * abs(gravity[lift])
        free = pinocchio_command("damping_10", Q, qd, None)[lift] - gravity[lift]
        assert efforts[0] == pytest.approx(free * np.sign(gravity[lift]), rel=1e-9) and abs(free) > 5.0
        assert (efforts == efforts[0]).all() if direction > 0.0 else not efforts[-1]


def test_effort_limits_above_the_description_s_are_refused():
    arm = dd.load_urdf(robot(UR5).path)
    with pytest.raises(InputError, match="'effort_limit' of 'wrist_1_joint' is 100, expected no more than the 28 of"):
        loop_of(arm, effort_limit=["*=28", "wrist_1_joint=100"])
    loop_of(arm, effort_limit=["*=28"])


def test_a_trajectory_far_ahead_is_refused(arm):
    """By a clock of another host, say: the arm would drift towards its first point for all that time."""
    loop = loop_of(arm)
    _, stamp = settle(loop)
    with pytest.raises(InputError, match="stamp is 11 s in the future, expected no more than 10 s"):
        loop.take_trajectory(waypoints([(1.0, Q)]), stamp + 11 * S, stamp)
    loop.take_trajectory(waypoints([(1.0, Q)]), stamp + 9 * S, stamp)


def test_limits_keep_direction(arm):
    """What moves the arm is scaled as a whole, gravity first; who limits is named."""
    loop = loop_of(arm, initial_mode="damping", effort_limit=["*=60"], effort_rate=["*=1e9"], limit_margin=0.0)
    sent, _ = settle(loop, qd=np.full(6, 2.0), cycles=2)
    gravity = robot(UR5).oracle.at(Q, np.zeros(6), None).g
    assert np.abs(sent.effort).max() == pytest.approx(60.0) and len(sent.saturated) == 1
    wanted, got = sent.command.tau - gravity, sent.effort - gravity
    np.testing.assert_allclose(got / np.linalg.norm(got), wanted / np.linalg.norm(wanted), atol=1e-9)


def test_targets_of_another_mode_are_refused(arm):
    """They say which mode they are for; without a law in force, or with another frame, they say that."""
    loop = loop_of(arm)
    target = np.zeros(3), (0.0, 0.0, 0.0, 1.0)
    with pytest.raises(InputError, match="set_point comes while the law is not in force: no valid state yet"):
        loop.take_set_point(Q)
    settle(loop)
    with pytest.raises(InputError, match="target is for mode pose, but tracking is in force"):
        loop.take_pose("base_link", *target)
    loop.switch(POSE)
    with pytest.raises(InputError, match="trajectory is for mode tracking, but pose is in force"):
        loop.take_trajectory(waypoints([(1.0, Q)]), 0, S)
    loop.take_pose("base_link", *target)
    with pytest.raises(InputError, match="'wing' is not a link"):
        loop.take_pose("wing", *target)
    with pytest.raises(InputError, match="orientation is"):
        loop.take_pose("base_link", target[0], (0.0, 0.0, 0.0, 3.0))
    with pytest.raises(InputError, match="'controlled_link' is empty"):
        loop_of(arm, controlled_link="").switch(POSE)


def test_a_law_of_ones_own_is_one_entry_of_the_table(arm, monkeypatch):
    """A mode that is listed is chosen by its name, takes its targets and is told of where another one is in force."""

    class Braked(DampingMode):
        name, targets = "braked", ("set_point",)

        def take_set_point(self, state, position):
            self.taken = position

    monkeypatch.setitem(LAWS, "braked", Braked)
    loop = loop_of(arm, initial_mode="braked")
    sent, _ = settle(loop, qd=np.full(6, 0.1))
    assert loop.mode == "braked" and sent.command.lyapunov_rate < 0.0
    loop.take_set_point(Q)
    assert loop.modes["braked"].taken is Q
    with pytest.raises(InputError, match="trajectory is for mode tracking, but braked is in force"):
        loop.take_trajectory(waypoints([(1.0, Q)]), 0, S)
    loop.switch(POSE)
    with pytest.raises(InputError, match="set_point is for mode tracking or braked, but pose is in force"):
        loop.take_set_point(Q)


def test_a_pose_in_the_axes_of_a_moving_link(arm):
    """The frame is taken where it is when the target comes: a step of the tool along its own axes, computed by Pinocchio."""
    loop = loop_of(arm, initial_mode=POSE)
    _, stamp = settle(loop)
    loop.take_pose("tool0", np.array([0.1, 0.0, -0.2]), (0.0, 0.0, 0.0, 1.0))
    sent = loop.step(state_at(stamp + MS, Q), stamp + MS)
    axes = loop.dynamics.placement(Q, "tool0")[:3, :3]
    np.testing.assert_allclose(sent.command.error.position, axes @ [0.1, 0.0, -0.2], atol=1e-12)
    np.testing.assert_allclose(sent.command.error.orientation, 0.0, atol=1e-9)


def test_the_limiter_follows_the_law_and_springs(arm):
    """Order of filters: what the springs put in is bounded as well; K no higher than the bound of a free arm's motion."""
    loop = loop_of(
        arm, initial_mode="gravity_compensation", energy_limit=0.5, observer_gain=60.0, effort_rate=["*=1e5"]
    )
    simulation, highest, stamp = dd.Simulation(arm, q=Q), 0.0, S
    tau = np.zeros(6)
    for k in range(1500):
        state = state_at(stamp + k * MS, simulation.q, simulation.qd)
        tau = loop.step(state, state.newest).effort
        simulation.advance(tau, f_ext={"tool0": (0, 30.0, 20.0, 0, 0, 0)} if k > 50 else None)
        highest = max(highest, loop.energy)
    assert 0.4 < highest < 1.02 * 0.5


def test_unactuated_bases_are_refused():
    model = dd.load_urdf(robot(UR5).path, floating_base=True)
    with pytest.raises(UnsupportedError, match="floating base"):
        loop_of(model)
