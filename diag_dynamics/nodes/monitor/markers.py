# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot as markers: links tinted by energy share, the ellipsoid of JM⁻¹Jᵀ, a velocity, a text, and a contact."""

import math

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from diag_dynamics.model.single_joints import sliding_dofs
from diag_dynamics.nodes.support.messages import to_time
from diag_dynamics.text import plain

KINDS = {"box": Marker.CUBE, "cylinder": Marker.CYLINDER, "sphere": Marker.SPHERE, "mesh": Marker.MESH_RESOURCE}

COLD, HOT = np.array([0.55, 0.60, 0.66]), np.array([0.84, 0.37, 0.0])
"""Tints of a link without energy and of one that has all of it; told apart by the colour-blind, and on black."""

LITTLE = 1e-3
"""Energy [J] that is added to K where shares are compared with it: at rest all links are cold."""

LASTING = 2.0
"""Time after which a viewer takes a marker away that has not come again [s]: what it shows is never old."""

SOME = 0.1
"""Part of the largest |r| of a joint from which another joint takes part in a contact."""

AHEAD = 0.5
"""The arrow ends where the point would be after so long [s]."""


class MarkerMaker:
    """Makes the MarkerArray of states of one robot; its message is the same object each time.

    Everything is in the frame of the root link, so that a viewer whose fixed frame that is needs no tf.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene):
        self._scene, model = scene, scene.model
        self._names = [plain(name) for name in model.dof_names]
        self._of_dof, self._units = _links_of_dofs(model), ["N" if slides else "N m" for slides in sliding_dofs(model)]
        self._dof = np.array([part.dof for part in scene.parts], dtype=int)
        thin = 0.015 * scene.reach
        self._links = [_of_part(part, k) for k, part in enumerate(scene.parts)]
        self._ellipsoid = _marker("ellipsoid", Marker.SPHERE, ColorRGBA(r=0.34, g=0.71, b=0.91, a=0.4))
        self._arrow = _marker("velocity", Marker.ARROW, ColorRGBA(r=0.9, g=0.62, b=0.0, a=1.0))
        self._arrow.scale = Vector3(x=thin, y=2.5 * thin, z=0.0)
        self._text = _marker("text", Marker.TEXT_VIEW_FACING, ColorRGBA(r=0.6, g=0.6, b=0.6, a=1.0))
        self._text.scale = Vector3(x=0.0, y=0.0, z=0.07 * scene.reach)
        self._contact = _marker("contact", Marker.SPHERE, ColorRGBA(r=0.9, g=0.1, b=0.1, a=0.5))
        size = 0.15 * scene.reach
        self._contact.scale = Vector3(x=size, y=size, z=size)
        self._all = [*self._links, self._ellipsoid, self._arrow, self._text, self._contact]
        self._message = MarkerArray(markers=self._all)

    def message(self, s, state, watch=None):
        """Markers of an evaluation (or what stands for it), its RobotState, and the TorqueWatch, if there is one."""
        header = Header(stamp=to_time(state.newest), frame_id=self._scene.model.root_link)
        for marker in self._all:
            marker.header = header
        q, qd, shares = state.position, state.velocity, s.energy_share
        self._tint(shares / (s.kinetic_energy + LITTLE))
        for marker, X in zip(self._links, self._scene.placements(q), strict=True):
            marker.pose = _pose(X)
        placed, half_axes = self._scene.ellipsoid(q)
        self._ellipsoid.pose = _pose(placed)
        x, y, z = np.maximum(2.0 * half_axes, 1e-3 * self._scene.reach).tolist()  # nothing that is flat is drawn
        self._ellipsoid.scale = Vector3(x=x, y=y, z=z)
        told = self._move(placed[:3, 3], *self._scene.motion(q, qd))
        told = [self._energies(s.kinetic_energy, shares), told, *self._touched(watch, q)]
        self._text.text = "\n".join([*told, *(["velocities are estimated"] if state.velocity_estimated else [])])
        self._text.pose.position = Point(z=self._scene.top(q) + 0.25 * self._scene.reach)
        return self._message

    def _tint(self, part):
        """Give each link the tint of the part of K that the joint which moves it has."""
        tints = COLD + np.append(part, 0.0)[self._dof, None] * (HOT - COLD)  # −1 is the 0 at the end: nothing moves it
        for marker, (r, g, b) in zip(self._links, tints.tolist(), strict=True):
            marker.color.r, marker.color.g, marker.color.b = r, g, b

    def _energies(self, K, shares):
        if not K:
            return "K 0 J: at rest"
        k = int(np.argmax(shares))
        return f"K {K:.3g} J, most of it {self._names[k]}: {100 * shares[k] / K:.0f} %"

    def _move(self, begin, v, mass):
        """Draw the velocity of the ellipsoid's link, and tell of it."""
        link, speed = plain(self._scene.link), float(np.linalg.norm(v))
        self._arrow.action = Marker.ADD if speed * AHEAD > 0.01 * self._scene.reach else Marker.DELETE
        self._arrow.points = [_point(begin), _point(begin + AHEAD * v)]
        if not (speed and math.isfinite(mass)):
            return f"{link}: {speed:.3g} m/s"
        return f"{link}: {speed:.3g} m/s, {mass:.3g} kg along it"

    def _touched(self, watch, q):
        """Mark the link that is touched in a collision, and tell of it; nothing where external torque is not observed.

        A push on a link makes no ε of joints outboard of it: the outermost joint that has some of r carries the link.
        """
        seen = watch.seen if watch else None
        colliding = bool(seen and seen.valid and seen.collision)
        self._contact.action = Marker.ADD if colliding else Marker.DELETE
        if not (seen and seen.valid):
            return []
        k = int(np.argmax(np.abs(seen.external_torque)))
        said = f"external torque {abs(seen.external_torque[k]):.3g} {self._units[k]} at {self._names[k]}"
        if not colliding:
            return [said]
        r = np.abs(seen.residual)
        link = self._of_dof[int(np.flatnonzero(r >= SOME * r.max())[-1])]
        self._contact.pose.position = _point(self._scene.origin(q, link))
        return [f"contact at {plain(link)}", said]


