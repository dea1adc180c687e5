# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""One message of each of the monitor's topics, made by the monitor's own parts, for the relay to send again and again."""

from functools import cache
from typing import NamedTuple

import numpy as np
from rclpy.serialization import serialize_message

import diag_dynamics as dd
from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.joint_states.robot_joints import RobotState
from diag_dynamics.model.joint_types import single_joints
from diag_dynamics.nodes.support.messages import MATRICES, ORDER, MessageMaker
from diag_dynamics.parameters.monitor import RATES


class Output(NamedTuple):
    """A topic as the relay needs it."""

    topic: str
    kind: str  # name of the type in diag_dynamics.msg
    rate: float  # highest [Hz], 0 for every state
    cdr: str  # the message, serialized, as hexadecimal text


@cache
def joints(robot):
    """Names that a joint state of the robot has, in order."""
    return single_joints(dd.load_urdf(find_urdf(robot)))


@cache
def outputs(robot):
    """All topics, in the order in which the monitor publishes them: who comes first is received first."""
    model = dd.load_urdf(find_urdf(robot))
    dynamics = dd.DiagonalDynamics(model)
    q, qd, tau = np.random.default_rng(1).uniform(-0.3, 0.3, (3, model.nv))
    state = RobotState(q, qd, tau, newest=0, oldest=0, stamp_is_receive_time=False)
    maker, s = MessageMaker(model, revision=1), dynamics.evaluate(q, qd, tau)
    messages = [
        maker.matrix(topic, dynamics, state)
        if topic in MATRICES
        else maker.evaluated(topic, s, state)
        for topic in ORDER
    ]
    return [
        Output(topic, type(message).__name__, RATES[topic], bytes(serialize_message(message)).hex())
        for topic, message in zip(ORDER, messages, strict=True)
    ]
