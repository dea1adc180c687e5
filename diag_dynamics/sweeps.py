"""The recursions over the links: the only place with the physics, compiled by numba.

Names are those of Jain and Rodriguez (1995), written in body frames and base-to-tip order. There is one body for each
degree of freedom: body i > 0 is the one that degree of freedom i - 1 moves, body 0 the world, and a parent comes before
its children. Outward sweeps run from the base to the tips, inward ones back, and each does a fixed amount of work per
body. A joint of several degrees of freedom is as many bodies in one and the same frame, all but the last without
inertia: the recursion then takes the factor U D Uᵀ of its block entry by entry, as of all the rest. Only what depends
on how the frame itself moves (ζ and Ṗ) belongs to the joint as a whole.

    X   placement of a body in its parent         P   articulated body inertia (Riccati, Algorithm 4.1)
    S   direction of the degree of freedom        D   SᵀPS + armature, articulated joint inertia
    V   twist of the body                         G   P S D⁻¹
    V⁺  parent's twist seen in the body           Ṗ   rate of P in the body frame (the paper's λ̇)
    v_J motion of the joint, sum of S q̇           P⁺, Ṗ⁺, y⁺, z⁺   the same beyond the joint, τ̄ = I − G Sᵀ applied
    ζ   V × v_J, velocity-dependent acceleration

`bodies` are the records of RobotModel (see model), `work` those of :data:`WORK`, one each per body. Sweeps that can fail
return a status: 0, `i` if body i has no articulated inertia, -1 if an input is not finite or no orientation, or is so
large that a result is not finite.
"""

import math

import numpy as np

from diag_dynamics.kernel import entry_kernel, kernel
from diag_dynamics.spatial import (
    ANGULAR_X,
    ANGULAR_Z,
    ZERO,
    Force,
    Inertia,
    Motion,
    Placement,
    add,
    add_force,
    add_motion,
    along,
    apply,
    apply_transposed,
    column_along,
    cross,
    cross_force,
    cross_motion,
    dot,
    force_to_parent,
    inertia_times,
    inertia_to_parent,
    less_rank_one,
    less_rank_two,
    motion_along,
    motion_to_child,
    power,
    product,
    rigid_inertia,
    rigid_momentum,
    rotation_of_quaternion,
    scale,
    scale_force,
    subtract_force,
    subtract_motion,
    transport,
    transport_along_z,
    turned_about_z,
)

WORK = np.dtype(
    [
        ("rotation", "f8", 9),
        ("translation", "f8", 3),
        ("orientation", "f8", 9),
        ("V", "f8", 6),
        ("acceleration", "f8", 6),
        ("P", "f8", 21),
        ("P_rate", "f8", 21),
        ("magnitude", "f8", 2),
        ("D", "f8"),
        ("G", "f8", 6),
        ("y", "f8", 6),
        ("z", "f8", 6),
        ("u", "f8", 6),
        ("inboard", "f8", 3),
    ],
    align=True,
)
"""Workspace of one body; which fields are alive depends on the sweep."""

WRENCH = np.dtype(
    [("body", "i8"), ("point", "f8", 3), ("force", "f8", 3), ("moment", "f8", 3)],
    align=True,
)
"""An external wrench at a point of a body, the point in the body's frame [m], force [N] and moment [N m]."""

NU, XI, EPSILON, KAPPA, CORIOLIS, CORIOLIS_UNNORMALIZED, GRAVITY, ARTICULATED_INERTIA = range(8)
"""Rows of the output of :func:`evaluate`."""

PLANAR, FLOATING = 3, 6
"""Degrees of freedom of the joints that have several; they name the joint."""

UNIT_TOLERANCE = 1e-3
"""How far from 1 the squared length of an orientation's quaternion may be; it is normalized."""

SINGULAR = 1e-10
"""A joint counts as moving no inertia where D is below this part of the inertias that D is the remainder of."""

# --- Records to tuples and back ---------------------------------------------------------------------------


@kernel
def _vector(a):
    return (a[0], a[1], a[2])


@kernel
def _matrix(a):
    return ((a[0], a[1], a[2]), (a[3], a[4], a[5]), (a[6], a[7], a[8]))


@kernel
def _symmetric(a):
    return ((a[0], a[1], a[2]), (a[1], a[3], a[4]), (a[2], a[4], a[5]))


@kernel
def _motion(a):
    return Motion((a[0], a[1], a[2]), (a[3], a[4], a[5]))


@kernel
def _force(a):
    return Force((a[0], a[1], a[2]), (a[3], a[4], a[5]))


