# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Limit on the transferable energy or the force of a contact at the worst point of a robot."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, VectorLike
from diag_dynamics.checks import number, positive, vector
from diag_dynamics.contact.points import ContactPoints
from diag_dynamics.contact.results import Contact
from diag_dynamics.control.command import Command
from diag_dynamics.control.laws import actuated
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError

AIM = 0.99
"""Fraction of the allowed speeds that is commanded; the rest covers the error of a cycle of some milliseconds."""

PASSES = 8
"""Maximum number of points that are slowed one after the other, before the whole robot is."""

IMMOBILE = 1e-9
"""Fraction of the largest mobility of a point below which it is immobile in a direction."""


class ContactSeen(NamedTuple):
    """Contact at a state, by its worst entry: that with the largest fraction of its allowed speed."""

    contact: Contact
    worst: int  # the entry; -1 if nothing moves
    energy: float  # its transferable energy [J]
    limit: float  # its limit [J]: the energy at the allowed speed, scaled; inf at rest or without a limit
    link: str  # its link; empty if nothing moves


class ContactLimiter:
    """Contact limiter, a filter on any law's command: no point with a limit exceeds its allowed speed.

    B = (v/v_max)² of a point along its own motion is its transferable energy, or the square of its contact force, relative
    to its limit. The filter predicts the state at the end of the cycle. Where a point has B above B₀ + αh(σ² − B₀) there, it
    changes ν along one direction, ŵ of the impulse Λv, Λ = (JM⁻¹Jᵀ)⁻¹, that slows the point without turning it:

        ν ← ν − (1 − f) ℓJᵀΛv,  then v ← f v and B ← f²B.

    An impulse along the motion itself, ŵ = ℓJᵀv/|ℓJᵀv|, would turn the point towards its lighter directions: with more than
    45° between v and JM⁻¹Jᵀv its energy along the motion rises while ν along ŵ falls. The filter slows the worst point first,
    at most `PASSES` of them, each by a contact evaluation and three sweeps, and then all of ν. It only removes power.
    External forces come on top, unless an estimate of them is passed on.

    Parameters
    ----------
    dynamics : DiagonalDynamics
    points : ContactPoints
        Points, at least one with a limit.
    rate : float
        α > 0 [1/s] of the approach to a limit, and of the return from above.

    Attributes
    ----------
    scale : float
        σ in [0, 1]: fraction of the allowed speeds that is allowed now, for instance by the distance of people.
    seen : ContactSeen or None
        Contact at the last state.
    """

    def __init__(self, dynamics: DiagonalDynamics, points: ContactPoints, rate: float) -> None:
        self.dynamics, self.points = actuated(dynamics), points
        self.rate = positive("rate", rate, "[1/s]")
        if not points.limited.any():
            raise InputError("points have no limit: there is nothing to bound.")
        self._scale = 1.0
        self.seen: ContactSeen | None = None
        dynamics.compile(
            *("contact", "forward_dynamics", "nu_from_qd", "qd_from_nu", "tau_from_epsilon", "link_velocity"),
            *("operational_inverse_inertia", "epsilon_from_wrench"),
        )

    @property
    def scale(self) -> float:
        """Return σ."""
        return self._scale

    @scale.setter
    def scale(self, value: float) -> None:
        self._scale = number("scale", value, "a number from 0 to 1", lambda x: 0.0 <= x <= 1.0)

    def look(self, q: VectorLike, qd: VectorLike) -> ContactSeen:
        """Return the contact at a state, and store it in `seen`."""
        contact = self.dynamics.contact(q, qd, self.points)
        usage = contact.usage
        k = int(np.argmax(usage))
        if usage[k] > 0.0:
            mass, allowed = float(contact.reflected_mass[k]), self._scale * float(contact.allowed_speed[k])
            limit = 0.5 * mass * allowed * allowed
            seen = ContactSeen(contact, k, float(contact.energy[k]), limit, contact.links[k])
        else:
            seen = ContactSeen(contact, -1, 0.0, math.inf, "")
        self.seen = seen
        return seen

    def filter(
        self, q: VectorLike, qd: VectorLike, command: Command, period: float, external: VectorLike | None = None
    ) -> Command:
        """Return the command at positions q [rad, m] and rates qd [rad/s, m/s], or one that keeps the limits.

        `period` is h > 0, until the next command [s]; `external` are working moments of external forces [J^½/s], such as a
        disturbance observer's residual.
        """
        dynamics, names = self.dynamics, self.dynamics.model.dof_names
        h = positive("period", period, "[s]")
        q, qd = vector("q", q, names), vector("qd", qd, names)
        now = self.look(q, qd).contact.usage ** 2
        tau = command.tau
        if external is not None:
            tau = tau + dynamics.tau_from_epsilon(q, vector("external", external, names))
        # an explicit step of order 2
        qdd = dynamics.forward_dynamics(q, qd, tau)
        ahead, then = dynamics.model.integrate(q, h * qd + 0.5 * h * h * qdd), qd + h * qdd
        allowed = now + min(self.rate * h, 1.0) * ((AIM * self._scale) ** 2 - now)
        change = self._slowed(ahead, then, allowed) - then
        if not change.any():
            return command
        epsilon = dynamics.nu_from_qd(q, change) / h
        return command._replace(
            tau=command.tau + dynamics.tau_from_epsilon(q, epsilon), epsilon=command.epsilon + epsilon
        )

    def _slowed(self, q: Array, qd: Array, allowed: Array) -> Array:
        """Return rates at which no entry exceeds its allowed B."""
        contact = self.dynamics.contact(q, qd, self.points)
        for _ in range(PASSES):
            fraction = _fraction(contact.usage**2, allowed)
            k = int(np.argmin(fraction))
            if fraction[k] >= 1.0:
                return qd
            qd = qd - self._impulse(q, qd, contact, k) * (1.0 - fraction[k])
            contact = self.dynamics.contact(q, qd, self.points)
        return qd * min(1.0, float(_fraction(contact.usage**2, allowed).min()))

    def _impulse(self, q: Array, qd: Array, contact: Contact, k: int) -> Array:
        """Return M⁻¹JᵀΛv, the change of rates by an impulse that stops the worst point of an entry."""
        dynamics, link, point = self.dynamics, contact.links[k], self.points.points[k][contact.point[k]]
        v = dynamics.link_velocity(q, qd, link, point)[:3]
        mobility = dynamics.operational_inverse_inertia(q, link, point)[:3, :3]
        impulse = np.linalg.pinv(mobility, rcond=IMMOBILE, hermitian=True) @ v
        w = dynamics.epsilon_from_wrench(q, link, np.concatenate([impulse, np.zeros(3)]), point)
        return dynamics.qd_from_nu(q, w)


def _fraction(found: Array, allowed: Array) -> Array:
    """Return the fraction of its speed that each entry may keep."""
    above = found > np.maximum(allowed, 0.0) * (1.0 + 1e-9)
    fraction = np.ones_like(found)
    fraction[above] = np.sqrt(np.maximum(allowed[above], 0.0) / found[above])
    return fraction
