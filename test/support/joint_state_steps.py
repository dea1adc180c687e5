# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Notation of the decision table: steps are messages with their expected outcome, cases are steps with parameters."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from joint_state_messages import IN_PLACE, MIMICS, MS, NAMES, NAN, NOW, S, joint_state

OLD = 50 * S
"""A stamp long before NOW."""
PERIOD = 8 * MS


class Step(NamedTuple):
    """A message, its time of reception, and what must come of it."""

    raw: bytes
    outcome: str
    """published, a counter, or "rejected: <cause>"."""
    state: Mapping | None = None
    """Expected fields of the published state."""
    also: tuple = ()
    """Further counters that it raises."""
    words: tuple = ()
    """Parts of the text of the rejection."""
    now: int = NOW
    odometry: bool = False


class Case(NamedTuple):
    """Messages for a robot with some parameters."""

    name: str
    steps: tuple
    parameters: Mapping = MappingProxyType({})
    robot: str = "arm"


OUTCOMES = (
    "published",
    "incomplete",
    "foreign",
    "empty",
    "followers only",
    "awaiting velocity",
    "before odometry",
)


def step(raw, outcome="published", *words, also=(), now=NOW, **state):
    """Return a step; an unknown outcome is the cause of a rejection."""
    known = outcome in OUTCOMES or outcome.startswith(("odometry", "published"))
    also = (also,) if isinstance(also, str) else tuple(also)
    return Step(raw, outcome if known else f"rejected: {outcome}", state or None, also, words, now)


def whole(
    stamp=NOW, outcome="published", *words, names=NAMES, shift=0.0, also=(), now=NOW, **fields
):
    """Step of a message with joints at 1, 2, 3 plus `shift`, velocities ten times and efforts a hundred times as large.

    `fields` replace fields of the message, or, with the prefix ``state_``, of the expected state. By default the state is
    that of the message, and both of its stamps are the message's.
    """
    base = [shift + NAMES.index(name) + 1.0 for name in names]
    sent = {"position": base, "velocity": [10 * x for x in base], "effort": [100 * x for x in base]}
    state = {
        key.removeprefix("state_"): value
        for key, value in fields.items()
        if key.startswith("state_")
    }
    sent |= {key: value for key, value in fields.items() if not key.startswith("state_")}
    if outcome == "published" and set(names) == set(NAMES):
        at = now if stamp == 0 else stamp
        whole_effort = len(sent["effort"]) == 3 and all(map(math.isfinite, sent["effort"]))
        values = {field: _in_order(names, sent[field]) for field in ("position", "velocity")}
        values["effort"] = _in_order(names, sent["effort"]) if whole_effort else None
        state = (
            values
            | {"newest": at, "oldest": at, "received": stamp == 0, "estimated": False}
            | state
        )
    return step(
        joint_state(names, **sent, stamp=stamp), outcome, *words, also=also, now=now, **state
    )


def _in_order(names, values):
    return [values[names.index(name)] for name in NAMES] if len(values) == 3 else None


def hand(stamp=NOW, outcome="followers only", *words, effort=(), also=(), now=NOW, **position):
    """Step of a message with the mimic joints alone, in their places but for those named."""
    position = IN_PLACE | position
    raw = joint_state(tuple(position), position.values(), [NAN] * 3, effort, stamp)
    return step(raw, outcome, *words, also=also, now=now)


def all_of(
    stamp=NOW, *, own=(0, 0, 0), also=(), joints=(100, 200, 300), effort=(100, 200, 300), **position
):
    """Step of a message with joints and mimic joints; `own` are efforts of the latter, `effort` those of the state."""
    position = {"shoulder": 1, "elbow": 2, "wrist": 3} | IN_PLACE | position
    names = ("pinky", "shoulder", "thumb", "elbow", "heel", "wrist")
    velocity = {"shoulder": 10, "elbow": 20, "wrist": 30}
    efforts = dict(zip(NAMES, joints, strict=True)) | dict(zip(MIMICS, own, strict=True))
    values = ([some.get(name, NAN) for name in names] for some in (position, velocity, efforts))
    state = {"position": [1, 2, 3], "velocity": [10, 20, 30], "effort": effort and list(effort)}
    return step(joint_state(names, *values, stamp), also=also, **state)


def positions(
    stamp,
    *values,
    rates=None,
    velocity=(),
    outcome="",
    words=(),
    also=(),
    now=NOW,
    estimated=True,
    names=NAMES,
):
    """Step of a message with positions and perhaps velocities; `rates` are the velocities of the state, if it makes one."""
    state = {} if rates is None else {"velocity": list(rates), "estimated": estimated}
    outcome = outcome or ("awaiting velocity" if rates is None else "published")
    return step(
        joint_state(names, values, velocity, (), stamp),
        outcome,
        *words,
        also=also,
        now=now,
        **state,
    )


def case(name, *steps, robot="arm", **parameters):
    """Return a case; a double underscore in the name of a parameter stands for a dot."""
    parameters = {key.replace("__", "."): value for key, value in parameters.items()}
    return Case(name, steps, parameters, robot)


ARM, GRIPPER = NAMES[:2], NAMES[2:]
PAST, FUTURE, LATE, JUMPED = (
    "stamp from the past",
    "stamp from the future",
    "late",
    "time jumped back",
)
IMPLAUSIBLE = "implausible value"
INTERLEAVED = "interleaved sources"
