# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Odometry as rclpy reads it."""

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message


def read_odometry(raw):
    """Odometry of its bytes; whatever rclpy raises where they are none."""
    return deserialize_message(raw, Odometry)
