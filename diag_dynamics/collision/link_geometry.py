# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact points of links: corners of their hulls and points between, or their frames."""

from __future__ import annotations

import math
import os
from typing import IO, Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.checks import choice, whole
from diag_dynamics.collision.contact_points import GEOMETRIES, ContactPoint, Geometry
from diag_dynamics.description.catalog import link_elements
from diag_dynamics.description.geometry import CUBE, Shape, shapes_of
from diag_dynamics.description.mesh_files import Meshes
from diag_dynamics.description.urdf_text import folder_of
from diag_dynamics.exceptions import UrdfError
from diag_dynamics.model import RobotModel

SIDES, BALL = 16, 160
"""Sides of the prism around a cylinder, and corners around a ball; they are 2 % outside."""

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
    own corners, round shapes those of a polyhedron around them. If these are too many, corners are
    the support points in many directions, moved outward until their hull holds the shapes. Speed is
    largest at a corner, but the transferable energy may be larger at the points between them. A
    link without such shapes has its frames: its own origin and those of the joints that it carries.

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
        joints = [joint for joint in model.description.joints.values() if joint.parent == link]
        around = np.array([np.zeros(3), *(joint.origin[:3, 3] for joint in joints)])
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


def _points_around(shapes: list[Shape], meshes: Meshes, most: int) -> Array:
    """Return points whose hull holds shapes, and more between them, in the link's axes."""
    corners = np.unique(np.concatenate([_corners(shape, meshes) for shape in shapes]), axis=0)
    axes = [sign * shape.placement[:3, :3].T for shape in shapes for sign in (-1.0, 1.0)]
    dense = np.concatenate([_directions(DENSE), *axes])
    support = (corners @ dense.T).max(axis=0)
    if len(corners) > CORNERS * most:
        farthest = np.argmax(corners @ _directions(int(CORNERS * most)).T, axis=0)
        corners = corners[np.unique(farthest)]
    centre = corners.mean(axis=0)
    reach = support - dense @ centre
    hull_reach = ((corners - centre) @ dense.T).max(axis=0)
    # In other directions nothing can lie outside.
    is_relevant = hull_reach > 1e-9 * reach.max()
    factor = (reach[is_relevant] / hull_reach[is_relevant]).max(initial=1.0)
    corners = centre + factor * (corners - centre)
    rays = _directions(most - len(corners))
    ahead = rays @ dense.T
    way = np.where(ahead > 1e-6, reach / np.maximum(ahead, 1e-6), np.inf).min(axis=1)
    return np.concatenate([corners, centre + np.maximum(way, 0.0)[:, None] * rays])


def _corners(shape: Shape, meshes: Meshes) -> Array:
    """Return the corners of a shape, or of a polyhedron around a round one, in the link's axes."""
    numbers = np.array(shape.numbers)
    if shape.kind == "box":
        corners = CUBE * (0.5 * numbers)
    elif shape.kind == "mesh":
        mesh = meshes.mesh(shape.file).copy()
        mesh.apply_transform(np.diag([*numbers, 1.0]))
        try:
            corners = np.asarray(mesh.convex_hull.vertices)
        except (ValueError, RuntimeError, ImportError):  # all in a plane, or no Qhull
            corners = np.asarray(mesh.vertices)
    else:
        radius, length = (*numbers, 0.0)[:2]
        around = _directions(BALL)
        if shape.kind == "cylinder":
            angle = 2.0 * math.pi * np.arange(SIDES) / SIDES
            around = np.stack([np.cos(angle), np.sin(angle), np.zeros(SIDES)], axis=1)
        end = np.array([0.0, 0.0, 0.5 * length])
        ring = radius / math.cos(math.pi / SIDES) * around
        corners = np.concatenate([ring - end, ring + end])
    return corners @ shape.placement[:3, :3].T + shape.placement[:3, 3]


def _directions(count: int) -> Array:
    """Return unit vectors spread evenly over all directions, on a spiral by the golden angle."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    angle = math.pi * (1.0 + math.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)
