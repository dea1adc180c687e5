# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints whose rates depend on others by ratios that change with the state.

They belong to closed loops, curves and flexible links. A follower's rate is Σ G q̇ over independent
joints. It is a body for each of them, all along the same axis in one frame: the workspace has the
body's own entry of G as `multiplier`, its rate Ġ as `multiplier_rate`, and the follower's position
as `offset`. Other sweeps read only these three.

A loop is cut. It is closed where φ = 0: points on both sides of the cut coincide, in directions
that are fixed in the group's carrier. With J = ∂φ/∂q over all joints of the group, independent ones
r, followers d,

    J_d G + J_r = 0        J_d Ġ + J̇_d G + J̇_r = 0        J̇ along the actual q̇

In the axes and about the origin of the carrier, with S and V of the joints, and F = (d, c × d) of a
direction d at a point c,

    J = FᵀS        J̇ = FᵀṠ + (0, ċ × d)ᵀS        Ṡ = V × S

Positions of followers are found by Newton's method, from the last state if it is near, and
otherwise along the straight line from the start values, which choose the branch. Equations may be
redundant: they are solved by least squares, J_d = QR with Householder reflections.
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

LOOP = np.dtype([(name, "i8") for name in ("begin", "end", "followers", "first", "last", "rows")])
"""A group that is closed: its joints, the number of followers, its closures, and the number of
equations."""

JOINT = np.dtype([("body", "i8"), ("carrier", "i8"), ("order", "i8")])
"""A joint of a loop: its first body, the joint that carries it or -1, and in `order` the joints,
followers first."""

CLOSURE = np.dtype(
    [
        ("a", "i8"),  # joints whose links meet, or -1 for the group's carrier
        ("b", "i8"),
        ("point_a", "f8", 3),
        ("point_b", "f8", 3),
        ("direction", "f8", 3),
    ],
    align=True,
)
"""A direction in the axes of the carrier in which two points coincide, each in the frame of its
body."""

CURVE = np.dtype(
    [
        ("loop", "i8"),  # number of the loop with this equation, or -1
        ("follower", "i8"),  # a joint of the loop; first body of the follower, if there is none
        ("source", "i8"),
        ("begin", "i8"),  # pieces
        ("end", "i8"),
    ],
    align=True,
)
"""A position that is a piecewise polynomial of another one."""

FORM = np.dtype([("body", "i8"), ("begin", "i8")], align=True)
"""A position φᵀη + ½ηᵀQη by several joints: first body of the follower, and where its coefficients
begin: φ and the row of Q of each joint."""

COUPLINGS = Table(
    "Couplings",
    bodies=array(records.BODY),
    work=array(records.WORK),
    nq=int,
    nv=int,
    loops=array(LOOP),
    joints=array(JOINT),
    closures=array(CLOSURE),
    curves=array(CURVE),
    pieces=array(
        float, 2
    ),  # where each begins, and coefficients of the distance from there, the constant first
    start=array(
        float
    ),  # positions of joints of loops: at the start, at the last state, before this one, and now
    last=array(float),
    before=array(float),
    position=array(float),
    forms=array(FORM),
    coefficients=array(float),  # of forms
    ratio=array(float),  # of each loop: smallest diagonal entry of R by the longest column of J
    J=array(float, 2),  # ∂φ/∂q and its rate, a row for each joint
    J_rate=array(float, 2),
    reduced=array(float, 2),  # QR of J_d, a row for each follower
    diagonal=array(float),  # 1/R_kk
    scale=array(float),  # of reflections
    bend=array(float),  # rates of slopes of curves by their sources' positions
    x=array(float),  # φ, then a solution
    frames=array(float, 2),  # of each joint in the carrier: R, p, S, V, Ṡ
)

_opened = COUPLINGS.opened
_vector_at = array_at(types.float64, 1)

NEAR = 0.5
"""Distance of the last state [rad, m] up to which followers are found from there."""

LARGEST_CORRECTION = 0.25
"""Correction of a follower [rad, m] above which a step toward the state is halved: it might change
the branch."""

LONGEST_STEP, SHORTEST_STEP = 0.1, 1e-5
"""Steps of independent joints [rad, m]: a longer one may change the branch, for a shorter one the
loop cannot be closed."""

STEPS = 1_000_000
"""Maximum number of steps to a state."""

