# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller in real time at 1 kHz: stalls, and what becomes of the robot when it is killed."""

import signal

import numpy as np
import pytest

from controllers import ACTIVE, START_AT, Controller, gravity_of, put, quiet, record
from limits import HANG
from nodes import MS, UR5, nanoseconds
from simulators import Simulator

pytestmark = [pytest.mark.full, pytest.mark.live]

TIMEOUT = 0.3
"""Time [s] without commands after which the drives close their brakes."""
STALL, STALLS = 50 * MS, 10
"""Time [ns, simulated] for which the controller is stopped, and the stalls that it has to
report.
"""


@pytest.fixture(scope="module")
def live(peer):
    """A UR5 at 1 kHz that carries itself and brakes without commands, and its controller, by the
    simulator's clock.
    """
    parameters = {
        "rate": 1000.0,
        "compensates_gravity": True,
        "command_timeout": TIMEOUT,
        "without_command": "brake",
        "real_time_factor": 0.9,
    }
    options = {
        "robot_compensates_gravity": True,
        "autostart": True,
        # the simulator lets time go where the machine is busy, and its stamps fall behind the clock
        "use_sim_time": True,
        "energy_limit": 0.5,
        "max_rate.status": 200.0,
        "hold_time": 10.0,  # on a busy machine nearly every state may be late for a while
        "effort_rate": ["*=400.0"],
    }
    with Simulator(peer, "/live", UR5, **parameters) as simulator:
        put(simulator, START_AT)
        quiet(simulator)
        with Controller(peer, "/live", **options) as controller:
            controller.simulator = simulator
            yield controller.connect()


def at_rest(live, since=0):
    """Wait until the law is in force and the robot rests, at a state with a later stamp."""

    def rests(s):
        return (
            nanoseconds(s.header.stamp) > since
            and s.phase == ACTIVE
            and s.energy < 1e-6
            and not s.saturated_dofs
        )

    live.wait_for(rests, "rest", HANG)


def test_stalls_are_survived_and_reported(live):
    """The controller is stopped for 50 ms again and again: the arm stays where it is, and
    diagnostics count the stalls.

    Its drives add what carries it: commands are next to nothing.
    """
    states = live.simulator.states
    put(live.simulator, START_AT)
    live.switch("damping")
    live.switch("tracking")
    at_rest(live)
    before = live.wait_for_report(lambda r: True, "a report")
    record(live)

    def counted(key):
        """Return the newest count; a report of one change has no others."""
        return max(report.count(key) for report in live.reports)

    def stalled():
        """Stop the controller once; a simulator that stands still, too, makes no stall."""
        live.process.signal(signal.SIGSTOP)
        begin = live.simulator.next_state()
        live.peer.wait_until(
            lambda: states.stamps[-1] >= nanoseconds(begin.header.stamp) + STALL, "the stall's end"
        )
        live.process.signal(signal.SIGCONT)
        sent = len(live.sent.messages)
        live.peer.wait_until(lambda: len(live.sent.messages) > sent + 20, "commands", HANG)
        return counted("stalls") >= before.count("stalls") + STALLS

    live.peer.wait_until(stalled, "reported stalls", HANG)
    content = [r.entries["commands"] for r in live.reports if "commands" in r.entries]
    assert any(
        "gaps between commands beyond max_state_age" in s.message and s.level == b"\1"
        for s in content
    )
    assert counted("commands") > before.count("commands")
    assert max(s.energy for s in live.status.messages) < 0.05
    positions = np.array([state.position for state in states.messages])
    assert np.abs(positions - positions[0]).max() < 0.05
    assert np.abs(gravity_of(START_AT)).max() > 30.0
    assert max(np.abs(message.data).max() for message in live.sent.messages[-100:]) < 5.0


def test_after_kill_9(live):
    """The drives' time-out is what is left: brakes close, the arm stands. A controller started anew
    takes it over.
    """
    simulator = live.simulator
    live.process.signal(signal.SIGKILL)
    live.process.popen.wait()
    report = simulator.wait_for_report(
        lambda r: (
            f"no command for command_timeout = {TIMEOUT:g} s" in r.entries["commands"].message
        ),
        "the time-out",
    )
    assert report.values["brakes"] == "closed"
    live.peer.wait_until(lambda: not np.any(simulator.next_state().velocity), "the brakes to hold")
    stood = simulator.next_state()
    live.start()
    at_rest(
        live, nanoseconds(stood.header.stamp)
    )  # what the one before has said may still be on its way
    live.wait_until_told("control", "mode tracking")
    simulator.wait_for_report(lambda r: r.values["brakes"] == "open", "open brakes")
    assert np.abs(np.array(simulator.next_state().position) - stood.position).max() < 0.1
