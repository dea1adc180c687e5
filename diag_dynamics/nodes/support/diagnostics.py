# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The entries of a node on /diagnostics, once a second."""

import re
from collections.abc import Mapping
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType

from diag_dynamics.text import plain

OK, WARN, ERROR, STALE = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.ERROR,
    DiagnosticStatus.STALE,
)

PERIOD = 1.0

FEW = 8
"""Names that a value lists at most."""

LONG = 1000
"""Characters that a message or a value has at most."""


class Status(NamedTuple):
    """One entry: its name after the node's, its level, what is to be said, and values by key."""

    name: str
    level: bytes
    message: str
    values: Mapping = {}


def counted(names):
    """How many there are, and the names of few."""
    return f"{len(names)}: {', '.join(names)}" if 0 < len(names) <= FEW else str(len(names))


def shortened(text, most=LONG):
    """The text, or its beginning, safe to show: what arrives may be long and hold anything, what is said of it may not."""
    return plain(text) if len(text) <= most else f"{plain(text[:most])}… ({len(text)} characters)"


_MEASURED = re.compile(r"'[^']*'|= [^\s,;]+|(?<![\w/.^])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w/])")


def steady(text):
    """A text without its numbers, but for those of parameters (``name = number``) and of names: it stays while a fault does.

    The message of a status says what is wrong, and who watches it is told once; how wrong it is now is for its values.
    """
    return _MEASURED.sub(lambda found: found[0] if found[0][0] in "'=" else "…", text)


class Diagnostics:
    """Publishes what `report` says, once a second of wall time even where simulated time stands still.

    Parameters
    ----------
    node : rclpy.node.Node
    report : callable
        Returns a list of :class:`Status`.
    robot : callable
        Returns the model in force, whose name is that of the hardware; None while there is none.
    """

    def __init__(self, node, report, robot):
        self._node = node
        self._name = node.get_fully_qualified_name().lstrip("/")
        self._report, self._robot = report, robot
        self._compiled = ""
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._timer = node.create_timer(PERIOD, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _tick(self):
        # Once told of, the entry stays: an aggregator takes one that comes no more for stale, and its group for an error.
        idle = [Status("compiling", OK, "nothing is compiled", {"last": self._compiled})] if self._compiled else []
        self.publish([*self._report(), *idle])

    def tell_compiling(self, text):
        """Publish at once that something is compiled; may be called by another thread, while the node serves nothing."""
        self._compiled = text
        self.publish([Status("compiling", OK, "compiling", {"what": text})])

    def publish(self, statuses):
        """Publish some statuses at once."""
        array = DiagnosticArray()
        model = self._robot()
        hardware = shortened(model.name) if model else ""
        for name, level, message, values in statuses:
            status = DiagnosticStatus(level=level, name=shortened(f"{self._name}: {name}"), message=shortened(message))
            status.hardware_id = hardware
            status.values = [
                KeyValue(key=shortened(str(key)), value=shortened(str(value))) for key, value in values.items()
            ]
            array.status.append(status)
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)
