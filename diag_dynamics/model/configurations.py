# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Configurations of a robot: random ones, those reached along a velocity, and what lies between two."""

import math

import numpy as np

from diag_dynamics.checks import vector
from diag_dynamics.exceptions import InputError
from diag_dynamics.sweeps import configuration, joints
from diag_dynamics.sweeps.spatial import ANGULAR_X

REACH = 1.0
"""Position coordinates without limits are drawn within this distance of zero [m]; angles within a turn."""


def random_positions(model, rng):
    """Return positions drawn evenly within the limits, orientations evenly of all."""
    if not isinstance(rng, np.random.Generator):
        try:
            rng = np.random.default_rng(rng)
        except (TypeError, ValueError) as error:
            raise InputError(f"rng is {rng!r}, expected a numpy.random.Generator or a seed.") from error
    free = np.where(_angles(model), math.pi, REACH)
    lower = np.where(np.isfinite(model.lower), model.lower, -free)
    upper = np.where(np.isfinite(model.upper), model.upper, free)
    # With one limit alone, the range begins or ends there.
    lower = np.where(np.isfinite(model.lower) | ~np.isfinite(model.upper), lower, upper - 2.0 * free)
    upper = np.where(np.isfinite(model.upper) | ~np.isfinite(model.lower), upper, lower + 2.0 * free)
    q = rng.uniform(lower, upper)
    for k, component in enumerate(model.orientations):
        if component == 3:
            quaternion = rng.normal(size=4)
            q[k - 3 : k + 1] = quaternion / np.linalg.norm(quaternion)
    return q


def integrated(model, q, v):
    """Return the positions reached from q along v."""
    result = np.empty(model.nq)
    q, v = positions(model, "q", q), vector("v", v, model.dof_names)
    own = model.workspace  # referenced while the sweep runs, which has its address only
    _check(configuration.integrate(own.robot, q, v, result), "q and v")
    return result


def difference(model, q0, q1):
    """Return the v that leads from q0 to q1."""
    v = np.empty(model.nv)
    q0, q1 = positions(model, "q0", q0), positions(model, "q1", q1)
    own = model.workspace
    _check(configuration.difference(own.robot, q0, q1, _turning(model), v), "q0 and q1")
    return v


def positions(model, name, q):
    """Return positions as a new array; each quaternion has length 1."""
    q = vector(name, q, model.coordinate_names)
    for k, component in enumerate(model.orientations):
        quaternion = q[k - 3 : k + 1]
        if component == 3 and abs(quaternion @ quaternion - 1.0) >= joints.UNIT_TOLERANCE:
            raise InputError(
                f"{name} of joint '{model.coordinate_names[k].rpartition('/')[0]}' has the quaternion {quaternion.tolist()} "
                "(x, y, z, w), expected one of length 1."
            )
    return q


def _check(status, what):
    if status:
        raise InputError(f"{what} are too large: a result overflows.")


def _angles(model):
    """Return whether each position coordinate is an angle."""
    angles = np.array([name.endswith("/theta") for name in model.coordinate_names], dtype=bool)
    bodies = model.bodies
    leads = bodies["leader"] == np.arange(len(bodies))  # a mimic joint has its leader's q
    single = bodies[(bodies["dofs"] == 1) & leads]
    angles[single["q"][single["direction"] >= ANGULAR_X]] = True
    return angles


def _turning(model):
    """Return 1 for each continuous joint that leads no other one: a whole turn of it is no motion."""
    turning = set(model.continuous_joints) - {mimic.leader for mimic in model.mimics.values()}
    return np.array([1.0 if name in turning else 0.0 for name in model.dof_names])
