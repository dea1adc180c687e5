# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Filters of commands: limits of kinetic energy, efforts, effort rates and joint positions."""

from __future__ import annotations

import numpy as np

from diag_dynamics.arrays import Array, VectorLike
from diag_dynamics.checks import instance, not_negative, per_name, positive, vector
from diag_dynamics.control.command import Command
from diag_dynamics.control.laws import actuated
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import RobotModel

HEAVY = 0.9
"""Fraction of an effort limit; a joint with a larger gravity torque begins to be left out of the common scale."""


class EnergyLimiter:
    """Kinetic-energy limiter, a filter on any law's command: ε ← ε − ν max(0, νᵀε − αh)/|ν|², h = K_max − K.

    The command alone then moves the robot with dK/dt ≤ αh: K stays below K_max, and returns to it at the rate α from above.
    As νᵀC = 0 (Lemma 7.1) the filter needs no dynamics but ν. It removes power along ν and never adds any. External forces
    of the power P let K rise to K_max + P/α, unless an estimate of them is passed on.

    Parameters
    ----------
    dynamics : DiagonalDynamics
    limit : float
        K_max > 0 [J].
    rate : float
        α > 0 [1/s]. A loop of period h [s] needs αh < 1.
    """

    def __init__(self, dynamics: DiagonalDynamics, limit: float, rate: float) -> None:
        self.dynamics = actuated(dynamics)
        self.limit, self.rate = positive("limit", limit, "[J]"), positive("rate", rate, "[1/s]")
        dynamics.compile("tau_from_epsilon")

    def excess_power(self, command: Command, external: VectorLike | None = None) -> float:
        """Return the power to remove from a command [W]: max(0, νᵀ(ε + ε_ext) − αh)."""
        nu = command.nu
        power = float(nu @ command.epsilon)
        if external is not None:
            power += float(nu @ vector("external", external, self.dynamics.model.dof_names))
        return max(0.0, power - self.rate * (self.limit - 0.5 * float(nu @ nu)))

    def filter(self, q: VectorLike, command: Command, external: VectorLike | None = None) -> Command:
        """Return the command at the positions q [rad, m], or one of less power.

        `external` are working moments of external forces [J^½/s], such as a disturbance observer's residual.
        """
        excess = self.excess_power(command, external)
        if excess == 0.0:
            return command
        nu = command.nu
        removed = nu * (excess / float(nu @ nu))  # excess > 0 bounds ν from below: |ν||ε| > αh, or K > K_max
        tau = command.tau - self.dynamics.tau_from_epsilon(q, removed)
        return command._replace(tau=tau, epsilon=command.epsilon - removed)


class EffortSaturation:
    """Effort limits |τ_k| ≤ L_k that keep the direction of ε: τ = g + s(τ − g) with one s in [0, 1].

    Gravity compensation has priority over motion. One factor for the rest keeps the sign of its power νᵀε, where cuts joint
    by joint can turn braking into driving. A joint whose gravity torque alone exceeds its limit is at its limit, and has no
    part in s. Between `HEAVY` of its limit and all of it the two cases are interpolated.

    Parameters
    ----------
    model : RobotModel
    limit : array_like, shape (nv,), optional
        L > 0 [N m, N], by default the URDF's; inf where there is none.
    """

    def __init__(self, model: RobotModel, limit: VectorLike | None = None) -> None:
        self._names = instance("model", model, RobotModel).dof_names
        limit = model.effort_limit if limit is None else limit
        self.limit = per_name("effort limit", limit, self._names, "a number > 0 [N m, N]", lambda x: x > 0.0)

    def filter(self, command: Command) -> Command:
        """Return the command within the limits, with its `scale` s and the joints at their limits in `limited`."""
        limit = self.limit
        if (np.abs(command.tau) <= limit).all():
            return command
        g = command.gravity_torque
        moving = command.tau - g
        scale = self._scale(g, moving)
        scaled = g + scale * moving
        at_limit = np.abs(scaled) >= limit * (1.0 - 1e-12)
        limited = tuple(name for name, is_at in zip(self._names, at_limit, strict=True) if is_at)
        tau = np.clip(scaled, -limit, limit)
        return command._replace(tau=tau, epsilon=scale * command.epsilon, scale=scale, limited=limited)

    def _scale(self, g: Array, moving: Array) -> float:
        """Return s."""
        limit = self.limit
        margin = np.where(moving > 0.0, limit - g, limit + g)
        factor = np.ones_like(moving)
        beyond = np.abs(moving) > np.maximum(margin, 0.0)  # and so not zero
        factor[beyond] = margin[beyond] / np.abs(moving[beyond])
        overload = np.clip((np.abs(g) / limit - HEAVY) / (1.0 - HEAVY), 0.0, 1.0)
        return float(np.where(overload < 1.0, factor + overload * (1.0 - factor), 1.0).min())


