# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes that are killed and come back, in every order; several monitors in one graph, or in one process."""

import contextlib
import signal
import subprocess
import sys
import time

import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from network import Watch, values
from nodes import BELIEVING, LATCHED, MANY, MAX_AGE, PANDA, START, TALOS, UR5, Monitor, Topic, description, robot
from processes import Process, node_process

pytestmark = [pytest.mark.full, pytest.mark.live]

OK, WARN, ERROR, STALE = b"\x00", b"\x01", b"\x02", b"\x03"


# --- many monitors


def serve(monitors):
    """Feed all monitors in turn; each publishes Pinocchio's numbers of its own robot."""
    for sample in range(3):
        for monitor, own in monitors:
            monitor.serves(own, sample)


def test_namespaces(peer):
    """Three robots in one graph: each monitor has the right one. One is killed, which the others do not notice."""
    ids = {"/left": PANDA, "/right": UR5, "/torso": TALOS}
    with contextlib.ExitStack() as stack:
        monitors = [
            (stack.enter_context(Monitor(peer, space, robot_description=robot(id).path)), robot(id))
            for space, id in ids.items()
        ]
        for monitor, own in monitors:
            monitor.connect(own)
        serve(monitors)
        killed, _ = monitors.pop(0)
        killed.process.signal(signal.SIGKILL)
        assert killed.process.wait() == -signal.SIGKILL
        serve(monitors)
        for monitor, own in monitors:
            report = monitor.next_report()
            assert report.values["robot"] == own.oracle.xml.get("name")
            assert not [name for name in report.counts() if name.startswith("rejected: ")]


SEVERAL = """
import queue, sys, threading
import rclpy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from diag_dynamics.nodes.monitor.monitor import MonitorNode
from diag_dynamics.nodes.support.runner import Executor, Stop

stop = Stop()
rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
executor, nodes, orders = Executor(), {}, queue.SimpleQueue()
threading.Thread(target=lambda: [orders.put(line.split()) for line in sys.stdin], daemon=True).start()
while not stop.future.done():
    executor.spin_until_future_complete(Future(), timeout_sec=0.1)
    while not orders.empty():
        order, namespace = orders.get()
        if order == "make":
            nodes[namespace] = MonitorNode(namespace=namespace)
            executor.add_node(nodes[namespace])
        else:
            executor.remove_node(nodes[namespace])
            nodes.pop(namespace).destroy_node()
            executor.spin_until_future_complete(Future(), timeout_sec=0.1)  # it lets go of the node when it spins
        print("done:", order, namespace, flush=True)
for node in nodes.values():
    executor.remove_node(node)
    node.destroy_node()
executor.shutdown()
rclpy.shutdown()
"""
"""Makes and destroys monitors in one process and one executor, in the order of its standard input."""


def test_one_process(peer, panda, monkeypatch):
    """While one of two monitors in one executor is destroyed and made anew, the other one goes on."""
    ur5 = robot(UR5)
    arguments = [part for name, value in ({"max_age": 0.0} | BELIEVING).items() for part in ("-p", f"{name}:={value}")]
    with Process([sys.executable, "-c", SEVERAL, "--ros-args", *arguments], stdin=subprocess.PIPE) as process:

        def order(text, count=1):
            process.popen.stdin.write(f"{text}\n".encode())
            process.popen.stdin.flush()
            while process.output.count(f"done: {text}") < count:
                if ready:
                    second.serves(ur5)

        monkeypatch.setattr(peer, "start", lambda *_, **__: process)
        first, second, ready = Monitor(peer, "/one"), Monitor(peer, "/two"), False
        for namespace, own in (("/one", panda), ("/two", ur5)):
            peer.publisher(String, f"{namespace}/robot_description", LATCHED).publish(description(own.urdf))
            order(f"make {namespace}")
        first.connect(panda)
        second.connect(ur5)
        ready = True
        serve([(first, panda), (second, ur5)])
        order("destroy /one")
        peer.wait_until(
            lambda: ("diag_dynamics", "/one") not in peer.node.get_node_names_and_namespaces(), "the node to be gone"
        )
        order("make /one", 2)
        first.connect(panda)
        serve([(first, panda), (second, ur5)])


