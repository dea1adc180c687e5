# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A fit: its unknowns, its normal equations, and its numbers with their certainty.

Least squares over physical inertias and positive friction, by Newton's method along the central
path:

    min ½ xᵀA x − bᵀx + Σ γ [tr(J₀⁻¹J) − ln det J] + γ' Σ [x_k/x₀ − ln x_k]

J is the pseudo-inertia of a body, linear in x, and J₀ that of the model. The barrier of J is its
prior, smallest at J = J₀. That of positive unknowns is smallest at x₀: where a joint moves one way
only, the rows do not bound its friction beside its offset. Plain Newton crawls along the boundary
of the cone. Logarithms with large weights that fall do not, if tr(J₀⁻¹J) keeps its weight.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.identification import inertias
from diag_dynamics.identification.normal_equations import COLUMNS, OFFSET, PARAMETERS
from diag_dynamics.optional import require

# γ of a payload (10 would shift its centre by centimetres) and γ'
PAYLOAD_WEIGHT, POSITIVE_WEIGHT = 0.1, 0.01
START = 0.1  # x₀ of friction and rotor inertias, with which a fit starts [SI]
# Rounds of weights by residual variance, and its relative change that ends them
ROUNDS, CONVERGED = 5, 0.02
GAIN_DEVIATION = 0.05  # standard deviation of the gain of a joint's effort, beside a payload
FALLING, MAX_ROUNDS = 0.5, 30  # without noise variances fall by this factor, and rounds go on
MIN_VARIANCE = 1e-10  # smallest variance of the residual, relative to the effort's mean square
# Prior of a payload: 1 kg, 5 cm from the link's origin
BALL = inertias.of_body(1.0, [0.0, 0.0, 0.05], 1e-3 * np.eye(3))
# Squared Newton decrement at the end of a stage, over its γ; of the last
STAGE_DECREMENT, LAST_DECREMENT = 0.1, 1e-7
QUADRATIC = 0.05  # squared decrement over the smallest weight below which convergence is quadratic
ROUNDING = 1e-14  # relative error of the function's value
REGULAR = 1e-12  # added to the scaled Hessian, whose rounding errors are smaller
MAX_STEPS, MAX_STEPS_NEAR, MAX_HALVINGS = 400, 25, 60


class ConvergenceError(DiagDynamicsError):
    """A fit that does not converge."""


class Carrier(NamedTuple):
    """Link that carries a payload: its name, its body, and its 4x4 placement in the body."""

    link: str
    body: int
    placement: np.ndarray


class Certainty(NamedTuple):
    """Covariance of unknowns, and that by priors and gains."""

    covariance: np.ndarray
    by_gains: np.ndarray


@dataclass
class Fit:
    """Unknowns `x` at the minimum, and their certainty, which cross-validation does not require."""

    x: np.ndarray
    free: np.ndarray | None = None
    find_certainty: Callable | None = None

    @cached_property
    def certainty(self):
        """The :class:`Certainty`."""
        covariance, by_gains = np.zeros((2, len(self.x), len(self.x)))
        if self.find_certainty:
            places = np.ix_(self.free, self.free)
            covariance[places], by_gains[places] = self.find_certainty()
        return Certainty(covariance, by_gains)


