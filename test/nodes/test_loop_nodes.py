# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes of robots with closed loops."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from diag_dynamics.srv import Diagonalize
from numpy.polynomial import Chebyshev
from sensor_msgs.msg import JointState
from visualization_msgs.msg import MarkerArray

import diag_dynamics as dd
from controllers import Controller, desired_by_differences, untouched
from diag_dynamics.joint_states.joints import RobotState
from diag_dynamics.nodes import demo
from diag_dynamics.nodes.monitor.watches import numerical_health
from diag_dynamics.nodes.support.diagnostics import ERROR, OK, WARN
from diag_dynamics.page.frames import coriolis_work
from linkages import (
    BASE,
    COUPLER,
    CRANK,
    FIVE_BAR,
    FOUR_BAR,
    ROCKER,
    five_bar,
    four_bar,
    four_bar_followers,
    placed_by_page,
)
from nodes import Monitor, S, joint_state, nanoseconds
from oracles import Oracle
from streams import FRAME, LAYOUT, Stream


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
        monitor.wait_for_report(
            lambda report: report.values.get("robot") == "four_bar", "the robot"
        )
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
        peer,
        "/five_bar",
        outputs=("state",),
        robot_description=five_bar(),
        loops_file=loops_file(FIVE_BAR),
    ) as monitor:
        monitor.wait_for_report(
            lambda report: report.values.get("robot") == "five_bar", "the robot"
        )
        good, apart = [0.1, -0.3, 0.4], [0.1, -1.5, 1.5]
        monitor.feed(joint_state(names, good, np.zeros(3), [], monitor.tick()), ("state",))
        before = monitor.next_report()
        begin = len(monitor.reports)
        monitor.feeder.publish(joint_state(names, apart, np.zeros(3), [], monitor.tick()))
        report = monitor.wait_for_report(
            lambda report: report.since(before).get("rejected: open loop"), "it", begin
        )
        assert report.entries["joint states"].level == ERROR
        assert "loop 'five' (p1, p2, r1, r2) cannot be closed" in report.values["last rejection"]
        monitor.feed(joint_state(names, good, np.zeros(3), [], monitor.tick()), ("state",))


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
    found = model.followers_at([crank, arm], message.velocity[:2])
    np.testing.assert_allclose(message.velocity[2:], found.rate, atol=1e-12)


GRIPPER = Path(__file__).parents[2] / "examples/closed_loops/four_bar_gripper"
STRONG = '<limit effort="200" velocity="9"/>'


def reduced(oracle, q, qd):
    """Return M, C of Christoffel and g of crank and arm: those of the tree by Pinocchio, G by trigonometry."""
    names, position, G, rate = (
        list(oracle.dof_names),
        np.zeros(4),
        np.zeros((4, 2)),
        np.zeros((4, 2)),
    )
    position[[names.index(name) for name in ("crank", "arm")]] = q
    G[names.index("crank"), 0] = G[names.index("arm"), 1] = 1.0
    for k, name in enumerate(("coupler", "rocker")):
        angle = Chebyshev.interpolate(
            lambda x, k=k: [four_bar_followers(y)[k] for y in x], 16, (q[0] - 0.2, q[0] + 0.2)
        )
        row = names.index(name)
        position[row], G[row, 0], rate[row, 0] = (
            angle(q[0]),
            angle.deriv()(q[0]),
            angle.deriv(2)(q[0]) * qd[0],
        )
    tree = oracle.at(position, G @ qd)
    return G.T @ tree.M @ G, G.T @ (tree.C_s @ G + tree.M @ rate), G.T @ tree.g


def test_controller_of_a_four_bar(peer, loops_file):
    """Tracking moves crank and arm to a set-point by two efforts, which are those of the reduced equations."""
    urdf = four_bar(crank=STRONG).replace('<axis xyz="1 0 0"/>', f'<axis xyz="1 0 0"/>{STRONG}')
    shared = {"robot_description": urdf, "loops_file": loops_file(FOUR_BAR)}
    states, oracle, goal = (
        peer.topic(JointState, "/led/joint_states"),
        Oracle(urdf),
        np.array([0.9, 0.2]),
    )
    own = {
        "autostart": True,
        "robot_compensates_gravity": False,
        "use_sim_time": True,
        "effort_rate": ["*=1e5"],
    }
    with (
        Controller(peer, "/led", **own, **shared) as controller,
        peer.start("simulator", "-r", "__ns:=/led", lockstep=True, rate=250.0, **shared),
    ):
        controller.connect().simulator = SimpleNamespace(states=states)
        controller.set_point.publish(joint_state(["arm", "crank"], goal[::-1]))
        controller.wait_for(
            lambda s: np.abs(np.array(states.messages[-1].position[:2]) - goal).max() < 1e-3,
            "the goal",
        )
    sent, checked, largest = {tuple(message.data) for message in controller.sent.messages}, 0, 0.0
    for k, status in enumerate(controller.status.messages):
        aim = desired_by_differences(controller, k)
        if k % 5 or aim is None or not untouched(status) or np.abs(aim[2]).max() > 50.0:
            continue
        state = states.repeated(nanoseconds(status.header.stamp))
        q, qd = np.array(state.position[:2]), np.array(state.velocity[:2])
        M, C, g = reduced(oracle, q, qd)
        reference = aim[1] + 10.0 * (aim[0] - q)
        expected = M @ (aim[2] + 10.0 * (aim[1] - qd) - 20.0 * (qd - reference)) + C @ reference + g
        np.testing.assert_allclose(status.effort_command, expected, atol=1e-8)
        assert tuple(status.effort_command) in sent
        checked, largest = checked + 1, max(largest, np.abs(C @ reference).max())
    assert checked > 20 and largest > 1e-2, (checked, largest)


