# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Call a service as `ros2 service call` does: SERVICE TYPE [REQUEST]."""

import sys
from pydoc import locate

import rclpy
import yaml


def convert(kind, value):
    """Return a value of YAML as the type of a field."""
    if isinstance(value, list):
        return [convert(kind, entry) for entry in value]
    if not isinstance(value, dict):
        return float(value) if "double" in kind else value
    name = kind.removeprefix("sequence<").removesuffix(">").replace("/", ".msg.")
    return fill(locate(name), value)


def fill(kind, values):
    """Return a message of a class."""
    types = kind.get_fields_and_field_types()
    return kind(**{name: convert(types[name], value) for name, value in values.items()})


name, kind, request = (*sys.argv[1:], "{}")[:3]
service = locate(kind.replace("/", "."))
rclpy.init()
node = rclpy.create_node("call")
client = node.create_client(service, name)
client.wait_for_service(timeout_sec=30.0)
rclpy.spin_once(node, timeout_sec=0.5)  # until the server has discovered the client
future = client.call_async(fill(service.Request, yaml.safe_load(request)))
rclpy.spin_until_future_complete(node, future, timeout_sec=30.0)
print(future.result() or f"{name} did not respond within 30 s")
sys.exit(0 if future.done() else 1)