class Layout:
    """Unknowns of a model (`known`).

    They are those of :class:`Regressors`, then the ten of a payload in its link's frame. The first
    `robot` of the `size` unknowns are those of the robot. `positive` and `inertial` tell which are
    positive, and which are of bodies with mass; `without_rotors` whether the model's rotor inertias
    are left out. Arguments `rows` are lists of pairs: normal equations, and whether the robot
    carries the payload in them.
    """

    def __init__(self, model, regressors, payload=None):
        self.model = model
        self.payload = payload
        self.bodies = regressors.bodies
        self.regressors = regressors
        self.own = regressors.own
        self.without_rotors = False
        self.robot = regressors.size
        self.size = self.robot + (PARAMETERS if payload else 0)
        if payload:
            self._carrier = self.block(int(np.searchsorted(self.bodies, payload.body)))
            units = [inertias.moved(unit, payload.placement) for unit in np.eye(PARAMETERS)]
            # Its product with the payload's parameters is added to those of the body.
            self._placed = np.transpose(units)
        self.known = np.zeros(self.size)
        self.positive, self.inertial = np.zeros((2, self.size), bool)
        for k, body in enumerate(self.bodies.tolist()):
            self.known[self.block(k)] = inertias.parameters_of_record(model.bodies[body])
            self.inertial[self.block(k)] = model.bodies["mass"][body] > 0.0
        for name, column in COLUMNS.items():
            self.known[self.own(column)] = getattr(model, name)
            self.positive[self.own(column)] = column != OFFSET

    def block(self, k):
        """Return the unknowns of the k-th body."""
        return slice(PARAMETERS * k, PARAMETERS * (k + 1))

    def fitted_of(self, k, x, free):
        """Return the free unknowns of a degree of freedom, by the names of joint parameters."""
        places = {name: self.own(column)[k] for name, column in COLUMNS.items()}
        return {name: float(x[place]) for name, place in places.items() if free[place]}

    def payload_of(self, x, free):
        """Return ten parameters of the payload that leave its carrier a physical body.

        A reference fits the carrier along, but the model keeps its own unless it is `free`.
        """
        payload = x[self.robot :]
        whole = np.where(free, x, self.known)[self._carrier] + self._placed @ payload
        if whole[0] <= 0.0 or inertias.is_physical(whole):
            return payload
        raised = inertias.parameters_of_pseudo(inertias.floored(whole))
        return payload + np.linalg.solve(self._placed, raised - whole)

    def squares(self, rows, x, any_gain=False):
        """Return the sum of squared residuals of each degree of freedom.

        Residuals are those of :meth:`Regressors.residual_squares`.
        """
        alone = x[: self.robot]
        carrying = x[: self.robot].copy()
        if self.payload:
            carrying[self._carrier] += self._placed @ x[self.robot :]
        return sum(
            self.regressors.residual_squares(sums, carrying if loaded else alone, any_gain)
            for sums, loaded in rows
        )

    def mean_squares(self, rows, x):
        """Return the mean squared residual of each degree of freedom.

        It is that of the efforts if the unknowns are 0.
        """
        return self.squares(rows, x) / _sum_weights(rows)

    def variance(self, rows, x):
        """Return the variance of rows of each degree of freedom.

        Beside a payload, gains may be wrong. A small residual of a wrong gain is chance, so all
        joints have the error of a gain that they show together, up to GAIN_DEVIATION.
        """
        efforts = np.maximum(self.mean_squares(rows, np.zeros(self.size)), 1e-12)
        residual = self.mean_squares(rows, x)
        if self.payload:
            noise = self.squares(rows, x, any_gain=True) / _sum_weights(rows)
            gain = np.mean((residual - noise) / efforts)
            residual = noise + min(gain, GAIN_DEVIATION**2) * efforts
        return np.maximum(residual, MIN_VARIANCE * efforts)

    def weighted(self, rows, variance):
        """Return A and b over all rows, b by degree of freedom."""
        A = np.zeros((self.size, self.size))
        robot = slice(self.robot)
        b = np.zeros((self.size, self.model.nv))
        for sums, loaded in rows:
            square, right = self.regressors.weighted(sums, variance)
            A[robot, robot] += square
            b[robot] += right
            if loaded and self.payload:
                carried = slice(self.robot, None)
                across = square[:, self._carrier] @ self._placed
                A[robot, carried] += across
                A[carried, robot] += across.T
                A[carried, carried] += self._placed.T @ across[self._carrier]
                b[carried] += self._placed.T @ right[self._carrier]
        return A, b


def _sum_weights(rows):
    return max(sum(sums[-1] for sums, _ in rows), 1e-300)


def fit_rows(layout, rows, free, weight, similar=None):
    """Return the :class:`Fit` of `free` unknowns to rows, from that to `similar` rows.

    `weight` is γ. Negative payloads are physical with their body.
    """
    if layout.payload:
        _, body, placement = layout.payload
        base = inertias.moved(
            inertias.parameters_of_record(layout.model.bodies[body]), np.linalg.inv(placement)
        )
        if similar:
            base = base if similar.x[layout.robot] < 0.0 else None
            return _fit(layout, rows, free, weight, base, similar)
        lighter = _fit(layout, rows, free, weight, base) if base[0] > 0.0 else None
        if lighter and lighter.x[layout.robot] < 0.0:
            return lighter
    return _fit(layout, rows, free, weight, None, similar)


