# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The entries of a node on /diagnostics, once a second."""

from contextlib import suppress

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from diag_dynamics.nodes.support.clocks import steady_clock
from diag_dynamics.nodes.support.statuses import ERROR, OK, WARN, Status, StatusLog
from diag_dynamics.numerics.progress import set_progress_callback
from diag_dynamics.text import listed, shortened

PERIOD = 1.0


def counted(names):
    """Return how many names there are, and the first of them."""
    return f"{len(names)}: {listed(names)}" if names else "0"


class Diagnostics:
    """Publishes what `report` returns, a list of :class:`Status`, once a second of steady time.

    The node's log has the begin and the end of each fault, see :class:`StatusLog`.

    `robot` returns the model in force, whose name is that of the hardware, or None.
    """

    def __init__(self, node, report, robot):
        self._node = node
        self._report = report
        self._robot = robot
        self._name = node.get_fully_qualified_name().lstrip("/")
        self._compiled = ""
        self._log = StatusLog()
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        node.create_timer(PERIOD, self._tick, clock=steady_clock())
        set_progress_callback(self._report_compiling)

    def _tick(self):
        # The entry stays after the first compilation: an aggregator takes one that disappears for
        # stale.
        idle = [Status("compiling", OK, "idle", {"last": self._compiled})] if self._compiled else []
        self.publish([*self._report(), *idle])

    def _report_compiling(self, text):
        """Log and publish at once what is compiled; the compiler calls it in a thread."""
        self._compiled = text
        with suppress(Exception):  # the node may be gone
            self._node.log_info(text)
            self.publish([Status("compiling", OK, "compiling", {"what": text})])

    def publish(self, statuses):
        """Publish statuses at once, and log the faults that begin or end."""
        array = DiagnosticArray()
        model = self._robot()
        hardware = shortened(model.name) if model else ""
        for name, level, message, values, *_ in statuses:
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
        for level, text in self._log.lines(statuses, self._node.time.steady()):
            if level == ERROR:
                self._node.log_error(text)
            elif level == WARN:
                self._node.log_warning(text)
            else:
                self._node.log_info(text)
