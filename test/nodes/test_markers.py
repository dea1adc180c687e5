# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Markers: each link where Pinocchio has it, tinted by its share, and everything else by the numbers that it stands for."""

import numpy as np
import pinocchio as pin
import pytest
from visualization_msgs.msg import Marker, MarkerArray

import diag_dynamics as dd
from diag_dynamics.control.observer import Disturbance
from diag_dynamics.joint_states.joints import RobotState
from diag_dynamics.model.example_robots import find_urdf
from diag_dynamics.nodes.monitor.markers import AHEAD, COLD, HOT, LASTING, LITTLE, MarkerMaker
from diag_dynamics.views.scene import Scene
from nodes import MS, PANDA, Monitor, S, nanoseconds, robot

ROBOTS = pytest.mark.parametrize(("name", "floating"), [("panda", False), ("ur5", False), ("go2", True)])


def made(name, floating=False, seed=0, watch=None, link="", effort=None):
    """Return dynamics, evaluation, RobotState, Scene, and markers by namespace."""
    model = dd.load_robot(name, floating_base=floating)
    dynamics, rng = dd.DiagonalDynamics(model), np.random.default_rng(seed)
    q, qd = model.random(rng), rng.normal(size=model.nv)
    s, state = dynamics.evaluate(q, qd, effort), RobotState(q, qd, effort, 5 * S + 7, 5 * S, False, True)
    scene = Scene(dynamics, find_urdf(name), link)
    return dynamics, s, state, scene, by_space(MarkerMaker(scene).message(s, state, watch))


def by_space(message):
    found = {}
    for marker in message.markers:
        found.setdefault(marker.ns, []).append(marker)
    return found


def matrix(pose):
    """Placement (4x4) of a pose."""
    p, r = pose.position, pose.orientation
    return pin.SE3(pin.Quaternion(r.w, r.x, r.y, r.z).matrix(), np.array([p.x, p.y, p.z])).homogeneous


def vector(x):
    return np.array([x.x, x.y, x.z])


@ROBOTS
def test_links_are_where_pinocchio_has_them(name, floating):
    """In the root link's axes, whatever turns the robot about; each marker of its kind, size and file."""
    dynamics, _, state, scene, markers = made(name, floating)
    model = pin.buildModelFromUrdf(str(find_urdf(name)), *([pin.JointModelFreeFlyer()] if floating else []))
    data, q, k = model.createData(), pin.neutral(model), 0
    assert [model.names[i] for i in range(1, model.njoints) if model.joints[i].nq == 1][:3]
    if floating:
        q[:7], k = state.position[:7], 7
    values = dict(zip(dynamics.model.coordinate_names[k:], state.position[k:], strict=True))
    for joint, mimic in dynamics.model.mimics.items():
        values[joint] = mimic.multiplier * values[mimic.leader] + mimic.offset
    for i in range(1, model.njoints):
        joint = model.joints[i]
        if joint.nq == 1:
            q[joint.idx_q] = values[model.names[i]]
        elif joint.nq == 2:  # a continuous joint
            q[joint.idx_q : joint.idx_q + 2] = np.cos(values[model.names[i]]), np.sin(values[model.names[i]])
    pin.framesForwardKinematics(model, data, q)
    root = data.oMf[model.getFrameId(dynamics.model.root_link)]
    assert len(markers["links"]) == len(scene.parts) > 7
    for part, marker in zip(scene.parts, markers["links"], strict=True):
        there = (root.inverse() * data.oMf[model.getFrameId(part.link)]).homogeneous @ part.placement
        assert np.allclose(matrix(marker.pose), there, atol=1e-9)
        assert vector(marker.scale) == pytest.approx(part.size)
        kind = {"mesh": Marker.MESH_RESOURCE, "box": Marker.CUBE, "sphere": Marker.SPHERE, "cylinder": Marker.CYLINDER}
        assert marker.type == kind[part.kind] and bool(marker.mesh_resource) == (part.kind == "mesh")
        assert marker.mesh_resource.startswith("package://") or not marker.mesh_resource
    assert len({(m.ns, m.id) for all_of in markers.values() for m in all_of}) == sum(map(len, markers.values()))


