# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of masses and inertias: against what any rigid body can be, and against the links' geometry."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import InputError, UrdfError
from diag_dynamics.inspection.description import ROLES, Body, LinkText
from diag_dynamics.inspection.findings import Finding
from diag_dynamics.inspection.subject import Subject, about_links, least, named
from diag_dynamics.model.geometry import Solid
from diag_dynamics.model.options import not_physical

ESTIMATE = "Give measured ones, or estimate them: --estimate-inertias DENSITY -o new.urdf."

DENSEST = 20000.0
"""Density that no link has [kg/m³]: tungsten has 19 300, and a convex hull makes density come out too low, not too high."""

DENSE = 9000.0
"""Density of solid copper; a link of motors, steel and air stays below [kg/m³]."""

STEEL = (7000.0, 8300.0)
"""Densities of steels and cast iron [kg/m³]. Links of arms, with motors and air, have 1000 to 3000."""

MOSTLY = 0.9
"""Fraction of the measured mass from which the robot as a whole is of one material."""

ALIKE = 0.02
"""Relative difference of densities that rounding of masses to two or three digits leaves."""

LIGHTEST = 50.0
"""Density of foam [kg/m³]. Hollow links of the example robots have some 100 and more, a drone within its hull 20."""

OUTSIDE = 0.1
"""Distance of a centre of mass from the geometry's bounding box, by the box's diagonal: geometry leaves out covers, motors.

Of some 1100 bodies of the example robots most have theirs well inside; one of Talos, whose motors are not shown, is at 0.06.
"""

WIDE = 1.1
"""Radius of gyration by the distance of the geometry's farthest point, which it cannot exceed; and a margin."""

POINT = 0.02
"""The same ratio of what is nearly a point. A solid ball has 0.63, a bar 0.58, and one link in twenty is below 0.02."""

SHARE = 0.1
"""Share of the mass of rigidly attached links below which it does not matter that one of them is a point."""

SAME = 3
"""Links of so many sizes with the very same inertia have it from copying; sides of a robot share theirs and their size."""

SLENDER = 4.0
"""Ratio of moments across and along from which a shape is a bar whose axis cannot be mistaken."""


NEGATIVE, CORRECT = "negative principal moments of inertia; the least", "Correct the inertia in the URDF."


def possible_inertias(subject: Subject) -> Iterator[Finding]:
    """Inertias that no rigid body can have.

    Moments of inertia are sums of squared distances, so none is negative, and none exceeds the sum of the other two by which
    a flat plate has it. An inertia of a plate or a bar lies on that bound; what rounding of its digits puts beyond is a note
    at most.
    """
    negative: dict[str, float] = {}
    broken: dict[str, float] = {}
    slight: dict[str, float] = {}
    for link in subject.description.links.values():
        if link.inertia is None or not_physical(link.inertia, link.mass or 0.0) is None:
            continue
        first, second, third = np.linalg.eigvalsh(link.inertia)
        rounding = 3.0 * link.half_digit  # an eigenvalue is off by the norm of the matrix of errors at most
        excess = third - first - second
        if first < -rounding and not subject.is_negligible(link.mass):
            negative[link.name] = float(first)
            continue
        few = slight if subject.is_negligible(link.mass) or excess <= 3.0 * rounding else broken
        few[link.name] = 100.0 * excess / max(abs(first), third)
    yield from about_links("warning", "possible_inertias", NEGATIVE, negative, "kg m²", CORRECT)
    why = (
        "break the triangle inequality: the largest principal moment exceeds the sum of the others, by this share of it"
    )
    remedy = "Look up the inertia: about the centre of mass, in kg m², in the axes of the inertial's origin."
    yield from about_links(
        "warning", "possible_inertias", f"inertias that no rigid body has: they {why}", broken, "%", remedy
    )
    yield from about_links(
        "note",
        "possible_inertias",
        f"inertias of next to no mass, or rounded to few digits, {why}",
        slight,
        "%",
        "Harmless here; write more digits, or drop the <inertial>.",
    )


