# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings in pieces: cut anywhere and put together, they are what one piece is."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import diag_dynamics as dd
from bags import Told, odometry, write_floating, write_mcap
from diag_dynamics.recordings.analysis import Analysis
from diag_dynamics.recordings.pieces import repaired, seams, settling_time, spans, together
from diag_dynamics.recordings.recording import Reading
from diag_dynamics.recordings.summary import summary_of
from hostile import MS, START, Driver, S, hostile

AT_REST = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
SOME = {
    "defaults": {},
    "collisions": {"external_torque.gain": 25.0, "external_torque.threshold": 2.0},
    "alarms": {"external_torque.gain": 25.0, "alarm.joints": ["*=35"], "alarm.norm": 29.0, "alarm.release": 0.95},
    "refusing frozen values": {"frozen_values": "refuse", "frozen_timeout": 0.05},
    "judging little": {"max_age": 0.0, "absurd.jump": 0.0, "absurd.beyond_limits": 0.0, "joint_timeout": 0.0},
    "estimating velocities": {"missing_velocity": "estimate"},
}


@pytest.fixture(scope="module")
def panda():
    return dd.load_robot("panda")


def good(model, seconds, seed=1):
    """Messages of one driver, 500 Hz with jitter, about which nothing is wrong; and times of reception."""
    driver, rng = Driver(model, seed), np.random.default_rng(seed)
    stamps = START + np.arange(int(500 * seconds)) * 2 * MS + rng.integers(-1000, 1000, int(500 * seconds))
    return [(driver.good(int(stamp)), int(stamp) + 200_000) for stamp in stamps]


def written(path, pairs, **options):
    """The same in a file, as the library mcap writes it, in chunks of some dozens of messages."""
    return write_mcap(path, [Told("/joint_states", now, raw) for raw, now in pairs], chunk_size=20_000, **options)


def analysed(path, model, parameters, begin=None, end=None, settle=None):
    reading = Reading(path, model, parameters=parameters)
    reading.limit(begin, end, settling_time(reading.settings, 25.0) if settle is None else settle)
    analysis = Analysis(reading, threads=1)
    analysis.run()
    return analysis.outcome


def in_pieces(path, model, parameters, pieces, settle=None):
    """Outcome, and how many pieces it took in the end."""
    while True:
        outcomes = [analysed(path, model, parameters, *piece, settle) for piece in pieces]
        better = repaired(pieces, outcomes)
        if better == pieces:
            return together(outcomes), len(pieces)
        pieces = better


def compare(one, other, where="", scale=0.0):
    """Numbers of two summaries: whole numbers, texts and times are the same, others to 1e-12."""
    assert type(one) is type(other), where
    if isinstance(one, dict):
        assert one.keys() == other.keys(), where
        for key in one:
            compare(one[key], other[key], f"{where}.{key}")
    elif isinstance(one, list):
        assert len(one) == len(other), where
        for k, pair in enumerate(zip(one, other, strict=True)):
            compare(*pair, f"{where}[{k}]")
    elif isinstance(one, float):
        assert math.isclose(one, other, rel_tol=1e-12, abs_tol=1e-14), f"{where}: {one} {other}"
    else:
        assert one == other, where


def unordered(summary):
    """Findings in an order of their own: first ones of a cause may come in another piece than others."""
    return summary | {"findings": sorted(summary["findings"], key=str)}


def check(path, model, parameters, pieces, settle=None):
    whole = analysed(path, model, parameters)
    outcome, number = in_pieces(path, model, parameters, pieces, settle)
    compare(unordered(summary_of(outcome)), unordered(summary_of(whole)))
    return number


@pytest.mark.parametrize("parameters", SOME.values(), ids=SOME)
def test_good_recordings_need_no_repair(tmp_path, panda, parameters):
    path = written(tmp_path / "good.mcap", good(panda, 16.0))
    pieces = seams(Reading(path, panda), 4.0)
    assert len(pieces) == 4
    assert check(path, panda, parameters, pieces) == 4


@pytest.mark.parametrize("parameters", SOME.values(), ids=SOME)
@settings(max_examples=6, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 1000), cuts=st.lists(st.floats(0.01, 0.99), min_size=1, max_size=4))
@example(seed=278, cuts=[0.1875])  # texts of refused states once were those of later ones
def test_hostile_recordings(tmp_path, panda, parameters, seed, cuts):
    pairs = hostile(panda, seed, 1200, odd=0.05)
    path, last = written(tmp_path / "hostile.mcap", pairs), pairs[-1][1]
    times = sorted({START + int(part * (last - START)) for part in cuts})
    check(path, panda, parameters, spans(times), settle=2 * S)


