# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Output of laws and filters."""

from __future__ import annotations

from typing import NamedTuple

from diag_dynamics.arrays import Array


class PoseError(NamedTuple):
    """Error of a frame's pose in the root link's axes; a part that is not regulated is None.

    Attributes
    ----------
    position : ndarray, shape (3,), or None
        Desired less actual position [m].
    orientation : ndarray, shape (3,), or None
        Rotation vector from the actual to the desired orientation [rad].
    """

    position: Array | None
    orientation: Array | None


class Command(NamedTuple):
    """Joint efforts and their reasons: one evaluation of a law. Arrays have shape (nv,) and are the caller's own.

    Attributes
    ----------
    tau : ndarray
        Joint efforts [N m, N], τ = m(ε + ε_g).
    epsilon : ndarray
        Working moments ε that move the robot [J^½/s], without gravity.
    gravity_torque : ndarray
        g(q) [N m, N], the part of tau that holds the robot. A robot with gravity compensation of its own receives tau − g.
    nu : ndarray
        Total joint rates ν [J^½].
    lyapunov : float
        Lyapunov function V of the law [J].
    lyapunov_rate : float
        dV/dt [W] by the law alone: without filters, pushes and friction, for a target at rest.
    error : ndarray, PoseError or None
        Error that the law reduces: q_d − q of a joint-space target, a :class:`PoseError`, or None.
    scale : float
        Factor in [0, 1] on the part of tau that moves the robot, which respects the effort limits.
    limited : tuple of str
        Degrees of freedom at their effort limits.
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