def missing_inertias(subject: Subject) -> Iterator[Finding]:
    """Links that should have mass and have none.

    A link with geometry is a thing, and a thing has mass. Where other links are rigidly attached to it, theirs may hold its
    mass; where none has any, what moves it moves nothing. Mass without moments of inertia is a point, which turns for free.
    """
    links = subject.description.links.values()
    check = "missing_inertias"
    if links and not any(link.mass for link in links):
        bare = [link.name for link in links if not link.has_inertial]
        what = "no link has a mass: there is no dynamics to compute; those without <inertial>"
        yield Finding("error", check, what, links=tuple(bare), remedy=ESTIMATE)
        return
    bodies = subject.description.bodies
    moved = {joint.child for joint in subject.description.joints}
    lacking: dict[str, list[str]] = {"alone": [], "root": [], "lumped": []}
    for body in bodies:
        bare = [link.name for link in body.links if link.has_geometry and not link.has_inertial]
        lacking["lumped" if body.mass else "alone" if body.links[0].name in moved else "root"] += bare
    yield from about_links(
        "warning",
        check,
        "moving links with geometry but without <inertial>: taken as massless",
        named(lacking["alone"]),
        "",
        ESTIMATE,
    )
    yield from about_links(
        "note",
        check,
        "links with geometry but without <inertial>; what is rigidly attached to them has mass",
        named(lacking["lumped"]),
        "",
        "Fine if that mass includes theirs.",
    )
    yield from about_links(
        "note",
        check,
        "the base has geometry but no <inertial>",
        named(lacking["root"]),
        "",
        "Matters only if the base moves.",
    )
    points: dict[str, float] = {}
    attached: dict[str, float] = {}
    for body in bodies:
        zero = {
            link.name: link.mass
            for link in body.links
            if link.mass and link.inertia is not None and not link.inertia.any()
        }
        if subject.is_negligible(sum(zero.values())):
            continue
        if len(zero) == len(body.heavy):
            points |= zero
        elif sum(zero.values()) > SHARE * body.mass:
            attached |= zero
    what, remedy = "mass with an inertia of zero: a point, which turns without effort", "Give the moments of inertia."
    yield from about_links("warning", check, what, points, "kg", remedy)
    yield from about_links("note", check, f"{what}; rigidly attached to what has inertia", attached, "kg", remedy)
    empty = [link.name for link in links if link.mass == 0.0 and link.inertia is not None and link.inertia.any()]
    yield from about_links(
        "warning", check, "an inertia without mass: nothing has that", named(empty), "", "Give the mass."
    )


def mass_without_geometry(subject: Subject) -> Iterator[Finding]:
    """Bodies that have mass and no shape, whose mass nothing here can be compared with."""
    bodies = [body for body in subject.description.bodies if not any(link.has_geometry for link in body.links)]
    masses = {body.heavy[0]: body.mass for body in bodies if not subject.is_negligible(body.mass)}
    yield from about_links(
        "note",
        "mass_without_geometry",
        "mass without geometry: nothing to compare it with",
        masses,
        "kg",
        "Fine if it was meant.",
    )


def density(subject: Subject) -> Iterator[Finding]:
    """Mass by the volume of the geometry, of links that are rigidly attached to each other together.

    Nothing is denser than tungsten, and hardly a link is as dense as solid metal, or as light as foam. Of visual and
    collision geometry the one counts that makes the density less remarkable; a mesh that is not watertight counts by its
    convex hull.
    """
    found: dict[str, dict[str, float]] = {"impossible": {}, "dense": {}, "light": {}}
    hull = False
    for body, solids in _measured(subject):
        densities = [body.mass / solid.volume for solid in solids.values()]
        low, high = min(densities), max(densities)
        kind = "impossible" if low > DENSEST else "dense" if low > DENSE else "light" if high < LIGHTEST else ""
        if kind:
            found[kind][body.heavy[0]] = low if kind != "light" else high
            hull |= any("hull" in of for solid in solids.values() for of in solid.of)
    by = " (meshes that are not watertight by their convex hull)" if hull else ""
    remedy = "Is the mass in kg, and are sizes and the meshes' scale in m?"
    check, unit = "density", "kg/m³"
    yield from about_links("warning", check, f"denser than anything{by}", found["impossible"], unit, remedy)
    yield from about_links("note", check, f"denser than solid copper{by}", found["dense"], unit, remedy)
    yield from about_links("note", check, f"lighter than foam{by}", found["light"], unit, remedy, least)


def uniform_density(subject: Subject) -> Iterator[Finding]:
    """Masses that CAD computed from volumes at one density.

    A link holds motors, gears, cables and air, so that links differ in density. CAD gives every part its default material;
    as solid steel an arm weighs several times as much as it does.
    """
    for role in ROLES:
        densities, masses = {}, {}
        for body in subject.description.bodies:
            solid = subject.description.solids(body).get(role)
            if solid and not subject.is_negligible(body.mass):
                densities[body.heavy[0]], masses[body.heavy[0]] = body.mass / solid.volume, body.mass
        steel = {name: value for name, value in densities.items() if STEEL[0] <= value <= STEEL[1]}
        if len(steel) > 1 and sum(masses[name] for name in steel) > MOSTLY * sum(masses.values()):
            what = "links as dense as solid steel, CAD's default material: masses are probably several times too large"
            remedy = "Weigh the links, or give each part its material in CAD and export again."
            yield from about_links("warning", "uniform_density", what, steel, "kg/m³", remedy)
            return
        if len(densities) >= SAME and max(densities.values()) < (1.0 + ALIKE) * min(densities.values()):
            what = "one density at all links: masses are computed from geometry, not measured"
            remedy = "Fine for first trials. Weigh the links, or identify them from a recording."
            yield from about_links("note", "uniform_density", what, densities, "kg/m³", remedy)
            return


