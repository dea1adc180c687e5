"""Assembling a robot's state from JointState messages: every way a message can be, and any sequence of them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diag_dynamics.model import Mimic
from diag_dynamics.nodes.joint_states import JointStateAssembler, RejectedError
from nodes import MS, S, joint_state

NAMES = ("shoulder", "elbow", "wrist")
TIMEOUT = 0.5
NOW = 77 * S

MIMICS = {"thumb": Mimic("wrist", -2.0, 0.5), "heel": Mimic("elbow", 0.5, 0.0), "pinky": Mimic("wrist", 3.0, -1.0)}
TOLERANCE = 0.01
IN_PLACE = {"thumb": -5.5, "heel": 1.0, "pinky": 8.0}
"""Where the followers belong, with the joints as in `whole`."""


@pytest.fixture
def assembler():
    """Return an assembler of three joints."""
    return JointStateAssembler(NAMES, TIMEOUT)


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
    return repr((assembler._position, assembler._velocity, assembler._effort, assembler._stamp))


# --- good messages


@pytest.mark.parametrize("names", [NAMES, NAMES[::-1], ("elbow", "wrist", "shoulder")])
def test_whole_message(assembler, names):
    """One message with all joints, in any order."""
    state = assembler.update(whole(5 * S, names=names), NOW)
    assert_state(state, [1, 2, 3], 5 * S, 5 * S)
    assert not state.stamp_is_receive_time
    assert assembler.missing == []
    assert not assembler.counts


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
    assert assembler.counts == {"foreign": 1}
    assert snapshot(assembler) == before


def test_pieces(assembler):
    """Nothing comes until every joint has arrived; then every message brings a state."""
    assert assembler.missing == list(NAMES)
    assert assembler.update(whole(1 * S, names=["elbow"]), NOW) is None
    assert assembler.missing == ["shoulder", "wrist"]
    assert assembler.update(whole(1 * S + 100 * MS, names=["wrist"]), NOW) is None
    assert assembler.counts == {"incomplete": 2}
    state = assembler.update(whole(1 * S + 50 * MS, names=["shoulder"]), NOW)
    assert assembler.missing == []
    assert_state(state, [1, 2, 3], 1 * S + 100 * MS, 1 * S)
    state = assembler.update(whole(1 * S + 200 * MS, 4.0, ["elbow"]), NOW)
    assert_state(state, [1, 6, 3], 1 * S + 200 * MS, 1 * S + 50 * MS)
    assert assembler.counts == {"incomplete": 2}


def test_no_joints():
    """A robot without joints has no state, and nothing is missing."""
    assembler = JointStateAssembler((), TIMEOUT)
    assert assembler.missing == []
    assert assembler.update(whole(1 * S), NOW) is None
    assert assembler.update(joint_state(stamp=2 * S), NOW) is None
    assert assembler.counts == {"foreign": 2}


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
    assert assembler.counts == {}


# --- time


def test_same_stamp_again(assembler):
    """The later message counts."""
    assembler.update(whole(1 * S), NOW)
    assert_state(assembler.update(whole(1 * S, 5.0), NOW), [6, 7, 8], 1 * S, 1 * S)


@pytest.mark.parametrize(("timeout", "most"), [(0.5, 1.0), (0.0, 1.0), (3.0, 3.0)])
def test_late(timeout, most):
    """Overtaken by a newer message: dropped, up to a second or the timeout. Beyond that, time has jumped back."""
    assembler = JointStateAssembler(NAMES, timeout)
    assembler.update(whole(100 * S), NOW)
    refused(assembler, whole(100 * S - 1, 5.0), "late", "shoulder")
    refused(assembler, whole(100 * S - int(most * S), 5.0), "late", f"{most:.6f} s")
    assert_state(assembler.update(whole(100 * S), NOW), [1, 2, 3], 100 * S, 100 * S)
    assert assembler.counts == {}
    stamp = 100 * S - int(most * S) - 1000
    assert_state(assembler.update(whole(stamp, 5.0), NOW), [6, 7, 8], stamp, stamp)
    assert assembler.counts == {"time jumped back": 1}


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


def test_time_jumps_back(assembler):
    """All joints have to arrive anew: none of before is mixed with those of now."""
    assembler.update(whole(100 * S), NOW)
    assert assembler.update(whole(10 * S, 1.0, ["wrist"]), NOW) is None
    assert assembler.missing == ["shoulder", "elbow"]
    assert assembler.counts == {"time jumped back": 1, "incomplete": 1}
    state = assembler.update(whole(10 * S, 2.0, ["shoulder", "elbow"]), NOW)
    assert_state(state, [3, 4, 4], 10 * S, 10 * S)


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
    assembler = JointStateAssembler(NAMES, 0.0)
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


def test_simulated_time_of_zero(assembler):
    """Before the first /clock, the time of reception is zero as well."""
    state = assembler.update(whole(0), 0)
    assert_state(state, [1, 2, 3], 0, 0)
    assert assembler.missing == []


# --- followers


@pytest.fixture
def coupled():
    """Return an assembler of three joints, which three others follow."""
    return JointStateAssembler(NAMES, TIMEOUT, MIMICS, TOLERANCE)


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
    assert not coupled.counts


def test_followers_alone(coupled):
    """They are known to be this robot's, but make no state, be the others known or not, nor do they hold one back."""
    assert coupled.update(hand(1 * S), NOW) is None
    assert coupled.missing == list(NAMES)
    coupled.update(whole(2 * S), NOW)
    assert coupled.update(hand(2 * S + 100 * MS), NOW) is None
    assert not coupled.counts
    state = coupled.update(whole(2 * S + 50 * MS), NOW)  # older than the followers, which does not make it late
    assert_state(state, [1, 2, 3], 2 * S + 50 * MS, 2 * S + 50 * MS)
    assert_state(coupled.update(whole(9 * S), NOW), [1, 2, 3], 9 * S, 9 * S)  # nobody waits for followers
    assert not coupled.counts


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
    assert coupled.update(whole(5 * S), NOW).effort.tolist() == [100, 200, 300]
    coupled.timeout = 0.0
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
    assert coupled.counts == {"mimic disagreement": 2}


