# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Who listens: times one topic by the stamps of its messages, and merely subscribes to the others.

The others belong to a node that nobody spins: DDS delivers them, and they cost this process no Python, lest it become the
one that is measured. All of them are kept serialized.
"""

import contextlib
import gc
import json
import sys
import threading
import time

import diag_dynamics.msg
import rclpy
import sensor_msgs.msg
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.qos import QoSProfile
from rclpy.task import Future

from graph import stamps

QUIET = 0.25
"""Nothing more will come when nothing has come for so long [s]."""

DEEP = QoSProfile(depth=2000)  # what is timed waits here while this process is held up


class Listener:
    """Subscriptions to the monitor's topics, each written as topic:type, the first of which is timed.

    Attributes
    ----------
    timed : rclpy.node.Node
        The node to spin.
    """

    def __init__(self, first, *others):
        self._latencies = []  # ns
        self._since = 0  # what is stamped earlier does not count
        self._sizes = {}  # bytes of a message of each topic
        self._cpu = 0.0
        self.timed, idle = rclpy.create_node("listener"), rclpy.create_node("idle_listener")
        self._first = self._subscribe(self.timed, first, DEEP)[0]
        self._others = dict(self._subscribe(idle, other, QoSProfile(depth=10)) for other in others)

    def _subscribe(self, node, output, qos):
        topic, kind = output.split(":")
        kind = getattr(diag_dynamics.msg, kind, None) or getattr(sensor_msgs.msg, kind)
        return topic, node.create_subscription(
            kind, f"/diag_dynamics/{topic}", self._take, qos, raw=True
        )

    def _take(self, data):
        now, stamp = time.time_ns(), stamps.get(data)
        if stamp >= self._since:
            self._latencies.append(now - stamp)
        if self._first not in self._sizes:
            self._sizes[self._first] = len(data)

    def sizes(self):
        """Bytes of a serialized message of each topic that something has come on by now."""
        for topic, subscription in self._others.items():
            if topic not in self._sizes:
                with subscription.handle:
                    taken = subscription.handle.take_message(subscription.msg_type, True)
                if taken:
                    self._sizes[topic] = len(taken[0])
        return self._sizes

    def begin(self):
        """Forget what has come so far."""
        self._since = time.time_ns()
        self._latencies.clear()
        self._cpu = time.process_time()
        return {}

    def end(self, sent):
        """Wait for the rest of what was sent; returns latencies [ns] of what has come, and the CPU time it took."""
        count, since = -1, 0.0
        while len(self._latencies) < sent and (
            len(self._latencies) != count or time.monotonic() - since < QUIET
        ):
            if len(self._latencies) != count:
                count, since = len(self._latencies), time.monotonic()
            time.sleep(0.01)
        return {"latencies": self._latencies.copy(), "cpu": time.process_time() - self._cpu}

    def serve(self):
        """Serve the lines of standard input, each a method and its arguments."""
        for line in sys.stdin:
            method, *arguments = json.loads(line)
            print(json.dumps(getattr(self, method)(*arguments)), flush=True)


def main():
    """Listen until a signal."""
    rclpy.init()
    listener = Listener(*sys.argv[1:])
    threading.Thread(target=listener.serve, daemon=True).start()
    executor = EventsExecutor()
    executor.add_node(listener.timed)
    gc.disable()
    never = Future()
    with contextlib.suppress(ExternalShutdownException):
        while rclpy.ok():
            executor.spin_until_future_complete(never, timeout_sec=0.2)


if __name__ == "__main__":
    main()
