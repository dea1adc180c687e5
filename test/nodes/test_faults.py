# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults injected into a monitor: each is counted and named, nothing is published of it, and the
next state is right.
"""

from collections import Counter

import numpy as np
import pytest
from diag_dynamics.msg import DiagonalizedState
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import String

import robots
from diag_dynamics.nodes.support.statuses import ERROR, OK, WARN, without_numbers
from joint_state_cases import COUNTERS, WIRING
from joint_state_messages import BASE_PARAMETERS, FLOATING, ROBOTS
from nodes import LATCHED, MS, PANDA, UR5, Monitor, Reports, description, joint_state, robot

FINGER, MIMIC_FINGER = "panda_finger_joint1", "panda_finger_joint2"
INPUTS = {"joint_states": JointState, "odom": Odometry}
COUNTED = set(COUNTERS) | {"received", "odometry received"}
ARM = tuple(name for name in robot(PANDA).names if name != FINGER)


@pytest.fixture(scope="module")
def running(peer):
    """Start a monitor whose stamps are the test's own."""
    with Monitor(peer, "/faults", robot_description=robot(PANDA).path) as monitor:
        yield monitor.connect(robot(PANDA))


def published(monitor):
    """Return whether anything has been published since the last `forget`."""
    return any(topic.messages for topic in monitor.topics.values())


# --- every counter


@pytest.mark.parametrize("counter", WIRING)
def test_counters(peer, tmp_path, counter):
    """The node counts what the decision table says, publishes its states, and reports the last
    rejection.
    """
    case = WIRING[counter]
    path = tmp_path / "robot.urdf"
    namespace = "/wiring"
    path.write_text(ROBOTS[case.robot])
    states = peer.topic(DiagonalizedState, f"{namespace}/diag_dynamics/state")
    publishers = [peer.publisher(kind, f"{namespace}/{name}") for name, kind in INPUTS.items()]
    reports = Reports(peer.node, peer.wait_until, f"{namespace}/diag_dynamics")
    parameters = BASE_PARAMETERS | case.parameters | {"floating_base": case.robot in FLOATING}
    before = peer.graph.system
    expected = Counter()
    with peer.start("monitor", "-r", f"__ns:={namespace}", robot_description=path, **parameters):
        for step in case.steps:
            peer.graph.system = step.now
            publishers[step.odometry].publish(step.raw)
            peer.graph.spin()
            expected.update([f"{'odometry ' * step.odometry}received", step.outcome, *step.also])
        peer.graph.system = before
        report = reports.wait_for(lambda report: len(report.entries) > 1, "all of it", 0)
    del expected["odometry"]  # an odometry that is used has no counter of its own
    assert {
        key: report.count(key) for key in report.values if key in COUNTED | set(expected)
    } == expected
    assert len(states.messages) == expected["published"] + expected["published from odometry"]
    assert report.count("received") == report.outcomes()
    if rejections := [step for step in case.steps if "rejected" in step.outcome]:
        assert report.entries["joint states"].level == WARN
        assert (
            without_numbers(report.values["last rejection"])
            in report.entries["joint states"].message
        )
        for word in rejections[-1].words:
            assert word in report.values["last rejection"]


# --- joint states that are rejected


def test_stuck_sensors(monitor, panda):
    """Diagnostics warn of velocities without motion, and the states are published."""
    q, qd, tau, _ = panda.samples[0]
    before = monitor.next_report()
    with monitor.having(stuck_timeout=0.1):
        for _ in range(20):
            stamp = monitor.tick(10 * MS)
            monitor.publish(joint_state(panda.names, q, 0.0 * qd + 0.1, tau, stamp))
        report = monitor.next_report()
    assert report.since(before) == {"received": 20, "published": 20}
    entry = report.entries["stuck sensors"]
    assert entry.level == WARN and "stuck values: " in entry.message


# --- joint states that are no states


def overloaded(monitor, panda):
    """Make a state that comes while the node is overloaded: its timers have had no turn for two
    seconds.
    """
    for timer in monitor.process.node.timers_:
        timer.cancel()
    monitor.peer.graph.skip(2.0)
    return panda.message(monitor.tick(), panda.samples[0])


def of_nobody(monitor, panda):
    """Make a message of 30,000 unknown joints."""
    names = [f"joint_of_nobody_{k}" for k in range(30_000)]
    return joint_state(names, np.zeros(len(names)), (), (), monitor.tick())


IGNORED = [("foreign", of_nobody), ("skipped: overload", overloaded)]


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


# --- descriptions


