# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes of robots with closed loops."""

import numpy as np
import pytest
import yaml
from diag_dynamics.srv import Diagonalize
from sensor_msgs.msg import JointState

import diag_dynamics as dd
from diag_dynamics.nodes import demo
from diag_dynamics.nodes.support.statuses import OK, WARN
from linkages import (
    BASE,
    COUPLER,
    CRANK,
    FOUR_BAR,
    ROCKER,
    five_bar,
    four_bar,
    four_bar_followers,
)
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
    """Efforts of followers are reflected, and services accept followers."""
    names = ["rocker", "arm", "crank", "coupler"]
    crank = 0.9
    parameters = {"robot_description": four_bar(), "loops_file": loops_file(FOUR_BAR)}
    model = dd.load_urdf(four_bar(), loops=[FOUR_BAR])
    G = model.followers_at([crank, 0.1]).ratios[:, 0]
    coupler, rocker = four_bar_followers(crank)
    effort = [4.0, 0.3, 2.0, -1.0]
    with Monitor(peer, "/four_bar", outputs=("state",), **parameters) as monitor:
        monitor.wait_for_report(
            lambda report: report.values.get("robot") == "four_bar", "the robot"
        )
        velocity = [G[1] * 2.0, 0.5, 2.0, G[0] * 2.0]
        position = [rocker, 0.1, crank, coupler]
        message = joint_state(names, position, velocity, effort, monitor.tick())
        published, report = report_of_state(monitor, message)
        expected = [2.0 + G @ [-1.0, 4.0], 0.3]
        np.testing.assert_allclose(published["state"].effort, expected, atol=1e-9)
        assert report.entries["loops"].level == OK
        assert report.values["mimic joints"] == "2: coupler, rocker"
        request = Diagonalize.Request(state=message)
        assert monitor.call(Diagonalize, "diagonalize", request).success
        request.state.position[0] += 0.1
        assert "'rocker'" in monitor.call(Diagonalize, "diagonalize", request).message


def test_simulator_of_a_four_bar(peer, loops_file):
    """Joint states have the followers' positions and rates, which close the loop."""
    states = peer.topic(JointState, "/bar/joint_states")
    parameters = {
        "robot_description": four_bar(),
        "loops_file": loops_file(FOUR_BAR),
        "rate": 100.0,
    }
    model = dd.load_urdf(four_bar(), loops=[FOUR_BAR])
    with peer.start("simulator", "-r", "__ns:=/bar", **parameters):
        peer.wait_until(lambda: len(states.messages) > 50, "joint states")
    message = states.messages[-1]
    assert list(message.name) == ["crank", "arm", "coupler", "rocker"]
    crank, arm, *followers = message.position
    assert abs(crank - model.start[0]) > 0.05
    np.testing.assert_allclose(np.array(followers), four_bar_followers(crank), atol=1e-9)
    result = model.followers_at([crank, arm], message.velocity[:2])
    np.testing.assert_allclose(message.velocity[2:], result.rate, atol=1e-12)


@pytest.mark.filterwarnings("ignore::diag_dynamics.LoopWarning")
def test_monitor_at_a_dead_point(peer, loops_file):
    """Where crank and coupler are in line, the rocker does not determine them."""
    dead = -np.arccos(((CRANK + COUPLER) ** 2 - BASE**2 - ROCKER**2) / (2.0 * BASE * ROCKER))
    file = loops_file(FOUR_BAR | {"independent": ["rocker"]})
    with Monitor(
        peer, "/dead", outputs=("state",), robot_description=four_bar(), loops_file=file
    ) as monitor:
        monitor.wait_for_report(
            lambda report: report.values.get("robot") == "four_bar", "the robot"
        )
        for apart, level in ((1e-2, OK), (1e-12, WARN)):
            message = joint_state(
                ["arm", "rocker"], [0.1, dead - apart], [0.0, 0.0], [], monitor.tick()
            )
            loops = report_of_state(monitor, message)[1].entries["loops"]
            assert loops.level == level
        assert loops.message == "nearly singular: loop 'bar' (crank, coupler, rocker)"


def test_demo_with_loops_of_another_robot(loops_file, capsys, monkeypatch, tmp_path):
    """The error names the loop and the link that is missing."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    (robot := tmp_path / "five_bar.urdf").write_text(five_bar())
    assert demo.main(["demo", "--robot", str(robot), "--loops", loops_file(FOUR_BAR)]) == 1
    assert "LoopError: loop 'bar' has 'coupler'; expected" in capsys.readouterr().err
