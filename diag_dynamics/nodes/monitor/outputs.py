# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the monitor publishes: each topic's message, made only where somebody listens, and no more often than wanted."""

from importlib import import_module

from rclpy.qos import QoSProfile

from diag_dynamics.nodes.support.publishing import RateLimit, connected
from diag_dynamics.nodes.support.topics import MATRICES, ORDER, TOPICS


def _type(name):
    """Class of a message, by ``package/Name``, or without package for one of ours."""
    package, _, kind = name.rpartition("/")
    return getattr(import_module(f"{package or 'diag_dynamics'}.msg"), kind)


TYPES = {topic.name: _type(topic.type) for topic in TOPICS}
"""Types of all topics: of those about a state, and of those that are made only where a parameter asks for them."""

SELDOM = 0.01
"""Time for which it is taken for granted that the same people listen [s]."""


class Outputs:
    """The publishers of a node.

    Who listens is not asked for every message: where they come fast, asking every publisher would cost as much as evaluating
    a state does. (ROS can tell of changes by itself, too, but an EventsExecutor then crashes when a publisher goes.)

    Parameters
    ----------
    node : rclpy.node.Node

    Attributes
    ----------
    drawn : bool
        Whether somebody listens to markers.
    touched : bool
        Likewise, to contact.
    """

    def __init__(self, node):
        self._node = node
        self._limits = {}  # of topics that have one
        self._publishers = {
            topic: connected(node.create_publisher, kind, f"~/{topic}", QoSProfile(depth=10))
            for topic, kind in TYPES.items()
        }
        self._look()

    def _look(self):
        """See who listens."""
        self._looked = self._node.time.steady()
        heard = {topic for topic, publisher in self._publishers.items() if publisher.get_subscription_count()}
        self._wanted = [topic for topic in ORDER if topic in heard]
        self.drawn, self.touched = "markers" in heard, "contact" in heard

    def limit(self, topic, rate):
        """Publish a topic at no more than this rate [Hz]; 0 for every state."""
        if rate:
            self._limits[topic] = RateLimit(rate)
        else:
            self._limits.pop(topic, None)

    def look(self):
        """See who listens, unless that was done a moment ago."""
        if self._node.time.steady() - self._looked > SELDOM:
            self._look()

    def publish(self, stamp, about_state, matrix):
        """Publish where somebody listens.

        Parameters
        ----------
        stamp : int
            Of the state [ns].
        about_state : callable
            Makes a list of messages, or of their bytes, of a list of topics about the state.
        matrix : callable
            Makes one, of one of :data:`MATRICES`.
        """
        limits = self._limits
        due = [topic for topic in self._wanted if topic not in limits or limits[topic].due(stamp)]
        matrices = [topic for topic in due if topic in MATRICES]
        topics = due[: len(due) - len(matrices)]
        for topic, message in zip(topics, about_state(topics) if topics else (), strict=True):
            self._send(topic, message)
        for topic in matrices:
            self._send(topic, matrix(topic))

    def publish_beside(self, topic, stamp, make):
        """Publish a topic beside the others where somebody listens: what `make` makes of a state stamped `stamp` [ns]."""
        if not self._publishers[topic].get_subscription_count():
            return
        if topic not in self._limits or self._limits[topic].due(stamp):
            self._send(topic, make())

    def _send(self, topic, message):
        self._publishers[topic].publish(message)
