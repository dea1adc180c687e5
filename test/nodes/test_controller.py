# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller reads the messages of ROS; test/library/test_control_references.py has the rules of their contents."""

from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import diag_dynamics as dd
from controllers import pose_message
from described import UR5, S
from diag_dynamics.nodes.controller import received
from nodes import joint_state, robot

NAMES = ("shoulder", "elbow", "wrist")


def trajectory(points, names=NAMES, stamp=0):
    """Return a JointTrajectory of (time, positions, velocities, accelerations)."""
    message = JointTrajectory(joint_names=list(names))
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, S)
    for time, *fields in points:
        point = JointTrajectoryPoint()
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(round(time * S), S)
        for field, values in zip(("positions", "velocities", "accelerations"), fields, strict=False):
            setattr(point, field, [float(x) for x in values])
        message.points.append(point)
    return message


def test_targets_are_read_from_messages():
    points = [(1.0, [1, 2, 3], [4, 5, 6]), (2.0, [7, 8, 9])]
    waypoints, stamp = received.trajectory(trajectory(points, NAMES[::-1], stamp=3 * S + 5), NAMES)
    assert stamp == 3 * S + 5 and waypoints.positions.tolist() == [[3, 2, 1], [9, 8, 7]]
    assert received.set_point(joint_state(NAMES[::-1], [1, 2, 3]), NAMES).tolist() == [3, 2, 1]
    link, position, _ = received.pose(pose_message("tool0", (1, 2, 3)), dd.load_urdf(robot(UR5).path))
    assert link == "tool0" and list(position) == [1, 2, 3]
