# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes in the test's own process: one graph, one clock that the test sets, no discovery, no
executor.

A node is constructed as its executable constructs it, with the same ROS arguments. Its publishers,
subscriptions, services, clients and timers are those of rclpy, so that names, remappings, QoS
overrides and parameters are judged by rclpy. Only the transport is replaced: :class:`Graph` hands
each message to the callbacks of its subscriptions, and fires the timers that are due at the time of
the test. Everything happens in one thread, in a fixed order.
"""

import contextlib
import itertools
import sys
import threading
from collections import defaultdict, deque
from functools import cache
from types import SimpleNamespace
from typing import ClassVar

import pytest
import rclpy
from rclpy.clock import ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSCompatibility, qos_check_compatible
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.task import Future
from rclpy.time import Time
from rosgraph_msgs.msg import Clock

from diag_dynamics.nodes.support.clocks import NodeTime
from diag_dynamics.nodes.support.descriptions import PERIOD, THREAD
from diag_dynamics.text import MAX_LENGTH

SECOND = 1_000_000_000

MAX_DELIVERIES = 20_000
"""Deliveries without a pause after which two nodes are taken to answer each other for ever."""


class Endpoint:
    """A publisher or a subscription: whose it is, its topic, type and QoS; a gid of its own."""

    _gids: ClassVar = itertools.count(1)

    def __init__(self, node, kind, topic, qos):
        self.node = node
        self.kind = kind
        self.topic = topic
        self.qos = qos
        self.gid = next(self._gids).to_bytes(16, "little")

    @property
    def info(self):
        """As rclpy's TopicEndpointInfo has it."""
        return SimpleNamespace(
            node_name=self.node.get_name(),
            node_namespace=self.node.get_namespace(),
            topic_type=type_name(self.kind),
            endpoint_gid=list(self.gid),
            qos_profile=self.qos,
        )


def type_name(kind):
    """Return the name of a message type, for example sensor_msgs/msg/JointState."""
    package, middle, _ = kind.__module__.split(".", 2)
    return f"{package}/{middle}/{kind.__name__}"


class Proxy:
    """Something of rclpy, of which a few attributes are the graph's."""

    def __init__(self, real):
        self._real = real

    def __getattr__(self, name):
        return getattr(self._real, name)


class GraphPublisher(Proxy):
    """A publisher that publishes to the graph."""

    def __init__(self, real, graph, node):
        super().__init__(real)
        self.graph = graph
        self.latched = deque(maxlen=max(1, real.qos_profile.depth))
        self.end = Endpoint(node, real.msg_type, real.topic_name, real.qos_profile)
        self.handle = SimpleNamespace(
            publish_raw=self.send,
            get_subscription_count=self.get_subscription_count,
            topic_name=real.topic_name,
        )

    def publish(self, message):
        """Publish a message, or its bytes."""
        self.send(message if isinstance(message, bytes) else serialize_message(message))

    def send(self, raw):
        """Hand bytes to all matched subscriptions."""
        if self.end.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            self.latched.append(raw)
        if self.end.kind is Clock:
            self.graph.follow(raw)
        for subscription in self.graph.subscriptions[self.end.topic]:
            if matches(self, subscription):
                self.graph.deliver(subscription, raw)

    def get_subscription_count(self):
        """Count matched subscriptions."""
        return sum(
            matches(self, subscription) for subscription in self.graph.subscriptions[self.end.topic]
        )


class GraphSubscription(Proxy):
    """A subscription whose callback the graph calls."""

    def __init__(self, real, graph, node):
        super().__init__(real)
        self.graph = graph
        self.destroyed = False
        self.end = Endpoint(node, real.msg_type, real.topic_name, real.qos_profile)

    def get_publisher_count(self):
        """Count matched publishers."""
        return sum(matches(publisher, self) for publisher in self.graph.publishers[self.end.topic])

    def take(self, raw):
        """Call the callback with a message, or with its bytes where the node wants those."""
        if not self.destroyed:
            self._real.callback(
                raw if self._real.raw else deserialize_message(raw, self._real.msg_type)
            )


def matches(publisher, subscription):
    """Return whether a publisher and a subscription agree in type and QoS."""
    compatible, _ = qos_check_compatible(publisher.end.qos, subscription.end.qos)
    return publisher.end.kind is subscription.end.kind and compatible != QoSCompatibility.ERROR


