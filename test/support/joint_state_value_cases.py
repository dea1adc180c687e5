# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rules of the decision table on values of joints."""

from joint_state_messages import INF, MS, NAMES, NAN, NOW, PI, S, joint_state
from joint_state_steps import (
    ARM,
    GRIPPER,
    IMPLAUSIBLE,
    JUMPED,
    LATE,
    OLD,
    PAST,
    PERIOD,
    all_of,
    case,
    hand,
    positions,
    step,
    whole,
)

# --- names and pieces

NAME_CASES = [
    case(
        "any order of names",
        *(
            whole(NOW + k * MS, names=names, shift=k)
            for k, names in enumerate((NAMES, NAMES[::-1], NAMES[::-1], NAMES))
        ),
    ),
    case(
        "joints of others are ignored whatever their values",
        step(
            joint_state(
                ("lid", "wrist", "shoulder", "wheel", "elbow"),
                (NAN, 3, 1, 1e9, 2),
                (INF, 30, 10, 1e9, 20),
                (NAN, 300, 100, 1e9, 200),
            ),
            position=[1, 2, 3],
            velocity=[10, 20, 30],
            effort=[100, 200, 300],
        ),
        plausibility__position=10.0,
        plausibility__velocity=100.0,
        plausibility__effort=1000.0,
    ),
    *(
        case(
            f"foreign: {names}",
            whole(),
            step(joint_state(names, [NAN] * 5, stamp=(-1, 0)), "foreign" if names else "empty"),
        )
        for names in ((), ("lid",), ("lid", "wheel"))
    ),
    case(
        "big endian",
        *[
            step(
                joint_state(NAMES, [1, 2, 3], [10, 20, 30], [], order=">"),
                position=[1, 2, 3],
                velocity=[10, 20, 30],
            )
        ]
        * 3,
    ),
    case(
        "duplicate joint",
        whole(),
        whole(NOW + MS, "duplicate name", "elbow", names=("elbow", "wrist", "elbow")),
    ),
    case(
        "joints in pieces",
        whole(NOW, "incomplete", names=("elbow",)),
        whole(NOW + 100 * MS, "incomplete", names=("wrist",)),
        whole(
            NOW + 50 * MS,
            names=("shoulder",),
            state_position=[1, 2, 3],
            state_newest=NOW + 100 * MS,
            state_oldest=NOW,
        ),
        whole(
            NOW + 200 * MS,
            names=("elbow",),
            shift=4.0,
            state_position=[1, 6, 3],
            state_velocity=[10, 60, 30],
            state_effort=[100, 600, 300],
            state_newest=NOW + 200 * MS,
            state_oldest=NOW + 50 * MS,
        ),
    ),
]

# --- lengths and numbers that are none

LENGTHS = {
    "short position": ({"position": [1, 2]}, "wrong length", "position has 2", "wrist"),
    "no positions": ({"position": []}, "no position", "shoulder"),
    "position infinite": ({"position": [1, 2, -INF]}, "no position", "wrist"),
    "no velocities": ({"velocity": []}, "no velocity", "shoulder"),
    "velocity infinite": ({"velocity": [10, 20, -INF]}, "no velocity", "wrist"),
}

NUMBER_CASES = [
    *(
        case(
            f"{when}: {name}",
            *[whole()] * (when == "later"),
            whole(NOW + MS, *outcome, **fields),
            whole(NOW + 2 * MS),
        )
        for name, (fields, *outcome) in LENGTHS.items()
        for when in ("at first", "later")
    ),
    *(
        case(
            f"effort {effort}",
            whole(),
            whole(NOW + MS, effort=effort, also=also),
            whole(NOW + 2 * MS),
        )
        for effort, also in (
            ([], ()),
            ([NAN] * 3, ()),
            ([100, NAN, 300], ()),
            ([100, 200, INF], "implausible effort"),
        )
    ),
    case(
        "bytes that are no message",
        whole(),
        step(b"\0\1\0\0 nothing", "malformed"),
        whole(NOW + MS),
    ),
]

# --- plausibility limits


def _values(outcome="published", *words, also=(), **fields):
    """Step of all joints with zeros but for the fields."""
    values = {"position": [0, 0, 0], "velocity": [0, 0, 0], "effort": [0, 0, 0]} | fields
    return whole(NOW + MS, outcome, *words, also=also, **values)


