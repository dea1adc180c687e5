# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The nodes of the terminal views `top` and `energy_view` in process: messages in, frames of text out."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from diag_dynamics.msg import DiagonalizedState, ExternalTorque
from std_msgs.msg import String

from diag_dynamics.nodes.demos import energy_view
from diag_dynamics.nodes.support.graph import NOT_YET_KNOWN, publishing
from diag_dynamics.nodes.tools import top
from nodes import LATCHED, MANY, Monitor

NAMES = ["shoulder", "elbow", "wrist"]
LIMITS = "<joint name='{}' type='revolute'><limit lower='-1' upper='1' effort='{}' velocity='2'/></joint>"
URDF = f"<robot name='r'>{''.join(map(LIMITS.format, NAMES, (100, 50, 10)))}</robot>"
CODES = re.compile(r"\x1b\[[0-9;]*m")


class Robot:
    """Publishes a monitor's messages of three joints."""

    def __init__(self, peer, namespace):
        self.peer, name = peer, f"{namespace}/diag_dynamics"
        self.node = peer.extra_node("diag_dynamics", namespace)
        self.states = self.node.create_publisher(DiagonalizedState, f"{name}/state", MANY)
        self.torques = self.node.create_publisher(ExternalTorque, f"{name}/external_torque", MANY)
        self.description = self.node.create_publisher(String, f"{namespace}/robot_description", LATCHED)
        self.description.publish(String(data=URDF))

    def publish(self, nu=(1.0, 2.0, 3.0), effort=(10.0, -45.0, 1.0), external=(1.0, 2.0, 0.5), count=10):
        """Publish states and external torques at 50 Hz."""
        nu, thresholds = np.array(nu), [20.0, 10.0, 5.0]
        state = DiagonalizedState(dof_names=NAMES, nu=nu.tolist(), effort=list(effort), effort_valid=True, power=-1.5)
        state.velocity, state.coriolis = (0.5 * nu).tolist(), (0.1 * nu[::-1]).tolist()
        state.articulated_inertia, state.kinetic_energy = [1.0] * 3, float(0.5 * nu @ nu)
        torque = ExternalTorque(
            dof_names=NAMES, valid=True, external_torque=list(external), torque_threshold=thresholds
        )
        torque.norm, torque.threshold = 0.5, math.inf
        torque.torque_norm, torque.torque_norm_threshold = float(np.linalg.norm(external)), 30.0
        torque.joint_collision = [bool(x) for x in np.abs(external) > np.array(thresholds)]
        torque.collision = any(torque.joint_collision)
        for _ in range(count):
            for publisher, message in ((self.torques, torque), (self.states, state)):
                message.header.stamp = self.peer.node.get_clock().now().to_msg()
                publisher.publish(message)
            self.peer.pass_time(0.02)


class Screen:
    """A terminal: keys that are typed, and the last frame."""

    size = (80, 24)

    def __init__(self):
        self.keys, self.lines = "", []

    def typed(self):
        """Return the keys since the last call."""
        keys, self.keys = self.keys, ""
        return keys

    def show(self, lines):
        """Keep a frame."""
        self.lines = lines

    def close(self):
        """Nothing is to be given back."""


class Top(top.Top):
    """`top` whose clocks are those of the graph."""

    def __init__(self, time, topics=(), duration=None, lines=False, **options):
        super().__init__(list(topics), 10.0, duration, lines, **options)


class EnergyView(energy_view.EnergyView):
    """The view of kinetic energy, likewise."""

    def __init__(self, time, **options):
        super().__init__(**options)


@pytest.fixture
def make_robot(peer):
    """Return a function that makes a robot, which leaves the graph at the end."""
    robots = []

    def make(namespace):
        robots.append(Robot(peer, namespace))
        return robots[-1]

    yield make
    for robot in robots:
        peer.drop_node(robot.node)


