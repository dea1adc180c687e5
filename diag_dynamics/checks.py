"""Arguments, checked: each wrong one is named, with its value and what was expected."""

import math
from collections.abc import Mapping

import numpy as np

from diag_dynamics.exceptions import InputError

_FLOAT = np.dtype(np.float64)


def array_of(value):
    """A value as a new float64 array; None if it is not of numbers, as texts, truth values and ragged lists are not."""
    try:
        array = np.array(value)
    except (TypeError, ValueError):
        return None
    if array.dtype is _FLOAT:
        return array
    return array.astype(_FLOAT) if array.dtype.kind in "fiu" else None


def instance(name, value, kind):
    """The value, if it is an object of a class.

    Raises
    ------
    InputError
        It is none.
    """
    if not isinstance(value, kind):
        raise InputError(f"{name} is {value!r}, expected a {kind.__name__}.")
    return value


def choice(name, value, choices):
    """Refuse a value that is none of the choices.

    Raises
    ------
    InputError
        It is none.
    """
    if value not in choices:
        raise InputError(f"{name} is {value!r}, expected one of {', '.join(map(repr, choices))}.")


def mapping(name, value):
    """The value, if it is a dict.

    Raises
    ------
    InputError
        It is none.
    """
    if not isinstance(value, Mapping):
        raise InputError(f"{name} is {value!r}, expected a dict by name.")
    return value


def whole(name, value):
    """A whole number from one on, as an int.

    Raises
    ------
    InputError
        It is none.
    """
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise InputError(f"{name} is {value!r}, expected a whole number >= 1.")
    return int(value)


# --- One number


def number(name, value, expected, valid=math.isfinite, unit=""):
    """A finite number, as a float.

    Parameters
    ----------
    expected : str
        What was expected, with its unit.
    valid : callable
        Whether a finite number will do.
    unit : str
        Put behind the value that is refused.

    Raises
    ------
    InputError
        It is none, or will not do.
    """
    x = value if type(value) is float else _single(value)
    if not (math.isfinite(x) and valid(x)):
        raise InputError(f"{name} is {value!r}{unit}, expected {expected}.")
    return x


def _single(value):
    array = array_of(value)
    return math.nan if array is None or array.shape else float(array)


def positive(name, value, unit):
    """A finite number above zero, as a float.

    Raises
    ------
    InputError
        It is none.
    """
    return number(name, value, f"a finite number > 0 {unit}", lambda x: x > 0.0)


def not_negative(name, value, unit):
    """A finite number of zero or above, as a float.

    Raises
    ------
    InputError
        It is none.
    """
    return number(name, value, f"a finite number >= 0 {unit}", lambda x: x >= 0.0)


# --- Several numbers


def numbers(name, value, shape, expected, most=np.inf):
    """Finite numbers of a shape, as a new array; none is beyond ±`most`.

    Parameters
    ----------
    expected : str
        What was expected, with its unit.

    Raises
    ------
    InputError
        They are not such.
    """
    array = array_of(value)
    if array is None or array.shape != shape or not np.isfinite(array).all():
        raise InputError(f"{name} is {value!r}, expected {expected}.")
    if array.size and np.abs(array).max() > most:
        raise InputError(f"{name} is {value!r}, expected {expected}, none beyond ±{most:g}.")
    return array


def vector(name, value, names):
    """A finite number for each degree of freedom, as a new array; the first wrong one is named by its joint.

    Raises
    ------
    InputError
        They are not as many as names, or one is not finite.
    """
    array = array_of(value)
    if array is None or array.shape != (len(names),):
        raise InputError(f"{name} is {value!r}, expected {len(names)} finite numbers, one for each degree of freedom.")
    if not np.isfinite(array).all():
        k = int(np.argmin(np.isfinite(array)))
        raise InputError(f"{name} of joint '{names[k]}' is {array[k]}, expected a finite number.")
    return array


def per_name(name, value, names, expected="a finite number > 0", valid=lambda x: 0.0 < x < np.inf):
    """One number for all of the names, or one for each, as a new read-only vector; the first wrong one is named.

    Parameters
    ----------
    expected : str
        What was expected of each, with its unit.
    valid : callable
        Whether a number will do.

    Raises
    ------
    InputError
        Neither, or a number that will not do.
    """
    array, n = array_of(value), len(names)
    if array is None or array.shape not in ((), (n,)):
        raise InputError(f"{name} is {value!r}, expected {expected}, or {n} such: one for each of {', '.join(names)}.")
    array = np.array(np.broadcast_to(array, (n,)))
    for one, x in zip(names, array, strict=True):
        if not valid(x):
            raise InputError(f"{name} of '{one}' is {x}, expected {expected}.")
    array.flags.writeable = False
    return array
