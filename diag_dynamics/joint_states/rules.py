# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rules of joint states, compiled: one loop over messages, of which there may be one or many.

A rejected message leaves no trace but what a later restart of time, setting of a clock or jump
depends on. So every rule that rejects comes before the first line that stores a value.
"""

import math

import numpy as np
from numba import types

from diag_dynamics.joint_states import codes
from diag_dynamics.joint_states.jumps import (
    MAX_EFFORT,
    MAX_VELOCITY,
    accept_step,
    judge_step,
    watch_stuck_sensors,
)
from diag_dynamics.joint_states.rule_memory import (
    BATCH_TYPES,
    BEGIN,
    COUNT,
    ERROR,
    FAR,
    FORGET,
    HEAD,
    JOINT_COUNT,
    MEMORY_TYPES,
    VALUES,
    Batch,
    Memory,
)
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.numerics.callback import call_address
from diag_dynamics.numerics.kernel import entry_kernel, kernel, large_kernel
from diag_dynamics.numerics.tables import address_of, array_at
from diag_dynamics.rotations import wrap_angle

PATIENCE = 10 * SECOND
"""Time [ns] until stamps of another clock are accepted again.

All stamps must differ from this node's clock by the same amount for so long.
"""

ODOM_TIMEOUT = SECOND // 2
"""Largest difference [ns] between the stamps of a joint state and of odometry."""

LATE_COUNT, LATE_TIME = 5, SECOND // 2
"""Late stamps in a row, and their duration [ns], after which time has restarted.

