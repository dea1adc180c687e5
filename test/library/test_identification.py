# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Identification on simulated motions whose efforts are Pinocchio's: results, rejected recordings,
warnings.
"""

import json
import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from coupling import with_payloads
from diag_dynamics.identification import inertias
from diag_dynamics.identification.fit import ConvergenceError, fit_rows
from diag_dynamics.identification.normal_equations import ROTOR
from diag_dynamics.identification.result import require_masses
from examples import shortened, some_of
from motions import changed, efforts, fourier, recorded
from oracles import Oracle
from perturbed import perturbed
from robots import robot, without_hand

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

PANDA = robot("panda_description/urdf/panda.urdf").urdf
HELD = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
V0 = 5e-3
DAMPING = np.array([0.5, 0.5, 0.4, 0.4, 0.2, 0.2, 0.2])
FRICTION = np.array([0.4, 0.5, 0.3, 0.5, 0.3, 0.2, 0.3])
OFFSET = np.array([-0.1, 0.2, 0.05, -0.1, 0.05, 0.03, -0.02])
NOISE = np.array([0.5] * 4 + [0.15] * 3)
ROTORS = np.array([0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0.05])
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


def recording(
    model, oracle, seed, duration=20.0, rate=250.0, noise=0.0, rotors=0.0, resist=friction
):
    """Return a motion with Pinocchio's efforts; noise 1 is 1e-4 rad, 1e-2 rad/s, 0.5 and 0.15 N
    m.
    """
    t, q, qd, qdd = motion(model, seed, duration, rate)
    tau = efforts(oracle, q, qd, qdd) + rotors * qdd + resist(qd)
    rng = np.random.default_rng(1000 + seed)
    q_noise, qd_noise, tau_noise = noise * rng.normal(size=(3, *q.shape))
    return recorded(model, t, q + 1e-4 * q_noise, qd + 1e-2 * qd_noise, tau + NOISE * tau_noise)


def residual(model, truth, oracle, seed=77):
    """Root mean square of |ℓ(τ̂ − τ)| on another motion [J^½/s], τ Pinocchio's, and the largest
    error [N m].
    """
    _, q, qd, qdd = motion(truth, seed, 10.0, 50.0)
    dynamics = dd.DiagonalDynamics(model)
    error = dynamics.inverse_dynamics(q, qd, qdd) + dynamics.friction_torque(qd)
    error -= efforts(oracle, q, qd, qdd) + friction(qd)
    epsilon = dd.DiagonalDynamics(truth).epsilon_from_tau(q, error)
    return np.sqrt((epsilon**2).sum(axis=1).mean()), np.abs(error).max()


def refuse_unphysical(model):
    """Fail unless every body of a model is one that can be."""
    for body in model.bodies[1:]:
        if body["mass"] != 0.0:
            assert inertias.is_physical(inertias.parameters_of_record(body))


def test_inertias_and_friction_predict_another_motion_exactly(panda):
    """From inertias wrong by a third: not each mass comes out, for no motion tells it, but every
    effort does.
    """
    model, oracle = panda
    start = perturbed(model, 0.35, 3)
    assert residual(start, model, oracle, seed=78)[0] > 4.0
    result = dd.identify(
        recording(start, oracle, 2, shortened(20.0, 6.0), rate=1000.0), start, WITH_ALL
    )
    assert {"friction", "inertias"} <= set(result.quality["taken"])
    assert max(residual(result.model, model, oracle, seed=78)) < 1e-3
    refuse_unphysical(result.model)
    assert any("not observable" in text for text in result.quality["warnings"])


def test_rotors_and_friction_are_recovered(panda):
    model, oracle = panda
    result = dd.identify(
        recording(model, oracle, 4, shortened(20.0, 6.0), 1000.0, rotors=ROTORS), model
    )
    assert result.quality["taken"] == ["friction", "rotors"]
    for key, truth in (
        ("armature", ROTORS),
        ("damping", DAMPING),
        ("friction", FRICTION),
        ("effort_offset", OFFSET),
    ):
        np.testing.assert_allclose(getattr(result.model, key), truth, atol=1e-3)
    assert any("kinetic energy is" in text for text in result.quality["warnings"])


@pytest.mark.parametrize(
    ("what", "felt"), [("friction", 0.0), ("friction", 1.0), (("friction", "rotors"), 0.0)]
)
def test_rotors_of_the_model_that_efforts_may_not_contain(panda, what, felt):
    """Torque sensors behind the gears do not feel the rotors of a URDF: no effort is left with
    armature 0.
    """
    model, oracle = panda
    joints = {
        name: {"armature": inertia} for name, inertia in zip(model.dof_names, ROTORS, strict=True)
    }
    identified = model.with_parameters({"joints": joints})
    result = dd.identify(
        recording(identified, oracle, 4, 6.0, noise=0.02, rotors=felt * ROTORS), identified, what
    )
    np.testing.assert_allclose(result.model.armature, felt * ROTORS, atol=2e-3)
    np.testing.assert_allclose(result.model.friction, FRICTION, atol=0.03)
    left_out = [
        text
        for text in result.quality["warnings"]
        if "rotor inertias of the model are omitted" in text
    ]
    assert len(left_out) == (felt == 0.0)
    quality = result.quality
    assert felt or (
        "rotors" not in quality["kept"]
        and not any("rotors" in rung["steps"] for rung in quality["ladder"])
    )


def test_a_step_that_a_larger_error_hides_is_tried_again(panda):
    """Beside rotors of 3 kg m² friction alone explains next to nothing; once they are known, it
    does.
    """
    model, oracle = panda
    result = dd.identify(
        recording(model, oracle, 4, shortened(20.0, 16.0), noise=1.0, rotors=3.0),
        model,
        ("friction", "rotors"),
    )
    steps = [(rung["steps"], rung["taken"]) for rung in result.quality["ladder"]]
    assert steps == [
        ([], True),
        (["friction"], False),
        (["rotors"], True),
        (["friction", "rotors"], True),
    ]
    deviations = np.array([joint["armature"] for joint in result.quality["deviations"].values()])
    assert (np.abs(result.model.armature - 3.0) < 2.0 * deviations).all()
    assert deviations.max() < 0.06
    np.testing.assert_allclose(result.model.friction, FRICTION, atol=0.05)
    assert not any("the model's values are kept" in text for text in result.quality["warnings"])


LOAD = 1.2, np.array([0.03, -0.02, 0.12]), np.diag([0.004, 0.005, 0.003])


def loaded(oracle):
    """The oracle with a payload on its hand."""
    other = Oracle(PANDA, oracle.dof_names, locked_joints=HELD)
    frame = other.model.frames[other.model.getFrameId("panda_hand", pin.FrameType.BODY)]
    mass, centre, about = LOAD
    other.model.appendBodyToJoint(
        frame.parentJoint, pin.Inertia(mass, centre, about), frame.placement
    )
    other.data = other.model.createData()
    return other


@pytest.mark.parametrize(
    ("known", "seed"), list(some_of([(True, 11), (True, 12), (False, 12), (False, 11)], 2))
)
def test_payload(panda, known, seed):
    """Ten seconds of noise: mass and centre, within their standard deviations; against a wrong
    robot by a reference run.

    Gains, here exact, are uncertain by 5 %: no mass is more certain than the mean of seven joints.
    """
    model, oracle = panda
    start = model if known else perturbed(model, 0.35, seed)
    data = recording(start, loaded(oracle), seed, 10.0, noise=1.0, resist=np.zeros_like)
    reference = (
        None
        if known
        else recording(start, oracle, 100 + seed, 20.0, noise=1.0, resist=np.zeros_like)
    )
    result = dd.identify(data, start, "payload:panda_hand", reference=reference)
    stated = result.quality["payload"]
    mass, centre, _ = LOAD
    assert stated["mass"] == pytest.approx(mass, rel=6e-3)
    np.testing.assert_allclose(stated["com"], centre, atol=3e-3)
    assert abs(stated["mass"] - mass) < 2.0 * stated["mass_deviation"]
    assert stated["mass_deviation"] > 0.05 * mass / np.sqrt(7.0)
    assert (np.abs(stated["com"] - centre) < 4.0 * np.array(stated["com_deviation"])).all()
    assert re.search("error of 20 to 50 %|not observable", stated["inertia_known"])
    assert result.parameters.payloads["panda_hand"].mass == stated["mass"]
    assert not result.parameters.links and not result.parameters.joints
    assert result.model.total_mass == pytest.approx(start.total_mass + stated["mass"])
    assert (
        any("assume a correct model of the robot" in text for text in result.quality["warnings"])
        == known
    )


def test_payload_without_noise_beside_a_reference(panda):
    """Its inertia is not that of the prior."""
    model, oracle = panda
    start = perturbed(model, 0.35, 11)
    data, reference = (
        recording(start, arm, seed, 6.0, 1000.0, resist=np.zeros_like)
        for arm, seed in ((loaded(oracle), 11), (oracle, 111))
    )
    quality = dd.identify(data, start, "payload:panda_hand", reference=reference).quality
    payload = quality["payload"]
    mass, centre, inertia = LOAD
    assert payload["mass"] == pytest.approx(mass, rel=2e-3)
    np.testing.assert_allclose(payload["com"], centre, atol=1e-3)
    np.testing.assert_allclose(payload["inertia"], inertia, atol=0.1 * np.trace(inertia))


def test_a_centre_beyond_the_reach_of_the_arm_is_named(panda):
    """The Panda reaches 1.4 m."""
    model, oracle = panda
    t, q, qd, qdd = motion(model, 5, 10.0, 100.0)
    light = Oracle(
        with_payloads(PANDA, {"panda_hand": (0.2, [3.0, 0.0, 0.0], 0.01 * np.eye(3))}),
        model.dof_names,
        locked_joints=HELD,
    )
    for arm, named in ((loaded(oracle), False), (light, True)):
        tau = efforts(arm, q, qd, qdd)
        result = dd.identify(recorded(model, t, q, qd, tau), model, "payload:panda_hand")
        assert any("beyond the arm's reach" in text for text in result.quality["warnings"]) == named


def test_recordings_of_different_payloads_are_named(panda):
    """Two with the same payload are not."""
    model, oracle = panda
    same, other = (
        recording(model, loaded(oracle), seed, 10.0, 100.0, 1.0, resist=np.zeros_like)
        for seed in (1, 2)
    )
    without = recording(model, oracle, 2, 10.0, 100.0, 1.0, resist=np.zeros_like)
    for data, named in (([same, other], False), ([same, without], True)):
        result = dd.identify(data, model, "payload:panda_hand")
        text = " ".join(result.quality["warnings"])
        assert ("have different payloads: recordings[1]" in text) == named


def test_a_negative_payload(panda):
    """The model has a hand that the robot lacks: its mass is found, and the links that are left are
    physical.
    """
    model, _ = panda
    bare = without_hand(PANDA)
    missing = model.total_mass - dd.load_urdf(bare, locked_joints=HELD).total_mass
    oracle = Oracle(bare, model.dof_names, locked_joints=HELD)
    result = dd.identify(
        recording(model, oracle, 5, noise=1.0, resist=np.zeros_like), model, "payload:panda_link7"
    )
    assert missing > 0.5 and result.quality["payload"]["mass"] == pytest.approx(-missing, abs=0.02)
    refuse_unphysical(result.model)
    assert result.parameters.origin["locked_joints"] == HELD
    with pytest.raises(dd.InputError, match=r"'panda_link7' is -0\.7\d* kg, which leaves -0"):
        require_masses(result.model, result.parameters.payloads)


@pytest.fixture(scope="module")
def noisy(panda):
    model, oracle = panda
    return recording(model, oracle, 6, noise=1.0)


def in_pieces(data, size):
    """What yields the pieces of a recording whenever it is called."""

    def pieces():
        for first in range(0, len(data), size):
            states = data.states[first : first + size]
            yield dd.Recording(
                data.model, states, data.offset, data.counts, data.findings, data.path
            )

    return pieces


@pytest.mark.parametrize(
    ("factors", "message"),
    [
        (
            dict.fromkeys(range(7), 180.0 / np.pi),
            r"joint 'panda_joint\d' change by 0.0174\d* times .* velocities seem to be in degrees",
        ),
        ({2: -1.0}, r"'panda_joint3' change by -1 times .* the wrong sign"),
        ({4: 1.3}, r"'panda_joint5' change by 0.769\d* times"),
    ],
)
def test_units_are_judged_first(panda, noisy, factors, message):
    """Units of efforts are judged in test_identification_efforts.py."""
    with pytest.raises(dd.InputError, match=message):
        dd.identify(
            changed(noisy, qd=noisy.qd * [factors.get(k, 1.0) for k in range(7)]),
            panda[0],
        )


def test_a_joint_that_does_not_move_keeps_its_friction(panda):
    model, oracle = panda
    t, q, qd, qdd = motion(model, 6, 20.0, 250.0)
    q[:, 4] = q[0, 4]
    qd[:, 4] = 0.0
    qdd[:, 4] = 0.0
    tau = efforts(oracle, q, qd, qdd) + friction(qd)
    result = dd.identify(recorded(model, t, q, qd, tau), model, "friction")
    assert result.quality["velocity_delay"] == [0.0]
    assert "panda_joint5" not in result.parameters.joints and len(result.parameters.joints) == 6
    assert any("'panda_joint5' moves 0 s forward" in text for text in result.quality["findings"])
    with pytest.raises(dd.InputError, match=r"^recordings\[0\]: no joint moves enough"):
        dd.identify(
            recorded(model, t, np.tile(q[:1], (len(t), 1)), 0.0 * qd, tau), model, "friction"
        )


def test_a_joint_keeps_its_friction_where_blocks_left_out_speak_against_another(panda, noisy):
    """Its sensor drifts, and it has no friction."""
    model, _ = panda
    tau = noisy.tau.copy()
    tau[:, 6] += np.linspace(-1.0, 1.0, len(tau)) - friction(noisy.qd)[:, 6]
    result = dd.identify(changed(noisy, tau=tau), model, "friction")
    ((joint, (without, fitted)),) = result.quality["kept"]["friction"].items()
    assert joint == "panda_joint7" and fitted > 0.97 * without
    assert set(result.parameters.joints) == set(model.dof_names[:6])
    assert result.model.friction[6] == result.model.effort_offset[6] == 0.0
    before, after = result.quality["row_residual"]["panda_joint7"]
    assert after == pytest.approx(before)
    assert any(
        "friction of panda_joint7: the model's values" in text
        for text in result.quality["warnings"]
    )


HAND = "payload:panda_hand"
WRONG = {
    r"what is .*mass.*; expected one or more of": lambda data: (
        data,
        data.model,
        ("friction", "mass"),
    ),
    r"what is \(\); expected": lambda data: (data, data.model, ()),
    "no joint moves link 'panda_link0'": lambda data: (data, data.model, "payload:panda_link0"),
    "expected one payload at most": lambda data: (data, data.model, (HAND, "payload:panda_link7")),
    "reference is missing. Give a recording without": lambda data: (
        data,
        data.model,
        (HAND, "inertias"),
    ),
    "floating base": lambda data: (data, dd.load_urdf(PANDA, floating_base=True)),
    r"recordings\[0\] is of robot": lambda data: (data, dd.load_robot("ur5")),
    "efforts of all joints": lambda data: (
        recorded(data.model, data.t, data.q, data.qd, None),
        data.model,
    ),
    "recordings is <generator .* such as lambda": lambda data: (
        in_pieces(data, 1000)(),
        data.model,
    ),
    r"a piece of recordings\[0\] is 'my_bag'": lambda data: (lambda: ["my_bag"], data.model),
}


@pytest.mark.parametrize("key", WRONG)
def test_arguments_are_checked(noisy, key):
    with pytest.raises((dd.InputError, dd.UnsupportedError), match=key):
        dd.identify(*WRONG[key](noisy))
    with pytest.raises(dd.InputError, match="what is 'friction'; expected payload"):
        dd.identify(noisy, noisy.model, "friction", reference=noisy)


@pytest.mark.parametrize("part", ["rotors", "payload:panda_hand"])
def test_a_part_whose_fit_does_not_converge_is_left_out(panda, noisy, monkeypatch, part):
    """The others are identified, and a warning names it; alone it is an error."""

    def fit(layout, rows, free, *others):
        if free[layout.own(ROTOR)].any() if part == "rotors" else layout.payload:
            raise ConvergenceError("The identification did not converge within 400 Newton steps.")
        return fit_rows(layout, rows, free, *others)

    monkeypatch.setattr("diag_dynamics.identification.selection.fit_rows", fit)
    result = dd.identify(noisy, panda[0], ("friction", part))
    assert result.quality["taken"] == ["friction"]
    assert any(f"Leave {part} out of what" in text for text in result.quality["warnings"])
    if part != "rotors":
        with pytest.raises(ConvergenceError, match=f"Leave {part} out of what"):
            dd.identify(noisy, panda[0], part)


@pytest.fixture(scope="module")
def eventful(panda):
    """Two runs of 45 s at 1 kHz: late velocities, states without effort, stamps that go back, gaps,
    jumps.
    """
    model, oracle = panda
    t, q, qd, qdd = motion(model, 31, 45.0, 100.0)
    columns = [q, qd, efforts(oracle, q, qd, qdd) + friction(qd)]
    fine = np.arange(0.0, 44.9, 1e-3)
    rng = np.random.default_rng(31)
    q, qd, tau = (
        np.column_stack([np.interp(fine, t, entry) for entry in column.T]) for column in columns
    )
    qd = np.column_stack(
        [np.interp(fine - 0.012, fine, entry) for entry in qd.T]
    ) + 1e-2 * rng.normal(size=qd.shape)
    tau = tau + NOISE * rng.normal(size=qd.shape)
    tau[9000:9003] = np.nan
    fine[500] = fine[499]
    rows = np.r_[0:12_000, 12_100:20_005, 20_300 : len(fine), 0 : len(fine) - 3000]
    data = recorded(model, *(column[rows] for column in (fine, q, qd, tau)))
    moved = np.zeros(len(rows), bool)
    moved[[30_000, 30_004, 60_000]] = True
    return dd.Recording(model, replace(data.states, jumped=moved), data.offset, {}, [])


@pytest.mark.full
def test_unusable_rows_are_counted(panda, eventful, monkeypatch):
    """Motions after a restart of time stamps are fitted, too; pieces of a recording give the
    same.
    """
    model, oracle = panda
    whole = dd.identify(eventful, model, "friction")
    texts = " ".join(whole.quality["findings"])
    assert all(
        cause in texts
        for cause in (
            "incomplete state",
            "repeated time stamp",
            "restart of time",
            "scattered",
        )
    )
    assert whole.quality["velocity_delay"][0] == pytest.approx(0.012, abs=1e-3)
    assert residual(whole.model, model, oracle)[0] < 0.1
    pieces = dd.identify(in_pieces(eventful, 7411), model, "friction")
    assert pieces.quality == whole.quality
    assert pieces.parameters.origin["recordings"] == whole.parameters.origin["recordings"]
    monkeypatch.setattr("diag_dynamics.identification.fitting.MAX_VALUES", 21 * 30_000)
    with pytest.raises(dd.InputError, match=r"has more than 30000 states.* --start and --end"):
        dd.identify(in_pieces(eventful, 20_000), model, "friction")


def test_held_out_part_of_delayed_velocities(panda):
    """All states that have velocities."""
    model, oracle = panda
    data = recording(model, oracle, 6, 10.0, 100.0)
    delay = 0.0123
    late = np.column_stack([np.interp(data.t - delay, data.t, column) for column in data.qd.T])
    data = changed(data, qd=late)
    stamp = data.states.stamp - np.where(data.t < data.t[500], 0, 5 * 10**9)  # a restart
    data = dd.Recording(model, replace(data.states, stamp=stamp), data.offset, {}, [])
    quality = dd.identify(data, model, "friction").quality
    assert quality["velocity_delay"] == [pytest.approx(delay, abs=1e-4)]
    lasts = np.ptp(data.t[:500]) + np.ptp(data.t[500:]) - 2 * 0.02  # the delay in whole samples
    assert quality["held_out_duration"] == pytest.approx(lasts, abs=0.01)
    assert re.match(r"each of \d+ parts of all recordings", quality["held_out"])


def test_a_file_gives_the_same_model(panda, noisy, tmp_path):
    model, _ = panda
    start = perturbed(model, 0.2, 9)
    result = dd.identify(changed(noisy, start), start, ("friction", "inertias"))
    assert json.loads(json.dumps(result.quality)) == result.quality
    result.save(tmp_path / "arm.yaml")
    again = start.with_parameters(tmp_path / "arm.yaml")
    for name in ("damping", "friction", "effort_offset", "armature"):
        np.testing.assert_array_equal(getattr(again, name), getattr(result.model, name))
    np.testing.assert_array_equal(again.bodies, result.model.bodies)
    origin = dd.Parameters.load(tmp_path / "arm.yaml").origin
    assert origin["method"].endswith("friction, inertias") and origin["recordings"][0][
        "states"
    ] == len(noisy)
    assert set(result.quality["torque_rms"]) == set(model.dof_names)
