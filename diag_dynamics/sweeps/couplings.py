# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints whose rates depend on others by ratios that change with the state: closed loops and non-linear mimic joints.

A follower's rate is Σ G q̇ over independent joints. It is a body for each of them, all along the same axis in one frame:
the workspace has the body's own entry of G as `multiplier`, its rate Ġ as `multiplier_rate`, and the follower's position
as `offset`. These three are all that other sweeps know of a coupling.

A loop is cut. It is closed where φ = 0: pairs of points, one on each side of the cut, that coincide. One pair is a ball
joint, two are a revolute joint, three a weld. With J = ∂φ/∂q over all joints of the group, independent ones r, followers d,

    J_d G + J_r = 0        J_d Ġ + J̇_d G + J̇_r = 0        J̇ along the actual q̇

Positions of followers are found by Newton's method, from the last state if it is near, and otherwise along the straight
line from the start values, which choose the branch. There are usually more equations than followers, as some of a planar
loop are redundant: they are solved by least squares, J_d = QR with Householder reflections.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.numerics.callback import Callback
from diag_dynamics.numerics.tables import Addresses, Table, array, array_at
from diag_dynamics.sweeps import joints, records
from diag_dynamics.sweeps import spatial as sp

LOOP = np.dtype(
    [
        ("first", "i8"),  # bodies of the group
        ("last", "i8"),
        ("begin", "i8"),  # closures
        ("end", "i8"),
        ("rows", "i8"),  # equations
        ("followers", "i8"),
    ],
    align=True,
)
"""A group that is closed by equations."""

CLOSURE = np.dtype(
    [
        ("a", "i8"),  # bodies that meet, of the group or its carrier
        ("b", "i8"),
        ("point_a", "f8", 3),
        ("point_b", "f8", 3),
    ],
    align=True,
)
"""Two points that coincide, each in the frame of its body."""

CURVE = np.dtype(
    [
        ("loop", "i8"),  # the loop of which it is an equation, or -1
        ("body", "i8"),  # first body of the follower
        ("source", "i8"),  # first body of the joint that it follows
        ("begin", "i8"),  # pieces
        ("end", "i8"),
        ("argument", "f8", 2),  # factor and offset of the source's position
        ("result", "f8", 2),
    ],
    align=True,
)
"""A position that is a piecewise polynomial of another one."""

COUPLINGS = Table(
    "Couplings",
    bodies=array(records.BODY),
    work=array(records.WORK),
    nq=int,
    nv=int,
    loops=array(LOOP),
    closures=array(CLOSURE),
    curves=array(CURVE),
    pieces=array(float, 2),  # where each begins, and coefficients of the distance from there, the constant first
    start=array(float),  # position of the single joint of each body: at the start, at the last state, and now
    last=array(float),
    position=array(float),
    ratio=array(float),  # of each loop: smallest diagonal entry of R by the longest column of J
    J=array(float, 2),  # ∂φ/∂q and its rate, a row for each body
    J_rate=array(float, 2),
    reduced=array(float, 2),  # QR of J_d, a row for each follower from a loop's first body on
    diagonal=array(float),
    x=array(float),  # an error of φ, then a solution
    frames=array(float, 2),  # of each body in the axes of the carrier: R, p, ṗ, ω
)

_opened = COUPLINGS.opened
_vector_at = array_at(types.float64, 1)

NEAR = 0.5
"""Distance of the last state [rad, m] up to which followers are found from there."""

LARGEST_CORRECTION = 0.25
"""Correction of a follower [rad, m] above which a step toward the state is halved: it might change the branch."""

SMALLEST_STEP = 1e-4
"""Fraction of the remaining way below which a loop counts as one that cannot be closed."""

FINE = 1e-9
"""Correction [rad, m] after which Newton's method has converged: the next one is its square."""

CLOSED = 1e-6
"""Largest distance between the two points of a closure [m]; loops of descriptions are closed to their last digit."""

NEARLY_SINGULAR, SINGULAR = 1e-6, 1e-10
"""Ratio of a loop below which to warn, and to refuse."""

OPEN_LOOP, SINGULAR_LOOP = -1000, -2000
"""Statuses of a loop that cannot be closed or is singular, less the number of the loop."""

ITERATIONS = 15


