# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rates of M and its factor along a motion: Ṁ, C_s x, ṁᵀx."""

import math

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.numerics.tables import flat
from diag_dynamics.sweeps import groups, joints, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws


@nk.large_kernel
def _initialize(bodies, q, qd, x, work):
    """Placed bodies with their own inertias, at rest as yet; checks further rates x."""
    if not (joints.are_finite(qd) and joints.are_finite(x)):
        return -1
    joints.set_base_at_rest(work)
    status = joints.initialize(bodies, q, work)
    joints.couple_rates(qd, work)
    return status


@nk.large_kernel
def _factorize_with_rates(bodies, q, qd, x, work, table):
    """D, G, g, u and Q̇[:, c] of every degree of freedom, in the axes of the base of its joint.

    Each joint counts as a group.
    """
    status = _initialize(bodies, q, qd, x, work)
    last = len(bodies) - 1
    # From the tips to the base: 𝓜, 𝓜̇, then D, G and g, for joints of one degree of freedom too
    while status == 0 and last > 0:
        first = bodies[last].first
        groups.compose(bodies, first, last, work, table[0])
        groups.compose_rates(bodies, first, last, qd, work, table[1])
        status = groups.eliminate(bodies, first, last, work, table[0])
        # Column c of 𝓜̇ remains as it is at the elimination of c
        for i in range(last, first - 1, -1):
            if status == 0 and groups.is_leader(bodies, i):
                groups.eliminate_rate(bodies, first, i, work, table[0], table[1])
        last = first - 1
    return status


@nk.kernel
def _propagate_rates(bodies, i, qd, x, work):
    """W of body i for rates x, and its rate in the body's axes along the motion q̇, x constant."""
    body = bodies[i]
    w = work[i]
    parent = work[bodies[i].parent]
    # W⁺ and X Ẇ_p; bodies of a joint share a frame, and v_J is zero but at the first of them
    W = joints.motion_outboard(body, w, records.motion_of(parent.W))
    rate = joints.motion_outboard(body, w, records.motion_of(parent.W_rate))
    # Ẇ = X Ẇ_p + W⁺ × v_J + S Ġ x, and W = W⁺ + S x
    rate = sp.add_motion(rate, sp.cross_motion(W, joints.joint_motion(bodies, i, qd, work)))
    W = sp.add_motion(W, joints.own_motion(body, w, x))
    rate = sp.add_motion(rate, sp.motion_along(body.direction, w.multiplier_rate * x[body.dof]))
    records.set_motion(w.W, W)
    records.set_motion(w.W_rate, rate)


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.VECTOR, nk.FILLED_MATRIX, nk.FILLED_MATRIX)
def mass_matrix_rate(robot, q, qd, M, M_rate):
    """M and Ṁ along the motion (Identity 6.3): the whole robot as one group."""
    bodies, _, work, _ = ws.opened(robot)
    status = _initialize(bodies, q, qd, qd, work)
    if status != 0:
        return status
    if len(bodies) > 1:
        # All bodies as one group, on the world: its Q and Q̇ are M and Ṁ
        groups.compose(bodies, 1, len(bodies) - 1, work, M)
        groups.compose_rates(bodies, 1, len(bodies) - 1, qd, work, M_rate)
    return 0 if joints.are_finite(flat(M_rate)) else -1


@nk.kernel
def _two_velocity_force(body, V, W):
    """b_x = ½[W ×* IV + V ×* IW + I(V × W)], bilinear, V ×* IV where W is V."""
    sum_ = sp.add_force(
        sp.cross_force(W, joints.momentum(body, V)), sp.cross_force(V, joints.momentum(body, W))
    )
    return sp.scale_force(sp.add_force(sum_, joints.momentum(body, sp.cross_motion(V, W))), 0.5)


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.FILLED_VECTOR)
def coriolis_matrix_times(robot, q, qd, x, result):
    """C_s(q, q̇) x with C_s q̇ = c and Ṁ − 2C_s skew: Newton–Euler with two velocities."""
    bodies, _, work, _ = ws.opened(robot)
    status = _initialize(bodies, q, qd, x, work)
    if status != 0:
        return status
    # From the base to the tips: V of q̇, and W and Ẇ of x
    for i in range(1, len(bodies)):
        body = bodies[i]
        w = work[i]
        V = joints.update_velocity(body, qd, work, w)
        _propagate_rates(bodies, i, qd, x, work)
        # f = I Ẇ + b_x
        b = _two_velocity_force(body, V, records.motion_of(w.W))
        records.set_force(w.y, sp.add_force(joints.momentum(body, records.motion_of(w.W_rate)), b))
    ws.clear(result)
    for i in range(1, len(bodies)):
        if bodies[i].armature != 0.0:
            # A rotor accelerates where ratios change.
            changing = joints.ratio_rate(bodies, joints.turning(bodies, i), x, work)
            result[bodies[i].dof] += work[i].multiplier * bodies[i].armature * changing
    # From the tips to the base: C_s x = Sᵀf
    joints.moments_inward(bodies, work, result)
    return 0 if joints.are_finite(result) else -1


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.FILLED_VECTOR)
def m_rate_transposed_times(robot, q, qd, x, result):
    """ṁᵀx, x constant: D^−½[𝓜̇_c (W_A, x) − ½ Ḋ η] + D^½ GᵀẆ_A with η = D^−½ mᵀx."""
    bodies, _, work, table = ws.opened(robot)
    status = _factorize_with_rates(bodies, q, qd, x, work, table)
    if status != 0:
        return status
    for i in range(1, len(bodies)):
        body = bodies[i]
        w = work[i]
        if groups.is_leader(bodies, i):
            k = body.dof
            base = work[bodies[body.first].parent]
            W_A = records.motion_of(base.W)
            G = records.force_of(w.G)
            # η = x + Gᵀ W_A + Σ g_b x_b, which is ξ of the rates x
            eta = x[k] + groups.induced_rate(bodies, i, W_A, x, table[0], G)
            rate = (
                groups.momentum_rate(bodies, i, W_A, x, work, table[1])
                - 0.5 * table[1, k, k - body.start] * eta
            )
            result[k] = rate / math.sqrt(w.D) + math.sqrt(w.D) * sp.power(
                G, records.motion_of(base.W_rate)
            )
        _propagate_rates(bodies, i, qd, x, work)
    return 0 if joints.are_finite(result) else -1
