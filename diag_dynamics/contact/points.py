# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Points of links at which contact is predicted, and the table of them for sweeps."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from diag_dynamics.arrays import Array, PointLike, RowsLike
from diag_dynamics.checks import array_of, choice, unit
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import RobotModel
from diag_dynamics.numerics.tables import Addresses
from diag_dynamics.sweeps import contacts

if TYPE_CHECKING:
    from diag_dynamics.contact.limits import ContactLimits

WorstBy = Literal["energy", "force", "limit"]

_BY = {"energy": contacts.BY_ENERGY, "force": contacts.BY_FORCE, "limit": contacts.BY_LIMIT}

MAX_DISTANCE = 1e6
"""Largest coordinate of a point in the link's axes [m]."""


@dataclass(frozen=True)
class ContactPoint:
    """A point of a link, or several of which the worst counts.

    Parameters
    ----------
    name : str
        Its name in results.
    link : str
        Name of the link.
    points : array_like, shape (3,) or (number, 3)
        From the link's origin in the link's axes [m].
    direction : array_like, shape (3,), optional
        Direction of contact; by default that of the motion of each point.
    frame : {"link", "root"}
        Axes of the direction.
    """

    name: str
    link: str
    points: PointLike | RowsLike = (0.0, 0.0, 0.0)
    direction: PointLike | None = None
    frame: Literal["link", "root"] = "link"


class ContactPoints:
    """Points of one robot's links, and the limits that hold there; immutable. For :meth:`DiagonalDynamics.contact`.

    Parameters
    ----------
    model : RobotModel
    points : iterable of ContactPoint
        Or tuples of its fields. Those on links that nothing moves are left out.
    limits : ContactLimits, optional
        Without it there is no force, and no limit.
    worst_by : {"energy", "force", "limit"}
        The worst of an entry's points has the largest transferable energy along its motion, the largest force against any of
        the entry's body regions, or the largest ratio of speed to allowed speed. Without regions or limits it is the energy.

    Attributes
    ----------
    names, links : tuple of str
        Of each entry.
    regions : tuple of tuple of str
        Body regions of each entry.
    points : tuple of ndarray, shape (number, 3)
        In the link's axes [m].
    limited : ndarray of bool
        Whether an entry has a limit.
    directed : ndarray of bool
        Whether an entry has a direction of its own: the others have that of their motion.
    """

    def __init__(
        self,
        model: RobotModel,
        points: Iterable[ContactPoint | tuple[Any, ...]],
        limits: ContactLimits | None = None,
        worst_by: WorstBy = "energy",
    ) -> None:
        choice("worst_by", worst_by, _BY)
        if not isinstance(model, RobotModel):
            raise InputError(f"ContactPoints needs a RobotModel, as load_urdf returns, not {type(model).__name__}.")
        self.model, self.worst_by = model, worst_by
        given = [point if isinstance(point, ContactPoint) else ContactPoint(*point) for point in points]
        self._given = model, tuple(given), limits, worst_by
        _refuse_links(model, limits)
        entries, rows, regions, kept = [], [], [], []
        for point in given:
            if point.name in (one[0].name for one in kept):
                raise InputError(f"there are two contact points of the name '{point.name}'.")
            body, placement = model.placement_in_body(point.link)
            own = _rows(point)
            kind, direction = _direction(point, placement)
            if body == 0:
                continue
            names = () if limits is None else limits.of(point)
            first, first_region = sum(map(len, rows)), len(regions)
            rows.append(own @ placement[:3, :3].T + placement[:3, 3])
            regions += [limits.regions[name].row for name in names] if limits is not None else []
            entries.append(
                (body, first, first + len(own), first_region, first_region + len(names), kind, tuple(direction))
            )
            own.flags.writeable = False
            kept.append((point, own, names))
        self.names = tuple(point.name for point, _, _ in kept)
        self.links = tuple(point.link for point, _, _ in kept)
        self.points = tuple(own for _, own, _ in kept)
        self.regions = tuple(names for _, _, names in kept)
        self._region_names = tuple(name for names in self.regions for name in names)
        known = {} if limits is None else limits.regions
        self.limited = np.array([any(known[name].is_limited for name in names) for names in self.regions], dtype=bool)
        self.directed = np.array([kind != contacts.ALONG_MOTION for *_, kind, _ in entries], dtype=bool)
        self.limited.flags.writeable = self.directed.flags.writeable = False
        base, _ = model.placement_in_body(model.root_link)  # whose axes are the root link's
        tables = {
            "entries": np.array(entries, dtype=contacts.CONTACT_ENTRY),
            "points": np.ascontiguousarray(np.concatenate(rows) if rows else np.zeros((0, 3))),
            "regions": np.array(regions, dtype=float).reshape(-1, 4),
        }
        self._table = Addresses(contacts.CONTACTS, base=base, by=_BY[worst_by], **tables)

    @property
    def table(self) -> int:
        """Address of the table for sweeps; valid as long as this object."""
        return self._table.at

    @property
    def count(self) -> int:
        """Number of points of all entries."""
        return sum(map(len, self.points))

    def region_name(self, index: int) -> str:
        """Return the name of a body region by its row in the table; empty for -1."""
        return self._region_names[index] if index >= 0 else ""

    def __len__(self) -> int:
        return len(self.names)

    def __repr__(self) -> str:
        return f"<ContactPoints of '{self.model.name}': {len(self)} entries, {self.count} points, worst by {self.worst_by}>"

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._given  # an address is valid in one process


def _rows(point: ContactPoint) -> Array:
    array = array_of(point.points)
    if array is None or array.shape[-1:] != (3,) or array.ndim not in (1, 2) or not array.size:
        raise InputError(
            f"points of '{point.name}' are {point.points!r}, expected three numbers [m], or rows of three."
        )
    if not (np.abs(array) <= MAX_DISTANCE).all():
        raise InputError(
            f"points of '{point.name}' are {point.points!r}, expected finite numbers within ±{MAX_DISTANCE:g} m."
        )
    return array.reshape(-1, 3)


def _direction(point: ContactPoint, placement: Array) -> tuple[int, Array]:
    """Return the kind of an entry's direction, and a unit vector along it in the axes of that kind."""
    choice("frame", point.frame, ("link", "root"))
    if point.direction is None:
        return contacts.ALONG_MOTION, np.zeros(3)
    u = unit(f"direction of '{point.name}'", point.direction)
    return (contacts.IN_ROOT, u) if point.frame == "root" else (contacts.IN_BODY, placement[:3, :3] @ u)


def _refuse_links(model: RobotModel, limits: ContactLimits | None) -> None:
    if limits is None:
        return
    named = dict.fromkeys(limits.links, "links") | {of["link"]: "points" for of in limits.points.values()}
    for link, where in named.items():
        if link not in model.link_names:
            raise InputError(f"contact limits, {where}: '{link}' is not a link of robot '{model.name}'.")
