# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Everything of the diagonalized equations of motion at one state: an outward and an inward sweep."""

import math

from diag_dynamics.numerics.kernel import (
    FILLED_MATRIX,
    FILLED_VECTOR,
    MATRIX,
    NUMBER,
    ROBOT,
    VECTOR,
    entry_kernel,
    kernel,
    large_kernel,
)
from diag_dynamics.numerics.tables import address_of
from diag_dynamics.sweeps import groups, joints, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws


@kernel
def start_at_world(gravity, world):
    """V and gravity's acceleration of the world."""
    records.set_motion(world.V, sp.NO_MOTION)
    records.set_vector(world.acceleration, 0, sp.scale(records.vector_of(gravity), -1.0))


@kernel
def outward_joint(body, X, own_motion, w, parent):
    """V, gravity's acceleration, and what the inward sweep starts from at a body, for one state or a lane."""
    records.set_placement(w, X)
    V = sp.add_motion(sp.motion_to_child(X, records.motion_of(parent.V)), own_motion)
    records.set_motion(w.V, V)
    acceleration = sp.apply_transposed(X.rotation, records.vector_of(parent.acceleration))
    records.set_vector(w.acceleration, 0, acceleration)
    joints.init_articulated_inertia(body, w)
    records.set_force(w.y, sp.cross_force(V, joints.momentum(body, V)))
    records.set_force(w.z, sp.NO_FORCE)


@kernel
def outward_step(bodies, i, q, qd, work):
    """The outward step of one state at a body."""
    body, w = bodies[i], work[i]
    X = joints.update_placement(body, q, w)
    outward_joint(body, X, joints.own_motion(body, qd), w, work[body.parent])
    w.armature = body.armature


@large_kernel
def _outward(bodies, gravity, q, qd, work):
    start_at_world(gravity, work[0])
    for i in range(1, len(bodies)):
        outward_step(bodies, i, q, qd, work)


@kernel
def outputs(root, xi, kappa, without_xi, gravity, D, D_rate):
    """Results of one degree of freedom, by row; `without_xi` is C_ξ but for its part Ḋ ξ, of which C has half."""
    coriolis = (without_xi + 0.5 * D_rate * xi) / root
    return root * xi, xi, kappa / root, kappa, coriolis, without_xi + D_rate * xi, gravity, D, D_rate


@kernel
def write_outputs(out, k, results):
    """Write the results of one degree of freedom, ν̇ and ξ̇."""
    out[ws.NU, k], out[ws.XI, k], out[ws.EPSILON, k], out[ws.KAPPA, k] = results[0], results[1], results[2], results[3]
    out[ws.CORIOLIS, k], out[ws.CORIOLIS_UNNORMALIZED, k], out[ws.GRAVITY, k] = results[4], results[5], results[6]
    out[ws.ARTICULATED_INERTIA, k], out[ws.ARTICULATED_INERTIA_RATE, k] = results[7], results[8]
    root, nu_dot = math.sqrt(results[7]), results[2] - results[4] - results[6]
    out[ws.NU_DOT, k], out[ws.XI_DOT, k] = nu_dot, (root * (nu_dot + results[4]) - results[5]) / results[7]


