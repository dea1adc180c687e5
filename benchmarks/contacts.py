# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What mobilities and contact cost beside `evaluate`, at one state, in turns.

`python benchmarks/run.py --only contact` in the sourced environment writes contacts.md into results.
"""

from functools import partial
from typing import NamedTuple

import numpy as np
from timing import Ratio, interleaved, ratio

import diag_dynamics as dd
from diag_dynamics.description.catalog import find_urdf

ROBOTS = ("ur5_robot", "panda", "talos_reduced")

TARGET = 2.0
"""Mobilities of all links of Talos by `evaluate`."""


class Costs(NamedTuple):
    """Of one robot: seconds of `evaluate`, and what other calls take of it."""

    links: int
    points: int
    evaluate: float
    mobilities: Ratio
    frames: Ratio
    hulls: Ratio


def compare(short):
    """Costs of each robot; short: of two rounds of one."""
    return {name: measure(name, 2 if short else 51) for name in (ROBOTS[-1:] if short else ROBOTS)}


def measure(name, rounds):
    """Time one robot: mobilities, contact at the links' frames, and over hulls of 64 points a link."""
    path = find_urdf(name)
    model = dd.load_urdf(path)
    dyn, rng = dd.DiagonalDynamics(model), np.random.default_rng(0)
    q, qd = model.random(rng), rng.normal(size=model.nv)
    frames = dd.ContactPoints(model, dd.link_geometry(model, path, "frames").points)
    hulls = dd.ContactPoints(model, dd.link_geometry(model, path, "meshes").points)
    check(dyn, q)
    times = interleaved(
        {
            "evaluate": partial(dyn.evaluate, q, qd, qd),
            "mobilities": partial(dyn.mobilities, q),
            "frames": partial(dyn.contact_limits, q, qd, frames),
            "hulls": partial(dyn.contact_limits, q, qd, hulls),
        },
        rounds,
    )
    over = {
        name: ratio(times[name], times["evaluate"]) for name in ("mobilities", "frames", "hulls")
    }
    return Costs(len(model.link_names), hulls.count, float(np.median(times["evaluate"])), **over)


def check(dyn, q):
    """Nothing is timed that is wrong: each link's mobility is that of the factor of its wrenches."""
    for link, Y in zip(dyn.model.link_names, dyn.mobilities(q), strict=True):
        np.testing.assert_allclose(
            Y, dyn.operational_inverse_inertia(q, link), rtol=0, atol=1e-9 * np.abs(Y).max()
        )


def table(found):
    """The results as lines of text."""
    lines = [
        "| robot | `evaluate` | `mobilities` of all links | `contact`, frames of links | `contact`, hulls of links |",
        "|---|---|---|---|---|",
    ]
    for name, costs in found.items():
        cells = (
            name,
            f"{1e6 * costs.evaluate:.1f} µs",
            f"× {costs.mobilities.median:.2f} ({costs.links} links)",
            f"× {costs.frames.median:.2f}",
            f"× {costs.hulls.median:.1f} ({costs.points} points)",
        )
        lines.append(f"| {' | '.join(cells)} |")
    worst = found["talos_reduced"].mobilities.median
    lines += [
        "",
        f"Target of Talos' mobilities: × {TARGET:g}, {'met' if worst <= TARGET else 'missed'}.",
    ]
    return lines
