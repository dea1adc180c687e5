"""The benchmarks in their short form: outputs are compared, every ratio is computed. Never a time."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

if os.environ.get("DIAG_DYNAMICS_REQUIRE_ROS") != "1":  # where everything is installed, they have to be here
    pytest.importorskip("mujoco", reason="mujoco is not installed: a peer of the benchmarks is missing")
    pytest.importorskip("matplotlib", reason="matplotlib is not installed: the benchmarks cannot draw")

ROOT = Path(__file__).parents[1]
BENCHMARKS = ROOT / "benchmarks"
PLOTS = ("dof.png", "growth.png", "batch.png")

# What the project has targets for, as the lines of the table begin.
TARGETS = [
    ("`evaluate`", "`pin.aba`", "6–9 dof", 0.9),
    ("`evaluate`", "`pin.aba`", "29–50 dof", 0.6),
    ("`evaluate`", "NumPy and Pinocchio route", "all robots", 0.1),
    ("`forward_dynamics`", "`pin.aba`", "6–50 dof", 0.7),
    ("`factors`", "`crba`", "6–50 dof", 0.5),
    ("`evaluate_batch` per state", "`pin.abaInParallel`", "6–9 dof", 0.4),
    ("`Simulation.advance` per step", "Python loop", "panda", 0.15),
    ("growth", "exponent", "serial chains, balanced trees", 1.05),
    ("allocations of compiled code", "each further one", "7 dof", 0.001),
    ("memory of `evaluate_stream`", "that of", "7 dof", 1.1),
    ("import to first result", "`import numba` + `import yourdfpy`", "panda", 1.3),
]


def run(folder, *arguments):
    """Run Python with the benchmarks to be imported, in a folder where it may leave what it likes."""
    path = os.pathsep.join(filter(None, (str(ROOT), str(BENCHMARKS), os.environ.get("PYTHONPATH"))))
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(
        command, cwd=folder, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, timeout=600
    )


def summary(path):
    """The table between the markers of a file, as text."""
    return re.search("<!-- benchmarks: begin -->\n(.*)<!-- benchmarks: end -->", path.read_text("utf-8"), re.S)[1]


def cells(table):
    """The lines of a table below its head."""
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]


def check(table):
    """Every target has its line in the order of the targets, every ratio is a number, and verdicts are right."""
    judged = []
    for subject, peer, over, target, median, worst, verdict in cells(table):
        median, worst = float(median), float(worst.split(" ")[0])
        assert np.isfinite([median, worst]).all()
        assert 0.0 <= median <= worst
        assert median > 0.0 or subject.startswith("allocations")
        assert bool(target) == bool(verdict)
        if target:
            limit = float(target.removeprefix("≤ "))
            judged.append((subject, peer, over, limit))
            if abs(worst - limit) > 0.01:  # else the table does not show enough digits to tell
                assert verdict == ("met" if worst <= limit else "missed")
    assert len(judged) == len(TARGETS)
    for (*shown, limit), (*expected, target) in zip(judged, TARGETS, strict=True):
        assert limit == target
        assert all(text.startswith(begin) for text, begin in zip(shown, expected, strict=True)), shown


def test_short_form(tmp_path, compiled):
    before = {path: path.stat().st_mtime_ns for path in (ROOT / "README.md", *(BENCHMARKS / "results").glob("*"))}
    done = run(tmp_path, BENCHMARKS / "run.py", "--short", "--output", tmp_path / "results")
    assert done.returncode == 0, done.stderr
    assert re.search(r"outputs of \d+ robots agree to \de-\d\d", done.stderr)
    table = summary(tmp_path / "results" / "table.md")
    assert table in done.stdout
    check(table)
    for plot in PLOTS:
        assert (tmp_path / "results" / plot).read_bytes().startswith(b"\x89PNG")
    assert before == {path: path.stat().st_mtime_ns for path in before}


@pytest.mark.parametrize("call", ["aba", "aba_default", "dense_evaluate", "dense_factors"])
def test_disagreement_is_an_error_before_anything_is_timed(call, tmp_path, compiled):
    script = f"""
import peers, run
calls = peers.Pinocchio.calls
def wrong(*arguments):
    exact = calls(*arguments)
    def perturbed():
        result = exact["{call}"]()
        (result[0] if isinstance(result, tuple) else result)[...] *= 1.0 + 1e-7
        return result
    return exact | {{"{call}": perturbed}}
peers.Pinocchio.calls = wrong
run.main()
"""
    done = run(tmp_path, "-c", script, "--short")
    assert done.returncode != 0
    assert re.search(r"outputs disagree: kinova: .* differs by", done.stderr)
    assert "measures" not in done.stderr
    assert "|" not in done.stdout


def test_what_is_compared(monkeypatch):
    monkeypatch.syspath_prepend(BENCHMARKS)
    from agreement import TOLERANCE, DisagreementError, compare

    x = np.array([1.0, -2.0, 3.0])
    assert compare("robot", "x", x, x) == 0.0
    assert compare("robot", "x", x * (1 + 0.5 * TOLERANCE), x) > 0.0
    for wrong in (x * (1 + 2 * TOLERANCE), x[::-1], np.array([1.0, np.nan, 3.0]), x * np.inf):
        with pytest.raises(DisagreementError, match=r"^robot: x differs by"):
            compare("robot", "x", wrong, x)
    with pytest.raises(DisagreementError, match="x has shape"):
        compare("robot", "x", x[:2], x)


def test_a_file_is_no_folder_to_write_into(tmp_path):
    file = tmp_path / "file"
    file.touch()
    done = run(tmp_path, BENCHMARKS / "run.py", "--short", "--output", file)
    assert done.returncode == 2
    assert "file is not a folder" in done.stderr


def test_readme_shows_what_was_measured():
    table = summary(ROOT / "README.md")
    assert table == summary(BENCHMARKS / "results" / "table.md")
    check(table)
    for plot in PLOTS:
        assert (BENCHMARKS / "results" / plot).is_file()
