# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every implementation of the rules of joint states behind one function: messages in, states and counters out."""

from collections import Counter
from functools import cache, partial
from typing import NamedTuple

import numpy as np

import diag_dynamics as dd
from diag_dynamics.assembly.assembler import JointStateAssembler, joints_of
from diag_dynamics.assembly.frozen import Frozen
from diag_dynamics.assembly.gaps import Gaps
from diag_dynamics.assembly.odometry import OdometryBase
from diag_dynamics.assembly.rejected import RejectedError
from diag_dynamics.assembly.whole import WithBase
from diag_dynamics.joint_states.decoding import Decoder
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from diag_dynamics.recordings.intake import JOINT_STATE, LOST, MAX_TEXTS, ODOMETRY, Intake
from diag_dynamics.recordings.messages import Messages
from diag_dynamics.recordings.sources import decode_messages
from diag_dynamics.wire.definitions import read_message
from diag_dynamics.wire.joint_states import KnownJointStates
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
    """Return the monitor's settings for parameters of the table."""
    return Settings.of(DEFAULTS | BASE_PARAMETERS | dict(parameters))


class Reader:
    """Reads messages as the monitor does, one at a time, and counts as it does."""

    def __init__(self, robot, parameters, warm=()):
        chosen = settings(parameters)
        self.values, self.counts, self.states, self.rejections = chosen.values, Counter(), [], []
        self.assembler = JointStateAssembler(joints_of(robot), chosen.inputs)
        self._warm_up(warm)
        refuses = self.values["frozen_values"] == "refuse"
        self.frozen = Frozen(self.assembler.names, self.values["frozen_timeout"], refuses)
        self.base = OdometryBase(robot, False) if robot.floating_base else None
        self._with_base = WithBase(self.base, self.assembler)
        if self.base:
            self.base.configure(chosen.inputs)

    def read(self, message):
        """Take a message in and count what comes of it."""
        kind = "odometry " if message.odometry else ""
        self.counts[f"{kind}received"] += 1
        try:
            state = self._read_odometry(message) if message.odometry else self._read_joints(message)
        except RejectedError as error:
            cause = f"{kind}rejected: {error.cause}"
            self.counts[cause] += 1
            self.rejections += [(cause, str(error))] * (self.counts[cause] <= MAX_TEXTS)
            if not message.odometry:
                self.assembler.gaps.pause()
            return
        if state is not None:
            self.counts["published from odometry" if message.odometry else "published"] += 1
            self.states.append(as_state(*state))

    def result(self):
        """Return what came of all messages."""
        lost = Counter({LOST: self.assembler.gaps.lost})
        jumps = Counter({"time jumped back": self.base.jumps if self.base else 0})
        return Result(self.states, positive(self.counts + self.assembler.counts + lost + jumps), self.rejections)

    def _warm_up(self, messages):
        pass

    def configure(self, parameters):
        """Judge by other parameters from now on."""
        parameters = {name.replace("__", "."): value for name, value in parameters.items()}
        self.assembler.configure(settings(parameters).inputs)

    def assemble(self, raw, now):
        """Return the state of the joints that a message completes."""
        return self.assembler.update(_parsed(raw, JOINT_STATE), now)

    def _read_joints(self, message):
        state = self.assemble(message.raw, message.now)
        if state is not None and self.base:
            state = self._with_base.state(state, self.values["odom_timeout"])
            self.counts["before odometry"] += state is None
        return self._judged(state)

    def _read_odometry(self, message):
        self.base.update(_parsed(message.raw, ODOMETRY), message.now)
        return self._judged(self._with_base.state_of_base(self.values["odom_timeout"]))

    def _judged(self, state):
        if state is not None:
            self.frozen.judge(state.newest, lambda: state)
        return state


class BytesReader(Reader):
    """The same by compiled code on bytes, wherever a message has the names and lengths of an earlier one."""

    def _warm_up(self, messages):
        self.known = KnownJointStates(self.assembler, partial(read_message, kind=JOINT_STATE))
        self.known.configure()
        for message in messages:  # learn names and lengths
            if not message.odometry:
                try:
                    self.known.update(message.raw, message.now)
                except RejectedError:
                    continue
        self.assembler.forget()
        self.assembler.stamps.forget()
        self.assembler.counts.clear()
        self.assembler.gaps, self.known.at_once = Gaps(), 0

    def configure(self, parameters):
        """Judge by other parameters from now on."""
        super().configure(parameters)
        self.known.configure()

    def assemble(self, raw, now):
        """Return the state of the joints that a message completes."""
        return self.known.update(raw, now)


def _parsed(raw, kind):
    try:
        return read_message(raw, kind)
    except ValueError as error:
        raise RejectedError("malformed", str(error)) from error


def as_state(position, velocity, effort, newest, oldest, received, estimated):
    """Return a state as plain lists and numbers."""
    effort = None if effort is None else effort.tolist()
    stamps = int(newest), int(oldest)
    return State(position.tolist(), velocity.tolist(), effort, *stamps, bool(received), bool(estimated))


def positive(counts):
    """Return the counters that are not zero, by name."""
    return {name: count for name, count in sorted(counts.items()) if count}


def read_messages(robot, parameters, messages):
    """Return the result by the assembler, of one message after the other."""
    return _read(Reader(robot, parameters), messages)


def read_bytes(robot, parameters, messages):
    """Return the result by the reader of bytes."""
    return _read(BytesReader(robot, parameters), messages)


def read_known_bytes(robot, parameters, messages):
    """Return the result by the reader of bytes, which has learned names and lengths of all messages before."""
    return _read(BytesReader(robot, parameters, messages), messages)


def _read(reader, messages):
    for message in messages:
        reader.read(message)
    return reader.result()


def read_columns(robot, parameters, messages, pieces=1):
    """Return the result by the columns of a recording, read in some pieces."""
    intake, decoder, states = Intake(robot, settings(parameters)), Decoder(), []
    kinds = np.array([JOINT_STATE, ODOMETRY])
    for part in np.array_split(np.arange(len(messages)), pieces):
        found = intake.read(decode_messages(decoder, recorded([messages[k] for k in part]), kinds))
        efforts = [row if known else None for row, known in zip(found.effort, found.effort_known, strict=True)]
        columns = (
            found.position,
            found.velocity,
            efforts,
            found.stamp,
            found.oldest_stamp,
            found.stamp_received,
            found.velocity_estimated,
        )
        states += [as_state(*row) for row in zip(*columns, strict=True)]
    return Result(states, positive(intake.counts), [(r.cause, r.text) for r in intake.rejections])


def recorded(messages):
    """Return messages as readers of bags give them."""
    size = np.array([len(message.raw) for message in messages], dtype=int)
    data = np.frombuffer(b"".join(message.raw for message in messages), dtype=np.uint8)
    times = np.array([message.now for message in messages], dtype=int)
    return Messages(
        data, np.array([int(message.odometry) for message in messages], dtype=int), np.cumsum(size) - size, size, times
    )


READERS = {
    "messages": read_messages,
    "bytes": read_bytes,
    "known bytes": read_known_bytes,
    "columns": read_columns,
    "columns in pieces": partial(read_columns, pieces=3),
}
"""All implementations. A new one is added here, and the table and the twin test cover it."""
