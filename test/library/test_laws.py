# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The laws of diagonalized dynamics, one test each, over fixed, floating and coupled robots, against Pinocchio.

Errors are measured in the units of ν (√J), in which all dofs weigh alike: rates times √M_kk, torques over it.
"""

import pickle
import re
from itertools import combinations

import numpy as np
import pytest

import diag_dynamics as dd
import robots
from accuracy import assert_close, norm, tolerance_of_differences
from coupling import NAMED, Coupled
from law_cases import Robot, assert_same, everything, fields, load, wrenches_on
from oracles import FLOATING

PANDA = "panda_description/urdf/panda.urdf"
TALOS = "talos_data/robots/talos_reduced.urdf"

# Some example robots have inertias that no rigid body has; test_urdf.py is about that.
pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")


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
    """Joints are Pinocchio's but for mimic joints that are coupled, base to tip; links are the URDF's."""
    model, oracle = robot.model, robot.oracle
    assert model.nv == len(model.dof_names) == oracle.nv
    assert model.nq == len(model.coordinate_names) == oracle.nq
    assert isinstance(model.dof_names, tuple) and isinstance(model.coordinate_names, tuple)
    assert model.joint_names == tuple(dict.fromkeys(name.split("/")[0] for name in model.dof_names))
    if not isinstance(oracle, Coupled):
        assert set(model.joint_names) == set(list(oracle.model.names)[1:])
    assert (model.neutral == oracle.neutral).all()
    assert oracle.ancestors(0) == frozenset()
    if model.floating_base:
        assert model.dof_names[:6] == tuple(f"root_joint/{suffix}" for suffix in FLOATING)
        assert oracle.ancestors(5) == set(range(5))
    assert all(j < k for k in range(model.nv) for j in oracle.ancestors(k))
    assert sorted(model.link_names) == sorted(link.get("name") for link in oracle.xml.findall("link"))


# --- factors: M = m mᵀ


def test_m_is_the_udu_factor(robot):
    """m = U √D, unit = U, D = D of Pinocchio's Cholesky decomposition, row by row."""
    for c in robot.cases:
        assert_close(c.f.m / c.unit[:, None], c.t.m / c.unit[:, None], c.tolerance)
        assert_close(c.f.unit * np.sqrt(c.t.D) / c.unit[:, None], c.t.m / c.unit[:, None], c.tolerance)
        assert_close(c.f.D / c.t.D, np.ones_like(c.t.D), c.tolerance)
        assert (c.s.articulated_inertia == c.f.D).all()


def test_m_factors_the_mass_matrix(robot):
    """M = m mᵀ, with M of the library, of Pinocchio, and of the factors; both triangles of M are alike."""
    for c in robot.cases:
        M, scale = c.dyn.mass_matrix(c.t.q), np.outer(c.unit, c.unit)
        assert_close(c.f.m @ c.f.m.T / scale, c.t.M / scale, 1e-12)
        assert_close(c.f.unit * c.f.D @ c.f.unit.T / scale, c.t.M / scale, 1e-12)
        assert_close(M / scale, c.t.M / scale, 1e-12)
        assert (M == M.T).all()


def test_l_inverts_m(robot):
    """ℓ m = m ℓ = I, and ℓᵀℓ = M⁻¹."""
    for c in robot.cases:
        identity = np.eye(robot.model.nv)
        assert_close(c.f.l @ c.f.m, identity, c.tolerance)
        assert_close((c.f.m @ c.f.l) * c.unit / c.unit[:, None], identity, c.tolerance)
        assert_close(c.f.l @ c.t.m, identity, c.tolerance)


def test_factors_have_the_sparsity_of_the_tree(robot):
    """m[i, j] ≠ 0 only where i = j or i is an ancestor of j: exact zeros elsewhere. So for ℓ."""
    nv = robot.model.nv
    allowed = np.eye(nv, dtype=bool)
    for k in range(nv):
        allowed[list(robot.oracle.ancestors(k)), k] = True
    for c in robot.cases:
        for factor in (c.f.m, c.f.unit, c.f.l):
            assert (factor[~allowed] == 0).all()
            assert (np.triu(factor) == factor).all()
        assert (np.diag(c.f.unit) == 1).all()
        assert (c.f.D > 0).all()


