# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot in space: the shapes of its links and where they are, which link its ellipsoid is drawn at, and how large."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError, UrdfError
from diag_dynamics.model import RobotModel, end_effector_link
from diag_dynamics.model.geometry import Shape, shapes_of
from diag_dynamics.model.meshes import find_mesh
from diag_dynamics.model.robot_source import read_source
from diag_dynamics.model.sources import folder_of
from diag_dynamics.model.urdf import parse_urdf

REACH = 0.2
"""Longest half axis of the ellipsoid at positions of zero, as a part of the robot's reach."""

SMALLEST = 0.05
"""Least reach of a robot that is drawn [m]: there may be nothing but points at one place."""


class Part(NamedTuple):
    """A shape of a link, to be drawn."""

    link: str
    dof: int
    """Degree of freedom that moves it, or the leader of the joint that does; -1 of what no joint moves."""
    kind: str
    """box, cylinder, sphere, or mesh."""
    size: tuple[float, ...]
    """Three edges, or diameters, of a cylinder two and its length [m]; the scale of a mesh."""
    placement: Array
    """In the link's frame, shape (4, 4)."""
    file: str = ""
    """Of a mesh, as a viewer on another machine finds it, where a package has it; else a file:// of this one."""


class Scene:
    """What is drawn of a robot.

    Of links with an inertia, but without a shape, the ellipsoid that has their mass and inertia is drawn.

    Parameters
    ----------
    dynamics : DiagonalDynamics
    description : str, bytes or os.PathLike
        The URDF that its model is of, or its path.
    link : str
        Where the ellipsoid is drawn; empty: the end-effector link.

    Attributes
    ----------
    parts : tuple of Part
    link : str
    reach : float
        Distance of the farthest link from the root link at positions of zero [m].
    scale : float
        Half axes of the ellipsoid per root of an eigenvalue [m kg^½].

    Raises
    ------
    InputError
        No such link.
    UrdfError
        The description is none.
    """

    def __init__(self, dynamics: DiagonalDynamics, description: Any, link: str = "") -> None:
        self._dynamics, self.model = dynamics, dynamics.model
        if link and link not in self.model.link_names:
            raise InputError(f"'{link}' is not a link of robot '{self.model.name}'.")
        self.link = link or end_effector_link(self.model)
        self.parts = tuple(_parts(self.model, description))
        self._links = sorted({part.link for part in self.parts})
        q = self.model.neutral
        origins = [self.origin(q, one) for one in self.model.link_names]
        self.reach = max(SMALLEST, max(float(np.linalg.norm(origin)) for origin in origins))
        inverse = dynamics.operational_inverse_inertia(q, self.link)[:3, :3]
        largest = float(np.linalg.eigvalsh(inverse).max(initial=0.0))
        self.scale = REACH * self.reach / np.sqrt(largest) if largest > 0.0 else 0.0

    def _in_root(self, q: Array, link: str) -> Array:
        """Placement of a link in the root link, shape (4, 4)."""
        X = self._dynamics.placement(q, link)
        return np.linalg.inv(self._dynamics.placement(q, self.model.root_link)) @ X if self.model.floating_base else X

    def origin(self, q: Array, link: str) -> Array:
        """Where a link is, in the root link's axes [m], shape (3,)."""
        return self._in_root(q, link)[:3, 3]

    def placements(self, q: Array) -> Array:
        """Placements of the parts in the root link, shape (parts, 4, 4)."""
        of_link = {link: self._in_root(q, link) for link in self._links}
        return np.array([of_link[part.link] @ part.placement for part in self.parts]).reshape(-1, 4, 4)

    def ellipsoid(self, q: Array) -> tuple[Array, Array]:
        """Placement in the root link, shape (4, 4), and half axes [m], shape (3,), of the linear part of JM⁻¹Jᵀ."""
        X = self._in_root(q, self.link)
        values, directions = np.linalg.eigh(self._dynamics.operational_inverse_inertia(q, self.link)[:3, :3])
        if np.linalg.det(directions) < 0.0:  # a mirror is no rotation
            directions[:, 0] *= -1.0
        placed = X.copy()
        placed[:3, :3] = X[:3, :3] @ directions
        return placed, self.scale * np.sqrt(np.maximum(values, 0.0))

    def motion(self, q: Array, qd: Array) -> tuple[Array, float]:
        """Velocity of the link's origin in the root link's axes [m/s], shape (3,), and the mass along it [kg]; 0 at rest."""
        v = self._dynamics.link_velocity(q, qd, self.link)[:3]
        mass = self._dynamics.reflected_mass(q, self.link, v) if v.any() else 0.0
        return self._in_root(q, self.link)[:3, :3] @ v, mass

    def top(self, q: Array) -> float:
        """Height of the highest link above the root link, in its axes [m]."""
        return max(float(self.origin(q, link)[2]) for link in self._links or [self.model.root_link])


