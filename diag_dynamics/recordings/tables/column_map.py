# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The map of columns: which of them hold time, positions, velocities and efforts, as a user writes it."""

import math
import os
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any, NamedTuple

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables.units import UNITS, factor_of
from diag_dynamics.yaml_files import read_yaml

QUANTITIES = ("position", "velocity", "effort")
JOINT = "{joint}"
"""Stands for the joints in a pattern."""
UNSAID = object()
"""Value of a quantity that the map does not have."""

_DELIMITERS = {"tab": "\t", "\\t": "\t", "comma": ",", "semicolon": ";", "space": " "}


class ColumnMap(NamedTuple):
    """A map of columns, checked as far as it can be without its table."""

    time: Any = UNSAID
    """One column or two (seconds and nanoseconds), by name or number."""
    position: Any = UNSAID
    """A name, a pattern, or a list of names or numbers; None: not read."""
    velocity: Any = UNSAID
    effort: Any = UNSAID
    joints: tuple[str, ...] = ()
    """In the order of the columns; empty if the map does not name them."""
    scale: Mapping[str, Any] = {}
    """By quantity: a number, a list, or a dict by joint."""
    header: bool | None = None
    delimiter: str | None = None
    decimal: str = "."
    skip: int = 0
    """Lines before the header."""
    joint_names: Mapping[str, str] | None = None
    """The robot's name of a joint by that of the file; not checked here."""
    source: str = "columns"
    """Where the map comes from, for messages."""


def column_map(columns):
    """Check a map of columns.

    Parameters
    ----------
    columns : str, Path, dict, ColumnMap or None
        Path of a YAML file, or its content. None is the empty map: all follows from the headers.

    Returns
    -------
    ColumnMap

    Raises
    ------
    InputError
        It names the file, the key, and the expected value.
    """
    if columns is None or isinstance(columns, ColumnMap):
        return columns or ColumnMap()
    source = "columns"
    if isinstance(columns, str | os.PathLike):
        source = f"'{os.fspath(columns)}'"
        columns = read_yaml(os.fspath(columns), f"The map of columns {source}")
    if not isinstance(columns, Mapping):
        raise InputError(f"{source} is {_shown(columns)}, expected the path of a YAML file or a dict with {_KEYS}.")
    _require_known(columns, [*_RULES, "scale", "joint_names"], source)
    for key, (valid, expected) in _RULES.items():
        if key in columns and not valid(columns[key]):
            raise InputError(f"{source}: {key} is {_shown(columns[key])}, expected {expected}.")
    given = {key: columns[key] for key in columns if key != "scale" and columns[key] is not None}
    given |= {key: None for key in ("velocity", "effort") if key in columns and columns[key] is None}
    delimiter = given.get("delimiter")
    given["delimiter"] = _DELIMITERS.get(delimiter, delimiter)
    if given["delimiter"] == "," == given.get("decimal"):
        raise InputError(f"{source}: decimal and delimiter are both ','.")
    if "time" in given:
        given["time"] = tuple(given["time"] if isinstance(given["time"], list | tuple) else [given["time"]])
    given["joints"] = tuple(given.get("joints", ()))
    for key in [one for one in QUANTITIES if one in given]:
        value = given[key]
        if isinstance(value, Mapping):
            given["joints"] = joints = given["joints"] or tuple(value)
            if set(value) != set(joints):
                odd = ", ".join(sorted(map(str, set(value) ^ set(joints))))
                raise InputError(f"{source}: {key} is by joint, but not for the same joints as the rest: {odd}.")
            given[key] = [value[joint] for joint in joints]
        elif not isinstance(value, str | None):
            given[key] = [value] if isinstance(value, int) else list(value)
    return ColumnMap(**given, scale=_scales(columns.get("scale"), source), source=source)


def _shown(value):
    text = repr(value)
    return text if len(text) < 80 else f"{text[:77]}..."


def _require_known(given, known, source):
    for key in given:
        if key not in known:
            near = get_close_matches(str(key), known, n=1)
            raise InputError(f"{source} has '{key}', expected {f'{near[0]!r}' if near else ', '.join(known)}.")


def _is_column(value):
    """Whether a value is a column's name or number."""
    if isinstance(value, int):
        return not isinstance(value, bool) and value >= 0
    return isinstance(value, str) and bool(value)


def _are_columns(value):
    if isinstance(value, str):
        return bool(value) and value.count(JOINT) < 2
    entries = list(value.values()) if isinstance(value, Mapping) else value
    entries = list(entries) if isinstance(entries, list | tuple) else [entries]
    return bool(entries) and all(map(_is_column, entries)) and len(set(entries)) == len(entries)


def _is_time(value):
    columns = value if isinstance(value, list | tuple) else [value]
    return len(columns) in (1, 2) and all(map(_is_column, columns))


def _are_joints(value):
    if not isinstance(value, list | tuple) or not value:
        return False
    return all(isinstance(one, str) and one for one in value) and len(set(value)) == len(value)


def _is_delimiter(value):
    text = _DELIMITERS.get(value, value) if isinstance(value, str) else ""
    return len(text) == 1 and text.isascii() and not text.isalnum() and text not in "\"\n\r.+-_#'"


_COLUMNS = f"a column's name, a pattern with {JOINT} once, or a list of columns by name or number from 0, each once"
_RULES = {
    "time": (_is_time, "one column, or two: seconds and nanoseconds, by name or number from 0"),
    "position": (_are_columns, _COLUMNS),
    "velocity": (lambda value: value is None or _are_columns(value), f"null, {_COLUMNS}"),
    "effort": (lambda value: value is None or _are_columns(value), f"null, {_COLUMNS}"),
    "joints": (lambda value: value is None or _are_joints(value), "a list of the joints' names, each once"),
    "header": (lambda value: value is None or isinstance(value, bool), "true or false"),
    "delimiter": (lambda value: value is None or _is_delimiter(value), "one character, such as ',', or tab or space"),
    "decimal": (lambda value: value in (".", ","), "'.' or ','"),
    "skip": (lambda value: type(value) is int and value >= 0, "a whole number from 0"),
}
"""By key: whether a value is valid, and what is expected."""
_KEYS = ", ".join([*_RULES, "scale", "joint_names"])


def _scales(value, source):
    """Scales by quantity, their units as numbers."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise InputError(
            f"{source}: scale is {_shown(value)}, expected a number or a unit for each of {', '.join(UNITS)}."
        )
    _require_known(value, list(UNITS), f"{source}: scale")
    return {key: _scale(key, one, f"{source}: scale: {key}") for key, one in value.items() if one is not None}


def _scale(quantity, value, name):
    if quantity != "time" and isinstance(value, Mapping):
        return {str(joint): _scale_factor(quantity, one, f"{name}: {joint}") for joint, one in value.items()}
    if quantity != "time" and isinstance(value, list | tuple):
        return [_scale_factor(quantity, one, name) for one in value]
    return _scale_factor(quantity, value, name)


def _scale_factor(quantity, value, name):
    """A scale as a number: YAML 1.1 takes 1e-9 for text."""
    number = factor_of(quantity, value) if isinstance(value, str) else value
    try:
        number = math.nan if isinstance(number, bool) else float(value if number is None else number)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number) or number == 0:
        known = ", ".join(list(UNITS[quantity])[:8])
        raise InputError(f"{name} is {_shown(value)}, expected a finite number other than 0 or a unit such as {known}.")
    return number
