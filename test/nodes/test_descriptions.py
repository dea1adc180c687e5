# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Descriptions that come while a node is at work: loaded in a thread, handed over by the executor; the newest counts."""

import gc
import sys
import threading

import pytest

from diag_dynamics import DiagonalDynamics, load_urdf
from diag_dynamics.nodes.monitor.described import MonitoredRobot
from diag_dynamics.nodes.support.descriptions import TURN, Descriptions, working
from diag_dynamics.nodes.support.loading import MOST_TOLD, compile_dynamics, load_robot
from diag_dynamics.parameters.monitor import PARAMETERS as MONITOR
from diag_dynamics.parameters.monitor import Settings
from diag_dynamics.parameters.shared import PARAMETERS
from nodes import PANDA, robot
from robots import description, joint, link


class TimersByHand:
    """A node whose timers the test runs."""

    def __init__(self):
        self.timers = []

    def create_timer(self, period, callback, clock):
        self.timers.append(callback)
        return callback

    def destroy_timer(self, timer):
        self.timers.remove(timer)

    def spin_until(self, condition):
        while not condition():
            for timer in list(self.timers):
                timer()


class Loading:
    """Descriptions that are loaded when the test allows it."""

    def __init__(self):
        self.node, self.begun, self.allowed, self.taken = TimersByHand(), [], {}, []
        self.descriptions = Descriptions(self.node, self.load, lambda *taken: self.taken.append(taken))

    def load(self, name, *context):
        self.begun.append(name)
        assert self.allowed.setdefault(name, threading.Event()).wait(10.0)
        if name.startswith("bad"):
            raise ValueError(name)
        return name.upper()

    def allow(self, *names):
        for name in names:
            self.allowed.setdefault(name, threading.Event()).set()


@pytest.fixture
def loading():
    loading, before = Loading(), sys.getswitchinterval()
    yield loading
    loading.allow(*loading.begun)
    while working():
        threading.Event().wait(0.001)
    assert sys.getswitchinterval() == before and gc.isenabled()


def test_executor_hands_the_robot_over(loading):
    """Meanwhile the thread takes short turns."""
    loading.descriptions.load("one", 1, 2)
    assert loading.descriptions.loading == "one" and not loading.taken
    loading.node.spin_until(lambda: loading.begun)
    assert sys.getswitchinterval() == pytest.approx(TURN) and working() and not gc.isenabled()
    loading.allow("one")
    loading.node.spin_until(lambda: loading.taken)
    assert loading.taken == [("ONE", "one", 1, 2)]
    assert loading.descriptions.loading is None and not loading.node.timers


def test_newest_description_counts(loading):
    """An older one is dropped, or not even loaded."""
    loading.descriptions.load("one")
    loading.node.spin_until(lambda: loading.begun)
    loading.descriptions.load("two")
    loading.descriptions.load("three")
    assert loading.descriptions.loading == "three"
    loading.allow("one", "three")
    loading.node.spin_until(lambda: loading.taken)
    assert loading.taken == [("THREE", "three")] and loading.begun == ["one", "three"]


def test_dropped_description_is_not_handed_over(loading):
    """Not even if the same one is loaded again."""
    loading.descriptions.load("one")
    loading.node.spin_until(lambda: loading.begun)
    loading.descriptions.drop()
    assert loading.descriptions.loading is None and not loading.node.timers
    loading.descriptions.load("one")
    loading.allow("one")
    loading.node.spin_until(lambda: loading.taken)
    assert loading.begun == ["one", "one"] and len(loading.taken) == 1


def test_error_is_handed_over(loading):
    loading.descriptions.load("bad", 1)
    loading.allow("bad")
    loading.node.spin_until(lambda: loading.taken)
    [(error, *arguments)] = loading.taken
    assert isinstance(error, ValueError) and arguments == ["bad", 1]


def test_finish_waits_for_the_newest(loading):
    loading.descriptions.load("one")
    loading.descriptions.load("two")
    loading.allow("one", "two")
    loading.descriptions.finish()
    assert loading.taken == [("TWO", "two")]
    loading.descriptions.finish()


class Log(list):
    """A node's log."""

    def get_logger(self):
        return self

    info = warning = list.append


def test_many_odd_inertias_are_summed_up():
    odd = (1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 1.0, 0.0, 5.0))
    joints = (joint(f"j{k}", "revolute", f"l{k}", f"l{k + 1}") for k in range(29))
    text = description("odd", *(link(f"l{k}", *odd) for k in range(30)), *joints)
    log, values = Log(), {name: spec.default for name, spec in PARAMETERS.items()}
    assert load_robot(log, text, values).nv == 29
    assert sum("triangle" in line for line in log) == MOST_TOLD
    assert log[-1].startswith(f"{30 - MOST_TOLD} more such warnings")


@pytest.mark.usefixtures("compiled")
def test_kernels_are_compiled_with_a_small_robot(monkeypatch):
    """The matrices of a large one would take time in which no callback has a turn."""
    sizes = []
    for name in ("factors", "mass_matrix"):
        method = getattr(DiagonalDynamics, name)

        def record(self, q, method=method):
            sizes.append(self.model.nv)
            return method(self, q)

        monkeypatch.setattr(DiagonalDynamics, name, record)
    compile_dynamics.cache_clear()
    settings = Settings.of({name: spec.default for name, spec in MONITOR.items()})
    model = load_urdf(robot(PANDA).path)
    assert MonitoredRobot(b"", model, settings, 1).model is model
    assert sizes and max(sizes) == 1
