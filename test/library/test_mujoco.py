# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""MuJoCo as a second oracle, with another algorithm and another reader of URDFs, and motions by three engines.

MuJoCo factors M = LᵀDL, so that ν = √D L q̇ and ε = √D⁻¹ L⁻ᵀ τ.
"""

import numpy as np
import pytest

import diag_dynamics as dd
import robots
from accuracy import assert_close, norm, tolerance
from engines import SCENES, Mujoco, by_mujoco, by_pinocchio, distance, ours, scene
from oracles import Oracle

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

FIXED = (
    "panda_description/urdf/panda.urdf",
    "ur_description/urdf/ur5_robot.urdf",
    "talos_data/robots/talos_reduced.urdf",
)
FLYING = (
    "go2_description/urdf/go2.urdf",
    "solo_description/robots/solo12.urdf",
    "talos_data/robots/talos_reduced.urdf",
)


def load(id, floating_base=False):
    """Return library, MuJoCo and Pinocchio; the last for states and tolerance only."""
    robot = robots.robot(id)
    dyn = dd.DiagonalDynamics(dd.load_urdf(robot.source, mimic="free", floating_base=floating_base))
    other = Mujoco(robot.urdf, dyn.model.dof_names, floating_base)
    return dyn, other, Oracle(robot.urdf, dyn.model.dof_names, floating_base=floating_base)


@pytest.mark.parametrize("id", FIXED)
def test_nu_and_epsilon(id):
    """ν of mj_mulM2, ε of mj_solveM2."""
    dyn, other, oracle = load(id)
    for q, qd, tau, _ in robots.samples(id, oracle):
        other.place(q)
        s, t = dyn.evaluate(q, qd, tau), oracle.at(q, qd, tau)
        assert_close(s.nu, other.mul_m2(qd), tolerance(t))
        assert_close(s.epsilon, other.solve_m2(tau), tolerance(t))
        assert_close(dyn.nu_from_qd(q, qd), other.mul_m2(qd), tolerance(t))
        assert_close(dyn.epsilon_from_tau(q, tau), other.solve_m2(tau), tolerance(t))


@pytest.mark.parametrize("id", FLYING)
def test_floating_base(id):
    """MuJoCo has the base's linear velocity in the world's axes, so the base turned aside has the same energy, no more.

    All other ν, and with the base upright every one, are the same.
    """
    dyn, other, oracle = load(id, floating_base=True)
    for q, qd, tau, _ in robots.samples(id, oracle):
        t = oracle.at(q, qd, tau)
        upright = q.copy()
        upright[3:7] = 0, 0, 0, 1
        other.place(upright)
        s = dyn.evaluate(upright, qd, tau)
        assert_close(s.nu, other.mul_m2(qd), tolerance(t))
        assert_close(s.epsilon, other.solve_m2(tau), tolerance(t))
        other.place(q)
        s, R = dyn.evaluate(q, qd, tau), rotation(q[3:7])
        in_world, force = qd.copy(), tau.copy()
        in_world[:3], force[:3] = R @ qd[:3], R @ tau[:3]
        nu, epsilon = other.mul_m2(in_world), other.solve_m2(force)
        assert_close(s.nu[6:], nu[6:], tolerance(t))
        assert_close(s.epsilon[6:], epsilon[6:], tolerance(t))
        assert_close(s.base_energy, 0.5 * nu[:6] @ nu[:6], tolerance(t))
        assert_close(norm(s.epsilon[:6]), norm(epsilon[:6]), tolerance(t))
        assert norm(s.nu[:3] - nu[:3]) > 1e-6 * norm(nu)


def rotation(quaternion):
    """Return the rotation matrix of x y z w, by Rodrigues' formula."""
    v, w = quaternion[:3], quaternion[3]
    K = np.cross(np.eye(3), v)  # K x = v × x
    return np.eye(3) + 2 * w * K + 2 * K @ K


@pytest.mark.parametrize("referee", [by_pinocchio, by_mujoco])
@pytest.mark.parametrize("name", SCENES)
def test_motion(name, referee):
    """Ours is where theirs is, to a millionth of the way; each force and the payload matter a thousand times as much."""
    it = scene(name)
    sim = ours(it, 0.1)
    x, qd = referee(it, 0.1, 5e-4)
    way = distance(it.oracle, sim, it.oracle.configuration(it.q), it.qd)
    error = distance(it.oracle, sim, x, qd)
    assert error < 1e-6 * way
    unloaded = it._replace(model=it.model.with_payload(it.link, 0.0))
    for other in (it._replace(tau=0 * it.tau), it._replace(damping=0 * it.damping), unloaded):
        assert distance(it.oracle, ours(other, 0.1), x, qd) > 1e3 * error
