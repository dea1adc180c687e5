# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Views without a terminal, a viewer or a browser: `top`, layouts, and the picture of energies."""

import json
import math
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest
from PIL import Image, ImageColor

import diag_dynamics as dd
from diag_dynamics.cli.main import main
from diag_dynamics.layouts.tools import TOOLS, layout
from diag_dynamics.nodes.support.topics import TOPICS
from diag_dynamics.views.energy_history import PALETTE, EnergyHistory
from diag_dynamics.views.top.choices import SORTS, WINDOWS, Choices, keys_of
from diag_dynamics.views.top.frame import Shown, _cells, frame, line_of
from diag_dynamics.views.top.history import RobotHistory
from diag_dynamics.views.top.quantities import ENERGY, EXTERNAL, QUANTITIES, TORQUE, columns
from diag_dynamics.yaml_files import parsed_yaml

mpl.use("agg")

CODES = re.compile(r"\x1b\[[0-9;]*m")


def state(nu, effort=None, **fields):
    nu = np.array(nu, dtype=float)
    told = {"nu": nu, "velocity": 0.5 * nu, "coriolis": np.flip(nu), "articulated_inertia": np.ones(len(nu))}
    told |= {"effort_valid": effort is not None, "effort": () if effort is None else effort}
    return SimpleNamespace(**(told | fields))


def moving(count, seconds=20.0, names=None, rate=50.0):
    """A history of joints that swing, each at its own pace."""
    history = RobotHistory(names or [f"joint_{k}" for k in range(count)])
    w, size = np.linspace(0.5, 3.0, count), np.linspace(3.0, 0.3, count)
    for k in range(round(seconds * rate)):
        t = k / rate
        history.add(100.0 + t, columns(state(size * np.sin(w * t), 60.0 * np.sin(w * t)), 5.0 * np.cos(w * t)))
    return history


def robots(*counts, **fields):
    return [Shown(f"/robot_{k}", moving(count), 50.0, 0.001, -1.5, 0.1, **fields) for k, count in enumerate(counts)]


def plain(lines):
    return [CODES.sub("", line) for line in lines]


def test_peaks_are_of_every_state():
    """However many come in a slot, and whatever their sign, until a restart."""
    history = RobotHistory(["a", "b"])
    for k in range(1000):
        torque = -9.0 if k == 501 else 1.0
        history.add(5.0 + 1e-3 * k, columns(state([1.0 if k != 300 else 4.0, 0.0], [torque, 0.5]), None))
    assert history.peak[TORQUE].tolist() == [9.0, 0.5] and history.peak_at[TORQUE, 0] == pytest.approx(5.501)
    assert history.total_peak == 8.0 and history.total_peak_at == pytest.approx(5.3)
    assert np.nanmax(history.recent(10.0, TORQUE, 40)) == 9.0  # drawn, too
    assert history.last[TORQUE].tolist() == [1.0, 0.5] and history.last[ENERGY].tolist() == [0.5, 0.0]
    assert np.isnan(history.last[EXTERNAL]).all()
    history.restart()
    assert not history.peak.any() and history.total_peak == 0.0


@pytest.mark.parametrize(("size", "colours"), [((80, 24), True), ((200, 60), False), ((3, 2), True)], ids=str)
def test_every_frame_fits(size, colours):
    """For one joint and for sixty: as many lines as there are, none of them too long."""
    width, height = size
    shown = robots(7, 60, torque=(3.0, 8.0), residual=(1.0, math.inf))
    shown[1].alarm = "collision: joint_3, joint_17"
    shown.append(Shown("/nobody_has_come_here_yet", waiting="waiting for states on /nobody/has/come/here/yet/state"))
    for robot in range(len(shown)):
        for quantity in range(len(QUANTITIES)):
            for how in ({}, {"sort": 3}, {"help": True}, {"overview": True}, {"typing": True, "wanted": "_1"}):
                choices = Choices()
                for name, value in (how | {"robot": robot, "quantity": quantity}).items():
                    setattr(choices, name, value)
                lines = frame(shown, choices, width, height, colours, fancy=colours)
                assert len(lines) == height
                assert max(_cells(line) for line in plain(lines)) <= width
                assert colours or not any("\x1b" in line for line in lines)


