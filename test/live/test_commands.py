# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics` in processes: signals, pipes and terminals, and `top` in tmux."""

import os
import shlex
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from diag_dynamics.msg import DiagonalizedState
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import Float64

from limits import HANG
from nodes import PANDA
from processes import Process
from robots import robot_path

pytestmark = [pytest.mark.full, pytest.mark.live]

TOP = Path(__file__).resolve().parents[2] / "scripts" / "top"


def command(*arguments):
    """Return the command as a user starts it."""
    return [sys.executable, "-m", "diag_dynamics", *map(str, arguments)]


@pytest.fixture(scope="module")
def simulator(ros_domain):
    """Start a simulator in a namespace."""
    parameters = (
        "-p",
        f"robot_description:={robot_path(PANDA)}",
        "-p",
        "motion:=wave",
        "-p",
        "rate:=100.0",
    )
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
        rate.wait_for(
            lambda output: output.splitlines()[-1:] == ["no new messages"], "silence to be told of"
        )
        rate.signal(signal.SIGINT)
        assert rate.wait() == 130 and "Traceback" not in rate.output


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


def test_top_in_a_terminal(peer, tmp_path):
    """A state is on the screen of tmux, which may be resized; `q` ends it with status 0 and gives the screen back."""
    assert shutil.which("tmux"), "the test of a terminal needs tmux"
    states = peer.publisher(DiagonalizedState, "/one/diag_dynamics/state")
    state = DiagonalizedState(
        dof_names=["elbow"], nu=[2.0], velocity=[1.0], coriolis=[0.0], kinetic_energy=2.0
    )
    state.articulated_inertia = [4.0]
    environment = os.environ | {"LANG": "C.UTF-8", "LC_ALL": "C.UTF-8", "SHELL": "/bin/sh"}

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

    top = f"trap : INT; {shlex.join([sys.executable, str(TOP)])}; echo status $?; exec cat"
    tmux("new-session", "-d", "-x", "80", "-y", "24", top)
    try:
        wait_until(lambda shown: "2.00 J" in shown and "elbow" in shown, "a state")
        tmux("resize-window", "-x", "40", "-y", "20")
        wait_until(
            lambda shown: "elbow" in shown and max(map(len, shown.splitlines())) <= 40,
            "forty columns",
        )
        tmux("send-keys", "q")
        wait_until(lambda shown: "status 0" in shown and "elbow" not in shown, "the end")
    finally:
        tmux("kill-server")
