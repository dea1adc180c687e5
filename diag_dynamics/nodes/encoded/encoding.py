# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What MessageMaker makes, as the bytes that are sent: laid out once, then only the numbers are written anew."""

import math
from typing import NamedTuple

import numpy as np
from rclpy.serialization import serialize_message

from diag_dynamics import sweeps
from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.compiled.kernel import COUNT, FLAG, MATRIX, NUMBER, VECTOR, entry_kernel, kernel, large_kernel, ready
from diag_dynamics.compiled.tables import Addresses, Table, array
from diag_dynamics.nodes.encoded.topic_bits import BITS, WITH_LINK_ENERGY
from diag_dynamics.sweeps import NU
from diag_dynamics.wire.cdr import HEADER, Template

_ROW, _STAMP, _OLDEST, _RECEIVED, _ESTIMATED, _ENERGY, _POWER, _BASE, _SHARES, _POSITION, _EFFORT, _FRICTION = range(12)

FIELDS = {
    "header.stamp.sec": (_STAMP, 0),
    "oldest_stamp.sec": (_OLDEST, 0),
    "stamp_is_receive_time": (_RECEIVED, 0),
    "velocity_estimated": (_ESTIMATED, 0),
    "total": (_ENERGY, 0),
    "kinetic_energy": (_ENERGY, 0),
    "power": (_POWER, 0),
    "base_energy": (_BASE, 0),
    "energy_share": (_SHARES, 0),
    "position": (_POSITION, 0),
    "effort": (_EFFORT, 0),
    "friction": (_FRICTION, 0),
    "velocity": (_ROW, sweeps.RATES),
    "nu": (_ROW, sweeps.NU),
    "xi": (_ROW, sweeps.XI),
    "epsilon": (_ROW, sweeps.EPSILON),
    "kappa": (_ROW, sweeps.KAPPA),
    "coriolis": (_ROW, sweeps.CORIOLIS),
    "coriolis_unnormalized": (_ROW, sweeps.CORIOLIS_UNNORMALIZED),
    "gravity": (_ROW, sweeps.GRAVITY),
    "articulated_inertia": (_ROW, sweeps.ARTICULATED_INERTIA),
}
"""What is written where a message about one Evaluation has this field, and which row of it."""

OF_TOPIC = {
    "named": {"position": (_SHARES, 0), "velocity": (_ROW, sweeps.NU), "effort": (_ROW, sweeps.EPSILON)},
}
"""Likewise, of topics in which these fields mean something else."""

CONSTANT = {"effort_valid", "friction_valid", "power_valid", "model_revision"}
"""Fields that are the same in all messages of one shape."""

ALONGSIDE = {"header.stamp.nanosec", "oldest_stamp.nanosec", "link_energy"}
"""Fields that are written with others, or by themselves."""

INSTRUCTION = np.dtype([("bit", "i8"), ("what", "i8"), ("at", "i8"), ("row", "i8")])
"""To write something in a topic's message: the topic's bit; one of the first entries of :data:`FIELDS`; at which byte, 32-bit
word or double; and which row."""

SHEETS = Table(
    "Sheets",
    data=array(np.uint8),  # one piece of memory, as numbers of three kinds
    words=array(np.int32),
    doubles=array(float),
    instructions=array(INSTRUCTION),
    nv=int,
    link_energy=array(float),  # where link energies are written; empty if nowhere
)
"""What :func:`write` writes, and in what."""


class Written(NamedTuple):
    """Numbers of a state that are written in messages: stamps [ns], energy [J] and its rate [W]."""

    newest: int
    oldest: int
    received: bool
    """Whether the stamp is a time of reception."""
    estimated: bool
    """Whether velocities are."""
    energy: float
    power: float
    base: int
    """Degrees of freedom of a floating base."""


class Vectors(NamedTuple):
    """Vectors of a state that are written in messages; empty where there is none."""

    rows: np.ndarray
    """Of the evaluation."""
    position: np.ndarray
    effort: np.ndarray
    friction: np.ndarray


