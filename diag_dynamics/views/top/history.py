# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What `top` remembers of one robot: the last minute in slots, and peaks of all states."""

import numpy as np

from diag_dynamics.views.top.quantities import ENERGY, EXTERNAL, QUANTITIES

SLOT = 0.02
"""Time that one slot stands for [s]: of more states the largest values of each are kept."""

HELD = 0.2
"""Time that a value is drawn for where no other one came [s]."""

LONGEST = 60.0
"""Time that is remembered [s]."""

_SLOTS = round(LONGEST / SLOT)


class RobotHistory:
    """Quantities of a robot's joints over the last minute.

    Parameters
    ----------
    names : sequence of str
        Degrees of freedom.

    Attributes
    ----------
    names : list of str
    limits : ndarray, shape (quantities, nv)
        What each quantity is told in parts of; inf where there is nothing.
    peak, peak_at : ndarray, shape (quantities, nv)
        Largest magnitude since the last :meth:`restart`, and its stamp [s].
    total_peak, total_peak_at : float
        Of the kinetic energy [J], and when [s].
    last : ndarray, shape (quantities, nv)
        Of the last state.
    newest : float or None
        Its stamp [s].
    """

    def __init__(self, names):
        self.names = list(names)
        self.limits = np.full((len(QUANTITIES), len(self.names)), np.inf)
        self._times = np.zeros(2 * _SLOTS)
        self._values = np.zeros((2 * _SLOTS, len(QUANTITIES), len(self.names)), dtype=np.float32)
        self.forget()
        self.restart()

    def restart(self):
        """Begin peaks anew."""
        shape = self.limits.shape
        self.peak, self.peak_at = np.zeros(shape), np.full(shape, np.nan)
        self.total_peak, self.total_peak_at = 0.0, np.nan

    def forget(self):
        """Drop what was, as after a jump of time."""
        self._end, self.newest, self.last = 0, None, np.full(self.limits.shape, np.nan)

    @property
    def total(self):
        """Kinetic energy of the last state [J]."""
        return float(self.last[ENERGY].sum())

    def set_thresholds(self, thresholds):
        """Thresholds of the external torque, one for each joint or none."""
        self.limits[EXTERNAL] = thresholds if len(thresholds) == len(self.names) else np.inf

    def add(self, stamp, values):
        """Take in the quantities of a state at a stamp [s]."""
        if self.newest is not None and stamp < self.newest:
            self.forget()
        size, end = np.abs(values), self._end
        higher = size > self.peak
        if higher.any():
            self.peak[higher], self.peak_at[higher] = size[higher], stamp
        total = values[ENERGY].sum()
        if total > self.total_peak:
            self.total_peak, self.total_peak_at = float(total), stamp
        self.newest, self.last = stamp, values
        if end and stamp - self._times[end - 1] < 0.99 * SLOT:
            kept = self._values[end - 1]
            np.copyto(kept, values, where=~(size <= np.abs(kept)))
            return
        if end == 2 * _SLOTS:
            self._times[:_SLOTS], self._values[:_SLOTS] = self._times[_SLOTS:], self._values[_SLOTS:]
            end = _SLOTS
        self._times[end], self._values[end] = stamp, values
        self._end = end + 1

    def recent(self, window, quantity, count):
        """Largest magnitudes of one quantity in `count` equal parts of the last `window` seconds, and whether there are any.

        Returns
        -------
        ndarray, shape (count, nv)
            NaN where nothing is known.
        """
        found = np.full((count, len(self.names)), np.nan)
        begin, at = self._parts(window, count)
        if len(at):
            first = np.flatnonzero(np.diff(at, prepend=-1))
            found[at[first]] = np.fmax.reduceat(np.abs(self._values[begin : self._end, quantity]), first)
            _fill(found, at[first], window)
        return found

    def recent_total(self, window, count):
        """The same of the kinetic energy [J], shape (count,)."""
        found = np.full(count, np.nan)
        begin, at = self._parts(window, count)
        if len(at):
            first = np.flatnonzero(np.diff(at, prepend=-1))
            found[at[first]] = np.fmax.reduceat(self._values[begin : self._end, ENERGY].sum(axis=1), first)
            _fill(found, at[first], window)
        return found

    def _parts(self, window, count):
        """First slot of a window, and the part that each slot from there on is in."""
        if self.newest is None:
            return 0, np.empty(0, int)
        times = self._times[: self._end]
        begin = int(np.searchsorted(times, self.newest - window, side="right"))
        at = np.floor((times[begin:] - (self.newest - window)) / window * count).astype(int)
        return begin, np.clip(at, 0, count - 1)


def _fill(found, known, window):
    """Draw the value before in parts in which no state came, for a short time."""
    count = len(found)
    latest = np.full(count, -count)
    latest[known] = known
    latest = np.maximum.accumulate(latest)
    held = (np.arange(count) - latest) * window <= HELD * count
    found[held] = found[latest[held]]
