# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files and folders of any format as batches of messages about one robot."""

import os
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.decoding import Decoder
from diag_dynamics.model import RobotModel
from diag_dynamics.model.joint_types import single_joints
from diag_dynamics.optional import require
from diag_dynamics.recordings.bag_messages import Unread
from diag_dynamics.recordings.bags import METADATA, Bag, is_bag
from diag_dynamics.recordings.intake import JOINT_STATE, ODOMETRY, Batch
from diag_dynamics.recordings.joint_names import SAME_NAMES
from diag_dynamics.recordings.tables import is_dataset, split_paths
from diag_dynamics.recordings.tables.column_map import ColumnMap, read_column_map
from diag_dynamics.wire.definitions import read_message

DESCRIPTION = "std_msgs/msg/String"
ENCODING, EXPECTED = "cdr", "'cdr' of ROS 2 or 'ros1'"
"""Encoding of messages that are read, to which bags convert those of ROS 1, and both in words."""

USUAL = {JOINT_STATE: "joint_states", ODOMETRY: "odom", DESCRIPTION: "robot_description"}
"""Last part of the name of a topic that is read, by its type."""
SEVERAL = {
    JOINT_STATE: "Choose one, or all topics of one robot: {options} (topic).",
    ODOMETRY: "Only one named odom, or one in the namespace of --topic, is read.",
    DESCRIPTION: "Give the robot: --urdf ROBOT (model).",
}
"""Advice about several topics of a type."""


@runtime_checkable
class Source(Protocol):
    """Messages of a recording about one robot; notes are complete after the last batch."""

    start: int | None  # first log time [ns]; None if it is unknown before reading
    offset: int  # delay of stamps from times in the file [ns]
    unread: list[Unread]
    notes: list[str]

    def description(self) -> str:
        """Return the description of the robot; raise InputError without one."""

    def joints(self, model: RobotModel) -> set[str]:
        """Return the robot's names of joints in messages."""

    def batches(self, model: RobotModel, begin: float, end: float) -> Iterator[Batch]:
        """Yield batches in the order of log time, some without messages outside of limits [ns]."""


def path_text(path):
    """Return the path of a recording as a text; ``a+b`` of a list of tables side by side."""
    return "+".join(map(os.fspath, path if isinstance(path, list | tuple) else [path]))


def open_source(path, columns=None, topic=None, names=SAME_NAMES) -> Source:
    """Return the Source of a path; see :func:`read_recording`. `names` are JointNames."""
    columns = read_column_map(columns)
    path = os.path.expanduser(path_text(path))
    paths = list(map(Path, split_paths(path)))
    if is_dataset(path):
        return _open_table(path, columns, names)
    for file in paths:
        if not (file.is_file() or file.is_dir()):  # it is opened more than once, unlike a pipe
            raise InputError(
                f"there is no file or folder '{file}'. Write the output of a pipe to a file."
            )
    path = paths[0].parent if paths[0].name == METADATA else paths[0]
    if len(paths) > 1 or not (path.is_dir() or (path.is_file() and is_bag(path))):
        return _open_table("+".join(map(str, paths)), columns, names)
    if columns != ColumnMap():
        raise InputError(f"'{path}' is a bag; expected no column map, which is for tables.")
    return BagSource(path, topic, names)


def _open_table(path, columns, names):
    require("pyarrow", f"'{path}'")
    return import_module("diag_dynamics.recordings.table_source").TableSource(path, columns, names)