def centre_of_mass(subject: Subject) -> Iterator[Finding]:
    """Centre of mass outside of the geometry.

    The centre of mass of any body lies in its convex hull, so in its bounding box. One that is far outside belongs to another
    frame: the origin of the CAD assembly, or of the joint before.
    """
    outside = {}
    for body, solids in _measured(subject):
        low, high = _box(solids)
        beyond = float(np.linalg.norm(np.maximum(0.0, np.maximum(low - body.centre, body.centre - high))))
        if beyond > OUTSIDE * np.linalg.norm(high - low):
            outside[body.heavy[0]] = beyond
    yield from about_links(
        "warning",
        "centre_of_mass",
        "centre of mass outside of the geometry's bounding box, by",
        outside,
        "m",
        "Is the inertial's origin in the axes of the link, and are visuals where the link is?",
    )


def gyration(subject: Subject) -> Iterator[Finding]:
    """Radius of gyration √(J/m) against the size of the geometry.

    No part of a body is farther from its centre of mass than the farthest point of its geometry, so neither is the root of
    the mean of squared distances. Inertias in kg mm² or g m², and those of tutorials (1 kg m²) are beyond; what is nearly a
    point has an inertia that somebody left out. What stands on a fixed base, or turns about one axis on it, does not feel
    the rest of its inertia.
    """
    wide: dict[str, float] = {}
    idle: dict[str, float] = {}
    point: dict[str, float] = {}
    for body, solids in _measured(subject):
        corners = np.concatenate([solid.corners for solid in solids.values()])
        for link in body.links:
            if link.inertia is None or subject.is_negligible(link.mass) or not link.inertia.any():
                continue
            reach = np.linalg.norm(corners - body.at(link.name, link.centre), axis=1).max()
            ratio = _gyration(np.linalg.eigvalsh(link.inertia)[-1], link) / reach
            if ratio > WIDE:
                axis = _only_axis(subject, body)
                felt = axis is None or _gyration(float(axis @ link.inertia @ axis), link) > WIDE * reach
                (wide if felt else idle)[link.name] = ratio
            elif ratio < POINT and (link.mass or 0.0) > 1e-3 * subject.total_mass:
                point[link.name] = ratio
    check, remedy = "gyration", "Is it in kg m², about the centre of mass, and of this link?"
    by = "radius of gyration over the distance of the farthest point"
    yield from about_links("warning", check, f"inertia too large for the geometry: {by}", wide, "1", remedy)
    what = f"inertia too large for the geometry, without effect as long as the base stands: {by}"
    yield from about_links(
        "note", check, what, idle, "1", "Identified parameters have such; a floating base needs other ones."
    )
    yield from about_links("note", check, f"inertia nearly that of a point: {by}", point, "1", remedy, least)


def _gyration(moment: float, link: LinkText) -> float:
    """Radius of gyration that a moment of inertia of a link means [m]."""
    return float(np.sqrt(max(moment, 0.0) / (link.mass or np.inf)))


def _only_axis(subject: Subject, body: Body) -> Array | None:
    """The only axis, in the link's axes, that a body on a fixed base turns about; zero if it stands, None if not one."""
    moved = {joint.child: joint for joint in subject.description.joints if joint.moves}
    joint = moved.get(body.links[0].name)
    if subject.model is None or subject.model.floating_base:
        return None
    if joint is None:
        return np.zeros(3)
    on_base = any(
        joint.parent in other.names and other.links[0].name not in moved for other in subject.description.bodies
    )
    if not on_base or joint.kind not in ("revolute", "continuous") or len(body.links) > 1:
        return None
    axis = np.array(joint.axis or (1.0, 0.0, 0.0))
    return axis / np.linalg.norm(axis)


def inertia_axes(subject: Subject) -> Iterator[Finding]:
    """Bars and discs whose inertia is that of one along another axis.

    A bar turns most easily about its long axis, a disc least easily about its own. Formulas of a cylinder along z that were
    used for one along x have it the other way round, and so does a wheel whose visual was turned and whose inertial was not.
    """
    wrong = []
    for body, solids in _measured(subject):
        for link in body.links:
            if link.inertia is None or not link.mass or link.mass < 0.8 * body.mass or subject.is_negligible(link.mass):
                continue
            R = body.placements[link.name][:3, :3]
            if all(_is_turned(solid, R @ link.inertia @ R.T) for solid in solids.values()):
                wrong.append(link.name)
    yield from about_links(
        "warning",
        "inertia_axes",
        "inertia about the wrong axis: the bar turns least easily about its length, or the disc most easily about its axis",
        named(wrong),
        "",
        "Turn the <inertial>'s origin as the geometry's, or exchange ixx, iyy and izz.",
    )


