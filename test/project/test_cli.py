# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command line without ROS, called as a function: commands, exit status, outputs and errors.

`analyse` has a file of its own. Tests that start processes are of the full tier.
"""

import json
import os
import re
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib import util
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

import diag_dynamics as dd
from bags import urdf_of
from commands import quiet_compiler  # noqa: F401 (a fixture of all tests here)
from diag_dynamics.cli import compile as compiling
from diag_dynamics.cli.main import COMMANDS, LIBRARY, NODES, main
from diag_dynamics.inspection import CHECKS, SEVERITIES
from limits import HANG

ROOT = Path(__file__).parents[2]

XACRO = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="mass" default="1"/>
  <link name="base"/><link name="arm"><inertial><mass value="$(arg mass)"/><origin xyz="0 0 0.1"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="$(arg side)_turn" type="continuous"><parent link="base"/><child link="arm"/>
    <axis xyz="0 1 0"/>
    <limit effort="10" velocity="1"/></joint></robot>"""

MJCF = """<!-- an arm --><mujoco model="arm"><option gravity="0 0 -1.6"/><worldbody>
<body mocap="true"/><body>
  <joint name="turn" axis="0 1 0" armature="0.2" stiffness="1"/><geom size="0.1" pos="0 0 1"/>
    </body></worldbody></mujoco>"""

BARE = """<?xml version="1.0"?>
<robot name="bare"><link name="base"/>
  <link name="arm"><collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="9" velocity="1"/></joint></robot>"""

TRUTH = {
    "shoulder_pan_joint": dd.JointParameters(
        damping=4.0, friction=6.0, effort_offset=1.0, armature=2.0
    ),
    "elbow_joint": dd.JointParameters(damping=2.0, friction=3.0, effort_offset=-0.5, armature=0.9),
    "wrist_3_joint": dd.JointParameters(damping=0.3, friction=0.6, effort_offset=0.1, armature=0.1),
}


def write(path, names, columns):
    """Write a CSV; return the path."""
    np.savetxt(path, columns, delimiter=",", header=",".join(names), comments="", fmt="%.17g")
    return path


@pytest.fixture(scope="module")
def columns():
    """Names and columns of a UR5 with friction and rotors that its URDF lacks, without noise."""
    robot = dd.load_robot("ur5_robot").with_parameters(dd.Parameters(joints=TRUTH))
    motion = dd.excite(robot, "friction", trials=3, rate=40.0, velocity=0.8)
    names = ["t", *(f"{kind}_{name}" for kind in ("q", "qd", "tau") for name in robot.dof_names)]
    return names, np.column_stack([motion.time, motion.position, motion.velocity, motion.effort])


@pytest.fixture(scope="module")
def folder(columns, tmp_path_factory):
    """A folder with robots and recordings."""
    folder = tmp_path_factory.mktemp("cli")
    for name, text in (("arm.urdf.xacro", XACRO), ("arm.xml", MJCF), ("bare.urdf", BARE)):
        (folder / name).write_text(text)
    (folder / "sub").mkdir()
    for name, joint in (("still", "turn"), ("side=left", "left_turn"), ("panda", "panda_joint1")):
        rows = [[k / 100, 0.1, 0.0] for k in range(3)]
        write(folder / f"{name}.csv", ["t", f"q_{joint}", f"qd_{joint}"], rows)
    write(folder / "monday.csv", *columns)
    for name, factor in (("huge", 1e6), ("nan", np.nan), ("doubled", 2.0)):
        numbers = columns[1].copy()
        numbers[:, -6:] *= factor
        write(folder / f"{name}.csv", columns[0], numbers)
    return folder


@pytest.fixture
def run(capsys, folder, tmp_path, monkeypatch):
    """Run a command line in the folder of robots; return the exit status and both streams."""

    def command(line):
        words = line.format(tmp=tmp_path).split() if isinstance(line, str) else line
        try:
            status = main([*map(str, words)])
        except SystemExit as end:  # of argparse
            status = end.code
        return status, *capsys.readouterr()

    monkeypatch.chdir(folder)
    return command


# --- Commands


