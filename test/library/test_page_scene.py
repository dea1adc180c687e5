# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The scene of a robot: what its URDF draws, where its meshes are, and ellipsoids where they are not."""

import json
import struct
import sys

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.page.meshes import MeshLibrary
from diag_dynamics.page.scene import mesh_folders, scene_of
from robots import description, joint, link, robot_path

trimesh = pytest.importorskip("trimesh")

PANDA, TALOS = "panda_description/urdf/panda.urdf", "talos_data/robots/talos_reduced.urdf"

BLOCK = (1.2, (0.1, 0.0, 0.2), (0.05, 0.0, 0.0, 0.06, 0.0, 0.03))


def visual(geometry, more="", xyz="0 0 0"):
    return f'<visual><origin xyz="{xyz}"/><geometry>{geometry}</geometry>{more}</visual>'


def with_visuals(*visuals, name="arm"):
    return description(
        name,
        link("base"),
        link("upper", *BLOCK).replace("</link>", f"{''.join(visuals)}</link>"),
        link("lower", *BLOCK),
        joint("shoulder", "revolute", "base", "upper"),
        joint("elbow", "revolute", "upper", "lower", xyz=(0, 0, 0.5)),
    )


def scene(text, folders=()):
    library = MeshLibrary(folders)
    return scene_of(dd.load_urdf(text), text, library), library


def mesh_of(data):
    """Vertices and triangles of the bytes that a page gets."""
    vertices, triangles = struct.unpack_from("<II", data)
    positions = np.frombuffer(data, "<f4", 3 * vertices, 8).reshape(-1, 3)
    indices = np.frombuffer(data, "<u4", 3 * triangles, 8 + 12 * vertices).reshape(-1, 3)
    assert len(data) == 8 + 12 * (vertices + triangles)
    return positions, indices


@pytest.mark.parametrize(("id", "meshes"), [(PANDA, 10), (TALOS, 37)])
def test_robots_of_the_wheel(id, meshes):
    """All meshes are found, also from text that has no folder: Talos' URLs have a third slash."""
    path = robot_path(id)
    model = dd.load_urdf(path)
    library = MeshLibrary(mesh_folders())
    drawn = scene_of(model, path.read_text(), library)
    assert drawn["missing"] == {}
    assert len(library) == meshes
    assert [one["name"] for one in drawn["links"]] == list(model.link_names)
    for entry in (shape for one in drawn["links"] for shape in one["visuals"]):
        if entry["kind"] == "mesh":
            positions, indices = mesh_of(library.data(entry["mesh"]))
            assert indices.max() < len(positions)
            assert np.isfinite(positions).all()
        assert np.array(entry["origin"]).reshape(4, 4)[3].tolist() == [0, 0, 0, 1]
    low, high = np.array(drawn["bounds"])
    assert (high - low > 0.2).all()
    assert (high - low < 3.0).all()
    assert json.loads(json.dumps(drawn, allow_nan=False)) == drawn


def test_joints_say_what_moves_them():
    model = dd.load_urdf(robot_path(PANDA))
    joints = {entry["name"]: entry for entry in scene_of(model, robot_path(PANDA))["joints"]}
    assert joints["panda_joint3"]["dof"] == 2
    assert joints["panda_joint3"]["limits"]["lower"] == pytest.approx(model.lower[2])
    assert joints["panda_joint8"] | {"type": "fixed", "dof": None} == joints["panda_joint8"]
    assert joints["panda_finger_joint2"]["follows"] == "panda_finger_joint1"
    assert joints["panda_finger_joint2"]["dof"] == joints["panda_finger_joint1"]["dof"] == 7


