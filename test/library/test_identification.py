# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Identification on simulated motions whose efforts are Pinocchio's: what is found, what is refused, what is told."""

import json
import re
import tracemalloc
from functools import partial
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from diag_dynamics.identification import inertias
from diag_dynamics.identification.cross_validation import Blocks, Cut
from diag_dynamics.identification.equations import Equations
from diag_dynamics.identification.fit import Free, Layout
from diag_dynamics.identification.result import without_impossible_links
from diag_dynamics.identification.segments import Segment, in_portions, since, without_delay
from diag_dynamics.identification.sifting import Beginnings, Sifter
from diag_dynamics.identification.solver import Body, Problem, solved
from diag_dynamics.identification.unexplained import MOST, Curves
from diag_dynamics.model.rewriting import urdf_with
from diag_dynamics.recordings.quality import Quality
from motions import efforts, fourier, recorded
from oracles import Oracle
from robots import description, joint, link, robot

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

PANDA = robot("panda_description/urdf/panda.urdf").urdf
HELD = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
V0 = 5e-3
DAMPING = np.array([0.5, 0.5, 0.4, 0.4, 0.2, 0.2, 0.2])
FRICTION = np.array([0.4, 0.5, 0.3, 0.5, 0.3, 0.2, 0.3])
OFFSET = np.array([-0.1, 0.2, 0.05, -0.1, 0.05, 0.03, -0.02])
NOISE = np.array([0.5] * 4 + [0.15] * 3)
WITH_ALL = "friction", "rotors", "inertias"


def friction(qd):
    return DAMPING * qd + FRICTION * np.tanh(qd / V0) + OFFSET


@pytest.fixture(scope="module")
def panda():
    """The Panda, without any friction in its URDF, and Pinocchio's."""
    model = dd.load_urdf(re.sub("<dynamics[^>]*>", "", PANDA), locked_joints=HELD)
    return model, Oracle(PANDA, model.dof_names, locked_joints=HELD)


def motion(model, seed, duration, rate):
    t = np.arange(0.0, duration, 1.0 / rate)
    return t, *fourier(np.random.default_rng(seed), t, model.lower, model.upper)


def recording(model, oracle, seed, duration=20.0, rate=250.0, noise=False, extra=friction):
    t, q, qd, qdd = motion(model, seed, duration, rate)
    tau = efforts(oracle, q, qd, qdd) + extra(qd)
    if noise:
        rng = np.random.default_rng(1000 + seed)
        q, qd = q + 1e-4 * rng.normal(size=q.shape), qd + 1e-2 * rng.normal(size=q.shape)
        tau = tau + NOISE * rng.normal(size=q.shape)
    return recorded(model, t, q, qd, tau)


def wrong(model, rng, size=0.35):
    """The model with each link's mass, centre and inertia wrong by some 30 %, and physical."""
    links = {}
    for record in model.links:
        name = model.link_names[record["index"]]
        body, placement = model.placement_in_body(name)
        if body == 0:
            continue
        own = inertias.pseudo_inertia(inertias.moved(inertias.parameters_of_record(record), np.linalg.inv(placement)))
        turn = np.eye(4) + 0.5 * size * rng.normal(size=(4, 4))
        root = np.linalg.cholesky(own)
        J = root @ turn @ turn.T @ root.T
        J *= (1.0 + size * rng.uniform(-1.0, 1.0)) * own[3, 3] / J[3, 3]
        links[name] = dd.Payload(*inertias.about_centre(inertias.parameters_of_pseudo(J)))
    return model.with_parameters(dd.Parameters(links=links))


def residual(model, truth, oracle, resist=friction, seed=77):
    """Root mean square of |ℓ(τ̂ − τ)| on another motion [J^½/s], τ Pinocchio's, and the largest error [N m]."""
    _, q, qd, qdd = motion(truth, seed, 10.0, 50.0)
    dynamics = dd.DiagonalDynamics(model)
    error = dynamics.inverse_dynamics_batch(q, qd, qdd) + dynamics.friction_torque_batch(qd)
    error -= efforts(oracle, q, qd, qdd) + resist(qd)
    epsilon = dd.DiagonalDynamics(truth).epsilon_from_tau_batch(q, error)
    return np.sqrt((epsilon**2).sum(axis=1).mean()), np.abs(error).max()


def refuse_unphysical(model):
    """Fail unless every body of a model is one that can be."""
    for body in model.bodies[1:]:
        if body["mass"] != 0.0:
            assert inertias.is_physical(inertias.parameters_of_record(body))


# --- Inertias and solver ---


def test_parameters_are_pinocchios():
    rng = np.random.default_rng(0)
    for _ in range(20):
        body = pin.Inertia(rng.uniform(0.1, 3.0), rng.normal(size=3), pin.Inertia.Random().inertia)
        M = pin.SE3.Random()
        ours = inertias.of_body(body.mass, body.lever, body.inertia)
        np.testing.assert_allclose(ours, body.toDynamicParameters(), atol=1e-12)
        np.testing.assert_allclose(
            inertias.moved(ours, M.homogeneous), M.act(body).toDynamicParameters(), rtol=1e-11, atol=1e-11
        )
        mass, centre, about = inertias.about_centre(ours)
        assert mass == pytest.approx(body.mass)
        np.testing.assert_allclose(centre, body.lever, atol=1e-12)
        np.testing.assert_allclose(about, body.inertia, atol=1e-10)