class GraphClient(Proxy):
    """A client whose requests the graph hands to the service of its name."""

    def __init__(self, real, graph):
        super().__init__(real)
        self.graph = graph
        self.removed = set()

    def service_is_ready(self):
        """Return whether there is such a service."""
        return self.service_name in self.graph.services

    def call_async(self, request):
        """Return a future, done once the graph has served the request."""
        future = Future()

        def respond(response):
            if future not in self.removed:
                future.set_result(response)

        self.graph.request(self.service_name, request, respond)
        return future

    def remove_pending_request(self, future):
        """Wait for no response."""
        self.removed.add(future)


class GraphTimer:
    """A timer that fires at the time of its clock."""

    def __init__(self, graph, period, callback, read):
        self.graph = graph
        self.period = period
        self.callback = callback
        self.read = read
        self.canceled = False
        self.reset()

    def reset(self):
        """Begin a period now."""
        self.canceled, self.due = False, self.read() + self.period

    def cancel(self):
        """Fire no more."""
        self.canceled = True

    def fire_if_due(self):
        """Fire once if a period is over; return whether it has fired. Periods that were missed are
        skipped.
        """
        now = self.read()
        if self.canceled or now < self.due - 1e-9:
            return False
        self.due += self.period * max(1, int((now - self.due) / self.period) + 1)
        self.callback()
        return True


def logged(severity):
    """Return a method that logs with a severity."""

    def log(self, message, **options):
        return self._log(severity, message, **options)

    return log


class GraphLogger:
    """A logger that keeps its lines; `once` and throttling hold for the place of the call, by the
    time of the test.
    """

    def __init__(self, graph, name, output):
        self.graph = graph
        self.name = name
        self.output = output
        self._last = {}

    def _log(self, severity, message, once=False, throttle_duration_sec=0.0):
        if len(message) > MAX_LENGTH:
            pytest.fail(f"a line of the log has {len(message)} characters: {message[:200]}")
        frame = sys._getframe(2)
        place = (frame.f_code, frame.f_lineno)
        now = self.graph.steady
        if place in self._last and (once or now - self._last[place] < throttle_duration_sec):
            return False
        self._last[place] = now
        self.output.append(f"[{severity}] [{self.name}]: {message}")
        return True

    def get_child(self, _):
        """Return the logger of a part of the node: this one."""
        return self

    debug, info, warning, error = map(logged, ("DEBUG", "INFO", "WARN", "ERROR"))
    warn = warning


class GraphClock(Proxy):
    """A node's clock: simulated time where the node uses it, else the system time that the test
    sets.
    """

    def __init__(self, real, graph):
        super().__init__(real)
        self.graph = graph

    def now(self):
        """Return the time."""
        if self._real.ros_time_is_active:
            return self._real.now()
        return Time(nanoseconds=self.graph.system, clock_type=ClockType.ROS_TIME)


