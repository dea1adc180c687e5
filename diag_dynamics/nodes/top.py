# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots on the graph in this terminal: their joints by energy, torque or velocity, with peaks, limits and alarms."""

import argparse
import copy
import math
import os
import re
import select
import signal
import sys
import termios
import tty
from functools import partial

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from rclpy.utilities import remove_ros_args
from rich.console import Console
from std_msgs.msg import String

from diag_dynamics.msg import DiagonalizedState, ExternalTorque
from diag_dynamics.nodes.screen import BLOCKS, ENERGY, EXTERNAL, LETTERS, MAX_SILENCE, Robot, View
from diag_dynamics.nodes.support.clocks import NodeTime
from diag_dynamics.nodes.support.graph import topics_of
from diag_dynamics.nodes.support.guard import attempt
from diag_dynamics.nodes.support.runner import run
from diag_dynamics.nodes.support.topics import NODES
from diag_dynamics.text import duration, number, plain

STATE = "diag_dynamics/msg/DiagonalizedState"

FRAME_RATE = 5.0
"""Frames per second by default."""

ARROWS = {"A": "up", "B": "down", "C": "right", "D": "left"}


class Keyboard:
    """Keys of the terminal, without Enter and echo; none if standard input is no terminal."""

    def __init__(self, fd=0):
        self._fd, self._mode = fd, termios.tcgetattr(fd) if os.isatty(fd) else None
        self._stop = signal.signal(
            signal.SIGTSTP, signal.SIG_IGN
        )  # the shell would draw on this screen
        if self._mode:
            tty.setcbreak(fd, termios.TCSANOW)

    def read(self):
        """Return the keys since the last call; q if the terminal has gone."""
        if not self._mode or not select.select([self._fd], [], [], 0.0)[0]:
            return []
        try:
            text = os.read(self._fd, 1024).decode(errors="replace") or "q"
        except OSError:
            text = "q"
        keys = re.findall(r"\x1b[\[O][\d;]*[A-Za-z~]|.", text, re.DOTALL)
        return [ARROWS.get(key[-1], "") if key[0] == "\x1b" else key for key in keys]

    def close(self):
        """Restore the mode of the terminal."""
        signal.signal(signal.SIGTSTP, self._stop)
        if self._mode:
            termios.tcsetattr(self._fd, termios.TCSANOW, self._mode)


class Top(Node):
    """Shows `topics`, or all robots on the graph, until the user quits: `finished` is done then."""

    def __init__(
        self,
        topics=(),
        rate=FRAME_RATE,
        duration=math.inf,
        lines=False,
        note="",
        time=NodeTime,
        **kwargs,
    ):
        super().__init__("top", enable_rosout=False, start_parameter_services=False, **kwargs)
        self.finished, self.time = Future(), time(self)
        self._topics, self._robots, self._received = topics, {}, []
        self._paused = self._console = self._frame = None
        self._end = self.time.steady() + duration
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._find_robots()
        self.create_timer(1.0, self._find_robots, clock=steady)
        self.create_timer(
            1.0 if lines else 1.0 / rate, self._print if lines else self._draw, clock=steady
        )
        if not lines:
            self._console = make_console()
            self._view = View(note, LETTERS if self._console.options.ascii_only else BLOCKS)
            self._console.set_alt_screen(True)
            self._console.show_cursor(False)
            self._keyboard = Keyboard()

    @property
    def has_states(self):
        """Whether any robot has published a state."""
        return any(robot.names for robot in self._robots.values())

    def _find_robots(self):
        """Subscribe to new robots; only `--state` shows a simulator's own states."""
        found = [topic for topic in topics_of(self, STATE) if not topic.endswith("/ground_truth")]
        for topic in self._topics or found:
            if topic not in self._robots:
                self._robots[topic] = self._subscribe(topic)

    def _subscribe(self, topic):
        """Return the robot of a monitor's states, external torques and description."""
        monitor = topic.rpartition("/")[0]
        namespace, _, name = monitor.rpartition("/")
        robot = Robot((namespace or "/") if name == NODES["monitor"] else topic, topic)
        newest = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for kind, name, accept, qos in (
            (DiagonalizedState, topic, Robot.accept_state, newest),
            (ExternalTorque, f"{monitor}/external_torque", Robot.accept_external_torque, newest),
            (String, f"{namespace}/robot_description", Robot.accept_description, latched),
        ):
            self.create_subscription(
                kind, name, partial(self._receive, robot, kind, accept), qos, raw=True
            )
        return robot

    def _receive(self, robot, kind, accept, data):
        """Store a message until the next frame: many at once cost a third of the CPU time."""
        self._received.append((robot, kind, accept, data, self.time.now(), self.time.steady()))

    def _accept_received(self):
        received, self._received = self._received, []
        for robot, kind, accept, data, *times in received:
            message, fault = attempt(deserialize_message, data, kind)
            robot.rejected += bool(fault or attempt(accept, robot, message, *times)[1])

    def _shown(self):
        self._accept_received()
        robots = [robot for _, robot in sorted(self._robots.items())]
        return robots or [Robot("diag_dynamics", f"any topic of type {STATE}")]

    def _draw(self):
        view, size, now = self._view, self._console.size, self.time.steady()
        robots = self._shown()
        for key in filter(None, self._keyboard.read()):
            view.press(key)
            for robot in self._robots.values() if view.reset else ():
                robot.reset_peaks()
        self._paused = (self._paused or copy.deepcopy((robots, now))) if view.paused else None
        frame = view.draw(*(self._paused or (robots, now)), size.width, size.height)
        if frame != self._frame:
            self._console.update_screen_lines(frame)
            self._frame = frame
        self._finish_if(view.quit or now > self._end)

    def _print(self):
        now, closed = self.time.steady(), False
        try:
            for robot in self._shown():
                print(plain(line_of(robot, now)), flush=True)
        except BrokenPipeError:
            closed = True
            os.dup2(
                os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno()
            )  # Python flushes it at its end
        self._finish_if(closed or now > self._end)

    def _finish_if(self, condition):
        if condition and not self.finished.done():
            self.finished.set_result(None)

    def destroy_node(self):
        """Restore the terminal."""
        if self._console:
            self._keyboard.close()
            self._console.show_cursor(True)
            self._console.set_alt_screen(False)
            self._console = None
        return super().destroy_node()