class Couplings:
    """Loops and curves of a robot as the kernels of a workspace take them, and memory for them.

    `ratio` is that of each loop: see :data:`COUPLINGS`. `work` of the workspace gets the addresses of table and code.
    """

    def __init__(self, bodies, work, nq, nv, of_model):
        count, rows = len(bodies), int(of_model.loops["rows"].max(initial=1))
        self.ratio = np.full(len(of_model.loops), np.inf)
        self._addresses = Addresses(
            COUPLINGS,
            bodies=bodies,
            work=work,
            nq=nq,
            nv=nv,
            **of_model._asdict(),
            last=np.full(count, np.nan),
            position=np.zeros(count),
            ratio=self.ratio,
            J=np.zeros((count, rows)),
            J_rate=np.zeros((count, rows)),
            reduced=np.zeros((count, rows)),
            diagonal=np.zeros(count),
            x=np.zeros(max(rows, count)),
            frames=np.zeros((count, 18)),
        )
        work[0]["couplings"], work[0]["couple"] = self._addresses.at, couple.address


class CouplingTables(NamedTuple):
    """Arrays of the records of a model's couplings: see :data:`COUPLINGS`."""

    loops: Any
    closures: Any
    curves: Any
    pieces: Any
    start: Any


# --- Least squares ------------------------------------------------------------------------------------------


@nk.kernel
def _reflect(v, begin, rows, x):
    """Apply the reflection x − v vᵀx; v begins at an entry."""
    total = 0.0
    for row in range(begin, rows):
        total += v[row] * x[row]
    for row in range(begin, rows):
        x[row] -= total * v[row]


@nk.large_kernel
def _reduce(at, loop):
    """QR of J_d: reflections replace the lower triangle. Returns the smallest |R_kk| by the longest column of J."""
    A, diagonal, longest, least = at.reduced[loop.first :], at.diagonal[loop.first :], 0.0, math.inf
    for i in range(loop.first, loop.last + 1):
        square = 0.0
        for row in range(loop.rows):
            square += at.J[i, row] * at.J[i, row]
        longest = max(longest, square)
    for k in range(loop.followers):
        square = 0.0
        for row in range(k, loop.rows):
            square += A[k, row] * A[k, row]
        length, own = math.sqrt(square), A[k, k]
        least = min(least, length)
        if not length > 0.0:
            return 0.0
        diagonal[k] = -length if own > 0.0 else length
        A[k, k] -= diagonal[k]
        scale = 1.0 / math.sqrt(length * (length + abs(own)))  # vᵀv = 2
        for row in range(k, loop.rows):
            A[k, row] *= scale
        for j in range(k + 1, loop.followers):
            _reflect(A[k], k, loop.rows, A[j])
    return least / math.sqrt(longest)


@nk.large_kernel
def _solve(at, loop):
    """Solve J_d y = x by least squares; y replaces the first entries of x."""
    A, diagonal, x = at.reduced[loop.first :], at.diagonal[loop.first :], at.x
    for k in range(loop.followers):
        _reflect(A[k], k, loop.rows, x)
    for k in range(loop.followers - 1, -1, -1):
        for j in range(k + 1, loop.followers):
            x[k] -= A[j, k] * x[j]
        x[k] /= diagonal[k]


# --- Closure of a loop, in the axes of the group's carrier ----------------------------------------------------


@nk.kernel
def _is_follower(bodies, i):
    """Whether a body is the first one of a follower."""
    return bodies[i].leader != i and bodies[i].rank == 0


@nk.kernel
def _is_single(bodies, i):
    """Whether a body is the first one of a joint of one degree of freedom."""
    return bodies[i].dofs == 1 or _is_follower(bodies, i)


@nk.kernel
def _origin(frame):
    return (frame[9], frame[10], frame[11])


@nk.kernel
def _turning(frame):
    return (frame[15], frame[16], frame[17])


@nk.large_kernel
def _place(at, bodies, loop, q, work):
    """Placements of a group's bodies in their parents and in the carrier, from positions of single joints."""
    for i in range(loop.first, loop.last + 1):
        body, w, frame = bodies[i], work[i], at.frames[i]
        if _is_single(bodies, i):
            position = at.position[i]
            if body.direction == sp.ANGULAR_Z:
                records.set_placement(w, joints.placement(sp.ANGULAR_Z, body, sp.reduced_angle(position)))
            else:
                records.set_placement(w, joints.placement(sp.LINEAR_Z, body, position))
        else:
            joints.update_placement(body, q, w)
        R, p = records.matrix_of(w.rotation), records.vector_of(w.translation)
        if body.parent >= loop.first:
            carrier = at.frames[body.parent]
            turn = records.matrix_of(carrier)
            R, p = sp.product(turn, R), sp.add(_origin(carrier), sp.apply(turn, p))
        records.set_matrix(frame, R)
        records.set_vector(frame, 9, p)


