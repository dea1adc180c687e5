# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Serialized messages: encoded once, then changed by overwriting their numbers.

Little-endian plain CDR (DDS-XTypes 1.3, 7.4.1, version 1): four bytes that say so, then every
primitive aligned to its own size. Implementations of rmw use this encoding; callers compare every
layout with rclpy's bytes by :meth:`Template.holds`.
"""

import re
import struct

import numpy as np

from diag_dynamics.exceptions import InputError

HEADER = b"\x00\x01\x00\x00"  # encapsulation: plain CDR, little-endian, no options

_PRIMITIVES = {
    "boolean": "?",
    "int8": "i1",
    "uint8": "u1",
    "int16": "<i2",
    "uint16": "<u2",
    "int32": "<i4",
    "uint32": "<u4",
    "int64": "<i8",
    "uint64": "<u8",
    "float": "<f4",
    "double": "<f8",
}
"""Types of NumPy by the name in IDL."""

_SEQUENCE = re.compile(r"sequence<(\w+)>")
_ARRAY = re.compile(r"(\w+)\[\d+\]")


class Template:
    """Bytes of a message, whose numbers can be overwritten in place; texts and lengths stay.

    `numbers` are views of numbers by path, such as ``header.stamp.sec``, without empty sequences;
    `data` all bytes. InputError for a message without fields, or fields other than numbers,
    strings, arrays of numbers, sequences of numbers or strings, and messages.
    """

    def __init__(self, message):
        self._kind = type(message).__name__
        self._places = {}
        self._bytes = bytearray()
        self._parts = bytearray()
        self._put(HEADER)
        self._add(message, "")
        size = len(self._bytes)
        room = np.zeros(size + 12, np.uint8)
        room = room[-room.ctypes.data % 8 :]
        self.data = room[4 : 4 + size]
        self.data[:] = self._bytes
        self._meaningful = np.frombuffer(self._parts, dtype=bool)
        self.numbers = {
            path: self.data[begin:end].view(kind)
            for path, (kind, begin, end) in self._places.items()
        }

    def encoded(self):
        """Return a copy of the bytes."""
        return self.data.tobytes()

    def holds(self, raw):
        """Return whether bytes equal this message, apart from padding and trailing bytes."""
        if len(raw) < len(self.data):
            return False
        theirs = np.frombuffer(raw, dtype=np.uint8, count=len(self.data))
        return bool((theirs == self.data)[self._meaningful].all())

    def place(self, path):
        """Return the first byte of a number or sequence; -1 if the sequence is empty."""
        return self._places[path][1] if path in self._places else -1

    def _add(self, message, prefix):
        fields = message.get_fields_and_field_types()
        if not fields:  # rclpy sends a byte that stands for one
            raise InputError(f"{type(message).__name__} has no fields: no template is made of it.")
        for field, kind in fields.items():
            self._add_field(getattr(message, field), kind, f"{prefix}{field}")

    def _add_field(self, value, kind, path):
        if kind in _PRIMITIVES:
            self._add_numbers([value], kind, path)
        elif kind == "string":
            self._add_text(value)
        elif hasattr(value, "get_fields_and_field_types"):
            self._add(value, f"{path}.")
        elif (items := _ARRAY.fullmatch(kind)) and items[1] in _PRIMITIVES:
            self._add_numbers(value, items[1], path)
        elif (items := _SEQUENCE.fullmatch(kind)) and items[1] in (*_PRIMITIVES, "string"):
            self._add_count(len(value))
            if items[1] == "string":
                for text in value:
                    self._add_text(text)
            elif len(value):
                self._add_numbers(value, items[1], path)
        else:
            raise InputError(
                f"{self._kind}.{path} is of type {kind}, of which no template is made."
            )

    def _add_numbers(self, values, kind, path):
        numbers = np.array(values, _PRIMITIVES[kind])
        self._align(numbers.itemsize)
        begin = len(self._bytes)
        self._put(numbers.tobytes())
        self._places[path] = numbers.dtype, begin, len(self._bytes)

    def _add_text(self, value):
        encoded = value.encode() + b"\0"
        self._add_count(len(encoded))
        self._put(encoded)

    def _add_count(self, count):
        self._align(4)
        self._put(struct.pack("<I", count))

    def _align(self, size):
        self._put(bytes(-(len(self._bytes) - len(HEADER)) % size), False)

    def _put(self, some, is_meaningful=True):
        self._bytes += some
        self._parts += bytes([is_meaningful]) * len(some)
