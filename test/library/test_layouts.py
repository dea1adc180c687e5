# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Layouts of viewers: every topic in them is the monitor's, every field its message's, every index a joint's."""

import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.exceptions import InputError
from diag_dynamics.layouts.foxglove import TITLES
from diag_dynamics.layouts.panels import panels
from diag_dynamics.layouts.rviz import SPACES
from diag_dynamics.layouts.tools import TOOLS, layout
from diag_dynamics.nodes.support.topics import TOPICS
from diag_dynamics.yaml_files import parsed_yaml

ROOT = Path(__file__).parents[2]
TYPES = {topic.name: topic.type for topic in TOPICS}

ROBOTS = pytest.mark.parametrize(("robot", "floating"), [("panda", False), ("go2", True), ("talos_full_v2", False)])


def model_of(robot, floating=False):
    return dd.load_robot(robot, floating_base=floating)


def fields(kind):
    """Types of a message's fields by name, as its definition has them."""
    if kind == "sensor_msgs/JointState":
        return {"name": "string[]"} | dict.fromkeys(("position", "velocity", "effort"), "float64[]")
    text = (ROOT / "msg" / f"{kind}.msg").read_text(encoding="utf-8")
    return {name: kind for kind, name in re.findall(r"^([\w/]+(?:\[\])?) +(\w+)", text, re.M)}


def check(model, topic, field, index, label):
    """A number over time: a number of a message, or the entry of the joint that the label names."""
    assert fields(TYPES[topic])[field] == ("float64" if index is None else "float64[]")
    if index is not None:
        assert label == model.dof_names[index]
        zero = np.zeros(model.nv)
        s = dd.DiagonalDynamics(model).evaluate(model.neutral, zero, zero)
        found = zero if field == "external_torque" else getattr(s, field)
        assert len(found) == model.nv  # an entry for each joint, and no other number of them


def leaves(tree):
    """Ids of the panels in a tree of splits."""
    if isinstance(tree, str):
        return [tree]
    assert tree["direction"] in ("row", "column") and 0 < tree["splitPercentage"] < 100
    return leaves(tree["first"]) + leaves(tree["second"])


@ROBOTS
@pytest.mark.parametrize("tool", ["foxglove", "lichtblick"])
def test_foxglove_and_lichtblick(robot, floating, tool):
    model = model_of(robot, floating)
    content = json.loads(layout(tool, model, "/cell/diag_dynamics"))
    assert set(content) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    by_id = content["configById"]
    ids = leaves(content["layout"])
    assert sorted(ids) == sorted(by_id) and len(set(ids)) == len(ids)
    assert {one.split("!")[0] for one in ids} == {"3D", "Plot", "DiagnosticSummary"}
    assert all(TITLES[tool] in config for config in by_id.values())
    plotted = set()
    for config in (config for one, config in by_id.items() if one.startswith("Plot!")):
        assert config["paths"] and config["xAxisVal"] == "timestamp" and "[" in config[TITLES[tool]]
        for path in config["paths"]:
            topic, field, index = re.fullmatch(
                r"/cell/diag_dynamics/(\w+)\.(\w+)(?:\[(\d+)\])?", path["value"]
            ).groups()
            check(model, topic, field, None if index is None else int(index), path["label"])
            assert path["enabled"] and re.fullmatch("#[0-9A-F]{6}", path["color"])
            plotted.add((topic, field, index))
    assert {("kinetic_energy", "energy_share", str(model.nv - 1)), ("kinetic_energy", "total", None)} <= plotted
    space = by_id["3D!robot"]
    (topic,) = space["topics"]
    assert topic == "/cell/diag_dynamics/markers" and TYPES["markers"] == "visualization_msgs/MarkerArray"
    assert space["followTf"] == model.root_link


@ROBOTS
def test_plotjuggler(robot, floating):
    model = model_of(robot, floating)
    root = ET.fromstring(layout("plotjuggler", model, "/cell/diag_dynamics").split("\n", 1)[1])
    renamed = {one.get("name"): one.findtext("linked_source") for one in root.findall("customMathEquations/snippet")}
    assert {one.findtext("function") for one in root.findall("customMathEquations/snippet")} == {"return value"}
    assert root.find("tabbed_widget").get("parent") == "main_window"
    plugin = root.find("Plugins/plugin")
    assert root.find("previouslyLoaded_Streamer").get("name") == plugin.get("ID") == "ROS2 Topic Subscriber"
    assert int(plugin.find("max_array_size").get("value")) >= model.nv
    chosen, heard, curves = plugin.find("selected_topics").get("value").split(";"), set(), []
    for splitter in root.findall("tabbed_widget/Tab/Container/DockSplitter"):
        areas = splitter.findall("DockArea")
        sizes = [float(size) for size in splitter.get("sizes").split(";")]
        assert len(areas) == len(sizes) == int(splitter.get("count")) and sum(sizes) == pytest.approx(1.0, abs=1e-5)
        curves += [curve.get("name") for curve in splitter.findall("DockArea/plot/curve")]
    assert len(curves) == len(set(curves)) and set(renamed) < set(curves)
    for curve in curves:
        path = renamed.get(curve, curve).removeprefix("/cell/diag_dynamics/")
        topic, rest = path.split("/", 1)
        heard.add(f"/cell/diag_dynamics/{topic}")
        if topic == "named":
            joint, field = rest.rsplit("/", 1)
            assert joint in model.dof_names and fields(TYPES[topic])[field] == "float64[]"
            continue
        field, index = re.fullmatch(r"(\w+?)(?:\[(\d+)\])?", rest).groups()
        label = curve.removeprefix(f"cell/{field}/") if index else None
        check(model, topic, field, None if index is None else int(index), label)
    assert sorted(heard) == chosen


