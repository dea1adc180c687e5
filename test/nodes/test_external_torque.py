# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor's disturbance observer on a real graph: what it tells is Pinocchio's, or nothing."""

import contextlib
import itertools
import math
import re
import xml.etree.ElementTree as ET
from unittest import mock

import numpy as np
import pinocchio as pin
import pytest
import rclpy
from diag_dynamics.msg import ExternalTorque
from diag_dynamics.srv import SetPayload
from geometry_msgs.msg import Inertia, Vector3
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from test_floating_base import Rig
from test_simulator_commands import Simulator

from diag_dynamics import DiagonalDynamics, load_urdf
from diag_dynamics.alarms.detector import AlarmDetector
from diag_dynamics.alarms.thresholds import AlarmThresholds
from diag_dynamics.assembly.assembler import RobotState
from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.monitor.monitor import MonitorNode
from diag_dynamics.nodes.monitor.torque_watch import TorqueWatch
from diag_dynamics.parameters.monitor import PARAMETERS, Observation, Settings
from diag_dynamics.recordings.calibration import Calibration
from nodes import BELIEVING, MAX_AGE, MS, PANDA, START, UR5, Monitor, S, joint_state, nanoseconds, robot

pytestmark = [pytest.mark.full, pytest.mark.live]

OK, WARN = b"\x00", b"\x01"
GAIN, STEP = 40.0, 2 * MS
ENTRY = "external torque"


class Motion:
    """All joints swing, by the efforts that Pinocchio says less what pushes: states by number, `STEP` apart."""

    def __init__(self, robot, push=0.0, size=0.3, **options):
        self.robot, self.push = robot, np.broadcast_to(push, len(robot.names))
        self.oracle = robot.make_oracle(robot.urdf, **options)
        self.middle = robot.samples[1].q
        self.size = size * np.cos(np.arange(len(self.middle)))

    def __call__(self, k):
        w, t = 4.0, 1e-9 * STEP * k
        q, qd = self.middle + self.size * np.sin(w * t), self.size * w * np.cos(w * t)
        return q, qd, self.oracle.inverse_dynamics(q, qd, -self.size * w**2 * np.sin(w * t)) - self.push


def residuals(motion, count, gain=GAIN):
    """r of ṙ = K_O(ε_ext − r) after each of the states, by Pinocchio: ε_ext is what ν̇ has that nothing explains."""
    states = [motion.oracle.at(*motion(k)) for k in range(count)]
    r, found = np.zeros(len(states[0].nu)), [None]
    for s, t in itertools.pairwise(states):
        explained = 0.5 * sum(x.epsilon - x.coriolis - x.gravity for x in (s, t))
        external = (t.nu - s.nu) / (1e-9 * STEP) - explained
        r = r + (1.0 - math.exp(-gain * 1e-9 * STEP)) * (external - r)
        found.append(r)
    return found


@pytest.fixture(scope="module")
def running(peer):
    """Start a monitor of the Panda that observes external torque."""
    with Monitor(peer, "/pushed", robot_description=robot(PANDA).path, **{"external_torque.gain": GAIN}) as monitor:
        listening(monitor)
        yield monitor


def listening(monitor):
    """Hear what a monitor of the Panda says of external torque."""
    monitor.torque = monitor.peer.topic(ExternalTorque, f"{monitor.name}/external_torque")
    monitor.robot = robot(PANDA)
    monitor.connect(monitor.robot)
    monitor.peer.wait_until(monitor.torque.subscription.get_publisher_count, "the observer's topic", START)


@pytest.fixture
def standing(panda):
    """Return the states of an arm at rest, which something pushes from the second one on."""
    return Motion(panda, 4.0 * np.cos(1 + np.arange(len(panda.names))), size=0.0)


def feed(monitor, states):
    """Publish states `STEP` apart, one after the other has been answered; return what the observer says of each."""
    said = []
    for q, qd, tau in states:
        message = joint_state(monitor.robot.names, q, qd, () if tau is None else tau, monitor.tick(STEP))
        said.append(answer(monitor, message))
    return said


