# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The factors of the mass matrix, filled row by row in one inward sweep over columns that are next to each other.

Columns are kept in blocks of WIDTH, records.COLUMNS: the loop over a block is made vector instructions by the compiler,
as batch describes.
"""

import math

from diag_dynamics.numerics.kernel import (
    FILLED_STATES,
    FILLED_VECTOR,
    ROBOT,
    VECTOR,
    entry_kernel,
    kernel,
    large_kernel,
)
from diag_dynamics.sweeps import groups, joints, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws
from diag_dynamics.sweeps.factorization import factor_group, factor_joint
from diag_dynamics.sweeps.records import WIDTH


@entry_kernel(ROBOT, VECTOR, FILLED_STATES, FILLED_VECTOR)
def factors(robot, q, m_l_unit, D):
    """Fill m = [I + HφK]D^½, ℓ = D^−½[I − HψK] and [I + HφK], the unit factor, and D (Identity 4.1).

    A unit working moment at joint j leaves G of j behind; rigid transport of it up the tree gives column j of the unit
    factor, transport through the articulated joints that of its inverse. One inward sweep transports all columns and fills
    row by row.
    """
    if not ws.positions_match(robot, q):
        return ws.BAD_LENGTH
    bodies, _, work, table = ws.opened(robot)
    if not joints.are_positions(bodies, q):
        return -1
    joints.initialize(bodies, q, work)
    columns = ws.robot_of(robot)
    for factor in range(3):
        for row in range(len(D)):
            ws.clear(m_l_unit[factor, row])
    i = len(bodies) - 1
    while i > 0:
        body = bodies[i]
        if groups.is_grouped(body):
            status = factor_group(bodies, i, work, table[0], False)
            if status != 0:
                return status
            _fill_rows_of_group(bodies, i, work, table[0], columns, m_l_unit, D)
        elif not factor_joint(body, work[i], work[body.parent], False):
            return i
        elif body.direction == sp.ANGULAR_Z:
            _fill_row(sp.ANGULAR_Z, body, work[i], columns.subtree_columns[i, 1], columns.blocks, m_l_unit, D)
        else:
            _fill_row(sp.LINEAR_Z, body, work[i], columns.subtree_columns[i, 1], columns.blocks, m_l_unit, D)
        i = body.first - 1
    return 0


@kernel
def _chosen(chosen, F, H):
    """F if it is chosen, else H, without a branch."""
    f, h, m, n = F.force, H.force, F.moment, H.moment
    return sp.Force(
        (f[0] if chosen else h[0], f[1] if chosen else h[1], f[2] if chosen else h[2]),
        (m[0] if chosen else n[0], m[1] if chosen else n[1], m[2] if chosen else n[2]),
    )


@kernel
def _fill_row(direction, body, w, end, blocks, m_l_unit, D):
    """The row of a body that is in no group; the forces of the columns before `end` go to its parent."""
    X, G, row, root = records.placement_of(w), records.force_of(w.G), body.dof, math.sqrt(w.D)
    inverse_root, minus_G = 1.0 / root, sp.scale_force(G, -1.0)
    for k in range((row + 1) // WIDTH, (end + WIDTH - 1) // WIDTH if end > row + 1 else 0):
        block, start = blocks[k], k * WIDTH
        for b in range(WIDTH):
            rigid, articulated = records.force_of(block.rigid[:, b]), records.force_of(block.articulated[:, b])
            kappa = sp.along(direction, articulated)
            block.moment[b] = sp.along(direction, rigid)
            block.kappa[b] = kappa
            carried = (row < start + b) & (start + b < end)
            passed = sp.add_force(articulated, sp.scale_force(minus_G, kappa))
            records.set_force(block.rigid[:, b], _chosen(carried, sp.force_to_parent(X, rigid), rigid))
            records.set_force(block.articulated[:, b], _chosen(carried, sp.force_to_parent(X, passed), articulated))
        for c in range(max(row + 1, start), min(end, start + WIDTH)):
            b = c - start
            moment, kappa = block.moment[b], block.kappa[b]
            _set_entries(m_l_unit, row, c, moment, kappa, block.root[b], inverse_root)
    D[row] = w.D
    m_l_unit[0, row, row], m_l_unit[1, row, row], m_l_unit[2, row, row] = root, inverse_root, 1.0
    block, b = blocks[row // WIDTH], row % WIDTH
    block.root[b] = root
    records.set_force(block.rigid[:, b], sp.force_to_parent(X, G))
    records.set_force(block.articulated[:, b], sp.force_to_parent(X, minus_G))


@kernel
def _set_entries(m_l_unit, row, c, moment, kappa, root, inverse_root):
    """Write an entry of each factor."""
    m_l_unit[0, row, c], m_l_unit[1, row, c], m_l_unit[2, row, c] = moment * root, kappa * inverse_root, moment


@large_kernel
def _fill_rows_of_group(bodies, last, work, Q, columns, m_l_unit, D):
    """The rows of a group; the forces of its columns, and of those it carries, go to its base.

    groups.filter_moments does the same with one column. A group's own columns begin as those of the identity, without force.
    """
    first, start = bodies[last].first, bodies[last].start
    stop, end = _start_columns(bodies, first, last, work, Q, columns)
    for i in range(last, first - 1, -1):
        for c in range(columns.subtree_columns[i, 0], columns.subtree_columns[i, 1]):
            block, b = columns.blocks[c // WIDTH], c % WIDTH
            _add_moment(bodies[i], work[i], block.rigid[:, b], columns.moments[c])
            _add_moment(bodies[i], work[i], block.articulated[:, b], columns.kappas[c])
    for i in range(last, first - 1, -1):
        if not groups.is_leader(bodies, i):
            continue
        row, G, D[bodies[i].dof] = bodies[i].dof, records.force_of(work[i].G), work[i].D
        inverse_root = 1.0 / math.sqrt(work[i].D)
        for c in range(start, end):
            block, b, moments, kappas = columns.blocks[c // WIDTH], c % WIDTH, columns.moments[c], columns.kappas[c]
            kappa = kappas[row - start]
            for k in range(stop - 1, row, -1):
                kappa = kappa - Q[row, k - start] * kappas[k - start]
            kappas[row - start] = kappa
            _set_entries(m_l_unit, row, c, moments[row - start], kappa, block.root[b], inverse_root)
            if bodies[first].parent > 0:
                F = sp.subtract_force(records.force_of(block.articulated[:, b]), sp.scale_force(G, kappa))
                records.set_force(block.articulated[:, b], F)


@kernel
def _start_columns(bodies, first, last, work, Q, columns):
    """Start a group's own columns, and zero the moments of those it carries; returns the end of each."""
    start = stop = end = bodies[first].start
    for i in range(first, last + 1):
        end = max(end, columns.subtree_columns[i, 1])
        if groups.is_leader(bodies, i):
            stop = bodies[i].dof + 1
    end = max(end, stop)
    for c in range(start, end):
        ws.clear(columns.moments[c])
        ws.clear(columns.kappas[c])
    for i in range(first, last + 1):
        if groups.is_leader(bodies, i):
            c = bodies[i].dof
            block, b = columns.blocks[c // WIDTH], c % WIDTH
            block.root[b] = math.sqrt(work[i].D)
            for k in range(start, c):
                columns.moments[c, k - start] = Q[k, c - start]
            columns.moments[c, c - start] = columns.kappas[c, c - start] = 1.0
            records.set_force(block.rigid[:, b], records.force_of(work[i].G))
            records.set_force(block.articulated[:, b], sp.NO_FORCE)
    return stop, end


@kernel
def _add_moment(body, w, forces, moments):
    """Add the moment of a column's force on a body of a group along its degree of freedom; the force goes to its parent."""
    F = records.force_of(forces)
    moments[body.dof - body.start] += body.multiplier * sp.along(body.direction, F)
    if body.rank == 0 and body.parent > 0:
        records.set_force(forces, sp.force_to_parent(records.placement_of(w), F))
