# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the monitor sends as bytes: of any sequence of states, each is the message that is made of it in the ordinary way."""

from functools import cache
from typing import NamedTuple
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

import diag_dynamics as dd
from diag_dynamics.assembly.assembler import RobotState
from diag_dynamics.control.observer import Disturbance
from diag_dynamics.nodes.encoded import encoding as encoded
from diag_dynamics.nodes.encoded.encoding import EncodedMessages
from diag_dynamics.nodes.encoded.topic_bits import MATRICES, ORDER
from diag_dynamics.nodes.support.messages import Alarming, MessageMaker
from diag_dynamics.parameters.monitor import Observation
from diag_dynamics.wire.cdr import Template
from examples import examples
from nodes import PANDA, S, robot
from robots import description, link, random_tree

MODELS = {
    "arm": lambda: dd.load_urdf(random_tree(4, joints=6)),
    "panda": lambda: dd.load_urdf(robot(PANDA).urdf),
    "floating base": lambda: dd.load_urdf(random_tree(3, joints=5), floating_base=True),
    "base alone": lambda: dd.load_urdf(description("brick", link("brick", 2.0, (0, 0, 0.1), (1, 0, 0, 2, 0, 2))), True),
    "no joints": lambda: dd.load_urdf(description("post", link("post", 2.0, (0, 0, 0.1), (1, 0, 0, 2, 0, 2)))),
}

ABOUT_STATE = tuple(topic for topic in ORDER if topic not in MATRICES)

of_every_robot = pytest.mark.parametrize("name", MODELS)


@cache
def dynamics(name):
    """Return the dynamics of a robot."""
    return dd.DiagonalDynamics(MODELS[name]())


class Moment(NamedTuple):
    """When a state is, how it came about, and what is wanted of it."""

    seed: int
    newest: int
    age: int
    received: bool
    estimated: bool
    effort: bool
    friction: bool
    inverse: bool


moments = st.builds(
    Moment,
    st.integers(0, 2**32 - 1),
    st.integers(0, (2**31 - 1) * S + S - 1) | st.sampled_from((0, S - 1, S, 2**31 * S - 1, 1_763_000_000 * S)),
    st.sampled_from((0, 1, S - 1, S, 10**6)),
    *[st.booleans()] * 5,
)


def arguments(name, moment):
    """Return by topic what a message is made of."""
    dyn, rng = dynamics(name), np.random.default_rng(moment.seed)
    model = dyn.model
    q = rng.normal(size=model.nq)
    if model.floating_base:
        q[3:7] /= np.linalg.norm(q[3:7])
    qd, tau = rng.normal(size=(2, model.nv))
    oldest = max(moment.newest - moment.age, 0)
    effort = tau if moment.effort else None
    state = RobotState(q, qd, effort, moment.newest, oldest, moment.received, moment.estimated)
    s = dyn.evaluate(q, qd, effort, friction=moment.friction)
    return {
        "total_joint_rates": (s, state),
        "working_moments": (s, state),
        "coriolis": (s, state),
        "named": (s, state),
        "kinetic_energy": (s, state),
        "state": (s, state),
        "mass_matrix_factors": (dyn.factors(q), moment.inverse, state),
        "joint_space_dynamics": (dyn.mass_matrix(q), dyn.bias(q, qd), dyn.gravity_torque(q), state),
    }


def encode(encoder, topic, of_it):
    """Return a topic's bytes."""
    return encoder.messages((topic,), *of_it)[0] if topic not in MATRICES else getattr(encoder, topic)(*of_it)


def same(raw, message):
    """The bytes are those of the message, to the last bit; where rclpy's differ is padding, which is zero."""
    assert type(raw) is bytes
    assert repr(deserialize_message(raw, type(message))) == repr(message)
    theirs = serialize_message(message)
    assert not any(own for own, other in zip(raw, theirs, strict=False) if own != other)
    assert Template(message).encoded() == raw


@of_every_robot
@pytest.mark.parametrize("topic", ORDER)
def test_any_sequence_of_states(name, topic):
    """With efforts or without, estimated or not: nothing of one message is left in another, nor does one change later."""

    @examples(15)
    @given(st.lists(moments, min_size=1, max_size=8))
    def check(sequence):
        maker = MessageMaker(dynamics(name).model, revision=7)
        encoder = EncodedMessages(maker)
        sent = []
        for moment in sequence:
            of_it = arguments(name, moment)[topic]
            raw, message = encode(encoder, topic, of_it), getattr(maker, topic)(*of_it)
            same(raw, message)
            sent.append((raw, message))
        for raw, message in sent:
            same(raw, message)
        assert not encoder.unlike

    check()


@of_every_robot
def test_all_topics_of_one_state(name):
    """As the monitor makes them: one encoder for all topics, which do not get into each other's way."""

    @examples(10)
    @given(st.lists(moments, min_size=2, max_size=4))
    def check(sequence):
        maker = MessageMaker(dynamics(name).model)
        encoder = EncodedMessages(maker)
        for moment in sequence:
            of_it = arguments(name, moment)
            for topic, raw in zip(ABOUT_STATE, encoder.messages(ABOUT_STATE, *of_it["state"]), strict=True):
                same(raw, getattr(maker, topic)(*of_it[topic]))
            for topic in ORDER:
                same(encode(encoder, topic, of_it[topic]), getattr(maker, topic)(*of_it[topic]))

    check()


