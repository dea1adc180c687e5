# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The end of nodes: signals in every state, exit status, and leaving the graph."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from std_msgs.msg import Float64MultiArray

from controllers import effort_controller
from nodes import PANDA, START, UR5, Monitor
from processes import Process, node_process
from robots import robot_path

pytestmark = [pytest.mark.full, pytest.mark.live]

READY = {"monitor": "Ready: robot", "simulator": "Ready: robot", "controller": "Ready: robot", "view": "Page: "}
OPTIONS = {
    "monitor": {"robot_description": robot_path(PANDA)},
    "simulator": {"robot_description": robot_path(PANDA), "motion": "wave"},
    "controller": {"robot_description": robot_path(UR5), "robot_compensates_gravity": False, "check_time": 0.0},
    "view": {"port": 0},
}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("node", OPTIONS)
def test_signal(ros_domain, node, number):
    """Each node ends with status 0."""
    autostart = {"autostart": True} if node == "controller" else {}
    with node_process(node, **OPTIONS[node], **autostart) as process:
        process.wait_for_text(READY[node])
        process.stop(number)


@pytest.mark.parametrize("after", ["rclpy", "numba", "llvmlite"])
def test_signal_while_it_imports(ros_domain, after, tmp_path):
    """A hook sends the signal when a library is imported."""
    (tmp_path / "sitecustomize.py").write_text(
        "import builtins, os, signal, sys\nfound = builtins.__import__\n"
        "def hook(name, *rest, **more):\n"
        f"    if name.startswith('{after}') and 'diag_dynamics.nodes.monitor.monitor' in sys.modules and not hook.sent:\n"
        "        hook.sent = True\n        os.kill(os.getpid(), signal.SIGTERM)\n"
        "    return found(name, *rest, **more)\nhook.sent = False\nbuiltins.__import__ = hook\n"
    )
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "diag_dynamics.nodes.monitor"]
    done = subprocess.run(command, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, timeout=START)
    assert (done.returncode, done.stderr.count("Traceback")) == (0, 0), done.stderr


@pytest.mark.parametrize("labels", [(), ("configure",), ("configure", "activate"), ("configure", "shutdown")], ids=str)
def test_signal_in_every_state_of_the_controller(peer, labels):
    namespace = "/" + "_".join(("at", *labels))
    name = f"{namespace}/diag_dynamics_controller"
    with node_process("controller", "-r", f"__ns:={namespace}", **OPTIONS["controller"]) as process:
        process.wait_for_text("Waiting to be configured")
        for label in labels:
            assert peer.transition(name, label)
        assert not peer.transition(name, "cleanup" if labels != ("configure",) else "configure")
        process.stop(signal.SIGTERM)


def test_last_command(peer):
    """A signal ends the controller by a last command: it leaves the robot with its gravity torque."""
    sent = peer.topic(Float64MultiArray, "/effort_controller/commands")
    simulated = {"robot_description": robot_path(UR5), "without_command": "brake", "publish_clock": True, "rate": 100.0}
    with (
        effort_controller(peer, "", []),
        node_process("simulator", **simulated),
        node_process("controller", **OPTIONS["controller"], autostart=True, use_sim_time=True) as controller,
    ):
        peer.wait_until(lambda: len(sent.messages) > 20, "commands", START)
        controller.stop(signal.SIGTERM)
        count = len(sent.messages)
        peer.pass_time(0.5)
        assert np.abs(sent.messages[-1].data).max() > 1.0 and count > 20


BUSY = """
import sys, time
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
    """More callbacks wait than it has time for: EventsExecutor heeds no time-out then."""
    with Process([sys.executable, "-c", BUSY]) as process:
        process.wait_for_text("begins")
        process.stop(number)


@pytest.mark.parametrize("node", ["monitor", "simulator", "controller"])
def test_a_robot_that_is_none(ros_domain, node):
    """The process ends with status 1, and its last line says why."""
    options = OPTIONS[node] | {"robot_description": "/nowhere/robot.urdf"}
    with node_process(node, **options, **({"autostart": True} if node == "controller" else {})) as process:
        assert process.wait(START) == 1
        last = process.output.strip().splitlines()[-1]
        assert "/nowhere/robot.urdf" in last and "Traceback" not in process.output


PROGRAM = """
import gc, os, signal, sys, threading
from pathlib import Path
from diag_dynamics.nodes.support.runner import node_class, run

def of_participant():
    names = [path.read_text().strip() for path in Path("/proc/self/task").glob("*/comm")]
    return sum(name.startswith(("dds.ev", "dds.udp")) for name in names)

def make():
    def end():
        print(of_participant(), int(gc.get_freeze_count() > 10_000), flush=True)
        os.kill(os.getpid(), signal.SIGTERM)
    node = node_class(sys.argv[1])()
    threading.Timer(2.0, end).start()
    return node

status = run(make)
print(of_participant(), 0)
sys.exit(status)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="threads are told apart by Linux")
@pytest.mark.parametrize("node", ["simulator", "monitor", "controller"])
def test_no_participant_outlives_its_node(ros_domain, node):
    """Nothing of the middleware runs when a node has ended; what was imported is kept from the garbage collector."""
    arguments = [f"{name}:={value}" for name, value in OPTIONS[node].items()]
    command = [sys.executable, "-c", PROGRAM, node, "--ros-args", *(word for one in arguments for word in ("-p", one))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=START)
    assert done.returncode == 0, done.stderr
    (running, frozen), (after, _) = [map(int, line.split()) for line in done.stdout.splitlines()]
    assert running > 0 and frozen and after == 0


def test_listeners_leave(peer, panda):
    """Whoever listens may go while the publishers do."""
    with Monitor(peer, "/left", robot_description=panda.path) as monitor:
        monitor.connect(panda).serves(panda)
        for topic in monitor.topics.values():
            peer.node.destroy_subscription(topic.subscription)
        monitor.process.stop(signal.SIGTERM)
