# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The diagonalized equations of motion at one state, in an outward and an inward sweep."""

import math

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.numerics.tables import address_of, flat
from diag_dynamics.sweeps import groups, joints, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws


@nk.kernel
def start_at_world(gravity, world):
    """V and gravity's acceleration of the world."""
    records.set_motion(world.V, sp.NO_MOTION)
    records.set_vector(world.acceleration, 0, sp.scale(records.vector_of(gravity), -1.0))


@nk.kernel
def outward_joint(body, X, own_motion, w, parent):
    """The outward step at a body, for one state or a lane: X, V, own inertia and forces."""
    records.set_placement(w, X)
    # V = V⁺ + S q̇, where V⁺ is the velocity of the parent in the axes of the body
    V = sp.add_motion(sp.motion_to_child(X, records.motion_of(parent.V)), own_motion)
    records.set_motion(w.V, V)
    # P = I and Ṗ = 0 of the body alone: the inward sweep adds its children
    joints.init_articulated_inertia(body, w)
    init_forces(body, X, V, w, parent)


@nk.kernel
def init_forces(body, X, V, w, parent):
    """Gravity's acceleration of a body, and its y and z before its children have been added."""
    # a is −g in the axes of the body; y begins as V ×* I V
    # a has no angular part, so that X reduces to Rᵀ
    acceleration = sp.apply_transposed(X.rotation, records.vector_of(parent.acceleration))
    records.set_vector(w.acceleration, 0, acceleration)
    records.set_force(w.y, sp.cross_force(V, joints.momentum(body, V)))
    records.set_force(w.z, sp.NO_FORCE)


@nk.kernel
def outward_step(bodies, i, q, qd, work):
    """The outward step of one state at a body."""
    body = bodies[i]
    w = work[i]
    X = joints.update_placement(body, q, w)
    outward_joint(body, X, joints.own_motion(body, w, qd), w, work[body.parent])
    w.armature = body.armature


@nk.large_kernel
def _outward(bodies, gravity, q, qd, work):
    """The outward sweep of one state; returns a status."""
    # Positions, G and Ġ of followers first, because X and V need them
    status = joints.couple_with_rates(q, qd, work)
    start_at_world(gravity, work[0])
    for i in range(1, len(bodies)):
        outward_step(bodies, i, q, qd, work)
    return status


@nk.kernel
def outputs(root, xi, kappa, without_xi, gravity, D, D_rate):
    """Results of one degree of freedom, by row; `without_xi` is C_ξ − Ḋ ξ.

    C has half of Ḋ ξ.
    """
    # C = D^−½ (C_ξ − ½ Ḋ ξ) (Algorithm 7.1, Lemma 7.3)
    coriolis = (without_xi + 0.5 * D_rate * xi) / root
    # Rows from ws.NU on: ν = D^½ ξ, ξ, ε = D^−½ κ, κ, C, C_ξ, ε_g, D and Ḋ
    return (
        root * xi,
        xi,
        kappa / root,
        kappa,
        coriolis,
        without_xi + D_rate * xi,
        gravity,
        D,
        D_rate,
    )


@nk.kernel
def set_results(column, x):
    """Write the results of one degree of freedom to numbers in a row."""
    records.set_matrix(column, ((x[0], x[1], x[2]), (x[3], x[4], x[5]), (x[6], x[7], x[8])))


