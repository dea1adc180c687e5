# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""An articulated inertia filtered and handed on in vector registers: a stack is a 3x3 matrix of lanes, see inertias."""

from diag_dynamics.compiled.kernel import kernel
from diag_dynamics.compiled.registers import EIGHT, FOUR, chooser, loader, mover, spreader, store
from diag_dynamics.sweeps.spatial import (
    ANGULAR_Z,
    cross_columns,
    matrix_difference,
    matrix_sum,
    outer,
    rotated,
    transpose,
    turn_columns,
)

_load_own, _load_one, _load_both = loader(FOUR, 4), loader(FOUR), loader(EIGHT)
_one, _both = spreader(FOUR), spreader(EIGHT)
_of_C, _of_B_and_C, _of_B, _of_rate = (
    chooser(False, False, True, False),
    chooser(False, True, True, False),
    chooser(False, True, False, False),
    chooser(*4 * [False], *4 * [True]),
)
_to_next_block, _A_to_B, _B_to_C = mover(None, 0, 1, None), mover(None, 0, None, None), mover(None, None, 1, None)
_P_to_rate = mover(*4 * [None], 0, 1, 2, None)


@kernel
def _symmetric(M):
    """Blocks A and C mirrored."""
    return (
        M[0],
        (_of_B(M[0][1], M[1][0]), M[1][1], M[1][2]),
        (_of_B(M[0][2], M[2][0]), _of_B(M[1][2], M[2][1]), M[2][2]),
    )


@kernel
def _rows(spread, F):
    """What a wrench F contributes to the rows of F Hᵀ: its force in the blocks A and B, its moment in C."""
    f, m = F.force, F.moment
    return (
        _of_C(spread(f[0]), spread(m[0])),
        _of_C(spread(f[1]), spread(m[1])),
        _of_C(spread(f[2]), spread(m[2])),
    )


@kernel
def _columns(spread, F):
    """What a wrench F contributes to the columns of G Fᵀ: its force in the block A, its moment in B and C."""
    f, m = F.force, F.moment
    return (
        _of_B_and_C(spread(f[0]), spread(m[0])),
        _of_B_and_C(spread(f[1]), spread(m[1])),
        _of_B_and_C(spread(f[2]), spread(m[2])),
    )


@kernel
def _beside(x, y):
    """Lanes of P from x, those of Ṗ from y."""
    return (_of_rate(x[0], y[0]), _of_rate(x[1], y[1]), _of_rate(x[2], y[2]))


@kernel
def _stack_to_parent(X, M):
    """XᵀP X of all inertias in a stack: see spatial.inertia_to_parent."""
    M = _symmetric(rotated(X.rotation, M))
    shifted = matrix_sum(M, _to_next_block(transpose(cross_columns(X.translation, M))))
    return _symmetric(matrix_sum(shifted, _B_to_C(cross_columns(X.translation, shifted))))


@kernel
def _moved(direction, rate, M):
    """What P's own motion adds to Ṗ: see spatial.transport_along_z."""
    if direction == ANGULAR_Z:
        K = matrix_sum(turn_columns(M, rate), transpose(turn_columns(transpose(M), rate)))
    else:
        N = turn_columns(M, rate)
        K = matrix_sum(_A_to_B(transpose(N)), _B_to_C(matrix_sum(N, transpose(N))))
    return _P_to_rate(K)


@kernel
def start_stack(body, w):
    """P of a body's own mass, and no Ṗ."""
    own, nothing = _load_own(w.rigid), _one(0.0)
    store(w.P, own)
    store(w.P_rate, ((nothing, nothing, nothing), (nothing, nothing, nothing), (nothing, nothing, nothing)))


@kernel
def hand_on_stack(w, G, column, X, parent):
    """P alone."""
    M = _load_one(w.P)
    M = _symmetric(matrix_difference(M, outer(_rows(_one, G), _columns(_one, column))))
    store(parent.P, matrix_sum(_load_one(parent.P), _stack_to_parent(X, M)))


@kernel
def hand_on_stack_of_both(w, direction, rate, G, column, h, X, parent):
    """P and Ṗ."""
    g_rows, g_columns = _rows(_both, G), _columns(_both, G)
    nothing = (_both(0.0), _both(0.0), _both(0.0))
    M = _load_both(w.P)
    M = matrix_difference(M, outer(g_rows, _beside(_columns(_both, column), _columns(_both, h))))
    M = _symmetric(matrix_difference(M, outer(_beside(nothing, _rows(_both, h)), g_columns)))
    M = matrix_sum(M, _moved(direction, rate, M))
    store(parent.P, matrix_sum(_load_both(parent.P), _stack_to_parent(X, M)))


@kernel
def stack_to_parent(source, target, X):
    """XᵀP X from one field P to another, in place of what that has."""
    store(target, _stack_to_parent(X, _load_one(source)))