FINE = 1e-9
"""Correction [rad, m] after which Newton's method has converged: the next one is its square."""

EXACT = 2e-15
"""Rounding of φ by the size of its points: no correction can improve on it."""

CLOSED = 1e-6
"""Largest distance between the two points of a closure [m]; loops of descriptions are closed to
their last digit."""

NEARLY_SINGULAR, SINGULAR = 1e-6, 1e-10
"""Ratio of a loop below which to warn, and to refuse."""

OPEN_LOOP, SINGULAR_LOOP = -1000, -2000
"""Statuses of a loop that cannot be closed or is singular, minus the number of the loop."""

ITERATIONS = 15


class CouplingTables(NamedTuple):
    """Arrays of the records of a model's couplings: see :data:`COUPLINGS`."""

    loops: Any
    joints: Any
    closures: Any
    curves: Any
    pieces: Any
    start: Any
    forms: Any
    coefficients: Any


class Couplings:
    """Loops and curves of a robot as the kernels of a workspace take them, and memory for them.

    `ratio` is that of each loop: see :data:`COUPLINGS`. `work` of the workspace gets the addresses
    of table and code.
    """

    def __init__(self, bodies, work, nq, nv, of_model):
        count = len(of_model.joints)
        # J has a column for each equation, as many as the largest loop has.
        rows = int(of_model.loops["rows"].max(initial=1))
        self.ratio = np.full(len(of_model.loops), np.inf)
        given = {
            "bodies": bodies,
            "work": work,
            "nq": nq,
            "nv": nv,
            "ratio": self.ratio,
        } | of_model._asdict()
        # A row of `frames` has 30 numbers: R 9, p 3, and 6 each of S, V and Ṡ.
        shapes = dict.fromkeys(("J", "J_rate", "reduced"), (count, rows)) | {"frames": (count, 30)}
        shapes |= {"x": max(rows, count), "bend": len(of_model.curves)} | dict.fromkeys(
            ("last", "before", "position", "diagonal", "scale"), count
        )
        # NaN in `last`: there is no state yet, so that loops are closed from the start values.
        self._addresses = Addresses(
            COUPLINGS, **given, **{name: np.full(size, np.nan) for name, size in shapes.items()}
        )
        work[0]["couplings"] = self._addresses.at
        work[0]["couple"] = couple.address


# Functions of their own take the address of the table: as an argument the table itself would be
# copied.


# --- Least squares --------------------------------------------------------------------------------


@nk.kernel
def _reflect(v, scale, begin, rows, x):
    """Apply the reflection x − scale v vᵀx; v begins at an entry."""
    total = 0.0
    for row in range(begin, rows):
        total += v[row] * x[row]
    total *= scale
    for row in range(begin, rows):
        x[row] -= total * v[row]


@nk.kernel
def _reduce(at, loop):
    """QR of J_d: reflections replace the lower triangle.

    Returns the smallest |R_kk| by the longest column of J.
    """
    A = at.reduced[loop.begin :]
    scale = at.scale[loop.begin :]
    longest = 0.0
    least = math.inf
    # Squared length of the longest column of J, independent joints included
    for k in range(loop.begin, loop.end):
        square = 0.0
        for row in range(loop.rows):
            square += at.J[k, row] * at.J[k, row]
        longest = max(longest, square)
    for k in range(loop.followers):
        for row in range(loop.rows):
            A[k, row] = at.J[at.joints[loop.begin + k].order, row]
        # Earlier reflections of the column, then the one that clears it below R_kk
        for j in range(k):
            _reflect(A[j], scale[j], j, loop.rows, A[k])
        # R_kk² is the squared length of the column from row k on.
        square = 0.0
        own = A[k, k]
        for row in range(k, loop.rows):
            square += A[k, row] * A[k, row]
        least = min(least, square)
        # Columns of followers depend on each other, or an entry is NaN.
        if not square > 0.0:
            return 0.0
        # The sign of R_kk is opposite to that of the entry, against cancellation.
        entry = math.copysign(math.sqrt(square), -own)
        # v = a − R_kk e_k from row k on, with 2/vᵀv = 1/(R_kk² + |a_k R_kk|)
        A[k, k] -= entry
        at.diagonal[loop.begin + k] = 1.0 / entry
        scale[k] = 1.0 / (square + abs(own * entry))
    return math.sqrt(least / longest)


