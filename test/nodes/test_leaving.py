# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A node that is over has left the graph before its process ends, and its exit status says whether all was written."""

import subprocess
import sys

import pytest

from described import UR5
from nodes import START
from robots import robot_path

pytestmark = [pytest.mark.full, pytest.mark.live]

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
