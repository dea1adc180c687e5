# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Layouts of viewers, and the picture of energies."""

import json
import math
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from PIL import Image, ImageColor

import diag_dynamics as dd
from diag_dynamics.cli.main import main
from diag_dynamics.layouts.tools import TOOLS, layout
from diag_dynamics.nodes.support.topics import TOPICS
from diag_dynamics.views.energy_history import PALETTE, EnergyHistory
from diag_dynamics.yaml_files import parsed_yaml

mpl.use("agg")


MONITOR = "/cell/diag_dynamics"
TYPES = {topic.name: topic.type for topic in TOPICS}


def is_a_number(model, topic, field, index):
    """Return whether a field of a topic is a number of its message, or has an entry for each joint."""
    text = (Path(__file__).parents[2] / "msg" / f"{TYPES[topic]}.msg").read_text(encoding="utf-8")
    kinds = {name: kind for kind, name in re.findall(r"^([\w/]+(?:\[\])?) +(\w+)", text, re.MULTILINE)}
    return kinds[field] == ("float64" if index is None else "float64[]") and int(index or 0) < model.nv


@pytest.mark.parametrize("tool", ["foxglove", "lichtblick"])
def test_foxglove_plots_numbers_of_topics(tool):
    model = dd.load_robot("go2", floating_base=True)
    by_id = json.loads(layout(tool, model, MONITOR))["configById"]
    assert {one.split("!")[0] for one in by_id} == {"3D", "Plot", "DiagnosticSummary"}
    plotted = set()
    for config in (config for one, config in by_id.items() if one.startswith("Plot!")):
        for path in config["paths"]:
            topic, field, index = re.fullmatch(MONITOR + r"/(\w+)\.(\w+)(?:\[(\d+)\])?", path["value"]).groups()
            assert is_a_number(model, topic, field, index)
            assert index is None or path["label"] == model.dof_names[int(index)]
            plotted.add((topic, field, index))
    assert {("kinetic_energy", "energy_share", str(model.nv - 1)), ("kinetic_energy", "total", None)} <= plotted
    space = by_id["3D!robot"]
    assert list(space["topics"]) == [f"{MONITOR}/markers"] and space["followTf"] == model.root_link


def test_plotjuggler_plots_numbers_of_topics():
    model = dd.load_robot("panda")
    root = ET.fromstring(layout("plotjuggler", model, MONITOR).split("\n", 1)[1])
    renamed = {one.get("name"): one.findtext("linked_source") for one in root.findall("customMathEquations/snippet")}
    plugin, heard = root.find("Plugins/plugin"), set()
    assert int(plugin.find("max_array_size").get("value")) >= model.nv
    curves = [curve.get("name") for curve in root.iter("curve")]
    assert len(curves) == len(set(curves)) and set(renamed) < set(curves)
    for curve in curves:
        topic, rest = renamed.get(curve, curve).removeprefix(f"{MONITOR}/").split("/", 1)
        heard.add(f"{MONITOR}/{topic}")
        if topic == "named":
            assert rest.rsplit("/", 1)[0] in model.dof_names
            continue
        field, index = re.fullmatch(r"(\w+?)(?:\[(\d+)\])?", rest).groups()
        assert is_a_number(model, topic, field, index)
        assert index is None or curve == f"cell/{field}/{model.dof_names[int(index)]}"
    assert sorted(heard) == plugin.find("selected_topics").get("value").split(";")


def test_rviz_shows_the_robot_and_its_markers():
    model = dd.load_robot("talos_full_v2")
    manager = parsed_yaml(layout("rviz", model, MONITOR), "the layout")["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == model.root_link
    shown = {display["Class"].removeprefix("rviz_default_plugins/"): display for display in manager["Displays"]}
    assert set(shown) == {"Grid", "MarkerArray", "RobotModel"}
    assert shown["MarkerArray"]["Enabled"] and shown["MarkerArray"]["Topic"]["Value"] == f"{MONITOR}/markers"
    assert shown["RobotModel"]["Description Topic"]["Value"] == "/cell/robot_description"


def test_layout_command(tmp_path, capsys):
    """It writes a file, or prints the layout, with the parameters of the monitor."""
    for tool in TOOLS:
        path = tmp_path / f"my {tool}"
        assert main(["layout", "--tool", tool, "panda", "-o", str(path)]) == 0
        assert path.read_text(encoding="utf-8") == layout(tool, dd.load_robot("panda"))
    capsys.readouterr()
    assert main(["layout", "--tool", "foxglove", "panda", "--set", "mimic=free", "--monitor", "/x/m"]) == 0
    assert capsys.readouterr().out == layout("foxglove", dd.load_robot("panda", mimic="free"), "/x/m")
    for arguments, key in (
        (["rviz", "lost.urdf"], "lost.urdf"),
        (["rviz", "panda", "--monitor", "x"], "whole name"),
        (["rviz", "panda", "-o", "nowhere/x.rviz"], "no folder"),
    ):
        assert main(["layout", "--tool", *arguments]) == 2
        printed = capsys.readouterr()
        assert key in printed.err and not printed.out


def swings(length):
    """Return times [s], energy shares [J] of two joints, and powers [W], which all swing within 0.8 s."""
    t = np.arange(0.0, length, 0.02)
    angle = math.pi / 0.8 * t
    return t, np.stack([2.0 * np.sin(angle) ** 2, np.cos(angle) ** 2 + t / length], axis=1), 8.0 * np.sin(2.0 * angle)


def colour_fractions(path, *colours):
    """Return the fraction of nearly black pixels of a picture, and of those of each colour."""
    pixels = np.array(Image.open(path).convert("RGB"), dtype=int).reshape(-1, 3)
    near = [(abs(pixels - ImageColor.getrgb(colour)).max(axis=1) < 25).mean() for colour in colours]
    return (pixels.max(axis=1) < 100).mean(), *near


@pytest.mark.parametrize("length", [12.0, 600.0])
def test_the_picture_of_a_long_time_is_not_black(tmp_path, length):
    """Each joint has its colour after ten minutes, as after ten seconds."""
    samples = EnergyHistory(["shoulder", "elbow"])
    for t, shares, power in zip(*swings(length), strict=True):
        samples.add(1.7e9 + t, shares, power, 1e-16, 1e-3)
    samples.picture(tmp_path / "energy.png", "arm")
    dark, *of_joints = colour_fractions(tmp_path / "energy.png", *PALETTE[:2])
    assert dark < 0.06 and min(of_joints) > 2.0 * dark
