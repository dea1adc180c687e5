# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command line without ROS, called as a function: commands, exit status, outputs and errors.

`analyse` has a file of its own. What starts processes is of the full tier.
"""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stderr, redirect_stdout
from importlib import util
from importlib.metadata import entry_points
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

import diag_dynamics as dd
from bags import urdf_of
from commands import quiet_compiler  # noqa: F401 (a fixture of all tests here)
from diag_dynamics.cli import compile as compiling
from diag_dynamics.cli.inspect import STATUS
from diag_dynamics.cli.main import COMMANDS, main
from diag_dynamics.cli.ros import TOOLS
from diag_dynamics.inspection import CHECKS, SEVERITIES
from diag_dynamics.nodes.support.start import EXECUTABLES
from diag_dynamics.views.identified import picture

ROOT = Path(__file__).parents[2]


@pytest.fixture
def run(capsys):
    """Run a command in this process; return the exit status and what it said on both streams."""

    def command(*arguments):
        try:
            status = main([*map(str, arguments)])
        except SystemExit as end:  # of argparse
            status = end.code
        return status, *capsys.readouterr()

    return command


# --- Commands ---


def test_help_lists_every_command(run):
    """Executables and tools of ROS 2 among them; each has a module that runs it, and help of its own."""
    assert {name.replace("_", "-") for name in EXECUTABLES} | set(TOOLS) <= set(COMMANDS)
    for arguments in ((), ("--help",), ("help",)):
        status, said, _ = run(*arguments)
        assert status == 0 and max(map(len, said.splitlines())) < 90
        assert all(f"  {name} " in said for name in COMMANDS)
    assert all((ROOT / f"{one.run.split(':')[0].replace('.', '/')}.py").exists() for one in COMMANDS.values())
    for name in ("compile", "analyse", "identify", "excite", "calibrate", "inspect", "layout", "robots"):
        status, said, _ = run(name, "--help")
        assert status == 0 and f"usage: diag-dynamics {name}" in said
    assert "80 % (" in run("analyse", "--help")[1] and STATUS in run("inspect", "--help")[1]
    assert re.fullmatch(r"diag_dynamics \d+\.\d+\.\d+\n", run("--version")[1])


@pytest.mark.parametrize(("typed", "meant"), [("monitr", "'monitor'"), ("topics", "'topic'"), ("xyz", "--help")])
def test_a_command_that_is_none(typed, meant, run):
    status, _, said = run(typed)
    assert status == 2 and f"'{typed}'" in said and meant in said


def test_without_ros(run, monkeypatch):
    """What needs a ROS 2 says so in one line, and how to get one; the rest works."""
    find = util.find_spec
    monkeypatch.setattr(util, "find_spec", lambda name, *rest: None if name == "rclpy" else find(name, *rest))
    for command in (["monitor"], ["topic", "list"]):
        status, _, said = run(*command)
        assert status == 1 and said.count("\n") == 1 and "needs a ROS 2" in said and "make setup" in said
    status, said, _ = run("robots")
    assert status == 0 and "panda_description/urdf/panda" in said.split()
    assert run("robots", "all")[0] == 2


def test_installed_under_its_name():
    """By pip under the name that `pyproject.toml` says; by colcon in bin/, which is on the PATH."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert 'diag-dynamics = "diag_dynamics.cli.main:main"' in text
    assert "install(PROGRAMS scripts/diag-dynamics DESTINATION bin)" in (ROOT / "CMakeLists.txt").read_text()
    for point in entry_points(group="console_scripts", name="diag-dynamics"):
        assert point.load() is main


