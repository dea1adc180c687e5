# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Memory that sweeps work in, and the addresses by which they find it."""

import math
from collections import namedtuple

import numpy as np

from diag_dynamics.compiled.kernel import kernel
from diag_dynamics.compiled.lanes import WIDTH
from diag_dynamics.compiled.tables import Addresses, Table, array, lanes
from diag_dynamics.sweeps.bodies import BODY, POSITIONS_OF, WORK

NU, XI, EPSILON, KAPPA, CORIOLIS, CORIOLIS_UNNORMALIZED, GRAVITY = range(7)
"""Rows of what evaluation.evaluate fills; RESULTS is the number of those that a batch keeps."""

ARTICULATED_INERTIA, ARTICULATED_INERTIA_RATE, RESULTS = range(7, 10)

ENERGY_SHARE, NU_DOT, XI_DOT = range(9, 12)
"""Further rows that a sweep fills."""

KINETIC_ENERGY, BASE_ENERGY, EFFORT_POWER, POWER, SWEPT = range(12, 17)
"""Rows with a first entry only: K, the share of the first six total rates in it, and νᵀ(ε − ε_g) twice."""

NUMBERS = SWEPT - KINETIC_ENERGY
"""Count of these numbers."""

POSITIONS, RATES, ROWS = range(16, 19)
"""Rows of a single state that receive q and q̇, and the number of all rows."""

MISFIT = -2
"""Status of a sweep: a vector has not the robot's length."""


ROBOT = Table(
    "Robot",
    bodies=array(BODY),  # of RobotModel
    gravity=array(float),  # acceleration [m/s²]
    work=array(WORK),
    table=array(float, 3),  # matrices 𝓜 and 𝓜̇ of groups, see groups
    nv=int,
    nq=int,
    spans=array(int, 2),  # first and end of the columns that a body carries in all, less those of its group
    rigid=array(float, 2),  # these and the following: see Columns
    articulated=array(float, 2),
    moments=array(float, 2),
    kappas=array(float, 2),
    roots=array(float),
)
"""The robot, and memory to work in, by the address of this table."""

WIDE = ROBOT.extended(
    "WideRobot",
    wide_work=lanes(WORK),
    wide_table=lanes(float, 3),
    q=lanes(float),
    qd=lanes(float),
    tau=lanes(float),
    out=lanes(float, 2),
    q_numbers=array(float, 2, WIDTH),  # the same memory as that of q, and so on
    qd_numbers=array(float, 2, WIDTH),
    tau_numbers=array(float, 2, WIDTH),
    out_numbers=array(float, 3, WIDTH),
)
"""Likewise, with memory for as many states as there are lanes."""


class Workspace:
    """A robot, as sweeps take it, and memory for them to work in: one for each thread.

    Attributes
    ----------
    robot : int
        Address of a table as :data:`ROBOT` has it: the one argument that stands for `bodies`, `gravity`, `work` and `table`,
        which as arguments of their own would cost as much as the arithmetic of a small robot. Keep the Workspace while a
        sweep runs.
    bodies, gravity, work, table : ndarray
        Those of the table.
    """

    def __init__(self, bodies, gravity):
        moving, body = bodies[1:], np.arange(1, len(bodies))
        own = moving["owner"] == body
        grouped = own & (moving["last"] > moving["first"])
        nv, widest = int(own.sum()), int(np.bincount(moving["first"][grouped]).max(initial=1))
        self.bodies, self.gravity = np.ascontiguousarray(bodies), np.ascontiguousarray(gravity, dtype=np.float64)
        self.work, self.table = aligned(len(bodies), WORK), np.zeros((2, nv, widest))
        for k, block in enumerate(_rigid_blocks(self.bodies)):
            self.work["rigid"][:, k::4] = block.reshape(-1, 9)
        nq = max((int(body["q"]) + POSITIONS_OF[int(body["kind"])] for body in moving), default=0)
        # A vector register's width of nothing comes before the first column.
        columns = np.zeros((2 * (6 + widest) + 1, nv + WIDTH))
        self._locate(
            ROBOT,
            bodies=self.bodies,
            gravity=self.gravity,
            work=self.work,
            table=self.table,
            nv=nv,
            nq=nq,
            spans=_spans(self.bodies, nv),
            rigid=columns[:6],
            articulated=columns[6:12],
            moments=columns[12 : 12 + widest],
            kappas=columns[12 + widest : -1],
            roots=columns[-1],
        )

    def _locate(self, table, /, **entries):
        self._entries, self._addresses = entries, Addresses(table, **entries)
        self.robot = self._addresses.at

    def __reduce__(self):
        return type(self), (self.bodies, self.gravity)  # addresses would be those of the original


