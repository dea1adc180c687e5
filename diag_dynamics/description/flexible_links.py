# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Flexible links by assumed modes: beams, and joints that follow modes.

A mode is an independent prismatic joint of a link without mass. Each section of the link, and the
frame at its tip, is the end of a chain of joints that follow the modes η: displacements Φη − ½ e
ηᵀHη along the axes of the beam, e its axis, and rotations R_z R_y R_x of Θη. H is the
foreshortening of a beam that bends and keeps its length.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import polynomial

from diag_dynamics.arrays import Array
from diag_dynamics.checks import mapping, numbers, per_name, positive
from diag_dynamics.description.constraints import Couplings
from diag_dynamics.description.description import (
    Description,
    Flexible,
    FlexibleLink,
    Form,
    Inertial,
    Joint,
    Link,
    Station,
)
from diag_dynamics.exceptions import InputError
from diag_dynamics.rigid_body import RigidBody, parallel_axes
from diag_dynamics.rotations import pose
from diag_dynamics.text import distinct, listed

MAX_MODES = 6  # of a plane: more shapes are powers of nearly the same form
LARGE_SLOPE = 0.3  # of the tip [rad]: beyond it a link is better two
# Distance of the inertial's centre from that of the modes' masses, by the length, above which one
# is wrong
FAR = 0.1
DIRECTIONS = "xyz"


# --- Beams ----------------------------------------------------------------------------------------


class _Field(NamedTuple):
    """Normal modes of a clamped beam in one direction.

    Columns are coefficients of the powers of ξ = x/L, the constant first.
    """

    coefficients: Array
    frequencies: Array
    length: float

    def values(self, xi: float, derivative: int = 0) -> Array:
        """Return each mode, or a derivative by x, at ξ."""
        columns = polynomial.polyder(self.coefficients, derivative)
        return np.asarray(polynomial.polyval(xi, columns)) / self.length**derivative

    def shortening(self, xi: float) -> Array:
        """Return ∫ φ_a' φ_b' dx from 0 to ξ."""
        H = np.zeros((len(self.frequencies),) * 2)
        for x, weight in _gauss(len(self.coefficients)):
            slope = self.values(x * xi, 1)
            H += weight * xi * self.length * np.outer(slope, slope)
        return H


def _normal_modes(
    count: int, order: int, length: float, stiffness: float, inertia: float
) -> _Field:
    """Return modes x^order … of bending (order 2, EI and mass) or torsion (1, GJ and inertia).

    The inertia of torsion is the polar inertia.
    """
    p = np.arange(order, order + count)
    powers = np.add.outer(p, p)
    derivative = p if order == 1 else p * (p - 1)
    L = np.linalg.inv(np.linalg.cholesky(inertia / (powers + 1.0)))
    K = (
        stiffness
        / length ** (2 * order - 1)
        * np.outer(derivative, derivative)
        / (powers - 2.0 * order + 1.0)
    )
    squares, V = np.linalg.eigh(L @ K @ L.T)
    columns = np.concatenate([np.zeros((order, count)), L.T @ V])
    return _Field(columns, np.sqrt(squares), length)


