# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External torque, collisions and contact on the monitor's topics, against Pinocchio and the
library.
"""

import math

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.collision.detector import Thresholds
from diag_dynamics.nodes.monitor.collisions import LiveAlarm
from diag_dynamics.nodes.support.statuses import ERROR, OK, WARN
from nodes import MS, PANDA, Monitor, S, joint_state, nanoseconds, robot
from pushed import GAIN, STEP, TORQUE, Motion, feed, subscribed


def through(steps):
    """Return the fraction of a constant push that the observer shows after some steps."""
    return -math.expm1(-GAIN * 1e-9 * STEP * steps)


@pytest.fixture(scope="module")
def running(peer):
    """Start a monitor of the Panda that observes external torque, and subscribe to torque and
    contact.
    """
    parameters = {"external_torque.gain": GAIN, "external_torque.friction": False}
    with Monitor(
        peer, "/pushed", outputs=["state"], robot_description=robot(PANDA).path, **parameters
    ) as monitor:
        yield subscribed(monitor).connect(robot(PANDA))


@pytest.fixture
def standing(panda):
    """Return the states of an arm at rest, which something pushes from the second one on."""
    return Motion(panda, 4.0 * np.cos(1 + np.arange(len(panda.names))), size=0.0)


@pytest.fixture
def free(panda):
    """Return the state of an arm at rest that nothing pushes."""
    return Motion(panda, size=0.0)(0)


def restart(monitor):
    """Let time pass, so that the next state is the first one."""
    monitor.tick(10 * S)


def nothing(message):
    """Return whether a message says that nothing is known, and no more."""
    empty = not len(message.residual) and not len(message.external_torque)
    return (
        empty
        and not message.valid
        and message.norm == message.torque_norm == 0.0
        and not message.collision
    )


# --- external torque


@pytest.mark.parametrize(
    ("name", "value", "restarts"),
    [
        ("gravity", [0.0, 0.0, -9.8], True),
        ("payloads", ["panda_hand=1.5"], True),
        ("effort_scale", ["*=1.0"], True),
        ("external_torque.gain", 41.0, True),
        ("plausibility.jump", 0.2, True),
        ("stuck_timeout", 2.0, False),
        ("energy.warn", ["total=1e6"], False),
    ],
)
def test_parameters(monitor, standing, name, value, restarts):
    """Parameters that change the observed torque restart the observer; others do not."""
    restart(monitor)
    before = feed(monitor, [standing(0)] * 10)[-1]
    with monitor.having(**{name: value}):
        after = feed(monitor, [standing(0)])[-1]
        assert nothing(after) == restarts
        assert restarts or after.norm > before.norm


# --- efforts


def test_missing_efforts(monitor, standing, panda):
    """Without one the others go on, and its joint is named; without any there is no result, and it
    goes on over the gap.
    """
    restart(monitor)
    q, qd, tau = standing(0)
    before = feed(monitor, [standing(0)] * 10)[-1]
    item = np.where(np.arange(len(tau)) == 2, math.nan, tau)
    none, part = feed(monitor, [(q, qd, None), (q, qd, item)])
    assert nothing(none) and part.valid and math.isnan(part.norm) and not part.collision
    assert np.isnan(part.external_torque).tolist() == (np.arange(len(tau)) == 2).tolist()
    after = feed(monitor, [standing(0)])[0]
    assert after.valid
    assert np.abs(np.delete(after.external_torque, 2)).max() > 0.0
    assert not math.isnan(before.norm)
    monitor.next_report()
    feed(monitor, [(q, qd, item)])
    entry = monitor.next_report().entries[TORQUE]
    assert entry.level == WARN and entry.message.endswith(
        f"joints without effort: 1: {panda.names[2]}"
    )


# --- collisions


def last_line(monitor):
    """Return the last line of the log."""
    return monitor.process.output.split("\n")[-1].partition("]: ")[2]


def test_alarms(monitor, panda, free):
    """Log and diagnostics name joint, torque and threshold at once; a contact is no warning."""
    limits = dict.fromkeys(panda.names, 40.0) | {"panda_joint2": 20.0}
    pushed = Motion(panda, 30.0 * (np.array(panda.names) == "panda_joint2"), size=0.0)(0)
    values = {
        "collision.threshold": ["panda_joint2=20", "*=40", "total=25", "norm=50"],
        "contact.threshold": ["*=12", "total=15", "norm=40"],
    }
    with monitor.having(**values):
        restart(monitor)
        feed(monitor, [free] * 3)
        before = monitor.next_report().count("collisions")
        count = len(monitor.reports)
        result = feed(monitor, [free] * 5 + [pushed] * 250 + [free] * 120)
        assert not result[-1].collision and not any(result[-1].joint_collision)
        assert list(result[0].collision_threshold) == [*limits.values(), 25.0, 50.0]
        assert list(result[0].contact_threshold) == [12.0] * len(panda.names) + [15.0, 40.0]
        touched = next(m for m in result if m.contact)
        assert not touched.collision and not result[-1].contact
        assert f"Contact: panda_joint2 {touched.external_torque[1]:.3g}" in monitor.process.output
        first = next(m for m in result if m.collision)
        assert list(first.joint_collision) == [name == "panda_joint2" for name in panda.names]
        entries = monitor.reports[count].entries
        cause = f"panda_joint2 {first.external_torque[1]:.3g} N m or N > 20"
        assert set(entries) == {TORQUE} and entries[TORQUE].message == "collision: panda_joint2"
        assert monitor.reports[count].values["detectors"] == cause
        assert last_line(monitor) == f"Collision: {cause}."
        assert monitor.reports[count].count("collisions") == before + 1
        monitor.next_report()


def covariance(panda, deviation=0.1):
    """Return parameters of equal noise of all joints."""
    entries = (deviation**2 * np.eye(len(panda.names))).ravel().tolist()
    joints = list(panda.names)
    return {"external_torque.covariance_joints": joints, "external_torque.covariance": entries}


def test_touched_link(monitor, panda, free):
    """Diagnostics and log have the link of the message; nothing within the noise."""
    push = 30.0 * (np.array(panda.names) == "panda_joint3")
    pushed = Motion(panda, push, size=0.0)(0)
    noise = covariance(panda)
    with monitor.having(**{"collision.threshold": ["*=10"]}, **noise):
        restart(monitor)
        feed(monitor, [free] * 3)
        monitor.next_report()
        count = len(monitor.reports)
        actual = feed(monitor, [free] * 3 + [pushed] * 60)
        assert not actual[2].touched_links and not len(actual[2].touched_link_probability)
        report = monitor.reports[count]
        first = next(m for m in actual if m.collision)
        largest = int(np.argmax(first.touched_link_probability))
        link = first.touched_links[largest]
        probability = first.touched_link_probability[largest]
        assert report.message == f"collision: {link}"
        assert report.values["detectors"].startswith(f"{link} ({probability:.2f}): panda_joint")
        assert last_line(monitor).startswith(f"Collision: {link} ({probability:.2f}): ")
    values = noise | {"external_torque.covariance_joints": ["*" + name for name in panda.names]}
    result = monitor.set_parameters(values)
    assert not result.successful and "external_torque.covariance_joints lacks" in result.reason


def test_when_it_is_computed(monitor, standing, panda):
    """Without a gain nothing is on the topic or in diagnostics; with a rate every state is
    observed.
    """
    with monitor.having(max_rate=["external_torque=100"]):
        restart(monitor)
        result = [message for message in feed(monitor, [standing(0)] * 51) if message]
    assert set(np.diff([nanoseconds(message.header.stamp) for message in result])) == {5 * STEP}
    np.testing.assert_allclose(result[-1].external_torque, through(50) * standing.push, rtol=1e-6)
    with monitor.having(**{"external_torque.gain": 0.0}):
        monitor.serves(panda)
        assert TORQUE not in monitor.next_report().entries and not monitor.torque.at(monitor.now)
    monitor.serves(panda)
    assert TORQUE in monitor.next_report().entries


# --- contact

LIMITS = """
regions:
  nobody: {mass: 3.0, stiffness: 20000, force: 60}
