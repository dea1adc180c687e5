# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The disk cache of compiled code: used, invalidated by any kernel source, and never in the way."""

import hashlib
import os
import pickle
import re
import resource
import shutil
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numba
import numpy as np
import pytest

from diag_dynamics import sweeps
from diag_dynamics.compiled import progress
from diag_dynamics.compiled.ahead import compile_ahead
from diag_dynamics.compiled.cache import ROOMS, hash_of
from diag_dynamics.compiled.kernel import NUMBER, VECTOR, entry_kernel

pytestmark = [pytest.mark.full]

PACKAGE = Path(__file__).parents[2] / "diag_dynamics"

# Prints D of a pendulum, and how many of the calls were loaded from the cache.
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
print(D[0], sum(sweeps.joint_inertias.stats.cache_hits.values()))
"""

# Calls a function of records, too, and fails if numba got ready to compile though there was nothing to.
FROM_CACHE = f"""{SCRIPT}
energies = np.zeros((1, 2))
sweeps.link_energies(model.bodies, model.links, *np.zeros((2, 1, 1)), energies)
assert not energies.any()
loaded = any(sweeps.evaluation._link_energies.stats.cache_hits.values())
assert loaded is ("numba.np.npyimpl" not in sys.modules)
"""


def run(folder, cache, script=SCRIPT, begin=None, **more):
    """Run a script with the package in `folder`, after `begin`; returns D, the cache hits and what was said."""
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "XDG_CACHE_HOME", "TMPDIR")}
    environment |= {"PYTHONPATH": str(folder), "NUMBA_CACHE_DIR": str(cache), "PYTHONDONTWRITEBYTECODE": "1"} | more
    environment = {k: v for k, v in environment.items() if v != ""}
    done = subprocess.run(
        [sys.executable, "-c", script],
        env=environment,
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        preexec_fn=begin,
    )
    assert done.returncode == 0, done.stderr
    D, hits = done.stdout.split()[-2:]
    return float(D), int(hits), done.stderr


@pytest.fixture
def copy(tmp_path):
    """A copy of the package without ROS parts."""
    folder = tmp_path / "site"
    shutil.copytree(PACKAGE, folder / "diag_dynamics", ignore=shutil.ignore_patterns("nodes", "__pycache__"))
    return folder


def test_cache_is_used_and_a_change_of_any_kernel_source_invalidates(copy, tmp_path):
    """spatial.py is inlined into the sweeps: after an edit of the one, the other gives the new number."""
    cache = tmp_path / "cache"
    first, hits, _ = run(copy, cache)
    assert (first, hits) == (3 * 4 + 1, 0)
    again, hits, _ = run(copy, cache)
    assert again == first
    assert hits >= 1

    spatial = copy / "diag_dynamics" / "sweeps" / "spatial.py"
    text = spatial.read_text()
    before = "    if direction == ANGULAR_Z:\n        return w[2]\n"
    assert text.count(before) == 1
    spatial.write_text(text.replace(before, before.replace("w[2]", "2.0 * w[2]")))
    changed, hits, _ = run(copy, cache)
    assert changed == 2 * first
    assert hits == 0


def test_what_is_cached_does_not_wait_for_the_compiler(copy, tmp_path):
    """Loading compiled code takes a tenth of the time that numba takes to get ready to compile."""
    for expected in (False, True):
        _, hits, _ = run(copy, tmp_path / "cache", FROM_CACHE)
        assert (hits > 0) is expected


def test_threads_may_call_first_together():
    """Who waits while another thread compiles finds the code."""

    @entry_kernel(NUMBER)
    def doubled(x):
        return 2.0 * x

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(doubled, [1.0, 2.0, 3.0, 4.0])) == [2.0, 4.0, 6.0, 8.0]
    with pytest.raises(TypeError):
        doubled("x")


def test_unwritable_cache_folder_is_survived(copy, tmp_path):
    """Without any place for compiled code everything works, and a warning says what to do."""
    occupied = tmp_path / "a file, not a folder"
    occupied.write_text("")
    D, hits, said = run(copy, occupied)
    assert (D, hits) == (13, 0)
    assert "NUMBA_CACHE_DIR" in said


def test_other_folders_are_tried(copy, tmp_path):
    """If the home folder cannot be written, the system's temporary one serves."""
    occupied = tmp_path / "a file, not a folder"
    occupied.write_text("")
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    for expected in (False, True):
        D, hits, said = run(copy, "", XDG_CACHE_HOME=str(occupied), TMPDIR=str(temporary))
        assert D == 13
        assert (hits > 0) is expected
        assert "NUMBA_CACHE_DIR" not in said
    assert list(temporary.glob("diag_dynamics-*/*.nbc"))


