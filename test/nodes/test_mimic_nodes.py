# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mimic joints on the graph, coupled to their leaders: listed or not, right or wrong, and moved by efforts of their own."""

import math

import numpy as np
import pytest
from diag_dynamics.srv import Diagonalize, ForwardDynamics, InverseDynamics, SetPayload
from geometry_msgs.msg import Inertia, Pose, Twist
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from coupling import NAMED, Coupled
from nodes import LATCHED, MS, PANDA, START, Monitor, S, Truth, assert_close, description, joint_state, robot, tolerance
from processes import node_process

pytestmark = [pytest.mark.full, pytest.mark.live]

OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"

CHAIN = "follower of a follower"
FAN = "several followers of one leader"
GRIPPER = "parallel gripper"
BAXTER = "baxter_description/urdf/baxter.urdf"
TIAGO = "tiago_pro_description/robots/tiago_pro.urdf"

LEADER, FOLLOWER = "f1", "f2"
"""Of FAN; q(f2) = 0.8 q(f1)."""


class Whole:
    """A state of all joints of a robot, as its driver would list them: followers, too, with efforts of their own."""

    def __init__(self, robot, sample=0, **own):
        """Take a sample of the robot; `own` are efforts of followers, and zero those that are not given."""
        self.robot, oracle = robot, robot.oracle
        self.q, self.qd, tau, self.qdd = robot.samples[sample]
        self.names = oracle.full.dof_names
        self.position, self.velocity = oracle.q_full(self.q), oracle.G @ self.qd
        effort = dict(zip(robot.names, tau, strict=True)) | own
        self.effort = np.array([effort.get(name, 0.0) for name in self.names])
        self.followers = [name for name in self.names if name not in robot.names]
        self.truth = Truth(robot, self.q, self.qd, oracle.G.T @ self.effort)

    def message(self, stamp=0, names=None, **position):
        """List all joints, or those given, shuffled; positions may be put in place of the right ones."""
        names = np.random.default_rng(7).permutation(self.names if names is None else names).tolist()
        at = [self.names.index(name) for name in names]
        message = joint_state(names, self.position[at], self.velocity[at], self.effort[at], stamp)
        for name, value in position.items():
            message.position[names.index(name)] = value
        return message


@pytest.fixture(scope="module")
def monitor(peer):
    """Start a monitor, with the default of mimic, that gets its robots by topic."""
    descriptions = peer.publisher(String, "/mimic/robot_description", LATCHED)
    with Monitor(peer, "/mimic") as monitor:
        monitor.descriptions, monitor.robot = descriptions, None
        yield monitor
        assert not any("internal error" in key for key in monitor.next_report().values)


def use(monitor, id):
    """Put a robot in force and forget what was before; returns it."""
    found = robot(id)
    if monitor.robot is not found:
        monitor.robot = None
        monitor.descriptions.publish(description(found.urdf))
        monitor.wait_for_report(lambda report: report.values.get("robot") == found.oracle.xml.get("name"), id)
        monitor.connect(found)
        monitor.robot = found
    monitor.feed(Whole(found).message(monitor.tick()))
    monitor.forget()
    return found


@pytest.fixture
def fan(monitor):
    """Return a state of a robot with three followers of one leader, which is in force."""
    return Whole(use(monitor, FAN))


# --- joint states


@pytest.mark.parametrize("id", [CHAIN, GRIPPER, BAXTER, TIAGO, FAN])
def test_listed_or_not(monitor, id):
    """The same numbers, Pinocchio's GᵀM G and so on; each robot replaces one with other mimic joints."""
    found = use(monitor, id)
    before, begin = monitor.next_report(), len(monitor.reports)
    for sample in range(3):
        whole = Whole(found, sample)
        for names in (whole.names, found.names):
            stamp = monitor.tick()
            whole.truth.check(monitor.feed(whole.message(stamp, names)), stamp)
    report = monitor.wait_for_report(lambda report: report.level == OK, "states", begin)
    assert not report.count("mimic disagreement")
    assert report.count("foreign") == before.count("foreign")
    mimics = found.oracle.coupling.mimics
    assert report.values["degrees of freedom"] == str(len(found.names))
    number, _, names = report.values["mimic joints"].partition(": ")
    assert int(number) == len(mimics)
    assert sorted(names.split(", ")) == sorted(mimics) if len(mimics) <= 8 else not names


