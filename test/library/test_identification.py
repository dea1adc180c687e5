# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Identification on simulated motions whose efforts are Pinocchio's: results, rejected recordings, warnings."""

import json
import re
import tracemalloc

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from diag_dynamics.identification import inertias
from diag_dynamics.identification.result import without_impossible_links
from diag_dynamics.model.rewriting import urdf_with
from diag_dynamics.recordings.quality import Quality
from examples import shortened, some_of
from motions import efforts, fourier, recorded
from oracles import Oracle
from robots import description, joint, link, robot

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

PANDA = robot("panda_description/urdf/panda.urdf").urdf
UR5 = robot("ur_description/urdf/ur5_robot.urdf")
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


# --- Exact data ---


def test_friction_is_recovered_exactly(panda):
    model, oracle = panda
    found = dd.identify(recording(model, oracle, 1, shortened(20.0, 8.0), rate=1000.0), model, "friction")
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
    found = dd.identify(recording(start, oracle, 2, shortened(20.0, 6.0), rate=1000.0), start, WITH_ALL)
    assert found.quality["taken"] == ["friction", "inertias"]
    error, largest = residual(found.model, model, oracle, seed=78)
    assert error < 1e-3
    assert largest < 1e-3
    refuse_unphysical(found.model)
    assert any("not determined" in text for text in found.quality["warnings"])


def test_rotors_are_recovered(panda):
    model, oracle = panda
    rotors = np.array([0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0.05])
    t, q, qd, qdd = motion(model, 4, shortened(20.0, 6.0), 1000.0)
    data = recorded(model, t, q, qd, efforts(oracle, q, qd, qdd) + rotors * qdd + friction(qd))
    found = dd.identify(data, model)
    assert found.quality["taken"] == ["friction", "rotors"]
    np.testing.assert_allclose(found.model.armature, rotors, atol=1e-3)
    np.testing.assert_allclose(found.model.damping, DAMPING, atol=1e-3)
    assert any("kinetic energy is" in text for text in found.quality["warnings"])


def test_a_step_that_a_larger_error_hides_is_tried_again(panda):
    """Beside rotors of 3 kg m² friction alone explains next to nothing; once they are known, it does."""
    model, oracle = panda
    t, q, qd, qdd = motion(model, 4, shortened(20.0, 16.0), 250.0)
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
    found = dd.identify(recording(model, oracle, 1, shortened(20.0, 10.0), noise=True), model)
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
    for seed in range(shortened(5, 1)):
        start = wrong(model, np.random.default_rng(seed))
        found = dd.identify(recording(start, oracle, seed, shortened(20.0, 10.0), noise=True), start, WITH_ALL)
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


@pytest.mark.parametrize(("known", "seed"), list(some_of([(True, 11), (True, 12), (False, 12), (False, 11)], 2)))
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


# --- Recordings ---


@pytest.fixture(scope="module")
def noisy(panda):
    model, oracle = panda
    return recording(model, oracle, 6, noise=True)


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


# --- Any length ---


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


@pytest.mark.parametrize("size", list(some_of([20_000, 411, 33_333], 3)))
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


@pytest.mark.full
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