The duration is from the first to the last of them.
"""

LONGEST = 10.0 * SECOND
"""Longest time [ns] between the first two positions from which a velocity is estimated."""

PERIODS = 3.0  # periods without a position after which an estimate restarts

_wrap_angle, _matrix_at = kernel(wrap_angle), array_at(types.float64, 2)


@entry_kernel(*MEMORY_TYPES, *BATCH_TYPES, nogil=True)
def judge_messages(shared, joints, followers, scratch, layouts, messages, numbers, outcome, states):
    """Judge messages one after the other; the arguments are the fields of Memory and Batch."""
    memory = Memory(shared, joints, followers, scratch)
    batch = Batch(layouts, messages, numbers, outcome, states)
    for k in range(len(messages)):
        record = outcome[k]
        layout = messages[k].layout
        if layout == FORGET:
            _forget(memory)
            shared[0].stuck_last = -1
            shared[0].stuck_kind = 0
            continue
        if layout < 0:
            record.code = codes.MALFORMED
        else:
            record.code = _judge(memory, batch, k, layouts[layout])
        if record.code == codes.STATE and shared[0].needs_base:
            record.code = _complete_by_base(shared[0], record)
        if record.code == codes.STATE:
            watch_stuck_sensors(memory, states[0, k], states[1, k], record.newest, record)


@large_kernel
def _judge(memory, batch, k, layout):
    """Judge one message and return the code of what comes of it."""
    message = batch.messages[k]
    outcome = batch.outcome[k]
    names = len(memory.joints) + len(memory.followers)
    row = memory.scratch[VALUES]
    indices = layout[HEAD : HEAD + layout[JOINT_COUNT]]
    follower_indices = layout[HEAD + layout[JOINT_COUNT] : HEAD + layout[COUNT]]
    _spread(batch.numbers[k], layout, names, row)
    position = row[:names]
    velocity = row[names : 2 * names]
    effort = row[2 * names : 3 * names]
    if layout[ERROR] == codes.DUPLICATE_NAME:
        return codes.DUPLICATE_NAME
    if len(indices) == 0 and len(follower_indices) == 0:
        return codes.FOREIGN
    if message.sec < 0 or message.nanosec >= SECOND:
        outcome.first = message.sec
        outcome.second = message.nanosec
        return codes.MALFORMED_STAMP
    stamp = message.sec * SECOND + message.nanosec
    unstamped = int(stamp == 0)
    if unstamped and message.now == 0:
        return codes.NO_TIME
    stamp = message.now if unstamped else stamp
    if layout[ERROR]:
        return layout[ERROR]
    code = _judge_values(memory, indices, position, velocity, outcome)
    if code == codes.NO_VELOCITY and memory.shared[0].slack > 0.0:
        for j in indices:  # a second source often sends no velocities
            velocity[j] = velocity[j] if np.isfinite(velocity[j]) else 0.0
        step = judge_step(memory, indices, position, velocity, stamp, unstamped, outcome)
        code = step if step else code
    if code:
        return code
    code, anew, source = _judge_stamp(
        memory, indices, follower_indices, stamp, unstamped, message.now, outcome
    )
    if code:
        return code
    if anew:
        outcome.events |= codes.TIME_JUMPED
        memory.shared[0].restarted = 1
        _forget(memory)
    if len(indices) and memory.shared[0].slack > 0.0:
        code = judge_step(memory, indices, position, velocity, stamp, unstamped, outcome)
        if code:
            return code
    if memory.shared[0].estimate:
        code = _estimate(memory, indices, position, velocity, stamp, unstamped, outcome)
        if code:
            return code
    # The message is accepted.
    _accept_stamp(memory, source, anew, stamp, unstamped, message.now)
    accept_step(memory, indices, outcome)
    _store_joints(memory, indices, position, velocity, effort, stamp, unstamped, outcome)
    _store_followers(memory, follower_indices, position, velocity, effort, stamp, outcome)
    if len(indices) == 0:
        return codes.FOLLOWERS_ONLY
    return _assemble(memory, batch, k)


@kernel
def _spread(numbers, layout, names, row):
    """Put the numbers of a message to their places; what it lacks is NaN."""
    for i in range(len(row)):
        row[i] = np.nan
    for field in range(3):
        begin = layout[BEGIN + field]
        if begin >= 0:
            for i in range(HEAD, HEAD + layout[COUNT]):
                row[field * names + layout[i]] = numbers[begin + layout[names + i]]


@kernel
def _judge_values(memory, indices, position, velocity, outcome):
    """Return the code of positions or velocities that are missing or out of bounds."""
    for j in indices:
        rules = memory.joints[j]
        outcome.joint = j
        outcome.first = position[j]
        if not np.isfinite(position[j]):
            return codes.NO_POSITION
        if position[j] < rules.lower or position[j] > rules.upper:
            outcome.second = rules.lower
            outcome.third = rules.upper
            return codes.POSITION_BOUND
        if np.isfinite(velocity[j]) and abs(velocity[j]) > rules.fastest:
            outcome.first = velocity[j]
            outcome.second = rules.fastest
            return codes.VELOCITY_BOUND
    for j in indices:
        if not np.isfinite(velocity[j]) and not (
            memory.shared[0].estimate and np.isnan(velocity[j])
        ):
            outcome.joint = j
            outcome.first = velocity[j]
            return codes.NO_VELOCITY
    return codes.STATE


@kernel
def _judge_stamp(memory, indices, follower_indices, stamp, unstamped, now, outcome):
    """Return the code of a stamp out of time, whether time has restarted, and a source.

    The source is the one with an earlier stamp, or −1.
    """
    span = float(SECOND)
    last = -1
    source = -1
    if len(indices):
        named = indices[0]
        for j in indices:
            # A stamp and a time of reception may be of two clocks, so they are not compared.
            if (
                memory.joints[j].known
                and memory.joints[j].unstamped == unstamped
                and memory.joints[j].stamp > last
            ):
                last = memory.joints[j].stamp
                named = j
        outcome.joint = named
        if np.isfinite(memory.joints[named].span):
            span = max(float(SECOND), memory.joints[named].span)
        if last >= 0:
            source = indices[0]  # it stands for their publisher
    else:
        outcome.joint = follower_indices[0]
    if memory.shared[0].max_age and now and not unstamped:
        code = _judge_clock(memory, stamp, now, outcome)
        if code:
            return code, False, source
    anew = last >= 0 and stamp < last
    if anew:
        code = _judge_late(memory.joints[source], stamp, last, np.int64(span), outcome)
        if code:
            return code, False, source
    return codes.STATE, anew, source


@kernel
def _judge_clock(memory, stamp, now, outcome):
    """Return the code of a stamp that is far from the clock.

    It is STATE if all stamps have been so for PATIENCE.
    """
    shared = memory.shared[0]
    apart = now - stamp
    if abs(apart) <= shared.max_age or (shared.in_step != 1 and not shared.refuse_foreign):
        return codes.STATE
    if (
        not shared.refused
        or abs(apart - shared.refused_apart) > shared.max_age
        or now < shared.refused_at
    ):
        shared.refused = 1
        shared.refused_at = now
        shared.refused_apart = apart
    if not shared.refuse_foreign and now - shared.refused_at >= PATIENCE:
        return codes.STATE
    outcome.first = apart * 1e-9
    outcome.second = shared.max_age * 1e-9
    if shared.in_step != 1:
        return codes.FOREIGN_TIME
    return codes.CLOCK_BEHIND if apart > 0 else codes.CLOCK_AHEAD


@kernel
def _judge_late(source, stamp, last, span, outcome):
    """Return the code of a stamp older than `last`.

    It is STATE if its source continues from it, because time has restarted.
    """
    first = source.late_first
    before = source.late_last
    count = source.late_count
    if count == 0 or not 0 <= stamp - before <= span:
        first = stamp
        count = 0
    source.late_first = first
    source.late_last = stamp
    source.late_count = count + 1
    outcome.first = (last - stamp) * 1e-9
    if last - stamp <= span:
        return codes.LATE if count + 1 < LATE_COUNT or stamp - first < LATE_TIME else codes.STATE
    return codes.STATE if count else codes.STAMP_FROM_PAST


@kernel
def _accept_stamp(memory, source, anew, stamp, unstamped, now):
    """Store what later stamps are judged by."""
    shared = memory.shared[0]
    if anew:
        for j in range(len(memory.joints)):
            memory.joints[j].late_count = 0
    elif source >= 0:
        memory.joints[source].late_count = 0
    if shared.max_age == 0:
        shared.in_step = -1
        shared.refused = 0
    elif now and not unstamped:
        shared.apart = now - stamp
        apart = abs(shared.apart)
        # A stamp of another clock must come within half of the bound before the bound holds for it.
        # At the bound itself it would be accepted and rejected by turns.
        within = apart <= shared.max_age and (shared.in_step != 0 or 2 * apart <= shared.max_age)
        shared.in_step = int(within)
        shared.refused = 0


@kernel
def _forget(memory):
    """Forget all joints, as after a restart of time."""
    for j in range(len(memory.joints)):
        joint = memory.joints[j]
        joint.known = joint.estimated = joint.estimate_known = 0
        joint.other_stamp = -1
    for f in range(len(memory.followers)):
        memory.followers[f].effort = np.nan


@kernel
def _estimate(memory, indices, position, velocity, stamp, unstamped, outcome):
    """Replace missing velocities by filtered difference quotients.

    Return the code of a step that is too fast.
    """
    shared = memory.shared[0]
    for j in indices:
        joint = memory.joints[j]
        elapsed = stamp - joint.estimate_stamp
        if elapsed == 0 or not _continues(memory, j, elapsed, unstamped, outcome):
            continue
        quotient = abs(_estimate_step(joint, position[j]) / (elapsed / 1e9))
        if np.isnan(velocity[j]) and quotient > MAX_VELOCITY:
            outcome.joint = j
            outcome.first = position[j]
            outcome.second = MAX_VELOCITY
            return codes.FAST_STEP
    for j in indices:
        joint = memory.joints[j]
        elapsed = stamp - joint.estimate_stamp
        if not _continues(memory, j, elapsed, unstamped, outcome):
            joint.estimate_since = stamp
            joint.estimate_sum = 0.0
            joint.estimate_weight = 0.0
            joint.estimate_period = LONGEST / PERIODS
            joint.estimate_position = position[j]
            joint.estimate_stamp = stamp
            joint.estimate_known = 1
        elif elapsed > 0:
            dt = elapsed / 1e9
            stays = math.exp(-dt / shared.filter_time) if shared.filter_time > 0.0 else 0.0
            quotient = _estimate_step(joint, position[j]) / dt
            joint.estimate_sum = stays * joint.estimate_sum + (1.0 - stays) * quotient
            joint.estimate_weight = stays * joint.estimate_weight + (1.0 - stays)
            joint.estimate_period = elapsed
            joint.estimate_position = position[j]
            joint.estimate_stamp = stamp
        joint.estimated = int(np.isnan(velocity[j]))
        if joint.estimated:
            ready = (
                joint.estimate_weight > 0.0
                and (stamp - joint.estimate_since) / 1e9 >= shared.filter_time
            )
            velocity[j] = joint.estimate_sum / joint.estimate_weight if ready else np.nan
    return codes.STATE


@kernel
def _continues(memory, j, elapsed, unstamped, outcome):
    """Whether an estimate goes on: no restart, no other clock, no jump, no pause."""
    joint = memory.joints[j]
    moved = outcome.moved > 0 and memory.scratch[FAR, j] > 0.0
    if not joint.estimate_known or joint.unstamped != unstamped or moved or elapsed < 0:
        return False
    longest = joint.span if np.isfinite(joint.span) else 0.0
    return elapsed <= max(longest, PERIODS * joint.estimate_period)


@kernel
def _estimate_step(joint, position):
    """Return the step of a position, of an angle that wraps the shorter way."""
    step = position - joint.estimate_position
    return _wrap_angle(step) if joint.turns else step


@kernel
def _plausible(effort, largest, outcome):
    """Return an effort, or NaN for one that is implausible, which is an event."""
    if abs(effort) > largest:
        outcome.events |= codes.IMPLAUSIBLE_EFFORT
        return np.nan
    return effort


@kernel
def _store_joints(memory, indices, position, velocity, effort, stamp, unstamped, outcome):
    """Store the values of joints."""
    for j in indices:
        joint = memory.joints[j]
        joint.position = position[j]
        joint.velocity = velocity[j]
        joint.effort = _plausible(effort[j] * joint.factor, joint.strongest, outcome)
        joint.stamp = stamp
        joint.unstamped = unstamped
        joint.known = 1


@kernel
def _store_followers(memory, indices, position, velocity, effort, stamp, outcome):
    """Store values of followers and compare their positions."""
    for j in indices:
        follower = memory.followers[j - len(memory.joints)]
        follower.position = position[j]
        follower.velocity = velocity[j]
        follower.effort = _plausible(effort[j] * follower.factor, MAX_EFFORT, outcome)
        follower.stamp = stamp
        source = memory.joints[follower.source]
        is_stale = not source.known or abs(source.stamp - stamp) > source.span
        if follower.body or is_stale or not np.isfinite(position[j]):  # bodies: see _close_loops
            continue
        expected = follower.multiplier * source.position + follower.offset
        _compare_follower(memory, follower, expected, outcome)


@kernel
def _compare_follower(memory, follower, expected, outcome):
    """Store the positions of a follower that disagree; forget those of an earlier message."""
    distance = abs(follower.position - expected)
    tolerance = memory.shared[0].tolerance
    distance = abs(_wrap_angle(distance)) if follower.turns else distance
    if tolerance == 0.0 or not distance > tolerance:
        return
    if not outcome.events & codes.DISAGREES:
        outcome.events |= codes.DISAGREES
        for f in range(len(memory.followers)):
            memory.followers[f].own = np.nan
    follower.own = follower.position
    follower.expected = expected


@kernel
def _assemble(memory, batch, k):
    """Make up the state of all joints; return its code."""
    outcome = batch.outcome[k]
    joints = memory.joints
    newest = joints[0].stamp
    oldest = joints[0].stamp
    for j in range(len(joints)):
        if not joints[j].known:
            return codes.INCOMPLETE
        newest = max(newest, joints[j].stamp)
        oldest = min(oldest, joints[j].stamp)
    for j in range(len(joints)):
        if newest - joints[j].stamp > joints[j].span:
            outcome.joint = j
            outcome.first = joints[j].span * 1e-9
            return codes.STALE_JOINT
    if memory.shared[0].estimate:
        for j in range(len(joints)):
            if np.isnan(joints[j].velocity):
                return codes.AWAITING_VELOCITY
    outcome.newest = newest
    outcome.oldest = oldest
    outcome.with_effort = 1
    for j in range(len(joints)):
        if not np.isfinite(joints[j].velocity):
            outcome.joint = j
            outcome.first = joints[j].velocity
            return codes.NO_VELOCITY
        batch.states[0, k, j] = joints[j].position
        batch.states[1, k, j] = joints[j].velocity
        batch.states[2, k, j] = joints[j].effort
        outcome.received |= joints[j].unstamped
        outcome.estimated |= joints[j].estimated
        outcome.with_effort &= int(np.isfinite(joints[j].effort))
    for f in range(len(memory.followers)):
        follower = memory.followers[f]
        if follower.body == 0:
            batch.states[2, k, follower.source] += follower.multiplier * _fresh_effort(
                follower, newest
            )
    if memory.shared[0].robot:
        return _close_loops(memory, batch.states[0, k], batch.states[2, k], outcome)
    return codes.STATE


@kernel
def _fresh_effort(follower, newest):
    """Return the effort of a follower, 0 if it is stale or unknown."""
    fresh = abs(newest - follower.stamp) <= follower.span and np.isfinite(follower.effort)
    return follower.effort if fresh else 0.0


@large_kernel
def _close_loops(memory, position, effort, outcome):
    """Reflect efforts of followers with changing ratios and compare their positions.

    Return the code of an open loop. Positions are compared with those of the same stamp.
    """
    shared = memory.shared[0]
    n = len(position)
    q = memory.scratch[VALUES]
    for j in range(n):
        q[shared.nq - n + j] = position[j]
    status = call_address(shared.follow, (shared.robot, address_of(q), shared.ratios, 0))
    if status != 0:
        outcome.joint = n + len(memory.followers) + (-status) % 1000
        return codes.OPEN_LOOP
    table = _matrix_at(shared.ratios, (shared.bodies, 1 + 2 * shared.nv))
    for f in range(len(memory.followers)):
        follower = memory.followers[f]
        row = table[memory.followers[f].body]
        if follower.body == 0:
            continue
        for j in range(n):
            effort[j] += row[1 + shared.nv - n + j] * _fresh_effort(follower, outcome.newest)
        if follower.stamp == outcome.newest:
            _compare_follower(memory, follower, row[0], outcome)
    return codes.STATE


@kernel
def _complete_by_base(shared, outcome):
    """Return the code of a state whose base is that of the newest odometry."""
    if shared.restarted and shared.base_stamp > outcome.newest + SECOND:
        shared.base_stamp = -1  # it is of the time before the restart
    shared.restarted = 0
    if shared.base_stamp < 0:
        return codes.BEFORE_ODOMETRY
    apart = abs(outcome.newest - shared.base_stamp)
    if apart > ODOM_TIMEOUT:
        outcome.first = apart * 1e-9
        outcome.second = ODOM_TIMEOUT * 1e-9
        return codes.STALE_ODOMETRY
    outcome.newest = max(outcome.newest, shared.base_stamp)
    outcome.oldest = min(outcome.oldest, shared.base_stamp)
    outcome.received |= shared.base_unstamped
    return codes.STATE
