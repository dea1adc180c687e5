# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Predicted contact at the points of a robot, and impacts.

The transient model is that of ISO/TS 15066, now in ISO 10218-2. A robot of the reflected mass m_u
comes with the speed v along u to a body region of the mass m_H, free to move, with a stiffness k.
In the frame of the common centre of mass the energy is ½μv², 1/μ = 1/m_u + 1/m_H; the spring takes
it up: ½F²/k = ½μv².
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.checks import number, positive
from diag_dynamics.collision.contact_points import ContactPoints
from diag_dynamics.exceptions import InputError
from diag_dynamics.sweeps import contacts


def _column(index: int | slice, doc: str) -> Any:
    """Return a property that reads a column of the results, or several."""
    return property(lambda self: self._results[..., index], doc=doc)


_XYZ = tuple(slice(first, first + 3) for first in (contacts.POSITION, contacts.DIRECTION))


class PredictedContact:
    """Predicted contact at the worst point of each entry of :class:`ContactPoints`; read-only.

    Arrays have a number or three coordinates for each of `names`; those of many states have a row
    for each state.
    """

    __slots__ = ("_results", "links", "names", "nu", "points")

    points: ContactPoints
    names: tuple[str, ...]  #: of the entries
    links: tuple[str, ...]  #: of the entries
    nu: Array  #: ν [J^½], shape (nv,)

    def __init__(self, points: ContactPoints, nu: Array, results: Array) -> None:
        self.points = points
        self.names = points.names
        self.links = points.links
        self.nu = nu
        self._results = results
        nu.flags.writeable = results.flags.writeable = False

    position: Array = _column(_XYZ[0], "Worst point in the root link's axes [m].")
    direction: Array = _column(
        _XYZ[1], "Unit vector u of the motion in these axes; zero without one."
    )
    speed: Array = _column(contacts.SPEED, "v_u = uᵀv [m/s]; zero where nothing is transferred.")
    reflected_mass: Array = _column(
        contacts.MASS, "m_u = 1/|ℓJᵀu|² [kg]; inf without mobility, zero without motion."
    )
    energy: Array = _column(contacts.TRANSFERABLE, "Transferable energy ½(ŵᵀν)² [J].")
    force: Array = _column(
        contacts.FORCE, "v_u √(μk) [N], maximum of the entry's body regions; zero without any."
    )
    allowed_speed: Array = _column(
        contacts.ALLOWED, "Maximum v_u within all limits [m/s]; inf without a limit or u."
    )

    @property
    def point(self) -> Any:
        """Index of the worst one among the entry's points."""
        return self._results[..., contacts.POINT].astype(int) - self.points.starts[:-1]

    @property
    def margin(self) -> Array:
        """Allowed speed less speed [m/s]: below zero above a limit, inf without one."""
        margin: Array = self.allowed_speed - self.speed
        return margin

    @property
    def usage(self) -> Array:
        """Ratio of speed to allowed speed: above 1 above a limit, zero without one."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.speed / self.allowed_speed
        return np.where(np.isnan(ratio), 0.0, ratio)

    @property
    def worst(self) -> Any:
        """Entry of the smallest margin; without limits, of the largest energy.

        It is -1 if all points are at rest.
        """
        margin = self.margin
        energy = self.energy
        if not energy.shape[-1]:
            return np.full(energy.shape[:-1], -1)[()]
        limited = margin.min(axis=-1) < np.inf
        chosen = np.where(limited, np.argmin(margin, axis=-1), np.argmax(energy, axis=-1))
        return np.where(energy.max(axis=-1) > 0.0, chosen, -1)[()]

    def region(self, k: int, t: int | None = None) -> str:
        """Return the body region with the strictest limit at entry k, or an empty text.

        Of many states it is that of state t.
        """
        index = int((self._results if t is None else self._results[t])[k, contacts.REGION])
        return self.points.region_names[index] if index >= 0 else ""

    def __len__(self) -> int:
        return self._results.shape[-2]


# --- Contact of two masses: transient against a spring, and an instantaneous impact


class Impact(NamedTuple):
    """Instantaneous impact along a direction u at a point of a link. Arrays have shape (nv,)."""

    nu: Array  #: ν before it [J^½]
    nu_after: Array  #: ν⁺ = ν − (1+e) μ v_u w [J^½], w = ℓJᵀu
    qd_after: Array  #: q̇⁺ = ℓᵀν⁺ [rad/s, m/s]
    speed: float  #: v_u before it [m/s]; unless it is above zero, nothing changes
    reflected_mass: float  #: m_u [kg]
    impulse: float  #: (1+e) μ v_u [N s] along −u on the robot
    mass_speed: float  #: speed of a free mass along u after it [m/s]; zero of a clamped one
    loss: float  #: ½(1−e²) μ v_u² [J] of both together


def impact(nu: Array, w: Array, square: float, mass: float, restitution: float) -> Impact:
    """Return the impact with a mass at rest.

    `qd_after` is empty, and :meth:`DiagonalDynamics.impact` computes it. w = ℓJᵀu [kg^−½] belongs
    to the direction u at the point, and its square is wᵀw. The mass m_H [kg] is free to move, or
    clamped if inf. The restitution e is from 0 to 1.
    """
    mass = mass if mass == math.inf else positive("mass", mass, "[kg]")
    e = number("restitution", restitution, "a number from 0 to 1", lambda x: 0.0 <= x <= 1.0)
    speed = float(w @ nu)
    reflected = 1.0 / square if square > 0.0 else math.inf
    closing = max(speed, 0.0)
    mu = 1.0 / (1.0 / reflected + 1.0 / mass) if closing else 0.0
    impulse = (1.0 + e) * mu * closing
    mass_speed = 0.0 if mass == math.inf else impulse / mass
    loss = 0.5 * (1.0 - e * e) * mu * closing * closing
    if loss == math.inf:
        raise InputError("qd are too large: the lost energy overflows.")
    after = nu - impulse * w
    return Impact(nu, after, np.empty(0), speed, reflected, impulse, mass_speed, loss)