def test_help_lists_every_command(run):
    for arguments in ((), ("--help",), ("help",)):
        status, out, _ = run(arguments)
        assert status == 0 and max(map(len, out.splitlines())) < 90
        assert all(f"  {name} " in out for name in COMMANDS)
    for name in LIBRARY:
        status, out, _ = run([name, "--help"])
        assert status == 0 and f"usage: diag-dynamics {name}" in out
        assert ("exit status: 0" in out) == (
            name in ("analyse", "calibrate", "identify", "inspect")
        )
    assert all((ROOT / "scripts" / name).is_file() for name in NODES)
    assert re.fullmatch(r"diag_dynamics \d+\.\d+\.\d+\n", run("--version")[1])


def test_without_ros(run, monkeypatch):
    """Commands of ROS say in one line how to get one; the others work."""
    find = util.find_spec
    monkeypatch.setattr(
        util, "find_spec", lambda name, *rest: None if name == "rclpy" else find(name, *rest)
    )
    for command in ("monitor", "top"):
        status, _, error = run(command)
        assert status == 1
        assert error.count("\n") == 1
        assert "requires ROS 2" in error
        assert "make setup" in error
    status, out, _ = run("robots")
    assert status == 0 and "ur_description/urdf/ur5_robot" in out.split()


@pytest.mark.full
def test_a_process_without_ros(tmp_path):
    """The installed program in an environment where no module of ROS can be imported."""
    names = "rclpy", "sensor_msgs", "std_msgs", "builtin_interfaces", "rosidl_runtime_py"
    (tmp_path / "sitecustomize.py").write_text(
        f"import sys; sys.modules.update(dict.fromkeys({names!r}))"
    )
    (tmp_path / "x.csv").write_text(
        "t,q_a,qd_a\n" + "".join(f"{k / 100},0.1,0\n" for k in range(9))
    )
    (tmp_path / "arm.urdf").write_text(urdf_of("a"))
    path = os.pathsep.join([str(tmp_path), str(ROOT), os.environ.get("PYTHONPATH", "")])
    command = [
        sys.executable,
        "-m",
        "diag_dynamics",
        "analyse",
        "x.csv",
        "--urdf",
        "arm.urdf",
        "--json",
        "-",
    ]
    done = subprocess.run(
        command,
        env=os.environ | {"PYTHONPATH": path},
        cwd=tmp_path,
        capture_output=True,
        timeout=HANG,
    )
    assert done.returncode == 0 and json.loads(done.stdout)["states"] == 9
    assert 'diag-dynamics = "diag_dynamics.cli.main:main"' in (ROOT / "pyproject.toml").read_text()


# --- Errors

LATE = "--start 1000 --urdf"

REFUSED = [  # command line, message; the exit status is 2
    ("monitr", "there is no command 'monitr'. Is 'monitor' meant?"),
    ("robots all", "unrecognized arguments: all"),
    ("compile side:=left", "unrecognized arguments: side:=left"),
    ("inspect pandda", "robot 'pandda' is neither"),
    ("inspect nowhere.xml", "'nowhere.xml' is neither a file"),
    ("inspect talos", "'talos' is neither a file nor an example robot"),
    (f"inspect {5000 * 'x'}", "x' is neither a file nor"),
    (f"analyse {5000 * 'x'} {5000 * 'y'} --urdf panda --quiet", "File name too long"),
    ("inspect arm.urdf.xacro", "Give side:=VALUE"),
    ("inspect arm.urdf.xacro side:=a side:=b", "'side' is 'a' and 'b'; expected one value"),
    (
        "inspect panda side:=left",
        "'side:=left' is a xacro argument, but robot 'panda' is no .xacro file",
    ),
    ("analyse panda.csv --urdf panda --set max_agee=1", "'max_age' meant"),
    ("excite nobody -o {tmp}/x.json", "nobody"),
    ("excite panda", "output is missing; expected -o OUT.json"),
    ("excite panda -o /nowhere/x.json", "there is no folder '/nowhere'"),
    ("analyse", "recording is missing"),
    (
        "analyse side:=left side=left.csv",
        "a xacro argument, but --urdf is missing. Give --urdf FILE.xacro.",
    ),
    ("calibrate monday.csv --urdf ur5_robot", "-o/--output"),
    (
        "calibrate nan.csv --urdf ur5_robot -o {tmp}/a.yaml",
        "no state of the recording has efforts of all joints",
    ),
    ("identify monday.csv --urdf ur5_robot --what colour", "'colour'"),
    (
        "identify monday.csv --urdf ur5_robot --reference nan.csv -o nan.csv",
        "is an input. Choose another file",
    ),
    (
        "identify monday.csv --urdf ur5_robot --json /nowhere/q.json",
        "there is no folder '/nowhere'",
    ),
    (
        "identify monday.csv --urdf ur5_robot --set floating_base=true",
        "has a floating base",
    ),
    (
        "identify still.csv --urdf arm.xml --write-urdf {tmp}/new.urdf",
        "--write-urdf requires a URDF",
    ),
    ("identify nan.csv --urdf ur5_robot", "no state of the recording has efforts of all joints"),
    ("identify huge.csv --urdf ur5_robot", "Else set effort_scale"),
    *((f"{name} monday.csv {LATE} ur5_robot", "contains no ") for name in ("analyse", "identify")),
    (f"calibrate monday.csv -o {{tmp}}/a.yaml {LATE} ur5_robot", "contains no "),
]


