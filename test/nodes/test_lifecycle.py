# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor as a managed node: every transition, what each state offers, a thousand changes, and every end."""

import signal
import subprocess
import sys

import numpy as np
import psutil
import pytest
from diag_dynamics.srv import Diagonalize
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.node import NodeNameNonExistentError
from sensor_msgs.msg import JointState

from nodes import MS, OUTPUTS, PANDA, START, UR5, Monitor, Truth, nanoseconds, robot
from processes import Process, node_process

pytestmark = [pytest.mark.full, pytest.mark.live]

OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"

SERVICES = {"forward_dynamics", "inverse_dynamics", "diagonalize", "set_payload"}


@pytest.fixture(scope="module")
def managed(peer):
    """Start a monitor that does nothing by itself."""
    with Monitor(peer, "/managed", autostart=False) as monitor:
        yield monitor


def unconfigured(monitor):
    """Lead a monitor back to the beginning, from wherever it is, with its parameters as they were."""
    phase = monitor.peer.phase(monitor.name)
    monitor.transition(*{"active": ("deactivate", "cleanup"), "inactive": ("cleanup",)}.get(phase, ()))
    result = monitor.set_parameters({"mimic": "embed", "robot_description": ""})
    assert result.successful, result.reason
    assert monitor.peer.phase(monitor.name) == "unconfigured"


@pytest.fixture
def monitor(managed):
    """Return it unconfigured."""
    unconfigured(managed)
    managed.forget()
    return managed


def offers(monitor):
    """Return on which outputs it publishes, which inputs it listens to, and which of its services there are."""
    node, at = monitor.peer.node, monitor.name
    namespace = at.rpartition("/")[0]
    outputs = {topic for topic in OUTPUTS if node.get_publishers_info_by_topic(f"{at}/{topic}")}
    inputs = {
        topic
        for topic in ("joint_states", "odom", "robot_description")
        if node.get_subscriptions_info_by_topic(f"{namespace}/{topic}")
    }
    # By node: the graph as a whole counts the test's clients as services, too.
    try:
        known = {name for name, _ in node.get_service_names_and_types_by_node(at.rpartition("/")[2], namespace)}
    except NodeNameNonExistentError:  # not discovered yet
        return None
    return outputs, inputs, {name for name in SERVICES if f"{at}/{name}" in known}


def wait_for_offers(monitor, outputs, inputs, services):
    """Wait until the graph says that it offers just this."""
    expected = (set(outputs), set(inputs), set(services))
    monitor.peer.wait_until(lambda: offers(monitor) == expected, f"the graph to show {expected}")


def test_what_each_state_offers(monitor, panda):
    """Up and down again: only diagnostics; then a model and services; then states, too; and back."""
    peer = monitor.peer
    wait_for_offers(monitor, (), (), ())
    report = monitor.next_report()
    assert report.values["lifecycle"] == "unconfigured"
    assert "unconfigured" in report.entries["joint states"].message

    monitor.set_parameter("robot_description", str(panda.path))
    monitor.transition("configure")
    assert peer.phase(monitor.name) == "inactive"
    wait_for_offers(monitor, OUTPUTS, (), SERVICES)
    request = Diagonalize.Request(state=panda.message(0, panda.samples[0]))
    response = monitor.call(Diagonalize, "diagonalize", request)
    assert response.success, response.message
    Truth(panda, *panda.samples[0][:3]).check_state(response.state)
    report = monitor.next_report()
    assert (report.values["lifecycle"], report.values["robot"]) == ("inactive", "panda")

    monitor.transition("activate")
    assert peer.phase(monitor.name) == "active"
    wait_for_offers(monitor, OUTPUTS, ("joint_states",), SERVICES)
    for sample in range(3):
        monitor.connect(panda, sample).serves(panda, sample)

    monitor.transition("deactivate")
    wait_for_offers(monitor, OUTPUTS, (), SERVICES)
    monitor.forget()
    received = monitor.next_report().count("received")
    monitor.feeder.publish(panda.message(monitor.tick(), panda.samples[0]))
    report = monitor.next_report()
    assert report.count("received") == received
    assert "inactive: nothing is listened to" in report.entries["joint states"].message
    assert not any(topic.messages for topic in monitor.topics.values())

    monitor.transition("cleanup")
    wait_for_offers(monitor, (), (), ())
    assert "robot" not in monitor.next_report().values


