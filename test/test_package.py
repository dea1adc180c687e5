"""The package as a whole: what is declared in several places agrees, and what is promised is there."""

import ast
import inspect
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
import yaml

import diag_dynamics as dd
from diag_dynamics import spatial

ROOT = Path(__file__).parents[1]
SOURCES = sorted((ROOT / "diag_dynamics").rglob("*.py"))


def imports(path):
    """Modules that a file imports, as dotted names."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


# --- Structure ---

FLOORS = [
    "exceptions kernel",
    "lanes",
    "trigonometry",
    "spatial",
    "sweeps",
    "model results batch",
    "dynamics",
    "simulation history push_history example_robots control",
    "observer",
    "terminal",
]
"""Rooms from the ground up: a module imports from its own floor or below. nodes stand on all of them."""


def test_imports_point_downward():
    floor = {name: k for k, names in enumerate(FLOORS) for name in names.split()}
    for path in SOURCES:
        room = path.relative_to(ROOT / "diag_dynamics").parts[0].removesuffix(".py")
        if room in ("__init__", "nodes"):
            continue
        assert room in floor, f"{path.name} has no floor in {__name__}.FLOORS"
        for name in imports(path):
            parts = name.split(".")
            if parts[0] == "diag_dynamics" and len(parts) > 1:
                assert floor[parts[1]] <= floor[room], f"{room} imports {name}"


def test_ros_only_in_nodes_and_pinocchio_nowhere():
    ros = {"rclpy", "std_msgs", "sensor_msgs", "diagnostic_msgs", "rcl_interfaces", "builtin_interfaces"}
    for path in SOURCES:
        found = {name.split(".")[0] for name in imports(path)}
        assert not found & {"pinocchio", "pin"}, path
        if "nodes" not in path.parts:
            assert not found & ros, path


def test_importing_the_package_is_cheap():
    """Who imports only a message does not wait for numba, yourdfpy or rclpy."""
    script = "import sys, diag_dynamics; print(sorted({'numba', 'yourdfpy', 'rclpy', 'numpy'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_public_names_are_there():
    for name in dd.__all__:
        value = getattr(dd, name)
        assert value.__doc__
    assert {"load_urdf", "DiagonalDynamics", "RobotModel"} <= set(dir(dd))
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = dd.nonsense


# --- Interfaces ---


def interface_files():
    return sorted((ROOT / "msg").glob("*.msg")) + sorted((ROOT / "srv").glob("*.srv"))


def test_cmake_lists_every_interface():
    listed = re.findall(r"^\s+((?:msg|srv)/\w+\.(?:msg|srv))$", (ROOT / "CMakeLists.txt").read_text(), re.M)
    assert listed == [path.relative_to(ROOT).as_posix() for path in interface_files()]


@pytest.mark.parametrize("path", interface_files(), ids=lambda path: path.name)
def test_every_field_has_a_meaning(path):
    """Each field has a comment of its own, or shares the comment of the field it completes."""
    shared = {"string[] dof_names", "string message", "geometry_msgs/Wrench[] wrenches"}
    for line in path.read_text(encoding="utf-8").splitlines():
        field = line.split("#")[0].strip()
        if not field or field == "---" or "#" in line or "=" in field:
            continue
        assert field in shared or field.startswith("diag_dynamics/"), f"{path.name}: {field} says nothing"


# --- Parameters: code, configuration and README ---


MODULES = {"monitor": "settings", "simulator": "plant.settings", "controller": "controlled.settings"}
"""Where a node's table of parameters is."""


def node_parameters(node):
    if os.environ.get("DIAG_DYNAMICS_REQUIRE_ROS") != "1":
        pytest.importorskip("rclpy", reason="rclpy is not installed: parameters cannot be read")
    module = __import__(f"diag_dynamics.nodes.{MODULES[node]}", fromlist=["PARAMETERS"])
    return module.PARAMETERS


