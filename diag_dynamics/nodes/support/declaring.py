"""Declaring parameters from a table: type, default, description, range, and when they may change."""

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.overrides import convert
from diag_dynamics.parameters.spec import wrong


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
