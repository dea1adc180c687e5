# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages without a ROS: read from any bytes as rclpy reads them, and defined as ROS has them."""

from collections import Counter
from importlib import import_module

import diag_dynamics.msg
import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg
from sensor_msgs.msg import JointState

from diag_dynamics.wire.definitions import definition_with_parts, read_message
from diag_dynamics.wire.ours import our_definitions
from diag_dynamics.wire.overrun import overruns

OURS = sorted(name for name in vars(diag_dynamics.msg) if hasattr(getattr(diag_dynamics.msg, name), "SLOT_TYPES"))
COUNT = 20_000


# --- bytes


def joint_state(rng):
    """A JointState of whatever names and lengths."""
    message = JointState(name=[str(rng.choice(["", "a", "joint_7", "€𝄞", "x" * 40])) for _ in range(rng.integers(4))])
    message.header.frame_id = str(rng.choice(["", "base", "world/€"]))
    message.header.stamp.sec = int(rng.integers(-(2**31), 2**31))
    for field in ("position", "velocity", "effort"):
        setattr(message, field, rng.normal(size=rng.integers(4)).tolist())
    return message


def odometry(rng):
    """An Odometry of whatever numbers."""
    message = Odometry(child_frame_id=str(rng.choice(["", "base", "base_link", "€"])))
    message.header.frame_id = str(rng.choice(["", "odom", "w"]))
    message.pose.pose.position.x, message.pose.pose.orientation.w = rng.normal(size=2).tolist()
    message.twist.twist.linear.x, message.twist.twist.angular.z = rng.normal(size=2).tolist()
    message.pose.covariance = rng.normal(size=36)
    return message


def mutated(raw, rng):
    """These bytes with one or two things wrong about them."""
    data = bytearray(raw)
    for _ in range(rng.integers(1, 3)):
        kind, at = rng.integers(9), int(rng.integers(len(data))) if data else 0
        if kind <= 1 and data:
            data[at] ^= 1 << rng.integers(8)
        elif kind == 2 and data:
            data[at] = rng.choice([0, 1, 127, 128, 255])
        elif kind == 3:
            del data[at:]
        elif kind == 4:
            data += rng.bytes(rng.integers(1, 20))
        elif kind == 5 and len(data) > 1:
            data[1] = rng.integers(14)
        elif kind == 6:
            del data[at : at + rng.integers(1, 9)]
        elif kind == 7:
            data[at:at] = rng.bytes(rng.integers(1, 9))
        elif len(data) > 8:  # a count, perhaps
            at -= at % 4
            data[at : at + 4] = int(rng.choice([0, 1, 2, 5, 1000, 2**31, 2**32 - 1])).to_bytes(4, "little")
    return bytes(data)


def plain(value):
    """Value of a field, in which NaN is equal to itself and a zero is not to its negative."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, float):
        return np.float64(value).tobytes()
    if isinstance(value, (int, str)):
        return value
    if len(value) and isinstance(value[0], str):
        return list(value)
    return np.array(value, dtype=float).tobytes()


@pytest.mark.parametrize(
    ("kind", "type_name", "make"),
    [(JointState, "sensor_msgs/msg/JointState", joint_state), (Odometry, "nav_msgs/msg/Odometry", odometry)],
    ids=["JointState", "Odometry"],
)
def test_read_as_rclpy_reads(kind, type_name, make):
    rng, found = np.random.default_rng(1), Counter()
    for k in range(COUNT):
        raw = serialize_message(make(rng))
        if k % 50:
            raw = mutated(raw, rng)
        try:
            if kind is JointState and overruns(raw):  # no node lets rclpy see these
                raise ValueError("an overrun")
            expected = plain(deserialize_message(raw, kind))
        except Exception:
            expected = None
        try:
            actual = plain(read_message(raw, type_name))
        except ValueError:
            actual = None
        assert actual == expected, raw.hex()
        found["refused" if expected is None else "read"] += 1
    assert found["read"] > COUNT // 5
    assert found["refused"] > COUNT // 10


# --- definitions


IN_IDL = {"bool": "boolean", "byte": "octet", "float32": "float", "float64": "double"}


def idl(description):
    """Name that rosidl has for what rosbags has parsed."""
    node, what = description
    if node == Nodetype.BASE:
        return IN_IDL.get(what[0], what[0])
    if node == Nodetype.NAME:
        return what.replace("/msg/", "/")
    element, count = what
    return f"sequence<{idl(element)}>" if node == Nodetype.SEQUENCE else f"{idl(element)}[{count}]"


@pytest.mark.parametrize("name", OURS)
def test_definitions_are_what_ros_has(name):
    """Of every message of this package and of all that is in it, as another library understands the text."""
    kind = f"diag_dynamics/msg/{name}"
    types = get_types_from_msg(definition_with_parts(kind, our_definitions()), kind)
    assert kind in types
    for one, (_, fields) in types.items():
        package, _, part = one.split("/")
        declared = getattr(import_module(f"{package}.msg"), part).get_fields_and_field_types()
        assert {field: idl(description) for field, description in fields} == declared, one
        assert [field for field, _ in fields] == list(declared), one
    parts = {one for _, fields in types.values() for _, (node, one) in fields if node == Nodetype.NAME}
    assert parts < set(types)


@pytest.mark.parametrize("name", ["sensor_msgs/msg/JointState", "nav_msgs/msg/Odometry"])
def test_definitions_of_inputs_are_what_ros_has(name):
    for one, (_, fields) in get_types_from_msg(definition_with_parts(name), name).items():
        package, _, part = one.split("/")
        declared = getattr(import_module(f"{package}.msg"), part).get_fields_and_field_types()
        assert {field: idl(description) for field, description in fields} == declared, one
