# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Print messages of a topic as JSON, for at most 60 s."""

import argparse
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
    part = getattr(message, args.field) if args.field else message
    print(part if isinstance(part, str) else json.dumps(part, default=fields, indent=2), flush=True)
    if args.once:
        sys.exit()


parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("topic")
parser.add_argument("--once", action="store_true", help="end after one message")
parser.add_argument("--field", help="print this field alone")
args = parser.parse_args()
signal.alarm(60)
rclpy.init()
for number in signal.SIGINT, signal.SIGPIPE:  # Ctrl-C, and the end of a reader
    signal.signal(number, signal.SIG_DFL)
node = rclpy.create_node("echo")
while not (publishers := node.get_publishers_info_by_topic(args.topic)):
    rclpy.spin_once(node, timeout_sec=0.1)
kind = locate(publishers[0].topic_type.replace("/", "."))
names = kind.get_fields_and_field_types()
if args.field and args.field not in names:
    parser.error(f"--field is '{args.field}'; expected one of {', '.join(names)}.")
node.create_subscription(kind, args.topic, show, qos_profile_best_available)
rclpy.spin(node)
