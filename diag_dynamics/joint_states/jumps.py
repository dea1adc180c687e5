# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rules across messages: stuck sensors, and steps of positions that no motion explains.

Steps are garbage, a re-zeroed encoder, a simulator's reset or a second source.

A joint may move by twice the larger of both velocities times the time between two messages, or at
its velocity limit, and by a slack besides. A joint of unknown velocity may move at the highest
velocity that is accepted. A message beyond that is rejected and stored as the candidate, apart from
the state in force. The candidate takes the place of that state in two cases:

* Three messages in a row agree with the candidate. The robot was moved, or its encoders were set.
* The candidate comes again between accepted messages, so sources are interleaved. It moves
  while the state in force rests.
"""

import numpy as np

from diag_dynamics.joint_states import codes
from diag_dynamics.joint_states.rule_memory import FAR
from diag_dynamics.numerics.kernel import kernel, large_kernel

STATES = 3
"""Number of successive messages that agree on a new place before the last is accepted."""

MAX_POSITION, MAX_VELOCITY, MAX_EFFORT = 1e8, 1e4, 1e6
"""Bounds of plausible values of any joint [rad, m; rad/s, m/s; N m, N]."""

MIN_STEP_TIME, MAX_STEP_TIME, MAX_STEP_TIME_WITHOUT_LIMIT = 0.01, 0.5, 0.05
"""Time between two states [s]: the shortest that counts, as stamps jitter and clocks tick; the
longest over which a step is judged, with a velocity limit and without. Over a longer one the two
velocities do not bound the way in between."""

CANDIDATE_TIMEOUT = 500_000_000
"""Time [ns] after which a message is not compared with the candidate."""


@large_kernel
def judge_step(memory, indices, position, velocity, stamp, unstamped, outcome):
    """Return the code of a step; set `outcome.moved` if the candidate replaces the state."""
    far = _mark_far_joints(memory, indices, position, velocity, stamp, unstamped)
    if far < 0:
        return codes.STATE
    joint = memory.joints[far]
    slack = memory.shared[0].slack
    in_row, interleaved = _compare_candidate(memory, indices, position, velocity, stamp)
    moves = interleaved and _moves_alone(memory, indices, position, velocity)
    if memory.shared[0].refuse_foreign:  # a controller goes on with its arm
        moves = False
    if moves or (in_row >= STATES and not interleaved):
        outcome.moved = far + 1
        outcome.moved_from = joint.position
        outcome.moved_to = position[far]
        return codes.STATE
    elapsed = stamp - joint.stamp
    outcome.joint = far
    outcome.first = joint.position
    outcome.second = position[far]
    outcome.third = elapsed * 1e-9
    outcome.fourth = _largest_step(joint, slack, velocity[far], joint.velocity, elapsed)
    outcome.fifth = joint.velocity
    outcome.sixth = velocity[far]
    for j in indices:
        _store_candidate(memory.joints[j], position[j], velocity[j], stamp)
        memory.joints[j].other_count = in_row
        memory.joints[j].interleaved = interleaved
    return codes.INTERLEAVED if interleaved else codes.JUMP


@kernel
def accept_step(memory, indices, outcome):
    """End the row of the candidate; exchange it for the state in force where it takes its place."""
    if outcome.moved > 0:
        outcome.events |= codes.MOVED
    for j in indices:
        joint = memory.joints[j]
        joint.other_count = 0
        if outcome.moved > 0:
            _store_candidate(joint, joint.position, joint.velocity, joint.stamp)


@kernel
def _mark_far_joints(memory, indices, position, velocity, stamp, unstamped):
    """Mark joints whose steps no velocity explains; return the first of them, or −1."""
    first = -1
    for k in range(len(indices) - 1, -1, -1):
        j = indices[k]
        joint = memory.joints[j]
        elapsed = stamp - memory.joints[j].stamp
        step = _step(joint, position[j], joint.position)
        slack = memory.shared[0].slack
        far = step > _largest_step(joint, slack, velocity[j], joint.velocity, elapsed)
        far = far and joint.known == 1 and joint.unstamped == unstamped
        far = far and elapsed * 1e-9 <= joint.lasting
        memory.scratch[FAR, j] = far
        first = j if far else first
    return first


@kernel
def _step(joint, position, before):
    """Return the distance of two positions, of angles that wrap the shorter way."""
    step = abs(position - before)
    if joint.turns:
        turned = step % (2.0 * np.pi)
        step = min(turned, 2.0 * np.pi - turned)
    return step


@kernel
def _largest_step(joint, slack, velocity, before, elapsed):
    """Return the largest step that velocities explain."""
    if np.isnan(velocity):
        speed = joint.fastest
    else:
        speed = abs(velocity)
        if abs(before) > speed:  # it may be NaN
            speed = abs(before)
        speed = max(2.0 * speed, joint.reach)
    return speed * max(elapsed * 1e-9, MIN_STEP_TIME) + slack


@kernel
def _compare_candidate(memory, indices, position, velocity, stamp):
    """Return the messages in a row of the candidate, and whether sources are interleaved."""
    slack = memory.shared[0].slack
    in_row = STATES
    interleaved = False
    for j in indices:
        joint = memory.joints[j]
        elapsed = stamp - memory.joints[j].other_stamp
        if memory.scratch[FAR, j] > 0.0:
            largest = _largest_step(joint, slack, velocity[j], joint.other_velocity, elapsed)
            elsewhere = _step(joint, position[j], joint.other_position) > largest
            if elsewhere or joint.other_stamp < 0 or abs(elapsed) > CANDIDATE_TIMEOUT:
                return 1, False
            in_row = min(in_row, joint.other_count + 1)
            interleaved = interleaved or joint.other_count == 0 or joint.interleaved == 1
    return in_row, interleaved


@kernel
def _moves_alone(memory, indices, position, velocity):
    """Whether a message has moved on from the candidate while the state in force rests."""
    moves = False
    elsewhere = False
    for j in indices:
        joint = memory.joints[j]
        if abs(joint.velocity) > 0.0:  # NaN is no motion of the state in force
            return False
        moves = moves or velocity[j] != 0.0  # NaN is no rest of the candidate
        elsewhere = elsewhere or position[j] != joint.other_position
    return moves and elsewhere


@kernel
def _store_candidate(joint, position, velocity, stamp):
    joint.other_position = position
    joint.other_velocity = velocity
    joint.other_stamp = stamp


# --- Stuck sensors
#
# A joint has a velocity of MOVING or more while no bit of its position changes for the timeout. Or
# its velocity is exactly 0 while its position moves by more than MOVED from one multiple of the
# timeout to the next. An arm at rest is neither. States further apart than the timeout say nothing.

SAMPLES = 5
"""Number of states that are compared within the timeout.

