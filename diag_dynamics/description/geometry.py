# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Visual and collision geometry of links, and its volume."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.description.elements import LARGEST, floats, placement_of
from diag_dynamics.description.meshes import Meshes
from diag_dynamics.exceptions import UrdfError
from diag_dynamics.rigid_body import RigidBody

KINDS = {  # shapes that are known, and how many numbers each attribute has
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {"scale": 3},
}

CUBE = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
"""Corners of a cube, in units of half its edge."""


class Shape(NamedTuple):
    """A shape of a URDF, of a kind in :data:`KINDS`.

    It has its placement (4, 4) in the link's axes and a mesh's file. Its numbers [m] are size x, y,
    z; radius, length; radius; or the scale of a mesh.
    """

    kind: str
    numbers: tuple[float, ...]
    placement: Array
    file: str = ""


class Solid(NamedTuple):
    """Shapes as a body of density 1: mass [m³], centre [m] and inertia [m⁵].

    The convex hull of `corners`, shape (number, 3) [m], holds all of it. `of` names the shapes.
    """

    body: RigidBody
    corners: Array
    of: tuple[str, ...]


def shapes_of(link: Any, role: str) -> tuple[Shape, ...]:
    """Return the shapes of a link's element; `role` is "visual" or "collision"."""
    where = f"link '{link.get('name')}': {role}"
    return tuple(
        shape for element in link.findall(role) if (shape := shape_of(element, where)) is not None
    )


def shape_of(element: Any, where: str) -> Shape | None:
    """Return the shape of one <visual> or <collision>, None without geometry.

    `where` is for errors.
    """
    shape = element.find("geometry/*")
    if shape is None:
        return None
    if shape.tag not in KINDS:
        raise UrdfError(
            f"{where}: <{shape.tag}> is no shape of a URDF; known are {', '.join(KINDS)}."
        )
    numbers: list[float] = []
    for attribute, count in KINDS[shape.tag].items():
        is_scale = attribute == "scale"
        text = shape.get(attribute, "1 1 1" if is_scale else "")
        parts = floats(text, count)
        if (
            parts is None
            or (0.0 in parts if is_scale else min(parts) < 0.0)
            or max(map(abs, parts)) > LARGEST
        ):
            expected = f"{count} number(s) > 0, none beyond {LARGEST:g}"
            raise UrdfError(f"{where}: <{shape.tag} {attribute}='{text}'>; expected {expected}.")
        numbers += parts
    if shape.tag == "mesh" and not shape.get("filename"):
        raise UrdfError(f"{where}: <mesh> has no filename.")
    placement = placement_of(element.find("origin"), where)
    return Shape(shape.tag, tuple(numbers), placement, shape.get("filename", ""))


def solid_of(shape: Shape, meshes: Meshes) -> Solid:
    """Return the content of a shape, in the link's axes.

    A mesh that is not watertight counts by its convex hull.
    """
    solid = _mesh(shape, meshes) if shape.kind == "mesh" else _primitive(shape.kind, *shape.numbers)
    if not solid.body.mass > 0.0:
        raise UrdfError(f"{solid.of[0]} encloses no volume.")
    return moved(solid, shape.placement)


def _primitive(kind: str, *numbers: float) -> Solid:
    """Return the content of a shape in its own axes, from its second moments ∫x², ∫y², ∫z²."""
    if kind == "box":
        half = 0.5 * np.array(numbers)
        volume = math.prod(numbers)
        squares = volume / 12.0 * np.array(numbers) ** 2
    elif kind == "cylinder":
        r, length = numbers
        half = np.array([r, r, 0.5 * length])
        volume = math.pi * r**2 * length
        squares = volume * np.array([r**2 / 4.0, r**2 / 4.0, length**2 / 12.0])
    else:  # a sphere is a capsule without a cylinder between its halves
        r, length = (*numbers, 0.0)[:2]
        half = np.array([r, r, 0.5 * length + r])
        cylinder = math.pi * r**2 * length
        ball = 4.0 / 3.0 * math.pi * r**3
        volume = cylinder + ball
        across = cylinder * r**2 / 4.0 + ball * r**2 / 5.0
        along = cylinder * length**2 / 12.0 + ball * (
            r**2 / 5.0 + length**2 / 4.0 + 3.0 * length * r / 8.0
        )
        squares = np.array([across, across, along])
    body = RigidBody(volume, np.zeros(3), np.diag(squares.sum() - squares))
    return Solid(body, CUBE * half, (kind,))


def _mesh(shape: Shape, meshes: Meshes) -> Solid:
    mesh = meshes.mesh(shape.file).copy()
    of = shape.file.rsplit("/", 1)[-1]
    mesh.apply_transform(np.diag([*shape.numbers, 1.0]))
    corners = CUBE * (0.5 * mesh.extents) + mesh.bounds.mean(axis=0)
    with np.errstate(all="ignore"):  # of a flat mesh, which is rejected for its volume of zero
        if not (mesh.is_watertight and mesh.is_winding_consistent):
            try:
                mesh = mesh.convex_hull
                of = f"convex hull of {of}"
            except (
                ValueError,
                RuntimeError,
            ) as error:  # of points in a plane; Qhull's error is a RuntimeError
                raise UrdfError(f"{of} encloses no volume.") from error
        elif mesh.volume < 0.0:  # all faces look inward
            mesh.invert()
        properties = mesh.mass_properties
    centre = np.array(properties.center_mass)
    inertia = np.array(properties.inertia)
    return Solid(RigidBody(float(properties.volume), centre, inertia), corners, (of,))


def united(solids: Iterable[Solid]) -> Solid:
    """Return several solids as one; where they overlap, the volume counts as often."""
    bodies, corners, of = zip(*solids, strict=True)
    return Solid(RigidBody.union(*bodies), np.concatenate(corners), sum(of, ()))


def moved(solid: Solid, placement: Array) -> Solid:
    """Return a solid in the axes in which its own ones have this placement (4x4)."""
    corners = solid.corners @ placement[:3, :3].T + placement[:3, 3]
    return solid._replace(body=solid.body.moved(placement), corners=corners)
