# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recording fed to a monitor and the same recording read: the same states, counters, external
torque and collisions.
"""

import json
from array import array

import numpy as np
import pinocchio as pin
import pytest
import yaml
from diag_dynamics.msg import DiagonalizedState, ExternalTorque
from mcap.reader import make_reader
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from bags import Message, serialized, write_mcap
from diag_dynamics.cli.main import main
from diag_dynamics.nodes.monitor.outputs import TYPES
from diag_dynamics.parameters.monitor import PARAMETERS
from diag_dynamics.recordings.outputs import mcap
from hostile import MS, START
from nodes import Reports, nanoseconds

OF_THE_MOMENT = {
    "missing joints",
    "stale joints",
    "joints without effort",
    "joints with estimated velocity",
    "effort undeclared (assumed: N m, with gravity)",
}
"""Whole numbers in the monitor's status that count joints as they are now."""


class Live:
    """A monitor whose clock is the time of reception of each message."""

    def __init__(self, peer, namespace, urdf, parameters):
        self.peer = peer
        self.name = f"{namespace}/diag_dynamics"
        self.inputs = {
            "/joint_states": peer.publisher(JointState, f"{namespace}/joint_states"),
            "/odom": peer.publisher(Odometry, f"{namespace}/odom"),
        }
        self.states = peer.topic(DiagonalizedState, f"{self.name}/state")
        self.torque = peer.topic(ExternalTorque, f"{self.name}/external_torque")
        self.reports = Reports(peer.node, peer.wait_until, self.name)
        parameters = {"robot_description": urdf} | parameters
        self.process = peer.start("monitor", "-r", f"__ns:={namespace}", **parameters)

    def feed(self, messages):
        """Have each message be received at its log time."""
        for topic, log_time, raw, _ in messages:
            self.peer.graph.system = log_time
            self.inputs[topic].publish(raw)
            self.peer.graph.spin()

    def counts(self):
        """Return all that it has counted."""
        report = self.reports.next()
        values = {pair.key: pair.value for pair in report.entries["joint states"].values}
        counts = {
            key: int(value) for key, value in values.items() if value.isdecimal() and "[" not in key
        }  # no unit
        return {key: n for key, n in counts.items() if n and key not in OF_THE_MOMENT}


# --- external torque and collisions, for each parameter

ARM = """<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0 0 0.2"/><mass value="2"/>
<inertia ixx="0.03" iyy="0.03" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="lower"><inertial><origin xyz="0.02 0 0.15"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="lift" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" velocity="4" effort="90"/><dynamics damping="0.8" friction="1.5"/>
</joint>
<joint name="turn" type="revolute"><parent link="upper"/><child link="lower"/>
<origin xyz="0 0 0.4"/><axis xyz="0 1 0.5"/>
<limit lower="-0.45" upper="3" velocity="4" effort="90"/><dynamics damping="0.3" friction="0.6"/>
</joint></robot>"""
JOINTS = "lift", "turn"
PUSHED = {"external_torque.gain": 30.0, "collision.threshold": ["norm=6"], "max_age": 0.0}
ALARMS = {
    "external_torque.gain": 30.0,
    "max_age": 0.0,
    "collision.threshold": ["lift=2.5", "turn=1"],
    "collision.release": 0.5,
}

IDENTIFIED = """{joints: {lift: {friction: 4.0, damping: 0.1}, turn: {effort_offset: 0.5}}}"""

FLEXIBLE = """{flexible_joints: {
  lift: {stiffness: 900, damping: 2, rotor_inertia: 2.0e-5, gear: 80, effort: spring},
turn: {stiffness: 300, rotor_inertia: 1.0e-5, gear: 50}}}"""

OBSERVED = {
    # by parameter: the value that differs from the one in force
    "external_torque.gain": (PUSHED, 60.0),
    "external_torque.friction": (PUSHED, False),
    "collision.threshold": (ALARMS, ["*=1.5", "total=1.5", "norm=3"]),
    "collision.release": (ALARMS, 0.9),
    "collision.hold_off": (ALARMS, 0.05),
    "collision.standing": (ALARMS, 0.3),
    "collision.stiction": (ALARMS, 3.0),
    "payloads": (PUSHED, ["lower=0.8 0 0 0.3"]),
    "gravity": (PUSHED, [0.0, 3.0, -9.0]),
    "locked_joints": (PUSHED, ["turn=0.1"]),
    "armature": (PUSHED, ["lift=0.2"]),
    "parameters_file": (PUSHED, IDENTIFIED),
    "effort_available": (PUSHED, ["turn=false"]),
    "effort_scale": (PUSHED, ["turn=0.8"]),
    "effort_includes_gravity": (PUSHED, ["lift=false"]),
    "missing_velocity": (PUSHED, "estimate"),
    "velocity_filter_time": (PUSHED | {"missing_velocity": "estimate"}, 0.05),
    "plausibility.beyond_velocity": (PUSHED, 0.3),
    "plausibility.beyond_limits": (PUSHED, 1e-3),
    "plausibility.jump": (PUSHED, 0.0),
    "joint_timeout": (PUSHED, ["*=0.02"]),
}
"""Parameters on which external torque or collisions depend."""