def _parts(model: RobotModel, description: Any) -> list[Part]:
    folder = folder_of(description)
    robot = parse_urdf(read_source(description).text.encode())
    elements = {element.get("name"): element for element in robot.findall("link")}
    found = []
    for index, link in enumerate(model.link_names):
        body, in_body = model.placement_in_body(link)
        dof = int(model.bodies["dof"][body]) if body else -1
        drawn = [piece for shape in _shapes(elements.get(link)) for piece in _drawn(shape, folder)]
        if not drawn:
            drawn = [_equal(record, np.linalg.inv(in_body)) for record in model.links if record["index"] == index]
        found += [Part(link, dof, *piece) for piece in drawn]
    return found


def _shapes(element: Any) -> tuple[Shape, ...]:
    """Visual shapes of a link, or else those for collisions; none, where one cannot be read."""
    for role in ("visual", "collision"):
        try:
            if element is not None and (shapes := shapes_of(element, role)):
                return shapes
        except UrdfError:
            continue
    return ()


def _drawn(shape: Shape, folder: Path | None) -> list[tuple[str, tuple[float, ...], Array, str]]:
    """What a viewer knows of a shape: kind, size, placement and file of one part or several."""
    numbers, placement = shape.numbers, shape.placement
    if shape.kind == "mesh":
        return [("mesh", numbers, placement, _found_by_viewers(shape.file, folder))]
    if shape.kind == "box":
        return [("box", numbers, placement, "")]
    d = 2.0 * numbers[0]
    if shape.kind == "sphere":
        return [("sphere", (d, d, d), placement, "")]
    parts = [("cylinder", (d, d, numbers[1]), placement, "")]
    if shape.kind == "capsule":
        for end in (-0.5, 0.5):
            shifted = placement.copy()
            shifted[:3, 3] += placement[:3, 2] * (end * numbers[1])
            parts.append(("sphere", (d, d, d), shifted, ""))
    return parts


def _found_by_viewers(file: str, folder: Path | None) -> str:
    """Name of a mesh as viewers take it: a package's, or a whole path; as it is, where there is neither."""
    if package := re.fullmatch(r"(?:package|model)://+([^/]+)/+(.+)", file.strip()):
        return f"package://{package[1]}/{package[2]}"  # some exporters write a third slash
    try:
        return find_mesh(file, folder).resolve().as_uri()
    except UrdfError:
        return file


def _equal(record: Any, to_link: Array) -> tuple[str, tuple[float, ...], Array, str]:
    """Kind, size, placement and file of the solid ellipsoid that has a link's mass and inertia."""
    mass, moment, (xx, xy, xz, yy, yz, zz) = float(record["mass"]), record["first_moment"], record["inertia"]
    centre = moment / mass if mass > 0.0 else np.zeros(3)
    about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    about = about - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    values, axes = np.linalg.eigh(about)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    squares = 2.5 * (values.sum() - 2.0 * values) / max(mass, 1e-300)  # I_a = m (b² + c²) / 5
    placement = np.eye(4)
    placement[:3, :3], placement[:3, 3] = axes, centre
    size = tuple((2.0 * np.sqrt(np.maximum(squares, 0.0))).tolist())
    return "sphere", size, to_link @ placement, ""
