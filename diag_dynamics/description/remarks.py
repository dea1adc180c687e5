# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Probable mistakes in the elements of a URDF that loads, and in inertias."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from difflib import get_close_matches

import numpy as np
from lxml import etree

from diag_dynamics.description.description import Link, Remark
from diag_dynamics.description.elements import Element, floats
from diag_dynamics.rigid_body import not_physical
from diag_dynamics.text import short

NEGLIGIBLE = 1e-5  # fraction of the robot's mass that rounding of its numbers exceeds

# Attributes of each element, those of Unitree's, ANYbotics' and Franka's tools included; those with
# a prefix are free
ATTRIBUTES: dict[str, tuple[str, ...]] = {
    "robot": ("name", "version"),
    "link": ("name", "type"),
    "inertial": (),
    "origin": ("xyz", "rpy", "quat_xyzw"),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz", "iyx", "izx", "izy"),
    "joint": ("name", "type", "dont_collapse"),
    "parent": ("link",),
    "child": ("link",),
    "axis": ("xyz",),
    "limit": (
        *("lower", "upper", "effort", "velocity", "acceleration", "deceleration", "jerk"),
        *("command_effort", "current", "gear_velocity"),
    ),
    "dynamics": ("damping", "friction", "D", "K", "mu_coulomb", "mu_viscous"),
    "mimic": ("joint", "multiplier", "offset"),
}

CHILDREN: dict[str, tuple[str, ...]] = {  # elements in each element that dynamics and contacts read
    "link": ("inertial", "visual", "collision"),
    "inertial": ("origin", "mass", "inertia"),
    "visual": ("origin",),
    "collision": ("origin",),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
    "origin": (),
}

# Elements of other formats, or of other places
MISPLACED = ("mass", "pose", "position", "orientation", "xyz", "rpy", "axes")
# Parts of the names of simulators' plugins that couple links or joints, lower case
COUPLING_PLUGINS = ("attach", "coupl", "detach", "gearbox", "loop_joint", "closed_loop", "mimic")
MIMIC = ("mimicJoint", "mimic_joint")  # elements of such plugins that name a joint with a source
MAX_ANGLE = 2.0 * math.pi + 1e-3  # of an origin [rad]: a full turn, rounded


def remarks_of(robot: Element) -> list[Remark]:
    """Return the probable mistakes of a parsed `<robot>` element, in the file's order."""
    remarks = list(_unknown_attributes(robot))
    for element in robot.iterchildren("link", "joint"):
        remarks += _of_element(element, element.tag, element.get("name") or "")
    for joint in robot.iterfind("gazebo/joint"):
        if joint.find("child") is not None:
            remarks.append(Remark("simulated", joint.get("name") or ""))
    return remarks + list(_couplings_of_plugins(robot))


def _couplings_of_plugins(robot: Element) -> Iterator[Remark]:
    """Yield a simulator's plugins that couple joints or links, but for joints with a <mimic>."""
    mimics = {mimic.getparent().get("name") for mimic in robot.iterfind("joint/mimic")}
    for plugin in robot.iterfind("gazebo//plugin"):
        names = [plugin.get("name") or "", plugin.get("filename") or ""]
        joints = {(element.text or "").strip() for tag in MIMIC for element in plugin.iterfind(tag)}
        is_coupling = any(part in "\n".join(names).lower() for part in COUPLING_PLUGINS)
        if is_coupling and not (joints and joints <= mimics):
            yield Remark("plugin", words=(short(next(filter(None, names))),))
    for parameter in robot.iterfind("ros2_control/joint/param[@name='mimic']"):
        joint = parameter.getparent().get("name") or ""
        if joint not in mimics:
            yield Remark("mimic parameter", joint)


def _of_element(element: Element, kind: str, name: str) -> Iterator[Remark]:
    """Yield the mistakes of an element of a link or joint, and of those within."""
    yield from _unknown_attributes(element, kind, name)
    is_axis = element.tag == "axis" and element.getparent().get("type") != "fixed"
    if is_axis and element.get("xyz") is None:
        yield Remark("no axis", name, kind=kind)
    if element.tag == "origin":
        angle = max(floats(element.get("rpy"), 3) or [0.0], key=abs)
        if abs(angle) > MAX_ANGLE:
            yield Remark("angle", name, angle, kind=kind)
    if element.tag not in CHILDREN:
        return
    children = CHILDREN[element.tag]
    for part in element.iterchildren(etree.Element):
        if part.tag in children:
            yield from _of_element(part, kind, name)
        elif part.tag in MISPLACED or get_close_matches(part.tag.lower(), children, 1, 0.8):
            yield Remark("element", name, 0.0, (short(part.tag)[1:-1], element.tag), kind)


def _unknown_attributes(
    element: Element, kind: str = "", name: str | None = None
) -> Iterator[Remark]:
    for attribute in element.keys() if element.tag in ATTRIBUTES else ():
        is_free = ":" in attribute or "}" in attribute
        if attribute not in ATTRIBUTES[element.tag] and not is_free:
            yield Remark("attribute", name, 0.0, (element.tag, short(attribute)), kind)


def unphysical(links: Iterable[Link]) -> Iterator[Remark]:
    """Find moments of inertia below zero or above the sum of the others, beyond rounding."""
    inertials = {link.name: link.inertial for link in links if link.inertial is not None}
    negligible = NEGLIGIBLE * sum(inertial.mass for inertial in inertials.values())
    for name, (mass, _, inertia) in inertials.items():
        if not_physical(inertia, mass) is None:
            continue
        first, second, third = np.linalg.eigvalsh(inertia)
        row = "negative" if first < 0.0 else "triangle"
        if not mass or mass < negligible:
            row = "rounded"
        excess = 100.0 * (third - first - second) / max(abs(first), third)
        yield Remark(row, name, first if row == "negative" else excess)
