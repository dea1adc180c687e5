# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A fit: its unknowns, the normal equations that it is made to, and its numbers with their certainty."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.identification import inertias
from diag_dynamics.identification.kernels.regressors import PARAMETERS
from diag_dynamics.identification.regressors import DAMPING, FRICTION, OWN, ROTOR
from diag_dynamics.identification.solver import Body, Problem, solve

PAYLOAD_WEIGHT, POSITIVE_WEIGHT = 0.1, 0.01  # γ of a payload (10 would shift its centre by centimetres) and γ'
START = 0.1  # friction and rotor inertias at the start of a fit [SI]
ROUNDS, CONVERGED = 5, 0.02  # rounds of weights by residual variance, and its relative change that ends them
FALLING, MAX_ROUNDS = 0.5, 30  # without noise variances fall by this factor, and rounds go on
MIN_VARIANCE = 1e-10  # smallest variance of the residual, relative to the effort's mean square
MASS, RADIUS, DISTANCE = 1.0, 0.05, 0.05  # prior of a payload: a ball [kg, m] at this distance along z [m]


class Payload(NamedTuple):
    """Link, its body, its 4x4 placement in that, and the prior pseudo-inertia in the body's frame."""

    link: str
    body: int
    placement: np.ndarray
    prior: np.ndarray


def payload_at(model, link):
    """Return the :class:`Payload` of a link."""
    body, placement = model.placement_in_body(link)
    ball = inertias.of_body(MASS, [0.0, 0.0, DISTANCE], 0.4 * MASS * RADIUS**2 * np.eye(3))
    return Payload(link, body, placement, inertias.pseudo_inertia(inertias.moved(ball, placement)))


class Fit(NamedTuple):
    """All unknowns, their covariance, and the fraction that the rows determine: diag (A + γH)⁻¹A. Both are 0 if known."""

    x: np.ndarray
    covariance: np.ndarray
    determined: np.ndarray


class Layout:
    """Unknowns of a model (`known`): those of :class:`Regressors`, then the ten of a payload.

    `positive` and `inertial` tell which are positive, and which are of bodies with mass. Rows are pairs of
    normal equations, and of whether the robot carries the payload in them.
    """

    def __init__(self, model, regressors, payload=None):
        self.model, self.payload, self.bodies = model, payload, regressors.bodies
        self.regressors, self.own, self.without_rotors = regressors, regressors.own, False
        self.robot = regressors.size
        self.size = self.robot + (PARAMETERS if payload else 0)
        # Unknowns of the robot, without and with the payload in them, are these matrices times all unknowns.
        self._maps = np.repeat(np.eye(self.robot, self.size)[None], 2, axis=0)
        if payload:
            carrier = self.block(int(np.searchsorted(self.bodies, payload.body)))
            self._maps[1, carrier, self.robot :] = np.eye(PARAMETERS)
        self.known, (self.positive, self.inertial) = np.zeros(self.size), np.zeros((2, self.size), dtype=bool)
        for k, body in enumerate(self.bodies.tolist()):
            self.known[self.block(k)] = inertias.parameters_of_record(model.bodies[body])
            self.inertial[self.block(k)] = model.bodies["mass"][body] > 0.0
        values = model.damping, model.friction, model.effort_offset, model.armature
        for column, one in zip(OWN, values, strict=True):
            self.known[self.own(column)] = one
            self.positive[self.own(column)] = column in (DAMPING, FRICTION, ROTOR)

    def block(self, k):
        """Return the unknowns of the k-th body."""
        return slice(PARAMETERS * k, PARAMETERS * (k + 1))

    def squares(self, rows, x):
        """Return the sum of squared residuals of each degree of freedom."""
        return sum(self.regressors.residual_squares(sums, self._maps[int(loaded)] @ x) for sums, loaded in rows)

    def mean_squares(self, rows, x):
        """Return the mean squared residual of each degree of freedom; of efforts, if the unknowns are 0."""
        return self.squares(rows, x) / max(sum(sums[-1] for sums, _ in rows), 1e-300)

    def weighted(self, rows, variance):
        """Return A and b over all rows."""
        A, b = np.zeros((self.size, self.size)), np.zeros(self.size)
        for sums, loaded in rows:
            square, right = self.regressors.weighted(sums, variance)
            matrix = self._maps[int(loaded)]
            A += matrix.T @ square @ matrix
            b += matrix.T @ right
        return A, b


