# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contents of columns by their headers: docs/recordings.md has the rules."""

import re
from typing import NamedTuple

from diag_dynamics.recordings.tables.column_map import JOINT
from diag_dynamics.recordings.tables.units import is_unit, split_unit, unit_word

_IGNORED = re.compile(
    r"(?<![a-z])(?:target|desired|des|command|commanded|cmd|reference|ref|setpoint|goal|error|err|planned|external"
    r"|accelerations?|acc)(?![a-z])"
)
_WORDS = {
    "velocity": "velocities|velocity|speeds|speed|q_dot|qdot|vel|qd|dq",
    "position": "positions|position|angles|angle|theta|pos|q",
    "effort": "efforts|effort|torques|torque|eff|tau",
    "current": "currents|current",
}
_QUANTITY = re.compile(
    f"(?<![a-z0-9])(?:{'|'.join(f'(?P<{name}>{words})' for name, words in _WORDS.items())})(?![a-z])"
)
_TIME = re.compile(
    r"(?:t|time|times|timestamps?|time_stamp|stamp|secs?|seconds?|elapsed|elapsed_time|unix_time"
    r"|(?:.*[./])?header[./]stamp)(?:_(?P<unit>s|sec|ms|msec|us|usec|µs|ns|nsec|nanosec))?"
)
_TOOL_TIMES = {"%time": "ns", "__time": None, "rosbagtimestamp": "ns"}
"""Times that tools add to a recording, and their units."""
_NANOSECONDS = "field.header.stamp"
_STAMP = re.compile(r"(?:.*[./_ ])?header[./_ ]stamp(?:[./_ ]n?secs?)?")
_PAIR = re.compile(r"(?P<prefix>(?:.*[^a-z])?)(?P<nano>n|nano)?secs?")
_NUMBER = re.compile(r"(?:(?:joints?|j|axis)[^a-z0-9]*)?(?P<number>\d{1,4})")
_BETWEEN = "_./[]()<>{}|: -\t"


class Column(NamedTuple):
    """One column of a table, or one array."""

    name: str
    width: int = 0
    """Columns of an array or of lists; 0 of one number a row."""
    unit: str | None = None
    """Unit outside of the name: in a line of units, in metadata."""
    numeric: bool = True
    """Whether the column holds numbers or times."""
    sample: tuple = ()
    """Texts of the first rows, or lists of them, of a column without numbers."""
    listed: bool = False
    """Whether each row has a list."""
    dated: bool = False
    """Whether the texts are times or numbers."""
    moments: bool = False
    """Whether all values are times by themselves: ISO 8601, or of a type of times."""
    type: str = ""
    """Type of values that are no numbers, for messages."""


class Header(NamedTuple):
    """Content of one column by its name."""

    quantity: str
    pattern: str
    """Name with {joint} for the joint."""
    joint: str
    """Empty where there is none."""
    number: int | None = None


def unit_of(column, name):
    """Return the unit of a column or None; `name` is its name without the joint's."""
    stem, unit = _split_unit(name)
    word = unit_word(stem.lower()) if unit is None else None
    return column.unit or unit or (word and word[1])


def time_columns(columns):
    """Return columns that may be the times: tuples of one index or two, by name, the best kind of them only."""
    times, tool_times, pairs, moments = {}, {}, ({}, {}), {}
    for k, column in enumerate(columns):
        if not (column.numeric or column.dated) or (column.sample and not any(column.sample)):
            continue
        name = split_unit(column.name.strip())[0].lower()
        if name in _TOOL_TIMES:
            tool_times[column.name] = (k,)
        elif _TIME.fullmatch(name) or name == _NANOSECONDS:
            times.setdefault(column.name, (k,))
        if column.moments:
            moments[column.name] = (k,)
        if match := _PAIR.fullmatch(name):
            pairs[bool(match["nano"])].setdefault(match["prefix"], k)
    for prefix in pairs[0].keys() & pairs[1].keys():
        both = pairs[0][prefix], pairs[1][prefix]
        times.pop(columns[both[0]].name, None)
        times[" and ".join(columns[k].name for k in both)] = both
    stamps = {name: ks for name, ks in times.items() if _STAMP.fullmatch(columns[ks[0]].name.strip().lower())}
    return stamps or times or tool_times or moments


def unit_of_time(column):
    """Return the unit of a column of times, or None."""
    name, unit = split_unit(column.name.strip())
    name = name.lower()
    if column.unit or unit:
        return column.unit or unit
    if name in _TOOL_TIMES:
        return _TOOL_TIMES[name]
    if name == _NANOSECONDS:
        return "ns"
    match = _TIME.fullmatch(name) or re.search(r"_(?P<unit>ms|us|µs|ns|sec|s)$", name)
    return match and match["unit"]


def parse_header(column, known):
    """Return the :class:`Header` of a numeric column or None; `known` are the model's joints, the longest first."""
    name = _split_unit(column.name.strip(), known)[0]
    for joint in known:
        if span := _span_of(joint, name):
            quantity = _quantity(_blank(name.lower(), span))
            if quantity:
                return Header(quantity[0], name[: span[0]] + JOINT + name[span[1] :], joint)
    return _parse_unknown_joint(column, name)


def _split_unit(header, known=()):
    """A header and its unit in brackets; the name of a joint or of the quantity in brackets is no unit."""
    stem, unit = split_unit(header)
    if not unit or is_unit(unit):
        return stem, unit
    names_quantity = _quantity(unit.lower()) and not _quantity(stem.lower())
    return (header, None) if names_quantity or unit in known else (stem, unit)


def _span_of(joint, name):
    """Place of a joint's name in a header, no letter or digit beside it."""
    match = re.search(rf"(?<![^\W_]){re.escape(joint)}(?![^\W_])", name)
    return match and match.span()


def _blank(text, span):
    return text[: span[0]] + " " * (span[1] - span[0]) + text[span[1] :]


def _quantity(text):
    """The quantity of a header and the place of its last word; None without a word, or with words of two."""
    if _IGNORED.search(text):
        return None
    spans = {match.lastgroup: match.span() for match in _QUANTITY.finditer(text)}
    if len(spans) > 1:
        spans.pop("current", None)  # the current position is no current
    return next(iter(spans.items())) if len(spans) == 1 else None


def _parse_unknown_joint(column, name):
    """The header of a column that names none of the model's joints."""
    text, quantity = name.lower(), _quantity(name.lower())
    if quantity is None:
        return None
    quantity, (start, begin) = quantity
    if word := unit_word(text):
        text = _blank(text, word[0])
    end = len(text)
    if not text[begin:].strip(_BETWEEN):  # the quantity ends the name
        end = len(text[:start].rstrip(_BETWEEN))
        begin = max(text.rfind("/", 0, end), text.rfind(".", 0, end)) + 1
    end = begin + len(text[begin:end].rstrip(_BETWEEN))
    begin = end - len(text[begin:end].lstrip(_BETWEEN))
    if column.width or begin >= end:
        return Header(quantity, column.name, "")
    if number := _NUMBER.fullmatch(text[begin:end]):
        begin += number.start("number")
    joint = _blank(name, word[0])[begin:end] if word else name[begin:end]
    if joint.lower() in ("x", "y", "z", "w") or re.search(r"[\[\](){}]", joint):  # q_d[0] is no 'd[0' of q
        return None
    stem = split_unit(column.name.strip())[0]
    return Header(quantity, stem[:begin] + JOINT + stem[end:], joint, int(joint) if number else None)
