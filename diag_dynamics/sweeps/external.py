# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External wrench and touched link from external torque τ with noise Σ; W is upper triangular with WᵀW = Σ⁻¹.

The rows G = S J Wᵀ of a wrench scaled by S are LQ, with orthonormal rows of Q and rank columns of L, the longest first.
One-sided Jacobi rotations V make the columns z of LV orthogonal. Along their directions estimates are independent: p/|z|
with p of VᵀQWτ, and with the standard deviation 1/|z|.
"""

import math

import numpy as np

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.numerics.tables import Table, array
from diag_dynamics.sweeps import joints, kinematics, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws

MAX_ROUNDS = 30
"""Maximum rounds of rotations; six rows need three to six."""

ORTHOGONAL, NEARLY_ORTHOGONAL = 1e-28, 1e-15
"""Squared cosines of two rows: they stay as they are below the first, and one rotation suffices below the second."""

LONGER = 1.0 - 1e-12
"""Ratio of squared lengths below which two rows change places."""

ROUNDING = 1e-26
"""Squared length of a row, as a fraction of the longest one's, below which it is rounding error."""

SQRT_THIRD = math.sqrt(1.0 / 3.0)

POINT_OF_WRENCH = Table(
    "PointOfWrench",
    body=int,
    point=array(float),  # in the body's axes
    rotation=array(float),  # row-major, from the body's axes to those of the wrench
    in_world=int,  # whether these are the root link's; then the rotation is ignored
    scale=array(float),  # S, shape (6,)
    whitening=array(float, 2),  # W
    count=int,  # 6, or 3 for a force alone
)

WRENCH, COVARIANCE, DIRECTIONS, DEVIATION, CHI_SQUARE, WRENCH_ROWS = 0, 1, 7, 13, 14, 15
"""First rows of the result, each of six numbers, and their number; χ² is the first entry of its row."""

_point_at = POINT_OF_WRENCH.opened


@nk.kernel
def _dot(x, y):
    total = 0.0
    for k in range(len(x)):
        total += x[k] * y[k]
    return total


@nk.kernel
def _add_multiple(x, factor, y):
    for k in range(len(x)):
        x[k] += factor * y[k]


@nk.kernel
def _scale(x, factor):
    for k in range(len(x)):
        x[k] *= factor


@nk.kernel
def _whiten(W, x, width, result):
    """Wx of a vector whose entries from `width` on are zero: so are those of the result, which is not written there."""
    for i in range(width):
        total = 0.0
        for j in range(i, width):
            total += W[i, j] * x[j]
        result[i] = total


@nk.large_kernel
def _decompose(G, y, count, Z, p):
    """L and p = Qy of G = LQ, the columns of L as rows of Z; return their number. G is overwritten, y keeps y − Qᵀp."""
    longest = 0.0
    for rank in range(count):
        pivot, square = 0, -1.0
        for i in range(count):
            length = _dot(G[i], G[i])
            if length > square:
                pivot, square = i, length
        longest = max(longest, square)
        if square < 0.0:  # no number
            y[0] = math.nan
        if not square > ROUNDING * longest:
            return rank
        root = math.sqrt(square)
        Q = G[pivot]
        p[rank] = _dot(Q, y) / root
        _add_multiple(y, -p[rank] / root, Q)
        for i in range(count):
            Z[rank, i] = _dot(G[i], Q) / root
        for i in range(count):
            if i != pivot:
                _add_multiple(G[i], -Z[rank, i] / root, Q)
        ws.clear(Q)
    return count


@nk.large_kernel
def _orthogonalize(Z, p, count):
    """Rotate rows pairwise until they are orthogonal, the longest first, and the entries of p with them."""
    for _ in range(MAX_ROUNDS):
        rotated = False
        for i in range(count - 1):
            for j in range(i + 1, count):
                a, b, c = 0.0, 0.0, 0.0
                for k in range(6):
                    x, y = Z[i, k], Z[j, k]
                    a, b, c = a + x * x, b + y * y, c + x * y
                if a >= LONGER * b and c * c <= ORTHOGONAL * a * b:
                    continue
                # tan 2φ = 2c/(b − a), |φ| ≤ π/4, and a quarter turn more if the second row is longer.
                zeta = 0.5 * (b - a)
                size = abs(zeta) + math.sqrt(zeta * zeta + c * c)
                t = (c if zeta >= 0.0 else -c) / size
                cosine = 1.0 / math.sqrt(1.0 + t * t)
                sine = cosine * t
                if a < b:
                    cosine, sine = -sine, cosine
                for k in range(6):
                    Z[i, k], Z[j, k] = (
                        cosine * Z[i, k] - sine * Z[j, k],
                        sine * Z[i, k] + cosine * Z[j, k],
                    )
                p[i], p[j] = cosine * p[i] - sine * p[j], sine * p[i] + cosine * p[j]
                rotated = rotated or a < b or c * c > NEARLY_ORTHOGONAL * a * b
        if not rotated:
            return


