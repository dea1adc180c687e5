# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics` on a graph: nodes started with plain options, and a look at them without ros2cli."""

import os
import re
import select
import signal
import subprocess
import sys
import threading
from contextlib import nullcontext, redirect_stderr, redirect_stdout
from io import StringIO
from types import SimpleNamespace

import pytest
import rclpy
import yaml
from geometry_msgs.msg import WrenchStamped
from rclpy.qos import qos_profile_sensor_data
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

from described import PANDA
from diag_dynamics.cli.main import main
from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.plain_options import as_ros_arguments
from diag_dynamics.nodes.tools import session as sessions
from diag_dynamics.nodes.tools import topic_commands
from diag_dynamics.nodes.tools.session import Session
from diag_dynamics.nodes.tools.yaml_messages import as_values, as_yaml, field, filled, type_of
from nodes import START
from processes import SLOW, Process
from robots import robot_path

pytestmark = [pytest.mark.full, pytest.mark.live]

# --- options

DEFAULTS = {
    "rate": 100.0,
    "gravity": [0.0, 0.0, -9.81],
    "robot_description": "",
    "locked_joints": [""],
    "floating_base": False,
    "depth": 5,
    "max_rate.state": 0.0,
}


@pytest.mark.parametrize(
    ("given", "made"),
    [
        (["--rate", "500"], ["-p", "rate:=500.0"]),
        (["--rate=1e-3"], ["-p", "rate:=0.001"]),
        (["--rate", "1e-6"], ["-p", "rate:=1.0e-06"]),
        (["--rate", "-1E3"], ["-p", "rate:=-1000.0"]),
        (["--gravity", "[0, 0, -1.62]"], ["-p", "gravity:=[0.0, 0.0, -1.62]"]),
        (["--gravity", "0,0,1"], ["-p", "gravity:=[0.0, 0.0, 1.0]"]),
        (["--gravity", "[]"], ["-p", "gravity:=[]"]),
        (["--depth", "7"], ["-p", "depth:=7"]),
        (["--robot-description", "a b/1.urdf"], ["-p", 'robot_description:="a b/1.urdf"']),
        (["--locked-joints", "a=1,b=2"], ["-p", 'locked_joints:=["a=1", "b=2"]']),
        (["--locked-joints", "['a=1', b=2]"], ["-p", 'locked_joints:=["a=1", "b=2"]']),
        (["--locked-joints", "[]"], ["-p", 'locked_joints:=[""]']),
        (["--floating-base"], ["-p", "floating_base:=true"]),
        (["--floating_base", "false"], ["-p", "floating_base:=false"]),
        (["--max-rate.state", "50"], ["-p", "max_rate.state:=50.0"]),
        (["--namespace", "two/arms"], ["-r", "__ns:=/two/arms"]),
        (["--namespace", "/arm", "--name", "watch"], ["-r", "__ns:=/arm", "-r", "__node:=watch"]),
        (
            ["--remap", "joint_states:=js", "--params-file", "f.yaml"],
            ["-r", "joint_states:=js", "--params-file", "f.yaml"],
        ),
    ],
)
def test_options(given, made):
    assert as_ros_arguments(given, DEFAULTS) == ["--ros-args", *made]
    more = ["--ros-args", "-p", "x:=1"]
    assert as_ros_arguments([*given, *more], DEFAULTS) == ["--ros-args", *made, "--", *more]


def test_options_that_stay():
    assert as_ros_arguments(["--help"], DEFAULTS) == ["--help"]
    assert as_ros_arguments(["--ros-args", "--log-level", "debug"], DEFAULTS) == ["--ros-args", "--log-level", "debug"]


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (["--rte", "1"], "option --rte is not known; is --rate meant"),
        (["--xyz"], "option --xyz is not known"),
        (["--rate"], "option --rate has no value"),
        (["--rate", "fast"], "option --rate is 'fast', expected a finite number"),
        (["--rate=inf"], "option --rate is 'inf', expected a finite number"),
        (["--gravity", "0,0,down"], "option --gravity is 'down', expected a finite number"),
        (["--depth", "0.5"], "option --depth is '0.5', expected a whole number"),
        (["--floating-base", "maybe"], "expected true or false"),
    ],
)
def test_options_that_are_wrong(given, text):
    with pytest.raises(InputError, match=text):
        as_ros_arguments(given, DEFAULTS)