@pytest.mark.parametrize(("line", "message"), REFUSED, ids=[line[:60] for line, _ in REFUSED])
def test_refused(line, message, run, folder, tmp_path):
    """One error, nothing on stdout, and no file is written or changed."""
    before = {path: path.stat().st_mtime_ns for path in folder.iterdir()}
    status, out, error = run(line)
    assert (status, out) == (2, "") and message in error and "Traceback" not in error
    assert "usage:" in error or error.count("\n") == 1 + line.endswith("--quiet")
    assert max(map(len, error.splitlines())) <= 1000
    assert {path: path.stat().st_mtime_ns for path in folder.iterdir()} == before and not list(
        tmp_path.iterdir()
    )


# --- The robot of a command

ROBOTS = [  # command line, status, text on either stream
    ("inspect arm.urdf.xacro side:=left mass:=2.5", 0, "mass     2.5 kg"),
    (
        "inspect arm.urdf.xacro side:=left msas:=2",
        0,
        "warning: The xacro argument 'msas' has no effect",
    ),
    ("inspect panda", 0, "mass     17.452 kg"),
    ("inspect ur5", 1, "warning  centre of mass outside of the geometry's bounding box"),
    ("inspect romeo_description/urdf/romeo", 2, "error    joints that move no inertia"),
    ("inspect arm.xml", 0, "omit: spring of joint 'turn'"),
    ("inspect side:=left arm.urdf.xacro", 0, "file     arm.urdf.xacro side:=left"),
    ("excite arm.urdf.xacro side:=left --range *=-1:1 --trials 1 -o {tmp}/x", 0, "left_turn"),
    ("analyse side:=left side=left.csv --urdf arm.urdf.xacro --json -", 0, '"states": 3'),
    ("identify side=left.csv --urdf arm.urdf.xacro side:=left", 2, "efforts of all joints"),
]


@pytest.mark.parametrize(
    ("line", "expected", "text"), ROBOTS, ids=[str(line)[:60] for line, *_ in ROBOTS]
)
def test_robots(line, expected, text, run):
    """A URDF, an MJCF, a name, and a xacro file with its arguments anywhere on the line, of every
    command.
    """
    status, out, error = run(line)
    assert status == expected and text in out + error


