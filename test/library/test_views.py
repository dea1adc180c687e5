# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Views without a terminal, a viewer or a browser: `top`, layouts of viewers, the history of a push."""

import json
import math
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace

import matplotlib.image
import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.cli.main import main
from diag_dynamics.exceptions import InputError
from diag_dynamics.layouts.panels import panels
from diag_dynamics.layouts.tools import TOOLS, layout
from diag_dynamics.nodes.support.topics import TOPICS
from diag_dynamics.views.push_history import Moment, PushHistory, Seen
from diag_dynamics.views.top.choices import HELP, SORTS, WINDOWS, Choices, keys_of
from diag_dynamics.views.top.drawing import chart, number, sparkline
from diag_dynamics.views.top.frame import Shown, _cells, frame, line_of
from diag_dynamics.views.top.history import LONGEST, RobotHistory
from diag_dynamics.views.top.quantities import ENERGY, EXCHANGE, EXTERNAL, QUANTITIES, TORQUE, VELOCITY, columns
from diag_dynamics.yaml_files import parsed_yaml

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


# --- The history of `top`


def test_quantities_of_a_state():
    values = columns(state([2.0, 4.0], [10.0, -3.0]), np.array([1.0, -7.0]))
    assert values[ENERGY].tolist() == [2.0, 8.0] and values[TORQUE].tolist() == [10.0, -3.0]
    assert values[EXTERNAL].tolist() == [1.0, -7.0] and values[VELOCITY].tolist() == [1.0, 2.0]
    assert values[EXCHANGE].tolist() == [8.0, 8.0]
    unknown = columns(state([2.0, 4.0]), None)
    assert np.isnan(unknown[[TORQUE, EXTERNAL]]).all() and not np.isnan(unknown[ENERGY]).any()


def test_peaks_are_of_every_state():
    """However many come in a slot, and whatever their sign; begun anew when somebody wants it."""
    history = RobotHistory(["a", "b"])
    for k in range(1000):
        torque = -9.0 if k == 501 else 1.0
        history.add(5.0 + 1e-3 * k, columns(state([1.0 if k != 300 else 4.0, 0.0], [torque, 0.5]), None))
    assert history.peak[TORQUE].tolist() == [9.0, 0.5] and history.peak_at[TORQUE, 0] == pytest.approx(5.501)
    assert history.total_peak == 8.0 and history.total_peak_at == pytest.approx(5.3)
    assert np.nanmax(history.recent(10.0, TORQUE, 40)) == 9.0  # drawn, too
    assert np.nanmax(history.recent_total(10.0, 40)) == 8.0
    assert history.last[TORQUE].tolist() == [1.0, 0.5]
    history.restart()
    assert not history.peak.any() and history.total_peak == 0.0


def test_the_last_minute_and_no_more():
    history = moving(3, seconds=100.0)
    known = ~np.isnan(history.recent(LONGEST, ENERGY, 60)[:, 0])
    assert known.sum() >= 59
    assert history.newest == pytest.approx(199.98)
    history.add(3.0, columns(state([0.0, 0.0, 1.0]), None))  # time has gone back
    assert history.newest == 3.0 and (~np.isnan(history.recent(60.0, ENERGY, 60)[:, 0])).sum() == 1


@pytest.mark.parametrize("rate", [10.0, 500.0])
def test_parts_in_which_no_state_came(rate):
    """A slow driver's states are drawn as steps, and its silence as a gap."""
    history = moving(2, seconds=8.0, rate=rate)
    assert not np.isnan(history.recent(5.0, ENERGY, 400)[10:]).any()
    history.add(history.newest + 2.0, columns(state([1.0, 1.0]), None))
    missing = np.isnan(history.recent(5.0, ENERGY, 400)[:, 0])
    assert 130 < missing.sum() < 160


# --- Frames of `top`


def test_sparklines_and_charts():
    assert sparkline(np.array([0.0, 4.0, 8.0, np.nan]), 8.0) == "▁▄█ "
    assert sparkline(np.array([0.0, 4.0, 8.0, np.nan]), 8.0, fancy=False) == ".=@ "
    assert sparkline(np.array([0.0, np.nan]), 0.0) == "▁ "
    lines = chart(np.array([1.0, 2.0, np.nan, 8.0]), 8.0, 2)
    assert [len(line) for line in lines] == [2, 2]
    assert lines == ["⠀⢸", "⣠⢸"]
    assert chart(np.array([1.0, 8.0]), 8.0, 2, fancy=False) == [" #", "##"]
    assert chart(np.array([np.nan] * 4), 0.0, 3) == [chr(0x2800) * 2] * 3


def test_numbers_keep_their_width():
    for value in (0.0, 1.234, -9.9999, 12.3, 99.996, -123.4, 99999.4, 1e7, -1e-5, math.nan):
        assert len(number(value)) == 8, value