def test_physical_is_what_points_of_mass_can_be():
    rng = np.random.default_rng(0)
    points, masses = rng.normal(size=(6, 3)), rng.uniform(0.1, 1.0, 6)
    parts = [inertias.of_body(m, r, np.zeros((3, 3))) for m, r in zip(masses, points, strict=True)]
    assert inertias.is_physical(sum(parts))
    assert not inertias.is_physical(sum(parts[:2]) - parts[2])
    flat = inertias.of_body(1.0, np.zeros(3), np.diag([1.0, 1.0, 2.5]))  # breaks the triangle inequality
    assert not inertias.is_physical(flat)


def test_what_a_body_has_is_shared_out_physically():
    rng = np.random.default_rng(1)
    parts = [a @ a.T + 1e-3 * np.eye(4) for a in rng.normal(size=(3, 4, 4))]
    root = rng.normal(size=(4, 4))
    whole = root @ root.T + 1e-2 * np.eye(4)
    shares = inertias.shared_out(parts, whole)
    np.testing.assert_allclose(sum(shares), whole, atol=1e-12)
    assert min(np.linalg.eigvalsh(share)[0] for share in shares) > 0.0
    np.testing.assert_allclose(inertias.shared_out(parts, sum(parts))[1], parts[1], atol=1e-10)


def test_prior_alone_is_the_model():
    rng = np.random.default_rng(2)
    a = rng.normal(size=(4, 4))
    prior = a @ a.T + 0.1 * np.eye(4)
    problem = Problem(
        np.zeros((10, 10)), np.zeros(10), [Body(0, prior, 10.0, np.zeros((4, 4)))], np.zeros(0, int), 0.01
    )
    start = inertias.parameters_of_pseudo(3.0 * np.eye(4))
    np.testing.assert_allclose(solved(problem, start).x, inertias.parameters_of_pseudo(prior), atol=1e-4)