def test_followers_of_another_publisher(monitor, fan):
    """A message with followers alone is no state, nor is it another robot's; its efforts are in the next state."""
    before = monitor.next_report()
    moved = Whole(fan.robot, 1, f2=3.0, g1=-2.0)
    stamp = monitor.tick()
    monitor.feeder.publish(moved.message(stamp, moved.followers))
    published = monitor.feed(moved.message(stamp, moved.robot.names))
    moved.truth.check(published, stamp)
    assert monitor.topics["state"].stamps == [stamp]
    # as old as the timeout allows, and older
    monitor.tick(500 * MS)
    moved.truth.check(monitor.feed(moved.message(monitor.now, moved.robot.names)), monitor.now)
    monitor.tick(1 * MS)
    alone = Whole(fan.robot, 1)
    alone.truth.check(monitor.feed(moved.message(monitor.now, moved.robot.names), ["state"]), monitor.now)
    report = monitor.wait_for_report(lambda report: report.count("received") >= before.count("received") + 4, "all")
    assert report.count("foreign") == before.count("foreign")
    assert report.count("incomplete") == before.count("incomplete")
    assert report.count("published") == before.count("published") + 3


@pytest.mark.parametrize("own", [{"f2": 2.0}, {"f2": -1.0, "f3": 4.0, "g1": 0.5}, {"f2": math.nan, "f3": 4.0}])
def test_efforts_are_reflected(monitor, fan, own):
    """The power is that of all efforts listed; one that is NaN is zero, and that of the leader stays."""
    whole = Whole(fan.robot, 2, **{name: effort for name, effort in own.items() if math.isfinite(effort)})
    message = whole.message(monitor.tick())
    for name, effort in own.items():
        message.effort[message.name.index(name)] = effort
    published = monitor.feed(message)
    whole.truth.check(published, monitor.now)
    state = published["state"]
    assert state.effort_valid
    assert_close(np.dot(state.effort, state.velocity), whole.effort @ whole.velocity, 1e-14)


def test_effort_of_the_leader_is_needed(monitor, fan):
    """Those of followers do not stand for it."""
    message = Whole(fan.robot, f2=2.0).message(monitor.tick())
    message.effort[message.name.index(LEADER)] = math.nan
    Truth(fan.robot, fan.q, fan.qd, None).check(monitor.feed(message), monitor.now)


@pytest.mark.parametrize("apart", [0.0101, -0.2])
def test_disagreement(monitor, fan, apart):
    """It is counted and named, states go on by the leader, and when they agree again all is well."""
    expected = 0.8 * fan.q[fan.robot.names.index(LEADER)]
    before = monitor.next_report().count("mimic disagreement")

    def astray(report):
        fan.truth.check(monitor.feed(fan.message(monitor.tick(), f2=expected + apart)), monitor.now)
        return report.level == WARN

    report = monitor.wait_for_report(astray, "the disagreement")
    assert report.count("mimic disagreement") > before
    assert not any(key.startswith("rejected") for key in report.values)
    for text in (FOLLOWER, LEADER, f"{expected + apart:.6g}"[:6], f"{expected:.6g}"[:6], "mimic_tolerance = 0.01"):
        assert text in report.values["last mimic disagreement"]
    for text in (FOLLOWER, LEADER, "mimic_tolerance = 0.01"):
        assert text in report.message

    def in_place(report):
        monitor.feed(fan.message(monitor.tick(), f2=expected + 0.0099))
        return report.level == OK

    assert monitor.wait_for_report(in_place, "agreement").message == "publishing"


