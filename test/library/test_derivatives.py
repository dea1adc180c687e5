# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rates of change and operational space: ṁᵀx, B, dM/dt, C_s, Ḋ, ln det M, ℓJᵀ. Each against
Pinocchio, or by its law.

A law is a function of a `Case`. Robots, coupled ones among them, and random trees go through the
same laws. The library is its own referee only where a law says so.
"""

import zlib
from typing import NamedTuple

import numpy as np
import pytest
import test_random_trees as trees
from hypothesis import given, note

import diag_dynamics as dd
import robots
from accuracy import EPS, assert_close, norm, tolerance
from coupling import NAMED, Coupled, with_payloads
from derivative_oracles import (
    CoupledRates,
    RateOracle,
    bracket,
    bracket_scale,
    carriers,
    coriolis_scale,
    jacobian,
    rate_oracle_of,
)
from described import PANDA
from examples import examples
from oracles import State

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")


# --- cases


class Case(NamedTuple):
    """One robot in one state, the oracle's truth beside the library."""

    dyn: dd.DiagonalDynamics
    oracle: RateOracle | CoupledRates
    t: State
    s: object  # evaluate
    x: np.ndarray  # a rate-like vector of which every entry weighs alike
    y: np.ndarray  # another
    unit: np.ndarray  # √M_kk
    size: float  # of the terms that make B [1/s]
    weight: float  # of the terms that make C_s, in units in which M_kk = 1 [1/s]
    tolerance: float
    points: tuple  # (link, point of it, axes, direction)


def case_of(dyn, oracle, q, qd, tau, seed):
    """Return the case of one state, with vectors and points drawn from a seed."""
    rng = np.random.default_rng(seed)
    t = oracle.at(q, qd, tau)
    unit = np.sqrt(np.diag(t.M))
    x, y = rng.standard_normal((2, len(unit))) / unit
    names = dyn.model.link_names
    chosen = dict.fromkeys((names[0], names[-1], *map(str, rng.choice(names, 3))))
    points = [
        (name, rng.uniform(-0.5, 0.5, 3), frame) for name in chosen for frame in ("link", "world")
    ]
    points.append((names[-1], np.zeros(3), "link"))
    points = tuple((*point, rng.standard_normal(3)) for point in points)
    numbers = bracket_scale(t), coriolis_scale(t), tolerance(t)
    return Case(dyn, oracle, t, dyn.evaluate(q, qd, tau), x, y, unit, *numbers, points)


def load(robot):
    """Return the cases of a robot's samples."""
    model = dd.load_urdf(robot.source, mimic=robot.mimic, **robot.options)
    dyn = dd.DiagonalDynamics(model)
    oracle = rate_oracle_of(robot, model.dof_names)
    seed = zlib.crc32(robot.id.encode())
    samples = robots.samples(robot.id, oracle)
    return [case_of(dyn, oracle, s.q, s.qd, s.tau, (seed, i)) for i, s in enumerate(samples)]


OUTBOARD = NAMED["leader outboard of its follower"]._replace(mimic="embed")


@pytest.fixture(scope="module", params=(*robots.robots_to_test(), OUTBOARD))
def cases(request):
    """Return the cases of each robot in turn; module scope, so that all laws share one
    evaluation.
    """
    return load(request.param)


@pytest.fixture(scope="module")
def panda():
    """Return one state of the robot of the tests that need only one."""
    return load(robots.robot(PANDA))[1]


def columns(function, n):
    """Return the matrix of a linear function."""
    return np.column_stack([function(e) for e in np.eye(n)]) if n else np.zeros((0, 0))


# --- ṁᵀx


def floor(c):
    """Return 10⁻² of how fast M changes [1/s], for what vanishes by cancellation or always; see
    `State.coriolis_scale`.
    """
    return 1e-2 * max(c.size, norm(c.t.qd))


def rate_scale(c, x):
    """Return |ṁᵀx|, or what stands in where that is rounding only."""
    return max(norm(c.t.mdot.T @ x), floor(c) * norm(c.t.m.T @ x))


def m_rate_transposed_times(c):
    """ṁᵀx, ṁ from Pinocchio's Ṁ and factor (eq. A.30)."""
    for x in (c.x, c.y, c.t.qd):
        actual = c.dyn.m_rate_transposed_times(c.t.q, c.t.qd, x)
        assert_close(actual, c.t.mdot.T @ x, c.tolerance, rate_scale(c, x))


# --- B(q, ν)x


def bracket_columns(c):
    """Return the library's B."""
    return columns(lambda e: c.dyn.coriolis_bracket_times(c.t.q, c.t.qd, e), c.dyn.model.nv)