@kernel
def _inertia(a):
    return Inertia(
        ((a[0], a[1], a[2]), (a[1], a[3], a[4]), (a[2], a[4], a[5])),
        ((a[6], a[7], a[8]), (a[9], a[10], a[11]), (a[12], a[13], a[14])),
        ((a[15], a[16], a[17]), (a[16], a[18], a[19]), (a[17], a[19], a[20])),
    )


@kernel
def _placement(w):
    return Placement(_matrix(w.rotation), _vector(w.translation))


@kernel
def _set_vector(a, first, v):
    a[first], a[first + 1], a[first + 2] = v


@kernel
def _set_motion(a, V):
    _set_vector(a, 0, V.linear)
    _set_vector(a, 3, V.angular)


@kernel
def _set_force(a, F):
    _set_vector(a, 0, F.force)
    _set_vector(a, 3, F.moment)


@kernel
def _add_to_force(a, F):
    _set_force(a, add_force(_force(a), F))


@kernel
def _set_matrix(a, M):
    _set_vector(a, 0, M[0])
    _set_vector(a, 3, M[1])
    _set_vector(a, 6, M[2])


@kernel
def _set_placement(w, X):
    _set_matrix(w.rotation, X.rotation)
    _set_vector(w.translation, 0, X.translation)


@kernel
def _set_inertia(a, P):
    a[0], a[1], a[2], a[3], a[4], a[5] = P.A[0] + P.A[1][1:] + P.A[2][2:]
    for row in range(3):
        _set_vector(a, 6 + 3 * row, P.B[row])
    a[15], a[16], a[17], a[18], a[19], a[20] = P.C[0] + P.C[1][1:] + P.C[2][2:]


@kernel
def _add_to_inertia(a, P):
    Q = _inertia(a)
    _set_inertia(
        a,
        Inertia(
            (add(Q.A[0], P.A[0]), add(Q.A[1], P.A[1]), add(Q.A[2], P.A[2])),
            (add(Q.B[0], P.B[0]), add(Q.B[1], P.B[1]), add(Q.B[2], P.B[2])),
            (add(Q.C[0], P.C[0]), add(Q.C[1], P.C[1]), add(Q.C[2], P.C[2])),
        ),
    )


# --- Steps that several sweeps share ----------------------------------------------------------------------


@kernel
def _place(body, q, w):
    """X of the body at the positions q, kept in its workspace; the later bodies of a joint are where the first is."""
    rotation, translation = _matrix(body.rotation), _vector(body.translation)
    if body.dofs == 1:
        position = q[body.q]
        if body.direction == ANGULAR_Z:
            rotation = turned_about_z(rotation, position)
        else:
            translation = add(translation, apply(rotation, (0.0, 0.0, position)))
    elif body.rank == 0:
        k = body.q
        if body.dofs == PLANAR:
            translation = add(translation, apply(rotation, (q[k], q[k + 1], 0.0)))
            rotation = turned_about_z(rotation, q[k + 2])
        else:
            translation = add(translation, apply(rotation, (q[k], q[k + 1], q[k + 2])))
            rotation = product(rotation, rotation_of_quaternion(q[k + 3], q[k + 4], q[k + 5], q[k + 6]))
    X = Placement(rotation, translation)
    _set_placement(w, X)
    return X


@kernel
def _are_positions(bodies, q):
    """Whether all positions are finite, and orientations near unit length."""
    for k in range(len(q)):
        if not math.isfinite(q[k]):
            return False
    for i in range(1, len(bodies)):
        if bodies[i].dofs == FLOATING and bodies[i].rank == 0:
            k = bodies[i].q + 3
            length = q[k] ** 2 + q[k + 1] ** 2 + q[k + 2] ** 2 + q[k + 3] ** 2
            if not abs(length - 1.0) < UNIT_TOLERANCE:
                return False
    return True


@kernel
def _are_finite(x):
    for k in range(len(x)):
        if not math.isfinite(x[k]):
            return False
    return True


@kernel
def _joint_motion(bodies, work, i):
    """v_J of the joint that body i, its first one, belongs to; V of all its bodies is known. And V of the last."""
    last = i + bodies[i].dofs - 1
    V = _motion(work[last].V)
    V_plus = motion_to_child(_placement(work[i]), _motion(work[bodies[i].parent].V))
    return subtract_motion(V, V_plus), V


@kernel
def _body_inertia(body):
    return rigid_inertia(body.mass, _vector(body.first_moment), _symmetric(body.inertia))


