# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sweeps over many states: the evaluation of several side by side, the others one after the other.

The evaluation has one row of memory per body, with number f of state b at ``row[f * WIDTH + b]``. The step at a body
reads and writes its own row alone, at distances that the compiler knows, and so LLVM makes vector instructions of the
loops over b. What the parent accumulates is added in a loop of its own. No operation is reordered: results have the bits
of single calls. Joints of several degrees of freedom and groups are rare, and take the step of a single state.

Each entry returns the end of what it has done: all, or what comes before the first states one of which fails.
"""

import itertools
import math

from diag_dynamics.numerics.kernel import (
    COUNT,
    FILLED_MATRIX,
    FILLED_STATES,
    FLAG,
    MATRIX,
    NUMBER,
    ROBOT,
    entry_kernel,
    kernel,
    large_kernel,
)
from diag_dynamics.sweeps import classical, evaluation, factorization, groups, joints, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps.trigonometry import LARGEST, near_sine_and_cosine
from diag_dynamics.sweeps.workspace import ARTICULATED_INERTIA as D
from diag_dynamics.sweeps.workspace import EPSILON, GRAVITY, N_NUMBERS, N_RESULTS, NU, WIDTH, batch_of, copy

K, BASE, POWER, NET_POWER = range(N_NUMBERS)
"""Numbers of a state: workspace.KINETIC_ENERGY and those that follow."""

# --- The row of a body ---

ROTATION, TRANSLATION, V, ACCELERATION, P, P_RATE, Y, Z, MAGNITUDE, TOTAL, N_SWEPT = itertools.accumulate(
    records.SWEPT_FIELDS.values(), initial=0
)
"""First numbers of the fields that the row shares with a body's record."""

ACCUMULATED = N_SWEPT - P
"""Numbers that a body accumulates from its children: those from P on."""

TO_PARENT = N_SWEPT
TO_PARENT_RATE, TO_PARENT_Y, TO_PARENT_Z, TO_PARENT_SCALE = (TO_PARENT - P + k for k in (P_RATE, Y, Z, MAGNITUDE))
V_PARENT = TO_PARENT + ACCUMULATED
ACCELERATION_PARENT = V_PARENT + 6
POSITION, RATE, EFFORT, SINE, COSINE, OUTPUT = range(V_PARENT + 9, V_PARENT + 15)
ROW_NUMBERS = OUTPUT + N_RESULTS
"""Numbers of one state in a row: what the parent accumulates, its motion, what the joint is given, and results."""


@kernel
def _vector(row, f, b):
    return (row[f * WIDTH + b], row[(f + 1) * WIDTH + b], row[(f + 2) * WIDTH + b])


@kernel
def _matrix(row, f, b):
    return (_vector(row, f, b), _vector(row, f + 3, b), _vector(row, f + 6, b))


@kernel
def _symmetric(row, f, b):
    x, y = _vector(row, f, b), _vector(row, f + 3, b)
    return (x, (x[1], y[0], y[1]), (x[2], y[1], y[2]))


@kernel
def _motion(row, f, b):
    return sp.Motion(_vector(row, f, b), _vector(row, f + 3, b))


@kernel
def _force(row, f, b):
    return sp.Force(_vector(row, f, b), _vector(row, f + 3, b))


@kernel
def _inertia(row, f, b):
    return sp.Inertia(_symmetric(row, f, b), _matrix(row, f + 6, b), _symmetric(row, f + 15, b))


@kernel
def _set_vector(row, f, b, v):
    row[f * WIDTH + b], row[(f + 1) * WIDTH + b], row[(f + 2) * WIDTH + b] = v


@kernel
def _set_pair(row, f, b, pair):
    """Write a Motion or a Force."""
    _set_vector(row, f, b, pair[0])
    _set_vector(row, f + 3, b, pair[1])


@kernel
def _set_matrix(row, f, b, M):
    _set_vector(row, f, b, M[0])
    _set_vector(row, f + 3, b, M[1])
    _set_vector(row, f + 6, b, M[2])


