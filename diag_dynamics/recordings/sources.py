# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files and folders of any format as batches of messages about one robot."""

import os
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.decoding import Decoder
from diag_dynamics.model.single_joints import single_joints
from diag_dynamics.model.sources import GIT_LFS
from diag_dynamics.recordings.bags import METADATA, open_bag
from diag_dynamics.recordings.findings import OTHER_TOPICS
from diag_dynamics.recordings.intake import JOINT_STATE, ODOMETRY, Batch
from diag_dynamics.recordings.joint_names import JointNames, describe_maps, listed, propose_maps
from diag_dynamics.recordings.rows import Rows
from diag_dynamics.recordings.tables.column_map import ColumnMap, column_map
from diag_dynamics.recordings.tables.columns import open_table
from diag_dynamics.wire.definitions import read_message

DESCRIPTION = "std_msgs/msg/String"

BAGS = {".mcap", ".db3", ".bag"}
MAGIC = b"\x89MCAP", b"SQLite format 3", b"#ROSBAG"
"""Parts of names, and first bytes, of bags; anything else is taken for a table."""

READ = "cdr"
"""Encoding of messages that are read. Bags convert messages of ROS 1 to it."""

USUAL = {JOINT_STATE: "joint_states", ODOMETRY: "odom", DESCRIPTION: "robot_description"}
"""Last part of the name of a topic that is read, by its type."""

SEVERAL = {
    JOINT_STATE: "Give one, or all those of one robot: {options} (topic=[…]).",
    ODOMETRY: "One is read: the one called odom, or the one in the namespace of the joint states that --topic gives.",
    DESCRIPTION: "Give the robot: --urdf ROBOT (model).",
}
"""What to do about several topics of a type."""


def checked_topics(topic):
    """Return topics without repetition, as a tuple of str; empty for None.

    Raises
    ------
    InputError
        It is neither a name nor a sequence of names.
    """
    if topic is None:
        return ()
    topics = [topic] if isinstance(topic, str) else topic
    if not isinstance(topics, list | tuple) or not all(isinstance(one, str) and one for one in topics):
        raise InputError(f"topic is {topic!r}; expected the name of a topic or a list of names.")
    return tuple(dict.fromkeys(topics))


def source_of(path, columns=None, topic=None, joint_names=None):
    """BagSource or TableSource of a path.

    Parameters
    ----------
    path : str or Path
    columns : str, Path or dict, optional
        Map of the columns of a table; of a bag, with `joint_names` alone.
    topic : str or sequence of str, optional
        Topics of the joint states, where a bag has several.
    joint_names : mapping, optional
        See :class:`JointNames`.
    """
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
        raise InputError(f"there is no file or folder '{path}'.{f' Is {near[0]!r} meant?' if near else ''}")
    if path.name == METADATA:
        path = path.parent
    if path.is_file() and _first_bytes(path, len(GIT_LFS)) == GIT_LFS:
        raise InputError(f"'{path}' is a pointer of Git LFS. Run git lfs pull.")
    if not _is_bag(path):
        return TableSource(path, wanted, names)
    for key, value in wanted._asdict().items():
        if key not in ("joint_names", "source") and value != ColumnMap._field_defaults[key]:
            raise InputError(
                f"'{path}' is a bag; expected joint_names alone in a map of columns, and {wanted.source} has {key}."
            )
    return BagSource(path, topic, names)


def _is_bag(path):
    """Whether this is a bag, by its name or its first bytes."""
    if path.is_dir() or BAGS & set(path.suffixes):
        return True
    begin = _first_bytes(path, 16)
    return any(begin.startswith(magic) for magic in MAGIC)


