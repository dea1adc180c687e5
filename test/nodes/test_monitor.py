# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor as a process on a real graph: what it publishes is Pinocchio's, whatever comes in and in which shape."""

import itertools
import math
import signal

import numpy as np
import pytest
from diag_dynamics.srv import Diagonalize
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

import robots
from diag_dynamics.nodes.support.diagnostics import steady
from nodes import (
    LATCHED,
    MS,
    OUTPUTS,
    PANDA,
    START,
    TALOS,
    UR5,
    Monitor,
    S,
    Truth,
    description,
    joint_state,
    nanoseconds,
    robot,
)

GRIPPER = ("panda_finger_joint1",)  # the other finger follows
OK, WARN, ERROR, STALE = b"\x00", b"\x01", b"\x02", b"\x03"


@pytest.fixture(scope="module")
def running(peer):
    """Start a monitor of the Panda: one for the whole file, as each test leaves it able to go on."""
    panda = robot(PANDA)
    with Monitor(peer, "/panda", robot_description=panda.path) as monitor:
        yield monitor.connect(panda)


@pytest.fixture
def monitor(running):
    """Return the monitor of the Panda, with all joints fresh and nothing received."""
    panda = robot(PANDA)
    running.feed(panda.message(running.tick(), panda.samples[0]))
    running.forget()
    yield running
    assert running.alive()


@pytest.fixture
def panda():
    """Return the robot of the running monitor."""
    return robot(PANDA)


def good(monitor, panda, sample=0):
    """Feed a whole state and check all that comes of it."""
    q, qd, tau, _ = panda.samples[sample]
    stamp = monitor.tick()
    published = monitor.feed(panda.message(stamp, panda.samples[sample]))
    Truth(panda, q, qd, tau).check(published, stamp)
    return published


# --- every topic, against Pinocchio


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


def test_at_rest(monitor, panda):
    """Rates of exactly zero give energies and a Coriolis term of exactly zero, and gravity as ever."""
    q, _, tau, _ = panda.samples[1]
    rest = np.zeros(len(q))
    stamp = monitor.tick()
    published = monitor.feed(panda.message(stamp, (q, rest, tau)))
    state, energy, coriolis = (published[topic] for topic in ("state", "kinetic_energy", "coriolis"))
    truth = Truth(panda, q, rest, tau)
    truth.check_gravity(state.gravity)
    truth.check_joint_space_dynamics(published["joint_space_dynamics"])
    assert energy.total == energy.power == state.kinetic_energy == state.power == 0.0
    assert not any(energy.energy_share) and not any(energy.link_energy)
    assert not any(coriolis.coriolis) and not any(coriolis.coriolis_unnormalized)


def test_arm_and_gripper_apart(monitor, panda):
    """Two publishers, each with joints of its own: every message brings a state of the newest values of all."""
    arm = [name for name in panda.shuffled if name not in GRIPPER]
    (q0, qd0, tau0, _), (q1, qd1, tau1, _) = panda.samples[0], panda.samples[1]
    moved = np.isin(panda.names, arm)
    before = monitor.now

    at_arm = monitor.tick(100 * MS)
    published = monitor.feed(panda.message(at_arm, panda.samples[1], arm))
    mixed = (np.where(moved, new, old) for new, old in ((q1, q0), (qd1, qd0), (tau1, tau0)))
    Truth(panda, *mixed).check(published, at_arm)
    assert nanoseconds(published["state"].oldest_stamp) == before

    at_gripper = monitor.tick(100 * MS)
    published = monitor.feed(panda.message(at_gripper, panda.samples[1], GRIPPER))
    Truth(panda, q1, qd1, tau1).check(published, at_gripper)
    assert nanoseconds(published["state"].oldest_stamp) == at_arm


def test_gripper_behind_arm(monitor, panda):
    """A message may be older than another publisher's: the stamp stays the newest one, the oldest moves on."""
    arm = [name for name in panda.names if name not in GRIPPER]
    at_arm = monitor.tick(100 * MS)
    monitor.feed(panda.message(at_arm, panda.samples[1], arm))
    monitor.forget()
    at_gripper = at_arm - 30 * MS
    monitor.feeder.publish(panda.message(at_gripper, panda.samples[1], GRIPPER))
    state = monitor.peer.wait_until(lambda: monitor.topics["state"].at(at_arm), "the state with both")
    assert nanoseconds(state.oldest_stamp) == at_gripper
    Truth(panda, *panda.samples[1][:3]).check({"state": state}, at_arm)


