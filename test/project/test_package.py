# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The package as a whole: what is declared in several places agrees, and what is promised is there."""

import ast
import inspect
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from importlib import import_module
from pathlib import Path

import pytest
import yaml

import diag_dynamics as dd
from diag_dynamics.nodes.support.launches import ARGUMENTS, LAUNCHES, arguments_of, misspelt, started
from diag_dynamics.nodes.support.names import NODES
from diag_dynamics.sweeps import spatial

ROOT = Path(__file__).parents[2]
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
    "text arrays",
    "exceptions",
    "checks entries yaml_files compiled",
    "bags tables",
    "sweeps",
    "model batch",
    "results contact",
    "dynamics",
    "control assembly inspection alarms",
    "simulation wire",
    "parameters views page",
    "recordings",
    "identification plot",
    "demos layouts",
    "nodes/support",
    "nodes/encoded",
    "nodes/monitor nodes/controller nodes/simulator",
    "nodes/demos nodes/tools nodes/view",
    "cli",
    "__main__",
]
"""Rooms from the ground up: a module imports from its own room or from a lower floor."""

INTERFACES = {"msg", "srv"}
"""What the ROS 2 build puts beside the rooms."""

WITHOUT_ROS = {"numpy", "numba", "llvmlite", "lxml", "yourdfpy", "rich", "matplotlib"} | set(sys.stdlib_module_names)
"""All that the library imports. Anything else is a package of ROS."""


def room_of(parts):
    """Room of a dotted name or path below diag_dynamics, as FLOORS has it."""
    return "/".join(parts[:2]) if parts[0] == "nodes" and len(parts) > 1 else parts[0]


def test_imports_point_downward():
    floor = {name: k for k, names in enumerate(FLOORS) for name in names.split()}
    for path in SOURCES:
        room = room_of(path.relative_to(ROOT / "diag_dynamics").with_suffix("").parts)
        if room in ("__init__", "nodes/__init__"):
            continue
        assert room in floor, f"{path} has no floor in {__name__}.FLOORS"
        for name in imports(path):
            parts = name.split(".")
            if parts[0] != "diag_dynamics" or len(parts) < 2 or parts[1] in INTERFACES:
                continue
            other = room_of(parts[1:])
            if other != "nodes":  # of `from diag_dynamics.nodes import support`, which names the room next
                assert other == room or floor[other] < floor[room], f"{path} imports {name}"


PRIVATE_OF_OTHERS = {
    "compiled/lent.py": "_get_function _getpointer _getvalue",
    "compiled/native.py": "_cache _can_compile _compile_for_args",
    "compiled/parts.py": "_defns _dynfunc _final_module _finalized _module_pass_manager _reload_init "
    "_resolve_user_function_type",
    "compiled/store.py": "_CacheLocator",
    "dynamics/many_states.py": "_external _friction _with_tau",
    "dynamics/one_state.py": "_external _friction _memory _model _with_tau",
    "nodes/support/logger.py": "_internal_callers",
    "nodes/support/overrides.py": "_parameter_overrides",
    "nodes/support/start.py": "_exit",
}
"""Private names that have no public counterpart, by the file that needs them: of numba, rclpy and Python; and of results that
are written again (``out=``), which nobody but `dynamics/` may write."""

NAMED_TUPLES = {"_replace", "_asdict", "_fields"}
"""Public names of named tuples, whose underscores keep them apart from fields."""


def private_names(tree):
    """Private attributes that the classes of a module have: their methods and fields, and what is set on self."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):
            for part in node.body:
                if isinstance(part, ast.FunctionDef):
                    yield part.name
                elif isinstance(part, ast.AnnAssign):
                    yield part.target.id
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and is_own(node):
            yield node.attr


def is_own(attribute):
    """Whether an attribute is one of the object or class whose method it stands in."""
    return isinstance(attribute.value, ast.Name) and attribute.value.id in ("self", "cls")


def test_nobody_touches_the_private_state_of_others():
    """A private attribute is read and written by the module of its class alone, and a private name is not imported."""
    for path in SOURCES:
        tree, name = ast.parse(path.read_text(encoding="utf-8")), path.relative_to(ROOT / "diag_dynamics").as_posix()
        allowed = NAMED_TUPLES | set(private_names(tree)) | set(PRIVATE_OF_OTHERS.get(name, "").split())
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and not is_own(node):
                private = node.attr.startswith("_") and not node.attr.endswith("__")
                assert not private or node.attr in allowed, f"{name}, line {node.lineno}: {ast.unparse(node)}"
            elif isinstance(node, ast.ImportFrom):
                private = [x.name for x in node.names if x.name.startswith("_") and x.name not in allowed]
                assert not private or node.module == "__future__", f"{name}, line {node.lineno}: {private}"


TRANSLATORS = {
    *("compiled/store.py", "nodes/support/publishing.py", "wire/joint_states.py", "bags/ros1_reader.py"),
    *("cli/compile.py", "recordings/intake.py", "model/meshes.py", "model/named.py", "model/urdf.py"),
    *("model/xacro_files.py", "wire/odometry.py"),
}
"""Files that turn whatever numba, rclpy, robot_descriptions, rosbags, trimesh, yourdfpy or xacro raises into an exception of
this package's, or a line of their own, or do without."""


