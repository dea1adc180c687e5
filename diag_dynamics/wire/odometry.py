# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Odometry as bytes."""

from diag_dynamics.assembly.rejected import RejectedError


def odometry_of(raw, deserialize):
    """Odometry of its bytes, as `deserialize` reads them, which may raise any exception.

    Raises
    ------
    RejectedError
        They are none.
    """
    try:
        return deserialize(raw)
    except Exception as error:
        raise RejectedError(
            "malformed", f"odom: {len(raw)} bytes that are no nav_msgs/msg/Odometry ({error})"
        ) from error
