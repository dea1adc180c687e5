# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots with random errors of their inertias, like those of a URDF."""

import numpy as np

from diag_dynamics.description.description import Link, Payload
from diag_dynamics.model.robot import build


def perturbed(model, part, seed=0):
    """Return a model whose masses, centres in radii of gyration and lengths are wrong.

    `part` is the largest relative error; of lengths it is half of that. Rigid bodies stay such.
    """
    rng = np.random.default_rng(seed)
    links = dict(model.description.links)
    for name, link in links.items():
        if link.inertial is None or not link.inertial.mass:
            continue
        body = link.inertial.body
        # second moments: inertia is their trace less their matrix
        moments = 0.5 * np.trace(body.inertia) * np.eye(3) - body.inertia
        heavier = 1.0 + part * rng.uniform(-1.0, 1.0)
        radius = np.sqrt(max(np.trace(moments), 0.0) / body.mass)
        centre = body.centre + part * radius * rng.uniform(-1.0, 1.0, 3) / np.sqrt(3.0)
        random = rng.uniform(-1.0, 1.0, (3, 3))
        stretch = np.eye(3) + 0.25 * part * (random + random.T)
        moments = heavier * stretch @ moments @ stretch
        inertia = np.trace(moments) * np.eye(3) - moments
        links[name] = Link(name, Payload(heavier * body.mass, centre, inertia).inertial)
    return build(model.description._replace(links=links, held={}))
