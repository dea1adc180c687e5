"""Many states at once: as many as there are lanes side by side, in the same sweep as a single one."""

from diag_dynamics.compiled.kernel import MATRIX, ROBOT, STATES, entry_kernel, kernel
from diag_dynamics.compiled.lanes import WIDTH
from diag_dynamics.sweeps.evaluation import sweep
from diag_dynamics.sweeps.joints import are_finite, are_positions
from diag_dynamics.sweeps.workspace import POSITIONS, RATES, RESULTS, copy, opened, opened_wide


@kernel
def _pack(values, first, numbers):
    """Fill lanes with rows of `values` from `first` on; where there are none left, with the last one."""
    for lane in range(WIDTH):
        row = values[min(first + lane, len(values) - 1)]
        for k in range(len(row)):
            numbers[k, lane] = row[k]


@entry_kernel(ROBOT, MATRIX, MATRIX, MATRIX, STATES, nogil=True)
def evaluate_many(robot, Q, QD, TAU, states):
    """Fill `states` with what state.evaluate gives at each of many, the first axis of all arguments.

    Without efforts TAU has one row, of zeros. The robot is that of a WideWorkspace. It returns how many states have been
    evaluated: all, or those before the first :data:`~lanes.WIDTH` of which one fails.
    """
    bodies, gravity, _, _ = opened(robot)
    work, table, (q, qd, tau), out, (q_numbers, qd_numbers, tau_numbers), numbers = opened_wide(robot)
    for first in range(0, len(Q), WIDTH):
        _pack(Q, first, q_numbers)
        _pack(QD, first, qd_numbers)
        _pack(TAU, first, tau_numbers)
        if not (are_positions(bodies, q) and are_finite(qd) and are_finite(tau)):
            return first
        if sweep(bodies, gravity, q, qd, tau, work, table, out) != 0:
            return first
        for t in range(first, min(first + WIDTH, len(Q))):
            state = states[t]
            for row in range(RESULTS):
                for k in range(len(qd)):
                    state[row, k] = numbers[row, k, t - first]
            copy(Q[t], state[POSITIONS])
            copy(QD[t], state[RATES])
    return len(Q)