# --- messages as YAML


def test_messages_there_and_back():
    text = "{header: {frame_id: arm, stamp: {sec: 3}}, name: [a, b], position: [1, 2.5]}"
    message = filled(JointState, text)
    assert message.header.stamp.sec == 3 and list(message.position) == [1.0, 2.5] and message.name == ["a", "b"]
    assert filled(JointState, as_yaml(as_values(message))) == message
    assert field(message, "header.frame_id") == "arm" and field(message, "position[1]") == 2.5
    assert type_of("sensor_msgs/msg/JointState") is JointState


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("{nam: [a]}", "no field 'nam'; is 'name' meant"),
        ("{position: a}", "field 'position' is 'a', expected sequence<double>"),
        ("{header: {stamp: {sec: 1.5}}}", "field 'header.stamp.sec' is 1.5, expected int32"),
        ("{name: [1]}", "field 'name'"),
        ("{header: 3}", "header is 3, expected {field: value"),
        ("[", "is no YAML"),
    ],
)
def test_messages_that_are_wrong(text, error):
    with pytest.raises(InputError, match=error.replace("[", r"\[")):
        filled(JointState, text)


@pytest.mark.parametrize("name", ["JointState", "sensor_msgs/msg/JointStat", "no_msgs/msg/X"])
def test_types_that_are_none(name):
    with pytest.raises(InputError, match=name):
        type_of(name)


# --- on the graph


def command(*arguments):
    return [sys.executable, "-m", "diag_dynamics", *map(str, arguments)]


def said_by_process(*arguments, status=0):
    """Output of a command that ends by itself with a status, in a process of its own, as a user starts it."""
    with Process(command(*arguments), stderr=subprocess.PIPE) as process:
        errors = threading.Thread(target=lambda: found.append(process.popen.stderr.read().decode()), daemon=True)
        found = []
        errors.start()
        done = process.wait(START)
        errors.join()
    assert done == status, process.output + found[0]
    assert "Traceback" not in found[0]
    return process.output if status == 0 else found[0]


def said(*arguments, status=0):
    """The same in this process, which has imported already what a command imports for a second."""
    output, errors = StringIO(), StringIO()
    with redirect_stdout(output), redirect_stderr(errors):
        done = main([*map(str, arguments)])
    assert done == status, output.getvalue() + errors.getvalue()
    return output.getvalue() if status == 0 else errors.getvalue()


@pytest.fixture(scope="module")
def robot(ros_domain):
    """A simulator and a monitor in a namespace, as a user starts them."""
    options = ["--namespace", "arm"]
    simulator = ["--robot-description", robot_path(PANDA), "--motion", "wave", "--rate", 100]
    with (
        Process(command("simulator", *simulator, *options)) as simulator,
        Process(command("monitor", "--max-rate.state", "5e1", "--gravity", "[0, 0, -1.62]", *options)) as monitor,
    ):
        simulator.wait_for_text("Ready")
        monitor.wait_for_text("Ready")
        yield "/arm/diag_dynamics"


def lists(arguments, *wanted):
    """Lines of a list that has all that is wanted: what one command hears of in its second another one may miss."""
    for _ in range(20):
        lines = said(*arguments).splitlines()
        if set(wanted) <= set(lines):
            return lines
    raise AssertionError(f"{arguments}: {lines}, without all of {wanted}")


def test_lists(robot):
    nodes = robot, f"{robot}_simulator"
    assert lists(["node", "list"], *nodes) == list(nodes)
    topics = (
        "/arm/joint_states [sensor_msgs/msg/JointState]",
        f"{robot}/kinetic_energy [diag_dynamics/msg/KineticEnergy]",
    )
    lists(["topic", "list", "-t"], *topics)
    assert f"{robot}/get_parameters" not in lists(["service", "list"], f"{robot}/set_payload")
    assert said_by_process("service", "type", f"{robot}/set_payload") == "diag_dynamics/srv/SetPayload\n"
    assert lists(["lifecycle", "nodes"], *nodes) == list(nodes)
    ends = "  /arm/diag_dynamics_simulator [sensor_msgs/msg/JointState] reliable, volatile", "Subscription count: 1"
    lists(["topic", "info", "/arm/joint_states"], *ends)


