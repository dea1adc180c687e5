# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The floor: publishes, for every joint state, messages of the monitor's types and sizes, and computes nothing.

As well written as rclpy allows with messages that are Python objects. Messages are prebuilt (`prebuilt.py` has the monitor's
own makers make them), numbers go into them as array.array, which rclpy takes over without a look at them, and nothing is
left for the garbage collector.
"""

import contextlib
import gc
import json
import struct
import sys
from array import array

import diag_dynamics.msg
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from sensor_msgs.msg import JointState

from graph.executors import EXECUTORS


class Output:
    """A topic: its publisher, its message, and the numbers that are put into it each time."""

    def __init__(self, node, topic, kind, rate, cdr):
        kind = getattr(diag_dynamics.msg, kind, None) or JointState
        self.message = deserialize_message(bytes.fromhex(cdr), kind)
        self.publish = node.create_publisher(kind, f"~/{topic}", QoSProfile(depth=10)).publish
        self.period = 1e9 / rate if rate else 0.0  # ns
        self.next = 0.0
        names = [
            name
            for name, of in kind.get_fields_and_field_types().items()
            if of == "sequence<double>"
        ]
        self.numbers = [
            (name, bytes(getattr(self.message, name)))
            for name in names
            if getattr(self.message, name)
        ]

    def is_due(self, stamp):
        """Return whether a message stamped `stamp` [ns] goes out."""
        if self.period and stamp < self.next:
            return False
        self.next = max(self.next + self.period, stamp)
        return True


class Relay(Node):
    """Goes by the monitor's name, so that its topics do, too."""

    def __init__(self, queue, outputs, raw=False):
        super().__init__("diag_dynamics")
        self.outputs = [Output(self, *output) for output in outputs]
        best_effort = QoSProfile(depth=queue, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.create_subscription(JointState, "joint_states", self.take, best_effort, raw=raw)

    def take(self, state):
        """Pass one state on."""
        stamp = state.header.stamp
        now = 1_000_000_000 * stamp.sec + stamp.nanosec
        for output in self.outputs:
            if not output.is_due(now):
                continue
            message = output.message
            message.header.stamp = stamp
            for name, numbers in output.numbers:
                setattr(message, name, array("d", numbers))
            output.publish(message)


class BytesRelay(Relay):
    """Receives and publishes bytes, of which it copies the stamp alone: less no node in rclpy can do."""

    def __init__(self, queue, outputs):
        super().__init__(queue, outputs, raw=True)
        for output, (*_, cdr) in zip(self.outputs, outputs, strict=True):
            output.message = bytearray.fromhex(cdr)

    def take(self, raw):
        """Pass the stamp of one state on."""
        sec, nanosec = struct.unpack_from("<iI", raw, 4)
        for output in self.outputs:
            if output.is_due(1_000_000_000 * sec + nanosec):
                output.message[4:12] = raw[4:12]
                output.publish(bytes(output.message))


def main(executor, queue, outputs, kind="Relay"):
    """Relay until a signal."""
    rclpy.init()
    relay = globals()[kind](int(queue), json.loads(outputs))
    executor = EXECUTORS[executor]()
    executor.add_node(relay)
    gc.collect()
    gc.freeze()
    never = Future()
    with contextlib.suppress(ExternalShutdownException):
        while rclpy.ok():  # spin() of the EventsExecutor heeds no signals in some releases
            executor.spin_until_future_complete(never, timeout_sec=0.2)


if __name__ == "__main__":
    main(*sys.argv[1:])