def test_primitives_and_colors():
    blue = '<material name="blue"><color rgba="0.1 0.2 0.9 1"/></material>'
    text = with_visuals(
        visual('<box size="0.1 0.2 0.3"/>', blue, xyz="0 0 1"),
        visual('<cylinder radius="0.05" length="0.4"/>', '<material name="blue"/>'),
        visual('<sphere radius="0.1"/>'),
        "<visual/>",
    )
    drawn, _ = scene(text)
    box, cylinder, sphere = drawn["links"][1]["visuals"]
    assert (box["kind"], box["size"]) == ("box", [0.1, 0.2, 0.3])
    assert box["origin"][11] == 1.0
    assert (cylinder["kind"], cylinder["size"]) == ("cylinder", [0.05, 0.4])
    assert box["color"] == cylinder["color"] == [0.1, 0.2, 0.9, 1.0]
    assert (sphere["kind"], sphere["size"]) == ("sphere", [0.1])
    assert sphere["color"] != box["color"]
    assert not drawn["links"][1]["ellipsoid"]
    assert drawn["links"][2]["ellipsoid"]
    assert drawn["bounds"][1][2] == pytest.approx(1.15)


def test_ellipsoid_has_the_links_inertia():
    """Mass, centre and moments of an ellipsoid of even density are the link's; a payload is part of it."""
    model = dd.load_urdf(with_visuals()).with_payload("lower", 0.3, (0.4, 0.0, 0.1))
    inertia = scene_of(model, with_visuals())["links"][2]["inertia"]
    mass, com, (xx, xy, xz, yy, yz, zz) = BLOCK
    total = mass + 0.3
    centre = (mass * np.array(com) + 0.3 * np.array([0.4, 0.0, 0.1])) / total
    about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    for m, c in ((mass, np.array(com)), (0.3, np.array([0.4, 0.0, 0.1]))):
        d = c - centre
        about = about + m * (d @ d * np.eye(3) - np.outer(d, d))
    assert inertia["mass"] == pytest.approx(total)
    np.testing.assert_allclose(inertia["com"], centre, atol=1e-12)
    a, b, c = np.array(inertia["semi"]) ** 2
    axes = np.array(inertia["axes"])
    np.testing.assert_allclose(
        axes @ np.diag(total / 5.0 * np.array([b + c, a + c, a + b])) @ axes.T, about, atol=1e-12
    )
    assert np.linalg.det(axes) == pytest.approx(1.0)


def worm(inertia, mesh="", count=6):
    """Links in a row, 0.1 m long, of 0.5 kg."""
    parts = [link(f"l{k}", 0.5, (0.0, 0.0, 0.05), inertia).replace("</link>", f"{mesh}</link>") for k in range(count)]
    joints = [joint(f"j{k}", "revolute", f"l{k}", f"l{k + 1}", xyz=(0, 0, 0.1)) for k in range(count - 1)]
    return description("worm", *parts, *joints)


@pytest.mark.parametrize("mesh", ["", visual('<mesh filename="not_there.stl"/>')])
def test_links_without_shapes_have_bones_and_ellipsoids_of_their_size(mesh):
    """Of a rotational inertia far too large for its link, in its proportions; the box is around joints, too."""
    drawn, _ = scene(worm((0.2, 0.0, 0.0, 0.2, 0.0, 0.1), mesh))
    for one in drawn["links"][:-1]:
        assert one["ellipsoid"]
        assert one["bones"] == [[0.0, 0.0, 0.1]]
        semi, within = np.array(one["inertia"]["semi"]), np.array(one["inertia"]["drawn"])
        assert semi.max() > 0.5
        np.testing.assert_allclose(within / within.max(), semi / semi.max())
        assert 0.02 < within.max() < 0.05
    assert drawn["links"][-1]["bones"] == []
    low, high = np.array(drawn["bounds"])
    assert low[2] == pytest.approx(0.0, abs=0.05)
    assert 0.5 <= high[2] < 0.65


def test_an_ellipsoid_within_its_link_is_the_inertias_own():
    inertia = scene_of(dd.load_urdf(worm((1e-4, 0, 0, 1e-4, 0, 1e-4))), worm((1e-4, 0, 0, 1e-4, 0, 1e-4)))["links"][1][
        "inertia"
    ]
    assert inertia["drawn"] == pytest.approx(inertia["semi"])


def test_inertias_that_no_body_has_are_balls():
    """izz > ixx + iyy: there is no ellipsoid of it, and the link is to be seen all the same."""
    text = worm((0.001, 0.0, 0.0, 0.001, 0.0, 0.003))
    with pytest.warns(dd.exceptions.InertiaWarning):
        model = dd.load_urdf(text)
    for one in scene_of(model, text)["links"]:
        assert one["ellipsoid"]
        assert min(one["inertia"]["semi"]) == 0.0
        a, b, c = one["inertia"]["drawn"]
        assert 0.002 < a == b == c < 0.02


