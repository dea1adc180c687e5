# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A bound on what a contact at the worst point of a robot could take out of it, or on the force it would have."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, VectorLike
from diag_dynamics.checks import number, positive, vector
from diag_dynamics.contact.points import ContactPoints
from diag_dynamics.contact.results import Contact
from diag_dynamics.control.command import Command
from diag_dynamics.control.law import actuated
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError

AIM = 0.99
"""Part of the speeds that keep the limits which is aimed at: the rest is for what a cycle of some milliseconds is off."""

PASSES = 8
"""Points that are slowed one after the other, before all of the robot is."""

IMMOBILE = 1e-9
"""Part of the largest mobility of a point below which it does not move in a direction."""


class ContactSeen(NamedTuple):
    """Contact at a state, by its worst entry.

    Attributes
    ----------
    contact : Contact
    worst : int
        The entry that uses most of its allowed speed; -1 if nothing moves.
    energy : float
        Its transferable energy [J].
    limit : float
        What that may be [J]: the energy at the allowed speed, scaled; inf where it rests or has no limit.
    link : str
        Its link; empty if nothing moves.
    """

    contact: Contact
    worst: int
    energy: float
    limit: float
    link: str


class ContactLimiter:
    """Contact limiter, a filter on any law's command: no point with a limit gets faster than what keeps it.

    B = (v/v_max)² of a point along its own motion is its transferable energy as a part of the largest one, or the square of
    its force likewise. The state at the end of the cycle is foreseen; where a point has B above B₀ + αh(σ² − B₀) there, ν is
    changed along one direction alone, ŵ of the impulse Λv, Λ = (JM⁻¹Jᵀ)⁻¹, that slows the point without turning it:

        ν ← ν − (1 − f) ℓJᵀΛv,  then v ← f v and B ← f²B.

    Along the motion itself, ŵ = ℓJᵀv/|ℓJᵀv|, an impulse turns the point towards where it is lighter, and what is left of its
    motion may be the heavier part: where the angle between v and JM⁻¹Jᵀv is above 45° the energy along the motion rises while
    ν along ŵ falls. Both are the same where JM⁻¹Jᵀ is the same in all directions. Points are slowed one after the other, the
    worst first; should that not do, all of ν is. Power is only ever taken away. What pushes from outside comes on top,
    unless an estimate of it is passed on.

    Parameters
    ----------
    dynamics : DiagonalDynamics
    points : ContactPoints
        With limits.
    rate : float
        α [1/s], at which a limit is approached, and returned to from above.

    Attributes
    ----------
    scale : float
        σ, from 0 to 1: part of the allowed speeds that is allowed now, as by how far people are.
    seen : ContactSeen or None
        At the last state.

    Raises
    ------
    InputError, UnsupportedError
        No point has a limit; not a positive number; or see :class:`Law`.
    """

    def __init__(self, dynamics: DiagonalDynamics, points: ContactPoints, rate: float) -> None:
        self.dynamics, self.points = actuated(dynamics), points
        self.rate = positive("rate", rate, "[1/s]")
        if not points.limited.any():
            raise InputError("points have no limit: there is nothing to bound.")
        self._scale, self.seen = 1.0, None
        dynamics.compile(
            *("contact", "forward_dynamics", "nu_from_qd", "qd_from_nu", "tau_from_epsilon", "link_velocity"),
            *("operational_inverse_inertia", "epsilon_from_wrench"),
        )

    @property
    def scale(self) -> float:
        """See above."""
        return self._scale

    @scale.setter
    def scale(self, value: float) -> None:
        self._scale = number("scale", value, "a number from 0 to 1", lambda x: 0.0 <= x <= 1.0)

    def look(self, q: VectorLike, qd: VectorLike) -> ContactSeen:
        """Contact at a state, kept in `seen`."""
        contact = self.dynamics.contact(q, qd, self.points)
        usage = contact.usage
        k = int(np.argmax(usage))
        if not usage[k] > 0.0:
            self.seen = ContactSeen(contact, -1, 0.0, math.inf, "")
        else:
            mass, allowed = float(contact.reflected_mass[k]), self._scale * float(contact.allowed_speed[k])
            limit = 0.5 * mass * allowed * allowed
            self.seen = ContactSeen(contact, k, float(contact.energy[k]), limit, contact.links[k])
        return self.seen

    def filter(
        self, q: VectorLike, qd: VectorLike, command: Command, period: float, external: VectorLike | None = None
    ) -> Command:
        """Return the command, or one that keeps the limits.

        Parameters
        ----------
        q, qd : array_like, shape (nv,)
            Positions [rad, m] and rates [rad/s, m/s] that the command was computed for.
        command : Command
        period : float
            h, until the next command [s].
        external : array_like, shape (nv,), optional
            Working moments of what pushes from outside [J^½/s], such as a disturbance observer's residual.

        Returns
        -------
        Command

        Raises
        ------
        InputError
            A vector or the period is wrong.
        """
        dynamics, names = self.dynamics, self.dynamics.model.dof_names
        h = positive("period", period, "[s]")
        q, qd = vector("q", q, names), vector("qd", qd, names)
        now = self.look(q, qd).contact.usage ** 2
        tau = command.tau
        if external is not None:
            tau = tau + dynamics.tau_from_epsilon(q, vector("external", external, names))
        # Half of an explicit step's way ahead in position, all of it in rates: of order 2, as the plant's own step is.
        qdd = dynamics.forward_dynamics(q, qd, tau)
        ahead, then = dynamics.model.integrate(q, h * qd + 0.5 * h * h * qdd), qd + h * qdd
        allowed = now + min(self.rate * h, 1.0) * ((AIM * self._scale) ** 2 - now)
        taken = self._slowed(ahead, then, allowed) - then
        if not taken.any():
            return command
        epsilon = dynamics.nu_from_qd(q, taken) / h
        return command._replace(
            tau=command.tau + dynamics.tau_from_epsilon(q, epsilon), epsilon=command.epsilon + epsilon
        )

    def _slowed(self, q: Array, qd: Array, allowed: Array) -> Array:
        """Rates at which no entry has more than its allowed B."""
        contact = self.dynamics.contact(q, qd, self.points)
        for _ in range(PASSES):
            part = _part(contact.usage**2, allowed)
            k = int(np.argmin(part))
            if part[k] >= 1.0:
                return qd
            qd = qd - self._impulse(q, qd, contact, k) * (1.0 - part[k])
            contact = self.dynamics.contact(q, qd, self.points)
        return qd * min(1.0, float(_part(contact.usage**2, allowed).min()))

    def _impulse(self, q: Array, qd: Array, contact: Contact, k: int) -> Array:
        """M⁻¹JᵀΛv: rates without which the worst point of an entry stands still, and nothing across ŵ changes."""
        dynamics, link, point = self.dynamics, contact.links[k], self.points.points[k][contact.point[k]]
        v = dynamics.link_velocity(q, qd, link, point)[:3]
        mobility = dynamics.operational_inverse_inertia(q, link, point)[:3, :3]
        impulse = np.linalg.pinv(mobility, rcond=IMMOBILE, hermitian=True) @ v
        w = dynamics.epsilon_from_wrench(q, link, np.concatenate([impulse, np.zeros(3)]), point)
        return dynamics.qd_from_nu(q, w)


def _part(found: Array, allowed: Array) -> Array:
    """Part of its speed that each entry may keep; 1 where it may keep all."""
    above = found > np.maximum(allowed, 0.0) * (1.0 + 1e-9)
    part = np.ones_like(found)
    part[above] = np.sqrt(np.maximum(allowed[above], 0.0) / found[above])
    return part
