# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a touch would cost, as a monitor tells it: listened to only where it judges contact by limits."""

import numpy as np
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from diag_dynamics.msg import Contact
from diag_dynamics.nodes.support.guard import attempt
from diag_dynamics.nodes.view.reading import SECOND, drained
from diag_dynamics.page.contact import Touch

JUDGED = "contact"
"""Status of a monitor that judges contact by limits: one that does not would compute contact for the page alone."""


class ContactReader:
    """The topic ~/contact of one monitor.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose log is written to.
    aside : rclpy.node.Node
        One that nobody spins: bytes wait in it until a page wants them.
    monitor : str
        Full name of the monitor.
    """

    def __init__(self, node, aside, monitor):
        self._node, self._aside, self._monitor, self._subscription = node, aside, monitor, None

    def listen(self):
        """Listen from now on."""
        if self._subscription is None:
            newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
            topic = f"{self._monitor}/contact"
            self._subscription = self._aside.create_subscription(Contact, topic, lambda _: None, newest, raw=True)

    def destroy(self):
        """Listen no more."""
        if self._subscription is not None:
            self._aside.destroy_subscription(self._subscription)

    def take(self, dynamics):
        """:class:`Touch` of the newest message since the last call; None without one, or of another robot's links."""
        touch, fault = attempt(self._newest, dynamics)
        if fault:
            text = f"contact of {self._monitor} cannot be read: {fault.reason}"
            self._node.get_logger().error(text, throttle_duration_sec=5.0)
        return touch

    def _newest(self, dynamics):
        if self._subscription is None:
            return None
        raw, _, _ = drained(self._subscription)
        message = None if raw is None else deserialize_message(raw, Contact)
        if message is None or not message.valid or not set(message.link_names) <= set(dynamics.model.link_names):
            return None
        stamp = message.header.stamp.sec + message.header.stamp.nanosec / SECOND
        arrays = message.positions, message.speed, message.reflected_mass, message.transferable_energy
        names, numbers = (list(message.point_names), list(message.link_names)), map(np.array, arrays)
        allowed = np.array(message.allowed_speed)
        return Touch(stamp, *names, *numbers, allowed, message.worst, message.velocity_estimated)
