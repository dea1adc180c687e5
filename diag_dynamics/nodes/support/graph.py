# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Publishers of a topic and of simulated time, and whether their QoS matches; topics of a type."""

from rclpy.qos import QoSCompatibility, qos_check_compatible

from diag_dynamics.nodes.support.diagnostics import counted

CLOCK = "/clock"
"""The topic of simulated time."""

CLOCK_TIMEOUT = 10.0
"""Time after the start of a node in which a simulator may load its robot [s]."""


def publishers(node, subscription, kind):
    """Return names of the nodes that publish a topic, and problems by name of the node.

    `kind` is a package/msg/Type.
    """
    topic = subscription.topic_name
    problems = {}
    infos = node.get_publishers_info_by_topic(topic)
    names = node_names(infos)
    for name, info in zip(names, infos, strict=True):
        if info.topic_type != kind:
            problems[name] = f"{name} publishes {info.topic_type} on {topic}; expected {kind}"
            continue
        compatible, reason = qos_check_compatible(info.qos_profile, subscription.qos_profile)
        if compatible == QoSCompatibility.ERROR:
            problems[name] = (
                f"QoS of {name} on {topic} is incompatible with this node's subscription: {reason}"
            )
    return names, problems


def node_names(infos):
    """Return the full names of the nodes that endpoints of a topic belong to."""
    return [
        "unknown node"  # its publisher was discovered before it
        if info.node_name == "_NODE_NAME_UNKNOWN_"
        else f"{info.node_namespace.rstrip('/')}/{info.node_name}"
        for info in infos
    ]


def topics_of(node, kind):
    """Return the topics on which messages of a type are published, in the order of names."""
    return [
        topic
        for topic, kinds in node.get_topic_names_and_types()
        if kind in kinds and node.count_publishers(topic)
    ]


def clock_notes(node, publishes=False):
    """Return diagnostic values and problems of simulated time.

    There are none if a node neither uses nor `publishes` it.
    """
    if not publishes and not node.get_clock().ros_time_is_active:
        return {}, []
    topic = node.resolve_topic_name(CLOCK)
    names = sorted(node_names(node.get_publishers_info_by_topic(topic)))
    problems = []
    if len(names) > 1:
        problems.append(f"several nodes publish {topic}, so time jumps: {counted(names)}")
    waits = node.time.steady() - node.time.start > CLOCK_TIMEOUT
    if waits and not publishes and not node.get_clock().now().nanoseconds:
        problems.append(f"use_sim_time is set, but {topic} has no messages. Play bags with --clock")
    return {f"publishers of {topic}": counted(names)}, problems