@kernel
def inward_joint(direction, body, rate, tau, w, parent, is_carried):
    """The inward step at a joint of one degree of freedom, for one state or a lane; the direction is a constant.

    Returns its results and whether it is singular. P⁺, Ṗ⁺, y⁺ and z⁺ go to the parent.
    """
    P, P_rate = records.inertia_of(w.P), records.inertia_of(w.P_rate)
    V, y, z = records.motion_of(w.V), records.force_of(w.y), records.force_of(w.z)
    D, column, G = joints.joint_inertia(direction, body.armature, P)
    root = math.sqrt(D)

    # Total rate: own rate, and the rate induced by the base's motion (eq. 5.3)
    v_J = sp.motion_along(direction, rate)
    xi = rate + sp.power(G, sp.subtract_motion(V, v_J))

    # Coriolis term, un-normalized Sᵀ[y − Ṗ(V − S ξ)] and normalized with half of the last part
    u = sp.column_along(direction, P_rate)
    D_rate = sp.along(direction, u)
    without_xi = sp.along(direction, y) - sp.power(u, V)

    kappa = tau - sp.along(direction, z)
    weight = sp.dot(column.force, records.vector_of(w.acceleration)) / root

    # y⁺ = τ̄ y + P⁺ζ, P⁺ζ = Pζ − G (P S)ᵀζ;  z⁺ = z + G κ
    zeta = sp.cross_along_z(direction, V, rate)
    y_plus = sp.subtract_force(y, sp.scale_force(G, sp.along(direction, y) + sp.power(column, zeta)))
    y_plus = sp.add_force(y_plus, sp.inertia_times(P, zeta))
    z_plus = sp.add_force(z, sp.scale_force(G, kappa))

    # P⁺ = P − G (P S)ᵀ;  Ṗ⁺ = Ṗ − G hᵀ − h Gᵀ − (v_J×)ᵀP⁺ − P⁺(v_J×), h = Ṗ S − ½ Ḋ G
    P_plus = sp.less_rank_one(P, G, column)
    h = sp.subtract_force(u, sp.scale_force(G, 0.5 * D_rate))
    moved = sp.transport_along_z(direction, rate, P_plus)
    rate_plus = sp.add_inertia(sp.less_rank_two(P_rate, G, h), moved)
    if is_carried:
        X = records.placement_of(w)
        joints.accumulate_scale(w, X, parent)
        records.add_to_inertia(parent.P, sp.inertia_to_parent(X, P_plus))
        records.add_to_inertia(parent.P_rate, sp.inertia_to_parent(X, rate_plus))
        records.add_to_force(parent.y, sp.force_to_parent(X, y_plus))
        records.add_to_force(parent.z, sp.force_to_parent(X, z_plus))
    results = outputs(root, xi, kappa, without_xi, weight, D, D_rate)
    return results, joints.is_singular(joints.scale_along(direction, w), D)


@kernel
def _inward_step(bodies, i, direction, qd, tau, work, out):
    """The inward step of one state at a joint of one degree of freedom."""
    body, k = bodies[i], bodies[i].dof
    parent, is_carried = work[body.parent], body.parent > 0
    results, singular = inward_joint(direction, body, qd[k], tau[k], work[i], parent, is_carried)
    if singular:
        return i
    write_outputs(out, k, results)
    return 0


@large_kernel
def _inward_coupled(bodies, last, qd, tau, work, table, out):
    """The inward step at degrees of freedom that are eliminated together: see groups."""
    first, Q, Q_rate, kappa, bias = bodies[last].first, table[0], table[1], out[ws.KAPPA], out[ws.CORIOLIS]
    for i in range(first, last + 1):
        kappa[bodies[i].dof], bias[bodies[i].dof] = tau[bodies[i].dof], 0.0
    z = groups.gather(bodies, first, last, work, work.z, -1.0, kappa)
    groups.compose(bodies, first, last, work, Q)
    y = groups.gather_bias(bodies, first, last, qd, work, work.V, -1.0, bias)
    groups.compose_rates(bodies, first, last, qd, work, Q_rate)
    status = groups.eliminate(bodies, first, last, work, Q, False)
    if status != 0:
        return status
    y = sp.add_force(y, groups.filter_moments(bodies, first, last, work, Q, bias))
    z = sp.add_force(z, groups.filter_moments(bodies, first, last, work, Q, kappa))

    V_A = groups.base_motion(bodies, first, work)
    base = work[bodies[first].parent]
    acceleration = sp.Motion(records.vector_of(base.acceleration), sp.ZERO)
    for i in range(last, first - 1, -1):
        if not groups.is_leader(bodies, i):
            continue
        w, k, start = work[i], bodies[i].dof, bodies[i].start
        G, D, D_rate = records.force_of(w.G), w.D, Q_rate[k, k - start]
        root, xi = math.sqrt(D), qd[k] + groups.induced_rate(bodies, i, V_A, qd, Q, G)
        without_xi = -bias[k] - groups.momentum_rate(bodies, i, V_A, qd, work, Q_rate)
        weight = root * sp.power(G, acceleration)
        write_outputs(out, k, outputs(root, xi, kappa[k], without_xi, weight, D, D_rate))
        groups.eliminate_rate(bodies, first, i, work, Q, Q_rate)
    if bodies[first].parent > 0:
        records.add_to_force(base.y, y)
        records.add_to_force(base.z, z)
    return 0


