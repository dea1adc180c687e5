# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What columns hold by their names: the rules by which a table needs no map."""

import re
from typing import NamedTuple

from diag_dynamics.tables.column_map import JOINT
from diag_dynamics.tables.names import names_of
from diag_dynamics.tables.units import is_unit, split_unit, word_of_unit

RULES = """
Columns are known by their names, small letters or capitals, by these rules and by nothing else.

1. **Units** in brackets at the end, `q1 [deg]` or `q1 (rad/s)`, or as a word, `q_deg_1`, are taken off and converted.
   In Parquet the metadata of a field may say its `unit`, too. Amperes, ticks, volts and units that are not known need
   a `scale`. No unit: SI.
2. **Not looked at** is what has one of the words target, desired, des, command, commanded, cmd, reference, ref,
   setpoint, goal, error, err, planned, external, acceleration, acc: it was not measured, or is of no use here.
3. **Time** is a column named t, time, times, timestamp, timestamps, time_stamp, stamp, sec, secs, second, seconds,
   elapsed, elapsed_time or unix_time, with or without a unit behind it (`t_ms`, `timestamp_ns`), or one whose name
   ends with `header.stamp`, with dots or slashes. Or two that differ in `sec` and `nanosec` (`secs` and `nsecs`) only.
   Stamps of messages, `header.stamp`, come before other times; of several, those of the topic of the positions.
   `%time`, `__time` and `rosbagTimestamp`, which tools add to a recording, are taken if there is nothing else,
   and then the only column of ISO 8601 times or of a type of times, as an index of pandas, whatever its name.
   `field.header.stamp`, `%time` and `rosbagTimestamp` are nanoseconds.
4. **Quantities** are words that no letter touches: position, positions, pos, q, angle, angles, theta for positions;
   velocity, velocities, vel, qd, dq, qdot, q_dot, speed, speeds for velocities; effort, efforts, eff, tau, torque,
   torques for efforts. current, currents are amperes, and looked at where a column has no other of these words and no
   column has efforts. A column with words of two quantities is not looked at.
5. **Joints** are found in what else is in the name. If the names of the model's joints are in the columns, these are
   the joints: `q_elbow`, `elbow_position`, `/joint_states/elbow/position`, also beside a number: `q0 (elbow)`,
   `q0_elbow`. Otherwise the joints are those that rows, comments or metadata name. Without such names, numbers that
   count up from 0 or 1 are the model's joints in their order, by themselves or behind joint, j or axis: `q1`,
   `pos[0]`, `tau_J[3]`, `joint2_velocity`. There have to be as many as the model has. Without a model, any other text
   is a joint's name: what follows the quantity, or, if the quantity ends the name, the last part before it between
   slashes or dots. x, y, z and w are no joints, and a word before a number in brackets is none: `q_d[0]` is a target.
6. **Whole arrays**, of an npz, as lists in Parquet or as text in brackets, `(0.1, 0.2)`, are a quantity's if their
   name has its word and no joint.
7. Columns that differ in the joint only belong together. If there are two such sets for one quantity, or two columns
   for one joint in the set that is read, or two columns of times, that is an error which lists them. Velocities and
   efforts are those of joints that have positions.
"""
"""As docs/recordings.md has them, too."""

_IGNORED = re.compile(
    r"(?<![a-z])(?:target|desired|des|command|commanded|cmd|reference|ref|setpoint|goal|error|err|planned|external"
    r"|accelerations?|acc)(?![a-z])"
)

_WORDS = {
    "velocity": "velocity velocities vel qd dq qdot q_dot speed speeds",
    "position": "position positions pos q angle angles theta",
    "effort": "effort efforts eff tau torque torques",
    "current": "current currents",
}

_QUANTITY = re.compile(
    "(?<![a-z0-9])(?:"
    + "|".join(
        f"(?P<{name}>{'|'.join(sorted(words.split(), key=len, reverse=True))})" for name, words in _WORDS.items()
    )
    + ")(?![a-z])"
)

_TIME = re.compile(
    r"(?P<name>t|time|times|timestamps?|time_stamp|stamp|secs?|seconds?|elapsed|elapsed_time|unix_time"
    r"|(?:.*[./])?header[./]stamp)(?:_(?P<unit>s|sec|ms|msec|us|usec|µs|ns|nsec|nanosec))?"
)

_LAST_TIMES = {"%time": "ns", "__time": None, "rosbagtimestamp": "ns"}
_NANOSECONDS = {"field.header.stamp"}

_STAMP = re.compile(r"(?:.*[./_ ])?header[./_ ]stamp(?:[./_ ]n?secs?)?")
"""Stamps of messages, beside which other times are those of a tool."""

_PAIR = re.compile(r"(?P<prefix>(?:.*[^a-z])?)(?P<nano>n|nano)?secs?")

_NUMBER = re.compile(r"(?:(?:joints?|j|axis)[^a-z0-9]*)?(?P<number>\d{1,4})")

_NO_JOINTS = {"x", "y", "z", "w"}

_BETWEEN = "_./[]()<>{}|: -\t"
"""What stands between words."""


class Column(NamedTuple):
    """One column of a table, or one array."""

    name: str
    """As in the file."""
    width: int = 0
    """Columns of a whole array; 0 for a column of numbers."""
    unit: str | None = None
    """Where it is said elsewhere than in the name: in a line of units."""
    numeric: bool = True
    """Whether it holds numbers or times at all: no rule takes what does not."""
    sample: tuple = ()
    """Texts of the first rows, or lists of them, of a column without numbers; empty strings where there is none."""
    listed: bool = False
    """Whether each row has a list: of texts, or numbers in a text."""
    dated: bool = False
    """Whether these texts are times."""
    type: str = ""
    """Type of values that are no numbers, for messages."""
    moments: bool = False
    """Whether values are times by themselves: ISO 8601, or of a type of times."""


