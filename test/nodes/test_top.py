# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The terminal view `top` in process: messages in, frames for a terminal of any size out."""

import io
import math
import os
import pty
import re
import termios
from types import SimpleNamespace

import numpy as np
import pytest
from diag_dynamics.msg import DiagonalizedState, ExternalTorque
from rich.cells import cell_len
from std_msgs.msg import String

from diag_dynamics.nodes import top
from nodes import LATCHED, MANY

NAMES = ["shoulder", "elbow", "wrist"]
LIMITS = "<joint name='{}' type='revolute'><limit lower='-1' upper='1' effort='{}' velocity='2'/></joint>"
URDF = f"<robot name='r'>{''.join(map(LIMITS.format, NAMES, (100, 50, 10)))}</robot>"
FRAME, LINE, CODES = "\x1b[1;1H", re.compile(r"\x1b\[\d+;1H"), re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]")
MAKE_CONSOLE = top.make_console


class Robot:
    """Publishes a monitor's messages."""

    def __init__(self, peer, namespace, names=NAMES):
        self.peer, self.names, name = peer, list(names), f"{namespace}/diag_dynamics"
        self.node = peer.extra_node("diag_dynamics", namespace)
        self.states = self.node.create_publisher(DiagonalizedState, f"{name}/state", MANY)
        self.torques = self.node.create_publisher(ExternalTorque, f"{name}/external_torque", MANY)
        self.description = self.node.create_publisher(
            String, f"{namespace}/robot_description", LATCHED
        )
        self.description.publish(String(data=URDF))

    def publish(
        self,
        nu=(1.0, 2.0, 3.0),
        effort=(10.0, -45.0, 1.0),
        external=(1.0, 2.0, 0.5),
        count=10,
        **fields,
    ):
        """Publish states and external torques at 50 Hz; `fields` are those of the external torque."""
        nu = np.array(nu)
        values = {
            "nu": nu,
            "velocity": 0.5 * nu,
            "coriolis": 0.1 * nu[::-1],
            "articulated_inertia": 1.0 + 0.0 * nu,
        }
        values = {field: value.tolist() for field, value in values.items()}
        state = DiagonalizedState(
            dof_names=self.names, power=-1.5, effort_valid=True, effort=list(effort), **values
        )
        defaults = {
            "norm": 0.5,
            "threshold": math.inf,
            "torque_norm": 2.0,
            "torque_norm_threshold": 30.0,
        }
        defaults |= {"torque_threshold": [20.0, 10.0, 5.0]}
        torque = ExternalTorque(
            dof_names=self.names, valid=True, external_torque=list(external), **(defaults | fields)
        )
        torque.joint_collision = (
            np.abs(external) > np.array(torque.torque_threshold or math.inf)
        ).tolist()
        torque.collision = any(torque.joint_collision)
        for _ in range(count):
            for publisher, message in ((self.torques, torque), (self.states, state)):
                message.header.stamp = self.peer.node.get_clock().now().to_msg()
                publisher.publish(message)
            self.peer.pass_time(0.02)


class Screen:
    """`top` in a terminal of a size."""

    def __init__(self, peer, monkeypatch, width=80, height=24, topics=(), **options):
        self.peer, self.keys, self.file = peer, [], io.StringIO()
        console = {"force_terminal": True, "color_system": "standard"} | options
        console |= {"file": self.file, "width": width, "height": height}
        monkeypatch.setattr(top, "Keyboard", lambda: self)
        monkeypatch.setattr(top, "make_console", lambda: MAKE_CONSOLE(**console))
        self.node = peer.graph.add(top.Top, topics=topics)

    def read(self):
        """Return the keys since the last call."""
        keys, self.keys = self.keys, []
        return keys

    def close(self):
        """Restore nothing."""

    def codes(self, keys=(), seconds=0.2):
        """Type keys, and return what the terminal has received for the last frame."""
        self.keys += keys
        self.peer.pass_time(seconds)
        return self.file.getvalue().rpartition(FRAME)[2]

    def frame(self, keys=(), seconds=0.2):
        """Type keys, and return the text of the last frame."""
        return CODES.sub("", LINE.sub("\n", self.codes(keys, seconds)))

    def rows(self, count, keys=()):
        """Return the first words of each joint's row."""
        lines = [line.split() for line in self.frame(keys).splitlines()]
        return [line[:count] for line in lines if line and line[0] in NAMES]


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
def make_screen(peer, monkeypatch):
    """Return a function that starts `top` in a terminal."""
    screens = []

    def make(*args, **options):
        screens.append(Screen(peer, monkeypatch, *args, **options))
        return screens[-1]

    yield make
    for screen in screens:
        screen.node.destroy_node()


