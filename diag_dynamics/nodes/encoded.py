"""What MessageMaker makes, as the bytes that are sent: laid out once, then only the numbers are written anew."""

import numpy as np
from numba import int32, int64, uint8
from rclpy.serialization import serialize_message

from diag_dynamics import sweeps
from diag_dynamics.kernel import COUNT, FLAG, MATRIX, NUMBER, VECTOR, Lent, entry_kernel, ready
from diag_dynamics.nodes.cdr import HEADER, Template
from diag_dynamics.nodes.inputs.stamps import SECOND
from diag_dynamics.sweeps import NU

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
        "velocity": sweeps.RATES,
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
        ready(_write)

    def total_joint_rates(self, s, state):
        """ν and ξ of an Evaluation."""
        sheet = self._sheets.get(("total_joint_rates", 0))
        if sheet is None:
            return self._first("total_joint_rates", 0, s, state)
        sheet.begin(state, s)
        return sheet.encoded()

    def working_moments(self, s, state):
        """ε and κ, empty where the effort is unknown."""
        shape = state.effort is not None
        sheet = self._sheets.get(("working_moments", shape))
        if sheet is None:
            return self._first("working_moments", shape, s, state)
        sheet.begin(state, s)
        return sheet.encoded()

    def coriolis(self, s, state):
        """C, C_ξ and ε_g."""
        shape = s.friction is not None
        sheet = self._sheets.get(("coriolis", shape))
        if sheet is None:
            return self._first("coriolis", shape, s, state)
        sheet.begin(state, s)
        if shape:
            sheet.write("friction", s.friction)
        return sheet.encoded()

    def kinetic_energy(self, s, state):
        """K, its two splits and its rate."""
        sheet = self._sheets.get(("kinetic_energy", 0))
        if sheet is None:
            return self._first("kinetic_energy", 0, s, state)
        sheet.begin(state, s)
        sheet.write("base_energy", s.base_energy)
        s.write_link_energy(sheet.view("link_energy"))
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
        sheet.begin(state, s)
        sheet.write("position", state.position)
        if state.effort is not None:
            sheet.write("effort", state.effort)
        if s.friction is not None:
            sheet.write("friction", s.friction)
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
        energy = "total" if template.place("total") >= 0 else "kinetic_energy"
        at = [
            *(template.place(flag) for flag in ("stamp_is_receive_time", "velocity_estimated", "power_valid")),
            (template.place("oldest_stamp.sec") - len(HEADER)) // 4,
            *(template.first_double(field) for field in (energy, "power", "energy_share")),
            *(place for field, row in filled.items() for place in (template.first_double(field), row)),
        ]
        self._layout = template.data, template.words, template.doubles, np.array(at, dtype=np.int64)

    def begin(self, state, s=None):
        """Write what all messages have, and of an Evaluation the rows and the energy."""
        K, power, rows = (s.kinetic_energy, s.effort_power, s.rows) if s else (0.0, None, _NO_ROWS)
        _write(
            *self._layout,
            state.newest,
            state.oldest,
            state.stamp_is_receive_time,
            state.velocity_estimated,
            power is not None,
            len(state.velocity),
            K,
            power or 0.0,
            rows,
        )

    def view(self, field):
        """Where a number or a sequence is written."""
        return self._numbers[field]

    def write(self, field, values):
        """Write one number or a sequence; nothing if it is empty."""
        if field in self._numbers:
            self._numbers[field][:] = values


@entry_kernel(_BYTES, _WORDS, VECTOR, _INDICES, COUNT, COUNT, FLAG, FLAG, FLAG, COUNT, NUMBER, NUMBER, MATRIX)
def _write(data, words, doubles, at, newest, oldest, received, estimated, valid, count, energy, power, rows):
    """Write stamps, flags, energies and `count` numbers of each row wherever there is a place for it in `at`.

    First come the places of what is named below, -1 for none, then pairs of a place and the row that goes there.
    """
    words[0], words[1] = newest // SECOND, newest % SECOND
    if at[0] >= 0:
        data[at[0]] = received
    if at[1] >= 0:
        data[at[1]] = estimated
    if at[2] >= 0:
        data[at[2]] = valid
    if at[3] >= 0:
        words[at[3]], words[at[3] + 1] = oldest // SECOND, oldest % SECOND
    if at[4] >= 0:
        doubles[at[4]] = energy
    if at[5] >= 0:
        doubles[at[5]] = power
    if at[6] >= 0:
        for i in range(count):
            doubles[at[6] + i] = 0.5 * rows[NU, i] * rows[NU, i]
    for k in range(7, len(at), 2):
        for i in range(count):
            doubles[at[k] + i] = rows[at[k + 1], i]
