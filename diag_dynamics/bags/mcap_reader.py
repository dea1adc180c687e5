# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of MCAP, read by chunks: whatever of a file can be read is handed out, and the rest is named."""

import struct
import zlib
from contextlib import suppress
from functools import partial
from typing import NamedTuple

import numpy as np

from diag_dynamics.bags.bag import Bag
from diag_dynamics.bags.compression import MOST, DamagedError, beginning, decompressed, inflated
from diag_dynamics.bags.kernels.records import (
    AT,
    CHANNEL,
    CHANNELS,
    CHUNK,
    CHUNK_HEAD,
    CHUNK_INDEX,
    CONNECTION,
    DATA_END,
    END,
    FOOTER,
    FOUND,
    HEAD,
    HEADER,
    LAST_KIND,
    LOG_TIME,
    MESSAGE,
    MESSAGE_HEAD,
    MESSAGE_INDEX,
    SCHEMA,
    SIZE,
    SKIPPED,
    STOP,
    SUMMARY_OFFSET,
    UNKNOWN,
    find,
    next_record,
)
from diag_dynamics.bags.messages import Connection, Messages, normalize_type
from diag_dynamics.bags.ordered import Source, in_order
from diag_dynamics.bags.ros1_messages import ENCODINGS, UnknownTypeError, convert_messages, ros1_type

MAGIC = b"\x89MCAP0\r\n"

_KINDS = 256
_RUN = 1 << 20  # bytes of messages without a chunk that are taken for one
_SEARCHED = 1 << 22  # bytes that are searched at a time for where records go on
_DECLARATION = 1 << 26  # most bytes of a schema or a channel; longer ones are damage
_COLUMNS = 1 << 16  # messages that are found at a time
_LENGTHS = {FOOTER: 20, SUMMARY_OFFSET: 17, DATA_END: 4}  # of contents that are always as long
_CHUNK_START = HEAD + CHUNK_HEAD + 16  # bytes that say all of a chunk but its records; names of compressions are short


_MISSED = (
    "are of channels that are declared nowhere",
    "have log times that int64 cannot hold",
    "are too short to be any",
)
"""What is wrong with messages that :func:`find` counts."""


class _Part(NamedTuple):
    """Chunk, or messages that are in none."""

    start: int
    """No message has an earlier log time [ns]."""
    at: int
    """First byte."""
    beyond: int
    """First byte that is neither of it nor of its message indexes."""
    channels: frozenset | None
    """Those that it has messages of, None if it does not say."""
    is_chunk: bool = True
    is_cut: bool = False
    """Whether the file ends within it."""
    end: int | None = None
    """No message has a later log time [ns], if it is known."""


class _ChunkStart(NamedTuple):
    """What a chunk says before its records."""

    start: int
    end: int
    size: int
    """Of its records, decompressed [bytes]."""
    crc: int
    compression: str
    at: int
    """First byte of the records, counted from the chunk's first one."""
    stored: int
    """Size of the records as they are [bytes]."""