def test_most_seams_of_hostile_recordings_hold(tmp_path, panda):
    """The above would hold of pieces that are always made one again."""
    held = 0
    for seed in range(8):
        pairs = hostile(panda, seed, 1500, odd=0.03)
        path, last = written(tmp_path / f"{seed}.mcap", pairs), pairs[-1][1]
        held += check(path, panda, {}, spans([START + k * (last - START) // 3 for k in (1, 2)]), settle=2 * S) - 1
    assert held >= 8


def test_too_short_an_overlap_is_found(tmp_path, panda):
    path = written(tmp_path / "good.mcap", good(panda, 6.0))
    assert check(path, panda, {}, spans([START + 3 * S]), settle=100 * MS) == 1


def test_floating_base(tmp_path):
    """What is known of odometry crosses seams, too."""
    model = dd.load_robot("panda", floating_base=True)
    path, joints = tmp_path / "base.mcap", good(model, 14.0)
    bases = [
        (now, odometry(now, model.root_link, AT_REST, (1e-3 * k, 0.0, 0.0, 0.0, 0.0, 0.0)))
        for k, (_, now) in enumerate(joints)
        if k % 5 == 0 and k % 1000 < 900  # without it for a while, until it is stale
    ]
    write_floating(path, joints, bases)
    pieces = seams(Reading(path, model), 4.0)
    assert len(pieces) == 4
    assert check(path, model, {"odom_timeout": 0.1}, pieces) == 4
    counts = analysed(path, model, {"odom_timeout": 0.1}).account.counts
    assert counts["rejected: stale odometry"] > 100


def test_part_of_a_recording(tmp_path, panda):
    pairs = good(panda, 6.0)
    path = written(tmp_path / "good.mcap", pairs)
    whole, first = dd.read_recording(path, panda), pairs[0][1]
    part = dd.read_recording(path, panda, start=1.5, end=2.25)
    within = [first + 1.5 * S <= now < first + 2.25 * S for _, now in pairs]
    np.testing.assert_array_equal(part.q, whole.q[within])
    assert part.counts["received"] == sum(within)
    assert sum(len(piece) for piece in dd.stream_recording(path, panda, start=5.0)) == sum(
        now >= first + 5 * S for _, now in pairs
    )
    with pytest.raises(dd.InputError, match="end is 1"):
        dd.read_recording(path, panda, start=2.0, end=1.0)
    with pytest.raises(dd.InputError, match="start is -1"):
        dd.read_recording(path, panda, start=-1.0)


def test_part_of_a_table(tmp_path, panda):
    names, rows = panda.dof_names, []
    for k in range(100):
        rows.append(",".join(map(str, [k * 0.01, *(0.001 * k * j for j in range(len(names)))])))
    path = tmp_path / "table.csv"
    path.write_text("\n".join([",".join(["t", *(f"q_{name}" for name in names)]), *rows]), encoding="utf-8")
    parameters = {"missing_velocity": "estimate", "velocity_filter_time": 0.0}
    part = dd.read_recording(path, panda, parameters=parameters, start=0.3, end=0.5)
    np.testing.assert_allclose(part.t, np.arange(31, 50) * 0.01, atol=1e-9)  # the first has no velocity yet


def test_lying_chunks_are_one_piece(tmp_path, panda):
    """A chunk that says that its messages end before they do: who skips it by that would lose them."""
    path = written(tmp_path / "good.mcap", good(panda, 16.0), enable_crcs=False)
    whole, pieces = analysed(path, panda, {}), seams(Reading(path, panda), 4.0)
    data, begin = bytearray(path.read_bytes()), pieces[1][0].to_bytes(8, "little")
    for kind in (6, 8):  # the chunk that begins at the first seam, and what the index says of it
        at = next(k for k in range(9, len(data)) if data[k - 9] == kind and data.startswith(begin, k))
        data[at + 8 : at + 16] = begin  # the end is where they begin
    path.write_bytes(data)
    assert seams(Reading(path, panda), 4.0) == pieces  # the index is used
    outcome, number = in_pieces(path, panda, {}, pieces)
    assert number == 1
    compare(unordered(summary_of(outcome)), unordered(summary_of(whole)))


def test_what_stands_is_carried_over_a_seam(tmp_path, panda):
    """An offset that has stood since long before a seam is not known behind it: both pieces are analysed again, as one."""
    path = written(tmp_path / "good.mcap", good(panda, 16.0))
    parameters = {"external_torque.gain": 25.0, "alarm.joints": ["*=30"], "alarm.standing": 0.1}
    assert check(path, panda, parameters, seams(Reading(path, panda), 4.0)) < 4