# A joint of several degrees of freedom that the world carries: V_A is zero, and 𝓜 and 𝓜̇ are P and Ṗ in the joint's
# axes. Its last body has them, κ in z, the bias in y and gravity's wrench in place of the acceleration. Angular z is
# eliminated; then the axes are turned, so that the next one is there.


@kernel
def start_base(armature, effort, w):
    """Terms of all directions, with the armature and the effort of each."""
    P = records.inertia_of(w.P)
    weight = sp.inertia_times(P, sp.Motion(records.vector_of(w.acceleration), sp.ZERO))
    records.set_inertia(w.P, sp.add_to_diagonal(P, armature))
    records.set_force(w.acceleration, weight)
    records.set_force(w.z, sp.subtract_force(effort, records.force_of(w.z)))


@kernel
def eliminate_last(w):
    """Eliminate angular z; returns its results and whether it is singular."""
    P, P_rate, V = records.inertia_of(w.P), records.inertia_of(w.P_rate), records.motion_of(w.V)
    kappas, bias, weights = records.force_of(w.z), records.force_of(w.y), records.force_of(w.acceleration)
    D, column, G = joints.joint_inertia(sp.ANGULAR_Z, 0.0, P)
    u, rate = sp.column_along(sp.ANGULAR_Z, P_rate), V.angular[2]
    D_rate, kappa, y, weight = u.moment[2], kappas.moment[2], bias.moment[2], weights.moment[2]
    root, xi, momentum_rate = math.sqrt(D), _add_power(rate, G, V), _add_power(D_rate * rate, u, V)
    rest = sp.subtract_force(u, sp.scale_force(G, D_rate))  # as groups.eliminate_rate
    records.set_inertia(w.P, sp.less_rank_one(P, G, column))
    records.set_inertia(w.P_rate, sp.less_products(P_rate, G, rest, u))
    records.set_force(w.z, sp.subtract_force(kappas, sp.scale_force(G, kappa)))
    records.set_force(w.y, sp.subtract_force(bias, sp.scale_force(G, y)))
    records.set_force(w.acceleration, sp.subtract_force(weights, sp.scale_force(G, weight)))
    results = outputs(root, xi, kappa, y - momentum_rate, weight / root, D, D_rate)
    return results, joints.is_singular(joints.scale_along(sp.ANGULAR_Z, w), D)


@kernel
def _add_power(start, F, V):
    """Add FᵀV of all directions but angular z, one by one."""
    f, m, v, w = F.force, F.moment, V.linear, V.angular
    return start + f[0] * v[0] + f[1] * v[1] + f[2] * v[2] + m[0] * w[0] + m[1] * w[1]


@kernel
def turn_axes(w):
    """Make angular y, the next direction to eliminate, angular z."""
    w.V[3], w.V[4], w.V[5] = 0.0, w.V[3], w.V[4]
    _turn(w.z, 3)
    _turn(w.y, 3)
    _turn(w.acceleration, 3)
    _turn_inertia(w.P)
    _turn_inertia(w.P_rate)


@kernel
def _turn(a, k):
    a[k], a[k + 1], a[k + 2] = a[k + 2], a[k], a[k + 1]


@kernel
def _turn_inertia(P):
    _turn(P, 6)
    _turn(P, 9)
    _turn(P, 12)
    P[15], P[16], P[17], P[18], P[19], P[20] = P[20], P[17], P[19], P[15], P[16], P[18]


@kernel
def use_linear_axes(w):
    """Put the linear directions in the place of the angular ones, which are eliminated."""
    P, P_rate = records.inertia_of(w.P), records.inertia_of(w.P_rate)
    none = sp.NO_INERTIA
    records.set_inertia(w.P, sp.Inertia(none.A, none.B, P.A))
    records.set_inertia(w.P_rate, sp.Inertia(none.A, none.B, P_rate.A))
    _use_linear(w.V)
    _use_linear(w.z)
    _use_linear(w.y)
    _use_linear(w.acceleration)
    w.magnitude[1], w.total[1] = w.magnitude[0], w.total[0]


@kernel
def _use_linear(F):
    records.set_force(F, sp.Force(sp.ZERO, records.vector_of(F)))


