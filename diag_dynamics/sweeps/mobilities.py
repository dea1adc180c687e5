# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mobilities of bodies and links, Υ = J M⁻¹Jᵀ, by one outward sweep behind the factorization.

ν has the unit matrix for its mass matrix, so that Υ of a body is the sum of what each ν_k moves it by, times its transpose.
Own rates and the carrier's motion are independent there, ξ_i of D⁻¹, and with q̇ = ξ − GᵀV⁺ (Table 1, right)

    Υ⁺ = X Υ_p Xᵀ      Υ = τ̄ᵀΥ⁺τ̄ + S D⁻¹Sᵀ      τ̄ᵀ = 1 − S Gᵀ      Υ of the world = 0.

A body of a group moves by what its carrier does and by the group's own ξ: Υ_ab = F_aᵀΥ_A F_b + Σ κ_a D⁻¹κ_b, with κ the
working moments of a unit wrench along a, and F what is left of it on the carrier.

Υ is kept in the place of P, its angular part first: then it goes to a child as P of a child goes to its parent, with the
inverse placement.
"""

import math

import numba
import numpy as np

from diag_dynamics.compiled.kernel import FILLED_STATES, ROBOT, VECTOR, entry_kernel, kernel, large_kernel
from diag_dynamics.sweeps.bodies import force_of, inertia_of, matrix_of, placement_of, set_inertia, vector_of
from diag_dynamics.sweeps.factorization import place_and_factorize
from diag_dynamics.sweeps.groups import filter_moments, is_grouped, owns
from diag_dynamics.sweeps.joints import force_inboard
from diag_dynamics.sweeps.spatial import (
    ANGULAR_Z,
    NO_INERTIA,
    ZERO,
    Force,
    Inertia,
    Motion,
    Placement,
    add,
    along,
    apply,
    apply_transposed,
    inertia_to_parent,
    power,
    scale,
    subtract,
    subtract_force,
    transpose,
)
from diag_dynamics.sweeps.workspace import MISFIT, columns_of, fit_positions, opened

FRAME = np.dtype(
    [("body", "i8"), ("same", "i8"), ("rotation", "f8", 9), ("translation", "f8", 3)],
    align=True,
)
"""A frame that is fixed to a body: its axes and origin in those of the body, and whether they are the body's own."""

FRAMES = numba.from_dtype(FRAME)[::1]

PLACES = np.zeros((6, 6), np.int64)
"""Where the field P has an entry of the symmetric matrix, by row and column."""

PLACES[np.triu_indices(6)] = [0, 1, 2, 6, 7, 8, 3, 4, 9, 10, 11, 5, 12, 13, 14, 15, 16, 17, 18, 19, 20]

# --- Between one frame and the next -------------------------------------------------------------------------


@kernel
def inverse_placement(X):
    """Placement of the parent in the child."""
    return Placement(transpose(X.rotation), scale(apply_transposed(X.rotation, X.translation), -1.0))


@kernel
def to_child(X, Y):
    """X Υ Xᵀ: Υ of a frame that has the placement X in the one of this Υ."""
    return inertia_to_parent(inverse_placement(X), Y)


@kernel
def moved_by(Y, F):
    """Υ F: the twist that a wrench gives to a body, per unit of time."""
    return Motion(
        add(apply_transposed(Y.B, F.moment), apply(Y.C, F.force)),
        add(apply(Y.A, F.moment), apply(Y.B, F.force)),
    )


@kernel
def mobility_of(w):
    """Υ of a body, behind :func:`mobilities_outward`."""
    return inertia_of(w.P)


# --- The outward sweep --------------------------------------------------------------------------------------


@kernel
def _let_joint_move(body, w, Y):
    """Υ of a body from Υ⁺: only the row and the column of S change."""
    G = force_of(w.G)
    g = moved_by(Y, G)
    c = power(G, g) + 1.0 / w.D
    A, B, C = Y.A, Y.B, Y.C
    v, w_ = g.linear, g.angular
    if body.direction == ANGULAR_Z:
        last = (A[2][0] - w_[0], A[2][1] - w_[1], A[2][2] - w_[2] + (c - w_[2]))
        A = ((A[0][0], A[0][1], last[0]), (A[1][0], A[1][1], last[1]), last)
        return Inertia(A, (B[0], B[1], subtract(B[2], v)), C)
    last = (C[2][0] - v[0], C[2][1] - v[1], C[2][2] - v[2] + (c - v[2]))
    C = ((C[0][0], C[0][1], last[0]), (C[1][0], C[1][1], last[1]), last)
    B = (
        (B[0][0], B[0][1], B[0][2] - w_[0]),
        (B[1][0], B[1][1], B[1][2] - w_[1]),
        (B[2][0], B[2][1], B[2][2] - w_[2]),
    )
    return Inertia(A, B, C)


