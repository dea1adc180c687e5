# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The map of columns: which of them hold time, positions, velocities and efforts."""

import math
import os
from collections.abc import Mapping
from difflib import get_close_matches
from functools import partial
from typing import Any, NamedTuple

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables.headers import JOINT, UNITS, factor_of
from diag_dynamics.yaml_files import read_yaml

QUANTITIES = ("position", "velocity", "effort")
UNSAID = object()  # value of a quantity that the map does not have


class ColumnMap(NamedTuple):
    """A map of columns, checked as far as it can be without its table."""

    time: Any = UNSAID  # one column or two (seconds and nanoseconds), by name or number
    rate: float | None = None  # rows per second [Hz], in place of a time
    position: Any = UNSAID  # a name, a pattern, or a list of names or numbers; None: not read
    velocity: Any = UNSAID
    effort: Any = UNSAID
    joints: tuple[str, ...] = ()  # in the order of the columns; empty if the map does not name them
    scale: Mapping[str, Any] = {}  # by quantity: a number, a list, or a dict by joint
    header: bool | None = None
    delimiter: str | None = None
    decimal: str = "."
    skip: int = 0  # lines before the header
    joint_names: Mapping[str, str] | None = None  # the robot's name of a joint by that of the file
    source: str = "columns"  # for messages


def read_column_map(columns):
    """Return the ColumnMap of a YAML file or of its content; None is the empty map."""
    if columns is None or isinstance(columns, ColumnMap):
        return columns or ColumnMap()
    source = "columns"
    if isinstance(columns, str | os.PathLike):
        source = f"'{os.fspath(columns)}'"
        columns = read_yaml(os.fspath(columns), f"The column map {source}")
    if not isinstance(columns, Mapping):
        keys = ", ".join(_PARSERS)
        raise InputError(
            f"{source} is {columns!r:.80}, expected the path of a YAML file or a dict with {keys}."
        )
    if isinstance(columns.get("joints"), Mapping):  # names in the data: names of the robot
        if columns.get("joint_names") is not None:
            raise InputError(
                f"{source} has joint_names and a mapping joints; expected one of them."
            )
        columns = {**columns, "joints": None, "joint_names": columns["joints"]}
    given = _parse(columns, _PARSERS, source)
    given["scale"] = _parse(given.get("scale") or {}, _SCALES, f"{source}: scale")
    given = {key: value for key, value in given.items() if value is not None or key in QUANTITIES}
    if "rate" in given and ("time" in given or "time" in given["scale"]):
        raise InputError(f"{source} has both rate and time; expected one of them.")
    by_joint = {key: given[key] for key in QUANTITIES if isinstance(given.get(key), Mapping)}
    for key, value in by_joint.items():
        given["joints"] = joints = given.get("joints") or tuple(value)
        if odd := sorted(map(str, set(value) ^ set(joints))):
            differ = f"{key} is by joint, but for other joints than the rest: {', '.join(odd)}"
            raise InputError(f"{source}: {differ}.")
        given[key] = [value[joint] for joint in joints]
    return ColumnMap(**given, source=source)


def _parse(values, parsers, where):
    """Return values by key, each checked by its parser."""
    parsed = {}
    for key, value in values.items():
        if key not in parsers:
            near = get_close_matches(str(key), parsers, n=1) or parsers
            raise InputError(f"{where} has '{key}', expected {', '.join(map(repr, near))}.")
        parser, expected = parsers[key]
        try:
            parsed[key] = None if value is None and key != "position" else parser(value)
        except (TypeError, ValueError):
            raise InputError(f"{where}: {key} is {value!r:.80}, expected {expected}.") from None
    return parsed


def _require(valid, value):
    """Return a value that is valid; raise ValueError for others."""
    if not valid:
        raise ValueError
    return value


def _parse_list(value, kinds=(str, int), most=1 << 20):
    """Return a list of different texts that are not empty, or of numbers from 0; one value becomes a list."""
    values = list(value) if isinstance(value, list | tuple) else [value]
    valid = all(
        type(one) in kinds and (one >= 0 if isinstance(one, int) else one) for one in values
    )
    return _require(valid and 0 < len(values) == len(set(values)) <= most, values)


def _parse_quantity(value):
    if isinstance(value, str):
        return _require(value and value.count(JOINT) < 2, value)
    if isinstance(value, Mapping):
        return dict(
            zip(_parse_list(list(value), (str,)), _parse_list(list(value.values())), strict=True)
        )
    return _parse_list(value)


def _parse_rate(value):
    return _require(not isinstance(value, bool) and 0.0 < float(value) < math.inf, float(value))


def _parse_delimiter(value):
    text = {"tab": "\t", "space": " "}.get(value, value)
    valid = len(text) == 1 and text.isascii() and not text.isalnum() and text not in "\"\n\r.+-_#'"
    return _require(valid, text)


def _parse_scale(quantity, value):
    """Return a scale as a number, or as numbers in a list or by joint; YAML 1.1 reads 1e-9 as text."""
    if quantity != "time" and isinstance(value, Mapping):
        return {str(joint): _parse_scale(quantity, one) for joint, one in value.items()}
    if quantity != "time" and isinstance(value, list | tuple):
        return [_parse_scale(quantity, one) for one in value]
    factor = factor_of(quantity, value) if isinstance(value, str) else None
    number = float(_require(not isinstance(value, bool), value) if factor is None else factor)
    return _require(math.isfinite(number) and number != 0, number)


def _checked(valid, expected):
    """Return a parser that accepts valid values unchanged, and its expectation."""
    return lambda value: _require(valid(value), value), expected


_COLUMNS = (
    _parse_quantity,
    f"a column's name, a pattern with {JOINT} once, or a list of columns by name or number from 0, each once",
)
_PARSERS = {
    "time": (
        lambda value: tuple(_parse_list(value, most=2)),
        "one column, or two: seconds and nanoseconds",
    ),
    "rate": (_parse_rate, "a finite number > 0 [Hz]"),
    **dict.fromkeys(QUANTITIES, _COLUMNS),
    "joints": (
        lambda value: tuple(_parse_list(value, (str,))),
        "a list of the joints' names, each once",
    ),
    "joint_names": _checked(lambda value: True, ""),  # JointNames checks it
    "scale": _checked(lambda value: isinstance(value, Mapping), f"one of {', '.join(UNITS)}"),
    "header": _checked(lambda value: value in (True, False), "true or false"),
    "delimiter": (_parse_delimiter, "one character, such as ',', or tab or space"),
    "decimal": _checked(lambda value: value in (".", ","), "'.' or ','"),
    "skip": _checked(lambda value: type(value) is int and value >= 0, "a whole number from 0"),
}
"""By key: what returns a value or raises ValueError, and what is expected. null is no value."""
_SCALES = {
    quantity: (
        partial(_parse_scale, quantity),
        f"finite numbers other than 0 or units such as {', '.join(units)}",
    )
    for quantity, units in UNITS.items()
}
