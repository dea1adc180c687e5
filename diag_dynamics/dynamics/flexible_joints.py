# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dynamics of a robot with flexible joints: equations of links and motors, and frequencies."""

from __future__ import annotations

from typing import NamedTuple, cast

import numpy as np

from diag_dynamics.arrays import Array, Frame, VectorLike, Wrenches
from diag_dynamics.checks import instance, vector
from diag_dynamics.dynamics.dynamics import DiagonalDynamics
from diag_dynamics.model import RobotModel
from diag_dynamics.model.joint_types import places
from diag_dynamics.results import Evaluation


class FlexibleEvaluation(NamedTuple):
    """Terms of ν̇ + C + ε_g = ε (+ ℓJᵀf_ext of the links) for links, then motors.

    Shapes are (nv + nf,), with nf flexible joints.

    ν = (mᵀq̇, B^½θ̇), C = (C(q, ν_q), 0), ε_g = (ℓg, 0), ε = (ℓτ_J, B^−½(τ_motor − τ_J)): the
    reduced model (Spong 1987). Powers balance: kinetic_power + Σ spring_power + Σ
    loss = q̇ᵀ(τ − g) + θ̇ᵀτ_motor, with τ of joints without a spring.
    """

    link: Evaluation  # of the links, with τ_J as effort of flexible joints
    nu: Array  # [J^½]
    coriolis: Array  # [J^½/s]
    gravity: Array  # [J^½/s]
    epsilon: Array  # [J^½/s]
    spring_torque: Array  # τ_J [N m, N], shape (nf,)
    motor_energy: Array  # ½Bθ̇² [J], shape (nf,)
    spring_energy: Array  # ½k(θ − q)² [J], shape (nf,)
    kinetic_power: float  # K̇ of links and motors, νᵀ(ε − ε_g), and of wrenches [W]
    spring_power: Array  # k(θ − q)(θ̇ − q̇) [W], shape (nf,)
    loss: Array  # d(θ̇ − q̇)² [W], shape (nf,)


class FlexibleDynamics:
    """Compute the dynamics of a robot with springs between motors and links.

    Links are evaluated in O(N) sweeps, motors one by one, and powers of both balance.

    q [rad, m], shape (nq,), and qd, shape (nv,), are of the links. theta and thetad, shape (nf,),
    are θ and θ̇ of the motors, motor angle over gear. tau [N m, N], shape (nv,), has the efforts of
    motors, gear times torque, at flexible joints. Wrong arguments raise InputError. The model may
    have no flexible joints; without its rotor a joint may move no inertia, which is a
    MasslessLinkError.

    Attributes
    ----------
    names : tuple of str
        The nf flexible joints, in the order of degrees of freedom.
    dofs, coordinates : ndarray of int, shape (nf,)
        Their places in q̇ and in q.
    stiffness, damping, rotor_inertia : ndarray, shape (nf,)
        k [N m/rad, N/m], d [N m s/rad, N s/m] and B = N²J_rotor [kg m², kg].
    link : DiagonalDynamics
        Of the links, without rotors of flexible joints.
    """

    def __init__(self, model: RobotModel) -> None:
        joints = instance("model", model, RobotModel).flexible_joints
        self.model = model
        self.names = tuple(joints)
        self.link = DiagonalDynamics(model.with_spring_efforts() if joints else model)
        self.stiffness: Array = np.array([joint.stiffness for joint in joints.values()])
        self.damping: Array = np.array([joint.damping for joint in joints.values()])
        self.rotor_inertia: Array = np.array([joint.reflected_inertia for joint in joints.values()])
        self.dofs: Array = np.array(places(self.names, model.dof_names), dtype=int)
        self.coordinates: Array = np.array(places(self.names, model.coordinate_names), dtype=int)

    def _stretch(
        self, q: VectorLike, theta: VectorLike, qd: VectorLike, thetad: VectorLike
    ) -> tuple[Array, Array]:
        """Return θ − q and θ̇ − q̇."""
        q = vector("q", q, self.model.coordinate_names)
        qd = vector("qd", qd, self.model.dof_names)
        theta = vector("theta", theta, self.names)
        thetad = vector("thetad", thetad, self.names)
        return theta - q[self.coordinates], thetad - qd[self.dofs]

    def spring_torque(
        self, q: VectorLike, theta: VectorLike, qd: VectorLike, thetad: VectorLike
    ) -> Array:
        """Return τ_J = k(θ − q) + d(θ̇ − q̇) [N m, N], shape (nf,)."""
        stretch, rate = self._stretch(q, theta, qd, thetad)
        return self.stiffness * stretch + self.damping * rate

    def _efforts(self, tau: VectorLike, torque: Array) -> tuple[Array, Array]:
        """Return the efforts on links, (nv,), and on motors, (nf,)."""
        effort = vector("tau", tau, self.model.dof_names)
        motor = effort[self.dofs] - torque
        effort[self.dofs] = torque
        return effort, motor

    def evaluate(
        self,
        q: VectorLike,
        theta: VectorLike,
        qd: VectorLike,
        thetad: VectorLike,
        tau: VectorLike,
        f_ext: Wrenches | None = None,
        *,
        frame: Frame = "link",
    ) -> FlexibleEvaluation:
        """Return all terms and energies at one state as a :class:`FlexibleEvaluation`."""
        stretch, rate = self._stretch(q, theta, qd, thetad)
        torque = self.stiffness * stretch + self.damping * rate
        effort, motor = self._efforts(tau, torque)
        s = self.link.evaluate(q, qd, effort, f_ext, frame=frame)
        nu = np.sqrt(self.rotor_inertia) * vector("thetad", thetad, self.names)
        epsilon = motor / self.rotor_inertia**0.5
        none = np.zeros(len(self.names))
        return FlexibleEvaluation(
            link=s,
            nu=np.append(s.nu, nu),
            coriolis=np.append(s.coriolis, none),
            gravity=np.append(s.gravity, none),
            epsilon=np.append(cast(Array, s.epsilon), epsilon),
            spring_torque=torque,
            motor_energy=0.5 * nu**2,
            spring_energy=0.5 * self.stiffness * stretch**2,
            kinetic_power=float(s.power or 0.0) + float(nu @ epsilon),
            spring_power=self.stiffness * stretch * rate,
            loss=self.damping * rate**2,
        )

    def accelerations(
        self,
        q: VectorLike,
        theta: VectorLike,
        qd: VectorLike,
        thetad: VectorLike,
        tau: VectorLike,
        f_ext: Wrenches | None = None,
        *,
        frame: Frame = "link",
    ) -> tuple[Array, Array]:
        """Return accelerations of links q̈, shape (nv,), and of motors θ̈, shape (nf,).

        M q̈ + c + g = τ_J + Jᵀf_ext and B θ̈ = τ_motor − τ_J.
        """
        effort, motor = self._efforts(tau, self.spring_torque(q, theta, qd, thetad))
        return self.link.forward_dynamics(
            q, qd, effort, f_ext, frame=frame
        ), motor / self.rotor_inertia
