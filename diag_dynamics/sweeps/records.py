"""The records that sweeps work on, and how they become tuples and back."""

import numba
import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from diag_dynamics.kernel import kernel
from diag_dynamics.spatial import Force, Inertia, Motion, Placement, add, add_force

BODY = np.dtype(
    [
        ("parent", "i8"),  # body that carries this one; 0 is the world
        ("direction", "i8"),  # of its degree of freedom: LINEAR_X … ANGULAR_Z
        ("dofs", "i8"),  # degrees of freedom of its joint
        ("rank", "i8"),  # which of them this one is, from 0
        ("q", "i8"),  # first position coordinate of its joint, or of the leader that it follows
        ("dof", "i8"),  # index of its degree of freedom, or of its leader's
        ("owner", "i8"),  # body whose own degree of freedom that is: this one, unless it follows
        ("multiplier", "f8"),  # position = multiplier q[q] + offset; 1 and 0 unless it follows
        ("offset", "f8"),
        ("first", "i8"),  # first and last body of those that are eliminated together with it
        ("last", "i8"),
        ("start", "i8"),  # first degree of freedom of those
        ("link", "i8"),  # index of the link that the joint moves
        ("rotation", "f8", 9),  # constant placement in the parent at q = 0, row-major
        ("translation", "f8", 3),
        ("mass", "f8"),
        ("first_moment", "f8", 3),  # mass times centre of mass
        ("inertia", "f8", 6),  # about the origin: xx xy xz yy yz zz
        ("armature", "f8"),
    ],
    align=True,
)
"""One degree of freedom and the rigid body it moves, all links that move as one, in a frame at the joint whose z is the
joint's axis. A joint of several degrees of freedom is several bodies in one frame, all but the last without inertia. A
mimic joint is a body, but no degree of freedom."""

LINK = np.dtype(
    [
        ("body", "i8"),
        ("index", "i8"),
        ("mass", "f8"),
        ("first_moment", "f8", 3),
        ("inertia", "f8", 6),
    ],
    align=True,
)
"""One link with inertia, in the frame of the body it belongs to."""

WORK = np.dtype(
    [
        ("rotation", "f8", 9),
        ("translation", "f8", 3),
        ("orientation", "f8", 9),
        ("V", "f8", 6),
        ("W", "f8", 6),
        ("W_rate", "f8", 6),
        ("acceleration", "f8", 6),
        ("zeta", "f8", 6),
        ("bias", "f8", 6),
        ("P", "f8", 21),
        ("P_rate", "f8", 21),
        ("magnitude", "f8", 2),
        ("total", "f8", 2),
        ("armature", "f8"),
        ("y", "f8", 6),
        ("z", "f8", 6),
        ("D", "f8"),
        ("size", "f8"),
        ("G", "f8", 6),
        ("u", "f8", 6),
    ],
    align=True,
)
"""Workspace of one body; which fields are alive depends on the sweep. D, size, G and u belong to the degree of freedom
that the body owns."""

WRENCH = np.dtype(
    [("body", "i8"), ("point", "f8", 3), ("force", "f8", 3), ("moment", "f8", 3)],
    align=True,
)
"""An external wrench at a point of a body, the point in the body's frame [m], force [N] and moment [N m]."""


class Workspace:
    """A robot, as sweeps take it, and memory for them to work in: one for each thread.

    Attributes
    ----------
    robot : ndarray of int64
        Where all of it lies: the one argument that stands for `bodies`, `gravity`, `work` and `table`, which as arguments
        of their own would cost as much as the arithmetic of a small robot. It holds addresses: keep the Workspace while a
        sweep runs.
    bodies, gravity, work, table : ndarray
        Records of RobotModel, acceleration of gravity [m/s²], those of :data:`WORK`, and the matrices 𝓜 and 𝓜̇ of groups
        (see groups).
    """

    def __init__(self, bodies, gravity):
        moving, body = bodies[1:], np.arange(1, len(bodies))
        own = moving["owner"] == body
        grouped = own & (moving["last"] > moving["first"])
        widest = np.bincount(moving["first"][grouped]).max(initial=1)
        self.bodies, self.gravity = np.ascontiguousarray(bodies), np.ascontiguousarray(gravity, dtype=np.float64)
        self.work, self.table = np.zeros(len(bodies), WORK), np.zeros((2, int(own.sum()), int(widest)))
        arrays = (self.bodies, self.gravity, self.work, self.table)
        self.robot = np.array([*(array.ctypes.data for array in arrays), len(bodies), *self.table.shape[1:]], np.int64)

    def __reduce__(self):
        return Workspace, (self.bodies, self.gravity)  # a copy lies elsewhere


