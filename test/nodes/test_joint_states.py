# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Assembling a robot's state from JointState messages: every way a message can be, and any sequence of them."""

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diag_dynamics.assembly.assembler import Joints, JointStateAssembler, Options
from diag_dynamics.assembly.rejected import RejectedError
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import Mimic
from examples import examples
from nodes import MS, S, joint_state

NAMES = ("shoulder", "elbow", "wrist")
TIMEOUT = 0.5
NOW = 77 * S

MIMICS = {"thumb": Mimic("wrist", -2.0, 0.5), "heel": Mimic("elbow", 0.5, 0.0), "pinky": Mimic("wrist", 3.0, -1.0)}
TOLERANCE = 0.01
IN_PLACE = {"thumb": -5.5, "heel": 1.0, "pinky": 8.0}
"""Where the followers belong, with the joints as in `whole`."""


def assembling(names=NAMES, mimics=None, continuous=(), lower=None, upper=None, **options):
    """Return an assembler; options as given, joint_timeout as in all these tests unless it is."""
    joints = Joints(tuple(names), mimics or {}, tuple(continuous), lower, upper)
    return JointStateAssembler(joints, Options(**({"timeout": TIMEOUT} | options)))


@pytest.fixture
def assembler():
    """Return an assembler of three joints."""
    return assembling()


def configure(assembler, **options):
    """Change some options of an assembler."""
    assembler.configure(assembler.options._replace(**options))


def counted(assembler):
    """Return what an assembler has counted, as a dictionary without zeros."""
    return {key: count for key, count in assembler.counts.items() if count}


def whole(stamp, shift=0.0, names=NAMES, **fields):
    """Return a message with all joints: positions 1, 2, 3, velocities 10, 20, 30, efforts 100, 200, 300."""
    base = shift + np.array([NAMES.index(name) + 1.0 for name in names])
    values = {"position": base, "velocity": 10 * base, "effort": 100 * base} | fields
    return joint_state(names, stamp=stamp, **values)


def assert_state(state, position, newest, oldest, effort=True):
    """The state holds what `whole` put there."""
    position = np.array(position, dtype=float)
    assert state.position.tolist() == position.tolist()
    assert state.velocity.tolist() == (10 * position).tolist()
    if effort:
        assert state.effort.tolist() == (100 * position).tolist()
    else:
        assert state.effort is None
    assert (state.newest, state.oldest) == (newest, oldest)


def refused(assembler, message, cause, *named, now=NOW):
    """The message is rejected for this cause, in words that name these things, and leaves no trace."""
    before = snapshot(assembler)
    with pytest.raises(RejectedError) as rejection:
        assembler.update(message, now)
    assert rejection.value.cause == cause
    for name in named:
        assert name in str(rejection.value)
    assert snapshot(assembler) == before


def snapshot(assembler):
    """Return all that the assembler knows of the joints, as text, in which NaN is equal to itself."""
    of_joints = ("_position", "_velocity", "_effort", "_stamp", "_known", "_without_stamp", "_estimated")
    of_followers = ("_follower_effort", "_follower_stamp")
    known = [getattr(assembler, name) for name in of_joints + of_followers]
    return repr((known, vars(assembler._estimator), counted(assembler)))


# --- good messages


@pytest.mark.parametrize("names", [NAMES, NAMES[::-1], ("elbow", "wrist", "shoulder")])
def test_whole_message(assembler, names):
    """One message with all joints, in any order."""
    state = assembler.update(whole(5 * S, names=names), NOW)
    assert_state(state, [1, 2, 3], 5 * S, 5 * S)
    assert not state.stamp_is_receive_time
    assert not state.velocity_estimated
    assert assembler.missing == []
    assert not counted(assembler)


def test_order_may_change(assembler):
    """What is remembered of the last message's names does not outlive it."""
    for k, names in enumerate((NAMES, NAMES[::-1], NAMES[::-1], NAMES), start=1):
        assert_state(assembler.update(whole(k * S, k, names), NOW), [k + 1, k + 2, k + 3], k * S, k * S)


def test_names_changed_in_place(assembler):
    """The caller may go on using its message."""
    message = whole(1 * S)
    assembler.update(message, NOW)
    message.name.reverse()
    message.header.stamp.sec = 2
    assert assembler.update(message, NOW).position.tolist() == [3, 2, 1]


def test_states_are_copies(assembler):
    """A state handed out does not change with what comes later, nor with its message."""
    message = whole(1 * S)
    first = assembler.update(message, NOW)
    message.position[0] = 99.0
    assembler.update(whole(2 * S, 7.0), NOW)
    assert_state(first, [1, 2, 3], 1 * S, 1 * S)
    first.position[:] = 0.0
    assert_state(assembler.update(whole(3 * S), NOW), [1, 2, 3], 3 * S, 3 * S)


def test_other_joints_are_ignored(assembler):
    """Joints of another robot may be among them, whatever their values."""
    names = ("lid", "wrist", "shoulder", "wheel", "elbow")
    nan = math.nan
    message = joint_state(names, (nan, 3, 1, nan, 2), (nan, 30, 10, nan, 20), (nan, 300, 100, nan, 200), 4 * S)
    assert_state(assembler.update(message, NOW), [1, 2, 3], 4 * S, 4 * S)


@pytest.mark.parametrize("names", [(), ("lid",), ("lid", "wheel")])
def test_message_of_another_robot(assembler, names):
    """It is counted and nothing else, be it ever so malformed."""
    assembler.update(whole(5 * S), NOW)
    before = snapshot(assembler)
    assert assembler.update(joint_state(names, [math.nan] * 5, stamp=1 * S), NOW) is None
    assert counted(assembler) == {"foreign": 1}
    assembler.counts.clear()
    assert snapshot(assembler) == before


def test_pieces(assembler):
    """Nothing comes until every joint has arrived; then every message brings a state."""
    assert assembler.missing == list(NAMES)
    assert assembler.update(whole(1 * S, names=["elbow"]), NOW) is None
    assert assembler.missing == ["shoulder", "wrist"]
    assert assembler.update(whole(1 * S + 100 * MS, names=["wrist"]), NOW) is None
    assert counted(assembler) == {"incomplete": 2}
    state = assembler.update(whole(1 * S + 50 * MS, names=["shoulder"]), NOW)
    assert assembler.missing == []
    assert_state(state, [1, 2, 3], 1 * S + 100 * MS, 1 * S)
    state = assembler.update(whole(1 * S + 200 * MS, 4.0, ["elbow"]), NOW)
    assert_state(state, [1, 6, 3], 1 * S + 200 * MS, 1 * S + 50 * MS)
    assert counted(assembler) == {"incomplete": 2}


def test_no_joints():
    """A robot without joints has no state, and nothing is missing."""
    assembler = assembling(())
    assert assembler.missing == []
    assert assembler.update(whole(1 * S), NOW) is None
    assert assembler.update(joint_state(stamp=2 * S), NOW) is None
    assert counted(assembler) == {"foreign": 2}


# --- efforts and velocities that are not there


@pytest.mark.parametrize("effort", [[], [math.nan] * 3, [100, math.nan, 300], [100, 200, math.inf]])
def test_unknown_effort(assembler, effort):
    """Of one joint or of all: there is a state without efforts, until they are known."""
    assert_state(assembler.update(whole(1 * S, effort=effort), NOW), [1, 2, 3], 1 * S, 1 * S, effort=False)
    assert_state(assembler.update(whole(2 * S), NOW), [1, 2, 3], 2 * S, 2 * S)


def test_unknown_effort_of_a_piece(assembler):
    """A gripper that never sends an effort: that of the arm alone is not enough."""
    assembler.update(whole(1 * S), NOW)
    state = assembler.update(whole(1 * S, names=["wrist"], effort=[]), NOW)
    assert_state(state, [1, 2, 3], 1 * S, 1 * S, effort=False)
    assert assembler.update(whole(1 * S, names=["elbow"]), NOW).effort is None
    assert_state(assembler.update(whole(1 * S, names=["wrist"]), NOW), [1, 2, 3], 1 * S, 1 * S)


@pytest.mark.parametrize(
    ("velocity", "joint"),
    [([], "shoulder"), ([math.nan] * 3, "shoulder"), ([10, math.nan, 30], "elbow"), ([10, 20, -math.inf], "wrist")],
)
def test_unknown_velocity(assembler, velocity, joint):
    """There is no state without velocities; with them there is."""
    with pytest.raises(RejectedError, match=joint) as rejection:
        assembler.update(whole(1 * S, velocity=velocity), NOW)
    assert rejection.value.cause == "no velocity"
    assert_state(assembler.update(whole(2 * S), NOW), [1, 2, 3], 2 * S, 2 * S)


def test_unknown_velocity_of_a_piece(assembler):
    """It is missed as soon as all joints have arrived, whoever's message it is."""
    assert assembler.update(whole(1 * S, names=["wrist"], velocity=[]), NOW) is None
    with pytest.raises(RejectedError, match="wrist"):
        assembler.update(whole(1 * S, names=["shoulder", "elbow"]), NOW)
    assert_state(assembler.update(whole(1 * S, names=["wrist"]), NOW), [1, 2, 3], 1 * S, 1 * S)


# --- bad messages


@pytest.mark.parametrize("known", [False, True], ids=["at first", "later"])
@pytest.mark.parametrize(
    ("message", "cause", "named"),
    [
        (whole(2 * S, position=[]), "no position", ["shoulder", "position"]),
        (whole(2 * S, position=[1, math.nan, 3]), "no position", ["elbow", "nan"]),
        (whole(2 * S, position=[1, 2, math.inf]), "no position", ["wrist", "inf"]),
        (whole(2 * S, position=[1, 2]), "wrong length", ["position", "2 entries", "3 names", "wrist"]),
        (whole(2 * S, position=[1, 2, 3, 4]), "wrong length", ["position", "4 entries", "3 names"]),
        (whole(2 * S, velocity=[1]), "wrong length", ["velocity", "elbow"]),
        (whole(2 * S, effort=[1, 2, 3, 4, 5]), "wrong length", ["effort", "5 entries"]),
        (whole(2 * S, names=["elbow", "wrist", "elbow"]), "duplicate name", ["elbow"]),
        (joint_state(["wrist", "lid", "lid"], [1, 2, 3], [1, 2, 3], [], 2 * S), "duplicate name", ["lid"]),
    ],
)
def test_malformed(assembler, message, cause, named, known):
    """It is rejected by name, and as if it had never come."""
    if known:
        assembler.update(whole(1 * S), NOW)
    refused(assembler, message, cause, *named)
    assert_state(assembler.update(whole(3 * S), NOW), [1, 2, 3], 3 * S, 3 * S)


def test_malformed_does_not_turn_time_back(assembler):
    """A message that is not accepted says nothing of the time either."""
    assembler.update(whole(50 * S), NOW)
    refused(assembler, whole(1 * S, position=[1, 2]), "wrong length")
    refused(assembler, whole(1 * S, position=[1, 2, math.nan]), "no position")
    assert counted(assembler) == {}


# --- time


def test_same_stamp_again(assembler):
    """The later message counts."""
    assembler.update(whole(1 * S), NOW)
    assert_state(assembler.update(whole(1 * S, 5.0), NOW), [6, 7, 8], 1 * S, 1 * S)


LATE = [
    ({"timeout": 0.5}, 1.0),
    ({"timeout": 0.0}, 1.0),
    ({"timeout": 3.0}, 3.0),
    ({"timeouts": {"*": 3.0}}, 3.0),
    ({"timeout": 3.0, "timeouts": {"*": 0.2}}, 1.0),
    ({"timeout": 3.0, "timeouts": {"*": 0.0}}, 1.0),
]


