# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""While a robot is loaded or compiled: states, services and diagnostics go on, and a signal ends the process."""

import gc
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

from diag_dynamics import DiagonalDynamics, load_urdf
from diag_dynamics.compiled.progress import RULE
from diag_dynamics.nodes.monitor.described import MonitoredRobot
from diag_dynamics.nodes.support.descriptions import TURN, Descriptions, working
from diag_dynamics.nodes.support.diagnostics import OK
from diag_dynamics.nodes.support.loading import MOST_TOLD, compile_dynamics, load_robot
from diag_dynamics.parameters.monitor import PARAMETERS as MONITOR
from diag_dynamics.parameters.monitor import Settings
from diag_dynamics.parameters.shared import PARAMETERS
from nodes import LATCHED, PANDA, Monitor, Truth, description, robot
from processes import Process
from robots import description as urdf_of
from robots import joint, link

pytestmark = [pytest.mark.full]

LARGE = 30_000
"""Joints of a description that takes half a minute to load, and is loaded to its end in no test."""


@pytest.fixture(scope="module")
def large():
    """Return the description."""
    body = (1.0, (0.1, 0.2, 0.3), (0.1, 0, 0, 0.1, 0, 0.1))
    parts = [link("l0")]
    for k in range(LARGE):
        parts += [link(f"l{k + 1}", *body), joint(f"j{k}", "revolute", f"l{k}", f"l{k + 1}", axis=(0, 0, 1))]
    return urdf_of("large", *parts)


def test_the_robot_in_force_goes_on(peer, large):
    """While another robot is loaded: every state is answered, requests too, and diagnostics say what is going on."""
    panda = robot(PANDA)
    descriptions = peer.publisher(String, "/busy/robot_description", LATCHED)
    descriptions.publish(description(panda.urdf))
    with Monitor(peer, "/busy", max_joints=2 * LARGE) as monitor:
        monitor.connect(panda)
        assert monitor.next_report().values["loading"] == "nothing"
        descriptions.publish(description(large))
        monitor.wait_for_report(lambda report: report.values["loading"] != "nothing", "loading")
        for k in range(100):
            monitor.serves(panda, k % 3)
        response = monitor.call(
            Diagonalize, "diagonalize", Diagonalize.Request(state=panda.message(0, panda.samples[0]))
        )
        assert response.success, response.message
        Truth(panda, *panda.samples[0][:3]).check_state(response.state)
        report = monitor.next_report()
        assert report.values["loading"].startswith("a robot_description of ") and report.values["robot"] == "panda"
        assert report.entries["model"].message == "robot 'panda'; loading another robot_description"
        monitor.transition("deactivate", "cleanup")
        report = monitor.next_report()
        assert (report.values["loading"], report.values["lifecycle"]) == ("nothing", "unconfigured")
        monitor.transition("configure")  # the description is latched
        report = monitor.wait_for_report(lambda report: report.values["loading"] != "nothing", "loading again")
        assert report.entries["model"].message == "loading the robot_description"
        stop_at_once(monitor.process, signal.SIGTERM)  # though a thread is at it yet
        assert "robot 'large'" not in monitor.process.output


# --- signals


def until_it_loads(node, path, *more, **environment):
    """Start a node, and return its process when it says that it loads its robot."""
    command = [sys.executable, "-m", "diag_dynamics.nodes.support.start", node, "--ros-args"]
    for name, value in {"robot_description": path, "max_joints": 2 * LARGE}.items():
        command += ["-p", f"{name}:={value}"]
    process = Process([*command, *more], env={**os.environ, **environment})
    process.wait_for_text("Loading a robot")
    return process


def stop_at_once(process, number):
    """Have a signal end a process within two seconds: of its own work, as the machine may have other things to do."""
    running = psutil.Process(process.popen.pid)

    def spent():
        times = running.cpu_times()
        return times.user + times.system

    begin = last = spent()
    process.signal(number)
    with suppress(psutil.NoSuchProcess):
        while process.popen.poll() is None:
            last = max(last, spent())
            threading.Event().wait(0.01)
    assert process.wait() == 0
    assert last - begin < 2.0
    assert "Traceback" not in process.output


@pytest.mark.parametrize(("node", "number"), [("monitor", signal.SIGTERM), ("simulator", signal.SIGINT)])
def test_signal_while_a_robot_is_loaded(large, tmp_path, node, number):
    """The process ends long before it would have been ready."""
    path = tmp_path / "large.urdf"
    path.write_text(large, encoding="utf-8")
    with until_it_loads(node, path) as process:
        stop_at_once(process, number)
    assert "Ready" not in process.output


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_while_it_compiles(tmp_path, number):
    """With nothing compiled yet it takes a minute until it is ready, and seconds of these in one step of the compiler."""
    with until_it_loads("monitor", robot(PANDA).path, NUMBA_CACHE_DIR=str(tmp_path)) as process:
        stop_at_once(process, number)
    assert "Ready" not in process.output
    assert not list(tmp_path.rglob("*_serve*.nbc"))  # which is compiled last


