# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Call a service as `ros2 service call` does."""

import argparse
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
    for name in values:
        if name not in types:
            parser.error(f"REQUEST has '{name}'; expected fields of {', '.join(types) or 'none'}.")
    return kind(**{name: convert(types[name], value) for name, value in values.items()})


parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("service")
parser.add_argument("type", help="such as rcl_interfaces/srv/GetParameters")
parser.add_argument("request", nargs="?", default="{}", help="fields in YAML")
args = parser.parse_args()
service = locate(args.type.replace("/", "."))
if not hasattr(service, "Request"):
    parser.error(f"TYPE is '{args.type}'; expected the type of a service. Is it installed?")
try:
    request = fill(service.Request, yaml.safe_load(args.request))
except (AssertionError, AttributeError, TypeError, ValueError, yaml.YAMLError) as error:
    parser.error(f"REQUEST is '{args.request}'; expected fields of the type. {error}")
rclpy.init()
node = rclpy.create_node("call")
client = node.create_client(service, args.service)
client.wait_for_service(timeout_sec=30.0)
rclpy.spin_once(node, timeout_sec=0.5)  # until the server has discovered the client
future = client.call_async(request)
rclpy.spin_until_future_complete(node, future, timeout_sec=30.0)
print(future.result() or f"{args.service} did not respond within 30 s")
sys.exit(0 if future.done() else 1)
