# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joint states and odometry as rclpy reads them."""

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState


def read_joint_state(raw):
    """JointState of its bytes; whatever rclpy raises where they are none."""
    return deserialize_message(raw, JointState)


def read_odometry(raw):
    """Odometry of its bytes; likewise."""
    return deserialize_message(raw, Odometry)