def _first_bytes(path, count):
    """Return the first bytes of a file."""
    with open(path, "rb") as file:
        return file.read(count)


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
    offset : int
        0: times are as they are.
    names : JointNames or None
    """

    def __init__(self, path, topic=None, names=None):
        self.offset, self.names = 0, names
        self._path, self._bag = path, open_bag(path)
        self._topics = checked_topics(topic)
        self._notes = []

    @property
    def unread(self):
        """What could not be read: a list of Unread."""
        return self._bag.unread

    without_values = 0  # as of TableSource

    @property
    def notes(self):
        """What is odd about the file, though nothing is lost: a list of str."""
        return [*self._bag.findings, *self._notes]

    def description(self):
        """The robot_description in the bag.

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
            raise InputError(f"'{self._path}' has nothing: {self._all()}.")
        raise InputError(f"'{self._path}' has no robot_description: say which robot it is of (model, or --urdf ROBOT).")

    @property
    def start(self):
        """Log time [ns] that no message is before; None if it is known when there is a piece."""
        return self._bag.start

    def limit(self, begin, end):
        """Leave messages out, where that is easy, that are before a log time, or not before another one [ns]."""
        self._bag.limit(begin, end)

    def _wanted(self, model):
        wanted = self._connections(JOINT_STATE)
        if not wanted and not model.floating_base:
            raise InputError(f"'{self._path}' has no joint states: {self._all()}.")
        return wanted + self._connections(ODOMETRY) if model.floating_base else wanted

    def batches(self, model):
        """Yield batches of messages in the order of log time."""
        wanted, decoder = self._wanted(model), Decoder()
        if self.names:
            self.names.check_recording(self._all_names(), model)
        kinds = np.array([connection.type for connection in self._bag.connections])
        for messages in self._bag.pieces(wanted):
            yield decode_messages(decoder, messages, kinds)

    def _all_names(self):
        """Yield names of joints in messages, whatever the limits are."""
        begin, end, wanted = self._bag.begin, self._bag.end, self._connections(JOINT_STATE)
        decoder, kinds = Decoder(), np.array([connection.type for connection in self._bag.connections])
        self._bag.limit(None, None)
        try:
            for messages in self._bag.pieces(wanted) if wanted else ():
                yield [name for part in decode_messages(decoder, messages, kinds).parts for name in part.names]
        finally:
            self._bag.limit(begin, end)

    def _connections(self, kind):
        """Indices of the connections of a type that are read.

        Raises
        ------
        InputError
            There are several topics and no rule chooses, or a chosen one is not there or cannot be read.
        """
        every = [(k, one) for k, one in enumerate(self._bag.connections) if one.type == kind]
        topics = list(self._topics) if kind == JOINT_STATE else []
        for topic in topics:
            if all(topic != one.topic for _, one in every):
                raise self._missing_topic(topic, kind)
        topics = topics or self._choose_topics(kind, [one for _, one in every])
        chosen = [(k, one) for k, one in every if one.topic in topics]
        for _, one in chosen:
            if one.encoding != READ:
                raise InputError(f"'{self._path}': {self._encoded(one)}")
        return [k for k, _ in chosen]

    def _choose_topics(self, kind, every):
        """Topics that are read where none is chosen: the only one, or the one with the usual name."""
        topics = sorted({one.topic for one in every})
        if len(topics) < 2:
            return topics
        readable = sorted({one.topic for one in every if one.encoding == READ}) or topics
        usual = [name for name in readable if name.split("/")[-1] == USUAL[kind]] if len(readable) > 1 else readable
        beside = {topic.rpartition("/")[0] for topic in self._topics}  # namespaces
        if len(usual) > 1 and kind != JOINT_STATE:
            usual = [name for name in usual if name.rpartition("/")[0] in beside]
        if len(usual) != 1:
            options = " ".join(f"--topic {topic}" for topic in topics[:2])
            raise InputError(
                f"'{self._path}' has several topics of {kind}: {', '.join(topics)}. {SEVERAL[kind].format(options=options)}"
            )
        others = ", ".join(name for name in topics if name not in usual)
        note = f"'{self._path}': joint states of {usual[0]} are read, not those of {others} {OTHER_TOPICS}."
        if kind == JOINT_STATE and note not in self._notes:
            self._notes.append(note)
        return usual

    def _missing_topic(self, topic, kind):
        """The error about a topic that is not there."""
        types = {one.topic: self._typed(one) for one in self._bag.connections}
        if topic in types:
            return InputError(f"'{self._path}': topic {topic} is of {types[topic]}; expected {kind}. {self._all()}.")
        topics = sorted(one.topic for one in self._bag.connections if one.type == kind)
        near = get_close_matches(topic, topics or sorted(types), n=1)
        only = f"of {kind}, only {', '.join(topics)}" if topics else f"of {kind}: {self._all()}"
        return InputError(f"'{self._path}' has no topic '{topic}' {only}.{f' Is {near[0]!r} meant?' if near else ''}")

    def _encoded(self, one):
        """What is wrong with the encoding of a connection."""
        why = "".join(f" {note}" for note in self._bag.findings if f"topic '{one.topic}' is not understood" in note)
        return f"messages of {one.topic} are encoded as '{one.encoding}'; expected 'cdr' of ROS 2 or 'ros1'.{why}"

    @staticmethod
    def _typed(one):
        """Type of a connection, and its encoding where that is not read."""
        return (one.type or "no type") + (f", encoded as '{one.encoding}'" if one.encoding != READ else "")

    def _all(self):
        """What is in the bag."""
        topics = sorted({f"{one.topic} ({self._typed(one)})" for one in self._bag.connections})
        lost = "".join(f"; {one.where}: {one.what}" for one in self.unread[:3])
        other = any(one.encoding != READ for one in self._bag.connections)
        lost += "; expected messages encoded as 'cdr' of ROS 2 or 'ros1'" if other else ""
        return (f"its topics are {', '.join(topics)}" if topics else "it has no topics that could be read") + lost