def test_a_robot_on_the_screen(make_robot, make_screen):
    """Energies of joints, torques with limits, external torque with its alarm; sorted, until the user quits."""
    screen = make_screen()
    assert (
        "waiting for states on any topic of type diag_dynamics/msg/DiagonalizedState"
        in screen.frame()
    )
    robot = make_robot("/one")
    assert "waiting for states on /one/diag_dynamics/state" in screen.frame(seconds=1.0)
    robot.publish(count=100)
    text = screen.frame()
    assert all(
        part in text
        for part in ("/one", "K 7.00 J", "net power -1.50 W", " Hz", "late", "peak 7.00 J")
    )
    assert screen.rows(3) == [
        ["shoulder", "0.500", "0.500"],
        ["elbow", "2.00", "2.00"],
        ["wrist", "4.50", "4.50"],
    ]
    assert screen.rows(5, "2") == [
        ["shoulder", "10.0", "10.0", "10", "%"],
        ["elbow", "-45.0", "45.0", "90", "%"],
        ["wrist", "1.00", "1.00", "10", "%"],
    ]
    robot.publish(external=(1.0, -12.0, 0.5))
    assert screen.rows(1, "3sss") == [["elbow"], ["wrist"], ["shoulder"]]
    codes = screen.codes()
    assert "\x1b[1;31mALARM collision: elbow" in codes and re.search(r"\x1b\[1?;?31m *120 %", codes)
    assert re.search(r"\x1b\[32m *5 %", codes)
    assert screen.rows(2, ["right"])[0] == ["wrist", "1.50"]
    assert not screen.node.finished.done()
    screen.frame("q")
    assert screen.node.finished.done()


def test_peaks_pause_and_silence(make_robot, make_screen):
    """Peaks are those of all states until they are reset; a paused frame stays; silence is reported."""
    robot, screen = make_robot("/two"), make_screen(topics=["/two/diag_dynamics/state"])
    robot.publish()
    robot.publish(nu=(10.0, 0.0, 0.0), count=1)
    robot.publish()
    text = screen.frame()
    assert "K 7.00 J" in text and "peak 50.0 J" in text and "█" in text
    assert screen.rows(3)[0] == ["shoulder", "0.500", "50.0"]
    assert "PAUSED" in screen.frame(" ")
    robot.publish(nu=(1.0, 0.0, 0.0))
    text = screen.frame(seconds=3.0)
    assert "K 7.00 J" in text and "no state for" not in text
    assert "K 0.500 J" in screen.frame(" ")
    screen.frame("r")
    robot.publish(nu=(1.0, 0.0, 0.0))
    assert "peak 0.500 J" in screen.frame()
    assert "no state for" in screen.frame(seconds=5.0)


def test_several_robots(make_robot, make_screen):
    """Tab shows one robot after the other, `o` all of them; a simulator's own states are not shown unasked."""
    robots = [make_robot(f"/{name}") for name in ("left", "right")]
    robots[0].node.create_publisher(
        DiagonalizedState, "/left/diag_dynamics_simulator/ground_truth", MANY
    )
    screen = make_screen()
    for robot in robots:
        robot.publish(count=50)
    assert [screen.frame().split()[:2], screen.frame("\t").split()[:2]] == [
        ["/left", "1/2"],
        ["/right", "2/2"],
    ]
    lines = [
        line.split()[:3]
        for line in screen.frame("o").splitlines()
        if line.startswith(("/left", "/right"))
    ]
    assert lines == [["/left", "7.00", "7.00"], ["/right", "7.00", "7.00"]]


def test_invalid_messages(make_robot, make_screen):
    """They are counted, and end nothing."""
    robot, screen = make_robot("/odd"), make_screen(topics=["/odd/diag_dynamics/state"])
    robot.publish()
    for fields in (
        {"nu": [1.0, 2.0]},
        {"velocity": [1.0] * 5},
        {"nu": [1.0] * 3, "effort": [], "effort_valid": True},
    ):
        robot.states.publish(DiagonalizedState(dof_names=NAMES, **fields))
    thresholds = [0.0, -1.0, math.nan]
    robot.torques.publish(
        ExternalTorque(
            dof_names=NAMES, valid=True, external_torque=[1.0], torque_threshold=thresholds
        )
    )
    for text in ("no XML", "<robot><joint name='wrist'><limit effort='much'/></joint></robot>"):
        robot.description.publish(String(data=text))
    assert "5 invalid messages" in screen.frame()
    robot.publish()
    assert "-45.0" in screen.frame("2")


@pytest.mark.parametrize(
    "fields",
    [
        {"torque_threshold": [100.0] * 3},
        {"torque_threshold": [], "torque_norm_threshold": 100.0},
        {"torque_threshold": [], "torque_norm_threshold": math.inf, "threshold": 40.0, "norm": 2.0},
    ],
    ids=["of joints", "of the norm of m r", "of |r|"],
)
def test_external_torque_far_below_its_threshold_looks_small(make_robot, make_screen, fields):
    """The threshold is the scale: noise of 5 N m is not a contact of 100 N m."""
    robot, screen = make_robot("/four"), make_screen(topics=["/four/diag_dynamics/state"])
    robot.publish(external=(5.0, 5.0, 5.0), count=20, **fields)
    assert "█" not in screen.frame("3") and "▁" in screen.frame()
    robot.publish(external=(150.0, 5.0, 5.0), count=20, **(fields | {"norm": 60.0}))
    assert "█" in screen.frame()


