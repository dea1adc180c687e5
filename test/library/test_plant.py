# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parts of the simulator without a node: drives, sensors, pace, pushes, lockstep, and the plant of
them.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import diag_dynamics as dd
from described import PANDA, robot
from diag_dynamics.exceptions import InputError, RejectedError
from diag_dynamics.parameters.simulator import PARAMETERS
from diag_dynamics.simulation.drives import (
    BRAKE,
    DRIVEN,
    TIMED_OUT,
    WAITING,
    ZERO,
    Drives,
    Pushes,
    Sensors,
)
from diag_dynamics.simulation.pace import MAX_LAG, Lockstep, Pace
from diag_dynamics.simulation.plant import Plant
from examples import examples

NAMES = ("shoulder", "elbow", "wrist")


@pytest.mark.parametrize("without", [ZERO, BRAKE])
def test_a_command_holds_until_the_next_one_or_its_timeout(without):
    """Each entry acts on its joint; a joint without an entry has no effort; after the timeout no
    joint has one.
    """
    drives = Drives(NAMES, ("wrist", "shoulder"), 0.0, without)
    assert drives.phase == WAITING
    assert not drives.effort(0.0).any()
    assert drives.braked == (without == BRAKE)
    drives.command([3.0, 1.0], 0.5)
    for time in (0.5, 1.0, 1e6):
        assert drives.effort(time).tolist() == [1.0, 0.0, 3.0]
        assert drives.phase == DRIVEN
        assert not drives.braked
    drives = Drives(NAMES, (), 0.1, without)
    drives.command([1.0, 2.0, 3.0], 5.0)
    assert drives.effort(5.099).tolist() == [1.0, 2.0, 3.0]
    for _ in range(3):
        assert not drives.effort(5.1).any()
        assert drives.phase == TIMED_OUT
        assert drives.braked == (without == BRAKE)
    assert drives.counts["commands timed out"] == 1
    drives.command([1.0, 2.0, 3.0], 6.0)
    assert drives.effort(6.05).tolist() == [1.0, 2.0, 3.0] and drives.phase == DRIVEN
    drives.forget()
    assert not drives.effort(6.06).any() and drives.phase == WAITING


VALUES = np.array([0.1, -2.0]), np.array([1.0, 0.5]), np.array([3.0, 0.0])


def test_noise():
    """Noise is white and has the given deviations; a restart repeats the errors."""
    sensors = Sensors(noise=(0.1, 2.0, 0.0))

    def measured():
        sensors.restart()
        return np.array([sensors.measure(*VALUES) for _ in range(4000)])

    error = measured() - np.array(VALUES)
    assert np.abs(error.mean(axis=0)).max() < 4 * 2.0 / np.sqrt(4000)
    np.testing.assert_allclose(error.std(axis=0), [[0.1, 0.1], [2.0, 2.0], [0.0, 0.0]], rtol=0.1)
    assert abs(np.corrcoef(error[1:, 0, 0], error[:-1, 0, 0])[0, 1]) < 0.1
    assert (measured() == measured()).all()


@examples(50)
@given(
    factor=st.sampled_from((0.25, 1.0, 8.0)),
    gaps=st.lists(st.floats(1e-5, 0.05) | st.floats(0.05, 2.0), min_size=1, max_size=60),
)
def test_pace(factor, gaps):
    """Simulated time is never ahead of the clock, and at most a step behind except for skipped
    whole steps.
    """
    period = 0.004
    step = 0.001
    pace = Pace(factor, period, step)
    now = 100.0
    steps = 0
    pace.resume(now, 7.0)
    for gap in gaps:
        now += gap
        taken = pace.steps(now, 7.0 + steps * step)
        assert taken >= 0 and taken * step <= max(MAX_LAG, 2 * period) + step
        steps += taken
        behind = (now - 100.0) * factor - pace.dropped - steps * step
        assert -1e-6 <= behind < step + 1e-6
        assert (
            now - (step + 1e-6) / factor
            < 100.0 + (steps * step + pace.skipped) / factor
            < now + 1e-6
        )
    assert pace.dropped / step == pytest.approx(round(pace.dropped / step))
    assert Pace(0.0, period, step).steps(now, 7.0) == 4


