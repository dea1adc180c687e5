# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Views without a terminal, a viewer or a browser: `top`, layouts, data of plots."""

import json
import math
import re
import sys
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
from diag_dynamics.plot.drawing import MOST, envelope
from diag_dynamics.views.energy_history import PALETTE, EnergyHistory
from diag_dynamics.views.top.choices import SORTS, WINDOWS, Choices, keys_of
from diag_dynamics.views.top.frame import Shown, _cells, frame, line_of
from diag_dynamics.views.top.history import RobotHistory
from diag_dynamics.views.top.quantities import ENERGY, EXTERNAL, QUANTITIES, TORQUE, columns
from diag_dynamics.yaml_files import parsed_yaml
from motions import recorded
from robots import description, joint, link

mpl.use("agg")
import matplotlib.pyplot as plt

CUBE = (1.0, (0, 0, 0), (0.1, 0, 0, 0.1, 0, 0.1))
TWO_SLIDES = (
    *(link("base"), link("one", *CUBE), link("two", *CUBE)),
    *(joint(f"to_{name}", "prismatic", "base", name) for name in ("one", "two")),
)
"""Two masses of 1 kg that slide by themselves: ½ν² is half the square of each velocity."""

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


PUSH = slice(600, 800)


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def panda():
    return dd.load_robot("panda")


@pytest.fixture(scope="module")
def dyn(panda):
    return dd.DiagonalDynamics(panda)


@pytest.fixture(scope="module")
def motion(panda, dyn):
    """Times, positions, rates, efforts and external efforts: a motion with a push at the hand in it."""
    t = np.arange(6000) * 1e-3
    rng = np.random.default_rng(1)
    middle, wide = np.clip(panda.neutral, panda.lower, panda.upper), 0.2 * np.ones(panda.nv)
    middle[3], wide[-1] = -1.5, 0.01
    w, phase = rng.uniform(3.0, 7.0, panda.nv), rng.uniform(0.0, 6.0, panda.nv)
    angle = w * t[:, None] + phase
    q, qd, qdd = middle + wide * np.sin(angle), wide * w * np.cos(angle), -wide * w * w * np.sin(angle)
    q[:, -1] += 0.02
    external = np.zeros_like(q)
    for k in range(*PUSH.indices(len(t))):
        external[k] = dyn.jacobian(q[k], "panda_hand", frame="world")[:3].T @ [0.0, 8.0, 0.0]
    tau = dyn.inverse_dynamics_batch(q, qd, qdd, friction=True) - external
    return t, q, qd, tau, external


@pytest.fixture(scope="module")
def recording(panda, motion):
    t, q, qd, tau, _ = motion
    return recorded(panda, t, q, qd, tau)


def curve(axes, label):
    (line,) = [line for line in axes.lines if line.get_label() == label]
    return np.array(line.get_data())


def test_energy_is_stacked_by_joint(recording, dyn, panda):
    """The top of the stack is K, each layer is as thick as the share of its joint."""
    s = dyn.evaluate_batch(recording.q[:MOST], recording.qd[:MOST])
    axes = dd.plot.energy(s, recording.t[:MOST])
    t, K = curve(axes, "K")
    assert np.array_equal(t, recording.t[:MOST] - recording.t[0]) and np.allclose(K, s.kinetic_energy, rtol=1e-12)
    shares = dict(zip(panda.dof_names, s.energy_share.T, strict=True))
    below, others = np.zeros(len(t)), set(panda.dof_names)
    for layer in axes.collections:
        at, top = layer.get_paths()[0].vertices.T
        edge = np.array([top[at == x].max() for x in t[::100]])
        if "other" in layer.get_label():
            expected = sum(shares[joint] for joint in others)
        else:
            others.remove(layer.get_label())
            expected = shares[layer.get_label()]
        assert np.allclose(edge - below[::100], expected[::100], atol=1e-12)
        below += expected
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [s]", "kinetic energy [J]")


