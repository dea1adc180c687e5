# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Text with a row on each line: whatever pandas writes is read back, and whatever is wrong with a file is counted.

Everything is read twice, with pyarrow and without it: the same rows, and the same losses.
"""

import bz2
import csv
import gzip
import lzma
import os
import random
import re
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diag_dynamics.exceptions import InputError
from diag_dynamics.tables import csv_plain, csv_reader
from diag_dynamics.tables.csv_arrow import ByArrow
from diag_dynamics.tables.opening import open_table
from examples import examples

pyarrow = pytest.importorskip("pyarrow", reason="pyarrow is the way through text that the other is compared with")

ROOT = Path(__file__).parents[2]
RECORDINGS = ROOT.parent / "shared" / "recordings"


def joined(reader):
    """All rows of a reader in one piece, as arrays."""
    parts = list(reader.pieces())
    return [None if field[0] is None else np.concatenate(field) for field in zip(*parts, strict=True)]


def read(path, columns=None, joints=()):
    """Rows and losses, which are the same with pyarrow and without."""
    first = open_table(path, columns, joints)
    rows, losses = joined(first), first.unread
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ByArrow, "there", classmethod(lambda *_: None))
        second = open_table(path, columns, joints)
        plain = joined(second)
    assert second.unread == losses
    assert len(plain) == len(rows)
    for one, other in zip(rows, plain, strict=True):
        assert (one is None) == (other is None)
        if one is not None:
            np.testing.assert_array_equal(one, other)
            assert one.dtype == other.dtype
    return rows, losses


@pytest.fixture
def written(tmp_path):
    """Writes bytes or text and returns its path."""

    def write(content, name="table.csv"):
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


def said(losses):
    """Where and what, without the file."""
    return [(one.where, one.what) for one in losses]


# --- What is right ---

numbers = st.floats(allow_nan=True, allow_infinity=True) | st.floats(-10, 10) | st.integers(-5, 5).map(float)
tables = st.lists(st.tuples(st.floats(-1e6, 1e6), *[numbers] * 6), min_size=1, max_size=20)
NAMES = ["t", "q_a", "q_b", "qd_a", "qd_b", "tau_a", "tau_b"]


@examples(150)
@given(
    tables,
    st.sampled_from(",;\t|"),
    st.sampled_from(["\n", "\r\n"]),
    st.sampled_from(["", "nan", "NA", "null"]),
    st.booleans(),
)
def test_what_pandas_writes_is_read_back(tmp_path_factory, table, separator, ending, missing, quoted):
    """To the last bit, whatever the separator, the line ends, the text for what is missing, and quotes."""
    path = tmp_path_factory.mktemp("pandas") / "table.csv"
    frame = pd.DataFrame(table, columns=NAMES)
    quoting = csv.QUOTE_ALL if quoted else csv.QUOTE_MINIMAL
    frame.to_csv(path, sep=separator, lineterminator=ending, na_rep=missing, index=False, quoting=quoting)
    (time, stamp, position, velocity, effort, rows), losses = read(path)
    assert losses == []
    np.testing.assert_array_equal(np.column_stack([time, position, velocity, effort]), np.array(table))
    np.testing.assert_array_equal(rows, np.arange(len(table)))
    exact = [round(Fraction(t) * 10**9) for t in time]
    assert max(abs(int(one) - other) for one, other in zip(stamp, exact, strict=True)) <= 1


@examples(50)
@given(tables)
def test_what_pandas_writes_without_a_header(tmp_path_factory, table):
    path = tmp_path_factory.mktemp("pandas") / "table.csv"
    pd.DataFrame(table).to_csv(path, header=False, index=True)
    columns = {
        "header": False,
        "time": 1,
        "position": [2, 3],
        "velocity": [4, 5],
        "effort": [6, 7],
        "joints": ["a", "b"],
    }
    (time, _, position, velocity, effort, _), losses = read(path, columns)
    assert losses == []
    np.testing.assert_array_equal(np.column_stack([time, position, velocity, effort]), np.array(table))


@examples(30)
@given(tables)
def test_what_numpy_writes(tmp_path_factory, table):
    """Spaces between columns, and the header in a comment."""
    path = tmp_path_factory.mktemp("numpy") / "table.txt"
    np.savetxt(path, np.array(table), header=" ".join(NAMES), fmt="%25.18e")
    (time, _, position, velocity, effort, _), losses = read(path)
    assert losses == []
    np.testing.assert_array_equal(np.column_stack([time, position, velocity, effort]), np.array(table))


def test_what_pyarrow_writes(tmp_path):
    generator = np.random.default_rng(3)
    table = pyarrow.table({name: generator.normal(size=1000) for name in NAMES})
    pyarrow.csv.write_csv(table, tmp_path / "table.csv")
    rows, losses = read(tmp_path / "table.csv")
    assert losses == []
    np.testing.assert_array_equal(rows[3], np.column_stack([table["qd_a"], table["qd_b"]]))


def test_large_files_come_in_pieces(written, monkeypatch):
    """Every row once, in its order, whatever the size of a piece."""
    text = "t,q1\n" + "".join(f"{k / 1000},{k}\n" for k in range(20_000))
    path = written(text)
    monkeypatch.setattr(csv_reader, "ROWS", 700)
    monkeypatch.setattr("diag_dynamics.tables.packed.CHUNK", 1000)
    assert 20 < len(list(open_table(path).pieces())) < 40
    rows, losses = read(path)
    assert losses == [] and rows[2][:, 0].tolist() == list(range(20_000)) == rows[5].tolist()
    reader = open_table(path)  # begins anew each time
    assert len(joined(reader)[0]) == len(joined(reader)[0]) == 20_000


PACKED = {
    "gz": gzip.compress,
    "bz2": lambda data: bz2.compress(data, 1),  # in blocks of 100 kB
    "xz": lambda data: lzma.compress(data, preset=0),
    "zst": lambda data: pyarrow.compress(data, "zstd", asbytes=True),
    "lz4": lambda data: pyarrow.compress(data, "lz4", asbytes=True),
}


def many(count=30_000):
    """A text of so many rows that no packer does it in one go."""
    generator = random.Random(4)
    return ("t,q1\n" + "".join(f"{k / 1000},{generator.random()}\n" for k in range(count))).encode()


@pytest.mark.parametrize("ending", PACKED)
def test_packed(written, ending):
    data = many()
    whole = read(written(data))[0]
    packed = PACKED[ending](data)
    for content in (
        packed,
        PACKED[ending](data[:200_000]) + PACKED[ending](data[200_000:]),
    ):  # also two, one behind the other
        rows, losses = read(written(content, f"table.csv.{ending}"))
        assert losses == []
        np.testing.assert_array_equal(rows[2], whole[2])


@pytest.mark.parametrize("ending", PACKED)
def test_packed_and_broken_off(written, ending):
    """What is there is read, and where it ends is said."""
    data = many()
    whole, packed = read(written(data))[0], PACKED[ending](data)
    rows, losses = read(written(packed[: len(packed) * 2 // 3], f"table.csv.{ending}"))
    count = len(rows[0])
    assert 10_000 < count < 30_000
    np.testing.assert_array_equal(rows[2], whole[2][:count])
    ((where, what),) = said(losses)
    assert (
        where == f"line {count + 1}"
        and "stream cannot be read to its end" in what
        and "all behind this line is lost" in what
    )


def test_packed_and_damaged(written):
    packed = bytearray(gzip.compress(many()))
    packed[len(packed) // 2] ^= 0xFF
    rows, losses = read(written(bytes(packed), "table.csv.gz"))
    assert 5000 < len(rows[0]) < 30_000
    assert re.search(
        "gzip stream cannot be read to its end.*rows before that may be wrong",
        " ".join(what for _, what in said(losses)),
    )
    with pytest.raises(InputError, match=r"table\.csv\.gz' .*the gzip stream cannot be read to its end"):
        open_table(written(gzip.compress(b"t,q1\n")[:12], "table.csv.gz"))


def test_packed_without_pyarrow(written, monkeypatch):
    for module in ("pyarrow", "pyarrow.csv"):
        monkeypatch.setitem(sys.modules, module, None)
    assert joined(open_table(written(gzip.compress(b"t,q1\n0,1\n"))))[2] == [[1]]
    with pytest.raises(InputError, match="is packed by zstd, for which pyarrow is needed: pip install"):
        open_table(written(PACKED["zst"](b"t,q1\n0,1\n")))


# --- What is wrong ---

HOSTILE = {
    "a row too short": (
        "t,q1,q2\n0,1,2\n1,1\n2,3,4\n",
        [0, 2],
        [("line 3", "another number of columns than the header has (2 instead of 3): 1 rows left out")],
    ),
    "a row too long": (
        "t,q1\n0,1\n1,1,9\n2,3\n4,5,6,7\n",
        [0, 2],
        [("line 3", "another number of columns than the header has (3 instead of 2): 2 rows left out")],
    ),
    "empty columns at the end": ("t,q1\n0,1,\n1,1,,\n", [0, 1], []),
    "broken off": ("t,q1,q2\n0,1,2\n1,1,", [0, 1], []),
    "broken off earlier": (
        "t,q1,q2\n0,1,2\n1,",
        [0],
        [("line 3", "another number of columns than the header has (2 instead of 3): 1 rows left out")],
    ),
    "text": (
        "t,q1\n0,1\n1,x\n2,1_0\n",
        [0, 1, 2],
        [("line 3", "text where a number belongs (column 'q1': 'x'): 2 fields are NaN")],
    ),
    "times": (
        "t,q1\n0,1\nx,2\n,3\nnan,4\n2,5\n",
        [0, 4],
        [("line 3", "no time, or one that is no number: 3 rows left out")],
    ),
    "header again": (
        "t,q1\n0,1\nt,q1\n1,2\n",
        [0, 2],
        [
            ("line 3", "text where a number belongs (column 'q1': 'q1'): 1 fields are NaN"),
            ("line 3", "no time, or one that is no number: 1 rows left out"),
        ],
    ),
    "NUL": (
        b"t,q1\n0,1\n\0\0\0\0\n1,2\0\n2,3\n" + b"\0" * 5000,
        [0, 3],
        [("line 3", "NUL bytes, as files have them of a machine that lost its power: 3 rows left out")],
    ),
    "empty lines": ("t,q1\n\n0,1\n\n  \n1,2\n\n", [0, 1], []),
    "comments": ("# by hand\nt,q1\n0,1\n# a pause, here\n#1,2\n1,2\n", [0, 1], []),
    "quotes": (
        't,name,q1\n0,"a, b",1\n1,"x""y",2\n2,"lost,3\n3,c,4\n',
        [0, 1, 3],
        [("line 4", "another number of columns than the header has (2 instead of 3): 1 rows left out")],
    ),
    "numbers in quotes": ('"t","q1"\n"0","1"\n"1"," 2 "\n', [0, 1], []),
    "CR LF": ("t,q1\r\n0,1\r\n1,2\r\n", [0, 1], []),
    "CR CR LF": ("t,q1\r\r\n0,1\r\r\n1,2\r\r\n", [0, 1], []),
    "BOM": (b"\xef\xbb\xbft,q1\n0,1\n1,2\n", [0, 1], []),
    "Latin-1": ("t,q1 [°]\n0,1\n1,2\n".encode("latin-1"), [0, 1], []),
    "spaces": ("t, q1\n 0,   1\n 1 , 2 \n", [0, 1], []),
    "one line": ("t,q1\n0,1", [0], []),
    "doubled name that nobody needs": ("t,x,q1,x\n0,1,2,3\n", [0], []),
    "sep": ("sep=;\nt;q1\n0;1\n1;2\n", [0, 1], []),
    "only a header": ("t,q1\n", [], [("line 2", "there is no row below the header")]),
    "a header without an end": ("t,q1", [], [("line 2", "there is no row below the header")]),
    "only rows that are none": (
        "t,q1\n1\n2\n",
        [],
        [("line 2", "another number of columns than the header has (1 instead of 2): 2 rows left out")],
    ),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile(written, kind):
    content, expected, unread = HOSTILE[kind]
    path = written(content)
    if not expected:
        assert list(open_table(path).pieces()) == []
        reader = open_table(path)
        list(reader.pieces())
        assert said(reader.unread) == unread
        return
    rows, losses = read(path)
    assert rows[5].tolist() == expected
    assert said(losses) == unread
    assert all(one.file == str(path) for one in losses)


def test_a_long_line_is_one_row(written, monkeypatch):
    for where in (csv_plain, csv_reader):
        monkeypatch.setattr(where, "LONGEST", 100_000)
    monkeypatch.setattr(csv_reader, "ROWS", 1000)
    rows, losses = read(written(f"t,q1\n0,1\n{'5' * 10_000_000}\n1,2\n{'6' * 50_000}\n2,3\n"))
    assert rows[5].tolist() == [0, 2, 4] and rows[0].tolist() == [0, 1, 2]
    assert [where for where, _ in said(losses)] == ["line 3", "line 5"]
    with pytest.raises(InputError, match="there is no line break in its first 1048576 bytes"):
        open_table(written("t,q1" * 400_000))


def test_numbers_are_handed_on_as_they_are(written):
    """What is garbage is for the monitor's rules."""
    text = "t,q1\n0,1e297\n1,1e400\n2,-inf\n3,nan\n4,\n5,253\n1e297,0\n86400000,+1.5\n-1,1e-400\ninf,5\n"
    rows, losses = read(written(text))
    assert losses == []
    assert rows[0].tolist() == [0, 1, 2, 3, 4, 5, 1e297, 86_400_000, -1, np.inf]
    expected = [1e297, np.inf, -np.inf, np.nan, np.nan, 253, 0, 1.5, 0, 5]
    np.testing.assert_array_equal(rows[2][:, 0], expected)
    assert np.abs(rows[1]).max() == 2**62