@kernel
def _momentum(body, V):
    """I V."""
    return rigid_momentum(body.mass, _vector(body.first_moment), _symmetric(body.inertia), V)


@kernel
def _start_inertia(body, w):
    """P of a body before its children have been added, and the magnitudes that D will be judged by."""
    rigid = _body_inertia(body)
    _set_inertia(w.P, rigid)
    w.magnitude[0] = 3.0 * body.mass
    w.magnitude[1] = rigid.C[0][0] + rigid.C[1][1] + rigid.C[2][2]


@kernel
def _joint_inertia(body, P):
    """D and G (Algorithm 4.1), with the armature that theory adds to D."""
    column = column_along(body.direction, P)
    D = along(body.direction, column) + body.armature
    return D, scale_force(column, 1.0 / D)


@kernel
def _is_singular(body, w, D):
    """Whether D is no more than what cancellation leaves of the inertias it came from."""
    magnitude = w.magnitude[0] if body.direction < ANGULAR_X else w.magnitude[1]
    return not SINGULAR * magnitude < D


@kernel
def _pass_inertia(X, P, P_plus, parent):
    """Add XᵀP⁺X to the parent's P, and the size of P itself to the parent's magnitudes."""
    _add_to_inertia(parent.P, inertia_to_parent(X, P_plus))
    linear = P.A[0][0] + P.A[1][1] + P.A[2][2]
    angular = P.C[0][0] + P.C[1][1] + P.C[2][2]
    parent.magnitude[0] += linear
    parent.magnitude[1] += angular + linear * dot(X.translation, X.translation)


@kernel
def _factorize(bodies, work):
    """Riccati sweep (Algorithm 4.1) over placed bodies: D and G of every one. Inward."""
    for i in range(1, len(bodies)):
        _start_inertia(bodies[i], work[i])
    for i in range(len(bodies) - 1, 0, -1):
        body, w = bodies[i], work[i]
        P = _inertia(w.P)
        D, G = _joint_inertia(body, P)
        if _is_singular(body, w, D):
            w.D = D
            return i
        w.D = D
        _set_force(w.G, G)
        if body.parent > 0:
            P_plus = less_rank_one(P, G, scale_force(G, D))
            _pass_inertia(_placement(w), P, P_plus, work[body.parent])
    return 0


@kernel
def _place_and_factorize(bodies, q, work):
    if not _are_positions(bodies, q):
        return -1
    for i in range(1, len(bodies)):
        _place(bodies[i], q, work[i])
    return _factorize(bodies, work)


@kernel
def _rest_at_world(work):
    _set_motion(work[0].V, Motion(ZERO, ZERO))


# --- Everything at one state ------------------------------------------------------------------------------


@kernel
def _evaluate_outward(bodies, gravity, q, qd, work):
    """V, gravity's acceleration, and what the inward sweep starts from."""
    world = work[0]
    _rest_at_world(work)
    _set_vector(world.acceleration, 0, scale(_vector(gravity), -1.0))
    for i in range(1, len(bodies)):
        body, w, parent = bodies[i], work[i], work[bodies[i].parent]
        X = _place(body, q, w)
        V = add_motion(motion_to_child(X, _motion(parent.V)), motion_along(body.direction, qd[i - 1]))
        _set_motion(w.V, V)
        _set_vector(w.acceleration, 0, apply_transposed(X.rotation, _vector(parent.acceleration)))
        _start_inertia(body, w)
        w.P_rate[:] = 0.0
        _set_force(w.y, cross_force(V, _momentum(body, V)))
        w.z[:] = 0.0


@kernel
def _pass_on(bodies, work, i, v_J, V, P, P_plus, filtered, moved, y_plus, z_plus):
    """Add what lies beyond joint i to its parent: XᵀP⁺X, XᵀṖ⁺X, Xᵀy⁺, Xᵀz⁺.

    `filtered` and `moved` are the two parts of Ṗ⁺, y_plus lacks P⁺ζ as yet.
    """
    X, parent = _placement(work[i]), work[bodies[i].parent]
    _pass_inertia(X, P, P_plus, parent)
    _add_to_inertia(parent.P_rate, inertia_to_parent(X, filtered))
    _add_to_inertia(parent.P_rate, inertia_to_parent(X, moved))
    zeta = cross_motion(V, v_J)
    _add_to_force(parent.y, force_to_parent(X, add_force(y_plus, inertia_times(P_plus, zeta))))
    _add_to_force(parent.z, force_to_parent(X, z_plus))


