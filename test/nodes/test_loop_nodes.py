# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Monitor and simulator of robots with closed loops."""

import numpy as np
import pytest
import yaml
from diag_dynamics.srv import Diagonalize
from sensor_msgs.msg import JointState

import diag_dynamics as dd
from diag_dynamics.nodes.support.diagnostics import ERROR, OK
from linkages import FIVE_BAR, FOUR_BAR, five_bar, four_bar, four_bar_followers
from nodes import Monitor, joint_state


@pytest.fixture(scope="module")
def loops_file(tmp_path_factory):
    """Return the function that writes a file of loops."""

    def write(*loops):
        path = tmp_path_factory.mktemp("loops") / "loops.yaml"
        path.write_text(yaml.safe_dump({"loops": list(loops)}))
        return str(path)

    return write


def report_of_state(monitor, message, topics=("state",)):
    """Feed a state; return what came of it, and the next report."""
    published = monitor.feed(message, topics) if topics else monitor.feeder.publish(message)
    return published, monitor.next_report()


def test_monitor_of_a_four_bar(peer, loops_file):
    """Efforts of followers are reflected; rates that break the loop have an energy, services accept followers."""
    names, crank = ["rocker", "arm", "crank", "coupler"], 0.9
    parameters = {"robot_description": four_bar(), "loops_file": loops_file(FOUR_BAR)}
    dynamics = dd.DiagonalDynamics(dd.load_urdf(four_bar(), loops=[FOUR_BAR]))
    G = dynamics.model.followers_at([crank, 0.1]).ratios[:, 0]
    coupler, rocker = four_bar_followers(crank)
    effort = [4.0, 0.3, 2.0, -1.0]
    with Monitor(peer, "/four_bar", outputs=("state",), **parameters) as monitor:
        monitor.wait_for_report(lambda report: report.values.get("robot") == "four_bar", "the robot")
        for factor in (1.0, 1.5):
            velocity = [factor * G[1] * 2.0, 0.5, 2.0, G[0] * 2.0]
            position = [rocker, 0.1, crank, coupler]
            message = joint_state(names, position, velocity, effort, monitor.tick())
            published, report = report_of_state(monitor, message)
            expected = [2.0 + G @ [-1.0, 4.0], 0.3]
            np.testing.assert_allclose(published["state"].effort, expected, atol=1e-9)
            nu = dynamics.nu_from_qd([crank, 0.1], [2.0, 0.5])
            np.testing.assert_allclose(published["state"].nu, nu, atol=1e-12)
            loops = report.entries["loops"]
            energy = float(report.values["energy that breaks 'bar' [J]"])
            assert loops.level == OK
            assert energy < 1e-9 if factor == 1.0 else energy > 1e-3
        assert report.values["mimic joints"] == "2: coupler, rocker"
        request = Diagonalize.Request(state=message)
        assert monitor.call(Diagonalize, "diagonalize", request).success
        request.state.position[0] += 0.1
        assert "'rocker'" in monitor.call(Diagonalize, "diagonalize", request).message


def test_monitor_of_an_open_loop(peer, loops_file):
    """A state in which a loop cannot be closed is dropped with an error that names it; the next one is published."""
    names = ["c", "p1", "r1"]
    with Monitor(
        peer, "/five_bar", outputs=("state",), robot_description=five_bar(), loops_file=loops_file(FIVE_BAR)
    ) as monitor:
        monitor.wait_for_report(lambda report: report.values.get("robot") == "five_bar", "the robot")
        good, apart = [0.1, -0.3, 0.4], [0.1, -1.5, 1.5]
        monitor.feed(joint_state(names, good, np.zeros(3), [], monitor.tick()), ("state",))
        before = monitor.next_report()
        begin = len(monitor.reports)
        monitor.feeder.publish(joint_state(names, apart, np.zeros(3), [], monitor.tick()))
        report = monitor.wait_for_report(lambda report: report.since(before).get("rejected: open loop"), "it", begin)
        assert report.entries["joint states"].level == ERROR
        assert "loop 'five' (p1, p2, r1, r2) cannot be closed" in report.values["last rejection"]
        monitor.feed(joint_state(names, good, np.zeros(3), [], monitor.tick()), ("state",))


def test_simulator_of_a_four_bar(peer, loops_file):
    """Joint states have the followers' positions and rates, which close the loop."""
    states = peer.topic(JointState, "/bar/joint_states")
    parameters = {"robot_description": four_bar(), "loops_file": loops_file(FOUR_BAR), "rate": 100.0}
    model = dd.load_urdf(four_bar(), loops=[FOUR_BAR])
    with peer.start("simulator", "-r", "__ns:=/bar", **parameters):
        peer.wait_until(lambda: len(states.messages) > 50, "joint states")
    message = states.messages[-1]
    assert list(message.name) == ["crank", "arm", "coupler", "rocker"]
    crank, arm, *followers = message.position
    assert abs(crank - model.start[0]) > 0.05
    np.testing.assert_allclose(np.array(followers), four_bar_followers(crank), atol=1e-9)
    found = model.followers_at([crank, arm], message.velocity[:2])
    np.testing.assert_allclose(message.velocity[2:], found.rate, atol=1e-12)
