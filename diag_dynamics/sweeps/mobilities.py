# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mobilities of bodies and links, Υ = J M⁻¹Jᵀ, by one outward sweep behind the factorization.

ν has the unit matrix for its mass matrix, so that Υ of a body is the sum of what each ν_k moves it by, times its transpose.
Own rates and the base's motion are independent there, ξ_i of D⁻¹, and with q̇ = ξ − GᵀV⁺ (Table 1, right)

    Υ⁺ = X Υ_p Xᵀ      Υ = τ̄ᵀΥ⁺τ̄ + S D⁻¹Sᵀ      τ̄ᵀ = 1 − S Gᵀ      Υ of the world = 0.

A body of a group moves by what its base does and by the group's own ξ: Υ_ab = F_aᵀΥ_A F_b + Σ κ_a D⁻¹κ_b, with κ the
working moments of a unit wrench along a, and F what is left of it on the base.

Υ is kept in the place of P, its angular part first: then it goes to a child as P of a child goes to its parent, with the
inverse placement.
"""

import math

import numba
import numpy as np

from diag_dynamics.numerics.kernel import FILLED_STATES, ROBOT, VECTOR, entry_kernel, kernel, large_kernel
from diag_dynamics.sweeps import groups, joints, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps.factorization import factorize_at
from diag_dynamics.sweeps.workspace import BAD_LENGTH, opened, positions_match, robot_of

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
    return sp.Placement(sp.transpose(X.rotation), sp.scale(sp.apply_transposed(X.rotation, X.translation), -1.0))


@kernel
def mobility_to_child(X, Y):
    """X Υ Xᵀ: Υ of a frame that has the placement X in the one of this Υ."""
    return sp.inertia_to_parent(inverse_placement(X), Y)


@kernel
def mobility_times(Y, F):
    """Υ F: the twist that a wrench gives to a body, per unit of time."""
    return sp.Motion(
        sp.add(sp.apply_transposed(Y.B, F.moment), sp.apply(Y.C, F.force)),
        sp.add(sp.apply(Y.A, F.moment), sp.apply(Y.B, F.force)),
    )


@kernel
def mobility_of(w):
    """Υ of a body, behind :func:`mobilities_outward`."""
    return records.inertia_of(w.P)


# --- The outward sweep --------------------------------------------------------------------------------------


@kernel
def _add_joint(body, w, Y):
    """Υ of a body from Υ⁺: only the row and the column of S change."""
    G = records.force_of(w.G)
    g = mobility_times(Y, G)
    c = sp.power(G, g) + 1.0 / w.D
    A, B, C = Y.A, Y.B, Y.C
    v, w_ = g.linear, g.angular
    if body.direction == sp.ANGULAR_Z:
        last = (A[2][0] - w_[0], A[2][1] - w_[1], A[2][2] - w_[2] + (c - w_[2]))
        A = ((A[0][0], A[0][1], last[0]), (A[1][0], A[1][1], last[1]), last)
        return sp.Inertia(A, (B[0], B[1], sp.subtract(B[2], v)), C)
    last = (C[2][0] - v[0], C[2][1] - v[1], C[2][2] - v[2] + (c - v[2]))
    C = ((C[0][0], C[0][1], last[0]), (C[1][0], C[1][1], last[1]), last)
    B = (
        (B[0][0], B[0][1], B[0][2] - w_[0]),
        (B[1][0], B[1][1], B[1][2] - w_[1]),
        (B[2][0], B[2][1], B[2][2] - w_[2]),
    )
    return sp.Inertia(A, B, C)


@large_kernel
def _wrench_on_carrier(bodies, i, work, Q, F, kappa):
    """Wrench that one on body i of a group leaves on the base; its κ along the group's degrees of freedom."""
    first, last, j = bodies[i].first, bodies[i].last, i
    for b in range(first, last + 1):
        kappa[bodies[b].dof] = 0.0
    while j >= first:
        kappa[bodies[j].dof] += bodies[j].multiplier * sp.along(bodies[j].direction, F)
        F = joints.force_inboard(bodies[j], work[j], F)
        j = bodies[j].parent
    return sp.subtract_force(F, groups.filter_moments(bodies, first, last, work, Q, kappa))


@large_kernel
def _group_mobility(robot, i):
    """Υ of a body of a group."""
    bodies, _, work, table = opened(robot)
    Q, kappa = table[0], robot_of(robot).scratch
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    left = (
        _wrench_on_carrier(bodies, i, work, Q, sp.Force(sp.ZERO, x), kappa[0]),
        _wrench_on_carrier(bodies, i, work, Q, sp.Force(sp.ZERO, y), kappa[1]),
        _wrench_on_carrier(bodies, i, work, Q, sp.Force(sp.ZERO, z), kappa[2]),
        _wrench_on_carrier(bodies, i, work, Q, sp.Force(x, sp.ZERO), kappa[3]),
        _wrench_on_carrier(bodies, i, work, Q, sp.Force(y, sp.ZERO), kappa[4]),
        _wrench_on_carrier(bodies, i, work, Q, sp.Force(z, sp.ZERO), kappa[5]),
    )
    base = records.inertia_of(work[bodies[bodies[i].first].parent].P)
    for a in range(6):
        V = mobility_times(base, left[a])
        for b in range(a, 6):
            entry = sp.power(left[b], V)
            for j in range(bodies[i].first, bodies[i].last + 1):
                if groups.is_leader(bodies, j):
                    entry += kappa[a, bodies[j].dof] * kappa[b, bodies[j].dof] / work[j].D
            work[i].P[PLACES[a, b]] = entry


@large_kernel
def mobilities_outward(robot):
    """Υ of every body that carries links, in its field P; the bodies are factorized."""
    bodies, _, work, _ = opened(robot)
    records.set_inertia(work[0].P, sp.NO_INERTIA)
    for i in range(1, len(bodies)):
        body, w = bodies[i], work[i]
        if not groups.is_grouped(body):
            Y = mobility_to_child(records.placement_of(w), records.inertia_of(work[body.parent].P))
            records.set_inertia(w.P, _add_joint(body, w, Y))
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
    if not positions_match(robot, q):
        return BAD_LENGTH
    bodies, _, work, table = opened(robot)
    status = factorize_at(bodies, q, work, table[0])
    if status != 0:
        return status
    mobilities_outward(robot)
    for k in range(len(frames)):
        frame = frames[k]
        Y = work[frame.body].P
        if frame.same == 0 and frame.body > 0:
            X = sp.Placement(records.matrix_of(frame.rotation), records.vector_of(frame.translation))
            records.set_inertia(work[0].P_rate, mobility_to_child(X, records.inertia_of(Y)))
            Y = work[0].P_rate
        if not _write(Y, results[k]):
            return -1
    return 0
