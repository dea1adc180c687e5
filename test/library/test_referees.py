# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where Pinocchio and MuJoCo say that a robot goes: the same efforts, damping, push and payload, integrated by each."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest
from test_simulation_bodies import distance, reference, start

import diag_dynamics as dd
from oracles import Oracle
from robots import robot_path

PAYLOAD = 0.5, (0.02, -0.01, 0.05), 1e-3 * np.diag([1.0, 2.0, 2.5])
"""Mass [kg], centre of mass [m] and inertia about it [kg m²], in the axes of the link that is pushed, too."""
PUSH = np.array([0.3, -0.4, 0.5, 0.02, 0.01, -0.03])
"""Force [N] and torque [N m] on its origin, along the axes of the world."""
DAMPING = 0.2
"""On every joint [N m s/rad, N s/m]."""
EFFORT = 0.02
"""Standard deviation of efforts [N m, N]; none on a base."""


class Scene(NamedTuple):
    """A robot, how it moves at first, and what acts on it."""

    urdf: str
    model: dd.RobotModel
    oracle: Oracle
    link: str
    q: np.ndarray
    qd: np.ndarray
    tau: np.ndarray
    damping: np.ndarray


SCENES = {
    "Panda": ("panda_description/urdf/panda.urdf", False, "panda_hand"),
    "UR5": ("ur_description/urdf/ur5_robot.urdf", False, "tool0"),
    "Solo 12, flying": ("solo_description/robots/solo12.urdf", True, "FL_FOOT"),
    "Talos, flying": ("talos_data/robots/talos_reduced.urdf", True, "arm_left_7_link"),
}
"""Robots, whether their base is free, and the link that is pushed."""


def scene(name):
    """Return a scene."""
    robot, floating, link = SCENES[name]
    path = robot_path(robot)
    urdf = path.read_text()
    model = dd.load_urdf(path, floating_base=floating, mimic="free").with_payload(link, *PAYLOAD)
    oracle = Oracle(urdf, model.dof_names, floating_base=floating)
    oracle.append_body(link, *PAYLOAD)
    q, qd = start(model, 1, speed=0.3)
    joints = np.array(["root_joint" not in dof for dof in model.dof_names])
    tau = EFFORT * np.random.default_rng(2).normal(size=model.nv) * joints
    return Scene(urdf, model, oracle, link, q, qd, tau, DAMPING * joints)


def ours(scene, duration):
    """Return the simulation after some time [s], by steps of 1 ms."""
    zero = np.zeros(scene.model.nv)
    sim = dd.Simulation(scene.model, scene.q, scene.qd, damping=scene.damping, friction=zero, limits=False)
    sim.advance(scene.tau, steps=round(duration / sim.step_size), f_ext={scene.link: PUSH}, frame="world")
    return sim


def by_pinocchio(scene, duration, h):
    """Configuration and velocity by Runge-Kutta-Munthe-Kaas steps on aba and Pinocchio's own charts."""
    oracle = scene.oracle
    model, data, damping = oracle.model, oracle.model.createData(), oracle.to_pin(scene.damping)
    frame, axes = model.getFrameId(scene.link), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def damper_and_push(x, v):
        return pin.computeFrameJacobian(model, data, x, frame, axes).T @ PUSH - damping * v

    return reference(oracle, scene.q, scene.qd, scene.tau, duration, h, damper_and_push)


def by_mujoco(scene, duration, h):
    """The same by MuJoCo's own steps of fourth order; skips where that is absent, which is no reason to miss the other."""
    from test_mujoco import Mujoco, mujoco

    def carry(spec):
        mass, com, inertia = PAYLOAD
        body = spec.body(scene.link).add_body(name="payload", pos=com, mass=mass, inertia=np.diag(inertia))
        body.ipos, body.explicitinertial = (0.0, 0.0, 0.0), True

    floating = scene.model.floating_base
    other = Mujoco(scene.urdf, scene.model.dof_names, floating, change=carry)
    model, data = other.model, other.data
    model.opt.timestep, model.opt.integrator = h, mujoco.mjtIntegrator.mjINT_RK4
    model.dof_damping[other.dof] = scene.damping
    data.qvel[other.dof] = scene.qd
    other.place(scene.q)
    if floating:  # its linear velocity is along the axes of the world, its angular one along those of the base
        data.qvel[:3] = data.body(scene.model.root_link).xmat.reshape(3, 3) @ scene.qd[:3]
        data.qvel[3:6] = scene.qd[3:6]
    data.qfrc_applied[other.dof] = scene.tau
    link = model.body(scene.link).id

    def push(model, data):
        mujoco.mj_applyFT(model, data, PUSH[:3], PUSH[3:], data.xpos[link], link, data.qfrc_passive)

    mujoco.set_mjcb_passive(push)  # in every stage of a step, where the link is then
    try:
        for _ in range(round(duration / h)):
            mujoco.mj_step(model, data)
    finally:
        mujoco.set_mjcb_passive(None)
    q, qd = np.zeros(scene.model.nq), data.qvel[other.dof]
    q[7 * floating :] = data.qpos[other.qpos]
    if floating:
        q[[0, 1, 2, 6, 3, 4, 5]] = data.qpos[:7]
        mujoco.mj_forward(model, data)
        qd[:3] = data.body(scene.model.root_link).xmat.reshape(3, 3).T @ data.qvel[:3]
    return scene.oracle.configuration(q), qd


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
