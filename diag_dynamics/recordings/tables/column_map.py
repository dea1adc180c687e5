# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The map of columns: which of them hold time, positions, velocities and efforts."""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import partial

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables.headers import QUANTITIES, UNITS, factor_of
from diag_dynamics.yaml_files import read_yaml

JOINT = "{joint}"  # stands for the joints in a pattern
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
    position: Entries | str | None = None  # of each joint, a pattern, or one array
    velocity: Entries | str | None = None
    effort: Entries | str | None = None
    joints: tuple[str, ...] | None = None  # in the order of the columns
    names: Entries | None = None  # columns that name the joint of each value in each row
    scale: Mapping[str, Numbers] = field(default_factory=dict)  # by quantity: factors to SI
    offset: Mapping[str, Numbers] = field(default_factory=dict)  # by quantity: summands in SI
    mixing: tuple[Numbers, ...] | None = None  # rows of B in q = B θ, of columns of motors θ
    header: bool | None = None
    delimiter: str | None = None
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
        keys = ", ".join(_PARSERS)
        expected = f"expected the path of a YAML file or a dict with {keys}"
        raise InputError(f"{source} is {columns!r:.80}; {expected}.")
    fields = {}
    for key, value in columns.items():
        fields[key] = _parse(key, value, _PARSERS, source)
    for key in ("scale", "offset"):
        where, numbers = f"{source}: {key}", fields.get(key) or {}
        parsers = dict.fromkeys(QUANTITIES if key == "offset" else UNITS, _NUMBERS[key])
        fields[key] = {
            name: _parse(name, value, parsers, where, name) for name, value in numbers.items()
        }
    if fields.get("rate") and (fields.get("time") or "time" in fields["scale"]):
        raise InputError(f"{source} has both rate and time; expected one of them.")
    stated = {key: value for key, value in fields.items() if value is not None}
    return ColumnMap(**stated, source=source)


def _parse(key, value, parsers, where, *quantity):
    """Return a value checked by the parser of its key; null of a quantity is no column."""
    if key not in parsers:
        near = get_close_matches(str(key), parsers, n=1) or parsers
        raise InputError(f"{where} has '{key}'; expected {', '.join(map(repr, near))}.")
    parser, expected = parsers[key]
    if value is None:
        return () if key in QUANTITIES[1:] and not quantity else None
    try:
        return parser(*quantity, value)
    except (TypeError, ValueError):
        raise InputError(f"{where}: {key} is {value!r:.80}; expected {expected}.") from None


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


def _parse_quantity(value):
    if isinstance(value, str) and JOINT in value:
        return _require(value.count(JOINT) == 1, value)
    return _parse_entries(value)


def _parse_rate(value):
    return _require(not isinstance(value, bool) and 0.0 < float(value) < math.inf, float(value))


def _parse_delimiter(value):
    text = {"tab": "\t", "space": " "}.get(value, value)
    valid = len(text) == 1 and text.isascii() and not text.isalnum() and text not in "\"\n\r.+-_#'"
    return _require(valid, text)


def _parse_numbers(quantity, value, is_factor):
    """Return one number, or one for each joint; YAML 1.1 reads 1e-9 as text."""
    numbers = []
    for number in value if isinstance(value, list | tuple) and quantity != "time" else [value]:
        is_unit = is_factor and isinstance(number, str)
        factor = factor_of(quantity, number) if is_unit else None
        factor = _require(not isinstance(number, bool), number) if factor is None else factor
        numbers.append(float(factor))
    is_valid = np.isfinite(numbers).all() and (np.all(numbers) or not is_factor)
    return _require(is_valid, tuple(numbers))


def _parse_mixing(value):
    matrix = np.array(value, float)
    return _require(np.linalg.cond(matrix, 1) < 1e12, tuple(map(tuple, matrix.tolist())))


def _checked(valid, expected):
    """Return a parser that accepts valid values unchanged, and its expectation."""
    return lambda value: _require(valid(value), value), expected


_COLUMNS = (
    _parse_quantity,
    f"a column, a pattern with {JOINT} once, or a list of names or numbers from 0, each once",
)
_PARSERS = {
    "time": (
        lambda value: _parse_entries(value, count=2),
        "one column, or two: seconds and nanoseconds",
    ),
    "rate": (_parse_rate, "a finite number > 0 [Hz]"),
    **dict.fromkeys(QUANTITIES, _COLUMNS),
    "joints": (lambda value: _parse_entries(value, (str,)), "a list of names, each once"),
    "names": (_parse_entries, "a list of columns, each once"),
    "scale": _checked(lambda value: isinstance(value, Mapping), f"one of {', '.join(UNITS)}"),
    "offset": _checked(lambda value: isinstance(value, Mapping), f"one of {', '.join(QUANTITIES)}"),
    "mixing": (_parse_mixing, "rows of an invertible matrix"),
    "header": _checked(lambda value: value in (True, False), "true or false"),
    "delimiter": (_parse_delimiter, "one character, such as ',', or tab or space"),
    "decimal": _checked(lambda value: value in (".", ","), "'.' or ','"),
    "skip": _checked(lambda value: type(value) is int and value >= 0, "a whole number from 0"),
}
"""Parser of each key, which raises ValueError, and the text on its expected values."""
_NUMBERS = {
    "scale": (
        partial(_parse_numbers, is_factor=True),
        "finite numbers other than 0, or units, one or one for each joint",
    ),
    "offset": (
        partial(_parse_numbers, is_factor=False),
        "finite numbers, one or one for each joint",
    ),
}
