# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rules of joint states: the decision table over every implementation."""

import gc
from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diag_dynamics.joint_states import decoding
from diag_dynamics.joint_states.assembler import StateAssembler
from diag_dynamics.joint_states.robot_joints import Joints, Options
from examples import examples
from joint_state_cases import CASES, TABLE
from joint_state_messages import MS, NAMES, NAN, NOW, S, joint_state, odometry
from joint_state_readers import READERS, Message, Reader, model, read_columns


def messages_of(steps):
    """Return the messages of steps."""
    return [Message(step.raw, step.now, step.odometry) for step in steps]


def expected_counts(steps):
    """Return the counters that steps raise."""
    counts = Counter("odometry received" if step.odometry else "received" for step in steps)
    counts.update(step.outcome for step in steps if step.outcome != "odometry")
    counts.update(counter for step in steps for counter in step.also)
    return dict(counts)


@pytest.mark.parametrize("rule", TABLE)
def test_table(rule):
    """Each message has the outcome, the counters, the words and the state that the table says."""
    for name, steps, parameters, robot in TABLE[rule]:
        result = READERS["bytes"](model(robot), parameters, messages_of(steps))
        assert result.counts == expected_counts(steps), name
        published = [step.state for step in steps if step.outcome.startswith("published")]
        for state, expected in zip(result.states, published, strict=True):
            for field, value in expected.items():
                assert_equal(getattr(state, field), value, f"{name}: {field}")
        rejected = first_of_each([step for step in steps if "rejected" in step.outcome])
        for (cause, text), step in zip(result.rejections, rejected, strict=True):
            assert cause == step.outcome, name
            for word in step.words:
                assert word in text, name


@st.composite
def streams(draw):
    """Draw a robot, parameters of some of its cases, and messages of others at changed times."""
    robot = draw(st.sampled_from(("arm", "wheel", "floating")))
    cases = [case for case in CASES if case.robot == robot]
    parameters = draw(st.sampled_from(cases)).parameters | draw(st.sampled_from(cases)).parameters
    steps = st.sampled_from([step for case in cases for step in case.steps[:5]])
    delays = st.sampled_from((0, 0, 1, 5 * MS, 2 * S))
    messages = []
    delay = 0
    for step in draw(st.lists(steps, min_size=5, max_size=40)):
        delay += draw(delays)
        messages.append(Message(step.raw, step.now + delay, step.odometry))
    return model(robot), parameters, messages


@examples(100)
@given(streams())
def test_readers_agree(stream):
    """Bytes of messages, and columns in one or several pieces have equal outcomes."""
    expected, *results = (read(*stream) for read in READERS.values())
    for result in results:
        assert result == expected


def first_of_each(steps, count=20):
    """Return the first steps of each outcome."""
    return [
        step
        for k, step in enumerate(steps)
        if [s.outcome for s in steps[:k]].count(step.outcome) < count
    ]


def assert_equal(actual, expected, what):
    """Compare a number, or vectors up to rounding of estimates."""
    if isinstance(expected, list):
        np.testing.assert_allclose(actual, expected, rtol=1e-9, atol=1e-9, err_msg=what)
    else:
        assert actual == expected, what


def test_efforts_without_gravity():
    """Recordings add m g l sin q to efforts that lack gravity, and nothing to those of a floating
    base.
    """
    lacking = {"effort_includes_gravity": ["*=false"]}
    drive = Message(joint_state(("drive",), [0.7], [0.0], [2.0]), NOW)
    (state,) = read_columns(model("wheel"), lacking, [drive]).states
    assert state.effort == pytest.approx(
        [2.0 + 2.0 * 9.81 * 0.5 * np.sin(0.7)]
    )  # with the mimic joint's link
    joint = Message(joint_state(("shoulder",), [0.3], [0.0], [2.0]), NOW)
    (state,) = read_columns(
        model("floating"), lacking, [Message(odometry(), NOW, True), joint]
    ).states
    assert state.effort == pytest.approx([0.0] * 6 + [2.0 + 9.81 * 0.5 * np.sin(0.3)])


# --- rejected messages

ACCEPTED = "stale joint", "stale odometry"
"""Causes of states that are rejected, while the message itself is accepted."""

SUSPECTS = (
    "late",
    "stamp from the past",
    "stamp from the future",
    "foreign time",
    "jump",
    "interleaved sources",
)
"""Causes of messages that time, a clock or the robot may turn out to have followed."""

TURNED = "time jumped back", "positions jumped"
"""Counters of messages that confirm this."""

NAMED = "received", "odometry received"
"""Counters that rejected messages may raise, or keep from being raised, for themselves and
others.
"""