def _beam(
    link: str, tip: str, vector_: Array, entries: Mapping[str, Any], mass: float, polar: float
) -> FlexibleLink:
    """Return a uniform beam from the link's origin to the origin of its tip."""
    where = f"flexible link '{link}'"
    counts = numbers(
        f"{where}: modes", entries.get("modes", (2, 2, 0)), (3,), "three numbers of modes"
    )
    if not (counts.any() and np.isin(counts, range(MAX_MODES + 1)).all()):
        raise InputError(
            f"{where}: modes are {counts.tolist()}; expected three whole numbers from 0 to "
            f"{MAX_MODES}."
        )
    n_y, n_z, n_x = (int(n) for n in counts)
    EI = per_name(f"{where}: EI", entries["EI"], ("y", "z"), "a finite number > 0 [N m²]")
    GJ = positive(f"{where}: GJ", entries.get("GJ"), "[N m²]") if n_x else 1.0
    if n_x:
        positive(f"{where}: its inertia about the beam", polar, "[kg m²] for torsion")
    length = float(np.linalg.norm(vector_))
    planes = [_normal_modes(n, 2, length, EI[k], mass) for k, n in enumerate((n_y, n_z))]
    twist = _normal_modes(n_x, 1, length, GJ, polar)
    n = n_y + n_z + n_x
    parts = (slice(0, n_y), slice(n_y, n_y + n_z), slice(n_y + n_z, None))

    def station(xi: float, is_tip: bool, weight: float) -> Station:
        shape = np.zeros((3, n))
        slope = np.zeros((3, n))
        H = np.zeros((n, n))
        for k, plane in enumerate(planes):
            shape[1 + k, parts[k]] = plane.values(xi)
            H[parts[k], parts[k]] = plane.shortening(xi)
            if is_tip:
                slope[2 - k, parts[k]] = (1.0, -1.0)[k] * plane.values(xi, 1)
        slope[0, parts[2]] = twist.values(xi)
        inertia = tuple(weight * polar * np.array([1.0, 0.5, 0.5]))
        return Station(np.array([xi * length, 0.0, 0.0]), shape, slope, H, weight * mass, inertia)

    def bend(k: int, xi: float, weight: float) -> Array:
        row = np.zeros((2, n))
        row[0, parts[k]] = planes[k].values(xi, 2) * np.sqrt(weight * length * EI[k])
        row[1, parts[k]] = planes[k].values(xi, 1)
        return row

    points = max(n_y, n_z, n_x)
    names = tuple(
        f"{link}/{letter}{k + 1}"
        for letter, m in zip("yzx", (n_y, n_z, n_x), strict=True)
        for k in range(m)
    )
    return FlexibleLink(
        names,
        _axes(vector_),
        np.concatenate([planes[0].frequencies, planes[1].frequencies, twist.frequencies]),
        _ratios(where, entries, names),
        tuple(station(xi, False, weight) for xi, weight in _gauss(points + 2)),
        {tip: station(1.0, True, 0.0)},
        np.array([bend(k, *point) for k in (0, 1) for point in _gauss(3 * (n_y, n_z)[k])]).reshape(
            -1, 2, n
        ),
    )


def _gauss(count: int) -> list[tuple[float, float]]:
    """Return points and weights of an integral from 0 to 1."""
    if not count:
        return []
    x, w = np.polynomial.legendre.leggauss(count)
    return list(zip((0.5 * (1.0 + x)).tolist(), (0.5 * w).tolist(), strict=True))


def _ratios(where: str, entries: Mapping[str, Any], modes: tuple[str, ...]) -> Array:
    ratio = entries.get("damping_ratio", 0.0)
    return per_name(
        f"{where}: damping_ratio", ratio, modes, "a finite number >= 0", lambda x: 0.0 <= x < np.inf
    )


def _axes(direction: Array) -> Array:
    """Return the axes of a beam, x along it and y as near as possible to the link's y.

    If the link's y is near the beam, its z takes the place of y.
    """
    x = direction / np.linalg.norm(direction)
    y = np.eye(3)[1 if abs(x[1]) < 0.9 else 2]
    y = y - (y @ x) * x
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


# --- The robot ------------------------------------------------------------------------------------

BEAM = "tip", "EI", "GJ", "modes", "damping_ratio", "mass"


def with_flexible_links(description: Description, couplings: Couplings) -> Description:
    """Return a description with links and joints for modes of flexible links."""
    entries = mapping("flexible_links", couplings.content.get("flexible_links") or {})
    for name, entry in entries.items():
        description.link("flexible_links", name)
        builder = _Builder(description)
        link = builder.divide(name, mapping(f"flexible link '{name}'", entry))
        modes = frozenset(builder.joints.keys() - description.joints.keys())
        links, forms, groups = description.flexible
        description = description._replace(
            links=builder.links,
            joints=builder.joints,
            flexible=Flexible({**links, name: link}, {**forms, **builder.forms}, (*groups, modes)),
        )
    return description


