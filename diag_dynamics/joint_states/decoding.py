# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Serialized joint states as columns.

Messages of one list of names and lengths are read by the places of their numbers.
"""

import struct
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

MAX_LAYOUTS, MAX_BYTES = 64, 1 << 20
"""Lists of names and lengths about which entries are kept, and the length of their messages
together [bytes]. An entry takes about ten times the length of its message."""

FIELDS = "position", "velocity", "effort"


class JointStates(NamedTuple):
    """Joint states with one list of names, in columns."""

    rows: np.ndarray
    """Place of each message among all of a batch: int64, shape (k,)."""
    names: tuple
    """Names of the joints (n)."""
    sec: np.ndarray
    """Seconds and nanoseconds of header.stamp: int64, shape (k,)."""
    nanosec: np.ndarray
    position: np.ndarray
    """Positions [rad, m], shape (k, n).

    A width other than n and 0 rejects the messages.
    """
    velocity: np.ndarray
    """Velocities [rad/s, m/s], with shapes as of positions."""
    effort: np.ndarray
    """Efforts as sent, with shapes as of positions."""

    def select(self, mask):
        """Return the messages of a mask."""
        return JointStates(self.rows[mask], self.names, *(column[mask] for column in self[2:]))


@dataclass(frozen=True, eq=False)
class Places:
    """Places of the numbers in a message."""

    names: tuple
    length: int
    """Length of the message [bytes]."""
    order: str
    """< for little-endian numbers, > otherwise."""
    first: tuple
    """First byte of each of FIELDS, and their numbers."""
    counts: tuple
    fixed: np.ndarray
    """Indices of the bytes that are neither numbers nor padding."""
    text: np.ndarray
    """Values of these bytes."""

    def holds(self, raw):
        """Whether a message of this length has these names and lengths."""
        return bool((np.frombuffer(raw, np.uint8)[self.fixed] == self.text).all())

    def read(self, raw, rows):
        """Return messages of this layout in columns.

        `raw` is (k, length), and `rows` are their places among all of a batch.
        """

        def read_numbers(at, kind, count):
            dtype = np.dtype(self.order + kind)
            values = np.ascontiguousarray(raw[:, at : at + dtype.itemsize * count]).view(dtype)
            return values.astype(dtype.newbyteorder("="), copy=False)

        sec, nanosec = (
            read_numbers(at, kind, 1)[:, 0].astype(np.int64) for at, kind in ((4, "i4"), (8, "u4"))
        )
        fields = [
            read_numbers(at, "f8", count) if count else np.zeros((len(rows), 0))
            for at, count in zip(self.first, self.counts, strict=True)
        ]
        return JointStates(rows, self.names, sec, nanosec, *fields)


class Layouts(dict):
    """Entries about messages, at most MAX_LAYOUTS of at most MAX_BYTES together."""

    _bytes = 0

    def keep(self, key, entry, size):
        """Store an entry of `size` bytes unless it is too large.

        Drop all others if there is no space.
        """
        if size > MAX_BYTES:
            return
        if len(self) >= MAX_LAYOUTS or self._bytes + size > MAX_BYTES:
            self.clear()
            self._bytes = 0
        self._bytes += size
        self[key] = entry


class Decoder:
    """Reads serialized sensor_msgs/msg/JointState."""

    def __init__(self):
        self._places = Layouts()

    def decode(self, data, at, size, chosen):
        """Return JointStates, and errors by place, of the `chosen` messages.

        Message k is ``data[at[k] : at[k] + size[k]]``.
        """
        parts = []
        errors = {}
        for length in np.unique(size[chosen]).tolist():
            rows = chosen[size[chosen] == length]
            raw = (
                np.lib.stride_tricks.sliding_window_view(data, length)[at[rows]]
                if length
                else data[:0]
            )
            self._decode_rows(raw, rows, parts, errors)
        return sorted(parts, key=lambda part: part.rows[0]), errors

    def find_places(self, raw):
        """Return the Places of one message; ValueError if it is no joint state."""
        for places in self._places.values():
            if places.length == len(raw) and places.holds(raw):
                return places
        try:
            places = find_places(raw)
        except ValueError as error:
            raise ValueError(
                f"{len(raw)} bytes that are no sensor_msgs/msg/JointState ({error})"
            ) from error
        self._places.keep(len(self._places), places, len(raw))
        return places

    def _decode_rows(self, raw, rows, parts, errors):
        """Read messages of one length, (n, length)."""
        while len(rows):
            try:
                places = self.find_places(raw[0].tobytes() if raw.size else b"")
            except ValueError as error:
                errors[int(rows[0])] = f"joint_states: {error}"
                raw = raw[1:]
                rows = rows[1:]
                continue
            alike = (raw[:, places.fixed] == places.text).all(axis=1)
            if alike.all():
                parts.append(places.read(raw, rows))
                return
            parts.append(places.read(raw[alike], rows[alike]))
            raw = raw[~alike]
            rows = rows[~alike]


def find_places(raw):
    """Return the Places of a message; ValueError if it is no joint state."""
    if len(raw) < 12 or raw[0] != 0 or raw[1] > 1:
        raise ValueError("the encapsulation is not that of plain CDR, or the stamp is missing")
    reader = _Reader(raw)
    reader.skip(1, reader.read_count())  # frame_id
    names = tuple(reader.read_text() for _ in range(reader.read_count()))
    first, counts = zip(*(reader.skip_doubles() for _ in FIELDS), strict=True)
    fixed = np.flatnonzero(reader.is_fixed)
    return Places(
        names=names,
        length=len(raw),
        order=reader.order,
        first=first,
        counts=counts,
        fixed=fixed,
        text=np.frombuffer(raw, np.uint8)[fixed],
    )


class _Reader:
    """Place in a message behind its stamp; `is_fixed` are bytes neither of numbers nor padding."""

    def __init__(self, raw):
        self.order = "<" if raw[1] else ">"
        self.is_fixed = np.zeros(len(raw), bool)
        self.is_fixed[:2] = True
        self._raw = raw
        self._at = 12

    def skip(self, alignment, size, is_fixed=True):
        """Return the first byte of so many bytes."""
        begin = self._at + -(self._at - 4) % alignment
        self._at = begin + size
        if self._at > len(self._raw):
            raise ValueError("the message ends before its content does")
        self.is_fixed[begin : self._at] = is_fixed
        return begin

    def read_count(self):
        """Return a number of entries or letters."""
        return struct.unpack_from(f"{self.order}I", self._raw, self.skip(4, 4))[0]

    def read_text(self):
        """Return a text."""
        begin = self.skip(1, self.read_count())
        return self._raw[begin : self._at].split(b"\0")[0].decode(errors="replace")

    def skip_doubles(self):
        """Return the first byte and the number of a sequence of doubles."""
        count = self.read_count()
        return self.skip(8 if count else 1, 8 * count, False), count
