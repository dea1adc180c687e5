# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Types of joints that a URDF may have, and what each is: the one table of them."""

from typing import NamedTuple

from diag_dynamics.sweeps.records import FLOATING, PLANAR, PRISMATIC, REVOLUTE
from diag_dynamics.sweeps.spatial import ANGULAR_X, ANGULAR_Y, ANGULAR_Z, LINEAR_X, LINEAR_Y, LINEAR_Z


class JointType(NamedTuple):
    """What sweeps call it, and its degrees of freedom and position coordinates."""

    kind: int | None
    freedoms: tuple
    """Suffix of the name, and direction."""
    coordinates: tuple
    """Suffixes of their names."""


_LINEAR = (("v_x", LINEAR_X), ("v_y", LINEAR_Y), ("v_z", LINEAR_Z))
_ANGULAR = (("w_x", ANGULAR_X), ("w_y", ANGULAR_Y), ("w_z", ANGULAR_Z))

QUATERNION = ("qx", "qy", "qz", "qw")
"""Suffixes of coordinates that are together an orientation."""

JOINT_TYPES = {
    "revolute": JointType(REVOLUTE, (("", ANGULAR_Z),), ("",)),
    "continuous": JointType(REVOLUTE, (("", ANGULAR_Z),), ("",)),
    "prismatic": JointType(PRISMATIC, (("", LINEAR_Z),), ("",)),
    "fixed": JointType(None, (), ()),
    "floating": JointType(FLOATING, (*_LINEAR, *_ANGULAR), ("x", "y", "z", *QUATERNION)),
    "planar": JointType(PLANAR, (*_LINEAR[:2], _ANGULAR[2]), ("x", "y", "theta")),
}

SINGLE = tuple(name for name, kind in JOINT_TYPES.items() if len(kind.freedoms) == 1)
"""Those of one degree of freedom."""
