# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as bytes: they equal those of rclpy for every topic and layout; damaged bytes are an
error, never a crash.
"""

import importlib
from collections import Counter
from functools import cache
from typing import NamedTuple
from unittest import mock

import diag_dynamics.msg
import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from hypothesis import given
from hypothesis import strategies as st
from rcl_interfaces.msg import ListParametersResult, ParameterDescriptor, ParameterValue
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg
from sensor_msgs.msg import BatteryState, JointState, LaserScan, RegionOfInterest
from std_msgs.msg import Byte, Char, Empty, Header, Int8, Int64, String, UInt16

import diag_dynamics as dd
from commands import quiet_compiler  # noqa: F401 (a fixture)
from diag_dynamics.control.observer import Disturbance
from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.decoding import find_places
from diag_dynamics.joint_states.robot_joints import RobotState
from diag_dynamics.nodes.monitor.monitored_robot import MonitoredRobot, model_status
from diag_dynamics.nodes.support import messages
from diag_dynamics.nodes.support.messages import (
    MATRICES,
    ORDER,
    BytesMaker,
    MessageMaker,
)
from diag_dynamics.parameters.monitor import Settings
from diag_dynamics.parameters.robot_models import model_of
from diag_dynamics.wire.cdr import Template
from diag_dynamics.wire.definitions import definition_with_parts
from diag_dynamics.wire.fields import Alarming
from examples import examples, shortened
from joint_state_messages import INF, NOW, S
from joint_state_readers import DEFAULTS
from robots import TwoLinkArm, description, link, random_tree

OURS = tuple(
    kind for kind in vars(diag_dynamics.msg).values() if hasattr(kind, "get_fields_and_field_types")
)
STANDARD = (
    JointState,
    LaserScan,
    BatteryState,
    RegionOfInterest,
    ListParametersResult,
    Header,
    Char,
    Int8,
    UInt16,
    Int64,
)
of_every_kind = pytest.mark.parametrize("kind", (*OURS, *STANDARD, String))

# --- templates: any message of numbers and texts

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
    """Return messages of a kind with anything in them that it can hold."""
    sample = kind()
    fields = {}
    for field, name in kind.get_fields_and_field_types().items():
        if name in VALUES:
            fields[field] = VALUES[name]
        elif name.startswith("sequence<"):
            fields[field] = st.lists(VALUES[name[len("sequence<") : -1]], max_size=5)
        elif name.endswith("]"):
            numbers = VALUES[name.partition("[")[0]]
            count = int(name[:-1].partition("[")[2])
            fields[field] = st.lists(numbers, min_size=count, max_size=count)
        else:
            fields[field] = contents(type(getattr(sample, field)))
    return st.builds(kind, **fields)


def write(message, path, values):
    """Put numbers into a message."""
    *outer, field = path.split(".")
    for name in outer:
        message = getattr(message, name)
    is_list = message.get_fields_and_field_types()[field].endswith(("]", ">"))
    setattr(message, field, values.tolist() if is_list else values[0].item())


def same(raw, message):
    """The bytes are those of the message, to the last bit; padding is zero."""
    assert type(raw) is bytes
    assert repr(deserialize_message(raw, type(message))) == repr(message)
    theirs = serialize_message(message)
    assert len(raw) <= len(theirs)
    assert not any(byte for byte, other in zip(raw, theirs, strict=False) if byte != other)


@of_every_kind
def test_template(kind):
    """Bytes equal rclpy's, also with other numbers written into them; a message cut short is
    none.
    """

    @examples(15)
    @given(contents(kind), st.integers(0, 2**32))
    def check(message, seed):
        template = Template(message)
        before = serialize_message(message)
        rng = np.random.default_rng(seed)
        encoded = template.encoded()
        same(encoded, message)
        assert template.holds(before)
        for path, old in template.numbers.items():
            new = np.frombuffer(rng.bytes(old.nbytes), dtype=old.dtype)
            template.numbers[path][:] = values = (
                rng.integers(2, size=old.size).astype(bool) if old.dtype == bool else new
            )
            write(message, path, values)
        assert repr(deserialize_message(template.encoded(), kind)) == repr(message)
        after = Template(message)
        if not any(
            np.isnan(values).any() for values in template.numbers.values()
        ):  # a NaN has many forms
            assert template.holds(serialize_message(message))
            assert template.holds(before) == after.holds(before)
        assert not any(
            template.holds(encoded[:size])
            for size in (*range(0, len(encoded), 3), len(encoded) - 1)
        )

    check()


@pytest.mark.parametrize(
    ("kind", "field", "named"),
    [
        (DiagnosticArray, "DiagnosticArray.status", "sequence<diagnostic_msgs/DiagnosticStatus>"),
        (DiagnosticStatus, "DiagnosticStatus.level", "octet"),
        (Byte, "Byte.data", "octet"),
        (ParameterValue, "ParameterValue.byte_array_value", "sequence<octet>"),
        (ParameterDescriptor, "ParameterDescriptor.floating_point_range", "FloatingPointRange, 1>"),
        (Empty, "Empty", "no fields"),
    ],
)
def test_other_types_are_refused(kind, field, named):
    """By field and type."""
    with pytest.raises(InputError) as refusal:
        Template(kind())
    assert field in str(refusal.value) and named in str(refusal.value)


# --- topics of the monitor

ROBOTS = {
    "arm": lambda: dd.load_urdf(random_tree(4, joints=6)),
    "floating base": lambda: dd.load_urdf(random_tree(3, joints=5), floating_base=True),
    "base alone": lambda: dd.load_urdf(
        description("brick", link("brick", 2.0, (0, 0, 0.1), (1, 0, 0, 2, 0, 2))), True
    ),
    "no joints": lambda: dd.load_urdf(
        description("post", link("post", 2.0, (0, 0, 0.1), (1, 0, 0, 2, 0, 2)))
    ),
}
of_every_robot = pytest.mark.parametrize("name", ROBOTS)


@cache
def dynamics(name):
    """Return the dynamics of a robot."""
    return dd.DiagonalDynamics(ROBOTS[name]())


class Moment(NamedTuple):
    """A state's stamps and flags, and what the messages about it hold."""

    seed: int = 1
    newest: int = 5 * S
    age: int = S
    received: bool = False
    estimated: bool = False
    effort: bool = True
    friction: bool = True
    inverse: bool = True


