# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start states of a robot, and its potential energy."""

import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.checks import numbers


def rest_position(model):
    """Zero, or the middle of a joint's limits where zero lies outside them; [rad, m], shape (nq,)."""
    lower, upper = np.maximum(model.lower, -1e6), np.minimum(model.upper, 1e6)
    outside = (lower > 0.0) | (upper < 0.0)
    return np.where(outside, 0.5 * (lower + upper), model.neutral)


def potential_energy(model, q):
    """Energy of the robot in the field of gravity at q [J]: −g·Σ m_i c_i in the world's axes, q of shape (nq,)."""
    own, moment = sweeps.Workspace(model.bodies, model.gravity), np.zeros(3)
    q = numbers("q", q, (model.nq,), f"{model.nq} finite numbers")
    sweeps.first_moment(own.robot, q, moment)
    return -float(model.gravity @ moment)


def with_unit_quaternions(model, q):
    """Copy of q with quaternions scaled to unit length."""
    q = np.array(q, dtype=float)
    for k, component in enumerate(model.orientations):
        if component == 3:
            q[k - 3 : k + 1] /= np.linalg.norm(q[k - 3 : k + 1])
    return q
