# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics inspect`: its exit status, what it prints for people and for machines, and the file that it writes."""

import json
import re
from pathlib import Path

import pytest
from test_command_line import run

import diag_dynamics as dd
from diag_dynamics.cli.inspect import STATUS
from diag_dynamics.cli.main import main
from diag_dynamics.inspection import CHECKS, SEVERITIES

BARE = """<?xml version="1.0"?>
<robot name="bare">
  <link name="base"/>
  <link name="arm">
    <collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision>
  </link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="9" velocity="1"/>
  </joint>
</robot>
"""


@pytest.fixture
def inspect(capsys):
    """Function that runs the command in this process; it returns the exit status and what was said on both streams."""

    def command(*arguments):
        try:
            status = main(["inspect", *map(str, arguments)])
        except SystemExit as end:  # of argparse
            status = end.code
        return status, *capsys.readouterr()

    return command


@pytest.fixture
def bare(tmp_path):
    path = tmp_path / "bare.urdf"
    path.write_text(BARE)
    return path


def test_help_says_the_exit_status():
    done = run("inspect", "--help")
    assert done.returncode == 0 and STATUS in done.stdout
    for option in ("--json", "--floating-base", "--estimate-inertias DENSITY", "-o NEW.urdf", "ROBOT"):
        assert option in done.stdout


@pytest.mark.parametrize(
    ("robot", "status", "said"),
    [
        ("panda", 0, "mass     17.452 kg"),
        ("ur5", 1, "warning  centre of mass outside of the geometry's bounding box"),
        ("romeo_description/urdf/romeo", 2, "error    joints that move no inertia"),
    ],
)
def test_for_people(robot, status, said):
    """By the names that load_robot knows; within 80 columns, the worst first."""
    done = run("inspect", robot)
    assert done.returncode == status and done.stderr == ""
    lines = done.stdout.splitlines()
    assert said in done.stdout and max(map(len, lines)) <= 80
    found = [line.split()[0] for line in lines if re.match(r"(?:ok|note|warning|error) ", line)]
    assert [SEVERITIES.index(one) for one in found] == sorted((SEVERITIES.index(one) for one in found), reverse=True)
    assert re.search(r"\n\d+ errors?, \d+ warnings?, \d+ notes?\n$", done.stdout)


def test_for_machines(bare):
    """The same in JSON, whose keys stay."""
    done = run("inspect", str(bare), "--json")
    document = json.loads(done.stdout)
    assert done.returncode == document["status"] == 2 and document["source"] == str(bare)
    assert set(document) == {"source", "status", "facts", "checks", "findings"} and set(document["checks"]) == set(
        CHECKS
    )
    for finding in document["findings"]:
        assert set(finding) == {"severity", "check", "what", "links", "joints", "values", "unit", "remedy"}
        assert finding["severity"] in SEVERITIES and finding["check"] in CHECKS
    assert set(document["facts"]) == {
        *("name", "links", "joints", "moving_joints", "degrees_of_freedom", "floating_base", "root_link", "total_mass"),
        *("mimic_joints", "coupled_groups", "locked_joints", "links_without_inertial", "frames", "poses"),
        *("condition_of_mass_matrix", "kinetic_energy_at_velocity_limits", "tips"),
    }
    loading = [finding for finding in document["findings"] if finding["check"] == "loading"]
    assert [finding["joints"] for finding in loading] == [["turn"]]


def test_estimates_are_written(bare, tmp_path, inspect):
    """To a new file, which says so; the source stays as it is, and so does any file that is there."""
    new = tmp_path / "new.urdf"
    status, said, _ = inspect(bare, "--estimate-inertias", 1000, "-o", new)
    assert status == 0 and "arm: 6 kg, estimated from collision box" in said
    assert bare.read_text() == BARE
    text = new.read_text(encoding="utf-8")
    assert text.startswith("<?xml") and "<!-- estimated by diag_dynamics from collision box at 1000 kg/m3 -->" in text
    with pytest.warns(dd.InertiaWarning):
        model = dd.load_urdf(bare, estimate_inertias=1000.0)
    assert model.bodies.tobytes() == dd.load_urdf(new).bodies.tobytes()
    assert inspect(new)[0] == 0

    for output in (new, bare):
        before = output.read_text()
        status, _, said = inspect(bare, "--estimate-inertias", 500, "-o", output)
        assert status == 2 and "not overwritten" in said and output.read_text() == before
    status, _, said = inspect(new, "--estimate-inertias", 500, "-o", tmp_path / "none.urdf")
    assert status == 1 and "nothing to estimate" in said and not (tmp_path / "none.urdf").exists()


def test_estimates_for_machines(bare, tmp_path, inspect):
    mesh = '<link name="base"><visual><geometry><mesh filename="x.stl"/></geometry></visual></link>'
    bare.write_text(BARE.replace('<link name="base"/>', mesh))
    status, said, _ = inspect(bare, "--estimate-inertias", 1000, "-o", tmp_path / "new.urdf", "--json")
    document = json.loads(said)
    assert status == 1 and set(document) == {"written", "density", "estimated", "failed"}
    (arm,) = document["estimated"]
    assert set(arm) == {"link", "mass", "centre", "inertia", "from"} and arm["mass"] == pytest.approx(6.0)
    assert list(document["failed"]) == ["base"] and Path(document["written"]).is_file()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["pandda"], "did you mean panda"),
        (["nowhere.urdf"], "no such file"),
        (["panda", "--estimate-inertias", "1000"], "belong together"),
        (["panda", "-o", "new.urdf"], "belong together"),
        (["panda", "--estimate-inertias", "-5", "-o", "new.urdf"], "estimate_inertias is -5.0"),
        (["panda", "--estimate-inertias", "light", "-o", "new.urdf"], "invalid float value"),
        ([], "ROBOT"),
    ],
)
def test_what_is_refused(arguments, said, inspect):
    status, out, error = inspect(*arguments)
    assert status == 2 and said in error and out == ""


def test_no_robot_for_machines(inspect):
    document = json.loads(inspect("nowhere.urdf", "--json")[1])
    assert document["status"] == 2 and "no such file" in document["error"]


def test_xacro(tmp_path, inspect):
    pytest.importorskip("xacro", reason="xacro is not installed")
    path = tmp_path / "bare.urdf.xacro"
    text = BARE.replace('name="bare"', 'name="bare" xmlns:xacro="http://www.ros.org/wiki/xacro"')
    path.write_text(text.replace('"0.1 0.2 0.3"', '"${0.1} 0.2 0.3"'))
    assert "joints that move no inertia" in inspect(path)[1]
    status, _, _ = inspect(path, "--estimate-inertias", 1000, "-o", tmp_path / "new.urdf")
    assert status == 0 and dd.load_urdf(tmp_path / "new.urdf").total_mass == pytest.approx(6.0)
