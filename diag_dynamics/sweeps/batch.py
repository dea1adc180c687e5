# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sweeps over many states: evaluation of WIDTH states side by side, other sweeps state by state.

Each body has a row of memory, records.LANES, in which the numbers of WIDTH states are next to each
other. The loop over the states in a step reads and writes the row of its body alone, at distances
that the compiler knows: LLVM makes vector instructions of it. Loops of their own copy the parent's
motion and add to its inertias and forces. The steps are those of one state, and no operation is
reordered: results have the bits of single calls, except those of closed loops, whose closing starts
at the last state. Groups are eliminated state by state.

Each entry returns `end`, or the first of WIDTH states of which at least one failed: results end
there.
"""

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.sweeps import (
    classical,
    evaluation,
    factorization,
    groups,
    joints,
    records,
    regressors,
)
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws
from diag_dynamics.sweeps.records import N_RESULTS, WIDTH, lane_of

K, BASE, POWER = range(ws.N_NUMBERS)
"""Numbers of a state: workspace.KINETIC_ENERGY and those that follow."""

PARENT, RESULTS = (records.LANES.fields[name][1] // 8 for name in ("parent", "results"))
V, P = (records.LANES["own"].fields[name][1] // 8 for name in ("V", "P"))
"""First numbers of fields in a row."""


@nk.kernel
def _copy_parent(at, i):
    """Copy the parent's motion to the row of a body, and clear its contributions to the parent."""
    row = at.rows[i]
    parent = at.rows[at.bodies[i].parent]
    # V and a of WIDTH states; P, Ṗ, y, z and the sizes of P are sums, and begin at zero
    for k in range(V, P):
        row[PARENT + k] = parent[k]
    for k in range(P, PARENT):
        row[PARENT + k] = 0.0


@nk.kernel
def _accumulate(at, i):
    """Add a body's contributions to its parent."""
    row = at.rows[i]
    parent = at.rows[at.bodies[i].parent]
    # P, Ṗ, y, z and the sizes of P; the world cannot move and needs none
    if at.bodies[i].parent > 0:
        for k in range(P, PARENT):
            parent[k] += row[PARENT + k]


# --- A joint of one degree of freedom ---


@nk.kernel
def _read_joint(at, i, Q, QD, TAU, first, last):
    """Position, rate and effort at states `first` to `last`; the last state fills up the row."""
    body = at.bodies[i]
    row = at.lanes[i]
    for b in range(WIDTH):
        # At the end fewer than WIDTH states may be left: _write skips the lanes of copies
        t = min(first + b, last - 1)
        position = body.multiplier * Q[t, body.q] + body.offset
        row.position[0, b] = (
            position if body.kind == records.PRISMATIC else sp.reduced_angle(position)
        )
        row.rate[0, b] = body.multiplier * QD[t, body.dof]
        # Without efforts TAU has one row of zeros for all states
        row.effort[0, b] = TAU[min(t, len(TAU) - 1), body.dof]


@nk.kernel
def _outward_joint(direction, at, i):
    _copy_parent(at, i)
    body = records.values_of(at.bodies[i])
    row = at.lanes[i]
    for b in range(WIDTH):
        X = joints.placement(direction, body, row.position[0, b])
        rate = row.rate[0, b]
        motion = sp.motion_along(direction, rate)
        evaluation.outward_joint(body, X, motion, lane_of(row.own, b), lane_of(row.parent, b))


@nk.kernel
def _inward_joint(direction, at, i):
    """The inward step; returns the number of singular states."""
    body = records.values_of(at.bodies[i])
    row = at.lanes[i]
    count = 0
    for b in range(WIDTH):
        w = lane_of(row.own, b)
        parent = lane_of(row.parent, b)
        # D and G of Algorithm 4.1; contributions of a body on the world are left to _accumulate
        D, _, G = joints.joint_inertia(direction, body.armature, records.inertia_of(w.P))
        rate = row.rate[0, b]
        effort = row.effort[0, b]
        results, singular = evaluation.inward_joint(direction, D, G, rate, effort, w, parent, True)
        evaluation.set_results(row.results[:, b], results)
        # A singular state is counted: to leave the loop early would prevent vector instructions
        count += 1 if singular else 0
    _accumulate(at, i)
    return count


# --- A floating base: its six degrees of freedom are in the row of its last body ---


