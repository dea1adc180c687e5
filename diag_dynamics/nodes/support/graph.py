# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Publishers of a topic, and whether their QoS matches; topics of a type."""

from rclpy.qos import QoSCompatibility, qos_check_compatible

NOT_YET_KNOWN = "a node not known yet"
"""Name of a node whose publisher was discovered before the node itself."""


def publishers(node, subscription, kind):
    """Return names of the nodes that publish a subscription's topic, and problems; `kind` is a package/msg/Type."""
    topic, problems = subscription.topic_name, []
    infos = node.get_publishers_info_by_topic(topic)
    names = node_names(infos)
    for name, info in zip(names, infos, strict=True):
        if info.topic_type != kind:
            problems.append(f"{name} publishes {info.topic_type} on {topic}, expected {kind}")
            continue
        compatible, reason = qos_check_compatible(info.qos_profile, subscription.qos_profile)
        if compatible == QoSCompatibility.ERROR:
            problems.append(f"QoS of {name} on {topic} is not compatible with this node's subscription: {reason}")
    return names, problems


def node_names(infos):
    """Return the full names of the nodes that endpoints of a topic belong to."""
    return [
        NOT_YET_KNOWN
        if info.node_name == "_NODE_NAME_UNKNOWN_"
        else f"{info.node_namespace.rstrip('/')}/{info.node_name}"
        for info in infos
    ]


def topics_of(node, kind):
    """Return the topics on which messages of a type are published, in the order of names."""
    return [
        topic for topic, kinds in node.get_topic_names_and_types() if kind in kinds and node.count_publishers(topic)
    ]
