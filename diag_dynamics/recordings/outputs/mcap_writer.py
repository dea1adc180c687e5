# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of MCAP, written by columns: many messages of the same size at once, in chunks, with all indexes and CRCs.

A file stands by itself, as `ros2 bag play`, `ros2 bag info` and Foxglove open it: its summary says all that the metadata.yaml
of a folder would, so none is written.
"""

import struct
import zlib
from collections import Counter
from contextlib import suppress

import numpy as np

import diag_dynamics
from diag_dynamics.bags.compression import extra
from diag_dynamics.bags.kernels.records import (
    CHANNEL,
    CHANNELS,
    CHUNK,
    CHUNK_INDEX,
    DATA_END,
    FOOTER,
    HEAD,
    HEADER,
    MESSAGE_HEAD,
    MESSAGE_INDEX,
    SCHEMA,
    STATISTICS,
    SUMMARY_OFFSET,
    lay,
)
from diag_dynamics.bags.mcap_reader import MAGIC
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.atomic_file import AtomicFile

_ENTRY = np.dtype([("log_time", "<u8"), ("at", "<u8")])  # of a message index


class McapWriter:
    """Writer of a file of MCAP, which has another name until it is whole, and is gone if it never is.

    Parameters
    ----------
    path : path
        What is there is replaced when the file is closed.
    compression : {"zstd", "lz4", ""}
    level : int
        Of the compression.
    chunk_size : int
        So many bytes of records are in a chunk, before compression, or one message that has more.

    Raises
    ------
    InputError
        The compression is not known or not installed, or the file cannot be written: then, or later.
    """

    def __init__(self, path, compression="zstd", level=1, chunk_size=1 << 20):
        self._compression, self._compress = compression, _compressor(compression, level)
        self._part = AtomicFile(path)
        self.path = self._part.path
        self._chunk_size, self._size, self._crc = chunk_size, 0, 0
        self._schemas, self._channels, self._counts = {}, [], Counter()
        self._declarations = {SCHEMA: [], CHANNEL: []}
        self._chunk_indexes, self._span = [], _Span()
        self._begin_chunk()
        try:
            self._file = open(self._part.name, "wb")  # noqa: SIM115 (it is open as long as this object)
        except OSError as error:
            raise self._failure(error) from error
        version = f"diag_dynamics {diag_dynamics.__version__}"
        self._put(MAGIC + _record(HEADER, _text("ros2") + _text(version)))

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if kind is None:
            self.close()
        else:
            self.abort()

    def channel(self, topic, name, definition, encoding="cdr", offered_qos_profiles=""):
        """Declare a topic.

        Parameters
        ----------
        topic, name : str
            Its name, and that of its type, such as ``sensor_msgs/msg/JointState``.
        definition : str
            Of the type, as ``ros2msg`` has them: types that it is made of behind lines of ``=``.
        encoding : str
            Of its messages.
        offered_qos_profiles : str
            As rosbag2 writes them. Releases write them in two ways, and some read only one; nothing is read by all, and has
            the topic be played with rosbag2's own profile: reliable, and volatile.

        Returns
        -------
        int
            What messages are written by.

        Raises
        ------
        InputError
            There are as many as a file can have.
        """
        if len(self._channels) == CHANNELS - 1:
            raise InputError(f"'{self.path}' has {len(self._channels)} channels, and can have no more.")
        schema = self._schemas.get((name, definition))
        if schema is None:
            schema = self._schemas[name, definition] = len(self._schemas) + 1
            content = struct.pack("<H", schema) + _text(name) + _text("ros2msg") + _text(definition)
            self._declare(SCHEMA, content)
        self._channels.append(topic)
        metadata = _text("offered_qos_profiles") + _text(offered_qos_profiles)
        content = struct.pack("<HH", len(self._channels), schema) + _text(topic) + _text(encoding) + _text(metadata)
        self._declare(CHANNEL, content)
        return len(self._channels)

    def write_rows(self, channel, rows, log_time):
        """Write messages of one channel; see :meth:`write`."""
        self.write([(channel, rows, log_time)])

    def write(self, pieces):
        """Write messages in the order of their log time.

        Those of one call are interleaved. Calls should come in this order, too: indexes put right what does not, but a player
        that goes by the order in the file does not look at them.

        Parameters
        ----------
        pieces : sequence of (int, ndarray, ndarray)
            Of each channel its number, one message a row of uint8, (n, size), and their log times [ns], int64, (n,).

        Raises
        ------
        InputError
            A channel is not declared, or arrays are not what they should be.
        """
        pieces = [self._checked(*piece) for piece in pieces]
        pieces = [piece for piece in pieces if len(piece[1])]
        if not pieces:
            return
        data = _joined([rows.reshape(-1) for _, rows, _ in pieces])
        lengths = [len(rows) for _, rows, _ in pieces]
        channel = np.repeat(np.array([one for one, _, _ in pieces]), lengths)
        size = np.repeat(np.array([rows.shape[1] for _, rows, _ in pieces]), lengths)
        log_time = _joined([times for _, _, times in pieces])
        begin = np.cumsum(size) - size
        if (np.diff(log_time) < 0).any():
            order = np.argsort(log_time, kind="stable")
            begin, size, channel, log_time = (column[order] for column in (begin, size, channel, log_time))
        self._lay(data, begin, size, channel, self._numbered(channel), log_time)

    def close(self):
        """Write what is left, and give the file its name."""
        try:
            self._end_chunk()
            self._put(_record(DATA_END, struct.pack("<I", self._crc)))
            self._put_summary()
            self._file.close()
            self._part.commit()
        except OSError as error:
            self.abort()
            raise self._failure(error) from error
        except BaseException:
            self.abort()
            raise

    def abort(self):
        """Remove what has been written."""
        with suppress(OSError):  # what was still to be written is not wanted
            self._file.close()
        self._part.discard()

    def _checked(self, channel, rows, log_time):
        if not 1 <= channel <= len(self._channels):
            raise InputError(f"'{self.path}' has no channel {channel}.")
        topic = self._channels[channel - 1]
        rows, log_time = np.ascontiguousarray(rows), np.ascontiguousarray(log_time)
        if rows.dtype != np.uint8 or rows.ndim != 2:
            raise InputError(f"messages of '{topic}' are {rows.dtype} of shape {rows.shape}, not rows of uint8.")
        if log_time.dtype != np.int64 or log_time.shape != rows.shape[:1]:
            what = f"{log_time.dtype} of shape {log_time.shape}"
            raise InputError(f"log times of '{topic}' are {what}, not int64 of shape {rows.shape[:1]}.")
        if (log_time < 0).any():
            k = int(np.argmax(log_time < 0))
            raise InputError(f"the log time of message {k} of '{topic}' is {log_time[k]} ns, which MCAP cannot hold.")
        return channel, rows, log_time

    def _numbered(self, channel):
        """Sequence numbers of the next messages, whose channels these are: they count each channel's messages."""
        sequence = np.empty(len(channel), np.int64)
        for one in np.unique(channel).tolist():
            own = np.flatnonzero(channel == one)
            sequence[own] = self._counts[one] + np.arange(len(own))
            self._counts[one] += len(own)
        return sequence

    # --- Chunks ---

    def _begin_chunk(self):
        self._records, self._length, self._entries, self._chunk_span = [], 0, [], _Span()

    def _declare(self, kind, content):
        """Put a schema or a channel into the chunk, and keep it for the summary."""
        record = _record(kind, content)
        self._declarations[kind].append(record)
        self._records.append(record)
        self._length += len(record)

    def _lay(self, data, begin, size, channel, sequence, log_time):
        """Lay records into chunks, of which each ends with the message that makes it large enough."""
        ends = np.cumsum(size + (HEAD + MESSAGE_HEAD))
        first = 0
        while first < len(ends):
            before = ends[first - 1] if first else 0
            room = max(self._chunk_size - self._length, 1)
            last = min(int(np.searchsorted(ends, before + room)) + 1, len(ends))
            part = slice(first, last)
            at = ends[part] - size[part] - (HEAD + MESSAGE_HEAD) - before
            records = np.empty(ends[last - 1] - before, np.uint8)
            lay(data, *(column[part] for column in (begin, size, channel, sequence, log_time)), at, records)
            self._entries.append((channel[part], log_time[part], at + self._length))
            self._chunk_span.include(log_time[first], log_time[last - 1])
            self._records.append(records)
            self._length += len(records)
            if self._length >= self._chunk_size:
                self._end_chunk()
            first = last

    def _end_chunk(self):
        """Write the chunk, its message indexes, and keep an entry for the summary."""
        if not self._length:
            return
        content = b"".join(self._records)
        stored, span = self._compress(content), self._chunk_span
        head = struct.pack("<QQQI", span.first, span.last, len(content), zlib.crc32(content)) + _text(self._compression)
        begin = self._size
        self._put(struct.pack("<BQ", CHUNK, len(head) + 8 + len(stored)) + head + struct.pack("<Q", len(stored)))
        self._put(stored)
        beyond, places = self._size, b""
        for channel, index in self._message_indexes():
            places += struct.pack("<HQ", channel, self._size)
            self._put(_record(MESSAGE_INDEX, struct.pack("<H", channel) + _text(index)))
        self._chunk_indexes.append(
            _record(
                CHUNK_INDEX,
                struct.pack("<QQQQ", span.first, span.last, begin, beyond - begin)
                + _text(places)
                + struct.pack("<Q", self._size - beyond)
                + _text(self._compression)
                + struct.pack("<QQ", len(stored), len(content)),
            )
        )
        self._span.include(span.first, span.last, span.any)
        self._begin_chunk()

    def _message_indexes(self):
        """Channels that have messages in the chunk, each with its index."""
        if not self._entries:
            return
        channel, log_time, at = map(_joined, zip(*self._entries, strict=True))
        entries = np.empty(len(at), _ENTRY)
        entries["log_time"], entries["at"] = log_time, at
        for one in np.unique(channel):
            yield int(one), entries[channel == one].tobytes()

    # --- Summary ---

    def _put_summary(self):
        begin, messages = self._size, sum(self._counts.values())
        counts = b"".join(struct.pack("<HQ", *one) for one in sorted(self._counts.items()) if one[1])
        declared = (len(self._schemas), len(self._channels), 0, 0, len(self._chunk_indexes))
        statistics = struct.pack("<QHIIIIQQ", messages, *declared, self._span.first, self._span.last) + _text(counts)
        groups = [
            (SCHEMA, b"".join(self._declarations[SCHEMA])),
            (CHANNEL, b"".join(self._declarations[CHANNEL])),
            (STATISTICS, _record(STATISTICS, statistics)),
            (CHUNK_INDEX, b"".join(self._chunk_indexes)),
        ]
        summary, offsets = b"", b""
        for kind, group in groups:
            if group:
                offsets += _record(SUMMARY_OFFSET, struct.pack("<BQQ", kind, begin + len(summary), len(group)))
            summary += group
        footer = struct.pack("<BQQQ", FOOTER, 20, begin, begin + len(summary))
        summary += offsets + footer
        self._put(summary + struct.pack("<I", zlib.crc32(summary)) + MAGIC)

    def _put(self, data):
        try:
            self._file.write(data)
        except OSError as error:
            raise self._failure(error) from error
        self._size += len(data)
        self._crc = zlib.crc32(data, self._crc)

    def _failure(self, error):
        return InputError(f"'{self.path}' cannot be written: {error.strerror}.")


class _Span:
    """Earliest and latest log time; zero without any, as the format has it."""

    def __init__(self):
        self.first, self.last, self.any = 0, 0, False

    def include(self, first, last, some=True):
        """Extend it by `some` times."""
        if some:
            self.first = min(self.first, int(first)) if self.any else int(first)
            self.last, self.any = max(self.last, int(last)), True


def _compressor(compression, level):
    if compression == "zstd":
        return extra("zstandard").ZstdCompressor(level=level).compress
    if compression == "lz4":
        frame = extra("lz4.frame")
        return lambda content: frame.compress(content, compression_level=level)
    if compression == "":
        return lambda content: content
    raise InputError(f"compression is '{compression}', expected 'zstd', 'lz4' or '' for none.")


def _joined(arrays):
    """One array of several; the same, not a copy, if there is one."""
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)


def _record(kind, content):
    return struct.pack("<BQ", kind, len(content)) + content


def _text(text):
    """A text, or bytes, behind the number of its bytes."""
    content = text.encode() if isinstance(text, str) else text
    return struct.pack("<I", len(content)) + content
