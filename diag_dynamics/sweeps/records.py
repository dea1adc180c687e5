# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records that sweeps work on, and their conversion to tuples and back."""

from collections import namedtuple

import numba
import numpy as np
from numba import types

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.sweeps import spatial as sp

REVOLUTE, PRISMATIC, PLANAR, FLOATING, VIRTUAL = range(5)
"""Kinds of joints; VIRTUAL is that of a later body of a follower, see couplings."""

POSITIONS_OF = {REVOLUTE: 1, PRISMATIC: 1, PLANAR: 3, FLOATING: 7, VIRTUAL: 1}
"""Position coordinates of a joint of each kind."""

BODY = np.dtype(
    [
        # Place in the tree, and joint
        ("parent", "i8"),  # body that carries this one; 0 is the world
        ("direction", "i8"),  # of its degree of freedom: LINEAR_X … ANGULAR_Z
        ("kind", "i8"),  # of its joint: REVOLUTE … FLOATING
        ("dofs", "i8"),  # degrees of freedom of its joint
        ("rank", "i8"),  # number of this degree of freedom within its joint, from 0
        # Coordinates, and the ratio to those of a leader
        ("q", "i8"),  # first position coordinate of its joint, or of the leader that it follows
        ("dof", "i8"),  # index of its degree of freedom, or of its leader's
        (
            "leader",
            "i8",
        ),  # body that owns its degree of freedom: this one, or the leader of a mimic joint
        (
            "multiplier",
            "f8",
        ),  # position = multiplier q[q] + offset; 1 and 0 unless it follows, 0 if its ratio changes
        ("offset", "f8"),
        # Degrees of freedom that are eliminated together: see groups
        ("first", "i8"),  # first and last body of its group
        ("last", "i8"),
        ("start", "i8"),  # first degree of freedom of its group
        ("link", "i8"),  # index of the link that the joint moves
        # Geometry and inertia, in the frame of the body unless stated otherwise
        ("rotation", "f8", 9),  # constant placement in the parent at q = 0, row-major
        ("translation", "f8", 3),
        ("mass", "f8"),
        ("first_moment", "f8", 3),  # mass times centre of mass
        ("inertia", "f8", 6),  # about the origin: xx xy xz yy yz zz
        ("armature", "f8"),
    ],
    align=True,
)
"""One degree of freedom and the rigid body it moves, all links that move as one, in a frame at the
joint whose z is the joint's axis. A joint of several degrees of freedom is several bodies in one
frame, all but the last without inertia. A mimic joint is a body, but no degree of freedom."""

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

SWEPT_FIELDS = {"rotation": 9, "translation": 3, "V": 6, "acceleration": 6}
SWEPT_FIELDS |= {"P": 21, "P_rate": 21, "y": 6, "z": 6, "magnitude": 2, "total": 2}
"""Fields of a body's workspace that the evaluation works on, and their lengths.

Inward fields are accumulated from the children. P and Ṗ are symmetric: xx xy xz yy yz zz of the
block A, the nine entries of B, and C as A.
"""

WORK = np.dtype(
    [
        *((name, "f8", length) for name, length in SWEPT_FIELDS.items()),
        # Factorization: armature, D and the size of its terms, G, and the rate u of D G: see groups
        ("armature", "f8"),
        ("D", "f8"),
        ("size", "f8"),
        ("G", "f8", 6),
        ("u", "f8", 6),
        # Motion of other rates x and its rate with x constant: B(q, ν)x and ṁᵀx
        ("W", "f8", 6),
        ("W_rate", "f8", 6),
        # ζ of the joint, and V̇ of a body of a group with V̇_A and q̈ zero (Algorithm 8.1)
        ("zeta", "f8", 6),
        ("bias", "f8", 6),
        # Ratios and offsets of followers in the present state, which couplings write
        (
            "multiplier",
            "f8",
        ),  # rate = multiplier q̇[dof]: the body's own, or G of a ratio that changes
        ("multiplier_rate", "f8"),
        ("offset", "f8"),  # of the position
        (
            "couple",
            "i8",
        ),  # of the world: addresses of couplings.couple and its table, 0 if no ratio changes
        ("couplings", "i8"),
    ],
    align=True,
)
"""Workspace of one body; which fields are alive depends on the sweep. D, size, G and u belong to
the degree of freedom that the body owns."""

WIDTH = 8
"""States side by side in the loops of batch: the registers of AVX-512 hold as many, those of AVX2
half."""

N_RESULTS = 9
"""Results of a degree of freedom that a batch keeps."""

_LANE = np.dtype(
    [(name, "f8", (length, WIDTH)) for name, length in SWEPT_FIELDS.items()], align=True
)

LANES = np.dtype(
    [
        ("own", _LANE),
        (
            "parent",
            _LANE,
        ),  # a copy of the parent's motion, and contributions to its inertias and forces
        ("position", "f8", (7, WIDTH)),
        ("rate", "f8", (6, WIDTH)),
        ("effort", "f8", (6, WIDTH)),
        ("results", "f8", (N_RESULTS, WIDTH)),
    ],
    align=True,
)
"""Workspace of one body for WIDTH states: see batch. Only a floating base has more than one
rate."""

