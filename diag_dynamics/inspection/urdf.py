# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Links and joints as the XML of a URDF has them: a wrong part leaves the others readable."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from diag_dynamics.arrays import Array
from diag_dynamics.description.checks import remarks_of
from diag_dynamics.description.elements import floats, placement_of
from diag_dynamics.description.geometry import Solid, moved, shapes_of, solid_of, united
from diag_dynamics.description.meshes import Meshes, find_mesh
from diag_dynamics.description.transmissions import reflected_inertias
from diag_dynamics.description.urdf import parse_urdf
from diag_dynamics.exceptions import DiagDynamicsError, UrdfError

NEGLIGIBLE = 1e-5  # fraction of the robot's mass that rounding of its numbers exceeds

ROLES = ("visual", "collision")
INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
LIMITS = ("lower", "upper", "effort", "velocity")

Found = Iterator[tuple[Any, ...]]
"""Results of a check: key of a row, name or None, number, words of the text."""


class Link:
    """A link; mass [kg] and inertia (about the centre of mass, link's axes) may be None."""

    def __init__(self, element: Any, folder: Path | None, meshes: Meshes) -> None:
        self.name: str = element.get("name", "")
        inertial = _child(element, "inertial")
        placement, inertia = _placement(inertial), _child(inertial, "inertia")
        self.has_inertial = element.find("inertial") is not None
        self.mass = _number(_child(inertial, "mass"), "value")
        self.centre = placement[:3, 3]
        self.inertia: Any = None
        self.half_digit = 0.0  # half a unit of the inertia's last digit
        moments = [_number(inertia, name) for name in INERTIA]
        if None not in moments:
            xx, xy, xz, yy, yz, zz = moments
            symmetric = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            self.inertia = placement[:3, :3] @ symmetric @ placement[:3, :3].T
            digits = [Decimal(inertia.get(name)) for name in INERTIA]
            exponents = [int(one.as_tuple().exponent) for one in digits if one]
            self.half_digit = 0.5 * 10.0 ** max(min(exponents, default=-300), -300)
        self.has_geometry = False
        self.solids: dict[str, Solid | None] = {}  # by role; None if a shape cannot be measured
        self.errors: list[tuple[str, str]] = []  # rows and texts about shapes
        for role in ROLES:
            self._measure(element, role, folder, meshes)

    def _measure(self, element: Any, role: str, folder: Path | None, meshes: Meshes) -> None:
        row, solids = "unmeasured", list[Solid]()
        try:
            for shape in shapes_of(element, role):
                self.has_geometry, row = True, "missing"
                if shape.file:
                    find_mesh(shape.file, folder)
                row = "unmeasured"
                solids.append(solid_of(shape, meshes))
        except DiagDynamicsError as error:
            self.solids[role] = None
            self.errors.append((row, str(error)))
        else:
            self.solids |= {role: united(solids)} if solids else {}


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
        self.limit = {name: _number(limit, name, largest=np.inf) for name in LIMITS}
        low, high = self.limit["lower"], self.limit["upper"]
        limited = low is not None and high is not None and self.kind in ("revolute", "prismatic")
        self.range = (low or 0.0, high or 0.0) if limited else None
        self.source: str | None = None if element.find("mimic") is None else mimic.get("joint", "")
        self.multiplier = _number(mimic, "multiplier", "1") or 0.0
        self.offset = _number(mimic, "offset") or 0.0


class Body:
    """Links that fixed joints connect, in the axes of the first, and the joint that moves them."""

    def __init__(self, placed: list[tuple[Link, Array]], joint: Joint | None) -> None:
        self.joint = joint
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
        robot = parse_urdf(text)
        self.name: str = robot.get("name") or "robot"
        self.remarks = remarks_of(robot)
        self.rotors: dict[str, float] = {}
        with suppress(UrdfError):  # the loader reports it
            self.rotors, ignored = reflected_inertias(robot)
            self.remarks += ignored
        links, joints, meshes = robot.findall("link"), robot.findall("joint"), Meshes(folder)
        self.elements = (*links, *joints)
        self.joints = [Joint(element) for element in joints]
        self.links: dict[str, Link] = {}
        for link in (Link(element, folder, meshes) for element in links):
            self.links.setdefault(link.name, link)
        self.total_mass: float = sum(link.mass or 0.0 for link in self.links.values())
        attached = {joint.child for joint in self.joints if not joint.moves}
        roots, seen = [name for name in self.links if name not in attached], set[str]()
        moving = {joint.child: joint for joint in self.joints if joint.moves}
        placed = {name: list(self._connect(name, np.eye(4), seen)) for name in roots}
        self.bodies = [Body(links, moving.get(name)) for name, links in placed.items()]
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


def _number(element: Any, name: str, default: str = "nan", largest: float = 1e308) -> float | None:
    """Return the number of an attribute, or None."""
    with suppress(ValueError):
        value = float(element.get(name, default))
        return value if abs(value) <= largest else None
    return None


def _placement(element: Any) -> Array:
    """Return the placement (4, 4) of an element's <origin>; the identity of one that is wrong."""
    with suppress(UrdfError):
        return placement_of(_child(element, "origin"), "")
    return np.eye(4)