@kernel
def _evaluate_axis(bodies, i, qd, tau, work, out):
    """The inward step of :func:`evaluate` at a joint of one degree of freedom."""
    body, w = bodies[i], work[i]
    k, direction, rate = i - 1, body.direction, qd[i - 1]
    V, P, P_rate, y, z = _motion(w.V), _inertia(w.P), _inertia(w.P_rate), _force(w.y), _force(w.z)

    D, G = _joint_inertia(body, P)
    w.D = D
    if _is_singular(body, w, D):
        return i
    _set_force(w.G, G)
    root = math.sqrt(D)
    column = scale_force(G, D)

    # Total rate: own rate, and the rate induced by the base's motion (eq. 5.3)
    v_J = motion_along(direction, rate)
    xi = rate + power(G, subtract_motion(V, v_J))

    # Coriolis term, un-normalized Sᵀ[y − Ṗ(V − S ξ)] and normalized with half of the last part
    u = column_along(direction, P_rate)
    D_rate = along(direction, u)
    without_xi = along(direction, y) - power(u, V)

    kappa = tau[k] - along(direction, z)
    out[NU, k] = root * xi
    out[XI, k] = xi
    out[EPSILON, k] = kappa / root
    out[KAPPA, k] = kappa
    out[CORIOLIS, k] = (without_xi + 0.5 * D_rate * xi) / root
    out[CORIOLIS_UNNORMALIZED, k] = without_xi + D_rate * xi
    out[GRAVITY, k] = dot(column.force, _vector(w.acceleration)) / root
    out[ARTICULATED_INERTIA, k] = D

    if body.parent > 0:
        # P⁺ = τ̄ P;  Ṗ⁺ = τ̄ Ṗ τ̄ᵀ − (v_J×)ᵀP⁺ − P⁺(v_J×);  y⁺ = τ̄ y + P⁺ζ;  z⁺ = z + G κ
        P_plus = less_rank_one(P, G, column)
        filtered = less_rank_two(P_rate, G, subtract_force(u, scale_force(G, 0.5 * D_rate)))
        moved = transport_along_z(direction, rate, P_plus)
        y_plus = subtract_force(y, scale_force(G, along(direction, y)))
        z_plus = add_force(z, scale_force(G, kappa))
        _pass_on(bodies, work, i, v_J, V, P, P_plus, filtered, moved, y_plus, z_plus)
    return 0


@kernel
def _evaluate_block(bodies, first, qd, tau, work, out):
    """The inward step of :func:`evaluate` at a joint of several degrees of freedom, the first of which moves body `first`.

    With D = R Rᵀ, R upper triangular, ν = Rᵀξ' and C = R⁻¹Sᵀ[y − Ṗ(V − S ξ')] − Ṙᵀξ', where ξ' = q̇ + GᵀV⁺ belongs
    to the block as a whole. All of it is taken column by column: R = U √D, and Ṙ from the rates of G and D as the
    directions are eliminated one after the other.
    """
    last = first + bodies[first].dofs - 1
    end = work[last]
    v_J, V = _joint_motion(bodies, work, first)
    P, P_rate, y, z = _inertia(end.P), _inertia(end.P_rate), _force(end.y), _force(end.z)
    acceleration = Motion(_vector(end.acceleration), ZERO)
    before, before_rate, y_plus = P, P_rate, y

    for i in range(last, first - 1, -1):  # eliminate the directions: P, Ṗ, y and z as seen without those outboard
        body, w, k = bodies[i], work[i], i - 1
        if i < last:
            w.magnitude[0] = P.A[0][0] + P.A[1][1] + P.A[2][2]
            w.magnitude[1] = P.C[0][0] + P.C[1][1] + P.C[2][2]
        D, G = _joint_inertia(body, P)
        w.D = D
        if _is_singular(body, w, D):
            return i
        column = scale_force(G, D)
        u = column_along(body.direction, P_rate)
        D_rate = along(body.direction, u)
        kappa = tau[k] - along(body.direction, z)
        _set_force(w.G, G)
        _set_force(w.u, u)
        out[EPSILON, k] = kappa / math.sqrt(D)
        out[KAPPA, k] = kappa
        out[GRAVITY, k] = power(column, acceleration) / math.sqrt(D)
        out[ARTICULATED_INERTIA, k] = D
        P = less_rank_one(P, G, column)
        P_rate = less_rank_two(P_rate, G, subtract_force(u, scale_force(G, 0.5 * D_rate)))
        y_plus = subtract_force(y_plus, scale_force(G, along(body.direction, y_plus)))
        z = add_force(z, scale_force(G, kappa))

    rate = subtract_motion(V, v_J)  # V⁺, then with the joint's directions added one by one
    inboard = Motion(ZERO, ZERO)  # S ξ' of the directions before
    for i in range(first, last + 1):
        w, k, direction = work[i], i - 1, bodies[i].direction
        G = _force(w.G)
        xi = qd[k] + power(G, rate)
        out[XI, k] = xi
        out[NU, k] = math.sqrt(w.D) * xi
        own = power(G, inboard)
        w.inboard[0], w.inboard[1] = own, power(_force(w.u), inboard)
        rate = add_motion(rate, motion_along(direction, qd[k]))
        inboard = add_motion(inboard, motion_along(direction, xi - own))

    remainder = subtract_force(y, inertia_times(before_rate, subtract_motion(V, inboard)))
    for i in range(last, first - 1, -1):
        w, k, direction = work[i], i - 1, bodies[i].direction
        part = along(direction, remainder)
        D_rate = along(direction, _force(w.u))
        # ξ = ξ' + Gᵀ(inboard) is the entry's own un-normalized rate
        own, xi = w.inboard[0], out[XI, k]
        c = part - w.inboard[1] + D_rate * own - 0.5 * D_rate * xi
        out[CORIOLIS, k] = c / math.sqrt(w.D)
        out[CORIOLIS_UNNORMALIZED, k] = c + 0.5 * D_rate * xi
        remainder = subtract_force(remainder, scale_force(_force(w.G), part))

    if bodies[first].parent > 0:
        _pass_on(bodies, work, first, v_J, V, before, P, P_rate, transport(v_J, P), y_plus, z)
    return 0


