# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The control study: its page has the tables of its data, and its short form finds what the laws
promise.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
DATA = json.loads((BENCHMARKS / "results" / "study.json").read_text(encoding="utf-8"))


def test_page_and_tables_agree_with_the_data(monkeypatch):
    monkeypatch.syspath_prepend(BENCHMARKS)
    import study_page

    text = study_page.PAGE.read_text(encoding="utf-8")
    assert text.count("<!-- study: ") == 3 and study_page.filled(text, DATA) == text
    assert study_page.details(DATA) == (BENCHMARKS / "results" / "study.md").read_text(
        encoding="utf-8"
    )


@pytest.mark.full
def test_short_form(tmp_path):
    command = [sys.executable, BENCHMARKS / "study.py", "--short", "--output", tmp_path]
    path = os.pathsep.join([str(BENCHMARKS.parent), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        command, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert {"study.md", "study_ratios.png", "study_contests.png"} <= {
        path.name for path in tmp_path.iterdir()
    }
    data = json.loads((tmp_path / "study.json").read_text(encoding="utf-8"))
    (damping,), (ratios,), (energies,) = (data[key] for key in ("damping", "ratios", "energies"))
    nu = damping["laws"]["ν, 5"]
    np.testing.assert_allclose(
        [*nu["rate"], *nu["cost"]], 1.0, atol=0.01
    )  # held torques: c·period / 2
    assert ratios["laws"]["ζ law"] == [0.7] * 20
    assert energies["laws"]["joints, observer"]["joint"] < 1.25 < energies["laws"]["sum"]["joint"]
    full = {(entry["robot"], entry["law"], entry["task"]): entry for entry in DATA["contests"]}
    for entry in data["contests"]:
        expected = full[entry["robot"], entry["law"], entry["task"]]
        assert entry["scale"] == pytest.approx(expected["scale"], rel=1e-3)
        for condition, row in entry["figures"].items():
            assert row == pytest.approx(expected["figures"][condition], rel=0.02, abs=0.02)
