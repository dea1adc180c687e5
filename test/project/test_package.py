# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The package as a whole: public names, dependencies, interfaces, versions, the map of the paper,
examples, launch files.
"""

import inspect
import json
import re
import runpy
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import yaml

import diag_dynamics as dd
from diag_dynamics.nodes.support.topics import NODES
from launches import LAUNCH_FILES, actions_of, launched
from robots import robot_path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "diag_dynamics"
SOURCES = {path: path.read_text(encoding="utf-8") for path in sorted(PACKAGE.rglob("*.py"))}


def test_public_names_are_importable():
    for name in dd.__all__:
        value = getattr(dd, name)
        assert value.__doc__
        assert Path(inspect.getsourcefile(value)).is_relative_to(ROOT), name
    assert {"load_urdf", "DiagonalDynamics", "RobotModel", "plot"} <= set(dir(dd))
    with pytest.raises(AttributeError):
        _ = dd.nonsense


def test_type_checkers_find_the_public_names():
    imported = re.findall(
        r"^    from diag_dynamics\S* import (\w+) as \1$", SOURCES[PACKAGE / "__init__.py"], re.M
    )
    assert sorted(imported) == dd.__all__


def test_importing_the_package_is_cheap():
    script = (
        "import sys, diag_dynamics; print({'numba', 'yourdfpy', 'rclpy', 'numpy'} & "
        "set(sys.modules))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "set()"


def test_way_of_a_urdf():
    """A plain arm passes at most ten modules; none is entered again from one that it calls."""
    path = robot_path("ur_description/urdf/ur5_robot.urdf")
    called_from = {}

    def module_of(frame):
        name = frame.f_globals.get("__name__", "")
        return name if re.match(r"diag_dynamics\.(description|model)\.", name) else None

    def profile(frame, event, _):
        if event != "call" or not (module := module_of(frame)):
            return
        caller = frame.f_back
        while caller and not module_of(caller):
            caller = caller.f_back
        if caller and module_of(caller) != module:
            called_from.setdefault(module, set()).add(module_of(caller))

    load_urdf = dd.load_urdf  # imports the modules
    sys.setprofile(profile)
    try:
        load_urdf(path)
    finally:
        sys.setprofile(None)
    assert len(list(TopologicalSorter(called_from).static_order())) <= 10


def test_errors_have_one_form():
    """It is `<name> is <value>; expected <condition>.`"""
    pattern = re.compile(r", expected (?!=|in )")
    assert [str(path) for path, source in SOURCES.items() if pattern.search(source)] == []


def test_each_file_has_a_name_of_its_own():
    """A node and its parameters share one."""
    names = Counter(path.name for path in SOURCES if path.parent.name != "parameters")
    assert {name for name, count in names.items() if count > 1} == {"__init__.py"}


# --- What is declared twice ---


def test_cmake_lists_every_interface():
    listed = re.findall(r"^\s+((?:msg|srv)/\w+\.\w+)$", (ROOT / "CMakeLists.txt").read_text(), re.M)
    interfaces = [*sorted((ROOT / "msg").glob("*.msg")), *sorted((ROOT / "srv").glob("*.srv"))]
    assert listed == [path.relative_to(ROOT).as_posix() for path in interfaces]


def imported_packages(source):
    """Return the names of the packages that a source imports."""
    return set(
        re.findall(r"^ *(?:import|from) (\w+)(?:\.\S+)?(?: as \w+| import .*)?$", source, re.M)
    )


def requirements(name):
    """Return a list of pyproject.toml: `dependencies`, or those of an extra."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    return set(json.loads(re.search(rf"^{name} = (\[.*\])$", text, re.M)[1]))


def rosdep_keys(kind=""):
    """Return the keys of package.xml, of all kinds or of one."""
    package = ET.parse(ROOT / "package.xml").getroot()
    return {element.text for element in package if element.tag.endswith(f"{kind}depend")}