def test_one_guard_keeps_nodes_from_ending():
    """What arrives is done by guard.attempt: nobody else catches exceptions that he does not know."""
    for path in SOURCES:
        name = path.relative_to(ROOT / "diag_dynamics").as_posix()
        if name in TRANSLATORS | {"nodes/support/guard.py"}:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ExceptHandler) and ast.unparse(node.body[-1]) != "raise":
                caught = ast.unparse(node.type) if node.type else "everything"
                assert caught not in ("everything", "Exception", "BaseException"), f"{name}, line {node.lineno}"


def test_ros_only_in_nodes_and_pinocchio_nowhere():
    """Outside of nodes/ nothing is imported but the library's own dependencies, so no package of ROS, known or not."""
    for path in SOURCES:
        found = set(imports(path))
        assert not {name.split(".")[0] for name in found} & {"pinocchio", "pin"}, path
        if "nodes" not in path.relative_to(ROOT / "diag_dynamics").parts:
            others = {name.split(".")[0] for name in found} - {"diag_dynamics"}
            assert others <= WITHOUT_ROS, path
            assert not {name.split(".")[1] for name in found if name.count(".")} & INTERFACES, path


def test_imports_are_found_in_this_tree():
    """What executables, launch files, benchmarks and tests import of ours is here: an older install hides what is missing.

    Programs that tests hold as text count as well.
    """
    files = [path for path in (ROOT / "scripts").iterdir() if path.is_file() and path.suffix != ".bash"]
    files += [
        path for room in ("diag_dynamics", "launch", "benchmarks", "test") for path in (ROOT / room).rglob("*.py")
    ]
    found = re.compile(r"^(?:.*[\"'])?\s*from (diag_dynamics(?:\.\w+)*) import \(?\s*(\w+)", re.M)
    for path in files:
        for module, name in found.findall(path.read_text(encoding="utf-8")):
            if INTERFACES & {*module.split("."), name}:
                continue
            place = ROOT.joinpath(*module.split("."))
            source = next((s for s in (place.with_suffix(".py"), place / "__init__.py") if s.is_file()), None)
            assert source, f"{path} imports {module}, which is not there"
            inside = (place / name).is_dir() or (place / f"{name}.py").is_file()
            assert inside or re.search(rf"\b{name}\b", source.read_text(encoding="utf-8")), f"{path}: {module}.{name}"


def test_compiled_code_knows_what_it_is_made_of():
    """Whatever has kernels, and all that it imports of ours, lies where a change makes compiled code stale."""
    from diag_dynamics.compiled.cache import ROOMS

    package = ROOT / "diag_dynamics"
    for path in SOURCES:
        made_of = set(imports(path))
        if not any(name.startswith("diag_dynamics.compiled.kernel") for name in made_of):
            continue
        modules = {package.parent / (name.replace(".", "/") + ".py") for name in made_of if "diag_dynamics." in name}
        for module in {path, *modules & set(SOURCES)}:
            assert any((package / room) in module.parents for room in ROOMS), f"{module}, of which {path} is made"


def test_what_numba_keeps_to_itself_is_used_in_one_room():
    """Another numba may have changed it; and what DIAG_DYNAMICS_PLAIN leads to does without."""
    for path in SOURCES:
        private = {name for name in imports(path) if name.split(".")[0] == "llvmlite" or name.startswith("numba.core")}
        fenced = path.parent.name == "compiled" and path.stem not in ("plain", "single", "kernel", "lanes", "arrays")
        assert fenced or not private, f"{path} imports {sorted(private)}"


