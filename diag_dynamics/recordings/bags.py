# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags: files of messages and folders of them, opened by their first bytes."""

import re
import shutil
import tempfile
from collections import Counter
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.messages import (
    Connection,
    DamageError,
    Messages,
    Notes,
    Stream,
    describe_error,
    merge_streams,
    normalize_type,
    require,
)

METADATA = "metadata.yaml"
"""File that rosbag2 writes into a folder when it closes a recording."""
ALL = "All bags in it are read, in the order of their names."
ZSTD = b"\x28\xb5\x2f\xfd"
MAGIC = {b"\x89MCAP": "mcap", b"SQLite format 3": "sqlite", b"#ROSBAG": "ros1"}
SUFFIXES = {".mcap": "mcap", ".db3": "sqlite", ".bag": "ros1"}
UNFINISHED, PACKED = ".active", ".zstd"
"""Suffixes that rosbag of ROS 1 adds while it records, and rosbag2 to compressed files."""
KNOWN = "folders of rosbag2, .mcap and .db3, each of them compressed by zstd or not, and .bag of ROS 1"
ROS1 = "ros1", "ros1msg"
"""Names of the encoding of ROS 1."""
MAX_MESSAGE = 1 << 26
"""Maximum size of a message that is compressed by itself [bytes]."""


def open_bag(path):
    """Return the Bag of a file or a folder; an InputError says that it is none, or which package is not installed."""
    return Bag(path)


class Bag:
    """Messages of a file, or of the files of a folder. Damage of a file raises no exception.

    Messages of ROS 1 are converted to CDR. `unread` (damage) and `findings` (oddities without loss) are complete after the
    last piece. No message precedes the log time `start` [ns], which is None without messages.
    """

    def __init__(self, path):
        self.path, self.begin, self.end = Path(path), None, None
        self.connections, self._notes, self._unpacked = [], Notes(), []
        self.unread, self.findings = self._notes.unread, self._notes.findings
        paths = _find_files(self.path, self._notes) if self.path.is_dir() else [self.path]
        self._files = [self._open_file(one, str(one)) for one in paths]
        self._maps = [self._map_connections(file) for file in self._files]
        self.start = min((file.start for file in self._files if file.start is not None), default=None)

    def limit(self, begin=None, end=None):
        """Allow to omit messages before one log time, and from another one on [ns]."""
        self.begin, self.end = begin, end

    def pieces(self, wanted=None):
        """Yield Messages in log-time order; `wanted` are indices of connections, None for all."""
        chosen = set(range(len(self.connections))) if wanted is None else set(wanted)
        streams, failed = [], Counter()
        for file, (places, conversions) in zip(self._files, self._maps, strict=True):
            own = {k for k, place in enumerate(places) if place in chosen}
            for start, end, read in file.streams(own):
                if (self.end is None or start < self.end) and (self.begin is None or end >= self.begin):
                    read = partial(_convert_stream, read, np.array(places), conversions, failed)
                    streams.append(Stream(start, end, read))
        yield from merge_streams(streams)
        for k, count in failed.items():
            what = f"{count} messages of '{self.connections[k].topic}' are not of its type"
            self._notes.add_damage(self.path, "messages of ROS 1", what)

    def _open_file(self, path, name):
        """Open a file; the content of one that is compressed is unpacked into a temporary folder."""
        begin = _first_bytes(path, name)
        if begin.startswith(ZSTD):
            return self._open_file(self._unpack(path), name)
        kind = next((kind for magic, kind in MAGIC.items() if begin.startswith(magic)), None)
        kind = kind or SUFFIXES.get(Path(path.name.removesuffix(UNFINISHED)).suffix)
        if kind is None:
            raise InputError(f"'{name}' is no bag that is known; there are {KNOWN}.")
        if kind == "mcap":
            require("mcap")
        reader = import_module(f"diag_dynamics.recordings.{kind}_file")  # the libraries are optional
        return getattr(reader, f"{kind.capitalize()}File")(path, name, self._notes)

    def _unpack(self, path):
        """Return the path of the content of a compressed file."""
        zstandard, folder = require("zstandard"), tempfile.TemporaryDirectory(prefix="diag_dynamics-")
        self._unpacked.append(folder)  # it is deleted with the bag
        content = Path(folder.name) / path.name.removesuffix(PACKED)
        try:
            with open(path, "rb") as file, open(content, "wb") as out:
                reader = zstandard.ZstdDecompressor().stream_reader(file, read_across_frames=True)
                shutil.copyfileobj(reader, out, 1 << 17)
        except zstandard.ZstdError as error:
            what = f"{describe_error(error)}: all behind {content.stat().st_size} bytes of its content"
            self._notes.add_damage(path, "its compression", what)
        except OSError as error:
            raise InputError(f"'{path}' cannot be decompressed: {error.strerror}.") from error
        return content

    def _map_connections(self, file):
        """Return the places of a file's declarations in `connections`, and conversions to CDR by declaration.

        A topic of several files is one connection; several writers in one file are several.
        """
        places, conversions = [], {}
        for k, (topic, kind, encoding, definition, md5) in enumerate(file.declarations):
            kind = normalize_type(kind)
            if encoding in ROS1:
                try:
                    ros1 = import_module("diag_dynamics.recordings.ros1_file")
                    conversions[k], encoding = ros1.find_conversion(kind, definition, md5), "cdr"
                except DamageError as error:
                    what = f": the type of topic '{topic}' is not understood: {error}."
                    self._notes.add_finding(self.path, what)
                    encoding = "ros1"
            one = Connection(topic, kind, encoding)
            alike = (n for n, other in enumerate(self.connections) if other == one and n not in places)
            if (place := next(alike, None)) is None:
                place = len(self.connections)
                self.connections.append(one)
            places.append(place)
        return places, conversions


