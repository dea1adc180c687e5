# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrays that the rules of joint states work on: options, memory of joints and followers, layouts, messages, outcomes.

Times are in nanoseconds. A flag is an int64 of 0 or 1.
"""

from typing import NamedTuple

import numba
import numpy as np
from numba import types

SHARED = np.dtype(
    [
        ("max_age", "i8"),  # options: largest distance of a stamp from the clock, 0 for any
        ("refuse_foreign", "i8"),
        ("estimate", "i8"),  # whether missing velocities are estimated
        ("filter_time", "f8"),  # [s]
        ("max_velocity", "f8"),  # of estimated velocities
        ("slack", "f8"),  # of steps of positions, 0: not judged
        ("tolerance", "f8"),  # of mimic joints, 0 for any
        ("max_effort", "f8"),  # of followers
        ("frozen_timeout", "i8"),  # 0: not judged
        ("frozen_step", "i8"),
        ("frozen_refused", "i8"),
        ("needs_base", "i8"),  # floating base: whether there is one, its stamp, −1 for none, and age limit
        ("base_stamp", "i8"),
        ("base_unstamped", "i8"),
        ("base_timeout", "i8"),
        ("restarted", "i8"),  # whether time restarted since the last state
        ("in_step", "i8"),  # memory: whether stamps agree with the clock, -1 before that is known
        ("refused", "i8"),  # whether a stamp was rejected by the clock, when, and its distance then
        ("refused_at", "i8"),
        ("refused_apart", "i8"),
        ("lost", "i8"),  # states lost by gaps in stamps
        ("frozen_last", "i8"),  # stamp of the last state that was compared, -1 before there is one
        ("frozen_kind", "i8"),  # FROZEN_… of that state
        ("frozen_joint", "i8"),
        ("frozen_more", "i8"),
    ]
)
"""One element."""

JOINT = np.dtype(
    [
        ("lower", "f8"),  # rules: bounds of positions and velocities
        ("upper", "f8"),
        ("fastest", "f8"),
        ("factor", "f8"),  # of efforts, NaN for efforts that cannot be used
        ("strongest", "f8"),
        ("reach", "f8"),  # velocity limit, 0 for none
        ("lasting", "f8"),  # longest time over which a step is judged [s]
        ("turns", "i8"),  # whether the position is an angle that wraps
        ("span", "f8"),  # age limit, infinite for none
        ("position", "f8"),  # memory: newest values
        ("velocity", "f8"),
        ("effort", "f8"),
        ("stamp", "i8"),
        ("known", "i8"),
        ("unstamped", "i8"),  # whether a time of reception stands for the stamp
        ("estimated", "i8"),
        ("other_position", "f8"),  # candidate: a pose that was rejected
        ("other_velocity", "f8"),
        ("other_stamp", "i8"),
        ("other_since", "i8"),  # stamp and position in force then
        ("other_since_position", "f8"),
        ("other_count", "i8"),  # messages in a row that agree with it, and how often it returned
        ("other_returns", "i8"),
        ("bare_stamp", "i8"),  # source, by its first joint: last message without velocity, and stamp in force then
        ("bare_since", "i8"),
        ("bare_count", "i8"),  # number of its positions
        ("late_first", "i8"),  # source: first and last stamp older than the one before, and their number
        ("late_last", "i8"),
        ("late_count", "i8"),
        ("gap_last", "i8"),  # source: last stamp, -1 for none, and number of intervals
        ("gap_count", "i8"),
        ("estimate_known", "i8"),  # estimator of velocities
        ("estimate_position", "f8"),
        ("estimate_stamp", "i8"),
        ("estimate_since", "i8"),
        ("estimate_sum", "f8"),
        ("estimate_weight", "f8"),
        ("estimate_period", "f8"),
        ("still_position", "f8"),  # stuck sensors
        ("still_fast", "i8"),
        ("still_since", "i8"),
        ("zero_since", "i8"),
        ("zero_position", "f8"),
        ("slides", "i8"),
    ]
)
"""An element for each independent joint."""

FOLLOWER = np.dtype(
    [
        ("source", "i8"),  # rules: index of the joint that it follows
        ("multiplier", "f8"),
        ("offset", "f8"),
        ("turns", "i8"),
        ("factor", "f8"),
        ("span", "f8"),
        ("effort", "f8"),  # memory
        ("stamp", "i8"),
        ("own", "f8"),  # positions that disagreed last: its own, NaN where it agreed, and the expected one
        ("expected", "f8"),
    ]
)
"""An element for each mimic joint."""

LAYOUT = np.dtype(
    [
        ("joints", "i8"),  # numbers of joints and followers in a message
        ("followers", "i8"),
        ("error", "i8"),  # 0, DUPLICATE_NAME or WRONG_LENGTH
    ]
)
"""An element for each list of names and lengths."""

MESSAGE = np.dtype([("sec", "i8"), ("nanosec", "i8"), ("now", "i8"), ("layout", "i8")])
"""An element for each message; `layout` is −1 for bytes that are no joint state, `now` the time of reception."""

OUTCOME = np.dtype(
    [
        ("code", "i8"),  # a code of codes.py
        ("joint", "i8"),  # that it names; followers come after joints
        ("events", "i8"),  # sum of events of codes.py
        ("contradicting", "i8"),  # joint of the event CONTRADICTS of a message without velocity, else −1
        ("moved", "i8"),  # joint of the event MOVED
        ("moved_from", "f8"),
        ("moved_to", "f8"),
        ("first", "f8"),  # numbers that texts of codes.py have
        ("second", "f8"),
        ("third", "f8"),
        ("fourth", "f8"),
        ("fifth", "f8"),
        ("sixth", "f8"),
        ("newest", "i8"),  # of a state: stamps
        ("oldest", "i8"),
        ("with_effort", "i8"),
        ("received", "i8"),
        ("estimated", "i8"),
        ("frozen_kind", "i8"),  # of the comparison with earlier states, 0 without one
        ("frozen_joint", "i8"),
        ("frozen_more", "i8"),
    ]
)
"""An element for each message."""


class Memory(NamedTuple):
    """What rules depend on, for n joints and m followers."""

    shared: np.ndarray
    joints: np.ndarray
    followers: np.ndarray
    bare: np.ndarray
    """Positions of the last message without velocity by its first joint, (n, n)."""
    intervals: np.ndarray
    """Intervals between stamps by the first joint of a message [ns], (n, WINDOW)."""
    scratch: np.ndarray
    """(SCRATCH, max(n, m, WINDOW))"""


class Layouts(NamedTuple):
    """Joints and followers of messages, in the order of their names."""

    sizes: np.ndarray
    joints: np.ndarray
    """Indices of joints, (number of layouts, n)."""
    followers: np.ndarray


class Batch(NamedTuple):
    """Messages: values in the order of the robot's joints, of which those count that the layout lists."""

    messages: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    follower_position: np.ndarray
    follower_effort: np.ndarray


class Outcomes(NamedTuple):
    """What comes of messages. Of those that complete no state, position, velocity and effort mean nothing."""

    outcome: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray


def _array(dtype, ndim):
    return types.Array(numba.from_dtype(np.dtype(dtype)), ndim, "C")


MEMORY_TYPES = *(_array(dtype, 1) for dtype in (SHARED, JOINT, FOLLOWER)), *[_array(float, 2)] * 3
LAYOUT_TYPES = _array(LAYOUT, 1), *[_array(int, 2)] * 2
BATCH_TYPES = _array(MESSAGE, 1), *[_array(float, 2)] * 5
OUTCOME_TYPES = _array(OUTCOME, 1), *[_array(float, 2)] * 3
"""Types of the fields above."""
