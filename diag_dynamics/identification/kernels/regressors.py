# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Columns of momentum, ∂K/∂q and gravity, linear in the inertial parameters, and their low-pass.

The parameters of a body are m, mc (three), Ixx, Ixy, Iyy, Ixz, Iyz, Izz about its frame's origin.
"""

import math

from diag_dynamics.numerics.kernel import (
    FILLED_MATRIX,
    FILLED_STATES,
    MATRIX,
    ROBOT,
    VECTOR,
    entry_kernel,
    large_kernel,
)
from diag_dynamics.sweeps import records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps.regressors import coefficients, propagate_motions
from diag_dynamics.sweeps.workspace import clear, opened

PARAMETERS = 10  # of a body's inertia


@large_kernel
def propagate_directions(bodies, gravity, q, qd, work, directions):
    """Compute V and −g in the frame of each body, and its own and inboard directions.

    ``directions[i, k]`` has S_k, a mimic joint's times its multiplier, and V_k × S_k in the frame of
    body i, V_k that of the joint's last body.
    """
    propagate_motions(bodies, len(bodies) - 1, gravity, q, qd, work)
    for i in range(1, len(bodies)):
        body, w = bodies[i], work[i]
        X, V = records.placement_of(w), records.motion_of(w.V)
        a = body.parent
        while a > 0:
            for half in range(0, 12, 6):
                inboard = records.motion_of(directions[body.parent, a, half:])
                records.set_motion(directions[i, a, half:], sp.motion_to_child(X, inboard))
            a = bodies[a].parent
        if body.rank == body.dofs - 1:
            for j in range(i - body.rank, i + 1):  # bodies of one joint share a frame
                S = sp.motion_along(bodies[j].direction, work[j].multiplier)
                changing = sp.motion_along(bodies[j].direction, work[j].multiplier_rate)
                turning = sp.add_motion(sp.cross_motion(V, S), changing)
                records.set_motion(directions[i, j], S)
                records.set_motion(directions[i, j, 6:], turning)


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
            V, up = records.motion_of(work[i].V), records.motion_of(work[i].acceleration)
            a = i
            while a > 0:
                at = int(first[bodies[a].dof, i])
                S, turning = records.motion_of(directions[i, a]), records.motion_of(directions[i, a, 6:])
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