def answer(monitor, message):
    """Publish a joint state and return what the observer says of it."""
    monitor.feeder.publish(message)
    stamp = nanoseconds(message.header.stamp)
    return monitor.peer.wait_until(lambda: monitor.torque.at(stamp), f"the observer's word on {stamp}")


def anew(monitor):
    """Let time pass, so that the next state is the first one."""
    monitor.tick(10 * S)


def nothing(message):
    """Whether this says that nothing is known, and no more."""
    empty = not len(message.residual) and not len(message.external_torque)
    return empty and not message.valid and message.norm == message.torque_norm == 0.0 and not message.collision


# --- what is seen


def test_a_push_on_a_moving_arm(monitor, panda):
    """Every residual is that of Pinocchio's account; m r and |r| belong to it; stamps and names are the state's."""
    motion = Motion(panda, 6.0 * np.sin(1 + np.arange(len(panda.names))))
    anew(monitor)
    said, expected = feed(monitor, map(motion, range(80))), residuals(motion, 80)
    assert nothing(said[0])
    for k, (message, r) in enumerate(zip(said[1:], expected[1:], strict=True), 1):
        assert message.valid
        np.testing.assert_allclose(message.residual, r, atol=1e-7 * np.linalg.norm(r))
        m = motion.oracle.factor(motion(k)[0])
        np.testing.assert_allclose(message.external_torque, m @ r, atol=1e-7 * np.linalg.norm(m @ r))
        assert message.norm == pytest.approx(np.linalg.norm(r), rel=1e-7)
        assert tuple(message.dof_names) == panda.names and message.header.frame_id == panda.root
        assert not message.velocity_estimated and not message.stamp_is_receive_time
    assert message.threshold == message.release_threshold == message.torque_norm_threshold == math.inf
    assert not message.collision and not len(message.torque_threshold) and not len(message.joint_collision)


def test_a_push_on_a_standing_arm(monitor, standing):
    """It settles on the torque that pushes, at its gain."""
    anew(monitor)
    said = feed(monitor, map(standing, range(150)))
    np.testing.assert_allclose(said[-1].external_torque, standing.push, rtol=1e-4)
    at = 1.0 - math.exp(-GAIN * 1e-9 * STEP * 20)
    np.testing.assert_allclose(said[20].external_torque, at * standing.push, rtol=1e-6)


def test_nothing_pushes(monitor, panda):
    """A residual of a thousandth of what moves the arm."""
    motion = Motion(panda)
    anew(monitor)
    said = feed(monitor, map(motion, range(60)))
    moving = max(np.linalg.norm(motion.oracle.at(*motion(k)).coriolis) for k in range(60))
    assert max(message.norm for message in said[1:]) < 1e-3 * moving


def test_a_push_on_a_simulated_arm(peer):
    """Simulator and monitor as processes: what pushes the tool is told as Jᵀf, and when it is over."""
    wrench = np.array([10.0, -20.0, 15.0, 0.5, 1.0, -0.5])
    parameters = {"compensates_gravity": True, "wrench_axes": "world", "wrench_timeout": 0.0, "rate": 250.0}
    with Simulator(peer, "/plant", UR5, **parameters) as arm:
        said = peer.topic(ExternalTorque, "/plant/diag_dynamics/external_torque")
        options = {"external_torque.gain": 200.0, "external_torque.friction": True, "max_age": MAX_AGE}
        with peer.start("monitor", "-r", "__ns:=/plant", robot_description=arm.robot.path, **options):
            peer.wait_until(lambda: said.messages and said.messages[-1].valid, "a result", START)
            assert said.messages[-1].norm < 0.1
            arm.push("tool0", *wrench)

            def told():
                message = said.messages[-1]
                state = arm.states.at(nanoseconds(message.header.stamp))
                if state is None or not message.valid:
                    return False
                q = np.array([state.position[list(state.name).index(name)] for name in arm.robot.names])
                expected = arm.robot.oracle.effort_of(q, {"tool0": wrench}, "world")
                return np.linalg.norm(message.external_torque - expected) < 0.03 * np.linalg.norm(expected)

            peer.wait_until(told, "the push")
            arm.push("tool0", *np.zeros(6))
            peer.wait_until(lambda: said.messages[-1].valid and said.messages[-1].norm < 0.5, "its end")


