# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots with closed loops, and their followers by plane trigonometry."""

import numpy as np

BASE, CRANK, COUPLER, ROCKER = 0.5, 0.2, 0.5, 0.4
"""Lengths [m] of the bars."""


def _link(name, mass, center):
    inertia = 'ixx="0.02" iyy="0.03" izz="0.025" ixy="0" ixz="0" iyz="0"'
    origin = " ".join(map(str, center))
    return (
        f'<link name="{name}"><inertial><origin xyz="{origin}"/><mass value="{mass}"/>'
        f"<inertia {inertia}/></inertial></link>"
    )


def _joint(name, parent, child, xyz, kind="continuous", axis="0 1 0", more=""):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>{more}</joint>'
    )


def four_bar(rocker="", crank="", kind="continuous"):
    """Return the URDF of a crank and rocker with an arm on the coupler; more elements of the joints
    rocker and crank.
    """
    return (
        '<robot name="four_bar"><link name="base"/>'
        + _link("crank", 1.0, (0.1, 0.0, 0.02))
        + _link("coupler", 2.0, (0.2, 0.01, 0.0))
        + _link("rocker", 1.5, (0.15, 0.0, 0.0))
        + _link("arm", 0.7, (0.1, 0.05, 0.1))
        + _joint("crank", "base", "crank", "0 0 0", kind, more=crank)
        + _joint("coupler", "crank", "coupler", f"{CRANK} 0 0")
        + _joint(
            "rocker",
            "base",
            "rocker",
            f"{BASE} 0 0",
            "revolute" if "limit" in rocker else "continuous",
            more=rocker,
        )
        + _joint("arm", "coupler", "arm", "0.4 0 0.1", axis="1 0 0")
        + "</robot>"
    )


FOUR_BAR = {
    "name": "bar",
    "a": {"link": "coupler", "xyz": [COUPLER, 0, 0]},
    "b": {"link": "rocker", "xyz": [ROCKER, 0, 0]},
    "type": "revolute",
    "axis": [0, 1, 0],
    "independent": ["crank"],
    "start": {"crank": 0.5, "coupler": -0.8, "rocker": -1.5},
}
"""The loop, of one degree of freedom."""


def four_bar_followers(crank):
    """Return the positions of coupler and rocker, by the law of cosines; a joint turns x toward
    −z.
    """
    pin = CRANK * np.array([np.cos(crank), -np.sin(crank)])
    across = np.array([BASE, 0.0]) - pin
    distance = np.hypot(*across)
    bearing = np.arctan2(-across[1], across[0])
    inside = np.arccos((COUPLER**2 + distance**2 - ROCKER**2) / (2.0 * COUPLER * distance))
    coupler = bearing - inside
    end = pin + COUPLER * np.array([np.cos(coupler), -np.sin(coupler)])
    rocker = np.arctan2(-end[1], end[0] - BASE)
    return np.array([coupler - crank, rocker])


def five_bar(more=""):
    """Return the URDF of two arms on a carrier that meet at their ends, of two degrees of freedom;
    one more element of p2.
    """
    links = ("carrier", "a1", "a2", "b1", "b2")
    return (
        '<robot name="five_bar"><link name="base"/>'
        + "".join(_link(name, 0.5 + 0.2 * k, (0.05, 0.02, 0.1)) for k, name in enumerate(links))
        + _joint("c", "base", "carrier", "0 0 0.3", axis="0 0 1")
        + _joint("p1", "carrier", "a1", "-0.2 0 0")
        + _joint("p2", "a1", "a2", "0 0 0.4", more=more)
        + _joint("r1", "carrier", "b1", "0.2 0 0")
        + _joint("r2", "b1", "b2", "0 0 0.4")
        + "</robot>"
    )


FIVE_BAR = {
    "name": "five",
    "a": {"link": "a2", "xyz": [0.35, 0, 0.35]},
    "b": {"link": "b2", "xyz": [-0.25, 0, 0.35]},
    "independent": ["p1", "r1"],
    "start": {"p1": -0.3, "r1": 0.4},
}
"""The loop, of two degrees of freedom."""


def placed_by_page(tree, q, names):
    """Return the placement of each link as web/src/tree.js computes it."""
    world = []
    for body in tree["bodies"]:
        rest = np.reshape(body["placement"], (4, 4))
        X = np.eye(4)
        if body["kind"] == "revolute":
            angle = body["multiplier"] * q[body["q"]] + body["offset"]
            X[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        world.append((world[body["parent"]] if world else np.eye(4)) @ rest @ X)
    links = zip(names, tree["links"], strict=True)
    return {
        name: world[link["body"]] @ np.reshape(link["placement"], (4, 4)) for name, link in links
    }