def _convert_stream(read, places, conversions, failed):
    """Yield the Messages of a file in CDR, with connections of the bag; `failed` counts those of another type."""
    for messages in read():
        is_packed = messages.size >= len(ZSTD)
        for k, byte in enumerate(ZSTD):
            is_packed[is_packed] = messages.data[messages.at[is_packed] + k] == byte
        if conversions or is_packed.any():
            messages = _convert(messages, is_packed, conversions, failed, places)
        if messages:
            yield messages._replace(connection=places[messages.connection])


def _convert(messages, is_packed, conversions, failed, places):
    """Return Messages of which some are decompressed or converted to CDR; None if there are none."""
    rows, view, converted = [], memoryview(messages.data), {}
    for k, (_, convert_alike) in conversions.items():
        for size in set(messages.size[messages.connection == k].tolist()) if convert_alike else ():
            which = np.flatnonzero((messages.connection == k) & (messages.size == size))
            with suppress(Exception):  # those that are damaged are converted one by one
                same = np.lib.stride_tricks.sliding_window_view(messages.data, size)[messages.at[which]]
                alike, contents = convert_alike(same)
                converted |= zip(which[alike].tolist(), contents, strict=True)
    columns = (column.tolist() for column in (*messages[1:], is_packed))
    for row, (k, at, size, time, packed) in enumerate(zip(*columns, strict=True)):
        raw = view[at : at + size]
        if row in converted:
            rows.append((k, time, converted[row]))
            continue
        if packed:
            zstandard = require("zstandard")
            with suppress(zstandard.ZstdError):  # a damaged message is rejected when it is decoded
                if zstandard.frame_content_size(raw) <= MAX_MESSAGE:
                    raw = zstandard.ZstdDecompressor().decompress(raw, MAX_MESSAGE)
        try:
            rows.append((k, time, conversions[k][0](raw) if k in conversions else raw))
        except Exception:  # rosbags generates code from the definition, which checks little
            failed[int(places[k])] += 1
    return Messages.from_rows(*zip(*rows, strict=True)) if rows else None


# --- Files of a folder ---


def _find_files(folder, notes):
    """Return the files that metadata.yaml lists, renamed ones too; without it, all bags by their names and numbers."""
    listed, topics = _read_metadata(folder, notes)
    names = _names(folder, lambda name: Path(name.removesuffix(PACKED).removesuffix(UNFINISHED)).suffix in SUFFIXES)
    if not listed:
        names = names or _names(folder, partial(_begins_as_bag, folder))
        if not names:
            has = f"no {METADATA} and no" if listed is None else f"a {METADATA} that lists no files, and no"
            inner = sorted(path.parent.name for path in folder.glob(f"*/{METADATA}"))
            meant = f" Is one of its folders meant: {', '.join(inner[:8])}?" if inner else ""
            raise InputError(f"'{folder}' has {has} bags in it; there are {KNOWN}.{meant}")
        if listed is not None:
            notes.add_finding(folder, f": {METADATA} lists no files. {ALL}")
        return [folder / name for name in names]
    stored = {name: (name, f"{name}{PACKED}", name.removesuffix(PACKED)) for name in listed}
    files = {name: next((one for one in stored[name] if (folder / one).is_file()), None) for name in listed}
    others = [name for name in names if name not in files.values()]
    if None in files.values():
        others = others or _names(folder, lambda name: name not in names and _begins_as_bag(folder, name))
        missing = {name: listed[name] for name, file in files.items() if file is None}
        files |= _find_renamed(folder, listed, missing, others, topics, notes)
    for name, file in files.items():
        if file is None:
            notes.add_damage(folder, name, f"{METADATA} lists this file, which is not there")
    if others := sorted(set(others) - set(files.values())):
        notes.add_finding(folder, f": {METADATA} does not list {', '.join(others)}: not read.")
    return [folder / file for file in files.values() if file is not None]


