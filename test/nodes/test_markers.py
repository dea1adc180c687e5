# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Markers: links at their placements, tinted by their shares, and all else by its numbers."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
import yaml
from visualization_msgs.msg import MarkerArray

import diag_dynamics as dd
from diag_dynamics.control.observer import Disturbance
from diag_dynamics.joint_states.robot_joints import RobotState
from diag_dynamics.nodes.monitor.collisions import CollisionWatch, LoadWatch
from diag_dynamics.nodes.monitor.markers import (
    COLD,
    HOT,
    LIFETIME,
    MIN_ENERGY,
    TOUCHED,
    MarkerMaker,
)
from diag_dynamics.page.layout import center_of_body, tree_of
from diag_dynamics.page.scene import links_of
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from nodes import MS, PANDA, Monitor, S, nanoseconds, robot

ROOT = Path(__file__).parents[2]

ROBOTS = pytest.mark.parametrize(
    ("name", "floating"), [("panda", False), ("ur5", False), ("go2", True)]
)


class Drawn:
    """A robot in a random state, and its markers by namespace."""

    def __init__(self, name, floating=False, watch=None):
        self.model = dd.load_robot(name, floating_base=floating)
        self.dynamics = dd.DiagonalDynamics(self.model)
        rng = np.random.default_rng(0)
        self.q = self.model.random(rng)
        self.qd = rng.normal(size=self.model.nv)
        self.s = self.dynamics.evaluate(self.q, self.qd)
        self.maker = MarkerMaker(self.dynamics)
        self.markers = self.show(watch)

    def show(self, watch=None, qd=None):
        """Return the markers by namespace."""
        s = self.s if qd is None else self.dynamics.evaluate(self.q, qd)
        state = RobotState(
            self.q, self.qd if qd is None else qd, None, 5 * S + 7, 5 * S, False, True
        )
        return by_space(self.maker.message(s, state, watch))


def by_space(message):
    result = {}
    for marker in message.markers:
        result.setdefault(marker.ns, []).append(marker)
    return result


def matrix(pose):
    """Return the placement (4x4) of a pose."""
    p = pose.position
    r = pose.orientation
    return pin.SE3(
        pin.Quaternion(r.w, r.x, r.y, r.z).matrix(), np.array([p.x, p.y, p.z])
    ).homogeneous


def vector(x):
    return np.array([x.x, x.y, x.z])


@ROBOTS
def test_links(name, floating):
    """Ellipsoids in the root link's axes, tinted by the share of their joints; the text has K."""
    drawn = Drawn(name, floating)
    placed = {link: drawn.dynamics.placement(drawn.q, link) for link in drawn.model.link_names}
    from_world = np.linalg.inv(placed[drawn.model.root_link])
    names = drawn.model.dof_names
    fractions = drawn.s.energy_share / (drawn.s.kinetic_energy + MIN_ENERGY)
    moved_by = zip(drawn.model.link_names, tree_of(drawn.model)["links"], strict=True)
    moved_by = {link: entry["dofs"][-1] for link, entry in moved_by if entry["dofs"]}
    links = [link for link in links_of(drawn.model) if link.ellipsoid is not None]
    for link, marker in zip(links, drawn.markers["links"], strict=True):
        M = (from_world @ placed[link.name] @ link.ellipsoid)[:3]
        X = matrix(marker.pose)
        half = 0.5 * vector(marker.scale)
        np.testing.assert_allclose(X[:3, 3], M[:, 3], atol=1e-9)
        np.testing.assert_allclose(
            X[:3, :3] @ np.diag(half**2) @ X[:3, :3].T, M[:, :3] @ M[:, :3].T, atol=1e-9
        )
        share = fractions[moved_by[link.name]] if link.name in moved_by else 0.0
        tint = COLD + share * (HOT - COLD)
        assert [marker.color.r, marker.color.g, marker.color.b] == pytest.approx(tint, abs=1e-6)
    every = [marker for several in drawn.markers.values() for marker in several]
    assert len({(marker.ns, marker.id) for marker in every}) == len(every)
    for marker in every:
        assert (nanoseconds(marker.header.stamp), marker.header.frame_id) == (
            5 * S + 7,
            drawn.model.root_link,
        )
        assert nanoseconds(marker.lifetime) == LIFETIME * S and marker.color.a > 0.0
    (text,) = drawn.markers["text"]
    k = int(np.argmax(fractions))
    share = f"{100 * fractions[k]:.0f}% of it {names[k]}"
    assert text.text.splitlines() == [f"K {drawn.s.kinetic_energy:.3g} J", share]
    assert text.pose.position.z > max(marker.pose.position.z for marker in drawn.markers["links"])
    (text,) = drawn.show(qd=np.zeros(drawn.model.nv))["text"]
    assert text.text == "K 0 J"