# --- rates, moments, energy


def test_total_joint_rates(robot):
    """ν = mᵀ q̇ and ξ = D^−½ ν."""
    for c in robot.cases:
        assert_close(c.s.nu, c.t.nu, c.tolerance)
        assert_close(np.sqrt(c.t.D) * c.s.xi, c.t.nu, c.tolerance)
        assert_close(np.sqrt(c.s.articulated_inertia) * c.s.xi, c.s.nu, 1e-15)


def test_working_moments(robot):
    """ε = ℓ τ and κ = D^½ ε."""
    for c in robot.cases:
        assert_close(c.s.epsilon, c.t.epsilon, c.tolerance)
        assert_close(c.s.kappa / np.sqrt(c.t.D), c.t.kappa / np.sqrt(c.t.D), c.tolerance)
        assert_close(c.s.kappa / np.sqrt(c.s.articulated_inertia), c.s.epsilon, 1e-15)


def test_gravity(robot):
    """ε_g = ℓ g and g. Where gravity has no moment at all, relative to √mass·|g|, which bounds |ε_g|."""
    scale = np.sqrt(robot.oracle.mass) * 9.81
    for c in robot.cases:
        assert_close(c.s.gravity, c.t.gravity, c.tolerance, max(norm(c.t.gravity), 1e-3 * scale))
        g, expected = c.dyn.gravity_torque(c.t.q) / c.unit, c.t.g / c.unit
        assert_close(g, expected, c.tolerance, max(norm(expected), 1e-3 * scale))


def test_energy(robot):
    """K = ½ q̇ᵀM q̇; ½ν_k² are its shares."""
    for c in robot.cases:
        K = c.t.kinetic_energy
        assert_close(c.s.kinetic_energy, K, 1e-12)
        assert_close(c.s.energy_share, 0.5 * c.s.nu**2, 1e-15)
        assert_close(c.s.energy_share.sum(), K, 1e-12)


def test_link_energy(robot):
    """Each URDF link's own ½VᵀIV, armature counted where it moves; they sum to K."""
    for c in robot.cases:
        assert_close(c.s.link_energy, [c.t.link_energy[n] for n in robot.model.link_names], 1e-12)
        assert_close(c.s.link_energy.sum(), c.t.kinetic_energy, 1e-12)
        assert (c.s.link_energy >= 0).all()


def upper_rates(M, qd):
    """Return ν = mᵀq̇ with m the upper Cholesky factor of M."""
    return np.linalg.cholesky(M[::-1, ::-1])[::-1, ::-1].T @ qd


def test_base_energy(robot):
    """The shares of a floating base's six dofs sum to ½V*ᵀPV*, whatever the order of its twist's components."""
    for c in robot.cases:
        if not robot.model.floating_base:
            assert c.s.base_energy == 0.0
            continue
        angular_first = np.r_[3:6, 0:3, 6 : robot.model.nv]
        nu = upper_rates(c.t.M[np.ix_(angular_first, angular_first)], c.t.qd[angular_first])
        assert_close(c.s.base_energy, 0.5 * nu[:6] @ nu[:6], c.tolerance)
        assert_close(c.s.base_energy, c.s.energy_share[:6].sum(), 1e-15)
        assert 0 < c.s.base_energy <= c.t.kinetic_energy * (1 + 1e-12)


def test_energy_of_a_joint_does_not_depend_on_the_order_of_its_dofs(robot):
    """The shares of a planar or floating joint, anywhere, sum to the same with its dofs in reverse."""
    joints = {frozenset(robot.oracle.joint_mates(k)) for k in range(robot.model.nv)}
    c = robot.cases[0]
    for joint in (sorted(joint) for joint in joints if len(joint) > 1):
        order = np.arange(robot.model.nv)
        order[joint] = joint[::-1]
        nu = upper_rates(c.t.M[np.ix_(order, order)], c.t.qd[order])
        assert_close(c.s.energy_share[joint].sum(), 0.5 * nu[joint] @ nu[joint], c.tolerance)
        if robot.id == f"{TALOS}+floating":  # though each share does
            assert abs(nu[joint[0]] - c.s.nu[joint[-1]]) > 1e-3 * norm(c.s.nu[joint])


