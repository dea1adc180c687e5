# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Transforms of tf; the package tf2_ros is optional."""

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.rotations import from_quaternion


class Transforms:
    """Latest transforms of a node's tf; construction raises ImportError without tf2_ros."""

    def __init__(self, node):
        from rclpy.time import Time
        from tf2_ros import Buffer, TransformListener

        self._time = node.time
        self._latest = Time()
        self._buffer = Buffer()
        self._listener = TransformListener(self._buffer, node)

    @classmethod
    def if_installed(cls, node):
        """Return the transforms of a node; None without tf2_ros."""
        try:
            return cls(node)
        except ImportError:
            return None

    def find(self, target, source, max_age):
        """Return the position [m] and the axes of the frame `source` in `target`.

        Raises
        ------
        InputError
            If the transform is older than `max_age` [s]. Transforms that never change have no
            stamp, and no age.
        """
        result = self._buffer.lookup_transform(target, source, self._latest)
        stamp = result.header.stamp.sec * SECOND + result.header.stamp.nanosec
        age = 1e-9 * (self._time.now() - stamp)
        if stamp and age > max_age:
            raise InputError(f"the transform is {age:.3g} s old")
        p = result.transform.translation
        return np.array([p.x, p.y, p.z]), from_quaternion(
            *unit_quaternion(result.transform.rotation)
        )


def unit_quaternion(q):
    """Return x, y, z and w of a message's quaternion; InputError if its length is not 1."""
    numbers = np.array([q.x, q.y, q.z, q.w])
    if not abs(numbers @ numbers - 1.0) < 0.01:
        raise InputError(f"orientation is {numbers.tolist()}; expected a quaternion of length 1")
    return numbers