class _Builder:
    """Links and joints of a description, to which those of the modes of a link are added."""

    def __init__(self, description: Description) -> None:
        self.links = dict(description.links)
        self.joints = dict(description.joints)
        self.forms: dict[str, Form] = {}
        self._robot = description.name

    def divide(self, name: str, entry: Mapping[str, Any]) -> FlexibleLink:
        """Divide a link into its modes, sections and tips."""
        inertial, flexible = _flexible_link(self.links[name], self.joints, entry)
        self.links[name] = Link(name, inertial)
        for k, mode in enumerate(flexible.modes):
            bound = LARGE_SLOPE / max(flexible.slope(np.eye(len(flexible.modes))[k]), 1e-9)
            self._add(Joint(mode, "prismatic", name, mode, np.eye(4), np.eye(3)[0], -bound, bound))
        for k, section in enumerate(flexible.sections):
            end = self._add_chain(name, f"{name}/{k + 1}", flexible, section)
            inertia = Inertial(section.mass, np.eye(4), np.diag(section.inertia))
            self.links[end] = Link(end, inertia)
        for joint, tip in flexible.tips.items():
            end = self._add_chain(name, f"{name}/tip", flexible, tip)
            turn = pose(np.zeros(3), flexible.axes.T @ self.joints[joint].origin[:3, :3])
            self.joints[joint] = self.joints[joint]._replace(parent=end, origin=turn)
        return flexible

    def _add(self, joint: Joint) -> None:
        """Add a joint and its child link of the same name."""
        if joint.name in self.links or joint.name in self.joints:
            raise InputError(
                f"flexible link: robot '{self._robot}' has '{joint.name}' already. Rename it."
            )
        self.links[joint.child] = Link(joint.child)
        self.joints[joint.name] = joint

    def _add_chain(self, parent: str, name: str, flexible: FlexibleLink, station: Station) -> str:
        """Add joints that take a frame from the link to where the modes have it.

        Return the link at its end.
        """
        origin = pose(flexible.axes @ station.at, flexible.axes)
        n = len(flexible.modes)
        freedoms = [(f"{name}/{DIRECTIONS[k]}", "prismatic", k, station.shape[k]) for k in range(3)]
        for k in (2, 1, 0):
            freedoms.append((f"{name}/r{DIRECTIONS[k]}", "continuous", k, station.slope[k]))
        link = parent
        for joint, kind, k, linear in freedoms:
            quadratic = -station.shortening if kind == "prismatic" and k == 0 else np.zeros((n, n))
            moving = np.flatnonzero((linear != 0.0) | quadratic.any(axis=1))
            if not len(moving):
                continue
            self._add(Joint(joint, kind, link, joint, origin, np.eye(3)[k]))
            sources = tuple(flexible.modes[i] for i in moving)
            quadratic = quadratic[np.ix_(moving, moving)]
            self.forms[joint] = Form(sources, linear[moving], quadratic)
            link = joint
            origin = np.eye(4)
        if link == parent:
            self._add(Joint(name, "fixed", parent, name, origin, np.eye(3)[0]))
            return name
        return link


def _flexible_link(
    link: Link, joints: Mapping[str, Joint], entry: Mapping[str, Any]
) -> tuple[Inertial | None, FlexibleLink]:
    """Check the entry of a link; return the inertia that is not that of its modes, and these."""
    where = f"flexible link '{link.name}'"
    mapping(where, entry, BEAM, BEAM[:2])
    if link.inertial is None or not link.inertial.mass > 0.0:
        raise InputError(f"{where} has no mass; expected an <inertial>.")
    tip = entry["tip"]
    outboard = [name for name, joint in joints.items() if joint.parent == link.name]
    if tip not in outboard:
        raise InputError(
            f"{where}: tip is '{tip}'; expected a joint of this link: {listed(outboard)}."
        )
    beam = joints[tip].origin[:3, 3]
    length = float(np.linalg.norm(beam))
    if not length > 0.0:
        raise InputError(f"{where}: joint '{tip}' is at its origin; expected a tip at a distance.")
    whole = link.inertial.body
    mass = positive(f"{where}: mass", entry.get("mass", whole.mass), "[kg]")
    x = beam / length
    about = whole.inertia + parallel_axes(whole.mass, whole.centre)
    polar = float(x @ about @ x) * mass / whole.mass
    flexible = _beam(link.name, tip, beam, entry, mass, polar)
    return _rest(where, whole, flexible, length), flexible


def _rest(where: str, whole: RigidBody, flexible: FlexibleLink, length: float) -> Inertial | None:
    """Return the inertia of a link without its sections, or None."""
    R = pose(np.zeros(3), flexible.axes)
    sections = [RigidBody(-s.mass, s.at, -np.diag(s.inertia)).moved(R) for s in flexible.sections]
    modal = -sum(section.mass for section in sections)
    left = whole.mass - modal
    if left < -1e-6 * whole.mass:
        value, bound = distinct(modal, whole.mass)
        raise InputError(
            f"{where}: the mass of its modes is {value} kg; expected no more than its {bound} kg."
        )
    if left > 1e-6 * whole.mass:
        rest = RigidBody.union(whole, *sections)
        return Inertial(rest.mass, pose(rest.centre), rest.inertia)
    centre = RigidBody.union(*sections).centre
    if np.linalg.norm(centre - whole.centre) > FAR * length:
        raise InputError(
            f"{where}: its centre of mass is at {whole.centre.tolist()} m, "
            f"that of its modes at {centre.tolist()} m."
            " Give the mass of the beam; the rest stays at the origin."
        )
    return None