# --- collisions


def test_collision_and_release(monitor, standing, panda):
    """Set above the threshold, taken back below the other; told at once, counted, and over with the push."""
    level = np.linalg.norm(np.linalg.solve(standing.oracle.factor(standing.middle), standing.push))
    free = Motion(panda, size=0.0)
    high, low = round(0.6 * level, 3), round(0.2 * level, 3)
    bounds = {"external_torque.threshold": high, "external_torque.release_threshold": low}
    with monitor.having(**bounds):
        begin = len(monitor.reports)
        feed(monitor, [free(0)] * 3)
        before = monitor.wait_for_report(lambda r: r.entries[ENTRY].level == OK, "peace", begin).count("collisions")
        begin = len(monitor.reports)
        pushed = feed(monitor, [standing(0)] * 60)
        after = feed(monitor, [free(0)] * 120)
        said, colliding = pushed + after, False
        for message in said:
            assert (message.threshold, message.release_threshold) == (high, low)
            colliding = message.norm >= low if colliding else message.norm > high
            assert message.collision == colliding
        assert not pushed[0].collision and pushed[-1].collision and not after[-1].collision
        assert any(message.collision and message.norm < high for message in after)

        def told(report):
            return report.entries[ENTRY].level == WARN

        first = monitor.wait_for_report(told, "the collision", begin)
        assert set(first.entries) == {ENTRY}  # it did not wait for the others
        assert f"threshold = {high:g}" in first.entries[ENTRY].message
        assert first.count("collisions") == before + 1

        def peace(report):
            feed(monitor, [free(0)])
            return report.entries.get(ENTRY) and report.entries[ENTRY].level == OK

        report = monitor.wait_for_report(peace, "its end")
        assert report.count("collisions") == before + 1
        assert report.entries[ENTRY].message == "no collision"
    assert feed(monitor, [free(0)])[0].threshold == math.inf


# --- beginning anew


HAND, COM = "panda_hand", (0.0, 0.02, 0.1)


def set_payload(monitor, mass):
    """Put a payload on the hand, or take it off."""
    inertia = Inertia(m=mass, com=Vector3(x=COM[0], y=COM[1], z=COM[2]), ixx=0.01, iyy=0.01, izz=0.01)
    done = monitor.call(SetPayload, "set_payload", SetPayload.Request(link=HAND, inertia=inertia))
    assert done.success, done.message


def test_a_payload_begins_anew(monitor, standing, panda):
    """The state after it has no result; from then on what carries the payload is no external torque."""
    anew(monitor)
    assert feed(monitor, [standing(0)] * 20)[-1].norm > 1.0
    set_payload(monitor, 1.5)
    try:
        carrying = Motion(panda, size=0.0, payloads={HAND: (1.5, COM, 0.01 * np.eye(3))})
        said = feed(monitor, [carrying(0)] * 20)
        assert nothing(said[0]) and all(message.valid for message in said[1:])
        assert said[-1].norm < 1e-6
    finally:
        set_payload(monitor, 0.0)
    said = feed(monitor, [carrying(0)] * 100)
    assert nothing(said[0])
    weight = carrying.oracle.gravity_torque(carrying.middle) - standing.oracle.gravity_torque(carrying.middle)
    through = -math.expm1(-GAIN * 1e-9 * STEP * 99)
    np.testing.assert_allclose(said[-1].external_torque, -through * weight, atol=1e-6)  # it holds up what is not there


@pytest.mark.parametrize(
    ("name", "value", "anew_"),
    [
        ("gravity", [0.0, 0.0, -9.8], True),
        ("effort_scale", ["*=1.0"], True),
        ("external_torque.gain", 41.0, True),
        ("external_torque.max_gap", 0.2, True),
        ("max_rate.state", 0.0, False),
        ("warn_energy", 1e6, False),
    ],
)
def test_parameters(monitor, standing, name, value, anew_):
    """What it is seen by begins anew, and nothing else does."""
    anew(monitor)
    before = feed(monitor, [standing(0)] * 10)[-1]
    with monitor.having(**{name: value}):
        after = feed(monitor, [standing(0)])[-1]
        assert nothing(after) == anew_
        assert anew_ or after.norm > before.norm


