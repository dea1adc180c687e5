"""Everything of the diagonalized equations of motion at one state: an outward and an inward sweep."""

import math

from diag_dynamics.kernel import entry_kernel, large_kernel
from diag_dynamics.spatial import (
    ZERO,
    Motion,
    add_force,
    add_inertia,
    add_motion,
    along,
    apply_transposed,
    column_along,
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
    scale,
    scale_force,
    subtract_force,
    subtract_motion,
    transport_along_z,
)
from diag_dynamics.sweeps.groups import (
    carried_motion,
    compose,
    compose_rates,
    eliminate,
    eliminate_rate,
    filter_moments,
    gather,
    gather_bias,
    induced_rate,
    is_grouped,
    momentum_rate,
    owns,
)
from diag_dynamics.sweeps.records import (
    add_to_force,
    add_to_inertia,
    force_of,
    inertia_of,
    motion_of,
    opened,
    placement_of,
    set_force,
    set_motion,
    set_vector,
    vector_of,
)
from diag_dynamics.sweeps.steps import (
    are_finite,
    are_positions,
    is_singular,
    joint_inertia,
    magnitude_along,
    momentum,
    own_motion,
    pass_inertia,
    place,
    rest_at_world,
    start_inertia,
)

NU, XI, EPSILON, KAPPA, CORIOLIS, CORIOLIS_UNNORMALIZED, GRAVITY = range(7)
"""Rows of the output of :func:`evaluate`."""

ARTICULATED_INERTIA, ARTICULATED_INERTIA_RATE, RATES, ROWS = range(7, 11)


@large_kernel
def _outward(bodies, gravity, q, qd, work):
    """V, gravity's acceleration, and what the inward sweep starts from."""
    world = work[0]
    rest_at_world(work)
    set_vector(world.acceleration, 0, scale(vector_of(gravity), -1.0))
    for i in range(1, len(bodies)):
        body, w, parent = bodies[i], work[i], work[bodies[i].parent]
        X = place(body, q, w)
        V = add_motion(motion_to_child(X, motion_of(parent.V)), own_motion(body, qd))
        set_motion(w.V, V)
        set_vector(w.acceleration, 0, apply_transposed(X.rotation, vector_of(parent.acceleration)))
        start_inertia(body, w)
        w.P_rate[:] = 0.0
        set_force(w.y, cross_force(V, momentum(body, V)))
        w.z[:] = 0.0


@large_kernel
def _axis(bodies, i, qd, tau, work, out):
    """The inward step at a joint of one degree of freedom."""
    body, w = bodies[i], work[i]
    k, direction = body.dof, body.direction
    rate = qd[k]
    V, P, P_rate, y, z = motion_of(w.V), inertia_of(w.P), inertia_of(w.P_rate), force_of(w.y), force_of(w.z)

    D, column, G = joint_inertia(direction, w, P)
    w.D = D
    if is_singular(magnitude_along(body, w), D):
        return i
    root = math.sqrt(D)

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
    out[GRAVITY, k] = dot(column.force, vector_of(w.acceleration)) / root
    out[ARTICULATED_INERTIA, k] = D
    out[ARTICULATED_INERTIA_RATE, k] = D_rate

    if body.parent > 0:
        # P⁺ = τ̄ P;  Ṗ⁺ = τ̄ Ṗ τ̄ᵀ − (v_J×)ᵀP⁺ − P⁺(v_J×);  y⁺ = τ̄ y + P⁺ζ;  z⁺ = z + G κ
        X, parent = placement_of(w), work[body.parent]
        P_plus = less_rank_one(P, G, column)
        filtered = less_rank_two(P_rate, G, subtract_force(u, scale_force(G, 0.5 * D_rate)))
        moved = transport_along_z(direction, rate, P_plus)
        y_plus = subtract_force(y, scale_force(G, along(direction, y)))
        z_plus = add_force(z, scale_force(G, kappa))
        pass_inertia(w, P, P_plus, parent)
        add_to_inertia(parent.P_rate, inertia_to_parent(X, add_inertia(filtered, moved)))
        zeta = cross_motion(V, v_J)
        add_to_force(parent.y, force_to_parent(X, add_force(y_plus, inertia_times(P_plus, zeta))))
        add_to_force(parent.z, force_to_parent(X, z_plus))
    return 0


