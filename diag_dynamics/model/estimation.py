# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inertias of links that have none, estimated from their geometry and written into the URDF."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from lxml import etree

from diag_dynamics.arrays import Array
from diag_dynamics.checks import positive
from diag_dynamics.exceptions import InputError, UrdfError
from diag_dynamics.model.geometry import Solid, shapes_of, solid_of, united
from diag_dynamics.model.meshes import Meshes
from diag_dynamics.model.rewriting import inertial_element, insert_first
from diag_dynamics.model.urdf import parse_urdf

LARGEST_DENSITY = 30000.0
"""Largest density accepted [kg/m³]; osmium, the densest element, has 22 590."""


class Estimate(NamedTuple):
    """Estimated inertia of a link: mass [kg], centre (3,) in its axes [m], inertia (3, 3) about the centre [kg m²].

    `role` is the geometry, "collision" or "visual"; `of` the shapes, a mesh that is not watertight by its convex hull.
    """

    link: str
    mass: float
    centre: Array
    inertia: Array
    role: str
    of: tuple[str, ...]

    @property
    def source(self) -> str:
        """What it is estimated from, in words."""
        return f"{self.role} {' + '.join(self.of)}"


class Estimated(NamedTuple):
    """Text of a URDF with estimated inertias, each with a comment, at a density [kg/m³].

    `failed` has the reason, by link, why an inertia could not be estimated.
    """

    text: str
    estimates: tuple[Estimate, ...]
    density: float
    failed: dict[str, str]

    def said(self, robot: str) -> str:
        """What was done, in a sentence or two for people; empty if nothing was."""
        parts = []
        if self.estimates:
            names = ", ".join(f"'{estimate.link}'" for estimate in self.estimates)
            parts.append(
                f"robot '{robot}': the inertias of these links are estimated from geometry at {self.density:g} kg/m³, "
                f"and are no measured ones: {names}."
            )
        if self.failed:
            reasons = "; ".join(f"'{link}' ({reason.rstrip('.')})" for link, reason in self.failed.items())
            parts.append(f"No inertia could be estimated of {reasons}.")
        return " ".join(parts)


def density_of(value: object) -> float:
    """A density, checked [kg/m³]."""
    density = positive("estimate_inertias", value, "[kg/m³]")
    if density > LARGEST_DENSITY:
        raise InputError(
            f"estimate_inertias is {value!r}, expected a density in kg/m³ up to {LARGEST_DENSITY:g}: water has 1000, "
            "aluminium 2700, steel 7850."
        )
    return density


def estimated(text: str, density: object, folder: Path | None) -> Estimated:
    """Return the URDF with an inertia for every link that has geometry and lacks one, at a uniform density [kg/m³].

    The collision geometry counts, or the visual one if that cannot be measured. Primitives and watertight meshes are exact,
    other meshes are replaced by their convex hull. Where shapes overlap, they count twice. Meshes begin from `folder`.
    """
    rho = density_of(density)
    robot, meshes = parse_urdf(text.encode(errors="replace"), comments=True), Meshes(folder)
    estimates, failed = [], {}
    for link in robot.findall("link"):
        name = link.get("name", "")
        if link.find("inertial") is not None or not (link.findall("collision") or link.findall("visual")):
            continue
        try:
            role, solid = _measured(link, meshes)
        except UrdfError as error:
            failed[name] = str(error)
            continue
        estimate = Estimate(name, rho * solid.volume, solid.centre, rho * solid.inertia, role, solid.of)
        said = f"estimated by diag_dynamics from {estimate.source} at {rho:g} kg/m3"
        insert_first(link, inertial_element(said, estimate.mass, estimate.centre, estimate.inertia))
        estimates.append(estimate)
    whole = etree.tostring(robot.getroottree(), encoding="unicode")
    return Estimated(whole, tuple(estimates), rho, failed)


def _measured(link: Any, meshes: Meshes) -> tuple[str, Solid]:
    """Which geometry of a link counts, and what it encloses."""
    reason = None
    for role in ("collision", "visual"):
        try:
            shapes = shapes_of(link, role)
            if shapes:
                return role, united(solid_of(shape, meshes) for shape in shapes)
        except UrdfError as error:
            reason = reason or error
    raise reason or UrdfError("its <collision> and <visual> have no shape")
