# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""MCAP files, chunk by chunk: records by the library mcap, messages of a chunk by NumPy."""

import struct
import zlib
from bisect import bisect
from functools import partial
from io import BytesIO
from typing import NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, Schema
from mcap.stream_reader import get_chunk_data_stream

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.messages import LAST_TIME, DamageError, Messages, Stream, describe_error, require

MAGIC = b"\x89MCAP0\r\n"
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, LAST = 2, 3, 4, 5, 6, 7, 15
COMPRESSIONS = {"": "zlib", "zstd": "zstandard", "lz4": "lz4.frame"}
MAX_SIZE = 1 << 30
"""Maximum size of a chunk, a message, a declaration and a summary [bytes]."""
RUN = 1 << 20
"""Messages outside of chunks are read in parts of this size [bytes]."""
UNDECLARED, SKIPPED = -2, -1
NO_RECORD = "no record begins here"

_RECORD = struct.Struct("<BQ")
HEAD = np.dtype(
    [("opcode", "u1"), ("size", "<u8"), ("channel", "<u2"), ("number", "<u4"), ("time", "<u8"), ("sent", "<u8")]
)
"""First 31 bytes of a message record, of which its size counts the last 22."""


class Part(NamedTuple):
    """A chunk, or messages outside of chunks (`is_chunk` False), from log time `start` to `end` [ns].

    `size` is that of the record, `beyond` the first byte behind its message indexes. `channels` are None if the file does
    not list them.
    """

    at: int
    size: int
    beyond: int
    start: int
    end: int
    channels: frozenset | None
    is_chunk: bool = True

    def __str__(self):
        return f"{'chunk' if self.is_chunk else 'messages'} at byte {self.at}"


