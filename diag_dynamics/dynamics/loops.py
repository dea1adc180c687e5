# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How far measured rates are from closing the loops of a robot, by energy."""

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.dynamics.dynamics import DiagonalDynamics
from diag_dynamics.model import RobotModel
from diag_dynamics.model.followers import FollowerMotion, FollowerState


class LoopBalance:
    """Energy by which rates break loops.

    It is the least ½|mᵀ(q̇ − N x)|² of the cut tree over rates N x with a closed group.

    N has a column for each joint that does not follow others in the group, with G of those that do.
    For one thread.
    """

    def __init__(self, model: RobotModel) -> None:
        self._model = model
        self._motion = FollowerMotion(model)
        self._cut = DiagonalDynamics(model.cut_tree())

    def energies(self, q: Array, qd: Array, rates: Array) -> tuple[dict[str, float], FollowerState]:
        """Return the energy [J] by the loops of each group, and the FollowerState.

        Raise LoopError where a loop cannot be closed.

        `q` and `qd` are of the model, `rates` (f,) [rad/s, m/s] are measured ones of followers, NaN
        for unknown ones.
        """
        model = self._model
        cut = self._cut.model
        now = self._motion.at(q, qd)
        rates = np.where(np.isfinite(rates), rates, now.rate)
        position = dict(
            zip((*model.coordinate_names, *now.names), (*q, *now.position), strict=True)
        )
        rate = dict(zip((*model.dof_names, *now.names), (*qd, *rates), strict=True))
        q = np.array([position[name] for name in cut.coordinate_names])
        factor = np.asarray(np.linalg.cholesky(self._cut.mass_matrix(q)).T, dtype=float)
        nu = factor @ np.array([rate[name] for name in cut.dof_names])
        energies = {}
        for loops, joints in zip(model.loops, model.loop_joints, strict=True):
            closed = factor @ self._closed_rates(now, set(joints))
            apart = nu - closed @ np.linalg.lstsq(closed, nu)[0]
            energies[", ".join(loop.name for loop in loops)] = 0.5 * float(apart @ apart)
        return energies, now

    def _closed_rates(self, now: FollowerState, joints: set[str]) -> Array:
        """Return N of a group of joints."""
        place = {name: k for k, name in enumerate(self._cut.model.dof_names)}
        N = np.eye(len(place))
        independent = [place[name] for name in self._model.dof_names]
        followers = [name in joints for name in now.names]
        rows = [place[name] for name in now.names if name in joints]
        N[np.ix_(rows, independent)] = now.ratios[followers]
        return np.delete(N, rows, axis=1)
