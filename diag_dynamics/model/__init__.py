# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robot models from URDFs and MJCFs.

A wrong argument raises an InputError that names the argument, its value and what was expected. A
mistake in a robot's file raises a UrdfError that names the element.
"""

from diag_dynamics.description.description import (
    Curve,
    FlexibleJoint,
    FlexibleLink,
    Loop,
    LoopEnd,
    Mimic,
    Payload,
)
from diag_dynamics.description.parameters import JointParameters, Parameters
from diag_dynamics.description.urdf_text import urdf_text
from diag_dynamics.model.links import end_effector_link
from diag_dynamics.model.loading import load_mjcf, load_robot, load_urdf
from diag_dynamics.model.robot import RobotModel

__all__ = [
    "Curve",
    "FlexibleJoint",
    "FlexibleLink",
    "JointParameters",
    "Loop",
    "LoopEnd",
    "Mimic",
    "Parameters",
    "Payload",
    "RobotModel",
    "end_effector_link",
    "load_mjcf",
    "load_robot",
    "load_urdf",
    "urdf_text",
]
