# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Spatial (6-D) vector algebra on tuples of scalars, which numba turns into straight-line code.

Conventions: the linear part comes first. A 3-vector is a tuple of three floats, a 3x3 matrix a
tuple of three rows. Body frames are chosen so that the axis of every joint is z (see model), and a
joint of several degrees of freedom moves along axes of its body. A projection on a degree of
freedom S therefore picks an entry.
"""

import math
from collections import namedtuple

from diag_dynamics.numerics import kernel as nk

Motion = namedtuple("Motion", ["linear", "angular"])
"""Twist or spatial acceleration about the frame's origin."""

Force = namedtuple("Force", ["force", "moment"])
"""Wrench or momentum about the frame's origin."""

Inertia = namedtuple("Inertia", ["A", "B", "C"])
"""Symmetric 6x6 matrix [[A, B], [Bᵀ, C]] that takes a Motion to a Force."""

Placement = namedtuple("Placement", ["rotation", "translation"])
"""Pose of a child frame in its parent: x_parent = rotation x_child + translation."""

LINEAR_X, LINEAR_Y, LINEAR_Z, ANGULAR_X, ANGULAR_Y, ANGULAR_Z = range(6)
"""Directions of a degree of freedom: entries of a Motion. A revolute joint has ANGULAR_Z, a
prismatic one LINEAR_Z."""

ZERO = (0.0, 0.0, 0.0)

NO_MOTION, NO_FORCE = Motion(ZERO, ZERO), Force(ZERO, ZERO)

IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

NO_INERTIA = Inertia(3 * (ZERO,), 3 * (ZERO,), 3 * (ZERO,))

# --- 3-vectors and 3x3 matrices -------------------------------------------------------------------


@nk.kernel
def add(a, b):
    """Sum a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@nk.kernel
def subtract(a, b):
    """Difference a − b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@nk.kernel
def scale(a, s):
    """Multiple s a."""
    return (a[0] * s, a[1] * s, a[2] * s)


@nk.kernel
def dot(a, b):
    """aᵀb."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@nk.kernel
def cross(a, b):
    """Vector product a × b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@nk.kernel
def transpose(M):
    """Mᵀ."""
    return (
        (M[0][0], M[1][0], M[2][0]),
        (M[0][1], M[1][1], M[2][1]),
        (M[0][2], M[1][2], M[2][2]),
    )


@nk.kernel
def mirror(M):
    """Symmetric matrix from its upper triangle; spares the compiler the lower one."""
    return (M[0], (M[0][1], M[1][1], M[1][2]), (M[0][2], M[1][2], M[2][2]))


@nk.kernel
def apply(M, a):
    """M a."""
    return (dot(M[0], a), dot(M[1], a), dot(M[2], a))


@nk.kernel
def apply_transposed(M, a):
    """Mᵀ a."""
    return add(add(scale(M[0], a[0]), scale(M[1], a[1])), scale(M[2], a[2]))


@nk.kernel
def product(M, N):
    """M N."""
    return (apply_transposed(N, M[0]), apply_transposed(N, M[1]), apply_transposed(N, M[2]))


@nk.kernel
def matrix_sum(M, N):
    """M + N."""
    return (add(M[0], N[0]), add(M[1], N[1]), add(M[2], N[2]))


@nk.kernel
def matrix_difference(M, N):
    """M − N."""
    return (subtract(M[0], N[0]), subtract(M[1], N[1]), subtract(M[2], N[2]))


@nk.kernel
def outer(a, b):
    """Outer product a bᵀ."""
    return (scale(b, a[0]), scale(b, a[1]), scale(b, a[2]))


@nk.kernel
def cross_columns(a, M):
    """ã M: the cross product of a with each column of M."""
    # Rows of ã: (0, −a_z, a_y), (a_z, 0, −a_x), (−a_y, a_x, 0).
    return (
        subtract(scale(M[2], a[1]), scale(M[1], a[2])),
        subtract(scale(M[0], a[2]), scale(M[2], a[0])),
        subtract(scale(M[1], a[0]), scale(M[0], a[1])),
    )


@nk.kernel
def turn_columns(M, rate):
    """ã M for a = rate along z."""
    return (scale(M[1], -rate), scale(M[0], rate), scale(M[2], 0.0))


@nk.kernel
def rotated(R, M):
    """R M Rᵀ."""
    return product(product(R, M), transpose(R))


# --- Spatial vectors ------------------------------------------------------------------------------


@nk.kernel
def add_motion(V, W):
    """V + W."""
    return Motion(add(V.linear, W.linear), add(V.angular, W.angular))


