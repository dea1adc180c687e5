# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compiled kernels: they compute what Python computes, read what Python writes, and are kept on disk while they are valid."""

import errno
import logging
import math
import os
import pickle
import shutil
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from numba.core.caching import IndexDataCacheFile
from numba.core.errors import TypingError

import diag_dynamics as dd
from diag_dynamics import sweeps
from diag_dynamics.compiled import cache, native, plain, progress, store
from diag_dynamics.compiled.ahead import compile_ahead
from diag_dynamics.compiled.arrays import array_at
from diag_dynamics.compiled.kernel import (
    COUNT,
    FILLED_MATRIX,
    FILLED_VECTOR,
    MATRIX,
    NUMBER,
    VECTOR,
    entry_kernel,
    kernel,
)
from diag_dynamics.compiled.lanes import lane_of
from diag_dynamics.compiled.registers import (
    EIGHT,
    FOUR,
    WIDTH,
    chooser,
    from_lane,
    lanes_at,
    loader,
    mover,
    nought,
    set_lanes,
    set_lanes_from,
    spreader,
)
from diag_dynamics.compiled.registers import store as store_matrix
from diag_dynamics.compiled.tables import Addresses, Table, array, lanes
from diag_dynamics.compiled.trigonometry import LARGEST, sine_and_cosine
from diag_dynamics.sweeps.workspace import aligned
from robots import TwoLinkArm

PACKAGE = Path(dd.__file__).parent

# --- Kernels against Python


@kernel
def ranges(a, n, out):
    for k in range(n):
        out[k] += a[k]
    for k in range(2, n):
        out[k] += 10.0 * k
    for k in range(n - 1, -1, -1):
        out[k] += out[(k + 1) % n]
    for k in range(n - 1, 0, -3):
        out[k] -= 100.0
    for k in range(3, 3):
        out[k] = math.nan
    for k in range(5, 2):
        out[k] = math.nan
    for k in range(1, n, n):
        for j in range(k):
            out[j] += 0.5
    return k + j


@kernel
def extremes(a, n, out):
    for k in range(n):
        out[k] = min(a[k], a[k - 1], 0.5) + max(k, n - k, 2) * max(a[k], -0.0)
    out[0], out[1] = max(a[2], math.nan), max(math.nan, a[2])
    out[2], out[3] = math.copysign(1.0, min(0.0, -0.0)), math.copysign(1.0, max(-0.0, 0.0))
    return min(n, 4)


@kernel
def indices(a, n, out):
    found = (a[0], a[-1], a[2])
    total = 0.0
    for k in range(-3, 3):
        total += found[k] * (k + 5)
    for k in range(n):
        out[-1 - k] = total - a[k - n]
    return n


@kernel
def branches(a, n, out):
    last, how = 0.0, 0
    while how < n:
        if a[how] > 0.0:
            last = a[how]
        elif how == 3:
            how += 2
            continue
        else:
            before = last
            last = -1.0
            if before > 1.0:
                break
        out[how] = last
        how += 1
    return how


@kernel
def _apart(x, y, swap=False):
    if swap:
        x, y = y, x
    return (x, (y, x > y)), x < y


@kernel
def calls(a, n, out):
    for k in range(1, n):
        (x, (y, more)), less = _apart(a[k], a[k - 1])
        (u, _), _ = _apart(a[k], a[k - 1], k % 2 == 0)
        out[k] = x + 3.0 * y + (7.0 if more else 0.0) - (9.0 if less else 0.0) + 0.1 * u
    return len(a)


def in_python(function):
    """Return a kernel as Python runs it, with those that it calls."""
    code = function.py_func
    return type(code)(code.__code__, {**code.__globals__, "_apart": _apart.py_func})


