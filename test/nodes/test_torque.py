# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External torque, collisions and contact on the monitor's topics, against Pinocchio and the library."""

import itertools
import math
import re
import xml.etree.ElementTree as ET
from functools import partial
from unittest import mock

import numpy as np
import pinocchio as pin
import pytest
from diag_dynamics.msg import ExternalTorque
from diag_dynamics.srv import SetPayload
from geometry_msgs.msg import Inertia, Vector3

import diag_dynamics as dd
from diag_dynamics.collision.calibration import Calibration
from diag_dynamics.collision.detector import AlarmDetector, AlarmThresholds
from diag_dynamics.joint_states.joints import RobotState
from diag_dynamics.nodes.monitor.collision_log import CollisionLog
from diag_dynamics.nodes.monitor.contact_watch import ContactWatch, prepared
from diag_dynamics.nodes.monitor.torque_watch import TorqueWatch
from diag_dynamics.nodes.support.diagnostics import ERROR, OK, STALE, WARN
from diag_dynamics.parameters.monitor import PARAMETERS, Observation, Settings
from floating import FloatingMonitor
from nodes import BELIEVING, MS, PANDA, Monitor, S, joint_state, nanoseconds, robot
from pushed import GAIN, STEP, TORQUE, Motion, feed, subscribed

HAND, COM = "panda_hand", (0.0, 0.02, 0.1)


def residuals(motion, count, gain=GAIN):
    """Return r of ṙ = K_O(ε_ext − r) at each state, by Pinocchio: ε_ext is what of ν̇ the state does not explain."""
    states = [motion.oracle.at(*motion(k)) for k in range(count)]
    r, found = np.zeros(len(states[0].nu)), [None]
    for s, t in itertools.pairwise(states):
        explained = 0.5 * sum(x.epsilon - x.coriolis - x.gravity for x in (s, t))
        external = (t.nu - s.nu) / (1e-9 * STEP) - explained
        r = r + (1.0 - math.exp(-gain * 1e-9 * STEP)) * (external - r)
        found.append(r)
    return found


def through(steps, gain=GAIN):
    """Return the fraction of a constant push that the observer shows after some steps."""
    return -math.expm1(-gain * 1e-9 * STEP * steps)


@pytest.fixture(scope="module")
def running(peer):
    """Start a monitor of the Panda that observes external torque without friction, and subscribe to torque and contact."""
    parameters = {
        "robot_description": robot(PANDA).path,
        "external_torque.gain": GAIN,
        "external_torque.friction": False,
    }
    with Monitor(peer, "/pushed", outputs=["state"], **parameters) as monitor:
        yield subscribed(monitor).connect(robot(PANDA))


@pytest.fixture
def standing(panda):
    """Return the states of an arm at rest, which something pushes from the second one on."""
    return Motion(panda, 4.0 * np.cos(1 + np.arange(len(panda.names))), size=0.0)


@pytest.fixture
def free(panda):
    """Return the state of an arm at rest that nothing pushes."""
    return Motion(panda, size=0.0)(0)


def pause(monitor):
    """Let time pass, so that the next state is the first one."""
    monitor.tick(10 * S)


def nothing(message):
    """Return whether a message says that nothing is known, and no more."""
    empty = not len(message.residual) and not len(message.external_torque)
    return empty and not message.valid and message.norm == message.torque_norm == 0.0 and not message.collision


# --- external torque


def test_a_push_on_a_moving_arm(monitor, panda):
    """Every residual is that of Pinocchio's account; m r and |r| belong to it; stamps and names are the state's."""
    motion = Motion(panda, 6.0 * np.sin(1 + np.arange(len(panda.names))))
    pause(monitor)
    found, expected = feed(monitor, map(motion, range(80))), residuals(motion, 80)
    assert nothing(found[0])
    for k, (message, r) in enumerate(zip(found[1:], expected[1:], strict=True), 1):
        np.testing.assert_allclose(message.residual, r, atol=1e-7 * np.linalg.norm(r))
        m = motion.oracle.factor(motion(k)[0])
        np.testing.assert_allclose(message.external_torque, m @ r, atol=1e-7 * np.linalg.norm(m @ r))
        assert message.norm == pytest.approx(np.linalg.norm(r), rel=1e-7)
        assert tuple(message.dof_names) == panda.names
        assert message.header.frame_id == panda.root
        assert message.valid
        assert not (message.velocity_estimated or message.stamp_is_receive_time or message.collision)
    assert message.threshold == message.release_threshold == message.torque_norm_threshold == math.inf
    assert not len(message.torque_threshold)
    assert not len(message.joint_collision)


