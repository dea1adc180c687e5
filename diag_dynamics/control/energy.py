# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A bound on the kinetic energy that a law may put into the robot."""

from __future__ import annotations

from diag_dynamics.arrays import VectorLike
from diag_dynamics.checks import positive, vector
from diag_dynamics.control.command import Command
from diag_dynamics.control.law import actuated
from diag_dynamics.dynamics import DiagonalDynamics


class EnergyLimiter:
    """Kinetic-energy limiter, a filter on any law's command: ε ← ε − ν max(0, νᵀε − αh)/|ν|², h = K_max − K.

    The command alone then moves the robot with dK/dt ≤ αh: K stays below K_max, and returns to it at the rate α from above.
    As νᵀC = 0 (Lemma 7.1) the law needs no dynamics but ν. It takes power away, along ν, and never adds any. What pushes
    from outside comes on top, K ≤ K_max + P/α while that has the power P, unless an estimate of it is passed on.

    Parameters
    ----------
    dynamics : DiagonalDynamics
    limit : float
        K_max [J].
    rate : float
        α [1/s]. A loop of period h [s] needs αh < 1.

    Raises
    ------
    InputError, UnsupportedError
        Not positive numbers; or see :class:`Law`.
    """

    def __init__(self, dynamics: DiagonalDynamics, limit: float, rate: float) -> None:
        self.dynamics = actuated(dynamics)
        self.limit, self.rate = positive("limit", limit, "[J]"), positive("rate", rate, "[1/s]")
        dynamics.compile("tau_from_epsilon")

    def excess_power(self, command: Command, external: VectorLike | None = None) -> float:
        """Power that has to be taken out of a command [W]: max(0, νᵀ(ε + ε_ext) − αh)."""
        nu = command.nu
        power = float(nu @ command.epsilon)
        if external is not None:
            power += float(nu @ vector("external", external, self.dynamics.model.dof_names))
        return max(0.0, power - self.rate * (self.limit - 0.5 * float(nu @ nu)))

    def filter(self, q: VectorLike, command: Command, external: VectorLike | None = None) -> Command:
        """Return the command, or one of less power.

        Parameters
        ----------
        q : array_like, shape (nv,)
            Positions that the command was computed for [rad, m].
        command : Command
        external : array_like, shape (nv,), optional
            Working moments of what pushes from outside [J^½/s], such as a disturbance observer's residual.

        Returns
        -------
        Command

        Raises
        ------
        InputError
            `q` or `external` is no vector of finite numbers.
        """
        excess = self.excess_power(command, external)
        if excess == 0.0:
            return command
        nu = command.nu
        taken = nu * (excess / float(nu @ nu))  # excess > 0 means ν is not small: |ν||ε| > αh, or K > K_max
        tau = command.tau - self.dynamics.tau_from_epsilon(q, taken)
        return command._replace(tau=tau, epsilon=command.epsilon - taken)
