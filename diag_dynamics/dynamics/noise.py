# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments of estimates from external torque: its covariance, and the point of a wrench."""

from __future__ import annotations

from typing import Any

import numpy as np

from diag_dynamics import checks
from diag_dynamics.arrays import Array, Frame, PointLike
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import RobotModel
from diag_dynamics.numerics.tables import Addresses
from diag_dynamics.sweeps import external

SYMMETRIC = 1e-6
"""Maximum difference of two entries of a covariance, as a fraction of the deviations of both joints."""


def whitening(model: RobotModel, covariance: Any) -> Array:
    """Return W of a covariance Σ, lower triangular with WᵀW = Σ⁻¹; the identity of None."""
    count = model.nv
    if not count:
        raise InputError(f"robot '{model.name}' has no moving joint; expected at least one.")
    if covariance is None:
        return np.eye(count)
    array = checks.array_of(covariance)
    if array is None or array.shape != (count, count) or not np.isfinite(array).all():
        expected = f"finite numbers, shape ({count}, {count}), in the order of model.dof_names"
        raise InputError(f"covariance is {covariance!r:.200}; expected {expected}.")
    size = np.sqrt(np.outer(*[np.abs(np.diag(array))] * 2))
    if (np.abs(array - array.T) > SYMMETRIC * size).any():
        raise InputError("covariance is not symmetric; expected the second moment of external torque.")
    try:
        return np.tril(np.linalg.inv(np.linalg.cholesky(array)))
    except np.linalg.LinAlgError:
        smallest = np.linalg.eigvalsh(array)[0]
        raise InputError(
            f"covariance has the eigenvalue {smallest:.3g}; expected all of them > 0. Calibrate with a "
            "recording in which all joints move."
        ) from None


def point_of_wrench(
    model: RobotModel,
    link: str,
    covariance: Any,
    point: PointLike,
    frame: Frame,
    force_only: bool,
    max_deviation: tuple[float, float],
) -> Addresses:
    """Return the table of a point for sweeps.external.wrench."""
    checks.choice("frame", frame, ("link", "world"))
    offset = checks.numbers("point", point, (3,), "three finite numbers [m]")
    scale = checks.numbers("max_deviation", max_deviation, (2,), "two numbers > 0 [N, N m]")
    if not (scale > 0.0).all():
        raise InputError(f"max_deviation is {max_deviation!r}, expected two numbers > 0 [N, N m].")
    body, placement = model.placement_in_body(link)
    rotation = placement[:3, :3]
    return Addresses(
        external.POINT_OF_WRENCH,
        body=body,
        point=placement[:3, 3] + rotation @ offset,
        rotation=np.ascontiguousarray(rotation.T).ravel(),
        in_world=int(frame == "world"),
        scale=np.repeat(scale, 3),
        whitening=whitening(model, covariance),
        count=3 if force_only else 6,
    )
