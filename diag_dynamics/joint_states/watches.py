# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gaps in stamps, by which lost states are counted, and stuck sensors.

Gaps: of each source the intervals between stamps are collected, WINDOW at a time. The period is the one that they are
multiples of, from their lower quartile; of an interval of n periods n − 1 states are lost. Where intervals are no multiples
of anything, or no more than half of them are one period, as of two drivers of one joint, none is.

Stuck sensors: a joint has a velocity of MOVING or more while no bit of its position changes for the timeout, or its velocity
is exactly 0 while its position moves by more than MOVED from one multiple of the timeout to the next. An arm at rest is
neither. States further apart than the timeout say nothing.
"""

import numpy as np

from diag_dynamics.joint_states import codes
from diag_dynamics.joint_states.memory import WINDOW
from diag_dynamics.numerics.kernel import kernel, large_kernel

LONGEST = 1_000_000_000
"""Longest interval between stamps [ns]: a longer one is a pause of the sender."""

IRREGULAR = 0.15
"""Mean distance of intervals from multiples of the period, in periods, beyond which there is no period."""

SAMPLES = 5
"""Number of states that are compared within the timeout: the first one after each multiple of its fifth part."""

MOVING = 0.05
"""Speed [rad/s, m/s] at which a joint's position must change. Velocity noise of a joint at rest stays below it."""

MOVED = 0.05  # distance [rad, m] within the timeout that a joint with velocity zero does not go


@large_kernel
def count_gap(memory, first, stamp):
    """Count states lost before a message of a source, by its stamp."""
    source = memory.joints[first]
    elapsed = stamp - source.gap_last if source.gap_last >= 0 else 0
    source.gap_last = stamp
    if elapsed > LONGEST:
        source.gap_count = 0
    elif elapsed > 0:
        intervals = memory.history[first, len(memory.joints) :]
        intervals[source.gap_count] = elapsed
        source.gap_count += 1
        if source.gap_count == WINDOW:
            memory.shared[0].lost += _lost_in(intervals, memory.scratch[0])
            source.gap_count = 0


@kernel
def pause_gaps(memory):
    """Restart after a message whose stamp is unknown: the next interval would count as a loss."""
    for j in range(len(memory.joints)):
        memory.joints[j].gap_last = -1


@large_kernel
def _lost_in(intervals, ordered):
    """Return the number of states lost within intervals; 0 if they are no multiples of a period."""
    for i in range(WINDOW):
        at = i
        while at > 0 and ordered[at - 1] > intervals[i]:
            ordered[at] = ordered[at - 1]
            at -= 1
        ordered[at] = intervals[i]
    period, total = ordered[(WINDOW - 1) // 4], 0.0
    for i in range(WINDOW):
        total += intervals[i]
    for _ in range(2):
        count, single, apart = 0.0, 0, 0.0
        for i in range(WINDOW):
            periods = max(np.rint(intervals[i] / period), 1.0)
            ordered[i] = periods
            count += periods
            single += int(periods == 1.0)
        period = total / count
    for i in range(WINDOW):
        apart += abs(intervals[i] / period - ordered[i])
    if apart / WINDOW > IRREGULAR or 2 * single <= WINDOW:
        return 0
    return int(count) - WINDOW


@large_kernel
def watch_stuck_sensors(memory, position, velocity, stamp, one):
    """Compare a state with earlier ones, if it is time to; return False if it is rejected."""
    shared = memory.shared[0]
    if shared.stuck_timeout == 0 or len(memory.joints) == 0:
        return True
    last = shared.stuck_last
    if last < 0 or stamp < last or stamp // shared.stuck_step != last // shared.stuck_step:
        _compare_states(memory, position, velocity, stamp)
        one.stuck_kind, one.stuck_joint = shared.stuck_kind, shared.stuck_joint
        one.stuck_more = shared.stuck_more
    if shared.stuck_kind == 0 or shared.stuck_rejected == 0:
        return True
    one.joint, one.first, one.second = shared.stuck_joint, shared.stuck_kind, shared.stuck_more
    return False


@kernel
def _compare_states(memory, position, velocity, stamp):
    """Compare a state with earlier ones, and store the first joint that is stuck."""
    shared = memory.shared[0]
    last, timeout, period = shared.stuck_last, shared.stuck_timeout, SAMPLES * shared.stuck_step
    restarts = last < 0 or not 0 <= stamp - last <= timeout
    ends = not restarts and stamp // period != last // period
    still, slides = 0, 0
    for j in range(len(memory.joints)):
        joint, x = memory.joints[j], position[j]
        fast, zero = abs(velocity[j]) >= MOVING, velocity[j] == 0.0
        if restarts:
            joint.still_since = joint.zero_since = stamp
            joint.zero_position, joint.slides = x, 0
        else:
            if not (fast and joint.still_fast and x == joint.still_position):
                joint.still_since = stamp
            over = zero and ends
            if over and stamp - joint.zero_since >= timeout - shared.stuck_step:
                joint.slides = int(abs(x - joint.zero_position) > MOVED)
            elif not zero:
                joint.slides = 0
            if over or not zero:
                joint.zero_since, joint.zero_position = stamp, x
        joint.still_position, joint.still_fast = x, int(fast)
        still += int(stamp - joint.still_since >= timeout)
        slides += joint.slides
    shared.stuck_last, shared.stuck_kind = stamp, codes.STATE
    if still or slides:
        shared.stuck_kind = codes.STUCK_STILL if still else codes.STUCK_SLIDES
        shared.stuck_more = (still if still else slides) - 1
        for j in range(len(memory.joints) - 1, -1, -1):
            stuck = stamp - memory.joints[j].still_since >= timeout if still else memory.joints[j].slides == 1
            if stuck:
                shared.stuck_joint = j
