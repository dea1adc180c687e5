# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`top` in a real terminal, tmux: what a robot on the graph does is on the screen, and keys change it."""

import contextlib
import math
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
from diag_dynamics.msg import DiagonalizedState, ExternalTorque
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from nodes import START
from processes import Process

pytestmark = [pytest.mark.full, pytest.mark.live]

TOP = Path(__file__).resolve().parents[2] / "scripts" / "top"
NAMES = ["shoulder", "elbow", "wrist"]
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
URDF = (
    "<robot name='r'>"
    + "".join(
        f"<joint name='{name}' type='revolute'><limit lower='-1' upper='1' effort='{effort}' velocity='2'/></joint>"
        for name, effort in zip(NAMES, (100, 50, 10), strict=True)
    )
    + "</robot>"
)


class Robot:
    """Publishes what a monitor would, of three joints."""

    def __init__(self, peer, namespace):
        self.peer, name = peer, f"{namespace}/diag_dynamics"
        kinds = (ExternalTorque, "external_torque"), (DiagonalizedState, "state")
        self.publishers = [peer.publisher(kind, f"{name}/{topic}") for kind, topic in kinds]
        self.description = peer.publisher(String, f"{namespace}/robot_description", LATCHED)
        self.description.publish(String(data=URDF))

    def say(self, nu=(1.0, 2.0, 3.0), effort=(10.0, -45.0, 1.0), external=(1.0, 2.0, 0.5)):
        """Publish a state and what is seen of external torque."""
        now = self.peer.node.get_clock().now().to_msg()
        nu = np.array(nu)
        state = DiagonalizedState(dof_names=NAMES, nu=nu.tolist(), effort=list(effort), effort_valid=True, power=-1.5)
        state.velocity, state.coriolis = (0.5 * nu).tolist(), (0.1 * nu[::-1]).tolist()
        state.articulated_inertia = [1.0] * 3
        state.kinetic_energy = float(0.5 * nu @ nu)
        thresholds = [20.0, 10.0, 5.0]
        seen = ExternalTorque(dof_names=NAMES, valid=True, external_torque=list(external), torque_threshold=thresholds)
        seen.norm, seen.threshold = 0.5, math.inf
        seen.torque_norm, seen.torque_norm_threshold = float(np.linalg.norm(external)), 30.0
        seen.joint_collision = [bool(x) for x in np.abs(external) > np.array(thresholds)]
        seen.collision = any(seen.joint_collision)
        for publisher, message in zip(self.publishers, (seen, state), strict=True):
            message.header.stamp = now
            publisher.publish(message)


class Terminal(contextlib.AbstractContextManager):
    """tmux with `top` in it."""

    def __init__(self, folder, width, height, *arguments, term="tmux-256color"):
        nothing = folder / "tmux.conf"
        nothing.touch()
        self._tmux = ["tmux", "-S", str(folder / "socket"), "-f", str(nothing)]
        command = f"trap : INT; env TERM={term} {sys.executable} {TOP} {' '.join(arguments)}; echo status $?; exec cat"
        environment = os.environ | {"LANG": "C.UTF-8", "LC_ALL": "C.UTF-8", "SHELL": "/bin/sh"}
        self._run("new-session", "-d", "-x", str(width), "-y", str(height), command, env=environment)

    def _run(self, *arguments, **options):
        done = subprocess.run([*self._tmux, *arguments], capture_output=True, text=True, timeout=60, **options)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def screen(self, colours=False):
        """What is on it."""
        return self._run("capture-pane", "-p", *(["-e"] if colours else []))

    def type(self, *keys):
        """Send keys, by tmux's names."""
        self._run("send-keys", *keys)

    def resize(self, width, height):
        """Make it another one."""
        self._run("resize-window", "-x", str(width), "-y", str(height))

    def process(self):
        """That of `top`."""
        (pane,) = self._run("list-panes", "-F", "#{pane_pid}").split()
        return next(p for p in psutil.Process(int(pane)).children(recursive=True) if str(TOP) in p.cmdline())

    def __exit__(self, *_):
        subprocess.run([*self._tmux, "kill-server"], capture_output=True, timeout=60)