def fit_rows(layout, rows, free, weight):
    """Return the :class:`Fit` of the `free` unknowns (bool) to rows; `weight` is γ of the prior on inertias.

    A payload is physical by itself; if its mass is negative, together with its body.
    """
    if layout.payload:
        base = inertias.parameters_of_record(layout.model.bodies[layout.payload.body])
        lighter = _fit(layout, rows, free, weight, base) if base[0] > 0.0 else None
        if lighter and lighter.x[layout.robot] < 0.0:
            return lighter
    return _fit(layout, rows, free, weight, None)


def _fit(layout, rows, free, weight, base):
    index, x = np.flatnonzero(free), layout.known.copy()
    covariance, determined = np.zeros((layout.size, layout.size)), np.zeros(layout.size)
    if not len(index):
        return Fit(x, covariance, determined)
    start, bodies = _start(layout, free, weight, base)
    bodies = [body._replace(first=int(np.searchsorted(index, body.first))) for body in bodies]
    known, positive = np.where(free, 0.0, layout.known), np.flatnonzero(layout.positive[index])
    variance = scale = np.maximum(layout.mean_squares(rows, np.zeros(layout.size)), 1e-12)
    for turn in range(MAX_ROUNDS):
        A, b = layout.weighted(rows, variance)
        problem = Problem(A[np.ix_(index, index)], (b - A @ known)[index], bodies, positive, POSITIVE_WEIGHT)
        x[index], hessian = solve(problem, start[index])
        before, variance = variance, np.maximum(layout.mean_squares(rows, x), MIN_VARIANCE * scale)
        falls = np.any(variance <= FALLING * before)
        if np.all(np.abs(variance / before - 1.0) < CONVERGED) or (turn >= ROUNDS and not falls):
            break
    units = 1.0 / np.sqrt(np.diag(hessian))
    inverse = np.linalg.pinv(hessian * units[:, None] * units, hermitian=True) * units[:, None] * units
    covariance[np.ix_(index, index)] = inverse
    determined[index] = np.einsum("ij,ji->i", inverse, problem.A)
    return Fit(x, covariance, determined)


def _start(layout, free, weight, base):
    """Return all unknowns at the start, and the bodies to fit; `base` carries the payload."""
    start, bodies = np.where(layout.positive, START, layout.known), []
    for k, body in enumerate(layout.bodies.tolist()):
        if free[layout.block(k)].all():
            bodies.append(Body(layout.block(k).start, *_prior(layout.model, body, weight)))
    if layout.payload and base is None:
        bodies.append(Body(layout.robot, layout.payload.prior, PAYLOAD_WEIGHT, np.zeros((4, 4))))
    elif layout.payload:
        bodies.append(Body(layout.robot, inertias.floored(base), PAYLOAD_WEIGHT, inertias.pseudo_inertia(base)))
    for body in bodies:
        start[body.places] = inertias.parameters_of_pseudo(body.prior - body.fixed)
    return start, bodies


def _prior(model, body, weight):
    """Return a body's floored pseudo-inertia without the model's payloads, the weight, and theirs, negative."""
    whole, carried = inertias.parameters_of_record(model.bodies[body]), np.zeros(PARAMETERS)
    for link, payload in model.payloads.items():
        of_link, placement = model.placement_in_body(link)
        if of_link == body:
            carried += inertias.moved(inertias.of_body(*payload), placement)
    carried *= whole[0] > carried[0]
    return inertias.floored(whole - carried), weight, -inertias.pseudo_inertia(carried)
