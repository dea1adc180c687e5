# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot as its XML alone has it, whatever the library makes of it: a part that is wrong leaves the rest to be read."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import InputError, UrdfError
from diag_dynamics.model.geometry import Shape, Solid, floats, moved, shapes_of, solid_of, united
from diag_dynamics.model.meshes import Meshes
from diag_dynamics.model.origins import placement_of
from diag_dynamics.model.remarks import remarks_of
from diag_dynamics.model.transmissions import reflected_inertias
from diag_dynamics.model.urdf import parse_urdf

ROLES = ("visual", "collision")

_TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_PLACES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


@dataclass
class LinkText:
    """A link.

    Attributes
    ----------
    has_inertial : bool
    mass : float or None
        None if there is no number [kg].
    inertia : ndarray or None
        About the centre of mass, in the link's axes, shape (3, 3) [kg m²].
    centre : ndarray
        Of mass, in the link's axes [m].
    half_digit : float
        Half a unit of the last digit that the inertia is written with [kg m²].
    shapes : dict
        Of "visual" and "collision"; shapes that cannot be read are not among them.
    """

    name: str
    has_inertial: bool = False
    mass: float | None = None
    inertia: Array | None = None
    centre: Array = field(default_factory=lambda: np.zeros(3))
    half_digit: float = 0.0
    shapes: dict[str, tuple[Shape, ...]] = field(default_factory=dict)

    @property
    def has_geometry(self) -> bool:
        """Whether it has a shape."""
        return any(self.shapes.values())


@dataclass
class JointText:
    """A joint, with the texts of its numbers.

    Attributes
    ----------
    placement : ndarray, shape (4, 4)
        Of the child in the parent's axes at position zero.
    limit : dict or None
        Numbers of <limit>, each None if it is missing or no number; None without the element.
    mimic : tuple of (str, float, float) or None
        Leader, multiplier, offset.
    """

    name: str
    kind: str
    parent: str
    child: str
    placement: Array
    axis: list[float] | None
    limit: dict[str, float | None] | None
    mimic: tuple[str, float, float] | None

    @property
    def moves(self) -> bool:
        """Whether it is of a type that moves."""
        return self.kind != "fixed"

    @property
    def range(self) -> tuple[float, float] | None:
        """Lower and upper position limit; None if it lacks one, or is of a type without."""
        low, high = (None if self.limit is None else self.limit[name] for name in ("lower", "upper"))
        return None if low is None or high is None or self.kind not in ("revolute", "prismatic") else (low, high)


