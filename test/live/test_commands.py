# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics` in processes: signals, pipes and terminals, `launch`, and `top` in tmux."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
import yaml
from diag_dynamics.msg import DiagonalizedState
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import Float64
from trajectory_msgs.msg import JointTrajectory

from nodes import PANDA, START
from processes import SLOW, Process
from robots import robot_path

pytestmark = [pytest.mark.full, pytest.mark.live]

TOP = Path(__file__).resolve().parents[2] / "scripts" / "top"


def command(*arguments):
    """Return the command as a user starts it."""
    return [sys.executable, "-m", "diag_dynamics", *map(str, arguments)]


@pytest.fixture(scope="module")
def simulator(ros_domain):
    """Start a simulator in a namespace by plain options."""
    arguments = ["--robot-description", robot_path(PANDA), "--motion", "wave", "--rate", 100, "--namespace", "arm"]
    with Process(command("simulator", *arguments)) as simulator:
        simulator.wait_for_text("Ready")
        yield simulator


def test_publish_from_stdin(peer, tmp_path):
    """A message that is too long for an argument."""
    heard = peer.topic(JointTrajectory, "/long/trajectory")
    path = tmp_path / "long.yaml"
    path.write_text(yaml.safe_dump({"points": [{"positions": [0.25 + k] * 6} for k in range(5000)]}))
    assert path.stat().st_size > 131072  # the longest argument of Linux
    arguments = ("topic", "pub", "--once", "/long/trajectory", "trajectory_msgs/msg/JointTrajectory", "-")
    with path.open() as values, Process(command(*arguments), stdin=values) as sent:
        peer.wait_until(lambda: heard.messages, "the trajectory")
        assert sent.wait() == 0
    assert [point.positions[5] for point in heard.messages[0].points] == [0.25 + k for k in range(5000)]


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


@pytest.mark.parametrize("arguments", [("topic", "echo", "/arm/joint_states"), ("topic", "list"), ("robots",)])
def test_a_reader_that_goes_away(simulator, arguments):
    """As of `… | head -1`."""
    read, write = os.pipe()
    with Process(command(*arguments), stdout=write, stderr=subprocess.PIPE) as process:
        os.close(write)
        if arguments[1:2] == ("echo",):
            assert os.read(read, 10)
        os.close(read)
        process.listen(process.popen.stderr.fileno())
        assert process.wait() == 0
        said = [line for line in process.output.splitlines() if not line.startswith("Waiting for")]  # a slow machine
        assert said == []


def ended(*arguments):
    """Run a command to its end, and return its status and output."""
    done = subprocess.run(command(*arguments), capture_output=True, text=True, timeout=START)
    assert "Traceback" not in done.stderr
    return done.returncode, done.stdout + done.stderr


def test_exit_status(simulator):
    """0 with output; 2 for wrong options and choices; 1 for what fails."""
    status, output = ended("node", "list")
    assert status == 0 and "/arm/diag_dynamics_simulator" in output
    for arguments, expected, key in (
        (("simulator", "--rte", "5"), 2, "option --rte is not known; is --rate meant"),
        (("launch", "nothing"), 2, "invalid choice: 'nothing'"),
        (("launch", "demo", "urdf=x"), 1, "of the form name:=value"),
        (("topic", "hz", "/arm/joint_state"), 1, "/arm/joint_states meant"),
    ):
        status, output = ended(*arguments)
        assert status == expected and key in output


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_launch(ros_domain, number):
    """Nodes of a launch file start, their lines name them, and they end with the launcher, even if it is killed."""
    arguments = ("launch", "demo", f"urdf:={robot_path(PANDA)}", "namespace:=launched")
    with Process(command(*arguments), env=os.environ | {"PYTHONUNBUFFERED": "1"}) as launched:
        for node in ("simulator", "monitor"):
            launched.wait_for(
                lambda output, node=node: any(f"[{node}]" in line and "Ready" in line for line in output.splitlines()),
                f"{node} to be ready",
            )
        nodes = launched.children()
        assert len(nodes) == 2
        launched.signal(number)
        assert launched.wait(SLOW) == (-number if number == signal.SIGKILL else 0)
        _, alive = psutil.wait_procs(nodes, timeout=START)
    assert not alive


# --- top in a terminal


class Terminal(contextlib.AbstractContextManager):
    """tmux with `top` in it."""

    def __init__(self, folder, width, height, *arguments, term="tmux-256color"):
        nothing = folder / "tmux.conf"
        nothing.touch()
        self._tmux = ["tmux", "-S", str(folder / "socket"), "-f", str(nothing)]
        command = f"trap : INT; env TERM={term} {sys.executable} {TOP} {' '.join(arguments)}; echo status $?; exec cat"
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
        until(lambda shown: "K 2.00 J" in shown and "elbow" in shown and "⣿" in shown, "a state")
        view.resize(40, 20)
        until(lambda shown: "? q" in shown and max(map(len, shown.splitlines())) <= 40, "forty columns")
        view.type("q")
        assert "elbow" not in until(lambda shown: "status 0" in shown, "the end")
