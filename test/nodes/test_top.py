# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The terminal view `top` in process: messages in, tables or lines out."""

import io
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from diag_dynamics.msg import DiagonalizedState, ExternalTorque
from rich.console import Console

from diag_dynamics.nodes import top
from nodes import MANY

NAMES = ["shoulder", "elbow", "wrist"]


class Robot:
    """Publishes a monitor's messages."""

    def __init__(self, peer, namespace, names=NAMES):
        self.peer, self.names, name = peer, list(names), f"{namespace}/diag_dynamics"
        self.node = peer.extra_node("diag_dynamics", namespace)
        self.states = self.node.create_publisher(DiagonalizedState, f"{name}/state", MANY)
        self.torques = self.node.create_publisher(ExternalTorque, f"{name}/external_torque", MANY)

    def publish(self, nu=(1.0, 3.0, 2.0), effort=(10.0, -45.0, 1.0), **fields):
        """Publish an external torque with these fields, then a state."""
        self.torques.publish(ExternalTorque(dof_names=self.names, valid=True, **fields))
        energy = 0.5 * sum(rate * rate for rate in nu)
        state = DiagonalizedState(dof_names=self.names, nu=list(nu), effort=list(effort))
        state.kinetic_energy = energy
        self.states.publish(state)
        self.peer.pass_time(0.6)


class Screen:
    """A terminal of a size that stores the text of its newest frame."""

    def __init__(self, width, height, **options):
        self.size = {"width": width, "height": height} | options

    def start(self):
        """Open the screen."""
        self.is_open = True

    def update(self, frame, refresh):
        """Draw a frame."""
        self.text = io.StringIO()
        Console(file=self.text, force_terminal=False, **self.size).print(frame)

    def stop(self):
        """Close the screen."""
        self.is_open = False

    def rows(self, count):
        """Return the first words of each joint's row."""
        rows = [line.split() for line in self.text.getvalue().splitlines()]
        return [row[:count] for row in rows if row and row[0] in NAMES]


@pytest.fixture
def make_robot(peer):
    """Return a function that makes a robot, which leaves the graph at the end."""
    robots = []

    def make(namespace, *names):
        robots.append(Robot(peer, namespace, *names))
        return robots[-1]

    yield make
    for robot in robots:
        peer.drop_node(robot.node)


@pytest.fixture
def make_top(peer):
    """Return a function that starts `top`, which leaves the graph at the end."""
    started = []

    def make(**options):
        started.append(peer.graph.add(top.Top, **options))
        peer.pass_time(0.6)
        return started[-1]

    yield make
    for node in started:
        node.destroy_node()


@pytest.fixture
def screen(monkeypatch):
    """Have `top` draw on a screen of 90 columns."""
    screen = Screen(90, 24)
    monkeypatch.setattr(top, "has_screen", lambda: True)
    monkeypatch.setattr(top, "Live", lambda **_: screen)
    return screen


def test_a_robot_on_the_screen(make_robot, make_top, screen, peer):
    """Energies, torques and peaks of the joints, the largest peak first; the alarm and its end."""
    node = make_top(note="Page: here")
    peer.pass_time(1.0)
    assert "any robot: waiting for the first state\n" in screen.text.getvalue().replace(" \n", "\n")
    node.accept_progress("compiling sweeps")
    peer.pass_time(0.6)
    assert "waiting for the first state (compiling sweeps)" in screen.text.getvalue()
    robot = make_robot("/one")
    peer.pass_time(0.6)
    robot.publish(external_torque=[1.0, float("nan"), 0.5])
    robot.publish(nu=(2.0, 1.0, 2.0), external_torque=[1.0, float("nan"), 0.5])
    assert "Page: here" in screen.text.getvalue()
    assert "/one: K 4.50 J, peak energy 4.50 J at elbow\n" in screen.text.getvalue().replace(
        " \n", "\n"
    )
    assert screen.rows(5) == [
        ["elbow", "0.500", "-45.0", "-", "4.50"],
        ["shoulder", "2.00", "10.0", "1.00", "2.00"],
        ["wrist", "2.00", "1.00", "0.500", "2.00"],
    ]
    bars = [row[5:] for row in screen.rows(6)]
    assert len(bars[1][0]) > 3 * len(bars[0][0])
    robot.publish(collision=True, joint_collision=[False, True, True])
    assert "ALARM collision elbow, wrist" in screen.text.getvalue()
    robot.publish(
        collision=True, touched_links=["arm", "forearm"], touched_link_probability=[0.3, 0.7]
    )
    assert "ALARM collision forearm" in screen.text.getvalue()
    robot.publish()
    assert "ALARM" not in screen.text.getvalue()
    peer.pass_time(2.0)
    assert "/one: no state in the last second" in screen.text.getvalue()
    node.destroy_node()
    assert not screen.is_open


