# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External torque, collisions and contact on the monitor's topics, against Pinocchio and the library."""

import itertools
import math
import re
import xml.etree.ElementTree as ET
from functools import partial

import numpy as np
import pinocchio as pin
import pytest
from diag_dynamics.msg import ExternalTorque

import diag_dynamics as dd
from diag_dynamics.collision.calibration import Calibration
from diag_dynamics.collision.detector import AlarmDetector, AlarmThresholds
from diag_dynamics.joint_states.joints import RobotState
from diag_dynamics.nodes.monitor.contact import ContactWatch
from diag_dynamics.nodes.support.diagnostics import ERROR, OK, STALE, WARN
from diag_dynamics.parameters.contact_points import contact_points
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from floating import FloatingMonitor
from nodes import MS, PANDA, Monitor, S, joint_state, nanoseconds, robot
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


@pytest.mark.parametrize(
    ("name", "value", "restarts"),
    [
        ("gravity", [0.0, 0.0, -9.8], True),
        ("effort_scale", ["*=1.0"], True),
        ("external_torque.gain", 41.0, True),
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


def test_time(monitor, standing):
    """Neither a jump back nor a gap is integrated over; a lost state is."""
    pause(monitor)
    feed(monitor, [standing(0)] * 10)
    monitor.tick(3 * STEP)
    assert feed(monitor, [standing(0)])[0].valid
    monitor.tick(200 * MS)
    first, second = feed(monitor, [standing(0)] * 2)
    assert nothing(first) and second.valid
    monitor.now -= 60 * S
    lost, first, second = feed(monitor, [standing(0)] * 3)
    assert lost is None and nothing(first)
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
        assert f"> {high:.3g}, most of it at" in first.entries[TORQUE].message
        assert last_line(monitor).startswith("Collision: |r| ")
        assert first.count("collisions") == before + 1
        monitor.next_report()
        feed(monitor, [free])
        assert monitor.next_report().entries[TORQUE].message == "no collision"


def pushed_by(panda, **torques):
    """Return the state of a standing arm that is pushed at some joints."""
    return Motion(panda, np.array([torques.get(name, 0.0) for name in panda.names]), size=0.0)(0)


def last_line(monitor):
    """Return the last line of the log."""
    return monitor.process.output.split("\n")[-1].partition("]: ")[2]


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
        cause = f"panda_joint2 {first.external_torque[1]:.3g} N m > 20"
        assert (entries[TORQUE].message, last_line(monitor)) == (f"collision: {cause}", f"Collision: {cause}.")
        assert monitor.reports[count].count("collisions") == before + 1


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
        assert not quiet.torque.at(quiet.now)
        with quiet.having(**{"external_torque.gain": GAIN}):
            assert feed(quiet, [standing(0)] * 2)[-1].valid
            assert TORQUE in quiet.next_report().entries
        quiet.serves(panda)
        assert not quiet.torque.at(quiet.now)


def test_highest_rate(monitor, standing, panda):
    """Every fifth state's is published, and all of them are observed."""
    with monitor.having(max_rate__external_torque=100.0):
        pause(monitor)
        found = [message for message in feed(monitor, [standing(0)] * 51) if message]
    assert set(np.diff([nanoseconds(message.header.stamp) for message in found])) == {5 * STEP}
    np.testing.assert_allclose(found[-1].external_torque, through(50) * standing.push, rtol=1e-6)


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
    settings, dynamics, watch = Settings.of(values), points_of(panda)[0], ContactWatch()
    watch.use(dynamics, settings, contact_points(dynamics.model, panda.path, settings.contact))
    q, qd = panda.samples[0][:2]
    state = partial(RobotState, effort=None, newest=S, oldest=S, velocity_estimated=False, stamp_is_receive_time=False)
    full = 1.0 / watch.compute(state(q, qd)).usage.max()
    assert watch.report().level == STALE
    levels = []
    for part in (0.5, 0.79, 0.81, 0.75, 0.73, 0.71, 1.01, 0.99, 1.01, 0.91, 0.89, 0.5):
        rose = watch.accept_state(state(q, part * full * qd))
        levels.append(watch.report().level)
        assert rose == (part in (0.81, 1.01) and levels[-2:-1] != [ERROR])
    assert levels == [OK, OK, WARN, WARN, WARN, OK, *[ERROR] * 4, WARN, OK]
