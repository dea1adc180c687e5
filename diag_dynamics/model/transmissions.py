# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rotor inertias that the `<transmission>` elements of a URDF give, reflected to their joints: N²J."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from diag_dynamics.exceptions import UrdfError
from diag_dynamics.model.joint_types import SINGLE
from diag_dynamics.model.options import LARGEST
from diag_dynamics.model.origins import local_name, short
from diag_dynamics.model.remarks import Remark

ROTOR = ("rotorinertia", "motorinertia")
"""Names of a rotor inertia, in lower case without underscores: <drake:rotor_inertia>, <rotorInertia>."""

REDUCTION = ("mechanicalreduction", "gearratio", "reduction")
"""Names of a reduction: <mechanicalReduction> of ROS 1, <mechanical_reduction> of ROS 2, <drake:gear_ratio>."""

ACTUATORS = ("actuator", "leftActuator", "rightActuator")
JOINTS = ("joint", "flexJoint", "rollJoint")


class Rotor(NamedTuple):
    """Rotor inertia J [kg m²] and reduction N of an actuator."""

    inertia: float
    reduction: float


def reflected_inertias(robot: Any) -> tuple[dict[str, float], list[Remark]]:
    """Return N²J [kg m², prismatic: kg] of each joint whose transmission gives a rotor inertia, and remarks on the rest.

    Rotors of several actuators of one joint add up. An actuator that several transmissions name counts once.
    """
    types = {joint.get("name"): joint.get("type") for joint in robot.findall("joint")}
    rotors: dict[str, dict[str, Rotor]] = {}
    remarks = []
    for number, transmission in enumerate(
        [*robot.findall("transmission"), *robot.findall("ros2_control/transmission")]
    ):
        where = f"transmission {short(transmission.get('name'))}"
        joints = _joints(transmission)
        parts = [element for element in transmission.iterchildren() if local_name(element) in (*ACTUATORS, *JOINTS)]
        if not any(_entries_of([transmission, *parts], ROTOR)):
            continue
        for joint in joints:
            if joint not in types:
                raise UrdfError(f"{where}: joint {short(joint)} is not a joint of this URDF.")
        reason = "it does not drive one joint" if len(joints) != 1 else ""
        if not reason and types[joints[0]] not in SINGLE:
            reason = f"the joint is {types[joints[0]]}"
        actuators = [element for element in parts if local_name(element) in ACTUATORS]
        if not reason and len(actuators) > 1 and any(_entries_of(_beside_actuators(transmission), ROTOR)):
            reason = "it is that of none of its actuators"
        if reason:
            what = f"the rotor inertia of {where} is ignored: {reason}"
            places = [("joint", joint) for joint in joints] or [("robot", robot.get("name") or "robot")]
            remarks += [Remark(*place, what, "Give load_urdf the armature of each joint.") for place in places]
            continue
        found = dict(_rotors(transmission, where, f"transmission {number}"))
        known = rotors.setdefault(joints[0], {})
        for actuator, rotor in found.items():
            if known.setdefault(actuator, rotor) != rotor:
                raise UrdfError(
                    f"{where}: {actuator} has another rotor inertia or reduction in an earlier transmission."
                )
    armature = {
        joint: sum(rotor.reduction * rotor.reduction * rotor.inertia for rotor in of_joint.values())
        for joint, of_joint in rotors.items()
    }
    for joint, value in armature.items():
        if not value <= LARGEST:
            raise UrdfError(f"joint '{joint}': reflected rotor inertia {value:g} is beyond {LARGEST:g}.")
    return armature, remarks


def _joints(transmission: Any) -> list[str]:
    """Names of the joints that a transmission drives."""
    elements = (element for element in transmission.iterchildren() if local_name(element) in JOINTS)
    return list(dict.fromkeys(element.get("name") or "" for element in elements))


def _beside_actuators(transmission: Any) -> list[Any]:
    """The transmission and its joints, whose numbers belong to all actuators."""
    return [transmission, *(element for element in transmission.iterchildren() if local_name(element) in JOINTS)]


def _entries_of(elements: Iterable[Any], names: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    return (entry for element in elements for entry in _entries(element, names))


def _rotors(transmission: Any, where: str, unnamed: str) -> Iterator[tuple[str, Rotor]]:
    """Name of each actuator of a transmission that has a rotor inertia, and its rotor."""
    children = list(transmission.iterchildren())
    actuators = [element for element in children if local_name(element) in ACTUATORS]
    shared = _beside_actuators(transmission)
    for actuator in actuators or [None]:
        elements = shared if actuator is None else [actuator, *(shared if len(actuators) == 1 else ())]
        inertia = _number(elements, ROTOR, where, "a finite number >= 0 [kg m²]", lambda value: value >= 0.0)
        if inertia is None:
            continue
        elements = shared if actuator is None else [actuator, *shared]
        reduction = _number(elements, REDUCTION, where, "a finite number other than 0", lambda value: value != 0.0)
        name = None if actuator is None else actuator.get("name")
        yield (f"actuator '{name}'" if name else unnamed), Rotor(inertia, 1.0 if reduction is None else reduction)


def _number(elements: Iterable[Any], names: tuple[str, ...], where: str, expected: str, is_valid: Any) -> float | None:
    """The one size of a number that elements give under one of some names; reductions of 1 give way to others."""
    given: dict[float, str] = {}
    for tag, text in _entries_of(elements, names):
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and is_valid(value)):
            raise UrdfError(f"{where}: <{tag}> is {short(text)}; expected {expected}.")
        given.setdefault(abs(value), tag)
    if names is REDUCTION and len(given) > 1:
        given.pop(1.0, None)
    if len(given) > 1:
        listed = ", ".join(f"<{tag}> {value:g}" for value, tag in given.items())
        raise UrdfError(f"{where}: {listed} contradict each other; expected one number.")
    return next(iter(given), None)


def _entries(element: Any, names: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Name and text of the numbers of an element: attributes, elements with text or a value, and <param>."""
    for attribute, text in element.items():
        if _plain(attribute) in names:
            yield attribute, text
    for child in element.iterchildren():
        tag = child.get("name", "") if local_name(child) == "param" else local_name(child)
        if _plain(tag) in names:
            yield tag, child.get("value") or child.text or ""


def _plain(name: str) -> str:
    return name.rpartition("}")[2].rpartition(":")[2].replace("_", "").lower()