class Found(NamedTuple):
    """What one column is by its name."""

    quantity: str
    pattern: str
    """Its name, with {joint} for the joint; of a whole array there is none."""
    joint: str
    """As in the name; empty where there is none."""
    number: int | None = None


def unit_of(column, name=None):
    """Unit of a column, or None; `name` is its name without the joint's, which may look like a unit."""
    if column.unit is not None:
        return column.unit
    stem, unit = _stem(column.name if name is None else name)
    if unit is None:
        word = word_of_unit(stem.lower())
        unit = word and word[1]
    return unit


def time_columns(columns):
    """Columns that may be the times: tuples of one index, or of two, by the name under which a message lists them.

    Those that count as last resort are among them only if there are no others.
    """
    first, last, seconds, nanoseconds, moments = {}, {}, {}, {}, {}
    for k, column in enumerate(columns):
        if not (column.numeric or column.dated) or (column.sample and not any(column.sample)):
            continue
        name, _ = split_unit(column.name.strip())
        name = name.lower()
        if name in _LAST_TIMES:
            last[column.name] = (k,)
        elif _TIME.fullmatch(name) or name in _NANOSECONDS:
            first.setdefault(column.name, (k,))
        if column.moments:
            moments[column.name] = (k,)
        if pair := _PAIR.fullmatch(name):
            (nanoseconds if pair["nano"] else seconds).setdefault(pair["prefix"], k)
    for prefix in seconds.keys() & nanoseconds.keys():
        two = seconds[prefix], nanoseconds[prefix]
        first.pop(columns[two[0]].name, None)
        first[" and ".join(columns[k].name for k in two)] = two
    stamps = {name: ks for name, ks in first.items() if _STAMP.fullmatch(columns[ks[0]].name.strip().lower())}
    return stamps or first or last or moments


def unit_of_time(column):
    """Unit of a column of times, or None."""
    name, unit = split_unit(column.name.strip())
    name = name.lower()
    if column.unit or unit:
        return column.unit or unit
    if name in _NANOSECONDS:
        return "ns"
    if name in _LAST_TIMES:
        return _LAST_TIMES[name]
    found = _TIME.fullmatch(name)
    if found:
        return found["unit"]
    tail = re.search(r"_(ms|us|µs|ns|sec|s)$", name)
    return tail and tail[1]


def found(column, known):
    """What a column is, or None.

    Parameters
    ----------
    column : Column
    known : sequence of str
        Names of joints, those of the model; the longest first.
    """
    if not column.numeric or any(name in known for text in column.sample for name in names_of(text)):
        return None
    name, _ = _stem(column.name.strip(), known)
    for joint in known:
        span = _place(joint, name)
        if span:
            rest = _blanked(name.lower(), span)
            quantity, _ = _quantity(rest)
            if quantity:
                return Found(quantity, name[: span[0]] + JOINT + name[span[1] :], joint)
    return _unnamed(column, name)


def _stem(header, known=()):
    """A header without its unit in brackets, and the unit; what names a joint, or the quantity, is no unit."""
    stem, unit = split_unit(header)
    if unit is None or is_unit(unit):
        return stem, unit
    names_quantity = _quantity(unit.lower())[0] and not _quantity(stem.lower())[0]
    return (header, None) if unit in known or names_quantity else (stem, unit)


def _place(joint, name):
    """Where a joint's name stands in a column's, no letter or digit touching it."""
    found = re.search(rf"(?<![^\W_]){re.escape(joint)}(?![^\W_])", name)
    return found and found.span()


def _blanked(text, span):
    """A text with spaces in one place."""
    return text[: span[0]] + " " * (span[1] - span[0]) + text[span[1] :]


def _quantity(rest):
    """The quantity that the words of a name mean, and its last place; None if there is none, or two."""
    if _IGNORED.search(rest):
        return None, None
    places = {match.lastgroup: match.span() for match in _QUANTITY.finditer(rest)}
    if len(places) > 1:
        places.pop("current", None)  # the current position is no current
    if len(places) != 1:
        return None, None
    return next(iter(places.items()))


def _unnamed(column, name):
    """What a column is that has no known joint in its name."""
    rest = name.lower()
    quantity, place = _quantity(rest)
    if quantity is None:
        return None
    word = word_of_unit(rest)
    if word:
        name, rest = _blanked(name, word[0]), _blanked(rest, word[0])
    begin, end = place[1], len(name)
    if not rest[begin:].strip(_BETWEEN):  # the quantity ends the name
        begin, end = 0, place[0]
        tail = rest[:end].rstrip(_BETWEEN)
        begin = max(tail.rfind("/"), tail.rfind(".")) + 1
    begin += len(rest[begin:end]) - len(rest[begin:end].lstrip(_BETWEEN))
    end = begin + len(rest[begin:end].rstrip(_BETWEEN))
    if column.width or begin >= end:
        return Found(quantity, column.name, "")
    if number := _NUMBER.fullmatch(rest[begin:end]):
        begin += number.start("number")
    joint = name[begin:end]
    if joint.lower() in _NO_JOINTS or re.search(r"[\[\](){}]", joint):  # q_d[0] is no 'd[0' of q
        return None
    stem, _ = split_unit(column.name.strip())  # with its word of a unit, which has been blanked in the name
    return Found(quantity, stem[:begin] + JOINT + stem[end:], joint, int(joint) if number else None)
