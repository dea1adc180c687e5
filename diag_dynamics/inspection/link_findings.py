# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of masses, inertias and geometry of links. Each yields fields of remarks."""

from __future__ import annotations

import numpy as np

from diag_dynamics.description.remarks import unphysical
from diag_dynamics.inspection.inspected_robot import Found, Robot

OUTSIDE = 0.1  # distance of a centre of mass from the box, over its diagonal; Talos has 0.06
WIDE = 1.1  # radius of gyration over the distance of the farthest point; 1 bounds any body
POINT = 0.02  # the same ratio of nearly a point; a solid ball has 0.63


def possible_inertias(robot: Robot) -> Found:
    """Find moments of inertia below zero or above the sum of the others, beyond rounding."""
    return unphysical(robot.description.links.values())


def missing_inertias(robot: Robot) -> Found:
    """Find moving links with geometry and no mass, and mass or moments without the other."""
    if not robot.total_mass:
        bare = [link.name for link in robot.links.values() if not link.has_inertial]
        yield from (("massless", name, 0.0) for name in bare or (None,))
        return
    for body in robot.bodies:
        for link in body.links:
            if link.has_geometry and not link.has_inertial and body.joint and not body.mass:
                yield "moving", link.name, 0.0
            if link.mass == 0.0 and link.body.inertia.any():
                yield "no mass", link.name, 0.0
        heavy = [link for link in body.links if link.mass]
        points = [link for link in heavy if not link.body.inertia.any()]
        if len(points) == len(heavy) and not robot.is_negligible(body.mass):
            yield from (("point", link.name, link.mass) for link in points)


def centre_of_mass(robot: Robot) -> Found:
    """Find centres of mass far outside of the bounding box, as in the frame of an assembly."""
    for body in robot.measured_bodies:
        low = body.corners.min(axis=0)
        high = body.corners.max(axis=0)
        distance = np.linalg.norm(body.centre - np.clip(body.centre, low, high))
        if distance > OUTSIDE * np.linalg.norm(high - low):
            yield "outside", body.heavy[0], distance


def gyration(robot: Robot) -> Found:
    """Find radii of gyration √(J/m) beyond the farthest point of the geometry, or near zero."""
    base = robot.bodies[0]
    for body in robot.measured_bodies:
        is_near_base = body.joint is None or body.joint.parent in base.placements
        for link in filter(robot.has_inertia, body.links):
            reach = np.linalg.norm(body.corners - body.centres[link.name], axis=1).max()
            moment = max(np.linalg.eigvalsh(link.body.inertia)[-1], 0.0)
            ratio = np.sqrt(moment / link.mass) / reach
            if ratio > WIDE:
                is_idle = robot.stands and is_near_base
                yield "idle" if is_idle else "large", link.name, ratio
            elif ratio < POINT and link.mass > 1e-3 * robot.total_mass:
                yield "small", link.name, ratio


def placeholders(robot: Robot) -> Found:
    """Find inertias of 1 kg m² about all axes."""
    for link in filter(robot.has_inertia, robot.links.values()):
        if np.allclose(link.body.inertia, np.eye(3), rtol=0.0, atol=1e-9):
            yield "identity", link.name, 2.0 * np.sqrt(2.5 / link.mass)


def meshes(robot: Robot) -> Found:
    """Find shapes and meshes that cannot be read; viewers need them, dynamics do not."""
    errors = {link.name: link.errors[0] for link in robot.links.values() if link.errors}
    first = next(iter(errors.values()), "")
    return (("unreadable", name, 0.0, (first,)) for name in errors)
