# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inertias estimated from geometry: against closed forms, points thrown at random, and Pinocchio reading what was written."""

import pickle
import struct
import sys
import warnings

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree

import diag_dynamics as dd
from diag_dynamics.model.estimation import estimated
from diag_dynamics.model.geometry import Shape, shapes_of, solid_of, united
from diag_dynamics.model.meshes import Meshes, find_mesh
from diag_dynamics.model.options import inertias_told
from robots import robot_path

BOX = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
"""Corners of the unit cube in the first octant."""

FACES = [
    *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
    *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
]
"""Its triangles, seen from outside counterclockwise."""


def stl(path, corners, faces):
    """Write a binary STL by hand."""
    triangles = np.asarray(corners, dtype="<f4")[np.array(faces)]
    records = b"".join(struct.pack("<12f", 0, 0, 0, *triangle.ravel()) + b"\0\0" for triangle in triangles)
    path.write_bytes(bytes(80) + struct.pack("<I", len(triangles)) + records)
    return path


def placed(rpy, xyz):
    placement = np.eye(4)
    placement[:3, :3], placement[:3, 3] = pin.rpy.rpyToMatrix(*rpy), xyz
    return placement


def solid(kind, numbers, placement=None, file="", folder=None):
    return solid_of(Shape(kind, numbers, np.eye(4) if placement is None else placement, file), Meshes(folder))


def close(a, b, tolerance=1e-12):
    np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance * np.abs(b).max())


# --- What shapes enclose


def inside(kind, numbers, points):
    """Whether points are within a primitive: its definition."""
    x, y, z = points.T
    if kind == "box":
        return (np.abs(points) <= 0.5 * np.array(numbers)).all(axis=1)
    if kind == "sphere":
        return x**2 + y**2 + z**2 <= numbers[0] ** 2
    radius, length = numbers
    if kind == "cylinder":
        return (x**2 + y**2 <= radius**2) & (np.abs(z) <= 0.5 * length)
    return x**2 + y**2 + np.maximum(np.abs(z) - 0.5 * length, 0.0) ** 2 <= radius**2


@pytest.mark.parametrize(
    ("kind", "numbers"),
    [("box", (0.2, 0.5, 0.9)), ("sphere", (0.3,)), ("cylinder", (0.2, 0.7)), ("capsule", (0.2, 0.5))],
)
def test_primitives_against_points_thrown_at_random(kind, numbers):
    """A million points in a box around it: volume and second moments to 0.5 %."""
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (1_000_000, 3))
    hit = points[inside(kind, numbers, points)]
    share = len(hit) / len(points)
    found = solid(kind, numbers)
    assert found.volume == pytest.approx(share, rel=5e-3)
    second = share * (hit.T @ hit) / len(hit)
    close(found.inertia, np.trace(second) * np.eye(3) - second, 5e-3)
    assert (np.abs(hit) <= np.abs(found.corners).max(axis=0)).all()


def test_placements():
    """A solid far off and turned: Pinocchio's inertia of the same box, moved by Pinocchio."""
    placement = placed((0.3, -0.7, 1.9), (1.0, 2.0, -3.0))
    found = solid("box", (0.2, 0.5, 0.9), placement)
    box = pin.Inertia.FromBox(0.09, 0.2, 0.5, 0.9).se3Action(pin.SE3(placement))
    close(found.centre, box.lever)
    close(found.inertia, box.inertia)
    twice = united([found, solid("cylinder", (0.1, 0.3))])
    both = box + pin.Inertia.FromCylinder(np.pi * 0.1**2 * 0.3, 0.1, 0.3)
    assert twice.volume == pytest.approx(both.mass, rel=1e-12)
    close(twice.centre, both.lever)
    close(twice.inertia, both.inertia)


