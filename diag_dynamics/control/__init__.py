# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Control in (ν, ε): laws, and what their commands pass through on the way to the robot. No ROS.

A law takes a state to a :class:`Command`; filters take commands to commands. Put together in this order: law, soft position
limits, energy limiter, contact limiter, effort saturation, effort rate.

command: what laws and filters hand on. damping, pose, tracking: the laws; law: what they share. energy, contact_limit,
limits: the filters.
"""

from diag_dynamics.control.command import Command, PoseError
from diag_dynamics.control.contact_limit import ContactLimiter
from diag_dynamics.control.damping import GravityCompensation, RateDamping
from diag_dynamics.control.energy import EnergyLimiter
from diag_dynamics.control.limits import EffortRateLimiter, EffortSaturation, PositionRepulsion
from diag_dynamics.control.pose import PoseRegulation
from diag_dynamics.control.tracking import JointTracking

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
