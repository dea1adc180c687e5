# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joint tracking that adapts to an unknown payload, whose estimate is always a physical body."""

from __future__ import annotations

from typing import Any

import numpy as np

from diag_dynamics.arrays import Array, MatrixLike, VectorLike
from diag_dynamics.checks import not_negative, positive
from diag_dynamics.control.laws import (
    STABLE,
    Gain,
    JointTracking,
    positive_definite,
    require_at_most,
)
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.rigid_body import parameters_of_record, pseudo_inertia
from diag_dynamics.sweeps.regressors import PARAMETERS

MASS, RADIUS = 0.5, 0.03
"""Mass [kg] of a ball that the body has in addition at the start, and deviation along an axis [m].

A light body adapts more slowly at first.
"""

DUAL = np.linalg.pinv([pseudo_inertia(unit).ravel() for unit in np.eye(PARAMETERS)]).T
"""Ten parameters of a pseudo-inertia, shape (10, 16); tr(LP) = yᵀπ if L is yᵀDUAL."""

MAX_CHANGE, MAX_CONDITION = 0.5, 1e6
"""Limits of the pseudo-inertia.

The logarithm changes by at most the first number in a step. Above the second one, the condition of
its factor, the pseudo-inertia stays.
"""

MARGIN = 0.25
"""Fraction of the stable rate at rest that is accepted, because motion adapts faster."""


