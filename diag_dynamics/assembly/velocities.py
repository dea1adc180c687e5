# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Velocities estimated from positions, for drivers that send none."""

import math

import numpy as np

SECOND = 1e9

LONGEST = 10.0 * SECOND
"""Longest time [ns] between the first two positions from which a velocity is estimated."""

PERIODS = 3.0
"""Periods without a position after which the estimate begins anew."""


class VelocityEstimator:
    """Exponentially weighted mean of the difference quotients of each joint's positions.

    A quotient that is older by the filter time T counts 1/e as much, so a constant acceleration is seen with a delay of
    dt/2 + dt/(exp(dt/T) − 1): T where samples are dense, dt/2 where they are sparse. However short the time between two
    positions is, a step of one of them changes the estimate by no more than the step over T, at first by 1.6 times as much;
    before T has passed nothing is handed out. Positions of one stamp count as one, the last of them with the next stamp.

    Parameters
    ----------
    turns : array_like of bool, shape (n,)
        Joints whose position is an angle that turns round: a step of it is the shorter way.
    """

    def __init__(self, turns):
        self._turns = np.array(turns, dtype=bool)
        count = len(self._turns)
        self._position = np.zeros(count)
        self._stamp, self._since = np.zeros((2, count), dtype=np.int64)
        self._sum, self._weight, self._period = np.zeros((3, count))
        self._known = np.zeros(count, dtype=bool)

    def forget(self, here=slice(None)):
        """Start anew with all joints or some, as after a jump of time."""
        self._known[here] = False

    def update(self, here, position, stamp, time, longest, fastest=np.inf, anew=False):
        """Velocities of joints by their newest positions.

        Parameters
        ----------
        here : ndarray of int, shape (k,)
            The joints.
        position : ndarray, shape (k,)
            [rad, m].
        stamp : int
            [ns], no less than those before.
        time : float
            Filter time T [s]; 0: the last difference quotient alone.
        longest : ndarray, shape (k,)
            Time between two positions [ns] up to which the estimate goes on, as it does up to :data:`PERIODS` periods.
        fastest : float or ndarray, shape (k,)
            Quotients beyond it are no velocities [rad/s, m/s]: nothing of the message is kept.
        anew : bool or ndarray of bool, shape (k,)
            Joints whose last position is not to be compared with this one.

        Returns
        -------
        ndarray, shape (k,)
            [rad/s, m/s]; NaN where it is not known yet, infinite where a quotient was beyond `fastest`.
        """
        elapsed = stamp - self._stamp[here]
        goes_on = self._known[here] & ~np.broadcast_to(anew, len(here)) & (elapsed >= 0)
        goes_on &= elapsed <= np.maximum(longest, PERIODS * self._period[here])
        moved = goes_on & (elapsed > 0)
        at = here[moved]
        dt = elapsed[moved] / SECOND
        step = position[moved] - self._position[at]
        step = np.where(self._turns[at], np.remainder(step + np.pi, 2.0 * np.pi) - np.pi, step)
        quotient = step / dt
        absurd = np.abs(quotient) > np.broadcast_to(fastest, len(here))[moved]
        if absurd.any():
            velocity = np.full(len(here), np.nan)
            velocity[np.flatnonzero(moved)[absurd]] = np.inf
            return velocity
        begun = here[~goes_on]
        self._since[begun], self._sum[begun], self._weight[begun] = stamp, 0.0, 0.0
        self._period[begun] = LONGEST / PERIODS
        stays = np.array([math.exp(-x / time) if time else 0.0 for x in dt])
        self._sum[at] = stays * self._sum[at] + (1.0 - stays) * quotient
        self._weight[at] = stays * self._weight[at] + (1.0 - stays)
        self._period[at] = elapsed[moved]
        new = moved | ~goes_on
        self._position[here[new]], self._stamp[here[new]], self._known[here[new]] = position[new], stamp, True
        ready = (self._weight[here] > 0.0) & ((stamp - self._since[here]) / SECOND >= time)
        return np.where(ready, self._sum[here] / np.where(ready, self._weight[here], 1.0), np.nan)
