# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Limits of body regions, and the regions that each link may meet. The user enters all numbers: none is built in."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from diag_dynamics.checks import listed, mapping, positive
from diag_dynamics.contact.points import ContactPoint
from diag_dynamics.exceptions import InputError
from diag_dynamics.yaml_files import read_yaml

CLAMPED = "clamped"
"""Mass, in a file, of a body region that cannot give way."""

MIN_STIFFNESS = 500.0
"""Smallest stiffness accepted [N/m]: no part of a body is so soft, but tables have N/mm."""


@dataclass(frozen=True)
class BodyRegion:
    """A part of the body, and the limits of contact with it.

    Parameters
    ----------
    mass : float
        Effective mass m_H [kg] that is free to move; inf if it is clamped, and cannot give way.
    stiffness : float
        Effective spring constant k [N/m]; 0 if there is no limit of force.
    force : float
        Largest transient force [N]; inf if it is not limited.
    energy : float
        Largest transferable energy ½(ŵᵀν)² [J]; inf if it is not limited.
    """

    mass: float = math.inf
    stiffness: float = 0.0
    force: float = math.inf
    energy: float = math.inf

    def __post_init__(self) -> None:
        for name, unit in (("mass", "[kg]"), ("force", "[N]"), ("energy", "[J]")):
            value = getattr(self, name)
            object.__setattr__(self, name, value if value == math.inf else positive(name, value, unit))
        if self.stiffness != 0.0 or self.force != math.inf:
            object.__setattr__(self, "stiffness", positive("stiffness", self.stiffness, "[N/m]"))
            if self.stiffness < MIN_STIFFNESS:
                raise InputError(
                    f"stiffness is {self.stiffness:g} N/m, softer than any part of a body; is it in N/mm, as tables have it? "
                    f"1 N/mm is 1000 N/m; expected {MIN_STIFFNESS:g} at least."
                )

    @property
    def is_limited(self) -> bool:
        """Whether it has any limit."""
        return self.force < math.inf or self.energy < math.inf

    @property
    def row(self) -> tuple[float, float, float, float]:
        """1/m_H, k, and both limits, a row of the table for sweeps."""
        return 1.0 / self.mass, self.stiffness, self.force, self.energy


@dataclass(frozen=True)
class ContactLimits:
    """Which body regions the links of a robot may meet.

    Parameters
    ----------
    regions : mapping
        :class:`BodyRegion` by name, or a dict of its fields.
    default : sequence of str
        Regions that any link may meet that is not in `links`; by default all.
    links : mapping
        Regions by link name; empty for a link that nobody can reach.
    points : mapping
        Points beside those of links, by name: a dict of `link`, `xyz` [m] in the link's axes, and of `direction` (along the
        point's motion unless it is given) and `regions` (those of the link unless they are given).
    """

    regions: Mapping[str, BodyRegion] = field(default_factory=dict)
    default: Sequence[str] | None = None
    links: Mapping[str, Sequence[str]] = field(default_factory=dict)
    points: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        regions = {str(name): _region(name, given) for name, given in mapping("regions", self.regions).items()}
        object.__setattr__(self, "regions", regions)
        default = tuple(regions) if self.default is None else self._known("default", self.default)
        object.__setattr__(self, "default", default)
        links = {str(link): self._known(f"links: '{link}'", of) for link, of in mapping("links", self.links).items()}
        object.__setattr__(self, "links", links)
        points = {
            str(name): dict(mapping(f"point '{name}'", of)) for name, of in mapping("points", self.points).items()
        }
        for name, point in points.items():
            _refuse_unknown(f"point '{name}'", point, ("link", "xyz", "direction", "regions"))
            if "link" not in point:
                raise InputError(f"point '{name}' has no link.")
            if "regions" in point:
                self._known(f"point '{name}'", point["regions"])
        object.__setattr__(self, "points", points)

    def _known(self, where: str, names: object) -> tuple[str, ...]:
        """Names of regions, as a tuple."""
        if isinstance(names, str) or not isinstance(names, Sequence):
            raise InputError(f"{where} is {names!r}, expected a list of body regions.")
        for name in names:
            if name not in self.regions:
                raise InputError(f"{where} has {name!r}, which is none of the regions: {listed(list(self.regions))}.")
        return tuple(names)

    def of(self, point: ContactPoint) -> tuple[str, ...]:
        """Return the names of the body regions that a point may meet."""
        own = self.points.get(point.name, {})
        if own.get("link") == point.link and "regions" in own:
            return tuple(own["regions"])
        return tuple(self.links.get(point.link, self.default or ()))

    def with_energy(self, energy: float, name: str) -> ContactLimits:
        """Return these limits and one of transferable energy [J] on every link, as a region of this name."""
        regions = {**self.regions, name: BodyRegion(energy=energy)}
        points = {
            one: of | {"regions": [*of["regions"], name]} if "regions" in of else of for one, of in self.points.items()
        }
        links = {link: (*of, name) for link, of in self.links.items()}
        return ContactLimits(regions, (*(self.default or ()), name), links, points)

    def contact_points(self) -> tuple[ContactPoint, ...]:
        """Return the points beside those of links."""
        return tuple(
            ContactPoint(name, of["link"], of.get("xyz", (0.0, 0.0, 0.0)), of.get("direction"))
            for name, of in self.points.items()
        )

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> ContactLimits:
        """Read a YAML file with `regions`, `default`, `links` and `points`; see config/contact_limits.example.yaml."""
        what = f"contact limits '{os.fspath(path)}'"
        content = mapping(what, read_yaml(path, what))
        try:
            _refuse_unknown("the file", content, ("regions", "default", "links", "points"))
            given = {name: value for name, value in content.items() if value is not None}
            return cls(**given)
        except InputError as error:
            raise InputError(f"{what}: {error}") from None


def _region(name: object, given: object) -> BodyRegion:
    if isinstance(given, BodyRegion):
        return given
    numbers = dict(mapping(f"region '{name}'", given))
    _refuse_unknown(f"region '{name}'", numbers, ("mass", "stiffness", "force", "energy"))
    if numbers.get("mass") == CLAMPED:
        numbers["mass"] = math.inf
    try:
        return BodyRegion(**numbers)
    except InputError as error:
        raise InputError(f"region '{name}': {error}") from None


def _refuse_unknown(where: str, given: Mapping[Any, Any], known: Sequence[str]) -> None:
    for name in given:
        if name not in known:
            raise InputError(f"{where} has {name!r}, which is none of {listed(known)}.")