@pytest.mark.parametrize("function", [ranges, extremes, indices, branches, calls], ids=lambda f: f.py_func.__name__)
def test_kernel_equals_python(function):
    @entry_kernel(VECTOR, COUNT, FILLED_VECTOR)
    def entry(a, n, out):
        return function(a, n, out)

    rng = np.random.default_rng(3)
    for _ in range(5):
        a, out, expected = rng.normal(size=9), np.zeros(9), np.zeros(9)
        assert entry(a, 9, out) == in_python(function)(a, 9, expected)
        np.testing.assert_array_equal(out, expected)


def test_matrices():
    @entry_kernel(MATRIX, FILLED_MATRIX)
    def entry(A, out):
        m, n = A.shape
        for i in range(m):
            row = out[i]
            for j in range(n):
                row[j] = A[i, j] + 2.0 * A[i - m, -1 - j]
            out[i - m, 0] += A[-1][i % n]

    A, out = np.arange(12.0).reshape(3, 4), np.zeros((3, 4))
    entry(A, out)
    expected = A + 2.0 * A[:, ::-1]
    expected[:, 0] += A[-1, :3]
    np.testing.assert_array_equal(out, expected)


def test_exceptions_of_kernels():
    """Those of a kernel that a kernel calls, and of one that a function of numba's calls."""

    @kernel
    def root(x):
        if x < 0.0:
            raise ValueError("negative")
        return (math.sqrt(x), x > 1.0), x

    @kernel
    def total(a):
        return a.sum() + root(a[0])[0][0]

    @entry_kernel(VECTOR)
    def entry(a):
        return total(a) + 1.0

    @numba.njit
    def foreign(x):
        (y, more), z = root(x)
        return y + z if more else 0.0

    assert entry(np.array([4.0, 2.0])) == 9.0 and foreign(4.0) == 6.0
    for function, argument in ((entry, np.array([-1.0])), (foreign, -1.0)):
        with pytest.raises(ValueError, match="negative"):
            function(argument)


def test_first_calls():
    """Threads may make the first call together; compiled code may make it, with arrays of its own."""

    @entry_kernel(NUMBER)
    def doubled(x):
        return 2.0 * x

    @entry_kernel(VECTOR)
    def total(x):
        return x.sum()

    @numba.njit
    def doubled_total(x):
        return 2.0 * total(x)

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(doubled, [1.0, 2.0, 3.0, 4.0])) == [2.0, 4.0, 6.0, 8.0]
    assert doubled_total(np.ones(3)) == 6.0 and total(np.ones(3)) == 3.0
    for entry, wrong in ((doubled, "x"), (total, np.ones(3, np.int64))):
        with pytest.raises(TypeError):
            entry(wrong)


def test_read_only_arrays():
    """Results are arguments; compiled code would not notice that an array to write is read-only."""
    model = dd.load_urdf(TwoLinkArm().urdf)
    workspace = sweeps.Workspace(model.bodies, model.gravity)

    def read_only(array):
        array.flags.writeable = False
        return array

    q, ones = read_only(np.zeros(2)), read_only(np.ones(2))
    v, M = read_only(np.zeros(2)), read_only(np.zeros((2, 2)))
    rows, factors = read_only(np.zeros((sweeps.ROWS, 2))), read_only(np.zeros((3, 2, 2)))
    placement = read_only(np.zeros((3, 4)))
    for name, arguments in {
        "evaluate": (q, ones, ones, rows),
        "forward_dynamics": (q, ones, ones, v),
        "inverse_dynamics": (q, ones, ones, 1.0, v),
        "mass_matrix": (q, M),
        "factors": (q, factors, v),
        "nu_from_qd": (q, ones, v),
        "tau_from_epsilon": (q, ones, v),
        "mass_matrix_rate": (q, ones, M, M),
        "coriolis_bracket": (q, ones, ones, v, v, v),
        "placement": (q, 1, placement),
    }.items():
        sweep, outputs = getattr(sweeps, name), (v, M, rows, factors, placement)
        with pytest.raises(TypeError, match="argument type"):
            sweep(workspace.robot, *arguments)
        assert not any(array.any() for array in outputs), name
        writable = [np.zeros(x.shape) if any(x is array for array in outputs) else x for x in arguments]
        assert sweep(workspace.robot, *writable) == 0, name