def test_limits_alarms_and_silence():
    """A quantity near or above its limit, an alarm and a silent robot are marked, in a frame and in a line."""
    shown, choices = robots(3), Choices()
    history = shown[0].history
    history.limits[TORQUE] = abs(history.last[TORQUE]) / [0.3, 0.8, 1.5]
    choices.quantity = TORQUE
    rows = {line.split()[0].split("m")[-1]: line for line in frame(shown, choices, 80, 24) if "joint_" in line}
    for name, code, part in (("joint_0", "32", "30 %"), ("joint_1", "33", "80 %"), ("joint_2", "1;31", "150 %")):
        assert f"\x1b[1;{code}m" in rows[name] and part in rows[name]
    shown[0].alarm, shown[0].silent = "collision: joint_2", 4.2
    text = "".join(frame(shown, Choices(), 80, 24))
    assert "\x1b[1;31mALARM collision: joint_2" in text and "no state for 4.20 s" in text
    assert line_of(shown[0]) == "/robot_0: no state for 4.20 s"
    shown[0].silent = 0.0
    line = line_of(shown[0])
    assert line.startswith("/robot_0: K ") and line.isascii()


@pytest.mark.parametrize(
    "thresholds",
    [{"joints": 100.0}, {"torque": (5.0, 100.0)}, {"residual": (2.0, 40.0)}],
    ids=["of joints", "of the norm of m r", "of |r|"],
)
def test_external_torque_far_below_its_threshold_looks_small(thresholds):
    """The threshold is the scale of the chart and of the bars of joints: noise of 5 N m is not a contact of 100 N m."""
    (shown,) = robots(4)
    shown.history.set_thresholds([thresholds.get("joints", math.inf)] * 4)
    shown.torque, shown.residual = (
        thresholds.get("torque", (5.0, math.inf)),
        thresholds.get("residual", (2.0, math.inf)),
    )
    choices = Choices()
    choices.quantity = EXTERNAL
    for factor, tall in ((1.0, False), (30.0, True)):
        shown.history.add(shown.history.newest + 0.1, columns(state(np.ones(4)), np.full(4, 5.0 * factor)))
        shown.residual = shown.residual[0] * factor, shown.residual[1]
        lines = plain(frame([shown], choices, 80, 30))
        drawn = "".join(line[-50:] for line in lines[2:-1])
        assert ("█" in drawn or "⣿" in drawn) == tall, drawn


def names_shown(choices):
    lines = plain(frame(robots(20), choices, 80, 30))
    return [line.split()[0] for line in lines if line.startswith("joint_")]


def test_keys():
    """Quantity, order, window, pause, help, filter, robot, restart, scrolling, quit."""
    assert keys_of("a\x1b[C\x1bOD\x1b\x1b[15~é\t\x1b[Z") == ["a", "right", "left", "escape", "é", "\t", "back"]
    choices = Choices()
    choices.take("3s" + "+" * 9 + " ?")
    assert (choices.quantity, SORTS[choices.sort], choices.window) == (EXTERNAL, "value", WINDOWS[-1])
    assert choices.paused and choices.help
    choices.take("q" + "-" * 9 + "/elbq\x7f\r")
    assert not choices.help and not choices.ends and choices.window == WINDOWS[0]
    assert (choices.wanted, choices.typing) == ("elb", False)
    choices.take("\x1b\t\trq")
    assert choices.wanted == "" and choices.robot == 2 and choices.restarts and choices.ends
    choices, values = Choices(), moving(20).last[ENERGY]
    assert names_shown(choices)[:3] == ["joint_0", "joint_1", "joint_2"]
    choices.sort = SORTS.index("value")
    assert names_shown(choices)[0] == f"joint_{int(np.argmax(values))}"
    choices.sort, choices.wanted = 0, "_1"
    assert names_shown(choices) == ["joint_1", *(f"joint_{k}" for k in range(10, 20))]
    choices.wanted = ""
    choices.take("\x1b[B" * 100)
    assert names_shown(choices)[-1] == "joint_19" and choices.scroll < 20


def test_names_of_joints_do_nothing_to_the_terminal():
    shown = [Shown("/a\x1b[2J", moving(2, names=["\x1b]0;evil\x07", "名前のとても長い関節"]))]
    lines = frame(shown, Choices(), 40, 20, colours=False)
    assert "\x1b" not in "".join(lines) and "\x07" not in "".join(lines)
    assert max(map(_cells, lines)) <= 40 and any("関節" in line for line in lines)


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
