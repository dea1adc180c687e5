# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all nodes share: parameters of a table, robots loaded in a thread, and texts of
diagnostics.
"""

import os
import pickle
import re
import select
import signal
import subprocess
import sys
import threading
import warnings
from importlib import import_module
from pathlib import Path

import pytest
import rclpy
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.node import Node
from rclpy.parameter import Parameter, get_parameter_value

from diag_dynamics.description.catalog import describe
from diag_dynamics.exceptions import InputError, UrdfError
from diag_dynamics.nodes.support import runner
from diag_dynamics.nodes.support.declaring import TableNode, judge
from diag_dynamics.nodes.support.descriptions import RobotLoader, load_robot
from diag_dynamics.nodes.support.topics import NODES
from diag_dynamics.parameters.controller import PARAMETERS as OF_CONTROLLER
from diag_dynamics.parameters.monitor import PARAMETERS
from diag_dynamics.parameters.shared import PARAMETERS as SHARED
from limits import HANG
from robots import description, joint, link

ROOT = Path(__file__).resolve().parents[2]

# --- parameters


class Tabled(TableNode, Node):
    """A node with a table of parameters."""

    is_unconfigured = False


@pytest.fixture
def made(no_discovery):
    """Make nodes of a table with arguments, and destroy them at the end."""
    context = rclpy.Context()
    nodes = []
    rclpy.init(context=context)

    def make(*arguments, specs=PARAMETERS, name="own"):
        options = (
            {"context": context, "cli_args": ["--ros-args", *arguments]}
            if arguments
            else {"context": context}
        )
        nodes.append(Tabled(name, specs, **options))
        judge(nodes[-1], specs, nodes[-1].values.update)
        return nodes[-1]

    yield make
    for node in nodes:
        node.destroy_node()
    context.try_shutdown()


def test_values_on_the_command_line(made):
    node = made("-p", "max_age:=1", "-p", "gravity:=[0, 0, -9]", "-p", "payloads:=[]")
    assert node.values["max_age"] == 1.0 and node.get_parameter("max_age").value == 1.0
    assert list(node.values["gravity"]) == [0.0, 0.0, -9.0] and node.values["payloads"] == [""]
    with pytest.raises(InputError, match=r"parameter 'gravity' is \[\]; expected 3 numbers"):
        made("-p", "gravity:=[]")
    with pytest.raises(
        InputError, match="parameter 'missing_velocity' is 'maybe'; expected one of"
    ):
        made("-p", "missing_velocity:=maybe")
    with pytest.raises(InvalidParameterTypeException, match="max_age"):
        made("-p", "max_age:=high")


def test_paths_are_absolute(made, tmp_path, monkeypatch):
    """Other nodes, such as the view, read files of parameters in other folders."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.yaml").write_text("{}")
    (tmp_path / "arm.xacro").write_text("<robot/>")
    node = made("-p", "parameters_file:=arm.yaml", "-p", "robot_description:=arm.xacro side:=left")
    assert node.values["parameters_file"] == str(tmp_path / "arm.yaml")
    assert node.values["robot_description"] == f"{tmp_path / 'arm.xacro'} side:=left"
    texts = made("-p", "parameters_file:=none.yaml", "-p", "robot_description:=<robot/>").values
    assert (texts["parameters_file"], texts["robot_description"]) == ("none.yaml", "<robot/>")


def test_values_set_while_running(made):
    """As `ros2 param set` parses what is typed; a value of another type is refused, a read-only one
    stays.
    """
    node = made()

    def put(name, text):
        message = Parameter(name).to_parameter_msg()
        message.value = get_parameter_value(text)
        return node.set_parameters([Parameter.from_parameter_msg(message)])[0]

    for name, text, expected in (
        ("payloads", "[tool0=1.0]", ["tool0=1.0"]),
        ("payloads", "[]", [""]),
        ("max_age", "3", 3.0),
        ("gravity", "[0, 1, -9.81]", [0.0, 1.0, -9.81]),
    ):
        result = put(name, text)
        assert result.successful, result.reason
        value = node.get_parameter(name).value
        assert (value if isinstance(value, float) else list(value)) == expected
    for name, text, reason in (
        ("max_age", "high", "Wrong parameter type"),
        ("max_age", "true", "Wrong parameter type"),
        ("gravity", "down", "Wrong parameter type"),
        ("gravity", "[]", "Wrong parameter type"),
        ("gravity", "[1.0]", "parameter 'gravity' is [1.0]; expected 3 numbers."),
        ("missing_velocity", "maybe", "expected one of reject, estimate"),
        ("mimic", "free", "read-only"),
    ):
        assert reason in put(name, text).reason