def test_the_ground_is_external(peer):
    """Nothing drives the base of a standing robot, so its whole weight is external."""
    with FloatingMonitor(peer, "/standing", **{"external_torque.gain": GAIN}) as monitor:
        torque = peer.topic(ExternalTorque, f"{monitor.name}/external_torque")
        monitor.v[:] = 0.0
        g = pin.computeGeneralizedGravity(monitor.model, monitor.data, monitor.q)
        for _ in range(300):
            stamp = monitor.tick(STEP)
            monitor.odom.publish(monitor.odometry(stamp))
            monitor.publish(monitor.joints_message(stamp, effort=g[6:]))
        found = torque.messages[-1].external_torque
        np.testing.assert_allclose(found, np.r_[g[:6], np.zeros(12)], atol=1e-3)
        assert np.linalg.norm(found[:3]) == pytest.approx(9.81 * pin.computeTotalMass(monitor.model), rel=1e-4)


# --- restarts of the observer


def set_payload(monitor, mass):
    """Put a payload on the hand, or take it off."""
    inertia = Inertia(m=mass, com=Vector3(x=COM[0], y=COM[1], z=COM[2]), ixx=0.01, iyy=0.01, izz=0.01)
    assert monitor.call(SetPayload, "set_payload", SetPayload.Request(link=HAND, inertia=inertia)).success


def test_a_payload_restarts_the_observer(monitor, standing, panda):
    """The state after it has no result; from then on the efforts that carry it are no external torque."""
    pause(monitor)
    assert feed(monitor, [standing(0)] * 20)[-1].norm > 1.0
    set_payload(monitor, 1.5)
    carrying = Motion(panda, size=0.0, payloads={HAND: (1.5, COM, 0.01 * np.eye(3))})
    found = feed(monitor, [carrying(0)] * 20)
    assert nothing(found[0])
    assert found[-1].norm < 1e-6
    set_payload(monitor, 0.0)
    found = feed(monitor, [carrying(0)] * 100)
    assert nothing(found[0])
    weight = carrying.oracle.gravity_torque(carrying.middle) - standing.oracle.gravity_torque(carrying.middle)
    np.testing.assert_allclose(found[-1].external_torque, -through(99) * weight, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "value", "restarts"),
    [
        ("gravity", [0.0, 0.0, -9.8], True),
        ("effort_scale", ["*=1.0"], True),
        ("external_torque.gain", 41.0, True),
        ("external_torque.max_gap", 0.2, True),
        ("max_rate.state", 0.0, False),
        ("warn_energy", 1e6, False),
    ],
)
def test_parameters(monitor, standing, name, value, restarts):
    """Parameters that change the observed torque restart the observer; others do not."""
    pause(monitor)
    before = feed(monitor, [standing(0)] * 10)[-1]
    with monitor.having(**{name: value}):
        after = feed(monitor, [standing(0)])[-1]
        assert nothing(after) == restarts
        assert restarts or after.norm > before.norm


def test_another_description_and_a_pause(monitor, standing, panda):
    """Another robot has another observer; a pause restarts it, however short it was by the stamps."""
    with monitor.having(external_torque__max_gap=100.0):
        pause(monitor)
        feed(monitor, [standing(0)] * 10)
        monitor.set_parameter("robot_description", panda.urdf)
        first, second = feed(monitor, [standing(0)] * 2)
        assert nothing(first)
        assert second.valid
        monitor.reload()
        first, second = feed(monitor, [standing(0)] * 2)
        assert nothing(first)
        assert second.valid


