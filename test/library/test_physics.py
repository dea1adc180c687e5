# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The laws of diagonalized dynamics, one test each, over every robot, fixed and floating, against Pinocchio.

Errors are measured in the units of ν (√J), in which all dofs weigh alike: rates times √M_kk, torques over it.
"""

import os
import pickle
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import diag_dynamics as dd
import robots
from accuracy import EPS, assert_close, norm, tolerance, tolerance_of_differences
from diag_dynamics.exceptions import InputError
from oracles import FLOATING, Oracle, State

PANDA = "panda_description/urdf/panda.urdf"
TALOS = "talos_data/robots/talos_reduced.urdf"

# Some example robots have inertias that no rigid body has; test_urdf.py is about that.
pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")


# --- cases


class Case(NamedTuple):
    """One robot in one state: the oracle's truth beside the library's answers."""

    dyn: dd.DiagonalDynamics
    truth: State
    sample: robots.Sample
    s: object  # evaluate
    f: object  # factors
    unit: np.ndarray  # √M_kk


class Robot(NamedTuple):
    """A robot, its oracle, and its cases."""

    id: str
    model: object
    dyn: dd.DiagonalDynamics
    oracle: Oracle
    cases: list[Case]


def load(robot: robots.Robot, **options) -> Robot:
    """Load a robot in library and oracle, and evaluate its samples."""
    model = dd.load_urdf(robot.source, mimic="free", **robot.options, **options)
    dyn = dd.DiagonalDynamics(model)
    oracle = Oracle(robot.urdf, model.dof_names, **robot.options)
    cases = []
    for sample in robots.samples(robot.id, oracle):
        truth = oracle.at(sample.q, sample.qd, sample.tau)
        s = dyn.evaluate(sample.q, sample.qd, sample.tau)
        cases.append(Case(dyn, truth, sample, s, dyn.factors(sample.q), np.sqrt(np.diag(truth.M))))
    return Robot(robot.id, model, dyn, oracle, cases)


@pytest.fixture(scope="module", params=robots.robots_to_test(), ids=lambda robot: robot.id)
def robot(request) -> Robot:
    """Return each robot in turn; module scope, so that all tests of one robot share one evaluation."""
    return load(request.param)


@pytest.fixture(scope="module")
def panda() -> Robot:
    """Return the robot of the tests that need only one."""
    return load(robots.robot(PANDA))


# --- the model


def test_names(robot):
    """Joints are Pinocchio's, with their degrees of freedom, base to tip; links are the URDF's."""
    model, oracle = robot.model, robot.oracle
    assert model.nv == len(model.dof_names) == oracle.nv
    assert model.nq == len(model.coordinate_names) == oracle.nq
    assert isinstance(model.dof_names, tuple) and isinstance(model.coordinate_names, tuple)
    assert model.joint_names == tuple(dict.fromkeys(name.split("/")[0] for name in model.dof_names))
    assert set(model.joint_names) == set(list(oracle.model.names)[1:])
    assert (model.neutral == oracle.neutral).all()
    assert next(k for k in range(model.nv) if oracle.parent_dof(k) is None) == 0
    if model.floating_base:
        assert model.dof_names[:6] == tuple(f"root_joint/{suffix}" for suffix in FLOATING)
        assert oracle.ancestors(5) == set(range(5))
    assert all(j < k for k in range(model.nv) for j in oracle.ancestors(k))
    assert sorted(model.link_names) == sorted(link.get("name") for link in oracle.xml.findall("link"))


# --- factors: M = m mᵀ


def test_m_is_the_udu_factor(robot):
    """m = U √D, unit = U, D = D of Pinocchio's Cholesky decomposition, row by row."""
    for case in robot.cases:
        t = case.truth
        assert_close(case.f.m / case.unit[:, None], t.m / case.unit[:, None], tolerance(t))
        assert_close(case.f.unit * np.sqrt(t.D) / case.unit[:, None], t.m / case.unit[:, None], tolerance(t))
        assert_close(case.f.D / t.D, np.ones_like(t.D), tolerance(t))
        assert (case.s.articulated_inertia == case.f.D).all()


def test_m_factors_the_mass_matrix(robot):
    """M = m mᵀ, with M of the library, of Pinocchio, and of the factors."""
    for case in robot.cases:
        t, scale = case.truth, np.outer(case.unit, case.unit)
        assert_close(case.f.m @ case.f.m.T / scale, t.M / scale, 1e-12)
        assert_close(case.f.unit * case.f.D @ case.f.unit.T / scale, t.M / scale, 1e-12)
        assert_close(case.dyn.mass_matrix(case.sample.q) / scale, t.M / scale, 1e-12)


def test_mass_matrix_is_symmetric(robot):
    """Both triangles of M are filled, alike."""
    for case in robot.cases:
        M = case.dyn.mass_matrix(case.sample.q)
        assert (M == M.T).all()


def test_l_inverts_m(robot):
    """ℓ m = m ℓ = I, and ℓᵀℓ = M⁻¹."""
    for case in robot.cases:
        t, identity = case.truth, np.eye(robot.model.nv)
        assert_close(case.f.l @ case.f.m, identity, tolerance(t))
        assert_close((case.f.m @ case.f.l) * case.unit / case.unit[:, None], identity, tolerance(t))
        assert_close(case.f.l @ t.m, identity, tolerance(t))