moments = st.builds(
    Moment,
    st.integers(0, 2**32 - 1),
    st.integers(0, 2**31 * S - 1)
    | st.sampled_from((0, S - 1, S, 2**31 * S - 1, 1_763_000_000 * S)),
    st.sampled_from((0, 1, S - 1, S, 10**6)),
    *[st.booleans()] * 5,
)


def arguments(name, moment):
    """Return what a message of each topic is made of: first of all the state."""
    dyn = dynamics(name)
    rng = np.random.default_rng(moment.seed)
    model = dyn.model
    q = rng.normal(size=model.nq)
    if model.floating_base:
        q[3:7] /= np.linalg.norm(q[3:7])
    qd, tau, r = rng.normal(size=(3, model.nv))
    effort = tau if moment.effort else None
    stamps = moment.newest, max(moment.newest - moment.age, 0)
    state = RobotState(q, qd, effort, *stamps, moment.received, moment.estimated)
    s = dyn.evaluate(q, qd, effort, friction=moment.friction)
    limits = dd.ContactLimits({"any": {"energy": 1.0}}, links={model.link_names[-1]: []})
    rows = [(link, link, ((0, 0, 0), (0.1, 0, 0))) for link in model.link_names]
    points = _points(
        name,
        model,
        tuple(rows) if moment.inverse else tuple(rows[-1:]),
        limits if moment.inverse else None,
    )
    links = [name for name in model.link_names if model.placement_in_body(name)[0] or not model.nv]
    scale = 10.0 ** rng.integers(-1, 2)
    result = None
    if moment.effort and model.nv:
        result = dyn.wrench(
            q,
            links[moment.seed % len(links)],
            tau,
            np.eye(model.nv),
            max_deviation=(10.0 * scale, scale),
        )
    seen = Disturbance(True, "", r, tau, float(np.linalg.norm(r)))
    seen = seen if moment.effort else Disturbance(False, "")
    limits = np.r_[np.abs(tau), INF, 1.0 + moment.age]
    alarming = Alarming(limits, 0.5 * limits, r > 0.0, moment.estimated, moment.received)
    touched = None
    if moment.effort and model.nv and moment.friction:
        touched = dyn.touched_link(q, tau, np.eye(model.nv) * 10.0 ** rng.integers(-2, 2))
    return {
        **{topic: (s, state) for topic in ORDER if topic not in MATRICES},
        **dict.fromkeys(MATRICES, (dyn, state, moment.inverse)),
        "contact_limits": (dyn.contact_limits(q, moment.effort * qd, points), state),
        "external_torque": (seen, state, alarming, touched),
        "external_wrench_estimates": (links[moment.seed % len(links)], result, state),
    } | ({"external_wrench": (links[0], result, state)} if result else {})


