# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Geometry of links against closed forms and Pinocchio, and the files of meshes."""

import struct

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree

import diag_dynamics as dd
from diag_dynamics.description.geometry import Shape, corners_of, shapes_of
from diag_dynamics.description.mesh_files import Meshes, find_mesh

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


def corners(kind, numbers, placement=None, file="", folder=None):
    return corners_of(
        Shape(kind, numbers, np.eye(4) if placement is None else placement, file), Meshes(folder)
    )


def close(a, b, tolerance=1e-12):
    np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance * np.abs(b).max())


# --- Boxes around shapes


PRIMITIVES = {
    "box": ((0.2, 0.5, 0.9), (0.1, 0.25, 0.45)),
    "sphere": ((0.3,), (0.3, 0.3, 0.3)),
    "cylinder": ((0.2, 0.7), (0.2, 0.2, 0.35)),
    "capsule": ((0.2, 0.5), (0.2, 0.2, 0.45)),
}


@pytest.mark.parametrize("kind", PRIMITIVES)
def test_primitives(kind):
    numbers, half = PRIMITIVES[kind]
    placement = placed((0.3, -0.7, 1.9), (1.0, 2.0, -3.0))
    expected = [
        placement[:3, :3] @ (corner * half) + placement[:3, 3] for corner in 2.0 * BOX - 1.0
    ]
    close(corners(kind, numbers, placement), np.array(expected))


def mesh(folder, name, scale=(1.0, 1.0, 1.0)):
    return corners("mesh", scale, file=name, folder=folder)


def test_scaled_and_mirrored_meshes(tmp_path):
    size = np.array([0.2, 0.5, 1.0])
    stl(tmp_path / "box.stl", BOX * size, FACES)
    for scale in ((1.0, 1.0, 1.0), (2.0, 1.0, 0.5), (-1.0, 1.0, 1.0)):
        close(mesh(tmp_path, "box.stl", scale), BOX * size * scale, 1e-6)


def test_damaged_meshes(tmp_path):
    (tmp_path / "none.stl").write_bytes(b"no mesh")
    (tmp_path / "none.dae").write_bytes(b"no mesh")
    (tmp_path / "lfs.stl").write_bytes(
        b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 12\n"
    )
    keys = {
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
    close(mesh(tmp_path, "box.dae"), BOX, 1e-6)


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