def test_gaps_and_peaks(panda, motion):
    """Ten seconds without a state are a gap; the largest value of many is drawn."""
    t, q, qd, tau, _ = motion
    recording = recorded(panda, np.where(t < 3.0, t, t + 10.0), q, qd, tau)
    for at, y in (curve(dd.plot.energy(recording), "K"), dd.plot.balance(recording).axes[1].lines[0].get_data()):
        (gap,) = np.flatnonzero(np.isnan(y))
        assert at[gap - 1] < 3.0 and 12.9 < at[gap + 1] < 13.2
    seldom = recorded(panda, 2.0 * np.arange(30.0), q[:30], qd[:30], None)
    assert not np.isnan(curve(dd.plot.energy(seldom), "K")).any()
    values = np.zeros(50 * MOST)
    values[12345] = -1.0
    drawn, y = envelope(np.arange(len(values)) * 1.0, values)
    assert len(drawn) == 2 * MOST and y.min() == -1.0 and drawn[y.argmin()] == pytest.approx(12345, abs=50)


LONG = 600.0


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


@pytest.mark.parametrize("length", [12.0, LONG])
def test_the_picture_of_a_long_time_is_not_black(tmp_path, length):
    """Each joint has its colour after ten minutes, as after ten seconds."""
    samples = EnergyHistory(["shoulder", "elbow"])
    for t, shares, power in zip(*swings(length), strict=True):
        samples.add(1.7e9 + t, shares, power, 1e-16, 1e-3)
    samples.picture(tmp_path / "energy.png", "arm")
    dark, *of_joints = colour_fractions(tmp_path / "energy.png", *PALETTE[:2])
    assert dark < 0.06 and min(of_joints) > 2.0 * dark


def test_a_plot_of_a_long_time_has_means_and_the_largest_energy():
    """Layers are the mean shares, and the band reaches up to the largest K."""
    t, shares, _ = swings(LONG)
    model = dd.load_urdf(description("arm", *TWO_SLIDES))
    s = dd.DiagonalDynamics(model).evaluate_batch(np.zeros_like(shares), np.sqrt(2.0 * shares))
    axes = dd.plot.energy(s, t)
    at, K = curve(axes, "K")
    assert len(at) == 100 and np.mean(K) == pytest.approx(s.kinetic_energy.mean(), rel=1e-6)
    (band,) = [one for one in axes.collections if one.get_label() == "maximum of K"]
    assert band.get_paths()[0].vertices[:, 1].max() == pytest.approx(s.kinetic_energy.max())
    assert "mean of 6.00 s" in axes.get_ylabel()


def test_shares_of_one_state_and_of_many(recording, dyn, panda):
    s = dyn.evaluate(recording.q[700], recording.qd[700])
    axes = dd.plot.shares(s)
    assert [bar.get_width() for bar in axes.patches] == pytest.approx(s.energy_share.tolist())
    assert [label.get_text() for label in axes.get_yticklabels()] == list(panda.dof_names)
    many = dyn.evaluate_batch(recording.q, recording.qd)
    axes = dd.plot.shares(recording)
    assert [bar.get_width() for bar in axes.patches] == pytest.approx(many.energy_share.mean(axis=0).tolist())
    assert np.allclose(curve(axes, "largest")[0], many.energy_share.max(axis=0))


def test_rest_of_the_balance_is_the_power_of_a_push(recording, motion, panda):
    t, _, qd, _, external = motion
    figure = dd.plot.balance(recording)
    both, rest = figure.axes
    at, power = np.array(rest.lines[0].get_data())
    pushing = (external * qd).sum(axis=1)
    expected = np.array([pushing[(t >= x - 0.05 - 1e-9) & (t <= x + 0.05 + 1e-9)].mean() for x in at])
    assert np.abs(expected).max() > 0.05
    assert np.abs(power - expected).max() < 0.02 * np.abs(expected).max() + 2e-3
    difference = curve(both, "dK/dt")[1] - curve(both, "explained by efforts, gravity and friction")[1]
    assert np.allclose(difference, power)
    assert re.search(r"panda: \d+\.\d % of dK/dt explained", both.get_title(loc="left"))
    assert both.get_ylabel() == "power [W]"


