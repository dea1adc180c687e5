# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The touched link from external torque τ with noise Σ.

W is upper triangular with WᵀW = Σ⁻¹.
"""

import math

import numpy as np

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.numerics.tables import Table, array
from diag_dynamics.sweeps import joints, kinematics, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws

SQRT_THIRD = math.sqrt(1.0 / 3.0)


@nk.kernel
def _dot(x, y):
    total = 0.0
    for k in range(len(x)):
        total += x[k] * y[k]
    return total


@nk.kernel
def _whiten(W, x, width, result):
    """Wx of a vector whose entries from `width` on are zero.

    So are those of the result, which are not written.
    """
    for i in range(width):
        total = 0.0
        for j in range(i, width):
            total += W[i, j] * x[j]
        result[i] = total


CANDIDATE = np.dtype([("body", "i8"), ("point", "f8", 3), ("spread", "f8", 9)], align=True)
"""A body that may be touched: the mean of its points p, and K, row-major, with KᵀK the mean of
p̃p̃ᵀ/3 about it."""

CANDIDATES = Table(
    "Candidates",
    bodies=array(CANDIDATE),  # two of each link: its box, and points near its origin
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
    """Log of N(y; 0, 1 + F²GᵀG)/N(y; 0, 1), F² = `square`, B = GGᵀ and b = Gy.

    The Cholesky factor is written to L.
    """
    # Row by row: L Lᵀ = 1 + F²B and L z = b. Entries lack the 1 of the diagonal until it is added
    # to a pivot; the diagonal of L is kept inverted.
    determinant = 1.0
    explained = 0.0
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
    # Woodbury: yᵀ[1 − (1 + F²GᵀG)⁻¹]y = F² bᵀ(1 + F²B)⁻¹b = F² zᵀz; det(1 + F²GᵀG) = det(1 + F²B).
    return 0.5 * (square * explained - math.log(determinant))


@nk.large_kernel
def _evidence(at, candidate, bodies, work, memory):
    """Log of the mean over forces of :func:`_log_ratio` for a body.

    y is the thirteenth vector of the memory.
    """
    # A force f at a point p from the mean of points has the torque (J_v − p̃ J_ω)ᵀf. Over all
    # directions and points its covariance is F²[J_vᵀJ_v/3 + (K J_ω)ᵀ(K J_ω)]: the mean of p is 0.
    J = memory[:6]
    width = kinematics.set_jacobian(bodies, candidate.body, candidate.point, work, J)
    K = records.matrix_of(candidate.spread)
    for k in range(width):
        moved = sp.apply(K, (J[3, k], J[4, k], J[5, k]))
        for a in range(3):
            J[a, k] *= SQRT_THIRD
            J[3 + a, k] = moved[a]
    # The world has no inertia, so its workspace is free.
    B = work[0].P
    b = work[0].y
    L = work[0].P_rate
    z = work[0].z
    # G = [J_v/√3; K J_ω] Wᵀ, B = GGᵀ and b = Gy.
    rows = memory[6:12, :width]
    y = memory[12, :width]
    for i in range(6):
        _whiten(at.whitening, J[i], width, rows[i])
        b[i] = _dot(rows[i], y)
        for j in range(i + 1):
            B[_packed(i, j)] = _dot(rows[i], rows[j])
    # Log of the sum of ratios over forces, relative to the largest: exp of a ratio can overflow.
    # The number of forces is the same for all bodies and cancels in their probabilities.
    largest = -math.inf
    total = 0.0
    for f in range(len(at.forces)):
        ratio = _log_ratio(at.forces[f], B, b, L, z)
        total = total * math.exp(min(largest - ratio, 0.0)) + math.exp(min(ratio - largest, 0.0))
        largest = max(largest, ratio)
    return largest + math.log(total)


@nk.entry_kernel(nk.ROBOT, nk.COUNT, nk.VECTOR, nk.VECTOR, nk.FILLED_VECTOR)
def touched_link(robot, candidates, q, tau, result):
    """χ² of τ, and behind it the probability of each candidate: zeros below the threshold of χ²."""
    if not ws.lengths_match(robot, q, tau, tau):
        return ws.BAD_LENGTH
    at = _candidates_at(candidates)
    memory = ws.robot_of(robot).scratch
    bodies, _, work, _ = ws.opened(robot)
    if not (joints.are_positions(bodies, q) and joints.are_finite(tau)):
        return -1
    # Noise alone gives y = Wτ the unit covariance: χ² = τᵀΣ⁻¹τ = |y|².
    y = memory[12]
    probability = result[1:]
    _whiten(at.whitening, tau, len(tau), y)
    ws.clear(result)
    result[0] = _dot(y, y)
    if result[0] < at.threshold:
        return 0
    status = joints.update_placements(bodies, q, work)
    if status != 0:
        return status
    # A link has two candidates, its box and points near its origin: log(exp a + exp b).
    largest = -math.inf
    total = 0.0
    for k in range(len(probability)):
        box = _evidence(at, at.bodies[2 * k], bodies, work, memory)
        origin = _evidence(at, at.bodies[2 * k + 1], bodies, work, memory)
        probability[k] = max(box, origin) + math.log1p(math.exp(-abs(box - origin)))
        largest = max(largest, probability[k])
    # Links are equally probable beforehand: ratios over their sum, relative to the largest.
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
