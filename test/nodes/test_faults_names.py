# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names of joints, links and robots that would act on a terminal or forge lines of a log, in real nodes."""

import math
from types import SimpleNamespace

import pytest
from diag_dynamics.msg import DiagonalizedState
from diag_dynamics.srv import Diagonalize, SetPayload
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from diag_dynamics.nodes.support.diagnostics import LONG, Diagnostics, Status, shortened
from diag_dynamics.nodes.support.logger import PlainLogger
from nodes import LATCHED, MANY, START, description, joint_state

pytestmark = [pytest.mark.full, pytest.mark.live]

FIRE = "\n[FATAL] [0.0] [safety_controller]: fire"
ELBOW, WRIST = f"elbow{FIRE}", "wrist\x9b31m\u202e"
ESCAPE = "\x1b]0;owned\x07\x1b[31m"  # XML has no such character, ROS messages have
URDF = """<robot name="arm&#10;[FATAL] [0.0] [safety_controller]: robot&#x9b;2J">
  <link name="base"/>
  <joint name="elbow&#10;[FATAL] [0.0] [safety_controller]: fire" type="revolute">
    <parent link="base"/><child link="upper&#x9b;2J"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/>
  </joint>
  <link name="upper&#x9b;2J"><inertial><origin xyz="0 0 0.1"/><mass value="1"/>
    <inertia ixx="0.05" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <joint name="wrist&#x9b;31m&#x202e;" type="continuous">
    <parent link="upper&#x9b;2J"/><child link="hand"/><origin xyz="0 0 0.2"/><axis xyz="1 0 0"/>
  </joint>
  <link name="hand"><inertial><origin xyz="0 0 0.1"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
</robot>"""
"""The inertia of the upper link is that of no body, which each node warns of by name."""


class Told:
    """All that nodes say to others: on /diagnostics and on /rosout."""

    def __init__(self, peer):
        """Listen."""
        self._diagnostics, self._log = peer.topic(DiagnosticArray, "/diagnostics"), peer.topic(Log, "/rosout")

    def texts(self):
        """Return every text that has come."""
        for array in self._diagnostics.messages:
            for status in array.status:
                yield from (status.name, status.message, status.hardware_id)
                for pair in status.values:
                    yield from (pair.key, pair.value)
        for line in self._log.messages:
            yield line.msg

    def hears(self, *texts):
        """Whether each of these has been part of something."""
        return all(any(text in told for told in self.texts()) for text in texts)


def check_output(process):
    """A log has lines of the logger only, of which nothing acts; and it names what was wrong."""
    assert r"[FATAL] [0.0] [safety_controller]: robot\x9b2J" in process.output
    for line in process.output.split("\n"):
        assert line.isprintable(), repr(line)
        assert not line.startswith("[FATAL]"), line


def test_names_that_would_act(peer):
    """A monitor takes such a robot, and publishes its names as they are; what is said of them is plain, wherever that is."""
    told = Told(peer)
    peer.publisher(String, "/hostile/robot_description", LATCHED).publish(description(URDF))
    feeder = peer.publisher(JointState, "/hostile/joint_states")
    states = peer.topic(DiagonalizedState, "/hostile/diag_dynamics/state")
    at = "/hostile/diag_dynamics"

    def sent(*messages):
        for message in messages:
            feeder.publish(message)

    wrong = (
        joint_state([ELBOW, WRIST, ELBOW], [0.1] * 3, [0.0] * 3),  # twice
        joint_state([WRIST], [math.nan], [0.0]),
        joint_state([ELBOW, ESCAPE], [0.1], [0.0]),  # lengths, of which the first name is told
    )
    with peer.start("monitor", "-r", "__ns:=/hostile") as process:
        peer.wait_until(feeder.get_subscription_count, "the monitor", START)
        good = joint_state([ELBOW, WRIST, ESCAPE], [0.1, 0.2, 0.3], [0.0] * 3)
        peer.wait_until(lambda: sent(good) or states.messages, "a state", START)
        assert list(states.messages[-1].dof_names) == [ELBOW, WRIST]  # names are data
        for message, name in zip(wrong, (ELBOW, WRIST, ESCAPE), strict=True):
            reason = f"'{shortened(name)}'"
            peer.wait_until(lambda message=message, reason=reason: sent(message) or told.hears(reason), reason)
        answers = [
            peer.call(Diagonalize, f"{at}/diagonalize", Diagonalize.Request(state=joint_state([ESCAPE], [0.0], [0.0]))),
            peer.call(SetPayload, f"{at}/set_payload", SetPayload.Request(link=f"{ESCAPE}{FIRE}")),
        ]
        for answer in answers:
            assert not answer.success
            assert r"\x1b]0;owned\x07\x1b[31m" in answer.message and answer.message.isprintable()
        refused = peer.set_parameter(at, "payloads", [f"{ESCAPE}=heavy"])
        assert not refused.successful and r"\x1b[31m=heavy" in refused.reason and refused.reason.isprintable()
        peer.publisher(String, "/hostile/robot_description", LATCHED).publish(
            description(URDF.replace('"1"', '"-1"', 1).replace('value="1"', 'value="-1"'))
        )
        peer.wait_until(lambda: told.hears(r"refused", r"upper\x9b2J"), "a refusal", START)
        told_of = list(told.texts())
        process.wait_for_text("robot_description refused")
    assert all(text.isprintable() for text in told_of)
    check_output(process)