def test_damaged_cache_is_made_anew(copy, tmp_path):
    """A file cut short, or filled with something else, costs a compilation and nothing more."""
    cache = tmp_path / "cache"
    run(copy, cache)
    for pattern, content in (("*.nbi", b""), ("*.nbc", b"not a pickle"), ("*.nbi", b"\x80")):
        files = list(cache.rglob(pattern))
        assert files
        for file in files:
            file.write_bytes(content)
        D, hits, said = run(copy, cache)
        assert (D, hits) == (13, 0)
        assert "unreadable" in said
        assert run(copy, cache)[1] >= 1


def test_a_full_disk_is_survived(copy, tmp_path):
    """A file that cannot be written to its end is no cache, and a warning says so; with room again there is one."""
    cache = tmp_path / "cache"
    full = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (4096, 4096))
    D, hits, said = run(copy, cache, begin=full)
    assert (D, hits) == (13, 0)
    assert "could not be saved" in said and "Traceback" not in said
    assert run(copy, cache)[:2] == (13, 0)
    assert run(copy, cache)[1] >= 1


def test_code_of_another_processor_is_not_used(copy, tmp_path):
    """A cache that was copied from another computer, or is shared with one, holds instructions that this one may not have."""
    cache, other = tmp_path / "cache", {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": "+sse2"}
    if os.uname().machine != "x86_64":
        pytest.skip("the other processor is a kind of x86-64")
    assert run(copy, cache, **other)[:2] == (13, 0)
    assert run(copy, cache)[:2] == (13, 0)
    for processor in ({}, other):  # each finds its own from then on
        D, hits, _ = run(copy, cache, **processor)
        assert D == 13 and hits >= 1


def test_processes_may_compile_together(copy, tmp_path):
    """Two that start with an empty cache compile twice and hurt neither each other nor who comes later."""
    cache = tmp_path / "cache"
    with ThreadPoolExecutor(2) as pool:
        for D, _, said in pool.map(lambda _: run(copy, cache), range(2)):
            assert D == 13 and "unreadable" not in said and "could not be saved" not in said
    D, hits, _ = run(copy, cache)
    assert D == 13 and hits >= 1


def test_compiled_code_may_call_first():
    """An entry kernel that compiled code has called, with arrays of its own, still takes what Python gives it."""

    @entry_kernel(VECTOR)
    def total(x):
        return x.sum()

    @numba.njit
    def doubled(x):
        return 2.0 * total(x)

    assert doubled(np.ones(3)) == 6.0
    assert total(np.ones(3)) == 3.0
    with pytest.raises(TypeError, match="argument type"):
        total(np.ones(3, np.int64))


# --- The stamp, and damage ----------------------------------------------------------------------------------


@pytest.mark.parametrize("room", ROOMS)
def test_an_edit_in_any_room_of_kernels_changes_the_stamp(tmp_path, room):
    folder = tmp_path / "diag_dynamics"
    shutil.copytree(PACKAGE, folder, ignore=shutil.ignore_patterns("__pycache__"))
    before = hash_of(folder)
    assert before == hash_of(PACKAGE)
    edited = sorted((folder / room).rglob("*.py"))[-1]
    edited.write_text(edited.read_text() + "\n")
    assert hash_of(folder) != before


def test_a_flipped_byte_that_unpickles_is_noticed(copy, tmp_path):
    """It lies in the machine code, where only a digest finds it."""
    cache = tmp_path / "cache"
    run(copy, cache)
    files = list(cache.rglob("*joint_inertias*.nbc"))
    assert files
    for file in files:
        content = bytearray(file.read_bytes())
        at = content.index(b"\x7fELF") + 4096
        content[at] ^= 0x10
        pickle.loads(bytes(content[64:]))
        file.write_bytes(content)
    D, hits, said = run(copy, cache)
    assert (D, hits) == (13, 0)
    assert "damaged" in said
    assert run(copy, cache)[1] >= 1


def test_files_of_another_format_are_no_damage(copy, tmp_path):
    """Those of an older version, whose digest was made otherwise: what they were called then, and what is in them."""
    cache, package = tmp_path / "cache", copy / "diag_dynamics"
    run(copy, cache)
    older = hashlib.sha256(str(package).encode()).hexdigest()[:16]
    for file in [*cache.rglob("*.nbi"), *cache.rglob("*.nbc")]:
        function, _, python = file.name.partition("-")
        of_older = file.with_name(f"{function}-{older}.{python.partition('.')[2]}")
        of_older.write_bytes(b"another digest.................." + file.read_bytes()[64:])
        if of_older != file:
            file.unlink()
    D, hits, said = run(copy, cache)
    assert (D, hits) == (13, 0) and "unreadable" not in said
    assert run(copy, cache)[1] >= 1


def test_code_of_another_processor_in_the_place_of_ones_own_is_stale(copy, tmp_path):
    """Two that share a folder have begun together: the index is of the one, the code of the other."""
    if os.uname().machine != "x86_64":
        pytest.skip("the other processor is a kind of x86-64")
    own, others = tmp_path / "own", tmp_path / "others"
    run(copy, own)
    run(copy, others, NUMBA_CPU_NAME="x86-64", NUMBA_CPU_FEATURES="+sse2")
    files = list(own.rglob("*.nbc"))
    assert files
    for file in files:
        shutil.copy(others / file.relative_to(own), file)
    D, hits, said = run(copy, own)
    assert (D, hits) == (13, 0) and "unreadable" not in said
    assert run(copy, own)[1] >= 1


# --- Plainly compiled ---------------------------------------------------------------------------------------


def test_a_full_disk_is_survived_plainly(copy, tmp_path):
    """And folders of other sources go when nobody has begun with them for long."""
    cache, plain = tmp_path / "cache", {"DIAG_DYNAMICS_PLAIN": "1"}
    full = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (4096, 4096))
    D, hits, said = run(copy, cache, begin=full, **plain)
    assert (D, hits) == (13, 0)
    assert "could not be saved" in said and "Traceback" not in said
    (used,) = (cache / "diag_dynamics").glob("plain-*")
    for name, age in (("plain-old", 40), ("plain-new", 20), ("else", 40)):
        folder = used.with_name(name)
        folder.mkdir()
        (folder / "code.nbc").write_text("")
        os.utime(folder, times=(time.time() - age * 86400,) * 2)
    os.utime(used, times=(0, 0))
    assert run(copy, cache, **plain)[:2] == (13, 0)
    assert run(copy, cache, **plain)[1] >= 1
    assert {path.name for path in used.parent.iterdir()} == {used.name, "plain-new", "else"}


