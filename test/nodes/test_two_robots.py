# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Two robots under control side by side, their nodes started as control.launch.py starts them, in namespaces of their own."""

import contextlib
from pathlib import Path

import pytest
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray

from diag_dynamics.nodes.support.launches import LAUNCHES, arguments_of, started
from nodes import START, UR5, Reports, robot

pytestmark = [pytest.mark.full, pytest.mark.live]

CONFIG = Path(__file__).resolve().parents[2] / "config"


class Launched(contextlib.AbstractContextManager):
    """Simulator and controller of one robot, as launched, and what the controller says."""

    def __init__(self, peer, namespace, **arguments):
        launch = LAUNCHES["control"]
        values = {name: default for name, (default, _) in arguments_of(launch).items()}
        self.namespace = namespace
        self.name = f"{namespace}/diag_dynamics_controller"
        self.reports = Reports(peer.node, peer.wait_until, self.name)
        self.commands = peer.topic(Float64MultiArray, f"{namespace}/effort_controller/commands")
        self.processes = {}
        for node in started(launch, values | arguments | {"namespace": namespace}):
            if node.executable != "monitor":
                options = ["-r", f"__node:={node.name}", "-r", f"__ns:={node.namespace}"]
                for source, target in node.remappings.items():
                    options += ["-r", f"{source}:={target}"]
                for path in (CONFIG / f"{node.executable}.yaml", node.params_file):
                    options += ["--params-file", path]
                given = {name: text for name, (_, text) in node.parameters.items()}
                self.processes[node.executable] = peer.start(node.executable, *options, **given)

    def __exit__(self, *error):
        with contextlib.ExitStack() as stack:
            for process in self.processes.values():
                stack.push(lambda *_, process=process: process.__exit__(*error))

    def wait_for_report(self, condition, what):
        """Return the first report from now on for which a condition holds."""
        return self.reports.wait_for(condition, what, timeout=START)


@pytest.fixture(scope="module")
def two(peer, tmp_path_factory):
    """Two robots, of which the second one's time begins later."""
    file = tmp_path_factory.mktemp("parameters") / "robot.yaml"
    slow = "rate: 100.0", "max_state_age: 1.0", "hold_time: 2.0", "resume_after_ramp: true"  # a test shares its machine
    file.write_text("\n    ".join(["/**:\n  ros__parameters:", *slow]) + "\n")
    arguments = {"urdf": str(robot(UR5).path), "params_file": str(file)}
    with Launched(peer, "/left", **arguments) as left:
        peer.wait_until(lambda: left.commands.messages, "commands on the left", START)
        with Launched(peer, "/right", **arguments) as right:
            peer.wait_until(lambda: right.commands.messages, "commands on the right", START)
            yield left, right


def test_two_robots_have_two_times(peer, two):
    """Each robot is controlled by its own simulator's time: no time goes back, and nobody publishes a global one."""
    for one in two:
        begin = len(one.commands.messages)
        peer.wait_until(lambda one=one, begin=begin: len(one.commands.messages) > begin + 100, "commands")
        report = one.wait_for_report(lambda r: r.entries["control"].level == b"\0", f"{one.name} in control")
        clock = f"publishers of {one.namespace}/clock"
        assert report.entries["control"].hardware_id == robot(UR5).oracle.xml.get("name")
        assert report.values[clock] == f"1: {one.namespace}/diag_dynamics_simulator"
        assert "clock went back" not in report.values
        assert "clock went back" not in one.processes["controller"].output
    assert peer.node.count_publishers("/clock") == 0


def test_a_second_clock_is_told_of(peer, two):
    """Diagnostics of the nodes that use a clock name all who publish it, and warn where there are several."""
    left, _ = two
    publisher = peer.publisher(Clock, "/left/clock")
    try:
        report = left.wait_for_report(lambda r: "several publish" in r.entries["inputs"].message, "the second clock")
        assert "2: /left/diag_dynamics_simulator, /test" in report.entries["inputs"].message
        assert report.entries["inputs"].level == b"\1"
    finally:
        peer.node.destroy_publisher(publisher)
    left.wait_for_report(lambda r: r.entries["inputs"].level == b"\0", "its departure")
