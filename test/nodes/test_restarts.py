# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes that die and come back, in every order; and many monitors in one graph, or in one process."""

import contextlib
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import rclpy
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from diag_dynamics.nodes.monitor.monitor import MonitorNode
from diag_dynamics.nodes.support import descriptions
from network import Watch, random_state, values
from nodes import BELIEVING, LATCHED, MANY, MAX_AGE, PANDA, START, TALOS, UR5, Topic, description, joint_state, robot
from processes import Process, node_process

pytestmark = [pytest.mark.full, pytest.mark.live]

OK, WARN, ERROR, STALE = b"\x00", b"\x01", b"\x02", b"\x03"


# --- many monitors


class Fed:
    """A monitor of known states, wherever it runs: its inputs and all its outputs."""

    def __init__(self, peer, namespace, id):
        self.parameters = {  # for it to publish everything of every state, however busy the machine is
            **{"max_rate.mass_matrix_factors": 0.0, "max_rate.joint_space_dynamics": 0.0, "max_age": MAX_AGE},
            f"qos_overrides.{namespace}/joint_states.subscription.reliability": "reliable",
            **BELIEVING,
        }
        self.peer, self.namespace, self.robot = peer, namespace, robot(id)
        self.watch = Watch(peer.node, peer.wait_until, f"{namespace}/diag_dynamics")
        self._publisher = peer.publisher(JointState, f"{namespace}/joint_states")
        self._rng = np.random.default_rng(1)
        self.sent = {}

    def feed(self):
        """Publish a state."""
        stamp = time.time_ns()
        self.sent[stamp] = state = random_state(self.robot, self._rng)
        self._publisher.publish(joint_state(self.robot.names, *state, stamp=stamp))

    def answered(self):
        """Whether everything has been published of the last state."""
        last = next(reversed(self.sent))
        return all(topic.at(last) for topic in self.watch.topics.values())

    def connect(self):
        """Publish states until everything is published of one of them, which shows that the monitor is there."""
        deadline, patience = time.monotonic() + START, 0.5
        while not (self.sent and self.answered()):
            assert time.monotonic() < deadline, f"nothing comes through {self.watch.name}"
            self.feed()
            with contextlib.suppress(AssertionError):
                self.peer.wait_until(self.answered, "everything", patience)
            patience *= 1.2  # it may be slow, and not only on its way
        self.check()

    def check(self):
        """All that was published until now is right; forget it, and return of how many states it was."""
        count = self.watch.check(self.robot, self.sent)
        self.sent.clear()
        self.watch.forget()
        return count


def serve(*monitors):
    """States come to all monitors at once, and each publishes everything of its own, and the right thing."""
    for _ in range(10):
        for monitor in monitors:
            monitor.feed()
        for monitor in monitors:
            monitor.peer.wait_until(monitor.answered, f"what {monitor.watch.name} makes of a state")
    for monitor in monitors:
        assert monitor.check() == 10


def test_namespaces(peer):
    """Three robots in one graph: each monitor has the right one. One is killed, which the others do not notice."""
    first, second, third = monitors = [
        Fed(peer, namespace, id) for namespace, id in (("/left", PANDA), ("/right", UR5), ("/torso", TALOS))
    ]

    def start(monitor):
        options = {"robot_description": monitor.robot.path, **monitor.parameters}
        return node_process("monitor", "-r", f"__ns:={monitor.namespace}", **options)

    with contextlib.ExitStack() as stack:
        processes = [stack.enter_context(start(monitor)) for monitor in monitors]
        for monitor in monitors:
            monitor.connect()
        serve(*monitors)
        processes[0].signal(signal.SIGKILL)
        processes[0].wait()
        first.feed()
        serve(second, third)
        for monitor in (second, third):
            report = monitor.watch.wait_for_report(lambda _: True, "anything")
            assert report.values["robot"] == monitor.robot.oracle.xml.get("name")
            assert not [name for name in report.values if name.startswith("rejected: ")]
        assert not first.check()


