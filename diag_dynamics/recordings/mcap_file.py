# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""MCAP files, chunk by chunk: records by the library mcap, messages of a chunk by NumPy."""

import struct
import zlib
from contextlib import suppress
from functools import partial
from io import BytesIO
from typing import NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, Schema, Statistics
from mcap.stream_reader import get_chunk_data_stream

from diag_dynamics.exceptions import InputError
from diag_dynamics.optional import require
from diag_dynamics.recordings.bag_messages import (
    REASON,
    Connection,
    DamageError,
    Messages,
    describe_error,
)

MAGIC = b"\x89MCAP0\r\n"
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, STATISTICS, LAST, PRIVATE = 2, 3, 4, 5, 6, 11, 15, 128
"""Kinds of records; those from `PRIVATE` on are not of the format."""
COMPRESSIONS = {"": "zlib", "zstd": "zstandard", "lz4": "lz4.frame"}
MAX_SIZE = 1 << 30  # maximum size of a chunk, a message, a declaration and a summary [bytes]
UNWRITTEN = bytes(512)  # a sector at the end of a chunk that a crash left empty
RUN = 1 << 20  # records outside of chunks are read in parts of this size [bytes]
LAST_TIME = (1 << 63) - 1  # latest log time that int64 holds [ns]
UNDECLARED, SKIPPED = -2, -1

_RECORD = struct.Struct("<BQ")
_FIELDS = {
    "opcode": "u1",
    "size": "<u8",
    "channel": "<u2",
    "number": "<u4",
    "time": "<u8",
    "sent": "<u8",
}
HEAD = np.dtype(list(_FIELDS.items()))
"""First 31 bytes of a message record; its size is without the first 9."""


class Part(NamedTuple):
    """A chunk, or records outside of chunks."""

    at: int
    size: int
    is_chunk: bool = True
    start: int = 0  # log times [ns]
    end: int = 0
    channels: frozenset = frozenset()  # empty: not known

    def __str__(self):
        return f"{'chunk' if self.is_chunk else 'messages'} at byte {self.at}"


