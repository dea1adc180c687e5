# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rates of change and operational space: ṁᵀx, B, dM/dt, C_s, Ḋ, ln det M, ℓJᵀ. Each against Pinocchio, or by its law.

A law is a function of a `Case`; robots of the wheel and made-up ones, coupled robots, and trees that hypothesis draws
all go through the same ones. Nothing the library computes is its own referee, but where a law says so.
"""

import ast
import random
import zlib
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import test_random_trees as trees
from hypothesis import given, note
from pinocchio.rpy import rpyToMatrix

import derivative_oracles
import diag_dynamics as dd
import robots
from accuracy import EPS, assert_close, norm, tolerance, tolerance_of_differences
from derivative_oracles import (
    Coupled,
    RateOracle,
    bracket,
    bracket_scale,
    carriers,
    coriolis_scale,
    jacobian,
    link_placement,
)
from examples import examples
from oracles import Oracle, State
from robots import description, joint, link

PANDA = "panda_description/urdf/panda.urdf"
ICUB = "icub_description/robots/icub.urdf"

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")


# --- cases


class Case(NamedTuple):
    """One robot in one state, the oracle's truth beside the library."""

    dyn: dd.DiagonalDynamics
    oracle: RateOracle | Coupled
    t: State
    s: object  # evaluate
    x: np.ndarray  # a rate-like vector of which every entry weighs alike
    y: np.ndarray  # another
    unit: np.ndarray  # √M_kk
    size: float  # of the terms that make B [1/s]
    weight: float  # of the terms that make C_s, in units in which M_kk = 1 [1/s]
    tolerance: float
    tolerance_of_differences: float
    points: tuple  # (link, point of it, axes, direction)


def case_of(dyn, oracle, q, qd, tau, seed) -> Case:
    """Return the case of one state, with vectors and points drawn from a seed."""
    rng = np.random.default_rng(seed)
    t = oracle.at(q, qd, tau)
    unit = np.sqrt(np.diag(t.M))
    x, y = rng.standard_normal((2, len(unit))) / unit
    names = dyn.model.link_names
    chosen = dict.fromkeys((names[0], names[-1], *map(str, rng.choice(names, 3))))
    points = [(name, rng.uniform(-0.5, 0.5, 3), frame) for name in chosen for frame in ("link", "world")]
    points.append((names[-1], np.zeros(3), "link"))
    points = tuple((*point, rng.standard_normal(3)) for point in points)
    numbers = bracket_scale(t), coriolis_scale(t), tolerance(t), tolerance_of_differences(t)
    return Case(dyn, oracle, t, dyn.evaluate(q, qd, tau), x, y, unit, *numbers, points)


class Robot(NamedTuple):
    """A robot, its oracle, and its cases."""

    id: str
    model: object
    dyn: dd.DiagonalDynamics
    oracle: RateOracle | Coupled
    cases: list[Case]


def load(robot: robots.Robot, coupled: bool = False) -> Robot:
    """Load a robot in library and oracle, followers independent or coupled, and evaluate its samples."""
    model = dd.load_urdf(robot.source, mimic="embed" if coupled else "free", **robot.options)
    dyn = dd.DiagonalDynamics(model)
    oracle = (Coupled if coupled else RateOracle)(robot.urdf, model.dof_names, **robot.options)
    seed = zlib.crc32(robot.id.encode())
    cases = [case_of(dyn, oracle, s.q, s.qd, s.tau, (seed, i)) for i, s in enumerate(robots.samples(robot.id, oracle))]
    return Robot(robot.id, model, dyn, oracle, cases)


def branched(leader: str, follower: str) -> str:
    """Return a tree of two arms and a tool in which one joint follows another: −1.3 times, and 0.4 further."""
    rng = np.random.default_rng(8)
    parents = {"waist": "root", "a1": "waist", "a2": "a1", "a3": "a2", "b1": "waist", "b2": "b1", "b3": "b2"}
    elements = [link("root", *robots._random_inertia(rng))]
    for name, parent in parents.items():
        pose = {"xyz": rng.uniform(-0.4, 0.4, 3), "rpy": rng.uniform(-3, 3, 3)}
        kind = "prismatic" if name == "b2" else "revolute"
        text = joint(name, kind, parent, name, rng.standard_normal(3), **pose)
        if name == follower:
            mimic = f'<mimic joint="{leader}" multiplier="-1.3" offset="0.4"/>'
            text = text.replace("</joint>", f"{mimic}</joint>")
        elements += [text, link(name, *robots._random_inertia(rng))]
    return description(f"{follower}_follows_{leader}", *elements)


COUPLED = (
    robots.robot(PANDA),
    robots.robot(PANDA).floating,
    robots.robot("pr2_description/urdf/pr2.urdf"),
    robots.robot("tiago_pro_description/robots/tiago_pro.urdf").floating,
    robots.Robot("follower on another branch", branched("a3", "b1"), {"a3": 0.3, "b2": 0.7}),
    robots.Robot("leader outboard", branched("a3", "a1")),
    robots.Robot("leader outboard+floating", branched("b3", "waist"), floating_base=True),
)


@pytest.fixture(scope="module", params=robots.robots_to_test(), ids=lambda robot: robot.id)
def robot(request) -> Robot:
    """Return each robot in turn; module scope, so that all tests of one robot share one evaluation."""
    return load(request.param)


@pytest.fixture(scope="module", params=COUPLED, ids=lambda robot: robot.id)
def coupled(request) -> Robot:
    """Return each robot with followers in turn."""
    return load(request.param, coupled=True)


@pytest.fixture(scope="module")
def panda() -> Robot:
    """Return the robot of the tests that need only one."""
    return load(robots.robot(PANDA))


# --- the oracles


def test_oracles_import_nothing_of_the_library():
    """An oracle that shared code with the library would share its mistakes."""
    tree = ast.parse(Path(derivative_oracles.__file__).read_text(encoding="utf-8"))
    names = [a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names]
    names += [n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)]
    assert names and not [name for name in names if name.startswith("diag_dynamics")]


def test_coriolis_matrix_of_the_oracle(robot):
    """C_s is that of Pinocchio, as far as that goes; C_s q̇ is its bias and C_s + C_sᵀ = Ṁ, to rounding."""
    for c in robot.cases:
        weigh, theirs = np.outer(c.unit, c.unit), Oracle.coriolis_matrix(c.oracle, c.t.q, c.t.qd)
        assert_close(c.t.C_s / weigh, theirs / weigh, 2e-11, c.weight)
        assert_close(c.t.C_s @ c.t.qd / c.unit, c.t.c / c.unit, 1e-13, c.weight * norm(c.unit * c.t.qd))
        rate = c.oracle.mass_matrix_rate(c.t.q, c.t.qd)
        assert_close((c.t.C_s + c.t.C_s.T) / weigh, rate / weigh, 1e-13, 2 * c.weight)


def test_coriolis_matrix_of_the_oracle_with_followers(coupled):
    """The same of coupled joints: C_s q̇ = c, and C_s + C_sᵀ = Ṁ."""
    for c in coupled.cases:
        weigh = np.outer(c.unit, c.unit)
        assert_close(c.t.C_s @ c.t.qd / c.unit, c.t.c / c.unit, 1e-13, c.weight * norm(c.unit * c.t.qd))
        rate = c.oracle.mass_matrix_rate(c.t.q, c.t.qd)
        assert_close((c.t.C_s + c.t.C_s.T) / weigh, rate / weigh, 1e-13, 2 * c.weight)


