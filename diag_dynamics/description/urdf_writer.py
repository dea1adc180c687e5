# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""URDFs written anew with inertias and parameters; all else in the file stays, comments too."""

from __future__ import annotations

import numpy as np
from lxml import etree

from diag_dynamics.description.elements import Element
from diag_dynamics.description.parameters import JointParameters, Parameters, with_parameters
from diag_dynamics.description.urdf import INERTIAL, describe_urdf, parse_urdf
from diag_dynamics.rigid_body import RigidBody


def urdf_with(text: str, parameters: Parameters) -> str:
    """Return a URDF's text with inertias, payloads, damping and friction.

    It has no place for armature and offsets. Numbers have the same bits. A comment in the first
    lines names method and date.
    """
    element = parse_urdf(text, comments=True)
    links = with_parameters(describe_urdf(element), parameters).links
    for link in element.findall("link"):
        name = link.get("name")
        payload = parameters.payloads.get(name)
        if name in parameters.links or (payload is not None and payload.mass):
            etree.strip_elements(link, "inertial", with_tail=False)
            inertial = links[name].inertial
            if inertial is not None:
                _insert(link, _inertial(inertial.body))
    for joint in element.findall("joint"):
        entry = parameters.joints.get(joint.get("name"), JointParameters()).known
        numbers = {name: repr(x) for name, x in entry.items() if name in ("damping", "friction")}
        if numbers:
            if joint.find("dynamics") is None:
                _insert(joint, etree.Element("dynamics"))
            joint.find("dynamics").attrib.update(numbers)
    if parameters.to_dict():
        keys = ("method", "date")
        origin = [str(parameters.origin[key]) for key in keys if parameters.origin.get(key)]
        source = ", ".join(["written by diag_dynamics", *origin])
        # A comment has no two dashes in a row.
        _insert(element, etree.Comment(f" {source} ".replace("--", "- -")))
    return str(etree.tostring(element.getroottree(), encoding="unicode"))


def _inertial(body: RigidBody) -> Element:
    """Return an `<inertial>` in the axes of the link."""
    inertial = etree.Element("inertial")
    etree.SubElement(inertial, "origin", xyz=" ".join(map(repr, body.centre.tolist())), rpy="0 0 0")
    etree.SubElement(inertial, "mass", value=repr(float(body.mass)))
    moments = map(repr, body.inertia[np.triu_indices(3)].tolist())
    etree.SubElement(inertial, "inertia", dict(zip(INERTIAL["inertia"], moments, strict=True)))
    etree.indent(inertial, space="  ", level=2)
    return inertial


def _insert(parent: Element, element: Element) -> None:
    """Insert an element or comment on a line of its own."""
    indent = parent.text if len(parent) and not (parent.text or "").strip() else None
    parent.text = indent or "\n    "
    element.tail = indent or "\n  "
    parent.insert(0, element)
