# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames of the page: numbers are those of the evaluation, poses and mobility are Pinocchio's, one state is as many are."""

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from diag_dynamics.page.frames import GAP, FrameMaker, Seen, States, Told
from diag_dynamics.page.layout import CAUSES, CHOSEN, Layout
from diag_dynamics.page.poses import LinkPoses, quaternions
from oracles import Oracle
from robots import description, joint, link, random_robots, random_tree, robot

FLOAT = 1e-6
"""Relative error of float32, and some."""

ROBOTS = [
    robot("panda_description/urdf/panda.urdf"),
    robot("talos_data/robots/talos_reduced.urdf").floating,
    *random_robots()[2:6],
]
PLANAR = random_tree(11, kinds=("revolute", "prismatic", "planar", "floating"))


def loaded(one):
    model = dd.load_urdf(one.urdf, mimic="free", **one.options)
    return model, Oracle(one.urdf, model.dof_names, floating_base=model.floating_base)


def some(model, count, seed=3):
    """Positions, rates and efforts."""
    rng = np.random.default_rng(seed)
    q = np.array([model.random(rng) for _ in range(count)])
    return q, rng.normal(size=(count, model.nv)), 10.0 * rng.normal(size=(count, model.nv))


def value(frame, layout, name):
    return frame["numbers"][..., layout.place(name)]


@pytest.fixture(scope="module")
def panda():
    return dd.load_urdf(robot("panda_description/urdf/panda.urdf").urdf)


@pytest.mark.parametrize("one", ROBOTS, ids=lambda one: one.id)
@pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
def test_poses_are_pinocchios(one):
    model, oracle = loaded(one)
    q, _, _ = some(model, 3)
    poses, matrices = LinkPoses(model).poses(q), LinkPoses(model).matrices(q)
    for k in range(3):
        pin.forwardKinematics(oracle.model, oracle.data, oracle.configuration(q[k]))
        pin.updateFramePlacements(oracle.model, oracle.data)
        for j, name in enumerate(model.link_names):
            expected = oracle.data.oMf[oracle.model.getFrameId(name, pin.FrameType.BODY)]
            np.testing.assert_allclose(matrices[k, j], expected.homogeneous, rtol=0, atol=1e-12)
            np.testing.assert_allclose(poses[k, j, :3], expected.translation, rtol=0, atol=1e-12)
            quaternion = pin.Quaternion(expected.rotation).coeffs()
            assert abs(abs(poses[k, j, 3:] @ quaternion) - 1.0) < 1e-12
            assert poses[k, j, 6] >= 0.0


def test_poses_of_joints_with_several_freedoms_and_of_followers():
    """Of planar and floating joints, and of mimic joints that are coupled, placements are those of the dynamics."""
    gripper = description(
        "gripper",
        *(link(name, 1.0, (0.1, 0, 0), (0.1, 0, 0, 0.1, 0, 0.1)) for name in ("hand", "left", "right")),
        joint("open", "prismatic", "hand", "left", (0, 1, 0), rpy=(0.3, 0.1, 0)),
        joint("close", "prismatic", "hand", "right", (0, 1, 0)).replace(
            "</joint>", '<mimic joint="open" multiplier="-0.7" offset="0.02"/></joint>'
        ),
    )
    for text in (PLANAR, gripper):
        model = dd.load_urdf(text)
        dyn, poses = dd.DiagonalDynamics(model), LinkPoses(model)
        for q in some(model, 2)[0]:
            for name, placed in zip(model.link_names, poses.matrices(q[None])[0], strict=True):
                np.testing.assert_allclose(placed, dyn.placement(q, name), rtol=0, atol=1e-12)


def test_quaternions_of_half_turns():
    """Where the scalar part vanishes, rotation and quaternion still agree."""
    for axis in np.eye(3):
        x, y, z, w = quaternions(2.0 * np.outer(axis, axis) - np.eye(3))
        np.testing.assert_allclose(np.abs([x, y, z, w]), [*axis, 0.0], atol=1e-15)


