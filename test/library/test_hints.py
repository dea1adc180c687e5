# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hints of errors and findings: each is followed, and then the command succeeds."""

import json
import re
from math import degrees

import numpy as np
import pytest

import desk_arm
from diag_dynamics.cli.main import main


@pytest.fixture
def analysed(tmp_path, capsys):
    """Return a function that analyses a motion: exit status, summary and what was printed."""
    (tmp_path / "desk.urdf").write_text(desk_arm.URDF)

    def run(columns, *options):
        table = desk_arm.write_table(tmp_path / "log.csv", *columns)
        summary = tmp_path / "summary.json"
        summary.unlink(missing_ok=True)
        arguments = [str(table), "--urdf", str(tmp_path / "desk.urdf"), "--json", str(summary)]
        status = main(["analyse", *arguments, *options])
        text = " ".join("".join(capsys.readouterr()).split())
        return status, json.loads(summary.read_text()) if summary.exists() else None, text

    return run


def weightless():
    """Return a motion whose efforts lack gravity, by Pinocchio."""
    return desk_arm.motion(20.0, gravity=(0.0, 0.0, 0.0))


PARAMETERS = {
    "unit": lambda: (*desk_arm.motion(20.0)[:3], 6.0 * desk_arm.motion(20.0)[3]),
    "sign": lambda: (*desk_arm.motion(20.0)[:3], -desk_arm.motion(20.0)[3]),
    "gravity": weightless,
}


@pytest.mark.parametrize("case", PARAMETERS)
def test_parameters_that_hints_name(analysed, case):
    columns = PARAMETERS[case]()
    status, summary, _ = analysed(columns)
    assert status == 1 and summary["explained"] < 0.8
    parameter, value = re.search(r"\((effort_\w+): '([^']+)'", summary["efforts"]["text"]).groups()
    status, summary, _ = analysed(columns, "--set", f"{parameter}={value}")
    assert status == 0 and summary["explained"] > 0.95


MAPS = {
    "times": lambda t, q, qd, tau: (1e3 * t, q, qd, tau),
    "positions": lambda t, q, qd, tau: (t, degrees(1.0) * q, qd, tau),
    "velocities": lambda t, q, qd, tau: (t, q, degrees(1.0) * qd, tau),
}


@pytest.mark.parametrize("case", MAPS)
def test_column_maps_that_hints_name(analysed, tmp_path, case):
    columns = MAPS[case](*desk_arm.motion(20.0))
    status, _, text = analysed(columns)
    hint = re.search(r"scale: \{[^}]+\}", text)[0]
    assert status > 0
    (tmp_path / "map.yaml").write_text(hint + "\n")
    status, summary, _ = analysed(columns, "--columns", str(tmp_path / "map.yaml"))
    assert status == 0 and summary["explained"] > 0.95


@pytest.mark.parametrize("limits", ["velocity", "position"])
def test_limits_that_excite_asks_for(tmp_path, capsys, limits):
    """The option with the joint's name and a number in place of the words in capitals."""
    lacking = {
        "velocity": ('velocity="6"', 'velocity="0"'),
        "position": ('upper="3"', 'upper="-3"'),
    }
    (tmp_path / "arm.urdf").write_text(desk_arm.URDF.replace(*lacking[limits]))
    command = ["excite", str(tmp_path / "arm.urdf"), "-o", str(tmp_path / "out.json")]
    command += ["--trials", "2"]
    assert main(command) == 2
    option, values = re.search(r"Give (--\S+) (JOINT=\S+)", capsys.readouterr().err).groups()
    numbers = {"LIMIT": "2", "LOWER": "-1", "UPPER": "1"}
    for word, value in numbers.items():
        values = values.replace(word, value)
    options = [f"{option}={values.replace('JOINT', name)}" for name in desk_arm.JOINTS]
    assert main([*command, *options]) == 0
    assert np.isfinite(json.loads((tmp_path / "out.json").read_text())["condition"])
