"""Balance of power of the last minute, as a recording's is judged: over windows, from a few numbers of each state."""

import numpy as np

from diag_dynamics.recordings.explained import (
    MAX_GAP,
    WINDOW,
    Variances,
    explained_share,
    is_judged,
    judgement,
    likely_cause,
)

MINUTE = 60.0
"""What is judged [s]."""

MOST = 1e100
"""Power that no robot has [W], and whose square is a number yet."""

_LENGTH, _GAP, _MINUTE = (round(1e9 * seconds) for seconds in (WINDOW, MAX_GAP, MINUTE))


class LastMinute:
    """Sums powers over windows by the trapezoidal rule, and keeps those of the last minute."""

    def __init__(self):
        self._windows = np.zeros(
            (round(MINUTE / WINDOW), 5)
        )  # end [ns]; means of dK/dt, gravity, friction, the residual [W]
        self._count = 0  # of all that have been written, the last ones over the first ones
        self.restart()

    def restart(self):
        """Begin a window with the next state: what lies between is no motion."""
        self._last = None

    def forget(self):
        """Drop all windows, as those of another model."""
        self._count = 0
        self.restart()

    def take(self, stamp, K, power, lifting, friction=0.0):
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
        """
        last = self._last
        if last is None or not 0 < stamp - last <= _GAP:
            if last == stamp:  # in pieces: of the states with one stamp the first one counts, as it does in a recording
                return
            self._begin_window(stamp, K, whole=False)
        else:
            half = 0.5e-9 * (stamp - last)
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
        span = 1e-9 * (stamp - self._begin)
        gained = K - self._begun
        residual = gained - (self._work - self._rubbed)
        powers = gained / span, self._lifted / span, self._rubbed / span, residual / span
        if self._whole and all(abs(power) < MOST for power in powers):
            self._windows[self._count % len(self._windows)] = stamp, *powers
            self._count += 1
        self._begin_window(stamp, K, whole=True)

    def values(self, newest):
        """Values for diagnostics, by key, of the minute before a stamp [ns]; none without windows enough, or at rest."""
        kept = self._windows[: self._count]
        end, kinetic, lifted, rubbed, residual = kept[(kept[:, 0] > newest - _MINUTE) & (kept[:, 0] <= newest)].T
        if not len(end) or not is_judged(len(end), (kinetic**2).mean()):
            return {}
        explained, total = (explained_share(residual.var(), change.var()) for change in (kinetic, kinetic + lifted))
        if explained is None:
            return {}
        needed = kinetic + lifted + rubbed
        powers = residual, needed - residual, needed, kinetic, residual - lifted
        cause = likely_cause(Variances(*(power.var() for power in powers)))
        return {
            "explained share of dK/dt (last minute)": f"{explained:.4g}",
            "power-balance residual, rms (last minute) [W]": f"{np.sqrt((residual**2).mean()):.4g}",
            "balance of power (last minute)": judgement(explained, total, cause=cause),
        }
