# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes under test in the test's process, a node to talk to them, and what their messages have to
say.
"""

import contextlib
from functools import cache
from typing import NamedTuple
from unittest import mock

from diag_dynamics.msg import (
    CoriolisTerm,
    DiagonalizedState,
    JointSpaceDynamics,
    KineticEnergy,
    MassMatrixFactors,
    TotalJointRates,
    WorkingMoments,
)
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

import described
from accuracy import assert_close as assert_close
from accuracy import tolerance as tolerance
from described import MS as MS
from described import PANDA as PANDA
from described import TALOS as TALOS
from described import UR5 as UR5
from described import S
from diag_dynamics.nodes.support.runner import node_class
from limits import HANG
from node_harness import Graph
from truth import Truth as Truth
from truth import nanoseconds

OUTPUTS = {
    "total_joint_rates": TotalJointRates,
    "working_moments": WorkingMoments,
    "coriolis": CoriolisTerm,
    "mass_matrix_factors": MassMatrixFactors,
    "kinetic_energy": KineticEnergy,
    "joint_space_dynamics": JointSpaceDynamics,
    "state": DiagonalizedState,
}
"""What a monitor publishes under its name."""

MAX_AGE = 60.0
"""How old states may be whose stamps are judged by the clock [s]: a busy machine is late by more
than the default, 1 s.
"""

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
MANY = QoSProfile(depth=1000)


# --- the test's own node


class Topic:
    """A subscription and all that came by it."""

    def __init__(self, node, kind, name, qos):
        """Subscribe."""
        self.messages = []
        self.stamps = []
        self._at = {}
        self.subscription = node.create_subscription(kind, name, self._take, qos)

    def _take(self, message):
        self.messages.append(message)
        if hasattr(message, "header"):
            stamp = nanoseconds(message.header.stamp)
            self.stamps.append(stamp)
            self._at.setdefault(stamp, []).append(message)

    def at(self, stamp):
        """Return the one message with this stamp [ns]; None if there is none yet."""
        result = self._at.get(stamp, ())
        assert len(result) <= 1, (
            f"{len(result)} messages on {self.subscription.topic_name} with one stamp"
        )
        return result[0] if result else None

    def repeated(self, stamp):
        """Return the message with this stamp [ns], however often it came; None if there is none, or
        others with it.
        """
        result = self._at.get(stamp, ())
        return result[0] if result and all(other == result[0] for other in result) else None

    def forget(self):
        """Drop all messages received so far."""
        self.messages.clear()
        self.stamps.clear()
        self._at.clear()


class Running(contextlib.AbstractContextManager):
    """A node of this package in the test's process; a context at whose end it is destroyed.

    Attributes
    ----------
    node : rclpy.node.Node
    """

    def __init__(self, peer, node):
        self.peer = peer
        self.node = node

    @property
    def output(self):
        """All that it has logged until now, a line each."""
        return "\n".join(self.node.output)

    def wait_for_text(self, text):
        """Let time go by until this has been logged."""
        self.peer.wait_until(lambda: text in self.output, repr(text))

    def alive(self):
        """Return whether it has not been destroyed."""
        return self.node in self.peer.graph.nodes

    def stop(self, *signals):
        """Destroy it; a process would be sent signals."""
        if self.alive():
            self.node.destroy_node()

    def __exit__(self, *_):
        self.stop()


class Peer(contextlib.AbstractContextManager):
    """A node of the test's own beside the nodes under test, all in one process: see
    :mod:`node_harness`.
    """

    def __init__(self):
        """Make a graph, and a node on it."""
        self.graph = Graph()
        self.node = self.graph.add(Node, node_name="test")
        self.clients = {}
        # rclpy's executor, which controllers spin to ask for joints, serves no graph
        module = "diag_dynamics.nodes.controller.controller"
        self._asking = mock.patch(f"{module}.joints_of_controller", self._joints_of_controller)
        self._asking.start()

    def __exit__(self, *_):
        self._asking.stop()
        self.graph.__exit__()

    def _joints_of_controller(self, node, controller):
        """Return the parameter `joints` of an effort controller on the graph; None without one."""
        service = self.graph.services.get(f"{controller}/get_parameters")
        if service is None:
            return None
        request = GetParameters.Request(names=["joints"])
        (joints,) = service.callback(request, GetParameters.Response()).values
        return list(joints.string_array_value)

    def start(self, name, *arguments, **parameters):
        """Start a node of this package, such as "monitor"; `arguments` are ROS arguments."""
        for parameter, value in parameters.items():
            arguments += ("-p", f"{parameter}:={value}")
        return Running(self, self.graph.add(node_class(name), *arguments))

    def extra_node(self, name, namespace, apart=False):
        """Make another node of the test's; `apart`: in a context of its own, see
        :meth:`Graph.add`.
        """
        return self.graph.add(Node, node_name=name, namespace=namespace, apart=apart)

    def drop_node(self, node):
        """Have it leave the graph."""
        node.destroy_node()

    def now(self):
        """Return the time of the node's clock [ns]."""
        return self.node.get_clock().now().nanoseconds

    def pass_time(self, seconds):
        """Let time go by."""
        self.graph.advance(seconds)

    def wait_until(self, condition, what, timeout=HANG):
        """Let time go by until a condition holds, and return its value; `what` is being waited
        for.
        """
        value = self.graph.run(condition, self.graph.steady + timeout)
        assert value, f"waited {timeout:g} s in vain for {what}"
        return value

    def publisher(self, kind, name, qos=MANY):
        """Return a publisher."""
        return self.node.create_publisher(kind, name, qos)

    def topic(self, kind, name, qos=MANY):
        """Subscribe."""
        return Topic(self.node, kind, name, qos)

    def call(self, kind, name, request, node=None):
        """Call a service, of a node or else of the one that its name begins with, and return the
        response.
        """
        if name not in self.clients:
            self.clients[name] = self.node.create_client(kind, name)
            self.become_known(node or name.rpartition("/")[0])
        client = self.clients[name]
        self.wait_until(client.service_is_ready, f"service {name}")
        future = client.call_async(request)
        self.wait_until(future.done, f"a response of {name}")
        return future.result()

    def become_known(self, node):
        """Return: on a graph of one process everybody is known at once."""

    def set_parameter(self, node, name, value):
        """Set a parameter of a node and return the result."""
        parameter = Parameter(name, value=value).to_parameter_msg()
        request = SetParameters.Request(parameters=[parameter])
        return self.call(SetParameters, f"{node}/set_parameters", request).results[0]

    def set_parameters_atomically(self, node, values):
        """Set several parameters of a node, all or none, and return the result."""
        parameters = [
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
        ]
        request = SetParametersAtomically.Request(parameters=parameters)
        return self.call(
            SetParametersAtomically, f"{node}/set_parameters_atomically", request
        ).result

    def get_parameters(self, node, names):
        """Return parameters of a node as Python values, by name."""
        values = self.call(
            GetParameters, f"{node}/get_parameters", GetParameters.Request(names=list(names))
        ).values
        return dict(zip(names, map(parameter_value_to_python, values), strict=True))

    def transition(self, node, label):
        """Ask a managed node for a transition, and return whether it succeeded."""
        request = ChangeState.Request(transition=Transition(label=label))
        return self.call(ChangeState, f"{node}/change_state", request).success

    def phase(self, node):
        """Return the lifecycle state of a managed node."""
        return self.call(GetState, f"{node}/get_state", GetState.Request()).current_state.label