def test_factors_have_the_sparsity_of_the_tree(robot):
    """m[i, j] ≠ 0 only where i = j or i is an ancestor of j: exact zeros elsewhere. So for ℓ."""
    nv = robot.model.nv
    allowed = np.eye(nv, dtype=bool)
    for k in range(nv):
        allowed[list(robot.oracle.ancestors(k)), k] = True
    for case in robot.cases:
        for factor in (case.f.m, case.f.unit, case.f.l):
            assert (factor[~allowed] == 0).all()
            assert (np.triu(factor) == factor).all()
        assert (np.diag(case.f.unit) == 1).all()
        assert (case.f.D > 0).all()


def test_determinant(robot):
    """Det M = Π D_k."""
    for case in robot.cases:
        sign, logarithm = np.linalg.slogdet(case.truth.M)
        assert sign == 1
        assert_close(np.log(case.f.D).sum(), logarithm, tolerance(case.truth), robot.model.nv)


# --- rates, moments, energy


def test_total_joint_rates(robot):
    """ν = mᵀ q̇ and ξ = D^−½ ν."""
    for case in robot.cases:
        t = case.truth
        assert_close(case.s.nu, t.nu, tolerance(t))
        assert_close(np.sqrt(t.D) * case.s.xi, t.nu, tolerance(t))
        assert_close(np.sqrt(case.s.articulated_inertia) * case.s.xi, case.s.nu, 1e-15)


def test_working_moments(robot):
    """ε = ℓ τ and κ = D^½ ε."""
    for case in robot.cases:
        t = case.truth
        assert_close(case.s.epsilon, t.epsilon, tolerance(t))
        assert_close(case.s.kappa / np.sqrt(t.D), t.kappa / np.sqrt(t.D), tolerance(t))
        assert_close(case.s.kappa / np.sqrt(case.s.articulated_inertia), case.s.epsilon, 1e-15)


def test_gravity(robot):
    """ε_g = ℓ g and g. Where gravity has no moment at all, relative to √mass·|g|, which bounds |ε_g|."""
    scale = np.sqrt(robot.oracle.mass) * 9.81
    for case in robot.cases:
        t = case.truth
        assert_close(case.s.gravity, t.gravity, tolerance(t), max(norm(t.gravity), 1e-3 * scale))
        g = case.dyn.gravity_torque(case.sample.q)
        assert_close(g / case.unit, t.g / case.unit, tolerance(t), max(norm(t.g / case.unit), 1e-3 * scale))


def test_energy(robot):
    """K = ½ q̇ᵀM q̇; ½ν_k² are its shares."""
    for case in robot.cases:
        K = case.truth.kinetic_energy
        assert_close(case.s.kinetic_energy, K, 1e-12)
        assert_close(case.s.energy_share, 0.5 * case.s.nu**2, 1e-15)
        assert_close(case.s.energy_share.sum(), K, 1e-12)


def test_link_energy(robot):
    """Each URDF link's own ½VᵀIV, armature counted where it moves; they sum to K."""
    for case in robot.cases:
        energy = case.truth.link_energy
        assert case.s.link_energy.shape == (len(robot.model.link_names),)
        assert_close(case.s.link_energy, [energy[n] for n in robot.model.link_names], 1e-12)
        assert_close(case.s.link_energy.sum(), case.truth.kinetic_energy, 1e-12)
        assert (case.s.link_energy >= 0).all()


def test_base_energy(robot):
    """The shares of a floating base's six dofs sum to ½V*ᵀPV*, whatever the order of its twist's components."""
    for case in robot.cases:
        s, t = case.s, case.truth
        if not robot.model.floating_base:
            assert s.base_energy == 0.0
            continue
        angular_first = np.r_[3:6, 0:3, 6 : robot.model.nv]
        M = t.M[np.ix_(angular_first, angular_first)]
        nu = np.linalg.cholesky(M[::-1, ::-1])[::-1, ::-1].T @ t.qd[angular_first]  # M = m mᵀ, m upper triangular
        assert_close(s.base_energy, 0.5 * nu[:6] @ nu[:6], tolerance(t))
        assert_close(s.base_energy, s.energy_share[:6].sum(), 1e-15)
        assert 0 < s.base_energy <= t.kinetic_energy * (1 + 1e-12)


def test_energy_of_a_joint_does_not_depend_on_the_order_of_its_dofs(robot):
    """The shares of a planar or floating joint, anywhere, sum to the same with its dofs in reverse."""
    joints = {frozenset(robot.oracle.joint_mates(k)) for k in range(robot.model.nv)}
    for joint in (sorted(joint) for joint in joints if len(joint) > 1):
        order = np.arange(robot.model.nv)
        order[joint] = joint[::-1]
        for case in robot.cases[:1]:
            M = case.truth.M[np.ix_(order, order)]
            nu = np.linalg.cholesky(M[::-1, ::-1])[::-1, ::-1].T @ case.truth.qd[order]
            assert_close(case.s.energy_share[joint].sum(), 0.5 * nu[joint] @ nu[joint], tolerance(case.truth))
            if robot.id == f"{TALOS}+floating":  # though each share does
                assert abs(nu[joint[0]] - case.s.nu[joint[-1]]) > 1e-3 * norm(case.s.nu[joint])


