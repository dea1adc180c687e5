# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints that move no inertia and make the mass matrix singular: the recursion finds them, they are named or locked."""

import numpy as np

from diag_dynamics.exceptions import MasslessLinkError
from diag_dynamics.model.options import negative_moments
from diag_dynamics.sweeps import factorization
from diag_dynamics.sweeps import workspace as ws
from diag_dynamics.sweeps.joints import SINGULAR


def massless_freedoms(model):
    """Return the degrees of freedom that move no inertia in any of four configurations, and the smallest D of each one.

    At a single configuration M may be merely singular there.
    """
    rng = np.random.default_rng(0)
    own = ws.Workspace(model.bodies, model.gravity)
    smallest, massless = np.full(model.nv, np.inf), np.ones(model.nv, dtype=bool)
    for spread in (0.0, 1.0, 1.0, 1.0):
        q = model.neutral
        turning = np.array([orientation < 0 for orientation in model.orientations], dtype=bool)
        q[turning] += spread * rng.uniform(-1.0, 1.0, turning.sum())
        D, magnitude = np.zeros(model.nv), np.zeros(model.nv)
        factorization.joint_inertias(own.robot, q, D, magnitude)
        massless &= ~(SINGULAR * magnitude < D)
        smallest = np.minimum(smallest, D)
    return np.flatnonzero(massless), smallest


MAX_LISTED = 50
"""Largest number of joints that a message lists."""


def _joints_of_dofs(tree):
    return [joint for joint in tree.joints for _ in joint.dof_names]


def refuse_massless(model, tree, found):
    """Raise, naming all joints that move no inertia, and their cures."""
    massless, smallest = found
    if not len(massless):
        return
    joints = _joints_of_dofs(tree)
    negative = {k: links for k in massless if (links := _negative_links(tree, joints[k]))}
    text = _negative_text(model, smallest, negative) if negative else _massless_text(model, tree, joints, *found)
    which = list(negative or massless)
    raise MasslessLinkError(text, [model.dof_names[k] for k in which], smallest[which])


def _negative_text(model, smallest, negative):
    links = list(dict.fromkeys(text for found in negative.values() for text in found))[:MAX_LISTED]
    names = ", ".join(f"'{model.dof_names[k]}' (D = {smallest[k]:.3g})" for k in list(negative)[:MAX_LISTED])
    return (
        f"robot '{model.name}': {'; '.join(links)}. Expected positive moments, because the mass matrix is not positive "
        f"definite with these, at the joint(s) {names}. Correct the inertia in the URDF."
    )


def _massless_text(model, tree, joints, massless, smallest):
    heavy, lines = tree.joints_with_inertia(), []
    for k in massless[:MAX_LISTED]:
        joint = joints[k]
        link = joint.joint.child if joint.joint else model.root_link
        why = "has little inertia about that axis" if joint.name in heavy else "has no <inertial>"
        lines.append(f"joint '{model.dof_names[k]}' (D = {smallest[k]:.3g}): link '{link}' {why}")
    if len(massless) > MAX_LISTED:
        lines.append(f"… and {len(massless) - MAX_LISTED} more")
    advice = "Give the link mass and inertia in the URDF, or make the joint fixed."
    single = next((joints[k].name for k in massless if joints[k].is_single), None)
    if single is not None:
        advice += (
            f" Or give the joint a rotor inertia, armature={{'{single}': …}}, or lock it, "
            f"locked_joints={{'{single}': 0.0}} or massless='lock'."
        )
    return (
        f"robot '{model.name}' has {len(massless)} joint(s) that move no inertia, which makes its mass matrix "
        f"singular: {'; '.join(lines)}. {advice}"
    )


def _negative_links(tree, moved):
    """Return texts on the links that a joint moves and whose inertia has negative principal moments."""
    children = {}
    for joint in tree.robot.joints:
        children.setdefault(joint.parent, []).append(joint.child)
    ahead = [moved.joint.child if moved.joint else tree.root]
    outboard = set(ahead)
    while ahead:
        ahead += (more := children.get(ahead.pop(), []))
        outboard.update(more)
    return [
        f"link '{link.name}' has negative principal moments of inertia, {moments} kg m²"
        for link in tree.robot.links
        if link.name in outboard
        and link.inertial is not None
        and (moments := negative_moments(link.inertial.inertia, link.inertial.mass))
    ]


def positions_to_hold(model, tree, found):
    """Return the positions at which joints that move no inertia are locked: zero, or the limit next to it."""
    joints, at = _joints_of_dofs(tree), {name: k for k, name in enumerate(model.coordinate_names)}
    held = {}
    for k in found[0]:
        if joints[k].is_single:
            i = at[joints[k].name]
            held[joints[k].name] = float(np.clip(0.0, model.lower[i], model.upper[i]))
    return held
