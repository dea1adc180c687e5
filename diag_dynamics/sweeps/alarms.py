# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Kernels of collision detection over rows of states: dead zone of standing joints, and alarms."""

import math

from numba import types

from diag_dynamics.numerics import kernel as nk

STAMPS, FLAGS = (types.Array(kind, 1, "C", readonly=True) for kind in (nk.COUNT, nk.FLAG))
FILLED_STAMPS, FILLED_FLAGS = (types.Array(kind, 1, "C") for kind in (nk.COUNT, nk.FLAG))
FLAGS_OF_JOINTS = types.Array(nk.FLAG, 2, "C")

STANDING_SPEED, STANDING_TIME, DECAY = 0.005, 30_000_000, 4
"""A joint stands once its rate has been below a speed [rad/s, m/s] for a time [ns]. Twice that time
counts at most. Higher rates reduce it `DECAY` times as fast, each by that time at most: a single
one ends no standing of twice that time, and more than a fifth of all do, at less than 133 Hz
more."""

RISE_TIME = 300_000_000
"""Time after the begin of an event within which a rise belongs to it [ns]."""

FLOOR_TIME = 0.5e9
"""Time constant with which the floor of a value follows a larger value [ns]."""

MAX_GAP = 1_000_000_000
"""Longest time between rows without a restart [ns]."""

BEGIN, END, COUNT, EVENT, EXTENDS, LAST, MEMORY = range(7)
"""Entries of the memory: stamps of begin and end of the last alarm that had an event, whether there
was one, the stamp of its last event, whether the current alarm had one, and the last stamp."""


@nk.entry_kernel(
    STAMPS, *[nk.MATRIX] * 2, nk.NUMBER, FILLED_STAMPS, *[nk.FILLED_VECTOR] * 2, nk.FILLED_MATRIX,
    nogil=True
)  # fmt: skip
def apply_dead_zone(elapsed, rates, zones, gain, standing, widths, largest, torque):
    """Lower |m r| of joints to √(|m r|² − zone²); the zone follows standing as the observer does.

    `elapsed` is the time since the row before [ns], below zero after a restart, where a slow joint
    is taken as standing. `standing` is the time for which each joint has been slow [ns], `widths`
    are the zones, after the last row;
    `largest` are the largest of standing joints, unfiltered.
    """
    for t in range(len(elapsed)):
        # Step of a first-order filter with the observer's gain [1/s]; times are in ns.
        pace = -math.expm1(-1e-9 * gain * max(0, elapsed[t]))
        for k in range(torque.shape[1]):
            # Time of standing: it grows while the joint is slow, and decreases DECAY times as fast.
            if elapsed[t] < 0:
                standing[k] = STANDING_TIME if abs(rates[t, k]) < STANDING_SPEED else 0
                widths[k] = 0.0
            elif abs(rates[t, k]) < STANDING_SPEED:
                standing[k] = min(standing[k] + elapsed[t], 2 * STANDING_TIME)
            else:
                lost = min(DECAY * elapsed[t], STANDING_TIME)
                standing[k] = max(standing[k] - lost, 0)
            # Filtered zone of a standing joint, then √(|m r|² − zone²), zero inside the zone.
            zone = zones[t, k] if standing[k] >= STANDING_TIME else 0.0
            largest[k] = max(largest[k], zone)
            widths[k] += pace * (zone - widths[k])
            size = abs(torque[t, k])  # an unknown one, NaN, remains
            part = widths[k] / size if size > widths[k] else 1.0
            torque[t, k] *= math.sqrt(1.0 - part * part)


