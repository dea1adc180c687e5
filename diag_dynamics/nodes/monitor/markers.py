# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot as RViz markers: ellipsoids of links, tinted by energy share or collision, and text."""

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, Quaternion, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from diag_dynamics.nodes.support.messages import to_time
from diag_dynamics.page.scene import links_of
from diag_dynamics.rotations import to_quaternion
from diag_dynamics.text import plain

COLD, HOT = np.array([0.55, 0.60, 0.66]), np.array([0.84, 0.37, 0.0])
"""Tints of a link without energy and of one that has all of it; the color-blind tell them apart."""

TOUCHED, TEXT = np.array([0.9, 0.1, 0.1]), np.array([0.6, 0.6, 0.6])
"""Colors of the link of a collision, and of the text."""

LIFETIME = 2
"""Time after which a viewer deletes markers [s]."""

MIN_ENERGY = 1e-3
"""Energy added to K where shares are compared with it [J]."""

LETTER, GAP = 0.06, 0.2
"""Height of a letter of the text, and of the text above the links [m]."""


class MarkerMaker:
    """Makes the MarkerArray of states of one robot, in the frame of its root link."""

    def __init__(self, dynamics):
        self._dynamics = dynamics
        self._ellipsoids = [
            (link.name, link.ellipsoid)
            for link in links_of(dynamics.model)
            if link.ellipsoid is not None
        ]

    def message(self, s, state, watch=None):
        """Return the markers of an Evaluation, its RobotState and the CollisionWatch, if any."""
        model = self._dynamics.model
        q = state.position
        shares = s.energy_share / (s.kinetic_energy + MIN_ENERGY)
        lines = [f"K {s.kinetic_energy:.3g} J"]
        if shares.any():
            k = int(np.argmax(shares))
            lines.append(f"{shares[k]:.0%} of it {plain(model.dof_names[k])}")
        touched_body = None
        if watch and watch.seen.valid and watch.collision.on:
            lines.append("collision")
            if (touched := watch.touched) and touched.link:
                touched_body = model.placement_in_body(touched.link)[0]
                lines[-1] += f": {plain(touched.link)} ({touched.confidence:.0%})"
        to_root = np.linalg.inv(self._dynamics.placement(q, model.root_link))
        markers = []
        top = 0.0
        for name, ellipsoid in self._ellipsoids:
            body = model.placement_in_body(name)[0]
            share = shares[model.bodies["dof"][body]] if body else 0.0
            color = TOUCHED if body == touched_body else COLD + share * (HOT - COLD)
            axes = to_root @ self._dynamics.placement(q, name) @ ellipsoid
            half_axes = np.linalg.norm(axes[:3, :3], axis=0)
            marker = _marker("links", Marker.SPHERE, 2.0 * half_axes, color, axes[:3, 3])
            axes[:3, :3] /= half_axes
            axes[:3, 0] *= np.sign(np.linalg.det(axes))  # a mirror is no rotation
            x, y, z, w = to_quaternion(axes[:3, :3])
            marker.pose.orientation = Quaternion(x=x, y=y, z=z, w=w)
            marker.id = len(markers)
            markers.append(marker)
            top = max(top, axes[2, 3])
        size = np.array([0.0, 0.0, LETTER])
        text = _marker("text", Marker.TEXT_VIEW_FACING, size, TEXT, np.array([0.0, 0.0, top + GAP]))
        text.text = "\n".join(lines)
        markers.append(text)
        header = Header(stamp=to_time(state.newest), frame_id=model.root_link)
        for marker in markers:
            marker.header = header
        return MarkerArray(markers=markers)


def _marker(namespace, kind, size, color, position):
    marker = Marker(ns=namespace, type=kind, lifetime=Duration(sec=LIFETIME))
    marker.scale = Vector3(**dict(zip("xyz", size.tolist(), strict=True)))
    marker.color = ColorRGBA(a=1.0, **dict(zip("rgb", color.tolist(), strict=True)))
    marker.pose.position = Point(**dict(zip("xyz", position.tolist(), strict=True)))
    return marker
