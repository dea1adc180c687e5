# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots whose dynamics are known by hand, in the library and in the oracles."""

import re
from pathlib import Path

import numpy as np
import pytest

import diag_dynamics as dd
import robots
from accuracy import norm
from derivative_oracles import link_placement
from oracles import Oracle
from robots import description, joint, link

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

# --- the oracles


@pytest.mark.parametrize("name", ["oracles", "robots", "coupling", "derivative_oracles"])
def test_oracles_share_no_code_with_the_library(name):
    """An oracle that shared code with the library would share its mistakes."""
    source = (Path(robots.__file__).parent / f"{name}.py").read_text(encoding="utf-8")
    assert not re.search(r"^\s*(from|import) diag_dynamics", source, re.M)


# --- closed forms, of the library and of the oracle


# --- rates of change and operational space


@pytest.mark.parametrize("frame", ["link", "world"])
@pytest.mark.parametrize("kind", ["prismatic", "revolute"])
def test_reflected_mass_beside_a_crooked_joint(kind, frame):
    """∞ across a slide and along lines through a hinge's axis: rounding is no motion. A push 10⁻⁶
    beside is finite.
    """
    for seed in range(20):
        rng = np.random.default_rng(seed)
        axis = rng.standard_normal(3)
        rpy = rng.uniform(-3, 3, 3)
        head = link("head", 2.5, (0.1, 0, 0), (0.1, 0, 0, 0.1, 0, 0.1))
        urdf = description(
            kind,
            link("base"),
            head,
            joint("only", kind, "base", "head", axis, (0.3, 0.1, 0.2), rpy),
        )
        axis = axis / norm(axis)
        q = rng.uniform(-2, 2, 1)
        point = rng.standard_normal(3)
        dyn = dd.DiagonalDynamics(dd.load_urdf(urdf))
        R = link_placement(Oracle(urdf), q, "head").rotation if frame == "world" else np.eye(3)
        if kind == "prismatic":
            stuck = np.cross(axis, rng.standard_normal(3))
            free = axis
            mass = 2.5
        else:
            stuck = rng.standard_normal() * axis - point
            free = np.cross(axis, point)  # stuck: towards the axis
            mass = dyn.evaluate(q, [0.0]).articulated_inertia[0] / (free @ free)
        stuck = stuck / norm(stuck)
        free = free / norm(free)
        nearly = dyn.reflected_mass(q, "head", R @ (stuck + 1e-6 * free), point, frame=frame)
        assert nearly == pytest.approx(1e12 * mass, rel=1e-8)
        assert dyn.reflected_mass(q, "head", R @ stuck, point, frame=frame) == np.inf