@pytest.mark.parametrize("colours", [True, False])
@pytest.mark.parametrize("size", [(80, 24), (200, 60), (20, 8), (3, 2)], ids=str)
def test_every_frame_fits(size, colours):
    """Whatever is chosen, for one joint and for sixty: as many lines as there are, none of them too long."""
    width, height = size
    shown = robots(7, 60, 1, torque=(3.0, 8.0), residual=(1.0, math.inf))
    shown[1].alarm = "collision: joint_3, joint_17"
    shown.append(Shown("/nobody_has_come_here_yet", waiting="waiting for states on /nobody/has/come/here/yet/state"))
    shown[0].history.limits[TORQUE] = 50.0
    for robot in range(len(shown)):
        for quantity in range(len(QUANTITIES)):
            for how in ({}, {"sort": 3}, {"help": True}, {"overview": True}, {"typing": True, "wanted": "_1"}):
                choices = Choices()
                choices.robot, choices.quantity = robot, quantity
                for name, value in how.items():
                    setattr(choices, name, value)
                lines = frame(shown, choices, width, height, colours, fancy=colours)
                assert len(lines) == height
                assert max(_cells(line) for line in plain(lines)) <= width
                assert colours or not any("\x1b" in line for line in lines)


def test_all_joints_have_a_row_where_there_is_room():
    lines = plain(frame(robots(32), Choices(), 200, 60))
    assert all(any(line.startswith(f"joint_{k} ") for line in lines) for k in range(32))
    assert sum("⣿" in line for line in lines) >= 10  # and there is a chart
    few = plain(frame(robots(32), Choices(), 80, 24))
    assert any("(1-" in line and "of 32)" in line for line in few)


def test_names_of_joints_do_nothing_to_the_terminal():
    shown = [Shown("/a\x1b[2J", moving(2, names=["\x1b]0;evil\x07", "名前のとても長い関節"]))]
    lines = frame(shown, Choices(), 40, 20, colours=False)
    assert "\x1b" not in "".join(lines) and "\x07" not in "".join(lines)
    assert max(map(_cells, lines)) <= 40 and any("関節" in line for line in lines)


def test_thresholds_are_coloured():
    """Calm, near and above a limit; of a quantity without one neither."""
    shown = robots(3)
    history = shown[0].history
    history.limits[TORQUE] = abs(history.last[TORQUE]) / [0.3, 0.8, 1.5]
    choices = Choices()
    choices.quantity = TORQUE
    rows = {line.split()[0].split("m")[-1]: line for line in frame(shown, choices, 80, 24) if "joint_" in line}
    for name, code, part in (("joint_0", "32", "30 %"), ("joint_1", "33", "80 %"), ("joint_2", "1;31", "150 %")):
        assert f"\x1b[1;{code}m" in rows[name] and part in rows[name]
    choices.quantity = ENERGY
    assert not any("\x1b[1;31m" in line for line in frame(shown, choices, 80, 24))
    shown[0].alarm = "collision: joint_2"
    assert any("\x1b[1;31mALARM collision: joint_2" in line for line in frame(shown, choices, 80, 24))


def test_lines_of_robots():
    """A robot without states for a while, one that waits, and the line of a terminal without cursor control."""
    shown = robots(6)
    shown[0].history.set_thresholds([2.0] * 6)
    line = line_of(shown[0])
    assert line.startswith("/robot_0: K ") and line.count("joint_") == 5 and " of 2 N m" in line and line.isascii()
    shown[0].silent = 4.2
    assert "no state for 4 s" in frame(shown, Choices(), 80, 24)[0]
    assert "no state for 4 s" in line_of(shown[0])
    assert "waiting" in line_of(Shown("/x", waiting="waiting for it"))


# --- Keys of `top`


def test_keys():
    assert keys_of("a\x1b[C\x1bOD\x1b\x1b[15~é\t\x1b[Z") == ["a", "right", "left", "escape", "é", "\t", "back"]


def test_what_keys_do():
    choices = Choices()
    choices.take("3")
    assert choices.quantity == EXTERNAL
    choices.take("\x1b[C" * len(QUANTITIES))
    assert choices.quantity == EXTERNAL
    choices.take("s")
    assert SORTS[choices.sort] == "value"
    choices.take("+" * 9)
    assert choices.window == WINDOWS[-1]
    choices.take("-" * 9)
    assert choices.window == WINDOWS[0]
    choices.take(" ")
    assert choices.paused
    choices.take("?")
    assert choices.help
    choices.take("q")
    assert not choices.help and not choices.ends
    choices.take("/elbq\x7f\r")
    assert (choices.wanted, choices.typing, choices.ends) == ("elb", False, False)
    choices.take("\x1b")
    assert choices.wanted == ""
    choices.take("\t\tr")
    assert choices.robot == 2 and choices.restarts
    choices.take("q")
    assert choices.ends
    assert not Choices().take("")


def test_sorting_filter_and_scrolling():
    shown, choices = robots(20), Choices()

    def names():
        lines = plain(frame(shown, choices, 80, 30))
        return [line.split()[0] for line in lines if line.startswith("joint_")]

    assert names()[:3] == ["joint_0", "joint_1", "joint_2"]
    choices.sort = SORTS.index("value")
    values = shown[0].history.last[ENERGY]
    assert names()[0] == f"joint_{int(np.argmax(values))}"
    choices.sort = SORTS.index("peak")
    assert names()[0] == f"joint_{int(np.argmax(shown[0].history.peak[ENERGY]))}"
    choices.sort, choices.wanted = 0, "_1"
    assert names() == ["joint_1", *(f"joint_{k}" for k in range(10, 20))]
    choices.wanted = "shoulder"
    assert not names() and "no joint has 'shoulder'" in "\n".join(plain(frame(shown, choices, 80, 30)))
    choices.wanted = ""
    choices.take("\x1b[B" * 100)
    assert names()[-1] == "joint_19" and choices.scroll < 20


