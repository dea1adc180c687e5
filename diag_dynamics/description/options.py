# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checked arguments of load_urdf and of methods of a model, merged into a description."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from diag_dynamics.checks import mapping, number, numbers
from diag_dynamics.description.description import LARGEST_INERTIA, SINGLE, Description, Payload
from diag_dynamics.description.parameters import checked_body
from diag_dynamics.exceptions import InputError

LARGEST_GRAVITY = 1000.0  # maximum of a component [m/s²]: a value in mm/s² is beyond it


def with_gravity(description: Description, value: object) -> Description:
    """Return a description with an acceleration of gravity [m/s²], shape (3,)."""
    expected = "three finite numbers [m/s²]"
    gravity = numbers("gravity", value, (3,), expected, LARGEST_GRAVITY)
    return description._replace(gravity=gravity)


def with_armature(description: Description, value: object) -> Description:
    """Return a description with the armature of joints, one number for all or a dict by name."""
    if not isinstance(value, Mapping):
        armature = number("armature", value, "a finite number >= 0, or such by joint name")
        single = [joint.name for joint in description.joints.values() if joint.type in SINGLE]
        value = dict.fromkeys(single, armature)
    values = _by_joint(
        "armature",
        value,
        description,
        "a finite number >= 0 [kg m², kg]",
        lambda x: 0.0 <= x <= LARGEST_INERTIA,
    )
    joints = description.joints
    return description.with_joints(*(joints[n]._replace(armature=x) for n, x in values.items()))


def with_locked_joints(description: Description, value: object) -> Description:
    """Return a description with exactly these positions of locked joints by name."""
    expected = f"a finite number [rad, m] within ±{LARGEST_INERTIA:g}"
    locked = _by_joint(
        "locked_joints", value, description, expected, lambda x: abs(x) <= LARGEST_INERTIA
    )
    return description._replace(locked=locked, held={})


def with_payloads(description: Description, value: object) -> Description:
    """Return a description with exactly these payloads by link, those of mass zero left out."""
    checked = {}
    for name, entry in mapping("payloads", value).items():
        description.link("payloads", name)
        try:
            payload = Payload(*entry)
        except TypeError as error:
            raise InputError(
                f"payloads: '{name}' has {entry!r}; expected (mass, com, inertia)."
            ) from error
        checked[name] = checked_body(payload, "payloads: ", f" on link '{name}'")
    payloads = {name: payload for name, payload in checked.items() if payload.mass > 0.0}
    return description._replace(payloads=payloads)


def _by_joint(
    name: str,
    value: object,
    description: Description,
    expected: str,
    valid: Callable[[float], bool],
) -> dict[str, float]:
    """Return a number by name of joints of one degree of freedom."""
    values = {}
    for joint, x in mapping(name, value).items():
        description.single_joint(name, joint)
        values[joint] = number(f"{name} of joint '{joint}'", x, expected, valid)
    return values