@kernel
def _set_symmetric(row, f, b, M):
    _set_vector(row, f, b, M[0])
    _set_vector(row, f + 3, b, (M[1][1], M[1][2], M[2][2]))


@kernel
def _set_inertia(row, f, b, inertia):
    _set_symmetric(row, f, b, inertia.A)
    _set_matrix(row, f + 6, b, inertia.B)
    _set_symmetric(row, f + 15, b, inertia.C)


@kernel
def _set_results(row, b, x):
    _set_matrix(row, OUTPUT, b, ((x[0], x[1], x[2]), (x[3], x[4], x[5]), (x[6], x[7], x[8])))


# --- Steps side by side, at a joint of one degree of freedom ---


@kernel
def _read_joint(body, row, Q, QD, TAU, first, last):
    """Position, rate and effort of a joint at states `first` to `last`, of which the last one fills the row."""
    for b in range(WIDTH):
        t = min(first + b, last - 1)
        row[POSITION * WIDTH + b] = body.multiplier * Q[t, body.q] + body.offset
        row[RATE * WIDTH + b] = body.multiplier * QD[min(t, len(QD) - 1), body.dof]
        row[EFFORT * WIDTH + b] = TAU[min(t, len(TAU) - 1), body.dof]


@kernel
def _fill_large_angles(row):
    """Sine and cosine of angles that near_sine_and_cosine is not for."""
    for b in range(WIDTH):
        x = row[POSITION * WIDTH + b]
        if not abs(x) < LARGEST:
            row[SINE * WIDTH + b], row[COSINE * WIDTH + b] = math.sin(x), math.cos(x)


@kernel
def _outward_joint(direction, body, row, parent):
    """As evaluation.outward_step."""
    for k in range(9 * WIDTH):
        row[V_PARENT * WIDTH + k] = parent[V * WIDTH + k]
    rotation, translation = records.matrix_of(body.rotation), records.vector_of(body.translation)
    mass, first_moment, inertia = body.mass, records.vector_of(body.first_moment), records.symmetric_of(body.inertia)
    own, angular = sp.rigid_inertia(mass, first_moment, inertia), body.inertia[0] + body.inertia[3] + body.inertia[5]
    if direction == sp.ANGULAR_Z:
        _fill_large_angles(row)
    for b in range(WIDTH):
        if direction == sp.ANGULAR_Z:
            x, sine, cosine = (row[POSITION * WIDTH + b], row[SINE * WIDTH + b], row[COSINE * WIDTH + b])
            near, (near_sine, near_cosine) = abs(x) < LARGEST, near_sine_and_cosine(x)
            turned = sp.turned_about_z(rotation, near_sine if near else sine, near_cosine if near else cosine)
            X = sp.Placement(turned, translation)
        else:
            moved = sp.apply(rotation, (0.0, 0.0, row[POSITION * WIDTH + b]))
            X = sp.Placement(rotation, sp.add(translation, moved))
        own_motion = sp.motion_along(direction, row[RATE * WIDTH + b])
        motion = sp.add_motion(sp.motion_to_child(X, _motion(row, V_PARENT, b)), own_motion)
        momentum = sp.rigid_momentum(mass, first_moment, inertia, motion)
        _set_matrix(row, ROTATION, b, X.rotation)
        _set_vector(row, TRANSLATION, b, X.translation)
        _set_pair(row, V, b, motion)
        _set_vector(row, ACCELERATION, b, sp.apply_transposed(X.rotation, _vector(row, ACCELERATION_PARENT, b)))
        _set_inertia(row, P, b, own)
        _set_inertia(row, P_RATE, b, sp.NO_INERTIA)
        _set_pair(row, Y, b, sp.cross_force(motion, momentum))
        _set_pair(row, Z, b, sp.NO_FORCE)
        _set_vector(row, MAGNITUDE, b, (3.0 * mass, angular, 3.0 * mass))
        row[(TOTAL + 1) * WIDTH + b] = angular


