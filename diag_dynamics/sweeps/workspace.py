"""Memory that sweeps work in, and the addresses by which they find it."""

from collections import namedtuple

import numba
import numpy as np

from diag_dynamics.compiled.arrays import array_at
from diag_dynamics.compiled.kernel import kernel
from diag_dynamics.compiled.lanes import EIGHT, WIDTH, record_of_lanes
from diag_dynamics.sweeps.bodies import BODY, POSITIONS_OF, WORK

NU, XI, EPSILON, KAPPA, CORIOLIS, CORIOLIS_UNNORMALIZED, GRAVITY = range(7)
"""Rows of what evaluation.evaluate fills; RESULTS is the number of those that a batch keeps."""

ARTICULATED_INERTIA, ARTICULATED_INERTIA_RATE, RESULTS = range(7, 10)

ENERGY_SHARE, KINETIC_ENERGY, EFFORT_POWER, SWEPT = range(9, 13)
"""Further rows that a sweep fills. Of the two numbers, K and νᵀ(ε − ε_g), the row has the first entry only."""

POSITIONS, RATES, ROWS = range(12, 15)
"""Rows of a single state that receive q and q̇, and the number of all rows."""

MISFIT = -2
"""Status of a sweep: a vector has not the robot's length."""


class Workspace:
    """A robot, as sweeps take it, and memory for them to work in: one for each thread.

    Attributes
    ----------
    robot : int
        Address of `addresses`: the one argument that stands for `bodies`, `gravity`, `work` and `table`, which as arguments
        of their own would cost as much as the arithmetic of a small robot. Keep the Workspace while a sweep runs.
    addresses : ndarray of int64
        Where these arrays lie, and the numbers of bodies, of degrees of freedom, of the widest group's degrees of freedom
        and of position coordinates; then where `spans` and `columns` lie.
    bodies, gravity, work, table : ndarray
        Records of RobotModel, acceleration of gravity [m/s²], those of :data:`WORK`, and the matrices 𝓜 and 𝓜̇ of groups
        (see groups).
    spans : ndarray, shape (number of bodies, 2)
        First and end of the columns, one for each degree of freedom, that a body carries in all, less those of its group.
    columns : ndarray
        The rows of :data:`Columns`; a vector register's width of nothing comes before the first column.
    """

    def __init__(self, bodies, gravity):
        moving, body = bodies[1:], np.arange(1, len(bodies))
        own = moving["owner"] == body
        grouped = own & (moving["last"] > moving["first"])
        widest = np.bincount(moving["first"][grouped]).max(initial=1)
        self.bodies, self.gravity = np.ascontiguousarray(bodies), np.ascontiguousarray(gravity, dtype=np.float64)
        self.work, self.table = aligned(len(bodies), WORK), np.zeros((2, int(own.sum()), int(widest)))
        for k, block in enumerate(_rigid_blocks(self.bodies)):
            self.work["rigid"][:, k::4] = block.reshape(-1, 9)
        nq = max((int(body["q"]) + POSITIONS_OF[int(body["kind"])] for body in moving), default=0)
        arrays = (self.bodies, self.gravity, self.work, self.table)
        self.spans = _spans(self.bodies, int(own.sum()))
        self.columns = np.zeros((2 * (6 + int(widest)) + 1, int(own.sum()) + WIDTH))
        sizes = len(bodies), *self.table.shape[1:], nq
        self._locate(
            [*(array.ctypes.data for array in arrays), *sizes, self.spans.ctypes.data, self.columns.ctypes.data]
        )

    def _locate(self, addresses):
        self.addresses = np.array(addresses, np.int64)
        self.robot = self.addresses.ctypes.data

    def __reduce__(self):
        return type(self), (self.bodies, self.gravity)  # addresses would be those of the original


class WideWorkspace(Workspace):
    """Robot and memory for a sweep over as many states as there are lanes; `addresses` has that memory, too."""

    def __init__(self, bodies, gravity):
        super().__init__(bodies, gravity)
        n, nv, widest, nq = (int(size) for size in self.addresses[4:8])
        parts = n * WORK.itemsize // 8, 2 * nv * widest, nq, nv, nv, SWEPT * nv
        self._memory = aligned(WIDTH * sum(parts), np.dtype(np.float64))
        starts = 8 * WIDTH * np.cumsum([0, *parts[:-1]])
        self._locate([*self.addresses, *(self._memory.ctypes.data + starts)])


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


_bodies_at, _work_at = array_at(numba.from_dtype(BODY), 1), array_at(numba.from_dtype(WORK), 1)
_vector_at, _matrix_at, _table_at = (array_at(numba.float64, ndim) for ndim in (1, 2, 3))
_wide_work_at = array_at(record_of_lanes(WORK, EIGHT), 1)
_wide_vector_at, _wide_matrix_at, _wide_table_at = (array_at(EIGHT, ndim) for ndim in (1, 2, 3))
_addresses_at, _spans_at = array_at(numba.int64, 1), array_at(numba.int64, 2)


@kernel
def opened(robot):
    """`bodies`, `gravity`, `work` and `table` of a :class:`Workspace`."""
    at = _addresses_at(robot, (8,))
    return (
        _bodies_at(at[0], (at[4],)),
        _vector_at(at[1], (3,)),
        _work_at(at[2], (at[4],)),
        _table_at(at[3], (2, at[5], at[6])),
    )


Columns = namedtuple("Columns", ["spans", "rigid", "articulated", "moments", "kappas", "roots"])
"""Forces of rigid and of articulated joints, moments along a group's degrees of freedom, and roots of D, by column."""


@kernel
def opened_columns(robot):
    """`spans` and `columns` of a :class:`Workspace`."""
    at = _addresses_at(robot, (10,))
    n, nv, widest = at[4], at[5], at[6]
    columns = _matrix_at(at[9], (2 * (6 + widest) + 1, nv + WIDTH))
    return Columns(
        _spans_at(at[8], (n, 2)),
        columns[:6],
        columns[6:12],
        columns[12 : 12 + widest],
        columns[12 + widest : 12 + 2 * widest],
        columns[12 + 2 * widest],
    )


@kernel
def opened_wide(robot):
    """`work` and `table` of a :class:`WideWorkspace`, lanes for q, q̇, τ and results, and these as numbers."""
    at = _addresses_at(robot, (16,))
    n, nv, widest, nq = at[4], at[5], at[6], at[7]
    return (
        _wide_work_at(at[10], (n,)),
        _wide_table_at(at[11], (2, nv, widest)),
        (_wide_vector_at(at[12], (nq,)), _wide_vector_at(at[13], (nv,)), _wide_vector_at(at[14], (nv,))),
        _wide_matrix_at(at[15], (SWEPT, nv)),
        (_matrix_at(at[12], (nq, WIDTH)), _matrix_at(at[13], (nv, WIDTH)), _matrix_at(at[14], (nv, WIDTH))),
        _table_at(at[15], (SWEPT, nv, WIDTH)),
    )


@kernel
def fit(robot, q, qd, tau):
    """Whether vectors have the robot's lengths."""
    at = _addresses_at(robot, (8,))
    return len(q) == at[7] and len(qd) == at[5] and len(tau) == at[5]


@kernel
def fit_positions(robot, q):
    """Whether q has as many entries as the robot has position coordinates."""
    return len(q) == _addresses_at(robot, (8,))[7]


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
