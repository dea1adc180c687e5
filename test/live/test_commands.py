# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics` in processes: signals, pipes and terminals, and `top` in tmux."""

import contextlib
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from diag_dynamics.msg import DiagonalizedState
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import Float64

from diag_dynamics.nodes.support.names import NODES
from nodes import PANDA, START
from processes import Process
from robots import robot_path

pytestmark = [pytest.mark.full, pytest.mark.live]

SIMULATOR = NODES["simulator"]
TOP = Path(__file__).resolve().parents[2] / "scripts" / "top"


def command(*arguments):
    """Return the command as a user starts it."""
    return [sys.executable, "-m", "diag_dynamics", *map(str, arguments)]


@pytest.fixture(scope="module")
def simulator(ros_domain):
    """Start a simulator in a namespace."""
    parameters = ("-p", f"robot_description:={robot_path(PANDA)}", "-p", "motion:=wave", "-p", "rate:=100.0")
    with Process(command("simulator", "--ros-args", "-r", "__ns:=/arm", *parameters)) as simulator:
        simulator.wait_for_text("Ready")
        yield simulator


def test_rate_of_a_topic_that_falls_silent(ros_domain, peer):
    publisher = peer.publisher(Float64, "/beat", qos_profile_sensor_data)
    with Process(command("topic", "hz", "/beat")) as rate:

        def beat():
            publisher.publish(Float64())
            return "average rate" in rate.output

        peer.wait_until(beat, "a rate")
        rate.wait_for(lambda output: output.splitlines()[-1:] == ["no new messages"], "silence to be told of")
        rate.signal(signal.SIGINT)
        assert rate.wait() == 130 and "Traceback" not in rate.output


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals(simulator, number):
    """They end a command that goes on for ever in good order, with the status that shells have for it."""
    with Process(command("topic", "echo", "/arm/joint_states", "--field", "name")) as echo:
        echo.wait_for_text("---")
        echo.signal(number)
        assert echo.wait() == 128 + number and "Traceback" not in echo.output


def test_echo_before_anybody_publishes(ros_domain, peer):
    """A topic whose type is given is heard, however it will be published."""
    with Process(command("topic", "echo", "--once", "/late", "std_msgs/msg/Float64")) as echo:
        peer.wait_until(lambda: peer.node.count_subscribers("/late"), "the subscription")
        publisher = peer.publisher(Float64, "/late", qos_profile_sensor_data)

        def sent():
            publisher.publish(Float64(data=4.5))
            return echo.popen.poll() is not None

        peer.wait_until(sent, "the end of echo")
        assert echo.wait() == 0 and "data: 4.5" in echo.output


@pytest.mark.parametrize("arguments", [("topic", "echo", "/arm/joint_states"), ("robots",)])
def test_a_reader_that_goes_away(simulator, arguments):
    """As of `… | head -1`."""
    read, write = os.pipe()
    with Process(command(*arguments), stdout=write, stderr=subprocess.PIPE) as process:
        os.close(write)
        if arguments[0] == "topic":
            assert os.read(read, 10)
        os.close(read)
        process.listen(process.popen.stderr.fileno())
        assert process.wait() == 0 and process.output == ""


def test_exit_status_of_a_failure(simulator):
    """A service call with a response ends with 0, a misspelt topic with 1."""
    pause = f"/arm/{SIMULATOR}/pause"
    for arguments, expected, text in (
        (("service", "call", pause, "std_srvs/srv/SetBool", "{data: false}"), 0, "success: true"),
        (("topic", "hz", "/arm/joint_state"), 1, "Did you mean /arm/joint_states?"),
    ):
        done = subprocess.run(command(*arguments), capture_output=True, text=True, timeout=START)
        assert done.returncode == expected and text in done.stdout + done.stderr
        assert "Traceback" not in done.stderr


# --- top in a terminal


class Terminal(contextlib.AbstractContextManager):
    """tmux with `top` in it."""

    def __init__(self, folder, width, height, *arguments, term="tmux-256color"):
        nothing = folder / "tmux.conf"
        nothing.touch()
        self._tmux = ["tmux", "-S", str(folder / "socket"), "-f", str(nothing)]
        run = shlex.join(["env", f"TERM={term}", sys.executable, str(TOP), *arguments])
        command = f"trap : INT; {run}; echo status $?; exec cat"
        environment = os.environ | {"LANG": "C.UTF-8", "LC_ALL": "C.UTF-8", "SHELL": "/bin/sh"}
        self._run("new-session", "-d", "-x", str(width), "-y", str(height), command, env=environment)

    def _run(self, *arguments, **options):
        done = subprocess.run([*self._tmux, *arguments], capture_output=True, text=True, timeout=60, **options)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def screen(self, colours=False):
        """What is on it."""
        return self._run("capture-pane", "-p", *(["-e"] if colours else []))

    def type(self, *keys):
        """Send keys, by tmux's names."""
        self._run("send-keys", *keys)

    def resize(self, width, height):
        """Make it another one."""
        self._run("resize-window", "-x", str(width), "-y", str(height))

    def __exit__(self, *_):
        subprocess.run([*self._tmux, "kill-server"], capture_output=True, timeout=60)


def test_top_in_a_terminal(peer, tmp_path):
    """A state is on the screen, which may be resized; `q` ends it with status 0 and gives the screen back."""
    assert shutil.which("tmux"), "the test of a terminal needs tmux"
    states = peer.publisher(DiagonalizedState, "/one/diag_dynamics/state")
    state = DiagonalizedState(dof_names=["elbow"], nu=[2.0], velocity=[1.0], coriolis=[0.0], kinetic_energy=2.0)
    state.articulated_inertia = [4.0]

    def until(condition, what):
        deadline = time.monotonic() + START
        while not condition(shown := view.screen()):
            assert time.monotonic() < deadline, f"waited in vain for {what}:\n{shown}"
            state.header.stamp = peer.node.get_clock().now().to_msg()
            states.publish(state)
            time.sleep(0.02)  # 50 Hz
        return shown

    with Terminal(tmp_path, 80, 24) as view:
        until(lambda shown: "2.00 J" in shown and "elbow" in shown, "a state")
        view.resize(40, 20)
        until(lambda shown: "elbow" in shown and max(map(len, shown.splitlines())) <= 40, "forty columns")
        view.type("q")
        assert "elbow" not in until(lambda shown: "status 0" in shown, "the end")
