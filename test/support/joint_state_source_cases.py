# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rules of the decision table on two sources of one topic: a driver, and joint_state_publisher or another robot."""

import math

from joint_state_messages import MS, NAMES, NOW, joint_state
from joint_state_steps import INTERLEAVED, case, step, whole


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
    return whole(
        NOW + time, outcome, *words, position=list(pose), velocity=list(velocity), effort=[], **more
    )


def _both(*steps):
    """Steps in the order of time, those of one stamp in the order of the arguments."""
    return sorted((step for some in steps for step in some), key=lambda step: step[0])


def _at(times, make, *first, then):
    """Steps at some times with their outcomes, in pairs of time and step."""
    outcomes = [*first, *[then] * len(times)]
    return [(time, make(time, **one)) for time, one in zip(times, outcomes, strict=False)]


def _in_turns(*steps):
    return [step for _, step in _both(*steps)]


GOOD, JUMP, ELSEWHERE, MOVED = (
    {},
    {"outcome": "jump"},
    {"outcome": INTERLEAVED},
    {"also": "positions jumped"},
)
BARE, NAMED = {"outcome": "no velocity"}, {"outcome": "no velocity", "also": INTERLEAVED}
EACH = range(0, 2000 * MS, 10 * MS)
"""Stamps of the driver, less NOW."""


def _bare(time, **more):
    return _pose(time, velocity=(), **more)


def _near(time, **more):
    return _driver(time, amplitude=0.02, **more)


SOURCES = {
    "zeros without velocities after the driver": (
        _at(EACH, _driver, then=GOOD),
        _at([time + 5 * MS for time in EACH], _bare, BARE, then=NAMED),
    ),
    "zeros after the driver": (
        _at(EACH, _driver, then=GOOD),
        _at([time + 5 * MS for time in EACH], _pose, JUMP, then=ELSEWHERE),
    ),
    "zeros before the driver": (
        _at([time - 5 * MS for time in EACH], _pose, GOOD, GOOD, then=ELSEWHERE),
        _at(EACH, _driver, JUMP, MOVED, then=GOOD),
    ),
    "zeros and the driver at one stamp": (
        _at(EACH, _driver, then=GOOD),
        _at(EACH, _pose, JUMP, then=ELSEWHERE),
    ),
    "zeros less often than the driver": (
        _at(EACH, _driver, then=GOOD),
        _at(range(5 * MS, 2000 * MS, 100 * MS), _pose, JUMP, then=ELSEWHERE),
    ),
    "zeros beside small motions": (
        _at(EACH, _near, then=GOOD),
        _at([time + 5 * MS for time in EACH], _pose, GOOD, GOOD, then=ELSEWHERE),
    ),
    "zeros while small motions go on and half a second beyond": (
        _at(EACH[:100], _near, then=GOOD),
        _at([time + 5 * MS for time in EACH], _pose, GOOD, GOOD, *[ELSEWHERE] * 147, then=GOOD),
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


# --- one robot with coarse encoders: no state of it is rejected

COUNT, RATE = 2.0 * math.pi / 4096, 0.229 * math.pi / 30.0
"""Steps of a servo's positions [rad] and velocities [rad/s]."""


def _pick_and_place(time, rest=0.3):
    """Positions and velocities of a robot that goes to and fro between two poses, each way in a second."""
    k, s = divmod(time, 1.0 + rest)
    s = min(s, 1.0)
    way, rate = s**3 * (10 - 15 * s + 6 * s * s), 30 * s * s * (1 - s) ** 2
    way, rate = (way, rate) if k % 2 == 0 else (1 - way, -rate)
    return [x * way for x in (0.6, -0.5, 0.8)], [x * rate for x in (0.6, -0.5, 0.8)]


def _sine(time):
    w = 2 * math.pi
    return [x * math.sin(w * time) for x in (0.5, 0.3, 0.4)], [
        x * w * math.cos(w * time) for x in (0.5, 0.3, 0.4)
    ]


def _held(time):
    """A robot that trembles: encoders count to and fro, and velocities are now and then not 0."""
    k = round(time * 100)
    return [COUNT * (k % 2), 0.2 + COUNT * (k // 2 % 2), 0.1], [RATE * (k % 2), 0.0, 0.0]


def _counted(values, step):
    return [step * round(value / step) for value in values]


def _one_robot(motion, count, velocities):
    """Steps of one robot, without efforts, all accepted."""
    steps = []
    for k in range(count):
        position, velocity = motion(0.01 * k)
        sent = (
            _counted(velocity, RATE)
            if velocities == "all" or (velocities == "some" and k % 3)
            else []
        )
        raw = joint_state(NAMES, _counted(position, COUNT), sent, (), NOW + 10 * k * MS)
        steps.append(step(raw, "published" if k or sent else "awaiting velocity"))
    return steps


COARSE_CASES = [
    case(
        f"one robot, {motion.__name__[1:]}, with {velocities} velocities, {missing}",
        *_one_robot(motion, 400, velocities),
        plausibility__jump=0.1,
        missing_velocity=missing,
        velocity_filter_time=0.0,
    )
    for motion in (_pick_and_place, _sine, _held)
    for velocities, missing in (
        ("all", "reject"),
        ("all", "estimate"),
        ("some", "estimate"),
        ("no", "estimate"),
    )
]

SOURCE_CASES = [
    *(case(name, *_in_turns(*steps), plausibility__jump=0.1) for name, steps in SOURCES.items()),
    case(
        "sources are not told apart without a bound of jumps",
        *_in_turns(_at(EACH[:20], _driver, then=GOOD), _at(EACH[:20], _bare, then=BARE)),
        plausibility__jump=0.0,
    ),
    case(
        "garbage at home is not another source",
        *(_pose(10 * k * MS) for k in range(5)),
        _pose(50 * MS, "jump", pose=(1.5, 1.5, 1.5), velocity=(0.3, 0.3, 0.3)),
        *(_pose(10 * k * MS) for k in range(6, 10)),
        plausibility__jump=0.1,
    ),
]
