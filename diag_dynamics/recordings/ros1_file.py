# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags of ROS 1 and the conversion of their messages to CDR, by rosbags."""

import struct
from functools import lru_cache, partial
from itertools import accumulate
from pathlib import Path

from diag_dynamics.optional import require
from diag_dynamics.recordings.messages import (
    Connection,
    DamageError,
    Messages,
    describe_error,
)

ROWS = 2000
"""Messages that are read together."""
JOINT_STATE = "sensor_msgs/msg/JointState"
TYPES = JOINT_STATE, "nav_msgs/msg/Odometry", "std_msgs/msg/String"
"""Types of messages that recordings are made of."""
CDR = b"\0\1\0\0"
"""First bytes of a message in CDR."""


class Ros1File:
    """A bag of ROS 1 with its index."""

    def __init__(self, path, name, notes):
        self._path, self._lose = Path(path), partial(notes.add_damage, name)
        self._open = partial(require("rosbags.rosbag1", "reading the recording").Reader, self._path)
        self.connections, self.start = [], None
        try:
            with self._open() as reader:
                for one in reader.connections:
                    connection = Connection(one.topic, one.msgtype, "ros1", one.digest)
                    self.connections.append(connection)
                self.start = min((one.start_time for one in reader.chunk_infos), default=None)
        except Exception as error:  # of damaged bytes
            size, advice = self._path.stat().st_size, f"`rosbag reindex {name}` makes an index"
            self._lose("index", f"{describe_error(error)}: {size} bytes; {advice}")

    def parts(self, wanted):
        """Yield (first log time, last one, function that returns Messages) in their order."""
        if not wanted or not self.connections:
            return
        with self._open() as reader:
            chosen = {one.id: k for k, one in enumerate(reader.connections) if k in wanted}
            for rows in self._read_rows(reader, chosen):
                messages = Messages.from_rows(rows)
                yield rows[0][1], rows[-1][1], lambda messages=messages: messages

    def _read_rows(self, reader, chosen):
        """Yield lists of (connection, log time, content); behind damage go on at the next chunk."""
        connections = [one for one in reader.connections if one.id in chosen]
        chunks = sorted(reader.chunk_infos, key=lambda one: one.start_time)
        counts = [sum(one.connection_counts.get(key, 0) for key in chosen) for one in chunks]
        ends, start, done, rows = list(accumulate(counts)), None, 0, []
        while True:
            try:
                for one, time, data in reader.messages(connections, start):
                    rows.append((chosen[one.id], time, data))
                    start, done = time + 1, done + 1
                    if len(rows) == ROWS:
                        yield rows
                        rows = []
                break
            except Exception as error:  # of damaged bytes
                k = next((k for k, end in enumerate(ends) if end > done), len(ends) - 1)
                what = f"{describe_error(error)}: {ends[k] - done} messages"
                self._lose(f"chunk at byte {chunks[k].pos}", what)
                if k == len(ends) - 1:
                    break
                start, done = max(start or 0, chunks[k + 1].start_time), ends[k]
        if rows:
            yield rows


@lru_cache(64)
def find_conversion(name, md5):
    """Return the function that converts messages of a type of ROS 1 to CDR; None if none are read.

    A DamageError says that the type is not that of ROS Noetic.
    """
    if name not in TYPES:
        return None
    typesys = require("rosbags.typesys", "reading the recording")
    noetic = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    expected = noetic.generate_msgdef(name, ros_version=1)[1]
    if md5 not in ("", "*", expected):
        raise DamageError(f"its MD5 sum is {md5}; expected {expected}")
    if name == JOINT_STATE:  # twice as fast as the library
        return partial(_convert_joint_state, [])
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)  # its headers have no `seq`
    return partial(store.ros1_to_cdr, typename=name)


def _convert_joint_state(known, raw):
    """Convert a joint state; `known` has the texts of the last one, and what they are in CDR."""
    raw = bytes(raw)
    if not known or not raw.startswith(known[0], 12):
        known[:] = _convert_texts(raw)
    at, converted = 12 + len(known[0]), bytearray(CDR + raw[4:12] + known[1])
    for _ in range(3):
        size = 8 * int.from_bytes(raw[at : at + 4], "little")
        converted += raw[at : at + 4]
        if size:
            converted += bytes((4 - len(converted)) % 8) + raw[at + 4 : at + 4 + size]
        at += 4 + size
    if at != len(raw):
        raise DamageError("the message has another size than its arrays")
    return converted


def _convert_texts(raw):
    """Return frame and names of a joint state in ROS 1 and in CDR."""

    def convert_text(at):
        (size,) = struct.unpack_from("<I", raw, at)
        end = at + 4 + size
        return struct.pack("<I", size + 1) + raw[at + 4 : end] + bytes(4 - size % 4), end

    converted, at = convert_text(12)
    (count,) = struct.unpack_from("<I", raw, at)
    converted, at = converted + raw[at : at + 4], at + 4
    for _ in range(count):
        name, at = convert_text(at)
        converted += name
    return raw[12:at], converted
