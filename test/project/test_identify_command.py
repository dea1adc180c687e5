# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics identify` and what it writes, on a simulated arm whose truth is known."""

import json
import re

import numpy as np
import pytest
from lxml import etree

import diag_dynamics as dd
from diag_dynamics.cli.main import main
from diag_dynamics.identification.exciting import excite
from diag_dynamics.views.identified import picture
from robots import robot_path

UR5 = robot_path("ur_description/urdf/ur5_robot.urdf")

TRUTH = {
    "shoulder_pan_joint": dd.JointParameters(damping=4.0, friction=6.0, effort_offset=1.0, armature=2.0),
    "elbow_joint": dd.JointParameters(damping=2.0, friction=3.0, effort_offset=-0.5, armature=0.9),
    "wrist_3_joint": dd.JointParameters(damping=0.3, friction=0.6, effort_offset=0.1, armature=0.1),
}


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A CSV of an arm with friction and rotors that its URDF does not know, without noise."""
    robot = dd.load_urdf(UR5).with_parameters(dd.Parameters(joints=TRUTH))
    motion = excite(robot, "friction", trials=3, rate=100.0, velocity=0.8)
    columns = [motion.time, *motion.position.T, *motion.velocity.T, *motion.effort.T]
    names = ["t", *(f"{kind}_{name}" for kind in ("q", "qd", "tau") for name in robot.dof_names)]
    path = tmp_path_factory.mktemp("identify") / "monday.csv"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=",".join(names), comments="", fmt="%.17g")
    return path


def test_writes_what_it_finds(recording, tmp_path, capsys):
    arm, quality, plots, urdf = (tmp_path / name for name in ("arm.yaml", "q.json", "page.png", "new.urdf"))
    options = ["-o", str(arm), "--json", str(quality), "--plots", str(plots), "--write-urdf", str(urdf)]
    assert main(["identify", str(recording), "--urdf", "ur5_robot", *options]) == 0
    out, err = capsys.readouterr()
    assert "friction, rotors" in out.splitlines()[0]
    assert "From " in out
    head = next(k for k, line in enumerate(out.splitlines()) if "damping" in line)
    assert "N m s/rad" in out.splitlines()[head + 1]
    assert all(f"Wrote {path}" in err for path in (arm, plots, urdf, quality))
    found = dd.Parameters.load(arm)
    for name, truth in TRUTH.items():
        one = found.joints[name]
        assert one.friction == pytest.approx(truth.friction, rel=0.03)
        assert one.damping == pytest.approx(truth.damping, rel=0.05)
        assert one.effort_offset == pytest.approx(truth.effort_offset, abs=0.03 * truth.friction)
        assert one.armature == pytest.approx(truth.armature, rel=0.05)
    told = json.loads(quality.read_text())
    for before, after in told["torque_rms"].values():
        assert after < max(0.3 * before, 0.05)
    assert told["explained"][1] > 0.99
    assert found.origin["recordings"][0]["path"] == str(recording)
    assert plots.read_bytes().startswith(b"\x89PNG")
    text = urdf.read_text()
    dynamics = etree.fromstring(text.encode()).xpath("//joint[@name='elbow_joint']/dynamics")[0]
    assert float(dynamics.get("friction")) == found.joints["elbow_joint"].friction
    assert "monday.csv" in text


def test_goes_on_from_what_is_known(recording, tmp_path, capsys):
    """With what was found as --parameters there is nothing left to take, and nothing of it is lost."""
    arm, after, urdf = tmp_path / "arm.yaml", tmp_path / "after.yaml", tmp_path / "after.urdf"
    assert main(["identify", str(recording), "--urdf", "ur5_robot", "-o", str(arm), "--quiet"]) == 0
    capsys.readouterr()
    again = [
        "identify",
        str(recording),
        "--urdf",
        "ur5_robot",
        "--parameters",
        str(arm),
        "--what",
        "rotors",
        "-o",
        str(after),
        "--write-urdf",
        str(urdf),
        "--json",
        "-",
    ]
    assert main(again) == 1
    told = json.loads(capsys.readouterr().out)
    assert (told["taken"], told["shared"]) == ([], [])
    before = dd.Parameters.load(arm).joints
    assert dd.Parameters.load(after).joints == before
    model = dd.load_urdf(urdf)
    for name, one in before.items():
        assert model.friction[model.dof_names.index(name)] == one.friction


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--what", "colour"], "'colour'"),
        (["--urdf", "nobody"], "nobody"),
        (["-o", "{recording}"], "is read, so nothing is written there"),
        (["--json", "/nowhere/q.json"], "there is no folder '/nowhere'"),
        (["--start", "1000"], "has not a single state"),
        (["--set", "floating_base=true"], "a floating base is not identified"),
    ],
)
def test_errors(recording, options, message, capsys):
    options = [one.format(recording=recording) for one in options]
    before = recording.read_bytes()
    assert main(["identify", str(recording), *(() if "--urdf" in options else ("--urdf", "ur5_robot")), *options]) == 2
    assert message in capsys.readouterr().err
    assert recording.read_bytes() == before


@pytest.mark.parametrize(
    ("factor", "message"),
    [
        (1e6, r"no efforts, for those of \d+ states are beyond what can be .* are they in N m\?"),
        (np.nan, "no efforts, or in no state one of every joint"),
    ],
)
def test_tells_why_there_are_no_efforts(recording, tmp_path, factor, message, capsys):
    """A wrong unit, or one joint without: the file has a column of efforts, and it would be wrong to say that it has none."""
    names = recording.read_text().splitlines()[0]
    columns = np.loadtxt(recording, delimiter=",", skiprows=1)
    columns[:, names.split(",").index("tau_elbow_joint")] *= factor
    wrong = tmp_path / "wrong.csv"
    np.savetxt(wrong, columns, delimiter=",", header=names, comments="")
    for command in (["identify"], ["calibrate", "-o", str(tmp_path / "a.yaml")]):
        assert main([command[0], str(wrong), "--urdf", "ur5_robot", *command[1:]]) == 2
        assert re.search(message, capsys.readouterr().err)


def table_of(path):
    """Names and columns of a CSV, (T, n)."""
    return path.read_text().splitlines()[0], np.loadtxt(path, delimiter=",", skiprows=1)


def test_a_reference_is_read_by_the_same_parameters(recording, tmp_path, capsys):
    """Efforts of both in half N m: without --set the units of the reference alone would be refused."""
    names, columns = table_of(recording)
    columns[:, [k for k, name in enumerate(names.split(",")) if name.startswith("tau_")]] *= 2.0
    doubled = tmp_path / "doubled.csv"
    np.savetxt(doubled, columns, delimiter=",", header=names, comments="")
    options = ["--what", "payload:ee_link", "--set", "effort_scale=*=0.5", "--json", "-"]
    command = ["identify", str(doubled), "--urdf", "ur5_robot", *options, "--reference", str(doubled)]
    assert main(command) == 0
    assert abs(json.loads(capsys.readouterr().out)["payload"]["mass"]) < 0.05


def test_plots_of_two_runs_are_one_behind_the_other(recording, tmp_path, monkeypatch):
    """A file whose stamps begin anew in the middle: no curve goes back, and what is held out is its end."""
    figures = []
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, *_, **__: figures.append(figure))
    names, columns = table_of(recording)
    twice = tmp_path / "twice.csv"
    np.savetxt(twice, np.vstack([columns, columns]), delimiter=",", header=names, comments="", fmt="%.17g")
    assert main(["identify", str(twice), "--urdf", "ur5_robot", "--plots", str(tmp_path / "x.png"), "--quiet"]) == 0
    whole = 2.0 * (columns[-1, 0] - columns[0, 0])
    for axes in figures[0].axes[:6]:
        (held_out,) = axes.patches
        assert held_out.get_x() == pytest.approx(2.0 / 3.0 * whole, rel=0.02)
        for line in axes.lines[:2]:
            time, values = line.get_data()
            assert (np.diff(time) >= 0.0).all() and time[-1] == pytest.approx(whole, rel=0.02)
            assert np.isnan(values).sum() < 10
            assert held_out.get_x() + held_out.get_width() == pytest.approx(time[-1])


def test_every_column_of_plots_has_its_times_and_a_unit(tmp_path, monkeypatch):
    """Of an odd number of joints, too, where the right column ends a row earlier."""
    figures = []
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, *_, **__: figures.append(figure))
    names = ("a", "b", "c")
    torques = [np.zeros((4, 3))] * 2
    picture(tmp_path / "x.png", "three", np.arange(4.0), torques, dict.fromkeys(names, (1.0, 0.5)), (2.0, 3.0))
    a, b, c, _ = figures[0].axes
    assert [axes.get_xlabel() for axes in (a, b, c)] == ["", "time [s]", "time [s]"]
    assert [axes.get_ylabel() for axes in (a, c)] == ["N m, N"] * 2
