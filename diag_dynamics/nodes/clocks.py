"""Who publishes simulated time, which has to be one node."""

from diag_dynamics.nodes.diagnostics import counted
from diag_dynamics.nodes.graph import publishing

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
        # Not at once: time may begin a little later than the node. A recording has none unless it is played with --clock.
        said = f"use_sim_time is true, but nothing is on {topic} yet: a recording is played with --clock."
        node.get_logger().warning(said, skip_first=True, once=True)
    return {f"publishers of {topic}": counted(names)}, problems