@nk.kernel
def subtract_motion(V, W):
    """V − W."""
    return Motion(subtract(V.linear, W.linear), subtract(V.angular, W.angular))


@nk.kernel
def add_force(F, H):
    """F + H."""
    return Force(add(F.force, H.force), add(F.moment, H.moment))


@nk.kernel
def subtract_force(F, H):
    """F − H."""
    return Force(subtract(F.force, H.force), subtract(F.moment, H.moment))


@nk.kernel
def scale_force(F, s):
    """F s."""
    return Force(scale(F.force, s), scale(F.moment, s))


@nk.kernel
def power(F, V):
    """FᵀV: the power of a wrench on a twist."""
    return dot(F.force, V.linear) + dot(F.moment, V.angular)


@nk.kernel
def cross_motion(V, W):
    """V × W of two motions."""
    # V× = [[ω̃, ṽ], [0, ω̃]] in this order of parts.
    return Motion(
        add(cross(V.angular, W.linear), cross(V.linear, W.angular)), cross(V.angular, W.angular)
    )


@nk.kernel
def cross_force(V, F):
    """V ×* F of a motion and a force; equal to −(V×)ᵀF."""
    # V×* = −(V×)ᵀ = [[ω̃, 0], [ṽ, ω̃]].
    return Force(
        cross(V.angular, F.force), add(cross(V.angular, F.moment), cross(V.linear, F.force))
    )


@nk.kernel
def compose_placements(X, T):
    """Placement in the parent of X of a frame that has the placement T in its child."""
    return Placement(
        product(X.rotation, T.rotation), add(X.translation, apply(X.rotation, T.translation))
    )


@nk.kernel
def motion_to_child(X, V):
    """X V: the parent's motion seen in the child's frame."""
    # Velocity v + ω × r at the child's origin r, then Rᵀ into the child's axes.
    at_origin = add(V.linear, cross(V.angular, X.translation))
    return Motion(apply_transposed(X.rotation, at_origin), apply_transposed(X.rotation, V.angular))


@nk.kernel
def force_to_parent(X, F):
    """XᵀF: the child's wrench seen in the parent's frame."""
    # R into the parent's axes; the force at r adds the moment r × f.
    force = apply(X.rotation, F.force)
    return Force(force, add(apply(X.rotation, F.moment), cross(X.translation, force)))


# --- Inertias -------------------------------------------------------------------------------------


@nk.kernel
def rigid_inertia(mass, first_moment, rotational):
    """Inertia of a rigid body from mass, first moment, and rotational inertia about the origin.

    The first moment is mass times centre of mass.
    """
    # A = m 1, B = −h̃, because I V has the force m v − h × ω and the moment h × v + C ω.
    h = first_moment
    A = ((mass, 0.0, 0.0), (0.0, mass, 0.0), (0.0, 0.0, mass))
    B = ((0.0, h[2], -h[1]), (-h[2], 0.0, h[0]), (h[1], -h[0], 0.0))
    return Inertia(A, B, rotational)


@nk.kernel
def rigid_momentum(mass, first_moment, rotational, V):
    """I V of a rigid body."""
    return Force(
        subtract(scale(V.linear, mass), cross(first_moment, V.angular)),
        add(apply(rotational, V.angular), cross(first_moment, V.linear)),
    )


@nk.kernel
def add_inertia(P, Q):
    """P + Q."""
    return Inertia(matrix_sum(P.A, Q.A), matrix_sum(P.B, Q.B), matrix_sum(P.C, Q.C))


@nk.kernel
def inertia_times(P, V):
    """P V."""
    return Force(
        add(apply(P.A, V.linear), apply(P.B, V.angular)),
        add(apply_transposed(P.B, V.linear), apply(P.C, V.angular)),
    )


@nk.kernel
def inertia_to_parent(X, P):
    """XᵀP X: the child's inertia seen in the parent's frame."""
    # Parent's axes: R (·) Rᵀ of each block, still about the child's origin.
    r = X.translation
    A = mirror(rotated(X.rotation, P.A))
    B = rotated(X.rotation, P.B)
    C = mirror(rotated(X.rotation, P.C))
    # [[A, B], [Bᵀ, C]] [[1, −r̃], [0, 1]] adds −A r̃ = (r̃ A)ᵀ to B and −Bᵀr̃ = (r̃ B)ᵀ to C
    # [[1, 0], [r̃, 1]] from the left then adds r̃ (B − A r̃) to C
    shifted = matrix_sum(B, transpose(cross_columns(r, A)))
    C = matrix_sum(matrix_sum(C, transpose(cross_columns(r, B))), cross_columns(r, shifted))
    return Inertia(A, shifted, mirror(C))