@nk.kernel
def _read_base(at, i, Q, QD, TAU, first, last):
    body = at.bodies[i]
    row = at.lanes[at.bodies[i].last]
    for b in range(WIDTH):
        # x, y, z and a quaternion; six rates and efforts, linear ones first
        t = min(first + b, last - 1)
        for k in range(7):
            row.position[k, b] = Q[t, body.q + k]
        for k in range(6):
            row.rate[k, b] = QD[t, body.dof + k]
            row.effort[k, b] = TAU[min(t, len(TAU) - 1), body.dof + k]


@nk.kernel
def _outward_base(at, i):
    last = at.bodies[i].last
    # V and a of the world; nothing is added to it inward, so that there is nothing to clear
    for k in range(V, P):
        at.rows[last, PARENT + k] = at.rows[0, k]
    # The first body has the joint's constant placement, the last one its inertia
    base = records.values_of(at.bodies[i])
    body = records.values_of(at.bodies[last])
    row = at.lanes[last]
    for b in range(WIDTH):
        position = row.position[:, b]
        motion = records.motion_of(row.rate[:, b])
        # X is the constant placement, then the joint's displacement; S = 1, so that v_J = q̇
        R = sp.rotation_of_quaternion(position[3], position[4], position[5], position[6])
        X = sp.compose_placements(
            records.placement_of(base), sp.Placement(R, records.vector_of(position))
        )
        evaluation.outward_joint(body, X, motion, lane_of(row.own, b), lane_of(row.parent, b))


@nk.kernel
def _inward_base(at, i):
    """The inward step; returns the number of singular directions of all states."""
    row = at.lanes[i]
    count = 0
    # κ = τ − z and κ_g = P a of all six directions, which are eliminated one by one, the last first
    for b in range(WIDTH):
        effort = records.force_of(row.effort[:, b])
        evaluation.start_base(effort, lane_of(row.own, b))
    for j in range(i, at.bodies[i].first - 1, -1):
        direction = at.bodies[j].direction
        armature = at.bodies[j].armature
        for b in range(WIDTH):
            results, singular = evaluation.eliminate_last(direction, armature, lane_of(row.own, b))
            # The base adds nothing to the world, so that its contribution to P has free memory
            # The loop over states writes to this row alone; then results go to their body's row
            evaluation.set_results(row.parent.P[:, b], results)
            count += 1 if singular else 0
        for k in range(N_RESULTS * WIDTH):
            at.rows[j, RESULTS + k] = at.rows[i, PARENT + P + k]
    return count


# --- Groups and other joints of several degrees of freedom, state by state ---


