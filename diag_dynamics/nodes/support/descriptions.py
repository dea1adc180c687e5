# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots of descriptions that come while a node is at work: made in a thread beside it, handed over between two callbacks."""

import codecs
import gc
import sys
import threading
from contextlib import contextmanager

from rclpy.clock import Clock, ClockType
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from diag_dynamics.nodes.support.guard import attempt
from diag_dynamics.nodes.support.managed import ACTIVE, INACTIVE
from diag_dynamics.nodes.support.publishing import connected

LOOK = 0.02
"""How often the executor looks whether something has been made [s]."""

PATIENCE, LONGEST = 5.0, 60.0
"""How long to wait for a description that somebody publishes before listening anew, at first and at most [s]."""

TURN = 1e-4
"""How long the thread computes while the executor waits for its turn [s]; Python's own 5 ms are half a period at 100 Hz."""

_turns = {"threads": 0, "before": None, "collects": False}
_lock = threading.Lock()


def working():
    """Whether such a thread is running, in whichever node; the interpreter may crash if it ends meanwhile."""
    return _turns["threads"] > 0


@contextmanager
def _short_turns():
    with _lock:
        if not _turns["threads"]:
            _turns["before"], _turns["collects"] = sys.getswitchinterval(), gc.isenabled()
            gc.disable()  # which would look through all that is being made, again and again, while nobody else has a turn
            sys.setswitchinterval(TURN)
        _turns["threads"] += 1
    try:
        yield
    finally:
        with _lock:
            _turns["threads"] -= 1
            if not _turns["threads"]:
                sys.setswitchinterval(_turns["before"])
                if _turns["collects"]:
                    gc.enable()


class Descriptions:
    """Makes something of descriptions while the node goes on, one after the other; only the newest counts.

    Parameters
    ----------
    node : rclpy.node.Node
    make : callable
        Called in the thread with what :meth:`load` was called with; it changes nothing of the node's.
    take : callable
        Called by the executor with what `make` has returned or raised, and with what :meth:`load` was called with.

    Attributes
    ----------
    loading : str, bytes or None
        The description that something is being made of.
    """

    def __init__(self, node, make, take):
        self._node, self._make, self._take = node, make, take
        self.loading = self._wanted = self._thread = self._timer = None

    def load(self, description, *context):
        """Make something of this description, whatever was loading before."""
        self.loading = description
        self._wanted = (
            description,
            *context,
        )  # a new tuple for each wish: that is how the thread's result knows its own
        if self._timer is None:
            self._timer = self._node.create_timer(LOOK, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._begin()

    def drop(self):
        """Take nothing over any more; the thread ends as soon as it has made what it is at."""
        self.loading = self._wanted = None
        if self._timer is not None:
            self._node.destroy_timer(self._timer)
            self._timer = None

    def finish(self):
        """Wait until what is loading has been handed over."""
        while self._timer is not None and self.loading is not None:
            self._thread.join()
            self._look()

    def _begin(self):
        """Start on what is wanted, unless the thread is at something that was wanted before."""
        if self._thread is None:
            self._thread = _Making(self._make, self._wanted)
            self._thread.start()

    def _look(self):
        thread = self._thread
        if self._timer is None or (thread is not None and thread.is_alive()):
            return
        self._thread = None
        if thread is None or thread.wanted is not self._wanted:
            self._begin()
            return
        self.drop()
        self._take(thread.made, *thread.wanted)


class DescriptionTopic:
    """The topic robot_description, as a node that waits for its robot listens to it.

    A controller that was started again after a kill once never got the latched description, though its publisher lived. So
    where somebody publishes, and nothing comes, the topic is listened to anew, after pauses that double.

    Parameters
    ----------
    node : ManagedNode
    take : callable
        Called with each description, bytes, that comes while the node is configured.

    Attributes
    ----------
    subscription : rclpy.subscription.Subscription
    """

    def __init__(self, node, take):
        self._node, self._take, self._topic = node, take, node.resolve_topic_name("robot_description")
        self._patience, self._timer = PATIENCE, None
        self._listen()
        node.get_logger().info(f"Waiting for a robot on {self._topic}.")

    def close(self):
        """Listen no more."""
        self._stop_looking()
        self._node.destroy_subscription(self.subscription)

    def _listen(self):
        once = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.subscription = connected(self._node.create_subscription, String, self._topic, self._take_message, once)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = self._node.create_timer(self._patience, self._look, clock=steady)

    def _stop_looking(self):
        if self._timer is not None:
            self._node.destroy_timer(self._timer)
            self._timer = None

    def _look(self):
        if self._timer is None or not self._node.count_publishers(self._topic):
            return
        self._node.get_logger().warning(
            f"Nothing came on {self._topic} in {self._patience:g} s, though it has a publisher: listening anew."
        )
        self.close()
        self._patience = min(2.0 * self._patience, LONGEST)
        self._listen()

    def _take_message(self, message):
        if self._node.phase not in (INACTIVE, ACTIVE):
            return  # an event of a subscription that is gone
        self._stop_looking()
        # What comes from a topic is text and never a path: bytes are not looked up. It has been decoded already, whatever
        # encoding it declares, which the byte-order mark says.
        description = codecs.BOM_UTF8 + message.data.lstrip("\ufeff").encode(errors="replace")
        self._node.get_logger().debug(f"robot_description came: {len(description)} bytes")
        self._take(description)


class _Making(threading.Thread):
    """One call of `make`; a daemon, for nobody waits for it at the end."""

    def __init__(self, make, wanted):
        super().__init__(name="description", daemon=True)
        self._make, self.wanted, self.made = make, wanted, None

    def run(self):
        with _short_turns():
            made, fault = attempt(self._make, *self.wanted)
            self.made = made if fault is None else fault.error  # of which the executor tells