def test_time(monitor, standing):
    """Neither a jump back nor a gap is integrated over; a lost state is."""
    pause(monitor)
    feed(monitor, [standing(0)] * 10)
    monitor.tick(3 * STEP)
    assert feed(monitor, [standing(0)])[0].valid
    monitor.tick(200 * MS)
    first, second = feed(monitor, [standing(0)] * 2)
    assert nothing(first)
    assert second.valid
    monitor.now -= 60 * S
    lost, first, second = feed(monitor, [standing(0)] * 3)
    assert lost is None
    assert nothing(first)
    np.testing.assert_allclose(second.external_torque, through(1) * standing.push, rtol=1e-6)


# --- efforts


def test_missing_efforts(monitor, standing, panda):
    """No result while one is missing, and its joint is named; afterwards it goes on over the gap."""
    pause(monitor)
    q, qd, tau = standing(0)
    before = feed(monitor, [standing(0)] * 10)[-1]
    one = np.where(np.arange(len(tau)) == 2, math.nan, tau)
    assert all(map(nothing, feed(monitor, [(q, qd, None), (q, qd, one)])))
    after = feed(monitor, [standing(0)])[0]
    assert after.valid
    assert after.norm > before.norm
    np.testing.assert_allclose(after.external_torque, through(13) * standing.push * (12 / 13), rtol=0.2)
    monitor.next_report()
    feed(monitor, [(q, qd, one)])
    entry = monitor.next_report().entries[TORQUE]
    assert (entry.level, entry.message) == (WARN, f"no effort of 1: {panda.names[2]}")


def test_meaning_of_efforts(monitor, standing, panda):
    """Gravity is added and currents are scaled where parameters say so; without a sensor nothing is known."""
    q, qd, tau = standing(0)
    gravity, one = standing.oracle.gravity_torque(q), panda.names[1]
    for values, sent in (
        ({"effort_includes_gravity": ["*=false"]}, tau - gravity),
        ({"effort_scale": ["*=0.5"]}, 2.0 * tau),
        ({"effort_includes_gravity": [f"{one}=false"]}, tau - gravity * (np.arange(len(q)) == 1)),
    ):
        with monitor.having(**values):
            found = feed(monitor, [(q, qd, sent)] * 150)
            np.testing.assert_allclose(found[-1].external_torque, standing.push, rtol=1e-4)
    with monitor.having(effort_available=[f"{one}=false"]):
        assert all(map(nothing, feed(monitor, [(q, qd, tau)] * 3)))


def test_friction(monitor, panda):
    """The URDF's friction is no external torque, and part of it without external_torque.friction."""
    motion, xml, friction = Motion(panda), ET.fromstring(panda.urdf), dict.fromkeys(panda.names, (0.0, 0.0))
    for k, joint in enumerate(xml.findall("joint")):
        for dynamics in joint.findall("dynamics"):
            of_arm = re.fullmatch(r"panda_joint\d", joint.get("name"))
            friction[joint.get("name")] = damping, dry = (2.0 + 0.1 * k, 1.0 + 0.1 * k) if of_arm else (0.0, 0.0)
            dynamics.set("damping", str(damping))
            dynamics.set("friction", str(dry))
    d, f = np.array([friction[name] for name in panda.names]).T
    rubbing = [(q, qd, tau + d * qd + f * np.sign(qd)) for q, qd, tau in map(motion, range(60))]
    with monitor.having(robot_description=ET.tostring(xml, encoding="unicode")):
        for known in (True, False):
            pause(monitor)
            with monitor.having(external_torque__friction=known):
                torque = np.array(feed(monitor, rubbing)[-1].external_torque)
            resisting = -(d * rubbing[-1][1] + f * np.sign(rubbing[-1][1]))
            expected, tolerance = (0.0, 0.02) if known else (resisting, 0.1 * np.linalg.norm(resisting))
            assert np.linalg.norm(torque - expected) < tolerance


def test_flags(monitor, standing):
    """Estimated velocities and the time of reception are flagged."""
    q, _, tau = standing(0)
    with monitor.having(missing_velocity="estimate", velocity_filter_time=0.0):
        pause(monitor)
        found = feed(monitor, [(q, (), tau)] * 150)[1:]
        assert all(message.velocity_estimated for message in found)
        np.testing.assert_allclose(found[-1].external_torque, standing.push, rtol=1e-3)
    monitor.publish(joint_state(standing.robot.names, *standing(0)))
    assert monitor.torque.messages[-1].stamp_is_receive_time


