# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact quantities of points: speed, reflected mass and energy along a direction.

They follow from Υ of the bodies of the points. Of a point r of a body and a unit direction u, h =
(u, r × u) is the unit force there as a wrench, and

    v_u = uᵀ(v + ω × r)        1/m_u = hᵀΥh = |ℓJᵀu|²        ½ m_u v_u² = ½(ŵᵀν)²
    ŵ = ℓJᵀu/|ℓJᵀu|.

Against a mass m_H that waits behind a spring k the force reaches v_u √(μk), 1/μ = 1/m_u + 1/m_H.
"""

import math

import numpy as np

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.numerics.tables import Table, array
from diag_dynamics.sweeps import joints, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws
from diag_dynamics.sweeps.factorization import convert_rates, factorize_at, scale_by_inertia
from diag_dynamics.sweeps.mobilities import mobilities_outward, mobility_times

BY_ENERGY, BY_FORCE, BY_LIMIT = range(3)
"""Criterion of the worst point of an entry: transferable energy, force, or ratio of speed to
allowed speed."""

CONTACT_ENTRY = np.dtype(
    [
        ("body", "i8"),
        ("first", "i8"),  # points, from the first to before the end
        ("end", "i8"),
        ("first_region", "i8"),  # likewise
        ("end_region", "i8"),
    ],
    align=True,
)
"""Points of one body and the body regions that they may hit. The result is that of the worst
point."""

INVERSE_MASS, STIFFNESS, LARGEST_FORCE, LARGEST_ENERGY = range(4)
"""Columns of a body region: 1/m_H, 0 if it is clamped, k, and limits, inf where there is none."""

CONTACTS = Table(
    "Contacts",
    entries=array(CONTACT_ENTRY),
    points=array(float, 2),  # from the origin of the entry's body, in its axes
    regions=array(float, 2),
    base=int,  # body in whose axes results are
    by=int,  # BY_ENERGY, BY_FORCE or BY_LIMIT
)

_contacts_at = CONTACTS.opened

POINT, POSITION, DIRECTION, SPEED, MASS, TRANSFERABLE, FORCE, ALLOWED, REGION, CONTACT_COLUMNS = (
    *(0, 1, 4, 7, 8),
    *range(9, 14),
)
"""First columns of the result of an entry, and their number; REGION is that of the strictest limit,
-1 if there is none."""

AT_REST = 1e-12
"""A speed below this fraction of its terms, linear and angular, is rounding error."""

IMMOBILE = 1e-14
"""Ratio of 1/m_u to the mobility of a body below which it is rounding error."""

TIE = 1.0 + 1e-9
"""Ratio of scores above which a later point is worse: all points of a link on a single joint have
the same energy."""


@nk.kernel
def _strictest_limit(regions, first, end, inverse_mass, speed):
    """Maximum contact force, speed that keeps all limits, and region of the strictest limit."""
    force = 0.0
    allowed = math.inf
    strictest = -1
    for k in range(first, end):
        # 1/μ = 1/m_u + 1/m_H; 0 where neither the point nor the region yields.
        reduced = inverse_mass + regions[k, INVERSE_MASS]  # 1/μ
        stiffness = regions[k, STIFFNESS]
        if reduced > 0.0:
            force = max(force, speed * math.sqrt(stiffness / reduced))
        # Allowed speeds: v = F_max/√(μk) and ½ m_u v² = E_max.
        of_force = (
            regions[k, LARGEST_FORCE] * math.sqrt(reduced / stiffness)
            if stiffness > 0.0
            else math.inf
        )
        of_energy = math.sqrt(2.0 * regions[k, LARGEST_ENERGY] * inverse_mass)
        least = min(of_force, of_energy)
        if least < allowed:
            allowed = least
            strictest = k
    return force, allowed, strictest


@nk.large_kernel
def _contact(at, entry, w, X, result):
    """The worst point of an entry and its contact quantities.

    X is the placement of its body in the axes of results.
    """
    V = records.motion_of(w.V)
    Y = records.inertia_of(w.P)  # of mobilities_outward
    R = X.rotation
    scale_of_V = sp.dot(V.linear, V.linear)
    scale_of_w = sp.dot(V.angular, V.angular)
    # The result where no point moves: the first one, without a direction or a limit.
    best = -1
    strongest = -1.0
    ws.clear(result)
    result[POINT] = float(entry.first)
    result[REGION] = -1.0
    result[ALLOWED] = math.inf
    for k in range(entry.first, entry.end):
        r = (at.points[k, 0], at.points[k, 1], at.points[k, 2])
        # v + ω × r; a sum below the rounding error of its terms has no direction.
        v = sp.add(V.linear, sp.cross(V.angular, r))
        square = sp.dot(v, v)
        if not square > AT_REST * AT_REST * (scale_of_V + scale_of_w * sp.dot(r, r)):
            continue
        u = sp.scale(v, 1.0 / math.sqrt(square))
        speed = sp.dot(u, v)
        # 1/m_u = hᵀΥh with the unit force at r as a wrench about the body's origin.
        h = sp.Force(u, sp.cross(r, u))
        inverse_mass = sp.power(h, mobility_times(Y, h))
        # Size of Υ at r. Υ has its angular part first: C is its linear block, A its angular one.
        most = (
            Y.C[0][0] + Y.C[1][1] + Y.C[2][2] + sp.dot(r, r) * (Y.A[0][0] + Y.A[1][1] + Y.A[2][2])
        )
        if not inverse_mass > IMMOBILE * most:  # the point cannot move that way
            inverse_mass = 0.0
            speed = 0.0
        # ½ m_u v_u², then the score of the criterion; without a region it is the energy.
        energy = 0.5 * speed * speed / inverse_mass if speed > 0.0 else 0.0
        force, allowed, strictest = _strictest_limit(
            at.regions, entry.first_region, entry.end_region, inverse_mass, speed
        )
        score = energy
        if at.by == BY_FORCE and entry.end_region > entry.first_region:
            score = force
        elif at.by == BY_LIMIT and strictest >= 0:
            score = speed / allowed if speed > 0.0 else 0.0
        # Scores that are equal up to rounding keep the earlier point.
        if best < 0 or score > strongest * TIE:
            best = k
            strongest = score
            result[POINT] = float(k)
            result[REGION] = float(strictest)
            records.set_vector(result, DIRECTION, u)
            result[SPEED] = speed
            result[MASS] = 1.0 / inverse_mass if inverse_mass > 0.0 else math.inf
            result[TRANSFERABLE] = energy
            result[FORCE] = force
            result[ALLOWED] = allowed
    # Point and direction, until here in axes of the body.
    k = int(result[POINT])
    r = (at.points[k, 0], at.points[k, 1], at.points[k, 2])
    records.set_vector(result, POSITION, sp.add(X.translation, sp.apply(R, r)))
    u = (result[DIRECTION], result[DIRECTION + 1], result[DIRECTION + 2])
    records.set_vector(result, DIRECTION, sp.apply(R, u))


@nk.entry_kernel(nk.ROBOT, nk.COUNT, nk.VECTOR, nk.VECTOR, nk.FILLED_VECTOR, nk.FILLED_MATRIX)
def contacts(robot, points, q, qd, nu, results):
    """ν, and a row of `results` for each entry of the table :data:`CONTACTS` at `points`.

    `points` is an address.
    """
    if not ws.lengths_match(robot, q, qd, nu):
        return ws.BAD_LENGTH
    bodies, _, work, table = ws.opened(robot)
    at = _contacts_at(points)
    if not joints.are_finite(qd):
        return -1
    status = factorize_at(robot, q)
    if status != 0:
        return status
    # ν = D^½ξ (Table 1); the conversion leaves V of every body.
    convert_rates(bodies, work, table[0], True, qd, nu)
    scale_by_inertia(bodies, work, 0.5, nu)
    # From the base to the tips: Υ of every body, in the place of its P.
    mobilities_outward(robot)
    for k in range(len(at.entries)):
        entry = at.entries[k]
        _contact(
            at, entry, work[entry.body], joints.pose(bodies, entry.body, at.base, work), results[k]
        )
        if not math.isfinite(results[k, SPEED] + results[k, TRANSFERABLE]):
            return -1
    return 0 if joints.are_finite(nu) else -1


@nk.entry_kernel(
    nk.ROBOT,
    nk.COUNT,
    nk.MATRIX,
    nk.MATRIX,
    nk.COUNT,
    nk.COUNT,
    nk.FILLED_MATRIX,
    nk.FILLED_STATES,
    nogil=True,
)
def contacts_each(robot, points, Q, QD, begin, end, nu, results):
    """Run :func:`contacts` at states `begin` to `end`.

    Each has a row of Q, QD and ν, and a matrix of `results`.
    """
    for t in range(begin, end):
        if contacts(robot, points, Q[t], QD[t], nu[t], results[t]) != 0:
            return t
    return end
