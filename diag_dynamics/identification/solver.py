# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Least squares over physical inertias and positive friction, by Newton's method along the central path.

    min ½ xᵀA x − bᵀx + Σ γ [tr(J₀⁻¹J) − ln det J] − γ' Σ ln x_k

J is the pseudo-inertia of a body, linear in x, and J₀ that of the model. The barrier of J is its prior,
smallest at J = J₀. Plain Newton crawls along the boundary of the cone; from large γ downward it does not.
"""

from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.identification.inertias import BASIS
from diag_dynamics.identification.kernels.regressors import PARAMETERS
from diag_dynamics.optional import require

STAGE_DECREMENT, LAST_DECREMENT = 0.1, 1e-7  # squared Newton decrement at the end of a stage, over its γ; of the last
CONVERGED = 0.05  # squared decrement over the smallest weight below which convergence is quadratic
ROUNDING = 1e-14  # relative error of the function's value
REGULAR = 1e-12  # added to the scaled Hessian, whose rounding errors are smaller
MAX_STEPS, MAX_HALVINGS = 400, 60


class Body(NamedTuple):
    """A pseudo-inertia J = Σ_j x[first + j] BASIS_j + fixed with prior J₀ and its weight γ; all 4x4."""

    first: int
    prior: np.ndarray
    weight: float
    fixed: np.ndarray

    @property
    def places(self):
        """Its unknowns."""
        return slice(self.first, self.first + PARAMETERS)

    def pseudo_inertia(self, x):
        """Return J."""
        return np.tensordot(x[self.places], BASIS, 1) + self.fixed


class Problem(NamedTuple):
    """The function to minimize; unknowns with the indices `positive` are so, with the weight γ'."""

    A: np.ndarray
    b: np.ndarray
    bodies: list
    positive: np.ndarray
    positive_weight: float


def solve(problem, start):
    """Return x at the minimum and the Hessian there, from a start within all cones; raises DiagDynamicsError."""
    smallest = min((body.weight for body in problem.bodies), default=problem.positive_weight)
    first = _newton_step(*_derivatives(problem, start, 1.0))[0]
    stages, x = max(0, int(np.ceil(np.log10(max(first, smallest) / smallest)))), start
    for scale in 10.0 ** np.arange(stages, 0, -1):
        x, _ = _minimize(problem, x, scale, STAGE_DECREMENT * smallest * scale)
    return _minimize(problem, x, 1.0, LAST_DECREMENT)


def _minimize(problem, x, scale, goal):
    """Return x where the squared Newton decrement is below a goal, and the Hessian; barriers times a scale."""
    weights, before = [problem.positive_weight, *(body.weight for body in problem.bodies)], np.inf
    for _ in range(MAX_STEPS):
        gradient, hessian = _derivatives(problem, x, scale)
        squared, direction = _newton_step(gradient, hessian)
        # A whole step squares the decrement near the minimum; if not, only rounding is left.
        if squared <= goal or (before < CONVERGED * scale * min(weights) and squared > 0.5 * before):
            return x, hessian
        length = _step_length(problem, x, direction, squared, scale)
        if not length:
            return x, hessian
        x, before = x + length * direction, squared if length == 1.0 else np.inf
    raise DiagDynamicsError(f"Identification has found no minimum within {MAX_STEPS} Newton steps.")


def _value(problem, x, scale):
    """Return the function, barriers times a scale; infinite outside of the cones."""
    positive = x[problem.positive]
    if (positive <= 0.0).any():
        return np.inf
    value = x @ (0.5 * problem.A @ x - problem.b) - scale * problem.positive_weight * np.log(positive).sum()
    for body in problem.bodies:
        J = body.pseudo_inertia(x)
        try:
            diagonal = np.diag(np.linalg.cholesky(J))
        except np.linalg.LinAlgError:
            return np.inf
        value += scale * body.weight * (np.sum(np.linalg.inv(body.prior) * J) - 2.0 * np.log(diagonal).sum())
    return value


def _derivatives(problem, x, scale):
    """Return gradient and Hessian."""
    gradient, hessian, k = problem.A @ x - problem.b, problem.A.copy(), problem.positive
    for body in problem.bodies:
        own, weight = body.places, scale * body.weight
        inverse = np.linalg.inv(body.pseudo_inertia(x))
        gradient[own] += weight * np.tensordot(BASIS, np.linalg.inv(body.prior) - inverse, 2)
        turned = inverse @ BASIS
        hessian[own, own] += weight * np.einsum("aij,bji->ab", turned, turned)
    gradient[k] -= scale * problem.positive_weight / x[k]
    hessian[k, k] += scale * problem.positive_weight / x[k] ** 2
    return gradient, hessian


def _newton_step(gradient, hessian):
    """Return the squared Newton decrement and the step, the Hessian scaled by its diagonal because units differ."""
    linalg, diagonal = require("scipy.linalg", "identify"), np.diag(hessian)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled, right = hessian * scale[:, None] * scale + REGULAR * np.eye(len(scale)), -gradient * scale
    direction = linalg.cho_solve(linalg.cho_factor(scaled), right)  # threads of an LU factorization mostly wait
    return float(direction @ right), direction * scale


def _step_length(problem, x, direction, squared, scale):
    """Return the fraction of the Newton step that reduces the function; 0 where only rounding is left."""
    value = _value(problem, x, scale)
    for length in 0.5 ** np.arange(MAX_HALVINGS):
        goal = value - 0.1 * length * squared + ROUNDING * abs(value)
        if _value(problem, x + length * direction, scale) <= goal:
            return length
    return 0.0
