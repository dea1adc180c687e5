"""Recordings are taken in as the monitor takes in messages: what columns make of them is what one after the other makes."""

from collections import Counter

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.assembly.assembler import JointStateAssembler, joints_of
from diag_dynamics.assembly.frozen import Frozen
from diag_dynamics.assembly.gaps import Gaps
from diag_dynamics.assembly.rejected import RejectedError
from diag_dynamics.bags.messages import Messages
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from diag_dynamics.recordings.intake import JOINT_STATE, Intake, States
from diag_dynamics.wire.cdr import Template
from diag_dynamics.wire.definitions import message_type, read_message

MS, S = 10**6, 10**9
START = 1_700_000_000 * S
DEFAULTS = {name: spec.default for name, spec in PARAMETERS.items()}
JointState = message_type(JOINT_STATE)


def serialized(stamp, names, position, velocity, effort=()):
    """Bytes of a joint state."""
    message = JointState(name=list(names), position=list(position), velocity=list(velocity), effort=list(effort))
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, S)
    message.header.frame_id = "base"
    return Template(message).encoded()


class Driver:
    """Sends states of a robot in slow motion, with whatever goes wrong with them."""

    def __init__(self, model, seed, names=None, effort=True):
        self.rng, self.effort = np.random.default_rng(seed), effort
        self.names = list(names or joints_of(model).names)
        low, high = (np.nan_to_num(x[: len(self.names)], posinf=1.0, neginf=-1.0) for x in (model.lower, model.upper))
        self.middle, self.reach = 0.5 * (low + high), np.minimum(0.05, 0.2 * (high - low))
        self.phase = self.rng.uniform(0.0, 6.0, len(self.names))

    def state(self, t):
        """Names, positions, velocities and efforts at a time [s]."""
        position = self.middle + self.reach * np.sin(t + self.phase)
        velocity = self.reach * np.cos(t + self.phase)
        return self.names, position, velocity, np.sin(self.phase + 3.0 * t) if self.effort else ()

    def good(self, stamp):
        """A message about which nothing is wrong."""
        return serialized(stamp, *self.state((stamp - START) / S))

    def bad(self, stamp):
        """One that is odd in one of many ways."""
        names, position, velocity, effort = self.state((stamp - START) / S)
        position, velocity, effort = position.copy(), velocity.copy(), np.array(effort)
        k = self.rng.integers(len(names))
        order = self.rng.permutation(len(names))
        some = order[: self.rng.integers(1, len(names) + 1)]
        kind = self.rng.integers(18)
        if kind == 0:
            return serialized(stamp, names, position, velocity, effort)[: self.rng.integers(1, 60)]
        if kind == 1:
            raw = bytearray(serialized(stamp, names, position, velocity, effort))
            raw[self.rng.integers(len(raw))] ^= 1 << self.rng.integers(8)
            return bytes(raw)
        if kind == 2:
            position[k] = self.rng.choice([np.nan, np.inf, 1e297, 253.0, 4.0, -40.0])
        elif kind == 3:
            velocity[k] = self.rng.choice([np.nan, -np.inf, 1e200, 253.0, 30.0])
        elif kind == 4 and self.effort:
            effort[k] = self.rng.choice([np.nan, np.inf, 1e9, 253.0])
        elif kind == 5:
            stamp -= int(self.rng.choice([1, 40, 3000, 40_000])) * MS
        elif kind == 6:
            stamp += int(self.rng.choice([1, 40, 3000, 40_000])) * MS
        elif kind == 7:
            stamp = 0
        elif kind == 8:
            position += self.rng.choice([0.05, 0.2, 1.0])
        elif kind == 9:
            return serialized(stamp, names, position[:-1], velocity, effort)
        elif kind == 10:
            return serialized(stamp, names, position, (), effort)
        elif kind == 11:
            return serialized(stamp, ["elsewhere", "nobody"], [0.0, 1.0], [0.0, 0.0])
        elif kind == 12:
            return serialized(stamp, [names[0], names[0]], [0.0, 1.0], [0.0, 0.0])
        elif kind == 13:
            position[:], velocity[:] = 253.0, 253.0
        elif kind == 14:
            return serialized(stamp, [*names, "gripper"], [*position, 0.0], [*velocity, 0.0])
        elif kind == 15:
            velocity[:] = 0.3
            return serialized(stamp, names, self.middle, velocity, effort)
        else:
            return serialized(
                stamp, [names[j] for j in some], position[some], velocity[some], effort[some] if self.effort else ()
            )
        return serialized(stamp, names, position, velocity, effort)


