# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rotor inertias that the `<transmission>` elements of a URDF give, reflected to their joints: N²J."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

from diag_dynamics.description.elements import floats, local_name, short
from diag_dynamics.description.inertias import LARGEST
from diag_dynamics.description.records import SINGLE
from diag_dynamics.description.remarks import Remark
from diag_dynamics.exceptions import UrdfError

# Names without prefix and underscores, in lower case: <drake:rotor_inertia>, <mechanicalReduction>,
# <drake:gear_ratio>
INERTIA = ("rotorinertia", "motorinertia")
REDUCTION = ("mechanicalreduction", "gearratio", "reduction")

ACTUATORS = ("actuator", "leftActuator", "rightActuator")
JOINTS = ("joint", "flexJoint", "rollJoint")


def driven_joints(robot: Any) -> tuple[str, ...]:
    """Return the joints of transmissions, and those of ros2_control with a command interface."""
    joints = []
    for transmission in robot.iter("transmission"):
        joints += [child for child in transmission.iterchildren() if local_name(child) in JOINTS]
    for joint in robot.findall("ros2_control/joint"):
        if joint.find("command_interface") is not None:
            joints.append(joint)
    return tuple(sorted({joint.get("name") or "" for joint in joints}))


def reflected_inertias(robot: Any) -> tuple[dict[str, float], list[Remark]]:
    """Return N²J [kg m², prismatic: kg] by joint, the sum over its actuators, and remarks on what is ignored."""
    types = {joint.get("name"): joint.get("type") for joint in robot.findall("joint")}
    rotors: dict[str, dict[str, float]] = {}  # N²J by actuator, by joint
    remarks = []
    for number, element in enumerate(
        [*robot.findall("transmission"), *robot.findall("ros2_control/transmission")]
    ):
        where = f"transmission {short(element.get('name'))}"
        actuators, joints = (
            [child for child in element.iterchildren() if local_name(child) in tags]
            for tags in (ACTUATORS, JOINTS)
        )
        shared = [element, *joints]  # numbers of these belong to all actuators
        if not any(_entries([*shared, *actuators], INERTIA)):
            continue
        names = list(dict.fromkeys(joint.get("name") or "" for joint in joints))
        for name in names:
            if name not in types:
                raise UrdfError(f"{where}: joint {short(name)} is not a joint of this URDF.")
        is_of_all = len(actuators) > 1 and any(_entries(shared, INERTIA))
        if len(names) != 1 or types[names[0]] not in SINGLE or is_of_all:
            name = robot.get("name") or "robot"
            remarks.append(Remark("ignored rotor", "robot", name, (where,)))
            continue
        actuated = rotors.setdefault(names[0], {})
        for actuator in actuators or [element]:
            J = _number([actuator, *shared], INERTIA, where)
            N = _number([actuator, *shared], REDUCTION, where) or 1.0
            name = actuator.get("name") if actuators else None
            if J is not None and actuated.setdefault(name or str(number), N * N * J) != N * N * J:
                text = f"{where}: actuator {short(name)} has another rotor inertia in an earlier transmission."
                raise UrdfError(text)
    armature = {joint: sum(own.values()) for joint, own in rotors.items()}
    for joint, value in armature.items():
        if not value <= LARGEST:
            raise UrdfError(
                f"joint '{joint}': reflected rotor inertia {value:g} is beyond {LARGEST:g}."
            )
    return armature, remarks


def _number(elements: Iterable[Any], names: tuple[str, ...], where: str) -> float | None:
    """Return the one size of a number that elements give under some names.

    A reduction of 1 gives way to another.
    """
    is_inertia, values = names is INERTIA, {}
    for tag, text in _entries(elements, names):
        value = (floats(text, 1) or [math.nan])[0]
        if not (value >= 0.0 if is_inertia else abs(value) > 0.0):
            expected = (
                "a finite number >= 0 [kg m²]" if is_inertia else "a finite number other than 0"
            )
            raise UrdfError(f"{where}: <{tag}> is {short(text)}; expected {expected}.")
        values[abs(value)] = tag
    if len(values) > 1 and not is_inertia:
        values.pop(1.0, None)
    if len(values) > 1:
        listed = ", ".join(f"<{tag}> {value:g}" for value, tag in values.items())
        raise UrdfError(f"{where}: {listed} contradict each other; expected one number.")
    return next(iter(values), None)


def _entries(elements: Iterable[Any], names: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Yield name and text of numbers: attributes of elements, and children with text or a value, <param> included."""
    for element in elements:
        entries = list(element.items())
        for child in element:
            tag = child.get("name", "") if local_name(child) == "param" else local_name(child)
            entries.append((tag, child.get("value") or child.text or ""))
        for tag, text in entries:
            if tag.rpartition("}")[2].rpartition(":")[2].replace("_", "").lower() in names:
                yield tag, text
