# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot as sweeps take it, and memory for them to work in."""

import numpy as np

from diag_dynamics.numerics.tables import Addresses
from diag_dynamics.sweeps import group_steps, records
from diag_dynamics.sweeps import workspace as ws
from diag_dynamics.sweeps.couplings import Couplings


class Workspace:
    """A robot, as sweeps take it, and memory for them to work in: one for each thread.

    Attributes
    ----------
    robot : int
        Address of a table as :data:`workspace.ROBOT` has it: one argument, because more would cost
        as much as the arithmetic of a small robot. Keep the Workspace while a sweep runs.
    bodies, gravity, work, table : ndarray
        Those of the table.
    """

    def __init__(self, bodies, gravity, couplings=None):
        # Bodies that own their degree of freedom: leaders, not followers.
        moving = bodies[1:]
        body = np.arange(1, len(bodies))
        own = moving["leader"] == body
        grouped = own & (moving["last"] > moving["first"])
        nv = int(own.sum())
        # Rows of 𝓜 and 𝓜̇ have an entry for each degree of freedom of the largest group.
        widest = int(np.bincount(moving["first"][grouped]).max(initial=1))
        # Followers have the positions of their leaders: the largest end counts.
        nq = max(
            (int(body["q"]) + records.POSITIONS_OF[int(body["kind"])] for body in moving), default=0
        )
        self.bodies = np.ascontiguousarray(bodies)
        self.gravity = np.ascontiguousarray(gravity, dtype=np.float64)
        self.work = np.zeros(len(bodies), records.WORK)
        self.table = np.zeros((2, nv, widest))
        # Constant ratios of followers; couplings overwrite those that change.
        for name in ("multiplier", "offset"):
            self.work[name] = bodies[name]
        self.couplings = couplings and Couplings(self.bodies, self.work, nq, nv, couplings)
        lanes = np.zeros(len(bodies), records.LANES)
        self._coupling_tables = couplings
        self._addresses = Addresses(
            ws.ROBOT,
            bodies=self.bodies,
            gravity=self.gravity,
            work=self.work,
            table=self.table,
            nv=nv,
            nq=nq,
            scratch=np.zeros((ws.N_ROWS, max(1, nv))),
            # `work`, and `lanes` below, as matrices of numbers with a row for each body
            numbers=self.work.view(np.float64).reshape(len(bodies), -1),
            lanes=lanes,
            rows=lanes.view(np.float64).reshape(len(bodies), -1),
            group_steps=group_steps.ADDRESSES,
        )
        self.robot = self._addresses.at

    def __reduce__(self):
        # Addresses would be those of the original.
        return type(self), (
            self.bodies,
            self.gravity,
            self._coupling_tables,
        )
