# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults injected into a monitor: each is counted and named, nothing is published of it, and the next state is right."""

import math
from collections import Counter
from collections.abc import Callable
from contextlib import nullcontext
from typing import NamedTuple

import numpy as np
import pytest
from diag_dynamics.msg import DiagonalizedState
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import String

import robots
from diag_dynamics.nodes.support.diagnostics import ERROR, OK, WARN, steady
from floating import FloatingMonitor
from joint_state_cases import COUNTERS, WIRING
from joint_state_messages import BASE_PARAMETERS, FLOATING, ROBOTS
from nodes import LATCHED, MAX_AGE, MS, PANDA, UR5, Monitor, Reports, S, description, joint_state, robot

FINGER, MIMIC_FINGER, JOINT, HAND = "panda_finger_joint1", "panda_finger_joint2", "panda_joint4", "panda_hand"
INPUTS = {"joint_states": JointState, "odom": Odometry}
COUNTED = set(COUNTERS) | {"received", "odometry received"}
ARM = tuple(name for name in robot(PANDA).names if name != FINGER)


@pytest.fixture(scope="module")
def running(peer):
    """Start a monitor whose stamps are the test's own."""
    with Monitor(peer, "/faults", robot_description=robot(PANDA).path) as monitor:
        yield monitor.connect(robot(PANDA))


@pytest.fixture(scope="module")
def clocked(peer):
    """Start a monitor that compares stamps with its clock."""
    with Monitor(peer, "/clocked", live=True, robot_description=robot(PANDA).path) as monitor:
        yield monitor.connect(robot(PANDA))


def published(monitor):
    """Return whether anything has been published since the last `forget`."""
    return any(topic.messages for topic in monitor.topics.values())


# --- every counter


@pytest.mark.parametrize("counter", WIRING)
def test_counters(peer, tmp_path, counter):
    """The node counts what the decision table says, publishes its states, and reports the last rejection."""
    case = WIRING[counter]
    path, namespace = tmp_path / "robot.urdf", "/wiring"
    path.write_text(ROBOTS[case.robot])
    states = peer.topic(DiagonalizedState, f"{namespace}/diag_dynamics/state")
    publishers = [peer.publisher(kind, f"{namespace}/{name}") for name, kind in INPUTS.items()]
    reports = Reports(peer.node, peer.wait_until, f"{namespace}/diag_dynamics")
    parameters = BASE_PARAMETERS | case.parameters | {"floating_base": case.robot in FLOATING}
    before, expected = peer.graph.system, Counter()
    with peer.start("monitor", "-r", f"__ns:={namespace}", robot_description=path, **parameters):
        for step in case.steps:
            peer.graph.system = step.now
            publishers[step.odometry].publish(step.raw)
            peer.graph.spin()
            expected.update([f"{'odometry ' * step.odometry}received", step.outcome, *step.also])
        peer.graph.system = before
        report = reports.wait_for(lambda report: len(report.entries) > 1, "all of it", 0)
    del expected["odometry"]  # an odometry that is used has no counter of its own
    assert {key: report.count(key) for key in report.values if key in COUNTED | set(expected)} == expected
    assert len(states.messages) == expected["published"] + expected["published from odometry"]
    assert report.count("received") == report.outcomes()
    if rejections := [step for step in case.steps if "rejected" in step.outcome]:
        assert report.entries["joint states"].level == WARN
        assert steady(report.values["last rejection"]) in report.entries["joint states"].message
        for word in rejections[-1].words:
            assert word in report.values["last rejection"]


# --- joint states that are rejected


class Fault(NamedTuple):
    """A joint state that is rejected.

    `make` makes it of the Panda and the stamp of the last good state; `words` stand in the rejection.
    """

    make: Callable
    cause: str
    words: tuple
    parameters: dict = {}  # noqa: RUF012