@nk.kernel
def less_rank_one(P, G, H):
    """P − G Hᵀ, for a difference that is symmetric."""
    return Inertia(
        mirror(matrix_difference(P.A, outer(G.force, H.force))),
        matrix_difference(P.B, outer(G.force, H.moment)),
        mirror(matrix_difference(P.C, outer(G.moment, H.moment))),
    )


@nk.kernel
def less_products(P, G, H, u):
    """P − (G Hᵀ + u Gᵀ), for a difference that is symmetric."""
    # Blocks of G Hᵀ + u Gᵀ. The difference is symmetric, so its lower left block is Bᵀ.
    A = matrix_sum(outer(G.force, H.force), outer(u.force, G.force))
    B = matrix_sum(outer(G.force, H.moment), outer(u.force, G.moment))
    C = matrix_sum(outer(G.moment, H.moment), outer(u.moment, G.moment))
    return Inertia(
        mirror(matrix_difference(P.A, A)),
        matrix_difference(P.B, B),
        mirror(matrix_difference(P.C, C)),
    )


@nk.kernel
def less_rank_two(P, G, H):
    """P − G Hᵀ − H Gᵀ: lower triangles, which no difference needs, follow from the upper ones."""
    return less_rank_one(less_rank_one(P, G, H), H, G)


# --- Degrees of freedom ---------------------------------------------------------------------------


@nk.kernel
def entry(direction, v, w):
    """Entry of the six numbers (v, w) in a direction."""
    # z first: x and y occur only in joints of several degrees of freedom.
    if direction == ANGULAR_Z:
        return w[2]
    if direction == LINEAR_Z:
        return v[2]
    if direction < ANGULAR_X:
        return v[0] if direction == LINEAR_X else v[1]
    return w[0] if direction == ANGULAR_X else w[1]


@nk.kernel
def along(direction, F):
    """SᵀF."""
    return entry(direction, F.force, F.moment)


@nk.kernel
def motion_along(direction, rate):
    """S rate."""
    if direction == ANGULAR_Z:
        return Motion(ZERO, (0.0, 0.0, rate))
    if direction == LINEAR_Z:
        return Motion((0.0, 0.0, rate), ZERO)
    # Axis x or y of a joint of several degrees of freedom.
    axis = direction if direction < ANGULAR_X else direction - ANGULAR_X
    x = rate if axis == LINEAR_X else 0.0
    y = rate if axis == LINEAR_Y else 0.0
    return Motion((x, y, 0.0), ZERO) if direction < ANGULAR_X else Motion(ZERO, (x, y, 0.0))


@nk.kernel
def cross_along_z(direction, V, rate):
    """V × S rate for a joint motion about or along z."""
    # a × (0, 0, rate) = (a_y, −a_x, 0) rate; V× S = (v × z, ω × z) or (ω × z, 0).
    w = V.angular
    if direction == ANGULAR_Z:
        v = V.linear
        return Motion((v[1] * rate, -(v[0] * rate), 0.0), (w[1] * rate, -(w[0] * rate), 0.0))
    return Motion((w[1] * rate, -(w[0] * rate), 0.0), ZERO)


@nk.kernel
def column_along(direction, P):
    """P S."""
    # Column of [[A, B], [Bᵀ, C]]; rows of the symmetric A and C are their columns.
    if direction == ANGULAR_Z:
        return Force((P.B[0][2], P.B[1][2], P.B[2][2]), P.C[2])
    if direction == LINEAR_Z:
        return Force(P.A[2], P.B[2])
    if direction < ANGULAR_X:
        return Force(P.A[0], P.B[0]) if direction == LINEAR_X else Force(P.A[1], P.B[1])
    if direction == ANGULAR_X:
        return Force((P.B[0][0], P.B[1][0], P.B[2][0]), P.C[0])
    return Force((P.B[0][1], P.B[1][1], P.B[2][1]), P.C[1])


@nk.kernel
def turned_about_z(rotation, sine, cosine):
    """R Rz of an angle with this sine and cosine."""
    # Columns of R: the axes x and y turn in their plane, z remains.
    x, y, z = transpose(rotation)
    return transpose(
        (add(scale(x, cosine), scale(y, sine)), subtract(scale(y, cosine), scale(x, sine)), z),
    )


