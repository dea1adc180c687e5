# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demos as people start them: what they print, show and leave behind, and their end."""

import fcntl
import os
import pty
import re
import shutil
import signal
import struct
import sys
import termios
import time
from pathlib import Path

import demo_identify
import matplotlib.image
import numpy as np
import psutil
import pytest

import robots
from diag_dynamics.cli.main import main as cli
from diag_dynamics.nodes.demos.demo_control import PUSH, REST, SIMULATOR
from nodes import PANDA, START, TIMEOUT, UR5, robot
from processes import Process
from streams import FRAME, Stream, wait_for_robot

pytestmark = [pytest.mark.full, pytest.mark.live]

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
DEMO, DEMO_CONTROL = SCRIPTS / "demo", SCRIPTS / "demo_control"

STEP = 1.0 / SIMULATOR["rate"]
"""Of simulated time from state to state in the demo of control [s]."""

# What a shell does for a program in the foreground: it gets the terminal, so that Ctrl-C reaches it.
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


def ended(process, children):
    """Wait for the end of the demo and of the nodes it has started; return its exit status."""
    status = process.wait()
    _, alive = psutil.wait_procs(children, timeout=TIMEOUT)
    assert not alive, process.tail()
    assert "Traceback" not in process.output
    return status


def check_summary(process, folder, name):
    """Robot states, energies, νᵀC, and the picture, which shows something."""
    said = process.output
    count, hertz = map(int, re.search(r"(\d+) states in [\d.]+ m?s \((\d+) Hz\)", said).groups())
    assert count > 10
    assert 0 < hertz <= 550  # by their stamps: 500 Hz, less what a busy machine lets go
    least, most = map(float, re.search(r"kinetic energy (\S+) … (\S+) J", said).groups())
    assert 0 <= least < most < 1000
    assert float(re.search(r"νᵀC\S* .*: (\S+)", said)[1]) < 1e-9
    path = Path(re.search(r"picture: (.+\.png)", said)[1])
    assert path.parent == folder.resolve()
    assert name in path.name
    check_picture(path)
    assert sorted(folder.glob("*.png")) == [path]


def check_picture(path):
    """A PNG of some size with areas in many colours."""
    image = matplotlib.image.imread(path)
    assert image.shape[0] >= 400
    assert image.shape[1] >= 600
    colours, sizes = np.unique((image[..., :3] * 255).astype(int).reshape(-1, 3), axis=0, return_counts=True)
    assert (sizes > 300).sum() >= 5
    assert sizes.max() < 0.9 * sizes.sum()
    assert len(colours) > 20


def test_ends_by_itself(tmp_path):
    """Not at a terminal, after the time it is given: the Panda, a summary and a picture."""
    with demo(tmp_path, "--duration", "3") as process:
        assert process.wait(2 * START) == 0
        check_summary(process, tmp_path, "panda")
        assert process.output.startswith("a simulated robot, panda, ")
        assert re.search(r"1 s +K = .* J", process.output)
        assert "panda_joint" in process.output
        assert "\x1b" not in process.output  # no colours into a file
        assert "Traceback" not in process.output


def test_robot_by_path(tmp_path):
    """Any URDF file; Ctrl-C, which goes to the whole group, ends it with a summary all the same."""
    shutil.copy(robot(UR5).path, tmp_path / "my robot.urdf")
    with demo(tmp_path, "--robot", "my robot.urdf", "--duration", "1000") as process:
        process.wait_for_text("states/s")
        children = process.children()
        assert len(children) == 3
        address = re.search(r"page, while the demo runs: (http://127\.0\.0\.1:\d+/)", process.output)[1]
        wait_for_robot(address, lambda one: one["alive"])
        with Stream(address) as stream:  # of the one robot that there is
            assert stream.next(FRAME)["K"] >= 0.0
            assert stream.layout["robot"] == "ur5"
        os.killpg(process.popen.pid, signal.SIGINT)
        assert ended(process, children) == 0
        check_summary(process, tmp_path, "ur5")


@pytest.mark.parametrize(("number", "status"), [(signal.SIGKILL, -signal.SIGKILL), (signal.SIGINT, 0)])
def test_robot_by_name(tmp_path, number, status):
    """A robot of the wheel by part of its path; a signal to the demo alone ends its nodes, too, even one that kills."""
    with demo(tmp_path, "--robot", "talos_reduced.urdf", "--duration", "1000", "--picture", "there.png") as process:
        process.wait_for_text("states/s")
        children = process.children()
        assert len(children) == 3
        process.signal(number)
        assert ended(process, children) == status
        if not status:
            check_summary(process, tmp_path, "there")


def test_end_while_compiling(tmp_path):
    """Ctrl-C while there is nothing to see yet, as the cache of compiled code is empty."""
    work, cache = tmp_path / "work", tmp_path / "cache"
    work.mkdir()
    with demo(work, NUMBA_CACHE_DIR=str(cache)) as process:
        process.wait_for_text("diag_dynamics: compiling")
        os.killpg(process.popen.pid, signal.SIGINT)
        assert ended(process, []) in (130, -signal.SIGINT)
        assert not list(work.iterdir())


