# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The mechanisms of examples/closed_loops, each in two poses, drawn from placements of their links."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from style import COLOURS, figure

import diag_dynamics as dd

FOLDER = Path(__file__).parents[2] / "examples" / "closed_loops"
ACROSS = (1, 0, 0), (0, 0, 1)
ROBOTS = {  # other pose by joint; the view, right and up
    "four_bar_gripper": ({"left_crank_joint": 0.35}, ACROSS),
    "delta": (
        {"motor_0": -0.3, "motor_1": 0.3, "motor_2": 0.6},
        ((0.94, -0.34, 0), (0.1, 0.28, 0.95)),
    ),
    "leg": ({"knee": 1.6, "toe_motor": -0.6}, ACROSS),
    "excavator": ({"boom_cylinder": 0.5, "arm_cylinder": 0.65, "bucket_cylinder": 0.6}, ACROSS),
}


def lines(dynamics, urdf, q):
    """Yield lines (n, 3) of each link: from its origin to the joints and closures on it."""
    places = {
        link.get("name"): dynamics.placement(q, link.get("name")) for link in urdf.findall("link")
    }
    beyond = {name: [] for name in places}
    for joint in urdf.findall("joint"):
        beyond[joint.find("parent").get("link")].append(
            places[joint.find("child").get("link")][:3, 3]
        )
    for loop in (loop for group in dynamics.model.loops for loop in group):
        for end in (loop.a, loop.b):
            beyond[end.link].append(places[end.link][:3, :3] @ end.xyz + places[end.link][:3, 3])
    root, *links = beyond
    yield np.array([*beyond[root], beyond[root][0]])
    for name in links:
        yield from (np.array([places[name][:3, 3], point]) for point in beyond[name])


def draw():
    """Return the figure."""
    picture = figure(6.6, 1.9)
    for axes, (name, (other, view)) in zip(
        picture.subplots(1, len(ROBOTS)), ROBOTS.items(), strict=True
    ):
        path, beside = FOLDER / f"{name}.urdf", FOLDER / f"{name}.yaml"
        model = dd.load_urdf(path, loops=beside if beside.exists() else None)
        dynamics, urdf, q = (
            dd.DiagonalDynamics(model),
            ElementTree.parse(path).getroot(),
            model.start,
        )
        for joint, position in other.items():
            q[model.coordinate_names.index(joint)] = position
        for pose, style in (
            (q, {"color": "#b8bfc6", "lw": 1}),
            (model.start, {"color": COLOURS[0], "lw": 2}),
        ):
            for line in lines(dynamics, urdf, pose):
                axes.plot(*np.array(view) @ line.T, solid_capstyle="round", **style)
        axes.set_title(name.replace("four_bar_", "four-bar "))
        axes.set_aspect("equal")
        axes.axis("off")
    return picture