@nk.large_kernel
def _estimate(Z, p, rank, rest, result):
    """Wrench, covariance and χ² in scaled units from the observed rows; they become unit vectors, p their deviations."""
    chi_square = _dot(rest, rest)
    for k in range(rank):
        part, square = p[k], _dot(Z[k], Z[k])
        p[k] = 1.0 / math.sqrt(square)
        _scale(Z[k], p[k])
        if square < 1.0:  # not observed
            chi_square += part * part
            continue
        _add_multiple(result[WRENCH], part * p[k], Z[k])
        for a in range(6):
            _add_multiple(result[COVARIANCE + a], Z[k, a] / square, Z[k])
    result[CHI_SQUARE, 0] = chi_square


@nk.large_kernel
def _complete(U, rank, count):
    """Unit vectors in the rows from `rank` to `count` that are orthogonal to the unit vectors before them."""
    for k in range(rank, count):
        axis, largest = 0, -1.0
        for a in range(count):
            rest = 1.0
            for i in range(k):
                rest -= U[i, a] * U[i, a]
            if rest > largest:
                axis, largest = a, rest
        ws.clear(U[k])
        U[k, axis] = 1.0
        for i in range(k):
            _add_multiple(U[k], -U[i, axis], U[i])
        _scale(U[k], 1.0 / math.sqrt(_dot(U[k], U[k])))


@nk.large_kernel
def _scaled_rows(at, bodies, work, J, width, rows):
    """Columns of G = S J Wᵀ before `width`; J is overwritten by its rows in the axes of the wrench."""
    R = records.matrix_of(at.rotation)
    if at.in_world:
        R = joints.pose(bodies, at.body, 0, work).rotation
    for k in range(width):
        for first in range(0, at.count, 3):
            v = sp.apply(R, (J[first, k], J[first + 1, k], J[first + 2, k]))
            for a in range(3):
                J[first + a, k] = at.scale[first + a] * v[a]
    for a in range(at.count):
        _whiten(at.whitening, J[a], width, rows[a])


@nk.entry_kernel(nk.ROBOT, nk.COUNT, nk.VECTOR, nk.VECTOR, nk.FILLED_MATRIX)
def wrench(robot, point, q, tau, result):
    """The wrench that explains τ, at the address `point` of a table :data:`POINT_OF_WRENCH`; see :data:`WRENCH`."""
    if not ws.lengths_match(robot, q, tau, tau):
        return ws.BAD_LENGTH
    at, memory, (bodies, _, work, _) = (
        _point_at(point),
        ws.robot_of(robot).scratch,
        ws.opened(robot),
    )
    if not (joints.are_positions(bodies, q) and joints.are_finite(tau)):
        return -1
    status = joints.update_placements(bodies, q, work)
    if status != 0:
        return status
    width = kinematics.set_jacobian(bodies, at.body, at.point, work, memory[:6])
    rows, rest = memory[6:12, :width], memory[12]
    _scaled_rows(at, bodies, work, memory[:6], width, rows)
    _whiten(at.whitening, tau, len(tau), rest)
    for k in range(WRENCH_ROWS):
        ws.clear(result[k])
    U, p = result[DIRECTIONS:DEVIATION], result[DEVIATION]
    rank = _decompose(rows, rest[:width], at.count, U, p)
    _orthogonalize(U, p, rank)
    _estimate(U, p, rank, rest, result)
    _complete(U, rank, at.count)
    for k in range(rank, 6):
        p[k] = math.inf
    for k in range(at.count, 6):
        U[k, k] = 1.0
    for k in range(DEVIATION):
        for a in range(6):
            result[k, a] *= at.scale[a]
            if COVARIANCE <= k < DIRECTIONS:
                result[k, a] *= at.scale[k - COVARIANCE]
    finite = math.isfinite(result[CHI_SQUARE, 0])
    for k in range(DEVIATION):
        finite = finite and joints.are_finite(result[k])
    return 0 if finite else -1


@nk.entry_kernel(
    nk.ROBOT, nk.COUNT, nk.MATRIX, nk.MATRIX, nk.COUNT, nk.COUNT, nk.FILLED_STATES, nogil=True
)
def wrench_each(robot, point, Q, TAU, begin, end, results):
    """:func:`wrench` at states `begin` to `end`."""
    for t in range(begin, end):
        if wrench(robot, point, Q[t], TAU[t], results[t]) != 0:
            return t
    return end


# --- Touched link -----------------------------------------------------------------------------------------

