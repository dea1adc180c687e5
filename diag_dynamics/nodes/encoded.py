"""What MessageMaker makes, as the bytes that are sent: laid out once, then only the numbers are written anew."""

import numpy as np
from numba import int32, int64, uint8
from rclpy.serialization import serialize_message

from diag_dynamics import sweeps
from diag_dynamics.kernel import COUNT, FLAG, MATRIX, NUMBER, VECTOR, Lent, entry_kernel, kernel, ready
from diag_dynamics.nodes.cdr import HEADER, Template
from diag_dynamics.nodes.inputs.stamps import SECOND
from diag_dynamics.sweeps import NU

_BYTES, _WORDS, _TABLE = Lent(uint8, 1), Lent(int32, 1), Lent(int64, 2)

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

CONSTANT = {"effort_valid", "friction_valid", "power_valid", "model_revision"}
"""Fields that are the same in all messages of one shape."""

ALONGSIDE = {"header.stamp.nanosec", "oldest_stamp.nanosec", "link_energy"}
"""Fields that are written with others, or by themselves."""


class EncodedMessages:
    """Makes what a MessageMaker makes of the same arguments, as bytes.

    Each topic is laid out by what the maker and rclpy make of its first message, and of the first one of another shape (with
    efforts or without). Should rclpy serialize one of them otherwise than :class:`Template` does, the messages themselves are
    returned, of all topics that were asked for together.

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
        self.unlike = set()
        ready(_write)

    def messages(self, topics, s, state):
        """The messages of several topics that are about an Evaluation and the RobotState it came from."""
        key = topics, state.effort is None, s.friction is None
        sheets = self._sheets.get(key)
        if sheets is not None:
            return sheets.written(s, state)
        return self._maker.messages(topics, s, state) if key in self._sheets else self._first(key, topics, s, state)

    def mass_matrix_factors(self, factors, with_inverse, state):
        """M and D of Factors, and ℓ if wanted."""
        values = {"m": factors.m, "d": factors.D} | ({"l": factors.l} if with_inverse else {})
        return self._single("mass_matrix_factors", values, state, factors, with_inverse, state)

    def joint_space_dynamics(self, mass_matrix, bias, gravity, state):
        """M, c and g."""
        values = {"mass_matrix": mass_matrix, "bias": bias, "gravity": gravity}
        return self._single("joint_space_dynamics", values, state, mass_matrix, bias, gravity, state)

    def _first(self, key, topics, s, state):
        """The messages by the maker; the next ones of their shape are written over them."""
        messages = self._maker.messages(topics, s, state)
        templates = [self._template(topic, message) for topic, message in zip(topics, messages, strict=True)]
        self._sheets[key] = _Sheets(templates, s, state) if all(templates) else None
        return [template.encoded() for template in templates] if all(templates) else messages

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


class _Sheets:
    """Templates of several messages about one Evaluation in one piece of memory, written in one pass."""

    def __init__(self, templates, s, state):
        begin, self._spans, table, energies = 0, [], [], []
        for template in templates:
            begin += -begin % 8 + 8 - len(HEADER)  # what comes after the encapsulation begins on a multiple of eight
            self._spans.append((begin, begin + len(template.data)))
            table += _instructions(template, begin)
            if template.place("link_energy") >= 0:
                energies.append((begin + template.place("link_energy")) // 8)
            begin += len(template.data)
        room = np.zeros(begin + 16, dtype=np.uint8)
        room = room[-room.ctypes.data % 8 :]
        for template, (first, last) in zip(templates, self._spans, strict=True):
            room[first:last] = template.data
        doubles = room[: len(room) // 8 * 8].view(np.float64)
        self._memory = room, room[: len(room) // 4 * 4].view(np.int32), doubles, np.array(table, dtype=np.int64)
        self._view = memoryview(room)
        self._link_energies = [doubles[at : at + len(s.link_energy)] for at in energies]
        self._base = 6 if len(state.position) > len(state.velocity) else 0

    def written(self, s, state):
        """All of them, as bytes."""
        _, _, effort, newest, oldest, received, estimated = state
        K, power = s.kinetic_energy, s.effort_power
        _write(
            *self._memory,
            newest,
            oldest,
            received,
            estimated,
            K,
            0.0 if power is None else power,
            s.rows,
            len(state.velocity),
            self._base,
            state.position,
            _NOTHING if effort is None else effort,
            _NOTHING if s.friction is None else s.friction,
        )
        for energy in self._link_energies:
            s.write_link_energy(energy)
        view = self._view
        return [bytes(view[first:last]) for first, last in self._spans]


_NOTHING = np.zeros(0)


def _instructions(template, begin):
    """What is written where: rows for :func:`_write`.

    Places are those of bytes, of 32-bit words or of doubles, in memory where the template begins at a byte.
    """
    found = []
    for field in template.numbers:
        if field in FIELDS:
            what, row = FIELDS[field]
            size = {_STAMP: 4, _OLDEST: 4, _RECEIVED: 1, _ESTIMATED: 1}.get(what, 8)
            found.append((what, (begin + template.place(field)) // size, row))
        elif field not in CONSTANT | ALONGSIDE:
            raise AssertionError(f"nobody writes {field}")
    return found


@entry_kernel(
    *(_BYTES, _WORDS, VECTOR, _TABLE),
    *(COUNT, COUNT, FLAG, FLAG, NUMBER, NUMBER),
    *(MATRIX, COUNT, COUNT, VECTOR, VECTOR, VECTOR),
)
def _write(
    data,
    words,
    doubles,
    table,
    newest,
    oldest,
    received,
    estimated,
    energy,
    power,
    rows,
    count,
    base,
    position,
    effort,
    friction,
):
    """Write everything that `table` has a place for."""
    for k in range(len(table)):
        what, at, row = table[k, 0], table[k, 1], table[k, 2]
        if what == _ROW:
            for i in range(count):
                doubles[at + i] = rows[row, i]
        elif what == _STAMP:
            words[at], words[at + 1] = newest // SECOND, newest % SECOND
        elif what == _OLDEST:
            words[at], words[at + 1] = oldest // SECOND, oldest % SECOND
        elif what == _RECEIVED:
            data[at] = received
        elif what == _ESTIMATED:
            data[at] = estimated
        elif what == _ENERGY:
            doubles[at] = energy
        elif what == _POWER:
            doubles[at] = power
        elif what == _BASE:
            doubles[at] = 0.0
            for i in range(base):
                doubles[at] += 0.5 * rows[NU, i] * rows[NU, i]
        elif what == _SHARES:
            for i in range(count):
                doubles[at + i] = 0.5 * rows[NU, i] * rows[NU, i]
        elif what == _POSITION:
            _copy(position, doubles, at)
        elif what == _EFFORT:
            _copy(effort, doubles, at)
        elif what == _FRICTION:
            _copy(friction, doubles, at)


@kernel
def _copy(values, doubles, at):
    for i in range(len(values)):
        doubles[at + i] = values[i]
