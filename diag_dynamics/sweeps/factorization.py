# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The factorization M = [I + HφK] D [I + HφK]ᵀ.

The factors are applied without being formed (Tables 1 and 2).
"""

import math

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.numerics.tables import flat
from diag_dynamics.sweeps import groups, joints, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws


@nk.kernel
def factor_joint(body, direction, w, parent):
    """D and G of a body that is in no group (Algorithm 4.1); return whether it moves inertia.

    P⁺ is added to its parent.
    """
    # D = SᵀPS + armature and G = P S D⁻¹
    P = records.inertia_of(w.P)
    D, column, G = joints.joint_inertia(direction, w.armature, P)
    w.D = D
    if joints.is_singular(joints.scale_along(direction, w), D):
        return False
    records.set_force(w.G, G)
    # P⁺ = P − G (P S)ᵀ, in the axes of the parent
    if body.parent > 0:
        joints.accumulate_inertia(w, sp.less_rank_one(P, G, column), parent)
    return True


@nk.kernel
def factorize_group(robot, last):
    """D and G of a group; returns a status."""
    bodies, _, work, table = ws.opened(robot)
    first = bodies[last].first
    # 𝓜 of the group, then its degrees of freedom are eliminated one by one
    groups.compose(bodies, first, last, work, table[0])
    return groups.eliminate(bodies, first, last, work, table[0])


@nk.large_kernel
def factorize(robot):
    """D and G of all initialized bodies; returns 0, or the body of a singular joint."""
    bodies, _, work, _ = ws.opened(robot)
    # From the tips to the base; i is the last body of a group
    i = len(bodies) - 1
    while i > 0:
        body = bodies[i]
        if groups.is_grouped(body):
            status = ws.step_group(robot, ws.FACTORIZE, (robot, i))
            if status != 0:
                return status
        elif not factor_joint(body, body.direction, work[i], work[body.parent]):
            return i
        i = body.first - 1
    return 0


@nk.large_kernel
def factorize_at(robot, q):
    """D and G of every body at the positions q."""
    bodies, _, work, _ = ws.opened(robot)
    status = joints.initialize(bodies, q, work)
    return status if status != 0 else factorize(robot)


@nk.large_kernel
def scale_by_inertia(bodies, work, exponent, x):
    """D to the power 1, 1/2, −1/2 or −1, times x, in place."""
    for i in range(1, len(bodies)):
        if groups.is_leader(bodies, i):
            D = work[i].D
            factor = D if abs(exponent) == 1.0 else math.sqrt(D)
            x[bodies[i].dof] = (
                x[bodies[i].dof] * factor if exponent > 0.0 else x[bodies[i].dof] / factor
            )


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, records.WRENCHES, nk.FLAG, nk.FILLED_MATRIX)
def factor_of_wrenches(robot, q, wrenches, in_world, epsilon):
    """ℓJᵀw of each wrench at a point of a body, a column of `epsilon` each.

    Each is a walk up the tree.
    """
    bodies, _, work, table = ws.opened(robot)
    status = factorize_at(robot, q)
    if status != 0:
        return status
    ws.clear(epsilon)
    for j in range(len(wrenches)):
        # κ of the wrench, then ε = D^−½ κ
        F = joints.wrench_on_body(bodies, wrenches[j], in_world, work)
        column = epsilon[:, j]
        groups.working_moments_of_wrench(bodies, wrenches[j].body, work, table[0], F, column)
        scale_by_inertia(bodies, work, -0.5, column)
    return 0


# --- Tables 1 and 2 over factorized bodies --------------------------------------------------------


@nk.large_kernel
def convert_rates(bodies, work, Q, to_xi, x, y):
    """Fill y = ξ = [I + HφK]ᵀq̇ of x = q̇, or y = q̇ = [I − HψK]ᵀξ of x = ξ (Table 1).

    In the second case y may be x.
    """
    qd = x if to_xi else y
    # From the base to the tips: V⁺ needs q̇ of all joints inboard, from x or from y
    joints.set_base_at_rest(work)
    for i in range(1, len(bodies)):
        # All rates of a group, because the leader of a follower may lie further out
        for j in range(i, bodies[i].last + 1):
            if i > bodies[i].first or not groups.is_leader(bodies, j):
                continue
            k = bodies[j].dof
            G = records.force_of(work[j].G)
            V_A = groups.base_motion(bodies, i, work)
            if groups.is_grouped(bodies[i]):
                induced = groups.induced_rate(bodies, j, V_A, qd, Q, G)
            else:
                # ξ = q̇ + Gᵀ V⁺ (5.3), where V⁺ is the velocity of the parent in axes of the body
                induced = sp.power(G, sp.motion_to_child(records.placement_of(work[i]), V_A))
            # In a group earlier degrees of freedom go first: q̇ of later ones needs theirs
            y[k] = x[k] + induced if to_xi else x[k] - induced
        joints.update_velocity(bodies[i], qd, work, work[i])


@nk.large_kernel
def _moments_inward(bodies, work, Q, is_kappa, moments):
    """κ = [I − HψK]τ in place of τ (Table 2), z⁺ = z + G κ; or τ = [I + HφK]κ in place of κ."""
    # From the tips to the base, with z = 0 at the tips
    for i in range(len(bodies)):
        ws.clear(work[i].z)
    i = len(bodies) - 1
    while i > 0:
        body = bodies[i]
        w = work[i]
        first = body.first
        z = records.force_of(w.z)
        if not groups.is_grouped(body):
            # τ = κ + Sᵀ z, or κ = τ − Sᵀ z (5.4); z⁺ = z + G κ
            moment = moments[body.dof]
            induced = sp.along(body.direction, z)
            moments[body.dof] = moment + induced if is_kappa else moment - induced
            kappa = moment if is_kappa else moments[body.dof]
            z = sp.add_force(z, sp.scale_force(records.force_of(w.G), kappa))
            z = sp.force_to_parent(records.placement_of(w), z)
        elif is_kappa:
            # The group alone, then the moments of z of its bodies
            z = groups.filter_moments(bodies, first, i, work, Q, 1.0, moments)
            z = sp.add_force(z, groups.gather(bodies, first, i, work, 1.0, moments))
        else:
            # The same steps in reverse order
            z = groups.gather(bodies, first, i, work, -1.0, moments)
            z = sp.add_force(z, groups.filter_moments(bodies, first, i, work, Q, -1.0, moments))
        records.add_to_force(work[bodies[first].parent].z, z)
        i = first - 1


NU_FROM_QD, QD_FROM_NU, EPSILON_FROM_TAU, TAU_FROM_EPSILON = range(4)
"""Transformations: ν = mᵀq̇ and q̇ = ℓᵀν (Table 1), ε = ℓτ and τ = mε (Table 2)."""


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.VECTOR, nk.NUMBER, nk.FILLED_VECTOR)
def transform(robot, q, x, which, result):
    """Fill the transformed x."""
    bodies, _, work, table = ws.opened(robot)
    if not ws.lengths_match(robot, q, x, x):
        return ws.BAD_LENGTH
    status = factorize_at(robot, q) if joints.are_finite(x) else -1
    if status != 0:
        return status
    # mᵀ and ℓ scale by D^½ or D^−½ last, ℓᵀ and m first
    ws.copy(x, result)
    if which == NU_FROM_QD:
        convert_rates(bodies, work, table[0], True, x, result)
        scale_by_inertia(bodies, work, 0.5, result)
    elif which == QD_FROM_NU:
        scale_by_inertia(bodies, work, -0.5, result)
        convert_rates(bodies, work, table[0], False, result, result)
    elif which == EPSILON_FROM_TAU:
        _moments_inward(bodies, work, table[0], False, result)
        scale_by_inertia(bodies, work, -0.5, result)
    else:
        scale_by_inertia(bodies, work, 0.5, result)
        _moments_inward(bodies, work, table[0], True, result)
    return 0 if joints.are_finite(result) else -1


@nk.large_kernel
def qd_from_momentum(robot, q, added, momentum, qd):
    """q̇ = (M + diag(added))⁻¹ momentum.

    The added inertia enters D as armature does, and `inf` locks its joint.
    """
    bodies, _, work, table = ws.opened(robot)
    status = joints.initialize(bodies, q, work)
    # An infinite inertia makes G = 0 and ξ = 0, hence q̇ = 0
    for i in range(1, len(bodies)):
        if groups.is_leader(bodies, i):
            work[i].armature += added[bodies[i].dof]
    # κ = [I − HψK] p, ξ = D⁻¹ κ, q̇ = [I − HψK]ᵀ ξ
    if status == 0:
        status = factorize(robot)
    ws.copy(momentum, qd)
    _moments_inward(bodies, work, table[0], False, qd)
    scale_by_inertia(bodies, work, -1.0, qd)
    convert_rates(bodies, work, table[0], False, qd, qd)
    return status


# --- The factors of the mass matrix, column by column


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.FILLED_STATES, nk.FILLED_VECTOR)
def factors(robot, q, m_l_unit, D):
    """Fill m = [I + HφK]D^½, ℓ = D^−½[I − HψK], the unit factor [I + HφK], and D (Identity 4.1).

    A unit working moment at joint j exerts the wrench G on the bodies inboard. Its moments along
    rigid joints are column j of the unit factor. The working moments of −G along articulated joints
    are column j of the inverse.
    """
    if not ws.positions_match(robot, q):
        return ws.BAD_LENGTH
    bodies, _, work, table = ws.opened(robot)
    status = factorize_at(robot, q)
    if status != 0:
        return status
    m = m_l_unit[0]
    inverse = m_l_unit[1]
    unit = m_l_unit[2]
    ws.clear(flat(m_l_unit))
    for i in range(1, len(bodies)):
        if groups.is_leader(bodies, i):
            j = bodies[i].dof
            D[j] = work[i].D
            _fill_column(bodies, i, work, table[0], unit[:, j], inverse[:, j])
            # m = [I + HφK] D^½: columns times √D
            root = math.sqrt(D[j])
            for row in range(j + 1):
                m[row, j] = unit[row, j] * root
    # ℓ = D^−½ [I − HψK]: rows over √D
    for row in range(len(D)):
        inverse_root = 1.0 / math.sqrt(D[row])
        for j in range(row, len(D)):
            inverse[row, j] *= inverse_root
    return 0


@nk.large_kernel
def _fill_column(bodies, i, work, Q, rigid, articulated):
    """Columns of [I + HφK] and [I − HψK] of the degree of freedom that body i owns."""
    body = bodies[i]
    w = work[i]
    rigid[body.dof] = articulated[body.dof] = 1.0
    base = bodies[body.first].parent
    if groups.is_grouped(body):
        # Rows of the group, and the wrenches on its base: H rigid, F articulated
        groups.filter_moments(bodies, body.first, i, work, Q, 1.0, rigid)
        F = groups.filter_moments(bodies, body.first, i, work, Q, -1.0, articulated)
        H = records.force_of(w.G)
    else:
        F = H = sp.force_to_parent(records.placement_of(w), records.force_of(w.G))
    # Rows of the bodies inboard
    groups.moments_of_wrench(bodies, base, 1, work, H, rigid)
    groups.working_moments_of_wrench(bodies, base, work, Q, sp.scale_force(F, -1.0), articulated)
