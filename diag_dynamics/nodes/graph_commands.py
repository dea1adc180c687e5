# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics topic echo`, `topic hz` and `service call`, for a ROS 2 without ros2cli."""

import itertools
import math
import re
import time
from contextlib import contextmanager
from importlib import import_module

import rclpy
import yaml
from rclpy.exceptions import InvalidServiceNameException, InvalidTopicNameException
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.topics import nearest

DISCOVERY_TIMEOUT = 10.0  # of a topic [s]


def add_topic_arguments(parser):
    """Declare the subcommands of `diag-dynamics topic`."""
    verbs = parser.add_subparsers(required=True, metavar="VERB")
    for name, run in (("echo", echo), ("hz", measure_rate)):
        verb = verbs.add_parser(name, help=run.__doc__)
        verb.add_argument("topic")
        verb.add_argument("type", nargs="?", help="package/msg/Name (default: the publisher's)")
        verb.add_argument("--once", action="store_true", help="print once and exit")
        verb.set_defaults(run=run)
    verbs.choices["echo"].add_argument("--field", help="print one field: header.stamp, position[0]")


def add_service_arguments(parser):
    """Declare the subcommand of `diag-dynamics service`."""
    verbs = parser.add_subparsers(required=True, metavar="VERB")
    verb = verbs.add_parser("call", help=call.__doc__)
    verb.add_argument("service")
    verb.add_argument("type", nargs="?", help="package/srv/Name (default: the server's)")
    verb.add_argument("values", nargs="?", default="", help="request as YAML: '{link: hand}'")
    verb.add_argument("--field", help="print one field of the response")
    verb.add_argument("--timeout", type=float, default=30.0, help="[s] (default %(default)s)")
    verb.set_defaults(run=call)


def echo(options):
    """Print messages as YAML."""
    with session() as graph:
        messages = []
        topic = graph.subscribe(options.topic, options.type, messages.append)
        while True:
            graph.wait_until(lambda: messages, f"a message on {topic}")
            message = messages.pop(0)
            value = read_field(message, options.field) if options.field else message
            print(to_yaml(value), end="" if options.once else "---\n", flush=True)
            if options.once:
                return


def measure_rate(options):
    """Print the rate of the messages of each second."""
    with session() as graph:
        times = []
        graph.subscribe(options.topic, options.type, lambda _: times.append(graph.time()), raw=True)
        while True:
            end = graph.time() + 1.0
            graph.wait_until(lambda end=end: graph.time() >= end, "messages")
            if len(times) < 2:
                print("no new messages", flush=True)
                continue
            steps = [b - a for a, b in itertools.pairwise(times)]
            rate = f"average rate: {len(steps) / sum(steps):.3f}"
            print(f"{rate} min: {min(steps):.4f}s max: {max(steps):.4f}s", flush=True)
            if options.once:
                return
            del times[:-1]


def call(options):
    """Call a service and print its response."""
    kind, values = options.type, options.values
    if kind and kind.lstrip().startswith("{"):  # the type was left out
        kind, values = None, kind
    with session() as graph:
        name = f"/{options.service.lstrip('/')}"
        kind = graph.find_type("service", name, kind, options.timeout)
        request = from_yaml(kind.Request, values)
        client = graph.node.create_client(kind, name)
        graph.wait_until(client.service_is_ready, f"service {name}", options.timeout)
        graph.spin(0.5)  # Fast DDS drops responses to clients that the server has not discovered
        future = client.call_async(request)
        graph.wait_until(future.done, f"response of {name}", options.timeout)
    response = future.result()
    print(to_yaml(read_field(response, options.field) if options.field else response), end="")


@contextmanager
def session():
    """Provide a :class:`Session` until a command ends; signals raise exceptions."""
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    options = {"enable_rosout": False, "start_parameter_services": False}
    try:
        yield Session(rclpy.create_node(f"_diag_dynamics_{time.time_ns()}", **options))
    except (InvalidServiceNameException, InvalidTopicNameException) as error:
        raise InputError(f"{' '.join(str(error).split())}.") from error
    finally:
        rclpy.try_shutdown()


