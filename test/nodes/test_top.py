# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The terminal view `top` in process: messages in, tables or lines out."""

import io
from functools import partial

import pytest
from diag_dynamics.msg import DiagonalizedState, ExternalTorque
from rich.console import Console

from diag_dynamics.nodes import top
from nodes import MANY

NAMES = ["shoulder", "elbow", "wrist"]


class Robot:
    """Publishes a monitor's messages."""

    def __init__(self, peer, namespace, names=NAMES):
        self.peer = peer
        self.names = list(names)
        name = f"{namespace}/diag_dynamics"
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
        self.peer.pass_time(1.0)


class Screen:
    """A terminal of a size that stores the text of its newest frame."""

    def __init__(self, width, height, **options):
        self.size = {"width": width, "height": height} | options
        self.is_started = False

    def start(self):
        """Open the screen."""
        self.is_started = True

    def update(self, frame, refresh):
        """Draw a frame."""
        self.text = io.StringIO()
        Console(file=self.text, force_terminal=False, **self.size).print(frame)

    def stop(self):
        """Close the screen."""
        self.is_started = False

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
    monkeypatch.setattr(top, "Console", partial(Console, force_interactive=True))
    monkeypatch.setattr(top, "Live", lambda **_: screen)
    return screen


def test_a_robot_on_the_screen(make_robot, make_top, screen, peer):
    """Energies, torques and peaks of the joints, the largest peak first; the alarm and its end."""
    node = make_top(topic="/one/diag_dynamics/state", note="Page: here")
    robot = make_robot("/one")
    peer.pass_time(1.0)
    assert "/one: no state in the last second" in screen.text.getvalue()
    robot.publish(external_torque=[1.0, float("nan"), 0.5])
    robot.publish(nu=(2.0, 1.0, 2.0), external_torque=[1.0, float("nan"), 0.5])
    assert "Page: here" in screen.text.getvalue()
    assert "/one: K 4.50 J, peak energy 4.50 J at elbow\n" in screen.text.getvalue().replace(
        " \n", "\n"
    )
    assert screen.rows(5) == [
        ["elbow", "0.500", "-45.0", "-", "4.50"],
        ["wrist", "2.00", "1.00", "0.500", "2.00"],
        ["shoulder", "2.00", "10.0", "1.00", "2.00"],
    ]
    links = {"touched_links": ["arm", "forearm"], "touched_link_probability": [0.3, 0.7]}
    robot.publish(collision=True, **links)
    assert "ALARM collision forearm" in screen.text.getvalue()
    robot.publish(collision=True, external_torque=[-9e-4, 0.0, 2e-3])
    assert screen.text.getvalue().splitlines()[1].rstrip().endswith("ALARM collision")
    robot.publish()
    assert "ALARM" not in screen.text.getvalue()
    peer.pass_time(2.0)
    assert "/one: no state in the last second" in screen.text.getvalue()
    node.destroy_node()
    assert not screen.is_started


def test_order_by_torque(make_robot, make_top, screen):
    robot = make_robot("/two")
    make_top(topic="/two/diag_dynamics/state", by="torque")
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


def test_messages_of_wrong_lengths(make_robot, make_top, screen):
    """Missing numbers are unknown, and further ones are ignored."""
    robot = make_robot("/odd")
    make_top(topic="/odd/diag_dynamics/state")
    robot.publish(nu=[1.0], effort=[2.0] * 5, external_torque=[3.0])
    assert sorted(screen.rows(5)) == [
        ["elbow", "-", "2.00", "-", "0"],
        ["shoulder", "0.500", "2.00", "3.00", "0.500"],
        ["wrist", "-", "2.00", "-", "0"],
    ]


def test_names_do_nothing_to_the_terminal(make_robot, make_top, screen):
    """Control characters are escaped, and markup is text."""
    names = ["\x1b]0;title\x07", "[red]shoulder[/]", "[/nothing]\n"]
    robot = make_robot("/hostile", names)
    make_top(topic="/hostile/diag_dynamics/state")
    robot.publish(collision=True, touched_links=["\x1b[2J"], touched_link_probability=[1.0])
    text = screen.text.getvalue()
    assert "\x1b" not in text and "\x07" not in text
    for shown in (r"\x1b]0;title\x07", "[red]shoulder[/]", r"[/nothing]\n", r"\x1b[2J"):
        assert shown in text


def test_lines(make_robot, make_top, capsys):
    """Without a terminal, a line a second."""
    robot = make_robot("/plain")
    make_top(topic="/plain/diag_dynamics/state")
    for _ in range(5):
        robot.publish()
    robot.publish(collision=True, touched_links=["elbow"], touched_link_probability=[0.5])
    lines = capsys.readouterr().out.splitlines()
    line = "/plain: K 7.00 J, peak energy 4.50 J at elbow"
    assert line in lines and lines[-1] == f"{line}, ALARM collision elbow"
    assert 5 <= len(lines) <= 7 and "".join(lines).isascii()
