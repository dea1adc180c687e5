# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as bytes: of whatever contents, they are what rclpy makes of them, and stay so when numbers are written anew."""

import math

import diag_dynamics.msg
import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Polygon, PoseStamped
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import ListParametersResult, ParameterDescriptor, ParameterValue
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import BatteryState, CompressedImage, JointState, Joy, LaserScan, RegionOfInterest
from std_msgs.msg import (
    Bool,
    Byte,
    Char,
    ColorRGBA,
    Empty,
    Float32,
    Float64,
    Header,
    Int8,
    Int16,
    Int32,
    Int64,
    String,
    UInt8,
    UInt16,
    UInt32,
    UInt64,
)
from trajectory_msgs.msg import JointTrajectoryPoint

from diag_dynamics.exceptions import InputError
from diag_dynamics.wire.cdr import HEADER, Template
from examples import examples

OURS = tuple(kind for kind in vars(diag_dynamics.msg).values() if hasattr(kind, "get_fields_and_field_types"))
SINGLE = (Bool, Char, Int8, Int16, Int32, Int64, UInt8, UInt16, UInt32, UInt64, Float32, Float64, String)
MIXED = (BatteryState, ColorRGBA, Duration, Header, KeyValue, PoseStamped, RegionOfInterest, Time)
SEQUENCES = (CompressedImage, JointState, JointTrajectoryPoint, Joy, LaserScan, ListParametersResult)
KINDS = (*OURS, *SINGLE, *MIXED, *SEQUENCES)

every_kind = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)

MOST = np.finfo(np.float32).max.item()
"""The one number of a float field that rclpy refuses, and its negative."""

VALUES = {
    "boolean": st.booleans(),
    "float": st.floats(width=32).filter(lambda value: abs(value) != MOST),
    "double": st.floats(),
    "string": st.text("ab/é€𝄞", max_size=9),
} | {
    f"{sign}int{bits}": st.integers(-least, 2**bits - 1 - least)
    for bits in (8, 16, 32, 64)
    for sign, least in (("", 2 ** (bits - 1)), ("u", 0))
}


def contents(kind):
    """Return messages of a kind, with anything in them that it can hold."""
    sample = kind()
    fields = {}
    for field, name in kind.get_fields_and_field_types().items():
        if name in VALUES:
            fields[field] = VALUES[name]
        elif name.startswith("sequence<"):
            fields[field] = st.lists(VALUES[name[len("sequence<") : -1]], max_size=5)
        else:
            fields[field] = contents(type(getattr(sample, field)))
    return st.builds(kind, **fields)


def number(message, path):
    """Return a number, or a sequence of numbers, of a message as an array."""
    for field in path.split("."):
        message = getattr(message, field)
    return np.atleast_1d(message)


def write(message, path, values):
    """Put numbers into a message."""
    *outer, field = path.split(".")
    for name in outer:
        message = getattr(message, name)
    is_sequence = message.get_fields_and_field_types()[field].startswith("sequence")
    setattr(message, field, values.tolist() if is_sequence else values[0].item())


def other_numbers(template, seed):
    """Return other values of all numbers by path: any bytes, which are any numbers; truth is 0 or 1."""
    rng = np.random.default_rng(seed)
    return {
        path: rng.integers(2, size=old.size).astype(bool)
        if old.dtype == bool
        else np.frombuffer(rng.bytes(old.nbytes), dtype=old.dtype)
        for path, old in template.numbers.items()
    }


def padding(raw, kind):
    """Return where a message's bytes can be anything: nothing that is read of it changes with them."""
    places = range(len(HEADER), len(raw))
    message = repr(deserialize_message(raw, kind))
    return [k for k in places if all(read(changed(raw, k, bit), kind) == message for bit in (1, 128))]


def changed(raw, place, bits):
    """Return bytes of which some bits are others."""
    return raw[:place] + bytes([raw[place] ^ bits]) + raw[place + 1 :]


def read(raw, kind):
    """Return what is read of a message, None if that fails."""
    try:
        return repr(deserialize_message(raw, kind))
    except Exception:
        return None


@every_kind
def test_bytes_are_those_of_rclpy(kind):
    """Where the two differ is padding, in which rclpy leaves what there was and a template has zeros."""

    @examples(15)
    @given(contents(kind))
    def check(message):
        template, raw = Template(message), serialize_message(message)
        assert template.holds(raw) and template.fits(raw)
        ours = template.encoded()
        assert len(ours) <= len(raw) and template.holds(ours)
        assert not any(own for own, other in zip(ours, raw, strict=False) if own != other)
        assert repr(deserialize_message(ours, kind)) == repr(message)

    check()


@every_kind
def test_numbers_written_anew(kind):
    """The bytes are those of the message with these numbers: of the same text, but not the same."""

    @examples(15)
    @given(contents(kind), st.integers(0, 2**32))
    def check(message, seed):
        template, before = Template(message), serialize_message(message)
        for path, values in other_numbers(template, seed).items():
            assert repr(template.numbers[path].tolist()) == repr(number(message, path).tolist())
            template.numbers[path][:] = values
            write(message, path, values)
        # NaN has many forms, which a float field of Python does not keep
        assert repr(deserialize_message(template.encoded(), kind)) == repr(message)
        after = Template(message)
        assert template.fits(before) and template.fits(after.encoded())
        if not any(np.isnan(values).any() for values in template.numbers.values()):
            assert template.holds(serialize_message(message))
            assert template.encoded() == after.encoded()
            assert template.holds(before) == after.holds(before)

    check()


