# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Filtered momentum regressor and its normal equations, state by state, in one pass."""

import math

from diag_dynamics.compiled.kernel import COUNT, FLAG, MATRIX, NUMBER, ROBOT, VECTOR, entry_kernel, kernel
from diag_dynamics.compiled.tables import Table, array
from diag_dynamics.identification.kernels.regressors import add_to, coefficients, directions_outward
from diag_dynamics.sweeps.bodies import motion_of
from diag_dynamics.sweeps.joints import are_finite, are_positions
from diag_dynamics.sweeps.workspace import clear, opened

NORMAL_EQUATIONS = Table(
    "NormalEquations",
    place=array(int, 2),  # where the ten entries of a body begin in the rows, by degree of freedom and body; or -1
    first=array(int),  # where the row of each degree of freedom begins; its last four entries are OWN
    corner=array(int),  # where its matrix begins in `square`
    columns=array(float, 3),  # directions of degrees of freedom, see regressors
    momentum=array(float),  # rows, one behind the other: λ times those of momentum
    before=array(float),  # those that go through the filter, of the state before
    now=array(float),
    filtered=array(float),
    effort=array(float, 2),  # of the state before, and filtered
    waiting=array(float, 2),  # rows that are in no sum yet, times the root of their weight
    count=array(int),  # how many there are
    square=array(float),  # sums that are kept: AᵀA of each degree of freedom, row-major
    right=array(float),  # Aᵀb
    numbers=array(float, 2),  # bᵀb of each degree of freedom, and the sum of weights
    time=array(float),  # of the state before [s]
)
"""What is known of a pass that is not over yet."""

OWN = 4
"""Columns of a degree of freedom: damping, Coulomb friction, offset, rotor."""

TOGETHER = 4
"""Rows that are added to AᵀA at once: it is larger than the fastest memory, through which it goes each time."""

_equations_at = NORMAL_EQUATIONS.opened


@kernel
def _rows(bodies, gravity, q, qd, rate, friction_velocity, work, of, y):
    """λ Y_p, and what goes through the filter: Y_g − Y_∂ − λ Y_p; the same of friction and rotor."""
    directions_outward(bodies, gravity, q, qd, work, of.columns)
    clear(of.momentum)
    clear(y)
    for i in range(1, len(bodies)):
        if of.place[bodies[i].dof, i] < 0:
            continue
        V, up = motion_of(work[i].V), motion_of(work[i].acceleration)
        a = i
        while a > 0:
            at = of.place[bodies[a].dof, i]
            S, turning = motion_of(of.columns[i, a]), motion_of(of.columns[i, a, 6:])
            momentum = coefficients(S, V)
            add_to(of.momentum, at, momentum, rate)
            add_to(y, at, momentum, -rate)
            add_to(y, at, coefficients(turning, V), -1.0)
            add_to(y, at, coefficients(S, up), 1.0)
            a = bodies[a].parent
    for k in range(len(qd)):
        at = of.first[k + 1] - OWN
        y[at] = qd[k]
        if friction_velocity > 0.0:
            y[at + 1] = math.tanh(qd[k] / friction_velocity)
        else:
            y[at + 1] = 1.0 if qd[k] > 0.0 else (-1.0 if qd[k] < 0.0 else 0.0)
        y[at + 2] = 1.0
        y[at + 3] = -rate * qd[k]
        of.momentum[at + 3] = rate * qd[k]


@kernel
def _add_squares(of):
    """Add AᵀA of the rows that wait, its lower triangles."""
    a, b, c, d = of.waiting[0], of.waiting[1], of.waiting[2], of.waiting[3]
    for k in range(len(of.corner) - 1):
        first = of.first[k]
        size = of.first[k + 1] - first
        for j in range(size):
            at, p = of.corner[k] + j * size, first + j
            ap, bp, cp, dp = a[p], b[p], c[p], d[p]
            for i in range(j + 1):
                of.square[at + i] += ap * a[first + i] + bp * b[first + i] + cp * c[first + i] + dp * d[first + i]
    of.count[0] = 0


@entry_kernel(ROBOT, COUNT, MATRIX, MATRIX, MATRIX, VECTOR, FLAG, NUMBER, NUMBER, nogil=True)
def take_many(robot, equations, Q, QD, TAU, t, anew, rate, friction_velocity):
    """Add the rows of states to the normal equations: one of Q, QD, TAU and t [s] each, the times rising.

    For inputs that are straight between states the filter of a rate λ is exact:
    w ← E w + (c − E) y + (1 − c) y⁺, E = exp(−λΔ), c = (1 − E)/(λΔ). Where all begins `anew`, at the first state, the filter
    of momentum begins at its first value and every other one at zero. A row has the weight min(1, λΔ/2), as rows that are
    closer than the filter's memory tell the same. Returns the number of states that were done.
    """
    bodies, gravity, work, _ = opened(robot)
    of, nv = _equations_at(equations), QD.shape[1]
    for s in range(len(Q)):
        q, qd, tau = Q[s], QD[s], TAU[s]
        if not (are_positions(bodies, q) and are_finite(qd) and are_finite(tau)):
            return s
        begins = anew and s == 0
        _rows(bodies, gravity, q, qd, rate, friction_velocity, work, of, of.now)
        if begins:
            for j in range(len(of.now)):
                of.filtered[j] = -of.momentum[j]
            clear(of.effort[1])
        else:
            step = rate * (t[s] - of.time[0])
            decay = math.exp(-step)
            mean = -math.expm1(-step) / step
            old, new = mean - decay, 1.0 - mean
            for j in range(len(of.now)):
                of.filtered[j] = decay * of.filtered[j] + old * of.before[j] + new * of.now[j]
            for k in range(nv):
                of.effort[1, k] = decay * of.effort[1, k] + old * of.effort[0, k] + new * tau[k]
            weight = min(1.0, 0.5 * step)
            root = math.sqrt(weight)
            row, scaled = of.momentum, of.waiting[of.count[0]]
            for j in range(len(row)):
                row[j] += of.filtered[j]
                scaled[j] = root * row[j]
            for k in range(nv):
                effort = of.effort[1, k]
                for j in range(of.first[k], of.first[k + 1]):
                    of.right[j] += weight * effort * row[j]
                of.numbers[0, k] += weight * effort * effort
                of.numbers[1, k] += weight
            of.count[0] += 1
            if of.count[0] == TOGETHER:
                _add_squares(of)
        of.time[0] = t[s]
        for j in range(len(of.now)):
            of.before[j] = of.now[j]
        for k in range(nv):
            of.effort[0, k] = tau[k]
    return len(Q)
