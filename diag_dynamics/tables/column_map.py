# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The map of columns: which of them hold time, positions, velocities and efforts, as a user writes it down."""

import math
import os
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any, NamedTuple

from diag_dynamics.exceptions import InputError
from diag_dynamics.tables.units import UNITS, named
from diag_dynamics.yaml_files import read_yaml

QUANTITIES = ("position", "velocity", "effort")

JOINT = "{joint}"
"""What stands for the joints in a pattern."""

UNSAID = object()
"""Of a quantity that the map does not name."""

DELIMITERS = {"tab": "\t", "\\t": "\t", "comma": ",", "semicolon": ";", "space": " "}
"""Words for what separates columns; a space is any number of spaces and tabs."""

_KEYS = ("time", *QUANTITIES, "joints", "joint_names", "scale", "header", "delimiter", "decimal", "skip")


class ColumnMap(NamedTuple):
    """A map of columns that has been checked as far as it can be without its table."""

    time: Any = UNSAID
    """A name, a number, or two of them: seconds and nanoseconds."""
    position: Any = UNSAID
    """A name, a pattern, a list of names or of numbers; a dict of them by joint; None for nothing."""
    velocity: Any = UNSAID
    effort: Any = UNSAID
    joints: tuple[str, ...] = ()
    """In the order of the columns; empty if the map does not name them."""
    scale: Mapping[str, Any] = {}
    """By quantity: a number, a list, or a dict by joint; of finite numbers other than 0."""
    header: bool | None = None
    """Whether the first line names the columns; None to look at it."""
    delimiter: str | None = None
    decimal: str = "."
    skip: int = 0
    """Lines before the header."""
    joint_names: Mapping[str, str] | None = None
    """The robot's name of a joint by that of the file; checked by who uses it."""
    source: str = "columns"
    """Where it comes from, for messages."""


def column_map(columns):
    """Check a map of columns.

    Parameters
    ----------
    columns : str, Path, dict or None
        Path of a YAML file, or what is in one. None is the empty map: everything follows from the headers.

    Returns
    -------
    ColumnMap

    Raises
    ------
    InputError
        It names the file, the key, and what was expected.
    """
    if columns is None:
        return ColumnMap()
    if isinstance(columns, ColumnMap):
        return columns
    source = "columns"
    if isinstance(columns, str | os.PathLike):
        source = f"'{os.fspath(columns)}'"
        columns = read_yaml(os.fspath(columns), f"The map of columns {source}")
    if not isinstance(columns, Mapping):
        raise InputError(
            f"{source} is {_shown(columns)}, expected the path of a YAML file or a dict with {_some(_KEYS)}."
        )
    for key in columns:
        if key not in _KEYS:
            near = get_close_matches(str(key), _KEYS, n=1)
            raise InputError(f"{source} has '{key}', expected {f'{near[0]!r}' if near else _some(_KEYS)}.")
    joints = _names(columns.get("joints"), source)
    given = {key: columns[key] for key in QUANTITIES if key in columns}
    for key, value in given.items():
        _check_columns(value, f"{source}: {key}")
        if isinstance(value, Mapping):
            joints = joints or tuple(value)
            if set(value) != set(joints):
                odd = ", ".join(sorted(map(str, set(value) ^ set(joints))))
                raise InputError(f"{source}: {key} is by joint, but not for the same joints as the rest: {odd}.")
            given[key] = [value[joint] for joint in joints]
        elif isinstance(value, list | tuple | int):
            given[key] = [value] if isinstance(value, int) else list(value)
    if given.get("position", UNSAID) is None:
        raise InputError(f"{source}: position is null, but there is no dynamics without positions.")
    return ColumnMap(
        time=_time(columns.get("time", UNSAID), source),
        **given,
        joints=joints,
        scale=_scales(columns.get("scale"), source),
        header=_header(columns.get("header"), source),
        delimiter=_delimiter(columns.get("delimiter"), source),
        decimal=_decimal(columns, source),
        skip=_count(columns.get("skip", 0), f"{source}: skip"),
        joint_names=columns.get("joint_names"),
        source=source,
    )


def _shown(value):
    text = repr(value)
    return text if len(text) < 80 else f"{text[:77]}..."


def _some(names):
    return f"{', '.join(names[:-1])} or {names[-1]}"


def _is_number(value):
    return isinstance(value, int) and not isinstance(value, bool)


def _count(value, what):
    if not _is_number(value) or value < 0:
        raise InputError(f"{what} is {_shown(value)}, expected a whole number from 0.")
    return value