links: {panda_link1: []}
points: {tip: {link: panda_hand, xyz: [0, 0, 0.1]}}
"""
QUANTITIES = ("speed", "reflected_mass", "force", "allowed_speed", "margin")


def contact(monitor, q, qd):
    """Publish a state and return the message of contact."""
    monitor.publish(joint_state(robot(PANDA).names, q, qd, (), monitor.tick(50 * MS)))
    return monitor.contact_limits.at(monitor.now)


def check_contact(message, expected, points):
    """Check that a message is what the library computes."""
    assert message.valid and message.worst == expected.worst
    assert (tuple(message.point_names), tuple(message.link_names)) == (points.names, points.links)
    assert list(message.limited) == points.limited.tolist()
    values = {name: getattr(expected, name) for name in QUANTITIES}
    values |= {"positions": expected.position, "directions": expected.direction}
    for field, value in (values | {"transferable_energy": expected.energy}).items():
        np.testing.assert_array_equal(getattr(message, field), value.ravel(), field)


def points_of(panda, limits=None):
    """Return the dynamics and points that the monitor has by default, or with limits."""
    model = dd.load_urdf(panda.path)
    of_file = limits or dd.ContactLimits()
    points = [
        *(p for p in dd.link_geometry(model, panda.path).points if of_file.links.get(p.link) != ()),
        *of_file.contact_points(),
    ]
    return dd.DiagonalDynamics(model), dd.ContactPoints(model, points, limits, "limit")


@pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
def test_contact(monitor, panda, tmp_path):
    """Each link at its worst point; at rest none is the worst; the limits file chooses links and
    points.
    """
    dynamics, points = points_of(panda)
    q, qd = panda.samples[0][:2]
    message = contact(monitor, q, qd)
    check_contact(message, dynamics.contact_limits(q, qd, points), points)
    assert set(message.margin) == {math.inf}
    assert contact(monitor, q, 0 * qd).worst == -1
    others = "".join(f"  {link}: []\n" for link in {*points.links} - {"panda_link4"})
    tip = "points: {tip: {link: panda_hand, xyz: [0, 0, 0.1]}}\n"
    path = tmp_path / "points.yaml"
    path.write_text(f"geometry: frames\nlinks:\n{others}{tip}")
    with monitor.having(**{"contact_limits.file": str(path)}):
        message = contact(monitor, q, qd)
        assert list(message.point_names) == ["panda_link4", "tip"]
        assert list(message.link_names) == ["panda_link4", "panda_hand"]


@pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
def test_limits_of_contact(monitor, panda, tmp_path):
    """A rise is reported at once with point and region; noise around a limit is one alarm."""
    (tmp_path / "limits.yaml").write_text(LIMITS)
    dynamics, points = points_of(panda, dd.ContactLimits.load(tmp_path / "limits.yaml"))
    q, qd = panda.samples[0][:2]
    full = (
        qd / dynamics.contact_limits(q, qd, points).usage.max()
    )  # at which the first limit is reached
    levels = []
    alarms = []
    with monitor.having(**{"contact_limits.file": str(tmp_path / "limits.yaml")}):
        for part in (0.5, 0.79, 0.81, 0.75, 0.73, 0.71, 1.01, 0.99, 1.01, 0.91, 0.89, 0.5):
            count = len(monitor.reports)
            message = contact(monitor, q, part * full)
            at_once = monitor.reports[count:]
            entries = (at_once or [monitor.next_report()])[0].entries
            if at_once:
                alarms.append(len(levels))
                assert set(entries) == {"contact limits"}
                assert (
                    f"'{message.point_names[message.worst]}'" in entries["contact limits"].message
                )
                assert "'nobody'" in entries["contact limits"].message
            levels.append(entries["contact limits"].level)
    assert levels == [OK, OK, WARN, WARN, WARN, OK, *[ERROR] * 4, WARN, OK] and alarms == [2, 6]


def test_a_rise_within_the_hold_off_starts_no_alarm():
    """An arm that bounces off has one alarm. Rises every 1.1 s prolong no hold-off."""
    alarm = LiveAlarm()
    starts = []
    alarm.use(["elbow"], Thresholds({"elbow": 10.0}, hold_off=1.0))
    for k in range(8000):
        time = 1e-3 * k
        torque = 40.0 * (0.1 <= time < 0.2) + 25.0 * (0.6 <= time < 0.7) + 40.0 * (2.5 <= time < 3)
        torque += 20.0 * (time >= 4.5 and (time - 4.5) % 1.1 < 0.2) + 25.0 * (7.85 <= time < 7.9)
        row = np.array([[torque]])
        alarm.accept_state(np.array([k * MS]), row, row, True, torque, lambda: None)
        if alarm.starts:
            starts.append(time)
    assert starts == [0.1, 2.5, 4.5, 6.7] and alarm.count == 5  # a stronger one is an event
