# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Columns that are linear in the ten inertial parameters of each body: momentum, ∂K/∂q, gravity, energies.

The parameters of a body are m, mc (three), Ixx, Ixy, Iyy, Ixz, Iyz, Izz about its frame's origin, in that order. For two
motions S and V in the body's frame, SᵀI V = :func:`coefficients` (S, V) times them.
"""

from diag_dynamics.compiled.kernel import (
    FILLED_MATRIX,
    FILLED_STATES,
    MATRIX,
    ROBOT,
    entry_kernel,
    kernel,
    large_kernel,
)
from diag_dynamics.sweeps.bodies import motion_of, set_motion
from diag_dynamics.sweeps.joints import (
    accelerate_world,
    are_finite,
    are_positions,
    move,
    place,
    rest_at_world,
    turn,
)
from diag_dynamics.sweeps.spatial import (
    add,
    cross,
    cross_motion,
    dot,
    motion_along,
    motion_to_child,
)
from diag_dynamics.sweeps.workspace import clear, opened

PARAMETERS = 10
"""Inertial parameters of a body."""


@kernel
def coefficients(S, V):
    """Coefficients of a body's inertial parameters in SᵀI V."""
    a, b, v, w = S.linear, S.angular, V.linear, V.angular
    h = add(cross(a, w), cross(v, b))
    return (
        dot(a, v),
        h[0],
        h[1],
        h[2],
        b[0] * w[0],
        b[0] * w[1] + b[1] * w[0],
        b[1] * w[1],
        b[0] * w[2] + b[2] * w[0],
        b[1] * w[2] + b[2] * w[1],
        b[2] * w[2],
    )


@kernel
def add_to(row, first, values, scale):
    """Add a multiple of ten numbers to a part of a row."""
    for j in range(PARAMETERS):
        row[first + j] += scale * values[j]


@large_kernel
def directions_outward(bodies, gravity, q, qd, work, columns):
    """V of each body, −g in its axes, and the directions of its own and all inboard degrees of freedom, seen in its frame.

    ``columns[i, k]`` has S_k, a follower's times its multiplier, and V_k × S_k, V_k that of the joint's last body. V and −g
    are left in `work`, and −g times the height of the origin in ``work[i].z[0]``.
    """
    rest_at_world(work)
    accelerate_world(gravity, 1.0, work)
    work[0].z[0] = 0.0
    turn(bodies, q, work)
    for i in range(1, len(bodies)):
        body, w, parent = bodies[i], work[i], work[bodies[i].parent]
        X = place(body, q, w)
        V = move(body, qd, work, w)
        up = motion_of(parent.acceleration)
        w.z[0] = parent.z[0] + dot(up.linear, X.translation)
        set_motion(w.acceleration, motion_to_child(X, up))
        a = body.parent
        while a > 0:
            for half in range(0, 12, 6):
                set_motion(columns[i, a, half:], motion_to_child(X, motion_of(columns[body.parent, a, half:])))
            a = bodies[a].parent
        if body.rank == body.dofs - 1:
            for j in range(i - body.rank, i + 1):  # bodies of one joint share a frame
                S = motion_along(bodies[j].direction, bodies[j].multiplier)
                set_motion(columns[i, j], S)
                set_motion(columns[i, j, 6:], cross_motion(V, S))


@entry_kernel(ROBOT, MATRIX, MATRIX, FILLED_STATES, *[FILLED_STATES] * 3, *[FILLED_MATRIX] * 2, nogil=True)
def regressors_many(robot, Q, QD, columns, momentum, velocity, gravity, kinetic, potential):
    """Y_p, Y_∂ and Y_g, (T, nv, 10 N), and y_K and y_U, (T, 10 N), at states, a row of Q and QD each.

    `columns`, (N + 1, N + 1, 12), is memory to work in. Returns the number of states that were done: all, or those before the
    first one that is no state.
    """
    bodies, g, work, _ = opened(robot)
    n = len(bodies)
    for t in range(len(Q)):
        q, qd = Q[t], QD[t]
        if not (are_positions(bodies, q) and are_finite(qd)):
            return t
        directions_outward(bodies, g, q, qd, work, columns)
        for k in range(len(qd)):
            clear(momentum[t, k])
            clear(velocity[t, k])
            clear(gravity[t, k])
        clear(kinetic[t])
        clear(potential[t])
        for i in range(1, n):
            first, w = PARAMETERS * (i - 1), work[i]
            V, up = motion_of(w.V), motion_of(w.acceleration)
            add_to(kinetic[t], first, coefficients(V, V), 0.5)
            potential[t, first] = w.z[0]
            for j in range(3):
                potential[t, first + 1 + j] = up.linear[j]
            if bodies[i].rank < bodies[i].dofs - 1:
                continue  # a body without inertia, whose columns are not made
            a = i
            while a > 0:
                S, rate, k = motion_of(columns[i, a]), motion_of(columns[i, a, 6:]), bodies[a].dof
                add_to(momentum[t, k], first, coefficients(S, V), 1.0)
                add_to(velocity[t, k], first, coefficients(rate, V), 1.0)
                add_to(gravity[t, k], first, coefficients(S, up), 1.0)
                a = bodies[a].parent
    return len(Q)
