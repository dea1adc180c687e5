# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot as RViz markers: links tinted by energy share, ellipsoid of JM⁻¹Jᵀ, velocity, text."""

import math
import re

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from diag_dynamics.description.meshes import find_mesh
from diag_dynamics.description.text import folder_of
from diag_dynamics.exceptions import UrdfError
from diag_dynamics.model import end_effector_link
from diag_dynamics.model.joint_types import sliding_dofs
from diag_dynamics.nodes.support.messages import to_time
from diag_dynamics.page.layout import center_of_body
from diag_dynamics.page.scene import links_of
from diag_dynamics.rotations import pose, to_quaternion
from diag_dynamics.text import plain

COLD, HOT = np.array([0.55, 0.60, 0.66]), np.array([0.84, 0.37, 0.0])
"""Tints of a link without energy and of one that has all of it; the color-blind tell them apart."""

LIFETIME, HORIZON = 2, 0.5
"""Time after which a viewer deletes markers, and until a link is at the end of its arrow [s]."""

MIN_ENERGY = 1e-3
"""Energy added to K where shares are compared with it [J]."""

MAX_HALF_AXIS, MIN_REACH = 0.2, 0.05
"""Longest half axis of the ellipsoid at positions of zero, as a fraction of the robot's reach, and
minimum reach [m]."""


class MarkerMaker:
    """Makes the MarkerArray of states of one robot, in the frame of its root link.

    It is always the same message object.

    `description` is the URDF of the robot, or its path. `link` has the ellipsoid; empty: the
    end-effector link. `reach` is the distance of the farthest link from the root link at positions
    of zero [m]; `scale` gives half axes of the ellipsoid per root of an eigenvalue [m kg^½].
    """

    def __init__(self, dynamics, description, link=""):
        self._dynamics = dynamics
        self._model = dynamics.model
        model = dynamics.model
        q = dynamics.model.start
        bodies = dynamics.model.bodies
        self.link = link or end_effector_link(model)
        self.reach = max(
            MIN_REACH, *(float(np.linalg.norm(X[:3, 3])) for X in self._placements(q).values())
        )
        largest = float(self._mobility(q)[0].max(initial=0.0))
        self.scale = MAX_HALF_AXIS * self.reach / np.sqrt(largest) if largest > 0.0 else 0.0
        self._names = [plain(name) for name in model.dof_names]
        self._units = ["N" if slides else "N m" for slides in sliding_dofs(model)]
        geometry = links_of(model, description)
        folder = folder_of(description)
        self._parts = [(shape.name, *part) for shape in geometry for part in _parts(shape, folder)]
        for number, (*_, marker) in enumerate(self._parts):
            marker.id = number
        moving = [model.placement_in_body(name)[0] for name, *_ in self._parts]
        self._dofs = np.array([bodies["dof"][body] if body else -1 for body in moving], dtype=int)
        reach = self.reach
        self._ellipsoid = _marker(
            "ellipsoid", Marker.SPHERE, (1.0, 1.0, 1.0), (0.34, 0.71, 0.91, 0.4)
        )
        self._arrow = _marker(
            "velocity", Marker.ARROW, (0.015 * reach, 0.0375 * reach, 0.0), (0.9, 0.62, 0.0, 1.0)
        )
        self._text = _marker(
            "text", Marker.TEXT_VIEW_FACING, (0.0, 0.0, 0.07 * reach), (0.6, 0.6, 0.6, 1.0)
        )
        self._collision = _marker(
            "collision", Marker.SPHERE, (0.15 * reach,) * 3, (0.9, 0.1, 0.1, 0.5)
        )
        single = self._ellipsoid, self._arrow, self._text, self._collision
        self._message = MarkerArray(markers=[*(marker for *_, marker in self._parts), *single])

    def message(self, s, state, watch=None):
        """Return the markers of an Evaluation, its RobotState and the CollisionWatch, if any."""
        header = Header(stamp=to_time(state.newest), frame_id=self._model.root_link)
        for marker in self._message.markers:
            marker.header = header
        placed = self._placements(state.position)
        shares = s.energy_share
        self._tint(shares / (s.kinetic_energy + MIN_ENERGY))
        for name, placement, marker in self._parts:
            marker.pose = _pose(placed[name] @ placement)
        lines = [
            self._describe_energy(s.kinetic_energy, shares),
            self._draw_velocity(placed[self.link], state),
        ]
        lines += self._draw_contact(watch, placed)
        lines += ["estimated velocities"] * bool(state.velocity_estimated)
        self._text.text = "\n".join(lines)
        top = max((float(placed[name][2, 3]) for name, *_ in self._parts), default=0.0)
        self._text.pose.position = Point(z=top + 0.25 * self.reach)
        return self._message

    def _placements(self, q):
        """Return the placement of each link in the root link, shape (4, 4), by name."""
        placed = {name: self._dynamics.placement(q, name) for name in self._model.link_names}
        if not self._model.floating_base:
            return placed
        from_world = np.linalg.inv(placed[self._model.root_link])
        return {name: from_world @ X for name, X in placed.items()}

    def _mobility(self, q):
        """Return eigenvalues [1/kg] and axes of the linear part of JM⁻¹Jᵀ in the link's axes."""
        return np.linalg.eigh(self._dynamics.operational_inverse_inertia(q, self.link)[:3, :3])

    def _tint(self, fractions):
        """Tint each link by the fraction of K of the joint that moves it."""
        tints = COLD + np.append(fractions, 0.0)[self._dofs, None] * (
            HOT - COLD
        )  # dof −1: nothing moves the link
        for (*_, marker), (r, g, b) in zip(self._parts, tints.tolist(), strict=True):
            marker.color.r = r
            marker.color.g = g
            marker.color.b = b

    def _describe_energy(self, K, shares):
        if not K:
            return "K 0 J, at rest"
        k = int(np.argmax(shares))
        return f"K {K:.3g} J, {100 * shares[k] / K:.0f} % of it {self._names[k]}"

    def _draw_velocity(self, X, state):
        """Place ellipsoid and arrow at a link's placement; return the line about its velocity."""
        q = state.position
        R = X[:3, :3]
        origin = X[:3, 3]
        values, axes = self._mobility(q)
        half_axes = np.maximum(
            self.scale * np.sqrt(np.maximum(values, 0.0)), 5e-4 * self.reach
        )  # never flat
        placement, diameters = _sphere(pose(origin, R @ axes * half_axes))
        self._ellipsoid.pose = _pose(placement)
        self._ellipsoid.scale = _vector(diameters)
        v = self._dynamics.link_velocity(q, self.link, state.velocity)[:3]
        speed = float(np.linalg.norm(v))
        self._arrow.action = Marker.ADD if speed * HORIZON > 0.01 * self.reach else Marker.DELETE
        self._arrow.points = [_point(origin), _point(origin + HORIZON * R @ v)]
        line = f"{plain(self.link)}: {speed:.3g} m/s"
        mass = self._dynamics.reflected_mass(q, self.link, v) if speed else math.inf
        return f"{line}, reflected mass {mass:.3g} kg" if math.isfinite(mass) else line

    def _draw_contact(self, watch, placed):
        """Mark the touched link of a collision; return lines about external torque."""
        seen = watch.seen if watch and watch.seen.valid else None
        touched = watch.touched if seen and (watch.collision.on or watch.contact.on) else None
        link = touched.link if touched else ""
        is_marked = link and watch.collision.on
        self._collision.action = Marker.ADD if is_marked else Marker.DELETE
        if seen is None:
            return []
        k = int(np.nanargmax(np.abs(seen.external_torque)))
        torque = f"{abs(seen.external_torque[k]):.3g} {self._units[k]}"
        lines = [f"external torque {torque} at {self._names[k]}"]
        if link:
            center = np.append(center_of_body(self._model, link), 1.0)
            self._collision.pose.position = _point(placed[link] @ center)
            lines.insert(0, f"{plain(link)} ({100.0 * touched.confidence:.0f} %)")
        return ["collision", *lines] if watch.collision.on else lines


