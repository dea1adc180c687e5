# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Filters of commands: limits of kinetic energy, contact, efforts and joint positions.

:class:`.filters.Limits` calls the filters. Limits and gains are one number for all degrees of
freedom, or one for each. `external` are working moments of external forces [J^½/s], such as a
disturbance observer's residual.
"""

from __future__ import annotations

import math
from itertools import compress
from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, BoolArray, VectorLike
from diag_dynamics.checks import number, per_name, positive, vector
from diag_dynamics.collision.contact_points import ContactPoints
from diag_dynamics.collision.predicted_contact import PredictedContact
from diag_dynamics.control.laws import Command, Gain, actuated
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.sweeps.limits import project

SPRING, DAMPER = 0.2, 0.5
"""Maximum impulses of springs and dampers at position limits in a cycle.

See :class:`PositionRepulsion`.
"""

RETREAT = 0.2
"""Fraction of its margin by which a spring moves in a second [1/s]; see :class:`PositionRepulsion`.
"""

AIM = 0.99
"""Commanded fraction of the allowed contact speeds; the rest covers the error of a cycle."""

PREDICTIONS = 2
"""Predictions of the end of a cycle, the second one with the efforts that the first one changed."""

PASSES = 8
"""Maximum number of points that are slowed one by one before all of the robot is."""

IMMOBILE = 1e-9
"""Fraction of the largest mobility of a point below which it is immobile in a direction."""


def names_where(names: tuple[str, ...], mask: BoolArray) -> tuple[str, ...]:
    """Return the names at which a mask of bool is true."""
    return tuple(compress(names, mask))


def end_of_cycle(
    dynamics: DiagonalDynamics, q: Array, qd: Array, tau: Array, period: float
) -> tuple[Array, Array]:
    """Return q and q̇ when efforts have lasted for a period, by an explicit step of order 2."""
    middle = qd + 0.5 * period * dynamics.forward_dynamics(q, qd, tau)
    qdd = dynamics.forward_dynamics(q + 0.25 * period * (qd + middle), middle, tau)
    then = qd + period * qdd
    return q + 0.5 * period * (qd + then), then


class EnergyLimiter:
    """Limiter of the kinetic energy and of its shares by joint, a filter on any law's command.

    In total joint rates K = ½|ν|², so that K ≤ K_max is a ball and ½ν_k² ≤ K_k a box. Efforts last
    for a cycle of length h, at whose end the rates are ν₊. The filter clips ν₊ to the box and
    scales it to the ball of the energies

        ½ν_k² + min(αh, 1)(K_k − ½ν_k²)   and   K + min(αh, 1)(K_max − K),

    and converts the change Δν₊ to efforts mΔν₊/h. It does so twice: with ν₊ = ν + hε, then, unless
    this keeps K below half of the least limit, with the motion under these efforts by a step of
    order 2, whose error is of order h³. An error e in each cycle adds up to e/(αh). Within it K
    stays below K_max, and returns to it at the rate α from above. External forces of the power P
    let K rise to K_max + P/α, unless an estimate of them is passed on.

    The limits are K_max > 0 [J] and, by degree of freedom, K_k > 0 [J], inf for none; the rate is
    α > 0 [1/s]. ν_k is the rate of joint k and of all that it induces further out, not q̇_k.
    """

    def __init__(
        self,
        dynamics: DiagonalDynamics,
        limit: float = math.inf,
        joint_limit: Gain = math.inf,
        rate: float = 50.0,
    ) -> None:
        self.dynamics = actuated(dynamics)
        names = dynamics.model.dof_names
        self.limit = math.inf if limit == math.inf else positive("limit", limit, "[J]")
        self.joint_limit = per_name(
            "joint_limit", joint_limit, names, "a number > 0 [J]", lambda x: x > 0.0
        )
        self.rate = positive("rate", rate, "[1/s]")
        self._least = min(self.limit, *self.joint_limit.tolist())
        dynamics.compile("tau_from_epsilon", "forward_dynamics", "nu_from_qd")
        project.compile()

    def filter(
        self,
        q: VectorLike,
        qd: VectorLike,
        command: Command,
        period: float,
        external: VectorLike | None = None,
    ) -> Command:
        """Return the command at q [rad, m] and qd [rad/s, m/s], or one that keeps the limits.

        `period` is h > 0, until the next command [s].
        """
        h = positive("period", period, "[s]")
        names = self.dynamics.model.dof_names
        q = vector("q", q, names)
        qd = vector("qd", qd, names)
        tau = command.tau
        end = command.nu + h * command.epsilon
        if external is not None:
            external = vector("external", external, names)
            tau = tau + self.dynamics.tau_from_epsilon(q, external)
            end += h * external
        first = self._change(command.nu, end, h)
        if not first.any() and end @ end < self._least:
            return command
        if first.any():
            tau = tau + self.dynamics.tau_from_epsilon(q, first)
        end = self.dynamics.nu_from_qd(*end_of_cycle(self.dynamics, q, qd, tau, h)) - h * first
        change = self._change(command.nu, end, h)
        if not change.any():
            return command
        tau = command.tau + self.dynamics.tau_from_epsilon(q, change)
        return command._replace(tau=tau, epsilon=command.epsilon + change)

    def _change(self, nu: Array, end: Array, period: float) -> Array:
        """Return the change of ε with which the rates ν at the end of a cycle keep the limits."""
        change = np.empty_like(nu)
        fraction = min(self.rate * period, 1.0)
        project(nu, end, fraction, self.limit, self.joint_limit, change)
        return change / period


class PositionRepulsion:
    """Springs before the position limits.

    Within the margin of a limit, τ = ∓k d ∓ b (d/margin) q̇ while q̇ is outward.

    d is the depth of the joint in the margin in the middle of the cycle, at most the margin: there
    an effort that lasts for the cycle does no more work than the spring would, and beyond the limit
    the spring is no stronger than at it. The springs' energy U = ½Σk d² adds to the Lyapunov
    function of a law that damps rates or regulates a pose, and their damping only removes energy.
    Under such a law a robot of less than ½k margin² of V + U reaches no hard stop. In a cycle of
    length h the impulse of a spring is at most SPRING of D d/h, that of a damper DAMPER of D q̇,
    with the inertia D of the joint while all others are free: more would drive a light joint.

    After `begin` no joint is thrown out of the margin: its spring begins where the joint is, and
    moves out of the margin at RETREAT of it in each second.

    The margin > 0 [rad, m] from the limits inward is at most half of a joint's range. The stiffness
    is k > 0 [N m/rad, N/m], the damping b ≥ 0 [N m s/rad, N s/m] at the limit.
    """

    def __init__(
        self, dynamics: DiagonalDynamics, margin: Gain, stiffness: Gain, damping: Gain = 0.0
    ) -> None:
        self.dynamics = actuated(dynamics)
        model = dynamics.model
        names = dynamics.model.dof_names
        margin = per_name("margin", margin, names, "a finite number > 0 [rad, m]")
        self.stiffness = per_name(
            "stiffness", stiffness, names, "a finite number > 0 [N m/rad, N/m]"
        )
        expected = "a finite number >= 0 [N m s/rad, N s/m]"
        self.damping = per_name("damping", damping, names, expected, lambda x: 0.0 <= x < np.inf)
        self._margin = np.minimum(margin, 0.5 * (model.upper - model.lower))
        self._lower = self._least = model.lower + self._margin
        self._upper = self._largest = model.upper - self._margin
        self._is_new = False
        for name, lower, upper in zip(names, model.lower, model.upper, strict=True):
            if not lower < upper:
                raise InputError(
                    f"joint '{name}' has limits [{lower}, {upper}]; expected a range between them."
                )
        dynamics.compile("epsilon_from_tau", "factors")

    def begin(self) -> None:
        """Begin where the joints are in the next state."""
        self._is_new = True

    def filter(self, q: VectorLike, qd: VectorLike, command: Command, period: float) -> Command:
        """Return the command with these efforts added at q [rad, m] and qd [rad/s, m/s].

        `period` is h > 0, until the next command [s].
        """
        h = positive("period", period, "[s]")
        names = self.dynamics.model.dof_names
        q = vector("q", q, names)
        qd = vector("qd", qd, names)
        step = RETREAT * h * self._margin
        lower, upper = (q, q) if self._is_new else (self._lower + step, self._upper - step)
        self._is_new = False
        self._lower = np.minimum(lower, self._least)
        self._upper = np.maximum(upper, self._largest)
        middle = q + 0.5 * h * qd
        depth = np.maximum(middle - self._upper, 0.0) + np.minimum(middle - self._lower, 0.0)
        if not depth.any():
            return command
        d = np.clip(depth, -self._margin, self._margin)
        inertia = 1.0 / np.square(self.dynamics.factors(q).l).sum(axis=0)
        outward = np.where(d * qd > 0.0, np.abs(d) / self._margin, 0.0)
        effort = -np.minimum(self.stiffness, SPRING * inertia / (h * h)) * d
        effort -= np.minimum(self.damping * outward, DAMPER * inertia / h) * qd
        added = self.dynamics.epsilon_from_tau(q, effort)
        return command._replace(tau=command.tau + effort, epsilon=command.epsilon + added)


class ContactSeen(NamedTuple):
    """Contact at a state, by the entry with the largest fraction of its allowed speed."""

    contact: PredictedContact
    energy: float = 0.0  # its transferable energy [J]
    # Its limit [J] is the energy at the allowed speed, scaled; inf at rest or without a limit.
    limit: float = math.inf
    link: str = ""  # its link; empty if nothing moves


class ContactLimiter:
    """Contact limiter: no point with a limit exceeds its allowed speed.

    It is a filter on any law's command.

    B = (v/v_max)² of a point along its own motion is its transferable energy, or the square of its
    contact force, relative to its limit. The filter predicts the state at the end of the cycle.
    Where a point has B above B₀ + αh(σ² − B₀) there, it changes ν along one direction, ŵ of the
    impulse Λv, Λ = (JM⁻¹Jᵀ)⁻¹, that slows the point without turning it:

        ν ← ν − (1 − f) ℓJᵀΛv,  then v ← f v and B ← f²B.

    An impulse along the motion itself, ŵ = ℓJᵀv/|ℓJᵀv|, would turn the point towards its lighter
    directions: with more than 45° between v and JM⁻¹Jᵀv its energy along the motion rises while ν
    along ŵ falls. The filter slows the worst point first, at most `PASSES` of them, each by a
    contact evaluation and three sweeps, and then all of ν. A second prediction with these efforts
    corrects them. It only removes power. External forces come on top, unless an estimate of them is
    passed on.

    At least one of the points has a limit. The rate is α > 0 [1/s], of the approach to a limit and
    of the return from above.
    """

    seen: ContactSeen | None = None  #: contact at the last state
    _scale = 1.0

    def __init__(self, dynamics: DiagonalDynamics, points: ContactPoints, rate: float) -> None:
        self.dynamics = actuated(dynamics)
        self.points = points
        self.rate = positive("rate", rate, "[1/s]")
        if not points.limited.any():
            raise InputError("points have no limits; expected at least one.")
        dynamics.compile(
            *("contact_limits", "forward_dynamics", "wrench_factor"),
            *("nu_from_qd", "qd_from_nu", "tau_from_epsilon"),
        )

    @property
    def scale(self) -> float:
        """Fraction σ in [0, 1] of the allowed speeds that is allowed now.

        It may depend on the distance of people, for instance.
        """
        return self._scale

    @scale.setter
    def scale(self, value: float) -> None:
        self._scale = number("scale", value, "a number from 0 to 1", lambda x: 0.0 <= x <= 1.0)

    def look(self, q: VectorLike, qd: VectorLike) -> ContactSeen:
        """Return the contact at a state, and store it in `seen`."""
        contact = self.dynamics.contact_limits(q, qd, self.points)
        usage = contact.usage
        k = int(np.argmax(usage))
        self.seen = ContactSeen(contact)
        if usage[k] > 0.0:
            allowed = self._scale * float(contact.allowed_speed[k])
            limit = 0.5 * float(contact.reflected_mass[k]) * allowed * allowed
            self.seen = ContactSeen(contact, float(contact.energy[k]), limit, contact.links[k])
        return self.seen

    def filter(
        self,
        q: VectorLike,
        qd: VectorLike,
        command: Command,
        period: float,
        external: VectorLike | None = None,
    ) -> Command:
        """Return the command at q [rad, m] and qd [rad/s, m/s], or one that keeps the limits.

        `period` is h > 0, until the next command [s].
        """
        dynamics = self.dynamics
        names = self.dynamics.model.dof_names
        h = positive("period", period, "[s]")
        q = vector("q", q, names)
        qd = vector("qd", qd, names)
        now = self.look(q, qd).contact.usage ** 2
        tau = command.tau
        if external is not None:
            tau = tau + dynamics.tau_from_epsilon(q, vector("external", external, names))
        allowed = now + min(self.rate * h, 1.0) * ((AIM * self._scale) ** 2 - now)
        change = np.zeros(len(q))
        for _ in range(PREDICTIONS):
            then, qd_then = end_of_cycle(dynamics, q, qd, tau, h)
            impulse = dynamics.nu_from_qd(q, self._slowed(then, qd_then, allowed) - qd_then)
            if not impulse.any():
                break
            change += impulse / h
            tau = tau + dynamics.tau_from_epsilon(q, impulse / h)
        if not change.any():
            return command
        tau = command.tau + dynamics.tau_from_epsilon(q, change)
        return command._replace(tau=tau, epsilon=command.epsilon + change)

    def _slowed(self, q: Array, qd: Array, allowed: Array) -> Array:
        """Return rates at which no entry exceeds its allowed B."""
        for _ in range(PASSES):
            contact = self.dynamics.contact_limits(q, qd, self.points)
            fraction = _fraction(contact.usage**2, allowed)
            k = int(np.argmin(fraction))
            if fraction[k] >= 1.0:
                return qd
            qd = qd - self._impulse(q, qd, contact, k) * (1.0 - fraction[k])
        contact = self.dynamics.contact_limits(q, qd, self.points)
        return qd * min(1.0, float(_fraction(contact.usage**2, allowed).min()))

    def _impulse(self, q: Array, qd: Array, contact: PredictedContact, k: int) -> Array:
        """Return M⁻¹JᵀΛv of an entry, the change of rates by an impulse.

        The impulse stops the worst point of the entry. In total rates it takes ν's projection onto
        the range of ℓJᵀ.
        """
        dynamics = self.dynamics
        point = self.points.points[k][contact.point[k]]
        factor = dynamics.wrench_factor(q, contact.links[k], point)[:, :3]
        directions, sizes, _ = np.linalg.svd(factor, full_matrices=False)
        directions = directions[:, sizes**2 > IMMOBILE * sizes[0] ** 2]
        return dynamics.qd_from_nu(q, directions @ (dynamics.nu_from_qd(q, qd) @ directions))


def _fraction(usage: Array, allowed: Array) -> Array:
    """Return the fraction of its speed that each entry may keep, by its B and the allowed one."""
    allowed = np.maximum(allowed, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(usage > allowed * (1.0 + 1e-9), np.sqrt(allowed / usage), 1.0)