def test_echo_and_rate(robot):
    state = yaml.safe_load(said_by_process("topic", "echo", "--once", "arm/joint_states"))
    assert len(state["name"]) == len(state["position"]) == 9  # fingers and follower
    assert float(said("topic", "echo", "--once", f"{robot}/kinetic_energy", "--field", "total")) > 0.0
    assert said("topic", "echo", "--once", "/arm/robot_description", "--field", "data").count("<link") > 8  # latched
    rate = ("topic", "hz", "--once", "/arm/joint_states")
    rates = (float(tell(*rate).split()[2]) for tell in (said_by_process, *[said] * 30))
    assert any(80.0 < rate < 120.0 for rate in rates)  # on a busy machine some seconds have fewer
    assert "is /arm/joint_states meant" in said_by_process("topic", "hz", "/arm/joint_state", status=1).replace(
        "Is", "is"
    )


def test_parameters(robot):
    assert float(said_by_process("param", "get", robot, "max_rate.state")) == 50.0  # as the options have said
    assert yaml.safe_load(said("param", "get", robot, "gravity")) == [0.0, 0.0, -1.62]
    assert "Set parameter successful" in said("param", "set", robot, "gravity", "[0, 0, -3.72]")
    assert yaml.safe_load(said("param", "get", robot, "gravity")) == [0.0, 0.0, -3.72]
    assert "expected 3 numbers" in said("param", "set", robot, "gravity", "[0, 0]", status=1)
    assert "is 'gravity' meant" in said_by_process("param", "get", robot, "gravitty", status=1)
    assert "gravity" in said("param", "list", robot).split()


def test_services_and_lifecycle(robot):
    assert (
        yaml.safe_load(said_by_process("service", "call", f"{robot}_simulator/pause", "{data: true}"))["success"]
        is True
    )
    assert said("service", "call", f"{robot}_simulator/pause", "std_srvs/srv/SetBool", "{data: false}")
    assert "has no field 'dat'" in said("service", "call", f"{robot}_simulator/pause", "{dat: true}", status=1)
    simulator = f"{robot}_simulator"
    state = ("service", "call", f"{simulator}/get_state", "--field")
    assert said(*state, "current_state.label") == "active\n"
    assert "there is no 'label'" in said(*state, "label", status=1)
    step = ("service", "call", f"{simulator}/step", "--field", "stamp")
    assert said(*step, status=1)  # it has to be paused for that, which the message says; nothing else comes out
    assert said_by_process("lifecycle", "get", robot) == "active [3]\n"
    assert "has no transition 'configure'; it has" in said("lifecycle", "set", robot, "configure", status=1)
    assert "successful" in said("lifecycle", "set", robot, "deactivate")
    assert "activate" in said("lifecycle", "list", robot)
    assert "successful" in said("lifecycle", "set", robot, "activate")


def test_publish(robot, peer):
    """A message reaches who listens, with its values: nobody else does, for `pub --once` waits for one of them only."""
    pushes = peer.topic(WrenchStamped, "/heard/wrench")
    values = "{header: {frame_id: panda_hand}, wrench: {force: {x: 5}}}"
    arguments = ("topic", "pub", "--once", "/heard/wrench", "geometry_msgs/msg/WrenchStamped", values)
    with Process(command(*arguments)) as push:
        peer.wait_until(lambda: pushes.messages, "the push")
        assert push.wait() == 0
    assert pushes.messages[0].wrench.force.x == 5.0 and pushes.messages[0].header.frame_id == "panda_hand"


def test_publish_from_stdin(robot, peer, tmp_path):
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