def test_unknown_names(made, tmp_path, capfd):
    """The node warns of parameters that no node has, and names the nearest one."""
    file = tmp_path / "shared.yaml"
    file.write_text(
        "/**:\n  ros__parameters:\n    joint_timeout: [a=1.0]\n    rate: 100.0\n    step: "
        "0.001\n    update_rate: 5\n"
        "    robot_compensates_gravity: true\n    use_sim_tme: true\n    qos_overrides: "
        "{/x: {publisher: {depth: 3}}}\n"
        "own:\n  ros__parameters: {energy_limt: 1.0, max_rate: "
        "{statos: 1.0}, nothing: []}\n"
    )
    node = made("--params-file", str(file), specs=OF_CONTROLLER)
    logged = [line.split(": ", 1)[1] for line in capfd.readouterr().err.splitlines()]
    assert sorted(logged) == [
        "Unknown parameter 'energy_limt' ignored. Did you mean 'energy_limit'?",
        "Unknown parameter 'max_rate.statos' ignored. Did you mean 'max_rate.status'?",
        "Unknown parameter 'nothing' ignored.",
        "Unknown parameter 'update_rate' ignored.",
        "Unknown parameter 'use_sim_tme' ignored. Did you mean 'use_sim_time'?",
    ]
    assert not node.has_parameter("update_rate")


WRITTEN = []
"""Texts of parameter files, and the nodes that may read them."""
for path in sorted((ROOT / "config").rglob("*.yaml")):
    nodes = [path.stem] if path.stem in NODES else [*NODES]
    WRITTEN.append((path.read_text(encoding="utf-8"), nodes))
for path in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
    blocks = re.findall(r"```yaml\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL)
    WRITTEN += [(block, [*NODES]) for block in blocks]
WRITTEN = [entry for entry in WRITTEN if "ros__parameters" in entry[0]]


def test_written_parameters_are_known(made, tmp_path, capfd):
    """No YAML of config/ and of the pages has a parameter that a node does not know."""
    assert len(WRITTEN) > 15
    for number, (text, nodes) in enumerate(WRITTEN):
        file = tmp_path / f"{number}.yaml"
        file.write_text(text)
        for node in nodes:
            specs = import_module(f"diag_dynamics.parameters.{node}").PARAMETERS
            made("--params-file", str(file), specs=specs, name=NODES[node])
        assert "Unknown parameter" not in capfd.readouterr().err, text


@pytest.mark.parametrize(
    ("node", "most"), [("monitor", 50), ("controller", 42), ("simulator", 22), ("view", 4)]
)
def test_number_of_parameters(node, most):
    """Each parameter is read by every user of a node: a new one takes the place of another one."""
    assert len(import_module(f"diag_dynamics.parameters.{node}").PARAMETERS) <= most


# --- robots


class TimersByHand:
    """A node whose timers the test runs."""

    def __init__(self):
        self.timers = []

    def create_timer(self, period, callback, clock):
        self.timers.append(callback)
        return callback

    def destroy_timer(self, timer):
        self.timers.remove(timer)

    def spin_until(self, condition):
        while not condition():
            for timer in list(self.timers):
                timer()


class Loading:
    """Descriptions that are loaded when the test allows it."""

    def __init__(self):
        self.node = TimersByHand()
        self.begun = []
        self.allowed = {}
        self.taken = []
        self.loader = RobotLoader(self.node, self.load, lambda *taken: self.taken.append(taken))

    def load(self, name, *context):
        self.begun.append(name)
        assert self.allowed.setdefault(name, threading.Event()).wait(HANG)
        if name.startswith("bad"):
            raise ValueError(name)
        return name.upper()

    def allow(self, *names):
        for name in names:
            self.allowed.setdefault(name, threading.Event()).set()

    def begin(self, *names):
        """Load one, whose thread waits, and request others."""
        self.loader.load(names[0], 1)
        self.node.spin_until(lambda: self.begun)
        for name in names[1:]:
            self.loader.load(name, 2)


@pytest.fixture
def loading():
    loading = Loading()
    yield loading
    loading.allow(*loading.begun)


def test_executor_takes_the_newest_robot(loading):
    """The executor takes it over; older ones are dropped, or not even loaded."""
    loading.begin("one", "two", "three")
    assert loading.loader.loading == "three" and not loading.taken
    loading.allow("one", "three")
    loading.node.spin_until(lambda: loading.taken)
    assert loading.taken == [("THREE", "three", 2)] and loading.begun == ["one", "three"]
    assert loading.loader.loading is None and not loading.node.timers


def test_error_is_handed_over(loading):
    loading.begin("bad")
    loading.allow("bad")
    loading.node.spin_until(lambda: loading.taken)
    [(error, *arguments)] = loading.taken
    assert isinstance(error, ValueError) and arguments == ["bad", 1]


def test_finish_waits_for_the_newest(loading, monkeypatch):
    """A signal ends the waiting."""
    loading.begin("one", "two")
    monkeypatch.setattr(runner.Stop, "requested", True)
    loading.loader.finish()
    assert not loading.taken
    monkeypatch.setattr(runner.Stop, "requested", False)
    loading.allow("one", "two")
    loading.loader.finish()
    assert loading.taken == [("TWO", "two", 2)]


class Log(list):
    """A node's log."""

    log_info = log_warning = list.append


DESCRIBE = """
import pickle, sys, warnings
from diag_dynamics.nodes.support.description_process import described

source = pickle.load(sys.stdin.buffer)
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    try:
        outcome = described(source)
    except ValueError as error:
        outcome = error
texts = [(warning.category, str(warning.message)) for warning in caught]
sys.stdout.buffer.write(pickle.dumps((outcome, texts, "yourdfpy" in sys.modules)))
"""
"""Reads a description without the reader in its process, and writes what came of it."""


@pytest.mark.parametrize("fault", [False, True])
def test_description_read_in_a_process_of_its_own(fault, tmp_path):
    """Description, warnings and errors are those of the reader, which stays outside.

    A module of its name in the working directory is not imported.
    """
    parent = "<patent" if fault else "<parent"
    text = (
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute">'
        f'{parent} link="a"/><child link="b"/><axis/></joint></robot>'
    )
    path = tmp_path / "r.urdf.xacro"
    path.write_text(text)
    source = f"{path} unused:=1"
    command = [sys.executable, "-c", DESCRIBE]
    (tmp_path / "yourdfpy.py").write_text("raise SystemExit('not the reader')")
    options = {"capture_output": True, "check": True, "cwd": tmp_path}
    process = subprocess.run(command, input=pickle.dumps(source), **options)
    outcome, warned, has_reader = pickle.loads(process.stdout)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        if fault:
            with pytest.raises(UrdfError) as expected:
                describe(source)
            assert isinstance(outcome, UrdfError)
            assert str(outcome) == str(expected.value)
        else:
            assert pickle.dumps(outcome) == pickle.dumps(describe(source))
    assert warned == [(warning.category, str(warning.message)) for warning in caught]
    assert warned and not has_reader


def test_reader_of_descriptions_ends_with_its_node(tmp_path):
    """It waits for a part of the robot from a pipe that nobody writes."""
    robot = tmp_path / "r.urdf.xacro"
    part = tmp_path / "part"
    os.mkfifo(part)
    include = f'<xacro:include filename="{part}"/>'
    robot.write_text(f'<robot name="r" xmlns:xacro="http://wiki.ros.org/xacro">{include}</robot>')
    module = "diag_dynamics.nodes.support.description_process"
    command = [sys.executable, "-c", f"from {module} import described; described({str(robot)!r})"]
    node = subprocess.Popen(command)
    with open(part, "wb") as pipe:  # once the reader has opened it
        node.kill()
        node.wait()
        ends = select.poll()
        ends.register(pipe, select.POLLERR)
        assert ends.poll(60_000)


def test_warnings_are_logged():
    odd = (1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 1.0, 0.0, 5.0))
    joints = (joint(f"j{k}", "revolute", f"l{k}", f"l{k + 1}") for k in range(29))
    text = description("odd", *(link(f"l{k}", *odd) for k in range(30)), *joints)
    log = Log()
    values = {name: spec.default for name, spec in SHARED.items()}
    assert load_robot(log, text, values).nv == 29
    assert sum("link 'l0' and 29 more" in line for line in log) == 1


