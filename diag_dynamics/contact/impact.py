# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact of two masses: the transient one against a spring, and the instantaneous impact.

The transient model is that of ISO/TS 15066, now in ISO 10218-2. A robot of the reflected mass m_u comes with the speed v
along u to a body region of the mass m_H, free to move, with a stiffness k. In the frame of the common centre of mass the
energy is ½μv², 1/μ = 1/m_u + 1/m_H; the spring takes it up: ½F²/k = ½μv².
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
    """Return the maximum force v√(μk) [N] of a transient contact at the speed v [m/s] with a stiffness k [N/m]."""
    return np.asarray(speed, float) * np.sqrt(reduced_mass(reflected_mass, mass) * stiffness)


def speed_of_force(force: Any, reflected_mass: Any, stiffness: Any, mass: Any = np.inf) -> Any:
    """Return the speed F/√(μk) [m/s] at which a transient contact reaches the force F [N]."""
    return np.asarray(force, float) / np.sqrt(reduced_mass(reflected_mass, mass) * stiffness)


def simplified_mass(moving_mass: float, payload: float = 0.0) -> float:
    """Return m_R = M/2 + m_L [kg] of ISO/TS 15066: half the mass of the moving parts, and the payload.

    For comparison: independent of pose and direction, it can be too small as well as too large.
    """
    return 0.5 * moving_mass + payload


class Impact(NamedTuple):
    """Instantaneous impact along a direction u at a point of a link. Arrays have shape (nv,)."""

    nu: Array  #: ν before it [J^½]
    nu_after: Array  #: ν⁺ = ν − (1+e) μ v_u w [J^½], w = ℓJᵀu
    qd_after: Array  #: q̇⁺ = ℓᵀν⁺ [rad/s, m/s]
    along: Array  #: ŵ(ŵᵀν) [J^½], the part of ν that changes: ½|along|² is the transferable energy
    rest: Array  #: ν − along [J^½], the part that stays
    speed: float  #: v_u before it [m/s]; unless it is above zero, nothing changes
    reflected_mass: float  #: m_u [kg]
    impulse: float  #: (1+e) μ v_u [N s] along −u on the robot
    mass_speed: float  #: speed of a free mass along u after it [m/s]; zero of a clamped one
    loss: float  #: ½(1−e²) μ v_u² [J] of both together


def impact(nu: Array, w: Array, mass: float = math.inf, restitution: float = 0.0) -> Impact:
    """Return the impact with a mass at rest; `qd_after` is empty, :meth:`DiagonalDynamics.impact` computes it.

    w = ℓJᵀu [kg^−½] belongs to the direction u at the point. The mass m_H [kg] is free to move, or clamped if inf. The
    restitution e is from 0 to 1.
    """
    mass = mass if mass == math.inf else positive("mass", mass, "[kg]")
    e = number("restitution", restitution, "a number from 0 to 1", lambda x: 0.0 <= x <= 1.0)
    square, speed = float(w @ w), float(w @ nu)
    moves = square > 0.0
    along = w * (speed / square) if moves else np.zeros_like(nu)
    reflected = 1.0 / square if moves else math.inf
    closing = max(speed, 0.0) if moves else 0.0
    mu = float(reduced_mass(reflected, mass)) if closing else 0.0
    impulse = (1.0 + e) * mu * closing
    mass_speed = 0.0 if mass == math.inf else impulse / mass
    loss = 0.5 * (1.0 - e * e) * mu * closing**2
    after, rest = nu - impulse * w, nu - along
    return Impact(nu, after, np.empty(0), along, rest, speed, reflected, impulse, mass_speed, loss)
