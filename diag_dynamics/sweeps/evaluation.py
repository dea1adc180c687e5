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
from diag_dynamics.sweeps.workspace import (
    ARTICULATED_INERTIA,
    ARTICULATED_INERTIA_RATE,
    BAD_LENGTH,
    BASE_ENERGY,
    CORIOLIS,
    CORIOLIS_UNNORMALIZED,
    EFFORT_POWER,
    ENERGY_SHARE,
    EPSILON,
    GRAVITY,
    KAPPA,
    KINETIC_ENERGY,
    N_RESULTS,
    NU,
    NU_DOT,
    POSITIONS,
    POWER,
    RATES,
    XI,
    XI_DOT,
    clear,
    lengths_match,
    opened,
)


@kernel
def start_at_world(gravity, world):
    """V and gravity's acceleration of the world."""
    records.set_motion(world.V, sp.NO_MOTION)
    records.set_vector(world.acceleration, 0, sp.scale(records.vector_of(gravity), -1.0))


@kernel
def outward_step(bodies, i, q, qd, work):
    """V, gravity's acceleration, and what the inward sweep starts from at a body."""
    body, w, parent = bodies[i], work[i], work[bodies[i].parent]
    X = joints.update_placement(body, q, w)
    V = sp.add_motion(sp.motion_to_child(X, records.motion_of(parent.V)), joints.own_motion(body, qd))
    records.set_motion(w.V, V)
    records.set_vector(w.acceleration, 0, sp.apply_transposed(X.rotation, records.vector_of(parent.acceleration)))
    joints.init_articulated_inertia(body, w)
    records.set_force(w.y, sp.cross_force(V, joints.momentum(body, V)))
    clear(w.z)


@large_kernel
def _outward(bodies, gravity, q, qd, work):
    start_at_world(gravity, work[0])
    for i in range(1, len(bodies)):
        outward_step(bodies, i, q, qd, work)


@kernel
def outputs(root, xi, kappa, without_xi, gravity, D, D_rate):
    """Results of one degree of freedom, by row: the only place where they are listed.

    `without_xi` is C_ξ but for its part Ḋ ξ, of which C has half; `gravity` is ε_g.
    """
    coriolis = (without_xi + 0.5 * D_rate * xi) / root
    return root * xi, xi, kappa / root, kappa, coriolis, without_xi + D_rate * xi, gravity, D, D_rate


@kernel
def write_outputs(out, k, results):
    """Write the results of one degree of freedom, ν̇ and ξ̇."""
    out[NU, k], out[XI, k], out[EPSILON, k], out[KAPPA, k] = results[0], results[1], results[2], results[3]
    out[CORIOLIS, k], out[CORIOLIS_UNNORMALIZED, k], out[GRAVITY, k] = results[4], results[5], results[6]
    out[ARTICULATED_INERTIA, k], out[ARTICULATED_INERTIA_RATE, k] = results[7], results[8]
    root, nu_dot = math.sqrt(results[7]), results[2] - results[4] - results[6]
    out[NU_DOT, k], out[XI_DOT, k] = nu_dot, (root * (nu_dot + results[4]) - results[5]) / results[7]


@kernel
def inward_joint(direction, armature, rate, tau, V, acceleration, P, P_rate, y, z):
    """The inward step at a joint of one degree of freedom: its results, and P⁺, Ṗ⁺, y⁺ and z⁺ in its own frame.

    One state and many take this step. The direction is a constant, for the compiler's sake.
    """
    D, column, G = joints.joint_inertia(direction, armature, P)
    root = math.sqrt(D)

    # Total rate: own rate, and the rate induced by the base's motion (eq. 5.3)
    v_J = sp.motion_along(direction, rate)
    xi = rate + sp.power(G, sp.subtract_motion(V, v_J))

    # Coriolis term, un-normalized Sᵀ[y − Ṗ(V − S ξ)] and normalized with half of the last part
    u = sp.column_along(direction, P_rate)
    D_rate = sp.along(direction, u)
    without_xi = sp.along(direction, y) - sp.power(u, V)

    kappa = tau - sp.along(direction, z)
    weight = sp.dot(column.force, acceleration) / root

    # y⁺ = τ̄ y + P⁺ζ, P⁺ζ = Pζ − G (P S)ᵀζ;  z⁺ = z + G κ
    zeta = sp.cross_along_z(direction, V, rate)
    y_plus = sp.subtract_force(y, sp.scale_force(G, sp.along(direction, y) + sp.power(column, zeta)))
    y_plus = sp.add_force(y_plus, sp.inertia_times(P, zeta))
    z_plus = sp.add_force(z, sp.scale_force(G, kappa))

    # P⁺ = P − G (P S)ᵀ;  Ṗ⁺ = Ṗ − G hᵀ − h Gᵀ − (v_J×)ᵀP⁺ − P⁺(v_J×), h = Ṗ S − ½ Ḋ G
    P_plus = sp.less_rank_one(P, G, column)
    h = sp.subtract_force(u, sp.scale_force(G, 0.5 * D_rate))
    rate_plus = sp.add_inertia(sp.less_rank_two(P_rate, G, h), sp.transport_along_z(direction, rate, P_plus))
    return outputs(root, xi, kappa, without_xi, weight, D, D_rate), (P_plus, rate_plus, y_plus, z_plus)


