# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Call a service as `ros2 service call` does."""

import argparse
import sys
from pydoc import locate

import rclpy
import yaml


def convert(kind, value):
    """Return a value of YAML as a type."""
    if isinstance(value, list):
        return [convert(kind, entry) for entry in value]
    if not isinstance(value, dict):
        return float(value) if "double" in kind else value
    message = locate(kind.removeprefix("sequence<").removesuffix(">").replace("/", ".msg."))
    types = message.get_fields_and_field_types()
    if unknown := ", ".join(map(str, value.keys() - types)):
        parser.error(f"REQUEST has '{unknown}'; expected fields of {', '.join(types) or 'none'}.")
    return message(**{name: convert(types[name], entry) for name, entry in value.items()})


parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("service")
parser.add_argument("type", help="such as rcl_interfaces/srv/GetParameters")
parser.add_argument("request", nargs="?", default="{}", help="fields in YAML")
args = parser.parse_args()
name = args.type.replace("/", ".")
service = locate(name)
if not hasattr(service, "Request"):
    parser.error(f"TYPE is '{args.type}'; expected the type of a service. Is it installed?")
try:
    request = convert(f"{name}.Request", dict(yaml.safe_load(args.request)))
except (AssertionError, AttributeError, TypeError, ValueError, yaml.YAMLError) as error:
    reason = " ".join(str(error).split())
    parser.error(f"REQUEST is '{args.request}'; expected fields of the type. {reason}")
rclpy.init()
node = rclpy.create_node("call")
client = node.create_client(service, args.service)
client.wait_for_service(timeout_sec=30.0)
rclpy.spin_once(node, timeout_sec=0.5)  # until the server has discovered the client
future = client.call_async(request)
rclpy.spin_until_future_complete(node, future, timeout_sec=30.0)
print(future.result() or f"{args.service} did not respond within 30 s")
sys.exit(0 if future.done() else 1)