def _fit(layout, rows, free, weight, base, similar=None):
    index = np.flatnonzero(free)
    x = layout.known.copy()
    if not len(index):
        return Fit(x)
    start, bodies = _start(layout, free, weight, base)
    bodies = [body._replace(first=int(np.searchsorted(index, body.first))) for body in bodies]
    fixed = np.where(free, 0.0, layout.known)
    positive = np.flatnonzero(layout.positive[index])
    variance = np.maximum(layout.mean_squares(rows, np.zeros(layout.size)), 1e-12)
    if similar:
        start = similar.x
        variance = layout.variance(rows, start)
    for turn in range(MAX_ROUNDS):
        A, b = layout.weighted(rows, variance)
        right = (b.sum(axis=1) - A @ fixed)[index]
        problem = Problem(A[np.ix_(index, index)], right, bodies, positive)
        near = turn > 0 or similar is not None
        x[index], hessian = solve(problem, x[index] if turn else start[index], near)
        before = variance
        variance = layout.variance(rows, x)
        falls = np.any(variance <= FALLING * before)
        if np.all(np.abs(variance / before - 1.0) < CONVERGED) or (turn >= ROUNDS and not falls):
            break

    def find_certainty():
        inverse = _solve_scaled(hessian, np.eye(len(index)))
        residual = layout.mean_squares(rows, x)
        noise, _ = layout.weighted(rows, before**2 / np.maximum(residual, MIN_VARIANCE * before))
        by_priors = inverse - inverse @ problem.A @ inverse
        gains = GAIN_DEVIATION * inverse @ b[index]
        covariance = by_priors + inverse @ noise[np.ix_(index, index)] @ inverse
        return covariance, by_priors + gains @ gains.T

    return Fit(x, index, find_certainty)


def _start(layout, free, weight, base):
    """Return all unknowns at the start, and the bodies to fit; `base` carries the payload."""
    start = np.where(layout.positive, START, layout.known)
    bodies = []
    for k, body in enumerate(layout.bodies.tolist()):
        if free[layout.block(k)].all():
            bodies.append(Body(layout.block(k).start, *_prior(layout.model, body, weight)))
    if layout.payload:
        prior, fixed = (BALL, 0.0 * BALL) if base is None else (base, base)
        bodies.append(
            Body(
                layout.robot,
                inertias.floored(prior),
                PAYLOAD_WEIGHT,
                inertias.pseudo_inertia(fixed),
            )
        )
    for body in bodies:
        start[body.first : body.first + PARAMETERS] = inertias.parameters_of_pseudo(
            body.prior - body.fixed
        )
    return start, bodies


def _prior(model, body, weight):
    """Return a body's floored pseudo-inertia without payloads, the weight, and minus the payloads'.

    Payloads are those of the model.
    """
    whole = inertias.parameters_of_record(model.bodies[body])
    carried = np.zeros(PARAMETERS)
    for link, payload in model.payloads.items():
        of_link, placement = model.placement_in_body(link)
        if of_link == body:
            carried += inertias.moved(inertias.of_body(*payload), placement)
    carried *= whole[0] > carried[0]
    return inertias.floored(whole - carried), weight, -inertias.pseudo_inertia(carried)


class Body(NamedTuple):
    """A pseudo-inertia J = Σ_j x[first + j] inertias.BASIS_j + fixed, prior J₀ and weight γ.

    All inertias are 4x4.
    """

    first: int
    prior: np.ndarray
    weight: float
    fixed: np.ndarray


class Problem(NamedTuple):
    """The function to minimize; unknowns with the indices `positive` are so, with the weight γ'."""

    A: np.ndarray
    b: np.ndarray
    bodies: list
    positive: np.ndarray


class _Logarithms(NamedTuple):
    """Logarithms of a problem: −Σ `weights` ln det J, and −Σ γ' ln x of `positive` unknowns.

    `places` are those of the ten unknowns of each body, (B, 10).
    """

    places: np.ndarray
    fixed: np.ndarray
    weights: np.ndarray
    positive: np.ndarray


