# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The geometry of a robot's links, for the page, reports and RViz markers."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import UrdfError
from diag_dynamics.model import RobotModel
from diag_dynamics.model.example_robots import example_urdfs
from diag_dynamics.model.geometry import Shape, floats, shape_of
from diag_dynamics.model.robot_source import read_source
from diag_dynamics.model.sources import folder_of
from diag_dynamics.model.urdf import parse_urdf
from diag_dynamics.page.meshes import MeshLibrary, corners_of

MIN_MASS = 1e-3
"""Minimum mass of a link that has an ellipsoid, as a fraction of the robot's. Lighter ones are often mere frames."""

MAX_HALF_AXIS, BALL = 0.35, 0.1
"""Maximum half axis, and radius where the inertia is impossible, as fractions of the link's size."""

MIN_LENGTH = 1e-3
"""Minimum length of a bone [m]."""

MIN_SIZE = 0.02
"""Half the size of a robot that has neither geometry nor inertia [m]."""


class LinkGeometry(NamedTuple):
    """The geometry of one link, in the link's axes."""

    name: str
    shapes: tuple[Shape, ...]
    """Visual shapes; of a link with mass and without these, its collision shapes."""
    mass: float
    """Payload included [kg]."""
    ellipsoid: Array | None
    """Maps the unit sphere to the ellipsoid that stands for a link without shapes, shape (4, 4)."""
    bones: tuple[Array, ...]
    """Origins of the joints that the link carries [m]."""
    problems: tuple[str, ...]
    """Errors of shapes that were left out."""


def links_of(model: RobotModel, source: Any) -> list[LinkGeometry]:
    """Return the geometry of each link, in the order of ``model.link_names``.

    An ellipsoid has the proportions of the solid one with the link's inertia, payload included, and fits in the link.

    Parameters
    ----------
    model : RobotModel
    source : str, bytes, os.PathLike or file
        The URDF, xacro file or MJCF of the model, see :func:`~diag_dynamics.load_urdf`.

    Raises
    ------
    UrdfError
        The URDF is malformed.
    """
    robot = parse_urdf(read_source(source).text.encode(errors="replace"))
    elements = {element.get("name"): element for element in robot.findall("link")}
    origins, bones = {}, {name: [] for name in model.link_names}
    for joint in robot.findall("joint"):
        origin, child = _origin(joint), joint.find("child").get("link")
        origins[child] = origin
        if np.linalg.norm(origin) > MIN_LENGTH:
            bones[joint.find("parent").get("link")].append(origin)
    records = {model.link_names[record["index"]]: record for record in model.links}
    found = []
    for name in model.link_names:
        mass, ellipsoid = float(records[name]["mass"]) if name in records else 0.0, None
        if mass > 0.0 and mass >= MIN_MASS * model.total_mass:
            placement = model.placement_in_body(name)[1]
            ellipsoid = _ellipsoid(records[name], placement, bones[name], origins.get(name, np.zeros(3)))
        shapes, problems = _shapes(elements[name], "visual")
        if not shapes and ellipsoid is not None:
            shapes, _ = _shapes(elements[name], "collision")
        found.append(LinkGeometry(name, tuple(shapes), mass, ellipsoid, tuple(bones[name]), tuple(problems)))
    return found


def _origin(joint: Any) -> Array:
    element = joint.find("origin")
    numbers = None if element is None else floats(element.get("xyz"), 3)
    return np.zeros(3) if numbers is None else np.array(numbers)


def _shapes(link: Any, role: str) -> tuple[list[Shape], list[str]]:
    """Return the shapes of a link's element, and errors of those that cannot be read."""
    shapes, problems = [], []
    for element in link.findall(role):
        try:
            shape = shape_of(element, f"link '{link.get('name')}': {role}")
        except UrdfError as error:
            problems.append(str(error))
        else:
            shapes += [] if shape is None else [shape]
    return shapes, problems


def _ellipsoid(record: Any, placement: Array, bones: list[Array], origin: Array) -> Array:
    """Return the ellipsoid of a link's inertia, no larger than the link: as far as its joints and its centre of mass.

    A link that has these at its origin is as large as its distance from the joint before it.
    """
    mass, R = float(record["mass"]), placement[:3, :3]
    c, (xx, xy, xz, yy, yz, zz) = record["first_moment"] / mass, record["inertia"]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - mass * (c @ c * np.eye(3) - np.outer(c, c))
    moments, axes = np.linalg.eigh(R.T @ inertia @ R)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    # A solid ellipsoid has I_x = m (b² + c²) / 5.
    half_axes = np.sqrt(np.maximum(2.5 / mass * (moments.sum() - 2.0 * moments), 0.0))
    centre = R.T @ (c - placement[:3, 3])
    size = max(float(np.linalg.norm(point)) for point in [*bones, centre])
    size = size if size > MIN_LENGTH else float(np.linalg.norm(origin))
    if not size > MIN_LENGTH:
        size = float(half_axes.max()) / MAX_HALF_AXIS or MIN_SIZE / BALL
    if half_axes.min() > 0.0:
        half_axes *= min(1.0, MAX_HALF_AXIS * size / half_axes.max())
    else:  # the moments break the triangle inequality
        half_axes[:] = BALL * size
    ellipsoid = np.eye(4)
    ellipsoid[:3, :3], ellipsoid[:3, 3] = axes * half_axes, centre
    return ellipsoid