@intrinsic
def _pointer(context, address):
    """The pointer that an integer is."""
    return types.voidptr(address), lambda _, builder, __, args: builder.inttoptr(args[0], cgutils.voidptr_t)


@kernel
def opened(robot):
    """`bodies`, `gravity`, `work` and `table` of a :class:`Workspace`."""
    bodies = numba.carray(_pointer(robot[0]), (robot[4],), BODY)
    gravity = numba.carray(_pointer(robot[1]), (3,), np.float64)
    work = numba.carray(_pointer(robot[2]), (robot[4],), WORK)
    table = numba.carray(_pointer(robot[3]), (2, robot[5], robot[6]), np.float64)
    return bodies, gravity, work, table


@kernel
def vector_of(a):
    """3-vector of three numbers."""
    return (a[0], a[1], a[2])


@kernel
def matrix_of(a):
    """3x3 matrix of nine numbers, row-major."""
    return ((a[0], a[1], a[2]), (a[3], a[4], a[5]), (a[6], a[7], a[8]))


@kernel
def symmetric_of(a):
    """Symmetric 3x3 matrix of xx xy xz yy yz zz."""
    return ((a[0], a[1], a[2]), (a[1], a[3], a[4]), (a[2], a[4], a[5]))


@kernel
def motion_of(a):
    """Motion of six numbers."""
    return Motion((a[0], a[1], a[2]), (a[3], a[4], a[5]))


@kernel
def force_of(a):
    """Force of six numbers."""
    return Force((a[0], a[1], a[2]), (a[3], a[4], a[5]))


@kernel
def inertia_of(a):
    """Inertia of 21 numbers: the upper triangle of A, all of B, the upper triangle of C."""
    return Inertia(
        ((a[0], a[1], a[2]), (a[1], a[3], a[4]), (a[2], a[4], a[5])),
        ((a[6], a[7], a[8]), (a[9], a[10], a[11]), (a[12], a[13], a[14])),
        ((a[15], a[16], a[17]), (a[16], a[18], a[19]), (a[17], a[19], a[20])),
    )


@kernel
def placement_of(w):
    """X of a body in its parent."""
    return Placement(matrix_of(w.rotation), vector_of(w.translation))


@kernel
def set_vector(a, first, v):
    """Write a 3-vector."""
    a[first], a[first + 1], a[first + 2] = v


@kernel
def set_motion(a, V):
    """Write a Motion."""
    set_vector(a, 0, V.linear)
    set_vector(a, 3, V.angular)


@kernel
def set_force(a, F):
    """Write a Force."""
    set_vector(a, 0, F.force)
    set_vector(a, 3, F.moment)


@kernel
def add_to_force(a, F):
    """Add a Force to the one that is there."""
    set_force(a, add_force(force_of(a), F))


@kernel
def set_matrix(a, M):
    """Write a 3x3 matrix."""
    set_vector(a, 0, M[0])
    set_vector(a, 3, M[1])
    set_vector(a, 6, M[2])


@kernel
def set_placement(w, X):
    """Write X of a body."""
    set_matrix(w.rotation, X.rotation)
    set_vector(w.translation, 0, X.translation)


@kernel
def set_inertia(a, P):
    """Write an Inertia."""
    a[0], a[1], a[2], a[3], a[4], a[5] = P.A[0] + P.A[1][1:] + P.A[2][2:]
    for row in range(3):
        set_vector(a, 6 + 3 * row, P.B[row])
    a[15], a[16], a[17], a[18], a[19], a[20] = P.C[0] + P.C[1][1:] + P.C[2][2:]


@kernel
def add_to_inertia(a, P):
    """Add an Inertia to the one that is there."""
    Q = inertia_of(a)
    set_inertia(
        a,
        Inertia(
            (add(Q.A[0], P.A[0]), add(Q.A[1], P.A[1]), add(Q.A[2], P.A[2])),
            (add(Q.B[0], P.B[0]), add(Q.B[1], P.B[1]), add(Q.B[2], P.B[2])),
            (add(Q.C[0], P.C[0]), add(Q.C[1], P.C[1]), add(Q.C[2], P.C[2])),
        ),
    )
