# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Explained share of the last minute, as a recording has it: over windows, from a few numbers of each state."""

import numpy as np

from diag_dynamics.recordings.balance import MAX_GAP, MIN_POWER, MIN_WINDOWS, WINDOW, explained_share

MINUTE = 60.0  # time of the share [s]
MOST = 1e100  # power that no robot has [W], and whose square is a number yet

_ROWS = round(MINUTE / WINDOW)
_LENGTH, _GAP, _MINUTE = (round(1e9 * seconds) for seconds in (WINDOW, MAX_GAP, MINUTE))


class LastMinute:
    """Sum powers over windows by the trapezoidal rule, and keep those of the last minute."""

    def __init__(self):
        self._windows = np.zeros((_ROWS, 3))  # end [ns]; means of dK/dt and of the residual [W]
        self.clear()

    def restart(self):
        """Begin a window with the next state: what lies between is no motion."""
        self._last = None

    def clear(self):
        """Drop all windows, as those of another model."""
        self._count = 0  # of all that have been written, the last ones over the first ones
        self.restart()

    def add_state(self, stamp, K, power):
        """Add a state: stamp [ns], kinetic energy [J], and ν·(ε − ε_g − ε_fric) [W]."""
        last = self._last
        if last == stamp:  # in pieces: of the states with one stamp the first one counts, as it does in a recording
            return
        if last is None or not 0 < stamp - last <= _GAP:
            self._begin_window(stamp, K, whole=False)
        else:
            self._work += 0.5e-9 * (stamp - last) * (self._power + power)
            if stamp // _LENGTH != last // _LENGTH:  # as in a recording, whatever its first state is
                self._end_window(stamp, K)
        self._last, self._power = stamp, power

    def _begin_window(self, stamp, K, whole):
        self._begin, self._begun, self._whole, self._work = stamp, K, whole, 0.0

    def _end_window(self, stamp, K):
        span, gained = 1e-9 * (stamp - self._begin), K - self._begun
        powers = gained / span, (gained - self._work) / span
        if self._whole and all(abs(power) < MOST for power in powers):
            self._windows[self._count % _ROWS] = stamp, *powers
            self._count += 1
        self._begin_window(stamp, K, whole=True)

    def values(self, newest):
        """Return values for diagnostics, by key, of the minute before a stamp [ns]; none with few windows, or at rest."""
        kept = self._windows[: self._count]
        within = (kept[:, 0] > newest - _MINUTE) & (kept[:, 0] <= newest)
        _, kinetic, residual = kept[within].T
        if len(kinetic) < MIN_WINDOWS or (kinetic**2).mean() < MIN_POWER**2:
            return {}
        explained = explained_share(residual.var(), kinetic.var())
        if explained is None:
            return {}
        return {
            "explained share of dK/dt (last minute)": f"{explained:.4g}",
            "power-balance residual, rms (last minute) [W]": f"{np.sqrt((residual**2).mean()):.4g}",
        }
