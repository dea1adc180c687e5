# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The time of a node, and the publishers of simulated time."""

import time

from rclpy.clock import Clock, ClockType, JumpThreshold
from rclpy.duration import Duration

from diag_dynamics.nodes.support.diagnostics import counted
from diag_dynamics.nodes.support.graph import node_names

CLOCK = "/clock"
"""The topic of simulated time."""


def steady_clock():
    """Return the clock of timers that go on where simulated time stands still."""
    return Clock(clock_type=ClockType.STEADY_TIME)


class NodeTime:
    """The times that a node reads: ROS time for stamps, steady time for periods and timeouts."""

    def __init__(self, node):
        self._clock, self._callbacks = node.get_clock(), []
        self._simulated = self._clock.ros_time_is_active
        backward = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=True)
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
        """Call `callback()` when ROS time jumps back, or changes between system and simulated time."""
        self._callbacks.append(callback)

    def _take_jump(self, _):
        self._simulated = self._clock.ros_time_is_active
        for callback in self._callbacks:
            callback()


def clock_notes(node, publishes=False):
    """Return diagnostic values and problems of simulated time; none if a node neither uses nor `publishes` it."""
    if not publishes and not node.get_clock().ros_time_is_active:
        return {}, []
    topic = node.resolve_topic_name(CLOCK)
    names, problems = sorted(node_names(node.get_publishers_info_by_topic(topic))), []
    if len(names) > 1:
        problems.append(f"several publish {topic}, and time jumps between them: {counted(names)}")
    if not publishes and not node.get_clock().now().nanoseconds:
        problems.append(f"use_sim_time, but nothing on {topic} yet")
    return {f"publishers of {topic}": counted(names)}, problems


def warn_of_time(node, received, foreign):
    """Warn once of joint states without simulated time, and of `foreign` inputs: name, and clock less stamp [s]."""
    log = node.get_logger()
    if received and not node.get_clock().now().nanoseconds:
        topic = node.resolve_topic_name(CLOCK)
        log.warning(f"use_sim_time is set, but nothing publishes {topic}. Play bags with --clock.", once=True)
    for what, offset in foreign[:1]:
        side = "behind" if offset > 0.0 else "ahead of"
        log.warning(
            f"Stamps of {what} are {abs(offset):.3f} s {side} this node's clock. Play bags with --clock and set "
            "use_sim_time, or synchronize the clocks of the hosts.",
            once=True,
        )
