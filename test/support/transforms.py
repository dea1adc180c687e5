# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A stand-in for tf2_ros, which is not installed with the tests: a buffer with one transform."""

import sys
from types import ModuleType
from unittest import mock

import pinocchio as pin
from geometry_msgs.msg import TransformStamped


class Buffer:
    """A buffer that has `transform` of the frames (target, source) `frames`."""

    frames = transform = None

    def lookup_transform(self, target, source, time):
        """Return the transform."""
        if (target, source) != self.frames:
            raise LookupError(
                f'"{source}" passed to lookupTransform argument source_frame does not exist'
            )
        return self.transform


def with_tf2_ros():
    """Return a context in which nodes can import tf2_ros."""
    module = ModuleType("tf2_ros")
    module.Buffer = Buffer
    module.TransformListener = lambda buffer, node: None
    return mock.patch.dict(sys.modules, tf2_ros=module)


def transform_of(rotation, translation=(0, 0, 0)):
    """Return a static transform."""
    message = TransformStamped()
    p = message.transform.translation
    o = message.transform.rotation
    p.x, p.y, p.z = map(float, translation)
    o.x, o.y, o.z, o.w = map(float, pin.Quaternion(rotation).coeffs())
    return message
