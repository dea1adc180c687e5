# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The laws of diagonalized dynamics over robots in one state, the library's answers beside the
oracle's.

A law is a function of a `Case`. Errors are measured in the units of ν (√J), in which all dofs weigh
alike: rates times √M_kk, torques over it.
"""

from typing import NamedTuple

import numpy as np

import diag_dynamics as dd
import robots
from accuracy import assert_close, norm, tolerance
from coupling import Coupled, oracle_of
from oracles import Oracle, State


class Case(NamedTuple):
    """One robot in one state: the oracle's truth beside the library's answers."""

    dyn: dd.DiagonalDynamics
    t: State
    sample: robots.Sample
    s: object  # evaluate
    f: object  # factors
    unit: np.ndarray  # √M_kk
    tolerance: float
    rounding: float  # of sums that vanish

    @property
    def model(self):
        """Return the library's model."""
        return self.dyn.model

    @property
    def oracle(self):
        """Return the robot in the oracle."""
        return self.t.oracle


def case_of(
    dyn,
    oracle,
    sample,
    rounding=1e-12,
):
    """Evaluate one state."""
    t = oracle.at(sample.q, sample.qd, sample.tau)
    s = dyn.evaluate(sample.q, sample.qd, sample.tau)
    f = dyn.factors(sample.q)
    return Case(dyn, t, sample, s, f, np.sqrt(np.diag(t.M)), tolerance(t), rounding)


class Robot(NamedTuple):
    """A robot, its oracle, and its cases."""

    id: str
    model: object
    dyn: dd.DiagonalDynamics
    oracle: Oracle | Coupled
    cases: list[Case]


def load(robot, **more):
    """Load a robot in library and oracle, and evaluate its samples."""
    model = dd.load_urdf(robot.source, mimic=robot.mimic, **robot.options, **more)
    dyn = dd.DiagonalDynamics(model)
    oracle = oracle_of(robot, model.dof_names, **more)
    return Robot(
        robot.id,
        model,
        dyn,
        oracle,
        [case_of(dyn, oracle, s) for s in robots.samples(robot.id, oracle)],
    )


def assert_same(actual, expected):
    """Two mappings from names to numbers or arrays agree to the bit."""
    for name, value in expected.items():
        assert (np.asarray(actual[name]) == np.asarray(value)).all(), name


FIELDS = (
    "nu",
    "xi",
    "epsilon",
    "kappa",
    "coriolis",
    "coriolis_unnormalized",
    "gravity",
    "articulated_inertia",
    "kinetic_energy",
    "energy_share",
    "link_energy",
    "power",
)


def fields(s, *without):
    """Return an evaluation's quantities by name."""
    return {name: getattr(s, name) for name in FIELDS if name not in without}


def everything(dyn, sample):
    """Return every answer of the API at one state."""
    q, qd, tau, qdd = sample
    s = dyn.evaluate(q, qd, tau)
    f = dyn.factors(q)
    tip = dyn.model.link_names[-1]
    at = {"point": (0.1, -0.2, 0.3), "frame": "world"}
    return {
        **fields(s),
        "articulated_inertia_rate": s.articulated_inertia_rate,
        **{name: getattr(f, name) for name in ("m", "l", "unit", "D")},
        **{name: getattr(dyn, name)(q) for name in ("mass_matrix", "gravity_torque", "log_det")},
        **{
            name: getattr(dyn, name)(q, qd)
            for name in ("coriolis_torque", "mass_matrix_rate", "log_det_rate")
        },
        **{name: getattr(dyn, name)(q, tau) for name in ("epsilon_from_tau", "tau_from_epsilon")},
        **{name: getattr(dyn, name)(q, qd) for name in ("nu_from_qd", "qd_from_nu")},
        **{
            f"{name}_times": getattr(dyn, f"{name}_times")(q, qd, qdd)
            for name in ("m_rate_transposed", "coriolis_bracket", "coriolis_matrix")
        },
        "momentum": np.concatenate(dyn.momentum(q, qd)),
        "forward_dynamics": dyn.forward_dynamics(q, qd, tau),
        "inverse_dynamics": dyn.inverse_dynamics(q, qd, qdd),
        "wrench_factor": dyn.wrench_factor(q, tip, **at),
        "epsilon_from_wrench": dyn.epsilon_from_wrench(q, tip, (1, -2, 3, -4, 5, -6), **at),
        "operational_inverse_inertia": dyn.operational_inverse_inertia(q, tip, **at),
        "reflected_mass": dyn.reflected_mass(q, tip, (1, 2, 3), **at),
    }