def _column(value, what):
    """Refuse what is neither a column's name nor its number."""
    if _is_number(value):
        _count(value, what)
    elif not isinstance(value, str) or not value:
        raise InputError(f"{what} is {_shown(value)}, expected a column's name, or its number from 0.")


def _time(value, source):
    if value is UNSAID:
        return value
    pair = value if isinstance(value, list | tuple) else [value]
    if len(pair) not in (1, 2):
        raise InputError(f"{source}: time is {_shown(value)}, expected one column, or two: seconds and nanoseconds.")
    for one in pair:
        _column(one, f"{source}: time")
    return tuple(pair)


def _check_columns(value, what):
    if value is None or (isinstance(value, str) and value):
        if value is not None and value.count(JOINT) > 1:
            raise InputError(f"{what} is '{value}', expected {JOINT} once.")
        return
    if isinstance(value, Mapping):
        entries = list(value.values())
        if not all(isinstance(joint, str) and joint for joint in value):
            raise InputError(f"{what} is {_shown(value)}, expected names of joints as keys.")
    elif isinstance(value, list | tuple):
        entries = list(value)
    else:
        entries = [value] if _is_number(value) else []
    if not entries:
        raise InputError(
            f"{what} is {_shown(value)}, expected a column's name, a pattern such as q_{JOINT}, or a list of columns, by "
            "name or by number from 0, in the order of the joints."
        )
    for entry in entries:
        _column(entry, what)
    doubled = sorted({str(entry) for entry in entries if entries.count(entry) > 1})
    if doubled:
        raise InputError(f"{what} has column {doubled[0]} for two joints.")


def _names(value, source):
    if value is None:
        return ()
    if not isinstance(value, list | tuple) or not value or not all(isinstance(one, str) and one for one in value):
        raise InputError(f"{source}: joints is {_shown(value)}, expected a list of the joints' names.")
    if len(set(value)) != len(value):
        doubled = next(one for one in value if list(value).count(one) > 1)
        raise InputError(f"{source}: joints has '{doubled}' twice.")
    return tuple(value)


def _scales(value, source):
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise InputError(
            f"{source}: scale is {_shown(value)}, expected a number or a unit for each of {_some(list(UNITS))}."
        )
    for key in value:
        if key not in UNITS:
            near = get_close_matches(str(key), UNITS, n=1)
            raise InputError(f"{source}: scale has '{key}', expected {f'{near[0]!r}' if near else _some(list(UNITS))}.")
    return {key: _scale(key, one, f"{source}: scale: {key}") for key, one in value.items() if one is not None}


def _scale(quantity, value, what):
    """One scale, its numbers checked and its units turned into numbers."""
    if quantity != "time" and isinstance(value, Mapping):
        return {str(joint): _factor(quantity, one, f"{what}: {joint}") for joint, one in value.items()}
    if quantity != "time" and isinstance(value, list | tuple):
        return [_factor(quantity, one, what) for one in value]
    return _factor(quantity, value, what)


def _factor(quantity, value, what):
    number = value
    if isinstance(value, str):  # YAML 1.1 takes 1e-9 for text
        number = named(quantity, value)
        if number is None:
            try:
                number = float(value)
            except ValueError:
                known = ", ".join(list(UNITS[quantity])[:8])
                raise InputError(f"{what} is '{value}', expected a number or a unit such as {known}.") from None
    if isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number) or number == 0:
        raise InputError(f"{what} is {_shown(value)}, expected a finite number other than 0.")
    return float(number)


def _header(value, source):
    if value is not None and not isinstance(value, bool):
        raise InputError(f"{source}: header is {_shown(value)}, expected true or false.")
    return value


def _delimiter(value, source):
    if value is None:
        return None
    known = DELIMITERS.get(value, value) if isinstance(value, str) else ""
    if len(known) != 1 or not known.isascii() or known.isalnum() or known in "\"\n\r.+-_#'":
        raise InputError(
            f"{source}: delimiter is {_shown(value)}, expected one character, such as ',' or ';', or tab or space."
        )
    return known


def _decimal(columns, source):
    value = columns.get("decimal", ".")
    if value not in (".", ","):
        raise InputError(f"{source}: decimal is {_shown(value)}, expected '.' or ','.")
    if value == "," and _delimiter(columns.get("delimiter"), source) == ",":
        raise InputError(f"{source}: decimal and delimiter are both ','.")
    return value
