# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Points of links at which contact is predicted, limits of body regions, and their table.

The sweeps read the table. The user enters all numbers of body regions: none is built in.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal

import numpy as np

from diag_dynamics.arrays import Array, PointLike, RowsLike
from diag_dynamics.checks import array_of, choice, instance, mapping, positive
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import RobotModel
from diag_dynamics.numerics.tables import Addresses
from diag_dynamics.sweeps import contacts
from diag_dynamics.yaml_files import read_yaml

Geometry = Literal["frames", "primitives", "meshes"]
GEOMETRIES: tuple[Geometry, ...] = "frames", "primitives", "meshes"

WorstBy = Literal["energy", "force", "limit"]

_BY = {"energy": contacts.BY_ENERGY, "force": contacts.BY_FORCE, "limit": contacts.BY_LIMIT}

MAX_DISTANCE = 1e6
"""Maximum coordinate of a point in the link's axes [m]."""

MIN_STIFFNESS = 500.0
"""Minimum stiffness [N/m]: no part of a body is softer, but tables have N/mm."""


@dataclass(frozen=True)
class ContactPoint:
    """A point of a link at which contact is predicted, or several points; the worst counts.

    The monitor and the contact limiter compare its speed with the limits of a body region.
    """

    name: str  #: in results
    link: str
    points: PointLike | RowsLike = (
        0.0,
        0.0,
        0.0,
    )  #: in the link's axes [m], shape (3,) or (number, 3)
    regions: Sequence[str] | None = None  #: that it may meet; by default those of the link


@dataclass(frozen=True)
class BodyRegion:
    """A part of a person's body, and the limits of contact with it.

    A contact point assigned to it has the speed at which none of the limits is exceeded.
    """

    mass: float = math.inf  #: effective mass m_H [kg] that is free to move; inf if clamped
    stiffness: float = 0.0  #: effective spring constant k [N/m]; 0 without a limit of force
    force: float = math.inf  #: maximum transient force [N]; inf without a limit
    energy: float = math.inf  #: maximum transferable energy ½(ŵᵀν)² [J]; inf without a limit

    def __post_init__(self) -> None:
        for name, si in (("mass", "[kg]"), ("force", "[N]"), ("energy", "[J]")):
            value = getattr(self, name)
            if value != math.inf:
                positive(name, value, si)
        is_elastic = self.stiffness != 0.0 or self.force != math.inf
        if is_elastic and positive("stiffness", self.stiffness, "[N/m]") < MIN_STIFFNESS:
            least = f"expected {MIN_STIFFNESS:g} at least; tables have N/mm, 1 N/mm is 1000 N/m"
            raise InputError(f"stiffness is {self.stiffness:g} N/m, {least}.")

    @property
    def is_limited(self) -> bool:
        """Whether it has any limit."""
        return self.force < math.inf or self.energy < math.inf


@dataclass(frozen=True)
class ContactLimits:
    """Which body regions the links of a robot may meet, and the contact points there.

    An additional point is a dict of `link`, and optionally `xyz` [m] in the link's axes and
    `regions` (by default those of the link).
    """

    regions: Mapping[str, BodyRegion] = field(
        default_factory=dict
    )  #: by name, or dicts of their fields
    default: Sequence[str] | None = (
        None  #: regions of links that are not in `links`; by default all
    )
    links: Mapping[str, Sequence[str]] = field(
        default_factory=dict
    )  #: regions by link, empty for one out of reach
    points: Mapping[str, Mapping[str, Any]] = field(
        default_factory=dict
    )  #: additional points, by name
    geometry: Geometry = (
        "primitives"  #: points on primitive shapes, also on meshes, or at link frames
    )
    worst_by: WorstBy = "limit"  #: criterion of the worst point of each link

    def __post_init__(self) -> None:
        choice("geometry", self.geometry, GEOMETRIES)
        choice("worst_by", self.worst_by, _BY)
        put = partial(object.__setattr__, self)
        put(
            "regions",
            {str(name): _region(name, of) for name, of in mapping("regions", self.regions).items()},
        )
        if self.default is not None:
            put("default", self._known("default", self.default))
        for link, names in mapping("links", self.links).items():
            self._known(f"links: '{link}'", names)
        points = mapping("points", self.points).items()
        keys = "link", "xyz", "regions"
        put(
            "points",
            {str(name): mapping(f"point '{name}'", of, keys, ["link"]) for name, of in points},
        )
        for point in self.contact_points():
            self.of(point)

    def _known(self, where: str, names: object) -> tuple[str, ...]:
        """Return names of regions as a tuple."""
        if isinstance(names, str) or not isinstance(names, Sequence):
            raise InputError(f"{where} is {names!r}; expected a list of body regions.")
        for name in names:
            choice(where, name, self.regions)
        return tuple(names)

    def of(self, point: ContactPoint) -> tuple[str, ...]:
        """Return the names of the body regions that a point may meet."""
        if point.regions is not None:
            return self._known(f"point '{point.name}'", point.regions)
        every = self.regions if self.default is None else self.default
        return tuple(self.links.get(point.link, every))

    def with_energy(self, energy: float) -> ContactLimits:
        """Return these limits with at most this transferable energy [J] in every region.

        So it is on links without a region of their own if `default` has none.
        """
        default = tuple(self.regions) if self.default is None else self.default
        regions = self.regions if default else {"any": BodyRegion(), **self.regions}
        limited = {
            name: replace(region, energy=min(energy, region.energy))
            for name, region in regions.items()
        }
        return replace(self, regions=limited, default=default or ("any",))

    def contact_points(self) -> tuple[ContactPoint, ...]:
        """Return the additional points."""
        return tuple(
            ContactPoint(name, of["link"], of.get("xyz", (0.0, 0.0, 0.0)), of.get("regions"))
            for name, of in self.points.items()
        )

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> ContactLimits:
        """Read a YAML file of these fields; see config/contact_limits.example.yaml."""
        title = f"contact limits '{os.fspath(path)}'"
        content = mapping(title, read_yaml(path, title), tuple(cls.__dataclass_fields__))
        try:
            return cls(**{name: value for name, value in content.items() if value is not None})
        except InputError as error:
            raise InputError(f"{title}: {error}") from None