def test_missing_texts(written):
    words = ("", "nan", "NaN", "NA", "N/A", "null", "NULL", "None", "-", "--", "#N/A")
    rows, losses = read(written("t,q1\n" + "".join(f"{k},{word}\n" for k, word in enumerate(words))))
    assert losses == [] and np.isnan(rows[2]).all() and len(rows[0]) == len(words)


def test_nanoseconds_since_1970(written):
    text = "timestamp_ns,q1\n1700000000123456789,1\n1700000000124456790,2\n"
    rows, _ = read(written(text))
    assert rows[1].tolist() == [1700000000123456789, 1700000000124456790]
    text = "time,q1\n1700000000.123456789,1\n1700000000.124456790,2\n"
    assert read(written(text))[0][1].tolist() == rows[1].tolist()
    text = "time,q1\n2023-11-14 22:13:20.123456789,1\n2023-11-14T22:13:20.124456790Z,2\n"
    assert read(written(text))[0][1].tolist() == rows[1].tolist()


def test_decimal_commas(written):
    path = written("t;q1;qd1\n0,5;1,25;3\n1;-2e-1,5;1.234,5\n2,25;1.000;,5\n")
    with pytest.raises(InputError, match=r"numbers such as '0,5' have a decimal comma: say `decimal: ','`"):
        open_table(path)
    rows, losses = read(path, {"decimal": ","})
    assert rows[0].tolist() == [0.5, 1, 2.25] and rows[3][:, 0].tolist()[::2] == [3, 0.5]
    assert np.isnan(rows[2][1:, 0]).all() and np.isnan(rows[3][1, 0])  # points between thousands are no numbers
    assert said(losses) == [("line 3", "text where a number belongs (column 'q1': '-2e-1,5'): 3 fields are NaN")]


