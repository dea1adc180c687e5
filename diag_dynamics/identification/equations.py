# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Normal equations of a model's parameters, and what a recording adds to them."""

from __future__ import annotations

import numpy as np

from diag_dynamics.compiled.tables import Addresses
from diag_dynamics.identification.kernels import prepare
from diag_dynamics.identification.kernels.normal_equations import NORMAL_EQUATIONS, OWN, TOGETHER, take_many
from diag_dynamics.identification.kernels.regressors import PARAMETERS
from diag_dynamics.sweeps import Workspace

DAMPING, FRICTION, OFFSET, ROTOR = range(OWN)
"""Columns of a degree of freedom of its own."""


class Equations:
    """Sums of squares of filtered rows, one set for each degree of freedom, so that they can be weighted later.

    A row says: momentum, friction and gravity, filtered, equal the filtered effort. Unknowns are ten parameters of each body
    with inertia, in the body's frame, then four of each degree of freedom: damping, Coulomb friction, offset, rotor inertia.

    Parameters
    ----------
    model : RobotModel
    rate : float
        λ, of the filter [1/s].
    friction_velocity : float
        v₀ of Coulomb friction [rad/s, m/s].
    also : sequence of int
        Bodies that are among the unknowns, have they inertia or not.

    Attributes
    ----------
    bodies : ndarray of int
        Bodies with inertia, in the order of the unknowns.
    columns : list of ndarray of int
        Unknowns that stand in the rows of each degree of freedom.
    size : int
        Number of unknowns.
    """

    def __init__(self, model, rate, friction_velocity, also=()):
        bodies = model.bodies
        self.bodies = np.union1d(np.flatnonzero(bodies["mass"][1:] > 0.0) + 1, np.array(also, dtype=int))
        self._rate, self._friction_velocity, nv = rate, friction_velocity, model.nv
        self.size = PARAMETERS * len(self.bodies) + OWN * nv
        place = np.full((nv, len(bodies)), -1)
        first, corner, self.columns = np.zeros(nv + 1, int), np.zeros(nv + 1, int), []
        carried = [set() for _ in range(nv)]
        for body in self.bodies.tolist():
            inboard = body
            while inboard > 0:
                carried[bodies["dof"][inboard]].add(body)
                inboard = int(bodies["parent"][inboard])
        rank = {body: k for k, body in enumerate(self.bodies.tolist())}
        for k in range(nv):
            outboard = sorted(carried[k])
            for number, body in enumerate(outboard):
                place[k, body] = first[k] + PARAMETERS * number
            inertial = [PARAMETERS * rank[body] + np.arange(PARAMETERS) for body in outboard]
            own = PARAMETERS * len(self.bodies) + OWN * k + np.arange(OWN)
            self.columns.append(np.concatenate([*inertial, own]))
            first[k + 1] = first[k] + len(self.columns[k])
            corner[k + 1] = corner[k] + len(self.columns[k]) ** 2
        self._first, self._corner = first, corner
        self._square, self._right, self._numbers = np.zeros(corner[-1]), np.zeros(first[-1]), np.zeros((2, nv))
        self._waiting, self._count = np.zeros((TOGETHER, first[-1])), np.zeros(1, int)
        self._workspace = Workspace(bodies, model.gravity)
        self._table = Addresses(
            NORMAL_EQUATIONS,
            place=place,
            first=first,
            corner=corner,
            columns=np.zeros((len(bodies), len(bodies), 12)),
            **{name: np.zeros(first[-1]) for name in ("momentum", "before", "now", "filtered")},
            effort=np.zeros((2, nv)),
            waiting=self._waiting,
            count=self._count,
            square=self._square,
            right=self._right,
            numbers=self._numbers,
            time=np.zeros(1),
        )
        prepare(take_many)

    def take(self, segment, anew=True):
        """Add rows of states.

        Parameters
        ----------
        segment : Segment
            Consecutive states.
        anew : bool
            Whether the filter begins anew, or goes on from what was taken in last.
        """
        done = take_many(
            self._workspace.robot,
            self._table.at,
            *(np.ascontiguousarray(part) for part in (segment.q, segment.qd, segment.tau, segment.t)),
            anew,
            self._rate,
            self._friction_velocity,
        )
        assert done == len(segment.t), "segments hold only finite states"

    def sums(self):
        """:class:`Sums` of all that was taken in until now."""
        nv, squares, rights = self._numbers.shape[1], [], []
        for k in range(nv):
            size = self._first[k + 1] - self._first[k]
            waiting = self._waiting[: self._count[0], self._first[k] : self._first[k + 1]]
            square = self._square[self._corner[k] : self._corner[k + 1]].reshape(size, size)
            lower = np.tril(square + waiting.T @ waiting)
            squares.append(lower + np.tril(lower, -1).T)
            rights.append(self._right[self._first[k] : self._first[k + 1]].copy())
        return Sums(self.columns, squares, rights, *self._numbers.copy())


class Sums:
    """Weighted sums over rows: AᵀA, Aᵀb, bᵀb and of the weights, of each degree of freedom.

    Attributes
    ----------
    columns : list of ndarray of int
    square, right : list of ndarray
    effort, weight : ndarray, shape (nv,)
    """

    def __init__(self, columns, square, right, effort, weight):
        self.columns, self.square, self.right, self.effort, self.weight = columns, square, right, effort, weight

    def __sub__(self, other):
        """Sums over the rows that `other`, taken earlier in the same pass, has not."""
        return Sums(
            self.columns,
            [a - b for a, b in zip(self.square, other.square, strict=True)],
            [a - b for a, b in zip(self.right, other.right, strict=True)],
            self.effort - other.effort,
            self.weight - other.weight,
        )

    def squared_residuals(self, x):
        """Mean squared residual of the rows of each degree of freedom, [N m]² or [N]²; x are all unknowns."""
        found = np.zeros(len(self.columns))
        for k, columns in enumerate(self.columns):
            own = x[columns]
            found[k] = self.effort[k] - 2.0 * self.right[k] @ own + own @ self.square[k] @ own
        return np.maximum(found, 0.0) / np.maximum(self.weight, 1e-300)

    def weighted(self, variance, size):
        """A and b of all rows over each degree of freedom's variance."""
        A, b = np.zeros((size, size)), np.zeros(size)
        for k, columns in enumerate(self.columns):
            A[np.ix_(columns, columns)] += self.square[k] / variance[k]
            b[columns] += self.right[k] / variance[k]
        return A, b
