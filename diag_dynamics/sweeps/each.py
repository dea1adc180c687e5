# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sweeps over many states, one after the other: each entry returns the first of which the sweep fails, or the end."""

from diag_dynamics.compiled.kernel import (
    COUNT,
    FILLED_MATRIX,
    FILLED_STATES,
    FLAG,
    MATRIX,
    NUMBER,
    ROBOT,
    entry_kernel,
)
from diag_dynamics.sweeps.bodies import WRENCHES
from diag_dynamics.sweeps.classical import effort_of_wrenches, forward_dynamics, inverse_dynamics, mass_matrix
from diag_dynamics.sweeps.factorization import nu_from_qd, qd_from_nu

FORWARD, INVERSE, NU_FROM_QD, QD_FROM_NU = range(4)
"""Sweeps of :func:`sweep_each`."""


@entry_kernel(ROBOT, COUNT, *[MATRIX] * 3, NUMBER, COUNT, COUNT, FILLED_MATRIX, nogil=True)
def sweep_each(robot, which, Q, A, B, weight, begin, end, results):
    """One of these sweeps at states `begin` to `end`, a row of Q, A, B and `results` each; A and B may have one for all."""
    for t in range(begin, end):
        q, a, b, result = Q[t], A[min(t, len(A) - 1)], B[min(t, len(B) - 1)], results[t]
        if which == FORWARD:
            status = forward_dynamics(robot, q, a, b, result)
        elif which == INVERSE:
            status = inverse_dynamics(robot, q, a, b, weight, result)
        elif which == NU_FROM_QD:
            status = nu_from_qd(robot, q, a, result)
        else:
            status = qd_from_nu(robot, q, a, result)
        if status != 0:
            return t
    return end


@entry_kernel(ROBOT, MATRIX, COUNT, COUNT, FILLED_STATES, nogil=True)
def mass_matrix_each(robot, Q, begin, end, M):
    """M at states `begin` to `end`."""
    for t in range(begin, end):
        if mass_matrix(robot, Q[t], M[t]) != 0:
            return t
    return end


@entry_kernel(ROBOT, MATRIX, WRENCHES, COUNT, FLAG, COUNT, COUNT, FILLED_MATRIX, nogil=True)
def effort_of_wrenches_each(robot, Q, wrenches, count, in_world, begin, end, results):
    """Jᵀf at states `begin` to `end`, each with `count` wrenches."""
    for t in range(begin, end):
        if effort_of_wrenches(robot, Q[t], wrenches[t * count : (t + 1) * count], in_world, results[t]) != 0:
            return t
    return end