@large_kernel
def _left_on_carrier(bodies, i, work, Q, F, kappa):
    """Wrench that one on body i of a group leaves on the carrier; its κ along the group's degrees of freedom."""
    first, last, j = bodies[i].first, bodies[i].last, i
    for b in range(first, last + 1):
        kappa[bodies[b].dof] = 0.0
    while j >= first:
        kappa[bodies[j].dof] += bodies[j].multiplier * along(bodies[j].direction, F)
        F = force_inboard(bodies[j], work[j], F)
        j = bodies[j].parent
    return subtract_force(F, filter_moments(bodies, first, last, work, Q, kappa))


@large_kernel
def _group_mobility(robot, i):
    """Υ of a body of a group."""
    bodies, _, work, table = opened(robot)
    Q, kappa = table[0], columns_of(robot).scratch
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    left = (
        _left_on_carrier(bodies, i, work, Q, Force(ZERO, x), kappa[0]),
        _left_on_carrier(bodies, i, work, Q, Force(ZERO, y), kappa[1]),
        _left_on_carrier(bodies, i, work, Q, Force(ZERO, z), kappa[2]),
        _left_on_carrier(bodies, i, work, Q, Force(x, ZERO), kappa[3]),
        _left_on_carrier(bodies, i, work, Q, Force(y, ZERO), kappa[4]),
        _left_on_carrier(bodies, i, work, Q, Force(z, ZERO), kappa[5]),
    )
    carrier = inertia_of(work[bodies[bodies[i].first].parent].P)
    for a in range(6):
        V = moved_by(carrier, left[a])
        for b in range(a, 6):
            entry = power(left[b], V)
            for j in range(bodies[i].first, bodies[i].last + 1):
                if owns(bodies, j):
                    entry += kappa[a, bodies[j].dof] * kappa[b, bodies[j].dof] / work[j].D
            work[i].P[PLACES[a, b]] = entry


@large_kernel
def mobilities_outward(robot):
    """Υ of every body that carries links, in its field P; the bodies are factorized."""
    bodies, _, work, _ = opened(robot)
    set_inertia(work[0].P, NO_INERTIA)
    for i in range(1, len(bodies)):
        body, w = bodies[i], work[i]
        if not is_grouped(body):
            Y = to_child(placement_of(w), inertia_of(work[body.parent].P))
            set_inertia(w.P, _let_joint_move(body, w, Y))
        elif body.rank == body.dofs - 1:
            _group_mobility(robot, i)


@kernel
def _write(Y, mobility):
    """Υ as 6x6 numbers, its linear part first; whether all of them are finite."""
    together = 0.0
    for row in range(6):
        for column in range(row, 6):
            entry = Y[PLACES[row, column]]
            a, b = (row + 3) % 6, (column + 3) % 6
            mobility[a, b] = mobility[b, a] = entry
            together += entry
    return math.isfinite(together)


@entry_kernel(ROBOT, VECTOR, FRAMES, FILLED_STATES)
def mobilities(robot, q, frames, results):
    """Υ = J M⁻¹Jᵀ of frames that are fixed to bodies, in their axes, linear part first, shape (frames, 6, 6)."""
    if not fit_positions(robot, q):
        return MISFIT
    bodies, _, work, table = opened(robot)
    status = place_and_factorize(bodies, q, work, table[0])
    if status != 0:
        return status
    mobilities_outward(robot)
    for k in range(len(frames)):
        frame = frames[k]
        Y = work[frame.body].P
        if frame.same == 0 and frame.body > 0:
            X = Placement(matrix_of(frame.rotation), vector_of(frame.translation))
            set_inertia(work[0].P_rate, to_child(X, inertia_of(Y)))
            Y = work[0].P_rate
        if not _write(Y, results[k]):
            return -1
    return 0
