# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Columns of momentum, ∂K/∂q and gravity, linear in the inertial parameters, and their low-pass.

The parameters of a body are m, mc (three), Ixx, Ixy, Iyy, Ixz, Iyz, Izz about its frame's origin.
"""

import math

from diag_dynamics.compiled.kernel import (
    FILLED_MATRIX,
    FILLED_STATES,
    MATRIX,
    ROBOT,
    VECTOR,
    entry_kernel,
    kernel,
    large_kernel,
)
from diag_dynamics.sweeps.bodies import motion_of, set_motion
from diag_dynamics.sweeps.joints import accelerate_world, move, place, rest_at_world
from diag_dynamics.sweeps.spatial import add, cross, cross_motion, dot, motion_along, motion_to_child
from diag_dynamics.sweeps.workspace import clear, opened

PARAMETERS = 10  # of a body's inertia


@kernel
def coefficients(S, V):
    """Return the coefficients of a body's parameters in SᵀI V, S and V in the body's frame."""
    a, b, v, w = S.linear, S.angular, V.linear, V.angular
    h = add(cross(a, w), cross(v, b))
    xy, xz, yz = b[0] * w[1] + b[1] * w[0], b[0] * w[2] + b[2] * w[0], b[1] * w[2] + b[2] * w[1]
    return dot(a, v), h[0], h[1], h[2], b[0] * w[0], xy, b[1] * w[1], xz, yz, b[2] * w[2]


@large_kernel
def propagate_directions(bodies, gravity, q, qd, work, directions):
    """Compute V and −g in the frame of each body, and its own and inboard directions.

    ``directions[i, k]`` has S_k, a mimic joint's times its multiplier, and V_k × S_k in the frame of
    body i, V_k that of the joint's last body.
    """
    rest_at_world(work)
    accelerate_world(gravity, 1.0, work)
    for i in range(1, len(bodies)):
        body, w = bodies[i], work[i]
        X = place(body, q, w)
        V = move(body, qd, work, w)
        set_motion(w.acceleration, motion_to_child(X, motion_of(work[body.parent].acceleration)))
        a = body.parent
        while a > 0:
            for half in range(0, 12, 6):
                inboard = motion_of(directions[body.parent, a, half:])
                set_motion(directions[i, a, half:], motion_to_child(X, inboard))
            a = bodies[a].parent
        if body.rank == body.dofs - 1:
            for j in range(i - body.rank, i + 1):  # bodies of one joint share a frame
                S = motion_along(bodies[j].direction, bodies[j].multiplier)
                set_motion(directions[i, j], S)
                set_motion(directions[i, j, 6:], cross_motion(V, S))


@entry_kernel(ROBOT, MATRIX, MATRIX, MATRIX, FILLED_STATES, FILLED_MATRIX, FILLED_MATRIX, nogil=True)
def fill_regressors(robot, Q, QD, first, directions, momentum, bias):
    """Fill rows of Y_p and Y_g − Y_∂ at states, a row of Q and QD each; all joints' rows in one.

    ``first[k, i]`` is where the parameters of body i begin in the row of degree of freedom k, or −1.
    `directions`, (N + 1, N + 1, 12), is memory to work in.
    """
    bodies, gravity, work, _ = opened(robot)
    for t in range(len(Q)):
        propagate_directions(bodies, gravity, Q[t], QD[t], work, directions)
        clear(momentum[t])
        clear(bias[t])
        for i in range(1, len(bodies)):
            if first[bodies[i].dof, i] < 0.0:
                continue
            V, up = motion_of(work[i].V), motion_of(work[i].acceleration)
            a = i
            while a > 0:
                at = int(first[bodies[a].dof, i])
                S, turning = motion_of(directions[i, a]), motion_of(directions[i, a, 6:])
                own, gravity_of, kinetic = coefficients(S, V), coefficients(S, up), coefficients(turning, V)
                for j in range(PARAMETERS):
                    momentum[t, at + j] += own[j]
                    bias[t, at + j] += gravity_of[j] - kinetic[j]
                a = bodies[a].parent


@entry_kernel(VECTOR, MATRIX, FILLED_MATRIX, nogil=True)
def low_pass(time, y, w):
    """Filter the columns of y by λ/(s + λ) in place of w[1:], given w[0]; `time` is λt.

    Exact for inputs that are straight between states: w⁺ = E w + (c − E) y + (1 − c) y⁺ with
    E = exp(−λΔ) and c = (1 − E)/(λΔ).
    """
    for t in range(1, len(time)):
        step = time[t] - time[t - 1]
        decay = math.exp(-step)
        mean = -math.expm1(-step) / step
        old, new = mean - decay, 1.0 - mean
        for j in range(y.shape[1]):
            w[t, j] = decay * w[t - 1, j] + old * y[t - 1, j] + new * y[t, j]
