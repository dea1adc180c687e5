# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The examples run as they stand, in a folder that has nothing else."""

import json
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted((ROOT / "examples").glob("*.py"))
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))


@pytest.fixture(autouse=True)
def empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["example"])


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_script(script, capsys):
    """It runs to its end and says something, none of it NaN."""
    runpy.run_path(str(script), run_name="__main__")
    said = capsys.readouterr().out
    assert said.strip() and "nan" not in said.lower()


def test_there_are_a_dozen():
    assert len(SCRIPTS) >= 12 and len(NOTEBOOKS) == 1


def test_a_script_as_a_process():
    """It needs nothing but the package."""
    done = subprocess.run([sys.executable, ROOT / "examples/factors.py"], capture_output=True, text=True, check=True)
    errors = [float(line.split()[-1]) for line in done.stdout.splitlines()]
    assert len(errors) == 5 and max(errors) < 1e-12


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook(notebook):
    """Its cells run one after the other; it is kept without results, which would go stale."""
    pytest.importorskip("matplotlib", reason="matplotlib is not installed").use("agg")
    cells = [cell for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]
    assert cells and not any(cell["outputs"] for cell in cells)
    names = {}
    for k, cell in enumerate(cells):
        exec(compile("".join(cell["source"]), f"{notebook.name}, cell {k}", "exec"), names)
    assert abs(names["batch"].energy_share.sum(axis=1) - names["batch"].kinetic_energy).max() < 1e-9
