"""Declaring parameters from a table: type, default, description, range, and whether they change at run time."""

from typing import Any, NamedTuple

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor


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
            raise ValueError(reason)
    return values


def wrong(name, value, specs):
    """Why a value is not acceptable, or None."""
    spec = specs.get(name)
    if spec is not None and spec.choices and value not in spec.choices:
        return f"parameter '{name}' is {value!r}, expected one of {', '.join(spec.choices)}"
    return None
