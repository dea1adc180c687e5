# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Data of the page: frames with the numbers of the evaluation, contact, and scenes."""

import base64
import gzip
import itertools
import json
import struct
import sys

import numpy as np
import pinocchio as pin
import pytest
import trimesh

import diag_dynamics as dd
import page_fixture
from diag_dynamics.page.frames import GAP, FrameMaker, States
from diag_dynamics.page.layout import CAUSES, CHOSEN, Layout, tree_of
from diag_dynamics.page.meshes import MeshLibrary
from diag_dynamics.page.scene import mesh_folders, scene_of
from diag_dynamics.page.stream import Received, RobotStream, compile_frames
from examples import some_of
from oracles import Oracle
from robots import (
    EXCLUDED,
    SINGULAR,
    all_robots,
    description,
    joint,
    link,
    random_robots,
    robot,
    robot_path,
)

PANDA, TALOS = "panda_description/urdf/panda.urdf", "talos_data/robots/talos_reduced.urdf"
BLOCK = (1.2, (0.1, 0.0, 0.2), (0.05, 0.0, 0.0, 0.06, 0.0, 0.03))

# --- Data of the tests in JavaScript ---


def require_same(found, expected, where="fixture"):
    """Require equal JSON; numbers and packed bytes may differ by rounding."""
    if isinstance(expected, dict):
        assert found.keys() == expected.keys(), where
        for name in expected:
            require_same(found[name], expected[name], f"{where}.{name}")
    elif isinstance(expected, list):
        assert len(found) == len(expected), where
        for k, pair in enumerate(zip(found, expected, strict=True)):
            require_same(*pair, f"{where}[{k}]")
    elif isinstance(expected, float):
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9, err_msg=where)
    else:
        assert found == expected, where


def unpacked(text):
    """Return the bytes of a text without their compression, which depends on the version of
    zlib.
    """
    data = base64.b64decode(text)
    return gzip.decompress(data) if data[:2] == b"\x1f\x8b" else data


def numbers_of(frame):
    """Return time and numbers of a frame."""
    return [
        float(np.frombuffer(frame, "<f8", 1)[0]),
        *np.frombuffer(frame, "<f4", offset=8).astype(float).tolist(),
    ]


def test_the_fixture_of_the_javascript_tests_is_what_python_writes():
    """If this fails after a change of frames or packing: python3 test/support/page_fixture.py, then
    npm test in web/.
    """
    stored = json.loads(page_fixture.PATH.read_text(encoding="utf-8"))
    made = page_fixture.content()
    for entry in (stored, made):
        entry["frames"] = [numbers_of(unpacked(text)) for text in entry["frames"]]
        entry["states"]["block"] = len(unpacked(entry["states"]["block"]))
    require_same(made, stored)


# --- Frames ---

FLOAT = 1e-6
"""Relative error of float32, rounded up."""

ROBOTS = [
    robot("panda_description/urdf/panda.urdf"),
    robot("talos_data/robots/talos_reduced.urdf").floating,
    *random_robots()[4:6],
]


def some(model, count=1, seed=3):
    """Return positions, rates and efforts of some states."""
    rng = np.random.default_rng(seed)
    q = np.array([model.random(rng) for _ in range(count)])
    return q, rng.normal(size=(count, model.nv)), 10.0 * rng.normal(size=(count, model.nv))


def value(frame, layout, name):
    return frame["numbers"][..., layout.places[name]]


FORCES = "touch_interval", "touch_force"
"""Fields of test_page_forces.py."""


@pytest.fixture(scope="module")
def panda():
    return dd.load_urdf(robot_path(PANDA))


