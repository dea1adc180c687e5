# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The terminal view `top` without a terminal: what is remembered, drawn, and chosen by keys."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest

from diag_dynamics.views.top.choices import HELP, SORTS, WINDOWS, Choices, keys_of
from diag_dynamics.views.top.drawing import chart, number, sparkline
from diag_dynamics.views.top.frame import Shown, _cells, frame, line_of
from diag_dynamics.views.top.history import LONGEST, SLOT, RobotHistory
from diag_dynamics.views.top.quantities import ENERGY, EXCHANGE, EXTERNAL, QUANTITIES, TORQUE, VELOCITY, columns

CODES = re.compile(r"\x1b\[[0-9;]*m")
SIZES = [(40, 20), (80, 24), (132, 43), (200, 60), (20, 8), (3, 2)]


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


# --- What is remembered


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
    history = moving(3, seconds=200.0)
    assert len(history._times) == 2 * round(LONGEST / SLOT)
    known = ~np.isnan(history.recent(LONGEST, ENERGY, 60)[:, 0])
    assert known.sum() >= 59
    assert history.newest == pytest.approx(299.98)
    history.add(3.0, columns(state([0.0, 0.0, 1.0]), None))  # time has gone back
    assert history.newest == 3.0 and (~np.isnan(history.recent(60.0, ENERGY, 60)[:, 0])).sum() == 1


@pytest.mark.parametrize("rate", [10.0, 50.0, 500.0])
def test_parts_in_which_no_state_came(rate):
    """A slow driver's states are drawn as steps, and its silence as a gap."""
    history = moving(2, seconds=8.0, rate=rate)
    assert not np.isnan(history.recent(5.0, ENERGY, 400)[10:]).any()
    history.add(history.newest + 2.0, columns(state([1.0, 1.0]), None))
    missing = np.isnan(history.recent(5.0, ENERGY, 400)[:, 0])
    assert 130 < missing.sum() < 160


# --- What is drawn


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
@pytest.mark.parametrize("size", SIZES, ids=str)
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


def test_silence_is_told():
    shown = robots(3)
    shown[0].silent = 4.2
    assert "no state for 4 s" in frame(shown, Choices(), 80, 24)[0]
    assert "no state for 4 s" in line_of(shown[0])


def test_a_line_for_a_dumb_terminal():
    shown = robots(6)[0]
    shown.history.set_thresholds([2.0] * 6)
    said = line_of(shown)
    assert said.startswith("/robot_0: K ") and said.count("joint_") == 5 and " of 2 N m" in said and "50 Hz" in said
    assert said.isascii()
    assert "waiting" in line_of(Shown("/x", waiting="waiting for it"))


# --- What is chosen


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
