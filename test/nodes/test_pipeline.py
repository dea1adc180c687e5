# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""From bytes to bytes in one pass: two monitors, one that works by templates and one by messages, never say another thing."""

import time
from functools import partial
from typing import NamedTuple

import numpy as np
import pytest
import rclpy
from hypothesis import given
from hypothesis import strategies as st
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from test_encoded import same

from diag_dynamics.nodes.encoded.topic_bits import ABOUT_STATE, BITS, MATRICES, ORDER
from diag_dynamics.nodes.monitor.monitor import MonitorNode
from examples import examples
from nodes import BELIEVING, MS, PANDA, S, joint_state, robot

FINGER, FOLLOWER = "panda_finger_joint1", "panda_finger_joint2"
ARM = tuple(f"panda_joint{k}" for k in range(1, 8))

PLAIN = {
    "payloads": [""],
    "gravity": [0.0, 0.0, -9.81],
    "publish_friction": False,
    "publish_inverse_factor": False,
    "effort_includes_gravity": [""],
    "effort_scale": [""],
    "joint_timeout": 0.5,
    "max_rate.state": 0.0,
    "warn_energy_share": [""],
    "missing_velocity": "refuse",
    "external_torque.gain": 0.0,
}

CHANGES = (
    {"payloads": ["panda_hand=1.5 0 0 0.1 0.01 0.01 0.01 0 0 0"]},
    {"gravity": [0.0, 1.0, -1.6]},
    {"publish_friction": True},
    {"publish_inverse_factor": True},
    {"effort_includes_gravity": ["panda_joint2=false"]},
    {"effort_scale": ["*=2.0"]},
    {"max_rate.state": 100.0},
    {"warn_energy_share": ["*=0.001"]},
    {"missing_velocity": "estimate"},
    {"external_torque.gain": 50.0},
)


class Step(NamedTuple):
    """A joint state, what time it is, and who listens."""

    seed: int
    names: tuple
    effort: str
    wrong: float | None  # what one position is instead
    passed: int  # since the last stamp [ns]
    late: int  # how much later it is received
    wanted: frozenset
    change: dict | None


steps = st.builds(
    Step,
    seed=st.integers(0, 2**32 - 1),
    names=st.sampled_from(((*ARM, FINGER), (FOLLOWER, *ARM[::-1], FINGER), ARM, (FINGER,), (FINGER, FOLLOWER, "lid"))),
    effort=st.sampled_from(("all", "all", "none", "some")),
    wrong=st.none() | st.none() | st.sampled_from((np.nan, np.inf, 1e9, 3e4)),
    passed=st.just(MS) | st.sampled_from((0, 20 * MS, -MS, 2 * S, -30 * S)),
    late=st.just(0) | st.sampled_from((3 * MS, 3 * S)),
    wanted=st.just(frozenset(ORDER)) | st.frozensets(st.sampled_from(ORDER)),
    change=st.none() | st.none() | st.none() | st.sampled_from(CHANGES),
)


def windows_of(minute):
    """What a monitor remembers of its last minute, by name, that of its joints too."""
    found = dict(vars(minute))
    return found | {f"joints: {name}": value for name, value in vars(found.pop("_joints")).items() if name != "_names"}


class Twins:
    """A monitor twice, by each way of serialization. Nobody spins them: they are told what comes."""

    def __init__(self, context):
        """Start both."""
        self.nodes, self.now = [], 1000 * S
        for way in ("template", "rclpy"):
            values = {"serialization": way, "robot_description": str(robot(PANDA).path), **BELIEVING}
            parameters = [Parameter(name, value=value) for name, value in values.items()]
            node = MonitorNode(context=context, namespace=f"/by_{way}", parameter_overrides=parameters)
            node._now = lambda: self.received
            self.nodes.append(node)
        self.served_at_once = 0

    def destroy(self):
        """End both."""
        for node in self.nodes:
            node.destroy_node()

    def begin(self):
        """Let them be as they were at first."""
        self.now += 1000 * S
        self.received = self.now
        self.change(PLAIN)
        for node in self.nodes:
            node._robot.forget()

    def change(self, values):
        """Set parameters of both."""
        for node in self.nodes:
            results = node.set_parameters([Parameter(name, value=value) for name, value in values.items()])
            assert all(result.successful for result in results), results

    def take(self, step):
        """Let both take one joint state in, and compare all that comes of it; return what was published."""
        if step.change:
            self.change(step.change)
        self.now += step.passed
        self.received = self.now + step.late
        rng = np.random.default_rng(step.seed)
        position, velocity, effort = rng.uniform(0.0, 0.03, (3, len(step.names)))
        if step.wrong is not None:
            position[rng.integers(len(position))] = step.wrong
        effort = {"all": effort, "none": (), "some": np.where(rng.random(len(effort)) < 0.5, np.nan, effort)}[
            step.effort
        ]
        message = joint_state(step.names, position, velocity, effort, self.now)
        before = self.nodes[0]._robot.at_once
        by_template, by_rclpy = (
            self._taken(node, one, step.wanted)
            for node, one in zip(self.nodes, (serialize_message(message), message), strict=True)
        )
        assert [entry[:2] for entry in by_template] == [entry[:2] for entry in by_rclpy]
        for (_, topic, raw), (_, _, expected) in zip(by_template, by_rclpy, strict=True):
            assert type(raw) is bytes or topic in self.nodes[0]._robot.encoder.unlike
            same(raw, expected)
        first, second = (self._memory(node) for node in self.nodes)
        assert first == second
        windows, others = (windows_of(node._robot.energy._minute) for node in self.nodes)
        assert windows.keys() == others.keys()
        for name, one in windows.items():  # powers are summed up in another order
            assert (one is None) == (others[name] is None)
            if one is not None:
                np.testing.assert_allclose(one, others[name], rtol=1e-9, atol=1e-12, err_msg=name)
        self.served_at_once += self.nodes[0]._robot.at_once > before
        return by_rclpy

    @staticmethod
    def _taken(node, message, wanted):
        """What a node publishes of a message: stamps, topics and messages, in their order."""
        published = []
        outputs = node._outputs
        outputs._wanted = [topic for topic in ORDER if topic in wanted]
        outputs._bits, outputs._looked = sum(BITS[topic] for topic in wanted), np.inf  # nobody is asked

        def send(stamp, topic, message):
            published.append((stamp, topic, message))

        def publish(stamp, about_state, matrix):
            outputs._send = partial(send, stamp)
            type(outputs).publish(outputs, stamp, about_state, matrix)

        outputs.publish = publish
        node._beat = time.monotonic()
        node._take_joint_state(node._listening, message)
        return published

    @staticmethod
    def _memory(node):
        """All that a node remembers of what came, as text."""
        beside = "_shares", "_at", "_minute", "_model"
        watch = {name: value for name, value in vars(node._robot.energy).items() if name not in beside}
        traffic = {name: getattr(node._traffic, name) for name in ("counts", "last_rejection", "last_stamp")}
        return repr((watch, traffic, node._robot.state, node._robot.assembler.stamps.offset))