def columns(function, n: int) -> np.ndarray:
    """Return the matrix of a linear function."""
    return np.column_stack([function(e) for e in np.eye(n)]) if n else np.zeros((0, 0))


# --- ṁᵀx


def m_rate(c: Case) -> np.ndarray:
    """Return the library's ṁ: ṁᵀe_i is its row i."""
    return columns(lambda e: c.dyn.m_rate_transposed(c.t.q, c.t.qd, e), c.dyn.model.nv).T


def floor(c: Case) -> float:
    """Return 10⁻² of how fast M changes [1/s], for what vanishes by cancellation or always; see `State.coriolis_scale`."""
    return 1e-2 * max(c.size, norm(c.t.qd))


def rate_scale(c: Case, x) -> float:
    """Return |ṁᵀx|, or what stands in where that is rounding only."""
    return max(norm(c.t.mdot.T @ x), floor(c) * norm(c.t.m.T @ x))


def m_rate_transposed(c):
    """ṁᵀx, ṁ from Pinocchio's Ṁ and factor (eq. A.30)."""
    for x in (c.x, c.y, c.t.qd):
        actual = c.dyn.m_rate_transposed(c.t.q, c.t.qd, x)
        assert_close(actual, c.t.mdot.T @ x, c.tolerance, rate_scale(c, x))


def m_rate_by_difference(c):
    """ṁ, all of it, from differences of Pinocchio's factor along the motion: no Coriolis matrix, no recursion."""
    unit = c.unit[:, None]
    scale = max(norm(c.t.mdot / unit), floor(c) * norm(c.t.m / unit))
    assert_close(m_rate(c) / unit, c.t.mdot_by_difference / unit, c.tolerance_of_differences, scale)


def m_rate_factors_the_mass_matrix_rate(c):
    """ṁ mᵀ + m ṁᵀ = Ṁ: the product rule of M = m mᵀ, with Ṁ of Pinocchio."""
    half, weigh = m_rate(c) @ c.dyn.factors(c.t.q).m.T, np.outer(c.unit, c.unit)
    scale = max(norm(half / weigh), floor(c) * norm(c.t.M / weigh))
    assert_close((half + half.T) / weigh, (c.t.C_s + c.t.C_s.T) / weigh, c.tolerance, scale)


def m_rate_diagonal(c):
    """ṁ_kk = ½ D_k^−½ Ḋ_k, Ḋ that of the evaluation."""
    expected = 0.5 * c.s.articulated_inertia_rate / np.sqrt(c.s.articulated_inertia)
    scale = max(norm(expected / c.unit), floor(c))
    assert_close(np.diag(m_rate(c)) / c.unit, expected / c.unit, c.tolerance, scale)


def m_rate_is_linear(c):
    """ṁᵀ(ax + by) = a ṁᵀx + b ṁᵀy, and ṁ is linear in q̇."""
    rate = c.dyn.m_rate_transposed
    q, qd, other, a, b = c.t.q, c.t.qd, norm(c.t.qd) * c.y, -1.7, 0.3
    scale = rate_scale(c, c.x) + rate_scale(c, c.y)
    expected = a * rate(q, qd, c.x) + b * rate(q, qd, c.y)
    assert_close(rate(q, qd, a * c.x + b * c.y), expected, c.tolerance, scale)
    parts = a * rate(q, qd, c.x), b * rate(q, other, c.x)
    scale = rate_scale(c, c.x) + norm(parts[1])
    assert_close(rate(q, a * qd + b * other, c.x), sum(parts), c.tolerance, scale)
    assert (rate(q, 0 * qd, c.x) == 0).all()


# --- B(q, ν)x


def bracket_columns(c) -> np.ndarray:
    """Return the library's B."""
    return columns(lambda e: c.dyn.coriolis_bracket(c.t.q, c.t.qd, e), c.dyn.model.nv)


def coriolis_bracket(c):
    """B x, B = ℓ (C_s − m ṁᵀ) ℓᵀ with Pinocchio's C_s."""
    B = bracket(c.t)
    for x in (c.x * c.unit, c.y * c.unit, c.t.nu):
        scale = c.size * norm(x)
        assert_close(c.dyn.coriolis_bracket(c.t.q, c.t.qd, x), B @ x, c.tolerance, scale)


def bracket_is_skew(c):
    """B + Bᵀ = 0, entry by entry: B is the bracket of Identity 7.1, and Lemma 7.1 is its νᵀBν = 0."""
    B = bracket_columns(c)
    assert_close(B + B.T, np.zeros_like(B), max(1e-12, EPS * c.t.scaled_condition), c.size)
    for x in (c.x * c.unit, c.t.nu):
        work = x @ c.dyn.coriolis_bracket(c.t.q, c.t.qd, x)
        assert_close(work, 0.0, max(1e-12, EPS * c.t.scaled_condition), c.size * x @ x)


def bracket_makes_the_coriolis_term(c):
    """Bν = C, C of the evaluation and of Pinocchio."""
    actual = c.dyn.coriolis_bracket(c.t.q, c.t.qd, c.s.nu)
    assert_close(actual, c.s.coriolis, c.tolerance, c.t.coriolis_scale)
    assert_close(actual, c.t.coriolis, c.tolerance, c.t.coriolis_scale)


def bracket_is_linear(c):
    """B is linear in what it is applied to, and in q̇."""
    B = c.dyn.coriolis_bracket
    q, qd, other, a, b = c.t.q, c.t.qd, norm(c.t.qd) * c.y, -1.7, 0.3
    x, y = c.x * c.unit, c.y * c.unit
    scale = c.size * (norm(x) + norm(y))
    assert_close(B(q, qd, a * x + b * y), a * B(q, qd, x) + b * B(q, qd, y), c.tolerance, scale)
    parts = a * B(q, qd, x), b * B(q, other, x)
    assert_close(B(q, a * qd + b * other, x), sum(parts), c.tolerance, scale + sum(map(norm, parts)))
    assert (B(q, 0 * qd, x) == 0).all()


def reference_motion_follows(c):
    """m(ν̇_r + Bν_r) = M q̈_r + C_s q̇_r with ν_r = mᵀq̇_r: the identity of tracking control."""
    dyn, q, qd, qd_r, qdd_r = c.dyn, c.t.q, c.t.qd, norm(c.t.qd) * c.x, c.y
    nu_r = dyn.nu_from_qd(q, qd_r)
    rate = dyn.nu_from_qd(q, qdd_r) + dyn.m_rate_transposed(q, qd, qd_r)
    terms = [c.t.M @ qdd_r, c.t.C_s @ qd_r]
    scale = sum(norm(term / c.unit) for term in terms) + norm(rate)
    actual = dyn.tau_from_epsilon(q, rate + dyn.coriolis_bracket(q, qd, nu_r))
    assert_close(actual / c.unit, sum(terms) / c.unit, c.tolerance, scale)


# --- dM/dt and C_s