def test_end_while_starting(tmp_path):
    """Ctrl-C while the nodes are being started."""
    with demo(tmp_path) as process:
        deadline = time.monotonic() + START
        while len(children := process.children()) < 3:
            assert process.popen.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.01)  # nobody tells when a process starts another one
        os.killpg(process.popen.pid, signal.SIGINT)
        assert ended(process, children) in (0, 130)
        assert not list(tmp_path.iterdir())


def test_robots_it_cannot_show(tmp_path):
    """Exit status 1 and the reason: unknown ones with similar names, ambiguous ones with those meant, paths as paths."""
    cases = {
        "nosuchrobot": ["'nosuchrobot'", "neither a file nor one of the", "All of them: "],
        "pandaa": ["'pandaa'", "did you mean panda"],
        "talos": ["talos", *(id.removesuffix(".urdf").rsplit("/")[-1] for id in robots.all_robots() if "talos" in id)],
        "iris_simple": ["iris", "no moving joint"],
        "romeo_laas_small": ["l_gripper_joint"],
        "nowhere/panda.urdf": ["nowhere/panda.urdf"],
    }
    for name, texts in cases.items():
        with demo(tmp_path, "--robot", name) as process:
            assert process.wait(120) == 1
            missing = [text for text in texts if text not in process.output]
            assert not missing
            assert "Traceback" not in process.output
            if name == "talos":
                assert "panda" not in process.output
    assert not list(tmp_path.iterdir())


def test_at_a_terminal(tmp_path):
    """A live view: kinetic energy and a row for each joint, until Ctrl-C; then the summary."""
    terminal, inside = pty.openpty()
    try:
        fcntl.ioctl(inside, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 120, 0, 0))
        command = [sys.executable, "-c", IN_TERMINAL, sys.executable, DEMO]
        environment = os.environ | {"TERM": "xterm-256color"}
        with Process(command, stdin=inside, stdout=inside, stderr=inside, cwd=tmp_path, env=environment) as process:
            os.close(inside)
            process.listen(terminal)
            process.wait_for(lambda output: output.count("kinetic energy") > 5, "some frames")
            for text in (*robot(PANDA).names, "power", "νᵀC", "Hz", "latency"):
                assert text in process.output
            children = process.children()
            assert len(children) == 3
            os.write(terminal, b"\x03")
            assert ended(process, children) == 0
            check_summary(process, tmp_path, "panda")
            assert "\x1b[?25h" in process.output  # the cursor is back
            echo = termios.tcgetattr(terminal)[3] & termios.ECHO
            assert echo
    finally:
        os.close(terminal)


# --- the demo of identification


def test_demo_identify(tmp_path, capsys):
    """Of ten pushes nine are detected with the identified model; its files are usable."""
    plot, kept = tmp_path / "before_and_after.svg", tmp_path / "kept"
    assert demo_identify.main(["--robots", "ur5_robot", "--picture", str(plot), "--keep", str(kept)]) == 0
    out = capsys.readouterr().out
    detected = re.findall(r"(with the URDF|identified): (\d+) of 10 pushes detected", out)
    assert [label for label, _ in detected] == ["with the URDF", "identified"]
    assert int(detected[0][1]) < 9 <= int(detected[1][1])
    shares = re.search(r"dK/dt explained: (\S+) with the URDF, (\S+) identified", out)
    assert float(shares[1]) < 0.0 and float(shares[2]) > 0.95
    assert plot.read_text().startswith("<?xml")
    arm, pushed = kept / "ur5_robot_arm.yaml", kept / "ur5_robot_pushed.npz"
    alarms = ["--alarms", str(kept / "ur5_robot_alarms_identified.yaml")]
    assert cli(["analyse", str(pushed), "--urdf", "ur5_robot", "--parameters", str(arm), *alarms]) == 0
    assert "collision" in capsys.readouterr().out


# --- the demo of control


def number(pattern, text):
    """Return the number that a pattern finds."""
    return float(re.search(pattern, text)[1])


def test_a_push_is_seen_and_its_energy_bounded(tmp_path):
    """It ends by itself with status 0; the story is told in its order, with times and numbers that belong together."""
    with Process([sys.executable, DEMO_CONTROL, "--picture", "there.png"], cwd=tmp_path) as process:
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
    with Process([sys.executable, DEMO_CONTROL], cwd=tmp_path) as process:
        process.wait_for_text("the arm holds its hand")
        children = process.children()
        assert len(children) == 3
        os.killpg(process.popen.pid, signal.SIGINT)
        assert ended(process, children) == 130
        assert "K at most" not in process.output
    assert not list(tmp_path.iterdir())


def test_a_node_that_dies(tmp_path):
    """Status 1 and its last words; the others end."""
    with Process([sys.executable, DEMO_CONTROL], cwd=tmp_path) as process:
        process.wait_for_text("the arm holds its hand")
        children = process.children()
        controller = next(child for child in children if "controller" in child.cmdline())
        controller.kill()
        assert ended(process, children) == 1
        assert "controller has ended with status" in process.output
