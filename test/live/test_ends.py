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
from diag_dynamics.nodes.support.topics import NODES
from limits import HANG
from nodes import PANDA, UR5
from processes import Process, node_process
from robots import robot_path

pytestmark = [pytest.mark.full, pytest.mark.live]

READY = {
    "monitor": "Ready: robot",
    "simulator": "Ready: robot",
    "controller": "Ready: robot",
    "view": "Page: ",
}
OPTIONS = {
    "monitor": {"robot_description": robot_path(PANDA)},
    "simulator": {"robot_description": robot_path(PANDA), "motion": "wave"},
    "controller": {
        "robot_description": robot_path(UR5),
        "robot_compensates_gravity": False,
    },
    "view": {"port": 0},
}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("node", OPTIONS)
def test_signal(peer, node, number):
    """Each node ends with status 0, and leaves the graph: nobody has to wait for the lease of its
    participant, 20 s.
    """
    autostart = {"autostart": True} if node == "controller" else {}
    with node_process(node, **OPTIONS[node], **autostart) as process:
        process.wait_for_text(READY[node])
        peer.wait_until(lambda: NODES[node] in peer.node.get_node_names(), "the node")
        process.stop(number)
    peer.wait_until(lambda: NODES[node] not in peer.node.get_node_names(), "its departure", 15.0)


@pytest.mark.parametrize("after", ["rclpy", "numba", "llvmlite"])
def test_signal_while_it_imports(ros_domain, after, tmp_path):
    """A hook sends the signal when a library is imported."""
    (tmp_path / "sitecustomize.py").write_text(
        "import builtins, os, signal, sys\nfound = builtins.__import__\n"
        "def hook(name, *rest, **more):\n"
        f"    if name.startswith('{after}') and 'diag_dynamics.nodes.monitor.monitor' in "
        f"sys.modules and not hook.sent:\n"
        "        hook.sent = True\n        os.kill(os.getpid(), signal.SIGTERM)\n"
        "    return found(name, *rest, **more)\nhook.sent = False\nbuiltins.__import__ = hook\n"
    )
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "diag_dynamics", "monitor"]
    done = subprocess.run(
        command,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=HANG,
    )
    assert (done.returncode, done.stderr.count("Traceback")) == (0, 0), done.stderr


@pytest.mark.parametrize(
    "labels", [(), ("configure",), ("configure", "activate"), ("configure", "shutdown")], ids=str
)
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
    """A signal ends the controller by a last command: it leaves the robot with its gravity
    torque.
    """
    sent = peer.topic(Float64MultiArray, "/effort_controller/commands")
    simulated = {
        "robot_description": robot_path(UR5),
        "without_command": "brake",
        "real_time_factor": 0.9,
        "rate": 100.0,
    }
    with (
        effort_controller(peer, "", []),
        node_process("simulator", **simulated),
        node_process(
            "controller", **OPTIONS["controller"], autostart=True, use_sim_time=True
        ) as controller,
    ):
        peer.wait_until(lambda: len(sent.messages) > 20, "commands")
        controller.stop(signal.SIGTERM)
        count = len(sent.messages)
        peer.pass_time(0.5)
        assert np.abs(sent.messages[-1].data).max() > 1.0 and count > 20


BUSY = """
import gc, sys, time
from rclpy.node import Node
from diag_dynamics.nodes.support.runner import run

class Busy(Node):
    def __init__(self):
        super().__init__("busy")
        for _ in range(2):
            self.create_timer(0.001, self.work)

    def work(self):
        print("frozen:", gc.get_freeze_count() > 10_000, flush=True)
        end = time.perf_counter() + 0.004
        while time.perf_counter() < end:
            pass

sys.exit(run(Busy))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_node_that_is_never_idle(ros_domain, number):
    """More callbacks wait than it has time for; the garbage collector skips what was imported."""
    with Process([sys.executable, "-c", BUSY]) as process:
        process.wait_for_text("frozen: True")
        process.stop(number)


STUCK = """
import sys, threading
from rclpy.node import Node
from diag_dynamics.nodes.support import runner

class Stuck(Node):
    def __init__(self):
        super().__init__("stuck")
        self.create_timer(0.1, lambda: print("spins", flush=True))

    def destroy_node(self):
        threading.Event().wait()

runner.SHUTDOWN_TIMEOUT = 0.5
sys.exit(runner.run(Stuck))
"""


def test_a_node_that_cannot_leave_the_graph(ros_domain):
    """The process prints the stacks of its threads after a time limit, and ends with status 1."""
    with Process([sys.executable, "-c", STUCK]) as process:
        process.wait_for_text("spins")
        process.signal(signal.SIGTERM)
        assert process.wait() == 1 and "in destroy_node" in process.output