@pytest.fixture
def terminal(tmp_path):
    """Return what opens one."""
    assert shutil.which("tmux"), "the tests of terminal views need tmux"
    with contextlib.ExitStack() as stack:
        yield lambda *options, **named: stack.enter_context(Terminal(tmp_path, *options, **named))


def until(screen, robots, condition, what, **said):
    """Have robots go on until all of something is on a screen, for half a frame may be seen; returns that."""
    deadline = time.monotonic() + START
    while not condition(shown := screen()):
        assert time.monotonic() < deadline, f"waited in vain for {what}:\n{shown}"
        for robot in robots:
            robot.say(**said)
        time.sleep(0.02)  # 50 Hz
    return shown


def rows(shown, count):
    """The first words of each joint's row."""
    return [line.split()[:count] for line in shown.splitlines() if line.split()[:1] and line.split()[0] in NAMES]


def test_a_robot_on_the_screen(peer, terminal):
    """Energies of joints, then torques by limit, external torque with its alarm, sorted; and the terminal is given back."""
    robot, view = Robot(peer, "/one"), terminal(80, 24)

    def shows(*texts, condition=lambda shown: True, **said):
        def what(shown):
            return all(text in shown for text in texts) and condition(shown)

        return until(view.screen, [robot], what, repr(texts), **said)

    expected = [["shoulder", "0.500"], ["elbow", "2.000"], ["wrist", "4.500"]]
    texts = "/one", "K 7.000 J", "power -1.5 W", "Hz", "⣿", "▁", "peak 7 J"
    shows(*texts, condition=lambda shown: rows(shown, 2) == expected)
    view.type("2")
    shows("2 torque", "90 %", "of limit", "-45.00")
    view.type("3", "s", "s", "s")
    pushed = {"external": (1.0, -12.0, 0.5)}
    texts = "ALARM collision: elbow", "120 %", "sort: part of limit"
    shows(*texts, condition=lambda shown: rows(shown, 1) == [["elbow"], ["wrist"], ["shoulder"]], **pushed)
    red = "\x1b[1m\x1b[31m", "\x1b[1;31m"
    until(lambda: view.screen(colours=True), [robot], lambda shown: any(code in shown for code in red), "red", **pushed)
    view.type("/", "w", "r", "Enter")
    shows("/wr", condition=lambda shown: "shoulder" not in shown)
    view.type("?")
    shows("begin peaks anew")
    view.type("?", "Escape")
    shows("shoulder")
    view.resize(40, 20)
    until(
        view.screen, [robot], lambda shown: "? q" in shown and max(map(len, shown.splitlines())) <= 40, "forty columns"
    )
    view.type("q")
    shown = until(view.screen, [robot], lambda shown: "status 0" in shown, "the end")
    assert "shoulder" not in shown  # the screen before is back


def test_pause_peaks_and_silence(peer, terminal):
    """What is paused stays; peaks are those of all states until they begin anew; a robot that says nothing is told of."""
    robot, view = Robot(peer, "/two"), terminal(100, 30, "--state", "/two/diag_dynamics/state")

    def shows(*texts, **said):
        return until(view.screen, [robot], lambda shown: all(text in shown for text in texts), repr(texts), **said)

    shows("K 7.000 J")
    shows("K 50.00 J", nu=(10.0, 0.0, 0.0))
    shows("K 7.000 J", "peak 50 J")
    view.type("Space")
    shows("PAUSED")
    for _ in range(30):
        robot.say(nu=(1.0, 0.0, 0.0))
        time.sleep(0.02)
    assert "K 7.000 J" in view.screen() and "0.500 J" not in view.screen()
    view.type("Space")

    shows("K 0.500 J", nu=(1.0, 0.0, 0.0))  # no state of before is under way any more
    view.type("r")
    shows("peak 0.5 J", nu=(1.0, 0.0, 0.0))
    until(view.screen, [], lambda shown: "no state for" in shown, "silence")


