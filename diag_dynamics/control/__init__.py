"""Control in (ν, ε): laws, and what their commands pass through on the way to the robot. No ROS.

A law takes a state to a :class:`Command`.

command: what laws hand on. damping, pose, tracking: the laws; law: what they share. arguments: what all of them check.
"""

from diag_dynamics.control.command import Command, PoseError
from diag_dynamics.control.damping import GravityCompensation, RateDamping
from diag_dynamics.control.pose import PoseRegulation
from diag_dynamics.control.tracking import JointTracking

__all__ = [
    "Command",
    "GravityCompensation",
    "JointTracking",
    "PoseError",
    "PoseRegulation",
    "RateDamping",
]