def test_help_names_every_key():
    text = " ".join(plain(frame(robots(2), SimpleNamespace(**vars(Choices()) | {"help": True}), 80, 24)))
    assert all(keys in text for keys, _ in HELP)


# --- Layouts

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


def test_panels_have_units_and_joints():
    model = dd.load_robot("panda")
    for panel in panels(model):
        assert re.search(r"\[[^]]+\]$", panel.title) and re.fullmatch("[a-z]+", panel.name)
        assert len([one for one in panel.series if one.index is not None]) in (0, model.nv)


def test_layout_command(tmp_path, capsys):
    """It writes a file, or prints the layout; with the parameters of the monitor."""
    model = dd.load_robot("panda")
    for tool in TOOLS:
        path = tmp_path / f"my {tool}"
        assert main(["layout", "--tool", tool, "panda", "-o", str(path)]) == 0
        printed = capsys.readouterr()
        assert not printed.out and f"Wrote {path}" in printed.err
        assert path.read_text(encoding="utf-8") == layout(tool, model)
    assert main(["layout", "--tool", "foxglove", "panda", "--set", "mimic=free", "--monitor", "/x/m"]) == 0
    assert capsys.readouterr().out == layout("foxglove", dd.load_robot("panda", mimic="free"), "/x/m")
    for arguments, key in (
        (["panda"], "--tool"),
        (["--tool", "rqt", "panda"], "'rqt'"),
        (["--tool", "rviz", "lost.urdf"], "lost.urdf"),
        (["--tool", "rviz", "panda", "--monitor", "x"], "whole name"),
        (["--tool", "rviz", "panda", "-o", "nowhere/x.rviz"], "no folder"),
    ):
        try:
            status = main(["layout", *arguments])
        except SystemExit as end:
            status = end.code
        printed = capsys.readouterr()
        assert status == 2 and key in printed.err and not printed.out
    for monitor in ("diag_dynamics", "/arm/", ""):
        with pytest.raises(InputError, match="whole name"):
            layout("rviz", model, monitor)


# --- The history of a push

ONSET, END, STEP = 1.0, 2.0, 2e-3


def history(delay=0.02, late=0.05, energy=0.25, limited=True):
    """Return a push of one second, seen `delay` after it began and until `late` after its end."""
    made = PushHistory(30.0, 0.25, 8.0, 4.0)
    made.onset, made.end = ONSET, END
    for t in np.arange(0.0, 4.0, STEP):
        pushed = ONSET <= t <= END
        made.moments.append(Moment(t, energy if pushed else 0.0, limited and pushed, 0.1 if pushed else 1e-3))
        seen = delay is not None and ONSET + delay <= t <= END + late
        made.seen.append(Seen(t, 20.0 if seen else 0.5, seen))
    return made


def test_summary_of_a_push():
    made = history(delay=0.021, late=0.05)
    assert not made.failures() and not history(energy=0.255).failures()
    push, norm, energy, limiter, hand = made.summary()
    assert "30 N for 1.00 s" in push and "after 22 ms" in push and "52 ms after its end" in push
    assert "20.0 J" in norm and "threshold 8" in norm
    assert "0.2500 J" in energy and "100 %" in limiter
    assert "100 mm" in hand and "1.0 mm" in hand


@pytest.mark.parametrize(
    ("options", "key"),
    [
        ({"delay": None}, "not seen"),
        ({"delay": 1.01}, "not seen"),
        ({"delay": -0.1}, "100 ms before there was a push"),
        ({"late": 10.0}, "never over"),
        ({"energy": 0.27}, "K rose to 0.27 J, beyond its bound"),
        ({"limited": False}, "limiter had nothing to do"),
    ],
)
def test_failures_of_a_push(options, key):
    (line,) = history(**options).failures()
    assert key in line


def test_picture(tmp_path):
    """The spans of push, collision and limiter are where they belong: a strip's colour has the width of its time."""
    made = history(delay=0.5, late=0.5)
    made.picture(tmp_path / "push.png", "a push")
    image = (matplotlib.image.imread(tmp_path / "push.png")[..., :3] * 255).astype(int)
    widths = {}
    for name, color in {"collision": "e8998d", "limiter": "5fb3ce"}.items():
        wanted = [int(color[k : k + 2], 16) for k in (0, 2, 4)]
        rows = (np.abs(image - wanted).max(axis=2) < 4).sum(axis=1)
        widths[name] = rows.max()
    # Both last one second here, as far as sampling goes: the strips are equally long.
    assert widths["collision"] > 100
    assert widths["limiter"] == pytest.approx(widths["collision"], abs=3)
