# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Links, joints and bodies of a robot with the geometry of its URDF, for checks."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.description import description as records
from diag_dynamics.description.description import Description, Joint
from diag_dynamics.description.geometry import corners_of, shapes_of
from diag_dynamics.description.mesh_files import Meshes
from diag_dynamics.description.remarks import NEGLIGIBLE
from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.rigid_body import RigidBody

Found = Iterator[tuple[Any, ...]]
"""Results of a check: fields of a Remark."""


class Link:
    """A link with its body, corners of boxes around its shapes (n, 3), and errors about shapes."""

    def __init__(self, record: records.Link, element: Any, meshes: Meshes) -> None:
        inertial = record.inertial
        self.name = record.name
        self.has_inertial = inertial is not None
        self.body = inertial.body if inertial else RigidBody(0.0, np.zeros(3), np.zeros((3, 3)))
        self.mass = self.body.mass
        self.has_geometry = False
        self.errors: list[str] = []
        boxes = [np.zeros((0, 3))]
        for role in () if element is None else ("visual", "collision"):
            try:
                for shape in shapes_of(element, role):
                    self.has_geometry = True
                    boxes.append(corners_of(shape, meshes))
            except DiagDynamicsError as error:
                self.errors.append(str(error))
        self.corners = np.concatenate(boxes)


class Body:
    """Links that fixed joints connect, in the axes of the first, and the joint that moves them."""

    def __init__(self, placed: list[tuple[Link, Array]], joint: Joint | None) -> None:
        self.joint = joint
        self.links = links = [link for link, _ in placed]
        self.mass = sum(link.mass for link in links)
        self.heavy = [link.name for link in links if link.mass]
        self.placements = {link.name: X for link, X in placed}
        self.centres = {link.name: link.body.moved(X).centre for link, X in placed}
        moment = sum((link.mass * self.centres[link.name] for link in links), np.zeros(3))
        self.centre = moment / self.mass if self.mass > 0.0 else moment
        self.corners = np.concatenate([link.corners @ X[:3, :3].T + X[:3, 3] for link, X in placed])
        self.is_measured = len(self.corners) > 0 and not any(link.errors for link in links)


class Robot:
    """Links, joints and bodies of a description; `element` is that of its URDF, None of an MJCF."""

    def __init__(self, description: Description, element: Any, folder: Path | None) -> None:
        self.description = description
        self.is_mjcf = element is None
        self.elements = [] if element is None else list(element.iterchildren("link", "joint"))
        of_links = {part.get("name"): part for part in self.elements if part.tag == "link"}
        meshes = Meshes(folder)
        self.links = {
            name: Link(link, of_links.get(name), meshes) for name, link in description.links.items()
        }
        self.joints = list(description.joints.values())
        self.total_mass: float = sum(link.mass for link in self.links.values())
        moving = {joint.child: joint for joint in self.joints if joint.type != "fixed"}
        self.bodies = [
            Body(list(self._connect(name, np.eye(4))), moving.get(name))
            for name in (description.root, *moving)
        ]
        self.measured_bodies = [
            body for body in self.bodies if body.is_measured and not self.is_negligible(body.mass)
        ]
        self.stands = False  # whether the model's base is fixed

    def is_negligible(self, mass: float) -> bool:
        """Return whether a mass is too small to change results."""
        return not mass or mass < NEGLIGIBLE * self.total_mass

    def has_inertia(self, link: Link) -> bool:
        """Return whether a link has moments of inertia, and a mass that changes results."""
        return bool(link.body.inertia.any()) and not self.is_negligible(link.mass)

    def _connect(self, name: str, X: Array) -> Iterator[tuple[Link, Array]]:
        """Yield a link, and those that fixed joints attach to it, with their placements."""
        yield self.links[name], X
        for joint in self.joints:
            if joint.parent == name and joint.type == "fixed":
                yield from self._connect(joint.child, X @ joint.origin)