# --- the Coriolis term


def unnormalized_scale(t) -> float:
    """Return the size of the terms of D^−½C_ξ."""
    return t.coriolis_scale + norm(t.Ddot * t.xi / np.sqrt(t.D))


def test_coriolis(robot):
    """C = ℓc − ṁᵀq̇, ṁ from Pinocchio's Coriolis matrix."""
    for c in robot.cases:
        assert_close(c.s.coriolis, c.t.coriolis, c.tolerance, c.t.coriolis_scale)


def test_coriolis_by_difference(robot):
    """C = ℓc − ṁᵀq̇, ṁ from differences of Pinocchio's factor: no recursion, no Coriolis matrix."""
    for c in robot.cases:
        assert_close(c.s.coriolis, c.t.coriolis_by_difference, tolerance_of_differences(c.t), c.t.coriolis_scale)


def test_coriolis_unnormalized(robot):
    """C_ξ of Lemma 7.3."""
    for c in robot.cases:
        root = np.sqrt(c.t.D)
        expected = c.t.coriolis_unnormalized / root
        assert_close(c.s.coriolis_unnormalized / root, expected, c.tolerance, unnormalized_scale(c.t))


def test_coriolis_does_no_work(robot):
    """νᵀC = 0 (Lemma 7.1)."""
    for c in robot.cases:
        assert_close(c.s.nu @ c.s.coriolis, 0.0, 1e-12, norm(c.s.nu) * c.t.coriolis_scale)


def test_unnormalized_coriolis_does_work(robot):
    """ξᵀC_ξ = ½ ξᵀḊξ, which is not zero."""
    for c in robot.cases:
        scale = norm(c.s.nu) * unnormalized_scale(c.t)
        expected = 0.5 * c.t.xi @ (c.t.Ddot * c.t.xi)
        assert_close(c.s.xi @ c.s.coriolis_unnormalized, expected, c.tolerance, scale)


# --- dynamics


def test_bias(robot):
    """The classical bias c without gravity."""
    for c in robot.cases:
        scale = max(norm(c.t.c / c.unit), 1e-3 * norm(c.t.nu) * norm(c.t.qd))
        assert_close(c.dyn.bias(c.t.q, c.t.qd) / c.unit, c.t.c / c.unit, c.tolerance, scale)


def test_inverse_dynamics(robot):
    """τ of rnea, gravity included."""
    for c in robot.cases:
        tau = robot.oracle.inverse_dynamics(c.t.q, c.t.qd, c.sample.qdd)
        assert_close(c.dyn.inverse_dynamics(c.t.q, c.t.qd, c.sample.qdd) / c.unit, tau / c.unit, c.tolerance)


def test_forward_dynamics(robot):
    """q̈ of aba, gravity included; the library's inverse dynamics undoes its forward dynamics."""
    for c in robot.cases:
        actual = c.dyn.forward_dynamics(c.t.q, c.t.qd, c.t.tau)
        assert_close(actual * c.unit, c.t.acceleration * c.unit, c.tolerance)
        qdd = c.sample.qdd
        again = c.dyn.forward_dynamics(c.t.q, c.t.qd, c.dyn.inverse_dynamics(c.t.q, c.t.qd, qdd))
        assert_close(again * c.unit, qdd * c.unit, c.tolerance)


def test_equation_of_motion(robot):
    """ν̇ + C + ε_g = ε along aba's acceleration; the library's ν̇ is that."""
    for c in robot.cases:
        terms = c.t.nu_dot, c.s.coriolis, c.s.gravity
        assert_close(sum(terms), c.s.epsilon, c.tolerance, sum(map(norm, (*terms, c.s.epsilon))))
        scale = norm(c.s.epsilon) + norm(c.s.gravity) + c.t.coriolis_scale
        assert_close(c.s.nu_dot, c.t.nu_dot, c.tolerance, scale)


