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
from diag_dynamics.optional import require
from diag_dynamics.recordings.mcap_file import HEAD, MAGIC

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
        self._compress = require("zstandard", "writing MCAP").ZstdCompressor(level=LEVEL).compress
        self._file = self._call(open, file.name, "wb")
        self._indexes, self._counts, self._records = [], [0] * len(topics), []
        for k, (topic, kind, definition) in enumerate(topics, 1):
            # Releases of rosbag2 write QoS profiles in two ways; all read none.
            metadata = {"offered_qos_profiles": ""}
            self._records += [Schema(k, definition.encode(), "ros2msg", kind), Channel(k, topic, "cdr", metadata, k)]
        self._write(MAGIC)
        self._put(Header("ros2", f"diag_dynamics {diag_dynamics.__version__}"), *self._records)

    def write_chunk(self, k, numbers, times, rows):
        """Write a chunk of messages of topic k: their numbers, log times [ns] and contents, rows of bytes."""
        head = np.zeros(len(rows), HEAD)
        head["opcode"], head["size"], head["channel"] = Opcode.MESSAGE, rows.shape[1] + 22, k + 1
        head["number"], head["time"], head["sent"] = numbers, times, times
        messages = np.hstack([head.view(np.uint8).reshape(len(rows), -1), rows])
        index = np.column_stack([times, messages.shape[1] * np.arange(len(rows))]).astype("<u8")
        index = index[np.argsort(times, kind="stable")].tobytes()
        data, first, last = self._compress(messages), int(times.min()), int(times.max())
        crc, begin = zlib.crc32(messages), self._size
        self._put(Chunk("zstd", data, last, first, crc, messages.nbytes))
        end, builder = self._size, RecordBuilder()
        builder.start_record(Opcode.MESSAGE_INDEX)
        builder.write2(k + 1)
        builder.write4(len(index))
        builder.write(index)
        builder.finish_record()
        self._write(builder.end())
        sizes = len(data), last, self._size - end
        index = ChunkIndex(end - begin, begin, "zstd", *sizes, {k + 1: end}, first, messages.nbytes)
        self._indexes.append(index)
        self._counts[k] += len(rows)

    def finish(self):
        """Write the summary, and close the file."""
        self._put(DataEnd(0))
        begin, count = self._size, len(self._counts)
        first = min((one.message_start_time for one in self._indexes), default=0)
        last = max((one.message_end_time for one in self._indexes), default=0)
        counts = {k: n for k, n in enumerate(self._counts, 1) if n}
        span = len(self._indexes), sum(counts.values()), last, first
        statistics = Statistics(0, count, counts, *span, 0, count)
        builder = RecordBuilder()
        for record in (*self._records, statistics, *self._indexes, Footer(begin, 0, 0)):
            record.write(builder)
        summary = builder.end()[:-4]
        self._write(summary + zlib.crc32(summary).to_bytes(4, "little") + MAGIC)
        self._call(self._file.close)

    def abort(self):
        """Close the file."""
        with suppress(OSError):
            self._file.close()

    def _put(self, *records):
        builder = RecordBuilder()
        for record in records:
            record.write(builder)
        self._write(builder.end())

    def _write(self, data):
        self._call(self._file.write, data)
        self._size += len(data)

    def _call(self, action, *arguments):
        try:
            return action(*arguments)
        except OSError as error:
            raise InputError(f"'{self._path}' cannot be written: {error.strerror}.") from error
