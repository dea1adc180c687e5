# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Predicted contact at the points of a robot, at one state or many."""

from __future__ import annotations

from typing import Any

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.contact.points import ContactPoints
from diag_dynamics.sweeps.contacts import ALLOWED, DIRECTION, FORCE, MASS, POINT, POSITION, REGION, SPEED, TRANSFERABLE


class Contact:
    """Predicted contact at the worst point of each entry of :class:`ContactPoints`; read-only.

    Arrays have an entry for each of `names`; of many states, a row of them for each state.

    Attributes
    ----------
    points : ContactPoints
    nu : ndarray, shape (nv,)
        ν [J^½].
    """

    __slots__ = ("_results", "nu", "points")

    def __init__(self, points: ContactPoints, nu: Array, results: Array) -> None:
        self.points, self.nu, self._results = points, nu, results
        nu.flags.writeable = results.flags.writeable = False

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the entries."""
        return self.points.names

    @property
    def links(self) -> tuple[str, ...]:
        """Links of the entries."""
        return self.points.links

    @property
    def point(self) -> Any:
        """Which of the entry's points is the worst, counted from 0."""
        starts = np.cumsum([0, *map(len, self.points.points)])[:-1]
        return self._results[..., POINT].astype(int) - starts

    @property
    def position(self) -> Array:
        """Where it is, in the root link's axes [m]; three numbers each."""
        return self._results[..., POSITION : POSITION + 3]

    @property
    def direction(self) -> Array:
        """u, a unit vector in the root link's axes; three numbers each. Zero where a point that gives it is at rest."""
        return self._results[..., DIRECTION : DIRECTION + 3]

    @property
    def speed(self) -> Array:
        """v_u = uᵀv [m/s]; below zero where the point moves against a given direction."""
        return self._results[..., SPEED]

    @property
    def reflected_mass(self) -> Array:
        """m_u = 1/|ℓJᵀu|² [kg]; inf where the point cannot move along u, zero where there is no u."""
        return self._results[..., MASS]

    @property
    def energy(self) -> Array:
        """½(ŵᵀν)² = ½ m_u v_u² [J], the transferable energy; zero where the point moves against u."""
        return self._results[..., TRANSFERABLE]

    @property
    def kinetic_energy(self) -> Any:
        """K = ½|ν|² [J] of the whole robot: one number, or one for each state."""
        return 0.5 * np.einsum("...k,...k->...", self.nu, self.nu)

    @property
    def rest(self) -> Array:
        """K less the transferable energy [J]: what of ν lies across ŵ, and what a push along u leaves to the robot."""
        return np.asarray(self.kinetic_energy)[..., None] - self.energy

    @property
    def force(self) -> Array:
        """v_u √(μk) [N], against that of the entry's body regions where it is largest; zero without any."""
        return self._results[..., FORCE]

    @property
    def allowed_speed(self) -> Array:
        """The largest v_u along u that keeps all limits [m/s]; inf where there is none, or no u."""
        return self._results[..., ALLOWED]

    @property
    def margin(self) -> Array:
        """Allowed speed less speed [m/s]: below zero where a limit is exceeded, inf where there is none."""
        return self.allowed_speed - np.maximum(self.speed, 0.0)

    @property
    def usage(self) -> Array:
        """Speed as a part of the allowed one: above 1 where a limit is exceeded, zero where there is none."""
        with np.errstate(divide="ignore", invalid="ignore"):
            part = np.maximum(self.speed, 0.0) / self.allowed_speed
        return np.where(np.isnan(part), 0.0, part)

    @property
    def worst(self) -> Any:
        """The entry of the smallest margin or, where none has a limit, of the largest energy; -1 if all are at rest."""
        margin, energy = self.margin, self.energy
        if not energy.shape[-1]:
            return np.full(energy.shape[:-1], -1)[()]
        chosen = np.where(margin.min(axis=-1) < np.inf, np.argmin(margin, axis=-1), np.argmax(energy, axis=-1))
        return np.where(energy.max(axis=-1) > 0.0, chosen, -1)[()]

    def region(self, k: int, t: int | None = None) -> str:
        """Name of the body region whose limit is the strictest at entry k, of state t if there are many; else empty."""
        row = self._results if t is None else self._results[t]
        return self.points.region_name(int(row[k, REGION]))

    def __len__(self) -> int:
        return self._results.shape[-2]

    def __repr__(self) -> str:
        states = "" if self._results.ndim == 2 else f"{len(self._results)} states, "
        return f"<Contact of '{self.points.model.name}': {states}{len(self)} entries>"
