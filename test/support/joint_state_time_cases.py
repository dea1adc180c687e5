# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rules of the decision table on time: order of stamps, clock, age of joints, odometry."""

from joint_state_messages import INF, MS, NAN, NOW, S, joint_state, odometry
from joint_state_steps import (
    ARM,
    FUTURE,
    GRIPPER,
    IMPLAUSIBLE,
    JUMPED,
    LATE,
    OLD,
    PAST,
    case,
    hand,
    step,
    whole,
)

# --- stamps: form and order

SPANS = [
    # parameters; time up to which an older stamp is late [s]
    ({}, 1.0),
    ({"joint_timeout": ["*=0"]}, 1.0),
    ({"joint_timeout": ["*=3"]}, 3.0),
    ({"joint_timeout": ["*=0.2"]}, 1.0),
]

TOO_LATE = [NOW - 900 * MS + k * 125 * MS for k in range(5)]
ORDERS = {
    # stamps after one at NOW; outcomes
    "same stamp": ([NOW], "published"),
    "late, then in order": ([NOW - 1, NOW, NOW - 1], LATE, "published", LATE),
    "confirmed by the same stamp": ([OLD, OLD], PAST, JUMPED),
    "not confirmed after more than a second": ([OLD, OLD + S + 1, OLD + S + 1], PAST, PAST, JUMPED),
    "not confirmed by an older stamp": ([OLD, OLD - 1, OLD], PAST, PAST, JUMPED),
    "five late over half a second": (TOO_LATE, LATE, LATE, LATE, LATE, JUMPED),
    "four late are too few": ([NOW - 900 * MS + k * 200 * MS for k in range(4)], *[LATE] * 4),
    "five late over less than half a second": (
        [TOO_LATE[0] + k * 124 * MS for k in range(5)],
        *[LATE] * 5,
    ),
    "late stamps with a good one between": (
        [*TOO_LATE[:4], NOW, TOO_LATE[4]],
        *[LATE] * 4,
        "published",
        LATE,
    ),
}


def _ordered(stamp, outcome):
    return whole(stamp, also=JUMPED) if outcome == JUMPED else whole(stamp, outcome)


ORDER_CASES = [
    *(
        case(
            f"malformed stamp {stamp}",
            whole(1 * S),
            whole(stamp, "malformed stamp", f"{stamp[0]} s and {stamp[1]} ns"),
        )
        for stamp in ((-1, 0), (-1, S - 1), (-(2**31), 0), (5, S), (0, 2**32 - 1))
    ),
    case(
        "largest stamp",
        whole(NOW),
        *(whole((2**31 - 1) * S + S - 1 - behind) for behind in (7, 1, 0)),
    ),
    case("no stamp: time of reception", whole(0), whole(0, now=NOW + MS), hand(0)),
    case(
        "neither stamp nor clock",
        whole(0, "no time", "/clock", now=0),
        whole(5 * S, now=0),
        hand(0, "no time", now=0),
    ),
    case(
        "time of reception stands for the stamp as long as one joint has none",
        whole(0),
        whole(NOW + 100 * MS, names=("wrist", "elbow"), state_received=True, state_oldest=NOW),
        whole(
            NOW + 100 * MS, names=("shoulder",), state_received=False, state_oldest=NOW + 100 * MS
        ),
    ),
    case(
        "stamps and times of reception are not compared",
        *(
            step
            for k in range(3)
            for step in (whole(0, now=NOW + k * MS), whole(20 * S + k * MS, shift=k))
        ),
        whole(20 * S, LATE),
    ),
    *(
        case(
            f"late up to {span:g} s: {parameters}",
            whole(NOW),
            whole(NOW - 1, LATE, "shoulder"),
            whole(NOW - round(span * S), LATE, f"{span:.6f} s"),
            whole(NOW - round(span * S) - 1, PAST, "shoulder"),
            whole(NOW),
            **parameters,
        )
        for parameters, span in SPANS
    ),
    *(
        case(name, whole(NOW), *map(_ordered, stamps, outcomes))
        for name, (stamps, *outcomes) in ORDERS.items()
    ),
    case(
        "older than other joints is not late",
        whole(NOW),
        whole(NOW + 300 * MS, names=GRIPPER),
        whole(
            NOW + 100 * MS,
            names=ARM,
            shift=1.0,
            state_position=[2, 3, 3],
            state_oldest=NOW + 100 * MS,
        ),
    ),
    case(
        "malformed messages say nothing of the time",
        whole(NOW),
        whole(OLD, PAST),
        whole(NOW, "no position", position=[1, 2, NAN]),
        whole(1 * S, "wrong length", position=[1, 2]),
        whole(OLD, also=JUMPED),
    ),
    case(
        "all joints are forgotten where time jumps back",
        whole(NOW),
        whole(OLD, PAST, "wrist", "50.000000 s", names=GRIPPER),
        whole(OLD, "incomplete", names=GRIPPER, shift=1.0, also=JUMPED),
        whole(OLD, names=ARM, shift=2.0, state_position=[3, 4, 4]),
    ),
    case(
        "the first joint is the source",
        whole(NOW),
        whole(OLD, PAST, names=("wrist", "elbow")),
        whole(OLD, PAST, names=("shoulder", "wrist")),
        whole(OLD, PAST, names=GRIPPER),
        whole(OLD + MS, "incomplete", names=("elbow",), also=JUMPED),
    ),
]

