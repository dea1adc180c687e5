# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rigid bodies as values: mass, centre of mass and inertia about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from diag_dynamics.arrays import Array


def parallel_axes(mass: float, c: Array) -> Array:
    """Return m (c·c 1 − ccᵀ) [kg m²], the inertia of a point mass at c."""
    return mass * (c @ c * np.eye(3) - np.outer(c, c))


@dataclass(frozen=True, eq=False)
class RigidBody:
    """A rigid body, in the axes of some frame.

    Attributes
    ----------
    mass : float
        [kg].
    centre : ndarray, shape (3,)
        Centre of mass from the frame's origin [m].
    inertia : ndarray, shape (3, 3)
        About the centre [kg m²].
    """

    mass: float
    centre: Array
    inertia: Array

    @classmethod
    def about_origin(cls, mass: float, first_moment: Array, inertia: Array) -> RigidBody:
        """Return the body of a mass, not zero, a first moment [kg m] and an inertia there."""
        centre = first_moment / mass
        return cls(mass, centre, inertia - parallel_axes(mass, centre))

    def moved(self, placement: Array) -> RigidBody:
        """Return the body in the frame in which its own one has this placement (4, 4)."""
        R = placement[:3, :3]
        r = placement[:3, 3]
        return RigidBody(self.mass, R @ self.centre + r, R @ self.inertia @ R.T)

    @classmethod
    def union(cls, *bodies: RigidBody) -> RigidBody:
        """Return several bodies as one; masses may be negative, but their sum is not zero."""
        masses = [body.mass for body in bodies]
        mass = sum(masses)
        centre = np.dot(masses, [body.centre for body in bodies]) / mass
        inertia = np.zeros((3, 3))
        for body in bodies:
            inertia += body.inertia + parallel_axes(body.mass, body.centre - centre)
        return cls(mass, centre, inertia)


def symmetric(upper: Array) -> Array:
    """Return the matrix (3, 3) of xx, xy, xz, yy, yz, zz, the order of records.BODY and LINK."""
    xx, xy, xz, yy, yz, zz = upper
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


SQUARE = np.array([[0, 1, 3], [1, 2, 4], [3, 4, 5]])
"""Places of I_xx, I_xy, I_yy, I_xz, I_yz, I_zz, the last of ten parameters, in a matrix (3, 3)."""


def parameters_of_record(record: Any) -> Array:
    """Return ten parameters of a record of BODY or LINK, in the body's frame."""
    return np.r_[record["mass"], record["first_moment"], record["inertia"][[0, 1, 3, 2, 4, 5]]]


def pseudo_inertia(parameters: Array) -> Array:
    """Return ∫ (r, 1)(r, 1)ᵀdm of ten parameters, shape (4, 4).

    It is positive definite for a physical body.
    """
    rotational = np.asarray(parameters)[4:][SQUARE]
    J = np.empty((4, 4))
    J[:3, :3] = 0.5 * np.trace(rotational) * np.eye(3) - rotational
    J[:3, 3] = J[3, :3] = parameters[1:4]
    J[3, 3] = parameters[0]
    return J


def not_physical(inertia: Array, mass: float) -> str | None:
    """Return the reason why no rigid body has an inertia about its centre of mass, or None.

    Moments may be rounded to three digits.
    """
    moments = np.linalg.eigvalsh(np.asarray(inertia, np.float64))
    rounding = max(1e-3 * np.abs(moments).max(), 1e-12 * mass)
    shown = ", ".join(f"{moment:.3g}" for moment in moments)
    if moments[0] < -rounding:
        return f"whose principal moments {shown} are not all positive"
    if moments[2] > moments[0] + moments[1] + rounding:
        return f"whose principal moments {shown} break the triangle inequality"
    return None