@nk.kernel
def _end(at, loop, body, point):
    """An end of a closure."""
    p = records.vector_of(point)
    if body < loop.first:
        return p
    return sp.add(_origin(at.frames[body]), sp.apply(records.matrix_of(at.frames[body]), p))


@nk.kernel
def _axis(body, frame):
    """S of a body about its origin, linear part first."""
    S, R = sp.motion_along(body.direction, 1.0), records.matrix_of(frame)
    return sp.apply(R, S.linear), sp.apply(R, S.angular)


@nk.large_kernel
def _add_end(at, bodies, loop, i, end, sign, row):
    """Add the velocities that joints of unit rate give to a point of body i to three columns of J."""
    while i >= loop.first:
        if bodies[i].kind != records.VIRTUAL:
            along, about = _axis(bodies[i], at.frames[i])
            moved = sp.add(along, sp.cross(about, sp.subtract(end, _origin(at.frames[i]))))
            for k in range(3):
                at.J[i, row + k] += sign * moved[k]
        i = bodies[i].parent


@nk.large_kernel
def _close(at, bodies, number):
    """Fill J and φ, in x; return the largest distance between two points."""
    loop, row, largest = at.loops[number], 0, 0.0
    for i in range(loop.first, loop.last + 1):
        for k in range(loop.rows):
            at.J[i, k] = 0.0
    for k in range(loop.begin, loop.end):
        closure = at.closures[k]
        a, b = _end(at, loop, closure.a, closure.point_a), _end(at, loop, closure.b, closure.point_b)
        apart = sp.subtract(a, b)
        largest = max(largest, math.sqrt(sp.dot(apart, apart)))
        records.set_vector(at.x, row, apart)
        _add_end(at, bodies, loop, closure.a, a, 1.0, row)
        _add_end(at, bodies, loop, closure.b, b, -1.0, row)
        row += 3
    for k in range(len(at.curves)):
        curve = at.curves[k]
        if curve.loop == number:
            position, slope, _ = _curve_at(at, curve, at.position[curve.source])
            at.x[row] = at.position[curve.body] - position
            at.J[curve.body, row], at.J[curve.source, row] = 1.0, -slope
            row += 1
    return largest


@nk.large_kernel
def _newton(at, bodies, number, q, work):
    """Find the followers from where they are; J and its reduction are those of the result. Returns whether they are."""
    loop, before, correction = at.loops[number], math.inf, math.inf
    for _ in range(ITERATIONS):
        _place(at, bodies, loop, q, work)
        apart, count = _close(at, bodies, number), 0
        for i in range(loop.first, loop.last + 1):
            if _is_follower(bodies, i):
                for row in range(loop.rows):
                    at.reduced[loop.first + count, row] = at.J[i, row]
                count += 1
        at.ratio[number] = _reduce(at, loop)
        if correction <= FINE:
            return apart <= CLOSED and at.ratio[number] > SINGULAR
        if not at.ratio[number] > SINGULAR:
            return False
        _solve(at, loop)
        before, correction, count = correction, 0.0, 0
        for i in range(loop.first, loop.last + 1):
            if _is_follower(bodies, i):
                at.position[i] -= at.x[count]
                correction, count = max(correction, abs(at.x[count])), count + 1
        if not (correction <= LARGEST_CORRECTION and correction <= max(0.5 * before, FINE)):
            return False
    return False


@nk.large_kernel
def _set_ratios(at, bodies, loop, work):
    """G of all followers."""
    for r in range(loop.first, loop.last + 1):
        if bodies[r].leader == r:
            for row in range(loop.rows):
                at.x[row] = -at.J[r, row]
            _solve(at, loop)
            _write(at, bodies, loop, r, work, False)


@nk.kernel
def _write(at, bodies, loop, r, work, rates):
    """Write the solution of x as G or Ġ of all followers by the independent joint of body r."""
    count = 0
    for i in range(loop.first, loop.last + 1):
        if _is_follower(bodies, i):
            for j in range(i, i + bodies[i].dofs):
                if bodies[j].leader == r and rates:
                    work[j].multiplier_rate = at.x[count]
                elif bodies[j].leader == r:
                    work[j].multiplier = at.x[count]
            count += 1