@ROBOTS
def test_rviz(robot, floating):
    model = model_of(robot, floating)
    content = parsed_yaml(layout("rviz", model, "/cell/diag_dynamics"), "the layout")
    assert set(content) == {"Panels", "Visualization Manager", "Window Geometry"}
    manager = content["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == model.root_link
    shown = {display["Class"].removeprefix("rviz_default_plugins/"): display for display in manager["Displays"]}
    assert set(shown) == {"Grid", "MarkerArray", "RobotModel"}
    markers = shown["MarkerArray"]
    assert markers["Enabled"] and markers["Topic"]["Value"] == "/cell/diag_dynamics/markers"
    assert markers["Topic"]["Reliability Policy"] == "Reliable"
    described = shown["RobotModel"]
    assert described["Description Topic"]["Value"] == "/cell/robot_description" and not described["Enabled"]
    assert described["Description Topic"]["Durability Policy"] == "Transient Local"
    assert manager["Views"]["Current"]["Distance"] > 0.3


def test_namespaces_are_those_of_the_markers():
    pytest.importorskip("visualization_msgs", reason="no ROS 2")
    from diag_dynamics.assembly.assembler import RobotState
    from diag_dynamics.model.example_robots import find_urdf
    from diag_dynamics.nodes.monitor.markers import MarkerMaker
    from diag_dynamics.views.scene import Scene

    model = model_of("ur5")
    dynamics, zero = dd.DiagonalDynamics(model), np.zeros(model.nv)
    message = MarkerMaker(Scene(dynamics, find_urdf("ur5"))).message(
        dynamics.evaluate(model.neutral, zero), RobotState(model.neutral, zero, None, 0, 0, False)
    )
    assert tuple(dict.fromkeys(marker.ns for marker in message.markers)) == SPACES


def test_panels_have_units_and_joints():
    model = model_of("panda")
    for panel in panels(model):
        assert re.search(r"\[[^]]+\]$", panel.title) and re.fullmatch("[a-z]+", panel.name)
        numbered = [one for one in panel.series if one.index is not None]
        assert len(numbered) in (0, model.nv)


@pytest.mark.parametrize("monitor", ["diag_dynamics", "/arm/", ""])
def test_a_name_has_to_be_whole(monitor):
    with pytest.raises(InputError, match="expected its whole name"):
        layout("rviz", model_of("ur5"), monitor)


# --- The command ---


def command(*arguments, **options):
    return subprocess.run(
        [sys.executable, "-m", "diag_dynamics", "layout", *arguments],
        capture_output=True,
        text=True,
        cwd=ROOT,
        **options,
    )


def test_command_writes_a_file(tmp_path):
    """By its name, or on stdout; with the parameters that the monitor has; and says that nobody has tried it."""
    for tool in TOOLS:
        path = tmp_path / f"my {tool}"
        done = command("--tool", tool, "panda", "-o", str(path))
        assert done.returncode == 0 and not done.stdout
        assert f"Wrote {path}" in done.stderr and f"not been tried with {TOOLS[tool].title} itself" in done.stderr
        if "FILE" in TOOLS[tool].opened:  # a command that can be pasted
            assert f"'{path}'." in done.stderr
        assert path.read_text(encoding="utf-8") == layout(tool, model_of("panda"))
    free = command("--tool", "foxglove", "panda", "--set", "mimic=free", "--monitor", "/x/m")
    model = dd.load_robot("panda", mimic="free")
    assert free.stdout == layout("foxglove", model, "/x/m") and "panda_finger_joint2" in free.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["panda"], "required: --tool"),
        (["--tool", "rqt", "panda"], "invalid choice: 'rqt'"),
        (["--tool", "rviz", "lost.urdf"], "lost.urdf"),
        (["--tool", "rviz", "panda", "--monitor", "x"], "expected its whole name"),
        (["--tool", "rviz", "panda", "-o", "nowhere/x.rviz"], "there is no folder"),
    ],
)
def test_command_says_what_is_wrong(arguments, said):
    done = command(*arguments)
    assert done.returncode == 2 and said in done.stderr and not done.stdout