@pytest.mark.parametrize("one", ROBOTS)
@pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
def test_mobility_and_velocity_are_pinocchios(one):
    model = dd.load_urdf(one.urdf, mimic="free", **one.options)
    oracle = Oracle(one.urdf, model.dof_names, floating_base=model.floating_base)
    dyn = dd.DiagonalDynamics(model)
    last = model.link_names[-1]
    (q,), (qd,), _ = some(model)
    pin.computeJointJacobians(oracle.model, oracle.data, oracle.configuration(q))
    frame = oracle.model.getFrameId(last, pin.FrameType.BODY)
    J = pin.getFrameJacobian(oracle.model, oracle.data, frame, pin.LOCAL_WORLD_ALIGNED)[:3]
    J = np.stack([oracle.from_pin(row) for row in J])
    mobility = J @ np.linalg.solve(oracle.mass_matrix(q), J.T)
    numbers = FrameMaker(dyn).chosen(q, dyn.nu_from_qd(q, qd), last)
    root = np.zeros((3, 3))
    root[np.triu_indices(3)] = numbers[:6]
    root += np.triu(root, 1).T
    np.testing.assert_allclose(root @ root, mobility, rtol=1e-5, atol=1e-5 * mobility.max())
    np.testing.assert_allclose(numbers[6:], J @ qd, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("one", ROBOTS[:3])
@pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
def test_frames_have_the_numbers_of_the_evaluation(one):
    model = dd.load_urdf(one.urdf, mimic="free", **one.options)
    dyn = dd.DiagonalDynamics(model)
    places = [(link, (0.0, 0.1, 0.2)) for link in model.link_names[-2:]]
    points = dd.ContactPoints(model, [dd.ContactPoint(link, link, place) for link, place in places])
    maker = FrameMaker(dd.DiagonalDynamics(model), zip(points.names, points.links, strict=True))
    q, qd, tau = (rows[0] for rows in some(model))
    s = dyn.evaluate(q, qd, tau, friction=True)
    r = np.random.default_rng(8).normal(size=model.nv)
    torque = dyn.tau_from_epsilon(q, r)
    norm = np.linalg.norm(r)
    contact = dyn.contact_limits(q[None], qd[None], points)
    observed = {
        "residual": r[None],
        "external_torque": torque[None],
        "norm": np.array([norm]),
        "collision": True,
    }
    links = np.array([[1.0, 0.0, np.nan]])
    observed |= {
        "touched_link": links,
        "touched_probability": links / 2.0,
    }
    states = States.of(1.5, q, qd, tau, s, **observed).with_contact_limits(contact)
    (frame,) = maker.frames(states)
    assert len(frame.tobytes()) == 8 + 4 * maker.layout.size
    expected = {
        "q": q,
        "qd": qd,
        "effort": tau,
        "nu": s.nu,
        "epsilon": s.epsilon,
        "coriolis": s.coriolis,
        "gravity": s.gravity,
        "gravity_torque": dyn.gravity_torque(q),
        "D": s.articulated_inertia,
        "link_energy": s.link_energy,
        "K": s.kinetic_energy,
        "residual": r,
        "external_torque": torque,
        "norm": norm,
        "torque_norm": np.linalg.norm(torque),
        "p_effort": s.nu @ s.epsilon,
        "p_gravity": -s.nu @ s.gravity,
        "p_friction": -s.nu @ s.friction,
        "p_external": qd @ torque,
        "flags": CAUSES["collision"],
        "contact_limits_worst": contact.worst,
        "contact_limits_position": contact.position[0, contact.worst[0]],
        "contact_limits_speed": contact.speed,
        "contact_limits_mass": contact.reflected_mass,
        "contact_limits_energy": contact.energy,
        "contact_limits_allowed": contact.allowed_speed,
        "touched_link": links,
        "touched_probability": links / 2.0,
    }
    scale = np.linalg.norm(s.nu) * sum(map(np.linalg.norm, (s.epsilon, s.gravity, r)))
    for name, wanted in expected.items():
        result = value(frame, maker.layout, name)
        wanted = np.ravel(wanted)
        finite = wanted[np.isfinite(wanted)]
        atol = FLOAT * (
            scale if name.startswith("p_") else max(np.abs(finite).max(initial=0.0), 1e-3)
        )
        np.testing.assert_allclose(result, wanted, rtol=FLOAT, atol=atol, err_msg=name)
    assert np.isnan(value(frame, maker.layout, "dK"))
    assert all(np.isnan(value(frame, maker.layout, name)).all() for name in CHOSEN)
    assert {field.name for field in maker.layout.fields} == {
        *expected,
        "dK",
        *CHOSEN,
        *FORCES,
    }


def test_unknown_values_are_nan_and_flagged(panda):
    """A state without efforts, of a receive time and with an estimated velocity."""
    q, qd, _ = (rows[0] for rows in some(panda))
    maker = FrameMaker(dd.DiagonalDynamics(panda), [("tool", "panda_hand")])
    evaluation = dd.DiagonalDynamics(panda).evaluate(q, qd)
    (frame,) = maker.frames(
        States.of(1.0, q, qd, None, evaluation, velocity_estimated=True, receive_time=True)
    )
    for name in (
        "effort",
        "epsilon",
        "p_effort",
        "p_external",
        "external_torque",
        "norm",
        "torque_norm",
        "contact_limits_speed",
    ):
        assert np.isnan(value(frame, maker.layout, name)).all(), name
    flags = int(value(frame, maker.layout, "flags")[0])
    expected = {
        "velocity_estimated",
        "effort_missing",
        "no_external_torque",
        "receive_time",
    }
    assert {name for name, bit in CAUSES.items() if flags & bit} == expected


def test_many_states_are_as_one_by_one(panda):
    """Frames of a recording, in pieces or not, are those of a live robot; dK continues from piece
    to piece.
    """
    dyn = dd.DiagonalDynamics(panda)
    q, qd, tau = some(panda, 40)
    t = 100.0 + 0.01 * np.arange(40)
    t[20:] += 2.0 * GAP
    batch = dyn.evaluate(q, qd, tau)
    whole = FrameMaker(dyn).frames(States.of(t, q, qd, tau, batch))
    for ends in (range(41), (0, 15, 40)):
        maker = FrameMaker(dyn)
        parts = [(slice(a, b), (q[a:b], qd[a:b], tau[a:b])) for a, b in itertools.pairwise(ends)]
        frames = np.concatenate(
            [maker.frames(States.of(t[k], *x, dyn.evaluate(*x))) for k, x in parts]
        )
        np.testing.assert_array_equal(frames["t"], whole["t"])
        np.testing.assert_allclose(frames["numbers"], whole["numbers"], rtol=1e-5, atol=1e-4)
    rate = value(whole, maker.layout, "dK")[:, 0]
    K = batch.kinetic_energy
    assert np.isnan(rate[[0, 20]]).all()
    np.testing.assert_allclose(rate[1:20], np.diff(K[:20]) / 0.01, rtol=1e-5)
    assert np.isfinite(rate[21:]).all()


# --- Streams ---

SHOWN = [id for id in all_robots() if id not in EXCLUDED or EXCLUDED[id].reason == SINGULAR]


def test_a_frame_is_made_once_for_each_link(panda):
    """An unknown link is the end effector. Thresholds and points of contact start a new layout."""
    dyn = dd.DiagonalDynamics(panda)
    states = []
    q, qd, tau = (rows[0] for rows in some(panda))
    stream = RobotStream("/arm", lambda _: states.pop() if states else None)
    assert stream.newest("panda_hand") == ((0, ""), (0, "[]"), "", 0, b"")  # no robot yet
    stream.set_robot(dyn)
    evaluated = States.of(1.0, q, qd, tau, dyn.evaluate(q, qd, tau))
    states[:] = [Received(evaluated, 0.0, 3)]
    newest = [stream.newest(link) for link in ("panda_hand", "nobody", "panda_link3")]
    assert [entry.link for entry in newest] == ["panda_hand", "panda_hand", "panda_link3"]
    assert newest[0].frame is newest[1].frame != newest[2].frame
    common = 8 + 4 * Layout(panda).common
    assert newest[0].frame[:common] == newest[2].frame[:common]
    assert (newest[0].layout[0], newest[0].number) == (1, 3)
    states[:] = [
        Received(
            evaluated, 0.0, 1, (*np.full(panda.nv, np.inf), np.inf, 8.0), (("tool", "panda_hand"),)
        )
    ]
    number, layout = stream.newest().layout
    assert (number, json.loads(layout)["thresholds"]["norm"]) == (2, 8.0)
    assert json.loads(layout)["contact_limits"]["points"] == [
        {"name": "tool", "link": "panda_hand"}
    ]


@pytest.mark.parametrize("id", some_of(SHOWN, 14))
@pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
def test_example_robots_are_shown(id):
    """The first frame of a collision has K and a force, also where no joint moves the last link."""
    path = robot_path(id)
    model = dd.load_urdf(path, mimic="free", massless="lock")
    dyn = dd.DiagonalDynamics(model)
    covariance = np.eye(model.nv)
    compile_frames(dyn, covariance)
    q, qd, tau = (rows[0] for rows in some(model))
    s = dyn.evaluate(q, qd, tau)
    observed = {"external_torque": tau[None], "norm": np.ones(1), "collision": True}
    stream = RobotStream("/robot", lambda _: Received(States.of(1.0, q, qd, tau, s, **observed), 0))
    stream.set_robot(dyn, scene_of(model, path), covariance=covariance)
    newest = stream.newest()
    layout = Layout(model)
    frame = np.frombuffer(newest.frame, layout.dtype)[0]
    np.testing.assert_allclose(value(frame, layout, "K"), s.kinetic_energy, rtol=FLOAT)
    touched = int(value(frame, layout, "touched_link")[0])
    if touched >= 0:
        assert np.isfinite(value(frame, layout, "touch_interval")).all()
        assert json.loads(newest.layout[1])["tree"]["links"][touched]["dofs"]


def test_why_no_state_comes():
    """The worst status is the reason if there is no other."""
    stream = RobotStream("/arm", lambda _: None)
    stream.set_robot(dd.DiagonalDynamics(dd.load_urdf(page_fixture.ARM)))
    assert stream.about()["waiting"] == "waiting for the first state"
    statuses = [
        (0, "model", "fits"),
        (1, "joint states", "rejected: no joint 'elbow'"),
        (0, "rates", "well"),
    ]
    stream.set_diagnostics(
        [
            {"level": level, "name": f"/arm/monitor: {name}", "message": text}
            for level, name, text in statuses
        ]
    )
    assert stream.about()["waiting"] == "joint states: rejected: no joint 'elbow'"
    assert stream.about()["error"] == ""
    error = {"level": 2, "name": "/arm/monitor: model", "message": "rejected"}
    stale = {"level": 3, "name": "/arm/monitor: loops", "message": "no states"}
    stream.set_diagnostics([stale, error])
    assert stream.about()["error"] == "model: rejected"
    stream.error = "no description"
    assert stream.about()["error"] == "no description"
    stream.waiting = "waiting for robot_description"
    assert stream.about()["waiting"] == "waiting for robot_description"


# --- Scenes ---


def visual(geometry, more="", xyz="0 0 0"):
    return f'<visual><origin xyz="{xyz}"/><geometry>{geometry}</geometry>{more}</visual>'


def mesh(name, scale="1 1 1"):
    return visual(f'<mesh filename="{name}" scale="{scale}"/>')


def scene(*visuals, folders=()):
    """Return the scene of an arm whose first moving link has these visuals, and its meshes."""
    text = description(
        "arm",
        link("base"),
        link("upper", *BLOCK).replace("</link>", f"{''.join(visuals)}</link>"),
        link("lower", *BLOCK),
        joint("shoulder", "revolute", "base", "upper"),
        joint("elbow", "revolute", "upper", "lower", xyz=(0, 0, 0.5)),
    )
    library = MeshLibrary(folders)
    return scene_of(dd.load_urdf(text), text, library), library


def mesh_of(data):
    """Return vertices and triangles of a packed mesh."""
    vertices, triangles = struct.unpack_from("<II", data)
    assert len(data) == 8 + 12 * (vertices + triangles)
    positions = np.frombuffer(data, "<f4", 3 * vertices, 8).reshape(-1, 3)
    return positions, np.frombuffer(data, "<u4", 3 * triangles, 8 + 12 * vertices).reshape(-1, 3)


@pytest.mark.parametrize(
    ("id", "meshes"), [(PANDA, 10), pytest.param(TALOS, 37, marks=pytest.mark.full)]
)
def test_scenes_of_robots(id, meshes):
    """All meshes are found, also of a text without a folder: Talos' URLs have a third slash."""
    path = robot_path(id)
    library = MeshLibrary(mesh_folders())
    model = dd.load_urdf(path)
    drawn = scene_of(model, path.read_text(), library)
    assert (drawn["missing"], len(library.meshes)) == ({}, meshes)
    assert [element["name"] for element in drawn["links"]] == list(model.link_names)
    assert (np.array(drawn["rest"]) >= model.lower).all()
    assert (np.array(drawn["rest"]) <= model.upper).all()
    assert json.loads(json.dumps(drawn, allow_nan=False)) == drawn


def test_the_tree_of_a_panda(panda):
    """The degree of freedom that moves each link: the one of the source joint, for a mimic joint;
    none, for the base.
    """
    tree = tree_of(panda)
    dofs = dict(zip(panda.link_names, (element["dofs"] for element in tree["links"]), strict=True))
    assert [dofs[name] for name in ("panda_link0", "panda_link3", "panda_hand")] == [[], [2], [6]]
    assert dofs["panda_leftfinger"] == dofs["panda_rightfinger"] == [7]
    assert tree["link_of_dof"] == [*(f"panda_link{k}" for k in range(1, 8)), "panda_leftfinger"]


HAND = (*(f"arm{k}" for k in range(1, 7)), "palm")
TORSO = ("waist", "chest")


def tree(*chains):
    """Return a URDF of chains of links 0.2 m apart; each has the link that carries it, names, and
    how joints move.
    """
    parts = [link("base", *BLOCK)]
    for parent, names, kind in chains:
        for name in names:
            parts.append(link(name, *BLOCK))
            parts.append(
                joint(
                    f"to_{name}",
                    kind,
                    parent,
                    name,
                    xyz=(0.0, 0.0, 0.01 if "finger" in name else 0.2),
                )
            )
            parent = name
    return description("tree", *parts)


def arms(*names, length):
    return [("chest", tuple(f"{name}{k}" for k in range(length)), "revolute") for name in names]


def fingers(*names, length, parent="palm"):
    return [
        (parent, tuple(f"{name}_finger{k}" for k in range(length)), "revolute") for name in names
    ]


@pytest.mark.parametrize(
    ("expected", "chains", "options"),
    [
        ("base", [("base", ("plate",), "fixed")], {}),
        ("palm", [("base", HAND, "revolute")], {}),
        ("palm", [("base", HAND, "revolute"), *fingers("thumb", "index", "little", length=4)], {}),
        ("tool", [("base", HAND, "revolute"), ("palm", ("tool",), "fixed")], {}),
        ("left3", [("base", TORSO, "revolute"), *arms("left", "right", length=4)], {}),
        (
            "base",
            [("base", (f"rotor{k}",), "continuous") for k in range(4)],
            {"floating_base": True},
        ),
        ("palm", [("base", HAND, "revolute")], {"locked_joints": {"to_palm": 0.3}}),
    ],
)
def test_the_end_effector_link_of_trees(expected, chains, options):
    """The last link of the longest chain, before fingers, also with 4 kg in the hand and with a
    camera on its side.
    """
    text = tree(*chains)
    model = dd.load_urdf(text, **options)
    assert Layout(model).to_json()["end_effector"] == expected
    carrying = model.with_payload(expected, 4.0, (0.0, 0.0, 0.1))
    assert Layout(carrying).to_json(scene_of(carrying, text))["end_effector"] == expected
    camera = link("camera", 0.01, (0, 0, 0), (1e-6, 0, 0, 1e-6, 0, 1e-6))
    mount = joint("mount", "fixed", expected, "camera", xyz=(0.0, 0.3, 0.0))
    with_camera = dd.load_urdf(text.replace("</robot>", f"{camera}{mount}</robot>"), **options)
    assert Layout(with_camera).to_json()["end_effector"] == expected


def stands_in(link):
    """Return whether bones and ellipsoid are drawn."""
    return not link["visuals"] and link["ellipsoid"] is not None


def test_primitives():
    drawn, _ = scene(
        visual('<box size="0.1 0.2 0.3"/>', xyz="0 0 1"),
        visual('<cylinder radius="0.05" length="0.4"/>'),
        visual('<sphere radius="0.1"/>'),
        "<visual/>",
    )
    assert [(shape["kind"], shape["size"]) for shape in drawn["links"][1]["visuals"]] == [
        ("box", [0.1, 0.2, 0.3]),
        ("cylinder", [0.05, 0.4]),
        ("sphere", [0.1]),
    ]
    assert drawn["links"][1]["visuals"][0]["origin"][11] == 1.0
    assert [stands_in(element) for element in drawn["links"]] == [False, False, True]


def test_collision_shapes_of_a_link_without_visual_ones():
    drawn, _ = scene(visual('<box size="0.1 0.2 0.3"/>').replace("visual", "collision"))
    assert [shape["kind"] for shape in drawn["links"][1]["visuals"]] == ["box"]


def test_an_ellipsoid_has_the_inertia_of_its_link():
    """Centre and moments of an ellipsoid of even density are the link's; a payload is part of
    it.
    """
    text = page_fixture.ARM
    about = np.array([[0.1, 0.0, 0.02], [0.0, 0.1, 0.0], [0.02, 0.0, 0.1]])
    model = dd.load_urdf(text).with_payload("lower", 0.5, (0.4, 0.3, 0.1), 0.1 * about)
    lower = scene_of(model, text)["links"][2]
    centre = (1.0 * np.array([1.0, 0.0, 0.0]) + 0.5 * np.array([0.4, 0.3, 0.1])) / 1.5
    inertia = 0.1 * about
    for mass, at in ((1.0, [1.0, 0.0, 0.0]), (0.5, [0.4, 0.3, 0.1])):
        d = np.array(at) - centre
        inertia = inertia + mass * (d @ d * np.eye(3) - np.outer(d, d))
    ellipsoid = np.reshape(lower["ellipsoid"], (4, 4))
    root = ellipsoid[:3, :3] @ ellipsoid[:3, :3].T
    moments = 1.5 / 5.0 * (np.trace(root) * np.eye(3) - root)
    assert lower["mass"] == pytest.approx(1.5)
    np.testing.assert_allclose(ellipsoid[:3, 3], centre, atol=1e-12)
    np.testing.assert_allclose(moments / np.trace(moments), inertia / np.trace(inertia), atol=1e-12)
    assert np.trace(moments) <= np.trace(inertia) * (1.0 + 1e-12)
    assert np.linalg.det(ellipsoid) > 0.0


@pytest.mark.parametrize("kind", ["stl", "obj", "dae"])
def test_meshes_are_scaled_mirrored_and_stored_once(tmp_path, kind):
    trimesh.creation.box((1.0, 2.0, 3.0)).export(tmp_path / f"box.{kind}")
    same = mesh(f"box.{kind}", "0.1 0.1 0.1")
    drawn, library = scene(same, same, mesh(f"box.{kind}", "-0.1 0.1 0.1"), folders=[tmp_path])
    shas = [shape["mesh"] for shape in drawn["links"][1]["visuals"]]
    assert shas[0] == shas[1] != shas[2]
    assert len(library.meshes) == 2
    for sha in shas:
        positions, indices = mesh_of(library.meshes[sha])
        np.testing.assert_allclose(np.ptp(positions, axis=0), [0.1, 0.2, 0.3], rtol=1e-6)
        volume = trimesh.Trimesh(positions, indices, process=False).volume
        assert volume == pytest.approx(0.006)  # faces look outward


def test_what_cannot_be_drawn_is_listed_and_replaced_by_an_ellipsoid(tmp_path, monkeypatch):
    (tmp_path / "broken.stl").write_text("no mesh")
    (tmp_path / "secret.txt").write_text("secret")
    trimesh.creation.box((1.0, 1.0, 1.0)).export(tmp_path / "box.stl")
    causes = {
        "package://nowhere/arm.stl": "cannot be found",
        "http://example.org/arm.stl": "cannot be found",
    }
    causes |= {"secret.txt": "is none of .stl", "broken.stl": ""}
    drawn, library = scene(*map(mesh, causes), visual('<cone size="1"/>'), folders=[tmp_path])
    assert drawn["missing"].keys() == {*causes, "upper"}
    for name, cause in (causes | {"upper": "no shape of a URDF"}).items():
        assert cause in drawn["missing"][name]
    assert len(library.meshes) == 0 and stands_in(drawn["links"][1])
    monkeypatch.setitem(sys.modules, "trimesh", None)
    drawn, _ = scene(mesh("box.stl"), folders=[tmp_path])
    assert "trimesh" in drawn["missing"]["box.stl"]
    assert stands_in(drawn["links"][1])