class McapFile:
    """An MCAP file, with or without chunks, indexes and summary.

    `declarations` are (topic, type, encoding, definition, MD5 sum) of its channels.
    """

    def __init__(self, path, name, notes):
        self._path, self._lose = path, partial(notes.add_damage, name)
        self._notes, self._name = notes, name
        self._channels, self._schemas, self._parts, self._strange = {}, {}, [], []
        with open(path, "rb") as file:
            size, known, end = file.seek(0, 2), {}, None
            try:
                known, end = self._read_summary(file, size)
            except Exception as error:  # of damaged bytes, which the library does not check
                notes.add_finding(name, f": the summary is not used: {describe_error(error)}.")
            self._is_declared, self._is_closed = bool(self._channels), end is not None
            self._find_parts(file, known, size if end is None else end)
        self.declarations = [self._describe(channel) for channel in self._channels.values()]
        self.start = min((part.start for part in self._parts if part.end), default=None)

    def streams(self, wanted):
        """Yield streams of the parts that may have messages of some declarations."""
        places = np.full(1 << 16, UNDECLARED)
        for k, channel in enumerate(self._channels):
            places[channel] = k if k in wanted else SKIPPED
        for part in self._parts:
            if part.channels is None or (places[list(part.channels)] != SKIPPED).any():
                yield Stream(part.start, part.end, partial(self._read_messages, part, places))

    def _read_summary(self, file, size):
        """Return chunks by their first bytes, and where the data end (None without a summary)."""
        file.seek(max(0, size - 37))
        tail = file.read()
        begin, _, crc = struct.unpack_from("<QQI", tail, 9) if len(tail) == 37 else (0, 0, 0)
        if tail[:9] != _RECORD.pack(FOOTER, 20) or tail[-8:] != MAGIC or begin == 0:
            return {}, None
        if not 0 <= size - 37 - begin <= MAX_SIZE:
            raise DamageError(f"it is to begin at byte {begin}")
        file.seek(begin)
        if crc and crc != zlib.crc32(tail[:25], zlib.crc32(file.read(size - 37 - begin))):
            raise DamageError("its CRC is wrong")
        file.seek(0)
        summary, known, behind = SeekingReader(file, record_size_limit=MAX_SIZE).get_summary(), {}, begin
        for one in sorted(summary.chunk_indexes, key=lambda one: -one.chunk_start_offset):
            at, channels = one.chunk_start_offset, frozenset(one.message_index_offsets) or None
            times, beyond = (
                (one.message_start_time, one.message_end_time),
                at + one.chunk_length + one.message_index_length,
            )
            if beyond > behind:
                raise DamageError(f"the chunk at byte {at} does not end before byte {behind}")
            known[at], behind = Part(at, one.chunk_length, beyond, *times, channels), at
        if all(channel.schema_id in {0, *summary.schemas} for channel in summary.channels.values()):
            self._channels, self._schemas = summary.channels, summary.schemas  # else chunks declare them
        return known, begin

    def _find_parts(self, file, known, stop):
        """Walk from record to record; chunks of the summary are not read."""
        at, places = len(MAGIC), sorted(known)
        file.seek(0)
        if file.read(len(MAGIC)) != MAGIC:
            self._lose("byte 0", "the file does not begin as one of MCAP does" if stop else "the file is empty")
        while at < stop:
            part = known.get(at)
            try:
                part, beyond = (part, part.beyond) if part else self._read_record(file, at, stop)
            except DamageError as error:
                beyond = next(iter(places[bisect(places, at) :]), stop)
                self._lose(f"byte {at}", f"{error}: {beyond - at} bytes (`mcap recover` may find more)")
                self._is_closed = True
            if part:
                self._add_part(part)
            at = beyond
        if self._strange:
            what = f"{len(self._strange)}, {sum(self._strange)} bytes"
            self._lose("records", f"records of kinds that the format does not have: {what}")
        if not self._is_closed:
            self._lose(f"byte {stop}", "the file has no end: what came here, if anything, is lost")

    def _read_record(self, file, at, stop):
        """Return a chunk or messages (None for another record), and the first byte behind."""
        file.seek(at)
        head = file.read(64)
        opcode, size = _RECORD.unpack_from(head) if len(head) > 8 else (0, 0)
        beyond = at + 9 + size
        if opcode == CHUNK:
            part = _parse_chunk(file, at, head, stop)
            return part, part.beyond
        is_read = opcode in (SCHEMA, CHANNEL, MESSAGE)
        if opcode == 0 or beyond > stop or (is_read and size > MAX_SIZE) or (opcode == MESSAGE and size < 22):
            raise DamageError(NO_RECORD)
        file.seek(at)
        if opcode == MESSAGE:
            part = _parse_run(at, file.read(min(stop - at, max(RUN, size + 9))))
            return part, part.beyond
        if is_read:
            self._declare(opcode, file.read(size + 9)[9:], f"byte {at}")
        elif opcode > LAST:
            self._strange.append(size + 9)
        elif opcode == FOOTER and beyond + len(MAGIC) == stop:
            self._is_closed, beyond = True, stop
        return None, beyond

    def _add_part(self, part):
        """Store a part; read its declarations if it has messages of unknown channels."""
        is_known = self._is_declared if part.channels is None else part.channels <= self._channels.keys()
        if part.is_chunk and not is_known and (found := self._read_content(part)):
            for opcode, at, size in _walk(found[0])[0]:
                if opcode in (SCHEMA, CHANNEL):
                    self._declare(opcode, found[0][at + 9 : at + 9 + size], str(part))
        self._parts.append(part)

    def _declare(self, opcode, content, where):
        """Store a schema or a channel; the first one with its number counts."""
        kind, stored = (Schema, self._schemas) if opcode == SCHEMA else (Channel, self._channels)
        try:
            one = kind.read(ReadDataStream(BytesIO(content)))
            stored.setdefault(one.id, one)
        except Exception as error:
            self._lose(where, f"a {kind.__name__.lower()} is not readable: {describe_error(error)}")

    def _describe(self, channel):
        """Return the declaration of a channel."""
        schema = self._schemas.get(channel.schema_id)
        if schema is None and channel.schema_id:
            what = f": topic '{channel.topic}' is of schema {channel.schema_id}, which is not declared."
            self._notes.add_finding(self._name, what)
        schema = schema or Schema(0, b"", "", "")
        text = "" if schema.encoding == "ros2idl" else schema.data.decode("utf-8", "backslashreplace")
        return channel.topic, schema.name, channel.message_encoding, text, channel.metadata.get("md5sum", "")

    def _read_content(self, part):
        """Return the records of a part and the places of messages that its indexes name; None if it is damaged."""
        indexed = np.empty(0, np.int64)
        try:
            with open(self._path, "rb") as file:
                file.seek(part.at)
                raw, indexes = file.read(part.size), file.read(part.beyond - part.at - part.size)
            if not part.is_chunk:
                return raw, indexed
            indexed = _parse_indexes(indexes)
            return _decompress(raw, part.size), indexed
        except InputError:  # a package is missing
            raise
        except Exception as error:
            lost = f"{len(indexed)} messages" if len(indexed) else f"{part.size} bytes"
            self._lose(str(part), f"{describe_error(error)}: {lost}")
            return None

    def _read_messages(self, part, places):
        """Yield the messages of a part."""
        if (found := self._read_content(part)) is None:
            return
        data = np.frombuffer(found[0], np.uint8)
        starts, end = _find_messages(*found)
        head = _read_heads(data, starts)
        place, is_late = places[head["channel"]], head["time"] > LAST_TIME
        for count, what in (
            (len(data) - end, f"bytes are lost from byte {end} of its records on, where none begins"),
            ((place == UNDECLARED).sum(), "messages are of channels that are declared nowhere"),
            ((is_late & (place >= 0)).sum(), "messages have log times that int64 cannot hold"),
        ):
            if count:
                self._lose(str(part), f"{count} {what}")
        columns = place, starts + 31, head["size"].astype(np.int64) - 22, head["time"].astype(np.int64)
        messages = Messages(data, *columns)
        rows = (place >= 0) & ~is_late
        messages = messages.sort() if rows.all() else messages.select(rows).sort()
        if len(messages.at):
            yield messages


