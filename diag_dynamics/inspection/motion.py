# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of a model in random poses. Each yields fields of remarks."""

from __future__ import annotations

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.inspection.inspected_robot import Found
from diag_dynamics.model import RobotModel

POSES = 200  # extremes are met in about one pose in a hundred

CURRENT_RISE = 1e-3  # rise time of a motor's current and torque, L/R [s]: a millisecond or more
BALANCED = 2.0  # gravity over effort limit up to which springs or counterweights may carry it
OFTEN = 0.05  # fraction of poses beyond which the robot is not merely outstretched


class Motion:
    """A model in reproducible random poses within its limits."""

    def __init__(self, model: RobotModel) -> None:
        rng = np.random.default_rng(0)
        self.model = model
        dynamics = DiagonalDynamics(model)
        Q = np.array([model.random(rng) for _ in range(POSES)])
        velocity = np.nan_to_num(model.velocity_limit, posinf=0.0)
        signs = np.random.default_rng(1).choice([-1.0, 1.0], (POSES, model.nv))
        QD = signs * velocity
        # A limit of 1e308 is an energy of inf here, and an error of evaluate.
        energy = 0.5 * np.einsum("ti,tij,tj->t", QD, dynamics.mass_matrix(Q), QD)
        self.D = dynamics.evaluate(Q, np.zeros_like(QD)).articulated_inertia
        self.largest_energy = float(np.max(energy))
        self.gravity_torque = dynamics.gravity_torque(Q)


def rotor_inertia(motion: Motion) -> Found:
    """Find joints without a rotor's inertia: their time to the velocity limit is no drive's."""
    model = motion.model
    D = motion.D.max(axis=0)
    times = D * model.velocity_limit / model.effort_limit
    for name, time in zip(model.dof_names, times, strict=True):
        if 0.0 < time < CURRENT_RISE:
            yield "quick", name, 1e3 * time


def gravity(motion: Motion) -> Found:
    """Find gravity torques beyond the effort limit; a floating base is held here."""
    columns = motion.model.dof_names, motion.model.effort_limit, np.abs(motion.gravity_torque).T
    for name, limit, load in zip(*columns, strict=True):
        if 0.0 < limit < load.max():
            heavy = load.max() > BALANCED * limit and (load > limit).mean() > OFTEN
            yield "heavy" if heavy else "balanced", name, load.max() / limit
