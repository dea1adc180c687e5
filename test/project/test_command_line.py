# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command line without ROS: what it lists, what it refuses, and compiling ahead."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pytest

from diag_dynamics.cli import compile as compiling
from diag_dynamics.cli.main import COMMANDS, main
from diag_dynamics.cli.ros import TOOLS
from diag_dynamics.nodes.support.start import EXECUTABLES

ROOT = Path(__file__).parents[2]


def run(*arguments, **environment):
    return subprocess.run(
        [sys.executable, "-m", "diag_dynamics", *arguments],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=300,
    )


def test_help_lists_every_command(capsys):
    for arguments in ([], ["--help"], ["help"]):
        assert main(arguments) == 0
        said = capsys.readouterr().out
        assert all(f"  {name} " in said for name in COMMANDS) and max(map(len, said.splitlines())) < 90


def test_every_executable_and_tool_is_a_command():
    """And each has a program in scripts/ or a module that runs it."""
    assert {name.replace("_", "-") for name in EXECUTABLES} | set(TOOLS) <= set(COMMANDS)
    for command in COMMANDS.values():
        module, _ = command.run.split(":")
        assert (ROOT / f"{module.replace('.', '/')}.py").exists()


@pytest.mark.parametrize(("typed", "meant"), [("monitr", "'monitor'"), ("topics", "'topic'"), ("xyz", "--help")])
def test_a_command_that_is_none(typed, meant, capsys):
    assert main([typed]) == 2
    said = capsys.readouterr().err
    assert f"'{typed}'" in said and meant in said


def test_without_ros(tmp_path):
    """What needs a ROS 2 says so in one line, and how to get one; the rest works."""
    (tmp_path / "sitecustomize.py").write_text("import sys; sys.modules['rclpy'] = None")
    path = f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    for command in (["monitor"], ["topic", "list"]):
        done = run(*command, PYTHONPATH=path)
        assert done.returncode == 1 and done.stderr.count("\n") == 1
        assert "needs a ROS 2" in done.stderr and "make setup" in done.stderr
    done = run("robots", PYTHONPATH=path)
    assert done.returncode == 0 and "panda_description/urdf/panda" in done.stdout.split()


def test_version():
    assert re.fullmatch(r"diag_dynamics \d+\.\d+\.\d+\n", run("--version").stdout)


