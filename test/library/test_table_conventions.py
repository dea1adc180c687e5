# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables without a map: three conventions are read, all else is an error that offers a map."""

import re
import shlex
from functools import cache

import numpy as np
import pyarrow as pa
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from pyarrow import parquet

import diag_dynamics as dd
import robots
from bags import arm, numbered, urdf_of, write_mcap
from diag_dynamics.cli.main import main
from diag_dynamics.recordings.sources import Source, open_source
from diag_dynamics.recordings.tables.column_map import ColumnMap
from diag_dynamics.recordings.tables.columnar import read_npz
from diag_dynamics.recordings.tables.readers import open_reader
from diag_dynamics.recordings.tables.table import Table
from diag_dynamics.recordings.tables.template import write_template
from examples import examples

JOINTS = "shoulder", "elbow", "wrist"
"""Of the robot, from the base to the tip."""
FIELDS = "position", "velocity", "effort"
ROWS = 5
LOOSE = {"joint_timeout": ["*=0"], "stuck_timeout": 0.0, "missing_velocity": "estimate"} | {
    "plausibility.jump": 0.0
}
WORDS = {
    "position": ("q", "pos", "Position", "angle"),
    "velocity": ("qd", "dq", "vel", "velocity"),
    "effort": ("tau", "torque", "EFFORT", "tau_J"),
}
OFFER = r"diag-dynamics (analyse \S+ --urdf \S+ --columns NEW.yaml)"
robot = cache(arm)


def value(field, joint, row):
    """Return a number that states its quantity, joint and row."""
    return FIELDS.index(field) + 0.1 * JOINTS.index(joint) + 0.001 * row


TRUTH = [
    [[value(field, joint, row) for joint in JOINTS] for row in range(ROWS)] for field in FIELDS
]
LIMITS = {"": 0.0, " [deg]": np.pi / 180, " (mrad)": 1e-3}


def read(path, columns=None, joints=JOINTS, **options):
    return dd.read_recording(path, robot(*joints), columns, parameters=LOOSE, **options)


def write(folder, columns, separator=","):
    """Write cells by header, in this order, as text; return the path."""
    rows = [
        separator.join(columns),
        *(separator.join(map(str, row)) for row in zip(*columns.values(), strict=True)),
    ]
    path = folder / "table.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def cells(field, joint):
    return [f"{value(field, joint, row):.4f}" for row in range(ROWS)]


def require_truth(recording, factor=1.0):
    """Require the numbers of all rows, each at its joint."""
    assert [finding.text for finding in recording.findings if finding.cause != "note"] == []
    for values, truth, scale in zip(
        (recording.q, recording.qd, recording.tau), TRUTH, (factor, 1.0, 1.0), strict=True
    ):
        np.testing.assert_allclose(values, np.array(truth) * scale, rtol=0, atol=1e-12)


OTHERS = (
    "q_gripper",
    "cmd_q_elbow",
    "target_q_1",
    "q_d[0]",
    "temperature_1",
    "tcp_speed_2",
    "mode",
)
NAMED = (
    "{0}_{1}",
    "{0}.{1}",
    "{0}[{1}]",
    "{1}_{0}",
    "/joint_states/{1}/{0}",
    "{1} {0}",
    "state.{0}.{1}",
)
NUMBERED = (
    "{0}{1}",
    "{0}_{1}",
    "{0}[{1}]",
    "J{1} {0}",
    "actual_{0}_{1}",
    "joint{1}_{0}",
    "{0}_j{1}",
)
TIMES = {"t": 1.0, "Time [ms]": 1e3, "timestamp_us": 1e6, "header.stamp": 1.0, "__time": 1.0}


@st.composite
def headers(draw, kind):
    """Return cells by header in any order, and the factor of positions to SI."""
    form = draw(st.sampled_from(kind))
    unit = draw(st.sampled_from(sorted(LIMITS)))
    first = draw(st.integers(0, 1))
    labels = JOINTS if kind is NAMED else range(first, first + len(JOINTS))
    time = draw(st.sampled_from(sorted(TIMES)))
    columns = {time: [0.01 * row * TIMES[time] for row in range(1, ROWS + 1)]}
    for field in FIELDS:
        word = draw(st.sampled_from(WORDS[field]))
        for label, joint in zip(labels, JOINTS, strict=True):
            columns[form.format(word, label) + unit * (field == "position")] = cells(field, joint)
    for name in draw(st.sets(st.sampled_from(OTHERS))):
        columns[name] = [7] * ROWS
    order = draw(st.permutations(list(columns)))
    return {name: columns[name] for name in order}, LIMITS[unit] or 1.0