def test_unnormalized_equation_of_motion(robot):
    """D ξ̇ + C_ξ + κ_g = κ along aba's acceleration: ξ̇ = D^−½(ν̇ − ½ Ḋ D^−½ ξ) (Lemma 7.3)."""
    for c in robot.cases:
        t, root = c.t, np.sqrt(c.t.D)
        terms = root * t.nu_dot - 0.5 * t.Ddot * t.xi, c.s.coriolis_unnormalized, root * c.s.gravity
        scale = sum(norm(term / root) for term in (*terms, c.s.kappa)) + norm(t.Ddot * t.xi / root)
        assert_close(sum(terms) / root, c.s.kappa / root, c.tolerance, scale)


def test_nu_and_xi_move_by_the_equations_of_motion(robot):
    """The library's ν and ξ, differenced along aba's motion: ν̇ = ε − C − ε_g, Dξ̇ = κ − C_ξ − κ_g.

    Fourth-order differences of a curve through the state: 1e-8 of ν̇, plus 2e-14 of ν over the step.
    """
    for c in robot.cases:
        s, t, root = c.s, c.t, np.sqrt(c.t.D)
        h = 1e-3 / max(1.0, np.abs(t.qd).max(), np.sqrt(np.abs(t.acceleration).max()))
        # a motion with the right q̇ and q̈ at 0; the rates there depend on nothing else
        along = []
        for x in (-2, -1, 1, 2):
            q = robot.oracle.moved(t.q, x * h * t.qd + 0.5 * (x * h) ** 2 * t.acceleration)
            along.append(c.dyn.evaluate(q, t.qd + x * h * t.acceleration))

        def rate(name, along=along, h=h):
            values = [getattr(state, name) for state in along]
            return (8 * (values[2] - values[1]) - (values[3] - values[0])) / (12 * h)

        close = max(1e-8, c.tolerance)
        scale = sum(map(norm, (s.coriolis, s.gravity, s.epsilon))) + 2e-6 * norm(s.nu) / h
        assert_close(rate("nu"), s.epsilon - s.coriolis - s.gravity, close, scale)
        terms = s.kappa / root, s.gravity, s.coriolis_unnormalized / root
        scale = sum(map(norm, terms)) + 2e-6 * norm(s.nu) / h
        assert_close(root * rate("xi"), terms[0] - terms[1] - terms[2], close, scale)


def test_power(robot):
    """K̇ = νᵀ(ε − ε_g) (Lemma 7.2) is what aba's acceleration makes of ½q̇ᵀMq̇; νᵀε = q̇ᵀτ."""
    for c in robot.cases:
        s, t = c.s, c.t
        scale = norm(s.nu) * (norm(s.epsilon) + norm(s.gravity) + t.coriolis_scale)
        assert_close(s.power, t.power, c.tolerance, scale)
        assert_close(s.power, s.nu @ (s.epsilon - s.gravity), 1e-14, scale)
        assert_close(s.nu @ s.epsilon, t.qd @ t.tau, c.tolerance, norm(s.nu) * norm(s.epsilon))


# --- external wrenches and friction, each a term of its own