def test_order_by_torque(make_robot, make_top, screen):
    robot = make_robot("/two")
    make_top(topics=["/two/diag_dynamics/state"], by="torque")
    robot.publish(effort=(-20.0, 10.0, 1.0))
    robot.publish(effort=(5.0, 10.0, 30.0))
    robot.publish(effort=())
    assert [row[0] for row in screen.rows(1)] == ["wrist", "shoulder", "elbow"]
    assert [row[2:] for row in screen.rows(5)] == [
        ["-", "-", "30.0"],
        ["-", "-", "20.0"],
        ["-", "-", "10.0"],
    ]
    assert "peak torque 30.0 N m at wrist" in screen.text.getvalue()


def test_several_robots(make_robot, make_top, screen):
    """All robots are shown, but not the states that a simulator computes for itself."""
    robots = [make_robot(f"/{name}") for name in ("left", "right")]
    truth = "/left/diag_dynamics_simulator/ground_truth"
    robots[0].node.create_publisher(DiagonalizedState, truth, MANY)
    make_top()
    for robot in robots:
        robot.publish()
    text = screen.text.getvalue()
    assert text.index("/left: K 7.00 J") < text.index("/right: K 7.00 J")
    assert "ground_truth" not in text


def test_messages_of_wrong_lengths(make_robot, make_top, screen):
    """Missing numbers are unknown, and further ones are ignored."""
    robot = make_robot("/odd")
    make_top(topics=["/odd/diag_dynamics/state"])
    robot.publish(nu=[1.0], effort=[2.0] * 5, external_torque=[3.0], joint_collision=[True] * 5)
    assert screen.rows(5) == [
        ["shoulder", "0.500", "2.00", "3.00", "0.500"],
        ["elbow", "-", "2.00", "-", "0"],
        ["wrist", "-", "2.00", "-", "0"],
    ]


def test_names_do_nothing_to_the_terminal(make_robot, make_top, screen):
    """Control characters are escaped, and markup is text."""
    names = ["\x1b]0;title\x07", "[red]shoulder[/]", "[/nothing]\n"]
    robot = make_robot("/hostile", names)
    make_top(topics=["/hostile/diag_dynamics/state"])
    robot.publish(collision=True, joint_collision=[True] * 3)
    text = screen.text.getvalue()
    assert "\x1b" not in text and "\x07" not in text
    for shown in (r"\x1b]0;title\x07", "[red]shoulder[/]", r"[/nothing]\x0a"):
        assert shown in text


def test_lines(peer, make_robot, make_top, capsys):
    """Without a terminal: a line a second, until the duration is over."""
    robot = make_robot("/plain")
    topics = ["/plain/diag_dynamics/state", "/nobody/state"]
    node = make_top(topics=topics, duration=4.0)
    for _ in range(5):
        robot.publish()
    robot.publish(collision=True, joint_collision=[False, True, False])
    peer.pass_time(0.4)
    assert not node.finished.done()
    peer.pass_time(3.0)
    text = capsys.readouterr().out
    line = "/plain: K 7.00 J, peak energy 4.50 J at elbow"
    assert f"{line}\n" in text and f"{line}, ALARM collision elbow\n" in text
    assert text.count("/nobody/state: waiting for the first state\n") > 5
    assert text.isascii() and "\x1b" not in text
    assert node.finished.done()


def test_a_pipe_that_nobody_reads(peer, make_top, monkeypatch):
    """It ends the node, as in `top | head -1`."""
    pipe = io.StringIO()
    monkeypatch.setattr(pipe, "write", Mock(side_effect=BrokenPipeError))
    monkeypatch.setattr(top.sys, "stdout", pipe)
    node = make_top()
    peer.pass_time(1.5)
    assert isinstance(node.finished.exception(), BrokenPipeError)


@pytest.mark.parametrize(
    ("terminal", "kind", "screen"),
    [(True, "xterm", True), (True, "dumb", False), (False, "xterm", False)],
)
def test_pipes_and_simple_terminals_get_lines(monkeypatch, terminal, kind, screen):
    monkeypatch.setattr(top.sys, "stdout", SimpleNamespace(isatty=lambda: terminal))
    monkeypatch.setenv("TERM", kind)
    assert top.has_screen() == screen