class McapFile:
    """An MCAP file. Without a summary it is read up to the first damage between records."""

    def __init__(self, path, _name, lose):
        self._path = path
        self._lose = lose
        self._channels = {}
        self._schemas = {}
        self._parts = []
        with open(path, "rb") as file:
            self._size = file.seek(0, 2)
            with suppress(Exception):  # of damaged bytes, which the library does not check
                self._read_summary(file)
            if not self._parts:
                self._scan(file)
        self._parts.sort(key=lambda part: part.start)
        self.start = next((part.start for part in self._parts if part.end), None)
        self.connections = []
        for channel in self._channels.values():
            schema = self._schemas.get(channel.schema_id)
            md5 = channel.metadata.get("md5sum", "")
            fields = channel.topic, schema.name if schema else "", channel.message_encoding, md5
            self.connections.append(Connection(*fields))

    def parts(self, connections):
        """Yield (first log time, last one, function that returns Messages) in their order."""
        places = np.full(1 << 16, UNDECLARED)
        for k, channel in enumerate(self._channels):
            places[channel] = k if k in connections else SKIPPED
        for part in self._parts:
            if not part.channels or (places[list(part.channels)] != SKIPPED).any():
                yield part.start, part.end, partial(self._read_messages, part, places)

    def _read_summary(self, file):
        """Read channels and chunks from the summary, if it has all of them."""
        file.seek(self._size - 37)
        begin, _, crc = struct.unpack_from("<QQI", file.read(), 9)
        if not 0 < begin < self._size < begin + MAX_SIZE:
            return
        file.seek(begin)
        if crc and crc != zlib.crc32(file.read()[:-12]):
            return
        file.seek(0)
        summary = SeekingReader(file, record_size_limit=MAX_SIZE).get_summary()
        indexes = summary.chunk_indexes
        channels = summary.channels
        chunks = summary.statistics.chunk_count if summary.statistics else len(indexes)
        schemas = {channel.schema_id for channel in channels.values()}
        used = set().union(*(index.message_index_offsets for index in indexes))
        is_declared = channels and used <= channels.keys() and schemas <= {0, *summary.schemas}
        if chunks != len(indexes) or not is_declared:
            return
        self._channels = channels
        self._schemas = summary.schemas
        for index in indexes:
            offsets = frozenset(index.message_index_offsets)
            place = index.chunk_start_offset, index.chunk_length, True
            times = index.message_start_time, index.message_end_time
            self._parts.append(Part(*place, *times, offsets))

    def _scan(self, file):
        """Read channels and parts from all records."""
        file.seek(0)
        at = len(MAGIC)
        stop = self._size
        begin = file.read(len(MAGIC))
        chunks = 0  # less those that statistics count
        if not begin:
            self._lose("byte 0", "the file is empty")
            return
        if begin != MAGIC:
            self._lose("byte 0", "the file does not start with the magic bytes of MCAP")
        while at < stop:
            file.seek(at)
            opcode, size = _RECORD.unpack(file.read(9).ljust(9, b"\0"))
            end = at + 9 + size
            if opcode == FOOTER and end + len(MAGIC) == stop:
                if chunks < 0:
                    self._lose(f"byte {at}", f"{-chunks} chunks are missing: no record is theirs")
                return
            is_record = 0 < opcode <= LAST or opcode >= PRIVATE
            if not is_record or end > stop:
                is_chunk = opcode == CHUNK
                cause = "the file ends within a chunk" if is_chunk else "no record starts here"
                text = f"{cause}: {stop - at} bytes (`mcap recover` may find more)"
                self._lose(f"byte {at}", text)
                if is_chunk and size <= MAX_SIZE:
                    self._add_part(Part(at, end - at))
                return
            if opcode == CHUNK:
                chunks += 1
                self._add_part(Part(at, end - at))
            elif opcode == STATISTICS:
                with suppress(Exception):  # damaged
                    chunks -= Statistics.read(ReadDataStream(file)).chunk_count
            elif opcode in (SCHEMA, CHANNEL, MESSAGE):
                end = at + self._add_part(Part(at, min(max(RUN, end - at), stop - at), False))
            at = end
        self._lose(f"byte {stop}", "the file has no footer: it may be truncated here")

    def _add_part(self, part):
        """Store a part with its declarations, times and channels; return its size."""
        content = self._read_content(part) or b""
        starts, declarations, end = _find_records(content)
        for kind, raw in declarations:
            try:
                record = kind.read(ReadDataStream(BytesIO(raw)))
                records = self._schemas if kind is Schema else self._channels
                records.setdefault(record.id, record)
            except Exception as error:
                text = f"a {kind.__name__.lower()} is not readable: {describe_error(error)}"
                self._lose(str(part), text)
        if len(starts):
            heads = _read_heads(content, starts)
            times = heads["time"]
            channels = frozenset(heads["channel"].tolist())
            size = part.size if part.is_chunk else end
            span = int(times.min()), int(times.max())
            self._parts.append(Part(part.at, size, part.is_chunk, *span, channels))
        return end or part.size

    def _read_content(self, part):
        """Return the records of a part, up to a cut; None if it is damaged."""
        try:
            with open(self._path, "rb") as file:
                file.seek(part.at)
                raw = file.read(min(part.size, MAX_SIZE))
            return self._unpack(part, raw) if part.is_chunk else raw
        except InputError:  # a package is missing
            raise
        except Exception as error:
            self._lose(str(part), f"{describe_error(error)}: {part.size} bytes")
            return None

    def _unpack(self, part, raw):
        """Return the records of a chunk, whose CRC is checked unless its end is missing."""
        library, chunk = _read_chunk(raw, part.size)
        if len(raw) < part.size:  # found and named by _scan
            return _decompress_begin(library, chunk)
        try:
            return _decompress(chunk)
        except Exception:
            if not _lacks_end(chunk):
                raise
            reason = "its end was not written; later records are lost, read without CRC"
            self._lose(str(part), reason)
            return _decompress_begin(library, chunk)

    def _read_messages(self, part, places):
        """Return the messages of a part; None if there are none."""
        if (content := self._read_content(part)) is None:
            return None
        starts, _, end = _find_records(content)
        heads = _read_heads(content, starts)
        place = places[heads["channel"]]
        is_late = heads["time"] > LAST_TIME
        for count, kind in (
            (len(content) - end, f"bytes are lost from byte {end} of its records on"),
            ((place == UNDECLARED).sum(), "messages are of undeclared channels"),
            ((is_late & (place >= 0)).sum(), "messages have log times that int64 cannot hold"),
        ):
            if count:
                self._lose(str(part), f"{count} {kind}")
        size, time = (heads[name].astype(np.int64) for name in ("size", "time"))
        messages = Messages(np.frombuffer(content, np.uint8), place, starts + 31, size - 22, time)
        rows = (place >= 0) & ~is_late
        return messages.select(rows).sort() if rows.any() else None


