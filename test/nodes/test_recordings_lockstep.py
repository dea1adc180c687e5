# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recording fed to the running monitor in lockstep, and the same one processed: the same states, the same counters.

Lockstep: the time of a message is on /clock and taken before the message is sent, and the message is served before the time
of the next one is. Whether a message makes a state is known beforehand, by what processes the recording: if so, its state is
waited for. What makes none leaves no trace but a count, and there a service call tells that it has been served, as it does
of the time on /clock: all that one process sends another comes through one queue, and the node serves it in the order in
which it comes. If that did not hold, the counts at the end would not be those of as many messages, or differ.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pytest
from diag_dynamics.msg import DiagonalizedState
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import GetParameterTypes
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from coupling import NAMED
from diag_dynamics.assembly.assembler import joints_of
from diag_dynamics.bags.messages import Messages
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from diag_dynamics.parameters.robots import model_of
from diag_dynamics.recordings.intake import JOINT_STATE, ODOMETRY, Intake
from hostile import MS, Driver, S, hostile, messages_of
from hostile import START as BEGIN
from nodes import PANDA, START, Reports, nanoseconds
from robots import robot_path

pytestmark = [pytest.mark.full, pytest.mark.live]

SOLO = "solo_description/robots/solo12.urdf"
DEFAULTS = {name: spec.default for name, spec in PARAMETERS.items()}
KINDS = {JOINT_STATE: JointState, ODOMETRY: Odometry}


class Sent(NamedTuple):
    """One message of a recording."""

    kind: str
    raw: bytes
    now: int


# --- recordings


def joint_states(model, seed, count, **options):
    return [Sent(JOINT_STATE, raw, now) for raw, now in hostile(model, seed, count, **options)]


class Base:
    """Sends odometry of a base in slow motion, with whatever goes wrong with it."""

    def __init__(self, link, seed):
        self.link, self.rng = link, np.random.default_rng(seed)

    def message(self, stamp):
        """Odometry about which nothing is wrong."""
        t = (stamp - BEGIN) / S
        message = Odometry(child_frame_id=self.link)
        message.header.frame_id = "odom"
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, S)
        pose, twist = message.pose.pose, message.twist.twist
        turn = np.array([0.1 * np.sin(t), 0.2 * np.cos(t), 0.3, 1.0])
        o = pose.orientation
        o.x, o.y, o.z, o.w = (turn / np.linalg.norm(turn)).tolist()
        p, v, w = pose.position, twist.linear, twist.angular
        p.x, p.y, p.z = np.sin([t, 2 * t, 3 * t]).tolist()
        v.x, v.y, v.z = (0.1 * np.cos([t, 2 * t, 3 * t])).tolist()
        w.x, w.y, w.z = (0.1 * np.sin([3 * t, 2 * t, t])).tolist()
        return message

    def good(self, stamp):
        return serialize_message(self.message(stamp))

    def bad(self, stamp):
        """One that is odd in one of many ways."""
        kind, message = self.rng.integers(12), self.message(stamp)
        pose, twist = message.pose.pose, message.twist.twist
        if kind == 0:
            return serialize_message(message)[: self.rng.integers(1, 700)]
        if kind == 1:
            raw = bytearray(serialize_message(message))
            raw[self.rng.integers(len(raw))] ^= 1 << self.rng.integers(8)
            return bytes(raw)
        if kind == 2:
            message.child_frame_id = str(self.rng.choice(["", "nowhere", "/" + self.link, "FL_FOOT"]))
        elif kind == 3:
            pose.position.y = float(self.rng.choice([np.nan, np.inf, 1e9, -1e200]))
        elif kind == 4:
            twist.angular.z = float(self.rng.choice([np.nan, -np.inf, 1e5, 1e300]))
        elif kind == 5:
            pose.orientation.w = float(self.rng.choice([np.nan, 0.0, -1.0, 17.0]))
        elif kind == 6:
            o = pose.orientation
            o.x = o.y = o.z = o.w = 0.0
        elif kind in (7, 8):
            apart = int(self.rng.choice([1, 40, 900, 3000, 40_000])) * MS
            return self.good(stamp + (apart if kind == 7 else -apart))
        elif kind == 9:
            message.header.stamp.sec = message.header.stamp.nanosec = 0
        elif kind == 10:
            message.header.stamp.nanosec = 2_000_000_000
        else:
            return serialize_message(JointState(name=["odom"]))
        return serialize_message(message)


