# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The numbered statements of Jain and Rodriguez (1995) that are operator identities, or laws along a motion.

test_laws.py shows (1.1)–(1.3), (5.1), (5.2), (7.7)–(7.9), Lemma 7.1, Lemma 7.2 and Lemma 7.3 for every robot.
"""

import xml.etree.ElementTree as ET
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
import robots
from accuracy import EPS, assert_close, norm, tolerance
from derivative_oracles import RateOracle, link_placement, rate_oracle_of
from examples import some_of
from oracles import State
from paper_operators import ANGULAR_FIRST, Operators, cross, stacked, tilde
from robots import description, joint, link

PANDA = "panda_description/urdf/panda.urdf"
UR5 = "ur_description/urdf/ur5_robot.urdf"
HAND = "allegro_hand_description/urdf/allegro_left_hand.urdf"
TALOS = "talos_data/robots/talos_reduced.urdf"

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")


# --- cases


class Case(NamedTuple):
    """A robot in one state: the paper's operators, the oracle's truth, the library's answers."""

    w: Operators
    t: State
    dyn: dd.DiagonalDynamics
    s: object  # evaluate
    f: object  # factors
    sample: robots.Sample
    unit: np.ndarray  # √M_kk
    tolerance: float
    has_armature: bool


def cases_of(robot: robots.Robot) -> list[Case]:
    """Return the cases of a robot."""
    model = dd.load_urdf(robot.source, mimic="free", **robot.options)
    dyn, oracle = (
        dd.DiagonalDynamics(model),
        RateOracle(robot.urdf, model.dof_names, **robot.options),
    )
    out = []
    for sample in robots.samples(robot.id, oracle):
        q, qd, tau, _ = sample
        t = oracle.at(q, qd, tau)
        w = Operators(oracle, q, qd)
        s, f = dyn.evaluate(q, qd, tau), dyn.factors(q)
        out.append(
            Case(w, t, dyn, s, f, sample, np.sqrt(np.diag(t.M)), tolerance(t), bool(robot.armature))
        )
    return out


GEARED = next(robot for robot in robots.random_robots() if robot.armature)
ROBOTS = (robots.robot(UR5), robots.robot(HAND), robots.random_robots()[1], GEARED)


@pytest.fixture(scope="module", params=ROBOTS, ids=lambda robot: robot.id)
def cases(request) -> list[Case]:
    """Return the cases of each robot in turn: an arm, a hand, trees with slides, without and with armature."""
    return cases_of(request.param)


@pytest.fixture(params=range(len(robots.SPEEDS)))
def c(request, cases) -> Case:
    """Return each case of each robot in turn."""
    return cases[request.param]


@pytest.fixture(scope="module", params=ROBOTS[:2], ids=lambda robot: robot.id)
def revolute(request) -> list[Case]:
    """Return the cases of robots that have revolute joints only, as the paper's."""
    return cases_of(request.param)


def scaled(c: Case, A: np.ndarray) -> np.ndarray:
    """Return a matrix over the joints in units in which M_kk = 1."""
    return A / np.outer(c.unit, c.unit)


# --- Section 4: factorizations


def test_identity_4_1a(c):
    """Identity 4.1 (a): M = HφMφ*H*, the Newton–Euler factorization (armature added to its diagonal)."""
    w = c.w
    M = w.mine(w.H @ w.phi @ w.M @ w.phi.T @ w.H.T + w.armature)
    assert_close(scaled(c, c.dyn.mass_matrix(c.t.q)), scaled(c, M), 1e-12)


def test_identity_4_1b(c):
    """Identity 4.1 (b): M = [1 + HφK] D [1 + HφK]*, the innovations factorization; its factors are the library's."""
    w, root = c.w, c.unit
    M = w.mine(w.unit @ w.D @ w.unit.T)
    assert_close(scaled(c, c.dyn.mass_matrix(c.t.q)), scaled(c, M), 1e-12)
    weigh = np.sqrt(c.f.D) / root[:, None]
    assert_close(c.f.unit * weigh, w.mine(w.unit) * weigh, c.tolerance)
    assert_close(c.f.D / w.mine(np.diag(w.D)), np.ones(w.n), c.tolerance)


def test_identity_4_1c(c):
    """Identity 4.1 (c): [1 + HφK]⁻¹ = 1 − HψK."""
    w = c.w
    assert_close(w.mine(w.inverse) @ c.f.unit, w.I, c.tolerance, norm(w.inverse) * norm(c.f.unit))
    assert_close(w.unit @ w.inverse, w.I, c.tolerance, norm(w.inverse) * norm(w.unit))


def test_identity_4_1d(c):
    """Identity 4.1 (d): M⁻¹ = [1 − HψK]* D⁻¹ [1 − HψK] = ℓᵀℓ."""
    w, root = c.w, c.unit
    inverse = w.mine(w.inverse.T @ np.linalg.inv(w.D) @ w.inverse)
    weigh = np.outer(root, root)
    assert_close(c.f.l.T @ c.f.l * weigh, inverse * weigh, c.tolerance)
    assert_close(inverse @ c.t.M * root[:, None] / root, w.I, c.tolerance, norm(inverse * weigh))


def test_newton_euler(c):
    """(4.3)–(4.7): V = φ*H*θ', α = φ*(H*θ'' + a), f = φ(Mα + b), T = Hf is the library's inverse dynamics."""
    w, o = c.w, c.t.oracle
    speed = w.V.reshape(w.n, 6)
    pin.forwardKinematics(o.model, o.data, o.configuration(c.t.q), o.to_pin(c.t.qd))
    for k, X in enumerate(list(o.data.oMi)[1:]):
        own = o.data.v[k + 1]
        expected = np.concatenate([X.rotation @ own.angular, X.rotation @ own.linear])
        assert_close(speed[k], expected, 1e-13, norm(w.V))
    # the accelerations a and forces b of velocity: the spatial ones, not those of points
    a = w.V_cross @ w.H.T @ w.rates
    b = -w.V_cross.T @ w.M @ w.V
    rates = o.to_pin(c.sample.qdd)
    f = w.phi @ (w.M @ w.phi.T @ (w.H.T @ rates + a) + b)
    expected = w.mine(w.H @ f + w.armature @ rates)
    unit = c.unit
    actual = c.dyn.inverse_dynamics(c.t.q, c.t.qd, c.sample.qdd) - c.dyn.gravity_torque(c.t.q)
    scale = norm(expected / unit) + norm(c.t.g / unit)
    assert_close(actual / unit, expected / unit, c.tolerance, scale)