@kernel
def _inward_joint(direction, body, row, parent):
    """As evaluation's step; returns how many states are singular."""
    armature, part, singular = body.armature, 0 if direction < sp.ANGULAR_X else 1, 0
    for b in range(WIDTH):
        X = sp.Placement(_matrix(row, ROTATION, b), _vector(row, TRANSLATION, b))
        inertia = _inertia(row, P, b)
        results, plus = evaluation.inward_joint(
            direction,
            armature,
            row[RATE * WIDTH + b],
            row[EFFORT * WIDTH + b],
            _motion(row, V, b),
            _vector(row, ACCELERATION, b),
            inertia,
            _inertia(row, P_RATE, b),
            _force(row, Y, b),
            _force(row, Z, b),
        )
        scale = joints.inertia_scale(row[(MAGNITUDE + part) * WIDTH + b], row[(TOTAL + part) * WIDTH + b])
        singular += 1 if joints.is_singular(scale, results[D]) else 0
        _set_results(row, b, results)
        total = (row[TOTAL * WIDTH + b], row[(TOTAL + 1) * WIDTH + b])
        scales = joints.scales_to_parent(X, inertia, total)
        _set_inertia(row, TO_PARENT, b, sp.inertia_to_parent(X, plus[0]))
        _set_inertia(row, TO_PARENT_RATE, b, sp.inertia_to_parent(X, plus[1]))
        _set_pair(row, TO_PARENT_Y, b, sp.force_to_parent(X, plus[2]))
        _set_pair(row, TO_PARENT_Z, b, sp.force_to_parent(X, plus[3]))
        _set_vector(row, TO_PARENT_SCALE, b, (scales[0], scales[1], scales[2]))
        row[(TO_PARENT_SCALE + 3) * WIDTH + b] = scales[3]
    if body.parent > 0:
        for k in range(ACCUMULATED * WIDTH):
            parent[P * WIDTH + k] += row[TO_PARENT * WIDTH + k]
    return singular


# --- Steps state by state, at joints of several degrees of freedom and groups ---


@kernel
def _load(at, i, b):
    """Copy the record of a body from its row."""
    record, row = at.records[i], at.rows[i]
    for f in range(N_SWEPT):
        record[f] = row[f * WIDTH + b]
    at.work[i].armature = at.bodies[i].armature


@kernel
def _store(at, i, b):
    """Copy the record of a body to its row."""
    record, row = at.records[i], at.rows[i]
    for f in range(N_SWEPT):
        row[f * WIDTH + b] = record[f]


@kernel
def _first_used(bodies, last):
    """First body of a group whose row the evaluation reads: of a joint that the world carries, the last one alone."""
    return last if evaluation.is_base(bodies, last) else bodies[last].first


@large_kernel
def _outward_several(at, i, used, Q, QD, first, last):
    """As evaluation.outward_step, at all bodies of a joint; the rows from that of the body `used` on are written."""
    end = i + at.bodies[i].dofs
    for b in range(WIDTH):
        t = min(first + b, last - 1)
        if at.bodies[i].parent > 0:
            _load(at, at.bodies[i].parent, b)
        for j in range(i, end):
            evaluation.outward_step(at.bodies, j, Q[t], QD[min(t, len(QD) - 1)], at.work)
            if j >= used:
                _store(at, j, b)


@large_kernel
def _inward_group(at, i, QD, TAU, first, last):
    """As evaluation.inward_group."""
    start, carrier, out = at.bodies[i].first, at.bodies[at.bodies[i].first].parent, at.out
    used = _first_used(at.bodies, i)
    for j in range(start, used):
        at.work[j].armature = at.bodies[j].armature
    for b in range(WIDTH):
        t = min(first + b, last - 1)
        if carrier > 0:
            _load(at, carrier, b)
        for j in range(used, i + 1):
            _load(at, j, b)
        status = evaluation.inward_group(at.bodies, i, QD[t], TAU[min(t, len(TAU) - 1)], at.work, at.table, out)
        if status != 0:
            return 1
        if carrier > 0:
            _store(at, carrier, b)
        for j in range(start, i + 1):
            if groups.is_leader(at.bodies, j):
                for k in range(N_RESULTS):
                    at.rows[j, (OUTPUT + k) * WIDTH + b] = out[k, at.bodies[j].dof]
    return 0


