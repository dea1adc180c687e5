# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a node is given as parameters: made what its table wants, where that is plain; told of, where it is not known."""

from importlib import import_module

from rcl_interfaces.srv import ListParameters
from rclpy.parameter import Parameter

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.names import nearest

TABLES = ("monitor", "simulator", "view", "controller")
"""Modules with the tables of all nodes, which may share a section of a file."""

QOS = "qos_overrides."
"""Begins the names of parameters that are declared with each topic, some of them later."""


def meant(value, default):
    """The value of a parameter as its default has it, if that is plainly what is meant; else the value as it is.

    A whole number stands for a number; a list without entries, which has no type or any, for one of nothing (``[""]``, where
    entries are texts); a list of numbers of both kinds, which `ros2 param set` sends as a text, for one of numbers.
    """
    if isinstance(default, float) and type(value) is int:
        return float(value)
    if not isinstance(default, list):
        return value
    of_numbers = isinstance(default[0], float)
    if of_numbers and isinstance(value, str):
        return _numbers(value)
    if not hasattr(value, "__len__") or isinstance(value, str):
        return value
    if not len(value):
        return [] if of_numbers else [""]
    if of_numbers and all(type(entry) is int for entry in value):
        return [float(entry) for entry in value]
    return value


def _numbers(text):
    """Numbers of a text such as ``[0, 0, -9.81]``; the text, if that is none."""
    try:
        return [float(entry) for entry in text.strip().removeprefix("[").removesuffix("]").split(",")]
    except ValueError:
        return text


def convert(node, defaults):
    """Have what the node has been given and will be given be what its parameters want; `defaults` are theirs by name."""
    given = node._parameter_overrides  # rclpy has no other way to them before they are declared
    for name, default in defaults.items():
        if name in given:
            # An empty list has no type in rcl.
            value = [] if given[name].value is None and isinstance(default, list) else given[name].value
            value = meant(value, default)
            if isinstance(value, list) and not value:  # rclpy would call it a list of bytes
                raise InputError(f"parameter '{name}' is [], expected {len(default)} numbers.")
            given[name] = Parameter(name, value=value)

    def before_setting(parameters):
        return [
            _parameter(parameter.name, meant(parameter.value, defaults[parameter.name]))
            if parameter.name in defaults and parameter.type_ != Parameter.Type.NOT_SET
            else parameter
            for parameter in parameters
        ]

    if hasattr(node, "add_pre_set_parameters_callback"):  # not in Humble
        node.add_pre_set_parameters_callback(before_setting)


def _parameter(name, value):
    if isinstance(value, list) and not value:
        return Parameter(name, Parameter.Type.DOUBLE_ARRAY, value)
    return Parameter(name, value=value)


def tell_unknown(node):
    """Warn of what the node has been given under names that are nearly those of its parameters; others go to DEBUG.

    A section of a file that several nodes share (``/**``) cannot be told from a node's own, so that what is unknown may well
    be meant for another node: what is one of this package's is not told of.
    """
    unknown = [name for name in node._parameter_overrides if not node.has_parameter(name) and not name.startswith(QOS)]
    others = _of_all_nodes() if unknown else ()
    for name in unknown:
        if name in others:
            continue
        if known := nearest(name, node.list_parameters([], ListParameters.Request.DEPTH_RECURSIVE).names):
            node.get_logger().warning(f"Parameter '{name}' is not known, and has no effect: is '{known}' meant?")
        else:
            node.get_logger().debug(f"Parameter '{name}' is not known, and has no effect.")


def _of_all_nodes():
    modules = [import_module(f"diag_dynamics.parameters.{module}") for module in TABLES]
    return {name for module in modules for name in module.PARAMETERS} | {modules[-1].COMPENSATES}
