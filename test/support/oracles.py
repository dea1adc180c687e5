# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Independent answers, from Pinocchio, for what diag_dynamics computes. Imports nothing of
diag_dynamics.

`Oracle` is a robot, `State` one (q, q̇, τ) of it. Vectors and matrices are in the caller's order of
dofs: they are mapped to Pinocchio's joints by name, one angle stands for a continuous joint or the
heading of a planar one. The upper factor m is taken in Pinocchio's own base-to-tip order and
permuted: ν_k does not depend on how siblings are numbered. Degrees of freedom of one joint are in
Pinocchio's order, linear first, and count as a chain.
"""

import xml.etree.ElementTree as ET
from functools import cached_property

import numpy as np
import pinocchio as pin

EARTH = (0.0, 0.0, -9.81)


# Names of the degrees of freedom, and numbers of position coordinates, of joints that have several.
PLANAR = ("v_x", "v_y", "w_z")
FLOATING = ("v_x", "v_y", "v_z", "w_x", "w_y", "w_z")
SUFFIXES = {1: ("",), 3: PLANAR, 6: FLOATING}
COORDINATES = {1: 1, 3: 3, 6: 7}

ROOT = "root_joint"


class Oracle:
    """A robot in Pinocchio, mimic followers independent. It ignores the axis of planar joints: let
    that be z.
    """

    def __init__(
        self,
        urdf,
        dof_names=None,
        gravity=EARTH,
        armature=None,
        floating_base=False,
        locked_joints=None,
    ):
        """Build the model from URDF text; `armature`: reflected inertia by joint name [kg m²] or
        [kg].
        """
        self.xml = ET.fromstring(urdf)
        if floating_base:
            self.model = pin.buildModelFromXML(urdf, pin.JointModelFreeFlyer(), ROOT, False)
        else:
            self.model = pin.buildModelFromXML(
                urdf, False
            )  # False: mimic joints are ordinary joints
        if locked_joints:
            self.model = self._reduced(locked_joints)
        self.data = self.model.createData()
        if not self.model.check(self.data):
            raise ValueError(
                "Pinocchio's crba is wrong on models whose joints are not numbered depth-first"
            )
        self.model.gravity.linear = np.array(gravity, dtype=float)
        part = {  # of every dof: its joint, and where it stands in Pinocchio's velocity vector
            f"{self.model.names[j]}/{suffix}".rstrip("/"): (j, self.model.idx_vs[j] + i)
            for j in range(1, self.model.njoints)
            for i, suffix in enumerate(SUFFIXES[self.model.nvs[j]])
        }
        self.dof_names = tuple(part) if dof_names is None else tuple(dof_names)
        if sorted(self.dof_names) != sorted(part):
            raise ValueError(f"dofs {sorted(self.dof_names)} are not Pinocchio's {sorted(part)}")
        self.nv = self.model.nv
        self._joint = [part[name][0] for name in self.dof_names]
        # _order[k]: where dof k of the caller stands in Pinocchio's velocity vector
        self._order = np.array([part[name][1] for name in self.dof_names], dtype=int)
        self._at = {at: k for k, at in enumerate(self._order)}
        # joints in the caller's order, and the first of the caller's coordinates of each
        self._joints = list(dict.fromkeys(self._joint))
        self._first = {}
        self.nq = 0
        for j in self._joints:
            self._first[j] = self.nq
            self.nq += COORDINATES[self.model.nvs[j]]
        self.armature = np.zeros(self.nv)
        for name, inertia in (armature or {}).items():
            self.armature[self.dof_names.index(name)] = inertia
        self.model.armature = self.to_pin(self.armature)

    def _reduced(self, locked_joints):
        """Return the model with joints of one degree of freedom held."""
        q = pin.neutral(self.model)
        ids = []
        for name, position in locked_joints.items():
            joint = self.model.getJointId(name)
            at = self.model.idx_qs[joint]
            circular = self.model.nqs[joint] == 2
            q[at : at + 1 + circular] = (
                (np.cos(position), np.sin(position)) if circular else position
            )
            ids.append(joint)
        return pin.buildReducedModel(self.model, ids, q)

    def append_body(self, link, mass, com, inertia):
        """Attach a rigid body to a link: centre of mass in the link's axes, inertia about it."""
        frame = self.model.frames[self.model.getFrameId(link, pin.FrameType.BODY)]
        body = pin.Inertia(mass, np.array(com, dtype=float), np.array(inertia, dtype=float))
        self.model.appendBodyToJoint(frame.parentJoint, body, frame.placement)
        self.data = self.model.createData()

    def parent_dof(self, k):
        """Return the dof next inboard of dof k, of the same joint or the nearest one inboard; None
        at the root.
        """
        joint = self._joint[k]
        at = self._order[k]
        if at > self.model.idx_vs[joint]:
            return self._at[at - 1]
        parent = self.model.parents[joint]
        return self._at[self.model.idx_vs[parent] + self.model.nvs[parent] - 1] if parent else None

    @cached_property
    def _ancestors(self):
        """Of each dof in Pinocchio's order, which is base to tip, those strictly inboard of it."""
        result = {}
        for at in range(self.nv):
            k = self._at[at]
            parent = self.parent_dof(k)
            result[k] = frozenset() if parent is None else result[parent] | {parent}
        return [result[k] for k in range(self.nv)]

    def ancestors(self, k):
        """Return the dofs strictly inboard of dof k, those of its own joint that come before it
        among them.
        """
        return self._ancestors[k]

    def descendants(self, k):
        """Return the dofs strictly outboard of dof k, those of its own joint that come after it
        among them.
        """
        return {j for j in range(self.nv) if k in self._ancestors[j]}

    def joint_mates(self, k):
        """Return all dofs of the joint of dof k."""
        return {j for j in range(self.nv) if self._joint[j] == self._joint[k]}

    @cached_property
    def mass(self):
        """Return the total mass of the moving bodies [kg]."""
        return sum(body.mass for body in list(self.model.inertias)[1:])

    def is_prismatic(self, k):
        """Whether dof k is a translation."""
        if self.model.nvs[self._joint[k]] > 1:
            return "/v_" in self.dof_names[k]
        return "P" in self.model.joints[self._joint[k]].shortname().removeprefix("JointModel")[:2]

    def is_circular(self, k):
        """Whether dof k is a continuous joint, which Pinocchio parametrizes by (cos, sin)."""
        return self.model.nqs[self._joint[k]] == 2

    @property
    def joint_of_dof(self):
        """Return the joint's name of each dof."""
        return [self.model.names[j] for j in self._joint]

    @property
    def joint_of_coordinate(self):
        """Return the joint's name of each coordinate."""
        return [
            self.model.names[j] for j in self._joints for _ in range(COORDINATES[self.model.nvs[j]])
        ]

    # --- between the caller's order of dofs and Pinocchio's

    def to_pin(self, x):
        """Put a velocity-like vector into Pinocchio's order."""
        out = np.empty(self.nv)
        out[self._order] = x
        return out

    def from_pin(self, x):
        """Put a velocity-like vector, or both axes of a matrix, into the caller's order (always a
        copy).
        """
        return x[self._order].copy() if x.ndim == 1 else x[np.ix_(self._order, self._order)]

    def configuration(self, q):
        """Return Pinocchio's configuration vector."""
        out = np.empty(self.model.nq)
        for j in self._joints:
            part = q[self._first[j] : self._first[j] + COORDINATES[self.model.nvs[j]]]
            at = self.model.idx_qs[j]
            if self.model.nqs[j] == 2:
                out[at : at + 2] = np.cos(part[0]), np.sin(part[0])
            elif self.model.nvs[j] == 3:
                out[at : at + 4] = part[0], part[1], np.cos(part[2]), np.sin(part[2])
            else:
                out[at : at + len(part)] = part
        return out

    @cached_property
    def neutral(self):
        """Return the positions of zero, quaternions at the identity."""
        q = np.zeros(self.nq)
        for j in self._joints:
            if self.model.nvs[j] == 6:
                q[self._first[j] + 6] = 1.0
        return q

    def moved(self, q, step):
        """Return q after a step: sums, and where a joint has several dofs the motion along a
        constant twist.
        """
        out = np.array(q, dtype=float)
        end = None
        for k, j in enumerate(self._joint):
            first = self._first[j]
            nv = self.model.nvs[j]
            at = self.model.idx_qs[j]
            if nv == 1:
                out[first] += step[k]
            elif self._order[k] == self.model.idx_vs[j]:
                end = (
                    pin.integrate(self.model, self.configuration(q), self.to_pin(step))
                    if end is None
                    else end
                )
                if nv == 3:
                    out[first : first + 3] = (
                        end[at],
                        end[at + 1],
                        np.arctan2(end[at + 3], end[at + 2]),
                    )
                else:
                    out[first : first + 7] = end[at : at + 7]
        return out

    def at(self, q, qd, tau=None):
        """Return the oracle's answers at one state."""
        return State(
            self,
            np.array(q, float),
            np.array(qd, float),
            None if tau is None else np.array(tau, float),
        )

    # --- functions of the configuration

    def mass_matrix(self, q):
        """Return M(q), armature included."""
        upper = np.triu(
            pin.crba(self.model, self.data, self.configuration(q))
        )  # crba fills that triangle only
        return self.from_pin(upper + np.triu(upper, 1).T)

    def unit_factor(self, q):
        """Return U with unit diagonal, and D, of M = U D Uᵀ."""
        pin.crba(self.model, self.data, self.configuration(q))
        pin.cholesky.decompose(self.model, self.data)
        return self.from_pin(self.data.U), self.from_pin(self.data.D)

    def factor(self, q):
        """Return m = U √D."""
        unit, D = self.unit_factor(q)
        return unit * np.sqrt(D)

    def gravity_torque(self, q):
        """Return g(q)."""
        return self.from_pin(
            pin.computeGeneralizedGravity(self.model, self.data, self.configuration(q))
        )

    # --- along a motion

    def coriolis_torque(self, q, qd):
        """Return c(q, q̇), the velocity terms of M q̈ + c + g = τ."""
        gravity = self.model.gravity.linear.copy()
        self.model.gravity.linear = np.zeros(
            3
        )  # rather than take away g, which may be far larger than c
        nle = pin.nonLinearEffects(self.model, self.data, self.configuration(q), self.to_pin(qd))
        self.model.gravity.linear = gravity
        return self.from_pin(nle)

    def coriolis_matrix(self, q, qd):
        """Return Pinocchio's C_s with c = C_s q̇ and Ṁ = C_s + C_sᵀ."""
        C_s = pin.computeCoriolisMatrix(
            self.model, self.data, self.configuration(q), self.to_pin(qd)
        )
        return self.from_pin(C_s)

    def mass_matrix_rate(self, q, qd):
        """Return Ṁ of M = Σ JᵀIJ, body by body in its own axes.

        Pinocchio's C_s is of sums in the world's axes. There a heavy body that passes by rounds
        the rate of a small inertia about its own joint.
        """
        args = self.configuration(q), self.to_pin(qd)
        pin.computeJointJacobiansTimeVariation(self.model, self.data, *args)
        half = np.zeros((self.nv, self.nv))
        for joint in range(1, self.model.njoints):
            J = pin.getJointJacobian(self.model, self.data, joint, pin.LOCAL)
            J_rate = pin.getJointJacobianTimeVariation(self.model, self.data, joint, pin.LOCAL)
            half += J.T @ self.model.inertias[joint].matrix() @ J_rate
        return self.from_pin(half + half.T)

    def inverse_dynamics(self, q, qd, qdd):
        """Return τ, gravity included."""
        args = self.configuration(q), self.to_pin(qd), self.to_pin(qdd)
        return self.from_pin(pin.rnea(self.model, self.data, *args))

    def forward_dynamics(self, q, qd, tau):
        """Return q̈, gravity included."""
        args = self.configuration(q), self.to_pin(qd), self.to_pin(tau)
        return self.from_pin(pin.aba(self.model, self.data, *args))

    def effort_of(self, q, wrenches, frame):
        """Return Jᵀf of wrenches, force first, at the origins of links, in the axes of the link or
        the world.
        """
        axes = {"link": pin.LOCAL, "world": pin.LOCAL_WORLD_ALIGNED}[frame]
        tau = np.zeros(self.nv)
        configuration = self.configuration(q)
        for name, wrench in wrenches.items():
            at = self.model.getFrameId(name, pin.FrameType.BODY)
            J = pin.computeFrameJacobian(self.model, self.data, configuration, at, axes)
            tau += J.T @ np.asarray(wrench, dtype=float)
        return self.from_pin(tau)

    def center_of_mass(self, q):
        """Return mass and centre of mass of all bodies; Pinocchio leaves out the body of the
        world.
        """
        com = pin.centerOfMass(self.model, self.data, self.configuration(q))
        fixed = self.model.inertias[0]
        mass = self.mass + fixed.mass
        return mass, (self.mass * com + fixed.mass * fixed.lever) / mass

    def potential_energy(self, q):
        """Return the energy in the field of gravity; Pinocchio leaves out the body of the world."""
        energy = pin.computePotentialEnergy(self.model, self.data, self.configuration(q))
        fixed = self.model.inertias[0]
        return energy - fixed.mass * self.model.gravity.linear @ fixed.lever

    def regressor(self, q, qd, qdd, links):
        """Return the regressor of the parameters of links."""
        arguments = self.configuration(q), self.to_pin(qd), self.to_pin(qdd)
        return link_regressor(self.model, self.data, arguments, links)[self._order]

    # --- energy, link by link

    def link_energy(self, q, qd):
        """Return each URDF link's kinetic energy from its own <inertial>; no armature, no merged
        bodies.
        """
        pin.forwardKinematics(self.model, self.data, self.configuration(q), self.to_pin(qd))
        energy = {}
        for link in self.xml.findall("link"):
            name = link.get("name")
            mass, com, inertia = _inertial(link)
            frame = self.model.getFrameId(name, pin.FrameType.BODY)
            twist = pin.getFrameVelocity(self.model, self.data, frame, pin.LOCAL)
            at_com = twist.linear + np.cross(twist.angular, com)
            energy[name] = (
                0.5 * mass * at_com @ at_com + 0.5 * twist.angular @ inertia @ twist.angular
            )
        return energy

    def child_link(self, k):
        """Return the URDF link that dof k moves."""
        joint = next(j for j in self.xml.findall("joint") if j.get("name") == self.dof_names[k])
        return joint.find("child").get("link")


