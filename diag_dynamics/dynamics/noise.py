# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Noise of external torque, and the links that may be touched."""

from __future__ import annotations

from typing import Any

import numpy as np

from diag_dynamics import checks
from diag_dynamics.arrays import Array, PointLike
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import RobotModel
from diag_dynamics.numerics.tables import Addresses
from diag_dynamics.sweeps import external

FORCES = 7.0, 18.0, 33.0
"""Magnitudes of a contact force [N] that are equally probable."""

MARGIN = 0.05
"""Distance of a link's surface from its frames [m]."""

SYMMETRIC = 1e-6
"""Maximum asymmetry of a covariance, as a fraction of the deviations of both joints."""


def whitening(model: RobotModel, covariance: Any) -> Array:
    """Return W of a covariance Σ, upper triangular with WᵀW = Σ⁻¹; the identity of None."""
    count = model.nv
    if not count:
        raise InputError(f"robot '{model.name}' has no moving joint; expected at least one.")
    if covariance is None:
        return np.eye(count)
    expected = f"finite numbers, shape ({count}, {count}), in the order of model.dof_names"
    array = checks.numbers("covariance", covariance, (count, count), expected)
    deviation = np.sqrt(np.abs(np.diag(array)))
    size = np.outer(deviation, deviation)
    if (np.abs(array - array.T) > SYMMETRIC * size).any():
        raise InputError(
            "covariance is not symmetric; expected the second moment of external torque."
        )
    try:
        reversed_factor = np.linalg.cholesky(array[::-1, ::-1])
        return np.triu(np.linalg.inv(reversed_factor)[::-1, ::-1])
    except np.linalg.LinAlgError:
        smallest = np.linalg.eigvalsh(array)[0]
        raise InputError(
            f"covariance has the eigenvalue {smallest:.3g}; expected all of them > 0. "
            "Calibrate with a recording in which all joints move."
        ) from None


def candidates(
    model: RobotModel, covariance: Any, significance: float, forces: PointLike
) -> tuple[tuple[str, ...], Addresses]:
    """Return the links that may be touched and their table for sweeps.external.touched_link."""
    z = checks.number(
        "significance", significance, "a number >= 0 and <= 1e9", lambda x: 0.0 <= x <= 1e9
    )
    names = [f"{k}" for k in range(max(np.size(forces), 1))]
    magnitudes = checks.per_name(
        "forces", forces, names, "a finite number > 0 and <= 1e9", lambda x: 0.0 < x <= 1e9
    )
    W = whitening(model, covariance)
    links, records = touchable_bodies(model)
    # Wilson and Hilferty: the cube root of χ²/nv is nearly normal.
    part = 2.0 / (9.0 * model.nv)
    threshold = model.nv * max(1.0 - part + z * part**0.5, 0.0) ** 3
    table = Addresses(
        external.CANDIDATES,
        bodies=records.ravel(),
        forces=np.square(magnitudes),
        threshold=threshold,
        whitening=W,
    )
    return links, table


def touchable_bodies(model: RobotModel) -> tuple[tuple[str, ...], Any]:
    """Return the links that may be touched, and of each its box and the points near its origin.

    Shape (number of links, 2), of external.CANDIDATE.
    """
    bodies = model.bodies
    numbers = 1 + np.flatnonzero(bodies["rank"][1:] == bodies["dofs"][1:] - 1)
    links = tuple(model.link_names[k] for k in bodies["link"][numbers])
    records = np.zeros((len(numbers), 2), external.CANDIDATE)
    for pair, number, link in zip(records, numbers, links, strict=True):
        X = model.placement_in_body(link)[1]
        R = X[:3, :3]
        t = X[:3, 3]
        points = (_points(model, int(number)) - t) @ R
        whole = points.min(axis=0), points.max(axis=0)
        for record, (low, high) in zip(pair, (whole, (np.zeros(3), np.zeros(3))), strict=True):
            square = (high - low + 2.0 * MARGIN) ** 2 / 12.0  # second moments about the centre
            record["body"] = number
            record["point"] = R @ (low + high) / 2.0 + t
            record["spread"] = (np.sqrt((square.sum() - square) / 3.0)[:, None] * R.T).ravel()
    return links, records


def _points(model: RobotModel, number: int) -> Array:
    """Return the origins of a body's links and of the joints on it, and its centre of mass."""
    body = model.bodies[number]
    placed = [model.placement_in_body(name) for name in model.link_names]
    points = [X[:3, 3] for where, X in placed if where == number]
    points.extend(model.bodies["translation"][1:][model.bodies["parent"][1:] == number])
    if body["mass"] > 0.0:
        points.append(body["first_moment"] / body["mass"])
    return np.array(points)
