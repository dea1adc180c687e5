# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inertial parameters of a body: ten numbers, its 4x4 pseudo-inertia, and the shares of its links."""

import numpy as np

from diag_dynamics.identification.kernels.regressors import PARAMETERS

ORDER = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))  # rotational inertia in the order of the parameters
UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))  # and of BODY and LINK
FLOOR = 1e-3  # smallest variance of a body's mass along an axis, relative to the largest


def parameters_of(mass, first_moment, rotational):
    """Return ten parameters, given mass, mass times centre, and 3x3 inertia about the origin."""
    return np.array([mass, *first_moment, *(rotational[i, j] for i, j in ORDER)])


def of_body(mass, centre, about_centre):
    """Return ten parameters, given mass, centre of mass and 3x3 inertia about it."""
    c = np.asarray(centre, dtype=float)
    rotational = np.asarray(about_centre) + mass * (c @ c * np.eye(3) - np.outer(c, c))
    return parameters_of(mass, mass * c, rotational)


def parameters_of_record(record):
    """Return ten parameters of a record of BODY or LINK, in the body's frame."""
    return parameters_of(record["mass"], record["first_moment"], _symmetric(record["inertia"], UPPER))


def rotational_of(parameters):
    """Return the 3x3 inertia about the origin."""
    return _symmetric(parameters[4:], ORDER)


def _symmetric(six, order):
    rotational = np.zeros((3, 3))
    for value, (i, j) in zip(six, order, strict=True):
        rotational[i, j] = rotational[j, i] = value
    return rotational


def pseudo_inertia(parameters):
    """Return the 4x4 pseudo-inertia ∫ (r, 1)(r, 1)ᵀ dm, positive definite for a physical body."""
    rotational = rotational_of(parameters)
    J = np.empty((4, 4))
    J[:3, :3] = 0.5 * np.trace(rotational) * np.eye(3) - rotational
    J[:3, 3] = J[3, :3] = parameters[1:4]
    J[3, 3] = parameters[0]
    return J


def parameters_of_pseudo(J):
    """Return ten parameters of a 4x4 pseudo-inertia."""
    return parameters_of(J[3, 3], J[:3, 3], np.trace(J[:3, :3]) * np.eye(3) - J[:3, :3])


BASIS = np.array([pseudo_inertia(unit) for unit in np.eye(PARAMETERS)])
"""Pseudo-inertia of each parameter, (10, 4, 4): J is linear in them."""


def moved(parameters, placement):
    """Return ten parameters in the frame of a 4x4 placement, of those in the placed frame."""
    return parameters_of_pseudo(placement @ pseudo_inertia(parameters) @ placement.T)


def about_centre(parameters):
    """Return mass, centre of mass and 3x3 inertia about it."""
    mass, h = float(parameters[0]), parameters[1:4]
    if mass == 0.0:
        return 0.0, np.zeros(3), rotational_of(parameters)
    c = h / mass
    return mass, c, rotational_of(parameters) - mass * (c @ c * np.eye(3) - np.outer(c, c))


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
    """Return pseudo-inertias of the links of a body, given their old ones and the body's new one.

    J = Σ A J_part A with the symmetric A that maps the old sum to the new one, so that every part
    stays physical.
    """
    root = _power(sum(parts), 0.5)
    inverse = np.linalg.inv(root)
    A = inverse @ _power(root @ whole @ root, 0.5) @ inverse
    return [A @ part @ A for part in parts]


def _power(J, exponent):
    values, axes = np.linalg.eigh(J)
    return axes @ np.diag(np.maximum(values, 0.0) ** exponent) @ axes.T