# --- What is read, and what is written -----------------------------------------------------------------------


def test_what_is_read_only_is_read_and_not_written(two_links):
    """Results are arguments, and never where results go: compiled code would not look."""
    robot, q, shapes = two_links
    ones, zeros = np.ones(2), {name: np.zeros(shape) for name, shape in shapes.items()}
    ones.flags.writeable = False
    for array in zeros.values():
        array.flags.writeable = False
    v, M = zeros["v"], zeros["M"]
    calls = {
        "evaluate": (q, ones, ones, zeros["rows"]),
        "forward_dynamics": (q, ones, ones, v),
        "inverse_dynamics": (q, ones, ones, 1.0, v),
        "mass_matrix": (q, M),
        "factors": (q, zeros["factors"], v),
        "nu_from_qd": (q, ones, v),
        "tau_from_epsilon": (q, ones, v),
        "mass_matrix_rate": (q, ones, M, M),
        "coriolis_bracket": (q, ones, ones, v, v, v),
        "placement": (q, 1, zeros["placement"]),
    }
    for name, arguments in calls.items():
        sweep = getattr(sweeps, name)
        with pytest.raises(TypeError, match="argument type"):
            sweep(robot, *arguments)
        assert not any(array.any() for array in zeros.values()), name
        assert sweep(robot, *(zeros_like(x) if any(x is z for z in zeros.values()) else x for x in arguments)) == 0


def zeros_like(array):
    """Zeros of its shape, to write into."""
    return np.zeros(array.shape)


@pytest.fixture
def two_links():
    """Robot, positions, and shapes of what sweeps fill."""
    import diag_dynamics as dd
    from robots import TwoLinkArm

    model = dd.load_urdf(TwoLinkArm().urdf)
    workspace = sweeps.Workspace(model.bodies, model.gravity)
    q = np.zeros(2)
    q.flags.writeable = False
    yield workspace.robot, q, {"v": 2, "M": (2, 2), "rows": (sweeps.ROWS, 2), "factors": (3, 2, 2), "placement": (3, 4)}