@cache
def in_process(kind):
    """Return a class of nodes that live on a :class:`Graph`, which is its class attribute
    `graph`.
    """

    class InProcess(kind):
        graph = None
        """Set while a node is constructed, see :meth:`Graph.add`."""

        def __init__(self, *args, **kwargs):
            self.graph = type(self).graph
            self.output = []
            self.timers_ = []
            super().__init__(*args, **kwargs)
            for (
                service
            ) in self.services:  # those of a lifecycle node are not made by create_service
                self.graph.offer(service)

        # --- time and log

        def get_clock(self):
            return GraphClock(super().get_clock(), self.graph)

        def get_logger(self):
            logger = self.__dict__.get("_graph_logger")
            if logger is None:
                logger = self._graph_logger = GraphLogger(self.graph, self.get_name(), self.output)
            return logger

        def create_timer(self, period, callback, callback_group=None, clock=None, autostart=True):
            clock = clock or self.get_clock()
            steady = clock.clock_type == ClockType.STEADY_TIME
            read = (
                (lambda: self.graph.steady)
                if steady
                else (lambda: clock.now().nanoseconds / SECOND)
            )
            timer = GraphTimer(self.graph, float(period), callback, read)
            self.graph.timers.append(timer)
            self.timers_.append(timer)
            return timer

        def destroy_timer(self, timer):
            timer.cancel()
            self.graph.timers = [other for other in self.graph.timers if other is not timer]
            return True

        # --- topics

        def create_publisher(self, *args, **kwargs):
            return self.graph.publish_by(super().create_publisher(*args, **kwargs), self)

        def destroy_publisher(self, publisher):
            return super().destroy_publisher(self.graph.drop_publisher(publisher))

        def create_subscription(self, *args, **kwargs):
            return self.graph.subscribe_by(super().create_subscription(*args, **kwargs), self)

        def destroy_subscription(self, subscription):
            return super().destroy_subscription(self.graph.drop_subscription(subscription))

        def count_publishers(self, topic):
            return len(self.graph.publishers[self.resolve_topic_name(topic)])

        def count_subscribers(self, topic):
            return len(self.graph.subscriptions[self.resolve_topic_name(topic)])

        def get_publishers_info_by_topic(self, topic, no_mangle=False):
            return [
                publisher.end.info
                for publisher in self.graph.publishers[self.resolve_topic_name(topic)]
            ]

        def get_subscriptions_info_by_topic(self, topic, no_mangle=False):
            return [
                entry.end.info for entry in self.graph.subscriptions[self.resolve_topic_name(topic)]
            ]

        def get_topic_names_and_types(self, no_demangle=False):
            return self.graph.topics()

        # --- services

        def create_service(self, *args, **kwargs):
            return self.graph.offer(super().create_service(*args, **kwargs))

        def destroy_service(self, service):
            self.graph.services = {
                name: entry for name, entry in self.graph.services.items() if entry is not service
            }
            return super().destroy_service(service)

        def create_client(self, *args, **kwargs):
            return GraphClient(super().create_client(*args, **kwargs), self.graph)

        def destroy_client(self, client):
            return super().destroy_client(getattr(client, "_real", client))

        def destroy_node(self):
            self.graph.forget(self)
            return super().destroy_node()

    InProcess.__name__ = kind.__name__
    return InProcess


def join_loading():
    """Wait for all robots that are being loaded: they take no time of the test's."""
    for thread in threading.enumerate():
        if thread.name == THREAD:
            thread.join()