def test_disagreement_between_messages(monitor, fan):
    """A follower on its own is compared with where its leader was, unless that is too long ago."""
    before, begin = monitor.next_report().count("mimic disagreement"), len(monitor.reports)
    for delay in (100 * MS, 600 * MS):
        monitor.feeder.publish(fan.message(monitor.now + delay, [FOLLOWER], f2=50.0))
    monitor.feeder.publish(fan.message(monitor.now + 100 * MS, [FOLLOWER]))
    monitor.feed(fan.message(monitor.tick()))
    report = monitor.wait_for_report(
        lambda report: report.count("mimic disagreement") > before, "the disagreement", begin
    )
    assert report.count("mimic disagreement") == before + 1
    assert report.level == WARN
    assert "'f2' is 50," in report.values["last mimic disagreement"]
    assert "'f2' is …," in report.message


def test_tolerance_at_run_time(monitor, fan):
    """A larger one, and none; services go by it as well."""
    before = monitor.next_report().count("mimic disagreement")
    message = fan.message(f2=fan.position[fan.names.index(FOLLOWER)] + 0.5)
    stamp = message.header.stamp
    try:
        for allowed, good in ((0.6, True), (0.4, False), (0.0, True)):
            monitor.set_parameter("mimic_tolerance", allowed)
            assert monitor.call(Diagonalize, "diagonalize", Diagonalize.Request(state=message)).success == good
            stamp.sec, stamp.nanosec = divmod(monitor.tick(), S)
            fan.truth.check(monitor.feed(message), monitor.now)
    finally:
        monitor.set_parameter("mimic_tolerance", 0.01)
    assert monitor.next_report().count("mimic disagreement") == before + 1


def test_follower_without_position(monitor, fan):
    """NaN is not compared, nor is what is not listed; velocities of followers do not matter."""
    before, begin = monitor.next_report().count("mimic disagreement"), len(monitor.reports)
    message = fan.message(monitor.tick(), f2=math.nan, f3=math.nan)
    for name, velocity in ((FOLLOWER, math.nan), ("g1", 1e3)):
        message.velocity[message.name.index(name)] = velocity
    fan.truth.check(monitor.feed(message), monitor.now)
    fan.truth.check(monitor.feed(fan.message(monitor.tick(), (*fan.robot.names, "g1"))), monitor.now)
    report = monitor.wait_for_report(lambda report: report.level == OK, "states", begin)
    assert report.count("mimic disagreement") == before


def test_leader_that_never_arrives(monitor, fan):
    """It is missed, although its followers come."""
    monitor.tick(-500 * S)  # time starts anew
    names = [name for name in fan.names if name != LEADER]

    def missing(report):
        monitor.feeder.publish(fan.message(monitor.tick(10 * MS), names))
        return report.message == f"joints that never arrived: {LEADER}"

    assert monitor.wait_for_report(missing, LEADER).level == WARN
    monitor.tick(1000 * S)


def test_gravity_and_payload(monitor, fan):
    """On a link that a follower moves; both while running, and the followers stay who they are."""
    load = (2.0, (0.0, 0.1, 0.2), np.diag([0.01, 0.02, 0.025]))
    inertia = Inertia(m=load[0], ixx=0.01, iyy=0.02, izz=0.025)
    inertia.com.y, inertia.com.z = load[1][1:]
    response = monitor.call(SetPayload, "set_payload", SetPayload.Request(link="f2_link", inertia=inertia))
    assert response.success, response.message
    gravity = (1.0, -2.0, 3.0)
    try:
        monitor.set_parameter("gravity", list(gravity))
        published = monitor.feed(Whole(fan.robot, f2=2.0).message(monitor.tick()))
    finally:
        monitor.set_parameter("gravity", [0.0, 0.0, -9.81])
        monitor.robot = None  # a description takes payloads off, though not the one in force
        monitor.call(SetPayload, "set_payload", SetPayload.Request(link="f2_link", inertia=Inertia()))
    loaded = Coupled(fan.robot.urdf, gravity=gravity, payloads={"f2_link": load})
    state = loaded.at(fan.q, fan.qd, loaded.G.T @ Whole(fan.robot, f2=2.0).effort)
    for name in ("nu", "epsilon", "gravity"):
        assert_close(np.array(getattr(published["state"], name)), getattr(state, name), 1e-11)
    assert_close(np.array(published["state"].coriolis), state.coriolis, 1e-11, state.coriolis_scale)


# --- services


SERVICES = {
    "forward_dynamics": ForwardDynamics,
    "inverse_dynamics": InverseDynamics,
    "diagonalize": Diagonalize,
}