@nk.large_kernel
def _approach(at, bodies, number, q, work):
    """Move a closed loop from `last` to q in as many steps as it needs; returns whether it arrives.

    Followers begin where their ratios take them, so that the branch stays where two of them meet.
    """
    loop, step = at.loops[number], 1.0
    while step > SMALLEST_STEP:
        for i in range(loop.first, loop.last + 1):
            if bodies[i].dofs == 1 and bodies[i].leader == i:
                target = q[bodies[i].q]
                at.position[i] = target if step == 1.0 else at.last[i] + step * (target - at.last[i])
        for i in range(loop.first, loop.last + 1):
            if _is_follower(bodies, i):
                at.position[i] = at.last[i]
                for j in range(i, i + bodies[i].dofs):
                    r = bodies[j].leader
                    if bodies[r].dofs == 1:
                        at.position[i] += work[j].multiplier * (at.position[r] - at.last[r])
        if _newton(at, bodies, number, q, work):
            for i in range(loop.first, loop.last + 1):
                at.last[i] = at.position[i]
            _set_ratios(at, bodies, loop, work)
            if step == 1.0:
                return True
            step = min(1.0, 2.0 * step / (1.0 - step))
        else:
            step *= 0.5
    return False


@nk.kernel
def _is_near(at, bodies, loop, q):
    """Whether the last state is known and near."""
    for i in range(loop.first, loop.last + 1):
        if bodies[i].leader == i and bodies[i].dofs == 1 and not abs(q[bodies[i].q] - at.last[i]) <= NEAR:
            return False
    return True


@nk.large_kernel
def _begin(at, bodies, number, q, work):
    """Take the start values for the last state; return whether the loop is closed there."""
    loop = at.loops[number]
    for i in range(loop.first, loop.last + 1):
        at.last[i] = at.position[i] = at.start[i]
    closed = _newton(at, bodies, number, q, work)
    if closed:
        for i in range(loop.first, loop.last + 1):
            at.last[i] = at.position[i]
        _set_ratios(at, bodies, loop, work)
    return closed


@nk.large_kernel
def _close_loop(at, bodies, number, q, work):
    """Positions of followers of a loop and their ratios; returns a status."""
    loop = at.loops[number]
    closed = _is_near(at, bodies, loop, q) and _approach(at, bodies, number, q, work)
    if not closed:
        closed = _begin(at, bodies, number, q, work) and _approach(at, bodies, number, q, work)
    if not closed:
        at.last[loop.first : loop.last + 1] = math.nan
        return (SINGULAR_LOOP if not at.ratio[number] > SINGULAR else OPEN_LOOP) - number
    for i in range(loop.first, loop.last + 1):
        if _is_follower(bodies, i):
            work[i].offset = at.position[i]
    return 0


# --- Non-linear mimic joints ----------------------------------------------------------------------------------


@nk.kernel
def _curve_at(at, curve, source):
    """Position of a curve, its slope and the rate of the slope by the source's position."""
    argument = curve.argument[0] * source + curve.argument[1]
    k = curve.begin
    while k + 1 < curve.end and argument >= at.pieces[k + 1, 0]:
        k += 1
    x, p, slope, bend = argument - at.pieces[k, 0], 0.0, 0.0, 0.0
    for j in range(at.pieces.shape[1] - 1, 0, -1):
        bend = bend * x + slope
        slope = slope * x + p
        p = p * x + at.pieces[k, j]
    scale, factor = curve.result[0], curve.argument[0]
    return scale * p + curve.result[1], scale * factor * slope, 2.0 * scale * factor * factor * bend


# --- All couplings of a robot ---------------------------------------------------------------------------------


@Callback
def couple(couplings, positions, rates, what):
    """Positions of followers and G at the positions at an address, and then, or alone, Ġ: see joints.couple."""
    at = _opened(couplings)
    status = 0
    if what != joints.RATES:
        status = _couple(at, at.bodies, _vector_at(positions, (at.nq,)), at.work)
    if what != joints.POSITIONS and status == 0:
        _couple_rates(at, at.bodies, _vector_at(rates, (at.nv,)), at.work)
    return status


