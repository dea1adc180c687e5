"""Velocities that a driver does not send, from its positions."""

import numpy as np


class VelocityEstimator:
    """Exponentially weighted mean of the difference quotients of each joint's positions.

    A quotient that is older by the filter time T counts 1/e as much, so a constant acceleration is seen with a delay of
    dt/2 + dt/(exp(dt/T) − 1): T where samples are dense, dt/2 where they are sparse. However short the time between two
    positions is, a step of one of them changes the estimate by no more than the step over T, once T has passed; nothing
    is handed out before.

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
        self._sum, self._weight = np.zeros((2, count))
        self._known = np.zeros(count, dtype=bool)

    def forget(self):
        """Start anew, as after a jump of time."""
        self._known[:] = False

    def update(self, here, position, stamp, time, longest):
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
            Time between two positions [ns] beyond which the estimate starts anew.

        Returns
        -------
        ndarray, shape (k,)
            [rad/s, m/s]; NaN where it is not known yet.
        """
        elapsed = stamp - self._stamp[here]
        goes_on = self._known[here] & (elapsed <= longest)
        begun = here[~goes_on]
        self._since[begun], self._sum[begun], self._weight[begun] = stamp, 0.0, 0.0
        moved = goes_on & (elapsed > 0)
        if moved.any():
            at = here[moved]
            dt = elapsed[moved] * 1e-9
            step = position[moved] - self._position[at]
            step = np.where(self._turns[at], np.remainder(step + np.pi, 2.0 * np.pi) - np.pi, step)
            stays = np.exp(-dt / time) if time else np.zeros(len(at))
            self._sum[at] = stays * self._sum[at] + (1.0 - stays) * step / dt
            self._weight[at] = stays * self._weight[at] + (1.0 - stays)
        self._position[here], self._stamp[here], self._known[here] = position, stamp, True
        ready = (self._weight[here] > 0.0) & ((stamp - self._since[here]) * 1e-9 >= time)
        return np.where(ready, self._sum[here] / np.where(ready, self._weight[here], 1.0), np.nan)
