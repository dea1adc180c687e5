# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The tree of bodies and links by which the page computes placements from positions."""

from __future__ import annotations

from typing import Any

import numpy as np

from diag_dynamics.model import RobotModel
from diag_dynamics.sweeps.bodies import FLOATING, PLANAR, PRISMATIC, REVOLUTE

KINDS = {REVOLUTE: "revolute", PRISMATIC: "prismatic", PLANAR: "planar", FLOATING: "floating"}


def tree_of(model: RobotModel) -> dict[str, Any]:
    """Return the tree of a robot, for JSON.

    Parameters
    ----------
    model : RobotModel

    Returns
    -------
    dict
        ``bodies``: parent, kind of the joint (its axis is z), q (index of its first position), multiplier and offset of a
        mimic joint's position, placement in the parent at position 0 (4x4, row by row). A body precedes those that it
        carries; body 0 is the world. ``links``: body, placement in it, dofs that move the link.
        ``link_of_dof``: name of the link that each degree of freedom moves.
    """
    return {
        "bodies": [_body(body, number) for number, body in enumerate(model.bodies)],
        "links": [_link(model, name) for name in model.link_names],
        "link_of_dof": links_of_dofs(model),
    }


def links_of_dofs(model: RobotModel) -> list[str]:
    """Return the name of the link that each degree of freedom moves."""
    bodies = model.bodies
    own = {int(bodies["dof"][k]): k for k in range(1, len(bodies)) if bodies["owner"][k] == k}
    return [model.link_names[bodies["link"][own[dof]]] for dof in range(model.nv)]


def _body(body: Any, number: int) -> dict[str, Any]:
    placement = np.eye(4)
    if number:
        placement[:3, :3], placement[:3, 3] = body["rotation"].reshape(3, 3), body["translation"]
    # Of a joint with several degrees of freedom the first body has the whole motion.
    moves = number and not body["rank"]
    return {
        "parent": int(body["parent"]),
        "kind": KINDS[int(body["kind"])] if moves else "fixed",
        "q": int(body["q"]),
        "multiplier": float(body["multiplier"]),
        "offset": float(body["offset"]),
        "placement": placement.ravel().tolist(),
    }


def _link(model: RobotModel, name: str) -> dict[str, Any]:
    number, placement = model.placement_in_body(name)
    body = model.bodies[number]
    first = int(body["dof"] - body["rank"])
    dofs = list(range(first, first + int(body["dofs"]))) if number else []
    return {"body": number, "placement": placement.ravel().tolist(), "dofs": dofs}
