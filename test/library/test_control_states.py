# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Decision table of the control loop: next state and command for every state and event; its clocks
and timeouts.
"""

import re

import numpy as np
import pytest

import diag_dynamics as dd
from arm import control_loop, gravity_of, state_at
from described import MS, UR5, S, robot
from diag_dynamics.control.modes import DAMPING, GRAVITY_COMPENSATION, TRACKING
from diag_dynamics.control.supervisor import HOLDING, INACTIVE, RAMPING_DOWN, Supervisor
from diag_dynamics.exceptions import InputError

Q, REST, MOVING = np.array([0.3, -1.2, 1.4, -0.6, 0.5, 0.2]), np.zeros(6), np.full(6, 0.9)
AGE, HOLD, RATE = 20, 300, 400.0
"""max_state_age and hold_time [ms], effort_rate [N m/s]."""

EVENTS = "valid", "carried", "invalid", "timeout"
TABLE = """
                valid          carried      invalid        timeout
WAITING         STARTING       ACTIVE       WAITING        WAITING
STARTING        STARTING       ACTIVE       HOLDING_START  RAMPING_DOWN
ACTIVE          ACTIVE         ACTIVE       HOLDING        RAMPING_DOWN
HOLDING_START   STARTING       ACTIVE       HOLDING_START  RAMPING_DOWN
HOLDING         ACTIVE         ACTIVE       HOLDING        RAMPING_DOWN
RAMPING_DOWN    STARTING       ACTIVE       RAMPING_DOWN   RAMPING_DOWN
"""
ROWS = [line.split() for line in TABLE.strip().splitlines()[1:]]
CASES = [
    (row[0], event, after) for row in ROWS for event, after in zip(EVENTS, row[1:], strict=True)
]

PATHS = {
    "WAITING": [],
    "STARTING": ["valid"],
    "ACTIVE": ["carried"],
    "HOLDING_START": ["valid", "invalid"],
    "HOLDING": ["carried", "invalid"],
    "RAMPING_DOWN": ["carried", "timeout"],
}
"""Events from the beginning to each state."""

PHASES = {"WAITING": 0, "STARTING": 1, "ACTIVE": 1, "HOLDING_START": 2, "HOLDING": 2}
PHASES["RAMPING_DOWN"] = 3
"""As in ControllerStatus."""
STARTS = "STARTING", "HOLDING_START"
STATES = {(phase, name in STARTS): name for name, phase in PHASES.items()}
"""State by phase, and by whether the loop is starting."""


@pytest.fixture(scope="module")
def strong():
    """Return a UR5 that is strong enough for anything."""
    return dd.load_urdf(re.sub(r'effort="[^"]*"', 'effort="1e4"', robot(UR5).urdf))


class Driven:
    """A loop that is driven by events; `sent` is the answer to the last one."""

    def __init__(self, arm, compensated=False, mode=DAMPING, hold=HOLD, margin=0.0):
        values = {"hold_time": hold * 1e-3, "initial_mode": mode}
        values |= {"effort_rate": [f"*={RATE}"], "limit_margin": margin}
        self.loop = control_loop(arm, compensated, **values)
        self.now = S
        self.sent = None
        self.machine = 0.0
        self.hold = hold
        self.loop.supervisor._machine_time = lambda: self.machine

    @property
    def state(self):
        supervisor = self.loop.supervisor
        return STATES[supervisor.phase, supervisor.starting]

    def carry(self, q=Q):
        """Make the last effort that which carries the arm."""
        self.loop.limits.reset(gravity_of(q))

    def step(self, q=Q, qd=REST, period=MS):
        self.now += period
        self.sent = self.loop.step(state_at(self.now, q, qd), self.now)

    def without(self, period=MS):
        self.now += period
        self.machine += abs(period) * 1e-9
        self.sent = self.loop.without_state(self.now, "NaN")

    def go(self, event):
        """Let an event happen."""
        before = self.loop.state
        if event == "valid":  # efforts are far from gravity compensation: no step reaches it
            self.loop.limits.reset(np.zeros(6) if before is None else -gravity_of(Q))
            self.step()
        elif event == "carried":
            self.carry()
            self.step()
        elif event == "invalid":
            self.without()
        else:
            self.without()
            self.without(self.hold * MS)

    def reach(self, name):
        for event in PATHS[name]:
            self.go(event)
        assert self.state == name
        return self


def driven(arm, name, **options):
    return Driven(arm, **options).reach(name)


@pytest.mark.parametrize(("name", "event", "after"), CASES)
def test_states_and_events(strong, name, event, after):
    driver = driven(strong, name)
    driver.go(event)
    assert driver.state == after
    assert bool(driver.loop.supervisor.reason) == (driver.loop.supervisor.phase != 1)


@pytest.mark.parametrize("compensated", [False, True])
@pytest.mark.parametrize("name", [row[0] for row in ROWS])
def test_commands_of_states(strong, name, compensated):
    """Each state sends nothing, damping, the law, gravity compensation or zero; efforts go there at
    their rate.
    """
    compensated = compensated and "START" not in name  # such an arm needs no start
    driver = driven(strong, name, compensated=compensated, mode=GRAVITY_COMPENSATION, hold=3000)
    gravity = gravity_of(Q)
    law = name in ("STARTING", "ACTIVE")
    for _ in range(2 + int(np.abs(gravity).max() / RATE * 1000)):
        if name == "STARTING":
            driver.go("valid")
        elif name == "ACTIVE":
            driver.step(qd=MOVING)
        else:
            driver.without()
    if name == "WAITING":
        assert driver.sent is None
        return
    if name != "STARTING":
        goal = gravity * (name in ("ACTIVE", "HOLDING", "HOLDING_START") and not compensated)
        np.testing.assert_allclose(driver.sent.effort, goal, atol=1e-9)
    assert (driver.sent.command is not None) == law
    if name == "STARTING":  # brakes a moving arm, whatever the mode
        driver.step(qd=0.1 * MOVING)
        assert driver.sent.command.nu @ driver.sent.command.epsilon < 0.0
    elif law:
        assert not driver.sent.command.epsilon.any()


# --- Start


def test_a_start_lasts_until_the_efforts_carry_a_slow_arm(strong):
    """Not before they carry it; then until no joint is faster than a twentieth of its limit, at
    most for a second.
    """
    limit = strong.velocity_limit
    for factor, after in (
        (0.049, "ACTIVE"),
        (-0.049, "ACTIVE"),
        (0.051, "STARTING"),
        (-0.051, "STARTING"),
    ):
        driver = Driven(strong)
        driver.carry()
        driver.step(qd=factor * limit)
        assert driver.state == after
    for _ in range(1000):
        driver.carry()
        driver.step(qd=0.2 * limit)
    assert driver.state == "STARTING"
    driver.step(qd=0.2 * limit)
    assert driver.state == "ACTIVE"


def test_a_start_takes_the_rate_of_efforts(strong):
    """From zero on, the law begins when one step reaches gravity compensation; the arm that needs
    none is not damped.
    """
    driver = Driven(strong, mode=GRAVITY_COMPENSATION)
    cycles = 0
    while not cycles or driver.state == "STARTING":
        driver.step()
        cycles += 1
        assert np.abs(driver.sent.effort).max() <= RATE * 1e-3 * (cycles - 1) + 1e-9
    assert cycles == pytest.approx(np.abs(gravity_of(Q)).max() / RATE * 1e3, abs=2)
    driver = Driven(strong, compensated=True)
    driver.step()
    assert driver.state == "ACTIVE"


def test_no_spring_of_a_limit_delays_a_start_or_throws_the_arm(strong):
    """In the margin springs begin with the mode, also where one has pressed on a standing joint."""
    q = Q.copy()
    q[1] = strong.lower[1] + 0.05
    driver = Driven(strong, mode=TRACKING, margin=0.1)
    for _ in range(2000):
        driver.step(q)
    assert driver.state == "ACTIVE"
    assert np.abs(driver.sent.demand - gravity_of(q)).max() > 100.0
    driver.loop.switch(GRAVITY_COMPENSATION)
    driver.step(q)
    np.testing.assert_allclose(driver.sent.demand, gravity_of(q), atol=1e-9)


def test_a_start_goes_on_after_a_hold(strong):
    """The time for which the efforts carry the arm goes on, too; targets are refused until it is
    over.
    """
    driver = Driven(strong, mode=TRACKING)
    fast = 0.2 * strong.velocity_limit
    driver.carry()
    driver.step(qd=fast)
    driver.without()
    assert driver.state == "HOLDING_START"
    with pytest.raises(InputError, match="while the law is not in force: NaN"):
        driver.loop.take_set_point(Q)
    driver.carry()
    driver.step(qd=fast)
    with pytest.raises(InputError, match="came while braking"):
        driver.loop.take_set_point(Q)
    assert (
        driver.state == "STARTING"
        and driver.sent.command.error is None
        and driver.sent.lyapunov_rate is None
    )
    for _ in range(998):
        driver.carry()
        driver.step(qd=fast)
    assert driver.state == "STARTING"
    driver.step(qd=fast)
    assert driver.state == "ACTIVE"


def test_the_law_begins_where_a_start_ends(strong):
    """The target is the position at the end of the start, during which the arm may have sunk."""
    driver = Driven(strong, mode=TRACKING)
    driver.go("valid")
    driver.carry(Q + 0.01)
    driver.step(Q + 0.01)
    assert driver.state == "ACTIVE" and not driver.sent.command.error.any()


def test_a_start_after_the_ramp_is_a_new_one(strong):
    """The arm may have been moved: the time of an earlier start does not count."""
    driver = Driven(strong)
    fast = 0.2 * strong.velocity_limit
    driver.carry()
    driver.step(qd=fast)
    driver.go("timeout")
    driver.without(2 * S)
    driver.carry()
    driver.step(qd=fast)
    assert driver.state == "STARTING"


@pytest.mark.parametrize("name", ["WAITING", "RAMPING_DOWN"])
def test_no_start_outside_of_limits(strong, name):
    """A position beyond its limit counts as no valid state where a law would begin, and there
    alone.
    """
    for end, side in ((strong.upper, 1.0), (strong.lower, -1.0)):
        at_stop = Q.copy()
        beyond = Q.copy()
        at_stop[2] = end[2] + side * 0.049
        beyond[2] = end[2] + side * 0.051
        driver = driven(strong, name)
        driver.step(beyond)
        assert driver.loop.supervisor.phase == (0 if name == "WAITING" else 3)
        assert "'elbow_joint'" in driver.loop.supervisor.reason
        driver = driven(strong, name)
        driver.step(at_stop)
        assert driver.loop.supervisor.phase == 1
        driver = driven(strong, "ACTIVE")
        driver.step(beyond)
        assert driver.state == "ACTIVE"


# --- Mode switches


@pytest.mark.parametrize("name", ["HOLDING", "HOLDING_START"])
def test_a_mode_chosen_without_a_state(strong, name):
    """It is in force from the next state on, which is its target; without one it changes no
    effort.
    """
    driver = driven(strong, name)
    before = driver.loop.limits.sent.copy()
    driver.loop.switch(TRACKING)
    assert (
        driver.state == name
        and (driver.loop.limits.sent == before).all()
        and driver.loop.mode == TRACKING
    )
    driver.carry(Q + 0.2)
    driver.step(Q + 0.2)
    assert (
        driver.state == "ACTIVE"
        and not driver.sent.command.error.any()
        and driver.sent.lyapunov_rate is None
    )


def test_a_switch_voids_the_target_of_the_chosen_mode(strong):
    """The arm stays where it is, also where the mode had another target when it was last in
    force.
    """
    driver = driven(strong, "ACTIVE", mode=TRACKING)
    driver.loop.take_set_point(Q + 0.2)
    for _ in range(50):
        driver.step()
    assert driver.sent.command.error.any()
    for mode in (DAMPING, TRACKING):
        driver.loop.switch(mode)
        driver.step()
    assert not driver.sent.command.error.any() and driver.sent.lyapunov_rate is None


def test_the_cause_of_the_ramp_is_the_first_one():
    supervisor = outage(1000, -1020, -1320)
    supervisor.invalid(2000 * MS, "NaN")
    assert (supervisor.reason, supervisor.cause) == ("NaN", "late")
    supervisor.valid(2001 * MS)
    assert (supervisor.reason, supervisor.cause) == ("", "late")


def test_modes_that_are_rejected(strong):
    """Unknown modes, one without its link, and all of them while the loop has stopped."""
    for name, mode, reason in (
        ("ACTIVE", "wing", "mode is 'wing'"),
        ("ACTIVE", "pose", "'controlled_link' is empty"),
        ("RAMPING_DOWN", TRACKING, "no valid state yet: NaN"),
    ):
        driver = driven(strong, name)
        with pytest.raises(InputError, match=reason):
            driver.loop.switch(mode)
        assert driver.loop.mode == DAMPING


@pytest.mark.parametrize("compensated", [False, True])
def test_gravity_compensation_and_damping_after_the_ramp(strong, compensated):
    """The ramp ends in silence. An arm at rest gets gravity torque, a moving one is braked."""
    driver = driven(strong, "ACTIVE", mode=TRACKING, compensated=compensated)
    driver.loop.take_set_point(Q + 0.3)
    driver.go("timeout")
    for _ in range(300):
        driver.without()
    assert driver.sent.silent and not driver.sent.effort.any() and driver.loop.leave() is None
    driver.step(Q + 0.1, MOVING)
    assert driver.sent.command.nu @ driver.sent.command.epsilon < 0.0
    for _ in range(500):
        driver.step(Q + 0.1)
        assert not driver.sent.silent
    gravity = gravity_of(Q + 0.1) * (not compensated)
    np.testing.assert_allclose(driver.sent.effort, gravity, atol=1e-9)
    assert (driver.loop.mode, driver.loop.supervisor.cause) == (DAMPING, "NaN")
    driver.loop.switch(TRACKING)
    driver.step(Q + 0.1)
    assert not driver.sent.command.error.any() and not driver.loop.supervisor.cause


# --- Clocks and timeouts of an outage


def outage(*times):
    """Return a supervisor after times [ms]; there is no valid state at negative ones."""
    supervisor = Supervisor(AGE * 1e-3, HOLD * 1e-3, machine_time=lambda: 0.0)
    for time in times:
        if time > 0:
            supervisor.valid(time * MS)
        else:
            supervisor.invalid(-time * MS, "late")
    return supervisor


HELD = 1000, -1020, -1310, 1311
"""A hold that a valid state ends, 10 ms before the ramp."""


@pytest.mark.parametrize(
    ("times", "phase"),
    [
        ((1000, -1020, -1319), HOLDING),
        ((1000, -1020, -1320), RAMPING_DOWN),
        ((1000, -1500), HOLDING),  # the hold begins with the first event without a state
        # A valid state ends the hold, and shortens the outage by no more than its largest age.
        ((*HELD, -1331, -1361), RAMPING_DOWN),
        ((*HELD, -1331, -1360), HOLDING),
        ((*HELD, -1999, -2028), HOLDING),
        ((*HELD, -1999, -2029), RAMPING_DOWN),
        # Valid states in a row shorten it by their time.
        ((*HELD, 1611, -1612, -1911), HOLDING),
        ((*HELD, 1611, -1612, -1912), RAMPING_DOWN),
        # A clock that goes back adds nothing and removes nothing, in a hold and between states.
        ((1000, -1020, -1300, -20, -39), HOLDING),
        ((1000, -1020, -1300, -20, -40), RAMPING_DOWN),
        ((*HELD, 11, -11, -21), RAMPING_DOWN),
        ((*HELD, 11, -11, -20), HOLDING),
        # Nothing ends the ramp, and nothing before the first state begins a hold.
        ((1000, -1020, -1320, -1), RAMPING_DOWN),
        ((0, -9000), INACTIVE),
    ],
)
def test_the_time_of_an_outage(times, phase):
    assert outage(*times).phase == phase


def test_a_whole_hold_after_the_ramp():
    supervisor = outage(1000, -1020, -1320)
    supervisor.valid(1400 * MS)
    for time, phase in ((1401, HOLDING), (1700, HOLDING), (1701, RAMPING_DOWN)):
        supervisor.invalid(time * MS, "late")
        assert supervisor.phase == phase


@pytest.mark.parametrize(("hold", "timeout"), [(0.3, 1.0), (2.5, 2.5)])
def test_a_clock_that_stands_still(hold, timeout):
    """The hold ends by the time of the machine: after the hold time, and no less than a second; a
    tick begins it anew.
    """
    machine = [0.0]
    supervisor = Supervisor(0.02, hold, machine_time=lambda: machine[0])
    supervisor.valid(S)
    machine[0] = 50.0
    supervisor.invalid(S, "late")
    machine[0] += timeout
    supervisor.invalid(S, "late")
    assert supervisor.phase == HOLDING
    supervisor.invalid(S + 1, "late")
    machine[0] += timeout
    supervisor.invalid(S + 1, "late")
    assert supervisor.phase == HOLDING
    machine[0] += 0.01
    supervisor.invalid(S + 1, "late")
    assert supervisor.phase == RAMPING_DOWN
    assert "late; the clock stands still" in supervisor.cause


def test_the_ramp_while_the_clock_stands_still(strong):
    """Efforts go to zero at their rate by the time of the machine, and then there are none."""
    driver = Driven(strong)
    driver.carry()
    driver.step()
    driver.step()
    efforts = []
    while not driver.sent.silent:
        driver.machine += 0.004
        driver.sent = driver.loop.without_state(driver.now, "late")
        efforts.append(driver.sent.effort)
        assert driver.machine < 20.0
    held, ramp = np.split(efforts, [round(1.0 / 0.004)])
    np.testing.assert_allclose(held, np.tile(gravity_of(Q), (len(held), 1)), atol=1e-9)
    largest = 0.004 * RATE
    assert np.abs(np.diff(ramp, axis=0)).max() == pytest.approx(largest)
    assert len(ramp) == pytest.approx(np.abs(gravity_of(Q)).max() / largest, abs=4)


def test_the_ramp_of_a_clock_that_stood_still_goes_on():
    """A clock that moves again does not end it, though it never counted a whole hold."""
    machine = [0.0]
    supervisor = Supervisor(0.02, 0.3, machine_time=lambda: machine[0])
    supervisor.valid(S)
    supervisor.invalid(S, "late")
    machine[0] = 1.1
    supervisor.invalid(S, "late")
    supervisor.invalid(S + MS, "late")
    assert supervisor.phase == RAMPING_DOWN


def test_texts_of_the_age():
    supervisor = Supervisor(max_age=0.02, hold_time=0.5)
    assert supervisor.age_problem(S, S + 20 * MS) is supervisor.age_problem(S, S - 20 * MS) is None
    assert "is too old: 0.021 s" in supervisor.age_problem(S, S + 21 * MS)
    assert "is in the future: 0.021 s" in supervisor.age_problem(S, S - 21 * MS)
    assert "nothing on /clock" in supervisor.age_problem(S, 0)


def test_an_outage_within_the_hold_keeps_the_target(strong):
    """And the start of the outage is no step of V."""
    driver = driven(strong, "ACTIVE", mode=TRACKING)
    driver.loop.take_set_point(Q + 0.01)
    for _ in range(20):
        driver.step()
    for _ in range(100):
        driver.without()
        assert driver.sent.lyapunov_rate is None and driver.sent.command is None
    driver.step()
    assert (
        driver.state == "ACTIVE"
        and driver.sent.command.error.any()
        and driver.sent.lyapunov_rate is None
    )


# --- Robots that do not execute the commands


def test_an_arm_outside_of_its_limits_starts_within_them(strong):
    """Also where another controller has moved it there: until then gravity compensation goes on."""
    driver = driven(strong, "ACTIVE")
    driver.loop.not_executed = "controller 'x' is inactive"
    driver.step()
    driver.loop.not_executed = ""
    outside = Q.copy()
    outside[1] = strong.upper[1] + 0.06
    for _ in range(3):
        driver.step(outside)
        assert driver.loop.supervisor.phase == HOLDING
        assert "'shoulder_lift_joint' is" in driver.loop.supervisor.reason
        np.testing.assert_allclose(driver.sent.effort, gravity_of(outside), atol=1e-9)
    driver.go("carried")
    assert driver.state == "ACTIVE"


def test_a_new_mode_forgets_the_old_target(strong):
    """A trajectory of some joints that comes before the next state leaves the others where they
    are.
    """
    driver = driven(strong, "ACTIVE", mode=TRACKING)
    driver.step(Q + 0.1)
    driver.loop.switch(TRACKING)
    np.testing.assert_array_equal(driver.loop.desired.position, Q + 0.1)


# --- The end


@pytest.mark.parametrize("compensated", [False, True])
@pytest.mark.parametrize(
    ("name", "carries"),
    [("ACTIVE", True), ("STARTING", True), ("HOLDING", True), ("RAMPING_DOWN", False)],
)
def test_the_last_effort(strong, name, carries, compensated):
    """Gravity compensation; none before the first state and in a ramp."""
    assert Driven(strong).loop.leave() is None
    driver = driven(strong, name, compensated=compensated and name != "STARTING")
    compensates = compensated and name != "STARTING"
    effort = driver.loop.leave()
    assert (effort is None) != carries
    if carries:
        np.testing.assert_allclose(effort, gravity_of(Q) * (not compensates), atol=1e-9)
    driver.loop.forget()
    assert (
        driver.state == "WAITING"
        and driver.loop.state is None
        and driver.loop.without_state(driver.now, "late") is None
    )


# --- Efforts


def test_the_clock_of_efforts(strong):
    """A step back within the longest cycle is ignored; after a longer one the rate counts from
    there.
    """
    driver = driven(strong, "ACTIVE", mode=GRAVITY_COMPENSATION)
    driver.loop.limits.reset(np.zeros(6))
    for period, expected in ((-10, 0.0), (11, 0.4), (-101, 0.4), (1, 0.8)):
        driver.step(period=period * MS)
        assert np.abs(driver.sent.effort).max() == pytest.approx(expected, abs=1e-12)


def test_joints_that_their_effort_rate_limits(strong):
    """Each is named, and no other one."""
    driver = driven(strong, "ACTIVE", mode=GRAVITY_COMPENSATION)
    gravity = gravity_of(Q)
    driver.loop.limits.reset(np.zeros(6))
    driver.step()
    slow = np.abs(gravity) > RATE * 1e-3
    assert 0 < slow.sum() < 6
    assert driver.sent.saturated == tuple(np.array(strong.dof_names)[slow])
    driver.carry()
    driver.step()
    assert driver.sent.saturated == ()
    driver = Driven(dd.load_urdf(re.sub(r'effort="[^"]*"', 'effort="9"', robot(UR5).urdf)))
    driver.step()
    weak = tuple(np.array(strong.dof_names)[np.abs(gravity) > 9.0])
    assert driver.loop.stand_by(driver.now, "test").saturated == weak != ()


@pytest.mark.parametrize("compensated", [False, True])
def test_the_effort_that_acts_has_the_compensation_of_the_robot(strong, compensated):
    driver = driven(strong, "ACTIVE", compensated=compensated)
    driver.loop.limits.reset(np.ones(6))
    np.testing.assert_allclose(
        driver.loop.limits.acting, 1.0 + compensated * gravity_of(Q), atol=1e-9
    )
