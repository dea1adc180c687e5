# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings: states and counts are those of the monitor's assembler, message by message."""

import os
from collections import Counter

import numpy as np
import pytest

import diag_dynamics as dd
from bags import ODOMETRY, Message, arm, serialized, write_mcap
from diag_dynamics.recordings.states import States
from hostile import MS, START, Driver, S
from joint_state_readers import DEFAULTS, Reader
from joint_state_readers import Message as Given
from recording_cases import CASES, hostile_messages, write_case


@pytest.fixture(scope="module")
def panda():
    return dd.load_robot("panda")


def states_written(path, pairs, **options):
    """Write joint states, pairs of bytes and log time; return the path."""
    return write_mcap(
        path,
        [Message("/joint_states", now, raw) for raw, now in pairs],
        chunk_size=20_000,
        **options,
    )


def driven(model, count, seed=3, stuck=0):
    """Return pairs of bytes and log time at 500 Hz; old values for a time [ns] `stuck`."""
    driver = Driver(model, seed)
    driver.stick(START, stuck)
    return [(driver.good(START + k * 2 * MS), START + k * 2 * MS + 1000) for k in range(count)]


# --- What the monitor would publish ---


def one_after_the_other(case, messages):
    """Do with each message what the monitor does; return states and counts."""
    reader = Reader(case.model, DEFAULTS | case.parameters)
    for _, now, raw, kind in messages:
        reader.read(Given(raw, now, kind == ODOMETRY))
    result = reader.result()
    return result.states, result.counts


@pytest.mark.parametrize(
    "seeds", [(0, 1), pytest.param((2, 3, 4, 5), marks=pytest.mark.full)], ids=str
)
@pytest.mark.parametrize("name", CASES)
def test_states_and_counts_are_the_monitors(tmp_path, name, seeds):
    """To the last bit, of hostile recordings in pieces of any size; all that a case is about
    occurs.
    """
    case = CASES[name]
    total = Counter()
    for seed in seeds:
        messages = hostile_messages(case, seed)
        path = write_case(tmp_path / "x.mcap", messages)
        size = int(np.random.default_rng(seed).integers(50, 900))
        expected, counts = one_after_the_other(case, messages)
        pieces = list(
            dd.stream_recording(path, case.model, parameters=case.own_parameters, size=size)
        )
        assert pieces[-1].counts == counts
        states = States.concatenate([piece.states for piece in pieces])
        newest, oldest, _, position, velocity, effort, with_effort, received, estimated, _ = (
            states.columns()
        )
        assert len(newest) == len(expected) > 200
        nothing = np.full(effort.shape[1], np.nan)
        for actual, field in (
            (position, "position"),
            (velocity, "velocity"),
            (newest, "newest"),
            (oldest, "oldest"),
        ):
            assert (
                actual.tobytes()
                == np.array([getattr(state, field) for state in expected]).tobytes()
            )
        assert with_effort.tolist() == [state.effort is not None for state in expected]
        efforts = [state.effort for state in expected if state.effort is not None]
        assert effort[with_effort].tobytes() == np.array(efforts).tobytes()
        some = [
            np.frombuffer(state.partial) if state.partial else nothing
            for state in expected
            if state.effort is None
        ]
        np.testing.assert_array_equal(effort[~with_effort], np.reshape(some, (-1, len(nothing))))
        assert received.tolist() == [state.received for state in expected]
        assert estimated.tolist() == [state.estimated for state in expected]
        total += counts
    assert seeds != (0, 1) or not [key for key in case.counts if not total[key]]


# --- Reading ---


def test_part_of_a_recording(tmp_path, panda):
    pairs = driven(panda, 1000)
    path = states_written(tmp_path / "x.mcap", pairs)
    first = pairs[0][1]
    part = dd.read_recording(path, panda, start=0.5, end=1.25)
    whole = dd.read_recording(path, panda)
    assert whole.findings == [] and "1000 states" in repr(whole)
    within = [first + 500 * MS <= now < first + 1250 * MS for _, now in pairs]
    np.testing.assert_array_equal(part.q, whole.q[within])
    assert part.counts["received"] == sum(within)
    assert sum(map(len, dd.stream_recording(path, panda, start=1.0, size=100))) == 500
    for start, end, what in ((2.0, 1.0, "end is 1"), (-1.0, None, "start is -1")):
        with pytest.raises(dd.InputError, match=what):
            dd.read_recording(path, panda, start=start, end=end)
    rows = [f"{0.01 * k},{0.001 * k},0.1" for k in range(100)]
    (tmp_path / "x.csv").write_text("\n".join(["t,q1,qd1", *rows]))
    part = dd.read_recording(tmp_path / "x.csv", arm("a"), start=0.3, end=0.5)
    np.testing.assert_allclose(part.t, 0.01 * np.arange(30, 50), atol=1e-9)


def test_stuck_values_are_a_finding(tmp_path, panda):
    """Repeated positions with velocities are named, and their states are read."""
    path = states_written(tmp_path / "stuck.mcap", driven(panda, 500, stuck=S))
    recording = dd.read_recording(path, panda)
    assert len(recording) == 500
    assert any(
        finding.cause == "stuck values" and "has a velocity" in finding.text
        for finding in recording.findings
    )


def test_two_sources_are_a_finding(tmp_path):
    """All states of the first source are read; the finding has the counts of both."""
    times = range(START, START + S, 5 * MS)
    pairs = [
        (serialized(t, ["a"], [2.0] if k % 2 else [0.0], [] if k % 2 else [0.1]), t)
        for k, t in enumerate(times)
    ]
    recording = dd.read_recording(states_written(tmp_path / "two.mcap", pairs), arm("a"))
    assert len(recording) == 100 and (recording.q == 0.0).all()
    result = {finding.cause: finding for finding in recording.findings}
    assert result["rejected: interleaved sources"].count == 99
    text = result["rejected: interleaved sources"].text
    assert "two sources" in text and "(100 states accepted, 99 messages rejected)" in text


def test_errors_of_reading(tmp_path, panda):
    """Each names what there is, or what may be meant."""
    path = tmp_path / "recording.mcap"
    states = [Message("/joint_states", now, raw) for raw, now in driven(panda, 5)]

    def refused(what, path=path, model=panda, **options):
        with pytest.raises(dd.InputError, match=what):
            dd.read_recording(path, model, **options)

    refused(r"no file or folder.*nothing\.mcap", tmp_path / "nothing.mcap")
    os.mkfifo(tmp_path / "pipe.csv")
    refused(r"no file or folder.*pipe\.csv'", tmp_path / "pipe.csv")
    for name in ("day.mcap", "day.csv", "day"):
        (tmp_path / name).write_text("version https://git-lfs.github.com/spec/v1\noid sha256:12\n")
        refused(rf"{name}' is a pointer of Git LFS\. Run git lfs pull", tmp_path / name)
    write_mcap(path, states)
    refused("robot_description", model=None)
    refused(r"no topic '/joint_state'.*: it has /joint_states", topic="/joint_state")
    for span in ({"start": 1e300}, {"start": 2.0, "end": 2.0}, {"end": float("nan")}):
        refused(r"start is .* s and end is .* s; expected seconds after", **span)
    assert len(dd.read_recording(path, panda, end=float("inf"))) == 5
    refused("no parameter 'max_agge'", parameters={"max_agge": 1.0})
    refused("parameter 'locked_joints' is", parameters={"locked_joints": ["a=0"]})
    assert len(dd.read_recording(path, panda, parameters={"gravity": [0.0, 0.0, -9.81]})) == 5
    write_mcap(path, [])
    refused("has no joint states")
