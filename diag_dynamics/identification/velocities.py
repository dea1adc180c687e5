# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether velocities are those of the positions: their units, and by how much they are late."""

import numpy as np

from diag_dynamics.exceptions import InputError

INCREMENT = 0.05
"""Time over which positions are compared with integrated velocities [s]."""

TOLERANCE = 0.02
"""Distance from 1 of the slope of positions over integrated velocities that is accepted."""

LEAST_CORRELATION = 0.7
"""Correlation of the two without which a joint moves too little to be judged."""

DELAYS = np.arange(-20.0, 40.5, 0.5) * 1e-3
"""Delays of velocities against positions that are tried [s]."""

UNITS = (
    (-1.0, "of the other sign"),
    (np.pi / 180.0, "in degrees per second"),
    (np.pi / 30.0, "in revolutions per minute"),
    (2.0 * np.pi, "in revolutions per second"),
    (180.0 / np.pi, "right, and positions in degrees"),
    (1e-3, "in mm/s or mrad/s"),
    (1e3, "right, and positions in mm or mrad"),
)
"""Slopes of positions over integrated velocities, and what velocities then are."""

PART = 1000
"""Increments that are looked at together: all delays of them take memory."""

TINY = 1e-30
"""Sum of squares of a joint that does not move [rad², m²]."""


class Velocities:
    """Compares positions with integrated velocities, portion by portion.

    Parameters
    ----------
    model : RobotModel
    """

    def __init__(self, model):
        self._names = model.dof_names
        coupled = {joint for group in model.coupled_groups for joint in group}
        self._turning = np.array([name in model.continuous_joints and name not in coupled for name in model.dof_names])
        self._size, self._product, self._square = np.zeros(model.nv), *np.zeros((2, len(DELAYS), model.nv))
        self._t, self._q, self._integral = None, None, None  # of the segment, as far as further increments need them
        self._qd, self._begin, self._number = (
            None,
            0.0,
            0,
        )  # its last velocities, time 0 of its grid, and its next point

    def take(self, states, begins):
        """Take in a Portion."""
        t, q, qd = states.t, states.q, states.qd
        if begins:
            integral = np.zeros_like(qd[:1])
            self._begin, self._number = t[0] - DELAYS[0], 0
        else:
            t, qd = np.r_[self._t[-1], t], np.r_[self._qd, qd]
            q, integral = np.r_[self._q[-1:], q], self._integral[-1:]
        q = q.copy()
        q[:, self._turning] = np.unwrap(q[:, self._turning], axis=0)
        steps = 0.5 * (qd[1:] + qd[:-1]) * np.diff(t)[:, None]
        columns = t, q, np.cumsum(np.r_[integral, steps], axis=0)
        if not begins:
            columns = (
                np.r_[old[:-1], new] for old, new in zip((self._t, self._q, self._integral), columns, strict=True)
            )
        self._t, self._q, self._integral = columns
        self._qd = qd[-1:]
        self._compare()

    def _compare(self):
        """Take in the increments that are known by now."""
        last = self._t[-1] - DELAYS[-1] - self._begin
        if self._number == 0 and last < 2.0 * INCREMENT:
            return
        end = int(np.ceil(last / INCREMENT))  # first point of the grid that is too late
        for first in range(self._number, end - 1, PART):
            some = self._begin + INCREMENT * np.arange(first, min(first + PART + 1, end))
            q = np.column_stack([np.interp(some, self._t, column) for column in self._q.T])
            at = some + DELAYS[:, None]
            values = np.stack([np.interp(at, self._t, column) for column in self._integral.T], axis=-1)
            increments, integrals = np.diff(q, axis=0), np.diff(values, axis=1)
            self._size += (increments**2).sum(axis=0)
            self._product += (integrals * increments).sum(axis=1)
            self._square += (integrals**2).sum(axis=1)
        self._number = max(self._number, end - 1)
        oldest = self._begin + INCREMENT * self._number + DELAYS[0]
        past = max(0, int(np.searchsorted(self._t, oldest, side="right")) - 1)
        self._t, self._q, self._integral = self._t[past:], self._q[past:], self._integral[past:]

    def delay(self):
        """Delay of velocities against positions [s], where both are of the same units.

        Raises
        ------
        InputError
            Positions of a joint do not change as its velocity says.
        """
        size, product, square = self._size, self._product, self._square
        if not size.any():
            return 0.0
        size, square = np.maximum(size, TINY), np.maximum(square, TINY)
        explained = np.maximum(0.0, 1.0 - product**2 / (square * size))  # unexplained share, by delay and joint
        telling = np.sqrt(np.maximum(0.0, 1.0 - explained.min(axis=0))) >= LEAST_CORRELATION
        if not telling.any():
            return 0.0
        cost = explained[:, telling].sum(axis=1)
        best = int(np.argmin(cost))
        for k in np.flatnonzero(telling):
            # Noise of velocities makes one slope too small, that of positions the other one too large.
            slopes = sorted((product[best, k] / square[best, k], size[k] / product[best, k]), key=abs)
            low, high = min(slopes), max(slopes)
            if high < 1.0 - TOLERANCE or low > 1.0 + TOLERANCE:
                slope = float(slopes[0])
                raise InputError(
                    f"positions of joint '{self._names[k]}' change by {slope:.4g} times what its velocities say"
                    f"{_unit(slope)}."
                )
        return _refined(cost, best)


def _refined(cost, best):
    """Delay of the smallest cost, by the parabola through it and its neighbours."""
    if not 0 < best < len(DELAYS) - 1:
        return float(DELAYS[best])
    before, here, after = cost[best - 1 : best + 2]
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float(DELAYS[best] + shift * (DELAYS[1] - DELAYS[0]))


def _unit(slope):
    for value, text in UNITS:
        if abs(slope / value - 1.0) < 0.05:
            return f", expected 1: velocities seem to be {text}"
    return ", expected 1: are velocities those of the motor, or of another joint?"
