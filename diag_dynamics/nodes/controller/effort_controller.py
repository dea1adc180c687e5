# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Asking the effort controller for the order of its joints: once before anything is sent, and again and again after that."""

import time

import rclpy
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor

AGAIN = 0.5
"""How often it is asked again [s]."""

REQUEST = GetParameters.Request(names=["joints"])


def joints_of_controller(node, controller, patience):
    """The parameter `joints` of another node; None if there is no such node, or it does not answer.

    Nodes that start together do not know of each other at once: it is waited for.

    Parameters
    ----------
    node : rclpy.node.Node
        Who asks; its own executor is busy with what has called this.
    controller : str
        Name of the other node, with its namespace.
    patience : float
        Longest wait [s].

    Returns
    -------
    list of str or None
    """
    deadline = time.monotonic() + patience
    asking = rclpy.create_node(f"{node.get_name()}_asking", context=node.context, use_global_arguments=False)
    executor = SingleThreadedExecutor(context=node.context)
    try:
        executor.add_node(asking)
        client = asking.create_client(GetParameters, f"{controller}/get_parameters")
        while not client.service_is_ready():
            if time.monotonic() > deadline:
                return None
            executor.spin_once(timeout_sec=0.02)
        while (left := deadline - time.monotonic()) > 0.0:
            # Asked again now and then: a service may not know its client yet, and throws its answer away.
            future = client.call_async(REQUEST)
            executor.spin_until_future_complete(future, timeout_sec=min(left, 0.3))
            if future.done():
                return _joints_in(future.result())
        return None
    finally:
        executor.shutdown()
        asking.destroy_node()


def _joints_in(response):
    values = response.values
    known = values and values[0].type == ParameterType.PARAMETER_STRING_ARRAY
    return list(values[0].string_array_value) if known else None


class JointsWatch:
    """Asks the same, again and again, without anybody waiting: effort controllers may come late, or come back changed.

    Parameters
    ----------
    node : rclpy.node.Node
    controller : str
        Name of the other node, with its namespace.
    told : callable
        Called with the list of joints, or with None when the other node does not answer any more.
    """

    def __init__(self, node, controller, told):
        self._node, self._told, self._asked = node, told, None
        self._client = node.create_client(GetParameters, f"{controller}/get_parameters")
        self._timer = node.create_timer(AGAIN, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _look(self):
        """Tell what was answered since the last time, and ask again."""
        if asked := self._asked:
            self._asked = None
            if asked.done() and not asked.exception():
                self._told(_joints_in(asked.result()))
            else:
                self._client.remove_pending_request(asked)
                self._told(None)
        if self._timer is None:  # who was told has ended this
            return
        if self._client.service_is_ready():
            self._asked = self._client.call_async(REQUEST)
        else:
            self._told(None)

    def end(self):
        """Ask no more."""
        self._node.destroy_timer(self._timer)
        self._node.destroy_client(self._client)
        self._timer = self._asked = None