_POINTS = {}


def _points(name, model, rows, limits):
    """Return the same points each time: an encoder lays a message out once for each set of
    points.
    """
    return _POINTS.setdefault(
        (name, len(rows)), dd.ContactPoints(model, rows, *[limits] * (limits is not None))
    )


def encode(encoder, topic, of_it):
    """Return a topic's bytes."""
    if topic in MATRICES:
        return encoder.matrix(topic, *of_it)
    if topic not in ORDER:
        return getattr(encoder, topic)(*of_it)
    return encoder.evaluated(topic, *of_it)


@of_every_robot
def test_any_sequence_of_states(name):
    """One encoder for all topics: nothing of one message is left in another, nor does one change
    later.
    """

    @examples(15)
    @given(st.lists(moments, min_size=2, max_size=5))
    def check(sequence):
        maker, encoder = (
            kind(dynamics(name).model, revision=7) for kind in (MessageMaker, BytesMaker)
        )
        sent = []
        for moment in sequence:
            made = arguments(name, moment)
            for topic, of_it in made.items():
                sent.append((encode(encoder, topic, of_it), encode(maker, topic, of_it)))
        for raw, message in sent:
            same(raw, message)
        assert not encoder.unlike

    check()


OTHERWISE = {
    "big-endian": lambda raw: b"\0\0" + raw[2:],
    "XCDR2": lambda raw: b"\0\7" + raw[2:],
    "truncated": lambda raw: raw[:-8],
    "another number": lambda raw: raw[:8] + bytes([raw[8] ^ 1]) + raw[9:],
}


@pytest.mark.parametrize("otherwise", OTHERWISE.values(), ids=OTHERWISE)
def test_where_rclpy_serializes_otherwise(otherwise):
    """The messages themselves are sent, and the topic is named; other topics are not affected."""
    for topic in ORDER:
        maker, encoder = (kind(dynamics("arm").model, 7) for kind in (MessageMaker, BytesMaker))
        with mock.patch.object(
            messages, "serialize_message", lambda message: otherwise(serialize_message(message))
        ):
            for seed, effort in ((1, True), (2, True), (3, False)):
                of_it = arguments("arm", Moment(seed, effort=effort))[topic]
                assert repr(encode(encoder, topic, of_it)) == repr(encode(maker, topic, of_it))
        for other, of_it in arguments("arm", Moment()).items():
            assert (type(encode(encoder, other, of_it)) is bytes) == (other != topic)
        assert encoder.unlike == {topic}


# --- from bytes to bytes

URDF = TwoLinkArm(I1=0.02).urdf.replace(
    "</joint>", '<dynamics damping="0.3" friction="0.2"/></joint>'
)


def monitored(description=URDF, **parameters):
    """Return the robot of a monitor."""
    values = DEFAULTS | {"max_age": 0.0, "plausibility.jump": 0.0} | parameters
    return MonitoredRobot(description, model_of(description, values), Settings.of(values), 1)


def test_file_that_is_gone(tmp_path):
    """A robot of a file needs it no longer once it is loaded."""
    path = tmp_path / "arm.urdf"
    path.write_text(URDF, encoding="utf-8")
    robot = monitored(str(path))
    path.unlink()
    s, _ = robot.evaluate(RobotState(np.zeros(2), np.ones(2), None, NOW, NOW, False))
    assert robot.markers(s).markers
    model = robot.model.with_payload("upper", 2.0)
    robot.use(model, robot.settings, 2)
    assert robot.model is model


def test_friction_power():
    """It is that of the term of the equations of motion."""
    robot = monitored()
    joints = {"elbow": {"effort_offset": 0.7, "load_friction": 0.1, "root_friction": 0.2}}
    robot.use(robot.model.with_parameters({"joints": joints}), robot.settings, 2)
    q = np.array([0.3, -0.2])
    qd = np.array([1.0, -0.5])
    s, _ = robot.evaluate(RobotState(q, qd, None, NOW, NOW, False))
    friction = robot.dynamics.friction_torque(qd, q)
    assert robot.friction_power(s) == pytest.approx(qd @ friction, rel=1e-12)


