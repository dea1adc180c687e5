# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rotation matrices (3, 3), placements (4, 4), quaternions x y z w, and angles.

Kernels have sweeps.spatial.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from diag_dynamics.arrays import Array


def from_quaternion(x: float, y: float, z: float, w: float) -> Array:
    """Return the rotation matrix of a quaternion of any length but zero."""
    s = 2.0 / (x * x + y * y + z * z + w * w)
    return np.array(
        [
            [1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y)],
        ]
    )


def to_quaternion(R: Array) -> tuple[float, float, float, float]:
    """Return the unit quaternion x y z w of a rotation matrix."""
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


def from_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Return the rotation matrix Rz(yaw) Ry(pitch) Rx(roll)."""
    sr = math.sin(roll)
    sp = math.sin(pitch)
    sy = math.sin(yaw)
    cr = math.cos(roll)
    cp = math.cos(pitch)
    cy = math.cos(yaw)
    # Products in this order have the bits of yourdfpy's.
    cc = cr * cy
    cs = cr * sy
    sc = sr * cy
    ss = sr * sy
    return np.array(
        [
            [cp * cy, sp * sc - cs, sp * cc + ss],
            [cp * sy, sp * ss + cc, sp * cs - sc],
            [-sp, cp * sr, cp * cr],
        ]
    )


def to_rpy(R: Array) -> tuple[float, float, float]:
    """Return roll, pitch and yaw; the roll is 0 at a pitch of ±90°, where it acts as a yaw."""
    across = np.hypot(R[0, 0], R[1, 0])
    pitch = np.arctan2(-R[2, 0], across)
    if across < 1e-9:
        return 0.0, pitch, np.arctan2(-R[0, 1], R[1, 1])
    return np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])


def pose(position: Array | Sequence[float], rotation: Array | None = None) -> Array:
    """Return the placement (4, 4) of axes at a point [m], turned by a rotation matrix."""
    placement = np.eye(4)
    placement[:3, 3] = position
    if rotation is not None:
        placement[:3, :3] = rotation
    return placement


def about_axis(axis: Array, angle: float) -> Array:
    """Return the rotation matrix of an angle [rad] about a unit axis."""
    x, y, z = np.sin(0.5 * angle) * axis
    return from_quaternion(x, y, z, np.cos(0.5 * angle))


def frame_about(axis: Array) -> Array:
    """Return a rotation matrix whose third column is the axis; exact for axes along x, y or z."""
    z = np.asarray(axis, dtype=float) / np.abs(axis).max()
    z /= np.linalg.norm(z)
    x = np.zeros(3)
    x[np.argmin(np.abs(z))] = 1.0
    x -= (x @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def vee(R: Array) -> Array:
    """Return 2 sin(angle) times the axis of a rotation: Σ a_j × R a_j for any orthonormal a."""
    return np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])


def to_vector(R: Array) -> Array:
    """Return angle [rad] times axis of a rotation matrix, shape (3,); the angle is in [0, π]."""
    x, y, z, cosine = to_quaternion(R)
    sine = math.hypot(x, y, z)
    if sine == 0.0:
        return np.zeros(3)
    angle = 2.0 * math.atan2(sine, abs(cosine))
    return np.array([x, y, z]) * (angle / math.copysign(sine, cosine))


def wrap_angle(angle: Array) -> Array:
    """Return angles [rad] within ±π; kernels compile it, too."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