class EncodedMessages:
    """Makes what a MessageMaker makes of the same arguments, as bytes.

    Each topic is laid out by what the maker and rclpy make of its first message, and of the first one of another shape (with
    efforts or without). Should rclpy serialize it otherwise than :class:`Template` does, the message itself is returned.

    Parameters
    ----------
    maker : MessageMaker

    Attributes
    ----------
    unlike : set of str
        Topics of which rclpy makes other bytes.
    """

    def __init__(self, maker):
        self._maker = maker
        self._sheets, self._templates = {}, {}
        self._points = None  # those that templates of contact are of
        self.unlike = set()
        ready(_write)

    def messages(self, topics, s, state):
        """The messages of several topics that are about an Evaluation and the RobotState it came from."""
        shape = state.effort is not None, s.friction is not None
        sheets = self._sheets.get(shape)
        if sheets is None or any(topic not in sheets.spans and topic not in self.unlike for topic in topics):
            sheets = self._sheets[shape] = self._laid_out({*topics, *(sheets.spans if sheets else ())}, s, state)
        sheets.write(sum(BITS[topic] for topic in topics), s, state)
        return [
            sheets.encoded(topic) if topic in sheets.spans else getattr(self._maker, topic)(s, state)
            for topic in topics
        ]

    def sheets(self, with_effort):
        """The Sheets of messages without friction, of those topics that have been asked for; None without any."""
        return self._sheets.get((with_effort, False))

    def mass_matrix_factors(self, factors, with_inverse, state):
        """M and D of Factors, and ℓ if wanted."""
        values = {"m": factors.m, "d": factors.D} | ({"l": factors.l} if with_inverse else {})
        return self._single("mass_matrix_factors", values, state, factors, with_inverse, state)

    def joint_space_dynamics(self, mass_matrix, bias, gravity, state):
        """M, c and g."""
        values = {"mass_matrix": mass_matrix, "bias": bias, "gravity": gravity}
        return self._single("joint_space_dynamics", values, state, mass_matrix, bias, gravity, state)

    def external_torque(self, seen, observation, state, alarming=None):
        """What an observer has seen."""
        values = {"norm": seen.norm, "collision": seen.collision, "threshold": observation.threshold}
        values |= {"release_threshold": observation.release, "torque_norm": seen.torque_norm}
        values |= alarming.fields(seen.valid) if alarming else {"torque_norm_threshold": math.inf}
        if seen.valid:
            values |= {"residual": seen.residual, "external_torque": seen.external_torque}
        return self._single("external_torque", values, state, seen, observation, state, alarming)

    def contact(self, contact, state):
        """Contact at the points of a robot: its names are those that the first message of these points had."""
        if contact.points is not self._points:
            self._points = contact.points
            self._templates = {shape: one for shape, one in self._templates.items() if shape[0] != "contact"}
        return self._single("contact", self._maker.contact_numbers(contact), state, contact, state)

    def _laid_out(self, topics, s, state):
        templates = {}
        for topic in BITS:
            if topic in topics and (template := self._template(topic, getattr(self._maker, topic)(s, state))):
                templates[topic] = template
        return Sheets(templates, s, state)

    def _template(self, topic, message):
        """The template of a message; None if rclpy makes other bytes of it, or has of one before."""
        if topic not in self.unlike:
            template = Template(message)
            if template.holds(serialize_message(message)):
                return template
            self.unlike.add(topic)
        return None

    def _single(self, topic, values, state, *arguments):
        """A message that is not about an Evaluation, and has no part in what is written at once."""
        shape = topic, *values
        template = self._templates.get(shape)
        if template is None:
            message = getattr(self._maker, topic)(*arguments)
            template = self._template(topic, message)
            if template is None:
                return message
            self._templates[shape] = template
        sec, nanosec = divmod(state.newest, SECOND)
        values = values | {
            "header.stamp.sec": sec,
            "header.stamp.nanosec": nanosec,
            "stamp_is_receive_time": state.stamp_is_receive_time,
            "velocity_estimated": state.velocity_estimated,
        }
        for field, value in values.items():
            if field in template.numbers:
                template.numbers[field][:] = np.ravel(value)
        return template.encoded()


