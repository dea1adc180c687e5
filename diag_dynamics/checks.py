# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of arguments. Each raises an InputError that names argument, value and expectation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import InputError
from diag_dynamics.text import listed

_FLOAT = np.dtype(np.float64)

_Kind = TypeVar("_Kind")


def array_of(value: object) -> Array | None:
    """Return a value as a new float64 array; None for texts, truth values and ragged lists.

    None for a Series with names, too, because its order may be another one: see :func:`in_order`.
    """
    if has_names(value):
        return None
    try:
        array = np.array(value)
    except (TypeError, ValueError):
        return None
    if array.dtype is _FLOAT:
        return array
    return array.astype(_FLOAT) if array.dtype.kind in "fiu" else None


def instance(name: str, value: object, kind: type[_Kind]) -> _Kind:
    """Return the value if it is an object of a class."""
    if not isinstance(value, kind):
        raise InputError(f"{name} is {value!r}; expected an object of class {kind.__name__}.")
    return value


def choice(name: str, value: object, choices: Iterable[object]) -> None:
    """Reject a value that is not one of the choices."""
    if value not in (choices := tuple(choices)):
        raise InputError(f"{name} is {value!r}; expected one of {', '.join(map(repr, choices))}.")


def mapping(
    name: str, value: object, known: Sequence[str] = (), required: Sequence[str] = ()
) -> Mapping[Any, Any]:
    """Return a dict, or a NamedTuple as one, that has the required keys.

    If `known` has keys, all others are rejected.
    """
    value = value._asdict() if hasattr(value, "_asdict") else value
    if not isinstance(value, Mapping):
        raise InputError(f"{name} is {value!r}; expected a dict by name.")
    for key in required:
        if key not in value:
            raise InputError(f"{name} has no {key}; expected {', '.join(required)}.")
    for key in value if known else ():
        if key not in known:
            raise InputError(f"{name} has {key!r}; expected one of {', '.join(known)}.")
    return value


def whole(name: str, value: object) -> int:
    """Return an integer >= 1."""
    expected = "a whole number >= 1"
    return int(number(name, value, expected, lambda x: x >= 1.0 and x.is_integer()))


def number(
    name: str, value: object, expected: str, valid: Callable[[float], bool] = math.isfinite
) -> float:
    """Return a finite number for which `valid` is true; errors say `expected`."""
    x = value if type(value) is float else _single(value)
    if not (math.isfinite(x) and valid(x)):
        raise InputError(f"{name} is {value!r}; expected {expected}.")
    return x


def _single(value: object) -> float:
    array = array_of(value)
    return math.nan if array is None or array.shape else float(array)


def positive(name: str, value: object, unit: str) -> float:
    """Return a finite number > 0."""
    return number(name, value, f"a finite number > 0 {unit}", lambda x: x > 0.0)


def not_negative(name: str, value: object, unit: str) -> float:
    """Return a finite number >= 0."""
    return number(name, value, f"a finite number >= 0 {unit}", lambda x: x >= 0.0)


def numbers(
    name: str, value: object, shape: tuple[int, ...], expected: str, most: float = np.inf
) -> Array:
    """Return finite numbers of a shape within ±`most` as a new array; errors say `expected`."""
    array = array_of(value)
    if array is None or array.shape != shape or not np.isfinite(array).all():
        raise InputError(f"{name} is {value!r}; expected {expected}.")
    if most < np.inf and (np.abs(array) > most).any():
        raise InputError(f"{name} is {value!r}; expected {expected}, none beyond ±{most:g}.")
    return array


def unit(name: str, value: object) -> Array:
    """Return the unit vector along three finite numbers that are not all zero."""
    u = numbers(name, value, (3,), "three finite numbers, not all zero")
    largest = np.abs(u).max()
    if not largest > 0.0:
        raise InputError(f"{name} is {u.tolist()}; expected three finite numbers, not all zero.")
    u /= largest
    return u / np.linalg.norm(u)


def in_order(name: str, value: Any, names: Sequence[str]) -> Any:
    """Return the numbers of a dict, Series or DataFrame in the order of the names.

    Values of other types are returned unchanged.
    """
    if has_names(value):
        labels = list(value.keys())
        entries = dict(value.items())
        if len(entries) < len(labels):
            twice = next(label for label in labels if labels.count(label) > 1)
            raise InputError(f"{name} has {twice!r} twice; expected each name once.")
    elif isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise InputError(f"{name} has {np.ma.count_masked(value)} masked entries; expected none.")
    else:
        return value
    for label in entries:
        if label not in names:
            joints = "joints with an entry of their own, which mimic, locked and fixed ones lack"
            expected = f"names of {joints}; they are {listed(names)}"
            raise InputError(f"{name} has {label!r}; expected {expected}.")
    missing = [label for label in names if label not in entries]
    if missing:
        raise InputError(f"{name} lacks {listed(missing)}; expected one entry for each name.")
    columns = [np.asarray(entries[label]) for label in names]
    if len({column.shape for column in columns}) > 1:
        raise InputError(f"{name} has columns of several lengths; expected one length.")
    return np.stack(columns, axis=-1) if columns else np.empty(0)