def _find_records(content):
    """Return first bytes of messages, (kind, content) of declarations, and the end of records."""
    starts = []
    declarations = []
    at = 0
    stop = len(content)
    while at + 9 <= stop:
        opcode, size = _RECORD.unpack_from(content, at)
        end = at + 9 + size
        if (
            end > stop
            or opcode not in (SCHEMA, CHANNEL, MESSAGE)
            or (opcode == MESSAGE and size < 22)
        ):
            break
        if opcode == MESSAGE and not starts:  # many messages of one size are found together
            count = _count_alike(content, at, end - at)
            starts += range(at, at + count * (end - at), end - at)
            end = at + count * (end - at)
        elif opcode == MESSAGE:
            starts.append(at)
        else:
            declarations.append((Schema if opcode == SCHEMA else Channel, content[at + 9 : end]))
        at = end
    return np.array(starts, np.int64), declarations, at


def _count_alike(content, at, size):
    """Return how many records of the kind and size of the first one follow each other."""
    count = (len(content) - at) // size
    rows = np.frombuffer(content, np.uint8, count * size, at).reshape(count, size)[:, :9]
    is_other = (rows != rows[0]).any(axis=1)
    return int(is_other.argmax()) if is_other.any() else count


def _read_heads(content, starts):
    """Return the heads of the messages that begin at some bytes."""
    return np.ndarray((max(0, len(content) - 30),), "V31", content, 0, (1,))[starts].view(HEAD)


def _read_chunk(raw, size):
    """Return the library of the compression of a chunk, and the chunk."""
    if len(raw) < 9 or _RECORD.unpack_from(raw) != (CHUNK, size - 9):
        raise DamageError("the bytes are not a chunk")
    chunk = Chunk.read(ReadDataStream(BytesIO(raw[9:])))
    name = chunk.compression
    length = chunk.uncompressed_size
    if name not in COMPRESSIONS:
        raise DamageError(f"compression is '{name}'; expected zstd, lz4 or none")
    library = require(COMPRESSIONS[name], REASON)
    sizes = -1, length
    if length > MAX_SIZE or (
        name == "zstd" and library.frame_content_size(chunk.data) not in sizes
    ):
        raise DamageError(f"{length} bytes is not the uncompressed size")
    return library, chunk


def _lacks_end(chunk):
    """Return whether the end of a chunk was not written: zeros follow its last record.

    Compressed data do not end with zeros.
    """
    data = chunk.data
    if not data.endswith(UNWRITTEN):
        return False
    tail = data[_find_records(data)[2] :]
    return bool(chunk.compression) or (len(tail) > 0 and not any(tail))


def _decompress(chunk):
    """Return the records of a whole chunk."""
    stream, count = get_chunk_data_stream(chunk, validate_crc=True)
    if count != chunk.uncompressed_size:
        raise DamageError(f"it has {count} bytes of records; expected {chunk.uncompressed_size}")
    return stream.read(count)


def _decompress_begin(library, chunk):
    """Return the records of a chunk before the first byte that is missing."""
    data = chunk.data
    length = chunk.uncompressed_size
    if data.endswith(UNWRITTEN):
        data = data.rstrip(b"\0")
    if chunk.compression == "zstd":
        return library.ZstdDecompressor().stream_reader(data).read(length)
    if chunk.compression == "lz4":
        return library.LZ4FrameDecompressor().decompress(data, length)
    return data
