# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Geometry of links against closed forms and Pinocchio, and the files of meshes."""

import struct

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree

import diag_dynamics as dd
from diag_dynamics.description.geometry import Shape, shapes_of, solid_of, united
from diag_dynamics.description.meshes import Meshes, find_mesh

BOX = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
"""Corners of the unit cube in the first octant."""

FACES = [
    (0, 1, 3),
    (0, 3, 2),
    (4, 6, 7),
    (4, 7, 5),
    (0, 4, 5),
    (0, 5, 1),
    (2, 3, 7),
    (2, 7, 6),
    (0, 2, 6),
    (0, 6, 4),
    (1, 5, 7),
    (1, 7, 3),
]
"""Its triangles, seen from outside counterclockwise."""


def stl(path, corners, faces):
    """Write a binary STL by hand."""
    triangles = np.asarray(corners, dtype="<f4")[np.array(faces)]
    records = b"".join(
        struct.pack("<12f", 0, 0, 0, *triangle.ravel()) + b"\0\0" for triangle in triangles
    )
    path.write_bytes(bytes(80) + struct.pack("<I", len(triangles)) + records)
    return path


def placed(rpy, xyz):
    placement = np.eye(4)
    placement[:3, :3] = pin.rpy.rpyToMatrix(*rpy)
    placement[:3, 3] = xyz
    return placement


def solid(kind, numbers, placement=None, file="", folder=None):
    return solid_of(
        Shape(kind, numbers, np.eye(4) if placement is None else placement, file), Meshes(folder)
    )


def close(a, b, tolerance=1e-12):
    np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance * np.abs(b).max())


# --- Solids


PRIMITIVES = {
    "box": (pin.Inertia.FromBox, (0.2, 0.5, 0.9), 0.2 * 0.5 * 0.9, (0.1, 0.25, 0.45)),
    "sphere": (pin.Inertia.FromSphere, (0.3,), np.pi * 4 / 3 * 0.3**3, (0.3, 0.3, 0.3)),
    "cylinder": (pin.Inertia.FromCylinder, (0.2, 0.7), np.pi * 0.2**2 * 0.7, (0.2, 0.2, 0.35)),
    "capsule": (
        pin.Inertia.FromCapsule,
        (0.2, 0.5),
        np.pi * 0.2**2 * (0.5 + 4 / 3 * 0.2),
        (0.2, 0.2, 0.45),
    ),
}


@pytest.mark.parametrize("kind", PRIMITIVES)
def test_primitives_against_pinocchio(kind):
    reference, numbers, volume, reach = PRIMITIVES[kind]
    result = solid(kind, numbers)
    expected = reference(volume, *numbers)
    assert result.body.mass == pytest.approx(volume, rel=1e-12)
    assert np.abs(result.body.centre).max() < 1e-15
    close(result.body.inertia, expected.inertia)
    assert (np.abs(result.corners).max(axis=0) >= np.array(reach) - 1e-12).all()


def test_placements_against_pinocchio():
    placement = placed((0.3, -0.7, 1.9), (1.0, 2.0, -3.0))
    result = solid("box", (0.2, 0.5, 0.9), placement)
    box = pin.Inertia.FromBox(0.09, 0.2, 0.5, 0.9).se3Action(pin.SE3(placement))
    close(result.body.centre, box.lever)
    close(result.body.inertia, box.inertia)
    twice = united([result, solid("cylinder", (0.1, 0.3))])
    both = box + pin.Inertia.FromCylinder(np.pi * 0.1**2 * 0.3, 0.1, 0.3)
    assert twice.body.mass == pytest.approx(both.mass, rel=1e-12)
    close(twice.body.centre, both.lever)
    close(twice.body.inertia, both.inertia)


def mesh(folder, name, scale=(1.0, 1.0, 1.0)):
    return solid("mesh", scale, file=name, folder=folder)


def test_meshes_against_closed_forms(tmp_path):
    """A box that is scaled, mirrored or inside out; a tetrahedron, by the moments of a simplex."""
    size = np.array([0.2, 0.5, 1.0])
    stl(tmp_path / "box.stl", BOX * size, FACES)
    for scale in ((1.0, 1.0, 1.0), (2.0, 1.0, 0.5), (-1.0, 1.0, 1.0)):
        result = mesh(tmp_path, "box.stl", scale)
        expected = solid("box", tuple(size * np.abs(scale)))
        assert result.body.mass == pytest.approx(expected.body.mass, rel=1e-6) and result.of == (
            "box.stl",
        )
        close(result.body.centre, 0.5 * size * scale, 1e-6)
        close(result.body.inertia, expected.body.inertia, 1e-6)
    stl(tmp_path / "inward.stl", BOX, [face[::-1] for face in FACES])
    assert mesh(tmp_path, "inward.stl").body.mass == pytest.approx(1.0, rel=1e-6)

    corners = np.array([[0, 0, 0], [0.3, 0, 0.1], [0, 0.4, 0], [0.1, 0.1, 0.5]])
    stl(tmp_path / "tetrahedron.stl", corners, [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)])
    result = mesh(tmp_path, "tetrahedron.stl")
    volume = abs(np.linalg.det(corners[1:] - corners[0])) / 6.0
    centre = corners.mean(axis=0)
    second = volume / 20.0 * sum(np.outer(c, c) for c in corners - centre)
    assert result.body.mass == pytest.approx(volume, rel=1e-6)
    close(result.body.centre, centre, 1e-6)
    close(result.body.inertia, np.trace(second) * np.eye(3) - second, 1e-6)


