# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The robot: publishes joint states in bursts, each when a line on its standard input asks for it.

The message is serialized once, and only its stamp is overwritten. A feeder that was held up does not send all that it has
missed in one go, which would overflow the queue of whoever listens, but leaves it out: what counts is what was sent.
"""

import ctypes
import gc
import json
import sys
import time

import numpy as np
import rclpy
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from graph import stamps

BEHIND = 2
"""Messages that are sent late, back to back, before any is left out; a subscription of depth 5 holds them."""

TIMER_SLACK = 29  # PR_SET_TIMERSLACK


class Feeder:
    """A publisher of joint states of joints of these names."""

    def __init__(self, names):
        self._node = rclpy.create_node("feeder")
        self._publisher = self._node.create_publisher(
            JointState, "joint_states", QoSProfile(depth=10)
        )
        position, velocity, effort = (
            np.random.default_rng(1).uniform(-0.3, 0.3, (3, len(names))).tolist()
        )
        message = JointState(name=names, position=position, velocity=velocity, effort=effort)
        self._data = bytearray(serialize_message(message))

    def burst(self, rate, seconds):
        """Publish at a rate [Hz] for a while; returns what was sent, how late at worst, and whether anybody listens."""
        period, sent, late = 1.0 / rate, 0, 0.0
        send = self._publisher.handle.publish_raw  # what rclpy puts around it would be the limit
        due = begin = time.perf_counter()
        while due < begin + seconds:
            if (early := due - time.perf_counter()) > 0.0:
                time.sleep(early)
            late = max(late, time.perf_counter() - due)
            stamps.put(self._data, time.time_ns())
            send(bytes(self._data))
            sent += 1
            due = max(due + period, time.perf_counter() - BEHIND * period)
        seconds = time.perf_counter() - begin
        return {
            "sent": sent,
            "late": late,
            "seconds": seconds,
            "matched": self._publisher.get_subscription_count() > 0,
        }


def main():
    """Serve the lines of standard input, each a method and its arguments."""
    ctypes.CDLL(None).prctl(TIMER_SLACK, 1)  # wake up on time: by default Linux may take 50 µs more
    rclpy.init()
    feeder = Feeder(sys.argv[1:])
    gc.disable()
    for line in sys.stdin:
        method, *arguments = json.loads(line)
        print(json.dumps(getattr(feeder, method)(*arguments)), flush=True)


if __name__ == "__main__":
    main()
