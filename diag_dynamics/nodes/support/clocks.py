# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The time of a node, and the publishers of simulated time."""

import time

from rclpy.clock import JumpThreshold
from rclpy.duration import Duration

from diag_dynamics.nodes.support.diagnostics import counted
from diag_dynamics.nodes.support.graph import publishing

CLOCK = "/clock"
"""The topic of simulated time, which may be another one by remapping."""


class NodeTime:
    """The times that a node reads: ROS time for stamps, steady time for periods and timeouts.

    Parameters
    ----------
    node : rclpy.node.Node
    """

    def __init__(self, node):
        self._clock, self._jumped = node.get_clock(), []
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
        self._jumped.append(callback)

    def _take_jump(self, _):
        self._simulated = self._clock.ros_time_is_active
        for callback in self._jumped:
            callback()


def clock_notes(node, publishes=False):
    """What diagnostics say of simulated time, where a node takes it from there or publishes it itself.

    Parameters
    ----------
    node : rclpy.node.Node
    publishes : bool
        Whether the node publishes it.

    Returns
    -------
    values : dict
        Its publishers; empty for a node that has nothing to do with it.
    problems : list of str
        What is wrong with them.
    """
    if not publishes and not node.get_clock().ros_time_is_active:
        return {}, []
    topic = node.resolve_topic_name(CLOCK)
    names, problems = sorted(publishing(node, topic)), []
    if len(names) > 1:
        problems.append(f"several publish {topic}, and time jumps between them: {counted(names)}")
    if not publishes and not node.get_clock().now().nanoseconds:
        problems.append(f"use_sim_time, but nothing on {topic} yet")
    return {f"publishers of {topic}": counted(names)}, problems


def tell_of_time(node, received, foreign):
    """Say on the console, once, what is probably a recording that is played without time.

    Parameters
    ----------
    node : rclpy.node.Node
    received : int
        Number of joint states that have come.
    foreign : list
        Inputs whose stamps are of another time, and the node's clock less these [s].
    """
    if received and not node.get_clock().now().nanoseconds:
        said = f"Joint states come, but no time on {node.resolve_topic_name(CLOCK)} (use_sim_time): "
        node.get_logger().warning(f"{said}a recording is played with --clock.", once=True)
    for what, offset in foreign[:1]:
        node.get_logger().warning(
            f"Stamps of {what} are {abs(offset):.3f} s {'behind' if offset > 0.0 else 'ahead of'} this node's clock. A "
            "recording is played with --clock, and its listeners have use_sim_time; clocks of hosts are synchronized.",
            once=True,
        )
