# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Steps of sweeps at groups, compiled for robots that have groups alone: sweeps call them by address."""

from numba import types

from diag_dynamics.numerics.callback import Callback
from diag_dynamics.numerics.tables import array_at
from diag_dynamics.sweeps import classical, evaluation, factorization
from diag_dynamics.sweeps import workspace as ws

_vector_at, _matrix_at = array_at(types.float64, 1), array_at(types.float64, 2)


@Callback
def step(robot, which, i, x, y, out, columns):
    """Run a step at body i of a group; returns a status.

    The others are addresses: for ws.INWARD q̇, τ and `out` of evaluation.inward_group, a matrix of
    as many columns, for ws.ABA_INWARD and ws.ABA_OUTWARD q̇ and q̈.
    """
    at = ws.robot_of(robot)
    if which == ws.FACTORIZE:
        return factorization.factorize_group(robot, i)
    qd, vector = _vector_at(x, (at.nv,)), _vector_at(y, (at.nv,))
    if which == ws.INWARD:
        return evaluation.inward_group(robot, i, qd, vector, _matrix_at(out, (ws.N_ROWS, columns)))
    if which == ws.ABA_INWARD:
        return classical.aba_inward_group(robot, i, qd, vector)
    classical.aba_outward_group(robot, i, qd, vector)
    return 0