def test_another_description(monitor, standing, panda):
    """A new robot, a new observer."""
    anew(monitor)
    feed(monitor, [standing(0)] * 10)
    with monitor.having(robot_description=panda.urdf):
        monitor.feed(panda.message(monitor.tick(STEP), panda.samples[0]))  # all joints arrive anew
        said = feed(monitor, [standing(0)] * 3)
        assert nothing(monitor.torque.at(monitor.now - 3 * STEP))
        assert said[-1].valid


def test_time(monitor, standing):
    """Neither a jump back nor a gap is integrated over; a lost state is."""
    anew(monitor)
    feed(monitor, [standing(0)] * 10)
    monitor.tick(3 * STEP)
    assert feed(monitor, [standing(0)])[0].valid
    monitor.tick(200 * MS)
    assert nothing(feed(monitor, [standing(0)])[0])
    assert feed(monitor, [standing(0)])[0].valid
    monitor.now -= 60 * S
    monitor.feeder.publish(joint_state(monitor.robot.names, *standing(0), monitor.tick(STEP)))  # is lost by its jump
    said = feed(monitor, [standing(0)] * 2)
    assert nothing(said[0]) and said[1].valid
    np.testing.assert_allclose(said[1].external_torque, -math.expm1(-GAIN * 1e-9 * STEP) * standing.push, rtol=1e-6)


def test_a_pause(monitor, standing, panda):
    """Deactivated and activated: it begins anew, however soon by the stamps."""
    with monitor.having(external_torque__max_gap=100.0):
        anew(monitor)
        assert feed(monitor, [standing(0)] * 10)[-1].valid
        count = len(monitor.torque.messages)
        monitor.transition("deactivate", "activate")
        monitor.connect(panda)
        monitor.peer.wait_until(lambda: len(monitor.torque.messages) > count, "the first one")
        assert nothing(monitor.torque.messages[count])
        assert feed(monitor, [standing(0)])[0].valid


# --- efforts


def test_missing_efforts(monitor, standing, panda):
    """No result while one is missing, and who is named; afterwards it goes on over the gap."""
    anew(monitor)
    q, qd, tau = standing(0)
    before = feed(monitor, [standing(0)] * 10)[-1]
    one = np.where(np.arange(len(tau)) == 2, math.nan, tau)
    assert all(map(nothing, feed(monitor, [(q, qd, None), (q, qd, one)])))

    def blamed(report):
        feed(monitor, [(q, qd, one)])
        return report.entries.get(ENTRY) and report.entries[ENTRY].level == WARN

    after = feed(monitor, [standing(0)])[0]
    through = 1.0 - math.exp(-GAIN * 1e-9 * STEP * 13)
    assert after.valid and after.norm > before.norm
    np.testing.assert_allclose(after.external_torque, through * standing.push * (12 / 13), rtol=0.2)
    report = monitor.wait_for_report(blamed, "the missing effort")
    assert report.entries[ENTRY].message == f"no effort of 1: {panda.names[2]}"


def test_efforts_without_gravity(monitor, standing, panda):
    """What the drives do not count is counted; what cannot be used is unknown; what is in amperes is scaled."""
    q, qd, tau = standing(0)
    gravity = standing.oracle.gravity_torque(q)
    cases = (
        ({"effort_includes_gravity": ["*=false"]}, tau - gravity),
        ({"effort_scale": ["*=0.5"]}, 2.0 * tau),
        ({"effort_includes_gravity": [f"{panda.names[1]}=false"]}, tau - gravity * (np.arange(len(q)) == 1)),
    )
    for values, sent in cases:
        with monitor.having(**values):
            said = feed(monitor, [(q, qd, sent)] * 150)
            np.testing.assert_allclose(said[-1].external_torque, standing.push, rtol=1e-4)
    with monitor.having(effort_available=[f"{panda.names[1]}=false"]):
        assert all(map(nothing, feed(monitor, [(q, qd, tau)] * 3)))