def test_installers_of_rosdep_keys_are_listed():
    """rosdep rejects keys of pip unless the variable of the README is set."""
    text = (ROOT / "RELEASING.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (apt|pip)\b.* \| (`.*`) \|$", text, re.M)
    listed = [(key, installer) for installer, keys in rows for key in keys.strip("`").split("` `")]
    assert sorted(key for key, _ in listed) == sorted(rosdep_keys())
    assert all((installer == "pip") == key.endswith("-pip") for key, installer in listed)
    commands = (ROOT / "README.md").read_text(encoding="utf-8")
    assert "    PIP_BREAK_SYSTEM_PACKAGES=1 rosdep install " in commands


def test_the_image_installs_the_dependencies():
    """Those of pyproject.toml with their versions, and the Python packages of package.xml."""
    text = (ROOT / "deploy" / "Dockerfile").read_text(encoding="utf-8")
    command = re.search(r"&& pip install (?:.*\\\n)*.*", text)[0]
    installed = set(re.findall(r'"([^"]+)"', command))
    declared = set().union(*map(requirements, ("dependencies", "nodes", "plots")))
    versions = {re.split("[<>=]", name)[0] for name in declared}
    pips = {re.sub("^python3-|-pip$", "", key) for key in rosdep_keys("exec_") if "python3" in key}
    pips = {"pyyaml" if name == "yaml" else name for name in pips}
    assert installed == declared | (pips - versions)


def test_package_xml_declares_what_is_imported():
    """But for what recordings need, which pip alone has: `pip install
    diag_dynamics[recordings]`.
    """
    declared = rosdep_keys()
    keys = {
        name: f"python3-{name}"
        for name in ("aiohttp", "numba", "numpy", "lxml", "rich", "matplotlib", "scipy", "yaml")
    }
    keys |= {"yourdfpy": "python3-yourdfpy-pip", "llvmlite": keys["numba"]}
    declared |= {re.split("[<>=]", name)[0] for name in requirements("recordings")}
    packages = (
        set().union(*map(imported_packages, SOURCES.values()))
        - sys.stdlib_module_names
        - {"diag_dynamics"}
    )
    assert len(packages) > 15
    assert {keys.get(name, name) for name in packages} - declared == set()


def test_versions_and_licences_agree():
    """Compare package.xml, pyproject.toml and CITATION.cff."""
    package = ET.parse(ROOT / "package.xml").getroot()
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    licences = [element.text for element in package.iterfind("license")]
    assert package.findtext("version") == citation["version"] == dd.__version__
    assert f'license = "{" AND ".join(licences)}"' in (ROOT / "pyproject.toml").read_text(
        encoding="utf-8"
    )
    assert citation["license"] == licences[0]


# --- What breaks silently ---


def test_compiled_code_is_stale_after_any_change_of_its_sources():
    """The key of the cache has all modules that Python has imported for kernels: no import is of
    another form.
    """
    for path, source in SOURCES.items():
        if "from diag_dynamics.numerics" in source:
            lines = re.findall(r"^(?:import|from) .*diag_dynamics.*$", source, re.M)
            assert all(re.match(r"from diag_dynamics\S* import ", line) for line in lines), (
                f"{path}: {lines}"
            )


def test_one_writer_of_files():
    """The others write into its temporary file, into a folder of their own, or lock a kernel."""
    writing = re.compile(
        r"""\.write_(?:text|bytes)\(|open\([^)]*["'][wax]b?["']|FileIO\(|OSFile\("""
    )
    temporary = (
        "page/recording_page.py",
        "recordings/outputs/mcap.py",
        "recordings/outputs/table_files.py",
    )
    locks = ("numerics/cache.py",)
    expected = {"atomic_file.py", "cli/common.py", "recordings/bags.py", *temporary, *locks}
    writers = {path for path, source in SOURCES.items() if writing.search(source)}
    assert {str(path.relative_to(PACKAGE)) for path in writers} == expected


def test_the_page_makes_no_html_of_text():
    """Names in messages come from strangers."""
    forbidden = re.compile(
        r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function"
    )
    for path in (ROOT / "web" / "src").rglob("*.js"):
        assert not forbidden.search(path.read_text(encoding="utf-8")), path


