# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags: files of messages and folders of them, opened by their first bytes.

A reader of files, such as McapFile, has `connections`, the first log time `start` [ns] or None, and
`parts(wanted)`. These are, for some connections by index, (first log time, last one, function that
returns Messages or None), in order.
"""

import re
import shutil
import tempfile
from collections import Counter
from contextlib import suppress
from functools import lru_cache, partial
from importlib import import_module
from math import inf
from pathlib import Path

import numpy as np

from diag_dynamics.description.urdf_text import GIT_LFS
from diag_dynamics.exceptions import InputError
from diag_dynamics.optional import require
from diag_dynamics.recordings.bag_messages import (
    REASON,
    Connection,
    DamageError,
    Messages,
    Unread,
    describe_error,
    group_rows,
    merge_parts,
)
from diag_dynamics.wire.definitions import typestore
from diag_dynamics.yaml_files import read_yaml

METADATA = "metadata.yaml"  # file that rosbag2 writes into a folder when it closes a recording
ZSTD = b"\x28\xb5\x2f\xfd"
MAGIC = {b"\x89MCAP": "mcap", b"SQLite format 3": "sqlite", b"#ROSBAG": "ros1"}
SUFFIXES = {".mcap": "mcap", ".db3": "sqlite", ".bag": "ros1"}
PACKED = ".zstd"  # suffix that rosbag2 adds to compressed files
KNOWN = "a rosbag2 folder, .mcap or .db3, also compressed by zstd, or a ROS 1 .bag"
ROS1 = "ros1", "ros1msg"  # names of the encoding of ROS 1
ROS1_TYPES = "sensor_msgs/msg/JointState", "nav_msgs/msg/Odometry", "std_msgs/msg/String"
"""Types of messages that recordings are made of."""
MAX_MESSAGE = 1 << 26  # maximum size of a message that is compressed by itself [bytes]
OF_URIS = {*"?#%"}  # signs that rosbags cannot have in the name of a SQLite file


class Bag:
    """Messages of a file, or of the files of a folder, those of ROS 1 converted to CDR.

    `unread` (damage) is complete after the last piece; `start` is the first log time [ns].
    """

    def __init__(self, path):
        self.path = Path(path)
        self.connections = []
        self._folders = []  # temporary ones, which are deleted with the bag
        self.unread = []
        self._lose = partial(_add_damage, self.unread)
        paths = _find_bags(self.path, self._lose) if self.path.is_dir() else [self.path]
        self._files = [self._open_file(path, str(path)) for path in paths]
        self._maps = [self._map_connections(file) for file in self._files]
        starts = (file.start for file in self._files if file.start is not None)
        self.start = min(starts, default=None)

    def pieces(self, connections, begin=-inf, end=inf):
        """Yield Messages of some connections in log-time order.

        They contain at least those between two log times [ns].
        """
        failed = Counter()
        connections = set(connections)

        def read_file(file, places, conversions):
            convert = partial(
                _convert, conversions=conversions, places=np.array(places), failed=failed
            )
            chosen = {k for k, place in enumerate(places) if place in connections}
            for first, last, read in file.parts(chosen):
                if begin <= last and first < end:
                    yield first, lambda read=read: convert(read())

        yield from merge_parts(
            read_file(file, *maps) for file, maps in zip(self._files, self._maps, strict=True)
        )
        for k, count in failed.items():
            topic, kind = self.connections[k][:2]
            text = f"{count} of '{topic}' are damaged, or not of the type {kind} of ROS Noetic"
            self._lose(self.path, "messages", text)

    def _open_file(self, path, name):
        """Open a file; one that is compressed is unpacked into a temporary folder."""
        begin = first_bytes(path)
        if begin.startswith(ZSTD):
            return self._open_file(self._unpack(path), name)
        kind = next((kind for magic, kind in MAGIC.items() if begin.startswith(magic)), None)
        kind = kind or SUFFIXES.get(path.suffix)
        if kind is None:
            raise InputError(f"'{name}' is not a supported bag; expected {KNOWN}.")
        if kind == "mcap":  # the library is optional
            require("mcap", REASON)
            reader = import_module("diag_dynamics.recordings.mcap_file").McapFile
        else:
            reader = partial(RosbagFile, is_ros1=kind == "ros1")
            if kind == "sqlite" and (path.suffix != ".db3" or OF_URIS.intersection(str(path))):
                path = self._link(path)
        return reader(path, name, partial(self._lose, name))

    def _link(self, path):
        """Return a path to a SQLite file by which rosbags opens it."""
        folder = tempfile.TemporaryDirectory(prefix="diag_dynamics-")
        self._folders.append(folder)
        link = Path(folder.name) / "bag.db3"
        link.symlink_to(path.absolute())
        return link

    def _unpack(self, path):
        """Return the path of the content of a compressed file."""
        zstandard = require("zstandard", REASON)
        folder = tempfile.TemporaryDirectory(prefix="diag_dynamics-")
        self._folders.append(folder)
        content = Path(folder.name) / path.name.removesuffix(PACKED)
        try:
            with open(path, "rb") as file, open(content, "wb") as out:
                unpacker = zstandard.ZstdDecompressor()
                shutil.copyfileobj(
                    unpacker.stream_reader(file, read_across_frames=True), out, 1 << 17
                )
        except zstandard.ZstdError as error:
            text = f"{describe_error(error)}: all content after {content.stat().st_size} bytes"
            self._lose(path, "its compression", text)
        except OSError as error:
            raise InputError(f"'{path}' cannot be decompressed: {error.strerror}.") from error
        return content

    def _map_connections(self, file):
        """Return the places of connections in `connections`, and conversions by connection."""
        places = []
        conversions = {}
        for k, connection in enumerate(file.connections):
            connection = connection._replace(type=_normalize_type(connection.type))
            if connection.encoding in ROS1:
                if convert := _find_conversion(connection.type, connection.md5):
                    conversions[k] = convert
                connection = connection._replace(encoding="cdr")
            if connection not in self.connections:
                self.connections.append(connection)
            places.append(self.connections.index(connection))
        return places, conversions


def _add_damage(unread, file, where, what):
    """Add data that cannot be read to a list, once."""
    if (damage := Unread(str(file), where, what)) not in unread:
        unread.append(damage)


def _convert(messages, conversions, places, failed):
    """Return Messages in CDR with connections of the bag; `failed` counts those of another type."""
    if messages is None:
        return None
    view = memoryview(messages.data)
    first = int(messages.at[0])
    is_compressed = view[first : first + 4] == ZSTD  # all messages of a file, or none
    if not conversions and not is_compressed:
        return messages._replace(connection=places[messages.connection])
    if is_compressed:
        require("zstandard", REASON)
    rows = []
    columns = (column.tolist() for column in messages[1:])
    for k, at, size, time in zip(*columns, strict=True):
        raw = view[at : at + size]
        try:
            raw = _unpack_message(raw) if is_compressed else raw
            rows.append((places[k], time, conversions[k](raw) if k in conversions else raw))
        except Exception:  # rosbags generates code from the definition, which checks little
            failed[int(places[k])] += 1
    return Messages.from_rows(rows) if rows else None


def _unpack_message(raw):
    """Return the content of a compressed message; raise an error if it is damaged or too large."""
    zstandard = require("zstandard", REASON)
    if zstandard.frame_content_size(raw) > MAX_MESSAGE:
        raise DamageError("the message is too large")
    return zstandard.ZstdDecompressor().decompress(raw, MAX_MESSAGE)


def _normalize_type(name):
    """Return a type as ROS 2 has it; ROS 1 omits ``/msg/``, IDL writes ``a::msg::dds_::B_``."""
    name = name.replace("::", "/")
    if "/dds_/" in name:
        name = name.replace("/dds_/", "/").removesuffix("_")
    package, slash, rest = name.partition("/")
    return f"{package}/msg/{rest}" if slash and "/" not in rest else name


@lru_cache(64)
def _find_conversion(name, md5):
    """Return the function that converts messages of a type of ROS 1 to CDR, or None."""
    if name not in ROS1_TYPES:
        return None
    typesys = require("rosbags.typesys", REASON)
    noetic = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    store = typestore()  # its headers have no `seq`
    is_known = md5 in ("", "*", noetic.generate_msgdef(name, ros_version=1)[1])

    def convert(raw):
        if not is_known:
            raise DamageError("the type has another definition")
        return store.ros1_to_cdr(raw, name)

    return convert


# --- SQLite and ROS 1 ---


class RosbagFile:
    """A SQLite file, or a bag of ROS 1 with its index. It is read up to the first damage."""

    def __init__(self, path, name, lose, is_ros1):
        self._lose = lose
        self._open = partial(require(f"rosbags.rosbag{2 - is_ros1}", REASON).Reader, path)
        self.connections = []
        self.start = None
        repair = f"rosbag reindex {name}" if is_ros1 else f"sqlite3 {name} .recover"
        self._advice = f"`{repair}` may help"
        try:
            with self._open() as reader:
                for entry in reader.connections:
                    encoding = "ros1" if is_ros1 else entry.ext.serialization_format
                    connection = Connection(entry.topic, entry.msgtype, encoding, entry.digest)
                    self.connections.append(connection)
                self.start = reader.start_time if reader.message_count else None
        except Exception as error:  # of damaged bytes
            size = path.stat().st_size
            text = f"{describe_error(error)}: {size} bytes; {self._advice}"
            lose("index", text if size else "the file is empty")
        journals = [Path(f"{name}{end}") for end in ("-wal", "-journal")]
        if any(journal.is_file() and journal.stat().st_size for journal in journals):
            lose("journal", f"it is not read; `sqlite3 {name} .schema` writes it into the file")

    def parts(self, connections):
        """Yield (first log time, last one, function that returns Messages) in their order."""
        return group_rows(self._read_rows(connections)) if connections and self.connections else ()

    def _read_rows(self, connections):
        """Yield (connection, log time, content) of each message."""
        time = 0
        count = 0
        with self._open() as reader:
            chosen = {entry.id: k for k, entry in enumerate(reader.connections) if k in connections}
            entries = [entry for entry in reader.connections if entry.id in chosen]
            lost = sum(entry.msgcount for entry in entries)
            try:
                for entry, time, data in reader.messages(entries):
                    if isinstance(data, bytes) and isinstance(time, int):
                        count += 1
                        yield chosen[entry.id], time, data
                cause = "no bytes, or no log time in int64"
            except Exception as error:  # of damaged bytes
                cause = describe_error(error)
            if lost > count:
                text = f"{cause}: {lost - count} messages; {self._advice}"
                self._lose(f"after log time {time}", text)


# --- Files of a folder ---


def _find_bags(folder, lose):
    """Return the bags of a folder by suffix or first bytes, `bag_10` behind `bag_9`.

    Report those that metadata.yaml lists and that are missing.
    """
    try:
        names = [path.name for path in folder.iterdir() if path.is_file() and is_bag(path)]
    except OSError as error:
        raise InputError(f"'{folder}' cannot be read: {error.strerror}.") from error
    if not names:
        raise InputError(f"'{folder}' contains no bag; expected {KNOWN}, or the file of a table.")
    listed = _read_metadata(folder)
    missing = sorted(listed.difference(name.removesuffix(PACKED) for name in names))
    if missing and not len(missing) == len(listed) <= len(names):  # all files may be renamed
        lose(folder, METADATA, f"it lists {', '.join(missing)}, missing here")
    unpacked = {f"{name}{PACKED}" for name in names}  # of files that were played
    parts = {name: enumerate(re.split(r"(\d+)", name)) for name in {*names} - unpacked}
    names = sorted(
        parts, key=lambda name: [int(part) if k % 2 else part for k, part in parts[name]]
    )
    return [folder / name for name in names]


def _read_metadata(folder):
    """Return the names of files that metadata.yaml lists; none if it is missing or damaged."""
    with suppress(InputError, KeyError, TypeError):
        content = read_yaml(folder / METADATA, METADATA)
        paths = content["rosbag2_bagfile_information"]["relative_file_paths"]
        return {Path(path).name.removesuffix(PACKED) for path in paths}
    return set()


def is_bag(path):
    """Return whether a file has the suffix or the first bytes of a bag."""
    with suppress(InputError):
        suffix = Path(path.name.removesuffix(PACKED)).suffix
        return suffix in SUFFIXES or first_bytes(path).startswith(tuple(MAGIC))
    return False


def first_bytes(path):
    """Return the first bytes of a file; raise InputError if it cannot be read."""
    try:
        with open(path, "rb") as file:
            content = file.read(64)
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror}.") from error
    if content.startswith(GIT_LFS):
        raise InputError(f"'{path}' is a pointer of Git LFS. Run git lfs pull.")
    return content
