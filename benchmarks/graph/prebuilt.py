"""One message of each of the monitor's topics, made by the monitor's own parts, for the relay to send again and again."""

from functools import cache
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from rclpy.serialization import serialize_message

import diag_dynamics as dd
from diag_dynamics.example_robots import find_urdf
from diag_dynamics.nodes.inputs.joint_states import RobotState
from diag_dynamics.nodes.messages import MessageMaker
from diag_dynamics.nodes.outputs import TOPICS, Outputs
from diag_dynamics.nodes.robot import single_joints


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


class Recorder:
    """Stands where the monitor's node does, and keeps what is published, as if everybody listened."""

    def __init__(self):
        self.published = []

    def create_lifecycle_publisher(self, kind, topic, *_, **__):
        """Return what publishes into the list."""
        return SimpleNamespace(
            handle=SimpleNamespace(get_subscription_count=lambda: 1, publish_raw=None),
            is_activated=True,
            publish=lambda message: self.published.append((topic.removeprefix("~/"), message)),
        )


@cache
def outputs(robot):
    """All topics, in the order in which the monitor publishes them: who comes first is received first."""
    model = dd.load_urdf(find_urdf(robot))
    dynamics = dd.DiagonalDynamics(model)
    q, qd, tau = np.random.default_rng(1).uniform(-0.3, 0.3, (3, model.nv))
    state = RobotState(q, qd, tau, newest=0, oldest=0, stamp_is_receive_time=False)
    recorder = Recorder()
    maker = MessageMaker(model, revision=1)
    Outputs(recorder).publish(dynamics, maker, state, dynamics.evaluate(q, qd, tau), with_inverse=False)
    return [
        Output(topic, type(message).__name__, TOPICS[topic][1], bytes(serialize_message(message)).hex())
        for topic, message in recorder.published
    ]
