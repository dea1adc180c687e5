# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The factors of the mass matrix, column by column."""

import math

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.numerics.tables import flat
from diag_dynamics.sweeps import groups, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws
from diag_dynamics.sweeps.factorization import factorize_at


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.FILLED_STATES, nk.FILLED_VECTOR)
def factors(robot, q, m_l_unit, D):
    """Fill m = [I + HφK]D^½, ℓ = D^−½[I − HψK] and [I + HφK], the unit factor, and D (Identity 4.1).

    A unit working moment at joint j exerts the wrench G on the bodies inboard. Its moments along rigid joints are column j
    of the unit factor. The working moments of −G along articulated joints are column j of the inverse.
    """
    if not ws.positions_match(robot, q):
        return ws.BAD_LENGTH
    bodies, _, work, table = ws.opened(robot)
    status = factorize_at(bodies, q, work, table[0])
    if status != 0:
        return status
    m, inverse, unit = m_l_unit[0], m_l_unit[1], m_l_unit[2]
    ws.clear(flat(m_l_unit))
    for i in range(1, len(bodies)):
        if groups.is_leader(bodies, i):
            j = bodies[i].dof
            D[j] = work[i].D
            _fill_column(bodies, i, work, table[0], unit[:, j], inverse[:, j])
            root = math.sqrt(D[j])
            for row in range(j + 1):
                m[row, j] = unit[row, j] * root
    for row in range(len(D)):
        inverse_root = 1.0 / math.sqrt(D[row])
        for j in range(row, len(D)):
            inverse[row, j] *= inverse_root
    return 0


@nk.large_kernel
def _fill_column(bodies, i, work, Q, rigid, articulated):
    """Columns of [I + HφK] and [I − HψK] of the degree of freedom that body i owns."""
    body, w = bodies[i], work[i]
    rigid[body.dof] = articulated[body.dof] = 1.0
    base = bodies[body.first].parent
    if groups.is_grouped(body):
        groups.unfilter_moments(bodies, body.first, i, work, Q, rigid)
        F = groups.filter_moments(bodies, body.first, i, work, Q, articulated)
        H = records.force_of(w.G)
    else:
        F = H = sp.force_to_parent(records.placement_of(w), records.force_of(w.G))
    groups.moments_of_wrench(bodies, base, 1, work, H, rigid)
    groups.working_moments_of_wrench(bodies, base, work, Q, sp.scale_force(F, -1.0), articulated)
