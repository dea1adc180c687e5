# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sensors: noise, resolution, delay and loss between a state and what a driver publishes."""

from collections import deque

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.simulation.drives import ROUNDING

NONE = (0.0, 0.0, 0.0)


class Sensors:
    """Sensors of all joints. `lost` is the number of messages lost; the same seed and states give the same errors.

    `noise` is the standard deviation of white noise on position [rad, m], velocity [rad/s, m/s] and effort [N m, N], and
    `resolution` their steps; 0: none. `delay` is the simulated time from a state to its publication [s], and `dropped` the
    probability that a message is lost.
    """

    def __init__(self, noise=NONE, resolution=NONE, delay=0.0, dropped=0.0, seed=0):
        for name, values in (("noise", noise), ("resolution", resolution)):
            if len(values) != 3 or min(values) < 0.0:
                raise InputError(f"parameter 'sensor_{name}' is {list(values)}, expected 3 numbers >= 0.")
        self._errors, self._delay, self._dropped, self._seed = (noise, resolution), delay, dropped, seed
        self.lost = 0
        self.restart()

    def restart(self):
        """Restart the sequence of errors, and drop delayed measurements."""
        self._random = np.random.default_rng(self._seed)
        self.forget()

    def forget(self):
        """Drop delayed measurements."""
        self._delayed = deque()

    def measure(self, time, position, velocity, effort, label=None):
        """Measure a state at a simulated time [s]; it becomes known after the delay, with its label, unless it is lost."""
        values = []
        for value, noise, step in zip((position, velocity, effort), *self._errors, strict=True):
            if noise:
                value = value + noise * self._random.normal(size=len(value))
            if step:
                value = step * np.round(value / step)
            values.append(value)
        if self._dropped and self._random.random() < self._dropped:
            self.lost += 1
            return
        self._delayed.append((time, tuple(values), label))

    def known(self, time):
        """Return measurements that have become known by a simulated time [s]: their time, three vectors, and the label."""
        found = []
        while self._delayed and self._delayed[0][0] + self._delay <= time + ROUNDING:
            found.append(self._delayed.popleft())
        return found
