# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller's supervisor: how long a robot is held without valid states, and when it is given up."""

import pytest

from described import MS, S
from diag_dynamics.control import supervisor as phases
from diag_dynamics.control.supervisor import Supervisor
from diag_dynamics.exceptions import InputError


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