def _parts(link, folder):
    """Yield placement and marker of each shape of a LinkGeometry, or of its ellipsoid."""
    for shape in link.shapes:
        X = shape.placement
        numbers = shape.numbers
        d = 2.0 * shape.numbers[0]
        if shape.kind == "mesh":
            marker = _marker("links", Marker.MESH_RESOURCE, numbers)
            marker.mesh_resource = _resource(shape.file, folder)
            yield X, marker
        elif shape.kind == "box":
            yield X, _marker("links", Marker.CUBE, numbers)
        elif shape.kind == "sphere":
            yield X, _marker("links", Marker.SPHERE, (d, d, d))
        else:
            length = numbers[1] + (d if shape.kind == "capsule" else 0.0)
            yield X, _marker("links", Marker.CYLINDER, (d, d, length))
    if not link.shapes and link.ellipsoid is not None:
        placement, diameters = _sphere(link.ellipsoid)
        yield placement, _marker("links", Marker.SPHERE, diameters)


def _sphere(ellipsoid):
    """Return placement and diameters of an ellipsoid (4x4).

    Its first columns are its half axes.
    """
    half_axes = np.linalg.norm(ellipsoid[:3, :3], axis=0)
    placement = ellipsoid.copy()
    placement[:3, :3] /= half_axes
    placement[:3, 0] *= np.sign(np.linalg.det(placement))  # a mirror is no rotation
    return placement, 2.0 * half_axes


def _resource(file, folder):
    """Return the name of a mesh for viewers: in a package, else a whole path, else unchanged."""
    if package := re.fullmatch(r"(?:package|model)://+([^/]+)/+(.+)", file.strip()):
        return f"package://{package[1]}/{package[2]}"  # some exporters write a third slash
    try:
        return find_mesh(file, folder).resolve().as_uri()
    except UrdfError:
        return file


def _marker(namespace, kind, size, color=(0.0, 0.0, 0.0, 1.0)):
    marker = Marker(ns=namespace, type=kind, action=Marker.ADD, lifetime=Duration(sec=LIFETIME))
    marker.pose.orientation = Quaternion(w=1.0)
    marker.scale = _vector(size)
    marker.color = ColorRGBA(**dict(zip("rgba", color, strict=True)))
    return marker


def _point(x):
    return Point(x=float(x[0]), y=float(x[1]), z=float(x[2]))


def _vector(x):
    return Vector3(x=float(x[0]), y=float(x[1]), z=float(x[2]))


def _pose(X):
    x, y, z, w = to_quaternion(X[:3, :3])
    return Pose(position=_point(X[:3, 3]), orientation=Quaternion(x=x, y=y, z=z, w=w))