@kernel
def _is_finite_result(out):
    """Whether every row is finite, and the kinetic energy too."""
    energy = 0.0
    for k in range(out.shape[1]):
        energy += out[NU, k] ** 2
    for row in range(out.shape[0]):
        if not _are_finite(out[row]):
            return False
    return math.isfinite(energy)


@entry_kernel
def evaluate(bodies, gravity, q, qd, tau, work, out, twists):
    """ν, ξ, ε, κ, C, C_ξ, ε_g and D at one state, in an outward and an inward sweep.

    Tables 1 and 2, Algorithms 4.1 and 7.1, Lemma 7.3. Rows of `out` are those of :data:`NU` and so on;
    `twists` receives V of every body.
    """
    if not (_are_positions(bodies, q) and _are_finite(qd) and _are_finite(tau)):
        return -1
    _evaluate_outward(bodies, gravity, q, qd, work)
    twists[0] = 0.0
    i = len(bodies) - 1
    while i > 0:
        twists[i] = work[i].V
        if bodies[i].dofs == 1:
            status = _evaluate_axis(bodies, i, qd, tau, work, out)
        else:
            status = _evaluate_block(bodies, i - bodies[i].dofs + 1, qd, tau, work, out)
        if status != 0:
            return status
        i -= bodies[i].dofs
    return 0 if _is_finite_result(out) else -1


@entry_kernel
def link_energy(bodies, links, twists, qd, out):
    """½VᵀIV of each link with inertia, in the frame of the body it belongs to, and ½ armature q̇² of its joint."""
    out[:] = 0.0
    for j in range(len(links)):
        link = links[j]
        V = _motion(twists[link.body])
        out[link.index] += 0.5 * power(_momentum(link, V), V)
    for i in range(1, len(bodies)):
        out[bodies[i].link] += 0.5 * bodies[i].armature * qd[i - 1] ** 2


# --- The factors ------------------------------------------------------------------------------------------


@entry_kernel
def joint_inertias(bodies, q, work, D, magnitude):
    """D of every joint; one that moves no inertia is passed over as if it were locked. For judging a model."""
    for i in range(1, len(bodies)):
        _place(bodies[i], q, work[i])
        _start_inertia(bodies[i], work[i])
    for i in range(len(bodies) - 1, 0, -1):
        body, w = bodies[i], work[i]
        P = _inertia(w.P)
        D[i - 1], G = _joint_inertia(body, P)
        magnitude[i - 1] = w.magnitude[0] if body.direction < ANGULAR_X else w.magnitude[1]
        if body.parent > 0:
            P_plus = P if _is_singular(body, w, D[i - 1]) else less_rank_one(P, G, scale_force(G, D[i - 1]))
            _pass_inertia(_placement(w), P, P_plus, work[body.parent])


