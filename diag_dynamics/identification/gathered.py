# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows of an identification: those that are fitted, by blocks, and those that are held out to judge the fit."""

from __future__ import annotations

import numpy as np

from diag_dynamics.identification.cross_validation import Blocks
from diag_dynamics.identification.equations import Equations
from diag_dynamics.identification.fit import Layout, Rows
from diag_dynamics.identification.segments import duration

RATE = 2.0 * np.pi
"""λ of the filter [1/s]: 1 Hz. At 3 Hz the noise of velocities biases the columns."""

HELD_OUT = 1.0 / 3.0
"""Part of the recordings that a fit is judged by."""


class Gathered:
    """Sums over rows of recordings.

    Parameters
    ----------
    model : RobotModel
    payload : Payload or None
    loaded, unloaded : list of list of Segment
        Of each recording with the payload, if there is one; and without it.

    Attributes
    ----------
    layout : Layout
    begin : float
        Where the part held out begins, in times of the last loaded recording: of that a third of all time, or the whole of it
        if that is less [s].
    held : list of Segment
        States of the part held out.
    blocks : Blocks
        Of the rows that are fitted first, but those of `beside`.
    beside, held_rows, all_rows : list of Rows
        Of the recordings without the payload; of the part held out; and of everything.
    """

    def __init__(self, model, payload, loaded, unloaded):
        self._split(loaded)
        carrier = [payload.body] if payload else []
        equations = Equations(model, RATE, model.friction_velocity, carrier)
        self.layout = Layout(model, equations, payload)
        early = [segment for segments in loaded[:-1] for segment in segments]
        anew = True
        for segment in loaded[-1]:
            part = segment.part(segment.t < self.begin)
            if len(part.t):
                early.append(part)
                anew = len(part.t) == len(segment.t)
        carries = payload is not None
        self.blocks = Blocks(equations, early, carries)
        for segment in loaded[-1]:
            late = segment.part(segment.t >= self.begin)
            if len(late.t):
                equations.take(late, anew)
                anew = True
        whole = equations.sums()
        self.beside = []
        if unloaded:
            alone = Equations(model, RATE, model.friction_velocity, carrier)
            for segments in unloaded:
                for segment in segments:
                    alone.take(segment)
            self.beside = [Rows(alone.sums(), False)]
        self.held_rows = [Rows(whole - self.blocks.sums, carries)]
        self.all_rows = [Rows(whole, carries), *self.beside]

    def _split(self, loaded):
        last = loaded[-1]
        total = sum(duration(segments) for segments in loaded)
        held = min(HELD_OUT * total, duration(last) if len(loaded) > 1 else total)
        remaining = held
        for segment in reversed(last):
            length = segment.t[-1] - segment.t[0]
            if length >= remaining:
                self.begin = float(segment.t[-1] - remaining)
                break
            remaining -= length
        else:
            self.begin = float(last[0].t[0])
        self.held = [part for segment in last if len((part := segment.part(segment.t >= self.begin)).t) > 1]
