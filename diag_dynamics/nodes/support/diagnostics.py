# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The entries of a node on /diagnostics, once a second."""

import re
from collections.abc import Mapping
from contextlib import suppress
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from diag_dynamics.nodes.support.clocks import steady_clock
from diag_dynamics.numerics.progress import set_progress_callback
from diag_dynamics.text import plain

OK, WARN, ERROR, STALE = (
    getattr(DiagnosticStatus, level) for level in ("OK", "WARN", "ERROR", "STALE")
)

PERIOD = 1.0

MAX_NAMES = 8
"""Names that a value lists at most."""

MAX_LENGTH = 1000
"""Characters that a message or a value has at most."""


class Status(NamedTuple):
    """One entry: its name after the node's, level, message, and values by key."""

    name: str
    level: bytes
    message: str
    values: Mapping = {}


def counted(names):
    """Return how many names there are, and all of them if they are few."""
    return f"{len(names)}: {', '.join(names)}" if 0 < len(names) <= MAX_NAMES else str(len(names))


def shortened(text, most=MAX_LENGTH):
    """Return a text, or its beginning, with control characters escaped: others may have written parts of it."""
    return plain(text) if len(text) <= most else f"{plain(text[:most])}… ({len(text)} characters)"


_MEASURED = re.compile(
    r"'[^']*'|= [^\s,;]+|(?<![\w/.^])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w/])"
)


def steady(text):
    """Return a text without measured numbers, so that a message stays the same while a fault lasts.

    Numbers of parameters (``name = number``) and within names stay.
    """
    return _MEASURED.sub(lambda found: found[0] if found[0][0] in "'=" else "…", text)


class Diagnostics:
    """Publishes what `report` returns, a list of :class:`Status`, once a second of steady time.

    `robot` returns the model in force, whose name is that of the hardware, or None.
    """

    def __init__(self, node, report, robot):
        self._node, self._report, self._robot = node, report, robot
        self._name = node.get_fully_qualified_name().lstrip("/")
        self._compiled = ""
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        node.create_timer(PERIOD, self._tick, clock=steady_clock())
        set_progress_callback(self._report_compiling)

    def _tick(self):
        # The entry stays after the first compilation: an aggregator takes one that disappears for stale.
        idle = [Status("compiling", OK, "idle", {"last": self._compiled})] if self._compiled else []
        self.publish([*self._report(), *idle])

    def _report_compiling(self, text):
        """Log and publish at once what is compiled; the compiler calls it in a thread."""
        self._compiled = text
        with suppress(Exception):  # the node may be gone
            self._node.get_logger().info(text)
            self.publish([Status("compiling", OK, "compiling", {"what": text})])

    def publish(self, statuses):
        """Publish statuses at once."""
        array = DiagnosticArray()
        model = self._robot()
        hardware = shortened(model.name) if model else ""
        for name, level, message, values in statuses:
            status = DiagnosticStatus(
                level=level, name=shortened(f"{self._name}: {name}"), message=shortened(message)
            )
            status.hardware_id = hardware
            status.values = [
                KeyValue(key=shortened(str(key)), value=shortened(str(value)))
                for key, value in values.items()
            ]
            array.status.append(status)
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)