@pytest.mark.parametrize(
    ("text", "columns", "message"),
    [
        ("", None, "is empty: it has 0 bytes"),
        ("\n\n \n", None, "has 4 lines and nothing in them"),
        (b"\xff\xfet\0,\0", None, "is text in UTF-16: save it in UTF-8"),
        (b"\x01\x02\0\0rubbish", None, "is neither a table of text nor Parquet or npz"),
        ("t,q1\r0,1\r", None, "lines end with CR alone"),
        ("5,1,2\n1,2,3\n", None, "has no header, line 1 is of numbers: .*from 0 to 2"),
        ("1.5,1,base\n", None, "line 1 has text and numbers.*`header: true` or `header: false`"),
        ("0,1,2\n1,2,3\n", {"time": 0, "position": [1, 2]}, "counts from 0 to 2, which may be a header or a row"),
        ("t,q1\n", {"skip": 5}, "5 lines are to be skipped, but there are 2"),
        ("t,q1,q1\n0,1,2\n", {"position": "q1"}, "'q1' is the name of columns 1, 2: give the number"),
        (b"\x93NUMPY\x01\0", None, "is a single array without names: write an npz"),
        (b"\x89MCAP0\r\n", None, "is a bag, no table"),
        (b"PK\x03\x04rubbish", None, "is no npz that can be read"),
        (b"PAR1rubbish", None, "is no Parquet file that can be read"),
    ],
)
def test_what_is_no_table_is_an_error(written, text, columns, message):
    with pytest.raises(InputError, match=message):
        open_table(written(text), columns)


