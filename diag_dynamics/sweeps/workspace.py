# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Memory that sweeps work in, and the addresses by which they find it."""

import numpy as np

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.numerics.tables import Addresses, Table, array
from diag_dynamics.sweeps import records
from diag_dynamics.sweeps.couplings import Couplings

NU, XI, EPSILON, KAPPA, CORIOLIS, CORIOLIS_UNNORMALIZED, GRAVITY = range(7)
ARTICULATED_INERTIA, ARTICULATED_INERTIA_RATE, ENERGY_SHARE, NU_DOT, XI_DOT = range(7, 12)
KINETIC_ENERGY, BASE_ENERGY, EFFORT_POWER, POWER, N_SWEPT = range(12, 17)
POSITIONS, RATES, N_ROWS = range(16, 19)
"""Rows that evaluation.evaluate fills.

A batch keeps those before ENERGY_SHARE. From KINETIC_ENERGY on rows have a first entry only: K, the share of the first
six total rates in it, and νᵀ(ε − ε_g) twice. The last two receive q and q̇ of a single state.
"""

N_NUMBERS = N_SWEPT - KINETIC_ENERGY
"""Count of rows with a first entry only."""

WIDTH, N_RESULTS = records.WIDTH, records.N_RESULTS

BAD_LENGTH = -2
"""Status of a sweep: a vector has not the robot's length."""

ROBOT = Table(
    "Robot",
    bodies=array(records.BODY),  # of RobotModel
    gravity=array(float),  # acceleration [m/s²]
    work=array(records.WORK),
    table=array(float, 3),  # matrices 𝓜 and 𝓜̇ of groups, see groups
    nv=int,
    nq=int,
    scratch=array(float, 2),  # N_SWEPT vectors
    numbers=array(float, 2),  # the memory of `work`
    lanes=array(records.LANES),  # WIDTH states, see batch
    rows=array(float, 2),  # the memory of `lanes`
)
"""The robot, and memory to work in, by the address of this table."""


class Workspace:
    """A robot, as sweeps take it, and memory for them to work in: one for each thread.

    Attributes
    ----------
    robot : int
        Address of a table as :data:`ROBOT` has it: one argument, because more would cost as much as the arithmetic of a
        small robot. Keep the Workspace while a sweep runs.
    bodies, gravity, work, table : ndarray
        Those of the table.
    """

    def __init__(self, bodies, gravity, couplings=None):
        moving, body = bodies[1:], np.arange(1, len(bodies))
        own = moving["leader"] == body
        grouped = own & (moving["last"] > moving["first"])
        nv, widest = int(own.sum()), int(np.bincount(moving["first"][grouped]).max(initial=1))
        nq = max(
            (int(body["q"]) + records.POSITIONS_OF[int(body["kind"])] for body in moving), default=0
        )
        self.bodies, self.gravity = (
            np.ascontiguousarray(bodies),
            np.ascontiguousarray(gravity, dtype=np.float64),
        )
        self.work, self.table = np.zeros(len(bodies), records.WORK), np.zeros((2, nv, widest))
        for name in ("multiplier", "offset"):
            self.work[name] = bodies[name]
        self.couplings = couplings and Couplings(self.bodies, self.work, nq, nv, couplings)
        lanes = np.zeros(len(bodies), records.LANES)
        self._tables = couplings
        self._addresses = Addresses(
            ROBOT,
            bodies=self.bodies,
            gravity=self.gravity,
            work=self.work,
            table=self.table,
            nv=nv,
            nq=nq,
            scratch=np.zeros((N_SWEPT, max(1, nv))),
            numbers=self.work.view(np.float64).reshape(len(bodies), -1),
            lanes=lanes,
            rows=lanes.view(np.float64).reshape(len(bodies), -1),
        )
        self.robot = self._addresses.at

    def __reduce__(self):
        return type(self), (
            self.bodies,
            self.gravity,
            self._tables,
        )  # addresses would be those of the original


robot_of = ROBOT.opened
"""Kernel (address) that returns the table as a named tuple."""


@nk.kernel
def opened(robot):
    """`bodies`, `gravity`, `work` and `table` of a :class:`Workspace`."""
    at = robot_of(robot)
    return at.bodies, at.gravity, at.work, at.table


@nk.kernel
def lengths_match(robot, q, qd, tau):
    """Whether vectors have the robot's lengths."""
    at = robot_of(robot)
    return len(q) == at.nq and len(qd) == at.nv and len(tau) == at.nv


@nk.kernel
def positions_match(robot, q):
    """Whether q has as many entries as the robot has position coordinates."""
    return len(q) == robot_of(robot).nq


@nk.kernel
def copy(source, target):
    """target[:] = source, without a look at whether they overlap."""
    for k in range(len(source)):
        target[k] = source[k]


@nk.kernel
def clear(target):
    """target[:] = 0.0, which numba takes a second to compile."""
    for k in range(len(target)):
        target[k] = 0.0
