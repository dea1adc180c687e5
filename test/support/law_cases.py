# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots in library and oracle, in the same states: what the tests of the laws have in common."""

from typing import NamedTuple

import numpy as np

import diag_dynamics as dd
import robots
from accuracy import tolerance
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


class Robot(NamedTuple):
    """A robot, its oracle, and its cases."""

    id: str
    model: object
    dyn: dd.DiagonalDynamics
    oracle: Oracle | Coupled
    cases: list[Case]


def load(robot: robots.Robot, **more) -> Robot:
    """Load a robot in library and oracle, and evaluate its samples."""
    model = dd.load_urdf(robot.source, mimic=robot.mimic, **robot.options, **more)
    dyn, oracle, cases = dd.DiagonalDynamics(model), oracle_of(robot, model.dof_names, **more), []
    for sample in robots.samples(robot.id, oracle):
        t = oracle.at(sample.q, sample.qd, sample.tau)
        s, f = dyn.evaluate(sample.q, sample.qd, sample.tau), dyn.factors(sample.q)
        cases.append(Case(dyn, t, sample, s, f, np.sqrt(np.diag(t.M)), tolerance(t)))
    return Robot(robot.id, model, dyn, oracle, cases)


def assert_same(actual, expected):
    """Two mappings from names to numbers or arrays agree to the bit."""
    for name, value in expected.items():
        assert (np.asarray(actual[name]) == np.asarray(value)).all(), name


FIELDS = (
    *("nu", "xi", "epsilon", "kappa", "coriolis", "coriolis_unnormalized", "gravity", "articulated_inertia"),
    *("kinetic_energy", "energy_share", "link_energy", "power"),
)


def fields(s, *without) -> dict:
    """Return an evaluation's quantities by name."""
    return {name: getattr(s, name) for name in FIELDS if name not in without}


def wrenches_on(model, seed) -> dict[str, np.ndarray]:
    """Return wrenches on the root, a tip and some other links, those without inertia among them."""
    rng = np.random.default_rng(seed)
    names = dict.fromkeys((model.link_names[0], model.link_names[-1], *map(str, rng.choice(model.link_names, 4))))
    return {name: 10 * rng.standard_normal(6) for name in names}


def everything(dyn, sample) -> dict:
    """Return every answer of the API at one state."""
    q, qd, tau, qdd = sample
    s, f, tip = dyn.evaluate(q, qd, tau), dyn.factors(q), dyn.model.link_names[-1]
    at = {"point": (0.1, -0.2, 0.3), "frame": "world"}
    return {
        **fields(s),
        "articulated_inertia_rate": s.articulated_inertia_rate,
        **{name: getattr(f, name) for name in ("m", "l", "unit", "D")},
        **{name: getattr(dyn, name)(q) for name in ("mass_matrix", "gravity_torque", "log_det")},
        **{name: getattr(dyn, name)(q, qd) for name in ("bias", "mass_matrix_rate", "log_det_rate")},
        **{name: getattr(dyn, name)(q, tau) for name in ("epsilon_from_tau", "tau_from_epsilon")},
        **{name: getattr(dyn, name)(q, qd) for name in ("nu_from_qd", "qd_from_nu")},
        **{name: getattr(dyn, name)(q, qd, qdd) for name in ("m_rate_transposed", "coriolis_bracket")},
        **{name: getattr(dyn, name)(q, qd, qdd) for name in ("mass_matrix_rate_times", "coriolis_product")},
        "forward_dynamics": dyn.forward_dynamics(q, qd, tau),
        "inverse_dynamics": dyn.inverse_dynamics(q, qd, qdd),
        "wrench_factor": dyn.wrench_factor(q, tip, **at),
        "epsilon_from_wrench": dyn.epsilon_from_wrench(q, tip, (1, -2, 3, -4, 5, -6), **at),
        "operational_inverse_inertia": dyn.operational_inverse_inertia(q, tip, **at),
        "reflected_mass": dyn.reflected_mass(q, tip, (1, 2, 3), **at),
    }