def flat(tree, prefix=""):
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from flat(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


@pytest.mark.ros
@pytest.mark.parametrize("node", ["monitor", "simulator", "controller"])
def test_configuration_holds_the_defaults(node):
    tree = yaml.safe_load((ROOT / "config" / f"{node}.yaml").read_text(encoding="utf-8"))
    written = dict(flat(tree["/**"]["ros__parameters"]))
    assert written == {name: spec.default for name, spec in node_parameters(node).items()}


@pytest.mark.ros
@pytest.mark.parametrize("node", ["monitor", "simulator", "controller"])
def test_readme_lists_every_parameter(node):
    section = (ROOT / "README.md").read_text(encoding="utf-8").split(f"## The {node}\n")[1].split("\n## ")[0]
    rows = re.findall(r"^\| `([\w.]+)` \| `([^`]*)` \|", section, re.M)
    expected = {}
    for name, spec in node_parameters(node).items():
        expected[name] = (
            str(spec.default).replace("'", '"') if spec.default else {"": '""'}.get(spec.default, str(spec.default))
        )
    assert dict(rows) == expected


# --- Launching and installing ---


@pytest.mark.parametrize("path", sorted((ROOT / "launch").glob("*.py")), ids=lambda path: path.name)
def test_launch_files_name_what_exists(path):
    """Executables are installed and configuration files there; the rest needs `launch`."""
    text = path.read_text(encoding="utf-8")
    compile(text, str(path), "exec")
    assert "def generate_launch_description" in text
    for executable in re.findall(r'launch_of_node\("(\w+)"', text):
        assert (ROOT / "scripts" / executable).is_file()
    for name in re.findall(r'"(\w+\.(?:yaml|launch\.py))"', text):
        assert (ROOT / "config" / name).is_file() or (ROOT / "launch" / name).is_file()


@pytest.mark.ros
def test_included_launch_files_take_what_they_are_given():
    """Every argument that one launch file passes on to another is declared there, and is a parameter of the node."""

    def keys_in(file, constant):
        tree = ast.parse((ROOT / "launch" / file).read_text(encoding="utf-8"))
        assigned = {node.targets[0].id: node.value for node in tree.body if isinstance(node, ast.Assign)}
        return {key.value: value for key, value in zip(assigned[constant].keys, assigned[constant].values, strict=True)}

    given = keys_in("control.launch.py", "GIVEN")
    assert set(given) == {"simulator", "controller", "monitor"}
    for node, arguments in given.items():
        declared = keys_in(f"{node}.launch.py", "ARGUMENTS")
        assert {key.value for key in arguments.keys} <= {"use_sim_time", *declared}, node
        assert set(declared) <= {"robot_compensates_gravity", *node_parameters(node)}, node
    defaults = set(keys_in("control.launch.py", "DEFAULTS"))
    assert defaults <= {name for node in given for name in keys_in(f"{node}.launch.py", "ARGUMENTS")}


@pytest.mark.ros
def test_the_example_for_ros2_control_fits_together():
    """The controller's commands are in the order of the effort controller's joints, which are the arm's."""
    from robots import robot

    example = yaml.safe_load((ROOT / "config" / "effort_controllers.yaml").read_text(encoding="utf-8"))
    parameters = {node: section["ros__parameters"] for node, section in example.items()}
    assert set(parameters) == {"controller_manager", "effort_controller", "diag_dynamics_controller"}
    own = parameters["diag_dynamics_controller"]
    joints = parameters["effort_controller"]["joints"]
    assert own["command_joints"] == joints
    assert set(joints) == set(dd.load_urdf(robot("ur_description/urdf/ur5_robot.urdf").source).dof_names)
    assert set(own) - {"robot_compensates_gravity"} <= set(node_parameters("controller"))
    assert own["robot_compensates_gravity"] in (False, True)


def test_the_table_of_what_is_safe_names_tests():
    """docs/control.md: every row of the controller's table names tests that exist."""
    text = (ROOT / "docs" / "control.md").read_text(encoding="utf-8")
    table = text.split("| what is safe | test |\n")[1].split("\n\n")[0]
    tests = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "test").glob("test_control*.py"))
    for row in table.splitlines()[1:]:
        named = re.findall(r"`(test_\w+)`", row)
        assert named, row
        for name in named:
            assert f"\ndef {name}(" in tests, name


LAUNCHED = {
    "monitor": ({}, {"monitor": {}}),
    "simulator": (
        {"urdf": "/my.urdf", "command_timeout": "2", "without_command": "zero", "publish_clock": "true"},
        {
            "simulator": {
                "robot_description": "/my.urdf",
                "command_timeout": 2.0,
                "without_command": "zero",
                "publish_clock": True,
            }
        },
    ),
    "controller": (
        {"robot_compensates_gravity": "true", "controlled_link": "1", "mimic": "lock", "namespace": "arm"},
        {"controller": {"robot_compensates_gravity": True, "controlled_link": "1", "mimic": "lock"}},
    ),
    "demo": (
        {"urdf": "<robot>1: x</robot>"},
        {"simulator": {"robot_description": "<robot>1: x</robot>"}, "monitor": {}},
    ),
    "control": (
        {"robot_compensates_gravity": "true", "command_timeout": "0.2"},
        {
            "simulator": {
                "compensates_gravity": True,
                "publish_clock": True,
                "use_sim_time": False,
                "without_command": "brake",
                "command_timeout": 0.2,
            },
            "controller": {
                "robot_compensates_gravity": True,
                "autostart": True,
                "check_time": 0.0,
                "use_sim_time": True,
            },
            "monitor": {"use_sim_time": True},
        },
    ),
}
"""Arguments of the launch files, and the parameters that their nodes are given by them: those and no others."""


LAUNCH = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

