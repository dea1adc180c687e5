# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags to read: messages written by the libraries that others read and write bags with."""

from typing import NamedTuple

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.typesys import Stores, get_typestore

JOINT_STATE = "sensor_msgs/msg/JointState"
ODOMETRY = "nav_msgs/msg/Odometry"
TEXT = "std_msgs/Header header\nstring[] name\nfloat64[] position\n"


class Told(NamedTuple):
    """A message of a bag."""

    topic: str
    log_time: int
    data: bytes


def told_by(bag, wanted=None):
    """All messages of a bag, which must be in the order of their log time, or the bag says that they are not."""
    told = []
    for piece in bag.pieces(wanted):
        assert len(piece.at)
        if told and told[-1].log_time > piece.log_time[0]:
            assert any("come late" in finding for finding in bag.findings)
        assert (np.diff(piece.log_time) >= 0).all()
        for connection, at, size, log_time in zip(*piece[1:], strict=True):
            assert 0 <= at <= at + size <= len(piece.data)
            data = piece.data[at : at + size].tobytes()
            told.append(Told(bag.connections[connection].topic, int(log_time), data))
    return told


def some(count, rng=None, topics=("/a", "/b", "/c"), disorder=0, longest=40):
    """Messages of several topics, no two alike, as they were written: `disorder` is how late one may be [ns]."""
    rng = rng or np.random.default_rng(0)
    return [
        Told(
            topics[int(rng.integers(len(topics)))],
            10**9 + 1000 * k - int(rng.integers(disorder + 1)),
            b"\0\1\0\0" + k.to_bytes(4, "little") + rng.bytes(int(rng.integers(longest))),
        )
        for k in range(count)
    ]


def ordered(messages):
    """In the order of their log time, those of the same time as they were written."""
    return sorted(messages, key=lambda one: one.log_time)


def write_mcap(path, messages, compression="zstd", chunk_size=400, **options):
    """Write messages by the library mcap; returns the path."""
    kind = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "": CompressionType.NONE}[compression]
    with open(path, "wb") as file:
        writer = Writer(file, compression=kind, chunk_size=chunk_size, **options)
        writer.start(profile="ros2")
        schema = writer.register_schema(JOINT_STATE, "ros2msg", TEXT.encode())
        channels = {}
        for one in messages:
            if one.topic not in channels:
                channels[one.topic] = writer.register_channel(one.topic, "cdr", schema)
            writer.add_message(channels[one.topic], one.log_time, one.data, one.log_time)
        writer.finish()
    return path


ALL, NO_MESSAGES, NO_CHUNKS, NO_INDEX = IndexType.ALL, IndexType.CHUNK, IndexType.MESSAGE, IndexType.NONE


def odometry(stamp, link, pose, twist):
    """Bytes of an odometry, by rosbags: x y z qx qy qz qw, and linear and angular velocity in the link's axes."""
    store, no = get_typestore(Stores.ROS2_JAZZY), np.zeros(36)

    def of(name, *fields):
        return store.types[name](*fields)

    def vector(numbers):
        return of("geometry_msgs/msg/Vector3", *map(float, numbers))

    header = of("std_msgs/msg/Header", of("builtin_interfaces/msg/Time", *divmod(stamp, 10**9)), "odom")
    point = of("geometry_msgs/msg/Point", *map(float, pose[:3]))
    placed = of("geometry_msgs/msg/Pose", point, of("geometry_msgs/msg/Quaternion", *map(float, pose[3:])))
    covered = (
        of("geometry_msgs/msg/PoseWithCovariance", placed, no),
        of(
            "geometry_msgs/msg/TwistWithCovariance",
            of("geometry_msgs/msg/Twist", *map(vector, (twist[:3], twist[3:]))),
            no,
        ),
    )
    return bytes(store.serialize_cdr(of(ODOMETRY, header, link, *covered), ODOMETRY))


def write_floating(path, joints, bases):
    """Write joint states, pairs of bytes and log times, and odometries, pairs of log times and bytes; returns the path."""
    told = [(now, 1, raw) for now, raw in bases] + [(now, 0, raw) for raw, now in joints]
    with open(path, "wb") as file:
        writer = Writer(file, chunk_size=20_000)
        writer.start(profile="ros2")
        channels = [
            writer.register_channel(topic, "cdr", writer.register_schema(kind, "ros2msg", b""))
            for topic, kind in (("/joint_states", JOINT_STATE), ("/odom", ODOMETRY))
        ]
        for now, kind, raw in sorted(told, key=lambda one: (one[0], -one[1])):
            writer.add_message(channels[kind], now, raw, now)
        writer.finish()
    return path