def test_what_is_compiled_is_told(peer, tmp_path):
    """In the node's log and on /diagnostics, while it has time for neither; a signal ends it then as ever."""
    told = []

    def take(array):
        told.extend(status for status in array.status if status.name == "told/diag_dynamics: compiling")

    subscription = peer.node.create_subscription(DiagnosticArray, "/diagnostics", take, 10)
    try:
        more = "-r", "__ns:=/told"
        with until_it_loads("monitor", robot(PANDA).path, *more, NUMBA_CACHE_DIR=str(tmp_path)) as process:
            peer.wait_until(lambda: told, "a status", 60.0)
            process.wait_for_text("compiling")
            stop_at_once(process, signal.SIGTERM)
    finally:
        peer.node.destroy_subscription(subscription)
    assert told[0].level == OK and told[0].values[0].key == "what"
    assert re.match(r"compiling \w+ ", told[0].values[0].value)
    lines = [line for line in process.output.splitlines() if "compiling" in line]
    assert lines[0].endswith(RULE)
    assert all("[INFO]" in line and "[told.diag_dynamics]: compiling" in line for line in lines)


# --- what is said of a robot


class Said(list):
    """A node's log."""

    def get_logger(self):
        return self

    info = warning = list.append


def test_many_odd_inertias_are_summed_up():
    """A thousand of them would fill the log of everybody."""
    odd = (1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 1.0, 0.0, 5.0))
    text = urdf_of(
        "odd",
        *(link(f"l{k}", *odd) for k in range(30)),
        *(joint(f"j{k}", "revolute", f"l{k}", f"l{k + 1}", axis=(0, 0, 1)) for k in range(29)),
    )
    said, values = Said(), {name: spec.default for name, spec in PARAMETERS.items()}
    assert load_robot(said, text, values).nv == 29
    of_links = [line for line in said if "triangle" in line]
    assert len(of_links) == MOST_TOLD and said[-1] == f"{30 - MOST_TOLD} more links have such inertias."


def test_a_large_robot_is_put_in_force_without_its_matrices(monkeypatch):
    """Its matrices would take time as their entries, in which nobody else has a turn: a small one is compiled for."""
    sizes = []
    for method in ("factors", "mass_matrix"):
        original = getattr(DiagonalDynamics, method)
        monkeypatch.setattr(
            DiagonalDynamics, method, lambda self, q, call=original: sizes.append(self.model.nv) or call(self, q)
        )
    compile_dynamics.cache_clear()
    settings = Settings.of({name: spec.default for name, spec in MONITOR.items()})
    model = load_urdf(robot(PANDA).path)
    assert MonitoredRobot(b"", model, settings, 1).model is model
    assert sizes and max(sizes) == 1


# --- who makes the robots


class Node:
    """Timers that are run by hand."""

    def __init__(self):
        self.timers = []

    def create_timer(self, period, callback, clock):
        self.timers.append(callback)
        return callback

    def destroy_timer(self, timer):
        self.timers.remove(timer)

    def spin(self, condition):
        """Run them until a condition holds."""
        while not condition():
            for timer in list(self.timers):
                timer()


class Making:
    """What is made of names, when it is allowed to be."""

    def __init__(self):
        self.node, self.begun, self.allowed, self.taken = Node(), [], {}, []
        self.loads = Descriptions(self.node, self.make, lambda *taken: self.taken.append(taken))

    def make(self, name, *context):
        self.begun.append(name)
        assert self.allowed.setdefault(name, threading.Event()).wait(60.0)
        if name.startswith("bad"):
            raise ValueError(name)
        return name.upper()

    def allow(self, name):
        self.allowed.setdefault(name, threading.Event()).set()


@pytest.fixture
def making():
    """Return one; whatever it has begun comes to its end."""
    making = Making()
    before = sys.getswitchinterval()
    yield making
    for name in making.begun:
        making.allow(name)
    while working():
        threading.Event().wait(0.001)
    assert sys.getswitchinterval() == before and gc.isenabled()


def test_what_is_made_is_handed_over_by_the_executor(making):
    making.loads.load("one", 1, 2)
    assert making.loads.loading == "one" and not making.taken
    making.node.spin(lambda: making.begun)
    assert sys.getswitchinterval() == pytest.approx(TURN) and working() and not gc.isenabled()
    making.allow("one")
    making.node.spin(lambda: making.taken)
    assert making.taken == [("ONE", "one", 1, 2)]
    assert making.loads.loading is None and not making.node.timers


def test_the_newest_counts(making):
    """What has been overtaken is dropped; what was never begun is not even made."""
    making.loads.load("one")
    making.node.spin(lambda: making.begun)
    making.loads.load("two")
    making.loads.load("three")
    assert making.loads.loading == "three"
    for name in ("one", "three"):
        making.allow(name)
    making.node.spin(lambda: making.taken)
    assert making.taken == [("THREE", "three")] and making.begun == ["one", "three"]


def test_nothing_is_handed_over_after_a_drop(making):
    making.loads.load("one")
    making.node.spin(lambda: making.begun)
    making.loads.drop()
    assert making.loads.loading is None and not making.node.timers
    making.loads.load("one")  # again: not what was dropped, although it is alike
    making.allow("one")
    making.node.spin(lambda: making.taken)
    assert making.begun == ["one", "one"] and len(making.taken) == 1


def test_why_it_could_not_be_made_is_handed_over(making):
    making.loads.load("bad", 1)
    making.allow("bad")
    making.node.spin(lambda: making.taken)
    [(error, *asked)] = making.taken
    assert isinstance(error, ValueError) and asked == ["bad", 1]


def test_waiting_for_what_is_loading(making):
    """For whoever must not go on without it."""
    making.loads.load("one")
    making.loads.load("two")
    for name in ("one", "two"):
        making.allow(name)
    making.loads.finish()
    assert making.taken == [("TWO", "two")]
    making.loads.finish()
