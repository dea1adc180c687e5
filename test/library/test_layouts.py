# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Layouts of viewers: every topic, field and index in them exists, and has the label of its joint."""

import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
import yaml

import diag_dynamics as dd
from diag_dynamics.cli.main import main
from diag_dynamics.nodes.support.topics import TOPICS

ROOT = Path(__file__).parents[2]
MONITOR = "/cell/diag_dynamics"
TYPES = {topic.name: topic.type for topic in TOPICS}


def check_number(model, topic, field, index):
    """Require that a field of a topic is a number of its message, or has an entry for each joint."""
    text = (ROOT / "msg" / f"{TYPES[topic]}.msg").read_text(encoding="utf-8")
    kinds = {
        name: kind for kind, name in re.findall(r"^([\w/]+(?:\[\])?) +(\w+)", text, re.MULTILINE)
    }
    assert (
        kinds[field] == ("float64" if index is None else "float64[]") and int(index or 0) < model.nv
    )


def layout(capsys, tool, robot, *options):
    """Return the output of the command."""
    assert main(["layout", "--tool", tool, robot, "--monitor", MONITOR, *options]) == 0
    return capsys.readouterr().out


def test_foxglove_plots_numbers_of_topics(capsys):
    model, plotted = dd.load_robot("go2", floating_base=True), set()
    panels = json.loads(layout(capsys, "foxglove", "go2", "--set", "floating_base=true"))[
        "configById"
    ]
    assert {one.split("!")[0] for one in panels} == {"3D", "Plot", "DiagnosticSummary"}
    for path in (path for panel in panels.values() for path in panel.get("paths", ())):
        topic, field, index = re.fullmatch(
            MONITOR + r"/(\w+)\.(\w+)(?:\[(\d+)\])?", path["value"]
        ).groups()
        check_number(model, topic, field, index)
        assert index is None or path["label"] == model.dof_names[int(index)]
        plotted.add((topic, field, index))
    assert {
        ("kinetic_energy", "energy_share", str(model.nv - 1)),
        ("kinetic_energy", "total", None),
    } <= plotted
    space = panels["3D!robot"]
    assert list(space["topics"]) == [f"{MONITOR}/markers"] and space["followTf"] == model.root_link


def test_plotjuggler_plots_numbers_of_topics(capsys):
    model, topics = dd.load_robot("panda", mimic="free"), set()
    root = ET.fromstring(
        layout(capsys, "plotjuggler", "panda", "--set", "mimic=free").split("\n", 1)[1]
    )
    sources = {
        one.get("name"): one.findtext("linked_source")
        for one in root.findall("customMathEquations/snippet")
    }
    curves = [curve.get("name") for curve in root.iter("curve")]
    assert len(curves) == len(set(curves)) and set(sources) < set(curves)
    for curve in curves:
        topic, rest = sources.get(curve, curve).removeprefix(f"{MONITOR}/").split("/", 1)
        field, index = re.fullmatch(r"(\w+?)(?:\[(\d+)\])?", rest).groups()
        check_number(model, topic, field, index)
        assert index is None or curve == f"cell/{field}/{model.dof_names[int(index)]}"
        topics.add(f"{MONITOR}/{topic}")
    assert root.find("Plugins/plugin/selected_topics").get("value").split(";") == sorted(topics)


def test_rviz_shows_the_markers():
    displays = yaml.safe_load((ROOT / "config" / "diag_dynamics.rviz").read_text())[
        "Visualization Manager"
    ]["Displays"]
    (markers,) = (display for display in displays if display["Class"].endswith("MarkerArray"))
    assert markers["Enabled"] and markers["Topic"]["Value"] == "/diag_dynamics/markers"


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ("lost.urdf", "lost.urdf"),
        ("panda --monitor x", "absolute name"),
        ("panda -o nowhere/x", "no folder"),
    ],
)
def test_errors_of_the_command(arguments, key, capsys, tmp_path):
    assert main(["layout", "--tool", "foxglove", "panda", "-o", str(tmp_path / "a layout")]) == 0
    assert (tmp_path / "a layout").exists()
    assert main(["layout", "--tool", "foxglove", *arguments.split()]) == 2
    printed = capsys.readouterr()
    assert key in printed.err and not printed.out