@pytest.mark.parametrize(("options", "most"), LATE)
def test_late(options, most):
    """Overtaken by a newer message: dropped, up to a second or the joint's timeout. Beyond that, it is from the past."""
    assembler = assembling(**options)
    assembler.update(whole(100 * S), NOW)
    refused(assembler, whole(100 * S - 1, 5.0), "late", "shoulder")
    refused(assembler, whole(100 * S - int(most * S), 5.0), "late", f"{most:.6f} s")
    refused(assembler, whole(100 * S - int(most * S) - 1, 5.0), "stamp from the past", "shoulder", f"{most:.6f} s")
    assert_state(assembler.update(whole(100 * S), NOW), [1, 2, 3], 100 * S, 100 * S)
    assert not counted(assembler)


def test_late_names_the_joint_concerned(assembler):
    """Of several joints in a message, the one that has been heard of later."""
    assembler.update(whole(1 * S), NOW)
    assembler.update(whole(1 * S + 200 * MS, names=["wrist"]), NOW)
    refused(assembler, whole(1 * S + 100 * MS), "late", "wrist", "0.1")


def test_older_than_others_is_not_late(assembler):
    """Each joint has a time of its own."""
    assembler.update(whole(1 * S), NOW)
    assembler.update(whole(1 * S + 300 * MS, names=["wrist"]), NOW)
    state = assembler.update(whole(1 * S + 100 * MS, 1.0, ["shoulder", "elbow"]), NOW)
    assert_state(state, [2, 3, 3], 1 * S + 300 * MS, 1 * S + 100 * MS)


def jump(assembler, stamp, now=NOW):
    """Let time jump back: the first message is rejected, the second one, an instant later, is believed."""
    refused(assembler, whole(stamp), "stamp from the past", now=now)
    return assembler.update(whole(stamp + 1), now)


def test_time_jumps_back(assembler):
    """All joints have to arrive anew: none of before is mixed with those of now."""
    assembler.update(whole(100 * S), NOW)
    refused(assembler, whole(10 * S, 9.0, ["wrist"]), "stamp from the past", "wrist", "90.000000 s")
    assert assembler.missing == []
    assert assembler.update(whole(10 * S, 1.0, ["wrist"]), NOW) is None
    assert assembler.missing == ["shoulder", "elbow"]
    assert counted(assembler) == {"time jumped back": 1, "incomplete": 1}
    state = assembler.update(whole(10 * S, 2.0, ["shoulder", "elbow"]), NOW)
    assert_state(state, [3, 4, 4], 10 * S, 10 * S)


def test_time_jumps_back_again(assembler):
    """Each time it takes two messages, and what came before is no confirmation of what comes later."""
    assembler.update(whole(100 * S), NOW)
    for k, stamp in enumerate((90 * S, 80 * S, 60 * S, 30 * S), start=1):
        assert_state(jump(assembler, stamp), [1, 2, 3], stamp + 1, stamp + 1)
        assert counted(assembler) == {"time jumped back": k}


@pytest.mark.parametrize(
    ("step", "confirmed"), [(0, True), (1, True), (10 * MS, True), (S, True), (S + 1, False), (-1, False), (-S, False)]
)
def test_what_confirms_a_jump(assembler, step, confirmed):
    """A stamp no earlier than the one that was rejected, and no more than a second later; any other has to be confirmed."""
    assembler.update(whole(100 * S), NOW)
    refused(assembler, whole(50 * S), "stamp from the past")
    if not confirmed:
        refused(assembler, whole(50 * S + step), "stamp from the past")
        step += 10 * MS
    assert_state(assembler.update(whole(50 * S + step, 1.0), NOW), [2, 3, 4], 50 * S + step, 50 * S + step)
    assert counted(assembler) == {"time jumped back": 1}


def test_strays_are_no_jump(assembler):
    """Messages from the past, each alone among others that go on as before, never turn time back."""
    for k in range(5):
        assembler.update(whole(100 * S + k * 10 * MS), NOW)
        refused(assembler, whole(50 * S + k * 10 * MS, 9.0), "stamp from the past")
    assert not counted(assembler)


def test_what_is_malformed_refutes_no_jump(assembler):
    """It says nothing of the time."""
    assembler.update(whole(100 * S), NOW)
    refused(assembler, whole(50 * S), "stamp from the past")
    refused(assembler, whole(100 * S, position=[1, 2, math.nan]), "no position")
    assert_state(assembler.update(whole(50 * S), NOW), [1, 2, 3], 50 * S, 50 * S)
    assert counted(assembler) == {"time jumped back": 1}


def test_small_jump_back(assembler):
    """Within a second messages are late, until five of them in a row, over half a second, say that time has jumped."""
    assembler.update(whole(100 * S), NOW)
    for k in range(5):
        refused(assembler, whole(99 * S + k * 100 * MS), "late")
    assert_state(assembler.update(whole(99 * S + 500 * MS, 1.0), NOW), [2, 3, 4], 99 * S + 500 * MS, 99 * S + 500 * MS)
    assert counted(assembler) == {"time jumped back": 1}


def test_delayed_messages_are_no_jump(assembler):
    """Two sources of the same joints, of which one is behind: its messages are late for ever, and only those."""
    for k in range(100):
        stamp = 100 * S + k * 20 * MS
        assert_state(assembler.update(whole(stamp), NOW), [1, 2, 3], stamp, stamp)
        refused(assembler, whole(stamp - 200 * MS, 9.0), "late")
    assert not counted(assembler)


def test_two_sources_jump_back(assembler):
    """Each of them has to confirm it itself; the first one that does forgets all joints, those of the others, too."""
    arm, gripper = ["shoulder", "elbow"], ["wrist"]
    assembler.update(whole(100 * S, names=arm), NOW)
    assembler.update(whole(100 * S, names=gripper), NOW)
    refused(assembler, whole(5 * S, names=arm), "stamp from the past", "shoulder")
    refused(assembler, whole(5 * S, names=gripper), "stamp from the past", "wrist")
    assert assembler.update(whole(5 * S + MS, names=arm), NOW) is None
    assert_state(assembler.update(whole(5 * S + MS, names=gripper), NOW), [1, 2, 3], 5 * S + MS, 5 * S + MS)
    assert counted(assembler) == {"time jumped back": 1, "incomplete": 2}


def test_one_of_two_sources_jumps_back():
    """It is believed although the other one goes on as before, which its messages do not refute."""
    assembler = assembling(timeout=0.0)
    arm, gripper = ["shoulder", "elbow"], ["wrist"]
    assembler.update(whole(100 * S), NOW)
    refused(assembler, whole(90 * S, names=arm), "stamp from the past")
    assert_state(assembler.update(whole(100 * S + MS, names=gripper), NOW), [1, 2, 3], 100 * S + MS, 100 * S)
    assert assembler.update(whole(90 * S + MS, names=arm), NOW) is None
    assert_state(assembler.update(whole(101 * S, names=gripper), NOW), [1, 2, 3], 101 * S, 90 * S + MS)
    assert counted(assembler) == {"time jumped back": 1, "incomplete": 1}


ARM, GRIPPER = ["shoulder", "elbow"], ["wrist"]


def test_a_source_that_goes_on_does_not_refute_the_jump_of_another(assembler):
    """Nor does it confirm it: only its own stamps that are no older do away with the suspicion."""
    for k in range(5):
        assembler.update(whole(100 * S + k * MS, names=GRIPPER), NOW)
        assembler.update(whole(100 * S + k * MS, names=ARM), NOW)
        refused(assembler, whole(5 * S + k * MS, names=ARM), "stamp from the past")
        assembler.update(whole(100 * S + k * MS, names=GRIPPER), NOW)
    assembler.counts.clear()
    assert assembler.update(whole(5 * S + 10 * MS, names=ARM), NOW) is None
    assert counted(assembler) == {"time jumped back": 1, "incomplete": 1}


def test_the_first_joint_tells_sources_apart(assembler):
    """In whatever order they are listed, and whatever else is with it."""
    assembler.update(whole(100 * S), NOW)
    refused(assembler, whole(5 * S, names=["wrist", "elbow"]), "stamp from the past")
    refused(assembler, whole(5 * S, names=["shoulder", "wrist"]), "stamp from the past")
    refused(assembler, whole(5 * S, names=["wrist"]), "stamp from the past")
    assert assembler.update(whole(5 * S + MS, names=["elbow"]), NOW) is None
    assert counted(assembler) == {"time jumped back": 1, "incomplete": 1}


@pytest.mark.parametrize(("timeouts", "most"), [({"wrist": 3.0}, 3.0), ({"wrist": 0.0}, 1.0), ({"wrist": 0.2}, 1.0)])
def test_late_by_the_joint_concerned(timeouts, most):
    """Its own age limit says what is merely late, a second at least, and a second without any."""
    assembler = assembling(timeout=2.0, timeouts=timeouts)
    assembler.update(whole(100 * S), NOW)
    assembler.update(whole(100 * S + 1, names=["wrist"]), NOW)
    refused(assembler, whole(100 * S + 1 - int(most * S)), "late", "wrist", f"{most:.6f} s")
    refused(assembler, whole(100 * S - int(most * S)), "stamp from the past", "wrist")
    assembler.stamps.forget()
    refused(assembler, whole(98 * S, names=ARM), "late", "shoulder", "2.000000 s")
    refused(assembler, whole(98 * S - 1, names=ARM), "stamp from the past", "shoulder")


BETWEEN = {
    "followers": (lambda stamp: hand(stamp), NAMES),
    "a joint never heard of": (lambda stamp: whole(stamp, names=["wrist"]), ["shoulder", "elbow"]),
    "a joint without stamps": (lambda stamp: whole(0, names=["wrist"]), ["shoulder", "elbow"]),
}


@pytest.mark.parametrize(("other", "names"), BETWEEN.values(), ids=BETWEEN)
def test_jump_is_confirmed_whatever_comes_between(coupled, other, names):
    """Messages that cannot tell whether time has jumped, because nothing of theirs is to be compared, do not refute it."""
    configure(coupled, timeout=0.0)
    coupled.update(whole(100 * S, names=names), NOW)
    refused(coupled, whole(50 * S, names=names), "stamp from the past")
    coupled.update(other(50 * S), NOW)
    coupled.update(whole(50 * S + MS, names=names), NOW)
    assert counted(coupled)["time jumped back"] == 1


def test_stamps_and_times_of_reception_are_not_compared(assembler):
    """They may be those of different clocks: a driver that begins or ceases to stamp is neither late nor from the past."""
    for k in range(3):
        at = NOW + k * 10 * MS
        assert_state(assembler.update(whole(0, k), at), [k + 1, k + 2, k + 3], at, at)
        stamp = 20 * S + k * 10 * MS
        assert_state(assembler.update(whole(stamp, k + 3.0), at), [k + 4, k + 5, k + 6], stamp, stamp)
    assert not counted(assembler)
    refused(assembler, whole(20 * S), "late")


def test_times_of_reception_have_an_order(assembler):
    """Among messages without stamps those of reception count like stamps."""
    assembler.update(whole(0), NOW)
    refused(assembler, whole(0), "late", now=NOW - 1)
    refused(assembler, whole(0), "stamp from the past", now=NOW - S - 1)
    assert not counted(assembler)


@pytest.mark.parametrize(("sec", "nanosec"), [(-1, 0), (-1, 999_999_999), (-(2**31), 0), (5, 10**9), (0, 2**32 - 1)])
@pytest.mark.parametrize("names", [NAMES, ("wrist",), tuple(MIMICS)], ids=["all", "one", "followers"])
def test_malformed_stamp(coupled, sec, nanosec, names):
    """Negative, or with a second or more in its nanoseconds: rejected with both numbers, and as if it had never come."""
    coupled.update(all_of(1 * S), NOW)
    message = hand(0) if names == tuple(MIMICS) else whole(0, 9.0, names)
    message.header.stamp.sec, message.header.stamp.nanosec = sec, nanosec
    refused(coupled, message, "malformed stamp", "header.stamp", str(sec), str(nanosec))
    assert_state(coupled.update(whole(2 * S), NOW), [1, 2, 3], 2 * S, 2 * S)


