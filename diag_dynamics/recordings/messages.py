# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Serialized messages in columns, and what readers of bags report about their files."""

from importlib import import_module
from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import InputError

LAST_TIME = (1 << 63) - 1
"""Latest log time that int64 holds [ns]."""


class Connection(NamedTuple):
    """One topic of one writer; its type is such as ``sensor_msgs/msg/JointState``."""

    topic: str
    type: str
    encoding: str


class Messages(NamedTuple):
    """Messages in log-time order; message k is ``data[at[k] : at[k] + size[k]]``.

    `connection` are indices into the connections of the bag, log times are in ns. `data` is of uint8, all others are of
    int64, shape (n,).
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
    def from_rows(cls, connection, log_time, contents):
        """Return messages of three sequences; `contents` are bytes."""
        size = np.fromiter(map(len, contents), np.int64, len(contents))
        data = np.frombuffer(b"".join(contents), np.uint8)
        at = np.cumsum(size) - size
        return cls(data, np.array(connection, np.int64), at, size, np.array(log_time, np.int64)).sort()

    @classmethod
    def concatenate(cls, pieces):
        """Return the messages of several in log-time order; no copy if there is one."""
        if len(pieces) == 1:
            return pieces[0]
        data, columns, offset = [], [], 0
        for piece in pieces:
            first, last = int(piece.at.min()), int((piece.at + piece.size).max())
            data.append(piece.data[first:last])
            columns.append((piece.connection, piece.at + (offset - first), piece.size, piece.log_time))
            offset += last - first
        return cls(np.concatenate(data), *map(np.concatenate, zip(*columns, strict=True))).sort()


class Unread(NamedTuple):
    """Damage: file, place such as ``byte 1024``, and cause with the amount that is lost."""

    file: str
    where: str
    what: str


class Notes:
    """Damage and oddities of the files of a bag, each once."""

    def __init__(self):
        self.unread, self.findings = [], []

    def add_damage(self, file, where, what):
        """Report data that cannot be read."""
        if (damage := Unread(str(file), where, what)) not in self.unread:
            self.unread.append(damage)

    def add_finding(self, file, what):
        """Report an oddity without loss."""
        if (finding := f"'{file}'{what}") not in self.findings:
            self.findings.append(finding)


class DamageError(Exception):
    """Part of a file cannot be read; the text says why."""


class Stream(NamedTuple):
    """A source of Messages in log-time order, from `start` to `end` [ns], which the iterator `read()` yields."""

    start: int
    end: int
    read: object


def merge_streams(streams):
    """Yield the messages of all streams in log-time order; those of one time are in the order of the streams.

    Only pieces of streams that overlap in time are in memory.
    """
    waiting = sorted(enumerate(streams), key=lambda one: one[1].start, reverse=True)
    pieces, readers, fetched = {}, {}, []
    while waiting or pieces or fetched:
        for place in fetched:
            if (piece := next((one for one in readers[place] if len(one.at)), None)) is not None:
                pieces[place] = piece
        until = min((int(piece.log_time[-1]) for piece in pieces.values()), default=None)
        if waiting and (until is None or waiting[-1][1].start <= until):
            place, stream = waiting.pop()
            readers[place], fetched = iter(stream.read()), [place]
            continue
        ready, fetched = [], []
        for place in sorted(pieces):
            piece = pieces.pop(place)
            count = int(np.searchsorted(piece.log_time, until, "right"))
            if count == len(piece.at):
                ready.append(piece)
                fetched.append(place)
                continue
            pieces[place] = piece.select(slice(count, None))
            if count:
                ready.append(piece.select(slice(count)))
        if ready:
            yield Messages.concatenate(ready)


def normalize_type(name):
    """Return the name of a type as ROS 2 has it; ROS 1 omits ``/msg/``, IDL writes ``a::msg::dds_::B_``."""
    name = name.replace("::", "/")
    if "/dds_/" in name:
        name = name.replace("/dds_/", "/").removesuffix("_")
    package, slash, rest = name.partition("/")
    return f"{package}/msg/{rest}" if slash and "/" not in rest else name


def describe_error(error):
    """Return the text of an error in one line without a full stop; its class if there is none."""
    return " ".join(str(error).split()).rstrip(".")[:200] or type(error).__name__


def require(module):
    """Import a module of the extra `recordings`; an InputError names its package if it is not installed."""
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0].replace("yaml", "pyyaml")
        raise InputError(f"recordings of this kind need the package {package}: pip install {package}.") from error
