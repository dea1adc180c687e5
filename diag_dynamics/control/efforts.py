# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Filters of the control loop in their order, for robots with and without gravity compensation of their own."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.control import limits
from diag_dynamics.control.by_dof import by_dof, effort_limits
from diag_dynamics.control.laws import Command
from diag_dynamics.control.limits import ContactLimiter
from diag_dynamics.control.tank import EnergyTank

MAX_RAMP_TIME = 0.1
"""Maximum time in which efforts reach gravity compensation without a warning [s]."""

FIRST_PERIOD = 1e-3
"""Assumed length of the first cycle [s]."""


class Filtered(NamedTuple):
    """Command of a law after all filters but the effort rate."""

    effort: np.ndarray  # [N m, N], without gravity if the robot compensates that itself
    command: Command  # within the limits of power and effort
    energy_limited: bool  # whether an energy limiter changed the command
    contact_limited: bool  # whether the contact limiter did


class Efforts:
    """Filters of one robot, the last effort `sent` [N m, N], and the `scale` of the effort limits on the last command.

    Arguments are those of :class:`ControlLoop`. Limiters are None without limits; `unlimited` joints have no effort limit.
    """

    def __init__(self, dynamics, values, compensated, points):
        model = dynamics.model
        self._names, self._compensated, self._max_period = (
            model.dof_names,
            compensated,
            values["max_state_age"],
        )
        self._springs = self.energy_limiter = self.tank = self.contact_limiter = None
        if margin := values["limit_margin"]:
            springs = values["limit_stiffness"], values["limit_damping"]
            self._springs = limits.PositionRepulsion(dynamics, margin, *springs)
        joint_limit = by_dof(
            "joint_energy_limit",
            values["joint_energy_limit"],
            self._names,
            np.full(model.nv, np.inf),
        )
        if values["energy_limit"] or any(values["joint_energy_limit"]):
            self.energy_limiter = limits.EnergyLimiter(
                dynamics, values["energy_limit"] or np.inf, joint_limit, values["energy_rate"]
            )
        if capacity := values["tank_energy"]:
            self.tank = EnergyTank(dynamics, capacity, values["energy_rate"], not compensated)
        if points is not None:
            self.contact_limiter = ContactLimiter(dynamics, points, values["contact.rate"])
        self._saturation = limits.EffortSaturation(
            model, effort_limits(values["effort_limit"], model)
        )
        self.unlimited = limits.names_where(self._names, np.isinf(self._saturation.limit))
        self.sent = np.zeros(model.nv)
        # The rate is that of the command, not of the total torque: a robot with gravity compensation is released by zero.
        rate = by_dof("effort_rate", values["effort_rate"], model.dof_names)
        self._ramp = limits.EffortRateLimiter(model, rate, self.sent)
        self.begin()

    def begin(self):
        """Start from the last effort, with a full tank."""
        self._held = []  # efforts since the last valid state, at most two
        self.fill_tank()
        self._gravity, self._time, self.scale = (
            np.zeros_like(self.sent),
            None,
            1.0,
        )  # time of the last command [ns]

    def filtered(self, state, command, external):
        """Return the :class:`Filtered` command of a law for a state and ε of external forces."""
        q, qd = state.position, state.velocity
        self._gravity = g = command.gravity_torque
        if self._springs:
            command = self._springs.filter(q, qd, command)
        unlimited, period = command, self._elapsed(state.newest) or FIRST_PERIOD
        if self.energy_limiter:
            command = self.energy_limiter.filter(q, qd, command, period, external)
        if self.tank:
            self.tank.measure(q, *self._held[:1], held=len(self._held) == 1)
            self._held = []
            command = self.tank.filter(q, qd, command, period, external)
        slower = command
        if self.contact_limiter:
            command = self.contact_limiter.filter(q, qd, command, period, external)
        saturated = self._saturation.filter(command)
        effort, self.scale = saturated.tau, saturated.scale
        if self._compensated:  # weight beyond the limit is left to the robot
            bound = np.maximum(self._saturation.limit, np.abs(g))
            effort = np.clip(g + self.scale * (command.tau - g), -bound, bound) - g
        limited = command._replace(scale=self.scale, limited=saturated.limited)
        return Filtered(effort, limited, slower is not unlimited, command is not slower)

    def ramped(self, effort, time):
        """Return the effort to send at a time [ns] and the joints that wait for their rate.

        After a stall efforts change by no more than within the longest cycle.
        """
        self.sent, waiting = self._ramp.filter(effort, self._elapsed(time))
        self._held = [*self._held, self.sent][:2]
        if self._time is None or not -self._max_period * 1e9 <= time - self._time < 0:
            self._time = time
        return self.sent, waiting

    def _elapsed(self, time):
        """Return the time since the last command [s], no more than the longest cycle."""
        elapsed = 0.0 if self._time is None else (time - self._time) * 1e-9
        return min(max(elapsed, 0.0), self._max_period)

    def fill_tank(self):
        """Fill the tank, if there is one."""
        if self.tank:
            self.tank.fill()

    def reset(self, sent):
        """Start from an effort that has been sent, without rate limit."""
        self.sent = sent
        self._ramp.reset(sent)

    def limit_to_gravity(self):
        """Start from the last effort, clipped between zero and gravity compensation."""
        gravity = self.gravity_compensation
        self.reset(np.clip(self.sent, np.minimum(gravity, 0.0), np.maximum(gravity, 0.0)))

    def reaches_gravity(self, effort, time):
        """Return whether one rate-limited step reaches the range from gravity compensation to `effort`."""
        gravity = self.gravity_compensation
        between = np.clip(self.sent, np.minimum(gravity, effort), np.maximum(gravity, effort))
        return bool(
            (np.abs(between - self.sent) <= self._ramp.rate * self._elapsed(time) + 1e-9).all()
        )

    @property
    def gravity_compensation(self):
        """Effort of gravity compensation in the last state [N m, N]; zero for a robot with its own."""
        if self._compensated:
            return np.zeros_like(self._gravity)
        return np.clip(self._gravity, -self._saturation.limit, self._saturation.limit)

    @property
    def acting(self):
        """Effort on the joints since the last command [N m, N], gravity compensation included."""
        return self.sent + self._gravity if self._compensated else self.sent

    @property
    def heavy(self):
        """Joints whose gravity torque exceeds HEAVY of their effort limit in the last state."""
        return limits.names_where(
            self._names, np.abs(self._gravity) > limits.HEAVY * self._saturation.limit
        )

    @property
    def slow(self):
        """Joints that need more than MAX_RAMP_TIME for gravity compensation in the last state."""
        gravity = self.gravity_compensation
        return limits.names_where(self._names, np.abs(gravity) > MAX_RAMP_TIME * self._ramp.rate)