class BagSource:
    """Messages of a bag, a Source: joint states of one robot, merged by log time, and odometry."""

    offset = 0

    def __init__(self, path, topic, names):
        self._names = names
        self._path = path
        self._bag = Bag(path)
        topics = [topic] if isinstance(topic, str) else topic or ()
        self._topics = tuple(dict.fromkeys(topics))
        self.notes = []
        self.start = self._bag.start
        self.unread = self._bag.unread
        self._kinds = np.array([connection.type for connection in self._bag.connections])

    def description(self):
        """Return the robot_description in the bag; raise InputError if there is none."""
        connections = self._connections(DESCRIPTION)
        for messages in self._bag.pieces(connections) if connections else ():
            for at, size in zip(messages.at.tolist(), messages.size.tolist(), strict=True):
                if text := read_message(messages.data[at : at + size].tobytes(), DESCRIPTION).data:
                    return text
        if not self._bag.connections:
            raise InputError(f"'{self._path}' is empty: {self._content()}.")
        raise InputError(
            f"'{self._path}' has no robot_description. Give the robot: --urdf ROBOT (model)."
        )

    def joints(self, model):
        """Return the robot's names of joints in messages, until all of the model are there."""
        names = set()
        for batch in self._batches(self._connections(JOINT_STATE)):
            names.update(map(self._names.map_name, batch.names()))
            if names.issuperset(single_joints(model)):
                break
        return names

    def batches(self, model, begin, end):
        """Yield batches of messages in the order of log time, at least those between two [ns]."""
        connections = self._connections(JOINT_STATE)
        if not connections and not model.floating_base:
            raise InputError(f"'{self._path}' has no joint states: {self._content()}.")
        connections += self._connections(ODOMETRY) if model.floating_base else []
        yield from self._batches(connections, begin, end)

    def _batches(self, connections, *limits):
        decoder = Decoder()
        for messages in self._bag.pieces(connections, *limits):
            yield decode_messages(decoder, messages, self._kinds)

    def _connections(self, kind):
        """Return the indices of the connections of a type that are read."""
        places = [k for k, name in enumerate(self._kinds) if name == kind]
        connections = self._bag.connections
        encodings = {connections[k].topic: connections[k].encoding for k in places}
        topics = self._topics if kind == JOINT_STATE else ()
        for topic in topics:
            if topic not in encodings:
                content = self._content()
                raise InputError(f"'{self._path}' has no topic '{topic}' of {kind}: {content}.")
        topics = topics or self._choose_topics(kind, encodings)
        for topic in topics:
            if encodings[topic] != ENCODING:
                raise InputError(
                    f"'{self._path}': messages of {topic} are encoded as '{encodings[topic]}'; "
                    f"expected {EXPECTED}."
                )
        return [k for k in places if connections[k].topic in topics]

    def _choose_topics(self, kind, encodings):
        """Return the topics that are read where none is chosen, of those with their encodings.

        This is the only one, or the one with the usual name.
        """
        topics = sorted(encodings)
        if len(topics) < 2:
            return topics
        usual = [name for name in topics if encodings[name] == ENCODING] or topics
        if len(usual) > 1:
            usual = [name for name in usual if name.split("/")[-1] == USUAL[kind]]
        if len(usual) > 1 and kind != JOINT_STATE:
            namespaces = {topic.rpartition("/")[0] for topic in self._topics}
            usual = [name for name in usual if name.rpartition("/")[0] in namespaces]
        if len(usual) != 1:
            options = " ".join(f"--topic {name}" for name in topics[:2])
            raise InputError(
                f"'{self._path}' has several topics of {kind}: {', '.join(topics)}. "
                f"{SEVERAL[kind].format(options=options)}"
            )
        unread = ", ".join(name for name in topics if name not in usual)
        note = (
            f"'{self._path}': joint states of {usual[0]} are read, not those of {unread} "
            "(--topic reads several)."
        )
        if kind == JOINT_STATE and note not in self.notes:
            self.notes.append(note)
        return usual

    def _content(self):
        """Return the topics of the bag as a text, and the beginning of its damage."""
        texts = {
            f"{topic} ({kind or 'no type'}, encoded as '{encoding}')"
            for topic, kind, encoding, _ in self._bag.connections
        }
        topics = ", ".join(sorted(texts)) or "no readable topics"
        damage = "".join(f"; {part.where}: {part.what}" for part in self.unread[:3])
        return f"it has {topics}; expected messages encoded as {EXPECTED}{damage}"


def decode_messages(decoder, messages, kinds):
    """Return the Batch of Messages; `kinds` are the types of their connections."""
    kind = kinds[messages.connection]
    parts, errors = decoder.decode(
        messages.data, messages.at, messages.size, np.flatnonzero(kind == JOINT_STATE)
    )
    odometry = {
        k: messages.data[messages.at[k] : messages.at[k] + messages.size[k]].tobytes()
        for k in np.flatnonzero(kind == ODOMETRY).tolist()
    }
    return Batch(messages.log_time, parts, odometry, errors)
