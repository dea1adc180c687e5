# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The launch files: each starts its nodes with the parameters that its arguments give."""

import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
import yaml

import diag_dynamics as dd
from diag_dynamics.nodes.support.launches import ARGUMENTS, LAUNCHES, arguments_of, misspelt, started
from diag_dynamics.nodes.support.names import NODES
from robots import robot_path

ROOT = Path(__file__).parents[2]


def node_parameters(node):
    return import_module(f"diag_dynamics.parameters.{node}").PARAMETERS


@pytest.mark.parametrize("name", LAUNCHES)
def test_launch_files_name_what_exists(name):
    """Each file starts the launch of its name, whose executables and parameter files are installed."""
    source = (ROOT / "launch" / f"{name}.launch.py").read_text(encoding="utf-8")
    compile(source, name, "exec")
    assert f'return launched("{name}")' in source
    for executable in LAUNCHES[name].given:
        assert (ROOT / "scripts" / executable).is_file()
        assert (ROOT / "config" / f"{executable}.yaml").is_file()


@pytest.mark.ros
@pytest.mark.parametrize("name", LAUNCHES)
def test_arguments_of_launches_are_parameters(name):
    """A launch lists each free parameter of its nodes, and no argument without effect."""
    launch = LAUNCHES[name]
    listed = set(arguments_of(launch)) - {"namespace", "params_file", "clock_topic", "urdf", *launch.optional}
    free = {text[1:] for given in launch.given.values() for text in given.values() if text.startswith("$")}
    for node, given in (launch.given | launch.optional).items():
        known = {"robot_compensates_gravity", "use_sim_time", *node_parameters(node)}
        assert set(given) <= set(ARGUMENTS[node]) <= known
        free |= set(ARGUMENTS[node]) - set(given)
    assert listed == free
    assert set(launch.defaults) <= free


def test_arguments_without_effect_are_reported():
    """A misspelt argument, or one that the launch sets, gives a warning; arguments of an outer launch do not."""
    given = {"robot_compensate_gravity": "true", "rviz": "true", "urdf": "x.urdf"}
    (warning,) = misspelt(LAUNCHES["control"], given)
    assert "'robot_compensate_gravity'" in warning
    assert "'robot_compensates_gravity'" in warning
    assert misspelt(LAUNCHES["control"], {"use_sim_time": "true"}) == []
    (warning,) = misspelt(LAUNCHES["control"], {"publish_clock": "false"})
    assert "'publish_clock' has no effect" in warning
    assert misspelt(LAUNCHES["demo"], {"publish_clock": "false"}) == []


def test_the_example_for_ros2_control_fits_together():
    """The controller commands the joints of the effort controller, in its order: those of the arm."""
    example = yaml.safe_load((ROOT / "config" / "effort_controllers.yaml").read_text(encoding="utf-8"))
    parameters = {node: section["ros__parameters"] for node, section in example.items()}
    own, joints = parameters["diag_dynamics_controller"], parameters["effort_controller"]["joints"]
    assert own["command_joints"] == joints
    assert set(joints) == set(dd.load_urdf(robot_path("ur_description/urdf/ur5_robot.urdf")).dof_names)
    assert set(own) - {"robot_compensates_gravity"} <= set(node_parameters("controller"))
    assert own["robot_compensates_gravity"] in (False, True)


LAUNCHED = {
    "monitor": ({}, {"monitor": {}}),
    "simulator": (
        {"urdf": "/my.urdf", "command_timeout": "2", "without_command": "zero"},
        {"simulator": {"robot_description": "/my.urdf", "command_timeout": 2.0, "without_command": "zero"}},
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
            "simulator": {"compensates_gravity": True, "publish_clock": True, "use_sim_time": False}
            | {"without_command": "brake", "command_timeout": 0.2},
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
"""Arguments of each launch file, and all parameters that it gives to its nodes."""

CASES = pytest.mark.parametrize(
    ("file", "arguments", "expected"), [(file, *case) for file, case in LAUNCHED.items()], ids=LAUNCHED
)


@CASES
def test_launches_give_parameters(file, arguments, expected):
    """Check names, namespaces, clocks and parameters of the nodes."""
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
"""What `ros2 launch` does."""


@pytest.mark.full
@CASES
def test_launch_files_launch(file, arguments, expected):
    """Have launch print its commands, and read the parameter files in them. PyPI has no launch_ros."""
    pytest.importorskip("launch_ros", reason="launch_ros comes with an installed ROS 2")
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
