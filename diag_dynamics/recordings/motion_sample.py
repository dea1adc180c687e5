# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""States of a recording in motion, as many as its efforts are judged by where the balance of power is bad."""

import numpy as np

from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.recordings.effort_causes import complaint
from diag_dynamics.recordings.effort_relation import EffortRelation, Run
from diag_dynamics.recordings.explained import MAX_GAP

MAX_STATES = 20_000
"""States that are kept, the first ones."""

MOVING = 0.01
"""Velocity of any joint above which the robot is in motion [rad/s, m/s]."""

MIN_RUN = 20
"""States of a run without gaps; fewer are left out."""


class MotionSample:
    """Keeps states with efforts in motion.

    Parameters
    ----------
    model : RobotModel

    Attributes
    ----------
    columns : list of ndarray
        Stamps [ns], whether a state begins a run, positions, velocities and efforts.
    """

    def __init__(self, model):
        self._model = model
        widths = (), (), (model.nq,), (model.nv,), (model.nv,)
        kinds = np.int64, bool, float, float, float
        self.columns = [np.zeros((0, *width), kind) for width, kind in zip(widths, kinds, strict=True)]
        self._possible = not model.floating_base and model.nq == model.nv > 0

    def take(self, states):
        """Take in states."""
        room = MAX_STATES - len(self.columns[0])
        if room <= 0 or not self._possible:
            return
        kept = states.effort_known & (np.abs(states.velocity) > MOVING).any(axis=1)
        kept = np.flatnonzero(kept & np.isfinite(states.effort).all(axis=1))[:room]
        more = states.stamp, states.jumped, states.position, states.velocity, states.effort
        self.columns = [np.concatenate([old, new[kept]]) for old, new in zip(self.columns, more, strict=True)]

    def add(self, other):
        """Take in what another one has."""
        room = MAX_STATES - len(self.columns[0])
        self.columns = [np.concatenate([old, new[:room]]) for old, new in zip(self.columns, other.columns, strict=True)]

    def complaint(self):
        """Return what is wrong with the efforts, a Cause; None where nothing is, or nothing can be said."""
        compared = EffortRelation(self._model)
        for run in self._runs():
            compared.take(run)
        return complaint(compared, compared.relation())

    def _runs(self):
        """Yield runs of states without gaps."""
        stamps, begins, *columns = self.columns
        if not len(stamps):
            return
        steps = np.diff(stamps)
        bounds = np.flatnonzero((steps < 0) | (steps > MAX_GAP * SECOND) | begins[1:]) + 1
        for part in np.split(np.arange(len(stamps)), bounds):
            part = part[np.diff(stamps[part], prepend=stamps[part[0]] - 1) > 0]
            if len(part) >= MIN_RUN:
                yield Run((stamps[part] - stamps[part[0]]) / SECOND, *(column[part] for column in columns))