def ask(monitor, service, state, **fields):
    return monitor.call(SERVICES[service], service, SERVICES[service].Request(state=state, **fields))


def answer(monitor, service, state, **fields):
    response = ask(monitor, service, state, **fields)
    assert response.success, response.message
    return response


@pytest.mark.parametrize("id", [GRIPPER, FAN])
def test_services(monitor, id):
    """Followers may be listed: their efforts are reflected, their velocities and accelerations not looked at."""
    found = use(monitor, id)
    for listed in (True, False):
        own = {name: 1.0 + k for k, name in enumerate(found.oracle.coupling.mimics)} if listed else {}
        whole = Whole(found, 1, **own)
        state, truth = whole.message(0, whole.names if listed else found.names), whole.truth
        published = answer(monitor, "diagonalize", state)
        truth.check_state(published.state)
        truth.check_joint_space_dynamics(published.joint_space_dynamics)
        truth.check_mass_matrix_factors(published.factors, with_inverse=True)
        for name in own:
            state.velocity[state.name.index(name)] = 1e3
        response = answer(monitor, "forward_dynamics", state)
        assert tuple(response.dof_names) == found.names
        assert_close(response.acceleration * truth.unit, truth.state.acceleration * truth.unit, truth.tolerance)
        acceleration = dict(zip(found.names, whole.qdd.tolist(), strict=True))
        acceleration = [acceleration.get(name, -1e3) for name in state.name]
        response = answer(monitor, "inverse_dynamics", state, acceleration=acceleration)
        expected = found.oracle.inverse_dynamics(whole.q, whole.qd, whole.qdd)
        assert_close(response.effort / truth.unit, expected / truth.unit, truth.tolerance)


@pytest.mark.parametrize("service", SERVICES)
def test_bad_followers_in_requests(monitor, fan, service):
    """What is wrong is named, with its value and the one expected."""

    def refused(state, *named):
        response = ask(monitor, service, state)
        assert not response.success
        for text in named:
            assert text in response.message

    expected = 0.8 * fan.q[fan.robot.names.index(LEADER)]
    refused(fan.message(f2=7.25), "state.position", "'f2' is 7.25,", f"expected {expected:.5g}"[:14], "'f1'", "0.01")
    refused(fan.message(names=[FOLLOWER]), "'f1' is missing", "'f2'")
    refused(fan.message(names=[name for name in fan.names if name != LEADER]), "'f1' is missing", "follow")
    refused(fan.message(names=[*fan.names, FOLLOWER]), "'f2' is listed twice")
    message = fan.message()
    message.effort.pop()
    refused(message, "state.effort has 4 entries for 5 names")


def test_unknown_values_of_followers_in_requests(monitor, fan):
    """NaN is neither compared nor an effort."""
    message = fan.message(f2=math.nan, g1=math.nan)
    message.effort[message.name.index("f3")] = math.nan
    fan.truth.check_state(answer(monitor, "diagonalize", message).state)


def test_floating_base(peer):
    """The base's rates come first, and followers go on following."""
    found = robot(BAXTER)
    whole = Whole(found, 1, **dict.fromkeys(found.oracle.coupling.mimics, 3.0))
    pose, twist = Pose(), Twist()
    pose.position.z, pose.orientation.x, pose.orientation.w = 0.5, 0.6, 0.8
    twist.linear.y, twist.angular.x = 0.3, -0.2
    floating = Coupled(found.urdf, floating_base=True)
    base, rates = [0.0, 0.0, 0.5, 0.6, 0.0, 0.0, 0.8], [0.0, 0.3, 0.0, -0.2, 0.0, 0.0]
    truth = floating.at(np.r_[base, whole.q], np.r_[rates, whole.qd], np.r_[np.zeros(6), whole.truth.state.tau])
    with Monitor(peer, "/floating", robot_description=found.path, floating_base=True) as monitor:
        response = answer(monitor, "diagonalize", whole.message(), base_pose=pose, base_twist=twist)
        state = response.state
        assert tuple(state.dof_names[6:]) == found.names
        for name in ("nu", "epsilon", "gravity"):
            assert_close(np.array(getattr(state, name)), getattr(truth, name), tolerance(truth))
        assert_close(np.array(state.coriolis), truth.coriolis, tolerance(truth), truth.coriolis_scale)
        response = answer(monitor, "forward_dynamics", whole.message(), base_pose=pose, base_twist=twist)
        unit = np.sqrt(np.diag(truth.M))
        assert_close(np.array(response.acceleration) * unit, truth.acceleration * unit, tolerance(truth))


