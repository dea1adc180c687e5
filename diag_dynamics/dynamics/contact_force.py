# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Magnitude of a contact force on any link, by the evidence of the touched link."""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import Any

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.dynamics import noise
from diag_dynamics.model import RobotModel
from diag_dynamics.sweeps import external, kinematics

LEVELS = 0.16, 0.84
"""Quantiles at the ends of an interval."""

QUANTILES = np.array([NormalDist().inv_cdf((k + 0.5) / 12.0) for k in range(12)])
"""Standard normal quantiles in the middle of twelve equally probable parts."""


class ContactForce:
    """Magnitude |f| of a contact force from external torque τ̂ with noise Σ.

    For each link, region of points and magnitude F of :mod:`noise` f and τ̂ are normal. Of |f|² the
    first three cumulants are those of a shifted χ², whose quantiles have the weight of the
    evidence for τ̂. Used by one thread at a time.
    """

    def __init__(self, model: RobotModel, covariance: Array) -> None:
        self._workspace = model.new_workspace()
        self._dofs = model.nv
        self._whitening = noise.whitening(model, covariance)
        self._bodies = noise.touchable_bodies(model)[1].ravel()

    def interval(self, q: Array, torque: Array) -> Array:
        """Return the interval that has |f| with a probability of 68 % [N], shape (T, 2)."""
        y = torque @ self._whitening.T
        parts = [_cumulants(self._rows(body, q), y) for body in self._bodies]
        evidence, *cumulants = np.concatenate(parts, axis=1)
        weight = np.exp(evidence - evidence.max(axis=0))
        squares = _quantiles(*cumulants).reshape(-1, len(q))
        order = squares.argsort(axis=0)
        weight = np.take_along_axis(np.tile(weight, (len(QUANTILES), 1)), order, axis=0)
        share = weight.cumsum(axis=0) / weight.sum(axis=0)
        places = np.array([(share < level).sum(axis=0) for level in LEVELS])
        squares = np.take_along_axis(squares, order, axis=0)
        return np.sqrt(np.take_along_axis(squares, places, axis=0)).T

    def _rows(self, body: Any, q: Array) -> Array:
        """Return GWᵀ of torque τ = F Gᵀu by a standard normal u of six numbers, (T, 6, nv)."""
        J = np.empty((len(q), 6, self._dofs))
        place = int(body["body"]), body["point"], False
        kinematics.jacobians(self._workspace.robot, *place, q, J)
        J[:, :3] *= external.SQRT_THIRD
        J[:, 3:] = body["spread"].reshape(3, 3) @ J[:, 3:]
        return J @ self._whitening.T


def _cumulants(G: Array, y: Array) -> Array:
    """Return log evidence of Wτ̂ and θₖ = tr Pᵏ + k μᵀPᵏ⁻¹μ, shape (4, number of F, T).

    μ and P are mean and covariance of f. |f|² has the cumulants θ₁, 2θ₂ and 8θ₃.
    """
    values, axes = np.linalg.eigh(G @ G.swapaxes(1, 2))
    along = (axes.swapaxes(1, 2) @ (G @ y[:, :, None]))[..., 0]
    square = np.square(noise.FORCES)[:, None, None]
    gain = 1.0 / (1.0 + square * np.maximum(values, 0.0))
    evidence = 0.5 * (square * gain * along**2 + np.log(gain)).sum(axis=-1)
    U = axes[:, :3]
    variance = square[..., None] / 3.0
    mean = math.sqrt(3.0) * variance * (U @ (gain * along)[..., None])
    P = variance * (U * gain[:, :, None]) @ U.swapaxes(1, 2)
    terms = [evidence]
    power = np.eye(3)
    for k in (1, 2, 3):
        moved = (mean * (power @ mean)).sum(axis=(2, 3))
        power = power @ P
        terms.append(np.trace(power, axis1=2, axis2=3) + k * moved)
    return np.array(terms)


def _quantiles(first: Array, second: Array, third: Array) -> Array:
    """Return quantiles of a shifted χ² with n degrees of freedom by its cumulants.

    Wilson and Hilferty: the cube root of χ²/n is nearly normal.
    """
    n = second**3 / third**2
    part = 2.0 / (9.0 * n)
    z = QUANTILES[:, None, None]
    chi_square = n * np.maximum(1.0 - part + z * np.sqrt(part), 0.0) ** 3
    return np.maximum(first + (chi_square - n) * np.sqrt(second / n), 0.0)