def _find_renamed(folder, listed, missing, others, topics, notes):
    """Return other files by the listed name that each had.

    A file is recognized by its first time, its topics and the number of its messages. Where none of the listed files is
    there, as many others are taken for them.
    """
    bags, found = {other: Bag(folder / other) for other in others}, {}
    for name, sign in missing.items():
        alike = [other for other, bag in bags.items() if sign and _fits(bag, sign, topics)]
        if len(alike) == 1 and list(missing.values()).count(sign) == 1:
            found[name] = alike[0]
    rest = [name for name in missing if name not in found]
    left = [other for other in others if other not in found.values()]
    if len(missing) == len(listed) and rest and left:
        if len(rest) != len(left):
            raise InputError(
                f"'{folder}': {METADATA} lists {', '.join(missing)}; the folder has {', '.join(others)} instead, and "
                f"it is not certain which are meant. Give one file, or delete {METADATA} to read all of them."
            )
        found |= zip(rest, left, strict=True)
    for name, other in found.items():
        notes.add_finding(folder, f": {METADATA} lists {name}, which is not there; {other} is read instead.")
    return found


def _fits(bag, sign, topics):
    """Return whether a bag has a first time [ns] and a number of messages, and no topics but some."""
    if bag.start != sign[0] or not {one.topic for one in bag.connections} <= topics:
        return False
    return sum(len(piece.at) for piece in bag.pieces()) == sign[1]


def _read_metadata(folder, notes):
    """Return (first time [ns], number of messages) or None by listed file, and the topics; None without a list."""
    yaml, listed, topics = require("yaml"), {}, set()
    try:
        text = (folder / METADATA).read_text(encoding="utf-8")
        told = yaml.load(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))["rosbag2_bagfile_information"]
        listed = {_last_part(path): None for path in told["relative_file_paths"]}
        for topic in told.get("topics_with_message_count") or ():
            topics.add(str(topic["topic_metadata"]["name"]))
        for file in told.get("files") or ([told | {"path": next(iter(listed))}] if len(listed) == 1 else []):
            with suppress(KeyError, TypeError, AttributeError):
                sign = file["starting_time"]["nanoseconds_since_epoch"], file["message_count"]
                listed |= {name: sign for name in listed if name == _last_part(file["path"])}
    except FileNotFoundError:
        what = f" has no {METADATA}: its recorder was ended. {ALL}"
    except (OSError, ValueError, yaml.YAMLError, KeyError, TypeError, AttributeError) as error:
        what = f": {METADATA} is damaged ({describe_error(error)}). {ALL}"
    else:
        return listed, topics
    notes.add_finding(folder, what)
    return None, set()


def _last_part(path):
    """Return the name of a file, whatever system has written its path."""
    return str(path).replace("\\", "/").rpartition("/")[2]


def _names(folder, is_wanted):
    """Return names of files, `bag_10` behind `bag_9`."""

    def by_number(name):
        return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]

    try:
        return sorted((one.name for one in folder.iterdir() if one.is_file() and is_wanted(one.name)), key=by_number)
    except OSError as error:
        raise InputError(f"'{folder}' cannot be read: {error.strerror}.") from error


def _first_bytes(path, name):
    try:
        with open(path, "rb") as file:
            return file.read(16)
    except OSError as error:
        raise InputError(f"'{name}' cannot be read: {error.strerror}.") from error


def _begins_as_bag(folder, name):
    """Return whether the first bytes of a file are those of a bag."""
    with suppress(InputError):
        return _first_bytes(folder / name, name).startswith(tuple(MAGIC))
    return False