# --- The evaluation ---


@kernel
def _outward(at, every_row, Q, QD, TAU, first, last):
    bodies, world = at.bodies, at.rows[0]
    evaluation.start_at_world(at.gravity, at.work[0])
    for b in range(WIDTH):
        _set_pair(world, V, b, sp.NO_MOTION)
        _set_vector(world, ACCELERATION, b, sp.scale(records.vector_of(at.gravity), -1.0))
    for i in range(1, len(bodies)):
        body, row, parent = bodies[i], at.rows[i], at.rows[bodies[i].parent]
        if body.dofs > 1:
            if body.rank == 0:
                used = i if every_row else _first_used(bodies, i + body.dofs - 1)
                _outward_several(at, i, used, Q, QD, first, last)
            continue
        _read_joint(body, row, Q, QD, TAU, first, last)
        if body.direction == sp.ANGULAR_Z:
            _outward_joint(sp.ANGULAR_Z, body, row, parent)
        else:
            _outward_joint(sp.LINEAR_Z, body, row, parent)


@kernel
def _are_valid(at, Q, QD, TAU, first, last):
    """Whether arguments are finite and orientations near unit length."""
    for t in range(first, last):
        if not (joints.are_positions(at.bodies, Q[t]) and joints.are_finite(QD[min(t, len(QD) - 1)])):
            return False
        if not joints.are_finite(TAU[min(t, len(TAU) - 1)]):
            return False
    return True


@kernel
def _inward(at, QD, TAU, first, last):
    """Results of all joints; returns whether a state is singular."""
    bodies, i = at.bodies, len(at.bodies) - 1
    while i > 0:
        body, row, parent = bodies[i], at.rows[i], at.rows[bodies[i].parent]
        if groups.is_grouped(body):
            singular = _inward_group(at, i, QD, TAU, first, last)
        elif body.direction == sp.ANGULAR_Z:
            singular = _inward_joint(sp.ANGULAR_Z, body, row, parent)
        else:
            singular = _inward_joint(sp.LINEAR_Z, body, row, parent)
        if singular > 0:
            return True
        i = body.first - 1
    return False


@kernel
def _write(at, first, last, results, numbers):
    """Write results and numbers of states; returns whether all are finite."""
    wrong = 0
    for t in range(first, last):
        for j in range(N_NUMBERS):
            numbers[j, t] = 0.0
    for i in range(1, len(at.bodies)):
        if groups.is_leader(at.bodies, i):
            row, k = at.rows[i], at.bodies[i].dof
            for t in range(first, last):
                total = 0.0
                for j in range(N_RESULTS):
                    result = row[(OUTPUT + j) * WIDTH + t - first]
                    results[j, t, k] = result
                    total += result if j != NU else 0.0
                nu = results[NU, t, k]
                share = 0.5 * nu * nu
                numbers[K, t] += share
                numbers[BASE, t] += share if k < 6 else 0.0
                numbers[POWER, t] += nu * (results[EPSILON, t, k] - results[GRAVITY, t, k])
                wrong += 0 if math.isfinite(total) else 1
    for t in range(first, last):
        numbers[NET_POWER, t] = numbers[POWER, t]
        wrong += 0 if math.isfinite(numbers[K, t]) and math.isfinite(numbers[POWER, t]) else 1
    return wrong == 0