@kernel
def has_linear_next(bodies, i):
    """Whether the direction before that of body i is its joint's first linear one."""
    return bodies[i - 1].direction < sp.ANGULAR_X <= bodies[i].direction


@kernel
def armature_of(bodies, last):
    """Armature of the directions of a joint."""
    armature = sp.NO_MOTION
    for i in range(bodies[last].first, last + 1):
        own = sp.motion_along(bodies[i].direction, bodies[i].armature)
        armature = sp.add_motion(armature, own)
    return armature


@large_kernel
def _inward_base(bodies, last, tau, work, out):
    """The inward step of one state at a joint that the world carries."""
    w, first, armature = work[last], bodies[last].first, armature_of(bodies, last)
    effort = joints.joint_vector(bodies[first], tau)
    start_base(armature, sp.Force(effort.linear, effort.angular), w)
    for i in range(last, first - 1, -1):
        results, singular = eliminate_last(w)
        if singular:
            return i
        write_outputs(out, bodies[i].dof, results)
        if has_linear_next(bodies, i):
            use_linear_axes(w)
        if bodies[i - 1].direction != sp.LINEAR_Z:
            turn_axes(w)
    return 0


@kernel
def is_base(bodies, last):
    """Whether a group is one joint, carried by the world."""
    return bodies[bodies[last].first].parent == 0 and bodies[last].dofs == last - bodies[last].first + 1


@large_kernel
def inward_group(bodies, last, qd, tau, work, table, out):
    """The inward step of one state at degrees of freedom that are eliminated together."""
    if is_base(bodies, last):
        return _inward_base(bodies, last, tau, work, out)
    return _inward_coupled(bodies, last, qd, tau, work, table, out)


@kernel
def _complete(out, n):
    """Fill the rows of energies; return whether they and all other results are finite."""
    energy = base = power = 0.0
    for k in range(n):
        total = 0.0
        for row in range(ws.XI, ws.N_RESULTS):
            total += out[row, k]
        if not math.isfinite(total):
            return False
        share = 0.5 * out[ws.NU, k] * out[ws.NU, k]
        out[ws.ENERGY_SHARE, k] = share
        energy += share
        if k < 6:
            base = energy
        power += out[ws.NU, k] * (out[ws.EPSILON, k] - out[ws.GRAVITY, k])
    if out.shape[1] > 0:
        out[ws.KINETIC_ENERGY, 0], out[ws.BASE_ENERGY, 0] = energy, base
        out[ws.EFFORT_POWER, 0] = out[ws.POWER, 0] = power
    return math.isfinite(energy) and math.isfinite(power)


@kernel
def sweep(bodies, gravity, q, qd, tau, work, table, out):
    """Fill the rows of `out` from ws.NU on with what :func:`evaluate` gives; q, q̇ and τ are finite."""
    _outward(bodies, gravity, q, qd, work)
    i = len(bodies) - 1
    while i > 0:
        first = bodies[i].first
        if groups.is_grouped(bodies[i]):
            status = inward_group(bodies, i, qd, tau, work, table, out)
        elif bodies[i].direction == sp.ANGULAR_Z:
            status = _inward_step(bodies, i, sp.ANGULAR_Z, qd, tau, work, out)
        else:
            status = _inward_step(bodies, i, sp.LINEAR_Z, qd, tau, work, out)
        if status != 0:
            return status
        i = first - 1
    return 0 if _complete(out, len(qd)) else -1


@entry_kernel(ROBOT, VECTOR, VECTOR, VECTOR, FILLED_MATRIX)
def evaluate(robot, q, qd, tau, out):
    """ν, ξ, ε, κ, C, C_ξ, ε_g, D and Ḋ at one state, in an outward and an inward sweep.

    Tables 1 and 2, Algorithms 4.1 and 7.1, Lemma 7.3. Rows of `out`, of length nq, are those of :data:`ws.NU` and so on:
    then come ν̇, ξ̇ and ½ν_k², four numbers, and the last two receive q and q̇. Vectors that lie in `out`, and would change
    meanwhile, are no fit: ws.BAD_LENGTH.
    """
    if overlap(q, out) or overlap(qd, out) or overlap(tau, out):
        return ws.BAD_LENGTH
    if not ws.lengths_match(robot, q, qd, tau):
        return ws.BAD_LENGTH
    if not (joints.are_finite(q) and joints.are_finite(qd) and joints.are_finite(tau)):
        return -1
    bodies, gravity, work, table = ws.opened(robot)
    if not joints.are_orientations(bodies, q):
        return -1
    for k in range(len(q)):
        out[ws.POSITIONS, k] = q[k]
    for k in range(len(qd)):
        out[ws.RATES, k] = qd[k]
    return sweep(bodies, gravity, q, qd, tau, work, table, out)


