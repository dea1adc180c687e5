# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics param`: list, get and set."""

import yaml
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.parameter import Parameter, parameter_value_to_python

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.names import nearest
from diag_dynamics.nodes.tools.session import session
from diag_dynamics.nodes.tools.yaml_messages import as_values, as_yaml


def add_arguments(parser):
    """Declare the subcommands."""
    commands = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    one = commands.add_parser("list", help="parameters of a node")
    one.add_argument("node")
    one.set_defaults(run=list_parameters)
    one = commands.add_parser("get", help="value of a parameter")
    one.add_argument("node")
    one.add_argument("parameter")
    one.set_defaults(run=get)
    one = commands.add_parser("set", help="give a parameter a value")
    one.add_argument("node")
    one.add_argument("parameter")
    one.add_argument("value", help="YAML, as 0.5, true or '[0, 0, -9.81]'")
    one.set_defaults(run=put)


def _names(graph, node):
    service = f"{graph.absolute(node)}/list_parameters"
    return graph.call(service, ListParameters, ListParameters.Request()).result.names


def _value(graph, node, name):
    """Value of a parameter, or an error that names one that is meant."""
    request = GetParameters.Request(names=[name])
    response = graph.call(f"{graph.absolute(node)}/get_parameters", GetParameters, request)
    value = parameter_value_to_python(response.values[0]) if response.values else None
    if value is None:
        names = _names(graph, node)
        if name not in names:
            near = nearest(name, names)
            raise InputError(
                f"{graph.absolute(node)} has no parameter '{name}'{f'; is {near!r} meant?' if near else '.'}"
            )
    return value


def list_parameters(chosen):
    """Print the parameters of a node."""
    with session() as graph:
        for name in sorted(_names(graph, chosen.node)):
            print(name)


def get(chosen):
    """Print the value of a parameter."""
    with session() as graph:
        value = _value(graph, chosen.node, chosen.parameter)
        print(as_yaml(as_values(value)), end="")


def put(chosen):
    """Give a parameter a value, and say why the node refuses it."""
    try:
        value = yaml.safe_load(chosen.value)
    except yaml.YAMLError as error:
        raise InputError(f"{chosen.value!r} is no YAML.") from error
    with session() as graph:
        now = _value(graph, chosen.node, chosen.parameter)
        if isinstance(now, str) and not isinstance(value, str):  # a link that is called 1
            value = chosen.value
        if isinstance(value, list) and any(isinstance(entry, float) for entry in value):
            value = [float(entry) if isinstance(entry, int) else entry for entry in value]
        if isinstance(value, list) and not value and now is not None:
            parameter = Parameter(chosen.parameter, Parameter.Type.from_parameter_value(now), value)
        else:
            try:
                parameter = Parameter(chosen.parameter, value=value)
            except (TypeError, ValueError, AssertionError) as error:
                raise InputError(f"'{chosen.value}' is no value that a parameter can have.") from error
        request = SetParameters.Request(parameters=[parameter.to_parameter_msg()])
        service = f"{graph.absolute(chosen.node)}/set_parameters"
        result = graph.call(service, SetParameters, request).results[0]
        if not result.successful:
            raise InputError(f"{graph.absolute(chosen.node)} refuses: {result.reason}")
        print("Set parameter successful")