@entry_kernel(ROBOT, *[MATRIX] * 3, COUNT, COUNT, FILLED_STATES, *[FILLED_MATRIX] * 3, nogil=True)
def evaluate_many(robot, Q, QD, TAU, begin, end, results, numbers, positions, rates):
    """What evaluation.evaluate gives at states `begin` to `end` of many, a row of Q, QD and TAU each.

    The robot is that of a BatchWorkspace. Without efforts TAU has one row, of zeros. `results`, of shape (N_RESULTS, T, nv),
    receives the rows from NU on, `numbers`, (N_NUMBERS, T), those from KINETIC_ENERGY on, `positions` and `rates` copies of
    Q and QD. The states that fail are some of the :data:`WIDTH` that follow.
    """
    at = batch_of(robot)
    for first in range(begin, end, WIDTH):
        last = min(first + WIDTH, end)
        if not _are_valid(at, Q, QD, TAU, first, last):
            return first
        for t in range(first, last):
            copy(Q[t], positions[t])
            copy(QD[t], rates[t])
        _outward(at, False, Q, QD, TAU, first, last)
        if _inward(at, QD, TAU, first, last) or not _write(at, first, last, results, numbers):
            return first
    return end


# --- Working moments ---


@kernel
def _inward_moment(direction, body, row, parent):
    """ε of a joint, P⁺ and z⁺ as factorization.factor_joint and kappa_from_tau; returns how many states are singular."""
    armature, part, singular = body.armature, 0 if direction < sp.ANGULAR_X else 1, 0
    for b in range(WIDTH):
        X = sp.Placement(_matrix(row, ROTATION, b), _vector(row, TRANSLATION, b))
        inertia, z = _inertia(row, P, b), _force(row, Z, b)
        joint_inertia, column, G = joints.joint_inertia(direction, armature, inertia)
        scale = joints.inertia_scale(row[(MAGNITUDE + part) * WIDTH + b], row[(TOTAL + part) * WIDTH + b])
        singular += 1 if joints.is_singular(scale, joint_inertia) else 0
        kappa = row[EFFORT * WIDTH + b] - sp.along(direction, z)
        row[OUTPUT * WIDTH + b] = kappa / math.sqrt(joint_inertia)
        total = (row[TOTAL * WIDTH + b], row[(TOTAL + 1) * WIDTH + b])
        scales = joints.scales_to_parent(X, inertia, total)
        z_plus = sp.add_force(z, sp.scale_force(G, kappa))
        _set_inertia(row, TO_PARENT, b, sp.inertia_to_parent(X, sp.less_rank_one(inertia, G, column)))
        _set_pair(row, TO_PARENT_Z, b, sp.force_to_parent(X, z_plus))
        _set_vector(row, TO_PARENT_SCALE, b, (scales[0], scales[1], scales[2]))
        row[(TO_PARENT_SCALE + 3) * WIDTH + b] = scales[3]
    if body.parent > 0:
        for k in range((P_RATE - P) * WIDTH):
            parent[P * WIDTH + k] += row[TO_PARENT * WIDTH + k]
        for k in range((N_SWEPT - Z) * WIDTH):
            parent[Z * WIDTH + k] += row[TO_PARENT_Z * WIDTH + k]
    return singular


@large_kernel
def _inward_moments_of_group(at, i, TAU, first, last):
    """The same of a group, state by state."""
    bodies, work, Q, kappa, start = at.bodies, at.work, at.table[0], at.out[0], at.bodies[i].first
    carrier = bodies[start].parent
    for b in range(WIDTH):
        t = min(first + b, last - 1)
        _load(at, carrier, b)
        for j in range(start, i + 1):
            _load(at, j, b)
            kappa[bodies[j].dof] = TAU[min(t, len(TAU) - 1), bodies[j].dof]
        if factorization.factor_group(bodies, i, work, Q, False) != 0:
            return 1
        z = groups.gather(bodies, start, i, work, work.z, -1.0, kappa)
        z = sp.add_force(z, groups.filter_moments(bodies, start, i, work, Q, kappa))
        if carrier > 0:
            records.add_to_force(work[carrier].z, z)
            _store(at, carrier, b)
        for j in range(start, i + 1):
            if groups.is_leader(bodies, j):
                at.rows[j, OUTPUT * WIDTH + b] = kappa[bodies[j].dof] / math.sqrt(work[j].D)
    return 0


