# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A URDF written anew with parameters in it; all else in the file stays, comments too."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from lxml import etree

from diag_dynamics.arrays import Array
from diag_dynamics.model.parameters import JointParameters, Parameters, apply_parameters
from diag_dynamics.model.urdf import parse_urdf, read_urdf

ENTRIES = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}


def numbers_text(values: Iterable[float]) -> str:
    """Return numbers as the text of an attribute that has the same bits."""
    return " ".join(repr(float(value)) for value in values)


def set_inertia(inertial: Any, mass: float, centre: Array, inertia: Array) -> None:
    """Add to an `<inertial>` the mass [kg], centre (3,) [m] and inertia (3, 3) about it [kg m²]."""
    etree.SubElement(inertial, "origin", xyz=numbers_text(centre), rpy="0 0 0")
    etree.SubElement(inertial, "mass", value=repr(float(mass)))
    etree.SubElement(inertial, "inertia", {entry: repr(float(inertia[place])) for entry, place in ENTRIES.items()})


def insert_inertia(link: Any, said: str, mass: float, centre: Array, inertia: Array) -> None:
    """Insert an `<inertial>` with a comment into a link, in the file's manner of indenting."""
    inertial = etree.Element("inertial")
    inertial.append(_comment(said))
    set_inertia(inertial, mass, centre, inertia)
    _insert_first(link, inertial)


def _comment(said: str) -> Any:
    return etree.Comment(f" {said} ".replace("--", "- -"))  # a comment has no two dashes in a row, a file's name may


def _insert_first(parent: Any, element: Any) -> None:
    """Insert an element of a link or joint, with its children, on lines of their own."""
    indent = parent.text if len(parent) and not (parent.text or "").strip() else None
    parent.text, element.tail = indent or "\n    ", indent or "\n  "
    etree.indent(element, space="  ", level=2)
    parent.insert(0, element)


def urdf_with(text: str, parameters: Parameters) -> str:
    """Return a URDF's text with inertias, payloads, damping and friction; it has no place for armature and offsets."""
    element = parse_urdf(text, comments=True)
    robot, _ = read_urdf(element)
    inertials = {link.name: link.inertial for link in apply_parameters(robot, parameters).links}
    origin = [str(parameters.origin[key]) for key in ("method", "date") if parameters.origin.get(key)]
    source = ", ".join(["written by diag_dynamics", *origin])
    for link in element.findall("link"):
        name = link.get("name")
        payload = parameters.payloads.get(name)
        if name in parameters.links or (payload is not None and payload.mass):
            etree.strip_elements(link, "inertial", with_tail=False)
            own = inertials[name]
            insert_inertia(link, source, own.mass, own.origin[:3, 3], np.asarray(own.inertia))
    for joint in element.findall("joint"):
        given = parameters.joints.get(joint.get("name"), JointParameters()).known
        if numbers := {name: repr(x) for name, x in given.items() if name in ("damping", "friction")}:
            _set_dynamics(joint, numbers, source)
    return etree.tostring(element.getroottree(), encoding="unicode")


def _set_dynamics(joint: Any, numbers: dict[str, str], source: str) -> None:
    dynamics = joint.find("dynamics")
    if dynamics is None:
        dynamics = etree.Element("dynamics")
        _insert_first(joint, dynamics)
    dynamics.attrib.update(numbers)
    comment, before = _comment(source), dynamics.getprevious()
    comment.tail = joint.text if before is None else before.tail  # on a line of its own, as the element is
    joint.insert(joint.index(dynamics), comment)
