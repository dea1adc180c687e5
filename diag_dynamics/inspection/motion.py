# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of a model in random poses. Each yields fields of remarks."""

from __future__ import annotations

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.inspection.urdf import Found
from diag_dynamics.model import RobotModel

POSES = 200  # extremes are met in about one pose in a hundred
TIP_POSES = 50  # poses for reflected masses: a robot may have fifty tips

CURRENT_RISE = 1e-3  # rise time of a motor's current and torque, L/R [s]: a millisecond or more
BALANCED = 2.0  # gravity over effort limit up to which springs or counterweights may carry it
OFTEN = 0.05  # fraction of poses beyond which the robot is not merely outstretched
LOST_DIGITS = 1e8  # condition number that leaves accelerations half of their 16 digits
SPEED = 50.0  # mean speed that no robot's mass has [m/s]; tips of the fastest arms have 10


class Motion:
    """A model in reproducible random poses within its limits."""

    def __init__(self, model: RobotModel) -> None:
        rng = np.random.default_rng(0)
        self.model = model
        self._dynamics = DiagonalDynamics(model)
        self._Q = np.array([model.random(rng) for _ in range(POSES)])
        still = np.zeros((POSES, model.nv))
        self.D = self._dynamics.evaluate(self._Q, still).articulated_inertia
        self.M = self._dynamics.mass_matrix(self._Q)
        self.gravity_torque = self._dynamics.gravity_torque(self._Q)
        self.condition: Array = np.linalg.cond(self.M)
        self.velocity_limit = np.nan_to_num(model.velocity_limit, posinf=0.0)
        QD = np.random.default_rng(1).choice([-1.0, 1.0], still.shape) * self.velocity_limit
        self.energy_at_limits = 0.5 * np.einsum("ti,tij,tj->t", QD, self.M, QD)

    def reflected_mass(self, link: str) -> Array:
        """Return the smallest mass that a push on a link's origin meets in each pose [kg]."""
        inverse = self._dynamics.operational_inverse_inertia
        inverses = [inverse(q, link)[:3, :3] for q in self._Q[:TIP_POSES]]
        return np.asarray(1.0 / np.linalg.eigvalsh(inverses)[:, -1], dtype=np.float64)


def too_quick(model: RobotModel, D: Array) -> dict[str, float]:
    """Return joints whose time D q̇_max/τ_max [s] is below :data:`CURRENT_RISE`.

    D is (poses, nv).
    """
    times = zip(
        model.dof_names, D.max(axis=0), model.velocity_limit, model.effort_limit, strict=True
    )
    limited = [
        (name, d * speed / effort) for name, d, speed, effort in times if 0.0 < effort < np.inf
    ]
    return {name: float(time) for name, time in limited if 0.0 < time < CURRENT_RISE}


def rotor_inertia(motion: Motion) -> Found:
    """Find joints without a rotor's inertia: their time to the velocity limit is no drive's."""
    for name, time in too_quick(motion.model, motion.D).items():
        yield "quick", name, 1e3 * time


def gravity(motion: Motion) -> Found:
    """Find gravity torques beyond the effort limit; a floating base is held here."""
    columns = motion.model.dof_names, motion.model.effort_limit, np.abs(motion.gravity_torque).T
    for name, limit, load in zip(*columns, strict=True):
        if 0.0 < limit < load.max():
            heavy = load.max() > BALANCED * limit and (load > limit).mean() > OFTEN
            yield "heavy" if heavy else "balanced", name, load.max() / limit


def conditioning(motion: Motion) -> Found:
    """Find a condition number of M that costs accelerations half of their digits."""
    worst = float(motion.condition.max())
    smallest = motion.D.min(axis=0)
    digits = max(16.0 - np.log10(worst), 0.0)
    for k in np.argsort(smallest)[:3] if worst > LOST_DIGITS else ():
        row = "few digits" if digits > 4.0 else "no digits"
        yield row, motion.model.dof_names[k], smallest[k], (worst, digits)


def kinetic_energy(motion: Motion) -> Found:
    """Find velocity limits at which the mass has a mean speed √(2K/m) that no robot has."""
    limit = motion.velocity_limit
    mass = motion.model.total_mass
    speed = np.sqrt(2.0 * motion.energy_at_limits.max() / mass) if mass > 0.0 else 0.0
    alone = 0.5 * np.einsum("tkk->tk", motion.M).max(axis=0) * limit**2
    for k in np.argsort(-alone)[:3] if speed > SPEED else ():
        yield "rapid", motion.model.dof_names[k], limit[k], (speed,)