class AdaptiveTracking(JointTracking):
    """Joint tracking with an adaptive payload on a link.

    The command is τ = (that of JointTracking) + Y(q, q̇, q̇_r, q̈_r)(π̂ − π₀). π are the ten
    parameters of the link's body with the payload, π₀ those of the model. Their pseudo-inertia is P
    = ∫ r̄r̄ᵀdm, r̄ = (r, 1), shape (4, 4) [kg m², kg m, kg], positive definite for every physical
    body. (q̇ − q̇_r)ᵀYπ = tr(LP) defines a symmetric L. With the natural metric (Lee, Kwon and Park
    2018)

        dP̂/dt = −γP̂LP̂,

    ½(q̇ − q̇_r)ᵀM(q̇ − q̇_r) + (ln(|P̂|/|P|) + tr(P̂⁻¹P) − 4)/γ falls at −sᵀKs: the tracking error
    vanishes, and P̂ stays positive definite. M and P are those with payload, which are not known:
    the V of commands is ½|s|² of the model, and its rate as if P̂ were P. The estimate becomes that
    of the payload if the motion excites it. It adapts to lasting pushes, too.

    The adaptation rate is γ > 0 [1/J]; the estimate keeps the mass of the payload below
    `max_mass` > 0 [kg]. Call `adapt` once after each command.

    Example
    -------
    >>> import diag_dynamics as dd
    >>> dyn = dd.DiagonalDynamics(dd.load_robot("ur5"))
    >>> law = dd.AdaptiveTracking(dyn, "tool0", gain=20.0, convergence=10.0, rate=3.0)
    >>> q = [0, -1, 1, 0, 0, 0]
    >>> command = law.command(q, [0] * 6, desired_q=[0, -1.1, 1, 0, 0, 0])  # sunk by 0.1 rad
    >>> law.adapt(0.1)
    >>> law.payload[0] > 0.01  # [kg]
    True
    """

    def __init__(
        self,
        dynamics: DiagonalDynamics,
        link: str,
        gain: Gain,
        convergence: Gain,
        *,
        rate: float,
        max_mass: float = 5.0,
        **options: Any,
    ) -> None:
        super().__init__(dynamics, gain, convergence, **options)
        dynamics.compile("regressor", "factors")
        self.link = link
        self.rate = positive("rate", rate, "[1/J]")
        self.max_mass = positive("max_mass", max_mass, "[kg]")
        self._nominal = nominal_inertia(dynamics, link)
        first = PARAMETERS * dynamics.model.link_names.index(link)
        self._columns = slice(first, first + PARAMETERS)
        self.reset()

    def reset(self, pseudo_inertia: MatrixLike | None = None) -> None:
        """Start from an estimate P̂, shape (4, 4), by default that of the model without payload."""
        P = self._nominal if pseudo_inertia is None else pseudo_inertia
        self._factor = np.linalg.cholesky(positive_definite("pseudo_inertia", P, 4))  # of P̂
        self._power = np.zeros((4, 4))  # L of the last command

    @property
    def pseudo_inertia(self) -> Array:
        """P̂ of the link's body with payload in the link's axes, shape (4, 4)."""
        P: Array = self._factor @ self._factor.T
        return P

    @property
    def payload(self) -> tuple[float, Array]:
        """Mass [kg] and first moment [kg m], shape (3,), of the payload in the link's axes."""
        change = self.pseudo_inertia - self._nominal
        return float(change[3, 3]), change[:3, 3]

    def adapt(self, period: float) -> None:
        """Adapt the estimate to the last command, which lasts for a period [s]."""
        rates, axes = np.linalg.eigh(self._factor.T @ self._power @ self._factor)
        steps = rates * (self.rate * not_negative("period", period, "[s]"))
        factor = self._factor @ axes * np.exp(-0.5 * np.clip(steps, -MAX_CHANGE, MAX_CHANGE))
        mass, last = (float(x[3] @ x[3]) for x in (factor, self._factor))
        if np.linalg.cond(factor) < MAX_CONDITION and mass < max(
            last, self._nominal[3, 3] + self.max_mass
        ):
            self._factor = factor

    def _reference(self, q: Array, qd: Array, qd_r: Array, qdd_r: Array) -> tuple[Array, Array]:
        tau, g = super()._reference(q, qd, qd_r, qdd_r)
        zero = self._zero
        gravity = self._regressor(q, zero, zero)
        plus = self._regressor(q, qd + qd_r, zero)
        minus = self._regressor(q, qd - qd_r, zero)
        # the part bilinear in q̇ and q̇_r by polarization
        Y = self._regressor(q, zero, qdd_r) + 0.25 * (plus - minus)
        change = DUAL @ (self.pseudo_inertia - self._nominal).ravel()
        self._power = ((qd - qd_r) @ Y @ DUAL).reshape(4, 4)
        return tau + Y @ change, g + gravity @ change

    def require_stable(self, q: VectorLike, period: float) -> None:
        """Raise InputError for gains that JointTracking rejects or that adapt without stability.

        The largest weight is stable if ω²·period < K/2.
        """
        super().require_stable(q, period)
        weight = self._regressor(q, self._zero, self._zero)
        powers = (weight @ DUAL).reshape(-1, 4, 4)
        columns = (self._factor.T @ powers @ self._factor).reshape(-1, 16)
        root = (self.dynamics.factors(q).l @ columns) / np.sqrt(self.gain)[:, None]
        root *= (self._nominal[3, 3] + self.max_mass) / self.pseudo_inertia[3, 3]
        largest = MARGIN * STABLE / period / float(np.linalg.norm(root, 2)) ** 2
        require_at_most("rate of adaptation to a payload", self.rate, largest, "1/J", period)

    def _regressor(self, q: VectorLike, qd: Array, qdd: Array) -> Array:
        """Return Y of the ten parameters of the link's body."""
        Y: Array = self.dynamics.regressor(q, qd, qdd)[:, self._columns]
        return Y


def nominal_inertia(dynamics: DiagonalDynamics, link: str) -> Array:
    """Return P of the body of a link and a ball at its centre, in the link's axes, shape (4, 4)."""
    index, placement = dynamics.model.placement_in_body(link)
    if index == 0:
        raise InputError(f"link is '{link}'; expected a link that a joint moves.")
    body = dynamics.model.bodies[index]
    center = np.append(body["first_moment"] / max(float(body["mass"]), MASS), 1.0)
    P = pseudo_inertia(parameters_of_record(body)) + MASS * np.outer(center, center)
    P[:3, :3] += MASS * RADIUS**2 * np.eye(3)
    inverse = np.linalg.inv(placement)
    moved: Array = inverse @ P @ inverse.T
    return moved