@pytest.mark.parametrize("missing", ["empty", "nan", "one nan"])
def test_without_effort(monitor, panda, missing):
    """What needs efforts is flagged and left empty; all else is there."""
    q, qd, tau, _ = panda.samples[2]
    effort = {"empty": [], "nan": [math.nan] * len(tau), "one nan": [*tau[:-1], math.nan]}[missing]
    stamp = monitor.tick()
    published = monitor.feed(joint_state(panda.names, q, qd, effort, stamp))
    Truth(panda, q, qd, None).check(published, stamp)
    good(monitor, panda)


# --- what is not good enough


def unusable(panda):
    """Return a message, the cause it is counted under, and what its rejection names, by a short name.

    The messages follow a good one after 100 ms.
    """
    q, qd, tau, _ = panda.samples[0]
    names, joint = list(panda.names), panda.names[3]

    def with_value(values, value):
        return [value if name == joint else x for name, x in zip(names, values, strict=True)]

    arm = [name for name in names if name not in GRIPPER]
    at = [names.index(name) for name in arm]
    return {
        "no velocity": ((names, q, [], tau), 100 * MS, "no velocity", names[0]),
        "one velocity is NaN": ((names, q, with_value(qd, math.nan), tau), 100 * MS, "no velocity", joint),
        "one velocity is infinite": ((names, q, with_value(qd, math.inf), tau), 100 * MS, "no velocity", joint),
        "no position": ((names, [], qd, tau), 100 * MS, "no position", names[0]),
        "one position is NaN": ((names, with_value(q, math.nan), qd, tau), 100 * MS, "no position", joint),
        "one position is infinite": ((names, with_value(q, -math.inf), qd, tau), 100 * MS, "no position", joint),
        "position too short": ((names, q[:-2], qd, tau), 100 * MS, "wrong length", names[-2]),
        "velocity too short": ((names, q, qd[:1], tau), 100 * MS, "wrong length", names[1]),
        "effort too long": ((names, q, qd, [*tau, 0.0]), 100 * MS, "wrong length", "effort"),
        "joint twice": (([*names, joint], [*q, 0], [*qd, 0], [*tau, 0]), 100 * MS, "duplicate name", joint),
        "late": ((names, q, qd, tau), -100 * MS, "late", "0.1"),
        "gripper stale": ((arm, q[at], qd[at], tau[at]), 600 * MS, "stale joint", GRIPPER[0]),
        "velocity overflows": ((names, q, with_value(qd, 1e200), tau), 100 * MS, "", ""),
        "position overflows": ((names, with_value(q, 1e308), with_value(qd, 1e308), tau), 100 * MS, "", ""),
    }


@pytest.mark.parametrize("case", unusable(robot(PANDA)))
def test_unusable_message(monitor, panda, case):
    """Nothing is published for it; it is counted and named on /diagnostics; the next good one is served."""
    values, delay, cause, named = unusable(panda)[case]
    before = monitor.reports[-1] if monitor.reports else monitor.next_report()
    begin = len(monitor.reports)
    good(monitor, panda)
    first = monitor.now
    monitor.feeder.publish(joint_state(*values, stamp=first + delay))
    good(monitor, panda, sample=1)
    for topic in monitor.topics.values():
        assert topic.stamps == [first, monitor.now]

    report = monitor.wait_for_report(lambda report: rejections(report) > rejections(before), "a rejection", begin)
    assert rejections(report) == rejections(before) + 1
    assert report.level == WARN
    assert named in report.values["last rejection"]
    assert steady(report.values["last rejection"]) in report.message
    if cause:
        assert report.count(f"rejected: {cause}") == before.count(f"rejected: {cause}") + 1
    assert "rejected: internal error" not in report.values


def rejections(report):
    """Return how many messages have been rejected, for whatever reason."""
    return sum(report.count(key) for key in report.values if key.startswith("rejected: "))


