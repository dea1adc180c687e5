# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Positions of joints that follow others, and their rates by those of independent joints."""

from numba import types

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.numerics.callback import Callback
from diag_dynamics.numerics.tables import array_at
from diag_dynamics.sweeps import joints
from diag_dynamics.sweeps import workspace as ws

_vector_at, _matrix_at = array_at(types.float64, 1), array_at(types.float64, 2)


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.VECTOR, nk.FILLED_MATRIX)
def ratios(robot, q, qd, result):
    """Position, G and Ġ of the joint whose first body is that of the row.

    The joint has one degree of freedom, or is a follower. `result` has the shape (bodies, 1 + 2
    nv).
    """
    if not ws.lengths_match(robot, q, qd, qd):
        return ws.BAD_LENGTH
    bodies, _, work, _ = ws.opened(robot)
    status = joints.start_motion(bodies, q, qd, work)
    _fill(bodies, work, q, len(qd), result)
    return status


@Callback
def positions(robot, q, result, _):
    """Run :func:`ratios` at the addresses of q and the result, without Ġ, for joint states."""
    at = ws.robot_of(robot)
    place = _vector_at(q, (at.nq,))
    status = joints.couple(place, at.work)
    # Columns of Ġ are those of the last call with rates.
    _fill(at.bodies, at.work, place, at.nv, _matrix_at(result, (len(at.bodies), 1 + 2 * at.nv)))
    return status


@nk.large_kernel
def _fill(bodies, work, q, nv, result):
    for i in range(1, len(bodies)):
        ws.clear(result[i])
        # The multiplier of the record is 0 where the ratio changes: the offset is the position.
        result[i, 0] = bodies[i].multiplier * q[bodies[i].q] + work[i].offset
        # Rows of later bodies of a joint run beyond the joint, and have no meaning.
        for j in range(i, min(i + bodies[i].dofs, len(bodies))):
            result[i, 1 + bodies[j].dof] += work[j].multiplier
            result[i, 1 + nv + bodies[j].dof] += work[j].multiplier_rate