# --- a robot and its monitor, killed without a chance to say goodbye


class Pair(contextlib.ExitStack):
    """A simulated Panda and its monitor, which know of each other by topics alone."""

    def __init__(self, peer, namespace):
        super().__init__()
        self.peer, self.robot, self.namespace = peer, robot(PANDA), namespace
        self.states = Topic(peer.node, JointState, f"{namespace}/joint_states", MANY)
        self.watch = Watch(peer.node, peer.wait_until, f"{namespace}/diag_dynamics")
        self.running = {}

    def start(self, *names):
        """Start them one after the other, each when the one before is there."""
        for name in names:
            here = "-r", f"__ns:={self.namespace}"
            if name == "robot":
                motion = {"robot_description": self.robot.path, "motion": "wave", "rate": 50.0}
                self.running[name] = self.enter_context(node_process("simulator", *here, **motion))
                self.running[name].wait_for_text("Ready: robot 'panda'")
            else:
                self.running[name] = self.enter_context(node_process("monitor", *here, max_age=MAX_AGE))
                self.running[name].wait_for_text("Waiting for a robot")

    def kill(self, *names):
        """Kill them all at once."""
        for name in names:
            self.running[name].signal(signal.SIGKILL)
        for name in names:
            assert self.running.pop(name).wait() == -signal.SIGKILL

    def recovers(self, since):
        """Right states come out that are newer than a stamp, all that has come out until now is right, nothing is wrong."""
        self.watch.wait_for_states(40, since, self.states, timeout=START)
        self.watch.wait_for_report(lambda report: report.level == OK, "all being well")
        # This process may miss a state that the monitor has got.
        assert self.watch.check(self.robot, values(self.robot, self.states.messages), complete=False) >= 40


@pytest.fixture(scope="module")
def running(peer):
    """Start a pair, the robot first."""
    with Pair(peer, "/pair") as pair:
        pair.start("robot", "monitor")
        pair.recovers(since=0)
        yield pair


@pytest.fixture
def pair(running):
    """Return the pair, running, with nothing heard."""
    running.watch.forget()
    running.states.forget()
    return running


def test_robot_dies(pair):
    """The monitor says that nothing comes, ever longer, and publishes nothing; when the robot is back, it goes on."""
    pair.kill("robot")
    died = time.time_ns()

    def silent(report):
        return report.stamp > died and report.level in (WARN, STALE) and "no joint states" in report.message

    silence = [pair.watch.wait_for_report(silent, "silence") for _ in range(2)]
    ages = [float(report.values["age of the last state [s]"]) for report in silence]
    assert ages[1] > ages[0]
    started = time.time_ns()
    pair.start("robot")
    pair.recovers(since=died)
    for topic in pair.watch.topics.values():
        assert not [stamp for stamp in topic.stamps if died < stamp < started]


def test_monitor_dies(pair):
    """The next one finds description and states of a robot that has long been there."""
    pair.kill("monitor")
    since = time.time_ns()
    pair.start("monitor")
    pair.recovers(since)


@pytest.mark.parametrize("order", [("robot", "monitor"), ("monitor", "robot")], ids=" first, then ".join)
def test_both_die(pair, order):
    """In whichever order they come back, they find each other; a monitor alone says what it waits for."""
    pair.kill(*order)
    since = time.time_ns()
    pair.start(order[0])
    if order[0] == "monitor":
        report = pair.watch.wait_for_report(lambda report: "no robot" in report.message, "no robot")
        assert report.level in (WARN, STALE)
        assert not any(stamp >= since for topic in pair.watch.topics.values() for stamp in topic.stamps)
    pair.start(order[1])
    pair.recovers(since)
