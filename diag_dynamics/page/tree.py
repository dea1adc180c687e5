# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The tree of bodies and links by which the page computes placements from positions."""

import numpy as np

from diag_dynamics.sweeps.records import FLOATING, PLANAR, PRISMATIC, REVOLUTE

KINDS = {REVOLUTE: "revolute", PRISMATIC: "prismatic", PLANAR: "planar", FLOATING: "floating"}


def tree_of(model):
    """Return the tree of a RobotModel, for JSON.

    ``bodies``: parent, kind of the joint (its axis is z), q (index of its first position), multiplier and offset of a mimic
    joint's position, placement in the parent at position 0 (4x4, row by row). A body precedes those that it carries; body 0
    is the world. ``links``: body, placement in it, dofs that move the link, centre of mass of the body in the link's axes.
    ``link_of_dof``: see :func:`links_of_dofs`.
    """
    bodies = [_body(body, bool(number)) for number, body in enumerate(model.bodies)]
    links = [_link(model, name) for name in model.link_names]
    return {"bodies": bodies, "links": links, "link_of_dof": links_of_dofs(model)}


def links_of_dofs(model):
    """Return the name of the link that each degree of freedom moves."""
    bodies = model.bodies
    own = {int(bodies["dof"][k]): k for k in range(1, len(bodies)) if bodies["leader"][k] == k}
    return [model.link_names[bodies["link"][own[dof]]] for dof in range(model.nv)]


def center_of_body(model, name):
    """Return the centre of mass of all links that are fixed to a link, in its axes [m]; its origin without mass."""
    number, placement = model.placement_in_body(name)
    body = model.bodies[number]
    if not body["mass"] > 0.0:
        return np.zeros(3)
    return placement[:3, :3].T @ (body["first_moment"] / body["mass"] - placement[:3, 3])


def _body(body, moves):
    placement = np.eye(4)
    if moves:
        placement[:3, :3], placement[:3, 3] = body["rotation"].reshape(3, 3), body["translation"]
    # Of a joint with several degrees of freedom the first body has the whole motion.
    kind = KINDS[int(body["kind"])] if moves and not body["rank"] else "fixed"
    numbers = {name: body[name].item() for name in ("parent", "q", "multiplier", "offset")}
    return {"kind": kind, **numbers, "placement": placement.ravel().tolist()}


def _link(model, name):
    number, placement = model.placement_in_body(name)
    body = model.bodies[number]
    first = int(body["dof"] - body["rank"])
    dofs = list(range(first, first + int(body["dofs"]))) if number else []
    center = center_of_body(model, name).tolist()
    return {"body": number, "placement": placement.ravel().tolist(), "dofs": dofs, "center": center}
