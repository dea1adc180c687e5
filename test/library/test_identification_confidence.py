# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Confidence in an identification: intervals on simulated recordings with known parameters, and
base parameters.

Efforts are Pinocchio's, friction that of its equation, on motions of a UR5 with noise of positions,
velocities and efforts.
"""

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from controlled import FINGERS
from described import PANDA
from diag_dynamics.identification.base_parameters import BaseParameters
from diag_dynamics.identification.fit import Layout
from diag_dynamics.identification.normal_equations import Regressors
from loads import Arm
from motions import efforts, fourier, recorded
from oracles import Oracle
from perturbed import perturbed
from robots import robot

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

UR5 = robot("ur_description/urdf/ur5_robot.urdf").urdf
TRUTH = {
    "damping": np.array([6.0, 6.0, 4.0, 1.0, 1.0, 0.6]),
    "friction": np.array([4.0, 5.0, 3.0, 1.0, 0.8, 0.5]),
    "effort_offset": np.array([0.5, -0.4, 0.3, 0.1, -0.1, 0.05]),
    "armature": np.array([1.5, 1.5, 1.0, 0.3, 0.3, 0.3]),
    "load_friction": np.array([0.0, 0.1, 0.15, 0.1, 0.0, 0.0]),
    "root_friction": np.array([3.0, 3.0, 2.0, 1.0, 1.0, 0.6]),
}
GAINS = np.array([1.0, 0.11, 0.12, 0.09, 1.0, 1.0])  # N m by unit of effort
NOISE = np.array([1.0, 1.0, 1.0, 0.3, 0.3, 0.2])  # of efforts [N m]
DELAY, V0 = 0.03, 5e-3  # of velocities [s]
SEEDS = pytest.mark.parametrize("seeds", [range(2), pytest.param(range(5), marks=pytest.mark.full)])


@pytest.fixture(scope="module")
def arm():
    model = dd.load_urdf(UR5)
    return model, Oracle(UR5, model.dof_names)


def recording(arm, seed, duration=20.0, missing=(), gains=1.0):
    """Return a noisy motion at 100 Hz with late velocities, and without efforts of some joints."""
    model, oracle = arm
    t = np.arange(0.0, duration, 0.01)
    rng = np.random.default_rng(seed)
    q, qd, qdd = fourier(rng, t, np.full(6, -2.0), np.full(6, 2.0))
    weight = np.abs(efforts(oracle, q, 0.0 * qd, 0.0 * qd))
    coulomb = (TRUTH["friction"] + TRUTH["load_friction"] * weight) * np.tanh(qd / V0)
    root = TRUTH["root_friction"] * qd / np.sqrt(np.maximum(np.abs(qd), V0))
    tau = (
        efforts(oracle, q, qd, qdd)
        + TRUTH["damping"] * qd
        + coulomb
        + root
        + TRUTH["effort_offset"]
    )
    tau += TRUTH["armature"] * qdd
    late = np.column_stack([np.interp(t - DELAY, t, column) for column in qd.T])
    noise = rng.normal(size=(3, *q.shape))
    tau = (tau + NOISE * noise[2]) / gains
    tau[:, list(missing)] = np.nan
    return recorded(model, t, q + 1e-4 * noise[0], late + 1e-2 * noise[1], tau)


def errors(found):
    """Return errors of fitted parameters of joints over their standard deviations."""
    names = found.model.dof_names
    return [
        (getattr(found.parameters.joints[name], key) - TRUTH[key][names.index(name)]) / deviation
        for name, deviations in found.quality["deviations"].items()
        for key, deviation in deviations.items()
    ]


def require_coverage(errors, count, share, largest):
    """Fail unless a share of errors is within 2 σ, and the rms shows that σ is not too large."""
    errors = np.abs(errors)
    within = np.mean(errors < 2.0)
    assert (
        len(errors) >= count
        and within >= share
        and np.median(errors) > 0.2
        and errors.max() < largest
    ), (
        f"{within:.1%} of {len(errors)} within 2 σ, median {np.median(errors):.2f}, "
        f"largest {errors.max():.1f}"
    )


@SEEDS
def test_intervals_contain_the_parameters(arm, seeds):
    """Load and root friction, late velocities, no efforts of the last joint. Joints without a
    rejected step.
    """
    result = [
        dd.identify(recording(arm, seed, missing=[5]), arm[0], ("friction", "rotors", "gears"))
        for seed in seeds
    ]
    ratios = []
    for entry in result:
        assert entry.quality["taken"] == ["friction", "rotors", "gears"]
        assert entry.quality["velocity_delay"][0] == pytest.approx(DELAY, abs=1e-3)
        assert "wrist_3_joint" not in entry.quality["deviations"]
        for name in entry.quality["kept"].get("gears", ()):  # its friction has another meaning
            del entry.quality["deviations"][name]
        ratios += errors(entry)
    require_coverage(ratios, 20 * len(seeds), 0.9, 5.0)


@pytest.mark.full
def test_intervals_of_gains_and_of_what_depends_on_them(arm):
    """A gain that is 1 % larger shifts the offset of a joint by 1 % of its weight."""
    ratios = []
    for seed in range(1, 6):
        data = recording(arm, seed, missing=[5], gains=GAINS)
        result = dd.identify(data, arm[0], ("gains", "friction", "rotors", "gears"))
        pairs = zip(result.quality["effort_gain"].values(), GAINS, strict=True)
        ratios += errors(result) + [(gain[0] - truth) / gain[1] for gain, truth in pairs if gain]
    require_coverage(ratios, 50, 0.85, 6.0)


@pytest.mark.full
@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_intervals_of_a_payload_contain_errors_of_gains(name):
    """Of 20 recordings with gains that are wrong by 5 %, each joint's by its own.

    σ is at most twice the errors' spread, which 20 runs give to 16 %.
    """
    arm = Arm(name)
    errors = []
    deviations = []
    mass = 2.0
    oracle = arm.oracle({arm.link: (2.0, [0.03, -0.02, 0.08], 4e-3 * np.eye(3))})
    model = arm.dynamics.model
    t = np.arange(0.0, 20.0, 0.01)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        q, qd, qdd = arm.motion(rng, t, 1.7)
        tau = efforts(oracle, q, qd, qdd) + 2.0 * qd + np.tanh(qd / V0)
        noise = rng.normal(size=(3, *q.shape))
        tau = tau * (1.0 + 0.05 * rng.normal(size=model.nv)) + 0.5 * noise[2]
        data = recorded(model, t, q + 1e-4 * noise[0], qd + 1e-3 * noise[1], tau)
        payload = dd.identify(data, model, ("friction", f"payload:{arm.link}")).quality["payload"]
        errors.append(payload["mass"] - mass)
        deviations.append(payload["mass_deviation"])
    require_coverage(np.divide(errors, deviations), 20, 0.85, 4.0)
    assert np.mean(deviations) < 2.0 * np.sqrt(np.mean(np.square(errors)))


# --- Base parameters


@pytest.mark.parametrize(
    ("path", "locked", "rank"),
    [("ur_description/urdf/ur5_robot.urdf", {}, 36), (PANDA, FINGERS, 43)],
)
def test_base_parameters_are_those_of_pinocchios_regressor(path, locked, rank):
    """As many as its rank at random states; with the columns of their first symbols they give its
    torques.
    """
    text = robot(path).urdf
    rng = np.random.default_rng(1)
    model = dd.load_urdf(text, locked_joints=locked)
    oracle = Oracle(text, model.dof_names, locked_joints=locked)
    layout = Layout(model, Regressors(model))
    base = BaseParameters(layout)
    rows = []
    torques = []
    for q, qd, qdd in rng.uniform(-2.0, 2.0, (40, 3, model.nv)):
        state = oracle.configuration(q), oracle.to_pin(qd), oracle.to_pin(qdd)
        rows.append(pin.computeJointTorqueRegressor(oracle.model, oracle.data, *state).copy())
        torques.append(pin.rnea(oracle.model, oracle.data, *state))
    Y = np.vstack(rows)
    tau = np.concatenate(torques)
    singular = np.linalg.svd(Y, compute_uv=False)
    assert len(base.combinations) == rank == np.count_nonzero(singular > 1e-10 * singular[0])
    columns = []
    for number, name in zip(base.kept, base.combinations, strict=True):
        body = model.bodies[layout.bodies[number // 10]]
        assert f"({model.link_names[body['link']]})" in name.split()[0]
        joint = oracle.model.getJointId(model.dof_names[body["dof"]])
        columns.append(10 * (joint - 1) + number % 10)
    np.testing.assert_allclose(
        Y[:, columns] @ (base.matrix @ layout.known[: layout.robot]), tau, atol=1e-11
    )


def test_curves_have_the_errors_of_an_arm_whose_first_joint_stands(arm):
    model, oracle = arm
    t = np.arange(0.0, 8.0, 0.01)
    rng = np.random.default_rng(3)
    q, qd, qdd = fourier(rng, t, np.full(6, -2.0), np.full(6, 2.0))
    q[:, 0] = 0.3
    qd[:, 0] = 0.0
    qdd[:, 0] = 0.0
    tau = efforts(oracle, q, qd, qdd) + 2.0 * np.tanh(qd / V0) + 0.1 * rng.normal(size=q.shape)
    result = dd.identify(recorded(model, t, q, qd, tau), model, "friction")
    assert result.quality["taken"] == ["friction"]
    curves = result.curves
    for k, error in enumerate(
        (curves.error_before, curves.error_after)
    ):  # of so few states, none is left out
        rms = [pair[k] for pair in result.quality["torque_rms"].values()]
        np.testing.assert_allclose(np.sqrt(np.nanmean(error**2, axis=0)), rms, rtol=1e-9)
        np.testing.assert_allclose(
            curves.measured - (curves.before, curves.after)[k], error, atol=1e-9
        )
    assert np.nanmax(np.abs(curves.measured[:, 1])) == pytest.approx(
        np.abs(tau[:, 1]).max(), rel=0.02
    )


@pytest.mark.full
@pytest.mark.parametrize(("error", "share"), [(0.35, 0.85), (0.1, 0.95)])
def test_intervals_of_base_parameters(arm, error, share):
    """Noise and parts of the recording make them, so they depend on the inertias of the model."""
    model = arm[0]
    layout = Layout(model, Regressors(model))
    truth = BaseParameters(layout).matrix @ layout.known[: layout.robot]
    ratios = []
    for seed in range(5):
        result = dd.identify(recording(arm, seed, 30.0), perturbed(model, error, 10 + seed))
        assert "inertias" in result.quality["taken"]
        rows = zip(result.quality["base_parameters"]["parameters"], truth, strict=True)
        ratios += [(entry["value"] - true) / entry["deviation"] for entry, true in rows]
    require_coverage(ratios, 100, share, 10.0)
