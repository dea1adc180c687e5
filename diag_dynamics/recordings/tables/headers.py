# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Time, quantity, joint and unit of columns by their headers: docs/recordings.md has the rules."""

import re
from math import pi
from typing import NamedTuple

JOINT = "{joint}"  # stands for the joints in a pattern
_UNITS = {
    "time": {
        "s sec secs second seconds utc gmt unix epoch": 1.0,
        "ms msec millisec milliseconds": 1e-3,
        "us µs usec microsec microseconds": 1e-6,
        "ns nsec nanosec nanoseconds": 1e-9,
        "min minute minutes": 60.0,
        "h hour hours": 3600.0,
        "d day days": 86400.0,
    },
    "position": {
        "rad radian radians m": 1.0,
        "mrad mm": 1e-3,
        "cm": 1e-2,
        "deg degree degrees °": pi / 180,
        "rev revs turn turns": 2 * pi,
    },
    "velocity": {
        "rad/s m/s": 1.0,
        "mrad/s mm/s": 1e-3,
        "cm/s": 1e-2,
        "deg/s °/s dps": pi / 180,
        "rpm rev/min 1/min": 2 * pi / 60,
        "rev/s 1/s hz": 2 * pi,
    },
    "effort": {"nm n": 1.0, "mnm": 1e-3, "knm kn": 1e3, "ncm": 1e-2},
}
UNITS = {
    quantity: {unit: factor for units, factor in table.items() for unit in units.split()}
    for quantity, table in _UNITS.items()
}
"""Factor to SI by quantity and unit, in lower case without spaces and signs of multiplication."""
AMPERES = dict.fromkeys(("a", "amp", "amps", "ampere", "amperes"), 1.0) | {"ma": 1e-3}
"""Factors to A of motor currents, which are efforts in another unit."""
_WITHOUT_FACTOR = re.compile("a|ma|amps?|amperes?|v|volts?|%|percent|ticks|counts|steps")
_BRACKETS = re.compile(r"(.+?)(\s*)[\[(]([^\[\]()]*[^\[\]()\s][^\[\]()]*)[\])]\s*$")
_UNIT_WORD = re.compile(
    r"°(?:/s)?|(?<![a-z0-9])(?:"
    r"(?P<per>degrees?|deg|radians?|rad|rev|mm|mrad)(?:_s|_?per_?s(?:ec(?:ond)?)?|_?p_?s|/s)"
    r"|dps|degrees?|deg|radians?|rad|mrad|revs?|turns?|mm|rpm|nm|mnm"
    r"|ma|amps?|amperes?|volts?|percent|ticks|counts|steps)(?![a-z])"
)
"""A unit as a word in a header. Single letters (m, s, A) are units in brackets only."""

_IGNORED = re.compile(
    r"(?<![a-z])(?:target|desired|des|command|commanded|cmd|reference|ref|setpoint|goal|error|err"
    r"|planned|external|ext|limits?|accelerations?|acc|tcp)(?![a-z])"
)
_DESIRED = re.compile(r"(?<![a-z])(?:d?q|qd|tau|tau_j)_d(?![a-z0-9])")  # of libfranka
_QUANTITY = re.compile(
    r"(?<![a-z0-9])(?:(?P<velocity>velocities|velocity|speeds|speed|q_dot|qdot|vel|qd|dq)"
    r"|(?P<position>positions|position|angles|angle|theta|pos|q)"
    r"|(?P<effort>efforts|effort|torques|torque|eff|tau)|(?P<current>currents|current))(?![a-z])"
)
_NUMBER = re.compile(r"(?:(?:joints?|j|axis)[^a-z0-9]*)?(\d{1,4})")
_BETWEEN = "_./[]()<>{}|: -\t"

_TIME_UNIT = "_(?P<unit>s|sec|ms|msec|us|usec|µs|ns|nsec|nanosec)"
_TIMES = (
    re.compile(rf"(?:.*[./])?header[./]stamp(?:{_TIME_UNIT})?"),
    re.compile(
        r"(?:t|time|times|timestamps?|time_stamp|stamp|secs?|seconds?|elapsed|elapsed_time|unix_time)"
        rf"(?:{_TIME_UNIT})?"
    ),
    re.compile("%time|__time|rosbagtimestamp"),  # which tools add to a recording
)
"""Headers of times, the best kind first."""
_NANOSECONDS = ("%time", "rosbagtimestamp", "field.header.stamp")
_PAIR = re.compile(
    r"(?P<prefix>(?P<stamp>(?:.*[./_ ])?header[./_ ]stamp[./_ ])?(?:.*[^a-z])?)(?P<nano>n|nano)?secs?"
)


class Column(NamedTuple):
    """One column of a table, or one array."""

    name: str
    width: int = 0  # columns of an array or of lists; 0 of one number a row
    unit: str | None = None  # outside of the name: in a line of units, in metadata
    numeric: bool = True  # whether the column holds numbers or times
    sample: tuple = ()  # texts of the first rows, or lists of them, of a column without numbers
    listed: bool = False  # whether each row has a list
    moments: bool = False  # whether all values are ISO 8601 times, or of a type of times
    type: str = ""  # of values that are no numbers, for messages


# --- Units ---


def _normalized(unit):
    """Return a unit in lower case without signs of multiplication and spaces; ``s^-1`` is ``/s``."""
    text = re.sub(r"[\s·*⋅.]", "", unit.lower()).replace("\u03bc", "µ").replace("º", "°")
    text = re.sub(r"(?:s\^?-1|s⁻¹)$", "/s", text).replace("//", "/")
    return re.sub(r"^(deg|rad)[a-z]*/", r"\1/", re.sub(r"/sec(?:ond)?$", "/s", text))


