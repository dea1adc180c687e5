# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parquet and npz: what pandas, pyarrow and numpy write is read back, and whatever is wrong with a file is counted."""

import contextlib
import random
import sys
import zipfile
from decimal import Decimal
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.tables import npz_reader, parquet_reader
from diag_dynamics.tables.opening import open_table
from examples import examples

pa = pytest.importorskip("pyarrow", reason="pyarrow writes and reads Parquet")
parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow writes and reads Parquet")

ROOT = Path(__file__).parents[2]
RECORDINGS = ROOT.parent / "shared" / "recordings"

NAMES = ["t", "q_a", "q_b", "qd_a", "qd_b", "tau_a", "tau_b"]
START = 1_700_000_000_123_456_789
"""[ns], which no double holds."""


def read(path, columns=None, joints=()):
    """Rows in one piece, and what was lost, as where and what."""
    reader = open_table(path, columns, joints)
    parts = list(reader.pieces()) or [[None] * 6]
    rows = [None if field[0] is None else np.concatenate(field) for field in zip(*parts, strict=True)]
    return rows, [(one.where, one.what) for one in reader.unread]


@pytest.fixture
def written(tmp_path):
    """Writes a table as Parquet, or arrays as npz, and returns its path."""

    def write(content, **options):
        if isinstance(content, dict):
            np.savez(tmp_path / "table.npz", **content)
            return tmp_path / "table.npz"
        parquet.write_table(content, tmp_path / "table.parquet", **options)
        return tmp_path / "table.parquet"

    return write


numbers = st.floats(allow_nan=True, allow_infinity=True) | st.floats(-10, 10)
tables = st.lists(st.tuples(st.floats(-1e6, 1e6), *[numbers] * 6), min_size=1, max_size=20)


@examples(60)
@example([(0.0,) * 7], "npz")
@example([(0.0,) * 7], "npz, packed")
@given(tables, st.sampled_from(["pandas", "pyarrow", "npz", "npz by joint", "npz, packed"]))
def test_what_others_write_is_read_back(tmp_path_factory, table, writer):
    path = tmp_path_factory.mktemp("written") / "table"
    array = np.array(table)
    if writer == "pandas":
        pd.DataFrame(table, columns=NAMES).to_parquet(path)
    elif writer == "pyarrow":
        parquet.write_table(pa.table(dict(zip(NAMES, array.T, strict=True))), path, row_group_size=7)
    else:
        with open(path, "wb") as file:
            if writer == "npz by joint":
                np.savez(file, **dict(zip(NAMES, array.T, strict=True)))
            else:
                save = np.savez if writer == "npz" else np.savez_compressed
                save(file, t=array[:, 0], q=array[:, 1:3], qd=np.asfortranarray(array[:, 3:5]), tau=array[:, 5:])
    (time, _, position, velocity, effort, rows), losses = read(path, joints=("a", "b"))
    assert losses == []
    np.testing.assert_array_equal(np.column_stack([time, position, velocity, effort]), array)
    assert rows.tolist() == list(range(len(table)))


TIMES = {
    "ns": (pa.array([START, START + 1]), {"scale": {"time": "ns"}}),
    "ns without a sign": (pa.array([START, START + 1], pa.uint64()), {"scale": {"time": 1e-9}}),
    "timestamps": (pa.array([START, START + 1], pa.timestamp("ns")), None),
    "timestamps with a zone": (pa.array([START, START + 1], pa.timestamp("ns", "Europe/Berlin")), None),
    "durations": (pa.array([START, START + 1], pa.duration("ns")), None),
    "decimals": (pa.array([Decimal(START).scaleb(-9), Decimal(START + 1).scaleb(-9)]), None),
    "in a dictionary": (pa.array([START, START + 1]).dictionary_encode(), {"scale": {"time": "ns"}}),
}