def test_flexible_joints(tmp_path):
    """Joints of which only the motor is known are named."""
    spring = {"stiffness": 200.0, "rotor_inertia": 1e-4, "gear": 50.0}
    flexible = {"shoulder": spring | {"effort": "spring"}, "elbow": spring}
    dd.Parameters.from_dict({"flexible_joints": flexible}).save(tmp_path / "arm.yaml")
    robot = monitored(parameters_file=str(tmp_path / "arm.yaml"))
    values = model_status(robot, 1, None, None).values
    assert values["flexible joints taken as rigid"] == "1: elbow"


# --- bytes that are read without rclpy


def some_joint_state(rng):
    """Return a JointState of any names and lengths."""
    message = JointState(
        name=[str(rng.choice(["", "a", "joint_7", "€𝄞", "x" * 40])) for _ in range(rng.integers(4))]
    )
    message.header.frame_id = str(rng.choice(["", "base", "world/€"]))
    message.header.stamp.sec = int(rng.integers(-(2**31), 2**31))
    for field in ("position", "velocity", "effort"):
        setattr(message, field, rng.normal(size=rng.integers(4)).tolist())
    return message


def mutated(raw, rng):
    """Return these bytes with one or two faults."""
    data = bytearray(raw)
    for _ in range(rng.integers(1, 3)):
        kind = rng.integers(5)
        at = int(rng.integers(len(data))) if data else 0
        if kind == 0 and data:
            data[at] = rng.integers(256)
        elif kind == 1 and len(data) > 1:
            data[1] = rng.integers(3)  # the encoding
        elif kind == 2:
            del data[at : at + rng.integers(1, 99)]
        elif kind == 3:
            data[at:at] = rng.bytes(rng.integers(1, 9))
        elif len(data) > 8:  # a count, perhaps
            at -= at % 4
            data[at : at + 4] = int(rng.choice([0, 1, 2, 5, 1000, 2**31, 2**32 - 1])).to_bytes(
                4, "little"
            )
    return bytes(data)


def columns_of(names, sec, nanosec, *fields):
    """Return the content of a joint state, in which NaN is equal to itself."""
    return list(names), sec, nanosec, *(np.array(field, dtype=float).tobytes() for field in fields)


def test_read_as_rclpy_reads():
    """Good bytes of plain CDR and damaged ones: the same values, or an error."""
    rng = np.random.default_rng(1)
    result = Counter()
    count = shortened(20_000, 1500)
    for k in range(count):
        raw = serialize_message(some_joint_state(rng))
        raw = mutated(raw, rng) if k % 50 else raw
        raw = raw[:2] + bytes(2) + raw[4:]  # options, from which Kilted takes the padding
        try:
            message = deserialize_message(raw, JointState)
            stamp = message.header.stamp
            values = message.position, message.velocity, message.effort
            expected = columns_of(message.name, stamp.sec, stamp.nanosec, *values)
        except Exception:
            expected = None
        try:
            part = find_places(raw).read(np.frombuffer(raw, np.uint8)[None], np.zeros(1, int))
            fields = part.position[0], part.velocity[0], part.effort[0]
            actual = columns_of(part.names, part.sec[0], part.nanosec[0], *fields)
        except ValueError:
            actual = None
        assert actual == (None if raw[1:2] > b"\1" else expected), raw.hex()
        result["refused" if expected is None else "read"] += 1
    assert result["read"] > count // 5 and result["refused"] > count // 10


IN_IDL = {"bool": "boolean", "byte": "octet", "float32": "float", "float64": "double"}


def idl(parsed):
    """Return rosidl's name of a type that rosbags has parsed."""
    node, what = parsed
    if node == Nodetype.BASE:
        return IN_IDL.get(what[0], what[0])
    if node == Nodetype.NAME:
        return what.replace("/msg/", "/")
    element, count = what
    return f"sequence<{idl(element)}>" if node == Nodetype.SEQUENCE else f"{idl(element)}[{count}]"


INPUTS = ("sensor_msgs/msg/JointState", "nav_msgs/msg/Odometry")


@pytest.mark.parametrize(
    "name", [*INPUTS, *(f"diag_dynamics/msg/{kind.__name__}" for kind in OURS)]
)
def test_definitions_equal_those_of_ros(name):
    """Of each message and of all in it, as another library understands the text."""
    types = get_types_from_msg(definition_with_parts(name), name)
    assert name in types
    for entry, (_, fields) in types.items():
        package, _, part = entry.split("/")
        declared = getattr(
            importlib.import_module(f"{package}.msg"), part
        ).get_fields_and_field_types()
        assert [(field, idl(parsed)) for field, parsed in fields] == list(declared.items()), entry