OTHERS = (
    "contact.",
    "contact_limits.",
    "external_torque.covariance",
    "external_wrench.",
    "gravity_",
    "load.",
)
OTHERS += "max_rate", "reaction."
"""Prefixes of parameters of other fields, topics and services, and of what a recording lacks."""

NOT_OBSERVED = {
    "robot_description",
    "loops_file",
    "floating_base",
    "mimic",
    "massless",
    "joint_names",
    "odom_twist_frame",
    "max_age",
    "mimic_tolerance",
    "stuck_timeout",
    "publish_inverse_factor",
    "energy.warn",
    "energy.error",
    "publish_friction",
}
"""Parameters that choose the robot, clocks or outputs: other tests compare these."""


def pushed_messages():
    """Return messages of an arm that is pushed in motion and at rest, with a gap, a jump, and
    missing or held values.
    """
    model = pin.buildModelFromXML(ARM)
    rng = np.random.default_rng(3)
    data = model.createData()
    messages = []
    damping = np.array([0.8, 0.3])
    friction = np.array([1.5, 0.6])
    for k in range(900):
        t = 0.01 * k
        phase = np.array([0.0, 1.0])
        w = np.array([2.0, 3.1])
        a = np.array([0.7, 0.5])
        q = a * np.sin(w * t + phase)
        qd = a * w * np.cos(w * t + phase)
        qdd = -a * w * w * np.sin(w * t + phase)
        tau = pin.rnea(model, data, q, qd, qdd) + damping * qd + friction * np.tanh(qd / 5e-3)
        if k >= 600:  # at rest, under stiction, with messages of unequal age
            q = np.array([0.3, 0.3]) + 1e-6 * k
            qd = np.array([0.02, 0.004])
            stiction = np.array([0.8, -0.4])
            tau = (
                pin.computeGeneralizedGravity(model, data, q)
                + stiction
                - np.array([0.0, 1.0]) * (700 <= k < 740)
            )
        tau -= np.array([4.0, 1.5]) * (
            150 <= k < 210 or 218 <= k < 230 or 400 <= k < 520
        ) + 0.02 * rng.normal(size=2)
        if 300 <= k < 320:
            continue
        qd = [] if 330 <= k < 340 else qd
        q = q + 0.9 if k == 100 else np.array([0.3, 0.3]) if k >= 540 else q
        names = JOINTS[:1] if k % 50 in (20, 21, 22, 23) else JOINTS
        count = len(names)
        stamp = START + 10 * MS * (k + 1) + (k >= 600) * int(rng.integers(9)) * MS
        raw = serialized(stamp, names, q[:count], qd[:count], tau[:count])
        messages.append(Message("/joint_states", stamp, raw))
    return messages


def external_torque(messages):
    """Return stamps, torques, norms and flags of messages of external_torque."""
    return [
        (
            nanoseconds(message.header.stamp),
            list(message.external_torque),
            message.norm,
            message.valid,
            message.collision,
            list(message.joint_collision),
            list(message.collision_threshold),
        )
        for message in messages
    ]


def analysed(folder, parameters, topics=("external_torque",)):
    """Return messages by topic that `analyse` writes, and its number of collisions."""
    (folder / "monitor.yaml").write_text(
        yaml.safe_dump({"/**": {"ros__parameters": parameters}}), encoding="utf-8"
    )
    arguments = ["--urdf", str(folder / "arm.urdf"), "--parameters", str(folder / "monitor.yaml")]
    out = folder / "out.mcap"
    summary = folder / "summary.json"
    outputs = ["--json", str(summary), "--mcap", str(out), "--topics", ",".join(topics), "--quiet"]
    assert main(["analyse", str(folder / "in.mcap"), *arguments, *outputs]) < 2
    with out.open("rb") as stream:
        sent = {topic: [] for topic in topics}
        for _, channel, message in make_reader(stream).iter_messages():
            topic = channel.topic.rpartition("/")[2]
            sent[topic].append(deserialize_message(message.data, TYPES[topic]))
    count = len(json.loads(summary.read_text(encoding="utf-8"))["collisions"])
    out.unlink()
    summary.unlink()
    return sent, count


