# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""MuJoCo as a second oracle, with another algorithm and another reader of URDFs: M = LᵀDL, ν = √D L q̇, ε = √D⁻¹ L⁻ᵀ τ."""

import os
import xml.etree.ElementTree as ET
from functools import cache

import numpy as np
import pytest

import diag_dynamics as dd
import robots
from accuracy import assert_close, norm, tolerance
from oracles import FLOATING, Oracle

if os.environ.get("DIAG_DYNAMICS_REQUIRE_ROS") == "1":  # where everything is installed, it has to be here
    import mujoco
else:
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: the second referee is missing")
pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

# MuJoCo takes no inertia that no rigid body has, nor one without mass at all; test_refused shows that it is so.
REFUSED = (
    "alex_description/urdf/alex_psyonic_hands.urdf",
    "allegro_hand_description/urdf/allegro_left_hand.urdf",
    "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "anymal_b_simple_description/robots/anymal-kinova.urdf",
    "anymal_b_simple_description/robots/anymal.urdf",
    "anymal_c_simple_description/urdf/anymal.urdf",
    "b1_description/urdf/b1-z1.urdf",
    "b1_description/urdf/b1.urdf",
    "finger_edu_description/robots/finger_edu.urdf",
    "go1_description/urdf/go1.urdf",
    "human_description/robots/human.urdf",
    "hyq_description/robots/hyq_no_sensors.urdf",
    "icub_description/robots/icub.urdf",
    "icub_description/robots/icub_reduced.urdf",
    "pr2_description/urdf/pr2.urdf",
    "romeo_description/urdf/romeo_small.urdf",
    "tiago_description/robots/tiago.urdf",
    "tiago_description/robots/tiago_dual.urdf",
    "tiago_description/robots/tiago_no_hand.urdf",
)
ACCEPTED = tuple(id for id in robots.regular_robots() if id not in REFUSED)
FLYING = (
    "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "go2_description/urdf/go2.urdf",
    "panda_description/urdf/panda.urdf",
    "solo_description/robots/solo12.urdf",
    "talos_data/robots/talos_reduced.urdf",
)


def bare(urdf: str) -> str:
    """Return a URDF with nothing but what both are to read, and with MuJoCo's corrections switched off."""
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
            at |= {name + suffix: (first + i, self.model.jnt_qposadr[j]) for i, suffix in enumerate(suffixes)}
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

    def solve_m2(self, tau):
        """Return √D⁻¹ L⁻ᵀ τ."""
        result, vector = np.zeros((2, 1, self.model.nv))
        vector[0, self.dof] = tau
        mujoco.mj_solveM2(self.model, self.data, result, vector, np.sqrt(self.data.qLDiagInv))
        return result[0, self.dof]


@cache
def load(id, floating_base=False):
    """Return library, MuJoCo and Pinocchio; the last for states and tolerance only."""
    robot = robots.robot(id)
    dyn = dd.DiagonalDynamics(dd.load_urdf(robot.source, mimic="free", floating_base=floating_base))
    other = Mujoco(robot.urdf, dyn.model.dof_names, floating_base)
    return dyn, other, Oracle(robot.urdf, dyn.model.dof_names, floating_base=floating_base)


@pytest.mark.parametrize("id", REFUSED)
def test_refused(id):
    """The reason is in the robot's inertias, and nothing else is kept from being compared."""
    with pytest.raises(ValueError, match="inertia"):
        mujoco.MjModel.from_xml_string(bare(robots.robot(id).urdf))


def test_most_robots_are_accepted():
    assert len(ACCEPTED) >= 40


@pytest.mark.parametrize("id", ACCEPTED)
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
