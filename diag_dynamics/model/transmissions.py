# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rotor inertias that the `<transmission>` elements of a URDF give, reflected to their joints: N²J."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

from diag_dynamics.exceptions import UrdfError
from diag_dynamics.model.inertias import LARGEST
from diag_dynamics.model.joint_types import SINGLE
from diag_dynamics.model.origins import local_name, short
from diag_dynamics.model.remarks import Remark

INERTIA = ("rotorinertia", "motorinertia")
"""Names of a rotor inertia, in lower case without underscores: <drake:rotor_inertia>, <rotorInertia>."""

REDUCTION = ("mechanicalreduction", "gearratio", "reduction")
"""Names of a reduction: <mechanicalReduction> of ROS 1, <mechanical_reduction> of ROS 2, <drake:gear_ratio>."""

ACTUATORS = ("actuator", "leftActuator", "rightActuator")
JOINTS = ("joint", "flexJoint", "rollJoint")


def reflected_inertias(robot: Any) -> tuple[dict[str, float], list[Remark]]:
    """Return N²J [kg m², prismatic: kg] of each joint whose transmission gives a rotor inertia, and remarks on the rest.

    Rotors of several actuators of one joint add up. An actuator that several transmissions name counts once.
    """
    types = {joint.get("name"): joint.get("type") for joint in robot.findall("joint")}
    rotors: dict[str, dict[str, tuple[float, float]]] = {}
    remarks = []
    elements = [*robot.findall("transmission"), *robot.findall("ros2_control/transmission")]
    for number, element in enumerate(elements):
        where = f"transmission {short(element.get('name'))}"
        actuators, joints = (
            [child for child in element.iterchildren() if local_name(child) in tags] for tags in (ACTUATORS, JOINTS)
        )
        shared = [element, *joints]  # numbers of these belong to all actuators
        if not any(_entries([*shared, *actuators], INERTIA)):
            continue
        names = list(dict.fromkeys(joint.get("name") or "" for joint in joints))
        for name in names:
            if name not in types:
                raise UrdfError(f"{where}: joint {short(name)} is not a joint of this URDF.")
        reason = None
        if len(names) != 1:
            reason = "it does not drive one joint"
        elif types[names[0]] not in SINGLE:
            reason = f"the joint is {types[names[0]]}"
        elif len(actuators) > 1 and any(_entries(shared, INERTIA)):
            reason = "it is that of none of its actuators"
        if reason:
            what = f"the rotor inertia of {where} is ignored: {reason}"
            places = [("joint", name) for name in names] or [("robot", robot.get("name") or "robot")]
            remarks += [Remark(*place, what, "Give load_urdf the armature of each joint.") for place in places]
            continue
        known = rotors.setdefault(names[0], {})
        for actuator, rotor in dict(_rotors(actuators, shared, where, f"transmission {number}")).items():
            if known.setdefault(actuator, rotor) != rotor:
                raise UrdfError(
                    f"{where}: {actuator} has another rotor inertia or reduction in an earlier transmission."
                )
    armature = {joint: sum(N * N * J for J, N in own.values()) for joint, own in rotors.items()}
    for joint, value in armature.items():
        if not value <= LARGEST:
            raise UrdfError(f"joint '{joint}': reflected rotor inertia {value:g} is beyond {LARGEST:g}.")
    return armature, remarks


def _rotors(actuators: list[Any], shared: list[Any], where: str, unnamed: str) -> Iterator[tuple[str, Any]]:
    """Yield the name of each actuator that has a rotor inertia, and its inertia and reduction."""
    for actuator in actuators or [None]:
        own, name = ([], None) if actuator is None else ([actuator], actuator.get("name"))
        inertia = _number([*own, *shared], INERTIA, where)
        if inertia is not None:
            reduction = _number([*own, *shared], REDUCTION, where)
            yield f"actuator '{name}'" if name else unnamed, (inertia, 1.0 if reduction is None else reduction)


def _number(elements: list[Any], names: tuple[str, ...], where: str) -> float | None:
    """Return the one size of a number that elements give under one of some names; a reduction of 1 gives way to others."""
    is_inertia = names is INERTIA
    expected = "a finite number >= 0 [kg m²]" if is_inertia else "a finite number other than 0"
    given: dict[float, str] = {}
    for tag, text in _entries(elements, names):
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or (value < 0.0 if is_inertia else value == 0.0):
            raise UrdfError(f"{where}: <{tag}> is {short(text)}; expected {expected}.")
        given.setdefault(abs(value), tag)
    if len(given) > 1 and not is_inertia:
        given.pop(1.0, None)
    if len(given) > 1:
        listed = ", ".join(f"<{tag}> {value:g}" for value, tag in given.items())
        raise UrdfError(f"{where}: {listed} contradict each other; expected one number.")
    return next(iter(given), None)


def _entries(elements: Iterable[Any], names: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Yield name and text of the numbers of elements: attributes, elements with text or a value, and <param>."""
    for element in elements:
        children = [
            (child.get("name", "") if local_name(child) == "param" else local_name(child), child) for child in element
        ]
        entries = [(tag, child.get("value") or child.text or "") for tag, child in children]
        for tag, text in (*element.items(), *entries):
            if tag.rpartition("}")[2].rpartition(":")[2].replace("_", "").lower() in names:
                yield tag, text
