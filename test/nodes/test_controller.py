# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the controller reads in messages: trajectories, set-points and poses."""

import numpy as np
import pytest
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import diag_dynamics as dd
from controllers import pose_message
from described import UR5, S
from diag_dynamics.control.trajectory import Trajectory
from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.controller import received
from nodes import joint_state, robot

NAMES = ("shoulder", "elbow", "wrist")


# --- trajectories


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


POINT = (1.0, [0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("points", "names", "said"),
    [
        ([], NAMES, "points is empty"),
        ([POINT], ("shoulder", "elbow"), "lacks joint 'wrist'"),
        ([POINT], (*NAMES, "wing"), "has 'wing'"),
        ([POINT], ("wrist", "elbow", "wrist"), "'wrist' twice"),
        ([(1.0, [0.0, 0.0])], NAMES, r"points\[0\].positions has 2 entries, expected 3"),
        ([(1.0, [])], NAMES, r"points\[0\].positions is empty"),
        ([POINT, (2.0, [0, 0, 0], [0, np.nan, 0])], NAMES, r"points\[1\].velocities of joint 'elbow' is nan"),
        ([POINT, POINT], NAMES, r"points\[1\].time_from_start is 1 s, expected more than the 1 s"),
        ([(-1.0, [0, 0, 0])], NAMES, r"points\[0\].time_from_start is -1 s"),
        ([(1.0, [0, 0, 0], [0, 0, 0.5])], NAMES, "'wrist' at the last point of the trajectory is 0.5, expected 0"),
    ],
)
def test_bad_trajectories_are_refused_by_name(points, names, said):
    with pytest.raises(InputError, match=said):
        Trajectory(received.trajectory(trajectory(points, names), NAMES)[0], NAMES)


def test_a_trajectory_with_efforts_is_refused():
    message = trajectory([POINT])
    message.points[0].effort = [1.0, 1.0, 1.0]
    with pytest.raises(InputError, match=r"points\[0\].effort"):
        received.trajectory(message, NAMES)


@pytest.mark.parametrize(
    ("message", "said"),
    [
        (joint_state(NAMES[:2], [0, 0]), "lacks joint 'wrist'"),
        (joint_state((*NAMES, "wing"), [0] * 4), "has 'wing'"),
        (joint_state(("wrist", "elbow", "wrist"), [0] * 3), "'wrist' twice"),
        (joint_state(NAMES, [0, 0]), "position has 2 entries, expected 3"),
        (joint_state(NAMES, [0, np.inf, 0]), "position of joint 'elbow' is inf"),
        (joint_state(NAMES, [0, 0, 0], [0, 0, 1]), "expected positions alone"),
    ],
)
def test_bad_set_points_are_refused_by_name(message, said):
    with pytest.raises(InputError, match=said):
        received.set_point(message, NAMES)


def test_joints_of_messages_come_in_any_order():
    points = [(1.0, [1, 2, 3], [4, 5, 6]), (2.0, [7, 8, 9])]
    waypoints, stamp = received.trajectory(trajectory(points, NAMES[::-1], stamp=3 * S + 5), NAMES)
    assert stamp == 3 * S + 5 and waypoints.times.tolist() == [1.0, 2.0]
    assert waypoints.positions.tolist() == [[3, 2, 1], [9, 8, 7]]
    assert waypoints.velocities.tolist() == [[6, 5, 4], [0, 0, 0]] and waypoints.with_velocity.tolist() == [True, False]
    assert not waypoints.with_acceleration.any()
    assert received.set_point(joint_state(NAMES[::-1], [1, 2, 3]), NAMES).tolist() == [3, 2, 1]


@pytest.mark.parametrize(
    ("link", "position", "said"),
    [
        ("wing", (0, 0, 0), "frame_id is 'wing', which is no link of robot 'ur5'; its root is '"),
        ("tool0", (0, np.nan, 0), r"target.pose.position is \[0.0, nan, 0.0\], expected finite numbers"),
    ],
)
def test_bad_poses_are_refused_by_name(link, position, said):
    with pytest.raises(InputError, match=said):
        received.pose(pose_message(link, position), dd.load_urdf(robot(UR5).path))
