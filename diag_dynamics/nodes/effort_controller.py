"""Asking the effort controller for the order of its joints, in bounded time and within a transition."""

import time

import rclpy
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor


def joints_of_controller(node, controller, topic, patience):
    """The parameter `joints` of another node; None if there is no such node, or it does not answer.

    Nodes that start together do not know of each other at once: it is waited for until somebody listens to its topic.

    Parameters
    ----------
    node : rclpy.node.Node
        Who asks; its own executor is busy with what has called this.
    controller : str
        Name of the other node, with its namespace.
    topic : str
        What it listens to.
    patience : float
        Longest wait [s].

    Returns
    -------
    list of str or None
    """
    deadline = time.monotonic() + patience
    while not _is_there(node, controller):
        if time.monotonic() >= deadline or node.count_subscribers(topic):
            return None
        time.sleep(0.02)  # a change of the graph wakes the node's executor, which waits for this
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
            future = client.call_async(GetParameters.Request(names=["joints"]))
            executor.spin_until_future_complete(future, timeout_sec=min(left, 0.3))
            if future.done():
                values = future.result().values
                known = values and values[0].type == ParameterType.PARAMETER_STRING_ARRAY
                return list(values[0].string_array_value) if known else None
        return None
    finally:
        executor.shutdown()
        asking.destroy_node()


def _is_there(node, name):
    return name in {f"{namespace.rstrip('/')}/{other}" for other, namespace in node.get_node_names_and_namespaces()}
