# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The order of joints of an effort controller, which is read before anything is sent."""

import time

import rclpy
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor

from diag_dynamics.nodes.support.runner import Stop

RETRY_PERIOD = 0.3
"""Time [s] after which the request is repeated: a service that does not know its client yet drops the answer."""


def joints_of_controller(node, controller, timeout):
    """Return the parameter `joints` of another node; None if it does not answer within the timeout [s].

    `node` asks, by a node of its own: its executor runs the callback that calls this.
    """
    deadline = time.monotonic() + timeout
    asking = rclpy.create_node(f"{node.get_name()}_asking", context=node.context, use_global_arguments=False)
    executor = SingleThreadedExecutor(context=node.context)
    try:
        executor.add_node(asking)
        client = asking.create_client(GetParameters, f"{controller}/get_parameters")
        while (left := deadline - time.monotonic()) > 0.0 and not Stop.requested:
            if not client.service_is_ready():
                executor.spin_once(timeout_sec=0.02)
                continue
            future = client.call_async(GetParameters.Request(names=["joints"]))
            executor.spin_until_future_complete(future, timeout_sec=min(left, RETRY_PERIOD))
            if future.done():
                values = future.result().values
                known = values and values[0].type == ParameterType.PARAMETER_STRING_ARRAY
                return list(values[0].string_array_value) if known else None
        return None
    finally:
        executor.shutdown()
        asking.destroy_node()