def test_time_jumps_back(monitor, panda):
    """A recording starts over: all joints are forgotten, and none of before is mixed with those of now.

    A single stamp of long ago may be a mistake, so it takes a second one to be believed.
    """
    before = monitor.next_report()
    arm = [name for name in panda.names if name not in GRIPPER]
    good(monitor, panda)
    monitor.forget()
    last = monitor.now
    monitor.tick(-500 * S)
    monitor.feeder.publish(panda.message(monitor.now, panda.samples[2]))
    monitor.feeder.publish(panda.message(monitor.tick(MS), panda.samples[1], arm))
    stamp = monitor.tick(100 * MS)
    published = monitor.feed(panda.message(stamp, panda.samples[1], GRIPPER))
    Truth(panda, *panda.samples[1][:3]).check(published, stamp)
    assert nanoseconds(published["state"].oldest_stamp) == stamp - 100 * MS
    assert monitor.topics["state"].stamps == [stamp]
    monitor.now = last  # and a jump forward is nothing special
    good(monitor, panda)
    report = monitor.next_report()
    for key in ("time jumped back", "rejected: stamp from the past", "incomplete"):
        assert report.count(key) == before.count(key) + 1


def test_without_stamp(monitor, panda):
    """A stamp of zero: the time of reception stands for it, and the state says so."""
    q, qd, tau, _ = panda.samples[1]
    earliest = monitor.peer.now()
    monitor.feeder.publish(joint_state(panda.names, q, qd, tau, 0))
    monitor.peer.wait_until(lambda: all(topic.stamps for topic in monitor.topics.values()), "the state")
    stamp = monitor.topics["state"].stamps[0]
    assert earliest <= stamp <= monitor.peer.now()
    state = monitor.topics["state"].at(stamp)
    assert state.stamp_is_receive_time
    assert nanoseconds(state.oldest_stamp) == stamp
    Truth(panda, q, qd, tau).check({topic: messages.at(stamp) for topic, messages in monitor.topics.items()}, stamp)
    published = good(monitor, panda)
    assert not published["state"].stamp_is_receive_time


def test_report_when_all_is_well(monitor, panda):
    """The entry on /diagnostics: OK while states come, with the model in force, then STALE."""
    begin = len(monitor.reports)
    good(monitor, panda)
    values = monitor.wait_for_report(lambda report: report.level == OK, "states", begin).values
    assert values["robot"] == "panda"
    assert values["degrees of freedom"] == "8"
    assert values["mimic joints"] == "1: panda_finger_joint2"
    assert values["locked joints"] == "0"
    assert float(values["total mass [kg]"]) == pytest.approx(
        sum(float(mass.get("value")) for mass in panda.oracle.xml.findall("link/inertial/mass")), rel=1e-5
    )
    report = monitor.wait_for_report(lambda report: report.level != OK, "silence")
    assert (report.level, report.message) == (STALE, "no joint states")


def test_names_of_another_robot_are_told(monitor, panda):
    """A driver whose prefix was changed sends as ever: the entry says which joints come, and not that none do."""
    good(monitor, panda)
    q, qd, tau, _ = panda.samples[1]

    def told(report):
        monitor.feeder.publish(joint_state([f"left_{name}" for name in panda.names], q, qd, tau, monitor.peer.now()))
        return report.level == STALE and "messages are of other joints, as 'left_panda_joint1'" in report.message

    monitor.wait_for_report(told, "names")


# --- parameters at run time


def series(monitor, panda, count, step):
    """Feed states at stamps `step` apart, one after the other, and return the first stamp."""
    first = monitor.tick()
    for k in range(count):
        stamp = first if k == 0 else monitor.tick(step)
        monitor.feed(panda.message(stamp, panda.samples[k % 3]), ["kinetic_energy"])
    # Of each topic the last one arrives last; it is not part of the series.
    end = monitor.tick()
    monitor.feed(panda.message(end, panda.samples[0]))
    return first, end