@pytest.mark.parametrize(("position", "apart"), [(1.0099, False), (1.0101, True), (0.9901, False), (0.9899, True)])
def test_tolerance(coupled, position, apart):
    """On both sides; as it is changed, and without one."""
    disagrees(coupled, all_of(1 * S, heel=position), *["heel"] * apart)
    coupled.followers.tolerance = 1.0
    disagrees(coupled, all_of(2 * S, heel=position))
    disagrees(coupled, all_of(3 * S, heel=2.1), "heel")
    coupled.followers.tolerance = 0.0
    disagrees(coupled, all_of(4 * S, heel=1e9))


@pytest.mark.parametrize("position", [7.0, 1.0 + 2.0 * math.pi, 1.0 - 4.0 * math.pi, math.inf])
def test_whole_turns_of_a_continuous_joint_are_no_distance(position):
    """Drivers wrap such angles as they like."""
    wheel = JointStateAssembler(["drive"], 0.5, {"wheel": Mimic("drive", 1.0, 0.0)}, 0.01, ("wheel",))
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
    assert not coupled.counts


def test_compared_with_a_leader_of_before(coupled):
    """As long as the two are within the timeout of each other, whichever is older."""
    disagrees(coupled, hand(1 * S, thumb=9.0))  # no leader yet
    coupled.update(whole(10 * S), NOW)
    for stamp, apart in ((10 * S, True), (10 * S + 500 * MS, True), (10 * S + 501 * MS, False), (9 * S, False)):
        assert disagrees(coupled, hand(stamp, thumb=9.0), *["'thumb' is 9,"] * apart) is None
    disagrees(coupled, hand(10 * S))
    coupled.timeout = 0.0
    disagrees(coupled, hand(500 * S, heel=9.0), "heel")


def test_not_compared_with_a_leader_of_another_time(coupled):
    """After time has jumped back, the leader has to be heard of anew."""
    coupled.update(whole(100 * S), NOW)
    coupled.timeout = 0.0
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


# --- any sequence, against a model that keeps a dictionary


