# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Least squares over inertias that can be and friction that brakes: a convex problem, solved along its central path.

    min ½ xᵀA x − bᵀx + γ Σ [tr(J₀⁻¹J) − ln det J] − γ' Σ ln x_k

with the pseudo-inertia J of each body, linear in x, J₀ that of the model, and positive x_k. The barrier of each J is its
prior, smallest at J = J₀, so that what the rows do not tell stays as the model has it. Plain Newton crawls along the boundary
of the cone; from large γ downward it does not.
"""

from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.identification.inertias import BASIS
from diag_dynamics.identification.kernels.regressors import PARAMETERS

STAGE = 0.1
"""Squared Newton decrement at which a stage ends, in parts of its γ."""

LAST = 1e-7
"""Squared Newton decrement at which the last one ends."""

NEAR = 0.05
"""Squared Newton decrement, in parts of a barrier's smallest weight, below which Newton's method converges quadratically."""

ROUNDING = 1e-14
"""Relative error of the function's value."""

MOST_STEPS = 400
"""Newton steps, all stages together."""


class Body(NamedTuple):
    """A pseudo-inertia among the unknowns: J = Σ_j x[first + j] BASIS_j + fixed."""

    first: int
    prior: np.ndarray
    """J₀, 4x4."""
    weight: float
    """γ."""
    fixed: np.ndarray
    """4x4; what J has beside the unknowns."""


class Problem(NamedTuple):
    """What is to be minimized."""

    A: np.ndarray
    b: np.ndarray
    bodies: list
    positive: np.ndarray
    """Indices of unknowns that are positive."""
    positive_weight: float
    """γ'."""


class Solution(NamedTuple):
    """Where the minimum is."""

    x: np.ndarray
    hessian: np.ndarray
    """Of the whole function, at x."""
    steps: int


def solved(problem, start):
    """Return the :class:`Solution`, from a start within all cones.

    Raises
    ------
    DiagDynamicsError
        The path was not followed to its end.
    """
    x = np.array(start)
    weights = [body.weight for body in problem.bodies] + [problem.positive_weight] * bool(len(problem.positive))
    if not weights:  # a quadratic function
        _, gradient, hessian = _derivatives(problem, x, 1.0)
        return Solution(x + _decrement(gradient, hessian)[1], hessian, 1)
    least = min(body.weight for body in problem.bodies) if problem.bodies else problem.positive_weight
    first = _decrement(*_derivatives(problem, x, 1.0)[1:])[0]
    stage, steps = max(0, int(np.ceil(np.log10(max(first, least) / least)))), 0
    while True:
        scale, before, length = 10.0**stage, np.inf, 0.0
        goal = STAGE * least * scale if stage else LAST
        while True:
            value, gradient, hessian = _derivatives(problem, x, scale)
            squared, direction = _decrement(gradient, hessian)
            # Near the minimum a whole step squares the decrement: where it does not, nothing but rounding is left.
            rounded = length == 1.0 and before < NEAR * scale * min(weights) and squared > 0.5 * before
            if squared <= goal or rounded:
                break
            if steps == MOST_STEPS:
                raise DiagDynamicsError(
                    f"Identification has found no minimum within {MOST_STEPS} steps of Newton's method."
                )
            x, length = _stepped(problem, x, direction, value, squared, scale)
            before, steps = squared, steps + 1
            if not length:
                break
        if stage == 0:
            return Solution(x, hessian, steps)
        stage -= 1


def _derivatives(problem, x, scale):
    """Value, gradient and Hessian, the barriers times a scale; the value is infinite outside of the cones."""
    value = 0.5 * x @ problem.A @ x - problem.b @ x
    gradient, hessian = problem.A @ x - problem.b, problem.A.copy()
    for body in problem.bodies:
        own = slice(body.first, body.first + PARAMETERS)
        J = np.tensordot(x[own], BASIS, 1) + body.fixed
        factor = _factor(J)
        if factor is None:
            return np.inf, gradient, hessian
        weight = scale * body.weight
        inverse, prior = np.linalg.inv(J), np.linalg.inv(body.prior)
        value += weight * (np.sum(prior * J) - 2.0 * np.log(np.diag(factor)).sum())
        gradient[own] += weight * np.tensordot(BASIS, prior - inverse, 2)
        turned = inverse @ BASIS
        hessian[own, own] += weight * np.einsum("aij,bji->ab", turned, turned)
    k = problem.positive
    if len(k):
        if np.min(x[k]) <= 0.0:
            return np.inf, gradient, hessian
        weight = scale * problem.positive_weight
        value -= weight * np.log(x[k]).sum()
        gradient[k] -= weight / x[k]
        hessian[k, k] += weight / x[k] ** 2
    return value, gradient, hessian


def _factor(J):
    try:
        return np.linalg.cholesky(J)
    except np.linalg.LinAlgError:
        return None


def _decrement(gradient, hessian):
    """Squared Newton decrement, and the step; the Hessian is scaled by its diagonal, as units differ."""
    diagonal = np.diag(hessian)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = hessian * scale[:, None] * scale
    right = -gradient * scale
    try:
        direction = np.linalg.solve(scaled, right)
    except np.linalg.LinAlgError:
        direction = np.linalg.lstsq(scaled, right, rcond=None)[0]
    return float(direction @ right), direction * scale


def _stepped(problem, x, direction, value, squared, scale):
    """The next point on the line of a Newton step, and the part of the step that was gone; 0 where only rounding is left."""
    slack = ROUNDING * abs(value)
    length = 1.0
    for _ in range(60):
        ahead = x + length * direction
        if _value(problem, ahead, scale) <= value - 0.1 * length * squared + slack:
            return ahead, length
        length *= 0.5
    return x, 0.0


def _value(problem, x, scale):
    value = 0.5 * x @ problem.A @ x - problem.b @ x
    for body in problem.bodies:
        J = np.tensordot(x[body.first : body.first + PARAMETERS], BASIS, 1) + body.fixed
        factor = _factor(J)
        if factor is None:
            return np.inf
        value += scale * body.weight * (np.sum(np.linalg.inv(body.prior) * J) - 2.0 * np.log(np.diag(factor)).sum())
    own = x[problem.positive]
    if len(own):
        if np.min(own) <= 0.0:
            return np.inf
        value -= scale * problem.positive_weight * np.log(own).sum()
    return value
