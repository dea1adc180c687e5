# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Spec of a parameter, and the check of a value."""

import math
from difflib import get_close_matches
from typing import Any, NamedTuple

from diag_dynamics.entries import LARGEST
from diag_dynamics.exceptions import InputError


class Spec(NamedTuple):
    """One parameter: default, description with unit, range, and when it may change.

    The range is that of a float, or of ±`maximum` for a list. A list has the length of its default,
    or any if the default is a single number.
    """

    default: Any
    description: str
    minimum: float | None = None
    maximum: float = LARGEST
    choices: tuple = ()
    read_only: bool = False
    while_unconfigured: bool = False


def fixed(specs):
    """Return specs of parameters that a node reads when it starts."""
    return {name: spec._replace(read_only=True) for name, spec in specs.items()}


def while_unconfigured(specs):
    """Return specs of parameters that a managed node reads when it is configured."""
    return {
        name: spec._replace(read_only=False, while_unconfigured=True)
        for name, spec in specs.items()
    }


def nearest(name, names):
    """Return the name that is spelled like an unknown one, or None."""
    return next(iter(get_close_matches(name, names, n=1, cutoff=0.8)), None)


def check(name, value, spec):
    """Raise InputError for a value that a Spec does not accept."""
    is_list = isinstance(spec.default, list) and isinstance(spec.default[0], float)
    numbers = value if is_list else [value]
    expected = None
    if spec.choices and value not in spec.choices:
        expected = f"one of {', '.join(map(str, spec.choices))}"
    elif any(isinstance(number, float) and not math.isfinite(number) for number in numbers):
        expected = "finite numbers"
    elif is_list and len(numbers) != len(spec.default) > 1:
        expected = f"{len(spec.default)} numbers"
    elif (
        spec.minimum is not None
        and type(value) is float
        and not (spec.minimum <= value <= spec.maximum)
    ):
        expected = f"{spec.minimum:g} to {spec.maximum:g}"
    elif is_list and any(abs(number) > spec.maximum for number in numbers):
        expected = f"numbers within ±{spec.maximum:g}"
    if expected:
        text = list(value) if is_list else repr(value)
        raise InputError(f"parameter '{name}' is {text}; expected {expected}.")