def test_names_in_control(peer, tmp_path):
    """So with a simulator and a controller: what they refuse is named in one line of their log."""
    path = tmp_path / "hostile.urdf"
    path.write_text(URDF, encoding="utf-8")
    told = Told(peer)
    trajectory = peer.publisher(JointTrajectory, "/held/trajectory", MANY)
    command = peer.publisher(Float64MultiArray, "/held/effort_controller/commands", MANY)
    point = JointTrajectoryPoint(positions=[0.1])
    parameters = {"robot_description": path, "autostart": True}
    settings = parameters | {"robot_compensates_gravity": False, "check_time": 0.0}
    arguments = ("-r", "__ns:=/held")
    with (
        peer.start("simulator", *arguments, **parameters) as simulator,
        peer.start("controller", *arguments, **settings) as controller,
    ):

        def refuses():
            trajectory.publish(JointTrajectory(joint_names=[f"{ESCAPE}{FIRE}"], points=[point]))
            command.publish(Float64MultiArray(data=[math.nan, 0.0]))
            return told.hears(r"\x1b[31m\x0a[FATAL]", r"'elbow\x0a[FATAL]")

        peer.wait_until(refuses, "refusals", START)
        told_of = list(told.texts())
        simulator.wait_for_text(r"'elbow\x0a[FATAL]")
    assert all(text.isprintable() for text in told_of)
    check_output(simulator)
    check_output(controller)


def test_started_with_such_a_robot(peer, tmp_path):
    """A node that a robot's description ends says so in one line."""
    path = tmp_path / "hostile.urdf"
    path.write_text(URDF.replace('value="1"', 'value="-1"'), encoding="utf-8")
    process = peer.start("monitor", "-r", "__ns:=/ended", robot_description=path)
    assert process.wait(START) == 1
    assert r"link 'upper\x9b2J': mass -1 kg is negative." in process.output
    assert all(line.isprintable() for line in process.output.split("\n"))


def test_what_is_said_is_short_and_plain(peer):
    """A text is cut before it is escaped; entries are plain from their names to their values."""
    assert shortened("\x1b" * 1_000_000) == r"\x1b" * LONG + "… (1000000 characters)"
    told = Told(peer)
    node = peer.extra_node("teller", "/told")
    said = Diagnostics(node, list, lambda: SimpleNamespace(name=f"e{FIRE}"))
    entry = Status(f"a{FIRE}", b"\x00", f"b{FIRE}", {f"c{FIRE}": f"d{FIRE}"})
    shown = [rf"{letter}\x0a[FATAL] [0.0] [safety_controller]: fire" for letter in "abcde"]
    peer.wait_until(lambda: said.publish([entry]) or told.hears(*shown), "the entry")
    peer.drop_node(node)


def test_the_logger_is_rclpys(peer, capfd):
    """A line bears the place that logs it, and what is throttled is so by that place."""
    node = peer.extra_node("logging", "/logged")
    log, logger = peer.topic(Log, "/rosout"), PlainLogger(node.get_logger().name)
    capfd.readouterr()
    for k in range(3):  # two places, each of which is heard once
        logger.warning(f"first {k}{FIRE}", throttle_duration_sec=1e6)
        logger.warning(f"second {k}", throttle_duration_sec=1e6)
    said = capfd.readouterr().err.splitlines()
    assert [line.partition("]: ")[2] for line in said] == [rf"first 0{shortened(FIRE)}", "second 0"]

    def heard():
        logger.info("third")
        return [line for line in log.messages if line.name == logger.name]

    assert peer.wait_until(heard, "a line")[0].file == __file__
    peer.drop_node(node)
