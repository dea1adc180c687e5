"""Declaring parameters from a table: type, default, description, range, and whether they change at run time."""

import math
from typing import Any, NamedTuple

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor

from diag_dynamics.exceptions import InputError


class Spec(NamedTuple):
    """One parameter: its description says the unit; `minimum` and `maximum` bound a float."""

    default: Any
    description: str
    read_only: bool = False
    minimum: float | None = None
    maximum: float = 1e9
    choices: tuple = ()


def declare(node, specs):
    """Declare all parameters of a table and return their values by name."""
    values = {}
    for name, spec in specs.items():
        descriptor = ParameterDescriptor(description=spec.description, read_only=spec.read_only)
        if spec.choices:
            descriptor.additional_constraints = "one of " + ", ".join(spec.choices)
        if spec.minimum is not None:
            descriptor.floating_point_range = [FloatingPointRange(from_value=spec.minimum, to_value=spec.maximum)]
        values[name] = node.declare_parameter(name, spec.default, descriptor).value
        reason = wrong(name, values[name], specs)
        if reason:
            raise InputError(reason + ".")
    return values


def wrong(name, value, specs):
    """Why a value is not acceptable, or None."""
    spec = specs.get(name)
    if spec is None:
        return None
    if spec.choices and value not in spec.choices:
        return f"parameter '{name}' is {value!r}, expected one of {', '.join(spec.choices)}"
    numbers = value if isinstance(spec.default, list) and isinstance(spec.default[0], float) else [value]
    if any(isinstance(number, float) and not math.isfinite(number) for number in numbers):
        return f"parameter '{name}' is {value!r}, expected finite numbers"
    if numbers is value and len(numbers) != len(spec.default):
        return f"parameter '{name}' is {list(value)!r}, expected {len(spec.default)} numbers"
    return None
