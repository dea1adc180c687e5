# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mobilities of bodies and links, Υ = J M⁻¹Jᵀ, by one outward sweep behind the factorization.

The mass matrix of ν is the unit matrix. Υ of a body is therefore Σ v_k v_kᵀ, with v_k its twist for
ν_k = 1. Own rates and the base's motion are independent there, ξ_i of D⁻¹, and with q̇ = ξ − GᵀV⁺
(Table 1, right)

    Υ⁺ = X Υ_p Xᵀ      Υ = τ̄ᵀΥ⁺τ̄ + S D⁻¹Sᵀ      τ̄ᵀ = 1 − S Gᵀ      Υ of the world = 0.

Υ of a body of a group is Σ κ_a D⁻¹κ_b over all degrees of freedom, with κ_a the working moments of
a unit wrench along a.

Υ is kept in the place of P, its angular part first: then it goes to a child as P of a child goes to
its parent, with the inverse placement.
"""

import numba
import numpy as np

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.numerics.tables import flat
from diag_dynamics.sweeps import groups, joints, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws
from diag_dynamics.sweeps.factorization import factorize_at

FRAME = np.dtype([("body", "i8"), ("rotation", "f8", 9), ("translation", "f8", 3)], align=True)
"""A frame fixed to a body, and its placement in the body."""

FRAMES = numba.from_dtype(FRAME)[::1]

PLACES = np.zeros((6, 6), np.int64)
"""Where the field P has an entry of the symmetric matrix, by row and column."""

PLACES[np.triu_indices(6)] = [
    0,
    1,
    2,
    6,
    7,
    8,
    3,
    4,
    9,
    10,
    11,
    5,
    12,
    13,
    14,
    15,
    16,
    17,
    18,
    19,
    20,
]

# --- Between one frame and the next ---------------------------------------------------------------


@nk.kernel
def mobility_to_child(X, Y):
    """X Υ Xᵀ: Υ of a frame that has the placement X in the one of this Υ."""
    R = X.rotation
    # (Rᵀ, −Rᵀp) takes Υ, angular part first, outward as X takes P inward
    inverse = sp.Placement(sp.transpose(R), sp.scale(sp.apply_transposed(R, X.translation), -1.0))
    return sp.inertia_to_parent(inverse, Y)


@nk.kernel
def mobility_times(Y, F):
    """Υ F: the twist that a wrench gives to a body, per unit of time."""
    # The angular part is first, so that the moment comes first too
    angular, linear = sp.inertia_times(Y, sp.Motion(F.moment, F.force))
    return sp.Motion(linear, angular)


# --- The outward sweep ----------------------------------------------------------------------------


@nk.kernel
def _add_joint(body, w, Y):
    """Υ of a body from Υ⁺: Υ⁺ − S gᵀ − g Sᵀ + S (GᵀΥ⁺G + D⁻¹) Sᵀ with g = Υ⁺G."""
    G = records.force_of(w.G)
    S = sp.motion_along(body.direction, 1.0)
    g = mobility_times(Y, G)
    # Half of the last part, because S hᵀ + h Sᵀ has it twice
    half = sp.motion_along(body.direction, 0.5 * (sp.power(G, g) + 1.0 / w.D))
    h = sp.subtract_motion(g, half)
    return sp.less_rank_two(Y, sp.Force(S.angular, S.linear), sp.Force(h.angular, h.linear))


@nk.large_kernel
def _group_mobility(robot, i):
    """Υ = Σ κ D⁻¹κᵀ of a body of a group, with the moments κ of six unit wrenches on the body.

    κ are working moments.
    """
    bodies, _, work, table = ws.opened(robot)
    kappa = ws.robot_of(robot).scratch
    # κ of unit moments (a below 3), then of unit forces: the angular part of Υ is first
    for a in range(6):
        ws.clear(kappa[a])
        e = sp.motion_along((a + 3) % 6, 1.0)
        groups.working_moments_of_wrench(
            bodies, i, work, table[0], sp.Force(e.linear, e.angular), kappa[a]
        )
    for a in range(6):
        for b in range(a, 6):
            entry = 0.0
            for j in range(1, bodies[i].last + 1):
                # κ is zero at joints that do not carry body i, and no joint after its group does
                if groups.is_leader(bodies, j):
                    entry += kappa[a, bodies[j].dof] * kappa[b, bodies[j].dof] / work[j].D
            work[i].P[PLACES[a, b]] = entry


@nk.large_kernel
def mobilities_outward(robot):
    """Υ of every body that carries links, in its field P; the bodies are factorized."""
    bodies, _, work, _ = ws.opened(robot)
    # From the base to the tips; factorized bodies have no further use for P
    records.set_inertia(work[0].P, sp.NO_INERTIA)
    for i in range(1, len(bodies)):
        body = bodies[i]
        w = work[i]
        if not groups.is_grouped(body):
            # Υ⁺ = X Υ_p Xᵀ, then the joint
            Y = mobility_to_child(records.placement_of(w), records.inertia_of(work[body.parent].P))
            records.set_inertia(w.P, _add_joint(body, w, Y))
        elif body.rank == body.dofs - 1:
            # Only the last body of a joint carries links and further joints
            _group_mobility(robot, i)


@nk.kernel
def _write(Y, mobility):
    """Write Υ as 6x6 numbers, its linear part first."""
    for a in range(3):
        for b in range(3):
            # A is the angular block, B has angular rows and linear columns, C is the linear block
            mobility[a, b] = Y.C[a][b]
            mobility[3 + a, 3 + b] = Y.A[a][b]
            mobility[3 + a, b] = mobility[b, 3 + a] = Y.B[a][b]


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, FRAMES, nk.FILLED_STATES)
def mobilities(robot, q, frames, results):
    """Υ = J M⁻¹Jᵀ of frames fixed to bodies, in their axes, linear part first.

    The shape is (frames, 6, 6).
    """
    if not ws.positions_match(robot, q):
        return ws.BAD_LENGTH
    status = factorize_at(robot, q)
    if status != 0:
        return status
    mobilities_outward(robot)
    work = ws.robot_of(robot).work
    for k in range(len(frames)):
        Y = records.inertia_of(work[frames[k].body].P)
        _write(mobility_to_child(records.placement_of(frames[k]), Y), results[k])
    return 0 if joints.are_finite(flat(results)) else -1
