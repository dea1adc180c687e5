# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The factors of the mass matrix, filled row by row in one inward sweep, eight columns side by side."""

import math

from diag_dynamics.compiled.arrays import flat
from diag_dynamics.compiled.kernel import (
    FILLED_STATES,
    FILLED_VECTOR,
    ROBOT,
    VECTOR,
    entry_kernel,
    kernel,
    large_kernel,
)
from diag_dynamics.compiled.lanes import EIGHT, WIDTH, from_lane, lanes_at, set_lanes, set_lanes_from, spreader
from diag_dynamics.sweeps.bodies import force_of, placement_of
from diag_dynamics.sweeps.factorization import take_out, take_out_group
from diag_dynamics.sweeps.groups import is_grouped, owns
from diag_dynamics.sweeps.joints import are_positions, start
from diag_dynamics.sweeps.spatial import Force, add_force, force_to_parent, scale_force, subtract_force
from diag_dynamics.sweeps.workspace import MISFIT, clear, fit_positions, opened, opened_columns

_eight = spreader(EIGHT)


@entry_kernel(ROBOT, VECTOR, FILLED_STATES, FILLED_VECTOR)
def factors(robot, q, m_l_unit, D):
    """Fill m = [I + HφK]D^½, ℓ = D^−½[I − HψK] and [I + HφK], the unit factor, and D (Identity 4.1).

    A unit working moment at joint j leaves G of j behind; rigid transport of it up the tree gives column j of the unit
    factor, transport through the articulated joints that of its inverse. One inward sweep transports all columns and fills
    row by row: those of what a body carries are next to each other, so that eight of them go side by side.
    """
    if not fit_positions(robot, q):
        return MISFIT
    bodies, _, work, table = opened(robot)
    if not are_positions(bodies, q):
        return -1
    start(bodies, q, work)
    columns = opened_columns(robot)
    clear(flat(m_l_unit))
    i = len(bodies) - 1
    while i > 0:
        body = bodies[i]
        if is_grouped(body):
            status = take_out_group(bodies, i, work, table[0], False)
            if status != 0:
                return status
            _fill_rows_of_group(robot, i, m_l_unit, D)
            i = body.first - 1
            continue
        if not take_out(body, work[i], work[body.parent], False):
            return i
        _fill_row(body, work[i], columns.spans[i, 1], columns, m_l_unit, D)
        i -= 1
    return 0


@kernel
def _fill_row(body, w, end, columns, m_l_unit, D):
    """The row of a body that is in no group; the forces of the columns before `end` go to its parent.

    Eight at a time from the last on: what is left over is filled up with columns that begin further inboard, of which there
    is nothing to keep yet, or with none at all.
    """
    X, G, row, root = placement_of(w), force_of(w.G), body.dof, math.sqrt(w.D)
    inverse_root = 1.0 / root
    D[row], columns.roots[row + WIDTH] = w.D, root
    own, own_articulated = _in_every_lane(G), _in_every_lane(scale_force(G, -1.0))
    for k in range(end, row, -WIDTH):
        after = row + 1 + WIDTH - k
        moment, kappa = lanes_at(columns.rigid[body.direction], k), lanes_at(columns.articulated[body.direction], k)
        _set_row(m_l_unit, row, k, after, moment, kappa, lanes_at(columns.roots, k), inverse_root)
        if body.parent > 0:
            F = _forces_from(after, _forces_at(columns.rigid, k), own)
            _set_forces(columns.rigid, k, force_to_parent(X, F))
            F = add_force(_forces_at(columns.articulated, k), scale_force(own_articulated, kappa))
            _set_forces(columns.articulated, k, force_to_parent(X, _forces_from(after, F, own_articulated)))
    m_l_unit[0, row, row], m_l_unit[1, row, row], m_l_unit[2, row, row] = root, inverse_root, 1.0