@nk.kernel
def inward_joint(direction, D, G, rate, tau, w, parent, is_carried):
    """The inward step at a joint of one degree of freedom, for one state or a lane.

    The direction is a constant. Returns its results and whether it is singular. P⁺, Ṗ⁺, y⁺ and z⁺
    go to the parent.
    """
    P = records.inertia_of(w.P)
    P_rate = records.inertia_of(w.P_rate)
    V = records.motion_of(w.V)
    y = records.force_of(w.y)
    z = records.force_of(w.z)
    column = sp.column_along(direction, P)
    root = math.sqrt(D)

    # Total rate: own rate, and the rate induced by the base's motion (eq. 5.3)
    v_J = sp.motion_along(direction, rate)
    xi = rate + sp.power(G, sp.subtract_motion(V, v_J))

    # Coriolis term, un-normalized Sᵀ[y − Ṗ(V − S ξ)] and normalized with half of the last part
    u = sp.column_along(direction, P_rate)
    D_rate = sp.along(direction, u)
    without_xi = sp.along(direction, y) - sp.power(u, V)

    # κ = τ − Sᵀ z (5.4), and gravity's ε_g = D^−½ (P S)ᵀ a
    kappa = tau - sp.along(direction, z)
    weight = sp.dot(column.force, records.vector_of(w.acceleration)) / root

    # y⁺ = τ̄ y + P⁺ζ, P⁺ζ = Pζ − G (P S)ᵀζ;  z⁺ = z + G κ
    zeta = sp.cross_along_z(direction, V, rate)
    y_plus = sp.subtract_force(
        y, sp.scale_force(G, sp.along(direction, y) + sp.power(column, zeta))
    )
    y_plus = sp.add_force(y_plus, sp.inertia_times(P, zeta))
    z_plus = sp.add_force(z, sp.scale_force(G, kappa))

    # P⁺ = P − G (P S)ᵀ;  Ṗ⁺ = Ṗ − G hᵀ − h Gᵀ − (v_J×)ᵀP⁺ − P⁺(v_J×), h = Ṗ S − ½ Ḋ G
    P_plus = sp.less_rank_one(P, G, column)
    h = sp.subtract_force(u, sp.scale_force(G, 0.5 * D_rate))
    moved = sp.transport_along_z(direction, rate, P_plus)
    rate_plus = sp.add_inertia(sp.less_rank_two(P_rate, G, h), moved)
    # XᵀP⁺X, XᵀṖ⁺X, Xᵀy⁺ and Xᵀz⁺ add to the parent; the world, which cannot move, needs none
    if is_carried:
        X = records.placement_of(w)
        joints.accumulate_scale(w, X, parent)
        records.add_to_inertia(parent.P, sp.inertia_to_parent(X, P_plus))
        records.add_to_inertia(parent.P_rate, sp.inertia_to_parent(X, rate_plus))
        records.add_to_force(parent.y, sp.force_to_parent(X, y_plus))
        records.add_to_force(parent.z, sp.force_to_parent(X, z_plus))
    results = outputs(root, xi, kappa, without_xi, weight, D, D_rate)
    return results, joints.is_singular(joints.scale_along(direction, w), D)


@nk.kernel
def _inward_step(bodies, i, direction, qd, tau, work, out):
    """The inward step of one state at a joint of one degree of freedom."""
    body = bodies[i]
    k = bodies[i].dof
    w = work[i]
    parent = work[body.parent]
    is_carried = body.parent > 0
    D, _, G = joints.joint_inertia(direction, body.armature, records.inertia_of(w.P))
    results, singular = inward_joint(direction, D, G, qd[k], tau[k], w, parent, is_carried)
    if singular:
        return i
    set_results(out[:, k], results)
    return 0


@nk.large_kernel
def inward_coupled(robot, last, qd, tau, out):
    """The inward step of one state at a group."""
    bodies, _, work, table = ws.opened(robot)
    first = bodies[last].first
    Q = table[0]
    Q_rate = table[1]
    kappa = out[ws.KAPPA]
    bias = out[ws.CORIOLIS]
    # Rows of κ and C serve as memory for moments until a degree of freedom has its results
    for i in range(first, last + 1):
        kappa[bodies[i].dof] = tau[bodies[i].dof]
        bias[bodies[i].dof] = 0.0
    # κ begins as τ less the moments of z of the group's bodies; z is now that on their base
    z = groups.gather(bodies, first, last, work, -1.0, kappa)
    # 𝓜, then −𝓎 in `bias` and 𝓎 on the base, which need composite P, then 𝓜̇
    groups.compose(bodies, first, last, work, Q)
    y = groups.gather_bias(bodies, first, last, qd, work, bias)
    groups.compose_rates(bodies, first, last, qd, work, Q_rate)
    # D, G and g; then κ and the bias within the group, z⁺ and y⁺ on the base
    status = groups.eliminate(bodies, first, last, work, Q)
    if status != 0:
        return status
    # y⁺ = 𝓎 − Σ G 𝓎_c has a plus here, because `bias` is −𝓎;  z⁺ = z + Σ G κ
    y = sp.add_force(y, groups.filter_moments(bodies, first, last, work, Q, -1.0, bias))
    z = sp.add_force(z, groups.filter_moments(bodies, first, last, work, Q, -1.0, kappa))

    V_A = groups.base_motion(bodies, first, work)
    base = work[bodies[first].parent]
    acceleration = sp.Motion(records.vector_of(base.acceleration), sp.ZERO)
    # Each degree of freedom needs 𝓜̇ without later ones, and is eliminated from it then
    for i in range(last, first - 1, -1):
        if not groups.is_leader(bodies, i):
            continue
        w = work[i]
        k = bodies[i].dof
        start = bodies[i].start
        G = records.force_of(w.G)
        D = w.D
        D_rate = Q_rate[k, k - start]
        root = math.sqrt(D)
        # ξ_c = q̇_c + GᵀV_A + Σ g_b q̇_b, and C_ξ − Ḋ ξ = 𝓎_c − 𝓜̇_c (V_A, q̇)
        xi = qd[k] + groups.induced_rate(bodies, i, V_A, qd, Q, G)
        without_xi = -bias[k] - groups.momentum_rate(bodies, i, V_A, qd, work, Q_rate)
        # κ_g = F_cᵀ a = D Gᵀ a
        weight = root * sp.power(G, acceleration)
        results = outputs(root, xi, kappa[k], without_xi, weight, D, D_rate)
        set_results(out[:, k], results)
        groups.eliminate_rate(bodies, first, i, work, Q, Q_rate)
    # y⁺ and z⁺ are in the axes of the base; its P and Ṗ have those of the group already
    if bodies[first].parent > 0:
        records.add_to_force(base.y, y)
        records.add_to_force(base.z, z)
    return 0