def spoiled(delay=S, names=None, sec=None, **fields):
    """Return a function that makes a state `delay` after the last good one, with some fields changed."""

    def make(panda, last):
        message = panda.message(last + delay, panda.samples[0], names or panda.names)
        for field, change in fields.items():
            setattr(message, field, change(list(getattr(message, field))))
        if sec is not None:
            message.header.stamp.sec = sec
        return message

    return make


def with_value(value):
    """Return a function that puts a value in place of that of JOINT."""
    return lambda values: [*values[:3], value, *values[4:]]


def cut(panda, last):
    """Return the first half of a message's bytes."""
    data = serialize_message(panda.message(last + S, panda.samples[0]))
    return data[: len(data) // 2]


FAULTS = {
    "stale joint by its own limit": Fault(
        spoiled(300 * MS, ARM), "stale joint", (FINGER, "0.2 s"), {"joint_timeouts": [f"{FINGER}=0.2", "*=9"]}
    ),
    "position beyond limits": Fault(
        spoiled(position=with_value(-9.5)), "absurd value", (f"'{JOINT}': position is -9.5",)
    ),
    "velocity beyond a multiple of its limit": Fault(
        spoiled(velocity=with_value(30.0)), "absurd value", ("velocity is 30",), {"absurd.beyond_velocity": 4.0}
    ),
    "the year 2100": Fault(spoiled(sec=4_102_444_800 - 2**32), "malformed stamp", (str(4_102_444_800 - 2**32),)),
    "half a message": Fault(cut, "malformed", ("bytes that are no sensor_msgs/msg/JointState",)),
    "too large an energy": Fault(
        spoiled(velocity=with_value(1e200)), "InputError", ("a result overflows",), {"absurd.velocity": 0.0}
    ),
}


def check_rejected(monitor, message, cause, words):
    """Publish a joint state, which may have no effect but a count and a warning."""
    before = monitor.next_report()
    monitor.forget()
    monitor.publish(message)
    assert not published(monitor)
    report = monitor.next_report()
    assert report.since(before) == {"received": 1, f"rejected: {cause}": 1}
    assert report.count("received") == report.outcomes()
    rejection, entry = report.values["last rejection"], report.entries["joint states"]
    assert entry.level == WARN
    assert steady(rejection) in entry.message
    for word in words:
        assert word in rejection


@pytest.mark.parametrize("name", FAULTS)
def test_rejected(monitor, panda, name):
    """Counted with its cause, named, not published; the next state is right again, and nothing is wrong any more."""
    make, cause, words, parameters = FAULTS[name]
    monitor.serves(panda)
    with monitor.having(**parameters) if parameters else nullcontext():
        check_rejected(monitor, make(panda, monitor.now), cause, words)
    monitor.serves(panda, 1)
    report = monitor.next_report()
    assert (report.entries["joint states"].level, report.entries["joint states"].message) == (OK, "publishing")


@pytest.mark.parametrize(("offset", "cause"), [(-600, "stamp from the past"), (600, "stamp from the future")])
def test_stamps_that_leave_the_clock(clocked, panda, offset, cause):
    """Stamps of now are served; one far off is rejected with its distance."""
    clocked.serves(panda)
    words = (f"this node's clock, expected within max_age = {MAX_AGE:g} s",)
    check_rejected(clocked, panda.message(clocked.now + offset * S, panda.samples[0]), cause, words)
    clocked.serves(panda, 1)


def test_foreign_time_refused(clocked, panda):
    """With foreign_time = refuse a recording is rejected from its first message on; stamps of now are served."""

    with clocked.having(foreign_time="refuse"):
        clocked.reload()
        recorded = panda.message(1000 * S, panda.samples[0])
        check_rejected(clocked, recorded, "foreign time", ("behind this node's clock",))
        clocked.serves(panda, 1)


def test_frozen_values(monitor, panda):
    """Old values under fresh stamps: a warning names the joint, or they are rejected; a state that moves is served."""
    q, qd, tau, _ = panda.samples[0]

    def repeat(count):
        for _ in range(count):
            monitor.publish(joint_state(panda.names, q, qd, tau, monitor.tick(100 * MS)))

    with monitor.having(frozen_timeout=0.5):
        repeat(8)
        assert monitor.topics["state"].at(monitor.now)
        report = monitor.next_report()
        assert report.entries["joint states"].level == WARN
        assert "frozen values" in report.entries["joint states"].message
        with monitor.having(frozen_values="refuse"):
            repeat(8)
            repeated = joint_state(panda.names, q, qd, tau, monitor.now + 100 * MS)
            check_rejected(monitor, repeated, "frozen", ("no bit of its position changes",))
            stamp = monitor.tick(200 * MS)
            monitor.publish(joint_state(panda.names, q + 1e-3, qd, tau, stamp))
            assert monitor.topics["state"].at(stamp)


# --- joint states that are no states


def overloaded(monitor, panda):
    """Make a state that comes while the node is overloaded: its timers have had no turn for two seconds."""
    for timer in monitor.process.node.timers_:
        timer.cancel()
    monitor.peer.graph.skip(2.0)
    return panda.message(monitor.tick(), panda.samples[0])


def of_nobody(monitor, panda):
    """Make a message of 30,000 unknown joints."""
    names = [f"joint_of_nobody_{k}" for k in range(30_000)]
    return joint_state(names, np.zeros(len(names)), (), (), monitor.tick())


IGNORED = [
    ("foreign", lambda monitor, panda: joint_state(["wheel"], [0.0], [0.0], [0.0], monitor.tick())),
    ("foreign", of_nobody),
    ("followers only", lambda monitor, panda: joint_state([MIMIC_FINGER], [0.0], [], [], monitor.tick())),
    ("skipped: overload", overloaded),
]


@pytest.mark.parametrize(("outcome", "make"), IGNORED)
def test_ignored(monitor, panda, outcome, make):
    """Counted under its outcome, and nothing is published of it."""
    before = monitor.next_report()
    monitor.publish(make(monitor, panda))
    assert not published(monitor)
    for timer in monitor.process.node.timers_:
        timer.reset()
    report = monitor.next_report()
    assert report.since(before) == {"received": 1, outcome: 1}
    assert report.count("received") == report.outcomes()


# --- odometry


@pytest.fixture(scope="module")
def floating(peer):
    """Start a monitor of Solo, whose odometry may be 0.2 s old."""
    with FloatingMonitor(peer, "/floating", odom_timeout=0.2) as monitor:
        yield monitor


def spoil(path, value):
    """Return a function that sets a field of an odometry."""

    def change(message):
        *parents, field = path.split(".")
        for parent in parents:
            message = getattr(message, parent)
        setattr(message, field, value)

    return change


ODOMETRY = [
    (spoil("pose.pose.position.x", math.nan), "malformed", "position"),
    (spoil("child_frame_id", "FL_FOOT"), "malformed", "FL_FOOT"),
    (spoil("twist.twist.linear.z", -1e5), "absurd value", "odom: twist is"),
]


@pytest.mark.parametrize(("change", "cause", "word"), ODOMETRY)
def test_odometry_rejected(floating, change, cause, word):
    """Counted, named, and part of no state."""
    floating.check(floating.answer())
    before = floating.next_report()
    message = floating.odometry(floating.tick(10 * MS))
    message.pose.pose.position.y = 99.0
    change(message)
    floating.odom.publish(message)
    state = floating.feed(floating.joints_message(floating.now), ["state"])["state"]
    assert state.position[:3].tolist() == pytest.approx(floating.q[:3].tolist())
    report = floating.next_report()
    assert report.since(before)[f"odometry rejected: {cause}"] == 1
    assert report.entries["joint states"].level == WARN
    assert word in report.values["last rejection"]
    floating.check(floating.answer())


def test_joints_before_odometry_and_after_it(floating):
    """Counted and warned of until the first odometry; beyond `odom_timeout` nothing is published, and the age is named."""
    floating.reload()
    before = floating.next_report()
    floating.forget()
    floating.publish(floating.joints_message(floating.tick()))
    assert not published(floating)
    report = floating.next_report()
    assert report.since(before) == {"received": 1, "before odometry": 1}
    assert "no odometry yet" in report.entries["joint states"].message
    floating.check(floating.answer())
    message = floating.joints_message(floating.now + 250 * MS)
    check_rejected(floating, message, "stale odometry", ("odom is 0.25",))
    floating.check(floating.answer())


# --- descriptions


@pytest.fixture(scope="module")
def by_topic(peer):
    """Start a monitor that gets its robot by topic."""
    descriptions = peer.publisher(String, "/topic/robot_description", LATCHED)
    descriptions.publish(description(robot(PANDA).urdf))
    with Monitor(peer, "/topic") as monitor:
        monitor.describe = lambda text: descriptions.publish(description(text))
        yield monitor.connect(robot(PANDA))


def circle():
    """Return the Panda with two joints that mimic each other."""
    begin, source, end = robot(PANDA).urdf.partition(f'<joint name="{FINGER}"')
    return begin + source + end.replace("</joint>", f'<mimic joint="{MIMIC_FINGER}"/></joint>', 1)


DESCRIPTIONS = {
    "malformed": ("<robot name='broken'><link name='a'/>", "not well-formed"),
    "no link": ("<robot name='r'/>", "link"),
    "singular": (robots.robot("romeo_description/urdf/romeo_laas_small.urdf").urdf, "l_gripper_joint"),
    "mimic joints in a circle": (circle(), f"'{FINGER}' mimics itself"),
}


@pytest.mark.parametrize("case", [*DESCRIPTIONS, "empty", "a path"])
def test_description_refused_by_topic(by_topic, panda, case):
    """The robot stays in force, and diagnostics say what is wrong until a valid description arrives."""
    more = {"empty": ("", "empty"), "a path": (str(robot(UR5).path), "refused")}  # a topic does not open files
    text, reason = (DESCRIPTIONS | more)[case]
    by_topic.describe(text)
    report = by_topic.wait_for_report(lambda report: report.level == ERROR, "the refusal")
    assert report.message.startswith("robot_description refused")
    assert reason in report.message
    assert report.values["robot"] == "panda"
    by_topic.serves(panda)
    by_topic.describe(panda.urdf)
    by_topic.serves(panda, 1)
    report = by_topic.next_report()
    assert (report.level, report.message) == (OK, "publishing")


def test_before_the_first_robot(peer, panda):
    """A monitor whose first description is refused counts joint states and names the reason."""
    peer.publisher(String, "/first/robot_description", LATCHED).publish(description(circle()))
    with Monitor(peer, "/first") as monitor:
        monitor.process.wait_for_text("robot_description refused")
        monitor.publish(panda.message(monitor.tick(), panda.samples[0]))
        report = monitor.next_report()
        assert report.counts() == {"received": 1, "before the model": 1}
        assert report.level == ERROR
        for text in (f"'{FINGER}' mimics itself", MIMIC_FINGER):
            assert text in report.message


@pytest.mark.parametrize("case", ["malformed", "no file"])
def test_description_refused_by_parameter(monitor, panda, case):
    """Diagnostics say why, and not a joint is forgotten."""
    text, reason = (DESCRIPTIONS | {"no file": ("/nowhere/robot.urdf", "/nowhere/robot.urdf")})[case]
    monitor.set_parameter("robot_description", text)
    report = monitor.next_report()
    assert report.level == ERROR
    assert "robot_description refused" in report.message and reason in report.message
    assert monitor.feed(panda.message(monitor.tick(100 * MS), panda.samples[1], ARM), ["state"])
    monitor.set_parameter("robot_description", panda.urdf)
    monitor.serves(panda)
    assert monitor.next_report().entries["model"].level == OK


def test_one_source_of_the_robot(by_topic, monitor, panda):
    """A robot by topic is not replaced by the parameter, nor the other way round."""
    for found, value, reason in (
        (by_topic, str(robot(UR5).path), "cannot replace the topic"),
        (monitor, "", "cannot become empty"),
    ):
        result = found.set_parameters({"robot_description": value})
        assert not result.successful
        assert reason in result.reason
        found.serves(panda)


# --- parameters

READ_ONLY = "read-only"

PARAMETERS = {
    "absurd.position": [(-1.0, "absurd.position"), (math.nan, "absurd.position"), (1e13, "absurd.position")],
    "alarm.joints": [(["elbow=1"], "gain is 0"), (["panda_joint1"], "name=number")],
    "armature": [(["panda_joint1=0.5"], READ_ONLY)],
    "contact.limits_file": [("/nowhere/limits.yaml", "parameter 'contact.limits_file'")],
    "contact.links": [
        (["nowhere"], "'nowhere', which is no link of robot 'panda'"),
        (["panda_link0"], "names no link that moves: 'panda_link0'"),
        (4, "Wrong parameter type"),
    ],
    "contact.points": [(["tip=nowhere 0 0 0"], "'nowhere' is not a link")],
    "effort_available": [(["elbow=true"], "elbow"), ([f"{FINGER}=true", f"{FINGER}=false"], "two entries")],
    "effort_includes_gravity": [([f"{MIMIC_FINGER}=false"], MIMIC_FINGER)],
    "foreign_time": [("maybe", "warn, refuse")],
    "gravity": [
        ([0.0], "3 numbers"),
        ([0.0, 0.0, math.nan], "finite"),
        ([0.0, 9810.0, 0.0], "within ±1000"),
        (-9.81, "Wrong parameter type"),
    ],
    "max_rate.coriolis": [(-1.0, "max_rate.coriolis")],
    "payloads": [(["tool=1"], "tool"), ([f"{HAND}=1 0 1e200 0"], "within ±1e+09"), ([f"{HAND}=-1"], "-1")],
    "warn_energy_share": [(["elbow=1"], "elbow")],
}


def test_wrong_values_are_refused(monitor, panda):
    """Each with a reason, together with a right value beside it, which is not applied either."""
    names = [*PARAMETERS, "publish_inverse_factor"]
    before = monitor.peer.get_parameters(monitor.name, names)
    for name, cases in PARAMETERS.items():
        for value, reason in cases:
            result = monitor.set_parameters({"publish_inverse_factor": True, name: value})
            assert not result.successful, (name, value)
            assert reason in result.reason
    assert monitor.peer.get_parameters(monitor.name, names) == before


def test_parameters_that_do_not_fit_each_other(monitor):
    """Rejected together, with the name of one; all values stay."""
    for values, named in (
        ({"warn_energy": 10.0, "error_energy": 5.0}, "warn_energy is 10"),
        ({"warn_energy_share": ["*=2"], "error_energy_share": ["panda_joint1=1"]}, "panda_joint1"),
        ({"gravity": [0.0, 0.0, 0.0], "joint_timeout": -1.0}, "joint_timeout"),
        ({"external_torque.threshold": 1.0, "external_torque.release_threshold": 2.0}, "release_threshold is 2"),
        ({"external_torque.gain": 9.0, "alarm.norm": 1.0, "external_torque.threshold": 2.0}, "threshold is 2"),
        ({"external_torque.gain": 9.0, "alarm.joints": ["elbow=1"]}, "'elbow'"),
    ):
        before = monitor.peer.get_parameters(monitor.name, values)
        result = monitor.set_parameters(values)
        assert not result.successful
        assert named in result.reason
        assert monitor.peer.get_parameters(monitor.name, values) == before