# --- Numbers side by side

_lanes_at = array_at(EIGHT, 1)


def in_registers(x):
    """Return a copy at an address that lanes may have."""
    copy = aligned(WIDTH, np.dtype(float))
    copy[:] = x
    return copy


@numba.njit
def _in_place(x, y):
    x += y
    x -= 1
    x *= y
    x /= 3.0
    return x


FORMULAS = {
    "arithmetic": lambda x, y: 2.0 * x + y / 3.0 - x * y / (1.0 + abs(y)) - (-x),
    "in place": lambda x, y: _in_place(x, y),
    "square root and larger": lambda x, y: math.sqrt(abs(x)) + max(x, y) - max(x, 0.5),
    "sine": lambda x, y: sine_and_cosine(x)[0] + 0.0 * y,
    "cosine": lambda x, y: sine_and_cosine(x)[1] + 0.0 * y,
    "zero": lambda x, y: nought(x) + y,
}


@pytest.mark.parametrize("name", FORMULAS)
def test_lanes_have_the_bits_of_numbers(name):
    inlined = numba.njit(error_model="numpy")(FORMULAS[name])

    @numba.njit(error_model="numpy")
    def wide(x, y, result):
        _lanes_at(result, (1,))[0] = inlined(_lanes_at(x, (1,))[0], _lanes_at(y, (1,))[0])

    @numba.njit(error_model="numpy")
    def narrow(x, y):
        return inlined(x, y)

    rng = np.random.default_rng(5)
    for size in (1.0, 1e-8, 1e5, 1e9):  # at 1e9 some lanes are beyond LARGEST, some are not
        for _ in range(20):
            x, y = map(in_registers, size * rng.standard_normal((2, WIDTH)) * rng.choice([1e-4, 1.0], (2, WIDTH)))
            result = in_registers(x)
            wide(x.ctypes.data, y.ctypes.data, result.ctypes.data)
            assert result.tobytes() == np.array([narrow(a, b) for a, b in zip(x, y, strict=True)]).tobytes()


def test_comparisons_of_lanes():
    """They hold where they hold in every lane."""

    @numba.njit
    def holds(x, y):
        a, b = _lanes_at(x, (1,))[0], _lanes_at(y, (1,))[0]
        return a < b, math.isfinite(a)

    x, y = in_registers(0.0), in_registers(1.0)
    assert holds(x.ctypes.data, y.ctypes.data) == (True, True)
    for lane in range(WIDTH):
        for value, finite in ((1.0, True), (2.0, True), (np.nan, False), (np.inf, False)):
            other = in_registers(x)
            other[lane] = value
            assert holds(other.ctypes.data, y.ctypes.data) == (False, finite), (lane, value)


@pytest.mark.parametrize(("kind", "width"), [(FOUR, 4), (EIGHT, 8)])
def test_matrices_of_lanes(kind, width):
    """Entries lie eight numbers apart; lanes move among four."""
    load, spread = loader(kind), spreader(kind)
    move, choose = mover(None, 0, 1, None), chooser(False, True, False, True)

    @numba.njit
    def moved(a, b):
        M = move(load(a))
        x = choose(M[0][0], spread(7.0))
        store_matrix(b, ((x, M[0][1], M[0][2]), M[1], M[2]))

    a, b = np.arange(72.0) + 1.0, np.zeros(72)
    moved(a, b)
    before, found, expected = a.reshape(9, 8)[:, :width], b.reshape(9, 8), np.zeros((9, width))
    for first in range(0, width, 4):
        expected[:, first + 1 : first + 3] = before[:, first : first + 2]
    expected[0, 1::2] = 7.0
    np.testing.assert_array_equal(found[:, :width], expected)
    assert not found[:, width:].any()