# --- the laws


def upper_rates(M, qd):
    """Return ν = mᵀq̇ with m the upper Cholesky factor of M."""
    return np.linalg.cholesky(M[::-1, ::-1])[::-1, ::-1].T @ qd


def unnormalized_scale(t):
    """Return the size of the terms of D^−½C_ξ."""
    return t.coriolis_scale + norm(t.Ddot * t.xi / np.sqrt(t.D))


def xi_dot_is(s, t, tolerance, scale):
    """The library's ξ̇ is d/dt D^−½ν along aba's acceleration."""
    root = np.sqrt(t.D)
    expected = t.nu_dot - 0.5 * t.Ddot / root * t.xi
    assert_close(root * s.xi_dot, expected, tolerance, scale + unnormalized_scale(t))


def wrenches_on(model, seed):
    """Return wrenches on the root, a tip and some other links, those without inertia among them."""
    rng = np.random.default_rng(seed)
    names = dict.fromkeys(
        (model.link_names[0], model.link_names[-1], *map(str, rng.choice(model.link_names, 4)))
    )
    return {name: 10 * rng.standard_normal(6) for name in names}


def m_is_the_udu_factor(c):
    """m = U √D, unit = U, D = D of Pinocchio's Cholesky decomposition, row by row."""
    assert_close(c.f.m / c.unit[:, None], c.t.m / c.unit[:, None], c.tolerance)
    assert_close(c.f.unit * np.sqrt(c.t.D) / c.unit[:, None], c.t.m / c.unit[:, None], c.tolerance)
    assert_close(c.f.D / c.t.D, np.ones_like(c.t.D), c.tolerance)
    assert (c.s.articulated_inertia == c.f.D).all()


def m_factors_the_mass_matrix(c):
    """M = m mᵀ, with M of the library, of Pinocchio, and of the factors; both triangles of M are
    alike.
    """
    M = c.dyn.mass_matrix(c.t.q)
    scale = np.outer(c.unit, c.unit)
    assert_close(c.f.m @ c.f.m.T / scale, c.t.M / scale, 1e-12)
    assert_close(c.f.unit * c.f.D @ c.f.unit.T / scale, c.t.M / scale, 1e-12)
    assert_close(M / scale, c.t.M / scale, 1e-12)
    assert (M == M.T).all()


def l_inverts_m(c):
    """ℓ m = m ℓ = I, and ℓᵀℓ = M⁻¹."""
    identity = np.eye(c.model.nv)
    assert_close(c.f.l @ c.f.m, identity, c.tolerance)
    assert_close((c.f.m @ c.f.l) * c.unit / c.unit[:, None], identity, c.tolerance)
    assert_close(c.f.l @ c.t.m, identity, c.tolerance)


def factors_have_the_sparsity_of_the_tree(c):
    """m[i, j] ≠ 0 only where i = j or i is an ancestor of j: exact zeros elsewhere. So for ℓ."""
    if isinstance(c.oracle, Coupled):
        return
    nv = c.model.nv
    allowed = np.eye(nv, dtype=bool)
    for k in range(nv):
        allowed[list(c.oracle.ancestors(k)), k] = True
    for factor in (c.f.m, c.f.unit, c.f.l):
        assert (factor[~allowed] == 0).all()
        assert (np.triu(factor) == factor).all()
    assert (np.diag(c.f.unit) == 1).all()
    assert (c.f.D > 0).all()


def total_joint_rates(c):
    """ν = mᵀ q̇ and ξ = D^−½ ν."""
    assert_close(c.s.nu, c.t.nu, c.tolerance)
    assert_close(np.sqrt(c.t.D) * c.s.xi, c.t.nu, c.tolerance)
    assert_close(np.sqrt(c.s.articulated_inertia) * c.s.xi, c.s.nu, 1e-15)


