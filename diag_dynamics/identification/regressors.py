# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Regressors of a robot, its filtered rows and their normal equations."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.kernels.regressors import PARAMETERS, fill_regressors, low_pass
from diag_dynamics.sweeps import Workspace

OWN = DAMPING, FRICTION, OFFSET, ROTOR = range(4)  # unknowns of a degree of freedom beside inertias
RATE = 2.0 * np.pi  # λ of the low-pass [1/s]; at 3 Hz the noise of velocities biases the columns
SIZE = 1000  # states whose rows are in memory at once
PRODUCT = 240_000  # rows × columns² of a product: BLAS has more threads wait for larger ones than work


class Regressors:
    """Rows Y_p and Y_g − Y_∂ with d/dt(Y_p π) + (Y_g − Y_∂) π = τ, without friction and rotors.

    Unknowns are ten parameters of each body with inertia, in its frame, then damping, Coulomb friction,
    offset and rotor inertia of each degree of freedom. The row of a degree of freedom has `columns` of
    them, of the bodies that it moves and its own, and then the effort. `rows` are their places in the row
    of all. Bodies in `also` are unknowns even without inertia.
    """

    def __init__(self, model, also=()):
        bodies, nv = model.bodies, model.nv
        self.bodies = np.union1d(np.flatnonzero(bodies["mass"][1:] > 0.0) + 1, np.array(also, dtype=int))
        self.size = PARAMETERS * len(self.bodies) + len(OWN) * nv
        moved = [set() for _ in range(nv)]
        for number, body in enumerate(self.bodies.tolist()):
            inboard = body
            while inboard > 0:
                moved[bodies["dof"][inboard]].add(number)
                inboard = int(bodies["parent"][inboard])
        self.columns, self.rows, end = [], [], 0
        self._first = np.full((nv, len(bodies)), -1.0)
        for k, numbers in enumerate(map(sorted, moved)):
            blocks = [PARAMETERS * number + np.arange(PARAMETERS) for number in numbers]
            own = PARAMETERS * len(self.bodies) + len(OWN) * k + np.arange(len(OWN))
            self.columns.append(np.concatenate([*blocks, own]))
            self._first[k, self.bodies[numbers]] = end + PARAMETERS * np.arange(len(numbers))
            self.rows.append(slice(end, end + len(self.columns[k]) + 1))
            end = self.rows[k].stop
        self._friction_velocity = model.friction_velocity
        self._workspace = Workspace(bodies, model.gravity)
        self._directions = np.zeros((len(bodies), len(bodies), 12))

    def evaluate(self, q, qd):
        """Return Y_p and Y_g − Y_∂ at states (T, nq) and (T, nv): rows of all, (T, R), zero beside inertias."""
        momentum, bias = np.empty((2, len(q), self.rows[-1].stop))
        q, qd = np.ascontiguousarray(q), np.ascontiguousarray(qd)
        done = fill_regressors(self._workspace.robot, q, qd, self._first, self._directions, momentum, bias)
        if done < len(q):
            raise InputError(f"state {done} is {q[done]}, {qd[done]}; expected finite numbers and an orientation.")
        return momentum, bias

    def filtered_rows(self, t, q, qd, tau):
        """Yield rows and weights of consecutive states from the second one on.

        A row is λ(Y_p − F Y_p) + F(Y_g − Y_∂), F[q̇, tanh(q̇/v₀), 1], λ(q̇ − F q̇) and Fτ. F of momentum
        begins at its first value, other filters at 0. The weight is min(1, λΔ/2), as rows that are closer
        than the filter's memory say the same.
        """
        own, state = np.array([row.stop - len(OWN) - 1 for row in self.rows]), None
        for first in range(0, len(t) - 1, SIZE):
            part = slice(first, first + SIZE + 1)
            rates, time = qd[part], RATE * t[part]
            momentum, y = self.evaluate(q[part], rates)
            momentum *= RATE
            momentum[:, own + ROTOR] = RATE * rates
            y -= momentum
            y[:, own + DAMPING], y[:, own + OFFSET], y[:, own + len(OWN)] = rates, 1.0, tau[part]
            v0 = self._friction_velocity
            y[:, own + FRICTION] = np.tanh(rates / v0) if v0 > 0.0 else np.sign(rates)
            filtered = np.empty_like(y)
            filtered[0] = -momentum[0] if state is None else state
            low_pass(time, y, filtered)
            state = filtered[-1]
            yield momentum[1:] + filtered[1:], np.minimum(1.0, 0.5 * np.diff(time))

    def sum_rows(self, rows, weights):
        """Return the :class:`NormalEquations` of rows."""
        rows = rows * np.sqrt(weights)[:, None]
        return NormalEquations(self.columns, [_square(rows[:, part]) for part in self.rows], weights.sum())

    def sum_segment(self, t, q, qd, tau):
        """Return the :class:`NormalEquations` of consecutive states."""
        sums = (self.sum_rows(*some) for some in self.filtered_rows(t, q, qd, tau))
        return sum(sums, NormalEquations.zero(self.columns))


def _square(rows):
    """Return AᵀA."""
    count, size = rows.shape
    each = max(1, PRODUCT // size**2)
    whole = count // each * each
    chunks, rest = np.ascontiguousarray(rows[:whole]).reshape(-1, each, size), rows[whole:]
    return (chunks.transpose(0, 2, 1) @ chunks).sum(axis=0) + rest.T @ rest


class NormalEquations(NamedTuple):
    """Weighted products of the columns of each degree of freedom, the effort behind them, and the sum of weights."""

    columns: list
    products: list
    weight: float

    @classmethod
    def zero(cls, columns):
        """Return sums over no rows."""
        return cls(columns, [np.zeros((len(one) + 1,) * 2) for one in columns], 0.0)

    def __add__(self, other):
        return self._merge(other, 1.0)

    def __sub__(self, other):
        return self._merge(other, -1.0)

    def _merge(self, other, factor):
        products = [a + factor * b for a, b in zip(self.products, other.products, strict=True)]
        return NormalEquations(self.columns, products, self.weight + factor * other.weight)

    @property
    def effort_squares(self):
        """Sums of squared efforts, shape (nv,)."""
        return np.array([one[-1, -1] for one in self.products])

    def residual_squares(self, x):
        """Return sums of squared residuals of each degree of freedom, given all unknowns."""
        signed = [np.append(-x[columns], 1.0) for columns in self.columns]
        return np.maximum([y @ one @ y for y, one in zip(signed, self.products, strict=True)], 0.0)

    def weighted(self, variance, size):
        """Return A and b over all rows, each degree of freedom's over its variance."""
        A, b = np.zeros((size, size)), np.zeros(size)
        for columns, one, each in zip(self.columns, self.products, variance, strict=True):
            A[np.ix_(columns, columns)] += one[:-1, :-1] / each
            b[columns] += one[:-1, -1] / each
        return A, b