def coriolis_bracket_times(c):
    """B x, B = ℓ (C_s − m ṁᵀ) ℓᵀ with Pinocchio's C_s."""
    B = bracket(c.t)
    for x in (c.x * c.unit, c.y * c.unit, c.t.nu):
        scale = c.size * norm(x)
        assert_close(c.dyn.coriolis_bracket_times(c.t.q, c.t.qd, x), B @ x, c.tolerance, scale)


def bracket_is_skew(c):
    """B + Bᵀ = 0, entry by entry: B is the bracket of Identity 7.1, and Lemma 7.1 is its νᵀBν =
    0.
    """
    B = bracket_columns(c)
    assert_close(B + B.T, np.zeros_like(B), max(1e-12, EPS * c.t.scaled_condition), c.size)
    for x in (c.x * c.unit, c.t.nu):
        work = x @ c.dyn.coriolis_bracket_times(c.t.q, c.t.qd, x)
        assert_close(work, 0.0, max(1e-12, EPS * c.t.scaled_condition), c.size * x @ x)


# --- dM/dt and C_s


def mass_matrix_rate(c):
    """dM/dt = C_s + C_sᵀ of Pinocchio, both triangles alike."""
    weigh = np.outer(c.unit, c.unit)
    actual = c.dyn.mass_matrix_rate(c.t.q, c.t.qd)
    assert_close(actual / weigh, (c.t.C_s + c.t.C_s.T) / weigh, 1e-12, 2 * c.weight)
    assert (actual == actual.T).all()


def coriolis_matrix_times(c):
    """C_s x with Pinocchio's C_s, and the classical bias where x = q̇."""
    scale = c.weight
    for x in (c.x, c.y, c.t.qd):
        actual = c.dyn.coriolis_matrix_times(c.t.q, c.t.qd, x) / c.unit
        assert_close(actual, c.t.C_s @ x / c.unit, 1e-12, scale * norm(x * c.unit))
    for bias in (c.t.c, c.dyn.coriolis_torque(c.t.q, c.t.qd)):
        assert_close(actual, bias / c.unit, 1e-12, scale * norm(c.t.qd * c.unit))


def momentum(c):
    """M q̇, and C_sᵀq̇ − g, with Pinocchio's M, C_s and g."""
    p, rate = c.dyn.momentum(c.t.q, c.t.qd)
    size = norm(c.t.qd * c.unit)
    assert_close(p / c.unit, c.t.M @ c.t.qd / c.unit, 1e-12, size)
    scale = c.weight * size + norm(c.t.g / c.unit)
    assert_close(rate / c.unit, (c.t.C_s.T @ c.t.qd - c.t.g) / c.unit, 1e-12, scale)


# --- D and ln det M


def inertia_rate(c):
    """Ḋ of Pinocchio's factor."""
    scale = max(norm(c.t.Ddot / c.t.D), floor(c))
    assert_close(c.s.articulated_inertia_rate / c.t.D, c.t.Ddot / c.t.D, c.tolerance, scale)


def log_determinant(c):
    """Ln det M = Σ ln D_k, of Pinocchio's M."""
    actual = c.dyn.log_det(c.t.q)
    assert isinstance(actual, float)
    assert_close(
        actual, np.linalg.slogdet(c.t.M)[1], c.tolerance, c.dyn.model.nv + norm(np.log(c.t.D))
    )
    assert_close(
        actual,
        np.log(c.s.articulated_inertia).sum(),
        c.tolerance,
        c.dyn.model.nv + norm(np.log(c.t.D)),
    )


def log_determinant_rate(c):
    """d/dt ln det M = tr M⁻¹Ṁ = Σ Ḋ_k/D_k."""
    actual = c.dyn.log_det_rate(c.t.q, c.t.qd)
    assert isinstance(actual, float)
    shares = np.diag(np.linalg.solve(c.t.m, np.linalg.solve(c.t.m, c.t.C_s + c.t.C_s.T).T))
    scale = max(norm(shares, 1), floor(c))
    assert_close(actual, shares.sum(), c.tolerance, scale)
    assert_close(
        actual, (c.s.articulated_inertia_rate / c.s.articulated_inertia).sum(), c.tolerance, scale
    )


# --- ℓJᵀ


def wrench_factor(c):
    """ℓJᵀ, J from Pinocchio's frames, at points beside the link's origin, in axes of link and
    world.
    """
    for name, point, frame, _ in c.points:
        J = jacobian(c.oracle, c.t.q, name, point, frame)
        actual = c.dyn.wrench_factor(c.t.q, name, point, frame=frame)
        assert_close(actual, np.linalg.solve(c.t.m, J.T), c.tolerance)


def wrench_factor_is_zero_off_the_path(c):
    """Rows of joints that do not carry the link are 0 exactly; the root of a fixed base feels
    nothing at all.
    """
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