def test_importing_the_package_is_cheap():
    """Who imports only a message does not wait for numba, yourdfpy or rclpy."""
    script = "import sys, diag_dynamics; print(sorted({'numba', 'yourdfpy', 'rclpy', 'numpy'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_public_names_are_there():
    for name in dd.__all__:
        value = getattr(dd, name)
        assert value.__doc__
        # An installed copy lies on the path of the package, too, and its modules would stand in for those that have moved.
        assert Path(inspect.getsourcefile(value)).is_relative_to(ROOT), name
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


def node_parameters(node):
    return import_module(f"diag_dynamics.parameters.{node}").PARAMETERS


# --- Launching and installing ---


@pytest.mark.parametrize("path", sorted((ROOT / "launch").glob("*.py")), ids=lambda path: path.name)
def test_launch_files_name_what_exists(path):
    """Each starts the launch of its name, whose executables are installed and have files of parameters."""
    name = path.name.removesuffix(".launch.py")
    text = path.read_text(encoding="utf-8")
    compile(text, str(path), "exec")
    assert 'def generate_launch_description():\n    """' in text and f'return launched("{name}")' in text
    for executable in LAUNCHES[name].given:
        assert (ROOT / "scripts" / executable).is_file()
        assert (ROOT / "config" / f"{executable}.yaml").is_file()


@pytest.mark.ros
@pytest.mark.parametrize("name", LAUNCHES)
def test_arguments_of_launches_are_parameters(name):
    """What a launch takes and gives are parameters of its nodes, and it lists none that has no effect."""
    launch = LAUNCHES[name]
    listed = set(arguments_of(launch)) - {"namespace", "params_file", "clock_topic", "urdf", *launch.optional}
    free = {text[1:] for given in launch.given.values() for text in given.values() if text.startswith("$")}
    for node, given in (launch.given | launch.optional).items():
        assert set(given) <= set(ARGUMENTS[node])
        assert set(ARGUMENTS[node]) <= {"robot_compensates_gravity", "use_sim_time", *node_parameters(node)}
        free |= set(ARGUMENTS[node]) - set(given)
    assert listed == free
    assert set(launch.defaults) <= free