@pytest.mark.parametrize("kind", TIMES)
def test_times_to_the_nanosecond(written, kind):
    column, columns = TIMES[kind]
    rows, losses = read(written(pa.table({"t": column, "q1": [1.0, 2.0]})), columns)
    assert losses == [] and rows[1].tolist() == [START, START + 1]
    np.testing.assert_allclose(rows[0], START / 1e9, rtol=1e-16)


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_timestamps_of_any_unit(written, unit):
    column = pa.array([5, None, 7], pa.timestamp(unit))
    rows, losses = read(written(pa.table({"t": column, "q1": [1.0, 2.0, 3.0]}), version="2.6"))
    factor = {"s": 1, "ms": 1e3, "us": 1e6, "ns": 1e9}[unit]
    assert rows[0].tolist() == [5 / factor, 7 / factor] and rows[5].tolist() == [0, 2]
    assert losses == [("row 1", "no time, or one that is no number: 1 rows left out")]
    with pytest.raises(InputError, match="there is a scale of time, but 't' says its unit itself"):
        open_table(written(pa.table({"t": column, "q1": [1.0, 2.0, 3.0]})), {"scale": {"time": 1}})


def test_numbers_of_any_kind(written):
    kinds = [pa.float32(), pa.float64(), pa.float16(), pa.int8(), pa.uint64(), pa.decimal128(10, 3), pa.int32()]
    values = [Decimal(1), None, Decimal(3)], [1, None, 3]
    columns = {f"q{k}": pa.array(values[not pa.types.is_decimal(kind)], kind) for k, kind in enumerate(kinds)}
    columns["q6"] = columns["q6"].dictionary_encode()
    rows, losses = read(written(pa.table({"t": [0, 1, 2], "state": ["a", "b", "c"]} | columns)))
    assert losses == []
    np.testing.assert_array_equal(rows[2], np.array([[1.0], [np.nan], [3.0]]) * np.ones(7))


@pytest.mark.parametrize("kind", [pa.list_(pa.float64()), pa.list_(pa.float32(), 2), pa.large_list(pa.int16())])
def test_lists(written, kind):
    table = pa.table(
        {
            "t": [0.0, 1.0, 2.0],
            "q": pa.array([[1, 2], [3, 4], None], kind),
            "tau": pa.array([[], [5, 6], [7, 8]], pa.list_(pa.float64())),
        }
    )
    rows, losses = read(written(table), joints=("a", "b"))
    assert losses == []
    np.testing.assert_array_equal(rows[2], [[1, 2], [3, 4], [np.nan, np.nan]])
    np.testing.assert_array_equal(rows[4], [[np.nan, np.nan], [5, 6], [7, 8]])
    with pytest.raises(InputError, match="'q' has 2 columns, but there are 3 joints of the model"):
        open_table(written(table), joints=("a", "b", "c"))
    assert read(written(table), {"position": "q", "effort": "tau"})[0][4][1].tolist() == [5, 6]


def test_lists_of_another_length(written):
    lists = pa.array([[1.0, 2.0], [3.0], [4.0, 5.0, 6.0], [7.0, None]])
    rows, losses = read(written(pa.table({"t": [0.0, 1.0, 2.0, 3.0], "q": lists})))
    np.testing.assert_array_equal(rows[2], [[1, 2], [np.nan, np.nan], [np.nan, np.nan], [7, np.nan]])
    what = "list of another length than there are joints (column 'q': 1 instead of 2): 2 rows of it are NaN"
    assert losses == [("row 1", what)]


def test_joint_states(written):
    """A struct of lists, as a message is, names included; rows of other joints are left out."""
    states = [{"name": ["b", "a"], "position": [k, k + 10], "velocity": [], "effort": [1, 2]} for k in range(4)]
    states[2]["name"] = ["gripper"]
    states[2]["position"] = [9]
    kind = pa.struct(
        [("name", pa.list_(pa.string()))]
        + [(name, pa.list_(pa.float64())) for name in ("position", "velocity", "effort")]
    )
    table = pa.table({"stamp": [0.0, 1.0, 2.0, 3.0], "joint_states": pa.array(states, kind)})
    reader = open_table(written(table), joints=("a", "b"))
    (piece,) = reader.pieces()
    assert reader.joints == ("b", "a") and piece.rows.tolist() == [0, 1, 3]
    assert piece.position.tolist() == [[0, 10], [1, 11], [3, 13]] and piece.velocity is None
    assert [(one.where, one.what) for one in reader.unread] == [
        ("row 2", "names of other joints than the first row has: 1 rows left out")
    ]
    single = pa.table(
        {"t": [0.0], "name": [["a"]], "position": [[1.0]], "effort": pa.array([[]], pa.list_(pa.float64()))}
    )
    assert open_table(written(single)).notes[-1] == "not read: name, effort."
    assert read(written(single), joints=("a",))[0][4] is None
    flat = pa.table({"t": [0.0], "joint_states.position.a": [1.0], "joint_states.position.b": [2.0]})
    assert read(written(flat), joints=("b", "a"))[0][2].tolist() == [[2, 1]]


