# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Links and joints of a URDF: a link or joint that load_urdf rejects leaves the others readable."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.description import records
from diag_dynamics.description.elements import reflected_inertias
from diag_dynamics.description.geometry import Solid, moved, shapes_of, solid_of, united
from diag_dynamics.description.meshes import Meshes, find_mesh
from diag_dynamics.description.records import Description, Joint, Remark
from diag_dynamics.description.remarks import NEGLIGIBLE, remarks_of
from diag_dynamics.description.urdf import INERTIAL, parse_urdf, readable_parts
from diag_dynamics.exceptions import DiagDynamicsError, UrdfError

ROLES = ("visual", "collision")

Found = Iterator[tuple[Any, ...]]
"""Results of a check: fields of a Remark."""


@dataclass
class Link:
    """A link; mass [kg], and inertia about the centre of mass in the link's axes or None."""

    name: str
    has_inertial: bool = False
    mass: float = 0.0
    centre: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Any = None
    half_digit: float = 0.0  # half a unit of the inertia's last digit
    has_geometry: bool = False
    solids: dict[str, Solid | None] = field(default_factory=dict)  # by role; None if unmeasured
    errors: list[tuple[str, str]] = field(default_factory=list)  # rows and texts about shapes

    def measure(self, element: Any, role: str, folder: Path | None, meshes: Meshes) -> None:
        """Measure the shapes of an element."""
        row = "unmeasured"
        solids = list[Solid]()
        try:
            for shape in shapes_of(element, role):
                self.has_geometry = True
                row = "missing"
                if shape.file:
                    find_mesh(shape.file, folder)
                row = "unmeasured"
                solids.append(solid_of(shape, meshes))
        except DiagDynamicsError as error:
            self.solids[role] = None
            self.errors.append((row, str(error)))
        else:
            self.solids |= {role: united(solids)} if solids else {}


def _described_link(link: records.Link) -> Link:
    if link.inertial is None:
        return Link(link.name)
    body = link.inertial.body
    return Link(link.name, True, body.mass, body.centre, body.inertia)


def _half_digit(inertia: Any) -> float:
    """Return half a unit of the last digit of an element's moments of inertia."""
    digits = [Decimal(inertia.get(name)) for name in INERTIAL["inertia"]]
    exponents = [int(digit.as_tuple().exponent) for digit in digits if digit]
    return 0.5 * 10.0 ** max(min(exponents, default=-300), -300)


class Body:
    """Links that fixed joints connect, in the axes of the first, and the joint that moves them."""

    def __init__(self, placed: list[tuple[Link, Array]], joint: Joint | None) -> None:
        self.joint = joint
        self.links = links = [link for link, _ in placed]
        self.mass = sum(link.mass for link in links)
        self.heavy = [link.name for link in links if link.mass]
        self.placements = {link.name: X for link, X in placed}
        self.centres = {link.name: X[:3, :3] @ link.centre + X[:3, 3] for link, X in placed}
        moment = sum((link.mass * self.centres[link.name] for link in links), np.zeros(3))
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
        self.densities = {role: self.mass / solid.body.mass for role, solid in self.solids.items()}
        self.corners = np.array([x for solid in self.solids.values() for x in solid.corners])


class Urdf:
    """Links and joints of a URDF's text, of two links of one name the first.

    It reads those of an MJCF, too.
    """

    def __init__(self, source: str | Description, folder: Path | None = None) -> None:
        self.remarks: list[Remark] = []
        self.rotors: dict[str, float] = {}
        self.elements: list[Any] = []
        self.links: dict[str, Link] = {}
        self.is_mjcf = isinstance(source, Description)
        if isinstance(source, Description):
            self.name = source.name
            self.remarks = [*source.remarks]
            self.joints = list(source.joints.values())
            self.links |= {name: _described_link(link) for name, link in source.links.items()}
        else:
            self._read(parse_urdf(source), folder)
        self.total_mass: float = sum(link.mass for link in self.links.values())
        attached = {joint.child for joint in self.joints if joint.type == "fixed"}
        roots = [name for name in self.links if name not in attached]
        seen = set[str]()
        moving = {joint.child: joint for joint in self.joints if joint.type != "fixed"}
        placed = {name: list(self._connect(name, np.eye(4), seen)) for name in roots}
        self.bodies = [Body(links, moving.get(name)) for name, links in placed.items()]
        self.heavy_bodies = [body for body in self.bodies if not self.is_negligible(body.mass)]
        self.measured_bodies = [body for body in self.heavy_bodies if body.is_measured]
        self.stands = False  # whether the model's base is fixed

    def _read(self, robot: Any, folder: Path | None) -> None:
        """Read the elements of a URDF, whether it loads or not."""
        self.name = robot.get("name") or "robot"
        self.remarks = remarks_of(robot)
        with suppress(UrdfError):  # the loader reports it
            self.rotors, ignored = reflected_inertias(robot)
            self.remarks += ignored
        links, joints = readable_parts(robot)
        elements = robot.findall("link")
        meshes = Meshes(folder)
        self.elements += [*elements, *robot.findall("joint")]
        self.joints = list(joints.values())
        for element in elements:
            name = element.get("name", "")
            if name in self.links:
                continue
            link = _described_link(links.get(name, records.Link(name)))
            if link.has_inertial:
                link.half_digit = _half_digit(element.find("inertial/inertia"))
            link.has_inertial = element.find("inertial") is not None
            for role in ROLES:
                link.measure(element, role, folder, meshes)
            self.links[name] = link

    def is_negligible(self, mass: float) -> bool:
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
                if joint.parent == name and joint.type == "fixed":
                    yield from self._connect(joint.child, X @ joint.origin, seen)