def test_misspelt_arguments_are_told_of():
    """An argument that is nearly another one, or that a launch decides, is told of; those of a launch around it are not."""
    said = misspelt(LAUNCHES["control"], {"robot_compensate_gravity": "true", "rviz": "true", "urdf": "x.urdf"})
    assert said == [
        "argument 'robot_compensate_gravity' is not known, and has no effect: is 'robot_compensates_gravity' meant?"
    ]
    assert misspelt(LAUNCHES["control"], {"use_sim_time": "true"}) == []
    (said,) = misspelt(LAUNCHES["control"], {"publish_clock": "false"})
    assert said == "argument 'publish_clock' has no effect: this launch says itself what it is."
    assert misspelt(LAUNCHES["demo"], {"publish_clock": "false"}) == []


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
    tests = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "test").rglob("test_control*.py"))
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
        {"urdf": "<robot>1: x</robot>", "view": "true"},
        {"simulator": {"robot_description": "<robot>1: x</robot>"}, "monitor": {}, "view": {}},
    ),
    "control": (
        {"robot_compensates_gravity": "true", "command_timeout": "0.2", "view": "false"},
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


LAUNCH_CASES = pytest.mark.parametrize(
    ("file", "arguments", "expected"), [(f, *case) for f, case in LAUNCHED.items()], ids=LAUNCHED
)


@LAUNCH_CASES
def test_launches_give_what_they_say(file, arguments, expected):
    """Each node has the same name as by itself, its namespace, a clock of its robot's, and the parameters that are given."""
    launch = LAUNCHES[file]
    values = {name: default for name, (default, _) in arguments_of(launch).items()} | arguments
    found = {}
    for node in started(launch, values | {"params_file": "~/robot.yaml"}):
        assert (node.name, node.namespace) == (NODES[node.executable], arguments.get("namespace", ""))
        assert node.remappings == {"/clock": "/clock" if file in ("monitor", "controller") else "clock"}
        assert node.params_file == str(Path.home() / "robot.yaml")
        found[node.executable] = {
            name: kind(yaml.safe_load(text) if kind is bool else text) for name, (kind, text) in node.parameters.items()
        }
    assert found == expected
    assert NODES == {
        "monitor": "diag_dynamics",
        "simulator": "diag_dynamics_simulator",
        "controller": "diag_dynamics_controller",
        "view": "diag_dynamics_view",
    }


@LAUNCH_CASES
def test_launch_files_launch(file, arguments, expected):
    """By launch itself, which prints what it would start; its files of parameters say what each node would be given."""
    pytest.importorskip("launch_ros", reason="launch and launch_ros are not on PyPI, only in an installed ROS 2")
    path = str(ROOT / "launch" / f"{file}.launch.py")
    given = [f"{name}:={value}" for name, value in (arguments | {"launch-prefix": "echo"}).items()]
    done = subprocess.run([sys.executable, "-c", LAUNCH, path, *given], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    executables, found = {name: executable for executable, name in NODES.items()}, {}
    for line in done.stdout.splitlines():
        if name := re.search(r"__node:=(\w+)", line):
            node = executables[name[1]]
            files = re.findall(r"--params-file (\S+)", line)
            assert Path(files[0]).name == f"{node}.yaml"
            assert ("__ns:=/arm" in line) == ("namespace" in arguments)
            assert f"/clock:={'/clock' if file in ('monitor', 'controller') else 'clock'}" in line
            sections = [yaml.safe_load(Path(path).read_text(encoding="utf-8")).values() for path in files[1:]]
            tables = [section["ros__parameters"] for of_file in sections for section in of_file]
            found[node] = {key: value for table in tables for key, value in table.items()}
    assert found == expected


def test_package_xml_is_complete():
    package = ET.parse(ROOT / "package.xml").getroot()
    assert package.get("format") == "3"
    assert package.findtext("version") == dd.__version__
    assert package.findtext("export/build_type") == "ament_cmake"
    declared = {e.text for e in package if e.tag.endswith("depend")}
    third_party = {"numba", "numpy", "lxml", "yourdfpy", "rich", "matplotlib"}
    keys = {name: f"python3-{name}" for name in third_party} | {
        "yourdfpy": "python3-yourdfpy-pip",
        "yaml": "python3-yaml",
    }
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
    script = (
        "import diag_dynamics as dd; print(dd.load_urdf, dd.DiagonalDynamics, dd.Simulation)\n"
        "from diag_dynamics.wire.ours import our_definitions\n"
        "assert 'diag_dynamics/msg/DiagonalizedState' in our_definitions()"
    )
    clean = {"PATH": "/usr/bin", "PYTHONPATH": f"{target}", "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, env=clean, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_readme_program_runs(tmp_path):
    """The program in the README, as it stands there, in a folder without anything."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"<!-- test: run -->\n```python\n(.*?)```", text, re.S)
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=None, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert abs(float(done.stdout.split()[-1])) < 1e-12


def test_file(name):
    """Path of a test's file, in whichever folder of test/ it is."""
    return next((ROOT / "test").rglob(name))


test_file.__test__ = False  # it is no test


def defined(path):
    """Names of a file's functions and classes, and of their methods as Class.method."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        if isinstance(node, ast.ClassDef):
            yield from (f"{node.name}.{one.name}" for one in node.body if isinstance(one, ast.FunctionDef))


def test_the_map_of_the_paper_says_where():
    """docs/paper.md: the last cell but one of each row names functions as file::function, or says that the test forms it."""
    rows = [
        re.split(r"(?<!\\)\|", line)[1:-1]
        for line in (ROOT / "docs" / "paper.md").read_text().splitlines()
        if "|" in line
    ]
    rows = [row for row in rows if row[0].strip() not in ("number", "claim") and "---" not in row[0]]
    assert len(rows) > 50
    for row in rows:
        where = row[-2].strip()
        named = re.findall(r"`([\w/]+\.py)::([\w.]+)`", where)
        if not named:
            assert where == "*in the test*" and "*in the test*" in row[2], row
        for file, name in named:
            assert name in set(defined(ROOT / "diag_dynamics" / file)), f"{file}::{name}"


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
            source = test_file(file or "test_paper_identities.py").read_text(encoding="utf-8")
            assert re.search(rf"^def {function}\(", source, re.M), name
        for name in set(named) - set(tests):
            if name.startswith("spatial."):
                assert hasattr(spatial, name.removeprefix("spatial.")), name
            elif "::" in name:
                continue  # see above
            elif name.endswith(".py"):
                assert (ROOT / name).exists() or test_file(name), name
            else:
                assert name.split()[0] in public, name