# --- the Coriolis term


def test_coriolis(robot):
    """C = ℓc − ṁᵀq̇, ṁ from Pinocchio's Coriolis matrix."""
    for case in robot.cases:
        assert_close(case.s.coriolis, case.truth.coriolis, tolerance(case.truth), case.truth.coriolis_scale)


def test_coriolis_by_difference(robot):
    """C = ℓc − ṁᵀq̇, ṁ from differences of Pinocchio's factor: no recursion, no Coriolis matrix."""
    for case in robot.cases:
        t = case.truth
        assert_close(case.s.coriolis, t.coriolis_by_difference, tolerance_of_differences(t), t.coriolis_scale)


def test_coriolis_unnormalized(robot):
    """C_ξ of Lemma 7.3."""
    for case in robot.cases:
        t, root = case.truth, np.sqrt(case.truth.D)
        scale = t.coriolis_scale + norm(t.Ddot * t.xi / root)
        assert_close(case.s.coriolis_unnormalized / root, t.coriolis_unnormalized / root, tolerance(t), scale)


def test_coriolis_does_no_work(robot):
    """νᵀC = 0 (Lemma 7.1)."""
    for case in robot.cases:
        s = case.s
        assert_close(s.nu @ s.coriolis, 0.0, 1e-12, norm(s.nu) * case.truth.coriolis_scale)


def test_unnormalized_coriolis_does_work(robot):
    """ξᵀC_ξ = ½ ξᵀḊξ, which is not zero."""
    for case in robot.cases:
        s, t = case.s, case.truth
        scale = norm(s.nu) * (t.coriolis_scale + norm(t.Ddot * t.xi / np.sqrt(t.D)))
        assert_close(s.xi @ s.coriolis_unnormalized, 0.5 * t.xi @ (t.Ddot * t.xi), tolerance(t), scale)


# --- dynamics


def test_bias(robot):
    """The classical bias c without gravity."""
    for case in robot.cases:
        t = case.truth
        scale = max(norm(t.c / case.unit), 1e-3 * norm(t.nu) * norm(t.qd))
        assert_close(case.dyn.bias(t.q, t.qd) / case.unit, t.c / case.unit, tolerance(t), scale)


def test_inverse_dynamics(robot):
    """τ of rnea, gravity included."""
    for case in robot.cases:
        t = case.truth
        tau = robot.oracle.inverse_dynamics(t.q, t.qd, case.sample.qdd)
        actual = case.dyn.inverse_dynamics(t.q, t.qd, case.sample.qdd)
        assert_close(actual / case.unit, tau / case.unit, tolerance(t))


def test_forward_dynamics(robot):
    """q̈ of aba, gravity included."""
    for case in robot.cases:
        t = case.truth
        actual = case.dyn.forward_dynamics(t.q, t.qd, t.tau)
        assert_close(actual * case.unit, t.acceleration * case.unit, tolerance(t))


def test_forward_undoes_inverse_dynamics(robot):
    """The library's two are each other's inverse."""
    for case in robot.cases:
        t, qdd = case.truth, case.sample.qdd
        tau = case.dyn.inverse_dynamics(t.q, t.qd, qdd)
        assert_close(case.dyn.forward_dynamics(t.q, t.qd, tau) * case.unit, qdd * case.unit, tolerance(t), None)


def test_equation_of_motion(robot):
    """ν̇ + C + ε_g = ε along aba's acceleration."""
    for case in robot.cases:
        s, t = case.s, case.truth
        scale = sum(map(norm, (t.nu_dot, s.coriolis, s.gravity, s.epsilon)))
        assert_close(t.nu_dot + s.coriolis + s.gravity, s.epsilon, tolerance(t), scale)


def test_nu_moves_by_the_equation_of_motion(robot):
    """The library's own ν, differenced along aba's motion, changes by ε − C − ε_g.

    Fourth-order differences of a curve through the state: 1e-8 of ν̇, plus 2e-14 of ν over the step.
    """
    for case in robot.cases:
        s, t = case.s, case.truth
        h = 1e-3 / max(1.0, np.abs(t.qd).max(), np.sqrt(np.abs(t.acceleration).max()))
        # a motion with the right q̇ and q̈ at 0; ν̇ there depends on nothing else
        steps = [x * h * t.qd + 0.5 * (x * h) ** 2 * t.acceleration for x in (-2, -1, 1, 2)]
        q = [robot.oracle.moved(t.q, step) for step in steps]
        qd = [t.qd + x * h * t.acceleration for x in (-2, -1, 1, 2)]
        nu = [case.dyn.nu_from_qd(*state) for state in zip(q, qd, strict=True)]
        nu_dot = (8 * (nu[2] - nu[1]) - (nu[3] - nu[0])) / (12 * h)
        scale = sum(map(norm, (s.coriolis, s.gravity, s.epsilon))) + 2e-6 * norm(s.nu) / h
        assert_close(nu_dot, s.epsilon - s.coriolis - s.gravity, max(1e-8, tolerance(t)), scale)


def test_power(robot):
    """K̇ = νᵀ(ε − ε_g) (Lemma 7.2) is what aba's acceleration makes of ½q̇ᵀMq̇."""
    for case in robot.cases:
        s, t = case.s, case.truth
        scale = norm(s.nu) * (norm(s.epsilon) + norm(s.gravity) + t.coriolis_scale)
        assert_close(s.power, t.power, tolerance(t), scale)
        assert_close(s.power, s.nu @ (s.epsilon - s.gravity), 1e-14, scale)


