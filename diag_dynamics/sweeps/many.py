# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many states at once: as many as there are lanes side by side, in the same sweep as a single one."""

from diag_dynamics.compiled.kernel import COUNT, FILLED_MATRIX, FILLED_STATES, FLAG, MATRIX, ROBOT, entry_kernel, kernel
from diag_dynamics.compiled.lanes import WIDTH
from diag_dynamics.sweeps.evaluation import sweep
from diag_dynamics.sweeps.factorization import (
    moments_inward,
    place_and_factorize,
    scale_by_inertia,
    working_moments_inward,
)
from diag_dynamics.sweeps.joints import are_finite, are_positions
from diag_dynamics.sweeps.workspace import KINETIC_ENERGY, NUMBERS, RESULTS, copy, opened_wide


@kernel
def _pack(values, first, end, numbers):
    """Fill lanes with rows of `values` from `first` on; where none are left before `end`, with the last one."""
    last = min(end, len(values)) - 1
    for lane in range(WIDTH):
        row = values[min(first + lane, last)]
        for k in range(len(row)):
            numbers[k, lane] = row[k]


@entry_kernel(ROBOT, *[MATRIX] * 3, COUNT, COUNT, FILLED_STATES, *[FILLED_MATRIX] * 3, nogil=True)
def evaluate_many(robot, Q, QD, TAU, begin, end, results, numbers, positions, rates):
    """What evaluation.evaluate gives at states `begin` to `end` of many, a row of Q, QD and TAU each.

    The robot is that of a WideWorkspace. Without efforts TAU has one row, of zeros. `results`, of shape (RESULTS, T, nv),
    receives the rows from NU on, `numbers`, (NUMBERS, T), those from KINETIC_ENERGY on, `positions` and `rates` copies of
    Q and QD. It returns the end of what has been evaluated: all, or what comes before the first
    :data:`~lanes.WIDTH` of which one fails.
    """
    at = opened_wide(robot)
    q, qd, tau, work, table, out, lanes = at.q, at.qd, at.tau, at.wide_work, at.wide_table, at.out, at.out_numbers
    for first in range(begin, end, WIDTH):
        _pack(Q, first, end, at.q_numbers)
        _pack(QD, first, end, at.qd_numbers)
        _pack(TAU, first, end, at.tau_numbers)
        if not (are_positions(at.bodies, q) and are_finite(qd) and are_finite(tau)):
            return first
        if sweep(at.bodies, at.gravity, q, qd, tau, work, table, out) != 0:
            return first
        last = min(first + WIDTH, end)
        for row in range(RESULTS):
            for t in range(first, last):
                for k in range(len(qd)):
                    results[row, t, k] = lanes[row, k, t - first]
        for t in range(first, last):
            for k in range(NUMBERS):
                numbers[k, t] = lanes[KINETIC_ENERGY + k, 0, t - first] if len(qd) > 0 else 0.0
            copy(Q[t], positions[t])
            copy(QD[t], rates[t])
    return end


@entry_kernel(ROBOT, FLAG, *[MATRIX] * 2, COUNT, COUNT, FILLED_MATRIX, nogil=True)
def moments_many(robot, working, Q, A, begin, end, results):
    """ε = ℓτ of the rows of A if `working`, else τ = mε, at states `begin` to `end` of many.

    Robot and result are as of :func:`evaluate_many`; A may have one row for all.
    """
    at = opened_wide(robot)
    q, given, result, work, table = at.q, at.tau, at.qd, at.wide_work, at.wide_table
    for first in range(begin, end, WIDTH):
        _pack(Q, first, end, at.q_numbers)
        _pack(A, first, end, at.tau_numbers)
        if not are_finite(given) or place_and_factorize(at.bodies, q, work, table[0]) != 0:
            return first
        if working:
            working_moments_inward(at.bodies, given, work, table[0], result)
            scale_by_inertia(at.bodies, work, -0.5, result)
        else:
            copy(given, result)
            scale_by_inertia(at.bodies, work, 0.5, result)
            moments_inward(at.bodies, result, work, table[0], result)
        if not are_finite(result):
            return first
        for t in range(first, min(first + WIDTH, end)):
            for k in range(len(result)):
                results[t, k] = at.qd_numbers[k, t - first]
    return end
