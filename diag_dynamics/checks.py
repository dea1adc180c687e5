# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of arguments. Each raises an InputError that names the argument, its value and what was expected."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, TypeVar

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import InputError

_FLOAT = np.dtype(np.float64)

_Kind = TypeVar("_Kind")


def array_of(value: object) -> Array | None:
    """A value as a new float64 array; None if it is not of numbers, as texts, truth values and ragged lists are not.

    What has names is none either: taken by position, a reordered Series would be other joints' numbers. See :func:`in_order`.
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
    """The value, if it is an object of a class."""
    if not isinstance(value, kind):
        raise InputError(f"{name} is {value!r}, expected a {kind.__name__}.")
    return value


def choice(name: str, value: object, choices: Iterable[object]) -> None:
    """Refuse a value that is none of the choices."""
    if value not in choices:
        raise InputError(f"{name} is {value!r}, expected one of {', '.join(map(repr, choices))}.")


def mapping(name: str, value: object) -> Mapping[Any, Any]:
    """The value, if it is a dict."""
    if not isinstance(value, Mapping):
        raise InputError(f"{name} is {value!r}, expected a dict by name.")
    return value


def whole(name: str, value: object) -> int:
    """A whole number from one on, as an int."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise InputError(f"{name} is {value!r}, expected a whole number >= 1.")
    return int(value)


# --- One number


def number(
    name: str, value: object, expected: str, valid: Callable[[float], bool] = math.isfinite, unit: str = ""
) -> float:
    """A finite number, as a float.

    Parameters
    ----------
    expected : str
        What was expected, with its unit.
    valid : callable
        Whether a finite number will do.
    unit : str
        Put behind the value that is refused.
    """
    x = value if type(value) is float else _single(value)
    if not (math.isfinite(x) and valid(x)):
        raise InputError(f"{name} is {value!r}{unit}, expected {expected}.")
    return x


def _single(value: object) -> float:
    array = array_of(value)
    return math.nan if array is None or array.shape else float(array)


def positive(name: str, value: object, unit: str) -> float:
    """A finite number above zero, as a float."""
    return number(name, value, f"a finite number > 0 {unit}", lambda x: x > 0.0)


def not_negative(name: str, value: object, unit: str) -> float:
    """A finite number of zero or above, as a float."""
    return number(name, value, f"a finite number >= 0 {unit}", lambda x: x >= 0.0)


# --- Several numbers


def numbers(name: str, value: object, shape: tuple[int, ...], expected: str, most: float = np.inf) -> Array:
    """Finite numbers of a shape, as a new array; none is beyond ±`most`.

    Parameters
    ----------
    expected : str
        What was expected, with its unit.
    """
    array = array_of(value)
    if array is None or array.shape != shape or not np.isfinite(array).all():
        raise InputError(f"{name} is {value!r}, expected {expected}.")
    if array.size and np.abs(array).max() > most:
        raise InputError(f"{name} is {value!r}, expected {expected}, none beyond ±{most:g}.")
    return array


def unit(name: str, value: object) -> Array:
    """Unit vector along three finite numbers, not all zero, as a new array."""
    u = numbers(name, value, (3,), "three finite numbers, not all zero")
    largest = np.abs(u).max()
    if not largest > 0.0:
        raise InputError(f"{name} is {u.tolist()}, expected three finite numbers, not all zero.")
    u /= largest
    return u / np.linalg.norm(u)


def in_order(name: str, value: Any, names: Sequence[str]) -> Any:
    """A dict, a pandas Series or the columns of a DataFrame by name, in the order of the names; anything else as it is.

    A Series without names, numbered from 0, is taken by position.
    """
    if isinstance(value, Mapping):
        given = dict(value)
    elif has_names(value):
        labels = value.columns if is_pandas(value, "DataFrame") else value.index
        if labels.has_duplicates:
            raise InputError(f"{name} has a name twice: {', '.join(map(str, labels[labels.duplicated()]))}.")
        given = dict(value.items())
    elif isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise InputError(
            f"{name} has {int(np.ma.count_masked(value))} masked entries: there is nothing to compute with."
        )
    else:
        return value
    for one in given:
        if one not in names:
            near = get_close_matches(str(one), names, n=1)
            meant = f"; is '{near[0]}' meant?" if near else f"; they are {listed(names)}."
            raise InputError(f"{name} has {one!r}, which is none of this robot's names{meant}")
    missing = [one for one in names if one not in given]
    if missing:
        raise InputError(f"{name} has nothing for {listed(missing)}.")
    columns = [np.asarray(given[one]) for one in names]
    if len({column.shape for column in columns}) > 1:
        raise InputError(f"{name} has not as many entries of '{names[0]}' as of all others.")
    return np.stack(columns, axis=-1) if columns else np.empty(0)


def has_names(value: Any) -> bool:
    """Whether a value is a Series or DataFrame of pandas with names, not numbered from 0."""
    if is_pandas(value, "Series"):
        return not is_pandas(value.index, "RangeIndex")
    return is_pandas(value, "DataFrame") and not is_pandas(value.columns, "RangeIndex")


def is_pandas(value: Any, kind: str) -> bool:
    """Whether a value is of a class of pandas, which need not be installed."""
    pandas = sys.modules.get("pandas")
    # While another thread imports pandas, it is there without its classes, and nobody has one of them.
    return isinstance(value, getattr(pandas, kind, ()))


def listed(names: Sequence[str], most: int = 12) -> str:
    """Names in a row, the first of them if there are many."""
    return ", ".join(names[:most]) + (", …" if len(names) > most else "")


def vector(name: str, value: object, names: Sequence[str]) -> Array:
    """A finite number for each degree of freedom, as a new array; the first wrong one is named by its joint.

    They may also be a dict or a pandas Series by name.
    """
    array = array_of(in_order(name, value, names))
    if array is None or array.shape != (len(names),):
        raise InputError(f"{name} is {value!r}, expected {len(names)} finite numbers, one for each degree of freedom.")
    if not np.isfinite(array).all():
        k = int(np.argmin(np.isfinite(array)))
        raise InputError(f"{name} of joint '{names[k]}' is {array[k]}, expected a finite number.")
    return array


def per_name(
    name: str,
    value: object,
    names: Sequence[str],
    expected: str = "a finite number > 0",
    valid: Callable[[float], bool] = lambda x: 0.0 < x < np.inf,
) -> Array:
    """One number for all of the names, or one for each, as a new read-only vector; the first wrong one is named.

    They may also be a dict or a pandas Series by name.

    Parameters
    ----------
    expected : str
        What was expected of each, with its unit.
    valid : callable
        Whether a number will do.
    """
    array, n = array_of(in_order(name, value, names)), len(names)
    if array is None or array.shape not in ((), (n,)):
        raise InputError(f"{name} is {value!r}, expected {expected}, or {n} such: one for each of {', '.join(names)}.")
    array = np.array(np.broadcast_to(array, (n,)))
    for one, x in zip(names, array, strict=True):
        if not valid(x):
            raise InputError(f"{name} of '{one}' is {x}, expected {expected}.")
    array.flags.writeable = False
    return array