def test_algorithm_4_1(c):
    """Algorithm 4.1, (4.8), (4.9): P solves M = P − E_ψPE_φ*, and = P − E_ψPE_ψ* without armature; D, G, τ̄, K, ψ."""
    w, scale = c.w, norm(c.w.P)
    assert_close(w.P - w.E_psi @ w.P @ w.E_phi.T, w.M, 1e-13, scale)
    if not c.has_armature:
        assert_close(w.P - w.E_psi @ w.P @ w.E_psi.T, w.M, 1e-13, scale)
    elif w.n > 1:
        assert norm(w.P - w.E_psi @ w.P @ w.E_psi.T - w.M) > 1e-3 * scale
    D = w.mine(np.diag(w.H @ w.P @ w.H.T + w.armature))
    assert_close(c.s.articulated_inertia / D, np.ones(w.n), c.tolerance)
    assert_close(w.G @ w.D, w.P @ w.H.T, 1e-13, scale)
    assert_close(w.K, w.E_phi @ w.P @ w.H.T @ np.linalg.inv(w.D), 1e-13, norm(w.K))
    assert_close(w.tau_bar, w.one - w.G @ w.H, 1e-15)


# --- Section 5: rates and moments


def test_table_1(c):
    """Table 1: ν = D^½[θ' + G*V⁺] and θ' = D^−½ν − G*V⁺, body by body; (5.3): D^−½ν = own rate + induced rate."""
    w, root = c.w, c.unit
    V = np.zeros((w.n, 6))
    own = np.zeros(w.n)
    induced = np.zeros(w.n)
    nu = w.oracle.to_pin(c.dyn.nu_from_qd(c.t.q, c.t.qd))
    for k, parent in enumerate(w.parents):
        V_plus = w.E_phi[w.at(parent), w.at(k)].T @ V[parent] if parent >= 0 else np.zeros(6)
        induced[k] = w.G[w.at(k), k] @ V_plus
        own[k] = nu[k] / w.root[k, k] - induced[k]
        V[k] = V_plus + w.H[k, w.at(k)] * own[k]
    assert_close(w.mine(own) * root, c.t.qd * root, c.tolerance)
    assert_close(np.sqrt(c.f.D) * (c.t.qd + w.mine(induced)), c.s.nu, c.tolerance)
    assert_close(c.s.xi * np.sqrt(c.f.D), np.sqrt(c.f.D) * (c.t.qd + w.mine(induced)), c.tolerance)
    assert_close(V.ravel(), w.V, c.tolerance)


def test_table_2(c):
    """Table 2: ε = D^−½[T − Hz], z⁺ = z + G D^½ε, body by body; (5.4): T = D^½ε + compensation of the outboard."""
    w, root = c.w, c.unit
    epsilon = w.oracle.to_pin(c.dyn.epsilon_from_tau(c.t.q, c.t.tau))
    z, T = np.zeros((w.n, 6)), np.zeros(w.n)
    for k in reversed(range(w.n)):
        T[k] = w.root[k, k] * epsilon[k] + w.H[k, w.at(k)] @ z[k]
        if w.parents[k] >= 0:
            z_plus = z[k] + w.G[w.at(k), k] * w.root[k, k] * epsilon[k]
            z[w.parents[k]] += w.E_phi[w.at(w.parents[k]), w.at(k)] @ z_plus
    assert_close(w.mine(T) / root, c.t.tau / root, c.tolerance)
    assert_close(
        c.dyn.tau_from_epsilon(c.t.q, w.mine(epsilon)) / root, w.mine(T) / root, c.tolerance
    )
    # stacked: z = ψKT
    compensation = w.mine(w.H @ w.psi @ w.K @ w.oracle.to_pin(c.t.tau))
    weigh = np.sqrt(c.f.D)
    assert_close(c.s.kappa / weigh, (c.t.tau - compensation) / weigh, c.tolerance)


def test_induced_rates_and_moments_through_the_reduced_manipulator():
    """G_k depends on the positions strictly outboard of k only (after Algorithm 4.1): `unit` of a floating base has it.

    Its first six rows are G_k in the base's axes; in the body's own they do not change with the inboard positions.
    """
    for robot in (robots.robot(TALOS).floating, robots.random_robots()[0].floating):
        model = dd.load_urdf(robot.source, mimic="free", **robot.options)
        dyn, o = (
            dd.DiagonalDynamics(model),
            RateOracle(robot.urdf, model.dof_names, **robot.options),
        )
        q = robots.samples(robot.id, o)[1].q

        def gains(q, dyn=dyn, o=o):
            pin.forwardKinematics(o.model, o.data, o.configuration(q))
            base = o.data.oMi[1]
            return {
                k: o.data.oMi[o._joint[k]]
                .actInv(base.act(pin.Force(dyn.factors(q).unit[:6, k])))
                .vector
                for k in range(6, o.nv)
            }

        before = gains(q)
        for k in range(6, o.nv, 3):
            inboard = np.isin(np.arange(o.nv), list(set(range(o.nv)) - o.descendants(k)))
            after = gains(o.moved(q, 0.7 * inboard))
            assert_close(after[k], before[k], 1e-11)


# --- Section 6: derivatives in moving axes


def test_spatial_cross_product(c):
    """(5.5), (5.6), (6.3): X~ is the cross product of spatial motions; Ω_δ(k) = (H*θ')~ = V(k)~ less that of V⁺(k)~."""
    w, V_plus = c.w, c.w.E_phi.T @ c.w.V
    for k in range(w.n):
        at = w.at(k)
        action = pin.Motion(w.V[at][ANGULAR_FIRST]).action[np.ix_(ANGULAR_FIRST, ANGULAR_FIRST)]
        assert (w.block(w.V_cross, k) == action).all()
        assert_close(w.block(w.delta, k), cross(w.V[at]) - cross(V_plus[at]), 1e-14, norm(w.V))


MOVING = ("H", "M", "P", "D", "G", "tau_bar")


def rates_of(w: Operators, q, qd, function) -> list:
    """Return the rates of several matrices of the operators along a motion, by differences."""
    shapes = [A.shape for A in function(w)]

    def all_of_them(at):
        return np.concatenate([A.ravel() for A in function(Operators(w.oracle, at, 0 * qd))])

    ends = np.cumsum([np.prod(shape) for shape in shapes])[:-1]
    parts = np.split(w.oracle.derivative(all_of_them, q, qd), ends)
    return [part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)]