def test_meshes_against_closed_forms(tmp_path):
    """A box of triangles, and a tetrahedron whose moments the simplex formula gives; scaled, mirrored, inside out."""
    stl(tmp_path / "box.stl", BOX * (0.2, 0.5, 1.0), FACES)
    for scale in ((1.0, 1.0, 1.0), (2.0, 1.0, 0.5), (-1.0, 1.0, 1.0)):
        size = np.array([0.2, 0.5, 1.0]) * np.abs(scale)
        found = solid("mesh", scale, file="box.stl", folder=tmp_path)
        expected = solid("box", tuple(size))
        assert found.volume == pytest.approx(expected.volume, rel=1e-6) and found.of == ("box.stl",)
        close(found.centre, 0.5 * size * np.sign(scale), 1e-6)
        close(found.inertia, expected.inertia, 1e-6)
    stl(tmp_path / "inward.stl", BOX, [face[::-1] for face in FACES])
    assert solid("mesh", (1.0,) * 3, file="inward.stl", folder=tmp_path).volume == pytest.approx(1.0, rel=1e-6)

    corners = np.array([[0, 0, 0], [0.3, 0, 0.1], [0, 0.4, 0], [0.1, 0.1, 0.5]])
    stl(tmp_path / "tetrahedron.stl", corners, [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)])
    found = solid("mesh", (1.0,) * 3, file="tetrahedron.stl", folder=tmp_path)
    volume = abs(np.linalg.det(corners[1:] - corners[0])) / 6.0
    centre = corners.mean(axis=0)
    second = volume / 20.0 * sum(np.outer(c, c) for c in corners - centre)  # of a simplex, about its centre
    assert found.volume == pytest.approx(volume, rel=1e-6)
    close(found.centre, centre, 1e-6)
    close(found.inertia, np.trace(second) * np.eye(3) - second, 1e-6)


def test_open_meshes_are_measured_by_their_hull(tmp_path):
    stl(tmp_path / "open.stl", BOX, FACES[2:])
    found = solid("mesh", (1.0,) * 3, file="open.stl", folder=tmp_path)
    assert found.volume == pytest.approx(1.0, rel=1e-6) and found.of == ("convex hull of open.stl",)
    stl(tmp_path / "flat.stl", BOX, FACES[:2])
    with pytest.raises(dd.UrdfError, match=r"flat\.stl encloses no volume"):
        solid("mesh", (1.0,) * 3, file="flat.stl", folder=tmp_path)
    for name, said in (("none.stl", "has no surface"), ("none.dae", "cannot be read: ")):
        (tmp_path / name).write_bytes(b"no mesh")
        with pytest.raises(dd.UrdfError, match=f"mesh '{name}' {said}"):
            solid("mesh", (1.0,) * 3, file=name, folder=tmp_path)


def test_a_collada_file_may_be_in_centimetres(tmp_path):
    collada = pytest.importorskip("collada", reason="pycollada is not installed")
    document = collada.Collada()
    document.assetInfo.unitmeter, document.assetInfo.unitname = 0.01, "centimeter"
    source = collada.source.FloatSource("v", 100.0 * BOX.ravel(), ("X", "Y", "Z"))
    geometry = collada.geometry.Geometry(document, "box", "box", [source])
    inputs = collada.source.InputList()
    inputs.addInput(0, "VERTEX", "#v")
    geometry.primitives.append(geometry.createTriangleSet(np.array(FACES).ravel(), inputs, "material"))
    document.geometries.append(geometry)
    node = collada.scene.Node("node", children=[collada.scene.GeometryNode(geometry)])
    document.scenes.append(collada.scene.Scene("scene", [node]))
    document.scene = document.scenes[0]
    document.write(str(tmp_path / "box.dae"))
    assert solid("mesh", (1.0,) * 3, file="box.dae", folder=tmp_path).volume == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize(
    ("shape", "said"),
    [
        ('<box size="1 2"/>', "<box size='1 2'> is not 3"),
        ('<cylinder radius="-1" length="1"/>', "<cylinder radius='-1'> is not 1"),
        ('<cone radius="1"/>', "<cone> is no shape"),
        ("<mesh/>", "no filename"),
        ('<mesh filename="a.stl" scale="1 1 0"/>', "scale='1 1 0'"),
    ],
)
def test_shapes_that_are_none(shape, said):
    link = etree.fromstring(f'<link name="arm"><visual><geometry>{shape}</geometry></visual></link>')
    with pytest.raises(dd.UrdfError, match="link 'arm': visual") as error:
        shapes_of(link, "visual")
    assert said in str(error.value)