@pytest.mark.parametrize("size", [(80, 24), (140, 40), (40, 12), (8, 2)], ids=str)
def test_every_frame_fits(make_robot, make_screen, size):
    """For one joint and for sixty, every quantity and order: as many lines as there are, none too long."""
    many, screen = make_robot("/many", [f"joint_{k}" for k in range(60)]), make_screen(*size)
    one = make_robot("/a_robot_of_a_long_name", ["joint"])
    screen.peer.pass_time(1.0)
    ones = np.ones(60)
    many.publish(ones, ones, 15.0 * ones, torque_threshold=10.0 * ones)
    one.publish([1.0], [1.0], [1.0], torque_threshold=[])
    for keys in ["", *"123456s3s3so", "\t", "o", *"123456", ["down"] * 100, ["up"] * 100]:
        text = screen.frame(keys)
        lines = text.split("\n")
        assert len(lines) == size[1] and max(map(cell_len, lines)) <= size[0], keys
        if len(keys) == 100 and size[0] >= 80:  # the arrows scroll, to the last joint at most
            shown = [f"joint_{k} " in text for k in (0, 59)]
            assert (
                shown == ([False, True] if keys[0] == "down" else [True, False])
                and " of 60" in text
            )


HOSTILE = ["\x1b]0;title\x07", "[red]shoulder[/]", "[/nothing]\n", "\u202e名前のとても長い関節"]


def test_names_do_nothing_to_the_terminal(make_robot, make_screen):
    """Control characters are escaped, and markup is text, in names of joints and in alarms."""
    robot, screen = make_robot("/hostile", HOSTILE), make_screen(120, 30)
    screen.peer.pass_time(1.0)
    robot.publish(np.ones(4), np.ones(4), np.full(4, 9.0), torque_threshold=[1.0] * 4)
    text = screen.frame("3")
    assert "\x1b" not in text and "\x07" not in text and "\u202e" not in text
    for shown in (r"\x1b]0;title\x07", "[red]shoulder[/]", r"[/nothing]\x0a", "関節"):
        assert text.count(shown) == 2  # in the alarm and in its row


def test_keys_of_a_terminal():
    """Keys arrive without Enter, arrows as one key; a terminal that has gone quits; the mode is restored."""
    terminal, inside = pty.openpty()
    before = termios.tcgetattr(inside)
    keyboard = top.Keyboard(inside)
    assert keyboard.read() == []
    os.write(terminal, b"2\x1b[C\x1bOA\x1b[15~ \t")
    assert keyboard.read() == ["2", "right", "up", "", " ", "\t"]
    keyboard.close()
    assert termios.tcgetattr(inside) == before
    keyboard = top.Keyboard(inside)
    os.close(terminal)
    assert keyboard.read() == ["q"]
    os.close(inside)


def test_lines(peer, make_robot, capsys):
    """Where there is no terminal: a line a second in ASCII, until the duration is over."""
    robot = make_robot("/plain")
    topics = ["/plain/diag_dynamics/state", "/nobody/state"]
    node = peer.graph.add(top.Top, topics=topics, duration=4.0, lines=True)
    robot.publish(count=60)
    robot.publish(external=(1.0, -12.0, 0.5), count=60)
    peer.pass_time(3.5)
    text = capsys.readouterr().out
    line = "/plain: K 7.00 J, peak 7.00; wrist 4.50, elbow 2.00, shoulder 0.500 J; external elbow 2.00 of 10.0 N m; 50 Hz\n"
    assert (
        line in text
        and "50 Hz; ALARM collision: elbow\n" in text
        and "/plain: no state for" in text
    )
    assert "/nobody/state: waiting for states on /nobody/state" in text
    assert text.isascii() and "\x1b" not in text
    assert node.finished.done()
    node.destroy_node()


def test_a_pipe_that_nobody_reads(peer, monkeypatch):
    """It ends the node, as in `top | head -1`."""
    reader, writer = os.pipe()
    os.close(reader)
    with open(writer, "w") as pipe:
        monkeypatch.setattr(top.sys, "stdout", pipe)
        node = peer.graph.add(top.Top, lines=True)
        peer.pass_time(1.5)
    assert node.finished.done()
    node.destroy_node()


@pytest.mark.parametrize(
    "arguments",
    ["--rate 0", "--rate nan", "--duration -1", "--state /no-topic", "--state relative"],
)
def test_wrong_arguments(arguments, capsys):
    """The command ends with status 2 and names the argument."""
    with pytest.raises(SystemExit) as ended:
        top.main(["top", *arguments.split()])
    assert ended.value.code == 2 and f"argument {arguments.split()[0]}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("terminal", "kind", "screen"),
    [(True, "xterm", True), (True, "dumb", False), (False, "xterm", False)],
)
def test_pipes_and_simple_terminals_get_lines(monkeypatch, terminal, kind, screen):
    monkeypatch.setattr(top.sys, "stdout", SimpleNamespace(isatty=lambda: terminal))
    monkeypatch.setenv("TERM", kind)
    assert top.has_screen() == screen