# A floating base: V of the world is zero, so 𝓜 and 𝓜̇ are P and Ṗ of the base. Its last body has
# them, κ in z, the bias in y and gravity's wrench in place of the acceleration. The last direction,
# angular z, is eliminated. The others move up by one, so that the next one is the last.


@nk.kernel
def is_floating_base(bodies, i):
    """Whether a body is of a floating joint that the world carries, and of no larger group."""
    body = bodies[i]
    return (
        body.kind == records.FLOATING
        and bodies[body.first].parent == 0
        and body.last - body.first == 5
    )


@nk.kernel
def start_base(effort, w):
    """κ and gravity's wrench of a floating base, from the effort of each direction."""
    # S = 1: κ_g = P a and κ = τ − z (5.4), before any direction is eliminated
    weight = sp.inertia_times(
        records.inertia_of(w.P), sp.Motion(records.vector_of(w.acceleration), sp.ZERO)
    )
    records.set_force(w.acceleration, weight)
    records.set_force(w.z, sp.subtract_force(effort, records.force_of(w.z)))


@nk.kernel
def eliminate_last(direction, armature, w):
    """Eliminate the last direction of a floating base; return results and its singularity."""
    P = records.inertia_of(w.P)
    P_rate = records.inertia_of(w.P_rate)
    V = records.motion_of(w.V)
    kappas = records.force_of(w.z)
    bias = records.force_of(w.y)
    weights = records.force_of(w.acceleration)
    # Entries of angular z, where the direction has moved to; u = 𝓜̇_c
    D, column, G = joints.joint_inertia(sp.ANGULAR_Z, armature, P)
    u = sp.column_along(sp.ANGULAR_Z, P_rate)
    rate = V.angular[2]
    D_rate = u.moment[2]
    kappa = kappas.moment[2]
    y = bias.moment[2]
    weight = weights.moment[2]
    # ξ_c = q̇_c + Gᵀ V and 𝓜̇_c V, over all directions but the last
    root = math.sqrt(D)
    xi = _add_power(rate, G, V)
    momentum_rate = _add_power(D_rate * rate, u, V)
    rest = sp.subtract_force(u, sp.scale_force(G, D_rate))  # as groups.eliminate_rate
    # 𝓜, 𝓜̇, κ, the bias and gravity's wrench without the last direction
    records.set_inertia(w.P, _moved_up_inertia(sp.less_rank_one(P, G, column)))
    records.set_inertia(w.P_rate, _moved_up_inertia(sp.less_products(P_rate, G, rest, u)))
    records.set_force(w.z, _moved_up(sp.subtract_force(kappas, sp.scale_force(G, kappa))))
    records.set_force(w.y, _moved_up(sp.subtract_force(bias, sp.scale_force(G, y))))
    records.set_force(
        w.acceleration, _moved_up(sp.subtract_force(weights, sp.scale_force(G, weight)))
    )
    records.set_force(w.V, _moved_up(sp.Force(V.linear, V.angular)))
    results = outputs(root, xi, kappa, y - momentum_rate, weight / root, D, D_rate)
    # The size of D is that of the direction itself: a mass if it is linear, else an inertia
    return results, joints.is_singular(joints.scale_along(direction, w), D)


@nk.kernel
def _add_power(start, F, V):
    """Add FᵀV of all directions but the last, one by one."""
    f = F.force
    m = F.moment
    v = V.linear
    w = V.angular
    return start + f[0] * v[0] + f[1] * v[1] + f[2] * v[2] + m[0] * w[0] + m[1] * w[1]