# --- What is said meanwhile ----------------------------------------------------------------------------------

LONG = 120.0
"""How long anything may take [s]. Only a failing test waits so long."""


class Said(list):
    """Lines that are said, each with its time, and a wait for them."""

    def __init__(self):
        self._more = threading.Condition()

    def take(self, text):
        with self._more:
            self.append((time.perf_counter(), text))
            self._more.notify_all()

    def wait_for(self, what, count):
        """Wait until there are so many of what is compiled."""
        with self._more:
            assert self._more.wait_for(lambda: sum(text.split()[1] == what for _, text in self) >= count, LONG)


@pytest.fixture
def said(monkeypatch):
    """Lines that are said while something is compiled, in hundredths of the time that it takes else."""
    monkeypatch.setattr(progress, "PATIENCE", 0.02)
    monkeypatch.setattr(progress, "LEAST", 0.02)
    monkeypatch.setattr(progress, "EVERY", 0.05)
    monkeypatch.setattr(progress, "_teller", progress._Teller())
    lines = Said()
    progress.tell_by(lines.take)
    return lines


@contextmanager
def compiled(name):
    """A context in which something is compiled; when it is over, so are the threads that tell of it."""
    with progress.told(name):
        yield
    for thread in threading.enumerate():
        if thread.name == "compiling":
            thread.join(LONG)
            assert not thread.is_alive()


def is_line_of(line, what):
    """Whether a line says what is compiled, and no time before it has taken a second."""
    return re.fullmatch(re.escape(f"compiling {what}") + "(, for [1-9][0-9]* s by now)?", line)


def test_compiling_is_told_if_it_takes_long(said, monkeypatch):
    """What, how far, how long it takes as a rule, and for how long by now; a line now and then, none for what is quick."""
    with monkeypatch.context() as patient:
        patient.setattr(progress, "LEAST", LONG)  # a busy machine may take its time for nothing
        with compiled("quick"):
            pass
    assert not said
    begun = time.perf_counter()
    for item in progress.steps(["a", "b"]):
        with compiled(item):
            said.wait_for(item, 3 if item == "a" else 1)
    times, lines = zip(*said, strict=True)
    assert lines[0] == f"compiling a (1 of 2) {progress.RULE}" and "half a minute as a rule" in lines[0]
    assert not any(" 0 s" in line for line in lines)
    assert [line.split()[1:5] for line in lines] == sorted([line.split()[1:5] for line in lines])
    assert any(is_line_of(line, "b (2 of 2)") for line in lines)
    assert all(time - begun >= 0.02 + 0.05 * k for k, time in enumerate(times))
    with compiled("c"):
        said.wait_for("c", 1)
    assert is_line_of(said[-1][1], "c")
    progress._teller._last = -progress.EVERY
    start = time.perf_counter() - 6.8
    progress._teller.line("d", start)
    assert is_line_of(said[-1][1], "d")
    assert 7 <= int(said[-1][1].split()[3]) <= time.perf_counter() - start + 0.5


def test_without_a_listener_stderr_is_told(said, capsys, monkeypatch):
    on_stderr, over = progress.on_stderr, threading.Event()
    monkeypatch.setattr(progress, "on_stderr", lambda text: (on_stderr(text), over.set()))
    progress.tell_by(None)
    with progress.told("evaluate"):
        assert over.wait(LONG)
    assert capsys.readouterr().err.startswith(f"diag_dynamics: compiling evaluate {progress.RULE}\n")


def test_compiling_ahead(monkeypatch):
    """Every entry of the modules named, each told of before it is at hand; those of others are left."""
    asked, reported = [], []
    monkeypatch.setattr("diag_dynamics.compiled.ahead.ready", asked.append)
    compile_ahead("diag_dynamics.sweeps.classical", report=lambda *report: reported.append(report))
    names = [entry.__name__ for entry in asked]
    assert names[:2] == ["forward_dynamics", "inverse_dynamics"] and "mass_matrix" in names
    assert {entry.__module__ for entry in asked} == {"diag_dynamics.sweeps.classical"}
    count = len(names)
    assert reported == [*((name, k, count) for k, name in enumerate(names)), (None, count, count)]
    asked.clear()
    compile_ahead("diag_dynamics.sweeps")
    assert {"evaluate", "factors", "mass_matrix"} <= {entry.__name__ for entry in asked}