def test_paths(tmp_path, monkeypatch, written):
    for path, message in (
        (tmp_path, "is a folder"),
        (tmp_path / "none.csv", "Cannot read '.*none.csv': No such file"),
        (5, "path is 5"),
    ):
        with pytest.raises(InputError, match=message):
            open_table(path)
    monkeypatch.setenv("HOME", str(tmp_path))
    written("t,q1\n0,1\n")
    assert open_table("~/table.csv").joints == ("joint1",)
    with pytest.raises(InputError, match="joints is 'elbow', expected a list"):
        open_table("~/table.csv", joints="elbow")


def test_headers_that_are_said(written):
    """A map by numbers alone makes a first row of numbers a row; `header` and `skip` say the rest."""
    by_number = {"time": 0, "position": [1]}
    assert read(written("0.5,1\n1,2\n"), by_number)[0][0].tolist() == [0.5, 1]
    assert read(written("t,x\n0.5,1\n1,2\n"), by_number)[0][0].tolist() == [0.5, 1]
    assert read(written("0,1\n0.5,1\n"), by_number | {"header": True})[0][0].tolist() == [0.5]
    assert read(written("0,1\n0.5,1\n"), by_number | {"header": False})[0][0].tolist() == [0, 0.5]
    text = "robot: 5\nby hand, 2024\n\nt,q1\n0.5,1\n"
    rows, losses = read(written(text), {"skip": 2})
    assert rows[0].tolist() == [0.5] and losses == []
    rows, losses = read(written("x,y\n0.5,1\n"), by_number | {"header": False})
    assert rows[5].tolist() == [1] and said(losses)[-1] == (
        "line 1",
        "no time, or one that is no number: 1 rows left out",
    )
    rows, _ = read(written("% t q1\n# more\n% t q1\n0.5 1\n"))
    assert rows[0].tolist() == [0.5]