@nk.kernel
def _moved_up(F):
    """The six entries moved up by one direction; the last one is dropped."""
    return sp.Force((0.0, F.force[0], F.force[1]), (F.force[2], F.moment[0], F.moment[1]))


@nk.kernel
def _moved_up_inertia(P):
    """Rows and columns moved up by one direction; the last ones are dropped."""
    A, B, C = P
    # Entry (i, j) of the 6x6 matrix goes to (i + 1, j + 1)
    return sp.Inertia(
        (sp.ZERO, (0.0, A[0][0], A[0][1]), (0.0, A[0][1], A[1][1])),
        (sp.ZERO, (A[0][2], B[0][0], B[0][1]), (A[1][2], B[1][0], B[1][1])),
        ((A[2][2], B[2][0], B[2][1]), (B[2][0], C[0][0], C[0][1]), (B[2][1], C[0][1], C[1][1])),
    )


@nk.large_kernel
def inward_base(robot, last, tau, out):
    """The inward step of one state at a floating base."""
    bodies, _, work, _ = ws.opened(robot)
    w = work[last]
    first = bodies[last].first
    k = bodies[first].dof
    start_base(records.force_of(tau[k : k + 6]), w)
    # From angular z to linear x; the body of a singular direction is the status
    for i in range(last, first - 1, -1):
        results, singular = eliminate_last(bodies[i].direction, bodies[i].armature, w)
        if singular:
            return i
        set_results(out[:, bodies[i].dof], results)
    return 0


@nk.kernel
def inward_group(robot, last, qd, tau, out):
    """The inward step of one state at degrees of freedom that are eliminated together."""
    is_base = is_floating_base(ws.robot_of(robot).bodies, last)
    addresses = address_of(qd), address_of(tau), address_of(out)
    step = ws.INWARD_BASE if is_base else ws.INWARD
    return ws.step_group(robot, step, (robot, last, *addresses, out.shape[1]))


@nk.kernel
def sums(rows):
    """Whether results of one state are finite, K, the share of the first six ν, and νᵀ(ε − ε_g)."""
    finite = True
    energy = 0.0
    base = 0.0
    power = 0.0
    for k in range(rows.shape[1]):
        # A sum with inf or NaN is not finite, so that one test is enough.
        total = 0.0
        for row in range(ws.XI, ws.N_RESULTS):
            total += rows[row, k]
        finite &= math.isfinite(total)
        # K = ½ νᵀν (1.2), which is not finite if ν is not, and K̇ = νᵀ(ε − ε_g) (Lemma 7.2)
        nu = rows[ws.NU, k]
        energy += 0.5 * nu * nu
        if k < 6:
            base = energy
        power += nu * (rows[ws.EPSILON, k] - rows[ws.GRAVITY, k])
    return finite and math.isfinite(energy) and math.isfinite(power), energy, base, power


@nk.kernel
def _complete(out, n):
    """Fill the rows of energies; return whether they and all other results are finite."""
    finite, energy, base, power = sums(out[:, :n])
    for k in range(n):
        out[ws.ENERGY_SHARE, k] = 0.5 * out[ws.NU, k] * out[ws.NU, k]
    if out.shape[1] > 0:
        out[ws.KINETIC_ENERGY, 0] = energy
        out[ws.BASE_ENERGY, 0] = base
        out[ws.EFFORT_POWER, 0] = power
    return finite


@nk.kernel
def _inward(robot, qd, tau, out):
    """Fill the rows of `out` from ws.NU on with results of :func:`evaluate`: the inward sweep."""
    bodies, _, work, _ = ws.opened(robot)
    # From the tips to the base; i is the last body of its group, or alone
    # Each call has a constant direction, so that the compiler can drop the other branches
    i = len(bodies) - 1
    while i > 0:
        first = bodies[i].first
        if groups.is_grouped(bodies[i]):
            status = inward_group(robot, i, qd, tau, out)
        elif bodies[i].direction == sp.ANGULAR_Z:
            status = _inward_step(bodies, i, sp.ANGULAR_Z, qd, tau, work, out)
        else:
            status = _inward_step(bodies, i, sp.LINEAR_Z, qd, tau, work, out)
        if status != 0:
            return status
        i = first - 1
    return 0 if _complete(out, len(qd)) else -1


