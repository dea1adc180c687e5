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
from diag_dynamics.model.meshes import Meshes
from diag_dynamics.model.origins import placement_of
from diag_dynamics.model.remarks import remarks_of
from diag_dynamics.model.transmissions import reflected_inertias
from diag_dynamics.model.urdf import parse_urdf

NEGLIGIBLE = 1e-5  # fraction of the robot's mass that rounding of its numbers exceeds

ROLES = ("visual", "collision")
INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
ONCE = ("origin", "axis", "limit", "mimic", "parent", "child", "dynamics")

Found = Iterator[tuple[Any, ...]]
"""Results of a check: row of a table or its key, name or None, number, words of the text."""


class Link:
    """A link; mass [kg] and inertia (about the centre of mass, link's axes) may be None.

    `half_digit` is half a unit of the inertia's last digit; `solids` has None for a role of which a
    shape cannot be measured, `bad_shape` says why shapes cannot be read.
    """

    def __init__(self, element: Any) -> None:
        self.name: str = element.get("name", "")
        inertial = _child(element, "inertial")
        placement = _placement(inertial)
        self.has_inertial = element.find("inertial") is not None
        self.mass = _number(_child(inertial, "mass"), "value")
        self.centre = placement[:3, 3]
        self.inertia = _inertia(_child(inertial, "inertia"), placement[:3, :3])
        self.half_digit = _half_digit(_child(inertial, "inertia"))
        self.shapes: dict[str, tuple[Shape, ...]] = {}
        self.solids: dict[str, Solid | None] = {}
        self.bad_shape = ""
        for role in ROLES:
            try:
                self.shapes[role] = shapes_of(element, role)
            except UrdfError as error:
                self.bad_shape = str(error)
        self.has_geometry = any(self.shapes.values())

    def measure(self, meshes: Meshes) -> Iterator[tuple[str, Shape, Exception]]:
        """Measure all shapes, and yield those that cannot be measured with the error."""
        for role, shapes in self.shapes.items():
            solids = []
            for shape in shapes:
                try:
                    solids.append(solid_of(shape, meshes))
                except (UrdfError, InputError) as error:
                    yield self.name, shape, error
            if shapes:
                self.solids[role] = united(solids) if len(solids) == len(shapes) else None


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
        names = ("lower", "upper", "effort", "velocity")
        self.limit = {name: _limit(limit.get(name)) for name in names}
        low, high = self.limit["lower"], self.limit["upper"]
        limited = low is not None and high is not None and self.kind in ("revolute", "prismatic")
        self.range = (low or 0.0, high or 0.0) if limited else None
        self.source: str | None = None if element.find("mimic") is None else mimic.get("joint", "")
        self.multiplier = _number(mimic, "multiplier", 1.0) or 0.0
        self.offset = _number(mimic, "offset", 0.0) or 0.0


class Body:
    """Links that fixed joints connect, the nearest to the root first, and in whose axes all is."""

    def __init__(self, links: list[Link], placements: list[Array]) -> None:
        self.links = links
        names = [link.name for link in links]
        self.placements = dict(zip(names, placements, strict=True))
        self.mass = sum(link.mass or 0.0 for link in links)
        self.heavy = [link.name for link in links if link.mass]
        centres = [X[:3, :3] @ x.centre + X[:3, 3] for x, X in zip(links, placements, strict=True)]
        self.centres = dict(zip(names, centres, strict=True))
        moment = sum(((link.mass or 0.0) * self.centres[link.name] for link in links), np.zeros(3))
        self.centre = moment / self.mass if self.mass > 0.0 else moment
        self.solids: dict[str, Solid] = {}
        roles = {role for link in links for role in link.solids}
        for role in ROLES:
            parts = [link for link in links if role in link.solids]
            solids = [(link.solids[role], self.placements[link.name]) for link in parts]
            placed = [moved(solid, placement) for solid, placement in solids if solid]
            if placed and len(placed) == len(parts) and not any(x.bad_shape for x in links):
                self.solids[role] = united(placed)
        self.is_measured = bool(roles) and roles == set(self.solids)
        if self.is_measured:
            self.corners = np.concatenate([solid.corners for solid in self.solids.values()])


class Urdf:
    """Links and joints of a URDF's text; of two links of one name the first."""

    def __init__(self, text: str, folder: Path | None) -> None:
        robot = parse_urdf(text.encode(errors="replace"))
        self.name: str = robot.get("name") or "robot"
        self.folder, self.remarks = folder, remarks_of(robot)
        self.rotors: dict[str, float] = {}
        with suppress(UrdfError):  # the loader reports it
            self.rotors, ignored = reflected_inertias(robot)
            self.remarks += ignored
        links, joints = robot.findall("link"), robot.findall("joint")
        self.repeated = [one for element in (*links, *joints) for one in _repeated(element)]
        self.links: dict[str, Link] = {}
        for link in map(Link, links):
            self.links.setdefault(link.name, link)
        meshes = Meshes(folder)
        self.unmeasured = [one for link in self.links.values() for one in link.measure(meshes)]
        self.joints = [Joint(element) for element in joints]
        self.total_mass: float = sum(link.mass or 0.0 for link in self.links.values())
        self.bodies = list(self._connect())
        self.stands = False  # whether the model's base is fixed

    def is_negligible(self, mass: float | None) -> bool:
        """Return whether a mass is too small to change results."""
        return not mass or mass < NEGLIGIBLE * self.total_mass

    def measured_bodies(self) -> list[Body]:
        """Return the bodies that have mass, and shapes that are all measured."""
        bodies = [body for body in self.bodies if body.is_measured]
        return [body for body in bodies if not self.is_negligible(body.mass)]

    def _connect(self) -> Iterator[Body]:
        fixed: dict[str, list[Joint]] = {}
        for joint in self.joints:
            if not joint.moves:
                fixed.setdefault(joint.parent, []).insert(0, joint)
        carried = {joint.child for joints in fixed.values() for joint in joints}
        seen = set()
        for root in [name for name in self.links if name not in carried]:
            links, placements, stack = [], [], [(root, np.eye(4))]
            while stack:
                name, X = stack.pop()
                if name in self.links and name not in seen:
                    seen.add(name)
                    links.append(self.links[name])
                    placements.append(X)
                    stack += [(joint.child, X @ joint.placement) for joint in fixed.get(name, [])]
            yield Body(links, placements)


def _child(element: Any, tag: str) -> Any:
    """Return the first child of a tag, or an empty element."""
    child = element.find(tag)
    return etree.Element(tag) if child is None else child


def _repeated(element: Any) -> Iterator[tuple[str, str, str]]:
    """Yield kind, name and tag of children that an element has more than once."""
    tags: list[str] = list(ONCE)
    if element.tag == "link":
        parts = ["inertial/mass", "inertial/inertia", "inertial/origin"]
        tags = parts if len(element.findall("inertial")) == 1 else ["inertial"]
        tags += [f"{role}/geometry/*" for role in ROLES if len(element.findall(role)) == 1]
    for tag in tags:
        if len(element.findall(tag)) > 1:
            shown = tag.split("/")[-1].replace("*", "shape")
            yield f"{element.tag}s", element.get("name", ""), shown


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
