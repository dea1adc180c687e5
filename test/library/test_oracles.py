# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The oracles are right themselves: against closed forms, and each against another route."""

import ast
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import oracles
import robots
from oracles import Oracle

ALL = robots.robots_to_test()


def close(a, b, tolerance, scale):
    """Whether two arrays differ by at most tolerance·scale in norm."""
    return np.linalg.norm(np.asarray(a) - b) <= tolerance * scale


@pytest.fixture(scope="module", params=ALL, ids=lambda robot: robot.id)
def states(request):
    """Return the oracle's states of one robot."""
    robot = request.param
    oracle = Oracle(robot.urdf, **robot.options)
    return [(oracle.at(s.q, s.qd, s.tau), s) for s in robots.samples(robot.id, oracle)]


def tolerance(state):
    """Return the tolerance of comparisons that are exact but for rounding."""
    return max(1e-12, 100 * np.finfo(float).eps * state.condition)


def test_oracles_import_nothing_of_the_library():
    """An oracle that shared code with the library would share its mistakes."""
    for file in ("oracles.py", "robots.py"):
        tree = ast.parse(Path(oracles.__file__).with_name(file).read_text(encoding="utf-8"))
        names = [a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names]
        names += [n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)]
        assert names
        assert not [name for name in names if name.startswith("diag_dynamics")]


# --- closed forms


@pytest.mark.parametrize("seed", range(5))
def test_two_link_arm(seed):
    """M, c, U, D and C of the textbook arm, worked out by hand."""
    arm = robots.TwoLinkArm(*np.random.default_rng(seed).uniform(0.2, 2, 7))
    q, qd = np.random.default_rng(seed + 100).uniform(-3, 3, (2, 2))
    state = Oracle(arm.urdf, ("shoulder", "elbow")).at(q, qd)
    unit, D = arm.factor(q)
    assert np.allclose(state.M, arm.mass_matrix(q), rtol=1e-13)
    assert np.allclose(state.c, arm.bias(q, qd), rtol=1e-11, atol=1e-13)
    assert np.allclose(state.unit, unit, rtol=1e-12)
    assert np.allclose(state.D, D, rtol=1e-12)
    assert np.allclose(state.coriolis, arm.coriolis(q, qd), rtol=1e-10, atol=1e-12)
    assert np.allclose(state.coriolis_by_difference, arm.coriolis(q, qd), rtol=1e-9, atol=1e-11)


def test_pendulum():
    """One joint: D is the inertia about the axis, g its gravity moment, and C = 0."""
    state = Oracle(robots.PENDULUM).at(np.array([4.0]), np.array([3.0]), np.array([1.5]))
    inertia = 0.02 + 0.8 * (0.05**2 + 0.4**2)
    y, z = 0.05, -0.4
    moment = 0.8 * 9.81 * (y * np.cos(4.0) - z * np.sin(4.0))  # m g × lever arm of the turned centre of mass
    assert pytest.approx([inertia], rel=1e-14) == state.D
    assert state.g == pytest.approx([moment], rel=1e-13)
    assert state.nu == pytest.approx([3 * np.sqrt(inertia)], rel=1e-14)
    assert state.acceleration == pytest.approx([(1.5 - moment) / inertia], rel=1e-13)
    assert np.abs(state.coriolis) < 1e-14
    assert np.abs(state.coriolis_by_difference) < 1e-11


def test_gantry():
    """Translations only: M is constant, c and C vanish."""
    oracle = Oracle(robots.GANTRY, ("x", "y", "z"))
    state = oracle.at(np.array([0.1, 0.2, 0.3]), np.array([1.0, -2.0, 3.0]))
    assert np.allclose(np.diag(state.M), [27, 7, 2], rtol=1e-14)
    assert np.allclose(oracle.mass_matrix(np.zeros(3)), state.M, rtol=1e-14)
    for vanishing in (state.c, state.coriolis, state.coriolis_by_difference, state.coriolis_unnormalized):
        assert np.abs(vanishing).max() < 1e-11


# --- one route against another, over all robots


def test_factor(states):
    """M = U D Uᵀ, with unit diagonal, nothing outside the tree, and upper triangular in base-to-tip order."""
    for state, _ in states:
        o = state.oracle
        s = np.sqrt(np.diag(state.M))
        assert np.abs((state.m @ state.m.T - state.M) / np.outer(s, s)).max() < 1e-13
        assert (np.diag(state.unit) == 1).all()
        allowed = np.eye(o.nv, dtype=bool)
        for k in range(o.nv):
            allowed[list(o.ancestors(k)), k] = True
        assert (state.m[~allowed] == 0).all()


def test_coriolis_by_two_routes(states):
    """Differences of the factor, and Pinocchio's Coriolis matrix, give one C."""
    for state, _ in states:
        scale, s = state.coriolis_scale, np.sqrt(np.diag(state.M))
        assert close(state.coriolis_by_difference, state.coriolis, max(1e-10, tolerance(state)), scale)
        assert close(state.C_s @ state.qd / s, state.c / s, 1e-12, np.linalg.norm(state.c / s) + scale)