@pytest.mark.parametrize("frame", ["link", "world"])
def test_external_wrenches(robot, frame):
    """ℓJᵀf, q̈, τ and K̇ with wrenches, Jᵀ from Pinocchio's frames; nothing else changes."""
    wrenches = wrenches_on(robot.model, len(robot.id))
    for c in robot.cases:
        (q, qd, tau, qdd), t = c.sample, c.t
        effort = robot.oracle.effort_of(q, wrenches, frame)
        s = c.dyn.evaluate(q, qd, tau, wrenches, frame=frame)
        expected = np.linalg.solve(t.m, effort)
        scale = max(norm(expected), norm(t.epsilon))  # wrenches on a robot that is one joint may do nothing
        assert_close(s.external, expected, c.tolerance, scale)
        assert_same(fields(s), fields(c.s, "power"))
        # s.epsilon is that of τ alone; the equation of motion has the wrenches as a further term
        loaded = robot.oracle.at(q, qd, tau + effort)
        actual = c.dyn.forward_dynamics(q, qd, tau, wrenches, frame=frame)
        assert_close(actual * c.unit, loaded.acceleration * c.unit, c.tolerance)
        rnea = robot.oracle.inverse_dynamics(q, qd, qdd)
        actual = c.dyn.inverse_dynamics(q, qd, qdd, wrenches, frame=frame)
        scale = norm(rnea / c.unit) + norm(effort / c.unit)
        assert_close(actual / c.unit, (rnea - effort) / c.unit, c.tolerance, scale)
        terms = (loaded.nu_dot, s.coriolis, s.gravity, s.epsilon, s.external)
        assert_close(sum(terms[:3]), s.epsilon + s.external, c.tolerance, sum(map(norm, terms)))
        scale = norm(s.nu) * (sum(map(norm, terms[2:])) + t.coriolis_scale)
        assert_close(s.power, loaded.power, c.tolerance, scale)


def test_friction(robot):
    """Damping and Coulomb friction of the URDF, only on request, against Pinocchio driven by τ − τ_fric.

    Mimic joints brake their source joints: GᵀdG and |G|ᵀf.
    """
    model, oracle = robot.model, robot.oracle
    full, G = getattr(oracle, "full", oracle), getattr(oracle, "G", np.eye(model.nv))
    given = {element.get("name"): element.find("dynamics") for element in oracle.xml.findall("joint")}

    def numbers(name):
        values = [given[joint].get(name) if given.get(joint) is not None else 0 for joint in full.joint_of_dof]
        return np.array([float(value or 0) for value in values])

    damping, coulomb = (G**2).T @ numbers("damping"), np.abs(G).T @ numbers("friction")
    for c in robot.cases:
        (q, qd, tau, qdd), t = c.sample, c.t
        resisting = damping * qd + coulomb * np.tanh(qd / 5e-3)
        assert_close(c.dyn.friction_torque(qd), resisting, 1e-15)
        s = c.dyn.evaluate(q, qd, tau, friction=True)
        assert_close(s.friction, np.linalg.solve(t.m, resisting), c.tolerance)
        assert c.s.friction is None
        assert_same(fields(s), fields(c.s, "power"))
        slowed = oracle.at(q, qd, tau - resisting)
        actual = c.dyn.forward_dynamics(q, qd, tau, friction=True)
        assert_close(actual * c.unit, slowed.acceleration * c.unit, c.tolerance)
        actual = c.dyn.inverse_dynamics(q, qd, qdd, friction=True)
        expected = (oracle.inverse_dynamics(q, qd, qdd) + resisting) / c.unit
        assert_close(actual / c.unit, expected, c.tolerance, norm(expected) + norm(resisting / c.unit))
        terms = (slowed.nu_dot, s.coriolis, s.gravity, s.friction, s.epsilon)
        assert_close(sum(terms[:4]), s.epsilon, c.tolerance, sum(map(norm, terms)))
        assert_close(s.power, slowed.power, c.tolerance, norm(s.nu) * (sum(map(norm, terms)) + t.coriolis_scale))


def test_coulomb_friction_is_smooth_at_rest():
    """Odd, rising and continuous, f sign(q̇) but for 1e-4 beyond 25 mrad/s; its rate stays with the model."""
    urdf = re.sub('damping="[^"]*" friction="[^"]*"', 'damping="0" friction="1.5"', robots.robot(PANDA).urdf)
    model = dd.load_urdf(urdf)
    torque, rubbing = dd.DiagonalDynamics(model).friction_torque, model.friction > 0.0
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
    copies = other.with_gravity((0, 0, 0)), other.with_payload("panda_hand", 1.0), pickle.loads(pickle.dumps(other))
    assert [copy.friction_velocity for copy in copies] == 3 * [0.02]
    jumping = dd.DiagonalDynamics(dd.load_urdf(urdf, friction_velocity=0))
    qd = np.linspace(-1e-9, 1e-9, model.nv)
    assert (jumping.friction_torque(qd)[rubbing] == 1.5 * np.sign(qd[rubbing])).all()
    for wrong in (-1e-3, np.nan, np.inf, "5e-3"):
        with pytest.raises(dd.InputError, match="friction_velocity"):
            dd.load_urdf(urdf, friction_velocity=wrong)


