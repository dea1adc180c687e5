# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Table of the memory that sweeps work in, by whose address they find it: see memory."""

import numpy as np

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.numerics.callback import call_address
from diag_dynamics.numerics.tables import Table, array
from diag_dynamics.sweeps import records

# ν, ξ, ε, κ, C, C_ξ and ε_g; D, Ḋ and ½ν_k² of each degree of freedom; three sums; q, q̇.
NU, XI, EPSILON, KAPPA, CORIOLIS, CORIOLIS_UNNORMALIZED, GRAVITY = range(7)
ARTICULATED_INERTIA, ARTICULATED_INERTIA_RATE, ENERGY_SHARE = range(7, 10)
KINETIC_ENERGY, BASE_ENERGY, EFFORT_POWER, N_SWEPT = range(10, 14)
POSITIONS, RATES, N_ROWS = range(13, 16)
"""Rows that evaluation.evaluate fills.

A batch keeps those before ENERGY_SHARE. From KINETIC_ENERGY on rows have a first entry only: K, the
share of the first six total rates in it, and νᵀ(ε − ε_g). The last two receive q and q̇ of a single
state.
"""

N_NUMBERS = N_SWEPT - KINETIC_ENERGY
"""Count of rows with a first entry only."""

WIDTH, N_RESULTS = records.WIDTH, records.N_RESULTS

BAD_LENGTH = -2
"""Status of a sweep: a vector has not the robot's length."""

ROBOT = Table(
    "Robot",
    # Constants of the robot, and memory that sweeps overwrite
    bodies=array(records.BODY),  # of RobotModel
    gravity=array(float),  # acceleration [m/s²]
    work=array(records.WORK),
    table=array(float, 3),  # matrices 𝓜 and 𝓜̇ of groups, see groups
    nv=int,
    nq=int,
    scratch=array(float, 2),  # N_ROWS vectors
    # Memory of batches, and steps that are called by address
    numbers=array(float, 2),  # the memory of `work`
    lanes=array(records.LANES),  # WIDTH states, see batch
    rows=array(float, 2),  # the memory of `lanes`
    group_steps=array(np.int64),  # group_steps.ADDRESSES
)
"""The robot, and memory to work in, by the address of this table."""


robot_of = ROBOT.opened
"""Kernel (address) that returns the table as a named tuple."""


@nk.kernel
def opened(robot):
    """`bodies`, `gravity`, `work` and `table` of a :class:`memory.Workspace`."""
    at = robot_of(robot)
    return at.bodies, at.gravity, at.work, at.table


INWARD, INWARD_BASE, FACTORIZE, ABA_INWARD, ABA_OUTWARD = range(5)
"""Steps of :func:`step_group`."""


@nk.kernel
def step_group(robot, step, arguments):
    """Run a step at a group with the arguments, and the result, of its function in group_steps."""
    # By address: a robot without groups compiles no step of groups.
    return call_address(robot_of(robot).group_steps[step], arguments)


@nk.kernel
def lengths_match(robot, q, qd, tau):
    """Whether vectors have the robot's lengths."""
    # A floating joint has 7 positions, but 6 rates and efforts.
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