REST = step(joint_state(NAMES, *[[0, 0, 0]] * 3), position=[0, 0, 0], velocity=[0, 0, 0])
POSITION, BEYOND = {"plausibility__position": 2.5}, {"plausibility__beyond_limits": 0.5}
WIDER, NARROWER = ({"plausibility__beyond_limits": x, "plausibility__position": 6} for x in (3, 1))
VELOCITY, TRIPLE = {"plausibility__velocity": 29}, {"plausibility__beyond_velocity": 3}
LEAST = TRIPLE | {"plausibility__velocity": 10}
LIMITS = [
    # parameters, field, values, words of the rejection, if there is one
    (POSITION, "position", [0, -2.5, 2.5]),
    (POSITION, "position", [0, 0, 2.51], "'wrist'", "plausibility.position"),
    (POSITION, "position", [1e7, 0, 0]),  # of a continuous joint
    (BEYOND, "position", [1e7, 4.5, -6.5]),
    (BEYOND, "position", [0, 4.51, 0], "'elbow'", "-5.5 … 4.5"),
    (WIDER, "position", [0, 0, -6.1], "'wrist'"),
    (NARROWER, "position", [0, 5.1, 0], "'elbow'"),
    (VELOCITY, "velocity", [-29, 29, 0]),
    (VELOCITY, "velocity", [0, 0, 29.1], "'wrist'", "plausibility.velocity"),
    (TRIPLE, "velocity", [-18, 9, 1e6]),
    (TRIPLE, "velocity", [0, -9.1, 0], "'elbow'", "±9"),
    (LEAST, "velocity", [10.1, 0, 0], "±10"),
]
LIMIT_CASES = [
    *(
        case(
            f"{field} {values}, {parameters}",
            REST,
            _values(IMPLAUSIBLE if words else "published", *words, **{field: values}),
            **parameters,
        )
        for parameters, field, values, *words in LIMITS
    ),
]

# --- efforts


def _efforts(sent, state, *also):
    return _values(effort=sent, state_effort=state, also=also)


MAX_EFFORT, MULTIPLE = {"plausibility__effort": 1000.0}, {"plausibility__beyond_effort": 4.0}
SCALED = {"effort_scale": ["*=10"], "plausibility__effort": 30.0}
ONE_SCALED = {"effort_scale": ["shoulder=10"], **MULTIPLE}
EFFORTS = [
    # parameters, efforts of the message, efforts of the state (None: unknown)
    (MAX_EFFORT, [1000, 0, -1000], [1000, 0, -1000]),
    (MAX_EFFORT, [1000, 1001, -1000], None),
    ({}, [1e300, -1e300, 0], [1e300, -1e300, 0]),
    (MULTIPLE, [200, 1e9, -400], [200, 1e9, -400]),
    (MULTIPLE, [0, 0, -400.1], None),
    (MULTIPLE | {"plausibility__effort": 100.0}, [100.1, 0, 0], None),
    ({"effort_scale": ["elbow=-0.5", "*=10"]}, [1, 2, 3], [10, -1, 30]),
    (SCALED, [3, -3.1, 3], None),
    (ONE_SCALED, [-20.1, 0, 0], None),
]
UNAVAILABLE = [
    ({"effort_available": ["elbow=false"], "plausibility__effort": 10.0}, [1, INF, 1], None),
    ({"effort_available": ["*=false", "elbow=true"]}, [1, 2, 3], None),
    ({"effort_available": ["*=false", *(f"{name}=true" for name in NAMES)]}, [1, 2, 3], [1, 2, 3]),
]
EFFORT_CASES = [
    *(
        case(f"effort: {sent}, {parameters}", REST, _efforts(sent, state, *also), **parameters)
        for table, unknown in ((EFFORTS, ["implausible effort"]), (UNAVAILABLE, []))
        for parameters, sent, state in table
        for also in ([] if state else unknown,)
    ),
]

# --- mimic joints

