# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator by itself: joint states, time, description, and parameters that it cannot start
with.
"""

import numpy as np
import pytest
from rclpy.exceptions import ParameterException
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

import robots
from diag_dynamics import DiagonalDynamics, load_urdf
from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.parameters.monitor import PARAMETERS
from launches import launched
from nodes import BELIEVING, LATCHED, MS, PANDA, UR5, Monitor, S
from simulators import Simulator


@pytest.fixture(scope="module")
def wave(peer):
    """Start a Panda that moves along sine waves, with a step of the integrator for each state."""
    with Simulator(peer, "/wave", PANDA, motion="wave", rate=500.0, step=0.002) as simulator:
        yield simulator


# --- what it publishes


def test_description(wave):
    """Who subscribes late receives the URDF as text, without its XML declaration, which is for
    files.
    """
    topic = wave.peer.topic(String, "/wave/robot_description", LATCHED)
    wave.peer.wait_until(lambda: topic.messages, "the description")
    text = topic.messages[0].data
    assert text.startswith("<")
    assert wave.robot.urdf.endswith(text)
    assert len(text) > 0.9 * len(wave.robot.urdf)


def test_description_of_a_xacro_file(peer, tmp_path):
    """The simulator publishes the URDF that xacro makes of the file and its arguments.

    Time passes as fast as possible.
    """
    path = tmp_path / "arm.urdf.xacro"
    yaml_path = tmp_path / "arm.yaml"
    yaml_path.write_text("joints: {left_turn: {damping: 0.5}}")
    path.write_text(
        '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="base"/>'
        '<link name="tip"><inertial>'
        '<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
        "</inertial></link>"
        '<joint name="$(arg side)_turn" type="continuous"><parent link="base"/>'
        '<child link="tip"/></joint></robot>'
    )
    topic = peer.topic(String, "/expanded/robot_description", LATCHED)
    states = peer.topic(JointState, "/expanded/joint_states")
    parameters = {"robot_description": f"{path} side:=left", "parameters_file": str(yaml_path)}
    parameters["real_time_factor"] = 0.0
    with peer.start("simulator", "-r", "__ns:=/expanded", **parameters) as simulator:
        peer.wait_until(lambda: topic.messages and states.messages, "a description")
        assert f"Parameters of 1 joint from '{yaml_path}'." in simulator.output
    assert load_urdf(topic.messages[-1].data).dof_names == ("left_turn",)
    with pytest.raises(DiagDynamicsError, match="Give side:=VALUE"):
        peer.start("simulator", robot_description=str(path))


# --- with a monitor


def test_monitor_accepts_the_robot_of_the_demo(peer):
    """By default the demo's launch file drives a UR5 along sine waves, of which the monitor rejects
    nothing.
    """
    parameters = {executable: node.parameters for executable, node in launched("demo").items()}
    rules = {name: PARAMETERS[name].default for name in BELIEVING}
    with (
        Simulator(peer, "/demo", UR5, rate=100.0, **parameters["simulator"]) as simulator,
        Monitor(peer, "/demo", **rules, **parameters["monitor"]) as monitor,
    ):
        peer.wait_until(lambda: len(simulator.states.messages) >= 300, "joint states")
        report = monitor.next_report()
    assert report.count("published") > 200
    assert [name for name in report.counts() if "rejected" in name] == []
    moved = np.ptp([message.position for message in simulator.states.messages], axis=0)
    assert (moved > 0.1).all()


def test_simulated_time(peer):
    """With use_sim_time the robot moves by /clock, and rests while that stands still."""
    clock = peer.publisher(Clock, "/clock")
    with Simulator(peer, "/clocked", UR5, waits=False, rate=100.0, use_sim_time=True) as simulator:
        now = 0

        def tick():
            nonlocal now
            now += 10 * MS
            message = Clock()
            message.clock.sec, message.clock.nanosec = divmod(now, S)
            clock.publish(message)
            return len(simulator.states.messages) >= 50

        peer.pass_time(1.0)
        assert simulator.call(Trigger, "reset").success
        peer.pass_time(1.0)
        assert not simulator.states.messages
        peer.wait_until(tick, "states in simulated time")
        stamps = simulator.states.stamps
        assert stamps[0] > 0 and stamps[-1] <= now and (np.diff(stamps) > 0).all()


# --- what it cannot start with


PANDA_PATH = robots.robot_path(PANDA)

WRONG = {
    "no robot": ({}, "parameter 'robot_description' is empty"),
    "no such file": ({"robot_description": f"{PANDA_PATH}.none"}, "panda.urdf.none"),
    "singular": (
        {"robot_description": robots.robot_path("romeo_description/urdf/romeo_laas_small.urdf")},
        "robot 'RomeoH37' has 2 joint\\(s\\) that move no inertia",
    ),
    "two components": ({"robot_description": PANDA_PATH, "gravity": [0.0, -9.81]}, "gravity"),
    "no such motion": ({"robot_description": PANDA_PATH, "motion": "dance"}, "motion"),
    "two types": ({"gravity": "[0, 0.0, -9.81]"}, "Sequence should be of same type"),  # so says rcl
    "rate of 0": ({"robot_description": PANDA_PATH, "rate": 0.0}, "rate"),
    "no such joint": (
        {"robot_description": PANDA_PATH, "command_joints": "[elbow]"},
        "parameter 'command_joints' names 'elbow'",
    ),
}


@pytest.mark.parametrize(("parameters", "said"), WRONG.values(), ids=WRONG)
def test_bad_parameters(peer, parameters, said):
    """The constructor raises what an executable prints in one line, and the message names the
    parameter.
    """
    with pytest.raises((DiagDynamicsError, ParameterException, RuntimeError), match=said):
        peer.start("simulator", **parameters)


def test_gravity_that_is_set_while_it_loads(peer):
    """It counts from the first state on."""
    simulator = Simulator(peer, "/early", UR5, waits=False)
    moon = (0.0, 0.0, -1.62)
    with simulator:
        assert simulator.process.node.set_parameters([Parameter("gravity", value=moon)])[
            0
        ].successful
        assert not simulator.truth.messages
        peer.wait_until(lambda: simulator.truth.messages, "a state")
        message = simulator.truth.messages[-1]
        dyn = DiagonalDynamics(simulator.model.with_gravity(moon))
        expected = dyn.evaluate(message.position, message.velocity).gravity
        np.testing.assert_allclose(message.gravity, expected, rtol=1e-9, atol=1e-9)
