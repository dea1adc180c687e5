# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rules of the decision table on two sources of one topic: a driver, and joint_state_publisher or another robot."""

import math

from joint_state_messages import MS, NOW
from joint_state_steps import INTERLEAVED, case, whole

MOVED = "positions jumped"


def _message(time, outcome, position, velocity):
    also = ()
    if outcome == MOVED:
        outcome, also = "published", MOVED
    words = ("in turns",) if outcome == INTERLEAVED else ()
    values = {"position": position, "velocity": velocity, "effort": []}
    return whole(NOW + time, outcome, *words, also=also, **values)


def _driver(time, outcome, amplitude=0.7):
    """Step of a robot in motion."""
    phases = [3e-9 * time + k for k in (1, 2, 3)]
    position = [amplitude * math.sin(phase) for phase in phases]
    return _message(time, outcome, position, [3 * amplitude * math.cos(x) for x in phases])


def _other_robot(time, outcome):
    return _driver(time, outcome, amplitude=-0.7)


def _zeros(time, outcome):
    return _message(time, outcome, [0, 0, 0], [0, 0, 0])


def _bare_zeros(time, outcome):
    return _message(time, outcome, [0, 0, 0], [])


def _source(step, begin, period, *outcomes):
    """Steps of a source for a second, with their times; the last outcome repeats."""
    times = range(begin * MS, 1000 * MS, period * MS)
    outcomes = [*outcomes, *[outcomes[-1]] * len(times)]
    return [(time, step(time, outcome)) for time, outcome in zip(times, outcomes, strict=False)]


SERVED = _source(_driver, 0, 10, "published")
SOURCES = {
    "zeros without velocities": (
        SERVED,
        _source(_bare_zeros, 5, 10, "jump", INTERLEAVED),
    ),
    "zeros after the driver": (SERVED, _source(_zeros, 5, 10, "jump", INTERLEAVED)),
    "zeros before the driver": (
        _source(_zeros, -5, 10, "published", "published", INTERLEAVED),
        _source(_driver, 0, 10, "jump", MOVED, "published"),
    ),
    "zeros and the driver at one stamp": (SERVED, _source(_zeros, 0, 10, "jump", INTERLEAVED)),
    "zeros less often than the driver": (SERVED, _source(_zeros, 5, 100, "jump", INTERLEAVED)),
    "zeros five times as often as the driver": (
        _source(_driver, 0, 10, "published", MOVED, "published"),
        _source(_zeros, 1, 2, "jump", "jump", MOVED, "published", "published", INTERLEAVED),
    ),
    "two robots in motion": (SERVED, _source(_other_robot, 5, 10, "jump", INTERLEAVED)),
}


def _in_turns(sources):
    timed = [entry for source in sources for entry in source]
    return [step for _, step in sorted(timed, key=lambda entry: entry[0])]


SOURCE_CASES = [
    case(name, *_in_turns(sources), plausibility__jump=0.1, plausibility__beyond_velocity=3.0)
    for name, sources in SOURCES.items()
]
SOURCE_CASES += [
    case(
        "sources are not told apart without a bound of jumps",
        *_in_turns((SERVED[:20], _source(_zeros, 5, 10, "published")[:20])),
        plausibility__jump=0.0,
    ),
    case(
        "garbage that repeats is not believed",
        *(_zeros(10 * k * MS, "published") for k in range(5)),
        _message(50 * MS, "jump", [1.5] * 3, [0.3] * 3),
        _zeros(60 * MS, "published"),
        _message(70 * MS, INTERLEAVED, [1.5] * 3, [0.3] * 3),
        _zeros(80 * MS, "published"),
        plausibility__jump=0.1,
    ),
]