@pytest.mark.parametrize(("rate", "stride"), [(None, 20), (100.0, 10), (0.0, 1), (400.0, 2.5)])
@pytest.mark.parametrize("topic", ["mass_matrix_factors", "joint_space_dynamics", "state"])
def test_rate_limit(monitor, panda, topic, rate, stride):
    """States at 1 kHz by their stamps: the topic has its highest rate, others have all of them.

    The limit lets a state through that is up to a twentieth of the period early, and that alone.
    """
    default = 0.0 if topic == "state" else 50.0
    if rate is not None:
        monitor.set_parameter(f"max_rate.{topic}", rate)
    elif topic == "state":
        stride = 1
    count = 200
    try:
        first, end = series(monitor, panda, count, MS)
    finally:
        monitor.set_parameter(f"max_rate.{topic}", default)
    stamps = monitor.topics[topic].stamps
    assert stamps[0] == first
    assert stamps[-1] == end
    gaps = np.diff(stamps[:-1]) / MS
    assert all(gaps >= 0.95 * math.floor(stride))
    assert all(gaps <= math.ceil(stride))
    assert abs(len(stamps) - 1 - count / stride) <= 1 + 0.05 * count / stride
    assert len(monitor.topics["kinetic_energy"].stamps) == len(monitor.topics["coriolis"].stamps) == count + 1


def test_inverse_factor_on_demand(monitor, panda):
    """The inverse l is published when the parameter says so, from one state to the next."""
    q, qd, tau, _ = panda.samples[1]
    truth = Truth(panda, q, qd, tau)
    monitor.set_parameter("publish_inverse_factor", True)
    try:
        message = monitor.feed(panda.message(monitor.tick(), panda.samples[1]))["mass_matrix_factors"]
        truth.check_mass_matrix_factors(message, with_inverse=True)
    finally:
        monitor.set_parameter("publish_inverse_factor", False)
    good(monitor, panda)


def test_gravity_at_run_time(monitor, panda):
    """Another gravity holds from the next state on, in every topic."""
    q, qd, tau, _ = panda.samples[2]
    for gravity in ([1.0, -2.0, 3.0], [0.0, 0.0, 0.0]):
        monitor.set_parameter("gravity", gravity)
        try:
            stamp = monitor.tick()
            published = monitor.feed(panda.message(stamp, panda.samples[2]))
        finally:
            monitor.set_parameter("gravity", [0.0, 0.0, -9.81])
        truth = Truth(panda, q, qd, tau, gravity=tuple(gravity))
        if any(gravity):
            truth.check(published, stamp)
        else:
            assert not any(published["state"].gravity) and not any(published["coriolis"].gravity)
            assert not any(published["joint_space_dynamics"].gravity)
            truth.check_power(published["kinetic_energy"].power)
    good(monitor, panda)


def test_joint_timeout_at_run_time(monitor, panda):
    """Without a limit of age, a gripper that spoke long ago still counts."""
    arm = [name for name in panda.names if name not in GRIPPER]
    before = monitor.now
    monitor.set_parameter("joint_timeout", 0.0)
    try:
        state = monitor.feed(panda.message(monitor.tick(3600 * S), panda.samples[0], arm))["state"]
    finally:
        monitor.set_parameter("joint_timeout", 0.5)
    assert nanoseconds(state.oldest_stamp) == before
    good(monitor, panda)


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("gravity", [0.0, -9.81], "gravity"),
        ("gravity", [0.0, 0.0, math.nan], "gravity"),
        ("gravity", [0.0, 0.0, math.inf], "gravity"),
        ("gravity", -9.81, "Wrong parameter type"),
        ("max_rate.state", -1.0, "max_rate.state"),
        ("max_rate.state", math.nan, "max_rate.state"),
        ("max_rate.mass_matrix_factors", "fast", "Wrong parameter type"),
        ("joint_timeout", -0.5, "joint_timeout"),
        ("joint_timeout", math.nan, "joint_timeout"),
        ("mimic_tolerance", -0.01, "mimic_tolerance"),
        ("mimic_tolerance", math.nan, "mimic_tolerance"),
        ("publish_inverse_factor", "yes", "Wrong parameter type"),
        ("mimic", "lock", "read-only while the node is configured"),
        ("autostart", False, "read-only"),
        ("robot_description", "<robot/>", "robot"),
        ("robot_description", "", "cannot become empty"),
    ],
)
def test_parameter_refused(monitor, panda, name, value, reason):
    """A wrong value is refused with a reason, and changes nothing."""
    result = monitor.peer.set_parameter(monitor.name, name, value)
    assert not result.successful
    assert reason in result.reason
    good(monitor, panda)