@entry_kernel
def factors(bodies, q, work, unit, unit_inverse, D):
    """[I + HφK], its inverse [I − HψK], and D (Identity 4.1), column by column up the tree.

    A unit working moment at joint j leaves G of j behind; rigid transport of it gives the column of the one,
    transport through the articulated joints the column of the other.
    """
    status = _place_and_factorize(bodies, q, work)
    if status != 0:
        return status
    unit[:] = 0.0
    unit_inverse[:] = 0.0
    for j in range(1, len(bodies)):
        D[j - 1] = work[j].D
        unit[j - 1, j - 1] = 1.0
        unit_inverse[j - 1, j - 1] = 1.0
        rigid = force_to_parent(_placement(work[j]), _force(work[j].G))
        articulated = rigid
        i = bodies[j].parent
        while i > 0:
            direction, w = bodies[i].direction, work[i]
            unit[i - 1, j - 1] = along(direction, rigid)
            kappa = -along(direction, articulated)
            unit_inverse[i - 1, j - 1] = kappa
            X = _placement(w)
            rigid = force_to_parent(X, rigid)
            articulated = force_to_parent(X, add_force(articulated, scale_force(_force(w.G), kappa)))
            i = bodies[i].parent
    return 0


@kernel
def _rates_outward(bodies, qd, work, xi):
    """ξ = [I + HφK]ᵀq̇ (Table 1)."""
    _rest_at_world(work)
    for i in range(1, len(bodies)):
        body, w = bodies[i], work[i]
        V_plus = motion_to_child(_placement(w), _motion(work[body.parent].V))
        xi[i - 1] = qd[i - 1] + power(_force(w.G), V_plus)
        _set_motion(w.V, add_motion(V_plus, motion_along(body.direction, qd[i - 1])))


@kernel
def _own_rates_outward(bodies, xi, work, qd):
    """q̇ = [I − HψK]ᵀξ (Table 1, right); qd may be xi."""
    _rest_at_world(work)
    for i in range(1, len(bodies)):
        body, w = bodies[i], work[i]
        V_plus = motion_to_child(_placement(w), _motion(work[body.parent].V))
        qd[i - 1] = xi[i - 1] - power(_force(w.G), V_plus)
        _set_motion(w.V, add_motion(V_plus, motion_along(body.direction, qd[i - 1])))


@kernel
def _working_moments_inward(bodies, tau, work, kappa):
    """κ = [I − HψK]τ (Table 2); kappa may be tau."""
    for i in range(len(bodies)):
        work[i].z[:] = 0.0
    for i in range(len(bodies) - 1, 0, -1):
        body, w = bodies[i], work[i]
        z = _force(w.z)
        kappa[i - 1] = tau[i - 1] - along(body.direction, z)
        z_plus = add_force(z, scale_force(_force(w.G), kappa[i - 1]))
        _add_to_force(work[body.parent].z, force_to_parent(_placement(w), z_plus))


@kernel
def _moments_inward(bodies, kappa, work, tau):
    """τ = [I + HφK]κ (Table 2, right); tau may be kappa."""
    for i in range(len(bodies)):
        work[i].z[:] = 0.0
    for i in range(len(bodies) - 1, 0, -1):
        body, w = bodies[i], work[i]
        z = _force(w.z)
        z_plus = add_force(z, scale_force(_force(w.G), kappa[i - 1]))
        tau[i - 1] = kappa[i - 1] + along(body.direction, z)
        _add_to_force(work[body.parent].z, force_to_parent(_placement(w), z_plus))


@entry_kernel
def nu_from_qd(bodies, q, qd, work, nu):
    """ν = mᵀq̇ (Table 1)."""
    status = _place_and_factorize(bodies, q, work)
    if status == 0:
        _rates_outward(bodies, qd, work, nu)
        for i in range(1, len(bodies)):
            nu[i - 1] *= math.sqrt(work[i].D)
    return status


@entry_kernel
def qd_from_nu(bodies, q, nu, work, qd):
    """q̇ = ℓᵀν (Table 1, right)."""
    status = _place_and_factorize(bodies, q, work)
    if status == 0:
        for i in range(1, len(bodies)):
            qd[i - 1] = nu[i - 1] / math.sqrt(work[i].D)
        _own_rates_outward(bodies, qd, work, qd)
    return status