def test_clock_that_jumps_back():
    """Simulated time goes on from where it is."""
    pace = Pace(1.0, 0.01, 0.001)
    pace.resume(50.0, 0.0)
    assert pace.steps(50.5, 0.0) > 0
    taken = pace.steps(10.0, 0.5)
    assert taken <= 10 and pace.dropped == pytest.approx(0.49, abs=0.02)
    assert 50.0 + 0.5 + 0.001 * taken + pace.skipped == pytest.approx(10.0, abs=0.002)
    assert pace.steps(10.02, 0.5 + 0.001 * taken) == pytest.approx(20, abs=10)


def test_pushes():
    """Each link's last wrench holds for its time; zeros end it; a rejected wrench changes
    nothing.
    """
    pushes = Pushes(("hand", "arm"), 0.5)
    assert pushes.at(0.0) == {}
    pushes.push("hand", (1, 2, 3, 4, 5, 6), 1.0)
    pushes.push("arm", (0, 0, 1, 0, 0, 0), 1.2)
    for link, bad, key in (
        ("foot", [1] * 6, "'foot' is no link"),
        ("arm", (math.nan, 0, 0, 0, 0, 0), "'arm'"),
    ):
        with pytest.raises(RejectedError, match=key):
            pushes.push(link, bad, 1.3)
    wrenches = {link: six.tolist() for link, six in pushes.at(1.49).items()}
    assert wrenches == {"hand": [1, 2, 3, 4, 5, 6], "arm": [0, 0, 1, 0, 0, 0]}
    assert list(pushes.at(1.5)) == ["arm"]
    pushes.push("arm", [0] * 6, 1.6)
    assert pushes.at(1.6) == {}
    assert pushes.counts["wrenches received"] == 5


DEFAULTS = {name: spec.default for name, spec in PARAMETERS.items()}


def plant(id=PANDA, floating=False, **values):
    """Return the plant of a robot."""
    return Plant(dd.load_urdf(robot(id).path, floating_base=floating), DEFAULTS | values)


@pytest.mark.parametrize(
    ("compensated", "commanded", "falls"), [(True, 0, False), (False, 0, True), (True, 1, True)]
)
def test_held_by_gravity_compensation(compensated, commanded, falls):
    """Drives that compensate gravity hold the robot; it moves without them, and with gravity
    commanded as well.
    """
    system = plant(compensates_gravity=compensated)
    q = system.simulation.q
    system.drives.command(commanded * system.simulation.dynamics.gravity_torque(q), 0.0)
    system.advance(200)
    moved = np.abs(system.simulation.q - q).max()
    assert moved > 0.05 if falls else moved < 1e-3


def test_brakes():
    """Brakes hold the robot exactly before the first command, and stop it after a time-out."""
    system = plant(without_command="brake", command_timeout=0.1)
    q = system.simulation.q
    system.advance(100)
    assert (system.simulation.q == q).all() and not system.simulation.qd.any()
    system.drives.command([0.0] * 8, system.time)
    system.advance(99)
    assert np.abs(system.simulation.qd).max() > 0.1
    for _ in range(200):
        system.advance(1)
    assert system.drives.phase == TIMED_OUT and not system.simulation.qd.any()


def test_no_time_out_while_catching_up():
    """A tick that catches up acts on the commands from before it began."""
    system = plant(command_timeout=0.05)
    system.drives.command([0.1] * 8, system.time)
    system.advance(85)
    assert system.drives.phase == DRIVEN
    system.drives.command([0.1] * 8, system.time)
    system.advance(10)
    assert system.drives.phase == DRIVEN and not system.drives.counts["commands timed out"]
    system.advance(41)
    system.advance(1)
    assert system.drives.phase == TIMED_OUT


@pytest.mark.parametrize(
    ("rate", "step", "own"), [(300.0, 1e-3, 1 / 1200), (500.0, 1e-3, 1e-3), (400.0, 0.1, 1 / 400)]
)
def test_steps_divide_the_period(rate, step, own):
    assert plant(rate=rate, step=step).simulation.step_size == pytest.approx(own, rel=1e-12)


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: Drives(NAMES, ("hip",), 0.0, ZERO), "names 'hip'"),
        (lambda: Drives(NAMES, ("wrist", "wrist"), 0.0, ZERO), "names 'wrist' twice"),
        (lambda: Sensors(noise=(1.0, 0.0)), "'sensor_noise' is"),
        (lambda: plant(real_time_factor=1e-16), "'real_time_factor' is 1e-16"),
        (lambda: plant(lockstep=True, motion="wave"), "'lockstep'"),
    ],
)
def test_bad_parameters(make, key):
    with pytest.raises(InputError, match=key):
        make()


