# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a robot can bear: efforts, how fast they change, and joint ranges."""

from __future__ import annotations

import numpy as np

from diag_dynamics.arrays import Array, VectorLike
from diag_dynamics.checks import instance, not_negative, per_name, vector
from diag_dynamics.control.command import Command
from diag_dynamics.control.law import actuated
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import RobotModel

HEAVY = 0.9
"""Part of an effort limit that gravity may take before the joint no longer holds the others back."""


class EffortSaturation:
    """Effort limits |τ_k| ≤ L_k that keep the direction of ε: τ = g + s(τ − g) with one s in [0, 1].

    Gravity comes first, for an arm that stays up matters more than one that arrives. The rest, which moves it, is scaled as
    a whole: its power νᵀε keeps its sign, where joints cut one by one can turn braking into driving. A joint whose gravity
    torque alone exceeds its limit has no s: it gives what it can, and the others are scaled as if it were none. Between
    `HEAVY` of its limit and all of it the one goes over into the other, so that efforts stay continuous.

    Parameters
    ----------
    model : RobotModel
    limit : array_like, shape (nv,), optional
        L [N m, N], by default the URDF's; inf where there is none.

    Raises
    ------
    InputError
        A limit is not a positive number; the joint is named.
    """

    def __init__(self, model: RobotModel, limit: VectorLike | None = None) -> None:
        self._names = instance("model", model, RobotModel).dof_names
        self.limit = per_name(
            "effort limit",
            model.effort_limit if limit is None else limit,
            self._names,
            "a number > 0 [N m, N]",
            lambda x: x > 0.0,
        )

    def filter(self, command: Command) -> Command:
        """Return the command within the limits, its `scale` s and the joints that made it so in `limited`.

        Parameters
        ----------
        command : Command

        Returns
        -------
        Command
        """
        limit = self.limit
        if (np.abs(command.tau) <= limit).all():
            return command
        g = command.gravity_torque
        rest = command.tau - g
        room = np.where(rest > 0.0, limit - g, limit + g)
        factor = np.ones_like(rest)
        moved = np.abs(rest) > np.maximum(room, 0.0)  # nothing is divided by zero
        factor[moved] = room[moved] / np.abs(rest[moved])
        overload = np.clip((np.abs(g) / limit - HEAVY) / (1.0 - HEAVY), 0.0, 1.0)
        factor = np.where(overload < 1.0, factor + overload * (1.0 - factor), 1.0)
        scale = float(factor.min())
        wanted = g + scale * rest
        tau = np.clip(wanted, -limit, limit)
        at_limit = np.abs(wanted) >= limit * (1.0 - 1e-12)
        limited = tuple(name for name, is_at in zip(self._names, at_limit, strict=True) if is_at)
        return command._replace(tau=tau, epsilon=scale * command.epsilon, scale=scale, limited=limited)


class EffortRateLimiter:
    """Limit on how fast efforts change, |dτ_k/dt| ≤ R_k; it remembers what it last let pass.

    Each joint goes to what is asked at its own rate: were they to wait for each other, one that is slow could hold up the
    gravity torque of the rest. Efforts between two that are within effort limits are so too: it comes last.

    Parameters
    ----------
    model : RobotModel
    rate : float or array_like, shape (nv,)
        R [N m/s, N/s], one for all joints or one for each.
    start : array_like, shape (nv,), optional
        Effort that is on the joints at first [N m, N]. Without it the first command passes as it is.

    Raises
    ------
    InputError
        A rate is not a positive number, or `start` no vector of finite numbers; the joint is named.
    """

    def __init__(self, model: RobotModel, rate: VectorLike | float, start: VectorLike | None = None) -> None:
        self._names = instance("model", model, RobotModel).dof_names
        self.rate = per_name("effort rate", rate, self._names, "a finite number > 0 [N m/s, N/s]")
        self.reset(start)

    def reset(self, tau: VectorLike | None = None) -> None:
        """Start from the effort `tau` [N m, N], shape (nv,); without it from the next one that is asked for."""
        self._last: Array | None = None if tau is None else vector("tau", tau, self._names)

    def filter(self, tau: VectorLike, dt: float) -> tuple[Array, tuple[str, ...]]:
        """Efforts to send, and which joints had to wait.

        Parameters
        ----------
        tau : array_like, shape (nv,)
            Efforts that are asked for [N m, N].
        dt : float
            Time since the last call [s].

        Returns
        -------
        tau : ndarray, shape (nv,)
        limited : tuple of str
        """
        tau = vector("tau", tau, self._names)
        change = not_negative("dt", dt, "[s]") * self.rate
        limited: tuple[str, ...] = ()
        if self._last is not None:
            near = np.clip(tau, self._last - change, self._last + change)
            if (near != tau).any():
                limited = tuple(name for name, far in zip(self._names, near != tau, strict=True) if far)
            tau = near
        self._last = tau
        return tau.copy(), limited


