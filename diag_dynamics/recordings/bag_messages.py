# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Serialized messages in columns, and what readers of bags report about their files."""

import heapq
from functools import partial
from itertools import islice
from operator import itemgetter
from typing import NamedTuple

import numpy as np

REASON = "reading the recording"  # use of libraries, for the error about one that is missing
ROWS = 2000  # messages that are grouped where a file has no chunks


class Connection(NamedTuple):
    """One topic of one writer."""

    topic: str
    type: str  # such as sensor_msgs/msg/JointState
    encoding: str
    md5: str = ""  # of the definition, in ROS 1


class Messages(NamedTuple):
    """Messages in log-time order [ns], in columns of int64 (n,).

    Message k is ``data[at[k] : at[k] + size[k]]``.
    """

    data: np.ndarray
    connection: np.ndarray
    at: np.ndarray
    size: np.ndarray
    log_time: np.ndarray

    def select(self, rows):
        """Return some of the messages: a slice, a mask or indices."""
        return Messages(self.data, *(column[rows] for column in self[1:]))

    def sort(self):
        """Return the messages in log-time order."""
        if (self.log_time[1:] >= self.log_time[:-1]).all():
            return self
        return self.select(np.argsort(self.log_time, kind="stable"))

    @classmethod
    def from_rows(cls, rows):
        """Return messages of a list of (connection, log time, bytes)."""
        connection, log_time, contents = zip(*rows, strict=True)
        size = np.fromiter(map(len, contents), np.int64, len(contents))
        data = np.frombuffer(b"".join(contents), np.uint8)
        columns = np.array(connection, np.int64), np.cumsum(size) - size, size
        return cls(data, *columns, np.array(log_time, np.int64)).sort()

    @classmethod
    def concatenate(cls, pieces):
        """Return the messages of several in log-time order; no copy if there is one."""
        if len(pieces) == 1:
            return pieces[0]
        data = []
        columns = []
        offset = 0
        for data_of_all, connection, at, size, log_time in pieces:
            first = int(at.min())
            last = int((at + size).max())
            data.append(data_of_all[first:last])
            columns.append((connection, at + (offset - first), size, log_time))
            offset += last - first
        return cls(np.concatenate(data), *map(np.concatenate, zip(*columns, strict=True))).sort()


def merge_parts(files):
    """Yield the messages of several files in log-time order.

    A file yields pairs (start, read) in order.
    """
    waiting = []
    for start, read in heapq.merge(*files, key=itemgetter(0)):
        if waiting and min(int(messages.log_time[0]) for messages in waiting) < start:
            messages = Messages.concatenate(waiting)
            count = int(np.searchsorted(messages.log_time, start))
            yield messages.select(slice(count))
            waiting = [messages.select(slice(count, None))] if count < len(messages.at) else []
        if messages := read():
            waiting.append(messages)
    if waiting:
        yield Messages.concatenate(waiting)


def group_rows(rows):
    """Yield (first log time, last one, function that returns Messages) of groups of rows.

    A row is (connection, log time, bytes).
    """
    while group := list(islice(rows, ROWS)):
        yield group[0][1], group[-1][1], partial(Messages.from_rows, group)


class Unread(NamedTuple):
    """Part of a file that cannot be read."""

    file: str
    where: str  # such as byte 1024
    what: str  # cause and amount that is lost


class DamageError(Exception):
    """Part of a file cannot be read; the text says why."""


def describe_error(error):
    """Return the text of an error in one line without a full stop; its class if there is none."""
    return " ".join(str(error).split()).rstrip(".")[:200] or type(error).__name__
