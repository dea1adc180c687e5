# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rules across messages: stuck sensors, and steps of positions that no motion explains.

Steps are garbage, a re-zeroed encoder, a simulator's reset or a second source.

A joint may move by twice the larger of both velocities times the time between two messages, or at its velocity limit, and by
a slack besides. A joint of unknown velocity may move at the highest velocity that is accepted. A message beyond that is
rejected and stored as the candidate, apart from the state in force. The candidate takes the place of that state in two cases:

* Three messages in a row agree with the candidate. The robot was moved, or its encoders were set.
* The candidate came again between messages of the source in force: sources are interleaved. The candidate moves while the
  source in force rests, or that source has been silent for SOURCE_TIMEOUT.

A second source may rest within the slack of a moving robot. Where a robot in motion is at rest in the same pose to the bit
again and again, and no motion explains that, that pose is the candidate's, too. Messages without a velocity say nothing on
rest.
"""

import numpy as np

from diag_dynamics.joint_states import codes
from diag_dynamics.joint_states.memory import (
    COUNT,
    FAR,
    KNOWN,
    LARGEST,
    RETURNS,
    STEP,
    VELOCITY,
)
from diag_dynamics.numerics.kernel import kernel, large_kernel

STATES = 3
"""Messages in a row that agree on a new place before it is believed. The last of them is accepted."""

MIN_STEP_TIME, MAX_STEP_TIME, MAX_STEP_TIME_WITHOUT_LIMIT = 0.01, 0.5, 0.05
"""Time between two states [s]: the shortest that counts, as stamps jitter and clocks tick; the longest over which a step is
judged, with a velocity limit and without. Over a longer one the two velocities do not bound the way in between."""

SOURCE_TIMEOUT = 0.5
"""Time [s] without a message of the source in force after which another source may take its place."""

CANDIDATE_TIMEOUT = 5.0
"""Time [s] after which a pose that comes again is no longer that of the source that sent it before."""

MARGIN = 1e-3  # largest distance [rad, m] between positions of one stamp that says nothing

STOP_FRACTION = 0.15
"""Fraction of the slack by which a robot may stop elsewhere than its velocities lead: some counts of a coarse encoder."""

NOTHING, CANDIDATE, DISPLACED, CONTRADICTED = 0, 1, 2, 4
"""What :func:`accept_step` does: store the message, or the state in force, as the candidate; count a contradiction."""


@large_kernel
def judge_step(memory, here, position, velocity, stamp, unstamped, one):
    """Return the code of a step that is too far, and what :func:`accept_step` has to do."""
    table = memory.scratch
    far, moves, contradicts = _measure_steps(memory, here, position, velocity, stamp, unstamped)
    action = CONTRADICTED if contradicts else NOTHING
    was_interleaved = _is_interleaved(memory)
    stops = not far and _stops_elsewhere(memory, here, velocity, stamp)
    if not far and not was_interleaved and not stops:
        return codes.STATE, action
    mask = FAR if far else KNOWN
    same = _compare_candidate(memory, here, position, velocity, stamp, mask)
    interleaved = False
    for j in here:
        if table[mask, j] > 0.0 and table[RETURNS, j] >= (1.0 if far else 2.0):
            interleaved = True
    if not far:
        if not same or not _rests(here, velocity) or not moves:
            stores = stops and not was_interleaved
            return codes.STATE, action | (CANDIDATE if stores else NOTHING)
        if not interleaved:
            return codes.STATE, action | CANDIDATE
    silence = _describe_step(memory, here, position, velocity, stamp, mask, one)
    if _takes_place(memory, here, velocity, far, same, interleaved, silence, mask):
        return codes.STATE, DISPLACED
    _store_candidate(memory, here, position, stamp)
    return codes.INTERLEAVED if interleaved else codes.JUMP, NOTHING


@kernel
def accept_step(memory, here, position, stamp, action, one):
    """Store the candidate of a message that is accepted, and count what is said of it."""
    if action & CONTRADICTED:
        one.events |= codes.CONTRADICTS
    if action & CANDIDATE:
        _store_candidate(memory, here, position, stamp)
    if action & DISPLACED:
        far = False
        for j in here:
            joint = memory.joints[j]
            far = far or memory.scratch[FAR, j] > 0.0
            known = memory.scratch[KNOWN, j] > 0.0
            joint.other_position, joint.other_velocity, joint.other_stamp = (
                joint.position,
                joint.velocity,
                joint.stamp,
            )
            joint.other_since, joint.other_since_position = joint.stamp, joint.position
            joint.other_count = int(known)
            joint.other_returns = int(memory.scratch[RETURNS, j]) if known else 0
        if far:
            one.events |= codes.MOVED
            one.moved, one.moved_from, one.moved_to = one.joint, one.first, one.second


@kernel
def is_contradicted(memory, here, position, stamp, unstamped):
    """Return the joint in which a message without velocity is of another source, or −1.

    Its stamp is that of the state in force, or its positions repeat to the bit after that source's next message.
    """
    first, newest = here[0], -1
    for j in here:
        first = min(first, j)
        if _is_comparable(memory.joints[j], unstamped):
            newest = max(newest, memory.joints[j].stamp)
    source = memory.joints[first]
    again = source.bare_count == len(here) and source.bare_since != newest
    for i in range(len(here)):
        again = again and memory.history[first, i] == position[here[i]]
        memory.history[first, i] = position[here[i]]
    source.bare_count, source.bare_since = len(here), newest
    largest, joint = MARGIN, -1
    for j in here:
        if _is_comparable(memory.joints[j], unstamped):
            step = _step(memory.joints[j], position[j], memory.joints[j].position)
            if step > largest:
                largest, joint = step, j
    return joint if again or stamp == newest else -1


@kernel
def _is_comparable(joint, unstamped):
    """Whether a joint is known by the clock of a message."""
    return joint.known == 1 and joint.unstamped == unstamped


@kernel
def _measure_steps(memory, here, position, velocity, stamp, unstamped):
    """Fill the scratch; return whether a step is too far, whether there is one, and whether one contradicts its stamp."""
    table, joints = memory.scratch, memory.joints
    for j in range(len(joints)):
        if abs(stamp - joints[j].other_stamp) > CANDIDATE_TIMEOUT * 1e9:
            joints[j].other_count = joints[j].other_returns = 0
    far, moves, contradicts = False, False, False
    for j in here:
        joint = joints[j]
        known = _is_comparable(joint, unstamped)
        step = _step(joint, position[j], joint.position) if known else 0.0
        most = _largest_step(
            joint, memory.shared[0].slack, velocity[j], joint.velocity, stamp - joint.stamp
        )
        too_far = known and step > most and (stamp - joint.stamp) * 1e-9 <= joint.lasting
        table[FAR, j], table[KNOWN, j], table[STEP, j], table[LARGEST, j] = (
            too_far,
            known,
            step,
            most,
        )
        table[VELOCITY, j] = velocity[j]
        far, moves = far or too_far, moves or step != 0.0
        contradicts = contradicts or (known and stamp == joint.stamp and step > MARGIN)
    return far, moves, contradicts


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
def _is_interleaved(memory):
    """Whether a candidate came again between messages of the source in force."""
    for j in range(len(memory.joints)):
        if memory.joints[j].other_returns > 0:
            return True
    return False


@kernel
def _rests(here, velocity):
    """Whether all velocities are 0 or missing."""
    for j in here:
        if velocity[j] != 0.0 and not np.isnan(velocity[j]):
            return False
    return True


@kernel
def _stops_elsewhere(memory, here, velocity, stamp):
    """Whether a robot in motion is at rest at once where its velocities do not lead."""
    moved, elsewhere = False, False
    for j in here:
        joint = memory.joints[j]
        if memory.scratch[KNOWN, j] == 0.0 or velocity[j] != 0.0:  # NaN is no rest
            return False
        before = 0.0 if np.isnan(joint.velocity) else joint.velocity
        moved = moved or before != 0.0
        way = 2.0 * abs(before) * max(stamp - joint.stamp, 0) * 1e-9
        elsewhere = (
            elsewhere or memory.scratch[STEP, j] > way + STOP_FRACTION * memory.shared[0].slack
        )
    return moved and elsewhere


@kernel
def _compare_candidate(memory, here, position, velocity, stamp, mask):
    """Compare a message with the candidate; return whether all positions are the candidate's to the bit."""
    table, agrees, same = memory.scratch, True, True
    for j in here:
        joint = memory.joints[j]
        most = _largest_step(
            joint,
            memory.shared[0].slack,
            velocity[j],
            joint.other_velocity,
            stamp - joint.other_stamp,
        )
        elsewhere = _step(joint, position[j], joint.other_position) > most
        if table[mask, j] > 0.0 and (joint.other_count == 0 or elsewhere):
            agrees = False
        same = same and joint.other_count > 0 and position[j] == joint.other_position
    for j in here:
        joint = memory.joints[j]
        in_row = table[KNOWN, j] > 0.0 and joint.other_since == joint.stamp
        in_row = in_row and joint.other_since_position == joint.position
        recent = (stamp - joint.other_stamp) * 1e-9 <= SOURCE_TIMEOUT
        table[COUNT, j] = joint.other_count + 1 if agrees and in_row else 1
        returned = int(agrees and not in_row)
        table[RETURNS, j] = joint.other_returns + returned if agrees and (in_row or recent) else 0
    return same


