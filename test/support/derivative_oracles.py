# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Oracles, from Pinocchio, of what goes with rates of change: ∂M/∂q, B, frame Jacobians, coupled
joints.

Imports nothing of diag_dynamics. What `oracles.State` has already (ṁ, Ḋ, C_s, all exact) is not
repeated here.
"""

import numpy as np
import pinocchio as pin

from coupling import Coupled
from oracles import Oracle


def bracket(t):
    """Return B = ℓ (C_s − m ṁᵀ) ℓᵀ."""
    return np.linalg.solve(t.m, np.linalg.solve(t.m, t.C_s.T).T) - np.linalg.solve(t.m, t.mdot).T


def bracket_scale(t):
    """Return the size of the terms of which B is the sum: those of ℓ C_s ℓᵀ, and ℓ ṁ; 10⁻²|q̇|
    where all vanish.
    """
    terms = [t.l @ part @ t.l.T for part in t.oracle.coriolis_terms(t.q, t.qd)] + [t.l @ t.mdot]
    return float(max(sum(map(np.linalg.norm, terms)), 1e-2 * np.linalg.norm(t.qd)))


def coriolis_scale(t):
    """Return the size of the terms of which C_s is the sum, or 10⁻²|M||q̇|; in units in which M_kk
    = 1.
    """
    unit = np.sqrt(np.diag(t.M))
    weigh = np.outer(unit, unit)
    terms = [np.linalg.norm(part / weigh) for part in t.oracle.coriolis_terms(t.q, t.qd)]
    return float(max(sum(terms), 1e-2 * np.linalg.norm(t.M / weigh) * np.linalg.norm(t.qd)))


class RateOracle(Oracle):
    """An `Oracle` whose Coriolis matrix does not lose digits.

    Pinocchio's own is made of inertias about the world's origin: at a light wrist far from it,
    tiago's arm_7_joint with M_kk = 4e-6 kg m², it is good to 1e-11 only. What it is made of here is
    exact to some 1e-14; the two are compared in `test_derivatives.py`.
    """

    def newton_euler_by_position(self, q, x):
        """Return ∂(M(q) x)/∂q, that of Newton–Euler at rest and without gravity.

        Of a joint with several degrees of freedom ∂/∂q is along its twist, and so is what is meant
        in this file.
        """
        gravity = self.model.gravity.linear.copy()
        self.model.gravity.linear = np.zeros(3)
        args = self.configuration(q), np.zeros(self.nv), self.to_pin(x)
        by_position = pin.computeRNEADerivatives(self.model, self.data, *args)[0]
        self.model.gravity.linear = gravity
        return self.from_pin(by_position)

    def mass_matrix_rate(self, q, qd):
        """Return Ṁ = Σ q̇_i ∂M/∂q_i."""
        columns = [self.newton_euler_by_position(q, e) @ qd for e in np.eye(self.nv)]
        return np.reshape(columns, (self.nv, self.nv)).T

    def coriolis_matrix(self, q, qd):
        """Return C_s of the Levi-Civita connection of M: C_s x is the covariant derivative of a
        constant x along q̇.
        """
        return sum(self.coriolis_terms(q, qd))

    def coriolis_terms(self, q, qd):
        """Return what C_s is the sum of.

        For joints of one degree of freedom these are the Christoffel symbols, ½[Ṁ + N − Nᵀ] with N
        = ∂(Mq̇)/∂q. Rates of the others are no derivatives of coordinates, so their Lie brackets ad
        come in (Koszul's formula).
        """
        N = self.newton_euler_by_position(q, qd)
        terms = [self.mass_matrix_rate(q, qd), N, -N.T]
        if max(self.model.nvs) > 1:
            M = self.mass_matrix(q)
            ad = self.brackets(qd)
            momentum = M @ qd
            e = np.eye(self.nv)
            terms += [
                M @ ad,
                -ad.T @ M,
                -np.column_stack([self.brackets(x).T @ momentum for x in e]),
            ]
        return [0.5 * part for part in terms]

    def brackets(self, x):
        """Return ad_x: y ↦ [x, y], joint by joint; 0 for a joint of one degree of freedom."""
        ad = np.zeros((self.nv, self.nv))
        x = self.to_pin(x)
        for j in range(1, self.model.njoints):
            count = self.model.nvs[j]
            at = self.model.idx_vs[j]
            if count > 1:
                rows = [0, 1, 5] if count == 3 else list(range(6))
                twist = np.zeros(6)
                twist[rows] = x[at : at + count]
                ad[at : at + count, at : at + count] = pin.Motion(twist).action[np.ix_(rows, rows)]
        return self.from_pin(ad)


def link_placement(oracle, q, link):
    """Return where a link's frame is in the world."""
    if isinstance(oracle, Coupled):
        return link_placement(oracle.full, oracle.q_full(q), link)
    at = oracle.model.getFrameId(link, pin.FrameType.BODY)
    pin.framesForwardKinematics(oracle.model, oracle.data, oracle.configuration(q))
    return oracle.data.oMf[at].copy()


def jacobian(oracle, q, link, point=(0.0, 0.0, 0.0), frame="link"):
    """Return J (6 × nv), linear first, of the velocity of a point given in the link's axes; in axes
    of link or world.
    """
    if isinstance(oracle, Coupled):
        return jacobian(oracle.full, oracle.q_full(q), link, point, frame) @ oracle.G
    at = oracle.model.getFrameId(link, pin.FrameType.BODY)
    J = pin.computeFrameJacobian(oracle.model, oracle.data, oracle.configuration(q), at, pin.LOCAL)
    J = J.reshape(6, oracle.nv)[:, oracle._order]  # of one joint Pinocchio gives a vector
    J[:3] -= np.cross(np.asarray(point, float), J[3:], axis=0)  # v_p = v + ω × r
    if frame == "world":
        R = link_placement(oracle, q, link).rotation
        J = np.vstack([R @ J[:3], R @ J[3:]])
    return J


def carriers(oracle, link):
    """Return the dofs that carry a link."""
    if isinstance(oracle, Coupled):
        free = carriers(oracle.full, link)
        return {k for k in range(oracle.nv) if oracle.G[sorted(free), k].any()}
    joint = oracle.model.frames[oracle.model.getFrameId(link, pin.FrameType.BODY)].parentJoint
    if joint == 0:
        return set()
    last = oracle._at[oracle.model.idx_vs[joint] + oracle.model.nvs[joint] - 1]
    return set(oracle.ancestors(last)) | {last}


class CoupledRates(Coupled):
    """A `Coupled` robot over a `RateOracle`: Ṁ and the terms of C_s are projected by G, too."""

    Full = RateOracle

    def coriolis_terms(self, q, qd):
        """Return the terms of GᵀC_sG."""
        return [
            self.G.T @ part @ self.G
            for part in self.full.coriolis_terms(self.q_full(q), self.G @ qd)
        ]

    def mass_matrix_rate(self, q, qd):
        """Return GᵀṀG."""
        return self.G.T @ self.full.mass_matrix_rate(self.q_full(q), self.G @ qd) @ self.G


def rate_oracle_of(robot, dof_names=None):
    """Return the oracle of a robot, which couples its mimic joints where the robot does."""
    return (CoupledRates if robot.mimic == "embed" else RateOracle)(
        robot.urdf, dof_names, **robot.options
    )