def test_stale(assembler):
    """A joint older than the timeout against the newest: no state, until it speaks again. Exactly as old is young."""
    assembler.update(whole(1 * S), NOW)
    others = ["shoulder", "elbow"]
    state = assembler.update(whole(1 * S + 500 * MS, names=others), NOW)
    assert_state(state, [1, 2, 3], 1 * S + 500 * MS, 1 * S)
    with pytest.raises(RejectedError, match="wrist") as rejection:
        assembler.update(whole(1 * S + 500 * MS + 1, names=others), NOW)
    assert rejection.value.cause == "stale joint"
    state = assembler.update(whole(1 * S + 400 * MS, names=["wrist"]), NOW)
    assert_state(state, [1, 2, 3], 1 * S + 500 * MS + 1, 1 * S + 400 * MS)
    assert assembler.stale(1 * S + 900 * MS) == []
    assert assembler.stale(1 * S + 900 * MS + 1) == ["wrist"]
    assert assembler.stale(10 * S) == list(NAMES)


def test_no_timeout():
    """With a timeout of 0 no age is too old."""
    assembler = assembling(timeout=0.0)
    assembler.update(whole(1 * S), NOW)
    state = assembler.update(whole(9000 * S, names=["wrist"]), NOW)
    assert_state(state, [1, 2, 3], 9000 * S, 1 * S)
    assert assembler.stale(10**18) == []


def test_joints_that_never_came_are_not_stale(assembler):
    """They are missing."""
    assembler.update(whole(1 * S, names=["wrist"]), NOW)
    assert assembler.stale(10 * S) == ["wrist"]
    assert assembler.missing == ["shoulder", "elbow"]


def test_without_stamp(assembler):
    """The time of reception stands for a stamp of zero, and the state says so as long as any joint has none."""
    state = assembler.update(whole(0), NOW)
    assert_state(state, [1, 2, 3], NOW, NOW)
    assert state.stamp_is_receive_time
    state = assembler.update(whole(NOW + 100 * MS, names=["wrist", "elbow"]), NOW + 200 * MS)
    assert state.stamp_is_receive_time
    state = assembler.update(whole(NOW + 100 * MS, names=["shoulder"]), NOW + 200 * MS)
    assert not state.stamp_is_receive_time
    assert (state.newest, state.oldest) == (NOW + 100 * MS, NOW + 100 * MS)


def test_neither_stamp_nor_clock(assembler):
    """Before the first /clock there is no time that could stand for a stamp of zero; other stamps do not need it."""
    for message in (whole(0), whole(0, names=["wrist"])):
        refused(assembler, message, "no time", "use_sim_time", now=0)
    assert_state(assembler.update(whole(5 * S), 0), [1, 2, 3], 5 * S, 5 * S)


@pytest.mark.parametrize("known", [False, True], ids=["at first", "later"])
@pytest.mark.parametrize("names", [NAMES, tuple(MIMICS)], ids=["joints", "followers"])
def test_simulated_time_of_zero(coupled, known, names):
    """Before the first /clock, there is no time that could stand for a stamp of zero."""
    if known:
        coupled.update(all_of(1 * S), NOW)
    message = hand(0) if names == tuple(MIMICS) else whole(0)
    refused(coupled, message, "no time", "header.stamp is zero", "/clock", now=0)
    assert_state(coupled.update(whole(2 * S), 0), [1, 2, 3], 2 * S, 2 * S)


def test_newest_stamp(assembler):
    """Of all joints that have arrived; 0 without any."""
    assert assembler.newest == 0
    assembler.update(whole(3 * S, names=GRIPPER), NOW)
    assert assembler.newest == 3 * S
    assembler.update(whole(3 * S - 1, names=ARM), NOW)
    assert assembler.newest == 3 * S
    assembler.forget()
    assert assembler.newest == 0


# --- followers


@pytest.fixture
def coupled():
    """Return an assembler of three joints, which three others follow."""
    return assembling(mimics=MIMICS, mimic_tolerance=TOLERANCE)


def hand(stamp, effort=(), **position):
    """Return a message with followers alone, in place but for those given."""
    position = IN_PLACE | position
    return joint_state(position, position.values(), [math.nan] * len(position), effort, stamp)


def all_of(stamp, *, effort=(0, 0, 0), **position):
    """Return a message with the joints of `whole` and the followers, in place but for those given, among them."""
    joints, followers = whole(stamp), hand(stamp, effort, **position)
    order = [5, 0, 3, 1, 4, 2]
    fields = (
        [[*getattr(joints, field), *getattr(followers, field)][k] for k in order]
        for field in ("name", "position", "velocity", "effort")
    )
    return joint_state(*fields, stamp=stamp)


def test_followers_may_be_listed(coupled):
    """The same state with and without them; and they are not needed."""
    assert coupled.missing == list(NAMES)
    assert_state(coupled.update(whole(1 * S), NOW), [1, 2, 3], 1 * S, 1 * S)
    assert_state(coupled.update(all_of(2 * S), NOW), [1, 2, 3], 2 * S, 2 * S)
    assert_state(coupled.update(whole(3 * S), NOW), [1, 2, 3], 3 * S, 3 * S)
    assert coupled.missing == coupled.stale(3 * S) == []
    assert not counted(coupled)


def test_followers_alone(coupled):
    """They are known to be this robot's, but make no state, be the others known or not, nor do they hold one back."""
    assert coupled.update(hand(1 * S), NOW) is None
    assert coupled.missing == list(NAMES)
    coupled.update(whole(2 * S), NOW)
    assert coupled.update(hand(2 * S + 100 * MS), NOW) is None
    assert counted(coupled) == {"followers only": 2}
    state = coupled.update(whole(2 * S + 50 * MS), NOW)  # older than the followers, which does not make it late
    assert_state(state, [1, 2, 3], 2 * S + 50 * MS, 2 * S + 50 * MS)
    assert_state(coupled.update(whole(9 * S), NOW), [1, 2, 3], 9 * S, 9 * S)  # nobody waits for followers
    assert counted(coupled) == {"followers only": 2}


@pytest.mark.parametrize(
    ("own", "reflected"),
    [
        ((0, 0, 0), (0, 0, 0)),
        ((10, 20, 30), (0, 10, 70)),
        ((math.nan, 20, 30), (0, 10, 90)),
        ((10, math.nan, math.inf), (0, 0, -20)),
        ((math.nan,) * 3, (0, 0, 0)),
    ],
)
def test_effort_of_followers(coupled, own, reflected):
    """It acts on the leader, multiplied, so that the power is that of all efforts; one that is unknown is zero."""
    expected = np.array([100, 200, 300]) + reflected
    state = coupled.update(all_of(1 * S, effort=own), NOW)
    assert state.effort.tolist() == expected.tolist()
    rates = [10, 20, 30, -2 * 30, 0.5 * 20, 3 * 30]
    assert state.velocity @ state.effort == rates @ np.array([100, 200, 300, *np.where(np.isfinite(own), own, 0.0)])
    # and likewise from a message of their own, until there is another one
    assert coupled.update(whole(2 * S), NOW).effort.tolist() == [100, 200, 300]  # that of before is stale
    coupled.update(hand(2 * S, own), NOW)
    assert coupled.update(whole(2 * S), NOW).effort.tolist() == expected.tolist()
    coupled.update(hand(2 * S), NOW)
    assert coupled.update(whole(2 * S), NOW).effort.tolist() == [100, 200, 300]


def test_effort_of_followers_ages(coupled):
    """Exactly as old as the timeout it counts, older not; after time has jumped back it is forgotten."""
    coupled.update(hand(1 * S, [0, 20, 0]), NOW)
    assert coupled.update(whole(1 * S + 500 * MS), NOW).effort.tolist() == [100, 210, 300]
    assert coupled.update(whole(1 * S + 500 * MS + 1), NOW).effort.tolist() == [100, 200, 300]
    coupled.update(hand(90 * S, [0, 20, 0]), NOW)
    coupled.update(whole(90 * S), NOW)
    assert jump(coupled, 5 * S).effort.tolist() == [100, 200, 300]
    configure(coupled, timeout=0.0)
    coupled.update(hand(5 * S, [0, 20, 0]), NOW)
    assert coupled.update(whole(900 * S), NOW).effort.tolist() == [100, 210, 300]


def test_effort_of_a_leader_is_needed(coupled):
    """That of a follower does not stand for it."""
    message = all_of(1 * S, effort=(10, 20, 30))
    message.effort[message.name.index("wrist")] = math.nan
    assert coupled.update(message, NOW).effort is None


def disagrees(assembler, message, *named, now=NOW):
    """The message brings a state all the same, if it would; what it disagrees in is counted once, and named."""
    before = assembler.counts["mimic disagreement"]
    state = assembler.update(message, now)
    assert assembler.counts["mimic disagreement"] == before + bool(named)
    for text in named:
        assert text in assembler.last_disagreement
    return state


def test_disagreement(coupled):
    """Follower, its position, that by the leader, and the tolerance; over as soon as they agree."""
    named = ("'thumb' is -5.4,", "-5.5", "'wrist'", "0.01")
    assert_state(disagrees(coupled, all_of(1 * S, thumb=-5.4), *named), [1, 2, 3], 1 * S, 1 * S)
    disagrees(coupled, all_of(2 * S))
    disagrees(coupled, all_of(3 * S, thumb=-5.6, heel=1.2), "'thumb' is -5.6,", "'heel' is 1.2,", "'elbow'")
    assert "pinky" not in coupled.last_disagreement
    assert counted(coupled) == {"mimic disagreement": 2}


@pytest.mark.parametrize(("position", "apart"), [(1.0099, False), (1.0101, True), (0.9901, False), (0.9899, True)])
def test_tolerance(coupled, position, apart):
    """On both sides; as it is changed, and without one."""
    disagrees(coupled, all_of(1 * S, heel=position), *["heel"] * apart)
    configure(coupled, mimic_tolerance=1.0)
    disagrees(coupled, all_of(2 * S, heel=position))
    disagrees(coupled, all_of(3 * S, heel=2.1), "heel")
    configure(coupled, mimic_tolerance=0.0)
    disagrees(coupled, all_of(4 * S, heel=1e9))


@pytest.mark.parametrize("position", [7.0, 1.0 + 2.0 * math.pi, 1.0 - 4.0 * math.pi, math.inf])
def test_whole_turns_of_a_continuous_joint_are_no_distance(position):
    """Drivers wrap such angles as they like."""
    mimics = {"wheel": Mimic("drive", 1.0, 0.0)}
    wheel = assembling(["drive"], mimics, ["wheel"], mimic_tolerance=TOLERANCE)
    message = joint_state(["drive", "wheel"], [1.0, position], [0.0, 0.0], stamp=1 * S)
    disagrees(wheel, message, *["'wheel' is 7,"] * (position == 7.0))


@pytest.mark.parametrize("position", [math.nan, math.inf, -math.inf])
def test_position_that_is_no_number(coupled, position):
    """Of a follower it is not compared; the others are."""
    state = disagrees(coupled, all_of(1 * S, thumb=position))
    assert_state(state, [1, 2, 3], 1 * S, 1 * S)
    disagrees(coupled, all_of(2 * S, thumb=position, heel=7.0), "heel")


def test_only_efforts_of_followers(coupled):
    """Without any position there is nothing to compare."""
    coupled.update(whole(1 * S), NOW)
    assert coupled.update(joint_state(["heel"], [], [], [20.0], 1 * S), NOW) is None
    assert coupled.update(whole(1 * S), NOW).effort.tolist() == [100, 210, 300]
    assert counted(coupled) == {"followers only": 1}


