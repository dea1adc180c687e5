# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Balance of power of the last minute, as a recording's is judged: over windows, from a few numbers of each state."""

import numpy as np

from diag_dynamics.recordings.balance import (
    MAX_GAP,
    MIN_EXPLAINED,
    MIN_WINDOWS,
    WINDOW,
    culprits_of,
    explained_share,
    is_judged,
    judgement,
    likely_cause,
)

MINUTE = 60.0
"""What is judged [s]."""

MOST = 1e100
"""Power that no robot has [W], and whose square is a number yet."""

_ROWS = round(MINUTE / WINDOW)
_LENGTH, _GAP, _MINUTE = (round(1e9 * seconds) for seconds in (WINDOW, MAX_GAP, MINUTE))


class LastMinute:
    """Sums powers over windows by the trapezoidal rule, and keeps those of the last minute.

    Parameters
    ----------
    names : sequence of str
        Degrees of freedom.

    Attributes
    ----------
    looks_closer : bool
        Whether it wants to know of joints: where the efforts explain little, to say at which ones the fault is. Where they
        explain much that costs nothing.
    """

    def __init__(self, names):
        self.looks_closer, self._joints = False, _JointWindows(names)
        self._windows = np.zeros((_ROWS, 5))  # end [ns]; means of dK/dt, gravity, friction, the residual [W]
        self._count = 0  # of all that have been written, the last ones over the first ones
        self.restart()

    def restart(self):
        """Begin a window with the next state: what lies between is no motion."""
        self._last = None

    def forget(self, names):
        """Drop all windows, as those of another model."""
        self.looks_closer, self._joints = False, _JointWindows(names)
        self._count = 0
        self.restart()

    def take(self, stamp, K, power, lifting, friction=0.0, joints=None):
        """Take in a state.

        Parameters
        ----------
        stamp : int
            [ns]
        K : float
            Kinetic energy [J].
        power : float
            ν·(ε − ε_g) [W].
        lifting, friction : float
            ν·ε_g and ν·ε_fric [W].
        joints : tuple of ndarray, optional
            ½ν_k² [J], and the power by which it should change [W].
        """
        last = self._last
        if last is None or not 0 < stamp - last <= _GAP:
            if last == stamp:  # in pieces: of the states with one stamp the first one counts, as it does in a recording
                return
            self._begin_window(stamp, K, whole=False)
            self._joints.begin(joints)
        else:
            half = 0.5e-9 * (stamp - last)
            self._joints.add(half, joints)
            self._work += half * (self._power + power)
            self._lifted += half * (self._lifting + lifting)
            self._rubbed += half * (self._friction + friction)
            if stamp // _LENGTH != last // _LENGTH:  # as in a recording, whatever its first state is
                self._end(stamp, K)
        self._last, self._power, self._lifting, self._friction = stamp, power, lifting, friction

    def _begin_window(self, stamp, K, whole):
        self._begin, self._begun, self._whole = stamp, K, whole
        self._work = self._lifted = self._rubbed = 0.0

    def _end(self, stamp, K):
        span, joints = 1e-9 * (stamp - self._begin), self._joints.ended()
        gained = K - self._begun
        residual = gained - (self._work - self._rubbed)
        powers = gained / span, self._lifted / span, self._rubbed / span, residual / span
        if self._whole and all(abs(power) < MOST for power in powers):
            row = self._count % len(self._windows)
            self._windows[row] = stamp, *powers
            self._joints.residual[row] = joints / span
            self._count += 1
        self._begin_window(stamp, K, whole=True)

    def values(self, newest):
        """Values for diagnostics, by key, of the minute before a stamp [ns]; none without windows enough, or at rest."""
        kept = self._windows[: self._count]
        within = (kept[:, 0] > newest - _MINUTE) & (kept[:, 0] <= newest)
        end, kinetic, lifted, rubbed, residual = kept[within].T
        if not len(end) or not is_judged(len(end), (kinetic**2).mean()):
            return {}
        explained, total = (explained_share(residual.var(), change.var()) for change in (kinetic, kinetic + lifted))
        if explained is None:
            return {}
        self.looks_closer = explained < MIN_EXPLAINED
        culprits = self._joints.culprits(within) if self.looks_closer else ()
        needed = kinetic + lifted + rubbed
        powers = residual, needed - residual, needed, kinetic, residual - lifted
        cause = likely_cause(*(power.var() for power in powers))
        return {
            "explained share of dK/dt (last minute)": f"{explained:.4g}",
            "power-balance residual, rms (last minute) [W]": f"{np.sqrt((residual**2).mean()):.4g}",
            "balance of power (last minute)": judgement(explained, total, culprits, cause),
        }


class _JointWindows:
    """Residuals of joints over the same windows, of those in which all states came with joints."""

    def __init__(self, names):
        self._names = tuple(names)
        self.residual = np.full((_ROWS, len(self._names)), np.nan)  # [W]
        self._before = self._begun = None
        self._work = np.zeros(len(self._names))

    def begin(self, joints):
        """Begin a window with a state."""
        self._begun, self._before = joints or (None, None)
        self._work[:] = 0.0

    def add(self, half, joints):
        """Take in the next state, after twice this time [s]."""
        if joints is None:
            self._begun = self._before = None
            return
        if self._begun is not None:
            self._work += half * (self._before + joints[1])
        self._share, self._before = joints

    def ended(self):
        """What joints have gained less the work on them [J], nan if it is not known; the next window begins."""
        known = self._begun is not None
        found = self._share - self._begun - self._work if known else np.nan
        if self._before is not None:
            self._begun = self._share
        self._work[:] = 0.0
        return found

    def culprits(self, within):
        """Names of the joints at which most of the residual is; none before there are windows enough."""
        residual = self.residual[: len(within)][within]
        residual = residual[np.isfinite(residual).all(axis=1)]
        return culprits_of(self._names, (residual**2).mean(axis=0)) if len(residual) >= MIN_WINDOWS else ()
