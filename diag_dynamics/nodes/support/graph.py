# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Who publishes on a topic, and whether anything of it can arrive; where messages of a type are."""

from rclpy.qos import QoSCompatibility, qos_check_compatible


def publishers(node, subscription, kind):
    """Publishers of a subscription's topic.

    Parameters
    ----------
    node : rclpy.node.Node
    subscription : rclpy.subscription.Subscription
    kind : str
        Type of its messages, as ``sensor_msgs/msg/JointState``.

    Returns
    -------
    names : list of str
        Their nodes, each as often as it publishes there.
    problems : list of str
        Why nothing can arrive from some of them.
    """
    names, problems = [], []
    topic = subscription.topic_name
    for info in node.get_publishers_info_by_topic(topic):
        name = _name(info)
        names.append(name)
        if info.topic_type != kind:
            problems.append(f"{name} publishes {info.topic_type} on {topic}, expected {kind}")
            continue
        compatible, reason = qos_check_compatible(info.qos_profile, subscription.qos_profile)
        if compatible == QoSCompatibility.ERROR:
            problems.append(f"QoS of {name} on {topic} is not compatible with this node's subscription: {reason}")
    return names, problems


def publishing(node, topic):
    """Nodes that publish on a topic, each as often as it does."""
    return [_name(info) for info in node.get_publishers_info_by_topic(topic)]


NOT_YET_KNOWN = "a node not known yet"
"""Name of a node whose publisher has been heard of before the node itself."""


def _name(info):
    if info.node_name == "_NODE_NAME_UNKNOWN_":  # rcl's
        return NOT_YET_KNOWN
    return f"{info.node_namespace.rstrip('/')}/{info.node_name}"


def topics_of(node, kind):
    """Topics on which somebody publishes messages of a type, as ``sensor_msgs/msg/JointState``, in the order of names."""
    return [
        topic for topic, kinds in node.get_topic_names_and_types() if kind in kinds and node.count_publishers(topic)
    ]
