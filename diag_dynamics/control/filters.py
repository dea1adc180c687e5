# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""From what a law asks for to what is sent: filters in their order, for robots that carry themselves or do not."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.control import (
    Command,
    EffortRateLimiter,
    EffortSaturation,
    EnergyLimiter,
    PositionRepulsion,
)
from diag_dynamics.control.by_dof import by_dof, effort_limits
from diag_dynamics.control.contact_limit import ContactLimiter
from diag_dynamics.control.limits import HEAVY

SINKS = 0.1
"""How long efforts may take to carry a joint before that is worth a warning [s]."""


FIRST = 1e-3
"""Length that the first cycle is taken to have [s]."""


class Filtered(NamedTuple):
    """A command after all filters but that of rates.

    Attributes
    ----------
    effort : ndarray, shape (nv,)
        To be sent [N m, N]; without gravity if the robot adds that itself.
    command : Command
        What the law, springs and the energy limiter ask for, with the `scale` and `limited` of the effort limits.
    energy_limited : bool
        Whether the energy limiter took power out of it.
    contact_limited : bool
        Whether the contact limiter did.
    """

    effort: np.ndarray
    command: Command
    energy_limited: bool
    contact_limited: bool


class Efforts:
    """The filters of one robot, and what was sent last.

    Parameters
    ----------
    dynamics : DiagonalDynamics
    values : dict
        Values of parameters.controller.PARAMETERS.
    compensated : bool
        Whether the robot adds what carries its weight to what it is sent.
    points : ContactPoints, optional
        Where contacts are bounded.

    Attributes
    ----------
    energy_limiter : EnergyLimiter or None
    contact_limiter : ContactLimiter or None
    sent : ndarray, shape (nv,)
        Sent last [N m, N].
    scale : float
        What moves the robot was multiplied with to respect effort limits, in the last command.

    Raises
    ------
    InputError
        The values do not fit the robot.
    """

    def __init__(self, dynamics, values, compensated, points=None):
        model = dynamics.model
        self._names, self._compensated, self._longest = model.dof_names, compensated, values["max_state_age"]
        margin = values["limit_margin"]
        springs = (margin, values["limit_stiffness"], values["limit_damping"])
        self._springs = PositionRepulsion(dynamics, *springs) if margin else None
        limit, rate = values["energy_limit"], values["energy_rate"]
        self.energy_limiter = EnergyLimiter(dynamics, limit, rate) if limit else None
        self.contact_limiter = None if points is None else ContactLimiter(dynamics, points, values["contact.rate"])
        self._saturation = EffortSaturation(model, effort_limits(values["effort_limit"], model))
        self.sent = np.zeros(model.nv)
        # Of what is sent, not of what acts: a robot that carries itself and is let go is sent zero, not less than its weight.
        self._ramp = EffortRateLimiter(model, by_dof("effort_rate", values["effort_rate"], model.dof_names), self.sent)
        self.begin()

    def begin(self):
        """Begin anew, with what was sent last."""
        self._gravity, self._time, self.scale = np.zeros_like(self.sent), None, 1.0  # time of the last command [ns]

    def filtered(self, q, qd, command, external, time):
        """What is to be sent for a command at a state, as soon as rates allow.

        `external` is the observer's ε, or None; `time` the state's [ns].
        """
        self._gravity = g = command.gravity_torque
        if self._springs:
            command = self._springs.filter(q, qd, command)
        asked = command
        if self.energy_limiter:
            command = self.energy_limiter.filter(q, command, external)
        energy_limited, asked = command is not asked, command
        if self.contact_limiter:
            command = self.contact_limiter.filter(q, qd, command, self._elapsed(time) or FIRST, external)
        saturated = self._saturation.filter(command)
        effort, self.scale = saturated.tau, saturated.scale
        if self._compensated:  # whose weight is more than its limit is left to the robot, and never pulled down
            bound = np.maximum(self._saturation.limit, np.abs(g))
            effort = np.clip(g + self.scale * (command.tau - g), -bound, bound) - g
        limited = command._replace(scale=self.scale, limited=saturated.limited)
        return Filtered(effort, limited, energy_limited, command is not asked)

    def ramped(self, effort, time):
        """What is sent at a time [ns], and which joints had to wait; after a stall no more than within the longest cycle."""
        self.sent, waited = self._ramp.filter(effort, self._elapsed(time))
        back = self._time is not None and time - self._time < -self._longest * 1e9
        self._time = time if self._time is None or back else max(time, self._time)
        return self.sent, waited

    def _elapsed(self, time):
        """Since the last command [s]."""
        elapsed = 0.0 if self._time is None else (time - self._time) * 1e-9
        return min(max(elapsed, 0.0), self._longest)

    def reset(self, sent):
        """Go on from efforts that have been sent, whatever their rate."""
        self.sent = sent
        self._ramp.reset(sent)

    def carry_on(self):
        """Go on from what was sent last, as far as it carries the robot as it is now."""
        carrying = self.carrying
        self.reset(np.clip(self.sent, np.minimum(carrying, 0.0), np.maximum(carrying, 0.0)))

    def carry(self, effort, time):
        """Whether what was sent last, one step further, carries the robot or is between that and an effort that does."""
        carrying = self.carrying
        between = np.clip(self.sent, np.minimum(carrying, effort), np.maximum(carrying, effort))
        return bool((np.abs(between - self.sent) <= self._ramp.rate * self._elapsed(time) + 1e-9).all())

    @property
    def carrying(self):
        """What is sent to the robot to carry it, in the last state [N m, N]."""
        if self._compensated:
            return np.zeros_like(self._gravity)
        return np.clip(self._gravity, -self._saturation.limit, self._saturation.limit)

    @property
    def acting(self):
        """What acts on the joints since it was sent last [N m, N]."""
        return self.sent + self._gravity if self._compensated else self.sent

    @property
    def unlimited(self):
        """Joints whose effort nothing limits."""
        return self._named(np.isinf(self._saturation.limit))

    @property
    def heavy(self):
        """Joints whose weight takes more than HEAVY of their effort limit, in the last state."""
        return self._named(np.abs(self._gravity) > HEAVY * self._saturation.limit)

    @property
    def slow(self):
        """Joints that sink before efforts at their rate carry them, in the last state: for longer than SINKS."""
        return self._named(np.abs(self.carrying) > SINKS * self._ramp.rate)

    def _named(self, these):
        return tuple(name for name, is_one in zip(self._names, these, strict=True) if is_one)