@ROBOTS
def test_headers_and_tints(name, floating):
    """The tint is the share of the joint that moves the link; every marker has stamp, frame and lifetime."""
    dynamics, s, _, scene, markers = made(name, floating)
    for marker in (one for several in markers.values() for one in several):
        assert nanoseconds(marker.header.stamp) == 5 * S + 7
        assert marker.header.frame_id == dynamics.model.root_link
        assert nanoseconds(marker.lifetime) == LASTING * S
        assert marker.color.a > 0.0
    joints = dict(zip(dynamics.model.dof_names, s.energy_share, strict=True))
    for part, marker in zip(scene.parts, markers["links"], strict=True):
        share = joints[dynamics.model.dof_names[part.dof]] if part.dof >= 0 else 0.0
        tint = COLD + share / (s.kinetic_energy + LITTLE) * (HOT - COLD)
        assert [marker.color.r, marker.color.g, marker.color.b] == pytest.approx(tint, abs=1e-6)


@ROBOTS
def test_ellipsoid_arrow_and_text(name, floating):
    dynamics, s, state, scene, markers = made(name, floating)
    model, q, qd, link = dynamics.model, state.position, state.velocity, scene.link
    root = dynamics.placement(q, model.root_link)[:3, :3]
    J = root.T @ dynamics.jacobian(q, link, frame="world")[:3]
    (ellipsoid,), (arrow,), (text,) = markers["ellipsoid"], markers["velocity"], markers["text"]
    R, half = matrix(ellipsoid.pose)[:3, :3], 0.5 * vector(ellipsoid.scale) / scene.scale
    expected = J @ np.linalg.solve(dynamics.mass_matrix(q), J.T)
    assert np.allclose(R @ np.diag(half**2) @ R.T, expected, rtol=1e-6, atol=1e-4 * expected.max())
    begin, end = map(vector, arrow.points)
    assert np.allclose((end - begin) / AHEAD, J @ qd, atol=1e-9) and arrow.action == Marker.ADD
    assert np.allclose(begin, matrix(ellipsoid.pose)[:3, 3])
    first, second, third = text.text.splitlines()
    k = int(np.argmax(s.energy_share))
    most = f"most of it {model.dof_names[k]}: {100 * s.energy_share[k] / s.kinetic_energy:.0f} %"
    assert first == f"K {s.kinetic_energy:.3g} J, {most}"
    v = J @ qd
    mass = (v @ v) / (v @ expected @ v)
    assert second == f"{link}: {np.linalg.norm(v):.3g} m/s, {mass:.3g} kg along it"
    assert third == "velocities are estimated"


def test_at_rest():
    """No arrow, no share, nothing that is not finite."""
    model = dd.load_robot("ur5")
    dynamics, zero = dd.DiagonalDynamics(model), np.zeros(model.nv)
    maker = MarkerMaker(Scene(dynamics, find_urdf("ur5")))
    s = dynamics.evaluate(model.neutral, zero)
    markers = by_space(maker.message(s, RobotState(model.neutral, zero, None, 0, 0, False)))
    assert markers["velocity"][0].action == markers["contact"][0].action == Marker.DELETE
    assert markers["text"][0].text == "K 0 J: at rest\nwrist_3_link: 0 m/s"
    moving = dynamics.evaluate(model.neutral, zero + 1.0)
    markers = by_space(maker.message(moving, RobotState(model.neutral, zero + 1.0, None, 0, 0, False)))
    assert markers["velocity"][0].action == Marker.ADD


class Watch:
    """What a TorqueWatch has seen."""

    def __init__(self, residual, torque, collision):
        self.seen = Disturbance(True, "", residual, torque, float(np.linalg.norm(residual)), collision)


@pytest.mark.parametrize("link", ["upper_arm_link", "forearm_link", "wrist_2_link"])
def test_contact_is_at_the_link_that_is_pushed(link):
    """By ε of the push, which joints outboard of the link have none of."""
    dynamics, _, state, scene, _ = made("ur5")
    q = state.position
    epsilon = dynamics.epsilon_from_wrench(q, link, [30.0, -20.0, 9.0, 0, 0, 0], [0.05, 0.05, 0.15])
    torque = dynamics.tau_from_epsilon(q, epsilon)
    s = dynamics.evaluate(q, state.velocity)
    for collision in (True, False):
        markers = by_space(MarkerMaker(scene).message(s, state, Watch(epsilon, torque, collision)))
        (contact,), lines = markers["contact"], markers["text"][0].text.splitlines()
        k = int(np.argmax(np.abs(torque)))
        assert f"external torque {abs(torque[k]):.3g} N m at {dynamics.model.dof_names[k]}" in lines
        assert (contact.action == Marker.ADD) == (f"contact at {link}" in lines) == collision
    markers = by_space(MarkerMaker(scene).message(s, state, Watch(epsilon, torque, True)))
    assert np.allclose(vector(markers["contact"][0].pose.position), dynamics.placement(q, link)[:3, 3])