@nk.entry_kernel(
    STAMPS, nk.MATRIX, *[FLAGS] * 2, nk.MATRIX, nk.VECTOR, nk.FILLED_MATRIX, FILLED_FLAGS,
    *[nk.FILLED_VECTOR] * 2, FILLED_STAMPS, *[FILLED_FLAGS] * 2, FLAGS_OF_JOINTS, nogil=True
)  # fmt: skip
def judge_states(
    stamps, x, valid, restart, limits, options, values, active, offset, floor, memory,
    alarm, begins, joints
):  # fmt: skip
    """Judge rows x of [m r, r] as Detector has it; lower `values` by the offset, write the flags.

    `limits` are thresholds and release thresholds, `options` hold-off and standing [ns]. `active`,
    `offset`, `floor` and `memory` are those after the last row.
    """
    n = values.shape[1]
    for t in range(len(stamps)):
        elapsed = stamps[t] - memory[LAST]
        memory[LAST] = stamps[t]
        # No alarm, event or offset outlasts a restart or a gap.
        if restart[t] or not 0 <= elapsed <= MAX_GAP:
            memory[COUNT] = 0
            active[:] = False
            offset[:] = 0.0
        # A state without a result ends an alarm; the offset remains.
        if not valid[t]:
            active[:] = False
            continue
        # `released` compares values before the offset lowers them: a standing torque is no release.
        was_on = False
        is_offset = False
        released = True
        for k in range(n):
            was_on |= active[k]
            released &= values[t, k] < limits[1, k]
        for k in range(len(offset)):
            is_offset |= offset[k] != 0.0
        # Released, no alarm, no offset: most states end here.
        if released and not (was_on or is_offset):
            continue
        if is_offset:
            _lower_values(values[t], x[t], offset)
        # Hysteresis: active above the threshold, until below the release threshold.
        on = False
        for k in range(n):
            active[k] = values[t, k] > limits[0, k] or (active[k] and values[t, k] >= limits[1, k])
            on |= active[k]
        # A rise within the hold-off after the alarm of an event belongs to that event.
        begin = on and not was_on and (memory[COUNT] == 0 or stamps[t] - memory[END] > options[0])
        if begin:
            memory[BEGIN] = stamps[t]
        if on:
            rises = _follow_floor(stamps[t], elapsed, values[t], limits[0], begin, floor, memory)
            begins[t] = begin or rises
            # Only an alarm that had an event moves the end from which the hold-off counts.
            if begins[t] or not was_on:
                memory[EXTENDS] = begins[t]
            if memory[EXTENDS]:
                memory[END] = stamps[t]
                memory[COUNT] = 1
        alarm[t] = on
        for k in range(joints.shape[1]):
            joints[t, k] = active[k]
        # Time constant standing/2: the offset follows a standing alarm, then only decreases.
        is_standing = on and stamps[t] - memory[BEGIN] > options[1]
        if not released or is_standing:
            if is_standing or is_offset:
                _move_offset(offset, x[t], is_standing, -math.expm1(-2.0 * elapsed / options[1]))
        else:
            offset[:] = 0.0


@nk.kernel
def _follow_floor(stamp, elapsed, values, limits, begins, floor, memory):
    """Return whether a value has risen far enough above its floor within an alarm.

    That is by its threshold, times the largest ratio of a floor to its threshold if that exceeds 1:
    a strong push lasts and spreads to other joints without being several. The floor follows smaller
    values at once and larger ones slowly; until an event is old, all.
    """
    # Rises soon after the begin of an event belong to it.
    if begins:
        memory[EVENT] = stamp
    is_new = stamp - memory[EVENT] <= RISE_TIME
    # Largest ratio of a floor to its threshold, at least 1; 0 where the threshold is inf.
    ratio = 1.0
    for k in range(len(values)):
        if floor[k] > ratio * limits[k]:
            ratio = floor[k] / limits[k]
    rises = False
    for k in range(len(values)):
        rises |= not is_new and values[k] - floor[k] > ratio * limits[k]
        pace = 1.0 if is_new or values[k] < floor[k] else -math.expm1(-elapsed / FLOOR_TIME)
        floor[k] += pace * (values[k] - floor[k])
    if rises:
        memory[EVENT] = stamp
    return rises


@nk.kernel
def _move_offset(offset, x, is_standing, pace):
    """Approach x of an alarm that stands, and otherwise x where it is nearer to zero."""
    for k in range(len(offset)):
        target = x[k]
        # The smaller of x and the offset, zero where signs differ: it decreases and never grows.
        if not is_standing:
            nearer = min(abs(x[k]), abs(offset[k]))
            target = math.copysign(nearer, x[k]) if x[k] * offset[k] > 0.0 else 0.0
        offset[k] += pace * (target - offset[k])


@nk.kernel
def _lower_values(values, x, offset):
    """Lower |m r|, ‖m r‖ and |r| to those of x − offset."""
    n = len(offset) // 2
    # First half m r: joints and ‖m r‖; second half r: only |r|. No value becomes larger.
    for half in range(2):
        square = 0.0
        for k in range(half * n, half * n + n):
            value = x[k] - offset[k]
            square += value * value
            if half == 0:
                values[k] = min(values[k], abs(value))
        values[n + half] = min(values[n + half], math.sqrt(square))
