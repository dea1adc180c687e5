# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a person would call the hand of a robot: the link that a page's ellipsoid begins with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from diag_dynamics.model import RobotModel

FINGER, LEAST = 0.03, 0.003
"""Parts of the robot's mass: up to which what a hand moves are fingers, and below which a link is the end of nothing."""


def hand_of(model: RobotModel, scene: Mapping[str, Any] | None) -> str:
    """Name of the last link of the longest chain that moves and has some share of the mass.

    Where that is a finger, it is the link that all fingers are on, whatever is attached to it. Without a scene (see
    :func:`~diag_dynamics.page.scene.scene_of`) nothing is known of chains: it is the root link.
    """
    links, joints = model.link_names, scene["joints"] if scene else []
    parent = {joint["child"]: joint["parent"] for joint in joints}

    def above(name: str | None) -> list[str]:
        chain: list[str] = []
        while name is not None and len(chain) <= len(parent):
            chain.append(name)
            name = parent.get(name)
        return chain

    moved = [name for name in links if model.floating_base or model.placement_in_body(name)[0] != 0]
    candidates = moved or list(links)
    last = max(candidates, key=lambda name: len(above(name)))
    inertias = {link["name"]: link["inertia"] for link in scene["links"]} if scene else {}
    mass = {name: float(inertia["mass"]) if inertia else 0.0 for name, inertia in inertias.items()}
    carried = dict.fromkeys(links, 0.0)
    for name in links:
        for one in above(name):
            carried[one] = carried.get(one, 0.0) + mass.get(name, 0.0)
    total = sum(mass.values())

    def has_fingers(name: str) -> bool:
        own = [joint["child"] for joint in joints if joint["parent"] == name and joint["dof"] is not None]
        return len(own) > 1 and all(carried.get(child, 0.0) <= FINGER * total for child in own)

    hands = [name for name in above(last) if has_fingers(name)]
    if hands:
        return hands[-1]
    heavy = (name for name in above(last) if carried.get(name, 0.0) >= LEAST * total and name in candidates)
    return next(heavy, last)