def mass_matrix_rate(c):
    """dM/dt = C_s + C_sᵀ of Pinocchio, both triangles alike."""
    weigh, actual = np.outer(c.unit, c.unit), c.dyn.mass_matrix_rate(c.t.q, c.t.qd)
    assert_close(actual / weigh, (c.t.C_s + c.t.C_s.T) / weigh, 1e-12, 2 * c.weight)
    assert (actual == actual.T).all()


def mass_matrix_rate_by_difference(c):
    """dM/dt from differences of Pinocchio's M along the motion."""
    weigh = np.outer(c.unit, c.unit)
    expected = c.oracle.derivative(c.oracle.mass_matrix, c.t.q, c.t.qd)
    assert_close(c.dyn.mass_matrix_rate(c.t.q, c.t.qd) / weigh, expected / weigh, 1e-10, 2 * c.weight)


def mass_matrix_rate_applied(c):
    """(dM/dt) x from Pinocchio's derivatives of Newton–Euler, and from the matrix."""
    dense = c.dyn.mass_matrix_rate(c.t.q, c.t.qd)
    for x in (c.x, c.y, c.t.qd):
        scale = 2 * c.weight * norm(x * c.unit)
        actual = c.dyn.mass_matrix_rate_times(c.t.q, c.t.qd, x) / c.unit
        assert_close(actual, c.oracle.mass_matrix_rate(c.t.q, c.t.qd) @ x / c.unit, 1e-12, scale)
        assert_close(actual, dense @ x / c.unit, 1e-12, scale)


def mass_matrix_rate_sums_partial_derivatives(c):
    """dM/dt = Σ q̇_i ∂M/∂q_i, each ∂M/∂q_i by a unit rate (Identity 6.3)."""
    weigh = np.outer(c.unit, c.unit)
    sum_ = np.zeros_like(weigh)
    for rate, e in zip(c.t.qd, np.eye(len(weigh)), strict=True):
        sum_ += rate * c.dyn.mass_matrix_rate(c.t.q, e)
    expected = c.dyn.mass_matrix_rate(c.t.q, c.t.qd)
    assert_close(expected / weigh, sum_ / weigh, 1e-12, 2 * c.weight + norm(c.t.qd))


@cache
def outboard(oracle: RateOracle) -> np.ndarray:
    """Return [k, i]: whether dof i is outboard of dof k, or of the same joint."""
    dofs = np.arange(oracle.nv)
    return np.array([np.isin(dofs, list(oracle.descendants(k) | oracle.joint_mates(k))) for k in dofs])


def mass_matrix_ignores_what_is_inboard(c):
    """∂M_jk/∂q_i = 0 unless i is outboard of j or of k (A.13): inertias do not change with the inboard positions."""
    if isinstance(c.oracle, Coupled):
        return
    weigh, later = np.outer(c.unit, c.unit), outboard(c.oracle)
    for i, e in enumerate(np.eye(c.dyn.model.nv)):
        rate = c.dyn.mass_matrix_rate(c.t.q, e) / weigh
        independent = ~(later[:, i][:, None] | later[:, i])
        assert_close(rate[independent], 0 * rate[independent], 1e-13, norm(rate) + norm(c.t.M / weigh))


def coriolis_product(c):
    """C_s x with Pinocchio's C_s, and the classical bias where x = q̇."""
    scale = c.weight
    for x in (c.x, c.y, c.t.qd):
        actual = c.dyn.coriolis_product(c.t.q, c.t.qd, x) / c.unit
        assert_close(actual, c.t.C_s @ x / c.unit, 1e-12, scale * norm(x * c.unit))
    for bias in (c.t.c, c.dyn.bias(c.t.q, c.t.qd)):
        assert_close(actual, bias / c.unit, 1e-12, scale * norm(c.t.qd * c.unit))


def coriolis_product_is_skew(c):
    """Ṁ − 2C_s is skew: C_s + C_sᵀ = Ṁ, both of the library, C_s column by column."""
    weigh = np.outer(c.unit, c.unit)
    C_s = columns(lambda e: c.dyn.coriolis_product(c.t.q, c.t.qd, e), c.dyn.model.nv)
    assert_close((C_s + C_s.T) / weigh, c.dyn.mass_matrix_rate(c.t.q, c.t.qd) / weigh, 1e-12, 2 * c.weight)
    qd, other = c.t.qd, norm(c.t.qd) * c.y
    product = c.dyn.coriolis_product
    parts = [product(c.t.q, qd, c.x) / c.unit, product(c.t.q, other, c.x) / c.unit]
    scale = 2 * c.weight * norm(c.x * c.unit) + sum(map(norm, parts))
    assert_close(product(c.t.q, qd + other, c.x) / c.unit, sum(parts), 1e-12, scale)


# --- D and ln det M


def inertia_rate(c):
    """Ḋ of Pinocchio's factor."""
    scale = max(norm(c.t.Ddot / c.t.D), floor(c))
    assert_close(c.s.articulated_inertia_rate / c.t.D, c.t.Ddot / c.t.D, c.tolerance, scale)


def inertia_rate_by_difference(c):
    """Ḋ from differences of Pinocchio's D along the motion; D goes with the square of m, and so do its errors."""
    actual, D = c.s.articulated_inertia_rate, c.t.D
    scale = norm(c.t.Ddot / D) + 100 * floor(c)
    expected = c.oracle.derivative(lambda q: c.oracle.unit_factor(q)[1], c.t.q, c.t.qd)
    assert_close(actual / D, expected / D, 2 * c.tolerance_of_differences, scale)


def unnormalized_coriolis_does_this_work(c):
    """ξᵀC_ξ = ½ ξᵀḊξ, all of the library (after Lemma 7.3)."""
    s = c.s
    rate = s.articulated_inertia_rate * s.xi
    scale = norm(s.nu) * (c.t.coriolis_scale + norm(rate / np.sqrt(c.t.D)))
    assert_close(s.xi @ s.coriolis_unnormalized, 0.5 * s.xi @ rate, c.tolerance, scale)


def log_determinant(c):
    """Ln det M = Σ ln D_k, of Pinocchio's M."""
    actual = c.dyn.log_det(c.t.q)
    assert isinstance(actual, float)
    assert_close(actual, np.linalg.slogdet(c.t.M)[1], c.tolerance, c.dyn.model.nv + norm(np.log(c.t.D)))
    assert_close(actual, np.log(c.s.articulated_inertia).sum(), c.tolerance, c.dyn.model.nv + norm(np.log(c.t.D)))


def log_determinant_rate(c):
    """d/dt ln det M = tr M⁻¹Ṁ = Σ Ḋ_k/D_k."""
    actual = c.dyn.log_det_rate(c.t.q, c.t.qd)
    assert isinstance(actual, float)
    shares = np.diag(np.linalg.solve(c.t.m, np.linalg.solve(c.t.m, c.t.C_s + c.t.C_s.T).T))
    scale = max(norm(shares, 1), floor(c))
    assert_close(actual, shares.sum(), c.tolerance, scale)
    assert_close(actual, (c.s.articulated_inertia_rate / c.s.articulated_inertia).sum(), c.tolerance, scale)


