# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The numbered statements of Jain and Rodriguez (1995) that are operator identities, on a tree.

test_laws.py shows (1.1)–(1.3), (5.1), (5.2), (7.7)–(7.9), Lemma 7.1, Lemma 7.2 and Lemma 7.3 for
every robot.
"""

from typing import NamedTuple

import numpy as np
import pytest

import diag_dynamics as dd
import robots
from accuracy import EPS, assert_close, norm, tolerance
from derivative_oracles import RateOracle
from described import PANDA, UR5
from oracles import State
from paper_operators import Operators, cross

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


def cases_of(robot):
    """Return the cases of a robot."""
    model = dd.load_urdf(robot.source, mimic="free", **robot.options)
    dyn = dd.DiagonalDynamics(model)
    oracle = RateOracle(robot.urdf, model.dof_names, **robot.options)
    out = []
    for sample in robots.samples(robot.id, oracle):
        q, qd, tau, _ = sample
        t = oracle.at(q, qd, tau)
        w = Operators(oracle, q, qd)
        s = dyn.evaluate(q, qd, tau)
        f = dyn.factors(q)
        out.append(
            Case(w, t, dyn, s, f, sample, np.sqrt(np.diag(t.M)), tolerance(t), bool(robot.armature))
        )
    return out


GEARED = next(robot for robot in robots.random_robots() if robot.armature)
ROBOTS = (robots.random_robots()[1], GEARED)


@pytest.fixture(scope="module", params=ROBOTS)
def cases(request):
    """Return the cases of a tree with slides, without and with armature."""
    return cases_of(request.param)


@pytest.fixture(params=range(len(robots.SPEEDS)))
def c(request, cases):
    """Return each case of each robot in turn."""
    return cases[request.param]


def scaled(c, A):
    """Return a matrix over the joints in units in which M_kk = 1."""
    return A / np.outer(c.unit, c.unit)


# --- Section 4: factorizations


def test_identity_4_1b(c):
    """Identity 4.1 (b): M = [1 + HφK] D [1 + HφK]*, the innovations factorization; its factors are
    the library's.
    """
    w = c.w
    root = c.unit
    M = w.mine(w.unit @ w.D @ w.unit.T)
    assert_close(scaled(c, c.dyn.mass_matrix(c.t.q)), scaled(c, M), 1e-12)
    weigh = np.sqrt(c.f.D) / root[:, None]
    assert_close(c.f.unit * weigh, w.mine(w.unit) * weigh, c.tolerance)
    assert_close(c.f.D / w.mine(np.diag(w.D)), np.ones(w.n), c.tolerance)


# --- Section 6: rates


def test_rate_of_d(c):
    """(6.5) and Table 3: D' = HP'H* = Hλ̇H*, the library's rate of the articulated inertia."""
    w = c.w
    for rate in (w.P_rate, w.rate):
        expected = w.mine(np.diag(w.H @ rate @ w.H.T))
        scale = max(norm(expected / c.f.D), 1e-2 * norm(c.t.qd))
        assert_close(c.s.articulated_inertia_rate / c.f.D, expected / c.f.D, c.tolerance, scale)


def test_rate_of_m(c):
    """(A.30): m' = Hφ[Ω_δ φ~ P + (1 − τ/2)λ̇]H*D^−½ with φ~ = φ − 1, without armature: the
    library's ṁᵀx.
    """
    if c.has_armature:
        return
    w = c.w
    unit = c.unit
    tau = w.G @ w.H
    inner = w.turn @ (w.phi - w.one) @ w.P + (w.one - 0.5 * tau) @ w.rate
    expected = w.mine(w.H @ w.phi @ inner @ w.H.T @ np.linalg.inv(w.root)) / unit[:, None]
    actual = (
        np.array([c.dyn.m_rate_transposed_times(c.t.q, c.t.qd, e) for e in np.eye(w.n)])
        / unit[:, None]
    )
    assert_close(actual, expected, c.tolerance, max(norm(expected), 1e-2 * norm(c.t.qd)))


def test_identity_6_3(c):
    """Identity 6.3, Lemma A.2, (A.13): ∂M/∂θ_i = Hφ[H_δφM − Mφ*H_δ]φ*H*, the library's rate of M by
    a unit rate.
    """
    w = c.w
    largest = norm(scaled(c, c.t.M))
    left = w.H @ w.phi
    right = w.phi @ w.M @ w.phi.T @ w.H.T
    for k, e in enumerate(np.eye(w.n)):
        sensitivity = np.zeros_like(w.M)
        at = w.at(w.body(k))
        sensitivity[at, at] = cross(w.H[w.body(k), at])
        half = (
            -left @ sensitivity.T @ right
        )  # H_δ for −H_δ*, see `Operators`; the other half is its transpose
        expected = scaled(c, w.mine(half + half.T))
        actual = scaled(c, c.dyn.mass_matrix_rate(c.t.q, e))
        assert_close(actual, expected, 1e-12, norm(expected) + largest)


def partials(c):
    """Return ∂M/∂q of the library, [i, j, k] = ∂M_jk/∂q_i."""
    return np.array([c.dyn.mass_matrix_rate(c.t.q, e) for e in np.eye(c.w.n)])


# --- Sections 2, 3 and 7: equations of motion


