# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags of ROS 1, with or without their index, and the conversion of their messages to CDR by rosbags."""

import bz2
import struct
from collections import Counter
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.messages import DamageError, Messages, Stream, describe_error, require

MAGIC = b"#ROSBAG V2.0\n"
CHUNK, CHUNK_INFO, CONNECTION = 5, 6, 7
MAX_SIZE = 1 << 30
"""Maximum size of a chunk [bytes]."""
OP, CONN, TIME = b"\4\0\0\0op=\2", b"\t\0\0\0conn=", b"\r\0\0\0time="
"""Fields in the header of a message, behind their lengths."""
HEADER, JOINT_STATE = "std_msgs/msg/Header", "sensor_msgs/msg/JointState"
_TIME = struct.Struct("<II")


class Part(NamedTuple):
    """A chunk from log time `start` to `end` [ns], with the number of messages by connection."""

    at: int
    start: int
    end: int
    counts: dict


class Ros1File:
    """A bag of ROS 1. One without an index, as a killed recorder leaves it, is read up to its last whole chunk.

    `declarations` are (topic, type, encoding, definition, MD5 sum) of its connections.
    """

    def __init__(self, path, name, notes):
        self._path, self._lose = path, partial(notes.add_damage, name)
        self._connections, self._parts = {}, []
        with open(path, "rb") as file:
            self._size = file.seek(0, 2)
            file.seek(0)
            if file.read(len(MAGIC)) != MAGIC:
                what = "the file does not begin as a bag of ROS 1 does, of version 2.0"
                self._lose("byte 0", what if self._size else "the file is empty")
            else:
                try:
                    self._read_index(file)
                except Exception as error:  # of damaged bytes
                    notes.add_finding(name, f": the index is not used: {describe_error(error)}.")
                    self._connections, self._parts = {}, []
                    self._find_chunks(file)
        self.declarations = list(self._connections.values())
        self.start = min((part.start for part in self._parts), default=None)

    def streams(self, wanted):
        """Yield streams of the chunks that have messages of some declarations."""
        places = {key: k for k, key in enumerate(self._connections) if k in wanted}
        for part in self._parts:
            if not places.keys().isdisjoint(part.counts):
                yield Stream(part.start, part.end, partial(self._read_messages, part, places))

    def _read_index(self, file):
        """Read connections and chunks as the end of the file lists them."""
        fields, _ = _read_record(file, self._size)
        at, *expected = (_number(fields[name]) for name in (b"index_pos", b"chunk_count", b"conn_count"))
        if at == 0:
            raise DamageError("the file was not closed")
        file.seek(at)
        while file.tell() < self._size:
            fields, data = _read_record(file, self._size)
            if fields[b"op"][0] == CONNECTION:
                self._declare(fields, data)
            elif fields[b"op"][0] == CHUNK_INFO and data:
                counts = np.frombuffer(data, "<u4").reshape(-1, 2).tolist()
                times = _time(fields[b"start_time"]), _time(fields[b"end_time"])
                self._parts.append(Part(_number(fields[b"chunk_pos"]), *times, dict(counts)))
        if [len(self._parts), len(self._connections)] != expected:
            raise DamageError(f"it has {len(self._parts)} chunks; expected {expected[0]}")

    def _find_chunks(self, file):
        """Walk from chunk to chunk, and read which messages they have."""
        at = len(MAGIC)
        try:
            while at < self._size:
                file.seek(at)
                fields, data = _read_record(file, self._size)
                if fields[b"op"][0] == CHUNK:
                    self._add_chunk(at, fields, data)
                elif fields[b"op"][0] == CONNECTION:
                    self._declare(fields, data)
                at = file.tell()
        except Exception as error:
            self._lose(f"byte {at}", f"{describe_error(error)}: {self._size - at} bytes")
        else:
            self._lose(f"byte {at}", "the file was not closed: what came here, if anything, is lost")

    def _add_chunk(self, at, fields, data):
        rows, connections, problem = _parse_chunk(fields, data)
        if problem:
            self._lose(f"chunk at byte {at}", f"{problem}: {len(data)} bytes")
        for one in connections:
            self._declare(*one)
        if rows:
            keys, times, _ = zip(*rows, strict=True)
            self._parts.append(Part(at, min(times), max(times), Counter(keys)))

    def _declare(self, fields, data):
        """Store a connection."""
        more = _parse_fields(data)
        values = (fields[b"topic"], more[b"type"], b"ros1", more.get(b"message_definition", b""), more[b"md5sum"])
        self._connections.setdefault(_number(fields[b"conn"]), tuple(one.decode(errors="replace") for one in values))

    def _read_messages(self, part, places):
        """Yield the messages of a chunk."""
        rows, count = [], sum(count for key, count in part.counts.items() if key in places)
        try:
            with open(self._path, "rb") as file:
                file.seek(part.at)
                found, _, problem = _parse_chunk(*_read_record(file, self._size))
            rows = [(places[key], time, data) for key, time, data in found if key in places]
        except (DamageError, OSError) as error:
            problem = describe_error(error)
        if problem:
            self._lose(f"chunk at byte {part.at}", f"{problem}: {count - len(rows)} messages")
        if rows:
            yield Messages.from_rows(*zip(*rows, strict=True))


def _number(data):
    return int.from_bytes(data, "little")


def _time(data):
    return _number(data[:4]) * 10**9 + _number(data[4:8])


