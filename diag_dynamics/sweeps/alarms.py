# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The collision detector over rows of states: hysteresis, hold-off, offset of standing torques, and the arm at rest."""

import math

from numba import types

from diag_dynamics.numerics import kernel as nk

STAMPS, FLAGS = (types.Array(kind, 1, "C", readonly=True) for kind in (nk.COUNT, nk.FLAG))
FILLED_STAMPS, FILLED_FLAGS = (types.Array(kind, 1, "C") for kind in (nk.COUNT, nk.FLAG))
FLAGS_OF_JOINTS = types.Array(nk.FLAG, 2, "C")

REST_SPEED, REST_TIME, WINDOW = 0.05, 500_000_000, 200_000_000
"""An arm is at rest if all rates are below a speed [rad/s, m/s] for a time [ns]; window of changes of m r [ns]."""

KEPT, STEP = (
    256,
    1_000_000,
)  # samples of m r that are kept, at least a step apart [ns]: more than a window
BEGIN, END, COUNT, SINCE, SLOW, FIRST, LENGTH, LAST_REST, AT_REST, HELD, MEMORY = range(11)
"""Entries of the memory: stamps of begin and end of the last alarm, and whether there was one; the
stamp since when the arm is slow, and whether it is; the first of the kept samples, and their
number; the stamp of the last state at rest, and whether the last state was one; whether changes are
from the torque before an alarm. The stamps of samples follow."""


@nk.entry_kernel(
    *[STAMPS] * 2, nk.MATRIX, nk.VECTOR, *[FLAGS] * 2, nk.MATRIX, nk.VECTOR, *[nk.FILLED_MATRIX] * 2, FILLED_FLAGS,
    nk.FILLED_VECTOR, nk.FILLED_MATRIX, FILLED_STAMPS, *[FILLED_FLAGS] * 3, FLAGS_OF_JOINTS, nogil=True
)  # fmt: skip
def judge_states(
    stamps, elapsed, x, speed, valid, restart, limits, options, values, changes, active, offset, kept, memory, alarm, begins,
    at_rest, joints
):  # fmt: skip
    """Judge rows x of [m r, r] as AlarmDetector has it; lower `values` by the offset, and write the flags.

    `limits` are thresholds and release thresholds, `options` hold-off and standing [ns], whether
    rest is judged, and whether `changes` are given; otherwise they are written. `speed` is the
    largest rate. `active`, `offset`, `memory` and `kept` (m r before an alarm, a window ago, and of
    the samples) are those after the last row.
    """
    n = values.shape[1]
    for t in range(len(stamps)):
        if restart[t]:
            _clear(active, offset, memory)
        if not valid[t]:
            memory[SLOW] = memory[AT_REST] = 0
            continue
        was_on, released, is_offset = False, True, False
        for k in range(len(active)):
            was_on |= active[k]
        rest = options[2] != 0.0 and _follow_rest(
            stamps[t], elapsed[t], x[t], speed[t], kept, memory
        )
        if rest and memory[AT_REST] == 0 and not was_on:
            for k in range(len(offset)):
                offset[k] = x[t, k]
        memory[AT_REST] = at_rest[t] = rest
        for k in range(n):
            released &= values[t, k] < limits[1, k]
        for k in range(len(offset)):
            is_offset |= offset[k] != 0.0
        if released and not (was_on or is_offset or rest):
            continue
        if is_offset:
            _lower_values(values[t], x[t], offset)
        on, age = False, stamps[t] - memory[BEGIN]
        for k in range(n):
            active[k] = values[t, k] > limits[0, k] or (active[k] and values[t, k] >= limits[1, k])
            on |= active[k]
        if rest or memory[HELD] != 0:
            holds, is_old = (
                rest or stamps[t] - memory[LAST_REST] <= options[0],
                not was_on or age > options[1],
            )
            on |= _judge_rest(
                x[t],
                rest,
                holds,
                is_old,
                options[3] != 0.0,
                limits,
                changes[t],
                active,
                kept,
                memory,
            )
        alarm[t] = on
        begins[t] = (
            on and not was_on and (memory[COUNT] == 0 or stamps[t] - memory[END] > options[0])
        )
        if begins[t]:
            memory[BEGIN] = stamps[t]
        if on:
            memory[END], memory[COUNT] = stamps[t], 1
        for k in range(joints.shape[1]):
            joints[t, k] = active[k] or active[n + k]
        is_standing = on and stamps[t] - memory[BEGIN] > options[1]
        if is_standing or rest or not released:
            if is_standing or is_offset:
                _move_offset(offset, x[t], is_standing, -math.expm1(-2.0 * elapsed[t] / options[1]))
        else:
            for k in range(len(offset)):
                offset[k] = 0.0


