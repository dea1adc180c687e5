# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor's topic ~/contact: what the library says, only where somebody listens; limits that hold, told of at once."""

import math

import numpy as np
import pytest
from diag_dynamics.msg import Contact

import diag_dynamics as dd
from diag_dynamics.assembly.assembler import RobotState
from diag_dynamics.nodes.monitor import contact_watch
from diag_dynamics.nodes.monitor.contact_watch import ContactWatch, prepared
from diag_dynamics.nodes.support.diagnostics import ERROR, OK, STALE, WARN
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from nodes import MS, PANDA, START, Monitor, S, joint_state, nanoseconds, robot

pytestmark = [pytest.mark.full, pytest.mark.live, pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")]

ENTRY = "contact"

TYPE = "Wrong parameter type"
"""What rclpy says of a value of another type; it names no parameter."""

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


@pytest.fixture(scope="module")
def running(peer):
    """Start a monitor of the Panda, and listen to contact."""
    with Monitor(peer, "/touched", robot_description=robot(PANDA).path) as monitor:
        monitor.contact = peer.topic(Contact, f"{monitor.name}/contact")
        monitor.robot = robot(PANDA)
        monitor.connect(monitor.robot)
        peer.wait_until(monitor.contact.subscription.get_publisher_count, "the topic", START)
        yield monitor


def feed(monitor, q, qd, step=50 * MS):
    """Publish a state and return what is said of contact."""
    message = joint_state(monitor.robot.names, q, qd, (), monitor.tick(step))
    monitor.feeder.publish(message)
    stamp = nanoseconds(message.header.stamp)
    return monitor.peer.wait_until(lambda: monitor.contact.at(stamp), f"contact at {stamp}")


def check(message, contact, points):
    """A message is what the library computes."""
    assert message.valid and list(message.point_names) == list(points.names)
    assert list(message.link_names) == list(points.links) and message.worst == contact.worst
    assert list(message.limited) == points.limited.tolist()
    for field, value in (
        ("positions", contact.position),
        ("directions", contact.direction),
        ("speed", contact.speed),
        ("reflected_mass", contact.reflected_mass),
        ("transferable_energy", contact.energy),
        ("force", contact.force),
        ("allowed_speed", contact.allowed_speed),
        ("margin", contact.margin),
    ):
        np.testing.assert_array_equal(getattr(message, field), value.ravel(), field)


def points_of(panda, path=None):
    """Return the dynamics and points that the monitor has by default, or with limits."""
    model = dd.load_urdf(panda.path)
    given = dd.link_geometry(model, panda.path).points
    limits = dd.ContactLimits.load(path) if path else None
    more = limits.contact_points() if limits else ()
    return dd.DiagonalDynamics(model), dd.ContactPoints(model, [*given, *more], limits, "limit")


def test_contact_of_all_links(monitor, panda):
    """Without any configuration: each link at its worst point, without a limit; at rest nothing is the worst."""
    dynamics, points = points_of(panda)
    for sample in panda.samples[:2]:
        message = feed(monitor, sample.q, sample.qd)
        check(message, dynamics.contact(sample.q, sample.qd, points), points)
        assert not any(message.limited) and set(message.margin) == {math.inf} and message.worst >= 0
    resting = feed(monitor, panda.samples[0].q, np.zeros(len(panda.names)))
    assert resting.worst == -1 and not any(resting.speed) and not any(resting.directions)


def test_points_and_links_that_are_configured(monitor, panda):
    """Those alone, named as they are; a change takes effect at the next state, and back."""
    values = {
        "contact.links": ["panda_link4"],
        "contact.points": ["tip=panda_hand 0 0 0.1"],
        "contact.geometry": "frames",
    }
    with monitor.having(**values):
        message = feed(monitor, panda.samples[0].q, panda.samples[0].qd)
        assert list(message.point_names) == ["panda_link4", "tip"]
        assert list(message.link_names) == ["panda_link4", "panda_hand"]
    assert len(feed(monitor, panda.samples[0].q, panda.samples[0].qd).point_names) > 6


@pytest.mark.parametrize(
    ("links", "reason"),
    [
        (["nowhere"], "parameter 'contact.links' names 'nowhere', which is no link of robot 'panda'"),
        (["panda_link4", "Panda_link4"], "'Panda_link4', which is no link"),
        (["panda_link0"], "parameter 'contact.links' names no link that moves: 'panda_link0'"),
        ("panda_link4", TYPE),
        (4, TYPE),
        ([4.0], TYPE),
    ],
)
def test_links_that_are_refused(monitor, panda, links, reason):
    """With whatever else is set, and why; what was in force goes on."""
    with monitor.having(**{"contact.links": ["panda_link4"], "contact.geometry": "frames"}):
        result = monitor.set_parameters({"contact.links": links, "contact.geometry": "primitives"})
        assert not result.successful
        assert reason in result.reason
        left = monitor.peer.get_parameters(monitor.name, ["contact.links", "contact.geometry"])
        assert left == {"contact.links": ["panda_link4"], "contact.geometry": "frames"}
        message = feed(monitor, panda.samples[0].q, panda.samples[0].qd)
        assert list(message.point_names) == ["panda_link4"]


def test_no_links_are_all_that_move(monitor, panda):
    """An empty list is what the default is."""
    _, points = points_of(panda)
    with monitor.having(**{"contact.links": ["panda_link4"]}):
        assert monitor.set_parameters({"contact.links": []}).successful
        message = feed(monitor, panda.samples[0].q, panda.samples[0].qd)
        assert list(message.point_names) == list(points.names)


def test_a_limit_that_is_exceeded(monitor, panda, limits):
    """Told of at once and by name, held until the speed is well below; what the message says is what the library does."""
    dynamics, points = points_of(panda, limits)
    q, qd = panda.samples[0].q, panda.samples[0].qd
    allowed = 1.0 / dynamics.contact(q, qd, points).usage.max()  # part of qd at which the first limit is reached
    with monitor.having(**{"contact.limits_file": limits}):
        begin = len(monitor.reports)
        message = feed(monitor, q, 0.5 * allowed * qd)
        check(message, dynamics.contact(q, 0.5 * allowed * qd, points), points)
        assert any(message.limited) and not all(message.limited) and min(message.margin) > 0.0
        monitor.wait_for_report(
            lambda r: r.entries.get(ENTRY) and r.entries[ENTRY].message.startswith("within limits; "), "peace", begin
        )
        begin = len(monitor.reports)
        message = feed(monitor, q, 1.05 * allowed * qd)
        assert message.margin[message.worst] == min(message.margin) < 0.0

        def told(report):
            return ENTRY in report.entries and report.entries[ENTRY].level == ERROR

        at_once = monitor.wait_for_report(told, "the alarm", begin)
        assert set(at_once.entries) == {ENTRY} and at_once.count("limits exceeded") >= 1
        name = message.point_names[message.worst]
        assert f"'{name}'" in at_once.entries[ENTRY].message and "'nobody'" in at_once.entries[ENTRY].message

        def peace(report):
            feed(monitor, q, 0.5 * allowed * qd)
            return report.entries.get(ENTRY) and report.entries[ENTRY].message.startswith("within limits; ")

        monitor.wait_for_report(peace, "its end")


def watch_of(panda, path, **values):
    """Return a watch with parameters, and a state of the Panda's first sample at a part of its rates."""
    settings = Settings.of(
        {name: spec.default for name, spec in PARAMETERS.items()} | {"contact.limits_file": path} | values
    )
    dynamics = dd.DiagonalDynamics(dd.load_urdf(panda.path))
    watch = ContactWatch(panda.path)
    watch.use(dynamics, settings, prepared(dynamics.model, panda.path, settings.contact))
    sample = panda.samples[0]

    def state(part):
        return RobotState(sample.q, part * sample.qd, None, S, S, False, False)

    return watch, state


def test_levels_hold_from_one_state_to_the_next(panda, limits):
    """Noise around a threshold is one alarm; it is over below `contact.release` of where it began."""
    watch, state = watch_of(panda, limits)
    full = 1.0 / watch.at(state(1.0)).usage.max()
    assert watch.judges and watch.report().level == STALE
    levels = []
    for part in (0.5, 0.79, 0.81, 0.75, 0.73, 0.71, 1.01, 0.99, 1.01, 0.91, 0.89, 0.5):
        rose = watch.take(state(part * full))
        said = watch.report()
        levels.append(said.level)
        assert (
            f"{said.values['shapes left out'].split(':')[0]} links are looked at by their frames alone" in said.message
        )
        assert rose == (part in (0.81, 1.01) and levels[-2] != ERROR)
    assert levels == [OK, OK, WARN, WARN, WARN, OK, *[ERROR] * 4, WARN, OK]
    exceeding = int((1.01 * full * watch.at(state(1.0)).usage > 1.0).sum())
    assert said.values["limits exceeded"] == exceeding


def test_nothing_is_computed_that_nobody_asks_for(panda, limits, monkeypatch):
    """Without limits and listeners neither contact is computed nor are points made; with limits at every state."""
    calls = []
    monkeypatch.setattr(contact_watch, "contact_points", lambda *_: calls.append("points"))
    monkeypatch.setattr(dd.DiagonalDynamics, "contact", lambda *_: calls.append("contact"))
    watch, _ = watch_of(panda, "")
    assert not watch.judges and calls == []
    monkeypatch.undo()
    watch, state = watch_of(panda, limits)
    assert watch.judges and not watch.take(state(0.0))