def link_regressor(model, data, arguments, links):
    """Return Pinocchio's regressor at (q, q̇, q̈) by parameters of links, from that of its joints'
    bodies.
    """
    by_body = pin.computeJointTorqueRegressor(model, data, *arguments)
    by_body = by_body.reshape(model.nv, -1)  # a vector if there is one joint
    by_body = np.hstack([np.zeros((model.nv, 10)), by_body])  # of the world
    blocks = []
    for link in links:
        frame = model.frames[model.getFrameId(link, pin.FrameType.BODY)]

        def in_body(parameters, placement=frame.placement):
            """Return parameters of a body in the axes of its joint; linear, but the mass may not be
            0.
            """
            inertia = pin.Inertia.FromDynamicParameters(parameters)
            return placement.act(inertia).toDynamicParameters()

        unit = np.eye(10)
        columns = [in_body(unit[0])]
        columns += [in_body(unit[0] + axis) - columns[0] for axis in unit[1:]]
        body = frame.parentJoint
        blocks.append(by_body[:, 10 * body : 10 * body + 10] @ np.transpose(columns))
    return np.hstack(blocks)


class State:
    """What the oracle says at one (q, q̇, τ); every quantity is computed once, when first asked
    for.
    """

    def __init__(self, oracle, q, qd, tau):
        """Keep the state; see `Oracle.at`."""
        self.oracle = oracle
        self.q = q
        self.qd = qd
        self.tau = tau

    @cached_property
    def M(self):
        """Return the mass matrix."""
        return self.oracle.mass_matrix(self.q)

    @cached_property
    def _factors(self):
        return self.oracle.unit_factor(self.q)

    @property
    def unit(self):
        """Return U = [I + HφK]."""
        return self._factors[0]

    @property
    def D(self):
        """Return the articulated joint inertias."""
        return self._factors[1]

    @cached_property
    def m(self):
        """Return m = U √D."""
        return self.unit * np.sqrt(self.D)

    @cached_property
    def l(self):  # noqa: E743 (the paper's name)
        """Return m⁻¹."""
        return np.linalg.solve(self.m, np.eye(len(self.m)))

    @cached_property
    def condition(self):
        """Return cond(M)."""
        return float(np.linalg.cond(self.M))

    @cached_property
    def scaled_condition(self):
        """Return cond(M) in units in which M_kk = 1: what rounding is amplified by, whatever the
        units.
        """
        unit = np.sqrt(np.diag(self.M))
        return float(np.linalg.cond(self.M / np.outer(unit, unit))) if len(unit) else 1.0

    @cached_property
    def c(self):
        """Return the bias torque without gravity."""
        return self.oracle.coriolis_torque(self.q, self.qd)

    @cached_property
    def g(self):
        """Return the gravity torque."""
        return self.oracle.gravity_torque(self.q)

    @cached_property
    def nu(self):
        """Return ν = mᵀ q̇."""
        return self.m.T @ self.qd

    @cached_property
    def xi(self):
        """Return ξ = Uᵀ q̇."""
        return self.unit.T @ self.qd

    @cached_property
    def epsilon(self):
        """Return ε = ℓ τ."""
        return np.linalg.solve(self.m, self.tau)

    @cached_property
    def kappa(self):
        """Return κ = U⁻¹ τ."""
        return np.linalg.solve(self.unit, self.tau)

    @cached_property
    def gravity(self):
        """Return ε_g = ℓ g."""
        return np.linalg.solve(self.m, self.g)

    @cached_property
    def kinetic_energy(self):
        """Return ½ q̇ᵀMq̇ (computeKineticEnergy would drop the armature of unaligned joints)."""
        return 0.5 * self.qd @ self.M @ self.qd

    @cached_property
    def C_s(self):
        """Return Pinocchio's Coriolis matrix."""
        return self.oracle.coriolis_matrix(self.q, self.qd)

    @cached_property
    def mdot(self):
        """Return ṁ, exact: M = mmᵀ gives ℓṀℓᵀ = X + Xᵀ with X = ℓṁ upper triangular."""
        o = self.oracle
        m, Mdot = (np.empty((o.nv, o.nv)) for _ in range(2))
        at = np.ix_(o._order, o._order)  # in Pinocchio's order, where m is upper triangular
        m[at] = self.m
        Mdot[at] = o.mass_matrix_rate(self.q, self.qd)
        A = np.linalg.solve(m, np.linalg.solve(m, Mdot).T)
        return o.from_pin(m @ (np.triu(A, 1) + 0.5 * np.diag(np.diag(A))))

    @cached_property
    def coriolis(self):
        """Return C = ℓc − ṁᵀq̇, exact to rounding."""
        return np.linalg.solve(self.m, self.c) - self.mdot.T @ self.qd

    @cached_property
    def coriolis_scale(self):
        """Return |ℓc| + |ṁᵀq̇|, the two terms whose difference C is, for errors to be relative to.

        Where both vanish identically (one joint, a gantry, rotors about principal axes) all is
        rounding, and 10⁻²|ν||q̇| stands in; in every robot that has a Coriolis term they are that
        and more.
        """
        terms = np.linalg.norm(np.linalg.solve(self.m, self.c)) + np.linalg.norm(
            self.mdot.T @ self.qd
        )
        return float(max(terms, 1e-2 * np.linalg.norm(self.nu) * np.linalg.norm(self.qd)))

    @cached_property
    def Ddot(self):
        """Return Ḋ: m_kk = √D_k, so ṁ_kk = ½ Ḋ_k/√D_k."""
        return 2 * np.sqrt(self.D) * np.diag(self.mdot)

    @cached_property
    def coriolis_unnormalized(self):
        """Return C_ξ: D ξ̇ + C_ξ = κ with ξ = D^−½ν, each by its own D, and ν̇ = ε − C gives D^½ C
        + ½ Ḋ ξ.
        """
        return np.sqrt(self.D) * self.coriolis + 0.5 * self.Ddot * self.xi

    @cached_property
    def acceleration(self):
        """Return q̈ of aba."""
        return self.oracle.forward_dynamics(self.q, self.qd, self.tau)

    @cached_property
    def nu_dot(self):
        """Return ν̇ = mᵀq̈ + ṁᵀq̇ along aba's acceleration."""
        return self.m.T @ self.acceleration + self.mdot.T @ self.qd

    @cached_property
    def power(self):
        """Return K̇ = q̇ᵀMq̈ + ½ q̇ᵀṀq̇ along aba's acceleration."""
        return self.qd @ (self.M @ self.acceleration + self.C_s @ self.qd)

    @cached_property
    def link_energy(self):
        """Return the energy per URDF link; a joint's armature counts for the link it moves."""
        energy = self.oracle.link_energy(self.q, self.qd)
        for k in np.flatnonzero(self.oracle.armature):
            energy[self.oracle.child_link(k)] += 0.5 * self.oracle.armature[k] * self.qd[k] ** 2
        return energy


def _inertial(link):
    """Return a link's mass, centre of mass and inertia about it, in the link's axes."""
    inertial = link.find("inertial")
    if inertial is None:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    origin = inertial.find("origin")
    xyz, rpy = (
        np.zeros(3)
        if origin is None
        else np.array((origin.get(name) or "0 0 0").split(), dtype=float)
        for name in ("xyz", "rpy")
    )
    i = {name: float(value) for name, value in inertial.find("inertia").attrib.items()}
    local = np.array(
        [
            [i["ixx"], i["ixy"], i["ixz"]],
            [i["ixy"], i["iyy"], i["iyz"]],
            [i["ixz"], i["iyz"], i["izz"]],
        ]
    )
    cr, cp, cy = np.cos(rpy)
    sr, sp, sy = np.sin(rpy)
    R = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return float(inertial.find("mass").get("value")), xyz, R @ local @ R.T
