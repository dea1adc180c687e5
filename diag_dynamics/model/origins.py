# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers of XML attributes, and the placement that an `<origin>` describes: every reader of origins calls this module."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from diag_dynamics import rotations
from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import UrdfError

LARGEST = 1e30
"""Largest number accepted, of whatever unit: products of a few must not overflow."""


def numbers_of(element: Any, attribute: str, count: int, where: str, may_be_infinite: bool = False) -> list[float]:
    """Return the numbers of an attribute that the element has; `where` is for errors.

    They are `count` finite numbers within ±`LARGEST`, unless they may be infinite.
    """
    text = element.get(attribute)
    shown = f"{where}: <{element.tag} {attribute}={short(text)}>"
    if "${" in text or "$(" in text:
        raise UrdfError(f"{shown} is unexpanded xacro. Run xacro on it first.")
    try:
        numbers = [float(part) for part in text.split() if part.isascii() and "_" not in part]
    except ValueError:
        numbers = []
    finite = may_be_infinite or all(map(math.isfinite, numbers))
    if len(numbers) != count or not finite or any(map(math.isnan, numbers)):
        expected = f"{count} finite numbers" if count > 1 else "a finite number"
        raise UrdfError(f"{shown} is not {expected}.")
    if not may_be_infinite and any(abs(number) > LARGEST for number in numbers):
        raise UrdfError(f"{shown} is beyond {LARGEST:g}.")
    return numbers


def floats(text: str | None, count: int) -> list[float] | None:
    """Return the finite numbers of a text, None if these are not `count`."""
    try:
        numbers = [float(part) for part in (text or "").split() if "_" not in part]
    except ValueError:
        return None
    return numbers if len(numbers) == count and all(map(math.isfinite, numbers)) else None


def local_name(element: Any) -> str:
    """Tag of an element without namespace or prefix."""
    return str(element.tag).rpartition("}")[2].rpartition(":")[2]


def short(value: object) -> str:
    """A value as messages show it."""
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:60]}… ({len(text)} characters)"


def placement_of(element: Any, where: str) -> Array:
    """Return the placement (4, 4) of an `<origin>`: xyz, then rpy (Rz(yaw) Ry(pitch) Rx(roll)) or quat_xyzw.

    A quaternion is normalized, as urdfdom does; `where` is for errors.
    """
    given = {
        name: numbers_of(element, name, count, where)
        for name, count in {"xyz": 3, "rpy": 3, "quat_xyzw": 4}.items()
        if element.get(name) is not None
    }
    if "rpy" in given and "quat_xyzw" in given:
        raise UrdfError(f"{where}: <{element.tag}> has rpy and quat_xyzw; expected one of them. Remove the other.")
    placement, turn = np.eye(4), np.eye(4)
    placement[:3, 3] = given.get("xyz", (0.0, 0.0, 0.0))
    if "quat_xyzw" in given:
        if not any(given["quat_xyzw"]):
            shown = f"{where}: <{element.tag} quat_xyzw={short(element.get('quat_xyzw'))}>"
            raise UrdfError(f"{shown} is no rotation; expected a quaternion x y z w of length 1.")
        largest = max(map(abs, given["quat_xyzw"]))
        turn[:3, :3] = rotations.from_quaternion(*(number / largest for number in given["quat_xyzw"]))
    elif "rpy" in given:
        turn[:3, :3] = rotations.from_rpy(*given["rpy"])
    return placement @ turn
