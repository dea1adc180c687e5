# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Effort that models leave unexplained over a recording of any length, as curves to be drawn."""

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.identification.judgement import states_of
from diag_dynamics.identification.segments import in_portions
from diag_dynamics.identification.sifting import Sifter
from diag_dynamics.recordings.observer import Observer

MOST = 6000
"""Steps of a curve, an even number: ten times the pixels that they are drawn on."""


def unexplained(models, pieces, gain):
    """External torque that an observer sees where there was none, by each of several models.

    Parameters
    ----------
    models : sequence of RobotModel
        Of one robot.
    pieces : iterable of Recording
        Of one recording.
    gain : float
        Of the observer [1/s].

    Returns
    -------
    time : ndarray, shape (T,)
        From the first state, rising though stamps began anew in between [s].
    torques : list of ndarray, shape (T, nv)
        Of each model [N m, N]; rows of NaN where nothing is known.
    """
    dynamics = [DiagonalDynamics(model) for model in models]
    observers = [Observer(one, gain, friction=True) for one in dynamics]
    curves = Curves()
    for states, begins in in_portions(Sifter(models[0]).sifted(piece.states for piece in pieces)):
        torques = []
        for one, observer in zip(dynamics, observers, strict=True):
            s = one.evaluate_batch(states.q, states.qd, states.tau, friction=True)
            torques.append(observer.take(states_of(states, begins), s)[1])
        curves.take(states.t, np.hstack(torques), begins)
    time, values = curves.drawn()
    return time, np.split(values, len(models), axis=1)


class Curves:
    """Takes in columns over time, and keeps their smallest and largest values over steps of equally many rows."""

    def __init__(self):
        self._each = 1  # rows of a step
        self._rows = self._steps = None  # that are no step yet; and steps

    def take(self, time, values, begins):
        """Take in rows: times [s], shape (T,), values, shape (T, n), and whether the first one comes after a gap."""
        gap = np.zeros(len(time), dtype=bool)
        gap[0] = begins
        rows = time, values, values, gap
        self._rows = rows if self._rows is None else _together(self._rows, rows)
        if self._steps is None:
            self._steps = _part(rows, slice(0))
        while count := min(len(self._rows[0]) // self._each, MOST - len(self._steps[0])):
            end = count * self._each
            self._steps = _together(self._steps, _merged(_part(self._rows, slice(end)), self._each))
            self._rows = _part(self._rows, slice(end, None))
            if len(self._steps[0]) == MOST:
                self._steps, self._each = _merged(self._steps, 2), 2 * self._each

    def drawn(self):
        """Times and values of lines: the smallest and the largest of each step; NaN in gaps."""
        steps = self._steps
        if rest := len(self._rows[0]):
            steps = _together(steps, _merged(self._rows, rest))
        time, low, high, gap = steps
        wide = 1 + (self._each > 1)
        lines = np.stack([low, high], axis=1)[:, :wide].reshape(-1, low.shape[1])
        gaps = np.flatnonzero(gap[1:]) + 1
        return np.insert(np.repeat(time, wide), wide * gaps, time[gaps]), np.insert(lines, wide * gaps, np.nan, axis=0)


def _part(rows, which):
    return tuple(column[which] for column in rows)


def _together(rows, others):
    return tuple(map(np.concatenate, zip(rows, others, strict=True)))


def _merged(rows, each):
    """Rows, so many in one; one with a gap is of the time after it."""
    time, low, high, gap = (column.reshape(-1, each, *column.shape[1:]) for column in rows)
    after = np.where(gap.any(axis=1), each - 1 - np.argmax(gap[:, ::-1], axis=1), 0)
    smallest, largest = np.fmin.reduce(low, axis=1), np.fmax.reduce(high, axis=1)
    return time[np.arange(len(time)), after], smallest, largest, gap.any(axis=1)
