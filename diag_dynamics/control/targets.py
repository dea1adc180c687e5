# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where poses are that are given in the axes of a link, and which positions a robot can have."""

import numpy as np

from diag_dynamics.checks import numbers
from diag_dynamics.control.pose import rotation_of
from diag_dynamics.exceptions import InputError


def aimed(link, position, orientation, dynamics, q):
    """Position [m] and axes, in the root link's axes, of a pose in those of a link.

    It is taken from the link's origin as that link is at the positions q: a pose in the axes of a link that moves does not
    move with it.

    Raises
    ------
    InputError
        No such link, a position that is not finite, or no orientation; see :func:`rotation_of`.
    """
    position = numbers("position", position, (3,), "three finite numbers [m]")
    axes, X = rotation_of(orientation), dynamics.placement(q, link)
    return X[:3, :3] @ position + X[:3, 3], _orthonormal(X[:3, :3] @ axes)


def _orthonormal(R):
    """The rotation nearest to one that has gathered rounding errors of a URDF's angles."""
    U, _, V = np.linalg.svd(R)
    return U @ V


def require_within(what, positions, model):
    """Refuse positions [rad, m], shape (..., nv) in the robot's order, that it cannot have.

    Parameters
    ----------
    what : str
        Name of the positions, with a place for the index of a row if there are several.

    Raises
    ------
    InputError
        A position is outside of its joint's limits: followed there, the robot would press on its stop.
    """
    positions = np.atleast_2d(positions)
    beyond = np.argwhere(~((model.lower <= positions) & (positions <= model.upper)))
    if beyond.size:
        row, k = beyond[0]
        raise InputError(
            f"{what.format(row)} of joint '{model.dof_names[k]}' is {positions[row, k]:.6g}, expected within its limits "
            f"{model.lower[k]:g} … {model.upper[k]:g}."
        )