def test_positive_numbers_have_a_closed_form():
    """min ½ a x² − b x − γ' ln x is at (b + √(b² + 4 a γ')) / 2a, also where least squares is negative."""
    for a, b in ((4.0, 8.0), (4.0, -8.0), (1e6, -1e3)):
        problem = Problem(np.array([[a]]), np.array([b]), [], np.array([0]), 0.01)
        expected = (b + np.sqrt(b * b + 0.04 * a)) / (2.0 * a)
        assert solved(problem, np.array([0.1])).x[0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("seed", range(8))
def test_every_solution_is_physical(seed):
    """Whatever the rows say: here what no body can be, a thousand times more certain than the prior, or nothing at all."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(4, 4))
    prior = a @ a.T + 0.01 * np.eye(4)
    rows = rng.normal(size=(seed, 10)) * 10.0 ** rng.uniform(0, 4, size=(seed, 1))
    target = rng.normal(size=10)
    problem = Problem(
        rows.T @ rows, rows.T @ (rows @ target), [Body(0, prior, 10.0, np.zeros((4, 4)))], np.zeros(0, int), 0.01
    )
    solution = solved(problem, inertias.parameters_of_pseudo(prior))
    assert inertias.is_physical(solution.x)
    gradient = problem.A @ solution.x - problem.b
    J = inertias.pseudo_inertia(solution.x)
    barrier = 10.0 * np.tensordot(inertias.BASIS, np.linalg.inv(prior) - np.linalg.inv(J), 2)
    scale = np.abs(gradient).max() + 10.0 * np.abs(np.linalg.inv(J)).max()
    np.testing.assert_allclose(gradient, -barrier, atol=1e-4 * scale)


# --- Exact data ---


def test_friction_is_recovered_exactly(panda):
    model, oracle = panda
    found = dd.identify(recording(model, oracle, 1, rate=1000.0), model, "friction")
    assert found.quality["taken"] == ["friction"]
    np.testing.assert_allclose(found.model.damping, DAMPING, atol=1e-4)
    np.testing.assert_allclose(found.model.friction, FRICTION, atol=1e-4)
    np.testing.assert_allclose(found.model.effort_offset, OFFSET, atol=1e-4)
    assert residual(found.model, model, oracle)[1] < 1e-3
    assert found.quality["explained"][1] > 1.0 - 1e-6
    before, after = np.transpose(list(found.quality["torque_rms"].values()))
    assert (after < 0.05 * before).all()


def test_inertias_and_friction_predict_another_motion_exactly(panda):
    """From inertias wrong by a third: not each mass comes out, for no motion tells it, but every effort does."""
    model, oracle = panda
    start = wrong(model, np.random.default_rng(3))
    assert residual(start, model, oracle, seed=78)[0] > 4.0
    found = dd.identify(recording(start, oracle, 2, rate=1000.0), start, WITH_ALL)
    assert found.quality["taken"] == ["friction", "inertias"]
    error, largest = residual(found.model, model, oracle, seed=78)
    assert error < 1e-3
    assert largest < 1e-3
    refuse_unphysical(found.model)
    assert any("not determined" in text for text in found.quality["warnings"])


def test_rotors_are_recovered(panda):
    model, oracle = panda
    rotors = np.array([0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0.05])
    t, q, qd, qdd = motion(model, 4, 20.0, 1000.0)
    data = recorded(model, t, q, qd, efforts(oracle, q, qd, qdd) + rotors * qdd + friction(qd))
    found = dd.identify(data, model)
    assert found.quality["taken"] == ["friction", "rotors"]
    np.testing.assert_allclose(found.model.armature, rotors, atol=1e-3)
    np.testing.assert_allclose(found.model.damping, DAMPING, atol=1e-3)
    assert any("kinetic energy is" in text for text in found.quality["warnings"])


def test_a_step_that_a_larger_error_hides_is_tried_again(panda):
    """Beside rotors of 3 kg m² friction alone explains next to nothing; once they are known, it does."""
    model, oracle = panda
    t, q, qd, qdd = motion(model, 4, 20.0, 250.0)
    rng = np.random.default_rng(4)
    tau = efforts(oracle, q, qd, qdd) + 3.0 * qdd + friction(qd) + NOISE * rng.normal(size=q.shape)
    found = dd.identify(recorded(model, t, q, qd, tau), model)
    assert [(rung["steps"], rung["taken"]) for rung in found.quality["ladder"]] == [
        ([], True),
        (["friction"], False),
        (["rotors"], True),
        (["friction", "rotors"], True),
    ]
    np.testing.assert_allclose(found.model.armature, 3.0, atol=0.02)
    np.testing.assert_allclose(found.model.friction, FRICTION, atol=0.05)
    assert not any("stay as the model has them" in text for text in found.quality["warnings"])


def test_rotors_that_are_not_there_are_not_taken(panda):
    model, oracle = panda
    found = dd.identify(recording(model, oracle, 1, noise=True), model)
    assert found.quality["taken"] == ["friction"]
    assert not found.model.armature.any()
    assert any(text.startswith("rotors stay") for text in found.quality["warnings"])
    assert not any("a payload of" in text for text in found.quality["warnings"])


def test_followers_are_part_of_their_leader():
    """A gripper whose finger follows the other one: inertias and friction of both, as the leader feels them."""
    about = (0.02, 0.0, 0.0, 0.025, 0.0, 0.01)
    urdf = description(
        "gripper",
        link("base"),
        link("arm", 2.0, (0.1, 0.02, -0.3), about),
        link("left", 0.5, (0.1, 0.0, 0.05), about),
        link("right", 0.6, (0.12, 0.01, 0.02), about),
        joint("a", "revolute", "base", "arm", axis=(0, 1, 0)),
        joint("l", "revolute", "arm", "left", axis=(0, 1, 0), xyz=(0.1, 0.1, -0.5)),
        joint("r", "revolute", "arm", "right", axis=(1, 0, 0), xyz=(-0.1, 0.1, -0.5)).replace(
            "</joint>", '<mimic joint="l" multiplier="-1.5" offset="0.2"/></joint>'
        ),
    )
    model = dd.load_urdf(urdf)
    assert model.nv == 2 and list(model.mimics) == ["r"]
    oracle = Oracle(urdf, ("a", "l", "r"))
    G = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, -1.5]])
    damping, coulomb = np.array([0.3, 0.2]), np.array([0.4, 0.1])

    def needed(q, qd, qdd):
        return efforts(oracle, q @ G.T + (0.0, 0.0, 0.2), qd @ G.T, qdd @ G.T) @ G

    def data(seed, of):
        t = np.arange(0.0, 20.0, 1e-3)
        q, qd, qdd = fourier(np.random.default_rng(seed), t, -2.0 * np.ones(2), 2.0 * np.ones(2))
        tau = needed(q, qd, qdd) + damping * qd + coulomb * np.tanh(qd / V0)
        return recorded(of, t, q, qd, tau), q, qd, qdd, tau

    start = wrong(model, np.random.default_rng(8))
    found = dd.identify(data(1, start)[0], start, ("friction", "inertias"))
    _, q, qd, qdd, tau = data(2, start)
    dynamics = dd.DiagonalDynamics(found.model)
    predicted = dynamics.inverse_dynamics_batch(q, qd, qdd) + dynamics.friction_torque_batch(qd)
    assert np.abs(predicted - tau).max() < 2e-3
    assert found.parameters.joints["r"] == dd.JointParameters(damping=0.0, friction=0.0, effort_offset=0.0)
    refuse_unphysical(found.model)


# --- Noise ---


def test_a_noisy_panda_that_is_wrong_by_a_third(panda):
    """Noise of 1e-4 rad, 1e-2 rad/s, 0.5 and 0.15 N m; five robots, motions and noises, judged on other motions.

    Motions: 20 s at 250 Hz, five harmonics of 0.1 Hz, up to 1.7 rad/s.
    """
    model, oracle = panda
    before, after = [], []
    for seed in range(5):
        start = wrong(model, np.random.default_rng(seed))
        found = dd.identify(recording(start, oracle, seed, noise=True), start, WITH_ALL)
        refuse_unphysical(found.model)
        before.append(residual(start, model, oracle, seed=50 + seed)[0])
        after.append(residual(found.model, model, oracle, seed=50 + seed)[0])
    assert np.median(before) > 5.0
    assert np.median(after) <= 0.25
    assert max(after) <= 0.35


LOAD = 1.2, np.array([0.03, -0.02, 0.12]), np.diag([0.004, 0.005, 0.003])


def loaded(oracle):
    """The oracle with a payload on its hand."""
    other = Oracle(PANDA, oracle.dof_names, locked_joints=HELD)
    frame = other.model.frames[other.model.getFrameId("panda_hand", pin.FrameType.BODY)]
    mass, centre, about = LOAD
    other.model.appendBodyToJoint(frame.parentJoint, pin.Inertia(mass, centre, about), frame.placement)
    other.data = other.model.createData()
    return other


@pytest.mark.parametrize("seed", [11, 12])
@pytest.mark.parametrize("known", [True, False], ids=["robot known", "reference run"])
def test_payload(panda, known, seed):
    """Ten seconds of noise: mass and centre, within their standard deviations; against a wrong robot by a reference run."""
    model, oracle = panda
    start = model if known else wrong(model, np.random.default_rng(seed))
    data = recording(start, loaded(oracle), seed, 10.0, noise=True, extra=np.zeros_like)
    reference = None if known else recording(start, oracle, 100 + seed, 20.0, noise=True, extra=np.zeros_like)
    found = dd.identify(data, start, "payload:panda_hand", reference=reference)
    told, (mass, centre, _) = found.quality["payload"], LOAD
    assert told["mass"] == pytest.approx(mass, rel=6e-3)
    np.testing.assert_allclose(told["com"], centre, atol=3e-3)
    assert abs(told["mass"] - mass) < 4.0 * told["mass_deviation"] < 0.05
    assert (np.abs(told["com"] - centre) < 4.0 * np.array(told["com_deviation"])).all()
    assert max(told["com_deviation"]) < 3e-3
    assert re.search("20 to 50 % only|not known", told["inertia_known"])
    assert found.parameters.payloads["panda_hand"].mass == told["mass"]
    assert not found.parameters.links and not found.parameters.joints
    assert found.model.total_mass == pytest.approx(start.total_mass + told["mass"])
    assert any("take the model of the robot for right" in text for text in found.quality["warnings"]) == known


def test_payload_that_is_less_than_nothing(panda):
    """The hand is on the model and not on the robot, which feels nothing of it: it is found, and what is left is physical."""
    model, _ = panda
    bare = re.sub(
        r'<link name="panda_(hand|leftfinger|rightfinger)">.*?</link>',
        lambda found: re.sub("<inertial>.*?</inertial>", "", found.group(0), flags=re.DOTALL),
        PANDA,
        flags=re.DOTALL,
    )
    real = dd.load_urdf(bare, locked_joints=HELD)
    missing = model.total_mass - real.total_mass
    assert missing > 0.5
    oracle = Oracle(bare, model.dof_names, locked_joints=HELD)
    found = dd.identify(recording(model, oracle, 5, noise=True, extra=np.zeros_like), model, "payload:panda_link7")
    assert found.quality["payload"]["mass"] == pytest.approx(-missing, abs=0.02)
    refuse_unphysical(found.model)
    assert found.quality["explained"][1] > found.quality["explained"][0]
    assert found.parameters.origin["locked_joints"] == HELD
    parameters, shared = without_impossible_links(found.model, found.parameters)
    assert set(shared) == {"panda_link7", "panda_hand", "panda_leftfinger", "panda_rightfinger"}
    assert parameters.payloads == {}
    assert all(inertias.is_physical(inertias.of_body(*parameters.links[name])) for name in shared)
    written = dd.load_urdf(urdf_with(PANDA, parameters), locked_joints=HELD)
    q = model.random(np.random.default_rng(3))
    masses = [dd.DiagonalDynamics(one).mass_matrix(q) for one in (written, found.model)]
    np.testing.assert_allclose(*masses, atol=1e-12)
    np.testing.assert_allclose(
        *(dd.DiagonalDynamics(one).gravity_torque(q) for one in (written, found.model)), atol=1e-12
    )


def test_payloads_that_their_links_can_carry_stay(panda):
    model, _ = panda
    parameters = dd.Parameters(payloads={"panda_hand": dd.Payload(0.4, (0.0, 0.0, 0.1), 1e-3 * np.eye(3))})
    same, shared = without_impossible_links(model.with_parameters(parameters), parameters)
    assert shared == []
    assert same.payloads == parameters.payloads
    assert same.links == {}


# --- What a recording must be ---


@pytest.fixture(scope="module")
def noisy(panda):
    model, oracle = panda
    return recording(model, oracle, 6, noise=True)


def sifted(data, *changes, size=None):
    """Segments of a recording that comes in pieces of a size; changed by functions of portions; and its Sifter."""
    sifter, found = Sifter(data.model), []
    portions = sifter.sifted(piece.states for piece in in_pieces(data, size or len(data))())
    for change in changes:
        portions = change(portions)
    for states, begins in portions:
        found = [*found, states] if begins else [*found[:-1], Segment.together([found[-1], states])]
    return found, sifter


def in_pieces(data, size):
    """What yields the pieces of a recording whenever it is called."""

    def pieces():
        for first in range(0, len(data), size):
            states = data.states.part(slice(first, first + size))
            yield dd.Recording(data.model, states, data.offset, data.counts, data.findings, data.path)

    return pieces


def changed(model, data, **columns):
    return recorded(model, data.t, *(columns.get(name, getattr(data, name)) for name in ("q", "qd", "tau")))


def scaled(data, name, factors):
    values = getattr(data, name).copy()
    for k, factor in factors.items():
        values[:, k] *= factor
    return values


@pytest.mark.parametrize(
    ("column", "factors", "message"),
    [
        ("qd", dict.fromkeys(range(7), 180.0 / np.pi), r"velocities of joint 'panda_joint\d' reach .* degrees"),
        ("qd", {2: np.pi / 180.0}, r"'panda_joint3' change by 57.\d* times .* positions in degrees"),
        ("qd", {2: -1.0}, r"'panda_joint3' change by -1 times .* of the other sign"),
        ("qd", {4: 1.3}, r"'panda_joint5' change by 0.769\d* times .* are velocities those of the motor"),
        ("tau", {1: -1.0}, r"effort of joint 'panda_joint2' is of the other sign: it changes by -"),
        ("tau", {1: 1000.0}, r"effort of joint 'panda_joint2' changes by .* is it in N m or N"),
    ],
)
def test_units_are_judged_first(panda, noisy, column, factors, message):
    model, _ = panda
    with pytest.raises(dd.InputError, match=message):
        dd.identify(changed(model, noisy, **{column: scaled(noisy, column, factors)}), model)


def test_efforts_without_gravity_are_told(panda, noisy):
    model, _ = panda
    tau = noisy.tau - dd.DiagonalDynamics(model).gravity_torque_batch(noisy.q)
    with pytest.raises(dd.InputError, match=r"gravity is not in the efforts: .*effort_includes_gravity"):
        dd.identify(changed(model, noisy, tau=tau), model)


def test_late_velocities_are_put_right(panda, noisy):
    model, oracle = panda
    late = np.column_stack([np.interp(noisy.t - 0.012, noisy.t, column) for column in noisy.qd.T])
    found = dd.identify(changed(model, noisy, qd=late), model, "friction")
    assert found.quality["velocity_delay"][0] == pytest.approx(0.012, abs=1e-3)
    assert any("12." in text or "11." in text for text in found.quality["findings"] if "late" in text)
    assert residual(found.model, model, oracle)[0] < 1.0
    assert dd.identify(noisy, model, "friction").quality["velocity_delay"] == [0.0]


def test_a_joint_that_does_not_move_keeps_its_friction(panda, noisy):
    model, oracle = panda
    t, q, qd, qdd = motion(model, 6, 20.0, 250.0)
    q[:, 4], qd[:, 4], qdd[:, 4] = q[0, 4], 0.0, 0.0
    data = recorded(model, t, q, qd, efforts(oracle, q, qd, qdd) + friction(qd))
    found = dd.identify(data, model, "friction")
    assert "panda_joint5" not in found.parameters.joints and len(found.parameters.joints) == 6
    assert any("'panda_joint5' moves 0 s forward" in text for text in found.quality["findings"])
    still = recorded(model, t, np.tile(q[:1], (len(t), 1)), 0.0 * qd, noisy.tau[: len(t)])
    with pytest.raises(dd.InputError, match="no joint moves enough"):
        dd.identify(still, model, "friction")


@pytest.fixture(scope="module")
def drifting(panda, noisy):
    """A joint without friction whose sensor drifts: what was fitted to one time is wrong at any other."""
    model, _ = panda
    tau = noisy.tau.copy()
    tau[:, 6] += np.interp(noisy.t, [0.0, 2.0 / 3.0 * noisy.t[-1]], [-1.0, 1.0]) - friction(noisy.qd)[:, 6]
    return changed(model, noisy, tau=tau)


def test_a_joint_keeps_its_friction_where_blocks_left_out_speak_against_another(panda, drifting):
    model, _ = panda
    found = dd.identify(drifting, model, "friction")
    ((joint, (without, own)),) = found.quality["kept"]["friction"].items()
    assert joint == "panda_joint7" and without <= own
    assert set(found.parameters.joints) == set(model.dof_names[:6])
    assert found.model.friction[6] == found.model.effort_offset[6] == 0.0
    before, after = found.quality["row_residual"]["panda_joint7"]
    assert after == pytest.approx(before)
    assert any("friction of joint 'panda_joint7': as the model has it" in text for text in found.quality["warnings"])


def test_what_the_part_held_out_says_changes_no_joint(panda, drifting):
    """The joint is chosen by the part that is fitted alone: the judge has no hand in it."""
    model, _ = panda
    tau = drifting.tau.copy()
    late = drifting.t > 0.67 * drifting.t[-1]
    tau[late, 6] = drifting.tau[late, 6] + 3.0 * np.sign(drifting.qd[late, 6])
    found = dd.identify(changed(model, drifting, tau=tau), model, "friction")
    assert found.quality["kept"] == dd.identify(drifting, model, "friction").quality["kept"]


def in_blocks(model, segments):
    """Equations of segments, none of which is held out, and their Blocks."""
    equations = Equations(model, 2.0 * np.pi, V0)
    cut, bounds, block = Cut(sum(one.t[-1] - one.t[0] for one in segments)), [equations.sums()], 0
    for one in segments:
        for number, part, begins in cut.take(one, True, np.inf):
            if number != block:
                bounds.append(equations.sums())
                block = number
            equations.take(part, begins)
    return equations, Blocks([*bounds, equations.sums()], False)


def test_blocks_add_up_to_the_rows(panda, drifting):
    """Over several segments, too; and the fewest seconds make no blocks."""
    model, _ = panda
    ((segment,), _) = sifted(drifting)
    parts = [segment.part(slice(0, 1100)), segment.part(slice(1100, 1103)), segment.part(slice(1200, 5000))]
    whole = Equations(model, 2.0 * np.pi, V0)
    for part in parts:
        whole.take(part)
    equations, blocks = in_blocks(model, parts)
    np.testing.assert_allclose(blocks.sums.weight, whole.sums().weight, rtol=1e-12)
    for mine, its in zip(blocks.sums.square, whole.sums().square, strict=True):
        np.testing.assert_allclose(mine, its, rtol=1e-9, atol=1e-9 * np.abs(its).max())
    layout = Layout(model, equations)
    free = Free(np.ones(model.nv, bool), np.zeros(model.nv, bool), False, None)
    without = free._replace(friction=free.rotors)
    worth = blocks.worth(layout, [], free, without, 10.0)
    np.testing.assert_allclose(worth.without, np.sqrt(layout.mean_squares([blocks.rows], layout.known)), rtol=1e-9)
    np.testing.assert_array_equal(worth.pays(), np.arange(7) < 6)
    _, short = in_blocks(model, [segment.part(slice(0, 740))])
    assert short.worth(layout, [], free, without, 10.0) is None


def test_what_is_left_out_is_told(panda, noisy):
    """Garbage, rows without effort, stamps that go back, a gap: counted, and the result is nearly that without them."""
    model, oracle = panda
    t, q, qd, tau = noisy.t.copy(), noisy.q.copy(), noisy.qd.copy(), noisy.tau.copy()
    qd[100], tau[200] = 25.0, np.nan
    t[300] = t[298]
    kept = np.r_[0:2000, 2100 : len(t)]
    data = recorded(model, *(column[kept] for column in (t, q, qd, tau)))
    found = dd.identify(data, model, "friction")
    texts = " ".join(found.quality["findings"])
    assert all(f"{cause}:" in texts for cause in ("too fast", "not whole", "time did not go on"))
    assert residual(found.model, model, oracle)[0] < 1.0


def test_segments_end_at_gaps_and_jumps(panda, noisy):
    model, _ = panda
    kept = np.r_[0:1000, 1100 : len(noisy.t)]
    data = recorded(model, *(column[kept] for column in (noisy.t, noisy.q, noisy.qd, noisy.tau)))
    moved = np.zeros(len(kept), dtype=bool)
    moved[[3000, 3001]] = True
    data = dd.Recording(model, data.states._replace(moved=moved), data.offset, {}, [])
    segments, sifter = sifted(data)
    findings = sifter.findings()
    assert [len(segment.t) for segment in segments] == [1000, 2000, len(kept) - 3001]
    assert [finding.cause for finding in findings] == ["scattered"] and findings[0].count == 1
    np.testing.assert_allclose(segments[1].t, noisy.t[1100:3100], atol=1e-9)
    np.testing.assert_array_equal(segments[2].q, noisy.q[3101:])


def test_what_follows_after_stamps_went_back_is_fitted_too(panda, tmp_path):
    """A file of two runs of 7 s, the second one from the first one's stamps on: as a robot that was started again."""
    model, oracle = panda
    runs = [recording(model, oracle, seed, 7.0, noise=True) for seed in (21, 22)]
    columns = [np.concatenate(pair) for pair in zip(*((one.t, one.q, one.qd, one.tau) for one in runs), strict=True)]
    names = ["t", *(f"{kind}_{name}" for kind in ("q", "qd", "tau") for name in model.dof_names)]
    path = tmp_path / "two_runs.csv"
    np.savetxt(path, np.column_stack(columns), delimiter=",", comments="", fmt="%.17g", header=",".join(names))
    data = dd.read_recording(path, model)
    assert data.counts["time jumped back"] == 1 and len(data) == 2 * len(runs[0]) - 1
    segments, sifter = sifted(data)
    findings = sifter.findings()
    assert [len(segment.t) for segment in segments] == [len(runs[0]), len(runs[1]) - 1]
    assert [finding.cause for finding in findings] == ["time began anew"] and findings[0].count == 1
    assert segments[1].t[0] > segments[0].t[-1] and segments[1].stamp[0] < segments[0].stamp[-1]
    np.testing.assert_allclose(np.diff(segments[1].t), np.diff(runs[1].t[1:]), atol=1e-9)
    found = dd.identify(data, model, "friction")
    begin, end = found.quality["held_out"]
    assert end == pytest.approx(runs[1].t[-1], abs=1e-6) and begin == pytest.approx(end - 14.0 / 3.0, abs=0.02)
    assert (
        residual(found.model, model, oracle)[0]
        < residual(dd.identify(runs[0], model, "friction").model, model, oracle)[0]
    )
    quality = Quality(model)
    quality.take(data.states)
    assert quality.duration == pytest.approx(14.0, abs=0.05)


@pytest.mark.parametrize(
    ("stamps", "begins"),
    [
        (range(40), []),
        ([*range(20), 18, *range(20, 40)], []),  # one late row
        ([*range(20), *range(12, 40)], []),  # a stretch that was written twice
        ([*range(20), *range(20)], [20]),
        ([*range(20), *range(5)], []),  # too short to tell
        ([*range(100, 120), *range(50, 70), *range(15)], [20, 40]),
    ],
)
def test_time_begins_anew_where_stamps_go_on_from_before(stamps, begins):
    stamps = np.array(stamps)
    assert Beginnings().among(stamps, len(stamps)) == begins
    one_by_one = Beginnings()
    assert [k for k in range(len(stamps)) if one_by_one.among(stamps[k:], 1)] == begins


def test_arguments_are_checked(panda, noisy):
    model, _ = panda
    for what, message in (
        (("friction", "mass"), "what has 'mass', expected friction, rotors, inertias or payload:<link>"),
        ((), "what is empty"),
        ("payload:elbow", "'elbow' is not a link of robot 'panda'"),
        ("payload:panda_link0", "no joint moves link 'panda_link0'"),
        (("payload:panda_hand", "payload:panda_link7"), "what has 2 payloads, expected one"),
        (("payload:panda_hand", "inertias"), "give one without the payload as reference"),
    ):
        with pytest.raises(dd.InputError, match=message):
            dd.identify(noisy, model, what)
    with pytest.raises(dd.InputError, match="reference is for a payload"):
        dd.identify(noisy, model, "friction", reference=noisy)
    with pytest.raises(dd.InputError, match="recordings is empty"):
        dd.identify([], model)
    with pytest.raises(dd.InputError, match=r"recordings\[0\] is of robot"):
        dd.identify(noisy, dd.load_robot("ur5"))
    with pytest.raises(dd.InputError, match="no efforts"):
        dd.identify(recorded(model, noisy.t, noisy.q, noisy.qd, None), model)
    with pytest.raises(dd.UnsupportedError, match="floating base"):
        dd.identify(noisy, dd.load_urdf(PANDA, floating_base=True))


# --- Of any length ---


@pytest.fixture(scope="module")
def eventful(panda):
    """Two runs of 45 s at 1 kHz: late velocities, garbage, states without effort, stamps that go back, gaps, jumps."""
    model, oracle = panda
    t, q, qd, qdd = motion(model, 31, 45.0, 100.0)
    columns = [q, qd, efforts(oracle, q, qd, qdd) + friction(qd)]
    fine = np.arange(0.0, 44.9, 1e-3)
    rng = np.random.default_rng(31)
    q, qd, tau = (np.column_stack([np.interp(fine, t, one) for one in column.T]) for column in columns)
    qd = np.column_stack([np.interp(fine - 0.012, fine, one) for one in qd.T]) + 1e-2 * rng.normal(size=qd.shape)
    tau = tau + NOISE * rng.normal(size=qd.shape)
    qd[7000], tau[9000:9003] = 25.0, np.nan
    fine[500] = fine[498]
    rows = np.r_[0:12_000, 12_100:20_005, 20_300 : len(fine), 0 : len(fine) - 3000]
    data = recorded(model, *(column[rows] for column in (fine, q, qd, tau)))
    moved = np.zeros(len(rows), dtype=bool)
    moved[[30_000, 30_004, 60_000]] = True
    return dd.Recording(model, data.states._replace(moved=moved), data.offset, {}, [])


@pytest.mark.parametrize("size", [411, 20_000, 33_333])
def test_pieces_of_any_size_give_what_the_whole_does(panda, eventful, size):
    """Bit for bit: the state of the filter, of the segments and of every judgement is carried over the seams."""
    model, _ = panda
    whole = dd.identify(eventful, model, "friction")
    texts = " ".join(whole.quality["findings"])
    assert all(
        f"{cause}" in texts for cause in ("too fast", "not whole", "time did not go on", "began anew", "scattered")
    )
    assert whole.quality["velocity_delay"][0] == pytest.approx(0.012, abs=1e-3)
    pieces = dd.identify(in_pieces(eventful, size), model, "friction")
    assert pieces.quality == whole.quality
    for name in ("damping", "friction", "effort_offset"):
        np.testing.assert_array_equal(getattr(pieces.model, name), getattr(whole.model, name))
    assert pieces.parameters.origin["recordings"] == whole.parameters.origin["recordings"]


@pytest.mark.parametrize("size", [97, 20_000])
def test_portions_do_not_depend_on_pieces(eventful, size):
    """Nor do they lose, double or mix states; and velocities are put right as over the whole segment."""
    whole, pieces = sifted(eventful)[0], sifted(eventful, size=size)[0]
    cut = sifted(eventful, lambda portions: in_portions(portions, 700), size=size)[0]
    for one, other, third in zip(whole, pieces, cut, strict=True):
        for column, again, once_more in zip(one, other, third, strict=True):
            np.testing.assert_array_equal(column, again)
            np.testing.assert_array_equal(column, once_more)
    for delay in (0.012, -0.008):
        late = sifted(eventful, partial(without_delay, delay=delay), size=size)[0]
        for segment, put_right in zip(whole, late, strict=True):
            at = segment.t + delay
            within = (at >= segment.t[0]) & (at <= segment.t[-1])
            np.testing.assert_array_equal(put_right.t, segment.t[within])
            expected = np.column_stack([np.interp(at[within], segment.t, column) for column in segment.qd.T])
            np.testing.assert_array_equal(put_right.qd, expected)


@pytest.mark.parametrize("size", [1, 3, 100])
def test_portions_are_even(size):
    """About as many states in each, whatever they came in: none is shorter than half of that but a whole segment."""
    none = np.zeros((1000, 1))
    segment = Segment(np.arange(1000), np.arange(1000.0), none, none, none)
    given = [(segment.part(slice(k, min(k + size, 740))), k == 0) for k in range(0, 740, size)]
    given += [(segment.part(slice(740, 743)), True), (segment.part(slice(743, 1000)), True)]
    found = [(len(states.t), begins) for states, begins in in_portions(given, 100)]
    assert found == [(100, True), *[(100, False)] * 5, (140, False), (3, True), (100, True), (100, False), (57, False)]
    assert sum(number for number, _ in found) == 1000 and all(50 <= number < 150 or number == 3 for number, _ in found)
    assert [begins for _, begins in found].count(True) == 3
    late = [(states.t[0], begins) for states, begins in in_portions(since(given, 601.0), 100)]
    assert late[0] == (601.0, True) and [begins for _, begins in late].count(True) == 3


@pytest.mark.parametrize("size", [997, 20_000, 200_000])
def test_curves_of_any_length_are_some_steps_and_all_peaks(size):
    """Whatever the rows come in; gaps stay gaps."""
    number, rng = 200_000, np.random.default_rng(0)
    time, values = np.arange(float(number)), rng.normal(size=(number, 2))
    values[123_456, 0], values[77, 1] = 50.0, -60.0
    time[150_000:] += 1e5
    curves = Curves()
    bounds = sorted({*range(0, number, size), 150_000, number})
    for first, end in pairwise(bounds):
        curves.take(time[first:end], values[first:end], first in (0, 150_000))
    drawn, lines = curves.drawn()
    assert len(drawn) == len(lines) <= 2 * MOST + 1 and (np.diff(drawn) >= 0.0).all()
    assert np.nanmax(lines[:, 0]) == 50.0 and np.nanmin(lines[:, 1]) == -60.0
    ((gap,),) = np.nonzero(np.isnan(lines[:, 0]))
    assert drawn[gap - 1] < 150_000 and drawn[gap] == drawn[gap + 1] == 250_000
    few = Curves()
    few.take(time[:900], values[:900], True)
    np.testing.assert_array_equal(few.drawn()[1], values[:900])


def test_memory_does_not_grow_with_the_length(panda):
    """Of a periodic motion that goes on for longer, in pieces that are made when they are asked for; a third is held out."""
    model, oracle = panda
    one = recording(model, oracle, 6, rate=500.0, noise=True)

    def pieces(times):
        for k in range(times):
            stamp = one.stamp + k * 20 * 10**9
            states = one.states._replace(newest=stamp, oldest=stamp, log_time=stamp)
            yield dd.Recording(model, states, one.offset, {}, [])

    def peak(times):
        tracemalloc.start()
        try:
            dd.identify(lambda: pieces(times), model, "friction")
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    short = peak(8)
    assert peak(20) < 1.05 * short


def test_what_can_be_read_once_is_refused(panda, noisy):
    model, _ = panda
    once = in_pieces(noisy, 1000)()
    for given, name in ((once, "recordings"), ([noisy, once], r"recordings\[1\]")):
        with pytest.raises(dd.InputError, match=name + " is <generator .*read once.*lambda: dd.stream_recording"):
            dd.identify(given, model)
    with pytest.raises(dd.InputError, match="has 0 states when it is read again, and had 5000: a file must be written"):
        dd.identify(lambda: once, model)
    with pytest.raises(dd.InputError, match=r"'recordings\[0\]' has not a single state: it has no messages"):
        dd.identify(list, model)
    with pytest.raises(dd.InputError, match=r"recordings\[0\] returns 7, expected pieces"):
        dd.identify(lambda: 7, model)
    with pytest.raises(dd.InputError, match=r"a piece of recordings\[0\] is 'my_bag', expected a Recording"):
        dd.identify(lambda: ["my_bag"], model)


# --- What comes out ---


def test_a_file_gives_the_same_model(panda, noisy, tmp_path):
    model, _ = panda
    start = wrong(model, np.random.default_rng(9), 0.2)
    found = dd.identify(changed(start, noisy), start, ("friction", "inertias"))
    assert json.loads(json.dumps(found.quality)) == found.quality
    found.save(tmp_path / "arm.yaml")
    again = start.with_parameters(tmp_path / "arm.yaml")
    for name in ("damping", "friction", "effort_offset", "armature"):
        np.testing.assert_array_equal(getattr(again, name), getattr(found.model, name))
    np.testing.assert_array_equal(again.bodies, found.model.bodies)
    origin = dd.Parameters.load(tmp_path / "arm.yaml").origin
    assert origin["method"].endswith("friction, inertias") and origin["recordings"][0]["states"] == len(noisy)
    assert set(found.quality["torque_rms"]) == set(model.dof_names)
    begin, end = found.quality["held_out"]
    assert end - begin == pytest.approx((noisy.t[-1] - noisy.t[0]) / 3.0, rel=1e-3)


def test_several_recordings_are_one(panda):
    """Two recordings; the part held out is of the last one, in its times."""
    model, oracle = panda
    both = [recording(model, oracle, seed, 8.0, noise=True) for seed in (21, 22)]
    found = dd.identify(both, model, "friction")
    begin, end = found.quality["held_out"]
    assert end == pytest.approx(both[1].t[-1], abs=1e-6) and begin == pytest.approx(end - 16.0 / 3.0, abs=0.02)
    assert len(found.quality["velocity_delay"]) == 2
    assert residual(found.model, model, oracle)[0] < 0.3


def test_a_payload_of_the_model_stays_beside_what_is_identified(panda):
    """Inertias of links are those without the payload that load_urdf was told of."""
    model, oracle = panda
    mass, centre, about = LOAD
    carrying = wrong(model, np.random.default_rng(13)).with_payload("panda_hand", mass, centre, about)
    data = recording(carrying, loaded(oracle), 14, rate=500.0, extra=np.zeros_like)
    found = dd.identify(data, carrying, "inertias")
    assert found.quality["taken"] == ["inertias"]
    assert found.model.payloads["panda_hand"].mass == mass
    assert residual(found.model, model, loaded(oracle), np.zeros_like)[0] < 1e-2
    refuse_unphysical(found.model.without_payload("panda_hand"))