def test_measured_joints():
    """A command beyond the URDF's limits is cut to them; a mimic joint is measured where its source
    joint is.
    """
    system = plant()
    system.drives.command([1e3] + [0.0] * 6 + [2.0], 0.0)
    system.advance(20)
    measured = system.measure()
    assert measured.effort[0] == 87.0 and system.simulation.saturated == ("panda_joint1",)
    leader, follower = (system.names.index(f"panda_finger_joint{k}") for k in (1, 2))
    assert measured.position[follower] == measured.position[leader] > 0.0
    assert measured.velocity[follower] == measured.velocity[leader] > 0.0
    assert measured.effort[follower] == 0.0


def test_same_seed_same_trajectory():
    """After a reset motion and noise are the same to the last bit; time continues."""
    system = plant(sensor_noise=[1e-3, 1e-2, 0.1], motion="wave")

    def measured():
        seen = []
        for _ in range(40):
            system.advance(2)
            m = system.measure()
            seen.append((m.position.tobytes(), m.velocity.tobytes(), m.effort.tobytes()))
        return seen

    first = measured()
    at = system.time
    system.reset()
    assert system.time == at and measured() == first and system.time == pytest.approx(2 * at)


def test_put():
    """Another state at the same time. A refused state changes nothing."""
    system = plant()
    system.advance(5)
    q = system.simulation.q + 0.01
    qd = 0.1 * np.ones(8)
    system.put(q, qd)
    beyond = q.copy()
    beyond[1] = 3.0
    for bad, rate, key in (
        (beyond, qd, "panda_joint2"),
        (q, np.full(8, 1e200), "finite|overflow|large"),
    ):
        with pytest.raises(InputError, match=key):
            system.put(bad, rate)
        assert (system.simulation.q == q).all() and (system.simulation.qd == qd).all()
    assert system.time == pytest.approx(0.005)
    assert plant(limits="none").put(beyond, qd) is None


def answered(lockstep, now):
    """Accept a command; return whether time continues."""
    lockstep.command(now)
    return lockstep.answered(now)


def synchronous():
    """Return a Lockstep with a listener and a commander after their first states and command."""
    lockstep = Lockstep()
    lockstep.begin(0.0)
    lockstep.meet({"listener", "commander"}, -10.0)
    lockstep.publish()
    answered(lockstep, 0.0)
    lockstep.publish()
    return lockstep


def test_a_state_that_all_have_seen_is_not_repeated():
    lockstep = synchronous()
    assert not lockstep.waits(0.9) and lockstep.waits(1.1)
    assert not any(lockstep.repeat(now) for now in (0.5, 2.0, 100.0))


@pytest.mark.parametrize("doubt", ["newcomer", "refused", "answer to an earlier one", "several"])
def test_a_state_is_repeated(doubt):
    """Once a second until a command comes, when a peer may have missed it."""
    lockstep = synchronous()
    if doubt == "newcomer":
        lockstep.meet({"listener", "another commander"}, 0.3)
    elif doubt == "refused":
        lockstep.refuse()
    else:
        lockstep.publish()
        assert doubt == "several" or not answered(lockstep, 0.1)
    assert [lockstep.repeat(now) for now in (0.9, 1.2, 1.3)] == [False, True, False]
    assert answered(lockstep, 5.0)
    lockstep.publish()
    assert not lockstep.repeat(10.0)


def test_newcomers():
    """A command of a peer that left does not answer for a newcomer; after a restart all peers are
    newcomers.
    """
    lockstep = synchronous()
    lockstep.meet({"listener", "another commander"}, 0.3)
    assert answered(lockstep, 0.4)
    lockstep.publish()
    assert lockstep.repeat(1.5) and lockstep.repeat(2.6)
    lockstep = synchronous()
    lockstep.begin(20.0)
    lockstep.publish()
    lockstep.meet({"listener", "commander"}, 20.4)
    assert lockstep.repeat(21.1)
