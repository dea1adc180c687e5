# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact of two masses: the transient one against a spring, and the impact that is over at once.

The transient model is that of ISO/TS 15066, now in ISO 10218-2. A robot of reflected mass m_u comes with the speed v along
u to a body region of the mass m_H, free to move, with a stiffness k. In the frame of the common centre of mass the energy is
½μv², 1/μ = 1/m_u + 1/m_H; the spring takes it up: ½F²/k = ½μv².
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.checks import number, positive


def reduced_mass(reflected_mass: Any, mass: Any = np.inf) -> Any:
    """Return μ = (1/m_u + 1/m_H)⁻¹ [kg]; a mass of inf is clamped."""
    with np.errstate(divide="ignore"):
        return 1.0 / (1.0 / np.asarray(reflected_mass, float) + 1.0 / np.asarray(mass, float))


def contact_force(speed: Any, reflected_mass: Any, stiffness: Any, mass: Any = np.inf) -> Any:
    """Return the largest force v√(μk) [N] of a transient contact of speed v [m/s] against a stiffness k [N/m]."""
    return np.asarray(speed, float) * np.sqrt(reduced_mass(reflected_mass, mass) * stiffness)


def contact_energy(force: Any, stiffness: Any) -> Any:
    """Return the energy E = F²/2k [J] of a spring k [N/m] at the force F [N]."""
    return np.asarray(force, float) ** 2 / (2.0 * np.asarray(stiffness, float))


def speed_of_force(force: Any, reflected_mass: Any, stiffness: Any, mass: Any = np.inf) -> Any:
    """Return the speed F/√(μk) [m/s] at which a transient contact reaches the force F [N]."""
    return np.asarray(force, float) / np.sqrt(reduced_mass(reflected_mass, mass) * stiffness)


def speed_of_energy(energy: Any, reflected_mass: Any) -> Any:
    """Return the speed √(2E/m_u) [m/s] at which the transferable energy ½m_u v² is E [J]."""
    return np.sqrt(2.0 * np.asarray(energy, float) / np.asarray(reflected_mass, float))


def simplified_mass(moving_mass: float, payload: float = 0.0) -> float:
    """Return m_R = M/2 + m_L [kg] of ISO/TS 15066: half the mass of the moving parts, and the payload.

    For comparison: independent of pose and direction, it can be too small as well as too large.
    """
    return 0.5 * moving_mass + payload


class Impact(NamedTuple):
    """An impact that is over at once, along a direction u at a point of a link. Arrays have shape (nv,).

    Attributes
    ----------
    nu : ndarray
        ν before it [J^½].
    nu_after : ndarray
        ν⁺ = ν − (1+e) μ v_u w [J^½], w = ℓJᵀu.
    qd_after : ndarray
        q̇⁺ = ℓᵀν⁺ [rad/s, m/s].
    along : ndarray
        ŵ(ŵᵀν) [J^½], the part of ν that the impact changes: ½|along|² is the transferable energy.
    rest : ndarray
        ν − along [J^½], which it leaves as it is.
    speed : float
        v_u before it [m/s]; where it is not above zero, nothing happens.
    reflected_mass : float
        m_u [kg].
    impulse : float
        (1+e) μ v_u [N s] along −u on the robot.
    mass_speed : float
        Speed along u that the free mass has afterwards [m/s]; zero of one that is clamped.
    loss : float
        ½(1−e²) μ v_u² [J], lost by both together.
    """

    nu: Array
    nu_after: Array
    qd_after: Array
    along: Array
    rest: Array
    speed: float
    reflected_mass: float
    impulse: float
    mass_speed: float
    loss: float


def impact(nu: Array, w: Array, mass: float = math.inf, restitution: float = 0.0) -> Impact:
    """Return ν⁺ of an impact with a mass at rest; `qd_after` is empty, :meth:`DiagonalDynamics.impact` computes it.

    w = ℓJᵀu [kg^−½] is that of the direction u at the point; the mass m_H [kg] is free to move, or clamped if inf; the
    restitution e is within 0 and 1.
    """
    if mass != math.inf:
        mass = positive("mass", mass, "[kg]")
    e = number("restitution", restitution, "a number from 0 to 1", lambda x: 0.0 <= x <= 1.0)
    square = float(w @ w)
    speed = float(w @ nu)
    along = w * (speed / square) if square > 0.0 else np.zeros_like(nu)
    reflected = 1.0 / square if square > 0.0 else math.inf
    mu = float(reduced_mass(reflected, mass)) if speed > 0.0 and square > 0.0 else 0.0
    impulse = (1.0 + e) * mu * max(speed, 0.0)
    return Impact(
        nu=nu,
        nu_after=nu - impulse * w,
        qd_after=np.empty(0),
        along=along,
        rest=nu - along,
        speed=speed,
        reflected_mass=reflected,
        impulse=impulse,
        mass_speed=0.0 if mass == math.inf else impulse / mass,
        loss=0.5 * (1.0 - e * e) * mu * max(speed, 0.0) ** 2,
    )
