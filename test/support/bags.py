# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings of robots with few joints, written by the libraries mcap and rosbags."""

import shutil
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
import yaml
from mcap.writer import CompressionType, IndexType, Writer
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

import diag_dynamics as dd

MS, S = 10**6, 10**9
START = 1_700_000_000 * S
JOINT_STATE = "sensor_msgs/msg/JointState"
ODOMETRY = "nav_msgs/msg/Odometry"
STRING = "std_msgs/msg/String"
TEXT = (
    "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] "
    "effort\n"
)
DEFINITIONS = {JOINT_STATE: TEXT, STRING: "string data\n"}

NO_INDEX = IndexType.NONE
ZSTD, LZ4, PLAIN = CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE
SQLITE, MCAP = rosbag2.StoragePlugin.SQLITE3, rosbag2.StoragePlugin.MCAP

JAZZY, NOETIC = get_typestore(Stores.ROS2_JAZZY), get_typestore(Stores.ROS1_NOETIC)


class Message(NamedTuple):
    """A message of a bag."""

    topic: str
    log_time: int
    data: bytes
    type: str = JOINT_STATE


def urdf_of(*names):
    """Return a URDF of a chain of links on continuous joints of these names, with plausible
    numbers.
    """
    links = "".join(
        f'<link name="link_{name}"><inertial><mass value="1"/><origin xyz="0.1 0 0.3"/>'
        '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        for name in names
    )
    parents = ["base", *(f"link_{name}" for name in names)]
    joints = "".join(
        f'<joint name="{name}" type="continuous"><parent link="{parent}"/>'
        f'<child link="link_{name}"/>'
        '<axis xyz="0 1 0"/></joint>'
        for name, parent in zip(names, parents, strict=False)
    )
    return f'<robot name="arm"><link name="base"/>{links}{joints}</robot>'


@cache
def arm(*names):
    """Return the robot of :func:`urdf_of`."""
    return dd.load_urdf(urdf_of(*names))


def header(stamp, frame):
    """Return a Header; `stamp` in nanoseconds, or seconds and nanoseconds."""
    time = stamp if isinstance(stamp, tuple) else divmod(stamp, S)
    return JAZZY.types["std_msgs/msg/Header"](
        JAZZY.types["builtin_interfaces/msg/Time"](*time), frame
    )


def serialized(stamp, names, position, velocity=(), effort=(), frame="", order="<"):
    """Return the bytes of a joint state of ROS 2, by rosbags."""
    arrays = [np.array(list(values), float) for values in (position, velocity, effort)]
    message = JAZZY.types[JOINT_STATE](header(stamp, frame), list(names), *arrays)
    return bytes(JAZZY.serialize_cdr(message, JOINT_STATE, little_endian=order == "<"))