def test_table_3(revolute):
    """Table 3, (6.1), (6.2), (6.4)–(6.6): rates of H*, M, P, D, G, τ̄ in inertial axes, by differences of each.

    Inertial = local + Ω x: (H*)' = ΩH*, M' = ΩM − MΩ, P' = ψλ̇ψ* + ΩP − PΩ, D' = HP'H*, G' = τ̄P'H*D⁻¹ + ΩG,
    τ̄' = −G'H + Ωτ̄ − τ̄Ω; (6.5) λ̇ = P' + Ω_δP − PΩ_δ, so that P' = λ̇ + ΩP − PΩ with the inboard body's Ω (6.6).
    """
    for c in revolute:
        w, qd = c.w, c.t.qd
        rates = rates_of(w, c.t.q, qd, lambda at: [getattr(at, name) for name in MOVING])
        rate = dict(zip(MOVING, rates, strict=True))
        turning = norm(qd)
        inverse = np.linalg.inv(w.D)
        G_rate = w.tau_bar @ w.P_rate @ w.H.T @ inverse

        def commutator(A, Omega=w.Omega):
            return Omega @ A - A @ Omega

        inboard = w.Omega - w.delta
        for actual, expected, size in (
            (rate["H"].T, w.Omega @ w.H.T, w.H),
            (rate["M"], commutator(w.M), w.M),
            (rate["P"], w.P_rate + commutator(w.P), w.P),
            (rate["P"], w.rate + commutator(w.P, inboard), w.P),
            (rate["D"], w.H @ w.P_rate @ w.H.T, w.D),
            (rate["G"], G_rate + w.Omega @ w.G, w.G),
            (rate["tau_bar"], -G_rate @ w.H + commutator(w.tau_bar), w.tau_bar),
        ):
            assert_close(actual, expected, 1e-10, turning * norm(size))
        assert_close(w.rate, w.P_rate + w.turn @ w.P - w.P @ w.delta, 1e-13, turning * norm(w.P))
        assert_close(w.delta, w.turn, 1e-15)
        seen = w.E_phi.T @ w.V
        turning_inboard = stacked(
            [np.kron(np.eye(2), tilde(seen[w.at(k)][:3])) for k in range(w.n)]
        )
        assert_close(inboard, turning_inboard, 1e-14, norm(w.Omega))


def test_rate_of_d(c):
    """(6.5) and Table 3: D' = HP'H* = Hλ̇H*, the library's rate of the articulated inertia."""
    w = c.w
    for rate in (w.P_rate, w.rate):
        expected = w.mine(np.diag(w.H @ rate @ w.H.T))
        scale = max(norm(expected / c.f.D), 1e-2 * norm(c.t.qd))
        assert_close(c.s.articulated_inertia_rate / c.f.D, expected / c.f.D, c.tolerance, scale)


def test_rate_of_m(c):
    """(A.30): m' = Hφ[Ω_δ φ~ P + (1 − τ/2)λ̇]H*D^−½ with φ~ = φ − 1, without armature: the library's ṁᵀx."""
    if c.has_armature:
        return
    w, unit = c.w, c.unit
    tau = w.G @ w.H
    inner = w.turn @ (w.phi - w.one) @ w.P + (w.one - 0.5 * tau) @ w.rate
    expected = w.mine(w.H @ w.phi @ inner @ w.H.T @ np.linalg.inv(w.root)) / unit[:, None]
    actual = (
        np.array([c.dyn.m_rate_transposed_times(c.t.q, c.t.qd, e) for e in np.eye(w.n)])
        / unit[:, None]
    )
    assert_close(actual, expected, c.tolerance, max(norm(expected), 1e-2 * norm(c.t.qd)))


def test_identity_6_3(c):
    """Identity 6.3, Lemma A.2, (A.13): ∂M/∂θ_i = Hφ[H_δφM − Mφ*H_δ]φ*H*, the library's rate of M by a unit rate."""
    w = c.w
    largest = norm(scaled(c, c.t.M))
    left, right = w.H @ w.phi, w.phi @ w.M @ w.phi.T @ w.H.T
    for k, e in enumerate(np.eye(w.n)):
        own, _ = w.sensitivity(w.body(k))
        half = (
            -left @ own.T @ right
        )  # H_δ for −H_δ*, see `Operators`; the other half is its transpose
        expected = scaled(c, w.mine(half + half.T))
        actual = scaled(c, c.dyn.mass_matrix_rate(c.t.q, e))
        assert_close(actual, expected, 1e-12, norm(expected) + largest)


def partials(c: Case) -> np.ndarray:
    """Return ∂M/∂q of the library, [i, j, k] = ∂M_jk/∂q_i."""
    return np.array([c.dyn.mass_matrix_rate(c.t.q, e) for e in np.eye(c.w.n)])


def test_quadratic_form_of_partial_derivatives(c):
    """(6.13): θ'*M_θθ' = 2HV~*φMV, entry i being θ'*(∂M/∂θ_i)θ'."""
    w, unit = c.w, c.unit
    expected = w.mine(2 * w.H @ w.V_cross.T @ w.phi @ w.M @ w.V)
    actual = np.einsum("j,ijk,k->i", c.t.qd, partials(c), c.t.qd)
    scale = norm(actual / unit) + norm(c.t.qd) * norm(c.t.nu)
    assert_close(actual / unit, expected / unit, c.tolerance, scale)


# --- Sections 2, 3 and 7: equations of motion


def test_lagrange_equations(c):
    """(2.1): C(θ, θ') = M'θ' − ½ θ'*M_θθ' and Mθ'' + C = T, gravity aside; C is coriolis_torque."""
    unit = c.unit
    first = c.dyn.mass_matrix_rate_times(c.t.q, c.t.qd, c.t.qd)
    second = 0.5 * np.einsum("j,ijk,k->i", c.t.qd, partials(c), c.t.qd)
    scale = norm(first / unit) + norm(second / unit) + norm(c.t.qd) * norm(c.t.nu)
    for bias in (c.dyn.coriolis_torque(c.t.q, c.t.qd), c.t.c):
        assert_close((first - second) / unit, bias / unit, c.tolerance, scale)
    weight, qdd = c.dyn.gravity_torque(c.t.q), c.sample.qdd
    T = c.dyn.mass_matrix(c.t.q) @ qdd + first - second + weight
    expected = c.t.oracle.inverse_dynamics(c.t.q, c.t.qd, qdd)
    assert_close(
        T / unit, expected / unit, c.tolerance, norm(expected / unit) + norm(weight / unit) + scale
    )


def test_lemma_3_1(c):
    """Lemma 3.1, (3.2): C = ℓ(m'ν − ½ θ'*M_θθ') with θ' = ℓ*ν, from the library's m' and ∂M/∂θ."""
    rate = np.array([c.dyn.m_rate_transposed_times(c.t.q, c.t.qd, e) for e in np.eye(c.w.n)])  # m'
    half = 0.5 * np.einsum("j,ijk,k->i", c.t.qd, partials(c), c.t.qd)
    parts = c.dyn.epsilon_from_tau(c.t.q, rate @ c.s.nu), c.dyn.epsilon_from_tau(c.t.q, half)
    scale = c.t.coriolis_scale + sum(map(norm, parts))
    assert_close(c.s.coriolis, parts[0] - parts[1], c.tolerance, scale)
    assert_close(c.t.coriolis, parts[0] - parts[1], c.tolerance, scale)