@nk.kernel
def sweep_state(robot, q, qd, tau, out):
    """Fill the rows of `out` from NU on but those of q and q̇; returns a status."""
    # -1 for numbers that are not finite, and for quaternions far from unit length
    if not (joints.are_finite(q) and joints.are_finite(qd) and joints.are_finite(tau)):
        return -1
    bodies, gravity, work, _ = ws.opened(robot)
    if not joints.are_orientations(bodies, q):
        return -1
    status = _outward(bodies, gravity, q, qd, work)
    return status if status != 0 else _inward(robot, qd, tau, out)


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.FILLED_MATRIX)
def evaluate(robot, q, qd, tau, out):
    """Fill the rows of `out`, from NU to RATES, at one state.

    Tables 1 and 2, Algorithms 4.1 and 7.1, Lemma 7.3. No vector lies in `out`.
    """
    if not ws.lengths_match(robot, q, qd, tau):
        return ws.BAD_LENGTH
    ws.copy(q, out[ws.POSITIONS])
    ws.copy(qd, out[ws.RATES])
    return sweep_state(robot, q, qd, tau, out)


@nk.entry_kernel(nk.MATRIX, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.NUMBER)
def friction_power(state, damping, friction, effort_offset, friction_velocity):
    """Return q̇·τ_fric [W] of a state that :func:`evaluate` has filled.

    τ_fric is that of DiagonalDynamics.friction_torque.
    """
    power = 0.0
    for k in range(len(damping)):
        rate = state[ws.RATES, k]
        sign = float((rate > 0.0) - (rate < 0.0))
        turned = math.tanh(rate / friction_velocity) if friction_velocity > 0.0 else sign
        power += rate * (damping[k] * rate + friction[k] * turned + effort_offset[k])
    return power


@nk.entry_kernel(
    nk.VECTOR,
    nk.VECTOR,
    *[nk.MATRIX] * 3,
    nk.FILLED_MATRIX,
    nk.FILLED_MATRIX,
    nk.FILLED_VECTOR,
    nogil=True,
)
def observe_samples(gain, interval, momentum, resisting, applied, last, x, norm):
    """Write x, m r or r of DisturbanceObserver, and |x| of samples.

    x is NaN where the applied term is. `last` has x, momentum, resisting and applied terms of the
    sample before, and then of the last one.
    """
    for t in range(len(interval)):
        square = 0.0
        for k in range(len(gain)):
            filtered = 0.0
            # The first sample, and the first after a gap, has no interval: r = 0
            if interval[t] > 0.0:
                # External term: Δp/Δt less the mean of applied minus resisting terms
                mean = 0.5 * (last[3, k] + applied[t, k] - last[2, k] - resisting[t, k])
                external = (momentum[t, k] - last[1, k]) / interval[t] - mean
                # ṙ = K_O(ε_ext − r) with constant ε_ext; expm1 has no cancellation at small K_O dt
                filtered = last[0, k] - math.expm1(-gain[k] * interval[t]) * (external - last[0, k])
            x[t, k] = filtered
            if math.isnan(applied[t, k]) or math.isnan(
                last[3, k]
            ):  # unknown at an end of the interval
                x[t, k] = math.nan
                filtered = 0.0
            square += filtered * filtered
            last[0, k] = filtered
            last[1, k] = momentum[t, k]
            last[2, k] = resisting[t, k]
            last[3, k] = applied[t, k]
        norm[t] = math.sqrt(square)
        # An overflow is not carried over: r starts at 0 again
        if not math.isfinite(norm[t]):
            for k in range(len(gain)):
                last[0, k] = 0.0


@nk.entry_kernel(nk.ROBOT, records.LINKS, nk.MATRIX, nk.MATRIX, nk.FILLED_MATRIX, nogil=True)
def link_energies(robot, links, Q, QD, energies):
    """Kinetic energy ½VᵀIV + ½ armature q̇² of every link and its joint, a row for each state.

    Returns whether all are finite, which finite K does not imply. Rows of QD may be longer than nv.
    """
    bodies, _, work, _ = ws.opened(robot)
    ws.clear(flat(energies))
    for t in range(len(Q)):
        # V needs positions and G of followers, not Ġ
        if joints.couple(Q[t], work) != 0:
            return False
        joints.set_base_at_rest(work)
        for i in range(1, len(bodies)):
            body = bodies[i]
            w = work[i]
            joints.update_placement(body, Q[t], w)
            joints.update_velocity(body, QD[t], work, w)
            # Once for a joint: its rotor turns at the sum of the rates of its bodies
            if body.rank == 0 and body.armature != 0.0:
                rate = joints.joint_rate(bodies, i, QD[t], work)
                energies[t, body.link] += 0.5 * body.armature * (rate * rate)
        for j in range(len(links)):
            V = records.motion_of(work[links[j].body].V)
            energies[t, links[j].index] += 0.5 * sp.power(joints.momentum(links[j], V), V)
    return joints.are_finite(flat(energies))
