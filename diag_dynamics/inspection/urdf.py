# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Links and joints as the XML of a URDF has them: a wrong part leaves the others readable."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import InputError, UrdfError
from diag_dynamics.model.geometry import Shape, Solid, floats, moved, shapes_of, solid_of, united
from diag_dynamics.model.meshes import Meshes, find_mesh
from diag_dynamics.model.origins import placement_of
from diag_dynamics.model.remarks import remarks_of
from diag_dynamics.model.transmissions import reflected_inertias
from diag_dynamics.model.urdf import parse_urdf

NEGLIGIBLE = 1e-5  # fraction of the robot's mass that rounding of its numbers exceeds

ROLES = ("visual", "collision")
INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
LIMITS = ("lower", "upper", "effort", "velocity")
ONCE = {
    "link": ("inertial",),
    "inertial": ("mass", "inertia", "origin"),
    "geometry": ("*",),
    "joint": ("origin", "axis", "limit", "mimic", "parent", "child", "dynamics"),
}  # children that an element has once

Found = Iterator[tuple[Any, ...]]
"""Results of a check: row of a table or its key, name or None, number, words of the text."""


class Link:
    """A link; mass [kg] and inertia (about the centre of mass, link's axes) may be None.

    `half_digit` is half a unit of the inertia's last digit; `solids` has None for a role of which a
    shape cannot be measured; `errors` are rows and texts of the check of meshes.
    """

    def __init__(self, element: Any, folder: Path | None, meshes: Meshes) -> None:
        self.name: str = element.get("name", "")
        inertial = _child(element, "inertial")
        placement, inertia = _placement(inertial), _child(inertial, "inertia")
        self.has_inertial = element.find("inertial") is not None
        self.mass = _number(_child(inertial, "mass"), "value")
        self.centre = placement[:3, 3]
        self.inertia: Any = _inertia(inertia, placement[:3, :3])
        self.half_digit = _half_digit(inertia)
        self.has_geometry = False
        self.solids: dict[str, Solid | None] = {}
        self.errors: list[tuple[str, str]] = []
        for role in ROLES:
            self._measure(element, role, folder, meshes)

    def _measure(self, element: Any, role: str, folder: Path | None, meshes: Meshes) -> None:
        try:
            shapes = shapes_of(element, role)
        except UrdfError as error:
            self.solids[role] = None
            self.errors.append(("unmeasured", str(error)))
            return
        solids = [self._solid(shape, folder, meshes) for shape in shapes]
        measured = [solid for solid in solids if solid is not None]
        if shapes:
            self.has_geometry = True
            self.solids[role] = united(measured) if len(measured) == len(shapes) else None

    def _solid(self, shape: Shape, folder: Path | None, meshes: Meshes) -> Solid | None:
        row = "missing"
        try:
            if shape.file:
                find_mesh(shape.file, folder)
            row = "unmeasured"
            return solid_of(shape, meshes)
        except (UrdfError, InputError) as error:  # an InputError: trimesh is not installed
            row = "no trimesh" if isinstance(error, InputError) else row
            self.errors.append((row, str(error)))
        return None


class Joint:
    """A joint; a limit that is missing or not a number is None."""

    def __init__(self, element: Any) -> None:
        self.name: str = element.get("name", "")
        self.kind: str = element.get("type", "")
        self.moves = self.kind != "fixed"
        self.parent: str = _child(element, "parent").get("link", "")
        self.child: str = _child(element, "child").get("link", "")
        self.placement = _placement(element)
        self.axis = floats(_child(element, "axis").get("xyz", "1 0 0"), 3)
        limit, mimic = _child(element, "limit"), _child(element, "mimic")
        self.limit = {name: _limit(limit.get(name)) for name in LIMITS}
        low, high = self.limit["lower"], self.limit["upper"]
        limited = low is not None and high is not None and self.kind in ("revolute", "prismatic")
        self.range = (low or 0.0, high or 0.0) if limited else None
        self.source: str | None = None if element.find("mimic") is None else mimic.get("joint", "")
        self.multiplier = _number(mimic, "multiplier", 1.0) or 0.0
        self.offset = _number(mimic, "offset", 0.0) or 0.0