# --- stamps by the clock; max_age is 1 s


def _at(later, behind, outcome="published", *words, **more):
    """Step received `later` [ns] after NOW, with a stamp so far behind that time [ns]."""
    return whole(NOW + later - behind, outcome, *words, now=NOW + later, **more)


SET = 4 * S
CLOCKS = {
    "from the past": [
        _at(0, S),
        _at(S, S + 1, PAST, "shoulder", "1.000000001 s behind", "max_age"),
        _at(S, S),
    ],
    "from the future": [
        _at(0, 0),
        _at(S, -S - 1, FUTURE, "1.000000001 s ahead", "max_age"),
        _at(S, -S),
    ],
    "foreign until well within the bound": [
        _at(0, 40 * S),
        _at(S, 501 * MS),
        _at(2 * S, -3 * S),
        _at(6 * S, 500 * MS),
        _at(7 * S, -S - 1, FUTURE, "max_age"),
    ],
    "a clock set back or ahead": [
        _at(0, 0),
        *(_at(k * S, -SET, FUTURE) for k in range(1, 11)),
        _at(11 * S - 1, -SET, FUTURE),
        _at(11 * S, -SET),
        _at(11 * S + MS, -SET),
    ],
    "ten seconds of another distance begin anew": [
        _at(0, 0),
        _at(S, -SET, FUTURE),
        _at(11 * S, -SET - S - 1, FUTURE),
        _at(21 * S - 1, -SET - S - 1, FUTURE),
        _at(21 * S, -SET - S - 1),
    ],
    "ten seconds by a clock that goes back": [
        _at(0, 0),
        _at(S, -SET, FUTURE),
        _at(-50 * S, -154 * S, FUTURE),
        _at(-40 * S - 1, -154 * S, FUTURE),
        _at(-40 * S, -154 * S),
    ],
    "mimic joints have an age and no order": [
        _at(0, 0),
        hand(NOW - S),
        hand(NOW - S - 1, PAST, "thumb"),
        hand(NOW + S + 1, FUTURE, "thumb"),
    ],
    "before the clock begins and without stamp": [
        whole(50 * S, now=0),
        whole(0, now=7 * S),
        whole(NOW, now=0),
    ],
}

