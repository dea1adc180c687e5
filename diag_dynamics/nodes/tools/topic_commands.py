# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics topic`: list, info, echo, hz and pub."""

import itertools
import statistics
import sys
import time

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.tools.session import session
from diag_dynamics.nodes.tools.yaml_messages import as_values, as_yaml, field, filled, type_of

DISCOVERY = 10.0
"""Time [s] for a topic to appear."""

ACKNOWLEDGED = 5.0
"""Time [s] for those who listen to acknowledge a message."""


def add_arguments(parser):
    """Declare the subcommands."""
    commands = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    one = commands.add_parser("list", help="names of all topics")
    one.add_argument("-t", "--show-types", action="store_true", help="their types, too")
    one.set_defaults(run=list_topics)
    one = commands.add_parser("info", help="type of a topic, its publishers and subscriptions, and their QoS")
    one.add_argument("topic")
    one.add_argument(
        "-v", "--verbose", action="store_true", help="for those who type it from habit: all is said anyway"
    )
    one.set_defaults(run=info)
    one = commands.add_parser("echo", help="print messages")
    one.add_argument("topic")
    one.add_argument("type", nargs="?", help="of its messages; found out if not given")
    one.add_argument("--once", action="store_true", help="one message, then end")
    one.add_argument("--field", metavar="PATH", help="one field, as header.stamp or position[0]")
    one.set_defaults(run=echo)
    one = commands.add_parser("hz", help="rate of messages, once a second")
    one.add_argument("topic")
    one.add_argument("-w", "--window", type=int, default=10000, help="messages that count (default %(default)s)")
    one.add_argument("--once", action="store_true", help="one figure, then end")
    one.set_defaults(run=hz)
    one = commands.add_parser("pub", help="publish messages")
    one.add_argument("topic")
    one.add_argument("type", help="as std_msgs/msg/Float64MultiArray")
    one.add_argument("values", nargs="?", default="", help="YAML, as '{data: [0, 1]}'; - reads it from stdin")
    one.add_argument("-1", "--once", action="store_true", help="one message, to whoever listens, then end")
    one.add_argument("-r", "--rate", type=float, default=1.0, help="messages a second (default %(default)s)")
    one.set_defaults(run=publish)


def list_topics(chosen):
    """Print the names of all topics."""
    with session() as graph:
        graph.look()
        for name, types in sorted(graph.node.get_topic_names_and_types()):
            print(f"{name} [{', '.join(types)}]" if chosen.show_types else name)


def info(chosen):
    """Print who publishes and subscribes, and how."""
    with session() as graph:
        topic = graph.absolute(chosen.topic)
        kind = graph.kind_of(topic, graph.node.get_topic_names_and_types, "topic", DISCOVERY)
        graph.look()
        print(f"Type: {kind}")
        ends = {
            "Publisher": graph.node.get_publishers_info_by_topic(topic),
            "Subscription": graph.node.get_subscriptions_info_by_topic(topic),
        }
        for what, those in ends.items():
            print(f"{what} count: {len(those)}")
            for one in those:
                qos = one.qos_profile
                print(
                    f"  {one.node_namespace.rstrip('/')}/{one.node_name} [{one.topic_type}] "
                    f"{qos.reliability.name.lower()}, {qos.durability.name.lower()}"
                )


def echo(chosen):
    """Print messages as they come."""
    with session() as graph:
        messages = []
        subscribe(graph, chosen.topic, chosen.type, messages.append)
        while True:
            graph.until(lambda: messages, f"a message on {graph.absolute(chosen.topic)}")
            message = messages.pop(0)
            shown = field(message, chosen.field) if chosen.field else message
            print(as_yaml(as_values(shown)), end="", flush=True)
            if chosen.once:
                return
            print("---", flush=True)


def hz(chosen):
    """Print the rate of messages once a second."""
    if chosen.window < 2:
        raise InputError(f"--window is {chosen.window}, expected at least 2.")
    with session() as graph:
        times = []
        subscribe(graph, chosen.topic, None, lambda _: times.append(time.perf_counter()), raw=True)
        while True:
            last = times[-1] if times else None
            graph.serve(time.monotonic() + 1.0)
            del times[: -chosen.window]
            if len(times) < 2 or times[-1] == last:
                print("no new messages", flush=True)
                continue
            gaps = [b - a for a, b in itertools.pairwise(times)]
            print(
                f"average rate: {len(gaps) / (times[-1] - times[0]):.3f}\n"
                f"\tmin: {min(gaps):.4f}s max: {max(gaps):.4f}s std dev: {statistics.pstdev(gaps):.5f}s "
                f"window: {len(times)}",
                flush=True,
            )
            if chosen.once:
                return


def publish(chosen):
    """Publish messages, the same again and again."""
    kind = type_of(chosen.type)
    # No system takes an argument of more than some hundred kilobytes, as a trajectory of a minute has.
    message = filled(kind, sys.stdin.read() if chosen.values == "-" else chosen.values)
    if not 0.0 < chosen.rate <= 1e4:
        raise InputError(f"--rate is {chosen.rate:g}, expected more than 0 and at most 10000 messages a second.")
    with session() as graph:
        topic = graph.absolute(chosen.topic)
        publisher = graph.node.create_publisher(kind, topic, 10)
        # What is published before anybody has been heard of is lost.
        graph.until(
            publisher.get_subscription_count, f"somebody to listen to {topic}", 3600.0 if not chosen.once else 10.0
        )
        if chosen.once:
            publisher.publish(message)
            if not publisher.wait_for_all_acked(Duration(seconds=ACKNOWLEDGED)):
                raise InputError(f"waited {ACKNOWLEDGED:g} s in vain for all that listen to {topic} to acknowledge.")
            return
        due = time.monotonic()
        while True:
            publisher.publish(message)
            due += 1.0 / chosen.rate
            graph.serve(due)


def subscribe(graph, topic, type_name, take, raw=False):
    """Subscribe so that every publisher's messages arrive: as reliable and as latched as all of them are.

    Where none is known yet, as any publisher's would.
    """
    topic = graph.absolute(topic)
    if type_name is None:
        type_name = graph.kind_of(topic, graph.node.get_topic_names_and_types, "topic", DISCOVERY)
    offered = graph.publishers(topic, DISCOVERY)
    reliable = offered and all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offered)
    latched = offered and all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered)
    profile = QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=1000 if raw else 100,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
    return graph.node.create_subscription(type_of(type_name), topic, take, profile, raw=raw)
