# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A fit: which parameters are free, the rows that they are fitted to, and what comes out, as plain numbers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diag_dynamics.identification import inertias
from diag_dynamics.identification.equations import DAMPING, FRICTION, OFFSET, OWN, ROTOR, Sums
from diag_dynamics.identification.kernels.regressors import PARAMETERS
from diag_dynamics.identification.solver import Body, Problem, solved

WEIGHT, SHORT_WEIGHT, SHORT = 10.0, 30.0, 6.0
"""γ of the prior on inertias; and that for less than so many seconds of motion."""

PAYLOAD_WEIGHT = 0.1
"""γ of a payload: 10 would shift its centre by centimetres."""

POSITIVE_WEIGHT = 0.01
"""γ' of friction and rotor inertias."""

START = 0.1
"""Friction and rotor inertias that a fit begins with [SI]."""

ROUNDS, SETTLED = 5, 0.02
"""Most rounds of weights by the variance of the residual, and its relative change below which they are over."""

FALLING, MOST_ROUNDS = 0.5, 30
"""Part to which a round makes a variance fall that is followed by another one, up to so many: where there is no noise."""

LEAST_VARIANCE = 1e-10
"""Smallest variance of the residual, in parts of the effort's mean square: without noise there is nothing to weigh by."""

BALL, RADIUS, BEYOND = 1.0, 0.05, 0.05
"""What a payload is taken for where the rows do not tell: a ball of a mass [kg] and radius [m], so far along z [m]."""


class Free(NamedTuple):
    """What is fitted; everything else is as the model has it."""

    friction: np.ndarray
    """Degrees of freedom whose damping, Coulomb friction and offset are, bool, shape (nv,)."""
    rotors: np.ndarray
    inertias: bool
    payload: Payload | None


class Payload(NamedTuple):
    """Where a payload is."""

    link: str
    body: int
    placement: np.ndarray
    """4x4, of the link in the body's frame."""
    ball: np.ndarray
    """Pseudo-inertia that it is taken for, in the body's frame."""

    @classmethod
    def of(cls, model, link):
        """Payload of a link."""
        body, placement = model.placement_in_body(link)
        centre = np.array([0.0, 0.0, BEYOND])
        ball = inertias.of_body(BALL, centre, 0.4 * BALL * RADIUS**2 * np.eye(3))
        return cls(link, body, placement, inertias.pseudo_inertia(inertias.moved(ball, placement)))


class Rows(NamedTuple):
    """Sums over rows, and whether the robot carries the payload in them."""

    sums: Sums
    loaded: bool


class Layout:
    """The unknowns of a model: those of :class:`Equations`, and then the ten of a payload.

    Parameters
    ----------
    model : RobotModel
    equations : Equations
    payload : Payload, optional

    Attributes
    ----------
    without_rotors : bool
        Whether the model's rotor inertias are left out, because the efforts do not contain them.
    """

    def __init__(self, model, equations, payload=None):
        self.model, self.bodies, self.payload = model, equations.bodies, payload
        self.robot = equations.size
        self.without_rotors = False
        self.size = self.robot + (PARAMETERS if payload else 0)
        self._own = PARAMETERS * len(self.bodies) + OWN * np.arange(model.nv)
        self.carrier = None
        if payload:
            self.carrier = PARAMETERS * int(np.searchsorted(self.bodies, payload.body)) + np.arange(PARAMETERS)
        self.known = np.zeros(self.size)
        for k, body in enumerate(self.bodies.tolist()):
            self.known[self.block(k)] = inertias.parameters_of_record(model.bodies[body])
        for column, values in (
            (DAMPING, model.damping),
            (FRICTION, model.friction),
            (OFFSET, model.effort_offset),
            (ROTOR, model.armature),
        ):
            self.known[self.own(column)] = values

    def block(self, k):
        """Unknowns of a body, by its number among those with inertia."""
        return slice(PARAMETERS * k, PARAMETERS * (k + 1))

    def own(self, column):
        """Unknowns of one kind, of all degrees of freedom."""
        return self._own + column

    def weighted(self, rows, variance):
        """A and b over all rows, (size, size) and (size,)."""
        A, b = np.zeros((self.size, self.size)), np.zeros(self.size)
        robot = slice(0, self.robot)
        for sums, loaded in rows:
            square, right = sums.weighted(variance, self.robot)
            A[robot, robot] += square
            b[robot] += right
            if loaded:
                A[robot, self.robot :] += square[:, self.carrier]
                A[self.robot :, robot] += square[self.carrier]
                A[self.robot :, self.robot :] += square[np.ix_(self.carrier, self.carrier)]
                b[self.robot :] += right[self.carrier]
        return A, b

    def effective(self, x, loaded):
        """Unknowns of the robot alone that stand for it and its payload."""
        own = x[: self.robot].copy()
        if loaded:
            own[self.carrier] += x[self.robot :]
        return own

    def mean_squares(self, rows, x):
        """Mean squared residual of each degree of freedom's rows."""
        weight = sum(sums.weight for sums, _ in rows)
        total = sum(sums.squared_residuals(self.effective(x, loaded)) * sums.weight for sums, loaded in rows)
        return total / np.maximum(weight, 1e-300)