@nk.large_kernel
def _solve(table, loop):
    """Solve J_d y = x by least squares; y replaces the first entries of x."""
    at = _opened(table)
    A = at.reduced[loop.begin :]
    x = at.x
    # x ← Qᵀ x
    for k in range(loop.followers):
        _reflect(A[k], at.scale[loop.begin + k], k, loop.rows, x)
    # R y = x, from the last row
    # Entries of Qᵀx after the last row of R are the residual.
    for k in range(loop.followers - 1, -1, -1):
        for j in range(k + 1, loop.followers):
            x[k] -= A[j, k] * x[j]
        x[k] *= at.diagonal[loop.begin + k]


# --- Closure of a loop, in the carrier of the group -----------------------------------------------


@nk.kernel
def _part(frame, first):
    return (frame[first], frame[first + 1], frame[first + 2])


@nk.kernel
def _motion(frame, first):
    return sp.Motion(_part(frame, first), _part(frame, first + 3))


@nk.kernel
def _place(at, loop):
    """Placements of the joints of a group in the carrier, and S."""
    for k in range(loop.begin, loop.end):
        joint = at.joints[k]
        frame = at.frames[k]
        body = at.bodies[joint.body]
        position = at.position[k]
        turns = body.direction == sp.ANGULAR_Z
        # X in the frame of the parent body, and then of the group's carrier
        if turns:
            X = joints.placement(sp.ANGULAR_Z, body, sp.reduced_angle(position))
        else:
            X = joints.placement(sp.LINEAR_Z, body, position)
        if joint.carrier >= 0:
            carrier = at.frames[joint.carrier]
            X = sp.compose_placements(
                sp.Placement(records.matrix_of(carrier), _part(carrier, 9)), X
            )
        R = X.rotation
        p = X.translation
        records.set_matrix(frame, R)
        records.set_vector(frame, 9, p)
        # S about the carrier's origin: (p × a, a) of a revolute joint, (a, 0) of a prismatic one
        axis = (R[0][2], R[1][2], R[2][2])
        records.set_vector(frame, 12, sp.cross(p, axis) if turns else axis)
        records.set_vector(frame, 15, axis if turns else sp.ZERO)


@nk.kernel
def _end(at, joint, point):
    """An end of a closure."""
    p = records.vector_of(point)
    if joint < 0:
        return p
    return sp.add(_part(at.frames[joint], 9), sp.apply(records.matrix_of(at.frames[joint]), p))


@nk.kernel
def _add_end(at, k, F, sign, row):
    """Add FᵀS of the joints that carry an end to a column of J."""
    while k >= 0:
        at.J[k, row] += sign * sp.power(F, _motion(at.frames[k], 12))
        k = at.joints[k].carrier


@nk.kernel
def _close(at, number):
    """Fill J and φ, in x; return the largest entry of φ, and the size of points that rounds it."""
    loop = at.loops[number]
    largest = 0.0
    size = 0.0
    for k in range(loop.begin, loop.end):
        for row in range(loop.rows):
            at.J[k, row] = 0.0
    # d is constant in the axes of the carrier: the rate of φ is dᵀ(ȧ − ḃ).
    for row in range(loop.last - loop.first):
        closure = at.closures[loop.first + row]
        a = _end(at, closure.a, closure.point_a)
        b = _end(at, closure.b, closure.point_b)
        d = closure.direction
        d = records.vector_of(d)
        # φ = dᵀ (a − b), and FᵀS of the joints that carry either end
        at.x[row] = sp.dot(sp.subtract(a, b), d)
        largest = max(largest, abs(at.x[row]))
        # φ is rounded relative to the distance of its points from the carrier's origin.
        size = max(size, sp.dot(a, a))
        _add_end(at, closure.a, sp.Force(d, sp.cross(a, d)), 1.0, row)
        _add_end(at, closure.b, sp.Force(d, sp.cross(b, d)), -1.0, row)
    # Curves in the loop: φ = q_d − c(q_s), with the derivatives 1 and −c′
    row = loop.last - loop.first
    for k in range(len(at.curves)):
        curve = at.curves[k]
        if curve.loop == number:
            position, slope, at.bend[k] = _curve_at(at, curve, at.position[curve.source])
            at.x[row] = at.position[curve.follower] - position
            largest = max(largest, abs(at.x[row]))
            at.J[curve.follower, row] = 1.0
            at.J[curve.source, row] = -slope
            row += 1
    return largest, math.sqrt(size)


