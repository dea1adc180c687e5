# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the console says of joints that are misnamed, missing or dead: one line within two
seconds.
"""

from types import SimpleNamespace

import pytest
from sensor_msgs.msg import JointState

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.monitor.joint_coverage import joint_coverage
from diag_dynamics.nodes.monitor.monitored_robot import joint_names_of
from nodes import PANDA, Monitor, joint_state, robot

ARM = robot(PANDA)
FINGER = "panda_finger_joint1"
ALL = f"joints without data: {', '.join(ARM.names)}"
ODD = {
    "misnamed": (
        [name.replace(FINGER, f"{FINGER}_x") for name in ARM.names],
        f"joints without data: {FINGER}; unknown names arrive: {FINGER}_x",
    ),
    "prefix": (
        [f"UR2024_{name}" for name in ARM.names],
        f"{ALL}; unknown names arrive: UR2024_panda_joint1, ",
    ),
    "missing": ([name for name in ARM.names if name != FINGER], f"joints without data: {FINGER}"),
    "empty": ([], f"{ALL}; all joint states are empty"),
}


def send(monitor, names, seconds):
    """Publish joint states of these names at 10 Hz."""
    for _ in range(round(10 * seconds)):
        q, qd, tau, _ = ARM.samples[0]
        count = len(names)
        values = (q[:count], 0.0 * qd[:count], tau[:count])
        monitor.publish(joint_state(names, *values, monitor.tick()))
        monitor.peer.pass_time(0.1)


def lines(monitor, status):
    """Return the lines of warnings about a status."""
    start = f"[WARN] [diag_dynamics]: {status}: "
    result = [line for line in monitor.process.output.splitlines() if line.startswith(start)]
    return [line.removeprefix(start) for line in result]


@pytest.mark.parametrize("fault", ODD)
def test_joints_without_data(peer, fault):
    """One warning names them, what arrives instead, and the parameter that maps it."""
    names, text = ODD[fault]
    with Monitor(peer, f"/{fault}", outputs=[], robot_description=ARM.path) as monitor:
        send(monitor, names, 2.0)
        assert len(lines(monitor, "joints")) == 1 and lines(monitor, "joints")[0].startswith(text)
        send(monitor, names, 30.0)
        assert len(lines(monitor, "joints")) == 1
        report = monitor.next_report()
        assert report.entries["joints"].message == lines(monitor, "joints")[0]
        assert report.count("empty") == (320 if fault == "empty" else 0)
        if fault == "prefix":
            assert lines(monitor, "joints")[0].endswith(". Set joint_names to ['UR2024_*=*']")


@pytest.mark.parametrize(
    ("unknown", "is_empty", "entries", "text"),
    [
        (["b2"], False, [("b1", "a1")], ". Set joint_names to ['b1=a1', 'b2=a2']"),
        (["b2"], False, [("c2", "a2")], ". Set joint_names to ['b2=a2']"),
        ([], True, [], "; all joint states are empty"),
        ([], False, [], ""),  # as of messages of locked joints
    ],
)
def test_advice(unknown, is_empty, entries, text):
    """It keeps entries of joints that arrive, and gives no joint a second name."""
    assembler = SimpleNamespace(
        joint_names=("a1", "a2"), missing=["a2"], unknown_names=lambda _: unknown
    )
    statistics = SimpleNamespace(is_foreign=False, is_empty=is_empty)
    status = joint_coverage(assembler, (), entries, 9.0, statistics)
    start = "joints without data: a2" + f"; unknown names arrive: {', '.join(unknown)}" * bool(
        unknown
    )
    assert status.message == start + text


@pytest.mark.parametrize("entries", [["elbow"], ["=1"], ["a=1", "b=1"], ["a*=1"]])
def test_wrong_names(entries):
    with pytest.raises(InputError, match=r"joint_names.* expected"):
        joint_names_of({"joint_names": entries})


def test_names_are_mapped(peer):
    """With the parameter that the line proposes, states are published."""
    entries = {"joint_names": '["UR2024_*=*"]', "robot_description": ARM.path}
    with Monitor(peer, "/mapped", outputs=["state"], **entries) as monitor:
        send(monitor, ODD["prefix"][0], 2.0)
        assert len(monitor.topics["state"].messages) == 20
        assert monitor.topics["state"].messages[0].dof_names == list(ARM.names)
        assert lines(monitor, "joints") == []


def test_publisher_that_leaves(peer):
    """A line names the topic, and others that have joint states; the end has one, too."""
    with Monitor(peer, "/arm", outputs=[], robot_description=ARM.path) as monitor:
        send(monitor, ARM.names, 15.0)
        peer.node.destroy_publisher(monitor.feeder)
        other = peer.publisher(JointState, "/left/joint_states")
        peer.pass_time(2.0)
        (line,) = lines(monitor, "joint states")
        assert line.startswith("/arm/joint_states has no publisher; joint states are on ")
        assert "/left/joint_states" in line and line.endswith(". Remap joint_states")
        peer.node.destroy_publisher(other)
        monitor.feeder = peer.publisher(JointState, "/arm/joint_states")
        send(monitor, ARM.names, 15.0)
        assert "[INFO] [diag_dynamics]: joint states: publishing (after " in monitor.process.output


def test_description_of_another_type(peer):
    """Without a robot a line names the publisher of robot_description that cannot be used."""
    with Monitor(peer, "/wrong", outputs=[]) as monitor:
        node = peer.extra_node("describer", "/", apart=True)
        node.create_publisher(JointState, "/wrong/robot_description", 1)
        peer.pass_time(12.0)
        (line,) = lines(monitor, "joint states")
        assert line.startswith("/describer publishes sensor_msgs/msg/JointState on /wrong/")
        peer.drop_node(node)
        assert monitor.next_report().entries["joint states"].message == "no robot yet"


def test_start_before_the_driver(peer):
    """A driver that starts within two seconds leaves no line; without one there is one line."""
    with Monitor(peer, "/early", outputs=[], robot_description=ARM.path) as monitor:
        peer.pass_time(1.5)
        send(monitor, ARM.names, 12.0)
        assert "WARN" not in monitor.process.output
    with Monitor(peer, "/alone", outputs=[], robot_description=ARM.path) as monitor:
        peer.node.destroy_publisher(monitor.feeder)
        peer.pass_time(12.0)
        (line,) = lines(monitor, "joint states")
        assert line.startswith("/alone/joint_states has no publisher; joint states are on /")