class Session:
    """The node of one command."""

    def __init__(self, node):
        self.node, self.time = node, time.monotonic

    def spin(self, seconds):
        """Serve one callback or wait."""
        rclpy.spin_once(self.node, timeout_sec=seconds)

    def wait_until(self, condition, what, timeout=math.inf, hint=str):
        """Spin until a condition holds; raise InputError at the timeout, with a hint."""
        end = self.time() + timeout
        while not condition():
            if self.time() > end:
                raise InputError(f"no {what} within {timeout:g} s. {hint()}".rstrip())
            self.spin(0.05)

    def find_type(self, what, name, kind, timeout=DISCOVERY_TIMEOUT):
        """Return the class of a topic or service: of the given type, or of the one on the graph."""

        def types():
            return dict(getattr(self.node, f"get_{what}_names_and_types")())

        def hint():
            near = nearest(name, types())
            return f"Did you mean {near}?" if near else ""

        if not kind:
            self.wait_until(lambda: name in types(), f"{what} {name}", timeout, hint)
        return find_type(kind or types()[name][0])

    def subscribe(self, topic, kind, callback, raw=False):
        """Subscribe with the QoS that all publishers offer; return the topic's absolute name."""
        topic, node = f"/{topic.lstrip('/')}", self.node
        kind = self.find_type("topic", topic, kind)
        end = self.time() + DISCOVERY_TIMEOUT
        while not (found := node.get_publishers_info_by_topic(topic)) and self.time() < end:
            self.spin(0.05)
        qos = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
        if {one.qos_profile.reliability for one in found} == {ReliabilityPolicy.RELIABLE}:
            qos.reliability = ReliabilityPolicy.RELIABLE
        if {one.qos_profile.durability for one in found} == {DurabilityPolicy.TRANSIENT_LOCAL}:
            qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
        node.create_subscription(kind, topic, callback, qos, raw=raw)
        return topic


def find_type(name):
    """Return the class of a type such as ``std_msgs/msg/Float64``."""
    try:
        package, kind, short = name.split("/")
        return getattr(import_module(f"{package}.{kind}"), short)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(f"type is '{name}'; expected package/msg/Name: {error}.") from error


def read_field(message, path):
    """Return the field of a message at a path such as ``header.stamp`` or ``position[0]``."""
    value = message
    for part in path.replace("[", ".[").split("."):
        try:
            value = value[int(part[1:-1])] if part.startswith("[") else getattr(value, part)
        except (AttributeError, IndexError, TypeError, ValueError):
            fields = _expected(part, getattr(value, "get_fields_and_field_types", dict)())
            raise InputError(f"field '{path}' has no part '{part}'{fields}") from None
    return value


def to_yaml(message):
    """Return a message or a field as YAML; a string alone is not quoted."""
    values = _to_values(message)
    if isinstance(values, str):
        return f"{values}\n"
    options = {"sort_keys": False, "default_flow_style": None, "width": 1000, "allow_unicode": True}
    return yaml.safe_dump(values, **options).removesuffix("...\n")


def _to_values(message):
    if names := getattr(message, "get_fields_and_field_types", dict)():
        return {name: _to_values(getattr(message, name)) for name in names}
    if hasattr(message, "tolist"):
        return message.tolist()
    return [_to_values(one) for one in message] if isinstance(message, (bytes, list)) else message


def from_yaml(kind, text):
    """Return a message of a class from YAML; fields that the text lacks keep their defaults."""
    try:
        return _message(kind, yaml.safe_load(text) if text else {}, "request")
    except yaml.YAMLError as error:
        raise InputError(f"request is no YAML: {' '.join(str(error).split())}.") from error


def _message(kind, values, path):
    message, types = kind(), kind.get_fields_and_field_types()
    if not isinstance(values, dict):
        raise InputError(f"{path} is {values!r}; expected {{field: value}} of {', '.join(types)}.")
    for name, value in values.items():
        if name not in types:
            raise InputError(f"{path} has no field '{name}'{_expected(str(name), types)}")
        converted = _convert(types[name], value, f"{path}.{name}")
        try:
            setattr(message, name, converted)
        except (AssertionError, OverflowError) as error:
            raise InputError(f"{path}.{name} is {value!r}; expected {types[name]}.") from error
    return message


def _convert(type_name, value, path):
    """Return a value of YAML as the type of a field."""
    entries = re.fullmatch(r"sequence<([^,]*).*>|(.*)\[\d+\]", type_name)
    if "/" in type_name and not entries:
        return _message(find_type(type_name.replace("/", "/msg/")), value, path)
    kinds = {"double": (float, int), "float": (float, int), "boolean": (bool,), "string": (str,)}
    allowed = (list,) if entries else kinds.get(type_name.split("<")[0], (int,))
    if type(value) not in allowed:
        raise InputError(f"{path} is {value!r}; expected {type_name}.")
    if entries:
        return [_convert(entries[1] or entries[2], one, path) for one in value]
    return bytes([value]) if type_name == "octet" else allowed[0](value)


def _expected(name, names):
    if near := nearest(name, names):
        return f". Did you mean '{near}'?"
    return f"; expected one of {', '.join(names)}." if names else "."