def test_power_balance_by_difference(robot):
    """K̇ = νᵀ(ε − ε_g + ℓJᵀf − ε_fric) is what K does along the library's own motion, differenced.

    Fourth-order differences: 1e-8 of the terms, plus the rounding of K over the step.
    """
    more = {"f_ext": wrenches_on(robot.model, 1), "frame": "world", "friction": True}
    for c in robot.cases:
        q, qd, tau, _ = c.sample
        s, qdd = c.dyn.evaluate(q, qd, tau, **more), c.dyn.forward_dynamics(q, qd, tau, **more)
        h = 1e-3 / max(1.0, np.abs(qd).max(), np.sqrt(np.abs(qdd).max()))
        energy = []
        for x in (-2, -1, 1, 2):
            at = robot.oracle.moved(q, x * h * qd + 0.5 * (x * h) ** 2 * qdd)
            energy.append(c.dyn.evaluate(at, qd + x * h * qdd).kinetic_energy)
        rate = (8 * (energy[2] - energy[1]) - (energy[3] - energy[0])) / (12 * h)
        terms = norm(s.nu) * sum(map(norm, (s.epsilon, s.gravity, s.external, s.friction, s.coriolis)))
        assert_close(rate, s.power, max(1e-8, c.tolerance), terms + 2e-6 * s.kinetic_energy / h)


# --- the four sweeps


def test_sweeps_are_the_factors(robot):
    """ν = mᵀq̇, q̇ = ℓᵀν, ε = ℓτ, τ = mε for any vector, without a matrix; the evaluation's ν and ε are theirs."""
    for c in robot.cases:
        dyn, t, x = c.dyn, c.t, np.array(c.sample.qdd)
        assert_close(dyn.nu_from_qd(t.q, x), t.m.T @ x, c.tolerance)
        assert_close(dyn.qd_from_nu(t.q, x) * c.unit, np.linalg.solve(t.m.T, x) * c.unit, c.tolerance)
        assert_close(dyn.epsilon_from_tau(t.q, x), np.linalg.solve(t.m, x), c.tolerance)
        assert_close(dyn.tau_from_epsilon(t.q, x) / c.unit, t.m @ x / c.unit, c.tolerance)
        assert_close(dyn.nu_from_qd(t.q, t.qd), c.s.nu, 1e-14)
        assert_close(dyn.epsilon_from_tau(t.q, t.tau), c.s.epsilon, c.tolerance)


def test_sweeps_invert_each_other(robot):
    """Each outward and each inward sweep has its inverse."""
    for c in robot.cases:
        dyn, t, unit = c.dyn, c.t, c.unit
        assert_close(dyn.qd_from_nu(t.q, dyn.nu_from_qd(t.q, t.qd)) * unit, t.qd * unit, c.tolerance)
        assert_close(dyn.nu_from_qd(t.q, dyn.qd_from_nu(t.q, t.qd)), t.qd, c.tolerance)
        assert_close(dyn.tau_from_epsilon(t.q, dyn.epsilon_from_tau(t.q, t.tau)) / unit, t.tau / unit, c.tolerance)
        assert_close(dyn.epsilon_from_tau(t.q, dyn.tau_from_epsilon(t.q, t.tau)), t.tau, c.tolerance)


# --- what depends on what: exactly, by structure


def others(robot, case, names):
    """Return copies of the sample's q, q̇ and τ in which the dofs of `names` are changed, the rest to the bit."""
    step = 0.7 * np.isin(np.arange(robot.model.nv), list(names))
    q, qd, tau, _ = case.sample
    moved, o = robot.oracle.moved(q, step), robot.oracle
    same = ~np.isin(o.joint_of_coordinate, [o.joint_of_dof[k] for k in names])
    moved[same] = q[same]  # angles of planar joints have gone through sine and cosine
    return moved, qd + step, tau + step