# --- the description by topic


@pytest.fixture(scope="module")
def by_topic(peer):
    """Start a monitor that gets its robot by topic, after the description was published; all names are remapped."""
    peer.descriptions = peer.publisher(String, "/elsewhere/description", LATCHED)
    peer.descriptions.publish(description(robot(UR5).urdf))
    names = ("__node:=dyn", "robot_description:=/elsewhere/description", "joint_states:=arm/states")
    remapped = [argument for name in names for argument in ("-r", name)]
    with Monitor(peer, "/topic", *remapped, joint_states="arm/states", name="dyn") as monitor:
        yield monitor.connect(robot(UR5))
        monitor.process.stop(signal.SIGTERM)


def describe(monitor, robot):
    """Publish a robot's description and wait until it is in force, even if it has been so already."""
    monitor.peer.descriptions.publish(description(robot.urdf))

    def accepted():
        monitor.feeder.publish(robot.message(monitor.tick(), robot.samples[0]))
        message = monitor.topics["state"].messages[-1:]
        return message and tuple(message[0].dof_names) == robot.names

    monitor.peer.wait_until(accepted, f"the robot of {robot.id}", START)
    good(monitor, robot)  # nothing is under way any more
    monitor.forget()


def test_late_joiner(by_topic):
    """The description was published before the node was there."""
    describe(by_topic, robot(UR5))
    assert by_topic.process.output.index("Ready: robot 'ur5'") > by_topic.process.output.index("/elsewhere/description")
    for k in range(3):
        good(by_topic, robot(UR5), k)


def test_another_robot(by_topic):
    """A later description replaces the robot; states of the old one no longer count."""
    ur5, talos = robot(UR5), robot(TALOS)
    describe(by_topic, ur5)
    good(by_topic, ur5)
    describe(by_topic, talos)
    for k in range(3):
        good(by_topic, talos, k)
    by_topic.forget()
    by_topic.feeder.publish(ur5.message(by_topic.tick(), ur5.samples[0]))
    good(by_topic, talos)
    assert by_topic.topics["state"].stamps == [by_topic.now]


def test_joints_that_never_arrive(by_topic):
    """They are named on /diagnostics, and nothing is published meanwhile."""
    talos, ur5 = robot(TALOS), robot(UR5)
    describe(by_topic, talos)
    describe(by_topic, ur5)
    describe(by_topic, talos)  # the joints of this robot are all unknown again, but for those of one message
    by_topic.peer.descriptions.publish(description(ur5.urdf))
    some = ur5.names[:4]

    def missing(report):
        by_topic.feeder.publish(ur5.message(by_topic.tick(10 * MS), ur5.samples[0], some))
        return report.message == f"joints that never arrived: {', '.join(ur5.names[4:])}"

    report = by_topic.wait_for_report(missing, "joints that never arrived")
    assert report.level == WARN
    assert report.values["missing joints"] == f"2: {', '.join(ur5.names[4:])}"
    assert not by_topic.topics["state"].messages
    good(by_topic, ur5)


