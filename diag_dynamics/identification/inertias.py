# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inertial parameters of a body: ten numbers, 4x4 pseudo-inertia, and shares of its links."""

import numpy as np

from diag_dynamics.rigid_body import SQUARE, parallel_axes, pseudo_inertia
from diag_dynamics.rigid_body import parameters_of_record as parameters_of_record
from diag_dynamics.sweeps.regressors import PARAMETERS

TRIANGLE = np.tril_indices(3)  # Ixx, Ixy, Iyy, Ixz, Iyz, Izz: the order of the parameters
FLOOR = 1e-3  # smallest variance of a body's mass along an axis, relative to the largest


def of_body(mass, centre, about_centre):
    """Return ten parameters, given mass, centre of mass and 3x3 inertia about it."""
    c = np.asarray(centre, float)
    rotational = np.asarray(about_centre) + parallel_axes(mass, c)
    return np.r_[mass, mass * c, rotational[TRIANGLE]]


def parameters_of_pseudo(J):
    """Return ten parameters of a 4x4 pseudo-inertia."""
    rotational = np.trace(J[:3, :3]) * np.eye(3) - J[:3, :3]
    return np.r_[J[3, 3], J[:3, 3], rotational[TRIANGLE]]


# J of each parameter, (10, 4, 4)
BASIS = np.array([pseudo_inertia(unit) for unit in np.eye(PARAMETERS)])


def moved(parameters, placement):
    """Return ten parameters in the frame of a 4x4 placement, of those in the placed frame."""
    return parameters_of_pseudo(placement @ pseudo_inertia(parameters) @ placement.T)


def about_centre(parameters):
    """Return mass, centre of mass and 3x3 inertia about it."""
    mass = float(parameters[0])
    rotational = parameters[4:][SQUARE]
    if mass == 0.0:
        return 0.0, np.zeros(3), rotational
    c = parameters[1:4] / mass
    return mass, c, rotational - parallel_axes(mass, c)


def is_physical(parameters):
    """Return whether a body of positive density can have these parameters."""
    return bool(np.linalg.eigvalsh(pseudo_inertia(parameters))[0] > 0.0)


def floored(parameters):
    """Return the pseudo-inertia with central second moments raised to a floor: points and rods."""
    J = pseudo_inertia(parameters)
    c = J[:3, 3] / J[3, 3]
    values, axes = np.linalg.eigh(J[:3, :3] - J[3, 3] * np.outer(c, c))
    least = max(FLOOR * values[-1], 1e-8 * J[3, 3])
    J[:3, :3] = axes @ np.diag(np.maximum(values, least)) @ axes.T + J[3, 3] * np.outer(c, c)
    return J


def share_out(parts, whole):
    """Return new pseudo-inertias A J A of a body's links, physical ones whose sum is `whole`.

    A is symmetric.
    """
    root = _root(sum(parts))
    inverse = np.linalg.inv(root)
    A = inverse @ _root(root @ whole @ root) @ inverse
    return [A @ part @ A for part in parts]


def _root(J):
    values, axes = np.linalg.eigh(J)
    return axes @ np.diag(np.sqrt(np.maximum(values, 0.0))) @ axes.T