CANDIDATE = np.dtype([("body", "i8"), ("point", "f8", 3), ("spread", "f8", 9)], align=True)
"""A body that may be touched: the mean of its points p, and K, row-major, with KᵀK the mean of p̃p̃ᵀ/3 about it."""

CANDIDATES = Table(
    "Candidates",
    bodies=array(CANDIDATE),
    forces=array(float),  # squares of the magnitudes F
    threshold=float,  # χ² below which nothing is touched
    whitening=array(float, 2),  # W
)

_candidates_at = CANDIDATES.opened


@nk.kernel
def _packed(i, j):
    """Place of the entry i ≥ j in the lower triangle of a symmetric matrix."""
    return i * (i + 1) // 2 + j


@nk.large_kernel
def _log_ratio(square, B, b, L, z):
    """Log of N(y; 0, 1 + F²GᵀG)/N(y; 0, 1) with F² = square, B = GGᵀ and b = Gy; the Cholesky factor goes to L."""
    determinant, explained = 1.0, 0.0
    for i in range(6):
        rest = b[i]
        for j in range(i + 1):
            entry = square * B[_packed(i, j)]
            for k in range(j):
                entry -= L[_packed(i, k)] * L[_packed(j, k)]
            if j < i:
                L[_packed(i, j)] = entry * L[_packed(j, j)]
                rest -= L[_packed(i, j)] * z[j]
            else:
                determinant *= 1.0 + entry
                L[_packed(i, i)] = 1.0 / math.sqrt(1.0 + entry)
        z[i] = rest * L[_packed(i, i)]
        explained += z[i] * z[i]
    return 0.5 * (square * explained - math.log(determinant))


@nk.large_kernel
def _evidence(at, candidate, bodies, work, memory):
    """Log of the mean over forces of :func:`_log_ratio` for a body; y is the thirteenth vector of the memory."""
    J = memory[:6]
    width = kinematics.set_jacobian(bodies, candidate.body, candidate.point, work, J)
    K = records.matrix_of(candidate.spread)
    for k in range(width):
        moved = sp.apply(K, (J[3, k], J[4, k], J[5, k]))
        for a in range(3):
            J[a, k] *= SQRT_THIRD
            J[3 + a, k] = moved[a]
    B, b, L, z = (
        work[0].P,
        work[0].y,
        work[0].P_rate,
        work[0].z,
    )  # of the world, which has no inertia
    rows, y = memory[6:12, :width], memory[12, :width]
    for i in range(6):
        _whiten(at.whitening, J[i], width, rows[i])
        b[i] = _dot(rows[i], y)
        for j in range(i + 1):
            B[_packed(i, j)] = _dot(rows[i], rows[j])
    largest, total = -math.inf, 0.0
    for f in range(len(at.forces)):
        one = _log_ratio(at.forces[f], B, b, L, z)
        total = total * math.exp(min(largest - one, 0.0)) + math.exp(min(one - largest, 0.0))
        largest = max(largest, one)
    return largest + math.log(total)


@nk.entry_kernel(nk.ROBOT, nk.COUNT, nk.VECTOR, nk.VECTOR, nk.FILLED_VECTOR)
def touched_link(robot, candidates, q, tau, result):
    """χ² of τ, and behind it the probability of each candidate: zeros below the threshold of χ²."""
    if not ws.lengths_match(robot, q, tau, tau):
        return ws.BAD_LENGTH
    at, memory, (bodies, _, work, _) = (
        _candidates_at(candidates),
        ws.robot_of(robot).scratch,
        ws.opened(robot),
    )
    if not (joints.are_positions(bodies, q) and joints.are_finite(tau)):
        return -1
    y, probability = memory[12], result[1:]
    _whiten(at.whitening, tau, len(tau), y)
    ws.clear(result)
    result[0] = _dot(y, y)
    if result[0] < at.threshold:
        return 0
    status = joints.update_placements(bodies, q, work)
    if status != 0:
        return status
    largest, total = -math.inf, 0.0
    for k in range(len(probability)):
        probability[k] = _evidence(at, at.bodies[k], bodies, work, memory)
        largest = max(largest, probability[k])
    for k in range(len(probability)):
        probability[k] = math.exp(probability[k] - largest)
        total += probability[k]
    for k in range(len(probability)):
        probability[k] /= total
    return 0 if joints.are_finite(result) else -1


@nk.entry_kernel(
    nk.ROBOT, nk.COUNT, nk.MATRIX, nk.MATRIX, nk.COUNT, nk.COUNT, nk.FILLED_MATRIX, nogil=True
)
def touched_link_each(robot, candidates, Q, TAU, begin, end, results):
    """:func:`touched_link` at states `begin` to `end`."""
    for t in range(begin, end):
        if touched_link(robot, candidates, Q[t], TAU[t], results[t]) != 0:
            return t
    return end