# --- the process


@pytest.fixture
def handlers(monkeypatch):
    """Return the signal handlers that are installed, and install none."""
    installed = {}
    monkeypatch.setattr(signal, "signal", installed.__setitem__)
    monkeypatch.setattr(runner.Stop, "requested", False)
    return installed


class Short(Node):
    """A node that ends by itself or by a signal, and is destroyed in any case."""

    def __init__(self, name, act):
        super().__init__(name, use_global_arguments=False)
        self.finished = rclpy.task.Future()
        self.destroyed = False
        self.create_timer(0.001, lambda: act(self))

    def destroy_node(self):
        self.destroyed = True
        super().destroy_node()


@pytest.mark.parametrize("way", ["signal", "finished"])
def test_nodes_end_together(no_discovery, handlers, way):
    """One signal, or one node that has finished, ends all nodes of an executor with status 0."""
    nodes = []

    def act(node):
        if way == "signal":
            handlers[signal.SIGTERM](signal.SIGTERM, None)
        elif not node.finished.done():
            node.finished.set_result(None)

    def make():
        nodes.extend([Short("one", act), Short("two", lambda node: None)])
        return nodes

    assert runner.run(lambda: list(make()), ["program"]) == 0
    assert all(node.destroyed for node in nodes) and set(handlers) == {
        signal.SIGINT,
        signal.SIGTERM,
    }
    assert not rclpy.ok()


@pytest.mark.parametrize("where", ["constructor", "future", "arguments"])
def test_faults_of_the_user_are_one_line(no_discovery, handlers, capfd, where):
    """The exit status is 1, and control characters are escaped."""

    def fail(*_):
        raise InputError("parameter 'x' is \x1b[31m")

    def finish(node):
        if not node.finished.done():
            node.finished.set_exception(InputError("parameter 'x' is \x1b[31m"))

    make = fail if where == "constructor" else lambda: Short("one", finish)
    wrong = ["--ros-args", "-p", "x:=[1, a]"] if where == "arguments" else []
    assert runner.run(make, ["program", *wrong]) == 1
    *_, printed = capfd.readouterr().err.splitlines()  # before that rcl logs what it cannot parse
    assert printed.startswith("InputError: ") and printed.isprintable()