@nk.large_kernel
def _newton(table, number):
    """Run Newton's method from `position`; return whether it converged.

    J and its reduction are those of the result.
    """
    at = _opened(table)
    loop = at.loops[number]
    correction = math.inf
    for _ in range(ITERATIONS):
        # φ and J at these positions, and J_d = QR
        _place(at, loop)
        apart, size = _close(at, number)
        at.ratio[number] = _reduce(at, loop)
        # J_d is singular or not finite: G does not exist.
        if not at.ratio[number] > SINGULAR:
            return False
        # Converged: the last correction was small, or φ is rounding.
        if correction <= FINE or apart <= EXACT * size:
            # Least squares also end where redundant equations contradict each other.
            return apart <= CLOSED
        # J_d Δ = φ
        _solve(table, loop)
        # Independent joints stay, and followers move by −Δ.
        before = correction
        correction = 0.0
        for k in range(loop.followers):
            at.position[at.joints[loop.begin + k].order] -= at.x[k]
            correction = max(correction, abs(at.x[k]))
        # Corrections that are large, or shrink slowly, may lead to another branch.
        if not (correction <= LARGEST_CORRECTION and correction <= max(0.5 * before, FINE)):
            return False
    return False


@nk.large_kernel
def _set_ratios(table, loop):
    """G of all followers where Newton's method has found them, which become the last ones."""
    at = _opened(table)
    # The search for the next state begins here.
    for k in range(loop.begin, loop.end):
        at.last[k] = at.position[k]
    for rank in range(loop.end - loop.begin - loop.followers):
        r = at.joints[loop.begin + loop.followers + rank].order
        # J_d G_r = −J_r
        for row in range(loop.rows):
            at.x[row] = -at.J[r, row]
        _solve(table, loop)
        # Body `rank` of a follower has its ratio to independent joint r.
        for k in range(loop.followers):
            at.work[at.joints[at.joints[loop.begin + k].order].body + rank].multiplier = at.x[k]


@nk.kernel
def _distance(at, loop, q):
    """Largest way of an independent joint from the last state."""
    farthest = 0.0
    for k in range(loop.begin + loop.followers, loop.end):
        r = at.joints[k].order
        farthest = max(farthest, abs(q[at.bodies[at.joints[r].body].q] - at.last[r]))
    return farthest


@nk.large_kernel
def _approach(table, number, q):
    """Move a closed loop from `last` to q in as many steps as it needs; returns whether it arrives.

    Followers begin where their ratios take them, so that the branch stays where two of them meet.
    """
    at = _opened(table)
    loop = at.loops[number]
    length = LONGEST_STEP
    for _ in range(STEPS):
        remaining = _distance(at, loop, q)
        # Fraction of the way on which no independent joint moves by more than `length`
        step = 1.0 if remaining <= length else length / remaining
        for k in range(loop.followers):
            i = at.joints[loop.begin + k].order
            at.position[i] = at.last[i]
        # Independent joints go a part of the way, followers along their ratios G.
        for rank in range(loop.end - loop.begin - loop.followers):
            r = at.joints[loop.begin + loop.followers + rank].order
            # The last step takes q itself, because the sum would be rounded.
            target = q[at.bodies[at.joints[r].body].q]
            at.position[r] = target if step == 1.0 else at.last[r] + step * (target - at.last[r])
            for k in range(loop.followers):
                i = at.joints[loop.begin + k].order
                at.position[i] += at.work[at.joints[i].body + rank].multiplier * (
                    at.position[r] - at.last[r]
                )
        # Newton's method corrects the followers. A failure leaves `last` and G unchanged.
        if _newton(table, number):
            _set_ratios(table, loop)
            if step == 1.0:
                return True
            # Steps grow after a success, and are halved after a failure.
            length = min(2.0 * length, LONGEST_STEP)
        else:
            length = 0.5 * min(length, remaining)
            if not length > SHORTEST_STEP:
                return False
    return False


@nk.large_kernel
def _close_at(table, number, positions):
    """Close a loop near positions of its joints; returns whether it is closed."""
    at = _opened(table)
    loop = at.loops[number]
    for k in range(loop.begin, loop.end):
        at.position[k] = positions[k]
    closed = _newton(table, number)
    if closed:
        _set_ratios(table, loop)
    return closed