# --- The map of the paper ---


def test_the_map_of_the_paper_names_what_exists():
    """In docs/paper.md each row names tests or a measurement, and functions as file::function."""
    tests = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "test").rglob("test_*.py"))
    rows = [
        line
        for line in (ROOT / "docs" / "paper.md").read_text(encoding="utf-8").splitlines()
        if line.startswith("| ")
    ]
    rows = [row for row in rows if not row.startswith(("| number", "| claim"))]
    assert len(rows) > 40
    for row in rows:
        named = re.findall(r"`(?:test_\w+\.py::)?(test_\w+)`", row)
        assert named or "measured:" in row, row
        assert [name for name in named if f"\ndef {name}(" not in tests] == []
        for file, function in re.findall(r"`([\w/]+\.py)::(?!test_)(?:\w+\.)?(\w+)`", row):
            assert re.search(rf"^ *(?:def|class) {function}\b", SOURCES[PACKAGE / file], re.M), (
                f"{file}::{function}"
            )


# --- Examples ---

EXAMPLES = ROOT / "examples"
ON_A_GRAPH = {"call.py", "echo.py"}
"""Programs that need nodes; test_smoke.py runs them."""

SCRIPTS = [path for path in sorted(EXAMPLES.glob("*.py")) if path.name not in ON_A_GRAPH]


@pytest.fixture
def empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["example"])


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_example(script, empty_folder, capsys):
    """It prints one line, without NaN, and the docs name it."""
    runpy.run_path(str(script), run_name="__main__")
    output = capsys.readouterr().out
    assert output.count("\n") == 1
    assert "nan" not in output.lower()
    assert f"| `{script.name}` |" in (ROOT / "docs" / "library.md").read_text(encoding="utf-8")
    if script.stem == "factors":
        residuals = re.findall(r"\d\.\de-\d+", output)
        assert len(residuals) == 5 and max(map(float, residuals)) < 1e-12


def test_notebook(empty_folder, capsys):
    """Its cells run one after the other and print what it shows."""
    import matplotlib

    matplotlib.use("agg")
    cells = json.loads((EXAMPLES / "first_steps.ipynb").read_text(encoding="utf-8"))["cells"]
    names = {}
    for k, cell in enumerate(cell for cell in cells if cell["cell_type"] == "code"):
        exec(compile("".join(cell["source"]), f"cell {k}", "exec"), names)
        shown = "".join(line for part in cell["outputs"] for line in part.get("text", ()))
        texts = [
            re.split(r"(-?\d[\d.]*(?:e-?\d+)?)", text) for text in (shown, capsys.readouterr().out)
        ]
        assert texts[0][::2] == texts[1][::2]
        numbers = [np.array(text[1::2], dtype=float) for text in texts]
        np.testing.assert_allclose(*numbers, rtol=1e-3, atol=1e-12)
    batch = names["batch"]
    np.testing.assert_allclose(
        batch.energy_share.sum(axis=1), batch.kinetic_energy, rtol=0.0, atol=1e-9
    )


# --- Launch files ---


def node_parameters(node):
    return import_module(f"diag_dynamics.parameters.{node}").PARAMETERS


def test_the_example_for_ros2_control_fits_together():
    """The controller commands the joints of the effort controller, in its order: those of the
    arm.
    """
    example = yaml.safe_load(
        (ROOT / "config" / "effort_controllers.yaml").read_text(encoding="utf-8")
    )
    parameters = {
        node.removeprefix("/**/"): section["ros__parameters"] for node, section in example.items()
    }
    values = parameters["diag_dynamics_controller"]
    joints = parameters["effort_controller"]["joints"]
    assert values["command_joints"] == joints
    assert set(joints) == set(
        dd.load_urdf(robot_path("ur_description/urdf/ur5_robot.urdf")).dof_names
    )
    assert set(values) - {"robot_compensates_gravity"} <= set(node_parameters("controller"))
    assert values["robot_compensates_gravity"] in (False, True)
    assert all(node.startswith("/**/") for node in example)  # in any namespace