@large_kernel
def _fill_rows_of_group(robot, last, m_l_unit, D):
    """The rows of a group; the forces of its columns, and of those it carries, go to its carrier.

    groups.filter_moments does the same with one column. A group's own columns begin as those of the identity, without force.
    """
    bodies, _, work, table = opened(robot)
    columns, Q = opened_columns(robot), table[0]
    first, start = bodies[last].first, bodies[last].start
    stop, end = _start_columns(bodies, first, last, work, Q, columns)
    for i in range(last, first - 1, -1):
        _add_moments(bodies[i], work[i], columns.spans[i], columns, bodies[i].dof - start)
    for i in range(last, first - 1, -1):
        if not owns(bodies, i):
            continue
        b, G = bodies[i].dof, _in_every_lane(force_of(work[i].G))
        moments, kappas = columns.moments[b - start], columns.kappas[b - start]
        D[b], inverse_root = work[i].D, 1.0 / columns.roots[b + WIDTH]
        for k in range(end, start, -WIDTH):
            kappa = lanes_at(kappas, k)
            for c in range(stop - 1, b, -1):
                kappa = kappa - Q[b, c - start] * lanes_at(columns.kappas[c - start], k)
            set_lanes(kappas, k, kappa)
            moment, roots = lanes_at(moments, k), lanes_at(columns.roots, k)
            _set_row(m_l_unit, b, k, start + WIDTH - k, moment, kappa, roots, inverse_root)
            if bodies[first].parent > 0:
                F = subtract_force(_forces_at(columns.articulated, k), scale_force(G, kappa))
                _set_forces(columns.articulated, k, F)


@kernel
def _start_columns(bodies, first, last, work, Q, columns):
    """Start a group's own columns, and zero the moments of those it carries; returns the end of each."""
    start = stop = end = bodies[first].start
    for i in range(first, last + 1):
        end = max(end, columns.spans[i, 1])
    for k in range(end, start, -WIDTH):
        for b in range(len(columns.moments)):
            set_lanes(columns.moments[b], k, _eight(0.0))
            set_lanes(columns.kappas[b], k, _eight(0.0))
    for i in range(first, last + 1):
        if owns(bodies, i):
            c, k, stop = bodies[i].dof, bodies[i].dof + WIDTH, bodies[i].dof + 1
            columns.roots[k] = math.sqrt(work[i].D)
            for b in range(start, c):
                columns.moments[b - start, k] = Q[b, c - start]
            columns.moments[c - start, k] = columns.kappas[c - start, k] = 1.0
            if bodies[first].parent > 0:
                for row in range(6):
                    columns.rigid[row, k], columns.articulated[row, k] = work[i].G[row], 0.0
    return stop, end


@kernel
def _add_moments(body, w, span, columns, row):
    """Add the moments of forces on a body of a group along its degree of freedom; the forces go to its parent."""
    X = placement_of(w)
    for k in range(span[1], span[0], -WIDTH):
        begin = span[0] + WIDTH - k  # earlier columns are those of another body of the group
        _add_moment(body, X, columns.rigid, columns.moments[row], k, begin)
        _add_moment(body, X, columns.articulated, columns.kappas[row], k, begin)


@kernel
def _add_moment(body, X, forces, moments, k, begin):
    """The same of rigid or articulated joints, in as many columns as there are lanes."""
    moment, others = body.multiplier * lanes_at(forces[body.direction], k), lanes_at(moments, k)
    set_lanes(moments, k, from_lane(begin, others + moment, others))
    if body.rank == 0 and body.parent > 0:
        F = _forces_at(forces, k)
        _set_forces(forces, k, _forces_from(begin, force_to_parent(X, F), F))


@kernel
def _set_row(m_l_unit, row, k, begin, moment, kappa, roots, inverse_root):
    """Write the lanes from `begin` on, of the eight columns before k, to a row of every factor."""
    set_lanes_from(m_l_unit[0, row], k - WIDTH, moment * roots, begin)
    set_lanes_from(m_l_unit[1, row], k - WIDTH, kappa * inverse_root, begin)
    set_lanes_from(m_l_unit[2, row], k - WIDTH, moment, begin)


@kernel
def _forces_at(forces, k):
    """Forces of the eight columns before k."""
    return Force(
        (lanes_at(forces[0], k), lanes_at(forces[1], k), lanes_at(forces[2], k)),
        (lanes_at(forces[3], k), lanes_at(forces[4], k), lanes_at(forces[5], k)),
    )


@kernel
def _set_forces(forces, k, F):
    """Write forces of the eight columns before k."""
    for row in range(3):
        set_lanes(forces[row], k, F.force[row])
        set_lanes(forces[row + 3], k, F.moment[row])


@kernel
def _forces_from(lane, F, H):
    """F from a lane on, H before."""
    f, h, m, n = F.force, H.force, F.moment, H.moment
    return Force(
        (from_lane(lane, f[0], h[0]), from_lane(lane, f[1], h[1]), from_lane(lane, f[2], h[2])),
        (from_lane(lane, m[0], n[0]), from_lane(lane, m[1], n[1]), from_lane(lane, m[2], n[2])),
    )


@kernel
def _in_every_lane(F):
    """One force in every lane."""
    f, m = F.force, F.moment
    return Force((_eight(f[0]), _eight(f[1]), _eight(f[2])), (_eight(m[0]), _eight(m[1]), _eight(m[2])))