# --- collisions


def test_collision_and_release(monitor, standing, free):
    """Begins above one threshold, ends below the other; it is reported at once, alone, and counted."""
    level = np.linalg.norm(np.linalg.solve(standing.oracle.factor(standing.middle), standing.push))
    high, low = round(0.6 * level, 3), round(0.2 * level, 3)
    with monitor.having(**{"external_torque.threshold": high, "external_torque.release_threshold": low}):
        feed(monitor, [free] * 3)
        report = monitor.next_report()
        assert report.entries[TORQUE].message == "no collision"
        before, count = report.count("collisions"), len(monitor.reports)
        found, colliding = feed(monitor, [standing(0)] * 60 + [free] * 120), False
        for message in found:
            assert (message.threshold, message.release_threshold) == (high, low)
            colliding = message.norm >= low if colliding else message.norm > high
            assert message.collision == colliding
        assert not found[0].collision
        assert found[59].collision
        assert not found[-1].collision
        first = monitor.reports[count]
        assert set(first.entries) == {TORQUE}
        assert first.entries[TORQUE].level == WARN
        assert f"threshold = {high:g}" in first.entries[TORQUE].message
        assert first.count("collisions") == before + 1
        monitor.next_report()
        feed(monitor, [free])
        assert monitor.next_report().entries[TORQUE].message == "no collision"


def pushed_by(panda, **torques):
    """Return the state of a standing arm that is pushed at some joints."""
    return Motion(panda, np.array([torques.get(name, 0.0) for name in panda.names]), size=0.0)(0)


def collision_lines(monitor):
    """Return the lines of the log on collisions."""
    lines = [line.partition("]: ")[2] for line in monitor.process.output.split("\n") if "Collision" in line]
    assert all(len(line.split()) <= 15 for line in lines), lines
    return lines


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"external_torque.threshold": 8.0}, ("|r| 8", "threshold 8;", "joint 'panda_joint2'")),
        ({"alarm.joints": ["panda_joint2=20", "*=40"]}, ("joint 'panda_joint2' 2", "N m, threshold 20.")),
    ],
    ids=["norm", "joints"],
)
def test_collisions_in_the_log(monitor, panda, free, values, words):
    """One line where a collision begins, one where it ends; rises within half a second belong to it, and are counted."""
    pushed = pushed_by(panda, panda_joint2=30.0)
    with monitor.having(**values):
        pause(monitor)
        feed(monitor, [free] * 3)
        before = len(collision_lines(monitor))
        for pushes in (1, 5):
            found = []
            for _ in range(pushes):
                found += feed(monitor, [pushed] * 100 + [free] * 60)
            stamps = [nanoseconds(message.header.stamp) for message in found if message.collision]
            (begins,) = collision_lines(monitor)[before:]
            assert begins.startswith("Collision: ") and all(word in begins for word in words), begins
            monitor.tick(S)
            feed(monitor, [free])
            _, ends = collision_lines(monitor)[before:]
            assert ends.startswith(f"Collision over after {1e-9 * (stamps[-1] - stamps[0]):.3g} s: at most "), ends
            most = max(abs(message.external_torque[1]) for message in found if message.collision)
            assert f"{most:.3g} N m at joint 'panda_joint2'" in ends
            assert ("5 rises" in ends) == (pushes == 5)
            before += 2


@pytest.mark.parametrize(
    ("first", "others", "most"),
    [(math.nan, math.nan, ""), (math.nan, 10.0, ": at most 10 N m at joint 'panda_joint2'")],
)
def test_collisions_in_the_log_without_a_torque(panda, first, others, most):
    """The line at the end has the largest torque that is known, if there is one."""
    log, count = CollisionLog(dd.load_urdf(panda.path)), len(panda.names)
    torque = np.array([first, *[others] * (count - 1)])
    for k in range(3):
        log.accept_state(k * 10 * MS, True, torque, np.full(count, 20.0), lambda: "cause")
    log.end()
    assert log.pop() == [("Collision: cause.", True), (f"Collision over after 0.02 s{most}.", False)]