def test_compared_with_a_leader_of_before(coupled):
    """As long as the two are within the timeout of each other, whichever is older."""
    disagrees(coupled, hand(1 * S, thumb=9.0))  # no leader yet
    coupled.update(whole(10 * S), NOW)
    for stamp, apart in ((10 * S, True), (10 * S + 500 * MS, True), (10 * S + 501 * MS, False), (9 * S, False)):
        assert disagrees(coupled, hand(stamp, thumb=9.0), *["'thumb' is 9,"] * apart) is None
    disagrees(coupled, hand(10 * S))
    configure(coupled, timeout=0.0)
    disagrees(coupled, hand(500 * S, heel=9.0), "heel")


def test_not_compared_with_a_leader_of_another_time(coupled):
    """After time has jumped back, the leader has to be heard of anew."""
    coupled.update(whole(100 * S), NOW)
    configure(coupled, timeout=0.0)
    refused(coupled, whole(10 * S, names=["shoulder"]), "stamp from the past")
    coupled.update(whole(10 * S, names=["shoulder"]), NOW)
    disagrees(coupled, hand(10 * S, thumb=9.0))
    disagrees(coupled, all_of(10 * S, thumb=9.0), "thumb")


@pytest.mark.parametrize(
    ("message", "cause", "named"),
    [
        (joint_state(["thumb", "heel"], [1.0], [], [], 2 * S), "wrong length", "heel"),
        (joint_state(["thumb", "heel"], [], [], [1.0, 2.0, 3.0], 2 * S), "wrong length", "effort"),
        (joint_state(["thumb", "thumb"], [1.0, 2.0], [], [], 2 * S), "duplicate name", "thumb"),
    ],
)
def test_malformed_followers(coupled, message, cause, named):
    """They are rejected like others."""
    coupled.update(whole(1 * S), NOW)
    refused(coupled, message, cause, named)


# --- options


def test_timeouts_of_single_joints():
    """Each joint has its own, 0 for none; * stands for all others, and joint_timeout for those that have none."""
    assembler = assembling(timeouts={"wrist": 2.0, "elbow": 0.0})
    assembler.update(whole(10 * S), NOW)
    state = assembler.update(whole(12 * S, names=["shoulder"]), NOW)
    assert_state(state, [1, 2, 3], 12 * S, 10 * S)
    with pytest.raises(RejectedError, match=r"'wrist' is older than 2 s"):
        assembler.update(whole(12 * S + 1, names=["shoulder"]), NOW)
    assert assembler.stale(13 * S) == ["shoulder", "wrist"]
    configure(assembler, timeouts={"wrist": 3.0, "*": 5.0})
    assert assembler.update(whole(13 * S, names=["shoulder"]), NOW).oldest == 10 * S
    assert assembler.stale(13 * S + 1) == ["wrist"]
    assert assembler.stale(15 * S + 1) == ["elbow", "wrist"]


@pytest.mark.parametrize("timeout", [k / 1000 for k in (1, 70, 290, 300, 1001, 1003, 1013, 2301)])
def test_exactly_as_old_as_the_timeout(timeout):
    """A joint is fresh, also where the timeout in nanoseconds is no whole number in floating point."""
    assembler = assembling(timeout=timeout)
    age = round(timeout * 1000) * MS
    assembler.update(whole(50 * S), NOW)
    assert assembler.stale(50 * S + age) == []
    assert assembler.stale(50 * S + age + 1) == list(NAMES)
    assert assembler.update(whole(50 * S + age, names=["wrist"]), NOW).oldest == 50 * S


def test_timeout_of_a_follower(coupled):
    """For so long its effort counts."""
    configure(coupled, timeouts={"heel": 2.0})
    coupled.update(hand(1 * S, [10, 20, 0]), NOW)
    assert coupled.update(whole(3 * S), NOW).effort.tolist() == [100, 210, 300]
    assert coupled.update(whole(3 * S + 1), NOW).effort.tolist() == [100, 200, 300]


BY_JOINT = {
    "timeouts": ("joint_timeouts", 1.0),
    "effort_available": ("effort_available", True),
    "effort_scale": ("effort_scale", 2.0),
    "effort_includes_gravity": ("effort_includes_gravity", False),
}


@pytest.mark.parametrize(("option", "parameter", "value"), [(k, *v) for k, v in BY_JOINT.items()], ids=BY_JOINT)
def test_options_of_a_joint_that_is_not_there(coupled, option, parameter, value):
    """They are refused, naming parameter and joint; those in force stay, all of them."""
    configure(coupled, timeout=1.5)
    before, options = snapshot(coupled), coupled.options
    with pytest.raises(InputError, match=f"'{parameter}' names 'knee'"):
        configure(coupled, timeout=9.0, mimic_tolerance=9.0, max_age=9.0, max_position=0.1, **{option: {"knee": value}})
    assert coupled.options == options and snapshot(coupled) == before
    assert coupled.followers.tolerance == TOLERANCE and coupled.stamps.max_age == 0.0
    coupled.update(whole(10 * S), NOW)
    assert coupled.stale(10 * S + 1500 * MS + 1) == list(NAMES)
    with pytest.raises(InputError, match=f"'{parameter}' names 'knee'"):
        assembling(mimics=MIMICS, **{option: {"elbow": value, "knee": value}})


# --- values that cannot be


@pytest.mark.parametrize(
    ("options", "message", "named"),
    [
        ({"max_position": 2.5}, whole(2 * S), ["'wrist': position is 3,", "-2.5 … 2.5", "absurd.position"]),
        ({"max_position": 2.5}, whole(2 * S, position=[1, -2.6, 0]), ["'elbow': position is -2.6,", "-2.5 … 2.5"]),
        (
            {"beyond_limits": 0.5},
            whole(2 * S, 0.6),
            ["'elbow': position is 2.6,", "-4.5 … 2.5", "absurd.beyond_limits"],
        ),
        ({"beyond_limits": 0.5}, whole(2 * S, position=[1, -4.6, 3]), ["'elbow': position is -4.6,"]),
        ({"max_velocity": 29.0}, whole(2 * S), ["'wrist': velocity is 30,", "±29", "absurd.velocity"]),
        ({"max_velocity": 29.0}, whole(2 * S, velocity=[-29.1, 0, 0]), ["'shoulder': velocity is -29.1,"]),
        ({"max_position": 2.5}, whole(2 * S, names=["wrist"]), ["'wrist': position is 3,"]),
    ],
)
def test_absurd_value(options, message, named):
    """Position or velocity beyond what can be: the message is rejected by name, value and bounds, without a trace."""
    assembler = assembling(lower=np.array([-np.inf, -4, -np.inf]), upper=np.array([np.inf, 2, np.inf]), **options)
    good = {"position": [1, 1, 1], "velocity": [10, 10, 10], "effort": [100, 100, 100]}
    assembler.update(whole(1 * S, **good), NOW)
    refused(assembler, message, "absurd value", *named)
    assert_state(assembler.update(whole(2 * S, **good), NOW), [1, 1, 1], 2 * S, 2 * S)
    configure(assembler, **dict.fromkeys(options, 0.0))
    assert assembler.update(message, NOW).newest == 2 * S


def test_bounds_are_inclusive_and_zero_is_none():
    """Exactly at a bound a value is taken; 0 is no bound at all."""
    limits = {"lower": np.array([0.0, -1.0, -np.inf]), "upper": np.array([0.5, 1.0, np.inf])}
    assembler = assembling(**limits, beyond_limits=1.0, max_position=3.0, max_velocity=30.0)
    state = assembler.update(whole(1 * S, position=[-1.0, 2.0, -3.0], velocity=[-30, 30, 0]), NOW)
    assert state.position.tolist() == [-1, 2, -3]
    configure(assembler, beyond_limits=0.0, max_position=0.0, max_velocity=0.0)
    state = assembler.update(whole(2 * S, position=[1e300, -1e300, 0], velocity=[1e300, -1e300, 0]), NOW)
    assert state.velocity.tolist() == [1e300, -1e300, 0]


def test_joints_that_turn_round_have_no_bound_of_position():
    """However often a wheel has turned."""
    assembler = assembling(continuous=["wrist"], max_position=100.0)
    assert assembler.update(whole(1 * S, position=[1, 2, 1e7]), NOW).position.tolist() == [1, 2, 1e7]
    refused(assembler, whole(2 * S, position=[1, 1e7, 2]), "absurd value", "elbow")


def test_joints_of_others_may_be_absurd(coupled):
    """What is not needed is not judged, nor are followers, who are compared with their leaders."""
    configure(coupled, max_position=3.0, max_velocity=30.0)
    message = joint_state([*NAMES, "lid"], [1, 2, 3, 1e9], [10, 20, 30, 1e9], [100, 200, 300, 1e9], 1 * S)
    assert_state(coupled.update(message, NOW), [1, 2, 3], 1 * S, 1 * S)
    disagrees(coupled, all_of(2 * S, pinky=1e9), "pinky")


@pytest.mark.parametrize("absurd", [1001.0, -1001.0, math.inf, -math.inf, 1e300])
def test_absurd_effort(absurd):
    """Beyond what can be it is unknown, and the message is counted; the state comes without efforts."""
    assembler = assembling(max_effort=1000.0)
    state = assembler.update(whole(1 * S, effort=[1000, absurd, -1000]), NOW)
    assert_state(state, [1, 2, 3], 1 * S, 1 * S, effort=False)
    assert assembler.without_effort == ["elbow"]
    assert counted(assembler) == {"absurd effort": 1}
    assert_state(assembler.update(whole(2 * S), NOW), [1, 2, 3], 2 * S, 2 * S)
    assert assembler.without_effort == []
    assert assembler.update(whole(3 * S, effort=[1000, 0, -1000]), NOW).effort.tolist() == [1000, 0, -1000]
    assert counted(assembler) == {"absurd effort": 1}


def test_without_a_bound_only_infinite_efforts_are_absurd(assembler):
    """NaN is how a driver says that it does not know, and is not counted."""
    assert assembler.update(whole(1 * S, effort=[1e300, -1e300, 0]), NOW).effort.tolist() == [1e300, -1e300, 0]
    assert assembler.update(whole(2 * S, effort=[math.nan] * 3), NOW).effort is None
    assert not counted(assembler)
    assert assembler.update(whole(3 * S, effort=[math.inf, 0, 0]), NOW).effort is None
    assert counted(assembler) == {"absurd effort": 1}


def test_absurd_effort_of_a_follower(coupled):
    """It counts as zero, like one that is unknown."""
    configure(coupled, max_effort=1000.0)
    assert coupled.update(all_of(1 * S, effort=(0, 2000, 10)), NOW).effort.tolist() == [100, 200, 330]
    assert counted(coupled) == {"absurd effort": 1}


def test_a_message_with_absurd_efforts_counts_once(coupled):
    """However many of its joints and followers have them: it is messages that are counted."""
    configure(coupled, max_effort=1000.0)
    message = all_of(1 * S, effort=(2000, 2000, math.inf))
    message.effort[message.name.index("wrist")] = message.effort[message.name.index("elbow")] = 1e4
    coupled.update(message, NOW)
    assert counted(coupled) == {"absurd effort": 1}