Lane = namedtuple("Lane", SWEPT_FIELDS)
"""Fields of one state in LANES, as a record WORK has them."""

Body = namedtuple(
    "Body",
    ["rotation", "translation", "mass", "first_moment", "inertia", "armature"],
)
"""Numbers of a record BODY."""

WRENCH = np.dtype(
    [("body", "i8"), ("point", "f8", 3), ("force", "f8", 3), ("moment", "f8", 3)],
    align=True,
)
"""An external wrench at a point of a body, the point in the body's frame [m], force [N] and moment
[N m]."""

LINKS = types.Array(numba.from_dtype(LINK), 1, "C", readonly=True)
WRENCHES = numba.from_dtype(WRENCH)[::1]
"""Types of arrays of records."""


@nk.kernel
def lane_of(row, b):
    """State b of the own or the parent's fields in the row of a body."""
    return Lane(
        row.rotation[:, b],
        row.translation[:, b],
        row.V[:, b],
        row.acceleration[:, b],
        row.P[:, b],
        row.P_rate[:, b],
        row.y[:, b],
        row.z[:, b],
        row.magnitude[:, b],
        row.total[:, b],
    )


@nk.kernel
def values_of(body):
    """Numbers of a body as constants for the compiler, in loops that write to memory."""
    about = body.inertia
    R = matrix_of(body.rotation)
    return Body(
        (*R[0], *R[1], *R[2]),
        vector_of(body.translation),
        body.mass,
        vector_of(body.first_moment),
        (about[0], about[1], about[2], about[3], about[4], about[5]),
        body.armature,
    )


@nk.kernel
def vector_of(a):
    """3-vector of three numbers."""
    return (a[0], a[1], a[2])


@nk.kernel
def matrix_of(a):
    """3x3 matrix of nine numbers, row-major."""
    return ((a[0], a[1], a[2]), (a[3], a[4], a[5]), (a[6], a[7], a[8]))


@nk.kernel
def symmetric_of(a):
    """Symmetric 3x3 matrix of xx xy xz yy yz zz."""
    return ((a[0], a[1], a[2]), (a[1], a[3], a[4]), (a[2], a[4], a[5]))


@nk.kernel
def motion_of(a):
    """Motion of six numbers."""
    return sp.Motion((a[0], a[1], a[2]), (a[3], a[4], a[5]))


@nk.kernel
def force_of(a):
    """Force from six numbers."""
    return sp.Force((a[0], a[1], a[2]), (a[3], a[4], a[5]))


@nk.kernel
def inertia_of(a):
    """Inertia of the field P or P_rate."""
    # Blocks A and C from their upper triangles, B between them row by row.
    return sp.Inertia(
        ((a[0], a[1], a[2]), (a[1], a[3], a[4]), (a[2], a[4], a[5])),
        ((a[6], a[7], a[8]), (a[9], a[10], a[11]), (a[12], a[13], a[14])),
        ((a[15], a[16], a[17]), (a[16], a[18], a[19]), (a[17], a[19], a[20])),
    )


@nk.kernel
def placement_of(w):
    """X of a body in its parent."""
    return sp.Placement(matrix_of(w.rotation), vector_of(w.translation))


@nk.kernel
def set_vector(a, first, v):
    """Write a 3-vector."""
    a[first], a[first + 1], a[first + 2] = v


@nk.kernel
def set_motion(a, V):
    """Write a Motion."""
    set_vector(a, 0, V.linear)
    set_vector(a, 3, V.angular)


@nk.kernel
def set_force(a, F):
    """Write a Force."""
    set_vector(a, 0, F.force)
    set_vector(a, 3, F.moment)


@nk.kernel
def add_to_force(a, F):
    """Add a Force to six numbers."""
    set_force(a, sp.add_force(force_of(a), F))


@nk.kernel
def set_matrix(a, M):
    """Write a 3x3 matrix."""
    set_vector(a, 0, M[0])
    set_vector(a, 3, M[1])
    set_vector(a, 6, M[2])


@nk.kernel
def set_placement(w, X):
    """Write X of a body."""
    set_matrix(w.rotation, X.rotation)
    set_vector(w.translation, 0, X.translation)


@nk.kernel
def set_symmetric(a, first, M):
    """Write the upper triangle of a symmetric matrix."""
    a[first], a[first + 1], a[first + 2] = M[0]
    a[first + 3] = M[1][1]
    a[first + 4] = M[1][2]
    a[first + 5] = M[2][2]


@nk.kernel
def set_inertia(a, P):
    """Write an Inertia."""
    # Numbers in the order of inertia_of.
    set_symmetric(a, 0, P.A)
    set_vector(a, 6, P.B[0])
    set_vector(a, 9, P.B[1])
    set_vector(a, 12, P.B[2])
    set_symmetric(a, 15, P.C)


@nk.kernel
def add_to_inertia(a, P):
    """Add an Inertia to the numbers of P."""
    set_inertia(a, sp.add_inertia(inertia_of(a), P))