def solve(problem, start, near=False):
    """Return x at the minimum and the Hessian there; the start is within all cones.

    Unless the start is `near`, the weights of logarithms fall by decades. Raises ConvergenceError.
    """
    bodies = problem.bodies
    places = np.array([body.first for body in bodies], int)[:, None] + np.arange(PARAMETERS)
    weights = np.array([body.weight for body in bodies])
    fixed = np.reshape([body.fixed for body in bodies], (-1, 4, 4))
    b = problem.b.copy()
    for place, body in zip(places, bodies, strict=True):
        b[place] -= body.weight * np.tensordot(inertias.BASIS, np.linalg.inv(body.prior), 2)
    b[problem.positive] -= POSITIVE_WEIGHT / START
    logs = _Logarithms(places, fixed, weights, problem.positive)
    smallest = min(POSITIVE_WEIGHT, weights.min(initial=np.inf))

    def minimize(x, scale, goal, steps):
        function = partial(_evaluate, problem.A, b, logs, scale)
        return _minimize(function, x, QUADRATIC * (scale * smallest), goal, steps)

    if near:
        try:
            return minimize(start, 1.0, LAST_DECREMENT, MAX_STEPS_NEAR)
        except ConvergenceError:
            pass
    goal = weights.min() if len(weights) else POSITIVE_WEIGHT
    decrement, _ = _newton_step(*_evaluate(problem.A, b, logs, 1.0, start)[1:])
    stages = int(np.ceil(np.log10(max(decrement, goal) / goal)))
    x = start
    for scale in 10.0 ** np.arange(stages, 0, -1):
        x, _ = minimize(x, scale, STAGE_DECREMENT * goal * scale, MAX_STEPS)
    return minimize(x, 1.0, LAST_DECREMENT, MAX_STEPS)


def _minimize(function, x, quadratic, goal, steps):
    """Return x where the squared Newton decrement is below a goal, and the Hessian."""
    before = np.inf
    value, gradient, hessian = function(x)
    for _ in range(steps):
        squared, direction = _newton_step(gradient, hessian)
        # A whole step squares the decrement near the minimum; if not, only rounding is left.
        if squared <= goal or (before < quadratic and squared > 0.5 * before):
            return x, hessian
        for length in 0.5 ** np.arange(MAX_HALVINGS):
            reached = function(x + length * direction)
            if reached[0] <= value - 0.1 * length * squared + ROUNDING * abs(value):
                break
        else:
            return x, hessian
        x = x + length * direction
        before = squared if length == 1.0 else np.inf
        value, gradient, hessian = reached
    raise ConvergenceError(f"The identification did not converge within {steps} Newton steps.")


def _evaluate(A, b, logs, scale, x):
    """Return ½ xᵀA x − bᵀx with scaled logarithms, gradient and Hessian.

    The value is infinite outside of the cones.
    """
    k = logs.positive
    weight = scale * POSITIVE_WEIGHT
    weights = scale * logs.weights
    J = np.tensordot(x[logs.places], inertias.BASIS, 1) + logs.fixed
    try:
        diagonals = np.diagonal(np.linalg.cholesky(J), axis1=1, axis2=2)
    except np.linalg.LinAlgError:
        return np.inf, None, None
    if (x[k] <= 0.0).any():
        return np.inf, None, None
    value = x @ (0.5 * A @ x - b) - weight * np.log(x[k]).sum()
    value -= 2.0 * weights @ np.log(diagonals).sum(axis=1)
    gradient = A @ x - b
    hessian = A.copy()
    gradient[k] -= weight / x[k]
    hessian[k, k] += weight / x[k] ** 2
    inverse = np.linalg.inv(J)
    pulls = np.tensordot(inverse, inertias.BASIS, ([1, 2], [1, 2]))
    gradient[logs.places] -= weights[:, None] * pulls
    turned = inverse[:, None] @ inertias.BASIS
    flat, transposed = (y.reshape(-1, PARAMETERS, 16) for y in (turned, turned.swapaxes(-1, -2)))
    curvatures = weights[:, None, None] * (flat @ transposed.swapaxes(-1, -2))
    hessian[logs.places[:, :, None], logs.places[:, None]] += curvatures
    return value, gradient, hessian


def _newton_step(gradient, hessian):
    """Return the squared Newton decrement and the step."""
    direction = -_solve_scaled(hessian, gradient)
    return float(-gradient @ direction), direction


def _solve_scaled(hessian, right):
    """Return H⁻¹ times a vector or columns; the diagonal scales H because units differ."""
    linalg = require("scipy.linalg", "identify")
    scale = 1.0 / np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    scaled = hessian * scale[:, None] * scale + REGULAR * np.eye(len(scale))
    factor = linalg.cho_factor(scaled)  # threads of an LU factorization mostly wait
    return (linalg.cho_solve(factor, (right.T * scale).T).T * scale).T