CENTRES = {"crank": (0.1, 0.0, 0.02), "coupler": (0.2, 0.01, 0.0), "rocker": (0.15, 0.0, 0.0)}
"""Centres of mass [m] of the links of the four-bar, in their frames."""


def turned(angle, point, origin=(0.0, 0.0, 0.0)):
    """Return a point of a bar that is turned about y by an angle [rad] at an origin [m]."""
    (x, y, z), c, s = point, np.cos(angle), np.sin(angle)
    return np.array([c * x + s * z, y, c * z - s * x]) + origin


def test_page_and_markers_of_a_four_bar(peer, loops_file):
    """Frame, scene and markers have all links where trigonometry has them, and bones to the ends of the loop."""
    crank, parameters = 0.9, {"robot_description": four_bar(), "loops_file": loops_file(FOUR_BAR)}
    coupler, rocker = four_bar_followers(crank)
    with (
        peer.start("view", port=0, rate=100.0) as view,
        Monitor(peer, "/shown", outputs=("state",), **parameters) as monitor,
    ):
        markers = peer.topic(MarkerArray, f"{monitor.name}/markers")
        monitor.wait_for_report(
            lambda report: report.values.get("robot") == "four_bar", "the robot"
        )
        peer.pass_time(3.0)
        with Stream(view.node.address, robot="/shown", hz=100) as stream:
            layout = stream.next(LAYOUT)
            monitor.feed(
                joint_state(["arm", "crank"], [0.1, crank], [0.5, 2.0], [], monitor.tick()),
                ("state",),
            )
            frame = stream.next(FRAME, lambda frame: frame.t == monitor.now / S)
    np.testing.assert_allclose(frame["q"], [crank, 0.1, coupler, rocker], atol=1e-6)
    np.testing.assert_allclose(
        layout["scene"]["rest"][2:], four_bar_followers(layout["scene"]["rest"][0]), atol=1e-9
    )
    angles = {"crank": crank, "coupler": crank + coupler, "rocker": rocker}
    origins = {
        "crank": np.zeros(3),
        "coupler": turned(crank, (CRANK, 0, 0)),
        "rocker": np.array([BASE, 0, 0]),
    }
    placed = placed_by_page(layout["tree"], frame["q"], layout["links"])
    bones = {link["name"]: link["bones"] for link in layout["scene"]["links"]}
    assert [COUPLER, 0, 0] in bones["coupler"] and bones["rocker"] == [[ROCKER, 0, 0]]
    drawn = [
        marker.pose.position for marker in markers.messages[-1].markers if marker.ns == "links"
    ]
    assert len(drawn) == 4
    for name, center in CENTRES.items():
        there = turned(angles[name], center, origins[name])
        np.testing.assert_allclose((placed[name] @ [*center, 1.0])[:3], there, atol=1e-6)
        assert min(np.abs([p.x, p.y, p.z] - there).max() for p in drawn) < 1e-9, name


def test_health_of_one_degree_of_freedom():
    """C of the gripper, 0 but for rounding, is no error of νᵀC = 0; C that does work is."""
    dynamics = dd.DiagonalDynamics(dd.load_urdf(f"{GRIPPER}.urdf", loops=f"{GRIPPER}.yaml"))
    for speed in (1e-3, 1.0, 30.0):
        state = RobotState(dynamics.model.start + 0.2, np.array([speed]), None, S, S, False)
        assert numerical_health(dynamics, state).level == OK
    nu, qd = (
        np.array([[0.3, 0.1], [0.3, 0.1], [0.0, 0.0]]),
        np.array([[1.0, -2.0], [1.0, -2.0], [0.0, 0.0]]),
    )
    found = coriolis_work(nu, np.array([[0.1, 0.2], [1e-14, 0.0], [0.0, 0.0]]), qd)
    np.testing.assert_allclose(found, [0.05 / np.sqrt(0.1 * 0.05), np.nan, np.nan])


@pytest.mark.filterwarnings("ignore::diag_dynamics.LoopWarning")
def test_monitor_at_a_dead_point(peer, loops_file):
    """Where crank and coupler are in line, the rocker does not determine them; beyond, it is out of their reach."""
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
        begin, count = len(monitor.reports), len(monitor.topics["state"].messages)
        monitor.feeder.publish(
            joint_state(["arm", "rocker"], [0.1, dead + 1e-3], [0.0, 0.0], [], monitor.tick())
        )
        report = monitor.wait_for_report(
            lambda report: report.count("rejected: open loop"), "it", begin
        )
        assert (
            report.entries["joint states"].level == ERROR
            and "loop 'bar'" in report.values["last rejection"]
        )
        assert len(monitor.topics["state"].messages) == count


def test_demo_with_loops_of_another_robot(loops_file, capsys, monkeypatch, tmp_path):
    """The error names the loop and the link that is missing."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    (robot := tmp_path / "five_bar.urdf").write_text(five_bar())
    assert demo.main(["demo", "--robot", str(robot), "--loops", loops_file(FOUR_BAR)]) == 1
    assert "LoopError: loop 'bar': 'coupler' is not a link" in capsys.readouterr().err
