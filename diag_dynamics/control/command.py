# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What laws and filters hand on."""

from __future__ import annotations

from typing import NamedTuple

from diag_dynamics.arrays import Array


class PoseError(NamedTuple):
    """How far a frame is from where it should be, in the root link's axes.

    Attributes
    ----------
    position : ndarray, shape (3,), or None
        Desired less actual position [m]; None if it is not regulated.
    orientation : ndarray, shape (3,), or None
        Rotation vector from the actual to the desired orientation [rad]; None if it is not regulated.
    """

    position: Array | None
    orientation: Array | None


class Command(NamedTuple):
    """Efforts for the robot, and why: one evaluation of a law. Arrays have shape (nv,) and are the caller's own.

    Attributes
    ----------
    tau : ndarray
        Joint efforts to apply [N m, N], τ = m(ε + ε_g).
    epsilon : ndarray
        Working moments ε that move the robot [J^½/s]: gravity is not among them.
    gravity_torque : ndarray
        g(q) [N m, N], the part of tau that holds the robot. A robot that compensates its own gravity gets tau less this.
    nu : ndarray
        Total joint rates ν [J^½].
    lyapunov : float
        Lyapunov function V of the law [J].
    lyapunov_rate : float
        dV/dt [W] that the law promises where nothing else acts: no filter, no push, no friction, and a target at rest.
    error : ndarray, PoseError or None
        What the law drives to zero: q_d − q of a joint-space target, a :class:`PoseError`, or nothing.
    scale : float
        What the part of tau that moves the robot has been multiplied with to respect effort limits; 1 unless it had to be.
    limited : tuple of str
        Degrees of freedom whose limits made it so.
    """

    tau: Array
    epsilon: Array
    gravity_torque: Array
    nu: Array
    lyapunov: float
    lyapunov_rate: float
    error: Array | PoseError | None = None
    scale: float = 1.0
    limited: tuple[str, ...] = ()