class McapFile(Bag):
    """A file of MCAP, with or without chunks, summary and indexes, whole or damaged; see :class:`Bag`.

    What a file says of itself is checked: an index that does not agree with the file is not used. Without a summary, those
    topics are listed that have messages.
    """

    def __init__(self, path, name=None):
        super().__init__(path, name)
        self._schemas, self._channels, self._parts, self._converters = {}, {}, [], {}
        self._has_summary = False
        with self.opened() as file:
            self._survey(_File(file))

    @property
    def start(self):
        """Log time [ns] that no message is before, as the file says it; None without messages."""
        return min((part.start for part in self._parts if part.channels != frozenset()), default=None)

    def pieces(self, wanted=None):
        """Hand out messages in the order of their log time, those of the same time as they stand in the file.

        No more is in memory than two chunks, and those that overlap in time.

        Parameters
        ----------
        wanted : iterable of int, optional
            Indices into `connections`; without them all. Chunks that have no messages of these are not read.

        Yields
        ------
        Messages
        """
        of = self._becoming(self.chosen(wanted))
        with self.opened() as opened:
            file = _File(opened)
            parts = [part for part in self._parts if self._may_have(part, of)]
            sources = [Source(part.start, partial(self._messages, file, part, of)) for part in parts]
            yield from in_order(sources, lambda place: self._find_late(parts[place]))

    def starts(self, wanted):
        """See :class:`Bag`; empty without a summary that can be used."""
        of = self._becoming(self.chosen(wanted))
        return sorted(part.start for part in self._parts if self._may_have(part, of)) if self._has_summary else []

    def _may_have(self, part, of):
        """Whether a part may have messages that are wanted."""
        if part.channels is not None and all(of[c] == SKIPPED for c in part.channels):
            return False
        late = self.end is not None and part.start >= self.end
        return not late and (self.begin is None or part.end is None or part.end >= self.begin)

    def _becoming(self, chosen):
        """What becomes of records, see :func:`find`."""
        of = np.full(CHANNELS + _KINDS, SKIPPED)
        of[:CHANNELS] = UNKNOWN
        for channel, k in self._channels.items():
            of[channel] = k if k in chosen else SKIPPED
        return of

    def _find_late(self, part):
        self.find(f", {_where(part)}: it has earlier messages than it says, which come late.")

    # --- What there is ---

    def _survey(self, file):
        """Find chunks, messages without a chunk, and channels."""
        if file.size == 0:
            self.lose("byte 0", "the file is empty")
            return
        if file.read(0, len(MAGIC)) != MAGIC:
            self.lose("byte 0", "the file does not begin as one of MCAP does")
        try:
            known, end = self._summary(file)
        except DamagedError as error:
            self.find(f": the summary is not used: {error}.")
            known, end = {}, None
        self._has_summary = bool(known)
        try:
            self._walk(file, known, end)
        except DamagedError as error:  # of reading: what comes from a damaged disk
            self.lose(f"byte {file.last}", f"{error}: {file.size - file.last} bytes")

    def _summary(self, file):
        """Chunks by their first bytes, and where the data end, which is None if no summary tells.

        Raises
        ------
        DamagedError
            The summary and the file do not agree.
        """
        length = HEAD + 20 + END
        tail = file.read(max(0, file.size - length), length)
        if len(tail) < length or tail[:HEAD] != struct.pack("<BQ", FOOTER, 20) or tail[-END:] != MAGIC:
            return {}, None
        begin, _, crc = struct.unpack_from("<QQI", tail, HEAD)
        end = file.size - length
        if begin == 0:
            return {}, None
        data_end = begin - HEAD - 4
        if not len(MAGIC) <= data_end < end or file.read(data_end, HEAD) != struct.pack("<BQ", DATA_END, 4):
            raise DamagedError(f"byte {begin}, where it is to begin, is not the end of data")
        if crc and crc != zlib.crc32(tail[: HEAD + 16], file.crc(begin, end)):
            raise DamagedError("its CRC is wrong")
        kept, at = {SCHEMA: [], CHANNEL: [], CHUNK_INDEX: []}, begin
        while at < end:
            kind, length = _head(file.read(at, HEAD))
            if kind < 1 or not 0 <= length <= end - at - HEAD:
                raise DamagedError(f"byte {at} begins no record")
            if kind in kept:
                kept[kind].append(file.declaration(at + HEAD, length))
            at += HEAD + length
        chunks = [self._indexed(file, content) for content in kept[CHUNK_INDEX]]
        chunks.sort(key=lambda chunk: chunk.at)
        behind = data_end
        for chunk in reversed(chunks):
            if chunk.beyond > behind:
                raise DamagedError(f"the chunk at byte {chunk.at} does not end before byte {behind}")
            behind = chunk.at
        schemas, channels = dict(map(_schema, kept[SCHEMA])), [_channel(content) for content in kept[CHANNEL]]
        if all(schema in schemas for _, schema, *_ in channels if schema):  # else chunks have them all
            for kind in (SCHEMA, CHANNEL):
                for content in kept[kind]:
                    self._declare(kind, content, f"byte {begin}")
        return {part.at: part for part in chunks}, data_end

    def _indexed(self, file, content):
        """Chunk that a record of the summary tells of."""
        fields = _Fields(content)
        start, end, at, length, told = *(fields.number(8) for _ in range(4)), fields.bytes()
        chunk = _chunk_start(file.read(at, _CHUNK_START))
        if chunk is None or chunk.at + chunk.stored != length or start != chunk.start:
            raise DamagedError(f"the chunk that it tells of is not at byte {at}")
        channels = frozenset(channel for channel, _ in struct.iter_unpack("<HQ", told[: len(told) // 10 * 10]))
        return _Part(start, at, at + length + fields.number(8), channels or None, end=end)

    def _walk(self, file, known, end):
        """Go from record to record; over a chunk that is known, and what is known to belong to it, at a step."""
        at, stop, closed, strange = len(MAGIC), file.size if end is None else end, end is not None, []
        while at < stop:
            if at in known:
                self._keep(file, known[at])
                at = known[at].beyond
                continue
            kind, beyond, begin = _record(file, at, stop)
            if kind == 0:
                at = self._resume(file, at, stop)
                closed = closed or at == stop  # what was there is told of
                continue
            if kind == CHUNK:
                start, is_cut = _chunk_start(begin), beyond > stop
                channels, _, beyond = (None, 0, stop) if is_cut else _indexes(file, beyond, stop)
                self._keep(file, _Part(start.start, at, beyond, channels, is_cut=is_cut, end=start.end))
                closed = closed or is_cut
            elif kind == MESSAGE:
                beyond = self._run(file, at, stop)
            elif kind in (SCHEMA, CHANNEL):
                self._declare(kind, file.declaration(at + HEAD, beyond - at - HEAD), f"byte {at}")
            elif kind == FOOTER and beyond + END == stop and file.read(beyond, END) == MAGIC:
                closed, beyond = True, stop
            elif kind > LAST_KIND:
                strange.append((at, beyond - at))
            at = beyond
        if strange:
            size = sum(size for _, size in strange)
            what = f"records of kinds that the format does not have, the first one here: {len(strange)}, {size} bytes"
            self.lose(f"byte {strange[0][0]}", what)
        if not closed:
            self.lose(f"byte {stop}", "the file has no end: what came here, if anything, is lost")

    def _resume(self, file, at, stop):
        """Where records go on after a place where there is none; tells of what is lost."""
        begin = at + 1
        while begin + HEAD <= stop:
            data = np.frombuffer(file.read(begin, _SEARCHED), np.uint8)
            found = next_record(data, 0, stop - begin)
            if found < 0:
                begin += max(1, len(data) - HEAD + 1)
            elif _goes_on(file, begin + found, stop):
                self.lose(f"byte {at}", f"no record begins here: {begin + found - at} bytes")
                return begin + found
            else:
                begin += found + 1
        self.lose(f"byte {at}", f"no whole record begins here, or anywhere behind: {stop - at} bytes")
        return stop

    def _run(self, file, at, stop):
        """Keep messages that are in no chunk; returns what is behind them."""
        of = np.full(CHANNELS + _KINDS, STOP)
        of[:CHANNELS] = 0
        size = max(_RUN, HEAD + _head(file.read(at, HEAD))[1])  # of a message that is longer, all
        data = np.frombuffer(file.read(at, min(size, stop - at)), np.uint8)
        found = np.empty((FOUND, _COLUMNS), np.int64)
        end, n, *_ = find(data, 0, of, found)
        if n:
            self._parts.append(_Part(int(found[LOG_TIME, :n].min()), at, at + end, None, is_chunk=False))
        return at + end

    def _keep(self, file, chunk):
        """Keep a chunk, and the channels that are declared in it, if they are not known yet."""
        if chunk.channels is None or not all(channel in self._channels for channel in chunk.channels):
            self._look_into(file, chunk)
        self._parts.append(chunk)

    def _look_into(self, file, chunk):
        of = np.full(CHANNELS + _KINDS, SKIPPED)
        of[CHANNELS + SCHEMA], of[CHANNELS + CHANNEL] = SCHEMA, CHANNEL
        for data, found in self._found(file, chunk, of, []):
            for kind, at, size, _ in found.T:
                self._declare(kind, data[at : at + size].tobytes(), _where(chunk))

    def _declare(self, kind, content, where):
        """Take in a schema or a channel."""
        try:
            if kind == SCHEMA:
                key, schema = _schema(content)
                if self._schemas.setdefault(key, schema) != schema:
                    self.find(f", {where}: schema {key} is declared again, otherwise; the first one counts.")
                return
            key, schema, topic, encoding, metadata = _channel(content)
        except DamagedError as error:
            self.lose(where, f"a {'schema' if kind == SCHEMA else 'channel'} is not readable: {error}")
            return
        name, form, definition = self._schemas.get(schema, ("", "", ""))
        if schema and schema not in self._schemas:
            self.find(f", {where}: topic '{topic}' is of schema {schema}, which is not declared.")
        name, convert = normalize_type(name), None
        if encoding in ENCODINGS:
            encoding, form, definition, convert = self._ros1(topic, name, definition, metadata)
        connection = Connection(topic, name, encoding, definition if form == "ros2msg" else "")
        if key not in self._channels:
            k = self._channels[key] = len(self.connections)
            self.connections.append(connection)
            if convert:
                self._converters[k] = convert
        elif self.connections[self._channels[key]] != connection:
            self.find(f", {where}: channel {key} is declared again, otherwise; the first one counts.")

    def _ros1(self, topic, name, definition, metadata):
        """Encoding, form and definition of a channel's messages once they are converted, and what converts them."""
        try:
            return "cdr", "ros2msg", *ros1_type(name, definition, metadata.get("md5sum", ""))
        except UnknownTypeError as error:
            self.find(f": the type of topic '{topic}' is not understood: {error}.")
            return "ros1", "", "", None

    # --- What is in it ---

    def _content(self, file, part):
        """Bytes of a part's records; what a cut chunk still has.

        Raises
        ------
        DamagedError
            They cannot be had.
        """
        if not part.is_chunk:
            return file.read(part.at, part.beyond - part.at)
        start = _chunk_start(file.read(part.at, _CHUNK_START))
        if start is None:
            raise DamagedError("the file has changed")
        stored = file.read(part.at + start.at, start.stored)
        if part.is_cut:
            content, _ = beginning(stored, start.compression, min(start.size, MOST))
            return content
        if len(stored) < start.stored:
            raise DamagedError("the file has become shorter")
        content = decompressed(stored, start.compression, start.size)
        if start.crc and start.crc != zlib.crc32(content):
            raise DamagedError("its CRC is wrong")
        return content

    def _found(self, file, part, of, missed):
        """Bytes of a part, and columns of what :func:`find` finds there, some at a time; `missed` receives what it counts."""
        try:
            content = self._content(file, part)
        except DamagedError as error:
            self.lose(_where(part), f"{error}: {self._size_of(file, part)}")
            return
        data, at = np.frombuffer(content, np.uint8), 0
        while at < len(data):
            found = np.empty((FOUND, min(_COLUMNS, len(data) // HEAD + 1)), np.int64)
            at, n, *more = find(data, at, of, found)
            missed.append(more)
            if n:
                yield data, found[:, :n]
            if n == found.shape[1] or at == len(data):
                continue
            if part.is_cut:
                break
            again = next_record(data, at + 1, len(data))
            end = len(data) if again < 0 else again
            self.lose(f"{_where(part)}, byte {at} of its records", f"no record begins here: {end - at} bytes")
            at = end
        if part.is_cut:
            size = _chunk_start(file.read(part.at, _CHUNK_START)).size
            self.lose(_where(part), f"the file ends within it: {size - at} of {size} bytes of its records")

    def _messages(self, file, part, of):
        """Messages of a part that are wanted: an iterator of none, one, or more Messages."""
        missed, columns, data = [], [], None
        for data, found in self._found(file, part, of, missed):  # noqa: B007 (data are the same each time)
            columns.append(found.copy())
        for count, what in zip(np.sum(missed, axis=0) if missed else (), _MISSED, strict=False):
            if count:
                self.lose(_where(part), f"{count} messages {what}")
        if not columns:
            return
        found = columns[0] if len(columns) == 1 else np.concatenate(columns, axis=1)
        earliest, latest = int(found[LOG_TIME].min()), int(found[LOG_TIME].max())
        if earliest < part.start or (part.end is not None and latest > part.end):
            self.misplaced = True
        if (np.diff(found[LOG_TIME]) < 0).any():
            found = np.take(found, np.argsort(found[LOG_TIME], kind="stable"), axis=1)
        messages = inflated(Messages(data, found[CONNECTION], found[AT], found[SIZE], found[LOG_TIME]))
        if self._converters:
            messages, failed = convert_messages(messages, self._converters)
            for k, count in failed.items():
                self.lose(_where(part), f"{count} messages of '{self.connections[k].topic}' are not of its type")
        yield messages

    def _size_of(self, file, chunk):
        """How much is lost with a chunk, in words."""
        start = _chunk_start(file.read(chunk.at, _CHUNK_START))
        _, messages, _ = _indexes(file, chunk.at + start.at + start.stored, file.size)
        return f"{messages} messages" if messages else f"{start.size} bytes of records"


class _File:
    """An open file, read at places."""

    def __init__(self, file):
        self._file, self.last = file, 0
        self.size = file.seek(0, 2)

    def read(self, at, size):
        """Up to `size` bytes from a place on; less at the end of the file.

        Raises
        ------
        DamagedError
            The disk does not give them.
        """
        self.last, parts = at, []
        try:
            self._file.seek(at)
            size = max(0, min(size, self.size - at))
            while size > 0:
                part = self._file.read(size)
                if not part:
                    break
                parts.append(part)
                size -= len(part)
        except OSError as error:
            raise DamagedError(f"it cannot be read ({error.strerror})") from error
        return parts[0] if len(parts) == 1 else b"".join(parts)

    def declaration(self, at, size):
        """Content of a schema, a channel, or an entry of the summary."""
        if size > _DECLARATION:
            raise DamagedError(f"byte {at} is to begin {size} bytes of a declaration")
        return self.read(at, size)

    def crc(self, begin, end):
        """CRC of bytes `begin` to `end`."""
        crc = 0
        while begin < end:
            data = self.read(begin, min(_SEARCHED, end - begin))
            if not data:
                break
            crc, begin = zlib.crc32(data, crc), begin + len(data)
        return crc


class _Fields:
    """Content of a record, field by field."""

    def __init__(self, content):
        self._content, self._at = content, 0

    def _take(self, size):
        end = self._at + size
        if end > len(self._content):
            raise DamagedError(f"it has {len(self._content)} bytes, and needs {end}")
        taken, self._at = self._content[self._at : end], end
        return taken

    def number(self, size):
        """A number of so many bytes."""
        return int.from_bytes(self._take(size), "little")

    def bytes(self):
        """Bytes behind their number."""
        return self._take(self.number(4))

    def text(self):
        """A text behind its length; what is no UTF-8 is shown as it is."""
        return self.bytes().decode("utf-8", "backslashreplace")


def _schema(content):
    """Key of a schema; its name, its encoding and its definition."""
    fields = _Fields(content)
    return fields.number(2), (fields.text(), fields.text(), fields.text())


def _channel(content):
    """Key of a channel, that of its schema, its topic, the encoding of its messages, and its metadata."""
    fields = _Fields(content)
    return fields.number(2), fields.number(2), fields.text(), fields.text(), _metadata(fields)


def _metadata(fields):
    """Texts by key; those that can be read."""
    found = {}
    with suppress(DamagedError):
        rest = _Fields(fields.bytes())
        while True:
            key = rest.text()
            found[key] = rest.text()
    return found


def _head(start):
    """Kind and length of a record by its first bytes; 0 and -1 if there are too few of these."""
    return struct.unpack_from("<BQ", start) if len(start) >= HEAD else (0, -1)


def _chunk_start(start):
    """What a chunk says by its first bytes; None if it is none, whose two lengths do not agree."""
    if len(start) < HEAD + CHUNK_HEAD or start[0] != CHUNK:
        return None
    length, first, last, size, crc, name = struct.unpack_from("<QQQQII", start, 1)
    at = HEAD + 32 + name
    if name > 16 or len(start) < at + 8:
        return None
    (stored,) = struct.unpack_from("<Q", start, at)
    if stored != length - CHUNK_HEAD - name or max(first, last, size) >= 1 << 63:
        return None
    return _ChunkStart(
        first, last, size, crc, start[HEAD + 32 : at].decode("utf-8", "backslashreplace"), at + 8, stored
    )


def _record(file, at, stop):
    """Kind of the record at a place, 0 if there is none; what is behind it, and its first bytes. Only chunks may be cut."""
    begin = file.read(at, min(_CHUNK_START, stop - at))
    kind, length = _head(begin)
    beyond = at + HEAD + length
    good = 0 <= length <= stop - at - HEAD
    if kind == CHUNK:
        good = _chunk_start(begin) is not None
    elif kind == MESSAGE:
        good = good and length >= MESSAGE_HEAD
    elif kind == MESSAGE_INDEX:
        good = good and length >= 6 and length - 6 == struct.unpack_from("<I", begin, HEAD + 2)[0]
    elif kind in (SCHEMA, CHANNEL):
        good = good and length <= _DECLARATION
    elif kind in _LENGTHS:
        good = good and length == _LENGTHS[kind]
    elif kind == HEADER:
        good = good and at == len(MAGIC)
    return (kind if good else 0), beyond, begin


def _indexes(file, at, stop):
    """Channels of the message indexes from a place on, None if these may not be all; number of messages; what is behind."""
    channels, messages = set(), 0
    while True:
        kind, beyond, begin = _record(file, at, stop)
        if kind != MESSAGE_INDEX:
            break
        channel, size = struct.unpack_from("<HI", begin, HEAD)
        channels.add(channel)
        messages += size // 16
        at = beyond
    return (frozenset(channels) if channels and kind else None), messages, at


def _goes_on(file, at, stop):
    """Whether three records follow one another from a place on, or fewer to the end."""
    for _ in range(3):
        kind, at, _ = _record(file, at, stop)
        if kind == 0 or at > stop:
            return False
        if at == stop or (kind == FOOTER and at + END == stop):
            return True
    return True


def _where(part):
    return f"{'chunk' if part.is_chunk else 'messages'} at byte {part.at}"
