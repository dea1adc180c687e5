# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Codes of the outcomes of a message, and their causes and texts."""

from diag_dynamics.text import distinct

STATE = 0  # the message completes a state

FOREIGN, FOLLOWERS_ONLY, INCOMPLETE, AWAITING_VELOCITY, BEFORE_ODOMETRY = range(-1, -6, -1)
"""The message is accepted and completes no state."""

(
    MALFORMED,
    DUPLICATE_NAME,
    MALFORMED_STAMP,
    NO_TIME,
    WRONG_LENGTH,
    NO_POSITION,
    POSITION_BOUND,
    VELOCITY_BOUND,
    NO_VELOCITY,
    CLOCK_BEHIND,
    CLOCK_AHEAD,
    FOREIGN_TIME,
    LATE,
    STAMP_FROM_PAST,
    JUMP,
    INTERLEAVED,
    FAST_STEP,
    STALE_JOINT,
    STALE_ODOMETRY,
    OPEN_LOOP,
) = range(1, 21)
"""The message, or the state that it completes, is rejected."""

LAYOUT_ERRORS = (DUPLICATE_NAME, WRONG_LENGTH)
"""Codes whose texts depend on names and lengths alone."""

TIME_JUMPED, MOVED, IMPLAUSIBLE_EFFORT, DISAGREES = 1, 2, 4, 8
"""Events of a message, whatever comes of it."""

STUCK_STILL, STUCK_SLIDES = 1, 2  # kinds of stuck sensors

COUNTS = {
    FOREIGN: "foreign",
    FOLLOWERS_ONLY: "followers only",
    INCOMPLETE: "incomplete",
    AWAITING_VELOCITY: "awaiting velocity",
    BEFORE_ODOMETRY: "before odometry",
}
"""Names of the counts of messages that complete no state."""

EVENTS = {
    TIME_JUMPED: "time jumped back",
    MOVED: "positions jumped",
    IMPLAUSIBLE_EFFORT: "implausible effort",
    DISAGREES: "mimic disagreement",
}
"""Names of the counts of events."""

CAUSES = {
    MALFORMED: "malformed",
    DUPLICATE_NAME: "duplicate name",
    MALFORMED_STAMP: "malformed stamp",
    NO_TIME: "no time",
    WRONG_LENGTH: "wrong length",
    NO_POSITION: "no position",
    POSITION_BOUND: "implausible value",
    VELOCITY_BOUND: "implausible value",
    NO_VELOCITY: "no velocity",
    CLOCK_BEHIND: "stamp from the past",
    CLOCK_AHEAD: "stamp from the future",
    FOREIGN_TIME: "foreign time",
    LATE: "late",
    STAMP_FROM_PAST: "stamp from the past",
    JUMP: "jump",
    INTERLEAVED: "interleaved sources",
    FAST_STEP: "implausible value",
    STALE_JOINT: "stale joint",
    STALE_ODOMETRY: "stale odometry",
    OPEN_LOOP: "open loop",
}
"""Causes of rejections, by which they are counted."""

CLOCK = "{name}: stamp {apart} s {where} this node's clock; expected within {limit} = {bound} s"

TEXTS = {
    MALFORMED_STAMP: "header.stamp is {first:.0f} s and {second:.0f} ns; "
    "expected no less than 0 s and less than 1e9 ns",
    NO_TIME: "header.stamp is zero, and so is the clock: use_sim_time without /clock",
    NO_POSITION: "{name}: position is {first}; expected a finite number",
    POSITION_BOUND: "{name}: position is {value}; expected within {bound} … {upper} "
    "(plausibility.beyond_limits)",
    VELOCITY_BOUND: "{name}: velocity is {value}; expected within ±{bound} "
    "(plausibility.beyond_velocity)",
    NO_VELOCITY: "{name}: velocity is {first}; expected a finite number "
    "(missing_velocity: estimate takes it from positions)",
    LATE: "{name}: stamp {first:.6f} s older than the one before",
    STAMP_FROM_PAST: "{name}: stamp {first:.6f} s older than the one before",
    JUMP: "{step} in {third:g} s; expected a step of no more than {fourth:g} "
    "at velocities of {fifth:g} and {sixth:g} (plausibility.jump)",
    INTERLEAVED: "two sources publish {name} in turns: {step}, "
    "{third:g} s after another source's message",
    FAST_STEP: "{name}: its step to position {first:.9g} is faster than {second:g}",
    STALE_JOINT: "{name} is older than {first:g} s",
    OPEN_LOOP: "{name} cannot be closed at these positions, or is singular there",
    STALE_ODOMETRY: "odom is {value} s away from the joints, more than {bound} s",
}
"""Texts of rejections, with the numbers of an OUTCOME."""


STEP = "{name}: position jumped from {first:.9g} to {second:.9g}"

STUCK_TEXTS = {
    STUCK_STILL: "has a velocity, but a constant position",
    STUCK_SLIDES: "moves, but its velocity is 0",
}


def rejection_text(outcome, labels, limit):
    """Return the text of an OUTCOME with one of CAUSES.

    `limit` names the parameter of the maximum age.
    """
    code = int(outcome["code"])
    numbers = {
        key: float(outcome[key]) for key in ("first", "second", "third", "fourth", "fifth", "sixth")
    }
    name = labels[outcome["joint"]] if len(labels) else ""
    if code in (CLOCK_BEHIND, CLOCK_AHEAD, FOREIGN_TIME):
        where = "behind" if numbers["first"] > 0.0 else "ahead of"
        apart, bound = distinct(abs(numbers["first"]), numbers["second"])
        return CLOCK.format(name=name, apart=apart, where=where, bound=bound, limit=limit)
    bounds = (
        numbers["second"],
        numbers["third"],
        -numbers["second"],
    )  # a velocity has one for each sign
    value, bound, upper, _ = distinct(numbers["first"], *bounds)
    texts = {"value": value, "bound": bound, "upper": upper}
    step = STEP.format(name=name, **numbers)
    return TEXTS[code].format(name=name, step=step, **numbers, **texts)


def stuck_text(kind, joint, more, labels):
    """Return the text on stuck sensors."""
    suffix = f" (and {more} more)" if more else ""
    return f"stuck values: {labels[joint]}{suffix} {STUCK_TEXTS[kind]} (stuck_timeout)"
