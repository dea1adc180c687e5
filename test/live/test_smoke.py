# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Smoke tests of the gate: nodes in processes of their own answer over DDS, and signals end them.

Each test publishes again while it waits, because the first messages get lost while processes
discover each other.
"""

import contextlib
import re
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from diag_dynamics.srv import ForwardDynamics
from std_msgs.msg import String

from controllers import Controller
from limits import HANG
from nodes import LATCHED, PANDA, UR5, Monitor, S, Truth, assert_close, robot
from processes import Process, node_process
from simulators import Simulator
from streams import FRAME, Stream, get

pytestmark = pytest.mark.live

EXAMPLES = Path(__file__).parents[2] / "examples"

RATE = 100
"""Of joint states in lockstep [Hz]."""

PERIOD = 5.0
ATTEMPTS = round(HANG / PERIOD)
"""Time [s] after which a message is published again, and how often."""


def served(monitor, robot, sample=0):
    """Publish a state until all topics answer it, check their numbers, and return them by topic.

    A monitor that got no processor for a second skips the states of that second.
    """
    q, qd, tau, _ = robot.samples[sample]
    for _ in range(ATTEMPTS):
        message = robot.message(monitor.tick(), (q, qd, tau))
        with contextlib.suppress(AssertionError):
            published = monitor.feed(message, timeout=PERIOD)
            break
    else:
        raise AssertionError(f"{monitor.name} answered none of {ATTEMPTS} states")
    Truth(robot, q, qd, tau).check(published, monitor.now)
    return published


@pytest.fixture(scope="module")
def monitors(peer):
    """Start the monitors of two robots, each in a namespace of its own."""
    ids = {"/left": PANDA, "/right": UR5}
    started = {
        space: Monitor(peer, space, robot_description=robot(id).path) for space, id in ids.items()
    }
    try:
        for namespace, id in ids.items():
            started[namespace].connect(robot(id))
        yield started
    finally:
        for monitor in started.values():
            monitor.process.popen.kill()


@pytest.fixture(scope="module")
def left(monitors):
    """Return the Panda's monitor."""
    return monitors["/left"]


def test_two_robots_are_answered(monitors, panda):
    """Each monitor publishes Pinocchio's numbers of its own robot, not by shared memory."""
    served(monitors["/left"], panda)
    served(monitors["/right"], robot(UR5), 1)
    assert "/dev/shm/fast" not in Path("/proc/self/maps").read_text()


def test_a_service_answers(left, panda):
    """Forward dynamics is Pinocchio's."""
    q, qd, tau, _ = panda.samples[0]
    response = left.call(
        ForwardDynamics,
        "forward_dynamics",
        ForwardDynamics.Request(state=panda.message(0, (q, qd, tau))),
    )
    assert response.success, response.message
    truth = Truth(panda, q, qd, tau)
    assert_close(
        response.acceleration * truth.unit, truth.state.acceleration * truth.unit, truth.tolerance
    )


def test_echo_prints_a_field(left, panda):
    """The program of the pages prints one field of one message."""
    command = [sys.executable, EXAMPLES / "echo.py", f"{left.name}/kinetic_energy"]
    with Process([*command, "--once", "--field", "total"]) as echo:

        def ended():
            served(left, panda)
            return not echo.alive()

        left.peer.wait_until(ended, "the end of echo")
        assert echo.wait() == 0
    K = left.topics["kinetic_energy"].messages[-1].total
    assert float(echo.output.split()[-1]) == pytest.approx(K, rel=1e-6)


def test_echo_names_the_fields(left):
    command = [sys.executable, EXAMPLES / "echo.py", f"{left.name}/kinetic_energy"]
    with Process([*command, "--field", "wrong"]) as echo:
        assert echo.wait(HANG) == 2, echo.tail()
    assert "--field is 'wrong'; expected one of header, dof_names" in echo.output


def test_echo_prints_a_latched_text(peer):
    """A text that was published before echo started is printed as it is, for example a URDF."""
    text = '<robot name="a">\n</robot>'
    publisher = peer.publisher(String, "/text", LATCHED)
    publisher.publish(String(data=text))
    command = [sys.executable, EXAMPLES / "echo.py", "/text", "--field", "data", "--once"]
    with Process(command) as echo:
        assert echo.wait(HANG) == 0, echo.tail()
    assert text in echo.output


