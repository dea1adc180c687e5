# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The transient contact of two masses and a spring: the model of ISO/TS 15066, now in ISO 10218-2, on numbers or arrays.

A robot of the reflected mass m_u comes with the speed v along u to a body region of the mass m_H, free to move, which feels
it through a spring k. In the frame of the common centre of mass ½μv² is all there is, 1/μ = 1/m_u + 1/m_H; the spring takes
it up: ½F²/k = ½μv².
"""

from __future__ import annotations

from typing import Any

import numpy as np


def reduced_mass(reflected_mass: Any, mass: Any = np.inf) -> Any:
    """μ = (1/m_u + 1/m_H)⁻¹ [kg] of a reflected mass and one that is free to move; with inf, clamped, the former."""
    with np.errstate(divide="ignore"):
        return 1.0 / (1.0 / np.asarray(reflected_mass, float) + 1.0 / np.asarray(mass, float))


def contact_force(speed: Any, reflected_mass: Any, stiffness: Any, mass: Any = np.inf) -> Any:
    """Force v√(μk) [N], the largest of a transient contact of the speed v [m/s] against a stiffness k [N/m]."""
    return np.asarray(speed, float) * np.sqrt(reduced_mass(reflected_mass, mass) * stiffness)


def contact_energy(force: Any, stiffness: Any) -> Any:
    """E = F²/2k [J]: what a spring k [N/m] has taken up at the force F [N]."""
    return np.asarray(force, float) ** 2 / (2.0 * np.asarray(stiffness, float))


def speed_of_force(force: Any, reflected_mass: Any, stiffness: Any, mass: Any = np.inf) -> Any:
    """The speed F/√(μk) [m/s] at which a transient contact reaches the force F [N]."""
    return np.asarray(force, float) / np.sqrt(reduced_mass(reflected_mass, mass) * stiffness)


def speed_of_energy(energy: Any, reflected_mass: Any) -> Any:
    """The speed √(2E/m_u) [m/s] at which the transferable energy ½m_u v² is E [J]."""
    return np.sqrt(2.0 * np.asarray(energy, float) / np.asarray(reflected_mass, float))


def simplified_mass(moving_mass: float, payload: float = 0.0) -> float:
    """m_R = M/2 + m_L [kg]: half the mass of the robot's moving parts, and its payload, as ISO/TS 15066 simplifies it.

    For comparison: it knows neither pose nor direction, and can be too small as well as too large.
    """
    return 0.5 * moving_mass + payload
