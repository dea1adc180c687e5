# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the library is measured against: Pinocchio, MuJoCo, and the dense route to the diagonalized equations.

Each peer is prepared outside of what is timed: its model built, its data allocated, states in its own order and
parametrization of joints. Orders are matched by the names of joints.
"""

import xml.etree.ElementTree as ET
from functools import partial

import mujoco
import numpy as np
import pinocchio as pin
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dtrtri

WORLD = pin.Convention.WORLD

# What the dense route and the library both compute, in the order of the dense route's results.
QUANTITIES = (
    "nu",
    "xi",
    "epsilon",
    "coriolis",
    "gravity",
    "kinetic_energy",
    "energy_share",
    "articulated_inertia",
)


class Pinocchio:
    """A robot in Pinocchio, its data allocated once.

    Attributes
    ----------
    order : ndarray of int
        Of each degree of freedom of the library, where it stands in Pinocchio's vectors of rates.
    """

    def __init__(self, case):
        if case.floating_base:
            self.model = pin.buildModelFromXML(
                case.urdf, pin.JointModelFreeFlyer(), "root_joint", False
            )
        else:
            self.model = pin.buildModelFromXML(
                case.urdf, False
            )  # False: mimic joints are ordinary ones
        self.data = self.model.createData()
        own = 6 * case.floating_base
        joints = [self.model.getJointId(name) for name in case.model.dof_names[own:]]
        self._coordinates = 7 * case.floating_base
        self._places = [(self.model.idx_qs[joint], self.model.nqs[joint] == 2) for joint in joints]
        self.order = np.array([*range(own), *(self.model.idx_vs[joint] for joint in joints)])
        self._above = np.triu(np.ones((self.model.nv, self.model.nv)), 1)

    def positions(self, Q):
        """Positions as Pinocchio has them, with (cos, sin) for a joint without an end; any number of leading axes."""
        own, first = np.empty((*Q.shape[:-1], self.model.nq)), self._coordinates
        own[..., :first] = Q[..., :first]
        for k, (at, circular) in enumerate(self._places, first):
            if circular:
                own[..., at], own[..., at + 1] = np.cos(Q[..., k]), np.sin(Q[..., k])
            else:
                own[..., at] = Q[..., k]
        return own

    def vectors(self, X):
        """Rates or efforts in Pinocchio's order; any number of leading axes."""
        own = np.empty_like(X)
        own[..., self.order] = X
        return own

    def calls(self, q, qd, tau):
        """What is timed at a state, by name: aba in its faster convention and in its default one, and the dense route."""
        aba = partial(pin.aba, self.model, self.data, q, qd, tau)
        return {
            "aba": partial(aba, WORLD),
            "aba_default": aba,
            "dense_evaluate": partial(self.dense_evaluate, q, qd, tau),
            "dense_factors": partial(self.dense_factors, q),
        }

    def dense_evaluate(self, q, qd, tau):
        """What :data:`QUANTITIES` names, by Pinocchio's matrices and LAPACK.

        With M = U D Uᵀ and c = C_s q̇, Ṁ = C_s + C_sᵀ (so for Pinocchio's C_s), ℓc − ṁᵀq̇ comes down to
        D^−½(S − Sᵀ)ξ with S the part above the diagonal of U⁻¹C_sU⁻ᵀ: neither ṁ nor ℓ has to be formed.
        """
        model, data = self.model, self.data
        pin.crba(model, data, q)
        pin.cholesky.decompose(model, data)
        U, D = data.U, data.D.copy()
        W = dtrsm(1.0, U, pin.computeCoriolisMatrix(model, data, q, qd), diag=1)
        S = dtrsm(1.0, U, W, side=1, trans_a=1, diag=1, overwrite_b=1) * self._above
        efforts = np.array((tau, pin.computeGeneralizedGravity(model, data, q)))
        root, xi = np.sqrt(D), qd @ U
        nu = root * xi
        epsilon, gravity = dtrsm(1.0, U, efforts.T, diag=1, overwrite_b=1).T / root
        share = 0.5 * nu * nu
        return nu, xi, epsilon, (S @ xi - xi @ S) / root, gravity, 0.5 * float(nu @ nu), share, D

    def dense_factors(self, q):
        """M = U D^½ and ℓ = m⁻¹."""
        pin.crba(self.model, self.data, q)
        pin.cholesky.decompose(self.model, self.data)
        m = self.data.U * np.sqrt(self.data.D)
        return m, dtrtri(m)[0]