Each is the first one after a multiple of the timeout's fifth part.
"""

MOVING = 0.05
"""Speed [rad/s, m/s] at which a joint's position must change.

Velocity noise of a joint at rest stays below it.
"""

MOVED = 0.05  # distance [rad, m] within the timeout that a joint with velocity zero does not go


@large_kernel
def watch_stuck_sensors(memory, position, velocity, stamp, outcome):
    """Compare a state with earlier ones, if it is time to."""
    shared = memory.shared[0]
    if shared.stuck_timeout == 0 or len(memory.joints) == 0:
        return
    last = shared.stuck_last
    if last < 0 or stamp < last or stamp // shared.stuck_step != last // shared.stuck_step:
        _compare_states(memory, position, velocity, stamp)
        outcome.stuck_kind = shared.stuck_kind
        outcome.stuck_joint = shared.stuck_joint
        outcome.stuck_more = shared.stuck_more


@kernel
def _compare_states(memory, position, velocity, stamp):
    """Compare a state with earlier ones, and store the first joint that is stuck."""
    shared = memory.shared[0]
    last = shared.stuck_last
    timeout = shared.stuck_timeout
    period = SAMPLES * shared.stuck_step
    restarts = last < 0 or not 0 <= stamp - last <= timeout
    ends = not restarts and stamp // period != last // period
    still = 0
    slides = 0
    first_still = 0
    first_sliding = 0
    for j in range(len(memory.joints)):
        joint = memory.joints[j]
        x = position[j]
        fast = abs(velocity[j]) >= MOVING
        zero = velocity[j] == 0.0
        if restarts:
            joint.still_since = joint.zero_since = stamp
            joint.zero_position = x
            joint.slides = 0
        else:
            if not (fast and joint.still_fast and x == joint.still_position):
                joint.still_since = stamp
            over = zero and ends
            if over and stamp - joint.zero_since >= timeout - shared.stuck_step:
                joint.slides = int(abs(x - joint.zero_position) > MOVED)
            elif not zero:
                joint.slides = 0
            if over or not zero:
                joint.zero_since = stamp
                joint.zero_position = x
        joint.still_position = x
        joint.still_fast = int(fast)
        if stamp - joint.still_since >= timeout:
            first_still = first_still if still else j
            still += 1
        if joint.slides:
            first_sliding = first_sliding if slides else j
            slides += 1
    shared.stuck_last = stamp
    shared.stuck_kind = codes.STATE
    if still:
        shared.stuck_kind = codes.STUCK_STILL
        shared.stuck_joint = first_still
        shared.stuck_more = still - 1
    elif slides:
        shared.stuck_kind = codes.STUCK_SLIDES
        shared.stuck_joint = first_sliding
        shared.stuck_more = slides - 1
