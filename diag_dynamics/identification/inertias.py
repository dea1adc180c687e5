# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inertial parameters of a body: ten numbers, its 4x4 pseudo-inertia, and what of them belongs to which link."""

import numpy as np

from diag_dynamics.identification.kernels.regressors import PARAMETERS

ORDER = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
"""Entries of the rotational inertia, in the order of the parameters."""

UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
"""Entries of the rotational inertia, in the order that BODY and LINK have."""

FLOOR = 1e-3
"""Smallest variance of a body's mass along an axis, in parts of the largest."""


def parameters_of(mass, first_moment, rotational):
    """Ten parameters of mass, mass times centre, and 3x3 inertia about the origin."""
    return np.array([mass, *first_moment, *(rotational[i, j] for i, j in ORDER)])


def of_body(mass, centre, about_centre):
    """Ten parameters of mass, centre of mass and 3x3 inertia about it."""
    c = np.asarray(centre, dtype=float)
    return parameters_of(mass, mass * c, about_centre + mass * (c @ c * np.eye(3) - np.outer(c, c)))


def parameters_of_record(record):
    """Ten parameters of a record of BODY or LINK, in the body's frame."""
    return parameters_of(record["mass"], record["first_moment"], rotational_of_record(record["inertia"]))


def rotational_of_record(six):
    """3x3 inertia of six numbers as BODY and LINK have them."""
    rotational = np.zeros((3, 3))
    for value, (i, j) in zip(six, UPPER, strict=True):
        rotational[i, j] = rotational[j, i] = value
    return rotational


def pseudo_inertia(parameters):
    """4x4 pseudo-inertia ∫ (r, 1)(r, 1)ᵀ dm of ten parameters: positive definite for a body that can be."""
    mass, h = parameters[0], parameters[1:4]
    rotational = rotational_of(parameters)
    J = np.empty((4, 4))
    J[:3, :3] = 0.5 * np.trace(rotational) * np.eye(3) - rotational
    J[:3, 3] = J[3, :3] = h
    J[3, 3] = mass
    return J


def rotational_of(parameters):
    """3x3 inertia about the origin of ten parameters."""
    rotational = np.zeros((3, 3))
    for value, (i, j) in zip(parameters[4:], ORDER, strict=True):
        rotational[i, j] = rotational[j, i] = value
    return rotational


def parameters_of_pseudo(J):
    """Ten parameters of a 4x4 pseudo-inertia."""
    second = J[:3, :3]
    return parameters_of(J[3, 3], J[:3, 3], np.trace(second) * np.eye(3) - second)


BASIS = np.array([pseudo_inertia(unit) for unit in np.eye(PARAMETERS)])
"""Pseudo-inertia of each parameter, (10, 4, 4): it is linear in them."""


def moved(parameters, placement):
    """Ten parameters in the frame that a 4x4 placement is in, of those in the placed frame."""
    return parameters_of_pseudo(placement @ pseudo_inertia(parameters) @ placement.T)


def about_centre(parameters):
    """Mass, centre of mass and 3x3 inertia about it."""
    mass, h = parameters[0], parameters[1:4]
    if mass == 0.0:
        return 0.0, np.zeros(3), rotational_of(parameters)
    c = h / mass
    return float(mass), c, rotational_of(parameters) - mass * (c @ c * np.eye(3) - np.outer(c, c))


def is_physical(parameters):
    """Whether a body of positive density can have these parameters."""
    return bool(np.linalg.eigvalsh(pseudo_inertia(parameters))[0] > 0.0)


def floored(parameters):
    """The pseudo-inertia, its central second moments raised to a floor where they are smaller: points, rods, mistakes."""
    J = pseudo_inertia(parameters)
    c = J[:3, 3] / J[3, 3]
    values, axes = np.linalg.eigh(J[:3, :3] - J[3, 3] * np.outer(c, c))
    least = max(FLOOR * values[-1], 1e-8 * J[3, 3])
    J[:3, :3] = axes @ np.diag(np.maximum(values, least)) @ axes.T + J[3, 3] * np.outer(c, c)
    return J


def shared_out(parts, whole):
    """Pseudo-inertias of the links of a body, given those they had and what the body has now.

    J = Σ A J_part A with the symmetric A that takes the old whole to the new one, so that every part stays physical.
    """
    root = _power(sum(parts), 0.5)
    inverse = np.linalg.inv(root)
    A = inverse @ _power(root @ whole @ root, 0.5) @ inverse
    return [A @ part @ A for part in parts]


def _power(J, exponent):
    values, axes = np.linalg.eigh(J)
    return axes @ np.diag(np.maximum(values, 0.0) ** exponent) @ axes.T