def log_determinant_rate_by_difference(c):
    """d/dt ln det M from differences of Pinocchio's M along the motion; det M goes with the square of m."""
    scale = norm(c.t.Ddot / c.t.D, 1) + 100 * floor(c)

    def logarithm(q):
        return np.linalg.slogdet(c.oracle.mass_matrix(q))[1]

    expected = c.oracle.derivative(logarithm, c.t.q, c.t.qd)
    assert_close(c.dyn.log_det_rate(c.t.q, c.t.qd), expected, 2 * c.tolerance_of_differences, scale)


# --- ℓJᵀ


def wrench_factor(c):
    """ℓJᵀ, J from Pinocchio's frames, at points beside the link's origin, in axes of link and world."""
    for name, point, frame, _ in c.points:
        J = jacobian(c.oracle, c.t.q, name, point, frame)
        actual = c.dyn.wrench_factor(c.t.q, name, point, frame=frame)
        assert_close(actual, np.linalg.solve(c.t.m, J.T), c.tolerance)


def wrench_factor_is_zero_off_the_path(c):
    """Rows of joints that do not carry the link are 0 exactly; the root of a fixed base feels nothing at all."""
    if isinstance(c.oracle, Coupled):  # there ℓ couples joints on another branch as well
        return
    for name, point, frame, _ in c.points:
        path = carriers(c.oracle, name)
        off = sorted(set(range(c.dyn.model.nv)) - path)
        actual = c.dyn.wrench_factor(c.t.q, name, point, frame=frame)
        assert (actual[off] == 0).all()
        assert actual[sorted(path)].any() or not path


def epsilon_of_a_wrench(c):
    """ℓJᵀw is linear in w, and at the link's origin that of the evaluation."""
    for name, point, frame, direction in c.points:
        wrench = np.concatenate([direction, point[::-1]])
        actual = c.dyn.epsilon_from_wrench(c.t.q, name, wrench, point, frame=frame)
        w = c.dyn.wrench_factor(c.t.q, name, point, frame=frame)
        assert_close(
            actual,
            np.linalg.solve(c.t.m, jacobian(c.oracle, c.t.q, name, point, frame).T) @ wrench,
            c.tolerance,
            norm(w) * norm(wrench),
        )
        assert_close(actual, w @ wrench, c.tolerance, norm(w) * norm(wrench))
        at_origin = c.dyn.epsilon_from_wrench(c.t.q, name, wrench, frame=frame)
        s = c.dyn.evaluate(c.t.q, c.t.qd, f_ext={name: wrench}, frame=frame)
        scale = norm(c.dyn.wrench_factor(c.t.q, name, frame=frame)) * norm(wrench)
        assert_close(at_origin, s.external, c.tolerance, scale)


def operational_inertia(c):
    """J M⁻¹Jᵀ, of Pinocchio's J and M, = (ℓJᵀ)ᵀ(ℓJᵀ); symmetric, and of no negative direction."""
    for name, point, frame, _ in c.points:
        J = jacobian(c.oracle, c.t.q, name, point, frame)
        expected = J @ np.linalg.solve(c.t.M, J.T)
        actual = c.dyn.operational_inverse_inertia(c.t.q, name, point, frame=frame)
        assert_close(actual, expected, c.tolerance)
        assert_close(actual, actual.T, 1e-15)
        assert np.linalg.eigvalsh(actual).min() >= -1e-14 * norm(actual)
        w = c.dyn.wrench_factor(c.t.q, name, point, frame=frame)
        assert_close(actual, w.T @ w, 1e-14)


def operational_inertia_in_other_axes(c):
    """The axes of link and world differ by the link's orientation."""
    name, point = c.points[-1][0], c.points[0][1]
    R = link_placement(c.oracle, c.t.q, name).rotation
    turn = np.kron(np.eye(2), R)
    link_, world = (c.dyn.operational_inverse_inertia(c.t.q, name, point, frame=frame) for frame in ("link", "world"))
    assert_close(world, turn @ link_ @ turn.T, 1e-13)


def reflected_mass(c):
    """1/(uᵀJM⁻¹Jᵀu), u of any length; ∞ at the root of a fixed base."""
    for name, point, frame, direction in c.points:
        J = jacobian(c.oracle, c.t.q, name, point, frame)[:3]
        mobility = J @ np.linalg.solve(c.t.M, J.T)
        u = direction / norm(direction)
        actual = c.dyn.reflected_mass(c.t.q, name, direction, point, frame=frame)
        assert isinstance(actual, float)
        if not carriers(c.oracle, name):
            assert actual == np.inf
            continue
        assert actual > 0
        assert_close(1 / actual, u @ mobility @ u, 2 * c.tolerance, np.trace(mobility))
        again = c.dyn.reflected_mass(c.t.q, name, 1e-6 * direction, point, frame=frame)
        assert_close(1 / again, 1 / actual, 1e-13, np.trace(mobility))
        back = c.dyn.reflected_mass(c.t.q, name, -direction, point, frame=frame)
        assert_close(1 / back, 1 / actual, 1e-13, np.trace(mobility))


def a_push_accelerates_the_reflected_mass(c):
    """A force f u alone gives a point at rest the acceleration f/m_u along u: forward dynamics agrees."""
    name, point, _, direction = c.points[-1]
    rest, u = np.zeros(c.dyn.model.nv), direction / norm(direction)
    J = jacobian(c.oracle, c.t.q, name, point, "link")[:3]
    free = c.dyn.forward_dynamics(c.t.q, rest, rest)
    pushed = c.dyn.forward_dynamics(c.t.q, rest, rest, {name: np.concatenate([u, np.zeros(3)])})
    mobility = np.trace(J @ np.linalg.solve(c.t.M, J.T))
    scale = mobility + norm(u @ J / c.unit) * (norm(free * c.unit) + norm(pushed * c.unit))
    actual = 1 / c.dyn.reflected_mass(c.t.q, name, direction, point) if mobility else 0.0
    assert_close(u @ J @ (pushed - free), actual, 2 * c.tolerance, scale)


LAWS = (
    m_rate_transposed,
    m_rate_by_difference,
    m_rate_factors_the_mass_matrix_rate,
    m_rate_diagonal,
    m_rate_is_linear,
    coriolis_bracket,
    bracket_is_skew,
    bracket_makes_the_coriolis_term,
    bracket_is_linear,
    reference_motion_follows,
    mass_matrix_rate,
    mass_matrix_rate_by_difference,
    mass_matrix_rate_applied,
    mass_matrix_rate_sums_partial_derivatives,
    mass_matrix_ignores_what_is_inboard,
    coriolis_product,
    coriolis_product_is_skew,
    inertia_rate,
    inertia_rate_by_difference,
    unnormalized_coriolis_does_this_work,
    log_determinant,
    log_determinant_rate,
    log_determinant_rate_by_difference,
    wrench_factor,
    wrench_factor_is_zero_off_the_path,
    epsilon_of_a_wrench,
    operational_inertia,
    operational_inertia_in_other_axes,
    reflected_mass,
    a_push_accelerates_the_reflected_mass,
)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
def test_law(robot, law):
    """Each law, for each robot of the wheel and those made up, fixed and floating."""
    for case in robot.cases:
        law(case)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
