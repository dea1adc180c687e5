# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recording that is read several times: what has to be known of it first, and its states whenever they are wanted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from diag_dynamics.checks import instance
from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.segments import SIZE, in_portions, since, without_delay
from diag_dynamics.identification.sifting import Sifter
from diag_dynamics.identification.velocities import Velocities
from diag_dynamics.recordings.account import Finding, without_efforts, without_states
from diag_dynamics.recordings.effort_checks import EffortRange
from diag_dynamics.recordings.recording import Recording
from diag_dynamics.recordings.refused_units import refuse_units


def several(name, given):
    """What was given, as a list of recordings: each a Recording, or a callable that yields the pieces of one.

    Raises
    ------
    InputError
        There is none, or something else among them.
    """
    one_by_one = given if isinstance(given, Iterable) else [given]
    found = [one_by_one] if isinstance(given, Iterator) else list(one_by_one)
    if not found:
        raise InputError(f"{name} is empty, expected one recording or more.")
    for k, one in enumerate(found):
        if isinstance(one, Iterator):
            raise InputError(
                f"{name}{'' if one is given else f'[{k}]'} is {one!r}, which can be read once, and identification reads a "
                "recording several times: give a function that begins anew, as lambda: dd.stream_recording(path, model), or "
                "a list of these or of recordings."
            )
        if not callable(one):
            instance(f"{name}[{k}]", one, Recording)
    return found


class Prepared:
    """A recording, ready to be fitted. To make one reads it once.

    Parameters
    ----------
    name : str
        Of the argument.
    recording : Recording or callable
    model : RobotModel

    Attributes
    ----------
    path : str or None
    robot : str
        Its name.
    states : int
        How many there are, left out ones too.
    start, end : float
        Times of the first and of the last one, as in the recording [s].
    zero : int
        Stamp of the first one [ns].
    delay : float
        Of velocities, that is taken out; 0 if it is less than a sample [s].
    spans : list of tuple of float
        Begin and end of each segment, to a sample, in times of :class:`Segment` [s].
    findings : list of Finding

    Raises
    ------
    InputError
        It is of another robot, has no efforts, or velocities in other units, or too little is left of it.
    """

    def __init__(self, name, recording, model):
        self._name, self._recording, self._model = name, recording, model
        self.path, self.robot, self.states = None, model.name, 0
        self.start = self.end = 0.0
        self.zero, self.delay = 0, 0.0
        sifter, velocities, spans = Sifter(model), Velocities(model), []
        self._counts, self._refused, self._with_efforts, self._estimated = {}, [], False, 0
        self._efforts = EffortRange(model.dof_names)
        for states, begins in in_portions(sifter.sifted(self._noted())):
            velocities.take(states, begins)
            if begins:
                spans.append([states.t[0], states.t[-1]])
            spans[-1][1] = states.t[-1]
        refuse_units(self._refused)
        if not self.states:
            raise without_states(self._name, self._refused)
        unmeasured = self._efforts.complaint()
        if unmeasured:
            raise InputError(f"{unmeasured}. Record the efforts of these joints, or lock the joints (locked_joints).")
        if not self._with_efforts:
            raise InputError(f"{without_efforts(self._counts)}, without which nothing can be identified.")
        self.findings = sifter.findings()
        if self._estimated:
            text = "velocities were estimated from positions: those of the driver would be better"
            self.findings.append(Finding("velocity estimated", self._estimated, text))
        found = velocities.delay()
        if abs(found) > sifter.sample:
            self.delay = found
            late = "late" if found > 0.0 else "early"
            text = f"velocities are {abs(found) * 1e3:.1f} ms {late} against positions, which was taken out"
            self.findings.append(Finding("velocity delay", 1, text))
        head, tail = max(0.0, -self.delay), max(0.0, self.delay)  # which have no velocities of their time
        self.spans = [(begin + head, end - tail) for begin, end in spans if end - tail > begin + head]
        if not self.spans:
            raise InputError(
                f"{name} has no segment that is longer than the delay of its velocities, {found * 1e3:.1f} ms."
            )

    @property
    def duration(self):
        """Time in segments [s]."""
        return sum(end - begin for begin, end in self.spans)

    def portions(self, begin=None):
        """Yield all that can be fitted, or what of it is not before a time [s], in portions; reads the recording anew.

        Raises
        ------
        InputError
            There are other states than the first time.
        """
        portions = without_delay(Sifter(self._model).sifted(self._again()), self.delay)
        return in_portions(portions if begin is None else since(portions, begin))

    def _pieces(self):
        """Pieces of the recording."""
        given = self._recording if isinstance(self._recording, Recording) else self._recording()
        if isinstance(given, Recording):
            yield given
            return
        if not isinstance(given, Iterable):
            raise InputError(f"{self._name} returns {given!r}, expected pieces of a recording.")
        for piece in given:
            yield instance(f"a piece of {self._name}", piece, Recording)

    def _noted(self):
        """States, piece by piece; takes note of what is said of them."""
        for piece in self._pieces():
            if piece.model.dof_names != self._model.dof_names:
                raise InputError(
                    f"{self._name} is of robot '{piece.model.name}', whose degrees of freedom are not those of the model."
                )
            self._counts, self._refused = piece.counts, piece.findings
            self._with_efforts |= piece.tau is not None
            self._estimated += int(piece.states.velocity_estimated.sum())
            if len(piece):
                if not self.states:
                    self.path, self.robot = piece.path, piece.model.name
                    self.start, self.zero = float(piece.t[0]), int(piece.stamp[0])
                self.states, self.end = self.states + len(piece), float(piece.t[-1])
            self._efforts.take(piece.states.position[:, -piece.model.nv :], piece.states.effort)
            yield from _small(piece.states)

    def _again(self):
        """States, piece by piece."""
        number = 0
        for piece in self._pieces():
            number += len(piece)
            yield from _small(piece.states)
        if number != self.states:
            raise InputError(
                f"{self._name} has {number} states when it is read again, and had {self.states}: a file must be written to "
                "its end before it is read, and a function must begin anew whenever it is called, as lambda: "
                "dd.stream_recording(path, model) does."
            )


def _small(states):
    """Yield states so many at a time that what is made of them needs little memory."""
    for first in range(0, len(states), SIZE):
        yield states[first : first + SIZE]