def test_beyond_multiples_of_limits():
    """Velocities refuse the message, efforts are unknown, in N m; a limit or a factor of 0 bounds nothing."""
    limits = {"velocity": np.array([6.0, 0.0, np.inf]), "effort": np.array([50.0, 0.0, np.inf])}
    assembler = JointStateAssembler(
        Joints(NAMES, **limits), Options(beyond_velocity=3.0, beyond_effort=4.0, effort_scale={"shoulder": 10.0})
    )
    state = assembler.update(whole(1 * S, velocity=[-18, 1e6, 1e6], effort=[20, 1e6, -1e6]), NOW)
    assert state.velocity.tolist() == [-18, 1e6, 1e6] and state.effort.tolist() == [200, 1e6, -1e6]
    named = ["'shoulder': velocity is -18.1,", "±18 ", "absurd.beyond_velocity"]
    refused(assembler, whole(2 * S, velocity=[-18.1, 0, 0]), "absurd value", *named)
    assert assembler.update(whole(2 * S, velocity=[0, 0, 0], effort=[-20.1, 0, 0]), NOW).effort is None
    assert counted(assembler) == {"absurd effort": 1} and assembler.without_effort == ["shoulder"]
    configure(assembler, max_velocity=10.0, max_effort=100.0)
    refused(assembler, whole(3 * S, velocity=[10.1, 0, 0]), "absurd value", "±10 ")
    assert assembler.update(whole(3 * S, velocity=[0, 0, 0], effort=[10.1, 0, 0]), NOW).effort is None
    configure(assembler, max_velocity=0.0, max_effort=0.0, beyond_velocity=0.0, beyond_effort=0.0)
    assert assembler.update(whole(4 * S, velocity=[1e6, 0, 0], effort=[1e6, 0, 0]), NOW).effort[0] == 1e7


# --- positions that no motion has led to


PERIOD = 8 * MS


def moving(*, limit=(3.0, 3.0, 0.0), jump=0.1, **options):
    """Return an assembler that judges steps, with a state at PERIOD of all joints at 0, at rest."""
    joints = Joints(NAMES, continuous=("wrist",), velocity=np.array(limit))
    assembler = JointStateAssembler(joints, Options(jump=jump, **options))
    if not options.get("estimate_velocity"):
        assert assembler.update(at_rest(1), NOW)
    return assembler


def at_rest(k, *position, velocity=(0, 0, 0)):
    """Return a message of all joints at a number of periods."""
    return joint_state(NAMES, position or (0, 0, 0), velocity, (), k * PERIOD)


@pytest.mark.parametrize(
    ("step", "velocities", "periods", "explained"),
    [
        ((0.129, 0, 0), (0, 0), 1, True),  # 0.1 and what 3 rad/s do in 10 ms, the least time
        ((0, -0.131, 0), (0, 0), 1, False),
        ((0.219, 0, 0), (0, 0), 5, True),
        ((0.221, 0, 0), (0, 0), 5, False),
        ((0, 0, 0.099), (0, 0), 1, True),  # without a limit
        ((0, 0, 0.101), (0, 0), 1, False),
        ((0, 0, 0.299), (-1, 10), 1, True),  # twice the larger velocity
        ((0, 0, -0.299), (10, 0), 1, True),
        ((0, 0, 0.301), (10, -2), 1, False),
        ((0, 0, 2 * math.pi - 0.09), (0, 0), 1, True),  # it turns round
        ((0, 2 * math.pi - 0.09, 0), (0, 0), 1, False),
        ((0, 0, 9.0), (0, 0), 7, True),  # too long ago, without a limit
        ((0, 0, 9.0), (0, 0), 6, False),
        ((1.58, 0, 0), (0, 0), 62, True),
        ((1.60, 0, 0), (0, 0), 62, False),
        ((3.0, 3.0, 3.0), (0, 0), 63, True),  # too long ago for all
        ((3.0, 0, 0), (0, 0), 0, False),  # at the same stamp
    ],
)
def test_jump(step, velocities, periods, explained):
    """Refused by name, with the step and the velocities, where neither these nor the limit explain it."""
    assembler = moving()
    before, after = velocities
    assembler.update(at_rest(2, velocity=[before] * 3), NOW)
    message = at_rest(2 + periods, *step, velocity=[after] * 3)
    if explained:
        assert assembler.update(message, NOW).position.tolist() == list(step)
    else:
        k = int(np.argmax(np.abs(step)))
        refused(assembler, message, "jump", f"'{NAMES[k]}': position went from 0 to {step[k]:.9g}", "absurd.jump")
        assert assembler.update(at_rest(3 + periods), NOW).position.tolist() == [0, 0, 0]
    assert not counted(assembler)


def test_a_jump_is_believed_when_it_stays():
    """With the third message in a row that agrees with the one before; what one row said is forgotten with a good one."""
    assembler = moving()
    for k in range(2, 200, 3):  # two rows of garbage and a good one
        refused(assembler, at_rest(k, 1, 0, 0), "jump")
        refused(assembler, at_rest(k + 1, 1, 0, 0), "jump")
        assembler.update(at_rest(k + 2), NOW)
    for k in range(200, 230):  # garbage that never agrees
        refused(assembler, at_rest(k, (-1) ** k, 0, 0), "jump")
    assembler.update(at_rest(230), NOW)
    refused(assembler, at_rest(231, 2, 0, 0), "jump")
    refused(assembler, at_rest(232, 2.05, 0, 0), "jump")
    assert not counted(assembler)
    assert assembler.update(at_rest(233, 2.1, 0, 0), NOW).position.tolist() == [2.1, 0, 0]
    assert counted(assembler) == {"positions jumped": 1}
    assert assembler.jumps.last == "joint 'shoulder': position went from 0 to 2.1"
    refused(assembler, at_rest(234, 0, 0, 0), "jump")  # from now on this is the place


def test_a_jump_of_one_joint_leaves_others_alone():
    """Those that another driver sends go on; and a jump of all is believed as one."""
    assembler = moving()
    for k in range(2, 7):
        refused(assembler, joint_state(["wrist"], [(-1) ** k], [0], (), k * PERIOD), "jump")
        arm = joint_state(NAMES[:2], [0.01 * k] * 2, [0, 0], (), k * PERIOD)
        assert assembler.update(arm, NOW).position.tolist() == [0.01 * k] * 2 + [0]
    for k in (7, 8):
        refused(assembler, at_rest(k, 1, 2, 3), "jump")
    assert assembler.update(at_rest(9, 1, 2, 3), NOW).position.tolist() == [1, 2, 3]
    assert counted(assembler) == {"positions jumped": 1}


def test_after_all_was_forgotten_nothing_is_a_jump():
    """Nor by another clock, nor where it is not judged."""
    assembler = moving()
    assembler.forget()
    assert assembler.update(at_rest(2, 2, 2, 2), NOW)
    assert assembler.update(joint_state(NAMES, [0, 0, 0], [0, 0, 0], ()), 3 * PERIOD)
    refused(assembler, at_rest(0, 2, 2, 2), "jump", now=4 * PERIOD)
    configure(assembler, jump=0.0)
    assert assembler.update(joint_state(NAMES, [2, 2, 2], [0, 0, 0], ()), 4 * PERIOD)


def test_jump_where_velocities_are_estimated():
    """A missing velocity may be as large as velocities may be; one that is believed begins the estimate anew."""
    options = {"beyond_velocity": 3.0, "estimate_velocity": True, "velocity_filter_time": 0.0}
    assembler = moving(limit=(3.0, 3.0, 3.0), **options)

    def update(k, *position):
        return assembler.update(joint_state(NAMES, position, (), (), k * PERIOD), NOW)

    assert update(1, 0, 0, 0) is None
    assert update(2, 0.18, 0, 0).velocity[0] == pytest.approx(0.18 / 8e-3)
    for k in (3, 4):
        with pytest.raises(RejectedError, match=r"'elbow'.* 0 and nan") as rejection:
            update(k, 0.18, 0.5, 0)
        assert rejection.value.cause == "jump"
    assert update(5, 0.18, 0.5, 0) is None  # of the elbow there is no velocity yet
    assert update(6, 0.18, 0.5, 0).velocity.tolist() == [0, 0, 0]


# --- efforts as they are meant


def test_scaled_efforts(coupled):
    """In N m per unit sent, of joints and of followers; the bound is on N m."""
    configure(coupled, effort_scale={"elbow": -0.5, "thumb": 2.0, "*": 10.0}, max_effort=3000.0)
    assert coupled.update(whole(1 * S), NOW).effort.tolist() == [1000, -100, 3000]
    assert coupled.update(all_of(1 * S, effort=(1, 2, 3)), NOW).effort.tolist() == [1000, -90, 3000 - 2 * 2 + 3 * 30]
    assert not counted(coupled)
    assert coupled.update(whole(1 * S, 1.0, ["wrist"]), NOW).effort is None
    assert counted(coupled) == {"absurd effort": 1}


def test_efforts_that_are_not_to_be_used(coupled):
    """They are unknown, whatever is sent, and not even absurd."""
    configure(coupled, effort_available={"thumb": False})
    assert coupled.update(all_of(1 * S, effort=(5, 2, 3)), NOW).effort.tolist() == [100, 201, 309]
    configure(coupled, effort_available={"elbow": False}, max_effort=1e6)
    message = all_of(2 * S, effort=(5, 2, 3))
    message.effort[message.name.index("elbow")] = math.inf
    assert_state(coupled.update(message, NOW), [1, 2, 3], 2 * S, 2 * S, effort=False)
    assert coupled.without_effort == ["elbow"]
    assert not counted(coupled)
    configure(coupled, effort_available={"*": False, "elbow": True})
    coupled.update(whole(3 * S), NOW)
    assert coupled.without_effort == ["shoulder", "wrist"]


# --- stamps by the clock


def test_stamps_in_step():
    """As soon as one stamp agrees with the clock, those further away than max_age are rejected, by name and distance."""
    assembler = assembling(max_age=1.0)
    assert_state(assembler.update(whole(50 * S), 50 * S + 100 * MS), [1, 2, 3], 50 * S, 50 * S)
    refused(assembler, whole(60 * S), "stamp from the past", "shoulder", "1.001 s", "max_age = 1 s", now=61 * S + MS)
    refused(assembler, whole(62 * S), "stamp from the future", "1.001 s", now=61 * S - MS)
    for stamp, now in ((60 * S, 61 * S), (62 * S, 61 * S)):  # exactly max_age
        assert_state(assembler.update(whole(stamp), now), [1, 2, 3], stamp, stamp)
    assert assembler.stamps.in_step is True


def test_stamps_of_another_time():
    """From the first one on far away: accepted, until one agrees with the clock."""
    assembler = assembling(max_age=1.0)
    for k in range(3):
        stamp = 5 * S + k * 10 * MS
        assert_state(assembler.update(whole(stamp), NOW), [1, 2, 3], stamp, stamp)
        assert assembler.stamps.in_step is False
        assert assembler.stamps.offset == pytest.approx(72.0 - k * 0.01)
    assert_state(assembler.update(whole(NOW), NOW), [1, 2, 3], NOW, NOW)
    assert assembler.stamps.in_step is True
    refused(assembler, whole(5 * S + 30 * MS), "stamp from the past")


def test_a_recording_in_a_loop():
    """Its stamps are of another time, and jump back at its beginning: published but for one message of every round."""
    assembler = assembling(max_age=1.0)
    published = 0
    for k in range(40):
        try:
            published += assembler.update(whole(5 * S + (k % 10) * 200 * MS), NOW + k * 200 * MS) is not None
        except RejectedError as rejection:
            assert rejection.cause == "stamp from the past"
            assert k % 10 == 0
    assert published == 37
    assert counted(assembler) == {"time jumped back": 3}


def test_stamps_of_another_time_refused():
    """With foreign_time refuse none of them counts, and the cause says why."""
    assembler = assembling(max_age=1.0, refuse_foreign=True)
    refused(assembler, whole(5 * S), "foreign time", "shoulder", "72.000 s", "max_age = 1 s")
    refused(assembler, whole(NOW + 2 * S), "foreign time", "2.000 s")
    assert assembler.missing == list(NAMES)
    assert_state(assembler.update(whole(NOW), NOW), [1, 2, 3], NOW, NOW)
    refused(assembler, whole(5 * S), "stamp from the past")


