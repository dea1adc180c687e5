# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Print messages as `ros2 topic echo` does, for at most 60 s: TOPIC [--once] [--field NAME]."""

import json
import signal
import sys
from pydoc import locate

import rclpy
import yaml
from rclpy.qos import qos_profile_sensor_data


def fields(value):
    """Return the fields of a message, or the entries of an array."""
    names = getattr(value, "get_fields_and_field_types", dict)()
    return {name: getattr(value, name) for name in names} if names else list(value)


def show(message):
    """Print a message or one of its fields as YAML."""
    value = getattr(message, options[-1]) if "--field" in options else message
    value = json.loads(json.dumps(value, default=fields))
    print(yaml.safe_dump(value, sort_keys=False, default_flow_style=None), flush=True)
    if "--once" in options:
        sys.exit()


topic, *options = sys.argv[1:]
signal.alarm(60)
rclpy.init()
node = rclpy.create_node("echo")
while topic not in (types := dict(node.get_topic_names_and_types())):
    rclpy.spin_once(node, timeout_sec=0.1)
kind = locate(types[topic][0].replace("/", "."))
node.create_subscription(kind, topic, show, qos_profile_sensor_data)
rclpy.spin(node)
