# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Spec of a parameter: default, description, range, when it may change; and the check of a value."""

import math
from typing import Any, NamedTuple

from diag_dynamics.entries import LARGEST


class Spec(NamedTuple):
    """One parameter: its description says the unit.

    `minimum` and `maximum` bound a float; of a list of floats each one lies within ±`maximum`.
    """

    default: Any
    description: str
    read_only: bool = False
    minimum: float | None = None
    maximum: float = LARGEST
    choices: tuple = ()
    while_unconfigured: bool = False
    """Whether a managed node takes another value only before it is configured."""


def wrong(name, value, specs):
    """Return why a value is not acceptable, or None."""
    spec = specs.get(name)
    if spec is None:
        return None
    if spec.choices and value not in spec.choices:
        return f"parameter '{name}' is {value!r}, expected one of {', '.join(map(str, spec.choices))}"
    numbers = value if isinstance(spec.default, list) and isinstance(spec.default[0], float) else [value]
    if any(isinstance(number, float) and not math.isfinite(number) for number in numbers):
        return f"parameter '{name}' is {value!r}, expected finite numbers"
    if numbers is value and len(numbers) != len(spec.default):
        return f"parameter '{name}' is {list(value)!r}, expected {len(spec.default)} numbers"
    if numbers is value and any(abs(number) > spec.maximum for number in numbers):
        return f"parameter '{name}' is {list(value)!r}, expected numbers within ±{spec.maximum:g}"
    return None