# --- a monitor


SEVERITY = (b"\x00", b"\x03", b"\x01", b"\x02")
"""Levels OK, STALE, WARN and ERROR: without states every entry is stale, and only one of them may
say why.
"""

OUTCOMES = (
    "published",
    "incomplete",
    "foreign",
    "empty",
    "followers only",
    "before the model",
    "before odometry",
    "awaiting velocity",
    "skipped: overload",
)
"""What becomes of a joint state that is not rejected, as /diagnostics count it."""

OTHER_COUNTERS = (
    "received",
    "odometry received",
    "time jumped back",
    "clock jumped back",
    "mimic disagreement",
    "implausible effort",
    "positions jumped",
    "lost in transport",
)


class Report(NamedTuple):
    """A monitor's entries on /diagnostics: stamp [ns], level and message of the worst, values of
    all, each by its name.
    """

    stamp: int
    level: bytes
    message: str
    values: dict
    entries: dict

    def count(self, key):
        """Return how often something has happened."""
        return int(self.values.get(key, 0))

    def counts(self):
        """Return all counters that are not zero."""
        counters = (*OUTCOMES, *OTHER_COUNTERS)
        names = [
            key
            for key in self.values
            if key in counters or key.startswith(("rejected: ", "odometry rejected: "))
        ]
        return {key: self.count(key) for key in names if self.count(key)}

    def since(self, before):
        """Return what has been counted since an earlier report, by key."""
        counts = self.counts()
        earlier = before.counts()
        return {
            key: n - earlier.get(key, 0) for key, n in counts.items() if n != earlier.get(key, 0)
        }

    def outcomes(self):
        """Return what has become of all joint states received, in all."""
        return sum(
            n for key, n in self.counts().items() if key in OUTCOMES or key.startswith("rejected: ")
        )


