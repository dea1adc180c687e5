# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Output of laws and filters."""

from __future__ import annotations

from typing import NamedTuple

from diag_dynamics.arrays import Array


class PoseError(NamedTuple):
    """Error of a frame's pose in the root link's axes, desired less actual; a part that is not regulated is None."""

    position: Array | None  # [m], shape (3,)
    orientation: Array | None  # rotation vector from the actual to the desired orientation [rad], shape (3,)


class Command(NamedTuple):
    """Joint efforts and their reasons: one evaluation of a law. Arrays have shape (nv,) and are the caller's own.

    A robot with gravity compensation of its own receives τ − g.
    """

    tau: Array  # joint efforts [N m, N], τ = m(ε + ε_g)
    epsilon: Array  # working moments ε that move the robot [J^½/s], without gravity
    gravity_torque: Array  # g(q) [N m, N], the part of tau that holds the robot
    nu: Array  # total joint rates ν [J^½]
    lyapunov: float  # Lyapunov function V of the law [J]
    lyapunov_rate: float  # dV/dt [W] by the law alone: without filters, pushes and friction, for a target at rest
    error: Array | PoseError | None = None  # what the law reduces: q_d − q of a joint-space target, or that of a pose
    scale: float = 1.0  # factor of the effort limits on the part of tau that moves the robot
    limited: tuple[str, ...] = ()  # degrees of freedom at their effort limits