@kernel
def _describe_step(memory, here, position, velocity, stamp, mask, one):
    """Store the numbers of a step's text; return the time since the last message of the source in force [s]."""
    table, newest, chosen = memory.scratch, -1, here[0]
    row = FAR if mask == FAR else STEP
    for j in here:
        if table[mask, j] > 0.0:
            newest = max(newest, memory.joints[j].stamp)
        if table[row, j] > table[row, chosen]:
            chosen = j
    joint, silence = memory.joints[chosen], (stamp - newest) * 1e-9
    one.joint, one.first, one.second, one.third = chosen, joint.position, position[chosen], silence
    one.fourth, one.fifth, one.sixth = table[LARGEST, chosen], joint.velocity, velocity[chosen]
    return silence


@kernel
def _takes_place(memory, here, velocity, far, same, interleaved, silence, mask):
    """Whether the candidate takes the place of the state in force, whose returns are stored in the scratch."""
    table, enough, rests, missing = memory.scratch, True, True, False
    for j in here:
        if table[mask, j] > 0.0 and table[COUNT, j] < STATES:
            enough = False
        before = memory.joints[j].velocity
        if table[KNOWN, j] > 0.0 and before != 0.0 and not np.isnan(before):
            rests = False
        missing = missing or np.isnan(velocity[j])
    if enough and (not interleaved or silence > SOURCE_TIMEOUT):
        for j in here:
            table[RETURNS, j] = 0.0
        return True
    # It moves, or goes on from the candidate where velocities are missing.
    moves = not same and (missing or not _rests(here, velocity))
    if far and interleaved and rests and moves:
        for j in here:
            table[RETURNS, j] = max(table[RETURNS, j], 1.0)
        return True
    return False