class Sheets:
    """Templates of several messages about one Evaluation in one piece of memory, written in one pass.

    Parameters
    ----------
    templates : dict
        By topic.
    s : Evaluation
    state : RobotState

    Attributes
    ----------
    spans : dict of tuple
        Begin and end of each topic's bytes.
    bits : int
        Sum of their :data:`~topic_bits.BITS`.
    addresses : Addresses
        Of what :func:`write` writes in.
    """

    def __init__(self, templates, s, state):
        begin, self.spans, instructions, energies = 0, {}, [], -1
        for topic, template in templates.items():
            begin += -begin % 8 + 8 - len(HEADER)  # what comes after the encapsulation begins on a multiple of eight
            end = begin + len(template.data)
            self.spans[topic] = begin, end
            fields = FIELDS | OF_TOPIC.get(topic, {})
            instructions += [(BITS[topic], *rest) for rest in _instructions(template, begin, fields)]
            if template.place("link_energy") >= 0:
                energies = (begin + template.place("link_energy")) // 8
            begin = end
        room = np.zeros(begin + 16, dtype=np.uint8)
        room = room[-room.ctypes.data % 8 :][: begin + -begin % 8]
        for topic, (first, last) in self.spans.items():
            room[first:last] = templates[topic].data
        self.bits = sum(BITS[topic] for topic in templates)
        self._view = memoryview(room)
        self._base = 6 if len(state.position) > len(state.velocity) else 0
        links, nv = len(s.link_energy), len(state.velocity)
        doubles = room.view(np.float64)
        self._link_energy = doubles[energies : energies + links] if energies >= 0 else _NOTHING
        self.addresses = Addresses(
            SHEETS,
            data=room,
            words=room.view(np.int32),
            doubles=doubles,
            instructions=np.array(instructions, INSTRUCTION),
            nv=nv,
            link_energy=self._link_energy,
        )

    def write(self, wanted, s, state):
        """Write the messages about a state whose bits are in `wanted`."""
        _, _, effort, newest, oldest, received, estimated = state
        K, power = s.kinetic_energy, s.effort_power
        _write(
            self.addresses.at,
            wanted,
            newest,
            oldest,
            received,
            estimated,
            K,
            0.0 if power is None else power,
            self._base,
            s.rows,
            state.position,
            _NOTHING if effort is None else effort,
            _NOTHING if s.friction is None else s.friction,
        )
        if wanted & WITH_LINK_ENERGY and len(self._link_energy):
            s.write_link_energy(self._link_energy)

    def encoded(self, topic):
        """The message of a topic as it is now."""
        first, last = self.spans[topic]
        return bytes(self._view[first:last])


_NOTHING = np.zeros(0)


def _instructions(template, begin, fields):
    """What of these fields is written where: each :data:`INSTRUCTION` but for its bit.

    Places are those of bytes, of 32-bit words or of doubles, in memory where the template begins at a byte.
    """
    found = []
    for field in template.numbers:
        if field in fields:
            what, row = fields[field]
            size = {_STAMP: 4, _OLDEST: 4, _RECEIVED: 1, _ESTIMATED: 1}.get(what, 8)
            found.append((what, (begin + template.place(field)) // size, row))
        elif field not in CONSTANT | ALONGSIDE:
            raise AssertionError(f"nobody writes {field}")
    return found


sheets_at = SHEETS.opened


@large_kernel
def write(sheets, wanted, written, vectors):
    """Write everything but link energies in messages whose bits are in `wanted`, in Sheets at this address.

    `written` is :class:`Written`, `vectors` :class:`Vectors`.
    """
    at = sheets_at(sheets)
    data, words, doubles, rows, nv = at.data, at.words, at.doubles, vectors.rows, at.nv
    for n in range(len(at.instructions)):
        instruction = at.instructions[n]
        what, k, row = instruction.what, instruction.at, instruction.row
        if not instruction.bit & wanted:
            continue
        if what == _ROW:
            for i in range(nv):
                doubles[k + i] = rows[row, i]
        elif what == _STAMP:
            words[k], words[k + 1] = written.newest // SECOND, written.newest % SECOND
        elif what == _OLDEST:
            words[k], words[k + 1] = written.oldest // SECOND, written.oldest % SECOND
        elif what == _RECEIVED:
            data[k] = written.received
        elif what == _ESTIMATED:
            data[k] = written.estimated
        elif what == _ENERGY:
            doubles[k] = written.energy
        elif what == _POWER:
            doubles[k] = written.power
        elif what == _BASE:
            doubles[k] = 0.0
            for i in range(written.base):
                doubles[k] += 0.5 * rows[NU, i] * rows[NU, i]
        elif what == _SHARES:
            for i in range(nv):
                doubles[k + i] = 0.5 * rows[NU, i] * rows[NU, i]
        elif what == _POSITION:
            _copy(vectors.position, doubles, k)
        elif what == _EFFORT:
            _copy(vectors.effort, doubles, k)
        elif what == _FRICTION:
            _copy(vectors.friction, doubles, k)


@entry_kernel(
    *(COUNT, COUNT, COUNT, COUNT, FLAG, FLAG, NUMBER, NUMBER, COUNT),
    *(MATRIX, VECTOR, VECTOR, VECTOR),
)
def _write(sheets, wanted, newest, oldest, received, estimated, energy, power, base, rows, position, effort, friction):
    """:func:`write`, and nothing else."""
    written = Written(newest, oldest, received, estimated, energy, power, base)
    write(sheets, wanted, written, Vectors(rows, position, effort, friction))


@kernel
def _copy(values, doubles, at):
    for i in range(len(values)):
        doubles[at + i] = values[i]
