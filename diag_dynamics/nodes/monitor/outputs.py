# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Publishers of the monitor: a message is made only for subscribers, and no more often than its rate limit allows."""

import re
from importlib import import_module

from geometry_msgs.msg import WrenchStamped
from rclpy.qos import QoSProfile

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.guard import attempt
from diag_dynamics.nodes.support.publishing import RateLimit, connected
from diag_dynamics.nodes.support.topics import ORDER, TOPICS


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
        self._node, self._steady, self._limits, self._frames = node, node.time.steady, {}, {}
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
        s, stamp, topics = moment.evaluation, moment.state.newest, self._about_state
        if self._limits:
            topics = tuple(topic for topic in topics if self._due(topic, stamp))
        for topic, message in zip(topics, robot.messages(topics, s), strict=True):
            self._publishers[topic].publish(message)
        if "markers" in self._heard:  # whose meshes may be unreadable
            _, fault = attempt(self.publish_beside, "markers", stamp, lambda: robot.markers(s))
            if fault:
                log = self._node.get_logger()
                log.warning(f"Markers: {fault.reason}", throttle_duration_sec=5.0)

    def publish_beside(self, topic, stamp, make):
        """Publish another topic; `make` returns its message about a state stamped `stamp` [ns]."""
        publisher = self._publishers[topic]
        if publisher.get_subscription_count() and self._due(topic, stamp):
            publisher.publish(make())

    def use_frames(self, frames):
        """Have a topic for the external wrench at each of these links: the first one is ~/external_wrench."""
        for publisher in [*self._frames.values()][1:]:
            self._node.destroy_publisher(publisher)
        topics = [f"~/external_wrench/{token}" for token in frame_tokens(frames)]
        further = [
            connected(self._node.create_publisher, WrenchStamped, topic, QoSProfile(depth=10))
            for topic in topics
        ]
        self._frames = dict(
            zip(frames, [self._publishers["external_wrench"], *further], strict=False)
        )

    def publish_wrenches(self, stamp, estimate, encoder, state):
        """Publish the external wrench at each frame, which `estimate` returns, None without a result.

        Return the subscribed frames at which a direction is not observed. These have no
        WrenchStamped, since a controller would take a zero for a measurement.
        """
        withheld = []
        heard = {
            frame for frame, publisher in self._frames.items() if publisher.get_subscription_count()
        }
        if not (heard and self._due("external_wrench", stamp)):
            heard = ()
        estimates = self._publishers["external_wrench_estimates"]
        in_detail = estimates.get_subscription_count() and self._due(
            "external_wrench_estimates", stamp
        )
        for frame in self._frames if in_detail else heard:
            found = estimate(frame)
            if frame in heard and found and found.observed.all():
                self._frames[frame].publish(encoder.external_wrench(frame, found, state))
            elif frame in heard and found:
                withheld.append(frame)
            if in_detail:
                estimates.publish(encoder.external_wrench_estimates(frame, found, state))
        return withheld

    def _due(self, topic, stamp):
        limit = self._limits.get(topic)
        return limit is None or limit.due(stamp)


def frame_token(frame):
    """Return the name of a link as a part of a topic, of letters, digits and underscores."""
    token = re.sub(r"\W", "_", frame, flags=re.ASCII)
    return f"link_{token}" if token[0].isdigit() else token


def frame_tokens(frames):
    """Return the names of all links but the first as parts of topics; InputError if two are equal."""
    by_token = {}
    for frame in frames[1:]:
        other = by_token.setdefault(frame_token(frame), frame)
        if other != frame:
            raise InputError(
                f"parameter 'external_wrench.frames' has '{other}' and '{frame}'; expected links with different topics, "
                f"both have ~/external_wrench/{frame_token(frame)}. Remove one or put it first."
            )
    return list(by_token)