def test_collisions_in_the_log_at_one_state_a_second(panda):
    """States in collision without a state at rest between them are one collision; the next state at rest ends it."""
    log, count = CollisionLog(dd.load_urdf(panda.path)), len(panda.names)
    found = []
    for k, colliding in enumerate((True, True, True, False, False, True, False)):
        log.accept_state(k * S, colliding, np.full(count, 30.0), np.full(count, 20.0), lambda: "cause")
        found.append([line.partition(" s:")[0] for line, _ in log.pop()])
    begins = ["Collision: cause."]
    assert found == [begins, [], [], ["Collision over after 2"], [], begins, ["Collision over after 0"]]


def test_alarms(monitor, panda, free):
    """Alarms are those of the library's detector; diagnostics name joint, torque and threshold at once."""
    limits = dict.fromkeys(panda.names, 40.0) | {"panda_joint2": 20.0}
    detector = AlarmDetector(panda.names, AlarmThresholds(limits, 25.0, 50.0))
    values = {"alarm.joints": ["panda_joint2=20", "*=40"], "alarm.external_torque": 25.0, "alarm.norm": 50.0}
    with monitor.having(**values):
        pause(monitor)
        monitor.next_report()
        feed(monitor, [free] * 3)
        before, count = monitor.next_report().count("collisions"), len(monitor.reports)
        found = feed(monitor, [free] * 5 + [pushed_by(panda, panda_joint2=30.0)] * 250 + [free] * 120)
        judged = [detector.update(1e-9 * nanoseconds(m.header.stamp), m.residual, m.external_torque) for m in found]
        assert [m.collision for m in found] == [one.alarm[0] for one in judged]
        assert sum(one.begins[0] for one in judged) == 1
        assert not found[-1].collision
        for m, one in zip(found, judged, strict=True):
            assert list(m.joint_collision) == one.joints[0].tolist()
            assert list(m.torque_threshold) == list(limits.values())
            assert m.torque_norm == pytest.approx(np.linalg.norm(m.external_torque))
            assert (m.torque_norm_threshold, m.threshold) == (25.0, 50.0)
        first = next(m for m in found if m.collision)
        entries = monitor.reports[count].entries
        assert set(entries) == {TORQUE}
        assert entries[TORQUE].message == f"collision: panda_joint2 {first.external_torque[1]:.3g} N m > 20"
        assert monitor.reports[count].count("collisions") == before + 1


ALARMS = AlarmThresholds({"panda_joint2": 20.0, "panda_joint4": 10.0}, 60.0, standing=math.inf)
BY_JOINT, BY_NORM = Observation(GAIN, math.inf, math.inf, False, 0.1, ALARMS), Observation(GAIN, 4.0, 1.0, False, 0.1)


@pytest.mark.parametrize(
    ("observation", "began", "lasts"),
    [
        (BY_JOINT, "collision: panda_joint2 30 N m > 20, panda_joint4 12 N m > 10", "alarm.release = 0.7"),
        (BY_NORM, " N m (prismatic: N), at joint 'panda_joint2', with r ", "release_threshold = 1"),
    ],
    ids=["joint by joint", "norm"],
)
def test_report_of_an_alarm(panda, free, observation, began, lasts):
    """The report says what was above which threshold, then that the alarm lasts, by the other threshold."""
    watch = TorqueWatch(dd.DiagonalDynamics(dd.load_urdf(panda.path)), observation)
    pushed, stamps = pushed_by(panda, panda_joint2=30.0, panda_joint4=-12.0), itertools.count(S, STEP)

    def take(state, count=1):
        for _ in range(count):
            watch.take(RobotState(*state, next(stamps), S, False))
        return watch.report([])

    take(free)
    risen = take(pushed, 200)
    assert risen.level == WARN and began in risen.message
    take(free)
    messages = []
    while watch.seen.collision:
        messages.append(take(free).message)
    assert messages[-2].startswith(f"{risen.message}; since then not below ") and lasts in messages[-2]
    assert take(free).message == "no collision"


