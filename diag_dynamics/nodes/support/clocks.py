# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Who publishes simulated time, which has to be one node."""

from diag_dynamics.nodes.support.diagnostics import counted
from diag_dynamics.nodes.support.graph import publishing

CLOCK = "/clock"
"""The topic of simulated time, which may be another one by remapping."""


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
