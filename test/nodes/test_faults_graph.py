# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Publishers and quality of service that fit and that do not: what arrives, and what /diagnostics say of the rest."""

import pytest
from diag_dynamics.msg import DiagonalizedState, KineticEnergy
from rcl_interfaces.srv import ListParameters
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from nodes import BELIEVING, LATCHED, MS, OUTPUTS, PANDA, UR5, Monitor, Peer, Truth, description, joint_state, robot

pytestmark = [pytest.mark.full, pytest.mark.live]

OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"

BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
RELIABLE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)


@pytest.fixture(scope="module")
def other(ros_domain):
    """Return a second node, in a participant of its own, as a type of a topic is fixed within one."""
    with Peer(ros_domain, "intruder") as node:
        yield node


@pytest.fixture(scope="module")
def default(peer):
    """Start a monitor with the quality of service that it has by itself, and its robot from the topic."""
    descriptions = peer.publisher(String, "/default/robot_description", LATCHED)
    descriptions.publish(description(robot(PANDA).urdf))
    with Monitor(peer, "/default", reliable=False) as monitor:
        yield monitor.connect(robot(PANDA))


@pytest.fixture(scope="module")
def overridden(peer):
    """Start a monitor with overrides of an input and of outputs."""
    overrides = {
        "/strict/joint_states.subscription.reliability": "reliable",
        "/strict/joint_states.subscription.depth": 7,
        "/strict/diag_dynamics/state.publisher.reliability": "best_effort",
        "/strict/diag_dynamics/state.publisher.depth": 3,
        "/strict/diag_dynamics/kinetic_energy.publisher.durability": "transient_local",
        "/strict/diag_dynamics/coriolis.publisher.history": "keep_all",
    }
    parameters = {f"qos_overrides.{name}": value for name, value in overrides.items()}
    with Monitor(peer, "/strict", robot_description=robot(PANDA).path, **parameters) as monitor:
        # The test's own subscription to `state` is reliable, so nothing of a best-effort publisher reaches it.
        peer.node.destroy_subscription(monitor.topics["state"].subscription)
        monitor.topics["state"] = peer.topic(DiagonalizedState, f"{monitor.name}/state", BEST_EFFORT)
        yield monitor.connect(robot(PANDA))


def joint_states_report(monitor, condition, what):
    """Wait for a report whose entry on the joint states fulfils a condition, and return that entry."""
    report = monitor.wait_for_report(lambda report: condition(report.entries["joint states"]), what)
    return report.entries["joint states"]


@pytest.mark.parametrize("qos", [BEST_EFFORT, RELIABLE], ids=["best effort", "reliable"])
def test_either_reliability_arrives(default, panda, qos):
    """By default, a publisher of sensor data reaches the node as well as a reliable one."""
    peer, feeder = default.peer, default.feeder
    default.serves(panda)
    publisher = peer.publisher(JointState, "/default/joint_states", qos)
    try:
        peer.wait_until(publisher.get_subscription_count, "the subscription")
        default.feeder = publisher
        default.connect(panda).serves(panda, 1)
    finally:
        default.feeder = feeder
        peer.node.destroy_publisher(publisher)
    default.serves(panda, 2)