@nk.kernel
def _load(at, i, b):
    """Copy the record of a body from its row."""
    record = at.numbers[i]
    row = at.rows[i]
    # A record begins with the fields of a row, in the same order
    for k in range(PARENT // WIDTH):
        record[k] = row[k * WIDTH + b]
    # Armature is in no row, and qd_from_momentum adds to it
    at.work[i].armature = at.bodies[i].armature


@nk.kernel
def _store(at, i, b):
    """Copy the record of a body to its row."""
    record = at.numbers[i]
    row = at.rows[i]
    for k in range(PARENT // WIDTH):
        row[k * WIDTH + b] = record[k]


@nk.large_kernel
def _outward_several(at, i, Q, QD, first, last):
    """As evaluation.outward_step, at all bodies of a joint."""
    for b in range(WIDTH):
        t = min(first + b, last - 1)
        # V and a of the parent; the record of the world has them already
        if at.bodies[i].parent > 0:
            _load(at, at.bodies[i].parent, b)
        for j in range(i, i + at.bodies[i].dofs):
            evaluation.outward_step(at.bodies, j, Q[t], QD[t], at.work)
            _store(at, j, b)


@nk.large_kernel
def _inward_group(robot, i, QD, TAU, first, last):
    """As evaluation.inward_group."""
    at = ws.robot_of(robot)
    start = at.bodies[i].first
    out = at.scratch
    base = at.bodies[start].parent
    for b in range(WIDTH):
        t = min(first + b, last - 1)
        # The base and all bodies of the group, to which children further out have been added
        _load(at, base, b)
        for j in range(start, i + 1):
            _load(at, j, b)
        tau = TAU[min(t, len(TAU) - 1)]
        if evaluation.inward_group(robot, i, QD[t], tau, out) != 0:
            return 1
        # P⁺, Ṗ⁺, y⁺ and z⁺ of the group have been added to the base
        if base > 0:
            _store(at, base, b)
        for j in range(start, i + 1):
            if groups.is_leader(at.bodies, j):
                for k in range(N_RESULTS):
                    at.lanes[j].results[k, b] = out[k, at.bodies[j].dof]
    return 0


# --- Evaluation ---


@nk.kernel
def _are_valid(at, Q, QD, TAU, first, last):
    """Whether arguments are finite and orientations near unit length."""
    for t in range(first, last):
        if not (joints.are_positions(at.bodies, Q[t]) and joints.are_finite(QD[t])):
            return False
        if not joints.are_finite(TAU[min(t, len(TAU) - 1)]):
            return False
    return True


@nk.kernel
def _outward(at, Q, QD, TAU, first, last):
    bodies = at.bodies
    # The world, in the record of one state and in all lanes
    world = at.lanes[0]
    evaluation.start_at_world(at.gravity, at.work[0])
    for b in range(WIDTH):
        evaluation.start_at_world(at.gravity, lane_of(world.own, b))
    for i in range(1, len(bodies)):
        # From the base to the tips; the first body of a joint (rank 0) stands for all of them
        if bodies[i].dofs == 1:
            _read_joint(at, i, Q, QD, TAU, first, last)
            if bodies[i].direction == sp.ANGULAR_Z:
                _outward_joint(sp.ANGULAR_Z, at, i)
            else:
                _outward_joint(sp.LINEAR_Z, at, i)
        elif bodies[i].rank == 0 and evaluation.is_floating_base(bodies, i):
            _read_base(at, i, Q, QD, TAU, first, last)
            _outward_base(at, i)
        elif bodies[i].rank == 0:
            _outward_several(at, i, Q, QD, first, last)


@nk.kernel
def _inward(robot, QD, TAU, first, last):
    """Results of all joints; returns whether a state is singular."""
    at = ws.robot_of(robot)
    bodies = at.bodies
    # From the tips to the base, until a step has a singular state
    i = len(at.bodies) - 1
    singular = 0
    while i > 0 and singular == 0:
        if groups.is_grouped(bodies[i]):
            is_base = evaluation.is_floating_base(bodies, i)
            singular = (
                _inward_base(at, i) if is_base else _inward_group(robot, i, QD, TAU, first, last)
            )
        elif bodies[i].direction == sp.ANGULAR_Z:
            singular = _inward_joint(sp.ANGULAR_Z, at, i)
        else:
            singular = _inward_joint(sp.LINEAR_Z, at, i)
        i = bodies[i].first - 1
    return singular > 0


@nk.kernel
def _write(at, first, last, results, numbers):
    """Write results and numbers of states; returns whether all are finite."""
    for t in range(first, last):
        for i in range(1, len(at.bodies)):
            if groups.is_leader(at.bodies, i):
                # State t is in lane t − first of the row
                for j in range(N_RESULTS):
                    results[j, t, at.bodies[i].dof] = at.lanes[i].results[j, t - first]
        finite, energy, base, power = evaluation.sums(results[:, t])
        numbers[K, t] = energy
        numbers[BASE, t] = base
        numbers[POWER, t] = power
        if not finite:
            return False
    return True


@nk.large_kernel
def _evaluate_each(robot, Q, QD, TAU, begin, end, results, numbers, positions, rates):
    """As :func:`evaluate_many`, state by state: ratios that change are of one state."""
    out = ws.robot_of(robot).scratch
    for t in range(begin, end):
        if evaluation.sweep_state(robot, Q[t], QD[t], TAU[min(t, len(TAU) - 1)], out) != 0:
            # First of the WIDTH states that evaluate_many would sweep together with t
            return begin + (t - begin) // WIDTH * WIDTH
        for j in range(N_RESULTS):
            ws.copy(out[j], results[j, t])
        for j in range(ws.N_NUMBERS):
            numbers[j, t] = out[ws.KINETIC_ENERGY + j, 0]
        ws.copy(Q[t], positions[t])
        ws.copy(QD[t], rates[t])
    return end


@nk.entry_kernel(
    nk.ROBOT,
    *[nk.MATRIX] * 3,
    nk.COUNT,
    nk.COUNT,
    nk.FILLED_STATES,
    *[nk.FILLED_MATRIX] * 3,
    nogil=True,
)
def evaluate_many(robot, Q, QD, TAU, begin, end, results, numbers, positions, rates):
    """Results of evaluation.evaluate at states `begin` to `end`, a row of Q, QD and TAU each.

    Without efforts TAU has one row, of zeros. `results`, of shape (N_RESULTS, T, nv), receives the
    rows from NU on, `numbers`, (N_NUMBERS, T), those from KINETIC_ENERGY on, `positions` and
    `rates` copies of Q and QD. The states that fail are some of the WIDTH that follow.
    """
    at = ws.robot_of(robot)
    # The workspace has ratios that change for one state only
    if at.work[0].couple != 0:
        return _evaluate_each(robot, Q, QD, TAU, begin, end, results, numbers, positions, rates)
    for first in range(begin, end, WIDTH):
        last = min(first + WIDTH, end)
        if not _are_valid(at, Q, QD, TAU, first, last):
            return first
        # Positions and rates of the results, then outward, inward, and the other results
        for t in range(first, last):
            ws.copy(Q[t], positions[t])
            ws.copy(QD[t], rates[t])
        _outward(at, Q, QD, TAU, first, last)
        if _inward(robot, QD, TAU, first, last) or not _write(at, first, last, results, numbers):
            return first
    return end


# --- Other sweeps ---

FORWARD, INVERSE, TRANSFORM, MOMENTUM, FIRST_MOMENT = range(5)
"""Sweeps of :func:`sweep_each`."""


@nk.entry_kernel(
    nk.ROBOT,
    nk.COUNT,
    *[nk.MATRIX] * 3,
    nk.NUMBER,
    nk.COUNT,
    nk.COUNT,
    nk.FILLED_MATRIX,
    nogil=True,
)
def sweep_each(robot, which, Q, A, B, option, begin, end, results):
    """Run a sweep at states `begin` to `end`, a row of Q, A, B and `results` each.

    A and B may have one row for all states. The option is the weight of gravity in inverse
    dynamics, and the number of a transformation.
    """
    for t in range(begin, end):
        q = Q[t]
        a = A[min(t, len(A) - 1)]
        b = B[min(t, len(B) - 1)]
        result = results[t]
        if which == FORWARD:
            status = classical.forward_dynamics(robot, q, a, b, result)
        elif which == INVERSE:
            status = classical.inverse_dynamics(robot, q, a, b, option, result)
        elif which == TRANSFORM:
            status = factorization.transform(robot, q, a, option, result)
        elif which == MOMENTUM:
            status = classical.momentum(robot, q, a, result)
        else:
            status = classical.first_moment(robot, q, result)
        if status != 0:
            return t
    return end


@nk.entry_kernel(
    nk.ROBOT, nk.MATRIX, nk.COUNT, nk.COUNT, nk.FILLED_STATES, nk.FILLED_MATRIX, nogil=True
)
def factors_each(robot, Q, begin, end, factors, D):
    """Fill m, ℓ and the unit factor of states `begin` to `end`, one after another."""
    for t in range(begin, end):
        # m, ℓ and unit factor of a state are next to each other
        if factorization.factors(robot, Q[t], factors[3 * t : 3 * t + 3], D[t]) != 0:
            return t
    return end


@nk.entry_kernel(
    nk.ROBOT,
    *[nk.MATRIX] * 3,
    regressors.FRAMES,
    nk.COUNT,
    nk.COUNT,
    nk.FILLED_STATES,
    nogil=True,
)
def regressor_each(robot, Q, QD, QDD, frames, begin, end, Y):
    """Fill the regressors of states `begin` to `end`."""
    for t in range(begin, end):
        if regressors.regressor(robot, Q[t], QD[t], QDD[t], frames, Y[t]) != 0:
            return t
    return end


@nk.entry_kernel(nk.ROBOT, nk.MATRIX, nk.COUNT, nk.COUNT, nk.FILLED_STATES, nogil=True)
def mass_matrix_each(robot, Q, begin, end, M):
    """M at states `begin` to `end`."""
    for t in range(begin, end):
        if classical.mass_matrix(robot, Q[t], M[t]) != 0:
            return t
    return end


@nk.entry_kernel(
    nk.ROBOT,
    nk.MATRIX,
    records.WRENCHES,
    nk.COUNT,
    nk.FLAG,
    nk.COUNT,
    nk.COUNT,
    nk.FILLED_MATRIX,
    nogil=True,
)
def effort_of_wrenches_each(robot, Q, wrenches, count, in_world, begin, end, results):
    """Jᵀf at states `begin` to `end`, each with `count` wrenches."""
    for t in range(begin, end):
        # Wrenches of one state are next to each other
        own = wrenches[t * count : (t + 1) * count]
        if classical.effort_of_wrenches(robot, Q[t], own, in_world, results[t]) != 0:
            return t
    return end