class Model:
    """The same, slowly: what is known of each joint, by name."""

    def __init__(self):
        self.known, self.efforts, self.disagreements = {}, {}, 0

    def update(self, message, now):
        """Return the state's fields, None, or the causes of a rejection: where there are several, any will do."""
        if len(set(message.name)) < len(message.name):
            return {"duplicate name"}
        names = [name for name in message.name if name in NAMES]
        followers = {name: {} for name in message.name if name in MIMICS}
        if not names and not followers:
            return None
        stamp = message.header.stamp.sec * S + message.header.stamp.nanosec
        at = stamp or now
        last = max((self.known[name]["at"] for name in names if name in self.known), default=at)
        causes = {"late"} if last > at >= last - max(TIMEOUT, 1.0) * S else set()
        entries = {name: {"at": at, "unstamped": stamp == 0} for name in names}
        for field in ("position", "velocity", "effort"):
            values = getattr(message, field) or [math.nan] * len(message.name)
            if len(values) != len(message.name):
                causes.add("wrong length")
                continue
            for name, value in zip(message.name, values, strict=True):
                if name in entries:
                    entries[name][field] = value
                if name in followers:
                    followers[name][field] = value
        if not all(math.isfinite(entry.get("position", 0.0)) for entry in entries.values()):
            causes.add("no position")
        if causes:
            return causes
        if last > at:
            self.known.clear()
            self.efforts.clear()
        self.known |= entries
        self.efforts |= {name: (at, own["effort"]) for name, own in followers.items()}
        self.disagreements += any(self._apart(name, own["position"], at) for name, own in followers.items())
        return self._state() if names else None

    def _apart(self, name, position, at):
        leader, multiplier, offset = MIMICS[name]
        if leader not in self.known or abs(self.known[leader]["at"] - at) > TIMEOUT * S:
            return False
        return math.isfinite(position) and abs(position - multiplier * self.known[leader]["position"] - offset) > 0.01

    def _state(self):
        if len(self.known) < len(NAMES):
            return None
        joints = [self.known[name] for name in NAMES]
        newest, oldest = (choose(joint["at"] for joint in joints) for choose in (max, min))
        if newest - oldest > TIMEOUT * S:
            return {"stale joint"}
        if not all(math.isfinite(joint["velocity"]) for joint in joints):
            return {"no velocity"}
        position, velocity, effort = ([joint[f] for joint in joints] for f in ("position", "velocity", "effort"))
        if not all(map(math.isfinite, effort)):
            effort = None
        for name, (leader, multiplier, _) in MIMICS.items() if effort else ():
            at, own = self.efforts.get(name, (0, math.nan))
            if math.isfinite(own) and newest - at <= TIMEOUT * S:
                effort[NAMES.index(leader)] += multiplier * own
        return position, velocity, effort, newest, oldest, any(joint["unstamped"] for joint in joints)


@st.composite
def messages(draw):
    """Draw a message, mostly good, with some of the joints, and a time of reception."""
    known = draw(st.sampled_from(((*NAMES, "lid"), (*NAMES, "lid", *MIMICS))))
    names = draw(st.lists(st.sampled_from(known), max_size=len(known), unique=draw(st.integers(0, 9)) > 0))
    number = draw(st.sampled_from((st.integers(-9, 9).map(float), st.floats(-9, 9), st.floats(-9, 9))))
    number = number if draw(st.integers(0, 5)) else st.sampled_from((1.0, math.nan, math.inf))
    fields = []
    for _ in range(3):
        length = draw(st.sampled_from([len(names)] * 12 + [0, 0, 1, 5]))
        fields.append(draw(st.lists(number, min_size=length, max_size=length)))
    # tenths of a second: equal stamps, exact timeouts, late messages and jumps all occur
    stamp = draw(st.integers(20, 28) | st.sampled_from((0, 1, 5, 90)))
    return joint_state(names, *fields, stamp=stamp * 100 * MS), draw(st.integers(20, 28)) * 100 * MS


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.lists(messages(), max_size=12))
def test_any_sequence(sequence):
    """Assembler and model agree on every message, whatever came before."""
    assembler, model = JointStateAssembler(NAMES, TIMEOUT, MIMICS, TOLERANCE), Model()
    for message, now in sequence:
        expected = model.update(message, now)
        try:
            state = assembler.update(message, now)
        except RejectedError as rejection:
            assert isinstance(expected, set)
            assert rejection.cause in expected
        else:
            actual = state and (
                state.position.tolist(),
                state.velocity.tolist(),
                None if state.effort is None else state.effort.tolist(),
                *state[3:],
            )
            assert actual == expected
        assert assembler.missing == [name for name in NAMES if name not in model.known]
        assert assembler.counts["mimic disagreement"] == model.disagreements
