# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""All filters of commands in their order.

Robots may have gravity compensation of their own.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, VectorLike
from diag_dynamics.checks import instance, not_negative, per_name, vector
from diag_dynamics.collision.contact_points import ContactPoints
from diag_dynamics.control.laws import Command, Gain, actuated
from diag_dynamics.control.limiters import (
    ContactLimiter,
    EnergyLimiter,
    PositionRepulsion,
    names_where,
)
from diag_dynamics.control.tank import EnergyTank
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.sweeps.limits import HEAVY, ROWS, deliver, demand_rate

FIRST_PERIOD = 1e-3
"""Assumed length of the first cycle [s]."""

MAX_RAMP_TIME = 0.1
"""Maximum time in which efforts reach gravity compensation without a warning [s]."""

SPRING_SHARE, SPRING_EFFORT, SPRING_TIME = 0.5, 10.0, 0.1
"""Effort of a spring at a position limit, and its damping per stiffness [s].

The effort is a fraction of the effort limit. Without a limit it is the second number [N m, N].
"""

CONTACT_RATE = 30.0
"""Rate of the approach to contact limits [1/s]."""

NO_FACTOR = np.empty((0, 0))

SHARE = 0.5
"""Fraction of the effort rate that a law may demand."""

DECAY, GROWTH = 200.0, 5.0
"""Rates at which the scale of a law's efforts falls, and grows back to 1 [1/s]."""

CYCLES = 3
"""Successive cycles in which a joint has to demand too much.

Noise and jumps do so in single cycles.
"""


class Limited(NamedTuple):
    """Result of all filters for one command of a law.

    The robot receives its effort; the rest says which limits changed the command.
    """

    effort: Array  # to send [N m, N], without gravity if the robot compensates it
    demand: Array  # the same before the limit of its rate
    command: Command  # within all limits but that of the rate
    limited: tuple[str, ...]  # joints at their effort limit or effort rate
    energy_limited: bool  # whether energy limiter, tank or foreseen braking changed the command
    contact_limited: bool  # whether the contact limiter did