class ContactPoints:
    """Contact points of one robot and the limits there; immutable.

    :meth:`DiagonalDynamics.contact_limits` has them as an argument. Points are ContactPoint or
    tuples of its fields; those on links that nothing moves are left out. Without limits there is no
    force. The worst of an entry's points has the largest transferable energy along its motion, the
    largest force against any of the entry's body regions, or the largest ratio of speed to allowed
    speed. Without regions or limits it is the energy.
    """

    names: tuple[str, ...]  #: of the entries
    links: tuple[str, ...]  #: of the entries
    regions: tuple[tuple[str, ...], ...]  #: body regions of each entry
    points: tuple[Array, ...]  #: of each entry, in the link's axes [m], shape (number, 3)
    limited: Any  #: array of bool: whether an entry has a limit
    region_names: tuple[str, ...]  #: body regions of all entries, by row of the table
    starts: Any  #: array of int: number of the first point of each entry, and of all
    count: int  #: number of points of all entries
    table: int  #: address of the table for sweeps; valid as long as this object

    def __init__(
        self,
        model: RobotModel,
        points: Iterable[ContactPoint | tuple[Any, ...]],
        limits: ContactLimits | None = None,
        worst_by: WorstBy = "energy",
    ) -> None:
        choice("worst_by", worst_by, _BY)
        self.model = instance("model", model, RobotModel)
        self.worst_by = worst_by
        contact_points = tuple(
            point if isinstance(point, ContactPoint) else ContactPoint(*point) for point in points
        )
        self._arguments = model, contact_points, limits, worst_by
        limits = limits or ContactLimits()
        for link in limits.links:
            choice("link of contact limits", link, model.link_names)
        entries: dict[str, Any] = {}  # body, link, regions, points and these in its axes, by name
        for point in contact_points:
            if point.name in entries:
                raise InputError(f"points have '{point.name}' twice; expected each name once.")
            body, placement = model.placement_in_body(point.link)
            coordinates = _rows(point)
            coordinates.flags.writeable = False
            places = coordinates @ placement[:3, :3].T + placement[:3, 3]
            if body != 0:
                entries[point.name] = body, point.link, limits.of(point), coordinates, places
        self.names = tuple(entries)
        columns = zip(*entries.values(), strict=True) if entries else ((),) * 5
        bodies, self.links, self.regions, self.points, in_bodies = columns
        self.starts = np.cumsum([0, *map(len, self.points)])
        self.count = int(self.starts[-1])
        self.region_names = tuple(name for names in self.regions for name in names)
        of_regions = np.cumsum([0, *map(len, self.regions)])
        bounds = self.starts[:-1], self.starts[1:], of_regions[:-1], of_regions[1:]
        regions = limits.regions
        near = [regions[name] for name in self.region_names]
        limited = [any(regions[name].is_limited for name in names) for names in self.regions]
        self.limited = np.array(limited, dtype=bool)
        self.limited.flags.writeable = False
        base, _ = model.placement_in_body(model.root_link)  # whose axes are the root link's
        self._table = Addresses(
            contacts.CONTACTS,
            base=base,
            by=_BY[worst_by],
            entries=np.array(list(zip(bodies, *bounds, strict=True)), dtype=contacts.CONTACT_ENTRY),
            points=np.concatenate([np.zeros((0, 3)), *in_bodies]),
            regions=np.array(
                [(1.0 / r.mass, r.stiffness, r.force, r.energy) for r in near]
            ).reshape(-1, 4),
        )
        self.table = self._table.at

    def __len__(self) -> int:
        return len(self.names)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._arguments  # an address is valid in one process


def _rows(point: ContactPoint) -> Array:
    array = array_of(point.points)
    if array is None or array.shape[-1:] != (3,) or array.ndim not in (1, 2) or not array.size:
        expected = "three numbers [m], or rows of three"
    elif not (np.abs(array) <= MAX_DISTANCE).all():
        expected = f"finite numbers within ±{MAX_DISTANCE:g} m"
    else:
        return array.reshape(-1, 3)
    raise InputError(f"points of '{point.name}' are {point.points!r}; expected {expected}.")


def _region(name: object, entry: object) -> BodyRegion:
    if isinstance(entry, BodyRegion):
        return entry
    fields = "mass", "stiffness", "force", "energy"
    numbers = dict(mapping(f"region '{name}'", entry, fields))
    if numbers.get("mass") == "clamped":
        numbers["mass"] = math.inf
    try:
        return BodyRegion(**numbers)
    except InputError as error:
        raise InputError(f"region '{name}': {error}") from None
