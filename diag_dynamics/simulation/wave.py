# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motion for demonstrations: every joint follows a sine."""

import numpy as np

from diag_dynamics.exceptions import UnsupportedError
from diag_dynamics.simulation.simulation import rest_position

STIFFNESS, DAMPING = 25.0, 10.0
"""Gains on errors of position [1/s²] and rate [1/s]: critically damped at 5 rad/s."""

RAMP = 1.0
"""Time in which the amplitude grows to half [s]."""


class Wave:
    """Motion of a simulation: every joint swings about the middle of its range, at a frequency of its own, within limits.

    The effort is that of a computed-torque controller, M(q) q̈_c + c + g + d q̇_d with q̈_c from the reference and the error;
    damping and friction are compensated at the desired rate. The robot starts at the middle of its ranges. Joints of several
    degrees of freedom raise UnsupportedError.
    """

    def __init__(self, simulation):
        model = simulation.model
        if (model.bodies["dofs"][1:] > 1).any():
            raise UnsupportedError(
                f"robot '{model.name}' has joints of several degrees of freedom, which no wave drives. Set motion to free."
            )
        self._simulation = simulation
        bounded = np.isfinite(model.lower) & np.isfinite(model.upper)
        span = np.where(bounded, model.upper - model.lower, 2.0)
        self._centre = np.where(bounded, model.lower, 0.0) + 0.5 * span
        self._centre = np.where(bounded, self._centre, rest_position(model))
        k, golden = np.arange(model.nv), 0.5 * (np.sqrt(5.0) - 1.0)
        self._pace = 2.0 * np.pi * (0.15 + 0.25 * ((k + 1) * golden % 1.0))  # [rad/s], no two alike
        slow = model.velocity_bound / (self._pace + 0.65 / RAMP)
        amplitude = np.minimum(np.minimum(0.35 * span, 0.7), slow)
        self._swing = np.where(k % 2, -1.0, 1.0) * amplitude
        simulation.reset(self._centre, np.zeros(model.nv))

    def effort(self):
        """Joint efforts for the simulation's present time and state [N m, N], shape (nv,)."""
        simulation, swing = self._simulation, self._swing
        t, T = simulation.time, RAMP
        grown, growing = t**2 / (t**2 + T**2), 2 * t * T**2 / (t**2 + T**2) ** 2
        bending = 2 * T**2 * (T**2 - 3 * t**2) / (t**2 + T**2) ** 3
        s, c, w = np.sin(self._pace * t), np.cos(self._pace * t), self._pace
        q_d = self._centre + swing * grown * s
        qd_d = swing * (growing * s + grown * w * c)
        qdd_d = swing * (bending * s + 2.0 * growing * w * c - grown * w * w * s)
        q, qd = simulation.q, simulation.qd
        qdd = qdd_d + DAMPING * (qd_d - qd) + STIFFNESS * (q_d - q)
        tau = simulation.dynamics.inverse_dynamics(q, qd, qdd) + simulation.damping * qd_d
        return tau + simulation.friction * np.sign(qd_d) + simulation.effort_offset