def test_several_robots(peer, terminal):
    """One after the other by Tab, all of them by `o`; each with its own."""
    robots = [Robot(peer, f"/{name}") for name in ("left", "right")]
    view = terminal(120, 40)

    def name(shown):
        return next(iter(shown.split()), "")

    shown, seen = until(view.screen, robots, lambda shown: "1/" in shown and "K 7.000 J" in shown, "the first"), set()
    for _ in range(8):
        seen |= {name(shown)} & {"/left", "/right"}
        if len(seen) == 2:
            break
        view.type("Tab")
        before = name(shown)
        shown = until(view.screen, robots, lambda now, before=before: name(now) not in ("", before), "another")
    assert seen == {"/left", "/right"}
    view.type("o")

    def overview(shown):
        return [line.split()[:3] for line in shown.splitlines() if line.startswith(("/left", "/right"))]

    expected = [["/left", "7.000", "7.000"], ["/right", "7.000", "7.000"]]
    until(view.screen, robots, lambda shown: "robot " in shown and overview(shown) == expected, "all")


def test_messages_that_make_no_sense(peer, terminal):
    """They are counted, and end nothing."""
    robot, view = Robot(peer, "/odd"), terminal(80, 24, "--state", "/odd/diag_dynamics/state")
    until(view.screen, [robot], lambda shown: "K 7.000 J" in shown, "a state")
    for fields in ({"nu": [1.0, 2.0]}, {"velocity": [1.0] * 5}, {"nu": [1.0] * 3, "effort": [], "effort_valid": True}):
        message = DiagonalizedState(dof_names=NAMES, **fields)
        message.header.stamp = peer.node.get_clock().now().to_msg()
        robot.publishers[1].publish(message)
    seen = ExternalTorque(
        dof_names=NAMES, valid=True, external_torque=[math.nan] * 2, torque_threshold=[0.0, -1.0, math.nan]
    )
    robot.publishers[0].publish(seen)
    robot.description.publish(String(data="<robot><joint/><joint name='wrist'><limit effort='much'/></joint>"))
    until(view.screen, [robot], lambda shown: "3 messages made no sense" in shown, "that it is told")
    view.type("2")
    until(view.screen, [robot], lambda shown: "2 torque" in shown and "-45.00" in shown, "more")


def test_nobody_yet(peer, terminal):
    view = terminal(80, 24, "--state", "/nobody/state")
    until(view.screen, [], lambda shown: "waiting for states on /nobody/state" in shown, "what it waits for")
    view.type("C-c")
    shown = until(view.screen, [], lambda shown: "status" in shown, "the end")
    assert "status 0" in shown and "Traceback" not in shown


@pytest.mark.parametrize("how", ["dumb", "pipe"])
def test_terminals_that_can_do_no_more(peer, terminal, how):
    """A line a second, in letters."""
    robot = Robot(peer, "/plain")
    arguments = "--state", "/plain/diag_dynamics/state", "--duration", "600"
    expected = "/plain: K 7 J, peak 7; wrist 4.5, elbow 2, shoulder 0.5 J; external elbow 2 of 10 N m;"
    if how == "dumb":
        view = terminal(120, 24, *arguments, term="dumb")
        shown = until(view.screen, [robot], lambda shown: expected in shown, expected)
        assert shown.isascii()
        return
    with Process([sys.executable, TOP, *arguments]) as process:
        until(lambda: process.output, [robot], lambda shown: expected in shown, expected)
        assert "\x1b" not in process.output


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--rate", "0"], "argument --rate: 0.0"),
        (["--rate", "nan"], "argument --rate: nan"),
        (["--duration", "-1"], "argument --duration"),
        (["--state", "no topic"], "argument --state"),
        (["--state", "relative"], "does not begin with /"),
    ],
)
def test_what_makes_no_sense(arguments, says):
    with Process([sys.executable, TOP, *arguments]) as process:
        assert process.wait() == 2
        assert says in process.output and "Traceback" not in process.output
