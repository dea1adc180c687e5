# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The terminal view at any width: no line wraps, so that the last joint and the hint are always seen."""

import html
import io
import re
from pathlib import Path

import numpy as np
import pytest

from diag_dynamics.views.energy_history import EnergyHistory
from diag_dynamics.views.terminal import energy_panel

rich = pytest.importorskip("rich.console", reason="rich is not installed")


def lines(names, width, height, silent=0.0, latency=1.23456e-3):
    history, rng = EnergyHistory(names), np.random.default_rng(0)
    for k in range(200):
        history.add(0.01 * k, rng.uniform(size=len(names)), 123.4567, 3e-16, latency)
    console = rich.Console(file=io.StringIO(), width=width, height=height, color_system=None, force_terminal=True)
    console.print(energy_panel("a robot", history, height, width, silent))
    return console.file.getvalue().rstrip("\n").split("\n")


@pytest.mark.parametrize("width", [40, 60, 80, 84, 100, 160])
@pytest.mark.parametrize("count", [2, 9, 32])
def test_fits(width, count):
    """All of it fits into the terminal, down to the last joint that is shown and to the hint."""
    names, height = [f"robot_arm_number_{k}_joint" for k in range(count)], 24
    shown = lines(names, width, height)
    assert len(shown) <= height and max(map(len, shown)) == width - len("^C")
    assert "Ctrl-C ends" in shown[-1]
    assert "others" in shown[-3] if count > height - 9 else f"{count - 1}_joint" in shown[-3]
    text = "\n".join(shown)
    assert "123.4567 W" in text and "3.0e-16" in text and " Hz" in text
    if width == 40:
        assert " Hz 1.2 ms " in text and " Hz 123 ms " in "\n".join(lines(names, width, height, latency=0.1234))
    assert "no state for 3 s" in lines(names, width, height, silent=3.0)[-1]


def test_the_picture_in_the_readme_shows_this_view():
    """With the words of now, whatever the numbers."""
    page = (Path(__file__).parents[2] / "docs" / "demo.svg").read_text(encoding="utf-8")
    shown = html.unescape("".join(re.findall(r"<text[^>]*>(.*?)</text>", page))).replace("\xa0", " ")
    words = [re.split(r"  +", line.strip("│ \n"))[0] for line in lines(["joint"], 98, 24)]
    expected = [word for word in words if word[:1] in ("k", "p", "|", "s")]
    assert len(expected) == 4 and [word for word in expected if word not in shown] == []
    assert "Coriolis does no work" in shown and "Ctrl-C ends" in shown


@pytest.mark.parametrize(("count", "said"), [(0, "No state arrived"), (1, "A single state arrived")])
def test_what_cannot_be_summed_up_is_said(count, said):
    history = EnergyHistory(["shoulder", "elbow"])
    for _ in range(count):
        history.add(1.0, [1.0, 2.0], np.nan, 0.0, 0.001)
    (line,) = history.summary()
    assert line.startswith(said)