def numbered(count, topics=("/joint_states",), disorder=0, longest=40, seed=0):
    """Return joint states in the order in which they were written: message k, by log time, is at
    START + k ms.

    The joint `a` moves by 0.1 rad/s from 0 on. `disorder` is how many messages a message may be
    late, `longest` the length of a text that makes messages differ in size.
    """
    rng = np.random.default_rng(seed)
    order = np.argsort(np.arange(count) + rng.integers(disorder + 1, size=count), kind="stable")
    return [
        Message(
            topics[k % len(topics)],
            START + k * MS,
            serialized(
                START + k * MS,
                ["a"],
                [1e-4 * k],
                [0.1],
                frame=rng.bytes(int(rng.integers(longest)) // 2).hex(),
            ),
        )
        for k in order.tolist()
    ]


def write_mcap(
    path,
    messages,
    compression=ZSTD,
    chunk_size=400,
    encoding="cdr",
    schema="ros2msg",
    definitions=DEFINITIONS,
    metadata=None,
    **options,
):
    """Write messages by the library mcap; return the path. `schema` is the encoding of
    `definitions`, by type.
    """
    with open(path, "wb") as file:
        writer = Writer(file, compression=compression, chunk_size=chunk_size, **options)
        writer.start(profile="ros2")
        schemas = {}
        channels = {}
        for message in messages:
            if message.type not in schemas:
                schemas[message.type] = writer.register_schema(
                    message.type, schema, definitions.get(message.type, "").encode()
                )
            if message.topic not in channels:
                channels[message.topic] = writer.register_channel(
                    message.topic, encoding, schemas[message.type], metadata or {}
                )
            writer.add_message(
                channels[message.topic], message.log_time, message.data, message.log_time
            )
        writer.finish()
    return path


def of_ros1(messages):
    """Return messages in the encoding of ROS 1, their types without ``/msg/``."""
    return [
        message._replace(
            data=bytes(JAZZY.cdr_to_ros1(message.data, message.type)),
            type=message.type.replace("/msg/", "/"),
        )
        for message in messages
    ]


def description(urdf, log_time=START):
    """Return a message with the description of a robot."""
    data = JAZZY.serialize_cdr(JAZZY.types[STRING](urdf), STRING)
    return Message("/robot_description", log_time, bytes(data), STRING)


def write_rosbag2(path, messages, plugin=SQLITE, mode=rosbag2.CompressionMode.NONE, version=9):
    """Write a folder of rosbag2 by rosbags; return its path."""
    writer = rosbag2.Writer(path, version=version, storage_plugin=plugin)
    if mode != rosbag2.CompressionMode.NONE:
        writer.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for message in messages:
            if message.topic not in connections:
                connections[message.topic] = writer.add_connection(
                    message.topic, message.type, typestore=JAZZY
                )
            writer.write(connections[message.topic], message.log_time, message.data)
    return path


def file_of(folder):
    """Return the only file of messages in a folder of rosbag2."""
    (path,) = (path for path in folder.iterdir() if path.name != "metadata.yaml")
    return path


def write_split(folder, parts, plugin=SQLITE):
    """Write a folder with a file for each part, as rosbag2 splits recordings; return its path."""
    folder.mkdir()
    names = []
    for k, messages in enumerate(parts):
        part = write_rosbag2(folder.with_name(f"{folder.name}_{k}"), messages, plugin)
        names.append(file_of(part).rename(folder / file_of(part).name).name)
        shutil.rmtree(part)
    metadata = {"rosbag2_bagfile_information": {"relative_file_paths": names}}
    (folder / "metadata.yaml").write_text(yaml.safe_dump(metadata))
    return folder


def write_ros1(path, messages, compression=None, chunk=2000):
    """Write a bag of ROS 1 by rosbags; return its path."""
    writer = rosbag1.Writer(path)
    writer.chunk_threshold = chunk
    if compression:
        writer.set_compression(compression)
    with writer:
        connections = {}
        for k, message in enumerate(messages):
            if message.topic not in connections:
                connections[message.topic] = writer.add_connection(
                    message.topic, JOINT_STATE, typestore=NOETIC
                )
            raw = (
                k.to_bytes(4, "little") + bytes(JAZZY.cdr_to_ros1(message.data, JOINT_STATE))[4:]
            )  # `seq` is k
            writer.write(connections[message.topic], message.log_time, raw)
    return path


def odometry(stamp, link, pose, twist):
    """Return the bytes of an odometry by rosbags: x y z qx qy qz qw, and linear and angular
    velocity in the link's axes.
    """

    def geometry(name, *fields):
        return JAZZY.types[f"geometry_msgs/msg/{name}"](*fields)

    point = geometry("Point", *map(float, pose[:3]))
    orientation = geometry("Quaternion", *map(float, pose[3:]))
    linear, angular = (geometry("Vector3", *map(float, part)) for part in (twist[:3], twist[3:]))
    place = geometry("PoseWithCovariance", geometry("Pose", point, orientation), np.zeros(36))
    motion = geometry("TwistWithCovariance", geometry("Twist", linear, angular), np.zeros(36))
    return bytes(
        JAZZY.serialize_cdr(
            JAZZY.types[ODOMETRY](header(stamp, "odom"), link, place, motion), ODOMETRY
        )
    )


def read(path, topic=None):
    """Return the numbers of the messages read, and the findings; nothing read is a finding, too.

    No message is changed, and none comes twice or before an earlier one.
    """
    try:
        recording = dd.read_recording(path, arm("a"), topic=topic)
    except dd.InputError as error:
        return [], [("unread", str(error))]
    numbers = (recording.stamp - START) // MS
    np.testing.assert_array_equal(recording.stamp, START + numbers * MS)
    np.testing.assert_allclose(recording.q[:, 0], 1e-4 * numbers, rtol=1e-15)
    assert (np.diff(numbers) > 0).all()
    return numbers.tolist(), [(finding.cause, finding.text) for finding in recording.findings]


def unread(findings):
    """Return the texts of what could not be read."""
    return [text for cause, text in findings if cause == "unread"]


def refused(what, *arguments, **options):
    """Assert that `read_recording` raises an error whose text matches."""
    with pytest.raises(dd.InputError, match=what):
        dd.read_recording(*arguments, **options)
