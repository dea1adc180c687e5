# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The classical form: M(q) q̈ + c(q, q̇) + g(q) = τ + Jᵀf, its forward and inverse dynamics."""

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.numerics.tables import address_of, flat
from diag_dynamics.sweeps import groups, joints, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws
from diag_dynamics.sweeps.factorization import factor_joint


@nk.kernel
def _aba_inward_step(bodies, i, direction, qd, work, qdd):
    """The inward step of :func:`forward_dynamics` at a joint of one degree of freedom.

    The direction is a constant.
    """
    body = bodies[i]
    w = work[i]
    k = body.dof
    parent = work[body.parent]
    if not factor_joint(body, direction, w, parent):
        return i
    P = records.inertia_of(w.P)
    y = records.force_of(w.y)
    G = records.force_of(w.G)
    # u = τ − Sᵀy, with τ in the place of q̈; D⁻¹u waits there for the outward sweep
    u = qdd[k] - sp.along(direction, y)
    qdd[k] = u / w.D
    zeta = sp.cross_along_z(direction, records.motion_of(w.V), qd[k])
    records.set_motion(w.zeta, zeta)
    if body.parent > 0:
        # y⁺ = y + G u + P⁺ζ with P⁺ζ = Pζ − G (P S)ᵀζ
        column = sp.column_along(direction, P)
        y_plus = sp.add_force(y, sp.scale_force(G, u - sp.power(column, zeta)))
        y_plus = sp.add_force(y_plus, sp.inertia_times(P, zeta))
        records.add_to_force(parent.y, sp.force_to_parent(records.placement_of(w), y_plus))
    return 0


@nk.large_kernel
def aba_inward_group(robot, last, qd, qdd):
    """The inward step of :func:`forward_dynamics` at a group."""
    bodies, _, work, table = ws.opened(robot)
    first = bodies[last].first
    Q = table[0]
    # 𝓜, then τ − 𝓎 in place of τ, and 𝓎 on the base
    groups.compose(bodies, first, last, work, Q)
    y = groups.gather_bias(bodies, first, last, qd, work, qdd)
    # D, G and g, and P⁺ on the base; then u within the group, and y⁺ = 𝓎 + Σ G u on the base
    status = groups.eliminate(bodies, first, last, work, Q)
    if status != 0:
        return status
    y = sp.add_force(y, groups.filter_moments(bodies, first, last, work, Q, -1.0, qdd))
    if bodies[first].parent > 0:
        records.add_to_force(work[bodies[first].parent].y, y)
    # D⁻¹u, for the outward sweep
    for i in range(first, last + 1):
        if groups.is_leader(bodies, i):
            qdd[bodies[i].dof] /= work[i].D
    return 0


@nk.kernel
def _aba_outward_step(body, w, parent, qdd):
    """The last outward step of :func:`forward_dynamics` at a joint of one degree of freedom."""
    # q̈ = D⁻¹u − Gᵀ(X A_p + ζ), then A = X A_p + ζ + S q̈ (Algorithm 8.1)
    A = sp.motion_to_child(records.placement_of(w), records.motion_of(parent.acceleration))
    A = sp.add_motion(A, records.motion_of(w.zeta))
    qdd[body.dof] -= sp.power(records.force_of(w.G), A)
    records.set_motion(w.acceleration, sp.add_motion(A, joints.own_motion(body, w, qdd)))


@nk.large_kernel
def aba_outward_group(robot, first, qd, qdd):
    """The last outward step of :func:`forward_dynamics` at a group."""
    bodies, _, work, table = ws.opened(robot)
    base = records.motion_of(work[bodies[first].parent].acceleration)
    # q̈_c = D⁻¹u_c − Gᵀ A_A − Σ g_b q̈_b: earlier degrees of freedom go first
    # The group's ζ is in u, as a part of 𝓎
    for i in range(first, bodies[first].last + 1):
        if groups.is_leader(bodies, i):
            G = records.force_of(work[i].G)
            qdd[bodies[i].dof] -= groups.induced_rate(bodies, i, base, qdd, table[0], G)
    # A of all bodies; ζ counts once for the bodies of a joint, which share a frame
    for i in range(first, bodies[first].last + 1):
        body = bodies[i]
        w = work[i]
        A = joints.motion_outboard(body, w, records.motion_of(work[body.parent].acceleration))
        if body.rank == 0:
            A = sp.add_motion(A, joints.zeta(bodies, i, qd, work))
        records.set_motion(w.acceleration, sp.add_motion(A, joints.own_motion(body, w, qdd)))


