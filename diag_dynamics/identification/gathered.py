# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows of an identification: those that are fitted, by blocks, and those that are held out to judge the fit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diag_dynamics.identification.cross_validation import Cut
from diag_dynamics.identification.equations import Equations
from diag_dynamics.identification.judgement import Judge
from diag_dynamics.identification.suitability import Efforts, Excitation

RATE = 2.0 * np.pi
"""λ of the filter [1/s]: 1 Hz. At 3 Hz the noise of velocities biases the columns."""

HELD_OUT = 1.0 / 3.0
"""Part of the recordings that a fit is judged by."""


class HeldOut(NamedTuple):
    """What the part held out says."""

    verdicts: list
    """Of each model that was judged: a Verdict."""
    stamps: tuple
    """Of its first and of its last state [ns]."""
    duration: float
    """From the one to the other, where stamps went back one behind the other [s]."""


class Gathered:
    """Sums over rows of recordings, each of which is read once for them.

    Parameters
    ----------
    model : RobotModel
    carriers : sequence of int
        Bodies that may have a payload.
    loaded, unloaded : list of Prepared
        Recordings with the payload, if there is one; and without it.
    tolerant : bool
        Whether the robot of the loaded ones may carry what the model does not.

    Attributes
    ----------
    equations : Equations
    loaded, unloaded : list of Prepared
    bounds : list of Sums
        Of the rows that are fitted first: before each block, and of all of them.
    held, whole : Sums
        Of the part held out; and of all rows of the loaded recordings.
    beside : Sums or None
        Of the unloaded ones.
    excitation : Excitation
        Of all recordings.
    relations : list of Relation
        Of the efforts of each recording to the torques of the model.
    begin : float
        Where the part held out begins, in times of the last loaded recording: of that a third of all time, or the whole of it
        if that is less [s].

    Raises
    ------
    InputError
        Efforts of a recording cannot be in SI units, or hold no gravity.
    """

    def __init__(self, model, carriers, loaded, unloaded, tolerant):
        self._model, self.loaded, self.unloaded = model, loaded, unloaded
        self.excitation, self.relations = Excitation(model), []
        self.begin, early = self._split()
        self.equations = Equations(model, RATE, model.friction_velocity, carriers)
        cut, self.bounds, block = Cut(early), [self.equations.sums()], 0
        for one in loaded:
            held_from = self.begin if one is loaded[-1] else np.inf
            for states, begins in self._suitable(one, tolerant):
                for number, part, anew in cut.take(states, begins, held_from):
                    if number != block:
                        self.bounds.append(self.equations.sums())
                        block = number
                    self.equations.take(part, anew)
        self.whole = self.equations.sums()
        if block != cut.held_out:
            self.bounds.append(self.whole)
        self.held = self.whole - self.bounds[-1]
        self.beside = None
        if unloaded:
            alone = Equations(model, RATE, model.friction_velocity, carriers)
            for one in unloaded:
                for states, begins in self._suitable(one, False):
                    alone.take(states, begins)
            self.beside = alone.sums()

    def _suitable(self, one, tolerant):
        """Yield portions of a recording; efforts and motion are judged in passing, and the efforts refused at the end."""
        efforts = Efforts(self._model)
        for states, begins in one.portions():
            efforts.take(states)
            self.excitation.take(states, begins)
            yield states, begins
        efforts.judge(tolerant, one.findings)
        self.relations.append(efforts.relation)

    def _split(self):
        """Where the part held out begins, and the time before it [s]."""
        last = self.loaded[-1]
        total = sum(one.duration for one in self.loaded)
        held = min(HELD_OUT * total, last.duration if len(self.loaded) > 1 else total)
        remaining = held
        for begin, end in reversed(last.spans):
            if end - begin >= remaining:
                return end - remaining, total - held
            remaining -= end - begin
        return last.spans[0][0], total - held

    def findings(self):
        """Of all recordings."""
        return [finding for one in (*self.loaded, *self.unloaded) for finding in one.findings]

    def judged(self, subjects):
        """Judge models by the part held out, which is read once more for that.

        Parameters
        ----------
        subjects : list of tuple
            Model and friction of each, see :class:`Judge`.

        Returns
        -------
        HeldOut
        """
        judges, first, last = [Judge(*one) for one in subjects], None, None
        for states, begins in self.loaded[-1].portions(self.begin):
            first, last = first or (states.stamp[0], states.t[0]), (states.stamp[-1], states.t[-1])
            for judge in judges:
                judge.take(states, begins)
        stamps = int(first[0]), int(last[0])
        return HeldOut([judge.verdict() for judge in judges], stamps, float(last[1] - first[1]))