def test_mjcf_without_mujoco(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    status, out, error = run("inspect arm.xml")
    assert (status, out, error.count("\n")) == (2, "", 1) and "pip install mujoco" in error


# --- inspect


def test_inspect_for_programs(run):
    """The keys of the JSON are part of the interface."""
    status, out, _ = run("inspect bare.urdf --json")
    document = json.loads(out)
    assert status == document["status"] == 2 and document["source"] == "bare.urdf"
    assert set(document) == {"source", "status", "facts", "checks", "findings"}
    assert set(document["checks"]) == set(CHECKS)
    for finding in document["findings"]:
        assert set(finding) == {
            "severity",
            "check",
            "what",
            "links",
            "joints",
            "values",
            "unit",
            "remedy",
        }
        assert finding["severity"] in SEVERITIES and finding["check"] in CHECKS
    assert set(document["facts"]) == {
        "name",
        "links",
        "joints",
        "moving_joints",
        "degrees_of_freedom",
        "floating_base",
        "root_link",
        "total_mass",
        "mimic_joints",
        "coupled_groups",
        "locked_joints",
        "links_without_inertial",
        "frames",
        "poses",
        "kinetic_energy_at_velocity_limits",
    }
    assert [entry["joints"] for entry in document["findings"] if entry["check"] == "loading"] == [
        ["turn"]
    ]
    document = json.loads(run("inspect nowhere.urdf --json")[1])
    assert document["status"] == 2 and "neither a file" in document["error"]


# --- identify


def assert_report(page, quality):
    """A report has a drawing with curves of each joint, every parameter and every step, and loads
    nothing.
    """
    root = etree.HTML(page)
    tables = {table.findtext("thead/tr/th"): table for table in root.iter("table")}
    for name, (_, after) in quality["torque_rms"].items():
        (section,) = root.xpath(f"//section[starts-with(h3, '{name} ')]")
        assert f"{after:.3g}" in section.findtext("h3/span/b")
        assert section.xpath(".//svg")[0].xpath("path/@class") == [
            "zero",
            "before",
            "after",
            "measured",
        ]
        ticks = section.xpath("div[@class='times']/span/text()")
        assert ticks[0] == "0 s" and len(ticks) >= 3 and float(ticks[1]) > 0.0
        curves = section.xpath(".//path[not(@class='zero')]/@d")
        assert len(curves) == 5 and all(curve.count("L") > 100 for curve in curves)
    for name in TRUTH:
        (row,) = tables["joint"].xpath(f"tr[th='{name}']")
        half = 2.0 * quality["deviations"][name]["friction"]
        assert f"± {half:#.2g}" == row.xpath("td")[1].findtext("i")
        assert float(row.xpath("td")[1].text) == pytest.approx(TRUTH[name].friction, rel=0.05)
    heads = tables["steps"].xpath("thead/tr/th")[1:]
    assert [head.text for head in heads] == [
        "before",
        *(rung["steps"][-1] for rung in quality["ladder"][1:]),
    ]
    assert [row.findtext("td") for row in tables["steps"].xpath("tr")] == [
        "geometric mean",
        *quality["torque_rms"],
    ]
    assert [head.findtext("i") for head in heads] == [
        "start",
        *("accepted" if rung["taken"] else "rejected" for rung in quality["ladder"][1:]),
    ]
    assert tables["combination"].xpath("ancestor::details[not(@open)]")
    names = [row.findtext("td") for row in tables["combination"].xpath("tr")]
    assert names == [parameter["name"] for parameter in quality["base_parameters"]["parameters"]]
    assert not root.xpath("//script | //link[@href != 'data:,'] | //img")


def test_identify(run, tmp_path):
    """Files have what was found."""
    outputs = {
        "-o": "arm.yaml",
        "--json": "q.json",
        "--report": "page.html",
        "--write-urdf": "new.urdf",
    }
    options = " ".join(f"{option} {{tmp}}/{name}" for option, name in outputs.items())
    status, out, error = run(
        f"identify monday.csv --urdf ur5_robot --what friction,rotors {options}"
    )
    assert status == 0 and all(f"Wrote {tmp_path / name}" in error for name in outputs.values())
    assert "friction, rotors" in out.splitlines()[0]
    result = dd.Parameters.load(tmp_path / "arm.yaml")
    for name, truth in TRUTH.items():
        assert result.joints[name].armature == pytest.approx(truth.armature, rel=0.05)
    quality = json.loads((tmp_path / "q.json").read_text())
    assert all(after < max(0.3 * before, 0.05) for before, after in quality["torque_rms"].values())
    assert quality["explained"][1] > 0.99 and result.origin["recordings"][0]["path"] == "monday.csv"
    assert_report((tmp_path / "page.html").read_text(encoding="utf-8"), quality)
    dynamics = etree.parse(tmp_path / "new.urdf").xpath("//joint[@name='elbow_joint']/dynamics")[0]
    assert float(dynamics.get("friction")) == result.joints["elbow_joint"].friction


def test_report_of_two_files(run, tmp_path, columns):
    """The report shows where files begin, and errors relative to the range of the effort. The model
    lacks rotors.
    """
    write(tmp_path / "tuesday.csv", *columns)
    outputs = "--report {tmp}/page.html --json {tmp}/q.json"
    run(f"identify monday.csv {{tmp}}/tuesday.csv --urdf ur5_robot --what friction {outputs}")
    quality = json.loads((tmp_path / "q.json").read_text())
    root = etree.HTML((tmp_path / "page.html").read_text(encoding="utf-8"))
    (begin, *others) = root.xpath("//svg/line[@class='file']/@x1")
    assert float(begin.rstrip("%")) == pytest.approx(50.0, abs=1.0) and {*others} == {begin}
    (text,) = root.xpath("//p[contains(., 'beginnings of files')]")
    assert re.findall(r"(\w+)\.csv' ([\d.]+) s", "".join(text.itertext())) == [
        ("monday", "0.0"),
        ("tuesday", "20.0"),
    ]
    heads = {head.text.strip(): head.findtext("span/em") for head in root.iter("h3")}
    for name in ("shoulder_pan_joint", "elbow_joint"):
        effort = columns[1][:, columns[0].index(f"tau_{name}")]
        expected = 100.0 * quality["torque_rms"][name][1] / np.ptp(effort)
        assert 1.0 < float(heads[name].split()[0]) == pytest.approx(expected, rel=0.15)


def test_known_parameters(run, tmp_path):
    """With the true parameters no other improves the model, and none is lost."""
    dd.Parameters(joints=TRUTH).save(tmp_path / "arm.yaml")
    identified = (
        "--urdf ur5_robot --parameters {tmp}/arm.yaml --what friction -o {tmp}/after.yaml --json -"
    )
    status, out, _ = run(f"identify monday.csv {identified}")
    quality = json.loads(out)
    assert (status, quality["taken"]) == (0, [])
    assert dd.Parameters.load(tmp_path / "after.yaml").joints.items() >= TRUTH.items()


def test_parameters_hold_for_all_recordings(run):
    """Recordings after the first, and the reference: efforts of all are in half N m. The model
    lacks friction.
    """
    options = "--urdf ur5_robot --what payload:ee_link --set effort_scale=*=0.5 --json -"
    status, out, _ = run(f"identify doubled.csv doubled.csv {options} --reference doubled.csv")
    assert status == 1 and abs(json.loads(out)["payload"]["mass"]) < 0.05


# --- compile


def test_all_entry_kernels_are_compiled():
    """Every module with one is a unit."""
    with_entries = {
        path.relative_to(ROOT / "diag_dynamics").with_suffix("").as_posix().replace("/", ".")
        for path in (ROOT / "diag_dynamics").rglob("*.py")
        if re.search(r"^@((nk\.)?entry_kernel\(|Callback$)", path.read_text(encoding="utf-8"), re.M)
    }
    assert with_entries == set(compiling.UNITS)
    assert list(compiling.UNITS.values()) == sorted(compiling.UNITS.values(), reverse=True)


def test_compile_in_this_process(run, tmp_path, monkeypatch):
    """Progress reaches 100 %, a failure is named, --if-needed compiles other or lost code."""
    done = []
    monkeypatch.setattr(compiling, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(compiling, "UNITS", {"a": 3, "b": 1})
    monkeypatch.setattr(compiling, "compile_unit", done.append)
    monkeypatch.setattr(
        compiling, "ProcessPoolExecutor", lambda jobs, **_: ThreadPoolExecutor(jobs)
    )
    monkeypatch.setattr(compiling, "code_folder", lambda module: tmp_path)
    code = tmp_path / "kernel.nbc"
    code.touch()
    status, _, error = run("compile --jobs 1")
    assert status == 0 and "   75 %  a" in error and "100 %  b" in error and done == ["a", "b"]
    assert run("compile --if-needed") == (0, "", "") and done == ["a", "b"]
    code.unlink()
    assert run("compile --if-needed --quiet") == (0, "", "") and sorted(done[2:]) == ["a", "b"]
    monkeypatch.setattr(compiling, "UNITS", {"a": 3, "b": 1, "c": 1})
    assert run("compile --if-needed --quiet") == (0, "", "") and sorted(done[4:]) == ["a", "b", "c"]

    def failing(unit):
        raise ModuleNotFoundError(unit)

    monkeypatch.setattr(compiling, "compile_unit", failing)
    status, _, error = run("compile --jobs 1")
    assert status == 1 and "a: ModuleNotFoundError" in error
    monkeypatch.setattr(compiling, "cache_folder", lambda: None)
    status, _, error = run("compile")
    assert status == 1 and "no folder to keep compiled code in" in error and "%" not in error


LONG = {"sweeps.kinematics": 1, "simulation.steps": 14, "sweeps.batch": 9, "sweeps.classical": 8}
"""Units of which two are under way when the first is done."""


@pytest.mark.full
@pytest.mark.parametrize("end", ["all", "first", "killed"])
def test_a_signal_ends_compiling(end, tmp_path):
    """A terminal sends Ctrl-C to all processes, a launcher to the first one. All end; what was
    compiled is kept.
    """
    (tmp_path / "sitecustomize.py").write_text(
        f"from diag_dynamics.cli import compile as c; c.UNITS = {LONG!r}"
    )
    path = os.pathsep.join([str(tmp_path), str(ROOT), os.environ.get("PYTHONPATH", "")])
    process = subprocess.Popen(
        [sys.executable, ROOT / "scripts/diag-dynamics", "compile", "--jobs", "2"],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": path},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    while "sweeps.kinematics" not in process.stderr.readline():
        pass
    if end == "all":
        os.killpg(process.pid, signal.SIGINT)
    else:
        process.send_signal(signal.SIGINT if end == "first" else signal.SIGKILL)
    _, error = process.communicate(timeout=HANG)  # ends when all processes have closed stderr
    assert end == "killed" or (error, process.returncode) == (
        "diag-dynamics compile: interrupted.\n",
        130,
    )
    kernels = {path.name.split("-")[0] for path in (tmp_path / "diag_dynamics").rglob("*.nbc")}
    assert "kinematics.integrate" in kernels and "steps.advance" not in kernels


@pytest.mark.full
def test_compiled_where_it_is_installed(tmp_path):
    """By CMake, at the end of an installation: what is installed, wherever that is; never where a
    package is made.
    """
    (tmp_path / "CMakeLists.txt").write_text(
        f"""
        cmake_minimum_required(VERSION 3.21)
        project(small NONE)
        set(PYTHON_INSTALL_DIR lib/python)
        set(Python3_EXECUTABLE "{sys.executable}")
        install(DIRECTORY diag_dynamics DESTINATION lib/python)
        include("{ROOT}/cmake/compile_ahead.cmake")
        """
    )
    (tmp_path / "diag_dynamics").mkdir()
    (tmp_path / "diag_dynamics/__init__.py").touch()
    (tmp_path / "diag_dynamics/__main__.py").write_text(
        "import os, sys, diag_dynamics; print(sys.argv[1:], os.getcwd(), diag_dynamics.__file__)\n"
        "sys.exit(int(os.environ.get('STATUS', 0)))"
    )

    def cmake(*arguments, **environment):
        command = ["cmake", *map(str, arguments)]
        options = {"capture_output": True, "text": True, "check": True}
        return subprocess.run(command, env=os.environ | environment, cwd=tmp_path, **options)

    build = tmp_path / "build"
    place = tmp_path / "elsewhere"
    cmake("-S", tmp_path, "-B", build, f"-DCMAKE_INSTALL_PREFIX={tmp_path}/configured")
    printed = cmake("--install", build, "--prefix", place)
    assert (
        f"['compile', '--if-needed'] {place} {place}/lib/python/diag_dynamics/__init__.py"
        in printed.stdout
    )
    assert "about half a minute" in printed.stdout and printed.stderr == ""
    assert (
        "could not be compiled ahead"
        in cmake("--install", build, "--prefix", place, STATUS="1").stderr
    )
    for mark in (
        {"DESTDIR": str(tmp_path / "package")},
        {"CONDA_BUILD": "1"},
        {"HOME": str(tmp_path / "nowhere")},
    ):
        assert (
            "['compile'"
            not in cmake("--install", build, "--prefix", tmp_path / "made", **mark).stdout
        )
    cmake("-S", tmp_path, "-B", build, "-DDIAG_DYNAMICS_COMPILE=OFF")
    assert "['compile'" not in cmake("--install", build, "--prefix", place).stdout