@of_every_robot
def test_contact(name):
    """Of any points, moving or at rest, with limits or without: what the maker makes, and never what was before."""
    dyn = dynamics(name)
    limits = dd.ContactLimits({"any": {"energy": 1.0}}, links={dyn.model.link_names[-1]: []})
    rows = [(link, link, ((0, 0, 0), (0.1, 0, 0))) for link in dyn.model.link_names]
    sets = [dd.ContactPoints(dyn.model, rows, limits), dd.ContactPoints(dyn.model, rows[-1:])]

    @examples(15)
    @given(st.lists(st.tuples(moments, st.booleans(), st.booleans()), min_size=1, max_size=8))
    def check(sequence):
        maker = MessageMaker(dyn.model)
        encoder = EncodedMessages(maker)
        for moment, moving, whole in sequence:
            _, state = arguments(name, moment)["state"]
            contact = dyn.contact(state.position, moving * state.velocity, sets[0 if whole else 1])
            message = maker.contact(contact, state)
            assert list(message.point_names) == list(contact.names) and message.worst == contact.worst
            same(encoder.contact(contact, state), message)

    check()


@of_every_robot
def test_external_torque(name):
    """With a result or without, in a collision or not: what the maker makes, and never what was before."""

    @examples(15)
    @given(st.lists(st.tuples(moments, *[st.booleans()] * 3), min_size=1, max_size=8))
    def check(sequence):
        maker = MessageMaker(dynamics(name).model)
        encoder = EncodedMessages(maker)
        for moment, valid, collision, judged in sequence:
            _, state = arguments(name, moment)["state"]
            r, torque = np.random.default_rng(moment.seed).normal(size=(2, len(state.velocity)))
            seen = Disturbance(True, "", r, torque, float(np.linalg.norm(r)), collision)
            seen = seen if valid else Disturbance(False, "")
            observation = Observation(
                1.0, np.inf if moment.received else 2.0 + moment.age, 1.0 + moment.age, False, 0.1
            )
            limits = np.r_[np.abs(torque), np.inf, 1.0 + moment.age]
            alarming = Alarming(limits, r > 0.0) if judged else None
            message = maker.external_torque(seen, observation, state, alarming)
            assert (message.valid, message.collision) == (valid, valid and collision)
            assert message.torque_norm == pytest.approx(np.linalg.norm(torque) if valid else 0.0)
            assert list(message.torque_threshold) == (np.abs(torque).tolist() if judged else [])
            assert list(message.joint_collision) == ((r > 0.0).tolist() if judged and valid else [])
            same(encoder.external_torque(seen, observation, state, alarming), message)

    check()


A_MOMENT = Moment(1, 5 * S, S, False, False, True, True, True)
SHAPES = dict.fromkeys(ORDER, (A_MOMENT,)) | {
    "working_moments": (A_MOMENT, A_MOMENT._replace(effort=False)),
    "coriolis": (A_MOMENT, A_MOMENT._replace(friction=False)),
    "named": (A_MOMENT, A_MOMENT._replace(effort=False)),
    "mass_matrix_factors": (A_MOMENT, A_MOMENT._replace(inverse=False)),
    "state": tuple(A_MOMENT._replace(effort=e, friction=f) for e in (True, False) for f in (True, False)),
}


@pytest.mark.parametrize("topic", ORDER)
def test_messages_are_made_once(topic):
    """One of each shape; all others are written over it."""
    maker = MessageMaker(dynamics("panda").model)
    encoder = EncodedMessages(maker)
    with mock.patch.object(maker, topic, wraps=getattr(maker, topic)) as made:
        for turn in range(3):
            for moment in SHAPES[topic]:
                encode(encoder, topic, arguments("panda", moment._replace(seed=turn))[topic])
    assert made.call_count == len(SHAPES[topic])


OTHERWISE = {
    "big-endian": lambda raw: b"\0\0" + raw[2:],
    "XCDR2": lambda raw: b"\0\7" + raw[2:],
    "truncated": lambda raw: raw[:-8],
    "another number": lambda raw: raw[:8] + bytes([raw[8] ^ 1]) + raw[9:],
    "empty": lambda raw: b"",
}


@pytest.mark.parametrize("otherwise", OTHERWISE.values(), ids=OTHERWISE)
@pytest.mark.parametrize("topic", ORDER)
def test_where_rclpy_serializes_otherwise(topic, otherwise):
    """The messages themselves are sent, each of them right, and the topic is named; others are not concerned."""
    maker = MessageMaker(dynamics("arm").model)
    encoder = EncodedMessages(maker)
    with mock.patch.object(encoded, "serialize_message", lambda message: otherwise(serialize_message(message))):
        for turn in range(3):
            for moment in SHAPES[topic]:
                of_it = arguments("arm", moment._replace(seed=turn))[topic]
                message = encode(encoder, topic, of_it)
                assert type(message) is not bytes
                assert repr(message) == repr(getattr(maker, topic)(*of_it))
                assert encoder.unlike == {topic}
    for other, of_it in arguments("arm", A_MOMENT).items():
        sent = encode(encoder, other, of_it)
        assert (type(sent) is bytes) == (other != topic)
    assert encoder.unlike == {topic}
