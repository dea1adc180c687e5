# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""MCAP files from columns: chunks by NumPy, because `mcap.writer` takes 5 µs a message; other records by the library."""

import zlib
from contextlib import suppress

import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, DataEnd, Footer, Header, Schema, Statistics

import diag_dynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.mcap_file import HEAD, MAGIC
from diag_dynamics.recordings.messages import require

LEVEL = 1
"""Of the compression by zstd."""


class McapWriter:
    """Writes an MCAP file.

    Parameters
    ----------
    file : AtomicFile
    topics : sequence of (topic, type, definition)
    """

    def __init__(self, file, topics):
        self._path, self._size = file.path, 0
        self._compress = require("zstandard").ZstdCompressor(level=LEVEL).compress
        self._file = self._call(open, file.name, "wb")
        self._indexes, self._counts, self._records = [], np.zeros(len(topics), int), []
        for k, (topic, kind, definition) in enumerate(topics, 1):
            # Releases of rosbag2 write QoS profiles in two ways; all read none.
            metadata = {"offered_qos_profiles": ""}
            self._records += [Schema(k, definition.encode(), "ros2msg", kind), Channel(k, topic, "cdr", metadata, k)]
        self._put(MAGIC)
        self._put_records(Header("ros2", f"diag_dynamics {diag_dynamics.__version__}"), *self._records)

    def write_chunk(self, blocks):
        """Write a chunk of (index of the topic, numbers of messages, log times, rows of bytes)."""
        parts, entries, at = [], {}, 0
        for k, numbers, times, rows in blocks:
            head = np.zeros(len(rows), HEAD)
            head["opcode"], head["size"], head["channel"] = Opcode.MESSAGE, rows.shape[1] + 22, k + 1
            head["number"], head["time"], head["sent"] = numbers, times, times
            self._counts[k] += len(rows)
            parts.append(np.hstack([head.view(np.uint8).reshape(len(rows), -1), rows]))
            offsets = at + parts[-1].shape[1] * np.arange(len(rows))
            entries.setdefault(k + 1, []).append(np.column_stack([times, offsets]))
            at += parts[-1].size
        content = b"".join(parts)
        data, times = self._compress(content), np.concatenate([times for _, _, times, _ in blocks])
        first, last = int(times.min()), int(times.max())
        begin = self._size
        self._put_records(Chunk("zstd", data, last, first, zlib.crc32(content), len(content)))
        index = ChunkIndex(self._size - begin, begin, "zstd", len(data), last, 0, {}, first, len(content))
        for channel, tables in entries.items():
            index.message_index_offsets[channel] = self._size
            builder, table = RecordBuilder(), np.concatenate(tables).astype("<u8")
            builder.start_record(Opcode.MESSAGE_INDEX)
            builder.write2(channel)
            builder.write4(table.nbytes)
            builder.write(table.tobytes())
            builder.finish_record()
            self._put(builder.end())
        index.message_index_length = self._size - begin - index.chunk_length
        self._indexes.append(index)

    def finish(self):
        """Write the summary, and close the file."""
        self._put_records(DataEnd(0))
        begin, count = self._size, len(self._counts)
        first = min((one.message_start_time for one in self._indexes), default=0)
        last = max((one.message_end_time for one in self._indexes), default=0)
        counts = {k: n for k, n in enumerate(self._counts.tolist(), 1) if n}
        statistics = Statistics(0, count, counts, len(self._indexes), sum(counts.values()), last, first, 0, count)
        records = [*self._records[::2], *self._records[1::2], statistics, *self._indexes]
        builder = RecordBuilder()
        for record in records:
            record.write(builder)
        Footer(begin, 0, 0).write(builder)
        summary = builder.end()[:-4]
        self._put(summary + zlib.crc32(summary).to_bytes(4, "little") + MAGIC)
        self._call(self._file.close)

    def abort(self):
        """Close the file."""
        with suppress(OSError):
            self._file.close()

    def _put_records(self, *records):
        builder = RecordBuilder()
        for record in records:
            record.write(builder)
        self._put(builder.end())

    def _put(self, data):
        self._call(self._file.write, data)
        self._size += len(data)

    def _call(self, action, *arguments):
        try:
            return action(*arguments)
        except OSError as error:
            raise InputError(f"'{self._path}' cannot be written: {error.strerror}.") from error