@entry_kernel
def epsilon_from_tau(bodies, q, tau, work, epsilon):
    """ε = ℓτ (Table 2)."""
    status = _place_and_factorize(bodies, q, work)
    if status == 0:
        _working_moments_inward(bodies, tau, work, epsilon)
        for i in range(1, len(bodies)):
            epsilon[i - 1] /= math.sqrt(work[i].D)
    return status


@entry_kernel
def tau_from_epsilon(bodies, q, epsilon, work, tau):
    """τ = mε (Table 2, right)."""
    status = _place_and_factorize(bodies, q, work)
    if status == 0:
        for i in range(1, len(bodies)):
            tau[i - 1] = epsilon[i - 1] * math.sqrt(work[i].D)
        _moments_inward(bodies, tau, work, tau)
    return status


@entry_kernel
def rates_with_added_inertia(bodies, q, nu, added, work, momentum, qd):
    """q̇ = (M + diag(added))⁻¹ m ν: rates after an implicit step of joint damping, or with joints held.

    The added inertia enters D as armature does; `inf` holds its joint. Nothing else is changed.
    """
    status = tau_from_epsilon(bodies, q, nu, work, momentum)
    if status != 0:
        return status
    for i in range(1, len(bodies)):
        _start_inertia(bodies[i], work[i])
    for i in range(len(bodies) - 1, 0, -1):
        body, w = bodies[i], work[i]
        P = _inertia(w.P)
        column = column_along(body.direction, P)
        w.D = along(body.direction, column) + body.armature + added[i - 1]
        G = scale_force(column, 1.0 / w.D)
        _set_force(w.G, G)
        if body.parent > 0:
            _pass_inertia(_placement(w), P, less_rank_one(P, G, column), work[body.parent])
    _working_moments_inward(bodies, momentum, work, qd)
    for i in range(1, len(bodies)):
        qd[i - 1] /= work[i].D
    _own_rates_outward(bodies, qd, work, qd)
    return 0


# --- The classical form -----------------------------------------------------------------------------------


@kernel
def _zeta(bodies, qd, work, i):
    """ζ of the joint whose first body is i."""
    if bodies[i].dofs == 1:
        return cross_motion(_motion(work[i].V), motion_along(bodies[i].direction, qd[i - 1]))
    v_J, V = _joint_motion(bodies, work, i)
    return cross_motion(V, v_J)


@entry_kernel
def forward_dynamics(bodies, gravity, q, qd, tau, work, qdd):
    """q̈ from τ: an outward, an inward and another outward sweep (theory: A₀ = −g, κ with gravity left in)."""
    if not (_are_positions(bodies, q) and _are_finite(qd) and _are_finite(tau)):
        return -1
    n = len(bodies)
    _rest_at_world(work)
    for i in range(1, n):
        body, w = bodies[i], work[i]
        X = _place(body, q, w)
        V = add_motion(motion_to_child(X, _motion(work[body.parent].V)), motion_along(body.direction, qd[i - 1]))
        _set_motion(w.V, V)
        _start_inertia(body, w)
        _set_force(w.y, cross_force(V, _momentum(body, V)))

    for i in range(n - 1, 0, -1):
        body, w, parent = bodies[i], work[i], work[bodies[i].parent]
        P, y = _inertia(w.P), _force(w.y)
        D, G = _joint_inertia(body, P)
        w.D = D
        if _is_singular(body, w, D):
            return i
        _set_force(w.G, G)
        remainder = tau[i - 1] - along(body.direction, y)
        qdd[i - 1] = remainder / D
        if body.parent > 0:
            X = _placement(w)
            P_plus = less_rank_one(P, G, scale_force(G, D))
            y_plus = add_force(y, scale_force(G, remainder))
            if body.rank == 0:
                y_plus = add_force(y_plus, inertia_times(P_plus, _zeta(bodies, qd, work, i)))
            _pass_inertia(X, P, P_plus, parent)
            _add_to_force(parent.y, force_to_parent(X, y_plus))

    _set_motion(work[0].acceleration, Motion(scale(_vector(gravity), -1.0), ZERO))
    for i in range(1, n):
        body, w = bodies[i], work[i]
        A = motion_to_child(_placement(w), _motion(work[body.parent].acceleration))
        if body.rank == 0:
            A = add_motion(A, _zeta(bodies, qd, work, i))
        qdd[i - 1] -= power(_force(w.G), A)
        _set_motion(w.acceleration, add_motion(A, motion_along(body.direction, qdd[i - 1])))
    return 0 if _are_finite(qdd) else -1


