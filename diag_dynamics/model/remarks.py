# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Probable mistakes of a URDF that loads: attributes that no reader evaluates, and values that readers take differently."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from difflib import get_close_matches
from typing import Any, NamedTuple

from lxml import etree

from diag_dynamics.model.origins import floats, local_name, short

VERSIONS = ("1.0", "1.1", "1.2")
"""Versions of URDF."""

ATTRIBUTES: dict[str, tuple[str, ...]] = {
    "robot": ("name", "version"),
    "link": ("name", "type"),
    "inertial": (),
    "origin": ("xyz", "rpy", "quat_xyzw"),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "joint": ("name", "type"),
    "parent": ("link",),
    "child": ("link",),
    "axis": ("xyz",),
    "limit": ("lower", "upper", "effort", "velocity", "acceleration", "deceleration", "jerk"),
    "dynamics": ("damping", "friction"),
    "mimic": ("joint", "multiplier", "offset"),
}
"""Attributes of each element that dynamics reads; those with a prefix are free."""

OF_JOINT = ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic")
"""Elements of a joint that dynamics reads."""

OF_INERTIAL = ("origin", "mass", "inertia")
"""Elements of an inertial that dynamics reads."""

FOREIGN = {
    "pose": "origin",
    "position": "origin",
    "orientation": "origin",
    "axes": "axis",
    "xyz": "origin",
    "rpy": "origin",
}
"""Elements of other formats, and what URDF has instead."""

HARMLESS: dict[str, tuple[str, ...]] = {
    "joint": ("dont_collapse",),
    "limit": ("command_effort", "current", "gear_velocity"),
    "dynamics": ("D", "K", "mu_coulomb", "mu_viscous"),
}
"""Attributes that manufacturers (Unitree, ANYbotics, Franka) add for their own tools."""

FORCES = ("linear_bushing_rpy", "linear_spring_damper")
"""Elements of Drake that exert forces between links."""

ROTOR = ("armature", "rotor_inertia", "motor_inertia")
"""Attributes of <dynamics> by which some simulators give the rotor inertia."""

ANGLE = 2.0 * math.pi + 1e-3
"""Largest angle of an origin or a mimic offset [rad]: a full turn, rounded."""

TURNS = 20.0
"""Limit of revolute joints [rad]: three turns, which cables allow; the same number in degrees is no range of a joint."""

PLACEHOLDER = 1000.0
"""Limit of revolute joints [rad] that stands for none, in no unit."""

LENGTH = 1e-2
"""Difference of a quaternion's length from 1 beyond rounding."""

MOST_NAMES = 4
"""Names that a warning lists of one mistake."""

MOST = 10
"""Mistakes that a warning lists."""


class Remark(NamedTuple):
    """A probable mistake of a "robot", "link" or "joint": its name, the mistake and the cure.

    `value` is the number concerned, in `unit`. A harmless one is an addition of a manufacturer that dynamics ignores.
    """

    kind: str
    name: str
    what: str
    remedy: str
    value: float | None = None
    unit: str = ""
    harmless: bool = False


def remarks_of(robot: Any) -> list[Remark]:
    """Probable mistakes of a parsed `<robot>` element, in the file's order."""
    remarks = [*_unknown(robot, "robot", robot.get("name") or "robot"), *_version(robot)]
    for link in robot.findall("link"):
        remarks += _of_link(link, link.get("name") or "")
    for joint in robot.findall("joint"):
        remarks += _of_joint(joint, joint.get("name") or "")
    for joint in robot.iterfind("gazebo/joint"):
        if joint.find("child") is not None:
            what = "<joint> of <gazebo> is ignored: the model is the open tree without it"
            remarks.append(
                Remark("joint", joint.get("name") or "", what, "Forward dynamics lacks its constraint forces.")
            )
    for element in robot.iterchildren(etree.Element):
        if local_name(element) in FORCES:
            what = f"<{short(local_name(element))[1:-1]}> is ignored: forward dynamics lacks its forces"
            remarks.append(Remark("robot", robot.get("name") or "robot", what, "Give them as f_ext or tau."))
    if (robot.get("version") or "1.0").strip() == "1.0" and _has_quaternion(robot):
        what = "quat_xyzw in a URDF of version 1.0: read here, ignored by urdfdom"
        remarks.append(Remark("robot", robot.get("name") or "robot", what, 'Give <robot version="1.1">.'))
    return remarks


def limits_in_degrees(robot: Any) -> list[Remark]:
    """Position limits of revolute joints beyond three turns; inspect has a check of limits instead."""
    remarks = []
    for joint in robot.iterfind("joint[@type='revolute']"):
        limit = joint.find("limit")
        values = [] if limit is None else [floats(limit.get(name), 1) or [0.0] for name in ("lower", "upper")]
        largest = max((value for (value,) in values), key=abs, default=0.0)
        if TURNS < abs(largest) < PLACEHOLDER:
            what, remedy = "<limit> is beyond three turns", "Is it in degrees? URDF has radians."
            remarks.append(Remark("joint", joint.get("name") or "", what, remedy, largest, "rad"))
    return remarks


def _has_quaternion(robot: Any) -> bool:
    places = ("joint/origin", "link/*/origin")
    return any(robot.find(f"{place}[@quat_xyzw]") is not None for place in places)


def warning_of(robot: str, remarks: Iterable[Remark]) -> str:
    """Text of one warning about all mistakes; empty without any."""
    groups: dict[tuple[str, str, str], list[Remark]] = {}
    for remark in remarks:
        if not remark.harmless:
            groups.setdefault((remark.kind, remark.what, remark.remedy), []).append(remark)
    if not groups:
        return ""
    texts = [f"{_named(kind, group)}: {what}. {remedy}" for (kind, what, remedy), group in groups.items()]
    if len(texts) > MOST:
        texts[MOST:] = [f"And {len(texts) - MOST} more mistakes: diag-dynamics inspect lists them."]
    return f"robot {short(robot)}: the URDF has probable mistakes. {' '.join(texts)}"


