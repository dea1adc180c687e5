# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Energy tank: a bound on the energy that any law adds to a robot.

It also bounds the energy that a person or a device can extract.
"""

from __future__ import annotations

import math

import numpy as np

from diag_dynamics.arrays import Array, VectorLike
from diag_dynamics.checks import positive, vector
from diag_dynamics.control.laws import Command, actuated
from diag_dynamics.control.references import nearest
from diag_dynamics.dynamics import DiagonalDynamics

RESERVE = 0.1
"""Fraction of the capacity for the work of an effort because it is held for a cycle."""


class EnergyTank:
    """Energy x that a law may still add: a filter on any law's command.

    The energy that the robot returns refills it.

    K̇ = νᵀε + νᵀε_ext, because νᵀC = 0 and the law compensates gravity. An effort τ held for a
    cycle does the work τᵀΔq exactly, so `measure` takes W = τᵀΔq − ΔU from x, with the potential
    energy U at both positions, and loses x above the capacity. Then K + x rises by no more than the
    work of external forces, with any law, delay of its set-point and period: a person who holds the
    robot extracts at most K + x, less with friction. With gravity compensation U is that of the
    robot; the compensation, held for a cycle, does the work τ_gᵀΔq − ΔU, which counts, too.

    Two steps keep x ≥ 0. The first one removes power along ν and leaves forces across it:

        ε ← ε − sν,  s|ν|² = min(νᵀε − α(x − x_r), max(νᵀε, 0) + α|ν|²) if that is positive.

    The reserve x_r is `RESERVE` of the capacity. Below it the robot brakes, at most as damped by α.
    The second step predicts the work of a held fτ', τ' = mε, by the motion Δq₀ without it, W(f) = f
    τ'ᵀΔq₀ + ½f²h²|ε|², and takes the largest f in [0, 1] with W(f) ≤ x. It acts near the end of the
    reserve; gravity compensation is never scaled. Errors of the prediction (unknown pushes, late
    states, later filters) can make x < 0, but cost nothing of the bound on K + x.

    The capacity is x_max > 0 [J], at first full, the rate α > 0 [1/s]; above 1/h it acts as 1/h.
    `gravity` is whether efforts contain gravity compensation.
    """

    energy: float  #: x [J]

    def __init__(
        self, dynamics: DiagonalDynamics, capacity: float, rate: float, gravity: bool = True
    ) -> None:
        self.dynamics = actuated(dynamics)
        model = dynamics.model
        self.capacity = positive("capacity", capacity, "[J]")
        self.rate = positive("rate", rate, "[1/s]")
        self._continuous = np.isin(model.dof_names, model.continuous_joints)
        self._gravity = gravity
        self._at: tuple[Array, float] | None = None  # last positions, and U there
        dynamics.compile("tau_from_epsilon", "forward_dynamics", "potential_energy")
        self.fill()

    @property
    def is_overdrawn(self) -> bool:
        """Whether x is below zero by more than the error of its prediction."""
        return self.energy < -RESERVE * self.capacity

    def fill(self) -> None:
        """Set x to the capacity: an operator's decision, because it adds energy to the bound."""
        self.energy = self.capacity

    def measure(self, q: VectorLike, tau: VectorLike | None = None, held: bool = True) -> float:
        """Take from x the work of the effort `tau` [N m, N] since the last call, and return x.

        The positions now are q [rad, m]. Without an effort x stays. Where it was not `held` all the
        time, its work counts only if it is positive.
        """
        names = self.dynamics.model.dof_names
        q = vector("q", q, names)
        potential = float(self.dynamics.potential_energy(q)) if self._gravity else 0.0
        last = self._at
        self._at = (q, potential)
        if tau is not None and last is not None:
            moved = nearest(q, last[0], self._continuous) - last[0]
            work = float(vector("tau", tau, names) @ moved) - (self._at[1] - last[1])
            self.energy = min(self.energy - (work if held else max(work, 0.0)), self.capacity)
        return self.energy

    def filter(
        self,
        q: VectorLike,
        qd: VectorLike,
        command: Command,
        period: float,
        external: VectorLike | None = None,
    ) -> Command:
        """Return the command at q [rad, m] and qd [rad/s, m/s], or one that x covers.

        `period` is h > 0, until the next command [s]. `external` [J^½/s] improves the prediction.
        """
        h = positive("period", period, "[s]")
        nu = command.nu
        epsilon = self._braked(nu, command.epsilon, min(self.rate, 1.0 / h))
        moving = command.tau - command.gravity_torque
        if epsilon is not command.epsilon:
            moving = moving + self.dynamics.tau_from_epsilon(q, epsilon - command.epsilon)
        tau = command.gravity_torque
        if external is not None:
            external = vector("external", external, self.dynamics.model.dof_names)
            tau = tau + self.dynamics.tau_from_epsilon(q, external)
        # the motion in a cycle under gravity compensation alone
        drift = h * np.asarray(qd) + 0.5 * h * h * self.dynamics.forward_dynamics(q, qd, tau)
        scale = self._covered(float(moving @ drift), 0.5 * h * h * float(epsilon @ epsilon))
        epsilon = epsilon if scale == 1.0 else scale * epsilon
        if epsilon is command.epsilon:
            return command
        return command._replace(tau=command.gravity_torque + scale * moving, epsilon=epsilon)

    def _braked(self, nu: Array, epsilon: Array, rate: float) -> Array:
        """Return ε of the power that x covers above its reserve."""
        power = float(nu @ epsilon)
        square = float(nu @ nu)
        excess = power - rate * (self.energy - RESERVE * self.capacity)
        excess = min(excess, max(power, 0.0) + rate * square)
        return epsilon - nu * (excess / square) if excess > 0.0 and square > 0.0 else epsilon

    def _covered(self, linear: float, square: float) -> float:
        """Return the largest f in [0, 1] with linear·f + square·f² ≤ x [J].

        If x is negative, the bound is 0.
        """
        energy = max(self.energy, 0.0)
        if linear + square <= energy:
            return 1.0
        root = math.sqrt(linear * linear + 4.0 * square * energy)
        return 2.0 * energy / (linear + root) if linear > 0.0 else (root - linear) / (2.0 * square)