@pytest.fixture
def start(peer, monkeypatch):
    """Return a function that starts a view on the graph."""
    for module in (top, energy_view):
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: peer.graph.steady))
    monkeypatch.setattr(top, "Screen", Screen)
    monkeypatch.setattr(top, "has_colours", lambda: True)
    nodes = []

    def make(kind, **options):
        nodes.append(peer.graph.add(kind, **options))
        return nodes[-1]

    yield make
    for node in nodes:
        node.destroy_node()


def shown(view, keys="", seconds=0.2):
    """Type keys, let frames be drawn, and return the last one."""
    view._screen.keys += keys
    view.graph.advance(seconds)
    return CODES.sub("", "\n".join(view._screen.lines))


def rows(text, count):
    """Return the first words of each joint's row."""
    return [line.split()[:count] for line in text.splitlines() if line.split()[:1] and line.split()[0] in NAMES]


def test_a_robot_on_the_screen(peer, start, make_robot):
    """Energies of joints, torques by limit, external torque with its alarm, sorted; filter, help and end by keys."""
    robot, view = make_robot("/one"), start(Top)
    robot.publish(count=100)
    text = shown(view)
    assert all(part in text for part in ("/one", "K 7.00 J", "net power -1.50 W", "Hz", "peak 7.00 J"))
    assert rows(text, 2) == [["shoulder", "0.500"], ["elbow", "2.00"], ["wrist", "4.50"]]
    text = shown(view, "2")
    assert all(part in text for part in ("2 torque", "90 %", "of limit", "-45.0"))
    robot.publish(external=(1.0, -12.0, 0.5))
    text = shown(view, "3sss")
    assert all(part in text for part in ("ALARM collision: elbow", "120 %", "sort: part of limit"))
    assert rows(text, 1) == [["elbow"], ["wrist"], ["shoulder"]]
    assert any(code in "\n".join(view._screen.lines) for code in ("\x1b[1m\x1b[31m", "\x1b[1;31m"))
    text = shown(view, "/wr\r")
    assert "/wr" in text and "shoulder" not in text
    assert "begin peaks anew" in shown(view, "?")
    assert "shoulder" in shown(view, "?\x1b", 1.0)
    assert not view.finished.done()
    shown(view, "q")
    assert view.finished.done()


def test_pause_peaks_and_silence(peer, start, make_robot):
    """A paused frame stays; peaks are those of all states until they begin anew; silence is reported."""
    robot, view = make_robot("/two"), start(Top, topics=["/two/diag_dynamics/state"])
    robot.publish()
    robot.publish(nu=(10.0, 0.0, 0.0))
    robot.publish()
    text = shown(view)
    assert "K 7.00 J" in text and "peak 50.0 J" in text
    assert "PAUSED" in shown(view, " ")
    robot.publish(nu=(1.0, 0.0, 0.0))
    assert "K 7.00 J" in shown(view)
    assert "K 0.500 J" in shown(view, " ")
    shown(view, "r")
    robot.publish(nu=(1.0, 0.0, 0.0))
    assert "peak 0.500 J" in shown(view)
    assert "no state for" in shown(view, seconds=5.0)


def test_several_robots(peer, start, make_robot):
    """Tab shows one robot after the other, `o` all of them."""
    robots = [make_robot(f"/{name}") for name in ("left", "right")]
    view = start(Top, topics=[f"/{name}/diag_dynamics/state" for name in ("left", "right")])
    for robot in robots:
        robot.publish()
    assert [shown(view).split()[0], shown(view, "\t").split()[0]] == ["/left", "/right"]
    lines = [line.split()[:3] for line in shown(view, "o").splitlines() if line.startswith(("/left", "/right"))]
    assert lines == [["/left", "7.00", "7.00"], ["/right", "7.00", "7.00"]]