def hostile(model, seed, count=1500, odd=0.1):
    """Messages of two drivers, one in ten of them odd, with stalls and bursts; and times of reception."""
    rng, names = np.random.default_rng(seed), joints_of(model).names
    both = seed % 2 == 0 and len(names) > 2
    drivers = [
        Driver(model, seed, names[: len(names) // 2], seed % 3 > 0),
        Driver(model, seed + 1, names[len(names) // 2 :]),
    ]
    drivers = drivers if both else [Driver(model, seed, effort=seed % 3 > 0)]
    now, found = START + 50 * MS, []
    for k in range(count):
        now += int(rng.choice([2, 4, 80, 700], p=[0.95, 0.035, 0.01, 0.005])) * MS
        driver = drivers[k % len(drivers)]
        stamp = now - int(rng.integers(MS // 8))
        found.append((driver.bad(stamp) if rng.random() < odd else driver.good(stamp), now))
    return found


def messages_of(pairs):
    """Pieces as readers of bags hand them out."""
    raws = [raw for raw, _ in pairs]
    size = np.array([len(raw) for raw in raws], dtype=int)
    data = np.frombuffer(b"".join(raws), dtype=np.uint8)
    at = np.cumsum(size) - size
    return Messages(data, np.zeros(len(raws), dtype=int), at, size, np.array([now for _, now in pairs], dtype=int))


def one_after_the_other(model, settings, pairs):
    """What the monitor does with each message, without bytes and columns: states and counts."""
    assembler, counts, states = JointStateAssembler(joints_of(model), settings.inputs), Counter(), []
    refuses = settings.values["frozen_values"] == "refuse"
    frozen = Frozen(assembler.names, settings.values["frozen_timeout"], refuses)
    for raw, now in pairs:
        counts["received"] += 1
        try:
            try:
                message = read_message(raw, JOINT_STATE)
            except ValueError as error:
                raise RejectedError("malformed", str(error)) from error
            state = assembler.update(message, now)
            if state is not None:
                frozen.judge(state.newest, lambda state=state: state)
        except RejectedError as error:
            counts[f"rejected: {error.cause}"] += 1
            assembler.gaps.pause()
            continue
        if state is not None:
            counts["published"] += 1
            states.append(state)
    return states, counts + assembler.counts + Counter({"lost by gaps in stamps": assembler.gaps.lost})


def in_columns(model, settings, pairs, cuts):
    """The same by Intake, in pieces."""
    intake = Intake(model, settings)
    pieces = [
        intake.take(messages_of(part), np.array([JOINT_STATE])) for part in np.split(np.array(pairs, object), cuts)
    ]
    return States.together(pieces), intake.counts


def settings_of(**changed):
    return Settings.of(DEFAULTS | {name.replace("__", "."): value for name, value in changed.items()})


SETTINGS = {
    "defaults": settings_of(),
    "refusing frozen values": settings_of(frozen_values="refuse", frozen_timeout=0.05),
    "refusing foreign stamps": settings_of(foreign_time="refuse", max_age=0.02),
    "judging little": settings_of(max_age=0.0, absurd__jump=0.0, absurd__beyond_limits=0.0, joint_timeout=0.0),
    "estimating velocities": settings_of(missing_velocity="estimate"),
    "scaling efforts": settings_of(effort_scale=["*=0.5"], effort_available=["panda_joint3=false"]),
}


@pytest.fixture(scope="module")
def panda():
    return dd.load_robot("panda")


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("settings", SETTINGS.values(), ids=SETTINGS)
def test_columns_are_the_monitors(panda, settings, seed):
    pairs = hostile(panda, seed)
    expected, counts = one_after_the_other(panda, settings, pairs)
    cuts = np.sort(np.random.default_rng(seed).integers(len(pairs), size=4))
    states, counted = in_columns(panda, settings, pairs, cuts)
    assert counted == counts
    assert states.number == len(expected)
    for name, actual in (("position", states.position), ("velocity", states.velocity)):
        np.testing.assert_array_equal(
            actual, np.array([getattr(state, name) for state in expected]).reshape(actual.shape)
        )
    unknown = np.full(states.effort.shape[1], np.nan)
    efforts = [unknown if state.effort is None else state.effort for state in expected]
    np.testing.assert_array_equal(states.effort, np.array(efforts).reshape(states.effort.shape))
    assert states.with_effort.tolist() == [state.effort is not None for state in expected]
    assert states.newest.tolist() == [state.newest for state in expected]
    assert states.oldest.tolist() == [state.oldest for state in expected]
    assert states.received.tolist() == [state.stamp_is_receive_time for state in expected]
    assert states.estimated.tolist() == [state.velocity_estimated for state in expected]


def test_hostile_recordings_are(panda):
    """All of the above would hold of nothing but good messages, or of none that is taken."""
    found = Counter()
    for seed in range(6):
        states, counts = one_after_the_other(panda, SETTINGS["defaults"], hostile(panda, seed))
        found += counts
        assert states.number > 500
    for cause in (
        "malformed",
        "absurd value",
        "jump",
        "late",
        "no velocity",
        "wrong length",
        "no position",
        "duplicate name",
    ):
        assert found[f"rejected: {cause}"] > 0, cause
    for what in ("incomplete", "foreign", "absurd effort", "lost by gaps in stamps"):
        assert found[what] > 0, what


@pytest.mark.parametrize("seed", range(20))
def test_gaps_of_many(seed):
    rng = np.random.default_rng(seed)
    one, many = Gaps(), Gaps()
    stamps = START + np.cumsum(
        rng.choice([MS, MS, MS, 2 * MS, 5 * MS, -MS, 0, 3 * S], 700, p=[0.3, 0.3, 0.3, 0.05, 0.03, 0.005, 0.01, 0.005])
    )
    if seed % 2:
        stamps = np.sort(stamps)
    for part in np.split(stamps, np.sort(rng.integers(len(stamps), size=5))):
        for stamp in part.tolist():
            one.take("joint", stamp)
        if len(part):
            many.take_many("joint", part)
        if rng.random() < 0.3:
            one.pause()
            many.pause()
    assert many.lost == one.lost


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("refused", [False, True])
def test_frozen_of_many(seed, refused):
    rng = np.random.default_rng(seed)
    one, many = (Frozen(["a", "b"], 0.05, refused) for _ in range(2))
    stamps = START + np.cumsum(rng.integers(1, 9, 600)) * MS
    position = np.cumsum(rng.choice([0.0, 1e-3], (600, 2), p=[0.9, 0.1]), axis=0)
    velocity = np.repeat(rng.choice([0.0, 0.5], (6, 2)), 100, axis=0)
    expected = []
    for k, stamp in enumerate(stamps.tolist()):
        state = States.none(dd.load_robot("ur5"))._replace(position=position[k], velocity=velocity[k])
        try:
            one.judge(stamp, lambda state=state: state)
            expected.append(False)
        except RejectedError:
            expected.append(True)
    cuts = np.sort(rng.integers(600, size=4))
    parts = zip(*(np.split(x, cuts) for x in (stamps, position, velocity)), strict=True)
    assert np.concatenate([many.judge_many(*part) for part in parts]).tolist() == expected
    assert any(expected) == refused
