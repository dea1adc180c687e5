# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rates of M and its factors along a motion: Ṁ, ṁᵀx, the bracket B(q, ν)x, Ḋ."""

import math

from diag_dynamics.compiled.arrays import flat
from diag_dynamics.compiled.kernel import (
    FILLED_MATRIX,
    FILLED_VECTOR,
    ROBOT,
    VECTOR,
    entry_kernel,
    kernel,
    large_kernel,
)
from diag_dynamics.sweeps.bodies import add_to_force, force_of, motion_of, set_force, set_motion
from diag_dynamics.sweeps.groups import (
    compose,
    compose_rates,
    eliminate,
    eliminate_rate,
    filter_moments,
    gather_bias,
    induced_rate,
    momentum_rate,
    owns,
    rate_inboard,
)
from diag_dynamics.sweeps.joints import (
    are_finite,
    are_positions,
    force_inboard,
    joint_motion,
    momentum,
    motion_outboard,
    move,
    own_motion,
    rest_at_world,
    start,
)
from diag_dynamics.sweeps.spatial import (
    ZERO,
    Motion,
    add_force,
    add_motion,
    along,
    cross_force,
    cross_motion,
    power,
    scale_force,
)
from diag_dynamics.sweeps.workspace import clear, opened


@large_kernel
def _start(bodies, q, qd, work):
    """Placed bodies with their own inertias, at rest as yet."""
    if not (are_positions(bodies, q) and are_finite(qd)):
        return -1
    start(bodies, q, work)
    return 0


@large_kernel
def _factorize_with_rates(bodies, q, qd, work, table):
    """D, G and g of every degree of freedom and, of the row c of 𝓜̇ that it was eliminated with, u and Q̇[:, c].

    Every joint is taken as a group here: what these sweeps need is in the axes of what carries it.
    """
    status = _start(bodies, q, qd, work)
    last = len(bodies) - 1
    while status == 0 and last > 0:
        first = bodies[last].first
        compose(bodies, first, last, work, table[0])
        compose_rates(bodies, first, last, qd, work, table[1])
        status = eliminate(bodies, first, last, work, table[0], False)
        for i in range(last, first - 1, -1):
            if status == 0 and owns(bodies, i):
                eliminate_rate(bodies, first, i, work, table[0], table[1])
        last = first - 1
    return status


@kernel
def _carry(bodies, i, qd, x, work):
    """W of body i for rates x, and its rate in the body's axes along the motion q̇, x constant."""
    body, w, parent = bodies[i], work[i], work[bodies[i].parent]
    W = motion_outboard(body, w, motion_of(parent.W))
    rate = motion_outboard(body, w, motion_of(parent.W_rate))
    rate = add_motion(rate, cross_motion(W, joint_motion(bodies, i, qd)))
    W = add_motion(W, own_motion(body, x))
    set_motion(w.W, W)
    set_motion(w.W_rate, rate)


@kernel
def _still_world(work):
    """W of the world, and its rate."""
    set_motion(work[0].W, Motion(ZERO, ZERO))
    set_motion(work[0].W_rate, Motion(ZERO, ZERO))


@entry_kernel(ROBOT, VECTOR, VECTOR, FILLED_VECTOR, FILLED_VECTOR)
def articulated_inertias(robot, q, qd, D, D_rate):
    """D and Ḋ along the motion (7.2)."""
    bodies, _, work, table = opened(robot)
    status = _factorize_with_rates(bodies, q, qd, work, table)
    if status != 0:
        return status
    for i in range(1, len(bodies)):
        if owns(bodies, i):
            body = bodies[i]
            D[body.dof], D_rate[body.dof] = work[i].D, table[1, body.dof, body.dof - body.start]
    return 0 if are_finite(D_rate) else -1


@entry_kernel(ROBOT, VECTOR, VECTOR, FILLED_MATRIX, FILLED_MATRIX)
def mass_matrix_rate(robot, q, qd, M, M_rate):
    """M and Ṁ along the motion (Identity 6.3): the whole robot as one group."""
    bodies, _, work, _ = opened(robot)
    status = _start(bodies, q, qd, work)
    if status != 0:
        return status
    if len(bodies) > 1:
        compose(bodies, 1, len(bodies) - 1, work, M)
        compose_rates(bodies, 1, len(bodies) - 1, qd, work, M_rate)
    return 0 if are_finite(flat(M_rate)) else -1


@entry_kernel(ROBOT, VECTOR, VECTOR, VECTOR, FILLED_VECTOR)
def mass_matrix_rate_times(robot, q, qd, x, result):
    """Ṁx: the rate of the momenta M x while x is constant, in an outward and an inward sweep."""
    bodies, _, work, _ = opened(robot)
    status = _start(bodies, q, qd, work)
    if status != 0 or not are_finite(x):
        return -1
    _still_world(work)
    for i in range(1, len(bodies)):
        body, w = bodies[i], work[i]
        _carry(bodies, i, qd, x, work)
        set_force(w.y, momentum(body, motion_of(w.W)))
        set_force(w.z, momentum(body, motion_of(w.W_rate)))
    clear(result)
    for i in range(len(bodies) - 1, 0, -1):
        body, w = bodies[i], work[i]
        h, rate = force_of(w.y), force_of(w.z)
        result[body.dof] += body.multiplier * along(body.direction, rate)
        if body.parent > 0:
            add_to_force(work[body.parent].z, rate_inboard(bodies, i, qd, work, h, rate))
            add_to_force(work[body.parent].y, force_inboard(body, w, h))
    return 0 if are_finite(result) else -1


