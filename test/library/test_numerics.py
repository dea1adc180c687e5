# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compiled kernels: exceptions, first calls, sine and cosine, and a cache that detects damage and
other sources.
"""

import _thread
import fcntl
import importlib
import logging
import math
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from unittest import mock

import numba
import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.numerics import cache, callback, linking, progress, tables
from diag_dynamics.numerics import kernel as kernels
from diag_dynamics.numerics.callback import FAILED, Callback, call_address
from diag_dynamics.numerics.kernel import (
    COUNT,
    FILLED_VECTOR,
    NUMBER,
    VECTOR,
    entry_kernel,
    kernel,
    large_kernel,
)
from diag_dynamics.sweeps.spatial import MAX_ANGLE, reduced_angle, sine_and_cosine

PACKAGE = Path(dd.__file__).parent

# --- Results and errors of kernels


def test_callbacks(caplog, monkeypatch):
    """A callback is compiled at its first call, also by threads together; a failure is a status."""
    monkeypatch.setattr(callback, "compile_ahead", lambda _: None)  # it would fail in precompile

    @Callback
    def added(x, y):
        return x + y

    @Callback
    def wrong(x):
        return x.missing

    @entry_kernel(COUNT, COUNT, nogil=True)
    def total(address, x):
        return call_address(address, (x, 2)) if x > 0 else -1

    @entry_kernel(COUNT)
    def failing(address):
        return call_address(address, (1,))

    assert total(added.address, 0) == -1 and "_compiled" not in vars(added)
    with ThreadPoolExecutor(4) as pool:
        totals = pool.map(lambda x: total(added.address, x), [1, 2, 3, 4])
        assert list(totals) == [3, 4, 5, 6]
    assert "_compiled" in vars(added)
    assert failing(wrong.address) == FAILED and "wrong cannot be compiled" in caplog.text


def test_an_interrupt_while_a_callback_is_compiled(monkeypatch):
    """The kernel gives the right result; the interrupt follows."""

    @Callback
    def doubled(x):
        return 2 * x

    @entry_kernel(COUNT)
    def entry(address):
        return call_address(address, (21,))

    def interrupt_and_compile(function):
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
        compile_callback(function)

    entry.compile()
    compile_callback = Callback.compile
    timer = mock.Mock()
    monkeypatch.setattr(Callback, "compile", interrupt_and_compile)
    monkeypatch.setattr(callback.threading, "Timer", timer)
    assert entry(doubled.address) == 42
    timer.assert_called_once_with(callback.INTERRUPT_DELAY, _thread.interrupt_main)
    timer.return_value.start.assert_called_once_with()


@pytest.mark.parametrize(
    "part", ["_optimize_functions", "_optimize_final_module", "_finalize_final_module"]
)
def test_other_inside_of_numba(part, monkeypatch, caplog):
    """Where a private part fails, or gives another number, numba links kernels itself, to the same
    bits.
    """

    def results():
        @kernel
        def third(x):
            return math.sin(x / 3.0), x

        @large_kernel
        def total(x):
            return third(x)[0] + third(2.0 * x)[0]

        @entry_kernel(NUMBER)
        def entry(x):
            return total(x) + total(x + 1.0)

        return [entry(x) for x in np.linspace(-9.0, 9.0, 50)]

    expected = results()
    assert linking.works() and not caplog.records
    monkeypatch.setattr(linking.KernelCompiler, "works", None)
    monkeypatch.setattr(linking.Library, part, None)
    assert results() == expected
    assert not linking.works() and f"slowly under numba {numba.__version__}" in caplog.text
    monkeypatch.undo()
    monkeypatch.setattr(linking.KernelCompiler, "works", None)
    monkeypatch.setattr(linking, "_compile_pair", lambda: lambda x: x)
    assert not linking.works() and "a wrong result" in caplog.text


def test_sine_and_cosine():
    """They equal the C library's to one unit in the last place of 1, also near multiples of π/2."""

    @entry_kernel(VECTOR, FILLED_VECTOR, FILLED_VECTOR)
    def tabulate(x, sine, cosine):
        for k in range(len(x)):
            sine[k], cosine[k] = sine_and_cosine(reduced_angle(x[k]))

    rng = np.random.default_rng(6)
    scales = np.repeat([1e-6, 4.0, 1e3, 0.999 * MAX_ANGLE], 100_000)
    multiples = np.arange(-4000, 4001) * (0.5 * np.pi)
    beyond = [MAX_ANGLE, -MAX_ANGLE, 1e9, -1e15, 1e300]
    x = np.concatenate([scales * rng.uniform(-1.0, 1.0, len(scales)), multiples, beyond])
    infinite = [np.nan, np.inf, -np.inf]
    sine, cosine = np.empty((2, len(x) + len(infinite)))
    tabulate(np.append(x, infinite), sine, cosine)
    tolerance = np.spacing(np.where(np.abs(x) < MAX_ANGLE, 0.5, 1.0))
    for values, expected in ((sine, np.sin(x)), (cosine, np.cos(x))):
        assert np.isnan(values[len(x) :]).all()
        values = values[: len(x)]
        assert (np.abs(values - expected) <= tolerance).all()
        small = np.abs(expected) < 1e-9
        assert small.sum() >= 4000
        np.testing.assert_allclose(values[small], expected[small], rtol=1e-6, atol=0.0)


