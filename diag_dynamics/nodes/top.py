# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints of robots by kinetic energy or torque in the terminal, with peaks and collisions."""

import argparse
import math
import sys
from itertools import chain, repeat

from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.task import Future
from rclpy.utilities import remove_ros_args
from rich.bar import Bar
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from diag_dynamics.msg import DiagonalizedState, ExternalTorque
from diag_dynamics.nodes.support.clocks import NodeTime, steady_clock
from diag_dynamics.nodes.support.graph import topics_of
from diag_dynamics.nodes.support.runner import run
from diag_dynamics.text import number, plain

QUIT = "Ctrl-C: quit"
UNITS = {"energy": "J", "torque": "N m", "external": "N m"}


class Robot:
    """Newest messages of one robot, and the peaks of one of UNITS by joint."""

    def __init__(self, topic, by, time):
        self._title = topic.removesuffix("/diag_dynamics/state") or "/"
        self._by, self._time = by, time
        self._state, self._external = DiagonalizedState(), ExternalTorque()
        self._received = -math.inf
        self.peaks = {}

    @property
    def is_waiting(self):
        """Whether no state has arrived."""
        return self._received == -math.inf

    def accept_state(self, message):
        """Store a state and its peaks."""
        self._state, self._received = message, self._time.steady()
        for name, values in self._joints():
            self.peaks[name] = max(self.peaks.get(name, 0.0), abs(values[self._by]))  # no NaN

    def accept_external_torque(self, message):
        """Store external torques."""
        self._external = message

    def _joints(self):
        energies = [0.5 * nu * nu for nu in self._state.nu]
        columns = energies, self._state.effort, self._external.external_torque
        columns = [chain(column, repeat(math.nan)) for column in columns]
        for name, *values in zip(self._state.dof_names, *columns, strict=False):
            yield plain(name), dict(zip(UNITS, values, strict=True))

    def status(self, progress):
        """Return kinetic energy, largest peak and alarm as a line with its style."""
        if self.is_waiting:
            return Text(f"{self._title}: waiting for the first state{progress}", "bold")
        if self._time.steady() - self._received > 1.0:
            return Text(f"{self._title}: no state in the last second", "bold red")
        name, peak = max(self.peaks.items(), key=lambda joint: joint[1], default=("-", 0.0))
        peak = f"peak {self._by} {number(peak)} {UNITS[self._by]} at {name}"
        text = f"{self._title}: K {number(self._state.kinetic_energy)} J, {peak}"
        if not self._external.collision:
            return Text(text, "bold")
        collisions = zip(self._external.dof_names, self._external.joint_collision, strict=False)
        joints = ", ".join(name for name, collision in collisions if collision)
        links = zip(
            self._external.touched_link_probability, self._external.touched_links, strict=False
        )
        _, link = max(links, default=(0.0, ""))
        place = plain(joints or link)
        return Text(f"{text}, ALARM collision {place}", "bold red")

    def table(self, progress):
        """Return the status and the joints, the largest peak first, with bars up to that peak."""
        table = Table(box=None, pad_edge=False, expand=True)
        table.add_column("joint", no_wrap=True)
        for heading in (*(f"{quantity} {unit}" for quantity, unit in UNITS.items()), "peak"):
            table.add_column(heading, justify="right", no_wrap=True)
        table.add_column(self._by, ratio=1, no_wrap=True)
        for name, values in sorted(self._joints(), key=lambda joint: -self.peaks[joint[0]]):
            size = max(0.0, abs(values[self._by]))
            bar = Bar(max(self.peaks.values()), 0.0, size, color="cyan")
            table.add_row(Text(name), *map(number, (*values.values(), self.peaks[name])), bar)
        return Group(self.status(progress), table)


class Top(Node):
    """Shows the robots of `topics`, or all, until `finished` is done after a duration [s]."""

    def __init__(self, topics=(), by="energy", duration=math.inf, note=QUIT, time=NodeTime, **kw):
        super().__init__("top", enable_rosout=False, start_parameter_services=False, **kw)
        self._topics, self._by, self._note = topics, by, note
        self._time = time(self)
        self._end = self._time.steady() + duration
        self._robots, self._progress, self._printed = {}, "", set()
        self.finished = Future()
        self._find_robots()
        self._live = Live(screen=True, auto_refresh=False) if has_screen() else None
        if self._live:
            self._live.start()
        self.create_timer(0.5 if self._live else 1.0, self._show, clock=steady_clock())

    @property
    def has_states(self):
        """Whether any robot has published a state."""
        return any(robot.peaks for robot in self._robots.values())

    def accept_progress(self, text):
        """Store what is compiled; any thread may call it."""
        self._progress = f" ({text})"

    def _subscribe(self, topic):
        self._robots[topic] = robot = Robot(topic, self._by, self._time)
        external = f"{topic.rpartition('/')[0]}/external_torque"
        qos = qos_profile_sensor_data
        self.create_subscription(DiagonalizedState, topic, robot.accept_state, qos)
        self.create_subscription(ExternalTorque, external, robot.accept_external_torque, qos)

    def _find_robots(self):
        for topic in self._topics or topics_of(self, "diag_dynamics/msg/DiagonalizedState"):
            if topic not in self._robots and not topic.endswith("/ground_truth"):
                self._subscribe(topic)

    def _show(self):
        self._find_robots()
        robots = [robot for _, robot in sorted(self._robots.items())]
        robots = robots or [Robot("any robot", self._by, self._time)]
        if self._live:
            self._live.update(
                Group(Text(self._note), *(robot.table(self._progress) for robot in robots)),
                refresh=True,
            )
        else:
            self._print(robots)
        if self._time.steady() > self._end and not self.finished.done():
            self.finished.set_result(None)

    def _print(self, robots):
        """Print a line about each robot, and once that it has no state yet."""
        for robot in robots:
            line = str(robot.status(self._progress))
            if robot.is_waiting and line in self._printed:
                continue
            if robot.is_waiting:
                self._printed.add(line)
            try:
                print(line, flush=True)
            except BrokenPipeError as error:
                self.finished.set_exception(error)
                return

    def destroy_node(self):
        """Restore the terminal."""
        if self._live:
            self._live.stop()
        return super().destroy_node()


def has_screen():
    """Return whether the terminal can draw tables."""
    return sys.stdout.isatty() and not Console().is_dumb_terminal


def main(args=None):
    """Show robots: ``ros2 run diag_dynamics top``."""
    parser = argparse.ArgumentParser(prog="top", description=__doc__)
    parser.add_argument("topic", nargs="*", help="states that are shown (default: all)")
    parser.add_argument("--by", choices=UNITS, default="energy", help="order, peaks and bars")
    chosen = parser.parse_args(remove_ros_args(args or sys.argv)[1:])
    return run(lambda: Top(chosen.topic, chosen.by), args)
