# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a robot's model says of its motion, measured in random poses within its limits."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.model import RobotModel

POSES = 200
"""Number of random poses: extremes over them are met in one pose in a hundred or so."""

ENTRIES = 4_000_000
"""Most entries of all mass matrices: of more than 141 degrees of freedom there are fewer poses, but ten at least."""

TIP_POSES = 50
"""Of these, poses in which the mass at tips is measured: there may be fifty tips."""


class Motion:
    """Quantities of a model in many poses, each computed when it is asked for.

    Attributes
    ----------
    poses : int
        Their number.
    Q : ndarray, shape (poses, nq)
        Positions, the same each time.
    """

    def __init__(self, model: RobotModel) -> None:
        rng = np.random.default_rng(0)
        self.model, self._dynamics = model, DiagonalDynamics(model)
        self.poses = max(10, min(POSES, ENTRIES // model.nv**2))
        self.Q = np.array([model.random(rng) for _ in range(self.poses)])

    @cached_property
    def D(self) -> Array:
        """Articulated inertias [kg m², kg], shape (poses, nv)."""
        return self._dynamics.evaluate_batch(self.Q, np.zeros((self.poses, self.model.nv))).articulated_inertia

    @cached_property
    def gravity_torque(self) -> Array:
        """[N m, N], shape (poses, nv)."""
        return self._dynamics.gravity_torque_batch(self.Q)

    @cached_property
    def M(self) -> Array:
        """Mass matrices, shape (poses, nv, nv)."""
        return self._dynamics.mass_matrix_batch(self.Q)

    @cached_property
    def condition(self) -> Array:
        """Condition numbers of M in SI units, shape (poses,)."""
        return np.linalg.cond(self.M)

    @cached_property
    def energy_at_limits(self) -> Array:
        """Kinetic energy with every joint at its velocity limit, either way, shape (poses,) [J]; those without limit rest."""
        limit = self.model.velocity_limit
        signs = np.random.default_rng(1).choice([-1.0, 1.0], (self.poses, self.model.nv))
        QD = signs * np.where(np.isfinite(limit), limit, 0.0)
        return 0.5 * np.einsum("ti,tij,tj->t", QD, self.M, QD)

    def reflected_mass(self, link: str) -> Array:
        """Least mass, over directions, that a push on a link's origin meets in each of up to TIP_POSES poses [kg]."""
        inverses = np.array([self._dynamics.operational_inverse_inertia(q, link)[:3, :3] for q in self.Q[:TIP_POSES]])
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / np.linalg.eigvalsh(inverses)[:, -1], dtype=np.float64)