@nk.large_kernel
def _close_loop(table, number, q):
    """Positions of followers of a loop and their ratios; returns a status.

    They are found from the last state if it is near, else from the start, else from the last state.
    """
    at = _opened(table)
    loop = at.loops[number]
    # Attempts overwrite `last`.
    for k in range(loop.begin, loop.end):
        at.before[k] = at.last[k]
    # Near the last state its branch is kept, elsewhere the start values choose the branch.
    is_near = _distance(at, loop, q) <= NEAR
    closed = is_near and _approach(table, number, q)
    if not closed:
        closed = _close_at(table, number, at.start) and _approach(table, number, q)
    if not (closed or is_near):
        closed = _close_at(table, number, at.before) and _approach(table, number, q)
    # A failure restores the last closed state. NaN leads to the start values the next time.
    if not closed:
        # The ratio is that of the last attempt, before the restored state changes it.
        is_singular = not at.ratio[number] > SINGULAR
        if not _close_at(table, number, at.before):
            at.last[loop.begin : loop.end] = math.nan
        return (SINGULAR_LOOP if is_singular else OPEN_LOOP) - number
    # The constant multiplier of a follower is 0, so that the offset is its position.
    for k in range(loop.followers):
        i = at.joints[loop.begin + k].order
        at.work[at.joints[i].body].offset = at.position[i]
    return 0


@nk.kernel
def _move(at, loop, qd):
    """V of the joints of a group against the carrier, and Ṡ."""
    for k in range(loop.begin, loop.end):
        frame = at.frames[k]
        carrier = at.joints[k].carrier
        V = sp.NO_MOTION
        S = _motion(frame, 12)
        # V and Ṡ are relative to the group's carrier, where V is zero.
        if carrier >= 0:
            V = _motion(at.frames[carrier], 18)
        rate = joints.joint_rate(at.bodies, at.joints[k].body, qd, at.work)
        # Ṡ = V × S with V of the parent body, because S × S = 0
        records.set_motion(frame[24:], sp.cross_motion(V, S))
        moved = sp.Motion(sp.scale(S.linear, rate), sp.scale(S.angular, rate))
        records.set_motion(frame[18:], sp.add_motion(V, moved))


@nk.large_kernel
def _add_end_rate(table, k, point, d, sign, row):
    """Add the rates of what :func:`_add_end` adds."""
    at = _opened(table)
    # An end on the group's carrier does not move against it.
    if k >= 0:
        end = _end(at, k, point)
        V = _motion(at.frames[k], 18)
        # F = (d, c × d), and the rate ċ × d of its moment, with ċ = v + ω × c
        F = sp.Force(d, sp.cross(end, d))
        moment = sp.cross(sp.add(V.linear, sp.cross(V.angular, end)), d)
        while k >= 0:
            # J̇ = FᵀṠ + (0, ċ × d)ᵀS
            rate = sp.power(F, _motion(at.frames[k], 24)) + sp.dot(moment, _part(at.frames[k], 15))
            at.J_rate[k, row] += sign * rate
            k = at.joints[k].carrier


@nk.large_kernel
def _set_ratio_rates(table, number, qd):
    """Ġ of all followers of a loop whose J is reduced."""
    at = _opened(table)
    loop = at.loops[number]
    # V and Ṡ along the actual q̇, which needs G of the followers
    _move(at, loop, qd)
    for k in range(loop.begin, loop.end):
        for row in range(loop.rows):
            at.J_rate[k, row] = 0.0
    for row in range(loop.last - loop.first):
        closure = at.closures[loop.first + row]
        d = records.vector_of(closure.direction)
        _add_end_rate(table, closure.a, closure.point_a, d, 1.0, row)
        _add_end_rate(table, closure.b, closure.point_b, d, -1.0, row)
    # Curves in the loop: only −c′ changes, at the rate −c″ q̇_s.
    row = loop.last - loop.first
    for k in range(len(at.curves)):
        curve = at.curves[k]
        if curve.loop == number:
            rate = joints.joint_rate(at.bodies, at.joints[curve.source].body, qd, at.work)
            at.J_rate[curve.source, row] = -at.bend[k] * rate
            row += 1
    # J_d Ġ_r = −J̇_r − J̇_d G_r, by the QR of J_d from Newton's last iteration
    for rank in range(loop.end - loop.begin - loop.followers):
        r = at.joints[loop.begin + loop.followers + rank].order
        for row in range(loop.rows):
            at.x[row] = -at.J_rate[r, row]
            for k in range(loop.followers):
                i = at.joints[loop.begin + k].order
                at.x[row] -= at.work[at.joints[i].body + rank].multiplier * at.J_rate[i, row]
        _solve(table, loop)
        for k in range(loop.followers):
            at.work[at.joints[at.joints[loop.begin + k].order].body + rank].multiplier_rate = at.x[
                k
            ]