@nk.large_kernel
def _couple(at, bodies, q, work):
    for k in range(len(at.curves)):
        curve = at.curves[k]
        if curve.loop < 0:
            w, position = work[curve.body], q[bodies[curve.source].q]
            at.position[curve.source] = position
            w.offset, w.multiplier, _ = _curve_at(at, curve, position)
    for number in range(len(at.loops)):
        status = _close_loop(at, bodies, number, q, work)
        if status != 0:
            return status
    return 0


@nk.large_kernel
def _couple_rates(at, bodies, qd, work):
    for k in range(len(at.curves)):
        curve = at.curves[k]
        if curve.loop < 0:
            _, _, bend = _curve_at(at, curve, at.position[curve.source])
            work[curve.body].multiplier_rate = bend * qd[bodies[curve.source].dof]
    for number in range(len(at.loops)):
        loop = at.loops[number]
        _move(at, bodies, loop, qd, work)
        _fill_rate(at, bodies, number, qd, work)
        for r in range(loop.first, loop.last + 1):
            if bodies[r].leader == r:
                _set_rate(at, bodies, loop, r, work)
                _solve(at, loop)
                _write(at, bodies, loop, r, work, True)


@nk.large_kernel
def _move(at, bodies, loop, qd, work):
    """Velocities of a group's frames against the carrier."""
    for i in range(loop.first, loop.last + 1):
        body, frame = bodies[i], at.frames[i]
        if body.rank > 0:
            for k in range(12, 18):
                frame[k] = at.frames[body.parent, k]
            continue
        v, turn = sp.ZERO, sp.ZERO
        if body.parent >= loop.first:
            carrier = at.frames[body.parent]
            turn, lever = _turning(carrier), sp.subtract(_origin(frame), _origin(carrier))
            v = sp.add((carrier[12], carrier[13], carrier[14]), sp.cross(turn, lever))
        for j in range(i, i + body.dofs):
            along, about = _axis(bodies[j], frame)
            rate = work[j].multiplier * qd[bodies[j].dof]
            v, turn = sp.add(v, sp.scale(along, rate)), sp.add(turn, sp.scale(about, rate))
        records.set_vector(frame, 12, v)
        records.set_vector(frame, 15, turn)


@nk.large_kernel
def _add_end_rate(at, bodies, loop, body, point, sign, row):
    """Add the rates of what :func:`_add_end` adds."""
    if body < loop.first:
        return
    end, last = _end(at, loop, body, point), at.frames[body]
    moved = sp.cross(_turning(last), sp.subtract(end, _origin(last)))
    velocity = sp.add((last[12], last[13], last[14]), moved)
    i = body
    while i >= loop.first:
        if bodies[i].kind != records.VIRTUAL:
            frame = at.frames[i]
            along, about = _axis(bodies[i], frame)
            turn, v = _turning(frame), (frame[12], frame[13], frame[14])
            rate = sp.add(sp.cross(turn, along), sp.cross(sp.cross(turn, about), sp.subtract(end, _origin(frame))))
            rate = sp.add(rate, sp.cross(about, sp.subtract(velocity, v)))
            for k in range(3):
                at.J_rate[i, row + k] += sign * rate[k]
        i = bodies[i].parent


@nk.large_kernel
def _fill_rate(at, bodies, number, qd, work):
    """J̇ of a loop."""
    loop, row = at.loops[number], 0
    for i in range(loop.first, loop.last + 1):
        for k in range(loop.rows):
            at.J_rate[i, k] = 0.0
    for k in range(loop.begin, loop.end):
        closure = at.closures[k]
        _add_end_rate(at, bodies, loop, closure.a, closure.point_a, 1.0, row)
        _add_end_rate(at, bodies, loop, closure.b, closure.point_b, -1.0, row)
        row += 3
    for k in range(len(at.curves)):
        curve = at.curves[k]
        if curve.loop == number:
            _, _, bend = _curve_at(at, curve, at.position[curve.source])
            at.J_rate[curve.source, row] = -bend * joints.joint_rate(bodies, curve.source, qd, work)
            row += 1


@nk.kernel
def _set_rate(at, bodies, loop, r, work):
    """−J̇_r − J̇_d G of the independent joint of body r, in x."""
    for row in range(loop.rows):
        at.x[row] = -at.J_rate[r, row]
    for i in range(loop.first, loop.last + 1):
        if _is_follower(bodies, i):
            for j in range(i, i + bodies[i].dofs):
                if bodies[j].leader == r:
                    for row in range(loop.rows):
                        at.x[row] -= work[j].multiplier * at.J_rate[i, row]
