# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Publishers of the monitor: messages are made for subscribers, within limits of rates."""

from importlib import import_module

from rclpy.qos import QoSProfile

from diag_dynamics.nodes.support.messages import ORDER
from diag_dynamics.nodes.support.publishing import RateLimit, connected
from diag_dynamics.nodes.support.topics import TOPICS


def _type(name):
    """Return the class of a message by ``package/Name``, or without package for one of ours."""
    package, _, kind = name.rpartition("/")
    return getattr(import_module(f"{package or 'diag_dynamics'}.msg"), kind)


TYPES = {topic.name: _type(topic.type) for topic in TOPICS}
"""Types of all topics."""

PERIOD = 0.01
"""Time between two counts of subscribers [s]."""


class Outputs:
    """The publishers of a node.

    Subscribers are not counted for each message, because that would take as long as evaluating a
    state. (An EventsExecutor crashes where it reports matched subscribers of a publisher that
    goes.)

    Parameters
    ----------
    node : rclpy.node.Node
    """

    def __init__(self, node):
        self._steady = node.time.steady
        self._limits = {}
        self._publishers = {
            topic: connected(node.create_publisher, kind, f"~/{topic}", QoSProfile(depth=10))
            for topic, kind in TYPES.items()
        }
        self._count_subscribers()

    def _count_subscribers(self):
        self._counted = self._steady()
        self._heard = {
            topic
            for topic, publisher in self._publishers.items()
            if publisher.get_subscription_count()
        }
        self._about_state = tuple(topic for topic in ORDER if topic in self._heard)

    def use_rates(self, rates):
        """Limit topics to these rates [Hz], 0 for every state."""
        self._limits = {topic: RateLimit(rate) for topic, rate in rates.items() if rate}

    def look(self):
        """Count the subscribers, unless that was done a moment ago."""
        if self._steady() - self._counted > PERIOD:
            self._count_subscribers()

    def publish(self, moment, robot):
        """Publish the topics about a Moment of a MonitoredRobot, the markers last."""
        s = moment.evaluation
        stamp = moment.state.newest
        topics = self._about_state
        if self._limits:
            topics = tuple(topic for topic in topics if self._due(topic, stamp))
        for topic, message in zip(topics, robot.messages(topics, s), strict=True):
            self._publishers[topic].publish(message)
        if "markers" in self._heard:
            self.publish_beside("markers", stamp, lambda: robot.markers(s))

    def publish_beside(self, topic, stamp, make):
        """Publish another topic; `make` returns its message about a state stamped `stamp` [ns]."""
        if self._is_awaited(topic, stamp):
            self._publishers[topic].publish(make())

    def publish_wrenches(self, frames, robot, state):
        """Publish the external wrench at the first frame, and the estimates at all frames.

        Return whether a direction at the first frame is not observed. A controller would take a
        zero for a measurement, so there is no WrenchStamped then.
        """
        is_withheld = False
        stamp = state.newest
        is_due = self._is_awaited("external_wrench", stamp)
        is_detailed = self._is_awaited("external_wrench_estimates", stamp)
        for frame in frames if is_detailed else frames[:1] if is_due else ():
            wrench = robot.wrench(frame)
            if is_detailed:
                message = robot.encoder.external_wrench_estimates(frame, wrench, state)
                self._publishers["external_wrench_estimates"].publish(message)
            if not (is_due and wrench and frame == frames[0]):
                continue
            is_withheld = not wrench.observed.all()
            if not is_withheld:
                message = robot.encoder.external_wrench(frame, wrench, state)
                self._publishers["external_wrench"].publish(message)
        return is_withheld

    def _is_awaited(self, topic, stamp):
        """Return whether a topic has a subscriber, and a message is due."""
        return self._publishers[topic].get_subscription_count() > 0 and self._due(topic, stamp)

    def _due(self, topic, stamp):
        limit = self._limits.get(topic)
        return limit is None or limit.due(stamp)