@pytest.mark.parametrize("separator", ["\t", ";", "|", "  ", " \t "])
def test_separators(written, separator):
    lines = (("t", "q1 [deg,°;|]" if separator == "\t" else "q1", "qd1"), ("0.5", "1", "2"), ("1", "3", "4"))
    columns = {"scale": {"position": 1}}
    rows, losses = read(written("\n".join(separator.join(line) for line in lines)), columns)
    assert losses == [] and rows[0].tolist() == [0.5, 1] and rows[3][:, 0].tolist() == [2, 4]
    columns["delimiter"] = {"\t": "tab", "  ": "space", " \t ": " "}.get(separator, separator)
    np.testing.assert_array_equal(
        read(written("\n".join(separator.join(line) for line in lines)), columns)[0][2], rows[2]
    )


pieces_of_text = st.sampled_from(
    [
        b",",
        b"\n",
        b'"',
        b"#",
        b"\0",
        b"x",
        b"-",
        b".",
        b"e",
        b" ",
        b"\r",
        b"_",
        b"1e400",
        b"nan",
        b"inf",
        b"\xff",
        b";",
        b"\n\n",
        b"0x1",
        b"+",
        b'""',
        b"NA",
        b"\xc2\xb0",
        b"1,5",
        b"t,q_a",
    ]
)


