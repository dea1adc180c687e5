# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a node by a table: declared with type, default, description and range, and judged when they are set."""

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.guard import attempt
from diag_dynamics.nodes.support.managed import UNCONFIGURED
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


def judge(node, specs, values, take):
    """Judge parameters of a table whenever somebody sets them.

    Each value is held against its Spec, and what only an unconfigured node may take over is refused later on.

    Parameters
    ----------
    node : ManagedNode
    specs : dict
        :class:`Spec` by name.
    values : callable
        Returns the values in force, by name.
    take : callable
        Called with those that are set, by name, be they in the table or not, and with those that are; takes these over, or
        raises and changes nothing.
    """

    def try_to_take(parameters):
        given = {parameter.name: parameter.value for parameter in parameters}
        changed = {name: value for name, value in given.items() if name in specs and value is not None}
        in_force = values()
        for name, value in changed.items():
            if reason := wrong(name, value, specs):
                raise InputError(f"{reason}.")
            if specs[name].while_unconfigured and node.phase != UNCONFIGURED and value != in_force[name]:
                raise InputError(f"parameter '{name}' is read-only while the node is configured: clean it up first.")
        take(given, changed)

    def callback(parameters):
        _, fault = attempt(try_to_take, parameters)
        if fault is None:
            return SetParametersResult(successful=True)
        if fault.is_internal:
            node.get_logger().error(f"Parameters refused: {fault.text}")
            return SetParametersResult(successful=False, reason=f"internal error: {fault.text}")
        return SetParametersResult(successful=False, reason=fault.text)

    node.add_on_set_parameters_callback(callback)
