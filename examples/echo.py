# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Print messages of a topic as JSON, for at most 60 s: TOPIC [--once] [--field NAME]."""

import json
import signal
import sys
from pydoc import locate

import rclpy
from rclpy.qos import qos_profile_best_available


def fields(value):
    """Return the fields of a message, or the entries of an array."""
    names = getattr(value, "get_fields_and_field_types", dict)()
    return {name: getattr(value, name) for name in names} if names else list(value)


def show(message):
    """Print a message or one of its fields as JSON, and a field of text as it is."""
    part = getattr(message, args[args.index("--field") + 1]) if "--field" in args else message
    print(part if isinstance(part, str) else json.dumps(part, default=fields, indent=2), flush=True)
    if "--once" in args:
        sys.exit()


topic, *args = sys.argv[1:]
signal.alarm(60)
rclpy.init()
for number in signal.SIGINT, signal.SIGPIPE:  # Ctrl-C, and the end of a reader
    signal.signal(number, signal.SIG_DFL)
node = rclpy.create_node("echo")
while not (publishers := node.get_publishers_info_by_topic(topic)):
    rclpy.spin_once(node, timeout_sec=0.1)
kind = locate(publishers[0].topic_type.replace("/", "."))
node.create_subscription(kind, topic, show, qos_profile_best_available)
rclpy.spin(node)