def test_law_with_followers(coupled, law):
    """Each law in independent coordinates: M_r = GᵀMG, C_s,r = GᵀC_sG, J_r = JG, m_r the upper factor of M_r."""
    assert coupled.model.nv < coupled.oracle.free.nv
    for case in coupled.cases:
        law(case)


EXACT = tuple(law for law in LAWS if not law.__name__.endswith("by_difference"))


def check(shape, laws=EXACT):
    """Check laws on the tree of a shape."""
    tree = trees.Tree(shape)
    note(tree.urdf)
    model = dd.load_urdf(tree.urdf, payloads=tree.payloads, **tree.options)
    if model.nv == 0:
        return
    oracle = RateOracle(tree.urdf_with_payloads, model.dof_names, **tree.options)
    rng = np.random.default_rng(shape.seed)
    reach = np.array([shape.length if oracle.is_prismatic(k) else 6.0 for k in range(model.nv)])
    q = oracle.moved(oracle.neutral, reach * rng.uniform(-1, 1, model.nv))
    qd = shape.speed * rng.standard_normal(model.nv)
    case = case_of(dd.DiagonalDynamics(model), oracle, q, qd, 0 * qd, shape.seed)
    for law in laws:
        note(law.__doc__)
        law(case)


@examples(100)
@given(trees.shapes())
def test_small_trees(shape):
    """Up to ten joints of every kind, planar and floating ones inside the tree, armature, locked joints, payloads."""
    check(shape)


@examples(8)
@given(trees.shapes(least=20, most=50, back=12, spread=1.0))
def test_bushes(shape):
    """Tens of joints with many branches."""
    check(shape)


@examples(25)
@given(trees.shapes(most=8, spread=8.0))
def test_magnitudes(shape):
    """Masses from ten nanograms to a hundred thousand tonnes in one robot, where M is not refused as singular."""
    with suppress(dd.MasslessLinkError, dd.SingularMassMatrixError):  # test_random_trees.py is about when that may be
        check(shape)


# --- closed forms and limits


@pytest.mark.parametrize("seed", range(5))
def test_two_link_arm(seed):
    """The textbook arm: only β cos q₂ changes, D₂ is constant, and B has the one entry that makes its C."""
    arm = robots.TwoLinkArm(*np.random.default_rng(seed).uniform(0.2, 2, 7))
    q, qd = np.random.default_rng(seed + 100).uniform(-3, 3, (2, 2))
    dyn = dd.DiagonalDynamics(dd.load_urdf(arm.urdf))
    _, beta, _ = arm._constants
    (unit, D), s = arm.factor(q), beta * np.sin(q[1])
    assert np.allclose(dyn.mass_matrix_rate(q, qd), -s * qd[1] * np.array([[2, 1], [1, 0]]), rtol=1e-11, atol=1e-14)
    assert (dyn.mass_matrix_rate(q, [1.0, 0.0]) == 0).all()  # nothing depends on the shoulder
    # D₁ = M₁₁ − M₁₂²/M₂₂, u = M₁₂/M₂₂
    D_rate = np.array([-2 * s * qd[1] * (1 - unit[0, 1]), 0.0])
    m_rate = np.array([[0.5 * D_rate[0] / np.sqrt(D[0]), -s * qd[1] / np.sqrt(D[1])], [0.0, 0.0]])
    assert np.allclose(dyn.evaluate(q, qd).articulated_inertia_rate, D_rate, rtol=1e-10, atol=1e-13)
    assert np.allclose(dyn.m_rate_transposed(q, qd, [1.0, 0.0]), m_rate[0], rtol=1e-10, atol=1e-13)
    assert np.allclose(dyn.m_rate_transposed(q, qd, [0.0, 1.0]), 0.0, atol=1e-13)
    b = -s * (qd[0] + qd[1]) / np.sqrt(D[0] * D[1])  # C = b [ν₂, −ν₁]
    assert np.allclose(dyn.coriolis_bracket(q, qd, [0.0, 1.0]), [b, 0.0], rtol=1e-10, atol=1e-12)
    assert np.allclose(dyn.coriolis_bracket(q, qd, [1.0, 0.0]), [0.0, -b], rtol=1e-10, atol=1e-12)
    assert dyn.log_det(q) == pytest.approx(np.log(np.linalg.det(arm.mass_matrix(q))), abs=1e-13)
    assert dyn.log_det_rate(q, qd) == pytest.approx(D_rate[0] / D[0], rel=1e-10)


def test_gantry():
    """Translations only: nothing changes; the hook's reflected mass along an axis is what that axis moves."""
    dyn = dd.DiagonalDynamics(dd.load_urdf(robots.GANTRY))
    q, qd, x = np.random.default_rng(5).uniform(-3, 3, (3, 3))
    rounding = 100 * EPS * norm(qd) * norm(x)
    for rate in (
        dyn.m_rate_transposed(q, qd, x),
        dyn.coriolis_bracket(q, qd, x),
        dyn.mass_matrix_rate_times(q, qd, x),
        dyn.mass_matrix_rate(q, qd),
        dyn.coriolis_product(q, qd, x),
        dyn.log_det_rate(q, qd),
        dyn.evaluate(q, qd).articulated_inertia_rate,
    ):
        assert norm(rate) <= rounding
    assert dyn.reflected_mass(q, "bridge", (1, 0, 0), frame="world") == pytest.approx(
        np.linalg.det(dyn.mass_matrix(q)) / np.linalg.det(dyn.mass_matrix(q)[1:, 1:]), rel=1e-12
    )
    for direction in ((0, 1, 0), (0, 0, 1), (0, 3, -2)):
        assert dyn.reflected_mass(q, "bridge", direction, frame="world") == np.inf


PISTON = description(
    "piston",
    link("base"),
    link("head", 2.5, (0.1, 0, 0), (0.1, 0, 0, 0.1, 0, 0.1)),
    joint("slide", "prismatic", "base", "head", axis=(1, 2, 2), xyz=(0.3, 0, 0), rpy=(0.4, 0.2, 0.1)),
)


def test_reflected_mass_of_one_joint():
    """A slide carries its mass along its axis, mass/cos² beside it; a wheel D/r² along the tangent."""
    dyn = dd.DiagonalDynamics(dd.load_urdf(PISTON))
    axis = np.array([1.0, 2.0, 2.0]) / 3
    assert dyn.reflected_mass([0.7], "head", axis) == pytest.approx(2.5, rel=1e-14)
    assert dyn.reflected_mass([0.7], "head", (0, 0, 1), (5.0, 1.0, 0.0)) == pytest.approx(2.5 * 9 / 4, rel=1e-13)
    turn = np.array(
        [link_placement(Oracle(PISTON), np.zeros(1), "head").rotation @ e for e in np.eye(3)]
    ).T  # of the link, which does not turn with the slide
    assert dyn.reflected_mass([0.7], "head", turn @ axis, frame="world") == pytest.approx(2.5, rel=1e-13)
    pendulum = dd.DiagonalDynamics(dd.load_urdf(robots.PENDULUM))
    D = pendulum.evaluate([1.0], [0.0]).articulated_inertia[0]
    assert pendulum.reflected_mass([1.0], "rod", (0, 1, 0), (0.3, 0, -2.0)) == pytest.approx(D / 4, rel=1e-13)
    J_w = pendulum.wrench_factor([1.0], "rod")  # a turning joint feels the moment about its axis only
    assert J_w[0] == pytest.approx([0, 0, 0, 1 / np.sqrt(D), 0, 0], rel=1e-13, abs=1e-14)