@nk.kernel
def _clear(active, offset, memory):
    """Forget alarms, offset and rest."""
    memory[COUNT] = memory[SLOW] = memory[AT_REST] = memory[HELD] = 0
    for k in range(len(active)):
        active[k] = False
    for k in range(len(offset)):
        offset[k] = 0.0


@nk.kernel
def _follow_rest(stamp, elapsed, x, speed, kept, memory):
    """Return whether the arm is at rest; keep m r, and interpolate that of a window ago."""
    is_slow = speed < REST_SPEED
    if not is_slow or elapsed > WINDOW or memory[SLOW] == 0:
        memory[SLOW], memory[SINCE], memory[FIRST], memory[LENGTH] = is_slow, stamp, 0, 0
    if not is_slow:
        return False
    n, samples, target = kept.shape[1], memory[MEMORY:], stamp - WINDOW
    if memory[LENGTH] == 0 or stamp - samples[(memory[FIRST] + memory[LENGTH] - 1) % KEPT] >= STEP:
        last = (memory[FIRST] + memory[LENGTH]) % KEPT
        memory[LENGTH] += 1
        samples[last] = stamp
        for k in range(n):
            kept[2 + last, k] = x[k]
    while memory[LENGTH] > 2 and samples[(memory[FIRST] + 1) % KEPT] <= target:
        memory[FIRST], memory[LENGTH] = (memory[FIRST] + 1) % KEPT, memory[LENGTH] - 1
    if stamp - memory[SINCE] < REST_TIME:
        return False
    i, j = memory[FIRST], (memory[FIRST] + 1) % KEPT
    part = (target - samples[i]) / (samples[j] - samples[i])
    for k in range(n):
        kept[1, k] = kept[2 + i, k] + part * (kept[2 + j, k] - kept[2 + i, k])
    memory[LAST_REST] = stamp
    return True


@nk.kernel
def _judge_rest(x, rest, holds, is_old, is_given, limits, changes, active, kept, memory):
    """Judge changes of m r within a window, during an alarm those from before it; return whether a detector is active.

    If an alarm is old, the smaller one of both counts: a standing torque holds no alarm.
    """
    n, held = kept.shape[1], memory[HELD] != 0
    on, returned, away_square, square = False, True, 0.0, 0.0
    for k in range(n + 1):
        away, change, d = math.sqrt(away_square), math.sqrt(square), len(active) - n - 1 + k
        if k < n:
            away, change = abs(x[k] - kept[0, k]), abs(x[k] - kept[1, k])
            away_square, square = away_square + away * away, square + change * change
        if is_given:
            change = changes[k]
        returned &= max(away, change) < limits[1, d]
        if held:
            change = min(away, change) if rest and is_old else away
        changes[k] = change
        active[d] = (rest and change > limits[0, d]) or (
            active[d] and holds and change >= limits[1, d]
        )
        on |= active[d]
    if on and not held:
        memory[HELD] = 1
        for k in range(n):
            kept[0, k] = kept[1, k]
    elif not on and (returned or not rest):
        memory[HELD] = 0
    return on


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
