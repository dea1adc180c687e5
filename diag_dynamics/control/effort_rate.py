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
from diag_dynamics.control.limits import EnergyLimiter, names_where
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.sweeps.limits import ROWS, foresee

SHARE = 0.5
"""Fraction of the effort rate that a law may demand."""

DECAY, GROWTH = 200.0, 5.0
"""Rates at which the scale of a law's efforts falls, and grows back to 1 [1/s]."""

CYCLES = 3
"""Successive cycles in which a joint has to demand too much.

Noise and jumps do so in single cycles.
"""

ROUNDING = 1e-12
"""Rounding error of efforts from and to those without gravity."""


class EffortRate:
    """Efforts within |dτ_k/dt| ≤ R_k.

    A law whose efforts have to change faster than R acts late, and late springs do work. So that it
    stays stable, all that moves the robot is scaled as a whole, τ = g + s(τ − g). s falls at the
    rate DECAY while s·d(τ − g)/dt exceeds SHARE of R in CYCLES successive cycles, and grows back at
    the rate GROWTH.

    Then each joint approaches its effort at its own rate, because a slow joint must not delay the
    gravity torque of the others. With an energy limit they approach no further than efforts from
    which braking at the rate R keeps the limit: see
    :func:`~diag_dynamics.sweeps.limits.foresee`.

    The rate is R > 0 [N m/s, N/s].
    """

    def __init__(
        self, dynamics: DiagonalDynamics, rate: Gain, energy: EnergyLimiter | None = None
    ) -> None:
        self._dynamics, self._energy, self._names = dynamics, energy, dynamics.model.dof_names
        self.rate = per_name("effort_rate", rate, self._names, "a finite number > 0 [N m/s, N/s]")
        dynamics.compile("factors")
        foresee.compile()
        self.begin()

    def begin(self) -> None:
        """Scale nothing until the next command."""
        self._moving, self._scale, self._fastest = np.zeros(len(self._names)), 1.0, ""
        self._demands = CYCLES * [self._moving]

    def scaled(self, command: Command, period: float) -> Command:
        """Return the command of a law, scaled for the rate of its efforts.

        The last command was a period [s] before.
        """
        moving = command.tau - command.gravity_torque
        if period:
            ratio = np.abs(moving - self._moving) / (SHARE * period * self.rate)
            self._demands = [*self._demands[1:], ratio]
            for demand in self._demands[:-1]:
                ratio = np.minimum(ratio, demand)
            k = int(ratio.argmax())
            if ratio[k] * self._scale > 1.0:
                slower = self._scale * math.exp(-DECAY * period)
                self._scale, self._fastest = max(1.0 / float(ratio[k]), slower), self._names[k]
            else:
                self._scale = min(self._scale * math.exp(GROWTH * period), 1.0)
        self._moving = moving
        if self._scale == 1.0:
            return command
        tau = command.gravity_torque + self._scale * moving
        return command._replace(tau=tau, epsilon=self._scale * command.epsilon)

    def limited(self, demand: Array, sent: Array) -> tuple[str, ...]:
        """Return the joints whose effort waits for the rate, or whose rate scales the law."""
        waiting = np.abs(sent - demand) > ROUNDING * (1.0 + np.abs(demand))
        if self._scale < 1.0:
            waiting[self._names.index(self._fastest)] = True
        return names_where(self._names, waiting) if waiting.any() else ()

    def towards(self, demand: Array, last: Array, period: float) -> Array:
        """Return the efforts nearest to a demand that are reached within a period [s]."""
        change = period * self.rate
        efforts: Array = np.minimum(np.maximum(demand, last - change), last + change)
        return efforts

    def foreseen(
        self, q: Array, command: Command, demand: Array, last: Array, bound: Array, period: float
    ) -> tuple[Array, bool]:
        """Return efforts without gravity [N m, N] from which braking keeps the energy limit.

        They are those of :meth:`towards`, or nearer to braking, for which the second result is
        true. `bound` are the largest efforts with gravity.
        """
        energy = self._energy
        if energy is None or not period:
            return self.towards(demand, last, period), False
        rows = np.empty((ROWS, len(last)))
        brakes = foresee(
            self._dynamics.factors(q).l,
            command.nu,
            last,
            demand,
            period * self.rate,
            period,
            energy.limit,
            energy.joint_limit,
            energy.rate,
            command.gravity_torque,
            bound,
            rows,
        )
        return rows[0], bool(brakes)