class Body:
    """Links that fixed joints connect, the nearest to the root first, and in whose axes all is."""

    def __init__(self, placed: list[tuple[Link, Array]]) -> None:
        self.links = links = [link for link, _ in placed]
        self.mass = sum(link.mass or 0.0 for link in links)
        self.heavy = [link.name for link in links if link.mass]
        self.placements = {link.name: X for link, X in placed}
        self.centres = {link.name: X[:3, :3] @ link.centre + X[:3, 3] for link, X in placed}
        moment = sum(((link.mass or 0.0) * self.centres[link.name] for link in links), np.zeros(3))
        self.centre = moment / self.mass if self.mass > 0.0 else moment
        self.solids: dict[str, Solid] = {}
        self.is_measured = any(link.solids for link in links)
        for role in ROLES:
            parts = [(link.solids[role], X) for link, X in placed if role in link.solids]
            solids = [moved(solid, X) for solid, X in parts if solid]
            if len(solids) < len(parts):
                self.is_measured = False
            elif solids:
                self.solids[role] = united(solids)
        self.densities = {role: self.mass / solid.volume for role, solid in self.solids.items()}
        self.corners = np.array([x for solid in self.solids.values() for x in solid.corners])


class Urdf:
    """Links and joints of a URDF's text; of two links of one name the first."""

    def __init__(self, text: str, folder: Path | None) -> None:
        robot = parse_urdf(text.encode(errors="replace"))
        self.name: str = robot.get("name") or "robot"
        self.remarks = remarks_of(robot)
        self.rotors: dict[str, float] = {}
        with suppress(UrdfError):  # the loader reports it
            self.rotors, ignored = reflected_inertias(robot)
            self.remarks += ignored
        links, joints, meshes = robot.findall("link"), robot.findall("joint"), Meshes(folder)
        self.repeated = [one for element in (*links, *joints) for one in _repeated(element)]
        self.links: dict[str, Link] = {}
        for link in (Link(element, folder, meshes) for element in links):
            self.links.setdefault(link.name, link)
        self.joints = [Joint(element) for element in joints]
        self.moving = {joint.child: joint for joint in self.joints if joint.moves}
        self.total_mass: float = sum(link.mass or 0.0 for link in self.links.values())
        attached = {joint.child for joint in self.joints if not joint.moves}
        roots, seen = [name for name in self.links if name not in attached], set[str]()
        self.bodies = [Body(list(self._connect(name, np.eye(4), seen))) for name in roots]
        self.heavy_bodies = [body for body in self.bodies if not self.is_negligible(body.mass)]
        self.measured_bodies = [body for body in self.heavy_bodies if body.is_measured]
        self.stands = False  # whether the model's base is fixed

    def is_negligible(self, mass: float | None) -> bool:
        """Return whether a mass is too small to change results."""
        return not mass or mass < NEGLIGIBLE * self.total_mass

    def has_inertia(self, link: Link) -> bool:
        """Return whether a link has moments of inertia, and a mass that changes results."""
        return link.inertia is not None and link.inertia.any() and not self.is_negligible(link.mass)

    def _connect(self, name: str, X: Array, seen: set[str]) -> Iterator[tuple[Link, Array]]:
        """Yield a link, and those that fixed joints attach to it, with their placements."""
        if name in self.links and name not in seen:
            seen.add(name)
            yield self.links[name], X
            for joint in self.joints:
                if joint.parent == name and not joint.moves:
                    yield from self._connect(joint.child, X @ joint.placement, seen)


def _child(element: Any, tag: str) -> Any:
    """Return the first child of a tag, or an empty element."""
    child = element.find(tag)
    return etree.Element(tag) if child is None else child


def _repeated(element: Any) -> Iterator[tuple[str, str, str]]:
    """Yield kind, name and tag of children that a link or joint has more than once."""
    for part in element.iter(*ONCE):
        for tag in ONCE[part.tag]:
            if len(part.findall(tag)) > 1:
                yield f"{element.tag}s", element.get("name", ""), tag.replace("*", "shape")


def _number(element: Any, attribute: str, default: float | None = None) -> float | None:
    if (text := element.get(attribute)) is None:
        return default
    numbers = floats(text, 1)
    return numbers[0] if numbers else None


def _limit(text: str | None) -> float | None:
    with suppress(ValueError):
        value = float(text or "")
        return None if np.isnan(value) else value
    return None


def _placement(element: Any) -> Array:
    """Return the placement (4, 4) of an element's <origin>; the identity of one that is wrong."""
    with suppress(UrdfError):
        return placement_of(_child(element, "origin"), "")
    return np.eye(4)


def _inertia(element: Any, rotation: Array) -> Array | None:
    numbers = [_number(element, name) for name in INERTIA]
    if None in numbers:
        return None
    xx, xy, xz, yy, yz, zz = numbers
    return rotation @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=float) @ rotation.T


def _half_digit(element: Any) -> float:
    exponents = []
    for name in INERTIA:
        text = element.get(name, "0").strip().lower()
        if floats(text, 1) not in (None, [0.0]):
            digits, _, exponent = text.partition("e")
            exponents.append(int(exponent or 0) - len(digits.partition(".")[2]))
    return 0.5 * 10.0 ** max(min(exponents), -300) if exponents else 0.0