# --- scenes


def test_links_without_a_shape_show_their_inertia():
    """As the solid ellipsoid that has it; a capsule is a cylinder and two spheres."""
    text = """<robot name="bare"><link name="base"/><link name="bar"><inertial><origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/>
    <mass value="2"/><inertia ixx="0.02" iyy="0.05" izz="0.06" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="j" type="continuous"><origin xyz="1 0 0" rpy="0 1 0"/><parent link="base"/><child link="bar"/><axis
    xyz="0 1 0"/></joint><link name="cap"><visual><origin xyz="0 0 1"/><geometry><capsule radius="0.1" length="0.6"/>
    </geometry></visual></link><joint name="f" type="fixed"><parent link="bar"/><child link="cap"/></joint></robot>"""
    dynamics = dd.DiagonalDynamics(dd.load_urdf(text))
    scene = Scene(dynamics, text)
    bar, cylinder, low, high = scene.parts
    d = np.array(bar.size)
    inertia = 2.0 / 20.0 * (d @ d - d**2)  # of a solid ellipsoid, by its diameters
    assert (bar.kind, sorted(inertia)) == ("sphere", pytest.approx([0.02, 0.05, 0.06]))
    assert bar.placement[:3, 3] == pytest.approx([0.1, 0.2, 0.3])
    about = bar.placement[:3, :3] @ np.diag(inertia) @ bar.placement[:3, :3].T
    R = pin.rpy.rpyToMatrix(0.3, 0.2, 0.1)
    assert np.allclose(about, R @ np.diag([0.02, 0.05, 0.06]) @ R.T)
    assert (cylinder.kind, cylinder.size) == ("cylinder", (0.2, 0.2, 0.6))
    assert [part.placement[2, 3] for part in (low, high)] == pytest.approx([0.7, 1.3])
    assert {part.dof for part in scene.parts} == {0}


def test_meshes_are_named_for_viewers(tmp_path):
    """A package stays one, without a third slash; a relative path becomes a whole one."""
    (tmp_path / "hand.stl").write_bytes(b"solid")
    urdf = tmp_path / "robot.urdf"
    shapes = "".join(
        f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
        for name in ("package:///arm/meshes/a.dae", "package://arm/b.dae", "hand.stl", "lost.stl")
    )
    urdf.write_text(f'<robot name="r"><link name="base">{shapes}</link></robot>')
    scene = Scene(dd.DiagonalDynamics(dd.load_urdf(urdf)), urdf)
    assert [part.file for part in scene.parts] == [
        *("package://arm/meshes/a.dae", "package://arm/b.dae", (tmp_path / "hand.stl").as_uri(), "lost.stl")
    ]


@pytest.mark.parametrize(("name", "link"), [("panda", "panda_hand"), ("ur5", "wrist_3_link")])
def test_the_ellipsoid_is_at_the_end_effector_link(name, link):
    model = dd.load_robot(name)
    assert Scene(dd.DiagonalDynamics(model), find_urdf(name)).link == link
    assert Scene(dd.DiagonalDynamics(model), find_urdf(name), model.link_names[3]).link == model.link_names[3]
    with pytest.raises(dd.InputError, match="'nose' is not a link of robot"):
        Scene(dd.DiagonalDynamics(model), find_urdf(name), "nose")


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
        assert text.startswith(f"K {energy.total:.3g} J, most of it panda_joint")
        assert "\npanda_hand: " in text
        refused = monitor.set_parameters({"markers.link": "nose"})
        assert not refused.successful
        assert "'nose', which is no link of robot 'panda'" in refused.reason
        monitor.set_parameter("markers.link", "panda_link7")
        monitor.serves(panda)
        assert "\npanda_link7: " in by_space(topic.messages[-1])["text"][0].text