@kernel
def _store_candidate(memory, here, position, stamp):
    """Store a message as the candidate."""
    table = memory.scratch
    for j in here:
        joint = memory.joints[j]
        joint.other_position, joint.other_velocity, joint.other_stamp = (
            position[j],
            table[VELOCITY, j],
            stamp,
        )
        joint.other_since = joint.stamp if table[KNOWN, j] > 0.0 else -1
        joint.other_since_position = joint.position
        joint.other_count, joint.other_returns = int(table[COUNT, j]), int(table[RETURNS, j])


# --- Stuck sensors
#
# A joint has a velocity of MOVING or more while no bit of its position changes for the timeout, or its
# velocity is exactly 0 while its position moves by more than MOVED from one multiple of the timeout to the next. An arm at
# rest is neither. States further apart than the timeout say nothing.

SAMPLES = 5
"""Number of states that are compared within the timeout: the first one after each multiple of its fifth part."""

MOVING = 0.05
"""Speed [rad/s, m/s] at which a joint's position must change. Velocity noise of a joint at rest stays below it."""

MOVED = 0.05  # distance [rad, m] within the timeout that a joint with velocity zero does not go


@large_kernel
def watch_stuck_sensors(memory, position, velocity, stamp, one):
    """Compare a state with earlier ones, if it is time to."""
    shared = memory.shared[0]
    if shared.stuck_timeout == 0 or len(memory.joints) == 0:
        return
    last = shared.stuck_last
    if last < 0 or stamp < last or stamp // shared.stuck_step != last // shared.stuck_step:
        _compare_states(memory, position, velocity, stamp)
        one.stuck_kind, one.stuck_joint = shared.stuck_kind, shared.stuck_joint
        one.stuck_more = shared.stuck_more


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
            stuck = (
                stamp - memory.joints[j].still_since >= timeout
                if still
                else memory.joints[j].slides == 1
            )
            if stuck:
                shared.stuck_joint = j