def _links_of_dofs(model):
    """Link that each degree of freedom moves."""
    bodies = model.bodies
    own = {int(bodies["dof"][k]): k for k in range(1, len(bodies)) if bodies["owner"][k] == k}
    return [model.link_names[bodies["link"][own[dof]]] for dof in range(model.nv)]


def _marker(space, kind, color, number=0):
    marker = Marker(ns=space, id=number, type=kind, action=Marker.ADD, color=color)
    marker.pose = Pose(orientation=Quaternion(w=1.0))
    whole = int(LASTING)
    marker.lifetime = Duration(sec=whole, nanosec=int((LASTING - whole) * 1e9))
    return marker


def _of_part(part, number):
    marker = _marker("links", KINDS[part.kind], ColorRGBA(a=1.0), number)
    marker.scale = Vector3(**dict(zip("xyz", part.size, strict=True)))
    marker.mesh_resource = part.file
    return marker


def _point(x):
    return Point(x=float(x[0]), y=float(x[1]), z=float(x[2]))


def _pose(X):
    """Pose of a placement, shape (4, 4)."""
    (a, b, c, x), (d, e, f, y), (g, h, i, z) = X[:3].tolist()
    # The largest of four squares is at least a quarter: nothing is divided by little (Shepperd 1978).
    squares = (a + e + i, a - e - i, e - a - i, i - a - e)
    k = squares.index(max(squares))
    w = 0.5 * math.sqrt(1.0 + squares[k])
    n = 0.25 / w
    quaternion = (
        ((h - f) * n, (c - g) * n, (d - b) * n, w),
        (w, (b + d) * n, (c + g) * n, (h - f) * n),
        ((b + d) * n, w, (f + h) * n, (c - g) * n),
        ((c + g) * n, (f + h) * n, w, (d - b) * n),
    )[k]
    turn = Quaternion(**dict(zip("xyzw", quaternion, strict=True)))
    return Pose(position=Point(x=x, y=y, z=z), orientation=turn)
