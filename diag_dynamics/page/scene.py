# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The geometry of a robot's links, for the page, reports and RViz markers."""

from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.description.catalog import example_urdfs, link_elements
from diag_dynamics.description.geometry import shape_of
from diag_dynamics.description.urdf_text import folder_of
from diag_dynamics.exceptions import UrdfError
from diag_dynamics.page.layout import with_followers
from diag_dynamics.rigid_body import RigidBody, symmetric
from diag_dynamics.rotations import pose

MIN_MASS = 1e-3
"""Minimum mass of a link that has an ellipsoid, as a fraction of the robot's. Lighter ones are
often mere frames."""

MAX_HALF_AXIS, BALL = 0.35, 0.1
"""Maximum half axis, and radius where the inertia is impossible, as fractions of the link's
size."""

MIN_LENGTH = 1e-3
"""Minimum length of a bone [m]."""

MIN_SIZE = 0.02
"""Size of a link that has neither a size nor an ellipsoid [m]."""


class LinkGeometry(NamedTuple):
    """The geometry of one link, in the link's axes.

    `mass` [kg] is with payload; `ellipsoid` (4x4, or None) maps the unit sphere to what stands for
    a link without shapes: the solid ellipsoid of its inertia, scaled into the link; `bones` are the
    origins of the joints that it carries and its ends of loops [m].
    """

    name: str
    mass: float
    ellipsoid: Any
    bones: tuple


def links_of(model):
    """Return the LinkGeometry of each link of a RobotModel."""
    origins = {}
    bones = {name: [] for name in model.link_names}
    for joint in model.description.joints.values():
        origin = origins[joint.child] = joint.origin[:3, 3]
        if np.linalg.norm(origin) > MIN_LENGTH:
            bones[joint.parent].append(origin)
    for end in (end for group in model.loops for loop in group for end in (loop.a, loop.b)):
        if np.linalg.norm(end.xyz) > MIN_LENGTH:
            bones[end.link].append(np.array(end.xyz))
    records = {model.link_names[record["index"]]: record for record in model.links}
    links = []
    for name in model.link_names:
        mass = float(records[name]["mass"]) if name in records else 0.0
        ellipsoid = None
        if mass > 0.0 and mass >= MIN_MASS * model.total_mass:
            placement = model.placement_in_body(name)[1]
            origin = origins.get(name, np.zeros(3))
            ellipsoid = _ellipsoid(records[name], placement, bones[name], origin)
        links.append(LinkGeometry(name, mass, ellipsoid, tuple(bones[name])))
    return links


def _shapes(link, role, missing):
    """Return the shapes of a link's element; errors of unreadable ones go into `missing`."""
    shapes = []
    for element in link:
        if element.tag != role:
            continue
        try:
            shape = shape_of(element, f"link '{link.get('name')}': {role}")
        except UrdfError as error:
            missing[link.get("name")] = str(error)
        else:
            shapes += [] if shape is None else [shape]
    return tuple(shapes)


def _ellipsoid(record, placement, bones, origin):
    """Return the ellipsoid of a link's inertia, no larger than the link.

    The link reaches to its joints and its centre of mass.
    A link that has these at its origin is as large as its distance from the joint before it.
    """
    mass = float(record["mass"])
    R = placement[:3, :3]
    body = RigidBody.about_origin(mass, record["first_moment"], symmetric(record["inertia"]))
    moments, axes = np.linalg.eigh(R.T @ body.inertia @ R)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    # A solid ellipsoid has I_x = m (b² + c²) / 5.
    half_axes = np.sqrt(np.maximum(2.5 / mass * (moments.sum() - 2.0 * moments), 0.0))
    centre = R.T @ (body.centre - placement[:3, 3])
    size = max(float(np.linalg.norm(point)) for point in [*bones, centre])
    size = size if size > MIN_LENGTH else float(np.linalg.norm(origin))
    if not size > MIN_LENGTH:
        size = float(half_axes.max()) / MAX_HALF_AXIS or MIN_SIZE
    if half_axes.min() > 0.0:
        half_axes *= min(1.0, MAX_HALF_AXIS * size / half_axes.max())
    else:  # the moments break the triangle inequality
        half_axes[:] = BALL * size
    return pose(centre, axes * half_axes)


def mesh_folders(source=None):
    """Return folders of meshes outside of ROS packages: of the URDF and of the example robots."""
    folder = folder_of(source) if source is not None else None
    urdfs = list(example_urdfs().values())
    return [*([folder.resolve()] if folder else []), urdfs[0].parent, urdfs[-1].parent]


def scene_of(model, source, meshes=None):
    """Return the scene of a robot, for JSON.

    ``links``, in the order of ``model.link_names``: name, mass [kg], visuals, and what stands for a
    link without them: ellipsoid (4x4, row by row; or null) and bones (ends in the link's axes [m]).
    Visuals are the visual shapes, or the collision shapes of a link with mass that has no others.
    ``rest``: positions next to the start within their limits. ``missing``: reasons why shapes are
    missing, by name. `source` is the URDF, xacro or MJCF of the RobotModel; the MeshLibrary loads
    and keeps meshes. Without one the scene has none.
    """
    missing = {}
    elements = link_elements(source)
    geometry = []
    for link in links_of(model):
        element = elements.get(link.name, ())
        shapes = _shapes(element, "visual", missing)
        if not shapes and link.ellipsoid is not None:
            shapes = _shapes(element, "collision", missing)
        geometry.append((shapes, link))
    shapeless = not missing and not any(shapes for shapes, _ in geometry)
    links = []
    for shapes, (name, mass, ellipsoid, bones) in geometry:
        visuals = [visual for shape in shapes if (visual := _visual(shape, meshes)) is not None]
        bones = [bone.tolist() for bone in bones] if ellipsoid is not None or shapeless else []
        ellipsoid = None if ellipsoid is None else ellipsoid.ravel().tolist()
        links.append(
            {"name": name, "mass": mass, "visuals": visuals, "ellipsoid": ellipsoid, "bones": bones}
        )
    missing |= meshes.missing if meshes is not None else {}
    rest = with_followers(model, np.clip(model.start, model.lower, model.upper)[None])[0]
    return {"links": links, "rest": rest.tolist(), "missing": missing}


def _visual(shape, meshes):
    """Return a visual, for JSON; None of a mesh that is missing."""
    visual = {
        "kind": shape.kind,
        "size": list(shape.numbers),
        "origin": shape.placement.ravel().tolist(),
    }
    if shape.kind != "mesh":
        return visual
    sha = meshes.add(shape.file, shape.numbers) if meshes is not None else None
    return sha and visual | {"mesh": sha}