def with_odometry(model, seed, count):
    """Joint states, and odometry that begins later, pauses for a second, and comes between them."""
    rng, base = np.random.default_rng(seed), Base(model.root_link, seed)
    sent = joint_states(model, seed, count)
    for number, (_, _, now) in enumerate(sent[:]):
        if number < 5 or count // 2 < number < count // 2 + 40 or rng.random() < 0.3:
            continue
        at = now + MS
        sent.append(Sent(ODOMETRY, base.bad(at - 1000) if rng.random() < 0.15 else base.good(at - 1000), at))
    return sorted(sent, key=lambda one: one.now)


def with_followers(model, seed, count):
    """Joint states that list what follows, too, at places and with efforts of its own."""
    joints = joints_of(model)
    return joint_states(model, seed, count, drivers=[Driver(model, seed, [*joints.names, *joints.mimics])])


class Case(NamedTuple):
    """A robot, how its recording is made, and parameters."""

    robot: str
    make: object
    seed: int
    parameters: Mapping = MappingProxyType({})
    count: int = 600


CASES = {
    "panda": Case(PANDA, joint_states, 1),
    "panda without effort": Case(PANDA, joint_states, 3),
    "frozen values refused": Case(PANDA, joint_states, 7, {"frozen_values": "refuse", "frozen_timeout": 0.05}),
    "two drivers": Case(PANDA, joint_states, 4),
    "velocities estimated": Case(PANDA, joint_states, 2, {"missing_velocity": "estimate"}),
    "motor currents": Case(PANDA, joint_states, 5, {"effort_scale": ["*=0.5"], "effort_includes_gravity": ["*=false"]}),
    "floating base": Case(SOLO, with_odometry, 0, {"floating_base": True}),
    "gripper": Case("parallel gripper", with_followers, 3),
}


# --- both ways


def processed(model, settings, sent):
    """States and counts of a recording, by Intake; in pieces, as a reader of a bag would hand them out."""
    kinds = np.array(list(KINDS))
    intake, states = Intake(model, settings), []
    for first in range(0, len(sent), 150):
        part = sent[first : first + 150]
        messages = messages_of([(one.raw, one.now) for one in part])
        connection = np.array([list(KINDS).index(one.kind) for one in part])
        states.append(intake.take(Messages(messages.data, connection, *messages[2:]), kinds))
    return states[0].together(states), intake


class Live:
    """A running monitor under simulated time."""

    def __init__(self, peer, namespace, model, parameters):
        self.peer, self.name, self._model = peer, f"{namespace}/diag_dynamics", model
        self.clock = peer.publisher(Clock, f"{namespace}/clock")
        self.inputs = {JOINT_STATE: peer.publisher(JointState, f"{namespace}/joint_states")}
        if model.floating_base:
            self.inputs[ODOMETRY] = peer.publisher(Odometry, f"{namespace}/odom")
        self.states = peer.topic(DiagonalizedState, f"{self.name}/state")
        self.reports = Reports(peer.node, peer.wait_until, self.name)
        names = ["-r", f"__ns:={namespace}", "-r", f"/clock:={namespace}/clock"]
        parameters = {"use_sim_time": True, "serialization": "template"} | parameters  # as recordings are read: bytes
        self.process = peer.start("monitor", *names, **parameters)

    def connect(self):
        """Wait until both sides know all topics of the other.

        What was made here before the client of a service is known to the node when that is answered: see Peer.become_known.
        """
        inputs = (self.clock, *self.inputs.values())
        self.peer.wait_until(
            lambda: all(one.get_subscription_count() for one in inputs), f"{self.name} to listen", START
        )
        self.peer.wait_until(self.states.subscription.get_publisher_count, "its states", START)
        self.served()

    def served(self):
        """Return once the node has served all that has been sent until now."""
        name = f"{self.name}/get_parameter_types"
        self.peer.call(GetParameterTypes, name, GetParameterTypes.Request())

    def set_time(self, now):
        """Have it be this time for the node."""
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(now, S)
        self.clock.publish(message)
        self.served()

    def feed(self, sent, with_state):
        """Send a recording in lockstep; `with_state` are the times of those that make a state."""
        for kind, raw, now in sent:
            self.set_time(now)
            self.inputs[kind].publish(raw)
            if now in with_state:
                expected = len(self.states.messages) + 1
                self.peer.wait_until(lambda expected=expected: len(self.states.messages) >= expected, f"state at {now}")
            else:
                self.served()

    def counts(self):
        """All that it has counted of what it was sent until now."""
        begin = len(self.reports)
        self.peer.wait_until(lambda: len(self.reports) > begin + 1, "diagnostics")  # the next may have been on its way
        values = {pair.key: pair.value for pair in self.reports[-1].entries["joint states"].values}
        counts = {key: int(value) for key, value in values.items() if value.isdecimal() and "[" not in key}  # no unit
        return {key: count for key, count in counts.items() if count and key not in OF_THE_MOMENT}


