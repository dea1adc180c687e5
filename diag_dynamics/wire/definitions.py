# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages without ROS: types from ``.msg`` files, and decoding of plain CDR."""

import os
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from diag_dynamics.exceptions import InputError

STANDARD = {
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec",
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "std_msgs/msg/String": "string data",
    "sensor_msgs/msg/JointState": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
        "float64[] effort"
    ),
    "geometry_msgs/msg/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/msg/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/msg/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/msg/Inertia": (
        "float64 m\nVector3 com\nfloat64 ixx\nfloat64 ixy\nfloat64 ixz\nfloat64 iyy\n"
        "float64 iyz\nfloat64 izz"
    ),
    "geometry_msgs/msg/Wrench": "Vector3 force\nVector3 torque",
    "geometry_msgs/msg/Pose": "Point position\nQuaternion orientation",
    "geometry_msgs/msg/PoseWithCovariance": "Pose pose\nfloat64[36] covariance",
    "geometry_msgs/msg/Twist": "Vector3 linear\nVector3 angular",
    "geometry_msgs/msg/TwistWithCovariance": "Twist twist\nfloat64[36] covariance",
    "nav_msgs/msg/Odometry": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
        "geometry_msgs/TwistWithCovariance twist"
    ),
}
"""Definitions of types that are read or used by the package's messages."""

PRIMITIVES = {
    "bool": ("boolean", "?"),
    "byte": ("octet", "u1"),
    "int8": ("int8", "i1"),
    "uint8": ("uint8", "u1"),
    "int16": ("int16", "i2"),
    "uint16": ("uint16", "u2"),
    "int32": ("int32", "i4"),
    "uint32": ("uint32", "u4"),
    "int64": ("int64", "i8"),
    "uint64": ("uint64", "u8"),
    "float32": ("float", "f4"),
    "float64": ("double", "f8"),
}
"""Names in IDL and in NumPy by the name in a definition."""

ALIGNMENT = dict.fromkeys(range(4), 8) | dict.fromkeys(range(6, 12), 4)
"""Alignment of doubles by the second byte of the encapsulation (DDS-XTypes 1.3, 7.4.3)."""


class Field:
    """Field of a message: name, type and count (None: one; 0: any number)."""

    def __init__(self, line, package):
        kind, self.name = line.split()
        kind, bracket, count = kind.partition("[")
        self.count = int(count[:-1] or 0) if bracket else None
        self.is_primitive = kind in PRIMITIVES or kind == "string"
        if not self.is_primitive:
            origin, _, kind = kind.rpartition("/")
            kind = f"{origin.removesuffix('/msg') or package}/msg/{kind}"
        self.kind = kind

    @property
    def idl(self):
        """Name of its type in IDL, as in rosidl's ``get_fields_and_field_types``."""
        name = PRIMITIVES.get(self.kind, (self.kind.replace("/msg/", "/"),))[0]
        if self.count is None:
            return name
        return f"{name}[{self.count}]" if self.count else f"sequence<{name}>"

    def default(self):
        """Return the value in a new message."""
        if self.count is not None:
            return [] if not self.count else [Field(f"{self.kind} x", "").default()] * self.count
        if self.is_primitive:
            return "" if self.kind == "string" else 0.0 if self.kind.startswith("float") else 0
        return message_type(self.kind)()


def fields_of(kind):
    """Return the fields of a type without comments, constants and default values."""
    package = kind.split("/")[0]
    lines = (line.split("#")[0].strip() for line in definition_of(kind).splitlines())
    return [
        Field(" ".join(line.split()[:2]), package) for line in lines if line and "=" not in line
    ]


@cache
def message_type(kind):
    """Return the class of messages of a type such as ``sensor_msgs/msg/JointState``."""
    fields = fields_of(kind)
    idl = {field.name: field.idl for field in fields}

    class Message(SimpleNamespace):
        __doc__ = kind

        def __init__(self, **values):
            super().__init__(
                **{field.name: field.default() for field in fields if field.name not in values},
                **values,
            )

        @classmethod
        def get_fields_and_field_types(cls):
            """Return types by field, as classes of rosidl."""
            return dict(idl)

    Message.__name__ = kind.split("/")[-1]
    return Message