def test_installed_under_its_name():
    """By pip under the name that `pyproject.toml` says; by colcon in bin/, which is on the PATH."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert 'diag-dynamics = "diag_dynamics.cli.main:main"' in text
    assert "install(PROGRAMS scripts/diag-dynamics DESTINATION bin)" in (ROOT / "CMakeLists.txt").read_text()
    for point in entry_points(group="console_scripts", name="diag-dynamics"):
        assert point.load() is main


def test_all_entry_kernels_are_compiled_ahead():
    """Every module with one is a unit; it takes some seconds, which its share of the bar says."""
    with_entries = {
        path.relative_to(ROOT / "diag_dynamics").with_suffix("").as_posix().replace("/", ".")
        for path in (ROOT / "diag_dynamics").rglob("*.py")
        if re.search(r"^@entry_kernel\(", path.read_text(encoding="utf-8"), re.M) and "compiled" not in path.parts
    }
    assert with_entries == set(compiling.UNITS)
    assert list(compiling.UNITS.values()) == sorted(compiling.UNITS.values(), reverse=True)


@pytest.fixture
def compiling_of(tmp_path):
    """Function that starts the program's `compile`, of some units, with an empty cache: all processes are told by Python."""

    def start(units, *arguments, **environment):
        (tmp_path / "sitecustomize.py").write_text(f"from diag_dynamics.cli import compile as c; c.UNITS = {units!r}")
        path = os.pathsep.join([str(tmp_path), str(ROOT), os.environ.get("PYTHONPATH", "")])
        return subprocess.Popen(
            [sys.executable, ROOT / "scripts/diag-dynamics", "compile", *arguments],
            env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": path} | environment,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    return start


def finished(process):
    """What a process has said when it, and all that it has started, have ended, and its status."""
    _, said = process.communicate(timeout=300)
    return said, process.returncode


SHORT = {name: compiling.UNITS[name] for name in ("sweeps.kinematics", "sweeps.motions")}


def test_compile_ahead(compiling_of, tmp_path):
    """Units are compiled in processes, into the cache; what is there is found; the progress reaches 100 %."""
    for _ in range(2):
        said, status = finished(compiling_of(SHORT, "--jobs", "2"))
        assert status == 0, said
        assert "100 %" in said and all(unit in said for unit in SHORT)
    kept = list((tmp_path / "diag_dynamics").glob("*.nbc"))
    assert len(kept) == 5  # placement, jacobian, motion, integrate, difference
    assert finished(compiling_of(SHORT, "--quiet")) == ("", 0)

    # A mark beside the code says that all was compiled, and no longer once a file is not what it was.
    assert finished(compiling_of(SHORT, "--if-needed")) == ("", 0)
    assert "100 %" in finished(compiling_of({"sweeps.motions": 1}, "--if-needed"))[0]
    assert finished(compiling_of({"sweeps.motions": 1}, "--if-needed")) == ("", 0)
    kept[0].unlink()
    for expected in ("100 %", ""):
        said, status = finished(compiling_of(SHORT, "--if-needed"))
        assert status == 0 and expected in said and bool(expected) == bool(said)
    assert kept[0].exists()


def test_a_unit_that_fails_is_named(compiling_of):
    said, status = finished(compiling_of({"sweeps.nowhere": 1}))
    assert status == 1 and "sweeps.nowhere: ModuleNotFoundError" in said
    said, status = finished(compiling_of({"sweeps.nowhere": 1}, "--if-needed"))
    assert status == 1


LONG = {"sweeps.motions": 1, "simulation.steps": 14, "sweeps.each": 9, "sweeps.many": 8}
"""Of which two are under way when the first is done."""


def compiled_kernels(folder):
    """Names of the kernels in a cache."""
    return {path.name.split("-")[0] for path in (folder / "diag_dynamics").glob("*.nbc")}


@pytest.mark.parametrize("everybody", [True, False])
def test_ctrl_c_ends_compiling(everybody, compiling_of, tmp_path):
    """In a terminal all processes get it; a launcher may send it to the first alone. What is under way is left."""
    process = compiling_of(LONG, "--jobs", "2")
    said = ""
    while "sweeps.motions" not in said:
        said += process.stderr.readline()
    if everybody:
        os.killpg(process.pid, signal.SIGINT)
    else:
        process.send_signal(signal.SIGINT)
    assert finished(process) == ("", 130)
    assert "motions.integrate" in compiled_kernels(tmp_path)
    assert "steps.advance" not in compiled_kernels(tmp_path)


def test_nobody_compiles_for_one_that_was_killed(compiling_of, tmp_path):
    process = compiling_of(LONG, "--jobs", "2")
    while "sweeps.motions" not in process.stderr.readline():
        pass
    process.kill()
    finished(process)  # those that it has started, too: they write where it does
    assert "motions.integrate" in compiled_kernels(tmp_path)
    assert "steps.advance" not in compiled_kernels(tmp_path)


def test_without_a_folder_nothing_is_compiled(compiling_of, tmp_path):
    (tmp_path / "file").touch()
    said, status = finished(compiling_of(SHORT, NUMBA_CACHE_DIR=str(tmp_path / "file")))
    assert status == 1 and "no folder to keep compiled code in" in said and "%" not in said


def test_wrong_jobs():
    done = run("compile", "--jobs", "0")
    assert done.returncode == 2 and "--jobs: 0 is not at least 1" in done.stderr


@pytest.mark.skipif(not shutil.which("cmake"), reason="only who builds the package has it")
def test_compiled_where_it_is_installed(tmp_path):
    """By CMake, at the end of an installation: what is installed, wherever that is; never where a package is made."""
    (tmp_path / "CMakeLists.txt").write_text(
        f"""
        cmake_minimum_required(VERSION 3.21)
        project(small NONE)
        set(PYTHON_INSTALL_DIR lib/python)
        set(Python3_EXECUTABLE "{sys.executable}")
        install(DIRECTORY diag_dynamics DESTINATION lib/python)
        include({ROOT}/cmake/compile_ahead.cmake)
        """
    )
    (tmp_path / "diag_dynamics").mkdir()
    (tmp_path / "diag_dynamics/__init__.py").touch()
    (tmp_path / "diag_dynamics/__main__.py").write_text(
        "import os, sys, diag_dynamics; print(sys.argv[1:], os.getcwd(), diag_dynamics.__file__)\n"
        "sys.exit(int(os.environ.get('STATUS', 0)))"
    )

    def cmake(*arguments, **environment):
        return subprocess.run(
            ["cmake", *map(str, arguments)],
            env=os.environ | environment,
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )

    build, place = tmp_path / "build", tmp_path / "elsewhere"
    cmake("-S", tmp_path, "-B", build, f"-DCMAKE_INSTALL_PREFIX={tmp_path}/configured")
    said = cmake("--install", build, "--prefix", place)
    assert f"['compile', '--if-needed', '--quiet'] {place} {place}/lib/python/diag_dynamics/__init__.py" in said.stdout
    assert "half a minute as a rule" in said.stdout and said.stderr == ""
    assert "could not be compiled ahead" in cmake("--install", build, "--prefix", place, STATUS="1").stderr
    for mark in ({"DESTDIR": str(tmp_path / "package")}, {"CONDA_BUILD": "1"}, {"HOME": str(tmp_path / "nowhere")}):
        assert "['compile'" not in cmake("--install", build, "--prefix", tmp_path / "made", **mark).stdout
    cmake("-S", tmp_path, "-B", build, "-DDIAG_DYNAMICS_COMPILE=OFF")
    assert "['compile'" not in cmake("--install", build, "--prefix", place).stdout


@pytest.mark.parametrize(
    ("number", "status", "word"), [(signal.SIGTERM, 143, "terminated"), (signal.SIGINT, 130, "interrupted")]
)
def test_analyse_that_is_ended_leaves_nothing(tmp_path, number, status, word):
    """No half of a file stays, what was there stays as it was, and what is not written is said."""
    count = 400_000
    t = np.arange(count)[:, None] * 1e-3
    q = 0.3 * np.sin(t * np.arange(1.0, 7.0))
    np.savez(
        tmp_path / "long.npz",
        time=t[:, 0],
        position=q,
        velocity=0.3 * np.arange(1.0, 7.0) * np.cos(t * np.arange(1.0, 7.0)),
    )
    written = {name: tmp_path / f"out.{name}" for name in ("mcap", "csv", "json")}
    written["csv"].write_text("of yesterday")
    options = [text for name, path in written.items() for text in (f"--{name}", str(path))]
    command = [
        sys.executable,
        "-m",
        "diag_dynamics",
        "analyse",
        str(tmp_path / "long.npz"),
        "--urdf",
        "ur5",
        "--quiet",
        *options,
    ]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    part = tmp_path / "out.mcap.part"
    while not (part.exists() and part.stat().st_size > 100_000):
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.01)
    process.send_signal(number)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == status
    assert f"diag-dynamics analyse: {word}; " in said and all(str(path) in said for path in written.values())
    assert "Traceback" not in said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["long.npz", "out.csv"]
    assert written["csv"].read_text() == "of yesterday"