TIME = {"use_sim_time": True}
LAUNCHED = {
    "monitor": ({"use_sim_time": "true", "view": "true"}, {"monitor": TIME, "view": TIME}),
    "simulator": (
        {"robot_description": "/my.urdf", "without_command": "zero"},
        {
            "simulator": {
                "robot_description": "/my.urdf",
                "without_command": "zero",
            }
        },
    ),
    "controller": (
        {"robot_compensates_gravity": "true", "autostart": "false"},
        {"controller": {"robot_compensates_gravity": True, "autostart": False}},
    ),
    "demo": (
        {"robot_description": "<robot>1: x</robot>", "view": "true"},
        {
            "simulator": {"robot_description": "<robot>1: x</robot>", "motion": "wave"},
            "monitor": {},
            "view": {},
        },
    ),
    "control": (
        {"robot_compensates_gravity": "true", "robot_description": "/my.urdf"},
        {
            "simulator": {
                "robot_description": "/my.urdf",
                "compensates_gravity": True,
            }
            | {"without_command": "brake", "command_timeout": 0.5},
            "controller": {"robot_compensates_gravity": True, "autostart": True},
            "monitor": {},
        },
    ),
}
"""Arguments of each launch file, and all parameters that it gives to its nodes."""


@pytest.mark.ros
@pytest.mark.parametrize("file", sorted({*LAUNCH_FILES} - {"ros2_control"}))
def test_launches_give_parameters(file):
    """Executables, names, namespaces and parameters of the nodes exist; without arguments
    params_file decides.
    """
    arguments, expected = LAUNCHED[file]
    nodes = launched(file, **arguments, namespace="arm", params_file="my.yaml")
    for executable, node in nodes.items():
        assert (node.name, node.namespace, node.files) == (NODES[executable], "arm", ["my.yaml"])
        assert (ROOT / "scripts" / executable).is_file()
        assert set(node.parameters) <= {
            "robot_compensates_gravity",
            "use_sim_time",
            *node_parameters(executable),
        }
    assert {executable: node.parameters for executable, node in nodes.items()} == expected
    for node in launched(file).values():
        assert not node.files and "robot_description" not in node.parameters


@pytest.mark.ros
@pytest.mark.parametrize("namespace", ["", "left/arm"])
def test_ros2_control_activates_efforts_last(namespace):
    """The node follows the inactive effort controller, which is activated when commands arrive."""
    arguments = {"namespace": namespace} if namespace else {}
    steps = actions_of("ros2_control", prefix="chrt -f 40", **arguments)
    manager, states, efforts, controller, command, switch = steps
    assert [manager.executable, states.executable, efforts.executable] == [
        "ros2_control_node",
        "spawner",
        "spawner",
    ]
    assert states.arguments[0] == "joint_state_broadcaster"
    assert efforts.arguments[:2] == ["effort_controller", "--inactive"]
    assert controller.name == NODES["controller"]
    assert {step.namespace for step in (manager, states, efforts, controller)} == {namespace}
    for step in (manager, controller):  # neither waits for a CPU or for Fast DDS's shared memory
        assert (step.prefix, *step.additional_env.values()) == ("chrt -f 40", "UDPv4")
    assert (efforts.starts_after, controller.starts_after) == (states, efforts)
    assert (command.starts_after, switch.starts_after) == (efforts, command)
    assert switch.has_handler  # errors are seen
    assert switch.cmd[2:5] == ["switch_controllers", "--activate", "effort_controller"]
    root = "/".join(["", *filter(None, [namespace])]).rstrip("/")
    assert switch.cmd[-1] == f"{root}/controller_manager"
    assert command.cmd[:4] == ["ros2", "topic", "echo", "--once"]
    assert f"{root}/effort_controller/commands" in command.cmd
    assert Path(manager.parameters[0]).samefile(ROOT / "config" / "effort_controllers.yaml")
    assert len(actions_of("ros2_control", activate="false")) == 4
    assert len(actions_of("ros2_control", activate="True")) == 6