@kernel
def overlap(vector, matrix):
    """Whether a vector has a number that is a matrix's, too."""
    first, begin = address_of(vector), address_of(matrix)
    return first < begin + 8 * matrix.size and begin < first + 8 * vector.size


@entry_kernel(MATRIX, VECTOR, VECTOR, VECTOR, NUMBER)
def friction_power(state, damping, friction, effort_offset, friction_velocity):
    """Return q̇·τ_fric [W] of a state that :func:`evaluate` has filled, τ_fric as in DiagonalDynamics.friction_torque."""
    power = 0.0
    for k in range(len(damping)):
        rate = state[ws.RATES, k]
        sign = float((rate > 0.0) - (rate < 0.0))
        turned = math.tanh(rate / friction_velocity) if friction_velocity > 0.0 else sign
        power += rate * (damping[k] * rate + friction[k] * turned + effort_offset[k])
    return power


@entry_kernel(VECTOR, VECTOR, *[MATRIX] * 3, FILLED_MATRIX, FILLED_MATRIX, FILLED_VECTOR, nogil=True)
def observe_samples(gain, interval, nu, resisting, epsilon, last, residual, norm):
    """Write r, ṙ = K (ε_ext − r) as DisturbanceObserver has it, and |r| of samples.

    `last` has r, ν, ε_g + C + ε_fric and ε of the sample before, and then of the last one.
    """
    for t in range(len(interval)):
        square = 0.0
        for k in range(len(gain)):
            r = 0.0
            if interval[t] > 0.0:
                mean = 0.5 * (last[3, k] + epsilon[t, k] - last[2, k] - resisting[t, k])
                external = (nu[t, k] - last[1, k]) / interval[t] - mean
                r = last[0, k] - math.expm1(-gain[k] * interval[t]) * (external - last[0, k])
            residual[t, k] = r
            square += r * r
            last[0, k], last[1, k], last[2, k], last[3, k] = r, nu[t, k], resisting[t, k], epsilon[t, k]
        norm[t] = math.sqrt(square)
        if not math.isfinite(norm[t]):
            for k in range(len(gain)):
                last[0, k] = 0.0


@entry_kernel(records.BODIES, records.LINKS, records.WORKS, MATRIX, MATRIX, FILLED_MATRIX, nogil=True)
def link_energies(bodies, links, work, Q, QD, energies):
    """Kinetic energy of every link, ½VᵀIV and ½ armature q̇² of its joint, at each of many states, a row each.

    It returns whether all are finite: K may be where those of links of no rigid body are not. Rows of QD may be longer
    than nv. I is taken in the frame of the body that the link belongs to.
    """
    finite = True
    for t in range(len(Q)):
        finite &= _link_energies_at(bodies, links, work, Q[t], QD[t], energies[t])
    return finite


@entry_kernel(records.BODIES, records.LINKS, records.WORKS, MATRIX, FILLED_VECTOR)
def link_energy(bodies, links, work, state, energy):
    """Kinetic energy of every link, as :func:`link_energies` has it, of a state that :func:`evaluate` has filled."""
    return _link_energies_at(bodies, links, work, state[ws.POSITIONS], state[ws.RATES], energy)


@kernel
def _link_energies_at(bodies, links, work, q, qd, energy):
    ws.clear(energy)
    joints.set_base_at_rest(work)
    for i in range(1, len(bodies)):
        body, w = bodies[i], work[i]
        joints.update_placement(body, q, w)
        joints.update_velocity(body, qd, work, w)
        rate = body.multiplier * qd[body.dof]
        energy[body.link] += 0.5 * body.armature * (rate * rate)
    for j in range(len(links)):
        V = records.motion_of(work[links[j].body].V)
        energy[links[j].index] += 0.5 * sp.power(joints.momentum(links[j], V), V)
    return joints.are_finite(energy)