def test_nu_ignores_outboard_rates(robot):
    """ν_k, ξ_k do not depend on the rates of joints that are not k or inboard of it."""
    case, nv = robot.cases[1], robot.model.nv
    expected = case.dyn.nu_from_qd(case.sample.q, case.sample.qd)
    for k in range(nv):
        _, qd, _ = others(robot, case, set(range(nv)) - (robot.oracle.ancestors(k) | {k}))
        s = case.dyn.evaluate(case.sample.q, qd, case.sample.tau)
        assert (s.nu[k], s.xi[k]) == (case.s.nu[k], case.s.xi[k])
        assert case.dyn.nu_from_qd(case.sample.q, qd)[k] == expected[k]


def test_epsilon_ignores_inboard_torques(robot):
    """ε_k, κ_k do not depend on the torques of joints that are not k or outboard of it."""
    case, nv = robot.cases[1], robot.model.nv
    for k in range(nv):
        _, _, tau = others(robot, case, set(range(nv)) - (robot.oracle.descendants(k) | {k}))
        s = case.dyn.evaluate(case.sample.q, case.sample.qd, tau)
        assert (s.epsilon[k], s.kappa[k]) == (case.s.epsilon[k], case.s.kappa[k])


def test_reduced_manipulator(robot):
    """D, and the block of m of a joint and all that is outboard of it, ignore all positions not outboard of it.

    The joint's own positions are among these; those of coupled joints are not.
    """
    case, o, nv = robot.cases[1], robot.oracle, robot.model.nv
    for node in {tuple(sorted(o.joint_mates(k))) for k in range(nv)}:
        outboard = set.intersection(*(o.descendants(k) for k in node)) - set(node)
        kept = outboard | set(node) if o.is_coupled(node[0]) else outboard
        q, _, _ = others(robot, case, set(range(nv)) - kept)
        f, node = case.dyn.factors(q), list(node)
        assert (f.D[node] == case.f.D[node]).all()
        assert (case.dyn.evaluate(q, case.sample.qd).articulated_inertia[node] == case.f.D[node]).all()
        block = np.ix_(sorted(outboard | set(node)), sorted(outboard | set(node)))
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
    case, zero = robot.cases[0], np.zeros(robot.model.nv)
    s = case.dyn.evaluate(case.sample.q, zero, case.sample.tau)
    assert_same(fields(s, "kinetic_energy", "power"), {"epsilon": case.s.epsilon, "gravity": case.s.gravity})
    for name in ("nu", "xi", "coriolis", "coriolis_unnormalized", "energy_share", "link_energy"):
        assert (getattr(s, name) == 0).all(), name
    assert s.kinetic_energy == 0 and s.power == 0
    assert (case.dyn.bias(case.sample.q, zero) == 0).all()


def test_continuous_joint_has_one_angle(robot):
    """Full turns of an angle that no other joint follows change nothing but rounding."""
    case, model = robot.cases[0], robot.model
    sources = {mimic.leader for mimic in model.mimics.values()}
    turning = {name for k, name in enumerate(model.dof_names) if not robot.oracle.is_prismatic(k)} - sources
    turning |= {name for name in model.coordinate_names if name.endswith("/theta")}
    turns = np.array([2 * np.pi * (name in turning) for name in model.coordinate_names])
    s = case.dyn.evaluate(case.sample.q + turns, case.sample.qd)
    assert_close(s.nu, case.s.nu, case.tolerance)
    assert_close(s.coriolis, case.s.coriolis, case.tolerance, case.t.coriolis_scale)


# --- the interface's promises


def test_without_torque(robot):
    """No τ, no moments: None, and the rest unchanged to the bit."""
    case = robot.cases[0]
    s = case.dyn.evaluate(case.sample.q, case.sample.qd)
    assert s.epsilon is None and s.kappa is None and s.power is None
    assert_same(fields(s), fields(case.s, "epsilon", "kappa", "power"))


