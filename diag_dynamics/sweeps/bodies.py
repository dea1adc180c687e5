# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records that sweeps work on, and their conversion to tuples and back."""

import numba
import numpy as np
from numba import types

from diag_dynamics.compiled.arrays import array_at
from diag_dynamics.compiled.kernel import kernel
from diag_dynamics.sweeps.spatial import Force, Inertia, Motion, Placement, add, add_force

REVOLUTE, PRISMATIC, PLANAR, FLOATING = range(4)
"""Kinds of joints: which one a body belongs to. Several may have as many degrees of freedom, so that number does not say."""

POSITIONS_OF = {REVOLUTE: 1, PRISMATIC: 1, PLANAR: 3, FLOATING: 7}
"""Position coordinates of a joint of each kind."""

BODY = np.dtype(
    [
        ("parent", "i8"),  # body that carries this one; 0 is the world
        ("direction", "i8"),  # of its degree of freedom: LINEAR_X … ANGULAR_Z
        ("kind", "i8"),  # of its joint: REVOLUTE … FLOATING
        ("dofs", "i8"),  # degrees of freedom of its joint
        ("rank", "i8"),  # number of this degree of freedom within its joint, from 0
        ("q", "i8"),  # first position coordinate of its joint, or of the leader that it follows
        ("dof", "i8"),  # index of its degree of freedom, or of its leader's
        ("owner", "i8"),  # body whose own degree of freedom that is: this one, unless it follows
        ("multiplier", "f8"),  # position = multiplier q[q] + offset; 1 and 0 unless it follows
        ("offset", "f8"),
        ("first", "i8"),  # first and last body of its group
        ("last", "i8"),
        ("start", "i8"),  # first degree of freedom of its group
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

INERTIA, RATE = 72, 4
"""Numbers that P and Ṗ of a body take together, and the distance of Ṗ from P.

Row by row, each entry of the 3x3 blocks A, B and C of P, a gap, those of Ṗ, a gap: eight numbers that are next to each other
make one vector register (see inertias).
"""


def _work():
    """Fields of a body's workspace, each where a vector register may start."""
    fields = {"P": ((np.float64, INERTIA - RATE), 0), "P_rate": ((np.float64, INERTIA - RATE), 8 * RATE)}
    end = 8 * INERTIA
    for name, length in (
        ("rigid", INERTIA // 2),
        ("sine", None),
        ("cosine", None),
        ("rotation", 9),
        ("translation", 3),
        ("V", 6),
        ("acceleration", 6),
        ("y", 6),
        ("z", 6),
        ("magnitude", 2),
        ("total", 2),
        ("armature", None),
        ("D", None),
        ("size", None),
        ("G", 6),
        ("u", 6),
        ("orientation", 9),
        ("W", 6),
        ("W_rate", 6),
        ("zeta", 6),
        ("bias", 6),
    ):
        fields[name] = (np.float64 if length is None else (np.float64, length)), end
        end += 8 * (length or 1)
    return np.dtype(
        {
            "names": list(fields),
            "formats": [format_ for format_, _ in fields.values()],
            "offsets": [offset for _, offset in fields.values()],
            "itemsize": -(-end // 64) * 64,
        },
        align=True,
    )


WORK = _work()
"""Workspace of one body; which fields are alive depends on the sweep. D, size, G and u belong to the degree of freedom
that the body owns; rigid is its own inertia, as P holds it; sine and cosine are those of its joint's angle."""

WRENCH = np.dtype(
    [("body", "i8"), ("point", "f8", 3), ("force", "f8", 3), ("moment", "f8", 3)],
    align=True,
)
"""An external wrench at a point of a body, the point in the body's frame [m], force [N] and moment [N m]."""

BODIES, LINKS = (types.Array(numba.from_dtype(record), 1, "C", readonly=True) for record in (BODY, LINK))
WRENCHES, WORKS = numba.from_dtype(WRENCH)[::1], numba.from_dtype(WORK)[::1]
"""Types of arrays of records."""

links_at = array_at(numba.from_dtype(LINK), 1)
"""Array of LINK that lies at an address."""


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
    """Force from six numbers."""
    return Force((a[0], a[1], a[2]), (a[3], a[4], a[5]))


@kernel
def inertia_of(a):
    """Inertia of the field P or P_rate."""
    return Inertia(
        ((a[0], a[8], a[16]), (a[8], a[32], a[40]), (a[16], a[40], a[64])),
        ((a[1], a[9], a[17]), (a[25], a[33], a[41]), (a[49], a[57], a[65])),
        ((a[2], a[10], a[18]), (a[10], a[34], a[42]), (a[18], a[42], a[66])),
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
    """Add a Force to six numbers."""
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
    for row in range(3):
        for column in range(3):
            k = 24 * row + 8 * column
            a[k], a[k + 1], a[k + 2] = P.A[row][column], P.B[row][column], P.C[row][column]


@kernel
def add_to_inertia(a, P):
    """Add an Inertia to the numbers of P."""
    Q = inertia_of(a)
    set_inertia(
        a,
        Inertia(
            (add(Q.A[0], P.A[0]), add(Q.A[1], P.A[1]), add(Q.A[2], P.A[2])),
            (add(Q.B[0], P.B[0]), add(Q.B[1], P.B[1]), add(Q.B[2], P.B[2])),
            (add(Q.C[0], P.C[0]), add(Q.C[1], P.C[1]), add(Q.C[2], P.C[2])),
        ),
    )