DISAGREES = "mimic disagreement"
MIMIC_CASES = [
    case(
        "mimic joints alone",
        hand(),
        whole(NOW),
        hand(NOW + 100 * MS),
        whole(NOW + 50 * MS),
        whole(NOW + 9 * S),
    ),
    *(
        case(
            f"reflected efforts {own}",
            whole(NOW - MS),
            all_of(own=own, effort=effort),
            hand(effort=own),
            whole(state_effort=effort),
        )
        for own, effort in (
            ((0, 0, 0), [100, 200, 300]),
            ((10, 20, 30), [100, 210, 370]),
            ((NAN, 20, 30), [100, 210, 390]),
            ((10, NAN, NAN), [100, 200, 280]),
        )
    ),
    case(
        "effort of the source joint is needed",
        whole(),
        all_of(own=(1, 2, 3), joints=(100, 200, NAN), effort=None),
    ),
    case(
        "scaled and unavailable efforts of mimic joints",
        whole(state_effort=[1000, -100, 3000]),
        all_of(own=(1, 2, 3), effort=[1000, -90, 3090]),
        effort_scale=["elbow=-0.5", "*=10"],
        effort_available=["thumb=false"],
    ),
    case(
        "reflected efforts age",
        hand(effort=[0, 20, 0]),
        whole(NOW + 500 * MS, state_effort=[100, 210, 300]),
        whole(NOW + 500 * MS + 1),
    ),
    case(
        "reflected efforts are forgotten where time jumps back",
        hand(effort=[0, 20, 0]),
        whole(state_effort=[100, 210, 300]),
        whole(OLD, PAST),
        whole(OLD, also=JUMPED),
        joint_timeout=["*=0"],
    ),
    case(
        "not compared with a source joint of before time jumped back",
        whole(NOW),
        whole(OLD, PAST, names=("shoulder",)),
        whole(OLD, "incomplete", names=("shoulder",), also=JUMPED),
        hand(OLD, thumb=9.0),
        joint_timeout=["*=0"],
    ),
    *(
        case(
            f"mimic joint at {heel}",
            whole(),
            all_of(heel=heel, also=[DISAGREES] * apart),
            all_of(NOW + MS),
        )
        for heel, apart in (
            (1.0099, 0),
            (1.0101, 1),
            (0.9901, 0),
            (0.9899, 1),
            (NAN, 0),
            (INF, 0),
            (-INF, 0),
        )
    ),
    case("no mimic_tolerance", whole(), all_of(heel=1e9), mimic_tolerance=0.0),
    *(
        case(
            f"continuous mimic joint at {position:.3f}",
            *[step(raw, also=[DISAGREES] * apart)] * 3,
            robot="wheel",
        )
        for position, apart in ((7.0, 1), (1.0 + 2 * PI, 0), (1.0 - 4 * PI, 0), (INF, 0))
        for raw in (joint_state(("drive", "wheel"), [1.0, position], [0.0, 0.0]),)
    ),
    case(
        "compared with a source joint within its timeout",
        hand(thumb=9.0),
        whole(NOW + S),
        hand(NOW + S, thumb=9.0, also=DISAGREES),
        hand(NOW + 1500 * MS, thumb=9.0, also=DISAGREES),
        hand(NOW + 500 * MS, thumb=9.0, also=DISAGREES),
        hand(NOW + 1500 * MS + 1, thumb=9.0),
        hand(NOW + 500 * MS - 1, thumb=9.0),
    ),
]

# --- jumps of positions; slack 0.1, limits 6, 3 and none, shoulder continuous


def _rest(
    k,
    position=(0, 0, 0),
    outcome="published",
    *words,
    velocity=(0, 0, 0),
    also=(),
    names=NAMES,
    now=NOW,
    **state,
):
    """Step of joints at rest after k periods."""
    values = {"position": list(position), "velocity": list(velocity), "effort": []}
    return whole(
        NOW + k * PERIOD, outcome, *words, names=names, also=also, now=now, **values, **state
    )


STEPS = [
    # step, velocities before and after, periods, explained
    ((0, 0.129, 0), (0, 0), 1, True),  # 0.1 and what 3 rad/s do in 10 ms, the least time
    ((0, -0.131, 0), (0, 0), 1, False),
    ((0, 0, 0.099), (0, 0), 1, True),  # without a limit
    ((0, 0, 0.101), (0, 0), 1, False),
    ((0, 0, 0.299), (-1, 10), 1, True),  # twice the larger velocity
    ((0, 0, -0.299), (10, 0), 1, True),
    ((0, 0, 0.301), (10, -2), 1, False),
    ((2 * PI - 0.15, 0, 0), (0, 0), 1, True),  # continuous
    ((2 * PI - 0.17, 0, 0), (0, 0), 1, False),
    ((0, 2 * PI - 2.3, 0), (0, 0), 1, False),
    ((0, 0, 9.0), (0, 0), 7, True),  # too long ago without a limit
    ((0, 0, 9.0), (0, 0), 6, False),
    ((0, 1.60, 0), (0, 0), 62, False),
    ((3.0, 3.0, 3.0), (0, 0), 63, True),  # too long ago for all
    ((0, 3.0, 0), (0, 0), 0, False),  # at the same stamp
]


def _step_case(position, velocities, periods, explained):
    before, after = ([v] * 3 for v in velocities)
    start = [_rest(0), _rest(1, velocity=before)]
    if explained:
        return *start, _rest(1 + periods, position, velocity=after)
    name = NAMES[max(range(3), key=lambda k: abs(position[k]))]
    refused = _rest(
        1 + periods,
        position,
        "jump",
        f"'{name}': position jumped from 0 to",
        "plausibility.jump",
        velocity=after,
    )
    return *start, refused, _rest(2 + periods)