def test_no_memory_of_earlier_calls(robot):
    """Workspaces are reused; answers do not show it, and what was handed out stays as it was."""
    first, other = robot.cases[0].sample, robot.cases[2].sample
    before = everything(robot.dyn, first)
    kept = {name: np.array(value) for name, value in before.items()}
    everything(robot.dyn, other)
    assert_same(before, kept)
    assert_same(everything(robot.dyn, first), kept)
    assert_same(everything(dd.DiagonalDynamics(robot.model), first), kept)


def test_nothing_is_left_unwritten(robot, monkeypatch):
    """Every entry handed out was computed: memory that starts as NaN changes no answer."""
    expected, empty = everything(robot.dyn, robot.cases[1].sample), np.empty

    def of_nan(shape, dtype=np.float64, **_):
        array = empty(shape, dtype)
        array.reshape(-1).view(np.uint8)[...] = 0xFF  # a NaN in every field of a record, too
        return array

    monkeypatch.setattr(np, "empty", of_nan)
    assert_same(everything(robot.dyn, robot.cases[1].sample), expected)


def test_answers_share_no_memory(panda):
    """No two arrays handed out overlap each other or the arguments, which stay as they are."""
    sample = panda.cases[0].sample
    given = [x.copy() for x in sample]
    answers = [*everything(panda.dyn, sample).items(), *everything(panda.dyn, sample).items()]
    arrays = [(name, a) for name, a in answers if isinstance(a, np.ndarray)] + [("argument", x) for x in sample]
    assert len(arrays) > 60
    for (name, a), (other, b) in combinations(arrays, 2):
        assert not np.shares_memory(a, b), (name, other)
    assert all((x == copy).all() for x, copy in zip(sample, given, strict=True))


def test_any_array_will_do(panda):
    """Lists, strided views and integers give what contiguous floats give; wrong sizes do not pass."""
    q, qd, tau, _ = panda.cases[0].sample
    for arguments in ([np.repeat(x, 3)[::3] for x in (q, qd, tau)], [list(x) for x in (q, qd, tau)]):
        assert (panda.dyn.evaluate(*arguments).coriolis == panda.cases[0].s.coriolis).all()
    whole = np.arange(panda.model.nv)
    assert (panda.dyn.evaluate(whole, whole).nu == panda.dyn.evaluate(whole * 1.0, whole * 1.0).nu).all()
    for wrong in (q[:-1], np.append(q, 0), q[:, None]):
        for arguments in ((wrong, qd), (q, wrong), (q, qd, wrong)):
            with pytest.raises(dd.InputError):
                panda.dyn.evaluate(*arguments)


@pytest.mark.parametrize("gravity", [(0.0, 0.0, 0.0), (1.5, -2.5, 3.0)], ids=str)
@pytest.mark.parametrize("robot", [robots.robot(PANDA), NAMED["parallel gripper"]._replace(mimic="embed")])
def test_gravity_argument(robot, gravity):
    """Gravity is an argument or a change of the model, reaches everything it belongs to, and never C."""
    moved, earth = load(robot, gravity=gravity), load(robot)
    changed = dd.DiagonalDynamics(earth.model.with_gravity(gravity))
    for c, before in zip(moved.cases, earth.cases, strict=True):
        (q, qd, tau, qdd), s, t, unit = c.sample, c.s, c.t, c.unit
        scale = norm(gravity) * np.sqrt(moved.oracle.mass)
        assert_close(s.gravity, t.gravity, c.tolerance, scale)
        assert (changed.evaluate(q, qd, tau).gravity == s.gravity).all()
        assert_close(c.dyn.gravity_torque(q) / unit, t.g / unit, c.tolerance, scale)
        assert (s.coriolis == before.s.coriolis).all()
        assert (c.dyn.bias(q, qd) == before.dyn.bias(q, qd)).all()
        assert_close(c.dyn.forward_dynamics(q, qd, tau) * unit, t.acceleration * unit, c.tolerance)
        expected = moved.oracle.inverse_dynamics(q, qd, qdd) / unit
        assert_close(c.dyn.inverse_dynamics(q, qd, qdd) / unit, expected, 1e-10)
        scale = norm(s.nu) * (norm(s.epsilon) + scale + t.coriolis_scale)
        assert_close(s.power, t.power, c.tolerance, scale)