@pytest.mark.parametrize("kind", [JointState, LaserScan, *OURS], ids=lambda kind: kind.__name__)
def test_what_is_padding(kind):
    """Exactly what makes no difference to who reads it: it is zero, and garbage in it is ignored."""

    @examples(4)
    @given(contents(kind), st.binary(min_size=64, max_size=64))
    def check(message, garbage):
        template = Template(message)
        for values in template.numbers.values():
            values[:] = 1  # no NaN, of which some bits are not seen either
        ours = template.encoded()
        raw, free = bytearray(ours), padding(ours, kind)
        for k, byte in zip(free, garbage, strict=False):
            assert ours[k] == 0
            raw[k] = byte
        assert template.holds(bytes(raw)) and template.fits(bytes(raw))
        assert template.holds(bytes(raw) + garbage)  # what comes after the message is not read either
        for k in set(range(len(ours))) - set(free):
            other = changed(bytes(raw), k, 1)
            assert not template.holds(other)
            assert template.fits(other) == (not template.text[k])

    check()


@examples(60)
@given(contents(JointState))
def test_truncated(message):
    """A message is whole or it is none."""
    template = Template(message)
    raw = template.encoded()
    for size in range(len(raw)):
        assert not template.fits(raw[:size]) and not template.holds(raw[:size])


def joint_states():
    """Return a message, and others of which each has another text."""
    changes = (
        {},
        {"name": ["shoulder", "elbow "]},
        {"name": ["elbow", "shoulder"]},
        {"name": ["shoulder"]},
        {"position": [1.0]},
        {"velocity": []},
        {"effort": [1.0, 2.0]},
        {"header": Header(frame_id="world")},
        {"header": Header(frame_id="wörld")},
    )
    good = {"name": ["shoulder", "elbow"], "position": [1.0, 2.0], "velocity": [3.0, 4.0]}
    return [JointState(**(good | change)) for change in changes]


def test_other_texts_do_not_fit():
    """Names, their order, lengths, frames: whatever is no number."""
    messages = joint_states()
    for k, message in enumerate(messages):
        template = Template(message)
        assert [template.fits(serialize_message(other)) for other in messages] == [j == k for j in range(len(messages))]
        assert [template.holds(serialize_message(other)) for other in messages] == [
            j == k for j in range(len(messages))
        ]


def test_other_numbers_fit():
    """They are not the same message, though."""
    message = joint_states()[0]
    template = Template(message)
    message.velocity[1] = math.nextafter(4.0, 5.0)
    raw = serialize_message(message)
    assert template.fits(raw) and not template.holds(raw)


@examples(100)
@given(contents(diag_dynamics.msg.DiagonalizedState))
def test_places(message):
    """All views are of the same bytes, wherever the texts before them end."""
    template = Template(message)
    assert template.words[:2].view(np.uint32).tolist() == [
        message.header.stamp.sec % 2**32,
        message.header.stamp.nanosec,
    ]
    for path, kind in message.get_fields_and_field_types().items():
        if kind == "sequence<double>":
            values = getattr(message, path)
            first = template.first_double(path)
            assert (first >= 0) == (template.place(path) >= 0) == (path in template.numbers) == (len(values) > 0)
            if values:
                assert repr(template.doubles[first : first + len(values)].tolist()) == repr(values.tolist())
                template.doubles[first] = 1.5
                assert template.numbers[path][0] == 1.5
    assert template.data[template.place("velocity_estimated")] == message.velocity_estimated
    assert template.place("elbow") == template.first_double("elbow") == -1


def test_bytes_handed_out_stay():
    """They are a copy."""
    template = Template(Float64(data=1.0))
    before = template.encoded()
    template.numbers["data"][:] = 2.0
    assert deserialize_message(before, Float64).data == 1.0


def test_a_text_that_rclpy_cuts_short():
    """It ends where there is a zero; who compares sees that."""
    message = String(data="to\0day")
    assert not Template(message).holds(serialize_message(message))


@pytest.mark.parametrize(
    ("kind", "field", "named"),
    [
        (Odometry, "Odometry.pose.covariance", "double[36]"),
        (DiagnosticArray, "DiagnosticArray.status", "sequence<diagnostic_msgs/DiagnosticStatus>"),
        (DiagnosticStatus, "DiagnosticStatus.level", "octet"),
        (Byte, "Byte.data", "octet"),
        (ParameterValue, "ParameterValue.byte_array_value", "sequence<octet>"),
        (
            ParameterDescriptor,
            "ParameterDescriptor.floating_point_range",
            "sequence<rcl_interfaces/FloatingPointRange, 1>",
        ),
        (Polygon, "Polygon.points", "sequence<geometry_msgs/Point32>"),
        (Empty, "Empty", "no fields"),
    ],
)
def test_other_types_are_refused(kind, field, named):
    """By field and type, not by bytes that are wrong."""
    with pytest.raises(InputError) as refusal:
        Template(kind())
    assert field in str(refusal.value) and named in str(refusal.value)
