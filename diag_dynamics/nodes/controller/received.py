# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Targets read from messages, with joints in the robot's order; invalid ones raise InputError."""

import numpy as np

from diag_dynamics.checks import vector
from diag_dynamics.control.following import Tolerances
from diag_dynamics.control.references import Waypoints
from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.tf import unit_quaternion
from diag_dynamics.rotations import from_quaternion

MAX_POINTS = 2000
"""Points that one trajectory may have."""


def pose(message):
    """Return link, position [m] in its axes and rotation matrix of a PoseStamped."""
    p = message.pose.position
    axes = from_quaternion(*unit_quaternion(message.pose.orientation))
    return message.header.frame_id, [p.x, p.y, p.z], axes


def set_point(message, names):
    """Return the positions of all joints [rad, m] of a JointState, in the order of `names`.

    The robot rests there.
    """
    _columns("set_point.name", message.name, names)
    if len(message.position) != len(message.name):
        raise InputError(
            f"set_point.position has {len(message.position)} entries; expected {len(message.name)}."
        )
    if any(message.velocity) or any(message.effort):
        raise InputError("set_point has velocities or efforts; expected positions only.")
    return vector(
        "set_point.position", dict(zip(message.name, message.position, strict=True)), names
    )


def trajectory(message, names, position):
    """Return the waypoints of a JointTrajectory in the order of `names`, and its start [ns].

    The start is 0 for a trajectory that starts with the first state. Joints that the message lacks
    hold their `position` [rad, m].
    """
    columns = _columns("trajectory.joint_names", message.joint_names, names)
    if not columns:
        raise InputError("trajectory.joint_names is empty; expected at least one joint.")
    points = message.points
    stamp = message.header.stamp
    if not points:
        raise InputError(
            "trajectory.points is empty; expected at least one point. "
            "To stop the robot, request the mode again."
        )
    if len(points) > MAX_POINTS:
        raise InputError(
            f"trajectory.points has {len(points)} entries; expected at most {MAX_POINTS}."
        )
    times = np.array(
        [point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in points]
    )
    positions, with_position = _field(points, "positions", columns, position)
    if not with_position.all():
        k = np.argmin(with_position)
        raise InputError(
            f"trajectory.points[{k}].positions is empty; expected {len(columns)} entries."
        )
    at_rest = np.zeros(len(names))
    velocities, with_velocity = _field(points, "velocities", columns, at_rest)
    accelerations, with_acceleration = _field(points, "accelerations", columns, at_rest)
    waypoints = Waypoints(
        times, positions, velocities, accelerations, with_velocity, with_acceleration
    )
    return waypoints, stamp.sec * 1_000_000_000 + stamp.nanosec


def tolerances(goal, names, defaults):
    """Return the Tolerances of a FollowJointTrajectory goal: 0 is a default, and -1 is none."""
    for field in ("component_path_tolerance", "component_goal_tolerance", "multi_dof_trajectory"):
        value = getattr(goal, field, ())
        if getattr(value, "joint_names", value):
            raise InputError(
                f"{field} is set; expected none because the robot has joints of one degree of "
                "freedom only."
            )
    tables = {"path_tolerance": defaults.path.copy(), "goal_tolerance": defaults.goal.copy()}
    for field, table in tables.items():
        for entry in getattr(goal, field):
            (k,) = _columns(field, [entry.name], names)
            joint = f"of joint '{entry.name}'"
            table[0, k] = _tolerance(f"{field}.position {joint}", entry.position, table[0, k])
            table[1, k] = _tolerance(f"{field}.velocity {joint}", entry.velocity, table[1, k])
            if entry.acceleration > 0.0:
                raise InputError(
                    f"{field}.acceleration {joint} is {entry.acceleration}, but accelerations are "
                    "not measured."
                )
    duration = goal.goal_time_tolerance
    time = _tolerance("goal_time_tolerance", duration.sec + 1e-9 * duration.nanosec, defaults.time)
    return Tolerances(*tables.values(), time)


def _tolerance(name, value, default):
    """Return a tolerance by the conventions of control_msgs/JointTolerance."""
    if value == 0.0:
        return default
    if value != -1.0 and not 0.0 < value < np.inf:
        raise InputError(f"{name} is {value}; expected a number > 0, 0 (the default) or -1 (none).")
    return value if value > 0.0 else np.inf


def _columns(field, listed, names):
    """Return where `names` has each listed joint."""
    for k, name in enumerate(listed):
        if name not in names:
            raise InputError(f"{field} has '{name}'; expected joints of {', '.join(names)}.")
        if name in listed[:k]:
            raise InputError(f"{field} has '{name}' twice; expected each joint once.")
    return [list(names).index(name) for name in listed]


def _field(points, name, columns, default):
    """Return one field of all points, shape (points, nv), and which points have it.

    Other points and columns have `default`, shape (nv,).
    """
    values = [getattr(point, name) for point in points]
    width = len(columns)
    lengths = np.array([len(value) for value in values])
    present = lengths > 0
    wrong = present & (lengths != width)
    if wrong.any():
        k = np.argmax(wrong)
        raise InputError(
            f"trajectory.points[{k}].{name} has {lengths[k]} entries; expected {width}."
        )
    table = np.tile(default, (len(points), 1))
    table[np.ix_(present, columns)] = np.frombuffer(b"".join(values)).reshape(-1, width)
    return table, present