@nk.kernel
def rotation_of_quaternion(x, y, z, w):
    """Rotation matrix of a quaternion of any length but zero."""
    # 2/|q|² in place of 2 normalizes without a square root.
    s = 2.0 / (x * x + y * y + z * z + w * w)
    return (
        (1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)),
        (s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)),
        (s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y)),
    )


# --- Displacements --------------------------------------------------------------------------------

SMALL = 1e-4
"""Square of the angle below which the functions of an exponential are taken from their series, good
to 1e-16."""


@nk.kernel
def screw_functions(squared):
    """(1 − cos θ)/θ² and (θ − sin θ)/θ³, of θ²."""
    # Series, because both differences cancel as θ → 0: 1/2 − θ²/24 + …, 1/6 − θ²/120 + …
    if squared < SMALL:
        return 0.5 - squared * (1 / 24 - squared / 720), 1 / 6 - squared * (
            1 / 120 - squared / 5040
        )
    angle = math.sqrt(squared)
    return (1.0 - math.cos(angle)) / squared, (angle - math.sin(angle)) / (squared * angle)


@nk.kernel
def screw_translation(V):
    """Translation of exp(V): v + (1 − cos θ)/θ² ω × v + (θ − sin θ)/θ³ ω × (ω × v)."""
    first, second = screw_functions(dot(V.angular, V.angular))
    turned = cross(V.angular, V.linear)
    return add(V.linear, add(scale(turned, first), scale(cross(V.angular, turned), second)))


@nk.kernel
def rotation_quaternion(vector):
    """Unit quaternion (x, y, z, w) of a rotation vector."""
    squared = dot(vector, vector)
    half = 0.5 * math.sqrt(squared)
    # sin(θ/2)/θ, by its series near θ = 0.
    s = (
        0.5 - squared * (1 / 48 - squared / 3840)
        if squared < SMALL
        else 0.5 * math.sin(half) / half
    )
    return (s * vector[0], s * vector[1], s * vector[2], math.cos(half))


@nk.kernel
def quaternion_product(p, r):
    """The rotation r, then p: quaternions (x, y, z, w)."""
    a = (p[0], p[1], p[2])
    b = (r[0], r[1], r[2])
    # Vector part p_w r + r_w p + p × r, scalar part p_w r_w − p·r.
    v = add(add(scale(b, p[3]), scale(a, r[3])), cross(a, b))
    return (v[0], v[1], v[2], p[3] * r[3] - dot(a, b))


@nk.kernel
def rotation_vector(x, y, z, w):
    """Rotation vector of a unit quaternion, the shorter way round.

    It is the inverse of :func:`rotation_quaternion`.
    """
    # q and −q are one rotation; w ≥ 0 has the angle θ ≤ π.
    if w < 0.0:
        x = -x
        y = -y
        z = -z
        w = -w
    sine = math.sqrt(x * x + y * y + z * z)
    # θ / sin(θ/2); by its series where the sine is nothing but rounding.
    s = 2.0 * math.atan2(sine, w) / sine if sine > 1e-8 else 2.0 / w
    return (s * x, s * y, s * z)


@nk.kernel
def screw_of_displacement(translation, vector):
    """V with exp(V) of this translation and rotation vector.

    It is the inverse of :func:`screw_translation`. v = t − ½ ω × t + (1/θ² − (1 + cos θ)/(2 θ sin
    θ)) ω × (ω × t).
    """
    squared = dot(vector, vector)
    angle = math.sqrt(squared)
    # Coefficient c of ω × (ω × t); its terms 1/θ² cancel as θ → 0.
    if squared < SMALL:
        c = 1 / 12 + squared * (1 / 720 + squared / 30240)
    else:  # (1 + cos θ)/sin θ = 1/tan(θ/2), which has no pole at π
        c = (1.0 - 0.5 * angle / math.tan(0.5 * angle)) / squared
    turned = cross(vector, translation)
    linear = add(translation, add(scale(turned, -0.5), scale(cross(vector, turned), c)))
    return Motion(linear, vector)


# --- How an inertia changes as its frame moves ----------------------------------------------------


@nk.kernel
def _commutator(axis, M):
    """ã M − M ã of a symmetric matrix."""
    # −M ã = (ã M)ᵀ of a symmetric M.
    N = cross_columns(axis, M)
    return mirror(matrix_sum(N, transpose(N)))


@nk.kernel
def _commutator_of_block(axis, B):
    """ã B − B ã of any matrix."""
    # −B ã = (ã Bᵀ)ᵀ.
    return matrix_sum(cross_columns(axis, B), transpose(cross_columns(axis, transpose(B))))