def test_rows_shorter_than_registers():
    """Lanes before `first` have no place in the row."""

    @numba.njit
    def write(a, b, first):
        x = lanes_at(a, 1)
        set_lanes_from(b, 2, x, first)
        set_lanes(b, 12, from_lane(first, x, lanes_at(a, 9)))

    for first in (-1, 0, 3, 7, 8, 9):
        a, b = np.arange(20.0), np.full(22, -1.0)
        write(a, b, first)
        later = np.arange(WIDTH) >= first
        np.testing.assert_array_equal(b[2:10], np.where(later, a[1:9], -1.0))
        np.testing.assert_array_equal(b[12:20], np.where(later, a[1:9], a[9:17]))
        assert (b[[0, 1, 10, 11, 20, 21]] == -1.0).all()


@entry_kernel(VECTOR, FILLED_VECTOR, FILLED_VECTOR)
def _tabulate(x, sine, cosine):
    for k in range(len(x)):
        sine[k], cosine[k] = sine_and_cosine(x[k])


def tabulated(x):
    sine, cosine = np.empty((2, len(x)))
    _tabulate(x, sine, cosine)
    return sine, cosine


def test_sine_and_cosine():
    """They equal the C library's to one unit in the last place of 1, also near multiples of π/2."""
    rng = np.random.default_rng(6)
    multiples = np.arange(-4000, 4001) * (0.5 * np.pi)
    x = np.concatenate([s * rng.uniform(-1.0, 1.0, 100_000) for s in (1e-6, 4.0, 1e3, 0.999 * LARGEST)] + [multiples])
    sine, cosine = tabulated(x)
    for found, expected in ((sine, np.sin(x)), (cosine, np.cos(x))):
        assert np.abs(found - expected).max() <= np.spacing(0.5)
        small = np.abs(expected) < 1e-9
        assert small.sum() >= 4000
        np.testing.assert_allclose(found[small], expected[small], rtol=1e-6, atol=0.0)
    assert np.abs(sine**2 + cosine**2 - 1.0).max() <= 2 * np.spacing(1.0)
    x = np.array([LARGEST, -LARGEST, 1e9, -1e15, 1e300, 0.0, 5e-324])
    np.testing.assert_allclose(tabulated(x), (np.sin(x), np.cos(x)), rtol=0.0, atol=np.spacing(0.5))
    assert np.isnan(tabulated(np.array([np.nan, np.inf, -np.inf]))).all()


# --- Tables

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
    total, cube, records, wide, flags = 0.0, 0.0, 0.0, 0.0, 0
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


def sums(values):
    """Return what the kernel should find."""
    i, j, k = np.indices((2, 3, 2))
    records = float((values["records"]["weight"] * values["records"]["count"]).sum())
    matrix = float((values["matrix"] * [[1.0], [2.0]]).sum())
    flags = int(values["bytes"].astype(int)[values["flags"]].sum())
    cube = float(((10 * i + j + k + 1) * values["cube"]).sum())
    return (matrix, cube, records), (float(values["wide"][:, -1].sum()), flags), (values["number"], values["factor"])


def test_tables():
    """Kernels read and write the arrays that Python has put there; a longer table is read as the shorter one."""
    values = entries()
    table, expected = Addresses(TABLE, **values), sums(values)
    assert _sums(table.at) == expected
    assert values["records"]["count"].tolist() == [3, 4]
    for name, entry in {"number": 8, "matrix": np.ones((2, 3)), "factor": 2.5}.items():
        values[name] = table[name] = entry
        expected = sums(values)
        assert _sums(table.at) == expected
    longer, expected = Addresses(LONGER, **values, more=np.array([4, 5])), sums(values)
    del values, table, entry  # the table holds its arrays
    assert _sums(longer.at) == expected and _more(longer.at) == 5