def test_reflected_mass_is_infinite_where_nothing_moves(panda):
    """On the axis of the only joint, across a slide, along an axis of rotation, at the root: the point cannot go there."""
    pendulum = dd.DiagonalDynamics(dd.load_urdf(robots.PENDULUM))
    slide = dd.DiagonalDynamics(dd.load_urdf(PISTON))
    for q in ([0.0], [0.3], [2.0]):
        assert pendulum.reflected_mass(q, "rod", (1, 0, 0), (0.1, 0.2, 0.3)) == np.inf
        assert pendulum.reflected_mass(q, "rod", (0, 1, 0)) == np.inf  # the link's origin is on the axis
        assert pendulum.reflected_mass(q, "rod", (0, 0, 2.0), (7.0, 0, 0)) == np.inf
        assert pendulum.reflected_mass(q, "base", (0, 0, 1)) == np.inf
        assert slide.reflected_mass(q, "head", (2, -1, 0), (0.1, 0.2, 0.3)) == np.inf
        assert slide.reflected_mass(q, "head", (0, 1, -1), frame="link") == np.inf
    sample = panda.cases[0].t
    for frame in ("link", "world"):
        assert panda.dyn.reflected_mass(sample.q, "panda_link0", (1, 2, 3), (1, 1, 1), frame=frame) == np.inf


def one_joint(kind, rng):
    """Return a robot of one crooked joint, its axis, and a position."""
    axis, rpy = rng.standard_normal(3), rng.uniform(-3, 3, 3)
    head = link("head", 2.5, (0.1, 0, 0), (0.1, 0, 0, 0.1, 0, 0.1))
    urdf = description(kind, link("base"), head, joint("only", kind, "base", "head", axis, (0.3, 0.1, 0.2), rpy))
    return urdf, axis / norm(axis), rng.uniform(-2, 2, 1)


@pytest.mark.parametrize("frame", ["link", "world"])
def test_reflected_mass_across_a_crooked_slide(frame):
    """∞ across a slide however its axis and the direction lie: rounding is no motion. A push 10⁻⁶ beside is not cut off."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        urdf, axis, q = one_joint("prismatic", rng)
        dyn, point = dd.DiagonalDynamics(dd.load_urdf(urdf)), rng.standard_normal(3)
        R = link_placement(Oracle(urdf), q, "head").rotation if frame == "world" else np.eye(3)
        across = np.cross(axis, rng.standard_normal(3))
        across /= norm(across)
        nearly = dyn.reflected_mass(q, "head", R @ (across + 1e-6 * axis), point, frame=frame)
        assert nearly == pytest.approx(2.5e12, rel=1e-8)
        assert dyn.reflected_mass(q, "head", R @ across, point, frame=frame) == np.inf


@pytest.mark.parametrize("frame", ["link", "world"])
def test_reflected_mass_towards_a_crooked_hinge(frame):
    """∞ along lines through a hinge's axis, however they lie. A push 10⁻⁶ beside is not cut off."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        urdf, axis, q = one_joint("revolute", rng)
        dyn, point = dd.DiagonalDynamics(dd.load_urdf(urdf)), rng.standard_normal(3)
        R = link_placement(Oracle(urdf), q, "head").rotation if frame == "world" else np.eye(3)
        through = rng.standard_normal() * axis - point  # from the point to somewhere on the axis
        through, tangent = through / norm(through), np.cross(axis, point)
        D = dyn.evaluate(q, [0.0]).articulated_inertia[0]
        beside = through + 1e-6 * tangent / norm(tangent)
        nearly = dyn.reflected_mass(q, "head", R @ beside, point, frame=frame)
        assert nearly == pytest.approx(1e12 * D / (tangent @ tangent), rel=1e-8)
        assert dyn.reflected_mass(q, "head", R @ through, point, frame=frame) == np.inf


@pytest.mark.parametrize("joints", [1, 3, 10, 30])
def test_reflected_mass_out_of_a_crooked_plane(joints):
    """∞ normal to the plane that a planar arm moves in, however many joints it has and however its frames are turned."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        normal, elements, at = rng.standard_normal(3), [link("link_0")], np.eye(3)
        for k in range(joints):
            rpy, xyz = rng.uniform(-3, 3, 3), at.T @ rng.uniform(-0.4, 0.4, 3)
            at = at @ rpyToMatrix(rpy)
            axis = at.T @ normal / norm(normal)
            elements.append(joint(f"joint_{k}", "revolute", f"link_{k}", f"link_{k + 1}", axis, xyz, rpy))
            elements.append(link(f"link_{k + 1}", 1.0, (0.1, 0.05, 0), (0.01, 0, 0, 0.01, 0, 0.01)))
        dyn, point = dd.DiagonalDynamics(dd.load_urdf(description("planar_arm", *elements))), rng.standard_normal(3)
        q = rng.uniform(-2, 2, joints)
        assert dyn.reflected_mass(q, f"link_{joints}", normal, point, frame="world") == np.inf
        across = np.cross(normal, rng.standard_normal(3))
        assert dyn.reflected_mass(q, f"link_{joints}", across, point, frame="world") < 1e3


def test_lever_of_a_point():
    """The point is in the link's axes and from its origin whatever the axes of the wrench are."""
    dyn = dd.DiagonalDynamics(dd.load_urdf(robots.PENDULUM))
    q, D = [0.8], dyn.evaluate([0.8], [0.0]).articulated_inertia[0]
    # 2 m along the rod; the world's x is the axis but for the mounting's turn about z of 0.4
    push = dyn.wrench_factor(q, "rod", (0, 0, -2.0), frame="world")[0]
    R = np.array([[np.cos(0.4), -np.sin(0.4), 0], [np.sin(0.4), np.cos(0.4), 0], [0, 0, 1]])
    tangent = R @ [0, 2 * np.cos(0.8), 2 * np.sin(0.8)]
    assert push * np.sqrt(D) == pytest.approx([*tangent, *(R @ [1, 0, 0])], rel=1e-13, abs=1e-13)


@pytest.mark.parametrize("id", [id for id, e in robots.EXCLUDED.items() if e.reason == robots.MOTIONLESS])
def test_motionless(id):
    """Where nothing moves answers are empty, ln det M is that of the empty matrix, and masses are infinite."""
    model = dd.load_urdf(robots.robot_path(id), mimic="free")
    dyn, none, tip = dd.DiagonalDynamics(model), np.zeros(0), model.link_names[-1]
    for method in ("m_rate_transposed", "coriolis_bracket", "mass_matrix_rate_times", "coriolis_product"):
        assert getattr(dyn, method)(none, none, none).shape == (0,)
    assert dyn.mass_matrix_rate(none, none).shape == (0, 0)
    assert dyn.evaluate(none, none).articulated_inertia_rate.shape == (0,)
    assert dyn.log_det(none) == 0.0 and dyn.log_det_rate(none, none) == 0.0
    assert dyn.wrench_factor(none, tip).shape == (0, 6)
    assert dyn.epsilon_from_wrench(none, tip, np.ones(6)).shape == (0,)
    assert (dyn.operational_inverse_inertia(none, tip) == np.zeros((6, 6))).all()
    assert dyn.reflected_mass(none, tip, (0, 0, 1)) == np.inf


