# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Positions and rates of links where joint states carry motor positions and spring torques of flexible joints."""

import numpy as np

from diag_dynamics.model.joint_types import places

MAX_GAP = 0.1
"""Interval of states [s] beyond which the rate of a spring torque is unknown."""


class LinkPositions:
    """Converts states in their order: q = θ − δ, q̇ = θ̇ − δ̇, with the stretch δ = (τ_J − d δ̇)/k and δ̇ = τ̇_J/k.

    τ̇_J is the difference to the state before. Without that state δ̇ is 0, without an effort δ is 0, too.
    `has_any` is whether a joint has a motor position and a spring torque.
    """

    def __init__(self, model):
        own = {n: j for n, j in model.flexible_joints.items() if (j.position, j.effort) == ("motor", "spring")}
        self._at, self._dofs = places(own, model.coordinate_names), places(own, model.dof_names)
        self._stiffness = np.array([joint.stiffness for joint in own.values()])
        self._damping = np.array([joint.damping for joint in own.values()])
        self.has_any = bool(own)
        self.forget()

    def forget(self):
        """Start anew, as after a restart of time."""
        self._last = 0, np.full(len(self._at), np.nan)

    def convert(self, stamp, position, velocity, effort, jumped):
        """Return positions and rates of links, (T, nq) and (T, nv).

        Rows are states of stamps [ns]; a row that `jumped` has no state before it.
        """
        if not len(stamp):
            return position, velocity
        torque = effort[:, self._dofs]
        dt = 1e-9 * np.diff(stamp, prepend=self._last[0])[:, None]
        change = np.diff(torque, axis=0, prepend=self._last[1][None])
        follows = (dt > 0.0) & (dt <= MAX_GAP) & ~np.asarray(jumped)[:, None]
        rate = np.nan_to_num(np.divide(change, dt, out=np.zeros_like(change), where=follows)) / self._stiffness
        self._last = int(stamp[-1]), torque[-1]
        position, velocity = position.copy(), velocity.copy()
        position[:, self._at] -= np.nan_to_num(torque / self._stiffness - self._damping * rate / self._stiffness)
        velocity[:, self._dofs] -= rate
        return position, velocity