def test_external_torque_of_each_joint(recording, dyn, panda, motion):
    thresholds = dd.AlarmThresholds({"panda_joint1": 0.5, "*": 100.0})
    observed = dd.observe(dyn, recording, 40.0)
    part = dd.Observed(*(column[:MOST] for column in observed))
    seen = part.external_torque
    panels = dd.plot.external_torque(part, thresholds, model=panda).axes
    titles = [axes.get_title(loc="left") for axes in panels]
    assert titles == [f"{n} [{'N' if 'finger' in n else 'N m'}]" for n in panda.dof_names]
    for k, axes in enumerate(panels):
        assert np.array_equal(axes.lines[1].get_ydata(), seen[:, k], equal_nan=True)
    beyond = np.array(panels[0].lines[2].get_ydata())
    assert np.array_equal(~np.isnan(beyond), np.abs(seen[:, 0]) > 0.5) and np.isfinite(beyond).any()
    whole = dd.plot.external_torque(recording, {"panda_joint1": 0.5}, gain=40.0).axes
    for k in (0, 1):  # a panel without a threshold has one curve
        curves = np.concatenate([line.get_ydata() for line in whole[k].lines[1:]])
        assert len(whole[k].lines) == 3 - k and np.nanmax(curves) == np.nanmax(observed.external_torque[:, k])


def test_ellipsoid_says_what_a_push_meets(panda, dyn, recording):
    q, qd = recording.q[100], recording.qd[100]
    axes = dd.plot.ellipsoid(panda, q, "panda_hand", qd, point=[0.0, 0.0, 0.1])
    J = dyn.jacobian(q, "panda_hand", [0.0, 0.0, 0.1], frame="world")[:3]
    masses = 1.0 / np.linalg.eigvalsh(J @ np.linalg.solve(dyn.mass_matrix(q), J.T))
    shown = [float(text.get_text().split()[0]) for text in axes.texts if text.get_text().endswith(" kg")]
    assert sorted(shown) == pytest.approx(sorted(masses), rel=5e-3)
    v = J @ qd
    along = 1.0 / (v @ (J @ np.linalg.solve(dyn.mass_matrix(q), J.T)) @ v / (v @ v))
    said = axes.get_title(loc="left")
    assert float(re.search(r"mass along v ([\d.e+-]+) kg", said)[1]) == pytest.approx(along, rel=5e-3)
    assert [axis.get_label_text() for axis in (axes.xaxis, axes.yaxis, axes.zaxis)] == ["x [m]", "y [m]", "z [m]"]
    assert "panda_hand" in dd.plot.ellipsoid(panda, q).get_title(loc="left")  # the end-effector link


def test_tree_has_every_freedom_with_its_inertia():
    model = dd.load_robot("go2", floating_base=True)
    dyn, q = dd.DiagonalDynamics(model), model.random(3)
    names, bars = dd.plot.tree(model, q).axes
    assert [text.get_text() for text in names.texts] == list(model.dof_names)
    D, M = dyn.factors(q).D, np.diag(dyn.mass_matrix(q))
    ends = {round(bar.get_y() + 0.5 * bar.get_height()): bar.get_x() + bar.get_width() for bar in bars.patches}
    assert [ends[k] for k in range(model.nv)] == pytest.approx(D.tolist())
    shown, rows = curve(bars, "M_kk: outboard joints held")
    assert np.allclose(shown, M) and np.array_equal(rows, np.arange(model.nv))
    # Lines go from a carrier to its children, a level further in where there are several.
    lines = [line for line in names.lines if len(line.get_xdata()) == 3]
    assert len(lines) == model.nv - 1
    for line in lines:
        assert line.get_ydata()[0] < line.get_ydata()[1] and line.get_xdata()[2] - line.get_xdata()[0] in (0, 1)


def test_errors_name_the_argument(recording, panda, dyn, monkeypatch):
    t, q, qd = recording.t, recording.q, recording.qd
    without, empty = (recorded(panda, t[:n], q[:n], qd[:n], None) for n in (100, 0))
    for draw, key in (
        (lambda: dd.plot.energy([1.0]), "expected a Recording"),
        (lambda: dd.plot.energy(dyn.evaluate_batch(q, qd), t=[0.0, 1.0, 2.0]), r"t has shape \(3,\)"),
        (lambda: dd.plot.balance(without), "no efforts"),
        (lambda: dd.plot.shares(empty), "no states"),
        (lambda: dd.plot.external_torque(dd.observe(dyn, recording)), "model"),
        (lambda: dd.plot.external_torque(recording, {"elbow": 1.0}), "'elbow'"),
        (lambda: dd.plot.ellipsoid(panda, panda.neutral, "hand"), "'hand'"),
    ):
        with pytest.raises(dd.InputError, match=key):
            draw()
    for name in ("matplotlib", "matplotlib.pyplot"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(dd.InputError, match="pip install matplotlib"):
        dd.plot.tree(panda)
