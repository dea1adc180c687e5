# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""ν̇ = ε − C − ε_g over bodies that are factorized: what evaluation computes, but for the recursion of P."""

import math

from diag_dynamics.numerics.kernel import kernel, large_kernel
from diag_dynamics.sweeps import groups, joints, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps.workspace import clear, opened


@large_kernel
def _outward(bodies, gravity, work):
    """Gravity's acceleration, and what the inward sweep starts from; Ṗ is zero since the factorization."""
    world = sp.scale(records.vector_of(gravity), -1.0)
    records.set_vector(work[0].acceleration, 0, world)
    for i in range(1, len(bodies)):
        w, parent = work[i], work[bodies[i].parent]
        R, V = records.matrix_of(w.rotation), records.motion_of(w.V)
        acceleration = sp.apply_transposed(R, records.vector_of(parent.acceleration))
        records.set_vector(w.acceleration, 0, acceleration)
        records.set_force(w.y, sp.cross_force(V, joints.momentum(bodies[i], V)))
        clear(w.z)


@kernel
def _inward_joint(direction, body, rate, tau, w, parent):
    """ν̇ of a joint of one degree of freedom; Ṗ⁺, y⁺ and z⁺ go to its parent: see evaluation.inward_joint."""
    P, P_rate, G = records.inertia_of(w.P), records.inertia_of(w.P_rate), records.force_of(w.G)
    V, y, z = records.motion_of(w.V), records.force_of(w.y), records.force_of(w.z)
    column, u = sp.column_along(direction, P), sp.column_along(direction, P_rate)
    D_rate, root = sp.along(direction, u), math.sqrt(w.D)
    xi = rate + sp.power(G, sp.subtract_motion(V, sp.motion_along(direction, rate)))
    bias, kappa = sp.along(direction, y), tau - sp.along(direction, z)
    coriolis = (bias - sp.power(u, V) + 0.5 * D_rate * xi) / root
    weight = sp.dot(column.force, records.vector_of(w.acceleration)) / root
    if body.parent > 0:
        X, zeta = records.placement_of(w), sp.cross_along_z(direction, V, rate)
        y_plus = sp.subtract_force(y, sp.scale_force(G, bias + sp.power(column, zeta)))
        y_plus = sp.add_force(y_plus, sp.inertia_times(P, zeta))
        z_plus = sp.add_force(z, sp.scale_force(G, kappa))
        h = sp.subtract_force(u, sp.scale_force(G, 0.5 * D_rate))
        moved = sp.transport_along_z(direction, rate, sp.less_rank_one(P, G, column))
        rate_plus = sp.add_inertia(sp.less_rank_two(P_rate, G, h), moved)
        records.add_to_inertia(parent.P_rate, sp.inertia_to_parent(X, rate_plus))
        records.add_to_force(parent.y, sp.force_to_parent(X, y_plus))
        records.add_to_force(parent.z, sp.force_to_parent(X, z_plus))
    return kappa / root - coriolis - weight


@large_kernel
def _inward_group(bodies, last, qd, tau, work, table, bias, nu_dot):
    """ν̇ of degrees of freedom that are eliminated together: see groups."""
    first, Q, Q_rate = bodies[last].first, table[0], table[1]
    for i in range(first, last + 1):
        nu_dot[bodies[i].dof], bias[bodies[i].dof] = tau[bodies[i].dof], 0.0
    z = groups.gather(bodies, first, last, work, work.z, -1.0, nu_dot)
    y = groups.gather_bias(bodies, first, last, qd, work, work.V, -1.0, bias)
    groups.compose_rates(bodies, first, last, qd, work, Q_rate)
    y = sp.add_force(y, groups.filter_moments(bodies, first, last, work, Q, bias))
    z = sp.add_force(z, groups.filter_moments(bodies, first, last, work, Q, nu_dot))

    V_A, carrier = groups.base_motion(bodies, first, work), work[bodies[first].parent]
    acceleration = sp.Motion(records.vector_of(carrier.acceleration), sp.ZERO)
    for i in range(last, first - 1, -1):
        if groups.is_leader(bodies, i):
            k, G, root = bodies[i].dof, records.force_of(work[i].G), math.sqrt(work[i].D)
            D_rate = Q_rate[k, k - bodies[i].start]
            xi = qd[k] + groups.induced_rate(bodies, i, V_A, qd, Q, G)
            without_xi = -bias[k] - groups.momentum_rate(bodies, i, V_A, qd, work, Q_rate)
            coriolis = (without_xi + 0.5 * D_rate * xi) / root
            nu_dot[k] = nu_dot[k] / root - coriolis - root * sp.power(G, acceleration)
            groups.eliminate_rate(bodies, first, i, work, Q, Q_rate)
    if bodies[first].parent > 0:
        records.add_to_force(carrier.y, y)
        records.add_to_force(carrier.z, z)


@large_kernel
def nu_dot_from_tau(robot, qd, tau, bias, nu_dot):
    """ν̇ from q̇ and τ over bodies that have just been factorized and have V; `bias` is scratch. Returns a status."""
    bodies, gravity, work, table = opened(robot)
    _outward(bodies, gravity, work)
    i = len(bodies) - 1
    while i > 0:
        body, k = bodies[i], bodies[i].dof
        w, parent = work[i], work[body.parent]
        if groups.is_grouped(body):
            _inward_group(bodies, i, qd, tau, work, table, bias, nu_dot)
        elif body.direction == sp.ANGULAR_Z:
            nu_dot[k] = _inward_joint(sp.ANGULAR_Z, body, qd[k], tau[k], w, parent)
        else:
            nu_dot[k] = _inward_joint(sp.LINEAR_Z, body, qd[k], tau[k], w, parent)
        i = body.first - 1
    return 0 if joints.are_finite(nu_dot) else -1
