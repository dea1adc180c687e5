# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Decision table of the rules of joint states: parameters and messages in, states, causes and counters out.

A case lists messages in order, each with its expected outcome. The table holds no code of the library: messages are bytes
written here, parameters have the monitor's names, expected states are numbers. `joint_state_readers.py` runs it.
"""

import math
import struct
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

MS, S = 10**6, 10**9
NOW = 100 * S
"""Stamp of most first messages, and time of reception of all messages unless a case says otherwise."""

NAN, INF, PI = math.nan, math.inf, math.pi
NAMES = ("shoulder", "elbow", "wrist")
LIMITS = {"shoulder": (-INF, INF), "elbow": (-5.0, 4.0), "wrist": (-6.0, 60.0)}
VELOCITY_LIMITS = {"shoulder": 6.0, "elbow": 3.0, "wrist": 0.0}
EFFORT_LIMITS = {"shoulder": 50.0, "elbow": 0.0, "wrist": 100.0}
MIMICS = {"thumb": ("wrist", -2.0, 0.5), "heel": ("elbow", 0.5, 0.0), "pinky": ("wrist", 3.0, -1.0)}
IN_PLACE = {"thumb": -5.5, "heel": 1.0, "pinky": 8.0}
"""Positions of the mimic joints where the joints are at 1, 2, 3."""

BASE_PARAMETERS = MappingProxyType(
    {
        "max_age": 0.0,
        "mimic_tolerance": 0.01,
        "frozen_timeout": 0.0,
        "absurd.position": 0.0,
        "absurd.velocity": 0.0,
        "absurd.effort": 0.0,
        "absurd.beyond_limits": 0.0,
        "absurd.beyond_velocity": 0.0,
        "absurd.beyond_effort": 0.0,
        "absurd.jump": 0.0,
    }
)
"""Parameters of every case: each rule is off unless the case turns it on. joint_timeout is 0.5 s."""


# --- robots


def _link(name, mass=1.0):
    inertia = '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>'
    return f'<link name="{name}"><inertial><origin xyz="0 0 -0.5"/><mass value="{mass}"/>{inertia}</inertial></link>'


def _joint(name, parent, kind="revolute", mimic=""):
    lower, upper = LIMITS.get(name, (-100.0, 100.0))
    of = f'velocity="{VELOCITY_LIMITS.get(name, 0.0)}" effort="{EFFORT_LIMITS.get(name, 0.0)}"'
    of = of if kind == "continuous" else f'lower="{lower}" upper="{upper}" {of}'
    if mimic:
        source, multiplier, offset = mimic
        mimic = f'<mimic joint="{source}" multiplier="{multiplier}" offset="{offset}"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}_link"/>'
        f'<axis xyz="1 0 0"/><limit {of}/>{mimic}</joint>{_link(f"{name}_link")}'
    )


def _robot(*parts):
    return f'<robot name="robot">{_link("trunk")}{"".join(parts)}</robot>'


ROBOTS = {
    "arm": _robot(
        _joint("shoulder", "trunk", "continuous"),
        _joint("elbow", "shoulder_link"),
        _joint("wrist", "elbow_link"),
        *(_joint(name, "wrist_link", mimic=mimic) for name, mimic in MIMICS.items()),
    ),
    "wheel": _robot(
        _joint("drive", "trunk", "continuous"),
        _joint("wheel", "trunk", "continuous", ("drive", 1.0, 0.0)),
    ),
    "floating": _robot(_joint("shoulder", "trunk", "continuous")),
    "brick": _robot(),
}
"""URDF by name. The last two have a floating base, whose state comes from odometry."""

FLOATING = ("floating", "brick")


# --- messages as bytes (CDR, DDS-XTypes 1.3, 7.4.1)


class Writer:
    """Writes primitives, each aligned to its size, and keeps where counts are."""

    def __init__(self, order="<"):
        self.order, self.body, self.counts = order, bytearray(), []

    def put(self, kind, *values):
        """Append numbers of one kind of :mod:`struct`."""
        self.body += bytes(-len(self.body) % struct.calcsize(kind))
        self.body += struct.pack(f"{self.order}{len(values)}{kind}", *values)

    def count(self, number):
        """Append a count, whose place in the message goes to `counts`."""
        self.put("I", number)
        self.counts.append(len(self.body))

    def text(self, text):
        """Append a string."""
        encoded = text.encode() + b"\0"
        self.count(len(encoded))
        self.body += encoded

    def numbers(self, values):
        """Append a sequence of doubles."""
        self.count(len(values))
        if len(values):
            self.put("d", *values)

    def header(self, stamp, frame=""):
        """Append a std_msgs/Header; `stamp` in nanoseconds, or seconds and nanoseconds."""
        sec, nanosec = stamp if isinstance(stamp, tuple) else divmod(stamp, S)
        self.put("i", sec)
        self.put("I", nanosec)
        self.text(frame)

    def encoded(self):
        """Return the message."""
        return (b"\0\1\0\0" if self.order == "<" else b"\0\0\0\0") + bytes(self.body)


def joint_state(names, position=(), velocity=(), effort=(), stamp=NOW, frame="", order="<"):
    """Return the bytes of a sensor_msgs/JointState."""
    writer = Writer(order)
    writer.header(stamp, frame)
    writer.count(len(names))
    for name in names:
        writer.text(name)
    for values in (position, velocity, effort):
        writer.numbers(list(values))
    return writer.encoded()


def odometry(stamp=NOW, position=(1, 2, 3), orientation=(0, 0, 0, 1), twist=(0,) * 6, child="trunk"):
    """Return the bytes of a nav_msgs/Odometry."""
    writer = Writer()
    writer.header(stamp, "odom")
    writer.text(child)
    writer.put("d", *position, *orientation, *[0.0] * 36, *twist, *[0.0] * 36)
    return writer.encoded()


# --- steps


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


OUTCOMES = ("published", "incomplete", "foreign", "followers only", "awaiting velocity", "before odometry")


def step(raw, outcome="published", *words, also=(), now=NOW, **state):
    """Return a step; what is no outcome is the cause of a rejection."""
    known = outcome in OUTCOMES or outcome.startswith(("odometry", "published"))
    also = (also,) if isinstance(also, str) else tuple(also)
    return Step(raw, outcome if known else f"rejected: {outcome}", state or None, also, words, now)


def whole(stamp=NOW, outcome="published", *words, names=NAMES, shift=0.0, also=(), now=NOW, **fields):
    """Step of a message with joints at 1, 2, 3 plus `shift`, velocities ten times and efforts a hundred times as large.

    `fields` replace fields of the message, or, with the prefix ``state_``, of the expected state. By default the state is
    that of the message, and both of its stamps are the message's.
    """
    base = [shift + NAMES.index(name) + 1.0 for name in names]
    sent = {"position": base, "velocity": [10 * x for x in base], "effort": [100 * x for x in base]}
    state = {key.removeprefix("state_"): value for key, value in fields.items() if key.startswith("state_")}
    sent |= {key: value for key, value in fields.items() if not key.startswith("state_")}
    if outcome == "published" and set(names) == set(NAMES):
        at = now if stamp == 0 else stamp
        whole_effort = len(sent["effort"]) == 3 and all(map(math.isfinite, sent["effort"]))
        values = {field: _in_order(names, sent[field]) for field in ("position", "velocity")}
        values["effort"] = _in_order(names, sent["effort"]) if whole_effort else None
        state = values | {"newest": at, "oldest": at, "received": stamp == 0, "estimated": False} | state
    return step(joint_state(names, **sent, stamp=stamp), outcome, *words, also=also, now=now, **state)


def _in_order(names, values):
    return [values[names.index(name)] for name in NAMES] if len(values) == 3 else None


def hand(stamp=NOW, outcome="followers only", *words, effort=(), also=(), now=NOW, **position):
    """Step of a message with the mimic joints alone, in their places but for those named."""
    position = IN_PLACE | position
    raw = joint_state(tuple(position), position.values(), [NAN] * 3, effort, stamp)
    return step(raw, outcome, *words, also=also, now=now)


def all_of(stamp=NOW, *, own=(0, 0, 0), also=(), joints=(100, 200, 300), effort=(100, 200, 300), **position):
    """Step of a message with joints and mimic joints; `own` are efforts of the latter, `effort` those of the state."""
    position = {"shoulder": 1, "elbow": 2, "wrist": 3} | IN_PLACE | position
    names = ("pinky", "shoulder", "thumb", "elbow", "heel", "wrist")
    velocity = {"shoulder": 10, "elbow": 20, "wrist": 30}
    efforts = dict(zip(NAMES, joints, strict=True)) | dict(zip(MIMICS, own, strict=True))
    values = ([some.get(name, NAN) for name in names] for some in (position, velocity, efforts))
    state = {"position": [1, 2, 3], "velocity": [10, 20, 30], "effort": effort and list(effort)}
    return step(joint_state(names, *values, stamp), also=also, **state)


def positions(
    stamp, *values, rates=None, velocity=(), outcome="", words=(), also=(), now=NOW, estimated=True, names=NAMES
):
    """Step of a message with positions and perhaps velocities; `rates` are the velocities of the state, if it makes one."""
    state = {} if rates is None else {"velocity": list(rates), "estimated": estimated}
    outcome = outcome or ("awaiting velocity" if rates is None else "published")
    return step(joint_state(names, values, velocity, (), stamp), outcome, *words, also=also, now=now, **state)


def case(name, *steps, robot="arm", **parameters):
    """Return a case; a double underscore in the name of a parameter stands for a dot."""
    parameters = {key.replace("__", "."): value for key, value in parameters.items()}
    return Case(name, steps, parameters, robot)


ARM, GRIPPER = NAMES[:2], NAMES[2:]
PAST, FUTURE, LATE, JUMPED = "stamp from the past", "stamp from the future", "late", "time jumped back"
ABSURD = "absurd value"


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
        absurd__position=10.0,
        absurd__velocity=100.0,
        absurd__effort=1000.0,
    ),
    *(
        case(f"foreign: {names}", whole(), step(joint_state(names, [NAN] * 5, stamp=(-1, 0)), "foreign"))
        for names in ((), ("lid",), ("lid", "wheel"))
    ),
    case(
        "big endian",
        *[step(joint_state(NAMES, [1, 2, 3], [10, 20, 30], [], order=">"), position=[1, 2, 3], velocity=[10, 20, 30])]
        * 3,
    ),
    case("duplicate joint", whole(), whole(NOW + MS, "duplicate name", "elbow", names=("elbow", "wrist", "elbow"))),
    case(
        "duplicate name of another robot",
        step(joint_state(("wrist", "lid", "lid"), [1, 2, 3], [1, 2, 3]), "duplicate name", "lid"),
    ),
    case(
        "joints in pieces",
        whole(NOW, "incomplete", names=("elbow",)),
        whole(NOW + 100 * MS, "incomplete", names=("wrist",)),
        whole(
            NOW + 50 * MS, names=("shoulder",), state_position=[1, 2, 3], state_newest=NOW + 100 * MS, state_oldest=NOW
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
    "long position": ({"position": [1, 2, 3, 4]}, "wrong length", "position has 4"),
    "short velocity": ({"velocity": [1]}, "wrong length", "velocity", "elbow"),
    "long effort": ({"effort": [1] * 5}, "wrong length", "effort has 5"),
    "no positions": ({"position": []}, "no position", "shoulder"),
    "position NaN": ({"position": [1, NAN, 3]}, "no position", "elbow"),
    "position infinite": ({"position": [1, 2, -INF]}, "no position", "wrist"),
    "no velocities": ({"velocity": []}, "no velocity", "shoulder"),
    "velocity NaN": ({"velocity": [10, NAN, 30]}, "no velocity", "elbow"),
    "velocity infinite": ({"velocity": [10, 20, -INF]}, "no velocity", "wrist"),
}

NUMBER_CASES = [
    *(
        case(
            f"{when}: {name}", *[whole()] * (when == "later"), whole(NOW + MS, *outcome, **fields), whole(NOW + 2 * MS)
        )
        for name, (fields, *outcome) in LENGTHS.items()
        for when in ("at first", "later")
    ),
    case(
        "velocity unknown in a piece",
        whole(NOW, "incomplete", names=GRIPPER, velocity=[]),
        whole(NOW, "no velocity", "wrist", names=ARM),
        whole(NOW, names=GRIPPER, state_position=[1, 2, 3]),
    ),
    *(
        case(f"effort {effort}", whole(), whole(NOW + MS, effort=effort, also=also), whole(NOW + 2 * MS))
        for effort, also in (([], ()), ([NAN] * 3, ()), ([100, NAN, 300], ()), ([100, 200, INF], "absurd effort"))
    ),
    case(
        "effort unknown in a piece",
        whole(),
        whole(NOW, names=GRIPPER, effort=[], state_effort=None),
        whole(NOW, names=ARM, state_effort=None),
        whole(NOW, names=GRIPPER, state_effort=[100, 200, 300]),
    ),
    case("bytes that are no message", whole(), step(b"\0\1\0\0 nothing", "malformed"), whole(NOW + MS)),
]

# --- stamps: form and order

SPANS = [
    # parameters; time up to which an older stamp is late [s]
    ({"joint_timeout": 0.5}, 1.0),
    ({"joint_timeout": 0.0}, 1.0),
    ({"joint_timeout": 3.0}, 3.0),
    ({"joint_timeouts": ["*=3"]}, 3.0),
    ({"joint_timeout": 3.0, "joint_timeouts": ["*=0.2"]}, 1.0),
    ({"joint_timeout": 3.0, "joint_timeouts": ["*=0"]}, 1.0),
]

OLD = 50 * S
TOO_LATE = [NOW - 900 * MS + k * 125 * MS for k in range(5)]
ORDERS = {
    # stamps after one at NOW; outcomes
    "same stamp": ([NOW], "published"),
    "late, then in order": ([NOW - 1, NOW, NOW - 1], LATE, "published", LATE),
    "confirmed by the same stamp": ([OLD, OLD], PAST, JUMPED),
    "confirmed a second later": ([OLD, OLD + S], PAST, JUMPED),
    "not confirmed after more than a second": ([OLD, OLD + S + 1, OLD + S + 1], PAST, PAST, JUMPED),
    "not confirmed by an older stamp": ([OLD, OLD - 1, OLD], PAST, PAST, JUMPED),
    "strays between good stamps": ([OLD, NOW, OLD, NOW + 1, OLD], PAST, "published", PAST, "published", PAST),
    "a late stamp confirms nothing": ([OLD, NOW - 1, OLD], PAST, LATE, PAST),
    "twice": ([OLD, OLD, OLD - 2 * S, OLD - 2 * S], PAST, JUMPED, PAST, JUMPED),
    "five late over half a second": (TOO_LATE, LATE, LATE, LATE, LATE, JUMPED),
    "four late are too few": ([NOW - 900 * MS + k * 200 * MS for k in range(4)], *[LATE] * 4),
    "five late over less than half a second": ([TOO_LATE[0] + k * 124 * MS for k in range(5)], *[LATE] * 5),
    "late stamps that go back begin anew": ([*TOO_LATE[:4], *TOO_LATE[2:]], *[LATE] * 7),
    "late stamps with a good one between": ([*TOO_LATE[:4], NOW, TOO_LATE[4]], *[LATE] * 4, "published", LATE),
    "from the past into what is late": (
        [NOW - 1100 * MS + k * 150 * MS for k in range(5)],
        PAST,
        *[LATE] * 3,
        JUMPED,
    ),
}


def _ordered(stamp, outcome):
    return whole(stamp, also=JUMPED) if outcome == JUMPED else whole(stamp, outcome)


ORDER_CASES = [
    *(
        case(
            f"malformed stamp {stamp}", whole(1 * S), whole(stamp, "malformed stamp", f"{stamp[0]} s and {stamp[1]} ns")
        )
        for stamp in ((-1, 0), (-1, S - 1), (-(2**31), 0), (5, S), (0, 2**32 - 1))
    ),
    case("malformed stamp of mimic joints", hand((-1, 5), "malformed stamp")),
    case("largest stamp", whole(NOW), *(whole((2**31 - 1) * S + S - 1 - behind) for behind in (7, 1, 0))),
    case("stamp of a nanosecond", whole(1)),
    case("no stamp: time of reception", whole(0), whole(0, now=NOW + MS), hand(0)),
    case(
        "neither stamp nor clock", whole(0, "no time", "/clock", now=0), whole(5 * S, now=0), hand(0, "no time", now=0)
    ),
    case(
        "time of reception stands for the stamp as long as one joint has none",
        whole(0),
        whole(NOW + 100 * MS, names=("wrist", "elbow"), state_received=True, state_oldest=NOW),
        whole(NOW + 100 * MS, names=("shoulder",), state_received=False, state_oldest=NOW + 100 * MS),
    ),
    case("times of reception have an order", whole(0), whole(0, LATE, now=NOW - 1), whole(0, PAST, now=NOW - S - 1)),
    case(
        "stamps and times of reception are not compared",
        *(step for k in range(3) for step in (whole(0, now=NOW + k * MS), whole(20 * S + k * MS, shift=k))),
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
    *(case(name, whole(NOW), *map(_ordered, stamps, outcomes)) for name, (stamps, *outcomes) in ORDERS.items()),
    case(
        "late by the joint concerned",
        whole(NOW),
        whole(NOW + 1, names=GRIPPER),
        whole(NOW + 1 - 3 * S, LATE, "wrist", "3.000000 s"),
        whole(NOW - 3 * S, PAST, "wrist"),
        joint_timeout=2.0,
        joint_timeouts=["wrist=3"],
    ),
    case(
        "older than other joints is not late",
        whole(NOW),
        whole(NOW + 300 * MS, names=GRIPPER),
        whole(NOW + 100 * MS, names=ARM, shift=1.0, state_position=[2, 3, 3], state_oldest=NOW + 100 * MS),
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
        "two sources jump back: each is suspected by itself",
        whole(NOW, "incomplete", names=ARM),
        whole(NOW, names=GRIPPER, state_position=[1, 2, 3]),
        whole(OLD, PAST, "shoulder", names=ARM),
        whole(OLD, PAST, "wrist", names=GRIPPER),
        whole(OLD + MS, "incomplete", names=ARM, also=JUMPED),
        whole(OLD + MS, names=GRIPPER, state_position=[1, 2, 3]),
    ),
    case(
        "one of two sources jumps back",
        whole(NOW),
        whole(OLD, PAST, names=ARM),
        whole(NOW + MS, names=GRIPPER, state_position=[1, 2, 3]),
        whole(OLD + MS, "incomplete", names=ARM, also=JUMPED),
        joint_timeout=0.0,
    ),
    case(
        "the first joint is the source",
        whole(NOW),
        whole(OLD, PAST, names=("wrist", "elbow")),
        whole(OLD, PAST, names=("shoulder", "wrist")),
        whole(OLD, PAST, names=GRIPPER),
        whole(OLD + MS, "incomplete", names=("elbow",), also=JUMPED),
    ),
    *(
        case(f"{name} confirm no jump and refute none", *steps, joint_timeout=0.0)
        for name, steps in {
            "mimic joints": (whole(NOW), whole(OLD, PAST), hand(OLD), whole(OLD + MS, also=JUMPED)),
            "new joints": (
                whole(NOW, "incomplete", names=ARM),
                whole(OLD, PAST, names=ARM),
                whole(OLD, names=GRIPPER, state_position=[1, 2, 3]),
                whole(OLD + MS, "incomplete", names=ARM, also=JUMPED),
            ),
            "joints without stamp": (
                whole(NOW, "incomplete", names=ARM),
                whole(OLD, PAST, names=ARM),
                whole(0, names=GRIPPER, state_received=True),
                whole(OLD + MS, "incomplete", names=ARM, also=JUMPED),
            ),
        }.items()
    ),
]

# --- stamps by the clock; max_age is 1 s


def _at(later, behind, outcome="published", *words, **more):
    """Step received `later` [ns] after NOW, with a stamp so far behind that time [ns]."""
    return whole(NOW + later - behind, outcome, *words, now=NOW + later, **more)


SET = 4 * S
CLOCKS = {
    "in step at the bound": [_at(0, S), _at(2 * S, S), _at(2 * S, -S)],
    "from the past": [_at(0, S), _at(S, S + 1, PAST, "shoulder", "1.000 s behind", "max_age"), _at(S, S)],
    "from the future": [_at(0, 0), _at(S, -S - 1, FUTURE, "1.000 s ahead", "max_age"), _at(S, -S)],
    "foreign from the first on": [_at(0, 72 * S), _at(MS, 72 * S), _at(2 * MS, -72 * S)],
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
    "up to max_age it is the same distance": [_at(0, 0), _at(S, -SET, FUTURE), _at(11 * S, -SET - S)],
    "one stamp in step and the ten seconds begin anew": [
        _at(0, 0),
        _at(S, -SET, FUTURE),
        _at(6 * S, 0),
        _at(11 * S, -SET, FUTURE),
        _at(21 * S - 1, -SET, FUTURE),
        _at(21 * S, -SET),
    ],
    "ten seconds by a clock that goes back": [
        _at(0, 0),
        _at(S, -SET, FUTURE),
        _at(-50 * S, -154 * S, FUTURE),
        _at(-40 * S - 1, -154 * S, FUTURE),
        _at(-40 * S, -154 * S),
    ],
    "rejected by the clock is no suspect": [_at(0, 0), *[_at(0, 90 * S, PAST, "max_age")] * 3],
    "mimic joints have an age and no order": [
        _at(0, 0),
        hand(NOW - S),
        hand(NOW - S - 1, PAST, "thumb"),
        hand(NOW + S + 1, FUTURE, "thumb"),
    ],
    "before the clock begins and without stamp": [whole(50 * S, now=0), whole(0, now=7 * S), whole(NOW, now=0)],
}

FOREIGN_REFUSED = {
    "refused": [
        _at(0, S + 1, "foreign time", "shoulder", "max_age"),
        _at(0, -S - 1, "foreign time"),
        _at(0, S),
        _at(0, 95 * S, PAST, "max_age"),
    ],
    "refused for ever": [_at(0, 0), *(_at(k * S, -SET, FUTURE) for k in range(1, 25))],
    "without a clock": [whole(50 * S, now=0), whole(0, now=7 * S)],
}

CLOCK_CASES = [
    *(case(f"clock: {name}", *steps, max_age=1.0) for name, steps in CLOCKS.items()),
    *(case(f"foreign: {name}", *steps, max_age=1.0, foreign_time="refuse") for name, steps in FOREIGN_REFUSED.items()),
    case("clock: no max_age", _at(0, 0), _at(0, -500 * S), _at(S, -500 * S), foreign_time="refuse"),
    *(
        case(
            f"clock: exactly max_age = {age} ms",
            _at(0, 0),
            *(_at(4 * S, sign * (age * MS + 1), PAST if sign > 0 else FUTURE) for sign in (1, -1)),
            *(_at(4 * S, sign * age * MS) for sign in (1, -1)),
            max_age=age / 1000,
        )
        for age in (9, 300, 700, 1100, 2300)
    ),
    case(
        "recording in a loop",
        *(_at(k * 200 * MS, 90 * S) for k in range(10)),
        _at(2000 * MS, 92 * S, PAST),
        _at(2200 * MS, 92 * S, also=JUMPED),
        _at(2400 * MS, 92 * S),
        max_age=1.0,
    ),
]

# --- age of joints


def _aged(later, outcome="published", *words, **more):
    """Step of shoulder and elbow so much later than NOW [ns]."""
    more = {"state_position": [1, 2, 3], "state_oldest": NOW} | more if outcome == "published" else more
    return whole(NOW + later, outcome, *words, names=ARM, **more)


AGE_CASES = [
    case(
        "joint at its timeout and older",
        whole(NOW),
        _aged(500 * MS),
        _aged(500 * MS + 1, "stale joint", "wrist", "0.5 s"),
        whole(NOW + 400 * MS, names=GRIPPER, state_newest=NOW + 500 * MS + 1, state_oldest=NOW + 400 * MS),
    ),
    case("no timeout", whole(NOW), _aged(9000 * S), joint_timeout=0.0),
    *(
        case(f"exactly {ms} ms", whole(NOW), _aged(ms * MS), _aged(ms * MS + 1, "stale joint"), joint_timeout=ms / 1000)
        for ms in (1, 70, 290, 300, 1001, 1013, 2301)
    ),
    case(
        "timeouts of single joints",
        whole(NOW),
        whole(NOW + 2 * S, names=("shoulder",), state_oldest=NOW),
        whole(NOW + 2 * S + 1, "stale joint", "'wrist' is older than 2 s", names=("shoulder",)),
        joint_timeouts=["wrist=2", "elbow=0"],
    ),
    case(
        "timeout of all other joints",
        whole(NOW),
        _aged(5 * S),
        _aged(5 * S + 1, "stale joint", "'wrist'"),
        joint_timeouts=["elbow=0", "*=5"],
    ),
]

# --- plausibility limits


def _values(outcome="published", *words, also=(), **fields):
    """Step of all joints with zeros but for the fields."""
    values = {"position": [0, 0, 0], "velocity": [0, 0, 0], "effort": [0, 0, 0]} | fields
    return whole(NOW + MS, outcome, *words, also=also, **values)


REST = step(joint_state(NAMES, *[[0, 0, 0]] * 3), position=[0, 0, 0], velocity=[0, 0, 0])
LIMIT_CASES = [
    *(
        case(f"{rule}: {value}", REST, _values(outcome, *words, **value), **parameters)
        for rule, parameters, value, outcome, *words in (
            ("position", {"absurd__position": 2.5}, {"position": [0, -2.5, 2.5]}, "published"),
            ("position", {"absurd__position": 2.5}, {"position": [0, 0, 2.51]}, ABSURD, "'wrist'", "absurd.position"),
            ("position", {"absurd__position": 2.5}, {"position": [0, -2.51, 0]}, ABSURD, "'elbow'", "-2.5 … 2.5"),
            ("position of a continuous joint", {"absurd__position": 2.5}, {"position": [1e7, 0, 0]}, "published"),
            ("limits", {"absurd__beyond_limits": 0.5}, {"position": [1e7, 4.5, -6.5]}, "published"),
            ("limits", {"absurd__beyond_limits": 0.5}, {"position": [0, -5.5, 60.5]}, "published"),
            ("limits", {"absurd__beyond_limits": 0.5}, {"position": [0, 4.51, 0]}, ABSURD, "'elbow'", "-5.5 … 4.5"),
            ("limits", {"absurd__beyond_limits": 0.5}, {"position": [0, -5.51, 0]}, ABSURD, "absurd.beyond_limits"),
            ("narrower", {"absurd__beyond_limits": 3, "absurd__position": 6}, {"position": [0, -6, 0]}, "published"),
            ("narrower", {"absurd__beyond_limits": 3, "absurd__position": 6}, {"position": [0, 0, -6.1]}, ABSURD),
            ("narrower", {"absurd__beyond_limits": 1, "absurd__position": 6}, {"position": [0, 5.1, 0]}, ABSURD),
            ("velocity", {"absurd__velocity": 29}, {"velocity": [-29, 29, 0]}, "published"),
            ("velocity", {"absurd__velocity": 29}, {"velocity": [0, 0, 29.1]}, ABSURD, "'wrist'", "absurd.velocity"),
            ("velocity", {"absurd__velocity": 29}, {"velocity": [-29.1, 0, 0]}, ABSURD, "'shoulder'", "±29"),
            ("infinite velocity", {"absurd__velocity": 29}, {"velocity": [0, INF, 0]}, "no velocity", "elbow"),
            ("velocity limit", {"absurd__beyond_velocity": 3}, {"velocity": [-18, 9, 1e6]}, "published"),
            ("velocity limit", {"absurd__beyond_velocity": 3}, {"velocity": [18.1, 0, 0]}, ABSURD, "±18", "beyond_vel"),
            ("velocity limit", {"absurd__beyond_velocity": 3}, {"velocity": [0, -9.1, 0]}, ABSURD, "'elbow'", "±9"),
            (
                "least",
                {"absurd__beyond_velocity": 3, "absurd__velocity": 10},
                {"velocity": [10.1, 0, 0]},
                ABSURD,
                "±10",
            ),
            ("least", {"absurd__beyond_velocity": 3, "absurd__velocity": 10}, {"velocity": [0, 9.1, 0]}, ABSURD, "±9"),
            ("no bound", {}, {"position": [1e300, -1e300, 0], "velocity": [1e300, -1e300, 0]}, "published"),
        )
    ),
    case("absurd message in pieces", REST, whole(NOW, ABSURD, "'wrist'", names=GRIPPER), absurd__position=2.5),
    case("mimic joints have no bounds", REST, hand(thumb=1e9, also="mimic disagreement"), absurd__position=2.5),
]

# --- efforts


def _efforts(sent, state, *also):
    return _values(effort=sent, state_effort=state, also=also)


EFFORT_CASES = [
    *(
        case(f"effort: {sent}, {parameters}", REST, _efforts(sent, state, *also), **parameters)
        for parameters, sent, state, *also in (
            ({"absurd__effort": 1000.0}, [1000, 0, -1000], [1000, 0, -1000]),
            ({"absurd__effort": 1000.0}, [1000, 1001, -1000], None, "absurd effort"),
            ({"absurd__effort": 1000.0}, [-1001, 1001, INF], None, "absurd effort"),
            ({}, [1e300, -1e300, 0], [1e300, -1e300, 0]),
            ({"absurd__beyond_effort": 4.0}, [200, 1e9, -400], [200, 1e9, -400]),
            ({"absurd__beyond_effort": 4.0}, [200.1, 0, 0], None, "absurd effort"),
            ({"absurd__beyond_effort": 4.0}, [0, 0, -400.1], None, "absurd effort"),
            ({"absurd__beyond_effort": 4.0, "absurd__effort": 100.0}, [100.1, 0, 0], None, "absurd effort"),
            ({"effort_scale": ["elbow=-0.5", "*=10"]}, [1, 2, 3], [10, -1, 30]),
            ({"effort_scale": ["elbow=-0.5"]}, [1, 2, 3], [1, -1, 3]),
            ({"effort_scale": ["*=10"], "absurd__effort": 30.0}, [3, -3, 3], [30, -30, 30]),
            ({"effort_scale": ["*=10"], "absurd__effort": 30.0}, [3, -3.1, 3], None, "absurd effort"),
            ({"effort_scale": ["shoulder=10"], "absurd__beyond_effort": 4.0}, [20, 0, 0], [200, 0, 0]),
            ({"effort_scale": ["shoulder=10"], "absurd__beyond_effort": 4.0}, [-20.1, 0, 0], None, "absurd effort"),
            ({"effort_available": ["elbow=false"], "absurd__effort": 10.0}, [1, INF, 1], None),
            ({"effort_available": ["*=false", "elbow=true"]}, [1, 2, 3], None),
            ({"effort_available": ["*=false", "shoulder=true", "elbow=true", "wrist=true"]}, [1, 2, 3], [1, 2, 3]),
        )
    ),
    case(
        "absurd effort is unknown until the next", REST, _efforts([0, INF, 0], None, "absurd effort"), whole(NOW + MS)
    ),
]

# --- mimic joints

DISAGREES = "mimic disagreement"
MIMIC_CASES = [
    case("mimic joints may be listed", whole(NOW), all_of(NOW + MS), whole(NOW + 2 * MS)),
    case("mimic joints alone", hand(), whole(NOW), hand(NOW + 100 * MS), whole(NOW + 50 * MS), whole(NOW + 9 * S)),
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
        "infinite effort of a mimic joint",
        whole(),
        all_of(own=(0, INF, 1), effort=[100, 200, 303], also="absurd effort"),
    ),
    case("effort of the source joint is needed", whole(), all_of(own=(1, 2, 3), joints=(100, 200, NAN), effort=None)),
    case(
        "absurd efforts count once for each message",
        whole(),
        all_of(own=(2000, 0, 10), effort=[100, 200, 330], also="absurd effort"),
        all_of(own=(2000, 2000, INF), joints=(1e4, 0, -1e4), effort=None, also="absurd effort"),
        absurd__effort=1000.0,
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
        "reflected efforts have a timeout of their own",
        hand(effort=[10, 20, 0]),
        whole(NOW + 2 * S, state_effort=[100, 210, 300]),
        whole(NOW + 2 * S + 1),
        joint_timeouts=["heel=2"],
    ),
    case(
        "reflected efforts are forgotten where time jumps back",
        hand(effort=[0, 20, 0]),
        whole(state_effort=[100, 210, 300]),
        whole(OLD, PAST),
        whole(OLD, also=JUMPED),
        joint_timeout=0.0,
    ),
    case(
        "efforts of mimic joints without positions",
        whole(),
        step(joint_state(("heel",), effort=[20.0]), "followers only"),
        whole(state_effort=[100, 210, 300]),
    ),
    *(
        case(f"mimic joint at {heel}", whole(), all_of(heel=heel, also=[DISAGREES] * apart), all_of(NOW + MS))
        for heel, apart in ((1.0099, 0), (1.0101, 1), (0.9901, 0), (0.9899, 1), (NAN, 0), (INF, 0), (-INF, 0))
    ),
    case("two mimic joints apart count once", whole(), all_of(thumb=-5.6, heel=7.0, pinky=NAN, also=DISAGREES)),
    case("no mimic_tolerance", whole(), all_of(heel=1e9), mimic_tolerance=0.0),
    case("another mimic_tolerance", whole(), all_of(heel=2.0), all_of(heel=2.1, also=DISAGREES), mimic_tolerance=1.0),
    *(
        case(f"continuous mimic joint at {position:.3f}", *[step(raw, also=[DISAGREES] * apart)] * 3, robot="wheel")
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
    case(
        "not compared with a source joint of before time jumped back",
        whole(NOW),
        whole(OLD, PAST, names=("shoulder",)),
        whole(OLD, "incomplete", names=("shoulder",), also=JUMPED),
        hand(OLD, thumb=9.0),
        joint_timeout=0.0,
    ),
    *(
        case(f"malformed mimic joints: {cause}", whole(), step(raw, cause, word))
        for raw, cause, word in (
            (joint_state(("thumb", "heel"), [1.0]), "wrong length", "heel"),
            (joint_state(("thumb", "heel"), effort=[1.0] * 3), "wrong length", "effort"),
            (joint_state(("thumb", "thumb"), [1.0, 2.0]), "duplicate name", "thumb"),
        )
    ),
]

# --- jumps of positions; slack 0.1, limits 6, 3 and none, shoulder continuous

PERIOD = 8 * MS


def _rest(
    k, position=(0, 0, 0), outcome="published", *words, velocity=(0, 0, 0), also=(), names=NAMES, now=NOW, **state
):
    """Step of joints at rest after k periods."""
    values = {"position": list(position), "velocity": list(velocity), "effort": []}
    return whole(NOW + k * PERIOD, outcome, *words, names=names, also=also, now=now, **values, **state)


STEPS = [
    # step, velocities before and after, periods, explained
    ((0, 0.129, 0), (0, 0), 1, True),  # 0.1 and what 3 rad/s do in 10 ms, the least time
    ((0, -0.131, 0), (0, 0), 1, False),
    ((0, 0.219, 0), (0, 0), 5, True),
    ((0, 0.221, 0), (0, 0), 5, False),
    ((0, 0, 0.099), (0, 0), 1, True),  # without a limit
    ((0, 0, 0.101), (0, 0), 1, False),
    ((0, 0, 0.299), (-1, 10), 1, True),  # twice the larger velocity
    ((0, 0, -0.299), (10, 0), 1, True),
    ((0, 0, 0.301), (10, -2), 1, False),
    ((2 * PI - 0.15, 0, 0), (0, 0), 1, True),  # continuous
    ((2 * PI - 0.17, 0, 0), (0, 0), 1, False),
    ((4 * PI + 0.15, 0, 0), (0, 0), 1, True),
    ((0, 2 * PI - 2.3, 0), (0, 0), 1, False),
    ((0, 0, 9.0), (0, 0), 7, True),  # too long ago without a limit
    ((0, 0, 9.0), (0, 0), 6, False),
    ((0, 1.58, 0), (0, 0), 62, True),
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
    refused = _rest(1 + periods, position, "jump", f"'{name}': position went from 0 to", "absurd.jump", velocity=after)
    return *start, refused, _rest(2 + periods)


STEP_CASES = [
    *(case(f"step {row[0]} in {row[2]} periods at {row[1]}", *_step_case(*row), absurd__jump=0.1) for row in STEPS),
    case(
        "garbage is never believed",
        _rest(0),
        *(
            step
            for k in range(1, 30, 3)
            for step in (_rest(k, (1, 0, 0), "jump"), _rest(k + 1, (1, 0, 0), "jump"), _rest(k + 2))
        ),
        *(_rest(k, ((-1) ** k, 0, 0), "jump") for k in range(31, 40)),
        absurd__jump=0.1,
    ),
    case(
        "a jump is believed with the third message that agrees",
        _rest(0),
        _rest(1, (2, 0, 0), "jump"),
        _rest(2, (2.05, 0, 0), "jump"),
        _rest(3, (2.1, 0, 0), also="positions jumped"),
        _rest(4, (0, 0, 0), "jump"),
        absurd__jump=0.1,
    ),
    case(
        "a jump of one joint leaves others alone",
        _rest(0),
        *(
            step
            for k in range(1, 5)
            for step in (
                _rest(k, [(-1) ** k], "jump", names=GRIPPER, velocity=[0]),
                _rest(k, [0.01 * k] * 2, names=ARM, velocity=[0, 0], state_position=[0.01 * k] * 2 + [0]),
            )
        ),
        _rest(5, (1, 2, 3), "jump"),
        _rest(6, (1, 2, 3), "jump"),
        _rest(7, (1, 2, 3), also="positions jumped"),
        absurd__jump=0.1,
    ),
    case(
        "by another clock nothing is a jump",
        _rest(0),
        step(joint_state(NAMES, [2, 2, 2], [0, 0, 0], stamp=0), now=NOW + MS, position=[2, 2, 2]),
        step(joint_state(NAMES, [0, 0, 0], [0, 0, 0], stamp=0), "jump", now=NOW + 2 * MS),
        absurd__jump=0.1,
    ),
    case(
        "after time jumped back nothing is a jump",
        _rest(0),
        _rest(-1000, (2, 2, 2), PAST),
        _rest(-1000, (2, 2, 2), also=JUMPED),
        absurd__jump=0.1,
    ),
    case(
        "jump where velocities are estimated",
        positions(NOW, 0, 0, 0),
        positions(NOW + PERIOD, 0.08, 0, 0, rates=[10, 0, 0]),
        *(positions(NOW + k * PERIOD, 0.08, 0.5, 0, outcome="jump", words=("'elbow'", "0 and nan")) for k in (2, 3)),
        positions(NOW + 4 * PERIOD, 0.08, 0.5, 0, also="positions jumped"),
        positions(NOW + 5 * PERIOD, 0.08, 0.5, 0, rates=[0, 0, 0]),
        absurd__jump=0.1,
        absurd__beyond_velocity=3.0,
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
    "after the filter time": _ramp(0, (2, -3, 0), 13),
    "only what is missing": [
        *(positions(NOW + k * 10 * MS, k, 0.5 * k, k, velocity=[7, NAN, 9]) for k in range(10)),
        positions(NOW + 100 * MS, 10, 5, 10, velocity=[7, NAN, 9], rates=[7, 50, 9]),
        positions(NOW + 110 * MS, 9, 5.5, 9, velocity=[1, 2, 3], rates=[1, 2, 3], estimated=False),
        positions(NOW + 120 * MS, 10, 6, 9, velocity=[1, NAN, 3], rates=[1, 50, 3]),
    ],
    "an infinite velocity is not missing": [
        positions(NOW, 1, 2, 3, velocity=[1, sign * INF, 3], outcome="no velocity", words=("elbow",))
        for sign in (1, -1)
    ],
    "rejected messages are no steps": [
        *_ramp(0, (100, 100, 100), 11),
        positions(NOW, 99, 99, 99, outcome=LATE),
        positions(OLD, 99, 99, 99, outcome=PAST),
        positions(NOW + 110 * MS, 99, 99, NAN, outcome="no position"),
        positions(NOW + 110 * MS, 11, 11, 11, rates=[100, 100, 100]),
    ],
    "anew after a pause": [
        *_ramp(0, (100, 100, 100), 11),
        *_ramp(0, (200, 200, 200), 11, begin=NOW + 600 * MS + 1, start=(60, 60, 60)),
    ],
    "no pause at the timeout": [
        *_ramp(0, (0, 100, 100), 11),
        positions(NOW + 600 * MS, 0, 60, 60, rates=[0, 100, 100]),
    ],
    "repeated stamps count once": [
        positions(NOW + k * 10 * MS, 0.5 * k, -k, 0, rates=[50, -100, 0] if k >= 10 else None)
        for k in range(13)
        for _ in range(3)
    ],
    "anew where time jumps back": [
        *_ramp(0, (100, 100, 100), 11),
        positions(OLD, 500, 500, 500, outcome=PAST),
        positions(OLD, 500, 500, 500, also=JUMPED),
        *_ramp(1, (200, 0, 0), 12, begin=OLD, start=(500, 500, 500)),
    ],
    "anew where stamps begin": [
        *(positions(0, k, k, k, rates=[100] * 3 if k >= 10 else None, now=NOW + k * 10 * MS) for k in range(11)),
        *_ramp(0, (-100, 0, 0), 12, begin=20 * S, start=(10, 0, 0)),
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
            positions(NOW + 110 * MS, 11, 10 + moved, 11, outcome=ABSURD, words=("'elbow'", "faster than 120")),
            *_ramp(12, (100, 100, 100), 23, ready=22),
            missing_velocity="estimate",
            velocity_filter_time=0.1,
            absurd__velocity=120.0,
        )
        for moved in (5.0, -5.0)
    ),
    case(
        "steps of joints with velocities are not judged",
        *(
            positions(NOW + k * 10 * MS, 1, x, 1, velocity=[1, 2, 3], rates=[1, 2, 3], estimated=False)
            for k, x in enumerate((0, 50, 0))
        ),
        missing_velocity="estimate",
        absurd__velocity=120.0,
    ),
    case(
        "no filter: the last two positions",
        positions(NOW, 0, 2, 3),
        positions(NOW + 250 * MS, 1, 2, 2.5, rates=[4, 0, -2]),
        missing_velocity="estimate",
        velocity_filter_time=0.0,
    ),
    case(
        "a continuous joint takes the shorter way",
        positions(NOW, 3.1, 3.1, 3.1),
        positions(NOW + 100 * MS, -3.1, -3.1, 3.1, rates=[10 * (2 * PI - 6.2), -62, 0]),
        missing_velocity="estimate",
        velocity_filter_time=0.0,
    ),
    case(
        "three periods are no pause",
        positions(NOW, 0, 0, 0),
        *(positions(NOW + k * S, 0, 2 * k, k, rates=[0, 2, 1]) for k in (1, 2, 3, 6)),
        positions(NOW + 15 * S + 1, 7, 7, 7),
        positions(NOW + 25 * S + 1, 7, 7, 17, rates=[0, 0, 1]),
        positions(NOW + 60 * S, 7, 7, 17),
        positions(NOW + 70 * S + 1, 7, 7, 17),
        joint_timeout=0.0,
        missing_velocity="estimate",
        velocity_filter_time=0.0,
    ),
    case(
        "velocities are refused", _ramp(0, (2, 2, 2), 1)[0]._replace(outcome="rejected: no velocity"), whole(NOW + MS)
    ),
]

# --- stuck sensors


def _stuck(count, period, position, velocity, outcomes):
    """Steps of functions of time; `outcomes` gives the outcome at each time [s]."""
    return [
        whole(
            NOW + k * period,
            outcomes(1e-9 * k * period),
            *(["shoulder"] if outcomes(1e-9 * k * period) == "frozen" else []),
            position=position(1e-9 * k * period),
            velocity=velocity(1e-9 * k * period),
        )
        for k in range(count)
    ]


def _from(time):
    return lambda t: "frozen" if t > time else "published"


HELD = lambda t: [0.3, t, t]  # noqa: E731
STUCK_CASES = [
    case(
        f"{name} ({action})",
        *_stuck(12, 100 * MS, position, velocity, _from(time) if action == "refuse" else lambda _: "published"),
        *([whole(NOW + 1300 * MS, position=[9, 9, 9], velocity=[1, 1, 1])] if time < 2 else []),
        frozen_timeout=0.5,
        frozen_values=action,
    )
    for name, position, velocity, time in (
        ("a velocity without motion", HELD, lambda t: [0.05, 1, 1], 0.45),
        ("a velocity just too small", HELD, lambda t: [0.0499, 1, 1], INF),
        ("one bit changes", lambda t: [0.3 + 1e-15 * round(10 * t), t, t], lambda t: [1, 1, 1], INF),
        ("at rest", lambda t: [0.3, 0.3, 0.3], lambda t: [0, 0, 0], INF),
        ("motion without velocity", lambda t: [0.11 * t, t, t], lambda t: [0, 1, 1], 0.45),
        ("creeping without velocity", lambda t: [0.09 * t, t, t], lambda t: [0, 1, 1], INF),
    )
    for action in ("warn", "refuse")
]
STUCK_CASES += [
    case(
        "states too far apart say nothing",
        *_stuck(6, 501 * MS, HELD, lambda t: [1, 1, 1], _from(INF)),
        frozen_timeout=0.5,
    ),
]

# --- states lost in a queue

LOST = "lost by gaps in stamps"
KEPT = [k for k in range(40) if k % 8 != 7]
LOST_CASES = [
    case(
        "gaps of one period",
        *(whole(NOW + k * PERIOD, also=[LOST] * (4 * (n == 32))) for n, k in enumerate(KEPT)),
    ),
    case(
        "late messages count",
        *(s for k in range(40) for s in (whole(NOW + k * PERIOD), whole(NOW + k * PERIOD - 1, LATE))),
    ),
    case(
        "unreadable messages are no gaps",
        *(whole(NOW + k * PERIOD) if k % 8 != 7 else step(b"\0\1\0\0 nothing", "malformed") for k in range(60)),
    ),
    case("pauses are no gaps", *(whole(NOW + (k + 200 * (k // 8)) * PERIOD) for k in range(40))),
]

# --- odometry

TWIST = (1, 2, 3, 4, 5, 6)
POSE = [1, 2, 3, 0, 0, 0, 1]


def base(stamp=NOW, outcome="", *words, also=(), now=NOW, **fields):
    """Step of odometry; by default it makes no state."""
    rejected = f"odometry rejected: {outcome}" if outcome else "odometry"
    return step(odometry(stamp, **fields), rejected, *words, also=also, now=now)._replace(odometry=True)


def _turtle(stamp=NOW, outcome="published", *words, also=(), now=NOW, **state):
    """Step of the joint of the robot with a floating base."""
    state = {"position": [*POSE, 0.3], "velocity": [0] * 6 + [0.4], "effort": [0] * 6 + [7]} | state
    raw = joint_state(("shoulder",), [0.3], [0.4], [7.0], stamp)
    return step(raw, outcome, *words, also=also, now=now, **(state if outcome == "published" else {}))


BAD_ODOMETRY = {
    "no frame": ({"child": ""}, "child_frame_id is empty", "'trunk'"),
    "unknown frame": ({"child": "nowhere"}, "'nowhere'"),
    "frame of a moving link": ({"child": "shoulder_link"}, "'shoulder_link'"),
    "position NaN": ({"position": (NAN, 0, 0)}, "position", "finite"),
    "twist infinite": ({"twist": (0, 0, 0, 0, 0, -INF)}, "twist", "finite"),
    "orientation NaN": ({"orientation": (0, 0, 0, NAN)}, "orientation", "finite"),
    "quaternion of zeros": ({"orientation": (0, 0, 0, 0)}, "quaternion", "length 0"),
    "quaternion too long": ({"orientation": (0, 0, 0, 1.02)}, "quaternion", "length 1.02"),
    "quaternion too short": ({"orientation": (0, 0, 0, 0.98)}, "quaternion", "length 0.98"),
}

ODOMETRY_CASES = [
    case(
        "base and joints",
        _turtle(NOW, "before odometry"),
        base(NOW, twist=TWIST),
        _turtle(NOW + 20 * MS, velocity=[*TWIST, 0.4], newest=NOW + 20 * MS, oldest=NOW),
        base(NOW + 30 * MS, child="/trunk", position=(7, 8, 9)),
        _turtle(NOW + 25 * MS, position=[7, 8, 9, *POSE[3:], 0.3], newest=NOW + 30 * MS, oldest=NOW + 25 * MS),
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
    *(
        case(
            f"odometry {ahead} ms ahead of the joints",
            base(NOW + ahead * MS),
            _turtle(NOW, *([] if ahead <= 500 else ["stale odometry"])),
            robot="floating",
        )
        for ahead in (500, 501)
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
    *(
        case(f"quaternion of length {length}", base(orientation=(0, 0, 0, length)), _turtle(), robot="floating")
        for length in (0.991, 1.009)
    ),
    case(
        "absurd odometry",
        base(position=(100, -100, 0), twist=(10, 0, 0, 0, -10, 0)),
        base(NOW + 1, ABSURD, "position", "±100", position=(0, -100.1, 0)),
        base(NOW + 1, ABSURD, "twist", "±10", twist=(0, 0, 10.1, 0, 0, 0)),
        base(NOW + 1, ABSURD, "twist", twist=(0, 0, 0, 0, 0, -10.1)),
        absurd__position=100.0,
        absurd__velocity=10.0,
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
        foreign_time="refuse",
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
            outcome="published from odometry", state={"position": POSE, "velocity": list(TWIST), "effort": None}
        ),
        base(NOW - 1, LATE),
        robot="brick",
    ),
]

TABLE = {
    "names": NAME_CASES,
    "numbers": NUMBER_CASES,
    "order of stamps": ORDER_CASES,
    "clock": CLOCK_CASES,
    "age": AGE_CASES,
    "plausibility": LIMIT_CASES,
    "efforts": EFFORT_CASES,
    "mimic joints": MIMIC_CASES,
    "jumps": STEP_CASES,
    "estimated velocities": ESTIMATE_CASES,
    "stuck sensors": STUCK_CASES,
    "lost states": LOST_CASES,
    "odometry": ODOMETRY_CASES,
}
"""All cases, by rule."""

COUNTERS = sorted(
    {
        counter
        for cases in TABLE.values()
        for one in cases
        for step in one.steps
        for counter in (step.outcome, *step.also)
    }
    - {"odometry"}
)
"""Every counter that the table raises."""

NODE_COUNTERS = (
    "before the model",
    "skipped: overload",
    "odometry skipped: overload",
    "clock jumped back",
    "rejected: InputError",
)
"""Counters that a node alone raises."""


def wiring(counter):
    """Return the shortest case that raises a counter."""
    cases = (one for cases in TABLE.values() for one in cases)
    raising = (one for one in cases if any(counter in (step.outcome, *step.also) for step in one.steps))
    return min(raising, key=lambda one: len(one.steps))


WIRING = {counter: wiring(counter) for counter in COUNTERS}
"""Case by counter: one test of a node's wiring for each."""