@nk.kernel
def _aba(bodies, gravity, q, qd, tau, work, robot, qdd):
    """q̈ from τ: an outward, an inward and another outward sweep.

    Theory: A₀ = −g, κ with gravity left in.
    """
    n = len(bodies)
    status = joints.couple_with_rates(q, qd, work)
    if status != 0:
        return status
    # From the base to the tips: X, V, and P = I and y = V ×* I V of each body alone
    joints.set_base_at_rest(work)
    for i in range(1, n):
        body = bodies[i]
        w = work[i]
        joints.update_placement(body, q, w)
        V = joints.update_velocity(body, qd, work, w)
        joints.init_articulated_inertia(body, w)
        w.armature = body.armature
        records.set_force(w.y, sp.cross_force(V, joints.momentum(body, V)))

    ws.copy(tau, qdd)
    addresses = address_of(qd), address_of(qdd)
    # From the tips to the base: q̈ ← D⁻¹u with u = τ − Sᵀy; y is the articulated bias force
    i = n - 1
    while i > 0:
        body = bodies[i]
        if groups.is_grouped(body):
            status = ws.step_group(robot, ws.ABA_INWARD, (robot, i, *addresses))
        elif body.direction == sp.ANGULAR_Z:
            status = _aba_inward_step(bodies, i, sp.ANGULAR_Z, qd, work, qdd)
        else:
            status = _aba_inward_step(bodies, i, sp.LINEAR_Z, qd, work, qdd)
        if status != 0:
            return status
        i = body.first - 1

    # From the base to the tips: q̈ and A, where A₀ = −g stands for gravity
    # Degrees of freedom of a group are solved together, at its last body
    joints.set_base_acceleration(gravity, 1.0, work)
    for i in range(1, n):
        body = bodies[i]
        if not groups.is_grouped(body):
            _aba_outward_step(body, work[i], work[body.parent], qdd)
        elif i == body.last:
            status = ws.step_group(robot, ws.ABA_OUTWARD, (robot, body.first, *addresses))
            if status != 0:
                return status
    return 0 if joints.are_finite(qdd) else -1


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.FILLED_VECTOR)
def forward_dynamics(robot, q, qd, tau, qdd):
    """q̈ from τ."""
    if not ws.lengths_match(robot, q, qd, tau):
        return ws.BAD_LENGTH
    bodies, gravity, work, _ = ws.opened(robot)
    if not (joints.are_positions(bodies, q) and joints.are_finite(qd) and joints.are_finite(tau)):
        return -1
    return _aba(bodies, gravity, q, qd, tau, work, robot, qdd)


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.NUMBER, nk.FILLED_VECTOR)
def inverse_dynamics(robot, q, qd, qdd, weight, tau):
    """τ = M q̈ + c + g (Newton–Euler, eq. 4.3), g times a weight of 0 or 1."""
    bodies, gravity, work, _ = ws.opened(robot)
    status = joints.start_motion(bodies, q, qd, work)
    if status != 0:
        return status
    if not joints.are_finite(qdd):
        return -1
    ws.clear(tau)
    joints.set_base_acceleration(gravity, weight, work)
    for i in range(1, len(bodies)):
        body = bodies[i]
        V, A = joints.update_motion(bodies, i, q, qd, qdd, work)
        # f = I A + V ×* I V, with gravity in A
        y = sp.add_force(joints.momentum(body, A), sp.cross_force(V, joints.momentum(body, V)))
        records.set_force(work[i].y, y)
        if body.armature != 0.0:
            # The rotor accelerates by Σ (G q̈ + Ġ q̇), and loads each leader G times
            first = joints.turning(bodies, i)
            rate = joints.joint_rate(bodies, first, qdd, work) + joints.ratio_rate(
                bodies, first, qd, work
            )
            tau[body.dof] += work[i].multiplier * (body.armature * rate)
    # From the tips to the base: τ = Sᵀf with f = f_i + Σ Xᵀf_c (4.3)
    joints.moments_inward(bodies, work, tau)
    return 0 if joints.are_finite(tau) else -1


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.VECTOR, nk.FILLED_VECTOR)
def momentum(robot, q, qd, result):
    """Momentum p = M q̇, then its rate without efforts, C_sᵀq̇ − g.

    They are Sᵀh and Sᵀ(F − V ×* h) of a joint. h and F are momentum and weight of all bodies
    outboard, in the axes of the joint.
    """
    if not ws.lengths_match(robot, q, qd, qd):
        return ws.BAD_LENGTH
    bodies, gravity, work, _ = ws.opened(robot)
    status = joints.start_motion(bodies, q, qd, work)
    if status != 0:
        return status
    nv = len(qd)
    ws.clear(result)
    # From the base to the tips: h = I V and F = I g of each body alone; weight −1 leaves g itself
    joints.set_base_acceleration(gravity, -1.0, work)
    for i in range(1, len(bodies)):
        body = bodies[i]
        w = work[i]
        X = joints.update_placement(body, q, w)
        V = joints.update_velocity(body, qd, work, w)
        g = sp.motion_to_child(X, records.motion_of(work[body.parent].acceleration))
        records.set_motion(w.acceleration, g)
        records.set_force(w.y, joints.momentum(body, V))
        records.set_force(w.z, joints.momentum(body, g))
        if body.armature != 0.0:
            first = joints.turning(bodies, i)
            # Momentum of the rotor counts G times; a ratio that changes adds Ġ times it to C_sᵀq̇
            spin = body.armature * joints.joint_rate(bodies, first, qd, work)
            result[body.dof] += w.multiplier * spin
            result[nv + body.dof] += w.multiplier_rate * spin
    # From the tips to the base: −Sᵀ(V ×* h) = (V × S)ᵀh is C_sᵀq̇, and SᵀF is −g
    for i in range(len(bodies) - 1, 0, -1):
        body = bodies[i]
        w = work[i]
        V = records.motion_of(work[i + body.dofs - 1 - body.rank].V)  # of the whole joint
        h = records.force_of(w.y)
        F = records.force_of(w.z)
        along = sp.along(body.direction, sp.subtract_force(F, sp.cross_force(V, h)))
        momentum_along = sp.along(body.direction, h)
        result[body.dof] += w.multiplier * momentum_along
        result[nv + body.dof] += w.multiplier * along + w.multiplier_rate * momentum_along
        if body.parent > 0:
            records.add_to_force(work[body.parent].y, joints.force_inboard(body, w, h))
            records.add_to_force(work[body.parent].z, joints.force_inboard(body, w, F))
    return 0 if joints.are_finite(result) else -1


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, records.WRENCHES, nk.FLAG, nk.FILLED_VECTOR)
def effort_of_wrenches(robot, q, wrenches, in_world, tau):
    """Jᵀf of wrenches at points of bodies, by walks down the tree.

    Wrenches are in the axes of the body or of the world.
    """
    bodies, _, work, _ = ws.opened(robot)
    status = joints.update_placements(bodies, q, work)
    if status != 0:
        return status
    ws.clear(tau)
    for j in range(len(wrenches)):
        F = joints.wrench_on_body(bodies, wrenches[j], in_world, work)
        groups.moments_of_wrench(bodies, wrenches[j].body, 1, work, F, tau)
    return 0


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.FILLED_MATRIX)
def mass_matrix(robot, q, M):
    """M from the inertias of the composite rigid bodies outboard of each joint."""
    bodies, _, work, _ = ws.opened(robot)
    status = joints.initialize(bodies, q, work)
    if status != 0:
        return status
    if len(bodies) > 1:
        # All bodies as one group, on the world: its Q is M
        groups.compose(bodies, 1, len(bodies) - 1, work, M)
    return 0 if joints.are_finite(flat(M)) else -1


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.FILLED_VECTOR)
def first_moment(robot, q, moment):
    """Σ m_i c_i of all bodies in the world's axes [kg m]."""
    bodies, _, work, _ = ws.opened(robot)
    status = joints.update_placements(bodies, q, work)
    if status != 0:
        return status
    total = sp.ZERO
    for i in range(len(bodies)):
        # R h + m p: the body's first moment about the origin of the world
        X = joints.pose(bodies, i, 0, work)
        h = records.vector_of(bodies[i].first_moment)
        total = sp.add(
            total, sp.add(sp.apply(X.rotation, h), sp.scale(X.translation, bodies[i].mass))
        )
    records.set_vector(moment, 0, total)
    return 0 if joints.are_finite(moment) else -1