@pytest.fixture(scope="module")
def twins(ros_domain):
    """Two monitors."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain)
    pair = Twins(context)
    yield pair
    pair.destroy()
    context.try_shutdown()


A_STEP = Step(1, (*ARM, FINGER), "all", None, MS, 0, frozenset(ORDER), None)


def served(twins):
    """Whether the pipeline has served the last state, as the node's own account of its state shows."""
    return twins.nodes[0]._robot._at_once


@examples(60)
@given(journey=st.lists(steps, min_size=1, max_size=20))
def test_twins(twins, journey):
    """Whatever comes, both publish the same of it, count the same, watch the same energies, and know the same state."""
    twins.begin()
    for step in journey:
        twins.take(step)


def test_plain_states_are_served_at_once(twins):
    """From the second of a text on; of a topic that nobody wanted before, from its second message on."""
    twins.begin()
    some = A_STEP._replace(wanted=frozenset({"kinetic_energy", "coriolis"}))
    for step, at_once in ((some, False), (some, True), (A_STEP, False), (A_STEP, True), (some, True)):
        assert [topic for _, topic, _ in twins.take(step)][:1] == ["kinetic_energy"]
        assert served(twins) == at_once
    for effort in ("none", "some"):
        step = A_STEP._replace(effort=effort)
        twins.take(step)
        twins.take(step)
        assert served(twins)


def test_nobody_listens(twins):
    """States are served at once all the same: energies are watched."""
    for wanted in (frozenset(), frozenset(MATRICES)):
        twins.begin()
        for at_once in (False, True):
            twins.take(A_STEP._replace(wanted=wanted))
            assert served(twins) == at_once


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: next(iter(change)))
def test_after_a_change_of_settings(twins, change):
    """The next state is already by the new settings, served at once where they are nothing unusual."""
    twins.begin()
    for _ in range(3):
        twins.take(A_STEP)
    assert served(twins)
    twins.take(A_STEP._replace(change=change))
    twins.take(A_STEP)
    unusual = {"publish_friction", "effort_includes_gravity", "missing_velocity", "external_torque.gain"}
    usual = not unusual & set(change)
    assert served(twins) == usual


@pytest.mark.parametrize(
    ("velocity", "effort"), [(1e200, 0.0), (1e150, 1e200), (1e150, -1e200)], ids=["energy", "power", "power taken out"]
)
def test_state_that_cannot_be_evaluated(twins, velocity, effort):
    """Velocities and efforts whose energy or power no number can hold: refused as ever, and the next state is right."""
    twins.begin()
    twins.change({"absurd.velocity": 0.0, "absurd.effort": 0.0})
    try:
        for _ in range(3):
            twins.take(A_STEP)
        assert served(twins)
        for node in twins.nodes:
            refused = node._traffic.counts["rejected: InputError"]
            speed, push = np.full(8, velocity), np.full(8, effort)
            huge = joint_state((*ARM, FINGER), np.full(8, 0.01), speed, push, twins.now + MS)
            message = serialize_message(huge) if node is twins.nodes[0] else huge
            twins.received = twins.now + MS
            assert twins._taken(node, message, frozenset(ORDER)) == []
            assert node._traffic.counts["rejected: InputError"] == refused + 1
            assert "overflows" in node._traffic.last_rejection
        first, second = (twins._memory(node) for node in twins.nodes)
        assert first == second
        twins.take(A_STEP._replace(passed=2 * MS))
        assert served(twins)
    finally:
        twins.change({"absurd.velocity": 1e4, "absurd.effort": 1e6})


def test_what_a_message_holds_does_not_change(twins):
    """Bytes that were handed out stay as they are when others are written."""
    twins.begin()
    for _ in range(2):
        twins.take(A_STEP)
    robot_ = twins.nodes[0]._robot
    topics = [topic for topic in ORDER if topic not in MATRICES]
    first = robot_.pipeline.messages(topics)
    state = robot_.state
    copies = [bytes(bytearray(raw)) for raw in first], [values.copy() for values in state[:3]]
    twins.take(A_STEP._replace(seed=7))
    assert first == copies[0]
    assert all((now == then).all() for now, then in zip(state[:3], copies[1], strict=True))
    assert robot_.pipeline.messages(topics) != first
    assert sum(BITS[topic] for topic in topics) == ABOUT_STATE