SEVERAL = """
import gc, os, queue, sys, threading
import rclpy
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from diag_dynamics.nodes.monitor.monitor import MonitorNode
from diag_dynamics.nodes.support.runner import Executor
from diag_dynamics.nodes.support.start import listen, stop

listen()
rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
executor, nodes, orders = Executor(), {}, queue.SimpleQueue()
threading.Thread(target=lambda: [orders.put(line.split()) for line in sys.stdin], daemon=True).start()
while not stop.asked:
    executor.spin_until_future_complete(Future(), timeout_sec=0.1)
    while not orders.empty():
        order, namespace, *assignments = orders.get()
        if order == "make":
            parameters = [Parameter(name, value=eval(value)) for name, value in (a.split("=") for a in assignments)]
            if wanted := os.environ.get("DIAG_DYNAMICS_TEST_SERIALIZATION"):
                parameters.append(Parameter("serialization", value=wanted))
            nodes[namespace] = MonitorNode(namespace=namespace, parameter_overrides=parameters)
            executor.add_node(nodes[namespace])
        else:
            executor.remove_node(nodes[namespace])
            nodes.pop(namespace).destroy_node()
            # The executor lets go of it when it spins, and then an rclpy lifecycle node still refers to itself.
            executor.spin_until_future_complete(Future(), timeout_sec=0.1)
            gc.collect()
        print("done:", order, namespace, flush=True)
for node in nodes.values():
    executor.remove_node(node)
    node.destroy_node()
executor.shutdown()
rclpy.shutdown()
"""
"""Makes and destroys monitors in one process and one executor, as it is told on its standard input."""


def test_one_process(peer):
    """Two monitors in one executor, with robots of their own, one by parameter and one by topic, each right.

    While one is destroyed the other goes on, and is not disturbed by that, nor by another one being made.
    """
    first, second = Fed(peer, "/first", PANDA), Fed(peer, "/second", UR5)
    descriptions = peer.publisher(String, "/second/robot_description", LATCHED)
    descriptions.publish(description(second.robot.urdf))
    orders = [
        f"make /first robot_description={str(first.robot.path)!r}",
        "make /second robot_description=''",
        "destroy /first",
    ]
    with Process([sys.executable, "-c", SEVERAL], stdin=subprocess.PIPE) as process:

        def tell(order):
            made = next((one for one in (first, second) if order.startswith(f"make {one.namespace} ")), None)
            limits = [f"{name}={value!r}" for name, value in made.parameters.items()] if made else ()
            line = " ".join([order, *limits])
            process.popen.stdin.write(f"{line}\n".encode())
            process.popen.stdin.flush()

        tell(orders[0])
        tell(orders[1])
        first.connect()
        second.connect()
        serve(first, second)
        tell(orders[2])
        while "done: destroy /first" not in process.output:
            serve(second)
        first.feed()
        serve(second)
        peer.wait_until(
            lambda: ("diag_dynamics", "/first") not in peer.node.get_node_names_and_namespaces(), "the node to be gone"
        )
        first.watch.reports.clear()
        for _ in range(2):
            second.watch.wait_for_report(lambda _: True, "anything")
        assert not first.check() and not first.watch.reports
        tell(orders[0])
        while process.output.count("done: make /first") < 2:
            serve(second)
        first.connect()
        serve(first, second)


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


def test_a_description_that_does_not_come(ros_domain, monkeypatch):
    """Somebody publishes, and nothing comes: the topic is listened to anew, as often as it takes, until a robot is there."""
    monkeypatch.setattr(descriptions, "PATIENCE", 0.1)
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain)
    node = MonitorNode(context=context, namespace="/lost")
    listened = [node._descriptions.subscription]
    try:
        executor = rclpy.executors.SingleThreadedExecutor(context=context)
        executor.add_node(node)
        publisher = node.create_publisher(String, "/lost/robot_description", LATCHED)

        def until(condition):
            deadline = time.monotonic() + START
            while not condition():
                assert time.monotonic() < deadline
                executor.spin_once(timeout_sec=0.1)
                if node._descriptions.subscription is not listened[-1]:
                    listened.append(node._descriptions.subscription)

        until(lambda: len(listened) == 3)
        publisher.publish(description(robot(UR5).urdf))
        until(lambda: node._robot is not None)
        count = len(listened)
        executor.spin_once(timeout_sec=1.0)
        assert node._descriptions.subscription is listened[-1] and len(listened) == count
    finally:
        node.destroy_node()
        context.try_shutdown()
