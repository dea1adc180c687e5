# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Elements of a URDF beside links and joints: numbers, origins, loops and transmissions.

`<loop_joint>` is that of Isaac Sim, `<constraint>` the one proposed to urdfdom_headers (pull
request 108). Elements `<start joint position>` and `<independent joint>` in them belong to this
package.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from lxml import etree

from diag_dynamics import rotations
from diag_dynamics.arrays import Array
from diag_dynamics.description.description import (
    LARGEST_INERTIA,
    SINGLE,
    Loop,
    LoopEnd,
    Remark,
)
from diag_dynamics.exceptions import UrdfError
from diag_dynamics.text import short

Element: TypeAlias = Any
"""Element of lxml, which has no types."""

LARGEST = 1e30  # largest number accepted, of whatever unit: products of a few must not overflow


def floats(text: str | None, count: int, may_be_infinite: bool = False) -> list[float] | None:
    """Return the numbers of a text, None if these are not `count` finite ones."""
    try:
        numbers = [
            float(part) for part in (text or "").split() if part.isascii() and "_" not in part
        ]
    except ValueError:
        return None
    valid = all(
        not math.isnan(number) and (may_be_infinite or math.isfinite(number)) for number in numbers
    )
    return numbers if len(numbers) == count and valid else None


def numbers_of(
    element: Element, attribute: str, count: int, where: str, may_be_infinite: bool = False
) -> list[float]:
    """Return the numbers of an attribute of an element, within ±:data:`LARGEST`.

    `where` is for errors.
    """
    if (text := element.get(attribute)) is None:
        raise UrdfError(f"{where}: <{element.tag}> has no {attribute}.")
    shown = f"{where}: <{element.tag} {attribute}={short(text)}>"
    numbers = floats(text, count, may_be_infinite)
    if numbers is None:
        raise UrdfError(
            f"{shown} is not {f'{count} finite numbers' if count > 1 else 'a finite number'}."
        )
    if not may_be_infinite and any(abs(number) > LARGEST for number in numbers):
        raise UrdfError(f"{shown} is beyond {LARGEST:g}.")
    return numbers


def local_name(element: Element) -> str:
    """Return the tag of an element without namespace or prefix."""
    return str(element.tag).rpartition("}")[2].rpartition(":")[2]


def is_xacro(element: Element) -> bool:
    """Return whether an element is of xacro's namespace or prefix."""
    tag = str(element.tag)
    is_prefixed = element.prefix == "xacro" or tag.startswith("xacro:")
    return is_prefixed or "xacro" in tag.rpartition("}")[0]


def placement_of(element: Element, where: str) -> Array:
    """Return the placement (4, 4) of an `<origin>`, the identity for None.

    The rotation is Rz(yaw) Ry(pitch) Rx(roll), or that of quat_xyzw, which is normalized.
    """
    if element is None:
        return np.eye(4)
    numbers = {
        name: numbers_of(element, name, count, where)
        for name, count in {"xyz": 3, "rpy": 3, "quat_xyzw": 4}.items()
        if element.get(name) is not None
    }
    if "rpy" in numbers and "quat_xyzw" in numbers:
        raise UrdfError(
            f"{where}: <{element.tag}> has rpy and quat_xyzw; expected one of them. "
            "Remove the other."
        )
    turn = np.eye(3)
    if "rpy" in numbers:
        turn = rotations.from_rpy(*numbers["rpy"])
    elif "quat_xyzw" in numbers:
        largest = max(map(abs, numbers["quat_xyzw"]))
        if largest == 0.0:
            shown = f"{where}: <{element.tag} quat_xyzw={short(element.get('quat_xyzw'))}>"
            raise UrdfError(f"{shown} is no rotation; expected a quaternion x y z w of length 1.")
        turn = rotations.from_quaternion(*(x / largest for x in numbers["quat_xyzw"]))
    return rotations.pose(numbers.get("xyz", (0.0, 0.0, 0.0)), turn)


# --- Closed loops


LOOP_KINDS = {
    "spherical": "point",
    "ball": "point",
    "revolute": "revolute",
    "continuous": "revolute",
    "fixed": "weld",
}

# Tags of the link, the frame and the axis at both ends, by element
ENDS = {
    "loop_joint": (("link1", "link1", "axis"), ("link2", "link2", "axis")),
    "constraint": (
        ("parent", "parent_origin", "parent_axis"),
        ("child", "child_origin", "child_axis"),
    ),
}


