# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The map of columns: which of them hold time, positions, velocities and efforts."""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables.headers import QUANTITIES, UNITS, factor_of
from diag_dynamics.yaml_files import read_yaml

Entries = tuple[str | int | None, ...]
"""Names or numbers of columns, from 0; None is no column."""
Numbers = tuple[float, ...]
"""One number, or one for each joint."""


@dataclass(frozen=True)
class ColumnMap:
    """A map of columns, checked as far as it can be without its table.

    None leaves an entry to a convention. An empty tuple is no column.
    """

    time: Entries | None = None  # one column, or two: seconds and nanoseconds
    rate: float | None = None  # rows per second [Hz], in place of a time
    position: Entries | None = None  # of each joint, or one array
    velocity: Entries | None = None
    effort: Entries | None = None
    joints: tuple[str, ...] | None = None  # in the order of the columns
    names: Entries | None = None  # columns that name the joint of each value in each row
    scale: Mapping[str, Numbers] = field(default_factory=dict)  # by quantity: factors to SI
    offset: Mapping[str, Numbers] = field(default_factory=dict)  # by quantity: summands in SI
    mixing: tuple[Numbers, ...] | None = None  # rows of B in q = B θ, of columns of motors θ
    header: bool | None = None
    decimal: str = "."
    skip: int = 0  # lines before the header
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
        raise InputError(
            f"{source} is {columns!r:.80}; expected the path of a YAML file or a dict with "
            f"{', '.join(_PARSERS)}."
        )
    stated = {key: _parse(key, value, source) for key, value in columns.items()}
    stated = {key: value for key, value in stated.items() if value is not None}
    if "rate" in stated and ("time" in stated or "time" in stated.get("scale", ())):
        raise InputError(f"{source} has both rate and time; expected one of them.")
    return ColumnMap(**stated, source=source)


def _parse(key, value, source):
    """Return the checked value of a key; null of velocities or efforts is no column."""
    if key not in _PARSERS:
        raise InputError(f"{source} has '{key}'; expected {', '.join(_PARSERS)}.")
    parser, expected = _PARSERS[key]
    if value is None:
        return () if key in QUANTITIES[1:] else None
    try:
        return parser(value)
    except (TypeError, ValueError, LookupError, AttributeError):
        raise InputError(f"{source}: {key} is {value!r:.80}; expected {expected}.") from None


def _require(valid, value):
    """Return a value that is valid; raise ValueError for others."""
    if not valid:
        raise ValueError
    return value


def _parse_entries(value, kinds=(str, int), count=1 << 20):
    """Return a tuple of different texts that are not empty, or numbers from 0."""
    values = tuple(value) if isinstance(value, list | tuple) else (value,)
    valid = all(
        type(entry) in kinds and (entry >= 0 if isinstance(entry, int) else entry)
        for entry in values
    )
    return _require(valid and 0 < len(values) == len(set(values)) <= count, values)


def _parse_rate(value):
    return _require(not isinstance(value, bool) and 0.0 < float(value) < math.inf, float(value))


def _parse_scale(value):
    """Return factors to SI by quantity, of numbers or units."""
    factors = {}
    for quantity, entry in value.items():
        units = entry if isinstance(entry, list | tuple) and quantity != "time" else [entry]
        numbers = [factor_of(quantity, text) or float(text) for text in map(str, units)]
        valid = numbers and np.isfinite(numbers).all() and all(numbers)
        factors[quantity] = _require(valid, tuple(numbers))
    return factors


def _parse_offset(value):
    offsets = {key: tuple(np.array(entry, float).ravel().tolist()) for key, entry in value.items()}
    valid = all(numbers and np.isfinite(numbers).all() for numbers in offsets.values())
    return _require(valid and offsets.keys() <= {*QUANTITIES}, offsets)


def _parse_mixing(value):
    matrix = np.array(value, float)
    return _require(np.linalg.cond(matrix, 1) < 1e12, tuple(map(tuple, matrix.tolist())))


def _checked(valid, expected):
    """Return a parser that accepts valid values unchanged, and its expectation."""
    return lambda value: _require(valid(value), value), expected


_PARSERS = {
    "time": (
        lambda value: _parse_entries(value, count=2),
        "one column, or two: seconds and nanoseconds",
    ),
    "rate": (_parse_rate, "a finite number > 0 [Hz]"),
    **dict.fromkeys(
        QUANTITIES, (_parse_entries, "a column, or a list of names or numbers from 0, each once")
    ),
    "joints": (lambda value: _parse_entries(value, (str,)), "a list of names, each once"),
    "names": (_parse_entries, "a list of columns, each once"),
    "scale": (
        _parse_scale,
        f"by {', '.join(UNITS)} finite numbers other than 0, or units, one or one for each joint",
    ),
    "offset": (
        _parse_offset,
        f"by {', '.join(QUANTITIES)} finite numbers, one or one for each joint",
    ),
    "mixing": (_parse_mixing, "rows of an invertible matrix"),
    "header": _checked(lambda value: value in (True, False), "true or false"),
    "decimal": _checked(lambda value: value in (".", ","), "'.' or ','"),
    "skip": _checked(lambda value: type(value) is int and value >= 0, "a whole number from 0"),
}
"""Parser of each key, which raises ValueError, and the text on its expected values."""
