# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics` options, messages as YAML, and commands on a graph in the test's process."""

import re
from contextlib import contextmanager, nullcontext
from types import SimpleNamespace

import pytest
import rclpy
import yaml
from geometry_msgs.msg import WrenchStamped
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

from described import PANDA
from diag_dynamics.cli.main import main
from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.plain_options import as_ros_arguments
from diag_dynamics.nodes.tools import session as sessions
from diag_dynamics.nodes.tools import topic_commands
from diag_dynamics.nodes.tools.session import Session
from diag_dynamics.nodes.tools.yaml_messages import as_values, as_yaml, field, filled, type_of
from nodes import TIMEOUT
from robots import robot_path

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
        (["--rate", "1e-6"], ["-p", "rate:=1.0e-06"]),
        (["--rate", "-1E3"], ["-p", "rate:=-1000.0"]),
        (["--gravity", "[0, 0, -1.62]"], ["-p", "gravity:=[0.0, 0.0, -1.62]"]),
        (["--gravity", "0,0,1"], ["-p", "gravity:=[0.0, 0.0, 1.0]"]),
        (["--depth", "7"], ["-p", "depth:=7"]),
        (["--robot-description", "a b/1.urdf"], ["-p", 'robot_description:="a b/1.urdf"']),
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


# --- commands on the graph


@pytest.fixture(scope="module")
def robot(peer):
    """Start a simulator and a monitor in a namespace, by options as a user gives them."""
    options = {"--robot-description": robot_path(PANDA), "--motion": "wave", "--rate": 100, "--namespace": "arm"}
    given = [str(part) for option in options.items() for part in option]
    defaults = {"robot_description": "", "motion": "", "rate": 100.0}
    arguments = as_ros_arguments(given, defaults)[1:]
    with peer.start("simulator", *arguments), peer.start("monitor", "-r", "__ns:=/arm"):
        peer.pass_time(1.0)
        yield "/arm/diag_dynamics"


@pytest.fixture
def said(peer, monkeypatch, capsys):
    """Return a function that runs a command on the graph, and returns its output, or its errors if it fails."""

    @contextmanager
    def session():
        node = peer.extra_node("_command", "/")
        yield Session(node)
        peer.drop_node(node)

    begun = 0.0
    for kind in ("topic", "service", "param", "lifecycle"):
        monkeypatch.setattr(f"diag_dynamics.nodes.tools.{kind}_commands.session", session)
    clock = SimpleNamespace(monotonic=lambda: peer.graph.steady, perf_counter=lambda: peer.graph.steady)
    monkeypatch.setattr(sessions, "time", clock)
    monkeypatch.setattr(topic_commands, "time", clock)

    def spin_once(node, timeout_sec):
        assert peer.graph.steady < begun + TIMEOUT, "the command does not end"
        peer.pass_time(min(timeout_sec, 0.01))

    monkeypatch.setattr(sessions, "rclpy", SimpleNamespace(spin_once=spin_once))

    def run(*arguments, status=0):
        nonlocal begun
        begun = peer.graph.steady
        capsys.readouterr()
        assert main([*map(str, arguments)]) == status
        output = capsys.readouterr()
        assert "Traceback" not in output.err
        return output.err if status else output.out

    return run


def test_topics(robot, said):
    """list, info, echo and hz; a similar name where there is no such topic."""
    topics = said("topic", "list", "-t").splitlines()
    assert "/arm/joint_states [sensor_msgs/msg/JointState]" in topics
    assert f"{robot}/kinetic_energy [diag_dynamics/msg/KineticEnergy]" in topics
    info = said("topic", "info", "/arm/joint_states").splitlines()
    assert "  /arm/diag_dynamics_simulator [sensor_msgs/msg/JointState] reliable, volatile" in info
    assert "Subscription count: 1" in info
    state = yaml.safe_load(said("topic", "echo", "--once", "arm/joint_states"))
    assert len(state["name"]) == len(state["position"]) == 9  # fingers and mimic joint
    assert float(said("topic", "echo", "--once", f"{robot}/kinetic_energy", "--field", "total")) > 0.0
    assert said("topic", "echo", "--once", "/arm/robot_description", "--field", "data").count("<link") > 8  # latched
    assert float(said("topic", "hz", "--once", "/arm/joint_states").split()[2]) == pytest.approx(100.0, rel=0.05)
    assert "/arm/joint_states meant" in said("topic", "hz", "/arm/joint_state", status=1)


def test_publish(peer, robot, said, monkeypatch):
    """A message reaches its subscribers with its values."""
    monkeypatch.setattr("node_harness.GraphPublisher.wait_for_all_acked", lambda *_: True, raising=False)
    pushes = peer.topic(WrenchStamped, "/heard/wrench")
    values = "{header: {frame_id: panda_hand}, wrench: {force: {x: 5}}}"
    said("topic", "pub", "--once", "/heard/wrench", "geometry_msgs/msg/WrenchStamped", values)
    peer.wait_until(lambda: pushes.messages, "the push")
    assert pushes.messages[0].wrench.force.x == 5.0 and pushes.messages[0].header.frame_id == "panda_hand"


def test_services(robot, said):
    """call, with a field of the response; a wrong request names the field."""
    pause = f"{robot}_simulator/pause"
    assert yaml.safe_load(said("service", "call", pause, "{data: true}"))["success"] is True
    assert said("service", "call", pause, "std_srvs/srv/SetBool", "{data: false}")
    assert "has no field 'dat'" in said("service", "call", pause, "{dat: true}", status=1)
    state = ("service", "call", f"{robot}_simulator/get_state", "--field")
    assert said(*state, "current_state.label") == "active\n"
    assert "there is no 'label'" in said(*state, "label", status=1)
    step = ("service", "call", f"{robot}_simulator/step", "--field", "stamp")
    assert said(*step, status=1)  # it has to be paused for that, which the message says; nothing else comes out


def test_parameters_and_lifecycle(robot, said):
    """get and set of a parameter, and of a lifecycle state."""
    assert "Set parameter successful" in said("param", "set", robot, "gravity", "[0, 0, -3.72]")
    assert yaml.safe_load(said("param", "get", robot, "gravity")) == [0.0, 0.0, -3.72]
    assert "expected 3 numbers" in said("param", "set", robot, "gravity", "[0, 0]", status=1)
    assert said("lifecycle", "get", robot) == "active [3]\n"
    assert "has no transition 'configure'; it has" in said("lifecycle", "set", robot, "configure", status=1)


# --- what is not there, and answers that do not come


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
    """A call is sent once, after the server knows the client: responses to unknown clients are dropped."""
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
