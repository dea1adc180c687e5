# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a node by a table.

They are declared with type, description and range, and checked when they are set.
"""

import os
from contextlib import suppress
from importlib import import_module

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.parameter import Parameter
from rclpy.task import Future

from diag_dynamics.entries import split_arguments
from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.clocks import NodeTime
from diag_dynamics.nodes.support.guard import attempt
from diag_dynamics.nodes.support.topics import NODES
from diag_dynamics.numerics.progress import set_progress_callback
from diag_dynamics.parameters.spec import check, nearest
from diag_dynamics.text import shortened

NOT_OVERRIDES = ("use_sim_time", "start_type_description_service")
"""Parameters that rclpy declares."""


class TableNode:
    """Base of nodes whose parameters are in a table `specs`, beside Node or LifecycleNode.

    `values` are those in force by name, `overrides` those that the node was started with, also
    unknown ones. `time` is the
    :class:`NodeTime`. The future `finished` ends the node, see :func:`runner.run`.
    """

    def __init__(self, name, specs, time=NodeTime, **options):
        super().__init__(name, automatically_declare_parameters_from_overrides=True, **options)
        self.time = time(self)
        self.finished = Future()
        self.overrides = {}
        for parameter in self.get_parameters_by_prefix("").values():
            if parameter.name not in NOT_OVERRIDES:
                self.overrides[parameter.name] = parameter.value
                self.undeclare_parameter(parameter.name)  # until it is declared with its type
        self.values = {name: _declare(self, name, spec) for name, spec in specs.items()}
        defaults = {name: spec.default for name, spec in specs.items()}
        if hasattr(self, "add_pre_set_parameters_callback"):  # not in Humble
            self.add_pre_set_parameters_callback(
                lambda new: [self._converted(parameter, defaults) for parameter in new]
            )

    def declare_parameters(self, namespace, parameters, ignore_override=False):
        """Declare parameters as rclpy does, also overrides that are empty lists.

        Empty lists have no type.
        """
        for _, *value_and_descriptor in parameters:
            if value_and_descriptor[:1] == [None]:
                value_and_descriptor[1].dynamic_typing = True
        return super().declare_parameters(namespace, parameters, ignore_override)

    def _converted(self, parameter, defaults):
        """Return a parameter with the type of its default; rclpy rejects wrong ones."""
        if parameter.name not in defaults or parameter.type_ == Parameter.Type.NOT_SET:
            return parameter
        value, fault = attempt(convert, parameter.name, parameter.value, defaults[parameter.name])
        return parameter if fault else Parameter(parameter.name, value=value)

    def log_debug(self, text):
        """Log a text, shortened and without control characters."""
        self.get_logger().debug(shortened(text))

    def log_info(self, text):
        """See log_debug."""
        self.get_logger().info(shortened(text))

    def log_warning(self, text):
        """See log_debug."""
        self.get_logger().warning(shortened(text))

    def log_error(self, text):
        """See log_debug."""
        self.get_logger().error(shortened(text))

    def destroy_node(self):
        """See rclpy; the compiler reports to stderr from now on."""
        set_progress_callback(None)
        super().destroy_node()


def _declare(node, name, spec):
    """Declare one parameter and return its value."""
    value = spec.default
    if name in node.overrides:
        value = convert(name, node.overrides[name], spec.default)
        kind = Parameter.Type.from_parameter_value(spec.default)
        if Parameter.Type.from_parameter_value(value) != kind:
            raise InvalidParameterTypeException(Parameter(name, value=value), kind.name)
    check(name, value, spec)
    descriptor = ParameterDescriptor(description=spec.description, read_only=spec.read_only)
    constraints = ["one of " + ", ".join(map(str, spec.choices))] if spec.choices else []
    constraints += (
        ["changes only while the node is unconfigured"] if spec.while_unconfigured else []
    )
    descriptor.additional_constraints = "; ".join(constraints)
    if spec.minimum is not None:
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=spec.minimum, to_value=spec.maximum)
        ]
    return node.declare_parameter(name, value, descriptor, ignore_override=True).value


def convert(name, value, default):
    """Return the value of a parameter with the type of its default where that is clear.

    Otherwise return the value as it is. An empty list has no type, and `ros2 param set` sends a
    list of integers and floats as a text. Paths of files become absolute, because other nodes read
    them in other folders.
    """
    if isinstance(value, str) and value and name.endswith(("_file", "robot_description")):
        return _absolute(value)
    if isinstance(default, float) and type(value) is int:
        return float(value)
    if not isinstance(default, list):
        return value
    of_numbers = isinstance(default[0], float)
    if of_numbers and isinstance(value, str):
        with suppress(ValueError):
            return [float(entry) for entry in value.strip(" []").split(",")]
    if isinstance(value, (str, bool, int, float)):
        return value
    if not value:
        if of_numbers:
            raise InputError(f"parameter '{name}' is []; expected {len(default)} numbers.")
        return [""]
    return [float(entry) if of_numbers and type(entry) is int else entry for entry in value]


def _absolute(value):
    """Return a path with its folder, and other texts as they are.

    Arguments of xacro may follow the path.
    """
    path, _ = split_arguments(value)
    file = os.path.expanduser(path)
    return value.replace(path, os.path.abspath(file), 1) if os.path.isfile(file) else value


def judge(node, specs, take):
    """Check new values of the parameters of a table, and warn of overrides with unknown names.

    `take` is called with the new values by name; it applies all of them, or raises and changes
    nothing.
    """

    def check_and_take(parameters):
        changed = {
            parameter.name: parameter.value
            for parameter in parameters
            if parameter.name in specs and parameter.value is not None
        }
        for name, value in changed.items():
            check(name, value, specs[name])
            if (
                specs[name].while_unconfigured
                and not node.is_unconfigured
                and value != node.values[name]
            ):
                raise InputError(
                    f"parameter '{name}' is read-only while the node is configured. "
                    "Call cleanup first."
                )
        take(changed)

    def callback(parameters):
        _, fault = attempt(check_and_take, parameters)
        if fault is None:
            return SetParametersResult(successful=True)
        if fault.is_internal:
            node.log_error(f"Parameters rejected: {fault.reason}")
        return SetParametersResult(successful=False, reason=fault.reason)

    _warn_unknown(node)
    node.add_on_set_parameters_callback(callback)


def _warn_unknown(node):
    """Warn of overrides that no node of this package declares, and name the nearest parameter."""
    declared = [parameter.name for parameter in node.get_parameters_by_prefix("").values()]
    unknown = {name for name in node.overrides if not name.startswith("qos_overrides.")}
    unknown -= {*declared}
    for table in NODES if unknown else ():  # a section /** is of all nodes
        module = import_module(f"diag_dynamics.parameters.{table}")
        unknown -= {*module.PARAMETERS, getattr(module, "COMPENSATES", "")}
    for name in sorted(unknown):
        meant = nearest(name, declared)
        question = f" Did you mean '{meant}'?" if meant else ""
        node.log_warning(f"Unknown parameter '{name}' ignored.{question}")
