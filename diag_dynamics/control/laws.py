# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Control laws in (ν, ε): rate damping, gravity compensation and joint tracking."""

from __future__ import annotations

import numpy as np

from diag_dynamics.arrays import Array, VectorLike
from diag_dynamics.checks import instance, per_name, vector
from diag_dynamics.control.command import Command, PoseError
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import UnsupportedError
from diag_dynamics.rotations import wrap_angle


def actuated(dynamics: DiagonalDynamics) -> DiagonalDynamics:
    """Return the dynamics of a robot with a motor at every degree of freedom; raise UnsupportedError for others."""
    model = instance("dynamics", dynamics, DiagonalDynamics).model
    if model.floating_base:
        raise UnsupportedError(
            f"robot '{model.name}' has a floating base, which no motor drives: control needs a fixed base."
        )
    for joint in model.joint_names:
        if joint not in model.dof_names:
            raise UnsupportedError(
                f"joint '{joint}' of robot '{model.name}' has several degrees of freedom, which no motor drives; lock it."
            )
    return dynamics


class Law:
    """Control law in (ν, ε) for one robot.

    A law uses the workspace of its :class:`DiagonalDynamics`: one thread. The constructor compiles all that the law calls.
    It raises UnsupportedError for a floating base or another joint of several degrees of freedom.
    """

    METHODS: tuple[str, ...] = "nu_from_qd", "tau_from_epsilon", "gravity_torque"

    def __init__(self, dynamics: DiagonalDynamics) -> None:
        self.dynamics = actuated(dynamics)
        dynamics.compile(*self.METHODS)

    def _command(
        self,
        q: VectorLike,
        nu: Array,
        epsilon: Array,
        lyapunov: float,
        rate: float,
        error: PoseError | None = None,
    ) -> Command:
        """Return the command of working moments without gravity: τ = mε + g."""
        g = self.dynamics.gravity_torque(q)
        tau = self.dynamics.tau_from_epsilon(q, epsilon)
        tau += g
        return Command(tau, epsilon, g, nu, lyapunov, rate, error)


class RateDamping(Law):
    """Rate control ε = −cν (Control 8.1): every total joint rate decays on its own.

    V = K = ½|ν|² and dV/dt = −νᵀcν. With equal gains K decays as exp(−2ct), in any configuration and motion.

    Parameters
    ----------
    dynamics : DiagonalDynamics
    gain : float or array_like, shape (nv,)
        c > 0 [1/s], one for all total rates or one for each.
    """

    def __init__(self, dynamics: DiagonalDynamics, gain: VectorLike | float) -> None:
        super().__init__(dynamics)
        self.gain = per_name("gain", gain, dynamics.model.dof_names, "a finite number > 0 [1/s]")

    def command(self, q: VectorLike, qd: VectorLike) -> Command:
        """Return the command at the positions q [rad, m] and rates qd [rad/s, m/s], each of shape (nv,)."""
        nu = self.dynamics.nu_from_qd(q, qd)
        epsilon = -self.gain * nu
        return self._command(q, nu, epsilon, 0.5 * float(nu @ nu), float(nu @ epsilon))


class GravityCompensation(Law):
    """Gravity compensation alone, ε = 0: the robot weighs nothing and can be guided by hand.

    V = K = ½|ν|², which only the hand and friction change: dV/dt = 0.
    """

    def command(self, q: VectorLike, qd: VectorLike) -> Command:
        """Return the command at the positions q [rad, m] and rates qd [rad/s, m/s], each of shape (nv,)."""
        nu = self.dynamics.nu_from_qd(q, qd)
        return self._command(q, nu, 0.0 * nu, 0.5 * float(nu @ nu), 0.0)


class JointTracking(Law):
    """Joint-space tracking in total rates: s = ν − ν_r decays as ṡ = −(K + B)s, with B skew.

    With q̇_r = q̇_d − Λ(q − q_d) and ν_r = mᵀq̇_r the law is ε = ν̇_r + B(q, ν)ν_r − Ks. B is skew and B ν = C(q, ν), so
    V = ½|s|² falls at −sᵀKs in every configuration. Once s is zero, q − q_d decays at Λ. ν̇_r + Bν_r is evaluated as
    ℓ(M q̈_r + C_s q̇_r), a Newton–Euler pass with two velocities, q̈_r = q̈_d − Λ(q̇ − q̇_d).

    Parameters
    ----------
    dynamics : DiagonalDynamics
    gain : float or array_like, shape (nv,)
        K > 0 [1/s], one for all components of s or one for each.
    convergence : float or array_like, shape (nv,)
        Λ > 0 [1/s], one for all joints or one for each.
    closing : float or array_like, shape (nv,)
        Largest part of q̇_r that reduces the error [rad/s, m/s]; inf for none. A larger error is reduced at this rate, and V
        falls as before.
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
        model, names = dynamics.model, dynamics.model.dof_names
        self.gain = per_name("gain", gain, names, "a finite number > 0 [1/s]")
        self.convergence = per_name("convergence", convergence, names, "a finite number > 0 [1/s]")
        self.closing = per_name("closing", closing, names, "a number > 0 [rad/s, m/s]", lambda x: x > 0.0)
        self._continuous = np.array([name in model.continuous_joints for name in names])
        self._has_continuous = bool(model.continuous_joints)
        self._zero = np.zeros(model.nv)

    def command(
        self,
        q: VectorLike,
        qd: VectorLike,
        desired_q: VectorLike,
        desired_qd: VectorLike | None = None,
        desired_qdd: VectorLike | None = None,
    ) -> Command:
        """Return the command at one state for the desired motion at this time.

        V is ½|s|², and the error q_d − q, of a continuous joint the shorter way round.

        Parameters
        ----------
        q, qd : array_like, shape (nv,)
            Positions [rad, m] and rates [rad/s, m/s].
        desired_q, desired_qd, desired_qdd : array_like, shape (nv,)
            Desired positions, rates and accelerations [rad/s², m/s²]; at rest by default.
        """
        dynamics, names = self.dynamics, self.dynamics.model.dof_names
        q, qd = vector("q", q, names), vector("qd", qd, names)
        error = self._error(vector("desired_q", desired_q, names), q)
        qd_d = self._zero if desired_qd is None else vector("desired_qd", desired_qd, names)
        qdd_d = self._zero if desired_qdd is None else vector("desired_qdd", desired_qdd, names)
        closing = self.convergence * error
        bounded = np.clip(closing, -self.closing, self.closing)
        qd_r = qd_d + bounded
        qdd_r = qdd_d + np.where(bounded == closing, self.convergence, 0.0) * (qd_d - qd)

        nu, s = dynamics.nu_from_qd(q, qd), dynamics.nu_from_qd(q, qd - qd_r)
        tau = dynamics.inverse_dynamics(q, self._zero, qdd_r)  # M q̈_r + g
        tau += dynamics.coriolis_product(q, qd, qd_r)
        braking = self.gain * s
        tau -= dynamics.tau_from_epsilon(q, braking)
        g = dynamics.gravity_torque(q)
        epsilon = dynamics.epsilon_from_tau(q, tau - g)
        return Command(tau, epsilon, g, nu, 0.5 * float(s @ s), -float(s @ braking), error)

    def _error(self, desired_q: Array, q: Array) -> Array:
        error = desired_q - q
        if self._has_continuous:
            error[self._continuous] = wrap_angle(error[self._continuous])
        return error
