# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of publishers, quality of service, requests and names: what fits is served, and the rest
is named.
"""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from diag_dynamics.msg import DiagonalizedState, KineticEnergy
from diag_dynamics.srv import Diagonalize, SetPayload
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Inertia, Vector3
from rcl_interfaces.srv import ListParameters
from rclpy.event_handler import QoSSubscriptionEventType as Lost
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from diag_dynamics.nodes.support.statuses import WARN
from diag_dynamics.text import MAX_LENGTH, shortened
from nodes import (
    LATCHED,
    MS,
    OUTPUTS,
    PANDA,
    UR5,
    Monitor,
    description,
    joint_state,
    robot,
)

BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
RELIABLE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
HAND = "panda_hand"


@pytest.fixture(scope="module")
def running(peer):
    """Start a monitor with the default QoS, and its robot by topic."""
    peer.publisher(String, "/default/robot_description", LATCHED).publish(
        description(robot(PANDA).urdf)
    )
    with Monitor(peer, "/default", reliable=False) as monitor:
        yield monitor.connect(robot(PANDA))


@pytest.fixture(scope="module")
def overridden(peer):
    """Start a monitor with overrides of the QoS of an input and of outputs."""
    overrides = {
        "joint_states.subscription.reliability": "reliable",
        "joint_states.subscription.depth": 7,
        "diag_dynamics/state.publisher.reliability": "best_effort",
        "diag_dynamics/kinetic_energy.publisher.durability": "transient_local",
    }
    parameters = {f"qos_overrides./strict/{name}": value for name, value in overrides.items()}
    with Monitor(peer, "/strict", robot_description=robot(PANDA).path, **parameters) as monitor:
        # The test's own subscription to `state` is reliable, and receives nothing of a best-effort
        # publisher.
        peer.node.destroy_subscription(monitor.topics["state"].subscription)
        monitor.topics["state"] = peer.topic(
            DiagonalizedState, f"{monitor.name}/state", BEST_EFFORT
        )
        yield monitor.connect(robot(PANDA))


@pytest.fixture
def intruder(peer):
    """Return a node of another context, because a topic has one type within a context."""
    node = peer.extra_node("intruder", "/", apart=True)
    yield node
    peer.drop_node(node)


# --- publishers


def test_default_qos(monitor, panda):
    """Inputs are sensor data, so publishers of either reliability arrive; outputs are reliable; all
    have parameters.
    """
    node = monitor.peer.node
    feeder = monitor.feeder
    for qos in (BEST_EFFORT, RELIABLE):
        monitor.feeder = monitor.peer.publisher(JointState, "/default/joint_states", qos)
        monitor.serves(panda)
        node.destroy_publisher(monitor.feeder)
    monitor.feeder = feeder
    (publisher,) = node.get_publishers_info_by_topic(f"{monitor.name}/state")
    assert publisher.qos_profile.reliability == ReliabilityPolicy.RELIABLE
    listed = monitor.call(ListParameters, "list_parameters", ListParameters.Request()).result.names
    at = {f"/default/{topic}": "subscription" for topic in ("joint_states", "robot_description")}
    at |= {f"{monitor.name}/{topic}": "publisher" for topic in OUTPUTS}
    wanted = ("history", "depth", "reliability", "durability")
    assert {
        f"qos_overrides.{topic}.{kind}.{policy}" for topic, kind in at.items() for policy in wanted
    } <= {*listed}


def test_overrides_of_qos(overridden, panda):
    """Publishers and subscriptions have the QoS of the parameters, and states are served."""
    node = overridden.peer.node
    (listener,) = node.get_subscriptions_info_by_topic("/strict/joint_states")
    assert (listener.qos_profile.reliability, listener.qos_profile.depth) == (
        ReliabilityPolicy.RELIABLE,
        7,
    )
    profiles = {
        topic: node.get_publishers_info_by_topic(f"{overridden.name}/{topic}")[0].qos_profile
        for topic in OUTPUTS
    }
    assert profiles["state"].reliability == ReliabilityPolicy.BEST_EFFORT
    assert profiles["total_joint_rates"].reliability == ReliabilityPolicy.RELIABLE
    overridden.serves(panda)
    late = overridden.peer.topic(KineticEnergy, f"{overridden.name}/kinetic_energy", LATCHED)
    overridden.peer.graph.spin()
    assert late.stamps == [overridden.now]
    node.destroy_subscription(late.subscription)


def test_messages_that_the_middleware_lost(monitor):
    """They are counted beside those received."""
    before = monitor.next_report()
    (states,) = [
        entry
        for entry in monitor.process.node.subscriptions
        if entry.topic_name == "/default/joint_states"
    ]
    (handler,) = [
        entry
        for entry in states.event_handlers
        if entry.event_type == Lost.RCL_SUBSCRIPTION_MESSAGE_LOST
    ]
    handler.callback(SimpleNamespace(total_count=7, total_count_change=3))
    assert monitor.next_report().since(before) == {"lost in transport": 3}


TYPE = ["/intruder publishes std_msgs/msg/String on", "expected sensor_msgs/msg/JointState"]
USELESS = [  # monitor, type, topic, QoS, words of the warning
    (
        "overridden",
        JointState,
        "/strict/joint_states",
        BEST_EFFORT,
        ["QoS of /intruder", "incompatible"],
    ),
    ("running", String, "/default/joint_states", QoSProfile(depth=1), TYPE),
    ("running", String, "/default/robot_description", QoSProfile(depth=1), ["QoS of /intruder on"]),
]


@pytest.mark.parametrize(
    ("name", "kind", "topic", "qos", "words"), USELESS, ids=["QoS", "type", "not latched"]
)
def test_a_publisher_that_cannot_be_used(request, intruder, panda, name, kind, topic, qos, words):
    """A warning names it; the publisher that fits is served, and the latched description counts."""
    monitor = request.getfixturevalue(name)
    publisher = intruder.create_publisher(kind, topic, qos)
    monitor.serves(panda, 1)
    publisher.publish(
        description(robot(UR5).urdf)
        if kind is String
        else panda.message(monitor.now, panda.samples[0])
    )
    monitor.serves(panda, 2)
    report = monitor.next_report()
    entry = report.entries["joint states"]
    assert entry.level == WARN and all(word in entry.message for word in [topic, *words]), (
        entry.message
    )
    assert "/test" not in entry.message and report.values["robot"] == "panda"
    intruder.destroy_publisher(publisher)
    monitor.serves(panda)
    assert monitor.next_report().entries["joint states"].message == "publishing"


def names_both_nodes(report):
    """Return whether the warning of joints with two publishers is there."""
    warning = "' on /default/joint_states: /intruder, /test. Stop one of them"
    entry = report.entries["joint states"]
    return entry.level == WARN and warning in entry.message


@pytest.mark.parametrize(
    ("first", "second", "overlap"),
    [
        (slice(0, 7), slice(7, None), False),
        (slice(0, 7), slice(6, None), True),
        (slice(None), slice(None, None, -1), True),
    ],
    ids=["arm and gripper", "one joint in both", "other order"],
)
def test_publishers_of_parts(monitor, intruder, panda, first, second, overlap):
    """A warning in diagnostics and log names two nodes whose joints overlap."""
    publisher = intruder.create_publisher(JointState, "/default/joint_states", BEST_EFFORT)
    q, qd, tau, _ = panda.samples[0]
    monitor.next_report()
    monitor.peer.pass_time(60.0)  # since the last line of the log
    begin = len(monitor.process.output)
    for part, sender in ((first, monitor.feeder), (second, publisher)):
        values = (panda.names[part], q[part], qd[part], tau[part])
        sender.publish(joint_state(*values, monitor.tick(8 * MS)))
        monitor.peer.graph.spin()
    report = monitor.next_report()
    assert names_both_nodes(report) == overlap
    assert report.values["publishers of /default/joint_states"] == "2: /test, /intruder"
    assert ("/intruder, /test" in monitor.process.output[begin:]) == overlap
    intruder.destroy_publisher(publisher)
    assert not names_both_nodes(monitor.next_report())


def test_two_publishers_of_the_clock(peer, intruder):
    """Time would jump between theirs: diagnostics name both."""
    clocks = [(node, node.create_publisher(Clock, "/clock", 10)) for node in (peer.node, intruder)]
    with Monitor(peer, "/timed", robot_description=robot(PANDA).path, use_sim_time=True) as monitor:
        peer.pass_time(2.0)
        report = monitor.reports[-1]
        assert report.values["publishers of /clock"] == "2: /intruder, /test"
        assert report.entries["joint states"].message.startswith("several nodes publish /clock")
    for node, clock in clocks:
        node.destroy_publisher(clock)


# --- requests


def inertia(mass, moments=(0.01, 0.02, 0.025), **com):
    """Return an inertia."""
    message = Inertia(m=mass, com=Vector3(**com))
    message.ixx, message.iyy, message.izz = moments
    return message


def test_payload_by_service_and_by_parameter(monitor, panda):
    """`set_payload` sets the parameter `payloads`, which attaches the same when it is set; links
    are independent.
    """
    load = (2.0, (0.0, 0.1, 0.2), np.diag([0.01, 0.02, 0.025]))
    loaded = panda.changed(payloads={HAND: load})
    both = panda.changed(payloads={HAND: load, "panda_link5": (1.0, (0, 0, 0), np.zeros((3, 3)))})
    revision = monitor.serves(panda)["state"].model_revision
    request = SetPayload.Request(link=HAND, inertia=inertia(2.0, y=0.1, z=0.2))
    response = monitor.call(SetPayload, "set_payload", request)
    assert response.success, response.message
    assert monitor.serves(loaded, 1)["state"].model_revision == revision + 1
    (entry,) = monitor.peer.get_parameters(monitor.name, ["payloads"])["payloads"]
    numbers = [float(number) for number in entry.removeprefix(f"{HAND}=").split()]
    assert numbers == [2.0, 0.0, 0.1, 0.2, 0.01, 0.02, 0.025, 0.0, 0.0, 0.0]
    with monitor.having(payloads=[entry, "panda_link5=1"]):
        monitor.serves(both, 2)
        off = monitor.call(SetPayload, "set_payload", SetPayload.Request(link="panda_link5"))
        assert off.success and off.total_mass == pytest.approx(response.total_mass)
        assert monitor.peer.get_parameters(monitor.name, ["payloads"])["payloads"] == [entry]
        monitor.serves(loaded)
    monitor.set_parameter("payloads", [""])
    monitor.serves(panda, 1)


# --- names that would act on a terminal or forge lines of a log


FIRE = "\n[FATAL] [0.0] [safety_controller]: fire"
ELBOW, WRIST = f"elbow{FIRE}", "wrist\x9b31m\u202e"
ESCAPE = "\x1b]0;owned\x07\x1b[31m"  # XML has no such character, ROS messages have
URDF = """<robot name="arm&#10;[FATAL] [0.0] [safety_controller]: robot&#x9b;2J">
  <link name="base"/>
  <joint name="elbow&#10;[FATAL] [0.0] [safety_controller]: fire" type="revolute">
    <parent link="base"/><child link="upper&#x9b;2J"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="9" velocity="9"/>
  </joint>
  <link name="upper&#x9b;2J"><inertial><origin xyz="0 0 0.1"/><mass value="1"/>
    <inertia ixx="0.05" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <joint name="wrist&#x9b;31m&#x202e;" type="continuous">
    <parent link="upper&#x9b;2J"/><child link="hand"/><origin xyz="0 0 0.2"/><axis xyz="1 0 0"/>
  </joint>
  <link name="hand"><inertial><origin xyz="0 0 0.1"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
