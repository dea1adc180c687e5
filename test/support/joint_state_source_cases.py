# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rules of the decision table on two sources of one topic: a driver, and joint_state_publisher or another robot."""

import math

from joint_state_messages import MS, NOW
from joint_state_steps import INTERLEAVED, case, whole


def _driver(time, outcome="published", *, amplitude=0.7, **more):
    """Step of a robot in motion, `time` [ns] after NOW."""
    t = time * 1e-9
    values = {
        "position": [amplitude * math.sin(3 * t + k + 1) for k in range(3)],
        "velocity": [3 * amplitude * math.cos(3 * t + k + 1) for k in range(3)],
    }
    return whole(NOW + time, outcome, effort=[], **values, **more)


def _pose(time, outcome="published", *, pose=(0, 0, 0), velocity=(0, 0, 0), **more):
    """Step of a source that always says the same, `time` [ns] after NOW."""
    words = ("in turns",) if outcome == INTERLEAVED or more.get("also") == INTERLEAVED else ()
    return whole(NOW + time, outcome, *words, position=list(pose), velocity=list(velocity), effort=[], **more)


def _both(*steps):
    """Steps in the order of time, those of one stamp in the order of the arguments."""
    return sorted((step for some in steps for step in some), key=lambda step: step[0])


def _at(times, make, *first, then):
    """Steps at some times with their outcomes, in pairs of time and step."""
    outcomes = [*first, *[then] * len(times)]
    return [(time, make(time, **one)) for time, one in zip(times, outcomes, strict=False)]


def _in_turns(*steps):
    return [step for _, step in _both(*steps)]


GOOD, JUMP, ELSEWHERE, MOVED = {}, {"outcome": "jump"}, {"outcome": INTERLEAVED}, {"also": "positions jumped"}
BARE, NAMED = {"outcome": "no velocity"}, {"outcome": "no velocity", "also": INTERLEAVED}
EACH = range(0, 2000 * MS, 10 * MS)
"""Stamps of the driver, less NOW."""


def _bare(time, **more):
    return _pose(time, velocity=(), **more)


def _posed(time, **more):
    return _pose(time, pose=(0.5, -0.4, 0.3), **more)


def _near(time, **more):
    return _driver(time, amplitude=0.02, **more)


SOURCES = {
    "zeros without velocities after the driver": (
        _at(EACH, _driver, then=GOOD),
        _at([time + 5 * MS for time in EACH], _bare, BARE, then=NAMED),
    ),
    "zeros without velocities before the driver": (
        _at([time - 5 * MS for time in EACH], _bare, BARE, then=NAMED),
        _at(EACH, _driver, then=GOOD),
    ),
    "zeros without velocities at the driver's stamps": (
        _at(EACH, _driver, then=GOOD),
        _at(EACH, _bare, then=NAMED),
    ),
    "zeros after the driver": (
        _at(EACH, _driver, then=GOOD),
        _at([time + 5 * MS for time in EACH], _pose, JUMP, then=ELSEWHERE),
    ),
    "zeros before the driver": (
        _at([time - 5 * MS for time in EACH], _pose, GOOD, JUMP, then=ELSEWHERE),
        _at(EACH, _driver, MOVED, then=GOOD),
    ),
    "zeros and the driver at one stamp": (_at(EACH, _driver, then=GOOD), _at(EACH, _pose, JUMP, then=ELSEWHERE)),
    "the driver and zeros at one stamp": (
        _at(EACH, _pose, GOOD, JUMP, then=ELSEWHERE),
        _at(EACH, _driver, MOVED, then=GOOD),
    ),
    "zeros for long before the driver": (
        _at(range(-1000 * MS, -1, 10 * MS), _pose, then=GOOD),
        _at([time + 5 * MS for time in EACH], _pose, JUMP, then=ELSEWHERE),
        _at(EACH, _driver, MOVED, then=GOOD),
    ),
    "zeros less often than the driver": (
        _at(EACH, _driver, then=GOOD),
        _at(range(5 * MS, 2000 * MS, 100 * MS), _pose, JUMP, then=ELSEWHERE),
    ),
    "zeros more often than the driver": (
        _at(range(0, 2000 * MS, 100 * MS), _driver, GOOD, MOVED, then=GOOD),
        _at(
            range(10 * MS, 2000 * MS, 20 * MS),
            _pose,
            *(JUMP, JUMP, MOVED, GOOD, GOOD),
            then=ELSEWHERE,
        ),
    ),
    "another pose after the driver": (
        _at(EACH, _driver, then=GOOD),
        _at([time + 5 * MS for time in EACH], _posed, JUMP, then=ELSEWHERE),
    ),
    "another pose before the driver": (
        _at([time - 5 * MS for time in EACH], _posed, GOOD, GOOD, then=ELSEWHERE),
        _at(EACH, _driver, JUMP, MOVED, then=GOOD),
    ),
    "zeros beside small motions": (
        _at(EACH, _near, then=GOOD),
        _at([time + 5 * MS for time in EACH], _pose, GOOD, GOOD, then=ELSEWHERE),
    ),
    "small motions at the stamps of zeros": (
        _at(EACH, _near, then=GOOD),
        _at(EACH, _pose, {"also": INTERLEAVED}, {"also": INTERLEAVED}, then=ELSEWHERE),
    ),
    "two robots in motion": (
        _at(EACH, _driver, then=GOOD),
        _at(
            [time + 5 * MS for time in EACH],
            lambda time, **more: _driver(time, amplitude=-0.7, **more),
            JUMP,
            then=ELSEWHERE,
        ),
    ),
}

SOURCE_CASES = [case(name, *_in_turns(*steps), absurd__jump=0.1) for name, steps in SOURCES.items()]