# --- Where meshes are


def test_where_meshes_are(tmp_path, monkeypatch):
    """Every way in which URDFs name them; a package around the URDF, or where ROS has packages."""
    for name in ("AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH"):
        monkeypatch.delenv(name, raising=False)
    urdf, mesh = tmp_path / "robots/arm/urdf", tmp_path / "robots/arm/meshes/a.stl"
    for folder in (urdf, mesh.parent):
        folder.mkdir(parents=True)
    mesh.touch()
    for name in (
        *("package://arm/meshes/a.stl", "package:///arm/meshes/a.stl", "model://arm/meshes/a.stl"),
        *(
            "package://robots/arm/meshes/a.stl",
            "../meshes/a.stl",
            "file://../meshes/a.stl",
            f"file://{mesh}",
            str(mesh),
        ),
    ):
        assert find_mesh(name, urdf).resolve() == mesh
    for name in (
        "package://leg/meshes/a.stl",
        "meshes/a.stl",
        "file:///meshes/a.stl",
        "https://x.org/a.stl",
        "package://arm",
    ):
        with pytest.raises(dd.UrdfError, match=r"cannot be found|is no file"):
            find_mesh(name, urdf)
    with pytest.raises(dd.UrdfError, match="relative path"):
        find_mesh("a.stl", None)
    for variable, path in (
        ("ROS_PACKAGE_PATH", tmp_path / "robots"),
        ("ROS_PACKAGE_PATH", tmp_path / "robots/arm"),
        ("AMENT_PREFIX_PATH", tmp_path / "install"),
    ):
        (tmp_path / "install").mkdir(exist_ok=True)
        if not (tmp_path / "install/share").exists():
            (tmp_path / "install/share").symlink_to(tmp_path / "robots")
        with monkeypatch.context() as context:
            context.setenv(variable, str(path))
            assert find_mesh("package://arm/meshes/a.stl", None).resolve() == mesh


def test_example_robots_have_their_meshes():
    """Talos names them with three slashes."""
    for robot in ("panda_description/urdf/panda.urdf", "talos_data/robots/talos_reduced.urdf"):
        path = robot_path(robot)
        names = {mesh.get("filename") for mesh in etree.parse(path).iter("mesh")}
        assert len(names) > 10 and all(find_mesh(name, path.parent).is_file() for name in names)


# --- Robots without inertias

BARE = """<robot name="bare">
  <!-- of a catalogue -->
  <link name="base"><visual><geometry><box size="1 1 0.1"/></geometry></visual></link>
  <link name="upper">
    <visual><geometry><sphere radius="9"/></geometry></visual>
    <collision><origin xyz="0.2 0 0" rpy="0 1.5707963267948966 0"/>
      <geometry><cylinder radius="0.05" length="0.4"/></geometry></collision>
  </link>
  <link name="lower">
    <visual><origin xyz="0 0 -0.1"/><geometry><box size="0.1 0.2 0.3"/></geometry></visual>
    <visual><geometry><mesh filename="b--ox.stl"/></geometry></visual>
  </link>
  <link name="given">
    <inertial><mass value="2"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="1 1 1"/></geometry></collision>
  </link>
  <link name="frame"/>
  <joint name="a" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit effort="9" velocity="1"/></joint>
  <joint name="b" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
    <limit effort="9" velocity="1"/></joint>
  <joint name="c" type="fixed"><parent link="lower"/><child link="given"/><origin xyz="0 0 -0.3"/></joint>
  <joint name="d" type="fixed"><parent link="given"/><child link="frame"/></joint>
</robot>
"""