@pytest.mark.parametrize(("refuse", "believed"), [(False, 20), (True, 25)])
def test_a_clock_that_was_set(refuse, believed):
    """After ten seconds in which all stamps are apart by the same amount they are foreign; with refuse they never are."""
    assembler = assembling(max_age=1.0, refuse_foreign=refuse)
    assembler.update(whole(NOW), NOW)
    for k in range(25):
        now = NOW + 5 * S + k * 500 * MS
        if k < believed:
            refused(assembler, whole(now - 4 * S), "stamp from the past", now=now)
        else:
            assert_state(assembler.update(whole(now - 4 * S), now), [1, 2, 3], now - 4 * S, now - 4 * S)


def test_followers_are_judged_by_the_clock():
    """They have no order, but an age."""
    assembler = assembling(mimics=MIMICS, max_age=1.0)
    assembler.update(whole(NOW), NOW)
    refused(assembler, hand(NOW - S - 1), "stamp from the past", "thumb")
    refused(assembler, hand(NOW + S + 1), "stamp from the future", "thumb")
    assert assembler.update(hand(NOW - S), NOW) is None


def test_before_the_clock_has_begun():
    """Simulated time of zero is no time to compare a stamp with; nor is one without stamp compared with anything."""
    assembler = assembling(max_age=1.0, refuse_foreign=True)
    assert_state(assembler.update(whole(50 * S), 0), [1, 2, 3], 50 * S, 50 * S)
    assert assembler.stamps.in_step is None
    assert_state(assembler.update(whole(0), 7 * S), [1, 2, 3], 7 * S, 7 * S)
    assert assembler.stamps.in_step is None


# --- velocities that are not sent


def positions(stamp, *values, names=NAMES, **fields):
    """Return a message with positions alone, unless there is more."""
    return joint_state(names, values, fields.get("velocity", ()), fields.get("effort", ()), stamp)


@pytest.fixture
def estimating():
    """Return an assembler that estimates velocities, with a filter time of 0.1 s."""
    return assembling(estimate_velocity=True, velocity_filter_time=0.1)


def test_estimated_velocity(estimating):
    """Handed out and flagged once the filter time has passed; until then counted, and no state."""
    for k in range(10):
        assert estimating.update(positions(S + k * 10 * MS, 0.02 * k, -0.03 * k, 1.0), NOW) is None
    assert counted(estimating) == {"awaiting velocity": 10}
    assert estimating.missing == []
    state = estimating.update(positions(S + 100 * MS, 0.2, -0.3, 1.0), NOW)
    np.testing.assert_allclose(state.velocity, [2.0, -3.0, 0.0], rtol=1e-12)
    assert state.velocity_estimated
    assert estimating.estimated == list(NAMES)
    assert counted(estimating) == {"awaiting velocity": 10}


def test_only_what_is_missing_is_estimated(estimating):
    """Velocities that are sent count as they are; the flag is up as long as one joint needs an estimate."""
    for k in range(11):
        velocity = [7.0, math.nan, 9.0]
        state = estimating.update(positions(S + k * 10 * MS, k, 0.5 * k, k, velocity=velocity), NOW)
        assert (state is not None) == (k == 10)
    np.testing.assert_allclose(state.velocity, [7.0, 50.0, 9.0], rtol=1e-12)
    assert state.velocity_estimated and estimating.estimated == ["elbow"]
    state = estimating.update(positions(S + 110 * MS, 9, 5.5, 9, velocity=[1, 2, 3]), NOW)
    assert state.velocity.tolist() == [1, 2, 3]
    assert not state.velocity_estimated and estimating.estimated == []
    # and the estimate is ready when it is needed again, as positions have been followed all the while
    state = estimating.update(positions(S + 120 * MS, 10, 6.0, 9, velocity=[1, math.nan, 3]), NOW)
    np.testing.assert_allclose(state.velocity, [1.0, 50.0, 3.0], rtol=1e-12)


@pytest.mark.parametrize("velocity", [math.inf, -math.inf])
def test_infinite_velocity_is_not_estimated(estimating, velocity):
    """It is no way of saying that there is none."""
    with pytest.raises(RejectedError, match="elbow") as rejection:
        estimating.update(positions(S, 1, 2, 3, velocity=[1, velocity, 3]), NOW)
    assert rejection.value.cause == "no velocity"


def test_rejected_messages_do_not_enter_estimates(estimating):
    """Late, malformed or from the past: none of them is a step."""
    for k in range(11):
        estimating.update(positions(10 * S + k * 10 * MS, k, k, k), NOW)
    for message, cause in (
        (positions(10 * S, 99, 99, 99), "late"),
        (positions(2 * S, 99, 99, 99), "stamp from the past"),
        (positions(10 * S + 110 * MS, 99, 99, math.nan), "no position"),
    ):
        refused(estimating, message, cause)
    state = estimating.update(positions(10 * S + 110 * MS, 11, 11, 11), NOW)
    np.testing.assert_allclose(state.velocity, 100.0, rtol=1e-12)


def test_estimates_start_anew_after_a_gap(estimating):
    """Of each joint after the timeout that it has; meanwhile there is no state."""
    configure(estimating, timeouts={"wrist": 2.0})
    for k in range(11):
        estimating.update(positions(S + k * 10 * MS, k, k, k), NOW)
    at = S + 100 * MS + 500 * MS + 1
    assert estimating.update(positions(at, 60, 60, 60), NOW) is None
    for k in range(1, 10):
        assert estimating.update(positions(at + k * 10 * MS, 60 + 2 * k, 60 + 2 * k, 60 + 2 * k), NOW) is None
    state = estimating.update(positions(at + 100 * MS, 80, 80, 80), NOW)
    np.testing.assert_allclose(state.velocity[:2], 200.0, rtol=1e-12)
    assert 99.0 < state.velocity[2] < 199.0  # that of before counts still a little


def test_sparse_positions_have_estimates():
    """Where positions come more seldom than the timeout, three periods make a gap."""
    assembler = assembling(timeout=0.0, estimate_velocity=True)
    assembler.update(positions(10 * S, 0, 0, 0), NOW)
    for k in (1, 2, 3, 6):
        velocity = assembler.update(positions((10 + k) * S, k, 2 * k, 0), NOW).velocity
        np.testing.assert_allclose(velocity, [1, 2, 0], rtol=1e-9)
    assert assembler.update(positions(26 * S, 7, 7, 7), NOW) is None


@pytest.mark.parametrize("moved", [5.0, -5.0])
def test_absurd_step(estimating, moved):
    """A step that is faster than any joint rejects the message; the joint starts anew, of others nothing has happened."""
    configure(estimating, max_velocity=120.0)
    for k in range(11):
        estimating.update(positions(S + k * 10 * MS, k, k, k), NOW)
    with pytest.raises(RejectedError, match=r"'elbow': its step to position .* faster than 120") as rejection:
        estimating.update(positions(S + 110 * MS, 11, 10 + moved, 11), NOW)
    assert rejection.value.cause == "absurd value"
    for k in range(12, 22):
        assert estimating.update(positions(S + k * 10 * MS, k, k, k), NOW) is None
    np.testing.assert_allclose(estimating.update(positions(S + 220 * MS, 22, 22, 22), NOW).velocity, 100.0, rtol=1e-9)


def test_steps_of_joints_with_velocities_are_not_judged(estimating):
    """A position that is reset, as by homing, says nothing against a velocity that is sent."""
    configure(estimating, max_velocity=120.0)
    for k, position in enumerate((0.0, 50.0, 0.0)):
        state = estimating.update(positions(S + k * 10 * MS, 1, position, 1, velocity=[1, 2, 3]), NOW)
        assert state.velocity.tolist() == [1, 2, 3]


@pytest.mark.parametrize("time", [0.0, 0.02])
def test_repeated_stamps(time):
    """A driver that sends each stamp several times has the velocities of one that sends it once."""
    assembler = assembling(estimate_velocity=True, velocity_filter_time=time)
    for k in range(30):
        for _ in range(3):
            state = assembler.update(positions(S + k * 10 * MS, 0.5 * k, -k, 0), NOW)
    np.testing.assert_allclose(state.velocity, [50, -100, 0], atol=1e-9)


def test_estimates_start_anew_when_time_jumps_back(estimating):
    """No step leads from the one time to the other."""
    for k in range(11):
        estimating.update(positions(50 * S + k * 10 * MS, k, k, k), NOW)
    refused(estimating, positions(10 * S, 500, 500, 500), "stamp from the past")
    for k in range(1, 11):
        assert estimating.update(positions(10 * S + k * 10 * MS, 500 + 2 * k, 500, 500), NOW) is None
    state = estimating.update(positions(10 * S + 110 * MS, 522, 500, 500), NOW)
    np.testing.assert_allclose(state.velocity, [200, 0, 0], atol=1e-9)


def test_estimates_start_anew_after_all_was_forgotten(estimating):
    """As after a pause, be it ever so short: nothing of before is left."""
    for k in range(11):
        estimating.update(positions(S + k * 10 * MS, k, k, k), NOW)
    estimating.forget()
    assert estimating.missing == list(NAMES)
    states = [estimating.update(positions(S + k * 10 * MS, 0, 0, 50 - 2 * k), NOW) for k in range(11, 22)]
    assert states[:-1] == [None] * 10
    np.testing.assert_allclose(states[-1].velocity, [0, 0, -200], atol=1e-9)


@pytest.mark.parametrize("behind", [0, 5 * MS, 60 * S], ids=["at once", "by a delay", "of another time"])
def test_estimates_start_anew_when_stamps_begin(estimating, behind):
    """A driver's stamps need not be of the clock that took the time of reception: no step leads from one to the other."""
    for k in range(11):
        estimating.update(positions(0, k, k, k), NOW + k * 10 * MS)
    begin = NOW + 100 * MS - behind
    states = [estimating.update(positions(begin + k * 10 * MS, 10 - k, 0, 0), NOW) for k in range(30)]
    assert [state is not None for state in states] == [k >= 10 for k in range(30)]
    for state in states[10:]:
        np.testing.assert_allclose(state.velocity, [-100, 0, 0], atol=1e-9)


def test_no_longer_estimated(estimating):
    """Once estimates are refused, velocities that are sent bear no flag, and those that are not are missed."""
    for k in range(11):
        state = estimating.update(positions(S + k * 10 * MS, k, k, k), NOW)
    assert state.velocity_estimated
    configure(estimating, estimate_velocity=False)
    state = estimating.update(whole(2 * S), NOW)
    assert_state(state, [1, 2, 3], 2 * S, 2 * S)
    assert not state.velocity_estimated
    assert estimating.estimated == []
    with pytest.raises(RejectedError) as rejection:
        estimating.update(positions(3 * S, 1, 2, 3), NOW)
    assert rejection.value.cause == "no velocity"


def test_estimates_are_forgotten_when_they_are_refused(estimating):
    """Neither are those that were handed out missing, nor do they go on when they are wanted again."""
    for k in range(11):
        state = estimating.update(positions(S + k * 10 * MS, k, k, k), NOW)
    assert state.velocity_estimated
    configure(estimating, estimate_velocity=False)
    assert estimating.estimated == []
    with pytest.raises(RejectedError, match="'elbow': velocity is nan") as rejection:
        estimating.update(whole(S + 110 * MS, names=["shoulder"]), NOW)
    assert rejection.value.cause == "no velocity"
    configure(estimating, estimate_velocity=True)
    for k in range(12, 23):
        state = estimating.update(positions(S + k * 10 * MS, -k, -k, -k), NOW)
        assert (state is not None) == (k == 22)
    np.testing.assert_allclose(state.velocity, -100.0, rtol=1e-12)