def test_unknown_fields():
    """Python and the compiler reject them; numba raises a KeyError for those of a record in an array."""
    values = entries()
    table = Addresses(TABLE, **values)
    with pytest.raises(TypingError, match="'numbr'"):
        _misspelt(table.at)
    with pytest.raises((TypingError, KeyError), match="wieght"):
        _misspelt_in_record(table.at)
    for call, key in (
        (lambda: Addresses(TABLE, **{name: values[name] for name in values if name != "wide"}), "for wide"),
        (lambda: Addresses(TABLE, **values, numbr=1), "no field numbr"),
        (lambda: table.__setitem__("numbr", 1), "no field numbr"),
        (lambda: Addresses(TABLE, number=1, **values), "'number'"),
        (lambda: TABLE.extended("DoubledTableOfTest", number=int), "'number'"),
    ):
        with pytest.raises(TypeError, match=key):
            call()


WRONG = {
    "matrix": (
        *(np.zeros((2, 3), kind) for kind in (np.float32, int, ">f8")),
        *(np.zeros((2, 6))[:, ::2], np.zeros((3, 2)).T, np.zeros(6), np.zeros((1, 2, 3)), [[0.0]], 1),
    ),
    "cube": (np.zeros((2, 3, 3)),),
    "flags": (np.zeros(3, np.uint8),),
    "bytes": (np.zeros(3, bool), np.zeros(3, np.int8)),
    "records": (np.zeros(2, [("weight", "f8"), ("number", "i8")]), np.zeros(2, [("weight", "f8"), ("count", "i4")])),
    "wide": (np.zeros((2, WIDTH + 1)), np.zeros(2)),
    "number": (np.zeros(1, int),),
}


@pytest.mark.parametrize(("name", "entry"), [(name, entry) for name, some in WRONG.items() for entry in some])
def test_entries_of_wrong_types(name, entry):
    with pytest.raises(TypeError, match=name):
        Addresses(TABLE, **entries(**{name: entry}))
    values = entries()
    table, expected = Addresses(TABLE, **values), sums(values)
    with pytest.raises(TypeError, match=name):
        table[name] = entry
    assert _sums(table.at) == expected


# --- Compiled code on disk


@pytest.fixture
def folder(tmp_path, monkeypatch, caplog):
    """Let kernels be kept in an empty folder."""
    for module in (native, plain, store):
        monkeypatch.setattr(module, "cache_folder", lambda: tmp_path)
    caplog.set_level(logging.WARNING)
    return tmp_path


def compile_small(decorate=native.entry_kernel):
    """Define a small kernel and call it; return how often it was loaded from the disk."""

    @decorate(NUMBER)
    def tripled(x):
        return 3.0 * x

    assert tripled(2.0) == 6.0
    return sum(tripled.stats.cache_hits.values())


def written(folder, pattern):
    (file,) = folder.glob(pattern)
    return file


def truncate(folder):
    written(folder, "*.nbi").write_bytes(b"")


def replace_index(folder):
    written(folder, "*.nbi").write_bytes(b"\x80")


def replace_code(folder):
    written(folder, "*.nbc").write_bytes(b"not a pickle")


def flip_bit(folder):
    """Change machine code that unpickles, which only a digest detects."""
    content = bytearray(written(folder, "*.nbc").read_bytes())
    content[content.index(b"\x7fELF") + 256] ^= 0x10
    pickle.loads(bytes(content[64:]))
    written(folder, "*.nbc").write_bytes(content)


@pytest.mark.parametrize("damage", [truncate, replace_index, replace_code, flip_bit])
def test_damaged_files_are_compiled_again(folder, caplog, damage):
    assert (compile_small(), compile_small()) == (0, 1)
    damage(folder)
    assert compile_small() == 0 and "unreadable" in caplog.text
    assert compile_small() == 1


