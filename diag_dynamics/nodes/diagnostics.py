"""One entry on /diagnostics, once a second: what came in, what was wrong with it, and which model is in force."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType

PERIOD = 1.0

FEW = 8
"""Names that a value lists at most."""


def counted(names):
    """How many there are, and the names of few."""
    return f"{len(names)}: {', '.join(names)}" if 0 < len(names) <= FEW else str(len(names))


class Diagnostics:
    """Publishes what `report` says, once a second of wall time even where simulated time stands still.

    Parameters
    ----------
    node : rclpy.node.Node
    name : str
        Name of the status, after the node's.
    report : callable
        Returns level (DiagnosticStatus.OK …), a message, and a dict of values.
    """

    def __init__(self, node, name, report):
        self._node = node
        self._name = f"{node.get_fully_qualified_name().lstrip('/')}: {name}"
        self._report = report
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._timer = node.create_timer(PERIOD, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def publish(self):
        """Publish the present report."""
        level, message, values = self._report()
        status = DiagnosticStatus(level=level, name=self._name, message=message, hardware_id="")
        status.values = [KeyValue(key=str(key), value=str(value)) for key, value in values.items()]
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)
