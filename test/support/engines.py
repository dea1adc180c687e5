# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pinocchio and MuJoCo integrate the motions that `Simulation` integrates; MuJoCo reads URDFs as a
second oracle.
"""

import xml.etree.ElementTree as ET
from typing import NamedTuple

import mujoco
import numpy as np
import pinocchio as pin

import diag_dynamics as dd
from oracles import FLOATING, Oracle
from robots import robot_path


def bare(urdf: str) -> str:
    """Return a URDF with nothing but what both are to read, and with MuJoCo's corrections switched
    off.
    """
    robot = ET.fromstring(urdf)
    for parent, useless in (
        (robot, ("material", "gazebo", "transmission")),
        *((link, ("visual", "collision")) for link in robot.findall("link")),
        *((joint, ("mimic", "dynamics", "limit")) for joint in robot.findall("joint")),
    ):
        for element in [element for tag in useless for element in parent.findall(tag)]:
            parent.remove(element)
    off = {"balanceinertia": "false", "fusestatic": "false", "boundmass": "0", "boundinertia": "0"}
    ET.SubElement(ET.SubElement(robot, "mujoco"), "compiler", off)
    for joint in robot.findall("joint"):
        if joint.get("type") == "revolute":
            joint.set("type", "continuous")  # they differ in nothing but the limits
    return ET.tostring(robot, encoding="unicode")


class Mujoco:
    """A robot in MuJoCo, dofs in the order of given names."""

    def __init__(self, urdf, dof_names, floating_base=False, change=lambda spec: None):
        """Read a URDF; `change` may add to it before it is compiled."""
        spec = mujoco.MjSpec.from_string(bare(urdf))
        change(spec)
        if floating_base:
            spec.worldbody.first_body().add_freejoint(name="root_joint")
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        at = {}  # of every dof: its place in qvel; of every joint: its first place in qpos
        for j in range(self.model.njnt):
            name, first = self.model.joint(j).name, self.model.jnt_dofadr[j]
            suffixes = [f"/{suffix}" for suffix in FLOATING] if name == "root_joint" else [""]
            at |= {
                name + suffix: (first + i, self.model.jnt_qposadr[j])
                for i, suffix in enumerate(suffixes)
            }
        assert sorted(at) == sorted(dof_names)
        self.dof = np.array([at[name][0] for name in dof_names])
        self.single = [k for k, name in enumerate(dof_names) if "/" not in name]
        self.qpos = np.array([at[dof_names[k]][1] for k in self.single], dtype=int)
        self.floating_base = floating_base

    def place(self, q):
        """Move to positions, the base's quaternion there being x y z w."""
        if self.floating_base:
            self.data.qpos[:7] = q[[0, 1, 2, 6, 3, 4, 5]]
        self.data.qpos[self.qpos] = q[7 * self.floating_base :]
        mujoco.mj_forward(self.model, self.data)

    def mul_m2(self, qd):
        """Return √D L q̇."""
        result, vector = np.zeros((2, self.model.nv))
        vector[self.dof] = qd
        mujoco.mj_mulM2(self.model, self.data, result, vector)
        return result[self.dof]


# --- motions


def start(model, seed, speed=1.0):
    """A state off every symmetry."""
    rng = np.random.default_rng(seed)
    q = model.neutral + 0.4 * rng.uniform(-1, 1, model.nq)
    for k, component in enumerate(model.orientations):
        if component == 3:
            q[k - 3 : k + 1] /= np.linalg.norm(q[k - 3 : k + 1])
    return q, speed * rng.normal(size=model.nv)


def reference(oracle, q, qd, effort, duration, h, more=lambda x, v: 0.0):
    """Runge-Kutta-Munthe-Kaas steps on Pinocchio's aba and integrate; its charts' rates by
    differences of pin.difference.

    `more` gives efforts that depend on configuration and velocity, all in Pinocchio's order. The
    chart is Pinocchio's own, so neither the exponential nor its differential is ours.
    """
    model, data = oracle.model, oracle.data
    x, v = oracle.configuration(q), oracle.to_pin(qd)

    def chart_rate(x, u, v):
        at, d = pin.integrate(model, x, u), 1e-4
        ends = (
            pin.difference(model, x, pin.integrate(model, at, s * d * v)) for s in (1, -1, 2, -2)
        )
        f, b, ff, bb = ends
        return (8 * (f - b) - (ff - bb)) / (12 * d)

    def rates(u, v):
        at = pin.integrate(model, x, u)
        return chart_rate(x, u, v), pin.aba(model, data, at, v, oracle.to_pin(effort) + more(at, v))

    for _ in range(round(duration / h)):
        u1, a1 = rates(np.zeros(model.nv), v)
        u2, a2 = rates(h / 2 * u1, v + h / 2 * a1)
        u3, a3 = rates(h / 2 * u2, v + h / 2 * a2)
        u4, a4 = rates(h * u3, v + h * a3)
        x = pin.integrate(model, x, h / 6 * (u1 + 2 * u2 + 2 * u3 + u4))
        v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return x, oracle.from_pin(v)


def distance(oracle, sim, x, qd):
    """From the simulation's state to the reference's."""
    apart = pin.difference(oracle.model, oracle.configuration(sim.q), x)
    return np.linalg.norm(apart) + np.linalg.norm(sim.qd - qd)


PAYLOAD = 0.5, (0.02, -0.01, 0.05), 1e-3 * np.diag([1.0, 2.0, 2.5])
"""Mass [kg], centre of mass [m] and inertia about it [kg m²], in the axes of the link that is
pushed, too.
"""
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
    """Return the simulation after some time [s], by steps of 10 µs."""
    zero = np.zeros(scene.model.nv)
    sim = dd.Simulation(
        scene.model,
        scene.q,
        scene.qd,
        step=1e-5,
        damping=scene.damping,
        friction=zero,
        limits=False,
    )
    sim.advance(
        scene.tau, steps=round(duration / sim.step_size), f_ext={scene.link: PUSH}, frame="world"
    )
    return sim


def by_pinocchio(scene, duration, h):
    """Configuration and velocity by Runge-Kutta-Munthe-Kaas steps on aba and Pinocchio's own
    charts.
    """
    oracle = scene.oracle
    model, data, damping = oracle.model, oracle.model.createData(), oracle.to_pin(scene.damping)
    frame, axes = model.getFrameId(scene.link), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def damper_and_push(x, v):
        return pin.computeFrameJacobian(model, data, x, frame, axes).T @ PUSH - damping * v

    return reference(oracle, scene.q, scene.qd, scene.tau, duration, h, damper_and_push)


def by_mujoco(scene, duration, h):
    """Configuration and velocity by MuJoCo's own steps of fourth order."""

    def carry(spec):
        mass, com, inertia = PAYLOAD
        body = spec.body(scene.link).add_body(
            name="payload", pos=com, mass=mass, inertia=np.diag(inertia)
        )
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