def test_work(robot):
    """νᵀε = q̇ᵀτ."""
    for case in robot.cases:
        s, t = case.s, case.truth
        assert_close(s.nu @ s.epsilon, t.qd @ t.tau, tolerance(t), norm(s.nu) * norm(s.epsilon))


# --- external wrenches and friction, each a term of its own


def wrenches_on(model, seed) -> dict[str, np.ndarray]:
    """Return wrenches on the root, a tip and some other links, those without inertia among them."""
    rng = np.random.default_rng(seed)
    names = dict.fromkeys((model.link_names[0], model.link_names[-1], *map(str, rng.choice(model.link_names, 4))))
    return {name: 10 * rng.standard_normal(6) for name in names}


@pytest.mark.parametrize("frame", ["link", "world"])
def test_external_wrenches(robot, frame):
    """ℓJᵀf, q̈, τ and K̇ with wrenches, Jᵀ from Pinocchio's frames; nothing else changes."""
    wrenches = wrenches_on(robot.model, len(robot.id))
    for case in robot.cases:
        (q, qd, tau, qdd), t = case.sample, case.truth
        effort = robot.oracle.effort_of(q, wrenches, frame)
        s = case.dyn.evaluate(q, qd, tau, wrenches, frame=frame)
        expected = np.linalg.solve(t.m, effort)
        scale = max(norm(expected), norm(t.epsilon))  # wrenches on a robot that is one joint may do nothing
        assert_close(s.external, expected, tolerance(t), scale)
        for name in ("nu", "epsilon", "coriolis", "coriolis_unnormalized", "gravity", "kinetic_energy"):
            assert (np.asarray(getattr(s, name)) == np.asarray(getattr(case.s, name))).all(), name
        # s.epsilon is what τ alone gives; the equation of motion has the wrenches as a further term
        loaded = robot.oracle.at(q, qd, tau + effort)
        scale = norm(loaded.acceleration * case.unit)
        actual = case.dyn.forward_dynamics(q, qd, tau, wrenches, frame=frame)
        assert_close(actual * case.unit, loaded.acceleration * case.unit, tolerance(t), scale)
        rnea = robot.oracle.inverse_dynamics(q, qd, qdd)
        actual = case.dyn.inverse_dynamics(q, qd, qdd, wrenches, frame=frame)
        scale = norm(rnea / case.unit) + norm(effort / case.unit)
        assert_close(actual / case.unit, (rnea - effort) / case.unit, tolerance(t), scale)
        terms = (loaded.nu_dot, s.coriolis, s.gravity, s.epsilon, s.external)
        assert_close(
            loaded.nu_dot + s.coriolis + s.gravity, s.epsilon + s.external, tolerance(t), sum(map(norm, terms))
        )
        scale = norm(s.nu) * (sum(map(norm, terms[2:])) + t.coriolis_scale)
        assert_close(s.power, loaded.power, tolerance(t), scale)


def test_friction(robot):
    """Damping and Coulomb friction of the URDF, only where asked for, against Pinocchio driven by τ − τ_fric."""
    model, oracle = robot.model, robot.oracle
    numbers = {"damping": np.zeros(model.nv), "friction": np.zeros(model.nv)}
    for element in oracle.xml.findall("joint"):
        for k in (k for k, name in enumerate(model.dof_names) if name.split("/")[0] == element.get("name")):
            for name, array in numbers.items():
                array[k] = (0 if element.find("dynamics") is None else element.find("dynamics").get(name)) or 0
    for case in robot.cases:
        (q, qd, tau, qdd), t = case.sample, case.truth
        resisting = numbers["damping"] * qd + numbers["friction"] * np.tanh(qd / 5e-3)
        assert_close(case.dyn.friction_torque(qd), resisting, 1e-15)
        s = case.dyn.evaluate(q, qd, tau, friction=True)
        epsilon = np.linalg.solve(t.m, resisting)
        assert_close(s.friction, epsilon, tolerance(t))
        assert case.s.friction is None
        for name in FIELDS:
            if name != "power":
                assert (np.asarray(getattr(s, name)) == np.asarray(getattr(case.s, name))).all(), name
        slowed = oracle.at(q, qd, tau - resisting)
        actual = case.dyn.forward_dynamics(q, qd, tau, friction=True)
        assert_close(actual * case.unit, slowed.acceleration * case.unit, tolerance(t))
        actual = case.dyn.inverse_dynamics(q, qd, qdd, friction=True)
        expected = (oracle.inverse_dynamics(q, qd, qdd) + resisting) / case.unit
        assert_close(actual / case.unit, expected, tolerance(t), norm(expected) + norm(resisting / case.unit))
        terms = (slowed.nu_dot, s.coriolis, s.gravity, s.friction, s.epsilon)
        assert_close(sum(terms[:4]), s.epsilon, tolerance(t), sum(map(norm, terms)))
        assert_close(s.power, slowed.power, tolerance(t), norm(s.nu) * (sum(map(norm, terms)) + t.coriolis_scale))