@pytest.fixture
def bare(tmp_path):
    stl(tmp_path / "b--ox.stl", BOX * (0.1, 0.1, 0.1), FACES)
    path = tmp_path / "bare.urdf"
    path.write_text(BARE)
    return path


def estimating(source, **options):
    with pytest.warns(dd.InertiaWarning) as warned:
        return dd.load_urdf(source, **options), [str(one.message) for one in warned]


def test_estimated_inertias(bare):
    """Links with geometry and without <inertial>, and only these: mass matrix against Pinocchio's sums of primitives."""
    model, (said,) = estimating(bare, estimate_inertias=500.0)
    assert model.estimated_links == ("base", "upper", "lower")
    assert (
        "estimated" in said
        and all(f"'{name}'" in said for name in model.estimated_links)
        and "given" not in said
        and "500 kg/m³" in said
    )
    cube = pin.Inertia(1.0, np.full(3, 0.05), np.eye(3) * 0.01 / 6.0)
    lower = pin.Inertia.FromBox(0.006, 0.1, 0.2, 0.3).se3Action(pin.SE3(placed((0, 0, 0), (0, 0, -0.1))))
    lower += pin.Inertia(0.001 * cube.mass, cube.lever, 0.001 * cube.inertia)
    given = pin.Inertia(2.0, np.array([0, 0, -0.3]), 0.1 * np.eye(3))
    cylinder = pin.Inertia.FromCylinder(np.pi * 0.05**2 * 0.4, 0.05, 0.4)
    upper = cylinder.se3Action(pin.SE3(placed((0, np.pi / 2, 0), (0.2, 0, 0))))
    reference = pin.Model()
    for inertia, at, joint, name in ((upper, 0, pin.JointModelRZ(), "a"), (lower, 0.4, pin.JointModelRY(), "b")):
        k = reference.addJoint(reference.njoints - 1, joint, pin.SE3(np.eye(3), np.array([at, 0.0, 0.0])), name)
        heavy = pin.Inertia(500.0 * inertia.mass, inertia.lever, 500.0 * inertia.inertia)
        reference.appendBodyToJoint(k, heavy + given if name == "b" else heavy, pin.SE3.Identity())
    for q in np.random.default_rng(0).uniform(-3, 3, (5, 2)):
        M = pin.crba(reference, reference.createData(), q)
        M = np.triu(M) + np.triu(M, 1).T
        close(dd.DiagonalDynamics(model).mass_matrix(q), M, 1e-6)  # the cube's corners are in single precision


def test_the_model_keeps_knowing(bare):
    """Through changes and pickles, and a model without estimates has none; whoever listens for warnings gets this one."""
    model, _ = estimating(bare, estimate_inertias=500.0)
    for other in (
        pickle.loads(pickle.dumps(model)),
        model.with_locked_joints({"b": 0.1}),
        model.with_payload("upper", 1.0),
    ):
        assert other.estimated_links == model.estimated_links
    assert dd.load_robot("panda").estimated_links == ()
    told = []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with inertias_told(told.append):
            dd.load_urdf(bare, estimate_inertias=500.0)
        dd.load_robot("panda", estimate_inertias=500.0)  # nothing is estimated, and nothing told
    assert len(told) == 1


