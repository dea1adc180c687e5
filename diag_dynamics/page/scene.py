# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot as a scene: what is drawn of each link, as JSON; of a link without geometry, bones and its inertia's ellipsoid."""

from __future__ import annotations

from pathlib import Path
from typing import Any

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
from diag_dynamics.page.layout import finite
from diag_dynamics.page.meshes import DrawnMesh, MeshLibrary, corners_of

GREY = (0.72, 0.74, 0.78, 1.0)
"""Color of what has none."""

LEAST = 1e-3
"""Part of the robot's mass from which a link that has nothing else is drawn as an ellipsoid: many a frame has a gram, and the
inertia of a barrel."""

WIDEST, BALL = 0.35, 0.1
"""Half axes of an ellipsoid, at most, and of the ball where an inertia has none, in parts of its link's extent: rotational
inertias are often guessed, and an ellipsoid of half a metre would hide the arm that it is of."""

SHORTEST = 1e-3
"""Length from which a bone is one [m]."""

SMALLEST = 0.02
"""Half the size of a robot that has neither geometry nor inertia [m]."""


def mesh_folders(source: Any = None) -> list[Path]:
    """Folders around which meshes may lie that no ROS package has: of the URDF's file, and of the example robots' wheel."""
    own = folder_of(source) if source is not None else None
    return [*([own.resolve()] if own else []), *[path.parent for path in list(example_urdfs().values())[:1]]]


def scene_of(model: RobotModel, source: Any, meshes: MeshLibrary | None = None) -> dict[str, Any]:
    """What is drawn of a robot.

    Parameters
    ----------
    model : RobotModel
    source : str, bytes, os.PathLike or file
        The URDF, xacro file or MJCF that it was made of, see :func:`~diag_dynamics.load_urdf`.
    meshes : MeshLibrary
        Where its meshes come from, and are kept to be asked for; None: none is read, which takes no time.

    Returns
    -------
    dict
        For JSON. ``links``, in the order of ``model.link_names``: name, parent_joint, visuals, inertia (mass, com, axes,
        semi: half axes of the ellipsoid of even density with the same inertia; drawn: the same, within the link's extent;
        null without one), ellipsoid (whether that stands for what is not there to be drawn), bones (where such a link's
        joints are, in its axes [m]). ``joints``: name, type, parent, child, origin (in the parent's axes [m]), dof (index of
        what moves it, its own or its leader's; null), follows (its leader, or null), limits.
        ``bounds``: corners of a box around the robot at rest [m]. ``missing``: why meshes are not there, by name.

    Raises
    ------
    UrdfError
        The URDF is malformed.
    """
    robot = parse_urdf(read_source(source).text.encode(errors="replace"))
    colors = _colors(robot)
    elements = {element.get("name"): element for element in robot.findall("link")}
    joints = [_joint(model, element) for element in robot.findall("joint")]
    carried_by = {joint["child"]: joint["name"] for joint in joints}
    inertias, problems = _inertias(model), {}
    shapeless = all(element.find("visual") is None for element in elements.values())
    links, corners = [], []
    for name in model.link_names:
        visuals, points = [], []
        for element in elements[name].findall("visual"):
            try:
                drawn = _visual(element, name, colors, meshes)
            except UrdfError as error:  # one shape that makes no sense takes nothing else away
                problems[name] = str(error)
                continue
            if drawn:
                visuals.append(drawn[0])
                points.append(drawn[1])
        inertia = inertias.get(name)
        ends = [joint["origin"] for joint in joints if joint["parent"] == name]
        own = [joint["origin"] for joint in joints if joint["child"] == name]
        bare = inertia is not None and not points and inertia["mass"] >= LEAST * model.total_mass
        if inertia is not None:
            inertia["drawn"] = _within(inertia, ends, own)
        bones = []
        if not points and (bare or shapeless):
            bones = [end for end in ends if np.linalg.norm(end) > SHORTEST]
            points.append(np.array([[0.0] * 3, *bones]))
        if inertia is not None and bare:
            points.append(_corners_of_ellipsoid(inertia))
        drawn_of_link = {"visuals": visuals, "inertia": inertia, "ellipsoid": bare, "bones": bones}
        links.append({"name": name, "parent_joint": carried_by.get(name), **drawn_of_link})
        corners.append(np.concatenate(points) if points else np.zeros((1, 3)))
    missing = {**problems, **(meshes.missing if meshes is not None else {})}
    return {"links": links, "joints": joints, "bounds": _bounds(model, corners), "missing": missing}


def _joint(model: RobotModel, element: Any) -> dict[str, Any]:
    name, kind = element.get("name"), element.get("type")
    leader = model.mimics[name].leader if name in model.mimics else None
    moved_by = leader or name
    several = next((k for k, dof in enumerate(model.dof_names) if dof.startswith(f"{moved_by}/")), None)
    dof = model.dof_names.index(moved_by) if moved_by in model.dof_names else several
    limits = {}
    if leader is None and moved_by in model.coordinate_names:
        k = model.coordinate_names.index(moved_by)
        lower, upper = finite(model.lower[k : k + 1]), finite(model.upper[k : k + 1])
        limits = {"lower": lower[0], "upper": upper[0]}
    ends = {end: element.find(end).get("link") for end in ("parent", "child")}
    placed = element.find("origin")
    origin = None if placed is None else floats(placed.get("xyz"), 3)
    ends["origin"] = [0.0] * 3 if origin is None else list(origin)
    return {"name": name, "type": kind, **ends, "dof": dof, "follows": leader, "limits": limits}