REFUSED = {
    "malformed": ("<robot name='broken'><link name='a'/>", "not well-formed"),
    "empty": ("", "empty"),
    "singular": (robots.robot("romeo_description/urdf/romeo_laas_small.urdf").urdf, "l_gripper_joint"),
    "a path": (str(robot(UR5).path), "refused"),  # a topic does not make the node open files
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_description(by_topic, case):
    """The old robot stays in force, and /diagnostics says what is wrong, until a valid description arrives."""
    text, reason = REFUSED[case]
    talos = robot(TALOS)
    describe(by_topic, talos)
    by_topic.peer.descriptions.publish(description(text))
    report = by_topic.wait_for_report(lambda report: report.level == ERROR and reason in report.message, reason)
    assert report.message.startswith("robot_description refused")
    assert report.values["robot"] == "talos"
    good(by_topic, talos)


@pytest.mark.parametrize("id", [TALOS, UR5], ids=["the same", "another"])
def test_refusal_is_over(by_topic, id):
    """After a valid description, be it the one in force, nothing is wrong any more."""
    describe(by_topic, robot(TALOS))
    by_topic.peer.descriptions.publish(description("<robot"))
    by_topic.wait_for_report(lambda report: report.level == ERROR, "the refusal")
    describe(by_topic, robot(id))
    before, begin = by_topic.next_report(), len(by_topic.reports)
    good(by_topic, robot(id))
    report = by_topic.wait_for_report(lambda r: r.count("published") > before.count("published"), "a state", begin)
    assert (report.level, report.message) == (OK, "publishing")


def test_motionless_robot(by_topic):
    """A robot without a moving joint does not end the node."""
    talos = robot(TALOS)
    describe(by_topic, talos)
    iris = robots.robot("iris_description/robots/iris_simple.urdf").urdf
    by_topic.peer.descriptions.publish(description(iris))
    by_topic.peer.wait_until(
        lambda: by_topic.next_report().values["robot"] == "iris", "the motionless robot to be in force", START
    )
    by_topic.feeder.publish(talos.message(by_topic.tick(), talos.samples[0]))
    by_topic.feeder.publish(joint_state(stamp=by_topic.tick()))
    response = by_topic.call(Diagonalize, "diagonalize", Diagonalize.Request())
    assert response.success, response.message
    assert response.state.kinetic_energy == 0.0
    assert len(response.state.nu) == response.factors.nv == 0
    describe(by_topic, talos)
    good(by_topic, talos)


def test_circular_mimics_are_refused_by_name(peer):
    """Joints that follow each other are named; the node lives, and a Ctrl-C ends it, without a robot as with one.

    Under a launcher, a Ctrl-C comes as two signals.
    """
    panda = robot(PANDA)
    begin, leader, end = panda.urdf.partition('<joint name="panda_finger_joint1"')
    circle = begin + leader + end.replace("</joint>", '<mimic joint="panda_finger_joint2"/></joint>', 1)
    descriptions = peer.publisher(String, "/circle/robot_description", LATCHED)
    descriptions.publish(description(circle))
    with Monitor(peer, "/circle") as monitor:
        report = monitor.wait_for_report(lambda report: report.level == ERROR, "the refusal")
        assert "'panda_finger_joint1' mimics itself" in report.message
        assert "panda_finger_joint2" in report.message
        peer.wait_until(monitor.feeder.get_subscription_count, "the subscription to joint_states")

        def counted(report):
            monitor.feeder.publish(panda.message(monitor.tick(), panda.samples[0]))
            return report.count("before the model")

        monitor.wait_for_report(counted, "a state without a model")
        assert not monitor.topics["state"].messages
        monitor.process.stop(signal.SIGINT, signal.SIGINT)


def test_simulated_time(peer):
    """With use_sim_time, the time of reception is that of /clock, be it long ago and standing still."""
    ur5 = robot(UR5)
    clock = peer.publisher(Clock, "/clock")
    with Monitor(peer, "/sim", robot_description=ur5.path, use_sim_time=True) as monitor:
        monitor.connect(ur5)
        peer.wait_until(clock.get_subscription_count, "the subscription to /clock")
        monitor.process.wait_for_text("Joint states come, but no time on /clock (use_sim_time)")
        monitor.forget()
        q, qd, tau, _ = ur5.samples[0]

        def unstamped():
            monitor.feeder.publish(joint_state(ur5.names, q, qd, tau, 0))
            have = len(monitor.topics["state"].messages)
            peer.wait_until(lambda: len(monitor.topics["state"].messages) > have, "a state")
            return monitor.topics["state"].messages[-1]

        for now in (5 * S, 7 * S + 1, 3 * S):
            message = Clock()
            message.clock.sec, message.clock.nanosec = divmod(now, S)
            for attempt in itertools.count():  # the two topics are not in step with each other
                clock.publish(message)
                state = unstamped()
                if nanoseconds(state.header.stamp) == now:
                    break
                assert attempt < 100
            assert state.stamp_is_receive_time
            Truth(ur5, q, qd, tau).check_state(state)
        # stamped states have their own time
        good(monitor, ur5)