@entry_kernel
def inverse_dynamics(bodies, gravity, q, qd, qdd, work, tau):
    """τ = M q̈ + c + g (Newton–Euler, eq. 4.3)."""
    if not (_are_positions(bodies, q) and _are_finite(qd) and _are_finite(qdd)):
        return -1
    n = len(bodies)
    _rest_at_world(work)
    _set_motion(work[0].acceleration, Motion(scale(_vector(gravity), -1.0), ZERO))
    for i in range(1, n):
        body, w, parent = bodies[i], work[i], work[bodies[i].parent]
        X = _place(body, q, w)
        V = add_motion(motion_to_child(X, _motion(parent.V)), motion_along(body.direction, qd[i - 1]))
        A = add_motion(motion_to_child(X, _motion(parent.acceleration)), motion_along(body.direction, qdd[i - 1]))
        _set_motion(w.V, V)
        if body.rank == body.dofs - 1:  # the body of inertia; those of its joint before it have none
            A = add_motion(A, _zeta(bodies, qd, work, i - body.rank))
        _set_motion(w.acceleration, A)
        _set_force(w.y, add_force(_momentum(body, A), cross_force(V, _momentum(body, V))))
    for i in range(n - 1, 0, -1):
        body, w = bodies[i], work[i]
        y = _force(w.y)
        tau[i - 1] = along(body.direction, y) + body.armature * qdd[i - 1]
        if body.parent > 0:
            _add_to_force(work[body.parent].y, force_to_parent(_placement(w), y))
    return 0 if _are_finite(tau) else -1


@entry_kernel
def effort_of_wrenches(bodies, q, wrenches, in_world, work, tau):
    """Jᵀf of wrenches at points of bodies, in the axes of the body or of the world."""
    if not _are_positions(bodies, q):
        return -1
    n = len(bodies)
    _set_matrix(work[0].orientation, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    for i in range(1, n):
        X = _place(bodies[i], q, work[i])
        _set_matrix(work[i].orientation, product(_matrix(work[bodies[i].parent].orientation), X.rotation))
        work[i].y[:] = 0.0
    for j in range(len(wrenches)):
        wrench = wrenches[j]
        w = work[wrench.body]
        force, moment = _vector(wrench.force), _vector(wrench.moment)
        if in_world:
            R = _matrix(w.orientation)
            force, moment = apply_transposed(R, force), apply_transposed(R, moment)
        _add_to_force(w.y, Force(force, add(moment, cross(_vector(wrench.point), force))))
    for i in range(n - 1, 0, -1):
        body, w = bodies[i], work[i]
        y = _force(w.y)
        tau[i - 1] = along(body.direction, y)
        if body.parent > 0:
            _add_to_force(work[body.parent].y, force_to_parent(_placement(w), y))
    return 0


@entry_kernel
def mass_matrix(bodies, q, work, M):
    """M from the inertias of the composite rigid bodies outboard of each joint."""
    if not _are_positions(bodies, q):
        return -1
    n = len(bodies)
    for i in range(1, n):
        _place(bodies[i], q, work[i])
        _set_inertia(work[i].P, _body_inertia(bodies[i]))
    M[:] = 0.0
    for j in range(n - 1, 0, -1):
        body, w = bodies[j], work[j]
        X, P = _placement(w), _inertia(w.P)
        if body.parent > 0:
            _add_to_inertia(work[body.parent].P, inertia_to_parent(X, P))
        column = column_along(body.direction, P)
        M[j - 1, j - 1] = along(body.direction, column) + body.armature
        i = body.parent
        column = force_to_parent(X, column)
        while i > 0:
            M[i - 1, j - 1] = M[j - 1, i - 1] = along(bodies[i].direction, column)
            column = force_to_parent(_placement(work[i]), column)
            i = bodies[i].parent
    return 0


@entry_kernel
def first_moment(bodies, q, work, moment):
    """Σ m_i c_i of all moving bodies in the world's axes [kg m], in an inward sweep."""
    n = len(bodies)
    for i in range(n):
        if i > 0:
            _place(bodies[i], q, work[i])
        work[i].y[:] = 0.0
        work[i].y[0] = bodies[i].mass
        _set_vector(work[i].z, 0, _vector(bodies[i].first_moment))
    for i in range(n - 1, 0, -1):
        w, parent = work[i], work[bodies[i].parent]
        X = _placement(w)
        parent.y[0] += w.y[0]
        h = add(apply(X.rotation, _vector(w.z)), scale(X.translation, w.y[0]))
        _set_vector(parent.z, 0, add(_vector(parent.z), h))
    _set_vector(moment, 0, _vector(work[0].z))