def working_moments(c):
    """ε = ℓ τ and κ = D^½ ε."""
    assert_close(c.s.epsilon, c.t.epsilon, c.tolerance)
    assert_close(c.s.kappa / np.sqrt(c.t.D), c.t.kappa / np.sqrt(c.t.D), c.tolerance)
    assert_close(c.s.kappa / np.sqrt(c.s.articulated_inertia), c.s.epsilon, 1e-15)


def gravity(c):
    """ε_g = ℓ g and g. Where gravity has no moment at all, relative to √mass·|g|, which bounds
    |ε_g|.
    """
    scale = np.sqrt(c.oracle.mass) * norm(c.model.gravity)
    assert_close(c.s.gravity, c.t.gravity, c.tolerance, max(norm(c.t.gravity), 1e-3 * scale))
    g = c.dyn.gravity_torque(c.t.q) / c.unit
    expected = c.t.g / c.unit
    assert_close(g, expected, c.tolerance, max(norm(expected), 1e-3 * scale))


def energy(c):
    """K = ½ q̇ᵀM q̇; ½ν_k² are its shares."""
    K = c.t.kinetic_energy
    assert_close(c.s.kinetic_energy, K, 1e-12)
    assert_close(c.s.energy_share, 0.5 * c.s.nu**2, 1e-15)
    assert_close(c.s.energy_share.sum(), K, 1e-12)


def link_energy(c):
    """Each URDF link's own ½VᵀIV, armature counted where it moves; they sum to K."""
    assert_close(c.s.link_energy, [c.t.link_energy[n] for n in c.model.link_names], 1e-12)
    assert_close(c.s.link_energy.sum(), c.t.kinetic_energy, 1e-12)
    assert (c.s.link_energy >= 0).all()


def base_energy(c):
    """The shares of a floating base's six dofs sum to ½V*ᵀPV*, whatever the order of its twist's
    components.
    """
    if not c.model.floating_base:
        assert c.s.base_energy == 0.0
        return
    angular_first = np.r_[3:6, 0:3, 6 : c.model.nv]
    nu = upper_rates(c.t.M[np.ix_(angular_first, angular_first)], c.t.qd[angular_first])
    assert_close(c.s.base_energy, 0.5 * nu[:6] @ nu[:6], c.tolerance)
    assert_close(c.s.base_energy, c.s.energy_share[:6].sum(), 1e-15)
    assert 0 < c.s.base_energy <= c.t.kinetic_energy * (1 + 1e-12)


def coriolis(c):
    """C = ℓc − ṁᵀq̇, ṁ from Pinocchio's Coriolis matrix."""
    assert_close(c.s.coriolis, c.t.coriolis, c.tolerance, c.t.coriolis_scale)


def coriolis_unnormalized(c):
    """C_ξ of Lemma 7.3."""
    root = np.sqrt(c.t.D)
    expected = c.t.coriolis_unnormalized / root
    assert_close(c.s.coriolis_unnormalized / root, expected, c.tolerance, unnormalized_scale(c.t))


def coriolis_does_no_work(c):
    """νᵀC = 0 (Lemma 7.1)."""
    assert_close(c.s.nu @ c.s.coriolis, 0.0, c.rounding, norm(c.s.nu) * c.t.coriolis_scale)


def coriolis_torque(c):
    """The classical torque c without gravity."""
    scale = max(norm(c.t.c / c.unit), 1e-3 * norm(c.t.nu) * norm(c.t.qd))
    assert_close(c.dyn.coriolis_torque(c.t.q, c.t.qd) / c.unit, c.t.c / c.unit, c.tolerance, scale)


def inverse_dynamics(c):
    """τ of rnea, gravity included."""
    tau = c.oracle.inverse_dynamics(c.t.q, c.t.qd, c.sample.qdd)
    assert_close(
        c.dyn.inverse_dynamics(c.t.q, c.t.qd, c.sample.qdd) / c.unit, tau / c.unit, c.tolerance
    )