def damaged_groups(path, group):
    """Overwrites the numbers of one row group."""
    chunk = parquet.ParquetFile(path).metadata.row_group(group).column(1)
    content = bytearray(path.read_bytes())
    begin = chunk.data_page_offset
    content[begin : begin + chunk.total_compressed_size] = b"\xff" * chunk.total_compressed_size
    path.write_bytes(content)


def test_a_damaged_row_group_is_left_out(written, monkeypatch):
    time = np.arange(1000) / 100
    path = written(pa.table({"t": time, "q1": np.sin(time)}), row_group_size=100, use_dictionary=False)
    damaged_groups(path, 3)
    damaged_groups(path, 9)
    monkeypatch.setattr(parquet_reader, "ROWS", 30)
    rows, losses = read(path)
    assert rows[5].tolist() == [*range(300), *range(400, 900)]
    np.testing.assert_array_equal(rows[2][:, 0], np.sin(time[rows[5]]))
    ((where, what),) = losses
    assert (
        where == "row 300, row group 3"
        and what.startswith("row group cannot be read (")
        and what.endswith(": 200 rows lost")
    )


def test_parquet_that_cannot_be_read(written, tmp_path, monkeypatch):
    path = written(pa.table({"t": [0.0], "q1": [1.0]}))
    content = path.read_bytes()
    for cut in (8, len(content) // 2, len(content) - 1):
        path.write_bytes(content[:cut])
        with pytest.raises(
            InputError, match=r"table\.parquet' is no Parquet file that can be read: .*not copied whole"
        ):
            open_table(path)
    path.write_bytes(content)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(InputError, match="is a Parquet file, and pyarrow is not installed: pip install"):
        open_table(path)


@pytest.mark.parametrize(
    ("table", "columns", "message"),
    [
        ({"t": [0.0], "q1": ["1"]}, None, "no column is known as a position"),
        ({"t": [0.0], "q1": ["1"]}, {"position": "q1"}, "position: 'q1' does not hold numbers"),
        ({"t": ["0"], "q1": [1.0]}, None, "no column is known as that of the times"),
        ({"t": [[0.0]], "q1": [1.0]}, {"time": "t"}, "time: 't' has 1 columns, expected one"),
        ({"t": [0.0], "q1": pa.array([1], pa.timestamp("s"))}, None, "column 'q1' is of times, expected numbers"),
        (
            {"t": [0.0], "q": [[1.0]], "q2": [1.0]},
            {"position": ["q", "q2"]},
            "position: 'q' is a whole array, in a list",
        ),
    ],
)
def test_types_that_do_not_fit(written, table, columns, message):
    with pytest.raises(InputError, match=message):
        open_table(written(pa.table(table)), columns)


def test_no_rows(written):
    for content in (pa.table({"t": [0.0], "q1": [1.0]}).slice(0, 0), {"t": np.zeros(0), "q1": np.zeros(0)}):
        reader = open_table(written(content))
        assert list(reader.pieces()) == [] and [one.what for one in reader.unread] == ["there are no rows"]


@examples(150)
@given(st.integers(0, 10**6), st.integers(1, 40), st.sampled_from(["parquet", "npz"]))
def test_damaged_anywhere(tmp_path_factory, seed, count, kind):
    """Bytes overwritten anywhere, or the end cut off: rows, losses, or one of our errors; never another one."""
    path = tmp_path_factory.mktemp("damaged") / "table"
    time = np.arange(50) / 100
    if kind == "parquet":
        table = pa.table({"t": time, "q1": np.sin(time), "tau": [[x] for x in time], "name": [["a"]] * 50})
        parquet.write_table(table, path, row_group_size=10)
    else:
        with open(path, "wb") as file:
            np.savez_compressed(file, t=time, q=np.sin(time), tau=time[:, None], names=np.array(["a"]))
    content, generator = bytearray(path.read_bytes()), random.Random(seed)
    for _ in range(count):
        content[generator.randrange(4, len(content))] = generator.randrange(256)
    if seed % 3 == 0:
        del content[generator.randrange(4, len(content)) :]
    path.write_bytes(content)
    with contextlib.suppress(DiagDynamicsError):
        read(path)


# --- npz ---


def test_arrays_turned_round(written):
    generator = np.random.default_rng(1)
    time, q, tau = np.arange(5.0), generator.normal(size=(5, 3)), generator.normal(size=(3, 5))
    reader = open_table(written({"t": time[None], "q": q, "tau": tau, "limits": np.ones(3)}))
    (piece,) = reader.pieces()
    np.testing.assert_array_equal(piece.position, q)
    np.testing.assert_array_equal(piece.effort, tau.T)
    assert reader.notes[-1] == "tau: turned round, it has a row for each joint." and "not read: limits." in reader.notes
    square = generator.normal(size=(5, 5))  # which cannot be told: rows are times, as the page says
    np.testing.assert_array_equal(read(written({"t": time, "q": square}))[0][2], square)


def test_names_of_joints_in_an_npz(written):
    arrays = {"t": np.arange(3.0), "q": np.ones((3, 2)), "joint_names": np.array(["b", "a"])}
    assert open_table(written(arrays), joints=("a", "b")).joints == ("b", "a")
    assert open_table(written(arrays), {"joints": ["x", "y"]}).joints == ("x", "y")


@pytest.mark.parametrize("kind", ["M8[ns]", "m8[ns]", "M8[us]", "i8", "u8"])
def test_times_in_an_npz(written, kind):
    unit = 1000 if "us" in kind else 1
    arrays = {"t": np.array([START // unit, START // unit + 1]).astype(kind), "q1": np.array([1, 2], np.float16)}
    rows, losses = read(written(arrays), None if "8[" in kind else {"scale": {"time": "ns"}})
    assert losses == [] and rows[1].tolist() == [START // unit * unit, (START // unit + 1) * unit]
    assert rows[2].dtype == float


def test_missing_times_in_an_npz(written):
    rows, losses = read(written({"t": np.array([1, "NaT", 3], "M8[s]"), "q1": np.arange(3.0)}))
    assert rows[5].tolist() == [0, 2] and rows[1].tolist() == [10**9, 3 * 10**9]
    assert losses == [("row 1", "no time, or one that is no number: 1 rows left out")]


def test_pieces_of_an_npz(written, monkeypatch):
    monkeypatch.setattr(npz_reader, "ROWS", 30)
    path = written({"t": np.arange(100.0), "q": np.arange(200.0).reshape(100, 2)})
    assert len(list(open_table(path).pieces())) == 4
    rows, _ = read(path)
    assert rows[2].reshape(-1).tolist() == list(range(200)) and rows[5].tolist() == list(range(100))


@pytest.mark.parametrize(
    ("arrays", "columns", "message"),
    [
        (
            {"t": np.arange(3.0), "q": np.ones((4, 2))},
            None,
            r"array 'q' has shape \(4, 2\), expected a row for each of the 3 times in 't'",
        ),
        (
            {"t": np.arange(3.0), "q": np.ones((3, 2, 2))},
            {"position": "q"},
            "'q' does not hold numbers in one or two dimensions",
        ),
        ({"t": np.arange(3.0), "q": np.ones((3, 2), complex)}, {"position": "q"}, "'q' does not hold numbers"),
        ({"t": np.arange(3.0), "q": np.array([{}, {}, {}])}, None, "no column is known as a position"),
        (
            {"t": np.arange(3.0), "q": np.ones((3, 2))},
            {"position": [0, 1]},
            "is an npz: its arrays have names, expected no numbers",
        ),
        (
            {"t": np.arange(3.0), "pose": np.ones((3, 2))},
            {"position": "poes"},
            "there is no column 'poes' .did you mean 'pose'",
        ),
        ({"t": np.ones((3, 2)), "q": np.ones((3, 2))}, None, "time: 't' has 2 columns, expected one"),
        (
            {"t": np.arange(3.0), "q": np.ones((3, 2)), "pos": np.ones((3, 2))},
            None,
            "several sets of columns may be the position",
        ),
    ],
)
def test_arrays_that_do_not_fit(written, arrays, columns, message):
    with pytest.raises(InputError, match=message):
        open_table(written(arrays), columns)


def spoiled(path, name, at):
    """Overwrites the numbers of one array, so many bytes behind its beginning."""
    with zipfile.ZipFile(path) as file:
        begin = file.getinfo(f"{name}.npy").header_offset + at
    content = bytearray(path.read_bytes())
    content[begin : begin + 50] = b"\x55" * 50
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("at", [300, 50_000])  # in what is read with the header of the array, and far behind it
def test_a_damaged_array(written, at):
    time, values = np.arange(10_000.0), np.ones((10_000, 2))
    why = "array 'tau' cannot be read: Bad CRC-32 for file 'tau.npy'"
    rows, losses = read(spoiled(written({"t": time, "q": values, "tau": values}), "tau", at))
    assert rows[4] is None and len(rows[0]) == 10_000 and losses == [("array tau", why + ": all its numbers are lost")]
    rows, losses = read(spoiled(written({"t": time, "q1": time, "q2": time, "tau1": time, "tau2": time}), "tau2", at))
    assert np.isnan(rows[4][:, 1]).all() and rows[4][:, 0].tolist() == time.tolist() and len(losses) == 1
    with pytest.raises(InputError, match="array 'q' cannot be read: Bad CRC-32"):
        read(spoiled(written({"t": time, "q": values}), "q", at))


def test_an_array_larger_than_its_file(tmp_path):
    """A header that says so takes no memory."""
    np.savez(tmp_path / "small.npz", t=np.arange(3.0))
    with zipfile.ZipFile(tmp_path / "small.npz") as file:
        array = file.read("t.npy")
    assert array.count(b"(3,), ") == 1
    huge = array.replace(b"(3,), }" + b" " * 12, b"(3000000000000,), }")
    with zipfile.ZipFile(tmp_path / "huge.npz", "w") as file:
        file.writestr("t.npy", array)
        file.writestr("q.npy", huge)
        file.writestr("tau.npy", array[:60])
    message = (
        r"array 'q' cannot be read: its shape is \(3000000000000,\), but it has 152 bytes; array 'tau' cannot be read"
    )
    with pytest.raises(InputError, match=message):
        open_table(tmp_path / "huge.npz")


def test_archives_that_are_none(tmp_path, written):
    path = written({"t": np.arange(100.0), "q": np.ones((100, 2))})
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(InputError, match=r"is no npz that can be read: .*not copied whole"):
        open_table(path)
    with zipfile.ZipFile(tmp_path / "book.xlsx", "w") as file:
        file.writestr("xl/workbook.xml", "<x/>")
    with pytest.raises(InputError, match=r"is a zip archive without numpy's arrays \(it has xl/workbook.xml\)"):
        open_table(tmp_path / "book.xlsx")
    np.save(tmp_path / "q.npy", np.ones(3))
    with pytest.raises(InputError, match="is a single array without names"):
        open_table(tmp_path / "q.npy")


# --- A real one ---


def test_a_kuka():
    """A recording of a KUKA LWR 4+, by the names of its arrays; what was commanded is not taken for what was measured."""
    path = RECORDINGS / "kuka_lwr4" / "measurements_1.npz"
    if not path.exists():
        pytest.skip("../shared/recordings/kuka_lwr4 is not there")
    joints = tuple(f"lwr_{k}_joint" for k in range(7))
    reader = open_table(path, joints=joints)
    (piece,) = reader.pieces()
    assert reader.joints == joints and reader.unread == []
    with np.load(path) as arrays:
        for values, name in (
            (piece.time, "times"),
            (piece.position, "positions"),
            (piece.velocity, "velocities"),
            (piece.effort, "torques"),
        ):
            np.testing.assert_array_equal(values, arrays[name])
    assert np.abs(np.diff(piece.stamp) - 5e6).mean() < 1e6  # at 200 Hz
    again = read(path, {"time": "times", "position": "target_positions"})[0]
    assert again[3] is None and not np.array_equal(again[2], piece.position)