def test_overrides_are_honoured(overridden, panda):
    """What the graph says of publishers and subscriptions is what the parameters ask for, and numbers flow."""
    node, at = overridden.peer.node, overridden.name
    (listener,) = node.get_subscriptions_info_by_topic("/strict/joint_states")
    assert listener.qos_profile.reliability == ReliabilityPolicy.RELIABLE

    def publisher(topic):
        (info,) = node.get_publishers_info_by_topic(f"{at}/{topic}")
        return info.qos_profile

    assert publisher("state").reliability == ReliabilityPolicy.BEST_EFFORT
    assert publisher("kinetic_energy").durability == DurabilityPolicy.TRANSIENT_LOCAL
    assert publisher("total_joint_rates").reliability == ReliabilityPolicy.RELIABLE
    assert publisher("total_joint_rates").durability == DurabilityPolicy.VOLATILE
    # history and depth do not go over the wire: the parameters tell
    names = [
        "qos_overrides./strict/joint_states.subscription.depth",
        "qos_overrides./strict/diag_dynamics/state.publisher.depth",
        "qos_overrides./strict/diag_dynamics/coriolis.publisher.history",
    ]
    assert list(overridden.peer.get_parameters(at, names).values()) == [7, 3, "keep_all"]
    overridden.serves(panda)
    # a late joiner gets the last message of a transient_local output
    late = overridden.peer.topic(KineticEnergy, f"{at}/kinetic_energy", LATCHED)
    overridden.peer.wait_until(lambda: late.messages, "the last kinetic energy")
    assert late.stamps == [overridden.now]
    overridden.peer.node.destroy_subscription(late.subscription)


def test_overrides_of_every_topic_can_be_read(default):
    """Every input and output has its parameters, so that they can be found."""
    listed = default.call(ListParameters, "list_parameters", ListParameters.Request()).result.names
    at = {f"/default/{topic}": "subscription" for topic in ("joint_states", "robot_description")}
    at |= {f"/default/diag_dynamics/{topic}": "publisher" for topic in OUTPUTS}
    for topic, kind in at.items():
        for policy in ("history", "depth", "reliability", "durability"):
            assert f"qos_overrides.{topic}.{kind}.{policy}" in listed


def test_incompatible_publisher_of_states(overridden, other, panda):
    """Best effort does not reach a reliable subscription: its node is named, and the right one beside it is served."""
    peer = overridden.peer
    overridden.serves(panda)
    publisher = other.publisher(JointState, "/strict/joint_states", BEST_EFFORT)
    try:

        def named(status):
            overridden.serves(panda, 1)
            return "/intruder" in status.message

        status = joint_states_report(overridden, named, "the publisher that does not fit")
        assert status.level == WARN
        for text in ("QoS of /intruder", "/strict/joint_states", "not compatible"):
            assert text in status.message
        assert "/test" not in status.message
        overridden.forget()
        publisher.publish(panda.message(overridden.now + 1, panda.samples[0]))
        overridden.serves(panda, 2)
        assert overridden.topics["state"].stamps == [overridden.now]
    finally:
        other.node.destroy_publisher(publisher)

    def over(status):
        overridden.serves(panda)
        return status.level == OK

    assert joint_states_report(overridden, over, "its departure").message == "publishing"
    peer.wait_until(lambda: peer.node.count_publishers("/strict/joint_states") == 1, "the one that is left")


def test_publisher_of_another_type(default, other, panda):
    """A topic of the same name and another type: its node and type are named; joint states go on."""
    publisher = other.publisher(String, "/default/joint_states")
    try:

        def named(status):
            publisher.publish(String(data="not a joint state"))
            default.serves(panda, 1)
            return "/intruder" in status.message

        status = joint_states_report(default, named, "the publisher of another type")
        assert status.level == WARN
        assert "/intruder publishes std_msgs/msg/String on /default/joint_states" in status.message
        assert "expected sensor_msgs/msg/JointState" in status.message
        default.serves(panda, 2)
    finally:
        other.node.destroy_publisher(publisher)

    def over(status):
        default.serves(panda)
        return status.level == OK

    joint_states_report(default, over, "its departure")


def test_volatile_description(default, other, panda):
    """A description that is not latched cannot be waited for: its publisher is named, and the latched one counts."""
    publisher = other.publisher(String, "/default/robot_description", QoSProfile(depth=1))
    try:
        publisher.publish(description(robot(UR5).urdf))

        def named(status):
            default.serves(panda, 1)
            return "/intruder" in status.message

        status = joint_states_report(default, named, "the volatile publisher")
        assert status.level == WARN
        assert "/default/robot_description" in status.message
        assert default.next_report().values["robot"] == "panda"
    finally:
        other.node.destroy_publisher(publisher)

    def over(status):
        default.serves(panda)
        return status.level == OK

    joint_states_report(default, over, "its departure")
    Truth(panda, *panda.samples[0][:3]).check_state(default.topics["state"].messages[-1])