@pytest.mark.full
def test_a_process_without_ros(tmp_path):
    """As a program of its own, which cannot import any of ROS."""
    names = "rclpy", "sensor_msgs", "std_msgs", "builtin_interfaces", "rosidl_runtime_py"
    (tmp_path / "sitecustomize.py").write_text(f"import sys; sys.modules.update(dict.fromkeys({names!r}))")
    (tmp_path / "x.csv").write_text("t,q_a,qd_a\n" + "".join(f"{k / 100},0.1,0\n" for k in range(9)))
    (tmp_path / "arm.urdf").write_text(urdf_of("a"))
    path = os.pathsep.join([str(tmp_path), str(ROOT), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "diag_dynamics", "analyse", "x.csv", "--urdf", "arm.urdf", "--json", "-"]
    done = subprocess.run(
        command, env=os.environ | {"PYTHONPATH": path}, cwd=tmp_path, capture_output=True, timeout=300
    )
    assert done.returncode == 0 and json.loads(done.stdout)["states"] == 9


# --- compile ---


def test_all_entry_kernels_are_compiled_ahead():
    """Every module with one is a unit; it takes some seconds, which its share of the bar says."""
    with_entries = {
        path.relative_to(ROOT / "diag_dynamics").with_suffix("").as_posix().replace("/", ".")
        for path in (ROOT / "diag_dynamics").rglob("*.py")
        if re.search(r"^@entry_kernel\(", path.read_text(encoding="utf-8"), re.M) and "compiled" not in path.parts
    }
    assert with_entries == set(compiling.UNITS)
    assert list(compiling.UNITS.values()) == sorted(compiling.UNITS.values(), reverse=True)


def test_compile_in_this_process(run, tmp_path, monkeypatch):
    """The progress reaches 100 %; a mark says that all was compiled, until a file of code is another; a failure is named."""
    done = []
    monkeypatch.setattr("diag_dynamics.cli.mark.cache_folder", lambda: tmp_path)
    monkeypatch.setattr(compiling, "UNITS", {"a": 3, "b": 1})
    monkeypatch.setattr(compiling, "compiled", done.append)
    monkeypatch.setattr(compiling, "ProcessPoolExecutor", lambda jobs, **_: ThreadPoolExecutor(jobs))
    status, _, said = run("compile", "--jobs", 1)
    assert status == 0 and "   75 %  a" in said and "100 %  b" in said and done == ["a", "b"]
    assert run("compile", "--if-needed") == (0, "", "") and done == ["a", "b"]
    monkeypatch.setattr(compiling, "UNITS", {"a": 3, "b": 1, "c": 1})
    assert run("compile", "--if-needed", "--quiet") == (0, "", "") and sorted(done[2:]) == ["a", "b", "c"]

    def failing(unit):
        raise ModuleNotFoundError(unit)

    monkeypatch.setattr(compiling, "compiled", failing)
    status, _, said = run("compile", "--jobs", 1)
    assert status == 1 and "a: ModuleNotFoundError" in said
    status, _, said = run("compile", "--jobs", "0")
    assert status == 2 and "--jobs: 0 is not at least 1" in said
    monkeypatch.setattr(compiling, "cache_folder", lambda: None)
    status, _, said = run("compile")
    assert status == 1 and "no folder to keep compiled code in" in said and "%" not in said


@pytest.fixture
def compiling_of(tmp_path):
    """Start the program's `compile`, of some units, with an empty cache."""

    def start(units, *arguments):
        (tmp_path / "sitecustomize.py").write_text(f"from diag_dynamics.cli import compile as c; c.UNITS = {units!r}")
        path = os.pathsep.join([str(tmp_path), str(ROOT), os.environ.get("PYTHONPATH", "")])
        return subprocess.Popen(
            [sys.executable, ROOT / "scripts/diag-dynamics", "compile", *arguments],
            env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": path},
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    return start


def finished(process):
    """Return what a process has said when it, and all that it has started, have ended, and its status."""
    _, said = process.communicate(timeout=300)
    return said, process.returncode


LONG = {"sweeps.motions": 1, "simulation.steps": 14, "sweeps.each": 9, "sweeps.many": 8}
"""Of which two are under way when the first is done."""


def compiled_kernels(folder):
    """Return the names of the kernels in a cache."""
    return {path.name.split("-")[0] for path in (folder / "diag_dynamics").glob("*.nbc")}


@pytest.mark.full
def test_compile_in_processes(compiling_of, tmp_path):
    """What is lost of the code is compiled again."""
    short = {name: compiling.UNITS[name] for name in ("sweeps.kinematics", "sweeps.motions")}
    for _ in range(2):
        said, status = finished(compiling_of(short, "--jobs", "2"))
        assert status == 0 and "100 %" in said and all(unit in said for unit in short)
    kept = list((tmp_path / "diag_dynamics").glob("*.nbc"))
    assert len(kept) == 5  # placement, jacobian, motion, integrate, difference
    assert finished(compiling_of(short, "--if-needed")) == ("", 0)
    kept[0].unlink()
    for expected in ("100 %", ""):
        said, status = finished(compiling_of(short, "--if-needed"))
        assert status == 0 and expected in said and bool(expected) == bool(said)
    assert kept[0].exists()


@pytest.mark.full
@pytest.mark.parametrize("end", ["all", "first", "killed"])
def test_a_signal_ends_compiling(end, compiling_of, tmp_path):
    """In a terminal all processes get Ctrl-C; a launcher may send it to the first alone. What is under way is left."""
    process = compiling_of(LONG, "--jobs", "2")
    while "sweeps.motions" not in process.stderr.readline():
        pass
    if end == "all":
        os.killpg(process.pid, signal.SIGINT)
    else:
        process.send_signal(signal.SIGINT if end == "first" else signal.SIGKILL)
    said, status = finished(process)  # those that it has started, too: they write where it does
    assert end == "killed" or (said, status) == ("", 130)
    kernels = compiled_kernels(tmp_path)
    assert "motions.integrate" in kernels and "steps.advance" not in kernels


@pytest.mark.full
@pytest.mark.skipif(not shutil.which("cmake"), reason="only who builds the package has it")
def test_compiled_where_it_is_installed(tmp_path):
    """By CMake, at the end of an installation: what is installed, wherever that is; never where a package is made."""
    (tmp_path / "CMakeLists.txt").write_text(
        f"""
        cmake_minimum_required(VERSION 3.21)
        project(small NONE)
        set(PYTHON_INSTALL_DIR lib/python)
        set(Python3_EXECUTABLE "{sys.executable}")
        install(DIRECTORY diag_dynamics DESTINATION lib/python)
        include({ROOT}/cmake/compile_ahead.cmake)
        """
    )
    (tmp_path / "diag_dynamics").mkdir()
    (tmp_path / "diag_dynamics/__init__.py").touch()
    (tmp_path / "diag_dynamics/__main__.py").write_text(
        "import os, sys, diag_dynamics; print(sys.argv[1:], os.getcwd(), diag_dynamics.__file__)\n"
        "sys.exit(int(os.environ.get('STATUS', 0)))"
    )

    def cmake(*arguments, **environment):
        command, options = ["cmake", *map(str, arguments)], {"capture_output": True, "text": True, "check": True}
        return subprocess.run(command, env=os.environ | environment, cwd=tmp_path, **options)

    build, place = tmp_path / "build", tmp_path / "elsewhere"
    cmake("-S", tmp_path, "-B", build, f"-DCMAKE_INSTALL_PREFIX={tmp_path}/configured")
    said = cmake("--install", build, "--prefix", place)
    assert f"['compile', '--if-needed', '--quiet'] {place} {place}/lib/python/diag_dynamics/__init__.py" in said.stdout
    assert "half a minute as a rule" in said.stdout and said.stderr == ""
    assert "could not be compiled ahead" in cmake("--install", build, "--prefix", place, STATUS="1").stderr
    for mark in ({"DESTDIR": str(tmp_path / "package")}, {"CONDA_BUILD": "1"}, {"HOME": str(tmp_path / "nowhere")}):
        assert "['compile'" not in cmake("--install", build, "--prefix", tmp_path / "made", **mark).stdout
    cmake("-S", tmp_path, "-B", build, "-DDIAG_DYNAMICS_COMPILE=OFF")
    assert "['compile'" not in cmake("--install", build, "--prefix", place).stdout


# --- inspect ---

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
def bare(tmp_path):
    path = tmp_path / "bare.urdf"
    path.write_text(BARE)
    return path


@pytest.mark.parametrize(
    ("robot", "expected", "said"),
    [
        ("panda", 0, "mass     17.452 kg"),
        ("ur5", 1, "warning  centre of mass outside of the geometry's bounding box"),
        ("romeo_description/urdf/romeo", 2, "error    joints that move no inertia"),
    ],
)
def test_inspect_for_people(robot, expected, said, run):
    """By the names that load_robot knows; within 80 columns, the worst first."""
    status, out, error = run("inspect", robot)
    assert (status, error) == (expected, "") and said in out and max(map(len, out.splitlines())) <= 80
    found = [line.split()[0] for line in out.splitlines() if re.match(r"(?:ok|note|warning|error) ", line)]
    assert [SEVERITIES.index(one) for one in found] == sorted((SEVERITIES.index(one) for one in found), reverse=True)
    assert re.search(r"\n\d+ errors?, \d+ warnings?, \d+ notes?\n$", out)


def test_inspect_for_machines(bare, run):
    """The same in JSON, whose keys stay."""
    status, out, _ = run("inspect", bare, "--json")
    document = json.loads(out)
    assert status == document["status"] == 2 and document["source"] == str(bare)
    assert set(document) == {"source", "status", "facts", "checks", "findings"}
    assert set(document["checks"]) == set(CHECKS)
    for finding in document["findings"]:
        assert set(finding) == {"severity", "check", "what", "links", "joints", "values", "unit", "remedy"}
        assert finding["severity"] in SEVERITIES and finding["check"] in CHECKS
    assert set(document["facts"]) == {
        *("name", "links", "joints", "moving_joints", "degrees_of_freedom", "floating_base", "root_link", "total_mass"),
        *("mimic_joints", "coupled_groups", "locked_joints", "links_without_inertial", "frames", "poses"),
        *("condition_of_mass_matrix", "kinetic_energy_at_velocity_limits", "tips"),
    }
    assert [one["joints"] for one in document["findings"] if one["check"] == "loading"] == [["turn"]]
    document = json.loads(run("inspect", "nowhere.urdf", "--json")[1])
    assert document["status"] == 2 and "no such file" in document["error"]


def test_estimates_are_written(bare, tmp_path, run):
    """To a new file, which says so; the source stays as it is, and so does any file that is there."""
    new = tmp_path / "new.urdf"
    status, said, _ = run("inspect", bare, "--estimate-inertias", 1000, "-o", new)
    assert status == 0 and "arm: 6 kg, estimated from collision box" in said and bare.read_text() == BARE
    text = new.read_text(encoding="utf-8")
    assert text.startswith("<?xml") and "<!-- estimated by diag_dynamics from collision box at 1000 kg/m3 -->" in text
    with pytest.warns(dd.InertiaWarning):
        model = dd.load_urdf(bare, estimate_inertias=1000.0)
    assert model.bodies.tobytes() == dd.load_urdf(new).bodies.tobytes()
    assert run("inspect", new)[0] == 0
    for output in (new, bare):
        before = output.read_text()
        status, _, said = run("inspect", bare, "--estimate-inertias", 500, "-o", output)
        assert status == 2 and "not overwritten" in said and output.read_text() == before
    status, _, said = run("inspect", new, "--estimate-inertias", 500, "-o", tmp_path / "none.urdf")
    assert status == 1 and "nothing to estimate" in said and not (tmp_path / "none.urdf").exists()


def test_estimates_for_machines(bare, tmp_path, run):
    """What could not be estimated is named; the source may be xacro."""
    mesh = '<link name="base"><visual><geometry><mesh filename="x.stl"/></geometry></visual></link>'
    path = tmp_path / "bare.urdf.xacro"
    text = BARE.replace('<link name="base"/>', mesh).replace('"0.1 0.2 0.3"', '"${0.1} 0.2 0.3"')
    path.write_text(text.replace('name="bare"', 'name="bare" xmlns:xacro="http://www.ros.org/wiki/xacro"'))
    status, said, _ = run("inspect", path, "--estimate-inertias", 1000, "-o", tmp_path / "new.urdf", "--json")
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
def test_inspect_refuses(arguments, said, run):
    status, out, error = run("inspect", *arguments)
    assert (status, out) == (2, "") and said in error


# --- The robot of a command

XACRO = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="mass" default="1"/>
  <link name="base"/><link name="arm"><inertial><mass value="$(arg mass)"/><origin xyz="0 0 0.1"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="$(arg side)_turn" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit effort="10" velocity="1"/></joint></robot>"""

MJCF = """<!-- an arm --><mujoco model="arm"><option gravity="0 0 -1.6"/><worldbody><body mocap="true"/><body>
  <joint name="turn" axis="0 1 0" armature="0.2" stiffness="1"/><geom size="0.1" pos="0 0 1"/></body></worldbody></mujoco>"""

KINDS = {  # how a command line names the robot, and its first joint
    "xacro": (["{folder}/arm.urdf.xacro", "side:=left", "mass:=2.5"], "left_turn"),
    "quoted": (["{folder}/arm.urdf.xacro side:=left 'mass:=2.5'"], "left_turn"),
    "MJCF": (["{folder}/arm.xml"], "turn"),
    "name": (["panda"], "panda_joint1"),
    "listed name": (["panda_description/urdf/panda"], "panda_joint1"),
}

OF_A_RECORDING = ["{recording}", "--start", "1000", "--urdf"]
COMMANDS_OF_A_ROBOT = {  # arguments before the robot, behind it, and what is printed if it was loaded
    "inspect": ([], ["--json"], '"status": 0'),
    "layout": (["--tool", "plotjuggler"], [], "{joint}"),
    "excite": (
        [],
        ["--trials", "1", "--joints", "{joint}", "--velocity-limit", "{joint}=1", "-o", "{folder}/x"],
        "{joint}",
    ),
    "analyse": (OF_A_RECORDING, [], "not a single state"),
    "identify": (OF_A_RECORDING, [], "not a single state"),
    "calibrate": (OF_A_RECORDING, ["-o", "{folder}/a.yaml"], "not a single state"),
}


@pytest.fixture
def robots_folder(tmp_path):
    (tmp_path / "arm.urdf.xacro").write_text(XACRO)
    (tmp_path / "arm.xml").write_text(MJCF)
    (tmp_path / "sub").mkdir()
    return tmp_path


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("command", COMMANDS_OF_A_ROBOT)
def test_every_command_takes_every_robot(command, kind, robots_folder, run):
    """A xacro file with arguments, an MJCF, and a robot by its name, as the list of robots has it or in short."""
    named, joint = KINDS[kind]
    recording = write(robots_folder / "x.csv", ["t", f"q_{joint}", f"qd_{joint}"], np.eye(3))
    before, behind, expected = COMMANDS_OF_A_ROBOT[command]
    words = {"folder": robots_folder, "recording": recording, "joint": joint}
    _, out, error = run(command, *(word.format(**words) for word in (*before, *named, *behind)))
    assert expected.format(**words) in out + error


@pytest.mark.parametrize("command", COMMANDS_OF_A_ROBOT)
@pytest.mark.parametrize(
    ("robot", "message"),
    [
        (["{folder}/arm.urdf.xacro"], "argument 'side' has no value and no default. Give it: side:=VALUE"),
        (["{folder}/arm.urdf.xacro", "mass:=2"], "argument 'side' has no value"),
        (["{folder}/arm.urdf.xacro", "side=left"], "'side=left' is no argument. Write side:=left"),
        (["{folder}/arm.urdf.xacro", "side:=a", "side:=b"], "'side' is 'a' and 'b'; expected one value"),
        (["panda", "side:=left"], "'side:=left' is a xacro argument, but robot 'panda' is no .xacro file"),
        (["{folder}/arm.xml", "side:=left"], "is no .xacro file"),
        (["talos"], "could be any of"),
        (["{folder}/sub"], "a folder; expected"),
        (["{folder}/nowhere.xml"], "no such file"),
        (["small.urdf"], "'small.urdf': no such file"),  # no part of romeo_small.urdf
        ([5000 * "x"], "x' cannot be read: File name too long."),
    ],
    ids=[
        "no value",
        "other value",
        "equals",
        "two values",
        "name",
        "mjcf",
        "ambiguous",
        "folder",
        "absent",
        "part",
        "long",
    ],
)
def test_every_command_refuses_in_one_line(command, robot, message, robots_folder, run):
    recording = write(robots_folder / "x.csv", ["t", "q_turn", "qd_turn"], np.eye(3))
    before, behind, _ = COMMANDS_OF_A_ROBOT[command]
    words = {"folder": robots_folder, "recording": recording, "joint": "turn"}
    behind = [word for word in behind if word != "--json"]
    status, out, error = run(command, *(word.format(**words) for word in (*before, *robot, *behind)))
    assert (status, out, error.count("\n")) == (2, "", 1) and message in error


def test_xacro_arguments_without_a_robot(robots_folder, run):
    """They may stand before the recording, too; and a recording may have a name like an assignment."""
    still = [[k / 100, 0.1, 0.0] for k in range(3)]
    odd = write(robots_folder / "side=left.csv", ["t", "q_left_turn", "qd_left_turn"], still)
    status, _, error = run("analyse", "side:=left", odd)
    assert status == 2 and "'side:=left' is a xacro argument, but no robot is named. Give --urdf FILE.xacro." in error
    robot = robots_folder / "arm.urdf.xacro"
    status, out, _ = run("analyse", "side:=left", odd, "--urdf", robot, "--json", "-")
    assert status == 0 and json.loads(out)["states"] == 3


def test_an_argument_that_xacro_does_not_use(robots_folder, run):
    status, _, error = run("inspect", robots_folder / "arm.urdf.xacro", "side:=left", "msas:=2")
    assert status == 0 and error.count("\n") == 1
    assert "warning: The xacro argument 'msas' has no effect" in error and "it uses mass, side" in error


def test_mjcf_on_the_command_line(robots_folder, run, monkeypatch):
    """What dynamics omits is a note of inspect, and a line of the others; what needs a URDF, or MuJoCo, says so."""
    robot = robots_folder / "arm.xml"
    status, out, error = run("inspect", robot)
    assert (status, error) == (0, "") and "omit: spring of joint 'turn'" in out and "omit: mocap body 'body1'" in out
    status, out, error = run("layout", robot, "--tool", "plotjuggler")
    (line,) = [line for line in error.splitlines() if "warning" in line]
    assert "robot 'arm' omit: spring of joint 'turn'; mocap body 'body1'" in line and "turn" in out
    status, _, error = run("inspect", robot, "--floating-base")
    assert status == 2 and "floating_base is True; expected False" in error
    status, _, error = run("inspect", robot, "--estimate-inertias", 1000, "-o", robots_folder / "new.urdf")
    assert status == 2 and "is an MJCF, whose inertias MuJoCo estimates" in error
    recording = write(robots_folder / "x.csv", ["t", "q_turn", "qd_turn"], np.eye(3))
    status, _, error = run("identify", recording, "--urdf", robot, "--write-urdf", robots_folder / "new.urdf")
    assert status == 2 and "--write-urdf writes a URDF" in error and not (robots_folder / "new.urdf").exists()
    monkeypatch.setitem(sys.modules, "mujoco", None)
    status, out, error = run("inspect", robot)
    assert (status, out, error.count("\n")) == (2, "", 1) and "pip install mujoco" in error


# --- identify ---

TRUTH = {
    "shoulder_pan_joint": dd.JointParameters(damping=4.0, friction=6.0, effort_offset=1.0, armature=2.0),
    "elbow_joint": dd.JointParameters(damping=2.0, friction=3.0, effort_offset=-0.5, armature=0.9),
    "wrist_3_joint": dd.JointParameters(damping=0.3, friction=0.6, effort_offset=0.1, armature=0.1),
}


@pytest.fixture(scope="module")
def columns():
    """Names and columns of a UR5 with friction and rotors that its URDF does not know, without noise."""
    robot = dd.load_robot("ur5_robot").with_parameters(dd.Parameters(joints=TRUTH))
    motion = dd.excite(robot, "friction", trials=3, rate=60.0, velocity=0.8)
    names = ["t", *(f"{kind}_{name}" for kind in ("q", "qd", "tau") for name in robot.dof_names)]
    return names, np.column_stack([motion.time, motion.position, motion.velocity, motion.effort])


def write(path, names, columns):
    """Write a CSV; return the path."""
    np.savetxt(path, columns, delimiter=",", header=",".join(names), comments="", fmt="%.17g")
    return path


@pytest.fixture(scope="module")
def recording(columns, tmp_path_factory):
    return write(tmp_path_factory.mktemp("identify") / "monday.csv", *columns)


@pytest.fixture(scope="module")
def identified(recording, tmp_path_factory):
    """Folder of all that the command writes."""
    folder = tmp_path_factory.mktemp("identified")
    outputs = {"-o": "arm.yaml", "--json": "q.json", "--plots": "page.png", "--write-urdf": "new.urdf"}
    options = [word for option, name in outputs.items() for word in (option, str(folder / name))]
    with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as error:
        assert main(["identify", str(recording), "--urdf", "ur5_robot", *options]) == 0
    (folder / "out").write_text(out.getvalue())
    assert all(f"Wrote {folder / name}" in error.getvalue() for name in outputs.values())
    return folder


def test_identify_writes_what_it_finds(recording, identified):
    lines = (identified / "out").read_text().splitlines()
    head = next(k for k, line in enumerate(lines) if "damping" in line)
    assert "friction, rotors" in lines[0] and "N m s/rad" in lines[head + 1]
    found = dd.Parameters.load(identified / "arm.yaml")
    for name, truth in TRUTH.items():
        one = found.joints[name]
        assert one.friction == pytest.approx(truth.friction, rel=0.03)
        assert one.damping == pytest.approx(truth.damping, rel=0.05)
        assert one.effort_offset == pytest.approx(truth.effort_offset, abs=0.03 * truth.friction)
        assert one.armature == pytest.approx(truth.armature, rel=0.05)
    told = json.loads((identified / "q.json").read_text())
    assert all(after < max(0.3 * before, 0.05) for before, after in told["torque_rms"].values())
    assert told["explained"][1] > 0.99 and found.origin["recordings"][0]["path"] == str(recording)
    assert (identified / "page.png").read_bytes().startswith(b"\x89PNG")
    dynamics = etree.parse(identified / "new.urdf").xpath("//joint[@name='elbow_joint']/dynamics")[0]
    assert float(dynamics.get("friction")) == found.joints["elbow_joint"].friction
    assert "monday.csv" in (identified / "new.urdf").read_text()


def test_identify_goes_on_from_what_is_known(recording, identified, tmp_path, run):
    """With what was found as --parameters there is nothing left to take, and nothing of it is lost."""
    arm, after, urdf = identified / "arm.yaml", tmp_path / "after.yaml", tmp_path / "after.urdf"
    command = ["identify", recording, "--urdf", "ur5_robot", "--parameters", arm, "--what", "rotors"]
    status, out, _ = run(*command, "-o", after, "--write-urdf", urdf, "--json", "-")
    told, before = json.loads(out), dd.Parameters.load(arm).joints
    assert (status, told["taken"], told["shared"]) == (1, [], [])
    assert dd.Parameters.load(after).joints == before
    model = dd.load_urdf(urdf)
    assert all(model.friction[model.dof_names.index(name)] == one.friction for name, one in before.items())


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
def test_identify_refuses(recording, options, message, run):
    options, before = [one.format(recording=recording) for one in options], recording.read_bytes()
    status, _, error = run("identify", recording, "--urdf", "ur5_robot", *options)
    assert status == 2 and message in error and recording.read_bytes() == before


@pytest.mark.parametrize(
    ("factor", "message"),
    [
        (1e6, r"no efforts, for those of \d+ states are beyond what can be .* are they in N m\?"),
        (np.nan, "no efforts, or in no state one of every joint"),
    ],
)
def test_why_there_are_no_efforts(columns, tmp_path, factor, message, run):
    """A wrong unit, or one joint without: the file has a column of efforts."""
    names, numbers = columns[0], columns[1].copy()
    numbers[:, names.index("tau_elbow_joint")] *= factor
    wrong = write(tmp_path / "wrong.csv", names, numbers)
    for command in (["identify"], ["calibrate", "-o", tmp_path / "a.yaml"]):
        status, _, error = run(command[0], wrong, "--urdf", "ur5_robot", *command[1:])
        assert status == 2 and re.search(message, error)


def test_all_recordings_are_read_by_the_same_parameters(columns, tmp_path, run):
    """Those behind the first, and the reference: efforts of all are in half N m."""
    names, numbers = columns[0], columns[1].copy()
    numbers[:, [k for k, name in enumerate(names) if name.startswith("tau_")]] *= 2.0
    doubled = write(tmp_path / "doubled.csv", names, numbers)
    options = ["--what", "payload:ee_link", "--set", "effort_scale=*=0.5", "--json", "-"]
    status, out, _ = run("identify", doubled, doubled, "--urdf", "ur5_robot", *options, "--reference", doubled)
    assert status == 0 and abs(json.loads(out)["payload"]["mass"]) < 0.05


def test_plots_of_two_runs_are_one_behind_the_other(columns, tmp_path, monkeypatch, run):
    """A file whose stamps begin anew in the middle: no curve goes back, and what is held out is its end."""
    figures = []
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, *_, **__: figures.append(figure))
    names, numbers = columns
    twice = write(tmp_path / "twice.csv", names, np.vstack([numbers, numbers]))
    assert run("identify", twice, "--urdf", "ur5_robot", "--plots", tmp_path / "x.png", "--quiet")[0] == 0
    whole = 2.0 * (numbers[-1, 0] - numbers[0, 0])
    for axes in figures[0].axes[:6]:
        (held_out,) = axes.patches
        assert held_out.get_x() == pytest.approx(2.0 / 3.0 * whole, rel=0.02)
        for line in axes.lines[:2]:
            time, values = line.get_data()
            assert (np.diff(time) >= 0.0).all() and time[-1] == pytest.approx(whole, rel=0.02)
            assert np.isnan(values).sum() < 10
            assert held_out.get_x() + held_out.get_width() == pytest.approx(time[-1])
    torques = [np.zeros((4, 3))] * 2  # of an odd number of joints, where the right column ends a row earlier
    picture(tmp_path / "x.png", "three", np.arange(4.0), torques, dict.fromkeys("abc", (1.0, 0.5)), (2.0, 3.0))
    a, b, c, _ = figures[1].axes
    assert [axes.get_xlabel() for axes in (a, b, c)] == ["", "time [s]", "time [s]"]
    assert [axes.get_ylabel() for axes in (a, c)] == ["N m, N"] * 2


# --- demo-identify ---


def test_demo_identify_refuses(run):
    status, _, error = run("demo-identify", "--robots", "nobody")
    assert status == 2 and "--robots has 'nobody', expected some of panda, ur5_robot, tiago_no_hand" in error


@pytest.mark.full
def test_demo_identify(tmp_path, run):
    """Ten pushes, of which nine are seen with what was identified; and every file of it can be used."""
    plot, kept = tmp_path / "before_and_after.svg", tmp_path / "kept"
    status, out, error = run("demo-identify", "--robots", "ur5_robot", "--picture", plot, "--keep", kept)
    assert status == 0 and error.startswith("ur5_robot: ")  # it says at once what it does
    seen = re.findall(r"(with the URDF|identified): (\d+) of 10 pushes seen", out)
    assert [what for what, _ in seen] == ["with the URDF", "identified"]
    assert int(seen[0][1]) < 9 <= int(seen[1][1])
    shares = re.search(r"explains (\S+) of dK/dt with the URDF, (\S+) identified", out)
    assert float(shares[1]) < 0.0 and float(shares[2]) > 0.95
    assert plot.read_text().startswith("<?xml")
    arm, pushed = kept / "ur5_robot_arm.yaml", kept / "ur5_robot_pushed.npz"
    model = dd.load_robot("ur5_robot", parameters=arm)
    seen = dd.observe(dd.DiagonalDynamics(model), dd.read_recording(pushed, model))
    assert np.isfinite(seen.norm[100:]).all()
    alarms = ["--alarms", kept / "ur5_robot_alarms_identified.yaml"]
    assert "collision" in run("analyse", pushed, "--urdf", "ur5_robot", "--parameters", arm, *alarms)[1]
