"""What MessageMaker makes, as the bytes that are sent: laid out once, then only the numbers are written anew."""

import numpy as np
from numba import int32, int64, uint8
from rclpy.serialization import serialize_message

from diag_dynamics import sweeps
from diag_dynamics.kernel import COUNT, FLAG, MATRIX, VECTOR, Lent, entry_kernel
from diag_dynamics.nodes.cdr import Template
from diag_dynamics.nodes.inputs.stamps import SECOND
from diag_dynamics.nodes.messages import power_of

_BYTES, _WORDS, _INDICES = Lent(uint8, 1), Lent(int32, 1), Lent(int64, 1)

_NO_ROWS = np.zeros((0, 0))

ROWS = {
    "total_joint_rates": {"nu": sweeps.NU, "xi": sweeps.XI},
    "working_moments": {"epsilon": sweeps.EPSILON, "kappa": sweeps.KAPPA},
    "coriolis": {
        "coriolis": sweeps.CORIOLIS,
        "coriolis_unnormalized": sweeps.CORIOLIS_UNNORMALIZED,
        "gravity": sweeps.GRAVITY,
    },
    "state": {
        "nu": sweeps.NU,
        "xi": sweeps.XI,
        "epsilon": sweeps.EPSILON,
        "kappa": sweeps.KAPPA,
        "coriolis": sweeps.CORIOLIS,
        "gravity": sweeps.GRAVITY,
        "articulated_inertia": sweeps.ARTICULATED_INERTIA,
    },
}
"""Fields by topic that are rows of an Evaluation, copied in one pass; all others are written one by one."""


class EncodedMessages:
    """Makes what a MessageMaker makes of the same arguments, as bytes.

    Each topic is laid out by what the maker and rclpy make of its first message, and of the first one of another shape (with
    efforts or without). Should rclpy not serialize as :class:`Template` does, the messages themselves are returned.

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
        self._sheets = {}
        self.unlike = set()

    def total_joint_rates(self, s, state):
        """ν and ξ of an Evaluation."""
        sheet = self._sheets.get(("total_joint_rates", 0))
        if sheet is None:
            return self._first("total_joint_rates", 0, s, state)
        sheet.begin(state, s.rows)
        return sheet.encoded()

    def working_moments(self, s, state):
        """ε and κ, empty where the effort is unknown."""
        shape = state.effort is not None
        sheet = self._sheets.get(("working_moments", shape))
        if sheet is None:
            return self._first("working_moments", shape, s, state)
        sheet.begin(state, s.rows)
        return sheet.encoded()

    def coriolis(self, s, state):
        """C, C_ξ and ε_g."""
        shape = s.friction is not None
        sheet = self._sheets.get(("coriolis", shape))
        if sheet is None:
            return self._first("coriolis", shape, s, state)
        sheet.begin(state, s.rows)
        if shape:
            sheet.write("friction", s.friction)
        return sheet.encoded()

    def kinetic_energy(self, s, state):
        """K, its two splits and its rate."""
        sheet = self._sheets.get(("kinetic_energy", 0))
        if sheet is None:
            return self._first("kinetic_energy", 0, s, state)
        sheet.begin(state, s.rows)
        sheet.write("total", s.kinetic_energy)
        sheet.write("energy_share", s.energy_share)
        sheet.write("base_energy", s.base_energy)
        sheet.write("link_energy", s.link_energy)
        sheet.write("power_valid", state.effort is not None)
        sheet.write("power", power_of(s))
        return sheet.encoded()

    def mass_matrix_factors(self, factors, with_inverse, state):
        """M and D of Factors, and ℓ if wanted."""
        sheet = self._sheets.get(("mass_matrix_factors", with_inverse))
        if sheet is None:
            return self._first("mass_matrix_factors", with_inverse, factors, with_inverse, state)
        sheet.begin(state)
        sheet.write("m", factors.m.ravel())
        sheet.write("d", factors.D)
        if with_inverse:
            sheet.write("l", factors.l.ravel())
        return sheet.encoded()

    def joint_space_dynamics(self, mass_matrix, bias, gravity, state):
        """M, c and g."""
        sheet = self._sheets.get(("joint_space_dynamics", 0))
        if sheet is None:
            return self._first("joint_space_dynamics", 0, mass_matrix, bias, gravity, state)
        sheet.begin(state)
        sheet.write("mass_matrix", mass_matrix.ravel())
        sheet.write("bias", bias)
        sheet.write("gravity", gravity)
        return sheet.encoded()

    def state(self, s, state):
        """One evaluation, whole, with the RobotState it came from."""
        shape = (state.effort is not None, s.friction is not None)
        sheet = self._sheets.get(("state", shape))
        if sheet is None:
            return self._first("state", shape, s, state)
        sheet.begin(state, s.rows)
        sec, nanosec = divmod(state.oldest, SECOND)
        sheet.write("oldest_stamp.sec", sec)
        sheet.write("oldest_stamp.nanosec", nanosec)
        sheet.write("position", state.position)
        sheet.write("velocity", state.velocity)
        if state.effort is not None:
            sheet.write("effort", state.effort)
        if s.friction is not None:
            sheet.write("friction", s.friction)
        sheet.write("kinetic_energy", s.kinetic_energy)
        sheet.write("power", power_of(s))
        return sheet.encoded()

    def _first(self, topic, shape, *arguments):
        """Lay out a topic's message by the first one of its shape; returns that."""
        message = getattr(self._maker, topic)(*arguments)
        if topic in self.unlike:
            return message
        template = Template(message)
        if not template.holds(serialize_message(message)):
            self.unlike.add(topic)
            return message
        sheet = self._sheets[topic, shape] = _Sheet(template, ROWS.get(topic, {}))
        return sheet.encoded()


class _Sheet:
    """A template, and how its numbers are written."""

    def __init__(self, template, rows):
        self._numbers, self.encoded = template.numbers, template.encoded
        filled = {field: row for field, row in rows.items() if template.place(field) >= 0}  # not those that are empty
        places = [template.place(flag) for flag in ("stamp_is_receive_time", "velocity_estimated")]
        self._layout = (
            template.data,
            template.words,
            template.doubles,
            np.array(places),
            np.array([template.first_double(field) for field in filled], dtype=np.int64),
            np.array(list(filled.values()), dtype=np.int64),
        )

    def begin(self, state, rows=_NO_ROWS):
        """Write what all messages have, and the rows of an Evaluation."""
        _write(
            *self._layout,
            state.newest,
            state.stamp_is_receive_time,
            state.velocity_estimated,
            len(state.velocity),
            rows,
        )

    def write(self, field, values):
        """Write one number or a sequence; nothing if it is empty."""
        if field in self._numbers:
            self._numbers[field][:] = values


@entry_kernel(_BYTES, _WORDS, VECTOR, _INDICES, _INDICES, _INDICES, COUNT, FLAG, FLAG, COUNT, MATRIX)
def _write(data, words, doubles, flags, places, chosen, newest, received, estimated, count, rows):
    """Write stamp and flags, and `count` numbers of each of the chosen rows at its place."""
    words[0], words[1] = newest // SECOND, newest % SECOND
    if flags[0] >= 0:
        data[flags[0]] = received
    if flags[1] >= 0:
        data[flags[1]] = estimated
    for k in range(len(chosen)):
        for i in range(count):
            doubles[places[k] + i] = rows[chosen[k], i]
