# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checked links and joints from the text of a URDF, the one place for XML and yourdfpy.

The text may come from a topic: no entities, no network, no files, bounded size and depth. yourdfpy
reads a reduced copy with the elements that dynamics needs, so broken visuals and unknown extensions
do not matter.
"""

from __future__ import annotations

import io
from collections.abc import Container, Iterable, Mapping
from typing import Any

import numpy as np
from lxml import etree

from diag_dynamics.description.description import (
    JOINT_TYPES,
    Description,
    Inertial,
    Joint,
    Link,
    Mimic,
)
from diag_dynamics.description.elements import (
    ENDS,
    Element,
    driven_joints,
    is_xacro,
    local_name,
    loops_of,
    numbers_of,
    placement_of,
    reflected_inertias,
)
from diag_dynamics.description.remarks import remarks_of
from diag_dynamics.description.urdf_text import DEFINITIONS, NO_LINK
from diag_dynamics.exceptions import UrdfError
from diag_dynamics.text import listed, short

MAX_JOINTS = 2000  # largest number of joints; the largest public robots have some 200

ROOTS = {  # root elements of files that are no URDF: their kind, and what to do
    "mujoco": "an MJCF of MuJoCo. Load it with load_mjcf",
    "sdf": "an SDF of Gazebo. Load the URDF that it was made from",
}

UNEXPANDED = (
    "it is unexpanded xacro. Run xacro on it first. A file whose path ends with .xacro is expanded."
)

# Parts of the names of elements that close loops or couple joints, of Isaac Sim, URDF+ and other
# dialects, lower case
LOOPS = ("loop", "constraint", "coupling", "gear_joint", "gearjoint")
TREE = (
    "expected a tree. Describe a loop by <loop_joint>, <constraint> or a file of loops "
    "(load_urdf: loops, commands: --loops, nodes: loops_file)."
)
CONTAINERS = ("robot", "link", "joint", "gazebo")  # elements whose children may close loops

# Elements that dynamics needs, each with the attributes that hold numbers. Limits may be infinite.
INERTIAL = {
    "mass": {"value": 1},
    "inertia": dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1),
}
JOINT = {
    "axis": {"xyz": 3},
    "limit": dict.fromkeys(("lower", "upper", "effort", "velocity"), 1),
    "dynamics": dict.fromkeys(("damping", "friction"), 1),
    "mimic": dict.fromkeys(("multiplier", "offset"), 1),
}
READ = {part: tuple(JOINT[part]) for part in ("limit", "dynamics")}  # fields of Joint


def describe_urdf(element: Element) -> Description:
    """Return the description of a parsed <robot> element."""
    loops = loops_of(element)
    joint_count, link_count = (len(element.findall(tag)) for tag in ("joint", "link"))
    reject_large("URDF", joint_count, link_count)
    _reject_loops(element)
    name = element.get("name") or "robot"
    armature, ignored = reflected_inertias(element)
    links, joints = _read(element, armature)
    root = _root_link(links, {record.child: record.parent for record in joints.values()})
    joints = {record.name: checked_joint(record) for record in joints.values()}
    remarks = (*remarks_of(element), *ignored)
    return Description(
        name, root, links, joints, loops, driven=driven_joints(element), remarks=remarks
    )


def reject_large(kind: str, joint_count: int, link_count: int) -> None:
    """Reject a robot that would take too long to load."""
    if max(joint_count, link_count - 1) > MAX_JOINTS:
        raise UrdfError(
            f"The {kind} has {joint_count} joints and {link_count} links, and no more than "
            f"{MAX_JOINTS} joints are accepted."
        )


def checked_joint(joint: Joint) -> Joint:
    """Return a joint, with limits if its type has these; reject numbers that no joint can have."""
    if joint.type not in ("revolute", "prismatic"):
        joint = joint._replace(lower=-np.inf, upper=np.inf)
    for name in ("damping", "friction"):
        if (value := getattr(joint, name)) < 0.0:
            raise UrdfError(f"joint '{joint.name}': {name} is {value}; expected a number >= 0.")
    if joint.lower > joint.upper:
        raise UrdfError(
            f"joint '{joint.name}': lower limit is {joint.lower}; expected at most the upper one, "
            f"{joint.upper}."
        )
    if joint.type not in ("fixed", "floating") and np.linalg.norm(joint.axis) < 1e-9:
        axis = " ".join(map(repr, joint.axis.tolist()))
        raise UrdfError(f"joint '{joint.name}': axis '{axis}' has no direction.")
    return joint


def _reject_loops(robot: Element) -> None:
    """Reject elements of dialects of URDF that change dynamics, except loops that can be closed."""
    for element in robot.iter(etree.Element):
        parent = element.getparent()
        tag = local_name(element)
        if parent is None or parent.tag not in CONTAINERS or (parent is robot and tag in ENDS):
            continue
        if (tag == "joint" and element.tag != "joint") or any(
            part in tag.lower() for part in LOOPS
        ):
            shown = short(f"{element.prefix}:{tag}" if element.prefix else element.tag)[1:-1]
            name = f" name={short(element.get('name'))}" if element.get("name") else ""
            raise UrdfError(f"<{shown}{name}> is not supported; {TREE}")


def parse_urdf(text: str, comments: bool = False) -> Element:
    """Return the <robot> element of XML text, without unexpanded xacro and entities.

    Nothing else is checked.
    """
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        remove_comments=not comments,
        remove_pis=True,
        recover=True,  # from undeclared prefixes of extensions, and from nothing else: see below
    )
    try:
        robot = etree.fromstring(text.encode(errors="replace"), parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise UrdfError(f"The URDF is not well-formed XML: {error}") from error
    for entry in parser.error_log:
        if entry.domain != etree.ErrorDomains.NAMESPACE and entry.level >= etree.ErrorLevels.ERROR:
            raise UrdfError(
                f"The URDF is not well-formed XML: {entry.message.strip()} (line {entry.line})"
            )
    if robot is None:
        raise UrdfError("The URDF is not well-formed XML: it has no element.")
    if robot.getroottree().docinfo.internalDTD is not None:  # also behind comments
        raise UrdfError(
            "The URDF has a DOCTYPE, which is not accepted: entities are never expanded."
        )
    _reject_xacro(robot)
    for element in robot.iter(etree.Element):
        if (
            element.prefix is None and "}" in element.tag
        ):  # a default namespace, as some schemas ask for
            element.tag = element.tag.rpartition("}")[2]
    if robot.tag != "robot":
        kind = f": the file is {ROOTS[robot.tag]}" if robot.tag in ROOTS else ""
        raise UrdfError(f"The root element is <{short(robot.tag)[1:-1]}>; expected <robot>{kind}.")
    return robot


def _reject_xacro(robot: Element) -> None:
    """Reject unexpanded xacro; definitions that nothing uses have no effect."""
    stack = [robot]
    while stack:
        for element in stack.pop().iterchildren(etree.Element):
            if not is_xacro(element):
                stack.append(element)
            elif local_name(element) not in DEFINITIONS:
                raise UrdfError(f"The URDF contains <xacro:{local_name(element)}>: {UNEXPANDED}")


def _read(
    element: Element, armature: Mapping[str, float]
) -> tuple[dict[str, Link], dict[str, Joint]]:
    """Return the records of links and joints, from a copy of the elements that yourdfpy needs.

    Importing yourdfpy takes a second.
    """
    try:
        import yourdfpy
    except Exception as error:  # also of a library for meshes that does not fit the NumPy
        raise UrdfError(
            f"The URDF reader yourdfpy cannot be imported: {error!r}. "
            "Install it: pip install yourdfpy."
        ) from error
    links = _named(element, "link")
    joints = _named(element, "joint")
    if not links:
        raise UrdfError(NO_LINK)
    copy = etree.Element("robot", name="robot")
    carriers: dict[str, str] = {}  # joint of each link that has a parent
    for name, link in links.items():
        copy.append(_copied_link(name, link))
    for name, joint in joints.items():
        child = _end(joint, name, "child", links)
        if child in carriers:
            raise UrdfError(
                f"link '{child}' is the child of two joints, '{carriers[child]}' and "
                f"'{name}'; {TREE} Remove the joint that closes it."
            )
        carriers[child] = name
        copy.append(_copied_joint(name, joint, _end(joint, name, "parent", links), child))
    text = etree.tostring(copy)
    if b"${" in text or b"$(" in text:
        raise UrdfError(f"The URDF contains a name with $: {UNEXPANDED}")
    load = yourdfpy.URDF.load
    robot = load(io.BytesIO(text), build_scene_graph=False, load_meshes=False).robot
    return (
        {link.name: _link(link, links[link.name]) for link in robot.links},
        {joint.name: _joint(joint, joints[joint.name], armature) for joint in robot.joints},
    )


def _named(robot: Element, tag: str) -> dict[str, Element]:
    """Return links or joints by name; reject missing names and duplicates."""
    elements: dict[str, Element] = {}
    for element in robot.findall(tag):
        name = element.get("name")
        if not name:
            raise UrdfError(f"A <{tag}> in line {element.sourceline} has no name.")
        if name in elements:
            raise UrdfError(
                f"Two elements <{tag}> have the name '{name}'; expected one. Rename the other."
            )
        elements[name] = element
    return elements


def _copied_link(name: str, link: Element) -> Element:
    """Return a copy of a link with the numbers of its inertial."""
    copy = etree.Element("link", name=name)
    inertial = link.find("inertial")
    if inertial is not None:
        where = f"link '{name}'"
        target = etree.SubElement(copy, "inertial")
        _copy_numbers(inertial, target, INERTIAL, where)
        names = [(part, attribute) for part in INERTIAL for attribute in INERTIAL[part]]
        missing = [f"<{a} {b}=…>" for a, b in names if target.find(f"{a}[@{b}]") is None]
        if missing:
            raise UrdfError(f"{where}: <inertial> lacks {missing[0]}.")
    return copy


def _copied_joint(name: str, joint: Element, parent: str, child: str) -> Element:
    """Return a copy of a joint with its numbers."""
    where = f"joint '{name}'"
    kind = joint.get("type")
    if kind not in JOINT_TYPES:
        raise UrdfError(f"{where}: unknown type {short(kind)}; known are {', '.join(JOINT_TYPES)}.")
    copy = etree.Element("joint", name=name, type=kind)
    etree.SubElement(copy, "parent", link=parent)
    etree.SubElement(copy, "child", link=child)
    _copy_numbers(joint, copy, JOINT, where)
    mimic = copy.find("mimic")
    if mimic is not None:
        mimic.set("joint", joint.find("mimic").get("joint", ""))
    if kind == "planar" and copy.find("axis") is None:  # its default differs
        etree.SubElement(copy, "axis", xyz="0 0 1")
    return copy


def _end(joint: Element, name: str, end: str, links: Container[str]) -> str:
    """Return the link of the one element of an end of a joint."""
    elements = joint.findall(end)
    if len(elements) > 1:
        raise UrdfError(f"joint '{name}' has {len(elements)} <{end}> elements; expected one.")
    link: str | None = elements[0].get("link") if elements else None
    if link is None or link not in links:
        raise UrdfError(f"joint '{name}' has {end} {short(link)}; expected a link of this URDF.")
    return link


def _link(link: Any, element: Element) -> Link:
    """Return the record of a link of yourdfpy."""
    if link.inertial is None:
        return Link(link.name)
    mass = link.inertial.mass
    where = f"link '{link.name}'"
    if mass < 0.0:
        raise UrdfError(f"{where}: mass is {mass:g} kg; expected a number >= 0.")
    placement = placement_of(element.find("inertial").find("origin"), where)
    return Link(link.name, Inertial(mass, placement, link.inertial.inertia))


def _joint(joint: Any, element: Element, armature: Mapping[str, float]) -> Joint:
    """Return the record of a joint of yourdfpy."""
    fields: dict[str, Any] = {}
    for part, names in READ.items():
        for name in names:
            value = getattr(getattr(joint, part), name, None)
            if value is not None:
                fields[name] = float(value)
    if joint.mimic is not None:
        fields["mimic"] = Mimic(joint.mimic.joint, joint.mimic.multiplier, joint.mimic.offset)
    fields["armature"] = armature.get(joint.name, 0.0)
    origin = placement_of(element.find("origin"), f"joint '{joint.name}'")
    return Joint(joint.name, joint.type, joint.parent, joint.child, origin, joint.axis, **fields)


def _copy_numbers(
    element: Element, copy: Element, tags: Mapping[str, Mapping[str, int]], where: str
) -> None:
    """Copy the first child of each tag, with the attributes that hold so many numbers."""
    for tag, attributes in tags.items():
        child = element.find(tag)
        if child is None:
            continue
        target = etree.SubElement(copy, tag)
        for attribute, count in attributes.items():
            text = child.get(attribute)
            if text is not None and (text.strip() or tag != "limit"):
                numbers = numbers_of(child, attribute, count, where, tag == "limit")
                target.set(attribute, " ".join(map(repr, numbers)))


def _root_link(links: Iterable[str], parents: Mapping[str, str]) -> str:
    """Return the one link without a parent, from which all others must be reached.

    `parents` has that of each child.
    """
    roots = [link for link in links if link not in parents]
    if len(roots) > 1:
        shown = listed([f"'{root}'" for root in roots], 6)
        raise UrdfError(
            f"The URDF has {len(roots)} root links ({shown}); expected one: "
            "join them with fixed joints."
        )
    reached = set(roots)
    for link in links:
        path = {link}
        carrier = link
        while carrier not in reached:
            carrier = parents[carrier]
            if carrier in path:
                raise UrdfError(f"link '{carrier}' is part of a loop of joints; {TREE}")
            path.add(carrier)
        reached |= path
    return roots[0]