@kernel
def _two_velocity_force(body, V, W):
    """b_x = ½[W ×* IV + V ×* IW + I(V × W)], bilinear, V ×* IV where W is V."""
    sum_ = add_force(cross_force(W, momentum(body, V)), cross_force(V, momentum(body, W)))
    return scale_force(add_force(sum_, momentum(body, cross_motion(V, W))), 0.5)


@entry_kernel(ROBOT, VECTOR, VECTOR, VECTOR, FILLED_VECTOR)
def coriolis_product(robot, q, qd, x, result):
    """C_s(q, q̇) x with C_s q̇ = c and Ṁ − 2C_s skew: Newton–Euler with two velocities."""
    bodies, _, work, _ = opened(robot)
    status = _start(bodies, q, qd, work)
    if status != 0 or not are_finite(x):
        return -1
    rest_at_world(work)
    _still_world(work)
    for i in range(1, len(bodies)):
        body, w = bodies[i], work[i]
        V = move(body, qd, work, w)
        _carry(bodies, i, qd, x, work)
        b = _two_velocity_force(body, V, motion_of(w.W))
        set_force(w.y, add_force(momentum(body, motion_of(w.W_rate)), b))
    clear(result)
    for i in range(len(bodies) - 1, 0, -1):
        body, w = bodies[i], work[i]
        y = force_of(w.y)
        result[body.dof] += body.multiplier * along(body.direction, y)
        if body.parent > 0:
            add_to_force(work[body.parent].y, force_inboard(body, w, y))
    return 0 if are_finite(result) else -1


@entry_kernel(ROBOT, VECTOR, VECTOR, VECTOR, FILLED_VECTOR)
def m_rate_transposed(robot, q, qd, x, result):
    """ṁᵀx, x constant: D^−½[𝓜̇_c (W_A, x) − ½ Ḋ η] + D^½ GᵀẆ_A with η = D^−½ mᵀx."""
    bodies, _, work, table = opened(robot)
    if not are_finite(x):
        return -1
    status = _factorize_with_rates(bodies, q, qd, work, table)
    if status != 0:
        return status
    _still_world(work)
    for i in range(1, len(bodies)):
        body, w = bodies[i], work[i]
        if owns(bodies, i):
            k, carrier = body.dof, work[bodies[body.first].parent]
            W_A, G = motion_of(carrier.W), force_of(w.G)
            eta = x[k] + induced_rate(bodies, i, W_A, x, table[0], G)
            rate = momentum_rate(bodies, i, W_A, x, work, table[1]) - 0.5 * table[1, k, k - body.start] * eta
            result[k] = rate / math.sqrt(w.D) + math.sqrt(w.D) * power(G, motion_of(carrier.W_rate))
        _carry(bodies, i, qd, x, work)
    return 0 if are_finite(result) else -1


@entry_kernel(ROBOT, VECTOR, VECTOR, VECTOR, *[FILLED_VECTOR] * 3)
def coriolis_bracket(robot, q, qd, x, eta, u, result):
    """B(q, ν)x, skew, B ν = C: an outward and an inward sweep over factorized bodies.

    Outward u = ℓᵀx and W; inward the recursion of C with W in place of one of its velocities.
    """
    bodies, _, work, table = opened(robot)
    if not are_finite(x):
        return -1
    status = _factorize_with_rates(bodies, q, qd, work, table)
    if status != 0:
        return status
    rest_at_world(work)
    _still_world(work)
    for i in range(1, len(bodies)):
        body, w = bodies[i], work[i]
        if i == body.first:
            W_A = motion_of(work[body.parent].W)
            for j in range(i, body.last + 1):
                if owns(bodies, j):
                    k = bodies[j].dof
                    eta[k] = x[k] / math.sqrt(work[j].D)
                    u[k] = eta[k] - induced_rate(bodies, j, W_A, u, table[0], force_of(work[j].G))
        V = move(body, qd, work, w)
        W = add_motion(motion_outboard(body, w, motion_of(work[body.parent].W)), own_motion(body, u))
        set_motion(w.W, W)
        set_force(w.y, _two_velocity_force(body, V, W))
    clear(result)
    last = len(bodies) - 1
    while last > 0:
        first = bodies[last].first
        y = gather_bias(bodies, first, last, qd, work, work.W, -1.0, result)
        y = add_force(y, filter_moments(bodies, first, last, work, table[0], result))
        carrier = bodies[first].parent
        W_A = motion_of(work[carrier].W)
        for i in range(first, last + 1):
            if owns(bodies, i):
                k = bodies[i].dof
                D_rate = table[1, k, k - bodies[i].start]
                rate = momentum_rate(bodies, i, W_A, u, work, table[1])
                result[k] = (-result[k] - rate + 0.5 * D_rate * eta[k]) / math.sqrt(work[i].D)
        if carrier > 0:
            add_to_force(work[carrier].y, y)
        last = first - 1
    return 0 if are_finite(result) else -1
