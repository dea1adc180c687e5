# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checked arguments of load_urdf, and the tree of a robot that they choose."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.checks import mapping, number, numbers
from diag_dynamics.exceptions import InputError, MimicJointError, UnsupportedError
from diag_dynamics.model.flexible_links import Flexible
from diag_dynamics.model.inertias import LARGEST, Payload
from diag_dynamics.model.joint_types import SINGLE
from diag_dynamics.model.loops import Curve, Loop, close, resolve_curves, without_curves
from diag_dynamics.model.mimic import resolve_mimics
from diag_dynamics.model.parameters import Coupling, FlexibleJoint
from diag_dynamics.model.tree import Tree

MAX_COUPLED = 200  # largest number of bodies in a coupled group, by default
FRICTION_VELOCITY = (
    5e-3  # default v₀ [rad/s, m/s]: estimated velocities at rest are milliradians per second
)
LARGEST_GRAVITY = (
    1000.0  # largest component of gravity accepted [m/s²]: a value in mm/s² is beyond it
)


class Options(NamedTuple):
    """Checked arguments of :func:`load_urdf`; `held` are the joints that massless="lock" has locked, with positions."""

    floating_base: bool
    gravity: Array
    mimic: str
    massless: str
    locked: dict[str, float]
    armature: dict[str, float]
    effort_offset: dict[str, float]
    load_friction: dict[str, float]
    root_friction: dict[str, float]
    effort_scale: dict[str, float]
    couplings: dict[str, Coupling]
    motor_efforts: bool
    payloads: dict[str, Payload]
    max_coupled: int
    friction_velocity: float
    estimated_links: tuple[str, ...]
    loops: tuple[Loop, ...]
    curves: dict[str, Curve]
    driven: tuple[str, ...]
    omitted: tuple[str, ...]
    held: dict[str, float]
    flexible_joints: dict[str, FlexibleJoint]
    flexible_links: Flexible


def motor_rates(couplings: Mapping[str, Coupling], names: tuple[str, ...]) -> Array:
    """Return rates of coupled motors by those of joints, (m, nv)."""
    found = np.zeros((len(couplings), len(names)))
    for row, (motor, coupling) in zip(found, couplings.items(), strict=True):
        for joint, ratio in coupling.joints.items():
            if joint not in names:
                raise InputError(
                    f"parameters: coupling '{motor}' names '{joint}', expected one of {', '.join(names)}."
                )
            row[names.index(joint)] = ratio
    return found


def reject_friction(followers: Mapping[str, Any], options: Options) -> None:
    """Reject parameters of followers that no method reflects."""
    for kind in ("effort_offset", "load_friction", "root_friction"):
        for name, value in getattr(options, kind).items():
            if value and name in followers:
                raise UnsupportedError(
                    f"parameters: {kind} of joint '{name}' is {value:g}; expected 0, because it follows other joints."
                )


def checked_gravity(value: object) -> Array:
    """Return gravity [m/s²], shape (3,)."""
    return numbers("gravity", value, (3,), "three finite numbers [m/s²]", LARGEST_GRAVITY)


def checked_armature(value: object, robot: Any) -> dict[str, float]:
    """Return the armature by joint name, given one number or a dict."""
    if value is not None and not isinstance(value, Mapping):
        one = number("armature", value, "a finite number >= 0, or such by joint name")
        value = {joint.name: one for joint in robot.joints if joint.type in SINGLE}
    expected = "a finite number >= 0 [kg m², kg]"
    return _by_joint(
        "armature", {} if value is None else value, robot, expected, lambda x: 0.0 <= x <= LARGEST
    )


def checked_locked(value: object, robot: Any) -> dict[str, float]:
    """Return positions of locked joints by name."""
    expected = f"a finite number [rad, m] within ±{LARGEST:g}"
    return _by_joint("locked_joints", value, robot, expected, lambda x: abs(x) <= LARGEST)


def _by_joint(
    name: str, value: object, robot: Any, expected: str, valid: Callable[[float], bool]
) -> dict[str, float]:
    """Return a number by name of joints of one degree of freedom."""
    types, found = {joint.name: joint.type for joint in robot.joints}, {}
    for joint, x in mapping(name, value).items():
        if joint not in types:
            raise InputError(f"{name}: {joint!r} is not a joint of robot '{robot.name}'.")
        if types[joint] not in SINGLE:
            raise InputError(
                f"{name}: joint '{joint}' is {types[joint]}, expected one degree of freedom."
            )
        found[joint] = number(f"{name} of joint '{joint}'", x, expected, valid)
    return found


def tree_of(robot: Any, root: str, options: Options) -> Tree:
    """Return the tree of a robot, its mimic joints and loops resolved."""
    if options.curves:
        robot = without_curves(robot, options.curves)
    mimics, locked = resolve_mimics(robot, options.mimic, options.locked | options.held)
    coupled = None
    flexible, locked = options.flexible_links.without(locked)
    if options.loops or options.curves or flexible.forms:
        curves = resolve_curves(robot, options.curves, mimics, locked)
        cut = Tree(robot, root, options.floating_base, locked, {})
        coupled = close(cut, options.loops, curves, mimics, frozenset(options.driven), flexible)
        mimics = coupled.mimics
    tree = Tree(robot, root, options.floating_base, locked, mimics, coupled)
    for group, size in zip(tree.groups, tree.group_sizes, strict=True):
        if size > options.max_coupled:
            text = f"robot '{robot.name}' has a group of {len(group)} coupled joints, '{group[0]}' to '{group[-1]}', of"
            most = f"and no more than {options.max_coupled} are accepted"
            cure = "Raise max_coupled, or take every joint as independent (mimic: free)."
            raise MimicJointError(f"{text} {size} bodies, {most}. {cure}", group)
    return tree