def test_two_publishers_of_the_same_joints(default, other, panda):
    """In turns: one robot's states go on, the other's are refused as jumps; both publishers are named to whoever looks."""
    q, qd, tau, _ = panda.samples[0]
    intruder = other.publisher(JointState, "/default/joint_states", BEST_EFFORT)
    try:

        def seen():  # by name: others that have gone may be seen for a while yet
            found = default.peer.node.get_publishers_info_by_topic("/default/joint_states")
            return {"intruder", "test"} <= {info.node_name for info in found}

        default.peer.wait_until(seen, "the intruder")
        default.serves(panda)
        before = default.next_report()
        default.set_parameter("absurd.jump", 0.1)
        listed, still = "publishers of /default/joint_states", 0.0 * qd

        def refused(report):
            stamp = default.tick(8 * MS)
            state = default.feed(joint_state(panda.names, q, still, tau, stamp), ["state"])["state"]
            Truth(panda, q, still, tau).check_state(state)
            intruder.publish(joint_state(panda.names, q + 0.5, still, tau, default.tick(8 * MS)))
            named = report.values[listed].partition(": ")[2].split(", ")
            return report.since(before).get("rejected: jump", 0) > 3 and {"/intruder", "/test"} <= set(named)

        report = default.wait_for_report(refused, "refused jumps")
        count, _, named = report.values[listed].partition(": ")
        assert int(count) == len(named.split(", ")) >= 2
        assert report.level == WARN and "position went from" in report.values["last rejection"]
        assert not default.topics["state"].at(default.now)
    finally:
        default.set_parameter("absurd.jump", BELIEVING["absurd.jump"])
        other.node.destroy_publisher(intruder)
    default.serves(panda, 1)


def test_two_hundred_subscribers(default, panda):
    """All of them hear every state, and the monitor goes on as if there were one."""
    peer = default.peer
    many = [peer.topic(DiagonalizedState, f"{default.name}/state") for _ in range(200)]
    try:
        peer.wait_until(lambda: all(topic.subscription.get_publisher_count() for topic in many), "all to know it")

        def heard():
            default.serves(panda)
            return all(topic.messages for topic in many)

        peer.wait_until(heard, "all to be known")
        for sample in range(3):
            state = default.serves(panda, sample)["state"]
            stamp = default.now
            peer.wait_until(lambda stamp=stamp: all(topic.at(stamp) for topic in many), "a state, for all of them")
            assert all(topic.at(stamp) == state for topic in many)
    finally:
        for topic in many:
            peer.node.destroy_subscription(topic.subscription)


def test_publishers_are_listed(default):
    """Who publishes the inputs can be read; others that have gone may be seen for a while yet."""
    inputs = ("joint_states", "robot_description")

    def told(status):
        values = {pair.key: pair.value for pair in status.values}
        return all(values.get(f"publishers of /default/{topic}") == "1: /test" for topic in inputs)

    joint_states_report(default, told, "this test alone")


def test_defaults(default):
    """The defaults are those of sensor data in, reliable out."""
    node = default.peer.node
    (listener,) = node.get_subscriptions_info_by_topic("/default/joint_states")
    assert listener.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    (publisher,) = node.get_publishers_info_by_topic(f"{default.name}/state")
    assert publisher.qos_profile.reliability == ReliabilityPolicy.RELIABLE
    names = [f"qos_overrides./default/joint_states.subscription.{policy}" for policy in ("history", "depth")]
    history, depth = default.peer.get_parameters(default.name, names).values()
    assert history == HistoryPolicy.KEEP_LAST.short_key
    assert depth >= 1