def rejections(robot, parameters, messages):
    """Return the place and the cause of each rejected message."""
    reader = Reader(model(robot), parameters)
    result = []
    for k, message in enumerate(messages):
        before = Counter(reader.counts)
        reader.read(message)
        causes = [name.partition("rejected: ")[2] for name in Counter(reader.counts) - before]
        result += [(k, cause) for cause in causes if cause and cause not in ACCEPTED]
    return result


def assert_no_trace(robot, parameters, messages, k, cause):
    """Compare outcomes of a sequence with and without message k, which is rejected."""
    end = k + 2 if cause in SUSPECTS else len(messages)

    def read(messages):
        result = READERS["bytes"](model(robot), parameters, messages)
        counts = {name: count for name, count in result.counts.items() if name not in NAMED}
        return result.states, Counter(counts)

    states, counts = read(messages[:k] + messages[k + 1 : end])
    if cause in SUSPECTS:
        before, count = read(messages[:k])
        if len(states) == len(before) or any(counts[name] > count[name] for name in TURNED):
            return
    actual, found_counts = read(messages[:end])
    assert actual == states
    found_counts.subtract(
        [name for name in found_counts if name.endswith(f"rejected: {cause}")][:1]
    )
    assert +found_counts == counts


def test_rejected_messages_leave_no_trace():
    """The message after a rejected one has the outcome and the state that it has without it."""
    for case in CASES:
        messages = messages_of(case.steps[:30])
        first = {}
        for k, cause in rejections(case.robot, case.parameters, messages):
            first.setdefault(cause, k)
        for cause, k in first.items():
            try:
                assert_no_trace(case.robot, case.parameters, messages, k, cause)
            except AssertionError as error:
                raise AssertionError(f"{case.name}: message {k}, {cause}") from error


# --- change of parameters and memory


def test_parameters_that_change():
    """They count from the next message on; estimates are forgotten where they are no longer
    made.
    """
    reader = Reader(model("arm"), {"missing_velocity": "estimate", "velocity_filter_time": 0.0})

    def outcome(k, velocity=(), position=(0, 0, 0), names=NAMES, **parameters):
        if parameters:
            reader.configure(parameters)
        before = Counter(reader.result().counts)
        raw = joint_state(names, position[: len(names)], velocity, (), NOW + k * MS)
        reader.read(Message(raw, NOW + k * MS))
        (result,) = (Counter(reader.result().counts) - before).keys() - {"received"}
        return result

    assert [outcome(0), outcome(1)] == ["awaiting velocity", "published"]
    assert (
        outcome(2, [0.0], names=("shoulder",), missing_velocity="reject") == "rejected: no velocity"
    )
    assert outcome(3, [0.6] * 3) == outcome(4, [0.6] * 3) == "published"
    slow = {"plausibility__beyond_velocity": 0.1}  # 0.6 rad/s of the shoulder, 0.3 of the elbow
    assert outcome(5, [0.6] * 3, **slow) == "rejected: implausible value"
    assert outcome(6, [0.6] * 3, plausibility__beyond_velocity=0.0) == "published"
    assert outcome(7, [0.6] * 3, [0, 0, 3], plausibility__jump=0.1) == "rejected: jump"
    assert outcome(8, [0.6] * 3, [0, 0, 3], plausibility__jump=0.0) == "published"
    assert (
        outcome(400, [0.6], names=("shoulder",), joint_timeout=["*=0.3"]) == "rejected: stale joint"
    )
    assert (
        outcome(401, missing_velocity="estimate", velocity_filter_time=0.0) == "awaiting velocity"
    )
    assert outcome(402) == "published"


def test_start_anew():
    """After a pause all joints have to arrive, and nothing of before is a jump, a step or a late
    stamp.
    """
    reader = Reader(
        model("arm"), {"plausibility.jump": 0.1, "missing_velocity": "estimate", "max_age": 1.0}
    )

    def read(stamp, names=NAMES, position=0.0, velocity=(0.0, 0.0, 0.0)):
        values = [position] * len(names), velocity[: len(names)], [1.0] * len(names)
        reader.read(Message(joint_state(names, *values, stamp), NOW))

    for k in range(3):
        read(NOW + 10 * k * MS, velocity=())
    assembler = reader.assembler
    assert assembler.estimated == list(NAMES) and assembler.newest == NOW + 20 * MS
    assert assembler.stale(NOW + 520 * MS) == [] and assembler.stale(NOW + 520 * MS + 1) == list(
        NAMES
    )
    assembler.forget()
    assert assembler.missing == list(NAMES) and assembler.newest == 0
    assert assembler.estimated == assembler.stale(NOW + S) == assembler.without_effort == []
    read(NOW, NAMES[:2], position=3.0)
    assert assembler.missing == ["wrist"] and reader.result().counts["incomplete"] == 1
    read(NOW, ("wrist",), position=3.0)
    assert reader.result().counts["published"] == 3
    read(NOW + MS, velocity=(NAN,) * 3, position=3.0)
    assert reader.result().counts["awaiting velocity"] == 2
    read(NOW - 50 * S, position=3.0)
    assert reader.result().counts["rejected: stamp from the past"] == 1
    assembler.forget()
    assembler.forget_clock()
    read(NOW - 50 * S, position=5.0)
    assert reader.result().counts["published"] == 4 and assembler.in_step is False
    assert assembler.offset == pytest.approx(50.0)


