# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demo of control as people start it: a push that is seen, an energy that is bounded, and what it says of both."""

import os
import re
import signal
import sys
from pathlib import Path

import pytest
from test_demo import check_picture, ended

from diag_dynamics.nodes.demos.demo_control import PUSH, REST, SIMULATOR
from nodes import START
from processes import Process

pytestmark = [pytest.mark.full, pytest.mark.live]

STEP = 1.0 / SIMULATOR["rate"]
"""Of simulated time from state to state [s]."""

DEMO = Path(__file__).resolve().parents[2] / "scripts" / "demo_control"


@pytest.fixture(autouse=True)
def in_domain(ros_domain):
    """All nodes of these tests are in a domain of their own."""


def number(pattern, text):
    """Return the number that a pattern finds."""
    return float(re.search(pattern, text)[1])


def test_a_push_is_seen_and_its_energy_bounded(tmp_path):
    """It ends by itself with status 0; the story is told in its order, with times and numbers that belong together."""
    with Process([sys.executable, DEMO, "--picture", "there.png"], cwd=tmp_path) as process:
        assert process.wait(2 * START) == 0, process.tail()
        said = process.output
        assert "Traceback" not in said
        story = ("holds its hand", "somebody pushes", "sees a collision", "the push ends", "no collision any more")
        told = [next(line for line in said.splitlines() if text in line) for text in story]
        times = [float(line.split(" s ")[0]) for line in told]
        assert times == sorted(times) and times[1] >= REST - STEP  # a busy machine may push later, and for longer
        assert said.index("the limiter takes power out") > said.index("somebody pushes")
        delay = number(r"collision seen after (\d+) ms", said)
        assert delay == pytest.approx(1e3 * (times[2] - times[1]), abs=4)
        assert 0 < delay < 50
        lasted = number(r"push of 40 N for ([\d.]+) s", said)
        assert lasted >= PUSH and lasted == pytest.approx(times[3] - times[1], abs=0.01)
        largest, bound = number(r"K at most ([\d.]+) J", said), number(r"its bound ([\d.]+) J \(", said)
        assert 0.9 * bound < largest < 1.05 * bound
        assert number(r"acted on (\d+) %", said) > 5
        assert number(r"\|r\| at most ([\d.]+)", said) > 8 > 4 * number(r"before the push ([\d.]+)", said)
        moved, back = number(r"hand moved by (\d+) mm", said), number(r"back to within ([\d.]+) mm", said)
        assert 100 < moved < 220 and back < 5
        check_picture(tmp_path / "there.png")
        assert [path.name for path in tmp_path.iterdir()] == ["there.png"]


FEATHER = "from diag_dynamics.nodes.demos import demo_control as d; d.FORCE = 0.5; import sys; sys.exit(d.main([]))"


def test_a_push_that_nobody_notices(tmp_path):
    """Too weak to be seen: status 1 and why, and no picture of it."""
    with Process([sys.executable, "-c", FEATHER], cwd=tmp_path) as process:
        assert process.wait(2 * START) == 1, process.tail()
        assert "The push was not seen" in process.output and "The limiter had nothing to do" in process.output
        assert "collision:" not in process.output and "Traceback" not in process.output
    assert not list(tmp_path.iterdir())


def test_end_while_it_runs(tmp_path):
    """Ctrl-C, which goes to the whole group: the nodes end, too, and nothing is claimed."""
    with Process([sys.executable, DEMO], cwd=tmp_path) as process:
        process.wait_for_text("the arm holds its hand")
        children = process.children()
        assert len(children) == 3
        os.killpg(process.popen.pid, signal.SIGINT)
        assert ended(process, children) == 130
        assert "K at most" not in process.output
    assert not list(tmp_path.iterdir())


def test_a_node_that_dies(tmp_path):
    """Status 1 and its last words; the others end."""
    with Process([sys.executable, DEMO], cwd=tmp_path) as process:
        process.wait_for_text("the arm holds its hand")
        children = process.children()
        controller = next(child for child in children if "controller" in child.cmdline())
        controller.kill()
        assert ended(process, children) == 1
        assert "controller has ended with status" in process.output