def brace(w: Operators, V_part: np.ndarray) -> np.ndarray:
    """Return {E_ψλ̇ − λ̇E_ψ* − Ω_δP − PΩ_δ − 2V~*M} of Identity 7.1, its last term given."""
    return w.E_psi @ w.rate - w.rate @ w.E_psi.T - w.turn @ w.P - w.P @ w.delta - V_part


def test_identity_7_1(c):
    """Identity 7.1: C = ½D^−½Hψ{E_ψλ̇ − λ̇E_ψ* − Ω_δP − PΩ_δ − 2V~*M}V."""
    w = c.w
    C = 0.5 * np.linalg.inv(w.root) @ w.H @ w.psi @ brace(w, 2 * w.V_cross.T @ w.M) @ w.V
    assert_close(c.s.coriolis, w.mine(C), c.tolerance, c.t.coriolis_scale)


def test_lemma_7_1_by_the_skew_brace(c):
    """Lemma 7.1: with 2(V~*M − MV~) for 2V~*M, as V~V = 0, the brace is skew, so ν*C = 0."""
    w = c.w
    skew = brace(w, 2 * (w.V_cross.T @ w.M - w.M @ w.V_cross))
    size = norm(w.P) * norm(w.V)
    assert_close(skew, -skew.T, 1e-13, size)
    assert_close(w.V_cross @ w.V, np.zeros_like(w.V), 1e-14, norm(w.V) ** 2)
    C = w.mine(0.5 * np.linalg.inv(w.root) @ w.H @ w.psi @ skew @ w.V)
    assert_close(c.s.coriolis, C, c.tolerance, c.t.coriolis_scale)
    # ν*D^−½Hψ = V*, so that ν*C = ½ V*{skew}V
    assert_close(
        w.psi.T @ w.H.T @ np.linalg.solve(w.root, w.oracle.to_pin(c.s.nu)), w.V, c.tolerance
    )
    assert_close(c.s.nu @ c.s.coriolis, 0.0, 1e-12, norm(c.s.nu) * c.t.coriolis_scale)


def test_algorithm_7_1(c):
    """Algorithm 7.1, (7.2), body by body as printed: C(k) = ½ D^−½ H y(k)."""
    w = c.w
    y, C = np.zeros((w.n, 6)), np.zeros(w.n)
    V = w.V.reshape(w.n, 6)
    for k in reversed(range(w.n)):
        at, own = w.at(k), cross(V[k])
        X = w.turn[at, at] @ w.P[at, at]
        parent = w.parents[k]
        V_plus = w.E_phi[w.at(parent), at].T @ V[parent] if parent >= 0 else np.zeros(6)
        y[k] -= (2 * own.T @ w.M[at, at] + X - X.T) @ V[k] + w.rate[at, at] @ w.tau_bar[
            at, at
        ].T @ V_plus
        for child in w.children(k):
            psi = w.E_psi[at, w.at(child)]
            y[k] += psi @ (y[child] + w.block(w.rate, child) @ V[child])
        C[k] = 0.5 * w.H[k, at] @ y[k] / w.root[k, k]
    assert_close(c.s.coriolis, w.mine(C), c.tolerance, c.t.coriolis_scale)


def unnormalized_scale(c: Case) -> float:
    """Return the size of the terms of D^−½C_ξ."""
    return c.t.coriolis_scale + norm(c.t.Ddot * c.t.xi / np.sqrt(c.t.D))


def test_lemma_7_3(c):
    """Lemma 7.3, (7.9): C_ξ = Hψ[λ̇H*ξ − (Ω_δP + V~*M)V] and κ = [1 − HψK]T; ξ*C_ξ = ½ξ*D'ξ."""
    w, root = c.w, np.sqrt(c.f.D)
    xi = w.oracle.to_pin(c.s.xi)
    C = w.mine(w.H @ w.psi @ (w.rate @ w.H.T @ xi - (w.turn @ w.P + w.V_cross.T @ w.M) @ w.V))
    scale = unnormalized_scale(c)
    assert_close(c.s.coriolis_unnormalized / root, C / root, c.tolerance, scale)
    kappa = w.mine(w.inverse @ w.oracle.to_pin(c.t.tau))
    assert_close(c.s.kappa / root, kappa / root, c.tolerance)
    work = 0.5 * c.s.xi @ w.mine(np.diag(w.H @ w.rate @ w.H.T) * xi)
    assert_close(c.s.xi @ c.s.coriolis_unnormalized, work, c.tolerance, norm(c.s.nu) * scale)


def test_recursion_7_10(c):
    """(7.10), body by body as printed: y(k) = ψy(k−1) + λ̇H*ξ − [V~*M + X]V, C_ξ(k) = Hy(k)."""
    w, root = c.w, np.sqrt(c.f.D)
    xi, V = w.oracle.to_pin(c.s.xi), w.V.reshape(w.n, 6)
    y = np.zeros((w.n, 6))
    for k in reversed(range(w.n)):
        at = w.at(k)
        X = w.turn[at, at] @ w.P[at, at]
        y[k] += w.rate[at, at] @ w.H[k, at] * xi[k] - (cross(V[k]).T @ w.M[at, at] + X) @ V[k]
        for child in w.children(k):
            y[k] += w.E_psi[at, w.at(child)] @ y[child]
    C = w.mine(np.array([w.H[k, w.at(k)] @ y[k] for k in range(w.n)]))
    assert_close(c.s.coriolis_unnormalized / root, C / root, c.tolerance, unnormalized_scale(c))


def test_algorithm_8_1(c):
    """Algorithm 8.1, (8.1), (8.2): ξ' = D⁻¹[T − Hψζ], ζ = KT + λ̇H*ξ − (Ω_δP + V~*M)V, gravity taken from T."""
    w, root = c.w, np.sqrt(c.f.D)
    T = w.oracle.to_pin(c.t.tau - c.t.g)
    xi = w.oracle.to_pin(c.s.xi)
    zeta = w.K @ T + w.rate @ w.H.T @ xi - (w.turn @ w.P + w.V_cross.T @ w.M) @ w.V
    rate = w.mine(np.linalg.solve(w.D, T - w.H @ w.psi @ zeta))
    s = c.s
    terms = s.kappa / root, s.gravity, s.coriolis_unnormalized / root
    actual = terms[0] - terms[1] - terms[2]  # D^½ξ'
    scale = sum(map(norm, terms)) + unnormalized_scale(c)
    assert_close(actual, root * rate, c.tolerance, scale)
    # and Pinocchio's aba moves ξ like that: ξ = D^−½ν
    expected = c.t.nu_dot - 0.5 * c.t.Ddot / c.t.D * c.t.nu
    assert_close(actual, expected, c.tolerance, scale)


