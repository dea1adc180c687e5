# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The classical form: M(q) q̈ + c(q, q̇) + g(q) = τ + Jᵀf, its forward and inverse dynamics."""

from diag_dynamics.compiled.arrays import flat
from diag_dynamics.compiled.kernel import (
    FILLED_MATRIX,
    FILLED_VECTOR,
    FLAG,
    NUMBER,
    ROBOT,
    VECTOR,
    entry_kernel,
    kernel,
    large_kernel,
)
from diag_dynamics.sweeps.bodies import (
    WRENCHES,
    add_to_force,
    force_of,
    inertia_of,
    matrix_of,
    motion_of,
    placement_of,
    set_force,
    set_matrix,
    set_motion,
    set_vector,
    vector_of,
)
from diag_dynamics.sweeps.groups import (
    compose,
    eliminate,
    filter_moments,
    gather_bias,
    induced_rate,
    is_grouped,
    owns,
)
from diag_dynamics.sweeps.joints import (
    accelerate_world,
    are_finite,
    are_positions,
    is_singular,
    joint_inertia,
    magnitude_along,
    momentum,
    motion_outboard,
    move,
    own_motion,
    pass_size,
    place,
    place_all,
    propagate_inertia,
    rest_at_world,
    start,
    start_inertia,
    zeta,
)
from diag_dynamics.sweeps.spatial import (
    ANGULAR_Z,
    LINEAR_Z,
    Force,
    add,
    add_force,
    add_motion,
    along,
    apply,
    apply_transposed,
    cross,
    cross_along_z,
    cross_force,
    force_to_parent,
    inertia_times,
    motion_to_child,
    power,
    product,
    scale,
    scale_force,
)
from diag_dynamics.sweeps.workspace import MISFIT, clear, copy, fit, opened


@kernel
def _spend(bodies, i, direction, qd, work, qdd):
    """The inward step of :func:`forward_dynamics` at a joint of one degree of freedom; the direction is a constant."""
    body, w = bodies[i], work[i]
    k, P, y = body.dof, inertia_of(w.P), force_of(w.y)
    D, column, G = joint_inertia(direction, w, P)
    w.D = D
    if is_singular(magnitude_along(body, w), D):
        return i
    set_force(w.G, G)
    remainder = qdd[k] - along(direction, y)
    qdd[k] = remainder / D
    zeta = cross_along_z(direction, motion_of(w.V), qd[k])
    set_motion(w.zeta, zeta)
    if body.parent > 0:
        X, parent = placement_of(w), work[body.parent]
        y_plus = add_force(y, scale_force(G, remainder - power(column, zeta)))  # P⁺ζ = Pζ − G (P S)ᵀζ
        y_plus = add_force(y_plus, inertia_times(P, zeta))
        pass_size(w, X, parent)
        propagate_inertia(w, G, column, X, parent)
        add_to_force(parent.y, force_to_parent(X, y_plus))
    return 0


@large_kernel
def _spend_of_group(bodies, last, qd, work, Q, qdd):
    """The inward step of :func:`forward_dynamics` at degrees of freedom that are eliminated together: see groups."""
    first = bodies[last].first
    compose(bodies, first, last, work, Q)
    y = gather_bias(bodies, first, last, qd, work, work.V, -1.0, qdd)
    status = eliminate(bodies, first, last, work, Q, False)
    if status != 0:
        return status
    y = add_force(y, filter_moments(bodies, first, last, work, Q, qdd))
    if bodies[first].parent > 0:
        add_to_force(work[bodies[first].parent].y, y)
    for i in range(first, last + 1):
        if owns(bodies, i):
            qdd[bodies[i].dof] /= work[i].D
    return 0


@large_kernel
def _accelerate(bodies, i, qd, work, Q, qdd):
    """The last outward step of :func:`forward_dynamics` at a body of a group."""
    body, w, carrier = bodies[i], work[i], work[bodies[bodies[i].first].parent]
    A = motion_outboard(body, w, motion_of(work[body.parent].acceleration))
    if body.rank == 0:
        A = add_motion(A, zeta(bodies, i, qd, work))
    if i == body.first:
        for j in range(i, body.last + 1):
            if owns(bodies, j):
                qdd[bodies[j].dof] -= induced_rate(
                    bodies, j, motion_of(carrier.acceleration), qdd, Q, force_of(work[j].G)
                )
    set_motion(w.acceleration, add_motion(A, own_motion(body, qdd)))


@kernel
def accelerations(bodies, gravity, q, qd, tau, added, work, Q, qdd):
    """q̈ from τ: an outward, an inward and another outward sweep (theory: A₀ = −g, κ with gravity left in).

    Where `added` is given, it enters D as armature does.
    """
    n = len(bodies)
    rest_at_world(work)
    for i in range(1, n):
        body, w = bodies[i], work[i]
        place(body, q, w)
        V = move(body, qd, work, w)
        start_inertia(body, w)
        if added is not None and owns(bodies, i):
            w.armature += added[body.dof]
        set_force(w.y, cross_force(V, momentum(body, V)))

    copy(tau, qdd)
    i = n - 1
    while i > 0:  # qdd becomes D⁻¹(τ − Sᵀy), y that of the links outboard with the torques already spent on them
        body = bodies[i]
        if is_grouped(body):
            status = _spend_of_group(bodies, i, qd, work, Q, qdd)
        elif body.direction == ANGULAR_Z:
            status = _spend(bodies, i, ANGULAR_Z, qd, work, qdd)
        else:
            status = _spend(bodies, i, LINEAR_Z, qd, work, qdd)
        if status != 0:
            return status
        i = body.first - 1

    accelerate_world(gravity, 1.0, work)
    for i in range(1, n):
        body, w = bodies[i], work[i]
        if is_grouped(body):
            _accelerate(bodies, i, qd, work, Q, qdd)
            continue
        A = motion_to_child(placement_of(w), motion_of(work[body.parent].acceleration))
        A = add_motion(A, motion_of(w.zeta))
        qdd[body.dof] -= power(force_of(w.G), A)
        set_motion(w.acceleration, add_motion(A, own_motion(body, qdd)))
    return 0 if are_finite(qdd) else -1