def test_velocities_that_were_sent_stay_when_estimates_are_refused(estimating):
    """They are no estimates."""
    estimating.update(whole(1 * S), NOW)
    configure(estimating, estimate_velocity=False)
    assert_state(estimating.update(whole(1 * S, names=["wrist"]), NOW), [1, 2, 3], 1 * S, 1 * S)


def test_forgotten_joints_are_not_estimated(estimating):
    """The flag does not outlive the joint: of what comes next, nothing is an estimate."""
    for k in range(11):
        estimating.update(positions(S + k * 10 * MS, k, k, k), NOW)
    assert estimating.estimated == list(NAMES)
    estimating.forget()
    assert estimating.estimated == []
    assert estimating.update(whole(2 * S, names=ARM), NOW) is None
    assert estimating.estimated == []
    state = estimating.update(whole(2 * S, names=GRIPPER), NOW)
    assert_state(state, [1, 2, 3], 2 * S, 2 * S)
    assert not state.velocity_estimated


def test_steps_without_a_bound(estimating):
    """0 is none."""
    configure(estimating, max_velocity=0.0)
    for k in range(11):
        state = estimating.update(positions(S + k * 10 * MS, 1e9 * k, 0, 0), NOW)
    assert state.velocity[0] == pytest.approx(1e11)


@pytest.mark.parametrize("timeout", [0.5, 0.0])
def test_estimates_of_a_slow_driver(timeout):
    """Of one that sends less often than the age limit, or of one that has none: gaps are counted in its own periods."""
    assembler = assembling(["wrist"], timeout=timeout, estimate_velocity=True, velocity_filter_time=0.0)
    times = [10, 19, 28, 54, 80]
    states = [assembler.update(positions(t * S, 2.0 * t, names=["wrist"]), NOW) for t in times]
    assert [state is not None for state in states] == [False, True, True, True, True]
    assert [state.velocity[0] for state in states[1:]] == [2.0] * 4
    assert assembler.update(positions(159 * S, 0.0, names=["wrist"]), NOW) is None  # more than three times 26 s
    assert assembler.update(positions(169 * S + 1, 0.0, names=["wrist"]), NOW) is None  # of the first two, 10 s


def test_estimates_where_a_stamp_comes_often():
    """Two drivers of one joint, or one that reads it several times between two stamps: the velocity is the true one."""
    assembler = assembling(["wrist"], estimate_velocity=True, velocity_filter_time=0.05)
    for k in range(100):
        for j in range(4):
            state = assembler.update(positions(S + k * 10 * MS, 3.0 * (k + j / 4) * 0.01, names=["wrist"]), NOW)
        assert (state is not None) == (k >= 5)
        if state:
            assert state.velocity[0] == pytest.approx(3.0, rel=1e-9)


def test_without_filter_time():
    """Of the two newest positions alone; the second message brings a state."""
    assembler = assembling(estimate_velocity=True, velocity_filter_time=0.0)
    assert assembler.update(positions(1 * S, 1, 2, 3), NOW) is None
    state = assembler.update(positions(1 * S + 250 * MS, 2, 2, 2.5), NOW)
    np.testing.assert_allclose(state.velocity, [4, 0, -2], atol=1e-12)


def test_estimate_of_a_joint_that_turns_round():
    """A step of a continuous joint is the shorter way; of another joint it is what it is."""
    assembler = assembling(continuous=["wrist"], estimate_velocity=True, velocity_filter_time=0.0)
    assembler.update(positions(1 * S, 0, 3.1, 3.1), NOW)
    state = assembler.update(positions(1 * S + 100 * MS, 0, -3.1, -3.1), NOW)
    np.testing.assert_allclose(state.velocity, [0, -62, 10 * (2 * math.pi - 6.2)], atol=1e-9)


# --- any sequence, against a model that keeps dictionaries


LIMITS = {"shoulder": (-math.inf, math.inf), "elbow": (-5.0, 4.0), "wrist": (-6.0, math.inf)}
CONTINUOUS = ("shoulder",)
OUTCOMES = ("incomplete", "foreign", "followers only", "awaiting velocity")


def of(name, entries, default):
    """Return what is said of a joint, else of all others, else the default."""
    return entries.get(name, entries.get("*", default))


def span(seconds):
    """Return seconds in nanoseconds."""
    return round(1000 * seconds) * MS


class Model:
    """The same, slowly: what is known of each joint, by name; of its positions, all steps it ever made."""

    def __init__(self, options):
        self.options = options
        self.jumps = self.late_jumps = self.believed = self.disagreements = self.absurd = 0
        self.forget()
        self.forget_clocks()

    def forget(self):
        """Know nothing of joints and followers any more."""
        self.known, self.efforts, self.tracks = {}, {}, {}

    def forget_clocks(self):
        """Know nothing of the sources any more."""
        self.in_step = self.refused = None
        self.runs = {}  # of each source, stamps that were too old, one after the other

    def estimate(self, wanted):
        """Estimate velocities from now on, or no longer: then there are no positions to do so when they are wanted again."""
        self.options = self.options._replace(estimate_velocity=wanted)
        if not wanted:
            self.tracks = {}
            for entry in self.known.values():
                if entry["estimated"]:
                    entry["velocity"], entry["estimated"] = math.nan, False

    def update(self, message, now):
        """Return the state's fields, an outcome, or the causes of a rejection: where there are several, any will do."""
        if len(set(message.name)) < len(message.name):
            return {"duplicate name"}
        names = [name for name in message.name if name in NAMES]
        followers = [name for name in message.name if name in MIMICS]
        if not names and not followers:
            return "foreign"
        entries = {name: {} for name in message.name}
        if causes := self._malformed(message, now, names, entries):
            return causes
        at = message.header.stamp.sec * S + message.header.stamp.nanosec
        stamped = at != 0
        at = at if stamped else now
        if cause := self._out_of_time(at, stamped, now, names):
            return {cause}
        for name in names:
            entries[name] |= {"at": at, "stamped": stamped, "estimated": False}
        if self.options.estimate_velocity and not self._follow_positions(names, entries):
            return {"absurd value"}
        for name in names if self.options.estimate_velocity else ():
            if math.isnan(entries[name]["velocity"]):
                entries[name] |= {"velocity": self._velocity(name, at), "estimated": True}
        self.known |= {name: entries[name] for name in names}
        for name in followers:
            self.efforts[name] = (at, self._effort(name, entries[name]["effort"]))
        self.absurd += any(self._is_absurd(name, entries[name]["effort"]) for name in names + followers)
        self.disagreements += any(self._is_apart(name, entries[name]["position"], at) for name in followers)
        return self._state() if names else "followers only"

    def _malformed(self, message, now, names, entries):
        """Return all that is wrong with a message as such, and put its values into the entries."""
        causes, most = set(), self.options
        stamp = message.header.stamp
        if stamp.sec < 0 or stamp.nanosec >= S:
            causes.add("malformed stamp")
        if not (stamp.sec or stamp.nanosec or now):
            causes.add("no time")
        for field in ("position", "velocity", "effort"):
            values = getattr(message, field) or [math.nan] * len(message.name)
            if len(values) != len(message.name):
                causes.add("wrong length")
            for name, value in zip(message.name, values, strict=False):
                entries[name][field] = value
        for name in names:
            position, velocity = entries[name].get("position", 0.0), entries[name].get("velocity", 0.0)
            lower, upper = LIMITS[name]
            if not math.isfinite(position):
                causes.add("no position")
            excesses = [
                (abs(position) if name not in CONTINUOUS else 0.0, most.max_position),
                (max(lower - position, position - upper), most.beyond_limits),
                (abs(velocity) if math.isfinite(velocity) else 0.0, most.max_velocity),
            ]
            if any(0.0 < bound < size for size, bound in excesses):
                causes.add("absurd value")
        return causes

    def _out_of_time(self, at, stamped, now, names):
        """Return why a stamp is not accepted; if it says that time has jumped back, forget all."""
        far, most = None, span(self.options.max_age)
        if stamped and now and most:
            far = abs(now - at) > most
            if far and (self.in_step or self.options.refuse_foreign) and self._out_of_step(now, now - at, most):
                return (
                    ("stamp from the past" if at < now else "stamp from the future") if self.in_step else "foreign time"
                )
        alike = [name for name in names if self.known.get(name, {}).get("stamped") == stamped]
        if alike:
            source = min(names, key=NAMES.index)
            newest = max(alike, key=lambda name: self.known[name]["at"])
            last, late = self.known[newest]["at"], max(S, self._timeout(newest))
            if at >= last:
                self.runs.pop(source, None)
            elif cause := self._too_old(at, last - at <= late, late, self.runs.setdefault(source, [])):
                return cause
            else:
                self.jumps += 1
                self.late_jumps += last - at <= late
                self.forget()
                self.runs = {}
        if far is not None:
            self.believed += far and self.in_step is True
            self.refused = None
            near = abs(now - at) <= most / 2
            self.in_step = near if self.in_step is False else not far
        return None

    def _out_of_step(self, now, offset, most):
        """Return whether a stamp is refused by the clock."""
        if self.refused is None or abs(offset - self.refused[1]) > most:
            self.refused = now, offset
        return self.options.refuse_foreign or now < self.refused[0] + 10 * S

    def _too_old(self, at, is_late, most, run):
        """Return why a stamp is not accepted that is older than the last one, or None if it is."""
        if run and not run[-1] <= at <= run[-1] + most:
            run.clear()
        run.append(at)
        if is_late:
            return None if len(run) >= 5 and at - run[0] >= S // 2 else "late"
        return None if len(run) >= 2 else "stamp from the past"

    def _follow_positions(self, names, entries):
        """Keep the steps that joints make; return False, and keep none, if one is too fast to be a velocity."""
        tracks, fast = {}, []
        for name in names:
            entry, track = entries[name], self.tracks.get(name)
            at, position = entry["at"], entry["position"]
            begun = {"stamped": entry["stamped"], "since": at, "at": at, "position": position, "steps": []}
            if not track or track["stamped"] != entry["stamped"] or at < track["at"]:
                tracks[name] = begun
                continue
            elapsed = at - track["at"]
            periods = 3 * track["steps"][-1][1] if track["steps"] else 10.0
            if elapsed > max(self._timeout(name), round(periods * S)):
                tracks[name] = begun
            elif elapsed:
                step = position - track["position"]
                if name in CONTINUOUS:
                    step = (step + math.pi) % (2.0 * math.pi) - math.pi
                steps = [*track["steps"], (at, elapsed / S, step)]
                tracks[name] = track | {"at": at, "position": position, "steps": steps}
                if math.isnan(entry["velocity"]) and 0.0 < self.options.max_velocity < abs(step / (elapsed / S)):
                    fast.append(name)
        for name in fast:
            del self.tracks[name]
        if not fast:
            self.tracks |= tracks
        return not fast

    def _velocity(self, name, at):
        """Return the velocity of a joint by its positions, NaN where it is not known."""
        track, time = self.tracks[name], self.options.velocity_filter_time
        if not track["steps"] or at - track["since"] < round(time * S):
            return math.nan
        if not time:
            _, elapsed, step = track["steps"][-1]
            return step / elapsed
        weighted, weights = 0.0, 0.0
        for then, elapsed, step in track["steps"]:
            weight = math.exp(-(at - then) / S / time) * -math.expm1(-elapsed / time)
            weighted, weights = weighted + weight * step / elapsed, weights + weight
        return weighted / weights

    def _effort(self, name, sent):
        """Return N m, NaN where it is not known."""
        if not of(name, self.options.effort_available, True) or self._is_absurd(name, sent):
            return math.nan
        return sent * of(name, self.options.effort_scale, 1.0)

    def _is_absurd(self, name, sent):
        if not of(name, self.options.effort_available, True) or math.isnan(sent):
            return False
        size = abs(sent * of(name, self.options.effort_scale, 1.0))
        return size == math.inf or (self.options.max_effort > 0 and size > self.options.max_effort)

    def _is_apart(self, name, position, at):
        leader, multiplier, offset = MIMICS[name]
        timeout = self._timeout(leader)
        if leader not in self.known or (timeout and abs(self.known[leader]["at"] - at) > timeout):
            return False
        distance = abs(position - multiplier * self.known[leader]["position"] - offset)
        return math.isfinite(position) and 0.0 < self.options.mimic_tolerance < distance

    def _timeout(self, name):
        """Return the timeout of a joint [ns], 0 for none."""
        return span(of(name, self.options.timeouts, self.options.timeout))

    def stale(self, now):
        """Return the joints that are known but too old."""
        timeouts = {name: self._timeout(name) for name in NAMES if name in self.known}
        return [name for name, timeout in timeouts.items() if timeout and now - self.known[name]["at"] > timeout]

    def _state(self):
        if len(self.known) < len(NAMES):
            return "incomplete"
        joints = [self.known[name] for name in NAMES]
        newest, oldest = (choose(joint["at"] for joint in joints) for choose in (max, min))
        if self.stale(newest):
            return {"stale joint"}
        velocity, estimated = ([joint[key] for joint in joints] for key in ("velocity", "estimated"))
        if any(math.isnan(one) for one in velocity) and self.options.estimate_velocity:
            return "awaiting velocity"
        if not all(map(math.isfinite, velocity)):
            return {"no velocity"}
        effort = [self._effort(name, joint["effort"]) for name, joint in zip(NAMES, joints, strict=True)]
        if not all(map(math.isfinite, effort)):
            effort = None
        for name, (leader, multiplier, _) in MIMICS.items() if effort else ():
            at, own = self.efforts.get(name, (0, math.nan))
            if math.isfinite(own) and (not self._timeout(name) or abs(newest - at) <= self._timeout(name)):
                effort[NAMES.index(leader)] += multiplier * own
        position = [joint["position"] for joint in joints]
        unstamped = any(not joint["stamped"] for joint in joints)
        return position, velocity, effort, newest, oldest, unstamped, any(estimated)


