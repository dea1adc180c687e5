# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables by `read_recording`: CSV and the like, Parquet, npz. Nothing is guessed, and nothing is
lost in silence.
"""

import bz2
import gzip
import math
import random
import re
import sys
import zipfile
from decimal import Decimal
from fractions import Fraction
from functools import cache
from math import pi
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from pyarrow import parquet

import diag_dynamics as dd
from bags import arm
from diag_dynamics.recordings.analysis import Analysis
from diag_dynamics.recordings.recording import Reading
from examples import examples
from pages import blocks_of

ARM = "shoulder", "elbow", "wrist"
FIELDS = "position", "velocity", "effort"
LOOSE = {"joint_timeout": ["*=0"], "stuck_timeout": 0.0} | {"plausibility.jump": 0.0}
"""Parameters by which every finite number with a velocity is a state."""
FREE = LOOSE | {"missing_velocity": "estimate", "velocity_filter_time": 0.0}
WIDTH = "another number of columns than the header has ({} instead of {}): {} rows omitted"
NO_TIME = "no time, or a time that is no number{}: {} rows omitted"
robot = cache(arm)


def read(path, columns=None, joints=("a",), parameters=FREE):
    """Read a table of an arm with these joints."""
    return dd.read_recording(path, robot(*joints), columns, parameters=parameters)


def lost(recording):
    """Return what could not be read, without the name of the file."""
    return [
        finding.text.partition(", ")[2]
        for finding in recording.findings
        if finding.cause == "unread"
    ]


def notes(recording):
    """Return how the columns were understood."""
    return [finding.text for finding in recording.findings if finding.cause == "note"]


@pytest.fixture
def written(tmp_path):
    """Write a text, a table of pyarrow, or a dict of arrays (npz); return the path."""

    def write(content, name="table.csv", **options):
        path = tmp_path / name
        if isinstance(content, dict):
            path = path.with_suffix(".npz")
            np.savez(path, **content)
        elif isinstance(content, pa.Table):
            path = path.with_suffix(".parquet")
            parquet.write_table(content, path, **options)
        else:
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


# --- Files of others ---

finite = st.floats(-1e4, 1e4)
tables = st.lists(
    st.tuples(*(finite,) * 4, *(st.one_of(finite, st.just(float("nan"))),) * 2),
    min_size=1,
    max_size=30,
)
NAMES = ["t", "q1", "q2", "qd1", "qd2", "tau1", "tau2"]
BY_NUMBERS = {
    "time": 1,
    "joints": ["a", "b"],
    "position": [2, 3],
    "velocity": [4, 5],
    "effort": [6, 7],
}
WRITERS = {
    "csv": lambda path, frame, **options: frame.to_csv(path, index=False, **options),
    "csv without header": lambda path, frame, **_: frame.to_csv(path, header=False),
    "txt": lambda path, frame, **_: np.savetxt(path, frame, header=" ".join(NAMES), fmt="%25.18e"),
    "parquet": lambda path, frame, **_: frame.to_parquet(path, row_group_size=7),
    "npz by joint": lambda path, frame, **_: np.savez(
        path, **{name: frame[name].to_numpy() for name in NAMES}
    ),
    "npz": lambda path, frame, **_: np.savez_compressed(
        path, t=frame.t, q=frame[NAMES[1:3]], qd=frame[NAMES[3:5]], tau=frame[NAMES[5:]]
    ),
}


@pytest.fixture(scope="module", autouse=True)
def first_reading(tmp_path_factory):
    """Read a table before the first test, which would pay for imports and kernels of all."""
    path = tmp_path_factory.mktemp("first") / "table.csv"
    pd.DataFrame(np.arange(14.0).reshape(2, 7), columns=NAMES).to_csv(path, index=False)
    read(path, None, joints="ab")


@pytest.mark.parametrize("writer", WRITERS)
@examples(40)
@given(
    tables,
    st.floats(-1e5, 1e5),
    st.sampled_from(",;\t|"),
    st.sampled_from(["\n", "\r\n"]),
    st.sampled_from(["", "nan", "NA", "null"]),
)
def test_what_others_write_is_read_to_the_last_bit(
    tmp_path_factory, writer, table, begin, separator, ending, missing
):
    path = tmp_path_factory.mktemp("written") / ("table.npz" if "npz" in writer else "table")
    table = np.column_stack([begin + 0.01 * np.arange(len(table)), table])
    options = {
        "sep": separator,
        "lineterminator": ending,
        "na_rep": missing,
        "quoting": int(missing == "NA"),
    }
    WRITERS[writer](path, pd.DataFrame(table, columns=NAMES), **options)
    recording = read(
        path, BY_NUMBERS | {"header": False} if "without" in writer else None, joints="ab"
    )
    assert not lost(recording) and len(recording) == len(table)
    np.testing.assert_array_equal(np.column_stack([recording.q, recording.qd]), table[:, 1:5])
    is_known = np.isfinite(table[:, 5:]).all(axis=1)
    np.testing.assert_array_equal(recording.states.effort_known, is_known)
    np.testing.assert_array_equal(recording.states.effort[is_known], table[is_known, 5:])
    exact = [round(Fraction(t) * 10**9) + recording.offset for t in table[:, 0].tolist()]
    assert (
        max(
            abs(entry - other) for entry, other in zip(recording.stamp.tolist(), exact, strict=True)
        )
        <= 1
    )


PACKED = {
    "gz": gzip.compress,
    "bz2": lambda data: bz2.compress(data, 1),  # in blocks of 100 kB
    "zst": lambda data: pa.compress(data, "zstd", asbytes=True),
    "lz4": lambda data: pa.compress(data, "lz4", asbytes=True),
}


@pytest.fixture(scope="module")
def long_text():
    """A text of several pieces that no packer does in one go, the last line of which is no row; and
    its positions.
    """
    positions = [random.Random(4).random() + 1e-6 * k for k in range(25_000)]
    pad = "x" * 20
    rows = "".join(f"{k / 1000},{entry},0,{pad}\n" for k, entry in enumerate(positions))
    return f"t,q1,qd1,pad\n{rows}1\n".encode(), positions


@pytest.mark.parametrize("ending", PACKED)
def test_packed(written, long_text, ending):
    """In one stream or two, whatever the name; one that is broken off is an error."""
    data, positions = long_text
    whole = PACKED[ending](data)
    for content in (whole, PACKED[ending](data[:200_000]) + PACKED[ending](data[200_000:])):
        name = f"table.csv.{ending}" if content is whole else "TABLE.CSV"
        recording = read(written(content, name), parameters=LOOSE)
        assert lost(recording) == ["line 25002: " + WIDTH.format(1, 4, 1)]
        assert recording.q[:, 0].tolist() == positions
    with pytest.raises(dd.InputError, match=rf"{ending}': .* after line \d+"):
        read(written(whole[: len(whole) * 2 // 3], f"table.csv.{ending}"), parameters=LOOSE)


# --- Damage ---

HOSTILE = {
    "a row too short": ("0,1,2\n1,1\n2,3,4\n", [0, 2], ["line 3: " + WIDTH.format(2, 3, 1)]),
    "text": (
        "0,1,2\n1,x,2\n2,1,1_0\n3,1,2\n",
        [0, 3],
        [
            "line 3: text where a number belongs (column 'q_a': 'x'): 4 fields are NaN"
        ],  # each one is read twice
    ),
    "times": (
        "0,1,2\n\n\nx,2,2\n,3,2\nnan,4,2\n2,5,2\n",
        [0, 2],
        ["line 5: " + NO_TIME.format(" ('x')", 3)],
    ),
    "NUL": (
        b"0,1,2\n\0\0\0\0\n2,3,4\n" + b"\0" * 5000,
        [0, 2],
        ["line 3: " + WIDTH.format(1, 3, 2)],
    ),
    "empty lines and comments": ("\n0,1,2\n\n  \n# a pause, here\n#1,2\n1,2,2\n\n", [0, 1], []),
    "quotes": ('"0","1"," 2 "\n1,"lost,2\n2,3,4\n', [0, 2], ["line 3: " + WIDTH.format(2, 3, 1)]),
    "infinite": ("0,1,2\n1,-inf,2\n2,1e400,3\n3,2,2\n", [0, 3], []),
    "missing": (
        "0,1,2\n" + "".join(f"{k},,2\n{k}.5,N/A,2\n{k}.6,null,2\n" for k in (1, 2)) + "3,2,2\n",
        [0, 3],
        [],
    ),
    "only a header": ("", [], ["end: there are no rows"]),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_texts(written, kind):
    """What is no row is counted, with its first line; numbers that are garbage are left to the
    monitor's rules.
    """
    rows, times, unread = HOSTILE[kind]
    content = b"t,q_a,q_b\n" + (rows.encode() if isinstance(rows, str) else rows)
    columns = {
        "time": "t",
        "position": ["q_a", "q_b"],
        "velocity": ["q_a", "q_b"],
    }  # so that each row has a velocity
    recording = read(written(content), columns, joints="ab")
    assert (recording.t.tolist(), lost(recording)) == (times, unread)


@pytest.mark.parametrize("kind", ["parquet", "npz"])
@examples(100)
@given(seed=st.integers(0, 10**6), count=st.integers(1, 40))
def test_damaged_anywhere(tmp_path_factory, seed, count, kind):
    """Bytes overwritten anywhere, or the end cut off: states, losses, or one of our errors."""
    path = tmp_path_factory.mktemp("damaged") / f"table.{kind}"
    time = np.arange(50) / 100
    rng = random.Random(seed)
    if kind == "parquet":
        texts = {"name": [["a"]] * 50, "mode": [f"run {x}" for x in time]}
        table = pa.table({"t": time, "q1": np.sin(time), "tau": [[x] for x in time]} | texts)
        parquet.write_table(table, path, row_group_size=10)
    else:
        np.savez_compressed(path, t=time, q=np.sin(time), tau=time[:, None], names=np.array(["a"]))
    content = bytearray(path.read_bytes())
    for _ in range(count):
        content[rng.randrange(4, len(content))] = rng.randrange(256)
    path.write_bytes(content[: rng.randrange(4, len(content)) if seed % 3 == 0 else None])
    try:
        read(path)
    except dd.DiagDynamicsError as error:
        assert str(path) in str(error)


def test_a_damaged_row_group_is_left_out(written):
    time = np.arange(1000) / 100
    table = pa.table({"t": time, "q1": np.sin(time), "qd1": np.cos(time)})
    path = written(table, row_group_size=100, use_dictionary=False)
    content = bytearray(path.read_bytes())
    for group in (3, 9):
        chunk = parquet.ParquetFile(path).metadata.row_group(group).column(1)
        begin = chunk.data_page_offset
        size = chunk.total_compressed_size
        content[begin : begin + size] = b"\xff" * size
    path.write_bytes(content)
    recording = read(path)
    np.testing.assert_array_equal(
        recording.q[:, 0], np.sin(np.delete(time, [*range(300, 400), *range(900, 1000)]))
    )
    (loss,) = lost(recording)
    assert loss.startswith("row 300, row group 3: ") and loss.endswith(": 200 rows lost")


def test_files_that_are_cut_or_none(written, monkeypatch):
    for content in (pa.table({"t": [0.0]}), {"t": np.arange(100.0)}):
        path = written(content)
        path.write_bytes(path.read_bytes()[:-30])
        with pytest.raises(dd.InputError, match=r"cannot be read: .*not copied completely"):
            read(path)
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("xl/workbook.xml", "<x/>")
    with pytest.raises(dd.InputError, match="is a zip archive without NumPy arrays"):
        read(path)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(dd.InputError, match="needs the package pyarrow: pip install pyarrow"):
        read(written("t,q1\n0,1\n"))


def test_rows_of_other_topics_are_no_messages(written):
    """Rows without any number are counted, not rejected."""
    rows = [
        f"{k / 100},{0.01 * k},1,3,,\n{k / 100 + 0.003},,,,1.5,\n{k / 100 + 0.004},NaN,,,,on\n"
        for k in range(20)
    ]
    text = (
        f"__time,{','.join(f'/joint_states/a/{name}' for name in FIELDS)},/imu/x,/mode\n"
        + ",,,,,\n"
        + "".join(rows)
        + "0.3,,1,,,\n"
    )
    numbers = {
        name: [0.01, None, 0.03]
        for name in (
            "/joint_states/a/position",
            "/joint_states/a/velocity",
            "/joint_states/a/effort",
        )
    }
    sent = {name: pa.array([0.01, np.nan, 0.03], from_pandas=False) for name in numbers}
    arrays = {
        "t": np.array([0.0, 0.1, 0.2]),
        "q": np.array([0.01, np.nan, 0.03]),
        "qd": np.array([0, np.nan, 0]),
    }
    for content, others, states, rejected in (
        (text, 41, 20, 1),
        (pa.table({"__time": [0.0, 0.1, 0.2], **numbers, "/imu/x": [None, 1.0, None]}), 1, 2, 0),
        (pa.table({"__time": [0.0, 0.1, 0.2], **sent}), 1, 2, 0),
        (arrays, 1, 2, 0),
    ):
        recording = dd.read_recording(written(content), robot("a"))
        assert f"rows without joint values, ignored: {others}." in notes(recording)
        assert recording.counts.get("rejected: no position", 0) == rejected
        assert (len(recording), lost(recording)) == (states, [])
        assert recording.offset == 10**9  # a stamp of zero is none
    stamped = [f"{k}.9,{k},,1,3\n{k}.95,,{k},,\n" for k in range(20)]
    header = "__time,/js/header/stamp,/imu/header/stamp,q1,qd1\n"  # each topic has its own
    path = written(header + "".join(stamped))
    recording = read(path, {"time": "/js/header/stamp"}, parameters=LOOSE)
    assert "rows without joint values, ignored: 20." in notes(recording) and not lost(recording)
    assert np.rint(recording.t).tolist() == list(range(20))


# --- Columns by their names ---


@pytest.fixture
def in_columns(written):
    """Read a table by its header; row r of column k is k / 10 + r / 100, so that each number says
    where it was.
    """

    def opened(header, columns=None, joints=ARM, rows=3):
        lines = [
            ",".join(f"{k / 10 + r / 100:.3f}" for k in range(header.count(",") + 1))
            for r in range(rows)
        ]
        return read(written("\n".join([header, *lines])), columns, joints)

    return opened


def found(recording):
    """Return the columns that a recording of :func:`in_columns` was read from: time, position,
    velocity, effort.
    """
    states = recording.states
    q, qd, tau = (
        [round(10 * (x - 0.02), 6) for x in entry[-1]]
        for entry in (states.position, states.velocity, states.effort)
    )
    estimated = states.velocity_estimated[-1]
    effort = states.effort_known[-1]
    return (
        round(10 * (recording.t[-1] - 0.02)),
        q,
        None if estimated else qd,
        tau if effort else None,
    )


def test_how_columns_were_read_is_noted(in_columns):
    recording = in_columns(
        "t,q_elbow [deg],q_wrist,temperature,tau_wrist", joints=("elbow", "wrist")
    )
    assert notes(recording) == [
        "time: t.",
        "position: q_elbow [deg], q_wrist of elbow, wrist, factor 0.0174533, 1.",
        "effort: none, tau_wrist of elbow, wrist.",
        "not read: temperature.",
    ]
    assert np.isnan(recording.tau).any(axis=1).all()  # in no state one of every joint
    np.testing.assert_allclose(recording.q[-1], [0.12 * pi / 180, 0.22], rtol=1e-12)


DEG, RPM = pi / 180, 2 * pi / 60
UNITS = [
    *((1, f"q{unit}", DEG) for unit in ("1 [deg]", "1[°]")),
    *((2, f"qd1 {unit}", DEG) for unit in ("[deg/s]", "(deg/sec)", "[°/s]", "[deg / s]")),
    (2, "qd1 [1/min]", RPM),
    (3, "tau1 [mNm]", 1e-3),
    *((0, name, 1e-3) for name in ("t_ms", "Time [ms]")),
    *((0, name, 1e-6) for name in ("timestamp_us", "time (µs)")),
]


@pytest.mark.parametrize(("place", "name", "factor"), UNITS)
def test_units_in_names(written, place, name, factor):
    names = ["t", "q1", "qd1", "tau1"]
    names[place] = name
    recording = read(written(",".join(names) + "\n0,0,0,0\n5000,0.25,0.5,7\n"))
    values = [
        np.diff(recording.stamp)[0] * 1e-9,
        recording.q[1, 0],
        recording.qd[1, 0],
        recording.tau[1, 0],
    ]
    assert values[place] == pytest.approx((5000, 0.25, 0.5, 7.0)[place] * factor, rel=1e-15)


def test_a_line_of_units_below_the_header(written):
    recording = read(written("t,q1,qd1,tau1\n[ms],[deg],deg/s,-\n5,180,90,7\n"))
    assert (recording.t, recording.q, recording.qd, recording.tau) == (
        pytest.approx(5e-3),
        pi,
        pi / 2,
        7,
    )


# --- Columns by a map ---

MAPS = [
    {"position": ["a_s", "a_e"], "velocity": ["b_s", "b_e"], "effort": ["c_s", 6]},
    {"position": [2, 1], "velocity": [4, 3], "effort": [6, 5], "joints": ["e", "s"]},
]
PLAIN = "t,a_s,a_e,b_s,b_e,c_s,c_e"


@pytest.mark.parametrize("columns", MAPS)
def test_maps(in_columns, columns):
    assert found(in_columns(PLAIN, {"time": "t"} | columns, "se")) == (0, [1, 2], [3, 4], [5, 6])


def test_maps_in_files(in_columns, written):
    path = written(
        """
        time: stamp
        position: [p b, p a]
        effort: [5, 3]
        joints: [b, a]
        scale: {position: [deg, 2], effort: [0.5, -1]}
        """,
        "map.yaml",
    )
    recording = in_columns("stamp,p a,p b,i a,x,i b", path, "ba")
    np.testing.assert_allclose(recording.q[-1], [0.22 * DEG, 2 * 0.12])
    np.testing.assert_allclose(recording.tau[-1], [0.5 * 0.52, -0.32])
    with pytest.raises(dd.InputError, match=r"map\.yaml' has 'positoin'; expected time, "):
        in_columns("t,q1", written("time: t\npositoin: q", "map.yaml"), "a")


def test_what_a_map_does_not_name_follows_from_names(in_columns):
    header = "t,time,q1,q2,qd1,qd2,tau1,tau2,current1,current2"
    recording = in_columns(header, {"time": "t", "scale": {"effort": 0.1}}, "ab")
    assert found(recording)[1:3] == ([2, 3], [4, 5])
    np.testing.assert_allclose(recording.tau[-1], [0.062, 0.072])
    columns = {"time": "t", "effort": ["current1", "current2"]}
    assert found(in_columns(header, columns, "ab")) == (0, [2, 3], [4, 5], [8, 9])
    assert in_columns(header, {"time": "t", "effort": None}, "ab").tau is None
    columns = {"joints": ["b", "a"]}  # in the order of numbers
    assert found(in_columns("t,q1,q2", columns, "ab"))[1] == [2, 1]
    # With positions in it, it is complete but for the time.
    assert found(in_columns("t,q1,qd1", {"position": ["q1"]}, "a"))[1:] == ([1], None, None)


def test_a_scale_replaces_what_names_say(in_columns):
    recording = in_columns("t [ms],q1 [ticks]", {"scale": {"position": "rev", "time": 1}}, "a")
    assert recording.t[-1] == pytest.approx(0.02) and recording.q[-1, 0] == pytest.approx(
        0.12 * 2 * pi
    )


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        (b"\xef\xbb\xbft,q1\n0,1\n1,2\n", None),
        ("t,q1 [°]\n0,1\n1,2\n".encode("latin-1"), None),
        ("sep=;\nt;q1\n0;1\n1;2\n", None),
        ("% t q1\n# more\n% t q1\n0 1.5\n1 2.5", None),
        ("robot: 5\nby hand, 2024\n\nt,q1\n0,1\n1,2\n", {"skip": 2}),
        ("t;q1\n0,0;1,5\n1,0;2,5\n", {"decimal": ","}),
        ("t,x\n0,1\n1,2\n", {"time": 0, "position": [1]}),
        ("t  q1\n0  1\n1  2\n", None),
    ],
    ids=str,
)
def test_headers_and_separators(written, text, columns):
    recording = read(written(text), columns)
    assert (recording.t.tolist(), lost(recording)) == ([1.0], [])


def test_decimal_commas_need_a_map(written):
    recording = read(written("t;q1;qd1\n0;1,5;1,0\n"))
    (loss,) = lost(recording)
    example = "column 'q1': '1,5' (decimal commas need `decimal: ','` in a column map)"
    assert loss == f"line 2: text where a number belongs ({example}): 2 fields are NaN"


# --- Errors ---

WRONG_MAPS = [
    ({"tiem": "t"}, "columns has 'tiem'; expected time, rate"),
    (
        {"position": [1, 2], "time": "tt"},
        "time: 'tt' is the name of 0 columns; .* one of t, a_s",
    ),
    (
        {"position": [1, 17]},
        "position: 17 is the name of 0 columns; expected the name or number of one of t, a_s",
    ),
    ({"position": [1, 2, 3]}, "position has 3 columns; expected one for each of 2 joints: s, e"),
    *(
        ({"position": value}, "position is .*; expected a column")
        for value in ([1, 1], [1, -2], [1, True], [])
    ),
    ({"joints": ["s", "s"]}, r"joints is \['s', 's'\]; expected .* each once"),
    *(
        ({"scale": {"effort": value}}, "scale is {.*}; expected .* finite numbers other than 0")
        for value in (0, True, [])
    ),
    ({"scale": {"position": "grad"}}, "scale is {'position': 'grad'}"),
    *(
        ({"offset": {"position": value}}, "offset is {.*}; expected .* finite numbers")
        for value in ("deg", [])
    ),
    ({"position": [1, 2], "scale": {"effort": 1}}, "scale has effort; expected columns of it"),
    ({"header": "no"}, "header is 'no'; expected true or false"),
    ({"skip": -1}, "skip is -1; expected a whole number"),
    ([1], r"columns is \[1\]; expected the path of a YAML file or a dict"),
]
ONES, THREE = pa.array([1.0]), np.arange(3.0)
CONTENTS = [
    ("", None, "is empty: it has 0 bytes"),
    (b"\xff\xfet\0,\0", None, r"its first line is not UTF-8 text"),
    ("5,1\n1,2\n", None, "no columns are recognized as positions of a, b; columns: 0, 1"),
    (
        "0,1\n",
        {"time": 0, "position": [1]},
        "line 1 has the numbers of the columns. Set `header: true` or `header: false`",
    ),
    (
        pa.table({"t": ["noon"], "q1": ONES, "q2": ONES}),
        None,
        "time: 't' is of type string such as 'noon'; expected",
    ),
    (
        pa.table({"t": pa.array([1], pa.date32()), "q1": ONES, "q2": ONES}),
        None,
        "time: 't' is of type date32",
    ),
    (
        pa.table({"t": [0.0], "q": [[1.0]], "q2": ONES}),
        {"position": ["q", "q2"]},
        "position has an array in a list; expected one for each of 2 joints: a, b",
    ),
    (
        {"t": THREE, "q": np.ones((4, 2))},
        None,
        "'q' has 4 rows; expected 3, as 't' has",
    ),
    ({"t": np.ones((3, 2)), "q": np.ones((3, 2))}, None, "time: 't' has 2 columns"),
    ({"t": THREE, "q": np.ones((3, 2, 1))}, None, r"columns: t, q \(3 × 2 × 1 float64\)"),
    ({"t": THREE, "q": np.ones((3, 999))}, None, r"columns: t, q \(999 columns\)"),
    (
        pa.table({"t": ONES, "q": [[1.0, 2.0]], "n": [["b", "a"]]}),
        {"names": "n", "position": "q"},
        "names: 'n' is of type list.*; expected a column of texts for each joint",
    ),
]


@pytest.mark.parametrize(("columns", "message"), WRONG_MAPS)
def test_wrong_maps_are_named(in_columns, columns, message):
    with pytest.raises(dd.InputError, match=message):
        in_columns(PLAIN, columns, joints="se")


@pytest.mark.parametrize(("content", "columns", "message"), CONTENTS, ids=lambda one: str(one)[:40])
def test_contents_without_a_table(written, content, columns, message):
    with pytest.raises(dd.InputError, match=message):
        read(written(content), columns, joints="ab")


# --- Times ---

BEGIN = 1_700_000_000_123_456_789
"""[ns], which no double holds."""
TWO = [BEGIN, BEGIN + 1]
EXACT = {
    "ns": (f"timestamp_ns,q1,qd1\n{BEGIN},1,0\n{BEGIN + 1},1,0\n", None),
    "decimals": ("time,q1,qd1\n1700000000.123456789,1,0\n1700000000.123456790,1,0\n", None),
    "pairs": (
        "a,b,c,d\n1700000000,123456789,1,0\n1700000000,123456790,1,0\n",
        {"time": ["a", "b"], "position": ["c"], "velocity": ["d"]},
    ),
    "Parquet ns": (pa.array(TWO), {"scale": {"time": "ns"}}),
    "Parquet timestamps": (pa.array(TWO, pa.timestamp("ns", "Europe/Berlin")), None),
    "Parquet durations": (pa.array(TWO, pa.duration("ns")), None),
    "Parquet decimals": (pa.array([Decimal(entry).scaleb(-9) for entry in TWO]), None),
    "npz dates": (np.array(TWO, "M8[ns]"), None),
}


@pytest.mark.parametrize("kind", EXACT)
def test_times_to_the_nanosecond(written, kind):
    content, columns = EXACT[kind]
    if isinstance(content, pa.Array | pa.ChunkedArray):
        content = pa.table({"t": content, "q1": [1.0, 1.0], "qd1": [0.0, 0.0]})
    elif isinstance(content, np.ndarray):
        content = {"t": content, "q1": np.ones(2), "qd1": np.zeros(2)}
    recording = read(written(content), columns)
    assert recording.offset == 0 and recording.stamp.tolist() == TWO


ISO = [
    "2023-11-14T22:13:20.123456789Z",
    "2023-11-14T22:13:20,123456789",
    "2023-11-14 22:13:20.123456789+00:00",
    "2023-11-15T03:43:20.123456789+05:30",
    "2023-11-14 15:13:20.123456789-07:00",
]
"""One moment, BEGIN, in ISO 8601."""


@pytest.mark.parametrize("text", ISO)
def test_iso_times(written, text):
    """In every form, in CSV with and without a header, in Parquet and in npz."""
    after = text.replace("6789", "6790")
    numbers = {"q1": [1.0, 1.0], "qd1": [0.0, 0.0]}
    contents = [
        (f'time,q1,qd1\n"{text}",1,0\n"{after}",1,0\n', None),
        (f"time;q1;qd1\n{text};1,0;0,0\n{after};1,0;0,0\n", {"decimal": ","}),
        (
            f'"{text}",1,0\n"{after}",1,0\n',
            {"header": None, "time": 0, "position": [1], "velocity": [2]},
        ),
        (
            {"time": np.array([text, after])}
            | {name: np.array(values) for name, values in numbers.items()},
            None,
        ),
    ]
    for kind in (pa.string_view(), pa.dictionary(pa.int32(), pa.string())):
        contents += [(pa.table({"time": pa.array([text, after]).cast(kind)} | numbers), None)]
    for content, columns in contents:
        recording = read(written(content), columns)
        assert (recording.stamp.tolist(), lost(recording)) == (TWO, [])


@pytest.mark.parametrize("time", ["05/13/2024 2:03:07 PM", "13.05.2024 14:03:07", "14:03:07.5"])
def test_times_of_another_form(written, time):
    """The error has examples that are read, and a column map that reads the rows as they are."""
    text = f"t,q1,qd1\n{time},1,0\n{time},1,0\n"
    with pytest.raises(dd.InputError, match=f"such as '{time}'; expected .* ISO 8601") as caught:
        read(written(text))
    for example in re.findall(r"'(20.*?)'", str(caught.value)):
        assert len(read(written(f"t,q1,qd1\n{example},1,0\n"))) == 1
    assert "`time: null` and `rate: HZ`" in str(caught.value)
    assert len(read(written(text), {"time": None, "rate": 100.0})) == 2


def test_texts_that_are_no_times(written):
    text = (
        "t,q1,qd1\n2026-02-30T00:00:00Z,1,0\n2026-01-01T00:00:00Z,1,0\n2026-01-01 25:00,1,"
        "0\n1_0,1,0\n"
    )
    recording = read(written(text))
    assert lost(recording) == ["line 2: " + NO_TIME.format(" ('2026-02-30T00:00:00Z')", 3)]
    assert len(recording) == 1


@pytest.mark.parametrize(("unit", "scale"), [("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)])
@pytest.mark.parametrize("start", [1_700_000_000, 4000, 0], ids=["1970", "boot", "0"])
def test_times_in_another_unit(written, start, unit, scale):
    """The only sentence on times names the unit, also where a header states another one.

    Times that can be seconds need velocities.
    """
    t = start + np.arange(1000) / 100
    times = np.rint(t / scale).astype(np.int64)
    rows = "".join(
        f"{n},{math.sin(x)},{math.cos(x)},{math.cos(2 * x)}\n"
        for n, x in zip(times, t, strict=True)
    )
    for header in ("time", "time_s"):
        path = written(f"{header},q1,qd1,tau1\n{rows}")
        try:
            texts = Analysis(Reading(path, robot("a"))).run()["warnings"]
            with pytest.raises(dd.InputError, match=f"time: {unit}"):
                dd.identify(read(path), robot("a"), "friction")
        except dd.InputError as error:
            texts = [str(error)]
        assert [re.findall(r"scale: \{time: (\w+)", text) for text in texts if "times" in text] == [
            [unit]
        ]
        assert read(path, {"scale": {"time": unit}}).t == pytest.approx(t)


def test_times_that_no_stamp_can_be_of(written):
    """Single rows of them are omitted, and are no reason to doubt the rest."""
    times = [k / 100 for k in range(20)]
    times[5:7] = 1e15, "1e297"
    recording = read(written("time,q1,qd1\n" + "".join(f"{t},1,0\n" for t in times)))
    assert len(recording) == 18
    assert lost(recording) == [
        "line 7: time outside of -1 … 2147483646 s (1e+15 s): 2 rows omitted"
    ]


def test_times_that_decrease(written):
    """Of most rows they are an error, of a second recording a finding."""
    t = np.arange(101) / 100
    rows = [f"{x:.2f},1,0\n" for x in t]
    with pytest.raises(dd.InputError, match=r"decrease at 100 of 101 rows.* Sort the rows by time"):
        read(written("".join(["t,q1,qd1\n", *rows[::-1]])))
    recording = read(written("".join(["t,q1,qd1\n", *rows, *rows])))
    assert "1.000000 s older than the one before" in str(recording.findings[0])


# --- Parquet and npz ---


@pytest.mark.parametrize("kind", [pa.list_(pa.float64()), pa.large_list(pa.int16())])
def test_lists(written, kind):
    lists = pa.array([[1, 2], None, [3, 4]], kind)
    efforts = pa.array([[], [5, 6], [7, 8]], pa.list_(pa.float64()))
    path = written(pa.table({"t": [0.0, 1.0, 2.0], "q": lists, "qd": lists, "tau": efforts}))
    recording = read(path, joints="ab")
    assert recording.q.tolist() == [[1, 2], [3, 4]] and recording.states.effort_known.tolist() == [
        False,
        True,
    ]
    with pytest.raises(dd.InputError, match=r"position has 2 columns; expected .* 3 joints"):
        read(path, {"position": "q"}, joints=ARM)


# --- Universal Robots ---

UR = tuple(
    f"{name}_joint"
    for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
)
RTDE = (
    "target_q",
    "target_qd",
    "target_qdd",
    "target_current",
    "target_moment",
    "actual_q",
    "actual_qd",
    "actual_current",
    "joint_control_output",
    "actual_TCP_pose",
    "actual_TCP_speed",
    "actual_TCP_force",
    "target_TCP_speed",
    "joint_temperatures",
    "actual_joint_voltage",
    "joint_mode",
)


@pytest.mark.parametrize("delimiter", [" ", ","])
def test_logs_of_universal_robots(written, delimiter):
    """Currents are read by the map of docs/recordings.md; without it there are no efforts."""
    blocks = blocks_of(Path(__file__).parents[2] / "docs/recordings.md")
    (columns,) = [
        yaml.safe_load(block.code) for block in blocks if block.how == "columns of a table"
    ]
    header = ["timestamp", *(f"{name}_{k}" for name in RTDE for k in range(6)), "robot_mode"]
    values = np.random.default_rng(2).normal(size=(30, len(header)))
    values[:, 0] = 1000 + np.arange(30) / 500
    lines = [delimiter.join(header), *(delimiter.join(map(repr, row)) for row in values.tolist())]
    path = written("\n".join(lines) + "\n")
    at = {name: header.index(f"{name}_0") for name in RTDE}
    recording = read(path, {key: entry for key, entry in columns.items() if key != "scale"}, UR)
    for numbers, name in (
        (recording.q, "actual_q"),
        (recording.qd, "actual_qd"),
        (recording.tau, "actual_current"),
    ):
        np.testing.assert_array_equal(numbers, values[:, at[name] : at[name] + 6])
    np.testing.assert_allclose(
        read(path, columns, UR).tau, recording.tau * columns["scale"]["effort"]
    )
    without = read(path, None, UR)
    assert without.tau is None
    np.testing.assert_array_equal(without.q, recording.q)


# --- A rate in place of times, and files side by side ---


def side_by_side(count, seed=5):
    """Return random positions, velocities and efforts (count, 3) by the name of a file."""
    numbers = np.random.default_rng(seed).normal(size=(3, count, 3))
    return dict(zip(("q", "qd", "tau"), numbers, strict=True))


def save(folder, name, times, values, names=ARM):
    """Write a text with a time in the first column, or without; return the path."""
    header = [*(["t"] if times is not None else []), *names]
    rows = values if times is None else np.column_stack([times, values])
    lines = [",".join(map(repr, row.tolist())) for row in rows]
    path = folder / name
    path.write_text("\n".join([*([",".join(header)] if names else []), *lines]) + "\n")
    return path


def assert_same(recording, values):
    for numbers, name in ((recording.q, "q"), (recording.qd, "qd"), (recording.tau, "tau")):
        np.testing.assert_array_equal(numbers, values[name])


def test_a_rate_in_place_of_times(written):
    """Row k is at k / rate; a line that is lost keeps its time. Times in the file are not read."""
    text = "t,q1\n9,0\n9,1\n9\n9,3\n"
    recording = read(written(text), {"rate": 400})
    assert recording.t.tolist() == pytest.approx([0.0025, 0.0075]) and lost(
        recording
    )  # the first has no velocity
    assert recording.q[:, 0].tolist() == [1, 3]
    content = {"q": np.arange(50_000.0)[:, None], "tau": np.ones((50_000, 1))}  # several pieces
    recording = read(written(content), {"rate": 1000 / 3})
    np.testing.assert_array_equal(
        recording.stamp - recording.offset, np.arange(1, 50_000) * 3_000_000
    )
    recording = read(written("0,5\n1,6\n"), {"rate": 2, "position": [1]})
    assert recording.q[:, 0].tolist() == [6]
    for rate in (0, -1, "fast", float("inf"), True):
        with pytest.raises(dd.InputError, match=r"rate is .*; expected a finite number > 0"):
            read(written(text), {"rate": rate})
    for both in ({"time": "t"}, {"scale": {"time": "ms"}}):
        with pytest.raises(dd.InputError, match="both rate and time; expected one"):
            read(written(text), {"rate": 5} | both)
    with pytest.raises(
        dd.InputError,
        match="'tau' has 9 rows; expected 50000, as 'q' has",
    ):
        read(written(content | {"tau": np.ones(9)}), {"rate": 5, "position": "q", "effort": "tau"})


def test_files_side_by_side(tmp_path):
    """Headers may have joints, numbers or nothing."""
    values = side_by_side(30_000)
    t = np.arange(30_000) / 500
    for names, more in ((ARM, {}), (("j1", "j2", "j3"), {}), ((), {"header": False})):
        paths = [
            save(tmp_path, f"log_{name}.csv", None, entry, names) for name, entry in values.items()
        ]
        recording = read(paths, {"rate": 500} | more, ARM)
        assert_same(recording, values)
        assert (recording.t - recording.t[0]).tolist() == pytest.approx(t.tolist())
        assert not lost(recording)
    paths = [
        save(tmp_path, f"{name}.csv", t if name == "q" else None, entry)
        for name, entry in values.items()
    ]
    assert_same(read(paths, None, ARM), values)  # only one has times
    recording = read("+".join(map(str, paths)), None, ARM)
    assert_same(recording, values)
    assert recording.path == "+".join(map(str, paths))
    parquet.write_table(
        pa.table({"t": t, **dict(zip(ARM, values["qd"].T, strict=True))}), tmp_path / "qd.parquet"
    )
    mixed = [paths[0], tmp_path / "qd.parquet", paths[2]]
    assert_same(read(mixed, None, ARM), values)


def test_files_that_are_not_side_by_side(tmp_path):
    values = side_by_side(50)
    t = np.arange(50) / 500
    paths = [save(tmp_path, f"{name}.csv", t, values["q"]) for name in ("q", "cmd_qd")]
    assert read(paths, None, ARM).states.velocity_estimated.all()
    q = save(tmp_path, "q.csv", t, values["q"])
    tau = save(tmp_path, "tau.csv", None, values["tau"][:49])
    for other, what in (
        (tau, r"rows of '.*tau\.csv' and '.*q\.csv' differ; expected the same number and times"),
        (save(tmp_path, "qd.csv", t + 0.001, values["qd"]), r"rows of '.*qd\.csv' and .* differ"),
        (tmp_path / "none.csv", r"no file or folder '.*none\.csv'"),
        (save(tmp_path, "qd2.csv", t[:0], values["qd"][:0]), r"qd2\.csv' has no rows"),
        (save(tmp_path, "q2.csv", t, values["q"]), "the position may be 'position.shoulder'"),
    ):
        with pytest.raises(dd.InputError, match=what):
            read([q, other], None, ARM)


def test_efforts_that_begin_late(tmp_path):
    """A column of lists without values in the first rows is read as the others are."""
    count = 400
    late = 150
    efforts = [None] * late + [[0.5]] * (count - late)
    columns = {"t": 0.01 * np.arange(count), "position": [[0.1]] * count, "effort": efforts}
    parquet.write_table(pa.table(columns), tmp_path / "late.parquet", row_group_size=100)
    tau = read(tmp_path / "late.parquet").tau[:, 0]
    assert np.isnan(tau[: late - 1]).all()  # the first state has no velocity
    assert (tau[-(count - late) :] == 0.5).all()