def test_the_file_of_a_calibration(peer, panda, free, tmp_path):
    """A node takes it by --params-file: gain, friction, and every threshold."""
    joints = {name: 20.0 + k for k, name in enumerate(panda.names)}
    thresholds = AlarmThresholds(joints, 31.5, 4.25, 0.6, 0.3, 1.5)
    trust = {"asked": 1 / 60, "duration": 300.0, "alarms": 4, "held_out": 5, "method": "tail", "peaks": 50}
    found = Calibration(**vars(thresholds), gain=GAIN, friction=True, **trust)
    found.save(tmp_path / "alarms.yaml")
    arguments = "--params-file", str(tmp_path / "alarms.yaml")
    with Monitor(peer, "/calibrated", *arguments, robot_description=panda.path) as monitor:
        message = feed(subscribed(monitor), [free] * 2)[1]
        assert list(message.torque_threshold) == list(joints.values())
        assert (message.torque_norm_threshold, message.threshold) == (31.5, 4.25)
        values = {"external_torque.gain": GAIN, "external_torque.friction": True}
        values |= {"alarm.release": 0.6, "alarm.hold_off": 0.3, "alarm.standing": 1.5}
        assert peer.get_parameters(monitor.name, list(values)) == values


# --- when it is computed


def test_off_by_default(peer, standing, panda):
    """Nothing on the topic or in diagnostics; switched on and off while running."""
    with Monitor(peer, "/quiet", robot_description=panda.path) as quiet:
        subscribed(quiet).serves(panda)
        assert TORQUE not in quiet.next_report().entries
        for _ in range(2):
            quiet.serves(panda)
            assert not quiet.torque.at(quiet.now)
            with quiet.having(**{"external_torque.gain": GAIN}):
                assert feed(quiet, [standing(0)] * 2)[-1].valid
                assert TORQUE in quiet.next_report().entries


def test_highest_rate(monitor, standing, panda):
    """Every fifth state's is published, and all of them are observed."""
    with monitor.having(max_rate__external_torque=100.0):
        pause(monitor)
        found = [message for message in feed(monitor, [standing(0)] * 51) if message]
    assert set(np.diff([nanoseconds(message.header.stamp) for message in found])) == {5 * STEP}
    np.testing.assert_allclose(found[-1].external_torque, through(50) * standing.push, rtol=1e-6)


def test_nobody_listens(peer, panda):
    """Every state is observed, and no message is made."""
    motion = Motion(panda, 5.0)
    parameters = {"robot_description": panda.path, "max_age": 0.0} | BELIEVING
    parameters |= {"external_torque.gain": GAIN, "external_torque.friction": False}
    with peer.start("monitor", "-r", "__ns:=/alone", **parameters) as running:
        watched, feeder = running.node._robot, peer.publisher(type(joint_state()), "/alone/joint_states")
        with mock.patch.object(watched, "encoder", wraps=watched.encoder) as encoder:
            for k in range(20):
                feeder.publish(joint_state(panda.names, *motion(k), 100 * S + k * STEP))
                peer.graph.spin()
        np.testing.assert_allclose(watched.torque.seen.residual, residuals(motion, 20)[-1], rtol=1e-6, atol=1e-6)
        assert not encoder.mock_calls


# --- contact


LIMITS = """
regions:
  nobody: {mass: 3.0, stiffness: 20000, force: 60}
links: {panda_link1: []}
points: {tip: {link: panda_hand, xyz: [0, 0, 0.1]}}
"""


@pytest.fixture(scope="module")
def limits(tmp_path_factory):
    """Return the path of a file of limits."""
    path = tmp_path_factory.mktemp("contact") / "limits.yaml"
    path.write_text(LIMITS)
    return str(path)


def contact(monitor, q, qd):
    """Publish a state and return the message of contact."""
    monitor.publish(joint_state(robot(PANDA).names, q, qd, (), monitor.tick(50 * MS)))
    return monitor.contact.at(monitor.now)


