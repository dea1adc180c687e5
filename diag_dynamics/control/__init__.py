# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Control in (ν, ε) without ROS: laws, filters of their commands, and the control loop.

A law returns a :class:`Command` for a state; filters return changed commands, in this order: law, soft position limits,
energy limiter, contact limiter, effort saturation, effort rate.

laws, pose: laws. limits, contact_limit: filters. observer: external torque. references, trajectory: desired motions.
modes, efforts, supervisor, loop: the control loop.
"""

from diag_dynamics.control.command import Command, PoseError
from diag_dynamics.control.contact_limit import ContactLimiter
from diag_dynamics.control.laws import GravityCompensation, JointTracking, RateDamping
from diag_dynamics.control.limits import EffortRateLimiter, EffortSaturation, EnergyLimiter, PositionRepulsion
from diag_dynamics.control.pose import PoseRegulation

__all__ = [
    "Command",
    "ContactLimiter",
    "EffortRateLimiter",
    "EffortSaturation",
    "EnergyLimiter",
    "GravityCompensation",
    "JointTracking",
    "PoseError",
    "PoseRegulation",
    "PositionRepulsion",
    "RateDamping",
]