def test_lagrange_equations(c):
    """(2.1): C(θ, θ') = M'θ' − ½ θ'*M_θθ' and Mθ'' + C = T, gravity aside; C is coriolis_torque."""
    unit = c.unit
    first = c.dyn.mass_matrix_rate(c.t.q, c.t.qd) @ c.t.qd
    second = 0.5 * np.einsum("j,ijk,k->i", c.t.qd, partials(c), c.t.qd)
    scale = norm(first / unit) + norm(second / unit) + norm(c.t.qd) * norm(c.t.nu)
    for bias in (c.dyn.coriolis_torque(c.t.q, c.t.qd), c.t.c):
        assert_close((first - second) / unit, bias / unit, c.tolerance, scale)
    weight = c.dyn.gravity_torque(c.t.q)
    qdd = c.sample.qdd
    T = c.dyn.mass_matrix(c.t.q) @ qdd + first - second + weight
    expected = c.t.oracle.inverse_dynamics(c.t.q, c.t.qd, qdd)
    assert_close(
        T / unit, expected / unit, c.tolerance, norm(expected / unit) + norm(weight / unit) + scale
    )


def brace(w, V_part):
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


def unnormalized_scale(c):
    """Return the size of the terms of D^−½C_ξ."""
    return c.t.coriolis_scale + norm(c.t.Ddot * c.t.xi / np.sqrt(c.t.D))


def test_lemma_7_3(c):
    """Lemma 7.3, (7.9): C_ξ = Hψ[λ̇H*ξ − (Ω_δP + V~*M)V] and κ = [1 − HψK]T; ξ*C_ξ = ½ξ*D'ξ."""
    w = c.w
    root = np.sqrt(c.f.D)
    xi = w.oracle.to_pin(c.s.xi)
    C = w.mine(w.H @ w.psi @ (w.rate @ w.H.T @ xi - (w.turn @ w.P + w.V_cross.T @ w.M) @ w.V))
    scale = unnormalized_scale(c)
    assert_close(c.s.coriolis_unnormalized / root, C / root, c.tolerance, scale)
    kappa = w.mine(w.inverse @ w.oracle.to_pin(c.t.tau))
    assert_close(c.s.kappa / root, kappa / root, c.tolerance)
    work = 0.5 * c.s.xi @ w.mine(np.diag(w.H @ w.rate @ w.H.T) * xi)
    assert_close(c.s.xi @ c.s.coriolis_unnormalized, work, c.tolerance, norm(c.s.nu) * scale)


def test_algorithm_8_1(c):
    """Algorithm 8.1, (8.1), (8.2): ξ' = D⁻¹[T − Hψζ], ζ = KT + λ̇H*ξ − (Ω_δP + V~*M)V, gravity
    taken from T.
    """
    w = c.w
    root = np.sqrt(c.f.D)
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


# --- Section 2: when ν is a derivative


def curl(dyn, q):
    """Return ∂(mᵀ)_kj/∂q_i − ∂(mᵀ)_ki/∂q_j, [k, i, j]: 0 if the rows of mᵀ are gradients."""
    e = np.eye(len(q))
    rate = np.array([[dyn.m_rate_transposed_times(q, a, b) for b in e] for a in e])  # [i, j, k]
    return (rate - rate.transpose(1, 0, 2)).transpose(2, 0, 1)


@pytest.mark.parametrize("id", [UR5, PANDA])
def test_total_rates_are_no_derivatives(id):
    """Assumption 2.1, (2.2) fails for a generic robot: mᵀ is the gradient of no transformation, ν
    of no coordinates.
    """
    robot = robots.robot(id)
    dyn = dd.DiagonalDynamics(dd.load_urdf(robot.source, mimic="free"))
    oracle = RateOracle(robot.urdf, dyn.model.dof_names)
    q = robots.samples(id, oracle)[0].q
    actual = curl(dyn, q)
    e = np.eye(len(q))
    assert norm(actual) > 0.1 * norm(dyn.factors(q).m)
    expected = np.array([oracle.at(q, a).mdot for a in e])  # [i, j, k]: ∂m_jk/∂q_i
    expected = (expected - expected.transpose(1, 0, 2)).transpose(2, 0, 1)
    assert_close(actual, expected, tolerance(oracle.at(q, e[0])))


def test_lemma_2_1():
    """Lemma 2.1, (2.4): where mᵀ is a gradient, as that of a gantry, f = mᵀq has f'' = ε and no
    Coriolis term.
    """
    dyn = dd.DiagonalDynamics(dd.load_urdf(robots.GANTRY))
    q, qd, tau, other = np.random.default_rng(1).standard_normal((4, 3))
    assert (curl(dyn, q) == 0).all()
    m = dyn.factors(q).m
    assert_close(dyn.factors(other).m, m, 1e-15)  # so that f = mᵀq has f' = mᵀq' = ν
    s = dyn.evaluate(q, qd, tau)
    acceleration = m.T @ dyn.forward_dynamics(q, qd, tau)
    assert_close(acceleration, s.epsilon - s.gravity, 1e-13, norm(s.epsilon) + norm(s.gravity))
    assert norm(s.coriolis) <= 10 * EPS * norm(s.nu) * norm(qd)
