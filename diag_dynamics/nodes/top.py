# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints of a robot by kinetic energy or torque in the terminal, with peaks and collisions."""

import math
import signal
import sys

from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.utilities import remove_ros_args
from rich.console import Console, Group
from rich.live import Live
from rich.table import Column, Table
from rich.text import Text

from diag_dynamics.entries import Parser
from diag_dynamics.msg import DiagonalizedState, ExternalTorque
from diag_dynamics.nodes.support.clocks import NodeTime, steady_clock
from diag_dynamics.nodes.support.runner import run
from diag_dynamics.text import number, plain

QUIT = "Ctrl-C: quit"
STATE, UNITS = "diag_dynamics/state", {"energy": "J", "torque": "N m", "external": "N m"}


class Top(Node):
    """Shows the newest state on a topic; joints are in the order of their peaks of one of UNITS."""

    def __init__(self, topic=STATE, by="energy", note=QUIT, time=NodeTime, **options):
        super().__init__("top", enable_rosout=False, start_parameter_services=False, **options)
        self._steady = time(self).steady
        self._note = note
        self._by = by
        self._torque = ExternalTorque()
        self._received = -math.inf
        self._peaks = {}
        self.rows = []  # peak, name and values of each joint at the last state
        self._title = self.resolve_topic_name(topic).removesuffix(f"/{STATE}") or "/"
        qos = qos_profile_sensor_data
        torques = f"{topic.removesuffix('state')}external_torque"
        self.create_subscription(DiagonalizedState, topic, self._accept_state, qos)
        self.create_subscription(ExternalTorque, torques, self._accept_torque, qos)
        self._live = Live(screen=True, auto_refresh=False)
        if Console().is_interactive:
            self._live.start()
        self.create_timer(1.0, self._show, clock=steady_clock())

    def _accept_torque(self, message):
        self._torque = message

    def _accept_state(self, message):
        self._energy, self._received, self.rows = message.kinetic_energy, self._steady(), []
        columns = [0.5 * nu * nu for nu in message.nu], message.effort, self._torque.external_torque
        for k, name in enumerate(message.dof_names):
            values = [column[k] if k < len(column) else math.nan for column in columns]
            size = abs(values[[*UNITS].index(self._by)])
            self._peaks[name] = max(self._peaks.get(name, 0.0), size)  # no NaN
            self.rows.append((self._peaks[name], plain(name), values))
        self.rows.sort(reverse=True)

    def _status(self):
        """Return kinetic energy, largest peak and alarm as a line."""
        if not self.rows or self._steady() - self._received > 1.0:
            return Text(f"{self._title}: no state in the last second", "bold red")
        peak, name, _ = self.rows[0]
        text = f"{self._title}: K {number(self._energy)} J, peak {self._by} {number(peak)}"
        text = f"{text} {UNITS[self._by]} at {name}"
        torque = self._torque
        if not torque.collision:
            return Text(text, "bold")
        links = zip(torque.touched_link_probability, torque.touched_links, strict=False)
        _, link = max(links, default=(0.0, ""))
        return Text(f"{text}, ALARM collision {plain(link)}".rstrip(), "bold red")

    def _table(self):
        headings = [*(f"{quantity} {unit}" for quantity, unit in UNITS.items()), "peak"]
        joint = Column("joint", no_wrap=True)
        table = Table(joint, *(Column(text, justify="right") for text in headings), box=None)
        for peak, name, values in self.rows:
            table.add_row(Text(name), *map(number, (*values, peak)))
        return table

    def _show(self):
        if self._live.is_started:
            rows = Text(self._note), self._status(), self._table()
            self._live.update(Group(*rows), refresh=True)
        else:
            print(self._status(), flush=True)

    def destroy_node(self):
        """Restore the terminal."""
        self._live.stop()
        super().destroy_node()


def main(args=None):
    """Show a robot: ``ros2 run diag_dynamics top``."""
    parser = Parser(prog="top", description=__doc__)
    parser.add_argument("topic", nargs="?", default=STATE, help="states (default: %(default)s)")
    parser.add_argument("--by", choices=UNITS, default="energy", help="order and peaks")
    chosen = parser.parse_args(remove_ros_args(args or sys.argv)[1:])
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # as in `top | head`
    return run(lambda: Top(chosen.topic, chosen.by), args)
