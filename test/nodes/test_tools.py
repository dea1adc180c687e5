# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as YAML, and `diag-dynamics topic` and `service` on a graph in the test's process."""

import re
from contextlib import contextmanager

import pytest
import yaml
from rcl_interfaces.msg import ParameterValue
from sensor_msgs.msg import JointState

from described import PANDA
from diag_dynamics.cli.main import main
from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes import graph_commands
from diag_dynamics.nodes.graph_commands import find_type, from_yaml, read_field, to_yaml
from limits import HANG
from robots import robot_path

# --- messages as YAML


def test_messages_there_and_back():
    text = "{header: {frame_id: arm, stamp: {sec: 3}}, name: [a, b], position: [1, 2.5]}"
    message = from_yaml(JointState, text)
    assert (
        message.header.stamp.sec == 3
        and list(message.position) == [1.0, 2.5]
        and message.name == ["a", "b"]
    )
    assert (
        from_yaml(JointState, to_yaml(message)) == message
        and from_yaml(JointState, "") == JointState()
    )
    assert (
        read_field(message, "header.frame_id") == "arm"
        and read_field(message, "position[1]") == 2.5
    )
    assert find_type("sensor_msgs/msg/JointState") is JointState
    value = from_yaml(
        ParameterValue, "{type: 5, bool_value: true, byte_array_value: [7], string_value: 'on'}"
    )
    assert from_yaml(ParameterValue, to_yaml(value)[: to_yaml(value).index("byte")]).bool_value
    assert list(value.byte_array_value) == [b"\x07"]


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("{nam: [a]}", "request has no field 'nam'. Did you mean 'name'?"),
        (
            "{xyz: 1}",
            "request has no field 'xyz'; expected one of header, name, position, velocity, effort.",
        ),
        ("{position: a}", "request.position is 'a'; expected sequence<double>."),
        ("{header: {stamp: {sec: 1.5}}}", "request.header.stamp.sec is 1.5; expected int32."),
        ("{name: [1]}", "request.name is 1; expected string."),
        ("{position: [true]}", "request.position is True; expected double."),
        ("{header: 3}", "request.header is 3; expected {field: value} of stamp, frame_id."),
        ("[", "request is no YAML"),
    ],
)
def test_messages_that_are_wrong(text, error):
    with pytest.raises(InputError, match=re.escape(error)):
        from_yaml(JointState, text)


@pytest.mark.parametrize("name", ["JointState", "sensor_msgs/msg/JointStat", "no_msgs/msg/X"])
def test_types_that_are_none(name):
    with pytest.raises(InputError, match=f"type is '{name}'; expected package/msg/Name"):
        find_type(name)


# --- commands on the graph


@pytest.fixture(scope="module")
def robot(peer):
    """Start a simulator and a monitor in a namespace."""
    parameters = {"robot_description": robot_path(PANDA), "motion": "wave", "rate": 100.0}
    with (
        peer.start("simulator", "-r", "__ns:=/arm", **parameters),
        peer.start("monitor", "-r", "__ns:=/arm"),
    ):
        peer.pass_time(1.0)
        yield "/arm/diag_dynamics"


@pytest.fixture
def output_of(peer, monkeypatch, capsys):
    """Return a function that runs a command on the graph, and returns its output, or its errors if it fails."""
    begin = 0.0

    class Session(graph_commands.Session):
        def __init__(self, node):
            self.node, self.time = node, lambda: peer.graph.steady

        def spin(self, seconds):
            assert peer.graph.steady < begin + HANG, "the command does not end"
            peer.pass_time(min(seconds, 0.01))

    @contextmanager
    def session():
        node = peer.extra_node("_command", "/")
        yield Session(node)
        peer.drop_node(node)

    monkeypatch.setattr(graph_commands, "session", session)

    def run(*arguments, status=0):
        nonlocal begin
        begin = peer.graph.steady
        capsys.readouterr()
        assert main([*map(str, arguments)]) == status
        output = capsys.readouterr()
        assert "Traceback" not in output.err
        return output.err if status else output.out

    return run


def test_topics(robot, output_of):
    """Echo and hz; a similar name where there is no such topic; latched topics arrive."""
    state = yaml.safe_load(output_of("topic", "echo", "--once", "arm/joint_states"))
    assert len(state["name"]) == len(state["position"]) == 9  # fingers and mimic joint
    assert (
        float(output_of("topic", "echo", "--once", f"{robot}/kinetic_energy", "--field", "total"))
        > 0.0
    )
    assert (
        output_of("topic", "echo", "--once", "/arm/robot_description", "--field", "data").count(
            "<link"
        )
        > 8
    )
    rate = output_of("topic", "hz", "--once", "/arm/joint_states").split()
    assert rate[:2] == ["average", "rate:"] and float(rate[2]) == pytest.approx(100.0, rel=0.05)
    error = output_of("topic", "hz", "/arm/joint_state", status=1)
    assert "no topic /arm/joint_state within 10 s. Did you mean /arm/joint_states?" in error
    assert "field 'totl' has no part 'totl'" in output_of(
        "topic", "echo", f"{robot}/kinetic_energy", "--field", "totl", status=1
    )


def test_services(robot, output_of):
    """Call, with and without a type, also for parameters; a wrong request names the field."""
    pause = ("service", "call", f"{robot}_simulator/pause")
    assert yaml.safe_load(output_of(*pause, "{data: true}"))["success"] is True
    assert (
        yaml.safe_load(output_of(*pause, "std_srvs/srv/SetBool", "{data: false}"))["success"]
        is True
    )
    assert "request has no field 'dat'" in output_of(*pause, "{dat: true}", status=1)
    parameters = ("service", "call", f"{robot}/get_parameters", "{names: [gravity]}")
    gravity = output_of(*parameters, "--field", "values[0].double_array_value")
    assert yaml.safe_load(gravity) == [0.0, 0.0, -9.81]
    error = output_of("service", "call", f"{robot}_simulator/paus", "--timeout", "1", status=1)
    assert (
        f"no service {robot}_simulator/paus within 1 s. Did you mean {robot}_simulator/pause?"
        in error
    )


@pytest.mark.parametrize(
    "arguments", [("topic", "list"), ("service", "list"), ("param", "get", "/a", "b")]
)
def test_commands_of_ros2cli_alone(arguments, capsys):
    """Only `topic echo`, `topic hz` and `service call` stand in for ros2cli."""
    if arguments[0] == "param":
        assert main([*arguments]) == 2
    else:
        with pytest.raises(SystemExit, match="2"):
            main([*arguments])
    assert "list" in capsys.readouterr().err