def test_coulomb_friction_is_smooth_at_rest():
    """Odd, rising and continuous, f sign(q̇) but for 1e-4 beyond 25 mrad/s; its rate stays with the model."""
    urdf = re.sub('damping="[^"]*" friction="[^"]*"', 'damping="0" friction="1.5"', robots.robot(PANDA).urdf)
    model = dd.load_urdf(urdf)
    torque = dd.DiagonalDynamics(model).friction_torque
    rubbing = model.friction > 0.0
    assert model.friction_velocity == 5e-3 and rubbing.sum() == 7
    rates = np.concatenate([[0.0], np.logspace(-9, 3, 400)])
    along, backward = (
        np.array([torque(np.full(model.nv, sign * rate))[rubbing] for rate in rates]) / 1.5 for sign in (1.0, -1.0)
    )
    assert (along == -backward).all() and (along[0] == 0.0).all()
    assert (np.diff(along, axis=0) >= 0.0).all() and (np.diff(along[rates < 0.01], axis=0) > 0.0).all()
    assert (np.diff(along, axis=0) <= np.diff(rates)[:, None] / 5e-3 * (1 + 1e-9) + 1e-15).all()
    assert (np.abs(along[rates > 0.025] - 1.0) < 1e-4).all()
    other = dd.load_urdf(urdf, friction_velocity=0.02)
    for same in (
        other.with_gravity((0, 0, 0)),
        other.with_payload("panda_hand", 1.0),
        pickle.loads(pickle.dumps(other)),
    ):
        assert same.friction_velocity == 0.02
    jumping = dd.DiagonalDynamics(dd.load_urdf(urdf, friction_velocity=0))
    qd = np.linspace(-1e-9, 1e-9, model.nv)
    assert (jumping.friction_torque(qd)[rubbing] == 1.5 * np.sign(qd[rubbing])).all()
    for wrong in (-1e-3, np.nan, np.inf, "5e-3"):
        with pytest.raises(InputError, match="friction_velocity"):
            dd.load_urdf(urdf, friction_velocity=wrong)


def test_power_balance_by_difference(robot):
    """K̇ = νᵀ(ε − ε_g + ℓJᵀf − ε_fric) is what K does along the library's own motion, differenced.

    Fourth-order differences: 1e-8 of the terms, plus the rounding of K over the step.
    """
    wrenches = wrenches_on(robot.model, 1)
    for case in robot.cases:
        (q, qd, tau, _), t = case.sample, case.truth
        s = case.dyn.evaluate(q, qd, tau, wrenches, frame="world", friction=True)
        qdd = case.dyn.forward_dynamics(q, qd, tau, wrenches, frame="world", friction=True)
        h = 1e-3 / max(1.0, np.abs(qd).max(), np.sqrt(np.abs(qdd).max()))
        energy = [
            case.dyn.evaluate(
                robot.oracle.moved(q, x * h * qd + 0.5 * (x * h) ** 2 * qdd), qd + x * h * qdd
            ).kinetic_energy
            for x in (-2, -1, 1, 2)
        ]
        rate = (8 * (energy[2] - energy[1]) - (energy[3] - energy[0])) / (12 * h)
        terms = norm(s.nu) * sum(map(norm, (s.epsilon, s.gravity, s.external, s.friction, s.coriolis)))
        assert_close(rate, s.power, max(1e-8, tolerance(t)), terms + 2e-6 * s.kinetic_energy / h)


# --- the four sweeps


def test_sweeps_are_the_factors(robot):
    """ν = mᵀq̇, q̇ = ℓᵀν, ε = ℓτ, τ = mε for any vector, without a matrix."""
    for case in robot.cases:
        dyn, t = case.dyn, case.truth
        x = np.array(case.sample.qdd)
        assert_close(dyn.nu_from_qd(t.q, x), t.m.T @ x, tolerance(t))
        assert_close(dyn.qd_from_nu(t.q, x) * case.unit, np.linalg.solve(t.m.T, x) * case.unit, tolerance(t))
        assert_close(dyn.epsilon_from_tau(t.q, x), np.linalg.solve(t.m, x), tolerance(t))
        assert_close(dyn.tau_from_epsilon(t.q, x) / case.unit, t.m @ x / case.unit, tolerance(t))


def test_sweeps_invert_each_other(robot):
    """Each outward and each inward sweep has its inverse."""
    for case in robot.cases:
        dyn, t = case.dyn, case.truth
        s = case.unit
        assert_close(dyn.qd_from_nu(t.q, dyn.nu_from_qd(t.q, t.qd)) * s, t.qd * s, tolerance(t))
        assert_close(dyn.nu_from_qd(t.q, dyn.qd_from_nu(t.q, t.qd)), t.qd, tolerance(t))
        assert_close(dyn.tau_from_epsilon(t.q, dyn.epsilon_from_tau(t.q, t.tau)) / s, t.tau / s, tolerance(t))
        assert_close(dyn.epsilon_from_tau(t.q, dyn.tau_from_epsilon(t.q, t.tau)), t.tau, tolerance(t))


def test_sweeps_are_those_of_the_evaluation(robot):
    """One physics: the evaluation's ν and ε are the sweeps'."""
    for case in robot.cases:
        dyn, t = case.dyn, case.truth
        assert_close(dyn.nu_from_qd(t.q, t.qd), case.s.nu, 1e-14)
        assert_close(dyn.epsilon_from_tau(t.q, t.tau), case.s.epsilon, tolerance(t))