NOISE = {"external_torque.covariance_joints": [*JOINTS]}
NOISE["external_torque.covariance"] = [0.04, 0.0, 0.0, 0.02]
CONTACTS = NOISE | {"contact.threshold": ["*=0.5"]}
TOPICS = {topic: TYPES[topic] for topic in mcap.TOPICS}


@pytest.mark.parametrize("flag", [False, True])
def test_every_field_of_a_recording_is_that_of_the_monitor(peer, tmp_path, flag):
    """All topics, with and without friction, the inverse factor, efforts and results."""
    flags = {"publish_friction": flag, "publish_inverse_factor": flag}
    parameters = ALARMS | CONTACTS | flags | {"max_rate": ["*=0"]}
    (tmp_path / "arm.urdf").write_text(ARM, encoding="utf-8")
    messages = pushed_messages()[140:360]
    for k in range(20):
        stamp = messages[-1].log_time + 10 * MS
        raw = serialized(stamp, JOINTS, [0.3 + 1e-4 * k, 0.3], [0.01, 0.0], [])
        messages.append(Message("/joint_states", stamp, raw))
    write_mcap(tmp_path / "in.mcap", messages)
    offline = analysed(tmp_path, parameters, TOPICS)[0]
    live = Live(peer, f"/all{flag}", tmp_path / "arm.urdf", parameters)
    published = {name: peer.topic(kind, f"{live.name}/{name}") for name, kind in TOPICS.items()}
    with live.process:
        live.feed(messages)
    for name, topic in published.items():
        assert len(topic.messages) == len(offline[name]) > 50
        for message, other in zip(topic.messages, offline[name], strict=True):
            for field in message.get_fields_and_field_types():
                values = getattr(message, field), getattr(other, field)
                if hasattr(values[0], "__float__") or isinstance(values[0], array):
                    np.testing.assert_allclose(*values, rtol=1e-6, atol=1e-6, err_msg=field)
                else:
                    assert values[0] == values[1], field
    torque = offline["external_torque"]
    assert {tuple(message.touched_links) for message in torque} == {(), ("upper", "lower")}
    assert (
        {message.contact for message in torque}
        == {message.valid for message in torque}
        == {False, True}
    )
    assert {message.effort_valid for message in offline["state"]} == {False, True}


def test_every_parameter_is_compared():
    """A new parameter needs a row in OBSERVED, or a reason why external torque does not depend on
    it.
    """
    others = {name for name in PARAMETERS if name.startswith(OTHERS)}
    assert OBSERVED.keys() | NOT_OBSERVED | others == PARAMETERS.keys()


@pytest.mark.parametrize("name", [*OBSERVED, "flexible joints"])
def test_live_and_offline_agree(peer, tmp_path, name):
    """The monitor and `analyse` have the same external torque and collisions, and the parameter
    changes these.
    """
    place = list(OBSERVED).index(name) if name in OBSERVED else len(OBSERVED)
    common, value = OBSERVED.get(name, (PUSHED, FLEXIBLE))
    name = name if name in OBSERVED else "parameters_file"
    if name == "parameters_file":
        (tmp_path / "arm.yaml").write_text(value, encoding="utf-8")
        value = str(tmp_path / "arm.yaml")
    (tmp_path / "arm.urdf").write_text(ARM, encoding="utf-8")
    messages = pushed_messages()
    write_mcap(tmp_path / "in.mcap", messages)
    parameters = common | {name: value}
    (sent, count), (others, other_count) = (
        analysed(tmp_path, chosen) for chosen in (parameters, common)
    )
    offline, others = (external_torque(message["external_torque"]) for message in (sent, others))
    live = Live(peer, f"/pushed{place}", tmp_path / "arm.urdf", parameters)
    with live.process:
        live.feed(messages)
        published = external_torque(live.torque.messages)
        values = {
            pair.key: pair.value for pair in live.reports.next().entries["external torque"].values
        }
    assert int(values["collisions"]) == count
    assert len(published) == len(offline) > 50
    for message, other in zip(published, offline, strict=True):
        assert message[0] == other[0] and message[3:] == other[3:]
        np.testing.assert_allclose(message[1], other[1], rtol=1e-6, atol=1e-6)
        assert message[2] == pytest.approx(other[2], rel=1e-6, abs=1e-6, nan_ok=True)
    assert any(message[3] for message in published) or name == "effort_available"
    assert repr((offline, count)) != repr((others, other_count))
