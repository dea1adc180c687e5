# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Closed loops and non-linear mimic joints in elements of a URDF.

`<loop_joint>` is that of Isaac Sim, `<constraint>` the one proposed to urdfdom_headers (pull
request 108). Elements `<start joint position>` and `<independent joint>` in them, and the attribute
`polynomial` of `<mimic>`, which replaces multiplier and offset, belong to this package.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from diag_dynamics import rotations
from diag_dynamics.description.elements import floats, numbers_of, placement_of, short
from diag_dynamics.description.records import Curve, Loop, LoopEnd
from diag_dynamics.exceptions import UrdfError

TYPES = {
    "spherical": "point",
    "ball": "point",
    "revolute": "revolute",
    "continuous": "revolute",
    "fixed": "weld",
}

# Tags of the link, the frame and the axis at both ends, by element
ENDS = {
    "loop_joint": (("link1", "link1", "axis"), ("link2", "link2", "axis")),
    "constraint": (
        ("parent", "parent_origin", "parent_axis"),
        ("child", "child_origin", "child_axis"),
    ),
}


def loops_of(robot: Any) -> tuple[Loop, ...]:
    """Return the closed loops of a parsed `<robot>` element."""
    elements = [element for tag in ENDS for element in robot.findall(tag)]
    loops = tuple(_loop(element, f"{element.tag}{k}") for k, element in enumerate(elements))
    for k, loop in enumerate(loops):
        if loop.name in [earlier.name for earlier in loops[:k]]:
            raise UrdfError(f"Two loops have the name '{loop.name}'.")
    return loops


def curves_of(robot: Any) -> dict[str, Curve]:
    """Return the mimic joints with a `polynomial`.

    It has the coefficients of their positions, the constant first.
    """
    curves = {}
    for joint in robot.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None and (text := mimic.get("polynomial")) is not None:
            values = floats(text, len(text.split()))
            if not values:
                shown = f"joint {short(joint.get('name'))}: <mimic polynomial={short(text)}>"
                raise UrdfError(f"{shown} is not finite numbers.")
            curves[joint.get("name")] = Curve(mimic.get("joint"), np.array([[0.0, *values]]))
    return curves


def _loop(element: Any, name: str) -> Loop:
    shown = (
        f"<{element.tag} name={short(element.get('name'))}>"
        if element.get("name")
        else f"<{element.tag}>"
    )
    kind = element.get("type")
    if kind not in TYPES:
        raise UrdfError(
            f"{shown} is not supported: its type is {kind!r}, expected one of {', '.join(TYPES)}."
        )
    ends, axes = [], []
    for tag, origin, axis in ENDS[element.tag]:
        link, frame, along = element.find(tag), element.find(origin), element.find(axis)
        if link is None or link.get("link") is None:
            raise UrdfError(f"{shown} is not supported: it lacks <{tag} link=…>.")
        place = np.eye(4) if frame is None else placement_of(frame, shown)
        numbers = [1.0, 0.0, 0.0] if along is None else numbers_of(along, "xyz", 3, shown)
        axes.append(np.array(numbers))
        if not np.linalg.norm(axes[-1]) > 0.0:
            raise UrdfError(f"{shown}: <{axis}> has no direction.")
        turn = place[:3, :3] @ rotations.frame_about(axes[-1]) @ rotations.frame_about(axes[0]).T
        ends.append(LoopEnd(link.get("link"), tuple(place[:3, 3].tolist()), rotations.to_rpy(turn)))
    start = {
        part.get("joint"): numbers_of(part, "position", 1, shown)[0]
        for part in element.findall("start")
    }
    independent = tuple(part.get("joint") for part in element.findall("independent"))
    first, second = ends
    name, kind = element.get("name", name), TYPES[kind]
    return Loop(name, first, second, kind, tuple(axes[0].tolist()), independent, start)