@entry_kernel(ROBOT, VECTOR, VECTOR, VECTOR, FILLED_VECTOR)
def forward_dynamics(robot, q, qd, tau, qdd):
    """q̈ from τ."""
    if not fit(robot, q, qd, tau):
        return MISFIT
    bodies, gravity, work, table = opened(robot)
    if not (are_positions(bodies, q) and are_finite(qd) and are_finite(tau)):
        return -1
    return accelerations(bodies, gravity, q, qd, tau, None, work, table[0], qdd)


@large_kernel
def accelerations_with_added_inertia(robot, q, qd, tau, added, qdd):
    """q̈ from τ, as :func:`forward_dynamics`, with inertia that enters D as armature does; nothing is checked."""
    bodies, gravity, work, table = opened(robot)
    return accelerations(bodies, gravity, q, qd, tau, added, work, table[0], qdd)


@entry_kernel(ROBOT, VECTOR, VECTOR, VECTOR, NUMBER, FILLED_VECTOR)
def inverse_dynamics(robot, q, qd, qdd, weight, tau):
    """τ = M q̈ + c + g (Newton–Euler, eq. 4.3), g times a weight of 0 or 1."""
    bodies, gravity, work, _ = opened(robot)
    if not (are_positions(bodies, q) and are_finite(qd) and are_finite(qdd)):
        return -1
    n = len(bodies)
    rest_at_world(work)
    accelerate_world(gravity, weight, work)
    for i in range(1, n):
        body, w, parent = bodies[i], work[i], work[bodies[i].parent]
        X = place(body, q, w)
        V = move(body, qd, work, w)
        A = add_motion(motion_to_child(X, motion_of(parent.acceleration)), own_motion(body, qdd))
        if body.rank == body.dofs - 1:  # the joint's last body: the earlier ones have no inertia
            A = add_motion(A, zeta(bodies, i - body.rank, qd, work))
        set_motion(w.acceleration, A)
        set_force(w.y, add_force(momentum(body, A), cross_force(V, momentum(body, V))))
    clear(tau)
    for i in range(n - 1, 0, -1):
        body, w = bodies[i], work[i]
        y = force_of(w.y)
        effort = along(body.direction, y) + body.armature * body.multiplier * qdd[body.dof]
        tau[body.dof] += body.multiplier * effort
        if body.parent > 0:
            add_to_force(work[body.parent].y, force_to_parent(placement_of(w), y))
    return 0 if are_finite(tau) else -1


@entry_kernel(ROBOT, VECTOR, WRENCHES, FLAG, FILLED_VECTOR)
def effort_of_wrenches(robot, q, wrenches, in_world, tau):
    """Jᵀf of wrenches at points of bodies, in the axes of the body or of the world."""
    bodies, _, work, _ = opened(robot)
    if not are_positions(bodies, q):
        return -1
    n = len(bodies)
    set_matrix(work[0].orientation, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    for i in range(1, n):
        X = place(bodies[i], q, work[i])
        set_matrix(work[i].orientation, product(matrix_of(work[bodies[i].parent].orientation), X.rotation))
        clear(work[i].y)
    for j in range(len(wrenches)):
        wrench = wrenches[j]
        w = work[wrench.body]
        force, moment = vector_of(wrench.force), vector_of(wrench.moment)
        if in_world:
            R = matrix_of(w.orientation)
            force, moment = apply_transposed(R, force), apply_transposed(R, moment)
        add_to_force(w.y, Force(force, add(moment, cross(vector_of(wrench.point), force))))
    clear(tau)
    for i in range(n - 1, 0, -1):
        body, w = bodies[i], work[i]
        y = force_of(w.y)
        tau[body.dof] += body.multiplier * along(body.direction, y)
        if body.parent > 0:
            add_to_force(work[body.parent].y, force_to_parent(placement_of(w), y))
    return 0


@entry_kernel(ROBOT, VECTOR, FILLED_MATRIX)
def mass_matrix(robot, q, M):
    """M from the inertias of the composite rigid bodies outboard of each joint."""
    bodies, _, work, _ = opened(robot)
    if not are_positions(bodies, q):
        return -1
    start(bodies, q, work)
    if len(bodies) > 1:
        compose(bodies, 1, len(bodies) - 1, work, M)  # all bodies as one group: its 𝓜 is M
    return 0 if are_finite(flat(M)) else -1


@entry_kernel(ROBOT, VECTOR, FILLED_VECTOR)
def first_moment(robot, q, moment):
    """Σ m_i c_i of all moving bodies in the world's axes [kg m], in an inward sweep."""
    bodies, _, work, _ = opened(robot)
    n = len(bodies)
    place_all(bodies, q, work)
    for i in range(n):
        clear(work[i].y)
        work[i].y[0] = bodies[i].mass
        set_vector(work[i].z, 0, vector_of(bodies[i].first_moment))
    for i in range(n - 1, 0, -1):
        w, parent = work[i], work[bodies[i].parent]
        X = placement_of(w)
        parent.y[0] += w.y[0]
        h = add(apply(X.rotation, vector_of(w.z)), scale(X.translation, w.y[0]))
        set_vector(parent.z, 0, add(vector_of(parent.z), h))
    set_vector(moment, 0, vector_of(work[0].z))
