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
from numba import types
from numba.extending import overload

from diag_dynamics.compiled.kernel import FILLED_STATES, INLINED, ROBOT, VECTOR, entry_kernel, kernel, large_kernel
from diag_dynamics.compiled.lanes import WIDTH
from diag_dynamics.sweeps.bodies import force_of, inertia_of, matrix_of, placement_of, set_inertia, vector_of
from diag_dynamics.sweeps.factorization import place_and_factorize
from diag_dynamics.sweeps.groups import filter_moments, is_grouped, owns
from diag_dynamics.sweeps.joints import force_inboard
from diag_dynamics.sweeps.spatial import (
    ANGULAR_Z,
    NOTHING,
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
    subtract_force,
    transpose,
)
from diag_dynamics.sweeps.workspace import MISFIT, fit_positions, opened, opened_columns

if WIDTH > 1:
    from diag_dynamics.sweeps.stacks import stack_to_parent

FRAME = np.dtype(
    [("body", "i8"), ("same", "i8"), ("rotation", "f8", 9), ("translation", "f8", 3)],
    align=True,
)
"""A frame that is fixed to a body: its axes and origin in those of the body, and whether they are the body's own."""

FRAMES = numba.from_dtype(FRAME)[::1]

# --- Between one frame and the next -------------------------------------------------------------------------


@kernel
def inverse_placement(X):
    """Placement of the parent in the child."""
    return Placement(transpose(X.rotation), scale(apply_transposed(X.rotation, X.translation), -1.0))


@kernel
def _to_child(source, target, X):
    set_inertia(target, inertia_to_parent(inverse_placement(X), inertia_of(source)))


if WIDTH > 1:

    @kernel
    def _stack_to_child(source, target, X):
        stack_to_parent(source, target, inverse_placement(X))


def to_child(source, target, X):
    """X Υ Xᵀ from the field P of a body to that of one that has the placement X in it."""


@overload(to_child, jit_options=INLINED)
def _(source, target, X):
    form = _stack_to_child if WIDTH > 1 and isinstance(source.dtype, types.Float) else _to_child
    return lambda source, target, X: form(source, target, X)


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
def _at(row, column):
    """Where an entry of the blocks of P is in its field."""
    return 24 * row + 8 * column


@kernel
def _let_joint_move(body, w):
    """Υ of a body from Υ⁺, which its field has: only the row and the column of S change."""
    G = force_of(w.G)
    g = moved_by(inertia_of(w.P), G)
    c, Y = power(G, g) + 1.0 / w.D, w.P
    if body.direction == ANGULAR_Z:
        for k in range(3):
            Y[_at(2, k)] -= g.angular[k]
            Y[_at(2, k) + 1] -= g.linear[k]
        Y[_at(2, 2)] += c - g.angular[2]
        Y[_at(0, 2)], Y[_at(1, 2)] = Y[_at(2, 0)], Y[_at(2, 1)]
    else:
        for k in range(3):
            Y[_at(2, k) + 2] -= g.linear[k]
            Y[_at(k, 2) + 1] -= g.angular[k]
        Y[_at(2, 2) + 2] += c - g.linear[2]
        Y[_at(0, 2) + 2], Y[_at(1, 2) + 2] = Y[_at(2, 0) + 2], Y[_at(2, 1) + 2]


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
    Q, kappa = table[0], opened_columns(robot).rigid
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    left = (
        _left_on_carrier(bodies, i, work, Q, Force(ZERO, x), kappa[0]),
        _left_on_carrier(bodies, i, work, Q, Force(ZERO, y), kappa[1]),
        _left_on_carrier(bodies, i, work, Q, Force(ZERO, z), kappa[2]),
        _left_on_carrier(bodies, i, work, Q, Force(x, ZERO), kappa[3]),
        _left_on_carrier(bodies, i, work, Q, Force(y, ZERO), kappa[4]),
        _left_on_carrier(bodies, i, work, Q, Force(z, ZERO), kappa[5]),
    )
    first, last, Y = bodies[i].first, bodies[i].last, work[i].P
    carrier = inertia_of(work[bodies[first].parent].P)
    for a in range(6):
        V = moved_by(carrier, left[a])
        for b in range(a, 6):
            entry = power(left[b], V)
            for j in range(first, last + 1):
                if owns(bodies, j):
                    entry += kappa[a, bodies[j].dof] * kappa[b, bodies[j].dof] / work[j].D
            if b < 3:
                Y[_at(a, b)] = Y[_at(b, a)] = entry
            elif a < 3:
                Y[_at(a, b - 3) + 1] = entry
            else:
                Y[_at(a - 3, b - 3) + 2] = Y[_at(b - 3, a - 3) + 2] = entry


@large_kernel
def mobilities_outward(robot):
    """Υ of every body that carries links, in its field P; the bodies are factorized."""
    bodies, _, work, _ = opened(robot)
    set_inertia(work[0].P, Inertia(NOTHING, NOTHING, NOTHING))
    for i in range(1, len(bodies)):
        body, w = bodies[i], work[i]
        if not is_grouped(body):
            to_child(work[body.parent].P, w.P, placement_of(w))
            _let_joint_move(body, w)
        elif body.rank == body.dofs - 1:
            _group_mobility(robot, i)


@kernel
def _write(Y, mobility):
    """Υ as 6x6 numbers, its linear part first; whether all of them are finite."""
    together = 0.0
    for row in range(3):
        for column in range(3):
            k = _at(row, column)
            mobility[3 + row, 3 + column] = Y[k]
            mobility[3 + row, column] = Y[k + 1]
            mobility[column, 3 + row] = Y[k + 1]
            mobility[row, column] = Y[k + 2]
            together += Y[k] + Y[k + 1] + Y[k + 2]
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
            to_child(Y, work[0].P_rate, Placement(matrix_of(frame.rotation), vector_of(frame.translation)))
            Y = work[0].P_rate
        if not _write(Y, results[k]):
            return -1
    return 0