def report_of(array, name):
    """Put the entries of one node together; None if it has none in this array."""
    statuses = [
        status for status in array.status if status.name.startswith(f"{name.lstrip('/')}: ")
    ]
    if not statuses:
        return None
    worst = max(statuses, key=lambda status: SEVERITY.index(status.level))
    values = {pair.key: pair.value for status in statuses for pair in status.values}
    entries = {status.name.split(": ")[1]: status for status in statuses}
    return Report(nanoseconds(array.header.stamp), worst.level, worst.message, values, entries)


class Reports(list):
    """All reports of a node on /diagnostics, in their order: see :class:`Report`.

    Record `len(reports)` before the event and pass it as `begin`, because the report may arrive
    before the wait starts.
    """

    def __init__(self, node, wait_until, name):
        """Listen to the node `name`; `wait_until` is that of a `Peer` or a `Network`."""
        super().__init__()
        self._node = node
        self._wait_until = wait_until
        self._name = name
        node.create_subscription(DiagnosticArray, "/diagnostics", self._take, MANY)

    def _take(self, array):
        if report := report_of(array, self._name):
            self.append(report)

    def wait_for(self, condition, what, begin=None, timeout=HANG):
        """Wait for the first report, from number `begin` or else from now on, that fulfils a
        condition, and return it.
        """
        begin = len(self) if begin is None else begin
        try:
            return self._wait_until(
                lambda: next(filter(condition, self[begin:]), None),
                f"a report of {what} by {self._name}",
                timeout,
            )
        except AssertionError as error:
            raise AssertionError(f"{error}; the last reports: {self[begin:][-3:]}") from error

    def next(self):
        """Wait for a report of all entries that is made from now on, and return it.

        Its stamp is compared with the clock, because an older report may be in transit. Not for
        nodes in simulated time.
        """
        now = self._node.get_clock().now().nanoseconds
        return self.wait_for(
            lambda report: report.stamp > now and len(report.entries) > 1, "anything"
        )


BELIEVING = {f"plausibility.{bound}": 0.0 for bound in ("beyond_velocity", "jump")} | {
    "stuck_timeout": 0.0
}
"""Parameters of a monitor that takes states drawn at random, up to 90 times as fast as the URDF
allows and no motion.
"""