def _visual(element: Any, link: str, colors: Any, meshes: MeshLibrary | None) -> tuple[dict[str, Any], Array] | None:
    """One visual and the corners of a box around it in the link's axes; None of a mesh that is not there."""
    shape = shape_of(element, f"link '{link}': visual")
    if shape is None:
        return None
    color = _own_color(element, colors)
    mesh: DrawnMesh | None = None
    if shape.kind == "mesh":
        mesh = meshes.drawn(shape.file, shape.numbers) if meshes is not None else None
        if mesh is None:
            return None
        points, size = mesh.corners, [1.0, 1.0, 1.0]
        color = color or mesh.color
    else:
        points, size = _corners(shape), list(shape.numbers)
    drawn = {
        "kind": shape.kind,
        "size": size,
        "mesh": mesh.sha if mesh else None,
        "origin": shape.placement.ravel().tolist(),
        "color": list(color or GREY),
    }
    return drawn, points @ shape.placement[:3, :3].T + shape.placement[:3, 3]


def _corners(shape: Shape) -> Array:
    """Corners of a box around a shape that is no mesh, in its own axes."""
    numbers = shape.numbers
    if shape.kind == "box":
        half = 0.5 * np.array(numbers)
    elif shape.kind == "sphere":
        half = np.full(3, numbers[0])
    else:  # a cylinder, or a capsule, which has half a ball at each end
        half = np.array([numbers[0], numbers[0], 0.5 * numbers[1] + (numbers[0] if shape.kind == "capsule" else 0.0)])
    return corners_of(-half, half)


def _colors(robot: Any) -> dict[str, tuple[float, ...]]:
    """Colors of materials by name, wherever in the URDF they are defined."""
    return {
        material.get("name"): color
        for material in robot.iter("material")
        if material.get("name") and (color := _rgba(material)) is not None
    }


def _own_color(element: Any, colors: dict[str, tuple[float, ...]]) -> tuple[float, ...] | None:
    material = element.find("material")
    return None if material is None else _rgba(material) or colors.get(material.get("name"))


def _rgba(material: Any) -> tuple[float, ...] | None:
    color = material.find("color")
    numbers = None if color is None else floats(color.get("rgba"), 4)
    return None if numbers is None else tuple(min(max(number, 0.0), 1.0) for number in numbers)


def _inertias(model: RobotModel) -> dict[str, dict[str, Any]]:
    """Mass, centre and ellipsoid of each link that has an inertia, payloads included, in the link's axes."""
    found = {}
    for record in model.links:
        name, mass = model.link_names[record["index"]], float(record["mass"])
        if not mass > 0.0:
            continue
        _, placement = model.placement_in_body(name)
        R, c = placement[:3, :3], record["first_moment"] / mass
        xx, xy, xz, yy, yz, zz = record["inertia"]
        about_centre = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - mass * (
            c @ c * np.eye(3) - np.outer(c, c)
        )
        moments, axes = np.linalg.eigh(R.T @ about_centre @ R)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        # Of an ellipsoid I_x = m (b² + c²) / 5, and so on round.
        squares = 2.5 / mass * (moments.sum() - 2.0 * moments)
        found[name] = {
            "mass": mass,
            "com": (R.T @ (c - placement[:3, 3])).tolist(),
            "axes": axes.tolist(),
            "semi": np.sqrt(np.maximum(squares, 0.0)).tolist(),
        }
    return found


def _within(inertia: dict[str, Any], ends: list[list[float]], own: list[list[float]]) -> list[float]:
    """Half axes of an ellipsoid as it is drawn: in its proportions, within its link's extent.

    That is how far its joints and its centre of mass are, or, of a link that has both at its origin, how far it is from the
    joint before it. An inertia that breaks the triangle inequality has no ellipsoid: a ball.
    """
    semi, com = np.array(inertia["semi"]), inertia["com"]
    lengths = [float(np.linalg.norm(point)) for point in [*ends, com]]
    extent = (
        max(lengths) if max(lengths) > SHORTEST else max([float(np.linalg.norm(point)) for point in own], default=0.0)
    )
    if not extent > SHORTEST:
        extent = float(semi.max()) / WIDEST if semi.max() > 0.0 else SMALLEST / BALL
    if not semi.min() > 0.0:
        return [BALL * extent] * 3
    return (semi * min(1.0, WIDEST * extent / semi.max())).tolist()


def _corners_of_ellipsoid(inertia: dict[str, Any]) -> Array:
    half = np.abs(np.array(inertia["axes"])) @ np.array(inertia["drawn"])
    return corners_of(np.array(inertia["com"]) - half, np.array(inertia["com"]) + half)


def _bounds(model: RobotModel, corners: list[Array]) -> list[list[float]]:
    """Corners of a box around all links, joints at zero or, where that is beyond their limits, at the limit next to it."""
    q = np.clip(model.neutral, model.lower, model.upper)
    dynamics = DiagonalDynamics(model)
    placed = [dynamics.placement(q, name) for name in model.link_names]
    points = np.concatenate([c @ X[:3, :3].T + X[:3, 3] for c, X in zip(corners, placed, strict=True)])
    low, high = points.min(axis=0), points.max(axis=0)
    if not (high > low).any():
        low, high = low - SMALLEST, high + SMALLEST
    return [low.tolist(), high.tolist()]
