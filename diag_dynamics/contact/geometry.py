# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact points of links: corners whose hull holds a link and points between them, or the link's frames."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from typing import IO, TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.checks import choice, whole
from diag_dynamics.contact.points import ContactPoint
from diag_dynamics.exceptions import UrdfError
from diag_dynamics.model.catalog import read_source
from diag_dynamics.model.geometry import Shape, shapes_of
from diag_dynamics.model.meshes import Meshes
from diag_dynamics.model.origins import placement_of
from diag_dynamics.model.sources import folder_of
from diag_dynamics.model.urdf import parse_urdf

if TYPE_CHECKING:
    from diag_dynamics.model import RobotModel

Geometry = Literal["frames", "primitives", "meshes"]

MAX_POINTS = 64
"""Default for the maximum number of points of a link."""

SIDES = 16
"""Sides of the prism around a cylinder; its corners are 2 % outside."""

CORNERS = 0.75
"""Fraction of a link's points that are corners; the others lie between them, on its surface."""

DENSE = 2000
"""Number of directions in which the corners are compared with the shapes."""

_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


class LinkGeometry(NamedTuple):
    """Points of all links of a robot that have any.

    Attributes
    ----------
    points : tuple of ContactPoint
        One for each link, of the link's name.
    source : dict
        By link, what its points are of: ``collision``, ``visual`` or ``frames``.
    grown : dict
        By link, the largest relative distance of its points from its shapes, which their hull holds; 0 for the shapes' own
        corners.
    left_out : dict
        By link, the reason why its shapes do not count.
    """

    points: tuple[ContactPoint, ...]
    source: dict[str, str]
    grown: dict[str, float]
    left_out: dict[str, str]


def link_geometry(
    model: RobotModel,
    urdf: str | bytes | os.PathLike[str] | IO[Any],
    geometry: Geometry = "primitives",
    most: int = MAX_POINTS,
) -> LinkGeometry:
    """Points of every link, for :class:`ContactPoints`: of its collision shapes, else of its visual ones.

    Boxes and hulls of meshes have their own corners, cylinders those of a prism around them. If these are too many, or a
    shape is round, corners are the support points in many directions, moved outward until their hull holds the shapes.
    Speed is largest at a corner, but the transferable energy may be larger at the points between them. A link without such
    shapes has its frames: its own origin and those of the joints that it carries.

    Parameters
    ----------
    model : RobotModel
    urdf : str, bytes, os.PathLike or file
        That of the model.
    geometry : {"frames", "primitives", "meshes"}
        Shapes that count. Meshes open the files that the URDF names, so they are not for untrusted descriptions; they need
        trimesh.
    most : int
        Maximum number of points of a link, at least 8.
    """
    choice("geometry", geometry, ("frames", "primitives", "meshes"))
    most = max(8, whole("most", most))
    text = read_source(urdf).text
    robot, meshes = parse_urdf(text.encode(errors="replace")), Meshes(folder_of(urdf))
    elements = {element.get("name", ""): element for element in robot.findall("link")}
    points, source, grown, left_out = [], {}, {}, {}
    for link in model.link_names:
        if link not in elements or model.placement_in_body(link)[0] == 0:
            continue
        found: Array | None = None
        for role in ("collision", "visual") if geometry != "frames" else ():
            try:
                every = shapes_of(elements[link], role)
                shapes = [s for s in every if s.kind != "mesh" or geometry == "meshes"]
                if every and not shapes:
                    left_out.setdefault(link, f"meshes, which geometry '{geometry}' does not look at")
                if shapes:
                    found, grown[link] = points_around(shapes, meshes, most)
                    source[link] = role
                    left_out.pop(link, None)
                    break
            except UrdfError as error:
                left_out.setdefault(link, str(error))
        if found is None:
            found = np.array([np.zeros(3), *_frames_of(robot, link)])
            source[link], grown[link] = "frames", 0.0
        points.append(ContactPoint(link, link, found))
    return LinkGeometry(tuple(points), source, grown, left_out)


