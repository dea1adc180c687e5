# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings are taken in as the monitor takes in messages: what columns make of them is what one after the other makes."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.assembly.assembler import JointStateAssembler, joints_of
from diag_dynamics.assembly.frozen import Frozen
from diag_dynamics.assembly.gaps import Gaps
from diag_dynamics.assembly.rejected import RejectedError
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from diag_dynamics.recordings.intake import JOINT_STATE, Intake, States
from diag_dynamics.wire.definitions import read_message
from hostile import MS, START, S, hostile, messages_of

DEFAULTS = {name: spec.default for name, spec in PARAMETERS.items()}


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
        assert len(states) > 500
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
    _, counts = one_after_the_other(panda, SETTINGS["refusing frozen values"], hostile(panda, 1))
    assert counts["rejected: frozen"] > 0


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
        state = SimpleNamespace(position=position[k], velocity=velocity[k])
        try:
            one.judge(stamp, lambda state=state: state)
            expected.append(False)
        except RejectedError:
            expected.append(True)
    cuts = np.sort(rng.integers(600, size=4))
    parts = zip(*(np.split(x, cuts) for x in (stamps, position, velocity)), strict=True)
    found = []
    for part in parts:
        which = many.judge_many(*part)
        found += [k in which for k in range(len(part[0]))]
    assert found == expected
    assert any(expected) == refused
