# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints of robots by kinetic energy or torque in the terminal, with peaks and collisions."""

import argparse
import math
import sys
from itertools import chain, compress, repeat

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

    def __init__(self, topic, by):
        self._title, self._by = topic.removesuffix("/diag_dynamics/state") or "/", by
        self._state, self.external_torque = DiagonalizedState(), ExternalTorque()
        self._received = -math.inf
        self.peaks = {}

    def accept_state(self, message, now):
        """Store a state and its peaks."""
        self._state, self._received = message, now
        for name, values in self._joints():
            self.peaks[name] = max(self.peaks.get(name, 0.0), abs(values[self._by]))  # no NaN

    def _joints(self):
        """Yield the name of each joint and its values by UNITS, NaN where unknown."""
        energies = [0.5 * nu * nu for nu in self._state.nu]
        columns = energies, self._state.effort, self.external_torque.external_torque
        columns = [chain(column, repeat(math.nan)) for column in columns]
        for name, *values in zip(self._state.dof_names, *columns, strict=False):
            yield plain(name), dict(zip(UNITS, values, strict=True))

    def status(self, now, progress):
        """Return kinetic energy, largest peak and alarm as a line."""
        if not self.peaks:
            return Text(f"{self._title}: waiting for the first state{progress}", "bold")
        if now - self._received > 1.0:
            return Text(f"{self._title}: no state in the last second", "bold red")
        name = max(self.peaks, key=self.peaks.get)
        peak = f"peak {self._by} {number(self.peaks[name])} {UNITS[self._by]} at {name}"
        text = f"{self._title}: K {number(self._state.kinetic_energy)} J, {peak}"
        torque = self.external_torque
        if not torque.collision:
            return Text(text, "bold")
        joints = ", ".join(compress(torque.dof_names, torque.joint_collision))
        links = dict(zip(torque.touched_links, torque.touched_link_probability, strict=False))
        place = joints or max(links, key=links.get, default="")
        return Text(f"{text}, ALARM collision {plain(place)}", "bold red")

    def table(self):
        """Return the joints, the largest peak first, with bars up to that peak."""
        table = Table(box=None, pad_edge=False, expand=True)
        table.add_column("joint", no_wrap=True)
        for heading in (*(f"{quantity} {unit}" for quantity, unit in UNITS.items()), "peak"):
            table.add_column(heading, justify="right", no_wrap=True)
        table.add_column(self._by, ratio=1, no_wrap=True)
        for name, values in sorted(self._joints(), key=lambda joint: -self.peaks[joint[0]]):
            size = max(0.0, abs(values[self._by]))
            bar = Bar(max(self.peaks.values()), 0.0, size, color="cyan")
            table.add_row(Text(name), *map(number, (*values.values(), self.peaks[name])), bar)
        return table


class Top(Node):
    """Shows the robots of `topics`, or all, until `finished` is done after a duration [s]."""

    def __init__(self, topics=(), by="energy", duration=math.inf, note=QUIT, time=NodeTime, **kw):
        super().__init__("top", enable_rosout=False, start_parameter_services=False, **kw)
        self._topics, self._by, self._note = topics, by, note
        self._time = time(self)
        self._end = self._time.steady() + duration
        self._robots, self._progress = {}, ""
        self.finished = Future()
        self._live = Live(screen=True, auto_refresh=False) if has_screen() else None
        if self._live:
            self._live.start()
        self._find_robots()
        self.create_timer(0.5 if self._live else 1.0, self._show, clock=steady_clock())

    @property
    def has_states(self):
        """Whether any robot has published a state."""
        return any(robot.peaks for robot in self._robots.values())

    def accept_progress(self, text):
        """Store the name of the function in compilation; any thread may call it."""
        self._progress = f" ({text})"

    def _find_robots(self):
        for topic in self._topics or topics_of(self, "diag_dynamics/msg/DiagonalizedState"):
            if topic not in self._robots and not topic.endswith("/ground_truth"):
                self._robots[topic] = robot = Robot(topic, self._by)
                self._subscribe(robot, topic)

    def _subscribe(self, robot, topic):
        def accept_state(message):
            robot.accept_state(message, self._time.steady())

        def accept_external_torque(message):
            robot.external_torque = message

        qos, torques = qos_profile_sensor_data, f"{topic.rpartition('/')[0]}/external_torque"
        self.create_subscription(DiagonalizedState, topic, accept_state, qos)
        self.create_subscription(ExternalTorque, torques, accept_external_torque, qos)

    def _show(self):
        self._find_robots()
        now, rows = self._time.steady(), []
        for _, robot in sorted(self._robots.items()) or [("", Robot("any robot", self._by))]:
            rows += [robot.status(now, self._progress), robot.table()]
        try:
            if self._live:
                self._live.update(Group(Text(self._note), *rows), refresh=True)
            else:
                print(*rows[::2], sep="\n", flush=True)
        except BrokenPipeError as error:
            self.finished.set_exception(error)
        if now > self._end and not self.finished.done():
            self.finished.set_result(None)

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