def read_message(raw, kind):
    """Return the message in bytes, as rclpy reads them; ValueError if they are no such message."""
    return Reader(raw).message(kind)


def definition_with_parts(kind):
    """Return the definitions of a type and of all types in it, in the format ``ros2msg``."""
    kinds = [kind]
    for part in kinds:
        part_kinds = (field.kind for field in fields_of(part) if not field.is_primitive)
        kinds += [part_kind for part_kind in dict.fromkeys(part_kinds) if part_kind not in kinds]
    parts = [f"MSG: {part.replace('/msg/', '/')}\n{definition_of(part)}\n" for part in kinds[1:]]
    return ("=" * 80 + "\n").join([f"{definition_of(kind)}\n", *parts])


class Reader:
    """Reads one message; ValueError if the bytes are none.

    `order` is < for little-endian numbers, else >. After reading, `used` has a 1 for each byte that
    is no padding, and `arrays` the first byte and count of sequences of numbers by field.
    """

    def __init__(self, raw):
        if len(raw) < 4 or raw[0] != 0 or raw[1] not in ALIGNMENT:
            raise ValueError("the encapsulation is not that of plain CDR")
        self._raw = raw
        self._at = 4
        self._widest = ALIGNMENT[raw[1]]
        self.order = "<" if raw[1] % 2 else ">"
        self.arrays = {}
        self.used = bytearray(b"\1\1" + bytes(len(raw) - 2))

    def message(self, kind):
        """Return the message of a type."""
        return message_type(kind)(**{field.name: self._field(field) for field in fields_of(kind)})

    def _field(self, field):
        if field.count is None:
            return self._one(field)
        count = field.count or self._count()
        if count > len(self._raw) - self._at:
            raise ValueError("a sequence counts more entries than there are bytes")
        if field.kind in PRIMITIVES:
            numbers = self._numbers(PRIMITIVES[field.kind][1], count)
            self.arrays[field.name] = self._at - numbers.nbytes, count
            return numbers
        return [self._one(field) for _ in range(count)]

    def _one(self, field):
        if field.kind == "string":
            return self._text()
        if field.is_primitive:
            return self._numbers(PRIMITIVES[field.kind][1], 1)[0].item()
        return self.message(field.kind)

    def _count(self):
        return self._numbers("u4", 1)[0].item()

    def _text(self):
        count = self._count()
        if self._at + count > len(self._raw):
            raise ValueError("a text is longer than the message")
        self._at += count
        self.used[self._at - count : self._at] = b"\1" * count
        return (
            bytes(self._raw[self._at - count : self._at]).split(b"\0")[0].decode(errors="replace")
        )

    def _numbers(self, kind, count):
        dtype = np.dtype(kind if kind == "?" else self.order + kind)
        if count:
            self._at += -(self._at - 4) % min(dtype.itemsize, self._widest)
        end = self._at + count * dtype.itemsize
        if end > len(self._raw):
            raise ValueError("the message ends before its numbers do")
        numbers = np.frombuffer(self._raw, dtype, count, self._at) if count else np.zeros(0, dtype)
        self.used[self._at : end] = b"\1" * (end - self._at)
        self._at = end
        return numbers.astype(dtype.newbyteorder("="))


# --- Messages of this package

PACKAGE = Path(__file__).resolve().parents[1]


def _folders():
    """Yield possible folders: of a wheel, of a checkout, of an installed workspace."""
    yield PACKAGE / "definitions"
    yield PACKAGE.parent / "msg"
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield Path(prefix) / "share" / "diag_dynamics" / "msg"


def definition_of(kind):
    """Return the definition of a type: a standard one, or one of this package."""
    return STANDARD[kind] if kind in STANDARD else our_definitions()[kind]


@cache
def our_definitions():
    """Return the definitions of this package's messages by type."""
    for folder in _folders():
        if paths := sorted(folder.glob("*.msg")):
            return {
                f"diag_dynamics/msg/{path.stem}": path.read_text(encoding="utf-8") for path in paths
            }
    folders = ", ".join(map(str, _folders()))
    raise InputError(f"the definitions of this package's messages are in none of {folders}.")
