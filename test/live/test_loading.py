# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes that load or compile: states, services and diagnostics go on, and a signal ends the
process.
"""

import os
import re
import signal
import sys
import threading
from contextlib import suppress

import psutil
import pytest
from diag_dynamics.srv import Diagonalize
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import String

from diag_dynamics.description.urdf import MAX_JOINTS
from diag_dynamics.nodes.support.statuses import OK
from diag_dynamics.numerics.progress import RULE
from nodes import LATCHED, PANDA, Monitor, Truth, description, robot
from processes import Process
from robots import description as urdf_of
from robots import joint, link

pytestmark = [pytest.mark.full, pytest.mark.live]

LARGE = MAX_JOINTS
"""Joints of a description that takes seconds to load; no test waits for its end."""


@pytest.fixture(scope="module")
def large():
    body = (1.0, (0.1, 0.2, 0.3), (0.1, 0, 0, 0.1, 0, 0.1))
    parts = [link("l0")]
    for k in range(LARGE):
        parts += [link(f"l{k + 1}", *body), joint(f"j{k}", "revolute", f"l{k}", f"l{k + 1}")]
    return urdf_of("large", *parts)


def start_loading(node, path, *more, **environment):
    """Start a node, and return its process when it loads its robot."""
    command = [sys.executable, "-m", "diag_dynamics", node, "--ros-args"]
    command += ["-p", f"robot_description:={path}"]
    process = Process([*command, *more], env={**os.environ, **environment})
    process.wait_for_text("Loading the robot")
    return process


def assert_signal_ends(process, number):
    """Assert that a signal ends a process within two seconds of its own CPU time."""
    running = psutil.Process(process.popen.pid)

    def cpu_time():
        times = running.cpu_times()
        return times.user + times.system

    begin = last = cpu_time()
    process.signal(number)
    with suppress(psutil.NoSuchProcess):
        while process.popen.poll() is None:
            last = max(last, cpu_time())
            threading.Event().wait(0.01)
    assert process.wait() == 0
    assert last - begin < 2.0
    assert "Traceback" not in process.output


def test_the_robot_in_force_goes_on(peer, large):
    """While another robot loads, the monitor answers states and requests; diagnostics name the
    loading.
    """
    panda = robot(PANDA)
    descriptions = peer.publisher(String, "/busy/robot_description", LATCHED)
    descriptions.publish(description(panda.urdf))
    with Monitor(peer, "/busy") as monitor:
        monitor.connect(panda)
        assert monitor.next_report().values["loading"] == "nothing"
        descriptions.publish(description(large))
        monitor.wait_for_report(lambda report: report.values["loading"] != "nothing", "loading")
        for k in range(100):
            monitor.serves(panda, k % 3)
        request = Diagonalize.Request(state=panda.message(0, panda.samples[0]))
        response = monitor.call(Diagonalize, "diagonalize", request)
        assert response.success, response.message
        Truth(panda, *panda.samples[0][:3]).check_state(response.state)
        report = monitor.next_report()
        assert report.values["loading"].startswith("a robot_description of ")
        assert report.values["robot"] == "panda"
        assert_signal_ends(monitor.process, signal.SIGTERM)  # while a thread still loads
        assert "robot 'large'" not in monitor.process.output


@pytest.mark.parametrize(
    ("node", "number"), [("monitor", signal.SIGTERM), ("simulator", signal.SIGINT)]
)
def test_signal_while_a_robot_is_loaded(large, tmp_path, node, number):
    path = tmp_path / "large.urdf"
    path.write_text(large, encoding="utf-8")
    with start_loading(node, path) as process:
        assert_signal_ends(process, number)
    assert "Ready" not in process.output


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_while_it_compiles(peer, tmp_path, number):
    """With an empty cache the monitor compiles for a minute; its log and /diagnostics name the
    kernel.
    """
    name = f"compiles_{int(number)}/diag_dynamics"
    reports = peer.topic(DiagnosticArray, "/diagnostics")

    def named():
        statuses = (status for array in reports.messages for status in array.status)
        return next((status for status in statuses if status.name == f"{name}: compiling"), None)

    namespace = "-r", f"__ns:=/compiles_{int(number)}"
    with start_loading(
        "monitor", robot(PANDA).path, *namespace, NUMBA_CACHE_DIR=str(tmp_path)
    ) as process:
        status = peer.wait_until(named, "a status")
        process.wait_for_text("compiling")
        assert_signal_ends(process, number)
    assert status.level == OK and re.match(r"compiling \w+ ", status.values[0].value)
    lines = [line for line in process.output.splitlines() if "compiling" in line]
    assert lines[0].endswith(RULE)
    assert all(
        "[INFO]" in line and f"[{name.replace('/', '.')}]: compiling" in line for line in lines
    )
    assert "Ready" not in process.output