@kernel
def _inward_step(bodies, i, direction, qd, tau, work, out):
    """The inward step of one state at a joint of one degree of freedom."""
    body, w = bodies[i], work[i]
    k, P = body.dof, records.inertia_of(w.P)
    results, plus = inward_joint(
        direction,
        w.armature,
        qd[k],
        tau[k],
        records.motion_of(w.V),
        records.vector_of(w.acceleration),
        P,
        records.inertia_of(w.P_rate),
        records.force_of(w.y),
        records.force_of(w.z),
    )
    w.D = results[ARTICULATED_INERTIA]
    if joints.is_singular(joints.scale_along(body, w), w.D):
        return i
    write_outputs(out, k, results)
    if body.parent > 0:
        X, parent = records.placement_of(w), work[body.parent]
        joints.accumulate_scale(w, X, parent)
        records.add_to_inertia(parent.P, sp.inertia_to_parent(X, plus[0]))
        records.add_to_inertia(parent.P_rate, sp.inertia_to_parent(X, plus[1]))
        records.add_to_force(parent.y, sp.force_to_parent(X, plus[2]))
        records.add_to_force(parent.z, sp.force_to_parent(X, plus[3]))
    return 0


@large_kernel
def _inward_coupled(bodies, last, qd, tau, work, table, out):
    """The inward step at degrees of freedom that are eliminated together: see groups."""
    first, Q, Q_rate, kappa, bias = bodies[last].first, table[0], table[1], out[KAPPA], out[CORIOLIS]
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
    carrier = work[bodies[first].parent]
    acceleration = sp.Motion(records.vector_of(carrier.acceleration), sp.ZERO)
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
        records.add_to_force(carrier.y, y)
        records.add_to_force(carrier.z, z)
    return 0


@large_kernel
def _inward_floating_base(bodies, last, qd, tau, work, table, out):
    """As :func:`_inward_coupled`, at a joint of several degrees of freedom that the world carries.

    There V_A is zero, and 𝓜 and 𝓜̇ are P and Ṗ in the joint's own axes: most of what a group needs is not there.
    """
    first, start, w, Q, Q_rate = bodies[last].first, bodies[last].start, work[last], table[0], table[1]
    kappa, bias, gravity = out[KAPPA], out[CORIOLIS], out[GRAVITY]
    P, P_rate, y, z = (
        records.inertia_of(w.P),
        records.inertia_of(w.P_rate),
        records.force_of(w.y),
        records.force_of(w.z),
    )
    weight = sp.inertia_times(P, sp.Motion(records.vector_of(w.acceleration), sp.ZERO))
    for i in range(first, last + 1):
        c, direction = bodies[i].dof, bodies[i].direction
        kappa[c], bias[c], gravity[c] = (
            tau[c] - sp.along(direction, z),
            sp.along(direction, y),
            sp.along(direction, weight),
        )
        column, rate = sp.column_along(direction, P), sp.column_along(direction, P_rate)
        for j in range(first, i + 1):
            b = bodies[j].dof
            Q[b, c - start] = sp.along(bodies[j].direction, column)
            Q_rate[b, c - start] = sp.along(bodies[j].direction, rate)
        Q[c, c - start] += work[i].armature

    for i in range(last, first - 1, -1):
        c = bodies[i].dof
        D, D_rate = Q[c, c - start], Q_rate[c, c - start]
        work[i].D = D
        if joints.is_singular(joints.scale_along(bodies[i], w), D):
            return i
        inverse, root = 1.0 / D, math.sqrt(D)
        xi, momentum_rate = qd[c], D_rate * qd[c]
        for b in range(start, c):
            g, u = Q[b, c - start] * inverse, Q_rate[b, c - start]
            xi += g * qd[b]
            momentum_rate += u * qd[b]
            kappa[b] -= g * kappa[c]
            bias[b] -= g * bias[c]
            gravity[b] -= g * gravity[c]
            for a in range(start, b + 1):  # as eliminate and eliminate_rate of groups
                g_a = Q[a, c - start] * inverse
                Q[a, b - start] -= g_a * Q[b, c - start]
                Q_rate[a, b - start] -= g_a * (u - g * D_rate) + Q_rate[a, c - start] * g
        without_xi = bias[c] - momentum_rate
        weight = gravity[c] / root
        write_outputs(out, c, outputs(root, xi, kappa[c], without_xi, weight, D, D_rate))
    return 0