# --- Tables


def test_tables():
    """Kernels read the numbers and arrays that Python has written; other types are errors."""
    table = tables.Table(
        "Mixed", count=int, cells=tables.array(float, 2), factor=float, ids=tables.array(np.int64)
    )
    opened = table.opened

    @entry_kernel(NUMBER)
    def total(address):
        at = opened(int(address))
        return at.count + at.factor * at.cells[1, 2] + at.ids[0] + 10.0 * at.cells.shape[0]

    fields = {
        "count": 3,
        "cells": np.arange(6.0).reshape(2, 3),
        "factor": 0.5,
        "ids": np.array([7]),
    }
    addresses = tables.Addresses(table, **fields)
    assert total(addresses.at) == 3 + 2.5 + 7 + 20
    for name, wrong in (("count", 1.5), ("cells", np.zeros((2, 3)).T), ("other", 1)):
        with pytest.raises(TypeError, match=r"cells|fields|int"):
            tables.Addresses(table, **fields | {name: wrong})


# --- Compiled code on disk


@pytest.fixture
def folder(tmp_path, monkeypatch, caplog):
    """Let kernels be kept in an empty folder."""
    monkeypatch.setattr(kernels, "code_folder", lambda module: tmp_path)
    caplog.set_level(logging.WARNING)
    return tmp_path


def compile_small():
    """Define a small kernel and call it; return how often it was loaded from the disk."""

    @entry_kernel(NUMBER)
    def tripled(x):
        return 3.0 * x

    assert tripled(2.0) == 6.0
    return sum(tripled.run.stats.cache_hits.values())


def test_messages_of_kernels_in_the_cache(folder, monkeypatch):
    """A kernel that is loaded is not reported as compiled, however long that takes."""
    messages = []
    sent = threading.Event()
    begin = progress.begin_compilation

    @contextmanager
    def only_process_slowly(*_):
        time.sleep(0.3)
        yield

    def begin_slowly():
        begin()
        assert sent.wait(60.0)

    monkeypatch.setattr(kernels, "only_process", only_process_slowly)
    monkeypatch.setattr(linking, "begin_compilation", begin_slowly)
    monkeypatch.setattr(progress, "DELAY", 0.0)
    for hits in (0, 1):
        monkeypatch.setattr(progress, "_progress", progress.Progress())
        progress.set_progress_callback(lambda text: (messages.append(text), sent.set()))
        assert compile_small() == hits
        assert messages == [f"compiling tripled {progress.RULE}"]


def test_processes_compile_a_kernel_once(folder, monkeypatch):
    """A process waits for another one that compiles the kernel, and says so."""
    messages = []
    waited = threading.Event()
    monkeypatch.setattr(progress, "_progress", progress.Progress())
    progress.set_progress_callback(lambda text: (messages.append(text), waited.set()))
    with ThreadPoolExecutor(1) as pool, (folder / "tripled.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        hits = pool.submit(compile_small)
        assert waited.wait(60.0) and not list(folder.rglob("*.nbc"))
        lock.close()
        assert hits.result() == 0
    assert messages == ["another process compiles tripled; this one waits for it"]
    assert compile_small() == 1 and len(messages) == 1


def written(folder, pattern):
    (file,) = folder.rglob(pattern)
    return file


def test_copies_share_code_of_this_package_alone(folder, monkeypatch):
    """The hash of sources is without what other packages import."""
    monkeypatch.setattr(linking, "cache_folder", lambda: folder.parent)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(folder))
    for function, is_ours in ((reduced_angle.py_func, True), (written, False)):
        place = numba.njit(cache=True)(function)._cache._impl.locator
        assert (place.get_source_stamp() is None) is is_ours
        assert (place.get_cache_path() == str(folder / "sweeps")) is is_ours


