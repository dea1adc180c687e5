# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files and folders of any format as batches of messages about one robot."""

import os
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.decoding import Decoder
from diag_dynamics.model.sources import GIT_LFS
from diag_dynamics.recordings.bags import MAGIC, METADATA, SUFFIXES, Bag
from diag_dynamics.recordings.findings import OTHER_TOPICS
from diag_dynamics.recordings.intake import JOINT_STATE, ODOMETRY, Batch
from diag_dynamics.recordings.joint_names import JointNames
from diag_dynamics.recordings.table_source import TableSource
from diag_dynamics.recordings.tables.column_map import ColumnMap, column_map
from diag_dynamics.wire.definitions import read_message

DESCRIPTION = "std_msgs/msg/String"

ENCODING = "cdr"
"""Encoding of messages that are read. Bags convert messages of ROS 1 to it."""

EXPECTED = "'cdr' of ROS 2 or 'ros1'"

USUAL = {JOINT_STATE: "joint_states", ODOMETRY: "odom", DESCRIPTION: "robot_description"}
"""Last part of the name of a topic that is read, by its type."""

SEVERAL = {
    JOINT_STATE: "Give one, or all those of one robot: {options} (topic=[…]).",
    ODOMETRY: "One is read: the one called odom, or the one in the namespace of the joint states that --topic gives.",
    DESCRIPTION: "Give the robot: --urdf ROBOT (model).",
}
"""Advice about several topics of a type."""


def checked_topics(topic):
    """Return topics without repetition, as a tuple of str; empty for None.

    Raises
    ------
    InputError
        It is neither a name nor a sequence of names.
    """
    topics = [topic] if isinstance(topic, str) else () if topic is None else topic
    if not isinstance(topics, list | tuple) or not all(isinstance(one, str) and one for one in topics):
        raise InputError(f"topic is {topic!r}; expected the name of a topic or a list of names.")
    return tuple(dict.fromkeys(topics))


def source_of(path, columns=None, topic=None, joint_names=None):
    """Return the BagSource or TableSource of a path; for its arguments see :func:`read_recording`."""
    wanted = column_map(columns)
    if wanted.joint_names is not None and joint_names is not None:
        raise InputError(f"joint_names is given by {wanted.source}, too; expected one of them.")
    given, where = joint_names, "joint_names"
    if joint_names is None:
        given, where = wanted.joint_names, f"{wanted.source}: joint_names"
    names = None if given is None else JointNames(given, where)
    path = Path(os.path.expanduser(os.fspath(path)))
    if not path.exists():
        near = get_close_matches(path.name, os.listdir(path.parent) if path.parent.is_dir() else [], n=1)
        raise InputError(f"there is no file or folder '{path}'.{_meant(near)}")
    path, first = path.parent if path.name == METADATA else path, b""
    if path.is_file():
        with open(path, "rb") as file:
            first = file.read(len(GIT_LFS))
    if first == GIT_LFS:
        raise InputError(f"'{path}' is a pointer of Git LFS. Run git lfs pull.")
    if not (path.is_dir() or SUFFIXES.keys() & set(path.suffixes) or first.startswith(tuple(MAGIC))):
        return TableSource(path, wanted, names)
    for key, value in wanted._asdict().items():
        if key not in ("joint_names", "source") and value != ColumnMap._field_defaults[key]:
            raise InputError(
                f"'{path}' is a bag; expected joint_names alone in a map of columns, and {wanted.source} has {key}."
            )
    return BagSource(path, topic, names)