def is_unit(text):
    """Return whether a text is a known unit of any quantity."""
    unit = _normalized(text)
    return any(unit in table for table in UNITS.values()) or bool(_WITHOUT_FACTOR.fullmatch(unit))


def factor_of(quantity, unit):
    """Return the factor of a unit to SI; None if the quantity has no such unit."""
    return UNITS[quantity].get(_normalized(unit))


def amperes_of(unit):
    """Return the factor of a unit of currents to A; None for others."""
    return None if unit is None else AMPERES.get(_normalized(unit))


def split_unit(header, known=()):
    """Return a header without its unit in brackets, and the unit or None.

    After a space any text in brackets is a unit, otherwise only a known one; names of joints and quantities are none.
    """
    match = _BRACKETS.match(header)
    if match is None:
        return header, None
    stem, space, unit = match[1], match[2], match[3].strip()
    is_name = unit in known or (find_quantity(unit.lower()) and not find_quantity(stem.lower()))
    if not is_unit(unit) and (unit.isdigit() or not space or is_name):
        return header, None
    return stem, unit


def unit_of(column, joint):
    """Return the unit of a column or None; a joint may be called deg."""
    stem, unit = split_unit(column.name.replace(joint, " ", 1))
    word = _UNIT_WORD.search(stem.lower())
    in_name = word and (f"{word['per']}/s" if word["per"] else word[0])
    return column.unit or unit or in_name


# --- Times ---


def time_columns(columns):
    """Return columns that may be the times: tuples of one index or two, by name, the best kind only."""
    kinds, pairs = [{}, {}, {}, {}], {}
    for k, column in enumerate(columns):
        if not (column.numeric or column.moments) or (column.sample and not any(column.sample)):
            continue
        name = split_unit(column.name.strip())[0].lower()
        kind = next(
            (n for n, pattern in enumerate(_TIMES) if pattern.fullmatch(name)),
            3 if column.moments else None,
        )
        if kind is not None:
            kinds[kind].setdefault(column.name, (k,))
        if match := _PAIR.fullmatch(name):
            pair = pairs.setdefault((match["prefix"], 0 if match["stamp"] else 1), {})
            pair.setdefault(bool(match["nano"]), k)
    for (_, kind), pair in pairs.items():
        if len(pair) == 2:
            both = pair[False], pair[True]
            kinds[kind].pop(columns[both[0]].name, None)
            kinds[kind][" and ".join(columns[k].name for k in both)] = both
    return next(filter(None, kinds), {})


def unit_of_time(column):
    """Return the unit of a column of times, or None."""
    name, unit = split_unit(column.name.strip())
    if column.unit or unit:
        return column.unit or unit
    if name.lower() in _NANOSECONDS:
        return "ns"
    match = re.search(f"{_TIME_UNIT}$", name.lower())
    return match and match["unit"]


# --- Quantities and joints ---


def parse_header(column, known):
    """Return quantity, name with {joint} for the joint, and joint of a numeric column; None without a quantity.

    The joint is a name or a number, or empty where there is none; `known` are the model's joints, longest first.
    """
    name = split_unit(column.name.strip(), known)[0]
    for joint in known:
        place = re.search(rf"(?<![^\W_]){re.escape(joint)}(?![^\W_])", name)
        if place and (quantity := find_quantity(_blank(name.lower(), place))):
            before, after = (
                re.sub(r"\d+", "*", part) for part in (name[: place.start()], name[place.end() :])
            )
            return quantity.lastgroup, before + JOINT + after, joint
    return _parse_unknown_joint(column, name)


def _parse_unknown_joint(column, name):
    """Parse a header without one of the model's joints: the joint follows or precedes the quantity."""
    quantity, word = find_quantity(name.lower()), _UNIT_WORD.search(name.lower())
    if quantity is None:
        return None
    text = _blank(name, word) if word else name
    begin, end = quantity.end(), len(text)
    if not text[begin:].strip(_BETWEEN):  # the quantity ends the name
        end = len(text[: quantity.start()].rstrip(_BETWEEN))
        begin = max(text.rfind("/", 0, end), text.rfind(".", 0, end)) + 1
    joint = text[begin:end].strip(_BETWEEN)
    if column.width or not joint:
        return quantity.lastgroup, column.name, ""
    number = _NUMBER.fullmatch(joint.lower())
    joint = number[1] if number else joint
    if joint.lower() in ("x", "y", "z", "w") or re.search(
        r"[\[\](){}]", joint
    ):  # q_d[0] is no 'd[0' of q
        return None
    begin = text.index(joint, begin)
    return quantity.lastgroup, name[:begin] + JOINT + name[begin + len(joint) :], joint


def find_quantity(text):
    """Return the match of the last word of the only quantity in a header; None for none or two quantities."""
    found = {match.lastgroup: match for match in _QUANTITY.finditer(text)}
    if len(found) > 1:
        found.pop("current", None)  # the current position is no current
    is_desired = _DESIRED.search(text) and not _DESIRED.fullmatch(text)  # a joint may be called d
    return (
        None
        if len(found) != 1 or _IGNORED.search(text) or is_desired
        else next(iter(found.values()))
    )


def _blank(text, match):
    return text[: match.start()] + " " * len(match[0]) + text[match.end() :]