def with_friction(urdf):
    """Return the description with damping and friction of the arm's joints alone, and both by joint."""
    xml, found = ET.fromstring(urdf), {}
    for k, joint in enumerate(xml.findall("joint")):
        for dynamics in joint.findall("dynamics"):
            of_arm = re.fullmatch(r"panda_joint\d", joint.get("name"))
            damping, friction = (2.0 + 0.1 * k, 1.0 + 0.1 * k) if of_arm else (0.0, 0.0)
            dynamics.set("damping", str(damping))
            dynamics.set("friction", str(friction))
            found[joint.get("name")] = damping, friction
    return ET.tostring(xml, encoding="unicode"), found


def test_friction(monitor, panda):
    """The URDF's is seen as external torque by default, and not if it is opted for."""
    motion = Motion(panda)
    urdf, friction = with_friction(panda.urdf)
    d, f = np.array([friction[name] for name in panda.names]).T
    rubbing = [(q, qd, tau + d * qd + f * np.sign(qd)) for q, qd, tau in map(motion, range(60))]
    with monitor.having(robot_description=urdf):
        monitor.feed(panda.message(monitor.tick(), panda.samples[0]))
        for known in (True, False):
            anew(monitor)
            with monitor.having(external_torque__friction=known):
                said = feed(monitor, rubbing)
            torque = said[-1].external_torque
            if known:
                assert np.abs(torque).max() < 0.01
            else:
                resisting = -(d * rubbing[-1][1] + f * np.sign(rubbing[-1][1]))
                assert np.linalg.norm(torque - resisting) < 0.1 * np.linalg.norm(resisting)


# --- flags


def test_estimated_velocity_and_time_of_reception(monitor, standing):
    """Both are flagged in what comes of them."""
    with monitor.having(missing_velocity="estimate", velocity_filter_time=0.0):
        anew(monitor)
        q, _, tau = standing(0)
        monitor.feeder.publish(joint_state(monitor.robot.names, q, (), tau, monitor.tick(STEP)))  # nothing to go by yet
        said = feed(monitor, [(q, (), tau)] * 150)
        assert all(message.velocity_estimated for message in said)
        np.testing.assert_allclose(said[-1].external_torque, standing.push, rtol=1e-4)
    count = len(monitor.torque.messages)
    monitor.feeder.publish(joint_state(monitor.robot.names, *standing(0)))
    monitor.peer.wait_until(lambda: len(monitor.torque.messages) > count, "a state without a stamp")
    assert monitor.torque.messages[-1].stamp_is_receive_time
    anew(monitor)


# --- on a floating base


def test_the_ground_is_external(peer):
    """A robot that stands: nothing drives its base, so what carries it is seen there, its whole weight."""
    rig = Rig(peer, "/standing", **{"external_torque.gain": GAIN})
    rig.v[:] = 0.0
    said = peer.topic(ExternalTorque, f"{rig.name}/external_torque")
    with rig.process:
        rig.answer()
        peer.wait_until(said.subscription.get_publisher_count, "the observer's topic")
        g = pin.computeGeneralizedGravity(rig.model, rig.data, rig.q)

        def settled():
            rig.now += STEP
            rig.odom.publish(rig.odometry(rig.now))
            rig.feeder.publish(joint_state(rig.joints, rig.q[7:], rig.v[6:], g[6:], rig.now))
            with contextlib.suppress(AssertionError):  # the first ones may be lost
                peer.wait_until(lambda: said.at(rig.now), "an answer", 1.0)
            last = said.messages[-1:]
            return (
                last and last[0].valid and np.allclose(last[0].external_torque, np.r_[g[:6], np.zeros(12)], atol=1e-3)
            )

        peer.wait_until(settled, "the weight")
        assert np.linalg.norm(said.messages[-1].external_torque[:3]) == pytest.approx(
            9.81 * pin.computeTotalMass(rig.model), rel=1e-4
        )


def judged(messages, stamps, names, thresholds):
    """Whether an alarm is on at each message, and whether one begins, by the library's detector on what they say."""
    valid, nothing = np.array([m.valid for m in messages]), np.zeros(len(names))
    r = np.array([m.residual if m.valid else nothing for m in messages])
    torque = np.array([m.external_torque if m.valid else nothing for m in messages])
    return AlarmDetector(names, thresholds).judge(np.array(stamps), r, torque, valid)


