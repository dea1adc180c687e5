# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checked arguments of load_urdf, and the tree of a description that they choose."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from diag_dynamics.arrays import Array
from diag_dynamics.checks import mapping, number, numbers
from diag_dynamics.description.inertias import LARGEST
from diag_dynamics.description.records import SINGLE, Description, Payload
from diag_dynamics.exceptions import InputError, MimicJointError
from diag_dynamics.model.flexible_links import Flexible
from diag_dynamics.model.loops import close, resolve_curves
from diag_dynamics.model.mimic import resolve_mimics
from diag_dynamics.model.tree import Tree

MAX_COUPLED = 1000  # largest number of bodies in a coupled group
LARGEST_GRAVITY = 1000.0  # maximum of a component [m/s²]: a value in mm/s² is beyond it


class Options(NamedTuple):
    """Checked arguments of :func:`load_urdf`.

    `held` are joints that massless="lock" locks, with positions.
    """

    floating_base: bool
    gravity: Array
    mimic: str
    massless: str
    locked: Mapping[str, float]
    payloads: Mapping[str, Payload]
    flexible_links: Flexible
    held: Mapping[str, float] = {}


def checked_gravity(value: object) -> Array:
    """Return gravity [m/s²], shape (3,)."""
    return numbers("gravity", value, (3,), "three finite numbers [m/s²]", LARGEST_GRAVITY)


def with_armature(description: Description, value: object) -> Description:
    """Return a description with the armature of joints, one number for all or a dict by name."""
    if value is None:
        return description
    if not isinstance(value, Mapping):
        armature = number("armature", value, "a finite number >= 0, or such by joint name")
        single = [joint.name for joint in description.joints.values() if joint.type in SINGLE]
        value = dict.fromkeys(single, armature)
    values = _by_joint(
        "armature",
        value,
        description,
        "a finite number >= 0 [kg m², kg]",
        lambda x: 0.0 <= x <= LARGEST,
    )
    joints = description.joints
    return description.with_joints(*(joints[n]._replace(armature=x) for n, x in values.items()))


def checked_locked(value: object, description: Description) -> dict[str, float]:
    """Return positions of locked joints by name."""
    expected = f"a finite number [rad, m] within ±{LARGEST:g}"
    return _by_joint("locked_joints", value, description, expected, lambda x: abs(x) <= LARGEST)


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
        if joint not in description.joints:
            raise InputError(f"{name}: {joint!r} is not a joint of robot '{description.name}'.")
        kind = description.joints[joint].type
        if kind not in SINGLE:
            raise InputError(f"{name}: joint '{joint}' is {kind}, expected one degree of freedom.")
        values[joint] = number(f"{name} of joint '{joint}'", x, expected, valid)
    return values


def tree_of(description: Description, options: Options) -> Tree:
    """Return the tree of a description, its mimic joints and loops resolved."""
    curves = {} if options.mimic == "free" else description.curves
    mimics, locked = resolve_mimics(description, options.mimic, {**options.locked, **options.held})
    coupled = None
    flexible, locked = options.flexible_links.without(locked)
    if description.loops or curves or flexible.forms:
        curves = resolve_curves(description, curves, mimics, locked)
        cut = Tree(description, options.floating_base, locked, {})
        coupled = close(cut, curves, mimics, flexible)
        mimics = coupled.mimics
    tree = Tree(description, options.floating_base, locked, mimics, coupled)
    for group, size in zip(tree.groups, tree.group_sizes, strict=True):
        if size > MAX_COUPLED:
            raise MimicJointError(
                f"robot '{description.name}' has a group of {len(group)} coupled joints, "
                f"'{group[0]}' to '{group[-1]}', of {size} bodies, and no more than "
                f"{MAX_COUPLED} are accepted. Take every joint as independent (mimic: free).",
                group,
            )
    return tree
