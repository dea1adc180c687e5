# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics` in processes: a closed pipe, and `top` in tmux."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from diag_dynamics.msg import DiagonalizedState

from limits import HANG
from processes import Process

pytestmark = [pytest.mark.full, pytest.mark.live]

TOP = Path(__file__).resolve().parents[2] / "scripts" / "top"
STATE = "/one/diag_dynamics/state"


def command(*arguments):
    """Return the command as a user starts it."""
    return [sys.executable, "-m", "diag_dynamics", *map(str, arguments)]


def test_a_reader_that_goes_away():
    """As of `… | head -1`."""
    read, write = os.pipe()
    with Process(command("robots"), stdout=write, stderr=subprocess.PIPE) as process:
        os.close(read)
        os.close(write)
        process.listen(process.popen.stderr.fileno())
        assert process.wait() == 0 and process.output == ""


def test_top_in_a_terminal(peer, tmp_path):
    """A state is on the screen of tmux, which may be resized; Ctrl-C ends it with status 0 and
    gives the screen back.
    """
    assert shutil.which("tmux"), "the test of a terminal needs tmux"
    states = peer.publisher(DiagonalizedState, STATE)
    state = DiagonalizedState(
        dof_names=["elbow"], nu=[2.0], velocity=[1.0], coriolis=[0.0], kinetic_energy=2.0
    )
    state.articulated_inertia = [4.0]
    # Pytest's readline gives its workers COLUMNS and LINES, which rich prefers to the terminal's.
    environment = {name: os.environ[name] for name in os.environ.keys() - {"COLUMNS", "LINES"}}
    environment |= {"LANG": "C.UTF-8", "LC_ALL": "C.UTF-8", "SHELL": "/bin/sh"}

    def tmux(*arguments):
        whole = ["tmux", "-S", tmp_path / "socket", "-f", os.devnull, *arguments]
        done = subprocess.run(whole, capture_output=True, text=True, timeout=HANG, env=environment)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def wait_until(condition, what):
        def shown():
            state.header.stamp = peer.node.get_clock().now().to_msg()
            states.publish(state)
            return condition(tmux("capture-pane", "-p"))

        peer.wait_until(shown, what)

    top = f"trap : INT; {shlex.join([sys.executable, str(TOP), STATE])}; echo status $?; exec cat"
    tmux("new-session", "-d", "-x", "80", "-y", "24", top)
    try:
        wait_until(lambda shown: "2.00 J" in shown and "elbow" in shown, "a state")
        tmux("resize-window", "-x", "40", "-y", "20")
        wait_until(
            lambda shown: "elbow" in shown and max(map(len, shown.splitlines())) <= 40,
            "forty columns",
        )
        tmux("send-keys", "C-c")
        wait_until(lambda shown: "status 0" in shown and "elbow" not in shown, "the end")
    finally:
        tmux("kill-server")