def test_a_robot_with_shapes_has_no_bones_to_its_frames():
    drawn, _ = scene(with_visuals(visual('<sphere radius="0.1"/>')))
    assert [one["bones"] for one in drawn["links"]] == [[], [], []]


def test_meshes_are_scaled_mirrored_and_kept_once(tmp_path):
    trimesh.creation.box((1.0, 2.0, 3.0)).export(tmp_path / "box.stl")
    same = visual('<mesh filename="box.stl" scale="0.1 0.1 0.1"/>')
    text = with_visuals(same, same, visual('<mesh filename="box.stl" scale="-0.1 0.1 0.1"/>'))
    drawn, library = scene(text, [tmp_path])
    visuals = drawn["links"][1]["visuals"]
    assert visuals[0]["mesh"] == visuals[1]["mesh"] != visuals[2]["mesh"]
    assert len(library) == 2
    for entry in visuals:
        positions, indices = mesh_of(library.data(entry["mesh"]))
        np.testing.assert_allclose(np.ptp(positions, axis=0), [0.1, 0.2, 0.3], rtol=1e-6)
        assert trimesh.Trimesh(positions, indices, process=False).volume == pytest.approx(0.006)  # faces look outward
    assert library.data("0" * 64) is None


@pytest.mark.parametrize("kind", ["stl", "obj", "dae"])
def test_formats(tmp_path, kind):
    trimesh.creation.icosphere(radius=0.2).export(tmp_path / f"ball.{kind}")
    drawn, library = scene(with_visuals(visual(f'<mesh filename="ball.{kind}"/>')), [tmp_path])
    assert drawn["missing"] == {}
    positions, _ = mesh_of(library.data(drawn["links"][1]["visuals"][0]["mesh"]))
    np.testing.assert_allclose(np.linalg.norm(positions, axis=1), 0.2, rtol=1e-5)


def test_what_is_missing_is_said_and_replaced(tmp_path):
    (tmp_path / "broken.stl").write_text("no mesh")
    (tmp_path / "secret.txt").write_text("secret")
    names = ("package://nowhere/arm.stl", "http://example.org/arm.stl", "broken.stl", "secret.txt")
    drawn, library = scene(with_visuals(*(visual(f'<mesh filename="{name}"/>') for name in names)), [tmp_path])
    assert set(drawn["missing"]) == set(names)
    assert "cannot be found" in drawn["missing"][names[0]]
    assert "is no file" in drawn["missing"][names[1]]
    assert "is none of .stl" in drawn["missing"]["secret.txt"]
    assert len(library) == 0
    assert drawn["links"][1]["visuals"] == []
    assert drawn["links"][1]["ellipsoid"]


def test_a_shape_that_makes_no_sense_takes_nothing_else_away():
    drawn, _ = scene(with_visuals(visual('<cone size="1"/>'), name="odd"))
    assert "no shape of a URDF" in drawn["missing"]["upper"]
    assert drawn["links"][1]["ellipsoid"]


def test_without_trimesh(monkeypatch, tmp_path):
    """Its absence is said, and the rest is drawn."""
    trimesh.creation.box((1.0, 1.0, 1.0)).export(tmp_path / "box.stl")
    monkeypatch.setitem(sys.modules, "trimesh", None)
    drawn, _ = scene(with_visuals(visual('<mesh filename="box.stl"/>')), [tmp_path])
    assert "needs trimesh" in drawn["missing"]["box.stl"]
    assert drawn["links"][1]["ellipsoid"]


def test_meshes_need_not_be_read():
    """The first scene of a robot, before its meshes are there, takes no time."""
    drawn = scene_of(dd.load_urdf(robot_path(PANDA)), robot_path(PANDA))
    assert drawn["missing"] == {}
    assert not any(one["visuals"] for one in drawn["links"])
    assert sum(one["ellipsoid"] for one in drawn["links"]) >= 8