def _named(kind: str, group: list[Remark]) -> str:
    """Names of links or joints, with their numbers."""
    names = [
        short(one.name) + ("" if one.value is None else f" ({one.value:g} {one.unit})".replace(" 1)", ")"))
        for one in group[:MOST_NAMES]
    ]
    more = f" and {len(group) - MOST_NAMES} more" if len(group) > MOST_NAMES else ""
    return f"{kind}{'s' if len(group) > 1 else ''} {', '.join(names)}{more}"


def _version(robot: Any) -> Iterator[Remark]:
    version = robot.get("version")
    if version is not None and version.strip() not in VERSIONS:
        what = f"<robot version={short(version)}> is unknown"
        remedy = f"Known versions are {', '.join(VERSIONS)}."
        yield Remark("robot", robot.get("name") or "robot", what, remedy)


def _of_link(link: Any, name: str) -> Iterator[Remark]:
    yield from _unknown(link, "link", name)
    for tag in ("mass", "inertia"):
        if link.find(tag) is not None:
            yield Remark("link", name, f"<{tag}> outside of <inertial> is ignored", "Move it into <inertial>.")
    for part in link:
        yield from _misspelt(part, "link", name, ("inertial",))
    for inertial in link.findall("inertial"):
        yield from _unknown(inertial, "link", name)
        for part in inertial:
            yield from _unknown(part, "link", name)
            yield from _misspelt(part, "link", name, OF_INERTIAL)
    for origin in link.iterfind("*/origin"):
        yield from _angles(origin, "link", name)
        yield from _of_origin(origin, "link", name)


def _of_joint(joint: Any, name: str) -> Iterator[Remark]:
    yield from _unknown(joint, "joint", name)
    for part in joint:
        yield from _unknown(part, "joint", name)
        yield from _misspelt(part, "joint", name, OF_JOINT)
    for origin in joint.findall("origin"):
        yield from _angles(origin, "joint", name)
        yield from _of_origin(origin, "joint", name)
    axis, mimic = joint.find("axis"), joint.find("mimic")
    if axis is not None and axis.get("xyz") is None and joint.get("type") not in ("fixed", "floating"):
        yield Remark("joint", name, "<axis> has no xyz, so the axis is 1 0 0", 'Give <axis xyz="…">.')
    offset = None if mimic is None else floats(mimic.get("offset"), 1)
    if offset and abs(offset[0]) > ANGLE and joint.get("type") in ("revolute", "continuous"):
        what = "<mimic offset> is beyond 2π"
        yield Remark("joint", name, what, "Is it in degrees? URDF has radians.", offset[0], "rad")


def _unknown(element: Any, kind: str, name: str) -> Iterator[Remark]:
    """Attributes that the element has and URDF has not."""
    tag = element.tag if isinstance(element.tag, str) else ""
    for attribute in element.keys() if tag in ATTRIBUTES else ():
        if attribute in ATTRIBUTES[tag] or ":" in attribute or "}" in attribute:
            continue
        remedy = "Is it misspelt?"
        if tag == "dynamics" and attribute in ROTOR:
            remedy = "Give it to load_urdf as armature, or in a <transmission>."
        harmless = attribute in HARMLESS.get(tag, ()) or _says_nothing(element, attribute)
        yield Remark(
            kind, name, f"<{tag}> has the unknown attribute {short(attribute)}, ignored", remedy, harmless=harmless
        )


def _says_nothing(element: Any, attribute: str) -> bool:
    """Whether an attribute repeats another one: iyx = ixy; or turns an axis by nothing."""
    own = floats(element.get(attribute), 3 if attribute == "rpy" else 1)
    if element.tag == "inertia":
        return own is not None and own == floats(element.get(f"i{attribute[:0:-1]}"), 1)
    return element.tag == "axis" and attribute == "rpy" and own == [0.0, 0.0, 0.0]


def _misspelt(part: Any, kind: str, name: str, known: tuple[str, ...]) -> Iterator[Remark]:
    """An element that is nearly one that dynamics reads, such as <limits>."""
    tag = part.tag if isinstance(part.tag, str) else ""
    near = get_close_matches(tag.lower(), known, n=1, cutoff=0.8)
    if FOREIGN.get(tag) in known:
        near = [FOREIGN[tag]]
    if tag not in ATTRIBUTES and near:
        yield Remark(kind, name, f"<{short(tag)[1:-1]}> is no element of URDF, ignored", f"Is <{near[0]}> meant?")


def _of_origin(origin: Any, kind: str, name: str) -> Iterator[Remark]:
    """Elements within an origin, whose numbers are attributes in URDF."""
    for part in origin.iterchildren(etree.Element):
        what = f"<{short(local_name(part))[1:-1]}> within <origin> is ignored"
        yield Remark(kind, name, what, 'Give <origin xyz="…" rpy="…">.')


def _angles(origin: Any, kind: str, name: str) -> Iterator[Remark]:
    angles = floats(origin.get("rpy"), 3) or [0.0]
    largest = max(angles, key=abs)
    if abs(largest) > ANGLE:
        what = "<origin rpy> has an angle beyond 2π"
        yield Remark(kind, name, what, "Is it in degrees? URDF has radians.", largest, "rad")
    quaternion = floats(origin.get("quat_xyzw"), 4)
    length = math.hypot(*quaternion) if quaternion else 1.0
    if abs(length - 1.0) > LENGTH:
        what = "<origin quat_xyzw> is not of length 1, and is normalized"
        yield Remark(kind, name, what, "Is it x y z w?", length, "1")