def test_publish_to_somebody_who_does_not_acknowledge(monkeypatch):
    """`pub --once` waits for some time only; a link may have gone."""

    class Publisher:
        publish = print

        def get_subscription_count(self):
            return 1

        def wait_for_all_acked(self, timeout):
            return timeout.nanoseconds > 60e9

    publisher = Publisher()
    graph = SimpleNamespace(
        absolute=str, until=lambda *_: None, node=SimpleNamespace(create_publisher=lambda *_: publisher)
    )
    monkeypatch.setattr(topic_commands, "session", lambda: nullcontext(graph))
    chosen = SimpleNamespace(topic="/push", type="geometry_msgs/msg/WrenchStamped", values="", rate=1.0, once=True)
    with pytest.raises(InputError, match="in vain for all that listen to /push"):
        topic_commands.publish(chosen)


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
def test_signals(robot, number):
    """They end a command that goes on for ever in good order, with the status that shells have for it."""
    with Process(command("topic", "echo", "/arm/joint_states", "--field", "name")) as echo:
        echo.wait_for_text("---")
        echo.signal(number)
        assert echo.wait() == 128 + number and "Traceback" not in echo.output


@pytest.mark.parametrize(
    ("name", "there", "says"),
    [
        ("/diag_dynamics/state", ["/demo_7/diag_dynamics/state", "/state"], "Is /demo_7/diag_dynamics/state meant[?]"),
        (
            "/arm/controller/mode/damping",
            ["/arm/controller/get_state"],
            "/arm/controller may not be active: lifecycle get",
        ),
        (
            "/arm/controller/mode/damping",  # one's own robot before another one
            ["/arm/controller/get_state", "/other/controller/mode/damping"],
            "/arm/controller may not be active: lifecycle get",
        ),
        ("/arm/controler/status", ["/arm/controller/status"], "Is /arm/controller/status meant[?]"),
    ],
)
def test_what_is_not_there_is_looked_for_elsewhere(monkeypatch, capsys, name, there, says):
    """While it is waited for, and when that is over."""
    monkeypatch.setattr(sessions, "PATIENCE", -1.0)
    monkeypatch.setattr(sessions, "rclpy", SimpleNamespace(spin_once=lambda *_, **__: None))
    services = [
        (name, ["Type"]) for name in there if name.endswith("/get_state")
    ]  # of which a topic's commands know, too
    node = SimpleNamespace(get_service_names_and_types=lambda: services)
    found = {key: ["Type"] for key in there if not key.endswith("/get_state")}
    with pytest.raises(InputError, match=says):
        sessions.Session(node).kind_of(name, lambda: found, "what", 0.0)
    assert re.search(f"Waiting for what {name} … {says}", capsys.readouterr().err)


def test_answer_that_is_lost(monkeypatch):
    """What is called acts once, when it knows its client: an answer to a client that is not known is thrown away."""
    asked = []

    class Client:
        def __init__(self, name):
            self.name, self.service_is_ready = name, lambda: True

        def call_async(self, request):
            asked.append(self.name)
            future = Future()
            if asked.count("/arm/get_parameter_types") > 2:  # two answers are lost
                future.set_result(request)
            return future

    offered = [("/arm/get_parameter_types", []), ("/arm/pause", [])]
    node = SimpleNamespace(
        create_client=lambda kind, name: Client(name),
        destroy_client=lambda client: None,
        get_service_names_and_types=lambda: offered,
    )
    monkeypatch.setattr(rclpy, "spin_once", lambda *_, **__: None)
    graph = Session(node)
    assert graph.call("/arm/pause", SetBool, "on") == "on"
    assert asked == 3 * ["/arm/get_parameter_types"] + ["/arm/pause"]
    del offered[0]  # a node without parameters cannot be asked
    assert graph.call("/arm/pause", SetBool, "on") == "on"
    assert asked[4:] == ["/arm/pause"]


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
def test_a_reader_that_goes_away(robot, arguments):
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


# --- launch


def test_launch(ros_domain, tmp_path):
    """Nodes of a launch file start, say who says what, and end together at one Ctrl-C."""
    arguments = ("launch", "demo", f"urdf:={robot_path(PANDA)}", "namespace:=launched")
    with Process(command(*arguments), env=os.environ | {"PYTHONUNBUFFERED": "1"}) as launched:
        launched.wait_for(
            lambda output: all(
                any(f"[{node}]" in line and "Ready" in line for line in output.splitlines())
                for node in ("simulator", "monitor")
            ),
            "both nodes to be ready",
        )
        names = {"/launched/diag_dynamics", "/launched/diag_dynamics_simulator"}
        assert any(names <= set(said("node", "list").split()) for _ in range(10))  # a busy machine may be late with one
        nodes = launched.children()
        assert len(nodes) == 2
        launched.stop(timeout=SLOW)
    assert not [node for node in nodes if node.is_running()]


