# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How far measured rates are from closing the loops of a robot, by energy."""

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.dynamics.dynamics import DiagonalDynamics
from diag_dynamics.model import RobotModel
from diag_dynamics.model.followers import FollowerMotion, FollowerState
from diag_dynamics.model.loops import Loop

DEPENDENT = 1e-7
"""Singular value of a loop's equations, by the largest, below which they depend on each other."""


class LoopBalance:
    """Energy by which rates break loops: ½|Qᵀν|² with ν of the cut tree and an orthonormal basis Q of ℓJᵀ, J = ∂φ/∂q.

    ν − QQᵀν are the rates with a closed loop that are nearest by energy. For one thread.
    """

    def __init__(self, model: RobotModel) -> None:
        self._model, self._motion = model, FollowerMotion(model)
        self._cut = DiagonalDynamics(model.cut_tree())

    def energies(self, q: Array, qd: Array, rates: Array) -> tuple[dict[str, float], FollowerState]:
        """Return the energy [J] by the name of each loop, and the FollowerState; LoopError where one cannot be closed.

        `q` and `qd` are of the model, `rates` (f,) [rad/s, m/s] are measured ones of followers, NaN for unknown ones.
        """
        model, cut, now = self._model, self._cut.model, self._motion.at(q, qd)
        rates = np.where(np.isfinite(rates), rates, now.rate)
        position = dict(zip((*model.coordinate_names, *now.names), (*q, *now.position), strict=True))
        rate = dict(zip((*model.dof_names, *now.names), (*qd, *rates), strict=True))
        q = np.array([position[name] for name in cut.coordinate_names])
        factor = np.asarray(np.linalg.cholesky(self._cut.mass_matrix(q)), dtype=float)
        nu = np.array([rate[name] for name in cut.dof_names]) @ factor
        return {loop.name: self._energy(loop, q, factor, nu) for group in model.loops for loop in group}, now

    def _energy(self, loop: Loop, q: Array, factor: Array, nu: Array) -> float:
        """Return the energy of a loop; `factor` is one of M, with which ν is factorᵀq̇."""
        ends = zip(*loop.points, strict=True)
        a, b = (
            [self._cut.jacobian(q, end.link, point, frame="world")[:3] for point in points]
            for end, points in zip((loop.a, loop.b), ends, strict=True)
        )
        Q, values, _ = np.linalg.svd(np.linalg.solve(factor, np.vstack(a).T - np.vstack(b).T), full_matrices=False)
        share = nu @ Q[:, values > DEPENDENT * values[0]]
        return 0.5 * float(share @ share)