def test_stale_files_are_compiled_again(folder, caplog, monkeypatch):
    """Files of other sources, of another format or of another function are no damage."""
    assert compile_small() == 0
    with monkeypatch.context() as context:
        context.setattr(store, "source_hash", lambda: "other sources")
        assert (compile_small(), compile_small()) == (0, 1)
    assert compile_small() == 0
    with monkeypatch.context() as context:
        context.setattr(store, "FORMAT", store.FORMAT - 1)
        assert compile_small() == 0
    assert compile_small() == 1
    (file,) = folder.glob(f"*tripled*-{store.FORMAT}-*.nbc")

    @native.entry_kernel(NUMBER)
    def doubled(x):
        return 2.0 * x

    doubled(1.0)
    shutil.copy(written(folder, "*doubled*.nbc"), file)
    assert (compile_small(), compile_small()) == (0, 1)
    assert not caplog.records


@pytest.mark.parametrize("decorate", [native.entry_kernel, plain.entry_kernel], ids=["native", "plain"])
def test_full_disk(folder, caplog, monkeypatch, decorate):
    def fail(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as context:
        context.setattr(IndexDataCacheFile, "_open_for_write", fail)
        assert compile_small(decorate=decorate) == 0
    assert "could not be saved" in caplog.text
    plain._folder.cache_clear()
    assert (compile_small(decorate=decorate), compile_small(decorate=decorate)) == (0, 1)
    assert list(folder.rglob("*tripled*.nbc"))
    plain._folder.cache_clear()


def test_unused_plain_folders_are_removed(folder):
    used = folder / f"plain-{cache.source_hash()[:16]}"
    for path, age in ((used, 99), (folder / "plain-old", 40), (folder / "plain-new", 20), (folder / "other", 40)):
        path.mkdir()
        os.utime(path, times=(time.time() - age * 86400,) * 2)
    assert plain._folder.__wrapped__() == used
    assert {path.name for path in folder.iterdir()} == {used.name, "plain-new", "other"}


def test_folder_of_compiled_code(tmp_path, monkeypatch, caplog):
    """The first writable one of $NUMBA_CACHE_DIR, or of $XDG_CACHE_HOME and the temporary folder; else none."""
    occupied = tmp_path / "file"
    occupied.touch()
    chosen = cache.cache_folder.__wrapped__
    monkeypatch.setattr(cache.tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "a"))
    assert chosen() == tmp_path / "a" / "diag_dynamics"
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "b"))
    assert chosen() == tmp_path / "b" / "diag_dynamics"
    monkeypatch.setenv("XDG_CACHE_HOME", str(occupied))
    assert chosen() == tmp_path / f"diag_dynamics-{os.getuid()}" and not caplog.records
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(occupied))
    assert chosen() is None and "NUMBA_CACHE_DIR" in caplog.text


@pytest.mark.parametrize("room", cache.ROOMS)
def test_hash_of_sources(tmp_path, room):
    """Any edit of any kernel's source changes it: numba inlines functions of other files."""
    for path in cache.sources(PACKAGE):
        copy = tmp_path / path.relative_to(PACKAGE)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, copy)
    assert cache.hash_of(tmp_path) == cache.hash_of(PACKAGE)
    edited = sorted((tmp_path / room).rglob("*.py"))[-1]
    edited.write_text(edited.read_text() + "\n")
    assert cache.hash_of(tmp_path) != cache.hash_of(PACKAGE)


# --- Progress of compilation


class Clock:
    """A clock, and an event whose wait lets it go on; the event is set after `waits` of them."""

    def __init__(self, waits=0):
        self.now, self.left = 0.0, waits

    def perf_counter(self):
        return self.now

    def wait(self, duration):
        self.now, self.left = self.now + duration, self.left - 1
        return self.left < 0


@pytest.fixture
def teller(monkeypatch):
    monkeypatch.setattr(progress, "_teller", progress._Teller())
    return progress._teller


