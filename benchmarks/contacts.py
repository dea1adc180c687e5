# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What contact costs beside `evaluate`, at one state, in turns.

`python benchmarks/run.py --only contact` in the sourced environment writes contacts.md into results.
"""

from functools import partial
from typing import NamedTuple

import numpy as np
from timing import Ratio, interleaved, ratio

import diag_dynamics as dd
from diag_dynamics.description.catalog import find_urdf

ROBOTS = ("ur5_robot", "panda", "talos_reduced")


class Costs(NamedTuple):
    """Of one robot: seconds of `evaluate`, and what other calls take of it."""

    links: int
    points: int
    evaluate: float
    frames: Ratio
    hulls: Ratio


def compare(short):
    """Costs of each robot; short: of two rounds of one."""
    return {name: measure(name, 2 if short else 51) for name in (ROBOTS[-1:] if short else ROBOTS)}


def measure(name, rounds):
    """Time one robot: contact at the links' frames, and over hulls of 64 points a link."""
    path = find_urdf(name)
    model = dd.load_urdf(path)
    dyn, rng = dd.DiagonalDynamics(model), np.random.default_rng(0)
    q, qd = model.random(rng), rng.normal(size=model.nv)
    frames = dd.ContactPoints(model, dd.link_geometry(model, path, "frames").points)
    hulls = dd.ContactPoints(model, dd.link_geometry(model, path, "meshes").points)
    check(dyn, q, qd, frames)
    times = interleaved(
        {
            "evaluate": partial(dyn.evaluate, q, qd, qd),
            "frames": partial(dyn.contact_limits, q, qd, frames),
            "hulls": partial(dyn.contact_limits, q, qd, hulls),
        },
        rounds,
    )
    over = {name: ratio(times[name], times["evaluate"]) for name in ("frames", "hulls")}
    return Costs(len(model.link_names), hulls.count, float(np.median(times["evaluate"])), **over)


def check(dyn, q, qd, frames):
    """Nothing is timed that is wrong: each mass is that of the factor of the wrenches of its point."""
    contact = dyn.contact_limits(q, qd, frames)
    for k, link in enumerate(contact.links):
        v = dyn.link_velocity(q, link, qd, frames.points[k][contact.point[k]])[:3]
        mass = dyn.reflected_mass(q, link, v, frames.points[k][contact.point[k]])
        np.testing.assert_allclose(contact.reflected_mass[k], mass, rtol=1e-6)


def table(found):
    """The results as lines of text."""
    lines = [
        "| robot | `evaluate` | `contact`, frames of links | `contact`, hulls of links |",
        "|---|---|---|---|",
    ]
    for name, costs in found.items():
        cells = (
            name,
            f"{1e6 * costs.evaluate:.1f} µs",
            f"× {costs.frames.median:.2f} ({costs.links} links)",
            f"× {costs.hulls.median:.1f} ({costs.points} points)",
        )
        lines.append(f"| {' | '.join(cells)} |")
    return lines