</robot>"""
"""The inertia of the upper link is that of no body, which each node warns of by name."""


def texts_of(arrays):
    """Return every text in diagnostics."""
    for status in (status for array in arrays for status in array.status):
        yield from (status.name, status.message, status.hardware_id)
        yield from (text for pair in status.values for text in (pair.key, pair.value))


def check_log(running):
    """Check that every line is one of the logger and printable, and names what was wrong."""
    assert r"[FATAL] [0.0] [safety_controller]: robot\x9b2J" in running.output
    for line in running.output.split("\n"):
        assert line.isprintable(), repr(line)
        assert not line.startswith("[FATAL]"), line


def test_names_that_would_act(peer):
    """Names are published as they are; in the log, in diagnostics and in responses control
    characters are escaped.
    """
    diagnostics = peer.topic(DiagnosticArray, "/diagnostics")
    descriptions = peer.publisher(String, "/hostile/robot_description", LATCHED)
    descriptions.publish(description(URDF))
    feeder = peer.publisher(JointState, "/hostile/joint_states")
    states = peer.topic(DiagonalizedState, "/hostile/diag_dynamics/state")
    at = "/hostile/diag_dynamics"
    wrong = {
        ELBOW: joint_state([ELBOW, WRIST, ELBOW], [0.1] * 3, [0.0] * 3),
        WRIST: joint_state([WRIST], [math.nan], [0.0]),
        ESCAPE: joint_state([ELBOW, ESCAPE], [0.1], [0.0]),
    }
    with peer.start("monitor", "-r", "__ns:=/hostile") as process:
        peer.pass_time(1.0)
        feeder.publish(joint_state([ELBOW, WRIST, ESCAPE], [0.1, 0.2, 0.3], [0.0] * 3))
        peer.graph.spin()
        assert list(states.messages[-1].dof_names) == [ELBOW, WRIST]
        for name, message in wrong.items():
            feeder.publish(message)
            peer.pass_time(1.0)
            assert any(f"'{shortened(name)}'" in text for text in texts_of(diagnostics.messages))
        unknown = Diagonalize.Request(state=joint_state([ESCAPE], [0.0], [0.0]))
        for message in (
            peer.call(Diagonalize, f"{at}/diagonalize", unknown).message,
            peer.call(
                SetPayload, f"{at}/set_payload", SetPayload.Request(link=f"{ESCAPE}{FIRE}")
            ).message,
            peer.set_parameter(at, "payloads", [f"{ESCAPE}=heavy"]).reason,
        ):
            assert r"\x1b]0;owned\x07\x1b[31m" in message and message.isprintable()
        descriptions.publish(description(URDF.replace('value="1"', 'value="-1"')))
        process.wait_for_text("robot_description rejected")
        assert r"upper\x9b2J" in process.output
    assert all(text.isprintable() for text in texts_of(diagnostics.messages))
    assert len(shortened("\x1b" * 1_000_000)) <= MAX_LENGTH
    check_log(process)


@pytest.mark.parametrize("node", ["monitor", "simulator", "controller"])
def test_long_names_have_short_lines(peer, node):
    """The graph of the tests rejects longer lines of a log."""
    long = "long" * 1000
    elbow = ELBOW.replace("elbow", "long" * 1000)
    diagnostics = peer.topic(DiagnosticArray, "/diagnostics")
    descriptions = peer.publisher(String, f"/{node}/robot_description", LATCHED)
    text = re.sub("arm|elbow|upper", long, URDF)
    descriptions.publish(description(text))
    feeder = peer.publisher(JointState, f"/{node}/joint_states")
    options = {
        "monitor": {},
        "simulator": {"robot_description": repr(text)},
        "controller": {"robot_compensates_gravity": "false", "autostart": "true"},
    }
    with peer.start(node, "-r", f"__ns:=/{node}", **options[node]) as process:
        for names, position in (([elbow], 0.0), ([elbow, WRIST], math.nan), ([long], 0.0)) * 20:
            feeder.publish(joint_state(names, [position] * len(names), [0.0] * len(names)))
            peer.pass_time(0.1)
        descriptions.publish(description(text.replace('value="1"', 'value="-1"')))
        peer.pass_time(1.0)
    assert long[:300] in process.output
    assert 0 < max(map(len, texts_of(diagnostics.messages))) <= MAX_LENGTH