def test_lines_while_compiling(teller, monkeypatch):
    """The first has the rule, later ones the time so far; at most one in 5 s."""
    clock, lines = Clock(waits=3), []
    monkeypatch.setattr(progress, "time", clock)
    progress.tell_by(lambda line: lines.append((clock.now, line)))
    progress._tell("evaluate", 0.0, clock, 2.0)
    clock.left, clock.now = 2, 16.0
    progress._tell("factors", 16.0, clock, 0.3)
    assert lines == [
        (2.0, f"compiling evaluate {progress.RULE}"),
        (7.0, "compiling evaluate, for 7 s by now"),
        (12.0, "compiling evaluate, for 12 s by now"),
        (17.0, "compiling factors, for 1 s by now"),
    ]


def test_patience(teller, monkeypatch):
    """Kernels one after the other say nothing for 2 s, a single one for 0.3 s; a pause begins anew."""
    clock, threads = Clock(), []

    def thread(target, args, **_):
        return SimpleNamespace(start=lambda: threads.append(args))

    monkeypatch.setattr(progress, "time", clock)
    monkeypatch.setattr(progress, "_row", progress._Row())
    monkeypatch.setattr(progress, "threading", SimpleNamespace(Thread=thread, Event=threading.Event))
    for duration, name in zip((1.5, 1.5, 0.1), progress.steps(["a", "b", "c"]), strict=True):
        with progress.told(name):
            clock.now += duration
    clock.now += 1.1
    with progress.told("d"):
        pass
    names, _, overs, waits = zip(*threads, strict=True)
    assert names == ("a (1 of 3)", "b (2 of 3)", "c (3 of 3)", "d")
    assert waits == pytest.approx((2.0, 0.5, 0.3, 2.0)) and all(over.is_set() for over in overs)


def test_lines_go_to_stderr(teller, capsys):
    progress.tell_by(None)
    teller.line("evaluate", 0.0)
    assert capsys.readouterr().err.startswith(f"diag_dynamics: compiling evaluate {progress.RULE}\n")


def test_compile_ahead(monkeypatch):
    """All entries of a module or package, each reported before it is compiled."""
    asked, reported = [], []
    monkeypatch.setattr("diag_dynamics.compiled.ahead.ready", asked.append)
    compile_ahead("diag_dynamics.sweeps.classical", report=lambda *report: reported.append(report))
    names = [entry.__name__ for entry in asked]
    assert names[:2] == ["forward_dynamics", "inverse_dynamics"] and "mass_matrix" in names
    assert {entry.__module__ for entry in asked} == {"diag_dynamics.sweeps.classical"}
    assert reported == [*((name, k, len(names)) for k, name in enumerate(names)), (None, len(names), len(names))]
    compile_ahead("diag_dynamics.sweeps")
    assert {"evaluate", "factors", "mass_matrix"} <= {entry.__name__ for entry in asked[len(names) :]}


# --- Processes with an empty cache

# Prints D of a pendulum and the cache hits; fails if numba prepared to compile although there was nothing to compile.
SCRIPT = """
import sys
import numpy as np
import diag_dynamics as dd
from diag_dynamics import sweeps

urdf = '''<robot name="r"><link name="a"/><link name="b"><inertial><origin xyz="0 0 -2"/><mass value="3"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint></robot>'''
model = dd.load_urdf(urdf)
D, size = np.zeros((2, 1))
own = sweeps.Workspace(model.bodies, model.gravity)
sweeps.joint_inertias(own.robot, np.zeros(1), D, size)
energies = np.zeros((1, 2))
sweeps.link_energies(model.bodies, model.links, *np.zeros((2, 1, 1)), energies)
hits = sum(sweeps.joint_inertias.stats.cache_hits.values())
print(D[0], hits, bool(hits) is ("numba.np.npyimpl" not in sys.modules))
"""


def run(folder, cache, **more):
    """Run the script with the package in `folder`; return D, the cache hits and stderr."""
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "XDG_CACHE_HOME", "TMPDIR")}
    environment |= {"PYTHONPATH": str(folder), "NUMBA_CACHE_DIR": str(cache), "PYTHONDONTWRITEBYTECODE": "1"} | more
    command = [sys.executable, "-c", SCRIPT]
    done = subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    D, hits, as_expected = done.stdout.split()[-3:]
    assert as_expected == "True"
    return float(D), int(hits), done.stderr


