# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags of ROS 1, read by rosbags chunk by chunk, their messages converted to CDR."""

from collections import defaultdict
from contextlib import contextmanager
from functools import partial
from io import BytesIO
from typing import NamedTuple

import numpy as np

from diag_dynamics.bags.bag import Bag
from diag_dynamics.bags.compression import extra
from diag_dynamics.bags.messages import Connection, Messages, normalize_type
from diag_dynamics.bags.ordered import Source, in_order
from diag_dynamics.bags.ros1_messages import UnknownTypeError, ros1_type


class Ros1Bag(Bag):
    """A bag of ROS 1; see :class:`Bag`.

    Messages are in CDR, their types as ROS 2 has them: headers have no `seq`. A type that cannot be turned leaves its
    messages as they are, of the encoding ``ros1``. A bag that was not closed, or is cut, is read up to its last whole chunk.
    """

    def __init__(self, path, name=None):
        super().__init__(path, name)
        self._library = extra("rosbags.rosbag1.reader")
        self._declared, self._converters, self._chunks = [], [], []
        with self._opened() as reader:
            self._survey(reader)

    @property
    def start(self):
        """Log time [ns] that no message is before; None without messages."""
        return min((chunk.start for chunk in self._chunks), default=None)

    def pieces(self, wanted=None):
        """Hand out messages in the order of their log time.

        Parameters
        ----------
        wanted : iterable of int, optional
            Indices into `connections`; without them all.

        Yields
        ------
        Messages
        """
        chosen = {self._declared[k].id: k for k in self.chosen(wanted)}
        chunks = [chunk for chunk in self._chunks if not chosen.keys().isdisjoint(chunk.entries)]
        with self._opened() as reader:
            reader.connections = self._declared
            reader.chunks = {chunk.at: chunk.place for chunk in chunks}
            sources = [Source(chunk.start, partial(self._messages, reader, chunk, chosen)) for chunk in chunks]
            yield from in_order(sources)

    @contextmanager
    def _opened(self):
        """Give a reader of the library that has the file open, and has not looked at it yet."""
        with self.opened():  # its errors are told
            reader = self._library.Reader(self.path)
        with self.path.open("rb") as reader.bio:
            self._size = reader.bio.seek(0, 2)
            yield reader

    # --- What there is ---

    def _survey(self, reader):
        whole = self._library.Reader(self.path)
        try:
            whole.open()
        except Exception as error:  # whatever the library meets in bytes that it does not check
            self._walk(reader, error)
            return
        entries = defaultdict(lambda: defaultdict(list))
        for key, index in whole.indexes.items():
            for entry in index:
                entries[entry.chunk_pos][key].append(entry)
        self._chunks = [_Chunk(at, whole.chunks[at], of) for at, of in sorted(entries.items())]
        for one in list(whole.connections):
            self._declare(one)
        whole.close()

    def _walk(self, reader, error):
        """Go from record to record, as far as there are any."""
        if self._size == 0:
            self.lose("byte 0", "the file is empty")
            return
        self.find(f": the index is not used: {_said(error)}.")
        at, known, file = 0, {}, reader.bio
        file.seek(0)
        try:
            if not file.readline(64).startswith(b"#ROSBAG V2.0"):
                raise self._library.ReaderError("it does not begin as a bag of ROS 1 does, of version 2.0")
            while (at := file.tell()) < self._size:
                kind = self._library.Header.read(file).get_uint8("op")
                if kind == self._library.RecordType.CHUNK:
                    file.seek(at)
                    place = reader.read_chunk()
                    if place.datapos + place.datasize > self._size:
                        raise self._library.ReaderError("the file ends within a chunk")
                    self._look_into(reader, file, at, place, known)
                    file.seek(place.datapos + place.datasize)
                else:
                    file.seek(self._library.read_uint32(file), 1)
        except Exception as problem:
            self.lose(f"byte {at}", f"{_said(problem)}: {self._size - at} bytes")
        else:
            self.lose(f"byte {self._size}", "the file was not closed: what came here, if anything, is lost")
        for one in known.values():
            self._declare(one)

    def _look_into(self, reader, file, at, place, known):
        """Find the messages of a chunk, and the connections that are declared in it."""
        entries = defaultdict(list)
        try:
            file.seek(place.datapos)
            reader.bio = records = BytesIO(place.decompressor(file.read(place.datasize)))
            size = len(records.getbuffer())
            while (offset := records.tell()) < size:
                header = self._library.Header.read(records)
                kind = header.get_uint8("op")
                if kind == self._library.RecordType.CONNECTION:
                    records.seek(offset)
                    one = reader.read_connection()
                    known.setdefault(one.id, one)
                    continue
                if kind == self._library.RecordType.MSGDATA:
                    entry = self._library.IndexData(header.get_time("time"), at, offset)
                    entries[header.get_uint32("conn")].append(entry)
                records.seek(self._library.read_uint32(records), 1)
        except Exception as error:
            self.lose(f"chunk at byte {at}", f"{_said(error)}: {place.datasize} bytes")
        finally:
            reader.bio = file
        unknown = sum(len(entries.pop(key)) for key in entries.keys() - known.keys())
        if unknown:
            self.lose(f"chunk at byte {at}", f"{unknown} messages are of connections that are declared nowhere")
        if entries:
            self._chunks.append(_Chunk(at, place, {key: sorted(index) for key, index in entries.items()}))

    def _declare(self, one):
        """Take in a connection, and find out how to turn its messages."""
        text, encoding, convert = "", "cdr", None
        try:
            text, convert = ros1_type(one.msgtype, one.msgdef.data, one.digest)
        except UnknownTypeError as error:
            self.find(f": the type of topic '{one.topic}' is not understood: {error}.")
            encoding = "ros1"
        self._declared.append(one)
        self._converters.append(convert)
        self.connections.append(Connection(one.topic, normalize_type(one.msgtype), encoding, text))

    # --- What is in it ---

    def _messages(self, reader, chunk, chosen):
        """Messages of a chunk that are wanted: an iterator of one Messages, or none."""
        rows, failed, expected = [], defaultdict(int), sum(len(chunk.entries.get(key, ())) for key in chosen)
        reader.indexes = {one.id: chunk.entries.get(one.id, []) for one in self._declared}
        read = 0
        try:
            for one, log_time, raw in reader.messages([one for one in self._declared if one.id in chosen]):
                read += 1
                k = chosen[one.id]
                data = self._converted(k, raw)
                if data is None:
                    failed[one.topic] += 1
                else:
                    rows.append((k, len(data), log_time, data))
        except Exception as error:  # whatever the library meets in bytes that it does not check
            self.lose(f"chunk at byte {chunk.at}", f"{_said(error)}: {expected - read} messages")
        for topic, count in failed.items():
            self.lose(f"chunk at byte {chunk.at}", f"{count} messages of '{topic}' are not of its type")
        if rows:
            connection, size, log_time, data = zip(*rows, strict=True)
            connection, size, log_time = (np.array(column, np.int64) for column in (connection, size, log_time))
            data = np.frombuffer(b"".join(data), np.uint8)
            yield Messages(data, connection, np.cumsum(size) - size, size, log_time)

    def _converted(self, k, raw):
        """A message in CDR, None if it is not of its type; as it is, where that is not known."""
        convert = self._converters[k]
        return raw if convert is None else convert(raw)


class _Chunk(NamedTuple):
    at: int
    """First byte."""
    place: tuple
    """Where its records are, and how they are decompressed, as the library has it."""
    entries: dict
    """Where its messages are, by connection, in the order of time."""

    @property
    def start(self):
        """Log time of its first message [ns]."""
        return min(index[0].time for index in self.entries.values())


def _said(error):
    """What an exception says; its kind, if it says nothing."""
    return str(error).rstrip(".") or type(error).__name__
