# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics service`: list, type and call."""

import sys

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.tools.session import session
from diag_dynamics.nodes.tools.yaml_messages import as_values, as_yaml, field, filled, type_of

OF_PARAMETERS = (
    "describe_parameters",
    "get_parameter_types",
    "get_parameters",
    "get_type_description",
    "list_parameters",
    "set_parameters",
    "set_parameters_atomically",
)
"""Services that every node has, left out of the list."""


def add_arguments(parser):
    """Declare the subcommands."""
    commands = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    one = commands.add_parser("list", help="names of all services")
    one.add_argument("-t", "--show-types", action="store_true", help="their types, too")
    one.add_argument("-a", "--all", action="store_true", help="those of parameters, too, which every node has")
    one.set_defaults(run=list_services)
    one = commands.add_parser("type", help="type of a service")
    one.add_argument("service")
    one.set_defaults(run=show_type)
    one = commands.add_parser("call", help="call a service and print its answer")
    one.add_argument("service")
    one.add_argument("type", nargs="?", help="as diag_dynamics/srv/SetPayload; found out if not given")
    one.add_argument("values", nargs="?", default="", help="the request in YAML, as '{link: hand, mass: 0.5}'")
    one.add_argument(
        "--field", help="print this one alone, a text as it is; with success: false nothing but the message"
    )
    one.add_argument("--timeout", type=float, default=30.0, help="longest time to wait [s] (default %(default)s)")
    one.set_defaults(run=call)


def list_services(chosen):
    """Print the names of all services."""
    with session() as graph:
        graph.look()
        for name, types in sorted(graph.node.get_service_names_and_types()):
            if chosen.all or name.rsplit("/", 1)[-1] not in OF_PARAMETERS:
                print(f"{name} [{', '.join(types)}]" if chosen.show_types else name)


def show_type(chosen):
    """Print the type of a service."""
    with session() as graph:
        print(graph.kind_of(chosen.service, graph.node.get_service_names_and_types, "service", 10.0))


def call(chosen):
    """Call a service and print its response."""
    kind_name, values = chosen.type, chosen.values
    if kind_name and kind_name.lstrip().startswith("{"):  # the type was left out
        kind_name, values = None, kind_name
    with session() as graph:
        if kind_name is None:
            kind_name = graph.kind_of(chosen.service, graph.node.get_service_names_and_types, "service", chosen.timeout)
        kind = type_of(kind_name)
        request = filled(kind.Request, values)
        response = graph.call(graph.absolute(chosen.service), kind, request, chosen.timeout)
        _show(response, chosen.field)


def _show(response, wanted):
    """Print a response, or one field of it for a file or a program, with what is said of it on stderr."""
    if wanted is None:
        print(as_yaml(as_values(response)), end="")
        return
    value, said = field(response, wanted), getattr(response, "message", "")
    if getattr(response, "success", True) is False:
        raise InputError(said or "the answer has success: false.")
    if said and value is not said:
        print(said, file=sys.stderr)
    print(as_yaml(as_values(value)), end="")