FOREIGN_REFUSED = {
    "refused": [
        _at(0, S + 1, "foreign time", "shoulder", "max_age"),
        _at(0, -S - 1, "foreign time"),
        _at(0, S),
        _at(0, 95 * S, PAST, "max_age"),
    ],
    "refused for ever": [_at(0, 0), *(_at(k * S, -SET, FUTURE) for k in range(1, 25))],
}

CLOCK_CASES = [
    *(case(f"clock: {name}", *steps, max_age=1.0) for name, steps in CLOCKS.items()),
    *(
        case(f"foreign: {name}", *steps, max_age=1.0, foreign_time="reject")
        for name, steps in FOREIGN_REFUSED.items()
    ),
    case("clock: no max_age", _at(0, 0), _at(0, -500 * S), _at(S, -500 * S), foreign_time="reject"),
]

# --- age of joints


def _aged(later, outcome="published", *words, **more):
    """Step of shoulder and elbow so much later than NOW [ns]."""
    more = (
        {"state_position": [1, 2, 3], "state_oldest": NOW} | more
        if outcome == "published"
        else more
    )
    return whole(NOW + later, outcome, *words, names=ARM, **more)


AGE_CASES = [
    case(
        "joint at its timeout and older",
        whole(NOW),
        _aged(500 * MS),
        _aged(500 * MS + 1, "stale joint", "wrist", "0.5 s"),
        whole(
            NOW + 400 * MS,
            names=GRIPPER,
            state_newest=NOW + 500 * MS + 1,
            state_oldest=NOW + 400 * MS,
        ),
    ),
    case("no timeout", whole(NOW), _aged(9000 * S), joint_timeout=["*=0"]),
    case(
        "timeouts of single joints",
        whole(NOW),
        whole(NOW + 2 * S, names=("shoulder",), state_oldest=NOW),
        whole(NOW + 2 * S + 1, "stale joint", "'wrist' is older than 2 s", names=("shoulder",)),
        joint_timeout=["wrist=2", "elbow=0"],
    ),
    case(
        "timeout of all other joints",
        whole(NOW),
        _aged(5 * S),
        _aged(5 * S + 1, "stale joint", "'wrist'"),
        joint_timeout=["elbow=0", "*=5"],
    ),
]

# --- odometry

TWIST = (1, 2, 3, 4, 5, 6)
POSE = [1, 2, 3, 0, 0, 0, 1]


def base(stamp=NOW, outcome="", *words, also=(), now=NOW, **fields):
    """Step of odometry; by default it makes no state."""
    rejected = f"odometry rejected: {outcome}" if outcome else "odometry"
    return step(odometry(stamp, **fields), rejected, *words, also=also, now=now)._replace(
        odometry=True
    )


def _turtle(stamp=NOW, outcome="published", *words, also=(), now=NOW, **state):
    """Step of the joint of the robot with a floating base."""
    state = {"position": [*POSE, 0.3], "velocity": [0] * 6 + [0.4], "effort": [0] * 6 + [7]} | state
    raw = joint_state(("shoulder",), [0.3], [0.4], [7.0], stamp)
    return step(
        raw, outcome, *words, also=also, now=now, **(state if outcome == "published" else {})
    )


BAD_ODOMETRY = {
    "no frame": ({"child": ""}, "child_frame_id is empty", "'trunk'"),
    "frame of a moving link": ({"child": "shoulder_link"}, "'shoulder_link'"),
    "twist infinite": ({"twist": (0, 0, 0, 0, 0, -INF)}, "twist", "finite"),
    "quaternion of zeros": ({"orientation": (0, 0, 0, 0)}, "quaternion", "length 0"),
    "quaternion too short": ({"orientation": (0, 0, 0, 0.98)}, "quaternion", "length 0.98"),
}

