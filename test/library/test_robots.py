# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Each excluded robot deserves it, and is treated as its reason says; every other robot is really tested."""

import numpy as np
import pytest

import diag_dynamics as dd
import robots
from oracles import Oracle

SINGULAR = [id for id, exclusion in robots.EXCLUDED.items() if exclusion.reason == robots.SINGULAR]
MOTIONLESS = [id for id, exclusion in robots.EXCLUDED.items() if exclusion.reason == robots.MOTIONLESS]
EMPTY = [id for id, exclusion in robots.EXCLUDED.items() if exclusion.reason == robots.EMPTY]


def articulated_inertias(M):
    """Return D of M = U D Uᵀ by elimination from the tip, leaving out pivots that are zero."""
    M, D = M.copy(), np.zeros(len(M))
    for k in reversed(range(len(M))):
        D[k] = M[k, k]
        if D[k] > 1e-13:
            M[:k, :k] -= np.outer(M[:k, k], M[:k, k]) / D[k]
    return D


def test_robots_of_the_wheel():
    """Nothing is lost: every URDF of the wheel is regular or excluded, and every exclusion exists."""
    everything = set(robots.all_robots())
    assert len(everything) >= 69
    assert set(robots.EXCLUDED) <= everything
    assert set(robots.regular_robots()) | set(robots.EXCLUDED) == everything
    assert sorted(SINGULAR + MOTIONLESS + EMPTY) == sorted(robots.EXCLUDED)


@pytest.mark.parametrize("robot", robots.robots_to_test(), ids=lambda robot: robot.id)
def test_regular(robot):
    """A regular robot moves, and its mass matrix can be told from a singular one."""
    oracle = Oracle(robot.urdf, **robot.options)
    assert oracle.nv > 0
    for sample in robots.samples(robot.id, oracle):
        assert np.linalg.cond(oracle.mass_matrix(sample.q)) < 1e10


@pytest.mark.parametrize("id", SINGULAR)
def test_singular(id):
    """D of exactly the listed joints vanishes in Pinocchio's M, anywhere; the loader names the same."""
    urdf = robots.robot(id).urdf
    oracle = Oracle(urdf)
    for sample in robots.samples(id, oracle):
        M = oracle.mass_matrix(sample.q)
        D = articulated_inertias(M)
        assert np.linalg.cond(M) > 1e13
        names = {name for name, d in zip(oracle.dof_names, D, strict=True) if d < 1e-13}
        assert names == set(robots.EXCLUDED[id].joints)
        assert min(d for d in D if d >= 1e-13) > 1e-6  # none is on the edge
    with pytest.raises(dd.MasslessLinkError) as error:
        dd.load_urdf(urdf, mimic="free")
    assert set(error.value.joints) == set(robots.EXCLUDED[id].joints)
    assert all(name in str(error.value) for name in robots.EXCLUDED[id].joints)


def test_singular_at_one_configuration():
    """iCub's head is point masses: regular in general, but D of neck_roll vanishes at q = 0. It is named."""
    robot = robots.robot("icub_description/robots/icub.urdf")
    dyn = dd.DiagonalDynamics(dd.load_urdf(robot.source, mimic="free"))
    zero = np.zeros(dyn.model.nv)
    oracle = Oracle(robot.urdf, dyn.model.dof_names)
    assert np.linalg.cond(oracle.mass_matrix(zero)) > 1e13
    D = dict(zip(oracle.dof_names, oracle.unit_factor(zero)[1], strict=True))
    assert min(D, key=D.get) == "neck_roll"
    assert D["neck_roll"] < 1e-12
    for call in (
        lambda: dyn.evaluate(zero, zero),
        lambda: dyn.factors(zero),
        lambda: dyn.forward_dynamics(zero, zero, zero),
        *(lambda s=s: s(zero, zero) for s in (dyn.nu_from_qd, dyn.qd_from_nu)),
        *(lambda s=s: s(zero, zero) for s in (dyn.epsilon_from_tau, dyn.tau_from_epsilon)),
    ):
        with pytest.raises(dd.SingularMassMatrixError, match="neck_roll") as error:
            call()
        assert error.value.joint == "neck_roll"
        assert abs(error.value.articulated_inertia) < 1e-12
    # what needs no factor is answered all the same
    s = np.sqrt(np.diag(oracle.mass_matrix(zero)))
    assert np.abs((dyn.mass_matrix(zero) - oracle.mass_matrix(zero)) / np.outer(s, s)).max() < 1e-12
    assert np.isfinite(dyn.inverse_dynamics(zero, zero + 1, zero + 1)).all()


@pytest.mark.parametrize("id", MOTIONLESS)
def test_motionless(id):
    """Nothing moves, says Pinocchio too; our model loads and gives empty answers."""
    assert Oracle(robots.robot(id).urdf).nv == 0
    model = dd.load_urdf(robots.robot_path(id), mimic="free")
    assert (model.nv, model.nq, model.dof_names, model.joint_names) == (0, 0, (), ())
    dyn = dd.DiagonalDynamics(model)
    none = np.zeros(0)
    state = dyn.evaluate(none, none, none)
    for name in (
        "nu",
        "xi",
        "epsilon",
        "kappa",
        "coriolis",
        "coriolis_unnormalized",
        "gravity",
        "energy_share",
    ):
        assert getattr(state, name).shape == (0,), name
    assert state.articulated_inertia.shape == (0,)
    assert state.kinetic_energy == 0
    assert state.power == 0
    assert state.link_energy.shape == (len(model.link_names),)
    assert (state.link_energy == 0).all()
    factors = dyn.factors(none)
    assert factors.m.shape == factors.l.shape == factors.unit.shape == (0, 0)
    assert dyn.mass_matrix(none).shape == (0, 0)
    assert dyn.forward_dynamics(none, none, none).shape == (0,)
    assert dyn.inverse_dynamics(none, none, none).shape == (0,)


@pytest.mark.parametrize("id", EMPTY)
def test_empty(id):
    """A file without any link is no robot for anyone: the loader says so."""
    assert "<link" not in robots.robot(id).urdf
    with pytest.raises(dd.UrdfError, match="link"):
        dd.load_urdf(robots.robot_path(id), mimic="free")
