# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Probable mistakes of a URDF that loads: attributes that no reader evaluates, and values that readers take differently."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from difflib import get_close_matches
from typing import Any, NamedTuple

from lxml import etree

from diag_dynamics.exceptions import ModelWarning
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

CHILDREN = {
    "link": ("inertial",),
    "inertial": ("origin", "mass", "inertia"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
}
"""Elements in each element that dynamics reads."""

FOREIGN = dict.fromkeys(("pose", "position", "orientation", "xyz", "rpy"), "origin") | {"axes": "axis"}
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

MAX_ANGLE = 2.0 * math.pi + 1e-3
"""Largest angle of an origin or a mimic offset [rad]: a full turn, rounded."""

TURNS = 20.0
"""Limit of revolute joints [rad]: three turns, which cables allow; the same number in degrees is no range of a joint."""

PLACEHOLDER = 1000.0
"""Limit of revolute joints [rad] that stands for none, in no unit."""

LENGTH = 1e-2
"""Difference of a quaternion's length from 1 beyond rounding."""

MAX_NAMES, MAX_MISTAKES = 4, 10
"""Names that a warning lists of one mistake, and mistakes that it lists."""

DEGREES = "Is it in degrees? URDF has radians."


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
    """Return the probable mistakes of a parsed `<robot>` element, in the file's order."""
    return list(_remarks(robot))


def _remarks(robot: Any) -> Iterator[Remark]:
    name = robot.get("name") or "robot"
    yield from _unknown(robot, "robot", name)
    version = robot.get("version")
    if version is not None and version.strip() not in VERSIONS:
        known = f"Known versions are {', '.join(VERSIONS)}."
        yield Remark("robot", name, f"<robot version={short(version)}> is unknown", known)
    for link in robot.findall("link"):
        yield from _of_link(link, link.get("name") or "")
    for joint in robot.findall("joint"):
        yield from _of_joint(joint, joint.get("name") or "")
    for joint in robot.iterfind("gazebo/joint"):
        if joint.find("child") is not None:
            what = "<joint> of <gazebo> is ignored: the model is the open tree without it"
            yield Remark("joint", joint.get("name") or "", what, "Forward dynamics lacks its constraint forces.")
    for element in robot.iterchildren(etree.Element):
        if local_name(element) in FORCES:
            what = f"<{short(local_name(element))[1:-1]}> is ignored: forward dynamics lacks its forces"
            yield Remark("robot", name, what, "Give them as f_ext or tau.")
    quaternions = (robot.find(f"{place}/origin[@quat_xyzw]") for place in ("joint", "link/*"))
    if (version or "1.0").strip() == "1.0" and any(origin is not None for origin in quaternions):
        what = "quat_xyzw in a URDF of version 1.0: read here, ignored by urdfdom"
        yield Remark("robot", name, what, 'Give <robot version="1.1">.')


def limits_in_degrees(robot: Any) -> list[Remark]:
    """Return the position limits of revolute joints beyond three turns; inspect has a check of limits instead."""
    remarks = []
    for joint in robot.iterfind("joint[@type='revolute']"):
        limit = joint.find("limit")
        values = [] if limit is None else [floats(limit.get(name), 1) or [0.0] for name in ("lower", "upper")]
        largest = max((value for (value,) in values), key=abs, default=0.0)
        if TURNS < abs(largest) < PLACEHOLDER:
            what = "<limit> is beyond three turns"
            remarks.append(Remark("joint", joint.get("name") or "", what, DEGREES, largest, "rad"))
    return remarks


def _of_link(link: Any, name: str) -> Iterator[Remark]:
    yield from _unknown(link, "link", name)
    for tag in ("mass", "inertia"):
        if link.find(tag) is not None:
            yield Remark("link", name, f"<{tag}> outside of <inertial> is ignored", "Move it into <inertial>.")
    for part in link:
        yield from _misspelt(part, "link", name)
    for inertial in link.findall("inertial"):
        yield from _unknown(inertial, "link", name)
        for part in inertial:
            yield from _unknown(part, "link", name)
            yield from _misspelt(part, "link", name)
    for origin in link.iterfind("*/origin"):
        yield from _of_origin(origin, "link", name)


def _of_joint(joint: Any, name: str) -> Iterator[Remark]:
    yield from _unknown(joint, "joint", name)
    for part in joint:
        yield from _unknown(part, "joint", name)
        yield from _misspelt(part, "joint", name)
    for origin in joint.findall("origin"):
        yield from _of_origin(origin, "joint", name)
    axis, mimic = joint.find("axis"), joint.find("mimic")
    if axis is not None and axis.get("xyz") is None and joint.get("type") not in ("fixed", "floating"):
        yield Remark("joint", name, "<axis> has no xyz, so the axis is 1 0 0", 'Give <axis xyz="…">.')
    offset = None if mimic is None else floats(mimic.get("offset"), 1)
    if offset and abs(offset[0]) > MAX_ANGLE and joint.get("type") in ("revolute", "continuous"):
        yield Remark("joint", name, "<mimic offset> is beyond 2π", DEGREES, offset[0], "rad")


def _unknown(element: Any, kind: str, name: str) -> Iterator[Remark]:
    """Yield the attributes that the element has and URDF has not."""
    tag = element.tag if isinstance(element.tag, str) else ""
    for attribute in element.keys() if tag in ATTRIBUTES else ():
        if attribute in ATTRIBUTES[tag] or ":" in attribute or "}" in attribute:
            continue
        is_rotor = tag == "dynamics" and attribute in ROTOR
        remedy = "Give it to load_urdf as armature, or in a <transmission>." if is_rotor else "Is it misspelt?"
        what = f"<{tag}> has the unknown attribute {short(attribute)}, ignored"
        harmless = attribute in HARMLESS.get(tag, ()) or _is_redundant(element, attribute)
        yield Remark(kind, name, what, remedy, harmless=harmless)


def _is_redundant(element: Any, attribute: str) -> bool:
    """Return whether an attribute repeats another one: iyx = ixy; or turns an axis by nothing."""
    own = floats(element.get(attribute), 3 if attribute == "rpy" else 1)
    if element.tag == "inertia":
        return own is not None and own == floats(element.get(f"i{attribute[:0:-1]}"), 1)
    return element.tag == "axis" and attribute == "rpy" and own == [0.0, 0.0, 0.0]


def _misspelt(part: Any, kind: str, name: str) -> Iterator[Remark]:
    """Yield an element that is nearly one that dynamics reads there, such as <limits>."""
    tag, known = part.tag if isinstance(part.tag, str) else "", CHILDREN[part.getparent().tag]
    near = get_close_matches(tag.lower(), known, n=1, cutoff=0.8)
    if FOREIGN.get(tag) in known:
        near = [FOREIGN[tag]]
    if tag not in ATTRIBUTES and near:
        yield Remark(kind, name, f"<{short(tag)[1:-1]}> is no element of URDF, ignored", f"Is <{near[0]}> meant?")


def _of_origin(origin: Any, kind: str, name: str) -> Iterator[Remark]:
    largest = max(floats(origin.get("rpy"), 3) or [0.0], key=abs)
    if abs(largest) > MAX_ANGLE:
        yield Remark(kind, name, "<origin rpy> has an angle beyond 2π", DEGREES, largest, "rad")
    quaternion = floats(origin.get("quat_xyzw"), 4)
    length = math.hypot(*quaternion) if quaternion else 1.0
    if abs(length - 1.0) > LENGTH:
        what = "<origin quat_xyzw> is not of length 1, and is normalized"
        yield Remark(kind, name, what, "Is it x y z w?", length, "1")
    for part in origin.iterchildren(etree.Element):  # numbers are attributes in URDF
        what = f"<{short(local_name(part))[1:-1]}> within <origin> is ignored"
        yield Remark(kind, name, what, 'Give <origin xyz="…" rpy="…">.')


# --- Warnings


def warning_of(robot: str, remarks: Iterable[Remark]) -> str:
    """Return the text of one warning about all mistakes; empty without any."""
    groups: dict[tuple[str, str, str], list[Remark]] = {}
    for remark in remarks:
        if not remark.harmless:
            groups.setdefault((remark.kind, remark.what, remark.remedy), []).append(remark)
    texts = [f"{_named(kind, group)}: {what}. {remedy}" for (kind, what, remedy), group in groups.items()]
    if len(texts) > MAX_MISTAKES:
        texts[MAX_MISTAKES:] = [f"And {len(texts) - MAX_MISTAKES} more mistakes: diag-dynamics inspect lists them."]
    return f"robot {short(robot)}: the URDF has probable mistakes. {' '.join(texts)}" if texts else ""


def _named(kind: str, group: list[Remark]) -> str:
    """Return the names of links or joints, with their numbers."""
    names = [
        short(one.name) + ("" if one.value is None else f" ({one.value:g} {one.unit})".replace(" 1)", ")"))
        for one in group[:MAX_NAMES]
    ]
    more = f" and {len(group) - MAX_NAMES} more" if len(group) > MAX_NAMES else ""
    return f"{kind}{'s' if len(group) > 1 else ''} {', '.join(names)}{more}"


_handler: ContextVar[Callable[[str], object] | None] = ContextVar("handler", default=None)


@contextmanager
def handle_warnings(handler: Callable[[str], object]) -> Iterator[None]:
    """Call `handler` with the text of each ModelWarning in this context; Python's warnings are shared by threads."""
    token = _handler.set(handler)
    try:
        yield
    finally:
        _handler.reset(token)


def warn(text: str, category: type[ModelWarning] = ModelWarning, stacklevel: int = 3) -> None:
    """Warn of a robot's file by the function of :func:`handle_warnings`, or by Python's own warning."""
    if handler := _handler.get():
        handler(text)
    else:
        warnings.warn(text, category, stacklevel=stacklevel)