@kernel
def is_base(bodies, last):
    """Whether a group is one joint, carried by the world."""
    return bodies[bodies[last].first].parent == 0 and bodies[last].dofs == last - bodies[last].first + 1


@large_kernel
def inward_group(bodies, last, qd, tau, work, table, out):
    """The inward step of one state at degrees of freedom that are eliminated together."""
    if is_base(bodies, last):
        return _inward_floating_base(bodies, last, qd, tau, work, table, out)
    return _inward_coupled(bodies, last, qd, tau, work, table, out)


@kernel
def _complete(out, n):
    """Fill the rows of energies; return whether they and all other results are finite."""
    energy = base = power = 0.0
    for k in range(n):
        total = 0.0
        for row in range(XI, N_RESULTS):
            total += out[row, k]
        if not math.isfinite(total):
            return False
        share = 0.5 * out[NU, k] * out[NU, k]
        out[ENERGY_SHARE, k] = share
        energy += share
        if k < 6:
            base = energy
        power += out[NU, k] * (out[EPSILON, k] - out[GRAVITY, k])
    if out.shape[1] > 0:
        out[KINETIC_ENERGY, 0], out[BASE_ENERGY, 0] = energy, base
        out[EFFORT_POWER, 0] = out[POWER, 0] = power
    return math.isfinite(energy) and math.isfinite(power)


@kernel
def sweep(bodies, gravity, q, qd, tau, work, table, out):
    """Fill the rows of `out` from NU on with what :func:`evaluate` gives; q, q̇ and τ are finite."""
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

    Tables 1 and 2, Algorithms 4.1 and 7.1, Lemma 7.3. Rows of `out`, of length nq, are those of :data:`NU` and so on:
    then come ν̇, ξ̇ and ½ν_k², four numbers, and the last two receive q and q̇. Vectors that lie in `out`, and would change
    meanwhile, are no fit: BAD_LENGTH.
    """
    if overlap(q, out) or overlap(qd, out) or overlap(tau, out):
        return BAD_LENGTH
    if not lengths_match(robot, q, qd, tau):
        return BAD_LENGTH
    if not (joints.are_finite(q) and joints.are_finite(qd) and joints.are_finite(tau)):
        return -1
    bodies, gravity, work, table = opened(robot)
    if not joints.are_orientations(bodies, q):
        return -1
    for k in range(len(q)):
        out[POSITIONS, k] = q[k]
    for k in range(len(qd)):
        out[RATES, k] = qd[k]
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
        rate = state[RATES, k]
        sign = float((rate > 0.0) - (rate < 0.0))
        turned = math.tanh(rate / friction_velocity) if friction_velocity > 0.0 else sign
        power += rate * (damping[k] * rate + friction[k] * turned + effort_offset[k])
    return power


@kernel
def energies_of_links(bodies, links, work, qd, energy):
    """Fill `energy` with the kinetic energy of every link, for bodies that move by their V; whether all are finite."""
    for k in range(len(energy)):
        energy[k] = 0.0
    for i in range(1, len(bodies)):
        body = bodies[i]
        rate = body.multiplier * qd[body.dof]
        energy[body.link] += 0.5 * body.armature * (rate * rate)
    for j in range(len(links)):
        V = records.motion_of(work[links[j].body].V)
        energy[links[j].index] += 0.5 * sp.power(joints.momentum(links[j], V), V)
    total = 0.0
    for k in range(len(energy)):
        total += energy[k]
    return math.isfinite(total)


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
    return _link_energies_at(bodies, links, work, state[POSITIONS], state[RATES], energy)


@kernel
def _link_energies_at(bodies, links, work, q, qd, energy):
    joints.set_base_at_rest(work)
    for i in range(1, len(bodies)):
        body, w = bodies[i], work[i]
        joints.update_placement(body, q, w)
        joints.update_velocity(body, qd, work, w)
    return energies_of_links(bodies, links, work, qd, energy)
