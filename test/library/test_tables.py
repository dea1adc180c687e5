# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables that kernels are told of by one number: Python and kernels agree on names and types, or somebody says so."""

import numpy as np
import pytest
from numba.core.errors import TypingError

from diag_dynamics.compiled.kernel import COUNT, entry_kernel
from diag_dynamics.compiled.lanes import WIDTH, lane_of
from diag_dynamics.compiled.tables import Addresses, Table, array, lanes

RECORD = np.dtype([("weight", "f8"), ("count", "i8")])

TABLE = Table(
    "TableOfTest",
    number=int,
    factor=float,
    matrix=array(float, 2),
    cube=array(float, 3, last=2),
    flags=array(bool),
    bytes=array(np.uint8),
    records=array(RECORD),
    wide=lanes(float),
)
LONGER = TABLE.extended("LongerTableOfTest", more=array(int))

_table_at, _longer_at = TABLE.opened, LONGER.opened


@entry_kernel(COUNT)
def _sums(table):
    at = _table_at(table)
    total, cube, records, wide = 0.0, 0.0, 0.0, 0.0
    for i in range(at.matrix.shape[0]):
        for k in range(at.matrix.shape[1]):
            total += (i + 1) * at.matrix[i, k]
    for i in range(at.cube.shape[0]):
        for j in range(at.cube.shape[1]):
            for k in range(at.cube.shape[2]):
                cube += (10 * i + j + k + 1) * at.cube[i, j, k]
    for k in range(len(at.records)):
        records += at.records[k].weight * at.records[k].count
        at.records[k].count += 1
    for k in range(len(at.wide)):
        wide += lane_of(at.wide[k], WIDTH - 1)
    flags = 0
    for k in range(len(at.flags)):
        if at.flags[k]:
            flags += at.bytes[k]
    return (total, cube, records), (wide, flags), (at.number, at.factor)


@entry_kernel(COUNT)
def _more(table):
    return _longer_at(table).more[1]


@entry_kernel(COUNT)
def _misspelt(table):
    return _table_at(table).numbr


@entry_kernel(COUNT)
def _misspelt_in_record(table):
    return _table_at(table).records[0].wieght


def entries(**others):
    """All of the table's entries."""
    return {
        "number": -3,
        "factor": 0.5,
        "matrix": np.arange(6.0).reshape(2, 3),
        "cube": np.arange(12.0).reshape(2, 3, 2),
        "flags": np.array([True, False, True]),
        "bytes": np.array([200, 1, 100], np.uint8),
        "records": np.array([(0.5, 2), (2.0, 3)], RECORD),
        "wide": np.arange(2.0 * WIDTH).reshape(2, WIDTH),
    } | others


def sums(given):
    """What the kernel shall find."""
    i, j, k = np.indices((2, 3, 2))
    records = given["records"]
    return (
        (
            float((given["matrix"] * [[1.0], [2.0]]).sum()),
            float(((10 * i + j + k + 1) * given["cube"]).sum()),
            float((records["weight"] * records["count"]).sum()),
        ),
        (float(given["wide"][:, -1].sum()), int(given["bytes"].astype(int)[given["flags"]].sum())),
        (given["number"], given["factor"]),
    )


def test_kernels_find_what_python_has_written():
    given = entries()
    table, expected = Addresses(TABLE, **given), sums(given)
    assert _sums(table.at) == expected
    assert given["records"]["count"].tolist() == [3, 4]  # kernels write in these very arrays


def test_fields_are_written_anew_by_name():
    given = entries()
    table = Addresses(TABLE, **given)
    for name, entry in {"number": 8, "matrix": np.ones((2, 3)), "factor": 2.5}.items():
        given[name] = table[name] = entry
        expected = sums(given)
        assert _sums(table.at) == expected


def test_a_longer_table_is_read_as_the_shorter_one():
    given = entries()
    table, expected = Addresses(LONGER, **given, more=np.array([4, 5])), sums(given)
    assert _sums(table.at) == expected and _more(table.at) == 5


def test_arrays_live_as_long_as_the_table():
    given = entries()
    table, expected = Addresses(TABLE, **given), sums(given)
    given.clear()
    assert _sums(table.at) == expected


def test_a_misspelt_field_is_not_compiled():
    """Of a record in an array, numba lets the error of its own table of fields through."""
    table = Addresses(TABLE, **entries())
    with pytest.raises(TypingError, match="Unknown attribute 'numbr'"):
        _misspelt(table.at)
    with pytest.raises((TypingError, KeyError), match="wieght"):
        _misspelt_in_record(table.at)


def test_names_that_are_not_there_are_refused():
    given = entries()
    with pytest.raises(TypeError, match="nothing is given for number, wide"):
        Addresses(TABLE, **{name: entry for name, entry in given.items() if name not in ("number", "wide")})
    with pytest.raises(TypeError, match="no field numbr"):
        Addresses(TABLE, **given, numbr=1)
    table = Addresses(TABLE, **given)
    with pytest.raises(TypeError, match="no field numbr"):
        table["numbr"] = 1
    with pytest.raises(TypeError, match="multiple values for keyword argument 'number'"):
        Addresses(TABLE, number=1, **given)
    with pytest.raises(TypeError, match="multiple values for keyword argument 'number'"):
        TABLE.extended("DoubledTableOfTest", number=int)


WRONG = {
    "matrix": (
        np.zeros((2, 3), np.float32),
        np.zeros((2, 3), int),
        np.zeros((2, 3), ">f8"),
        np.zeros((2, 6))[:, ::2],
        np.zeros((3, 2)).T,
        np.zeros(6),
        np.zeros((1, 2, 3)),
        [[0.0]],
        1,
    ),
    "cube": (np.zeros((2, 3, 3)),),
    "flags": (np.zeros(3, np.uint8),),
    "bytes": (np.zeros(3, bool), np.zeros(3, np.int8)),
    "records": (np.zeros(2, [("weight", "f8"), ("number", "i8")]), np.zeros(2, [("weight", "f8"), ("count", "i4")])),
    "wide": (np.zeros((2, WIDTH + 1)), np.zeros(2)),
    "number": (np.zeros(1, int),),
}


@pytest.mark.parametrize(("name", "entry"), [(name, entry) for name, some in WRONG.items() for entry in some])
def test_what_a_kernel_would_misread_is_refused(name, entry):
    with pytest.raises(TypeError, match=name):
        Addresses(TABLE, **entries(**{name: entry}))
    table = Addresses(TABLE, **entries())
    with pytest.raises(TypeError, match=name):
        table[name] = entry
    _sums(table.at)  # it is as it was