def points_around(shapes: list[Shape], meshes: Meshes, most: int = MAX_POINTS) -> tuple[Array, float]:
    """Return points whose hull holds shapes, and more between them, in the link's axes; and their relative distance."""
    found = [_corners(shape, meshes) for shape in shapes]
    every = [(shape, own) for shape, (own, _) in zip(shapes, found, strict=True)]
    exact = [_moved(shape, own) for shape, own in every if own is not None]
    corners, outside = np.zeros((0, 3)), 0.0
    if len(exact) == len(shapes):
        corners = np.unique(np.concatenate(exact), axis=0)
        outside = 1.0 / math.cos(math.pi / SIDES) - 1.0 if any(s.kind == "cylinder" for s in shapes) else 0.0
    faces = [normals @ shape.placement[:3, :3].T for shape, (_, normals) in zip(shapes, found, strict=True)]
    dense = np.concatenate([_directions(DENSE), *faces])
    support = np.einsum("nk,nk->n", _support_points(every, dense), dense)
    if not 0 < len(corners) <= CORNERS * most:
        corners = np.unique(_support_points(every, _directions(int(CORNERS * most))), axis=0)
        centre = corners.mean(axis=0)
        reach, held = support - dense @ centre, ((corners - centre) @ dense.T).max(axis=0)
        known = held > 1e-9 * reach.max()  # in other directions there is nothing that could lie outside
        factor = max(1.0, float((reach[known] / held[known]).max(initial=1.0)))
        corners, outside = centre + factor * (corners - centre), factor - 1.0
    return np.concatenate([corners, _between(corners.mean(axis=0), dense, support, most - len(corners))]), outside


def _between(centre: Array, dense: Array, support: Array, count: int) -> Array:
    """Return evenly spread points of the surface of a hull; `support` is its extent along `dense`."""
    rays = _directions(count)
    ahead = rays @ dense.T
    with np.errstate(divide="ignore"):
        way = np.where(ahead > 1e-6, (support - dense @ centre) / np.maximum(ahead, 1e-6), np.inf).min(axis=1)
    return centre + np.maximum(way, 0.0)[:, None] * rays


def _corners(shape: Shape, meshes: Meshes) -> tuple[Array | None, Array]:
    """Return the corners of a shape in its own axes, None of a round one; and the normals of its faces."""
    numbers = np.array(shape.numbers)
    if shape.kind == "box":
        return _CORNERS * (0.5 * numbers), np.concatenate([np.eye(3), -np.eye(3)])
    if shape.kind == "cylinder":
        radius, length = numbers
        ring, sides = (_ring(shift) for shift in (0.0, 0.5))
        corners = radius / math.cos(math.pi / SIDES) * ring
        ends = np.array([[0.0, 0.0, -0.5 * length], [0.0, 0.0, 0.5 * length]])
        return np.concatenate([corners + end for end in ends]), np.concatenate([sides, 2.0 / length * ends])
    if shape.kind == "mesh":
        mesh = meshes.mesh(shape.file).copy()
        mesh.apply_transform(np.diag([*numbers, 1.0]))
        try:
            hull = mesh.convex_hull
            return np.asarray(hull.vertices), np.asarray(hull.face_normals)
        except (ValueError, RuntimeError, ImportError):  # all in a plane, or no Qhull: they hold it themselves
            return np.asarray(mesh.vertices), np.zeros((0, 3))
    return None, np.zeros((0, 3))


def _ring(shift: float) -> Array:
    """Return unit vectors across z, around a full turn."""
    angle = 2.0 * math.pi * (np.arange(SIDES) + shift) / SIDES
    return np.stack([np.cos(angle), np.sin(angle), np.zeros(SIDES)], axis=1)


def _support_points(shapes: list[tuple[Shape, Array | None]], directions: Array) -> Array:
    """Return the point of several shapes that lies farthest along each direction."""
    best, most = np.zeros_like(directions), np.full(len(directions), -np.inf)
    for shape, corners in shapes:
        own = directions @ shape.placement[:3, :3]
        if corners is not None:
            points = corners[np.argmax(own @ corners.T, axis=1)]
        else:  # a sphere, or a capsule: a ball along a line
            half = 0.5 * shape.numbers[1] if shape.kind == "capsule" else 0.0
            points = shape.numbers[0] * own
            points[:, 2] += np.copysign(half, own[:, 2])
        points = _moved(shape, points)
        reach = np.einsum("nk,nk->n", points, directions)
        better = reach > most
        best[better], most[better] = points[better], reach[better]
    return best


def _moved(shape: Shape, points: Array) -> Array:
    return points @ shape.placement[:3, :3].T + shape.placement[:3, 3]


def _directions(count: int) -> Array:
    """Return unit vectors spread evenly over all directions: a spiral from pole to pole by the golden angle."""
    k = np.arange(count) + 0.5
    z, angle = 1.0 - 2.0 * k / count, math.pi * (1.0 + math.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)


def _frames_of(robot: Any, link: str) -> Iterator[Array]:
    """Yield the origins of the joints that a link carries, in its axes."""
    for joint in robot.findall("joint"):
        parent, origin = joint.find("parent"), joint.find("origin")
        if parent is not None and parent.get("link") == link and origin is not None:
            yield placement_of(origin, f"joint '{joint.get('name')}'")[:3, 3]