def test_joints_are_forgotten_when_inactive(monitor, panda):
    """After a pause, a part of the joints is no state: what was before the pause does not stand for the rest."""
    monitor.set_parameter("robot_description", str(panda.path))
    monitor.transition("configure", "activate")
    monitor.connect(panda)
    monitor.serves(panda)
    monitor.transition("deactivate", "activate")
    before = monitor.next_report()
    monitor.forget()
    monitor.peer.wait_until(monitor.feeder.get_subscription_count, "the subscription")

    def incomplete(report):
        monitor.feeder.publish(panda.message(monitor.tick(MS), panda.samples[1], panda.names[:5]))
        return report.count("incomplete") > before.count("incomplete")

    report = monitor.wait_for_report(incomplete, "an incomplete state")
    assert report.values["missing joints"] == f"3: {', '.join(panda.names[5:])}"
    assert not monitor.topics["state"].messages
    monitor.connect(panda).serves(panda, 2)


@pytest.mark.parametrize(
    ("value", "reason"),
    [("/nowhere/robot.urdf", "/nowhere/robot.urdf"), ("<robot name='r'><link name='a'/>", "not well-formed")],
    ids=["no file", "malformed"],
)
def test_configure_fails_and_can_be_repeated(monitor, panda, value, reason):
    """It stays unconfigured, with nothing left over, and says why; with the parameter put right it goes on."""
    monitor.set_parameter("robot_description", value)
    assert not monitor.peer.transition(monitor.name, "configure")
    assert monitor.peer.phase(monitor.name) == "unconfigured"
    wait_for_offers(monitor, (), (), ())
    report = monitor.next_report()
    model = report.entries["model"]
    assert model.level == ERROR
    assert reason in model.message and "robot_description" in model.message
    assert report.values["lifecycle"] == "unconfigured"

    monitor.set_parameter("robot_description", str(panda.path))
    monitor.transition("configure", "activate")
    monitor.connect(panda).serves(panda, 1)
    assert monitor.next_report().entries["model"].level == OK


def test_reconfigured(monitor, panda):
    """What shapes the model changes only while unconfigured, and holds from then on; so does another robot."""
    monitor.set_parameter("robot_description", str(panda.path))
    monitor.transition("configure", "activate")
    monitor.connect(panda).serves(panda)
    for phase in ("active", "inactive"):
        assert monitor.peer.phase(monitor.name) == phase
        result = monitor.set_parameters({"mimic": "free"})
        assert not result.successful
        assert result.reason.startswith(
            "parameter 'mimic' is read-only while the node is configured: clean it up first"
        )
        if phase == "active":
            monitor.transition("deactivate")
    monitor.transition("cleanup")
    monitor.set_parameter("mimic", "free")
    monitor.transition("configure", "activate")
    free = robot(PANDA, free=True)
    monitor.connect(free).serves(free, 1)
    monitor.transition("deactivate", "cleanup")
    result = monitor.set_parameters({"mimic": "embed", "robot_description": str(robot(UR5).path)})
    assert result.successful, result.reason
    monitor.transition("configure", "activate")
    monitor.connect(robot(UR5)).serves(robot(UR5), 1)


def test_transitions_that_are_none(monitor, panda):
    """Activating what is not configured fails and changes nothing."""
    assert not monitor.peer.transition(monitor.name, "activate")
    assert monitor.peer.phase(monitor.name) == "unconfigured"
    monitor.set_parameter("robot_description", str(panda.path))
    monitor.transition("configure")
    assert not monitor.peer.transition(monitor.name, "configure")
    assert monitor.peer.phase(monitor.name) == "inactive"
    monitor.transition("activate")
    monitor.connect(panda).serves(panda)


CYCLES = 200
WARM_UP = 50
"""Cycles in which allocators and DDS's pools grow to what they need."""
GROWTH = 4e6
"""Bytes that CYCLES may add: 20 kB each, where one subscription that stays behind holds 87 kB, and 1 kB is seen.

Queues and pools grow when the machine is busy, once; what stays behind is as much every time.
"""


def resources(process):
    """Return threads, file descriptors and memory of a process."""
    return process.num_threads(), process.num_fds(), process.memory_info().rss


def test_cleanup_as_listeners_leave(monitor, panda):
    """Whoever listens may go while the publishers do: the node lives, and has all of them again when it is configured."""
    peer = monitor.peer
    monitor.set_parameter("robot_description", str(panda.path))
    monitor.transition("configure", "activate")
    for _ in range(8):
        listeners = [peer.topic(kind, f"{monitor.name}/{topic}") for topic, kind in OUTPUTS.items()]
        peer.wait_until(
            lambda all_=listeners: all(topic.subscription.get_publisher_count() for topic in all_), "publishers"
        )
        monitor.transition("deactivate")
        request = ChangeState.Request(transition=Transition(label="cleanup"))
        answer = peer._clients[f"{monitor.name}/change_state"].call_async(request)
        for topic in listeners:
            peer.node.destroy_subscription(topic.subscription)
        peer.wait_until(answer.done, "the cleanup")
        assert answer.result().success
        monitor.transition("configure", "activate")
    monitor.connect(panda).serves(panda)