def call(monitor, service, kind, request):
    """Return what the program of the pages prints about the response of a service."""
    command = [sys.executable, EXAMPLES / "call.py", f"{monitor.name}/{service}", kind, request]
    with Process(command) as process:
        assert process.wait(HANG) == 0, process.tail()
    return process.output


def test_call_sets_and_gets_parameters(left):
    """Requests have nested messages, lists of them, and whole numbers for real ones."""
    value = "{name: max_age, value: {type: 3, double_value: 20}}"
    kinds = "rcl_interfaces/srv/SetParameters", "rcl_interfaces/srv/GetParameters"
    assert "successful=True" in call(left, "set_parameters", kinds[0], f"{{parameters: [{value}]}}")
    assert "double_value=20.0" in call(left, "get_parameters", kinds[1], "{names: [max_age]}")


def test_the_page_is_served(left, panda):
    """The viewer node serves the page by HTTP, and a stream of frames: K is the state's."""
    with node_process("view", port=0) as view:
        view.wait_for_text("Showing robot 'panda'")
        address = re.search(r"Page: (\S+)\n", view.output)[1]
        status, headers, body = get(address, "/")
        assert status == 200
        assert headers["Content-Type"].startswith("text/html")
        assert b"<script" in body
        with Stream(address, robot="/left", hz=10) as stream:

            def frame():
                """Publish a state, and read the next packet: a frame, or the heartbeat that always
                comes.
                """
                served(left, panda)
                kind, content = stream.packet()
                return content if kind == FRAME else None

            shown = left.peer.wait_until(frame, "a frame")["K"]
    assert shown == np.float32(left.topics["kinetic_energy"].messages[-1].total)


def test_a_second_in_lockstep(peer):
    """Controller and simulator take turns for a second of simulated time: every message is of a
    step.

    Neither waits for this process, which may miss some of their messages.
    """
    order = list(robot(UR5).names)
    simulated = {"lockstep": True, "rate": float(RATE), "command_joints": order, "autostart": True}
    options = {
        "robot_compensates_gravity": False,
        "autostart": True,
        "use_sim_time": True,
        "command_joints": order,
    }
    with (
        Simulator(peer, "/lockstep", UR5, **simulated) as simulator,
        Controller(peer, "/lockstep", **options) as controller,
    ):
        peer.wait_until(lambda: controller.sent.messages, "a command")
        first = simulator.states.stamps[-1]
        sent = len(controller.sent.messages)
        peer.wait_until(
            lambda: (
                simulator.states.stamps[-1] >= first + S
                and len(controller.sent.messages) >= sent + RATE
            ),
            "a second of simulated time",
        )
        states = simulator.states.stamps
        statuses = controller.status.stamps
        assert {(stamp - first) % (S // RATE) for stamp in (*states, *statuses)} == {0}
        assert (np.diff(states) >= 0).all()  # a state that nobody answers is published again


@pytest.mark.parametrize(
    ("namespace", "number"), [("/left", signal.SIGINT), ("/right", signal.SIGTERM)]
)
def test_signals_end_monitors(monitors, namespace, number):
    """The last tests of the file: either signal ends a monitor with status 0."""
    monitors[namespace].process.stop(number)


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (["echo.py"], "arguments are required: topic"),
        (["call.py"], "arguments are required: service, type"),
        (["call.py", "/a", "os/path"], "TYPE is 'os/path'; expected the type of a service"),
        (["{wrong: 1}"], "REQUEST has 'wrong'; expected fields of state, base_pose, base_twist."),
        (["{state: {wrong: 1}}"], "REQUEST has 'wrong'; expected fields of header, name, position"),
        (["{state: {position: [a]}}"], "expected fields of the type. could not convert"),
        (["[1"], "expected fields of the type. while parsing a flow sequence in"),
        (["5"], "REQUEST is '5'; expected fields of the type."),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_arguments_are_named(arguments, error):
    """Usage and one cause, not a traceback."""
    if not arguments[0].endswith(".py"):
        arguments = ["call.py", "/a", "diag_dynamics/srv/SetState", *arguments]
    with Process([sys.executable, EXAMPLES / arguments[0], *arguments[1:]]) as process:
        assert process.wait(HANG) == 2
    assert process.output.startswith("usage: ") and error in process.output.splitlines()[-1]