class WideWorkspace(Workspace):
    """Robot and memory for a sweep over as many states as there are lanes: its table is as :data:`WIDE` has it."""

    def __init__(self, bodies, gravity):
        super().__init__(bodies, gravity)
        nv, nq = self._entries["nv"], self._entries["nq"]
        shapes = {
            "wide_work": (len(self.work), WORK.itemsize // 8),
            "wide_table": self.table.shape,
            **{"q": (nq,), "qd": (nv,), "tau": (nv,), "out": (SWEPT, nv)},
        }
        ends = np.cumsum([math.prod(shape) * WIDTH for shape in shapes.values()])
        parts = np.split(aligned(int(ends[-1]), np.dtype(np.float64)), ends[:-1])
        memory = {name: part.reshape(*shapes[name], WIDTH) for name, part in zip(shapes, parts, strict=True)}
        numbers = {f"{name}_numbers": memory[name] for name in ("q", "qd", "tau", "out")}
        self._locate(WIDE, **self._entries, **memory, **numbers)


def aligned(count, dtype):
    """Zeros that begin where a vector register may."""
    memory = np.zeros(count * dtype.itemsize + 64, np.uint8)
    start = -memory.ctypes.data % 64
    return memory[start : start + count * dtype.itemsize].view(dtype)


def _spans(bodies, nv):
    """First and end of the columns that each body carries: one run, as carried bodies come right after their carrier.

    A body that carries none has nv for the first, and the end of its group's own columns.
    """
    first, end, own = np.full(len(bodies), nv), np.zeros(len(bodies), np.int64), np.zeros(len(bodies), np.int64)
    np.maximum.at(own, bodies["first"], 1 + bodies["dof"])
    for i in range(len(bodies) - 1, 0, -1):
        body = bodies[i]
        end[i] = max(end[i], own[body["first"]])
        carrier = body["parent"]
        first[carrier] = min(first[carrier], first[i] if i > body["first"] else body["start"])
        end[carrier] = max(end[carrier], end[i])
    return np.ascontiguousarray(np.transpose([first, end]))


def _rigid_blocks(bodies):
    """A, B and C of the bodies' own inertias, shape (number, 3, 3) each."""
    x, y, z = bodies["first_moment"].T
    zero = np.zeros_like(x)
    A = bodies["mass"][:, None, None] * np.eye(3)
    B = np.array([[zero, z, -y], [-z, zero, x], [y, -x, zero]]).transpose(2, 0, 1)
    return A, B, bodies["inertia"][:, [0, 1, 2, 1, 3, 4, 2, 4, 5]]


_robot_at, opened_wide = ROBOT.opened, WIDE.opened

Opened = namedtuple("Opened", ["bodies", "gravity", "work", "table"])


@kernel
def opened(robot):
    """`bodies`, `gravity`, `work` and `table` of a :class:`Workspace`."""
    at = _robot_at(robot)
    return Opened(at.bodies, at.gravity, at.work, at.table)


Columns = namedtuple("Columns", ["spans", "rigid", "articulated", "moments", "kappas", "roots"])
"""Forces of rigid and of articulated joints, moments along a group's degrees of freedom, and roots of D, by column, one for
each degree of freedom; and which of them each body carries."""


@kernel
def opened_columns(robot):
    """The columns of a :class:`Workspace`."""
    at = _robot_at(robot)
    return Columns(at.spans, at.rigid, at.articulated, at.moments, at.kappas, at.roots)


@kernel
def fit(robot, q, qd, tau):
    """Whether vectors have the robot's lengths."""
    at = _robot_at(robot)
    return len(q) == at.nq and len(qd) == at.nv and len(tau) == at.nv


@kernel
def fit_positions(robot, q):
    """Whether q has as many entries as the robot has position coordinates."""
    return len(q) == _robot_at(robot).nq


@kernel
def copy(source, target):
    """target[:] = source, without a look at whether they overlap."""
    for k in range(len(source)):
        target[k] = source[k]


@kernel
def clear(target):
    """target[:] = 0.0, which numba takes a second to compile."""
    for k in range(len(target)):
        target[k] = 0.0