# --- Appendix A: sensitivities, by differences


def test_appendix_a(revolute):
    """(A.4), (A.11), (A.12), (A.16)–(A.18): rates of H*, φ, φMφ* and P with θ_i alone, in inertial axes.

    (A.4) ∂H*(k) = H~(i)H*(k) outboard of i, else 0; (A.11) φ~ = E_φφ = φ − 1; (A.12) ∂(φMφ*) = φ[H_δφM − Mφ*H_δ]φ*
    + H_<φMφ* − φMφ*H_<; (A.17) λ_i = E_ψλ_iE_ψ* + H_δP − PH_δ, on the diagonal; (A.18) ∂P = λ_i + H_<P − PH_<.
    """
    for c in revolute[:1]:
        w, q = c.w, c.t.q
        assert_close(w.E_phi @ w.phi, w.phi - w.one, 1e-13)
        product = w.phi @ w.M @ w.phi.T
        for k, e in some_of(enumerate(np.eye(w.n)), 1 if w.n < 10 else 4):
            i = w.body(k)
            own, outboard = w.sensitivity(i)

            partial = rates_of(w, q, e, lambda at: [at.H.T, at.phi, at.phi @ at.M @ at.phi.T, at.P])
            change = w.partial_rate(i)
            source = own @ w.P - w.P @ own
            assert_close(
                change, w.diagonal(w.E_psi @ change @ w.E_psi.T) + source, 1e-13, norm(w.P)
            )
            expected = (
                outboard @ w.H.T,
                outboard @ w.phi - w.phi @ outboard + w.phi @ own @ (w.phi - w.one),
                w.phi @ (own @ w.phi @ w.M - w.M @ w.phi.T @ own) @ w.phi.T
                + outboard @ product
                - product @ outboard,
                change + outboard @ w.P - w.P @ outboard,
            )
            for actual, exact, size in zip(
                partial, expected, (w.H, w.phi, product, w.P), strict=True
            ):
                assert_close(actual, exact, 1e-10, norm(size))


def test_rate_of_p_sums_its_sensitivities(c):
    """(A.24): λ̇ = Σ λ_i θ'_i; and ∂D_k/∂θ_i = Hλ_iH* is the library's rate of D by a unit rate."""
    w = c.w
    parts = [w.partial_rate(i) for i in range(w.n)]
    total = sum(rate * part for rate, part in zip(w.rates, parts, strict=True))
    assert_close(total, w.rate, 1e-13, norm(w.P) * norm(w.V))
    for k, e in enumerate(np.eye(w.n)):
        expected = w.mine(np.diag(w.H @ parts[w.body(k)] @ w.H.T)) / c.f.D
        actual = c.dyn.evaluate(c.t.q, e).articulated_inertia_rate / c.f.D
        assert_close(actual, expected, c.tolerance, norm(expected) + 1e-2)


# --- Appendix B: operator identities


def test_appendix_b(c):
    """Appendix B: (1 − HψK)Hφ = Hψ, φK(1 − HψK) = ψK, E_φ*V~ = V⁺~E_φ*; without armature Hτ̄ = 0 and ψMV = PV."""
    w = c.w
    assert_close(
        w.inverse @ w.H @ w.phi, w.H @ w.psi, c.tolerance, norm(w.inverse) * norm(w.H @ w.phi)
    )
    assert_close(
        w.phi @ w.K @ w.inverse, w.psi @ w.K, c.tolerance, norm(w.inverse) * norm(w.phi @ w.K)
    )
    V_plus = w.E_phi.T @ w.V
    seen = stacked([cross(V_plus[w.at(k)]) for k in range(w.n)])
    assert_close(w.E_phi.T @ w.V_cross, seen @ w.E_phi.T, 1e-13, norm(w.V_cross) * norm(w.E_phi))
    if not c.has_armature:
        assert_close(w.H @ w.tau_bar, np.zeros_like(w.H), 1e-12, norm(w.tau_bar))
        assert_close(w.psi @ w.M @ w.V, w.P @ w.V, c.tolerance, norm(w.psi) * norm(w.M @ w.V))


# --- Section 2: when ν is a derivative


def curl(dyn, q) -> np.ndarray:
    """Return ∂(mᵀ)_kj/∂q_i − ∂(mᵀ)_ki/∂q_j, [k, i, j]: 0 if the rows of mᵀ are gradients."""
    e = np.eye(len(q))
    rate = np.array([[dyn.m_rate_transposed_times(q, a, b) for b in e] for a in e])  # [i, j, k]
    return (rate - rate.transpose(1, 0, 2)).transpose(2, 0, 1)


@pytest.mark.parametrize("id", [UR5, PANDA])
def test_total_rates_are_no_derivatives(id):
    """Assumption 2.1, (2.2) fails for a generic robot: mᵀ is the gradient of no transformation, ν of no coordinates."""
    robot = robots.robot(id)
    dyn = dd.DiagonalDynamics(dd.load_urdf(robot.source, mimic="free"))
    oracle = RateOracle(robot.urdf, dyn.model.dof_names)
    q = robots.samples(id, oracle)[0].q
    actual, e = curl(dyn, q), np.eye(len(q))
    assert norm(actual) > 0.1 * norm(dyn.factors(q).m)
    expected = np.array([oracle.at(q, a).mdot for a in e])  # [i, j, k]: ∂m_jk/∂q_i
    expected = (expected - expected.transpose(1, 0, 2)).transpose(2, 0, 1)
    assert_close(actual, expected, tolerance(oracle.at(q, e[0])))


def test_lemma_2_1():
    """Lemma 2.1, (2.4): where mᵀ is a gradient, as that of a gantry, f = mᵀq has f'' = ε and no Coriolis term."""
    dyn = dd.DiagonalDynamics(dd.load_urdf(robots.GANTRY))
    q, qd, tau, other = np.random.default_rng(1).standard_normal((4, 3))
    assert (curl(dyn, q) == 0).all()
    m = dyn.factors(q).m
    assert_close(dyn.factors(other).m, m, 1e-15)  # so that f = mᵀq has f' = mᵀq' = ν
    s = dyn.evaluate(q, qd, tau)
    acceleration = m.T @ dyn.forward_dynamics(q, qd, tau)
    assert_close(acceleration, s.epsilon - s.gravity, 1e-13, norm(s.epsilon) + norm(s.gravity))
    assert norm(s.coriolis) <= 10 * EPS * norm(s.nu) * norm(qd)