def test_messages_that_make_no_sense(peer, start, make_robot):
    """They are counted, and end nothing."""
    robot, view = make_robot("/odd"), start(Top, topics=["/odd/diag_dynamics/state"])
    robot.publish()
    for fields in ({"nu": [1.0, 2.0]}, {"velocity": [1.0] * 5}, {"nu": [1.0] * 3, "effort": [], "effort_valid": True}):
        robot.states.publish(DiagonalizedState(dof_names=NAMES, **fields))
    robot.torques.publish(
        ExternalTorque(
            dof_names=NAMES, valid=True, external_torque=[math.nan] * 2, torque_threshold=[0.0, -1.0, math.nan]
        )
    )
    robot.description.publish(String(data="<robot><joint/><joint name='wrist'><limit effort='much'/></joint>"))
    assert "3 messages made no sense" in shown(view)
    robot.publish()
    assert "-45.0" in shown(view, "2")


def test_lines(peer, start, make_robot, capsys):
    """Where there is no terminal: a line a second in ASCII, until the duration is over."""
    robot = make_robot("/plain")
    view = start(Top, topics=["/plain/diag_dynamics/state", "/nobody/state"], duration=3.0, lines=True)
    robot.publish(count=100)
    peer.pass_time(2.0)
    text = capsys.readouterr().out
    assert (
        "/plain: K 7.00 J, peak 7.00; wrist 4.50, elbow 2.00, shoulder 0.500 J; external elbow 2.00 of 10.0 N m;"
        in text
    )
    assert "waiting for states on /nobody/state" in text
    assert text.isascii() and "\x1b" not in text
    assert view.finished.done()


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        (["--rate", "0"], "argument --rate: 0.0"),
        (["--rate", "nan"], "argument --rate: nan"),
        (["--duration", "-1"], "argument --duration"),
        (["--state", "no topic"], "argument --state"),
        (["--state", "relative"], "does not begin with /"),
    ],
)
def test_wrong_arguments_of_top(arguments, key, capsys):
    """The command ends with status 2 and names the argument."""
    with pytest.raises(SystemExit) as ended:
        top.main(["top", *arguments])
    assert ended.value.code == 2 and key in capsys.readouterr().err


# --- energy_view


def test_a_monitor_in_a_namespace_is_found(peer, start, panda, tmp_path, monkeypatch, capsys):
    """The view names what it waits for, then shows the states of the only monitor; one with --state listens to no other."""
    monkeypatch.chdir(tmp_path)
    view = start(EnergyView, duration=5.0)
    given = start(EnergyView, duration=5.0, state="/nowhere/state")
    peer.pass_time(0.5)
    text = capsys.readouterr().out
    assert "waiting for states on /diag_dynamics/state, published by nobody yet" in text
    assert "waiting for states on /nowhere/state, published by nobody yet" in text
    assert "such states on no other topic" in text
    with Monitor(peer, "/away", robot_description=panda.path) as monitor:
        monitor.connect(panda)
        while not view.finished.done():
            monitor.serves(panda)
            peer.pass_time(0.1)
        peer.pass_time(100.0)
        text = capsys.readouterr().out
        assert "such states are on /away/diag_dynamics/state too: --state shows them" in text
        assert "states on /away/diag_dynamics/state, published by /away/diag_dynamics\n" in text
        assert given.finished.done() and "No state arrived" in given.failure and given.conclude() == 1
        assert view.conclude() == 0
    assert "kinetic energy" in capsys.readouterr().out
    assert (tmp_path / "kinetic_energy_robot.png").exists()


def test_a_topic_that_cannot_be_one(capsys):
    """A topic name that is none is refused before anything starts."""
    with pytest.raises(SystemExit) as ended:
        energy_view.main(["energy_view", "--state", "no topic"])
    assert ended.value.code == 2 and "argument --state: " in capsys.readouterr().err


def test_a_publisher_may_be_known_before_its_node():
    """It then has no name yet; rcl's word for that is not shown."""
    names = [("_NODE_NAMESPACE_UNKNOWN_", "_NODE_NAME_UNKNOWN_"), ("/arm", "driver")]
    found = [SimpleNamespace(node_namespace=space, node_name=name) for space, name in names]
    node = SimpleNamespace(get_publishers_info_by_topic=lambda topic: found)
    assert publishing(node, "/joint_states") == [NOT_YET_KNOWN, "/arm/driver"]
