"""The records that sweeps work on, and how they become tuples and back."""

import numpy as np

from diag_dynamics.kernel import kernel
from diag_dynamics.spatial import Force, Inertia, Motion, Placement, add, add_force

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


def workspace(bodies):
    """Workspace of each body, and the table of the groups' matrices 𝓜 and 𝓜̇ (see groups)."""
    moving, body = bodies[1:], np.arange(1, len(bodies))
    own = moving["owner"] == body
    grouped = own & (moving["last"] > moving["first"])
    widest = np.bincount(moving["first"][grouped]).max(initial=1)
    return np.zeros(len(bodies), WORK), np.zeros((2, int(own.sum()), int(widest)))


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
