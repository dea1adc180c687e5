# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Steps of sweeps at groups.

Sweeps call them by address, so that robots without groups compile none.
"""

import numpy as np
from numba import types

from diag_dynamics.numerics.callback import Callback
from diag_dynamics.numerics.tables import array_at
from diag_dynamics.sweeps import classical, evaluation, factorization
from diag_dynamics.sweeps import workspace as ws

_vector_at, _matrix_at = array_at(types.float64, 1), array_at(types.float64, 2)


@Callback
def inward(robot, i, qd, tau, out, columns):
    """Run evaluation.inward_coupled at the addresses of q̇, τ and `out`, a matrix of `columns`."""
    at = ws.robot_of(robot)
    # A callback takes integers: lengths follow from the robot, the columns of `out` do not.
    rates = _vector_at(qd, (at.nv,))
    efforts = _vector_at(tau, (at.nv,))
    results = _matrix_at(out, (ws.N_ROWS, columns))
    return evaluation.inward_coupled(robot, i, rates, efforts, results)


@Callback
def inward_base(robot, i, _, tau, out, columns):
    """Run evaluation.inward_base, as :func:`inward`."""
    # V of the base is q̇, whose address is not used.
    efforts = _vector_at(tau, (ws.robot_of(robot).nv,))
    return evaluation.inward_base(robot, i, efforts, _matrix_at(out, (ws.N_ROWS, columns)))


@Callback
def factorize(robot, i):
    """Run factorization.factorize_group."""
    return factorization.factorize_group(robot, i)


@Callback
def aba_inward(robot, i, qd, qdd):
    """Run classical.aba_inward_group at the addresses of q̇ and q̈."""
    count = (ws.robot_of(robot).nv,)
    return classical.aba_inward_group(robot, i, _vector_at(qd, count), _vector_at(qdd, count))


@Callback
def aba_outward(robot, i, qd, qdd):
    """Run classical.aba_outward_group at the addresses of q̇ and q̈."""
    count = (ws.robot_of(robot).nv,)
    classical.aba_outward_group(robot, i, _vector_at(qd, count), _vector_at(qdd, count))
    # A callback returns a status; this step has no failure.
    return 0


STEPS = {
    ws.INWARD: inward,
    ws.INWARD_BASE: inward_base,
    ws.FACTORIZE: factorize,
    ws.ABA_INWARD: aba_inward,
    ws.ABA_OUTWARD: aba_outward,
}
ADDRESSES = np.array([STEPS[number].address for number in range(len(STEPS))])
"""Addresses of the steps, by their numbers."""