@pytest.fixture
def copy(tmp_path):
    """Return a folder with a copy of the package, without its nodes."""
    folder = tmp_path / "site"
    shutil.copytree(PACKAGE, folder / "diag_dynamics", ignore=shutil.ignore_patterns("nodes", "__pycache__"))
    return folder


@pytest.mark.full
def test_next_process_loads_from_the_cache(copy, tmp_path):
    """It does not prepare to compile. spatial.py is inlined into the sweeps: after an edit they give the new number."""
    cache = tmp_path / "cache"
    for hits in (False, True):
        D, found, _ = run(copy, cache)
        assert D == 13.0 and (found > 0) is hits
    spatial = copy / "diag_dynamics" / "sweeps" / "spatial.py"
    text = spatial.read_text()
    before = "    if direction == ANGULAR_Z:\n        return w[2]\n"
    assert text.count(before) == 1
    spatial.write_text(text.replace(before, before.replace("w[2]", "2.0 * w[2]")))
    assert run(copy, cache)[:2] == (26.0, 0)


@pytest.mark.full
@pytest.mark.skipif(os.uname().machine != "x86_64", reason="the other processor is a kind of x86-64")
def test_processes_share_a_cache(copy, tmp_path):
    """They may compile together; each processor finds its own code."""
    cache, other = tmp_path / "cache", {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": "+sse2"}
    with ThreadPoolExecutor(3) as pool:
        for D, _, errors in pool.map(lambda more: run(copy, cache, **more), ({}, {}, other)):
            assert D == 13.0 and "unreadable" not in errors and "could not be saved" not in errors
    run(copy, cache)
    run(copy, cache, **other)
    for processor in ({}, other):
        D, hits, _ = run(copy, cache, **processor)
        assert D == 13.0 and hits >= 1


# Pickles results of some robots: a floating base, coupled joints, and plain chains.
RESULTS = """
import pickle, sys
import numpy as np
import diag_dynamics as dd

found = {}
for name, options in (("ur5", {}), ("panda", {}), ("go2", {"floating_base": True})):
    model = dd.load_robot(name, **options)
    dyn, rng = dd.DiagonalDynamics(model), np.random.default_rng(3)
    q, (qd, tau) = model.neutral, rng.standard_normal((2, model.nv))
    results = dyn.evaluate(q, qd, tau), dyn.evaluate_batch(*(np.tile(x, (11, 1)) for x in (q, qd, tau))), dyn.factors(q)
    values = {f"{k} {key}": x for k, one in enumerate(results) for key, x in one.to_dict().items() if x is not None}
    found[name] = values | {"M": dyn.mass_matrix(q), "forward": dyn.forward_dynamics(q, qd, tau)}
sys.stdout.buffer.write(pickle.dumps((found, sorted(sys.modules))))
"""

PRIVATE = {"native", "lent", "parts", "store", "registers", "addressed"}
"""Modules that use undocumented parts of numba."""


@pytest.mark.full
def test_plain_kernels_give_the_same_numbers():
    """With numba's documented interface alone, to 10 ε of the largest entry."""
    found = []
    for switch in ("1", ""):
        environment = os.environ | {"DIAG_DYNAMICS_PLAIN": switch}
        done = subprocess.run([sys.executable, "-c", RESULTS], env=environment, capture_output=True, check=True)
        results, modules = pickle.loads(done.stdout)
        own = {name.rsplit(".", 1)[1] for name in modules if name.startswith("diag_dynamics.compiled.")}
        assert own & PRIVATE == (set() if switch else PRIVATE)
        found.append(results)
    for name, quantities in found[1].items():
        for quantity, expected in quantities.items():
            difference = np.abs(found[0][name][quantity] - expected).max()
            assert difference <= 10 * np.finfo(float).eps * np.abs(expected).max(), (name, quantity)
