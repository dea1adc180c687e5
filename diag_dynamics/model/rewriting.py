# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A URDF written anew with parameters in it; all else in the file stays, comments too."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from lxml import etree

from diag_dynamics.arrays import Array
from diag_dynamics.model.parameters import Parameters, apply_parameters
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
    """Insert an element, each of its children on a line of its own."""
    inner = parent.text if len(parent) and parent.text and not parent.text.strip() else "\n    "
    unit = inner.rpartition("\n")[2]
    unit = unit[len(unit) // 2 :] or "  "  # links and joints, and so their children, are at depth 1 and 2
    element.tail = inner if len(parent) else inner.removesuffix(unit)
    if len(element):
        element.text = inner + unit
        for child in element:
            child.tail = element.text
        element[-1].tail = inner
    parent.insert(0, element)
    parent.text = inner


def urdf_with(text: str, parameters: Parameters) -> str:
    """Return the text of a URDF with inertias of links, payloads, damping and friction of joints written into it.

    A URDF has no place for rotor inertias and offsets of efforts: they stay with `parameters`.
    """
    element = parse_urdf(text, comments=True)
    robot, _ = read_urdf(text)
    inertials = {link.name: link.inertial for link in apply_parameters(robot, parameters).links}
    source = _source(parameters)
    for link in element.findall("link"):
        name = link.get("name")
        payload = parameters.payloads.get(name)
        if name in parameters.links or (payload is not None and payload.mass):
            for old in link.findall("inertial"):
                _remove(link, old)
            own = inertials[name]
            insert_inertia(link, source, own.mass, own.origin[:3, 3], np.asarray(own.inertia))
    for joint in element.findall("joint"):
        given = parameters.joints.get(joint.get("name"))
        numbers = {} if given is None else given.known
        _set_dynamics(joint, {name: numbers[name] for name in ("damping", "friction") if name in numbers}, source)
    return etree.tostring(element.getroottree(), encoding="unicode")


def _source(parameters: Parameters) -> str:
    origin = parameters.origin
    parts = ["written by diag_dynamics", *(str(origin[key]) for key in ("method", "date") if origin.get(key))]
    if recordings := origin.get("recordings"):
        paths = (one.get("path") if isinstance(one, Mapping) else one for one in recordings)
        parts.append(f"from {', '.join(str(path) for path in paths if path)}")
    if locked := parameters.locked_text:
        parts.append(f"with locked joints {locked}")
    return ", ".join(parts)


def _remove(parent: Any, element: Any) -> None:
    """Take an element out, and leave the text that follows it: lxml takes that for a part of it."""
    tail, before = element.tail or "", element.getprevious()
    if before is not None:
        before.tail = tail
    elif not (parent.text or "").strip():
        parent.text = tail
    parent.remove(element)


def _set_dynamics(joint: Any, numbers: dict[str, float], source: str) -> None:
    if not numbers:
        return
    dynamics = joint.find("dynamics")
    if dynamics is None:
        dynamics = etree.Element("dynamics")
        _insert_first(joint, dynamics)
    for name, value in numbers.items():
        dynamics.set(name, repr(value))
    comment, before = _comment(source), dynamics.getprevious()
    comment.tail = joint.text if before is None else before.tail  # on a line of its own, as the element is
    joint.insert(joint.index(dynamics), comment)
