# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""State of a floating base from the pose and twist of another frame on it."""

import math

import numpy as np

from diag_dynamics.checks import numbers
from diag_dynamics.exceptions import InputError
from diag_dynamics.sweeps.spatial import rotation_of_quaternion


def base_state(model, link, position, quaternion, twist, twist_in_world=False):
    """Positions and rates of a floating base.

    Parameters
    ----------
    model : RobotModel
        With a floating base.
    link : str
        Link that was measured: the root link, or one that is rigidly attached to it.
    position : array_like, shape (3,)
        Position of the link in the world [m].
    quaternion : array_like, shape (4,)
        Its orientation in the world, x y z w; normalized here.
    twist : array_like, shape (6,)
        Velocity of the link's origin [m/s] and angular velocity [rad/s].
    twist_in_world : bool
        Whether the twist is in the axes of the world rather than of the link.

    Returns
    -------
    q : ndarray, shape (7,)
        x y z qx qy qz qw of the root link.
    qd : ndarray, shape (6,)
        Its twist in its own axes, linear first.
    """
    values = {"position": (position, 3), "orientation": (quaternion, 4), "twist": (twist, 6)}
    for name, (value, length) in values.items():
        numbers(f"{name} of '{link}'", value, (length,), f"{length} finite numbers")
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1.0) > 1e-2:
        raise InputError(f"orientation of '{link}' is the quaternion {list(quaternion)} of length {length:.3g}, not 1.")
    attached = model.placement_in_root(link)
    R = np.array(rotation_of_quaternion.py_func(*map(float, quaternion)))
    linear, angular = np.asarray(twist[:3], dtype=float), np.asarray(twist[3:], dtype=float)
    if twist_in_world:
        linear, angular = R.T @ linear, R.T @ angular
    turn, offset = attached[:3, :3], attached[:3, 3]
    angular = turn @ angular
    linear = turn @ linear - np.cross(angular, offset)
    root = R @ turn.T
    x, y, z = np.asarray(position, dtype=float) - root @ offset
    return np.array([x, y, z, *quaternion_of(root)]), np.concatenate([linear, angular])


def quaternion_of(R):
    """Return the quaternion x y z w of a rotation matrix, by its largest component."""
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    # The largest of four squares is at least a quarter (Shepperd 1978).
    squares = (a + e + i, a - e - i, e - a - i, i - a - e)
    k = squares.index(max(squares))
    largest = 0.5 * math.sqrt(1.0 + squares[k])
    n = 0.25 / largest
    return (
        ((h - f) * n, (c - g) * n, (d - b) * n, largest),
        (largest, (b + d) * n, (c + g) * n, (h - f) * n),
        ((b + d) * n, largest, (f + h) * n, (c - g) * n),
        ((c + g) * n, (f + h) * n, largest, (d - b) * n),
    )[k]
