# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Markers: links at their placements, tinted by their shares, and all else by its numbers."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
import yaml
from visualization_msgs.msg import Marker, MarkerArray

import diag_dynamics as dd
from diag_dynamics.control.observer import Disturbance
from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.joint_states.joints import RobotState
from diag_dynamics.nodes.monitor.collisions import CollisionWatch, LoadWatch
from diag_dynamics.nodes.monitor.markers import (
    COLD,
    HORIZON,
    HOT,
    LIFETIME,
    MIN_ENERGY,
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
SHAPES = {
    "mesh": Marker.MESH_RESOURCE,
    "box": Marker.CUBE,
    "sphere": Marker.SPHERE,
    "cylinder": Marker.CYLINDER,
}


class Drawn:
    """A robot in a random state, and its markers by namespace."""

    def __init__(self, name, floating=False, watch=None):
        self.model = dd.load_robot(name, floating_base=floating)
        self.dynamics = dd.DiagonalDynamics(self.model)
        rng = np.random.default_rng(0)
        self.q = self.model.random(rng)
        self.qd = rng.normal(size=self.model.nv)
        self.s = self.dynamics.evaluate(self.q, self.qd)
        self.maker = MarkerMaker(self.dynamics, find_urdf(name))
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
    """In the root link's axes, tinted by the share of their joints, each of its kind, size and
    file.
    """
    drawn = Drawn(name, floating)
    placed = {link: drawn.dynamics.placement(drawn.q, link) for link in drawn.model.link_names}
    from_world = np.linalg.inv(placed[drawn.model.root_link])
    shares = dict(
        zip(
            drawn.model.dof_names,
            drawn.s.energy_share / (drawn.s.kinetic_energy + MIN_ENERGY),
            strict=True,
        )
    )
    geometry = links_of(drawn.model, find_urdf(name))
    shapes = [
        (link.name, shape)
        for link in geometry
        for shape in link.shapes or [None] * (link.ellipsoid is not None)
    ]
    moved_by = zip(drawn.model.link_names, tree_of(drawn.model)["links"], strict=True)
    moved_by = {
        link: drawn.model.dof_names[entry["dofs"][-1]] for link, entry in moved_by if entry["dofs"]
    }
    for (link, shape), marker in zip(shapes, drawn.markers["links"], strict=True):
        if shape is not None:  # else an ellipsoid stands for it
            there = from_world @ placed[link] @ shape.placement
            np.testing.assert_allclose(matrix(marker.pose), there, atol=1e-9)
        assert marker.type == (SHAPES[shape.kind] if shape else Marker.SPHERE)
        assert marker.mesh_resource.startswith("package://") == (
            marker.type == Marker.MESH_RESOURCE
        )
        tint = COLD + (shares[moved_by[link]] if link in moved_by else 0.0) * (HOT - COLD)
        assert [marker.color.r, marker.color.g, marker.color.b] == pytest.approx(tint, abs=1e-6)
    every = [marker for several in drawn.markers.values() for marker in several]
    assert len({(marker.ns, marker.id) for marker in every}) == len(every)
    for marker in every:
        assert (nanoseconds(marker.header.stamp), marker.header.frame_id) == (
            5 * S + 7,
            drawn.model.root_link,
        )
        assert nanoseconds(marker.lifetime) == LIFETIME * S and marker.color.a > 0.0


@ROBOTS
def test_ellipsoid_arrow_and_text(name, floating):
    drawn = Drawn(name, floating)
    model = drawn.model
    link = drawn.maker.link
    s = drawn.s
    q = drawn.q
    qd = drawn.qd
    root = drawn.dynamics.placement(q, model.root_link)[:3, :3]
    J = root.T @ drawn.dynamics.jacobian(q, link, frame="world")[:3]
    (ellipsoid,), (arrow,), (text,) = (
        drawn.markers[space] for space in ("ellipsoid", "velocity", "text")
    )
    R = matrix(ellipsoid.pose)[:3, :3]
    half = 0.5 * vector(ellipsoid.scale) / drawn.maker.scale
    mobility = J @ np.linalg.solve(drawn.dynamics.mass_matrix(q), J.T)
    np.testing.assert_allclose(
        R @ np.diag(half**2) @ R.T, mobility, rtol=1e-6, atol=1e-4 * mobility.max()
    )
    begin, end = map(vector, arrow.points)
    v = J @ qd
    np.testing.assert_allclose((end - begin) / HORIZON, v, atol=1e-9)
    np.testing.assert_allclose(begin, matrix(ellipsoid.pose)[:3, 3])
    k = int(np.argmax(s.energy_share))
    share = f"{100 * s.energy_share[k] / s.kinetic_energy:.0f} %"
    assert text.text.splitlines() == [
        f"K {s.kinetic_energy:.3g} J, {share} of it {model.dof_names[k]}",
        f"{link}: {np.linalg.norm(v):.3g} m/s, reflected mass "
        f"{(v @ v) / (v @ mobility @ v):.3g} kg",
        "estimated velocities",
    ]
    assert arrow.action == Marker.ADD
    markers = drawn.show(qd=np.zeros(model.nv))
    assert markers["velocity"][0].action == markers["collision"][0].action == Marker.DELETE
    assert markers["text"][0].text == f"K 0 J, at rest\n{link}: 0 m/s\nestimated velocities"


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
def test_touched_link(link):
    """A ball marks a collision where Pinocchio has the centre of mass; the text has the link."""
    drawn = Drawn("ur5")
    robot = pin.buildModelFromUrdf(str(find_urdf("ur5")))
    data = robot.createData()
    joint = robot.frames[robot.getFrameId(link)].parentJoint
    pin.framesForwardKinematics(robot, data, drawn.q)
    for collision in (False, True):
        markers = drawn.show(watch := Watch(drawn, link, FORCE, collision))
        (ball,) = markers["collision"]
        lines = markers["text"][0].text.splitlines()
        assert (ball.action == Marker.ADD) == ("collision" in lines) == collision
        assert f"{link} (70 %)" in lines
        torque = watch.seen.external_torque
        k = int(np.argmax(np.abs(torque)))
        assert f"external torque {abs(torque[k]):.3g} N m at {drawn.model.dof_names[k]}" in lines
    center = data.oMi[joint].act(robot.inertias[joint].lever)
    np.testing.assert_allclose(vector(ball.pose.position), center, atol=1e-9)


@pytest.mark.parametrize(("collision", "known"), [(False, True), (True, False)])
def test_no_ball_without_a_collision_or_a_link(collision, known):
    drawn = Drawn("ur5")
    markers = drawn.show(Watch(drawn, "forearm_link", FORCE, collision, False, known))
    assert markers["collision"][0].action == Marker.DELETE
    assert ("collision" in markers["text"][0].text.splitlines()) == collision


def test_shapes_of_links(tmp_path):
    """An ellipsoid stands for a link without shapes, a cylinder is a capsule, viewers find
    meshes.
    """
    names = ("package:///arm/meshes/a.dae", "package://arm/b.dae", "hand.stl", "lost.stl")
    (tmp_path / "hand.stl").write_bytes(b"solid")
    shapes = [
        '<capsule radius="0.1" length="0.6"/>',
        *(f'<mesh filename="{name}"/>' for name in names),
    ]
    visuals = "".join(
        f'<visual><origin xyz="0 0 1"/><geometry>{shape}</geometry></visual>' for shape in shapes
    )
    path = tmp_path / "robot.urdf"
    path.write_text(f"""<robot name="bare"><link name="base"/><link name="bar"><inertial>
      <origin xyz="0.1 0.2 0.3"
    rpy="0.3 0.2 0.1"/><mass value="2"/>
      <inertia ixx="0.002" iyy="0.005" izz="0.006" ixy="0" ixz="0" iyz="0"/></inertial>
    </link><joint name="j" type="continuous"><parent link="base"/><child link="bar"/></joint>
      <link name="cap">{visuals}
    </link><joint name="f" type="fixed"><parent link="bar"/><child link="cap"/></joint></robot>""")
    model = dd.load_urdf(path)
    maker = MarkerMaker(dd.DiagonalDynamics(model), path)
    s = dd.DiagonalDynamics(model).evaluate(model.neutral, np.zeros(1))
    message = maker.message(s, RobotState(model.neutral, np.zeros(1), None, 0, 0, False))
    bar, cylinder, *meshes = by_space(message)["links"]
    assert [mesh.mesh_resource for mesh in meshes] == [
        "package://arm/meshes/a.dae",
        "package://arm/b.dae",
        (tmp_path / "hand.stl").as_uri(),
        "lost.stl",
    ]
    d = vector(bar.scale)
    X = matrix(bar.pose)
    R = pin.rpy.rpyToMatrix(0.3, 0.2, 0.1)
    inertia = (
        X[:3, :3] @ np.diag(0.1 * (d @ d - d**2)) @ X[:3, :3].T
    )  # of a solid ellipsoid, by its diameters
    np.testing.assert_allclose(inertia, R @ np.diag([0.002, 0.005, 0.006]) @ R.T, atol=1e-12)
    np.testing.assert_allclose(X[:3, 3], [0.1, 0.2, 0.3])
    assert cylinder.type == Marker.CYLINDER
    np.testing.assert_allclose(vector(cylinder.scale), [0.2, 0.2, 0.8])
    assert cylinder.pose.position.z == 1.0


# --- the topic


def test_topic(peer):
    """At no more than the highest rate, of the link that a parameter names."""
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
        assert text.startswith(f"K {energy.total:.3g} J, ") and " % of it panda_joint" in text
        assert "\npanda_hand: " in text
        refused = monitor.set_parameters({"markers.link": "nose"})
        assert not refused.successful
        assert "'nose', expected a link of robot 'panda'" in refused.reason
        monitor.set_parameter("markers.link", "panda_link7")
        monitor.serves(panda)
        assert "\npanda_link7: " in by_space(topic.messages[-1])["text"][0].text


def test_rviz_shows_the_markers():
    config = yaml.safe_load((ROOT / "config" / "diag_dynamics.rviz").read_text())
    displays = config["Visualization Manager"]["Displays"]
    (markers,) = (display for display in displays if display["Class"].endswith("MarkerArray"))
    assert markers["Enabled"] and markers["Topic"]["Value"] == "/diag_dynamics/markers"
