# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrays that the rules of joint states work on.

They are options, memory of joints and followers, layouts, messages and outcomes.

Times are in nanoseconds, but for `filter_time` and `lasting` [s]. A flag is 0 or 1. A stamp of −1
is none.
"""

from typing import NamedTuple

import numba
import numpy as np
from numba import types


def _record(*groups):
    """Return a dtype of groups of fields, each a kind and names."""
    return np.dtype([(name, kind) for kind, names in groups for name in names.split()])


SHARED = _record(
    ("i8", "max_age refuse_foreign estimate"),  # options; 0: not judged
    ("f8", "filter_time slack tolerance"),
    ("i8", "stuck_timeout stuck_step"),
    ("i8", "needs_base base_stamp base_unstamped"),  # of a floating base
    ("i8", "restarted"),  # whether time restarted since the last state
    ("i8", "in_step"),  # whether stamps agree with the clock; −1 before that is known
    ("i8", "apart"),  # clock less the last accepted stamp that was compared with it
    (
        "i8",
        "refused refused_at refused_apart",
    ),  # by the clock: whether, when, and the distance then
    (
        "i8",
        "robot follow ratios",
    ),  # of followers with changing ratios, or 0: addresses for sweeps.followers.positions
    ("i8", "bodies nq nv"),  # of that robot
    (
        "i8",
        "stuck_last stuck_kind stuck_joint stuck_more",
    ),  # last state that was compared, and its stuck sensors
)
"""One element."""

JOINT = _record(
    ("f8", "lower upper fastest"),  # rules: bounds of position and velocity
    ("f8", "factor strongest"),  # of efforts; NaN for efforts that cannot be used
    (
        "f8",
        "reach lasting",
    ),  # velocity limit, 0 for none, and longest time over which a step is judged
    ("i8", "turns"),  # whether the position is an angle that wraps
    ("f8", "span"),  # age limit, infinite for none
    ("f8", "position velocity effort"),  # newest values
    (
        "i8",
        "stamp known unstamped estimated",
    ),  # unstamped: a time of reception stands for the stamp
    ("f8", "other_position other_velocity"),  # candidate: a pose that was rejected
    ("i8", "other_stamp other_count"),  # its stamp, and messages in a row that agree with it
    ("i8", "interleaved"),  # whether it came again between accepted messages
    ("i8", "late_first late_last late_count"),  # stamps older than the one before
    ("i8", "estimate_known estimate_stamp estimate_since"),  # estimator of velocities
    ("f8", "estimate_position estimate_sum estimate_weight estimate_period"),
    ("i8", "still_fast still_since zero_since slides"),  # stuck sensors
    ("f8", "still_position zero_position"),
)
"""An element for each independent joint."""

FOLLOWER = _record(
    ("i8", "source turns"),  # rules: index of the joint that it follows
    ("i8", "body"),  # its first one if its ratios change, else 0
    ("f8", "multiplier offset factor span"),
    ("f8", "position velocity effort"),
    ("i8", "stamp"),
    ("f8", "own expected"),  # positions that disagreed last; NaN where they agreed
)
"""An element for each follower."""

ERROR, JOINT_COUNT, COUNT, BEGIN = range(4)
HEAD = BEGIN + 3
"""Columns of a layout: 0, DUPLICATE_NAME or WRONG_LENGTH, the number of joints, and that of joints
and followers. Then come the places in `Batch.numbers` where positions, velocities and efforts
begin, the indices of joints and followers, and the place of each in these fields."""

UNUSED = -1
"""Begin of a field that is not used."""

MESSAGE = _record(("i8", "sec nanosec now layout"))
"""One element for each message.

`now` is the time of reception. `layout` is a place, UNREADABLE or FORGET.
"""

UNREADABLE, FORGET = -1, -2  # bytes that are no joint state; no message, but to forget all joints

OUTCOME = _record(
    ("i8", "code events stuck_kind"),  # codes.py
    ("i8", "newest oldest with_effort received estimated"),  # of a state
    ("i8", "joint"),  # that a text is on; followers come after joints
    ("i8", "moved"),  # 1 and the joint of the event MOVED, and its positions
    ("f8", "moved_from moved_to"),
    ("f8", "first second third fourth fifth sixth"),  # numbers of a text
    ("i8", "stuck_joint stuck_more"),  # of a comparison with earlier states
)
"""An element for each message."""

SUMMARY = OUTCOME.names[: OUTCOME.names.index("joint")]  # fields that every message is asked for

FAR, VALUES, ROWS = range(3)
"""Rows of the scratch: whether the step of a joint is too far; the positions of joints and
followers, their velocities and efforts, NaN for what the message lacks."""

BASE = 7
"""Coordinates of a floating base, which stand before those of the joints where loops are closed."""


class Memory(NamedTuple):
    """Rules and memory of n joints."""

    shared: np.ndarray
    joints: np.ndarray
    followers: np.ndarray
    scratch: np.ndarray  # (ROWS, …)

    @classmethod
    def create(cls, n, f):
        """Return the memory of n joints and f followers."""
        return cls(
            np.zeros(1, SHARED),
            np.zeros(n, JOINT),
            np.zeros(f, FOLLOWER),
            np.zeros((ROWS, BASE + 3 * (n + f))),
        )


class Batch(NamedTuple):
    """Messages, and what comes of them, with n joints."""

    layouts: np.ndarray  # a row for each list of names and lengths
    messages: np.ndarray
    numbers: np.ndarray  # of each message
    outcome: np.ndarray
    states: (
        np.ndarray
    )  # positions, velocities and efforts, (3, k, n); they count where a state is complete

    @classmethod
    def create(cls, count, layouts, memory, width=0):
        """Return a batch of a number of messages with `width` numbers each."""
        messages = np.zeros(count, MESSAGE)
        outcome = np.zeros(count, OUTCOME)
        rows = np.array(layouts, np.int64).reshape(len(layouts), row_length(memory))
        states = np.empty((3, count, len(memory.joints)))
        return cls(rows, messages, np.zeros((count, width)), outcome, states)


def row_length(memory):
    """Return the length of a layout."""
    return HEAD + 2 * (len(memory.joints) + len(memory.followers))


def layout_row(memory, error, places, begins):
    """Return a row of Batch.layouts; `places` has the place in a message by joint or follower."""
    row = np.zeros(row_length(memory), np.int64)
    indices = sorted(places)
    joints = sum(index < len(memory.joints) for index in indices)
    row[:HEAD] = error, joints, len(indices), *begins
    row[HEAD:].reshape(2, -1)[:, : len(indices)] = indices, [places[index] for index in indices]
    return row


def _array(dtype, ndim):
    return types.Array(numba.from_dtype(np.dtype(dtype)), ndim, "C")


MEMORY_TYPES = *(_array(dtype, 1) for dtype in (SHARED, JOINT, FOLLOWER)), _array(float, 2)
BATCH_TYPES = (
    _array(int, 2),
    _array(MESSAGE, 1),
    _array(float, 2),
    _array(OUTCOME, 1),
    _array(float, 3),
)