def test_clock_offset():
    """The offset is that of the last accepted stamp, whether or not a state is complete; others do
    not change it.
    """
    reader = Reader(model("arm"), {"max_age": 1.0})

    def offset(names, stamp, position=1.0, now=NOW):
        reader.read(Message(joint_state(names, *[[position] * len(names)] * 2, (), stamp), now))
        return reader.assembler.offset

    assert offset(NAMES, NOW - 50 * S) == 50.0
    assert offset(("gripper",), NOW - 7 * S) == 50.0
    assert offset(NAMES, NOW - 8 * S, position=NAN) == 50.0
    assert offset(NAMES, NOW - 9 * S, now=0) == 50.0
    assert offset(NAMES, 0) == 50.0
    assert offset(("thumb",), NOW - 5 * S) == 5.0
    assert offset(("wrist",), NOW - 4 * S) == 4.0
    assert reader.result().counts["rejected: stale joint"] == 1


def test_states_are_copies():
    """A state does not change with later messages, nor they with it."""
    reader = Reader(model("arm"), {})

    def read(*fields):
        return reader.accept(Message(joint_state(*fields), NOW)).state

    states = [read(NAMES, [k] * 3, [1] * 3, [k] * 3, NOW + k) for k in range(3)]
    states[1].position[:] = states[1].effort[:] = NAN
    states.append(read(("wrist",), [3], [1], [3], NOW + 3))
    assert [state.position[0] for state in (states[0], *states[2:])] == [0, 2, 2]
    assert states[3].effort.tolist() == [2, 2, 3]


def test_interleaved_layouts_of_one_length_are_read_once():
    """Two publishers with other orders of names: each message is in one part."""
    raw = [
        joint_state(names, *[[k] * 3] * 3, NOW + k)
        for k in range(4)
        for names in (NAMES, NAMES[::-1])
    ]
    size = np.array([len(entry) for entry in raw])
    data = np.frombuffer(b"".join(raw), np.uint8)
    parts, errors = decoding.Decoder().decode(data, np.cumsum(size) - size, size, np.arange(8))
    assert [part.rows.tolist() for part in parts] == [[0, 2, 4, 6], [1, 3, 5, 7]] and not errors
    assert all(part.position[:, 0].tolist() == [0, 1, 2, 3] for part in parts)


def test_the_text_of_a_displaced_robot_has_both_positions():
    assembler = StateAssembler(Joints(("hip",)), Options(jump=0.1))
    for k, position in enumerate((0.0, 2.0, 2.0, 2.0)):
        assembler.accept_values(
            ("hip",), 1, k * MS, [np.array([position]), np.zeros(1), np.zeros(0)], 0
        )
    assert assembler.last_texts == {"positions jumped": "joint 'hip': position jumped from 0 to 2"}


def test_long_messages_fill_no_memory():
    """Places of messages, their layouts and names are kept up to a length, whatever names are sent;
    all are judged.
    """
    reader = Reader(model("arm"), {})

    def read(name, length):
        names = (*NAMES, name * (length // len(name)))
        reader.read(Message(joint_state(names, *[[0.0] * 4] * 3, NOW), NOW))

    for k in range(50):
        read(f"joint {k:04}", decoding.MAX_BYTES // 5)
        read(f"joint {k:04}", 2 * decoding.MAX_BYTES)
    places = [
        entry
        for entry in gc.get_objects()
        if type(entry) is decoding.Places and len(entry.names[-1]) > 1000
    ]
    assert 0 < sum(entry.length for entry in places) <= 2 * decoding.MAX_BYTES
    lists = [entry for entry in gc.get_objects() if type(entry) is tuple and len(entry) == 4]
    texts = [
        entry[3]
        for entry in lists
        if all(type(name) is str for name in entry) and entry[:3] == NAMES
    ]
    assert len({id(text) for text in texts if len(text) > 1000}) <= 12
    assert list(reader.assembler.arrived) == list(NAMES)
    assert reader.result().counts["published"] == 100