class Graph(contextlib.AbstractContextManager):
    """Nodes in one process, what connects them, and their time.

    Attributes
    ----------
    steady : float
        Steady time [s].
    system : int
        System time [ns].
    """

    def __init__(self, system=1_700_000_000 * SECOND):
        self.steady = 1000.0
        self.system = system
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.contexts = [self.context]
        self.nodes = []
        self.timers = []
        self.services = {}
        self.publishers = defaultdict(list)
        self.subscriptions = defaultdict(list)
        self._events = deque()
        self._serving = False
        self._time_moved = False
        self._simulated = None

    def __exit__(self, *_):
        for node in reversed(self.nodes.copy()):
            node.destroy_node()
        for context in self.contexts:
            context.try_shutdown()

    # --- nodes

    def add(self, kind, *arguments, apart=False, **options):
        """Construct a node; `arguments` are ROS arguments as a shell would give them.

        `apart`: in a context of its own. Within one context a topic has one type.
        """
        made = in_process(kind)
        graph = self
        if apart:
            self.contexts.append(rclpy.Context())
            rclpy.init(context=self.contexts[-1])
        options["context"] = self.contexts[-1] if apart else self.context

        class Time(NodeTime):
            def steady(self):
                return graph.steady

            def system(self):
                return graph.system

        if arguments:
            options["cli_args"] = ["--ros-args", *map(str, arguments)]
        if kind is not Node:
            options["time"] = Time
        made.graph = self
        try:
            node = made(use_global_arguments=False, **options)
        finally:
            made.graph = None
        self.nodes.append(node)
        self.finish_loading(node)
        return node

    def finish_loading(self, node):
        """Have the robot of a parameter loaded: it takes no time of the test's but one look of the
        executor.
        """
        loader = getattr(node, "_loader", None)
        try:
            while loader and loader.loading is not None:
                join_loading()
                self.advance(PERIOD)
            if loader and node.finished.done():
                node.finished.result()  # or its exception
        except Exception:
            node.destroy_node()
            raise

    def forget(self, node):
        """Take all that is a node's off the graph."""
        for timer in node.timers_:
            timer.cancel()
        self.timers = [timer for timer in self.timers if not timer.canceled]
        for ends in (self.publishers, self.subscriptions):
            for topic in ends:
                for end in [end for end in ends[topic] if end.end.node is node]:
                    self._drop(ends, end)
        services = set(node.services)
        self.services = {
            name: service for name, service in self.services.items() if service not in services
        }
        if node in self.nodes:
            self.nodes.remove(node)

    # --- what nodes make

    def publish_by(self, real, node):
        """Enter a publisher."""
        publisher = GraphPublisher(real, self, node)
        self.publishers[publisher.end.topic].append(publisher)
        return publisher

    def drop_publisher(self, publisher):
        """Remove a publisher, and return rclpy's; rclpy itself, which destroys a node, gives its
        own.
        """
        return self._drop(self.publishers, publisher)

    def _drop(self, ends, end):
        real = getattr(end, "_real", end)
        for topic in ends.values():
            for gone in [entry for entry in topic if entry._real is real]:
                topic.remove(gone)
                gone.destroyed = True
        return real

    def subscribe_by(self, real, node):
        """Enter a subscription; a latched one receives what was latched."""
        subscription = GraphSubscription(real, self, node)
        self.subscriptions[subscription.end.topic].append(subscription)
        if subscription.end.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            for publisher in self.publishers[subscription.end.topic]:
                for raw in (
                    [*publisher.latched][-subscription.end.qos.depth :]
                    if matches(publisher, subscription)
                    else ()
                ):
                    self.deliver(subscription, raw)
        return subscription

    def drop_subscription(self, subscription):
        """Remove a subscription, and return rclpy's."""
        return self._drop(self.subscriptions, subscription)

    def offer(self, service):
        """Enter a service, and return it."""
        service.send_response = lambda response, respond: respond(response)
        self.services[service.service_name] = service
        return service

    def topics(self):
        """Return names and types of all topics."""
        kinds = defaultdict(set)
        for ends in (self.publishers, self.subscriptions):
            for topic, entries in ends.items():
                kinds[topic].update(type_name(entry.end.kind) for entry in entries)
        return sorted((topic, sorted(names)) for topic, names in kinds.items() if names)

    # --- events

    def deliver(self, subscription, raw):
        """Have a message wait for its turn."""
        self._events.append((subscription.take, raw))

    def request(self, name, request, respond):
        """Have a request wait for its turn."""
        self._events.append((self._serve, (name, request, respond)))

    def _serve(self, asked):
        name, request, respond = asked
        if service := self.services.get(name):
            sent = deserialize_message(serialize_message(request), service.srv_type.Request)
            response = service.callback(sent, service.srv_type.Response())
            service.send_response(response, respond)

    def serve_next(self):
        """Serve the timers that are due, or else one message or request; return whether there was
        any.
        """
        if self._time_moved:
            self._time_moved = False
            if self._fire():
                return True
        if not self._events:
            return self._fire()
        take, item = self._events.popleft()
        self._serving = True
        try:
            take(item)
        finally:
            self._serving = False
        return True

    def spin(self):
        """Serve all that waits and all timers that are due, until nothing is left to do."""
        for _ in range(MAX_DELIVERIES):
            if not self.serve_next():
                return
        raise AssertionError(f"nodes answered each other {MAX_DELIVERIES} times without a pause")

    def run(self, condition, end):
        """Let time go by, and serve callbacks, until a condition holds or a steady time has come;
        return its value.

        The condition is looked at whenever all that waits is served, or time has gone on in
        lockstep.
        """
        while True:
            while self.serve_next() and not self._time_moved:
                pass
            if (value := condition()) or self.steady >= end:
                return value
            if not self._time_moved:
                self._go_on(end)

    def follow(self, raw):
        """Let as much time go by as simulated time does while nodes answer each other in
        lockstep.
        """
        now = deserialize_message(raw, Clock).clock
        before = self._simulated
        self._simulated = now.sec * SECOND + now.nanosec
        if self._serving and before is not None and self._simulated > before:
            self.skip((self._simulated - before) / SECOND)

    def _fire(self):
        """Fire every timer that is due, once; return whether there was one."""
        return sum(timer.fire_if_due() for timer in self.timers.copy()) > 0

    def skip(self, seconds):
        """Let time go by in which no callback is served, as on a machine that stands still."""
        self.steady += seconds
        self.system += round(seconds * SECOND)
        self._time_moved = True

    def advance(self, seconds):
        """Let time go by, and serve callbacks at their times."""
        self.run(lambda: False, self.steady + seconds)

    def _go_on(self, end):
        """Go on to the next timer, at most to a steady time."""
        join_loading()
        waits = [timer.due - timer.read() for timer in self.timers if not timer.canceled]
        self.skip(min(end - self.steady, 1.0, *(wait for wait in waits if wait > 0.0)))