# --- The scene of the page ---


def mesh_folders(source: Any = None) -> list[Path]:
    """Return folders of meshes that no ROS package has: of the URDF's file, and of the example robots."""
    own = folder_of(source) if source is not None else None
    return [*([own.resolve()] if own else []), *[path.parent for path in list(example_urdfs().values())[:1]]]


def scene_of(model: RobotModel, source: Any, meshes: MeshLibrary | None = None) -> dict[str, Any]:
    """Return the scene of a robot, for JSON.

    Parameters
    ----------
    model : RobotModel
    source : str, bytes, os.PathLike or file
        As of :func:`links_of`.
    meshes : MeshLibrary
        Loads and keeps its meshes; None: the scene has none, and is ready at once.

    Returns
    -------
    dict
        ``links``, in the order of ``model.link_names``: name, mass [kg], visuals, and what stands for a link without them:
        ellipsoid (4x4, row by row, maps the unit sphere to it; or null) and bones (ends in the link's axes [m]).
        ``bounds``: corners of a box around the robot at rest [m]. ``missing``: reasons why shapes are missing, by name.

    Raises
    ------
    UrdfError
        The URDF is malformed.
    """
    geometry = links_of(model, source)
    shapeless = not any(link.shapes or link.problems for link in geometry)
    links, corners = [], []
    for link in geometry:
        drawn = [one for shape in link.shapes if (one := _visual(shape, meshes)) is not None]
        bones = [bone.tolist() for bone in link.bones] if link.ellipsoid is not None or shapeless else []
        points = [np.zeros((1, 3)), *(points for _, points in drawn)]
        if not drawn:
            points += [np.array(bones).reshape(-1, 3), *([] if link.ellipsoid is None else [_box(link.ellipsoid)])]
        ellipsoid = None if link.ellipsoid is None else link.ellipsoid.ravel().tolist()
        visuals = [visual for visual, _ in drawn]
        own = {"name": link.name, "mass": link.mass, "visuals": visuals, "ellipsoid": ellipsoid, "bones": bones}
        links.append(own)
        corners.append(np.concatenate(points[1:] or points))
    missing = {link.name: link.problems[-1] for link in geometry if link.problems}
    missing |= meshes.missing if meshes is not None else {}
    return {"links": links, "bounds": _bounds(model, corners), "missing": missing}


def _visual(shape: Shape, meshes: MeshLibrary | None) -> tuple[dict[str, Any], Array] | None:
    """Return one visual and the corners of a box around it in the link's axes; None of a mesh that is missing."""
    mesh, size = None, list(shape.numbers)
    if shape.kind == "mesh":
        mesh = meshes.drawn(shape.file, shape.numbers) if meshes is not None else None
        if mesh is None:
            return None
        size = [1.0, 1.0, 1.0]
    elif shape.kind == "box":
        half = 0.5 * np.array(size)
    else:  # a capsule has a hemisphere at each end
        radius, length = size[0], 0.5 * size[1] if len(size) > 1 else 0.0
        half = np.array([radius, radius, length + (0.0 if shape.kind == "cylinder" else radius)])
    points = mesh.corners if mesh else corners_of(-half, half)
    visual = {"kind": shape.kind, "size": size, "mesh": mesh.sha if mesh else None}
    return visual | {"origin": shape.placement.ravel().tolist()}, points @ shape.placement[:3, :3].T + shape.placement[
        :3, 3
    ]


def _box(ellipsoid: Array) -> Array:
    """Return the corners of a box around an ellipsoid."""
    half = np.linalg.norm(ellipsoid[:3, :3], axis=1)
    return corners_of(ellipsoid[:3, 3] - half, ellipsoid[:3, 3] + half)


def _bounds(model: RobotModel, corners: list[Array]) -> list[list[float]]:
    """Return the corners of a box around all links, each joint at the position next to zero within its limits."""
    dynamics, q = DiagonalDynamics(model), np.clip(model.neutral, model.lower, model.upper)
    placed = [dynamics.placement(q, name) for name in model.link_names]
    points = np.concatenate([c @ X[:3, :3].T + X[:3, 3] for c, X in zip(corners, placed, strict=True)])
    low, high = points.min(axis=0), points.max(axis=0)
    if not (high > low).any():
        low, high = low - MIN_SIZE, high + MIN_SIZE
    return [low.tolist(), high.tolist()]