class BagSource:
    """Messages of a bag: joint states of one robot, from any number of publishers and topics, and odometry.

    Parameters
    ----------
    path : Path
    topic : str or sequence of str, optional
        Topics of the joint states, which are merged in the order of log time.
    names : JointNames, optional

    Attributes
    ----------
    start : int or None
        Log time that no message precedes [ns].
    unread : list of Unread
        Damage.
    notes : list of str
        Oddities without loss.
    """

    offset = without_values = 0  # as of TableSource

    def __init__(self, path, topic=None, names=None):
        self.names, self._path, self._bag = names, path, Bag(path)
        self._topics, self._notes = checked_topics(topic), []
        self.start, self.unread, self.limit = self._bag.start, self._bag.unread, self._bag.limit
        self._kinds = np.array([connection.type for connection in self._bag.connections])

    @property
    def notes(self):
        """Oddities without loss: a list of str."""
        return [*self._bag.findings, *self._notes]

    def description(self):
        """Return the robot_description in the bag.

        Raises
        ------
        InputError
            There is none.
        """
        wanted = self._connections(DESCRIPTION)
        for messages in self._bag.pieces(wanted) if wanted else ():
            for at, size in zip(messages.at.tolist(), messages.size.tolist(), strict=True):
                if text := read_message(messages.data[at : at + size].tobytes(), DESCRIPTION).data:
                    return text
        if not self._bag.connections:
            raise InputError(f"'{self._path}' has nothing: {self._content()}.")
        raise InputError(f"'{self._path}' has no robot_description: say which robot it is of (model, or --urdf ROBOT).")

    def batches(self, model):
        """Yield batches of messages in the order of log time."""
        wanted = self._connections(JOINT_STATE)
        if not wanted and not model.floating_base:
            raise InputError(f"'{self._path}' has no joint states: {self._content()}.")
        if self.names and wanted:
            limits = self._bag.begin, self._bag.end
            self.limit(None, None)
            self.names.check_recording((batch.names() for batch in self._batches(wanted)), model)
            self.limit(*limits)
        yield from self._batches(wanted + self._connections(ODOMETRY) if model.floating_base else wanted)

    def _batches(self, wanted):
        decoder = Decoder()
        return (decode_messages(decoder, messages, self._kinds) for messages in self._bag.pieces(wanted))

    def _connections(self, kind):
        """Return the indices of the connections of a type that are read.

        Raises
        ------
        InputError
            There are several topics and no rule chooses, or a chosen one is missing or has another encoding.
        """
        every = [(k, one) for k, one in enumerate(self._bag.connections) if one.type == kind]
        topics = self._topics if kind == JOINT_STATE else ()
        for topic in topics:
            if all(topic != one.topic for _, one in every):
                raise self._missing_topic(topic, kind)
        topics = topics or self._choose_topics(kind, [one for _, one in every])
        chosen = [(k, one) for k, one in every if one.topic in topics]
        for _, one in chosen:
            if one.encoding != ENCODING:
                why = "".join(f" {note}" for note in self._bag.findings if f"topic '{one.topic}' is not" in note)
                raise InputError(
                    f"'{self._path}': messages of {one.topic} are encoded as '{one.encoding}'; expected {EXPECTED}.{why}"
                )
        return [k for k, _ in chosen]

    def _choose_topics(self, kind, every):
        """Return the topics that are read where none is chosen: the only one, or the one with the usual name."""
        topics = sorted({one.topic for one in every})
        if len(topics) < 2:
            return topics
        readable = sorted({one.topic for one in every if one.encoding == ENCODING}) or topics
        usual = [name for name in readable if name.split("/")[-1] == USUAL[kind]] if len(readable) > 1 else readable
        if len(usual) > 1 and kind != JOINT_STATE:
            namespaces = {topic.rpartition("/")[0] for topic in self._topics}
            usual = [name for name in usual if name.rpartition("/")[0] in namespaces]
        if len(usual) != 1:
            options = " ".join(f"--topic {topic}" for topic in topics[:2])
            advice = SEVERAL[kind].format(options=options)
            raise InputError(f"'{self._path}' has several topics of {kind}: {', '.join(topics)}. {advice}")
        others = ", ".join(name for name in topics if name not in usual)
        note = f"'{self._path}': joint states of {usual[0]} are read, not those of {others} {OTHER_TOPICS}."
        if kind == JOINT_STATE and note not in self._notes:
            self._notes.append(note)
        return usual

    def _missing_topic(self, topic, kind):
        """Return the error about a topic that is not there."""
        types = {one.topic: _describe_type(one) for one in self._bag.connections}
        if topic in types:
            text = f"topic {topic} is of {types[topic]}; expected {kind}. {self._content()}"
            return InputError(f"'{self._path}': {text}.")
        topics = sorted(one.topic for one in self._bag.connections if one.type == kind)
        near = get_close_matches(topic, topics or sorted(types), n=1)
        only = f"of {kind}, only {', '.join(topics)}" if topics else f"of {kind}: {self._content()}"
        return InputError(f"'{self._path}' has no topic '{topic}' {only}.{_meant(near)}")

    def _content(self):
        """Return the topics of the bag as a text."""
        topics = sorted({f"{one.topic} ({_describe_type(one)})" for one in self._bag.connections})
        lost = "".join(f"; {one.where}: {one.what}" for one in self.unread[:3])
        if any(one.encoding != ENCODING for one in self._bag.connections):
            lost += f"; expected messages encoded as {EXPECTED}"
        return (f"its topics are {', '.join(topics)}" if topics else "it has no topics that could be read") + lost


def _describe_type(one):
    """Return the type of a connection, and its encoding where that is not read."""
    return (one.type or "no type") + (f", encoded as '{one.encoding}'" if one.encoding != ENCODING else "")


def _meant(near):
    return f" Is {near[0]!r} meant?" if near else ""


def decode_messages(decoder, messages, kinds):
    """Return the Batch of Messages; `kinds` are the types of their connections."""
    kind = kinds[messages.connection]
    parts, errors = decoder.decode(messages.data, messages.at, messages.size, np.flatnonzero(kind == JOINT_STATE))
    odometry = {
        k: messages.data[messages.at[k] : messages.at[k] + messages.size[k]].tobytes()
        for k in np.flatnonzero(kind == ODOMETRY).tolist()
    }
    return Batch(messages.log_time, parts, odometry, errors)