@pytest.mark.parametrize("kind", [NAMED, NUMBERED], ids=["by joint", "by number"])
@examples(60)
@given(data=st.data(), separator=st.sampled_from(",;\t"))
def test_random_tables_are_read_right(tmp_path_factory, kind, data, separator):
    """Columns may be in any order, between others that are not read."""
    columns, factor = data.draw(headers(kind))
    path = write(tmp_path_factory.mktemp("random"), columns, separator)
    require_truth(read(path), factor)


@examples(100)
@given(data=st.data(), at=st.integers(0, 40), letter=st.sampled_from("abdejlmnqtuvwy0123_./[] "))
def test_changed_headers_are_never_read_wrong(tmp_path_factory, data, at, letter):
    """A table with one other character in a header is read right, in part, or not at all."""
    columns, factor = data.draw(headers(data.draw(st.sampled_from([NAMED, NUMBERED]))))
    names = list(columns)
    place = data.draw(st.integers(0, len(names) - 1))
    at = at % len(names[place])
    names[place] = names[place][:at] + letter + names[place][at + 1 :]
    folder = tmp_path_factory.mktemp("changed")
    if len(set(names)) < len(names):
        return
    changed = dict(zip(names, columns.values(), strict=True))
    try:
        recording = read(write(folder, changed))
    except dd.InputError:
        return
    rows = np.rint((recording.t - 0.01) * 100).astype(int)
    scales = factor, 1.0, 1.0
    for values, truth, scale in zip(
        (recording.q, recording.qd, recording.tau), TRUTH, scales, strict=True
    ):
        if values is None or (values is recording.qd and recording.states.velocity_estimated.any()):
            continue
        expected = np.array(truth)[rows] * scale
        unknown = np.isnan(values) if values is recording.tau else False
        np.testing.assert_allclose(np.where(unknown, expected, values), expected, atol=1e-12)


@examples(40)
@given(
    orders=st.lists(st.permutations(JOINTS), min_size=ROWS, max_size=ROWS),
    frame=st.sampled_from(["", "base"]),
    prefix=st.sampled_from(["", "left_"]),
)
def test_echoed_rows_name_their_joints(tmp_path_factory, orders, frame, prefix):
    """`ros2 topic echo --csv` has no header, and each row an order of its own."""
    path = tmp_path_factory.mktemp("echo") / "echo.csv"
    lines = [
        [7, 10_000_000 * row, frame, *(prefix + joint for joint in order)]
        + [f"{value(field, joint, row):.4f}" for field in FIELDS for joint in order]
        for row, order in enumerate(orders)
    ]
    path.write_text("".join(",".join(map(str, line)) + "\n" for line in lines))
    recording = read(path, joint_names={"left_*": "*"} if prefix else None)
    require_truth(recording)
    assert recording.stamp.tolist() == [7 * 10**9 + 10_000_000 * row for row in range(ROWS)]
    if prefix:
        assert read(path).counts["foreign"] == ROWS
        mapped = LOOSE | {"joint_names": ["left_*=*"]}  # as the monitor does
        require_truth(dd.read_recording(path, robot(*JOINTS), parameters=mapped))


def test_names_and_positions_alone_are_no_echo(tmp_path):
    path = tmp_path / "echo.csv"
    path.write_text("1,0,,elbow,shoulder,wrist,0.1,0.2,0.3\n")
    with pytest.raises(dd.InputError, match=OFFER):  # positions, or another quantity alone
        read(path)


