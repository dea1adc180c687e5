# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints that move no inertia: the recursion finds them, they are named or locked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import MasslessLinkError
from diag_dynamics.model.followers import closed
from diag_dynamics.sweeps import evaluation, factorization
from diag_dynamics.sweeps import workspace as ws
from diag_dynamics.sweeps.memory import Workspace

if TYPE_CHECKING:
    from diag_dynamics.model.robot import RobotModel
    from diag_dynamics.model.tree import Tree

LOCKED = 1e100  # armature of a joint that counts as locked [kg m², kg]
MAX_LISTED = 50  # largest number of joints that a message lists


def massless_freedoms(model: RobotModel) -> dict[int, float]:
    """Return the smallest D of each degree of freedom that moves no inertia in four poses."""
    if not _is_singular(model, model.start):
        return {}
    singular, rng = singular_joints(model, model.start), np.random.default_rng(0)
    turning = np.array(model.orientations) < 0
    spread = 1.0 if model.coupling_tables is None else 0.05
    for _ in range(3):
        q = model.start
        q[turning] += spread * rng.uniform(-1.0, 1.0, turning.sum())
        there = singular_joints(model, closed(model, q) if model.loops else q)
        singular = {body: min(D, there[body]) for body, D in singular.items() if body in there}
    return {int(model.bodies["dof"][body]): D for body, D in sorted(singular.items())}


def _is_singular(model: RobotModel, q: Array) -> bool:
    """Return whether a joint moves no inertia, by the sweep that most users compile anyway."""
    at_rest, rows = np.zeros(model.nv), np.empty((ws.N_ROWS, max(model.nq, 1)))
    workspace = model.new_workspace()
    status: int = evaluation.evaluate(workspace.robot, q, at_rest, at_rest, rows)
    return status > 0


def singular_joints(model: RobotModel, q: Array) -> dict[int, float]:
    """Return D by body of joints that move no inertia; each counts as locked for those inboard."""
    workspace = Workspace(model.bodies.copy(), model.gravity, model.coupling_tables)
    factors, D = np.empty((3, model.nv, model.nv)), np.empty(model.nv)
    singular: dict[int, float] = {}
    while True:
        body = factorization.factors(workspace.robot, q, factors, D)
        if body <= 0 or body in singular:
            return singular
        singular[body] = float(workspace.work["D"][body])
        workspace.bodies["armature"][body] = LOCKED


def positions_to_hold(model: RobotModel, massless: Mapping[int, float]) -> dict[str, float]:
    """Return the positions at which joints that move no inertia are locked: zero, or the limit next to it."""
    at = {name: k for k, name in enumerate(model.coordinate_names)}
    names = [name for name in _names_of(model, massless) if name in at]  # of one degree of freedom
    return {
        name: float(np.clip(0.0, model.lower[at[name]], model.upper[at[name]])) for name in names
    }


def _names_of(model: RobotModel, dofs: Iterable[int]) -> list[str]:
    return [model.dof_names[k] for k in dofs]


def reject_massless(model: RobotModel, tree: Tree, massless: Mapping[int, float]) -> None:
    """Raise, naming all joints that move no inertia, and their cures."""
    if not massless:
        return
    joints = [joint for joint in tree.joints for _ in joint.type.freedoms]
    inertials = [(link.inertial, body) for link, body, _ in tree.links]
    heavy = {
        body
        for inertial, body in inertials
        if inertial is not None and (inertial.mass or np.any(inertial.inertia))
    }
    lines = []
    for k, D in islice(massless.items(), MAX_LISTED):
        link = joints[k].joint.child
        is_heavy = tree.last_body[joints[k].name] in heavy
        why = "little or negative inertia about that axis" if is_heavy else "no <inertial>"
        lines.append(f"joint '{model.dof_names[k]}' (D = {D:.3g}): link '{link}' has {why}")
    if len(massless) > MAX_LISTED:
        lines.append(f"… and {len(massless) - MAX_LISTED} more")
    advice = "Correct the mass and inertia of the link in the URDF, or make the joint fixed."
    if single := next(
        (name for name in _names_of(model, massless) if name in model.coordinate_names), None
    ):
        advice += (
            f" Or give the joint a rotor inertia (armature: {single}=…), or lock it "
            f"(locked_joints: {single}=0, or massless: lock)."
        )
    raise MasslessLinkError(
        f"robot '{model.name}' has {len(massless)} joint(s) that move no inertia, which makes its mass matrix singular: "
        f"{'; '.join(lines)}. {advice}",
        _names_of(model, massless),
        massless.values(),
    )
