# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Flexible joints: a spring between the motor and the link of a joint, and the values that joint states have of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from diag_dynamics.checks import choice, listed, not_negative, positive
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.joint_types import SINGLE
from diag_dynamics.model.tree import Tree

_POSITIVE = {"stiffness": "[N m/rad, N/m]", "rotor_inertia": "[kg m²]", "gear": "[1, rad/m]"}
_CHOICES = {"position": ("motor", "link"), "effort": ("motor", "spring")}


class FlexibleJoint(NamedTuple):
    """Spring and rotor of a joint in the reduced model, in which a rotor has the energy of its own spin alone.

    With the motor's position θ = θ_motor/N and the link's q the spring torque is τ_J = k(θ − q) + d(θ̇ − q̇), and
    B = N²J_rotor. Joint states carry the position of the "motor" (θ) or the "link" (q), and the effort of the "motor"
    (N τ_motor) or of the "spring" (τ_J).
    """

    stiffness: float  # k [N m/rad, N/m]
    rotor_inertia: float  # J_rotor, at the motor [kg m²]
    damping: float = 0.0  # d [N m s/rad, N s/m]
    gear: float = 1.0  # N [1, prismatic: rad/m]
    position: str = "motor"
    effort: str = "motor"

    @property
    def reflected_inertia(self) -> float:
        """B [kg m², kg]."""
        return self.gear**2 * self.rotor_inertia


def checked_joint(entry: Mapping[str, Any], source: str) -> FlexibleJoint:
    """Return the joint of a dict with its fields; InputError names a wrong one."""
    values = {"gear": 1.0, "damping": 0.0, **entry}
    for name, unit in _POSITIVE.items():
        values[name] = positive(f"{source}: {name}", values.get(name), unit)
    values["damping"] = not_negative(f"{source}: damping", values["damping"], "[N m s/rad, N s/m]")
    for name, known in _CHOICES.items():
        choice(f"{source}: {name}", values.get(name, known[0]), known)
    return FlexibleJoint(**values)


def flexible_joints(tree: Tree, given: Mapping[str, FlexibleJoint], armature: Mapping[str, float]) -> dict[str, Any]:
    """Return the flexible joints that are degrees of freedom, in their order; InputError names joints that cannot be."""
    types = {joint.name: joint.type for joint in tree.robot.joints}
    for name in given:
        reason = f"is no joint of robot '{tree.robot.name}', expected one of {listed(list(types))}"
        if name in types:
            reason = "" if types[name] in SINGLE else f"is {types[name]}, expected one degree of freedom"
        if not reason and name not in (*tree.dof_names, *tree.locked):
            reason = "follows other joints, expected a degree of freedom"
        if armature.get(name):
            reason = f"has armature {armature[name]:g}, expected none. Set its rotor_inertia and gear"
        if reason:
            raise InputError(f"flexible_joints: '{name}' {reason}.")
    return {name: given[name] for name in tree.dof_names if name in given}