def by_joint(values):
    """Draw values of some joints by name, perhaps of all others."""
    return st.dictionaries(st.sampled_from((*NAMES, *MIMICS, "*")), values, max_size=3)


@st.composite
def some_options(draw):
    """Draw options: each of them often as it is by default; timeouts are tenths of a second, which occur exactly."""

    def seldom(default, values):
        return draw(values) if draw(st.integers(0, 2)) == 0 else default

    return Options(
        timeout=draw(st.sampled_from((0.5, 0.5, 0.0, 0.3, 2.0))),
        timeouts=seldom({}, by_joint(st.sampled_from((0.0, 0.2, 0.5, 1.0)))),
        mimic_tolerance=draw(st.sampled_from((0.01, 0.0, 2.0))),
        max_age=draw(st.sampled_from((1.05, 0.0, 0.45, 2.05))),
        refuse_foreign=seldom(False, st.booleans()),
        estimate_velocity=draw(st.booleans()),
        velocity_filter_time=draw(st.sampled_from((0.1, 0.0, 0.01, 0.2, 0.5))),
        effort_available=seldom({}, by_joint(st.booleans())),
        effort_scale=seldom({}, by_joint(st.sampled_from((2.0, -0.5, 1e-3)))),
        max_position=seldom(0.0, st.sampled_from((6.0, 8.5))),
        max_velocity=seldom(0.0, st.sampled_from((7.0, 8.5))),
        max_effort=seldom(0.0, st.sampled_from((3.0, 8.0))),
        beyond_limits=seldom(0.0, st.sampled_from((0.5, 3.0))),
    )


@st.composite
def messages(draw):
    """Draw a message, mostly good, with some of the joints, but without its stamp."""
    known = draw(st.sampled_from((NAMES, NAMES, (*NAMES, "lid"), (*NAMES, *MIMICS), (*NAMES, "lid", *MIMICS))))
    if draw(st.integers(0, 2)):
        names = draw(st.permutations(known))
    else:
        names = draw(st.lists(st.sampled_from(known), max_size=len(known), unique=draw(st.integers(0, 5)) > 0))
    number = draw(st.sampled_from((st.integers(-9, 9).map(float), st.floats(-9, 9), st.floats(-3, 3))))
    odd = st.sampled_from((1.0, math.nan, math.inf))
    fields = []
    for often in (20, 2, 4):
        good = draw(st.integers(0, often)) > 0
        length = draw(st.sampled_from([len(names)] * 12 + [0, 0, 1, 5])) if not good else len(names)
        fields.append(draw(st.lists(number if good else odd, min_size=length, max_size=length)))
    return joint_state(names, *fields)


CHANGES = ("forget", "forget clocks", "estimate", "refuse")


@st.composite
def journeys(draw):
    """Draw messages, times of their reception, and changes before them.

    Stamps are behind the clock by an offset that may change, and by a delay. All is in tenths of a second, so that equal
    stamps, exact timeouts and all kinds of jumps occur.
    """
    now, offset = 3000, draw(st.sampled_from((0, 0, 0, 700, -700, 9)))
    journey = []
    for message in draw(st.lists(messages(), min_size=1, max_size=14)):
        now += draw(st.sampled_from((1, 0, 1, 1, 2, 4, 9, 35)))
        kind = draw(st.integers(0, 17))
        offset += draw(st.sampled_from((12, 30, 100, 5, -12, -30))) if kind == 0 else 0
        delay = draw(st.sampled_from((15, 40, 6, -15, -40))) if kind == 1 else draw(st.sampled_from((0, 0, 0, 0, 1, 2)))
        stamp = 0 if kind == 2 else (now - offset - delay) * 100 * MS
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, S)
        if kind == 3:
            sec, nanosec = draw(st.sampled_from(((-1, 5), (300, 10**9), (300, 2**32 - 1), (300, 10**9 - 1))))
            message.header.stamp.sec, message.header.stamp.nanosec = sec, nanosec
        clock = 0 if kind == 4 or (kind == 2 and draw(st.integers(0, 4)) == 0) else now * 100 * MS
        journey.append((message, clock, draw(st.sampled_from(CHANGES)) if kind == 5 else None))
    return journey


@st.composite
def set_clocks(draw):
    """Draw good messages of one to three sources, whose clocks are set: by much, or by less than a second.

    What comes then goes on from there, at a steady pace.
    """
    parts = draw(
        st.sampled_from(((NAMES,), (NAMES,), (("shoulder", "elbow"), ("wrist",)), (NAMES, ("elbow", "wrist"))))
    )
    now, offsets = 3000, dict.fromkeys(parts, draw(st.sampled_from((0, 0, 0, 700))))
    least = draw(st.sampled_from((1, 1, 10, 30)))
    position = dict.fromkeys(NAMES, 0.0)
    journey, estimated = [], draw(st.booleans())
    for _ in range(draw(st.integers(5, 25))):
        now += draw(st.sampled_from((least, least, least + 1)))
        if draw(st.integers(0, 9)) == 0:
            some = parts if draw(st.booleans()) else (draw(st.sampled_from(parts)),)
            step = draw(st.sampled_from((6, 8, 9, 15, 30, 100, -8, -15, -100)))
            offsets |= {part: offsets[part] + step for part in some}
        part = draw(st.sampled_from(parts))
        for name in part:
            position[name] += draw(st.sampled_from((0.5, 0.5, 0.25, -0.5)))
        stamp = (now - offsets[part] - draw(st.sampled_from((0,) * 9 + (1,)))) * 100 * MS
        velocity = () if estimated else [1.0] * len(part)
        message = joint_state(part, [position[name] for name in part], velocity, [2.0] * len(part), stamp)
        journey.append((message, now * 100 * MS, None))
    return journey


def follow(options, journey):
    """Compare assembler and model, message by message; yield what became of each."""
    lower, upper = np.array([LIMITS[name] for name in NAMES]).T
    joints = Joints(NAMES, MIMICS, CONTINUOUS, lower, upper)
    assembler, model = JointStateAssembler(joints, options), Model(options)
    for message, now, change in journey:
        if change == "forget":
            assembler.forget()
            model.forget()
        elif change == "forget clocks":
            assembler.stamps.forget()
            model.forget_clocks()
        elif change:
            configure(assembler, estimate_velocity=change == "estimate")
            model.estimate(change == "estimate")
        before = Counter(assembler.counts)
        expected = model.update(message, now)
        try:
            state = assembler.update(message, now)
        except RejectedError as rejection:
            assert isinstance(expected, set)
            assert rejection.cause in expected
            outcome = rejection.cause
        else:
            if state is None:
                outcome = expected
                assert expected in OUTCOMES
                before[expected] += 1
            else:
                outcome = "published"
                agree(state, expected)
        assert [assembler.counts[key] for key in OUTCOMES] == [before[key] for key in OUTCOMES]
        assert assembler.missing == [name for name in NAMES if name not in model.known]
        assert assembler.estimated == [name for name in NAMES if model.known.get(name, {}).get("estimated")]
        assert assembler.newest == max((joint["at"] for joint in model.known.values()), default=0)
        assert assembler.stale(now) == model.stale(now)
        assert assembler.counts["time jumped back"] == model.jumps
        assert assembler.counts["mimic disagreement"] == model.disagreements
        assert assembler.counts["absurd effort"] == model.absurd
        assert assembler.stamps.in_step == model.in_step
        yield outcome
    yield from [what for what in ("jumps", "late_jumps", "believed") if getattr(model, what)]


def agree(state, expected):
    """The state is the model's: exactly, but for estimates, which are sums in another order."""
    position, velocity, effort, newest, oldest, unstamped, estimated = expected
    assert state.position.tolist() == position
    if estimated:
        np.testing.assert_allclose(state.velocity, velocity, rtol=1e-7, atol=1e-9)
    else:
        assert state.velocity.tolist() == velocity
    assert (None if state.effort is None else state.effort.tolist()) == effort
    assert state[3:] == (newest, oldest, unstamped, estimated)


def test_any_sequence():
    """Assembler and model agree on every message, whatever came before; each has exactly one outcome, and each occurs."""
    seen = Counter()

    @settings(examples(500), report_multiple_bugs=False)
    @given(some_options(), journeys())
    def compare(options, journey):
        seen.update(follow(options, journey))

    compare()
    # "stamp from the future" may well not: it is too rare among so many faults, and occurs in test_clocks_that_are_set.
    stamps = ("malformed stamp", "no time", "stamp from the past", "foreign time", "late")
    values = ("wrong length", "duplicate name", "no position", "no velocity", "absurd value", "stale joint")
    never = {*OUTCOMES, *stamps, *values, "published", "jumps"} - set(seen)
    assert not never, seen


def test_clocks_that_are_set():
    """Assembler and model agree on which stamps are late, from the past, of another time, or the first of a new one."""
    seen = Counter()

    @settings(examples(400), report_multiple_bugs=False)
    @given(
        st.fixed_dictionaries(
            {
                "timeout": st.sampled_from((0.5, 0.0, 2.0)),
                "timeouts": by_joint(st.sampled_from((0.0, 0.2, 1.5))),
                "max_age": st.sampled_from((0.0, 1.0, 2.0)),
                "estimate_velocity": st.booleans(),
                "velocity_filter_time": st.sampled_from((0.0, 0.1)),
            }
        ),
        set_clocks(),
    )
    def compare(options, journey):
        seen.update(follow(Options(**options), journey))

    compare()
    stamps = ("stamp from the past", "stamp from the future", "late")
    never = {*stamps, "jumps", "late_jumps", "believed", "published"} - set(seen)
    assert not never, seen