@pytest.mark.parametrize("one", ROBOTS[:3], ids=lambda one: one.id)
@pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
def test_numbers_are_those_of_the_evaluation(one):
    model, _ = loaded(one)
    dyn, maker = dd.DiagonalDynamics(model), FrameMaker(dd.DiagonalDynamics(model))
    layout = maker.layout
    q, qd, tau = (rows[0] for rows in some(model, 1))
    s = dyn.evaluate(q, qd, tau, friction=True)
    rng = np.random.default_rng(8)
    r = rng.normal(size=model.nv)
    torque = dyn.tau_from_epsilon(q, r)
    seen = Seen([True], r[None], torque[None], np.array([np.linalg.norm(r)]), [True])
    (frame,) = maker.frames(States.of(1.7e9 + 0.25, q, qd, tau, s), seen, Told(latency=0.003, rate=500.0))
    assert frame["t"] == 1.7e9 + 0.25
    assert len(frame.tobytes()) == 8 + 4 * layout.size
    expected = {
        **{"q": q, "qd": qd, "effort": tau, "nu": s.nu, "epsilon": s.epsilon, "coriolis": s.coriolis},
        **{"gravity": s.gravity, "gravity_torque": dyn.gravity_torque(q), "D": s.articulated_inertia},
        **{"link_energy": s.link_energy, "K": s.kinetic_energy, "residual": r, "external_torque": torque},
        **{"norm": np.linalg.norm(r), "torque_norm": np.linalg.norm(torque), "latency": 0.003, "rate": 500.0},
        **{"p_effort": s.nu @ s.epsilon, "p_gravity": -s.nu @ s.gravity, "p_friction": -s.nu @ s.friction},
        **{"p_external": qd @ torque, "flags": CAUSES["collision"]},
        "pose": [dyn.placement(q, name)[:3, 3] for name in model.link_names],
    }
    scale = np.linalg.norm(s.nu) * (np.linalg.norm(s.epsilon) + np.linalg.norm(s.gravity) + np.linalg.norm(r))
    for name, wanted in expected.items():
        found = value(frame, layout, name)
        if name == "pose":
            found = found.reshape(-1, 7)[:, :3]
        atol = FLOAT * (scale if name.startswith("p_") else max(np.abs(wanted).max(), 1e-3))
        np.testing.assert_allclose(found, np.squeeze(wanted) if found.size > 1 else [wanted], rtol=FLOAT, atol=atol)
    assert np.isnan(value(frame, layout, "dK"))
    assert 0.0 <= value(frame, layout, "coriolis_work") < 1e-14  # of doubles: floats would leave 1e-8
    assert all(np.isnan(value(frame, layout, name)).all() for name in CHOSEN)
    assert {field.name for field in layout.fields} == {*expected, "dK", "coriolis_work", *CHOSEN}


def test_chosen_link():
    """J M⁻¹Jᵀ and the twist of a link, in the world's axes, against Pinocchio's M and J."""
    model, oracle = loaded(ROBOTS[0])
    q, qd, _ = (rows[0] for rows in some(model, 1))
    dyn = dd.DiagonalDynamics(model)
    numbers = FrameMaker(dyn).chosen(q, dyn.nu_from_qd(q, qd), "panda_link6")
    pq = oracle.configuration(q)
    pin.computeJointJacobians(oracle.model, oracle.data, pq)
    pin.updateFramePlacements(oracle.model, oracle.data)
    frame = oracle.model.getFrameId("panda_link6", pin.FrameType.BODY)
    J = pin.getFrameJacobian(oracle.model, oracle.data, frame, pin.LOCAL_WORLD_ALIGNED)
    M = oracle.mass_matrix(q)
    J = np.stack([oracle.from_pin(row) for row in J])
    mobility = J @ np.linalg.solve(M, J.T)
    np.testing.assert_allclose(numbers[:21], mobility[np.triu_indices(6)], rtol=1e-5, atol=1e-5 * mobility.max())
    np.testing.assert_allclose(numbers[21:], J @ qd, rtol=1e-5, atol=1e-5)
    with pytest.raises(dd.InputError, match="'nobody' is not a link"):
        FrameMaker(dyn).chosen(q, qd, "nobody")