def test_open_and_damaged_meshes(tmp_path):
    """An open mesh has the volume of its convex hull."""
    stl(tmp_path / "open.stl", BOX, FACES[2:])
    result = mesh(tmp_path, "open.stl")
    assert result.body.mass == pytest.approx(1.0, rel=1e-6) and result.of == (
        "convex hull of open.stl",
    )
    stl(tmp_path / "flat.stl", BOX, FACES[:2])
    (tmp_path / "none.stl").write_bytes(b"no mesh")
    (tmp_path / "none.dae").write_bytes(b"no mesh")
    (tmp_path / "lfs.stl").write_bytes(
        b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 12\n"
    )
    keys = {
        "flat.stl": "no volume",
        "none.stl": "no surface",
        "none.dae": "cannot be read",
        "lfs.stl": "git lfs pull",
    }
    for name, key in keys.items():
        with pytest.raises(dd.UrdfError, match=f"{name}.* {key}"):
            mesh(tmp_path, name)


def test_collada_in_centimetres(tmp_path):
    import collada

    document = collada.Collada()
    document.assetInfo.unitmeter = 0.01
    document.assetInfo.unitname = "centimeter"
    source = collada.source.FloatSource("v", 100.0 * BOX.ravel(), ("X", "Y", "Z"))
    geometry = collada.geometry.Geometry(document, "box", "box", [source])
    inputs = collada.source.InputList()
    inputs.addInput(0, "VERTEX", "#v")
    geometry.primitives.append(
        geometry.createTriangleSet(np.array(FACES).ravel(), inputs, "material")
    )
    document.geometries.append(geometry)
    node = collada.scene.Node("node", children=[collada.scene.GeometryNode(geometry)])
    document.scenes.append(collada.scene.Scene("scene", [node]))
    document.scene = document.scenes[0]
    document.write(str(tmp_path / "box.dae"))
    assert mesh(tmp_path, "box.dae").body.mass == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize(
    ("shape", "key"),
    [
        ('<box size="1 2"/>', "size='1 2'"),
        ('<cylinder radius="-1" length="1"/>', "radius='-1'"),
        ('<cone radius="1"/>', "<cone>"),
        ('<sphere radius="1e31"/>', "radius='1e31'"),
        ("<mesh/>", "no filename"),
        ('<mesh filename="a.stl" scale="1 1 0"/>', "scale='1 1 0'"),
    ],
)
def test_wrong_shapes(shape, key):
    link = etree.fromstring(
        f'<link name="arm"><visual><geometry>{shape}</geometry></visual></link>'
    )
    with pytest.raises(dd.UrdfError, match="link 'arm': visual") as error:
        shapes_of(link, "visual")
    assert key in str(error.value)


# --- Paths of meshes

VALID = (
    "package://arm/meshes/a.stl",
    "package:///arm/meshes/a.stl",
    "model://arm/meshes/a.stl",
    "package://robots/arm/meshes/a.stl",
    "../meshes/a.stl",
    "file://../meshes/a.stl",
    "file://{mesh}",
    "{mesh}",
)
LOST = (
    "package://leg/meshes/a.stl",
    "meshes/a.stl",
    "file:///meshes/a.stl",
    "https://x.org/a.stl",
    "package://arm",
)


def test_paths_of_meshes(tmp_path, monkeypatch):
    """A package is a folder around the URDF, or one of ROS."""
    urdf = tmp_path / "robots/arm/urdf"
    file = tmp_path / "robots/arm/meshes/a.stl"
    for folder in (urdf, file.parent, tmp_path / "install"):
        folder.mkdir(parents=True)
    file.touch()
    (tmp_path / "install/share").symlink_to(tmp_path / "robots")
    for name in ("AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH"):
        monkeypatch.delenv(name, raising=False)
    for name in VALID:
        assert find_mesh(name.format(mesh=file), urdf).resolve() == file
    for name, folder in (*((name, urdf) for name in LOST), ("a.stl", None)):
        with pytest.raises(dd.UrdfError, match="cannot be found"):
            find_mesh(name, folder)
    for variable, path in (
        ("ROS_PACKAGE_PATH", "robots"),
        ("ROS_PACKAGE_PATH", "robots/arm"),
        ("AMENT_PREFIX_PATH", "install"),
    ):
        with monkeypatch.context() as context:
            context.setenv(variable, str(tmp_path / path))
            assert find_mesh("package://arm/meshes/a.stl", None).resolve() == file