# --- the interface's promises


def everything(dyn, t, x) -> dict:
    """Return every answer of these methods at one state."""
    tip, wrench = dyn.model.link_names[-1], np.array([1.0, -2, 3, -4, 5, -6])
    point, frame = (0.1, -0.2, 0.3), "world"
    return {
        "m_rate_transposed": dyn.m_rate_transposed(t.q, t.qd, x),
        "coriolis_bracket": dyn.coriolis_bracket(t.q, t.qd, x),
        "mass_matrix_rate": dyn.mass_matrix_rate(t.q, t.qd),
        "mass_matrix_rate_times": dyn.mass_matrix_rate_times(t.q, t.qd, x),
        "coriolis_product": dyn.coriolis_product(t.q, t.qd, x),
        "log_det": dyn.log_det(t.q),
        "log_det_rate": dyn.log_det_rate(t.q, t.qd),
        "articulated_inertia_rate": dyn.evaluate(t.q, t.qd).articulated_inertia_rate,
        "wrench_factor": dyn.wrench_factor(t.q, tip, point, frame=frame),
        "epsilon_from_wrench": dyn.epsilon_from_wrench(t.q, tip, wrench, point, frame=frame),
        "operational_inverse_inertia": dyn.operational_inverse_inertia(t.q, tip, point, frame=frame),
        "reflected_mass": dyn.reflected_mass(t.q, tip, (1, 2, 3), point, frame=frame),
    }


def assert_no_memory(robot):
    """Answers do not depend on what was asked before, and what was handed out stays as it was."""
    first, other = robot.cases[0], robot.cases[2]
    before = everything(robot.dyn, first.t, first.x)
    kept = {name: np.array(value) for name, value in before.items()}
    everything(robot.dyn, other.t, other.x)
    robot.dyn.evaluate(other.t.q, other.t.qd, other.t.tau, friction=True)
    robot.dyn.inverse_dynamics(other.t.q, other.t.qd, other.x)
    shuffled = list(everything(robot.dyn, first.t, first.x).items())
    fresh = everything(dd.DiagonalDynamics(robot.model), first.t, first.x)
    for answers in (before, dict(shuffled), fresh):
        for name, value in kept.items():
            assert (np.asarray(answers[name]) == value).all(), name


def test_no_memory_of_earlier_calls(robot):
    """Workspaces are reused; answers do not show it."""
    assert_no_memory(robot)


def test_no_memory_of_earlier_calls_with_followers(coupled):
    """Nor where joints follow others."""
    assert_no_memory(coupled)


def test_any_order_of_calls(panda):
    """One method after any other, in one workspace: the answers are those of a new one."""
    case, rng = panda.cases[1], random.Random(1)
    expected = everything(dd.DiagonalDynamics(panda.model), case.t, case.x)
    t, x, tip = case.t, case.x, panda.model.link_names[-1]
    calls = {
        "m_rate_transposed": lambda d: d.m_rate_transposed(t.q, t.qd, x),
        "coriolis_bracket": lambda d: d.coriolis_bracket(t.q, t.qd, x),
        "mass_matrix_rate": lambda d: d.mass_matrix_rate(t.q, t.qd),
        "mass_matrix_rate_times": lambda d: d.mass_matrix_rate_times(t.q, t.qd, x),
        "coriolis_product": lambda d: d.coriolis_product(t.q, t.qd, x),
        "log_det": lambda d: d.log_det(t.q),
        "log_det_rate": lambda d: d.log_det_rate(t.q, t.qd),
        "articulated_inertia_rate": lambda d: d.evaluate(t.q, t.qd).articulated_inertia_rate,
        "wrench_factor": lambda d: d.wrench_factor(t.q, tip, (0.1, -0.2, 0.3), frame="world"),
    }
    for name in rng.choices(list(calls), k=200):
        assert (np.asarray(calls[name](panda.dyn)) == expected[name]).all(), name


def test_nothing_is_left_unwritten(robot, monkeypatch):
    """Every entry handed out was computed: memory that starts as NaN changes no answer."""
    case = robot.cases[1]
    expected = everything(robot.dyn, case.t, case.x)
    monkeypatch.setattr(np, "empty", lambda shape, *_, **__: np.full(shape, np.nan))
    for name, value in everything(robot.dyn, case.t, case.x).items():
        assert (np.asarray(value) == np.asarray(expected[name])).all(), name


def test_answers_share_no_memory(panda):
    """No two arrays handed out overlap each other or the arguments, which stay as they are."""
    case = panda.cases[0]
    given = [x.copy() for x in (case.t.q, case.t.qd, case.x)]
    answers = [pair for _ in range(2) for pair in everything(panda.dyn, case.t, case.x).items()]
    arrays = [(name, a) for name, a in answers if isinstance(a, np.ndarray)]
    arrays += [("argument", x) for x in (case.t.q, case.t.qd, case.x)]
    assert len(arrays) > 15
    for i, (name, a) in enumerate(arrays):
        for other, b in arrays[:i]:
            assert not np.shares_memory(a, b), (name, other)
    assert all((x == copy).all() for x, copy in zip((case.t.q, case.t.qd, case.x), given, strict=True))


VECTORS = ("m_rate_transposed", "coriolis_bracket", "mass_matrix_rate_times", "coriolis_product")
LINK_METHODS = {
    "wrench_factor": lambda dyn, q, link, **more: dyn.wrench_factor(q, link, **more),
    "epsilon_from_wrench": lambda dyn, q, link, **more: dyn.epsilon_from_wrench(q, link, np.ones(6), **more),
    "operational_inverse_inertia": lambda dyn, q, link, **more: dyn.operational_inverse_inertia(q, link, **more),
    "reflected_mass": lambda dyn, q, link, **more: dyn.reflected_mass(q, link, (0, 0, 1), **more),
}


def spoiled(x, entry):
    """Return a copy with one entry replaced."""
    out = np.array(x)
    out[3] = entry
    return out


@pytest.mark.parametrize("entry", [np.nan, np.inf, -np.inf])
def test_not_finite(panda, entry):
    """A number that is none is refused; argument and joint are named."""
    q, qd, x = np.zeros((3, panda.model.nv)) + 0.3
    name = panda.model.dof_names[3]
    for method in VECTORS:
        call = getattr(panda.dyn, method)
        for arguments, argument in (
            ((spoiled(q, entry), qd, x), "q"),
            ((q, spoiled(qd, entry), x), "qd"),
            ((q, qd, spoiled(x, entry)), "x"),
        ):
            with pytest.raises(dd.InputError, match=rf"^{argument} of joint '{name}'"):
                call(*arguments)
    for call in (panda.dyn.mass_matrix_rate, panda.dyn.log_det_rate):
        with pytest.raises(dd.InputError, match=f"^q of joint '{name}'"):
            call(spoiled(q, entry), qd)
        with pytest.raises(dd.InputError, match=f"^qd of joint '{name}'"):
            call(q, spoiled(qd, entry))
    for call in (panda.dyn.log_det, *(lambda q, c=c: c(panda.dyn, q, "panda_hand") for c in LINK_METHODS.values())):
        with pytest.raises(dd.InputError, match=f"^q of joint '{name}'"):
            call(spoiled(q, entry))


