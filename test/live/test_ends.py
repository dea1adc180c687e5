# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes that run for long and nodes that end: resources, signals in every state, exit status, and leaving the graph."""

import signal
import subprocess
import sys

import numpy as np
import psutil
import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from sensor_msgs.msg import JointState

from nodes import OUTPUTS, START, UR5, Monitor, Truth, nanoseconds
from processes import Process, node_process
from robots import robot_path

pytestmark = [pytest.mark.full, pytest.mark.live]


# --- hundreds of transitions


@pytest.fixture
def monitor(peer, panda):
    """Return an active monitor."""
    with Monitor(peer, "/managed", robot_description=panda.path) as monitor:
        peer.become_known(monitor.name)
        yield monitor


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
    peer = monitor.connect(panda).peer
    for _ in range(8):
        listeners = [peer.topic(kind, f"{monitor.name}/{topic}") for topic, kind in OUTPUTS.items()]
        peer.wait_until(
            lambda all_=listeners: all(topic.subscription.get_publisher_count() for topic in all_), "publishers"
        )
        monitor.transition("deactivate")
        request = ChangeState.Request(transition=Transition(label="cleanup"))
        answer = peer.clients[f"{monitor.name}/change_state"].call_async(request)
        for topic in listeners:
            peer.node.destroy_subscription(topic.subscription)
        peer.wait_until(answer.done, "the cleanup")
        assert answer.result().success
        monitor.transition("configure", "activate")
    monitor.connect(panda).serves(panda)


def test_hundreds_of_pauses(monitor, panda):
    """With 1 kHz of input, pausing and going on leaves no thread, descriptor or memory behind; then all is right."""
    peer = monitor.peer
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

    SIGINT ends active nodes at the end of every other test.
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
        state = f"{monitors['finalized'].name}/state"
        peer.wait_until(lambda: not peer.node.get_publishers_info_by_topic(state), "no publisher")
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


# --- the graph after the end

PROGRAM = """
import os, signal, sys, threading
from pathlib import Path
from diag_dynamics.nodes.{0}.{0} import {1}
from diag_dynamics.nodes.support.runner import run

def of_participant():
    names = [path.read_text().strip() for path in Path("/proc/self/task").glob("*/comm")]
    return sum(name.startswith(("dds.ev", "dds.udp")) for name in names)

class Node({1}):
    def on_activate(self, state):
        threading.Timer(0.2, lambda: (print(of_participant(), flush=True), os.kill(os.getpid(), signal.SIGTERM))).start()
        return super().on_activate(state)

status = run(Node, ["node", "--ros-args", "-p", "robot_description:=" + sys.argv[1]])
print(of_participant())
sys.exit(status)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="threads are told apart by Linux")
@pytest.mark.parametrize("node", [("simulator", "SimulatorNode"), ("monitor", "MonitorNode")], ids=lambda node: node[0])
def test_no_participant_outlives_its_node(ros_domain, node):
    command = [sys.executable, "-c", PROGRAM.format(*node), str(robot_path(UR5))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=START)
    assert done.returncode == 0, done.stderr
    running, after = map(int, [line for line in done.stdout.splitlines() if line.isdigit()])
    assert running > 0 and after == 0


@pytest.mark.parametrize(("status", "room", "ends"), [("None", "unlimited", 0), ("0", "0", 120), ("3", "0", 3)])
def test_what_cannot_be_written_at_the_end_is_told_by_the_status(tmp_path, status, room, ends):
    """As of any Python program; by the limit of a shell, for no full disk is at hand."""
    program = f"from diag_dynamics.nodes.support.start import leave; print('last words'); leave({status})"
    command = f'ulimit -f {room}; unset PYTHONUNBUFFERED; exec "$0" -c "$1" > said'
    done = subprocess.run(["sh", "-c", command, sys.executable, program], cwd=tmp_path, timeout=START)
    assert done.returncode == ends
    assert (tmp_path / "said").read_text() == ("last words\n" if room == "unlimited" else "")


STUCK = """
import ctypes, os, signal, sys, threading
from diag_dynamics.nodes.simulator.simulator import SimulatorNode
from diag_dynamics.nodes.support import runner

runner.LEAVING = 1.0

class Node(SimulatorNode):
    def on_activate(self, state):
        threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGTERM)).start()
        return super().on_activate(state)

    def destroy_node(self):
        ctypes.PyDLL(None).pause()  # as rclpy does, with the interpreter's lock

runner.run(Node, ["node", "--ros-args", "-p", "robot_description:=" + sys.argv[1]])
"""


def test_a_middleware_that_waits_for_itself_keeps_no_process(ros_domain):
    """Where a node cannot leave the graph its process ends all the same, and says what it was at."""
    command = [sys.executable, "-c", STUCK, str(robot_path(UR5))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=START)
    assert done.returncode == 1, done.stderr
    assert "Timeout (" in done.stderr
    assert "in destroy_node" in done.stderr
