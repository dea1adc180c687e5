# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Probable mistakes of a URDF that loads, and warnings."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from difflib import get_close_matches
from typing import Any, NamedTuple

from lxml import etree

from diag_dynamics.description.elements import floats, short
from diag_dynamics.description.inertias import not_physical
from diag_dynamics.description.records import Description
from diag_dynamics.exceptions import InertiaWarning, ModelWarning

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
    "mimic": ("joint", "multiplier", "offset", "polynomial"),
}

CHILDREN: dict[str, tuple[str, ...]] = {  # elements in each element that dynamics and contacts read
    "link": ("inertial", "visual", "collision"),
    "inertial": ("origin", "mass", "inertia"),
    "visual": ("origin",),
    "collision": ("origin",),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
    "origin": (),
}

MISPLACED = (
    "mass",
    "pose",
    "position",
    "orientation",
    "xyz",
    "rpy",
    "axes",
)  # elements of formats or places beside
# Parts of the names of simulators' plugins that couple links or joints, lower case
COUPLING_PLUGINS = ("attach", "coupl", "detach", "gearbox", "loop_joint", "closed_loop", "mimic")
COUPLING_REMEDY = "Describe it by <loop_joint>, loops, <mimic> or payloads."
MIMIC = ("mimicJoint", "mimic_joint")  # elements of such plugins that name a joint with a source
MAX_ANGLE = (
    2.0 * math.pi + 1e-3
)  # largest angle of an origin or a mimic offset [rad]: a full turn, rounded
MAX_MISTAKES = 10  # mistakes that a warning lists


class Remark(NamedTuple):
    """A probable mistake of a "robot", "link" or "joint": its name, the mistake, the cure, and an angle concerned [rad]."""

    kind: str
    name: str
    what: str
    remedy: str
    angle: float | None = None


def remarks_of(robot: Any) -> list[Remark]:
    """Return the probable mistakes of a parsed `<robot>` element, in the file's order."""
    remarks = list(_unknown_attributes(robot, "robot", robot.get("name") or "robot"))
    for element in robot.iterchildren("link", "joint"):
        remarks += _of_element(element, element.tag, element.get("name") or "")
    for joint in robot.iterfind("gazebo/joint"):
        if joint.find("child") is not None:
            what = "<joint> of <gazebo> is ignored: the model is the open tree without it"
            remarks.append(
                Remark("joint", joint.get("name") or "", what, "Forward dynamics lacks its forces.")
            )
    return remarks + list(_couplings_of_plugins(robot))


def _couplings_of_plugins(robot: Any) -> Iterator[Remark]:
    """Yield a simulator's plugins that couple joints or links, but for joints with a <mimic>."""
    mimics = {mimic.getparent().get("name") for mimic in robot.iterfind("joint/mimic")}
    for plugin in robot.iterfind("gazebo//plugin"):
        names = [plugin.get("name") or "", plugin.get("filename") or ""]
        joints = {(element.text or "").strip() for tag in MIMIC for element in plugin.iterfind(tag)}
        is_coupling = any(part in "\n".join(names).lower() for part in COUPLING_PLUGINS)
        if is_coupling and not (joints and joints <= mimics):
            shown = short(next(filter(None, names)))
            mistake = f"plugin {shown} of <gazebo> couples links or joints and is not modelled"
            yield Remark("robot", robot.get("name") or "robot", mistake, COUPLING_REMEDY)
    for parameter in robot.iterfind("ros2_control/joint/param[@name='mimic']"):
        joint = parameter.getparent().get("name") or ""
        if joint not in mimics:
            mistake = "parameter 'mimic' of <ros2_control> is not modelled"
            yield Remark("joint", joint, mistake, "Give the joint a <mimic>.")


def _of_element(element: Any, kind: str, name: str) -> Iterator[Remark]:
    """Yield the mistakes of an element of a link or joint, and of those within."""
    yield from _unknown_attributes(element, kind, name)
    if (
        element.tag == "axis"
        and element.get("xyz") is None
        and element.getparent().get("type") != "fixed"
    ):
        yield Remark(kind, name, "<axis> has no xyz, so the axis is 1 0 0", 'Give <axis xyz="…">.')
    attribute, angle = _angle(element)
    if abs(angle) > MAX_ANGLE:
        what = f"<{element.tag} {attribute}> is beyond 2π"
        yield Remark(kind, name, what, "Is it in degrees? URDF has radians.", angle)
    known = CHILDREN.get(element.tag)
    for part in () if known is None else element.iterchildren(etree.Element):
        if part.tag in known:
            yield from _of_element(part, kind, name)
        elif part.tag in MISPLACED or get_close_matches(part.tag.lower(), known, n=1, cutoff=0.8):
            what = f"<{short(part.tag)[1:-1]}> within <{element.tag}> is ignored"
            yield Remark(kind, name, what, "Is it misspelt or misplaced?")


def _unknown_attributes(element: Any, kind: str, name: str) -> Iterator[Remark]:
    for attribute in element.keys() if element.tag in ATTRIBUTES else ():
        if (
            attribute not in ATTRIBUTES[element.tag]
            and ":" not in attribute
            and "}" not in attribute
        ):
            what = f"<{element.tag}> has the unknown attribute {short(attribute)}, ignored"
            yield Remark(kind, name, what, "Is it misspelt?")


def _angle(element: Any) -> tuple[str, float]:
    """Return the largest angle of an <origin> or of the <mimic> of a joint that turns [rad], and its attribute."""
    turns = element.getparent().get("type") in ("revolute", "continuous")
    if element.tag == "origin":
        return "rpy", max(floats(element.get("rpy"), 3) or [0.0], key=abs)
    offset = floats(element.get("offset"), 1) if element.tag == "mimic" and turns else None
    return "offset", (offset or [0.0])[0]


def warning_of(robot: str, remarks: Iterable[Remark]) -> str:
    """Return the text of one warning about all mistakes; empty without any."""
    groups: dict[tuple[str, str], list[Remark]] = {}
    for remark in remarks:
        groups.setdefault((remark.what, remark.remedy), []).append(remark)
    texts = []
    for (what, remedy), (first, *more) in groups.items():
        named = f"{first.kind} {short(first.name)}" + (f" and {len(more)} more" if more else "")
        angle = "" if first.angle is None else f" ({first.angle:g} rad)"
        texts.append(f"{named}{angle}: {what}. {remedy}")
    if len(texts) > MAX_MISTAKES:
        texts[MAX_MISTAKES:] = [
            f"And {len(texts) - MAX_MISTAKES} more mistakes: diag-dynamics inspect lists them."
        ]
    return (
        f"robot {short(robot)}: the URDF has probable mistakes. {' '.join(texts)}" if texts else ""
    )


def warn_of_inertias(description: Description, ignored: Sequence[str]) -> None:
    """Warn of inertias of no rigid body, but for those of ignored links."""
    for link in description.links.values():
        if link.inertial is None or link.name in ignored:
            continue
        if reason := not_physical(link.inertial.inertia, link.inertial.mass):
            warn(
                f"link '{link.name}' of robot '{description.name}' has an inertia {reason}: "
                "no rigid body is like that.",
                InertiaWarning,
                stacklevel=4,
            )


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