def test_unnormalized_coriolis_by_two_routes(states):
    """C_ξ = D^½C + ½Ḋξ = U⁻¹c − D U̇ᵀq̇, the latter with differences of U."""
    for state, _ in states:
        o, root = state.oracle, np.sqrt(state.D)
        Udot = o.derivative(lambda q, o=o: o.unit_factor(q)[0], state.q, state.qd)
        other = np.linalg.solve(state.unit, state.c) - state.D * (Udot.T @ state.qd)
        scale = state.coriolis_scale + np.linalg.norm(state.Ddot * state.xi / root)
        assert close(other / root, state.coriolis_unnormalized / root, max(1e-10, tolerance(state)), scale)


def test_lemma_7_1(states):
    """νᵀC = 0 for the oracle's C, so the exact route is exact."""
    for state, _ in states:
        assert abs(state.nu @ state.coriolis) < 1e-12 * np.linalg.norm(state.nu) * state.coriolis_scale


def test_dynamics_agree(states):
    """Rnea, aba, M, c and g are one equation of motion, armature included in each."""
    for state, sample in states:
        o, s = state.oracle, np.sqrt(np.diag(state.M))
        tau = o.inverse_dynamics(state.q, state.qd, sample.qdd)
        parts = [(state.M @ sample.qdd) / s, state.c / s, state.g / s]
        assert close(tau / s, sum(parts), 1e-12, sum(map(np.linalg.norm, parts)))
        residual = [state.M @ state.acceleration / s, state.c / s, state.g / s, -state.tau / s]
        assert close(sum(residual), 0, tolerance(state), sum(map(np.linalg.norm, residual)))


def test_power_by_difference(states):
    """K̇ along aba's acceleration is the derivative of ½q̇ᵀMq̇."""
    for state, _ in states:
        o, h = state.oracle, 1e-4 / (1 + np.abs(state.acceleration).max() / np.abs(state.qd).max())

        def energy(t, state=state, o=o):
            qd = state.qd + t * state.acceleration
            return 0.5 * qd @ o.mass_matrix(o.moved(state.q, t * state.qd)) @ qd

        rate = (8 * (energy(h) - energy(-h)) - (energy(2 * h) - energy(-2 * h))) / (12 * h)
        assert rate == pytest.approx(state.power, rel=1e-7, abs=1e-11 * state.kinetic_energy / h)


def test_link_energies_sum_up(states):
    """The inertials read from the XML, moved by Pinocchio's frames, carry the whole kinetic energy."""
    for state, _ in states:
        assert sum(state.link_energy.values()) == pytest.approx(state.kinetic_energy, rel=1e-12)
        assert min(state.link_energy.values()) >= 0


def test_armature_is_in_the_kinetic_energy():
    """Armature is in ½vᵀMv; Pinocchio's own kinetic energy may leave it out, so it is not the oracle."""
    robot = next(robot for robot in ALL if robot.armature)
    oracle = Oracle(robot.urdf, armature=robot.armature)
    bare = Oracle(robot.urdf, oracle.dof_names)
    sample = robots.samples(robot.id, oracle)[0]
    gears = 0.5 * oracle.armature @ sample.qd**2
    energy, without = (o.at(sample.q, sample.qd).kinetic_energy for o in (oracle, bare))
    assert gears > 0.01 * energy
    assert energy == pytest.approx(without + gears, rel=1e-13)
    args = bare.configuration(sample.q), bare.to_pin(sample.qd)
    assert without == pytest.approx(pin.computeKineticEnergy(bare.model, bare.data, *args), rel=1e-12)


def test_dofs_are_mapped_by_name():
    """Another order of dofs is the same robot, permuted."""
    robot = robots.robot(next(id for id in robots.regular_robots() if id.endswith("tiago_pro.urdf")))
    oracle = Oracle(robot.urdf)
    names = tuple(np.random.default_rng(3).permutation(oracle.dof_names))
    at = [oracle.dof_names.index(name) for name in names]
    other = Oracle(robot.urdf, names)
    s = robots.samples(robot.id, oracle)[1]
    a, b = oracle.at(s.q, s.qd, s.tau), other.at(s.q[at], s.qd[at], s.tau[at])
    assert (b.m == a.m[np.ix_(at, at)]).all()
    for quantity in ("nu", "epsilon", "c", "g", "coriolis", "coriolis_by_difference", "acceleration"):
        assert np.allclose(getattr(b, quantity), getattr(a, quantity)[at], rtol=1e-6, atol=1e-9), quantity
    assert {names[j] for j in other.ancestors(0)} == {oracle.dof_names[j] for j in oracle.ancestors(at[0])}