@examples(400)
@given(st.lists(st.tuples(st.integers(8, 400), st.integers(0, 4), pieces_of_text), max_size=6))
def test_mutated(tmp_path_factory, changes):
    """Whatever is overwritten, put in or taken away: rows with pyarrow are those without it, and so is what is lost.

    Nothing is lost in silence: each line that is not empty and no comment is a row, or was counted.
    """
    generator = random.Random(1)
    header = b"t,q_a,tau_a,name\n"
    body = b"".join(
        b"%.3f,%.4f,%.2f,n%d\n" % (k / 100, generator.uniform(-3, 3), generator.uniform(-99, 99), k) for k in range(16)
    )
    for at, taken, put in changes:
        body = body[:at] + put + body[at + taken :]
    path = tmp_path_factory.mktemp("mutated") / "table.csv"
    path.write_bytes(header + body)
    try:
        reader = open_table(path)
    except InputError:  # the header, or what may be one, has been hit
        return
    if not list(reader.pieces()):
        return
    rows, losses = read(path)
    lines = [line for line in body.decode("latin-1").split("\n") if line.strip() and not line.startswith("#")]
    left_out = sum(int(one.what.rsplit(": ", 1)[1].split()[0]) for one in losses if one.what.endswith("rows left out"))
    assert len(rows[0]) + left_out == len(lines)
    for row, time, position in zip(rows[5], rows[0], rows[2][:, 0], strict=True):
        if '"' in lines[row]:
            continue
        fields = lines[row].split(",")
        assert float(fields[0]) == time
        assert np.isnan(position) or float(fields[1]) == position


MEMORY = """
import resource, sys
from diag_dynamics.tables.opening import open_table
count, first = 0, 0
for piece in open_table(sys.argv[1]).pieces():
    count += len(piece.rows)
    first = first or resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(count, first, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def test_a_day_does_not_have_to_fit_into_memory(tmp_path):
    """What 90 MB of text, or 2 MB that become 90, take above the first piece is less than a third of them."""
    line = "0.001,0.5,1.5,2.5,0.123456789,0.123456789,0.123456789,-12.5,-13.5,-14.5\n"
    text = ("t,q1,q2,q3,qd1,qd2,qd3,tau1,tau2,tau3\n" + line * 1_250_000).encode()
    for name, content in (("table.csv", text), ("table.csv.gz", gzip.compress(text, 1))):
        path = tmp_path / name
        path.write_bytes(content)
        command = [sys.executable, "-c", MEMORY, str(path)]
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=environment)
        assert done.returncode == 0, done.stderr
        count, first, last = map(int, done.stdout.split())
        assert count == 1_250_000
        assert (last - first) * 1024 < len(text) / 3, f"{first} kB, then {last} kB"


# --- A real one ---


def test_a_panda():
    """A recording of a Franka Panda, by the names of its columns."""
    path = RECORDINGS / "panda" / "exciting_trajectory.csv.gz"
    if not path.exists():
        pytest.skip("../shared/recordings/panda is not there")
    joints = tuple(f"panda_joint{k}" for k in range(1, 8))
    frame = pd.read_csv(path)
    for known in ((), joints, ("panda_finger_joint1", *reversed(joints))):
        reader = open_table(path, joints=known)
        assert sorted(reader.joints) == list(joints)
        rows, losses = read(path, joints=known)
        assert losses == [] and len(rows[0]) == 20_544
        np.testing.assert_array_equal(rows[0], frame["t"])
        for at, name in ((2, "q"), (3, "qd"), (4, "tau")):
            np.testing.assert_array_equal(rows[at], frame[[f"{name}_{joint}" for joint in reader.joints]])