class Monitor(contextlib.AbstractContextManager):
    """A monitor seen from outside: all its inputs and outputs.

    Stamps are the test's own: `tick` advances them by so much that every rate limit lets the next
    state through. With `live`, they are those of the clock instead, no topic has a highest rate,
    and states may be :data:`MAX_AGE` old.
    """

    def __init__(
        self,
        peer,
        namespace,
        *arguments,
        joint_states="joint_states",
        name="diag_dynamics",
        live=False,
        reliable=True,
        outputs=OUTPUTS,
        **parameters,
    ):
        """Start it in a namespace, and subscribe to `outputs`.

        `reliable`: it asks again for an input that gets lost, which by default it does not.
        """
        self.peer = peer
        self.live = live
        self.name = f"{namespace}/{name}"
        self.now = 1000 * S
        self.feeder = peer.publisher(JointState, f"{namespace}/{joint_states}")
        self.topics = {
            topic: peer.topic(OUTPUTS[topic], f"{self.name}/{topic}") for topic in outputs
        }
        self.reports = Reports(peer.node, peer.wait_until, self.name)
        defaults = {"max_rate": ["*=0"], "max_age": MAX_AGE} if live else {"max_age": 0.0}
        defaults |= BELIEVING
        for topic in (joint_states, "odom") if reliable else ():
            defaults[f"qos_overrides.{namespace}/{topic}.subscription.reliability"] = "reliable"
        self.process = peer.start(
            "monitor", "-r", f"__ns:={namespace}", *arguments, **(defaults | parameters)
        )

    def __exit__(self, *error):
        self.process.__exit__(*error)

    def connect(self, robot, sample=0):
        """Wait until the node takes in states of a robot and all that it publishes arrives here."""
        self.peer.wait_until(
            lambda: (
                self.feeder.get_subscription_count()
                and all(topic.subscription.get_publisher_count() for topic in self.topics.values())
            ),
            f"{self.name} to be discovered",
        )
        # A publisher may know of a subscription before that knows of it: the first messages can get
        # lost.
        self.tick()  # what came by the last stamp came by another publisher, or to another robot
        patience = 0.5
        while not all(topic.at(self.now) for topic in self.topics.values()):
            assert patience < HANG, f"nothing comes through {self.name}"
            self.feeder.publish(robot.message(self.tick(), robot.samples[sample]))
            with contextlib.suppress(AssertionError):
                self._all_at(self.now, self.topics, patience)
            patience *= 1.5  # it may be slow, too
        return self

    def tick(self, step=S):
        """Advance the stamps by a step [ns] and return the new one."""
        if self.live:
            self.peer.pass_time(1e-3)  # no two states of one stamp
        self.now = self.peer.now() if self.live else self.now + step
        return self.now

    def publish(self, *messages):
        """Publish joint states, or their bytes, and have each served: only in process."""
        for message in messages:
            self.feeder.publish(message)
            self.peer.graph.spin()

    def feed(self, message, topics=None, timeout=HANG):
        """Publish a joint state and return what comes back by topic; its stamp is that of the
        message.
        """
        self.feeder.publish(message)
        return self._all_at(nanoseconds(message.header.stamp), topics or self.topics, timeout)

    def serves(self, robot, sample=0, truth=None):
        """Feed a whole state, and check all that comes of it against Pinocchio; return it by
        topic.
        """
        q, qd, tau, _ = robot.samples[sample]
        stamp = self.tick()
        published = self.feed(robot.message(stamp, robot.samples[sample]))
        (truth or Truth(robot, q, qd, tau)).check(published, stamp)
        return published

    def _all_at(self, stamp, topics, timeout=HANG):
        self.peer.wait_until(
            lambda: None not in [self.topics[topic].at(stamp) for topic in topics],
            f"what {self.name} makes of stamp {stamp}",
            timeout,
        )
        return {topic: self.topics[topic].at(stamp) for topic in topics}

    def forget(self):
        """Drop all messages received so far, but for the last report."""
        for topic in self.topics.values():
            topic.forget()
        del self.reports[:-1]

    def wait_for_report(self, condition, what, begin=None):
        """Wait for a report that fulfils a condition, and return it: see
        :meth:`Reports.wait_for`.
        """
        return self.reports.wait_for(condition, what, begin)

    def next_report(self):
        """Wait for a report that is made from now on, and return it: see :meth:`Reports.next`."""
        return self.reports.next()

    def call(self, kind, service, request):
        """Call one of its services."""
        return self.peer.call(kind, f"{self.name}/{service}", request)

    def set_parameter(self, name, value):
        """Set one of its parameters, which must succeed."""
        result = self.set_parameters({name: value})
        assert result.successful, result.reason

    def set_parameters(self, values):
        """Set several of its parameters, all or none, and return the result; in process, a robot is
        then loaded.
        """
        result = self.peer.set_parameters_atomically(self.name, values)
        if node := getattr(self.process, "node", None):
            self.peer.graph.finish_loading(node)
        return result

    @contextlib.contextmanager
    def having(self, **values):
        """Set parameters, which must succeed, and put them back at the end."""
        values = {name.replace("__", "."): value for name, value in values.items()}
        before = self.peer.get_parameters(self.name, values)
        result = self.set_parameters(values)
        assert result.successful, result.reason
        try:
            yield
        finally:
            result = self.set_parameters(before)
            assert result.successful, result.reason

    def alive(self):
        """Whether it still runs."""
        return self.process.alive()


# --- robots and their messages


class Robot(described.Robot):
    """A robot, and its messages."""

    def message(self, stamp, sample, names=None):
        """Return a JointState with some or all joints, in the order of `names`, shuffled by
        default.
        """
        names = self.shuffled if names is None else names
        at = [self.names.index(name) for name in names]
        return joint_state(names, *(values[at] for values in sample[:3]), stamp=stamp)


@cache
def robot(id, free=False):
    """Return a robot of the wheel, or one of `coupling.NAMED`, loaded once."""
    return Robot(id, free)


def joint_state(names=(), position=(), velocity=(), effort=(), stamp=0):
    """Return a JointState; stamp in nanoseconds."""
    message = JointState(name=[str(name) for name in names])
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, S)
    message.position, message.velocity, message.effort = (
        [float(x) for x in values] for values in (position, velocity, effort)
    )
    return message


def description(text):
    """Return a robot_description."""
    return String(data=text)
