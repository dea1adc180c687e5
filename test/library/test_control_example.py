# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The program of docs/control.md, as it stands there."""

import re
from pathlib import Path

import numpy as np

import diag_dynamics as dd
from robots import robot_path


def test_documented_example_runs(tmp_path, monkeypatch):
    """Twenty lines that reach their target, K within its bound all the way, and no false alarm."""
    text = (Path(__file__).parents[2] / "docs" / "control.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"<!-- test: run -->\n```python\n(.*?)```", text, re.S)
    assert len([line for line in program.splitlines() if line.strip()]) == 20
    (tmp_path / "panda.urdf").write_text(robot_path("panda_description/urdf/panda.urdf").read_text())
    monkeypatch.chdir(tmp_path)
    energies = []

    class Recorded(dd.Simulation):
        def advance(self, tau):
            super().advance(tau)
            energies.append(0.5 * self.nu @ self.nu)

    monkeypatch.setattr(dd, "Simulation", Recorded)
    names = {}
    exec(compile(program, "docs/control.md", "exec"), names)
    assert len(energies) == 4000 and 0.45 < max(energies) < 1.001 * 0.5
    assert np.abs(names["command"].error.position).max() < 2e-3
    assert not names["seen"].collision and names["command"].limited == ()
