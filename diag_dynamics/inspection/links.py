# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of masses, inertias and geometry of links. Each yields fields of remarks."""

from __future__ import annotations

import numpy as np

from diag_dynamics.description.remarks import unphysical
from diag_dynamics.inspection.urdf import ROLES, Body, Found, Link, Urdf

DENSEST = 20000.0  # density that no link has [kg/m³]: tungsten has 19 300
DENSE = 9000.0  # density of solid copper [kg/m³]
STEEL = (7000.0, 8300.0)  # densities of steel and cast iron [kg/m³]; links have 1000 to 3000
LIGHTEST = 50.0  # density of foam [kg/m³]; hollow links have 100, a drone within its hull 20
MOSTLY = 0.9  # fraction of the measured mass from which a robot is of one material
ALIKE = 0.02  # relative difference of densities by rounding of masses
OUTSIDE = 0.1  # distance of a centre of mass from the box, over its diagonal; Talos has 0.06
WIDE = 1.1  # radius of gyration over the distance of the farthest point; 1 bounds any body
POINT = 0.02  # the same ratio of nearly a point; a solid ball has 0.63
SHARE = 0.1  # fraction of a body's mass below which a point mass does not matter
SAME = 3  # links of one density from which it is that of CAD


def possible_inertias(urdf: Urdf) -> Found:
    """Find moments of inertia below zero or above the sum of the others, beyond rounding."""
    links = [link for link in urdf.links.values() if link.inertia is not None]
    return unphysical((x.name, x.mass, x.inertia, x.half_digit) for x in links)


def missing_inertias(urdf: Urdf) -> Found:
    """Find links with geometry and no mass, mass without moments, and moments without mass."""
    links = urdf.links.values()
    if links and not any(link.mass for link in links):
        bare = [link.name for link in links if not link.has_inertial]
        yield from (("massless", name, 0.0) for name in bare or (None,))
        return
    for body in urdf.bodies:
        row = "lumped" if body.mass else "moving" if body.joint else "base"
        for link in body.links:
            if link.has_geometry and not link.has_inertial:
                yield row, link.name, 0.0
            if link.mass == 0.0 and link.inertia is not None and link.inertia.any():
                yield "no mass", link.name, 0.0
        points = [x for x in body.links if x.mass and x.inertia is not None and not x.inertia.any()]
        mass = sum(x.mass for x in points)
        alone = len(points) == len(body.heavy)
        if not urdf.is_negligible(mass) and (alone or mass > SHARE * body.mass):
            yield from (("point" if alone else "attached", x.name, x.mass) for x in points)


def mass_without_geometry(urdf: Urdf) -> Found:
    """Find bodies with mass and without shapes."""
    for body in urdf.heavy_bodies:
        if not any(link.has_geometry for link in body.links):
            yield "bodiless", body.heavy[0], body.mass


def density(urdf: Urdf) -> Found:
    """Find densities of metal and foam; of visual and collision geometry the less remarkable."""
    for body in urdf.measured_bodies:
        low = min(body.densities.values())
        high = max(body.densities.values())
        if low > DENSE:
            yield "impossible" if low > DENSEST else "dense", body.heavy[0], low
        elif high < LIGHTEST:
            yield "light", body.heavy[0], high


def uniform_density(urdf: Urdf) -> Found:
    """Find masses that CAD computed from volumes: nearly all of steel, or all of one density."""
    for role in ROLES:
        bodies = [body for body in urdf.heavy_bodies if role in body.solids]
        densities = [body.densities[role] for body in bodies]
        steel = [body for body in bodies if STEEL[0] <= body.densities[role] <= STEEL[1]]
        row = ""
        mass = sum(body.mass for body in bodies)
        if len(steel) > 1 and sum(body.mass for body in steel) > MOSTLY * mass:
            row = "steel"
            bodies = steel
        elif len(bodies) >= SAME and max(densities) < (1.0 + ALIKE) * min(densities):
            row = "uniform"
        if row:
            yield from ((row, body.heavy[0], body.densities[role]) for body in bodies)
            return


def centre_of_mass(urdf: Urdf) -> Found:
    """Find centres of mass far outside of the bounding box, as in the frame of an assembly."""
    for body in urdf.measured_bodies:
        low = body.corners.min(axis=0)
        high = body.corners.max(axis=0)
        distance = np.linalg.norm(body.centre - np.clip(body.centre, low, high))
        if distance > OUTSIDE * np.linalg.norm(high - low):
            yield "outside", body.heavy[0], distance


def gyration(urdf: Urdf) -> Found:
    """Find radii of gyration √(J/m) beyond the farthest point of the geometry, or near zero."""
    for body in urdf.measured_bodies:
        for link in filter(urdf.has_inertia, body.links):
            reach = np.linalg.norm(body.corners - body.centres[link.name], axis=1).max()
            moments = np.linalg.eigvalsh(link.inertia)[-1], _felt_moment(urdf, body, link)
            ratio, felt = np.sqrt(np.maximum(moments, 0.0) / link.mass) / reach
            if ratio > WIDE:
                yield "large" if felt > WIDE else "idle", link.name, ratio
            elif ratio < POINT and link.mass > 1e-3 * urdf.total_mass:
                yield "small", link.name, ratio


def _felt_moment(urdf: Urdf, body: Body, link: Link) -> float:
    """Return the largest moment with an effect; a link on a fixed base may turn about one axis."""
    joint = body.joint
    largest = float(np.linalg.eigvalsh(link.inertia)[-1])
    if joint is None or not urdf.stands:
        return largest if not urdf.stands else 0.0
    on_base = any(joint.parent in base.placements for base in urdf.bodies if base.joint is None)
    if not on_base or len(body.links) > 1 or joint.type not in ("revolute", "continuous"):
        return largest
    axis = joint.axis
    return float(axis @ link.inertia @ axis / (axis @ axis))


def placeholders(urdf: Urdf) -> Found:
    """Find inertias of 1 kg m² about all axes."""
    for link in filter(urdf.has_inertia, urdf.links.values()):
        if np.allclose(link.inertia, np.eye(3), rtol=0.0, atol=1e-9):
            yield "identity", link.name, 2.0 * np.sqrt(2.5 / link.mass)


def meshes(urdf: Urdf) -> Found:
    """Find meshes that are missing or cannot be measured; viewers need them, dynamics do not."""
    errors = [(link.name, *error) for link in urdf.links.values() for error in link.errors]
    reasons = {row: reason for _, row, reason in reversed(errors)}
    yield from ((row, name, 0.0, (reasons[row],)) for name, row, _ in errors)