def _read_heads(data, starts):
    """Return the heads of the message records that begin at some bytes."""
    return np.ndarray((max(0, len(data) - 30),), "V31", data, 0, (1,))[starts].view(HEAD)


def _walk(content, at=0):
    """Return (opcode, first byte, size) of the records from a byte on, and where they end."""
    records, stop = [], len(content)
    while at + 9 <= stop:
        opcode, size = _RECORD.unpack_from(content, at)
        if opcode == 0 or size > stop - at - 9:
            break
        records.append((opcode, at, size))
        at += 9 + size
    return records, at


def _find_messages(content, starts):
    """Return the first bytes of the message records, and where records end.

    `starts` of the indexes are used if the messages that they name follow each other without a gap to the end.
    """
    if len(starts) and starts[0] >= 0 and starts[-1] < len(content) - 30:
        head, (before, end) = _read_heads(content, starts), _walk(content[: starts[0]])
        beyond = starts + 9 + head["size"].astype(np.int64)
        is_whole = (beyond[:-1] == starts[1:]).all() and beyond[-1] == len(content)
        is_whole = is_whole and end == starts[0] and (head["opcode"] == MESSAGE).all()
        if is_whole and MESSAGE not in {opcode for opcode, *_ in before}:
            return starts, len(content)
    records, end = _walk(content)
    starts = [at for opcode, at, size in records if opcode == MESSAGE and size >= 22]
    return np.array(starts, np.int64), end


def _parse_chunk(file, at, head, stop):
    """Return the chunk at a place, with the channels of the message indexes behind it."""
    _, size, start, end, _, _, name = struct.unpack_from("<BQQQQII", head.ljust(64, b"\0"))
    if name > 15 or size != 40 + name + struct.unpack_from("<Q", head.ljust(64, b"\0"), 41 + name)[0]:
        raise DamageError(NO_RECORD)
    beyond, channels = at + 9 + size, set()
    if beyond > stop:
        raise DamageError("the file ends within a chunk")
    while True:
        file.seek(beyond)
        index = file.read(15).ljust(15, b"\0")
        opcode, length, channel, count = struct.unpack("<BQHI", index)
        if opcode != MESSAGE_INDEX:
            break
        if length != count + 6 or beyond + 9 + length > stop:
            channels = set()
            break
        channels.add(channel)
        beyond += 9 + length
    return Part(at, 9 + size, beyond, start, end, frozenset(channels) or None)


def _parse_run(at, data):
    """Return the messages without a chunk at a place, as many as there are in `data`."""
    records, _ = _walk(data)
    stops = (k for k, (opcode, _, size) in enumerate(records) if opcode != MESSAGE or size < 22)
    records = records[: next(stops, len(records))]
    head = _read_heads(data, [first for _, first, _ in records])
    times, channels, size = head["time"], frozenset(head["channel"].tolist()), sum(records[-1][1:]) + 9
    return Part(at, size, at + size, int(times.min()), int(times.max()), channels, is_chunk=False)


def _parse_indexes(raw):
    """Return the first bytes of messages that message indexes name; none if these are damaged."""
    found, at = [], 0
    while at + 15 <= len(raw):
        opcode, length, _, size = struct.unpack_from("<BQHI", raw, at)
        at += 15
        if opcode != MESSAGE_INDEX or length != size + 6 or size % 16 or at + size > len(raw):
            return np.empty(0, np.int64)
        found.append(np.frombuffer(raw, "<u8", size // 8, at)[1::2].astype(np.int64))
        at += size
    starts = np.concatenate([np.empty(0, np.int64), *found])
    return starts if (starts[1:] > starts[:-1]).all() else np.sort(starts)


def _decompress(raw, size):
    """Return the records of a chunk, whose CRC is checked."""
    if len(raw) < size or _RECORD.unpack_from(raw) != (CHUNK, size - 9):
        raise DamageError("no chunk is here")
    stream = BytesIO(raw)
    stream.seek(9)
    chunk = Chunk.read(ReadDataStream(stream))
    if chunk.compression not in COMPRESSIONS:
        raise DamageError(f"compression '{chunk.compression}' is not known; zstd, lz4 and none are")
    library, length = require(COMPRESSIONS[chunk.compression]), chunk.uncompressed_size
    is_zstd = chunk.compression == "zstd"
    if length > MAX_SIZE or (is_zstd and library.frame_content_size(chunk.data) not in (-1, length)):
        raise DamageError(f"{length} bytes is not the size of its records")
    stream, found = get_chunk_data_stream(chunk, validate_crc=True)
    if found != length:
        raise DamageError(f"it has {found} bytes of records and is to have {length}")
    return stream.read(found)