LAUNCHER = """
import signal, sys
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # whoever runs the tests under nohup has it ignored
from diag_dynamics.cli.main import main
from diag_dynamics.nodes.tools import launch_command
launch_command.command_of = lambda node: [sys.executable, "-c", *sys.argv[1:]]
sys.exit(main(["launch", "simulator"]))
"""
"""Starts a program in the place of a node."""

NODE = """
import os, signal, sys
alive = open(sys.argv[1], "w")  # until the process is gone
signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
sys.stdout.buffer.write(b"caf\\xe9 ready\\n")
sys.stdout.flush()
signal.sigwait({signal.SIGTERM})
print("asked to end", flush=True)
"""


class Launched(Process):
    """A launcher of one program, and a pipe that its process holds open as long as it is there."""

    def __init__(self, program, fifo, **options):
        os.mkfifo(fifo)
        self.alive = os.open(fifo, os.O_RDONLY | os.O_NONBLOCK)
        super().__init__([sys.executable, "-c", LAUNCHER, program, fifo], **options)

    def nobody_is_left(self):
        """Wait until the program's process is gone."""
        ready, _, _ = select.select([self.alive], [], [], 30.0)
        return ready and os.read(self.alive, 1) == b""

    def __exit__(self, *error):
        super().__exit__(*error)
        os.close(self.alive)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_launch_ends_with_its_nodes(number, tmp_path):
    """At a Ctrl-C, at the end of a service, and when the terminal is closed."""
    with Launched(NODE, tmp_path / "alive") as launched:
        launched.wait_for_text("[simulator] caf\N{REPLACEMENT CHARACTER} ready")  # that it is no UTF-8 does not matter
        launched.stop(number)
        assert launched.nobody_is_left()
    assert "[simulator] asked to end" in launched.output


@pytest.mark.skipif(sys.platform != "linux", reason="others have no such signal")
def test_launch_that_is_killed_leaves_nobody(tmp_path):
    with Launched(NODE, tmp_path / "alive") as launched:
        launched.wait_for_text("ready")
        launched.signal(signal.SIGKILL)
        launched.wait()
        assert launched.nobody_is_left()


def test_launch_kills_at_a_second_ctrl_c(tmp_path):
    program = NODE + "signal.pause()\n"
    with Launched(program, tmp_path / "alive") as launched:
        launched.wait_for_text("ready")
        launched.signal(signal.SIGINT)
        launched.wait_for_text("asked to end")
        launched.signal(signal.SIGINT)
        assert launched.wait() == 1 and launched.nobody_is_left()
    assert "simulator has been killed" in launched.output and "Traceback" not in launched.output


def test_launch_that_nobody_reads_holds_no_node_up(tmp_path):
    """What its nodes say is taken from them nevertheless."""
    program = NODE + "print((100 * 'x' + '\\n') * 10000, flush=True)\n"
    read, write = os.pipe()
    with Launched(program, tmp_path / "alive", stdout=write, stderr=subprocess.PIPE) as launched:
        os.close(write)
        assert b"ready" in os.read(read, 100)
        os.close(read)
        launched.listen(launched.popen.stderr.fileno())
        launched.signal(signal.SIGTERM)
        assert launched.wait() == 0 and launched.nobody_is_left()
    assert launched.output == ""


def test_launch_tells_of_a_node_that_fails(tmp_path):
    with Launched("import sys; open(sys.argv[1], 'w'); sys.exit(3)", tmp_path / "alive") as launched:
        assert launched.wait() == 1
    assert "simulator has ended with status 3" in launched.output


def test_wrong_arguments(ros_domain):
    assert "option --rte is not known; is --rate meant" in said_by_process("simulator", "--rte", "5", status=2)
    assert "invalid choice: 'nothing'" in said_by_process("launch", "nothing", status=2)
    assert "of the form name:=value" in said_by_process("launch", "demo", "urdf=x", status=1)
