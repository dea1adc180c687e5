# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Modes of flexible links: their efforts, energy and slopes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.description.checks import warn
from diag_dynamics.description.flexible_links import LARGE_SLOPE
from diag_dynamics.description.records import FlexibleLink

if TYPE_CHECKING:
    from diag_dynamics.model.robot import RobotModel


def bending_energy(curvature: Array, slope: Array) -> float:
    """Return U₄₆ = ½ Σ κ²(σ² + σ⁴) [J].

    It is what the energy of a beam's curve, ½ ∫ EI κ²/(1 − σ²) dx, has beyond ½ ∫ EI κ² dx.
    """
    return 0.5 * float((curvature**2 * (slope**2 + slope**4)).sum())


def modal_effort(model: RobotModel, q: Array, qd: Array) -> Array:
    """Return the efforts of stiffness and damping of all modes, shape (nv,)."""
    effort, locked = np.zeros(model.nv), model.locked_joints
    for link in model.flexible_links.values():
        values = link.effort(
            _values(link, model.coordinate_names, q, locked),
            _values(link, model.dof_names, qd, dict.fromkeys(locked, 0.0)),
        )
        for name, value in zip(link.modes, values, strict=True):
            if name not in locked:
                effort[model.dof_names.index(name)] = value
    return effort


def _values(
    link: FlexibleLink, names: tuple[str, ...], values: Array, locked: Mapping[str, float]
) -> Array:
    """Return the entries of a link's modes in a vector, and values of locked modes."""
    return np.array(
        [locked[mode] if mode in locked else values[names.index(mode)] for mode in link.modes]
    )


def warn_of_slopes(model: RobotModel, q: Array) -> None:
    """Warn of links that bend beyond what assumed modes can describe."""
    for name, link in model.flexible_links.items():
        if link.slope(_values(link, model.coordinate_names, q, model.locked_joints)) > LARGE_SLOPE:
            warn(
                f"The slope of flexible link '{name}' exceeds {LARGE_SLOPE:g} rad. "
                "Divide it into two links."
            )
