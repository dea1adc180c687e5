# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A node for the time of one command."""

import os
import sys
import time
from contextlib import contextmanager

import rclpy
from rcl_interfaces.srv import GetParameterTypes
from rclpy.exceptions import InvalidServiceNameException, InvalidTopicNameException
from rclpy.signals import SignalHandlerOptions

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.names import nearest

PATIENCE = 2.0
"""Time [s] for which a command waits without saying what it waits for."""

QUIET = 1.0
"""Time [s] in which nothing new has to have been heard of, for the graph to be taken for known."""

LONGEST = 5.0
"""Time [s] for which the graph is looked at, at most."""

AGAIN = 0.5
"""Time [s] after which an answer that has not come is asked for again, where asking changes nothing."""

HIDDEN = "_"
"""Begins the names of nodes that lists leave out."""


class Session:
    """What a command does on the graph.

    Attributes
    ----------
    node : rclpy.node.Node
    """

    def __init__(self, node):
        self.node = node

    def until(self, condition, what, timeout=None, hint=lambda: ""):
        """Serve the node until a condition holds; where that takes long, what is waited for is said, and a hint.

        Raises
        ------
        InputError
            It does not within the time-out [s].
        """
        begun, told = time.monotonic(), False
        while not condition():
            rclpy.spin_once(self.node, timeout_sec=0.05)
            waited = time.monotonic() - begun
            if waited > PATIENCE and not told:
                print(f"Waiting for {what} … {hint()}".rstrip(), file=sys.stderr, flush=True)
                told = True
            if timeout is not None and waited > timeout:
                raise InputError(f"waited {timeout:g} s in vain for {what}.")

    def serve(self, until):
        """Serve the node until a time of time.monotonic."""
        while (left := until - time.monotonic()) > 0.0:
            rclpy.spin_once(self.node, timeout_sec=min(left, 0.05))

    def look(self):
        """Serve the node until nothing new is heard of."""
        begun = changed = time.monotonic()
        seen = None
        while time.monotonic() - begun < LONGEST:
            rclpy.spin_once(self.node, timeout_sec=0.05)
            node = self.node
            now = (
                node.get_topic_names_and_types(),
                node.get_node_names_and_namespaces(),
                node.get_service_names_and_types(),
            )
            if now != seen:
                seen, changed = now, time.monotonic()
            if time.monotonic() - changed > QUIET and len(now[1]) > 1:
                return

    def absolute(self, name):
        """A name of a topic, service or node as the graph has it."""
        return name if name.startswith("/") else f"/{name}"

    def kind_of(self, name, found, what, timeout):
        """The type of a topic or service, once it is there; `found` lists them all.

        Raises
        ------
        InputError
            There is none of that name; one with a similar name is named, or one of another namespace.
        """
        name = self.absolute(name)
        types = {}

        def is_there():
            types.update(found())
            return name in types

        def hint():
            asleep = _asleep(name, dict(self.node.get_service_names_and_types()))
            near = ", ".join(_namesakes(name, types)) or nearest(name, types)
            return asleep or (f"Is {near} meant?" if near else "")

        try:
            self.until(is_there, f"{what} {name}", timeout, hint)
        except InputError as error:
            more = hint() or f"Is what offers it running? Try: {what} list"
            raise InputError(f"{error} {more}") from None
        return types[name][0]

    def publishers(self, topic, patience=PATIENCE):
        """QoS of a topic's publishers, waited for so long [s]: one that is listened to is known before who publishes it."""
        begun, found = time.monotonic(), []
        while not found and time.monotonic() - begun < patience:
            rclpy.spin_once(self.node, timeout_sec=0.05)
            found = [one.qos_profile for one in self.node.get_publishers_info_by_topic(topic)]
        return found

    def call(self, service, kind, request, timeout=10.0):
        """Call a service and return its response.

        Raises
        ------
        InputError
            It is not offered, or does not answer in time.
        """
        client = self.node.create_client(kind, service)
        try:
            self.until(client.service_is_ready, f"service {service}", timeout)
            self._become_known(service.rpartition("/")[0], timeout)
            future = client.call_async(request)
            self.until(future.done, f"an answer of {service}", timeout)
            return future.result()
        finally:
            self.node.destroy_client(client)

    def _become_known(self, node, timeout):
        """Wait until a node knows of the clients made here so far, where it has parameters.

        A client may know a service before the service knows the client, and then Fast DDS throws the answer away after
        100 ms: on a busy machine the request is acted on, and nobody hears of it. A node hears of clients in the order in
        which they were made, so an answer to one made now, asked for until it comes, tells that those before it are known.
        """
        service = f"{node}/get_parameter_types"
        if service not in dict(self.node.get_service_names_and_types()):
            return
        client = self.node.create_client(GetParameterTypes, service)
        asked, due = [], 0.0

        def is_answered():
            nonlocal due
            if client.service_is_ready() and time.monotonic() >= due:
                asked.append(client.call_async(GetParameterTypes.Request()))
                due = time.monotonic() + AGAIN
            return any(future.done() for future in asked)

        try:
            self.until(is_answered, f"an answer of {node}", timeout)
        finally:
            self.node.destroy_client(client)


def _namesakes(name, names):
    """Names of the same node's topic or service in other namespaces."""
    end = name.split("/")[-2:]
    return [other for other in sorted(names) if len(end) > 1 and end[0] and other.split("/")[-2:] == end]


def _asleep(name, services):
    """That the node of a service has phases, and may not be in the one in which it offers it; else nothing."""
    parts = name.split("/")
    for k in range(len(parts) - 1, 1, -1):
        node = "/".join(parts[:k])
        if f"{node}/get_state" in services:
            return f"{node} may not be active: lifecycle get {node}"
    return ""


@contextmanager
def session():
    """Session of one command, which whoever runs it may end by an exception from a signal.

    rclpy's own handlers of signals would shut it down from another thread, and where both do so at once one of them fails.
    """
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node(
            f"{HIDDEN}diag_dynamics_{os.getpid()}", enable_rosout=False, start_parameter_services=False
        )
        yield Session(node)
        node.destroy_node()
    except (InvalidServiceNameException, InvalidTopicNameException) as error:
        raise InputError(f"{' '.join(str(error).split())}.") from error
    finally:
        rclpy.try_shutdown()