STEP_CASES = [
    *(
        case(
            f"step {row[0]} in {row[2]} periods at {row[1]}",
            *_step_case(*row),
            plausibility__jump=0.1,
        )
        for row in STEPS
    ),
    case(
        "garbage is never believed",
        _rest(0),
        *(
            step
            for k in range(1, 30, 3)
            for step in (
                _rest(k, (1 + 0.15 * k, 0, 0), "jump"),
                _rest(k + 1, (1 + 0.15 * k, 0, 0), "jump"),
                _rest(k + 2),
            )
        ),
        *(_rest(k, (2 * (-1) ** k, 0, 0), "jump") for k in range(31, 40)),
        plausibility__jump=0.1,
    ),
    case(
        "a jump is believed with the third message that agrees",
        _rest(0),
        _rest(1, (2, 0, 0), "jump"),
        _rest(2, (2.05, 0, 0), "jump"),
        _rest(3, (2.1, 0, 0), also="positions jumped"),
        _rest(4, (0, 1, 0), "jump"),
        plausibility__jump=0.1,
    ),
    case(
        "a jump of one joint leaves others alone",
        _rest(0),
        *(
            step
            for k in range(1, 5)
            for step in (
                _rest(k, [(-1) ** k], "jump", names=GRIPPER, velocity=[0]),
                _rest(
                    k,
                    [0.01 * k] * 2,
                    names=ARM,
                    velocity=[0, 0],
                    state_position=[0.01 * k] * 2 + [0],
                ),
            )
        ),
        _rest(5, (1, 2, 3), "jump"),
        _rest(6, (1, 2, 3), "jump"),
        _rest(7, (1, 2, 3), also="positions jumped"),
        plausibility__jump=0.1,
    ),
    case(
        "after time jumped back nothing is a jump",
        _rest(0),
        _rest(-1000, (2, 2, 2), PAST),
        _rest(-1000, (2, 2, 2), also=JUMPED),
        plausibility__jump=0.1,
    ),
    case(
        "jump where velocities are estimated",
        positions(NOW, 0, 0, 0),
        positions(NOW + PERIOD, 0.08, 0, 0, rates=[10, 0, 0]),
        *(
            positions(
                NOW + k * PERIOD, 0.08, 0.5, 0, outcome="jump", words=("'elbow'", "0 and nan")
            )
            for k in (2, 3)
        ),
        positions(NOW + 4 * PERIOD, 0.08, 0.5, 0, also="positions jumped"),
        positions(NOW + 5 * PERIOD, 0.08, 0.5, 0, rates=[0, 0, 0]),
        plausibility__jump=0.1,
        plausibility__beyond_velocity=3.0,
        missing_velocity="estimate",
        velocity_filter_time=0.0,
    ),
]

# --- velocities that are not sent; a filter of 0.1 s and messages each 10 ms, unless a case says otherwise


def _ramp(first, rates, count, *, begin=NOW, start=(0, 0, 0), ready=10, now=NOW):
    """Steps of a motion of constant velocity, published from the `ready`-th on."""
    return [
        positions(
            begin + k * 10 * MS,
            *(x + v * 0.01 * k for x, v in zip(start, rates, strict=True)),
            rates=rates if k >= ready else None,
            now=now,
        )
        for k in range(first, count)
    ]


ESTIMATES = {
    "only what is missing": [
        *(positions(NOW + k * 10 * MS, k, 0.5 * k, k, velocity=[7, NAN, 9]) for k in range(10)),
        positions(NOW + 100 * MS, 10, 5, 10, velocity=[7, NAN, 9], rates=[7, 50, 9]),
        positions(NOW + 110 * MS, 9, 5.5, 9, velocity=[1, 2, 3], rates=[1, 2, 3], estimated=False),
        positions(NOW + 120 * MS, 10, 6, 9, velocity=[1, NAN, 3], rates=[1, 50, 3]),
    ],
    "an infinite velocity is not missing": [
        positions(
            NOW, 1, 2, 3, velocity=[1, sign * INF, 3], outcome="no velocity", words=("elbow",)
        )
        for sign in (1, -1)
    ],
    "rejected messages are no steps": [
        *_ramp(0, (100, 100, 100), 11),
        positions(NOW, 99, 99, 99, outcome=LATE),
        positions(OLD, 99, 99, 99, outcome=PAST),
        positions(NOW + 110 * MS, 99, 99, NAN, outcome="no position"),
        positions(NOW + 110 * MS, 11, 11, 11, rates=[100, 100, 100]),
    ],
}

ESTIMATE_CASES = [
    *(
        case(f"estimate: {name}", *steps, missing_velocity="estimate", velocity_filter_time=0.1)
        for name, steps in ESTIMATES.items()
    ),
    *(
        case(
            f"a step too fast: {moved}",
            *_ramp(0, (100, 100, 100), 11),
            positions(
                NOW + 110 * MS,
                11,
                10 + moved,
                11,
                outcome=IMPLAUSIBLE,
                words=("'elbow'", "faster than 120"),
            ),
            *_ramp(12, (100, 100, 100), 15),
            missing_velocity="estimate",
            velocity_filter_time=0.1,
            plausibility__velocity=120.0,
        )
        for moved in (5.0, -5.0)
    ),
]