def forward_dynamics(c):
    """q̈ of aba, gravity included; the library's inverse dynamics undoes its forward dynamics."""
    actual = c.dyn.forward_dynamics(c.t.q, c.t.qd, c.t.tau)
    assert_close(actual * c.unit, c.t.acceleration * c.unit, c.tolerance)
    qdd = c.sample.qdd
    again = c.dyn.forward_dynamics(c.t.q, c.t.qd, c.dyn.inverse_dynamics(c.t.q, c.t.qd, qdd))
    assert_close(again * c.unit, qdd * c.unit, c.tolerance)


def equation_of_motion(c):
    """ν̇ + C + ε_g = ε along aba's acceleration; the library's ν̇ is that, and ξ̇ = d/dt D^−½ν."""
    terms = c.t.nu_dot, c.s.coriolis, c.s.gravity
    assert_close(sum(terms), c.s.epsilon, c.tolerance, sum(map(norm, (*terms, c.s.epsilon))))
    scale = norm(c.s.epsilon) + norm(c.s.gravity) + c.t.coriolis_scale
    assert_close(c.s.nu_dot, c.t.nu_dot, c.tolerance, scale)
    xi_dot_is(c.s, c.t, c.tolerance, scale)


def power(c):
    """K̇ = νᵀ(ε − ε_g) (Lemma 7.2) is what aba's acceleration makes of ½q̇ᵀMq̇; νᵀε = q̇ᵀτ."""
    s = c.s
    t = c.t
    scale = norm(s.nu) * (norm(s.epsilon) + norm(s.gravity) + t.coriolis_scale)
    assert_close(s.power, t.power, c.tolerance, scale)
    assert_close(s.power, s.nu @ (s.epsilon - s.gravity), 1e-14, scale)
    assert_close(s.effort_power, s.power, 1e-14, scale)
    assert_close(s.nu @ s.epsilon, t.qd @ t.tau, c.tolerance, norm(s.nu) * norm(s.epsilon))


def external_wrenches(c):
    """ℓJᵀf, q̈, τ and K̇ with wrenches, Jᵀ from Pinocchio's frames; nothing else changes."""
    wrenches = wrenches_on(c.model, c.model.nv)
    for frame in ("link", "world"):
        q, qd, tau, qdd = c.sample
        t = c.t
        effort = c.oracle.effort_of(q, wrenches, frame)
        s = c.dyn.evaluate(q, qd, tau, wrenches, frame=frame)
        expected = np.linalg.solve(t.m, effort)
        scale = max(
            norm(expected), norm(t.epsilon)
        )  # wrenches on a robot that is one joint may do nothing
        assert_close(s.external, expected, c.tolerance, scale)
        assert_same(fields(s), fields(c.s, "power"))
        # s.epsilon is that of τ alone; the equation of motion has the wrenches as a further term
        loaded = c.oracle.at(q, qd, tau + effort)
        actual = c.dyn.forward_dynamics(q, qd, tau, wrenches, frame=frame)
        assert_close(actual * c.unit, loaded.acceleration * c.unit, c.tolerance)
        rnea = c.oracle.inverse_dynamics(q, qd, qdd)
        actual = c.dyn.inverse_dynamics(q, qd, qdd, wrenches, frame=frame)
        scale = norm(rnea / c.unit) + norm(effort / c.unit)
        assert_close(actual / c.unit, (rnea - effort) / c.unit, c.tolerance, scale)
        terms = (loaded.nu_dot, s.coriolis, s.gravity, s.epsilon, s.external)
        assert_close(sum(terms[:3]), s.epsilon + s.external, c.tolerance, sum(map(norm, terms)))
        assert_close(s.nu_dot, loaded.nu_dot, c.tolerance, sum(map(norm, terms)))
        xi_dot_is(s, loaded, c.tolerance, sum(map(norm, terms)))
        scale = norm(s.nu) * (sum(map(norm, terms[2:])) + t.coriolis_scale)
        assert_close(s.power, loaded.power, c.tolerance, scale)