# --- Non-linear mimic joints ----------------------------------------------------------------------


@nk.kernel
def _curve_at(at, curve, source):
    """Position of a curve, its slope and the rate of the slope by the source's position."""
    # The first piece extends to smaller positions, and the last one to larger ones.
    k = curve.begin
    while k + 1 < curve.end and source >= at.pieces[k + 1, 0]:
        k += 1
    x = source - at.pieces[k, 0]
    p = 0.0
    slope = 0.0
    bend = 0.0
    # Horner's scheme for p, p′ and ½ p″, from the highest coefficient
    for j in range(at.pieces.shape[1] - 1, 0, -1):
        bend = bend * x + slope
        slope = slope * x + p
        p = p * x + at.pieces[k, j]
    return p, slope, 2.0 * bend


# --- Joints that follow the modes of a flexible link ----------------------------------------------


@nk.large_kernel
def _set_forms(table, q):
    """Positions of followers, and their ratios φ + Qη."""
    at = _opened(table)
    for form in at.forms:
        first = form.body
        count = at.bodies[form.body].dofs
        k = form.begin
        position = 0.0
        # A row is (φ_i, Q_i). Ratios are φ + Qη, the position is Σ ½ (φ_i + ratio_i) η_i.
        for i in range(first, first + count):
            linear = ratio = at.coefficients[k]
            for j in range(count):
                ratio += at.coefficients[k + 1 + j] * q[at.bodies[first + j].q]
            position += 0.5 * (linear + ratio) * q[at.bodies[i].q]
            at.work[i].multiplier = ratio
            k += count + 1
        at.work[first].offset = position


@nk.large_kernel
def _set_form_rates(table, qd):
    """Rates Qη̇ of ratios that change."""
    at = _opened(table)
    for form in at.forms:
        first = form.body
        count = at.bodies[form.body].dofs
        # φ is constant, and Q follows it in a row.
        k = form.begin + 1
        for i in range(first, first + count):
            rate = 0.0
            for j in range(count):
                rate += at.coefficients[k + j] * qd[at.bodies[first + j].dof]
            at.work[i].multiplier_rate = rate
            k += count + 1


# --- All couplings of a robot ---------------------------------------------------------------------


@Callback
def couple(table, positions, rates, what):
    """Positions of followers and G at the positions at an address, and then, or alone, Ġ.

    See joints.couple.
    """
    at = _opened(table)
    if what != joints.RATES:
        status = _couple(table, at, _vector_at(positions, (at.nq,)))
        if status != 0:
            return status
    # RATES alone relies on G, J_d and c″ of the call for positions before.
    if what != joints.POSITIONS:
        _couple_rates(table, _vector_at(rates, (at.nv,)))
    return 0


@nk.kernel
def _couple(table, at, q):
    # Curves outside loops: the position c(q_s), G = c′, and c″ for Ġ
    for k in range(len(at.curves)):
        curve = at.curves[k]
        if curve.loop < 0:
            w = at.work[curve.follower]
            w.offset, w.multiplier, at.bend[k] = _curve_at(at, curve, q[at.bodies[curve.source].q])
    _set_forms(table, q)
    for number in range(len(at.loops)):
        status = _close_loop(table, number, q)
        if status != 0:
            return status
    return 0


@nk.large_kernel
def _couple_rates(table, qd):
    at = _opened(table)
    # Curves outside loops: Ġ = c″ q̇_s
    for k in range(len(at.curves)):
        curve = at.curves[k]
        if curve.loop < 0:
            at.work[curve.follower].multiplier_rate = at.bend[k] * qd[at.bodies[curve.source].dof]
    _set_form_rates(table, qd)
    for number in range(len(at.loops)):
        _set_ratio_rates(table, number, qd)