def _is_turned(solid: Solid, inertia: Array) -> bool:
    """Whether a solid is a bar or a disc, and the inertia is clearly that of one along another axis."""
    (u1, u2, u3), axes = np.linalg.eigh(solid.inertia)
    low, _, high = np.linalg.eigvalsh(inertia)
    along, across = (float(axis @ inertia @ axis) for axis in (axes[:, 0], axes[:, 2]))
    if u2 > SLENDER * u1 and u3 < 1.5 * u2:
        return low < 0.5 * high and along > 0.9 * high
    if u2 < 1.2 * u1 and u3 > 1.6 * u2:
        return high > 1.5 * low and across < 1.1 * low
    return False


def placeholders(subject: Subject) -> Iterator[Finding]:
    """Inertias that nobody has measured: one for links of several sizes, or the identity.

    Inertia grows with the fifth power of size. Tutorials give every link 1 kg and 1 kg m², or 0.001 kg m².
    """
    groups: dict[tuple[float, ...], list[LinkText]] = {}
    identity = {}
    for link in subject.description.links.values():
        if link.inertia is None or not link.mass or subject.is_negligible(link.mass) or not link.inertia.any():
            continue
        if np.allclose(link.inertia, np.eye(3), rtol=0.0, atol=1e-9):
            identity[link.name] = 2.0 * float(np.sqrt(2.5 / link.mass))
        else:
            key = (link.mass, *np.round(np.linalg.eigvalsh(link.inertia), 12))
            groups.setdefault(key, []).append(link)
    check = "placeholders"
    what = "an inertia of 1 kg m² about every axis, as tutorials have it: with its mass that of a ball of diameter"
    yield from about_links("warning", check, what, identity, "m", ESTIMATE)
    for (mass, *moments), links in groups.items():
        volumes: list[float] = []
        for link in links:
            volume = _volume(subject, link)
            if volume and not any(abs(volume - other) < 0.05 * other for other in volumes):
                volumes.append(volume)
        if len(volumes) >= SAME:
            names = named([link.name for link in links])
            what = (
                f"one mass and inertia, {mass:g} kg and up to {moments[-1]:g} kg m², at links of {len(volumes)} sizes"
            )
            yield from about_links("note", check, what, names, "", "Fine of the same motor in different housings.")


SIDES = (
    ("left", "right"),
    ("Left", "Right"),
    ("LEFT", "RIGHT"),
    ("l_", "r_"),
    ("L_", "R_"),
    ("FL_", "FR_"),
    ("RL_", "RR_"),
)
"""Beginnings or parts of names that tell sides apart."""

UNEVEN = 0.05
"""Difference of the masses of two sides, relative to the larger one, that no cable explains."""


def sides(subject: Subject) -> Iterator[Finding]:
    """Left and right links of different mass: sides are built alike, so one number is a slip or of an older version."""
    links, uneven = subject.description.links, {}
    for name, link in links.items():
        for left, right in SIDES:
            at = name.find(left) if len(left) > 3 else 0 if name.startswith(left) else -1
            other = links.get(name[:at] + right + name[at + len(left) :]) if at >= 0 else None
            if other is None or not link.has_inertial or not other.has_inertial:
                continue
            larger = max(link.mass or 0.0, other.mass or 0.0)
            if not subject.is_negligible(larger) and abs((link.mass or 0.0) - (other.mass or 0.0)) > UNEVEN * larger:
                uneven[name], uneven[other.name] = link.mass or 0.0, other.mass or 0.0
    yield from about_links(
        "note", "sides", "left and right differ in mass", uneven, "kg", "Fine if the sides are built differently."
    )


def _measured(subject: Subject) -> Iterator[tuple[Body, dict[str, Solid]]]:
    """Bodies that are not negligible and whose shapes are all measured, with what these enclose by role."""
    for body in subject.description.bodies:
        if not subject.is_negligible(body.mass) and subject.description.measured_wholly(body):
            yield body, subject.description.solids(body)


def _box(solids: dict[str, Solid]) -> tuple[Array, Array]:
    corners = np.concatenate([solid.corners for solid in solids.values()])
    return corners.min(axis=0), corners.max(axis=0)


def _volume(subject: Subject, link: LinkText) -> float | None:
    """Volume of a link's geometry, None if it has none that can be measured."""
    for role in ("collision", "visual"):
        try:
            solid = subject.description.solid(link, role)
        except (UrdfError, InputError):
            continue
        if solid:
            return solid.volume
    return None
