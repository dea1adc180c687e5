# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Types of joints that a URDF may have, and the joints of a model by type."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from diag_dynamics.sweeps.records import FLOATING, PLANAR, PRISMATIC, REVOLUTE
from diag_dynamics.sweeps.spatial import (
    ANGULAR_X,
    ANGULAR_Y,
    ANGULAR_Z,
    LINEAR_X,
    LINEAR_Y,
    LINEAR_Z,
)

if TYPE_CHECKING:
    from diag_dynamics.model.robot import RobotModel


class JointType(NamedTuple):
    """Kind in sweeps, degrees of freedom, and position coordinates of a type of joints.

    A degree of freedom has the suffix of its name and its direction, a coordinate its suffix.
    """

    kind: int | None
    freedoms: tuple[tuple[str, int], ...]
    coordinates: tuple[str, ...]


_LINEAR = (("v_x", LINEAR_X), ("v_y", LINEAR_Y), ("v_z", LINEAR_Z))
_ANGULAR = (("w_x", ANGULAR_X), ("w_y", ANGULAR_Y), ("w_z", ANGULAR_Z))
QUATERNION = ("qx", "qy", "qz", "qw")  # suffixes of coordinates that are together an orientation

JOINT_TYPES = {
    "revolute": JointType(REVOLUTE, (("", ANGULAR_Z),), ("",)),
    "continuous": JointType(REVOLUTE, (("", ANGULAR_Z),), ("",)),
    "prismatic": JointType(PRISMATIC, (("", LINEAR_Z),), ("",)),
    "fixed": JointType(None, (), ()),
    "floating": JointType(FLOATING, (*_LINEAR, *_ANGULAR), ("x", "y", "z", *QUATERNION)),
    "planar": JointType(PLANAR, (*_LINEAR[:2], _ANGULAR[2]), ("x", "y", "theta")),
}


def single_joints(model: RobotModel) -> tuple[str, ...]:
    """Return the joints of one degree of freedom, those of joint_states, in the model's order."""
    dofs = set(model.dof_names)
    return tuple(name for name in model.joint_names if name in dofs)


def places(names: Iterable[str], among: Iterable[str]) -> list[int]:
    """Return the index of each name among others."""
    place = {name: k for k, name in enumerate(among)}
    return [place[name] for name in names]


def sliding_dofs(model: RobotModel) -> list[bool]:
    """Return whether each degree of freedom slides, a list of nv bool; the others turn."""
    joints = model.description.joints
    return [
        joints[name].type == "prismatic" if name in joints else "/v_" in name
        for name in model.dof_names
    ]


def is_angle(model: RobotModel) -> npt.NDArray[np.bool_]:
    """Return whether each position coordinate is an angle, as an array."""
    joints = model.description.joints
    angles = [
        joints[name].type != "prismatic" if name in joints else name.endswith("/theta")
        for name in model.coordinate_names
    ]
    return np.array(angles, dtype=bool)
