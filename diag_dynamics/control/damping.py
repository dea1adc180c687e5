# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Laws without a target: the robot is braked, or only held against gravity."""

from __future__ import annotations

from diag_dynamics.arrays import VectorLike
from diag_dynamics.checks import per_name
from diag_dynamics.control.command import Command
from diag_dynamics.control.law import Law
from diag_dynamics.dynamics import DiagonalDynamics


class RateDamping(Law):
    """Rate control ε = −cν (Control 8.1): every total joint rate decays on its own.

    V = K = ½|ν|² and dV/dt = −νᵀcν. With equal gains K decays as exp(−2ct), in any configuration and motion.

    Parameters
    ----------
    dynamics : DiagonalDynamics
    gain : float or array_like, shape (nv,)
        c [1/s], one for all total rates or one for each.

    Raises
    ------
    InputError, UnsupportedError
        A gain is not a positive number; or see :class:`Law`.
    """

    def __init__(self, dynamics: DiagonalDynamics, gain: VectorLike | float) -> None:
        super().__init__(dynamics)
        self.gain = per_name("gain", gain, dynamics.model.dof_names, "a finite number > 0 [1/s]")

    def command(self, q: VectorLike, qd: VectorLike) -> Command:
        """Command at the positions q [rad, m] and rates qd [rad/s, m/s], each of shape (nv,)."""
        nu = self.dynamics.nu_from_qd(q, qd)
        epsilon = -self.gain * nu
        return self._command(q, nu, epsilon, 0.5 * float(nu @ nu), float(nu @ epsilon))


class GravityCompensation(Law):
    """Gravity compensation alone, ε = 0: the robot weighs nothing and can be led by hand.

    V = K = ½|ν|², which nothing but the hand and friction changes: dV/dt = 0.
    """

    def command(self, q: VectorLike, qd: VectorLike) -> Command:
        """Command at the positions q [rad, m] and rates qd [rad/s, m/s], each of shape (nv,)."""
        nu = self.dynamics.nu_from_qd(q, qd)
        return self._command(q, nu, 0.0 * nu, 0.5 * float(nu @ nu), 0.0)