@dataclass
class Body:
    """Links that fixed joints hold together: dynamics knows them as one.

    Attributes
    ----------
    links : list of LinkText
        The first is the one that is nearest to the root.
    placements : dict
        Placement (4, 4) of each link in the axes of the first one, by name.
    """

    links: list[LinkText]
    placements: dict[str, Array]

    @property
    def mass(self) -> float:
        """[kg]."""
        return sum(link.mass or 0.0 for link in self.links)

    @property
    def centre(self) -> Array:
        """Of mass, in the first link's axes [m]."""
        moment = sum(((link.mass or 0.0) * self.at(link.name, link.centre) for link in self.links), np.zeros(3))
        return moment / self.mass if self.mass > 0.0 else moment

    def at(self, link: str, point: Array) -> Array:
        """A point of a link, in the first link's axes."""
        placement = self.placements[link]
        return placement[:3, :3] @ point + placement[:3, 3]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its links."""
        return tuple(link.name for link in self.links)

    @property
    def heavy(self) -> tuple[str, ...]:
        """Names of its links that have mass."""
        return tuple(link.name for link in self.links if link.mass)


class Description:
    """Links and joints of a URDF's text.

    Attributes
    ----------
    name : str
        Of the robot.
    links : dict of LinkText
        By name; of two of the same name the first.
    joints : list of JointText
    folder : Path or None
        Where the URDF lies.
    twice : list of (str, str, str)
        Elements that a link or joint has more than one of, though one is read: ("link" or "joint", its name, the element).
    remarks : list of Remark
        Unknown attributes, and values that are probably mistakes.
    rotors : dict
        Rotor inertia of transmissions, reflected to the joint [kg m², kg], by its name.
    bad_shapes : list of (str, str)
        Link, and what is wrong with a shape of it.
    """

    def __init__(self, text: str, folder: Path | None) -> None:
        robot = parse_urdf(text.encode(errors="replace"))
        self.name = robot.get("name") or "robot"
        self.folder, self.meshes = folder, Meshes(folder)
        self.remarks = remarks_of(robot)
        self.rotors: dict[str, float] = {}
        with suppress(UrdfError):  # the loader reports it
            self.rotors, left_out = reflected_inertias(robot)
            self.remarks += left_out
        self.twice: list[tuple[str, str, str]] = []
        self.bad_shapes: list[tuple[str, str]] = []
        self.links: dict[str, LinkText] = {}
        for element in robot.findall("link"):
            self.links.setdefault(element.get("name", ""), self._link(element))
        self.joints = [self._joint(element) for element in robot.findall("joint")]
        self._solids: dict[tuple[str, str], Solid | UrdfError | InputError | None] = {}

    def _once(self, kind: str, element: Any, tags: tuple[str, ...]) -> None:
        for tag in tags:
            if len(element.findall(tag)) > 1:
                self.twice.append((kind, element.get("name", ""), tag))

    def _link(self, element: Any) -> LinkText:
        link = LinkText(element.get("name", ""))
        inertial = element.find("inertial")
        parts = ("inertial/mass", "inertial/inertia", "inertial/origin")
        self._once("link", element, parts if len(element.findall("inertial")) == 1 else ("inertial",))
        if inertial is not None:
            link.has_inertial = True
            link.mass = _number(inertial.find("mass"), "value")
            placement = _placement(inertial.find("origin"))
            link.centre = placement[:3, 3]
            link.inertia = _tensor(inertial.find("inertia"), placement[:3, :3])
            link.half_digit = _half_digit(inertial.find("inertia"))
        for role in ROLES:
            self._once("link", element, (f"{role}/geometry/*",) if len(element.findall(role)) == 1 else ())
            try:
                link.shapes[role] = shapes_of(element, role)
            except UrdfError as error:
                self.bad_shapes.append((link.name, str(error)))
        return link

    def _joint(self, element: Any) -> JointText:
        self._once("joint", element, ("origin", "axis", "limit", "mimic", "parent", "child", "dynamics"))
        ends = [element.find(end) for end in ("parent", "child")]
        parent, child = ("" if end is None else end.get("link", "") for end in ends)
        axis, limit, mimic = (element.find(tag) for tag in ("axis", "limit", "mimic"))
        names = ("lower", "upper", "effort", "velocity")
        return JointText(
            element.get("name", ""),
            element.get("type", ""),
            parent,
            child,
            _placement(element.find("origin")),
            None if axis is None else floats(axis.get("xyz", "1 0 0"), 3),
            None if limit is None else {name: _limit(limit.get(name)) for name in names},
            None
            if mimic is None
            else (
                mimic.get("joint", ""),
                _number(mimic, "multiplier", 1.0) or 0.0,
                _number(mimic, "offset", 0.0) or 0.0,
            ),
        )

    @cached_property
    def total_mass(self) -> float:
        """Of all links [kg]."""
        return sum(link.mass or 0.0 for link in self.links.values())

    @cached_property
    def bodies(self) -> list[Body]:
        """Links that are held together, and their placements."""
        fixed: dict[str, list[JointText]] = {}
        for joint in self.joints:
            if not joint.moves:
                fixed.setdefault(joint.parent, []).append(joint)
        held = {joint.child for joints in fixed.values() for joint in joints}
        bodies, seen = [], set()
        for root in [name for name in self.links if name not in held]:
            body, stack = Body([], {}), [(root, np.eye(4))]
            while stack:
                name, placement = stack.pop()
                if name in seen or name not in self.links:
                    continue
                seen.add(name)
                body.links.append(self.links[name])
                body.placements[name] = placement
                stack += [(joint.child, placement @ joint.placement) for joint in reversed(fixed.get(name, []))]
            if body.links:
                bodies.append(body)
        return bodies

    def solid(self, link: LinkText, role: str) -> Solid | None:
        """What a link's shapes of a role enclose, in its axes; None without any.

        Raises
        ------
        UrdfError, InputError
            One of them cannot be measured.
        """
        key = (link.name, role)
        if key not in self._solids:
            try:
                shapes = link.shapes.get(role, ())
                self._solids[key] = united(solid_of(shape, self.meshes) for shape in shapes) if shapes else None
            except (UrdfError, InputError) as error:
                self._solids[key] = error
        found = self._solids[key]
        if isinstance(found, Exception):
            raise found
        return found

    def solids(self, body: Body) -> dict[str, Solid]:
        """What a body's shapes enclose, in its first link's axes, by role, but for one whose shapes are not all measured."""
        found = {}
        for role in ROLES:
            try:
                parts = [(link, self.solid(link, role)) for link in body.links]
            except (UrdfError, InputError):
                continue
            placed = [moved(solid, body.placements[link.name]) for link, solid in parts if solid]
            if placed and not any(link == name for link, _ in self.bad_shapes for name in body.names):
                found[role] = united(placed)
        return found

    def measured_wholly(self, body: Body) -> bool:
        """Whether every shape of a body was measured, and it has some."""
        roles = {role for link in body.links for role in ROLES if link.shapes.get(role)}
        return bool(roles) and roles == set(self.solids(body))

    def unmeasured(self) -> Iterator[tuple[str, Shape, UrdfError | InputError]]:
        """Shapes that cannot be measured: the link's name, the shape, and why."""
        for link in self.links.values():
            for role in ROLES:
                try:
                    self.solid(link, role)
                except (UrdfError, InputError):
                    yield from self._failing(link, role)

    def _failing(self, link: LinkText, role: str) -> Iterator[tuple[str, Shape, UrdfError | InputError]]:
        for shape in link.shapes[role]:
            try:
                solid_of(shape, self.meshes)
            except (UrdfError, InputError) as error:
                yield link.name, shape, error