@nk.kernel
def transport_along_z(direction, rate, P):
    """−(v_J×)ᵀP − P(v_J×) for a joint motion v_J = S rate about or along z."""
    # Blocks as in transport, ω̃ or ṽ along z. B is ω̃B of a revolute joint, else ṽB.
    B = turn_columns(P.B, rate)
    if direction == ANGULAR_Z:
        A = turn_columns(P.A, rate)
        C = turn_columns(P.C, rate)
        return Inertia(
            mirror(matrix_sum(A, transpose(A))),
            matrix_sum(B, transpose(turn_columns(transpose(P.B), rate))),
            mirror(matrix_sum(C, transpose(C))),
        )
    # Prismatic, ω = 0: no change of A, (ṽA)ᵀ in B, ṽB + (ṽB)ᵀ in C.
    row = scale(P.A[0], 0.0)
    return Inertia(
        (row, row, row), transpose(turn_columns(P.A, rate)), mirror(matrix_sum(B, transpose(B)))
    )


@nk.kernel
def transport(V, P):
    """−(V×)ᵀP − P(V×) for any motion V."""
    # Blocks: ω̃A − Aω̃;  ω̃B − Bω̃ − Aṽ;  ω̃C − Cω̃ + ṽB − Bᵀṽ. −Aṽ = (ṽA)ᵀ, −Bᵀṽ = (ṽB)ᵀ.
    B = cross_columns(V.linear, P.B)
    return Inertia(
        _commutator(V.angular, P.A),
        matrix_sum(_commutator_of_block(V.angular, P.B), transpose(cross_columns(V.linear, P.A))),
        matrix_sum(_commutator(V.angular, P.C), mirror(matrix_sum(B, transpose(B)))),
    )


# --- Sine and cosine ------------------------------------------------------------------------------

MAX_ANGLE = 1e6
"""Up to this angle [rad] a multiple of the first part of π/2 has no rounding error."""

TO_NEAREST = 6755399441055744.0
"""1.5 · 2⁵²: adding and subtracting it leaves the nearest integer."""

HALF_PI = (1.57079632673412561417, 6.07710050650619224932e-11)

SINE = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)

COSINE = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)


@nk.kernel
def reduced_angle(x):
    """Angle within MAX_ANGLE with the sine and cosine of x."""
    return x if abs(x) < MAX_ANGLE else math.atan2(math.sin(x), math.cos(x))


@nk.kernel
def sine_and_cosine(x):
    """Sine and cosine of |x| < MAX_ANGLE, without a branch.

    Errors are below one unit in the last place of 1. The nearest multiple of π/2 is subtracted in
    two parts (Cody and Waite 1980). The polynomials are fdlibm's.
    """
    # x = n π/2 + y + t, with the nearest integer n; n times the first part of π/2 is exact.
    n = (x * (2.0 / math.pi) + TO_NEAREST) - TO_NEAREST
    r = x - n * HALF_PI[0]
    w = n * HALF_PI[1]
    y = r - w
    t = (r - y) - w  # rounding error of y
    # Sine and cosine of y + t: to first order t adds t (1 − y²/2) to the sine, −y t to the cosine.
    z = y * y
    v = z * y
    half = 0.5 * z
    p = SINE[1] + z * (SINE[2] + z * (SINE[3] + z * (SINE[4] + z * SINE[5])))
    s = y - ((z * (0.5 * t - v * p) - t) - v * SINE[0])
    p = z * (
        COSINE[0]
        + z * (COSINE[1] + z * (COSINE[2] + z * (COSINE[3] + z * (COSINE[4] + z * COSINE[5]))))
    )
    # 1 − y²/2 + …: (1 − rounded) − y²/2 is the rounding error of the first difference.
    rounded = 1.0 - half
    c = rounded + (((1.0 - rounded) - half) + (z * p - y * t))
    # n = 2 turns + odd. An odd n swaps sine and cosine; odd turns change the sign of both.
    odd = n - 2.0 * ((0.5 * n + TO_NEAREST) - TO_NEAREST)
    odd = odd * odd  # 1 where n is odd, else 0
    even = 1.0 - odd
    turns = 0.5 * (n - odd)
    back = turns - 2.0 * ((0.5 * turns + TO_NEAREST) - TO_NEAREST)
    sign = 1.0 - 2.0 * back * back
    # cos(y + π/2) = −sin y: even − odd is −1 where n is odd.
    return sign * (even * s + odd * c), sign * (even - odd) * (even * c + odd * s)
