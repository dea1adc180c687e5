# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rotor inertias of the `<transmission>` elements of a URDF, reflected to their joints: N²J."""

from __future__ import annotations

from typing import Any

from lxml import etree

from diag_dynamics.description.checks import Remark
from diag_dynamics.description.elements import floats, local_name, short
from diag_dynamics.description.inertias import LARGEST
from diag_dynamics.description.records import SINGLE
from diag_dynamics.exceptions import UrdfError

# Tags without prefix and underscores, in lower case: <drake:rotor_inertia>, <mechanicalReduction>
INERTIA = ("rotorinertia", "motorinertia")
REDUCTION = ("mechanicalreduction", "gearratio")

JOINTS = ("joint", "flexJoint", "rollJoint")


def driven_joints(robot: Any) -> tuple[str, ...]:
    """Return the joints of transmissions, and those of ros2_control with a command interface."""
    joints = []
    for transmission in robot.iter("transmission"):
        joints += _joints_of(transmission)
    for joint in robot.findall("ros2_control/joint"):
        if joint.find("command_interface") is not None:
            joints.append(joint)
    return tuple(sorted({joint.get("name") or "" for joint in joints}))


def reflected_inertias(robot: Any) -> tuple[dict[str, float], list[Remark]]:
    """Return N²J [kg m², prismatic: kg] by joint, and remarks on what is ignored.

    A transmission has one joint, one rotor and one gear ratio, of 1 if it has none; a joint has one
    transmission with a rotor.
    """
    types = {joint.get("name"): joint.get("type") for joint in robot.findall("joint")}
    armature: dict[str, float] = {}
    remarks = []
    for element in [*robot.findall("transmission"), *robot.findall("ros2_control/transmission")]:
        where = f"transmission {short(element.get('name'))}"
        names = {joint.get("name") or "" for joint in _joints_of(element)}
        rotors = _sizes(element, INERTIA, where)
        if not rotors:
            continue
        ratios = set(_sizes(element, REDUCTION, where)) - {1.0}
        for name in names:
            if name not in types:
                raise UrdfError(f"{where}: joint {short(name)} is not a joint of this URDF.")
        joint = min(names, default="")
        is_single = len(names) == len(rotors) == 1 and types[joint] in SINGLE
        if not is_single or len(ratios) > 1 or joint in armature:
            remarks.append(Remark("ignored rotor", words=(where,)))
            continue
        N = min(ratios, default=1.0)
        armature[joint] = N * N * rotors[0]
        if not armature[joint] <= LARGEST:
            raise UrdfError(
                f"joint '{joint}': reflected rotor inertia {armature[joint]:g} is beyond "
                f"{LARGEST:g}."
            )
    return armature, remarks


def _joints_of(transmission: Any) -> list[Any]:
    return [child for child in transmission.iterchildren() if local_name(child) in JOINTS]


def _sizes(transmission: Any, tags: tuple[str, ...], where: str) -> list[float]:
    """Return the sizes of the numbers, text or value, of elements with one of the tags."""
    sizes = []
    for element in transmission.iterdescendants(etree.Element):
        tag = local_name(element)
        if tag.replace("_", "").lower() not in tags:
            continue
        text = element.get("value") or element.text or ""
        number = (floats(text, 1) or [float("nan")])[0]
        is_valid, expected = number >= 0.0, ">= 0 [kg m²]"
        if tags is REDUCTION:
            is_valid, expected = abs(number) > 0.0, "other than 0"
        if not is_valid:
            shown = f"{where}: <{tag}> is {short(text)}"
            raise UrdfError(f"{shown}; expected a finite number {expected}.")
        sizes.append(abs(number))
    return sizes