def test_what_is_written_is_what_is_loaded(bare, tmp_path):
    """Bit for bit; Pinocchio, which reads the file itself, has the same mass matrix; all else of the file stays."""
    found = estimated(BARE, 500.0, bare.parent)
    new = tmp_path / "elsewhere" / "new.urdf"
    new.parent.mkdir()
    new.write_text(found.text)
    model, _ = estimating(bare, estimate_inertias=500.0)
    written = dd.load_urdf(new)
    assert model.bodies.tobytes() == written.bodies.tobytes() and model.links.tobytes() == written.links.tobytes()
    reference = pin.buildModelFromUrdf(str(new))
    for q in np.random.default_rng(0).uniform(-3, 3, (5, 2)):
        M = pin.crba(reference, reference.createData(), q)
        close(dd.DiagonalDynamics(model).mass_matrix(q), np.triu(M) + np.triu(M, 1).T, 1e-12)
    assert "<!-- of a catalogue -->" in found.text
    assert "estimated by diag_dynamics from collision cylinder at 500 kg/m3 -->" in found.text
    assert "estimated by diag_dynamics from visual box + b- -ox.stl at 500 kg/m3 -->" in found.text
    tree, before = etree.fromstring(found.text), etree.fromstring(BARE)
    for link in tree.iter("link"):
        first = link.find("inertial")
        if first is not None and isinstance(first[0], etree._Comment):
            link.remove(first)
    assert [e.attrib for e in tree.iter(etree.Element)] == [e.attrib for e in before.iter(etree.Element)]
    again = estimated(found.text, 500.0, bare.parent)
    assert again.estimates == () and again.text == found.text


def test_example_robots_without_their_inertias():
    """Real meshes: the estimates of a Panda at 1000 kg/m³ have a mass like that of the given ones."""
    path = robot_path("panda_description/urdf/panda.urdf")
    tree = etree.parse(path)
    given = {}
    for link in tree.iter("link"):
        if (inertial := link.find("inertial")) is not None:
            given[link.get("name")] = float(inertial.find("mass").get("value"))
            link.remove(inertial)
    text = etree.tostring(tree, encoding="unicode")
    found = estimated(text, 1000.0, path.parent)
    assert not found.failed
    masses = {estimate.link: estimate.mass for estimate in found.estimates}
    assert 0.5 < sum(masses.values()) / sum(given.values()) < 2.0
    written = dd.load_urdf(found.text)
    assert written.total_mass == pytest.approx(sum(masses.values()), rel=1e-12)


def test_what_cannot_be_estimated_is_named(tmp_path):
    """A collision mesh that is lost: the visual stands in for it; a link without any that can be measured stays as it is."""
    text = BARE.replace('<cylinder radius="0.05" length="0.4"/>', '<mesh filename="lost.stl"/>')
    (tmp_path / "bare.urdf").write_text(text)
    model, (said,) = estimating(tmp_path / "bare.urdf", estimate_inertias=500.0)
    assert (
        model.estimated_links == ("base", "upper") and "No inertia could be estimated of 'lower' (mesh 'b--ox" in said
    )
    found = estimated(text, 500.0, tmp_path)
    assert [(one.link, one.source) for one in found.estimates] == [("base", "visual box"), ("upper", "visual sphere")]
    assert list(found.failed) == ["lower"]


@pytest.mark.parametrize("density", [0.0, -1.0, np.nan, np.inf, "1000", True, 1e6, [1000.0]])
def test_bad_densities(density, bare):
    with pytest.raises(dd.InputError, match="estimate_inertias"):
        dd.load_urdf(bare, estimate_inertias=density)


def test_other_formats_have_no_estimates():
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    with pytest.raises(dd.InputError, match="estimate_inertias is what the MJCF says"):
        dd.load_mjcf("<mujoco/>", estimate_inertias=1000.0)


def test_without_trimesh(bare, monkeypatch):
    """Primitives need nothing; a mesh says what to install."""
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(dd.InputError, match=r"b--ox\.stl' needs trimesh.*pip install"):
        dd.load_urdf(bare, estimate_inertias=500.0)
    bare.write_text(BARE.replace('<mesh filename="b--ox.stl"/>', '<box size="0.1 0.1 0.1"/>'))
    assert len(estimating(bare, estimate_inertias=500.0)[0].estimated_links) == 3
