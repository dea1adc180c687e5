# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""URDFs written anew with inertias and parameters; all else in the file stays, comments too."""

from __future__ import annotations

from typing import Any

import numpy as np
from lxml import etree

from diag_dynamics.description.parameters import JointParameters, Parameters, with_parameters
from diag_dynamics.description.urdf import INERTIAL, describe_urdf, parse_urdf
from diag_dynamics.rigid_body import RigidBody


def insert_inertia(link: Any, comment: str, body: RigidBody) -> None:
    """Insert an `<inertial>` with a comment into a link, in the file's manner of indenting.

    Numbers have the same bits.
    """
    inertial = etree.Element("inertial")
    inertial.append(_comment(comment))
    etree.SubElement(inertial, "origin", xyz=" ".join(map(repr, body.centre.tolist())), rpy="0 0 0")
    etree.SubElement(inertial, "mass", value=repr(float(body.mass)))
    moments = map(repr, body.inertia[np.triu_indices(3)].tolist())
    etree.SubElement(inertial, "inertia", dict(zip(INERTIAL["inertia"], moments, strict=True)))
    _insert_first(link, inertial)


def _comment(text: str) -> Any:
    # A comment has no two dashes in a row, but a file's name may have them.
    return etree.Comment(f" {text} ".replace("--", "- -"))


def _insert_first(parent: Any, element: Any) -> None:
    """Insert an element of a link or joint, with its children, on lines of their own."""
    indent = parent.text if len(parent) and not (parent.text or "").strip() else None
    parent.text = indent or "\n    "
    element.tail = indent or "\n  "
    etree.indent(element, space="  ", level=2)
    parent.insert(0, element)


def urdf_with(text: str, parameters: Parameters) -> str:
    """Return a URDF's text with inertias, payloads, damping and friction.

    It has no place for armature and offsets.
    """
    element = parse_urdf(text, comments=True)
    links = with_parameters(describe_urdf(element), parameters).links
    origin = [
        str(parameters.origin[key]) for key in ("method", "date") if parameters.origin.get(key)
    ]
    source = ", ".join(["written by diag_dynamics", *origin])
    for link in element.findall("link"):
        name = link.get("name")
        payload = parameters.payloads.get(name)
        if name in parameters.links or (payload is not None and payload.mass):
            etree.strip_elements(link, "inertial", with_tail=False)
            inertial = links[name].inertial
            if inertial is not None:
                insert_inertia(link, source, inertial.body)
    for joint in element.findall("joint"):
        entry = parameters.joints.get(joint.get("name"), JointParameters()).known
        if numbers := {
            name: repr(x) for name, x in entry.items() if name in ("damping", "friction")
        }:
            _set_dynamics(joint, numbers, source)
    return str(etree.tostring(element.getroottree(), encoding="unicode"))


def _set_dynamics(joint: Any, numbers: dict[str, str], source: str) -> None:
    dynamics = joint.find("dynamics")
    if dynamics is None:
        dynamics = etree.Element("dynamics")
        _insert_first(joint, dynamics)
    dynamics.attrib.update(numbers)
    comment = _comment(source)
    before = dynamics.getprevious()
    # The comment is on a line of its own, as the element is.
    comment.tail = joint.text if before is None else before.tail
    joint.insert(joint.index(dynamics), comment)