# --- what depends on what: exactly, by structure


def others(robot, case, names):
    """Return copies of the sample's q, q̇ and τ in which the dofs of `names` are changed."""
    step = 0.7 * np.isin(np.arange(robot.model.nv), list(names))
    q, qd, tau, _ = case.sample
    return robot.oracle.moved(q, step), qd + step, tau + step


def test_nu_ignores_outboard_rates(robot):
    """ν_k, ξ_k do not depend on the rates of joints that are not k or inboard of it."""
    case = robot.cases[1]
    for k in range(robot.model.nv):
        path = robot.oracle.ancestors(k) | {k}
        _, qd, _ = others(robot, case, set(range(robot.model.nv)) - path)
        s = case.dyn.evaluate(case.sample.q, qd, case.sample.tau)
        assert s.nu[k] == case.s.nu[k]
        assert s.xi[k] == case.s.xi[k]
        assert case.dyn.nu_from_qd(case.sample.q, qd)[k] == case.dyn.nu_from_qd(case.sample.q, case.sample.qd)[k]


def test_epsilon_ignores_inboard_torques(robot):
    """ε_k, κ_k do not depend on the torques of joints that are not k or outboard of it."""
    case = robot.cases[1]
    for k in range(robot.model.nv):
        subtree = robot.oracle.descendants(k) | {k}
        _, _, tau = others(robot, case, set(range(robot.model.nv)) - subtree)
        s = case.dyn.evaluate(case.sample.q, case.sample.qd, tau)
        assert s.epsilon[k] == case.s.epsilon[k]
        assert s.kappa[k] == case.s.kappa[k]


def test_reduced_manipulator(robot):
    """D_k, and the block of m of k and what is outboard of it, ignore all positions not outboard of k."""
    case = robot.cases[1]
    oracle, nv = robot.oracle, robot.model.nv
    for k in range(nv):
        outboard = oracle.descendants(k)
        q, _, _ = others(robot, case, set(range(nv)) - outboard | oracle.joint_mates(k))
        f = case.dyn.factors(q)
        assert f.D[k] == case.f.D[k]
        assert case.dyn.evaluate(q, case.sample.qd).articulated_inertia[k] == case.f.D[k]
        # the whole block of k and everything outboard of it is that of the reduced manipulator
        block = np.ix_(sorted(outboard | {k}), sorted(outboard | {k}))
        assert (f.m[block] == case.f.m[block]).all()
        assert (f.unit[block] == case.f.unit[block]).all()


def test_total_rate_is_own_rate_when_the_inboard_part_rests(robot):
    """D^−½ν_k = q̇_k where everything inboard of k is at rest."""
    case = robot.cases[1]
    for k in range(robot.model.nv):
        qd = case.sample.qd.copy()
        qd[list(robot.oracle.ancestors(k))] = 0
        s = case.dyn.evaluate(case.sample.q, qd)
        assert s.xi[k] == qd[k]
        assert s.nu[k] == pytest.approx(np.sqrt(case.f.D[k]) * qd[k], rel=1e-15)


def test_at_rest(robot):
    """Without rates there is no ν, no C, no K; gravity and ε are what they were."""
    for case in robot.cases[:1]:
        zero = np.zeros(robot.model.nv)
        s = case.dyn.evaluate(case.sample.q, zero, case.sample.tau)
        for quantity in (s.nu, s.xi, s.coriolis, s.coriolis_unnormalized, s.energy_share, s.link_energy):
            assert (quantity == 0).all()
        assert s.kinetic_energy == 0 and s.power == 0
        assert (s.epsilon == case.s.epsilon).all()
        assert (s.gravity == case.s.gravity).all()
        assert (case.dyn.bias(case.sample.q, zero) == 0).all()


# --- the interface's promises


FIELDS = (
    *("nu", "xi", "epsilon", "kappa", "coriolis", "coriolis_unnormalized", "gravity", "articulated_inertia"),
    *("kinetic_energy", "energy_share", "link_energy", "power"),
)


def test_without_torque(robot):
    """No τ, no moments: None, and the rest unchanged to the bit."""
    case = robot.cases[0]
    s = case.dyn.evaluate(case.sample.q, case.sample.qd)
    assert s.epsilon is None and s.kappa is None and s.power is None
    for name in FIELDS:
        if name not in ("epsilon", "kappa", "power"):
            assert (np.asarray(getattr(s, name)) == np.asarray(getattr(case.s, name))).all(), name


def everything(dyn, sample) -> dict[str, np.ndarray]:
    """Return every answer of the API at one state."""
    q, qd, tau, qdd = sample
    s, f = dyn.evaluate(q, qd, tau), dyn.factors(q)
    return {
        **{name: getattr(s, name) for name in FIELDS},
        **{name: getattr(f, name) for name in ("m", "l", "unit", "D")},
        "forward_dynamics": dyn.forward_dynamics(q, qd, tau),
        "inverse_dynamics": dyn.inverse_dynamics(q, qd, qdd),
        "mass_matrix": dyn.mass_matrix(q),
        "bias": dyn.bias(q, qd),
        "gravity_torque": dyn.gravity_torque(q),
        "nu_from_qd": dyn.nu_from_qd(q, qd),
        "qd_from_nu": dyn.qd_from_nu(q, qd),
        "epsilon_from_tau": dyn.epsilon_from_tau(q, tau),
        "tau_from_epsilon": dyn.tau_from_epsilon(q, tau),
    }


