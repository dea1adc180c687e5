"""Assembling a robot's state from JointState messages: every way a message can be, and any sequence of them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diag_dynamics.nodes.joint_states import JointStateAssembler, RejectedError
from nodes import MS, S, joint_state

NAMES = ("shoulder", "elbow", "wrist")
TIMEOUT = 0.5
NOW = 77 * S


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


# --- any sequence, against a model that keeps a dictionary


class Model:
    """The same, slowly: what is known of each joint, by name."""

    def __init__(self):
        self.known = {}

    def update(self, message, now):
        """Return the state's fields, None, or the causes of a rejection: where there are several, any will do."""
        if len(set(message.name)) < len(message.name):
            return {"duplicate name"}
        names = [name for name in message.name if name in NAMES]
        if not names:
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
        if not all(math.isfinite(entry.get("position", 0.0)) for entry in entries.values()):
            causes.add("no position")
        if causes:
            return causes
        if last > at:
            self.known.clear()
        self.known |= entries
        return self._state()

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
        return position, velocity, effort, newest, oldest, any(joint["unstamped"] for joint in joints)


@st.composite
def messages(draw):
    """Draw a message, mostly good, with some of the joints, and a time of reception."""
    names = draw(st.lists(st.sampled_from((*NAMES, "lid")), max_size=4, unique=draw(st.integers(0, 9)) > 0))
    number = st.floats(-9, 9) if draw(st.integers(0, 5)) else st.sampled_from((1.0, math.nan, math.inf))
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
    assembler, model = JointStateAssembler(NAMES, TIMEOUT), Model()
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
