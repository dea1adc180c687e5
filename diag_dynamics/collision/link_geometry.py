# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact points of links: corners of their hulls and points between, or their frames."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from typing import IO, Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.checks import choice, whole
from diag_dynamics.collision.contact_points import GEOMETRIES, ContactPoint, Geometry
from diag_dynamics.description.catalog import link_elements
from diag_dynamics.description.geometry import CUBE, Shape, shapes_of
from diag_dynamics.description.meshes import Meshes
from diag_dynamics.description.text import folder_of
from diag_dynamics.exceptions import UrdfError
from diag_dynamics.model import RobotModel

SIDES = 16
"""Sides of the prism around a cylinder; its corners are 2 % outside."""

CORNERS = 0.75
"""Fraction of a link's points that are corners; the others lie between them, on its surface."""

DENSE = 2000
"""Number of directions in which the corners are compared with the shapes."""


class LinkGeometry(NamedTuple):
    """Points of all links of a robot, and why shapes of a link do not count."""

    points: tuple[ContactPoint, ...]  #: one for each link, of the link's name
    left_out: dict[str, str]  #: reasons by link


def link_geometry(
    model: RobotModel,
    urdf: str | bytes | os.PathLike[str] | IO[Any],
    geometry: Geometry = "primitives",
    most: int = 64,
) -> LinkGeometry:
    """Return at most `most` points of every link, for ContactPoints.

    They are of its collision shapes, or of its visual ones. Boxes and hulls of meshes have their
    own corners, cylinders those of a prism around them. If these are too many, or a shape is round,
    corners are the support points in many directions, moved outward until their hull holds the
    shapes. Speed is largest at a corner, but the transferable energy may be larger at the points
    between them. A link without such shapes has its frames: its own origin and those of the joints
    that it carries.

    The URDF is that of the model, and `most` at least 8. Meshes need trimesh, and open the files
    that the URDF names: they are not for untrusted descriptions.
    """
    choice("geometry", geometry, GEOMETRIES)
    most = max(8, whole("most", most))
    elements = link_elements(urdf)
    meshes = Meshes(folder_of(urdf))
    points = []
    left_out = dict[str, str]()
    for link in model.link_names:
        if model.placement_in_body(link)[0] == 0:
            continue
        around = np.array([np.zeros(3), *_frames_of(model, link)])
        for role in ("collision", "visual") if geometry != "frames" and link in elements else ():
            try:
                every = shapes_of(elements[link], role)
                shapes = [s for s in every if s.kind != "mesh" or geometry == "meshes"]
                if shapes:
                    around = _points_around(shapes, meshes, most)
                    left_out.pop(link, None)
                    break
                if every:
                    left_out.setdefault(
                        link, f"meshes, which geometry '{geometry}' does not look at"
                    )
            except UrdfError as error:
                left_out.setdefault(link, str(error))
        points.append(ContactPoint(link, link, around))
    return LinkGeometry(tuple(points), left_out)


_Hull = tuple[Array, float, Array]
"""Centres (number, 3) and radius [m] of balls in a link's axes, and normals of the faces of their
convex hull."""


def _points_around(shapes: list[Shape], meshes: Meshes, most: int) -> Array:
    """Return points whose hull holds shapes, and more between them, in the link's axes."""
    hulls = [_hull(shape, meshes) for shape in shapes]
    dense = np.concatenate([_directions(DENSE), *(normals for _, _, normals in hulls)])
    support = np.einsum("nk,nk->n", _support_points(hulls, dense), dense)
    corners = np.unique(np.concatenate([centres for centres, _, _ in hulls]), axis=0)
    if any(radius for _, radius, _ in hulls) or len(corners) > CORNERS * most:
        corners = np.unique(_support_points(hulls, _directions(int(CORNERS * most))), axis=0)
        centre = corners.mean(axis=0)
        reach = support - dense @ centre
        hull_reach = ((corners - centre) @ dense.T).max(axis=0)
        # In other directions nothing can lie outside.
        is_relevant = hull_reach > 1e-9 * reach.max()
        factor = max(1.0, float((reach[is_relevant] / hull_reach[is_relevant]).max(initial=1.0)))
        corners = centre + factor * (corners - centre)
    centre = corners.mean(axis=0)
    rays = _directions(most - len(corners))
    ahead = rays @ dense.T
    with np.errstate(divide="ignore"):
        way = np.where(
            ahead > 1e-6, (support - dense @ centre) / np.maximum(ahead, 1e-6), np.inf
        ).min(axis=1)
    return np.concatenate([corners, centre + np.maximum(way, 0.0)[:, None] * rays])


def _hull(shape: Shape, meshes: Meshes) -> _Hull:
    numbers = np.array(shape.numbers)
    radius = 0.0
    normals = np.zeros((0, 3))
    if shape.kind == "box":
        centres = CUBE * (0.5 * numbers)
        normals = np.concatenate([np.eye(3), -np.eye(3)])
    elif shape.kind == "cylinder":
        ends = np.array([[0.0, 0.0, -0.5 * numbers[1]], [0.0, 0.0, 0.5 * numbers[1]]])
        ring = numbers[0] / math.cos(math.pi / SIDES) * _ring(0.0)
        centres = np.concatenate([ring + end for end in ends])
        normals = np.concatenate([_ring(0.5), 2.0 / numbers[1] * ends])
    elif shape.kind == "mesh":
        mesh = meshes.mesh(shape.file).copy()
        mesh.apply_transform(np.diag([*numbers, 1.0]))
        try:
            hull = mesh.convex_hull
            centres = np.asarray(hull.vertices)
            normals = np.asarray(hull.face_normals)
        except (
            ValueError,
            RuntimeError,
            ImportError,
        ):  # all in a plane, or no Qhull: they hold it themselves
            centres = np.asarray(mesh.vertices)
    else:
        half = 0.5 * numbers[1] if shape.kind == "capsule" else 0.0
        centres = np.array([[0.0, 0.0, -half], [0.0, 0.0, half]])
        radius = float(numbers[0])
    R = shape.placement[:3, :3]
    r = shape.placement[:3, 3]
    return centres @ R.T + r, radius, normals @ R.T


def _ring(shift: float) -> Array:
    """Return unit vectors across z, around a full turn."""
    angle = 2.0 * math.pi * (np.arange(SIDES) + shift) / SIDES
    return np.stack([np.cos(angle), np.sin(angle), np.zeros(SIDES)], axis=1)


def _support_points(hulls: list[_Hull], directions: Array) -> Array:
    """Return the point of several hulls that lies farthest along each direction."""
    best = np.zeros_like(directions)
    most = np.full(len(directions), -np.inf)
    for centres, radius, _ in hulls:
        points = centres[np.argmax(directions @ centres.T, axis=1)] + radius * directions
        reach = np.einsum("nk,nk->n", points, directions)
        better = reach > most
        best[better] = points[better]
        most[better] = reach[better]
    return best


def _directions(count: int) -> Array:
    """Return unit vectors spread evenly over all directions, on a spiral by the golden angle."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    angle = math.pi * (1.0 + math.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)


def _frames_of(model: RobotModel, link: str) -> Iterator[Array]:
    """Yield the origins of the joints that a link carries, in its axes."""
    for joint in model.description.joints.values():
        if joint.parent == link and joint.origin[:3, 3].any():
            yield joint.origin[:3, 3]
