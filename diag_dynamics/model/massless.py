# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints that move no inertia and make the mass matrix singular: the recursion finds them, they are named or locked."""

import numpy as np

from diag_dynamics.exceptions import MasslessLinkError
from diag_dynamics.sweeps import factorization
from diag_dynamics.sweeps import workspace as ws
from diag_dynamics.sweeps.joints import SINGULAR

MAX_LISTED = 50  # largest number of joints that a message lists


def massless_freedoms(model):
    """Return the degrees of freedom that move no inertia in four configurations, and the smallest D of each."""
    rng = np.random.default_rng(0)
    own = ws.Workspace(model.bodies, model.gravity)
    smallest, massless = np.full(model.nv, np.inf), np.ones(model.nv, dtype=bool)
    turning = np.array([orientation < 0 for orientation in model.orientations], dtype=bool)
    for spread in (0.0, 1.0, 1.0, 1.0):
        q = model.neutral
        q[turning] += spread * rng.uniform(-1.0, 1.0, turning.sum())
        D, magnitude = np.zeros(model.nv), np.zeros(model.nv)
        factorization.joint_inertias(own.robot, q, D, magnitude)
        massless &= ~(SINGULAR * magnitude < D)
        smallest = np.minimum(smallest, D)
    return np.flatnonzero(massless), smallest


def positions_to_hold(model, found):
    """Return the positions at which joints that move no inertia are locked: zero, or the limit next to it."""
    at = {name: k for k, name in enumerate(model.coordinate_names)}
    names = [name for name in _names_of(model, found[0]) if name in at]  # of one degree of freedom
    return {name: float(np.clip(0.0, model.lower[at[name]], model.upper[at[name]])) for name in names}


def _names_of(model, dofs):
    return [model.dof_names[k] for k in dofs]


def reject_massless(model, tree, found):
    """Raise, naming all joints that move no inertia, and their cures."""
    massless, smallest = found
    if not len(massless):
        return
    joints = [joint for joint in tree.joints for _ in joint.type.freedoms]
    own = [(link.inertial, body) for link, body, _ in tree.links]
    heavy = {body for inertial, body in own if inertial is not None and (inertial.mass or np.any(inertial.inertia))}
    lines = []
    for k in massless[:MAX_LISTED]:
        link = joints[k].joint.child if joints[k].joint else model.root_link
        is_heavy = tree.last_body[joints[k].name] in heavy
        why = "little or negative inertia about that axis" if is_heavy else "no <inertial>"
        lines.append(f"joint '{model.dof_names[k]}' (D = {smallest[k]:.3g}): link '{link}' has {why}")
    if len(massless) > MAX_LISTED:
        lines.append(f"… and {len(massless) - MAX_LISTED} more")
    advice = "Correct the mass and inertia of the link in the URDF, or make the joint fixed."
    if single := next((name for name in _names_of(model, massless) if name in model.coordinate_names), None):
        advice += (
            f" Or give the joint a rotor inertia, armature={{'{single}': …}}, or lock it, "
            f"locked_joints={{'{single}': 0.0}} or massless='lock'."
        )
    raise MasslessLinkError(
        f"robot '{model.name}' has {len(massless)} joint(s) that move no inertia, which makes its mass matrix singular: "
        f"{'; '.join(lines)}. {advice}",
        _names_of(model, massless),
        smallest[massless],
    )