def christoffel(dyn, q) -> np.ndarray:
    """Return Γ^l_jk of the metric M, [l, j, k], from the library's ∂M/∂q."""
    d = np.array([dyn.mass_matrix_rate(q, e) for e in np.eye(len(q))])  # [i, j, k]
    first = 0.5 * (
        d.transpose(2, 0, 1) + d.transpose(2, 1, 0) - d
    )  # [l, j, k]: ½(∂_j M_lk + ∂_k M_lj − ∂_l M_jk)
    return np.einsum("al,ljk->ajk", np.linalg.inv(dyn.mass_matrix(q)), first)


def curvature(dyn, q) -> np.ndarray:
    """Return the Riemann tensor R_lkij of the metric M, derivatives of Γ by fourth-order differences."""
    h, G = 1e-3, christoffel(dyn, q)

    def derivative(e):
        f = [christoffel(dyn, q + x * h * e) for x in (-2, -1, 1, 2)]
        return (8 * (f[2] - f[1]) - (f[3] - f[0])) / (12 * h)

    d = np.array([derivative(e) for e in np.eye(len(q))])  # [i, l, j, k] = ∂_i Γ^l_jk
    R = d.transpose(1, 3, 0, 2) - d.transpose(1, 3, 2, 0)  # ∂_i Γ^l_jk − ∂_j Γ^l_ik as [l, k, i, j]
    R = R + np.einsum("lim,mjk->lkij", G, G) - np.einsum("ljm,mik->lkij", G, G)
    return np.einsum("ml,lkij->mkij", dyn.mass_matrix(q), R)


@pytest.mark.parametrize("seed", range(3))
def test_lemma_2_2_an_arm_is_curved(seed):
    """Lemma 2.2: the two-link arm's metric has curvature β cos q₂ (αγ − β²)/(det M)², so no factor of M is a gradient."""
    arm = robots.TwoLinkArm(*np.random.default_rng(seed).uniform(0.2, 2, 7))
    alpha, beta, gamma = arm._constants
    dyn = dd.DiagonalDynamics(dd.load_urdf(arm.urdf))
    q = np.random.default_rng(seed + 10).uniform(-3, 3, 2)
    R = curvature(dyn, q)
    det = np.linalg.det(arm.mass_matrix(q))
    expected = beta * np.cos(q[1]) * (alpha * gamma - beta**2) / det**2
    assert R[0, 1, 0, 1] / det == pytest.approx(expected, rel=1e-6, abs=1e-8)
    assert abs(expected) > 1e-3
    assert norm(curl(dyn, q)) > 1e-3


POLAR = description(
    "polar_manipulator",
    link("base"),
    link("arm"),
    link("hand", 1.7),
    joint("turn", "revolute", "base", "arm"),
    joint("reach", "prismatic", "arm", "hand", axis=(1, 0, 0)),
)


def test_lemma_2_2_flat_metrics():
    """Lemma 2.2: a gantry, and a point mass in polar coordinates, are flat; there a transformation f with |f'| = |ν|.

    That of the point mass is √m times its Cartesian position: it belongs to a rotated factor of M, while the rows of the
    innovations factor mᵀ are no gradients even there (√m r θ').
    """
    gantry = dd.DiagonalDynamics(dd.load_urdf(robots.GANTRY))
    assert norm(curvature(gantry, np.array([0.1, 0.2, 0.3]))) == 0
    polar = dd.DiagonalDynamics(dd.load_urdf(POLAR))
    q, qd, tau = np.array([0.4, 0.8]), np.array([1.3, -0.6]), np.array([0.3, 0.9])
    assert_close(polar.mass_matrix(q), np.diag([1.7 * 0.8**2, 1.7]), 1e-14)
    assert_close(curvature(polar, q), np.zeros((2, 2, 2, 2)), 1e-8, 1.7)
    assert norm(curl(polar, q)) > 1
    (c, s), (r, v) = (np.cos(q[0]), np.sin(q[0])), (q[1], qd[1])
    rotation = np.array([[-s, c], [c, s]])
    velocity = rotation @ [r * qd[0], v]
    e = polar.evaluate(q, qd, tau)
    assert_close(np.sqrt(1.7) * velocity, rotation @ e.nu, 1e-14)
    qdd = polar.forward_dynamics(q, qd, tau)
    acceleration = rotation @ [r * qdd[0] + 2 * v * qd[0], qdd[1] - r * qd[0] ** 2]
    assert_close(
        np.sqrt(1.7) * acceleration, rotation @ (e.epsilon - e.gravity), 1e-13
    )  # f'' = ε, in f's axes
    assert norm(e.coriolis) > 0.1


# --- Sections 3 and 7 along motions


DURATION, STEPS = 0.1, (20, 40, 80)


def gripper() -> str:
    """Return a gripper of one coordinate: two fingers and their tips, three joints following one."""
    elements = [link("palm", 0.5, (0, 0, 0.02), (1e-3, 0, 0, 1e-3, 0, 1e-3))]
    mimics = {"left_tip": -0.8, "right": -1.0, "right_tip": 0.8}
    for name, parent, y in (
        ("left", "palm", 0.03),
        ("right", "palm", -0.03),
        ("left_tip", "left_link", 0),
        ("right_tip", "right_link", 0),
    ):
        text = joint(
            name,
            "revolute",
            parent,
            f"{name}_link",
            (1, 0, 0),
            (0, y, 0.05),
            (0.2 * np.sign(y), 0, 0),
        )
        if name in mimics:
            mimic = f'<mimic joint="left" multiplier="{mimics[name]}" offset="0.1"/>'
            text = text.replace("</joint>", f"{mimic}</joint>")
        elements += [
            text,
            link(f"{name}_link", 0.08, (0.001, 0.002, 0.025), (3e-5, 0, 0, 2e-5, 0, 1.5e-5)),
        ]
    return description("gripper", *elements)


def runge_kutta(rate, x, h, steps):
    """Return [(t, x)] at the ends of steps of the classical method of fourth order."""
    out = [(0.0, x)]
    for i in range(steps):
        t = i * h
        k1 = rate(t, x)
        k2 = rate(t + h / 2, x + h / 2 * k1)
        k3 = rate(t + h / 2, x + h / 2 * k2)
        k4 = rate(t + h, x + h * k3)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        out.append((t + h, x))
    return out


