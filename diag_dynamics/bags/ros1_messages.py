# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of ROS 1, converted to CDR by rosbags: of ``.bag`` files, and of MCAP files made of them."""

from collections import Counter
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from diag_dynamics.bags.compression import extra
from diag_dynamics.bags.messages import Messages

ENCODINGS = "ros1", "ros1msg"
"""Names of the encoding in MCAP files."""

_HEADER = "std_msgs/msg/Header"


class UnknownTypeError(Exception):
    """The type of a connection cannot be parsed; its text says why."""


class Ros1Type(NamedTuple):
    """A message type of ROS 1, as ROS 2 has it."""

    definition: str
    """As ``ros2msg`` has it."""
    convert: Callable
    """Return a message in CDR, or None if its bytes are not of the type."""


@lru_cache(64)
def ros1_type(name, definition, md5):
    """Return the type of a connection. Headers have no `seq`, because CDR messages of ROS 2 have none.

    Parameters
    ----------
    name : str
        Such as ``sensor_msgs/msg/JointState``.
    definition : str
        As the file has it. Types that it lacks are those of ROS Noetic. Where it is empty or cannot be parsed, the type
        itself is that of ROS Noetic if the MD5 sums agree.
    md5 : str
        MD5 sum of the definition, empty or ``*`` if the file has none.

    Raises
    ------
    UnknownTypeError
        The definition cannot be parsed, or it is empty and the type is not one of ROS Noetic.
    """
    typesys = extra("rosbags.typesys")
    noetic, types, expected = typesys.get_typestore(typesys.Stores.ROS1_NOETIC), {}, None
    for known in (_HEADER, name):
        if known in noetic.types:
            text, expected = noetic.generate_msgdef(known, ros_version=1)
            types |= typesys.get_types_from_msg(text, known)
    if not definition.strip():
        if name not in types:
            raise UnknownTypeError("its definition is empty, and the type is not one of ROS Noetic")
        if md5 not in ("", "*", expected):
            raise UnknownTypeError(f"its definition is empty, and its MD5 sum is {md5}; expected {expected}")
        definition = text
    try:
        store, text = _store(typesys, types, name, definition)
    except Exception as error:  # a definition may be anything, and the library checks little
        if name not in types or md5 != expected:
            why = " ".join(str(error).split())[:200].rstrip(".") or type(error).__name__
            raise UnknownTypeError(why) from error
        store, text = _store(typesys, types, name, text)

    def convert(raw):
        try:
            return store.ros1_to_cdr(raw, name)
        except Exception:  # the library generates code from a definition, which checks little
            return None

    return Ros1Type(text, convert)


def _store(typesys, types, name, definition):
    """Type store of a definition, and of types that it lacks, without `seq` in headers; and the definition of ROS 2."""
    types = types | typesys.get_types_from_msg(definition.replace("\r\n", "\n"), name)
    constants, fields = types[_HEADER]
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    store.register(types | {_HEADER: (constants, [field for field in fields if field[0] != "seq"])})
    return store, store.generate_msgdef(name, ros_version=2)[0]


def convert_messages(messages, converters):
    """Convert the messages of some connections to CDR; leave those of others unchanged.

    Parameters
    ----------
    messages : Messages
    converters : dict
        `Ros1Type.convert` by index of the connection.

    Returns
    -------
    Messages
        Without the messages that cannot be converted.
    failed : Counter
        Number of those by index of the connection.
    """
    old, failed = np.flatnonzero(np.isin(messages.connection, list(converters))), Counter()
    if not len(old):
        return messages, failed
    parts, beyond = [messages.data], len(messages.data)
    at, size, kept = messages.at.copy(), messages.size.copy(), np.ones(len(messages.at), dtype=bool)
    for k in old.tolist():
        connection = int(messages.connection[k])
        content = converters[connection](messages.data[at[k] : at[k] + size[k]].tobytes())
        if content is None:
            failed[connection] += 1
            kept[k] = False
            continue
        parts.append(np.frombuffer(content, np.uint8))
        at[k], size[k] = beyond, len(content)
        beyond += len(content)
    columns = messages.connection, at, size, messages.log_time
    return Messages(np.concatenate(parts), *(column[kept] for column in columns)), failed