source = PythonLaunchDescriptionSource(sys.argv[1])
given = [argument.split(":=", 1) for argument in sys.argv[2:]]
service = LaunchService(noninteractive=True)
service.include_launch_description(LaunchDescription([IncludeLaunchDescription(source, launch_arguments=given)]))
sys.exit(service.run())
"""
"""As `ros2 launch` does."""


@pytest.mark.parametrize(("file", "arguments", "expected"), [(f, *case) for f, case in LAUNCHED.items()], ids=LAUNCHED)
def test_launch_files_launch(file, arguments, expected):
    """By launch itself, which prints what it would start; its files of parameters say what each node would be given."""
    pytest.importorskip("launch_ros", reason="launch and launch_ros are not on PyPI, only in an installed ROS 2")
    path = str(ROOT / "launch" / f"{file}.launch.py")
    given = [f"{name}:={value}" for name, value in (arguments | {"launch-prefix": "echo"}).items()]
    done = subprocess.run([sys.executable, "-c", LAUNCH, path, *given], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    found = {}
    for line in done.stdout.splitlines():
        if node := re.search(r"__node:=diag_dynamics_(\w+)", line):
            files = re.findall(r"--params-file (\S+)", line)
            assert Path(files[0]).name == f"{node[1]}.yaml"
            assert ("__ns:=/arm" in line) == ("namespace" in arguments)
            sections = [yaml.safe_load(Path(path).read_text(encoding="utf-8")).values() for path in files[1:]]
            tables = [section["ros__parameters"] for of_file in sections for section in of_file]
            found[node[1]] = {key: value for table in tables for key, value in table.items()}
    assert found == expected


def test_package_xml_is_complete():
    package = ET.parse(ROOT / "package.xml").getroot()
    assert package.get("format") == "3"
    assert package.findtext("version") == dd.__version__
    assert package.findtext("export/build_type") == "ament_cmake"
    declared = {e.text for e in package if e.tag.endswith("depend")}
    third_party = {"numba", "numpy", "lxml", "yourdfpy", "rich", "matplotlib"}
    keys = {name: f"python3-{name}" for name in third_party} | {"yourdfpy": "python3-yourdfpy-pip"}
    keys["llvmlite"] = keys["numba"]  # numba's code generator, which it brings along
    standard = set(sys.stdlib_module_names) | {"diag_dynamics"}
    for path in SOURCES:
        for name in {name.split(".")[0] for name in imports(path)} - standard:
            assert keys.get(name, name) in declared, f"{path.name} imports {name}, which package.xml does not declare"


def test_installs_without_ros(tmp_path):
    """pip makes a wheel that holds every module of the library, and imports where there is no ROS."""
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "-q", "-w", str(tmp_path)]
    if os.environ.get("DIAG_DYNAMICS_REQUIRE_ROS") != "1":
        pytest.importorskip(
            "setuptools", minversion="77", reason="setuptools 77, which builds the wheel, is not installed"
        )
    subprocess.run([*command, str(ROOT)], check=True, capture_output=True, timeout=300)
    (wheel,) = tmp_path.glob("*.whl")
    target = tmp_path / "site"
    install = [sys.executable, "-m", "pip", "install", "--no-deps", "-q", "--target", str(target), str(wheel)]
    subprocess.run(install, check=True, capture_output=True, timeout=300)
    installed = {path.relative_to(target).as_posix() for path in (target / "diag_dynamics").rglob("*.py")}
    assert installed == {path.relative_to(ROOT).as_posix() for path in SOURCES}
    script = "import diag_dynamics as dd; print(dd.load_urdf, dd.DiagonalDynamics, dd.Simulation)"
    clean = {"PATH": "/usr/bin", "PYTHONPATH": f"{target}", "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, env=clean, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_readme_program_runs(tmp_path):
    """The program in the README, as it stands there."""
    from robots import robot_path

    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"<!-- test: the block below is run -->\n```python\n(.*?)```", text, re.S)
    (tmp_path / "panda.urdf").write_text(robot_path("panda_description/urdf/panda.urdf").read_text())
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=None, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert abs(float(done.stdout.split()[-1])) < 1e-12


def test_the_map_of_the_paper_names_what_exists():
    """docs/paper.md: every test and every function it names is there, and every row names a test or a measurement."""
    text = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    rows = [
        line for line in text.splitlines() if line.startswith("| ") and not line.startswith(("| number", "| claim"))
    ]
    assert len(rows) > 40
    public = {name for kind in (dd.DiagonalDynamics, dd.Evaluation) for name in dir(kind)} | set(dd.__all__)
    public |= set(dd.Factors._fields) | set(re.findall(r"self\.(\w+)", inspect.getsource(dd.Evaluation)))
    for row in rows:
        named = re.findall(r"`([^`]+)`", row)
        tests = [name for name in named if "test_" in name and not name.endswith(".py")]
        assert tests or "measured:" in row, row
        for name in tests:
            file, _, function = name.rpartition("::")
            source = (ROOT / "test" / (file or "test_paper_identities.py")).read_text(encoding="utf-8")
            assert re.search(rf"^def {function}\(", source, re.M), name
        for name in set(named) - set(tests):
            if name.startswith("spatial."):
                assert hasattr(spatial, name.removeprefix("spatial.")), name
            elif name.endswith(".py"):
                assert (ROOT / name).exists() or (ROOT / "test" / name).exists(), name
            else:
                assert name.split()[0] in public, name