@large_kernel
def _group(bodies, last, qd, tau, work, table, out):
    """The inward step at degrees of freedom that are eliminated together: see groups."""
    first, Q, Q_rate, kappa, bias = bodies[last].first, table[0], table[1], out[KAPPA], out[CORIOLIS]
    for i in range(first, last + 1):
        kappa[bodies[i].dof], bias[bodies[i].dof] = tau[bodies[i].dof], 0.0
    z = gather(bodies, first, last, work, work.z, -1.0, kappa)
    compose(bodies, first, last, work, Q)
    y = gather_bias(bodies, first, last, qd, work, work.V, -1.0, bias)
    compose_rates(bodies, first, last, qd, work, Q_rate)
    status = eliminate(bodies, first, last, work, Q, False)
    if status != 0:
        return status
    y = add_force(y, filter_moments(bodies, first, last, work, Q, bias))
    z = add_force(z, filter_moments(bodies, first, last, work, Q, kappa))

    V_A = carried_motion(bodies, first, work)
    carrier = work[bodies[first].parent]
    acceleration = Motion(vector_of(carrier.acceleration), ZERO)
    for i in range(last, first - 1, -1):
        if not owns(bodies, i):
            continue
        w, k, start = work[i], bodies[i].dof, bodies[i].start
        G, D, D_rate = force_of(w.G), w.D, Q_rate[k, k - start]
        root, xi = math.sqrt(D), qd[k] + induced_rate(bodies, i, V_A, qd, Q, G)
        without_xi = -bias[k] - momentum_rate(bodies, i, V_A, qd, work, Q_rate)
        out[NU, k] = root * xi
        out[XI, k] = xi
        out[EPSILON, k] = kappa[k] / root
        out[CORIOLIS, k] = (without_xi + 0.5 * D_rate * xi) / root
        out[CORIOLIS_UNNORMALIZED, k] = without_xi + D_rate * xi
        out[GRAVITY, k] = root * power(G, acceleration)
        out[ARTICULATED_INERTIA, k] = D
        out[ARTICULATED_INERTIA_RATE, k] = D_rate
        eliminate_rate(bodies, first, i, work, Q, Q_rate)
    if bodies[first].parent > 0:
        add_to_force(carrier.y, y)
        add_to_force(carrier.z, z)
    return 0


@large_kernel
def _is_finite_result(out):
    """Whether every row is finite, and the kinetic energy too."""
    energy = 0.0
    for k in range(out.shape[1]):
        energy += out[NU, k] ** 2
    for row in range(out.shape[0]):
        if not are_finite(out[row]):
            return False
    return math.isfinite(energy)


@entry_kernel
def evaluate(robot, q, qd, tau, out, twists):
    """ν, ξ, ε, κ, C, C_ξ, ε_g, D and Ḋ at one state, in an outward and an inward sweep.

    Tables 1 and 2, Algorithms 4.1 and 7.1, Lemma 7.3. Rows of `out` are those of :data:`NU` and so on;
    `twists` receives V of every body, and the last row q̇.
    """
    bodies, gravity, work, table = opened(robot)
    if not (are_positions(bodies, q) and are_finite(qd) and are_finite(tau)):
        return -1
    _outward(bodies, gravity, q, qd, work)
    out[RATES] = qd
    twists[0] = 0.0
    for i in range(1, len(bodies)):
        twists[i] = work[i].V
    i = len(bodies) - 1
    while i > 0:
        first = bodies[i].first
        grouped = is_grouped(bodies[i])
        status = _group(bodies, i, qd, tau, work, table, out) if grouped else _axis(bodies, i, qd, tau, work, out)
        if status != 0:
            return status
        i = first - 1
    return 0 if _is_finite_result(out) else -1


@entry_kernel
def link_energy(bodies, links, twists, qd, out):
    """½VᵀIV of each link with inertia, in the frame of the body it belongs to, and ½ armature q̇² of its joint."""
    out[:] = 0.0
    for j in range(len(links)):
        link = links[j]
        V = motion_of(twists[link.body])
        out[link.index] += 0.5 * power(momentum(link, V), V)
    for i in range(1, len(bodies)):
        body = bodies[i]
        out[body.link] += 0.5 * body.armature * (body.multiplier * qd[body.dof]) ** 2


# --- Many states ------------------------------------------------------------------------------------------


@entry_kernel
def evaluate_many(robot, Q, QD, TAU, out, twists, failed):
    """:func:`evaluate` at each of many states, the first axis of all arguments; `failed` receives the first that fails.

    Without efforts TAU has one row, of zeros.
    """
    for t in range(len(Q)):
        status = evaluate(robot, Q[t], QD[t], TAU[min(t, len(TAU) - 1)], out[t], twists[t])
        if status != 0:
            failed[0] = t
            return status
    return 0


@entry_kernel
def link_energies(bodies, links, twists, out, energies):
    """:func:`link_energy` at each of many states, of what :func:`evaluate_many` has filled."""
    for t in range(len(out)):
        link_energy(bodies, links, twists[t], out[t, RATES], energies[t])