class PositionRepulsion:
    """Springs before the position limits: within the margin of one, τ = ∓k d ∓ b (d/margin) q̇ while q̇ is outward.

    d is how far the joint is into the margin, and no more than that: beyond the limit the spring is no stronger than at it.
    The springs' energy U = ½Σk d² adds to the Lyapunov function of a law that
    damps rates or regulates a pose, and the damping only takes energy away: under such a law
    a robot of less than ½k margin² of V + U does not reach the hard stop of any joint.

    Parameters
    ----------
    dynamics : DiagonalDynamics
    margin : float or array_like, shape (nv,)
        Where the springs begin, from the limits inward [rad, m]; at most half of a joint's range is used.
    stiffness : float or array_like, shape (nv,)
        k [N m/rad, N/m].
    damping : float or array_like, shape (nv,)
        b [N m s/rad, N s/m] at the limit; none by default.

    Raises
    ------
    InputError, UnsupportedError
        Not positive numbers; or see :class:`Law`.
    """

    def __init__(
        self,
        dynamics: DiagonalDynamics,
        margin: VectorLike | float,
        stiffness: VectorLike | float,
        damping: VectorLike | float = 0.0,
    ) -> None:
        self.dynamics = actuated(dynamics)
        model = dynamics.model
        names = model.dof_names
        margin = per_name("margin", margin, names, "a finite number > 0 [rad, m]")
        self.stiffness = per_name("stiffness", stiffness, names, "a finite number > 0 [N m/rad, N/m]")
        self.damping = per_name(
            "damping", damping, names, "a finite number >= 0 [N m s/rad, N s/m]", lambda x: np.isfinite(x) and x >= 0.0
        )
        self._margin = np.minimum(margin, 0.5 * (model.upper - model.lower))
        self._lower, self._upper = model.lower + self._margin, model.upper - self._margin
        fixed = self._margin <= 0.0
        if fixed.any():
            k = int(np.argmax(fixed))
            raise InputError(
                f"joint '{names[k]}' has limits [{model.lower[k]}, {model.upper[k]}]: no range to keep it in."
            )
        dynamics.compile("epsilon_from_tau")

    def depth(self, q: VectorLike) -> Array:
        """How far each joint is into the margin [rad, m], shape (nv,): positive at its upper end, negative at the lower."""
        return np.clip(self._way(q), -self._margin, self._margin)

    def _way(self, q: VectorLike) -> Array:
        q = vector("q", q, self.dynamics.model.dof_names)
        return np.maximum(q - self._upper, 0.0) + np.minimum(q - self._lower, 0.0)

    def potential(self, q: VectorLike) -> float:
        """U = ½Σk d² [J], and kd more for every way beyond the limit."""
        d, way = self.depth(q), self._way(q)
        return 0.5 * float(self.stiffness @ (d * (2.0 * way - d)))

    def effort(self, q: VectorLike, qd: VectorLike) -> Array:
        """What the springs and their dampers add to the joint efforts [N m, N], shape (nv,)."""
        d, qd = self.depth(q), vector("qd", qd, self.dynamics.model.dof_names)
        outward = np.where(d * qd > 0.0, np.abs(d) / self._margin, 0.0)
        return -self.stiffness * d - self.damping * outward * qd

    def filter(self, q: VectorLike, qd: VectorLike, command: Command) -> Command:
        """Return the command with that added, to its ε too.

        Parameters
        ----------
        q, qd : array_like, shape (nv,)
            Positions [rad, m] and rates [rad/s, m/s] that the command was computed for.
        command : Command

        Returns
        -------
        Command
        """
        effort = self.effort(q, qd)
        if not effort.any():
            return command
        added = self.dynamics.epsilon_from_tau(q, effort)
        return command._replace(tau=command.tau + effort, epsilon=command.epsilon + added)