def test_no_memory_of_earlier_calls(robot):
    """Workspaces are reused; answers do not show it, and what was handed out stays as it was."""
    first, other = robot.cases[0].sample, robot.cases[2].sample
    before = everything(robot.dyn, first)
    kept = {name: np.array(value) for name, value in before.items()}
    everything(robot.dyn, other)
    again = everything(robot.dyn, first)
    fresh = everything(dd.DiagonalDynamics(robot.model), first)
    for name, value in kept.items():
        for answer in (before, again, fresh):
            assert (np.asarray(answer[name]) == value).all(), name


def test_nothing_is_left_unwritten(robot, monkeypatch):
    """Every entry handed out was computed: memory that starts as NaN changes no answer."""
    sample = robot.cases[1].sample
    expected = everything(robot.dyn, sample)
    empty = np.empty

    def of_nan(shape, dtype=np.float64):
        array = empty(shape, dtype)
        array.reshape(-1).view(np.uint8)[...] = 0xFF  # a NaN in every field of a record, too
        return array

    monkeypatch.setattr(np, "empty", of_nan)
    for name, value in everything(robot.dyn, sample).items():
        assert (np.asarray(value) == np.asarray(expected[name])).all(), name


def test_answers_share_no_memory(panda):
    """No two arrays handed out overlap each other or the arguments."""
    sample = panda.cases[0].sample
    given = [x.copy() for x in sample]
    answers = [*everything(panda.dyn, sample).items(), *everything(panda.dyn, sample).items()]
    arrays = [(name, a) for name, a in answers if isinstance(a, np.ndarray)] + [("argument", x) for x in sample]
    assert len(arrays) > 40
    for i, (name, a) in enumerate(arrays):
        for other, b in arrays[:i]:
            assert not np.shares_memory(a, b), (name, other)
    assert all((x == copy).all() for x, copy in zip(sample, given, strict=True))


def test_any_array_will_do(panda):
    """Lists, strided views and integers give what contiguous floats give; wrong sizes do not pass."""
    q, qd, tau, _ = panda.cases[0].sample
    expected = panda.cases[0].s
    strided = [np.repeat(x, 3)[::3] for x in (q, qd, tau)]
    lists = [list(x) for x in (q, qd, tau)]
    for arguments in (strided, lists):
        assert (panda.dyn.evaluate(*arguments).coriolis == expected.coriolis).all()
    whole = np.arange(panda.model.nv)
    assert (panda.dyn.evaluate(whole, whole).nu == panda.dyn.evaluate(whole * 1.0, whole * 1.0).nu).all()
    for wrong in (q[:-1], np.append(q, 0), q[:, None]):
        with pytest.raises(dd.InputError):
            panda.dyn.evaluate(wrong, qd)
        with pytest.raises(dd.InputError):
            panda.dyn.evaluate(q, wrong)
        with pytest.raises(dd.InputError):
            panda.dyn.evaluate(q, qd, wrong)


@pytest.mark.parametrize("gravity", [(0.0, 0.0, 0.0), (1.5, -2.5, 3.0)], ids=str)
@pytest.mark.parametrize("id", [PANDA, "tiago_description/robots/tiago_dual.urdf"])
def test_gravity_argument(id, gravity):
    """Gravity is an argument, reaches everything it belongs to, and never C."""
    robot = robots.robot(id)
    dyn = dd.DiagonalDynamics(dd.load_urdf(robot.source, mimic="free", gravity=gravity, **robot.options))
    earth = load(robot)
    oracle = Oracle(robot.urdf, earth.model.dof_names, gravity, **robot.options)
    for case in earth.cases:
        q, qd, tau, qdd = case.sample
        s, t, unit = dyn.evaluate(q, qd, tau), oracle.at(q, qd, tau), case.unit
        scale = norm(gravity) * np.sqrt(oracle.mass)
        assert_close(s.gravity, t.gravity, tolerance(t), scale)
        assert_close(dyn.gravity_torque(q) / unit, t.g / unit, tolerance(t), scale)
        assert (s.coriolis == case.s.coriolis).all()
        assert (dyn.bias(q, qd) == case.dyn.bias(q, qd)).all()
        assert_close(dyn.forward_dynamics(q, qd, tau) * unit, t.acceleration * unit, tolerance(t))
        assert_close(dyn.inverse_dynamics(q, qd, qdd) / unit, oracle.inverse_dynamics(q, qd, qdd) / unit, 1e-10)
        scale = norm(s.nu) * (norm(s.epsilon) + scale + t.coriolis_scale)
        assert_close(s.power, t.power, tolerance(t), scale)


def test_continuous_joint_has_one_angle(robot):
    """Full turns of a continuous or revolute joint change nothing but rounding."""
    case = robot.cases[0]
    turning = {name for k, name in enumerate(robot.model.dof_names) if not robot.oracle.is_prismatic(k)}
    turning |= {name for name in robot.model.coordinate_names if name.endswith("/theta")}
    turns = np.array([2 * np.pi * (name in turning) for name in robot.model.coordinate_names])
    assert turns.any() or robot.model.floating_base or not turning
    s = case.dyn.evaluate(case.sample.q + turns, case.sample.qd)
    assert_close(s.nu, case.s.nu, tolerance(case.truth))
    assert_close(s.coriolis, case.s.coriolis, tolerance(case.truth), case.truth.coriolis_scale)


