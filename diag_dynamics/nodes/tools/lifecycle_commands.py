# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics lifecycle`: states of managed nodes, and transitions."""

from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.tools.session import HIDDEN, session


def add_arguments(parser):
    """Declare the subcommands."""
    commands = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    one = commands.add_parser("nodes", help="all managed nodes")
    one.set_defaults(run=nodes)
    one = commands.add_parser("get", help="state of a node")
    one.add_argument("node")
    one.set_defaults(run=get)
    one = commands.add_parser("list", help="transitions that a node's state has")
    one.add_argument("node")
    one.set_defaults(run=transitions)
    one = commands.add_parser("set", help="put a node through a transition")
    one.add_argument("node")
    one.add_argument("transition", help="configure, activate, deactivate, cleanup or shutdown")
    one.set_defaults(run=change)


def nodes(chosen):
    """Print the managed nodes."""
    with session() as graph:
        graph.look()
        for name, types in sorted(graph.node.get_service_names_and_types()):
            if "lifecycle_msgs/srv/ChangeState" in types:
                print(name.removesuffix("/change_state"))


def get(chosen):
    """Print the state of a node."""
    with session() as graph:
        print(_state(graph, chosen.node))


def transitions(chosen):
    """Print the transitions that a node's present state has."""
    with session() as graph:
        for one in _available(graph, chosen.node):
            print(f"- {one.transition.label} [{one.transition.id}]: {one.start_state.label} → {one.goal_state.label}")


def change(chosen):
    """Put a node through a transition."""
    with session() as graph:
        node = graph.absolute(chosen.node)
        found = {one.transition.label: one.transition for one in _available(graph, node)}
        if chosen.transition not in found:
            raise InputError(
                f"{node} is {_state(graph, node)}, which has no transition '{chosen.transition}'; it has {', '.join(found)}."
            )
        request = ChangeState.Request(transition=found[chosen.transition])
        if not graph.call(f"{node}/change_state", ChangeState, request, timeout=600.0).success:
            raise InputError(f"{node} refuses to {chosen.transition}; its log says why. It is {_state(graph, node)}.")
        print("Transitioning successful")


def show_nodes(chosen):
    """Print the names of all nodes."""
    with session() as graph:
        graph.look()
        for name, namespace in sorted(graph.node.get_node_names_and_namespaces(), key=lambda one: (one[1], one[0])):
            if not name.startswith(HIDDEN):
                print(f"{namespace.rstrip('/')}/{name}")


def add_node_arguments(parser):
    """Declare the subcommand of `diag-dynamics node`."""
    commands = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    commands.add_parser("list", help="names of all nodes").set_defaults(run=show_nodes)


def _state(graph, node):
    response = graph.call(f"{graph.absolute(node)}/get_state", GetState, GetState.Request())
    return f"{response.current_state.label} [{response.current_state.id}]"


def _available(graph, node):
    service = f"{graph.absolute(node)}/get_available_transitions"
    return graph.call(service, GetAvailableTransitions, GetAvailableTransitions.Request()).available_transitions
