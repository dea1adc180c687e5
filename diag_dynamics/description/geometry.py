# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Visual and collision geometry of links."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.description.elements import LARGEST, Element, floats, placement_of
from diag_dynamics.description.mesh_files import Meshes
from diag_dynamics.exceptions import UrdfError

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


def shapes_of(link: Element, role: str) -> tuple[Shape, ...]:
    """Return the shapes of a link's element; `role` is "visual" or "collision"."""
    where = f"link '{link.get('name')}': {role}"
    return tuple(
        shape for element in link.findall(role) if (shape := shape_of(element, where)) is not None
    )


def shape_of(element: Element, where: str) -> Shape | None:
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


def corners_of(shape: Shape, meshes: Meshes) -> Array:
    """Return the corners of a box around a shape, shape (8, 3), in the link's axes [m]."""
    centre = np.zeros(3)
    if shape.kind == "mesh":
        low, high = meshes.mesh(shape.file).bounds * shape.numbers
        centre = 0.5 * (low + high)
        half: Array = 0.5 * (high - low)
    elif shape.kind == "box":
        half = 0.5 * np.array(shape.numbers)
    else:
        radius, length = (*shape.numbers, 0.0)[:2]
        half = np.array([radius, radius, 0.5 * length])
        if shape.kind != "cylinder":
            half[2] += radius
    placement = shape.placement
    return (CUBE * half + centre) @ placement[:3, :3].T + placement[:3, 3]