class TableSource:
    """Rows of a table, as joint states.

    Parameters
    ----------
    path : Path
    columns : ColumnMap
    names : JointNames, optional

    Attributes
    ----------
    offset : int
        By how much stamps are later than times in the table [ns].
    names : JointNames or None
    """

    start = None  # as of BagSource

    def __init__(self, path, columns, names=None):
        self._path, self._columns, self._table, self._rows = path, columns, None, None
        self.names = names

    @property
    def offset(self):
        """By how much stamps are later than times in the table [ns]."""
        return self._rows.offset or 0 if self._rows else 0

    @property
    def unread(self):
        """What could not be read: a list of Unread."""
        return self._table.unread if self._table else []

    @property
    def notes(self):
        """How the columns and times were understood: a list of str."""
        return [*self._rows.notes, *self._table.notes] if self._rows else []

    @property
    def without_values(self):
        """Number of rows without a value of any joint."""
        return self._table.without_values if self._table else 0

    def description(self):
        """Raise an InputError: a table does not describe its robot."""
        raise InputError(f"'{self._path}' does not say which robot it is of: give it (model, or --urdf ROBOT).")

    def limit(self, begin, end):
        """Leave nothing out: a table has no index."""

    def batches(self, model):
        """Yield batches of messages in the order of the rows."""
        joints = single_joints(model)
        if self.names:
            joints = self._own_names(model, joints)
        try:
            self._table = open_table(self._path, self._columns, joints)
        except InputError as error:
            raise InputError(f"{error}{self._proposal(joints)}") from error
        self._rows = Rows(self._table.joints)
        yield from map(self._rows.batch, self._table.pieces())
        self._refuse_other_robot(model, list(self._rows.named))

    def _refuse_other_robot(self, model, named):
        """Refuse a table whose rows name joints, none of which the robot has."""
        own = [*single_joints(model), *model.mimics]
        if not named or any((self.names.map_name(name) if self.names else name) in own for name in named):
            return
        found = [] if self.names else propose_maps(named, own)
        raise InputError(
            f"'{self._path}': rows name {listed(named)}, none of which the robot has. Its joints are {listed(own)}."
            f"{f' {describe_maps(found, named, own)}.' if found else ''}"
        )

    def _own_names(self, model, joints):
        """The table's names of the joints of a robot, as its map leads to them."""
        undone = tuple(map(self.names.unmap_joint, joints))
        try:
            table = open_table(self._path, self._columns, ())
        except InputError:  # without names it is not certain which columns are read
            table = open_table(self._path, self._columns, undone)
        rows = Rows(table.joints)
        batches = map(rows.batch, table.pieces())
        own = self.names.check_recording(([n for part in one.parts for n in part.names] for one in batches), model)
        return tuple(name for name in own if self.names.map_name(name) in joints) or undone

    def _proposal(self, joints):
        """The map of names by which a table that cannot be read can be read, as a sentence; empty without one."""
        if self.names:
            return ""
        try:
            own = [name for name in open_table(self._path, self._columns, ()).joints if name not in joints]
        except InputError:
            return ""
        found = propose_maps(own, [joint for joint in joints if joint not in own])
        return f" {describe_maps(found, own, joints)}." if found else ""


def decode_messages(decoder, messages, kinds):
    """Return the Batch of messages of a bag.

    Parameters
    ----------
    decoder : Decoder
    messages : Messages
    kinds : ndarray of str
        Type of each connection's messages.
    """
    kind = kinds[messages.connection]
    parts, errors = decoder.decode(messages.data, messages.at, messages.size, np.flatnonzero(kind == JOINT_STATE))
    odometry = {
        k: messages.data[messages.at[k] : messages.at[k] + messages.size[k]].tobytes()
        for k in np.flatnonzero(kind == ODOMETRY).tolist()
    }
    return Batch(messages.log_time, parts, odometry, errors)