def test_wrong_shape(panda):
    """A vector of another size, a matrix or a text is refused; the argument is named."""
    right = np.zeros(panda.model.nv) + 0.3
    for wrong in (right[:-1], np.append(right, 0), right[:, None], "abc", None, 0.3):
        for method in VECTORS:
            for at, argument in enumerate(("q", "qd", "x")):
                arguments = [right, right, right]
                arguments[at] = wrong
                with pytest.raises(dd.InputError, match=f"^{argument} "):
                    getattr(panda.dyn, method)(*arguments)
        for call in (panda.dyn.mass_matrix_rate, panda.dyn.log_det_rate):
            with pytest.raises(dd.InputError, match=r"^q "):
                call(wrong, right)
            with pytest.raises(dd.InputError, match=r"^qd "):
                call(right, wrong)
        for call in (panda.dyn.log_det, *(lambda q, c=c: c(panda.dyn, q, "panda_hand") for c in LINK_METHODS.values())):
            with pytest.raises(dd.InputError, match=r"^q "):
                call(wrong)


@pytest.mark.parametrize("method", LINK_METHODS)
def test_wrong_link_point_or_frame(panda, method):
    """What is wrong of a link, a point of it and axes is named."""
    q, call = np.zeros(panda.model.nv), LINK_METHODS[method]
    for unknown in ("nowhere", "", "panda_joint1"):
        with pytest.raises(dd.InputError, match=f"link.*{unknown!r}|{unknown!r}.*link"):
            call(panda.dyn, q, unknown)
    for unknown in (None, 3, ["panda_hand"]):
        with pytest.raises(dd.InputError, match="link"):
            call(panda.dyn, q, unknown)
    for wrong in ((0, 0), (0, 0, 0, 0), (0, np.nan, 0), (np.inf, 0, 0), "abc", None, np.zeros((1, 3))):
        with pytest.raises(dd.InputError, match="point"):
            call(panda.dyn, q, "panda_hand", point=wrong)
    for wrong in ("base", None, "Link"):
        with pytest.raises(dd.InputError, match="frame"):
            call(panda.dyn, q, "panda_hand", frame=wrong)


def test_wrong_wrench_or_direction(panda):
    """A wrench is six finite numbers, a direction three that are not all zero."""
    q = np.zeros(panda.model.nv)
    for wrong in (np.zeros(5), np.zeros(7), np.zeros((6, 1)), (0, 0, 0, np.nan, 0, 0), [np.inf] * 6, "abcdef", None):
        with pytest.raises(dd.InputError, match="wrench"):
            panda.dyn.epsilon_from_wrench(q, "panda_hand", wrong)
    for wrong in ((0, 0, 0), (0, 0), (0, 0, 1, 0), (0, np.nan, 1), (np.inf, 0, 0), "abc", None, np.ones((3, 1))):
        with pytest.raises(dd.InputError, match="direction"):
            panda.dyn.reflected_mass(q, "panda_hand", wrong)


def test_direction_of_any_length(panda):
    """A direction has no length that matters, the smallest and largest numbers there are among them."""
    q, direction = panda.cases[0].t.q, np.array([1.0, -2.0, 2.0])
    expected = panda.dyn.reflected_mass(q, "panda_hand", direction)
    for length in (1e-300, 1e-12, 1e12, 1e300):
        assert panda.dyn.reflected_mass(q, "panda_hand", length * direction) == pytest.approx(expected, rel=1e-13)


TOO_LARGE = {
    **{
        f"point in {name}": lambda dyn, q, call=call: call(dyn, q, "panda_hand", point=(1e308, 1e308, -1e308))
        for name, call in LINK_METHODS.items()
    },
    "square of a point": lambda dyn, q: dyn.operational_inverse_inertia(q, "panda_hand", (1e200, 0, 0)),
    "square of a point's mobility": lambda dyn, q: dyn.reflected_mass(q, "panda_hand", (0, 0, 1), (1e200, 0, 0)),
    "wrench": lambda dyn, q: dyn.epsilon_from_wrench(q, "panda_hand", np.full(6, 1e308)),
    "qd in mass_matrix_rate": lambda dyn, q: dyn.mass_matrix_rate(q, np.full(len(q), 1e308)),
    "qd in log_det_rate": lambda dyn, q: dyn.log_det_rate(q, np.full(len(q), 1e308)),
    **{
        f"qd and x in {method}": lambda dyn, q, method=method: getattr(dyn, method)(q, *np.full((2, len(q)), 1e200))
        for method in VECTORS
    },
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("call", TOO_LARGE)
def test_too_large_is_said(panda, call):
    """What overflows is refused, never answered with numbers that are none."""
    with pytest.raises(dd.InputError):
        TOO_LARGE[call](panda.dyn, np.full(panda.model.nv, 0.3))


def test_singular():
    """Where M is singular the factor's answers name the joint; what needs no factor is answered all the same."""
    robot = robots.robot(ICUB)
    dyn = dd.DiagonalDynamics(dd.load_urdf(robot.source, mimic="free"))
    zero = np.zeros(dyn.model.nv)
    link_ = dyn.model.link_names[-1]
    for call in (
        lambda: dyn.m_rate_transposed(zero, zero, zero),
        lambda: dyn.coriolis_bracket(zero, zero, zero),
        lambda: dyn.log_det(zero),
        lambda: dyn.log_det_rate(zero, zero),
        *(lambda c=c: c(dyn, zero, link_) for c in LINK_METHODS.values()),
    ):
        with pytest.raises(dd.SingularMassMatrixError, match="neck_roll") as error:
            call()
        assert error.value.joint == "neck_roll"
    oracle, (qd, x) = (
        RateOracle(robot.urdf, dyn.model.dof_names),
        np.random.default_rng(2).standard_normal((2, len(zero))),
    )
    C_s = oracle.coriolis_matrix(zero, qd)
    assert_close(dyn.coriolis_product(zero, qd, x), C_s @ x, 1e-12, norm(C_s) * norm(x))
    assert_close(dyn.mass_matrix_rate(zero, qd), C_s + C_s.T, 1e-12, norm(C_s))
    assert_close(dyn.mass_matrix_rate_times(zero, qd, x), (C_s + C_s.T) @ x, 1e-12, norm(C_s) * norm(x))


def test_orientation_is_checked():
    """A quaternion of another length than 1 is none of a floating base."""
    robot = robots.robot(PANDA).floating
    dyn = dd.DiagonalDynamics(dd.load_urdf(robot.source, mimic="free", floating_base=True))
    q, qd = dyn.model.neutral, np.ones(dyn.model.nv)
    q[3:7] = 0.7
    for method in VECTORS:
        with pytest.raises(dd.InputError, match=r"root_joint.*quaternion"):
            getattr(dyn, method)(q, qd, qd)
    for call in (dyn.log_det, *(lambda q, c=c: c(dyn, q, "panda_hand") for c in LINK_METHODS.values())):
        with pytest.raises(dd.InputError, match=r"root_joint.*quaternion"):
            call(q)
