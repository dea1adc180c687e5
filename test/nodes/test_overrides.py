# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a node is given as parameters, in a node of the test's own: other types of the same value, and unknown names."""

import array

import pytest
import rclpy
from rclpy.parameter import Parameter, get_parameter_value

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.declaring import declare
from diag_dynamics.nodes.support.diagnostics import steady
from diag_dynamics.nodes.support.overrides import meant, tell_unknown
from diag_dynamics.parameters.controller import PARAMETERS as OF_CONTROLLER
from diag_dynamics.parameters.monitor import PARAMETERS


@pytest.mark.parametrize(
    ("value", "default", "expected"),
    [
        (1, 0.0, 1.0),
        (True, 0.0, True),
        ("1", 0.0, "1"),
        (2, 1, 2),
        ([0, 0, -9], [0.0] * 3, [0.0, 0.0, -9.0]),
        (array.array("q", [1, 2, 3]), [0.0] * 3, [1.0, 2.0, 3.0]),
        ("[0, 0, -9.81]", [0.0] * 3, [0.0, 0.0, -9.81]),
        ("down", [0.0] * 3, "down"),
        ([], [0.0] * 3, []),
        ([], [""], [""]),
        (array.array("d"), [""], [""]),
        (["a=1"], [""], ["a=1"]),
        ("a=1", [""], "a=1"),
        ("", "", ""),
        (1, "", 1),
    ],
)
def test_meant(value, default, expected):
    """A whole number is a number, an empty list one of anything; what is another thing stays what it is."""
    found = meant(value, default)
    assert found == expected and type(found) is type(expected)


@pytest.fixture
def made(no_discovery):
    """Make nodes with arguments, and destroy them at the end."""
    context, nodes = rclpy.Context(), []
    rclpy.init(context=context)

    def make(*arguments):
        command = ["--ros-args", *(part for argument in arguments for part in argument)]
        nodes.append(rclpy.create_node("own", context=context, cli_args=command))
        return nodes[-1]

    yield make
    for node in nodes:
        node.destroy_node()
    context.try_shutdown()


def test_given_on_the_command_line(made):
    """Whole numbers, and an empty list, which has no type in rcl; an empty list of numbers is refused by name."""
    node = made(("-p", "warn_energy:=1"), ("-p", "gravity:=[0, 0, -9]"), ("-p", "payloads:=[]"))
    values = declare(node, PARAMETERS)
    assert values["warn_energy"] == 1.0 and list(values["gravity"]) == [0.0, 0.0, -9.0] and values["payloads"] == [""]
    with pytest.raises(InputError, match=r"parameter 'gravity' is \[\], expected 3 numbers"):
        declare(made(("-p", "gravity:=[]")), PARAMETERS)


def test_set_while_running(made):
    """As `ros2 param set` reads what is typed: what is no value of the parameter is refused with its type."""
    node = made()
    declare(node, PARAMETERS)

    def put(name, text):
        message = Parameter(name).to_parameter_msg()
        message.value = get_parameter_value(text)
        return node.set_parameters([Parameter.from_parameter_msg(message)])[0]

    for name, text, expected in (
        ("payloads", "[tool0=1.0]", ["tool0=1.0"]),
        ("payloads", "[]", [""]),
        ("warn_energy", "3", 3.0),
        ("gravity", "[0, 0, -9]", [0.0, 0.0, -9.0]),
        ("gravity", "[0, 1, -9.81]", [0.0, 1.0, -9.81]),
    ):
        result = put(name, text)
        assert result.successful, result.reason
        value = node.get_parameter(name).value
        assert (value if isinstance(value, float) else list(value)) == expected
    for name, text in (("warn_energy", "high"), ("gravity", "down"), ("payloads", "3"), ("floating_base", "1")):
        assert "Wrong parameter type" in put(name, text).reason
    assert node.set_parameters([Parameter("payloads", value=[])])[0].successful  # as rclpy sends it: bytes


def test_names_that_nobody_knows(made, tmp_path, capfd):
    """The node warns of misspelt parameters; it ignores those of other nodes and unrelated names."""
    file = tmp_path / "shared.yaml"
    file.write_text(
        "/**:\n  ros__parameters:\n    joint_timeouts: [a=1.0]\n    rate: 100.0\n    step: 0.001\n    update_rate: 5\n"
        "    robot_compensates_gravity: true\n    use_sim_tme: true\n    qos_overrides: {/x: {publisher: {depth: 3}}}\n"
        "own:\n  ros__parameters: {energy_limt: 1.0, max_rate: {statos: 1.0}}\n"
    )
    node = made(("--params-file", str(file)))
    declare(node, OF_CONTROLLER)
    capfd.readouterr()
    tell_unknown(node)
    told = [line.split(": ", 1)[1] for line in capfd.readouterr().err.splitlines()]
    assert sorted(told) == [
        "Parameter 'energy_limt' is not known, and has no effect: is 'energy_limit' meant?",
        "Parameter 'max_rate.statos' is not known, and has no effect: is 'max_rate.status' meant?",
        "Parameter 'use_sim_tme' is not known, and has no effect: is 'use_sim_time' meant?",
    ]


# --- texts


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "position of joint 'joint 1' is 12.5, expected a number",
            "position of joint 'joint 1' is …, expected a number",
        ),
        ("the state is 0.034 s old, expected no more than max_state_age = 0.02 s", None),
        ("state.position has 3 entries for 7 names", "state.position has … entries for … names"),
        ("target.pose.position is [nan, -1e-05, 2]", "target.pose.position is [nan, …, …]"),
        ("stamp 1700000000.5 s behind /robot1/clock of panda_link0, 2.5 J^0.5/s", None),
    ],
)
def test_a_status_says_what_stays(text, expected):
    """Numbers that are measured are left out of a status's message, those of parameters and within names are not."""
    if expected is None:
        expected = text.replace("0.034", "…").replace("1700000000.5", "…").replace("2.5 J", "… J")
    assert steady(text) == expected
    assert steady(expected) == expected