def _read_record(file, size):
    """Return the fields and the data of the record at the position of a file."""
    parts = []
    for _ in range(2):
        length = _number(file.read(4))
        if length > size - file.tell():
            raise DamageError("the file ends within a chunk" if parts else "no record begins here")
        parts.append(file.read(length))
    return _parse_fields(parts[0]), parts[1]


def _parse_fields(data):
    """Return the fields of a header by name."""
    fields, at = {}, 0
    while at < len(data):
        length = _number(data[at : at + 4])
        name, is_field, value = data[at + 4 : at + 4 + length].partition(b"=")
        if not is_field or length > len(data) - at - 4:
            raise DamageError("no record begins here")
        fields[name], at = value, at + 4 + length
    return fields


def _decompress(fields, data):
    """Return the records of a chunk."""
    size, compression = _number(fields[b"size"]), fields[b"compression"]
    if size > MAX_SIZE:
        raise DamageError(f"it is to have {size} bytes of records; expected {MAX_SIZE} at most")
    if compression == b"bz2":
        data = bz2.BZ2Decompressor().decompress(data, size + 1)
    elif compression == b"lz4":
        data = require("lz4.frame").LZ4FrameDecompressor().decompress(data, size + 1)
    elif compression != b"none":
        raise DamageError(f"compression {compression!r} is not known; bz2, lz4 and none are")
    if len(data) != size:
        raise DamageError(f"it has {len(data)} bytes of records and is to have {size}")
    return data


def _parse_chunk(fields, data):
    """Return the messages of a chunk, as (connection, log time, content), its connections, and its damage or None."""
    rows, connections, at = [], [], 0
    try:
        records = _decompress(fields, data)
        while at < len(records):
            head = at + 4 + _number(records[at : at + 4])
            end = head + 4 + _number(records[head : head + 4])
            header, data = records[at + 4 : head], records[head + 4 : end]
            if end > len(records):
                raise DamageError
            if OP in header:  # of a message, whose fields are found faster without a dict
                conn, time = header.index(CONN) + len(CONN), header.index(TIME) + len(TIME)
                seconds, nanoseconds = _TIME.unpack_from(header, time)
                rows.append((_number(header[conn : conn + 4]), seconds * 10**9 + nanoseconds, data))
            elif (fields := _parse_fields(header))[b"op"][0] == CONNECTION:
                connections.append((fields, data))
            at = end
    except InputError:  # a package is missing
        raise
    except Exception as error:  # of damaged bytes
        problem = f"no record begins at byte {at} of its records" if rows else describe_error(error)
        return rows, connections, problem
    return rows, connections, None


@lru_cache(64)
def find_conversion(name, definition, md5):
    """Return the function that converts messages of a type of ROS 1 to CDR, without the `seq` of headers.

    A second one converts rows of messages and returns which are converted; it is None but for joint states.

    Types that the definition lacks are those of ROS Noetic. So is the type itself if the definition is empty or cannot be
    parsed, and the MD5 sums agree. A DamageError says why a type is not known.
    """
    typesys = require("rosbags.typesys")
    noetic, types, expected = typesys.get_typestore(typesys.Stores.ROS1_NOETIC), {}, None
    for known in (HEADER, name):
        if known in noetic.types:
            text, expected = noetic.generate_msgdef(known, ros_version=1)
            types |= typesys.get_types_from_msg(text, known)
    if not definition.strip():
        if name not in types:
            raise DamageError("its definition is empty, and the type is not one of ROS Noetic")
        if md5 not in ("", "*", expected):
            raise DamageError(f"its definition is empty, and its MD5 sum is {md5}; expected {expected}")
        definition = text
    try:
        store = _make_store(typesys, types, name, definition)
    except Exception as error:  # a definition may be anything, and the library checks little
        if name not in types or md5 != expected:
            raise DamageError(describe_error(error)) from error
        store = _make_store(typesys, types, name, text)
    convert = partial(store.ros1_to_cdr, typename=name)
    return convert, partial(_convert_alike, convert) if name == JOINT_STATE else None


def _convert_alike(convert, rows):
    """Convert joint states that differ from the first one in numbers alone; return their mask and contents."""
    template = np.frombuffer(convert(rows[0].tobytes()), np.uint8)
    places, is_text = _find_numbers(rows[0], 1), np.ones(rows.shape[1], bool)
    for place in (slice(4), *places):  # `seq` and all numbers
        is_text[place] = False
    alike = (rows[:, is_text] == rows[0, is_text]).all(axis=1)
    contents = np.tile(template, (np.count_nonzero(alike), 1))
    for old, new in zip(places, _find_numbers(template, 8), strict=True):
        contents[:, new] = rows[alike, old]
    return alike, contents


def _find_numbers(raw, align):
    """Return the slices of stamp, positions, velocities and efforts in a joint state of ROS 1 (`align` 1) or CDR (8)."""
    at, found = 12, [slice(4, 12)]

    def read_count(at):
        at += (4 - at) % min(align, 4)
        return _number(raw[at : at + 4]), at + 4

    size, at = read_count(at)
    names, at = read_count(at + size)
    for _ in range(names):
        size, at = read_count(at)
        at += size
    for _ in range(3):
        count, at = read_count(at)
        at += (4 - at) % align if count else 0
        found.append(slice(at, at + 8 * count))
        at += 8 * count
    return found


def _make_store(typesys, types, name, definition):
    """Return the type store of a definition, in which headers have no `seq`."""
    types = types | typesys.get_types_from_msg(definition.replace("\r\n", "\n"), name)
    constants, fields = types[HEADER]
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    store.register(types | {HEADER: (constants, [field for field in fields if field[0] != "seq"])})
    store.generate_msgdef(name, ros_version=2)
    return store
