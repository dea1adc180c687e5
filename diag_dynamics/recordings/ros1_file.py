# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags of ROS 1 and the conversion of their messages to CDR, by rosbags."""

from functools import lru_cache, partial
from pathlib import Path

from diag_dynamics.optional import require
from diag_dynamics.recordings.messages import REASON, Connection, DamageError, describe_error, group_rows

TYPES = "sensor_msgs/msg/JointState", "nav_msgs/msg/Odometry", "std_msgs/msg/String"
"""Types of messages that recordings are made of."""


class Ros1File:
    """A bag of ROS 1 with its index. It is read up to the first damaged chunk."""

    def __init__(self, path, name, notes):
        self._path, self._lose = Path(path), partial(notes.add_damage, name)
        self._open = partial(require("rosbags.rosbag1", REASON).Reader, self._path)
        self.connections, self.start = [], None
        try:
            with self._open() as reader:
                for one in reader.connections:
                    self.connections.append(Connection(one.topic, one.msgtype, "ros1", one.digest))
                self.start = min((one.start_time for one in reader.chunk_infos), default=None)
        except Exception as error:  # of damaged bytes
            size, advice = self._path.stat().st_size, f"`rosbag reindex {name}` makes an index"
            self._lose("index", f"{describe_error(error)}: {size} bytes; {advice}" if size else "the file is empty")

    def parts(self, wanted):
        """Yield (first log time, last one, function that returns Messages) in their order."""
        return group_rows(self._read_rows(wanted)) if wanted and self.connections else ()

    def _read_rows(self, wanted):
        """Yield (connection, log time, content) of each message."""
        time, count = 0, 0
        with self._open() as reader:
            chosen = {one.id: k for k, one in enumerate(reader.connections) if k in wanted}
            connections = [one for one in reader.connections if one.id in chosen]
            try:
                for one, time, data in reader.messages(connections):
                    count += 1
                    yield chosen[one.id], time, data
            except Exception as error:  # of damaged bytes
                lost = sum(one.msgcount for one in connections) - count
                self._lose(f"after log time {time}", f"{describe_error(error)}: {lost} messages")


@lru_cache(64)
def find_conversion(name, md5):
    """Return the function that converts messages of a type of ROS 1 to CDR; None if none are read."""
    if name not in TYPES:
        return None
    typesys = require("rosbags.typesys", REASON)
    noetic = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)  # its headers have no `seq`
    is_known = md5 in ("", "*", noetic.generate_msgdef(name, ros_version=1)[1])

    def convert(raw):
        if not is_known:
            raise DamageError("the type has another definition")
        return store.ros1_to_cdr(raw, name)

    return convert
