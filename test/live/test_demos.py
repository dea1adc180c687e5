# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demos as people start them: what they print and show, and their end."""

import fcntl
import os
import pty
import re
import shutil
import signal
import struct
import sys
import termios
from pathlib import Path

import pytest

import demo_identify
from diag_dynamics.cli.main import main as cli
from nodes import PANDA, UR5, robot
from processes import Process
from streams import FRAME, Stream, wait_for_robot

pytestmark = [pytest.mark.full, pytest.mark.live]

ROOT = Path(__file__).resolve().parents[2]
DEMO, CONTROL = ROOT / "scripts" / "demo", ROOT / "examples" / "demos" / "demo_control.py"

# What a shell does for a program in the foreground: it gets the terminal, so that Ctrl-C reaches
# it.
IN_TERMINAL = """
import fcntl, os, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
os.execv(sys.argv[1], sys.argv[1:])
"""


@pytest.fixture(autouse=True)
def in_domain(ros_domain):
    """All nodes of these tests are in a domain of their own."""


def demo(folder, *arguments, **environment):
    """Start the demo in a folder, not at a terminal."""
    return Process([sys.executable, DEMO, *arguments], cwd=folder, env=os.environ | environment)


def test_without_a_terminal(tmp_path):
    """A line a second until a signal; no colours, and no file stays."""
    with demo(tmp_path) as process:
        process.wait_for(lambda output: output.count("peak energy") > 3, "some lines")
        process.signal(signal.SIGINT)
        assert process.wait() == 0, process.tail()
        printed = process.output
        assert "Open http://127.0.0.1:" in printed
        assert "\x1b" not in printed
        assert "Traceback" not in printed
        energies = re.findall(
            r"^/demo_\d+: K (\S+) J, peak energy (\S+) J at panda_joint\d", printed, re.MULTILINE
        )
        assert energies and all(
            0.0 <= float(energy) < 100.0 and 0.0 <= float(peak) < 100.0 for energy, peak in energies
        )
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_robot_by_path(tmp_path, number):
    """Any URDF file; the page shows it while the demo runs; a signal ends everything with status
    0.
    """
    shutil.copy(robot(UR5).path, tmp_path / "my robot.urdf")
    with demo(tmp_path, "--robot", "my robot.urdf") as process:
        process.wait_for_text("peak energy")
        address = re.search(r"Open (http://127\.0\.0\.1:\d+/)", process.output)[1]
        wait_for_robot(address, lambda entry: entry["alive"])
        with Stream(address) as stream:  # of the one robot that there is
            assert stream.next(FRAME)["K"] >= 0.0
            assert stream.layout["robot"] == "ur5"
            stream.send("push")
            assert stream.next(FRAME, lambda frame: "collision" in frame.flags)[
                "external_torque"
            ].any()
        assert process.children() == []
        process.signal(number)
        assert process.wait() == 0
        assert "Traceback" not in process.output


def test_end_while_compiling(tmp_path):
    """Ctrl-C before there is anything to see, because the cache of compiled code is empty."""
    work = tmp_path / "work"
    cache = tmp_path / "cache"
    work.mkdir()
    with demo(work, NUMBA_CACHE_DIR=str(cache)) as process:
        process.wait_for_text("diag_dynamics: 0 to 35 %: compiling evaluate")
        process.signal(signal.SIGINT)
        assert process.wait() == 130
        assert "Traceback" not in process.output


def test_at_a_terminal(tmp_path):
    """Frames with energy, page and a row for each joint, until Ctrl-C; the terminal is restored."""
    terminal, inside = pty.openpty()
    try:
        fcntl.ioctl(inside, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 120, 0, 0))
        command = [sys.executable, "-c", IN_TERMINAL, sys.executable, DEMO]
        environment = os.environ | {"TERM": "xterm-256color"}
        with Process(
            command, stdin=inside, stdout=inside, stderr=inside, cwd=tmp_path, env=environment
        ) as process:
            os.close(inside)
            process.listen(terminal)
            process.wait_for(lambda output: output.count("peak energy") > 5, "some frames")
            for text in (*robot(PANDA).names, "external N m", "Page: http://127.0.0.1:"):
                assert text in process.output
            os.write(terminal, b"\x03")
            assert process.wait() == 0
            assert process.output.rindex("\x1b[?1049l") > process.output.rindex("\x1b[?1049h")
            assert "\x1b[?25h" in process.output  # the cursor is back
            assert termios.tcgetattr(terminal)[3] & termios.ECHO
    finally:
        os.close(terminal)


def test_a_push_is_detected_and_its_energy_bounded(tmp_path):
    """It ends by itself with status 0; events and numbers belong together; its picture shows
    something.
    """
    with Process([sys.executable, CONTROL, "push.png"], cwd=tmp_path) as process:
        assert process.wait() == 0, process.tail()
        printed = process.output
    assert "[WARN]" not in printed
    events = (
        "holds the hand",
        "pushes the hand",
        "reports a collision",
        "the push ends",
        "reports no collision",
    )
    times = [float(re.search(rf"([\d.]+) s  .*{event}", printed)[1]) for event in events]
    assert times == sorted(times) and times[1] >= 1.0
    delay = float(re.search(r"collision after (\d+) ms", printed)[1])
    assert delay < 50.0 and delay == pytest.approx(1e3 * (times[2] - times[1]), abs=4.0)
    largest, bound = map(
        float, re.search(r"K at most ([\d.]+) J, its bound ([\d.]+) J", printed).groups()
    )
    assert 0.9 * bound < largest < 1.05 * bound
    assert float(re.search(r"acted on (\d+) %", printed)[1]) > 5.0
    moved, back = map(
        float, re.search(r"moved by (\d+) mm, and back to within ([\d.]+) mm", printed).groups()
    )
    assert 100.0 < moved < 220.0 and back < 5.0
    assert (tmp_path / "push.png").stat().st_size > 60_000


def test_demo_identify(tmp_path, capsys):
    """Of ten pushes nine are detected with the identified model; its files are usable."""
    plot = tmp_path / "before_and_after.svg"
    folder = tmp_path / "kept"
    assert (
        demo_identify.main(["--robots", "ur5_robot", "--picture", str(plot), "--keep", str(folder)])
        == 0
    )
    out = capsys.readouterr().out
    detected = re.findall(r"(with the URDF|identified): (\d+) of 10 pushes detected", out)
    assert [label for label, _ in detected] == ["with the URDF", "identified"]
    assert int(detected[0][1]) < 9 <= int(detected[1][1])
    shares = re.search(r"dK/dt explained: (\S+) with the URDF, (\S+) identified", out)
    assert float(shares[1]) < 0.0 and float(shares[2]) > 0.95
    assert plot.read_text().startswith("<?xml")
    arm = folder / "ur5_robot_arm.yaml"
    pushed = folder / "ur5_robot_pushed.npz"
    alarms = ["--alarms", str(folder / "ur5_robot_alarms_identified.yaml")]
    assert (
        cli(["analyse", str(pushed), "--urdf", "ur5_robot", "--parameters", str(arm), *alarms]) == 0
    )
    assert "collision" in capsys.readouterr().out