class Mover:
    """A robot driven by Pinocchio: efforts that vary with time, gravity, friction, wrenches in the world's axes.

    A quaternion is integrated as four coordinates.
    """

    def __init__(self, robot: robots.Robot):
        """Draw a start, efforts and wrenches, and load it with friction in the joints that follow no other."""
        options = {"mimic": robot.mimic, **robot.options}
        plain = dd.load_urdf(robot.source, **options)
        names, nv, rng = plain.dof_names, plain.nv, np.random.default_rng(4)
        oracle = self.oracle = rate_oracle_of(robot, names)
        self.floating = robot.floating_base
        slides = np.array([oracle.is_prismatic(k) for k in range(nv)])
        self.qd = rng.choice([-1, 1], nv) * rng.uniform(0.6, 1.2, nv) * np.where(slides, 0.3, 1.0)
        self.q = oracle.moved(oracle.neutral, 0.5 * rng.uniform(-1, 1, nv) * ~slides)
        state, wrench = oracle.at(self.q, self.qd), rng.standard_normal(6)
        moment = oracle.effort_of(self.q, {plain.link_names[-1]: wrench}, "world")
        self.wrenches = {
            plain.link_names[-1]: 3.0
            * norm(state.nu)
            / norm(np.linalg.solve(state.m, moment))
            * wrench
        }
        single = np.array(["/" not in name for name in names])
        self.damping = (
            single * state.D * rng.uniform(0.5, 2.0, nv)
        )  # [1/s] of the articulated inertia
        # efforts that hold the velocity of the start, and a swing about them
        self.held = (
            state.c
            + state.g
            + self.damping * self.qd
            - oracle.effort_of(self.q, self.wrenches, "world")
        )
        self.swing = state.m @ (3.0 * state.nu * rng.standard_normal(nv))
        # Coulomb friction jumps where a joint turns round: it is given, and compensated, where none does
        self.coulomb = np.zeros(nv)
        speeds = np.array([qd for _, _, qd in self.motion(DURATION, STEPS[0])]) / self.qd
        keeps_on = single & (speeds.min(axis=0) > 0.2)
        self.coulomb = keeps_on * state.D * rng.uniform(0.5, 2.0, nv)
        self.held = self.held + self.coulomb * np.sign(self.qd)
        assert keeps_on.any()
        xml = ET.fromstring(robot.urdf)
        for element in xml.findall("joint"):
            for old in element.findall("dynamics"):
                element.remove(old)
            if element.get("name") in names:
                k = names.index(element.get("name"))
                values = {
                    "damping": repr(float(self.damping[k])),
                    "friction": repr(float(self.coulomb[k])),
                }
                ET.SubElement(element, "dynamics", values)
        model = dd.load_urdf(ET.tostring(xml, encoding="unicode"), **options)
        assert model.dof_names == names
        self.dyn = dd.DiagonalDynamics(model)

    def friction(self, qd):
        """Return what resists the motion."""
        return self.damping * qd + self.coulomb * np.tanh(qd / 5e-3)

    def effort(self, t):
        """Return the joints' efforts at a time."""
        return self.held + self.swing * np.cos(7 * t)

    def rates(self, t, q, qd):
        """Return the rates of coordinates, and the accelerations of Pinocchio."""
        rate = np.zeros_like(q)
        if self.floating:
            q = q.copy()
            q[3:7] /= norm(q[3:7])
            turn = pin.Quaternion(q[3:7])
            rate[:3] = turn.matrix() @ qd[:3]
            rate[3:7] = 0.5 * (turn * pin.Quaternion(np.append(qd[3:6], 0.0))).coeffs()
            rate[7:] = qd[6:]
        else:
            rate[:] = qd
        tau = self.effort(t) - self.friction(qd) + self.oracle.effort_of(q, self.wrenches, "world")
        return rate, self.oracle.forward_dynamics(q, qd, tau)

    def motion(self, duration: float, steps: int) -> list:
        """Return (t, q, q̇) at the ends of the steps."""
        nq = len(self.q)

        def rate(t, x):
            return np.concatenate(self.rates(t, x[:nq], x[nq:]))

        states = runge_kutta(rate, np.r_[self.q, self.qd], duration / steps, steps)
        return [(t, x[:nq], x[nq:]) for t, x in states]

    def evaluate(self, t, q, qd):
        """Return the library's evaluation, with all terms."""
        return self.dyn.evaluate(q, qd, self.effort(t), self.wrenches, frame="world", friction=True)


def simpson(values: list, duration: float):
    """Return the integral over an even number of equal steps."""
    weights = np.ones(len(values))
    weights[1:-1:2], weights[2:-1:2] = 4, 2
    return duration / (len(values) - 1) / 3 * np.tensordot(weights, np.array(values), 1)


GRIPPER = robots.Robot("gripper", gripper(), mimic="embed")
MOVERS = {"arm": robots.robot(PANDA), "humanoid": robots.robot(TALOS).floating, "gripper": GRIPPER}


@pytest.fixture(scope="module", params=MOVERS)
def moved(request):
    """Return a robot, and its evaluations along one motion with three sizes of steps."""
    mover = Mover(MOVERS[request.param])
    motions = [mover.motion(DURATION, steps) for steps in STEPS]
    slid = np.sign([qd for _, _, qd in motions[-1]])[:, mover.coulomb > 0]
    assert (slid == slid[0]).all(), "Coulomb friction is smooth only while no joint turns round"
    return mover, [[mover.evaluate(*state) for state in motion] for motion in motions], motions


def orders(residuals) -> np.ndarray:
    """Return the observed orders of convergence."""
    residuals = np.asarray(residuals)
    return np.log2(residuals[:-1] / residuals[1:])


def assert_fourth_order(residuals, size):
    """Halving the step takes the residual down by about 2⁴, until rounding is all there is."""
    rounding = 1e-12 * size
    seen = [(a, b) for a, b in pairwise(residuals) if b > rounding]
    assert all(np.log2(a / b) > 3.4 for a, b in seen), residuals
    assert residuals[-1] < 1e-6 * size, residuals


def test_lemma_7_2_along_a_trajectory(moved):
    """Lemma 7.2, (7.6): K(t₁) − K(t₀) = ∫ν*(ε − ε_g + ℓJ*f − ε_fric)dt, with a residual that falls as h⁴."""
    mover, runs, motions = moved
    residuals = []
    for evaluations, motion in zip(runs, motions, strict=True):
        gained = evaluations[-1].kinetic_energy - evaluations[0].kinetic_energy
        residuals.append(abs(gained - simpson([s.power for s in evaluations], DURATION)))
        for s, (_, q, qd) in list(zip(evaluations, motion, strict=True))[:: len(motion) - 1]:
            M = mover.oracle.mass_matrix(
                np.r_[q[:3], q[3:7] / norm(q[3:7]), q[7:]] if len(q) > len(qd) else q
            )
            assert_close(s.kinetic_energy, 0.5 * qd @ M @ qd, 1e-12)
    size = simpson([abs(s.power) for s in runs[-1]], DURATION)
    parts = [simpson([abs(s.nu @ part(s)) for s in runs[-1]], DURATION) for part in PARTS]
    assert min(parts) > 1e-4 * size, "every term counts"
    assert_fourth_order(residuals, sum(parts))


PARTS = (lambda s: s.epsilon, lambda s: s.gravity, lambda s: s.external, lambda s: s.friction)