DAMAGES = {
    "empty index": lambda folder: written(folder, "*.nbi").write_bytes(b""),
    "cut index": lambda folder: written(folder, "*.nbi").write_bytes(b"\x80"),
    "other code": lambda folder: written(folder, "*.nbc").write_bytes(b"not a pickle"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_files_are_compiled_again(folder, caplog, damage):
    assert (compile_small(), compile_small()) == (0, 1)
    DAMAGES[damage](folder)
    assert compile_small() == 0 and "unreadable" in caplog.text
    assert compile_small() == 1


def test_an_index_that_cannot_be_read(folder, caplog):
    """A folder in its place, for instance: the function is compiled without a cache."""
    compile_small()
    index = written(folder, "*.nbi")
    index.unlink()
    index.mkdir()
    assert compile_small() == 0 and "cannot be used" in caplog.text


def test_code_of_other_sources_is_removed_after_a_month(tmp_path, monkeypatch):
    """Each state of the sources has a folder of its own, and each copy of the package a stamp."""
    monkeypatch.setattr(cache, "cache_folder", lambda: tmp_path)
    used = f"code-{cache.source_hash(__name__)[:16]}"
    ages = {used: 99, "code-old": 40, "code-new": 20, "other": 40}
    ages |= {"ahead-old": 40, "ahead-new": 20}
    for name, age in ages.items():
        path = tmp_path / name
        (path.touch if name.startswith("ahead") else path.mkdir)()
        os.utime(path, times=(time.time() - age * 86400,) * 2)
    assert cache.code_folder.__wrapped__(__name__) == tmp_path / used
    assert cache.code_folder.__wrapped__("diag_dynamics.zipped") is None
    assert {path.name for path in tmp_path.iterdir()} == {*ages} - {"code-old", "ahead-old"}


def test_folder_of_compiled_code(tmp_path, monkeypatch, caplog):
    """The first writable one of $NUMBA_CACHE_DIR, or of $XDG_CACHE_HOME and the temporary folder;
    else none.
    """
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


@pytest.mark.parametrize("umask", [0o002, 0o000, 0o077])
def test_only_this_user_writes_compiled_code(tmp_path, monkeypatch, caplog, umask):
    """A folder that was open to others is emptied once; another user's is rejected."""
    monkeypatch.setattr(cache.tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "new" / "cache"))
    before = os.umask(umask)
    try:
        top = cache.cache_folder.__wrapped__()
        monkeypatch.setattr(cache, "cache_folder", lambda: top)
        folder = cache.code_folder.__wrapped__(__name__)
        folders = (top.parent.parent, top.parent, top, folder)
        assert {path.stat().st_mode & 0o777 for path in folders} == {0o700}
        (folder / "code.nbc").touch()
        for opened, is_left in ((None, True), (folder, False), (None, True), (top, False)):
            folder.mkdir(exist_ok=True)
            (folder / "code.nbc").touch()
            if opened:
                opened.chmod(0o777)
            caplog.clear()
            cache.make_private(top)
            assert cache.code_folder.__wrapped__(__name__) == folder
            assert (folder / "code.nbc").exists() == is_left == (not caplog.records)
            assert len(caplog.records) <= 1
    finally:
        os.umask(before)
    (tmp_path / "to_foreign").symlink_to("/usr" if os.getuid() else tmp_path / "foreign")
    foreign = [tmp_path / "to_foreign"]
    if not os.getuid():
        (tmp_path / "foreign").mkdir()
        (tmp_path / "of_foreign").symlink_to(top)
        foreign += [tmp_path / "foreign", tmp_path / "of_foreign"]
        for path in foreign[1:]:
            os.chown(path, 65534, 65534, follow_symlinks=False)
    for path in foreign:
        with pytest.raises(PermissionError, match="another user"):
            cache.make_private(path)


# Of each module: others that it is compiled with, and some that it is not.
CLOSURES = {
    "sweeps.evaluation": (
        ["sweeps.spatial", "numerics.tables"],
        ["sweeps.batch", "simulation.steps"],
    ),
    "simulation.steps": (
        ["simulation.midpoint", "sweeps.spatial", "numerics.linking"],
        ["sweeps.batch", "simulation.simulation"],
    ),
}


@pytest.mark.parametrize("module", CLOSURES)
def test_hash_of_sources(module, tmp_path, monkeypatch):
    """An edit of a module changes the hash of those that import it, because numba inlines functions
    of other files.
    """
    copy = tmp_path / "diag_dynamics"
    shutil.copytree(
        PACKAGE,
        copy,
        ignore=lambda folder, names: [n for n in names if "." in n and not n.endswith(".py")],
    )
    monkeypatch.setattr(cache, "PACKAGE", copy)

    def result(name):
        cache.read_source.cache_clear()
        return cache.source_hash.__wrapped__(name)

    expected = result(f"diag_dynamics.{module}")
    for stale, edited in ((True, CLOSURES[module][0]), (False, CLOSURES[module][1])):
        for other in edited:
            path = copy.joinpath(*other.split(".")).with_suffix(".py")
            text = path.read_text()
            path.write_text(text + "\n")
            assert (result(f"diag_dynamics.{module}") != expected) is stale, other
            path.write_text(text)
    assert "diag_dynamics.sweeps.spatial" in cache.sources(__name__)
    monkeypatch.setattr(kernels, "_entries", [])
    monkeypatch.syspath_prepend(tmp_path)
    path = tmp_path / f"upgraded_{module.replace('.', '_')}.py"
    text = "from diag_dynamics.numerics.kernel import *\nentry_kernel(NUMBER)(lambda x: x)"
    path.write_text(text)
    importlib.import_module(path.stem)
    path.write_text("")  # an upgrade before the first call
    hash_of_call = cache.source_hash(path.stem)
    path.write_text(text)
    assert hash_of_call == result(path.stem)


# --- Progress of compilation


def test_messages_while_compiling(monkeypatch, capsys):
    """The first one after 2 s, with the rule, at most one in 5 s; kernels in a row share the 2
    s.
    """
    sender = progress.Progress()
    messages = []
    assert sender.begin(0.0) == 2.0
    sender.end(1.5)
    assert sender.begin(1.5) == 2.0
    monkeypatch.setattr(progress, "_progress", sender)
    progress.set_progress_callback(messages.append)
    assert sender.send("evaluate", 1.5, 2.0) == 7.0 and sender.send("evaluate", 1.5, 7.0) == 12.0
    assert messages == [f"compiling evaluate {progress.RULE}", "compiling evaluate, for 6 s"]
    sender.end(8.0)
    assert sender.begin(8.5) == 12.0 and sender.begin(30.0) == 32.0
    progress.set_progress_callback()
    sender.send("mass_matrix", 30.0, 32.0)
    assert capsys.readouterr().err.startswith("diag_dynamics: compiling mass_matrix")


# --- Processes with an empty cache

# Loads and evaluates a plain arm; prints the functions that are compiled.
PLAIN_ARM = """
import numpy as np
from numba.core import event
import diag_dynamics as dd

with event.install_recorder("numba:compile") as loading:
    model = dd.load_robot("ur5")
with event.install_recorder("numba:compile") as evaluating:
    dd.DiagonalDynamics(model).evaluate(*np.zeros((3, model.nv)))
for recorder in (loading, evaluating):
    print(*(compiled.data["dispatcher"].py_func.__name__ for _, compiled in recorder.buffer))
"""


def test_plain_arm_compiles_neither_loading_nor_groups(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(PACKAGE.parent)}
    command = [sys.executable, "-c", PLAIN_ARM]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    loading, evaluating = done.stdout.splitlines()
    functions = evaluating.split()
    assert "inward_joint" in functions
    groups = {"compose", "gather_bias", "inward_coupled", "inward_base", "factorize_group"}
    assert not loading and not groups & set(functions)