class Parallel:
    """Pinocchio's aba of many states: a model and data for each thread, states in columns, the result's memory reused."""

    def __init__(self, pinocchio, threads, Q, QD, TAU):
        self._pool, self._threads = pin.ModelPool(pinocchio.model, threads), threads
        self._arguments = [
            x.T for x in (pinocchio.positions(Q), pinocchio.vectors(QD), pinocchio.vectors(TAU))
        ]
        self._qdd = np.empty_like(self._arguments[1])

    def __call__(self):
        """q̈, a column for each state."""
        pin.abaInParallel(self._threads, self._pool, *self._arguments, self._qdd)
        return self._qdd


class Mujoco:
    """A robot in MuJoCo at one state, reduced to smooth dynamics: no constraints, contacts, limits or sensors."""

    def __init__(self, case):
        spec = mujoco.MjSpec.from_string(_for_mujoco(case.urdf))
        if case.floating_base:
            spec.worldbody.first_body().add_freejoint(name="root_joint")
        self.model = spec.compile()
        off = mujoco.mjtDisableBit
        self.model.opt.disableflags |= (
            off.mjDSBL_CONSTRAINT | off.mjDSBL_CONTACT | off.mjDSBL_SENSOR
        )
        self.data = mujoco.MjData(self.model)
        own = 6 * case.floating_base
        joints = [self.model.joint(name).id for name in case.model.dof_names[own:]]
        self.order = np.array([*range(own), *(self.model.jnt_dofadr[joint] for joint in joints)])
        self._turn = _rotation(case.q[3:7]) if case.floating_base else None
        self._q, self._qd, self._tau = np.zeros(self.model.nq), *np.zeros((2, self.model.nv))
        self._q[[self.model.jnt_qposadr[joint] for joint in joints]] = case.q[
            7 * case.floating_base :
        ]
        self._qd[self.order], self._tau[self.order] = case.qd, case.tau
        if case.floating_base:  # linear parts in the world's axes, the quaternion's real part first
            self._q[:7] = case.q[[0, 1, 2, 6, 3, 4, 5]]
            self._qd[:3], self._tau[:3] = self._turn @ case.qd[:3], self._turn @ case.tau[:3]
        self._twist = case.qd[:own]

    def forward(self):
        """mj_forward: kinematics, M and its LᵀDL, bias forces, q̈."""
        data = self.data
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = self._q, self._qd, self._tau
        mujoco.mj_forward(self.model, data)
        return data.qacc

    def accelerations(self):
        """The last q̈ in the library's order and axes."""
        qdd = self.data.qacc[self.order]
        if self._turn is not None:
            qdd[:3] = self._turn.T @ qdd[:3] - np.cross(self._twist[3:], self._twist[:3])
        return qdd


def _for_mujoco(urdf):
    """A URDF with nothing in it that only one of the two would heed, and MuJoCo's corrections of inertias off."""
    robot = ET.fromstring(urdf)
    for parent, tags in (
        (robot, ("material", "gazebo", "transmission")),
        *((link, ("visual", "collision")) for link in robot.findall("link")),
        *((joint, ("mimic", "dynamics", "limit")) for joint in robot.findall("joint")),
    ):
        for element in [element for tag in tags for element in parent.findall(tag)]:
            parent.remove(element)
    for joint in robot.findall("joint"):
        if joint.get("type") == "revolute":
            joint.set("type", "continuous")  # they differ in the limits only
    off = {"balanceinertia": "false", "fusestatic": "false", "boundmass": "0", "boundinertia": "0"}
    ET.SubElement(ET.SubElement(robot, "mujoco"), "compiler", off)
    return ET.tostring(robot, encoding="unicode")


def _rotation(quaternion):
    """Rotation matrix of a unit quaternion x y z w."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, np.roll(quaternion, 1))
    return matrix.reshape(3, 3)
