# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Modes of flexible links: their efforts, energy and slopes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.description.checks import warn
from diag_dynamics.description.flexible_links import LARGE_SLOPE
from diag_dynamics.description.records import FlexibleLink
from diag_dynamics.model.joint_types import places

if TYPE_CHECKING:
    from diag_dynamics.model.robot import RobotModel


def bending_energy(curvature: Array, slope: Array) -> float:
    """Return U₄₆ = ½ Σ κ²(σ² + σ⁴) [J].

    It is what the energy of a beam's curve, ½ ∫ EI κ²/(1 − σ²) dx, has beyond ½ ∫ EI κ² dx.
    """
    return 0.5 * float((curvature**2 * (slope**2 + slope**4)).sum())


def modal_effort(model: RobotModel, q: Array, qd: Array) -> Array:
    """Return the efforts of stiffness and damping of all modes, shape (nv,)."""
    effort = np.zeros(model.nv)
    for link in model.flexible_links.values():
        dofs = places(link.modes, model.dof_names)
        effort[dofs] = link.effort(_positions(model, link, q), qd[dofs])
    return effort


def _positions(model: RobotModel, link: FlexibleLink, q: Array) -> Array:
    """Return the positions of a link's modes."""
    return q[places(link.modes, model.coordinate_names)]


def warn_of_slopes(model: RobotModel, q: Array) -> None:
    """Warn of links that bend beyond what assumed modes can describe."""
    for name, link in model.flexible_links.items():
        if link.slope(_positions(model, link, q)) > LARGE_SLOPE:
            warn(
                f"The slope of flexible link '{name}' exceeds {LARGE_SLOPE:g} rad. "
                "Divide it into two links."
            )
