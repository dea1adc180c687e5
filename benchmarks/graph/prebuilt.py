"""One message of each of the monitor's topics, as the monitor itself would make it, for the relay to send again and again."""

from functools import cache
from typing import NamedTuple

import numpy as np
from rclpy.serialization import serialize_message

import diag_dynamics as dd
from diag_dynamics.example_robots import find_urdf
from diag_dynamics.nodes.inputs.joint_states import RobotState
from diag_dynamics.nodes.messages import MessageMaker, to_time
from diag_dynamics.nodes.outputs import TOPICS, classical
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


@cache
def outputs(robot):
    """All topics, in the order in which the monitor publishes them: who comes first is received first."""
    model = dd.load_urdf(find_urdf(robot))
    dynamics, maker = dd.DiagonalDynamics(model), MessageMaker(model, revision=1)
    q, qd, tau = np.random.default_rng(1).uniform(-0.3, 0.3, (3, model.nv))
    s = dynamics.evaluate(q, qd, tau)
    state, stamp = RobotState(q, qd, tau, newest=0, oldest=0, stamp_is_receive_time=False), to_time(0)
    messages = {
        "state": maker.state(stamp, s, state),
        "kinetic_energy": maker.kinetic_energy(stamp, s, state),
        "total_joint_rates": maker.total_joint_rates(stamp, s, state),
        "working_moments": maker.working_moments(stamp, s, state),
        "coriolis": maker.coriolis(stamp, s, state),
        "mass_matrix_factors": maker.mass_matrix_factors(stamp, dynamics.factors(q), False, state),
        "joint_space_dynamics": maker.joint_space_dynamics(stamp, *classical(dynamics, state), state),
    }
    return [
        Output(topic, type(message).__name__, TOPICS[topic][1], bytes(serialize_message(message)).hex())
        for topic, message in messages.items()
    ]
