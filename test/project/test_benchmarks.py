# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The benchmarks in their short form run, and compare outputs before they measure. No test reads a time."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytestmark = [pytest.mark.full]

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
WRITTEN = {
    "library": {"table.md", "dof.png", "growth.png", "batch.png"},
    "alarms": {"alarms.md"},
    "contact": {"contacts.md", "contact_limit.md"},
    "observer": {"observer.md", "observer.png"},
}


def run(folder, *arguments):
    path = os.pathsep.join([str(BENCHMARKS.parent), str(BENCHMARKS), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, cwd=folder, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True)


@pytest.mark.parametrize("part", WRITTEN)
def test_short_form_writes_results(part, tmp_path, compiled):
    done = run(tmp_path, BENCHMARKS / "run.py", "--short", "--only", part, "--output", tmp_path / "results")
    assert done.returncode == 0, done.stderr
    assert WRITTEN[part] <= {path.name for path in (tmp_path / "results").iterdir()}
    assert part != "library" or re.search(r"outputs of \d+ robots agree to \de-\d\d", done.stderr)


@pytest.mark.live
@pytest.mark.ros
def test_short_form_of_the_nodes_writes_results(ros_domain, tmp_path):
    done = run(tmp_path, BENCHMARKS / "run.py", "--short", "--only", "nodes", "--output", tmp_path / "results")
    assert done.returncode == 0, done.stderr
    assert {"nodes.md", "nodes_latency.png", "nodes_rates.png"} <= {
        path.name for path in (tmp_path / "results").iterdir()
    }


@pytest.mark.parametrize("call", ["aba", "aba_default", "dense_evaluate", "dense_factors"])
def test_disagreement_ends_the_run_before_anything_is_timed(call, tmp_path, compiled):
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
    done = run(tmp_path, "-c", script, "--short", "--only", "library")
    assert done.returncode != 0
    assert re.search(r"outputs disagree: kinova: .* differs by", done.stderr)
    assert "measures" not in done.stderr


def test_outputs_agree_within_a_tolerance(monkeypatch):
    monkeypatch.syspath_prepend(BENCHMARKS)
    from agreement import TOLERANCE, DisagreementError, compare

    x = np.array([1.0, -2.0, 3.0])
    assert compare("robot", "x", x, x) == 0.0
    assert compare("robot", "x", x * (1 + 0.5 * TOLERANCE), x) > 0.0
    for wrong in (x * (1 + 2 * TOLERANCE), x[::-1], np.array([1.0, np.nan, 3.0]), x * np.inf, x[:2]):
        with pytest.raises(DisagreementError):
            compare("robot", "x", wrong, x)