def test_many_states_are_as_one_by_one(panda):
    """A recording's frames, in pieces or not, are those that would have been sent live; dK goes on from piece to piece."""
    dyn = dd.DiagonalDynamics(panda)
    q, qd, tau = some(panda, 40)
    t = 100.0 + 0.01 * np.arange(40)
    t[20:] += 2.0 * GAP
    batch = dyn.evaluate_batch(q, qd, tau)
    whole = FrameMaker(dyn, live=False).frames(States.of(t, q, qd, tau, batch))
    by_one, by_piece = FrameMaker(dyn, live=False), FrameMaker(dyn, live=False)
    one = [by_one.frames(States.of(t[k], q[k], qd[k], tau[k], batch[k])) for k in range(40)]
    pieces = [by_piece.frames(States.of(t[a:b], q[a:b], qd[a:b], tau[a:b], batch[a:b])) for a, b in ((0, 15), (15, 40))]
    layout = by_one.layout
    assert "mobility" not in {field.name for field in layout.fields}
    for frames in (np.concatenate(one), np.concatenate(pieces)):
        np.testing.assert_array_equal(frames["t"], whole["t"])
        np.testing.assert_allclose(frames["numbers"], whole["numbers"], rtol=1e-5, atol=1e-4)
    rate = value(whole, layout, "dK")[:, 0]
    K = batch.kinetic_energy
    assert np.isnan(rate[[0, 20]]).all()
    np.testing.assert_allclose(rate[1:20], np.diff(K[:20]) / 0.01, rtol=1e-5)
    assert np.isfinite(rate[21:]).all()


def test_what_is_unknown_is_nan_and_flagged(panda):
    dyn, maker = dd.DiagonalDynamics(panda), FrameMaker(dd.DiagonalDynamics(panda))
    q, qd, _ = (rows[0] for rows in some(panda, 1))
    told = Told(velocity_estimated=True, receive_time=True, latency=3.0)
    (frame,) = maker.frames(States.of(1.0, q, qd, None, dyn.evaluate(q, qd)), None, told)
    for name in ("effort", "epsilon", "p_effort", "residual", "external_torque", "norm", "p_external", "rate"):
        assert np.isnan(value(frame, maker.layout, name)).all(), name
    named = {name for name, bit in CAUSES.items() if int(value(frame, maker.layout, "flags")[0]) & bit}
    assert named == {"velocity_estimated", "effort_missing", "no_external_torque", "receive_time", "late"}
    assert np.isfinite(value(frame, maker.layout, "nu")).all()


def test_another_model_is_flagged(panda):
    """K of a monitor whose robot carries a payload is not the sum over links without it."""
    loaded = dd.DiagonalDynamics(panda.with_payload("panda_link7", 2.0))
    maker = FrameMaker(dd.DiagonalDynamics(panda))
    q, qd, tau = (rows[0] for rows in some(panda, 1))
    (frame,) = maker.frames(States.of(1.0, q, qd, tau, loaded.evaluate(q, qd, tau)))
    assert int(value(frame, maker.layout, "flags")[0]) & CAUSES["other_model"]


def test_layout_says_what_a_page_needs(panda):
    layout = Layout(panda)
    told = layout.to_json()
    assert told["dofs"] == list(panda.dof_names)
    assert told["links"] == list(panda.link_names)
    assert told["angular"] == [True] * 7 + [False]
    assert sum(field["size"] for field in told["fields"]) == layout.size
    assert [field["name"] for field in told["fields"]][-2:] == list(CHOSEN)
    of = {"dofs": panda.nv, "coordinates": panda.nq, "links": len(panda.link_names)}
    for field in told["fields"]:
        assert not field["of"] or field["size"] % of[field["of"]] == 0
    assert told["thresholds"]["external_torque"] == [None] * panda.nv


def test_robot_without_joints():
    """A robot that does not move has frames, too."""
    model = dd.load_urdf(description("stone", link("stone", 1.0, (0, 0, 0), (1, 0, 0, 1, 0, 1))))
    dyn, maker = dd.DiagonalDynamics(model), FrameMaker(dd.DiagonalDynamics(model))
    none = np.zeros(0)
    (frame,) = maker.frames(States.of(1.0, none, none, none, dyn.evaluate(none, none, none)))
    assert value(frame, maker.layout, "K")[0] == 0.0
    assert value(frame, maker.layout, "pose").tolist() == [0, 0, 0, 0, 0, 0, 1]