# --- robots that are no robots, and other ways to take mimic joints


def test_circle_is_refused_by_name(monitor, fan):
    """Joints that follow each other are named, and the robot of before stays in force."""
    before, leader, after = fan.robot.urdf.partition('<joint name="f1"')
    circle = before + leader + after.replace("</joint>", '<mimic joint="f2"/></joint>', 1)
    try:
        monitor.descriptions.publish(description(circle))
        report = monitor.wait_for_report(lambda report: report.level == ERROR, "the refusal")
        assert "'f1' mimics itself" in report.message
        assert FOLLOWER in report.message
        assert report.values["robot"] == fan.robot.oracle.xml.get("name")
        fan.truth.check(monitor.feed(fan.message(monitor.tick())), monitor.now)
    finally:
        monitor.descriptions.publish(description(fan.robot.urdf))
        monitor.wait_for_report(lambda report: report.level != ERROR, "the robot of before")


def test_free_and_locked(peer):
    """`free` has a degree of freedom for each joint; `lock` none for those that follow, and names them."""
    free = robot(PANDA, free=True)
    q, qd, tau, _ = free.samples[1]
    with (
        Monitor(peer, "/free", robot_description=free.path, mimic="free") as monitor,
        Monitor(peer, "/locked", robot_description=free.path, mimic="lock") as locked,
    ):
        monitor.connect(free)
        stamp = monitor.tick()
        Truth(free, q, qd, tau).check(monitor.feed(free.message(stamp, free.samples[1])), stamp)
        values = monitor.next_report().values
        assert (values["mimic joints"], values["locked joints"]) == ("0", "0")
        values = locked.next_report().values
        assert (values["mimic joints"], values["locked joints"]) == ("0", "1: panda_finger_joint2")
        assert values["degrees of freedom"] == "8"


# --- the simulator


def test_monitor_of_a_simulator(peer, tmp_path):
    """The followers come after the independent joints, where these put them, and the monitor has nothing against it."""
    found = robot(FAN)
    path = tmp_path / "fan.urdf"
    path.write_text(NAMED[FAN].urdf)
    states = peer.topic(JointState, "/simulated/joint_states")
    arguments = ("-r", "__ns:=/simulated")
    with (
        node_process("simulator", *arguments, robot_description=path, motion="wave", rate=100.0),
        Monitor(peer, "/simulated") as monitor,
    ):
        topics = monitor.topics
        # Which of the two subscriptions to joint_states is there first, nobody knows.
        peer.wait_until(lambda: len({*states.stamps} & {*topics["state"].stamps}) >= 150, "states", START)
        compared = 0
        for stamp in topics["state"].stamps:
            message = states.at(stamp)
            if message is None:
                continue
            count = len(found.names)
            names = list(message.name)
            assert tuple(names[:count]) == found.names
            q, qd, tau = (np.array(x[:count]) for x in (message.position, message.velocity, message.effort))
            at = [names.index(name) for name in found.oracle.full.dof_names]
            assert_close(np.array(message.position)[at], found.oracle.q_full(q), 1e-14)
            assert_close(np.array(message.velocity)[at], found.oracle.G @ qd, 1e-14, max(np.linalg.norm(qd), 1e-300))
            assert not any(message.effort[count:])
            if compared % 10 == 0:
                truth = Truth(found, q, qd, tau)
                truth.check({name: topic.at(stamp) for name, topic in topics.items() if topic.at(stamp)}, stamp)
            compared += 1
        assert compared >= 150
        report = monitor.wait_for_report(lambda report: report.level == OK, "states")
        assert not report.count("mimic disagreement")
        assert report.values["mimic joints"] == "3: f2, f3, g1"