def test_alarms_joint_by_joint(monitor, panda):
    """One push above the threshold of its joint, seen before the norms: by the message, and by name, value, threshold."""
    push = np.zeros(len(panda.names))
    push[panda.names.index("panda_joint2")] = 30.0
    pushed, free = Motion(panda, push, size=0.0), Motion(panda, size=0.0)
    values = {"alarm.joints": ["panda_joint2=20", "*=40"], "alarm.external_torque": 25.0, "alarm.norm": 50.0}
    with monitor.having(**values):
        anew(monitor)
        begin = len(monitor.reports)
        feed(monitor, [free(0)] * 3)
        quiet = monitor.wait_for_report(lambda r: r.entries[ENTRY].message == "no collision", "peace", begin)
        before, begin = quiet.count("collisions"), len(monitor.reports)
        said = feed(monitor, [free(0)] * 5 + [pushed(0)] * 60 + [free(0)] * 120)
        assert all((m.threshold, m.release_threshold) == (50.0, pytest.approx(35.0)) for m in said)
        thresholds = AlarmThresholds({"panda_joint2": 20.0, "*": 40.0}, 25.0, 50.0)
        expected = judged(said, [nanoseconds(m.header.stamp) for m in said], panda.names, thresholds)
        assert [m.collision for m in said] == expected.alarm.tolist() and expected.begins.sum() == 1
        for m, joints in zip(said, expected.joints, strict=True):
            assert list(m.joint_collision) == (joints.tolist() if m.valid else [])
            assert list(m.torque_threshold) == [20.0 if name == "panda_joint2" else 40.0 for name in panda.names]
            assert m.torque_norm == pytest.approx(np.linalg.norm(m.external_torque)) and m.torque_norm_threshold == 25.0
        assert expected.joints.any(axis=0).tolist() == [name == "panda_joint2" for name in panda.names]
        first = said[int(np.argmax(expected.alarm))]
        assert 20.0 < first.external_torque[1] < 25.0 and first.norm < 50.0

        def told(report):
            return report.entries[ENTRY].level == WARN

        at_once = monitor.wait_for_report(told, "the alarm", begin)
        assert set(at_once.entries) == {ENTRY} and at_once.count("collisions") == before + 1
        assert at_once.entries[ENTRY].message == f"collision: panda_joint2 {first.external_torque[1]:.3g} N m > 20"

        def peace(report):
            feed(monitor, [free(0)])
            return report.entries.get(ENTRY) and report.entries[ENTRY].message == "no collision"

        assert monitor.wait_for_report(peace, "its end").count("collisions") == before + 1


def test_an_alarm_by_what_stands_ends(monitor, panda):
    """A push that stays: the alarm is over, and what is told is the same as from a recording."""
    push = np.zeros(len(panda.names))
    push[1] = 30.0
    pushed, free = Motion(panda, push, size=0.0), Motion(panda, size=0.0)
    with monitor.having(**{"alarm.joints": ["*=10"], "alarm.standing": 0.2}):
        anew(monitor)
        said = feed(monitor, [free(0)] * 5 + [pushed(0)] * 350)
        thresholds = AlarmThresholds({"*": 10.0}, standing=0.2)
        expected = judged(said, [nanoseconds(m.header.stamp) for m in said], panda.names, thresholds)
        assert [m.collision for m in said] == expected.alarm.tolist()
        assert any(m.collision for m in said) and not said[-1].collision and said[-1].external_torque[1] > 29.0
        assert said[-1].threshold == math.inf


