# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pose regulation of a frame of the robot."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from diag_dynamics import rotations
from diag_dynamics.arrays import Array, MatrixLike, VectorLike
from diag_dynamics.checks import numbers, per_name, positive
from diag_dynamics.control.command import Command, PoseError
from diag_dynamics.control.laws import Law
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError

ORTHOGONAL = 1e-6
"""Maximum deviation of RᵀR of a desired orientation from the identity."""

UNIT = 1e-3
"""Maximum deviation of a quaternion's length from 1."""


class PoseRegulation(Law):
    """Pose regulation ε = −c₁ν + ℓJᵀC₂e (Control 8.2, with the sign that converges): springs pull a frame to its target.

    e = Y_d − Y(q), Y the frame's position and its three axes a_j, and JᵀC₂e = J₆ᵀ[c_p; Σ a_j × c_j] with c = C₂e, a wrench
    at the frame. V = ½|ν|² + ½eᵀC₂e falls at −νᵀc₁ν, which includes the null space of a redundant arm. The robot comes to
    rest where ℓJᵀC₂e = 0: at the target; at a singularity or a target out of reach; and at an orientation error of exactly
    180°, if its stiffness is the same about all axes.

    Parameters
    ----------
    dynamics : DiagonalDynamics
    link : str
        Link of the frame.
    damping : float or array_like, shape (nv,)
        c₁ > 0 [1/s], one for all total rates or one for each.
    position_stiffness : float or array_like, shape (3,)
        C₂ of the position, > 0 [N/m], one number or one for each of the root link's axes.
    orientation_stiffness : float
        Stiffness against small rotations, > 0 [N m/rad]: twice the weight C₂ of an axis.
    point : array_like, shape (3,)
        Origin of the frame, from the link's origin in the link's axes [m]; the axes are the link's.
    """

    METHODS = (*Law.METHODS, "placement", "epsilon_from_wrench")

    def __init__(
        self,
        dynamics: DiagonalDynamics,
        link: str,
        damping: VectorLike | float,
        position_stiffness: VectorLike | float,
        orientation_stiffness: float,
        point: VectorLike = (0.0, 0.0, 0.0),
    ) -> None:
        super().__init__(dynamics)
        if link not in dynamics.model.link_names:
            raise InputError(f"'{link}' is not a link of robot '{dynamics.model.name}'.")
        self.link = link
        self.damping = per_name("damping", damping, dynamics.model.dof_names, "a finite number > 0 [1/s]")
        self.position_stiffness = per_name("position_stiffness", position_stiffness, "xyz", "a finite number > 0 [N/m]")
        self.orientation_stiffness = positive("orientation_stiffness", orientation_stiffness, "[N m/rad]")
        self.point = numbers("point", point, (3,), "three finite numbers [m]")
        self._position: Array | None = None
        self._axes: Array | None = None

    def aim(self, position: VectorLike | None = None, orientation: MatrixLike | None = None) -> None:
        """Set the target, which a command requires; a part that is None is not regulated.

        Parameters
        ----------
        position : array_like, shape (3,), optional
            In the root link's axes, from its origin [m].
        orientation : array_like, shape (3, 3) or (4,), optional
            Rotation matrix with the frame's axes as columns, or unit quaternion (x, y, z, w), in the root link's axes.
        """
        if position is None and orientation is None:
            raise InputError("position and orientation are both None: there is nothing to aim at.")
        axes = None if orientation is None else rotation_of(orientation)
        self._position = None if position is None else numbers("position", position, (3,), "three finite numbers [m]")
        self._axes = axes

    def pose(self, q: VectorLike) -> tuple[Array, Array]:
        """Return the frame's position [m], shape (3,), and axes as columns, shape (3, 3), at q in the root link's axes."""
        X = self.dynamics.placement(q, self.link)
        return X[:3, :3] @ self.point + X[:3, 3], X[:3, :3]

    def command(self, q: VectorLike, qd: VectorLike) -> Command:
        """Return the command at the positions q [rad, m] and rates qd [rad/s, m/s], each of shape (nv,)."""
        if self._position is None and self._axes is None:
            raise InputError("PoseRegulation has no target: call aim first.")
        nu = self.dynamics.nu_from_qd(q, qd)
        position, axes = self.pose(q)
        wrench, stored, distance, rotation = np.zeros(6), 0.0, None, None
        if self._position is not None:
            distance = self._position - position
            wrench[:3] = self.position_stiffness * distance
            stored += 0.5 * float(wrench[:3] @ distance)
        if self._axes is not None:
            weight, R = 0.5 * self.orientation_stiffness, self._axes @ axes.T
            wrench[3:] = weight * rotations.vee(R)  # Σ a_j × (a_dj − a_j)
            stored += weight * (3.0 - float(np.trace(R)))  # ½ Σ |a_dj − a_j|²
            rotation = rotations.to_vector(R)
        spring = self.dynamics.epsilon_from_wrench(q, self.link, wrench, self.point, "world")
        damped = self.damping * nu
        lyapunov, rate = 0.5 * float(nu @ nu) + stored, -float(nu @ damped)
        return self._command(q, nu, spring - damped, lyapunov, rate, PoseError(distance, rotation))


def rotation_of(orientation: Any) -> Array:
    """Return the rotation matrix of a unit quaternion (x, y, z, w) or a rotation matrix."""
    expected = "a rotation matrix or a unit quaternion (x, y, z, w)"
    try:
        shape = np.shape(orientation)
    except ValueError:
        shape = None
    array = numbers("orientation", orientation, (4,) if shape == (4,) else (3, 3), expected)
    if shape == (4,):
        length = math.sqrt(float(array @ array))
        if abs(length - 1.0) > UNIT:
            raise InputError(f"orientation is {array.tolist()}, of length {length:.6g}, expected {expected}.")
        return rotations.from_quaternion(*array)
    if np.abs(array.T @ array - np.eye(3)).max() > ORTHOGONAL or np.linalg.det(array) < 0.0:
        raise InputError(f"orientation is {array.tolist()}, expected {expected}.")
    return array
