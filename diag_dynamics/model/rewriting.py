# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A URDF written anew with parameters in it; all else in the file stays, comments too."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from lxml import etree

from diag_dynamics.arrays import Array
from diag_dynamics.model.parameters import Parameters, robot_with
from diag_dynamics.model.urdf import parse_urdf, read_urdf

ENTRIES = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}


def inertial_element(said: str, mass: float, centre: Array, inertia: Array) -> Any:
    """Return an `<inertial>` with a comment: mass [kg], centre (3,) [m] and inertia (3, 3) about it [kg m²]."""
    inertial = etree.Element("inertial")
    inertial.append(comment(said))
    etree.SubElement(inertial, "origin", xyz=" ".join(repr(float(x)) for x in centre), rpy="0 0 0")
    etree.SubElement(inertial, "mass", value=repr(float(mass)))
    etree.SubElement(inertial, "inertia", {entry: repr(float(inertia[place])) for entry, place in ENTRIES.items()})
    return inertial


def comment(said: str) -> Any:
    """A comment, which may not hold two dashes in a row, as a file's name may."""
    return etree.Comment(f" {said} ".replace("--", "- -"))


def insert_first(parent: Any, element: Any) -> None:
    """Put an element before all else of another one, in the file's manner of indenting."""
    inner = parent.text if len(parent) and parent.text and not parent.text.strip() else "\n    "
    indent = inner.rpartition("\n")[2]
    outer = inner + (
        indent[len(indent) // 2 :] or "  "
    )  # links and joints, and so their children, are at depth 1 and 2
    element.tail = inner if len(parent) else inner[: len(inner) - len(indent) // 2]
    if len(element):
        element.text = outer
        for child in element:
            child.tail = outer
        element[-1].tail = inner
    parent.insert(0, element)
    parent.text = inner


def urdf_with(text: str, parameters: Parameters) -> str:
    """Return the text of a URDF with inertias of links, payloads, damping and friction of joints written into it.

    A URDF has no place for rotor inertias and offsets of efforts: they stay with `parameters`.
    """
    element = parse_urdf(text.encode(errors="replace"), comments=True)
    robot, _ = read_urdf(text)
    wanted = robot_with(robot, parameters)
    inertials = {link.name: link.inertial for link in wanted.links}
    source = _source(parameters)
    for link in element.findall("link"):
        name = link.get("name")
        payload = parameters.payloads.get(name)
        if name in parameters.links or (payload is not None and payload.mass):
            own = inertials[name]
            for old in link.findall("inertial"):
                _remove(link, old)
            insert_first(link, inertial_element(source, own.mass, own.origin[:3, 3], np.asarray(own.inertia)))
    for joint in element.findall("joint"):
        given = parameters.joints.get(joint.get("name"))
        if given is not None:
            _resist(joint, {"damping": given.damping, "friction": given.friction}, source)
    return etree.tostring(element.getroottree(), encoding="unicode")


def _source(parameters: Parameters) -> str:
    origin = parameters.origin
    parts = [str(origin[key]) for key in ("method", "date") if origin.get(key)]
    recordings = origin.get("recordings")
    if recordings:
        paths = (one.get("path") if isinstance(one, Mapping) else one for one in recordings)
        parts.append(f"from {', '.join(str(path) for path in paths if path)}")
    locked = origin.get("locked_joints")
    if isinstance(locked, Mapping) and locked:
        parts.append(f"with locked joints {', '.join(f'{name}={value}' for name, value in locked.items())}")
    return ", ".join(["written by diag_dynamics", *parts])


def _remove(parent: Any, element: Any) -> None:
    """Take an element out, and leave the text that follows it: lxml takes that for a part of it."""
    tail, before = element.tail or "", element.getprevious()
    if before is None:
        parent.text = tail if not (parent.text or "").strip() else parent.text
    else:
        before.tail = tail
    parent.remove(element)


def _resist(joint: Any, given: dict[str, float | None], source: str) -> None:
    """Set what resists a joint, as far as it is given."""
    numbers = {name: repr(float(value)) for name, value in given.items() if value is not None}
    if not numbers:
        return
    dynamics = joint.find("dynamics")
    if dynamics is None:
        dynamics = etree.Element("dynamics")
        insert_first(joint, dynamics)
    for name, number in numbers.items():
        dynamics.set(name, number)
    before = dynamics.getprevious()
    said = comment(source)
    said.tail = joint.text if before is None else before.tail  # on a line of its own, as the element is
    joint.insert(joint.index(dynamics), said)
