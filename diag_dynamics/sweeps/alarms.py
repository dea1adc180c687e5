# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The collision detector over rows of states: hysteresis, hold-off and the offset of standing torques."""

import math

from numba import types

from diag_dynamics.numerics import kernel as nk

STAMPS, FLAGS = (types.Array(kind, 1, "C", readonly=True) for kind in (nk.COUNT, nk.FLAG))
FILLED_STAMPS, FILLED_FLAGS = (types.Array(kind, 1, "C") for kind in (nk.COUNT, nk.FLAG))
FLAGS_OF_JOINTS = types.Array(nk.FLAG, 2, "C")


@nk.entry_kernel(
    *[STAMPS] * 2, nk.MATRIX, *[FLAGS] * 2, nk.MATRIX, nk.VECTOR, nk.FILLED_MATRIX, FILLED_FLAGS,
    nk.FILLED_VECTOR, FILLED_STAMPS, *[FILLED_FLAGS] * 2, FLAGS_OF_JOINTS, nogil=True
)  # fmt: skip
def judge_states(
    stamps, elapsed, x, valid, restart, limits, times, values, active, offset, memory, alarm, begins, joints
):
    """Judge rows x of [m r, r] as AlarmDetector has it; lower `values` by the offset, and write alarm, begins and joints.

    `limits` are thresholds and release thresholds, `times` hold-off and standing [ns]. `active`, `offset` and `memory` (begin
    and end of the last alarm, and whether there was one) are those after the last row.
    """
    for t in range(len(stamps)):
        if restart[t]:
            memory[2] = 0
            for k in range(len(active)):
                active[k] = False
            for k in range(len(offset)):
                offset[k] = 0.0
        if not valid[t]:
            continue
        was_on, released, is_offset = False, True, False
        for k in range(len(active)):
            was_on |= active[k]
            released &= values[t, k] < limits[1, k]
        for k in range(len(offset)):
            is_offset |= offset[k] != 0.0
        if released and not was_on and not is_offset:
            continue
        if is_offset:
            _lower_values(values[t], x[t], offset)
        on = False
        for k in range(len(active)):
            active[k] = values[t, k] > limits[0, k] or (active[k] and values[t, k] >= limits[1, k])
            on |= active[k]
        alarm[t] = on
        begins[t] = on and not was_on and (memory[2] == 0 or stamps[t] - memory[1] > times[0])
        if begins[t]:
            memory[0] = stamps[t]
        if on:
            memory[1], memory[2] = stamps[t], 1
        for k in range(joints.shape[1]):
            joints[t, k] = active[k]
        is_standing = on and stamps[t] - memory[0] > times[1]
        if is_standing or not released:
            if is_standing or is_offset:
                _move_offset(offset, x[t], is_standing, -math.expm1(-2.0 * elapsed[t] / times[1]))
        else:
            for k in range(len(offset)):
                offset[k] = 0.0


@nk.kernel
def _move_offset(offset, x, is_standing, pace):
    """Approach x of an alarm that stands, and otherwise x where it is nearer to zero."""
    for k in range(len(offset)):
        target = x[k]
        if not is_standing:
            nearer = min(abs(x[k]), abs(offset[k]))
            target = math.copysign(nearer, x[k]) if x[k] * offset[k] > 0.0 else 0.0
        offset[k] += pace * (target - offset[k])


@nk.kernel
def _lower_values(values, x, offset):
    """Lower |m r|, ‖m r‖ and |r| to those of x − offset."""
    n = len(offset) // 2
    for half in range(2):
        square = 0.0
        for k in range(half * n, half * n + n):
            value = x[k] - offset[k]
            square += value * value
            if half == 0:
                values[k] = min(values[k], abs(value))
        values[n + half] = min(values[n + half], math.sqrt(square))