ODOMETRY_CASES = [
    case(
        "base and joints",
        _turtle(NOW, "before odometry"),
        base(NOW, twist=TWIST),
        _turtle(NOW + 20 * MS, velocity=[*TWIST, 0.4], newest=NOW + 20 * MS, oldest=NOW),
        base(NOW + 30 * MS, child="/trunk", position=(7, 8, 9)),
        _turtle(
            NOW + 25 * MS,
            position=[7, 8, 9, *POSE[3:], 0.3],
            newest=NOW + 30 * MS,
            oldest=NOW + 25 * MS,
        ),
        robot="floating",
    ),
    *(
        case(
            f"odometry {sign * timeout:g} s away",
            base(NOW),
            _turtle(NOW + sign * round(timeout * 10) * 100 * MS),
            _turtle(NOW + sign * (round(timeout * 10) * 100 * MS + 1), "stale odometry", "odom"),
            odom_timeout=timeout,
            robot="floating",
        )
        for timeout in (0.1, 0.3, 0.7, 5.0)
        for sign in (1, -1)
        if sign > 0 or timeout < 0
    ),
    case("no odom_timeout", base(NOW), _turtle(NOW + 5000 * S), odom_timeout=0.0, robot="floating"),
    *(
        case(
            f"odometry: {name}",
            base(NOW),
            base(NOW + MS, "malformed", "odom", *words, **fields),
            _turtle(),
            robot="floating",
        )
        for name, (fields, *words) in BAD_ODOMETRY.items()
    ),
    case(
        "implausible odometry",
        base(position=(100, -100, 0), twist=(10, 0, 0, 0, -10, 0)),
        base(NOW + 1, IMPLAUSIBLE, "position", "±100", position=(0, -100.1, 0)),
        base(NOW + 1, IMPLAUSIBLE, "twist", "±10", twist=(0, 0, 10.1, 0, 0, 0)),
        base(NOW + 1, IMPLAUSIBLE, "twist", twist=(0, 0, 0, 0, 0, -10.1)),
        plausibility__position=100.0,
        plausibility__velocity=10.0,
        robot="floating",
    ),
    case(
        "order of odometry",
        base(NOW),
        base(NOW - 1, LATE),
        base(NOW - S, LATE, "1.000000 s"),
        base(NOW - S - 1, PAST),
        base(NOW),
        base(OLD, PAST),
        base(OLD + S, also=JUMPED),
        *(base(OLD + 200 * MS * k, LATE) for k in range(1, 5)),
        base(OLD + 900 * MS, also=JUMPED),
        robot="floating",
    ),
    case(
        "stamps of odometry that are none",
        base((-1, 0), "malformed stamp"),
        base(0, "no time", now=0),
        base(0),
        _turtle(NOW, received=True),
        base(1, position=(7, 8, 9)),
        _turtle(NOW, position=[7, 8, 9, *POSE[3:], 0.3], received=False, oldest=1),
        base(0, now=NOW - MS),
        odom_timeout=0.0,
        robot="floating",
    ),
    case(
        "odometry by the clock",
        base(5 * S),
        base(NOW),
        base(NOW - S - 1, PAST, "max_age"),
        base(NOW + S + 1, FUTURE, "max_age"),
        max_age=1.0,
        robot="floating",
    ),
    case(
        "foreign odometry refused",
        base(5 * S, "foreign time", "max_age"),
        base(NOW),
        base(5 * S, PAST),
        max_age=1.0,
        foreign_time="reject",
        robot="floating",
    ),
    case(
        "after the joints' time jumped back the base has to come anew",
        base(NOW),
        _turtle(NOW + 50 * S, oldest=NOW),
        _turtle(5 * S, PAST),
        _turtle(5 * S, "before odometry", also=JUMPED),
        base(4 * S),
        _turtle(5 * S, oldest=4 * S),
        odom_timeout=0.0,
        robot="floating",
    ),
    case(
        "a robot that is all base",
        base(NOW, twist=TWIST)._replace(
            outcome="published from odometry",
            state={"position": POSE, "velocity": list(TWIST), "effort": None},
        ),
        base(NOW - 1, LATE),
        robot="brick",
    ),
]
