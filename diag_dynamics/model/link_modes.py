# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Modes of flexible links: their energy and slopes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from diag_dynamics.arrays import Array
from diag_dynamics.description.check_table import warn
from diag_dynamics.description.flexible_links import LARGE_SLOPE
from diag_dynamics.model.joint_types import places

if TYPE_CHECKING:
    from diag_dynamics.model.robot import RobotModel


def bending_energy(curvature: Array, slope: Array) -> float:
    """Return U₄₆ = ½ Σ κ²(σ² + σ⁴) [J].

    It is what the energy of a beam's curve, ½ ∫ EI κ²/(1 − σ²) dx, has beyond ½ ∫ EI κ² dx.
    """
    return 0.5 * float((curvature**2 * (slope**2 + slope**4)).sum())


def warn_of_slopes(model: RobotModel, q: Array) -> None:
    """Warn of links that bend beyond what assumed modes can describe."""
    for name, link in model.flexible_links.items():
        if link.slope(q[places(link.modes, model.coordinate_names)]) > LARGE_SLOPE:
            warn(
                f"The slope of flexible link '{name}' exceeds {LARGE_SLOPE:g} rad. "
                "Divide it into two links."
            )