def test_the_file_of_a_calibration(peer, panda, tmp_path):
    """A node takes it as it is, by --params-file: gain, friction, and every threshold."""
    joints = {name: 20.0 + k for k, name in enumerate(panda.names)}
    thresholds = AlarmThresholds(joints, 31.5, 4.25, 0.6, 0.3, 1.5)
    Calibration(thresholds, GAIN, True, 1 / 60, 300.0, 4, 5, "tail", 50, ("a warning",)).save(tmp_path / "alarms.yaml")
    arguments = "--params-file", str(tmp_path / "alarms.yaml")
    with Monitor(peer, "/calibrated", *arguments, robot_description=robot(PANDA).path) as monitor:
        listening(monitor)
        values = peer.get_parameters(
            monitor.name, [name for name in PARAMETERS if name.startswith(("alarm.", "external"))]
        )
        told = Settings.of({name: spec.default for name, spec in PARAMETERS.items()} | values).observation
        assert told == Observation(GAIN, 4.25, 0.6 * 4.25, True, 0.1, thresholds)
        message = feed(monitor, [Motion(panda, size=0.0)(0)] * 2)[1]
        assert message.valid and message.threshold == 4.25


def test_what_an_alarm_is_told_by(panda):
    """The joints that rose, as far as they went; then that it goes on, and what keeps it up."""
    push = np.zeros(len(panda.names))
    push[[1, 3]] = 30.0, -12.0
    pushed, free = (Motion(panda, push, size=0.0)(0), Motion(panda, size=0.0)(0))
    alarms = AlarmThresholds({"panda_joint2": 20.0, "panda_joint4": 10.0}, 60.0, standing=math.inf)
    model = load_urdf(panda.path)
    watch = TorqueWatch(DiagonalDynamics(model), Observation(GAIN, math.inf, math.inf, False, 0.1, alarms))
    seen = []

    def take(states):
        for q, qd, tau in states:
            watch.take(RobotState(q, qd, tau, S + STEP * len(seen), S, False))
            seen.append(watch.seen)
        return watch.report([])

    report = take([free] + [pushed] * 200)
    assert report.message == "collision: panda_joint2 30 N m > 20, panda_joint4 12 N m > 10" and report.level == WARN
    assert watch.active == ("panda_joint2", "panda_joint4") and watch.alarm.first == "panda_joint2"
    while seen[-1].external_torque[1] > 20.0 or seen[-1].external_torque[3] < -10.0:
        take([free])
    assert take([free]).message.endswith("; since then not below alarm.release = 0.7 of it")
    while seen[-1].collision:
        take([free])
    assert take([free]).message == "no collision" and watch.active == ()
    watch.forget()
    only_norm = AlarmThresholds({}, external_torque=25.0)
    watch.use(DiagonalDynamics(model), Observation(GAIN, math.inf, math.inf, False, 0.1, only_norm))
    assert "collision: |m r| 32.3 N m > 25, most of it at panda_joint2" in take([free] + [pushed] * 200).message
    with pytest.raises(InputError, match="'elbow'"):
        watch.use(DiagonalDynamics(model), Observation(GAIN, 1.0, 1.0, False, 0.1, AlarmThresholds({"elbow": 1.0})))


def test_what_was_above_what(panda):
    """Of a collision diagnostics say the norm, the threshold, the joint; then that it is not over, by the other threshold."""
    push = np.zeros(len(panda.names))
    push[panda.names.index("panda_joint2")] = 30.0
    pushed, free = (Motion(panda, push, size=0.0)(0), Motion(panda, size=0.0)(0))
    watch = TorqueWatch(DiagonalDynamics(load_urdf(panda.path)), Observation(GAIN, 4.0, 1.0, False, 0.1))
    seen = []

    def take(states):
        for q, qd, tau in states:
            watch.take(RobotState(q, qd, tau, S + STEP * len(seen), S, False))
            seen.append(watch.seen)
        return watch.report([])

    risen = take([free] + [pushed] * 60)
    first = next(one for one in seen if one.collision)
    k = panda.names.index("panda_joint2")
    assert np.argmax(np.abs(first.residual)) == k
    told = (
        f"collision: |r| rose to {first.norm:.6g} J^0.5/s, above external_torque.threshold = 4; most of it is joint "
        f"'panda_joint2', with {first.residual[k]:.6g} J^0.5/s and {first.external_torque[k]:.6g} N m (prismatic: N)"
    )
    assert risen.level == WARN and risen.message == told
    while seen[-1].norm > 4.0:
        take([free])
    assert seen[-1].collision
    falling = take([free])
    assert (
        falling.level == WARN
        and falling.message == f"{told}; since then not below external_torque.release_threshold = 1"
    )
    while seen[-1].collision:
        take([free])
    assert take([free]).message == "no collision"