class Limits:
    """Filters of the commands of one robot, in this order.

    Scale of a law whose efforts would change too fast, springs before position limits, kinetic
    energy, energy tank with its measurement, contact, effort limits, effort rates. Pass the effort
    of each result on to the robot, and nothing else.

    Parameters
    ----------
    dynamics : DiagonalDynamics
    margin : float
        Range of the springs before position limits [rad, m]; 0: none. At a limit a spring has half
        of the effort limit.
    energy_limit, joint_energy_limit, energy_rate
        Those of :class:`EnergyLimiter` [J, J, 1/s]; by default no limit.
    tank_energy : float
        Capacity of an :class:`EnergyTank` [J]; 0: none.
    contact_points : ContactPoints, optional
        Points with limits, as of a :class:`ContactLimiter`.
    effort_limit : (nv,), optional
        Largest efforts [N m, N], by default those of the URDF.
    effort_rate : float or (nv,)
        Largest rates of efforts [N m/s, N/s].
    compensated : bool
        Whether the robot adds gravity compensation to the efforts that it receives.
    start : (nv,), optional
        Present effort of the joints [N m, N], by default gravity compensation in the first state.

    Attributes
    ----------
    sent : (nv,)
        Last effort to send [N m, N].
    scale : float
        Scale of the effort limits on the last command.
    saturated : tuple of str
        Joints at their effort limit in the last command.
    energy, tank, contact : EnergyLimiter, EnergyTank and ContactLimiter, or None
    unlimited : tuple of str
        Joints without effort limit.

    Example
    -------
    >>> import diag_dynamics as dd
    >>> dyn = dd.DiagonalDynamics(dd.load_robot("ur5"))
    >>> law, limits = dd.RateDamping(dyn, 10.0), dd.Limits(dyn, energy_limit=0.5)
    >>> q, qd = [0, -1, 1, 0, 0, 0], [0.1] * 6
    >>> limits.filter(q, qd, law.command(q, qd), period=1e-3).effort.shape
    (6,)
    """

    def __init__(
        self,
        dynamics: DiagonalDynamics,
        *,
        margin: float = 0.0,
        energy_limit: float = math.inf,
        joint_energy_limit: Gain = math.inf,
        energy_rate: float = 50.0,
        tank_energy: float = 0.0,
        contact_points: ContactPoints | None = None,
        effort_limit: VectorLike | None = None,
        effort_rate: Gain = 1000.0,
        compensated: bool = False,
        start: VectorLike | None = None,
    ) -> None:
        model = actuated(dynamics).model
        self._names = model.dof_names
        self._compensated = compensated
        margin = not_negative("margin", margin, "[rad, m]")
        limit = model.effort_limit if effort_limit is None else effort_limit
        expected = "a number > 0 [N m, N]"
        limit = per_name("effort_limit", limit, self._names, expected, lambda x: x > 0.0)
        self._effort_limit = limit
        self.unlimited = names_where(self._names, np.isinf(limit))
        self._springs: PositionRepulsion | None = None
        if margin:
            effort = SPRING_SHARE * limit
            stiffness = np.where(np.isinf(effort), SPRING_EFFORT, effort) / margin
            self._springs = PositionRepulsion(dynamics, margin, stiffness, SPRING_TIME * stiffness)
        energy = EnergyLimiter(dynamics, energy_limit, joint_energy_limit, energy_rate)
        is_limited = np.isfinite([energy.limit, *energy.joint_limit]).any()
        self.energy = energy if is_limited else None
        self.tank = (
            EnergyTank(dynamics, tank_energy, energy_rate, not compensated) if tank_energy else None
        )
        self.contact = (
            None
            if contact_points is None
            else ContactLimiter(dynamics, contact_points, CONTACT_RATE)
        )
        expected = "a finite number > 0 [N m/s, N/s]"
        self._rate = per_name("effort_rate", effort_rate, self._names, expected)
        self._dynamics = dynamics
        self._energy_limits = energy.limit, energy.joint_limit, energy.rate
        dynamics.compile("factors")
        deliver.compile()
        demand_rate.compile()
        self._gravity = np.zeros(model.nv)
        self.reset(start)
        self.begin()

    def begin(self) -> None:
        """Start from the last effort, with a full tank and springs that begin at the joints."""
        self._held: list[Array] = []  # efforts since the last command of a law, at most two
        self.scale = 1.0
        self.saturated: tuple[str, ...] = ()
        self._demands = np.zeros((CYCLES, len(self._rate)))
        self._share = 1.0  # of a law whose efforts would change too fast
        self._scaling_joint: int | None = None  # whose effort rate does so
        self.renew()

    def renew(self) -> None:
        """Fill the tank, and let the springs begin where the joints are, if there are such."""
        if self._springs:
            self._springs.begin()
        if self.tank:
            self.tank.fill()

    def reset(self, effort: VectorLike | None = None) -> None:
        """Start from an effort that has been sent [N m, N].

        Without it, start from gravity compensation in the next state.
        """
        self._is_new = effort is None
        start = self.gravity_compensation if effort is None else effort
        self.sent = vector("effort", start, self._names)

    def filter(
        self,
        q: VectorLike,
        qd: VectorLike,
        command: Command,
        period: float,
        external: VectorLike | None = None,
    ) -> Limited:
        """Return the :class:`Limited` command of a law at q [rad, m] and qd [rad/s, m/s].

        `period` is the length of a cycle [s], since the last command and until the next one; 0 for
        a first command leaves efforts as they are. `external` are working moments of external
        forces [J^½/s], such as an observer's residual.
        """
        not_negative("period", period, "[s]")
        h = period or FIRST_PERIOD
        q = vector("q", q, self._names)
        qd = vector("qd", qd, self._names)
        vector("command.tau", instance("command", command, Command).tau, self._names)
        external = None if external is None else vector("external", external, self._names)
        g = vector("command.gravity_torque", command.gravity_torque, self._names)
        self._gravity = g
        if self._is_new:
            self.reset(self.gravity_compensation)
        command = self._scaled(command, period)
        if self._springs:
            command = self._springs.filter(q, qd, command, h)
        unlimited = command
        outside = external
        if command.friction is not None:
            outside = -command.friction if external is None else external - command.friction
        if self.energy:
            command = self.energy.filter(q, qd, command, h, outside)
        if self.tank:
            last = self._held[0] if self._held else None
            self.tank.measure(q, last, held=len(self._held) == 1)
            self._held = []
            command = self.tank.filter(q, qd, command, h, external)
        slower = command
        if self.contact:
            command = self.contact.filter(q, qd, command, h, outside)
        rows = np.empty((ROWS, len(g)))
        self.scale, brakes = deliver(
            self._dynamics.factors(q).l if self.energy else NO_FACTOR,
            command.nu,
            command.tau,
            g,
            self.sent,
            self._effort_limit,
            self._compensated,
            self._rate,
            period,
            *self._energy_limits,
            rows,
        )
        effort, demand, saturated, waiting = rows[:4]
        self.saturated = names_where(self._names, saturated)
        if self._scaling_joint is not None:
            waiting[self._scaling_joint] = 1.0
        return Limited(
            self._send(effort),
            demand,
            command,
            names_where(self._names, saturated + waiting),
            brakes or slower is not unlimited,
            command is not slower,
        )

    def _scaled(self, command: Command, period: float) -> Command:
        """Return the command of a law, scaled for the rate of its efforts.

        A law whose efforts have to change faster than R acts late, and late springs do work. So
        that it stays stable, all that moves the robot is scaled as a whole, τ = g + s(τ − g). s
        falls at the rate DECAY while s·d(τ − g)/dt exceeds SHARE of R in CYCLES successive cycles,
        and grows back at the rate GROWTH.
        """
        tau = command.tau
        gravity = command.gravity_torque
        demand, joint = demand_rate(tau, gravity, self._rate, SHARE * period, self._demands)
        if demand * self._share > 1.0:
            slower = self._share * math.exp(-DECAY * period)
            self._share = max(1.0 / demand, slower)
            self._scaling_joint = joint
        elif self._share < 1.0:
            self._share = min(self._share * math.exp(GROWTH * period), 1.0)
        if self._share == 1.0:
            self._scaling_joint = None
            return command
        tau = gravity + self._share * (tau - gravity)
        friction = command.friction
        if friction is not None:
            friction = self._share * friction
        return command._replace(tau=tau, epsilon=self._share * command.epsilon, friction=friction)

    def ramp(self, effort: VectorLike, period: float) -> Array:
        """Return the efforts to send without a law.

        They are those nearest to `effort` [N m, N] within a period [s], joint by joint: a slow one
        does not delay the gravity torque of the others.
        """
        demand = vector("effort", effort, self._names)
        change = period * self._rate
        return self._send(np.clip(demand, self.sent - change, self.sent + change))

    def _send(self, effort: Array) -> Array:
        self.sent = effort.copy()
        self._held = [*self._held, self.sent][:2]
        return effort

    def limit_to_gravity(self, command: Command) -> None:
        """Start from the last effort, clipped between zero and gravity compensation.

        The compensation is that in the state of a command.
        """
        self._gravity = command.gravity_torque
        gravity = self.gravity_compensation
        self.reset(np.clip(self.sent, np.minimum(gravity, 0.0), np.maximum(gravity, 0.0)))

    def reaches_gravity(self, command: Command, period: float) -> bool:
        """Return whether efforts reach the range of a command within a period [s].

        The range is from gravity compensation to the command.
        """
        self._gravity = command.gravity_torque
        gravity = self.gravity_compensation
        effort = gravity + (command.tau - command.gravity_torque)
        between = np.clip(self.sent, np.minimum(gravity, effort), np.maximum(gravity, effort))
        return bool((np.abs(between - self.sent) <= period * self._rate + 1e-9).all())

    @property
    def gravity_compensation(self) -> Array:
        """Effort of gravity compensation in the last state [N m, N].

        It is zero for a robot with its own.
        """
        if self._compensated:
            return np.zeros_like(self._gravity)
        return np.clip(self._gravity, -self._effort_limit, self._effort_limit)

    @property
    def acting(self) -> Array:
        """Effort on the joints since the last command [N m, N], gravity compensation included."""
        return self.sent + self._gravity if self._compensated else self.sent

    @property
    def heavy(self) -> tuple[str, ...]:
        """Joints whose gravity torque exceeds HEAVY of their effort limit in the last state."""
        return names_where(self._names, np.abs(self._gravity) > HEAVY * self._effort_limit)

    @property
    def slow(self) -> tuple[str, ...]:
        """Joints that need more than MAX_RAMP_TIME for gravity compensation in the last state."""
        gravity = self.gravity_compensation
        return names_where(self._names, np.abs(gravity) > MAX_RAMP_TIME * self._rate)