@pytest.fixture(scope="module")
def by_topic(peer):
    """Start a monitor that gets its robot by topic, after a first one that is rejected."""
    descriptions = peer.publisher(String, "/topic/robot_description", LATCHED)
    descriptions.publish(description(CIRCLE))
    with Monitor(peer, "/topic") as monitor:
        monitor.process.wait_for_text("robot_description rejected")
        monitor.publish(robot(PANDA).message(monitor.tick(), robot(PANDA).samples[0]))
        report = monitor.next_report()
        assert report.counts() == {"received": 1, "before the model": 1} and report.level == ERROR
        assert f"'{FINGER}' mimics itself" in report.message
        monitor.describe = lambda text: descriptions.publish(description(text))
        monitor.describe(robot(PANDA).urdf)
        yield monitor.connect(robot(PANDA))


BEGIN, SOURCE, END = robot(PANDA).urdf.partition(f'<joint name="{FINGER}"')
CIRCLE = BEGIN + SOURCE + END.replace("</joint>", f'<mimic joint="{MIMIC_FINGER}"/></joint>', 1)
DESCRIPTIONS = [
    ("<robot name='broken'><link name='a'/>", "not well-formed"),
    (
        robots.robot("romeo_description/urdf/romeo_laas_small.urdf").urdf,
        "l_gripper_joint",
    ),  # singular
    (CIRCLE, f"'{FINGER}' mimics itself"),
    ("", "empty"),
    (str(robot(UR5).path), "rejected"),  # a topic opens no files
]


@pytest.mark.parametrize(
    ("text", "reason"), DESCRIPTIONS, ids=[reason for _, reason in DESCRIPTIONS]
)
def test_description_refused_by_topic(by_topic, panda, text, reason):
    """The robot stays in force, and diagnostics say what is wrong until a valid description
    arrives.
    """
    by_topic.describe(text)
    report = by_topic.wait_for_report(lambda report: report.level == ERROR, "the refusal")
    assert report.message.startswith("robot_description rejected") and reason in report.message
    assert report.values["robot"] == "panda"
    by_topic.serves(panda)
    by_topic.describe(panda.urdf)
    by_topic.serves(panda, 1)
    report = by_topic.next_report()
    assert (report.level, report.message) == (OK, "publishing")


def test_counters_outlive_a_robot(by_topic, panda):
    """What the rules of joint states have counted for a robot still counts with another one."""
    by_topic.publish(joint_state(["wheel"], [0.0], [0.0], [0.0], by_topic.tick()))
    before = by_topic.next_report()
    by_topic.describe(f"{panda.urdf} ")
    by_topic.serves(panda)
    report = by_topic.next_report()
    assert report.count("foreign") == before.count("foreign") > 0
    assert report.count("received") == report.outcomes() > before.count("received")


@pytest.mark.parametrize(
    ("text", "reason"), [DESCRIPTIONS[0], ("/nowhere/robot.urdf", "/nowhere/robot.urdf")]
)
def test_description_refused_by_parameter(monitor, panda, text, reason):
    """Diagnostics say why, and not a joint is forgotten."""
    monitor.set_parameter("robot_description", text)
    report = monitor.next_report()
    assert report.level == ERROR
    assert "robot_description rejected" in report.message and reason in report.message
    assert monitor.feed(panda.message(monitor.tick(100 * MS), panda.samples[1], ARM), ["state"])
    monitor.set_parameter("robot_description", panda.urdf)
    monitor.serves(panda)
    assert monitor.next_report().entries["model"].level == OK


def test_one_source_of_the_robot(by_topic, monitor):
    """A robot by topic is not replaced by the parameter, nor the other way round."""
    for actual, value, reason in (
        (by_topic, str(robot(UR5).path), "cannot replace the topic"),
        (monitor, "", "become empty"),
    ):
        result = actual.set_parameters({"robot_description": value})
        assert not result.successful and reason in result.reason


# --- parameters

PARAMETERS = [
    ({"plausibility.jump": -1.0}, "plausibility.jump"),
    ({"collision.threshold": ["elbow=1"]}, "gain is 0"),
    ({"armature": ["panda_joint1=0.5"]}, "read-only"),
    ({"contact_limits.file": "/nowhere/limits.yaml"}, "parameter 'contact_limits.file'"),
    ({"gravity": [0.0, 9810.0, 0.0]}, "within ±1000"),
    ({"gravity": -9.81}, "Wrong parameter type"),
    ({"payloads": ["tool=1"]}, "tool"),
    ({"external_torque.gain": 9.0, "collision.threshold": ["elbow=1"]}, "'elbow'"),
]


def test_wrong_values_are_refused(monitor, panda):
    """Each value, and values that do not fit each other, with a reason; a right value beside them
    is not applied either.
    """
    for values, reason in PARAMETERS:
        values = {"publish_inverse_factor": True} | values
        before = monitor.peer.get_parameters(monitor.name, values)
        result = monitor.set_parameters(values)
        assert not result.successful, values
        assert reason in result.reason
        assert monitor.peer.get_parameters(monitor.name, values) == before
    monitor.serves(panda)
