# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Estimate of an external wrench: weighted least squares by a singular value decomposition."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from diag_dynamics import checks
from diag_dynamics.arrays import Array, Frame, PointLike
from diag_dynamics.dynamics import noise
from diag_dynamics.dynamics.calls import Sweep
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import RobotModel
from diag_dynamics.model.links import point_in_body
from diag_dynamics.sweeps import kinematics

ROUNDING = 1e-13
"""Singular value below which a direction is rounding error, as a fraction of the largest one."""

MIXED = 1e-6
"""Entry of an unobserved direction above which that component of a wrench is unknown."""

BLOCK = 512
"""Number of states that are decomposed at once."""


class PointOfWrench(NamedTuple):
    """A point of a link at which a wrench is estimated."""

    body: int
    point: Array  # in the body's axes
    axes: Array  # S and the rotation from the body's axes to those of the link, shape (6, 6)
    in_world: bool  # whether the wrench is in the axes of the root link
    scale: Array  # max_deviation of each of six numbers
    weight: Array  # S: the scale, and zeros for the moment if there is a force alone
    whitening: Array  # Wᵀ, where WᵀW = Σ⁻¹, with columns of zeros up to six
    largest: float  # deviation of an observed direction, infinite without a covariance


def point_of_wrench(
    model: RobotModel,
    covariance: Any,
    link: str,
    point: PointLike,
    frame: Frame,
    force_only: bool,
    max_deviation: tuple[float, float],
) -> PointOfWrench:
    """Return the checked point of :meth:`DiagonalDynamics.wrench`."""
    scale = checks.per_name("max_deviation", max_deviation, ("force", "moment"))
    body, rotation, in_body = point_in_body(model, link, point, frame)
    if body == 0 and model.nv:
        raise InputError(f"link is '{link}'; expected a link that a joint moves.")
    W = noise.whitening(model, covariance)
    weight = np.repeat(scale * (1.0, not force_only), 3)
    turn = np.eye(3) if frame == "world" else rotation.T
    return PointOfWrench(
        body=body,
        point=in_body,
        axes=weight[:, None] * np.kron(np.eye(2), turn),
        in_world=frame == "world",
        scale=np.repeat(scale, 3),
        weight=weight,
        whitening=np.pad(W.T, ((0, 0), (0, max(0, 6 - model.nv)))),
        largest=np.inf if covariance is None else 1.0,
    )


def sweep(point: PointOfWrench) -> Sweep:
    """Return the sweep of the wrenches at a point."""

    def many(robot: int, Q: Array, TAU: Array, begin: int, end: int, *results: Array) -> int:
        for first in range(begin, end, BLOCK):
            last = min(first + BLOCK, end)
            wrenches = _estimate(robot, point, Q[first:last], TAU[first:last])
            stop = first + len(wrenches[0])
            for result, rows in zip(results, wrenches, strict=True):
                result[first:stop] = rows
            if stop < last:
                return stop
        return end

    def single(robot: int, q: Array, torque: Array, *results: Array) -> int:
        wrenches = _estimate(robot, point, q[None], torque[None])
        if not len(wrenches[0]):
            return kinematics.placement(robot, q, point.body, np.empty((3, 4))) or -1
        for result, rows in zip(results, wrenches, strict=True):
            result[...] = rows[0]
        return 0

    return Sweep(single, many)


def _estimate(robot: int, point: PointOfWrench, Q: Array, TAU: Array) -> tuple[Any, ...]:
    """Return the fields of :class:`ExternalWrench` at all states before the first that fails."""
    G = np.empty((len(Q), 7, TAU.shape[1]))  # S J, and below it the torque
    G[:, 6] = TAU
    valid = kinematics.jacobians(robot, point.body, point.point, point.in_world, Q, G)
    G = G[:valid]
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        G[:, :6] = point.axes @ G[:, :6]
        G = G @ point.whitening
        finite = np.isfinite(G).all(axis=(1, 2))
        return _decompose(G if finite.all() else G[: finite.argmin()], point)


def _decompose(G: Array, point: PointOfWrench) -> tuple[Any, ...]:
    """Return the wrenches of S J Wᵀ and, below it, Wτ.

    Of S J Wᵀ = U diag(z) Vᵀ the columns of S U are directions with independent estimates VᵀWτ/z,
    whose standard deviations are 1/z.
    """
    y = G[:, 6:]
    U, z, Vt = np.linalg.svd(G[:, :6], full_matrices=False)
    deviation = np.where(z > ROUNDING * z[:, :1], 1.0 / z, np.inf)
    observed = np.isfinite(deviation) & (deviation <= point.largest)
    units = U.swapaxes(1, 2)
    directions = point.scale * units
    factor = np.where(observed, deviation, 0.0)[:, :, None] * directions
    covariance = factor.swapaxes(1, 2) @ factor
    is_mixed = (np.abs(units) > MIXED) & ~observed[:, :, None] & (point.weight > 0.0)
    state, component = is_mixed.any(axis=1).nonzero()
    covariance[state, component, component] = np.inf
    along = observed[:, None] * (y @ Vt.swapaxes(1, 2))
    wrench = along @ factor
    rest = y - along @ Vt
    chi_square = rest @ rest.swapaxes(1, 2)
    return wrench[:, 0], covariance, directions, deviation, observed, chi_square[:, 0, 0]
