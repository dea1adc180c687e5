# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rotor inertias that the `<transmission>` elements of a URDF give, reflected to their joints: N²J."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

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


class _Transmission:
    """A transmission; `shared` are the elements whose numbers belong to all of its actuators."""

    def __init__(self, element: Any, number: int) -> None:
        self.where = f"transmission {short(element.get('name'))}"
        self._unnamed = f"transmission {number}"
        children = list(element.iterchildren())
        joints = [child for child in children if local_name(child) in JOINTS]
        self.actuators = [child for child in children if local_name(child) in ACTUATORS]
        self.shared = [element, *joints]
        self.joints = list(dict.fromkeys(joint.get("name") or "" for joint in joints))
        self.has_inertia = any(_entries([*self.shared, *self.actuators], INERTIA))

    def reason_to_ignore(self, types: dict[str, str]) -> str:
        """Return why its rotor inertia belongs to no joint; empty if it does."""
        if len(self.joints) != 1:
            return "it does not drive one joint"
        if types[self.joints[0]] not in SINGLE:
            return f"the joint is {types[self.joints[0]]}"
        if len(self.actuators) > 1 and any(_entries(self.shared, INERTIA)):
            return "it is that of none of its actuators"
        return ""

    def rotors(self) -> Iterator[tuple[str, _Rotor]]:
        """Yield the name of each actuator that has a rotor inertia, and its rotor."""
        for actuator in self.actuators or [None]:
            own = [] if actuator is None else [actuator]
            elements = [*own, *(self.shared if len(self.actuators) < 2 else ())]
            inertia = self._number(elements, INERTIA, "a finite number >= 0 [kg m²]", lambda value: value >= 0.0)
            if inertia is not None:
                expected = "a finite number other than 0"
                reduction = self._number([*own, *self.shared], REDUCTION, expected, lambda value: value != 0.0)
                name = None if actuator is None else actuator.get("name")
                yield (
                    f"actuator '{name}'" if name else self._unnamed,
                    _Rotor(inertia, 1.0 if reduction is None else reduction),
                )

    def _number(
        self, elements: list[Any], names: tuple[str, ...], expected: str, is_valid: Callable[[float], bool]
    ) -> float | None:
        """Return the one size of a number that elements give under one of some names; a reduction of 1 gives way."""
        given: dict[float, str] = {}
        for tag, text in _entries(elements, names):
            try:
                value = float(text)
            except ValueError:
                value = math.nan
            if not (math.isfinite(value) and is_valid(value)):
                raise UrdfError(f"{self.where}: <{tag}> is {short(text)}; expected {expected}.")
            given.setdefault(abs(value), tag)
        if names is REDUCTION and len(given) > 1:
            given.pop(1.0, None)
        if len(given) > 1:
            listed = ", ".join(f"<{tag}> {value:g}" for value, tag in given.items())
            raise UrdfError(f"{self.where}: {listed} contradict each other; expected one number.")
        return next(iter(given), None)


class _Rotor(NamedTuple):
    inertia: float
    reduction: float


def reflected_inertias(robot: Any) -> tuple[dict[str, float], list[Remark]]:
    """Return N²J [kg m², prismatic: kg] of each joint whose transmission gives a rotor inertia, and remarks on the rest.

    Rotors of several actuators of one joint add up. An actuator that several transmissions name counts once.
    """
    types = {joint.get("name"): joint.get("type") for joint in robot.findall("joint")}
    rotors: dict[str, dict[str, _Rotor]] = {}
    remarks = []
    elements = [*robot.findall("transmission"), *robot.findall("ros2_control/transmission")]
    for number, element in enumerate(elements):
        transmission = _Transmission(element, number)
        if not transmission.has_inertia:
            continue
        for joint in transmission.joints:
            if joint not in types:
                raise UrdfError(f"{transmission.where}: joint {short(joint)} is not a joint of this URDF.")
        if reason := transmission.reason_to_ignore(types):
            what = f"the rotor inertia of {transmission.where} is ignored: {reason}"
            places = [("joint", joint) for joint in transmission.joints] or [("robot", robot.get("name") or "robot")]
            remarks += [Remark(*place, what, "Give load_urdf the armature of each joint.") for place in places]
            continue
        known = rotors.setdefault(transmission.joints[0], {})
        for actuator, rotor in dict(transmission.rotors()).items():
            if known.setdefault(actuator, rotor) != rotor:
                raise UrdfError(
                    f"{transmission.where}: {actuator} has another rotor inertia or reduction in an earlier transmission."
                )
    armature = {
        joint: sum(r.reduction * r.reduction * r.inertia for r in own.values()) for joint, own in rotors.items()
    }
    for joint, value in armature.items():
        if not value <= LARGEST:
            raise UrdfError(f"joint '{joint}': reflected rotor inertia {value:g} is beyond {LARGEST:g}.")
    return armature, remarks


def _entries(elements: Iterable[Any], names: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Yield name and text of the numbers of elements: attributes, elements with text or a value, and <param>."""
    for element in elements:
        for attribute, text in element.items():
            if _plain(attribute) in names:
                yield attribute, text
        for child in element.iterchildren():
            tag = child.get("name", "") if local_name(child) == "param" else local_name(child)
            if _plain(tag) in names:
                yield tag, child.get("value") or child.text or ""


def _plain(name: str) -> str:
    return name.rpartition("}")[2].rpartition(":")[2].replace("_", "").lower()