def check_contact(message, expected, points):
    """Check that a message is what the library computes."""
    assert message.valid
    assert list(message.point_names) == list(points.names)
    assert list(message.link_names) == list(points.links)
    assert message.worst == expected.worst
    assert list(message.limited) == points.limited.tolist()
    for field, value in (
        ("positions", expected.position),
        ("directions", expected.direction),
        ("speed", expected.speed),
        ("reflected_mass", expected.reflected_mass),
        ("transferable_energy", expected.energy),
        ("force", expected.force),
        ("allowed_speed", expected.allowed_speed),
        ("margin", expected.margin),
    ):
        np.testing.assert_array_equal(getattr(message, field), value.ravel(), field)


def points_of(panda, path=None):
    """Return the dynamics and points that the monitor has by default, or with limits."""
    model = dd.load_urdf(panda.path)
    limits = dd.ContactLimits.load(path) if path else None
    points = [*dd.link_geometry(model, panda.path).points, *(limits.contact_points() if limits else ())]
    return dd.DiagonalDynamics(model), dd.ContactPoints(model, points, limits, "limit")


@pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
def test_contact(monitor, panda):
    """Each link at its worst point; at rest none is the worst; parameters choose links and points."""
    dynamics, points = points_of(panda)
    for sample in panda.samples[:2]:
        message = contact(monitor, sample.q, sample.qd)
        check_contact(message, dynamics.contact(sample.q, sample.qd, points), points)
        assert set(message.margin) == {math.inf}
    q, qd = panda.samples[0][:2]
    assert contact(monitor, q, 0 * qd).worst == -1
    values = {"contact.links": ["panda_link4"], "contact.points": ["tip=panda_hand 0 0 0.1"]}
    with monitor.having(**values, **{"contact.geometry": "frames"}):
        message = contact(monitor, q, qd)
        assert list(message.point_names) == ["panda_link4", "tip"]
        assert list(message.link_names) == ["panda_link4", "panda_hand"]
    with monitor.having(**{"contact.links": ["panda_link4"]}):
        assert monitor.set_parameters({"contact.links": []}).successful
        assert list(contact(monitor, q, qd).point_names) == list(points.names)


@pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
def test_a_limit_of_contact(monitor, panda, limits):
    """Reported at once with point and region; the message is what the library computes."""
    dynamics, points = points_of(panda, limits)
    q, qd = panda.samples[0][:2]
    allowed = 1.0 / dynamics.contact(q, qd, points).usage.max()  # fraction of qd at which the first limit is reached
    with monitor.having(**{"contact.limits_file": limits}):
        message = contact(monitor, q, 0.5 * allowed * qd)
        check_contact(message, dynamics.contact(q, 0.5 * allowed * qd, points), points)
        assert any(message.limited)
        assert min(message.margin) > 0.0
        assert monitor.next_report().entries["contact"].message.startswith("within limits; ")
        count, message = len(monitor.reports), contact(monitor, q, 1.05 * allowed * qd)
        assert message.margin[message.worst] == min(message.margin) < 0.0
        report = monitor.reports[count]
        assert set(report.entries) == {"contact"}
        assert report.entries["contact"].level == ERROR
        for name in (message.point_names[message.worst], "nobody"):
            assert f"'{name}'" in report.entries["contact"].message


@pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
def test_hysteresis_of_contact(panda, limits):
    """Noise around a threshold is one alarm; it ends below `contact.release`."""
    values = {name: spec.default for name, spec in PARAMETERS.items()} | {"contact.limits_file": limits}
    settings, dynamics, watch = Settings.of(values), points_of(panda)[0], ContactWatch(panda.path)
    watch.use(dynamics, settings, prepared(dynamics.model, panda.path, settings.contact))
    q, qd = panda.samples[0][:2]
    state = partial(RobotState, effort=None, newest=S, oldest=S, velocity_estimated=False, stamp_is_receive_time=False)
    full = 1.0 / watch.at(state(q, qd)).usage.max()
    assert watch.report().level == STALE
    levels = []
    for part in (0.5, 0.79, 0.81, 0.75, 0.73, 0.71, 1.01, 0.99, 1.01, 0.91, 0.89, 0.5):
        rose = watch.take(state(q, part * full * qd))
        levels.append(watch.report().level)
        assert rose == (part in (0.81, 1.01) and levels[-2:-1] != [ERROR])
    assert levels == [OK, OK, WARN, WARN, WARN, OK, *[ERROR] * 4, WARN, OK]