def make_console(**options):
    """Return a console that interprets nothing of the text, and replaces what its terminal cannot show."""
    sys.stdout.reconfigure(errors="replace")
    plain_text = {"markup": False, "emoji": False, "highlight": False}
    return Console(**{"force_terminal": True} | plain_text | options)


def line_of(robot, now):
    """Return a robot as one line of text."""
    if not robot.names:
        return f"{robot.title}: waiting for states on {robot.topic}"
    if robot.silence(now) > MAX_SILENCE:
        return f"{robot.title}: no state for {duration(robot.silence(now))}"
    energies, external, limits = robot.last[ENERGY], robot.last[EXTERNAL], robot.limits[EXTERNAL]
    largest = [f"{robot.names[k]} {number(energies[k])}" for k in np.argsort(-energies)[:4]]
    energy = f"K {number(robot.energy)} J, peak {number(robot.energy_peak)}"
    parts = [f"{robot.title}: {energy}", f"{', '.join(largest)} J"]
    fraction = np.nan_to_num(np.abs(external) / limits)
    if fraction.any():
        k = int(fraction.argmax())
        parts.append(f"external {robot.names[k]} {number(external[k])} of {number(limits[k])} N m")
    alarm = [f"ALARM {robot.alarm}"] if robot.alarm else []
    return "; ".join([*parts, f"{robot.rate(now)} Hz", *alarm])


def has_screen():
    """Return whether the terminal can draw frames."""
    return sys.stdout.isatty() and os.environ.get("TERM", "dumb") not in ("", "dumb", "unknown")


def main(args=None):
    """Show robots: ``ros2 run diag_dynamics top``."""
    parser = argparse.ArgumentParser(prog="top", description=__doc__)
    states = "states that are shown (default: those of all robots); may be repeated"
    parser.add_argument("--state", metavar="TOPIC", action="append", default=[], help=states)
    parser.add_argument(
        "--rate", type=float, default=FRAME_RATE, help="frames per second (default: %(default)g)"
    )
    parser.add_argument("--duration", type=float, default=math.inf, help="time to run [s]")
    parser.add_argument(
        "--lines", action="store_true", help="a line per second, as without a terminal"
    )
    chosen = parser.parse_args(remove_ros_args(args or sys.argv)[1:])
    if not 0.0 < chosen.rate <= 60.0:
        parser.error(f"argument --rate: {chosen.rate} is not a number > 0 and <= 60")
    if not chosen.duration > 0.0:
        parser.error(f"argument --duration: {chosen.duration} is not a number > 0")
    for topic in chosen.state:
        if not re.fullmatch(r"(/[A-Za-z_]\w*)+", topic):
            parser.error(
                f"argument --state: '{topic}' is not a full topic name such as /diag_dynamics/state"
            )
    lines = chosen.lines or not has_screen()
    return run(lambda: Top(chosen.state, chosen.rate, chosen.duration, lines), args)


if __name__ == "__main__":
    sys.exit(main())
