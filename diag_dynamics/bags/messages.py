# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What readers of bags hand out: serialized messages in the order of their log time, and what could not be read."""

from typing import NamedTuple

import numpy as np


class Connection(NamedTuple):
    """One topic as one writer has it."""

    topic: str
    type: str
    """Such as ``sensor_msgs/msg/JointState``."""
    encoding: str
    """Of its messages: ``cdr``, or what else the file says."""
    definition: str = ""
    """Of its type, with all types in it, as ``ros2msg`` has them; empty where the file has none."""


def normalize_type(name):
    """Return the name of a type as ROS 2 has it: with ``/msg/``, and without the colons of IDL.

    ROS 1 and the first releases of ROS 2 write ``sensor_msgs/JointState``, DDS ``sensor_msgs::msg::dds_::JointState_``.
    """
    name = name.replace("::", "/")
    if "/dds_/" in name:
        name = name.replace("/dds_/", "/").removesuffix("_")
    package, slash, rest = name.partition("/")
    return f"{package}/msg/{rest}" if slash and "/" not in rest else name


class Messages(NamedTuple):
    """Messages in the order of their log time; message k is ``data[at[k] : at[k] + size[k]]``."""

    data: np.ndarray
    """Bytes of all messages, and others between them: uint8."""
    connection: np.ndarray
    """Index into the bag's list of connections: int64, shape (n,)."""
    at: np.ndarray
    """First byte: int64, shape (n,)."""
    size: np.ndarray
    """Number of bytes: int64, shape (n,)."""
    log_time: np.ndarray
    """[ns], int64, shape (n,)."""


class Unread(NamedTuple):
    """Part of a file that could not be read."""

    file: str
    where: str
    """As ``byte 1024`` or ``chunk 3, byte 1024``."""
    what: str
    """What is wrong, and how much is lost: ``CRC of a chunk is wrong: 812 messages``."""