class EffortRateLimiter:
    """Limit on the rate of efforts, |dτ_k/dt| ≤ R_k, from the last output on.

    Each joint approaches its effort at its own rate, because a slow joint must not delay the gravity torque of the others.
    Efforts between two that keep the effort limits keep them too: this filter is the last one.

    Parameters
    ----------
    model : RobotModel
    rate : float or array_like, shape (nv,)
        R > 0 [N m/s, N/s], one for all joints or one for each.
    start : array_like, shape (nv,), optional
        Present effort of the joints [N m, N]. Without it the first command passes unchanged.
    """

    def __init__(self, model: RobotModel, rate: VectorLike | float, start: VectorLike | None = None) -> None:
        self._names = instance("model", model, RobotModel).dof_names
        self.rate = per_name("effort rate", rate, self._names, "a finite number > 0 [N m/s, N/s]")
        self.reset(start)

    def reset(self, tau: VectorLike | None = None) -> None:
        """Start from the effort `tau` [N m, N], shape (nv,); without it the next one passes unchanged."""
        self._last: Array | None = None if tau is None else vector("tau", tau, self._names)

    def filter(self, tau: VectorLike, dt: float) -> tuple[Array, tuple[str, ...]]:
        """Return the efforts for requested ones `tau` [N m, N], and the limited joints; `dt` since the last call [s]."""
        tau = vector("tau", tau, self._names)
        change = not_negative("dt", dt, "[s]") * self.rate
        limited: tuple[str, ...] = ()
        if self._last is not None:
            near = np.clip(tau, self._last - change, self._last + change)
            far = (near != tau).tolist()
            limited = tuple(name for name, is_far in zip(self._names, far, strict=True) if is_far)
            tau = near
        self._last = tau
        return tau.copy(), limited


class PositionRepulsion:
    """Springs before the position limits: within the margin of one, τ = ∓k d ∓ b (d/margin) q̇ while q̇ is outward.

    d is the depth of the joint in the margin, at most the margin: beyond the limit the spring is no stronger than at it.
    The springs' energy U = ½Σk d² adds to the Lyapunov function of a law that damps rates or regulates a pose, and their
    damping only removes energy. Under such a law a robot of less than ½k margin² of V + U reaches no hard stop.

    Parameters
    ----------
    dynamics : DiagonalDynamics
    margin : float or array_like, shape (nv,)
        Range of the springs from the limits inward, > 0 [rad, m]; at most half of a joint's range is used.
    stiffness : float or array_like, shape (nv,)
        k > 0 [N m/rad, N/m].
    damping : float or array_like, shape (nv,)
        b ≥ 0 [N m s/rad, N s/m] at the limit; none by default.
    """

    def __init__(
        self,
        dynamics: DiagonalDynamics,
        margin: VectorLike | float,
        stiffness: VectorLike | float,
        damping: VectorLike | float = 0.0,
    ) -> None:
        self.dynamics = actuated(dynamics)
        model, names = dynamics.model, dynamics.model.dof_names
        margin = per_name("margin", margin, names, "a finite number > 0 [rad, m]")
        self.stiffness = per_name("stiffness", stiffness, names, "a finite number > 0 [N m/rad, N/m]")
        self.damping = per_name(
            "damping", damping, names, "a finite number >= 0 [N m s/rad, N s/m]", lambda x: 0.0 <= x < np.inf
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
        """Return the depth in the margin [rad, m], shape (nv,): positive at the upper end, negative at the lower."""
        return np.clip(self._distance(q), -self._margin, self._margin)

    def _distance(self, q: VectorLike) -> Array:
        q = vector("q", q, self.dynamics.model.dof_names)
        return np.maximum(q - self._upper, 0.0) + np.minimum(q - self._lower, 0.0)

    def potential(self, q: VectorLike) -> float:
        """Return U = ½Σk d² [J], and kd more for each unit beyond the limit."""
        d, distance = self.depth(q), self._distance(q)
        return 0.5 * float(self.stiffness @ (d * (2.0 * distance - d)))

    def effort(self, q: VectorLike, qd: VectorLike) -> Array:
        """Return the joint efforts of springs and dampers [N m, N], shape (nv,)."""
        d, qd = self.depth(q), vector("qd", qd, self.dynamics.model.dof_names)
        outward = np.where(d * qd > 0.0, np.abs(d) / self._margin, 0.0)
        return -self.stiffness * d - self.damping * outward * qd

    def filter(self, q: VectorLike, qd: VectorLike, command: Command) -> Command:
        """Return the command with these efforts added; q [rad, m] and qd [rad/s, m/s], each of shape (nv,), are its state."""
        effort = self.effort(q, qd)
        if not effort.any():
            return command
        added = self.dynamics.epsilon_from_tau(q, effort)
        return command._replace(tau=command.tau + effort, epsilon=command.epsilon + added)