OF_THE_MOMENT = {
    "missing joints",
    "stale joints",
    "joints without effort",
    "joints with estimated velocity",
    "effort undeclared (taken as N m, with gravity)",
}
"""Whole numbers in the monitor's status that count joints as they are now, where there are more than a few."""

BY_TEMPLATE = "joint states read by template"
"""How many messages were taken in without deserialization."""


@pytest.mark.parametrize("name", CASES)
def test_the_same_live(peer, tmp_path, name):
    case = CASES[name]
    if case.robot in NAMED:
        path = tmp_path / "robot.urdf"
        path.write_text(NAMED[case.robot].urdf)
    else:
        path = robot_path(case.robot)
    settings = Settings.of(DEFAULTS | case.parameters)
    model = model_of(str(path), settings.values)
    sent = case.make(model, case.seed, case.count)
    assert len({one.now for one in sent}) == len(sent)
    states, intake = processed(model, settings, sent)
    makes = set(states.log_time.tolist())

    live = Live(peer, f"/lockstep{list(CASES).index(name)}", model, {"robot_description": path} | case.parameters)
    with live.process:
        live.connect()
        live.feed(sent, makes)
        live.served()
        counts = live.counts()

    assert counts.pop(BY_TEMPLATE, 0) == intake._joint_states.at_once
    assert counts == {key: count for key, count in intake.counts.items() if count}
    hostile_enough(name, counts, states)
    same_states(live.states.messages, states)
    same_dynamics(live.states.messages, model, states)


def hostile_enough(name, counts, states):
    """That both agree would say little of a recording that is all good, or all bad."""
    assert states.number > 100
    assert states.received.any()
    assert counts["rejected: malformed"] and counts["rejected: absurd value"]
    if name == "frozen values refused":
        assert counts["rejected: frozen"] > 10
    elif name == "two drivers":
        assert (states.oldest < states.newest).mean() > 0.9
    elif name == "velocities estimated":
        assert states.estimated.any()
    elif name == "floating base":
        assert (
            counts["before odometry"] and counts["odometry rejected: malformed"] and counts["odometry rejected: late"]
        )
    elif name == "gripper":
        assert counts["mimic disagreement"] and counts["followers only"]


def same_states(messages, states):
    """Every state that was published, and in this order, is the same to the last bit."""
    assert [nanoseconds(one.header.stamp) for one in messages] == states.newest.tolist()
    assert [nanoseconds(one.oldest_stamp) for one in messages] == states.oldest.tolist()
    for field in ("position", "velocity"):
        published = np.array([getattr(one, field) for one in messages])
        assert published.tobytes() == getattr(states, field).tobytes(), field
    assert [one.effort_valid for one in messages] == states.with_effort.tolist()
    for one, effort in zip(messages, states.effort, strict=True):
        assert np.array(one.effort).tobytes() == (effort.tobytes() if one.effort_valid else b"")
    assert [one.stamp_is_receive_time for one in messages] == states.received.tolist()
    assert [one.velocity_estimated for one in messages] == states.estimated.tolist()


def same_dynamics(messages, model, states):
    """What comes of a state is what comes of a single one in the library, to the last bit."""
    dynamics, batch = DiagonalDynamics(model), DiagonalDynamics(model).evaluate_batch(states.position, states.velocity)
    for k, one in enumerate(messages):
        effort = states.effort[k] if states.with_effort[k] else None
        s = dynamics.evaluate(states.position[k], states.velocity[k], effort)
        for field in ("nu", "xi", "coriolis", "gravity", "articulated_inertia", "epsilon", "kappa"):
            expected = getattr(s, field)
            assert np.array(getattr(one, field)).tobytes() == (b"" if expected is None else expected.tobytes()), field
        assert one.kinetic_energy == s.kinetic_energy
        assert one.power == (s.effort_power or 0.0)
        assert np.array(one.nu).tobytes() == batch.nu[k].tobytes()
