# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measurements of the simulated sensors as messages."""

from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState

from diag_dynamics.nodes.support.messages import doubles

WORLD = "world"
"""Frame of a floating base's pose."""


def joint_state_message(names, measured, stamp):
    """Return a JointState of these joints."""
    message = JointState(name=names)
    message.header.stamp = stamp
    message.position, message.velocity = doubles(measured.position), doubles(measured.velocity)
    message.effort = doubles(measured.effort)
    return message


def odometry_message(root_link, measured, stamp):
    """Return the Odometry of a floating base."""
    (x, y, z, *orientation), twist = measured.base
    message = Odometry(child_frame_id=root_link)
    message.header.stamp, message.header.frame_id = stamp, WORLD
    position, o, moving = message.pose.pose.position, message.pose.pose.orientation, message.twist.twist
    position.x, position.y, position.z = float(x), float(y), float(z)
    o.x, o.y, o.z, o.w = map(float, orientation)
    moving.linear.x, moving.linear.y, moving.linear.z = map(float, twist[:3])
    moving.angular.x, moving.angular.y, moving.angular.z = map(float, twist[3:])
    return message
