# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""State of a floating base from the pose and twist of another frame on it."""

import numpy as np

from diag_dynamics import rotations
from diag_dynamics.checks import numbers
from diag_dynamics.exceptions import InputError


def base_state(model, link, position, quaternion, twist, twist_in_world=False):
    """Return positions x y z qx qy qz qw, and the twist in its own axes, linear first, of the root link.

    Parameters
    ----------
    model : RobotModel
        With a floating base.
    link : str
        Measured link: the root link, or one that is rigidly attached to it.
    position, quaternion : array_like, shape (3,) and (4,)
        Pose of the link in the world [m], x y z w.
    twist : array_like, shape (6,)
        Velocity of the link's origin [m/s] and angular velocity [rad/s].
    twist_in_world : bool
        Whether the twist is in the axes of the world instead of the link's.
    """
    values = {"position": (position, 3), "orientation": (quaternion, 4), "twist": (twist, 6)}
    for name, (value, length) in values.items():
        numbers(f"{name} of '{link}'", value, (length,), f"{length} finite numbers")
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1.0) > 1e-2:
        raise InputError(f"orientation of '{link}' is the quaternion {list(quaternion)} of length {length:.3g}, not 1.")
    attached = model.placement_in_root(link)
    R = rotations.from_quaternion(*map(float, quaternion))
    linear, angular = np.asarray(twist[:3], dtype=float), np.asarray(twist[3:], dtype=float)
    if twist_in_world:
        linear, angular = R.T @ linear, R.T @ angular
    turn, offset = attached[:3, :3], attached[:3, 3]
    angular = turn @ angular
    linear = turn @ linear - np.cross(angular, offset)
    root = R @ turn.T
    x, y, z = np.asarray(position, dtype=float) - root @ offset
    return np.array([x, y, z, *rotations.to_quaternion(root)]), np.concatenate([linear, angular])
