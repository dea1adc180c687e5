# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frozen values under fresh stamps: velocities without motion, and motion without velocity."""

from collections import Counter

import numpy as np

from diag_dynamics.assembly.rejected import RejectedError

SAMPLES = 5
"""Number of states that are compared within the timeout: the first one behind each multiple of its fifth part, so that it
does not matter when this has begun."""

MOVING = 0.05
"""Speed [rad/s, m/s] at which a joint's position must change. Velocity noise of a joint at rest stays below it."""

MOVED = 0.05
"""Distance [rad, m] within the timeout that a joint with velocity zero does not go."""


class Frozen:
    """Judges velocities by positions, and the other way round, over some states.

    A joint is frozen if its velocity is :data:`MOVING` or more while no bit of its position changes for the timeout, or if
    its velocity is exactly 0 while its position moves by more than :data:`MOVED` from one multiple of the timeout to the
    next. An arm at rest is neither. States further apart than the timeout say nothing.

    Parameters
    ----------
    names : sequence of str
        The joints.
    timeout : float
        [s]; 0: not judged.
    refused : bool
        Whether states with frozen values are.

    Attributes
    ----------
    text : str
        Text on the joint that is frozen; empty if none is.
    told : Counter
        How many of the states that were compared had which text.
    """

    def __init__(self, names, timeout, refused):
        self._names, self.told = names, Counter()
        self.configure(timeout, refused)

    def configure(self, timeout, refused):
        """Take other settings, and begin anew."""
        self._timeout, self._refused = round(timeout * 1e9), refused
        self._step = max(1, -(-self._timeout // SAMPLES))  # [ns], rounded up
        self.forget()

    def forget(self):
        """Forget all states."""
        self._last, self.text = None, ""

    def judge(self, stamp, state):
        """Take in a state stamped `stamp` [ns], if it is time to; `state()` is that, a RobotState that ends in the joints.

        Raises
        ------
        RejectedError
            Values are frozen, and this is to be refused.
        """
        if not self._timeout:
            return
        elapsed = None if self._last is None else stamp - self._last
        if elapsed is None or elapsed < 0 or stamp // self._step != self._last // self._step:
            whole, count = state(), len(self._names)
            position, velocity = (vector[len(vector) - count :] for vector in (whole.position, whole.velocity))
            self._take(stamp, elapsed, position, velocity)
        if self.text and self._refused:
            raise RejectedError("frozen", self.text)

    def _take(self, stamp, elapsed, position, velocity):
        fast, zero = np.abs(velocity) >= MOVING, velocity == 0.0
        if elapsed is None or not 0 <= elapsed <= self._timeout:
            self._still_since, self._zero_since = (np.full(len(position), stamp) for _ in range(2))
            self._zero_at, self._slides = position.copy(), np.zeros(len(position), dtype=bool)
        else:
            self._still_since[~(fast & self._fast & (position == self._position))] = stamp
            self._still_since = np.maximum(self._still_since, stamp - self._timeout)  # for longer says no more
            period = SAMPLES * self._step
            over = zero & (stamp // period != self._last // period)
            whole = over & (stamp - self._zero_since >= self._timeout - self._step)
            moved = np.abs(position - self._zero_at) > MOVED
            self._slides = np.where(whole, moved, self._slides & zero)
            anew = over | ~zero
            self._zero_since[anew], self._zero_at[anew] = stamp, position[anew]
        self._last, self._position, self._fast = stamp, position.copy(), fast
        self.text = self._told(stamp - self._still_since >= self._timeout)
        if self.text:
            self.told[self.text] += 1

    def _told(self, still):
        for joints, what in (
            (still, "has a velocity, but no bit of its position changes"),
            (self._slides, "moves, but its velocity is 0"),
        ):
            if joints.any():
                names = [self._names[k] for k in np.flatnonzero(joints)]
                more = f" (and {len(names) - 1} more)" if len(names) > 1 else ""
                return f"frozen values: joint '{names[0]}'{more} {what} (frozen_timeout)"
        return ""