class Watch(CollisionWatch):
    """One with a result of a push at the centre of mass of a link."""

    def __init__(self, drawn, link, force, collision=False, contact=True, known=True):
        dyn = drawn.dynamics
        names = drawn.model.dof_names
        covariance = 0.01 * np.eye(drawn.model.nv)
        values = {name: entry.default for name, entry in PARAMETERS.items()}
        values |= {
            "external_torque.gain": 25.0,
            "collision.threshold": ["total=2"],
            "contact.threshold": ["total=1"],
        }
        if known:
            values |= {"external_torque.covariance_joints": [*names]}
            values |= {"external_torque.covariance": covariance.ravel().tolist()}
        super().__init__(SimpleNamespace(load=LoadWatch(None, None)), None)
        self.configure(dyn, Settings.of(values))
        epsilon = dyn.epsilon_from_wrench(
            drawn.q, link, [*force, 0, 0, 0], center_of_body(drawn.model, link)
        )
        torque = dyn.tau_from_epsilon(drawn.q, epsilon)
        self.seen = Disturbance(True, "", epsilon, torque, float(np.linalg.norm(epsilon)))
        if known:  # neighbouring links are often not distinguishable
            self._touched = dyn.touched_link(drawn.q, torque, covariance)._replace(
                link=link, confidence=0.7
            )
        self._position = drawn.q
        self.contact_torque = torque
        self.collision.on = collision
        self.contact.on = contact


FORCE = np.array([30.0, -20.0, 9.0])


@pytest.mark.parametrize("link", ["forearm_link", "wrist_2_link"])
@pytest.mark.parametrize(("collision", "known"), [(False, True), (True, True), (True, False)])
def test_touched_link(link, collision, known):
    """A collision is in the text; where its link is known, this is red and in the text."""
    drawn = Drawn("ur5")
    markers = drawn.show(Watch(drawn, link, FORCE, collision, True, known))
    _, _, *lines = markers["text"][0].text.splitlines()
    assert lines == ([f"collision: {link} (70%)"] if known else ["collision"])[:collision]
    links = [link.name for link in links_of(drawn.model) if link.ellipsoid is not None]
    colors = [[m.color.r, m.color.g, m.color.b] for m in markers["links"]]
    red = [name for name, color in zip(links, colors, strict=True) if color == [*TOUCHED]]
    assert red == [link] * (collision and known)


# --- the topic


def test_topic(peer):
    """At no more than the highest rate."""
    panda = robot(PANDA)
    with Monitor(peer, "/drawn", robot_description=panda.path) as monitor:
        topic = peer.topic(MarkerArray, f"{monitor.name}/markers")
        monitor.connect(panda)
        peer.pass_time(0.1)  # the monitor looks for subscriptions a hundred times a second
        topic.forget()
        first = monitor.tick()
        for k in range(100):  # 0.2 s of states at 500 Hz
            monitor.publish(panda.message(first + 2 * k * MS, panda.samples[k % 3]))
        monitor.now = first + S
        energy = monitor.feed(panda.message(monitor.now, panda.samples[1]))["kinetic_energy"]
        stamps = [nanoseconds(message.markers[0].header.stamp) for message in topic.messages]
        assert len(stamps) == 6
        assert all(47 * MS < gap <= 50 * MS for gap in np.diff(stamps[:-1]))
        text = by_space(topic.messages[-1])["text"][0].text
        assert text.startswith(f"K {energy.total:.3g} J") and "% of it panda_joint" in text


def test_rviz_shows_the_markers():
    config = yaml.safe_load((ROOT / "config" / "diag_dynamics.rviz").read_text())
    displays = config["Visualization Manager"]["Displays"]
    (markers,) = (display for display in displays if display["Class"].endswith("MarkerArray"))
    assert markers["Enabled"] and markers["Topic"]["Value"] == "/diag_dynamics/markers"
