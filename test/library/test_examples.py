# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The examples run as they stand, in an empty folder."""

import json
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(autouse=True)
def empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["example"])


@pytest.mark.parametrize("script", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.stem)
def test_script(script, capsys):
    """It prints something, and no NaN."""
    runpy.run_path(str(script), run_name="__main__")
    output = capsys.readouterr().out
    assert output.strip() and "nan" not in output.lower()
    if script.stem == "factors":
        errors = [float(line.split()[-1]) for line in output.splitlines()]
        assert len(errors) == 5 and max(errors) < 1e-12


def test_notebook():
    """Its cells run one after the other; it is kept without outputs."""
    pytest.importorskip("matplotlib", reason="matplotlib is not installed").use("agg")
    cells = json.loads((EXAMPLES / "first_steps.ipynb").read_text(encoding="utf-8"))["cells"]
    names = {}
    for k, cell in enumerate(cell for cell in cells if cell["cell_type"] == "code"):
        assert not cell["outputs"]
        exec(compile("".join(cell["source"]), f"cell {k}", "exec"), names)
    batch = names["batch"]
    np.testing.assert_allclose(batch.energy_share.sum(axis=1), batch.kinetic_energy, rtol=0.0, atol=1e-9)