# --- closed forms


@pytest.mark.parametrize("seed", range(5))
def test_two_link_arm(seed):
    """The textbook arm, worked out by hand."""
    arm = robots.TwoLinkArm(*np.random.default_rng(seed).uniform(0.2, 2, 7))
    q, qd = np.random.default_rng(seed + 100).uniform(-3, 3, (2, 2))
    dyn = dd.DiagonalDynamics(dd.load_urdf(arm.urdf))
    s, f = dyn.evaluate(q, qd), dyn.factors(q)
    unit, D = arm.factor(q)
    m = unit * np.sqrt(D)
    assert np.allclose(dyn.mass_matrix(q), arm.mass_matrix(q), rtol=1e-12)
    assert np.allclose(dyn.bias(q, qd), arm.bias(q, qd), rtol=1e-11, atol=1e-13)
    assert np.allclose(f.unit, unit, rtol=1e-12)
    assert np.allclose(f.D, D, rtol=1e-12)
    assert np.allclose(s.nu, m.T @ qd, rtol=1e-12)
    assert np.allclose(s.coriolis, arm.coriolis(q, qd), rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("urdf", [robots.PENDULUM, robots.GANTRY], ids=["one joint", "gantry"])
def test_no_coriolis_term(urdf):
    """C = 0 for one joint, and where there are translations only; C_ξ too, as D is constant."""
    model = dd.load_urdf(urdf)
    dyn = dd.DiagonalDynamics(model)
    for q, qd in np.random.default_rng(5).uniform(-3, 3, (10, 2, model.nv)):
        s = dyn.evaluate(q, qd)
        rounding = 10 * EPS * norm(s.nu) * norm(qd)
        assert norm(s.coriolis) <= rounding
        assert norm(s.coriolis_unnormalized / np.sqrt(s.articulated_inertia)) <= rounding
        assert (s.articulated_inertia == dyn.evaluate(0 * q, qd).articulated_inertia).all()


# --- the tests can fail

MUTANTS = {
    "sign of the rate of P in C": (
        "evaluation.py",
        "along(direction, y) - power(u, V)",
        "along(direction, y) + power(u, V)",
    ),
    "sign of its source": (
        "stacks.py",
        "matrix_sum(M, _moved(direction, rate, M))",
        "matrix_difference(M, _moved(direction, rate, M))",
    ),
    "sign of it in a base": ("evaluation.py", "bias[c] - momentum_rate", "bias[c] + momentum_rate"),
    "sign of it in a group": ("evaluation.py", "-bias[k] - momentum_rate", "-bias[k] + momentum_rate"),
}
MUTATED = {"sign of it in a base": f"{PANDA}+floating", "sign of it in a group": "mobile_tree_20"}
"""Robots that show it, where an arm does not."""

COMPARISONS = (
    "test_coriolis",
    "test_coriolis_by_difference",
    "test_coriolis_does_no_work",
    "test_total_joint_rates",
)


@pytest.fixture(scope="module")
def mutants(tmp_path_factory):
    """Start the comparisons of C for a copy of the package per mutant, all at once."""
    here = Path(__file__).parent
    runs = {}
    for name, replacement in MUTANTS.items():
        folder = tmp_path_factory.mktemp("mutant")
        package = folder / "diag_dynamics"
        shutil.copytree(Path(dd.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
        for file in ("accuracy.py", "oracles.py", "robots.py"):
            shutil.copy(here.parent / "support" / file, folder)
        shutil.copy(__file__, folder)
        file, right, wrong = replacement
        sweep = package / "sweeps" / file
        source = sweep.read_text(encoding="utf-8")
        assert source.count(right) == 1, f"{file} has changed: mutate it anew ({name})"
        sweep.write_text(source.replace(right, wrong), encoding="utf-8")
        paths = os.pathsep.join(filter(None, (str(folder), os.environ.get("PYTHONPATH"))))
        robot = MUTATED.get(name, PANDA)
        tests = [f"test_physics.py::{test}[{robot}]" for test in COMPARISONS]
        runs[name] = subprocess.Popen(
            [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-rA", "--tb=line", *tests],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": paths, "NUMBA_CACHE_DIR": str(folder / "cache"), "PYTEST_ADDOPTS": ""},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
    yield runs
    for run in runs.values():
        run.kill()
        run.wait()


@pytest.mark.parametrize("name", MUTANTS)
def test_wrong_sign_is_noticed(mutants, name):
    """The comparisons above, which the package passes, fail on a copy with a sign flipped in the Λ term."""
    output, _ = mutants[name].communicate(timeout=1200)  # all of them compile at once
    outcome = {test: f"PASSED test_physics.py::{test}[" in output for test in COMPARISONS}
    assert outcome["test_total_joint_rates"], output  # the copy works at all
    assert not outcome["test_coriolis"], output
    assert not outcome["test_coriolis_by_difference"], output
    assert output.count("relative error") >= 2, output  # by disagreement, not by accident