def has_names(value: Any) -> bool:
    """Return whether a value has names: a dict, or a Series or DataFrame not numbered from 0."""
    if not hasattr(value, "keys"):
        return False
    labels = list(value.keys())
    return isinstance(value, Mapping) or labels != list(range(len(labels)))


def vector(name: str, value: Any, names: Sequence[str], *, finite: bool = True) -> Array:
    """Return a number for each name as a new array; the value may be a dict or a Series by name.

    It is a copy, because another thread could change the argument between its check and a sweep.
    """
    if type(value) is np.ndarray and value.dtype is _FLOAT and value.shape == (len(names),):
        array = value.copy()
    else:
        array = _numeric(name, in_order(name, value, names), "a vector")
        if array.shape != (len(names),):
            expected = f"({len(names)},): one entry for each of {listed(names)}"
            raise InputError(f"{name} has shape {array.shape}; expected {expected}.")
        array = np.array(array, dtype=_FLOAT)
    if finite:
        check_finite(name, array, names)
    return array


def rows(name: str, value: Any, names: Sequence[str], count: int | None = None) -> Array:
    """Return a contiguous array with a row for each state: `count` rows, if it is a number."""
    value = in_order(name, value, names)
    if isinstance(value, (list, tuple)):
        value = [in_order(f"{name}[{t}]", row, names) for t, row in enumerate(value)]
    array = _numeric(name, value, "an array")
    if array.ndim != 2 or array.shape[1] != len(names) or count not in (None, len(array)):
        expected = f"({'T' if count is None else count}, {len(names)}): a row for each state"
        raise InputError(f"{name} has shape {array.shape}; expected {expected}.")
    return np.ascontiguousarray(array, dtype=_FLOAT)


def is_rows(value: Any) -> bool:
    """Return whether a value is rows of many states, or columns by name."""
    if isinstance(value, np.ndarray):
        return value.ndim == 2
    if isinstance(value, (list, tuple)):
        return all(map(_is_row, value)) and len({len(row) for row in value}) == 1
    if isinstance(value, Mapping):
        return any(isinstance(x, (list, tuple)) or getattr(x, "ndim", 0) for x in value.values())
    return np.ndim(value) == 2


def _is_row(value: Any) -> bool:
    return isinstance(value, (list, tuple, Mapping)) or getattr(value, "ndim", 0) == 1


def _numeric(name: str, value: Any, kind: str) -> Any:
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise InputError(f"{name} is ragged ({error}); expected {kind} of numbers.") from error
    if array.dtype.kind not in "fiu":
        raise InputError(f"{name} has dtype {array.dtype}; expected {kind} of numbers.")
    return array


def check_finite(name: str, values: Array, names: Sequence[str]) -> None:
    """Reject a vector, or rows, with an entry that is not finite."""
    if not math.isfinite(np.vdot(values, values)) and not np.isfinite(values).all():
        *state, k = np.argwhere(~np.isfinite(values))[0]
        entry = f"{name} of joint '{names[k]}'"
        entry = f"state {state[0]}: {entry}" if state else entry
        raise InputError(f"{entry} is {values[(*state, k)]}; expected a finite number.")


def per_name(
    name: str,
    value: object,
    names: Sequence[str],
    expected: str = "a finite number > 0",
    valid: Callable[[float], bool] = lambda x: 0.0 < x < np.inf,
) -> Array:
    """Return a number for each name as a read-only vector; the value may be one number for all.

    It may be a dict or a Series by name. Each number must be `valid`; errors say `expected`.
    """
    array = array_of(in_order(name, value, names))
    n = len(names)
    if array is None or array.shape not in ((), (n,)):
        each = f"{n} such: one for each of {', '.join(names)}"
        raise InputError(f"{name} is {value!r}; expected {expected}, or {each}.")
    array = np.array(np.broadcast_to(array, (n,)))
    for label, x in zip(names, array, strict=True):
        if not valid(x):
            raise InputError(f"{name} of '{label}' is {x}; expected {expected}.")
    array.flags.writeable = False
    return array
