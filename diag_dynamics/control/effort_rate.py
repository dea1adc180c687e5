# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Limit on the rate of efforts.

It neither pumps energy into a stable loop nor breaks an energy limit.
"""

from __future__ import annotations

import math

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.checks import per_name
from diag_dynamics.control.laws import Command, Gain
from diag_dynamics.sweeps.limits import demand_rate

SHARE = 0.5
"""Fraction of the effort rate that a law may demand."""

DECAY, GROWTH = 200.0, 5.0
"""Rates at which the scale of a law's efforts falls, and grows back to 1 [1/s]."""

CYCLES = 3
"""Successive cycles in which a joint has to demand too much.

Noise and jumps do so in single cycles.
"""


class EffortRate:
    """Efforts within |dτ_k/dt| ≤ R_k.

    A law whose efforts have to change faster than R acts late, and late springs do work. So that it
    stays stable, all that moves the robot is scaled as a whole, τ = g + s(τ − g). s falls at the
    rate DECAY while s·d(τ − g)/dt exceeds SHARE of R in CYCLES successive cycles, and grows back at
    the rate GROWTH.

    Then each joint approaches its effort at its own rate, because a slow joint must not delay the
    gravity torque of the others. With an energy limit they approach no further than efforts from
    which braking at the rate R keeps the limit: see
    :func:`~diag_dynamics.sweeps.limits.deliver`.

    The rate is R > 0 [N m/s, N/s].
    """

    scaling_joint: int | None  #: its effort rate scales the law

    def __init__(self, rate: Gain, names: tuple[str, ...]) -> None:
        self.rate = per_name("effort_rate", rate, names, "a finite number > 0 [N m/s, N/s]")
        demand_rate.compile()
        self.begin()

    def begin(self) -> None:
        """Scale nothing until the next command."""
        self._demands = np.zeros((CYCLES, len(self.rate)))
        self._scale = 1.0
        self.scaling_joint = None

    def scaled(self, command: Command, period: float) -> Command:
        """Return the command of a law, scaled for the rate of its efforts.

        The last command was a period [s] before.
        """
        tau = command.tau
        gravity = command.gravity_torque
        demand, joint = demand_rate(tau, gravity, self.rate, SHARE * period, self._demands)
        if demand * self._scale > 1.0:
            slower = self._scale * math.exp(-DECAY * period)
            self._scale = max(1.0 / demand, slower)
            self.scaling_joint = joint
        elif self._scale < 1.0:
            self._scale = min(self._scale * math.exp(GROWTH * period), 1.0)
        if self._scale == 1.0:
            self.scaling_joint = None
            return command
        tau = gravity + self._scale * (tau - gravity)
        friction = command.friction
        if friction is not None:
            friction = self._scale * friction
        return command._replace(tau=tau, epsilon=self._scale * command.epsilon, friction=friction)

    def towards(self, demand: Array, last: Array, period: float) -> Array:
        """Return the efforts nearest to a demand that are reached within a period [s]."""
        change = period * self.rate
        efforts: Array = np.minimum(np.maximum(demand, last - change), last + change)
        return efforts
