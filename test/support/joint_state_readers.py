# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every implementation of the rules of joint states behind one function: messages in, states and
counters out.
"""

from collections import Counter
from functools import cache, partial
from typing import NamedTuple

import numpy as np

import diag_dynamics as dd
from diag_dynamics.joint_states.assembler import Rejected, StateAssembler
from diag_dynamics.joint_states.decoding import Decoder
from diag_dynamics.joint_states.odometry import OdometryBase
from diag_dynamics.joint_states.robot_joints import joints_of
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from diag_dynamics.recordings.bag_messages import Messages
from diag_dynamics.recordings.intake import JOINT_STATE, MAX_TEXTS, ODOMETRY, Intake
from diag_dynamics.recordings.sources import decode_messages
from diag_dynamics.wire.definitions import read_message
from joint_state_messages import BASE_PARAMETERS, FLOATING, ROBOTS

DEFAULTS = {name: spec.default for name, spec in PARAMETERS.items()}


class State(NamedTuple):
    """A published state; effort is None where one is unknown, stamps are in nanoseconds."""

    position: list
    velocity: list
    effort: list | None
    newest: int
    oldest: int
    received: bool
    estimated: bool
    partial: bytes | None = None
    """Of efforts, where `effort` is None and some are known; NaN where one is unknown."""


class Result(NamedTuple):
    """What comes of a sequence of messages."""

    states: list
    counts: dict
    rejections: list
    """Cause and text of each, at most 20 of a cause."""


class Message(NamedTuple):
    """Bytes of a joint state or odometry, and the time of reception [ns]."""

    raw: bytes
    now: int
    odometry: bool = False


@cache
def model(name):
    """Return one of the robots of the table."""
    return dd.load_urdf(ROBOTS[name], floating_base=name in FLOATING)


def settings(parameters):
    """Return the monitor's settings for parameters of the table; `refuse_foreign` is an option."""
    values = DEFAULTS | BASE_PARAMETERS | dict(parameters)
    refuse_foreign = values.pop("refuse_foreign", False)
    chosen = Settings.of(values)
    return chosen._replace(inputs=chosen.inputs._replace(refuse_foreign=refuse_foreign))


class Reader:
    """Reads messages as the monitor does, one at a time, and counts as it does."""

    def __init__(self, robot, parameters):
        chosen = settings(parameters)
        self.counts = Counter()
        self.states = []
        self.rejections = []
        self.base = (
            OdometryBase(robot, chosen.values["odom_twist_frame"] == "header")
            if robot.floating_base
            else None
        )
        self.assembler = StateAssembler(joints_of(robot), chosen.inputs, self.base)

    def read(self, message):
        """Read a message and count what comes of it."""
        kind = "odometry " if message.odometry else ""
        self.counts[f"{kind}received"] += 1
        result = self.accept(message)
        if isinstance(result, Rejected):
            cause = f"{kind}rejected: {result.cause}"
            self.counts[cause] += 1
            self.rejections += [(cause, result.text)] * (self.counts[cause] <= MAX_TEXTS)
        elif result.state is not None:
            self.counts["published from odometry" if message.odometry else "published"] += 1
            self.states.append(as_state(*result.state))

    def result(self):
        """Return what came of all messages."""
        more = Counter({"time jumped back": self.base.jumps if self.base else 0})
        return Result(
            self.states, positive(self.counts + self.assembler.counts + more), self.rejections
        )

    def configure(self, parameters):
        """Use other parameters from now on."""
        parameters = {name.replace("__", "."): value for name, value in parameters.items()}
        self.assembler.configure(settings(parameters).inputs)

    def accept(self, message):
        """Return the outcome of a message."""
        if message.odometry:
            try:
                return self.assembler.accept_odometry(
                    read_message(message.raw, ODOMETRY), message.now
                )
            except Exception as error:
                return Rejected(
                    "malformed",
                    f"odom: {len(message.raw)} bytes; expected a nav_msgs/msg/Odometry ({error})",
                )
        return self.assembler.accept(message.raw, message.now)


def as_state(position, velocity, effort, newest, oldest, received, estimated, partial=None):
    """Return a state as plain lists, numbers and bytes."""
    effort = None if effort is None else effort.tolist()
    partial = None if partial is None else partial.tobytes()
    stamps = int(newest), int(oldest)
    return State(
        position.tolist(),
        velocity.tolist(),
        effort,
        *stamps,
        bool(received),
        bool(estimated),
        partial,
    )


def positive(counts):
    """Return the counters that are not zero, by name."""
    return {name: count for name, count in sorted(counts.items()) if count}


def read_messages(robot, parameters, messages):
    """Return the result of one message after the other."""
    reader = Reader(robot, parameters)
    for message in messages:
        reader.read(message)
    return reader.result()


def read_columns(robot, parameters, messages, pieces=1):
    """Return the result by the columns of a recording, read in some pieces."""
    intake = Intake(robot, settings(parameters))
    decoder = Decoder()
    states = []
    kinds = np.array([JOINT_STATE, ODOMETRY])
    for part in np.array_split(np.arange(len(messages)), pieces):
        result = intake.read(decode_messages(decoder, recorded([messages[k] for k in part]), kinds))
        efforts = [
            row if is_known else None
            for row, is_known in zip(result.effort, result.effort_known, strict=True)
        ]
        some = np.isfinite(result.effort).any(axis=1) & ~result.effort_known
        partial = [
            row if is_known else None for row, is_known in zip(result.effort, some, strict=True)
        ]
        columns = (
            result.position,
            result.velocity,
            efforts,
            result.stamp,
            result.oldest_stamp,
            result.stamp_received,
            result.velocity_estimated,
            partial,
        )
        states += [as_state(*row) for row in zip(*columns, strict=True)]
    return Result(states, positive(intake.counts), [(r.cause, r.text) for r in intake.rejections])


def recorded(messages):
    """Return messages as readers of bags give them."""
    size = np.array([len(message.raw) for message in messages], int)
    data = np.frombuffer(b"".join(message.raw for message in messages), dtype=np.uint8)
    times = np.array([message.now for message in messages], int)
    return Messages(
        data,
        np.array([int(message.odometry) for message in messages], int),
        np.cumsum(size) - size,
        size,
        times,
    )


READERS = {
    "bytes": read_messages,
    "columns": read_columns,
    "columns in pieces": partial(read_columns, pieces=3),
}
"""All implementations. A new one is added here, and the table and the twin test cover it."""