def loops_of(robot: Element) -> tuple[Loop, ...]:
    """Return the closed loops of a parsed `<robot>` element."""
    elements = [element for tag in ENDS for element in robot.findall(tag)]
    return tuple(_loop(element, f"{element.tag}{k}") for k, element in enumerate(elements))


def _loop(element: Element, name: str) -> Loop:
    shown = (
        f"<{element.tag} name={short(element.get('name'))}>"
        if element.get("name")
        else f"<{element.tag}>"
    )
    kind = element.get("type")
    if kind not in LOOP_KINDS:
        raise UrdfError(
            f"{shown} is not supported: its type is {kind!r}; "
            f"expected one of {', '.join(LOOP_KINDS)}."
        )
    ends = []
    axes = []
    for tag, origin, axis in ENDS[element.tag]:
        link = element.find(tag)
        along = element.find(axis)
        if link is None or link.get("link") is None:
            raise UrdfError(f"{shown} is not supported: it lacks <{tag} link=…>.")
        place = placement_of(element.find(origin), shown)
        numbers = [1.0, 0.0, 0.0] if along is None else numbers_of(along, "xyz", 3, shown)
        axes.append(np.array(numbers))
        if not np.linalg.norm(axes[-1]) > 0.0:
            raise UrdfError(f"{shown}: <{axis}> has no direction.")
        turn = place[:3, :3] @ rotations.frame_about(axes[-1]) @ rotations.frame_about(axes[0]).T
        ends.append(LoopEnd(link.get("link"), tuple(place[:3, 3].tolist()), rotations.to_rpy(turn)))
    start = {
        part.get("joint"): numbers_of(part, "position", 1, shown)[0]
        for part in element.findall("start")
    }
    independent = tuple(part.get("joint") for part in element.findall("independent"))
    first, second = ends
    name = element.get("name", name)
    kind = LOOP_KINDS[kind]
    return Loop(name, first, second, kind, tuple(axes[0].tolist()), independent, start)


# --- Transmissions: rotor inertias reflected to their joints, N²J


# Tags without prefix and underscores, in lower case: <drake:rotor_inertia>, <mechanicalReduction>
ROTOR_INERTIA = ("rotorinertia", "motorinertia")
REDUCTION = ("mechanicalreduction", "gearratio")

JOINTS = ("joint", "flexJoint", "rollJoint")


def driven_joints(robot: Element) -> tuple[str, ...]:
    """Return the joints of transmissions, and those of ros2_control with a command interface."""
    joints = []
    for transmission in robot.iter("transmission"):
        joints += _joints_of(transmission)
    for joint in robot.findall("ros2_control/joint"):
        if joint.find("command_interface") is not None:
            joints.append(joint)
    return tuple(sorted({joint.get("name") or "" for joint in joints}))


def reflected_inertias(robot: Element) -> tuple[dict[str, float], list[Remark]]:
    """Return rotor inertias N²J by joint [kg m²; prismatic: kg], and remarks on what is ignored.

    A transmission has one joint, one rotor and one gear ratio, of 1 if it has none; a joint has one
    transmission with a rotor.
    """
    types = {joint.get("name"): joint.get("type") for joint in robot.findall("joint")}
    armature: dict[str, float] = {}
    remarks = []
    for element in [*robot.findall("transmission"), *robot.findall("ros2_control/transmission")]:
        rotors = _numbers(element, ROTOR_INERTIA)
        if not rotors:
            continue
        names = {joint.get("name") or "" for joint in _joints_of(element)}
        ratios = set(_numbers(element, REDUCTION)) - {1.0}
        joint = min(names, default="")
        N = min(ratios, default=1.0)
        inertia = N * N * rotors[0]
        is_single = len(names) == len(rotors) == 1 and len(ratios) <= 1
        is_free = types.get(joint) in SINGLE and joint not in armature
        if is_single and is_free and N and 0.0 <= inertia <= LARGEST_INERTIA:
            armature[joint] = inertia
        else:
            where = f"transmission {short(element.get('name'))}"
            remarks.append(Remark("ignored rotor", words=(where,)))
    return armature, remarks


def _joints_of(transmission: Element) -> list[Element]:
    return [child for child in transmission.iterchildren() if local_name(child) in JOINTS]


def _numbers(transmission: Element, tags: tuple[str, ...]) -> list[float]:
    """Return the numbers, text or value, of elements with one of the tags; NaN of other texts."""
    numbers = []
    for element in transmission.iterdescendants(etree.Element):
        if local_name(element).replace("_", "").lower() in tags:
            text = element.get("value") or element.text
            numbers += floats(text, 1) or [math.nan]
    return numbers