# --- who listens


def test_nobody_listens(ros_domain, panda):
    """Every state is observed, and diagnostics are ready to tell; no message is made."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain)
    values = {"robot_description": str(panda.path), "external_torque.gain": GAIN, "max_age": 0.0, **BELIEVING}
    node = MonitorNode(
        context=context, parameter_overrides=[Parameter(name, value=value) for name, value in values.items()]
    )
    try:
        motion = Motion(panda, 5.0)
        watched = node._robot
        with mock.patch.object(watched, "encoder", wraps=watched.encoder) as made:
            for k in range(20):
                message = joint_state(panda.names, *motion(k), 100 * S + k * STEP)
                node._take_heartbeat()  # nobody spins it: it would take itself for overloaded
                node._take_joint_state(node._listening, serialize_message(message))
        np.testing.assert_allclose(watched.torque.seen.residual, residuals(motion, 20)[-1], rtol=1e-6, atol=1e-6)
        assert not made.mock_calls
        assert "largest |r| [J^0.5/s]" in watched.torque_report().values
    finally:
        node.destroy_node()
        context.try_shutdown()


# --- parameters


def test_off_by_default(peer, standing, panda):
    """Nobody asked: nothing is said, on the topic or in diagnostics; switched on and off while running."""
    with Monitor(peer, "/quiet", robot_description=panda.path) as quiet:
        listening(quiet)
        assert set(quiet.next_report().entries) == {"joint states", "model", "numerical health", "energy"}
        off = []
        for _ in range(2):
            for _ in range(3):
                quiet.serves(panda)
                off.append(quiet.now)
            quiet.set_parameter("external_torque.gain", GAIN)
            quiet.feed(panda.message(quiet.tick(), panda.samples[0]))
            assert feed(quiet, [standing(0)] * 2)[-1].valid
            assert ENTRY in quiet.next_report().entries
            quiet.set_parameter("external_torque.gain", 0.0)
        assert quiet.torque.messages and not set(off) & set(quiet.torque.stamps)
        quiet.serves(panda)


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"external_torque.gain": -1.0}, "external_torque.gain"),
        ({"external_torque.threshold": math.nan}, "external_torque.threshold"),
        ({"external_torque.threshold": 1.0, "external_torque.release_threshold": 2.0}, "release_threshold is 2"),
        ({"external_torque.max_gap": 0.0}, "external_torque.max_gap"),
        ({"alarm.joints": ["elbow=1"]}, "'elbow'"),
        ({"alarm.norm": 1.0, "external_torque.threshold": 2.0}, "external_torque.threshold is 2"),
        ({"alarm.norm": 1.0, "external_torque.gain": 0.0}, "external_torque.gain is 0"),
    ],
    ids=str,
)
def test_wrong_values_are_refused(monitor, standing, values, named):
    """By name, and the observer goes on undisturbed."""
    anew(monitor)
    feed(monitor, [standing(0)] * 3)
    result = monitor.set_parameters(values)
    assert not result.successful and named in result.reason
    assert feed(monitor, [standing(0)])[0].valid


def test_highest_rate(monitor, standing, panda):
    """Every fifth state's is published, and all of them are observed."""
    with monitor.having(max_rate__external_torque=100.0):
        monitor.tick()
        answer(monitor, joint_state(panda.names, *standing(0), monitor.tick()))
        begin = len(monitor.torque.stamps)
        for _ in range(50):
            stamp = monitor.tick(STEP)
            monitor.feed(joint_state(panda.names, *standing(0), stamp), ["state"])
        monitor.peer.wait_until(lambda: monitor.torque.at(stamp), "the last one")
        apart = np.diff(monitor.torque.stamps[begin - 1 :])
    assert (apart == 5 * STEP).all()
    through = -math.expm1(-GAIN * 1e-9 * STEP * 50)
    np.testing.assert_allclose(monitor.torque.at(stamp).external_torque, through * standing.push, rtol=1e-6)
