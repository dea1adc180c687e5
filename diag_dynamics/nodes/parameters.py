"""Declaring parameters from a table: type, default, description, range, and when they may change."""

import math
from typing import Any, NamedTuple

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.overrides import convert

ALL = "*"
"""Stands for every joint that has no entry of its own."""


LARGEST = 1e9
"""Largest number that a parameter takes, but for those that say otherwise."""


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


def declare(node, specs):
    """Declare all parameters of a table and return their values by name."""
    convert(node, {name: spec.default for name, spec in specs.items()})
    values = {}
    for name, spec in specs.items():
        descriptor = ParameterDescriptor(description=spec.description, read_only=spec.read_only)
        constraints = ["one of " + ", ".join(map(str, spec.choices))] if spec.choices else []
        constraints += ["changes only while the node is unconfigured"] if spec.while_unconfigured else []
        descriptor.additional_constraints = "; ".join(constraints)
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
        return f"parameter '{name}' is {value!r}, expected one of {', '.join(map(str, spec.choices))}"
    numbers = value if isinstance(spec.default, list) and isinstance(spec.default[0], float) else [value]
    if any(isinstance(number, float) and not math.isfinite(number) for number in numbers):
        return f"parameter '{name}' is {value!r}, expected finite numbers"
    if numbers is value and len(numbers) != len(spec.default):
        return f"parameter '{name}' is {list(value)!r}, expected {len(spec.default)} numbers"
    if numbers is value and any(abs(number) > spec.maximum for number in numbers):
        return f"parameter '{name}' is {list(value)!r}, expected numbers within ±{spec.maximum:g}"
    return None


def assignments(parameter, entries, kind=float, minimum=None):
    """Values by name from strings such as ``joint=0.5``.

    Parameters
    ----------
    parameter : str
        Whose entries they are.
    entries : sequence of str
        Empty strings count for nothing: an empty list of strings cannot be told from one of anything else.
    kind : {float, bool, str}
        What stands behind the last ``=``.
    minimum : float or None
        Smallest number allowed; the largest is :data:`LARGEST`, either way.

    Raises
    ------
    InputError
        An entry is malformed, of the wrong kind or out of range, or a name has two.
    """
    values = {}
    for entry in entries:
        if not entry:
            continue
        name, equals, text = entry.rpartition("=")
        name, text = name.strip(), text.strip()
        if not equals or not name:
            raise InputError(f"parameter '{parameter}' has {entry!r}, expected name={_EXPECTED[kind]}.")
        if name in values:
            raise InputError(f"parameter '{parameter}' has two entries for '{name}'.")
        value = _parsed(text, kind)
        if value is None:
            raise InputError(f"parameter '{parameter}' has {entry!r}, expected name={_EXPECTED[kind]}.")
        if minimum is not None and value < minimum:
            raise InputError(f"parameter '{parameter}' has {entry!r}, expected no less than {minimum:g}.")
        if kind is float and abs(value) > LARGEST:
            raise InputError(f"parameter '{parameter}' has {entry!r}, expected a number within ±{LARGEST:g}.")
        values[name] = value
    return values


_EXPECTED = {float: "number", bool: "true or name=false", str: "text"}


def _parsed(text, kind):
    """The value of a text, or None."""
    if kind is bool:
        return {"true": True, "false": False}.get(text.lower())
    if kind is str:
        return text
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def by_name(parameter, entries, names):
    """Entries with :data:`ALL` written out for these names.

    Raises
    ------
    InputError
        An entry for another name.
    """
    for name in entries:
        if name != ALL and name not in names:
            raise InputError(f"parameter '{parameter}' names '{name}', which is no joint whose state is needed here.")
    if ALL in entries:
        return {name: entries.get(name, entries[ALL]) for name in names}
    return dict(entries)