def _number(element: Any, attribute: str, default: float | None = None) -> float | None:
    if element is None or element.get(attribute) is None:
        return default
    found = floats(element.get(attribute), 1)
    return found[0] if found else None


def _limit(text: str | None) -> float | None:
    try:
        value = float(text or "")
    except ValueError:
        return None
    return None if np.isnan(value) else value


def _placement(origin: Any) -> Array:
    """Placement (4, 4) of an <origin>, the identity where it is missing or has no numbers."""
    try:
        return np.eye(4) if origin is None else placement_of(origin, "")
    except UrdfError:
        return np.eye(4)


def _tensor(element: Any, turn: Array) -> Array | None:
    values = [] if element is None else [_number(element, name) for name in _TENSOR]
    if not values or any(value is None for value in values):
        return None
    tensor = np.zeros((3, 3))
    for (i, k), value in zip(_PLACES, values, strict=True):
        tensor[i, k] = tensor[k, i] = value
    return turn @ tensor @ turn.T


def _half_digit(element: Any) -> float:
    """Half a unit of the last digit that any entry of an inertia has."""
    texts = [] if element is None else [element.get(name, "0").strip().lower() for name in _TENSOR]
    units = []
    for text in texts:
        digits, _, exponent = text.partition("e")
        if floats(text, 1) not in (None, [0.0]):
            units.append(int(exponent or 0) - len(digits.partition(".")[2]))
    return 0.5 * 10.0 ** max(min(units), -300) if units else 0.0
