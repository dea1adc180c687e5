# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Spec of a parameter, the check of a value, and names and values from before version 0.2, accepted until 0.3."""

import math
import warnings
from typing import Any, NamedTuple

from diag_dynamics.entries import LARGEST


class Spec(NamedTuple):
    """One parameter: default, description with unit, range of a float or of ±`maximum` for a list, and when it may change.

    A list has the length of its default, or any if the default is a single number.
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
    return {name: spec._replace(read_only=False, while_unconfigured=True) for name, spec in specs.items()}


def wrong(name, value, specs):
    """Return why a value is not acceptable, or None."""
    spec = specs.get(name)
    if spec is None:
        return None
    is_list = isinstance(spec.default, list) and isinstance(spec.default[0], float)
    numbers, expected = value if is_list else [value], None
    if spec.choices and value not in spec.choices:
        expected = f"one of {', '.join(map(str, spec.choices))}"
    elif any(isinstance(number, float) and not math.isfinite(number) for number in numbers):
        expected = "finite numbers"
    elif is_list and len(numbers) != len(spec.default) > 1:
        expected = f"{len(spec.default)} numbers"
    elif is_list and any(abs(number) > spec.maximum for number in numbers):
        expected = f"numbers within ±{spec.maximum:g}"
    return expected and f"parameter '{name}' is {list(value) if is_list else value!r}, expected {expected}"


# --- Names and values before version 0.2

RENAMED = {
    **{
        f"absurd.{limit}": f"plausibility.{limit}"
        for limit in ("position", "velocity", "effort", "beyond_limits", "beyond_velocity", "beyond_effort", "jump")
    },
    "frozen_timeout": "stuck_timeout",
    "frozen_values": "stuck_values",
}
"""Current names by old ones."""

RENAMED_VALUES = {name: {"refuse": "reject"} for name in ("foreign_time", "missing_velocity", "stuck_values")}
"""Current values by old ones, by the current name of the parameter."""


def warn_user(text):
    """Warn by Python's warnings."""
    warnings.warn(text, FutureWarning, stacklevel=3)


def current(name, value, warn=warn_user):
    """Return the current name and value of a parameter; call `warn` with a text if either is an old one."""
    new_name = RENAMED.get(name, name)
    values = RENAMED_VALUES.get(new_name, {})
    new_value = values.get(value, value) if isinstance(value, str) else value
    if new_name != name:
        warn(f"Parameter '{name}' is renamed to '{new_name}'. Version 0.3 rejects the old name.")
    if new_value != value:
        warn(f"Parameter '{new_name}' is '{value}'; expected '{new_value}'. Version 0.3 rejects the old value.")
    return new_name, new_value


def current_parameters(values, warn=warn_user):
    """Return parameters by their current names; a value under the current name replaces one under the old name."""
    old_first = sorted(values.items(), key=lambda item: item[0] not in RENAMED)
    return dict(current(name, value, warn) for name, value in old_first)
