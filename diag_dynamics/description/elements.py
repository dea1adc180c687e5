# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers of XML attributes, and the placement of an `<origin>`.

Every reader of origins calls this module.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from diag_dynamics import rotations
from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import UrdfError
from diag_dynamics.text import shortened

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
    element: Any, attribute: str, count: int, where: str, may_be_infinite: bool = False
) -> list[float]:
    """Return the numbers of an attribute of an element, within ±:data:`LARGEST`.

    `where` is for errors.
    """
    if (text := element.get(attribute)) is None:
        raise UrdfError(f"{where}: <{element.tag}> has no {attribute}.")
    shown = f"{where}: <{element.tag} {attribute}={short(text)}>"
    if "${" in text or "$(" in text:
        raise UrdfError(f"{shown} is unexpanded xacro. Run xacro on it first.")
    numbers = floats(text, count, may_be_infinite)
    if numbers is None:
        raise UrdfError(
            f"{shown} is not {f'{count} finite numbers' if count > 1 else 'a finite number'}."
        )
    if not may_be_infinite and any(abs(number) > LARGEST for number in numbers):
        raise UrdfError(f"{shown} is beyond {LARGEST:g}.")
    return numbers


def local_name(element: Any) -> str:
    """Return the tag of an element without namespace or prefix."""
    return str(element.tag).rpartition("}")[2].rpartition(":")[2]


def is_xacro(element: Any) -> bool:
    """Return whether an element is of xacro's namespace or prefix."""
    tag = str(element.tag)
    is_prefixed = element.prefix == "xacro" or tag.startswith("xacro:")
    return is_prefixed or "xacro" in tag.rpartition("}")[0]


def short(value: object) -> str:
    """Return a value as messages show it."""
    return shortened(repr(value), 80)


def placement_of(element: Any, where: str) -> Array:
    """Return the placement (4, 4) of an `<origin>`.

    The rotation is Rz(yaw) Ry(pitch) Rx(roll), or that of quat_xyzw, which is normalized.
    """
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
    placement, turn = np.eye(4), np.eye(4)
    placement[:3, 3] = numbers.get("xyz", (0.0, 0.0, 0.0))
    if "rpy" in numbers:
        turn[:3, :3] = rotations.from_rpy(*numbers["rpy"])
    elif "quat_xyzw" in numbers:
        largest = max(map(abs, numbers["quat_xyzw"]))
        if largest == 0.0:
            shown = f"{where}: <{element.tag} quat_xyzw={short(element.get('quat_xyzw'))}>"
            raise UrdfError(f"{shown} is no rotation; expected a quaternion x y z w of length 1.")
        turn[:3, :3] = rotations.from_quaternion(
            *(number / largest for number in numbers["quat_xyzw"])
        )
    return placement @ turn
