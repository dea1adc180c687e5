# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joint states as bytes: whatever comes, all is as if each had been deserialized and taken in by an assembler."""

import contextlib
import math
import os
import random
import resource
import struct
import subprocess
import sys
from collections import Counter
from itertools import pairwise
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from test_joint_states import CONTINUOUS, LIMITS, MIMICS, NAMES, journeys, set_clocks, some_options

from diag_dynamics.assembly.assembler import Joints, JointStateAssembler, Options
from diag_dynamics.assembly.rejected import RejectedError
from diag_dynamics.nodes.support.reading import read_joint_state
from diag_dynamics.wire.joint_states import FREELY, LONGEST, MOST_LAYOUTS, SELDOM, KnownJointStates
from examples import examples, some_of
from nodes import MS, S, joint_state

NOW = 77 * S
LOWER, UPPER = np.array([LIMITS[name] for name in NAMES]).T
JOINTS = Joints(
    NAMES, MIMICS, CONTINUOUS, LOWER, UPPER, np.array([5.0, math.inf, 0.0]), np.array([100.0, 0.0, math.inf])
)
TURNING = JOINTS._replace(continuous=(*CONTINUOUS, "pinky"))
UNCOUPLED = Joints(NAMES)


class Twins:
    """The same assembler twice: one takes messages in, the other their bytes."""

    def __init__(self, joints=JOINTS, **options):
        """Make both of them."""
        self.ordinary, self.assembler = (JointStateAssembler(joints, Options(**options)) for _ in range(2))
        self.deserialize = mock.Mock(wraps=read_joint_state)
        self.known = KnownJointStates(self.assembler, self.deserialize)
        self.states = []
        self.at_once = False  # whether the last one was not deserialized

    def both(self, change):
        """Do something to both, as the monitor does."""
        for assembler in (self.ordinary, self.assembler):
            change(assembler)
        self.known.configure()

    def configure(self, **options):
        """Change some options."""
        self.both(lambda assembler: assembler.configure(assembler.options._replace(**options)))

    def update(self, raw, now=NOW):
        """Let both take a message in, of which nothing must differ; return what became of it."""
        raw = raw if isinstance(raw, bytes) else serialize_message(raw)
        try:
            message = deserialize_message(raw, JointState)
        except Exception:
            expected = None
        else:
            expected = outcome(self.ordinary.update, message, now)
        self.deserialize.reset_mock()
        actual = outcome(self.known.update, raw, now)
        self.at_once = not self.deserialize.called
        if expected is None:
            assert actual[:2] == ("rejected", "malformed")
            assert "joint_states: " in actual[2]
        else:
            assert actual == expected
        assert memory(self.assembler) == memory(self.ordinary)
        for at in (now, now + S // 2, now + 9 * S):
            assert self.assembler.stale(at) == self.ordinary.stale(at)
        return actual

    def update_at_once(self, raw, now=NOW):
        """Likewise; the message must not be deserialized."""
        what = self.update(raw, now)
        assert self.at_once
        return what


def outcome(update, message, now):
    """Return what becomes of a message, in which equal is equal to the last bit."""
    try:
        state = update(message, now)
    except RejectedError as rejection:
        return "rejected", rejection.cause, str(rejection)
    if state is None:
        return "none"
    vectors, times = state[:3], state[3:]
    assert [type(one) for one in times] == [int, int, bool, bool]
    assert all(one.dtype == np.float64 and one.shape == state.position.shape for one in vectors if one is not None)
    return "state", [None if one is None else one.tobytes() for one in vectors], times


OF_JOINTS = ("_position", "_velocity", "_effort", "_stamp", "_known", "_without_stamp", "_estimated")
OF_FOLLOWERS = ("_follower_effort", "_follower_stamp")
SAID = ("counts", "last_disagreement", "missing", "without_effort", "estimated", "newest", "options")


def memory(assembler):
    """Return all that an assembler knows, as texts and numbers, in which NaN is equal to itself."""
    arrays = {name: repr(getattr(assembler, name).tolist()) for name in OF_JOINTS + OF_FOLLOWERS}
    said = {name: getattr(assembler, name) for name in SAID}
    rest = {"estimator": repr(vars(assembler._estimator)), "jumps": repr(vars(assembler.jumps))}
    return arrays | said | vars(assembler.stamps) | rest


# --- what is taken in without deserialization


def good(stamp, names=NAMES, frame="", effort=True, shift=0.0):
    """Return a message in which all joints are within all limits, and followers in their places."""
    position = {name: shift + 0.25 * k for k, name in enumerate((*NAMES, "lid"))}
    position |= {name: m * position[leader] + offset for name, (leader, m, offset) in MIMICS.items()}
    values = np.array([position[name] for name in names])
    message = joint_state(names, values, 0.5 + values, 2.0 * values if effort else (), stamp)
    message.header.frame_id = frame
    return message


ORDERS = {
    "in order": NAMES,
    "in another order": NAMES[::-1],
    "among others": ("lid", "wrist", "shoulder", "elbow"),
    "with followers": ("heel", "wrist", "thumb", "shoulder", "elbow"),
}


@pytest.mark.parametrize("effort", [True, False], ids=["effort", "no effort"])
@pytest.mark.parametrize("names", ORDERS.values(), ids=ORDERS)
def test_a_known_text_is_not_deserialized(names, effort):
    """From the second message on, however joints are listed; of each the state is as ever."""
    twins = Twins(mimic_tolerance=0.01)
    assert twins.update(good(1 * S, names, "arm", effort))[0] == "state"
    assert not twins.at_once
    for k in range(1, 20):
        what = twins.update_at_once(good(S + 10 * k * MS, names, "arm", effort, 0.01 * k))
        assert (what[1][2] is None) == (not effort)
        assert what[2] == (S + 10 * k * MS, S + 10 * k * MS, False, False)


def test_several_publishers_are_known():
    """Each brings some of the joints; together they bring states."""
    twins = Twins(mimic_tolerance=0.01)
    parts = [("elbow", "shoulder"), ("wrist", "thumb", "pinky")]
    for k in range(10):
        for j, names in enumerate(parts):
            what = twins.update(good(S + (10 * k + j) * MS, names, shift=0.01 * k))
            assert what == "none" if (k, j) == (0, 0) else what[0] == "state"
            assert twins.at_once == (k > 0)


@pytest.mark.parametrize(("max_age", "behind"), [(0.0, 0), (0.0, 60 * S), (1.0, S), (1.0, -S), (1.0, 60 * S)])
def test_known_by_any_clock(max_age, behind):
    """In step with this node's clock, at the bound even, or of another time."""
    twins = Twins(max_age=max_age)
    twins.update(good(100 * S), 100 * S + behind)
    for k in range(1, 5):
        twins.update_at_once(good(100 * S + k * MS), 100 * S + k * MS + behind)
    assert twins.assembler.stamps.in_step is (None if not max_age else abs(behind) <= S)


def test_states_are_copies():
    """A state does not change with what comes later, nor what comes later with it."""
    twins = Twins(UNCOUPLED)
    states = [twins.known.update(serialize_message(good(S + k * MS, shift=k)), NOW) for k in range(5)]
    states[2].effort[:] = math.nan
    states += [twins.known.update(serialize_message(good(S + 9 * MS, GRIPPER)), NOW)]
    assert [state.position[0] for state in states] == [0, 1, 2, 3, 4, 4]
    assert [state.effort[0] for state in states[3:]] == [6, 8, 8]


ARM, GRIPPER = ("shoulder", "elbow"), ("wrist",)


def with_field(field, place, value):
    """Return a change of one number of a message."""

    def change(message):
        getattr(message, field)[place] = value

    return change


def with_fields(**fields):
    """Return a change of fields of a message."""

    def change(message):
        for field, value in fields.items():
            setattr(message, field, value)

    return change


def with_stamp(sec, nanosec):
    """Return a change of a message's stamp."""

    def change(message):
        message.header.stamp.sec, message.header.stamp.nanosec = sec, nanosec

    return change


ALL = ("heel", *NAMES)
UNUSUAL = {
    "position that is none": with_field("position", 2, math.nan),
    "infinite position": with_field("position", 2, -math.inf),
    "position beyond its limit": with_field("position", 2, 4.6),
    "velocity that is none": with_field("velocity", 1, math.nan),
    "infinite velocity": with_field("velocity", 1, math.inf),
    "absurd velocity": with_field("velocity", 1, -20.1),
    "velocity beyond its limit": with_field("velocity", 1, -15.1),
    "effort beyond its limit": with_field("effort", 1, -400.1),
    "jump": with_field("position", 1, 0.5),
    "infinite effort": with_field("effort", 1, math.inf),
    "absurd effort": with_field("effort", 1, -1000.1),
    "absurd effort of a follower": with_field("effort", 0, 1000.1),
    "infinite effort of a follower": with_field("effort", 0, -math.inf),
    "follower astray": with_field("position", 0, 9.0),
    "no stamp": with_stamp(0, 0),
    "negative stamp": with_stamp(-1, 5),
    "too many nanoseconds": with_stamp(100, S),
    "nanoseconds that are negative as int32": with_stamp(100, 2**32 - 1),
    "late": with_stamp(99, S - 1),
    "from the past": with_stamp(5, 0),
    "from the future": with_stamp(200, 0),
    "another name": with_fields(name=["heel", "shoulder", "elbow", "lid"]),
    "names in another order": with_fields(name=list(ALL[::-1])),
    "a name twice": with_fields(name=["heel", "wrist", "elbow", "wrist"]),
    "no velocities": with_fields(velocity=[]),
    "too few positions": with_fields(position=[1.0]),
    "too many efforts": with_fields(effort=[1.0] * 5),
}


@pytest.mark.parametrize("change", UNUSUAL.values(), ids=UNUSUAL)
def test_whatever_is_unusual_is_deserialized(change):
    """It goes the ordinary way, and so do those after it as long as that is in doubt; in the end all is at once again."""
    bounds = {"max_velocity": 20.0, "max_effort": 1000.0, "beyond_limits": 0.5, "max_age": 10.0}
    bounds |= {"beyond_velocity": 3.0, "beyond_effort": 4.0, "jump": 0.1}
    twins = Twins(mimic_tolerance=0.01, **bounds)
    for k in range(2):
        twins.update(good(100 * S + k * MS, ALL), 100 * S)
    assert twins.at_once
    message = good(100 * S + 2 * MS, ALL)
    change(message)
    twins.update(message, 100 * S)
    assert not twins.at_once
    for k in range(3, 10):
        twins.update(good(100 * S + k * MS, ALL), 100 * S)
    assert twins.at_once


def test_jumps_at_the_edge():
    """Steps of about what is explained, one joint or all, known text or not: taken, refused and believed alike."""
    rng, twins = np.random.default_rng(0), Twins(jump=0.1, beyond_velocity=3.0)
    position, stamp, seen = np.zeros(3), S, Counter()
    for _ in range(400):
        elapsed = int(rng.choice([0, MS, 10 * MS, 49 * MS, 51 * MS, 499 * MS, 501 * MS]))
        stamp += elapsed
        velocity = rng.uniform(-4.0, 4.0, 3)
        step = (2.0 * np.abs(velocity) * max(1e-9 * elapsed, 0.01) + 0.1) * rng.choice([-1.1, -0.5, 0.5, 1.02, 1.5], 3)
        moved = position + step * (rng.random(3) < 0.4) + rng.choice([0.0, 2 * math.pi], 3, p=[0.95, 0.05])
        moved = np.clip(moved, -3.0, 3.0)
        names = NAMES if rng.random() < 0.8 else NAMES[:2]
        what = twins.update(joint_state(names, moved[: len(names)], velocity[: len(names)], (), stamp))
        seen[what[1] if what[0] == "rejected" else what[0], twins.at_once] += 1
        if what[0] == "state" or rng.random() < 0.8:
            position = moved
    believed = twins.assembler.counts["positions jumped"]
    assert seen["state", True] > 50 and seen["jump", False] > 20 and believed and not seen["jump", True]


def test_what_is_not_known_of_an_effort_is_nothing_unusual():
    """NaN is how a driver says so."""
    twins = Twins()
    twins.update(good(S, ALL))
    for place in range(4):
        message = good(S + MS, ALL)
        with_field("effort", place, math.nan)(message)
        assert (twins.update_at_once(message)[1][2] is None) == (place > 0)


def test_to_the_nanosecond():
    """The same stamp again is as good as a later one; an earlier one is late."""
    twins = Twins()
    twins.update(good(S))
    twins.update_at_once(good(S))
    assert twins.update(good(S - 1))[1] == "late"


def test_efforts_of_followers_age():
    """They count as long as they are within the timeout of the newest joint, whoever sends them."""
    twins = Twins()
    twins.update(good(S))
    twins.update(joint_state(["heel"], (), (), [20.0], S))
    own = {}
    for stamp in (S, S + 500 * MS, S + 500 * MS + 1):
        own[stamp] = np.frombuffer(twins.update_at_once(good(stamp))[1][2])[1]
    assert list(own.values()) == [10.5, 10.5, 0.5]


def test_followers_of_a_leader_of_another_message():
    """They are compared if that is fresh, by its own timeout, be it older or newer; else all is well."""
    parts = ("thumb", "shoulder", "elbow"), ("wrist",)
    twins = Twins(mimic_tolerance=0.01, timeout=2.0, timeouts={"wrist": 0.25})
    for k in range(2):
        for names in parts:
            twins.update(good(S + k * MS, names))
    for ahead, fresh in ((-250 * MS, True), (-100 * MS, True), (250 * MS, True), (250 * MS + 1, False)):
        stamp = 10 * S + abs(ahead)
        twins.both(JointStateAssembler.forget)
        for names in parts:
            twins.update(good(9 * S, names))
        twins.update(good(stamp + ahead, parts[1]))
        message = good(stamp, parts[0])
        twins.update_at_once(message)
        message.position[0] = 9.0
        twins.update(message)
        assert twins.at_once == (not fresh)
        message.position[0] = math.inf  # which says nothing
        twins.update_at_once(message)


def test_other_texts_are_learned():
    """Names, frames and lengths may change; each is known from its second message on, and none is forgotten for it."""
    twins = Twins()
    texts = [{"names": names, "effort": effort} for names in ORDERS.values() for effort in (True, False)]
    texts += [{"frame": "base"}, {"frame": "link"}]
    for turn in range(3):
        for k, text in enumerate(texts):
            twins.update(good(S + (100 * turn + k) * MS, **text))
            assert twins.at_once == (turn > 0)


def test_nothing_is_taken_at_once_that_takes_more():
    """Velocities that are to be estimated, a clock of zero, followers that turn round."""
    for joints, now, options in (
        (JOINTS, NOW, {"estimate_velocity": True}),
        (JOINTS, 0, {}),
        (TURNING, NOW, {"mimic_tolerance": 0.01}),
    ):
        twins = Twins(joints, **options)
        for k in range(4):
            twins.update(good(S + k * MS), now)
            assert not twins.at_once
        twins.configure(estimate_velocity=False, mimic_tolerance=0.0)
        twins.update(good(2 * S), NOW)
        twins.update_at_once(good(2 * S + MS))


def test_options_that_change():
    """They count from the next message on."""
    twins = Twins()
    twins.update(good(S))
    for k, options in enumerate(
        ({"max_velocity": 0.6}, {"max_velocity": 0.0}, {"max_position": 0.4}, {"max_position": 0.0, "max_effort": 0.9})
    ):
        twins.configure(**options)
        twins.update(good(S + k * MS))
        assert twins.at_once == (k == 1)
    twins.configure(max_effort=0.0, effort_scale={"*": -2.0}, effort_available={"elbow": False})
    twins.update_at_once(good(2 * S))
    twins.configure(timeouts={"wrist": 0.2}, effort_available={}, timeout=0.0)
    twins.update_at_once(good(2 * S))
    twins.update_at_once(good(2 * S, NAMES))
    assert twins.update(good(3 * S, ARM))[1] == "stale joint"


def texts_of(twins):
    """Return how many texts are known."""
    return sum(map(len, twins.known._layouts.values()))


def test_texts_are_bounded():
    """A frame that changes all the time fills no memory, and after a while is learned but seldom; one that stays, still."""
    twins = Twins()
    most, learned = 0, []
    for k in range(FREELY + 20):
        twins.update(good(S + 2 * k * MS, frame=f"frame {k}"))
        assert not twins.at_once
        twins.update(good(S + (2 * k + 1) * MS, frame=f"frame {k}"))
        learned.append(twins.at_once)
        most = max(most, texts_of(twins))
    assert most == MOST_LAYOUTS
    assert sum(learned[:FREELY]) >= 0.95 * FREELY  # not while all places are taken by what has just been there
    assert sum(learned[FREELY:]) <= 5
    for k in range(20 * SELDOM):  # which one is learned is left to chance
        twins.update(good(9 * S + 2 * k * MS))
        twins.update(good(9 * S + (2 * k + 1) * MS, frame=f"another {k}"))
    twins.update_at_once(good(99 * S))


def test_texts_that_come_are_not_thrown_away():
    """However many others come and go in between."""
    twins = Twins()
    for k in range(3 * MOST_LAYOUTS):
        twins.update(good(S + 2 * k * MS))
        assert twins.at_once == (k > 0)
        twins.update(good(S + (2 * k + 1) * MS, frame=f"frame {k}"))


def test_a_suspect_slows_nobody_else():
    """A late message of some joints leaves those alone that list all of them."""
    twins = Twins()
    for k in range(3):
        twins.update(good(S + k * MS))
    assert twins.update(good(S, NAMES[2:3]))[1] == "late"
    for k in range(4, 9):
        twins.update_at_once(good(S + k * MS))


@pytest.mark.parametrize("names", [("lid",), ("thumb", "heel")], ids=["another robot", "followers"])
def test_what_brings_no_state_does_not_exhaust_what_is_learned(names):
    """Nor does a text that is never taken in at once, however often it comes."""
    twins = Twins()
    for k in range(FREELY + 20):
        twins.update(good(S + k * MS, names))
        assert not twins.at_once
    twins.update(good(9 * S))
    twins.update_at_once(good(9 * S + MS))


def test_long_messages():
    """Of more joints than there was room for at first."""
    names = tuple(f"joint {k}" for k in range(200))
    twins = Twins(Joints(names))
    for k, some in enumerate((names[:3], names[:100], names, names[:3], names[:100], names)):
        what = twins.update(joint_state(some, *np.random.default_rng(k).normal(size=(3, len(some))), stamp=S + k * MS))
        assert what[0] == "state" if k > 1 else what == "none"
        assert twins.at_once == (k > 2)


def test_messages_that_are_too_long_to_be_known():
    """Their size is the sender's to choose: nothing of them is kept."""
    twins = Twins()
    for count in (1000, 3000):
        names = (*NAMES, *(f"joint {k}" for k in range(count)))
        for k in range(3):
            message = joint_state(names, *np.zeros((3, len(names))), stamp=S + (count + k) * MS)
            assert twins.update(message)[0] == "state"
            assert twins.at_once == (k > 0 and len(serialize_message(message)) <= LONGEST)
    assert texts_of(twins) == 1
    assert twins.known._size <= 2 * LONGEST


def test_stamps_as_large_as_they_get():
    """Up to the last second that a stamp can hold, and to the nanosecond."""
    twins = Twins(max_age=1.0)
    last = (2**31 - 1) * S + S - 1
    twins.update(good(last - 10), last)
    for behind in (7, 1, 0):
        assert twins.update_at_once(good(last - behind), last)[2][0] == last - behind


# --- any sequence


SPOILS = (*UNUSUAL.values(), with_fields(effort=[]), with_fields(name=[]), lambda message: None)
ODD = (math.nan, math.inf, -math.inf, 1e300, -0.0, 5.5, -7.0, 1e-320)
PARTS = (
    (NAMES,),
    (NAMES[::-1], ("lid", "wheel")),
    (("elbow", "shoulder"), ("wrist",)),
    (("thumb", "wrist", *ARM, "heel", "pinky"),),
    (("lid", *ARM, "heel"), ("pinky", "wrist", "thumb"), ("elbow",)),
    (NAMES, ("thumb", "heel")),
)


@st.composite
def broadcasts(draw):
    """Draw messages of a few publishers, each of whose are alike; some are spoiled. And changes before them."""
    parts = draw(st.sampled_from(PARTS))
    efforts = draw(st.sampled_from((True, True, False)))
    now = draw(st.sampled_from((300 * S, 1_763_000_000 * S + 123_456_789)))
    behind = draw(st.sampled_from((0, 0, 1, 400 * MS, -300 * MS, 60 * S)))
    spoiled = draw(st.sampled_from((0, 2, 6)))
    shift, journey = 0.0, []
    for _ in range(draw(st.integers(4, 30))):
        now += draw(st.sampled_from((MS, MS, 1, 0, 10 * MS, 200 * MS, 450 * MS)))
        shift += draw(st.sampled_from((0.0, 0.001, 0.1, -0.05)))
        names = draw(st.sampled_from(parts))
        position = {name: shift + 0.25 * k for k, name in enumerate((*NAMES, "lid", "wheel"))}
        position |= {name: m * position[leader] + offset for name, (leader, m, offset) in MIMICS.items()}
        values = np.array([position[name] for name in names])
        effort = 0.7 * values if efforts else ()
        message = joint_state(names, values, 3.0 * values, effort, max(now - behind, 0))
        clock, change = now, None
        if draw(st.integers(0, 9)) < spoiled:
            kind = draw(st.sampled_from(("number", "number", "stamp", "any", "clock", "change")))
            if kind == "number":
                field = getattr(message, draw(st.sampled_from(("position", "velocity", "effort"))))
                if field:
                    field[draw(st.integers(0, len(field) - 1))] = draw(st.sampled_from(ODD))
            elif kind == "stamp":
                stamp = now - behind + draw(st.sampled_from((-1, -10 * MS, -2 * S, 2 * S, 12 * S, -now + behind)))
                with_stamp(*divmod(max(stamp, 0), S))(message)
            elif kind == "any":
                with contextlib.suppress(IndexError):
                    draw(st.sampled_from(SPOILS))(message)
            elif kind == "clock":
                clock = draw(st.sampled_from((0, 0, now + 2 * S, now - 2 * S)))
                if clock == 0 and draw(st.booleans()):
                    with_stamp(0, 0)(message)
            else:
                change = draw(st.sampled_from(("forget", "forget clocks", "estimate", "refuse")) | all_options())
        journey.append((message, clock, change))
    return journey


def all_options():
    """Draw options; velocities are seldom estimated."""
    gravity = st.dictionaries(st.sampled_from((*NAMES, "*")), st.booleans(), max_size=2)
    return st.builds(
        lambda options, gravity, k: options._replace(
            effort_includes_gravity=gravity, estimate_velocity=options.estimate_velocity and k == 0
        ),
        some_options(),
        gravity,
        st.integers(0, 3),
    )


def follow(joints, options, journey):
    """Compare both ways of taking in, message by message; yield what became of each."""
    twins = Twins(joints, **options._asdict())
    for message, now, change in journey:
        if change == "forget":
            twins.ordinary.forget()  # of which nothing is said to who takes in bytes
            twins.assembler.forget()
        elif change == "forget clocks":
            twins.ordinary.stamps.forget()
            twins.assembler.stamps.forget()
        elif change in ("estimate", "refuse"):
            twins.configure(estimate_velocity=change == "estimate")
        elif change:
            twins.configure(**change._asdict())
        what = twins.update(message, now)
        yield "at once" if twins.at_once else what if what == "none" else what[1] if what[0] == "rejected" else "state"
        assert texts_of(twins) <= MOST_LAYOUTS


JOURNEYS = {"broadcasts": (broadcasts(), 400, 0.3), "clocks": (set_clocks(), 150, 0.02), "any": (journeys(), 150, 0.0)}


@pytest.mark.parametrize(("some", "count", "least"), JOURNEYS.values(), ids=JOURNEYS)
def test_any_sequence(some, count, least):
    """As bytes and as messages, all is the same after each, whatever came before; and many were taken in at once."""
    seen = Counter()

    @settings(examples(count), report_multiple_bugs=False)
    @given(st.sampled_from((JOINTS, JOINTS, TURNING, UNCOUPLED)), all_options(), some)
    def compare(joints, options, journey):
        if joints is UNCOUPLED:
            mappings = ("timeouts", "effort_available", "effort_scale")
            options = options._replace(**{mapping: {} for mapping in mappings})
            journey = [(*step[:2], None if isinstance(step[2], Options) else step[2]) for step in journey]
        seen.update(follow(joints, options, journey))

    compare()
    assert seen["at once"] >= least * seen.total(), seen
    if count == 400:
        stamps = ("malformed stamp", "no time", "stamp from the past", "stamp from the future", "foreign time", "late")
        values = ("wrong length", "duplicate name", "no position", "no velocity", "absurd value", "stale joint")
        assert not {*stamps, *values, "state", "none"} - set(seen), seen


# --- bytes that are no message, or another one than they seem


def encoded(message, order="<"):
    """Return the bytes of a JointState by the book, and where its lengths are."""
    out, lengths = bytearray(), []

    def put(kind, *values):
        size = struct.calcsize(kind)
        out.extend(bytes(-len(out) % size))
        out.extend(struct.pack(f"{order}{len(values)}{kind}", *values))

    def length(count):
        put("I", count)
        lengths.append(len(out))  # less the four bytes of this one, and the four before all

    put("i", message.header.stamp.sec)
    put("I", message.header.stamp.nanosec)
    length(len(message.header.frame_id) + 1)
    out.extend(message.header.frame_id.encode() + b"\0")
    length(len(message.name))
    for name in message.name:
        length(len(name) + 1)
        out.extend(name.encode() + b"\0")
    for values in (message.position, message.velocity, message.effort):
        length(len(values))
        if values:
            put("d", *values)
    return (b"\0\1\0\0" if order == "<" else b"\0\0\0\0") + bytes(out), lengths


def one(stamp=S, shift=0.0):
    """Return the message that is damaged."""
    return good(stamp, ("heel", "wrist", "shoulder", "elbow"), "arm", True, shift)


def with_byte(raw, place, byte):
    """Return bytes of which one is another."""
    return raw[:place] + bytes([byte]) + raw[place + 1 :]


def truncated():
    """Yield a message cut off at every length."""
    raw, _ = encoded(one())
    yield from (raw[:size] for size in range(len(raw)))


def overwritten():
    """Yield a message with every single byte another."""
    raw, _ = encoded(one())
    for place, byte in enumerate(raw):
        others = {0, 1, 2, 4, 5, 7, 8, 0x20, 0x7F, 0x80, 0xFF, byte ^ 1, byte ^ 0x80, (byte + 1) % 256} - {byte}
        yield from (with_byte(raw, place, other) for other in sorted(others))


def with_other_lengths():
    """Yield a message with every length another, of either byte order; and with several of them huge."""
    some = (0, 1, 2, 3, 4, 5, 6, 8, 12, 20, 100, 10**4, 10**6, 2**27, 2**28, 2**29, 2**30, 2**31 - 1, 2**31, 2**32 - 1)
    for order in "<>":
        raw, lengths = encoded(one(), order)
        for end in lengths:
            for value in some:
                yield raw[:end] + struct.pack(f"{order}I", value) + raw[end + 4 :]
                yield raw[:end] + struct.pack(f"{order}I", value)
        for end, after in pairwise(lengths):
            many = struct.pack(f"{order}I", 2**32 - 1)
            yield raw[:end] + many + raw[end + 4 : after] + many + raw[after + 4 :]


def with_other_encapsulations():
    """Yield a message that says to be encoded otherwise: parameter lists, XCDR2, anything; and with options."""
    for raw in (encoded(one(), "<")[0], encoded(one(), ">")[0]):
        for kind in range(256):
            yield bytes([0, kind]) + raw[2:]
            yield bytes([kind, raw[1]]) + raw[2:]
            yield raw[:2] + bytes([kind % 4, kind]) + raw[4:]


def with_more_after_it():
    """Yield a message after which there is more, up to a second one."""
    raw, _ = encoded(one())
    yield from (raw + bytes(size) for size in range(9))
    yield from (raw + b"\xff" * size for size in range(9))
    yield raw + raw
    yield raw + raw[4:]
    yield raw + bytes(100_000)


def at_random():
    """Yield random bytes, with and without a header, and messages with several random bytes."""
    rng = random.Random(1)
    raw, _ = encoded(one())
    for _ in range(400):
        yield rng.randbytes(rng.randrange(200))
        yield raw[:4] + rng.randbytes(rng.randrange(200))
        damaged = bytearray(raw)
        for _ in range(rng.randint(2, 5)):
            damaged[rng.randrange(len(raw))] = rng.choice((0, 1, 0x7F, 0xFF, rng.randrange(256)))
        yield bytes(damaged)


def with_odd_texts():
    """Yield messages with names that are not UTF-8, hold a zero, or do not end in one."""
    raw, lengths = encoded(one())
    for end in (lengths[0], *lengths[2:6]):
        size = struct.unpack_from("<I", raw, end)[0]
        for text in (b"\xff" * size, b"\0" * size, b"x" * size, b"\xc3" * (size - 1) + b"\0", b"\xed\xa0\x80" * size):
            yield raw[: end + 4] + text[:size] + raw[end + 4 + size :]


DAMAGES = {
    damage.__name__: damage
    for damage in (
        truncated,
        overwritten,
        with_other_lengths,
        with_other_encapsulations,
        with_more_after_it,
        at_random,
        with_odd_texts,
    )
}
ROOM = 1 << 30
"""How much more memory a process may take for what is damaged [bytes]; and a sixteenth of it, how much it may keep."""


def take_damaged(damage, trace):
    """Take damaged messages in, before and after the text is known; each is in the file `trace` meanwhile."""
    before, after = (encoded(one(S + k * MS, 0.001 * k))[0] for k in (0, 1))
    Twins().update(before)  # all that is loaded and compiled once
    in_use = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (in_use + ROOM, in_use + ROOM))
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    outcomes = Counter()
    with Path(trace).open("wb", buffering=0) as file:
        for raw in some_of(DAMAGES[damage](), 7):
            file.seek(0)
            file.truncate()
            file.write(repr(raw[:2000]).encode())
            for is_known in (False, True):
                twins = Twins()
                if is_known:
                    twins.update(before)
                    twins.update_at_once(before)
                what = twins.update(raw)
                outcomes[what[1] if what[0] == "rejected" else what[0]] += 1
                twins.update(after)
                twins.update(after)
    kept = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - most
    assert kept < ROOM >> 14, f"{kept} kB more"
    print(dict(outcomes))


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_bytes(damage, tmp_path):
    """Whatever bytes come, they are refused or taken for what rclpy takes them for.

    In a process of its own, so that it is seen if that ends, hangs or takes all memory.
    """
    trace = tmp_path / "last"
    script = f"import {__name__} as tests; tests.take_damaged({damage!r}, {str(trace)!r})"
    here = Path(__file__).parent
    path = os.pathsep.join([str(here), str(here.parent / "support"), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-X", "faulthandler", "-c", script],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=1200,
    )
    assert done.returncode == 0, f"{trace.read_text()}\n{done.stderr[-4000:]}"
    assert "malformed" in done.stdout or damage in ("with_more_after_it", "with_odd_texts"), done.stdout


def test_damaged_numbers_stay_within_bounds():
    """A message has no checksum: one byte that is another makes other numbers, and they are believed within the bounds.

    Each byte of a message of a moving arm, in three ways; before it came two that were good.
    """
    velocity, jump = 0.3, 0.1
    limited = Joints(
        NAMES, velocity=np.full(3, 2.0), effort=np.full(3, 50.0), lower=np.full(3, -3.0), upper=np.full(3, 3.0)
    )
    options = Options(max_age=1.0, beyond_velocity=3.0, beyond_effort=4.0, jump=jump)

    def sent(k):
        return serialize_message(joint_state(NAMES, [0.0024 * k] * 3, [velocity] * 3, [5.0] * 3, NOW + 8 * k * MS))

    changed, good = Counter(), sent(2)
    for place in range(len(good)):
        for change in (0x01, 0x80, 0xFF):
            bytes_of = KnownJointStates(JointStateAssembler(limited, options), read_joint_state)
            for k in range(2):
                bytes_of.update(sent(k), NOW + 8 * k * MS)
            raw = bytearray(good)
            raw[place] ^= change
            try:
                state = bytes_of.update(bytes(raw), NOW + 16 * MS)
            except RejectedError:
                continue
            if state is None:
                continue
            assert np.abs(state.velocity).max() <= 3.0 * 2.0
            assert state.effort is None or np.abs(state.effort).max() <= 4.0 * 50.0
            step = np.abs(state.position - 0.0024).max()
            assert step <= jump + max(2.0 * max(velocity, np.abs(state.velocity).max()), 2.0) * 0.5
            assert abs(state.newest - NOW - 16 * MS) <= S
            changed["position"] += bool(np.ptp(state.position))
            changed["velocity"] += bool(np.ptp(state.velocity))
            changed["effort"] += state.effort is not None and bool(np.ptp(state.effort))
    assert min(changed.values()) > 20  # such messages are taken for what they say


def test_damaged_bytes_are_no_lines_on_stderr(capfd):
    """Whatever bytes come, nothing is written past the log, as rosidl does for every count that is beyond the bytes."""
    bytes_of = KnownJointStates(JointStateAssembler(JOINTS, Options()), read_joint_state)
    refused = 0
    for raw in (raw for damage in (overwritten, with_other_lengths, truncated, at_random) for raw in damage()):
        try:
            bytes_of.update(raw, NOW)
        except RejectedError as rejection:
            refused += rejection.cause == "malformed"
    assert refused > 1000
    assert capfd.readouterr().err == ""
    raw, lengths = encoded(one())
    spoilt = raw[: lengths[1]] + b"\xff" * 4 + raw[lengths[1] + 4 :]
    with contextlib.suppress(Exception):  # the fault that is met: rosidl's own
        deserialize_message(spoilt, JointState)
    assert "sequence size" in capfd.readouterr().err


@settings(examples(100))
@given(broadcasts())
def test_big_endian(journey):
    """Whoever sends it: the numbers are the same."""
    little, big = Twins(mimic_tolerance=0.01), Twins(mimic_tolerance=0.01)
    for message, now, _ in journey:
        raw, _ = encoded(message)
        assert big.update(encoded(message, ">")[0], now) == little.update(raw, now) != ("rejected", "malformed")
        assert not big.at_once
        assert not texts_of(big)


def test_both_byte_orders_of_one_text():
    """A publisher of one order does not lend its layout to one of the other."""
    twins = Twins()
    for k in range(6):
        message = one(S + k * MS, 0.1 * k)
        assert twins.update(encoded(message, "<>"[k % 2])[0])[0] == "state"
        assert twins.at_once == (k in (2, 4))
