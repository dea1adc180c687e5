# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracking of a joint trajectory, with an error that decays at the same rate in every configuration."""

from __future__ import annotations

import numpy as np

from diag_dynamics.arrays import VectorLike
from diag_dynamics.checks import per_name, vector
from diag_dynamics.control.command import Command
from diag_dynamics.control.law import Law
from diag_dynamics.dynamics import DiagonalDynamics


class JointTracking(Law):
    """Joint-space tracking in total rates: s = ν − ν_r decays as ṡ = −(K + B)s, with B skew.

    With q̇_r = q̇_d − Λ(q − q_d) and ν_r = mᵀq̇_r the law is ε = ν̇_r + B(q, ν)ν_r − Ks. B is skew and B ν = C(q, ν), so
    V = ½|s|² falls at −sᵀKs whatever the configuration; once s is gone, q − q_d decays at Λ. ν̇_r + Bν_r is evaluated as
    ℓ(M q̈_r + C_s q̇_r), a Newton–Euler pass with two velocities, q̈_r = q̈_d − Λ(q̇ − q̇_d).

    Parameters
    ----------
    dynamics : DiagonalDynamics
    gain : float or array_like, shape (nv,)
        K [1/s], one for all components of s or one for each.
    convergence : float or array_like, shape (nv,)
        Λ [1/s], one for all joints or one for each.
    closing : float or array_like, shape (nv,)
        Largest part of q̇_r that takes the error back [rad/s, m/s]; inf for none. Beyond it the reference moves at this rate
        and V falls as before: a target far away is gone to, and not thrown at.

    Raises
    ------
    InputError, UnsupportedError
        A gain is not a positive number; or see :class:`Law`.
    """

    METHODS = (*Law.METHODS, "inverse_dynamics", "coriolis_product", "epsilon_from_tau")

    def __init__(
        self,
        dynamics: DiagonalDynamics,
        gain: VectorLike | float,
        convergence: VectorLike | float,
        closing: VectorLike | float = np.inf,
    ) -> None:
        super().__init__(dynamics)
        model = dynamics.model
        self.gain = per_name("gain", gain, model.dof_names, "a finite number > 0 [1/s]")
        self.convergence = per_name("convergence", convergence, model.dof_names, "a finite number > 0 [1/s]")
        self.closing = per_name("closing", closing, model.dof_names, "a number > 0 [rad/s, m/s]", lambda x: x > 0.0)
        self._turns = np.array([name in model.continuous_joints for name in model.dof_names])
        self._any_turns = bool(self._turns.any())
        self._rest = np.zeros(model.nv)

    def command(
        self,
        q: VectorLike,
        qd: VectorLike,
        desired_q: VectorLike,
        desired_qd: VectorLike | None = None,
        desired_qdd: VectorLike | None = None,
    ) -> Command:
        """Command at one state, for where the robot should be at this time.

        A continuous joint is taken the shorter way round.

        Parameters
        ----------
        q, qd : array_like, shape (nv,)
            Positions [rad, m] and rates [rad/s, m/s].
        desired_q, desired_qd, desired_qdd : array_like, shape (nv,)
            Desired positions, rates and accelerations [rad/s², m/s²]; at rest by default.

        Returns
        -------
        Command
            V = ½|s|², its error q_d − q.

        Raises
        ------
        InputError
            A vector has another shape or is not finite; the joint is named.
        """
        dynamics, names = self.dynamics, self.dynamics.model.dof_names
        q, qd = vector("q", q, names), vector("qd", qd, names)
        error = vector("desired_q", desired_q, names) - q
        if self._any_turns:
            error[self._turns] = np.remainder(error[self._turns] + np.pi, 2.0 * np.pi) - np.pi
        qd_d = self._rest if desired_qd is None else vector("desired_qd", desired_qd, names)
        qdd_d = self._rest if desired_qdd is None else vector("desired_qdd", desired_qdd, names)
        wanted = self.convergence * error
        back = np.clip(wanted, -self.closing, self.closing)
        qd_r = qd_d + back
        qdd_r = qdd_d + np.where(back == wanted, self.convergence, 0.0) * (qd_d - qd)

        nu, s = dynamics.nu_from_qd(q, qd), dynamics.nu_from_qd(q, qd - qd_r)
        tau = dynamics.inverse_dynamics(q, self._rest, qdd_r)  # M q̈_r + g
        tau += dynamics.coriolis_product(q, qd, qd_r)
        braking = self.gain * s
        tau -= dynamics.tau_from_epsilon(q, braking)
        g = dynamics.gravity_torque(q)
        epsilon = dynamics.epsilon_from_tau(q, tau - g)
        return Command(tau, epsilon, g, nu, 0.5 * float(s @ s), -float(s @ braking), error)