@large_kernel
def _working_moments(at, Q, TAU, first, last, results):
    """ε = ℓτ of states side by side; returns whether there is one that fails."""
    if not _are_valid(at, Q, TAU, TAU, first, last):
        return True
    _outward(at, True, Q, at.no_rates, TAU, first, last)
    i, wrong = len(at.bodies) - 1, 0
    while i > 0:
        body, row, parent = at.bodies[i], at.rows[i], at.rows[at.bodies[i].parent]
        if groups.is_grouped(body):
            singular = _inward_moments_of_group(at, i, TAU, first, last)
        elif body.direction == sp.ANGULAR_Z:
            singular = _inward_moment(sp.ANGULAR_Z, body, row, parent)
        else:
            singular = _inward_moment(sp.LINEAR_Z, body, row, parent)
        if singular > 0:
            return True
        i = body.first - 1
    for i in range(1, len(at.bodies)):
        if groups.is_leader(at.bodies, i):
            for t in range(first, last):
                epsilon = at.rows[i, OUTPUT * WIDTH + t - first]
                results[t, at.bodies[i].dof] = epsilon
                wrong += 0 if math.isfinite(epsilon) else 1
    return wrong > 0


@large_kernel
def _working_moments_each(robot, Q, TAU, begin, end, results):
    at = batch_of(robot)
    for first in range(begin, end, WIDTH):
        last = min(first + WIDTH, end)
        if _working_moments(at, Q, TAU, first, last, results):
            for t in range(first, last):
                tau = TAU[min(t, len(TAU) - 1)]
                if factorization.epsilon_from_tau(robot, Q[t], tau, results[t]) != 0:
                    return t
    return end


# --- Other sweeps ---

FORWARD, INVERSE, NU_FROM_QD, QD_FROM_NU, EPSILON_FROM_TAU, TAU_FROM_EPSILON = range(6)
"""Sweeps of :func:`sweep_each`."""


@entry_kernel(ROBOT, COUNT, *[MATRIX] * 3, NUMBER, COUNT, COUNT, FILLED_MATRIX, nogil=True)
def sweep_each(robot, which, Q, A, B, weight, begin, end, results):
    """One of these sweeps at states `begin` to `end`, a row of Q, A, B and `results` each; A and B may have one for all."""
    if which == EPSILON_FROM_TAU:
        return _working_moments_each(robot, Q, A, begin, end, results)
    for t in range(begin, end):
        q, a, b, result = Q[t], A[min(t, len(A) - 1)], B[min(t, len(B) - 1)], results[t]
        if which == FORWARD:
            status = classical.forward_dynamics(robot, q, a, b, result)
        elif which == INVERSE:
            status = classical.inverse_dynamics(robot, q, a, b, weight, result)
        elif which == NU_FROM_QD:
            status = factorization.nu_from_qd(robot, q, a, result)
        elif which == QD_FROM_NU:
            status = factorization.qd_from_nu(robot, q, a, result)
        else:
            status = factorization.tau_from_epsilon(robot, q, a, result)
        if status != 0:
            return t
    return end


@entry_kernel(ROBOT, MATRIX, COUNT, COUNT, FILLED_STATES, nogil=True)
def mass_matrix_each(robot, Q, begin, end, M):
    """M at states `begin` to `end`."""
    for t in range(begin, end):
        if classical.mass_matrix(robot, Q[t], M[t]) != 0:
            return t
    return end


@entry_kernel(ROBOT, MATRIX, records.WRENCHES, COUNT, FLAG, COUNT, COUNT, FILLED_MATRIX, nogil=True)
def effort_of_wrenches_each(robot, Q, wrenches, count, in_world, begin, end, results):
    """Jᵀf at states `begin` to `end`, each with `count` wrenches."""
    for t in range(begin, end):
        own = wrenches[t * count : (t + 1) * count]
        if classical.effort_of_wrenches(robot, Q[t], own, in_world, results[t]) != 0:
            return t
    return end