def test_nu_along_a_trajectory(moved):
    """(1.1), (3.1): ν(t₁) − ν(t₀) = ∫(ε − C − ε_g + ℓJ*f − ε_fric)dt, component by component, to fourth order."""
    _, runs, _ = moved
    residuals = [norm(r[-1].nu - r[0].nu - simpson([s.nu_dot for s in r], DURATION)) for r in runs]
    terms = sum(
        simpson([norm(part(s)) for s in runs[-1]], DURATION)
        for part in (*PARTS, lambda s: s.coriolis)
    )
    assert_fourth_order(residuals, terms)


def test_xi_along_a_trajectory(moved):
    """(7.9): ξ(t₁) − ξ(t₀) = ∫D⁻¹(κ − κ_g − C_ξ + D^½(ℓJ*f − ε_fric))dt, to fourth order."""
    _, runs, _ = moved

    def rate(s):
        root = np.sqrt(s.articulated_inertia)
        return (s.kappa - s.coriolis_unnormalized) / root**2 + (
            s.external - s.gravity - s.friction
        ) / root

    residuals = [norm(r[-1].xi - r[0].xi - simpson([rate(s) for s in r], DURATION)) for r in runs]
    assert_fourth_order(
        residuals, simpson([norm(s.kappa / s.articulated_inertia) for s in runs[-1]], DURATION)
    )


def test_energy_flows_between_joints(moved):
    """Lemma 7.1, 7.2: each share ½ν_k² changes by ∫ν_k(ε_k − C_k − …)dt; what C moves out of one it moves into others."""
    _, runs, _ = moved
    shares = [r[-1].energy_share - r[0].energy_share for r in runs]
    flows = [simpson([s.nu * s.nu_dot for s in r], DURATION) for r in runs]
    size = simpson([norm(s.nu) * sum(norm(part(s)) for part in PARTS) for s in runs[-1]], DURATION)
    assert_fourth_order([norm(a - b) for a, b in zip(shares, flows, strict=True)], size)
    for s in runs[-1]:
        assert_close(
            (s.nu * s.coriolis).sum(),
            0.0,
            1e-12,
            norm(s.nu) * (norm(s.coriolis) + norm(s.nu) * 1.0),
        )


def test_one_coordinate_has_no_coriolis_term():
    """Lemma 7.1 for one coordinate, however many joints follow it: νC = 0, so C = 0 though M changes with q."""
    mover = Mover(GRIPPER)
    assert mover.dyn.model.nv == 1 and mover.oracle.full.nv > 1
    s = mover.dyn.evaluate(mover.q, mover.qd)
    half = 0.5 * s.articulated_inertia_rate * s.xi
    assert abs(half[0]) > 1e-3 * abs(s.nu[0] * mover.qd[0] * np.sqrt(s.articulated_inertia[0]))
    assert_close(s.coriolis, np.zeros(1), 1e-12, norm(half) / np.sqrt(s.articulated_inertia[0]))
    assert_close(s.coriolis_unnormalized, half, 1e-12)


def test_algorithm_8_1_integrates():
    """Algorithm 8.1: ξ integrated, θ' = ξ − G*V⁺ integrated, meets Pinocchio's aba; the error falls as h⁴."""
    mover = Mover(robots.robot(UR5))

    def rate(t, x):
        q, xi = x[:6], x[6:]
        root = np.sqrt(mover.dyn.factors(q).D)
        qd = mover.dyn.qd_from_nu(q, root * xi)
        s = mover.evaluate(t, q, qd)
        total = s.kappa - s.coriolis_unnormalized + root * (s.external - s.gravity - s.friction)
        return np.r_[qd, total / s.articulated_inertia]

    def end(steps):
        start = np.r_[mover.q, mover.dyn.evaluate(mover.q, mover.qd).xi]
        t, x = runge_kutta(rate, start, DURATION / steps, steps)[-1]
        return np.r_[x[:6], rate(t, x)[:6]]

    _, q, qd = mover.motion(DURATION, 640)[-1]
    errors = [norm(end(steps) - np.r_[q, qd]) for steps in STEPS]
    assert (orders(errors) > 3.7).all(), errors
    assert errors[-1] < 1e-6 * norm(qd)


# --- Section 8: control


@pytest.mark.parametrize("sign", [1, -1], ids=["as it must be", "as printed"])
def test_control_8_2(sign):
    """Control 8.2: ε = −c₁ν + ℓJ*C₂e takes ½|ν|² + ½e*C₂e down at ν*c₁ν; the printed sign (−) does not.

    e = Y_d − Y, Y the position of the hand and the three axes of its frame; ℓJ*C₂e is one wrench on the hand.
    """
    robot, hand = robots.robot(UR5), "ee_link"
    dyn = dd.DiagonalDynamics(dd.load_urdf(robot.source))
    oracle, rng = RateOracle(robot.urdf, dyn.model.dof_names), np.random.default_rng(6)
    q, qd, q_d = rng.uniform(-1, 1, (3, dyn.model.nv))
    c_1, c_2 = rng.uniform(0.5, 2, dyn.model.nv), rng.uniform(0.5, 2, 12)

    def pose(q):
        X = link_placement(oracle, q, hand)
        return np.concatenate([X.translation, *X.rotation.T])

    Y, Y_d = pose(q), pose(q_d)
    force = c_2 * (Y_d - Y)
    moment = sum(np.cross(Y[k : k + 3], force[k : k + 3]) for k in (3, 6, 9))
    pull = dyn.epsilon_from_wrench(q, hand, np.r_[force[:3], moment], frame="world")
    # J*C₂e is that wrench's effort: the gradient of ½e*C₂e with its sign turned
    J = np.column_stack([oracle.derivative(pose, q, e) for e in np.eye(len(q))])
    assert_close(pull, dyn.epsilon_from_tau(q, J.T @ force), 1e-10)

    def lyapunov(x):
        at, rate = q + x * h * qd + 0.5 * (x * h) ** 2 * qdd, qd + x * h * qdd
        e = Y_d - pose(at)
        return 0.5 * rate @ oracle.mass_matrix(at) @ rate + 0.5 * e @ (c_2 * e)

    s, h = dyn.evaluate(q, qd), 1e-3
    qdd = oracle.forward_dynamics(
        q, qd, dyn.tau_from_epsilon(q, s.gravity - c_1 * s.nu + sign * pull)
    )
    rate = (8 * (lyapunov(1) - lyapunov(-1)) - (lyapunov(2) - lyapunov(-2))) / (12 * h)
    damped = -s.nu @ (c_1 * s.nu)
    assert rate == pytest.approx(damped if sign > 0 else damped - 2 * s.nu @ pull, rel=1e-7)
    assert abs(s.nu @ pull) > 0.1 * abs(damped)
