# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor against Pinocchio: every topic, whatever joint states, descriptions, parameters and
clocks it receives.
"""

import math

import numpy as np
import pinocchio as pin
import pytest
from diag_dynamics.srv import Diagonalize, SetPayload
from geometry_msgs.msg import Inertia
from rcl_interfaces.srv import DescribeParameters, ListParameters
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

import robots
from diag_dynamics.nodes.support.statuses import OK, WARN
from diag_dynamics.parameters.monitor import PARAMETERS
from floating import SOLO, FloatingMonitor
from nodes import (
    LATCHED,
    MS,
    OUTPUTS,
    PANDA,
    TALOS,
    UR5,
    Monitor,
    S,
    Truth,
    assert_close,
    description,
    joint_state,
    nanoseconds,
    robot,
)

FINGER, JOINT, HAND = "panda_finger_joint1", "panda_joint4", "panda_hand"
ARM = tuple(name for name in robot(PANDA).names if name != FINGER)


@pytest.fixture(scope="module")
def running(peer):
    """Start a monitor of the Panda."""
    with Monitor(peer, "/panda", robot_description=robot(PANDA).path) as monitor:
        yield monitor.connect(robot(PANDA))


# --- joint states


@pytest.mark.parametrize("sample", range(3))
def test_every_topic(monitor, panda, sample):
    """Names are shuffled in the message, and joints of another robot are among them."""
    q, qd, tau, _ = panda.samples[sample]
    stamp = monitor.tick()
    message = panda.message(stamp, panda.samples[sample])
    message.name = ["wheel", *message.name[:4], "lid", *message.name[4:]]
    for values in (message.position, message.velocity, message.effort):
        values.insert(0, 1e9)
        values.insert(5, math.nan)
    published = monitor.feed(message)
    assert set(published) == set(OUTPUTS)
    Truth(panda, q, qd, tau).check(published, stamp)
    assert nanoseconds(published["state"].oldest_stamp) == stamp
    assert not published["state"].stamp_is_receive_time


@pytest.mark.parametrize("missing", ["empty", "one NaN", "effort_available"])
def test_without_effort(monitor, panda, missing):
    """What needs efforts is flagged and empty; all else is there."""
    q, qd, tau, _ = panda.samples[2]
    effort = {"empty": [], "one NaN": [*tau[:-1], math.nan]}.get(missing, tau)
    available = [f"{JOINT}=false"] if missing == "effort_available" else ["*=true"]
    with monitor.having(effort_available=available):
        stamp = monitor.tick()
        Truth(panda, q, qd, None).check(
            monitor.feed(joint_state(panda.names, q, qd, effort, stamp)), stamp
        )
        without = {"one NaN": f"1: {FINGER}", "effort_available": f"1: {JOINT}"}
        listed = monitor.next_report().values["joints without effort"]
        assert listed == without.get(missing, f"8: {', '.join(panda.names)}")


def test_efforts_that_are_all_zero(monitor, panda):
    """They are reported unless the robot has gravity compensation."""
    text = "all efforts are 0, but gravity requires"
    q, qd, tau, _ = panda.samples[1]
    for effort, includes_gravity, named in (
        (0.0 * tau, True, True),
        (tau, True, False),
        (0.0 * tau, False, False),
    ):
        with monitor.having(effort_includes_gravity=[f"*={includes_gravity}".lower()]):
            monitor.feed(joint_state(panda.names, q, qd, effort, monitor.tick()))
            report = monitor.next_report()
        assert (text in report.message) == named and (report.level == WARN) == named


def test_estimated_velocity(monitor, panda):
    """A velocity that is missing is flagged in every message; test_joint_state_filters.py has its
    value.
    """
    q, qd, tau, _ = panda.samples[1]
    sent = np.where(np.array(panda.names) == JOINT, math.nan, qd)
    with monitor.having(missing_velocity="estimate"):
        for k in range(3):
            stamp = monitor.tick(10 * MS)
            monitor.publish(joint_state(panda.names, q + 0.01 * k * qd, sent, tau, stamp))
        published = {topic: seen.at(stamp) for topic, seen in monitor.topics.items()}
        published = {topic: message for topic, message in published.items() if message}
        velocity = np.array(published["state"].velocity)
        assert_close(velocity, qd, 1e-12)
        Truth(panda, q + 0.02 * qd, velocity, tau, estimated=True).check(published, stamp)
        report = monitor.next_report()
        assert report.values["joints with estimated velocity"] == f"1: {JOINT}"
    monitor.serves(panda)


# --- time


def test_recording_without_simulated_time(peer, panda):
    """Right numbers with a warning of the distance, until stamps of now come; the recording is
    rejected then.
    """
    with Monitor(peer, "/played", live=True, robot_description=panda.path) as monitor:
        monitor.live = False
        monitor.connect(panda)
        monitor.serves(panda, 2)
        report = monitor.next_report()
        assert report.level == WARN
        assert report.message.startswith("stamps of joint_states are of another clock")
        assert float(report.values["clock minus stamps of joint_states [s]"]) > 1e9
        monitor.serves(panda, 1)
        monitor.next_report()
        assert monitor.process.output.count("Play bags with --clock") == 1
        replayed = monitor.now
        monitor.live = True
        monitor.serves(panda)
        assert monitor.next_report().message == "publishing"
        monitor.forget()
        monitor.publish(panda.message(replayed + 20 * MS, panda.samples[0]))
        assert not monitor.topics["state"].messages
        assert monitor.next_report().count("rejected: stamp from the past") == 1


def test_latency_and_silence(peer, panda):
    """Stamps of 0.25 s ago: latency and age say so; a joint that falls silent is named, then all of
    them.
    """
    with Monitor(peer, "/late", live=True, robot_description=panda.path) as monitor:
        monitor.connect(panda).next_report()
        monitor.feed(panda.message(monitor.tick() - 250 * MS, panda.samples[0]))
        values = monitor.next_report().values
        for which in ("mean", "maximum"):
            assert float(values[f"latency of input, {which} [s]"]) == pytest.approx(0.25, abs=1e-6)
        assert 0.25 <= float(values["age of the last state [s]"]) <= 1.5
        monitor.serves(panda)
        peer.pass_time(0.6)
        monitor.publish(panda.message(monitor.tick(), panda.samples[0], ARM))
        values = monitor.next_report().values
        assert values["stale joints"] in (f"1: {FINGER}", f"8: {', '.join(panda.names)}")
        assert "rejected: stale joint" in values
        report = monitor.next_report()
        assert (report.level, report.message) == (WARN, "no joint states")


def test_latency_of_joint_states(peer):
    """The latency is that of joint states, although a state has the stamp of newer odometry."""
    with FloatingMonitor(peer, "/late_joints", live=True) as monitor:
        monitor.next_report()
        monitor.odom.publish(monitor.odometry(monitor.tick()))
        monitor.publish(monitor.joints_message(monitor.now - 250 * MS))
        values = monitor.next_report().values
        assert float(values["latency of input, mean [s]"]) == pytest.approx(0.25, abs=1e-6)


def test_simulated_time(peer):
    """The time of reception is /clock's; a jump back resets all joints; states ahead of it are
    rejected.
    """
    ur5 = robot(UR5)
    clock = peer.publisher(Clock, "/clock")
    q, qd, tau, _ = ur5.samples[0]

    def set_clock(now):
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(now, S)
        clock.publish(message)
        peer.graph.spin()

    with Monitor(
        peer, "/sim", robot_description=ur5.path, use_sim_time=True, max_age=1.0
    ) as monitor:
        states = monitor.topics["state"]
        monitor.connect(ur5)
        monitor.process.wait_for_text("use_sim_time is set, but /clock has no messages")
        assert monitor.reports[0].message == "publishing"
        for now in (5 * S, 7 * S + 1, 5000 * S):
            set_clock(now)
            monitor.publish(joint_state(ur5.names, q, qd, tau, 0))
            assert states.messages[-1].stamp_is_receive_time
            assert states.stamps[-1] == now
        before = monitor.reports[-1]
        set_clock(100 * S)
        monitor.forget()
        first = 100 * S + 10 * MS
        second = 100 * S + 20 * MS
        monitor.publish(ur5.message(first, ur5.samples[1], ur5.names[:3]))
        published = monitor.feed(ur5.message(second, ur5.samples[1], ur5.names[3:]), ["state"])
        Truth(ur5, *ur5.samples[1][:3]).check(published, second)
        assert states.stamps == [second]
        monitor.publish(ur5.message(103 * S, ur5.samples[1]))  # /clock stands still
        peer.pass_time(1.0)
        since = monitor.reports[-1].since(before)
        assert (
            since["clock jumped back"]
            == since["incomplete"]
            == since["rejected: stamp from the future"]
            == 1
        )
        set_clock(103 * S)
        monitor.now = 102 * S
        monitor.serves(ur5)
        monitor.set_parameter("use_sim_time", False)
        monitor.publish(joint_state(ur5.names, q, qd, tau, 0))
        assert states.stamps[-1] == peer.now()


# --- parameters


def test_every_parameter_is_described(monitor):
    """Each has a description, a type, a range where it is a number, and its choices."""
    listed = monitor.call(ListParameters, "list_parameters", ListParameters.Request()).result.names
    options = {
        name
        for name in listed
        if not name.startswith(("qos_overrides.", "use_sim_time", "start_type_description"))
    }
    assert options == set(PARAMETERS)
    names = sorted(options)
    request = DescribeParameters.Request(names=names)
    described = monitor.call(DescribeParameters, "describe_parameters", request).descriptors
    values = monitor.peer.get_parameters(monitor.name, names)
    for name, result in zip(names, described, strict=True):
        assert len(result.description) > 20
        assert result.read_only == PARAMETERS[name].read_only
        if isinstance(values[name], float):
            (bounds,) = result.floating_point_range
            assert bounds.from_value <= values[name] <= bounds.to_value
        for choice in PARAMETERS[name].choices:
            assert choice in result.additional_constraints


@pytest.mark.parametrize(
    ("topic", "rate", "stride"),
    [
        ("mass_matrix_factors", None, 20),
        ("state", None, 1),
        ("state", 100.0, 10),
        ("state", 400.0, 2.5),
    ],
)
def test_rate_limit(monitor, panda, topic, rate, stride):
    """States at 1 kHz: the topic has its highest rate, up to a twentieth of a period early; others
    have every state.
    """
    rates = PARAMETERS["max_rate"].default if rate is None else [f"{topic}={rate}"]
    count = 100
    first = monitor.tick()
    with monitor.having(max_rate=rates):
        monitor.publish(
            *(panda.message(first + k * MS, panda.samples[k % 3]) for k in range(count))
        )
    monitor.now = first + count * MS
    stamps = monitor.topics[topic].stamps
    assert stamps[0] == first
    gaps = np.diff(stamps) / MS
    assert all(gaps >= 0.95 * math.floor(stride))
    assert all(gaps <= math.ceil(stride))
    assert abs(len(stamps) - count / stride) <= 1 + 0.05 * count / stride
    assert (
        len(monitor.topics["kinetic_energy"].stamps)
        == len(monitor.topics["coriolis"].stamps)
        == count
    )


def test_payload_and_gravity_together(monitor, panda):
    """Set at once, they hold from one state to the next."""
    gravity = (1.0, -2.0, 3.0)
    load = (2.0, (0.0, 0.1, 0.2), np.diag([0.01, 0.02, 0.025]))
    entry = f"{HAND}=2.0 0 0.1 0.2 0.01 0.02 0.025 0 0 0"
    revision = monitor.serves(panda)["state"].model_revision
    q, qd, tau, _ = panda.samples[2]
    loaded = panda.changed(payloads={HAND: load})
    with monitor.having(payloads=[entry], gravity=list(gravity)):
        published = monitor.serves(loaded, 2, Truth(loaded, q, qd, tau, gravity=gravity))
        assert published["state"].model_revision == revision + 1
        assert monitor.next_report().values["payloads"] == f"1: {HAND}"


# --- descriptions


@pytest.fixture(scope="module")
def by_topic(peer):
    """Start a monitor, all names remapped, that gets its robot by a topic that was published
    before.
    """
    descriptions = peer.publisher(String, "/elsewhere/description", LATCHED)
    descriptions.publish(description(robot(UR5).urdf))
    names = ("__node:=dyn", "robot_description:=/elsewhere/description", "joint_states:=arm/states")
    remapped = [argument for name in names for argument in ("-r", name)]
    with Monitor(peer, "/topic", *remapped, joint_states="arm/states", name="dyn") as monitor:
        monitor.describe = lambda urdf: descriptions.publish(description(urdf))
        yield monitor.connect(robot(UR5))


def replaced(monitor, urdf, name):
    """Publish a description and wait until its robot is in force."""
    monitor.describe(urdf)
    return monitor.wait_for_report(lambda report: report.values.get("robot") == name, name)


def test_another_robot(by_topic):
    """A later description replaces the robot; states of the old one do not count, and joints that
    are missing are named.
    """
    ur5 = robot(UR5)
    talos = robot(TALOS)
    by_topic.serves(ur5)
    replaced(by_topic, talos.urdf, "talos")
    by_topic.forget()
    by_topic.publish(ur5.message(by_topic.tick(), ur5.samples[0]))
    by_topic.serves(talos, 1)
    assert by_topic.topics["state"].stamps == [by_topic.now]
    replaced(by_topic, ur5.urdf, "ur5")
    by_topic.forget()
    by_topic.publish(ur5.message(by_topic.tick(), ur5.samples[0], ur5.names[:4]))
    report = by_topic.next_report()
    assert (report.level, report.message) == (
        WARN,
        f"joints without data: {', '.join(ur5.names[4:])}",
    )
    assert report.values["missing joints"] == f"2: {', '.join(ur5.names[4:])}"
    assert not by_topic.topics["state"].messages
    by_topic.serves(ur5)


@pytest.fixture(scope="module")
def tool():
    """Return the Panda with another hand: its joints have the same names."""
    panda = robot(PANDA)
    before, hand, rest = panda.urdf.partition(f'<link name="{HAND}">')
    changed = before.replace('<robot name="panda"', '<robot name="panda_with_tool"') + hand
    mass = panda.oracle.xml.find(f"link[@name='{HAND}']/inertial/mass").get("value")
    changed += rest.replace(f'<mass value="{mass}"', '<mass value="3.5"', 1)
    return panda.changed(changed)


@pytest.mark.parametrize("by", ["topic", "parameter", "path"])
def test_another_tool(by_topic, monitor, panda, tool, tmp_path, by):
    """All joints of the new robot have to arrive, though their names are the same; the numbers are
    the new robot's.
    """
    if by == "topic":
        monitor = by_topic
        replaced(monitor, panda.urdf, "panda")
    before = monitor.serves(panda)["state"].model_revision
    (tmp_path / "tool.urdf").write_text(tool.urdf)
    if by == "topic":
        replaced(monitor, tool.urdf, "panda_with_tool")
    else:
        source = tool.urdf if by == "parameter" else str(tmp_path / "tool.urdf")
        monitor.set_parameter("robot_description", source)
    monitor.forget()
    monitor.publish(tool.message(monitor.tick(MS), tool.samples[1], ARM))
    published = monitor.feed(tool.message(monitor.tick(MS), tool.samples[1], [FINGER]), ["state"])
    Truth(tool, *tool.samples[1][:3]).check(published, monitor.now)
    assert monitor.topics["state"].stamps == [monitor.now]
    assert published["state"].model_revision == before + 1
    if by != "topic":
        monitor.set_parameter("robot_description", str(panda.path))
        monitor.serves(panda)


def test_payload_outlives_a_description(by_topic, panda, tool):
    """On a robot without its link it is named as not applied; it is back with the link."""
    load = SetPayload.Request(link=HAND, inertia=Inertia(m=2.0, ixx=0.01, iyy=0.02, izz=0.025))
    replaced(by_topic, panda.urdf, "panda")
    assert by_topic.call(SetPayload, "set_payload", load).success
    payloads = {HAND: (2.0, (0.0, 0.0, 0.0), np.diag([0.01, 0.02, 0.025]))}
    for result, name in ((tool, "panda_with_tool"), (robot(UR5), "ur5"), (panda, "panda")):
        applied = name != "ur5"
        model = replaced(by_topic, result.urdf, name).entries["model"]
        by_topic.serves(result.changed(payloads=payloads) if applied else result, 1)
        assert {pair.key: pair.value for pair in model.values}["payloads"] == (
            f"1: {HAND}" if applied else "0"
        )
        assert model.level == (OK if applied else WARN)
        assert applied or model.message == f"payloads on unknown links: {HAND}"
    by_topic.call(SetPayload, "set_payload", SetPayload.Request(link=HAND))
    by_topic.serves(panda)


def test_motionless_robot(by_topic):
    """A robot without a moving joint does not end the node."""
    iris = robots.robot("iris_description/robots/iris_simple.urdf").urdf
    replaced(by_topic, iris, "iris")
    by_topic.publish(
        robot(UR5).message(by_topic.tick(), robot(UR5).samples[0]),
        joint_state(stamp=by_topic.tick()),
    )
    response = by_topic.call(Diagonalize, "diagonalize", Diagonalize.Request())
    assert response.success, response.message
    assert response.state.kinetic_energy == 0.0
    assert len(response.state.nu) == response.factors.nv == 0
    replaced(by_topic, robot(UR5).urdf, "ur5")
    by_topic.serves(robot(UR5))


# --- floating base


@pytest.fixture(scope="module")
def floating(peer):
    """Start a monitor of Solo."""
    parameters = {"joint_timeout": '["FL_HAA=2.0"]'}
    with FloatingMonitor(peer, "/floating", **parameters) as monitor:
        yield monitor


def test_base_from_odometry(floating):
    """The base's coordinates and rates are those of odometry, its dynamics the library's."""
    floating.check(floating.answer())


def test_base_of_a_request(floating):
    """A service has the numbers of the topic for pose and twist of a request."""
    odometry = floating.odometry(floating.now)
    request = Diagonalize.Request(state=floating.joints_message(floating.now))
    request.base_pose = odometry.pose.pose
    request.base_twist = odometry.twist.twist
    response = floating.call(Diagonalize, "diagonalize", request)
    assert response.success, response.message
    floating.check({"state": response.state, "kinetic_energy": response.kinetic_energy})


def test_odometry_of_an_attached_link(peer):
    """A camera on the base may be what is tracked, and its twist in the axes of the world."""
    camera = (
        '<link name="camera"/><joint name="mount" type="fixed"><parent link="base_link"/>'
        '<child link="camera"/>'
        '<origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/></joint></robot>'
    )
    text = robots.robot_path(SOLO).read_text().replace("</robot>", camera)
    peer.publisher(String, "/camera/robot_description", LATCHED).publish(description(text))
    attached = pin.SE3(pin.rpy.rpyToMatrix(0.4, 0.5, 0.6), np.array([0.1, 0.2, 0.3]))
    with FloatingMonitor(peer, "/camera", description=None, odom_twist_frame="header") as monitor:
        monitor.process.wait_for_text("Ready")
        monitor.check(monitor.answer(child="camera", attached=attached, in_header=True))