LAWS = (
    m_rate_transposed_times,
    coriolis_bracket_times,
    bracket_is_skew,
    mass_matrix_rate,
    coriolis_matrix_times,
    momentum,
    inertia_rate,
    log_determinant,
    log_determinant_rate,
    wrench_factor,
    wrench_factor_is_zero_off_the_path,
    epsilon_of_a_wrench,
    operational_inertia,
    reflected_mass,
)


@pytest.mark.parametrize("law", LAWS)
def test_law(cases, law):
    """Each law, for each robot."""
    for case in cases:
        law(case)


def check(shape, laws=LAWS):
    """Check laws on the tree of a shape."""
    tree = trees.Tree(shape)
    note(tree.urdf)
    model = dd.load_urdf(tree.urdf, payloads=tree.payloads, **tree.options)
    if model.nv == 0:
        return
    oracle = RateOracle(with_payloads(tree.urdf, tree.payloads), model.dof_names, **tree.options)
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
    """Up to ten joints of every kind, planar and floating ones inside the tree, armature, locked
    joints, payloads.
    """
    check(shape)


# --- the interface's promises


HAND = "panda_hand"
VECTORS = (
    "m_rate_transposed_times",
    "coriolis_bracket_times",
    "coriolis_matrix_times",
)
CALLS = {
    **dict.fromkeys(VECTORS, ("q", "qd", "x")),
    **dict.fromkeys(("mass_matrix_rate", "log_det_rate"), ("q", "qd")),
    "log_det": ("q",),
    "wrench_factor": ("q", "link"),
    "epsilon_from_wrench": ("q", "link", "wrench"),
    "operational_inverse_inertia": ("q", "link"),
    "reflected_mass": ("q", "link", "direction"),
}
"""Of each method the names of its arguments; the last four take point and frame, too."""
N = 9
"""Degrees of freedom of the Panda, its fingers independent."""
RIGHT = {
    **dict.fromkeys(("q", "qd", "x"), np.full(N, 0.3)),
    "link": HAND,
    "wrench": np.ones(6),
    "direction": (0, 0, 1),
}
NUMBERS = ("abc", None, 0.3)
WRONG = {
    **dict.fromkeys(
        ("q", "qd", "x"), (np.zeros(N - 1), np.zeros(N + 1), np.zeros((N, 1)), *NUMBERS)
    ),
    "link": ("nowhere", "", "panda_joint1", None, 3, [HAND]),
    "wrench": (np.zeros(5), np.zeros((6, 1)), (0, 0, 0, np.nan, 0, 0), [np.inf] * 6, *NUMBERS),
    "direction": (
        (0, 0, 0),
        (0, 0, 1, 0),
        (0, np.nan, 1),
        (np.inf, 0, 0),
        np.ones((3, 1)),
        *NUMBERS,
    ),
    "point": ((0, 0), (0, np.nan, 0), (np.inf, 0, 0), np.zeros((1, 3)), *NUMBERS),
    "frame": ("base", None, "Link"),
}


def call(dyn, method, **changed):
    """Call a method with arguments that are right but for those given."""
    arguments = [changed.pop(name, RIGHT[name]) for name in CALLS[method]]
    return getattr(dyn, method)(*arguments, **changed)


@pytest.mark.parametrize("method", CALLS)
def test_wrong_arguments_are_named(panda, method):
    """The error names the argument, and the joint of an entry that is not finite."""
    names = CALLS[method] + (("point", "frame") if "link" in CALLS[method] else ())
    for name in names:
        for wrong in WRONG[name]:
            with pytest.raises(dd.InputError, match=rf"\b{name}\b"):
                call(panda.dyn, method, **{name: wrong})
    for name in {"q", "qd", "x"} & set(names):
        for entry in (np.nan, np.inf, -np.inf):
            with pytest.raises(dd.InputError, match=f"^{name} of joint 'panda_joint4'"):
                call(panda.dyn, method, **{name: np.where(np.arange(N) == 3, entry, 0.3)})


FAR = (1e308, 1e308, -1e308)
TOO_LARGE = [
    *((method, {"point": FAR}) for method in CALLS if "link" in CALLS[method]),
    ("operational_inverse_inertia", {"point": (1e200, 0, 0)}),
    ("reflected_mass", {"point": (1e200, 0, 0)}),
    ("epsilon_from_wrench", {"wrench": np.full(6, 1e308)}),
    *((method, {"qd": np.full(N, 1e308)}) for method in ("mass_matrix_rate", "log_det_rate")),
    *((method, dict.fromkeys(("qd", "x"), np.full(N, 1e200))) for method in VECTORS),
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("method", "large"), TOO_LARGE)
def test_overflow_is_an_error(panda, method, large):
    with pytest.raises(dd.InputError, match=r"too large|overflow"):
        call(panda.dyn, method, **large)