def test_arrays_are_read_by_their_names(tmp_path):
    """Arrays and lists of as many columns as joints."""
    t = np.arange(1, ROWS + 1) / 100
    q, qd, tau = np.array(TRUTH)
    np.savez(tmp_path / "x.npz", times=t, positions=q, velocities=qd, torques=tau, target=q)
    recording = read(tmp_path / "x.npz")
    require_truth(recording)
    assert "not read: target." in {finding.text for finding in recording.findings}
    table = pa.table(
        {"t": t, **{key: x.tolist() for key, x in zip(FIELDS, (q, qd, tau), strict=True)}}
    )
    degrees = table.schema.field("position").with_metadata({"unit": "deg"})
    table = table.cast(table.schema.set(1, degrees))
    parquet.write_table(table, tmp_path / "x.parquet")
    require_truth(read(tmp_path / "x.parquet"), np.pi / 180)
    numbers = {f"q{k}": q[:, k] for k in range(3)}
    for others in (numbers, {"pos": q}):
        np.savez(tmp_path / "x.npz", t=t, q=q, **others)
        with pytest.raises(dd.InputError, match=rf"the position may be .*{OFFER}"):
            read(tmp_path / "x.npz")


# --- Errors ---

NUMBERS = {"q1": [1], "q2": [2], "q3": [3]}
REFUSED = {
    "another word": {"t": [1], "x_elbow": [1], "x_shoulder": [2], "x_wrist": [3]},
    "commands": {"t": [1], **{f"target_q_{k}": [1] for k in range(3)}},
    "unit as a word": {"t": [1], **{f"q_deg_{k}": [1] for k in range(3)}},
    "unknown unit": {"t": [1], **NUMBERS, "tau1 [%]": [1], "tau2": [1], "tau3": [1]},
    "too few": {"t": [1], "q1": [1], "q2": [2]},
    "too many": {"t": [1], **NUMBERS, "q4": [1]},
    "a gap": {"t": [1], "q1": [1], "q2": [2], "q4": [3]},
    "other joints": {"t": [1], "q_hip": [1], "q_knee": [2], "q_toe": [3]},
    "two sets of positions": {"t": [1], **NUMBERS, "pos1": [1], "pos2": [2], "pos3": [3]},
    "two units": {"t": [1], **NUMBERS, "q1 [deg]": [5]},
    "names and numbers": {"t": [1], **{f"q_{joint}": [1] for joint in JOINTS}, **NUMBERS},
    "no time": NUMBERS,
    "two times": {"t": [1], "time": [1], **NUMBERS},
    "seconds and nanoseconds": {"sec": [1], "nanosec": [1], **NUMBERS},
    "unit of time": {"t [furlongs]": [1], **NUMBERS},
    "names in cells": {"t": [1], "a": ["elbow"], "b": ["wrist"], "c": ["shoulder"], **NUMBERS},
    "names in headers": {"t": [1], "q0 (elbow)": [1], "q1 (shoulder)": [2], "q2 (wrist)": [3]},
    "arrays in cells": {"t": [1], "position": ['"[1, 2, 3]"']},
    "a line of names": {
        "t": ["", 1],
        "q1": ["elbow", 1],
        "q2": ["shoulder", 2],
        "q3": ["wrist", 3],
    },
    "numbers instead of names": {"0": [0], "1.5": [1], "x": [2]},
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_is_ambiguous_is_an_error_that_offers_a_map(tmp_path, kind):
    with pytest.raises(dd.InputError, match=f"({OFFER}|in a column map)"):
        read(write(tmp_path, REFUSED[kind]))


@pytest.mark.parametrize(
    "comment",
    ["# joints: elbow, wrist", "% q1 = wrist", "# joint order as sent", "# motors: a b c"],
)
def test_comments_and_metadata_that_may_state_an_order_are_an_error(tmp_path, comment):
    path = write(tmp_path, {"t": [1], **NUMBERS})
    table = pa.table({"t": [1.0], **{name: [1.0] for name in NUMBERS}})
    parquet.write_table(table.replace_schema_metadata({"note": comment}), tmp_path / "x.parquet")
    np.savez(tmp_path / "x.npz", t=[1.0], q=np.ones((1, 3)), note=np.array(comment))
    path.write_text(f"{comment}\n{path.read_text()}")
    for name in ("table.csv", "x.parquet", "x.npz"):
        with pytest.raises(
            dd.InputError, match=r"columns have numbers, and .* may state their order"
        ):
            read(tmp_path / name)
        assert "position" in str(read(tmp_path / name, {"joints": list(JOINTS)}).findings)
    np.savez(tmp_path / "x.npz", t=[1.0], q=np.ones((1, 3)), names=np.array(JOINTS, object))
    with pytest.raises(dd.InputError, match=r"'names: .*' may state their order"):
        read(tmp_path / "x.npz")
    np.savez(tmp_path / "x.npz", t=[1.0], q=np.ones((1, 3)), names=np.ones(3, bool))
    assert "position" in str(read(tmp_path / "x.npz").findings)


def test_a_quantity_without_a_separator_names_no_joint(tmp_path):
    """A joint may be called d, and qd is a velocity."""
    columns = {"t": [1], "q_c": [1], "q_d": [2], "qd_c": [3], "qd_d": [4]}
    recording = read(write(tmp_path, columns), joints=("c", "d"))
    assert (recording.q.tolist(), recording.qd.tolist()) == ([[1, 2]], [[3, 4]])
    with pytest.raises(dd.InputError, match=OFFER):
        read(write(tmp_path, {"t": [1], "qd": [1]}), joints=("d",))


@pytest.mark.parametrize(
    ("parents", "names"),
    [
        ((0, 1, 2, 3), ("pan", "lift", "wrist", "finger")),
        ((0, 1, 2, 3), ("arm_1", "arm_2", "arm_3", "finger_1")),
        ((0, 1, 2, 0), ("pan", "lift", "wrist", "other_arm")),
        ((0, 1, 2, 3), ("torso", "arm_1", "arm_2", "arm_3")),
    ],
)
def test_numbers_of_fewer_joints_are_those_that_carry_the_others(tmp_path, parents, names):
    """What else they may be is an error; `locked_joints` has the joints without columns."""
    columns = {f"q{k}": cells("position", joint) for k, joint in enumerate(JOINTS, 1)}
    path = write(tmp_path, {"t": [0.1 * row for row in range(ROWS)], **columns})
    inertia = 0.1, 0, 0, 0.1, 0, 0.1
    parts = [robots.link("l0")]
    for k, (parent, name) in enumerate(zip(parents, names, strict=True), 1):
        parts += [robots.link(f"l{k}", 1.0, (0, 0.1, 0), inertia)]
        parts += [robots.joint(name, "revolute", f"l{parent}", f"l{k}", (0, 1, 0))]
    options = {"parameters": LOOSE | {"locked_joints": ["*=0.5"]}}
    urdf = robots.description("some", *parts)
    if names[-1] in ("other_arm", "arm_3"):
        with pytest.raises(dd.InputError, match=r"no columns are recognized as.*--joint-names"):
            dd.read_recording(path, urdf, **options)
        return
    recording = dd.read_recording(path, urdf, **options)
    assert recording.model.locked_joints == {names[-1]: 0.5}
    assert recording.model.dof_names == names[:3]
    np.testing.assert_allclose(recording.q, np.array(TRUTH[0])[1:], rtol=0, atol=1e-12)


def test_joints_with_other_numbers_are_an_error(tmp_path):
    with pytest.raises(dd.InputError, match="columns have numbers, and the joints others: j2, j1"):
        read(write(tmp_path, {"t": [1], "q1": [1], "q2": [2]}), joints=("j2", "j1"))


# --- The map to fill in ---


def rostopic(folder):
    """Write what `rostopic echo -p` writes of a driver with an order of its own."""
    columns = {"%time": [10**18 + 10**7 * row + 5 for row in range(ROWS)]}
    columns["field.header.stamp"] = [10**18 + 10**7 * row for row in range(ROWS)]
    order = sorted(JOINTS)
    columns |= {f"field.name{k}": [joint] * ROWS for k, joint in enumerate(order)}
    for field in FIELDS:
        columns |= {f"field.{field}{k}": cells(field, joint) for k, joint in enumerate(order)}
    return write(folder, columns), columns


def test_a_map_has_the_beginning_of_values(tmp_path):
    np.savez(tmp_path / "x.npz", t=[1.0], q=np.ones((1, 999)))
    write_template(tmp_path / "new.yaml", read_npz(str(tmp_path / "x.npz")), JOINTS)
    assert (tmp_path / "new.yaml").stat().st_size < 1000


def test_the_command_writes_a_map_to_fill_in(tmp_path, capsys, monkeypatch):
    """It has every header and first value; its proposals, with the second time, give the states."""
    path, columns = rostopic(tmp_path)
    (tmp_path / "arm.urdf").write_text(urdf_of(*JOINTS))
    new = tmp_path / "new.yaml"
    command = ["analyse", str(path), "--urdf", str(tmp_path / "arm.urdf")]
    assert main(command) == 2
    monkeypatch.chdir(tmp_path)
    assert main(shlex.split(re.search(OFFER, capsys.readouterr().err)[1])) == 2
    assert (tmp_path / "NEW.yaml").exists()
    assert main([*command, "--columns", str(new)]) == 2
    assert f"Wrote {new}" in capsys.readouterr().err
    text = new.read_text(encoding="utf-8")
    for name, values in columns.items():
        assert f'"{name}", "{values[0]}"' in text
    assert yaml.safe_load(text) is None
    lines = re.findall(r"^# (\w+: .*)$", text, re.MULTILINE)
    proposals = {}
    for line in lines:
        proposals |= (
            yaml.safe_load(line) if line.split(":")[0] in ("time", "names", *FIELDS) else {}
        )
    proposals["scale"] = {"time": "ns"}
    require_truth(read(path, proposals))
    new.write_text(yaml.safe_dump(proposals))
    assert main([*command, "--columns", str(new), "--quiet"]) < 2
    order = {key: value for key, value in proposals.items() if key != "names"}
    require_truth(read(path, order | {"joints": sorted(JOINTS)}))


def test_two_columns_of_time_have_no_scale(tmp_path):
    """Seconds alone would be scaled."""
    path = write(tmp_path, {"sec": [1, 1], "nanosec": [1, 2], "q1": [1, 1]})
    columns = {"time": ["sec", "nanosec"], "position": ["q1"], "scale": {"time": "ms"}}
    with pytest.raises(dd.InputError, match="time has a scale and two columns"):
        read(path, columns, JOINTS[:1])


def test_a_map_is_written_of_tables_only(tmp_path, capsys):
    path = write_mcap(tmp_path / "x.mcap", numbered(3))
    assert main(["analyse", str(path), "--columns", str(tmp_path / "new.yaml")]) == 2
    assert not (tmp_path / "new.yaml").exists()
    assert "is no table" in capsys.readouterr().err


# --- Motors ---

MIXING = np.array([[1.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.25, -0.5]])


def test_motors_are_mixed_to_joints(tmp_path):
    """With q = B θ + offset the power of motors is that of joints; B⁻ᵀ maps efforts."""
    theta, rate, torque = np.random.default_rng(3).normal(size=(3, ROWS, 3))
    torque[2, 0] = np.nan
    np.savez(tmp_path / "x.npz", t=np.arange(1, ROWS + 1) / 100, q=theta, qd=rate, tau=torque)
    offset = [0.1, -0.2, 0.3]
    columns = {"mixing": MIXING.tolist(), "offset": {"position": offset}, "scale": {"position": 2}}
    recording = read(tmp_path / "x.npz", columns)
    np.testing.assert_allclose(recording.q, 2.0 * theta @ MIXING.T + offset, rtol=1e-14)
    powers = [
        (efforts * rates).sum(axis=1)
        for efforts, rates in ((recording.tau, recording.qd), (torque, rate))
    ]
    np.testing.assert_allclose(*powers, rtol=1e-13)
    assert np.isnan(recording.tau[2]).tolist() == [True, False, False]
    for matrix, text in (
        ([[1, 2], [2, 4]], r"mixing is .*; expected rows of an invertible matrix"),
        ([[1, 0], [0, 1]], "mixing has 2 rows; expected 3"),
    ):
        with pytest.raises(dd.InputError, match=text):
            read(tmp_path / "x.npz", {"mixing": matrix})


# --- Readers ---


def test_readers_yield_what_the_protocols_state(tmp_path):
    path = write(tmp_path, {"t": [1], **NUMBERS})
    parquet.write_table(pa.table({"t": [1.0]}), tmp_path / "x.parquet")
    np.savez(tmp_path / "x.npz", t=[1.0])
    bag = write_mcap(tmp_path / "x.mcap", numbered(3))
    for name in (path, bag):
        assert isinstance(open_source(name), Source)
    for name in (path, tmp_path / "x.parquet", tmp_path / "x.npz", f"{path}+{path}"):
        assert isinstance(open_reader(str(name), ColumnMap()), Table)