def friction(c):
    """Damping and Coulomb friction of the URDF, only on request, against Pinocchio driven by τ −
    τ_fric.

    Mimic joints brake their source joints: GᵀdG and |G|ᵀf.
    """
    model = c.model
    oracle = c.oracle
    full = getattr(oracle, "full", oracle)
    G = getattr(oracle, "G", np.eye(model.nv))
    elements = {
        element.get("name"): element.find("dynamics") for element in oracle.xml.findall("joint")
    }

    def numbers(name):
        values = [
            elements[joint].get(name) if elements.get(joint) is not None else 0
            for joint in full.joint_of_dof
        ]
        return np.array([float(value or 0) for value in values])

    damping = (G**2).T @ numbers("damping")
    coulomb = np.abs(G).T @ numbers("friction")
    q, qd, tau, qdd = c.sample
    t = c.t
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
    assert_close(s.nu_dot, slowed.nu_dot, c.tolerance, sum(map(norm, terms)))
    assert_close(
        s.power, slowed.power, c.tolerance, norm(s.nu) * (sum(map(norm, terms)) + t.coriolis_scale)
    )


def inverse_mass_matrix(c):
    """M⁻¹ by ℓᵀℓ is that by a dense solve with Pinocchio's M."""
    scale = np.outer(c.unit, c.unit)
    expected = np.linalg.solve(c.t.M / scale, np.eye(c.model.nv))
    assert_close(c.dyn.inverse_mass_matrix(c.t.q) * scale, expected, c.tolerance)


def energy_of_gravity_and_centre_of_mass(c):
    """U and the centre of mass of all links, that of a fixed base included."""
    mass, centre = c.oracle.center_of_mass(c.t.q)
    assert_close(c.model.total_mass, mass, 1e-14)
    reach = norm(centre) + 1.0
    assert_close(c.dyn.center_of_mass(c.t.q), centre, 1e-14, reach)
    U = c.oracle.potential_energy(c.t.q)
    assert_close(c.dyn.potential_energy(c.t.q), U, 1e-14, mass * norm(c.model.gravity) * reach)


def regressor(c):
    """Y of every link is Pinocchio's, column by column, and rotors are apart."""
    arguments = c.t.q, c.t.qd, c.sample.qdd
    Y = c.dyn.regressor(*arguments) / c.unit[:, None]
    expected = c.oracle.regressor(*arguments, c.model.link_names) / c.unit[:, None]
    for column, values in zip(Y.T, expected.T, strict=True):
        assert_close(column, values, 1e-12, max(norm(values), 1e-3 * norm(expected)))


def sweeps_are_the_factors(c):
    """ν = mᵀq̇, q̇ = ℓᵀν, ε = ℓτ, τ = mε for any vector, without a matrix; the evaluation's ν and ε
    are theirs.
    """
    dyn = c.dyn
    t = c.t
    x = np.array(c.sample.qdd)
    assert_close(dyn.nu_from_qd(t.q, x), t.m.T @ x, c.tolerance)
    assert_close(dyn.qd_from_nu(t.q, x) * c.unit, np.linalg.solve(t.m.T, x) * c.unit, c.tolerance)
    assert_close(dyn.epsilon_from_tau(t.q, x), np.linalg.solve(t.m, x), c.tolerance)
    assert_close(dyn.tau_from_epsilon(t.q, x) / c.unit, t.m @ x / c.unit, c.tolerance)
    assert_close(dyn.nu_from_qd(t.q, t.qd), c.s.nu, 1e-14)
    assert_close(dyn.epsilon_from_tau(t.q, t.tau), c.s.epsilon, c.tolerance)


LAWS = (
    m_is_the_udu_factor,
    m_factors_the_mass_matrix,
    l_inverts_m,
    factors_have_the_sparsity_of_the_tree,
    total_joint_rates,
    working_moments,
    gravity,
    energy,
    link_energy,
    base_energy,
    coriolis,
    coriolis_unnormalized,
    coriolis_does_no_work,
    coriolis_torque,
    inverse_dynamics,
    forward_dynamics,
    equation_of_motion,
    power,
    external_wrenches,
    friction,
    inverse_mass_matrix,
    energy_of_gravity_and_centre_of_mass,
    regressor,
    sweeps_are_the_factors,
)