class Fit(NamedTuple):
    """What a fit has found."""

    x: np.ndarray
    """All unknowns of the layout."""
    variance: np.ndarray
    """Mean squared residual of the rows, by degree of freedom."""
    free: np.ndarray
    """Indices of the unknowns that were fitted."""
    covariance: np.ndarray
    """Of these, given the prior."""
    known: np.ndarray
    """How much of each is told by the rows and not by the prior, 0 to 1."""
    steps: int


def fitted(layout, rows, free, weight):
    """Fit to rows, each degree of freedom's by the variance of its residual.

    Parameters
    ----------
    layout : Layout
    rows : list of Rows
    free : Free
    weight : float
        γ of the prior on inertias.
    """
    if free.payload is None:
        return _fitted(layout, rows, free, weight, None)
    base = inertias.parameters_of_record(layout.model.bodies[free.payload.body])
    if base[0] > 0.0:  # what is there bounds what can be missing
        found = _fitted(layout, rows, free, weight, base)
        if found.x[layout.robot] < 0.0:
            return found
    return _fitted(layout, rows, free, weight, None)


def _fitted(layout, rows, free, weight, carrying):
    """`carrying`: parameters of the body, where it is that together with the payload which has to be physical."""
    which, positive = np.zeros(layout.size, bool), np.zeros(layout.size, bool)
    start = layout.known.copy()
    for column, joints in ((DAMPING, free.friction), (FRICTION, free.friction), (ROTOR, free.rotors)):
        chosen = layout.own(column)[joints]
        which[chosen] = positive[chosen] = True
        start[chosen] = START
    which[layout.own(OFFSET)[free.friction]] = True
    bodies = []
    if free.inertias:
        for k, body in enumerate(layout.bodies.tolist()):
            if not layout.model.bodies["mass"][body] > 0.0:
                continue
            block = layout.block(k)
            prior, carried = _without_payloads(layout, body)
            which[block] = True
            start[block] = inertias.parameters_of_pseudo(prior - carried)
            bodies.append((block.start, prior, weight, carried))
    if free.payload:
        block = slice(layout.robot, layout.size)
        which[block] = True
        if carrying is None:
            prior, fixed = free.payload.ball, np.zeros((4, 4))
        else:
            prior, fixed = inertias.floored(carrying), inertias.pseudo_inertia(carrying)
        start[block] = inertias.parameters_of_pseudo(prior - fixed)
        bodies.append((block.start, prior, PAYLOAD_WEIGHT, fixed))
    index = np.flatnonzero(which)
    bodies = [Body(int(np.searchsorted(index, first)), *rest) for first, *rest in bodies]
    known = np.where(which, 0.0, layout.known)
    weights = np.maximum(sum(sums.weight for sums, _ in rows), 1e-300)
    scale = sum(sums.effort for sums, _ in rows) / weights
    scale = np.maximum(scale, 1e-12)
    variance, steps = scale, 0
    for turn in range(MOST_ROUNDS):
        A, b = layout.weighted(rows, variance)
        problem = Problem(
            A[np.ix_(index, index)],
            (b - A @ known)[index],
            bodies,
            np.flatnonzero(positive[index]),
            POSITIVE_WEIGHT,
        )
        solution = solved(problem, start[index])
        steps += solution.steps
        x = known.copy()
        x[index] = solution.x
        before, variance = variance, np.maximum(layout.mean_squares(rows, x), LEAST_VARIANCE * scale)
        if np.all(np.abs(variance / before - 1.0) < SETTLED) or (
            turn >= ROUNDS and np.all(variance > FALLING * before)
        ):
            break
    covariance, told = _certainty(problem, solution)
    return Fit(x, variance, index, covariance, told, steps)


def _without_payloads(layout, body):
    """Pseudo-inertia of a body without the payloads of the model, floored; and what these add to the unknowns, negative."""
    model = layout.model
    carried = np.zeros(PARAMETERS)
    for link, (mass, com, inertia) in model.payloads.items():
        of_link, placement = model.placement_in_body(link)
        if of_link == body:
            own = inertias.of_body(mass, np.asarray(com), np.asarray(inertia))
            carried += inertias.moved(own, placement)
    own = inertias.parameters_of_record(model.bodies[body]) - carried
    if own[0] <= 0.0:
        own, carried = own + carried, np.zeros(PARAMETERS)
    return inertias.floored(own), -inertias.pseudo_inertia(carried)


def _certainty(problem, solution):
    """Covariance of the unknowns, and the part of each that the rows tell: the diagonal of (A + γH)⁻¹A."""
    if not len(solution.x):
        return np.zeros((0, 0)), np.zeros(0)
    scale = 1.0 / np.sqrt(np.diag(solution.hessian))
    inverse = np.linalg.pinv(solution.hessian * scale[:, None] * scale, hermitian=True)
    covariance = inverse * scale[:, None] * scale
    return covariance, np.einsum("ij,ji->i", covariance, problem.A)