def test_hundreds_of_pauses(monitor, panda):
    """With 1 kHz of input, pausing and going on leaves no thread, descriptor or memory behind; then all is right."""
    peer = monitor.peer
    monitor.set_parameter("robot_description", str(panda.path))
    monitor.transition("configure", "activate")
    process = psutil.Process(monitor.process.popen.pid)
    simulator = node_process(
        "simulator", "-r", "__ns:=/managed", robot_description=panda.path, motion="wave", rate=1000.0
    )
    with simulator:
        monitor.wait_for_report(lambda report: report.count("published") > 200, "the simulator's states")

        def cycle(times):
            for _ in range(times):
                monitor.transition("deactivate", "activate")

        cycle(WARM_UP)
        before = monitor.next_report()
        for _ in range(3):
            threads, descriptors, memory = resources(process)
            cycle(CYCLES)
            now = resources(process)
            if now[2] <= memory + GROWTH:
                break
        states = monitor.topics["state"]
        inputs = peer.topic(JointState, "/managed/joint_states")
        last = peer.now()
        common = peer.wait_until(
            lambda: sorted(stamp for stamp in {*inputs.stamps} & {*states.stamps} if stamp > last)[:20], "states", START
        )
        for stamp in common:
            message = inputs.at(stamp)
            at = [message.name.index(name) for name in panda.names]
            q, qd, tau = (np.array(x)[at] for x in (message.position, message.velocity, message.effort))
            state = states.at(stamp)
            assert nanoseconds(state.oldest_stamp) == stamp
            Truth(panda, q, qd, tau).check_total_joint_rates(state)
        report = monitor.next_report()
        peer.node.destroy_subscription(inputs.subscription)
    assert report.count("received") == report.outcomes()
    assert report.count("published") > before.count("published")
    assert now[:2] == (threads, descriptors)
    assert now[2] <= memory + GROWTH


# --- the end


def test_signal_in_every_state(peer, panda):
    """A signal ends the process with status 0, whichever state the node is in; one that was shut down offers nothing.

    SIGINT ends those of the other tests while they are active, SIGTERM one in test_monitor_load.py.
    """
    ways = {
        "unconfigured": (signal.SIGTERM, ()),
        "inactive": (signal.SIGINT, ("configure",)),
        "active": (signal.SIGTERM, ("configure", "activate")),
        "finalized": (signal.SIGINT, ("configure", "activate", "shutdown")),
    }
    arguments = {"autostart": False, "robot_description": panda.path}
    monitors = {phase: Monitor(peer, f"/{phase}", **arguments) for phase in ways}
    try:
        for phase, (_, labels) in ways.items():
            monitors[phase].transition(*labels)
            assert peer.phase(monitors[phase].name) == phase
        wait_for_offers(monitors["finalized"], (), (), ())
        monitors["active"].connect(panda).serves(panda)
        for phase, (number, _) in ways.items():
            monitors[phase].process.stop(number)
    finally:
        for monitor in monitors.values():
            monitor.process.popen.kill()


BUSY = """
import sys, threading, time
from rclpy.node import Node
from diag_dynamics.nodes.support.runner import run

class Busy(Node):
    def __init__(self):
        super().__init__("busy")
        for _ in range(2):
            self.create_timer(0.001, self.work)
        print("begins", flush=True)

    def work(self):
        end = time.perf_counter() + 0.004
        while time.perf_counter() < end:
            pass

sys.exit(run(Busy))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_node_that_is_never_idle(ros_domain, number):
    """More callbacks wait than it has time for: EventsExecutor looks at no time-out then."""
    with Process([sys.executable, "-c", BUSY]) as process:
        process.wait_for_text("begins")
        process.stop(number)


def test_autostart_with_a_robot_that_is_none():
    """The process ends with status 1, and one line says why."""
    with node_process("monitor", robot_description="/nowhere/robot.urdf") as process:
        assert process.wait(START) == 1
        last = process.output.strip().splitlines()[-1]
        assert "robot_description" in last and "/nowhere/robot.urdf" in last
        assert "Traceback" not in process.output


def test_what_is_loaded_is_kept_from_the_garbage_collector():
    """An executable settles when its node is made; a node says so when its first robot has come."""
    program = """
import gc
from diag_dynamics.nodes.support import runner
from diag_dynamics.nodes.support.managed import ManagedNode
class Node(ManagedNode):
    finished = None
    def __init__(self):
        super().__init__("settled")
        assert not gc.get_freeze_count()
    def destroy_node(self):
        assert gc.get_freeze_count() > 10_000 and self.settled is runner.settle
        super().destroy_node()
        print("settled")
runner.spin = lambda node, until: None
raise SystemExit(runner.run(Node))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=START, check=False)
    assert (done.returncode, done.stdout) == (0, "settled\n"), done.stderr
