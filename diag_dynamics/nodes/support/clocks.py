# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The time of a node: ROS time for stamps, steady time for periods and timeouts."""

import time

from rclpy.clock import Clock, ClockType, JumpThreshold
from rclpy.duration import Duration


def steady_clock():
    """Return the clock of timers that go on where simulated time stands still."""
    return Clock(clock_type=ClockType.STEADY_TIME)


class NodeTime:
    """The times that a node reads; `start` is the steady time at which it was made [s]."""

    def __init__(self, node):
        self._clock = node.get_clock()
        self._callbacks = []
        self._simulated = self._clock.ros_time_is_active
        self.start = self.steady()
        backward = JumpThreshold(
            min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=True
        )
        self._handle = self._clock.create_jump_callback(backward, post_callback=self._take_jump)

    def now(self):
        """Return ROS time [ns]: simulated time where the node uses it, else system time."""
        # rclpy takes ten times as long as time_ns for the same number.
        return self._clock.now().nanoseconds if self._simulated else self.system()

    def system(self):
        """Return system time [ns]."""
        return time.time_ns()

    def steady(self):
        """Return steady time [s]."""
        return time.monotonic()

    def on_jump(self, callback):
        """Call `callback()` when ROS time jumps back or changes its source.

        The sources are system and simulated time.
        """
        self._callbacks.append(callback)

    def _take_jump(self, _):
        self._simulated = self._clock.ros_time_is_active
        for callback in self._callbacks:
            callback()
